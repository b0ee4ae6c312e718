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
_RIDGE_SHARE = 1e-10
_RANK_TOLERANCE = 1e-12
_N_FLIGHT_PARTS, _MIN_PART_ROWS, BOUND_STANDARD_ERRORS = 4, 60, 4.0
"""Parts of a flight, and their rows at least; standard errors."""


def group_surfaces_by_commands(vehicle: Vehicle) -> list[list[int]]:
    """Surfaces by what excites them: those in one group get proportional commands."""
    rows = mixer_matrix(vehicle)
    groups: list[list[int]] = []
    for i, row in enumerate(rows):
        for group in groups:
            other = rows[group[0]]
            if (row @ other) ** 2 >= (1.0 - _PARALLEL_TOLERANCE) * (row @ row) * (other @ other):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def build_regressors(
    samples: Samples,
    groups: list[list[int]],
    n_rate_lags: int,
    n_command_lags: int,
    scales_by_labels: bool,
    n_signal_lags: int = 1,
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The regressors of each sample: the past (n, 3 h + X f), the commands (n, G, L) of the groups at lags 1
    to L, and whether all of it is known and no gap lies within, (n,).

    scales_by_labels: multiply each surface's command by its labelled effectiveness (1 where there is no
    label). n_signal_lags: past samples f of the signals.
    """
    surface_commands = samples.commands
    if scales_by_labels:
        surface_commands = surface_commands * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    grouped = np.column_stack([surface_commands[:, group].sum(axis=1) for group in groups])
    rates = [_delay_rows(samples.rates, k, np.nan) for k in range(1, n_rate_lags + 1)]
    past = np.column_stack(
        [*rates, *(_delay_rows(samples.signals, k, np.nan) for k in range(1, n_signal_lags + 1))]
    )
    commands = np.stack([_delay_rows(grouped, k, np.nan) for k in range(1, n_command_lags + 1)], axis=1)
    is_known = np.isfinite(past).all(axis=1) & np.isfinite(commands).all(axis=(1, 2))
    is_known &= np.isfinite(samples.rates).all(axis=1)
    is_known &= samples.stretch_number == _delay_rows(
        samples.stretch_number, max(n_rate_lags, n_command_lags), -1
    )
    return past, commands.transpose(0, 2, 1), is_known


def _delay_rows(values: np.ndarray, lag: int, fill_value: float) -> np.ndarray:
    """The rows `lag` samples later, `fill_value` where there is no past."""
    lag = min(lag, len(values))
    return np.concatenate([np.full((lag, *values.shape[1:]), fill_value), values[: len(values) - lag]])


def surface_indices_by_group(model: Model) -> list[list[int]]:
    """The model's groups as positions of their surfaces."""
    names = list(model.vehicle.surfaces)
    return [[names.index(name) for name in group] for group in model.groups]


def group_values_by_surface(values: Floats, model: Model) -> Floats:
    """Each surface's column (n, S) of those of the groups (n, G): its group's, 1 where it is in none."""
    group_of_surface = np.full(len(model.vehicle.surfaces), -1)
    for group, members in enumerate(surface_indices_by_group(model)):
        group_of_surface[members] = group
    return np.asarray(np.take(np.column_stack([values, np.ones(len(values))]), group_of_surface, axis=1))


def unexplained_rates_and_responses(
    samples: Samples, model: Model, scales_by_labels: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """By a model: which samples it can predict, (n,), what the past leaves unexplained of the rates, (n, 3),
    and each group's healthy answer, (n, G, 3). scales_by_labels: as `build_regressors`.

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
    """
    order = (
        model.n_rate_lags,
        model.n_command_lags,
        scales_by_labels,
        model.vehicle.n_signal_lags(model.n_rate_lags),
    )
    past, commands, is_predictable = build_regressors(samples, surface_indices_by_group(model), *order)
    _, past_coefficients, response, _ = model.coefficient_arrays()
    unexplained = samples.rates - np.einsum("nm,mr->nr", past, past_coefficients)
    return is_predictable, unexplained, np.einsum("ngl,glr->ngr", commands, response)


def whitened_rates_and_responses(
    samples: Samples, model: Model, scales_by_labels: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """As `unexplained_rates_and_responses`, less the prediction of each residual from those before it by the
    flight's noise model: a healthy flight leaves a white residual."""
    is_predictable, unexplained, responses = unexplained_rates_and_responses(samples, model, scales_by_labels)
    predictor, is_whitened = (
        model.residual_ar_coefficients(samples.noise_ma_coefficients),
        is_predictable.copy(),
    )
    for lag in range(1, len(predictor) + 1):
        is_whitened &= _delay_rows(is_predictable, lag, False)
    return (
        is_whitened,
        subtract_noise_prediction(unexplained, predictor),
        subtract_noise_prediction(responses, predictor),
    )


def subtract_noise_prediction(values: Floats, predictor: Floats) -> Floats:
    """Values (n, ..., 3) less their prediction from the L before each; predictor (L, 3, 3): coefficients."""
    remainder = values.copy()
    if not len(predictor) or not values.size:
        return remainder
    series, remaining_series = (
        np.moveaxis(of.reshape(len(values), -1, 3), 0, -1) for of in (values, remainder)
    )
    for (r, s), taps in zip(np.ndindex(3, 3), predictor.reshape(-1, 9).T, strict=True):
        for one, of in zip(np.ascontiguousarray(series[:, r]), remaining_series[:, s], strict=True):
            of[1:] -= np.convolve(one, taps)[: len(one) - 1]
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


def least_squares(
    regressors: Floats, rates: Floats, stretch_number: NDArray[np.int64], max_lag: int
) -> RateRegression:
    """Ordinary least squares of rates (n, 3) on regressors (n, m), with Newey-West standard errors over
    `max_lag` lags.

    stretch_number (n,): products of residuals are formed within one gap-free stretch only. Directions that
    the regressors do not excite get the least coefficients that fit, and a column of nothing but rounding
    gets 0.
    """
    regressor_rms = np.sqrt((regressors**2).mean(axis=0))
    scale = np.where(regressor_rms > _RANK_TOLERANCE * regressor_rms.max(), regressor_rms, np.inf)
    scaled_regressors = regressors / scale
    inverse: Floats = np.asarray(
        np.linalg.pinv(scaled_regressors.T @ scaled_regressors, rcond=_RIDGE_SHARE), dtype=np.float64
    )
    coefficients = inverse @ (scaled_regressors.T @ rates)
    residuals = rates - scaled_regressors @ coefficients
    degrees_of_freedom = max(len(rates) - regressors.shape[1], 1)
    residual_covariance = residuals.T @ residuals / degrees_of_freedom
    white_errors = np.sqrt(np.maximum(np.outer(np.diag(inverse), np.diag(residual_covariance)), 0.0))
    newey_west_errors = np.column_stack(
        [
            _newey_west_standard_errors(
                scaled_regressors, residuals[:, axis], inverse, stretch_number, max_lag
            )
            for axis in range(rates.shape[1])
        ]
    )
    error_inflation = np.divide(
        newey_west_errors, white_errors, out=np.ones_like(newey_west_errors), where=white_errors > 0
    )
    regressor_rms = np.sqrt(np.maximum(np.diag(inverse), MIN_DIVISOR))
    return RateRegression(
        coefficients / scale[:, None], residual_covariance,
        newey_west_errors / scale[:, None], error_inflation,
        inverse / np.outer(regressor_rms, regressor_rms),
    )  # fmt: skip


def _newey_west_standard_errors(
    scaled_regressors: Floats,
    residual: Floats,
    inverse: Floats,
    stretch_number: NDArray[np.int64],
    max_lag: int,
) -> Floats:
    """Standard errors that hold for autocorrelated residuals: Bartlett weights over `max_lag` lags."""
    scores, width = scaled_regressors * residual[:, None], max_lag + 1
    edges = [0, *(np.flatnonzero(np.diff(stretch_number)) + 1).tolist(), len(stretch_number)]
    score_covariance = np.zeros((scaled_regressors.shape[1], scaled_regressors.shape[1]))
    for begin, end in pairwise(edges):  # Bartlett's weights are those of products of running sums
        cumulated = np.cumsum(np.pad(scores[begin:end], ((width, width - 1), (0, 0))), axis=0)
        window_sums = cumulated[width:] - cumulated[:-width]
        score_covariance += window_sums.T @ window_sums / width
    return np.sqrt(np.maximum(np.diag(inverse @ score_covariance @ inverse), 0.0))


def coefficient_upper_bounds(
    regressors: Floats, outputs: Floats, effective_sample_share: float
) -> tuple[Floats, Floats]:
    """Least squares of outputs (n,) on regressors (n, m): what each coefficient surely does not exceed, (m,),
    which is much where columns make one another up; and squares of what is left (n,). effective_sample_share:
    as in `FilterSettings`."""
    regressor_rms = np.maximum(np.sqrt((regressors**2).mean(axis=0)), MIN_DIVISOR)
    scaled_regressors = regressors / regressor_rms
    inverse = np.linalg.inv(
        scaled_regressors.T @ scaled_regressors
        + _RIDGE_SHARE * len(scaled_regressors) * np.eye(scaled_regressors.shape[1])
    )
    coefficients = inverse @ (scaled_regressors.T @ outputs)
    squared_residual = (outputs - scaled_regressors @ coefficients) ** 2
    standard_error = np.sqrt(
        np.maximum(np.diag(inverse), 0.0) * squared_residual.mean() / effective_sample_share
    )
    return (coefficients + BOUND_STANDARD_ERRORS * standard_error) / regressor_rms, squared_residual


def split_into_flight_parts(rows: NDArray[np.int64]) -> list[NDArray[np.int64]] | None:
    """The rows of a flight in its parts; None where one is too short."""
    parts = np.array_split(rows, _N_FLIGHT_PARTS)
    return parts if min(map(len, parts)) >= _MIN_PART_ROWS else None


def variance_inflation_factors(regressors: Floats) -> Floats:
    """How much each column's coefficient's variance is inflated by the others: 1 alone, inf dependent."""
    centred = regressors - regressors.mean(axis=0)
    column_norm = np.sqrt((centred**2).sum(axis=0))
    factors = np.full(regressors.shape[1], np.inf)
    varies = column_norm > 1e-12
    correlation = (centred[:, varies] / column_norm[varies]).T @ (centred[:, varies] / column_norm[varies])
    values, vectors = np.linalg.eigh(correlation)
    is_independent, squared_vectors = values > _RANK_TOLERANCE * values.max(initial=0.0), vectors**2
    inflated = (squared_vectors[:, is_independent] / values[is_independent]).sum(axis=1)
    factors[varies] = np.where(
        squared_vectors[:, ~is_independent].sum(axis=1) > _RANK_TOLERANCE, np.inf, inflated
    )
    return factors


def power_spectral_density(
    residuals: Floats, dt_s: float, segment_samples: int = 256
) -> tuple[Floats, Floats]:
    """One-sided spectral density of each residual, (f,) Hz and (f, 3), by averaged periodograms."""
    from scipy import signal

    n_per_segment = min(segment_samples, len(residuals))
    frequency_hz, density = signal.welch(
        residuals, fs=1.0 / dt_s, nperseg=n_per_segment, axis=0, detrend="constant"
    )
    return frequency_hz, density
