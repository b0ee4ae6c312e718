"""Dead, clipped and jumping signals, and what mechanics says of units: on columns made by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc_logs import physics, signals
from beaver_ftc_logs.recording import Column
from samples import samples

T_S = np.arange(0.0, 60.0, 0.05)


def noise(seed=1):
    return np.random.default_rng(seed).normal(0.0, 0.2, len(T_S))


def test_for_how_long_a_signal_stands_still():
    values = noise()
    values[200:261] = values[200]
    still = signals.time_since_change_s(Column(T_S, values))
    assert still[211] == 0.0
    assert still[212] == pytest.approx(0.6)
    assert still[260] == pytest.approx(3.0)
    assert not still[261:].any()
    assert signals.column_defect_texts("p", Column(T_S, values), is_rate=True) == [
        "p: frozen, the same to the last bit for 3.0 s"
    ]


def test_a_clipped_rate_and_one_that_is_not():
    free = np.sin(T_S) * 3.0 + 0.01 * noise()
    for side in (1.0, -1.0):
        rows = signals.find_clipped_rows(side * np.clip(free, -9.0, 2.0))
        assert rows.sum() > 100
        assert (free[rows] >= 2.0).all()
        said = signals.column_defect_texts("p", Column(T_S, side * np.clip(free, -9.0, 2.0)), is_rate=True)
        assert said[-1] == f"p: clipped at 2 in {rows.sum()} rows"
    assert not signals.find_clipped_rows(free).any()
    assert not signals.find_clipped_rows(np.zeros(500)).any()


@settings(max_examples=samples(20), deadline=None)
@given(cut=st.integers(20, 1199), level=st.floats(0.5, 2.9))
def test_what_is_clipped_shows_without_what_comes_later(cut, level):
    values = np.minimum(np.sin(T_S) * 3.0 + 0.01 * noise(), level)
    np.testing.assert_array_equal(
        signals.find_clipped_rows(values)[:cut], signals.find_clipped_rows(values[:cut])
    )


def test_jumps_are_single_rows_that_come_back():
    values = noise()
    values[[100, 700]] += 50.0
    values[900:] += 50.0
    assert signals.find_spike_rows(values).tolist() == [100, 700]
    assert not len(signals.find_spike_rows(noise()))
    assert signals.find_spike_rows(np.repeat(values[:800], 3))[:0].tolist() == []  # a jump is of one row
    stairs = noise()
    stairs[300] += 25.0
    stairs[301:] += 50.0
    assert not len(signals.find_spike_rows(stairs))  # up twice, and not back
    held = np.repeat(noise(), 3)
    held[[400, 2200]] -= 50.0
    assert signals.find_spike_rows(held).tolist() == [400, 2200]  # a log of more rows than readings
    said = signals.column_defect_texts("p", Column(T_S, values), is_rate=True)
    assert said == ["p: 2 jumps, the first at 5.00 s"]


def test_rows_without_a_number_are_counted():
    values = noise()
    values[3:10] = np.nan
    (said,) = signals.column_defect_texts("p", Column(T_S, values, ""), is_rate=True)
    assert said == "p: rows without a number: 7 of 1200"
    assert signals.column_defect_texts("u", Column(T_S, np.full(1200, 0.1)), is_rate=False)[-1].startswith(
        "u: does not move"
    )


def turning(seed=1):
    """Roll, pitch and body rates of a rigid body whose Euler angles are known, by Euler's kinematics."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 6.0, 3)
    phi, theta = 0.9 * np.sin(0.8 * T_S + phase[0]), 0.4 * np.sin(0.5 * T_S + phase[1])
    phi_dot, theta_dot = 0.72 * np.cos(0.8 * T_S + phase[0]), 0.2 * np.cos(0.5 * T_S + phase[1])
    psi_dot = 0.4 + 0.3 * np.sin(0.3 * T_S + phase[2])
    p = phi_dot - psi_dot * np.sin(theta)
    q = theta_dot * np.cos(phi) + psi_dot * np.cos(theta) * np.sin(phi)
    r = psi_dot * np.cos(theta) * np.cos(phi) - theta_dot * np.sin(phi)
    return phi, theta, np.array([p, q, r])


@pytest.mark.parametrize(("rate", "angle", "says"), [
    (1.0, 1.0, None),
    (180 / np.pi, 1.0, "p is in deg/s, a factor of 0.01745 fits"),
    (1.0, 180 / np.pi, "roll is in deg, a factor of 0.01745 fits"),
    (1000.0, 1.0, "p is in mrad/s, a factor of 0.001 fits"),
    (-1.0, 1.0, "one of them has the other sign"),
    (0.3, 1.0, "a factor of 3.3"),
])  # fmt: skip
def test_a_wrong_unit_of_rate_or_roll_is_found_by_kinematics(rate, angle, says):
    phi, theta, rates = turning()
    columns = [Column(T_S, rate * one) for one in rates]
    pitch = Column(T_S, theta) if angle == 1.0 else None
    found = physics.fit_roll(columns, Column(T_S, angle * phi), pitch)
    if pitch is not None:
        assert found.slope == pytest.approx(1.0 / rate, rel=2e-3)
        assert abs(found.correlation) > 0.9999
    said = physics.factor_remark(found, "p", "roll")
    assert (said is None) if says is None else (says in said)


@pytest.mark.parametrize(("seconds", "rate", "says"), [
    (7.5, 180 / np.pi, False), (15.0, 180 / np.pi, True), (15.0, 0.6, False), (15.0, 0.5, True),
    (25.0, 0.6, True),
])  # fmt: skip
def test_of_a_short_log_more_is_needed(seconds, rate, says):
    """Eight windows of a second, and 1.8 times apart where there are fewer than twenty."""
    phi, theta, rates = turning()
    kept = T_S - T_S[0] <= seconds
    t_s = T_S[kept]
    columns = [Column(t_s, rate * one[kept]) for one in rates]
    found = physics.fit_roll(columns, Column(t_s, phi[kept]), Column(t_s, theta[kept]))
    assert (found is not None and physics.factor_remark(found, "p", "roll") is not None) is says


@pytest.mark.parametrize("drift_rad_s", [0.0, 7e-6])
def test_nothing_is_said_of_an_angle_that_does_not_move(drift_rad_s):
    """In steady flight at 45 m/s the level turns by 45 / 6.37e6 rad/s, and no gyro does: alpha is no rate."""
    still = Column(T_S, np.zeros(len(T_S)))
    assert physics.fit_roll([still] * 3, Column(T_S, drift_rad_s * T_S), None) is None
    angles = [("roll", still), ("pitch", Column(T_S, 0.14 + drift_rad_s * T_S)), None]
    rates = {name: Column(T_S, 1e-8 * np.sin(T_S)) for name in ("gx", "gy", "gz")}
    alpha = {"alpha": Column(T_S, 0.14 + 0.0 * T_S)}
    assert physics.attitude_mistake(rates, angles, alpha) is None


@pytest.mark.parametrize(("mean", "says"), [
    (9.7, None), (-9.9, None), (1.0, "it is in g, a factor of 9.807 fits"), (-32.2, "it is in ft/s2"),
    (1000.0, "it is in mg"), (0.01, "no unit fits: is 1 g in it?"),
])  # fmt: skip
def test_the_mean_of_the_specific_force_is_one_g(mean, says):
    said = physics.gravity_remark(Column(T_S, mean + 0.001 * noise()), "az")
    assert (said is None) if says is None else (says in said)


def test_swapped_rates_are_found_by_the_roll_they_make():
    phi, theta, (p, q, r) = turning()
    swapped = {"gx": Column(T_S, q), "gy": Column(T_S, p), "gz": Column(T_S, r)}
    angles = [("roll", Column(T_S, phi)), ("pitch", Column(T_S, theta)), None]
    said = physics.attitude_mistake(swapped, angles, {})
    assert said.endswith("gy is the roll rate")
    right = {"gx": Column(T_S, p), "gy": Column(T_S, q), "gz": Column(T_S, r)}
    assert physics.attitude_mistake(right, angles, {}) is None


@pytest.mark.parametrize(("factor", "angle", "says"), [
    (1.0, 1.0, None),
    (180 / np.pi, 1.0, "gy is in deg/s, a factor of 0.01745 fits"),
    (1.0, 180 / np.pi, "it is in deg, a factor of 0.01745 fits"),
    (np.pi / 180, 1.0, "a factor of 57.3 on gy fits, or of 0.01745 on pitch"),
    (-1.0, 1.0, "the change of pitch is -1 times the integral of gy: one of them has the other sign"),
])  # fmt: skip
def test_a_wrong_pitch_rate_alone_is_found_by_the_pitch_angle(factor, angle, says):
    phi, theta, (p, q, r) = turning()
    found = physics.fit_pitch([Column(T_S, one) for one in (p, q, r)], Column(T_S, phi), Column(T_S, theta))
    assert (found.slope, found.correlation) == (pytest.approx(1.0, rel=2e-3), pytest.approx(1.0, abs=1e-3))
    rates = {"gx": Column(T_S, p), "gy": Column(T_S, factor * q), "gz": Column(T_S, r)}
    angles = [("roll", Column(T_S, phi)), ("pitch", Column(T_S, angle * theta)), None]
    said = physics.attitude_mistake(rates, angles, {})
    assert (said is None) if says is None else (says in said)


def yawed(seed=1):
    """The yaw angle of the same body, whose rate is known in closed form: 0.4 + 0.3 sin(0.3 t + phase)."""
    phase = np.random.default_rng(seed).uniform(0, 6.0, 3)[2]
    return (0.4 * T_S - np.cos(0.3 * T_S + phase) + np.pi) % (2.0 * np.pi) - np.pi


@pytest.mark.parametrize(("factor", "angle", "says"), [
    (1.0, 1.0, None),
    (180 / np.pi, 1.0, "times the integral of gz: a factor of 0.02"),
    (1.0, 180 / np.pi, "yaw is in deg, a factor of 0.01745 fits"),
    (1.0, -1.0, "the change of yaw is -1 times the integral of gz: one of them has the other sign"),
])  # fmt: skip
def test_a_wrong_yaw_rate_is_found_by_the_yaw_angle(factor, angle, says):
    phi, theta, (p, q, r) = turning()
    columns = [Column(T_S, one) for one in (p, q, r)]
    found = physics.fit_yaw(columns, Column(T_S, phi), Column(T_S, theta), Column(T_S, yawed()))
    assert (found.slope, found.correlation) == (pytest.approx(1.0, rel=2e-3), pytest.approx(1.0, abs=1e-3))
    rates = {"gx": columns[0], "gy": columns[1], "gz": Column(T_S, factor * r)}
    angles = [
        ("roll", Column(T_S, phi)),
        ("pitch", Column(T_S, theta)),
        ("yaw", Column(T_S, angle * yawed())),
    ]
    said = physics.attitude_mistake(rates, angles, {})
    assert (said is None) if says is None else (says in said)


@pytest.mark.parametrize(("factor", "says"), [
    (np.pi / 180, "a factor of 57.3 on gz fits"), (180 / np.pi, "gz"), (-1.0, "a factor of -1 on gz fits"),
    (1.0, None),
])  # fmt: skip
def test_a_wrong_yaw_rate_is_found_in_a_flight_that_banks_and_pitches_more_than_it_yaws(factor, says):
    (p, q, r), angles = banked_and_pitched()
    rates = {"gx": Column(T_S, p), "gy": Column(T_S, q), "gz": Column(T_S, factor * r)}
    said = physics.attitude_mistake(rates, angles, {})
    assert (said is None) if says is None else (says in said)


def banked_and_pitched():
    """psi = 0.02 sin(0.7 t), theta = 0.3 sin(0.5 t), phi = 0.4 sin(0.9 t): their rates, and the angles."""
    phi, theta = 0.4 * np.sin(0.9 * T_S), 0.3 * np.sin(0.5 * T_S)
    dphi, dtheta, dpsi = 0.36 * np.cos(0.9 * T_S), 0.15 * np.cos(0.5 * T_S), 0.014 * np.cos(0.7 * T_S)
    p = dphi - np.sin(theta) * dpsi
    q = np.cos(phi) * dtheta + np.sin(phi) * np.cos(theta) * dpsi
    r = np.cos(phi) * np.cos(theta) * dpsi - np.sin(phi) * dtheta
    angles = [
        ("roll", Column(T_S, phi)),
        ("pitch", Column(T_S, theta)),
        ("yaw", Column(T_S, 0.02 * np.sin(0.7 * T_S))),
    ]
    return (p, q, r), angles


@pytest.mark.parametrize(("factors", "without", "confirmed"), [
    ((1.0, 1.0, 1.0), None, {"gx", "gy", "gz"}),
    ((-1.0, 1.0, 1.0), None, {"gy", "gz"}),
    ((1.0, 1.4, 1.0), None, {"gx"}),  # yaw follows both q and r
    ((1.0, 1.0, 0.02), None, {"gx", "gy"}),
    ((1.0, 1.0, 1.0), 2, {"gx", "gy"}),
    ((1.0, 1.0, 1.0), 0, set()),  # without roll no rate of an angle is known
])  # fmt: skip
def test_the_attitude_confirms_the_rates_that_make_it(factors, without, confirmed):
    rates, angles = banked_and_pitched()
    angles = [None if k == without else one for k, one in enumerate(angles)]
    named = ("gx", "gy", "gz")
    given = {name: Column(T_S, f * one) for name, f, one in zip(named, factors, rates, strict=True)}
    assert physics.confirmed_rates(given, angles) == confirmed


def test_another_column_in_the_place_of_a_rate_is_found_by_the_angle_that_follows_it():
    phi, theta, (p, q, r) = turning()
    angles = [("roll", Column(T_S, phi)), ("pitch", Column(T_S, theta)), ("yaw", Column(T_S, yawed()))]
    rates = {"gx": Column(T_S, p), "gy": Column(T_S, np.sin(2.1 * T_S)), "gz": Column(T_S, r)}
    assert physics.attitude_mistake(rates, angles, {}) is None
    said = physics.attitude_mistake(rates, angles, {"alpha": Column(T_S, q), "beta": Column(T_S, 0.1 * p)})
    assert said is not None
    assert said.startswith("pitch does not follow gy")
    assert said.endswith("alpha is the pitch rate")


def test_nothing_is_said_where_the_nose_is_steep():
    """Roll and yaw turn about the same line there, and jump by half a circle over the top."""
    t_s = np.arange(0.0, 40.0, 0.05)
    looping = 0.3 * t_s + 1.2
    theta, over = np.arcsin(np.sin(looping)), np.cos(looping) < 0.0
    phi, psi = np.where(over, np.pi, 0.0), np.where(over, np.pi, 0.0)
    still = Column(t_s, 1e-3 * np.sin(t_s))
    rates = {"gx": still, "gy": Column(t_s, np.full(len(t_s), 0.3)), "gz": still}
    angles = [("roll", Column(t_s, phi)), ("pitch", Column(t_s, theta)), ("yaw", Column(t_s, psi))]
    assert physics.attitude_mistake(rates, angles, {}) is None
    assert physics.fit_roll(list(rates.values()), angles[0][1], angles[1][1]) is None


def test_what_turns_while_nothing_is_logged_says_nothing_of_a_rate():
    """A window over a gap of 5 s, in which the roll angle changes by 1 rad, is left out."""
    t_s = np.arange(0.0, 20.0, 0.05)
    p = 0.3 * np.sin(1.3 * t_s)
    roll = 0.3 / 1.3 * (1.0 - np.cos(1.3 * t_s))
    late = t_s >= 10.0
    t_s, roll = t_s + 5.0 * late, roll + 1.0 * late
    zero = Column(t_s, np.zeros(len(t_s)))
    found = physics.fit_roll([Column(t_s, p), zero, zero], Column(t_s, roll), None)
    assert (found.slope, found.correlation) == (pytest.approx(1.0, abs=0.01), pytest.approx(1.0, abs=1e-3))


def test_a_signal_is_clipped_from_the_tenth_row_at_its_largest_value():
    """In threes: 3 * 3 rows at 5 are not enough, and a row alone is none; a larger value begins again."""
    fives = [5.0, 5.0, 5.0, 1.0]
    values = np.array([*fives, *fives, *fives, *fives, 5.0, 1.0, 6.0, 6.0, 6.0])
    assert np.flatnonzero(signals.find_clipped_rows(values)).tolist() == [14]
    assert np.flatnonzero(signals.find_clipped_rows(-values)).tolist() == [14]


def test_a_spike_is_larger_than_forty_usual_steps():
    values = np.resize([0.0, 1.0], 300)
    for height, rows in ((41.5, [100]), (40.5, [])):
        values[100] = height
        assert signals.find_spike_rows(values).tolist() == rows
    values[[100, 150, 200, 250]] = 50.0
    assert not len(signals.find_spike_rows(values))  # four of 300 rows are more than 1 %


AGREES, ROUND, FAST = 0.9, 6.5, 12.5  # a correlation, an angle round and round, a rate of no vehicle
FIT_OF = "the change of roll is {} times the integral of gx: "


@pytest.mark.parametrize(("fit", "says"), [
    ((2.0, 0.69, 30, ROUND, FAST), None),
    ((1.49, AGREES, 20, 1.0, 1.0), None), ((0.67, AGREES, 20, 1.0, 1.0), None),
    ((1.79, AGREES, 19, 1.0, 1.0), None), ((0.56, AGREES, 19, 1.0, 1.0), None),
    ((-1.49, -0.71, 20, ROUND, FAST), "-1.49;one of them has the other sign, `scale: -1` fits"),
    ((1.51, AGREES, 20, 1.0, 1.0), "1.51;a factor of 1.51 on gx fits, or of 0.6623 on roll"),
    ((-0.25, -AGREES, 19, 6.4, 12.0), "-0.25;a factor of 0.25 on gx fits, or of 4 on roll"),
    ((60.0, AGREES, 20, ROUND, FAST), "60;roll is in deg, a factor of 0.01745 fits"),
    ((-5000.0, -AGREES, 20, ROUND, 1.0), "-5000;roll is in cdeg, a factor of 0.0001745 fits"),
    ((0.02, AGREES, 20, 6.4, FAST), "0.02;gx is in deg/s, a factor of 0.01745 fits"),
    ((0.0008, AGREES, 20, ROUND, FAST), "0.0008;gx is in mrad/s, a factor of 0.001 fits"),
    ((0.02, AGREES, 20, 6.4, 12.0), "0.02;a factor of 0.02 on gx fits, or of 50 on roll"),
    ((0.0131, AGREES, 20, 1.0, FAST), "0.0131;a factor of 0.0131 on gx fits, or of 76.34 on roll"),
    ((4.0, AGREES, 20, ROUND, FAST), "4;a factor of 4 on gx fits, or of 0.25 on roll"),
])  # fmt: skip
def test_what_is_said_of_an_angle_and_its_rate(fit, says):
    """By slope, correlation, windows, largest angle and largest rate; on either side of each bound."""
    said = physics.factor_remark(physics.AngleFit(*fit), "gx", "roll")
    slope, _, rest = (says or "").partition(";")
    assert said == (None if says is None else FIT_OF.format(slope) + rest)


@pytest.mark.parametrize(("correlation", "windows", "is_rate", "least"), [
    (0.39, 20, True, 0.7), (-0.39, 20, True, 0.7), (0.41, 20, True, 0.95), (0.39, 20, False, 0.95),
    (0.19, 19, True, 0.7), (0.21, 19, True, 0.95), (0.69, 19, False, 0.95), (0.71, 20, True, 0.99),
    (-0.94, 20, False, 0.99), (0.96, 20, True, np.inf), (-0.96, 19, False, np.inf),
])  # fmt: skip
def test_how_well_another_column_must_agree_with_an_angle(correlation, windows, is_rate, least):
    fit = physics.AngleFit(1.0, correlation, windows, 1.0, 1.0)
    assert physics._replacing_correlation(fit, is_rate) == least


@pytest.mark.parametrize(("largest", "circle"), [
    (6.40, 2.0 * np.pi), (6.42, 360.0), (367.1, 360.0), (367.3, 36000.0), (None, 2.0 * np.pi),
])  # fmt: skip
def test_the_circle_of_angles_is_the_least_that_holds_them(largest, circle):
    """A fiftieth more than a circle may be logged; of no number nothing is known."""
    angles = np.array([np.nan, 1.0, np.nan if largest is None else -largest])
    assert physics._full_circle(angles if largest else angles[:1]) == circle


def test_the_unit_of_a_pitch_angle_is_that_of_roll_or_what_a_right_angle_allows():
    """4 and 5 may be radians of a roll angle, but never of a pitch angle; in cdeg roll says so."""
    for roll, pitch, to_rad in ((5.0, 4.0, np.pi / 180), (2.0, 1.6, 1.0), (400.0, 1.6, np.pi / 18000)):
        found = physics._pitch_rad(
            Column(np.arange(2.0), np.array([0.1, -roll])), Column(np.arange(2.0), np.array([-pitch, 0.4])),
            np.array([0.0, 0.5]),
        )  # fmt: skip
        np.testing.assert_allclose(found, [-pitch * to_rad, (0.2 - 0.5 * pitch) * to_rad])


@pytest.mark.parametrize(("largest", "says"), [
    (1.601, None), (1.603, "it is in deg, a factor of 0.01745 fits"),
    (91.7, "it is in deg, a factor of 0.01745 fits"), (91.9, "it is in cdeg, a factor of 0.0001745 fits"),
    (9179.0, "it is in cdeg, a factor of 0.0001745 fits"), (9181.0, "no unit fits"),
])  # fmt: skip
def test_no_pitch_angle_is_more_than_a_right_angle(largest, says):
    pitch = Column(np.arange(4.0), np.array([0.3, np.nan, -largest, 1.0]))
    told = f"theta reaches {largest:.4g} rad, a pitch angle at most 1.571: {says}; look at the rates' too"
    assert physics.pitch_remark(pitch, "theta") == (None if says is None else told)


@pytest.mark.parametrize(("down", "says"), [
    ([-4.91, 19.6, 4.91, np.nan], None), ([19.60, -19.60, 1.0], None),
    ([-4.89, 4.89, 30.0], "4.89;no unit fits: is 1 g in it?"),
    ([0.7, -0.7, 0.7], "0.7;it is in g, a factor of 9.807 fits"),
    ([np.nan, np.nan], "0;no unit fits: is 1 g in it?"),
])  # fmt: skip
def test_what_is_said_of_an_acceleration_by_the_middle_of_its_sizes(down, says):
    said = physics.gravity_remark(Column(np.arange(float(len(down))), np.array(down)), "acc")
    size, _, rest = (says or "").partition(";")
    told = f"acc: is {size} m/s2 on the middle of the flight, 1 g is 9.807: {rest}"
    assert said == (None if says is None else told)


def test_angles_with_stamps_of_their_own_are_taken_between_their_rows():
    """Later and rarer than the rates', in degrees, with a row that is no number; what is before says nothing.

    The rates are of one unit and the angles of another, so that each slope is 180 / pi times the factor.
    """
    phi, theta, rates = turning()
    columns = [Column(T_S, factor * one) for factor, one in zip((0.5, 0.25, 0.25), rates, strict=True)]
    rows = np.arange(100, 1200, 2)
    spoilt = np.where(rows == 500, np.nan, 1.0)
    roll, pitch, yaw = (
        Column(T_S[rows], np.rad2deg(angle[rows]) * spoilt)
        for angle in (phi, theta, np.unwrap(yawed()) % 6.283185307)
    )
    deg = 180.0 / np.pi
    for found, slope, largest in (
        (physics.fit_roll(columns, roll, pitch), 2.0, phi),
        (physics.fit_pitch(columns, roll, pitch), 4.0, theta),
        (physics.fit_yaw(columns, roll, pitch, yaw), 4.0, None),
    ):
        assert found.slope == pytest.approx(slope * deg, rel=5e-3)
        assert found.correlation == pytest.approx(1.0, abs=2e-3)
        assert 50 <= found.n_windows <= 54
        if largest is not None:
            assert found.max_angle_magnitude == pytest.approx(deg * np.abs(largest[rows]).max(), rel=1e-3)
    found = physics.fit_roll(columns, roll, pitch)
    assert found.max_rate_magnitude == pytest.approx(0.5 * np.abs(rates[0]).max())


@pytest.mark.parametrize(("rows", "steep", "windows"), [(161, 0.99, 8), (160, 0.99, None), (161, 1.01, None)])
def test_an_angle_wants_eight_windows_in_which_the_nose_is_not_steep(rows, steep, windows):
    """A last window that is not over is none; one steep row in it spoils a window."""
    t_s, rate = T_S[:rows], np.cos(T_S[:rows])
    pitch = np.where(np.arange(rows) == 50, -steep, 0.3)
    found = physics._fit_angle(t_s, np.sin(t_s), [rate], None, pitch)
    assert (found and found.n_windows) == windows


def test_without_a_pitch_angle_the_nose_is_taken_to_be_level():
    """Of a body that is level the yaw rate follows from roll alone: psi' = q sin(phi) + r cos(phi)."""
    phi, psi_dot = 0.9 * np.sin(0.8 * T_S), 0.4 + 0.3 * np.sin(0.3 * T_S)
    psi = 0.4 * T_S - np.cos(0.3 * T_S)
    rates = [0.72 * np.cos(0.8 * T_S), psi_dot * np.sin(phi), psi_dot * np.cos(phi)]
    columns, roll = [Column(T_S, one) for one in rates], Column(T_S, phi)
    for found in (
        physics.fit_yaw(columns, roll, None, Column(T_S, psi % 6.283185307)),
        physics.fit_roll(columns, roll, None),
    ):
        assert found.slope == pytest.approx(1.0, rel=2e-3)
        assert found.correlation > 0.999


def test_an_exchange_is_told_whole_with_how_well_each_agrees():
    phi, theta, (p, q, r) = turning()
    angles = [("roll", Column(T_S, phi)), ("pitch", Column(T_S, theta)), ("yaw", Column(T_S, yawed()))]
    other = Column(T_S, np.sin(2.1 * T_S))
    columns = {name: Column(T_S, one) for name, one in (("gx", p), ("gy", q), ("gz", r))}
    for axis, (of, title, angle) in enumerate(
        (("gx", "roll rate", "roll"), ("gy", "pitch rate", "pitch"), ("gz", "yaw rate", "yaw"))
    ):
        rates = {name: other if name == of else one for name, one in columns.items()}
        said = physics.attitude_mistake(rates, angles, {"spare": columns[of]})
        fit = physics._fit_axis(list(rates.values()), angles, axis)
        assert said == (
            f"{angle} does not follow {of} (correlation {fit.correlation:.2f}) but spare (1.00): "
            f"spare is the {title}"
        )
        assert abs(fit.correlation) < 0.7
        without_it = [None if k == axis else one for k, one in enumerate(angles)]
        if axis:
            assert physics.attitude_mistake(columns, without_it, {"spare": other}) is None


@pytest.mark.parametrize("values", [[np.nan] * 3, [np.nan, np.inf, -np.inf]])
def test_a_column_without_a_number_has_none_at_other_times_either(values):
    found = physics._interpolate(Column(np.array([0.0, 1.0, 2.5]), np.array(values)), T_S[:7])
    assert found.shape == (7,)
    assert np.isnan(found).all()


def test_a_column_at_other_times_lies_on_the_line_between_its_numbers():
    column = Column(np.array([1.0, 2.0, 3.0, 5.0]), np.array([4.0, np.nan, 10.0, -2.0]))
    found = physics._interpolate(column, np.array([0.5, 1.0, 2.0, 4.0, 5.5]))
    np.testing.assert_allclose(found, [np.nan, 4.0, 7.0, 4.0, np.nan])
