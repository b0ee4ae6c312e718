"""An aircraft that has a file already: its moments are found anew, all else is as the file has it."""

import shutil
from pathlib import Path
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.loading import read
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc.studies.derive.level import Level


def about_known(source: Path, folder: Path) -> Level:
    """The aircraft in trim where its file has flights start; its folder is copied, with the systems its model
    shares with others."""
    aircraft = read(source)
    shutil.copytree(source, folder)
    data = aircraft.file.model_dump(mode="json", exclude_none=True, exclude={"moments"})
    start, (low, high) = aircraft.file.start, aircraft.envelope.airspeed_mps
    plant = Plant(100, aircraft=aircraft)
    settings = {name: setting.default for name, setting in aircraft.engine.settings.items()}
    data["start"] = {
        "airspeed_mps": start.airspeed_mps or 0.5 * (low + high),
        "altitude_m": start.altitude_m if start.altitude_m is not None else 1000.0,
    }
    point = trim(data["start"]["airspeed_mps"], data["start"]["altitude_m"], plant=plant, **settings)
    return Level(data, aircraft, plant, point)


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
