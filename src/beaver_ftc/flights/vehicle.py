"""The vehicle file: which columns of a log are rates and commands, and what each surface makes of these.

It names columns, not code. Unknown keys and every other mistake are refused with one line each:
`FILE:LINE: key: what is wrong, what is allowed`.
"""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from beaver_ftc.documents.base import Conflict, Number, Section, number, refuse
from beaver_ftc.documents.document import Problem
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.documents.files import UnreadableError, read_text
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import parse_document, validate
from beaver_ftc.scenario.loader import looks_like_a_path

_MAX_BYTES = 1_000_000
_FOLDER = Path(__file__).parent / "vehicles"

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]
_NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")
ColumnName = Annotated[str, Field(min_length=1, max_length=200)]
Kind = Literal["loss", "stuck"]


class Rates(Section):
    """The columns of the three body rates, rad/s."""

    p: ColumnName = Field(description="column of the roll rate, rad/s")
    q: ColumnName = Field(description="column of the pitch rate, rad/s")
    r: ColumnName = Field(description="column of the yaw rate, rad/s")


class Vehicle(Section):
    """What the columns of a vehicle's logs are."""

    name: Name = Field(description="what the vehicle is called")
    reader: Literal["table", "alfa", "ulog", "ardupilot"] | None = Field(
        default=None, description="how its logs are read, where a path does not show it"
    )
    rates: Rates
    commands: list[ColumnName] = Field(
        min_length=1, max_length=8, description="columns of the commands, upstream of what can fail"
    )
    signals: list[ColumnName] = Field(
        default=[], max_length=12, description="further measured columns the rates depend on"
    )
    surfaces: dict[str, dict[str, Number]] = Field(
        min_length=1, max_length=8, description="what each healthy surface makes of the commands"
    )
    labels: dict[str, ColumnName] = Field(
        default={}, description="columns with each surface's true effectiveness: identification and scoring"
    )
    outputs: dict[str, ColumnName] = Field(
        default={}, description="columns of the servo outputs: read by the freeze rule of a benchmark alone"
    )
    faults: list[Kind] = Field(
        default=["loss"], min_length=1, description="what a surface may do: lose effectiveness, be stuck"
    )
    max_rate_hz: Number = number(
        20.0, gt=0, le=1000, unit="Hz", says="rate above which the log is averaged to this rate"
    )

    @model_validator(mode="after")
    def _agree(self) -> "Vehicle":
        refuse([*self._bad_names(), *self._unknown_commands(), *self._unknown_surfaces()])
        return self

    def _bad_names(self) -> list[Conflict]:
        """A surface's name becomes part of a column's name, and + joins several."""
        return [
            (
                ("surfaces", name),
                f"{name!r}: a surface's name has letters, digits, - and _ only, allowed: one",
            )
            for name in self.surfaces
            if not _NAME.fullmatch(name)
        ]

    def _unknown_commands(self) -> list[Conflict]:
        return [
            (("surfaces", surface, name), f"{name!r} is no command{suggestion(name, self.commands)}")
            for surface, row in self.surfaces.items()
            for name in row
            if name not in self.commands
        ]

    def _unknown_surfaces(self) -> list[Conflict]:
        return [
            ((key, name), f"{name!r} is no surface{suggestion(name, self.surfaces)}")
            for key, table in (("labels", self.labels), ("outputs", self.outputs))
            for name in table
            if name not in self.surfaces
        ]


def builtin_vehicles() -> list[str]:
    """Names of the built-in vehicles."""
    return sorted(path.stem for path in _FOLDER.glob("*.yaml"))


def load_vehicle(path_or_name: str | Path) -> Vehicle:
    """The vehicle in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    given = str(path_or_name)
    path = Path(path_or_name)
    if not looks_like_a_path(given) and given in builtin_vehicles():
        path = _FOLDER / f"{given}.yaml"
    try:
        text = read_text(path, _MAX_BYTES)
    except UnreadableError as error:
        says = str(error)
        if says.startswith("no such file") and not looks_like_a_path(given):
            says = f"no such file or built-in vehicle{suggestion(given, builtin_vehicles())}"
        raise ScenarioError(given, [Problem(error.line, (), says)]) from None
    return validate(Vehicle, parse_document(text, str(path)), str(path))
