"""How states are drawn, read and sorted; the numbers of few of them, and what they must obey."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim as trimmed
from beaver_ftc.studies.engine import forks
from beaver_ftc_aircraft.derive import sample as sampling
from beaver_ftc_aircraft.derive.sample import Envelope

from .known import TRAINER

ENVELOPE = Envelope((38.0, 60.0), (-0.05, 0.2), 0.12)


@pytest.fixture(scope="module")
def plant():
    return Plant(100, aircraft=read(TRAINER))


@pytest.fixture(scope="module")
def trim(plant):
    return trimmed(50.0, 1000.0, plant=plant)


@pytest.mark.parametrize("searched", [True, False])
def test_samples_are_the_same_to_the_bit_whichever_process_looks_at_the_states(searched, monkeypatch):
    """In this process, in others one after the other, and in three at once; of a region, and not."""
    monkeypatch.setattr(sampling, "FRAMES", 21)
    found, errors = [], (lambda samples: abs(samples.rate)) if searched else None
    for at_once in (0, 1, 3):
        monkeypatch.setattr(forks, "can_fork", lambda forked=at_once > 0: forked)
        monkeypatch.setattr(forks, "cores", lambda cores=at_once: cores)
        plant = Plant(100)
        level = trimmed(50.0, 1000.0, plant=plant)
        where, properties = replace(ENVELOPE, of_region=not searched), {"pressure": "aero/qbar-psf"}
        samples = sampling.sample(plant, where, level, 60, 3, properties, starts=6, errors=errors)
        regions = [sampling.Region(where, at) for at in (level, replace(level, airspeed_mps=48.0))]
        flown = sampling.fly_about_all(plant, regions, 3, properties)
        assert flown.y[[0, 36], 2] == pytest.approx([level.airspeed_mps, 48.0], rel=1e-6)  # in their order
        plant.run()
        after = plant.read("accelerations/qdot-rad_sec2")
        found.append((*vars(samples).values(), *vars(flown).values(), after))
    with np.printoptions(threshold=np.inf, floatmode="unique"):
        assert len({repr(of) for of in found}) == 1
