"""The file of a plan of evidence: its keys, and what each may hold."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from beaver_ftc.documents import (
    Number,
    Section,
    Whole,
    deny,
    entry,
    number,
)
from beaver_ftc.scenario import (
    NAME_PATTERN,
    SweepExpect,
)

MOST_REQUIREMENTS = 500
Text = Annotated[str, StringConstraints(max_length=2000)]


class OfSweep(SweepExpect):
    """Conditions as in `expect` of a sweep file."""

    type: Literal["sweep"]


class OfHandling(Section):
    """Level of handling qualities of MIL-F-8785C: at the end of a flight with a fault, otherwise in trim."""

    type: Literal["handling_qualities"]
    level: Whole = number(1, "1", "worst allowed level, 1: best", ge=1, le=3)


class OfMargins(Section):
    """Stability margins of the loop of each surface, healthy and after each loss for which the default law
    is designed."""

    type: Literal["margins"]
    gain_db: Number = number(6.0, "dB", "smallest gain margin", ge=0, le=100)
    phase_deg: Number = number(45.0, "deg", "smallest phase margin", ge=0, le=180)


Bar = Annotated[OfSweep | OfHandling | OfMargins, Field(discriminator="type")]


class Requirement(Section):
    """One requirement, with exactly one of `expect`, `formula` and `bar`.

    id: name of the requirement: letters, digits, - and _
    text: the requirement in words
    clause: clause of the regulation or standard
    over: flights that must meet it: names from `flights`, built-in names, or files
    expect: conditions that each flight must meet, as in `expect` of a scenario
    formula: formula of signal temporal logic over columns of the log, times in s. Operators: `always`,
    `eventually`, `until`, `once`, `historically`, `not`, `and`, `or`, `implies`
    bar: limit that the result of a study must meet
    """

    id: str = entry(..., pattern=NAME_PATTERN, max_length=40, examples=["JAM-1"])
    text: Text = entry("", examples=["No jam loses the aircraft."])
    clause: Text = entry("", examples=["CS 25.671(c)(3)"])
    over: tuple[str, ...] = entry(..., min_length=1, max_length=200, examples=[["elevator-stuck"]])
    expect: dict[str, Any] | None = entry(None, min_length=1, examples=[{"no_departure": True}])
    formula: str | None = entry(None, max_length=4000, examples=["always(abs(q_rad_s) <= 0.5)"])
    bar: Bar | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        """Refuse a requirement with none or several of the three kinds."""
        given = [key for key in ("expect", "formula", "bar") if getattr(self, key) is not None]
        if len(given) != 1:
            said = " and ".join(given) or "nothing that can be judged"
            deny(f"has {said}, allowed: exactly one of expect, formula, bar")
        return self


class PlanFile(Section, title="beaver-ftc plan of evidence"):
    """Requirements, and the flights that are flown for them.

    name: name of the plan: letters, digits, - and _
    description: purpose of the plan
    flights: scenarios and sweeps of this plan, by name
    requirements: list of the requirements
    """

    name: str = entry(..., pattern=NAME_PATTERN, max_length=70, examples=["flight-controls"])
    description: str = entry("", max_length=4000, examples=["The flight controls after one failure."])
    flights: dict[Annotated[str, StringConstraints(pattern=NAME_PATTERN, max_length=70)], dict[str, Any]] = (
        entry(dict, max_length=200, examples=[{"own": {"duration_s": 30}}])
    )
    requirements: tuple[Requirement, ...] = entry(..., min_length=1, max_length=MOST_REQUIREMENTS)
