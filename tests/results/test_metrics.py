import json
import math

import pytest
from synthetic import landed

from beaver_ftc.results.metrics import as_json, metrics

KEYS = [
    "scenario", "seed", "frames", "flight", "fault", "faults", "assumes", "outside_class", "detection",
    "isolation", "false_alarm", "fault_free_s", "tracking", "supervisor", "changes", "mode_changes_left_out",
    "envelope_exits", "envelope", "departure",
    "authority", "engine_power", "profile", "arrival", "limits", "saturation_s", "hints",
    "expectations", "passed", "versions",
]  # fmt: skip


def test_published_case_has_every_key_of_the_contract_in_order():
    document = metrics(landed())
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


def test_what_is_not_finite_becomes_null_and_json_stays_json():
    document = metrics(landed(estimate=math.nan, post_fault_rms_rad_s=(math.inf, 0.0, 0.0)))
    assert json.loads(as_json(document)) == document
    assert document["isolation"]["estimate"] is None
    assert document["tracking"]["post_fault_rms_deg_s"]["p"] is None
    with pytest.raises(ValueError, match="JSON"):
        as_json({"x": math.nan})
