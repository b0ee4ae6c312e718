"""Dead, clipped and jumping signals, and what mechanics says of units: on columns made by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc_logs import physics, signals, unit_mistakes
from beaver_ftc_logs.recording import Column
from samples import samples

T_S = np.arange(0.0, 60.0, 0.05)


def noise(seed=1):
    return np.random.default_rng(seed).normal(0.0, 0.2, len(T_S))


def said_of(values, is_rate=True):
    return signals.column_defect_texts("p", Column(T_S, np.array(values)), is_rate=is_rate)


def with_rows(rows, *values, seed=1):
    """Noise with other values at some rows."""
    changed = noise(seed)
    for row, value in zip(rows, values, strict=True):
        changed[row] = value
    return changed


@pytest.mark.parametrize(("values", "says"), [
    (noise(), []),
    (with_rows([slice(200, 261)], 0.3), ["p: frozen, the same to the last bit for 3.0 s"]),
    (noise() + 50.0 * np.isin(np.arange(1200), [100, 700]), ["p: 2 jumps, the first at 5.00 s"]),
    (0.1 * noise() + 2.5 * (T_S > 14.98) + 2.5 * (T_S > 15.02), []),  # up twice, and not back
    (with_rows([slice(3, 10)], np.nan), ["p: rows without a number: 7 of 1200"]),
])  # fmt: skip
def test_what_is_said_of_a_column(values, says):
    assert said_of(values) == says


def test_for_how_long_a_signal_stands_still():
    still = signals.time_since_change_s(Column(T_S, with_rows([slice(200, 261)], 0.3)))
    assert still[[211, 212, 260]] == pytest.approx([0.0, 0.6, 3.0])
    assert not still[261:].any()
    assert said_of(np.full(1200, 0.1), is_rate=False)[-1].startswith("p: does not move")


def test_jumps_of_a_log_of_more_rows_than_readings():
    held = np.repeat(noise(), 3)
    held[[400, 2200]] -= 50.0
    assert signals.find_spike_rows(held).tolist() == [400, 2200]


@settings(max_examples=samples(20), deadline=None)
@given(cut=st.integers(20, 1199), level=st.floats(0.5, 2.9), side=st.sampled_from([1.0, -1.0]))
def test_a_clipped_rate_shows_without_what_comes_later(cut, level, side):
    free = np.sin(T_S) * 3.0 + 0.01 * noise()
    values = side * np.minimum(free, level)
    rows = signals.find_clipped_rows(values)
    assert (free[rows] >= level).all()
    assert said_of(values)[-1:] == [f"p: clipped at {level:.4g} in {rows.sum()} rows"] * bool(rows.any())
    np.testing.assert_array_equal(rows[:cut], signals.find_clipped_rows(values[:cut]))
    assert not signals.find_clipped_rows(free).any()


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


def yawed(seed=1):
    """The yaw angle of the same body, whose rate is known in closed form: 0.4 + 0.3 sin(0.3 t + phase)."""
    phase = np.random.default_rng(seed).uniform(0, 6.0, 3)[2]
    return (0.4 * T_S - np.cos(0.3 * T_S + phase) + np.pi) % (2.0 * np.pi) - np.pi


def test_rates_are_the_change_of_each_angle():
    """The angles are read between the rates; at 20 s, where a window ends, the yaw goes from 2 pi to 0."""
    phi, theta, rates = turning()
    yaw = (yawed() - yawed()[400]) % (2.0 * np.pi)
    columns = [Column(T_S, one) for one in rates]
    angles = [Column(T_S[1::2], one[1::2]) for one in (phi, theta, yaw)]
    for axis in range(3):
        found = physics.fit_angle(columns, angles, axis)
        assert (found.slope, found.correlation) == pytest.approx((1.0, 1.0), rel=2e-3)


def test_nothing_is_said_of_an_angle_that_does_not_move():
    """In steady flight at 45 m/s the level turns by 45 / 6.37e6 rad/s, and no gyro does: alpha is no rate."""
    still = Column(T_S, np.zeros(len(T_S)))
    waves = Column(T_S, np.cos(T_S))
    in_deg = Column(T_S, 20.0 + 7e-3 * np.sin(T_S))
    assert physics.fit_angle([waves] * 3, [in_deg, None, None], 0) is None
    angles = [("roll", still), ("pitch", Column(T_S, 0.14 + 7e-6 * T_S)), None]
    rates = {name: Column(T_S, 1e-8 * np.sin(T_S)) for name in ("gx", "gy", "gz")}
    alpha = {"alpha": Column(T_S, 0.14 + 0.0 * T_S)}
    assert unit_mistakes.attitude_mistake(rates, angles, alpha) is None


def test_nothing_is_said_where_the_nose_is_steep():
    """Roll and yaw turn about the same line there, and jump by half a circle over the top."""
    looping = 0.3 * T_S + 1.2
    over = Column(T_S, np.where(np.cos(looping) < 0.0, np.pi, 0.0))
    still, theta = Column(T_S, 1e-3 * np.sin(T_S)), Column(T_S, np.arcsin(np.sin(looping)))
    rates = {"gx": still, "gy": Column(T_S, np.full(len(T_S), 0.3)), "gz": still}
    angles = [("roll", over), ("pitch", theta), ("yaw", over)]
    assert unit_mistakes.attitude_mistake(rates, angles, {}) is None
    assert physics.fit_angle(list(rates.values()), [over, theta, None], 0) is None
