"""Records that kernels of the diagnosis are tried on, one at a time."""

import numpy as np

from beaver_ftc.diagnosis.schemes import fdi_dtype


def new_fdi():
    return np.zeros(1, fdi_dtype(4)).view(np.recarray)[0]


def fill(record, **values):
    """Fill fields of a stage's record, in itself or in one of its parts. Returns the record."""
    sections = [record[part] for part in record.dtype.names if record.dtype[part].names]
    for name, value in values.items():
        next(part for part in (record, *sections) if name in (part.dtype.names or ()))[name] = value
    return record
