"""A flight step by step: the same flight, however one looks; and what is done to it is kept to the bit."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.loop.plugin_frame import measured_of
from flying import loss, scenario

SHORT = {"duration_s": 4.0, "faults": [loss(at_s=1.5)]}


def same_log(one, other):
    return list(one.columns) == list(other.columns) and np.array_equal(one, other, equal_nan=True)


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

    def test_in_leaps_as_well(self, flight):
        sim = bf.Simulation(scenario(**SHORT))
        while not sim.done:
            sim.step(frames=37)
        assert same_log(sim.log, flight.log)

    def test_across_the_chunks_of_the_log(self):
        long = scenario(duration_s=90.0, faults=[loss(at_s=85.0)])
        sim = bf.Simulation(long)
        while not sim.done:
            sim.step(frames=13)
        assert same_log(sim.log, bf.fly(long).log)

    @pytest.mark.parametrize("look", ["measured", "readout", "records"])
    def test_whoever_looks_before_the_first_step_sees_frame_0(self, look):
        looked, begun = bf.Simulation(scenario(**SHORT)), bf.Simulation(scenario(**SHORT))
        seen = getattr(looked, look)
        airspeed_mps = {
            "measured": lambda: seen.y[2],
            "readout": lambda: seen.airspeed_mps,
            "records": lambda: measured_of(seen[0]).y[2],
        }[look]()
        assert begun.values is not None  # which begins it
        assert airspeed_mps == pytest.approx(begun.measured.y[2], rel=1e-9)
        assert airspeed_mps == pytest.approx(scenario(**SHORT).initial.airspeed_mps, rel=0.02)

    def test_looking_changes_nothing(self, flight):
        sim = bf.Simulation(scenario(**SHORT))
        while not sim.done:
            sim.step()
            if sim.frames % 50 == 0:
                assert (
                    sim.measured,
                    sim.verdict,
                    sim.values,
                    sim["velocities/p-rad_sec"],
                    sim.log,
                ) is not None
                assert sim.land().metrics["frames"] == sim.frames
        assert same_log(sim.log, flight.log)

    def test_two_side_by_side(self, flight):
        other = scenario(duration_s=4.0, seed=7, substeps=2, faults=[loss("rudder", at_s=1.0)])
        one, two = bf.Simulation(scenario(**SHORT)), bf.Simulation(other)
        while not one.done:
            one.step()
            two.step()
        assert same_log(one.log, flight.log)
        assert same_log(two.log, bf.fly(other).log)

    def test_a_reset_leaves_no_trace(self, flight):
        sim = bf.Simulation(scenario(**SHORT))
        sim.inject({"type": "stuck", "actuator": "elevator"})
        sim.step(sim.trim_rad, frames=150)
        sim.reset()
        assert sim.t_s == 0.0
        assert same_log(stepped(sim).log, flight.log)

    def test_ends_where_the_aircraft_is_lost(self):
        lost = scenario(faults=[{"type": "hardover", "actuator": "elevator", "at_s": 0.5}], duration_s=20.0)
        sim = stepped(bf.Simulation(lost))
        assert sim.departed
        assert sim.land().departure == bf.fly(lost).departure
        with pytest.raises(bf.BadInput, match="the flight is over"):
            sim.step()

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

    def test_a_fault_before_the_first_step_is_there_from_the_start(self):
        sim = bf.Simulation(scenario(duration_s=2.0))
        sim.inject({"type": "stuck", "actuator": "rudder", "position_deg": 2.0})
        stuck = {"type": "stuck", "actuator": "rudder", "position_deg": 2.0, "at_s": 0.0}
        assert same_log(stepped(sim).log, bf.fly(scenario(duration_s=2.0, faults=[stuck])).log)

    def test_repaired_is_as_if_declared_to_end_then(self):
        sim = stepped(bf.Simulation(scenario(**SHORT)), 230)
        sim.repair("elevator")
        ended = scenario(duration_s=4.0, faults=[loss(at_s=1.5, end_s=2.3)])
        assert same_log(stepped(sim).log, bf.fly(ended).log)

    def test_the_flight_as_flown_flies_again_to_the_bit(self, tmp_path):
        sim = eventful(bf.Simulation(scenario(duration_s=30.0, substeps=2)))
        again = bf.fly(sim.scenario_flown())
        assert same_log(sim.log, again.log)
        assert sim.land().metrics == again.metrics
        folder = sim.save(tmp_path, report=False)
        assert same_log(bf.fly(folder / "scenario.yaml").log, bf.open_run(folder).log)

    def test_landing_on_the_way_leaves_a_stick_alone(self):
        """Also across a chunk of the log, for which the references are sampled anew."""
        sims = [bf.Simulation(scenario(duration_s=84.0)) for _ in range(2)]
        for i, sim in enumerate(sims):
            sim.step(frames=8000, stick=(0.0, 0.002, 0.0))
            if i:
                assert sim.land().metrics["frames"] == 8001
            sim.step(frames=300, stick=(0.0, 0.001, 0.0))
            sim.step(frames=99)
        assert same_log(sims[0].log, sims[1].log)
        assert same_log(bf.fly(sims[0].scenario_flown()).log, sims[0].log)

    def test_repaired_before_it_was_there_it_never_was(self):
        sim = stepped(bf.Simulation(scenario(duration_s=4.0)), 100)
        sim.inject({"type": "float", "actuator": "flap"})
        sim.repair()
        assert sim.scenario_flown().faults == ()
        assert sim.land().fault is None

    @pytest.mark.parametrize(
        ("given", "key"),
        [
            ({"type": "stuck"}, "actuator: required key is missing"),
            ({"type": "stuk", "actuator": "elevator"}, "type: 'stuk' is not known, did you mean stuck"),
            ({"type": "stuck", "actuator": "elevater"}, "actuator: 'elevater' is not known, did you mean"),
            ({"type": "bias", "actuator": "flap", "bias_rad": 0.1}, "bias_rad: unknown key"),
            ({"type": "loss_of_effectiveness", "actuator": "flap", "magnitude": 40}, "magnitude: 40 is out"),
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

    def test_nothing_else_can_be_repaired(self):
        with pytest.raises(bf.BadInput, match="actuator: 'elevatr' is not known, did you mean elevator"):
            bf.Simulation(scenario()).repair("elevatr")


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

    def test_held_over_frames_is_the_same_as_given_frame_by_frame(self):
        one, two = bf.Simulation(scenario(**SHORT)), bf.Simulation(scenario(**SHORT))
        wanted = one.trim_rad + np.array([0.0, 0.01, 0.0, 0.0])
        one.step(wanted, frames=40)
        for _ in range(40):
            two.step(wanted)
        assert same_log(one.log, two.log)

    def test_a_flight_by_hand_is_no_scenario(self):
        sim = bf.Simulation(scenario())
        sim.step(sim.trim_rad)
        with pytest.raises(bf.BadInput, match="commanded by hand"):
            sim.scenario_flown()

    @pytest.mark.parametrize("command", [[0.0, 0.0, 0.0], [np.nan] * 4, "flap", [[0.0] * 4]])
    def test_what_is_no_command_is_refused(self, command):
        with pytest.raises(bf.BadInput, match=r"command: .* allowed: 4 finite numbers, rad"):
            bf.Simulation(scenario()).step(command)

    def test_a_stick_is_added_to_the_reference(self):
        sim = bf.Simulation(scenario(duration_s=2.0))
        sim.step(frames=20)
        sim.step(stick=[0.0, 0.02, 0.0], frames=10)
        sim.step(frames=5)
        q = sim.log["q_reference_rad_s"].to_numpy()
        plain = bf.fly(scenario(duration_s=2.0)).log["q_reference_rad_s"].to_numpy()[: q.size]
        np.testing.assert_allclose(q - plain, np.r_[np.zeros(21), np.full(10, 0.02), np.zeros(5)], atol=1e-15)

    def test_a_plugged_in_detector_watches_a_commanded_flight(self):
        class Counter:
            """Counts frames."""

            def reset(self, context):
                self.frames = 0

            def step(self, measured, command):
                self.frames += 1
                return bf.Verdict()

        counter = Counter()
        sim = bf.Simulation(scenario(), detector=counter)
        sim.step(sim.trim_rad, frames=9)
        assert counter.frames == 10


def eventful(sim):
    """A flight in which much is done by hand."""
    for i in range(1100):
        sim.step(stick=(0.01 * np.sin(i / 30), 0.0, 0.02 if i < 200 else -0.01) if 100 < i < 400 else None)
        if i == 300:
            sim.inject({"type": "stuck", "actuator": "rudder"})
            sim.inject({"type": "unanticipated", "profile": "incipient", "kappa_per_s": 0.5})
        if i == 700:
            sim.repair("rudder")
        if i == 800:
            sim.inject({"type": "bias", "actuator": "aileron", "bias_deg": 3.0})
        if i == 801:
            sim.repair()
    return sim


def test_a_gust_begins_when_it_is_asked_for_and_is_flown_again_to_the_bit():
    sim = bf.Simulation(scenario(duration_s=6.0))
    sim.step(frames=200)
    at_s = sim.t_s
    sim.blow({"velocity_mps": [0.0, 0.0, -5.0], "rise_s": 0.5})
    sim.step(frames=300)
    log, still = sim.log, bf.fly(scenario(duration_s=6.0)).log[:501]
    moved = (log["alpha_rad"] - still["alpha_rad"]).abs()
    assert moved[log["t_s"] <= at_s].max() == 0.0
    assert moved.max() > 0.05
    again = bf.fly(sim.scenario_flown()).log
    assert np.array_equal(log.to_numpy(), again.to_numpy(), equal_nan=True)


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


def test_none_of_the_last_gust_after_a_reset():
    sim = bf.Simulation(scenario(duration_s=2.0))
    sim.blow({"velocity_mps": [0.0, 3.0, 0.0]})
    sim.reset()
    assert sim.scenario_flown().environment.gust is None
    with pytest.raises(bf.BadInput, match="velocity_mps"):
        sim.blow({"velocity_mps": [0.0, 300.0, 0.0]})


def test_gusts_in_a_scenario_do_not_overlap():
    one = {"at_s": 2.0, "velocity_mps": [0, 0, -5], "hold_s": 3.0}
    with pytest.raises(
        bf.BadInput, match=r"environment.gust\[1\].at_s: 6 is before .*, allowed: 7 s or later"
    ):
        bf.load({"environment": {"gust": [one, {**one, "at_s": 6.0}]}})
    with pytest.raises(
        bf.BadInput, match=r"^environment.gust.rise_s: -1 is out of range, allowed: a number over 0"
    ):
        bf.load({"environment": {"gust": {**one, "rise_s": -1}}})
    with pytest.raises(bf.BadInput, match=r"^environment.gust\[0\].rise_s: -1 is out of range, allowed"):
        bf.load({"environment": {"gust": [{**one, "rise_s": -1}]}})
    assert (
        bf.load({"environment": {"gust": one}})
        .with_({"environment.gust.at_s": 3.0})
        .environment.gusts[0]
        .at_s
        == 3
    )


def test_the_mode_is_the_supervisors():
    sim = bf.Simulation(scenario(duration_s=4.0))
    sim.step(frames=200)
    assert sim.mode == "nominal"
    sim.inject({"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.6})
    sim.step(frames=200)
    assert sim.mode == sim.land().supervisor[-1].mode != "nominal"


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
    assert np.array_equal(log.to_numpy(), bf.fly(flown).log.to_numpy(), equal_nan=True)


def test_a_target_needs_an_autopilot_and_a_channel_there_is():
    with pytest.raises(bf.BadInput, match="this flight has none"):
        bf.Simulation(scenario(duration_s=1.0)).aim({"altitude_m": 1900.0})
    sim = bf.Simulation(scenario(duration_s=1.0, autopilot=AUTOPILOT))
    with pytest.raises(bf.BadInput, match="did you mean altitude_m"):
        sim.aim({"altitude": 1900.0})
    with pytest.raises(bf.BadInput, match="altitude_m"):
        sim.aim({"altitude_m": 99_000.0})
