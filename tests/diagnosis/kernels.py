"""Records that kernels of the diagnosis are tried on, one at a time."""

import numpy as np

from beaver_ftc.diagnosis.scheme import diagnosis_dtype
from beaver_ftc.diagnosis.state import LOSS

DT, POLES = 0.02, np.array([1e6, 4.0, 0.5])


def new_fdi():
    fdi = np.zeros(1, diagnosis_dtype(4)).view(np.recarray)[0]
    fdi["config"]["dt"], fdi["bank"]["n"], fdi["bank"]["decay"][:3] = DT, 3, np.exp(-POLES * DT)
    fdi["isolation"]["forgetting"], fdi["isolation"]["decay"] = 0.98, np.exp(-np.array([3.0, 4.0, 5.0]) * DT)
    return fdi


WHERE = {
    **dict.fromkeys(("enabled", "authority", "every_type", "abrupt", "dt"), "config"),
    **dict.fromkeys(("thresholds", "forgetting", "memory", "shared", "membership"), "isolation"),
    **dict.fromkeys(("own_errors", "eta_bar", "noise"), "bound"),
}


def put(fdi, **values):
    """Fill fields of the stages' records, by their names alone."""
    for name, value in values.items():
        if name in fdi["types"]["config"].dtype.names:
            fdi["types"]["config"][name] = value
        else:
            fdi[WHERE[name]][name] = value


def estimator(fdi, kind=LOSS, surface=0, low=-1.0, high=0.0):
    fdi["isolation"]["n"] = max(int(fdi["isolation"]["n"]), 1)
    fie = fdi["isolation"]["estimator"][0]
    fie["kind"], fie["surface"], fie["low"], fie["high"] = kind, surface, low, high
    fie["theta_low"], fie["theta_high"] = low, high
    return fie


def weights(decay, frames):
    """What is left, at the end, of each frame's share; oldest first."""
    return decay ** np.arange(frames)[::-1]
