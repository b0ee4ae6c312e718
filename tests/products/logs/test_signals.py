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
