"""Names in a scenario that must be those of its aircraft: surfaces, terms, the aircraft itself."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from beaver_ftc.aircraft import UnknownAircraft, load
from beaver_ftc.documents.base import Number, refuse
from beaver_ftc.documents.errors import suggestion
from beaver_ftc.scenario.airframe import aircraft_called, checked_aircraft
from beaver_ftc.scenario.sensor_faults import sensor_words, sensors_there

UNANTICIPATED = "unanticipated"


def known_surface(name: str) -> str:
    """Refuse what is no surface of the scenario's aircraft."""
    surfaces = checked_aircraft().surfaces
    if name not in surfaces:
        refuse([((), f"{name[:100]!r} is not known{suggestion(name, surfaces)}")])
    return name


def _examples(schema: dict[str, Any]) -> None:
    schema["examples"] = list(load().surfaces)


Actuator = Annotated[str, AfterValidator(known_surface), Field(json_schema_extra=_examples)]


def _known_term(name: str) -> str:
    known = checked_aircraft().terms
    if name not in known:
        refuse([((), f"unknown aerodynamic term{suggestion(name, known)}")])
    return name


def _no_more_than_there_are(given: Any) -> Any:
    """Refuse a mapping that cannot be right before a suggestion is made for each of its names."""
    most = len(checked_aircraft().terms)
    if isinstance(given, dict) and len(given) > most:
        refuse([((), f"{len(given)} terms, allowed: at most the {most} there are")])
    return given


TermName = Annotated[str, AfterValidator(_known_term)]
Ratio = Annotated[Number, Field(ge=-10, le=10)]
Ratios = Annotated[dict[TermName, Ratio], BeforeValidator(_no_more_than_there_are)]


def nameable(name: str) -> str:
    """Refuse what a diagnosis cannot name."""
    sensors = (sensor_words(name) for name in sensors_there())
    known = (*checked_aircraft().surfaces, UNANTICIPATED, *sensors)
    if name not in known:
        refuse([((), f"{name[:100]!r} is not known{suggestion(name, known)}")])
    return name


def known_aircraft(reference: str, info: ValidationInfo) -> str:
    """Refuse what is no aircraft."""
    try:
        aircraft_called(reference, folder_of(info))
    except UnknownAircraft as error:
        refuse([((), str(error))])
    return reference


def folder_of(info: ValidationInfo) -> Path | None:
    """Where the scenario's file is, if it is one."""
    return (info.context or {}).get("folder")
