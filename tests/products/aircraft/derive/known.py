"""An aircraft whose terms are known, and states whose accelerations follow from them by Euler's equations."""

import yaml

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile
from trainer import TRAINER


def aircraft(*signals, **more):
    """The trainer, with signals that none of its terms has, and other keys of its file."""
    data = yaml.safe_load((TRAINER / "aircraft.yaml").read_text())
    data["signals"] = {name: {"property": f"of/{name}"} for name in signals}
    return Aircraft(AircraftFile.model_validate(data | more), TRAINER)
