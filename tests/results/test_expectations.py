"""Each key of `expect:` on its limit and beyond it: whether it is met, and the sentence for it."""

import pytest

from beaver_ftc.results.expectations import evaluate, expectations_in_words
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.expect import Expect

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
SAID = [
    ("detected_within_s", 0.5, 0.01, True, "detection delay ≤ 0.5 s, got 0.01 s (2 % of the limit)"),
    ("detected_within_s", 0.5, 0.5, True, "detection delay ≤ 0.5 s, got 0.5 s (100 % of the limit)"),
    ("detected_within_s", 0.5, None, False, "detection delay ≤ 0.5 s, got none"),
    ("detected_within_s", 1.0, 15.96, False, "detection delay ≤ 1 s, got 16 s (1600 % of the limit)"),
    ("isolated_within_s", 1.0, 0.256, True, "isolation delay ≤ 1 s, got 0.256 s (25.6 % of the limit)"),
    ("isolated_as", "elevator", "rudder", False, "isolated fault elevator, got rudder"),
    ("isolated_as", "elevator", None, False, "isolated fault elevator, got none"),
    ("isolated_as", "elevator", "elevator", True, "isolated fault elevator"),
    ("isolated_type", "stuck", "float", False, "fault type stuck, got float"),
    ("isolated_type", "stuck", "stuck", True, "fault type stuck"),
    ("candidate_type", "bias", ["flap:stuck", "bias"], True,
     "possible fault types include bias, got flap:stuck, bias"),
    ("candidate_type", "bias", ["flap:bias"], True, "possible fault types include bias, got flap:bias"),
    ("candidate_type", "bias", [], False, "possible fault types include bias, got none"),
    ("no_false_alarm", True, True, False, "no false alarm, got a false alarm"),
    ("no_false_alarm", True, False, True, "no false alarm"),
    ("no_departure", False, None, False, "a departure, got no departure"),
    ("no_departure", True, None, True, "no departure"),
    ("pre_fault_rms_deg_s.p", 0.5, 0.2, True,
     "roll rate RMS before the fault ≤ 0.5 deg/s, got 0.2 deg/s (40 % of the limit)"),
    ("post_fault_rms_deg_s.q", 1.0, 0.11249, True,
     "pitch rate RMS after the fault ≤ 1 deg/s, got 0.112 deg/s (11.2 % of the limit)"),
    ("altitude_within_m", 2000, 1234.5, True,
     "altitude deviation ≤ 2000 m, got 1230 m (61.7 % of the limit)"),
    ("altitude_within_m", 14.9, 15.0, False, "altitude deviation ≤ 14.9 m, got 15 m (101 % of the limit)"),
    ("airspeed_within_limits_mps", 5, 1.25, True,
     "deviation from the limited airspeed (10 s mean) ≤ 5 m/s, got 1.25 m/s (25 % of the limit)"),
    ("airspeed_within_mps", 3, None, False, "airspeed deviation (10 s mean) ≤ 3 m/s, got none"),
    ("heading_within_deg", 5, 7.0, False, "heading deviation ≤ 5 deg, got 7 deg (140 % of the limit)"),
    ("stays_in_envelope", True, 2, False, "stays in the envelope, got leaves the envelope"),
    ("stays_in_envelope", False, 2, True, "leaves the envelope"),
    ("arrives.altitude_m", 20.0, -31.2, False,
     "altitude deviation at the end ≤ 20 m, got -31.2 m (156 % of the limit)"),
    ("arrives.altitude_m", 12.0, -12.0, True,
     "altitude deviation at the end ≤ 12 m, got -12 m (100 % of the limit)"),
    ("arrives.in_envelope", True, False, False,
     "inside the envelope at the end, got outside the envelope at the end"),
]  # fmt: skip


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
