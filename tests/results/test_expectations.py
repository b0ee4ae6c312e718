"""Each rule of `expect:` on its limit and beyond it."""

import pytest

from beaver_ftc.results.expectations import evaluate
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.schema import Expect

METRICS = {
    "isolation": {"fault": "elevator", "type": "stuck", "candidates": ["flap:stuck", "elevator:bias"]},
    "false_alarm": False, "departure": None, "envelope": {"exits": 2},
    "profile": {"altitude_m": 15.0, "airspeed_mps": 2.0, "heading_deg": 4.0},
}  # fmt: skip


def _found(name, expected, metrics):
    (found,) = evaluate(Expect.model_validate({name: expected}), Metrics.of(metrics))
    assert (found.name, found.expected) == (name, expected)
    return found.actual, found.passed


@pytest.mark.parametrize(
    ("name", "expected", "actual", "met"),
    [
        ("isolated_as", "elevator", "elevator", True),
        ("isolated_as", "flap", "elevator", False),
        ("isolated_type", "stuck", "stuck", True),
        ("isolated_type", "bias", "stuck", False),
        ("candidate_type", "bias", ["flap:stuck", "elevator:bias"], True),
        ("candidate_type", "float", ["flap:stuck", "elevator:bias"], False),
        ("no_false_alarm", True, True, True),
        ("no_false_alarm", False, True, False),
        ("no_departure", True, True, True),
        ("no_departure", False, True, False),
        ("altitude_within_m", 15.0, 15.0, True),
        ("altitude_within_m", 14.9, 15.0, False),
        ("airspeed_within_mps", 2.0, 2.0, True),
        ("heading_within_deg", 3.9, 4.0, False),
        ("stays_in_envelope", True, False, False),
        ("stays_in_envelope", False, False, True),
    ],
)
def test_a_rule(name, expected, actual, met):
    assert _found(name, expected, METRICS) == (actual, met)


EARLY = {
    "isolation": {"fault": "rudder", "names": ["rudder"], "time_s": 1.5, "delay_s": 0.5, "premature": True}
}
GONE = [{"fault": name, "from_s": at, "to_s": at + 0.25} for name, at in (("flap", 2.0), ("rudder", 3.0))]
GONE += [{"fault": "rudder", "from_s": 4.0, "to_s": 4.5}]


@pytest.mark.parametrize(
    ("name", "expected", "metrics", "met", "reason"),
    [
        ("isolated_as", "rudder", EARLY, False, "rudder was named at 1.5 s, before the fault began"),
        ("isolated_as", ["rudder"], EARLY, True, None),
        ("isolated_as", ["flap", "rudder"], {"isolation": {"names": ["flap", "rudder"]}}, True, None),
        ("isolated_as", ["flap", "rudder"], {"isolation": {"names": ["rudder", "flap"]}}, False, None),
        ("isolated_as", ["flap", "rudder"], {"isolation": {"names": ["flap"]}}, False, None),
        ("isolated_within_s", 0.5, EARLY, False, "rudder was named at 1.5 s, before the fault began"),
        (
            "isolated_as",
            "rudder",
            {"isolation": {"fault": None, "withdrawn": GONE}},
            False,
            "rudder was named at 4 s, and the name withdrawn at 4.5 s",
        ),
        ("isolated_as", "elevator", {"isolation": {"fault": None, "withdrawn": GONE}}, False, None),
        ("detected_within_s", 0.5, {"detection": {"delay_s": 0.5}}, True, None),
        ("detected_within_s", 0.5, {"detection": {"delay_s": None}, "isolation": {}}, False, None),
    ],
)
def test_why_the_diagnosis_does_not_do_what_was_expected(name, expected, metrics, met, reason):
    (found,) = evaluate(Expect.model_validate({name: expected}), Metrics.of(metrics))
    assert (found.passed, found.reason) == (met, reason)


@pytest.mark.parametrize(
    ("off_m", "met"), [(12.0, True), (-12.0, True), (12.1, False), (-12.1, False), (None, False)]
)
def test_an_arrival_is_as_near_on_either_side(off_m, met):
    expect = Expect.model_validate({"arrives": {"altitude_m": 12.0}})
    (found,) = evaluate(expect, Metrics.of({"arrival": {"altitude_m": off_m}}))
    assert (found.name, found.passed) == ("arrives.altitude_m", met)
