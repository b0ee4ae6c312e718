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


def test_what_was_named_before_is_listed_beside_what_is_named_now():
    gone = {"fault": "elevator", "from_s": 12.02, "to_s": 12.120000000001}
    found = _of(isolated="unanticipated", withdrawn=(gone,))["isolation"]
    assert (found["fault"], found["so_far"]) == ("unanticipated", False)
    assert found["withdrawn"] == [gone | {"to_s": 12.12}]


def test_alarm_before_the_fault_is_false_and_has_no_delay():
    document = _of(detection_time_s=11.99)
    assert document["false_alarm"] is True
    assert document["detection"]["delay_s"] is None
    assert document["detection"]["detected"] is True


def test_alarm_at_the_instant_of_the_fault_is_none():
    assert _of(detection_time_s=12.0)["false_alarm"] is False


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


def test_an_alarm_in_the_very_frame_of_the_fault_is_no_false_alarm():
    """5.89 s as a frame time lies a rounding below 5.890000000000001 s as a declared one."""
    document = _of(Scenario(faults=(Fault(at_s=5.890000000000001),)), detection_time_s=5.89)
    assert document["false_alarm"] is False
    assert document["detection"]["delay_s"] == 0.0


def test_deviations_from_the_profile_are_in_degrees_where_they_are_angles():
    off = {"altitude_m": 3.0, "airspeed_mps": 1.5, "heading_deg": math.radians(2.0), "bank_deg": None}
    off |= {"airspeed_limited_mps": 0.5, "airspeed_at_one_instant_mps": 4.0}
    assert _of(profile=off)["profile"] == {
        "altitude_m": 3.0, "airspeed_mps": 1.5, "heading_deg": 2.0, "bank_deg": None,
        "airspeed_limited_mps": 0.5, "airspeed_at_one_instant_mps": 4.0,
    }  # fmt: skip


TWO = Scenario(faults=(
    Fault(at_s=14.0, actuator="rudder", type="bias"), Fault(at_s=12.0),
    Fault(at_s=13.0, actuator="rudder", type="stuck"),
))  # fmt: skip
FOUND = {
    "isolated": "rudder", "isolation_type": "stuck", "isolation_time_s": 13.5, "type_time_s": 13.75,
    "candidates": ["stuck"], "estimate": 0.1, "estimate_interval": (0.05, 0.15), "frequency_rad_s": None,
}  # fmt: skip


def test_each_of_several_faults_is_held_against_its_own_surfaces_first():
    (one,) = _of(TWO, faults=(FOUND,), isolated="rudder", isolation_type="stuck")["isolation"]["faults"]
    assert (one["fault"], one["type"], one["correct"], one["type_correct"]) == ("rudder", "stuck", True, True)
    assert one["delay_s"] == pytest.approx(0.5)
    assert one["type_delay_s"] == pytest.approx(0.75)
    assert one["estimate_deg"] == pytest.approx(math.degrees(0.1))
    assert one["estimate_interval"] == [0.05, 0.15]


@pytest.mark.parametrize(
    ("changes", "key", "value"),
    [
        ({"isolation_type": "float"}, "type_correct", False),
        ({"isolation_type": None}, "type_correct", None),
        ({"isolated": "aileron"}, "correct", False),
        ({"isolated": "aileron"}, "delay_s", None),
        ({"isolated": None}, "correct", None),
        ({"isolated": None}, "so_far", None),
        ({}, "so_far", True),
        ({"isolation_type": "loss_of_effectiveness", "estimate": -0.4}, "estimate_deg", None),
        ({"estimate": None}, "estimate_deg", None),
        ({"estimate_interval": None}, "estimate_interval", None),
    ],
)
def test_what_is_wrong_or_open_of_one_of_several(changes, key, value):
    assert _of(TWO, faults=(FOUND | changes,))["isolation"]["faults"][0][key] == value


@pytest.mark.parametrize(("surface", "kind", "right"), [("rudder", "stuck", True), ("rudder", "bias", False)])
def test_of_several_faults_the_verdict_is_held_against_that_of_its_surface(surface, kind, right):
    found = _of(TWO, faults=(FOUND,), isolated=surface, isolation_type=kind, isolation_time_s=13.5)
    assert found["isolation"]["correct"] is True
    assert found["isolation"]["type_correct"] is right


@pytest.mark.parametrize(
    ("exits", "inside"), [([], True), ([(13.0, 14.5)], True), ([(3.0, 4.0), (13.0, 30.0)], False)]
)
def test_a_flight_arrives_in_the_envelope_if_it_has_come_back_to_it(exits, inside):
    document = _of(arrival={"altitude_m": 2.0}, envelope_exits=exits, outside_at_end=not inside)
    assert document["arrival"]["in_envelope"] is inside
    assert document["arrival"]["altitude_m"] == 2.0
    assert _of(arrival={"altitude_m": 2.0}, departure=(14.5, "alpha_rad"))["arrival"] is None
