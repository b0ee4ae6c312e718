"""A flight step by step: the same flight, however one looks; and what is done to it is kept to the bit."""

import numpy as np
import pytest

import beaver_ftc as bf
from flying import loss, same_log, scenario

SHORT = {"duration_s": 4.0, "faults": [loss(at_s=1.5)]}


def stepped(sim, frames=10**9):
    while not sim.done and sim.frames < frames:
        sim.step()
    return sim


@pytest.fixture(scope="module")
def flight():
    return bf.fly(scenario(**SHORT))


class TestStepping:
    def test_is_the_flight_in_one_go(self, flight):
        sim = stepped(bf.Simulation(scenario(**SHORT)))
        assert same_log(sim.log, flight.log)
        assert sim.land().metrics == flight.metrics
        assert sim.scenario_flown().duration_s == 4.0

    def test_a_reset_leaves_no_trace(self, flight):
        sim = bf.Simulation(scenario(**SHORT))
        sim.inject({"type": "stuck", "actuator": "elevator"})
        sim.step(sim.trim_rad, frames=150)
        sim.reset()
        assert sim.t_s == 0.0
        assert same_log(stepped(sim).log, flight.log)

    def test_a_property_by_its_name(self):
        sim = bf.Simulation(scenario())
        sim.step(frames=20)
        row = dict(zip(sim.columns, sim.values, strict=True))
        assert sim["velocities/p-rad_sec"] == row["p_rad_s"] != 0.0
        with pytest.raises(bf.BadInput, match="did you mean velocities/p-rad_sec"):
            sim.read("velocities/p-rad_se")


class TestBreakingThings:
    def test_what_is_injected_now_is_a_fault_declared_for_then(self, flight):
        sim = stepped(bf.Simulation(scenario(duration_s=4.0)), 150)
        sim.inject({"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4})
        assert same_log(stepped(sim).log, flight.log)
        assert sim.land().metrics == flight.metrics

    def test_repaired_is_as_if_declared_to_end_then(self):
        sim = stepped(bf.Simulation(scenario(**SHORT)), 230)
        sim.repair("elevator")
        ended = scenario(duration_s=4.0, faults=[loss(at_s=1.5, end_s=2.3)])
        assert same_log(stepped(sim).log, bf.fly(ended).log)

    @pytest.mark.parametrize(
        ("given", "key"),
        [
            ({"type": "stuck"}, "actuator: required key is missing"),
            ({"type": "stuck", "actuator": "elevater"}, "actuator: 'elevater' is not known, did you mean"),
            ({"type": "float", "actuator": "flap", "at_s": 3}, "at_s: has no meaning here"),
            ("stuck", "'stuck' is no fault"),
        ],
    )
    def test_a_mistake_is_named_by_its_key_and_breaks_nothing(self, given, key):
        sim = bf.Simulation(scenario())
        with pytest.raises(bf.BadInput, match="(?m)^" + key):
            sim.inject(given)
        sim.step()
        assert sim.scenario_flown().faults == ()


class TestCommanding:
    def test_the_surfaces_follow_whoever_commands(self):
        sim = bf.Simulation(scenario(faults=[]))
        sim.step(frames=50)
        wanted = sim.trim_rad + np.array([0.01, -0.02, 0.03, 0.0])
        sim.step(wanted, frames=3)
        assert [sim[f"fcs/{s}-pos-rad"] for s in ("aileron", "elevator", "rudder", "flap")] == [*wanted]

    def test_within_their_travel(self):
        sim = bf.Simulation(scenario(faults=[]))
        sim.step([9.0, -9.0, 9.0, -9.0])
        low, high = sim.travel_rad
        np.testing.assert_array_equal(
            [sim[f"fcs/{s}-cmd-rad"] for s in ("aileron", "elevator", "rudder", "flap")],
            [high[0], low[1], high[2], low[3]],
        )


def test_gusts_one_after_the_other_are_flown_again_to_the_bit():
    """The second is as strong as if it were alone; one that comes while another blows is refused."""
    sim = bf.Simulation(scenario(duration_s=12.0))
    sim.step(frames=200)
    sim.blow({"velocity_mps": [0.0, 0.0, -5.0]})
    sim.step(frames=100)
    with pytest.raises(bf.BadInput, match=r"another one blows from 2\.01 to 4\.01 s"):
        sim.blow({"velocity_mps": [0.0, 3.0, 0.0]})
    sim.step(frames=500)
    sim.blow({"velocity_mps": [0.0, 4.0, 0.0]})
    sim.step(frames=300)
    flown = sim.scenario_flown()
    assert [gust.at_s for gust in flown.environment.gusts] == [2.01, 8.01]
    assert same_log(sim.log, bf.fly(flown).log)
    alone = bf.fly(scenario(duration_s=11.0, environment={"gust": {"at_s": 8.01, "velocity_mps": [0, 4, 0]}}))
    still = bf.fly(scenario(duration_s=11.0)).log["beta_rad"]
    own, other = (log["beta_rad"][:1100] - still for log in (sim.log, alone.log))
    assert own[800:].abs().max() == pytest.approx(other[800:].abs().max(), rel=0.1)
    assert other[800:].abs().max() > 0.05


AUTOPILOT = {"altitude_m": [{"hold": True}, {"at_s": 50.0, "value": 1700.0}], "heading_deg": [{"hold": True}]}


def test_the_autopilot_is_aimed_in_flight_and_it_is_flown_again_to_the_bit():
    sim = bf.Simulation(scenario(duration_s=30.0, autopilot=AUTOPILOT))
    sim.step(frames=500)
    start_m = float(sim.log["altitude_m"].iloc[-1])
    sim.aim({"altitude_m": start_m + 20.0})
    sim.aim({"altitude_m": start_m + 25.0})  # in the same frame: the last word counts
    sim.step(frames=2400)
    log, flown = sim.log, sim.scenario_flown()
    assert log["altitude_command_m"].iloc[-1] == pytest.approx(start_m + 25.0)
    assert log["altitude_m"].iloc[-1] > start_m + 12.0
    assert len(flown.autopilot.altitude_m) == 2  # the leg at 50 s is dropped
    assert same_log(log, bf.fly(flown).log)
