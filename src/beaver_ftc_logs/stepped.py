"""Step the diagnosis of the control loop through a recorded flight; from its verdicts, the effectiveness of
each surface.

A loss theta in [-1, 0] explains a frame if |nu_i - theta Z_i| <= eta_i on every axis i, as in
diagnosis/isolation.py. If one surface alone is at fault and its effectiveness is constant for a second, its
theta is in the intersection of the sets of that second's frames.

nu (n, 3) rad/s2: innovation of the rates. eta (n, 3) rad/s2: its bound. Z (n, 3, S) rad/s2: expected effect
of each healthy surface. e (n, S): effectiveness, 1 + theta, with bounds low and high. S surfaces, n samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop import FLOW, Diagnosis
from beaver_ftc.results import Document
from beaver_ftc_logs.energy import UNKNOWN_SURFACE
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import Innovations, split_parts

if TYPE_CHECKING:
    from beaver_ftc.aircraft import Aircraft
    from beaver_ftc.scenario import Scenario

LOSS_FAULT_TYPE = "loss_of_effectiveness"
BOUND_WINDOW_S = 1.0  # the effectiveness is assumed constant for this time
_LOSS_TOLERANCE = 1e-9  # tolerance of theta: rounding must not empty an intersection of sets that touch
_TOLERANCE_RAD_S2 = 1e-12  # tolerance of |nu - theta Z|: rounding must not exclude a theta on its bound
# Number of white samples with the information of one sample, in the bounds of the command gains.
_EFFECTIVE_SAMPLE_SHARE = 0.4
_ERROR_KEYS = ("fdi", "actuators", "design_model")  # not `substeps`: a frame of a log has one instant


@dataclass(frozen=True)
class Replayed:
    """The verdicts of a stretch, one for each sample.

    alone_low and alone_high (n, S): bounds on the effectiveness of each surface if it alone is at fault.
    command_gains (S,): measured effect of each command over the expected one, in all of the stretch.
    command_gain_bounds (S,): its upper bound, the largest of all parts of the stretch. Both are 1 if the
    stretch is too short."""

    verdicts: list[Verdict]
    alone_low: Floats
    alone_high: Floats
    command_gains: Floats
    command_gain_bounds: Floats


def error_sections(scenario: "Scenario") -> Document:
    """The sections of a scenario that declare errors, as arguments of `Diagnosis`."""
    values = scenario.model_dump(mode="json", exclude_unset=True)
    return {key: values[key] for key in _ERROR_KEYS if key in values}


def input_columns(aircraft: "Aircraft") -> tuple[list[str], ...]:
    """The columns of our log that the diagnosis reads at each sample: rates, signals, commands, attitude."""
    return (
        [f"{axis}_measured_rad_s" for axis in "pqr"],
        [*FLOW, *aircraft.signals],
        [f"{name}_cmd_rad" for name in aircraft.surfaces],
        ["phi_rad", "theta_rad", "psi_rad"],
    )


def replay_samples(diagnosis: Diagnosis, arrays: Sequence[Floats], rate_hz: float) -> Replayed:
    """The verdicts of evenly spaced samples, and the bounds that follow from their innovations. arrays: the
    columns of `input_columns`, (n, ...) each."""
    verdicts: list[Verdict] = []
    nu = np.empty(arrays[0].shape)
    eta = np.empty_like(nu)
    Z = np.empty((*nu.shape, arrays[2].shape[1]))
    for k, inputs in enumerate(zip(*map(np.ascontiguousarray, arrays), strict=True)):
        verdicts.append(diagnosis.step(*inputs))
        nu[k], eta[k], Z[k] = diagnosis.innovation()
    lo, hi = _explaining_losses(nu[:, :, None], eta[:, :, None], Z)
    # The first sample has no innovation: every loss explains it.
    lo[0] = -1.0
    hi[0] = 0.0
    n = max(round(BOUND_WINDOW_S * rate_hz), 1)
    low = 1.0 + _sliding_maximum(lo, n)
    high = 1.0 - _sliding_maximum(-hi, n)
    # If no constant loss explains a window, its bounds are 0 and 1.
    empty = low > high
    return Replayed(verdicts, np.where(empty, 0.0, low), np.where(empty, 1.0, high), *_command_gains(nu, Z))


def _command_gains(nu: Floats, Z: Floats) -> tuple[Floats, Floats]:
    """The gains and their upper bounds (S,) of `Replayed`: 1 + beta of nu = constant + Z beta, each axis in
    standard deviations of nu.

    `Innovations` does this regression; here it has rad/s2 instead of rad/s. Its noise model only weights the
    axes, so it is built without checks (`model_construct`) and has no other field.
    """
    rows = np.flatnonzero(np.isfinite(nu).all(axis=1) & (np.arange(len(nu)) > 0))
    if (parts := split_parts(rows)) is None:
        return np.ones(Z.shape[2]), np.ones(Z.shape[2])
    sd = np.maximum(nu[rows].std(axis=0), MIN_DIVISOR)
    noise = NoiseModel.model_construct(average=[1.0], noise=np.diag(sd**2).tolist())
    k = np.arange(len(nu))
    known = np.ones(len(nu), dtype=bool)
    frames = Innovations(k, known, nu, Z.transpose(0, 2, 1), np.zeros(3), noise)
    upper = [frames.at(part).gain_bounds(_EFFECTIVE_SAMPLE_SHARE)[1] for part in parts]
    return 1.0 + frames.at(rows).gains(), 1.0 + np.max(upper, axis=0)


def _explaining_losses(nu: Floats, eta: Floats, Z: Floats) -> tuple[Floats, Floats]:
    """Least and greatest theta (n, S), within -1 and 0, of a loss with |nu - theta Z| <= eta on every axis of
    the frame; the least is above the greatest if no theta fulfils it. On an axis without effect, Z = 0, every
    theta fulfils it or none.
    """
    eta = eta + _TOLERANCE_RAD_S2
    acts = np.abs(Z) > MIN_DIVISOR
    Z1 = np.where(acts, Z, 1.0)
    ends = np.sort(np.stack([(nu - eta) / Z1, (nu + eta) / Z1]), axis=0)
    within = np.abs(nu) <= eta
    lo = np.where(acts, ends[0], np.where(within, -1.0, 1.0)).max(axis=1)
    hi = np.where(acts, ends[1], np.where(within, 0.0, -2.0)).min(axis=1)
    return np.maximum(lo - _LOSS_TOLERANCE, -1.0), np.minimum(hi + _LOSS_TOLERANCE, 0.0)


def _sliding_maximum(x: Floats, n: int) -> Floats:
    """For each column of x (k, S) the maximum over each row and the `n - 1` rows before it."""
    from scipy.ndimage import maximum_filter1d

    return maximum_filter1d(x, n, axis=0, mode="constant", cval=-np.inf, origin=(n - 1) // 2)


def named_since(t_s: Floats, verdicts: Sequence[Verdict]) -> float | None:
    """Time, s, since which each verdict has had the name of the last one; None if the last one has none."""
    name: str | None = None
    since_s: float | None = None
    for at_s, verdict in zip(t_s, verdicts, strict=True):
        if verdict.isolated != name:
            name = verdict.isolated
            since_s = float(at_s)
    return since_s if name else None


def _bounds(
    verdict: Verdict, alone_low: Floats, alone_high: Floats, surfaces: Sequence[str]
) -> tuple[Floats, Floats]:
    """Bounds low, high (S,) on the effectiveness at a sample, if at most one surface is at fault. alone_low
    and alone_high (S,): as in `Replayed`.

        verdict                                surface            low          high
        no alarm                               any                alone_low    1
        an alarm, candidates are surfaces      candidate          alone_low    1
        isolated, type is a loss               isolated           alone_low    alone_high
        isolated, another type or none         isolated           0            1
        one of the last three                  other              1            1
        no candidate, or one is no surface     any                0            1

    A fault of another type, or of none, may be no loss.
    """
    healthy = np.ones(len(surfaces))
    if not verdict.detected:
        return alone_low, healthy
    suspects = verdict.candidates if verdict.isolated is None else (verdict.isolated,)
    if not suspects or not set(suspects) <= set(surfaces):
        return np.zeros(len(surfaces)), healthy
    suspected = np.array([name in suspects for name in surfaces])
    low = np.where(suspected, alone_low, 1.0)
    if verdict.isolated is None:
        return low, healthy
    if verdict.type == LOSS_FAULT_TYPE:
        return low, np.where(suspected, alone_high, 1.0)
    return np.where(suspected, 0.0, 1.0), healthy


def rows_of_replay(t_s: Floats, replay: Replayed, surfaces: Sequence[str], fdi: Any) -> LogRows:
    """The rows of a flight. fdi: this section of the scenario. With the scheme of a rival, or verdicts on
    pairs of surfaces, the bounds are 0 and 1, since `_bounds` assumes that one surface is faulty.

    The estimate of a fault without a type is taken as theta of a loss, within its bounds, which stay 0 and 1.
    """
    low = np.zeros_like(replay.alone_low)
    high = np.ones_like(low)
    e = np.ones_like(low)
    names = np.full(len(low), "", dtype=object)
    for k, verdict in enumerate(replay.verdicts):
        if verdict.detected:
            names[k] = verdict.isolated if verdict.isolated in surfaces else UNKNOWN_SURFACE
        if fdi.is_ours and not fdi.pairs:
            low[k], high[k] = _bounds(verdict, replay.alone_low[k], replay.alone_high[k], surfaces)
        is_loss = verdict.type in (None, LOSS_FAULT_TYPE)
        if is_loss and verdict.estimate is not None and verdict.isolated in surfaces:
            s = surfaces.index(verdict.isolated)
            e[k, s] = min(max(1.0 + float(verdict.estimate), low[k, s]), high[k, s])
    return LogRows.of_names(t_s, names, e, low, high)
