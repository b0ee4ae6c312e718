"""The statistical detector's numbers one by one: from what is declared, by the formulas' own conditions."""

from math import pi, sqrt

import numpy as np
import pytest
from innovations import Detector, by_onset

from beaver_ftc.aircraft import load
from beaver_ftc.design import Dryden, rotation_lengths
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.likelihood import (
    GROWING_LOSS,
    LOSS_END,
    N_SLOTS,
)
from beaver_ftc.diagnosis.detection.statistical import statistical_dtype
from beaver_ftc.diagnosis.state import LOSS

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


def returning(rapidity, moving=1, rolling=200.0, rate_hz=50.0):
    record = np.zeros(1, statistical_dtype())[0]
    record["noise"]["q"], record["test"]["alarm_level"] = (
        rapidity,
        6.0,
    )
    return statistical.derive_length(record, V, rate_hz, moving * rolling)


def test_a_drift_returns_so_soon_that_a_swing_takes_half_the_level():
    """eta_bar sqrt(T / 2 i) / tau over the longest window; no later than the rolling gust does."""
    rapidity, rate_hz = 3.0, 50.0
    tau = returning(rapidity, moving=0) / V
    longest_s = 2 ** (N_SLOTS - 1) / rate_hz
    assert sqrt(longest_s / (2.0 * rapidity)) / tau == pytest.approx(6.0 / 2)
    assert returning(rapidity, rolling=2.0) == 2.0
    assert returning(rapidity, rolling=1e6) == pytest.approx(tau * V)
    assert returning(0.0) == 200.0
    assert returning(0.0, moving=0) == 0.0


@pytest.fixture(scope="module")
def alone():
    return Detector(50.0, forgetting_time_s=4.0, bounds={"sensors": "tactical-grade", "turbulence": "light"})


def test_a_sense_is_kept_for_every_onset(alone):
    """A loss is a loss from whichever onset: what takes away counts against it."""
    for block in alone.blocks:
        n = int(block["n_h"])
        kinds = block["hypothesis"]["kind"][:n]
        signs = [{LOSS: -1.0, GROWING_LOSS: -1.0, LOSS_END: 1.0}.get(int(kind), 0.0) for kind in kinds]
        sense = by_onset(block, "supporting_correlation_sign")
        assert (sense[:, :n] == signs).all()
        assert not sense[:, n:].any()


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
