"""The requests of a page and the messages to it.

Each request has a model with limits; any other message is refused. Messages to a page are JSON, with faults
in words and numbers of seven digits.
"""

import json
import re
from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Any, Literal
from unicodedata import category

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from beaver_ftc.documents import BadInput
from beaver_ftc_live.page import MAX_BYTES, MAX_GUESTS

FASTEST = 20.0  # times real time
STICK_DEG_S = 20.0  # full stick
WHEN = {"at_s", "end_s"}  # keys of a fault that are times
MAX_NAME = 24  # letters
# Blank letters; a mark without a letter; three marks on a letter, which reach into the line above.
ILLEGIBLE = re.compile(r"[\u115f\u1160\u2800\u3164\uffa0]|(^| )\0|\0{3}")

Message = dict[str, Any]  # to a page

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,100}$")]
Finite = Annotated[float, Field(ge=-1000, le=1000)]
Finite4 = Annotated[float, Field(ge=-10_000, le=10_000)]
Rate = Annotated[float, Field(ge=-STICK_DEG_S, le=STICK_DEG_S)]
GustMps = Annotated[float, Field(ge=-25, le=25)]


class Request(BaseModel):
    """A request. n: a number that the page chooses and the answer repeats. do: its kind."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n: int = Field(0, ge=0, le=2**53)
    do: str


class Break(Request):
    """Begin a fault now. The rules of a scenario check it."""

    do: Literal["break"]
    fault: dict[Name, Finite | Name] = Field(max_length=8)


class Repair(Request):
    """Repair a surface, or everything."""

    do: Literal["repair"]
    actuator: Name | None = None


class Blow(Request):
    """A gust now: m/s towards north, east, down."""

    do: Literal["blow"]
    velocity_mps: tuple[GustMps, GustMps, GustMps]


class Aim(Request):
    """New commands to the autopilot. None: unchanged."""

    do: Literal["aim"]
    altitude_m: Finite4 | None = None
    airspeed_mps: Finite | None = None
    heading_deg: Finite | None = None


class Stick(Request):
    """Rates added to the reference until the next such request, deg/s. coordinated: also those of a level
    turn."""

    do: Literal["stick"]
    coordinated: bool = False
    rates_deg_s: tuple[Rate, Rate, Rate]


class Speed(Request):
    """The speed of the simulation as a multiple of real time."""

    do: Literal["speed"]
    times: float = Field(ge=1, le=FASTEST)


class Pause(Request):
    """Pause the flight, or continue it."""

    do: Literal["pause"]
    on: bool


Grade = Literal["ideal", "tactical-grade", "consumer-grade"]


class Change(Request):
    """Another law, diagnosis or sensors from now on. None: unchanged."""

    do: Literal["change"]
    law: Name | None = None
    scheme: Name | None = None
    sensors: Grade | None = None


class Fresh(Request):
    """Begin a new flight in trim. None: as in the present flight."""

    do: Literal["fresh"]
    scenario: Name | None = None
    law: Name | None = None
    scheme: Name | None = None
    fault_class: Literal["published", "all"] | None = None
    sensors: Grade | None = None
    turbulence: Literal["none", "light", "moderate", "severe"] | None = None
    autopilot: bool | None = None


class Game(Request):
    """A move of the game against the detector: a new round with a random fault, or with one that another
    person chooses (`second`); an answer; or the end of the round."""

    do: Literal["game"]
    move: Literal["random", "second", "answer", "stop"]
    answer: Name | None = None


class Save(Request):
    """Write the flight up to now as a result folder."""

    do: Literal["save"]


class Invite(Request):
    """Request an address with which another browser can open the page once."""

    do: Literal["invite"]


class Let(Request):
    """Allow a guest, or all guests, to inject faults; or withdraw this."""

    do: Literal["let"]
    guest: int | None = Field(None, ge=1, le=MAX_GUESTS)
    on: bool


def _with_marks_as_zero(name: str) -> str:
    """The name with \\0 in place of each mark above, below or through the letter before it."""
    return "".join("\0" if category(letter) in ("Mn", "Me") else letter for letter in name)


def _as_one_line(name: str) -> str:
    """A name on one line. Raises ValueError without a letter, and for letters that change the direction of
    others, are blank, or reach into other lines."""
    line = " ".join(name.split())
    if not line or not line.isprintable() or ILLEGIBLE.search(_with_marks_as_zero(line)):
        raise ValueError("letters that can be read are missing, or others are there")
    return line


class CallMe(Request):
    """The name of a guest."""

    do: Literal["name"]
    name: Annotated[str, AfterValidator(_as_one_line)] = Field(max_length=MAX_NAME)


AnyRequest = Annotated[
    Break | Repair | Blow | Aim | Stick | Speed | Pause | Change | Fresh | Game | Save | Invite | Let
    | CallMe, Field(discriminator="do"),
]  # fmt: skip
_ADAPTER: TypeAdapter[Request] = TypeAdapter(AnyRequest)


def parse(text: str | bytes) -> Request:
    """The request in a message. Raises BadInput with the first mistake, in one line."""
    if len(text) > MAX_BYTES:
        raise BadInput(f"a message of {len(text)} characters, allowed: {MAX_BYTES}")
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "message"
        raise BadInput(f"{place:.100}: {first['msg']:.200}") from None


def acknowledged(n: int, ok: bool, says: str) -> Message:
    """The answer to the request of this number."""
    return {"k": "ack", "n": n, "ok": ok, "says": says}


def in_words(fault: Mapping[str, Any]) -> str:
    """A fault in words: its place, its type and its sizes."""
    where = fault.get("sensor", fault.get("actuator", fault["type"]))
    no_sizes = {"type", "actuator", "sensor", *WHEN}
    sizes = ", ".join(f"{key} {value}" for key, value in fault.items() if key not in no_sizes)
    return f"{where}: {str(fault['type']).replace('_', ' ')}" + (f" ({sizes})" if sizes else "")


def verdict_in_words(verdict: Any) -> str:
    """The surface that a verdict names, and the fault type."""
    kind = verdict.type
    if kind is None or kind == verdict.isolated:
        return str(verdict.isolated)
    return f"{verdict.isolated}, {kind.replace('_', ' ')}"


def encode(message: Message) -> bytes:
    """One message to a page."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def short(value: float) -> float | None:
    """A number with seven digits, which suffice to draw it; None for a number that is not finite."""
    return float(f"{value:.7g}") if isfinite(value) else None
