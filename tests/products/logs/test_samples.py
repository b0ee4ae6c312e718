"""One time base for all columns of a log: each step at its bounds, on columns made by hand."""

from dataclasses import fields, replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import samples as of
from beaver_ftc_logs.recording import Column, LoggedFailure, RecordedFlight
from products.logs import small
from products.logs.test_signals import T_S, turning, yawed

WING, WING_RATES = small.vehicle(), tuple(small.RATES.values())


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
            of._time_base("log", t_s, 20.0)
        return
    found, run, step = of._time_base("log", t_s, 20.0)
    assert 1.0 / step == pytest.approx(rate_hz)
    assert set(run.tolist()) == {0}
    assert (found is t_s) is (rate_hz != 20.0)


@pytest.mark.parametrize(("gap", "gaps"), [(3.49, 0), (3.51, 1)])
def test_a_gap_is_more_than_three_and_a_half_steps(gap, gaps):
    t_s = stamps(0.125)
    t_s[20:] += (gap - 1.0) * 0.125
    t_s[40:] += (gap - 1.0) * 0.125
    run = of._time_base("log", t_s, 20.0)[1]
    assert run.tolist() == [0] * 20 + [gaps] * 20 + [2 * gaps] * 20


def test_the_usual_step_is_that_of_the_first_fifty_stamps():
    t_s = np.concatenate([stamps(0.1, 26), 2.6 + stamps(0.2, 40)])
    assert of._median_step_s(t_s) == pytest.approx(0.1)
    assert of._median_step_s(t_s[2:]) == pytest.approx(0.2)
    assert of._median_step_s(t_s[:1]) == np.inf
    assert of._median_step_s(t_s[:2]) == pytest.approx(0.1)


def test_a_fast_log_is_sampled_over_each_stretch_from_its_first_stamp():
    """To the last stamp, or half a step beyond it; no sample in a gap."""
    t_s = np.array([0.0, 0.1, 0.2, 0.28, 1.0, 1.15, 1.28, 5.0])
    found, run, step = of._even_time_base(t_s, 0.2)
    np.testing.assert_allclose(found, [0.0, 0.2, 1.0, 1.2, 5.0])
    assert (run.tolist(), step) == ([0, 0, 1, 1, 2], 0.2)
    longer, run, _ = of._even_time_base(np.array([0.0, 0.31, 2.0]), 0.2)
    np.testing.assert_allclose(longer, [0.0, 0.2, 0.4, 2.0])
    edge = of._even_time_base(np.array([0.0, 3.49 * 0.2, 2.0]), 0.2)[1]
    assert edge.tolist() == [0] * 4 + [1]


def test_a_column_with_these_very_stamps_is_as_it_is():
    t_s = stamps(0.1, 5)
    same = column(t_s.copy(), np.arange(5.0))
    assert of.sample_column(same, t_s, 0.1) == (same.values, None)
    other = column(t_s + 0.01, np.arange(5.0))
    values, age_s = of.sample_column(other, t_s, 0.1)
    np.testing.assert_array_equal(values, [np.nan, 0.0, 1.0, 2.0, 3.0])
    assert age_s == pytest.approx(0.09)


@pytest.mark.parametrize(("step", "averaged"), [(0.059, True), (0.061, False)])
def test_a_column_of_less_than_six_tenths_of_a_step_is_averaged(step, averaged):
    fast = column(stamps(step, 40), np.arange(40.0))
    t_s = stamps(0.1, 10) + 0.3
    found = of.sample_column(fast, t_s, 0.1)
    expected = (of._means_and_age if averaged else of._latest_and_age)(
        fast, *((t_s, 0.1) if averaged else (t_s,))
    )
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1] == expected[1]


def test_a_held_column_is_the_last_value_known():
    held = column([1.0, 2.0, 3.0, 4.0], [5.0, np.nan, 7.0, 8.0])
    values, age_s = of._latest_and_age(held, np.array([0.5, 1.0, 2.5, 3.0, 3.75]))
    np.testing.assert_array_equal(values, [np.nan, 5.0, 5.0, 7.0, 7.0])
    assert age_s == pytest.approx((0.0 + 1.5 + 0.0 + 0.75) / 4)
    assert np.isnan(of._latest_and_age(held, np.array([0.0, 0.5]))[1])


def test_the_mean_over_the_interval_that_ends_at_a_sample():
    """Its end is in it, its begin is not, to a millionth of a step; of nothing, the last value."""
    fast = column([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.2], [1.0, 2.0, 4.0, np.nan, 16.0, 32.0, 64.0])
    t_s = np.array([-0.5, 0.0, 0.2, 0.4, 0.6, 0.8, 1.2])
    values, delay_s = of._means_and_age(fast, t_s, 0.2)
    np.testing.assert_allclose(values, [np.nan, 1.0, 3.0, 16.0, 32.0, 32.0, 64.0])
    assert delay_s == pytest.approx(0.1)
    near = column([0.1, 0.2 + 1e-8, 0.3], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(of._means_and_age(near, np.array([0.2, 0.4]), 0.2)[0], [1.5, 4.0])
    off = column([0.1, 0.2 + 1e-6, 0.3], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(of._means_and_age(off, np.array([0.2, 0.4]), 0.2)[0], [1.0, 3.0])
    both = column([-0.2 + 1e-8, 0.0, 0.2 - 1e-8], [1.0, 2.0, 4.0])
    np.testing.assert_allclose(of._means_and_age(both, np.array([0.0, 0.2]), 0.2)[0], [2.0, 4.0])


def recording(n=60, step=0.1, **changes):
    t_s = stamps(step, n)
    values = {"p_rad_s": 0.1, "q_rad_s": 0.2, "r_rad_s": 0.3, "roll": 0.4, "pitch": 0.6}
    columns = {name: column(t_s, size * np.cos(t_s)) for name, size in values.items()}
    return RecordedFlight("log", columns | changes, (LoggedFailure(3.0, "rudder"),), ("said of the log",))


def test_the_angles_of_a_log_confirm_its_rates():
    """At no bank and no pitch the change of roll is the integral of p, and that of pitch of q."""
    t_s = stamps(0.1, 300)
    rates = {name: column(t_s, 0.1 * k * np.cos(k * t_s)) for k, name in enumerate(WING_RATES, 1)}
    vehicle = small.vehicle(attitude={"roll": "phi", "pitch": "theta"})
    angles = {"phi": column(t_s, 0.1 * np.sin(t_s)), "theta": column(t_s, 0.01 * np.sin(7.0 * t_s))}
    found = of.resample(recording(300, **rates, **angles), vehicle)
    assert found.confirmed_rates == {"p_rad_s"}
    assert not of.resample(recording(300, **rates), vehicle).confirmed_rates


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
    assert found.held_age_s == {"pitch": pytest.approx((30 * 0.05 + 29 * 0.15) / 59)}
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
    np.testing.assert_allclose(found.unchanged_s["p_rad_s"][late], found.t_s[late] - last_s, atol=1e-9)
    assert found.unchanged_s["p_rad_s"][early].max() < 0.5


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


@pytest.mark.parametrize("weight", [1e308, -1e308, 11.0])
def test_weights_that_make_a_command_too_large_are_refused(weight):
    """The column reaches 1e5: times 10 it would be at the limit."""
    vehicle = small.vehicle(surfaces={"left": {"roll": 1.0}, "right": {"pitch": weight}})
    log = recording(pitch=column(stamps(0.1), 0.1 * MILLION))
    with pytest.raises(BadInput, match="log: the command of right is too large, allowed: weights in"):
        of.resample(log, vehicle)


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
    labels = of._sampled_labels(known, vehicle, np.array([0.5, 1.0, 2.9, 3.0]))
    assert np.isnan(labels[:, 0]).all()
    np.testing.assert_allclose(labels[:, 1], [np.nan, 0.4, 0.4, 0.7])


def test_airspeed_and_energy_are_known_where_their_columns_are():
    t_s = stamps(1.0, 8)
    columns = {"alt": column(t_s, 3.0 * t_s), "V": column(t_s, np.full(8, 20.0)), "one": column([0.0], [1.0])}
    base, log = (t_s, np.zeros(8, dtype=int), 1.0), RecordedFlight("log", columns)
    for altitude, speed, there in (("alt", "V", True), ("alt", "W", False), ("one", "V", False)):
        vehicle = small.vehicle(energy={"altitude": altitude, "airspeed": speed}, airspeed=speed)
        climb, airspeed = (
            of._sampled_height_rate(log, vehicle, base),
            of._sampled_airspeed(log, vehicle, t_s, 1.0),
        )
        assert (climb is not None, airspeed is not None) == (there, speed == "V")
        if there:
            np.testing.assert_allclose(climb, [np.nan] * 5 + [3.0] * 3)
    assert of._sampled_height_rate(log, WING, base) is of._sampled_airspeed(log, WING, t_s, 1.0) is None


DEG, CDEG = np.pi / 180.0, np.pi / 18000.0
IN_SI = {  # column: what its number is multiplied by, and what is added
    "gx": (DEG * 0.1, -DEG * 2.0), "gy": (CDEG, 0.0), "gz": (1.0, 0.0), "pwm": (0.0025, -3.75),
    "share": (0.01, 0.0), "alt": (0.3048, 0.0), "tas": (1852.0 / 3600.0, 0.0), "phi": (DEG, 0.0),
    "theta": (1e-3, 0.0), "psi": (CDEG, 0.0),
    "acc": (-9.80665, 9.80665 * 0.3), "wind": (0.44704, 0.0), "alpha": (-DEG, 0.0), "extra": (2.0, 7.0),
    "left_left": (1.0, 0.0), "other": (1.0, 0.0), "out": (1.0, 0.0),
}  # fmt: skip
EVERYWHERE = {
    "rates": {
        "p": {"column": "gx", "unit": "deg/s", "scale": 0.1, "offset": -2.0},
        "q": {"column": "gy", "unit": "cdeg/s"}, "r": "gz",
    },
    "commands": [{"column": "pwm", "scale": 0.0025, "offset": -3.75}, {"column": "share", "unit": "%"}],
    "surfaces": {"right": {"pwm": 0.5, "share": 0.4}, "left": {"pwm": 0.3, "share": -0.2}},
    "signals": [{"column": "wind", "unit": "mph"}],
    "labels": {"left": {"column": "left_left", "scale": 0.01}},
    "outputs": {"left": {"column": "out", "scale": 3.0}},
    "attitude": {
        "roll": {"column": "phi", "unit": "deg"}, "pitch": {"column": "theta", "unit": "mrad"},
        "yaw": {"column": "psi", "unit": "cdeg"},
    },
    "acceleration": {"column": "acc", "unit": "g", "scale": -1.0, "offset": 0.3},
    "airspeed": {"column": "tas", "unit": "kt"},
    "energy": {"altitude": {"column": "alt", "unit": "ft"}, "airspeed": {"column": "tas", "unit": "kt"}},
    "flow": {
        "alpha_rad": {"column": "alpha", "unit": "deg", "scale": -1.0},
        "dpt": {"column": "extra", "scale": 2.0, "offset": 7.0},
    },
}  # fmt: skip


def test_every_column_that_a_vehicle_names_is_in_si_but_labels_and_outputs():
    """These are converted where they are read. What it does not name is as it was, notes and stamps too."""
    vehicle, numbers = small.vehicle(EVERYWHERE | {"name": "all"}), np.array([3.0, -5.0, np.nan])
    given = {name: column([1.0, 2.0, 4.0], numbers, f"of {name}") for name in IN_SI}
    found = of.convert_to_si(RecordedFlight("log", given, (LoggedFailure(1.0, "fin"),), ("noted",)), vehicle)
    assert list(found.columns) == list(IN_SI)
    assert (found.name, found.logged_failures, found.notes) == (
        "log",
        (LoggedFailure(1.0, "fin"),),
        ("noted",),
    )
    for name, (factor, offset) in IN_SI.items():
        one = found.columns[name]
        np.testing.assert_allclose(one.values, factor * numbers + offset, rtol=1e-12, err_msg=name)
        assert (one.t_s is given[name].t_s, one.note) == (True, f"of {name}")
    assert set(vehicle.column_names()) == set(IN_SI) - {"other"}


def test_what_a_reader_is_asked_for_is_what_the_vehicle_names():
    """The option comes before the vehicle file, and the time is no column of the flight."""
    vehicle = small.vehicle(
        EVERYWHERE | {"name": "all", "reader": "alfa", "time": {"column": "clock", "unit": "us"}}
    )
    names = ["gx", "gy", "gz", "pwm", "share", "wind", "phi", "theta", "psi", "acc", "tas", "alt", "alpha"]
    names += ["extra", "left_left", "out"]
    assert of._reader_arguments(vehicle, None) == ("alfa", ("clock", "us"), names)
    assert of._reader_arguments(vehicle, "ulog") == ("ulog", ("clock", "us"), names)
    assert of._reader_arguments(WING, None)[:2] == (None, None)


IN_G = np.where(T_S < 50.0, -1.0, 20.0)
ATTITUDE = {"roll": "phi", "pitch": "theta", "yaw": "psi"}


def turned(**changes):
    """The recording of a body that turns, with all its angles; changes: columns of other numbers."""
    phi, theta, rates = turning()
    values = dict(zip(small.RATES.values(), rates, strict=True))
    values |= {"phi": phi, "theta": theta, "psi": yawed(), "acc": -9.8 + 0.1 * np.sin(T_S)}
    values |= {"roll": 0.3 * np.sin(T_S), "pitch": 0.2 * np.cos(1.3 * T_S)} | changes
    return RecordedFlight("log", {name: column(T_S, one) for name, one in values.items()})


@pytest.mark.parametrize(("changes", "keys", "says"), [
    ({}, {}, None),
    ({"psi": -yawed()}, {}, "the change of psi is -1 times the integral of r_rad_s: one of them has the "
     "other sign, `scale: -1` fits"),
    ({"psi": -yawed()}, {"attitude": {"roll": "phi"}}, None),
    ({"psi": -yawed(), "phi": np.rad2deg(turning()[0])}, {}, "phi is in deg, a factor of 0.01745 fits"),
    ({"acc": IN_G}, {}, "acc: is 1 m/s2 on the middle of the flight, 1 g is 9.807: it is in g, a factor of "
     "9.807 fits"),
    ({"acc": IN_G, "psi": -yawed()}, {}, "the change of psi is"),
    ({"acc": IN_G}, {"acceleration": None}, None), ({"acc": IN_G}, {"acceleration": "elsewhere"}, None),
    # a clipped roll rate is no integral of its angle
    ({"p_rad_s": np.minimum(turning()[2][0], 0.3), "psi": -yawed()}, {}, None),
    ({"q_rad_s": np.sin(2.1 * T_S), "spare": turning()[2][1]}, {}, None),
    *((
        {"q_rad_s": np.sin(2.1 * T_S), "spare": turning()[2][1]}, key,
        "but spare (1.00): spare is the pitch rate",
    ) for key in (
        {"signals": ["spare"]}, {"flow": {"beta_rad": "spare"}}, {"commands": ["roll", "pitch", "spare"]},
    )),
])  # fmt: skip
def test_rates_angles_and_gravity_that_contradict_one_another_are_refused(changes, keys, says):
    vehicle = small.vehicle(**{"attitude": ATTITUDE, "acceleration": "acc", **keys})
    if says is None:
        assert of.resample(turned(**changes), vehicle).name == "log"
        return
    with pytest.raises(BadInput) as refused:
        of.resample(turned(**changes), vehicle)
    said = str(refused.value)
    assert said.startswith("log: ")
    assert says in said
    assert said.endswith(", allowed: what the vehicle file says, or its `unit` mended")


@pytest.mark.parametrize(("largest", "says"), [
    (59.9, None), (60.1, " (deg/s would be 1.05 rad/s: `unit: deg/s`)"),
    (3437.0, " (deg/s would be 60 rad/s: `unit: deg/s`)"), (3438.0, ""),
])  # fmt: skip
def test_a_rate_that_no_vehicle_turns_at_may_be_in_degrees(largest, says):
    for name in small.RATES.values():
        one = column(stamps(0.1), np.where(np.arange(60) == 30, -largest, 0.01 * np.sin(np.arange(60))))
        if says is None:
            assert of.resample(recording(**{name: one}), WING).rates.min() == -largest
            continue
        with pytest.raises(BadInput) as refused:
            of.resample(recording(**{name: one}), WING)
        assert str(refused.value) == (
            f"log: column {name} reaches {largest:g}, allowed: rates in rad/s, up to 60{says}"
        )


@pytest.mark.parametrize(("spread", "says"), [(2.99, []), (3.01, ["3.01"])])
def test_a_rate_that_spreads_as_hardly_an_aircraft_does_is_said(spread, says):
    """Of the rates alone: a command may be anything."""
    swings = column(stamps(0.1), spread * np.array([1.0, -1.0] * 30))
    found = of.resample(recording(r_rad_s=swings, roll=swings), WING)
    assert [note for note in found.notes if "spreads" in note] == [
        f"r_rad_s: spreads {size} rad/s, as hardly an aircraft does: is it in deg/s? a factor of 0.01745 "
        "fits (`unit: deg/s`)"
        for size in says
    ]


def test_too_few_samples_of_a_fast_log_are_told_with_its_span():
    t_s = 5.0 + stamps(0.001, 2000)
    with pytest.raises(BadInput) as refused:
        of._time_base("log", t_s, 20.0)
    assert str(refused.value) == (
        "log: 2000 rows within 2 s are 41 samples at 20 Hz, allowed: at least 50; is time in another unit?"
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_sample_is_clipped_where_any_of_its_rates_was_at_its_last_row(axis):
    """Held at 2 from row 12 to 29, ten rows after it came there; sampled every third row, a row later."""
    values = np.sin(np.arange(60.0))
    values[12:30] = 2.0
    rates = [column(stamps(0.1), values if k == axis else np.cos(np.arange(60.0))) for k in range(3)]
    found = of._is_rate_clipped(rates, 0.11 + 0.3 * np.arange(19))
    rows = 1 + 3 * np.arange(19)
    assert found.tolist() == [21 <= row < 30 for row in rows]
    assert not of._is_rate_clipped(rates, np.array([-1.0])).any()
    log = recording(**dict(zip(small.RATES.values(), rates, strict=True)))
    assert np.flatnonzero(of.resample(log, WING).is_rate_clipped).tolist() == [*range(21, 30)]


def test_how_long_a_column_has_stood_still_counts_its_age():
    """Rows without a number stand still; before the first row nothing does."""
    values = np.concatenate([np.arange(10.0), np.full(20, 9.5), [np.nan, np.nan, 4.0]])
    one = column(stamps(0.5, 33), values)
    found = of._unchanged_s(one, np.array([-1.0, 4.7, 10.8, 11.2, 15.6, 16.0, 17.0]))
    np.testing.assert_allclose(found, [0.0, 0.2, 0.3, 6.2, 10.6, 0.0, 1.0])


@pytest.mark.parametrize(("age_s", "stale"), [(0.69, False), (0.71, True)])
def test_a_held_value_is_stale_three_and_a_half_usual_steps_after_its_row(age_s, stale):
    """Of the column's own step, or that of the samples where these are rarer; of its only row, the latter."""
    held, only = column(stamps(0.2, 60), np.arange(60.0)), column([11.8], [1.0])
    at = np.array([11.8 + age_s])
    assert of._is_held_value_stale(held, at, 0.1).tolist() == [stale]
    assert of._is_held_value_stale(held, at, 0.25).tolist() == [False]
    assert of._is_held_value_stale(column(stamps(0.1, 119), np.arange(119.0)), at, 0.2).tolist() == [stale]
    assert of._is_held_value_stale(only, at, 0.2).tolist() == [stale]


def filled(n=12, first=0.0, **changes):
    """Samples of which every field says something, and no two rows alike."""
    at = first + np.arange(float(n))
    per_row = {
        "t_s": 0.1 * at, "rates": at[:, None] + [0.1, 0.2, 0.3], "commands": at[:, None] - [0.4, 0.5],
        "signals": at[:, None] * 3.0, "labels": 1.0 / (1.0 + at[:, None] + [0.0, 0.7]),
        "stretch_number": (at >= 5.0).astype(np.int64), "airspeed": 20.0 + at, "is_rate_clipped": at % 3 == 1,
        "energy_height_rate_mps": -2.0 - at,
    }  # fmt: skip
    given = {
        "name": "all", "dt_s": 0.1, "held_age_s": {"roll": 0.02},
        "logged_failures": (LoggedFailure(3.0, "fin"),), "log_stamps_s": 0.01 * np.arange(99.0),
        "notes": ("one",),
        "unchanged_s": {"roll": 4.0 * at, "pitch": 5.0 * at},
        "noise_ma_coefficients": (1.0, 0.5), "fit_weight": 1.5, "n_log_parts": 1,
        "confirmed_rates": frozenset({"roll", "yaw"}),
    }  # fmt: skip
    assert {one.name for one in fields(of.Samples)} == {*per_row, *given}
    return of.Samples(**(per_row | given | changes)), per_row, given


def assert_same(found, expected):
    """All fields of samples, as they are to be."""
    assert {one.name for one in fields(found)} == expected.keys()
    for name, value in expected.items():
        one = getattr(found, name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(one, value, err_msg=name)
        elif name == "unchanged_s":
            assert one.keys() == value.keys()
            for key in value:
                np.testing.assert_array_equal(one[key], value[key], err_msg=key)
        else:
            assert one == value, name


def test_some_rows_of_samples_are_those_rows_of_every_field():
    whole, per_row, given = filled()
    rows = slice(3, 8)
    still = {name: one[rows] for name, one in given["unchanged_s"].items()}
    cut = {name: one[rows] for name, one in per_row.items()}
    expected = {**given, **cut, "unchanged_s": still, "log_stamps_s": per_row["t_s"][rows]}
    assert_same(of._select_rows(whole, rows), expected)
    bare = replace(whole, airspeed=None, is_rate_clipped=None, energy_height_rate_mps=None)
    without = {"airspeed": None, "is_rate_clipped": None, "energy_height_rate_mps": None}
    assert_same(of._select_rows(bare, rows), expected | without)
    assert of.first_samples(whole, 12) is whole
    assert of.first_samples(whole, 11).rates.tolist() == per_row["rates"][:11].tolist()


def test_stretches_one_after_the_other_are_samples_with_a_gap_between():
    """The second has a gap of its own; remarks are said once, after what is said of the whole."""
    (one, *_), (other, *_) = filled(4), filled(9, first=20.0, notes=("two", "one"))
    other = replace(other, stretch_number=np.repeat([7, 9], [6, 3]), dt_s=0.3, name="other")
    other = replace(other, confirmed_rates=frozenset({"pitch", "yaw"}))
    found = of._concatenate_samples("long", [one, other], 5)
    per_row, (_, _, given) = {}, filled()
    for name in ("t_s", "rates", "commands", "signals", "labels", "airspeed", "is_rate_clipped"):
        per_row[name] = np.concatenate([getattr(one, name), getattr(other, name)])
    per_row["energy_height_rate_mps"] = np.concatenate([-2.0 - np.arange(4.0), -22.0 - np.arange(9.0)])
    note = "a long log, read in 5 parts: 13 samples of it, spread evenly, are looked at"
    at = np.concatenate([np.arange(4.0), 20.0 + np.arange(9.0)])
    assert_same(found, given | per_row | {
        "name": "long", "n_log_parts": 5, "notes": (note, "one", "two"), "log_stamps_s": per_row["t_s"],
        "stretch_number": np.repeat([0, 1, 2], [4, 6, 3]), "confirmed_rates": frozenset({"yaw"}),
        "unchanged_s": {"roll": 4.0 * at, "pitch": 5.0 * at},
    })  # fmt: skip


def test_what_the_airspeed_makes_of_a_log_on_its_time_base():
    """Each surface by its own power, rates and signals by the airspeed less the reference, within bounds."""
    t_s = stamps(0.1)
    speed = np.linspace(5.0, 80.0, 60)
    speed[7] = np.nan
    keys = {
        "signals": ["wind"], "airspeed": "tas", "reference_airspeed_mps": 20.0,
        "airspeed_powers": {"left": 3.0},
    }  # fmt: skip
    given = recording(tas=column(t_s, speed), wind=column(t_s, 1.0 + np.sin(t_s)))
    found = of.resample(given, small.vehicle(**keys))
    plain = of.resample(given, small.vehicle(signals=["wind"]))
    ratio = np.nan_to_num(np.clip((speed / 20.0) ** 2, 0.1, 10.0), nan=1.0) ** 0.5
    assert [(ratio**2 <= 0.1).sum(), (ratio**2 >= 10.0).sum(), (ratio == 1.0).sum()] == [2, 14, 1]
    np.testing.assert_allclose(found.commands[:, 0], plain.commands[:, 0] * ratio**2)
    np.testing.assert_allclose(found.commands[:, 1], plain.commands[:, 1] * ratio**3)
    np.testing.assert_array_equal(found.rates, plain.rates)
    before = np.column_stack([plain.rates, plain.signals])
    np.testing.assert_allclose(found.signals, np.hstack([plain.signals, before * (ratio[:, None] - 1.0)]))
    np.testing.assert_array_equal(found.airspeed, speed)
    assert plain.airspeed is None


def test_of_a_log_in_parts_every_so_many_stretch_is_kept(monkeypatch):
    """Nine parts, each of which begins with the end of the one before, in stretches of 4 samples, of which 20
    samples are kept at most: each stretch that is begun before is not begun again, and once there are more
    than five every second one is left out, and of those that come."""
    monkeypatch.setattr(of, "MAX_FIT_SAMPLES", 20)
    monkeypatch.setattr(of, "_FIT_SAMPLES", 4)
    parts = [filled(14, first=10.0 * k, stretch_number=np.zeros(14, dtype=np.int64))[0] for k in range(9)]
    monkeypatch.setattr(of, "read_vehicle_parts", lambda *asked: parts)
    monkeypatch.setattr(of, "resample", lambda recording, vehicle: recording)
    found = of._read_flight_for_fit(of.Path("logs/long.csv"), WING, None)
    # of the first part samples 0 to 13 in stretches of 4, 4, 4 and 2; of each other 10 new ones in 4, 4 and 2
    begins = [(0, 4), (4, 4), (8, 4), (12, 2)]
    begins += [(10 * k + 4 + 4 * j, min(4, 10 - 4 * j)) for k in range(1, 9) for j in range(3)]
    kept, every = [], 1
    for number, stretch in enumerate(begins):
        if number % every == 0:
            kept.append(stretch)
        if (number - 3) % 3 == 0 and number > 3:  # the end of a part but the first
            while len(kept) * 4 > 20:
                kept, every = kept[::2], 2 * every
    assert found.t_s == pytest.approx(0.1 * np.array([k for at, n in kept for k in range(at, at + n)]))
    assert found.stretch_number.tolist() == [j for j, (_, n) in enumerate(kept) for _ in range(n)]
    assert (found.name, found.n_log_parts) == ("long", 9)
    monkeypatch.setattr(of, "read_vehicle_parts", lambda *asked: parts[:1])
    assert of._read_flight_for_fit(of.Path("logs/short.csv"), WING, None) is parts[0]


def test_flights_come_one_by_one_and_a_long_one_in_all_its_parts(monkeypatch):
    """What a fit took of the long one is not what is diagnosed."""
    flights = [filled(name=name, n_log_parts=parts)[0] for name, parts in (("a", 1), ("b", 3), ("c", 1))]
    asked = []

    def parts_of(path, vehicle, reader_name):
        asked.append((path, vehicle, reader_name))
        return iter(["b-1", "b-2", "b-3"])

    paths = [of.Path(name) for name in "abc"]
    loaded = flights, (paths, WING, "ulog")
    monkeypatch.setattr(of, "load_flights_for_fit", lambda *given: loaded[0] if given == loaded[1] else [])
    monkeypatch.setattr(of, "read_vehicle_parts", parts_of)
    monkeypatch.setattr(of, "resample", lambda recording, vehicle: (recording, vehicle))
    found = [*of.stream_flights(paths, WING, "ulog")]
    assert found == [flights[0], *((part, WING) for part in ("b-1", "b-2", "b-3")), flights[2]]
    assert asked == [(paths[1], WING, "ulog")]
