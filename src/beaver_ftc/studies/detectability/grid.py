"""The grid of the survey: which conditions, excitations and faults are flown, and how often.

condition   sensors and turbulence, which a designer knows; a scheme has an alarm level for each condition
block       a condition, an excitation and a seed: flights that are the same until the fault begins
grid        the conditions, excitations, faults and numbers of blocks of a survey
"""

from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.airframe import find_aircraft

WATCHED_S = 5.0  # time that is flown after the begin of the fault
WITHIN_S = (0.5, 1.0, WATCHED_S)  # delays within which detections are counted


class Condition(NamedTuple):
    """Names of the sensors and of the severity of turbulence."""

    sensors: str
    turbulence: str


class Block(NamedTuple):
    """One condition, one amplitude of the references, one seed."""

    condition: Condition
    excitation_deg_s: float
    seed: int


Faults = tuple[tuple[str, float], ...]
"""Surface and magnitude of each loss."""


@dataclass(frozen=True)
class Grid:
    """The survey.

    - conditions, surfaces, magnitudes, excitations_deg_s: all combinations are flown with faults.
    - blocks: flights of each combination. healthy_h: hours without a fault for each condition;
      healthy_flight_s: length of such a flight, s.
    - per_h: false alarms per hour at which the schemes are compared.
    - where: further keys of the scenarios, such as another aircraft and its start.
    """

    conditions: tuple[Condition, ...]
    surfaces: tuple[str, ...]
    magnitudes: tuple[float, ...]
    excitations_deg_s: tuple[float, ...]
    blocks: int
    healthy_h: float
    healthy_flight_s: float
    per_h: float
    where: Document = field(default_factory=dict, hash=False)

    @property
    def faults(self) -> Faults:
        """Every surface with every magnitude."""
        return tuple(product(self.surfaces, self.magnitudes))

    def only(self, sensors: str | None, turbulence: str | None) -> "Grid":
        """The same flights under the conditions with these sensors and this turbulence; None is any. Raises
        BadInput if there is no such condition."""
        conditions = tuple(
            condition
            for condition in self.conditions
            if sensors in (None, condition.sensors) and turbulence in (None, condition.turbulence)
        )
        if not conditions:
            allowed = "; ".join(map(", ".join, self.conditions))
            raise BadInput(f"detectability: this grid has no such condition, allowed: {allowed}")
        return replace(self, conditions=conditions)

    def elsewhere(
        self, aircraft: str | None, airspeed_mps: float | None, altitude_m: float | None, surface: str | None
    ) -> "Grid":
        """The same flights with another aircraft, airspeed or altitude, or with losses of one surface; None
        is as before. Without a surface, another aircraft loses all of its class of losses. Raises BadInput
        for a surface that is not in the class of losses."""
        class_of_losses = find_aircraft(aircraft or DEFAULT, Path()).class_of_losses
        if surface is not None and surface not in class_of_losses:
            raise BadInput(f"--surface {surface!r:.60}: allowed: {', '.join(class_of_losses)}")
        condition = {"airspeed_mps": airspeed_mps, "altitude_m": altitude_m}
        initial = {name: value for name, value in condition.items() if value is not None}
        keys = {"initial": initial, "aircraft": aircraft}
        where = {key: value for key, value in keys.items() if value}
        surfaces = self.surfaces if aircraft is None else class_of_losses
        return replace(self, where=where, surfaces=(surface,) if surface else surfaces)

    def faulted(self) -> list[Block]:
        """The blocks with faults; each flies all faults. The seeds are the same in every condition."""
        return [
            Block(condition, excitation, 1000 * i + seed)
            for condition in self.conditions
            for i, excitation in enumerate(self.excitations_deg_s)
            for seed in range(self.blocks)
        ]

    def healthy(self) -> list[Block]:
        """The blocks without a fault, which set the levels; the excitations take turns. Their seeds differ
        from those with faults."""
        count = round(self.healthy_h * 3600.0 / self.healthy_flight_s)
        excitations = self.excitations_deg_s
        return [
            Block(condition, excitations[i % len(excitations)], 1_000_000 + i)
            for condition in self.conditions
            for i in range(count)
        ]


GRIDS = TypeAdapter(dict[str, Grid]).validate_json((Path(__file__).parent / "grids.json").read_bytes())


def title_of(sensors: str, turbulence: str) -> str:
    """Sensors and turbulence in words."""
    air = "still air" if turbulence == "none" else f"{turbulence} turbulence"
    return f"{sensors} sensors, {air}"
