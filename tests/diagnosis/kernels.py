"""Records that kernels of the diagnosis are tried on, one at a time."""

from inspect import signature

import numpy as np

from beaver_ftc.diagnosis.schemes import diagnosis_dtype
from beaver_ftc.diagnosis.state import LOSS

DT, POLES = 0.02, np.array([1e6, 4.0, 0.5])


def new_fdi():
    fdi = np.zeros(1, diagnosis_dtype(4)).view(np.recarray)[0]
    fdi["config"]["dt"], fdi["bank"]["config"]["n"], fdi["bank"]["config"]["decay"][:3] = (
        DT,
        3,
        np.exp(-POLES * DT),
    )
    fdi["types"]["config"]["dt"] = DT
    fdi["isolation"]["config"]["forgetting"], fdi["isolation"]["config"]["decay"] = (
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


WHERE = {
    **dict.fromkeys(("enabled", "authority", "every_type", "abrupt", "dt"), "config"),
    **dict.fromkeys(("thresholds", "forgetting", "memory", "shared", "membership"), "isolation"),
    **dict.fromkeys(("eta_bar", "noise"), "bound"),
}


def put(fdi, **values):
    """Fill fields of the stages' records, by their names alone."""
    for name, value in values.items():
        if name in fdi["types"]["config"].dtype.names:
            fdi["types"]["config"][name] = value
        if name in WHERE:
            fill(fdi[WHERE[name]], **{name: value})


# Fields of a surface's records by one name each, for cases that say a few of them.
_ACTUATOR = (
    "travel_low", "travel_high", "reach_low", "reach_high", "least_runaway_rate", "approach", "step",
    "slowest_step",
)  # fmt: skip
_OBSERVED = ("command", "low", "high", "anomalous", "effectiveness_variation", "stop_hides")
_EVIDENCE = ("rest_frames", "unhidden_frames", "started_at", "start_low", "start_high")
OF_SURFACE = {
    **{name: ("actuator", name) for name in _ACTUATOR},
    **{name: ("elapsed", name) for name in _OBSERVED},
    **{f"{name}_then": ("judged", name) for name in _OBSERVED},
    **{f"{name}_before": ("earlier", name) for name in ("low", "high", "anomalous")},
    "evidence": ("evidence", "frames"),
    **{name: ("evidence", name) for name in _EVIDENCE},
    "frames_absent": ("accommodation", "frames_absent"),
    "in_question": ("status", "is_candidate"), "standing": ("status", "decided_by"),
    **{name: ("status", name) for name in ("named", "named_at_s", "type", "type_at_s")},
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
    later = "deflection" in kernel.__name__
    return {
        "config": types["config"] if whole else fdi["config"], "types": types, "surfaces": types["surface"],
        "pair": types["pair"], "conclusion": fdi["verdict"], "layout": fdi["layout"],
        "isolation": fdi["isolation"], "estimators": fdi["isolation"]["estimator"], "bound": fdi["bound"],
        "shared": fdi["isolation"]["config"]["shared"], "abrupt": fdi["config"]["abrupt"],
        "every_type": fdi["config"]["every_type"],
        "instants": fdi["config"]["instants"], "bank": fdi["bank"], "fdae": fdi["fdae"],
        "innovation": fdi["bank"]["output"]["innovation"], "detected": fdi["verdict"]["detected"],
        "frame_bound": fdi["bound"]["frame"], "noise": fdi["bound"]["noise"], "dt": fdi["config"]["dt"],
        "statistical_alarm": fdi["statistical"]["alarm"],
        **({"k": types["frame"] if later else types["frame"] - 1} if whole else {}),
    }  # fmt: skip


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
    fdi["isolation"]["config"]["n"] = max(int(fdi["isolation"]["config"]["n"]), 1)
    fie = fdi["isolation"]["estimator"][0]
    fie["kind"], fie["surface"], fie["low"], fie["high"] = kind, surface, low, high
    fie["theta_low"], fie["theta_high"] = low, high
    return fie


def weights(decay, frames):
    """What is left, at the end, of each frame's share; oldest first."""
    return decay ** np.arange(frames)[::-1]
