"""Other days made of a flight: each change is what the vehicle's equation says, seen from the moments."""

import numpy as np
import pytest

from beaver_ftc_logs.recorded.other_days import random_days
from beaver_ftc_logs.samples import Samples


@pytest.fixture
def samples():
    rng = np.random.default_rng(1)
    n = 4000
    labels = np.ones((n, 2))
    labels[1000:2000, 1] = 0.4
    t_s = np.arange(n) / 10.0
    commands = 0.1 + 0.03 * np.sin(2.0 * t_s)[:, None] * np.array([1.0, -0.5])
    rates = 0.1 * rng.standard_normal((n, 3))
    run = np.zeros(n, dtype=np.int64)
    return Samples("one", t_s, rates, commands, np.empty((n, 0)), labels, run, 0.1, {}, (), t_s)


def test_drawn_days_differ_as_much_as_is_said():
    """Over 900 days of four surfaces; ratios in their logarithms, what can only be more is half a bell."""
    days = random_days(4, range(900))
    assert len({day.name for day in days}) == len({day.common_gain for day in days}) == 900
    bells = {
        "trim_shift_commands": (np.array, 0.015), "neutral_shift_commands": (np.array, 0.01),
        "surface_gains": (np.log, 0.03), "common_gain": (np.log, 0.1), "command_delay_s": (np.array, 0.02),
        "motion_scale": (np.log, 0.25),
    }  # fmt: skip
    for name, (of, spread) in bells.items():
        values = of([getattr(day, name) for day in days])
        assert np.std(values) == pytest.approx(spread, rel=0.1), name
        assert np.mean(values) == pytest.approx(0.0, abs=0.15 * spread), name
    for name, least, spread in (("noise_ratio", 1.0, 0.3), ("trim_drift_sd_commands", 0.0, 0.006)):
        more = np.array([getattr(day, name) for day in days]) - least
        assert more.min() >= 0.0, name
        assert np.sqrt(np.mean(more**2)) == pytest.approx(spread, rel=0.1), name
