"""The records of a law, filled by the names of their fields, for tests of single kernels."""

import numpy as np

from beaver_ftc.control import row_of
from beaver_ftc.control.state import control_dtype

AILERON, ELEVATOR, RUDDER, FLAP = range(4)  # places of the built-in aircraft's surfaces

# Their fields have names of other stages' too: filled by `fields`.
_APART = ("compiled_rivals", "rejecting", "zhang2005", "published", "power", "engines")
_UNNAMED = {"hedging": ("reference", "active"), "fhat": ("surfaces", "unknown"), "G": ("axes", "G")}


class Fields:
    """A stage's records as one: each field by its name, in whichever of them it is."""

    def __init__(self, record):
        self._record = record

    def _place(self, name):
        (place,) = places(self._record, name)
        return place

    def __getitem__(self, name):
        return self._place(name)[name]

    def __setitem__(self, name, value):
        self._place(name)[name] = value


def places(record, name):
    """Every record in a record, itself included, that has a field of this name."""
    if name in record.dtype.names:
        yield record
        return
    for part in record.dtype.names:
        if isinstance(record[part], np.void) and record[part].dtype.names:
            yield from places(record[part], name)


def fields(record):
    """The fields of a stage, whichever of its records each is in."""
    return Fields(record)


def new_control(**given):
    """All records of a law for four surfaces, in one, zero but for these fields."""
    control = put(np.zeros(1, control_dtype(4)).view(np.recarray)[0], **given)
    layout = control["layout"]
    if "main" in given:  # one surface leads each axis
        layout["authority"][range(3), layout["main"]] = 1.0
    if given.get("stand_in", -1) >= 0:
        layout["is_backup"][layout["stand_in"]] = 1
    return control


def put(control, law=None, **given):
    """Put each value where a field of that name is, but for those of laws, power and engines. law: its name,
    whose row the record is to have."""
    if law is not None:
        row = row_of(law)
        control["config"] = row.place, row.uses_verdict, row.reallocates, row.informed
    for name, value in given.items():
        if name in _UNNAMED:
            stage, field = _UNNAMED[name]
            fields(control[stage])[field] = value
            continue
        own = (part for part in control.dtype.names if part not in _APART)
        found = [place for part in own for place in places(control[part], name)]
        assert len(found) == 1, (name, len(found))
        found[0][name] = value
        if name == "dt":
            control["rejecting"]["config"]["dt"] = value
    return control
