"""An informed test of a loss in a log of our own: which losses could be detected at all?

A log is a `Log` of own_logs.py. The test knows the surface, the size, the instant, the design model of the
aircraft, and the noise: a vector autoregression of the accelerations that the model does not explain in the
training flights, for quiet and for noisy gyros. It detects a loss at one false alarm an hour: its log
likelihood ratio exceeds the logarithm of the number of samples in an hour [Lorden1971].
"""

from math import log as ln
from typing import Any

import numpy as np
import pandas as pd
from benchmarks.page_test import Whitener, fitted

from beaver_ftc.design.model import DesignFunctions, design_record
from beaver_ftc.design.table import N_Y


def unexplained(log: Any) -> tuple[np.ndarray, np.ndarray]:
    """The acceleration of each frame that the design model does not explain, (n, 3) rad/s2, and the effect of
    each healthy surface, (n, 3, S) rad/s2."""
    aircraft, table = log.flown.airframe, pd.read_parquet(log.folder / "log.parquet")
    model = DesignFunctions(design_record(aircraft))
    rates = table[[f"{axis}_measured_rad_s" for axis in "pqr"]].to_numpy()
    flow = table[["alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals]].to_numpy()
    flow = np.pad(flow, ((0, 0), (0, N_Y - flow.shape[1])))
    commands = table[[f"{surface}_cmd_rad" for surface in aircraft.surfaces]].to_numpy()
    does = np.array([model.G(y) for y in flow]) * commands[:, None, :]
    expected = np.array([model.f(x, y) for x, y in zip(rates, flow, strict=True)]) + does.sum(axis=2)
    return np.diff(rates, axis=0) * log.flown.rate_hz - expected[:-1], does[:-1]


def noisy(log: Any) -> bool:
    """Whether the gyros have noise."""
    return bool(log.flown.sensors.p.noise_std_deg_s > 0.0)


def noises(logs: list[Any]) -> dict[bool, Whitener]:
    """The noise model of healthy flights, for quiet (False) and for noisy gyros (True)."""
    left = {log.folder: unexplained(log)[0] for log in logs}
    kinds = {noisy(log) for log in logs}
    return {kind: fitted([left[one.folder] for one in logs if noisy(one) == kind]) for kind in kinds}


def told(log: Any, noise: dict[bool, Whitener]) -> bool:
    """Whether the informed test detects the loss before the flight ends."""
    if noisy(log) not in noise or not log.flown.faults:
        return False
    (fault,), (left, does) = log.flown.faults, unexplained(log)
    lost = -fault.magnitude * does[:, :, list(log.flown.airframe.surfaces).index(fault.actuator)]
    lost[: round(fault.at_s * log.flown.rate_hz)] = 0.0
    white = noise[noisy(log)]
    seen, expected = white.respond(left), white.respond(lost)
    ratio = np.cumsum((expected * (seen - 0.5 * expected)).sum(axis=1))
    return bool(ratio.max() > ln(3600.0 * log.flown.rate_hz))
