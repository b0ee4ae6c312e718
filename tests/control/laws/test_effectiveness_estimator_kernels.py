"""Effectiveness of every surface from an observer's innovation: against one regression over the past."""

import numpy as np
import pytest

from beaver_ftc.control.laws import effectiveness_estimator
from beaver_ftc.control.laws.effectiveness_estimator import estimator_dtype
from beaver_ftc.design.table import ALPHA, BETA

N, DT, FRAMES = 6, 0.02, 200
PULL, INTO = np.array([0.2, 0.3, 0.25]), np.array([0.8, 1.2, 1.0])
THETA = np.array([-0.9, -0.3, 0.0, -0.6, -0.1, -0.45])
TURNED = {
    (2, 1): 20.0,
    (0, 1): -8.0,
    (1, 0): 12.0,
}  # rad/s2 per rad: yaw and roll by sideslip, pitch by alpha


def missed_by_observer(accelerations):
    """What an observer of a rate and a constant disturbance misses (frames, 3) of accelerations."""
    error, believed, missed = np.zeros(3), np.zeros(3), []
    for a in accelerations:
        error = error + DT * (a - believed)
        missed.append(error.copy())
        believed = believed + INTO * error
        error = (1.0 - PULL) * error
    return np.array(missed)


def flown(seed=1):
    """Moments of healthy surfaces (frames, 3, N), signals (frames, 5), what is missed (frames, 3)."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(FRAMES)
    G = rng.normal(0.0, 8.0, (3, N))
    u = 0.2 * np.sin(np.outer(t, rng.uniform(2.0, 15.0, N)) + rng.uniform(0, 6, N))
    signals = 0.1 * np.sin(np.outer(t, rng.uniform(2.0, 15.0, 5)) + rng.uniform(0, 6, 5))
    given = G[None] * u[:, None]
    a = given @ THETA
    for (axis, signal), per in TURNED.items():
        a[:, axis] += per * signals[:, signal]
    return given, signals, missed_by_observer(a)


def listened(given, signals, missed, forgets=True):
    """The record after all frames."""
    record = np.zeros(1, estimator_dtype(N)).view(np.recarray)[0]
    effectiveness_estimator.begin_estimator(record, np.zeros(3), np.zeros(3), DT)
    record.prior[:] *= forgets
    y = np.zeros(8)
    for moments, signal, off in zip(given, signals, missed, strict=True):
        y[ALPHA], y[BETA] = signal[:2]
        effectiveness_estimator.estimate(record, off, PULL, INTO, DT, signal[2:], y, np.ones(N), moments)
    return record


def at_once(given, signals, missed, noise):
    """theta by one weighted ridge regression over all frames and axes."""
    rows, seen = [], []
    filtered = [missed_by_observer(given[:, :, s]) for s in range(N)]
    for i in range(3):
        of_signals = [
            missed_by_observer(np.outer(signals[:, j], np.eye(3)[i]))[:, i] if k == i else np.zeros(FRAMES)
            for k in range(3)
            for j in range(5)
        ]
        rows.append(np.column_stack([*(f[:, i] for f in filtered), *of_signals]))
        seen.append(missed[:, i])
    H, z = np.vstack(rows), np.concatenate(seen)
    prior = np.concatenate([np.full(N, 0.5**2), np.tile([900.0, 900.0, 9.0, 9.0, 9.0], 3)])
    return np.linalg.solve(H.T @ H / noise + np.diag(1.0 / prior), H.T @ z / noise)[:N]


def test_it_is_least_squares_over_the_whole_past():
    given, signals, missed = flown()
    record = listened(given, signals, missed, forgets=False)
    noise = float(record.noise[0])
    assert record.noise == pytest.approx(10.0 * (0.05 * DT) ** 2 * np.ones(3))
    expected = at_once(given, signals, missed, noise)
    assert expected.min() > -1.0
    assert abs(expected - THETA).max() < 0.05
    free = np.abs(THETA) > 0.0  # those that nothing holds at a limit on the way
    assert record.parameters[:N][free] == pytest.approx(expected[free], abs=0.03)


@pytest.mark.parametrize("seed", range(2))
def test_each_surface_is_found_while_the_airframe_has_changed(seed):
    record = listened(*flown(seed))
    assert [1.0 + theta for theta in record.parameters[:N]] == pytest.approx(1.0 + THETA, abs=0.1)
    assert effectiveness_estimator.effectiveness_of(record, 0) == pytest.approx(0.1, abs=0.1)


def test_an_aircraft_of_four_surfaces_has_no_estimator():
    assert [estimator_dtype(n)["P"].shape for n in (4, 5)] == [(1, 1), (20, 20)]
