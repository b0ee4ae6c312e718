"""The vehicle file: which columns of a log are rates and commands, and what each surface makes of these.

It names columns, not code. Unknown keys and every other mistake are refused with one line each:
`FILE:LINE: key: what is wrong, what is allowed`.
"""

import re
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from beaver_ftc.documents.base import Conflict, Location, Number, Section, number, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.documents.validation import parse_document, text_of, validate
from beaver_ftc.scenario.loader import looks_like_a_path

_MAX_BYTES = 1_000_000
_FOLDER = Path(__file__).parent / "vehicles"

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
_NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")
ColumnName = Annotated[str, Field(min_length=1, max_length=200)]
Kind = Literal["loss", "stuck"]


class Rates(Section):
    """The columns of the three body rates, rad/s."""

    p: ColumnName = Field(description="column of the roll rate, rad/s", examples=["p_rad_s"])
    q: ColumnName = Field(description="column of the pitch rate, rad/s", examples=["q_rad_s"])
    r: ColumnName = Field(description="column of the yaw rate, rad/s", examples=["r_rad_s"])


class Vehicle(Section):
    """What the columns of a vehicle's logs are."""

    name: Name = Field(description="what the vehicle is called", examples=["flying-wing"])
    reader: Literal["table", "alfa", "ulog", "ardupilot"] | None = Field(
        default=None, description="how its logs are read, where a path does not show it"
    )
    rates: Rates
    commands: list[ColumnName] = Field(
        min_length=1,
        max_length=8,
        description="columns of the commands, upstream of what can fail",
        examples=[["roll_cmd", "pitch_cmd"]],
    )
    signals: list[ColumnName] = Field(
        default=[],
        max_length=12,
        description="further measured columns the rates depend on",
        examples=[["roll_rad", "pitch_rad"]],
    )
    surfaces: dict[str, dict[str, Number]] = Field(
        min_length=1,
        max_length=8,
        description="what each healthy surface makes of the commands: a share of each",
        json_schema_extra={"unit": "share of 1", "range": "any"},
        examples=[{"left": {"roll_cmd": 0.5, "pitch_cmd": 0.5}}],
    )
    labels: dict[str, ColumnName] = Field(
        default={},
        description="columns with each surface's true effectiveness: identification and scoring",
        examples=[{"left": "left_truth"}],
    )
    outputs: dict[str, ColumnName] = Field(
        default={},
        description="columns of the servo outputs: read by the freeze rule of a benchmark alone",
        examples=[{"left": "left_pwm"}],
    )
    faults: list[Kind] = Field(
        default=["loss"],
        min_length=1,
        description="what a surface may do: lose effectiveness, be stuck",
        examples=[["loss", "stuck"]],
    )
    max_rate_hz: Number = number(
        20.0, gt=0, le=1000, unit="Hz", says="rate above which the log is averaged to this rate"
    )

    @model_validator(mode="after")
    def _agree(self) -> "Vehicle":
        says = "a surface's name has letters, digits, - and _ only, allowed: one"  # it is part of a column's
        bad = [name for name in self.surfaces if not _NAME.fullmatch(name)]
        conflicts: list[Conflict] = [(("surfaces", name), f"{name!r}: {says}") for name in bad]
        for surface, row in self.surfaces.items():
            conflicts += _unknown(("surfaces", surface), row, "command", self.commands)
        for key, table in (("labels", self.labels), ("outputs", self.outputs)):
            conflicts += _unknown((key,), table, "surface", self.surfaces)
        refuse(conflicts)
        return self


def _unknown(at: Location, names: Iterable[str], what: str, known: Collection[str]) -> list[Conflict]:
    """The conflicts of names below a location that are not known."""
    unknown = [name for name in names if name not in known]
    return [((*at, name), f"{name!r} is no {what}{suggestion(name, known)}") for name in unknown]


def load_vehicle(path_or_name: str | Path) -> Vehicle:
    """The vehicle in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    given, known = str(path_or_name), sorted(path.stem for path in _FOLDER.glob("*.yaml"))
    if looks_like_a_path(given):
        text = text_of(given, _MAX_BYTES)
    else:
        given = str(_FOLDER / f"{given}.yaml") if given in known else given
        unknown = f"no such file or built-in vehicle{suggestion(given, known)}"
        text = text_of(given, _MAX_BYTES, lambda: unknown)
    path = str(Path(given))
    return validate(Vehicle, parse_document(text, path), path)
