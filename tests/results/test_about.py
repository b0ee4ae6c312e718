"""Hints and conditions: said where a reader would be misled, and nowhere else."""

import re
from types import SimpleNamespace

import pytest

from beaver_ftc.results.metrics import hints
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.verdict import outcome_class, title
from beaver_ftc.scenario.schema import Scenario

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 12}
STUCK = {"type": "stuck", "actuator": "elevator", "at_s": 12}
RUDDER = {"type": "bias", "actuator": "rudder", "bias_deg": 2, "at_s": 14}
UNKNOWN = {"type": "unanticipated", "at_s": 12}
ALL, PAIRS = {"fault_class": "all"}, {"fault_class": "all", "pairs": True}


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
    ("arguments", "keys"),
    [
        ([], {}), ([LOSS], {}), ([UNKNOWN], {}), ([STUCK], {"fdi": ALL}), ([STUCK, RUDDER], {"fdi": PAIRS}),
        ([STUCK], {"fdi": {"scheme": "none"}}), ([LOSS], {"end": (41.0, 1600.0)}),
        ([LOSS | {"end_s": 13}, RUDDER], {"fdi": ALL}), ([LOSS], {"detected": False}),
        ([LOSS], {"detected": False, "guaranteed": None, "why": {"share": 0.5}}),
        ([LOSS], {"used": (0.2, 0.899)}), ([LOSS], {"used": (0.2, 1.25)}), ([], {"used": (0.899, 0.2)}),
        ([LOSS], {"delay": 0.02}), ([LOSS], {"delay": 0.01, "sensors": "tactical-grade"}),
        ([LOSS], {"delay": 0.01, "actuators": "servo"}),
        ([LOSS], {"delay": 0.01, "environment": {"wind_mps": [0, 3, 0]}}),
        ([LOSS], {"delay": 0.01, "uncertainty": {"coefficients": {"Cm_de": 1.02}}}),
    ],
)  # fmt: skip
def test_nothing_is_said_without_need(arguments, keys):
    assert _hints(*arguments, **keys) == []


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
        ([LOSS], {"delay": 0.05, "rate_hz": 20}, r"within one frame \(0.05 s\)"),
        ([LOSS], {"delay": 1 / 60 + 5e-10, "rate_hz": 60}, r"within one frame \(0.017 s\)"),
        ([LOSS], {"used": (0.2, 0.99996)}, r"the residual already reaches 99.9 % of its threshold"),
        ([], {"end": (45.0, 1500.0)}, "altitude fell from 1829 to 1500 m"),
    ],
)
def test_a_reader_is_told(arguments, keys, says):
    (said,) = _hints(*arguments, **keys)
    assert re.search(says, said)


def _document(**changes):
    nothing = {"isolated": False, "candidates": []}
    return {
        "scenario": "x", "expectations": [], "passed": True, "departure": None, "fault": None, "faults": [],
        "detection": {"detected": False}, "false_alarm": False, "isolation": nothing, "supervisor": [],
        "envelope_exits": [], "saturation_s": {}, **changes,
    }  # fmt: skip


def test_a_lost_aircraft_is_said_and_not_green():
    lost = _document(departure={"time_s": 3.0, "signal": "altitude"})
    assert (title(Metrics.of(lost)), outcome_class(Metrics.of(lost))) == (
        "x: flown, the aircraft was LOST, nothing was expected",
        "lost",
    )
    assert outcome_class(Metrics.of(_document())) == "good"
    assert outcome_class(Metrics.of(lost | {"passed": False})) == "bad"
