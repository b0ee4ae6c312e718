"""The words of the verdict: each kind of value that an expectation can hold, as a reader sees it."""

import pytest

from beaver_ftc.results.verdict import expectations
from beaver_ftc.scenario.schema import Expect

# Each key of `expect:` with what the metrics say of it, and the sentence that a reader is shown.
SAID = [
    ("detected_within_s", 0.5, 0.01, ("≤ 0.5", "0.01")),
    ("detected_within_s", 0.5, None, ("≤ 0.5", "none")),
    ("isolated_within_s", 1.0, 0.256, ("≤ 1", "0.256")),
    ("isolated_as", "elevator", "rudder", ("elevator", "rudder")),
    ("isolated_as", "elevator", None, ("elevator", "none")),
    ("isolated_type", "stuck", "float", ("stuck", "float")),
    ("candidate_type", "bias", ["stuck", "bias"], ("bias", "stuck, bias")),
    ("candidate_type", "bias", ["flap:stuck", "elevator:bias"], ("bias", "flap:stuck, elevator:bias")),
    ("candidate_type", "bias", [], ("bias", "none")),
    ("no_false_alarm", True, False, ("yes", "no")),
    ("no_departure", False, True, ("no", "yes")),
    ("pre_fault_rms_deg_s.p", 0.5, 0.2, ("≤ 0.5", "0.2")),
    ("post_fault_rms_deg_s.q", 1.0, 0.11249, ("≤ 1", "0.112")),
    ("altitude_within_m", 15, 3.4567, ("≤ 15", "3.46")),
    ("airspeed_within_mps", 3, None, ("≤ 3", "none")),
    ("heading_within_deg", 5, 7.0, ("≤ 5", "7")),
    ("stays_in_envelope", True, False, ("yes", "no")),
]


@pytest.mark.parametrize(("name", "expected", "actual", "said"), SAID)
def test_an_expectation_in_words(name, expected, actual, said):
    found = {"name": name, "expected": expected, "actual": actual, "passed": False}
    assert expectations({"expectations": [found]}) == [(name, *said, False)]


def test_every_key_of_expect_is_said_in_words_here():
    assert {name.partition(".")[0] for name, *_ in SAID} == set(Expect.model_fields)
