"""A flight that is continued from a snapshot equals the one that went on, to the bit, whatever flies."""

from pathlib import Path

import numpy as np
import pytest

import beaver_ftc as bf
from flying import loss, same_log, scenario

TRAINER = Path(__file__).parents[1] / "data" / "aircraft" / "trainer-flight.yaml"
KINDS = {
    "published": scenario(duration_s=4.0, faults=[loss(at_s=1.5)]),
    "gust": scenario(duration_s=4.0, environment={"gust": [{"at_s": 1.5, "velocity_mps": [2, 1, -3]}]}),
    "turbulence, sensors, servos, statistical": bf.load("elevator-loss-in-turbulence"),
    "autopilot, halves by side": bf.load("mission-split-elevator-lost"),
    "broken sensor": bf.load("sensor-airspeed-frozen").with_({"faults[0].at_s": 0.5}),
    "an aircraft of others": bf.load(TRAINER),
}


def ended(sim, at_s=4.0):
    sim.step(frames=round((at_s - sim.frames / sim.rate_hz) * sim.rate_hz))
    return sim


@pytest.mark.parametrize("kind", KINDS)
def test_a_continued_flight_is_the_uninterrupted_one(kind):
    sim = bf.Simulation(KINDS[kind])
    sim.step(frames=30)
    sim.inject({"actuator": "rudder", "type": "bias", "bias_deg": 1})
    sim.step(stick=[0.01, 0.0, -0.02], frames=60)
    sim.repair()
    for _ in range(3):
        sim.step(sim.trim_rad + 0.01, frames=5)
    sim.step(frames=77)
    kept = sim.snapshot()
    first = kept.resume()
    assert (first.frames, first.t_s) == (sim.frames, sim.t_s) == (kept.frames, kept.t_s)
    assert np.array_equal(first.rows, sim.rows, equal_nan=True)
    assert same_log(ended(first).log, ended(sim).log)
    assert first.land().metrics == sim.land().metrics
    assert same_log(ended(kept.resume()).log, sim.log), "any number of times"
