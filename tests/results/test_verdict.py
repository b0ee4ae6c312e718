"""The words of the verdict: each kind of value that an expectation can hold, as a reader sees it."""

import pytest

from beaver_ftc.results import verdict
from beaver_ftc.results.expectations import expectations_in_words
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.schema import Expect

# Each key of `expect:` with what the metrics say of it, whether it passes, and the sentence
# that a reader is shown.
SAID = [
    ("detected_within_s", 0.5, 0.01, True, "detection delay ≤ 0.5 s, got 0.01 s (2 % of the limit)"),
    ("detected_within_s", 0.5, None, False, "detection delay ≤ 0.5 s, got none"),
    ("detected_within_s", 1.0, 15.96, False, "detection delay ≤ 1 s, got 16 s (1600 % of the limit)"),
    ("altitude_within_m", 2000, 1234.5, True,
     "altitude deviation ≤ 2000 m, got 1230 m (61.7 % of the limit)"),
    ("isolated_within_s", 1.0, 0.256, True, "isolation delay ≤ 1 s, got 0.256 s (25.6 % of the limit)"),
    ("isolated_as", "elevator", "rudder", False, "isolated fault elevator, got rudder"),
    ("isolated_as", "elevator", None, False, "isolated fault elevator, got none"),
    ("isolated_as", "elevator", "elevator", True, "isolated fault elevator"),
    ("isolated_type", "stuck", "float", False, "fault type stuck, got float"),
    ("candidate_type", "bias", ["stuck", "bias"], True, "possible fault types include bias, got stuck, bias"),
    ("candidate_type", "bias", [], False, "possible fault types include bias, got none"),
    ("no_false_alarm", True, False, False, "no false alarm, got a false alarm"),
    ("no_false_alarm", True, True, True, "no false alarm"),
    ("no_departure", False, True, False, "a departure, got no departure"),
    ("pre_fault_rms_deg_s.p", 0.5, 0.2, True,
     "roll rate RMS before the fault ≤ 0.5 deg/s, got 0.2 deg/s (40 % of the limit)"),
    ("post_fault_rms_deg_s.q", 1.0, 0.11249, True,
     "pitch rate RMS after the fault ≤ 1 deg/s, got 0.112 deg/s (11.2 % of the limit)"),
    ("altitude_within_m", 15, 3.4567, True, "altitude deviation ≤ 15 m, got 3.46 m (23 % of the limit)"),
    ("airspeed_within_limits_mps", 5, 1.25, True,
     "deviation from the limited airspeed (10 s mean) ≤ 5 m/s, got 1.25 m/s (25 % of the limit)"),
    ("airspeed_within_mps", 3, None, False, "airspeed deviation (10 s mean) ≤ 3 m/s, got none"),
    ("heading_within_deg", 5, 7.0, False, "heading deviation ≤ 5 deg, got 7 deg (140 % of the limit)"),
    ("stays_in_envelope", True, False, False, "stays in the envelope, got leaves the envelope"),
    ("arrives.altitude_m", 20.0, -31.2, False,
     "altitude deviation at the end ≤ 20 m, got -31.2 m (156 % of the limit)"),
    ("arrives.in_envelope", True, False, False,
     "inside the envelope at the end, got outside the envelope at the end"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "expected", "actual", "passed", "said"), SAID)
def test_an_expectation_in_words(name, expected, actual, passed, said):
    found = {"name": name, "expected": expected, "actual": actual, "passed": passed}
    (held,) = expectations_in_words(Metrics.of({"expectations": [found]}))
    assert (held.name, held.sentence, held.passed) == (name, said, passed)


def test_every_key_of_expect_is_said_in_words_here():
    assert {name.partition(".")[0] for name, *_ in SAID} == set(Expect.model_fields)


DETECTION = {"detected": True, "time_s": 12.5, "delay_s": 0.5, "guaranteed_delay_s": None, "axis": "q"}


def flown(**changes):
    """The metrics of a flight of which little is to be said."""
    nothing = {
        "detection": DETECTION | {"detected": False}, "isolation": {"isolated": False, "candidates": []},
        "fault": None, "false_alarm": False, "supervisor": [], "authority": None, "engine_power": None,
        "envelope_exits": [], "departure": None, "saturation_s": {}, "changes": [], "profile": None,
    }  # fmt: skip
    rms = {"p": 0.1, "q": 0.25, "r": 1.0}
    tracking = {"pre_fault_rms_deg_s": None, "post_fault_rms_deg_s": rms}
    expected = {"name": "no_false_alarm", "expected": True, "actual": True, "passed": True}
    missed = {"name": "detected_within_s", "expected": 0.5, "actual": None, "passed": False}
    return {
        "scenario": "a-flight", "expectations": [expected, missed], "passed": False, "tracking": tracking,
        **nothing, **changes,
    }  # fmt: skip


def test_markup_in_a_name_is_no_markup():
    text = verdict.verdict_text(Metrics.of(flown(scenario="[red]x[/red] :smile:")), "runs/[bold]x")
    assert "[red]x[/red] :smile:" in text
    assert "runs/[bold]x" in text


@pytest.mark.parametrize(
    ("changes", "title", "outcome_class"),
    [
        ({"passed": True}, "PASSED", "good"),
        ({"passed": True, "departure": None}, "PASSED", "good"),
        ({"passed": True, "departure": {"time_s": 1.0}}, "PASSED, the aircraft was LOST", "lost"),
        ({"departure": {"time_s": 1.0}}, "FAILED, the aircraft was LOST", "bad"),
        ({"interrupted_s": 2.5}, "INTERRUPTED at 2.50 s, not passed", "bad"),
        ({"expectations": [], "passed": True}, "flown, nothing was expected", "good"),
    ],
)
def test_the_title_and_the_mood(changes, title, outcome_class):
    document = flown(**changes)
    assert (verdict.title(Metrics.of(document)), verdict.outcome_class(Metrics.of(document))) == (
        f"a-flight: {title}",
        outcome_class,
    )


def test_an_alarm_does_not_hide_where_nothing_could_be_concluded():
    reason = {"quantity": "altitude_m", "flown": None, "share": 0.25, "says": "too high"}
    blind = {"share": 0.25, "from_s": 3.5, "reasons": [reason]}
    found = {"detected": True, "delay_s": 0.75, "time_s": 2.75, "axis": "r", "guaranteed_delay_s": None}
    said = dict(verdict.verdict_lines(Metrics.of(flown(detection=found | {"inconclusive": blind}))))
    assert said["detection"] == "after 0.75 s on r"
    assert said["inconclusive"] == "nothing can be concluded in 25 % of the frames from 3.50 s on: too high"
