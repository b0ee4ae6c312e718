"""Other days made of a flight: each change is what the vehicle's equation says, seen from the moments."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.recorded.other_days import drawn, grid, nominal, on
from beaver_ftc_logs.samples import Samples

PAST, NOISE = 0.5 * np.eye(3), 1e-4 * np.eye(3)


@pytest.fixture
def samples():
    rng = np.random.default_rng(1)
    n = 4000
    labels = np.ones((n, 2))
    labels[1000:2000, 1] = 0.4
    t_s = np.arange(n) / 10.0
    commands = 0.1 + 0.03 * np.sin(2.0 * t_s)[:, None] * np.array([1.0, -0.5])
    rates = 0.1 * rng.standard_normal((n, 3))
    run = np.zeros(n, dtype=np.int64)
    return Samples("one", t_s, rates, commands, np.empty((n, 0)), labels, run, 0.1, {}, (), t_s)


def test_the_day_as_it_was(samples):
    same = on(nominal(2), samples, PAST, NOISE)
    np.testing.assert_allclose(same.commands, samples.commands, atol=1e-15)
    np.testing.assert_allclose(same.rates, samples.rates, atol=1e-15)


def test_another_trim_is_one_moment_whatever_is_left_of_the_surface(samples):
    trim = np.array([0.02, -0.03])
    other = on(replace(nominal(2), trim=trim), samples, PAST, NOISE)
    moment = samples.labels * (other.commands - samples.commands)
    np.testing.assert_allclose(moment, np.tile(trim, (len(moment), 1)), atol=1e-12)


def test_with_more_gain_less_command_moves_as_much(samples):
    other = on(replace(nominal(2), gain=1.25, own=np.array([1.0, 0.8])), samples, PAST, NOISE)
    middle = slice(500, -500)
    was, now = (np.ptp(one.commands[middle], axis=0) for one in (samples, other))
    np.testing.assert_allclose(now * np.array([1.25, 1.0]), was, rtol=1e-2)
    np.testing.assert_allclose(
        other.commands[middle].mean(axis=0), samples.commands[middle].mean(axis=0), atol=1e-4
    )


def test_late_commands_are_logged_earlier(samples):
    """A command that acts 0.04 s later stands 0.04 s earlier in a log whose rates are the same."""
    other = on(replace(nominal(2), late_s=0.04), samples, PAST, NOISE)
    wave = 0.1 + 0.03 * np.sin(2.0 * (samples.t_s + 0.04))
    np.testing.assert_allclose(other.commands[10:-10, 0], wave[10:-10], atol=2e-3)


def test_more_noise_is_that_of_the_model(samples):
    other = on(replace(nominal(2), noise=2.0), samples, PAST, NOISE)
    added = other.rates - samples.rates
    assert added.var(axis=0) == pytest.approx(3.0 * 1e-4 / (1.0 - 0.25), rel=0.15)


def test_drawn_days_are_the_same_each_time_and_differ():
    assert drawn(2, range(3))[1].gain == drawn(2, range(1, 2))[0].gain
    assert len({day.gain for day in drawn(2, range(16))}) == 16
    assert len(grid(np.array([[0.5, 0.5], [0.5, -0.5]]), ["roll", "pitch"])) == 21


def test_drawn_days_differ_as_much_as_is_said():
    """Over 900 days of four surfaces; ratios in their logarithms, what can only be more is half a bell."""
    days = drawn(4, range(900))
    assert len({day.name for day in days}) == len({day.gain for day in days}) == 900
    bells = {
        "trim": (np.array, 0.015), "neutral": (np.array, 0.01), "own": (np.log, 0.03), "gain": (np.log, 0.1),
        "late_s": (np.array, 0.02), "excitation": (np.log, 0.25),
    }  # fmt: skip
    for name, (of, spread) in bells.items():
        values = of([getattr(day, name) for day in days])
        assert np.std(values) == pytest.approx(spread, rel=0.1), name
        assert np.mean(values) == pytest.approx(0.0, abs=0.15 * spread), name
    for name, least, spread in (("noise", 1.0, 0.3), ("drift", 0.0, 0.006)):
        more = np.array([getattr(day, name) for day in days]) - least
        assert more.min() >= 0.0, name
        assert np.sqrt(np.mean(more**2)) == pytest.approx(spread, rel=0.1), name
