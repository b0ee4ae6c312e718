"""Each key of `expect:` on its limit and beyond it: whether it is met, and the sentence for it."""

import pytest

from beaver_ftc.results.expectations import evaluate, expectations_in_words
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.expect import Expect
from given import given

GIVEN = given(__file__)

# Where the metrics have it.
PATHS = {
    "detected_within_s": "detection.delay_s", "isolated_within_s": "isolation.delay_s",
    "isolated_as": "isolation.fault", "isolated_type": "isolation.type",
    "candidate_type": "isolation.candidates", "no_false_alarm": "false_alarm", "no_departure": "departure",
    "altitude_within_m": "profile.altitude_m", "airspeed_within_mps": "profile.airspeed_mps",
    "airspeed_within_limits_mps": "profile.airspeed_limited_mps", "heading_within_deg": "profile.heading_deg",
    "stays_in_envelope": "envelope.exits", "arrives.altitude_m": "arrival.altitude_m",
    "arrives.in_envelope": "arrival.in_envelope",
    "pre_fault_rms_deg_s.p": "tracking.pre_fault_rms_deg_s.p",
    "post_fault_rms_deg_s.q": "tracking.post_fault_rms_deg_s.q",
}  # fmt: skip
# What is expected, what the metrics have, whether that passes, and what is said.
SAID = GIVEN["said"]  # fmt: skip


def nested(path, value):
    """The value at its path."""
    for key in reversed(path.split(".")):
        value = {key: value}
    return value


@pytest.mark.parametrize(("name", "expected", "found", "passed", "said"), SAID)
def test_an_expectation_is_met_and_said(name, expected, found, passed, said):
    metrics = Metrics.of({"isolation": {}} | nested(PATHS[name], found))
    (judged,) = evaluate(Expect.model_validate(nested(name, expected)), metrics)
    (held,) = expectations_in_words(Metrics.of({"expectations": [judged.document()]}))
    assert (held.name, held.passed, held.sentence) == (name, passed, said)


def test_every_key_of_expect_is_held_here():
    assert {name.partition(".")[0] for name, *_ in SAID} == set(Expect.model_fields)


EARLY = {
    "isolation": {"fault": "rudder", "names": ["rudder"], "time_s": 1.5, "delay_s": 0.5, "premature": True}
}
GONE = [{"fault": name, "from_s": at, "to_s": at + 0.25} for name, at in (("flap", 2.0), ("rudder", 3.0))]
GONE += [{"fault": "rudder", "from_s": 4.0, "to_s": 4.5}]
WITHDRAWN = {"isolation": {"fault": None, "withdrawn": GONE}}


@pytest.mark.parametrize(
    ("name", "expected", "metrics", "met", "reason"),
    [
        ("isolated_as", "rudder", EARLY, False, "rudder was named at 1.5 s, before the fault began"),
        ("isolated_as", ["rudder"], EARLY, True, None),
        ("isolated_as", ["flap", "rudder"], {"isolation": {"names": ["flap", "rudder"]}}, True, None),
        ("isolated_as", ["flap", "rudder"], {"isolation": {"names": ["rudder", "flap"]}}, False, None),
        ("isolated_within_s", 0.5, EARLY, False, "rudder was named at 1.5 s, before the fault began"),
        ("isolated_as", "rudder", WITHDRAWN, False,
         "rudder was named at 4 s, and the name withdrawn at 4.5 s"),
        ("isolated_as", "elevator", WITHDRAWN, False, None),
    ],
)  # fmt: skip
def test_why_the_diagnosis_does_not_do_what_was_expected(name, expected, metrics, met, reason):
    (found,) = evaluate(Expect.model_validate({name: expected}), Metrics.of(metrics))
    assert (found.passed, found.reason) == (met, reason)
