"""Other days: which they are, what each change makes of a flight by another road, and how they are told."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.recorded import other_days
from beaver_ftc_logs.recorded.other_days import (
    apply_day_changes,
    unchanged_day,
)
from kept import in_short
from products.logs import small

MODEL = small.model()
PAST = np.array(MODEL.past_coefficients)
NOISE = np.array(MODEL.residual_covariance)


CHANGES = {
    "nothing": {},
    "trim": {"trim_shift_commands": np.array([0.02, -0.03])},
    "neutral": {"neutral_shift_commands": np.array([0.02, -0.03])},
    "own": {"surface_gains": np.array([0.9, 1.2])},
    "gain": {"common_gain": 1.25},
    "late": {"command_delay_s": 0.04},
    "livelier": {"motion_scale": 1.5},
    "calmer": {"motion_scale": 0.6},
    "noise": {"noise_ratio": 1.5},
    "noise, calmer": {"noise_ratio": 1.2, "motion_scale": 0.8},
    "drift": {"trim_drift_sd_commands": 0.01},
}


@pytest.fixture(scope="module")
def flown():
    samples = small.flight(MODEL, 700, lost=((1, 300, 400, 0.5),))
    labels = samples.labels.copy()
    labels[:20] = np.nan
    return replace(samples, labels=labels)


@pytest.mark.parametrize("name", CHANGES)
def test_what_a_day_makes_of_a_flight(changed, flown, name):
    other = apply_day_changes(replace(unchanged_day(2), **CHANGES[name]), flown, PAST, NOISE)
    assert not changed({"commands": other.commands[::100], "rates": other.rates[::100],
          "all": [in_short(other.commands), in_short(other.rates)]})  # fmt: skip


def slow(values):
    """Mean over 30 s about each sample, of 300 from 15 s before on, the ends repeated."""
    n = len(values)
    at = np.clip(np.arange(n)[:, None] + np.arange(-150, 150), 0, n - 1)
    return values[at].mean(axis=1)


@pytest.mark.parametrize("name", ["gain", "own", "livelier", "calmer", "trim", "neutral"])
def test_a_day_by_hand(flown, name):
    """Motion about the slow mean is commanded anew, the slow mean is kept; trim acts behind the fault."""
    day = replace(unchanged_day(2), **CHANGES[name])
    other = apply_day_changes(day, flown, PAST, NOISE)
    mean = slow(flown.commands)
    commands = mean + (flown.commands - mean) * day.motion_scale / (day.common_gain * day.surface_gains)
    left = np.where(np.isfinite(flown.labels), flown.labels, 1.0)
    np.testing.assert_allclose(
        other.commands, commands + day.neutral_shift_commands + day.trim_shift_commands / left, atol=1e-12
    )
    mean = slow(flown.rates)
    rates = mean + day.motion_scale * (flown.rates - mean)
    if name != "calmer":
        np.testing.assert_allclose(other.rates, rates, atol=1e-12)
    else:  # the air moves it as much as before: what is missing is added
        added = other.rates - rates
        size = 0.8 * np.sqrt(response_to_noise())
        np.testing.assert_allclose(added.std(axis=0), size, rtol=0.25)


def response_to_noise():
    """Variance of the rates that white moments make, through the model's own past."""
    a = np.vstack([PAST.T, np.eye(3, 6)])
    p, q = np.zeros((6, 6)), np.zeros((6, 6))
    q[:3, :3] = NOISE
    for _ in range(500):
        p = a @ p @ a.T + q
    return np.diag(p)[:3]


def test_air_by_its_recursion():
    """Past samples of the rates alone, newest first; what signals do is no air."""
    past = np.vstack([PAST, [[9.0, 9.0, 9.0]]])  # a signal's row
    found = other_days._response_to_noise(np.random.default_rng(3), past, NOISE, 40)
    moments = np.random.default_rng(3).standard_normal((40, 3)) @ np.linalg.cholesky(NOISE).T
    one = two = np.zeros(3)
    for k in range(40):
        now = one @ PAST[:3] + two @ PAST[3:] + moments[k]
        np.testing.assert_allclose(found[k], now, atol=1e-14)
        one, two = now, one


def test_a_wander_of_its_length():
    found = other_days._coloured_noise(np.random.default_rng(3), (400_000, 2), 50.0)
    np.testing.assert_allclose(found[1000:].std(axis=0), 1.0, rtol=0.05)
    for lag in (1, 50):
        both = (found[1000:-lag] * found[1000 + lag :]).mean(axis=0)
        np.testing.assert_allclose(both, np.exp(-lag / 50.0), atol=0.05)
    white = np.random.default_rng(3).standard_normal((400_000, 2))
    keep = np.exp(-1.0 / 50.0)
    np.testing.assert_allclose(found[1], keep * found[0] + np.sqrt(1.0 - keep**2) * white[1])


@pytest.mark.parametrize("length", [0.4, -0.4, 0.0])
def test_commands_that_act_later_were_logged_earlier(length):
    values = np.column_stack([np.arange(6.0), np.arange(6.0) ** 2])
    found = other_days._shifted(values, length)
    at = np.clip(np.arange(6) + length, 0, 5)
    np.testing.assert_allclose(found[:, 0], at)
    np.testing.assert_allclose(found[:, 1], np.interp(at, np.arange(6), values[:, 1]))
