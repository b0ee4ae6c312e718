"""Hints and conditions: said where a reader would be misled, and nowhere else."""

import re
from types import SimpleNamespace

import pytest

from beaver_ftc.results.hints import hints
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.schema import Scenario
from given import given

GIVEN = given(__file__)

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 12}
STUCK = {"type": "stuck", "actuator": "elevator", "at_s": 12}
RUDDER = {"type": "bias", "actuator": "rudder", "bias_deg": 2, "at_s": 14}
ALL = {"fault_class": "all"}


def _hints(
    *faults, detected=True, guaranteed=0.1, end=(45.0, 1828.8), why=None, used=(0.11, 0.5), delay=None, **keys
):
    scenario = Scenario.model_validate({"name": "x", "faults": list(faults), **keys})
    detection = {
        "detected": detected,
        "guaranteed_delay_s": guaranteed,
        "inconclusive": why,
        "delay_s": delay,
    }
    flight = SimpleNamespace(scenario=scenario, end=end, closest_approach=used)
    return hints(flight, Metrics.of({"detection": detection}))


@pytest.mark.parametrize(
    ("arguments", "keys", "says"),
    GIVEN["a reader is told"],
)
def test_a_reader_is_told(arguments, keys, says):
    (said,) = _hints(*arguments, **keys)
    assert re.search(says, said)
