"""The redundancy tests in flights by rotation matrices: sound sensors stay within every bound."""

import numpy as np
import pytest
from kernels import fill
from true_flight import UNITS, compared, new_monitor, true_flight

from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    COUNTERPART,
    DENSITY_TEST,
    DUPLICATE,
    DUPLICATE_TOLERANCE,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    N_EQUATIONS,
    PRESSURE_TEST,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    TURN_TEST,
)
from beaver_ftc.plant.instruments import ALTITUDE, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI


@pytest.mark.parametrize("h", [0.05, 0.01, 0.002])
@pytest.mark.parametrize("swiftly", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_sound_sensors_stay_within_every_bound(seed, swiftly, h):
    """Each error at its extreme: a bias, a slope, a drift, and noise that jumps from side to side."""
    rng, n = np.random.default_rng([seed, round(1 / h)]), 100
    true = true_flight(rng, n, h, swiftly, theta=(-0.8, 0.8))
    side = rng.choice([-1.0, 1.0], (3, N_SENSORS)) * (rng.random((3, N_SENSORS)) < 0.7)
    bias, slope, drift = side[0] * UNITS, 0.03 * side[1], 3e-3 * side[2]
    drift[np.abs(np.arange(N_SENSORS) - PHI - 1) > 1] = 0.0
    noise = rng.choice([0.0, 0.2, 1.0], N_SENSORS) * UNITS
    monitor = new_monitor(h, np.abs(bias) + noise, np.abs(bias))
    fill(monitor, e_slope=np.abs(slope), drift=np.abs(drift).max())
    readings = (1.0 + slope) * true + bias + noise * rng.choice([-1.0, 1.0], true.shape)
    readings += h * np.arange(n)[:, None] * drift
    nearest = np.max([ratio for ratio, _ in compared(monitor, readings)], axis=0)
    assert (nearest <= 1.0).all(), nearest
    assert (nearest > 0.2).sum() >= 4, nearest


@pytest.mark.parametrize("seed", range(4))
def test_exact_readings_are_predicted(seed):
    """Attitude and flow to rounding; altitude and density to the second order of the sample time."""
    h = 0.01
    readings = true_flight(np.random.default_rng(seed), 50, h, theta=(-0.9, 0.9))
    residual = np.array([residual for _, residual in compared(new_monitor(h), readings)])[1:]
    assert abs(residual[:, :DENSITY_TEST]).max() < 1e-12
    assert abs(residual[:, CLIMB_TEST]).max() < 4.0 / 3.0 * h * h * 2.0
    assert abs(residual[:, [RPM_TEST, PRESSURE_TEST]]).max() == 0.0


# By sensor: the tests that are exceeded at once by a jump of 20 times the declared error
SHOWN_BY = {
    **{i: {TURN_TEST + i} for i in range(3)}, **{PHI + i: {ANGLE_TEST + i} for i in range(3)},
    I_ALPHA: {ALPHA_TEST}, I_BETA: {BETA_TEST}, I_AIRSPEED: {SPEED_TEST, DENSITY_TEST},
    I_QDYN: {DENSITY_TEST}, ALTITUDE: {CLIMB_TEST}, ENGINE_SPEED: {RPM_TEST}, MANIFOLD: {PRESSURE_TEST},
}  # fmt: skip


@pytest.mark.parametrize("sensor", SHOWN_BY)
def test_a_reading_that_jumps_exceeds_its_own_tests_and_a_small_error_none(sensor):
    h = 0.02
    for size, shown in ((0.9, set()), (20.0, SHOWN_BY[sensor])):
        readings = true_flight(np.random.default_rng(sensor), 20, h, False)
        readings[10:, sensor] += size * UNITS[sensor]
        ratios, residuals = np.swapaxes([*compared(new_monitor(h, UNITS), readings)], 0, 1)
        ratio, residual = ratios.max(axis=0), residuals.max(axis=0)
        exceeded = set(np.flatnonzero(ratio > 1.0).tolist())
        assert shown <= exceeded, exceeded
        assert bool(shown) == bool(exceeded), exceeded
        if sensor in (ENGINE_SPEED, MANIFOLD):
            assert ratio[RPM_TEST:N_EQUATIONS].max() == pytest.approx(size, rel=1e-5)
            assert residual[RPM_TEST:N_EQUATIONS].max() == pytest.approx(size * UNITS[sensor])


def test_a_declared_error_is_of_the_reading_and_what_is_steady_does_not_change():
    """|reading - truth| <= offset + slope |truth|, and |truth| <= (|reading| + offset) / (1 - slope)."""
    errors, signal = new_monitor(0.02, 0.3, 0.25, e_slope=0.1)["errors"], np.full(N_SENSORS, -3.0)
    signal[PHI + 2] += 2.0 * np.pi  # a heading is off by its slope of the angle from north
    redundancy.bound_readings(errors, signal)
    truth = (3.0 + 0.3) / 0.9
    assert errors["e"] == pytest.approx(truth - 3.0)
    assert errors["n"] == pytest.approx(truth - 3.0 - 0.25 + 3e-10, rel=1e-9)


def test_filters_sum_what_was_with_what_each_pole_keeps():
    rng, n, h = np.random.default_rng(2), 30, 0.02
    keep, gust = np.array([0.0, 0.8, 0.97]), np.array([0.1, 0.2, 0.3])
    red = fill(new_monitor(h), decay=keep, gust_change=gust, gust=0.5)
    tests = red["tests"]
    residual, rate, noise = rng.normal(size=n), rng.uniform(1, 2, n), rng.uniform(1, 2, n)
    for values in zip(residual, rate, noise, strict=True):
        tests["residual"][1], tests["per_s"][1], tests["per_sample"][1] = values
        redundancy.filter_test(red, 1)
    weight = keep[:, None] ** np.arange(n)[::-1]
    changes = (1.0 - keep) * (weight[:, 1:] @ noise[:-1]) + noise[-1]
    r, B = tests["r"][1], tests["B"][1]
    assert r == pytest.approx(weight @ residual)
    assert pytest.approx(h * weight @ rate + changes + 0.5 * gust) == B
    assert tests["ratio"][1] == pytest.approx(np.max(np.abs(r) / B))


def test_near_the_vertical_the_tests_of_the_attitude_begin_anew():
    readings = np.repeat(true_flight(np.random.default_rng(1), 1, 0.02), 5, axis=0)
    readings[:, :3], readings[:, THETA] = 0.0, (1.25, 1.28, 1.31, 1.28, 1.25)
    monitor = new_monitor(0.02)
    ratios = [ratio[ANGLE_TEST + 1] for ratio, _ in compared(monitor, readings)]
    assert ratios[0] > 1.0  # 0.03 rad in a sample, and no rates
    assert ratios[1:3] == [0.0, 0.0]  # that of now, or that of before, is beyond 1.3 rad
    assert monitor["tests"]["r"][ANGLE_TEST + 1] == pytest.approx([-0.03] * 3)


@pytest.mark.parametrize("seed", range(6))
def test_momentary_errors_of_the_attitude_stay_within_bounds_that_remember_long(seed):
    """A heading that jumps back and forth turns each time about the axis that a blurred bank has by then."""
    rng, e = np.random.default_rng(seed), np.zeros(N_SENSORS)
    e[PHI : PHI + 3] = 1e-3, 1e-3, 0.06
    readings = np.repeat(true_flight(rng, 1, 0.02), 400, axis=0)
    readings[:, :3] = readings[:, PHI] = 0.0
    readings[:, PHI : PHI + 3] += e[PHI : PHI + 3] * rng.choice([-1.0, 0.0, 1.0], (400, 3))
    monitor = new_monitor(0.02, e)
    fill(monitor, decay=(0.0, 0.99, 0.9999))
    for ratio, _ in compared(monitor, readings):
        assert (ratio[TURN_TEST : TURN_TEST + 3] <= 1.0).all()


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_duplicates_differ_by_no_more_than_both_their_errors(share):
    monitor, readings = new_monitor(0.02), np.zeros(N_SENSORS)
    monitor["errors"]["e"] = np.arange(N_SENSORS) * 0.01
    for i, j, within in zip(DUPLICATE, COUNTERPART, DUPLICATE_TOLERANCE, strict=True):
        readings[i] = readings[j] + share * (within + 0.01 * (i + j))
    redundancy.compare_duplicates(monitor, readings, np.ones(N_SENSORS, int))
    assert ((monitor["tests"]["ratio"][N_EQUATIONS:] > 1.0) == (share > 1.0)).all()
