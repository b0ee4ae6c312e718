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
    surface_indices_by_group,
    variance_inflation_factors,
)
from beaver_ftc_logs.samples import (
    NOISE_MA_CANDIDATES,
    UNSEEN_GYRO_NOISE_RAD_S,
    UNSEEN_NOISE_MA_COEFFICIENTS,
    Samples,
    scale_by_dynamic_pressure,
    whiten_samples,
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
_MAX_FREE_RUN_WINDOWS = 400
_AIRSPEED_POWER_CANDIDATES = (0.0, 1.0, 3.0)
_MAX_WHITENING_ROUNDS = 8
_MAX_COMMAND_DELAY_S, _MIN_SERVO_LAG_S, _MAX_SERVO_LAG_S = 0.6, 0.005, 1.0


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
    vehicle, assumption_lines = with_assumed_law_and_air(flights, vehicle)
    _check_command_units_alike(flights, vehicle)
    usable_flights = fitting.flights_with_usable_rows(whiten_flights(flights, vehicle))
    model = fitting.fit_model(usable_flights, vehicle)
    check_explained_variance(fitting.explained_variance_by_fold(usable_flights, model), usable_flights, model)
    model = add_unseen_noise_models(
        fitting.add_fitted_ranges_and_alarm_threshold(usable_flights, model), flights
    )
    tests, bounds = fitting.score_folds_and_choose_credible_mass(usable_flights, model)
    identified = {
        "assumed": assumption_lines,
        "flights": [_used_samples_entry(usable_flight) for usable_flight in usable_flights],
        "tests": tests,
        "another_day": expected_performance_on_another_day(tests, model),
        "collinear": collinear_regressors(usable_flights, model),
        "colour": median_standard_error_inflation_by_axis(usable_flights, model),
        "spectrum": residual_spectrum(usable_flights, model),
        "output_error": fit_output_error(usable_flights, surface_indices_by_group(model)),
    }
    settings = model.settings.model_copy(update={"credible_mass": bounds})
    return model.model_copy(update={"settings": settings, "identification_results": identified})


def add_unseen_noise_models(model: Model, flights: Sequence[Samples]) -> Model:
    """In moving air the model with noise that no fitted flight had: gusts held within a sample or not, and
    noisier gyros, whose colour follows from the model. A law answers noise; which noise a flight has, and how
    much of it, the flight itself shows (`filtering.recent_noise_variance_scale`)."""
    if not model.noise_models:
        return model
    known_averages, max_inflation = (
        [tuple(one.ma_coefficients) for one in model.noise_models],
        max(one.covariance_inflation for one in model.noise_models),
    )
    quietest_noise = min((np.array(one.residual_covariance) for one in model.noise_models), key=np.linalg.det)
    colours = list(model.noise_models)
    for average in UNSEEN_NOISE_MA_COEFFICIENTS:
        if average not in known_averages:
            whitened_flights = fitting.flights_with_usable_rows(
                [whiten_samples(one, average) for one in flights]
            )
            residuals = np.vstack([fitting.one_step_residuals(model, one)[1] for one in whitened_flights])
            colours.append(
                NoiseModel(average=list(average), noise=np.cov(residuals.T).tolist(), wider=max_inflation)
            )
    for gyro_noise_rad_s in UNSEEN_GYRO_NOISE_RAD_S:
        predictor, noise = gyro_noise.residual_predictor_by_yule_walker(
            model, quietest_noise, gyro_noise_rad_s, fitting.AUTOREGRESSIVE_ORDER
        )
        predictor_and_noise = {"before": predictor.tolist(), "noise": noise.tolist()}
        colours.append(NoiseModel(average=[1.0], wider=max_inflation, **predictor_and_noise))
    return model.model_copy(update={"noise_models": colours})


def with_assumed_law_and_air(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with what its file leaves open of laws and air, and a line on each with the reason.

    A log of healthy flight shows neither which law nor which air a later flight has: both are taken to be
    others, which costs power and raises no false alarm. Labelled faults show what they do under the law that
    flies, in the air that there is.
    """
    has_labels = any(np.isfinite(one.labels).any() for one in flights)
    reason = "labels show faults under it" if has_labels else "logs of healthy flight do not tell"
    assumption_of_key, lines = {"other_laws": "other laws may fly", "moving_air": "the air may move"}, []
    for key, assumption in assumption_of_key.items():
        if getattr(vehicle, key) is None:
            vehicle = vehicle.model_copy(update={key: not has_labels})
            lines.append(
                f"{key}: {str(not has_labels).lower()}, "
                f"{assumption if not has_labels else 'as fitted'} ({reason})"
            )
        else:
            lines.append(f"{key}: {str(getattr(vehicle, key)).lower()}, as the vehicle file says")
    if vehicle.reference_airspeed_mps is None:
        has_airspeed = any(one.airspeed is not None for one in flights)
        what = "explains no more" if has_airspeed else "is not logged"
        lines.append(f"reference_airspeed_mps: none, the airspeed {what}")
    return vehicle, lines


def whiten_flights(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """In moving air the flights whitened by the colour that leaves least unexplained of each, and one fit of
    all, in turns.

    A law that answers rates answers their noise: with a residual that is not white, what is noise is taken
    for what the surface does [Ljung1999, section 13.4].
    """
    rate_and_command_lags = max(fitting.RATE_LAG_COUNT_CANDIDATES), max(fitting.RATE_LAG_COUNT_CANDIDATES)
    if not vehicle.moving_air:
        return list(flights)
    noise_averages = [_choose_noise_ma_coefficients(one, vehicle, rate_and_command_lags) for one in flights]
    whitened_flights = [
        whiten_samples(one, noise_ma_coefficients)
        for one, noise_ma_coefficients in zip(flights, noise_averages, strict=True)
    ]
    for _ in range(_MAX_WHITENING_ROUNDS):
        regressors, rates, _ = fitting.stacked_regression_data(
            fitting.flights_with_usable_rows(whitened_flights), vehicle, *rate_and_command_lags
        )
        coefficients = np.linalg.lstsq(regressors, rates, rcond=None)[0]
        best_averages = [
            _log_determinant_and_best_ma_coefficients(
                fitting.flights_with_usable_rows([one]),
                vehicle,
                rate_and_command_lags,
                np.asarray(coefficients),
            )
            for one in flights
        ]
        if (
            new_averages := [noise_ma_coefficients for _, noise_ma_coefficients in best_averages]
        ) == noise_averages:
            break
        mean_score, noise_averages = np.mean([score for score, _ in best_averages]), new_averages
        whitened_flights = [
            whiten_samples(one, noise_ma_coefficients, float(np.exp((mean_score - score) / 6.0)))
            for one, (score, noise_ma_coefficients) in zip(flights, best_averages, strict=True)
        ]
    return whitened_flights


def _choose_noise_ma_coefficients(
    flight: Samples, vehicle: Vehicle, rate_and_command_lags: tuple[int, int]
) -> tuple[float, ...]:
    """The colour of which a fit to one flight alone leaves least: the likeliest of an ARMAX model, by
    profile likelihood over the moving averages."""

    def residual_log_determinant(noise_ma_coefficients: tuple[float, ...]) -> float:
        regressors, rates, _ = fitting.stacked_regression_data(
            fitting.flights_with_usable_rows([whiten_samples(flight, noise_ma_coefficients)]),
            vehicle,
            *rate_and_command_lags,
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
    usable_flight: list[fitting.FlightWithUsableRows],
    vehicle: Vehicle,
    rate_and_command_lags: tuple[int, int],
    coefficients: Floats,
) -> tuple[float, tuple[float, ...]]:
    """The colour of a flight, and the log determinant of the residual that it leaves."""
    from scipy.signal import lfilter

    regressors, rates, _ = fitting.stacked_regression_data(usable_flight, vehicle, *rate_and_command_lags)
    residual = rates - regressors @ coefficients
    log_determinants = {
        one: np.linalg.slogdet(np.cov(lfilter([1.0], one, residual, axis=0).T))[1]
        for one in NOISE_MA_CANDIDATES
    }
    best_average = min(log_determinants, key=lambda one: float(log_determinants[one]))
    return float(log_determinants[best_average]) + 6.0 * float(np.log(sum(best_average))), best_average


def expected_performance_on_another_day(tests: list[Document], model: Model) -> Document:
    """Estimate the errors on a day that was not fitted, by parts left out: worst and mean of every figure of
    merit, false alarms an hour and how sure that is, and how many minutes would show it."""
    scores = [test["score"] for test in tests if "score" in test]
    values_of_score = {key: [score[key] for score in scores] for key in _SCORE_TITLES if scores}
    expected: Document = {
        key: {"mean": float(np.mean(values)), "worst": float((max if key == "mean_error" else min)(values))}
        for key, values in values_of_score.items()
    }
    fitted_ranges, settings = model.fitted_ranges, model.settings
    if fitted_ranges is None or fitted_ranges.alarm_peak_tail is None or settings.alarm_threshold is None:
        return expected
    false_alarms_per_hour = settings.false_alarms_per_hour or 0.0
    return expected | {
        "false_alarms_per_hour": {
            "asked": false_alarms_per_hour,
            **asdict(
                extremes.expected_false_alarms_per_hour(
                    fitted_ranges.alarm_peak_tail, settings.alarm_threshold
                )
            ),
        },
        "minutes_left_out": fitted_ranges.alarm_peak_tail.healthy_minutes,
        "minutes_missing": extremes.missing_healthy_minutes(
            fitted_ranges.alarm_peak_tail, false_alarms_per_hour
        ),
        **model.identification_results,
    }


def scale_commands_by_dynamic_pressure(
    flights: Sequence[Samples], vehicle: Vehicle
) -> tuple[Sequence[Samples], Vehicle]:
    """Flights with commands times the dynamic pressure, and the vehicle that says so, where the airspeed is
    known and this explains more; else both as they are."""
    open_keys = {key: None for key in ("other_laws", "moving_air") if getattr(vehicle, key) is None}
    scaled_flights, scaled_vehicle = _choose_dynamic_pressure_scaling(
        flights, with_assumed_law_and_air(flights, vehicle)[0] if open_keys else vehicle
    )
    return scaled_flights, scaled_vehicle.model_copy(update=open_keys) if open_keys else scaled_vehicle


def _choose_dynamic_pressure_scaling(
    flights: Sequence[Samples], vehicle: Vehicle
) -> tuple[Sequence[Samples], Vehicle]:
    known_airspeeds = [one.airspeed[np.isfinite(one.airspeed)] for one in flights if one.airspeed is not None]
    speeds_mps = np.concatenate(known_airspeeds) if known_airspeeds else np.empty(0)
    reference_mps = float(np.median(speeds_mps)) if speeds_mps.size else 0.0
    if vehicle.reference_airspeed_mps is not None or reference_mps <= 0.0:
        return flights, vehicle
    scaled_flights = [
        scale_by_dynamic_pressure(one, reference_mps, vehicle.surface_airspeed_powers) for one in flights
    ]
    scaled_vehicle = vehicle.model_copy(update={"reference_airspeed_mps": reference_mps})
    if _min_bic(flights, vehicle) - _min_bic(scaled_flights, scaled_vehicle) < _DECISIVE_BIC_DIFFERENCE:
        return flights, vehicle
    return (
        _choose_airspeed_powers(flights, scaled_vehicle)
        if vehicle.other_laws
        else (scaled_flights, scaled_vehicle)
    )


def _min_bic(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion of any order."""
    return min(fitting.bic_by_order(fitting.flights_with_usable_rows(flights), vehicle).values())


def _choose_airspeed_powers(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[list[Samples], Vehicle]:
    """Each surface, or group, in its turn with the power of the airspeed that explains most: slipstream and
    linkages change the square. Another than that must explain decisively more."""

    scaled_flights = [
        scale_by_dynamic_pressure(one, vehicle.reference_airspeed_mps or 0.0, vehicle.surface_airspeed_powers)
        for one in flights
    ]
    whitened_flights = whiten_flights(
        scaled_flights, vehicle
    )  # a criterion believes each sample, as only white noise lets it

    def scale_and_whiten_flights(scaled_vehicle: Vehicle, whitens: bool = True) -> list[Samples]:
        rescaled_flights = [
            scale_by_dynamic_pressure(
                one, scaled_vehicle.reference_airspeed_mps or 0.0, scaled_vehicle.surface_airspeed_powers
            )
            for one in flights
        ]
        if not (whitens and vehicle.moving_air):
            return rescaled_flights
        return [
            whiten_samples(one, whitened_flight.noise_ma_coefficients, whitened_flight.fit_weight)
            for one, whitened_flight in zip(rescaled_flights, whitened_flights, strict=True)
        ]

    min_bic, names = (
        _min_bic(scale_and_whiten_flights(vehicle), vehicle) - _DECISIVE_BIC_DIFFERENCE,
        list(vehicle.surfaces),
    )
    for group in regression.group_surfaces_by_commands(vehicle):
        for power in _AIRSPEED_POWER_CANDIDATES:
            powers = vehicle.airspeed_powers | {names[i]: power for i in group}
            candidate = vehicle.model_copy(update={"airspeed_powers": powers})
            if (bic := _min_bic(scale_and_whiten_flights(candidate), candidate)) < min_bic:
                min_bic, vehicle = bic, candidate
    return scale_and_whiten_flights(vehicle, whitens=False), vehicle


def check_explained_variance(
    tests: list[Document], usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> None:
    """Raise BadInput where a model explains less of an axis than its mean does, on parts not fitted."""
    known_tests = [test for test in tests if test["samples"]]
    weights = [test["samples"] for test in known_tests]
    shares = {axis: [test["explained"][axis] for test in known_tests] for axis in "pqr"}
    explained = {
        axis: float(np.average(values, weights=weights)) for axis, values in shares.items() if known_tests
    }
    if unexplained_axes := {axis: share for axis, share in explained.items() if share <= 0.0}:
        minutes = sum(int(one.is_usable.sum()) * one.samples.dt_s for one in usable_flights) / 60.0
        stillest_command = min(
            _command_sd_by_surface(usable_flights, model).items(), key=lambda pair: pair[1]
        )
        raise BadInput(
            "identify: on parts it was not fitted on the model explains less of "
            f"{', '.join(unexplained_axes)} than the "
            f"mean does ({_values_by_axis_text(unexplained_axes)}), allowed: a model that "
            "explains more; what would "
            f"help: more than these {minutes:.1f} min, commands that move more "
            f"({stillest_command[0]} has a standard "
            f"deviation of {stillest_command[1]:.2g}), or the commands that this vehicle follows"
            f"{_remarks_on_rates(usable_flights, model)}"
        )


def _check_command_units_alike(flights: Sequence[Samples], vehicle: Vehicle) -> None:
    """Raise BadInput where a flight's command is in another unit than that of the first."""
    first_ranges = FittedRanges(
        commands=trust.central_ranges(flights[0].commands), rates=trust.central_ranges(flights[0].rates)
    )
    for other in flights[1:]:
        trust.check_command_units(
            other.name, other.commands, other.rates, first_ranges, list(vehicle.surfaces)
        )


def _remarks_on_rates(usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model) -> str:
    """Return the mistakes found in the rates when the log was read, each after a semicolon."""
    rates = tuple(f"{getattr(model.vehicle.rates, axis).column}:" for axis in "pqr")
    notes = [note for one in usable_flights for note in one.samples.notes if note.startswith(rates)]
    return "".join(f"; {note}" for note in notes)


def _command_sd_by_surface(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> dict[str, float]:
    """Standard deviation of each surface's command."""
    commands = np.vstack(
        [usable_flight.samples.commands[usable_flight.is_usable] for usable_flight in usable_flights]
    )
    return dict(zip(model.vehicle.surfaces, np.nanstd(commands, axis=0).tolist(), strict=True))


def _used_samples_entry(usable_flight: fitting.FlightWithUsableRows) -> Document:
    samples, use = usable_flight.samples, usable_flight.is_usable
    return {"name": samples.name, "samples": int(use.sum()), "of": len(use), "notes": list(samples.notes)}


def collinear_regressors(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first; None where
    the others make it up."""
    regressors, _, _ = fitting.stacked_regression_data(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    factors = variance_inflation_factors(regressors[:, 1:])
    worst = sorted(zip(regressor_names(model), factors.tolist(), strict=True), key=lambda pair: -pair[1])
    inflated = [
        (name, factor if isfinite(factor) else None)
        for name, factor in worst
        if factor > _MIN_COLLINEAR_VARIANCE_INFLATION
    ]
    return [{"regressor": name, "inflation": factor} for name, factor in inflated]


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    rates = [f"{rate}[-{k}]" for k in range(1, model.n_rate_lags + 1) for rate in "pqr"]
    n_signal_lags = range(1, model.vehicle.n_signal_lags(model.n_rate_lags) + 1)
    signals = [f"{name}[-{k}]" for k in n_signal_lags for name in model.vehicle.signal_regressor_names]
    delays, groups = range(1, model.n_command_lags + 1), map("+".join, model.groups)
    return rates + signals + [f"command of {group}[-{k}]" for group in groups for k in delays]


def median_standard_error_inflation_by_axis(
    usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model
) -> dict[str, float]:
    """By how much the residual's colour widens the standard errors of the responses: the median, an axis."""
    fit = fitting.fit_least_squares_of_order(
        usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags
    )
    first_command_row = len(fit.standard_error_inflation) - len(model.groups) * model.n_command_lags
    return dict(
        zip("pqr", np.median(fit.standard_error_inflation[first_command_row:], axis=0).tolist(), strict=True)
    )


def residual_spectrum(usable_flights: Sequence[fitting.FlightWithUsableRows], model: Model) -> list[Document]:
    """Mean density of the residual by band, over that of white noise of the same variance, an axis."""
    residual = np.vstack(
        [fitting.one_step_residuals(model, usable_flight)[1] for usable_flight in usable_flights]
    )
    frequency_hz, density = power_spectral_density(residual, 1.0 / model.rate_hz)
    white_density = residual.var(axis=0) / (0.5 * model.rate_hz)
    bands = []
    for low_hz, high_hz in _SPECTRUM_BANDS_HZ:
        is_in_band = (frequency_hz > low_hz) & (frequency_hz <= high_hz)
        if is_in_band.any():
            ratio = (density[is_in_band].mean(axis=0) / white_density).tolist()
            bands.append({"from_hz": low_hz, "to_hz": high_hz, **dict(zip("pqr", ratio, strict=True))})
    return bands


def identification_text(model: Model) -> str:
    """Return the identification as lines of text."""
    identified: Document = dict(model.identification_results)
    n_samples = sum(flight["samples"] for flight in identified["flights"])
    lines = [
        f"{model.vehicle.name}: {n_samples} samples at {model.rate_hz:.3g} Hz, flights: "
        f"{len(identified['flights'])}; "
        f"past samples of the rates: {model.n_rate_lags}, of the commands: {model.n_command_lags}",
        *(f"  {line}" for line in identified.get("assumed", [])),
        *(f"  together, not distinguishable: {', '.join(g)}" for g in model.groups if len(g) > 1),
        *_dynamic_pressure_sentences(model),
        *dict.fromkeys(
            f"  noise of the colour {', '.join(f'{c:.3g}' for c in one.ma_coefficients)}: "
            f"{one.covariance_inflation:.2g} times as wide, in squares, as gains of 10 s left out "
            "differ, and other laws may"
            for one in model.noise_models
        ),
        *(f"  {line}" for line in trust.unknown_effect_sentences(model)),
        *(f"  {flight['name']}: {note}" for flight in identified["flights"] for note in flight["notes"]),
        *map(_left_out_test_text, identified["tests"]),
        *_another_day_sentences(identified["another_day"], len(identified["flights"])),
        f"  the residual's colour widens standard errors by {_values_by_axis_text(identified['colour'])}",
    ]
    output_error = identified["output_error"]
    if "delay_s" in output_error:
        lines.append(
            f"  output error: servo lag {_servo_lag_text(output_error)}, delay "
            f"{output_error['delay_s']:.3f} s (sd {output_error['delay_sd_s']:.3f}), explains "
            "of 2 s free runs not fitted "
            f"{_values_by_axis_text(output_error['explained_of_windows_not_fitted'])}"
        )
    if identified["collinear"]:
        worst, n_collinear = identified["collinear"][0], len(identified["collinear"])
        lines.append(
            f"  {n_collinear} {'regressors are' if n_collinear > 1 else 'regressor is'} "
            "collinear (variance inflated over "
            f"{_MIN_COLLINEAR_VARIANCE_INFLATION:g} times), most {worst['regressor']} "
            f"({_variance_inflation_text(worst['inflation'])})"
        )
    return "\n".join(lines)


def _another_day_sentences(expected: Document, n_flights: int) -> list[str]:
    """Return lines on flights that were not fitted; one flight informs on its halves, not on another day."""
    what_day = (
        "another day, each left out in turn"
        if n_flights > 1
        else "another half of this day, not of another day"
    )
    lines = []
    if "classes" in expected:
        says = [
            f"{name} {expected[key]['mean']:.3f} ({expected[key]['worst']:.3f})"
            for key, name in _SCORE_TITLES.items()
        ]
        lines.append(f"  expect of {what_day}, mean (worst): {', '.join(says)}")
    if "false_alarms_per_hour" in expected:
        rate, missing_minutes = expected["false_alarms_per_hour"], expected["minutes_missing"]
        lines.append(
            f"  false alarms: {rate['asked']:g} an hour asked for, {rate['low']:.2g} to {rate['high']:.2g} "
            f"at 90 %, by {expected['minutes_left_out']:.1f} min of health left out"
        )
        if missing_minutes:
            lines.append(
                f"  to show this rate without a fitted tail {missing_minutes:.0f} min of health are missing"
            )
        if expected.get("parts"):
            alarmed = f"{expected['alarmed']} of {expected['parts']} parts left out alarm"
            lines.append(f"  at the threshold of the others {alarmed}")
    return lines


def _dynamic_pressure_sentences(model: Model) -> list[str]:
    if (reference_mps := model.vehicle.reference_airspeed_mps) is None:
        return []
    others = "".join(f", {n} with airspeed^{x:g}" for n, x in model.vehicle.airspeed_powers.items() if x != 2)
    return [f"  surfaces work with the dynamic pressure, 1 at {reference_mps:.4g} m/s{others}"]


def _left_out_test_text(test: Document) -> str:
    if not test["samples"]:
        return f"  without {test['left_out']}: nothing in it is known"
    line = f"  without {test['left_out']}: explains {_values_by_axis_text(test['explained'])} of it"
    if "score" not in test:
        return line
    kept = test["score"]
    return (
        f"{line}; {len(kept['settings'])} classes {kept['classes']:.3f}, healthy or faulty "
        f"{kept['healthy_or_faulty']:.3f}, side {kept['side']:.3f}, mean error {kept['mean_error']:.3f}"
    )


def _servo_lag_text(output_error_fit: Document) -> str:
    if output_error_fit["shorter_than_can_be_told"]:
        return "shorter than this rate can tell"
    return f"{output_error_fit['servo_lag_s']:.3f} s (sd {output_error_fit['servo_lag_sd_s']:.3f})"


def _variance_inflation_text(factor: float | None) -> str:
    return "made up by the others" if factor is None else f"{factor:.0f} times"


def _values_by_axis_text(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())


def fit_output_error(
    usable_flights: Sequence[fitting.FlightWithUsableRows], groups: list[list[int]]
) -> dict[str, Any]:
    """Fit on every other window, test on the rest. Returns servo lag and delay in s, their standard errors,
    and the share of the rates' variance explained over free-running windows not fitted, an axis."""
    from scipy.optimize import least_squares

    dt_s = float(np.median([usable_flight.samples.dt_s for usable_flight in usable_flights]))
    commands, rates = _cut_free_run_windows(
        usable_flights, groups, round(FREE_RUN_WINDOW_S / dt_s), round(_MAX_COMMAND_DELAY_S / dt_s) + 1
    )
    if len(rates) < 20 or not np.ptp(rates, axis=(0, 1)).all():
        return {"windows": len(rates), "says": "too few gap-free windows in which every rate moves"}
    fitted_windows, kept_windows = slice(0, None, 2), slice(1, None, 2)
    rate_spread = rates.std(axis=(0, 1))
    initial_parameters, min_parameters, max_parameters = _initial_output_error_parameters(len(groups), dt_s)

    def residual(parameters: Floats, window_slice: slice) -> Floats:
        simulated = _simulate_free_runs(parameters, commands[window_slice], rates[window_slice], dt_s)
        return ((simulated - rates[window_slice]) / rate_spread).ravel()

    fit = least_squares(
        residual,
        initial_parameters,
        bounds=(min_parameters, max_parameters),
        args=(fitted_windows,),
        loss="soft_l1",
        max_nfev=40,
    )
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    standard_errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) * float(fit.fun @ fit.fun) / len(fit.fun))
    residual_kept = residual(fit.x, kept_windows).reshape(-1, 3) * rate_spread
    explained = 1.0 - residual_kept.var(axis=0) / rates[kept_windows].reshape(-1, 3).var(axis=0)
    return {
        "windows": len(rates),
        "servo_lag_s": float(fit.x[0]),
        "servo_lag_sd_s": float(standard_errors[0]),
        "delay_s": float(fit.x[1]),
        "delay_sd_s": float(standard_errors[1]),
        "shorter_than_can_be_told": bool(fit.x[0] < 2.0 * _MIN_SERVO_LAG_S),
        "explained_of_windows_not_fitted": dict(zip("pqr", explained.tolist(), strict=True)),
    }


def _cut_free_run_windows(
    usable_flights: Sequence[fitting.FlightWithUsableRows],
    groups: list[list[int]],
    window_samples: int,
    n_past_samples: int,
) -> tuple[Floats, Floats]:
    """Commands (W, n_past_samples + window_samples, G) with their past, scaled by labels, and rates (W,
    window_samples, 3)."""
    commands, rates = [], []
    for usable_flight in usable_flights:
        samples = usable_flight.samples
        effectiveness = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
        group_commands = np.column_stack(
            [(samples.commands * effectiveness)[:, g].sum(axis=1) for g in groups]
        )
        is_usable = (
            usable_flight.is_usable
            & np.isfinite(group_commands).all(axis=1)
            & np.isfinite(samples.rates).all(axis=1)
        )
        for end in range(n_past_samples + window_samples, len(is_usable), window_samples):
            window = slice(end - n_past_samples - window_samples, end)
            if (
                is_usable[window].all()
                and samples.stretch_number[window.start] == samples.stretch_number[end - 1]
            ):
                commands.append(group_commands[window])
                rates.append(samples.rates[end - window_samples : end])
    window_stride = max(len(rates) // _MAX_FREE_RUN_WINDOWS, 1)
    shape = (-1, n_past_samples + window_samples, len(groups))
    return np.reshape(commands[::window_stride], shape), np.reshape(
        rates[::window_stride], (-1, window_samples, 3)
    )


def _initial_output_error_parameters(n_groups: int, dt_s: float) -> tuple[Floats, Floats, Floats]:
    """First guess and bounds of lag, delay, A, B and c."""
    values = [0.1, dt_s, *(0.7 * np.eye(3)).ravel(), *np.full(3 * n_groups, 0.01), *np.zeros(3)]
    no_limit = np.full(len(values) - 2, np.inf)
    low, high = [_MIN_SERVO_LAG_S, 0.0, *-no_limit], [_MAX_SERVO_LAG_S, _MAX_COMMAND_DELAY_S, *no_limit]
    return np.array(values), np.array(low), np.array(high)


def _simulate_free_runs(parameters: Floats, commands: Floats, rates: Floats, dt_s: float) -> Floats:
    """Free runs of all windows at once, (W, window_samples, 3)."""
    n_groups = commands.shape[2]
    lag_s, delay_s = parameters[:2]
    a = parameters[2:11].reshape(3, 3)
    b = parameters[11 : 11 + 3 * n_groups].reshape(n_groups, 3)
    c = parameters[11 + 3 * n_groups :]
    window_samples = rates.shape[1]
    n_past_samples = commands.shape[1] - window_samples
    whole_delay, part_delay = divmod(delay_s / dt_s, 1.0)
    servo_retention = np.exp(-dt_s / lag_s)
    predicted_rates, servo_commands = rates[:, 0].copy(), commands[:, 0].copy()
    simulated_rates = np.empty_like(rates)
    for k in range(commands.shape[1]):
        if k >= n_past_samples:
            simulated_rates[:, k - n_past_samples] = predicted_rates
            predicted_rates = predicted_rates @ a.T + servo_commands @ b + c
        delayed_rows = max(k - int(whole_delay), 0), max(k - int(whole_delay) - 1, 0)
        command = (1.0 - part_delay) * commands[:, delayed_rows[0]] + part_delay * commands[
            :, delayed_rows[1]
        ]
        servo_commands = servo_retention * servo_commands + (1.0 - servo_retention) * command
    return simulated_rates
