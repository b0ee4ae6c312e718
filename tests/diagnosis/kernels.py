"""Records that kernels of the diagnosis are tried on, one at a time."""

from inspect import signature

import numpy as np

from beaver_ftc.diagnosis.schemes import fdi_dtype
from beaver_ftc.diagnosis.state import LOSS

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
    """Fill fields of a stage's record, in itself or in its config, memory or output. Returns the record."""
    sections = [record[part] for part in ("config", "memory", "output") if part in record.dtype.names]
    for name, value in values.items():
        next(part for part in (record, *sections) if name in (part.dtype.names or ()))[name] = value
    return record


# Fields of a surface's records by one name each, for cases that say a few of them.
OF_SURFACE = {
    "runaway": ("actuator", "runaway"), "slowest_step": ("actuator", "slow_step"),
    "evidence": ("evidence", "n_anomalous"),
    **{name: ("evidence", name) for name in ("n_rest", "n_unhidden", "k_first", "first_lo", "first_hi")},
}  # fmt: skip


def put_on(surface, **values):
    """Fill fields of a surface's records, by their names in OF_SURFACE."""
    for name, value in values.items():
        part, field = OF_SURFACE[name]
        surface[part][field] = value


def of_stages(fdi):
    """What the arguments of kernels are called, of the stages of one diagnosis."""
    types, isolation = fdi["types"], fdi["isolation"]
    return {
        "c": types["config"], "k": types["frame_index"] - 1, "types": types, "surfs": types["surface"],
        "layout": fdi["layout"], "est": isolation["estimator"], "shared": isolation["config"]["shared"],
        "bank": fdi["bank"], "nu": fdi["bank"]["output"]["innovation"], "nu_max": fdi["bound"]["nu_max"],
        "dt": fdi["config"]["dt"],
    }  # fmt: skip


def on(kernel, fdi, *given):
    """Call a kernel on the records of its stages and on what is given, in the order of its arguments."""
    parameters = signature(getattr(kernel, "py_func", kernel)).parameters.values()
    needed = sum(each.default is each.empty for each in parameters)
    stages, left, missing = of_stages(fdi), list(given), max(needed - len(given), 1)
    arguments = []
    for each in parameters:
        if missing > 0 and each.name in stages:
            arguments.append(stages[each.name])
            missing -= 1
        elif left:
            arguments.append(left.pop(0))
    return kernel(*arguments)


def estimator(fdi, kind=LOSS, surface=0, low=-1.0, high=0.0):
    fdi["isolation"]["config"]["n_estimators"] = max(int(fdi["isolation"]["config"]["n_estimators"]), 1)
    fie = fdi["isolation"]["estimator"][0]
    fie["hypothesis_kind"], fie["surface"], fie["theta_min"], fie["theta_max"] = kind, surface, low, high
    fie["set_lo"], fie["set_hi"] = low, high
    return fie


def weights(decay, frames):
    """What is left, at the end, of each frame's share; oldest first."""
    return decay ** np.arange(frames)[::-1]
