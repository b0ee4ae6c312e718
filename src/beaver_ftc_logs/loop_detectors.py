"""Detectors of the control loop on recorded flights.

A detector of the loop receives the measured rates x, the predicted acceleration, and the contribution Z of
each surface to it. Both follow from the identified model, with the residual e of one step, rad/s, and the
responses F of the groups, rad/s:

    acceleration[k] = (x[k] - e[k] - x[k-1]) / dt,      Z_g = F_g / dt

The innovation that the detector forms is then e / dt. Its declared error is the standard deviation of e / dt.
The groups of the vehicle take the places of aileron, elevator and rudder, in this order.
"""

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from beaver_ftc.design import N_Y, Context, DeclaredErrors
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.documents import BadInput
from beaver_ftc_logs.energy import UNKNOWN_SURFACE
from beaver_ftc_logs.groups import group_commands, group_indices
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import innovations
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.stepped import LOSS_FAULT_TYPE

LOOP_SURFACES = ("aileron", "elevator", "rudder")
_N_LOOP = 4  # number of surfaces of the loop: these and the flap
_DECLARED_GYRO_RAD_S = 1e-4  # small, because the declared error of the model contains the noise of the gyros


class LinearRateModel:
    """The identified model as the design model of a detector: only the effect of the last rates x (...,
    3)."""

    def __init__(self, past: Floats, dt_s: float) -> None:
        self._transposed_jacobian = (past[:3] - np.eye(3)) / dt_s

    def f(self, x: Floats, y: Floats) -> Floats:
        """Angular acceleration by the rates, (..., 3) rad/s2."""
        return x @ self._transposed_jacobian

    def G(self, y: Floats) -> Floats:
        """Zeros: the effects of the surfaces, with their lags, are in `contribution`."""
        return np.zeros((3, _N_LOOP))


def loop_detector_inputs(samples: Samples, model: Model) -> list[tuple[Measured, Floats]]:
    """The inputs of a detector at each row: measurements, and the command u (4,) as shares of travel. The
    groups of the vehicle are the first columns of Z and u; the other columns are 0. Raises BadInput for more
    groups than LOOP_SURFACES.

    Z (n, 3, 4), rad/s2: the contribution of each surface. If the model cannot predict a row, as after a gap,
    the innovation and Z are 0.
    """
    members = group_indices(model)
    if len(members) > len(LOOP_SURFACES):
        raise BadInput(
            f"{model.vehicle.name}: {len(members)} groups of surfaces, allowed for a "
            f"detector of the loop: at most {len(LOOP_SURFACES)}"
        )
    flight = innovations(samples, model)
    dt_s = 1.0 / model.rate_hz
    rates = np.nan_to_num(samples.rates)
    before = np.vstack([rates[:1], rates[:-1]])
    expected = (rates - flight.e - before) / dt_s
    F = np.where(flight.is_known[:, None, None], flight.F, 0.0)
    commands = np.nan_to_num(group_commands(samples, members, labelled=False))
    others = (0, _N_LOOP - len(members))
    Z = np.pad(F.transpose(0, 2, 1) / dt_s, ((0, 0), (0, 0), others))
    u = np.pad(commands, ((0, 0), others))
    sd = _model_error_sd_rad_s2(model)
    t_s = samples.t_s.tolist()
    frames = [
        Measured(t_s[k], rates[k], np.zeros(N_Y), expected[k], Z[k], sd.copy()) for k in range(len(t_s))
    ]
    return list(zip(frames, u, strict=True))


def _model_error_sd_rad_s2(model: Model) -> Floats:
    """Standard deviation of the residual over a time step, an error of the model, (3,) rad/s2."""
    return np.sqrt(np.diag(np.array(model.noise))) / (1.0 / model.rate_hz)


def loop_detector_context(model: Model) -> Context:
    """The context that a detector receives before the flight."""
    dt_s = 1.0 / model.rate_hz
    noise = np.zeros(7)
    noise[:3] = _DECLARED_GYRO_RAD_S
    design: Any = LinearRateModel(np.array(model.past), dt_s)
    return Context(
        dt_s=dt_s, substeps=1, model=design, trim_x=np.zeros(3), trim_y=np.zeros(N_Y),
        trim_rad=np.zeros(_N_LOOP),
        travel_rad=np.outer((-1.0, 1.0), np.ones(_N_LOOP)),
        constant_rad_s2=np.zeros(3), inertia_coupling=np.zeros(3),
        surfaces=(*LOOP_SURFACES, "flap"),
        declared=DeclaredErrors(noise=noise, model_rad_s2=_model_error_sd_rad_s2(model)),
    )  # fmt: skip


def run_loop_detector(detector: Detector, samples: Samples, model: Model) -> LogRows:
    """Step a detector of the loop through a flight, and return its rows (`rows_of_verdicts`)."""
    inputs = loop_detector_inputs(samples, model)
    detector.reset(loop_detector_context(model))
    return rows_of_verdicts([detector.step(*deepcopy(frame)) for frame in inputs], samples, model)


def rows_of_verdicts(verdicts: list[Verdict], samples: Samples, model: Model) -> LogRows:
    """Verdicts as rows. An alarm lasts while the statistic exceeds 1 or, without a statistic, while the
    verdict is `detected`. The bounds are 0 and 1 for each surface that is then suspected, otherwise both 1. A
    name that is no group of the vehicle becomes `unknown`, and every surface is suspected.

    a, low (n, S): effectiveness and its lower bound; members: the surfaces of each group.
    """
    n = len(verdicts)
    members = group_indices(model)
    statistic, detected = np.array(
        [(verdict.statistic, verdict.detected) for verdict in verdicts], dtype=float
    ).T
    # If there is a statistic, it decides: `detected` of a detector of the loop stays true after its first
    # alarm.
    faulty = np.where(np.isnan(statistic), detected, statistic > 1.0).astype(np.int64)
    a, low = np.ones((2, n, len(model.vehicle.surfaces)))
    names = np.full(n, "", dtype=object)
    for k in np.flatnonzero(faulty):
        if verdicts[k].isolated not in LOOP_SURFACES[: len(members)]:
            names[k] = UNKNOWN_SURFACE
            low[k] = 0.0
            continue
        g = LOOP_SURFACES.index(str(verdicts[k].isolated))
        names[k] = model.group_names[g]
        low[k, members[g]] = 0.0
        a[k, members[g]] = _remaining_effectiveness(verdicts[k], g)
    p = np.where(np.isnan(statistic), faulty, np.clip(statistic, 0.0, 1.0))
    return replace(LogRows.of_names(samples.t_s, names, a, low, np.ones_like(low)), fault_probability=p)


def _remaining_effectiveness(verdict: Verdict, g: int) -> float:
    """Effectiveness of group g by a verdict, 0 to 1: that of the verdict, otherwise 1 + theta if its estimate
    is theta, that of a loss, otherwise 1.
    """
    value = 1.0
    if verdict.effectiveness is not None:
        value = verdict.effectiveness[g]
    elif verdict.type in (None, LOSS_FAULT_TYPE):
        value += verdict.estimate or 0.0
    return float(np.clip(value, 0.0, 1.0))
