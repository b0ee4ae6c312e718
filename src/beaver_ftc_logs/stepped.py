"""Step the diagnosis of the control loop through a recorded flight; from its verdicts, the effectiveness of
each surface.

A loss theta in [-1, 0] explains a frame if |nu_i - theta Z_i| <= eta_bar_i on every axis, as in
diagnosis/isolation.py. If one surface alone is at fault and its effectiveness is constant for a second, its
theta is in the intersection of the sets of that second's frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop import FLOW, Diagnosis
from beaver_ftc_logs.diagnose import UNKNOWN_SURFACE, DiagnosisRows
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.regression import (
    coefficient_upper_bounds_and_squared_residuals,
    split_into_parts_for_bounds,
)

LOSS_FAULT_TYPE = "loss_of_effectiveness"
EFFECTIVENESS_BOUND_WINDOW_S = 1.0
_LOSS_ROUNDING, _BOUND_ROUNDING_RAD_S2 = 1e-9, 1e-12
_EFFECTIVE_SAMPLE_SHARE = 0.4
_ERROR_DECLARING_SCENARIO_KEYS = ("fdi", "actuators", "design_model")  # between samples a log has no instants


@dataclass(frozen=True)
class ReplayedVerdicts:
    """The verdicts of a stretch, one for each sample.

    single_fault_effectiveness_low and single_fault_effectiveness_high (n, S): bounds on the effectiveness of
    each surface if it alone is at fault. relative_command_gains (S,): measured effect of each command over
    the expected one, in all of the stretch. relative_command_gain_upper_bounds (S,): its upper bound, the
    largest of all parts of the stretch. Both are 1 if the stretch is too short."""

    verdicts: list[Verdict]
    single_fault_effectiveness_low: Floats
    single_fault_effectiveness_high: Floats
    relative_command_gains: Floats
    relative_command_gain_upper_bounds: Floats


def declared_error_sections(scenario: Any) -> dict[str, Any]:
    """Return the errors that a scenario declares, as `Diagnosis` takes it."""
    scenario_values = scenario.model_dump(mode="json", exclude_unset=True)
    return {key: scenario_values[key] for key in _ERROR_DECLARING_SCENARIO_KEYS if key in scenario_values}


def log_column_names_of_each_input(aircraft: Any) -> tuple[list[str], ...]:
    """Return the columns of our log that the diagnosis reads at each sample: rates, signals, commands,
    attitude."""
    return (
        [f"{axis}_measured_rad_s" for axis in "pqr"],
        [*FLOW, *aircraft.signals],
        [f"{name}_cmd_rad" for name in aircraft.surfaces],
        ["phi_rad", "theta_rad", "psi_rad"],
    )


def replay_samples(
    diagnosis: Diagnosis, ordered_input_arrays: Sequence[Floats], rate_hz: float
) -> ReplayedVerdicts:
    """The verdicts of evenly spaced samples; ordered_input_arrays: as
    `log_column_names_of_each_input`, (n, ...) each."""
    verdicts: list[Verdict] = []
    innovation = np.empty_like(ordered_input_arrays[0])
    innovation_bound = np.empty_like(ordered_input_arrays[0])
    healthy_surface_effect = np.empty((*innovation.shape, ordered_input_arrays[2].shape[1]))
    for k, sample_inputs in enumerate(zip(*map(np.ascontiguousarray, ordered_input_arrays), strict=True)):
        verdicts.append(diagnosis.step(*sample_inputs))
        innovation[k], innovation_bound[k], healthy_surface_effect[k] = diagnosis.innovation()
    theta_bounds = _bounds_of_explaining_losses(
        innovation[:, :, None], innovation_bound[:, :, None], healthy_surface_effect
    )
    theta_bounds[0][0], theta_bounds[1][0] = -1.0, 0.0  # the first sample ends no frame
    window_samples = max(round(EFFECTIVENESS_BOUND_WINDOW_S * rate_hz), 1)
    effectiveness_low = 1.0 + _sliding_maximum(theta_bounds[0], window_samples)
    effectiveness_high = 1.0 - _sliding_maximum(-theta_bounds[1], window_samples)
    is_unexplained = effectiveness_low > effectiveness_high
    return ReplayedVerdicts(
        verdicts,
        np.where(is_unexplained, 0.0, effectiveness_low),
        np.where(is_unexplained, 1.0, effectiveness_high),
        *_relative_command_gains_and_upper_bounds(innovation, healthy_surface_effect),
    )


def _relative_command_gains_and_upper_bounds(
    innovation: Floats, healthy_surface_effect: Floats
) -> tuple[Floats, Floats]:
    """The gains and their upper bounds (S,) of `ReplayedVerdicts`, from the innovation of the rates (n, 3)
    and the expected effect of each surface (n, 3, S)."""
    n_surfaces = healthy_surface_effect.shape[2]
    finite_rows = np.flatnonzero(np.isfinite(innovation).all(axis=1) & (np.arange(len(innovation)) > 0))
    if (rows_by_part := split_into_parts_for_bounds(finite_rows)) is None:
        return np.ones(n_surfaces), np.ones(n_surfaces)
    innovation_sd = np.maximum(innovation[finite_rows].std(axis=0), MIN_DIVISOR)
    regressors = np.concatenate(
        [
            np.broadcast_to(np.eye(3), (len(healthy_surface_effect), 3, 3)),
            healthy_surface_effect / innovation_sd[:, None],
        ],
        axis=2,
    )
    scaled_innovation = innovation / innovation_sd
    coefficients, *_ = np.linalg.lstsq(
        regressors[finite_rows].reshape(3 * len(finite_rows), -1),
        scaled_innovation[finite_rows].ravel(),
        rcond=None,
    )
    gain_upper_bounds = np.full(n_surfaces, -np.inf)
    for part_rows in rows_by_part:
        part_coefficient_upper_bounds, _ = coefficient_upper_bounds_and_squared_residuals(
            regressors[part_rows].reshape(3 * len(part_rows), -1),
            scaled_innovation[part_rows].ravel(),
            _EFFECTIVE_SAMPLE_SHARE,
        )
        gain_upper_bounds = np.maximum(gain_upper_bounds, 1.0 + part_coefficient_upper_bounds[3:])
    return 1.0 + coefficients[3:], gain_upper_bounds


def _bounds_of_explaining_losses(
    innovation: Floats, innovation_bound: Floats, healthy_surface_effect: Floats
) -> tuple[Floats, Floats]:
    """Least and greatest theta (n, S) of a loss that explains each frame on every axis; least above greatest
    where none does."""
    innovation_bound = innovation_bound + _BOUND_ROUNDING_RAD_S2
    has_effect = np.abs(healthy_surface_effect) > MIN_DIVISOR
    nonzero_effect = np.where(has_effect, healthy_surface_effect, 1.0)
    interval_ends = np.sort(
        np.stack(
            [
                (innovation - innovation_bound) / nonzero_effect,
                (innovation + innovation_bound) / nonzero_effect,
            ]
        ),
        axis=0,
    )
    is_within_bound = np.abs(innovation) <= innovation_bound
    min_theta = np.where(has_effect, interval_ends[0], np.where(is_within_bound, -1.0, 1.0)).max(axis=1)
    max_theta = np.where(has_effect, interval_ends[1], np.where(is_within_bound, 0.0, -2.0)).min(axis=1)
    return np.maximum(min_theta - _LOSS_ROUNDING, -1.0), np.minimum(max_theta + _LOSS_ROUNDING, 0.0)


def _sliding_maximum(values: Floats, window_samples: int) -> Floats:
    """For each column the maximum over each sample and the `window_samples - 1` samples before it."""
    from scipy.ndimage import maximum_filter1d

    padded_values = np.concatenate([np.full((window_samples - 1, values.shape[1]), -np.inf), values])
    filtered_maximum = maximum_filter1d(
        padded_values, window_samples, axis=0, origin=(window_samples - 1) // 2
    )
    return np.asarray(filtered_maximum[window_samples - 1 :])


def diagnosis_rows_from_replay(
    t_s: Floats, replayed_verdicts: ReplayedVerdicts, surfaces: Sequence[str], fdi_config: Any
) -> DiagnosisRows:
    """The rows of a flight. fdi_config: of the scenario, which class of faults its verdicts are of."""
    faulty = np.array([verdict.detected for verdict in replayed_verdicts.verdicts])
    effectiveness = np.ones_like(replayed_verdicts.single_fault_effectiveness_low)
    effectiveness_low = np.zeros_like(replayed_verdicts.single_fault_effectiveness_low)
    effectiveness_high = np.ones_like(replayed_verdicts.single_fault_effectiveness_low)
    gives_single_fault_verdicts = fdi_config.is_ours and not fdi_config.pairs
    for k, verdict in enumerate(replayed_verdicts.verdicts):
        if gives_single_fault_verdicts:
            _fill_row_effectiveness_bounds(
                verdict,
                surfaces,
                (
                    replayed_verdicts.single_fault_effectiveness_low[k],
                    replayed_verdicts.single_fault_effectiveness_high[k],
                ),
                effectiveness_low[k],
                effectiveness_high[k],
            )
        if _is_loss_or_untyped(verdict) and verdict.estimate is not None and verdict.isolated in surfaces:
            surface_index = surfaces.index(verdict.isolated)
            effectiveness[k, surface_index] = min(
                max(1.0 + float(verdict.estimate), effectiveness_low[k, surface_index]),
                effectiveness_high[k, surface_index],
            )
    names = [_isolated_surface_unknown_or_empty(verdict, surfaces) for verdict in replayed_verdicts.verdicts]
    return DiagnosisRows(
        t_s=t_s,
        faulty=faulty.astype(np.int64),
        isolated_surfaces=np.array(names, dtype=object),
        effectiveness=effectiveness,
        effectiveness_low=effectiveness_low,
        effectiveness_high=effectiveness_high,
        fault_probability=faulty.astype(float),
    )


def _fill_row_effectiveness_bounds(
    verdict: Verdict,
    surfaces: Sequence[str],
    sample_single_fault_bounds: tuple[Floats, Floats],
    effectiveness_low: Floats,
    effectiveness_high: Floats,
) -> None:
    """Fill the bounds effectiveness_low and effectiveness_high (S,) of one row, which are given as 0 and 1.
    sample_single_fault_bounds: low and high (S,) of `ReplayedVerdicts`."""
    if not verdict.detected:
        effectiveness_low[:] = sample_single_fault_bounds[0]
    elif verdict.isolated in surfaces:
        effectiveness_low[:], surface_index = 1.0, surfaces.index(str(verdict.isolated))
        effectiveness_low[surface_index], effectiveness_high[surface_index] = (
            (sample_single_fault_bounds[0][surface_index], sample_single_fault_bounds[1][surface_index])
            if verdict.type == LOSS_FAULT_TYPE
            else (0.0, 1.0)
        )
    elif verdict.isolated is None and verdict.candidates and set(verdict.candidates) <= set(surfaces):
        effectiveness_low[:] = 1.0
        for name in verdict.candidates:
            effectiveness_low[surfaces.index(name)] = sample_single_fault_bounds[0][surfaces.index(name)]


def _is_loss_or_untyped(verdict: Verdict) -> bool:
    return verdict.type in (None, LOSS_FAULT_TYPE)


def _isolated_surface_unknown_or_empty(verdict: Verdict, surfaces: Sequence[str]) -> str:
    if not verdict.detected:
        return ""
    return str(verdict.isolated) if verdict.isolated in surfaces else UNKNOWN_SURFACE
