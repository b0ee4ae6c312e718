"""Sections against each other: what is said of contradictions and of what is unwise, right at each bound."""

import pytest

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.schema import load, load_text
from given import documents, given

GIVEN = given(__file__)

FLOAT = "{type: float, actuator: flap, at_s: "
GUST = "{velocity_mps: [0, 0, 1], rise_s: 1, hold_s: 2, fade_s: 3, at_s: "
CAN = {
    "actuators: {travel_deg: [-90, 90]}",
    "duration_s: 0.05\nrate_hz: 20",
    f"faults: [{FLOAT}29.9}}]",
    "changes: [{at_s: 1, law: nominal}, {at_s: 1.5, scheme: none}]",
    f"environment: {{gust: [{GUST}1}}, {GUST}7}}, {GUST}13}}]}}",
    "autopilot: {altitude_m: [{at_s: 0, hold: true}, {at_s: 0.1, value: 2000}]}",
    "autopilot: {altitude_m: [{value: -300}]}",
    "control: {power: {lowest_inhg: 20, highest_inhg: 20}}",
    "fdi: {pairs: true, fault_class: all}",
    "fdi: {authority: statistical, statistical: {}}",
    "autopilot: {heading_deg: [{value: 9}]}\nexpect: {heading_within_deg: 9, arrives: {heading_deg: 3}}",
}
CANNOT = GIVEN["cannot"]


@pytest.mark.parametrize("text", sorted(CAN))
def test_what_is_just_allowed(text):
    assert load_text(f"name: x\n{text}").name == "x"


def test_what_contradictions_are_called(changed):
    found = {}
    for text in CANNOT:
        with pytest.raises(ScenarioError) as caught:
            load_text(f"name: x\n{text}", "s.yaml")
        found[text[:90]] = [line[:180] for line in caught.value.lines]
    assert not changed(found)


def test_what_is_unwise_is_said_at_the_bound_and_not_before(changed):
    cases = documents("unwise")[0].items()
    assert not changed({case: load({"name": "x", **keys}).warnings() for case, keys in cases})
