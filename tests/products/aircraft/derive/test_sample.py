"""How states are drawn, read and sorted; the numbers of few of them, and what they must obey."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim as trimmed
from beaver_ftc.studies.engine import forks
from beaver_ftc_aircraft.derive import sample as sampling
from beaver_ftc_aircraft.derive.sample import Draw, Envelope, Samples

from .known import TRAINER, aircraft

ENVELOPE = Envelope((38.0, 60.0), (-0.05, 0.2), 0.12)


@pytest.fixture(scope="module")
def plant():
    return Plant(100, aircraft=read(TRAINER))


@pytest.fixture(scope="module")
def trim(plant):
    return trimmed(50.0, 1000.0, plant=plant)


def test_states_are_within_their_box_and_reach_its_ends(plant, trim):
    """Half way to the ends of the envelope, and as far to either side of trim; bank and climb everywhere."""
    one, seen = Draw(5, plant.aircraft, ENVELOPE, trim), []
    for _ in range(200):
        started = one.start(0.5, 0)
        there = one.state(started, one.place(one.ends(0.5, 0.35)))
        climb = there.theta_rad - there.alpha_rad - (trim.theta_rad - trim.alpha_rad)
        seen.append(there.as_dict() | {"started_mps": started.airspeed_mps, "climb": climb})
    V, alpha, thrust = trim.airspeed_mps, trim.alpha_rad, trim.settings["thrust_n"]
    reach = {  # about a middle
        "altitude_m": (1000.0, 300.0), "beta_rad": (trim.beta_rad, 0.06), "p_rad_s": (0.0, 0.3),
        "q_rad_s": (0.0, 0.175), "r_rad_s": (0.0, 0.175), "phi_rad": (trim.phi_rad, 1.0), "climb": (0.0, 0.3),
        "aileron_rad": (0.0, 0.14), "elevator_rad": (-0.0175, 0.14), "rudder_rad": (0.0, 0.147),
    }  # fmt: skip
    ends = {name: (middle - by, middle + by) for name, (middle, by) in reach.items()} | {
        "alpha_rad": ((alpha - 0.05) / 2, (alpha + 0.2) / 2),
        "thrust_n": (thrust - min(525.0, thrust / 2), thrust + 525.0),  # no less than nothing
        **dict.fromkeys(("airspeed_mps", "started_mps"), ((V + 38.0) / 2, (V + 60.0) / 2)),
    }
    for name, (low, high) in ends.items():
        found = [state[name] for state in seen]
        assert (min(found), max(found)) == pytest.approx((low, high)), name
    deep = Draw(1, plant.aircraft, ENVELOPE, replace(trim, altitude_m=100.0))
    assert min(deep.start(1.0, turn).altitude_m for turn in range(20)) >= 0.0


@pytest.mark.parametrize("searched", [True, False])
@pytest.mark.parametrize("name", ["trainer", "beaver"])
def test_samples_are_the_same_to_the_bit_whichever_process_looks_at_the_states(name, searched, monkeypatch):
    """In this process, in others one after the other, and in three at once; of a region, and not."""
    monkeypatch.setattr(sampling, "FRAMES", 21)
    found, errors = [], (lambda samples: abs(samples.rate)) if searched else None
    for at_once in (0, 1, 3):
        monkeypatch.setattr(forks, "can_fork", lambda forked=at_once > 0: forked)
        monkeypatch.setattr(forks, "cores", lambda cores=at_once: cores)
        plant = Plant(100, aircraft=read(TRAINER) if name == "trainer" else None)
        level = trimmed(50.0, 1000.0, plant=plant)
        where, properties = replace(ENVELOPE, of_region=not searched), {"pressure": "aero/qbar-psf"}
        samples = sampling.sample(plant, where, level, 60, 3, properties, starts=10, errors=errors)
        regions = [sampling.Region(where, at) for at in (level, replace(level, airspeed_mps=48.0))]
        flown = sampling.fly_about_all(plant, regions, 3, properties)
        assert flown.y[[0, 36], 2] == pytest.approx([level.airspeed_mps, 48.0], rel=1e-6)  # in their order
        plant.run()
        after = plant.read("accelerations/qdot-rad_sec2")
        found.append((*vars(samples).values(), *vars(flown).values(), after))
    with np.printoptions(threshold=np.inf, floatmode="unique"):
        assert len({repr(of) for of in found}) == 1


def test_a_state_is_in_the_innermost_box_that_has_it_and_in_its_share_of_the_travel():
    """Ends belong to a box and to a share; travel is counted to the side the surface is moved to."""
    trainer, shares = aircraft(), (0.15, 0.35, 0.65, 1.0)
    n = 7
    x = np.zeros((n, 3))
    x[:, 1] = [0.0, 0.1, -0.1, 0.11, -0.2, 0.2, 0.21]
    y = np.tile([0.0, 0.0, 50.0, 1250.0], (n, 1))
    u = np.zeros((n, 3))
    u[:5, 0] = [0.06, -0.0601, 0.1399, 0.2601, -0.26]  # of 0.4
    u[5, 1], u[0, 2] = 0.35, -0.02  # the elevator goes to -0.45 and 0.35
    numbers = np.zeros(n, int)
    samples = Samples(x, y, {}, u, np.arange(3 * n).reshape(n, 3), numbers, numbers, numbers)
    wide = np.array([-1.0, 0.2, 1.0, 1.0, 1.0, 60.0, 2.0])
    ends = [np.array([[-1, -0.1, -1, -1, -1, 40, 0], [1, 0.1, 1, 1, 1, 60, 2]]), np.array([-wide, wide])]
    ends[1][0, 0], ends[1][1, 0] = -1.0, 1.0
    found = sampling.sorted_in(samples, ends, trainer, sampling.Moves(shares))
    assert found.rate[:, 0].tolist() == [0, 3, 6, 9, 12, 15], "the last is in no box"
    assert found.box.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.level.tolist() == [0, 1, 1, 3, 2, 3]
