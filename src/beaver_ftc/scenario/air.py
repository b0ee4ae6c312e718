"""The air around the aircraft (`environment`): steady wind, turbulence and gusts."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from beaver_ftc.documents.document import Conflict, Number, Section, deny, entry, number, refuse

MAX_GUSTS = 100
Wind = Annotated[Number, Field(ge=-100, le=100)]


class Gust(Section):
    """A gust of JSBSim with the shape one minus cosine. Its velocity rises, stays constant, and falls."""

    at_s: Number = number(..., "s", "start of the gust", ge=0, le=360_000, examples=[10])
    velocity_mps: tuple[Wind, Wind, Wind] = number(
        ...,
        "m/s",
        "largest velocity, towards north, east and down",
        examples=[[0, 0, -3]],
    )
    rise_s: Number = number(1.0, "s", "duration of the rise", gt=0, le=3600)
    hold_s: Number = number(0.0, "s", "time at the largest velocity", ge=0, le=3600, examples=[2])
    fade_s: Number = number(1.0, "s", "duration of the fall", gt=0, le=3600)

    @property
    def end_s(self) -> float:
        """When it has faded."""
        return self.at_s + self.rise_s + self.hold_s + self.fade_s


def air_of(severity: str) -> dict[str, str]:
    """`environment` with turbulence of a severity; or `none`."""
    return {"turbulence": "none"} if severity == "none" else {"turbulence": "dryden", "severity": severity}


def _one_or_several(given: Any) -> str:
    return "several" if isinstance(given, list | tuple) else "one"


Severity = Literal["light", "moderate", "severe"]


def _no_severity(given: Any) -> Any:
    """`turbulence: moderate` is what many write; say where that belongs."""
    if given in get_args(Severity):
        deny(f"{given!r} is a severity, allowed: none, or turbulence: dryden with severity: {given}")
    return given


class Environment(Section):
    """Wind, turbulence and gusts."""

    turbulence: Annotated[Literal["none", "dryden"], BeforeValidator(_no_severity)] = entry(
        "none",
        "turbulence of the Dryden model, or none",
        needs={"severity": "light"},
        examples=["dryden"],
    )
    severity: Severity | None = entry(
        None, "severity of the turbulence", needs={"turbulence": "dryden"}, examples=["light"]
    )
    wind_mps: tuple[Wind, Wind, Wind] = number(
        (0.0, 0.0, 0.0),
        "m/s",
        "steady wind towards north, east and down",
        examples=[[5, 0, 0]],
    )
    gust: (
        Annotated[
            Annotated[Gust, Tag("one")]
            | Annotated[tuple[Gust, ...], Tag("several"), Field(max_length=MAX_GUSTS)],
            Discriminator(_one_or_several),
        ]
        | None
    ) = entry(
        None,
        "one gust, or a list of gusts that do not overlap",
        examples=[[{"at_s": 10, "velocity_mps": [0, 0, -3]}]],
    )

    @property
    def gusts(self) -> tuple[Gust, ...]:
        """Every gust, in the order in which they start."""
        if self.gust is None:
            return ()
        return (self.gust,) if isinstance(self.gust, Gust) else self.gust

    @property
    def is_turbulent(self) -> bool:
        """Whether there is turbulence; then `severity` is given."""
        return self.turbulence != "none"

    @property
    def is_still(self) -> bool:
        """Whether there is no wind, gust or turbulence."""
        return not (self.is_turbulent or any(self.wind_mps) or self.gusts)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.is_turbulent and self.severity is None:
            deny("required key is missing, allowed: light, moderate, severe", "severity")
        if self.severity is not None and not self.is_turbulent:
            deny("has no meaning here, allowed: only with turbulence: dryden", "severity")
        refuse(self._overlapping())
        return self

    def _overlapping(self) -> Iterator[Conflict]:
        """JSBSim flies one gust at a time."""
        for i, (early, late) in enumerate(pairwise(self.gusts), start=1):
            if late.at_s < early.end_s:
                allowed = f"allowed: {early.end_s:g} s or later"
                yield ("gust", i, "at_s"), f"{late.at_s:g} is before the gust before it has faded, {allowed}"
