"""Rare events whose probability is known; and one of short flights, which comes once in 10^5: a pitch rate
beyond a limit, with a biased elevator at several airspeeds and altitudes.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.stats import chi2, norm

from beaver_ftc.studies.sweep.subset_simulation import Chains

ANALYTIC: dict[str, tuple[Callable[[np.ndarray], np.ndarray], int, float]] = {
    "a sum of two": (lambda u: u.sum(1) / math.sqrt(2) - norm.isf(1e-5), 2, 1e-5),
    "a sum of ten": (lambda u: u.sum(1) / math.sqrt(10) - norm.isf(1e-5), 10, 1e-5),
    "two sides": (lambda u: np.abs(u[:, 0]) - norm.isf(5e-5), 3, 1e-4),
    "a sphere": (lambda u: (u**2).sum(1) - chi2.isf(1e-5, 4), 4, 1e-5),
    "in steps": (lambda u: np.floor(8 * (u[:, 0] - norm.isf(1e-3))) / 8, 2, 1e-3),
}
EXPECTATION, LIMIT_DEG_S = "post_fault_rms_deg_s.q", 5.1
SWEEP: dict[str, Any] = {
    "name": "biased",
    "base": {
        "name": "biased", "duration_s": 0.2, "rate_hz": 50, "control": {"law": "nominal"},
        "fdi": {"scheme": "none"}, "expect": {"post_fault_rms_deg_s": {"q": LIMIT_DEG_S}},
        "faults": [{"actuator": "elevator", "type": "bias", "bias_deg": 0.1, "at_s": 0}],
    },
    "runs": 1,
    "vary": {
        "faults[0].bias_deg": {"normal": [0, 1]},
        "initial.airspeed_mps": {"uniform": [40, 50]},
        "initial.altitude_m": {"uniform": [500, 2500]},
    },
}  # fmt: skip


def repeated(problem: str, repeats: int) -> tuple[int, int, int]:
    """In how many repeats the interval holds the probability, the estimate is near; flights of all."""
    score, keys, probability = ANALYTIC[problem]
    held = near = flights = 0
    for seed in range(repeats):
        chains = Chains(keys, seed)
        chains.go(score)
        found = chains.estimate()
        held += found["low"] <= probability <= found["high"]
        near += 0.5 < found["probability"] / probability < 2
        flights += found["flights"]
    return held, near, flights
