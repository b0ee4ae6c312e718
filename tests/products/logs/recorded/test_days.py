"""Other days: which they are, what each change makes of a flight by another road, and how they are told."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import FilterSettings
from beaver_ftc_logs.recorded import benchmark, other_days
from beaver_ftc_logs.recorded.other_days import (
    DayChanges,
    apply_day_changes,
    one_change_days,
    random_days,
    unchanged_day,
)
from kept import in_short
from products.logs import small

MODEL = small.model()
LOST = ((1, 300, 400, 0.5), (0, 600, 700, 0.4))
MIXER = np.array([[0.5, 0.5], [0.5, -0.5]])
PAST = np.array(MODEL.past_coefficients)
NOISE = np.array(MODEL.residual_covariance)


def test_the_days_on_which_one_thing_changes(changed):
    assert not changed([vars(day) for day in one_change_days(MIXER, ["roll", "pitch"])])


def test_drawn_days(changed):
    assert not changed([vars(day) for day in random_days(2, range(7, 9))])
    assert [list(seeds) for seeds in (other_days.TUNING_SEEDS, other_days.TEST_SEEDS)] == [
        [0, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 12, 13, 14, 15],
    ]  # fmt: skip


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


ROW = dict(zip((*benchmark.LABEL_TITLES, "beside"), (0.9, 0.8, 0.7, 0.1, 0.6, 0.5), strict=True))


def test_mean_and_worst_of_days():
    """The worst is the least, of the error the largest."""
    rows = [ROW, {key: value + 0.05 for key, value in ROW.items()}]
    found = other_days._summarize_days("drawn", rows)
    assert found["kind"] == "drawn"
    assert found["mean"] == {key: pytest.approx(value + 0.025) for key, value in ROW.items()}
    assert found["worst"] == ROW | {"mean_error": pytest.approx(0.15)}


@pytest.fixture(scope="module")
def data():
    flight = small.flight(MODEL, 1000, lost=LOST)
    return benchmark.DataSet("set", MODEL.vehicle, (), (flight,))


def test_a_labelled_flight_on_other_days(changed, monkeypatch, data):
    """As it was: the benchmark's own figures of its halves. Quick settings: one delay, few levels."""
    quick = FilterSettings(delays_s=[0.0], level_step=0.25, levels={"right": [0.4], "left": [0.5]})
    monkeypatch.setattr(benchmark, "whole_settings", lambda usable_flights, data: quick)
    monkeypatch.setattr(other_days, "one_change_days", lambda mixer, commands: [unchanged_day(2)])
    monkeypatch.setattr(other_days, "random_days", lambda surfaces, seeds: random_days(surfaces, seeds[:1]))
    document = other_days._test_data_set(data)
    assert not changed(document)
    assert [(row["kind"], row["day"]) for row in document["rows"]] == [
        ("one change", "as it was"), ("drawn, settings chosen on these", "drawn 0"),
        ("drawn, not looked at", "drawn 8"),
    ]  # fmt: skip
    monkeypatch.setattr(benchmark, "detector_names", lambda: ["bank-of-filters", "sliding-least-squares"])
    monkeypatch.setattr(benchmark, "diagnose_by_freeze_rule", lambda *given: None)
    given = replace(data, recordings=data.flights)
    ours, beside = benchmark._compare_methods(given)["rows"]
    as_it_was = document["rows"][0]
    for key in benchmark.LABEL_TITLES:
        assert as_it_was[key] == pytest.approx(ours[key])
    assert as_it_was["beside"] == pytest.approx(beside["classes"])


def test_only_labelled_data_sets_have_other_days(monkeypatch, tmp_path, data):
    bare = replace(data, flights=(replace(data.flights[0], labels=np.full((1000, 2), np.nan)),))
    monkeypatch.setattr(other_days, "_test_data_set", lambda one: one.name)
    monkeypatch.setattr(benchmark, "load_data_sets", lambda folder: [bare, data])
    assert other_days.run_other_days(tmp_path) == {"sets": ["set"]}
    mixed = replace(data, name="mixed", flights=(*data.flights, *bare.flights))
    late = replace(data, name="late", flights=(*bare.flights, *data.flights))
    monkeypatch.setattr(benchmark, "load_data_sets", lambda folder: [late, mixed])
    assert other_days.run_other_days(tmp_path) == {"sets": ["mixed"]}
    monkeypatch.setattr(benchmark, "load_data_sets", lambda folder: [bare])
    with pytest.raises(BadInput, match="holds no labelled flight, allowed: one with labels"):
        other_days.run_other_days(tmp_path)


def test_a_day_that_nothing_changes_is_its_defaults():
    same = unchanged_day(3)
    assert [
        values.tolist()
        for values in (same.trim_shift_commands, same.neutral_shift_commands, same.surface_gains)
    ] == [
        [0.0] * 3,
        [0.0] * 3,
        [1.0] * 3,
    ]
    bare = DayChanges("x", same.trim_shift_commands, same.neutral_shift_commands, same.surface_gains)
    assert (
        bare.common_gain,
        bare.command_delay_s,
        bare.motion_scale,
        bare.noise_ratio,
        bare.trim_drift_sd_commands,
    ) == (
        1.0,
        0.0,
        1.0,
        1.0,
        0.0,
    )
