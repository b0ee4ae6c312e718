"""The words of the verdict."""

import pytest

from beaver_ftc.results import verdict
from beaver_ftc.results.model import Metrics

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
        ({"passed": True, "departure": {"time_s": 1.0}}, "PASSED, the aircraft was LOST", "lost"),
        ({"departure": {"time_s": 1.0}}, "FAILED, the aircraft was LOST", "bad"),
        ({"interrupted_s": 2.5}, "INTERRUPTED at 2.50 s, not passed", "bad"),
        ({"expectations": [], "passed": True}, "flown, nothing was expected", "good"),
    ],
)
def test_the_title_and_the_mood(changes, title, outcome_class):
    metrics = Metrics.of(flown(**changes))
    assert (verdict.title(metrics), verdict.outcome_class(metrics)) == (f"a-flight: {title}", outcome_class)


def test_an_axis_about_which_no_surface_acts_has_lost_nothing():
    names = ("least_rad_s2", "greatest_rad_s2", "healthy_least_rad_s2", "healthy_greatest_rad_s2")
    of = {"given_share": 1.0, "beyond_s": 0.0}
    authority = {"p": of | dict(zip(names, (-1.0, 2.0, -2.0, 4.0), strict=True)), "q": of}
    authority["r"] = of | dict.fromkeys(names, 0.0)
    said = dict(verdict.verdict_lines(Metrics.of(flown(authority=authority))))
    assert said["remaining"] == "roll authority 50 % (-1 to 2 rad/s2)"


def test_a_size_that_grows_is_not_compared_at_an_unknown_time():
    fault = {"actuator": "rudder", "type": "loss_of_effectiveness", "at_s": 1.0, "profile": "incipient"}
    named = {"isolated": True, "fault": "rudder", "type": fault["type"], "estimate": -0.5, "correct": True}
    metrics = Metrics.of(flown(faults=[fault | {"size": {"magnitude": 0.5}}], isolation=named))
    assert (
        dict(verdict.verdict_lines(metrics))["isolation"]
        == "rudder; correct, loss of effectiveness, estimated loss 50 %"
    )


def test_an_alarm_does_not_hide_where_nothing_could_be_concluded():
    reason = {"quantity": "altitude_m", "flown": None, "share": 0.25, "says": "too high"}
    blind = {"share": 0.25, "from_s": 3.5, "reasons": [reason]}
    found = {"detected": True, "delay_s": 0.75, "time_s": 2.75, "axis": "r", "guaranteed_delay_s": None}
    said = dict(verdict.verdict_lines(Metrics.of(flown(detection=found | {"inconclusive": blind}))))
    assert said["detection"] == "after 0.75 s on r"
    assert said["inconclusive"] == "nothing can be concluded in 25 % of the frames from 3.50 s on: too high"
