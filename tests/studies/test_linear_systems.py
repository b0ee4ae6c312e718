"""Modes, zeros and responses against systems whose answers are written down."""

import numpy as np
import pytest

from beaver_ftc.studies.linear_systems import (
    MODES,
    Mode,
    deviation,
    held_over_frame,
    modes,
    response,
    zeros,
)


def test_python_control_gives_the_same():
    control = pytest.importorskip("control")
    rng = np.random.default_rng(4)
    A, b = rng.normal(size=(6, 6)) - 3.0 * np.eye(6), rng.normal(size=6)
    system, omega = control.ss(A, b[:, None], np.eye(6)[[2]], 0), np.geomspace(0.1, 30.0, 7)
    assert response(A, b, 2, omega) == pytest.approx(system(1j * omega), rel=1e-9)
    held = control.sample_system(system, 0.05, "zoh")
    for ours, theirs in zip(held_over_frame(A, b[:, None], 0.05), (held.A, held.B), strict=True):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-12)
    assert np.sort_complex(zeros(A, b, 2)) == pytest.approx(np.sort_complex(control.zeros(system)), rel=1e-6)


def pair(real, imaginary):
    return np.array([[real, imaginary], [-imaginary, real]])


@pytest.mark.parametrize("seed", [1, 2])
def test_each_mode_by_its_name(seed):
    """Two pairs of the longitudinal states, a pair and two real ones of the lateral, in any coordinates."""
    A = np.zeros((8, 8))
    A[:2, :2], A[2:4, 2:4] = pair(-0.02, 0.3), pair(-2.0, 1.5)
    A[4:6, 4:6] = pair(-0.3, 2.0)
    A[6, 6], A[7, 7] = -5.0, -0.01
    turn = np.zeros((8, 8))
    rng = np.random.default_rng(seed)
    for part in (slice(0, 4), slice(4, 8)):
        turn[part, part] = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    turn[:4, 4:] = 0.01
    found = modes(turn @ A @ np.linalg.inv(turn))
    poles = {
        "short_period": -2 + 1.5j,
        "phugoid": -0.02 + 0.3j,
        "roll": -5,
        "dutch_roll": -0.3 + 2j,
        "spiral": -0.01,
    }
    assert list(found) == list(MODES)
    for name, pole in poles.items():
        assert found[name].pole == pytest.approx(pole), name
    assert found["short_period"].frequency_rad_s == pytest.approx(2.5)
    assert found["short_period"].damping == pytest.approx(0.8)
    assert (found["spiral"].damping, Mode(0.5 + 0j).damping) == (pytest.approx(1.0), -1.0)
    assert deviation(3 + 4j, 3 + 0j) == pytest.approx(4 / 3)


def test_zeros_come_slowest_first_and_of_a_pair_the_upper_one():
    """Of (s^2 + 2 s + 5)(s + 0.5) over a quartic, in companion form; and of a system that has none."""
    a = np.vstack([[-10.0, -35.0, -50.0, -24.0], np.eye(3, 4)])
    T = np.eye(4)
    T[0] = np.convolve([1.0, 2.0, 5.0], [1.0, 0.5])
    found = zeros(T @ a @ np.linalg.inv(T), T @ np.eye(4)[0], 0)
    np.testing.assert_allclose(found, [-0.5, -1.0 + 2.0j, -1.0 - 2.0j], atol=1e-9)
    assert zeros(np.array([[0.0, 1.0], [-4.0, -0.4]]), np.array([0.0, 1.0]), 0).size == 0
