"""The regressors of the next sample's rates, and least squares on them.

    rates[k] = c + A [rates[k-1..k-h], signals[k-1]] + sum over groups g of e_g sum_j b_gj u_g[k-j] + noise

Surfaces whose commands are proportional to one another move together while they are healthy: their effects
cannot be distinguished by any fit, so they form one group with one response. Of a fit: what a coloured
residual does to its covariance, and which regressors are collinear.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.samples import Samples, mixer_matrix
from beaver_ftc_logs.vehicle import Vehicle

_PARALLEL_TOLERANCE = 1e-9
_GRAM_EIGENVALUE_FLOOR = 1e-10
_RANK_TOLERANCE = 1e-12
_N_PARTS_FOR_BOUNDS, _MIN_PART_ROWS_FOR_BOUNDS, BOUND_MARGIN_STANDARD_ERRORS = 4, 60, 4.0
"""Parts of a flight, and their rows at least; standard errors."""


def group_surfaces_by_commands(vehicle: Vehicle) -> list[list[int]]:
    """Surfaces by what excites them: those in one group get proportional commands."""
    mixer_rows = mixer_matrix(vehicle)
    groups_of_surface_indices: list[list[int]] = []
    for i, mixer_row in enumerate(mixer_rows):
        for surface_indices in groups_of_surface_indices:
            first_mixer_row_of_group = mixer_rows[surface_indices[0]]
            if (mixer_row @ first_mixer_row_of_group) ** 2 >= (1.0 - _PARALLEL_TOLERANCE) * (
                mixer_row @ mixer_row
            ) * (first_mixer_row_of_group @ first_mixer_row_of_group):
                surface_indices.append(i)
                break
        else:
            groups_of_surface_indices.append([i])
    return groups_of_surface_indices


def build_regressors(
    samples: Samples,
    groups_of_surface_indices: list[list[int]],
    n_rate_lags: int,
    n_command_lags: int,
    scales_by_labels: bool,
    n_signal_lags: int = 1,
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The regressors of each sample: the past (n, 3 h + X f), the commands (n, G, L) of
    groups_of_surface_indices at lags 1 to L, and whether all of it is known and no gap lies within, (n,).

    scales_by_labels: multiply each surface's command by its labelled effectiveness (1 where there is no
    label). n_signal_lags: past samples f of the signals.
    """
    surface_commands = samples.commands
    if scales_by_labels:
        surface_commands = surface_commands * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    group_commands = np.column_stack(
        [surface_commands[:, surface_indices].sum(axis=1) for surface_indices in groups_of_surface_indices]
    )
    lagged_rates = [_delay_rows(samples.rates, k, np.nan) for k in range(1, n_rate_lags + 1)]
    past_regressors = np.column_stack(
        [*lagged_rates, *(_delay_rows(samples.signals, k, np.nan) for k in range(1, n_signal_lags + 1))]
    )
    lagged_group_commands = np.stack(
        [_delay_rows(group_commands, k, np.nan) for k in range(1, n_command_lags + 1)], axis=1
    )
    is_predictable = np.isfinite(past_regressors).all(axis=1) & np.isfinite(lagged_group_commands).all(
        axis=(1, 2)
    )
    is_predictable &= np.isfinite(samples.rates).all(axis=1)
    is_predictable &= samples.stretch_number == _delay_rows(
        samples.stretch_number, max(n_rate_lags, n_command_lags), -1
    )
    return past_regressors, lagged_group_commands.transpose(0, 2, 1), is_predictable


def _delay_rows(values: np.ndarray, lag: int, fill_value: float) -> np.ndarray:
    """The rows `lag` samples later, `fill_value` where there is no past."""
    lag = min(lag, len(values))
    return np.concatenate([np.full((lag, *values.shape[1:]), fill_value), values[: len(values) - lag]])


def surface_indices_of_each_group(model: Model) -> list[list[int]]:
    """The model's groups as positions of their surfaces."""
    vehicle_surface_names = list(model.vehicle.surfaces)
    return [[vehicle_surface_names.index(name) for name in group_surfaces] for group_surfaces in model.groups]


def expand_group_values_to_surfaces(group_values: Floats, model: Model) -> Floats:
    """Each surface's column (n, S) of those of the groups (n, G): its group's, 1 where it is in none."""
    group_index_of_surface = np.full(len(model.vehicle.surfaces), -1)
    for group_index, surface_indices in enumerate(surface_indices_of_each_group(model)):
        group_index_of_surface[surface_indices] = group_index
    return np.asarray(
        np.take(np.column_stack([group_values, np.ones(len(group_values))]), group_index_of_surface, axis=1)
    )


def unexplained_rates_and_responses(
    samples: Samples, model: Model, scales_by_labels: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """By a model: which samples it can predict, (n,), what the past leaves unexplained of the rates, (n, 3),
    and each group's healthy answer, (n, G, 3). scales_by_labels: as `build_regressors`.

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
    """
    lag_counts_and_label_scaling = (
        model.n_rate_lags,
        model.n_command_lags,
        scales_by_labels,
        model.vehicle.n_signal_lags(model.n_rate_lags),
    )
    past_regressors, lagged_group_commands, is_predictable = build_regressors(
        samples, surface_indices_of_each_group(model), *lag_counts_and_label_scaling
    )
    _, lagged_rate_and_signal_coefficients, response_coefficients, _ = model.intercept_past_response_noise()
    rates_unexplained_by_past = samples.rates - np.einsum(
        "nm,mr->nr", past_regressors, lagged_rate_and_signal_coefficients
    )
    return (
        is_predictable,
        rates_unexplained_by_past,
        np.einsum("ngl,glr->ngr", lagged_group_commands, response_coefficients),
    )


def whitened_rates_and_responses(
    samples: Samples, model: Model, scales_by_labels: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """As `unexplained_rates_and_responses`, less the prediction of each residual from those before it by the
    flight's noise model: a healthy flight leaves a white residual."""
    is_predictable, rates_unexplained_by_past, group_responses = unexplained_rates_and_responses(
        samples, model, scales_by_labels
    )
    ar_coefficients = model.residual_ar_coefficients(samples.noise_ma_coefficients)
    is_predictable_whitened = is_predictable.copy()
    for lag in range(1, len(ar_coefficients) + 1):
        is_predictable_whitened &= _delay_rows(is_predictable, lag, False)
    return (
        is_predictable_whitened,
        subtract_noise_prediction(rates_unexplained_by_past, ar_coefficients),
        subtract_noise_prediction(group_responses, ar_coefficients),
    )


def subtract_noise_prediction(values: Floats, ar_coefficients: Floats) -> Floats:
    """Values (n, ..., 3) less their prediction from the L before each; ar_coefficients (L, 3, 3)."""
    remainder = values.copy()
    if not len(ar_coefficients) or not values.size:
        return remainder
    source_series_by_axis, target_series_by_axis = (
        np.moveaxis(array.reshape(len(values), -1, 3), 0, -1) for array in (values, remainder)
    )
    for (source_axis, target_axis), taps in zip(
        np.ndindex(3, 3), ar_coefficients.reshape(-1, 9).T, strict=True
    ):
        for source_series, target_series in zip(
            np.ascontiguousarray(source_series_by_axis[:, source_axis]),
            target_series_by_axis[:, target_axis],
            strict=True,
        ):
            target_series[1:] -= np.convolve(source_series, taps)[: len(source_series) - 1]
    return remainder


@dataclass(frozen=True)
class RateRegression:
    """coefficients (m, 3); residual_covariance (3, 3); standard_errors (m, 3); standard_error_inflation: the
    factor by which the residuals' colour widens them over those of white ones, (m, 3);
    coefficient_error_correlation (m, m): of the coefficients' errors, alike on every axis."""

    coefficients: Floats
    residual_covariance: Floats
    standard_errors: Floats
    standard_error_inflation: Floats
    coefficient_error_correlation: Floats


def ordinary_least_squares(
    regressors: Floats, rates: Floats, stretch_number: NDArray[np.int64], newey_west_max_lag: int
) -> RateRegression:
    """Ordinary least squares of rates (n, 3) on regressors (n, m), with Newey-West standard errors over
    `newey_west_max_lag` lags.

    stretch_number (n,): products of residuals are formed within one gap-free stretch only. Directions that
    the regressors do not excite get the least coefficients that fit, and a column of nothing but rounding
    gets 0.
    """
    regressor_rms = np.sqrt((regressors**2).mean(axis=0))
    regressor_divisor_or_inf = np.where(
        regressor_rms > _RANK_TOLERANCE * regressor_rms.max(), regressor_rms, np.inf
    )
    scaled_regressors = regressors / regressor_divisor_or_inf
    scaled_gram_pseudoinverse: Floats = np.asarray(
        np.linalg.pinv(scaled_regressors.T @ scaled_regressors, rcond=_GRAM_EIGENVALUE_FLOOR),
        dtype=np.float64,
    )
    scaled_coefficients = scaled_gram_pseudoinverse @ (scaled_regressors.T @ rates)
    residuals = rates - scaled_regressors @ scaled_coefficients
    degrees_of_freedom = max(len(rates) - regressors.shape[1], 1)
    residual_covariance = residuals.T @ residuals / degrees_of_freedom
    scaled_standard_errors_if_white = np.sqrt(
        np.maximum(np.outer(np.diag(scaled_gram_pseudoinverse), np.diag(residual_covariance)), 0.0)
    )
    scaled_newey_west_standard_errors = np.column_stack(
        [
            _newey_west_standard_errors(
                scaled_regressors,
                residuals[:, axis],
                scaled_gram_pseudoinverse,
                stretch_number,
                newey_west_max_lag,
            )
            for axis in range(rates.shape[1])
        ]
    )
    standard_error_inflation = np.divide(
        scaled_newey_west_standard_errors,
        scaled_standard_errors_if_white,
        out=np.ones_like(scaled_newey_west_standard_errors),
        where=scaled_standard_errors_if_white > 0,
    )
    root_of_pseudoinverse_diagonal = np.sqrt(np.maximum(np.diag(scaled_gram_pseudoinverse), MIN_DIVISOR))
    return RateRegression(
        scaled_coefficients / regressor_divisor_or_inf[:, None], residual_covariance,
        scaled_newey_west_standard_errors / regressor_divisor_or_inf[:, None], standard_error_inflation,
        scaled_gram_pseudoinverse / np.outer(root_of_pseudoinverse_diagonal, root_of_pseudoinverse_diagonal),
    )  # fmt: skip


def _newey_west_standard_errors(
    scaled_regressors: Floats,
    residual: Floats,
    scaled_gram_pseudoinverse: Floats,
    stretch_number: NDArray[np.int64],
    max_lag: int,
) -> Floats:
    """Standard errors that hold for autocorrelated residuals: Bartlett weights over `max_lag` lags."""
    score_contributions, bartlett_width = scaled_regressors * residual[:, None], max_lag + 1
    stretch_edges = [0, *(np.flatnonzero(np.diff(stretch_number)) + 1).tolist(), len(stretch_number)]
    score_covariance = np.zeros((scaled_regressors.shape[1], scaled_regressors.shape[1]))
    for begin, end in pairwise(stretch_edges):  # Bartlett's weights are those of products of running sums
        cumulated_scores = np.cumsum(
            np.pad(score_contributions[begin:end], ((bartlett_width, bartlett_width - 1), (0, 0))), axis=0
        )
        window_sums = cumulated_scores[bartlett_width:] - cumulated_scores[:-bartlett_width]
        score_covariance += window_sums.T @ window_sums / bartlett_width
    return np.sqrt(
        np.maximum(np.diag(scaled_gram_pseudoinverse @ score_covariance @ scaled_gram_pseudoinverse), 0.0)
    )


def coefficient_upper_bounds_and_squared_residuals(
    regressors: Floats, output_series: Floats, effective_sample_share: float
) -> tuple[Floats, Floats]:
    """Least squares of output_series (n,) on regressors (n, m): what each coefficient surely does not exceed,
    (m,), which is much where columns make one another up; and squares of what is left (n,).
    effective_sample_share: as in `FilterSettings`."""
    regressor_rms = np.maximum(np.sqrt((regressors**2).mean(axis=0)), MIN_DIVISOR)
    scaled_regressors = regressors / regressor_rms
    scaled_inverse_gram = np.linalg.inv(
        scaled_regressors.T @ scaled_regressors
        + _GRAM_EIGENVALUE_FLOOR * len(scaled_regressors) * np.eye(scaled_regressors.shape[1])
    )
    scaled_coefficients = scaled_inverse_gram @ (scaled_regressors.T @ output_series)
    squared_residual_by_row = (output_series - scaled_regressors @ scaled_coefficients) ** 2
    scaled_standard_errors = np.sqrt(
        np.maximum(np.diag(scaled_inverse_gram), 0.0)
        * squared_residual_by_row.mean()
        / effective_sample_share
    )
    return (
        scaled_coefficients + BOUND_MARGIN_STANDARD_ERRORS * scaled_standard_errors
    ) / regressor_rms, squared_residual_by_row


def split_into_parts_for_bounds(rows: NDArray[np.int64]) -> list[NDArray[np.int64]] | None:
    """The rows of a flight in its parts; None where one is too short."""
    parts = np.array_split(rows, _N_PARTS_FOR_BOUNDS)
    return parts if min(map(len, parts)) >= _MIN_PART_ROWS_FOR_BOUNDS else None


def variance_inflation_factors(regressors: Floats) -> Floats:
    """How much each column's coefficient's variance is inflated by the others: 1 alone, inf dependent."""
    centred_regressors = regressors - regressors.mean(axis=0)
    column_norms = np.sqrt((centred_regressors**2).sum(axis=0))
    inflation_factors = np.full(regressors.shape[1], np.inf)
    is_varying = column_norms > 1e-12
    correlation = (centred_regressors[:, is_varying] / column_norms[is_varying]).T @ (
        centred_regressors[:, is_varying] / column_norms[is_varying]
    )
    eigenvalues, eigenvectors = np.linalg.eigh(correlation)
    is_nonzero_eigenvalue = eigenvalues > _RANK_TOLERANCE * eigenvalues.max(initial=0.0)
    squared_eigenvectors = eigenvectors**2
    finite_factors = (
        squared_eigenvectors[:, is_nonzero_eigenvalue] / eigenvalues[is_nonzero_eigenvalue]
    ).sum(axis=1)
    inflation_factors[is_varying] = np.where(
        squared_eigenvectors[:, ~is_nonzero_eigenvalue].sum(axis=1) > _RANK_TOLERANCE, np.inf, finite_factors
    )
    return inflation_factors


def power_spectral_density(
    residuals: Floats, dt_s: float, max_samples_per_segment: int = 256
) -> tuple[Floats, Floats]:
    """One-sided spectral density of each residual, (f,) Hz and (f, 3), by averaged periodograms."""
    from scipy import signal

    n_samples_per_segment = min(max_samples_per_segment, len(residuals))
    frequency_hz, power_density = signal.welch(
        residuals, fs=1.0 / dt_s, nperseg=n_samples_per_segment, axis=0, detrend="constant"
    )
    return frequency_hz, power_density
