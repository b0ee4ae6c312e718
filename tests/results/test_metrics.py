import json
import math

import pytest
from synthetic import Expect, Fault, Flight, Scenario

from beaver_ftc.results.metrics import as_json, metrics

KEYS = [
    "scenario", "seed", "frames", "flight", "fault", "faults", "assumes", "outside_class", "detection",
    "isolation", "false_alarm", "fault_free_s", "tracking", "supervisor", "changes", "mode_changes_left_out",
    "envelope_exits", "envelope", "departure",
    "authority", "engine_power", "profile", "arrival", "limits", "saturation_s", "hints",
    "expectations", "passed", "versions",
]  # fmt: skip


def _of(scenario=None, **changes):
    return metrics(Flight(scenario=scenario or Scenario(), **changes))


def test_published_case_has_every_key_of_the_contract_in_order():
    document = _of()
    assert list(document) == KEYS
    assert document["fault"] == {"actuator": "elevator", "type": "loss_of_effectiveness", "at_s": 12.0}
    assert document["detection"] == {
        "detected": True, "time_s": 12.07, "delay_s": 0.07, "axis": "q", "guaranteed_delay_s": 0.31,
        "statistical": None, "inconclusive": None,
    }  # fmt: skip
    assert document["isolation"] == {
        "isolated": True, "fault": "elevator", "type": "loss_of_effectiveness",
        "time_s": 12.12, "delay_s": 0.12, "correct": True, "estimate": -0.39, "candidates": ["elevator"],
        "type_correct": True, "type_delay_s": None, "estimate_deg": None, "estimate_interval": None,
        "frequency_rad_s": None, "so_far": True, "premature": False, "withdrawn": [],
        "names": ["elevator"], "probing_s": None, "faults": [],
    }  # fmt: skip
    assert document["false_alarm"] is False
    assert document["supervisor"][1] == {"time_s": 12.07, "mode": "adaptive"}
    assert set(document["versions"]) == {"beaver-ftc", "jsbsim", "numpy", "numba", "python"}


def test_unanticipated_fault_is_named_right_only_as_such():
    fault = Fault(type="unanticipated", actuator=None)
    assert _of(Scenario(faults=(fault,)), isolated="unanticipated")["isolation"]["correct"] is True
    assert _of(Scenario(faults=(fault,)), isolated="elevator")["isolation"]["correct"] is False
    assert _of(isolated="unanticipated")["isolation"]["correct"] is False


def test_what_is_not_finite_becomes_null_and_json_stays_json():
    document = _of(estimate=math.nan, post_fault_rms_rad_s=(math.inf, 0.0, 0.0))
    assert json.loads(as_json(document)) == document
    assert document["isolation"]["estimate"] is None
    assert document["tracking"]["post_fault_rms_deg_s"]["p"] is None
    with pytest.raises(ValueError, match="JSON"):
        as_json({"x": math.nan})


EXPECTED = {"detected_within_s": 0.07, "isolated_as": "elevator", "isolated_within_s": 0.12,
            "no_false_alarm": True, "no_departure": True,
            "post_fault_rms_deg_s": {"q": 0.6, "r": 0.2}}  # fmt: skip


def _found(document):
    return {found["name"]: found["passed"] for found in document["expectations"]}


def test_expectations_met_on_the_limit():
    document = _of(Scenario(expect=Expect(**EXPECTED)))
    assert document["passed"] is True
    assert list(_found(document)) == [*list(EXPECTED)[:5], "post_fault_rms_deg_s.q", "post_fault_rms_deg_s.r"]
    assert document["expectations"][0] == {
        "name": "detected_within_s", "passed": True, "expected": 0.07, "actual": 0.07,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "missed"),
    [
        ({"detection_time_s": 12.08}, {"detected_within_s"}),
        ({"detection_time_s": None}, {"detected_within_s"}),
        ({"detection_time_s": 3.0}, {"detected_within_s", "no_false_alarm"}),
        ({"isolated": "rudder"}, {"isolated_as"}),
        ({"isolated": None, "isolation_time_s": None}, {"isolated_as", "isolated_within_s"}),
        ({"isolation_time_s": 12.13}, {"isolated_within_s"}),
        ({"departure": (15.0, "alpha_rad")}, {"no_departure"}),
        ({"post_fault_rms_rad_s": (0.0, 0.02, 0.0)}, {"post_fault_rms_deg_s.q"}),
        ({"post_fault_rms_rad_s": None}, {"post_fault_rms_deg_s.q", "post_fault_rms_deg_s.r"}),
        ({"post_fault_rms_rad_s": (0.0, math.nan, 0.0)}, {"post_fault_rms_deg_s.q"}),
    ],
)
def test_each_expectation_can_be_missed(changes, missed):
    document = _of(Scenario(expect=Expect(**EXPECTED)), **changes)
    assert {name for name, passed in _found(document).items() if not passed} == missed
    assert document["passed"] is False
