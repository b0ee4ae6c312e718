"""Envelope protection: level flight against the truth's trim, limits by brute force, jams that are kept."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.control import envelope_protection as holding
from beaver_ftc.control.autopilot_setup import AUTOPILOT
from beaver_ftc.control.level_flight import elevator_needed
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import measure, metrics
from beaver_ftc.results.verdict import verdict_lines
from beaver_ftc.scenario.schema import Scenario
from flying import Memory

MASS_KG, DENSITY = 2288.231, 1.0238  # the latter at 1828.8 m
STRAIGHT = {"altitude_m": [{"hold": True}], "airspeed_mps": [{"hold": True}], "heading_deg": [{"hold": True}]}


def jammed(position_deg):
    fault = {"actuator": "elevator", "type": "stuck", "position_deg": position_deg, "at_s": 20.0}
    given = {"name": "jam", "duration_s": 100.0, "autopilot": STRAIGHT, "faults": [fault],
             "actuators": "servo", "fdi": {"fault_class": "all"}}  # fmt: skip
    memory = Memory()
    return fly(Scenario.model_validate(given), memory), memory


@pytest.mark.parametrize(
    ("V", "flap_deg", "inhg"), [(36, -5.7, 20.4), (45, -5.7, 20.2), (45, 0, 20.8), (42, 20, 22)]
)
def test_level_flight_takes_the_elevator_that_the_truth_is_trimmed_with(V, flap_deg, inhg):
    """The truth besides has sideslip, a round Earth, and a path that is level to within a degree."""
    trim = bf.trim(airspeed_mps=V, flap_deg=flap_deg, manifold_pressure_inhg=inhg)
    assert abs(np.degrees(trim.gamma_rad)) < 1.0
    qdyn = (0.5 * DENSITY * V**2,)
    needed = elevator_needed(load(), ("elevator", "flap"), MASS_KG, (), qdyn, (np.radians(flap_deg),))
    assert np.degrees(needed[0, 0]) == pytest.approx(np.degrees(trim.surfaces_rad["elevator"]), abs=0.1)


def table(elevator=lambda V, flap: np.radians(-20.0 + 0.4 * V) + 0.3 * flap):
    """An autopilot's record with the table of a made-up aircraft, at 1 kg/m3."""
    autopilot = np.zeros(1, AUTOPILOT)
    hold = autopilot["holding"]
    speeds = np.linspace(30.0, 55.0, hold["qdyn"].size)
    hold["qdyn"], hold["flap"] = 0.5 * speeds**2, np.linspace(-0.1, 1.0, hold["flap"].size)
    hold["elevator"] = [[elevator(V, f) for f in hold["flap"][0]] for V in speeds]
    return autopilot


@pytest.mark.parametrize("elevator_deg", np.linspace(-12.0, 8.0, 9))
@pytest.mark.parametrize("flap", [-0.1, 0.12, 0.95])
def test_the_limits_are_where_the_elevator_there_is_just_suffices(elevator_deg, flap):
    hold = table().view(np.recarray)[0].holding
    speeds = np.linspace(30.0, 55.0, 2001)
    can = np.radians(-20.0 + 0.4 * speeds) + 0.3 * flap <= np.radians(elevator_deg)  # at this end or beyond
    fastest = np.sqrt(
        2.0 * holding.dynamic_pressure_limit(hold, flap, np.radians(elevator_deg), holding.FASTEST)
    )
    slowest = np.sqrt(
        2.0 * holding.dynamic_pressure_limit(hold, flap, np.radians(elevator_deg), holding.SLOWEST)
    )
    if can.all():
        assert fastest == np.inf
    else:
        assert fastest == pytest.approx(speeds[can].max() if can.any() else 30.0, abs=0.1)
    if not can.any():
        assert slowest == 0.0
    else:
        assert slowest == pytest.approx(speeds[~can].min() if not can.all() else 55.0, abs=0.1)


def test_the_bank_limit_ends_with_the_loss():
    autopilot = table().view(np.recarray)[0]
    autopilot["holding"]["in_force"] = 1
    holding.record_limits_in_force(autopilot, (0, 1, 2), np.ones(4), 1.0)
    assert not autopilot["holding"]["in_force"][holding.BANK_LIMIT]


def test_a_limit_in_force_from_the_start_began_there():
    hold = table().view(np.recarray)[0].holding
    hold["from_s"] = -1.0
    for t, value in ((0.0, 40.0), (0.1, 41.0)):
        holding.record_limit(hold, holding.FASTEST, value, True, t)
    assert (hold["from_s"][holding.FASTEST], hold["value"][holding.FASTEST]) == (0.0, 41.0)


class TestFlights:
    @pytest.mark.parametrize("position_deg", [-6.0, -7.4])
    def test_a_jam_nose_up_is_flown_at_a_speed_that_can_be_held(self, position_deg):
        flight, log = jammed(position_deg)
        limits = metrics(flight)["limits"]
        assert [(limit["limits"], limit["side"], limit["in_force"]) for limit in limits] == [
            ("airspeed_mps", "at most", True)
        ]
        assert limits[0]["because"] == f"elevator acts as at {position_deg:.1f} deg"
        trims = {-6.0: 42.2, -7.4: 39.7}  # with the flap up, by `beaver-ftc trim`
        assert trims[position_deg] - 1.5 < limits[0]["value"] < trims[position_deg]
        late = log["t_s"] > 70.0
        assert np.abs(log["airspeed_mps"][late] - log["airspeed_limited_mps"][late]).max() < 2.0
        assert np.abs(log["altitude_m"][late] - log["altitude_command_m"][late]).max() < 5.0
        assert np.abs(np.diff(log["airspeed_limited_mps"])).max() < 0.0101  # no bump: 1 m/s2 at 100 Hz
        said = dict(verdict_lines(measure(flight)))["limited"]
        assert said.startswith(f"airspeed to at most {limits[0]['value']:.1f} m/s from 2")

    def test_a_lost_aileron_limits_the_bank_and_says_so(self):
        fault = {"actuator": "aileron", "type": "loss_of_effectiveness", "magnitude": 1.0, "at_s": 10.0}
        roll = [{"sine": {"amplitude_deg_s": 2, "frequency_hz": 0.3}}]
        given = {"name": "bank", "duration_s": 30, "autopilot": STRAIGHT, "actuators": "servo",
                 "faults": [fault], "reference": {"p": roll}}  # fmt: skip
        (limit,) = metrics(fly(Scenario.model_validate(given)))["limits"]
        assert (limit["limits"], limit["side"]) == ("bank_deg", "at most")
        assert limit["value"] == pytest.approx(15.0, abs=0.5)
        assert limit["because"].endswith("% of the aileron left")
