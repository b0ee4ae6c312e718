"""Other days: what each change makes of a flight."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.recorded.other_days import (
    apply_day_changes,
    unchanged_day,
)
from kept import in_short
from products.logs import small

MODEL = small.model()
PAST = np.array(MODEL.past_coefficients)
NOISE = np.array(MODEL.residual_covariance)


CHANGES = {
    "nothing": {},
    "trim": {"trim_shift_commands": np.array([0.02, -0.03])},
    "neutral": {"neutral_shift_commands": np.array([0.02, -0.03])},
    "own": {"surface_gains": np.array([0.9, 1.2])},
    "gain": {"common_gain": 1.25},
    "late": {"command_delay_s": 0.04},
    "livelier": {"motion_scale": 1.5},
    "calmer": {"motion_scale": 0.6},
    "noise": {"noise_ratio": 1.5},
    "noise, calmer": {"noise_ratio": 1.2, "motion_scale": 0.8},
    "drift": {"trim_drift_sd_commands": 0.01},
}


@pytest.fixture(scope="module")
def flown():
    samples = small.flight(MODEL, 700, lost=((1, 300, 400, 0.5),))
    labels = samples.labels.copy()
    labels[:20] = np.nan
    return replace(samples, labels=labels)


@pytest.mark.parametrize("name", CHANGES)
def test_what_a_day_makes_of_a_flight(changed, flown, name):
    other = apply_day_changes(replace(unchanged_day(2), **CHANGES[name]), flown, PAST, NOISE)
    assert not changed({"commands": other.commands[::100], "rates": other.rates[::100],
          "all": [in_short(other.commands), in_short(other.rates)]})  # fmt: skip
