"""Hints and conditions: said where a reader would be misled, and nowhere else."""

import re
from types import SimpleNamespace

import pytest

from beaver_ftc.results.hints import hints
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.schema import Scenario

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
    [
        ([STUCK, RUDDER], {"fdi": ALL}, "faults on several surfaces at once: .*; set fdi.pairs: true"),
        ([LOSS], {"detected": False, "guaranteed": None}, "no alarm, and no alarm was guaranteed"),
        (
            [],
            {"end": (39.0, 1828.8)},
            r"airspeed fell from 45 to 39 m/s \(only the body rates",
        ),
        (
            [LOSS],
            {"used": (0.2, 0.9687)},
            "the residual already reaches 96.8 % of its threshold before the fault",
        ),
        ([], {"used": (0.95, 0.2)}, "reaches 95 % of its threshold: a slightly larger error"),
        ([LOSS], {"delay": 0.01}, r"within one frame \(0.01 s\): sensors exact, servos ideal"),
        ([LOSS], {"delay": 1 / 60 + 5e-10, "rate_hz": 60}, r"within one frame \(0.017 s\)"),
        ([LOSS], {"used": (0.2, 0.99996)}, r"the residual already reaches 99.9 % of its threshold"),
        ([], {"end": (45.0, 1500.0)}, "altitude fell from 1829 to 1500 m"),
    ],
)
def test_a_reader_is_told(arguments, keys, says):
    (said,) = _hints(*arguments, **keys)
    assert re.search(says, said)
