"""Real sensors, servos, coefficients and air, flown: what is declared raises no alarm, a fault does."""

import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import Scenario
from flying import SINES
from given import given

GIVEN = given(__file__)

COEFFICIENTS = {"Cm_alpha": 1.05, "Cm_de": 0.95, "Cl_p": 0.95, "Cl_da": 1.05, "Cn_p": 1.05, "Cm_0": 1.05}
CONDITIONS = GIVEN["conditions"]
LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": 6.0}


def flight(truth, bounds, **more):
    given = {"name": "x", "duration_s": 12, "reference": SINES, "fdi": {"bounds": bounds}, **truth, **more}
    return Scenario.model_validate(given)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_what_is_declared_raises_no_alarm(condition):
    flown = fly(flight(*CONDITIONS[condition], seed=1))
    assert flown.detection_time_s is None
    assert flown.worst_residual_ratio < 1.0


@pytest.mark.parametrize("condition", ["tactical", "consumer", "coefficients", "air"])
def test_the_same_undeclared_does(condition):
    assert fly(flight(CONDITIONS[condition][0], {})).detection_time_s is not None


@pytest.mark.parametrize("condition", [c for c in CONDITIONS if c not in ("air", "consumer", "gust")])
def test_a_lost_elevator_is_found_and_named(condition):
    flown = fly(flight(*CONDITIONS[condition], faults=[LOSS]))
    assert 6.0 <= flown.detection_time_s < 7.5
    assert flown.isolated == "elevator"
