"""One time base for all columns of a log: each step at its bounds, on columns made by hand."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import samples as of
from beaver_ftc_logs.recording import Column, LoggedFailure, RecordedFlight
from products.logs import small

WING = small.vehicle()


def column(t_s, values, note=""):
    return Column(np.asarray(t_s, dtype=float), np.asarray(values, dtype=float), note)


def stamps(step, n=60):
    return np.arange(n) * step


@pytest.mark.parametrize(("t_s", "rate_hz", "says"), [
    (stamps(0.1, 49), None, "has 49 samples of the rates, allowed: at least 50"),
    (stamps(0.1, 50), 10.0, None),
    (stamps(0.25), 4.0, None),
    (stamps(0.2501), None, r"logged at 4 Hz, allowed: at least 4 Hz to tell"),
    (stamps(2.0**-16, 200_000), 20.0, None),
    (stamps(0.999e-5), None, r"logged at 1e\+05 Hz, allowed: up to 100000 Hz, time in seconds"),
    (stamps(1.0 / 20.9), 20.9, None),  # a twentieth more than the most is no reason to average
    (stamps(1.0 / 21.1), 20.0, None),
])  # fmt: skip
def test_rates_that_a_log_may_have(t_s, rate_hz, says):
    if says:
        with pytest.raises(BadInput, match=says):
            of._check_stamps_and_make_time_base("log", t_s, 20.0)
        return
    found, run, step = of._check_stamps_and_make_time_base("log", t_s, 20.0)
    assert 1.0 / step == pytest.approx(rate_hz)
    assert set(run.tolist()) == {0}
    assert (found is t_s) is (rate_hz != 20.0)


@pytest.mark.parametrize(("gap", "gaps"), [(3.49, 0), (3.51, 1)])
def test_a_gap_is_more_than_three_and_a_half_steps(gap, gaps):
    t_s = stamps(0.125)
    t_s[20:] += (gap - 1.0) * 0.125
    t_s[40:] += (gap - 1.0) * 0.125
    run = of._check_stamps_and_make_time_base("log", t_s, 20.0)[1]
    assert run.tolist() == [0] * 20 + [gaps] * 20 + [2 * gaps] * 20


def test_the_usual_step_is_that_of_the_first_fifty_stamps():
    t_s = np.concatenate([stamps(0.1, 26), 2.6 + stamps(0.2, 40)])
    assert of._median_step_of_first_stamps_s(t_s) == pytest.approx(0.1)
    assert of._median_step_of_first_stamps_s(t_s[2:]) == pytest.approx(0.2)
    assert of._median_step_of_first_stamps_s(t_s[:1]) == np.inf
    assert of._median_step_of_first_stamps_s(t_s[:2]) == pytest.approx(0.1)


def test_a_fast_log_is_sampled_over_each_stretch_from_its_first_stamp():
    """To the last stamp, or half a step beyond it; no sample in a gap."""
    t_s = np.array([0.0, 0.1, 0.2, 0.28, 1.0, 1.15, 1.28, 5.0])
    found, run, step = of._regular_time_base(t_s, 0.2)
    np.testing.assert_allclose(found, [0.0, 0.2, 1.0, 1.2, 5.0])
    assert (run.tolist(), step) == ([0, 0, 1, 1, 2], 0.2)
    longer, run, _ = of._regular_time_base(np.array([0.0, 0.31, 2.0]), 0.2)
    np.testing.assert_allclose(longer, [0.0, 0.2, 0.4, 2.0])
    edge = of._regular_time_base(np.array([0.0, 3.49 * 0.2, 2.0]), 0.2)[1]
    assert edge.tolist() == [0] * 4 + [1]


def test_a_column_with_these_very_stamps_is_as_it_is():
    t_s = stamps(0.1, 5)
    same = column(t_s.copy(), np.arange(5.0))
    assert of.values_and_mean_age_at(same, t_s, 0.1) == (same.values, None)
    other = column(t_s + 0.01, np.arange(5.0))
    values, age_s = of.values_and_mean_age_at(other, t_s, 0.1)
    np.testing.assert_array_equal(values, [np.nan, 0.0, 1.0, 2.0, 3.0])
    assert age_s == pytest.approx(0.09)


@pytest.mark.parametrize(("step", "averaged"), [(0.059, True), (0.061, False)])
def test_a_column_of_less_than_six_tenths_of_a_step_is_averaged(step, averaged):
    fast = column(stamps(step, 40), np.arange(40.0))
    t_s = stamps(0.1, 10) + 0.3
    found = of.values_and_mean_age_at(fast, t_s, 0.1)
    expected = (of._interval_means_and_mean_age if averaged else of._latest_values_and_mean_age)(
        fast, *((t_s, 0.1) if averaged else (t_s,))
    )
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1] == expected[1]


def test_a_held_column_is_the_last_value_known():
    held = column([1.0, 2.0, 3.0, 4.0], [5.0, np.nan, 7.0, 8.0])
    values, age_s = of._latest_values_and_mean_age(held, np.array([0.5, 1.0, 2.5, 3.0, 3.75]))
    np.testing.assert_array_equal(values, [np.nan, 5.0, 5.0, 7.0, 7.0])
    assert age_s == pytest.approx((0.0 + 1.5 + 0.0 + 0.75) / 4)
    assert np.isnan(of._latest_values_and_mean_age(held, np.array([0.0, 0.5]))[1])


def test_the_mean_over_the_interval_that_ends_at_a_sample():
    """Its end is in it, its begin is not, to a millionth of a step; of nothing, the last value."""
    fast = column([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.2], [1.0, 2.0, 4.0, np.nan, 16.0, 32.0, 64.0])
    t_s = np.array([-0.5, 0.0, 0.2, 0.4, 0.6, 0.8, 1.2])
    values, delay_s = of._interval_means_and_mean_age(fast, t_s, 0.2)
    np.testing.assert_allclose(values, [np.nan, 1.0, 3.0, 16.0, 32.0, 32.0, 64.0])
    assert delay_s == pytest.approx(0.1)
    near = column([0.1, 0.2 + 1e-8, 0.3], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(
        of._interval_means_and_mean_age(near, np.array([0.2, 0.4]), 0.2)[0], [1.5, 4.0]
    )
    off = column([0.1, 0.2 + 1e-6, 0.3], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(of._interval_means_and_mean_age(off, np.array([0.2, 0.4]), 0.2)[0], [1.0, 3.0])
    both = column([-0.2 + 1e-8, 0.0, 0.2 - 1e-8], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(
        of._interval_means_and_mean_age(both, np.array([0.0, 0.2]), 0.2)[0], [2.0, 4.0]
    )


def recording(n=60, step=0.1, **changes):
    t_s = stamps(step, n)
    values = {"p_rad_s": 0.1, "q_rad_s": 0.2, "r_rad_s": 0.3, "roll": 0.4, "pitch": 0.6}
    columns = {name: column(t_s, size * np.cos(t_s)) for name, size in values.items()}
    return RecordedFlight("log", columns | changes, (LoggedFailure(3.0, "rudder"),), ("said of the log",))


def test_a_log_on_one_time_base():
    """Each surface's share of the commands, labels held, what was said of used columns once."""
    t_s = stamps(0.1)
    given = recording(
        pitch=column(stamps(0.2, 30) + 0.05, np.arange(30.0), "a row is left out"),
        roll=column(t_s, np.arange(60.0), "a row is left out"),
        left_effectiveness=column([1.0, 3.0], [1.0, 0.5]),
        other=column(t_s, t_s, "of no use"),
    )
    found = of.resample(given, WING)
    pitch = np.concatenate([[np.nan], np.repeat(np.arange(30.0), 2)[:59]])
    np.testing.assert_array_equal(found.commands[:, 0], 0.5 * np.arange(60.0) + 0.5 * pitch)
    np.testing.assert_array_equal(found.commands[:, 1], 0.5 * np.arange(60.0) - 0.5 * pitch)
    np.testing.assert_allclose(found.rates, np.outer(np.cos(t_s), [0.1, 0.2, 0.3]))
    assert np.isnan(found.labels[:, 0]).all()
    label = np.where(t_s < 0.99, np.nan, np.where(t_s < 2.99, 1.0, 0.5))
    np.testing.assert_array_equal(found.labels[:, 1], label)
    assert (found.name, found.dt_s, found.signals.shape) == ("log", pytest.approx(0.1), (60, 0))
    assert found.mean_age_s_by_held_column == {"pitch": pytest.approx((30 * 0.05 + 29 * 0.15) / 59)}
    assert found.notes == ("said of the log", "a row is left out")
    assert (found.logged_failures, found.log_stamps_s is given.columns["p_rad_s"].t_s) == (
        given.logged_failures,
        True,
    )
    tail = of.resample(recording(airspeed_m_s=column(t_s, t_s)), small.vehicle(small.TAIL))
    np.testing.assert_array_equal(tail.signals, t_s[:, None])


@pytest.mark.parametrize("step_s", [0.1, 0.01])
def test_a_rate_that_is_no_number_any_more_is_unknown_and_stands_still(step_s):
    """Averaged or as it is; a row without a number now and then is no gap."""
    stamps_s = stamps(step_s, round(6.0 / step_s))
    rate = np.where((stamps_s > 2.9) | (np.arange(len(stamps_s)) % 3 == 1), np.nan, np.cos(stamps_s))
    given = recording(
        p_rad_s=column(stamps_s, rate),
        q_rad_s=column(stamps_s, np.cos(stamps_s)),
        r_rad_s=column(stamps_s, np.sin(stamps_s)),
    )
    found = of.resample(given, WING)
    last_s = stamps_s[np.isfinite(rate)][-1]
    late, early = found.t_s > 3.3, (found.t_s > 0.2) & (found.t_s < 2.8)
    assert np.isnan(found.rates[late, 0]).all()
    assert np.isfinite(found.rates[early, 0]).mean() > 0.6
    assert np.isfinite(found.rates[:, 1:]).all()
    np.testing.assert_allclose(
        found.time_since_change_s_by_column["p_rad_s"][late], found.t_s[late] - last_s, atol=1e-9
    )
    assert found.time_since_change_s_by_column["p_rad_s"][early].max() < 0.5


def test_the_mixer_has_a_row_a_surface():
    tail = small.vehicle(small.TAIL)
    assert of.mixer_matrix(tail).tolist() == [[1.0, 0.0], [0.0, 0.8], [0.5, 0.0]]


MILLION = np.full(60, 1e6)
REFUSED = {
    "missing": ({"roll": None}, "no column roll, allowed: a log that has it; it has p_rad_s, q_rad_s, r_rad"),
    "nothing": ({"roll": column(stamps(0.1), np.full(60, np.nan))}, "column roll holds no number, allowed"),
    "too large": ({"roll": column(stamps(0.1), -1.01 * MILLION)}, r"holds 1.01e\+06, allowed: up to 1e\+06"),
    "degrees": (
        {"q_rad_s": column(stamps(0.1), -1.001e-6 * 60 * MILLION)},
        "column q_rad_s reaches 60.06, allowed: rates in rad/s, up to 60",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_column_that_cannot_be_used_is_told(name):
    changes, says = REFUSED[name]
    columns = {name: one for name, one in {**recording().columns, **changes}.items() if one is not None}
    with pytest.raises(BadInput, match=says):
        of.resample(RecordedFlight("log", columns), WING)


def test_numbers_at_the_limit_are_taken():
    columns = {"roll": column(stamps(0.1), MILLION), "q_rad_s": column(stamps(0.1), 6e-5 * MILLION)}
    assert of.resample(recording(**columns), WING).commands.max() > 4e5


def test_names_that_cannot_be_printed_are_shown_as_they_are_written():
    columns = recording().columns
    del columns["roll"]
    with pytest.raises(BadInput, match=r"'a\\tb'"):
        of.resample(RecordedFlight("log", columns | {"a\tb": columns["pitch"]}), WING)
    with pytest.raises(BadInput, match="it has none"):
        of.resample(RecordedFlight("log", {}), WING)


@pytest.mark.parametrize(("values", "parts"), [
    ([[1.0, 2.0], [1.0, 2.0], [1.0, 3.0]], [(0, 2), (2, 3)]),
    ([[1.0, np.nan], [1.0, np.nan], [0.0, np.nan], [0.0, 0.0]], [(0, 2), (2, 3), (3, 4)]),
    ([[1.0]], [(0, 1)]),
])  # fmt: skip
def test_stretches_of_equal_rows(values, parts):
    assert of.constant_stretches(np.array(values)) == parts


def test_two_flights_of_one_name_are_refused(tmp_path):
    from products.logs import synthetic

    vehicle = small.vehicle(commands=["roll_command"], surfaces={"right": {"roll_command": 1.0}}, labels={})
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        synthetic.write_csv(tmp_path / folder / "one.csv", synthetic.fly(8.0))
    paths = [tmp_path / folder / "one.csv" for folder in "ab"]
    assert [one.name for one in of.load_flights_for_fit(paths[:1], vehicle)] == ["one"]
    with pytest.raises(BadInput, match="two flights are named one: one result would replace the other"):
        of.load_flights_for_fit(paths, vehicle)


@pytest.mark.parametrize(("rate_hz", "says"), [
    (0.02, " (time in ms would be 20 Hz)"), (0.01, " (time in ms would be 10 Hz)"), (0.0099, ""),
    (1.0, " (time in ms would be 1e+03 Hz)"), (1.01, ""), (2e-5, " (time in us would be 20 Hz)"),
    (3e-8, " (time in ns would be 30 Hz)"), (5e-9, ""),
])  # fmt: skip
def test_a_log_too_slow_may_be_one_in_another_unit_of_time(rate_hz, says):
    assert of._other_time_unit_hint(rate_hz) == says


def test_labels_are_the_last_ones_of_each_surface_that_has_them():
    vehicle = small.vehicle(labels={"left": {"column": "left_left", "scale": 0.01}, "right": "right_left"})
    known = RecordedFlight("log", {"left_left": column([1.0, 3.0], [40.0, 70.0])})
    labels = of._labelled_surface_effectiveness(known, vehicle, np.array([0.5, 1.0, 2.9, 3.0]))
    assert np.isnan(labels[:, 0]).all()
    np.testing.assert_allclose(labels[:, 1], [np.nan, 0.4, 0.4, 0.7])


def test_airspeed_and_energy_are_known_where_their_columns_are():
    t_s = stamps(1.0, 8)
    columns = {"alt": column(t_s, 3.0 * t_s), "V": column(t_s, np.full(8, 20.0)), "one": column([0.0], [1.0])}
    base, log = (t_s, np.zeros(8, dtype=int), 1.0), RecordedFlight("log", columns)
    for altitude, speed, there in (("alt", "V", True), ("alt", "W", False), ("one", "V", False)):
        vehicle = small.vehicle(energy={"altitude": altitude, "airspeed": speed}, airspeed=speed)
        climb, airspeed = (
            of._sampled_energy_height_rate_mps(log, vehicle, base),
            of._sampled_airspeed(log, vehicle, t_s, 1.0),
        )
        assert (climb is not None, airspeed is not None) == (there, speed == "V")
        if there:
            np.testing.assert_allclose(climb, [np.nan] * 5 + [3.0] * 3)
    assert (
        of._sampled_energy_height_rate_mps(log, WING, base)
        is of._sampled_airspeed(log, WING, t_s, 1.0)
        is None
    )
