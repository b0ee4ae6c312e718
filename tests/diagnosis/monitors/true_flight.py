"""A flight that moves about all axes, as sound sensors read it, and a monitor of its sensors."""

import numpy as np
from kernels import fill
from scipy.spatial.transform import Rotation

from beaver_ftc.diagnosis.monitors import initial_errors, redundancy
from beaver_ftc.diagnosis.monitors.numbering import (
    FILTER_POLES_PER_S,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    NO_SENSOR,
)
from beaver_ftc.diagnosis.monitors.records import SENSOR_MONITOR_RECORD
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI

GRAVITY = 9.8
DOWN = np.array([0.0, 0.0, GRAVITY])
FORCES = slice(AX, AX + 3)
# Errors of each sensor, SI
UNITS = np.full(N_SENSORS, 0.5)
UNITS[:MANIFOLD] = 0.02, 0.02, 0.02, 0.01, 0.01, 1, 30, 0.01, 0.01, 0.01, 5, 10


def true_flight(rng, n, h, swiftly=True, theta=(-0.2, 0.3)):
    """Readings (n, N_SENSORS) without error: rates held over a sample, velocity integrated by two steps, the
    place by three."""
    size, pace = (0.3, 4.0) if swiftly else (0.06, 1.0)
    turn = Rotation.from_euler("ZYX", (rng.uniform(-3, 3), rng.uniform(*theta), rng.uniform(-0.5, 0.5)))
    alpha, beta, altitude = rng.uniform(0.03, 0.2), rng.uniform(-0.1, 0.1), 900.0
    body = np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    v = turn.apply(rng.uniform(35, 55) * body)
    amplitude, phase = size * np.ones(6), rng.uniform(0, 6, 6)
    amplitude[3:] = 1.0, 0.6, 1.5
    frequency, signal = pace * rng.uniform(0.5, 1.5, 6), np.zeros((n, N_SENSORS))
    moved, before = [v] * 3, None
    for k in range(n):
        motion = amplitude * np.sin(frequency * h * k + phase)
        body, air = turn.inv().apply(v), 1.225 * (1.0 - 2.25577e-5 * altitude) ** 4.2559
        V, now = np.linalg.norm(v), turn.apply(motion[3:])
        signal[k, :3], signal[k, PHI : PHI + 3] = motion[:3], turn.as_euler("ZYX")[::-1]
        signal[k, [I_ALPHA, I_BETA, I_AIRSPEED]] = np.arctan2(body[2], body[0]), np.arcsin(body[1] / V), V
        signal[k, I_QDYN], signal[k, ALTITUDE] = 0.5 * 1.1 * air * V * V, altitude  # on a cold day
        signal[k, [ENGINE_SPEED, MANIFOLD]] = 1800.0, 20.0
        signal[k, FORCES] = motion[3:] - turn.inv().apply(DOWN)
        v = v + h * (1.5 * now - 0.5 * (now if before is None else before))
        altitude -= h * np.dot((23.0, -16.0, 5.0), moved)[2] / 12.0
        moved, before, rate = [v, *moved[:2]], now, np.linalg.norm(motion[:3])
        turn *= Rotation.from_rotvec(motion[:3] * 2.0 * np.arctan(0.5 * h * rate) / rate)
    return signal


def new_monitor(h, e_zero=0.0, const=0.0, **fields):
    """A monitor of one sample a frame that is declared these errors."""
    monitor = np.zeros(1, SENSOR_MONITOR_RECORD).view(np.recarray)[0]
    fill(monitor, h=h, decay=np.exp(-h * np.array(FILTER_POLES_PER_S)), g=GRAVITY)
    fill(monitor, e_zero=e_zero, const=const, max_airspeed_mps=80.0, wind_max=1.0)
    monitor["sample"]["y_pred"][[ENGINE_SPEED, MANIFOLD]] = 1800.0, 20.0
    fill(monitor, enabled=1, substeps=1, has_engine=1, rate_gain=1.0, n_frozen=3, isolated_sensor=NO_SENSOR)
    return fill(monitor, alarmed_at_s=-1.0, isolated_at_s=-1.0, **fields)


def compared(monitor, readings):
    """Ratios and residuals of the tests after each sample but the first; errors from the start are judged."""
    redundancy.start_tests(monitor, readings[0], readings[0, FORCES])
    initial_errors.start_bounds(monitor, readings[0])
    for y in readings[1:]:
        redundancy.run_tests(monitor, y, np.ones(1, int))
        initial_errors.update_bounds(monitor, y)
        tests = monitor["tests"]
        tests["exceeded"] |= tests["ratio"] > 1.0
        initial_errors.latch_refuted(monitor, tests["exceeded"])
        yield tests["ratio"].copy(), tests["residual"].copy()
        redundancy.store_sample(monitor, y, y[FORCES])
