"""Damage: a part of the aircraft is gone, with its forces, its mass and the surfaces on it."""

from typing import Annotated, Literal

from beaver_ftc.documents.document import entry
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.scenario.airframe import checked_aircraft, named
from beaver_ftc.scenario.faults.base import Past, Properties, Switched, constant


def _wrong(case: str) -> str | None:
    """What is wrong with the name of a case."""
    aircraft = checked_aircraft()
    if not aircraft.damage:
        return f"{aircraft.name} declares no damage, allowed: an aircraft that does"
    if case in aircraft.damage:
        return None
    return f"{case[:100]!r} is not known{suggestion(case, tuple(aircraft.damage))}"


class Damage(Switched):
    """A case of damage that the aircraft declares: it acts on aerodynamics and mass, and takes surfaces.

    case: which, by its name in the aircraft's file
    """

    adds = False
    in_words = constant(case=lambda case: case.replace("-", " "))

    type: Literal["damage"]
    case: Annotated[str, named(_wrong)] = entry(..., examples=["left-wing-tip-off"])

    def strike(self, of: Properties, share: float, past: Past) -> None:
        of[self.case] = 1.0
