"""The whole of an identification: the fit, its tests on what it did not see, and what is said about both."""

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, fitting, gyro_noise, regression, trust
from beaver_ftc_logs.model import FittedRanges, Model, NoiseModel
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import (
    power_spectral_density,
    surface_indices_of_each_group,
    variance_inflation_factors,
)
from beaver_ftc_logs.samples import (
    NOISE_MA_CANDIDATES,
    UNFITTED_GYRO_NOISE_CANDIDATES_RAD_S,
    UNFITTED_NOISE_MA_CANDIDATES,
    Samples,
    whiten_samples,
    with_airspeed_scaling_and_products,
)
from beaver_ftc_logs.vehicle import Vehicle

_MIN_COLLINEAR_VARIANCE_INFLATION = 10.0
_SCORE_TITLES = {
    "classes": "classes", "healthy_or_faulty": "healthy or faulty", "mean_error": "mean error",
    "held_by_bounds": "held by bounds",
}  # fmt: skip
_DECISIVE_BIC_DIFFERENCE = 10.0
"""By how much a criterion must be less: odds of 150 to 1 [Kass1995, section 3.2]."""
_SPECTRUM_BANDS_HZ = ((0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))
FREE_RUN_WINDOW_S = 2.0
_MIN_WINDOWS_AFTER_THINNING = 400
_AIRSPEED_POWER_CANDIDATES = (0.0, 1.0, 3.0)
_MAX_WHITENING_ROUNDS = 8
_MAX_COMMAND_DELAY_S, _MIN_SERVO_LAG_S, _MAX_SERVO_LAG_S = 0.6, 0.005, 1.0


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
    vehicle, assumption_lines = with_assumed_law_and_air(flights, vehicle)
    _check_command_units_alike(flights, vehicle)
    usable_flights = fitting.flights_with_usable_rows(whiten_flights(flights, vehicle))
    model = fitting.fit_model(usable_flights, vehicle)
    check_explained_variance(fitting.prediction_quality_by_fold(usable_flights, model), usable_flights, model)
    model = add_unseen_noise_models(
        fitting.add_fitted_ranges_and_alarm_threshold(usable_flights, model), flights
    )
    fold_entries, credible_mass = fitting.score_folds_and_choose_credible_mass(usable_flights, model)
    identification_results = {
        "assumed": assumption_lines,
        "flights": [_flight_sample_count_entry(usable_flight) for usable_flight in usable_flights],
        "tests": fold_entries,
        "another_day": another_day_scores_and_false_alarms(fold_entries, model),
        "collinear": collinear_regressors(usable_flights, model),
        "colour": median_standard_error_inflation_by_axis(usable_flights, model),
        "spectrum": residual_to_white_density_by_band(usable_flights, model),
        "output_error": fit_output_error(usable_flights, surface_indices_of_each_group(model)),
    }
    settings = model.settings.model_copy(update={"credible_mass": credible_mass})
    return model.model_copy(update={"settings": settings, "identification_results": identification_results})


def add_unseen_noise_models(model: Model, flights: Sequence[Samples]) -> Model:
    """In moving air the model with noise that no fitted flight had: gusts held within a sample or not, and
    noisier gyros, whose colour follows from the model. A law answers noise; which noise a flight has, and how
    much of it, the flight itself shows (`filtering.recent_noise_variance_scale`)."""
    if not model.noise_models:
        return model
    known_ma_coefficients = [tuple(noise_model.ma_coefficients) for noise_model in model.noise_models]
    max_covariance_inflation = max(noise_model.covariance_inflation for noise_model in model.noise_models)
    quietest_covariance = min(
        (np.array(noise_model.residual_covariance) for noise_model in model.noise_models), key=np.linalg.det
    )
    hidden_gain_errors = [model.hidden_gain_error_sd(known) for known in known_ma_coefficients]
    max_hidden_gain_error_sd = np.max(hidden_gain_errors, axis=0).tolist()
    least_usual_power = min(
        (
            noise_model.usual_quick_response_power
            for noise_model in model.noise_models
            if noise_model.usual_quick_response_power is not None
        ),
        default=None,
    )
    noise_models = list(model.noise_models)
    for ma_coefficients in UNFITTED_NOISE_MA_CANDIDATES:
        if ma_coefficients not in known_ma_coefficients:
            usable_whitened_flights = fitting.flights_with_usable_rows(
                [whiten_samples(flight, ma_coefficients) for flight in flights]
            )
            residuals = np.vstack(
                [
                    fitting.rows_and_one_step_residuals(model, usable_flight)[1]
                    for usable_flight in usable_whitened_flights
                ]
            )
            noise_models.append(
                NoiseModel(
                    average=list(ma_coefficients),
                    noise=np.cov(residuals.T).tolist(),
                    wider=max_covariance_inflation,
                    misreads=max_hidden_gain_error_sd,
                    quick=least_usual_power,
                )
            )
    for gyro_noise_rad_s in UNFITTED_GYRO_NOISE_CANDIDATES_RAD_S:
        ar_coefficients, residual_covariance = gyro_noise.residual_predictor_by_yule_walker(
            model, quietest_covariance, gyro_noise_rad_s, fitting.AUTOREGRESSIVE_ORDER
        )
        ar_and_covariance = {"before": ar_coefficients.tolist(), "noise": residual_covariance.tolist()}
        noise_models.append(
            NoiseModel(
                average=[1.0],
                wider=max_covariance_inflation,
                misreads=max_hidden_gain_error_sd,
                quick=least_usual_power,
                **ar_and_covariance,
            )
        )
    return model.model_copy(update={"noise_models": noise_models})


def with_assumed_law_and_air(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with what its file leaves open of laws and air, and a line on each with the reason.

    A log of healthy flight shows neither which law nor which air a later flight has: both are taken to be
    others, which costs power and raises no false alarm. Labelled faults show what they do under the law that
    flies, in the air that there is.
    """
    has_labels = any(np.isfinite(flight.labels).any() for flight in flights)
    reason = "labels show faults under it" if has_labels else "logs of healthy flight do not tell"
    assumption_text_of_key = {"other_laws": "other laws may fly", "moving_air": "the air may move"}
    assumption_lines = []
    for key, assumption_text in assumption_text_of_key.items():
        if getattr(vehicle, key) is None:
            vehicle = vehicle.model_copy(update={key: not has_labels})
            assumption_lines.append(
                f"{key}: {str(not has_labels).lower()}, "
                f"{assumption_text if not has_labels else 'as fitted'} ({reason})"
            )
        else:
            assumption_lines.append(f"{key}: {str(getattr(vehicle, key)).lower()}, as the vehicle file says")
    if vehicle.reference_airspeed_mps is None:
        has_airspeed = any(flight.airspeed is not None for flight in flights)
        no_airspeed_scaling_reason = "explains no more" if has_airspeed else "is not logged"
        assumption_lines.append(f"reference_airspeed_mps: none, the airspeed {no_airspeed_scaling_reason}")
    return vehicle, assumption_lines


def whiten_flights(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """In moving air the flights whitened by the colour that leaves least unexplained of each, and one fit of
    all, in turns.

    A law that answers rates answers their noise: with a residual that is not white, what is noise is taken
    for what the surface does [Ljung1999, section 13.4].
    """
    max_n_rate_lags = max(fitting.RATE_LAG_COUNT_CANDIDATES)
    # the commands get as many lags as the rates, not as many as they have at most: the results rest on it
    whitening_lag_counts = max_n_rate_lags, max_n_rate_lags
    if not vehicle.moving_air:
        return list(flights)
    ma_coefficients_by_flight = [
        _choose_noise_ma_coefficients(flight, vehicle, whitening_lag_counts) for flight in flights
    ]
    whitened_flights = [
        whiten_samples(flight, noise_ma_coefficients)
        for flight, noise_ma_coefficients in zip(flights, ma_coefficients_by_flight, strict=True)
    ]
    for _ in range(_MAX_WHITENING_ROUNDS):
        regressors, rates, _ = fitting.stacked_regression_data(
            fitting.flights_with_usable_rows(whitened_flights), vehicle, *whitening_lag_counts
        )
        pooled_regression_coefficients = np.linalg.lstsq(regressors, rates, rcond=None)[0]
        log_determinants_and_ma_coefficients = [
            _log_determinant_and_best_ma_coefficients(
                fitting.flights_with_usable_rows([flight]),
                vehicle,
                whitening_lag_counts,
                np.asarray(pooled_regression_coefficients),
            )
            for flight in flights
        ]
        if (
            new_ma_coefficients_by_flight := [
                noise_ma_coefficients for _, noise_ma_coefficients in log_determinants_and_ma_coefficients
            ]
        ) == ma_coefficients_by_flight:
            break
        mean_log_determinant = np.mean(
            [log_determinant for log_determinant, _ in log_determinants_and_ma_coefficients]
        )
        ma_coefficients_by_flight = new_ma_coefficients_by_flight
        whitened_flights = [
            whiten_samples(
                flight, noise_ma_coefficients, float(np.exp((mean_log_determinant - log_determinant) / 6.0))
            )
            for flight, (log_determinant, noise_ma_coefficients) in zip(
                flights, log_determinants_and_ma_coefficients, strict=True
            )
        ]
    return whitened_flights


def _choose_noise_ma_coefficients(
    flight: Samples, vehicle: Vehicle, whitening_lag_counts: tuple[int, int]
) -> tuple[float, ...]:
    """The colour of which a fit to one flight alone leaves least: the likeliest of an ARMAX model, by
    profile likelihood over the moving averages."""

    def residual_log_determinant(noise_ma_coefficients: tuple[float, ...]) -> float:
        regressors, rates, _ = fitting.stacked_regression_data(
            fitting.flights_with_usable_rows([whiten_samples(flight, noise_ma_coefficients)]),
            vehicle,
            *whitening_lag_counts,
        )
        if len(rates) < 2:
            raise BadInput(
                f"identify: {flight.name}: {len(rates)} samples known to be healthy, allowed: at least 2"
            )
        residual = rates - regressors @ np.linalg.lstsq(regressors, rates, rcond=None)[0]
        return float(np.linalg.slogdet(np.cov(residual.T))[1]) - 6.0 * float(
            np.log(sum(noise_ma_coefficients))
        )

    return min(NOISE_MA_CANDIDATES, key=residual_log_determinant)


def _log_determinant_and_best_ma_coefficients(
    usable_flights: list[fitting.FlightWithUsableRows],
    vehicle: Vehicle,
    whitening_lag_counts: tuple[int, int],
    coefficients: Floats,
) -> tuple[float, tuple[float, ...]]:
    """The colour of a flight, and the log determinant of the residual that it leaves."""
    from scipy.signal import lfilter

    regressors, rates, _ = fitting.stacked_regression_data(usable_flights, vehicle, *whitening_lag_counts)
    residual = rates - regressors @ coefficients
    log_determinant_by_ma = {
        ma_coefficients: np.linalg.slogdet(np.cov(lfilter([1.0], ma_coefficients, residual, axis=0).T))[1]
        for ma_coefficients in NOISE_MA_CANDIDATES
    }
    best_ma_coefficients = min(
        log_determinant_by_ma, key=lambda ma_coefficients: float(log_determinant_by_ma[ma_coefficients])
    )
    return float(log_determinant_by_ma[best_ma_coefficients]) + 6.0 * float(
        np.log(sum(best_ma_coefficients))
    ), best_ma_coefficients


def another_day_scores_and_false_alarms(fold_entries: list[Document], model: Model) -> Document:
    """Estimate the errors on a day that was not fitted, by parts left out: worst and mean of every figure of
    merit, false alarms an hour and how sure that is, and how many minutes would show it."""
    scores = [fold_entry["score"] for fold_entry in fold_entries if "score" in fold_entry]
    fold_values_by_score_key = {
        key: [fold_score[key] for fold_score in scores] for key in _SCORE_TITLES if scores
    }
    expected_performance: Document = {
        key: {
            "mean": float(np.mean(fold_values)),
            "worst": float((max if key == "mean_error" else min)(fold_values)),
        }
        for key, fold_values in fold_values_by_score_key.items()
    }
    fitted_ranges, settings = model.fitted_ranges, model.settings
    if fitted_ranges is None or fitted_ranges.alarm_peak_tail is None or settings.alarm_threshold is None:
        return expected_performance
    target_false_alarms_per_hour = settings.false_alarms_per_hour or 0.0
    return expected_performance | {
        "false_alarms_per_hour": {
            "asked": target_false_alarms_per_hour,
            **asdict(
                extremes.expected_false_alarms_per_hour(
                    fitted_ranges.alarm_peak_tail, settings.alarm_threshold
                )
            ),
        },
        "minutes_left_out": fitted_ranges.alarm_peak_tail.healthy_minutes,
        "minutes_missing": extremes.missing_healthy_minutes(
            fitted_ranges.alarm_peak_tail, target_false_alarms_per_hour
        ),
        **model.identification_results,
    }


def scale_by_dynamic_pressure_if_better(
    flights: Sequence[Samples], vehicle: Vehicle
) -> tuple[Sequence[Samples], Vehicle]:
    """Flights with commands times the dynamic pressure, and the vehicle that says so, where the airspeed is
    known and this explains more; else both as they are."""
    none_by_unset_vehicle_key = {
        key: None for key in ("other_laws", "moving_air") if getattr(vehicle, key) is None
    }
    scaled_flights, scaled_vehicle = _scale_flights_and_vehicle_if_better(
        flights, with_assumed_law_and_air(flights, vehicle)[0] if none_by_unset_vehicle_key else vehicle
    )
    return scaled_flights, scaled_vehicle.model_copy(
        update=none_by_unset_vehicle_key
    ) if none_by_unset_vehicle_key else scaled_vehicle


def _scale_flights_and_vehicle_if_better(
    flights: Sequence[Samples], vehicle: Vehicle
) -> tuple[Sequence[Samples], Vehicle]:
    airspeeds_by_flight = [
        flight.airspeed[np.isfinite(flight.airspeed)] for flight in flights if flight.airspeed is not None
    ]
    known_airspeeds_mps = np.concatenate(airspeeds_by_flight) if airspeeds_by_flight else np.empty(0)
    reference_airspeed_mps = float(np.median(known_airspeeds_mps)) if known_airspeeds_mps.size else 0.0
    if vehicle.reference_airspeed_mps is not None or reference_airspeed_mps <= 0.0:
        return flights, vehicle
    scaled_flights = [
        with_airspeed_scaling_and_products(flight, reference_airspeed_mps, vehicle.surface_airspeed_powers)
        for flight in flights
    ]
    scaled_vehicle = vehicle.model_copy(update={"reference_airspeed_mps": reference_airspeed_mps})
    if _min_bic(flights, vehicle) - _min_bic(scaled_flights, scaled_vehicle) < _DECISIVE_BIC_DIFFERENCE:
        return flights, vehicle
    return (
        _scale_by_best_airspeed_powers(flights, scaled_vehicle)
        if vehicle.other_laws
        else (scaled_flights, scaled_vehicle)
    )


def _min_bic(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion of any order."""
    return min(fitting.bic_by_order(fitting.flights_with_usable_rows(flights), vehicle).values())


def _scale_by_best_airspeed_powers(
    flights: Sequence[Samples], vehicle: Vehicle
) -> tuple[list[Samples], Vehicle]:
    """Each surface, or group, in its turn with the power of the airspeed that explains most: slipstream and
    linkages change the square. Another than that must explain decisively more."""

    scaled_flights = [
        with_airspeed_scaling_and_products(
            flight, vehicle.reference_airspeed_mps or 0.0, vehicle.surface_airspeed_powers
        )
        for flight in flights
    ]
    whitened_flights = whiten_flights(
        scaled_flights, vehicle
    )  # a criterion believes each sample, as only white noise lets it

    def scale_and_optionally_whiten_flights(
        scaled_vehicle: Vehicle, whitens_if_air_moves: bool = True
    ) -> list[Samples]:
        rescaled_flights = [
            with_airspeed_scaling_and_products(
                flight, scaled_vehicle.reference_airspeed_mps or 0.0, scaled_vehicle.surface_airspeed_powers
            )
            for flight in flights
        ]
        if not (whitens_if_air_moves and vehicle.moving_air):
            return rescaled_flights
        return [
            whiten_samples(rescaled_flight, whitened_flight.noise_ma_coefficients, whitened_flight.fit_weight)
            for rescaled_flight, whitened_flight in zip(rescaled_flights, whitened_flights, strict=True)
        ]

    bic_to_beat = _min_bic(scale_and_optionally_whiten_flights(vehicle), vehicle) - _DECISIVE_BIC_DIFFERENCE
    surface_names = list(vehicle.surfaces)
    for surface_indices in regression.group_surfaces_by_commands(vehicle):
        for airspeed_power in _AIRSPEED_POWER_CANDIDATES:
            candidate_power_by_surface = vehicle.airspeed_powers | {
                surface_names[i]: airspeed_power for i in surface_indices
            }
            candidate_vehicle = vehicle.model_copy(update={"airspeed_powers": candidate_power_by_surface})
            if (
                bic := _min_bic(scale_and_optionally_whiten_flights(candidate_vehicle), candidate_vehicle)
            ) < bic_to_beat:
                bic_to_beat, vehicle = bic, candidate_vehicle
    return scale_and_optionally_whiten_flights(vehicle, whitens_if_air_moves=False), vehicle


def check_explained_variance(
    fold_entries: list[Document], usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> None:
    """Raise BadInput where a model explains less of an axis than its mean does, on parts not fitted."""
    entries_with_samples = [fold_entry for fold_entry in fold_entries if fold_entry["samples"]]
    sample_counts = [fold_entry["samples"] for fold_entry in entries_with_samples]
    explained_shares_by_axis = {
        axis: [fold_entry["explained"][axis] for fold_entry in entries_with_samples] for axis in "pqr"
    }
    mean_explained_share_by_axis = {
        axis: float(np.average(fold_values, weights=sample_counts))
        for axis, fold_values in explained_shares_by_axis.items()
        if entries_with_samples
    }
    if explained_share_by_unexplained_axis := {
        axis: explained_share
        for axis, explained_share in mean_explained_share_by_axis.items()
        if explained_share <= 0.0
    }:
        usable_minutes = (
            sum(
                int(usable_flight.is_usable.sum()) * usable_flight.samples.dt_s
                for usable_flight in usable_flights
            )
            / 60.0
        )
        stillest_surface_and_sd = min(
            _command_sd_by_surface(usable_flights, model).items(), key=lambda pair: pair[1]
        )
        raise BadInput(
            "identify: on parts it was not fitted on the model explains less of "
            f"{', '.join(explained_share_by_unexplained_axis)} than the "
            f"mean does ({_values_by_axis_text(explained_share_by_unexplained_axis)}), allowed: a model that "
            "explains more; what would "
            f"help: more than these {usable_minutes:.1f} min, commands that move more "
            f"({stillest_surface_and_sd[0]} has a standard "
            f"deviation of {stillest_surface_and_sd[1]:.2g}), or the commands that this vehicle follows"
            f"{_rate_mistakes_text(usable_flights, model)}"
        )


def _check_command_units_alike(flights: Sequence[Samples], vehicle: Vehicle) -> None:
    """Raise BadInput where a flight's command is in another unit than that of the first."""
    first_flight_ranges = FittedRanges(
        commands=trust.central_ranges(flights[0].commands), rates=trust.central_ranges(flights[0].rates)
    )
    for flight in flights[1:]:
        trust.refuse_commands_in_other_unit(
            flight.name, flight.commands, flight.rates, first_flight_ranges, list(vehicle.surfaces)
        )


def _rate_mistakes_text(usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model) -> str:
    """Return the mistakes found in the rates when the log was read, each after a semicolon."""
    rate_column_prefixes = tuple(f"{getattr(model.vehicle.rates, axis).column}:" for axis in "pqr")
    notes = [
        note
        for usable_flight in usable_flights
        for note in usable_flight.samples.notes
        if note.startswith(rate_column_prefixes)
    ]
    return "".join(f"; {note}" for note in notes)


def _command_sd_by_surface(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> dict[str, float]:
    """Standard deviation of each surface's command."""
    commands = np.vstack(
        [usable_flight.samples.commands[usable_flight.is_usable] for usable_flight in usable_flights]
    )
    return dict(zip(model.vehicle.surfaces, np.nanstd(commands, axis=0).tolist(), strict=True))


def _flight_sample_count_entry(usable_flight: fitting.FlightWithUsableRows) -> Document:
    samples, is_usable = usable_flight.samples, usable_flight.is_usable
    return {
        "name": samples.name,
        "samples": int(is_usable.sum()),
        "of": len(is_usable),
        "notes": list(samples.notes),
    }


def collinear_regressors(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first; None where
    the others make it up."""
    regressors, _, _ = fitting.stacked_regression_data(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    inflation_factors = variance_inflation_factors(regressors[:, 1:])
    names_and_inflation_factors = sorted(
        zip(regressor_names(model), inflation_factors.tolist(), strict=True), key=lambda pair: -pair[1]
    )
    collinear_names_and_factors = [
        (name, inflation_factor if isfinite(inflation_factor) else None)
        for name, inflation_factor in names_and_inflation_factors
        if inflation_factor > _MIN_COLLINEAR_VARIANCE_INFLATION
    ]
    return [
        {"regressor": name, "inflation": inflation_factor}
        for name, inflation_factor in collinear_names_and_factors
    ]


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    lagged_rate_names = [f"{rate}[-{k}]" for k in range(1, model.n_rate_lags + 1) for rate in "pqr"]
    signal_lags = range(1, model.vehicle.n_signal_lags(model.n_rate_lags) + 1)
    lagged_signal_names = [
        f"{name}[-{k}]" for k in signal_lags for name in model.vehicle.signal_regressor_names
    ]
    command_lags, group_names = range(1, model.n_command_lags + 1), map("+".join, model.groups)
    return (
        lagged_rate_names
        + lagged_signal_names
        + [f"command of {group}[-{k}]" for group in group_names for k in command_lags]
    )


def median_standard_error_inflation_by_axis(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> dict[str, float]:
    """By how much the residual's colour widens the standard errors of the responses: the median, an axis."""
    rate_regression = fitting.fit_least_squares_of_order(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    first_command_row = (
        len(rate_regression.standard_error_inflation) - len(model.groups) * model.n_command_lags
    )
    return dict(
        zip(
            "pqr",
            np.median(rate_regression.standard_error_inflation[first_command_row:], axis=0).tolist(),
            strict=True,
        )
    )


def residual_to_white_density_by_band(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> list[Document]:
    """Mean density of the residual by band, over that of white noise of the same variance, an axis."""
    residual = np.vstack(
        [fitting.rows_and_one_step_residuals(model, usable_flight)[1] for usable_flight in usable_flights]
    )
    frequency_hz, density = power_spectral_density(residual, 1.0 / model.rate_hz)
    white_density = residual.var(axis=0) / (0.5 * model.rate_hz)
    band_density_ratio_records = []
    for low_hz, high_hz in _SPECTRUM_BANDS_HZ:
        is_in_band = (frequency_hz > low_hz) & (frequency_hz <= high_hz)
        if is_in_band.any():
            density_ratio = (density[is_in_band].mean(axis=0) / white_density).tolist()
            band_density_ratio_records.append(
                {"from_hz": low_hz, "to_hz": high_hz, **dict(zip("pqr", density_ratio, strict=True))}
            )
    return band_density_ratio_records


def identification_text(model: Model) -> str:
    """Return the identification as lines of text."""
    results: Document = dict(model.identification_results)
    n_samples = sum(flight["samples"] for flight in results["flights"])
    lines = [
        f"{model.vehicle.name}: {n_samples} samples at {model.rate_hz:.3g} Hz, flights: "
        f"{len(results['flights'])}; "
        f"past samples of the rates: {model.n_rate_lags}, of the commands: {model.n_command_lags}",
        *(f"  {line}" for line in results.get("assumed", [])),
        *(f"  together, not distinguishable: {', '.join(group)}" for group in model.groups if len(group) > 1),
        *_dynamic_pressure_sentences(model),
        *dict.fromkeys(
            f"  noise of the colour {_ma_coefficients_text(noise_model)}: "
            f"{noise_model.covariance_inflation:.2g} times as wide, in squares, as gains of 10 s left out "
            "differ, and other laws may"
            for noise_model in model.noise_models
        ),
        *(f"  {line}" for line in trust.unknown_effect_sentences(model)),
        *(f"  {flight['name']}: {note}" for flight in results["flights"] for note in flight["notes"]),
        *map(_left_out_test_text, results["tests"]),
        *_another_day_sentences(results["another_day"], len(results["flights"])),
        f"  the residual's colour widens standard errors by {_values_by_axis_text(results['colour'])}",
    ]
    output_error = results["output_error"]
    if "delay_s" in output_error:
        lines.append(
            f"  output error: servo lag {_servo_lag_or_too_short_text(output_error)}, delay "
            f"{output_error['delay_s']:.3f} s (sd {output_error['delay_sd_s']:.3f}), explains "
            "of 2 s free runs not fitted "
            f"{_values_by_axis_text(output_error['explained_of_windows_not_fitted'])}"
        )
    if results["collinear"]:
        most_collinear_entry, n_collinear = results["collinear"][0], len(results["collinear"])
        lines.append(
            f"  {n_collinear} {'regressors are' if n_collinear > 1 else 'regressor is'} "
            "collinear (variance inflated over "
            f"{_MIN_COLLINEAR_VARIANCE_INFLATION:g} times), most {most_collinear_entry['regressor']} "
            f"({_inflation_factor_text(most_collinear_entry['inflation'])})"
        )
    return "\n".join(lines)


def _ma_coefficients_text(noise_model: NoiseModel) -> str:
    return ", ".join(f"{coefficient:.3g}" for coefficient in noise_model.ma_coefficients)


def _another_day_sentences(expected_performance: Document, n_flights: int) -> list[str]:
    """Return lines on flights that were not fitted; one flight informs on its halves, not on another day."""
    left_out_unit_text = (
        "another day, each left out in turn"
        if n_flights > 1
        else "another half of this day, not of another day"
    )
    lines = []
    if "classes" in expected_performance:
        mean_and_worst_score_texts = [
            f"{title} {expected_performance[key]['mean']:.3f} ({expected_performance[key]['worst']:.3f})"
            for key, title in _SCORE_TITLES.items()
        ]
        lines.append(
            f"  expect of {left_out_unit_text}, mean (worst): {', '.join(mean_and_worst_score_texts)}"
        )
    if "false_alarms_per_hour" in expected_performance:
        false_alarm_entry = expected_performance["false_alarms_per_hour"]
        missing_minutes = expected_performance["minutes_missing"]
        lines.append(
            f"  false alarms: {false_alarm_entry['asked']:g} an hour asked for, "
            f"{false_alarm_entry['low']:.2g} to {false_alarm_entry['high']:.2g} at 90 %, "
            f"by {expected_performance['minutes_left_out']:.1f} min of health left out"
        )
        if missing_minutes:
            lines.append(
                f"  to show this rate without a fitted tail {missing_minutes:.0f} min of health are missing"
            )
        if expected_performance.get("parts"):
            alarmed_text = (
                f"{expected_performance['alarmed']} of {expected_performance['parts']} parts left out alarm"
            )
            lines.append(f"  at the threshold of the others {alarmed_text}")
    return lines


def _dynamic_pressure_sentences(model: Model) -> list[str]:
    if (reference_airspeed_mps := model.vehicle.reference_airspeed_mps) is None:
        return []
    powers_text = "".join(
        f", {surface} with airspeed^{power:g}"
        for surface, power in model.vehicle.airspeed_powers.items()
        if power != 2
    )
    return [f"  surfaces work with the dynamic pressure, 1 at {reference_airspeed_mps:.4g} m/s{powers_text}"]


def _left_out_test_text(fold_entry: Document) -> str:
    if not fold_entry["samples"]:
        return f"  without {fold_entry['left_out']}: nothing in it is known"
    line = (
        f"  without {fold_entry['left_out']}: explains {_values_by_axis_text(fold_entry['explained'])} of it"
    )
    if "score" not in fold_entry:
        return line
    scores = fold_entry["score"]
    return (
        f"{line}; {len(scores['settings'])} classes {scores['classes']:.3f}, healthy or faulty "
        f"{scores['healthy_or_faulty']:.3f}, side {scores['side']:.3f}, mean error {scores['mean_error']:.3f}"
    )


def _servo_lag_or_too_short_text(output_error_fit: Document) -> str:
    if output_error_fit["shorter_than_can_be_told"]:
        return "shorter than this rate can tell"
    return f"{output_error_fit['servo_lag_s']:.3f} s (sd {output_error_fit['servo_lag_sd_s']:.3f})"


def _inflation_factor_text(inflation_factor: float | None) -> str:
    return "made up by the others" if inflation_factor is None else f"{inflation_factor:.0f} times"


def _values_by_axis_text(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())


def fit_output_error(
    usable_flights: Sequence[fitting.FlightWithUsableRows], surface_groups: list[list[int]]
) -> dict[str, Any]:
    """Fit on every other window, test on the rest. Returns servo lag and delay in s, their standard errors,
    and the share of the rates' variance explained over free-running windows not fitted, an axis."""
    from scipy.optimize import least_squares

    dt_s = float(np.median([usable_flight.samples.dt_s for usable_flight in usable_flights]))
    window_commands, window_rates = _cut_free_run_windows(
        usable_flights,
        surface_groups,
        round(FREE_RUN_WINDOW_S / dt_s),
        round(_MAX_COMMAND_DELAY_S / dt_s) + 1,
    )
    if len(window_rates) < 20 or not np.ptp(window_rates, axis=(0, 1)).all():
        return {"windows": len(window_rates), "says": "too few gap-free windows in which every rate moves"}
    fitted_window_slice, held_out_window_slice = slice(0, None, 2), slice(1, None, 2)
    rate_sd = window_rates.std(axis=(0, 1))
    initial_parameters, min_parameters, max_parameters = _output_error_fixed_guess_and_bounds(
        len(surface_groups), dt_s
    )

    def standardized_simulation_error(parameters: Floats, window_slice: slice) -> Floats:
        simulated_rates = _simulate_free_runs(
            parameters, window_commands[window_slice], window_rates[window_slice], dt_s
        )
        return ((simulated_rates - window_rates[window_slice]) / rate_sd).ravel()

    optimum = least_squares(
        standardized_simulation_error,
        initial_parameters,
        bounds=(min_parameters, max_parameters),
        args=(fitted_window_slice,),
        loss="soft_l1",
        max_nfev=40,
    )
    inverse_information = np.linalg.pinv(optimum.jac.T @ optimum.jac)
    standard_errors = np.sqrt(
        np.maximum(np.diag(inverse_information), 0.0) * float(optimum.fun @ optimum.fun) / len(optimum.fun)
    )
    held_out_simulation_errors_rad_s = (
        standardized_simulation_error(optimum.x, held_out_window_slice).reshape(-1, 3) * rate_sd
    )
    explained_rate_variance_share = 1.0 - held_out_simulation_errors_rad_s.var(axis=0) / window_rates[
        held_out_window_slice
    ].reshape(-1, 3).var(axis=0)
    return {
        "windows": len(window_rates),
        "servo_lag_s": float(optimum.x[0]),
        "servo_lag_sd_s": float(standard_errors[0]),
        "delay_s": float(optimum.x[1]),
        "delay_sd_s": float(standard_errors[1]),
        "shorter_than_can_be_told": bool(optimum.x[0] < 2.0 * _MIN_SERVO_LAG_S),
        "explained_of_windows_not_fitted": dict(
            zip("pqr", explained_rate_variance_share.tolist(), strict=True)
        ),
    }


def _cut_free_run_windows(
    usable_flights: Sequence[fitting.FlightWithUsableRows],
    surface_groups: list[list[int]],
    window_samples: int,
    n_past_samples: int,
) -> tuple[Floats, Floats]:
    """Commands (W, n_past_samples + window_samples, G) with their past, scaled by labels, and rates (W,
    window_samples, 3)."""
    window_commands, window_rates = [], []
    for usable_flight in usable_flights:
        samples = usable_flight.samples
        effectiveness = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
        effective_group_commands = np.column_stack(
            [
                (samples.commands * effectiveness)[:, surface_indices].sum(axis=1)
                for surface_indices in surface_groups
            ]
        )
        is_usable = (
            usable_flight.is_usable
            & np.isfinite(effective_group_commands).all(axis=1)
            & np.isfinite(samples.rates).all(axis=1)
        )
        for window_end in range(n_past_samples + window_samples, len(is_usable), window_samples):
            window_rows = slice(window_end - n_past_samples - window_samples, window_end)
            if (
                is_usable[window_rows].all()
                and samples.stretch_number[window_rows.start] == samples.stretch_number[window_end - 1]
            ):
                window_commands.append(effective_group_commands[window_rows])
                window_rates.append(samples.rates[window_end - window_samples : window_end])
    window_thinning_factor = max(len(window_rates) // _MIN_WINDOWS_AFTER_THINNING, 1)
    window_commands_shape = (-1, n_past_samples + window_samples, len(surface_groups))
    return np.reshape(window_commands[::window_thinning_factor], window_commands_shape), np.reshape(
        window_rates[::window_thinning_factor], (-1, window_samples, 3)
    )


def _output_error_fixed_guess_and_bounds(n_groups: int, dt_s: float) -> tuple[Floats, Floats, Floats]:
    """First guess and bounds of lag, delay, A, B and c."""
    initial_parameters = [0.1, dt_s, *(0.7 * np.eye(3)).ravel(), *np.full(3 * n_groups, 0.01), *np.zeros(3)]
    infinite_bounds = np.full(len(initial_parameters) - 2, np.inf)
    min_parameters = [_MIN_SERVO_LAG_S, 0.0, *-infinite_bounds]
    max_parameters = [_MAX_SERVO_LAG_S, _MAX_COMMAND_DELAY_S, *infinite_bounds]
    return np.array(initial_parameters), np.array(min_parameters), np.array(max_parameters)


def _simulate_free_runs(
    parameters: Floats, window_commands: Floats, measured_rates: Floats, dt_s: float
) -> Floats:
    """Free runs of all windows at once, (W, window_samples, 3)."""
    n_groups = window_commands.shape[2]
    servo_lag_s, delay_s = parameters[:2]
    rate_transition = parameters[2:11].reshape(3, 3)
    rate_step_per_servo_position = parameters[11 : 11 + 3 * n_groups].reshape(n_groups, 3)
    constant_rate_step = parameters[11 + 3 * n_groups :]
    window_samples = measured_rates.shape[1]
    n_past_samples = window_commands.shape[1] - window_samples
    whole_delay_samples, delay_fraction = divmod(delay_s / dt_s, 1.0)
    servo_retention = np.exp(-dt_s / servo_lag_s)
    current_simulated_rates, servo_positions = measured_rates[:, 0].copy(), window_commands[:, 0].copy()
    simulated_rates = np.empty_like(measured_rates)
    for k in range(window_commands.shape[1]):
        if k >= n_past_samples:
            simulated_rates[:, k - n_past_samples] = current_simulated_rates
            current_simulated_rates = (
                current_simulated_rates @ rate_transition.T
                + servo_positions @ rate_step_per_servo_position
                + constant_rate_step
            )
        rows_around_delayed_time = (
            max(k - int(whole_delay_samples), 0),
            max(k - int(whole_delay_samples) - 1, 0),
        )
        delayed_command = (1.0 - delay_fraction) * window_commands[
            :, rows_around_delayed_time[0]
        ] + delay_fraction * window_commands[:, rows_around_delayed_time[1]]
        servo_positions = servo_retention * servo_positions + (1.0 - servo_retention) * delayed_command
    return simulated_rates
