"""The outer loops of aircraft that were derived: a jet, a propeller, a glider; and what is refused."""

import numpy as np
import pytest

import needs
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import Scenario
from flying import Memory

pytestmark = needs.service("derive")


def flown(autopilot, duration_s=90.0, aircraft="jsbsim:c172p", **keys):
    memory, given = Memory(), {"name": "x", "aircraft": aircraft, "duration_s": duration_s, **keys}
    return fly(Scenario.model_validate(given | {"autopilot": autopilot}), memory), memory


def test_a_propeller_climbs_turns_and_speeds_up():
    """In still air: the climb is 40 m, the turn 30 deg, the airspeed 3 m/s more."""
    legs = {"altitude_m": [{"value": 1540}], "heading_deg": [{"at_s": 30, "value": 30}],
            "airspeed_mps": [{"hold": True}, {"at_s": 60, "value": 50.8, "change_mps2": 0.3}]}  # fmt: skip
    flight, log = flown(legs)
    assert flight.departure is None
    assert flight.detection_time_s is None
    assert np.degrees(log["psi_rad"][-1]) == pytest.approx(30.0, abs=0.5)
    assert log["altitude_m"][-1] == pytest.approx(1540.0, abs=1.0)
    assert log["airspeed_mps"][-1] == pytest.approx(50.8, abs=0.5)
    assert np.ptp(log["throttle"]) > 0.05
    assert log["throttle"].min() >= 0.0
    assert log["throttle"].max() <= 1.0


def energy_lost_m(log):
    """Height and airspeed as height: what drag has taken."""
    height = log["altitude_m"] + log["airspeed_mps"] ** 2 / (2.0 * 9.81)
    return height[0] - height[-1]


def test_a_glider_holds_its_airspeed_and_pays_for_more_with_height():
    """With what 2 m/s more take counted, energy goes at nearly the same rate."""
    glider = {"duration_s": 40.0, "aircraft": "jsbsim:SGS", "initial": {"altitude_m": 2500}}
    _, held = flown({"airspeed_mps": [{"hold": True}]}, **glider)
    assert held["airspeed_mps"] == pytest.approx(held["airspeed_mps"][0], abs=0.2)
    _, faster = flown({"airspeed_mps": [{"value": 28.2, "change_mps2": 0.5}]}, **glider)
    assert faster["airspeed_mps"][-1] == pytest.approx(28.2, abs=0.3)
    assert energy_lost_m(faster) == pytest.approx(energy_lost_m(held), rel=0.2)
