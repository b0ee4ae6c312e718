"""What is declared is kept: rates of false alarms, bounded uncertainty, steady errors of coefficients."""

import numpy as np
import pytest
from innovations import Detector, surfaces_at_work

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import AXES
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.studies.engine.statistics import poisson

NO_COUPLING = {"p": 0.0, "q": 0.0, "r": 0.0}
TACTICAL = {"sensors": "tactical-grade"}
SETTINGS = {
    "ideal gyros": {},
    "tactical-grade": TACTICAL,
    "tolerances": {**TACTICAL, "coefficients": 0.05},
    "light turbulence": {**TACTICAL, "turbulence": "light"},
    "severe turbulence, poor gyros": {"sensors": "consumer-grade", "turbulence": "severe"},
}


@pytest.mark.parametrize("per_h", [3600.0, 36000.0])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0])
@pytest.mark.parametrize("setting", SETTINGS)
def test_false_alarms_are_no_more_than_declared_and_not_absurdly_fewer(setting, rate_hz, per_h):
    """On innovations as declared, a new flight after every alarm. The union bound costs a factor of six or
    so: tests of neighbouring onsets and frames go together."""
    alone = Detector(rate_hz, bounds=SETTINGS[setting])
    tests = statistical.count_tests(load())
    alone.detector["test"]["alarm_level"] = statistical.derive_alarm_level(per_h, rate_hz, tests)
    hours, rng = 240.0 / 3600.0, np.random.default_rng(8)
    frames = round(hours * 3600.0 * rate_hz)
    scores = alone.watch(alone.innovations(frames, rng), *surfaces_at_work(frames, rate_hz, rng), renew=True)
    seen = poisson(int(np.sum(scores > 1.0)), hours, 0.999)
    assert seen.high <= per_h
    assert seen.low > 0.02 * per_h


def _share(rate_hz, omega, eta_bar, declared=None, seconds=20, **bounds):
    """Largest share of the level that eta_bar sin(omega t) reaches, in roll and pitch, or yaw."""
    constant = dict.fromkeys(AXES, eta_bar)
    largest = 0.0
    for axes in ((0, 1), (2,)):
        for phase in (0.0, 0.8, 1.6, 2.4):
            alone = Detector(
                rate_hz,
                statistical={"uncertainty_rad_s": declared or omega},
                bounds={"constant_rad_s2": constant, "inertia_coupling": NO_COUPLING, **bounds},
            )
            frames = round(seconds * rate_hz)
            nu = np.zeros((frames, 3))
            nu[:, axes] = eta_bar * np.sin(omega * np.arange(frames)[:, None] / rate_hz + phase)
            scores = alone.watch(nu, *surfaces_at_work(frames, rate_hz, np.random.default_rng(1)))
            largest = max(largest, scores[round(2 * rate_hz) :].max())
    return largest


@pytest.mark.parametrize("omega", [15.0, 60.0])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 500.0])
@pytest.mark.parametrize(
    ("sensors", "eta_bar"), [("ideal", 0.02), ("tactical-grade", 0.02), ("tactical-grade", 0.3)]
)
def test_bounded_uncertainty_takes_about_half_the_level_at_most(sensors, eta_bar, rate_hz, omega):
    assert 0.1 < _share(rate_hz, omega, eta_bar, sensors=sensors) < 0.6
