"""Which flights are flown: surfaces, magnitudes, excitations, instruments and air, and how many of each."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.environment import air_of
from beaver_ftc.scenario.schema import Scenario

STRIKES_S = (8.0, 10.0)  # a fault strikes at random in between
WATCHED_S = 5.0  # after it
WITHIN_S = (0.5, 1.0, WATCHED_S)  # how soon is soon
FREQUENCY_HZ = {"p": 0.25, "q": 0.2, "r": 0.15}
_RATE_HZ = 100.0
UNEXPLAINED_UP_TO_RAD_S = 15.0  # the faster of the published sinusoids, and what is declared of them


class Condition(NamedTuple):
    """What a designer is told, and may set his alarm level for."""

    sensors: str
    turbulence: str


class Bout(NamedTuple):
    """One condition, one excitation, one seed: flights that are the same until the fault strikes."""

    condition: Condition
    excitation_deg_s: float
    seed: int


@dataclass(frozen=True)
class Grid:
    """The survey. bouts: flights with a fault a cell; healthy_h: without one, a condition; per_h: false
    alarms per hour at which the schemes are compared."""

    conditions: tuple[Condition, ...]
    surfaces: tuple[str, ...]
    magnitudes: tuple[float, ...]
    excitations_deg_s: tuple[float, ...]
    bouts: int
    healthy_h: float
    healthy_flight_s: float
    per_h: float
    vanes: bool = True  # whether plug-ins are shown the air as our statistical detector sees it

    @property
    def faults(self) -> tuple[tuple[str, float], ...]:
        """Every surface with every magnitude."""
        return tuple((surface, magnitude) for surface in self.surfaces for magnitude in self.magnitudes)

    def only(self, sensors: str | None, turbulence: str | None) -> "Grid":
        """The same flights under some of the conditions. Raises BadInput if there are none."""
        kept = tuple(
            condition
            for condition in self.conditions
            if sensors in (None, condition.sensors) and turbulence in (None, condition.turbulence)
        )
        if not kept:
            there = "; ".join(f"{one.sensors}, {one.turbulence}" for one in self.conditions)
            raise BadInput(f"power: this grid has no such condition, allowed: {there}")
        return replace(self, conditions=kept)

    def faulted(self) -> list[Bout]:
        """The bouts with faults; each flies all of them. The same seeds in every condition."""
        return [
            Bout(condition, excitation, 1000 * i + seed)
            for condition in self.conditions
            for i, excitation in enumerate(self.excitations_deg_s)
            for seed in range(self.bouts)
        ]

    def healthy(self) -> list[Bout]:
        """The bouts without a fault, which set the levels; seeds of their own."""
        count = round(self.healthy_h * 3600.0 / self.healthy_flight_s)
        excitations = self.excitations_deg_s
        return [
            Bout(condition, excitations[i % len(excitations)], 1_000_000 + i)
            for condition in self.conditions
            for i in range(count)
        ]


_SURFACES = ("aileron", "rudder", "elevator")
GRIDS = {
    "quick": Grid(
        conditions=(Condition("tactical-grade", "none"), Condition("tactical-grade", "light")),
        surfaces=_SURFACES,
        magnitudes=(0.4, 1.0),
        excitations_deg_s=(3.0, 6.0),
        bouts=5,
        healthy_h=0.06,
        healthy_flight_s=18.0,
        per_h=20.0,
    ),
    "full": Grid(
        conditions=tuple(
            Condition(sensors, turbulence)
            for sensors in ("ideal", "tactical-grade")
            for turbulence in ("none", "light", "moderate")
        ),
        surfaces=_SURFACES,
        magnitudes=(0.2, 0.4, 0.7, 1.0),
        excitations_deg_s=(1.0, 3.0, 6.0),
        bouts=8,
        healthy_h=0.2,
        healthy_flight_s=20.0,
        per_h=20.0,
    ),
}


def scenario_of(bout: Bout, duration_s: float, faults: list[dict[str, Any]] | None = None) -> Scenario:
    """A flight of a bout: everything in it but the fault follows from the bout alone."""
    sensors, turbulence = bout.condition
    return Scenario.model_validate(
        {
            "name": "power",
            "duration_s": duration_s,
            "rate_hz": _RATE_HZ,
            "seed": bout.seed,
            "reference": _reference(bout),
            "uncertainty": _uncertainty(bout),
            "sensors": sensors,
            "environment": air_of(turbulence),
            "faults": faults or [],
            "fdi": {"bounds": {"sensors": sensors, "turbulence": turbulence}},
            "control": {"law": "nominal"},
        }
    )


def strikes_at_s(bout: Bout) -> float:
    """When the faults of a bout strike, on a frame."""
    return round(_draws(bout, 2).uniform(*STRIKES_S) * _RATE_HZ) / _RATE_HZ


def loss(surface: str, magnitude: float, at_s: float) -> dict[str, Any]:
    """The fault of a cell."""
    return {
        "type": "loss_of_effectiveness", "actuator": surface, "magnitude": magnitude, "at_s": at_s
    }  # fmt: skip


def _draws(bout: Bout, purpose: int) -> np.random.Generator:
    """Random numbers of a seed, the same in every condition."""
    return np.random.default_rng([bout.seed, purpose])


def _reference(bout: Bout) -> dict[str, Any]:
    phase_deg = _draws(bout, 0).uniform(-180.0, 180.0, 3)
    return {
        axis: [{"sine": {"amplitude_deg_s": bout.excitation_deg_s, "frequency_hz": hz, "phase_deg": phase}}]
        for (axis, hz), phase in zip(FREQUENCY_HZ.items(), phase_deg.tolist(), strict=True)
    }


def _uncertainty(bout: Bout) -> dict[str, Any]:
    """Inside the published bound [Zhang2005, sec. VII]: half of it at the bound, whatever the frequency."""
    draws = _draws(bout, 1)
    coupling = draws.uniform(-0.25, 0.25, 3).tolist()
    frequency = np.exp(draws.uniform(np.log(1.0), np.log(UNEXPLAINED_UP_TO_RAD_S), 3)).tolist()
    return {
        "inertia_coupling": dict(zip("pqr", coupling, strict=True)),
        "sinusoid": {
            axis: {"amplitude_rad_s2": 0.02, "frequency_rad_s": omega}
            for axis, omega in zip("pqr", frequency, strict=True)
        },
    }
