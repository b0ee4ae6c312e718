"""The statistical detector's numbers one by one: from what is declared, by the formulas' own conditions."""

from math import pi, sqrt

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design import Dryden, rotation_lengths
from beaver_ftc.diagnosis.detection import statistical

AIRCRAFT = load()
SPAN_M, CHORD_M = AIRCRAFT.geometry.span_m, AIRCRAFT.geometry.chord_m
V, QDYN_PA = 45.0, 1036.0


@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_gusts_drift_as_the_specification_has_them(turbulence):
    """Intensity over V: of a first-order process twice its variance over its lag; of a lagged slope that of
    the velocity over (V lag)^2 [MIL-F-8785C]."""
    found = Dryden(turbulence).rotation_walk(SPAN_M)
    sigma_w = 0.3048 * {"light": 7.4, "severe": 23.6}[turbulence]
    L = 0.3048 * 1750.0
    rolling_lag_s = sqrt(L * SPAN_M) / (2.6 * V)
    rolling = 2.0 * Dryden(turbulence).rotation_limit_rad_s(SPAN_M) ** 2 / rolling_lag_s
    velocity = 3.0 * sigma_w**2 * V / L
    pitching, yawing = (velocity / (V * n * SPAN_M / (pi * V)) ** 2 for n in (4, 3))
    assert found * V == pytest.approx([rolling, pitching, yawing], rel=1e-9)


def test_a_swing_takes_half_the_level_where_gyros_are_noisy():
    """eta_bar omega sqrt(2 sqrt 2 / i w0), w0 = (i / n)^(1/4); so fast that it hardly grows beside a loss."""
    eta_bar, omega, noise, level, dt = 0.02, 500.0, 1e-3, 6.0, 1e-3
    i = statistical.derive_intensity(eta_bar, omega, noise, level, dt) * eta_bar**2
    ramp = 4.0 * (1.204 * eta_bar / level) ** 2 * omega
    walk = sqrt(i**2 - ramp**2)
    w0 = (walk / (noise**2 * dt)) ** 0.25
    assert eta_bar * omega * sqrt(2.0 * sqrt(2.0) / (walk * w0)) == pytest.approx(level / 2)


def test_where_no_vane_shows_it_pitch_reckons_with_a_gust_no_weaker_at_any_frequency():
    """Dryden's vertical velocity, its slope lagged [MIL-F-8785C], beside the drift that stands for it."""
    lag_m, omega = float(rotation_lengths(SPAN_M)[1]), np.geomspace(1e-3, 1e3, 400)
    assert lag_m == pytest.approx(4.0 * SPAN_M / pi)
    sigma, L, tau = 0.3048 * 7.4, 0.3048 * 1750.0, lag_m / V
    x = (L * omega / V) ** 2
    velocity = sigma**2 * L / (pi * V) * (1.0 + 3.0 * x) / (1.0 + x) ** 2
    rotation = (omega / V) ** 2 * velocity / (1.0 + (tau * omega) ** 2)
    intensity = Dryden("light").rotation_walk(SPAN_M)[1] * V
    stands_for_it = intensity * tau**2 / pi / (1.0 + (tau * omega) ** 2)
    assert (rotation <= stands_for_it * (1.0 + 1e-9)).all()
    assert rotation[-1] == pytest.approx(stands_for_it[-1], rel=1e-4)
