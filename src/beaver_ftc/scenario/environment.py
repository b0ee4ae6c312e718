"""What a scenario may say of the air (`environment:`): steady wind, turbulence, gusts."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from beaver_ftc.documents.document import Conflict, Number, Section, deny, entry, number, refuse

MAX_GUSTS = 100
Wind = Annotated[Number, Field(ge=-100, le=100)]


class Gust(Section):
    """A one-minus-cosine gust: it rises, stays and fades as JSBSim's own does."""

    at_s: Number = number(..., "s", "when it starts", ge=0, le=360_000, examples=[10])
    velocity_mps: tuple[Wind, Wind, Wind] = number(
        ..., "m/s", "at its height, towards north, east, down", examples=[[0, 0, -3]]
    )
    rise_s: Number = number(1.0, "s", "duration of the rise", gt=0, le=3600)
    hold_s: Number = number(0.0, "s", "time at its height", ge=0, le=3600, examples=[2])
    fade_s: Number = number(1.0, "s", "duration of the decay", gt=0, le=3600)

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
    """The air."""

    turbulence: Annotated[Literal["none", "dryden"], BeforeValidator(_no_severity)] = entry(
        "none", "still air or Dryden turbulence", needs={"severity": "light"}, examples=["dryden"]
    )
    severity: Severity | None = entry(
        None, "of the turbulence", needs={"turbulence": "dryden"}, examples=["light"]
    )
    wind_mps: tuple[Wind, Wind, Wind] = number(
        (0.0, 0.0, 0.0), "m/s", "steady wind towards north, east, down", examples=[[5, 0, 0]]
    )
    gust: (
        Annotated[
            Annotated[Gust, Tag("one")]
            | Annotated[tuple[Gust, ...], Tag("several"), Field(max_length=MAX_GUSTS)],
            Discriminator(_one_or_several),
        ]
        | None
    ) = entry(None, "a one-minus-cosine gust, or a list of them, each begun after the one before has faded")

    @property
    def gusts(self) -> tuple[Gust, ...]:
        """Every gust, in the order in which they start."""
        if self.gust is None:
            return ()
        return (self.gust,) if isinstance(self.gust, Gust) else self.gust

    @property
    def is_still(self) -> bool:
        """Whether there is no wind, gust or turbulence."""
        return self.turbulence == "none" and not any(self.wind_mps) and not self.gusts

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        turbulent = self.turbulence != "none"
        if turbulent and self.severity is None:
            deny("required key is missing, allowed: light, moderate, severe", "severity")
        if self.severity is not None and not turbulent:
            deny("has no meaning here, allowed: only with turbulence: dryden", "severity")
        refuse(self._overlapping())
        return self

    def _overlapping(self) -> Iterator[Conflict]:
        """JSBSim flies one gust at a time."""
        for i, (early, late) in enumerate(pairwise(self.gusts), start=1):
            if late.at_s < early.end_s:
                allowed = f"allowed: {early.end_s:g} s or later"
                yield ("gust", i, "at_s"), f"{late.at_s:g} is before the gust before it has faded, {allowed}"
