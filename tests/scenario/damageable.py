"""The Beaver with cases of damage: of its XML nothing changes but that it has their properties."""

import shutil

import yaml

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.aircraft.schema import AircraftFile

DAMAGE = {
    "tail-off": {"property": "failures/damage/tail-off", "takes": ["elevator", "rudder"]},
    "dented": {"property": "failures/damage/dented"},
}
_BEFORE = '<property value="0"> failures/unanticipated/Cm-alpha3 </property>'


def damageable(folder=None, damage=DAMAGE):
    """The aircraft; its files are written only with a folder to put them in."""
    beaver = load()
    data = beaver.file.model_dump(mode="json", exclude_none=True) | {"damage": damage}
    if folder is None:
        return Aircraft(AircraftFile.model_validate(data), beaver.folder)
    shutil.copytree(beaver.folder, folder)
    (folder / "aircraft.yaml").write_text(yaml.safe_dump(data))
    model, text = folder / beaver.file.jsbsim, beaver.jsbsim.read_text()
    added = "".join(f'<property value="0"> {of["property"]} </property>' for of in damage.values())
    assert _BEFORE in text
    model.write_text(text.replace(_BEFORE, _BEFORE + added))
    return folder
