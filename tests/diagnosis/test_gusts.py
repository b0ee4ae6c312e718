"""What the vanes know of the air's rotation, held against JSBSim's own gusts, and the algebra behind it."""

from functools import cache

import numpy as np
import pytest

from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.diagnosis import gusts
from beaver_ftc.loop.loop import Loop
from flying import scenario

MEMORY_S = 0.05  # over which the whitening filter compares, about
FT = 0.3048


class Flown:
    """A flight frame by frame: gusts seen and true (k, 3) rad/s in level axes, airspeed, headings."""

    def __init__(self, turbulence="light", **keys):
        environment = {"turbulence": "dryden", "severity": turbulence} if turbulence != "none" else {}
        environment |= keys.pop("environment", {})
        fdi = {"statistical": {}, "bounds": {"turbulence": environment.get("severity", "light")}}
        keys = {"uncertainty": {}, "environment": environment, "fdi": fdi, **keys}
        given = scenario(**keys)
        loop = Loop(given)
        loop.sample_references(0, loop.n_frames)
        nodes = [loop.plant.node(f"atmosphere/{axis}-turb-rad_sec") for axis in "pqr"]
        heading = loop.plant.node("attitude/psi-rad")
        accelerations = [loop.plant.node(f"accelerations/a-pilot-{axis}-ft_sec2") for axis in "xyz"]
        record = loop.frames["fdi"]["statistical"]["gust"][0]
        rows = []
        loop.fly_frames(1, 0)
        for _ in range(loop.n_frames - 1):
            loop.fly_frames(1, given.substeps)
            turn = np.array(record["memory"]["T"])
            true = turn.T @ [node.get_double_value() for node in nodes]
            felt = [FT * node.get_double_value() for node in accelerations]
            V = loop.frames["measured"]["y"][0][2]
            seen, force = record["memory"]["w"], record["memory"]["f"]
            rows.append([*seen, *true, V, heading.get_double_value(), *force, *felt])
        rows = np.array(rows)
        self.seen, self.true = rows[:, 0:3], rows[:, 3:6]
        self.airspeed, self.heading = rows[:, 6].mean(), np.unwrap(rows[:, 7])
        self.force, self.felt = rows[:, 8:11], rows[:, 11:14]
        self.rate_hz, self.turbulence = given.rate_hz, turbulence

    def intensity(self, signal):
        """Of the random walk that differs as much over MEMORY_S (3,), as a share of what is declared."""
        frames = round(MEMORY_S * self.rate_hz)
        differences = signal[frames:] - signal[:-frames]
        declared = Dryden(self.turbulence).rotation_walk(14.63) * self.airspeed
        return np.mean(differences**2, axis=0) / MEMORY_S / declared


@cache
def _flown(turbulence, airspeed_mps, seed):
    initial = {"airspeed_mps": airspeed_mps, "altitude_m": 1143}
    return Flown(turbulence, duration_s=20, seed=seed, initial=initial)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("airspeed_mps", [35, 45, 52])
@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_pitching_and_yawing_gusts_are_seen_but_for_less_than_the_share_declared(
    turbulence, airspeed_mps, seed
):
    flown = _flown(turbulence, airspeed_mps, seed)
    left = flown.intensity(flown.true - flown.seen)
    assert left[1] < gusts.MIN_UNMEASURED_SHARES[1]
    assert left[2] < gusts.MIN_UNMEASURED_SHARES[2]
    assert np.corrcoef(flown.true[:, 1], flown.seen[:, 1])[0, 1] > 0.98
    assert np.corrcoef(flown.true[:, 2], flown.seen[:, 2])[0, 1] > 0.95


@pytest.mark.parametrize("turbulence", ["light", "severe"])
def test_all_three_true_gusts_drift_no_faster_than_declared(turbulence):
    flights = [_flown(turbulence, 45, seed) for seed in (1, 2, 3, 4)]
    share = np.mean([flight.intensity(flight.true) for flight in flights], axis=0)
    assert (share < 1.0).all()
    assert (share > 0.5).all()


def test_the_specific_force_is_the_one_felt_aboard():
    """At the centre of gravity, against JSBSim's accelerometer, under references on all axes."""
    flown = Flown("none", duration_s=8)
    wrong = np.abs(flown.force - flown.felt)
    assert flown.felt[:, 2].mean() == pytest.approx(-9.8, abs=0.5)
    assert (wrong.max(axis=0) < [0.05, 0.1, 0.1]).all()


TURN = {  # to 30 deg of bank, and round
    "p": [
        {"step": {"amplitude_deg_s": 15, "start_s": 0.5}},
        {"step": {"amplitude_deg_s": -15, "start_s": 2.5}},
    ],
    "q": [{"step": {"amplitude_deg_s": 3.6, "start_s": 1.5}}],
    "r": [{"step": {"amplitude_deg_s": 6.2, "start_s": 1.5}}],
}


@pytest.mark.parametrize("wind_mps", [[0, 0, 0], [10, 5, 0]])
def test_the_rolling_gust_rolls_whatever_the_heading(wind_mps):
    """Of an aircraft that flies across what JSBSim takes for ahead it would pitch the nose; the vanes would
    see nothing of it."""
    flown = Flown("light", duration_s=25, seed=5, reference=TURN, environment={"wind_mps": wind_mps})
    across = np.abs(np.cos(flown.heading)) < 0.5
    assert across.sum() > 400
    left = flown.intensity((flown.true - flown.seen)[across])
    assert left[1] < gusts.MIN_UNMEASURED_SHARES[1]
    assert left[2] < gusts.MIN_UNMEASURED_SHARES[2]
