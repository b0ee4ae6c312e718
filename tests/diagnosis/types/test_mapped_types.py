"""A model whose mapped error grows as surfaces leave neutral: the alarm goes by where healthy ones are, and
who may be anywhere is excluded by what he may do there alone."""

import numpy as np
import pytest
from design_plant import TRAVEL_RAD, UNCERTAINTIES, DesignPlant

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.aircraft.schema import AircraftFile

AILERON, ELEVATOR, RUDDER = range(3)
SHARE, ERROR = (0.3, 0.6, 1.0), np.array([[0.02, 0.03, 0.02], [0.2, 0.3, 0.1], [2.0, 3.0, 1.0]])
BEGINS, FRAMES = 100, 400
POSITIONS = {
    "hardover": lambda k, u: 0.4,
    "hardover down": lambda k, u: -0.4,
    "stuck": lambda k, u: 0.17,
    "bias": lambda k, u: u + 0.15,
    "variation_part": lambda k, u: 0.42 * np.sin(0.05 * k),
    "jumps": lambda k, u: 0.42 * np.sign(np.sin(0.3 * k)),
    "lost": lambda k, u: 0.0,
}


def mapped_beaver():
    """The Beaver with a map: one box of everything it flies."""
    beaver = load()
    ends = {f"{name}_rad": [-3, 3] for name in ("alpha", "beta")}
    ends |= {f"{axis}_rad_s": [-100, 100] for axis in "pqr"} | {"airspeed_mps": [1, 999]}
    ends |= {"density_kg_m3": [0.01, 2], "signals": {name: [-1e6, 1e6] for name in beaver.signals}}
    errors = {f"error_{axis}_rad_s2": [list(ERROR[:, i])] for i, axis in enumerate("pqr")}
    box = {"travel_share": SHARE, "until_s": [1e6], "boxes": [ends | errors]}
    data = beaver.file.model_dump(mode="json", exclude_none=True) | {"model_error_map": box}
    return Aircraft(AircraftFile.model_validate(data), beaver.folder)


class Mapped(DesignPlant):
    """What its model is off by is within the map, for where surfaces really are."""

    def __init__(self, **given):
        super().__init__(fault_class="all", aircraft=mapped_beaver(), **given)
        self.map = self.fdi["bound"]["error_map"]
        self.map["one_free"], self.map["two_free"] = 1, 0
        self.map["stop_lo"], self.map["stop_hi"] = TRAVEL_RAD
        self.amplitude *= 0.3

    def effect(self, G):
        if self.surface is None or self.k < BEGINS:
            return np.zeros(3)
        at = self.u.copy()
        at[self.surface] = self.position(self.k, self.u[self.surface])
        used = np.max(at / np.where(at > 0, TRAVEL_RAD[1], TRAVEL_RAD[0]))
        more = np.maximum(ERROR[np.searchsorted(SHARE[:2], used)] - self.map["e_now"], 0.0)
        signs = np.sign(np.random.default_rng((self.k // 9, 7)).uniform(-1, 1, 3))
        return G @ (at - self.u) + signs * more


def flown(course, surface=ELEVATOR, seed=1, uncertainty="bang-bang", **changes):
    plant = Mapped(seed=seed, surface=surface, position=POSITIONS[course])
    for name, value in changes.items():
        plant.map[name] = value
    return plant.fly(FRAMES, UNCERTAINTIES[uncertainty])


@pytest.mark.parametrize("uncertainty", ["push", "bang-bang"])
def test_no_healthy_flight_alarms(uncertainty):
    for seed in range(5):
        plant = Mapped(seed=seed).fly(FRAMES, UNCERTAINTIES[uncertainty])
        assert plant.detected_at_s == np.inf
        assert plant.frame["accounts"]["closest"]["filter"].max() > 0.9


@pytest.mark.parametrize("course", POSITIONS)
@pytest.mark.parametrize("surface", [AILERON, ELEVATOR, RUDDER])
def test_the_surface_at_fault_is_never_excluded(surface, course):
    for seed, uncertainty in enumerate(UNCERTAINTIES):
        plant = flown(course, surface, seed, uncertainty)
        assert plant.detected_at_s >= plant.dt * BEGINS
        assert not plant.position_excluded(surface)
