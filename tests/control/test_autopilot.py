"""The outer loops: the commanded profile by hand, kinematics against the truth, and flights that arrive."""

import numpy as np
import pytest

from beaver_ftc.control.autopilot import set_body_rates
from beaver_ftc.control.autopilot_setup import AUTOPILOT, GAINS
from beaver_ftc.control.laws.loop_design import margins
from beaver_ftc.control.profile import BANK
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.schema import Scenario
from flying import Memory, loss

STRAIGHT = {
    "altitude_m": [{"at_s": 0, "hold": True}],
    "airspeed_mps": [{"at_s": 0, "value": 45}],
    "heading_deg": [{"at_s": 0, "hold": True}],
}
REAL = {
    "sensors": "tactical-grade", "actuators": "servo",
    "environment": {"turbulence": "dryden", "severity": "light"},
    "fdi": {"bounds": {"sensors": "tactical-grade", "turbulence": "light"}},
}  # fmt: skip


def flown(duration_s=60.0, autopilot=None, **keys):
    memory = Memory()
    profile = STRAIGHT | (autopilot or {})
    given = {"name": "test", "duration_s": duration_s, "autopilot": profile, **keys}
    return fly(Scenario.model_validate(given), memory), memory


def altitude_error_bound_m(log):
    return log["altitude_m"] - log["altitude_command_m"]


def heading_off(log):
    return np.degrees(np.arcsin(np.sin(log["psi_rad"] - log["heading_command_rad"])))


def test_body_rates_of_a_steady_turn():
    """Against the derivative of the attitude's rotation matrix: omega = R^T R' [Etkin1996]."""
    theta, phi = 0.2, 0.4
    autopilot = np.zeros(1, AUTOPILOT)[0]
    autopilot["gravity"], autopilot["airspeed"], autopilot["dihedral"] = 9.81, 45.0, 0.02
    autopilot["is_commanded"][BANK], autopilot["rate_limit"] = 1, 10.0
    set_body_rates(
        np.asarray(autopilot).view(np.recarray), np.zeros(8), np.array([phi, theta, 1.0]), 0.03, 0.05
    )
    psidot = 9.81 / 45.0 * np.tan(phi)

    def rotation(t):
        def about(axis, angle):
            c, s = np.cos(angle), np.sin(angle)
            i, j = [(1, 2), (2, 0), (0, 1)][axis]
            R = np.eye(3)
            R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
            return R

        return about(2, 1.0 + psidot * t) @ about(1, theta + 0.05 * t) @ about(0, phi + 0.03 * t)

    h = 1e-6
    cross = rotation(0.0).T @ (rotation(h) - rotation(-h)) / (2.0 * h)
    expected = [cross[2, 1], cross[0, 2], cross[1, 0]]
    np.testing.assert_allclose(autopilot["rates"], expected, atol=1e-8)


def test_the_outer_loops_have_margins():
    """Each broken at its demand, inside out; the inner loop a lag of 4 1/s, the airspeed's smoothing in."""
    s = 1j * np.geomspace(1e-3, 100.0, 4000)
    inner = 1.0 / (1.0 + s / 4.0)
    attitude, bank = (GAINS[name] / s * inner for name in ("attitude", "bank"))
    path = (GAINS["altitude"] + GAINS["altitude_i"] / s) / s * attitude / (1.0 + attitude)
    heading = GAINS["heading"] / s * bank / (1.0 + bank)
    smoothed = s * (1.0 + GAINS["airspeed_s"] * s)
    speed = (GAINS["speed"] + GAINS["speed_i"] / s) / smoothed
    for loop, least_deg in ((attitude, 55.0), (bank, 55.0), (path, 55.0), (heading, 55.0), (speed, 42.0)):
        upper, lower, phase = margins(loop)
        assert min(upper, lower) > 13.0
        assert phase > least_deg


class TestFlights:
    def test_still_air_climb_turn_and_slow_down(self):
        profile = {
            "altitude_m": [{"at_s": 0, "hold": True}, {"at_s": 10, "value": 1878.8, "climb_mps": 2}],
            "airspeed_mps": [{"at_s": 0, "value": 45}, {"at_s": 60, "value": 40}],
            "heading_deg": [{"at_s": 0, "hold": True}, {"at_s": 20, "value": 60}],
        }
        flight, log = flown(110.0, profile, actuators="servo")
        assert np.abs(altitude_error_bound_m(log)).max() < 5.0
        assert flight.profile["airspeed_mps"] < 1.5
        assert np.abs(heading_off(log)[5500:]).max() < 1.0
        assert np.degrees(np.abs(log["beta_rad"][500:])).max() < 2.5  # coordinated
        assert flight.exits == 0

    def test_bank(self):
        profile = {"heading_deg": [], "bank_deg": [{"at_s": 5, "value": 20}]}
        _, log = flown(30.0, profile)
        bank, V = log["phi_rad"][-1], log["airspeed_mps"][-1]
        assert np.degrees(bank) == pytest.approx(20.0, abs=0.2)
        turned = np.diff(np.unwrap(log["psi_rad"]))[-500:].mean() * 100.0
        assert turned == pytest.approx(9.81 / V * np.tan(bank), rel=0.05)

    @pytest.mark.parametrize("V", [38.0, 52.0])
    def test_real_air(self, V):
        profile = {"airspeed_mps": [{"value": V}]}
        flight, _ = flown(120.0, profile, initial={"airspeed_mps": V}, **REAL)
        found = metrics(flight)["profile"]
        assert found["altitude_m"] < 20.0
        assert found["airspeed_mps"] < 4.5
        assert found["heading_deg"] < 6.0

    @pytest.mark.parametrize("off_deg", [1.0, 3.0, 5.0])
    def test_an_elevator_jammed_nose_down_is_carried_by_the_flap(self, off_deg):
        trimmed_deg = np.degrees(Loop(Scenario(name="trim")).trim.elevator_rad)
        fault = {"type": "stuck", "actuator": "elevator", "at_s": 30.0, "position_deg": trimmed_deg + off_deg}
        real = REAL | {"fdi": {"fault_class": "all", **REAL["fdi"]}}
        found = metrics(flown(100.0, faults=[fault], **real)[0])["profile"]
        assert found["altitude_m"] < 15.0
        assert found["airspeed_mps"] < 3.0
        assert found["heading_deg"] < 5.0

    def test_without_ailerons_the_rudder_rolls(self):
        flight, log = flown(120.0, faults=[loss("aileron", 1.0, at_s=20.0)], **REAL)
        assert flight.departure is None
        assert np.degrees(np.abs(log["phi_rad"])).max() < 20.0
        assert metrics(flight)["profile"]["heading_deg"] < 8.0
