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


def holder(record, name):
    """Where a stage's record has this field: the record itself, its config, memory or output."""
    sections = [record[part] for part in ("config", "memory", "output") if part in record.dtype.names]
    return next(part for part in (record, *sections) if name in (part.dtype.names or ()))


def fill(record, **values):
    """Fill fields of a stage's record, wherever it has them. Returns the record."""
    for name, value in values.items():
        holder(record, name)[name] = value
    return record


# Short names of fields, for cases that say a few of them.
SHORT = {
    "whole": "single_instant", "length": "frames_per_block", "thresholds": "mu_kind",
    "memory": "reach", "shared": "shared", "membership": "narrows",
    "forgetting": "forget", "instants": "n_substeps",
}  # fmt: skip
WHERE = {
    **dict.fromkeys(("enabled", "authority", "diagnoses_all_types", "abrupt", "dt"), "config"),
    **dict.fromkeys(("thresholds", "forgetting", "memory", "shared", "membership"), "isolation"),
    **dict.fromkeys(("eta_bar", "noise"), "bound"),
}


def put(fdi, **values):
    """Fill fields of the stages' records, by their names alone."""
    for name, value in values.items():
        field = SHORT.get(name, name)
        if field in fdi["types"]["config"].dtype.names:
            fdi["types"]["config"][field] = value
        if name in WHERE:
            fill(fdi[WHERE[name]], **{field: value})


# Fields of a surface's records by one name each, for cases that say a few of them.
_ACTUATOR = {
    **{name: name for name in ("stop_lo", "stop_hi", "reach_lo", "reach_hi")},
    "runaway": "runaway",
    "approach": "approach_share", "step": "step",
    "slowest_step": "slow_step",
}  # fmt: skip
_OBSERVED = {
    "command": "u", "low": "lo", "high": "hi",
    **{name: name for name in ("anomalous", "kappa",
    "hides")},
}  # fmt: skip
_EVIDENCE = (
    "n_rest",
    "n_unhidden",
    "k_first",
    "first_lo",
    "first_hi",
)
OF_SURFACE = {
    **{name: ("actuator", field) for name, field in _ACTUATOR.items()},
    **{name: ("last", field) for name, field in _OBSERVED.items()},
    **{f"{name}_then": ("judged", field) for name, field in _OBSERVED.items()},
    **{
        f"{name}_before": ("earlier", _OBSERVED[name]) for name in ("low", "high", "anomalous")
    },
    "evidence": ("evidence", "n_anomalous"),
    **{name: ("evidence", name) for name in _EVIDENCE},
    "n_silent": ("accommodation", "n_silent"),
    "in_question": ("status", "may_be_sole"), "standing": ("status", "basis"),
    "named": ("status", "is_isolated"), "named_at_s": ("status", "isolated_at_s"),
    "type": ("status", "fault_type"), "type_at_s": ("status", "typed_at_s"),
}  # fmt: skip


def put_on(surface, **values):
    """Fill fields of a surface's records, by their names in OF_SURFACE."""
    for name, value in values.items():
        part, field = OF_SURFACE[name]
        surface[part][field] = value


def of(surface, *names):
    """Fields of a surface's records, by the same names."""
    return tuple(surface[part][field] for part, field in map(OF_SURFACE.__getitem__, names))


def of_stages(fdi, kernel):
    """What the arguments of kernels are called, of the stages of one diagnosis."""
    types, whole = fdi["types"], kernel.__module__.startswith("beaver_ftc.diagnosis.types")
    later = "range" in kernel.__name__
    first = types["frame_index"]
    values = {
        ("c", "cfg", "config"): types["config"] if whole else fdi["config"],
        ("types",): types,
        ("surfs",): types["surface"],
        ("pair",): types["pair"],
        ("conclusion", "done", "found", "past"): fdi["verdict"],
        ("layout",): fdi["layout"],
        ("iso", "isolation"): fdi["isolation"],
        ("est", "fies", "estimators"): fdi["isolation"]["estimator"],
        ("bound",): fdi["bound"],
        ("shared",): fdi["isolation"]["config"]["shared"],
        ("abrupt",): fdi["config"]["abrupt"],
        ("all_types",): fdi["config"]["diagnoses_all_types"],
        ("n_substeps",): fdi["config"]["n_substeps"],
        ("bank",): fdi["bank"],
        ("fdae",): fdi["fdae"],
        ("nu", "innovation"): fdi["bank"]["output"]["innovation"],
        ("detected",): fdi["verdict"]["detected"],
        ("nu_max",): fdi["bound"]["nu_max"],
        ("noise", "n", "n_gyro"): fdi["bound"]["n_gyro"],
        ("dt",): fdi["config"]["dt"],
        ("alarm",): fdi["statistical"]["alarm"],
        ("k",) if whole else (): first if later else first - 1,
    }
    return {name: value for names, value in values.items() for name in names}


def on(kernel, fdi, *given):
    """Call a kernel on the records of its stages and on what is given, in the order of its arguments."""
    parameters = signature(getattr(kernel, "py_func", kernel)).parameters.values()
    needed = sum(each.default is each.empty for each in parameters)
    stages, left, missing = of_stages(fdi, kernel), list(given), max(needed - len(given), 1)
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
