"""An aircraft that has a file already: its moments are found anew, all else is as the file has it."""

import shutil
from pathlib import Path

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
