"""What a page may ask of the flight, and how it is answered.

One model a request, strict and small; anything else is refused. Faults are put in words, numbers short,
answers as JSON.
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
WHEN = {"at_s", "end_s"}  # of a fault: not what it is
MAX_NAME = 24  # letters
# Letters that are blank; a mark on no letter; three on one, which stand on the line above.
ILLEGIBLE = re.compile(r"[\u115f\u1160\u2800\u3164\uffa0]|(^| )\0|\0{3}")

Message = dict[str, Any]  # to a page

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,100}$")]
Finite = Annotated[float, Field(ge=-1000, le=1000)]
Finite4 = Annotated[float, Field(ge=-10_000, le=10_000)]
Rate = Annotated[float, Field(ge=-STICK_DEG_S, le=STICK_DEG_S)]
GustMps = Annotated[float, Field(ge=-25, le=25)]


class Request(BaseModel):
    """n: a number of the page's choice, which the answer repeats."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    n: int = Field(0, ge=0, le=2**53)
    do: str


class Break(Request):
    """Break something now; the scenario's own rules check the fault."""

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
    """New values for the autopilot; what is left out stays."""

    do: Literal["aim"]
    altitude_m: Finite4 | None = None
    airspeed_mps: Finite | None = None
    heading_deg: Finite | None = None


class Stick(Request):
    """Rates added to the reference, deg/s, until said otherwise; coordinated: with those of a level turn."""

    do: Literal["stick"]
    coordinated: bool = False
    rates_deg_s: tuple[Rate, Rate, Rate]


class Speed(Request):
    """How many times real time."""

    do: Literal["speed"]
    times: float = Field(ge=1, le=FASTEST)


class Pause(Request):
    """Hold the flight, or let it go on."""

    do: Literal["pause"]
    on: bool


Grade = Literal["ideal", "tactical-grade", "consumer-grade"]


class Change(Request):
    """Another law, diagnosis or sensors now; what is left out stays."""

    do: Literal["change"]
    law: Name | None = None
    scheme: Name | None = None
    sensors: Grade | None = None


class Fresh(Request):
    """Begin a new flight from trim; what is left out stays as it was."""

    do: Literal["fresh"]
    scenario: Name | None = None
    law: Name | None = None
    scheme: Name | None = None
    fault_class: Literal["published", "all"] | None = None
    sensors: Grade | None = None
    turbulence: Literal["none", "light", "moderate", "severe"] | None = None
    autopilot: bool | None = None


class Game(Request):
    """You against the detector: random or second (someone else breaks it), an answer, or the end of it."""

    do: Literal["game"]
    move: Literal["random", "second", "answer", "stop"]
    answer: Name | None = None


class Save(Request):
    """Write the flight so far as a result folder."""

    do: Literal["save"]


class Invite(Request):
    """Ask for an address that lets another browser in, once."""

    do: Literal["invite"]


class Let(Request):
    """Let a guest break things, or all guests; or have them look on again."""

    do: Literal["let"]
    guest: int | None = Field(None, ge=1, le=MAX_GUESTS)
    on: bool


def _with_marks_as_zero(name: str) -> str:
    """The name with what stands above, below or through the letter before it as \\0."""
    return "".join("\0" if category(letter) in ("Mn", "Me") else letter for letter in name)


def _as_one_line(name: str) -> str:
    """A name on one line. Letters that turn the direction of others, show as nothing, or reach into other
    lines are none of it."""
    one = " ".join(name.split())
    if not one or not one.isprintable() or ILLEGIBLE.search(_with_marks_as_zero(one)):
        raise ValueError("letters that can be read are missing, or others are there")
    return one


class CallMe(Request):
    """What a guest is to be called."""

    do: Literal["name"]
    name: Annotated[str, AfterValidator(_as_one_line)] = Field(max_length=MAX_NAME)


AnyRequest = Annotated[
    Break | Repair | Blow | Aim | Stick | Speed | Pause | Change | Fresh | Game | Save | Invite | Let
    | CallMe, Field(discriminator="do"),
]  # fmt: skip
_ADAPTER: TypeAdapter[Request] = TypeAdapter(AnyRequest)


def parse(text: str | bytes) -> Request:
    """The request in a message. Raises BadInput with the first thing that is wrong, in one line."""
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
    """What is broken, how, and by how much."""
    where = fault.get("sensor", fault.get("actuator", fault["type"]))
    unsaid = {"type", "actuator", "sensor", *WHEN}
    sizes = ", ".join(f"{key} {value}" for key, value in fault.items() if key not in unsaid)
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
    """Seven digits are enough to draw; what is not finite is none."""
    return float(f"{value:.7g}") if isfinite(value) else None
