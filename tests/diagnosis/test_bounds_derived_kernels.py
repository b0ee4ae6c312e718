"""The derived bound term by term: products of factors, each as large as its error allows, in plain Python."""

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design.model import DPT_0, KW_TO_DPT, SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.diagnosis import bounds
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import Scenario

AIRCRAFT = load()
TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
X, U = np.array([0.2, -0.15, 0.1]), np.array([0.1, -0.2, 0.15, 0.05])
Y = np.array([0.12, -0.06, 44.0, 1050.0, 0.4, 0.0, 0.0, 0.0])


def records(seed=0, gust=0.02, deflection=0.004):
    """(admitted, design) with every error declared, at random."""
    rng = np.random.default_rng(seed)
    frame = configure_design(Scenario.model_validate({"name": "x"}), TRAVEL_RAD).view(np.recarray)[0]
    declared_errors, design = frame["fdi"]["bound"]["declared_errors"], frame["prediction"]["design"]
    declared_errors["dC"][: len(AIRCRAFT.moments)] = rng.uniform(0.001, 0.05, len(AIRCRAFT.moments))
    declared_errors["dI"] = rng.uniform(0.001, 0.1, 12)
    declared_errors["e0"] = rng.uniform(0.001, 0.01, 7) * [1, 1, 1, 1, 1, 100, 2000]
    declared_errors["e1"] = rng.uniform(0.001, 0.02, 7)
    declared_errors["wg"], declared_errors["du"] = gust, deflection
    return declared_errors, design


def farthest(declared_errors, i, reading):
    """The largest truth that reads so: |reading - truth| <= offset + slope |truth|."""
    return (abs(reading) + declared_errors["e0"][i]) / (1.0 - declared_errors["e1"][i])


@pytest.mark.parametrize("dpt", [0.4, 0.05])
@pytest.mark.parametrize("engine", [0, 1])
def test_a_slipstream_worked_out_from_instruments_is_off_at_the_corner_of_their_errors(engine, dpt):
    """dpt = a + b P / (qdyn V) with the least qdyn and V, and the power in the densest air."""
    declared_errors, _ = records()
    y = Y.copy()
    y[4] = dpt
    (
        declared_errors["engine"],
        declared_errors["kw0"],
        declared_errors["kw1"],
    ) = (
        engine,
        2.0,
        150.0,
    )
    pressure = farthest(declared_errors, 6, y[3]) / y[3] - 1.0
    speed = farthest(declared_errors, 5, y[2]) / y[2] - 1.0

    def density(q, V):
        return 2.0 * q / V**2 / SEA_LEVEL_DENSITY_KG_M3

    slowest = y[2] * (1.0 - speed)
    thinner = density(y[3] * (1.0 + pressure), slowest) - density(y[3], y[2])
    more_kw = 2.0 + 150.0 * thinner
    power_kw = abs(dpt - DPT_0) * y[3] * y[2] / KW_TO_DPT
    there = KW_TO_DPT * (power_kw + more_kw) / (y[3] * (1.0 - pressure) * slowest)
    assert bounds.slipstream_bound(declared_errors, y) == pytest.approx(there - abs(dpt - DPT_0))
    bounds.fill_magnitudes(declared_errors, X, y, U)
    off = there - abs(dpt - DPT_0) if engine else 0.0
    assert declared_errors["yw"][4] == pytest.approx(dpt + off)
    assert declared_errors["ya"][4] == dpt
