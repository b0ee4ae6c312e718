"""An aircraft that has a file already: its moments are found anew, all else is as the file has it."""

from pathlib import Path
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.loading import read
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.initial import initial_of
from beaver_ftc.studies.derive.level import Level
from beaver_ftc.studies.derive.outline import EnvelopeFile

# What a rudder at its stop leads to: a file's own terms hold wherever the air is attached.
WIDE_SIDESLIP_RAD = 0.45


def about_known(source: Path, folder: Path, asked: EnvelopeFile) -> Level:
    """The aircraft in trim where its flights start, over the envelope of its file or the one asked for; its
    model is copied."""
    aircraft = read(source)
    copy_of(aircraft.jsbsim, folder)
    data = aircraft.file.model_dump(mode="json", exclude_none=True, exclude={"moments"})
    data["envelope"] |= asked.model_dump(
        mode="json", exclude_none=True, exclude={"altitude_m", "sideslip_deg"}
    )
    start = usual_start(aircraft)
    if asked.airspeed_mps is not None:
        start["airspeed_mps"] = 0.5 * sum(asked.airspeed_mps)
    if asked.altitude_m is not None:
        start["altitude_m"] = asked.altitude_m
    data["start"] = start
    plant = Plant(100, aircraft=aircraft)
    return Level(data, aircraft, plant, trim_at(plant, **start), asked.sideslip_rad or WIDE_SIDESLIP_RAD)


def usual_start(aircraft: Aircraft) -> dict[str, float]:
    """Where a scenario of an aircraft starts that says nothing else."""
    usual = initial_of(aircraft)()
    return {"airspeed_mps": usual.airspeed_mps, "altitude_m": usual.altitude_m}


def trim_at(plant: Plant, airspeed_mps: float, altitude_m: float) -> TrimPoint:
    """Trim with the engine as the file has it. Raises BadInput as `trim`."""
    settings = {name: setting.default for name, setting in plant.aircraft.engine.settings.items()}
    return trim(airspeed_mps, altitude_m, plant=plant, **settings)


def named_as(aircraft: Aircraft, moments: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """Terms under the names an aircraft's own file has for the same products."""
    names = {(t.coefficient, t.surface, frozenset(t.of)): t.name for t in aircraft.terms.values()}

    def name_of(coefficient: str, term: dict[str, Any]) -> str:
        product = coefficient, term.get("surface"), frozenset(term["of"].items())
        return names.get(product, term["name"])

    return {
        coefficient: [{**term, "name": name_of(coefficient, term)} for term in terms]
        for coefficient, terms in moments.items()
    }
