"""The records of a law, filled by the names of their fields, for tests of single kernels."""

import numpy as np

from beaver_ftc.control.state import control_dtype


def new_control(**fields):
    """All records of a law for four surfaces, in one, zero but for these fields."""
    control = put(np.zeros(1, control_dtype(4)).view(np.recarray)[0], **fields)
    layout = control["layout"]
    if "main" in fields:  # one surface leads each axis
        layout["authority"][range(3), layout["main"]] = 1.0
    if fields.get("stand_in", -1) >= 0:
        layout["aside"][layout["stand_in"]] = 1
    return control


def put(control, **fields):
    """Put each value where a field of that name is, but for what observer, rivals and engines keep."""
    for name, value in fields.items():
        if name in control.dtype.names:
            control[name] = value
            continue
        own = (part for part in control.dtype.names if part not in ("rival", "rejection", "power", "engines"))
        parts = [part for part in own if name in (control[part].dtype.names or ())]
        assert len(parts) == 1, (name, parts)
        control[parts[0]][name] = value
        if name == "dt":
            control["rejection"]["dt"] = value
    return control
