"""Records that kernels of the diagnosis are tried on, one at a time."""

import numpy as np

from beaver_ftc.diagnosis.schemes import fdi_dtype

DT, POLES = 0.02, np.array([1e6, 4.0, 0.5])


def new_fdi():
    fdi = np.zeros(1, fdi_dtype(4)).view(np.recarray)[0]
    fdi["config"]["dt"], fdi["bank"]["config"]["n_filters"], fdi["bank"]["config"]["a"][:3] = (
        DT,
        3,
        np.exp(-POLES * DT),
    )
    fdi["types"]["config"]["dt"] = DT
    fdi["isolation"]["config"]["forget"], fdi["isolation"]["config"]["a"] = (
        0.98,
        np.exp(-np.array([3.0, 4.0, 5.0]) * DT),
    )
    return fdi


def fill(record, **values):
    """Fill fields of a stage's record, in itself or in one of its parts. Returns the record."""
    sections = [record[part] for part in record.dtype.names if record.dtype[part].names]
    for name, value in values.items():
        next(part for part in (record, *sections) if name in (part.dtype.names or ()))[name] = value
    return record
