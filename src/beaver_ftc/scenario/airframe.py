"""The aircraft of a scenario, found by what the scenario calls it, and the names that are its own."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from beaver_ftc.aircraft import DEFAULT, Aircraft, load
from beaver_ftc.aircraft.aircraft import BESIDE, NotDerived, UnknownAircraft
from beaver_ftc.documents.document import Number, deny
from beaver_ftc.documents.errors import BeaverFtcError, suggestion
from beaver_ftc.extensions import offered, required

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
Ratio = Annotated[Number, Field(ge=-10, le=10, json_schema_extra={"unit": "share of 1"})]
Ratios = Annotated[dict[TermName, Ratio], BeforeValidator(_no_more_than_there_are)]
