"""Who may diagnose a recorded flight: our bank of filters, plain estimators, and the loop's detectors.

Plain estimators get the same model; the freeze rule needs none.

sliding-least-squares   the last 20 s, every sample alike
forgetting-least-squares  all the past, forgotten exponentially with 20 s [Ljung1999]
freeze                  a servo output that has not moved for 6 s: sees the logged output itself stand still

A detector of the loop is told the rates, what the design model makes of the frame before, and how much of
that each surface did (diagnosis/__init__.py). All three follow from the identified model:

    acceleration = (c + A past + sum_g F_g - rates before) / dt,      contribution_g = F_g / dt

so the innovation a detector forms is the model's one-step residual. Its declared error is the residual's
standard deviation. Detectors of the loop know the surfaces aileron, elevator and rudder: the vehicle's groups
take these places in their order.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from beaver_ftc.design import N_Y, Context, Declared
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, is_compiled, made, registered
from beaver_ftc_logs.bank import build_hypothesis_bank
from beaver_ftc_logs.diagnose import (
    UNKNOWN_SURFACE,
    DiagnosisRows,
    check_log_fits_model,
    diagnose,
    finalize_rows_at_log_stamps,
    join_flagged_names_by_row,
    standardized_healthy_residual,
)
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats, RecordedFlight
from beaver_ftc_logs.regression import (
    expand_group_values_to_surfaces,
    surface_indices_of_each_group,
    unexplained_rates_and_responses,
)
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.trust import with_rates_unknown_where_frozen_or_clipped

LEAST_SQUARES_MEMORY_S = 20.0
MIN_FROZEN_OUTPUT_S = 6.0
_MIN_LOSS_STANDARD_ERRORS = 5.0
_STANDARD_ERRORS_OF_90_PERCENT = 1.645
LOOP_SURFACE_BY_GROUP_INDEX = ("aileron", "elevator", "rudder")
_N_LOOP_SURFACES_WITH_FLAP = 4
_DECLARED_GYRO_NOISE_RAD_S = 1e-4
BANK_OF_FILTERS_DETECTOR = "bank-of-filters"


def _diagnose_by_least_squares(samples: Samples, model: Model, forgets_exponentially: bool) -> DiagnosisRows:
    """Effectiveness of the groups and the trim, from y = c + sum e_g F_g, whitened."""
    regressors, residual = _whitened_effectiveness_change_regression(samples, model)
    information_matrix = _fading_or_sliding_sums(
        np.einsum("nai,naj->nij", regressors, regressors), samples.dt_s, forgets_exponentially
    )
    information_vector = _fading_or_sliding_sums(
        np.einsum("nai,na->ni", regressors, residual), samples.dt_s, forgets_exponentially
    )
    prior_information = np.diag(
        [*np.full(3, 1.0 / model.settings.trim_sd**2), *np.full(regressors.shape[2] - 3, 4.0)]
    )
    estimate_covariance = np.linalg.inv(information_matrix + prior_information)
    trim_and_effectiveness_change = np.einsum("nij,nj->ni", estimate_covariance, information_vector)
    effectiveness_standard_error = np.sqrt(
        np.maximum(np.diagonal(estimate_covariance, axis1=1, axis2=2)[:, 3:], 0.0)
    )
    return _diagnosis_rows_from_least_squares(
        samples, model, 1.0 + trim_and_effectiveness_change[:, 3:], effectiveness_standard_error
    )


def _whitened_effectiveness_change_regression(samples: Samples, model: Model) -> tuple[Floats, Floats]:
    """Regressors (n, 3, 3 + G) of trim and lost effectiveness, and what a healthy vehicle leaves, (n, 3)."""
    is_predictable, rates_unexplained_by_past, group_responses = unexplained_rates_and_responses(
        samples, model
    )
    residual_covariance = model.intercept_past_response_noise()[3]
    whitening_matrix = np.linalg.inv(np.linalg.cholesky(residual_covariance))
    trim_regressors = np.broadcast_to(
        np.diag(np.sqrt(np.diag(residual_covariance))), (len(is_predictable), 3, 3)
    )
    unwhitened_regressors = np.where(
        is_predictable[:, None, None],
        np.concatenate([trim_regressors, group_responses.transpose(0, 2, 1)], axis=2),
        0.0,
    )
    return np.einsum("ab,nbi->nai", whitening_matrix, unwhitened_regressors), standardized_healthy_residual(
        model, is_predictable, rates_unexplained_by_past, group_responses
    )


def _fading_or_sliding_sums(values: Floats, dt_s: float, forgets_exponentially: bool) -> Floats:
    """Sums over the memory that ends at each sample."""
    if forgets_exponentially:
        from scipy.signal import lfilter

        return np.asarray(lfilter([1.0], [1.0, -np.exp(-dt_s / LEAST_SQUARES_MEMORY_S)], values, axis=0))
    sums = np.cumsum(values, axis=0)
    window_samples = round(LEAST_SQUARES_MEMORY_S / dt_s)
    sums[window_samples:] = sums[window_samples:] - sums[:-window_samples].copy()
    return sums


def _diagnosis_rows_from_least_squares(
    samples: Samples, model: Model, effectiveness: Floats, effectiveness_standard_error: Floats
) -> DiagnosisRows:
    """Rows of a least-squares estimate. With labelled levels, the effectiveness is the nearest of them, and
    below 1 it is a fault; without, it is a fault where it is below 1 by more than _MIN_LOSS_STANDARD_ERRORS
    standard deviations."""
    bank = build_hypothesis_bank(model)
    low_from_standard_error, high_from_standard_error = (
        np.clip(
            effectiveness + sign * _STANDARD_ERRORS_OF_90_PERCENT * effectiveness_standard_error, 0.0, 1.0
        )
        for sign in (-1.0, 1.0)
    )
    estimated_effectiveness = np.clip(effectiveness, 0.0, 1.0)
    has_loss = effectiveness + _MIN_LOSS_STANDARD_ERRORS * effectiveness_standard_error < 1.0
    if model.settings.likely_effectiveness_levels_by_group:
        for group_index, group in enumerate(model.groups):
            labelled_levels = model.settings.likely_effectiveness_levels_by_group.get("+".join(group))
            levels = (
                np.array([*labelled_levels, 1.0])
                if labelled_levels
                else np.unique(bank.effectiveness[:, group_index])
            )
            estimated_effectiveness[:, group_index] = levels[
                np.abs(estimated_effectiveness[:, group_index, None] - levels).argmin(axis=1)
            ]
        has_loss = estimated_effectiveness < 1.0
    group_bounds_by_end = {
        "low": np.minimum(low_from_standard_error, estimated_effectiveness),
        "high": np.maximum(high_from_standard_error, estimated_effectiveness),
    }
    surface_bounds_by_end = {
        bound_end: expand_group_values_to_surfaces(bound, model)
        for bound_end, bound in group_bounds_by_end.items()
    }
    isolated_names = join_flagged_names_by_row(has_loss, ["+".join(group) for group in model.groups])
    return _rows_with_default_bounds(
        samples,
        isolated_names,
        expand_group_values_to_surfaces(estimated_effectiveness, model),
        **surface_bounds_by_end,
    )


def _rows_with_default_bounds(
    samples: Samples,
    isolated_names: np.ndarray,
    effectiveness: Floats,
    **given_bounds_and_probability: Floats,
) -> DiagnosisRows:
    """Rows of a detector: faulty where it names a surface. Of low, high and probability those that are not
    in given_bounds_and_probability: the bounds are the estimate, the probability is 0 or 1."""
    faulty = np.array([bool(name) for name in isolated_names], dtype=np.int64)
    bounds_and_probability = {
        "low": effectiveness,
        "high": effectiveness,
        "probability": faulty.astype(float),
        **given_bounds_and_probability,
    }
    low = bounds_and_probability["low"]
    high = bounds_and_probability["high"]
    probability = bounds_and_probability["probability"]
    return DiagnosisRows(samples.t_s, faulty, isolated_names, effectiveness, low, high, probability)


def diagnose_by_freeze_rule(
    recording: RecordedFlight, samples: Samples, model: Model
) -> DiagnosisRows | None:
    """The freeze rule on the logged servo outputs; None where the vehicle file names none."""
    surface_names = list(model.vehicle.surfaces)
    output_quantity_column_by_surface = model.vehicle.outputs
    servo_output_column_name_by_surface = {
        name: quantity_column.column
        for name, quantity_column in output_quantity_column_by_surface.items()
        if quantity_column.column in recording.columns
    }
    if not servo_output_column_name_by_surface:
        return None
    is_frozen = np.zeros((len(samples.t_s), len(surface_names)), dtype=bool)
    for name in servo_output_column_name_by_surface:
        column = recording.columns[servo_output_column_name_by_surface[name]]
        last_output_rows = np.searchsorted(column.t_s, samples.t_s, side="right") - 1
        differs_from_previous_row = np.concatenate([[True], np.diff(column.values) != 0.0])
        unchanged_since_s = column.t_s[
            np.maximum.accumulate(
                np.where(differs_from_previous_row, np.arange(len(differs_from_previous_row)), 0)
            )
        ]
        is_frozen[:, surface_names.index(name)] = (
            samples.t_s - unchanged_since_s[np.maximum(last_output_rows, 0)] > MIN_FROZEN_OUTPUT_S
        ) & (last_output_rows >= 0)
    return _rows_with_default_bounds(
        samples, join_flagged_names_by_row(is_frozen, surface_names), 1.0 - is_frozen
    )


class LinearRateModel:
    """The identified model as a detector's design model: only how the rates answer themselves, x (..., 3)."""

    def __init__(self, lagged_rate_and_signal_coefficients: Floats, dt_s: float) -> None:
        self._transposed_jacobian = (lagged_rate_and_signal_coefficients[:3] - np.eye(3)) / dt_s

    def f(self, x: Floats, y: Floats) -> Floats:
        """Angular acceleration rad/s2 by the rates alone."""
        return np.asarray(x @ self._transposed_jacobian)

    def G(self, y: Floats) -> Floats:
        """Zeros: the effects of the surfaces, with their lags, are in `contribution`."""
        return np.zeros((3, _N_LOOP_SURFACES_WITH_FLAP))


def loop_detector_inputs(samples: Samples, model: Model) -> list[tuple[Measured, Floats]]:
    """Return the inputs of a detector at each row: measurements, and the command (4,) as shares of travel.

    Where the model cannot predict (a gap, a lost sample) the innovation is 0.
    """
    surface_indices_of_groups = surface_indices_of_each_group(model)
    if len(surface_indices_of_groups) > len(LOOP_SURFACE_BY_GROUP_INDEX):
        raise BadInput(
            f"{model.vehicle.name}: {len(surface_indices_of_groups)} groups of surfaces, allowed for a "
            f"detector of the loop: at most {len(LOOP_SURFACE_BY_GROUP_INDEX)}"
        )
    is_predictable, rates_unexplained_by_past, group_responses = unexplained_rates_and_responses(
        samples, model
    )
    intercept, dt_s = model.intercept_past_response_noise()[0], 1.0 / model.rate_hz
    rates = np.nan_to_num(samples.rates)
    previous_rates = np.vstack([rates[:1], rates[:-1]])
    predicted_rates = rates - np.where(
        is_predictable[:, None], rates_unexplained_by_past - intercept - group_responses.sum(axis=1), 0.0
    )
    expected_acceleration = (predicted_rates - previous_rates) / dt_s
    acceleration_contributions = np.zeros((len(rates), 3, _N_LOOP_SURFACES_WITH_FLAP))
    command = np.zeros((len(rates), _N_LOOP_SURFACES_WITH_FLAP))
    group_responses_or_zero = np.where(is_predictable[:, None, None], group_responses, 0.0)
    for group_index, surface_indices in enumerate(surface_indices_of_groups):
        acceleration_contributions[:, :, group_index] = group_responses_or_zero[:, group_index] / dt_s
        command[:, group_index] = np.nan_to_num(samples.commands[:, surface_indices].sum(axis=1))
    frames = zip(
        samples.t_s.tolist(), rates, expected_acceleration, acceleration_contributions, command, strict=True
    )
    model_error_sd_rad_s2 = _model_error_sd_rad_s2(model)
    return [
        (
            Measured(
                t_s,
                frame_rates,
                np.zeros(N_Y),
                expected_rad_s2,
                frame_acceleration_contributions,
                model_error_sd_rad_s2.copy(),
            ),
            frame_command,
        )
        for t_s, frame_rates, expected_rad_s2, frame_acceleration_contributions, frame_command in frames
    ]


def _model_error_sd_rad_s2(model: Model) -> Floats:
    """The residual's standard deviation as an error of the model, (3,) rad/s2."""
    return np.asarray(np.sqrt(np.diag(model.intercept_past_response_noise()[3])) / (1.0 / model.rate_hz))


def loop_detector_context(model: Model) -> Context:
    """Return the context that a detector is given before the flight."""
    dt_s = 1.0 / model.rate_hz
    declared_noise_sd = np.zeros(7)
    declared_noise_sd[:3] = _DECLARED_GYRO_NOISE_RAD_S
    design_model: Any = LinearRateModel(model.intercept_past_response_noise()[1], dt_s)
    return Context(
        dt_s=dt_s, substeps=1, model=design_model, trim_x=np.zeros(3), trim_y=np.zeros(N_Y),
        trim_rad=np.zeros(_N_LOOP_SURFACES_WITH_FLAP),
        travel_rad=np.outer((-1.0, 1.0), np.ones(_N_LOOP_SURFACES_WITH_FLAP)),
        constant_rad_s2=np.zeros(3), inertia_coupling=np.zeros(3),
        surfaces=(*LOOP_SURFACE_BY_GROUP_INDEX, "flap"),
        declared=Declared(noise=declared_noise_sd, model_rad_s2=_model_error_sd_rad_s2(model)),
    )  # fmt: skip


def run_loop_detector(detector: Detector, samples: Samples, model: Model) -> DiagnosisRows:
    """Step a detector of the loop through a flight. An alarm lasts while its statistic exceeds 1."""
    detector_inputs = loop_detector_inputs(samples, model)
    detector.reset(loop_detector_context(model))
    return diagnosis_rows_from_verdicts([detector.step(*frame) for frame in detector_inputs], samples, model)


def diagnosis_rows_from_verdicts(verdicts: list[Verdict], samples: Samples, model: Model) -> DiagnosisRows:
    """Verdicts as rows. The bounds are 0 to 1 for each surface that the detector may suspect, else 1."""
    n_samples, surface_indices_of_groups = len(verdicts), surface_indices_of_each_group(model)
    faulty = np.array([_is_statistic_high_or_detected(verdict) for verdict in verdicts], dtype=np.int64)
    effectiveness, effectiveness_low = np.ones((2, n_samples, len(model.vehicle.surfaces)))
    isolated_names = np.full(n_samples, "", dtype=object)
    for k in np.flatnonzero(faulty):
        if verdicts[k].isolated not in LOOP_SURFACE_BY_GROUP_INDEX[: len(surface_indices_of_groups)]:
            isolated_names[k], effectiveness_low[k] = UNKNOWN_SURFACE, 0.0
            continue
        group_index = LOOP_SURFACE_BY_GROUP_INDEX.index(str(verdicts[k].isolated))
        isolated_names[k], effectiveness_low[k, surface_indices_of_groups[group_index]] = (
            "+".join(model.groups[group_index]),
            0.0,
        )
        effectiveness[k, surface_indices_of_groups[group_index]] = _remaining_effectiveness(
            verdicts[k], group_index
        )
    probability = np.array([min(max(verdict.statistic, 0.0), 1.0) for verdict in verdicts])
    probability = np.where(np.isfinite(probability), probability, faulty)
    return _rows_with_default_bounds(
        samples,
        isolated_names,
        effectiveness,
        low=effectiveness_low,
        high=np.ones_like(effectiveness_low),
        probability=probability,
    )


def _is_statistic_high_or_detected(verdict: Verdict) -> bool:
    """By the statistic of this sample where there is one; the loop's own latch serves one fault a flight."""
    return verdict.statistic > 1.0 if np.isfinite(verdict.statistic) else verdict.detected


def _remaining_effectiveness(verdict: Verdict, group_index: int) -> float:
    if verdict.effectiveness is not None:
        return float(np.clip(verdict.effectiveness[group_index], 0.0, 1.0))
    return float(np.clip(1.0 + verdict.estimate, 0.0, 1.0)) if verdict.estimate is not None else 1.0


_FLIGHT_DETECTORS: dict[str, Callable[[Samples, Model], DiagnosisRows]] = {
    BANK_OF_FILTERS_DETECTOR: diagnose,
    "sliding-least-squares": partial(_diagnose_by_least_squares, forgets_exponentially=False),
    "forgetting-least-squares": partial(_diagnose_by_least_squares, forgets_exponentially=True),
}


def detector_names() -> list[str]:
    """Every detector a recorded flight can be given to, ours first."""
    return [*_FLIGHT_DETECTORS, *(name for name in registered(DETECTORS) if not is_compiled(DETECTORS, name))]


def check_detector_name(name: str) -> None:
    """Raise BadInput for a detector that recorded flights do not know."""
    known_names = detector_names()
    if name not in known_names:
        raise BadInput(f"--detector {name}: is not known{suggestion(name, known_names)}")


def diagnose_with_detector(detector_name: str, samples: Samples, model: Model) -> DiagnosisRows:
    """The rows of one detector. Raises BadInput for an unknown name, or a log at another rate."""
    check_detector_name(detector_name)
    check_log_fits_model(samples, model)
    if detector_name == BANK_OF_FILTERS_DETECTOR:
        return diagnose(samples, model)
    samples_with_bad_rates_unknown = with_rates_unknown_where_frozen_or_clipped(samples, model)
    if detector_name in _FLIGHT_DETECTORS:
        return finalize_rows_at_log_stamps(
            samples, model, _FLIGHT_DETECTORS[detector_name](samples_with_bad_rates_unknown, model)
        )
    detector: Detector = made(DETECTORS, detector_name)
    return finalize_rows_at_log_stamps(
        samples, model, run_loop_detector(detector, samples_with_bad_rates_unknown, model)
    )
