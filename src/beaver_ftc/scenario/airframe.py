"""What flies in a scenario, where it starts, and the air around it: aircraft, `initial`, `actuators`,
`environment`.

The aircraft is found by what the scenario calls it; names that are its own are checked against it. A
flight starts from a trimmed flight condition, whose keys depend on the aircraft. The surfaces' actuators
are ideal, a preset, one set of numbers for all, or one a surface. The air has steady wind, turbulence and
gusts.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, lru_cache
from itertools import pairwise
from math import degrees
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
    ValidationInfo,
    create_model,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.aircraft import DEFAULT, Aircraft, load
from beaver_ftc.aircraft.aircraft import BESIDE, NotDerived, UnknownAircraft
from beaver_ftc.documents.document import (
    Conflict,
    Flag,
    Number,
    Section,
    deny,
    entry,
    number,
    refuse,
    refuse_unknown,
)
from beaver_ftc.documents.errors import BeaverFtcError, suggestion
from beaver_ftc.plugins import offered, required

_CHECKED: ContextVar[tuple[Aircraft, str | None] | None] = ContextVar("aircraft", default=None)


def find_aircraft(reference: str = DEFAULT, beside: Path | None = None) -> Aircraft:
    """The aircraft of a name, `jsbsim:NAME` or `./FOLDER`; `beside` is the folder to find that in.

    One of the jsbsim package is derived at its first use. One of the user's own is checked, and compared with
    its model; the product that derives says so on standard error. Raises as `beaver_ftc.aircraft.load`, and
    as `plant.admission.admit`.
    """
    try:
        aircraft = load(reference, beside)
    except NotDerived:
        try:
            required("derive", reference)(reference)
        except BeaverFtcError as error:
            raise UnknownAircraft(str(error)) from None
        aircraft = load(reference, beside)
    if reference.startswith(BESIDE):
        required("admit", reference)(aircraft)
        if compare := offered("compare"):
            compare(aircraft)
    return aircraft


def checked_aircraft() -> Aircraft:
    """The aircraft of the scenario being read; outside of one, the built-in aircraft."""
    checked = _CHECKED.get()
    return checked[0] if checked else load()


def left_out(section: type[Section]) -> Callable[[], Section]:
    """What makes a section that a scenario leaves out: the same object in every flight of an aircraft, so
    that what is worked out of it is kept."""
    return lambda: _left_out(section, checked_aircraft().surfaces)


@cache
def _left_out(section: type[Section], surfaces: tuple[str, ...]) -> Section:
    return section()


def aircraft_called(reference: str | None, beside: Path | None) -> Aircraft:
    """What a scenario calls its aircraft, if anything: the one checked against if that is its name."""
    checked = _CHECKED.get()
    if reference is None or (checked and checked[1] == reference):
        return checked_aircraft()
    return find_aircraft(reference, beside)


@contextmanager
def checked_against(aircraft: Aircraft, reference: str | None = None) -> Iterator[None]:
    """Check names against this aircraft; `reference` is what a scenario calls it."""
    token = _CHECKED.set((aircraft, reference))
    try:
        yield
    finally:
        _CHECKED.reset(token)


def folder_of(info: ValidationInfo) -> Path | None:
    """Where the scenario's file is, if it is one."""
    return (info.context or {}).get("folder")


def known_aircraft(reference: str, info: ValidationInfo) -> str:
    """Refuse what is no aircraft."""
    try:
        aircraft_called(reference, folder_of(info))
    except UnknownAircraft as error:
        deny(str(error))
    return reference


def named(wrong: Callable[[str], str | None]) -> AfterValidator:
    """Refuse names of which something is wrong."""

    def check(name: str) -> str:
        if says := wrong(name):
            deny(says)
        return name

    return AfterValidator(check)


def among(known: Callable[[], Iterable[str]], says: str = "{!r} is not known") -> AfterValidator:
    """Refuse names that are not among those known. says: what such a name is."""

    def wrong(name: str) -> str | None:
        names = tuple(known())
        return None if name in names else f"{says.format(name[:100])}{suggestion(name, names)}"

    return named(wrong)


def _examples(schema: dict[str, Any]) -> None:
    schema["examples"] = list(load().surfaces)


def _no_more_than_there_are(given: Any) -> Any:
    """Refuse a mapping that cannot be right before a suggestion is made for each of its names."""
    most = len(checked_aircraft().terms)
    if isinstance(given, dict) and len(given) > most:
        deny(f"{len(given)} terms, allowed: at most the {most} there are")
    return given


Actuator = Annotated[str, among(lambda: checked_aircraft().surfaces), Field(json_schema_extra=_examples)]
TermName = Annotated[str, among(lambda: checked_aircraft().terms, "unknown aerodynamic term")]
Ratio = Annotated[Number, Field(ge=-10, le=10, json_schema_extra={"unit": "1"})]
Ratios = Annotated[dict[TermName, Ratio], BeforeValidator(_no_more_than_there_are)]


class Initial(Section):
    """The flight condition at the start: trimmed straight flight with wings level. Another aircraft has
    its own engine settings and surfaces."""

    airspeed_mps: Number = number(45.0, "m/s", "true airspeed", ge=20, le=70)
    altitude_m: Number = number(1828.8, "m", "altitude above sea level", ge=-300, le=6000)
    on_ground: Flag | None = entry(
        None,
        "true: the aircraft stands on the ground at `altitude_m`. Only for `sitl`",
    )

    _airframe: ClassVar[Aircraft | None] = None

    @model_validator(mode="after")
    def _can_stand(self) -> Self:
        if self.on_ground and self._airframe is not None and self._airframe.file.ground is None:
            deny(f"{self._airframe.name}'s file has no `ground` to stand on, allowed: false", "on_ground")
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Classes of a single aircraft are made again where they are read."""
        return _initial_again, (self._airframe, self.model_dump(exclude_unset=True))


@lru_cache(maxsize=32)
def initial_of(aircraft: Aircraft) -> type[Initial]:
    """The flight condition of an aircraft: with its engine's settings, and the surfaces trim leaves alone."""
    keys = _flow_keys(aircraft)
    for name, setting in aircraft.engine.settings.items():
        low, high = setting.range
        says = setting.says or name
        keys[name] = Number, number(setting.default, setting.unit, says, ge=low, le=high)
    for surface in aircraft.left_by_trim:
        travel = aircraft.travel[surface]
        says = f"{surface} deflection"
        low, high = degrees(travel.min_rad), degrees(travel.max_rad)
        of = number(0.0, "deg", says, ge=low, le=high, examples=[round(0.25 * high, 1)])
        keys[f"{surface}_deg"] = Number, of
    made = create_model("Initial", __base__=Initial, __doc__=Initial.__doc__, **keys)
    made._airframe = aircraft
    return made


def airspeeds_of(aircraft: Aircraft) -> tuple[float, float]:
    """The lowest and the highest airspeed that a scenario of an aircraft may name, m/s."""
    low, high = aircraft.envelope.airspeed_mps
    return min(20.0, 2.0 / 3.0 * low), max(70.0, 14.0 / 11.0 * high)


def highest_of(aircraft: Aircraft) -> float:
    """The highest altitude that a scenario of an aircraft may name, m."""
    return max(6000.0, aircraft.file.start.altitude_m or 0.0)


def _flow_keys(aircraft: Aircraft) -> dict[str, Any]:
    """Airspeed and altitude, whose range and default make room for the aircraft's own."""
    low, high = aircraft.envelope.airspeed_mps
    start = aircraft.file.start
    slowest, fastest = airspeeds_of(aircraft)
    default = start.airspeed_mps or (45.0 if low <= 45.0 <= high else 0.5 * (low + high))
    says = f"true airspeed. The model is valid from {low:g} to {high:g} m/s"
    speed = number(default, "m/s", says, ge=slowest, le=fastest)
    keys: dict[str, Any] = {"airspeed_mps": (Number, speed)}
    if start.altitude_m is not None:
        most = highest_of(aircraft)
        altitude = number(start.altitude_m, "m", "altitude above sea level", ge=-300, le=most)
        keys["altitude_m"] = Number, altitude
    return keys


def _initial_again(aircraft: Aircraft | None, values: dict[str, Any]) -> Initial:
    return (initial_of(aircraft) if aircraft else Initial).model_validate(values)


def given_initial(given: Any) -> Any:
    """The flight condition given, as one of the aircraft in question."""
    if isinstance(given, Initial):
        given = given.model_dump(exclude_unset=True)
    return initial_of(checked_aircraft()).model_validate(given)


def default_initial() -> Initial:
    """The default flight condition of the aircraft in question."""
    return initial_of(checked_aircraft())()


def initial_schema(schema: dict[str, Any]) -> None:
    """Show an editor the keys of the built-in aircraft."""
    schema.clear()
    schema.update(initial_of(load()).model_json_schema())


class ActuatorDynamics(Section):
    """one surface.

    bandwidth_rad_s: bandwidth of the first-order lag. 0: no lag, rad/s
    rate_limit_deg_s: largest rate of the surface. 0: no limit, deg/s
    travel_deg: lower and upper stop; left out: the stops in the aircraft file, deg
    """

    bandwidth_rad_s: Number = number(0.0, "rad/s", ge=0, le=10_000, examples=[20])
    rate_limit_deg_s: Number = number(0.0, "deg/s", ge=0, le=100_000, examples=[60])
    travel_deg: tuple[Number, Number] | None = number(
        None, "deg", range="rising, -90 to 90", examples=[[-20, 20]]
    )

    @model_validator(mode="after")
    def _stops_are_in_order(self) -> Self:
        if self.travel_deg is not None and not -90 <= self.travel_deg[0] < self.travel_deg[1] <= 90:
            deny("stops out of order or range, allowed: [lower, upper] from -90 to 90 deg", "travel_deg")
        return self

    @property
    def is_ideal(self) -> bool:
        """No lag and no rate limit; the stops are always there."""
        return self.bandwidth_rad_s == 0 and self.rate_limit_deg_s == 0


PRESETS: dict[str, dict[str, float]] = {
    "ideal": {},
    "servo": {"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 60.0},  # rates as in [SL03]
}


class OfSurfaces(Section, extra="allow"):
    """The same keys for every surface. A key directly in this section applies to all surfaces; one in the
    section of a surface applies only to this surface."""

    of_one: ClassVar[type[Section]]
    presets: ClassVar[Mapping[str, dict[str, float]]] = {}

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = cls.presets.get(given, given)
        return _by_surface(given, tuple(cls.of_one.model_fields)) if isinstance(given, dict) else given

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        mapping = handler.resolve_ref_schema(handler(core))
        reference = mapping["additionalProperties"]
        one = handler.resolve_ref_schema(reference)
        mapping["properties"] = {**one["properties"], **dict.fromkeys(load().surfaces, reference)}
        preset = {"enum": list(cls.presets), "type": "string", "description": "a preset"}
        return {"anyOf": [preset, mapping]} if cls.presets else mapping


class Actuators(OfSurfaces):
    """A preset, or a key directly in this section, applies to all surfaces. A key of one surface replaces
    it."""

    __pydantic_extra__: dict[str, ActuatorDynamics]
    of_one = ActuatorDynamics
    presets = PRESETS

    @property
    def is_ideal(self) -> bool:
        """Whether no surface has a lag or a rate limit."""
        return all(dynamics.is_ideal for _, dynamics in self)


DeadBand = Annotated[Number, Field(ge=0, le=10)]


class TrueActuator(Section):
    """one surface.

    bandwidth: bandwidth, divided by that in `actuators`, 1
    rate_limit: rate limit, divided by that in `actuators`, 1
    dead_band_deg: largest distance from the command at which the actuator does not move, deg
    """

    bandwidth: Number = number(1.0, "1", ge=0.1, le=10, examples=[0.8])
    rate_limit: Number = number(1.0, "1", ge=0.1, le=10, examples=[0.8])
    dead_band_deg: DeadBand = number(0.0, "deg", examples=[0.1])


class TrueActuators(OfSurfaces):
    """Actuators of the truth, compared with `actuators`. A key directly in this section applies to all
    surfaces, a key in the section of a surface only to this surface. An ideal actuator has no bandwidth and
    no rate limit that could differ."""

    __pydantic_extra__: dict[str, TrueActuator]
    of_one = TrueActuator


def _by_surface(given: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """Numbers given for all surfaces become each surface's own, unless it has its own already."""
    surfaces = checked_aircraft().surfaces
    for_all = {key: value for key, value in given.items() if key in keys}
    rest = {key: value for key, value in given.items() if key not in for_all}
    known = (*keys, *surfaces)
    wrong = [key for key in rest if key not in surfaces]
    refuse_unknown(wrong, known)
    own = {surface: rest.get(surface, {}) for surface in surfaces}
    return {surface: {**for_all, **it} if isinstance(it, dict) else it for surface, it in own.items()}


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
