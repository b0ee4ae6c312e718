"""Diagnosis of flights whose faults are known; causal, calibrated, honest about what is together."""

import numpy as np
import pytest

from beaver_ftc_logs.diagnose import diagnose
from products.logs import synthetic

PARTS = ((60, 120, 1.0, 0.5), (160, 220, 0.4, 1.0))


@pytest.fixture(scope="module")
def flown():
    return synthetic.fly(280.0, parts=PARTS, seed=11, trim=(0.12, -0.22), gain=0.95)


@pytest.fixture(scope="module")
def rows(flown, sampled, wing_model):
    return diagnose(sampled(columns=flown), wing_model)


def test_faults_are_named_and_measured(rows):
    for begin, end, surface, level in ((65, 120, 1, 0.5), (165, 220, 0, 0.4)):
        within = (rows.t_s > begin) & (rows.t_s < end)
        assert np.median(rows.effectiveness[within, surface]) == pytest.approx(level, abs=0.101)
        assert np.mean(rows.isolated_surfaces[within] == ("right", "left")[surface]) > 0.9
    before = rows.t_s < 60
    assert rows.faulty[before].mean() < 0.02


@pytest.mark.parametrize("cut", [400, 650])
def test_cutting_the_flight_short_changes_no_earlier_row(flown, sampled, wing_model, rows, cut):
    short = diagnose(sampled(columns={name: of[:cut] for name, of in flown.items()}), wing_model)
    for field in ("t_s", "faulty", "isolated_surfaces", "effectiveness", "fault_probability", "credible"):
        assert np.array_equal(getattr(short, field), getattr(rows, field)[:cut]), field


def test_bounds_are_in_order_and_hold_the_estimate(rows):
    assert (rows.effectiveness_low >= 0).all()
    assert (rows.effectiveness_high <= 1).all()
    assert (rows.effectiveness_low <= rows.effectiveness).all()
    assert (rows.effectiveness <= rows.effectiveness_high).all()
