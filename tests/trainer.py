"""The made-up trainer of tests/data/aircraft, with other words in its file: no model of it is flown."""

from pathlib import Path

import yaml

from beaver_ftc.aircraft.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile

TRAINER = Path(__file__).parent / "data" / "aircraft" / "trainer"


def trainer_file(**sections):
    """Its file's data. sections: a mapping is added to what there is, None takes a key out of it.

    A surface need not say its properties, and is in a group of its own unless groups are said.
    """
    data = yaml.safe_load((TRAINER / "aircraft.yaml").read_text(encoding="utf-8"))
    for section, given in sections.items():
        mapping = isinstance(given, dict)
        data[section] = {**data.get(section, {}), **given} if mapping else given
        for key in [key for key, value in data[section].items() if value is None] if mapping else ():
            del data[section][key]
    for name, surface in data["surfaces"].items():
        for key in ("command", "position", "effective"):
            surface.setdefault(key, f"fcs/{name}-{key}")
        if "groups" not in sections and not any(name in members for members in data["groups"].values()):
            data["groups"][f"{name}s"] = [name]
    return data


def trainer(**sections):
    """The aircraft."""
    return Aircraft(AircraftFile.model_validate(trainer_file(**sections)), TRAINER)


def change(file, old, new):
    """Write other words into a copy of the file."""
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
