"""Fit: from recorded flights to a model, with how well it is known and how it does elsewhere.

The fit uses the rows that are known to be healthy. Where labels state the remaining effectiveness, it uses
the faulty rows too, with the commands multiplied by the effectiveness. The Bayesian information criterion
chooses the number of past samples. Every figure of merit comes from held-out data, which the fit did not use:
the two halves of a single flight in turn, or each of several flights in turn.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, regression, trust
from beaver_ftc_logs.bank import build_hypothesis_bank, build_trim_and_gain_state_model
from beaver_ftc_logs.diagnose import DiagnosisRows, diagnosis_rows_from_posterior
from beaver_ftc_logs.filtering import (
    any_fault_log_odds_gains,
    hypothesis_state_and_noise_posterior,
    page_cusum,
    quick_response_power,
    quick_response_variance_scale,
    recent_noise_variance_scale,
)
from beaver_ftc_logs.model import FilterSettings, FittedRanges, Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.samples import Samples, constant_stretches
from beaver_ftc_logs.scoring import score_against_labels
from beaver_ftc_logs.vehicle import Vehicle

UNFITTED_LABEL_CHANGE_MARGIN_S = 1.5
"""Labels are good to about a second: what lies nearer to a change is not fitted."""
MIN_LABEL_DURATION_S = 3.0
"""A label that holds for less is the edge of another."""
RATE_LAG_COUNT_CANDIDATES = (1, 2, 3, 4)
COMMAND_LAG_COUNT_CANDIDATES = (2, 3, 4, 6)
_NEWEY_WEST_MAX_LAG_S = 2.0
_MIN_RATE_SD_RAD_S = 1e-6
_UNFITTED_MARGIN_BEFORE_FAILURE_S = 1.0
_MAX_EFFECTIVE_SAMPLE_SHARE_UNLABELLED = 0.9
"""Where no labels say how often things break, an alarm asks for more: for how much, the benchmark decided.
With parts enough that are not fitted, the rate of false alarms decides instead."""
_DEFAULT_FALSE_ALARMS_PER_HOUR = 1.0
_TRIM_DRIFT_AVERAGING_SPANS_S = (2.0, 8.0)
"""Spans whose means tell the drift of the trim from the residual's colour."""
_EFFECTIVE_SAMPLE_SHARE_LABELLED = 0.8
"""A coloured residual tells less than a white one: by how much, blocked tests decided."""
_FILTER_SETTINGS_FOR_OTHER_DAYS: dict[str, Any] = {
    "trim_sd": 0.1,
    "trim_shift": 0.03,
    "trim_walk": [2.5e-3, 6e-4, 2e-3],
    "gain_sd": 0.1,
    "gain_time_s": 300.0,
    "own_gain_sd": 0.03,
}
"""How far another day may be: chosen on days drawn from one flight, judged on others (`--other-days`). The
drift of the trim is what the means of the residual over 30 s show in that flight."""
_FILTER_SETTINGS_FOR_OTHER_LAWS: dict[str, Any] = {
    "own_gain_sd": 0.05,
    "own_gain_time_s": 20.0,
    "name_evidence": 2.0,
    "rename_s": 1.0,
    "one_group": True,
    "bounds": 0.97,
}
"""How far each group's gain wanders under a law and air that the fit has not seen (a law that answers what is
not modelled ties the command to it), and what a name asks for then. Chosen on simulated flights
(`own_logs.py`, seeds 1 to 6).

bounds: the posterior mass of 90 % bounds where no labels choose it. For a second or two after a loss most of
the mass still claims health: 0.9 of it held the truth at the fault in 0.70 to 0.94 of the samples, fewest of
large losses; 0.97 in 0.83 to 0.99, on seeds 401 to 403, which chose it."""
_FILTER_SETTINGS_FOR_MOVING_AIR: dict[str, Any] = {"own_gain_sd": 0.08, "own_gain_time_s": 100.0}
_GAIN_ERROR_WINDOW_S, AUTOREGRESSIVE_ORDER = 10.0, 20
"""Whitened by the flight's own noise model and an AR predictor of so many samples; gains differ by flight
rather than within it: chosen on seeds 11 and 12, in light turbulence; what a name asks for on a pa28's
seed 11."""
_MAX_EFFECTIVE_SAMPLE_SHARE_OTHER_LAWS, _LORDEN_BOUND_FACTOR_OTHER_LAWS = 0.4, 2.0
"""A law may feed a gyro's noise to the surfaces, which doubles the residual of one that does not: a sample
then tells less than the fit knows. And so many times the evidence of theory raises an alarm. Chosen in the
same way, the first on seed 1 of five aircraft."""
_GYRO_NOISE_VARIANCE_FACTOR_OTHER_LAWS, _GUST_NOISE_VARIANCE_FACTOR_OTHER_LAWS = 1.7, 2.5
"""In moving air the noise of another law's flight is so many times wider, gyros' or gusts', for gains too.
Chosen on seeds 71, 73 and 101 to 106: 3 of 240 healthy flights alarmed, and with no such factor 6 of 150."""
_MAX_WINDOW_COVARIANCE_INFLATION = 200.0
"""Largest noise factor of a window of ten seconds: of few flights one can be far from all others (1,550 of
seed 205, else 5)."""
_COMMAND_DELAY_OFFSET_CANDIDATES_SAMPLES = (-0.4, 0.0, 0.4)
"""Delays beside the model's that a flight may have, in samples."""
_USUAL_QUICK_RESPONSE_SHARE = 0.9
"""Share of the samples of the fit whose responses count as usual."""
_MIN_QUICK_SAMPLES = 10
"""Samples with quick responses that a flight must have, for the mean of their errors."""
_RANK_TOLERANCE = 1e-9
_N_HELD_OUT_TESTED_FOR_COLUMN_MISTAKES = 4
"""Number of held-out flights that are also read with each mistake in their columns. The largest gain in
likelihood of n flights is exceeded by that of the next, similar flight with probability 1 / (n + 1)."""
_MAX_CROSS_VALIDATION_SPLITS, _GROUP_GAIN_STANDARD_ERROR_CAP = 12, 0.33
"""A gain that is known no better than to a third is not known to be there."""
_N_PRIOR_CHANGES_FOR_REPAIR_SHARE = 20
"""Changes that count as seen before the labels are read, half of them repairs."""
_CREDIBLE_MASS_CANDIDATES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
_CREDIBLE_COVERAGE_GOAL = 0.93
"""Coverage the bounds aim at: 90 % and some of what another day takes away."""


CachedResult = TypeVar("CachedResult")


@dataclass(frozen=True)
class FlightWithUsableRows:
    """A flight (or half of one) and which of its samples the fit may use, is_usable (n,). result_cache:
    results that were computed from this flight and others."""

    samples: Samples
    is_usable: NDArray[np.bool_]
    result_cache: dict[tuple[object, ...], tuple[object, object]] = field(
        default_factory=dict, repr=False, compare=False
    )


def _compute_once(
    usable_flights: Sequence[FlightWithUsableRows],
    result_key: tuple[object, ...],
    compute: Callable[[], CachedResult],
) -> CachedResult:
    """Compute a result for these flights once: every test of a model needs the same fits to parts of them."""
    cached_results, cache_key = usable_flights[0].result_cache, (*result_key, *map(id, usable_flights))
    if cache_key not in cached_results:
        cached_results[cache_key] = (
            tuple(usable_flights),
            compute(),
        )  # held: an id is of one object while this lives
    return cached_results[cache_key][1]  # type: ignore[return-value]


def flights_with_usable_rows(flights: Sequence[Samples]) -> list[FlightWithUsableRows]:
    """Return each flight with the samples that are known well enough for the fit."""
    return [FlightWithUsableRows(samples, is_usable_for_fit(samples)) for samples in flights]


def is_usable_for_fit(samples: Samples) -> NDArray[np.bool_]:
    """Which samples are known to be healthy, or faulty by a known amount, (n,)."""
    is_usable = np.ones(len(samples.t_s), dtype=bool)
    if samples.logged_failures:
        is_usable &= (
            samples.t_s
            < min(failure.t_s for failure in samples.logged_failures) - _UNFITTED_MARGIN_BEFORE_FAILURE_S
        )
    is_surface_labelled = np.isfinite(samples.labels).any(axis=0)
    if not is_surface_labelled.any():
        return is_usable
    labels_of_labelled_surfaces = samples.labels[:, is_surface_labelled]
    is_usable &= np.isfinite(labels_of_labelled_surfaces).all(axis=1)
    for begin, end in constant_stretches(labels_of_labelled_surfaces):
        is_stretch_too_short = (end - begin) * samples.dt_s < MIN_LABEL_DURATION_S
        n_margin_samples = round(UNFITTED_LABEL_CHANGE_MARGIN_S / samples.dt_s)
        is_usable[begin : end if is_stretch_too_short else begin + n_margin_samples] = False
        is_usable[max(end - n_margin_samples, begin) : end] = False
    return is_usable


def fit_model(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, settings: FilterSettings | None = None
) -> Model:
    """The model that fits these flights. Raises BadInput where there is too little to fit."""
    n_rate_lags, n_command_lags = choose_model_order(usable_flights, vehicle)
    model = _fit_model_of_order(usable_flights, vehicle, n_rate_lags, n_command_lags)
    model = model.model_copy(update={"settings": settings or estimate_filter_settings(usable_flights, model)})
    return _with_noise_inflated_for_gain_errors(usable_flights, model) if model.noise_models else model


def fit_with_same_order(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> Model:
    """A model of the same order and settings, fitted to other flights."""
    refitted_model = _fit_model_of_order(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    covariance_inflation_by_ma_coefficients = {
        tuple(noise_model.ma_coefficients): noise_model.covariance_inflation
        for noise_model in model.noise_models
    }
    return _with_covariance_inflation(
        refitted_model.model_copy(update={"settings": model.settings}),
        covariance_inflation_by_ma_coefficients,
    )


def _with_covariance_inflation(
    model: Model, covariance_inflation_by_ma_coefficients: dict[tuple[float, ...], float]
) -> Model:
    noise_models = [
        noise_model.model_copy(
            update={
                "covariance_inflation": covariance_inflation_by_ma_coefficients.get(
                    tuple(noise_model.ma_coefficients), 1.0
                )
            }
        )
        for noise_model in model.noise_models
    ]
    return model.model_copy(update={"noise_models": noise_models})


def _fold_models_and_held_out_flights(
    usable_flights: Sequence[FlightWithUsableRows],
    model: Model,
    effect_share_explained_by_other_regressors: list[float],
) -> Iterator[tuple[Model, Sequence[FlightWithUsableRows]]]:
    """For each split, a model fitted to some of the flights, with the standard errors of its gains, and the
    held-out flights. effect_share_explained_by_other_regressors: of all flights, as in `FittedRanges`."""
    for fitted_flights, held_out_flights in _fitted_and_held_out_by_split(usable_flights):
        fold_model = fit_with_same_order(fitted_flights, model)
        rate_regression = fit_least_squares_of_order(
            fitted_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
        )
        gain_standard_errors = group_gain_standard_error(rate_regression, model).tolist()
        partial_fitted_ranges = FittedRanges(
            commands=[],
            rates=[],
            gain_sd=gain_standard_errors,
            tied=effect_share_explained_by_other_regressors,
        )
        yield fold_model.model_copy(update={"fitted_ranges": partial_fitted_ranges}), held_out_flights


def choose_model_order(usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle) -> tuple[int, int]:
    """Past samples of rates and commands by the Bayesian information criterion."""
    bic_of_order = bic_by_order(usable_flights, vehicle)
    return min(bic_of_order, key=lambda order: bic_of_order[order])


def bic_by_order(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle
) -> dict[tuple[int, int], float]:
    """The Bayesian information criterion of each number of past samples of rates and commands.

    Every order's regressors are among those of the largest: one matrix of products serves all.
    """
    regressors, rates, _ = stacked_regression_data(
        usable_flights, vehicle, max(RATE_LAG_COUNT_CANDIDATES), max(COMMAND_LAG_COUNT_CANDIDATES)
    )
    regressor_rms = np.maximum(np.sqrt((regressors**2).mean(axis=0)), MIN_DIVISOR)
    scaled_regressor_gram = (regressors / regressor_rms).T @ (regressors / regressor_rms)
    scaled_regressor_rate_products = (regressors / regressor_rms).T @ rates
    rate_gram = rates.T @ rates
    bic_of_order = {}
    for n_rate_lags in RATE_LAG_COUNT_CANDIDATES:
        for n_command_lags in COMMAND_LAG_COUNT_CANDIDATES:
            order_columns = _regressor_columns_of_order(vehicle, n_rate_lags, n_command_lags)
            scaled_coefficients = np.linalg.lstsq(
                scaled_regressor_gram[np.ix_(order_columns, order_columns)],
                scaled_regressor_rate_products[order_columns],
                rcond=1e-12,
            )[0]
            log_residual_covariance_determinant = np.linalg.slogdet(
                (rate_gram - scaled_regressor_rate_products[order_columns].T @ scaled_coefficients)
                / len(rates)
            )[1]
            bic_of_order[n_rate_lags, n_command_lags] = len(
                rates
            ) * log_residual_covariance_determinant + 3 * len(order_columns) * np.log(len(rates))
    return bic_of_order


def _regressor_columns_of_order(vehicle: Vehicle, n_rate_lags: int, n_command_lags: int) -> list[int]:
    """Columns of the largest design that an order has."""
    first_signal_column = 1 + 3 * max(RATE_LAG_COUNT_CANDIDATES)
    n_signals = len(vehicle.signal_regressor_names)
    first_command_column = first_signal_column + n_signals * vehicle.n_signal_lags(
        max(RATE_LAG_COUNT_CANDIDATES)
    )
    group_first_columns = [
        first_command_column + group_index * max(COMMAND_LAG_COUNT_CANDIDATES)
        for group_index in range(len(regression.group_surfaces_by_commands(vehicle)))
    ]
    command_columns = [
        first_column + lag for first_column in group_first_columns for lag in range(n_command_lags)
    ]
    return [
        *range(1 + 3 * n_rate_lags),
        *range(first_signal_column, first_signal_column + n_signals * vehicle.n_signal_lags(n_rate_lags)),
        *command_columns,
    ]


def fit_least_squares_of_order(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, n_rate_lags: int, n_command_lags: int
) -> regression.RateRegression:
    """Least squares of given order over all flights."""
    result_key = ("order", vehicle.model_dump_json(), n_rate_lags, n_command_lags)
    return _compute_once(
        usable_flights,
        result_key,
        lambda: _fit_least_squares_of_order_uncached(usable_flights, vehicle, n_rate_lags, n_command_lags),
    )


def _fit_least_squares_of_order_uncached(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, n_rate_lags: int, n_command_lags: int
) -> regression.RateRegression:
    regressors, rates, stretch_number = stacked_regression_data(
        usable_flights, vehicle, n_rate_lags, n_command_lags
    )
    if len(rates) < 10 * regressors.shape[1]:
        raise BadInput(
            f"identify: {len(rates)} samples known to be healthy, allowed: at least "
            f"{10 * regressors.shape[1]} to fit "
            f"{regressors.shape[1]} coefficients an axis"
        )
    motionless_axes = [
        axis for axis, rate_sd in zip("pqr", rates.std(axis=0), strict=True) if rate_sd < _MIN_RATE_SD_RAD_S
    ]
    if motionless_axes:
        raise BadInput(
            f"identify: rate {motionless_axes[0]} does not move, allowed: flights in which every rate does"
        )
    dt_s = float(np.median([usable_flight.samples.dt_s for usable_flight in usable_flights]))
    return regression.ordinary_least_squares(
        regressors, rates, stretch_number, round(_NEWEY_WEST_MAX_LAG_S / dt_s)
    )


def stacked_regression_data(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, n_rate_lags: int, n_command_lags: int
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Regressors, rates and run number over all flights: the same samples for any order.

    Columns of the regressors: one, the past, the commands of each group by lag.
    """
    surface_groups = regression.group_surfaces_by_commands(vehicle)
    max_lag = max(RATE_LAG_COUNT_CANDIDATES + COMMAND_LAG_COUNT_CANDIDATES)
    weighted_regressors_by_flight, weighted_rates_by_flight, stretch_numbers_by_flight = [], [], []
    for flight_index, usable_flight in enumerate(usable_flights):
        samples, n_signal_lags = usable_flight.samples, vehicle.n_signal_lags(n_rate_lags)
        lagged_rates_and_signals, lagged_group_commands, is_predictable = regression.build_regressors(
            samples, surface_groups, n_rate_lags, n_command_lags, True, n_signal_lags
        )
        is_usable = usable_flight.is_usable & is_predictable
        is_usable[:max_lag] = False
        n_samples = len(lagged_rates_and_signals)
        weighted_regressors_by_flight.append(
            samples.fit_weight
            * np.column_stack(
                [np.ones(n_samples), lagged_rates_and_signals, lagged_group_commands.reshape(n_samples, -1)]
            )[is_usable]
        )
        weighted_rates_by_flight.append(samples.fit_weight * samples.rates[is_usable])
        stretch_numbers_by_flight.append(
            np.cumsum(np.diff(np.flatnonzero(is_usable), prepend=0) > 1) + 1_000_000 * flight_index
        )
    return (
        np.vstack(weighted_regressors_by_flight),
        np.vstack(weighted_rates_by_flight),
        np.concatenate(stretch_numbers_by_flight),
    )


def _fit_model_of_order(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, n_rate_lags: int, n_command_lags: int
) -> Model:
    result_key = ("model", vehicle.model_dump_json(), n_rate_lags, n_command_lags)
    return _compute_once(
        usable_flights,
        result_key,
        lambda: _fit_model_of_order_uncached(usable_flights, vehicle, n_rate_lags, n_command_lags),
    )


def _fit_model_of_order_uncached(
    usable_flights: Sequence[FlightWithUsableRows], vehicle: Vehicle, n_rate_lags: int, n_command_lags: int
) -> Model:
    rate_regression = fit_least_squares_of_order(usable_flights, vehicle, n_rate_lags, n_command_lags)
    surface_names, surface_groups = list(vehicle.surfaces), regression.group_surfaces_by_commands(vehicle)
    first_command_row = len(rate_regression.coefficients) - len(surface_groups) * n_command_lags
    response_shape = (len(surface_groups), n_command_lags, 3)
    model = Model(
        vehicle=vehicle,
        rate_hz=1.0 / float(np.median([usable_flight.samples.dt_s for usable_flight in usable_flights])),
        groups=[[surface_names[i] for i in surface_indices] for surface_indices in surface_groups],
        history=n_rate_lags,
        lags=n_command_lags,
        intercept=rate_regression.coefficients[0].tolist(),
        past=rate_regression.coefficients[1:first_command_row].tolist(),
        response=rate_regression.coefficients[first_command_row:].reshape(response_shape).tolist(),
        response_sd=rate_regression.standard_errors[first_command_row:].reshape(response_shape).tolist(),
        noise=rate_regression.residual_covariance.tolist(),
    )
    model = model.model_copy(update={"noise_models": _fit_noise_models(usable_flights, model)})
    return _with_hidden_gain_errors(usable_flights, model) if vehicle.other_laws else model


def _fit_noise_models(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> list[NoiseModel]:
    """The colours that flights are whitened by, with the noise of each."""
    noise_models = []
    for noise_ma_coefficients in sorted(
        {usable_flight.samples.noise_ma_coefficients for usable_flight in usable_flights} - {()}
    ):
        rows_and_residuals = [
            rows_and_one_step_residuals(model, usable_flight)
            for usable_flight in usable_flights
            if usable_flight.samples.noise_ma_coefficients == noise_ma_coefficients
        ]
        noise_models.append(_fit_noise_model(list(noise_ma_coefficients), rows_and_residuals))
    return noise_models


def _with_hidden_gain_errors(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> Model:
    """The model with how far it may misread the groups' effects, by the noise of the flights.

    What the past predicts of a residual is no noise, but what the model lacks. A law that feeds it to the
    surfaces makes it look like their effect. On an axis with the power q of what is lacking and P of the
    effect, both in variances of the noise, the effect is then misread by sqrt(q / P) of itself at most; over
    axes, that least squares weighs by P, by sqrt(sum q P) / sum P. A law that feeds back otherwise shows it.
    """
    return model.model_copy(
        update={
            "noise_models": [
                noise_model.model_copy(
                    update={
                        "hidden_group_gain_error_sd": hidden_gain_errors(usable_flights, model, noise_model),
                        "usual_quick_response_power": usual_quick_response_power(
                            usable_flights, model, noise_model
                        ),
                    }
                )
                for noise_model in model.noise_models
            ]
        }
    )


def usual_quick_response_power(
    usable_flights: Sequence[FlightWithUsableRows], model: Model, noise_model: NoiseModel
) -> float:
    """The power of the quick part of the responses that the flights of one noise exceed in a tenth of their
    samples, in variances of this noise."""
    powers = [
        quick_response_power(
            rows_whitened_residual_and_responses(model, usable_flight)[2],
            np.array(noise_model.residual_covariance),
            model.rate_hz,
        )
        for usable_flight in usable_flights
        if list(usable_flight.samples.noise_ma_coefficients) == noise_model.ma_coefficients
    ]
    return float(np.quantile(np.concatenate(powers), _USUAL_QUICK_RESPONSE_SHARE))


def quick_response_error_share(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> float:
    """Estimate the error of unusually quick responses, as a share of them, at most 1: the largest of the
    flights left out; 1 if none of them has such responses."""
    squared_shares = [
        _squared_quick_response_error_share(fit_with_same_order(fitted_flights, model), held_out)
        for fitted_flights, held_out_flights in _fitted_and_held_out_by_split(usable_flights)
        for held_out in held_out_flights
    ]
    known_squared_shares = [squared_share for squared_share in squared_shares if squared_share is not None]
    return float(np.sqrt(np.clip(max(known_squared_shares, default=1.0), 0.0, 1.0)))


def _squared_quick_response_error_share(fold_model: Model, held_out: FlightWithUsableRows) -> float | None:
    """The square of the error of unusually quick responses in a flight left out, as a share of them; None if
    it has too few.

    In variances of the noise of the fit, the residual of a sample has the variance r (1 + share^2 s), with
    the variance r of the noise of this flight and the power s of the quick responses.
    """
    ma_coefficients = held_out.samples.noise_ma_coefficients
    _, residual, rate_responses = rows_whitened_residual_and_responses(fold_model, held_out)
    covariance = fold_model.covariance_of_noise_model(ma_coefficients)
    power = quick_response_power(rate_responses, covariance, fold_model.rate_hz)
    is_unusual = power > fold_model.usual_quick_response_power(ma_coefficients)
    if is_unusual.sum() < _MIN_QUICK_SAMPLES:
        return None
    whitening_matrix = np.linalg.inv(np.linalg.cholesky(covariance)).T
    squares = ((residual - np.median(residual, axis=0)) @ whitening_matrix) ** 2
    noise_variance = max(trust.noise_variance_scale(squares), 1.0)
    relative_squares = squares[is_unusual].mean(axis=1) / noise_variance
    return float(((relative_squares - 1.0) / power[is_unusual]).mean())


def hidden_gain_errors(
    usable_flights: Sequence[FlightWithUsableRows], model: Model, noise_model: NoiseModel
) -> list[float]:
    """How far a fit may misread the effect of each group in the flights of one noise, as a share, (G,): the
    standard deviation of an error that is anywhere below the largest."""
    flights_of_noise = [
        usable_flight
        for usable_flight in usable_flights
        if list(usable_flight.samples.noise_ma_coefficients) == noise_model.ma_coefficients
    ]
    residual = np.vstack([rows_and_one_step_residuals(model, flight)[1] for flight in flights_of_noise])
    response_power_by_flight = [
        _without_mean(rows_whitened_residual_and_responses(model, flight)[2]) ** 2
        for flight in flights_of_noise
    ]
    noise_variance = np.diag(np.array(noise_model.residual_covariance))
    response_power = np.vstack(response_power_by_flight).mean(axis=0) / noise_variance
    lacking_power = np.maximum(residual.var(axis=0) / noise_variance - 1.0, 0.0)
    max_errors = np.minimum(
        np.sqrt(response_power @ lacking_power) / np.maximum(response_power.sum(axis=1), MIN_DIVISOR),
        _GROUP_GAIN_STANDARD_ERROR_CAP,
    )
    return (max_errors / np.sqrt(3.0)).tolist()


def _fit_noise_model(
    ma_coefficients: list[float], rows_and_residuals: Sequence[tuple[NDArray[np.int64], Floats]]
) -> NoiseModel:
    """A noise model with an AR predictor of the residual, by least squares where samples follow one another,
    and the remaining noise; without a predictor where too few do."""
    residual_runs = [
        residual[begin:end]
        for rows, residual in rows_and_residuals
        for begin, end in _begins_and_ends_of_consecutive_rows(rows)
    ]
    target_residuals = [run[AUTOREGRESSIVE_ORDER:] for run in residual_runs]
    if sum(map(len, target_residuals)) < 10 * 3 * AUTOREGRESSIVE_ORDER:
        return NoiseModel(average=ma_coefficients, noise=np.cov(np.vstack(residual_runs).T).tolist())
    regressors = np.vstack([
        np.hstack([run[AUTOREGRESSIVE_ORDER - lag : len(run) - lag]
                   for lag in range(1, AUTOREGRESSIVE_ORDER + 1)])
        for run in residual_runs if len(run) > AUTOREGRESSIVE_ORDER
    ])  # fmt: skip
    stacked_targets = np.vstack(target_residuals)
    ar_coefficients = np.linalg.lstsq(regressors, stacked_targets, rcond=None)[0]
    return NoiseModel(
        average=ma_coefficients,
        before=ar_coefficients.tolist(),
        noise=np.cov((stacked_targets - regressors @ ar_coefficients).T).tolist(),
    )


def estimate_filter_settings(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> FilterSettings:
    """Estimate the settings of later faults from the flights: levels seen, and how often they changed."""
    may_air_move = model.vehicle.moving_air
    command_delay_offset_candidates_s = [
        delay_samples / model.rate_hz
        for delay_samples in ((0.0,) if may_air_move else _COMMAND_DELAY_OFFSET_CANDIDATES_SAMPLES)
    ]
    other_laws_settings: dict[str, Any] = (
        _FILTER_SETTINGS_FOR_OTHER_LAWS | (_FILTER_SETTINGS_FOR_MOVING_AIR if may_air_move else {})
        if model.vehicle.other_laws
        else {}
    )
    if model.vehicle.other_laws and model.noise_models:
        other_laws_settings |= {"quick_error": quick_response_error_share(usable_flights, model)}
    labelled = _count_labelled_faults(usable_flights, model)
    if not labelled.fault_levels_by_group:
        return _filter_settings_without_labelled_faults(
            usable_flights, model, other_laws_settings, command_delay_offset_candidates_s
        )
    # A flight may be tested less hard than these: the rate is the geometric mean of theirs and the usual.
    changes_per_hour = (labelled.n_effectiveness_changes + 1) / labelled.usable_hours
    return FilterSettings(
        levels=labelled.fault_levels_by_group,
        changes_per_hour=float(np.sqrt(changes_per_hour * FilterSettings().effectiveness_changes_per_hour)),
        **(_FILTER_SETTINGS_FOR_OTHER_DAYS | other_laws_settings),
        delays_s=command_delay_offset_candidates_s,
        repair_share=(labelled.n_repairs + _N_PRIOR_CHANGES_FOR_REPAIR_SHARE / 2)
        / (labelled.n_effectiveness_changes + _N_PRIOR_CHANGES_FOR_REPAIR_SHARE),
        power=_EFFECTIVE_SAMPLE_SHARE_LABELLED,
    )


class _LabelledFaults(NamedTuple):
    """What the labels of the flights say: levels of effectiveness below 1 seen of each group that is a single
    surface, how often a level changed, how often to 1, and the hours of usable rows."""

    fault_levels_by_group: dict[str, list[float]]
    n_effectiveness_changes: int
    n_repairs: int
    usable_hours: float


def _count_labelled_faults(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> _LabelledFaults:
    fault_levels_by_group, n_effectiveness_changes, n_repairs = dict[str, list[float]](), 0, 0
    surface_names = list(model.vehicle.surfaces)
    for group in model.groups:
        if len(group) > 1:
            continue
        level_sequences_by_flight = [
            _labelled_levels_in_order(usable_flight, surface_names.index(group[0]))
            for usable_flight in usable_flights
        ]
        fault_levels = {level for sequence in level_sequences_by_flight for level in sequence if level < 1.0}
        if fault_levels:
            fault_levels_by_group[group[0]] = sorted(fault_levels)
        n_effectiveness_changes += sum(max(len(sequence) - 1, 0) for sequence in level_sequences_by_flight)
        n_repairs += sum(
            int(level == 1.0) for sequence in level_sequences_by_flight for level in sequence[1:]
        )
    usable_s = sum(
        usable_flight.is_usable.sum() * usable_flight.samples.dt_s for usable_flight in usable_flights
    )
    return _LabelledFaults(
        fault_levels_by_group, n_effectiveness_changes, n_repairs, float(usable_s / 3600.0)
    )


def _filter_settings_without_labelled_faults(
    usable_flights: Sequence[FlightWithUsableRows],
    model: Model,
    other_laws_settings: dict[str, Any],
    command_delay_offset_candidates_s: list[float],
) -> FilterSettings:
    trim_walk_sd_per_sample = _estimate_trim_walk_sd_per_sample(usable_flights, model)
    model_with_trim_drift = model.model_copy(
        update={"settings": FilterSettings(trim_walk=trim_walk_sd_per_sample, **other_laws_settings)}
    )
    max_effective_sample_share = (
        (1.0 if model.vehicle.moving_air else _MAX_EFFECTIVE_SAMPLE_SHARE_OTHER_LAWS)
        if other_laws_settings
        else _MAX_EFFECTIVE_SAMPLE_SHARE_UNLABELLED
    )
    effective_sample_share = min(
        max_effective_sample_share, 1.0 / gain_error_overdispersion(usable_flights, model_with_trim_drift)
    )
    return FilterSettings(
        **other_laws_settings,
        power=effective_sample_share,
        trim_walk=trim_walk_sd_per_sample,
        delays_s=command_delay_offset_candidates_s,
    )


def gain_error_overdispersion(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> float:
    """Estimate how many times as far, in squares, the gains of parts left out are from 1 as the filter
    believes.

    Residuals e = F (g - 1) + noise of a part give the gains g of its groups, least squares with trims aside.
    Were the noise white and flights alike, the squares of g - 1 in the covariance (F' F)^-1 + S would be as
    many as gains, on average; S is what the filter leaves free. What flights differ in and colour make more:
    so much less does a sample tell of an effectiveness [McCullagh1989, section 4.5]. One part counts as seen
    that is as believed.
    """
    samples_and_is_usable_by_flight = [
        (usable_flight.samples, usable_flight.is_usable) for usable_flight in usable_flights
    ]
    held_out_normalized_error_sum = n_gains_over_flights = float(len(model.groups))
    for fold_model, held_out_flights in _fold_models_and_held_out_flights(
        usable_flights,
        model,
        trust.effect_share_explained_by_other_regressors(samples_and_is_usable_by_flight, model).tolist(),
    ):
        is_group_effect_separable = np.array(trust.is_group_effect_known(fold_model))
        for held_out in held_out_flights:
            group_responses, residual = _standardized_centred_responses_and_residual(fold_model, held_out)
            if not len(residual):  # a part without a residual shows no gain
                continue
            group_responses = group_responses.sum(axis=3)[:, :, is_group_effect_separable].reshape(
                residual.size, -1
            )
            flight_normalized_squared_gain_error, n_determined_gains_of_flight = (
                _normalized_squared_gain_error_and_rank(
                    group_responses,
                    residual.ravel(),
                    _prior_total_group_gain_covariance(
                        fold_model, is_group_effect_separable, held_out.samples.noise_ma_coefficients
                    ),
                )
            )
            held_out_normalized_error_sum = (
                held_out_normalized_error_sum + flight_normalized_squared_gain_error
            )
            n_gains_over_flights = n_gains_over_flights + n_determined_gains_of_flight
    return held_out_normalized_error_sum / n_gains_over_flights


def _with_noise_inflated_for_gain_errors(
    usable_flights: Sequence[FlightWithUsableRows], model: Model
) -> Model:
    """The model with the noise of each colour so many times wider as the gains of ten seconds left out, each
    axis of an answer with its own, are farther from 1, in squares, than it and the filter let them be: quiet
    gyros show what the model itself lacks."""
    window_inflations_by_ma_coefficients: dict[tuple[float, ...], list[float]] = {}
    samples_and_is_usable_by_flight = [
        (usable_flight.samples, usable_flight.is_usable) for usable_flight in usable_flights
    ]
    for fold_model, held_out_flights in _fold_models_and_held_out_flights(
        usable_flights,
        model,
        trust.effect_share_explained_by_other_regressors(samples_and_is_usable_by_flight, model).tolist(),
    ):
        other_flights = [
            flight
            for flight in usable_flights
            if all(flight is not held_out for held_out in held_out_flights)
        ]
        for held_out in held_out_flights:
            window_inflations_by_ma_coefficients.setdefault(
                held_out.samples.noise_ma_coefficients, []
            ).extend(_window_inflations(fold_model, held_out, other_flights))
    covariance_inflation_by_ma_coefficients = {
        ma_coefficients: max(float(np.mean(window_inflations)), 1.0)
        for ma_coefficients, window_inflations in window_inflations_by_ma_coefficients.items()
        if window_inflations
    }
    if model.vehicle.other_laws:
        covariance_inflation_by_ma_coefficients = {
            ma_coefficients: inflation
            * (
                _GYRO_NOISE_VARIANCE_FACTOR_OTHER_LAWS
                if _is_gyro_noise_spectrum(ma_coefficients)
                else _GUST_NOISE_VARIANCE_FACTOR_OTHER_LAWS
            )
            for ma_coefficients, inflation in covariance_inflation_by_ma_coefficients.items()
        }
    return _with_covariance_inflation(model, covariance_inflation_by_ma_coefficients)


def _window_inflations(
    fold_model: Model, held_out: FlightWithUsableRows, other_flights: Sequence[FlightWithUsableRows]
) -> list[float]:
    """How many times as far, in squares, the gains of each ten seconds of a part left out are from 1 as the
    filter lets them be. Under other laws the filter widens the noise of a flight that is louder than the
    others (`recent_noise_variance_scale`): what it widens by itself is not counted again."""
    is_group_effect_separable = np.array(trust.is_group_effect_known(fold_model))
    group_responses, residual = _standardized_centred_responses_and_residual(fold_model, held_out)
    if not len(residual):  # a part without a residual shows no gain
        return []
    prior_gain_covariance = _prior_total_group_gain_covariance(
        fold_model, is_group_effect_separable, held_out.samples.noise_ma_coefficients
    )
    prior_axis_gain_covariance = np.asarray(np.kron(prior_gain_covariance, np.ones((3, 3))), dtype=float)
    group_responses = group_responses[:, :, is_group_effect_separable].reshape(*residual.shape, -1)
    loudness = _noise_variance_scale_beyond_others(fold_model, held_out, other_flights)
    n_windows = max(round(len(residual) * held_out.samples.dt_s / _GAIN_ERROR_WINDOW_S), 1)
    window_inflations = []
    for window_rows in np.array_split(np.arange(len(residual)), n_windows):
        window_responses = _without_mean(group_responses[window_rows]) / np.sqrt(loudness)
        standardised_window_residual = _without_mean(residual[window_rows]) / np.sqrt(loudness)
        normalized_squared_gain_error, n_determined_gains = _normalized_squared_gain_error_and_rank(
            window_responses.reshape(standardised_window_residual.size, -1),
            standardised_window_residual.ravel(),
            prior_axis_gain_covariance,
        )
        window_inflations.append(
            min(normalized_squared_gain_error / max(n_determined_gains, 1), _MAX_WINDOW_COVARIANCE_INFLATION)
        )
    return window_inflations


def _noise_variance_scale_beyond_others(
    fold_model: Model, held_out: FlightWithUsableRows, other_flights: Sequence[FlightWithUsableRows]
) -> float:
    """How many times as wide the filter finds the noise of a flight left out as that of the loudest other
    flight of the same noise; 1 if it is within the range of these, or under the same law."""
    if not fold_model.vehicle.other_laws:
        return 1.0

    def scale(flight: FlightWithUsableRows) -> float:
        _, residual = _standardized_centred_responses_and_residual(fold_model, flight)
        is_usable = np.ones(len(residual), dtype=bool)
        scales = recent_noise_variance_scale(residual, is_usable, np.eye(3), fold_model.rate_hz)
        return float(scales.mean()) if len(scales) else 1.0

    other_scales = [
        scale(flight)
        for flight in other_flights
        if flight.samples.noise_ma_coefficients == held_out.samples.noise_ma_coefficients
    ]
    return max(scale(held_out) / max([1.0, *other_scales]), 1.0)


def _is_gyro_noise_spectrum(noise_ma_coefficients: Sequence[float]) -> bool:
    """Whether noise takes from the next sample what it added to one, as an instrument's does."""
    return len(noise_ma_coefficients) > 1 and noise_ma_coefficients[1] < 0.0


def _prior_total_group_gain_covariance(
    model: Model, is_group_effect_separable: NDArray[np.bool_], noise_ma_coefficients: tuple[float, ...]
) -> Floats:
    """Covariance of the gains of the groups with a known effect that the filter leaves free."""
    initial_gain_covariance = build_trim_and_gain_state_model(
        model, noise_ma_coefficients
    ).initial_covariance[3:, 3:]
    return np.asarray(
        initial_gain_covariance[0, 0]
        + np.diag(np.diag(initial_gain_covariance)[1:][is_group_effect_separable])
    )


def _normalized_squared_gain_error_and_rank(
    gain_responses: Floats, residual: Floats, prior_gain_covariance: Floats
) -> tuple[float, int]:
    """Squares of the gains of a residual (m,) on gain_responses (m, G), in their covariance and what
    lies between flights, and how many gains there are."""
    information, score_vector = gain_responses.T @ gain_responses, gain_responses.T @ residual
    gain_errors = np.linalg.lstsq(information, score_vector, rcond=_RANK_TOLERANCE)[0]
    identity_plus_prior_times_information = (
        np.eye(len(gain_errors)) + prior_gain_covariance @ information
    )  # singular by rounding where nothing tells a gain
    normalized_squared_gain_error = max(
        float(
            score_vector
            @ np.linalg.lstsq(identity_plus_prior_times_information, gain_errors, rcond=_RANK_TOLERANCE)[0]
        ),
        0.0,
    )
    return normalized_squared_gain_error, int(
        np.linalg.matrix_rank(information, tol=_RANK_TOLERANCE * np.trace(information))
    )


def _standardized_centred_responses_and_residual(
    model: Model, held_out: FlightWithUsableRows
) -> tuple[Floats, Floats]:
    """Return the effect of each axis of each group's answer on the residuals (n, 3) of a part, (n, 3, G, 3),
    both in sd of the noise, without means; where responses are quick, of the noise and their error."""
    _, residual, rate_responses = rows_whitened_residual_and_responses(model, held_out)
    ma_coefficients = held_out.samples.noise_ma_coefficients
    sd_scale = np.sqrt(quick_response_variance_scale(rate_responses, model, ma_coefficients))
    covariance = model.with_inflated_covariance_of_noise_model(ma_coefficients).residual_covariance
    whitening_matrix = np.linalg.inv(np.linalg.cholesky(np.array(covariance))).T
    noise_whitened_responses = np.einsum("nga,ab->nbga", rate_responses, whitening_matrix)
    noise_whitened_residual = residual @ whitening_matrix
    return (
        _without_mean(noise_whitened_responses) / sd_scale[:, None, None, None],
        _without_mean(noise_whitened_residual) / sd_scale[:, None],
    )


def _without_mean(values: Floats) -> Floats:
    """Values (n, ...) less their mean over n; none of none."""
    return values - values.mean(axis=0) if len(values) else values


def _estimate_trim_walk_sd_per_sample(
    usable_flights: Sequence[FlightWithUsableRows], model: Model
) -> list[float]:
    """Drift of the trim a sample, in residual sd, that parts left out show; the usual at least.

    Means of n samples of a random walk, with steps of variance w, and of noise whose mean has the variance
    c / n differ from the next with the variance 2 c / n + 2 n w / 3: two n tell w from c.
    """
    squared_difference_sums = np.zeros((2, 3))
    n_differences = np.zeros(2)
    span_lengths_samples = np.round(np.array(_TRIM_DRIFT_AVERAGING_SPANS_S) * model.rate_hz)
    for fitted_flights, held_out_flights in _fitted_and_held_out_by_split(usable_flights):
        fold_model = fit_with_same_order(fitted_flights, model)
        for held_out in held_out_flights:
            rows, residual, _ = rows_whitened_residual_and_responses(fold_model, held_out)
            noise_covariance = np.array(
                fold_model.with_inflated_covariance_of_noise_model(
                    held_out.samples.noise_ma_coefficients
                ).residual_covariance
            )
            noise_whitened_residual = residual / np.sqrt(np.maximum(np.diag(noise_covariance), MIN_DIVISOR))
            for begin, end in _begins_and_ends_of_consecutive_rows(rows):
                for i, n_span_samples in enumerate(span_lengths_samples.astype(int).tolist()):
                    span_means = (
                        noise_whitened_residual[begin:end][: (end - begin) // n_span_samples * n_span_samples]
                        .reshape(-1, n_span_samples, 3)
                        .mean(axis=1)
                    )
                    squared_difference_sums[i] += (np.diff(span_means, axis=0) ** 2).sum(axis=0)
                    n_differences[i] += max(len(span_means) - 1, 0)
    default_trim_walk_sd_per_sample = np.array(FilterSettings().trim_walk_sd_per_sample)
    if not n_differences.all():
        return default_trim_walk_sd_per_sample.tolist()
    short_span_difference_variance, long_span_difference_variance = (
        squared_difference_sums / n_differences[:, None]
    )
    short_span_samples, long_span_samples = span_lengths_samples
    random_walk_variance = (
        1.5
        * (
            long_span_samples * long_span_difference_variance
            - short_span_samples * short_span_difference_variance
        )
        / (long_span_samples**2 - short_span_samples**2)
    )
    return np.maximum(
        np.sqrt(np.maximum(random_walk_variance, 0.0)), default_trim_walk_sd_per_sample
    ).tolist()


def _begins_and_ends_of_consecutive_rows(rows: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Begin and end of what of increasing places follows one another."""
    run_edges = [0, *(np.flatnonzero(np.diff(rows) > 1) + 1).tolist(), len(rows)]
    return list(pairwise(run_edges))


def _labelled_levels_in_order(usable_flight: FlightWithUsableRows, surface_index: int) -> list[float]:
    """The levels of one surface's label in their order, edges left out."""
    labels = usable_flight.samples.labels[:, surface_index][usable_flight.is_usable]
    return [round(level, 6) for level, _ in groupby(labels[np.isfinite(labels)].tolist())]


def validation_folds(
    usable_flights: Sequence[FlightWithUsableRows],
) -> list[tuple[list[FlightWithUsableRows], FlightWithUsableRows, str]]:
    """Return the fitted flights, the held-out one and its name, for each fold."""
    if len(usable_flights) > 1:
        fitted_flights_by_fold = [
            [usable_flight for usable_flight in usable_flights if usable_flight is not held_out]
            for held_out in usable_flights
        ]
        return [
            (fitted_flights, held_out, held_out.samples.name)
            for fitted_flights, held_out in zip(fitted_flights_by_fold, usable_flights, strict=True)
        ]
    (only_flight,) = usable_flights
    first_half, second_half = _compute_once(
        usable_flights, ("halves",), lambda: _split_in_halves(only_flight)
    )
    return [([first_half], second_half, "second half"), ([second_half], first_half, "first half")]


def _split_in_halves(
    usable_flight: FlightWithUsableRows,
) -> tuple[FlightWithUsableRows, FlightWithUsableRows]:
    """Split the usable samples of a flight into two halves."""
    usable_rows = np.flatnonzero(usable_flight.is_usable)
    middle_row = int(usable_rows[len(usable_rows) // 2]) if len(usable_rows) else 0
    is_first_half = np.arange(len(usable_flight.is_usable)) < middle_row
    return FlightWithUsableRows(
        usable_flight.samples, usable_flight.is_usable & is_first_half
    ), FlightWithUsableRows(usable_flight.samples, usable_flight.is_usable & ~is_first_half)


def add_fitted_ranges_and_alarm_threshold(
    usable_flights: Sequence[FlightWithUsableRows], model: Model
) -> Model:
    """The model with what it was fitted on, and how it did on parts that were left out: at which evidence of
    a fault they would alarm as often as declared."""
    samples_and_is_usable_by_flight = [
        (usable_flight.samples, usable_flight.is_usable) for usable_flight in usable_flights
    ]
    held_out = _test_on_held_out_flights(usable_flights, model, samples_and_is_usable_by_flight)
    rate_regression = fit_least_squares_of_order(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    gain_variance_between_laws = np.zeros(len(model.groups))
    if model.vehicle.other_laws:
        gain_variance_between_laws = _gain_variance_between_laws(
            _max_gain_bias_under_one_law(usable_flights, model), held_out.squared_gain_deviations
        )
    gain_standard_errors = np.minimum(
        np.sqrt(group_gain_standard_error(rate_regression, model) ** 2 + gain_variance_between_laws),
        _GROUP_GAIN_STANDARD_ERROR_CAP,
    )
    peak_tail = extremes.fit_peak_tail(held_out.peaks_and_hours)
    fitted_ranges = trust.compute_fitted_ranges(
        samples_and_is_usable_by_flight, model, gain_standard_errors
    ).model_copy(
        update={
            "alarm_peak_tail": peak_tail,
            "max_column_mistake_log_likelihood_gain": held_out.max_column_mistake_log_likelihood_gain,
        }
    )
    false_alarms_per_hour, alarm_threshold = _alarm_rate_and_threshold(
        model, peak_tail, held_out.peaks_and_hours
    )
    alarm_settings = {"false_alarms_per_hour": false_alarms_per_hour, "alarm_threshold": alarm_threshold}
    return model.model_copy(
        update={
            "fitted_ranges": fitted_ranges,
            "settings": model.settings.model_copy(update=alarm_settings),
            "identification_results": dict(
                _cross_validate_alarm_threshold(held_out.peaks_and_hours, false_alarms_per_hour, model)
            ),
        }
    )


class _HeldOutResults(NamedTuple):
    """How models of parts of the flights did on the parts that were left out.

    max_column_mistake_log_likelihood_gain: largest gain, a sample, of reading the columns by mistake.
    peaks_and_hours: peaks of the evidence of a fault, and hours of health, of each part.
    squared_gain_deviations: of each part (G,), beyond what noise explains; empty under one law.
    """

    max_column_mistake_log_likelihood_gain: float
    peaks_and_hours: list[extremes.PeaksAndHours]
    squared_gain_deviations: list[Floats]


def _test_on_held_out_flights(
    usable_flights: Sequence[FlightWithUsableRows],
    model: Model,
    samples_and_is_usable_by_flight: Sequence[tuple[Samples, NDArray[np.bool_]]],
) -> _HeldOutResults:
    """Fit the model without each part of the flights in turn, and test it on that part."""
    max_mistake_gain = 0.0
    peaks_and_hours = list[extremes.PeaksAndHours]()
    squared_gain_deviations = list[Floats]()
    for fold_model, held_out_flights in _fold_models_and_held_out_flights(
        usable_flights,
        model,
        trust.effect_share_explained_by_other_regressors(samples_and_is_usable_by_flight, model).tolist(),
    ):
        for held_out in held_out_flights:
            if len(peaks_and_hours) < _N_HELD_OUT_TESTED_FOR_COLUMN_MISTAKES:
                max_mistake_gain = max(
                    max_mistake_gain, _max_column_mistake_log_likelihood_gain(fold_model, held_out)
                )
            peaks_and_hours.append(_healthy_alarm_peaks_and_hours(fold_model, held_out))
            if len(usable_flights) > 1 and model.vehicle.other_laws:
                squared_gain_deviations.append(
                    _squared_group_gain_deviations_beyond_noise(fold_model, held_out)
                )
    return _HeldOutResults(max_mistake_gain, peaks_and_hours, squared_gain_deviations)


def _alarm_rate_and_threshold(
    model: Model, peak_tail: extremes.PeakTail | None, peaks_and_hours: Sequence[extremes.PeaksAndHours]
) -> tuple[float | None, float | None]:
    """The rate of false alarms, 1/h, that the vehicle file asks for or that is usual, and the evidence at
    which health reaches it. Raises BadInput if the flights are too short to tell the rate asked for."""
    requested_false_alarms_per_hour = model.vehicle.false_alarms_per_hour
    target_false_alarms_per_hour = (
        _DEFAULT_FALSE_ALARMS_PER_HOUR
        if requested_false_alarms_per_hour is None and not model.settings.likely_effectiveness_levels_by_group
        else requested_false_alarms_per_hour
    )
    if peak_tail is None and requested_false_alarms_per_hour is not None:
        healthy_minutes = _total_healthy_minutes(peaks_and_hours)
        reason = f"{healthy_minutes:.1f} min of health left out have too few peaks of the evidence to tell"
        missing_minutes = (
            extremes.EXPECTED_COUNT_RULED_OUT_BY_NO_ALARM * 60.0 / requested_false_alarms_per_hour
            - healthy_minutes
        )
        raise BadInput(
            f"identify: false_alarms_per_hour {requested_false_alarms_per_hour:g}: {reason}, allowed: "
            f"{missing_minutes:.0f} min more"
        )
    if target_false_alarms_per_hour:
        return target_false_alarms_per_hour, _choose_alarm_threshold(
            peak_tail, target_false_alarms_per_hour, model
        )
    return target_false_alarms_per_hour, None


def _max_gain_bias_under_one_law(usable_flights: Sequence[FlightWithUsableRows], model: Model) -> Floats:
    """By how much a group's gain may be misread under one law, (G,).

    Of the residual's variance the share that its own past predicts is no noise, but what the model lacks. A
    law feeds it back to the surfaces, and least squares takes it for their answer, at most so much of it as
    the standard deviation of one is of the other's; a law that feeds back otherwise shows the difference.
    """
    if not model.noise_models:
        return np.zeros(len(model.groups))
    ar_explained_variance_share = 0.0
    for noise_model in model.noise_models:
        residuals_by_flight = [
            rows_and_one_step_residuals(model, usable_flight)[1]
            for usable_flight in usable_flights
            if list(usable_flight.samples.noise_ma_coefficients) == noise_model.ma_coefficients
        ]
        stacked_residuals, n_samples = np.vstack(residuals_by_flight), sum(map(len, residuals_by_flight))
        chance_ar_explained_variance_share = (
            3.0 * AUTOREGRESSIVE_ORDER / n_samples if noise_model.ar_coefficients else 0.0
        )
        ar_log_determinant_ratio = (
            np.linalg.slogdet(np.array(noise_model.residual_covariance))[1]
            - np.linalg.slogdet(np.cov(stacked_residuals.T))[1]
        )
        ar_explained_variance_share = max(
            ar_explained_variance_share,
            1.0 - float(np.exp(ar_log_determinant_ratio / 3.0)) - chance_ar_explained_variance_share,
        )
    unexplained_effect_power = trust.effect_power_unexplained_by_other_regressors(
        [(usable_flight.samples, usable_flight.is_usable) for usable_flight in usable_flights], model
    )
    return np.minimum(
        np.sqrt(3.0 * ar_explained_variance_share / np.maximum(unexplained_effect_power, MIN_DIVISOR)),
        _GROUP_GAIN_STANDARD_ERROR_CAP,
    )


def _squared_group_gain_deviations_beyond_noise(model: Model, held_out: FlightWithUsableRows) -> Floats:
    """Squares of how far the groups' gains are from 1 in a flight left out, beyond the noise's share, (G,);
    nan of a group whose effect it does not show."""
    group_responses, residual = _standardized_centred_responses_and_residual(model, held_out)
    group_responses = group_responses.sum(axis=3).reshape(residual.size, len(model.groups))
    squared_deviations_beyond_noise = np.full(group_responses.shape[1], np.nan)
    is_group_effect_separable = np.array(trust.is_group_effect_known(model)) & (group_responses.any(axis=0))
    information = (
        group_responses[:, is_group_effect_separable].T @ group_responses[:, is_group_effect_separable]
    )
    gain_error_covariance = np.linalg.pinv(information, rcond=_RANK_TOLERANCE, hermitian=True)
    gain_errors = gain_error_covariance @ (group_responses[:, is_group_effect_separable].T @ residual.ravel())
    if is_group_effect_separable.any():  # a part without a residual shows the effect of no group
        squared_deviations_beyond_noise[is_group_effect_separable] = np.maximum(
            gain_errors**2 - np.diag(gain_error_covariance) * max(float((residual**2).mean()), 1.0), 0.0
        )
    return squared_deviations_beyond_noise


def _gain_variance_between_laws(prior_gain_sd: Floats, squared_gain_deviations: Sequence[Floats]) -> Floats:
    """Variance of each group's gain from a flight to one of another law, (G,).

    prior_gain_sd: how far another flight's gains may be before any is left out, which counts as one flight;
    squared_gain_deviations: squares of how far those of flights left out were.
    """
    return np.asarray(np.nanmean([prior_gain_sd**2, *squared_gain_deviations], axis=0))


def _choose_alarm_threshold(
    tail: extremes.PeakTail | None, target_false_alarms_per_hour: float, model: Model
) -> float:
    """By the tail, or by theory if there is no tail. Under laws of which the parts left out say nothing, by
    theory if that asks for more."""
    lorden_bound_factor = 1.0 if tail is None or model.vehicle.other_laws else 0.0
    if model.vehicle.other_laws and not model.vehicle.moving_air:
        lorden_bound_factor = _LORDEN_BOUND_FACTOR_OTHER_LAWS
    min_threshold = lorden_bound_factor * extremes.threshold_by_lorden_bound(
        model.rate_hz, target_false_alarms_per_hour
    )
    return (
        max(extremes.threshold_for_false_alarms(tail, target_false_alarms_per_hour), min_threshold)
        if tail is not None
        else min_threshold
    )


def _max_column_mistake_log_likelihood_gain(model: Model, held_out: FlightWithUsableRows) -> float:
    """How much likelier a sample of a part left out, in health, is with its columns read wrongly, at most."""
    rates = np.where(held_out.is_usable[:, None], held_out.samples.rates, np.nan)
    sample_log_likelihood_gain_by_correction, _ = trust.min_log_likelihood_gains_and_part_size(
        replace(held_out.samples, rates=rates), model
    )
    return (
        max(0.0, *sample_log_likelihood_gain_by_correction.values())
        if sample_log_likelihood_gain_by_correction
        else 0.0
    )


def _total_healthy_minutes(held_out_peaks_and_hours: Sequence[extremes.PeaksAndHours]) -> float:
    return 60.0 * sum(hours for _, hours in held_out_peaks_and_hours)


def _cross_validate_alarm_threshold(
    held_out_peaks_and_hours: Sequence[extremes.PeaksAndHours],
    target_false_alarms_per_hour: float | None,
    model: Model,
) -> Document:
    """Test the threshold on parts left out: how many would have alarmed, each at the threshold that the
    others ask for, and how often."""
    tails_of_others = [
        extremes.fit_peak_tail([*held_out_peaks_and_hours[:i], *held_out_peaks_and_hours[i + 1 :]])
        for i in range(len(held_out_peaks_and_hours))
    ]
    if target_false_alarms_per_hour is None or len(held_out_peaks_and_hours) < 2 or not all(tails_of_others):
        return {}
    thresholds = [
        _choose_alarm_threshold(tail, target_false_alarms_per_hour, model) for tail in tails_of_others if tail
    ]
    n_alarms_by_flight = [
        int((peaks >= threshold).sum())
        for (peaks, _), threshold in zip(held_out_peaks_and_hours, thresholds, strict=True)
    ]
    return {
        "parts": len(held_out_peaks_and_hours),
        "minutes": _total_healthy_minutes(held_out_peaks_and_hours),
        "alarmed": sum(n_alarms > 0 for n_alarms in n_alarms_by_flight),
        "alarms": sum(n_alarms_by_flight),
    }


def _healthy_alarm_peaks_and_hours(model: Model, held_out: FlightWithUsableRows) -> extremes.PeaksAndHours:
    """Return for a part left out the peaks of the alarm statistic in health, and its healthy hours."""
    bank = build_hypothesis_bank(model)
    posterior, _, _ = hypothesis_state_and_noise_posterior(held_out.samples, model, bank)
    evidence_increments, labels = any_fault_log_odds_gains(posterior, bank), held_out.samples.labels
    is_usable_healthy_and_responding = (
        held_out.is_usable
        & ~(labels < 1.0).any(axis=1)
        & (posterior[:, bank.no_response_hypothesis_index] < 0.5)
    )
    healthy_responding_rows = np.flatnonzero(is_usable_healthy_and_responding)
    cusum_runs = [
        page_cusum(evidence_increments[healthy_responding_rows[begin:end]], np.inf)
        for begin, end in _begins_and_ends_of_consecutive_rows(healthy_responding_rows)
    ]
    peaks = np.concatenate([extremes.peaks_between_zeros(cusum) for cusum in cusum_runs])
    return peaks, len(healthy_responding_rows) * held_out.samples.dt_s / 3600.0


def _fitted_and_held_out_by_split(
    usable_flights: Sequence[FlightWithUsableRows],
) -> list[tuple[list[FlightWithUsableRows], list[FlightWithUsableRows]]]:
    """Return fitted and left-out parts: halves of one flight, or each flight; of many every twelfth."""
    if len(usable_flights) == 1:
        return [
            (fitted_flights, [held_out]) for fitted_flights, held_out, _ in validation_folds(usable_flights)
        ]
    n_splits = min(len(usable_flights), _MAX_CROSS_VALIDATION_SPLITS)
    held_out_indices_by_split = [
        [i for i in range(len(usable_flights)) if i % n_splits == split] for split in range(n_splits)
    ]
    return [
        (
            [usable_flight for i, usable_flight in enumerate(usable_flights) if i not in held_out_indices],
            [usable_flights[i] for i in held_out_indices],
        )
        for held_out_indices in held_out_indices_by_split
    ]


def group_gain_standard_error(rate_regression: regression.RateRegression, model: Model) -> Floats:
    """Standard error of each group's gain, (G,), colour included: of its response summed over lags, along
    itself, weighed by the noise; for `other_laws` of the factor of the whole response. Where a surface's slow
    effect is made up by the past, as an elevator's by alpha, its sum is not known, and its factor is.

    Responses b with errors of covariance V tell their factor with the variance 1 / (b' V^-1 b).
    """
    n_groups, n_command_lags = len(model.groups), model.n_command_lags
    first_command_row = len(rate_regression.coefficients) - n_groups * n_command_lags
    noise_sd = np.sqrt(np.maximum(np.diag(rate_regression.residual_covariance), MIN_DIVISOR))
    relative_error_sd_of_summed_response = np.zeros(n_groups)
    response_factor_information = np.full(n_groups, MIN_DIVISOR)
    for group_index in range(n_groups):
        group_coefficient_rows = slice(
            first_command_row + group_index * n_command_lags,
            first_command_row + (group_index + 1) * n_command_lags,
        )
        coefficient_error_correlation = rate_regression.coefficient_error_correlation[
            group_coefficient_rows, group_coefficient_rows
        ]
        standard_errors_over_noise_sd = rate_regression.standard_errors[group_coefficient_rows] / noise_sd
        response_sum_over_noise_sd = (
            rate_regression.coefficients[group_coefficient_rows].sum(axis=0) / noise_sd
        )
        summed_response_error_variance = np.einsum(
            "la,lm,ma->a",
            standard_errors_over_noise_sd,
            coefficient_error_correlation,
            standard_errors_over_noise_sd,
        )
        relative_error_sd_of_summed_response[group_index] = np.sqrt(
            response_sum_over_noise_sd**2 @ np.maximum(summed_response_error_variance, 0.0)
        ) / max(float(response_sum_over_noise_sd @ response_sum_over_noise_sd), MIN_DIVISOR)
        response_over_standard_errors = (
            rate_regression.coefficients[group_coefficient_rows]
            / noise_sd
            / np.maximum(standard_errors_over_noise_sd, MIN_DIVISOR)
        )
        response_factor_information[group_index] += np.einsum(
            "la,lm,ma->",
            response_over_standard_errors,
            np.linalg.pinv(coefficient_error_correlation, rcond=_RANK_TOLERANCE),
            response_over_standard_errors,
        )
    return np.minimum(
        1.0 / np.sqrt(response_factor_information)
        if model.vehicle.other_laws
        else relative_error_sd_of_summed_response,
        _GROUP_GAIN_STANDARD_ERROR_CAP,
    )


def prediction_quality_by_fold(
    usable_flights: Sequence[FlightWithUsableRows], model: Model
) -> list[Document]:
    """Compute the explained variance of parts left out, one entry a fold."""
    return [
        {
            "left_out": held_out_name,
            **one_step_prediction_quality(fit_with_same_order(fitted_flights, model), held_out),
        }
        for fitted_flights, held_out, held_out_name in validation_folds(usable_flights)
    ]


def score_folds_and_choose_credible_mass(
    usable_flights: Sequence[FlightWithUsableRows], model: Model
) -> tuple[list[Document], float]:
    """One entry a fold, and the posterior mass with which the bounds hold the labels as they should."""
    fold_entries: list[Document] = []
    coverage_by_fold_and_mass: list[list[float]] = []
    for fitted_flights, held_out, held_out_name in validation_folds(usable_flights):
        fold_model = fit_with_same_order(fitted_flights, model)
        fold_entry: Document = {
            "left_out": held_out_name,
            **one_step_prediction_quality(fold_model, held_out),
        }
        labels = np.where(held_out.is_usable[:, None], held_out.samples.labels, np.nan)
        if np.isfinite(labels).all(axis=1).any():
            diagnosis_rows_by_mass = _diagnosis_rows_by_credible_mass(fold_model, held_out)
            fold_entry["score"] = score_against_labels(
                diagnosis_rows_by_mass[model.settings.credible_mass], labels
            )
            coverage_by_fold_and_mass.append(
                [
                    score_against_labels(diagnosis_rows_by_mass[mass], labels)["held_by_bounds"]
                    for mass in _CREDIBLE_MASS_CANDIDATES
                ]
            )
        fold_entries.append(fold_entry)
    if not coverage_by_fold_and_mass:
        return fold_entries, model.settings.credible_mass
    return fold_entries, _CREDIBLE_MASS_CANDIDATES[
        int(np.argmin(np.abs(np.mean(coverage_by_fold_and_mass, axis=0) - _CREDIBLE_COVERAGE_GOAL)))
    ]


def _diagnosis_rows_by_credible_mass(
    model: Model, held_out: FlightWithUsableRows
) -> dict[float, DiagnosisRows]:
    bank = build_hypothesis_bank(model)
    posterior, _, _ = hypothesis_state_and_noise_posterior(held_out.samples, model, bank)
    settings_per_mass = [
        model.settings.model_copy(update={"credible_mass": mass})
        for mass in {*_CREDIBLE_MASS_CANDIDATES, model.settings.credible_mass}
    ]
    return {
        settings.credible_mass: diagnosis_rows_from_posterior(
            held_out.samples, model.model_copy(update={"settings": settings}), bank, posterior
        )
        for settings in settings_per_mass
    }


def one_step_prediction_quality(model: Model, held_out: FlightWithUsableRows) -> Document:
    """Share of the rates' variance that one-step prediction explains, and the residual, an axis."""
    rows, residual = rows_and_one_step_residuals(model, held_out)
    rates = held_out.samples.rates[rows]
    if not len(rates):
        return {"samples": 0}
    explained_rate_variance_share = 1.0 - residual.var(axis=0) / np.maximum(rates.var(axis=0), MIN_DIVISOR)
    return {
        "samples": len(rates),
        "explained": dict(zip("pqr", explained_rate_variance_share.tolist(), strict=True)),
        "residual_rad_s": dict(zip("pqr", residual.std(axis=0).tolist(), strict=True)),
    }


def rows_whitened_residual_and_responses(
    model: Model, usable_flight: FlightWithUsableRows
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Places (n,) of the samples in use, the unpredicted part of the residual (n, 3), and answers
    (n, G, 3) as they show in it."""
    is_predictable, rates_unexplained_by_past, group_responses = regression.whitened_rates_and_responses(
        usable_flight.samples, model, scales_by_labels=True
    )
    usable_rows = np.flatnonzero(usable_flight.is_usable & is_predictable)
    intercept = model.whitened_intercept(usable_flight.samples.noise_ma_coefficients)
    return (
        usable_rows,
        (rates_unexplained_by_past - group_responses.sum(axis=1) - intercept)[usable_rows],
        group_responses[usable_rows],
    )


def rows_and_one_step_residuals(
    model: Model, usable_flight: FlightWithUsableRows
) -> tuple[NDArray[np.int64], Floats]:
    """Places (n,) of the samples in use, and their one-step residuals (n, 3)."""
    is_predictable, rates_unexplained_by_past, group_responses = regression.unexplained_rates_and_responses(
        usable_flight.samples, model, scales_by_labels=True
    )
    usable_rows = np.flatnonzero(usable_flight.is_usable & is_predictable)
    return usable_rows, (rates_unexplained_by_past - group_responses.sum(axis=1) - np.array(model.intercept))[
        usable_rows
    ]
