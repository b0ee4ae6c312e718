"""A recorded flight through the diagnosis of the loop, sample by sample: its verdicts, and what they say of
each surface.

theta in [-1, 0] of a loss explains a frame if |nu_i - theta Z_i| <= eta_bar_i on every axis: as in
diagnosis/isolation.py. Where one surface alone is at fault, and its effectiveness stands for a
second, it is in the intersection of that second's sets.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop import FLOW, Diagnosis
from beaver_ftc_logs.diagnose import UNKNOWN, Rows
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.regression import coefficient_bounds, quarters

LOSS = "loss_of_effectiveness"
STANDS_S = 1.0
_ROUNDING, _ROUNDING_RAD_S2 = 1e-9, 1e-12
_POWER = 0.4
_KEPT = ("fdi", "actuators", "design_model")  # between samples a log has no instants


@dataclass(frozen=True)
class Stepped:
    """verdicts, one a sample; low, high (n, S): effectiveness of each surface if it alone is at fault; gains
    (S,): of what each command does at most as much as this in all of it, 1 where it is too short."""

    verdicts: list[Verdict]
    low: Floats
    high: Floats
    gains: Floats


def declared_of(scenario: Any) -> dict[str, Any]:
    """What a scenario tells the diagnosis, as `Diagnosis` takes it."""
    keys = scenario.model_dump(mode="json", exclude_unset=True)
    return {key: keys[key] for key in _KEPT if key in keys}


def inputs_of(aircraft: Any) -> tuple[list[str], ...]:
    """What the diagnosis is given at each sample, by the columns of our log: rates, signals, commands,
    attitude."""
    return (
        [f"{axis}_measured_rad_s" for axis in "pqr"],
        [*FLOW, *aircraft.signals],
        [f"{name}_cmd_rad" for name in aircraft.surfaces],
        ["phi_rad", "theta_rad", "psi_rad"],
    )


def step_through(diagnosis: Diagnosis, inputs: Sequence[Floats], rate_hz: float) -> Stepped:
    """The verdicts of evenly spaced samples; inputs: as `inputs_of`, (n, ...) each."""
    verdicts: list[Verdict] = []
    innovation, bound = np.empty_like(inputs[0]), np.empty_like(inputs[0])
    expected = np.empty((*innovation.shape, inputs[2].shape[1]))
    for k, sample in enumerate(zip(*map(np.ascontiguousarray, inputs), strict=True)):
        verdicts.append(diagnosis.step(*sample))
        innovation[k], bound[k], expected[k] = diagnosis.innovation()
    theta = _explaining(innovation[:, :, None], bound[:, :, None], expected)
    theta[0][0], theta[1][0] = -1.0, 0.0  # the first sample ends no frame
    reach = max(round(STANDS_S * rate_hz), 1)
    low, high = 1.0 + _latest(theta[0], reach), 1.0 - _latest(-theta[1], reach)
    nothing = low > high
    gains = _gains(innovation, expected)
    return Stepped(verdicts, np.where(nothing, 0.0, low), np.where(nothing, 1.0, high), gains)


def _gains(innovation: Floats, expected: Floats) -> Floats:
    """As in `Stepped`, of the rates' innovation (n, 3) and what each surface was to do, (n, 3, S)."""
    known = np.flatnonzero(np.isfinite(innovation).all(axis=1) & (np.arange(len(innovation)) > 0))
    if (parts := quarters(known)) is None:
        return np.ones(expected.shape[2])
    white = np.maximum(innovation[known].std(axis=0), TINY)
    x = np.concatenate([np.broadcast_to(np.eye(3), (len(expected), 3, 3)), expected / white[:, None]], axis=2)
    y, found = innovation / white, np.full(expected.shape[2], -np.inf)
    for part in parts:
        theta, _ = coefficient_bounds(x[part].reshape(3 * len(part), -1), y[part].ravel(), _POWER)
        found = np.maximum(found, 1.0 + theta[3:])
    return found


def _explaining(innovation: Floats, bound: Floats, expected: Floats) -> tuple[Floats, Floats]:
    """Least and greatest theta (n, S) of a loss that explains each frame on every axis; least above greatest
    where none does."""
    bound = bound + _ROUNDING_RAD_S2
    moved = np.abs(expected) > TINY
    slope = np.where(moved, expected, 1.0)
    ends = np.sort(np.stack([(innovation - bound) / slope, (innovation + bound) / slope]), axis=0)
    within = np.abs(innovation) <= bound
    least = np.where(moved, ends[0], np.where(within, -1.0, 1.0)).max(axis=1)
    greatest = np.where(moved, ends[1], np.where(within, 0.0, -2.0)).min(axis=1)
    return np.maximum(least - _ROUNDING, -1.0), np.minimum(greatest + _ROUNDING, 0.0)


def _latest(values: Floats, reach: int) -> Floats:
    """The greatest of each sample's own and the `reach - 1` values before it, by column."""
    from scipy.ndimage import maximum_filter1d

    padded = np.concatenate([np.full((reach - 1, values.shape[1]), -np.inf), values])
    found = maximum_filter1d(padded, reach, axis=0, origin=(reach - 1) // 2)
    return np.asarray(found[reach - 1 :])


def rows_of(t_s: Floats, stepped: Stepped, surfaces: Sequence[str], fdi: Any) -> Rows:
    """The rows of a flight. fdi: of the scenario, which class of faults its verdicts are of."""
    faulty = np.array([verdict.detected for verdict in stepped.verdicts])
    estimate, low, high = np.ones_like(stepped.low), np.zeros_like(stepped.low), np.ones_like(stepped.low)
    sharp = fdi.is_ours and not fdi.pairs
    for k, verdict in enumerate(stepped.verdicts):
        if sharp:
            _bound(verdict, surfaces, (stepped.low[k], stepped.high[k]), low[k], high[k])
        if _lost(verdict) and verdict.estimate is not None and verdict.isolated in surfaces:
            s = surfaces.index(verdict.isolated)
            estimate[k, s] = min(max(1.0 + float(verdict.estimate), low[k, s]), high[k, s])
    names = [_name(verdict, surfaces) for verdict in stepped.verdicts]
    return Rows(
        t_s=t_s,
        faulty=faulty.astype(np.int64),
        named=np.array(names, dtype=object),
        estimate=estimate,
        low=low,
        high=high,
        probability=faulty.astype(float),
    )


def _bound(
    verdict: Verdict, surfaces: Sequence[str], alone: tuple[Floats, Floats], low: Floats, high: Floats
) -> None:
    """Fill the bounds (S,) of one row, which are 0 and 1 where nothing is said. alone: as in Stepped."""
    if not verdict.detected:
        low[:] = alone[0]
    elif verdict.isolated in surfaces:
        low[:], s = 1.0, surfaces.index(str(verdict.isolated))
        low[s], high[s] = (alone[0][s], alone[1][s]) if verdict.type == LOSS else (0.0, 1.0)
    elif verdict.isolated is None and verdict.candidates and set(verdict.candidates) <= set(surfaces):
        low[:] = 1.0
        for name in verdict.candidates:
            low[surfaces.index(name)] = alone[0][surfaces.index(name)]


def _lost(verdict: Verdict) -> bool:
    return verdict.type in (None, LOSS)


def _name(verdict: Verdict, surfaces: Sequence[str]) -> str:
    if not verdict.detected:
        return ""
    return str(verdict.isolated) if verdict.isolated in surfaces else UNKNOWN
