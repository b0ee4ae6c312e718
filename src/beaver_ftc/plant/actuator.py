"""The actuator of one surface as JSBSim's XML: written from the one template, `aircraft/actuator.xml`."""

import re
from functools import lru_cache

from beaver_ftc.documents.paths import data_root


@lru_cache
def _template() -> str:
    return (data_root() / "aircraft" / "actuator.xml").read_text(encoding="utf-8")


def actuator_system(surface: str, low_rad: float, high_rad: float, prefix: str = "") -> str:
    """A system file for a surface that travels from low_rad to high_rad.

    prefix: begins the names of its signals, `fcs/<prefix><surface>-cmd-rad`, in an aircraft whose own flight
    control uses the plain ones.
    """
    start = _template().index("<system")
    text = _template()[start:].replace("fcs/SURFACE-", f"fcs/{prefix}SURFACE-")
    if prefix:  # JSBSim knows the plain ones without being told
        command = f'<property value="0"> fcs/{prefix}SURFACE-cmd-norm </property>'
        text = text.replace("<property", f"{command}\n  <property", 1)
    text = text.replace("SURFACE", surface)
    for end, stop_rad in (("min", low_rad), ("max", high_rad)):
        stop = f'"> actuators/{surface}/position-{end}-rad </property>'
        text = re.sub(rf'[^"]*(?={stop})', f"{stop_rad!r}", text, count=1)
    return f'<?xml version="1.0"?>\n<!-- From aircraft/actuator.xml: change that. -->\n{text}'
