"""What flies in a scenario, and where it starts: aircraft, `initial`.

The aircraft is found by what the scenario calls it; names that are its own are checked against it. A
flight starts from a trimmed flight condition, whose keys depend on the aircraft.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, lru_cache
from math import degrees
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    create_model,
    model_validator,
)

from beaver_ftc.aircraft import DEFAULT, Aircraft, load
from beaver_ftc.aircraft.aircraft import BESIDE, NotDerived, UnknownAircraft
from beaver_ftc.documents.document import (
    Document,
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
    model = initial_of(checked_aircraft())
    if isinstance(given, dict):  # the JSON Schema has the keys of one aircraft alone
        refuse_unknown((key for key in given if key not in model.model_fields), model.model_fields)
    try:
        return model.model_validate(given)
    except ValidationError as error:
        from beaver_ftc.documents.allowed import problems_of  # what is right needs no words

        found = problems_of(error, Document(given), model.model_json_schema())
        refuse((problem.location, problem.says) for problem in found)
        raise


def default_initial() -> Initial:
    """The default flight condition of the aircraft in question."""
    return initial_of(checked_aircraft())()


def initial_schema(schema: dict[str, Any]) -> None:
    """Show an editor the keys of the built-in aircraft."""
    schema.clear()
    schema.update(initial_of(load()).model_json_schema())
