"""What is declared is kept: rates of false alarms, bounded uncertainty, steady errors of coefficients."""

import numpy as np
import pytest
from innovations import Detector, surfaces_at_work

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.studies.engine.statistics import poisson

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
