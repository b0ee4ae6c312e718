"""Sections against each other: what is said of contradictions and of what is unwise, right at each bound."""

from pathlib import Path

import pytest
import yaml

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.schema import load, load_text

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
CANNOT = [
    "actuators: {travel_deg: [-90.1, 90]}",
    "actuators: {travel_deg: [-90, 90.1]}",
    "actuators: {flap: {travel_deg: [5, 5]}}",
    "actuators: {flap: 3, rudder: {rate: 4}}",
    "actuators: {flop: {}, bandwith_rad_s: 3}",
    "duration_s: 0.049\nrate_hz: 20",
    "duration_s: 10\nfaults: [" + ", ".join(f"{FLOAT}{at}}}" for at in (0, 9.9, 10, 11)) + "]",
    f"faults: [3, {FLOAT}31}}, {FLOAT}'x'}}]",
    "changes: [{at_s: 5, law: nominal}, {at_s: 5, law: lqr}, {at_s: 31, law: lqr}, {at_s: 4, law: lqr}]",
    "changes: [{at_s: 5}]",
    "faults: [{actuator: rudder, type: loss_of_effectiveness, magnitude: 1, at_s: 5, end_s: 4,"
    " profile: incipient}]",
    "autopilot: {altitude_m: [{value: -300.5}, {at_s: 1, value: 90000}], airspeed_mps: [{value: 3}]}",
    "expect: {detected_within_s: 1, isolated_as: flap, isolated_type: float, no_departure: true}",
    "expect: {candidate_type: float, isolated_within_s: 1, post_fault_rms_deg_s: {p: 1}}",
    "expect: {altitude_within_m: 1, airspeed_within_mps: 1, airspeed_within_limits_mps: 1}",
    "expect: {heading_within_deg: 1, arrives: {altitude_m: 1, airspeed_mps: 1, heading_deg: 1}}",
    "autopilot: {altitude_m: []}\nexpect: {altitude_within_m: 1}\nsubsteps: 0",
    "faults: []\nexpect: {detected_within_s: 1}\nsubsteps: 0",
    "autopilot: {altitude_m: [{at_s: 1, value: 9}, {at_s: 1, value: 9}, {value: 9}]}",
    "autopilot: {heading_deg: [{value: 9}], bank_deg: [{value: 9}]}",
    "autopilot: {bank_deg: [{value: 9, hold: true}, {at_s: 1}]}",
    f"environment: {{gust: [{GUST}1}}, {GUST}6.9}}]}}",
    "environment: {turbulence: severe}",
    "environment: {severity: light}",
    "environment: {turbulence: dryden}",
    "control: {power: {lowest_inhg: 20, highest_inhg: 19.9}}",
    "fdi: {pairs: true}",
    "fdi: {authority: statistical}",
    "fdi: {bounds: {sensors: {p: {delay_s: 0.1}, q: {bias_deg_s: 1}, r: {dropout_share: 0.1}}}}",
    "fdi: {bounds: {sensors: {q: {scale_error: 1}, r: {scale_error: 0.9}}}}",
    "fdi: {bounds: {coefficients: {Cm_alfa: 0.1, CZ_alpha: 0.1, Cm_q: 0.1}}}",
    "fdi: {scheme: rls}",
    "uncertainty: {coefficients: {Cm_alfa: 1, " + ", ".join(f"C{i}: 1" for i in range(70)) + "}}",
    "faults: [{sensor: p, type: bias, magnitude: -200.1, at_s: 1}]",
    "faults: [{sensor: airspeed, type: noise, magnitude: 100.1, at_s: 1}]",
    "faults: [{sensor: p, type: scale, magnitude: 2.1, at_s: 1, end_s: 1}]",
    "faults: [{type: bias, bias_deg: 1, actuator: flap, at_s: 1, profile: incipient}]",
    "faults: [{type: bias, bias_deg: 1, actuator: flap, at_s: 1, kappa_per_s: 1}]",
    "aircraft: ./nowhere",
    "aircraft: jsbsim:no one",
]


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
    given = yaml.safe_load((Path(__file__).parents[1] / "data" / "unwise.yaml").read_text())
    assert not changed({case: load({"name": "x", **keys}).warnings() for case, keys in given.items()})
