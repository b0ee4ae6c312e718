"""Credible or silent: where a model may be believed, and why not elsewhere.

What a model was fitted on is in its file (`FittedRanges`). A row is credible where the commands, rates and
the airspeed of the last seconds are such as the fit has seen, and where every signal lives. Elsewhere nothing
is said: no name, and bounds of 0 and 1. The size of the residual does not count, since a fault makes it large
too: where it is larger than in the flights of the model, the filter takes the noise to be as much larger, and
a sample counts for less. A log is refused only where a mistake in its columns explains it.
A row uses nothing later than its time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import energy, regression
from beaver_ftc_logs.column_mistakes import log_without_signal, logs_with_one_mistake_corrected
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.samples import NOISE_MA_CANDIDATES, Samples, whiten_samples
from beaver_ftc_logs.signals import MIN_STILL_S

Mask = NDArray[np.bool_]

_RANGE_MARGIN_SHARE = 0.5
"""Share of its span by which a range is passed before a row is outside."""
_AIRSPEED_MARGIN_SHARE_OF_LIMIT = 0.15
_RANGE_WINDOW_S, _MIN_OUTSIDE_SHARE = 5.0, 0.5
_MAX_UNCHANGED_TIME_FACTOR = 3.0
_MAX_FALSE_MISTAKE_PROBABILITY, _MAX_COMPARED_SAMPLES = 0.001, 8000
"""Probability with which chance alone may look like a mistake in the columns; samples that are compared."""
_DISTRUST_AFTER_CLIPPING_S = 30.0
_MIN_MOVED_EFFECT_POWER_RATIO = 1e-6
_MAX_SHARE_EXPLAINED_BY_OTHERS, _EFFECT_NOISE_POWER_RATIO_CAP = 0.98, 12.5
"""Of an effect of so many variances of the noise a sample, a fiftieth is half a standard deviation."""
_MAX_AXIS_RATIO_OF_ONE_UNIT, _UNIT_TOLERANCE_FACTOR_ROOT = 10.0, 1.6
_MAX_ALIKE_MOTION_FACTOR, _MIN_OTHER_UNIT_FACTOR = 3.0, 12.0
_COMMAND_UNIT_HINT = ": one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)"
_RANGE_QUANTILES = (0.001, 0.999)
_MEDIAN_CHI_SQUARE_3_DOF = 2.366
"""The median of a square of three axes."""
MAX_REVERSED_GAIN, _MIN_COMMAND_GAIN = -0.3, 0.2
"""Gains below which a command works the other way round, or hardly. Of 576 correct logs with faults of any
kind none was below 0.98, in light turbulence 0.93 (`own_logs.py`, seeds 31 to 42; 71 to 201)."""
_REVERSED_GAIN_LIMIT = -0.5
"""Half-way from the gain of a wrong sign, -1, to that of a lost surface, 0."""


def compute_fitted_ranges(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]],
    model: Model,
    held_out_gain_standard_errors: Floats,
) -> FittedRanges:
    """Compute the ranges in which a model was fitted. flights_with_used_rows: each flight, and its samples
    used; held_out_gain_standard_errors (G,): of parts not fitted."""
    rates = np.vstack([samples.rates[is_used] for samples, is_used in flights_with_used_rows])
    commands = np.vstack([samples.commands[is_used] for samples, is_used in flights_with_used_rows])
    used_airspeeds = [
        samples.airspeed[is_used]
        for samples, is_used in flights_with_used_rows
        if samples.airspeed is not None
    ]
    return FittedRanges(
        commands=central_ranges(commands),
        rates=central_ranges(rates),
        airspeed=central_ranges(np.concatenate(used_airspeeds)[:, None])[0] if used_airspeeds else None,
        spread=np.nanstd(rates, axis=0).tolist(),
        tied=effect_share_explained_by_other_regressors(flights_with_used_rows, model).tolist(),
        gain_sd=held_out_gain_standard_errors.tolist(),
        still_s=_longest_unchanged_time_s_by_column(flights_with_used_rows),
        energy_climb=_estimate_unpowered_energy_height_rate_mps(flights_with_used_rows),
    )


def _estimate_unpowered_energy_height_rate_mps(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]],
) -> float | None:
    """Return the rate of the energy height in the lowest part of healthy flight, m/s; None if not known."""
    used_energy_height_rates_mps = [
        flight.energy_height_rate_mps[is_used]
        for flight, is_used in flights_with_used_rows
        if flight.energy_height_rate_mps is not None
    ]
    energy_height_rates_mps = (
        np.concatenate(used_energy_height_rates_mps) if used_energy_height_rates_mps else np.empty(0)
    )
    energy_height_rates_mps = energy_height_rates_mps[np.isfinite(energy_height_rates_mps)]
    return (
        float(np.quantile(energy_height_rates_mps, energy.UNPOWERED_SHARE_OF_HEALTHY_FLIGHT))
        if energy_height_rates_mps.size
        else None
    )


def central_ranges(values: Floats) -> list[list[float]]:
    """Least and largest of each column but for the rarest, [0, 0] where nothing is known."""
    if not values.shape[1]:
        return []
    values_with_unknown_columns_zero = np.where(np.isfinite(values).any(axis=0), values, 0.0)
    return np.nanquantile(values_with_unknown_columns_zero, _RANGE_QUANTILES, axis=0).T.tolist()


def _longest_unchanged_time_s_by_column(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]],
) -> dict[str, float]:
    column_names = dict.fromkeys(
        column_name
        for samples, _ in flights_with_used_rows
        for column_name in samples.time_since_change_s_by_column
    )
    return {
        column_name: max(
            (
                float(flight.time_since_change_s_by_column[column_name].max(initial=0.0))
                for flight, _ in flights_with_used_rows
                if column_name in flight.time_since_change_s_by_column
            )
        )
        for column_name in column_names
    }


def effect_share_explained_by_other_regressors(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]], model: Model
) -> Floats:
    """Share of each group's effect on the rates that past, signals and the other groups make up, (G,): where
    it is near 1 the law ties the group to what it answers to, and its effect cannot be told; 1 where the
    group never moved. An effect far above the noise may be made up to a larger share: what is left counts."""
    effect_power, power_unexplained_by_other_regressors = _effect_and_unexplained_powers(
        flights_with_used_rows, model
    )
    has_moved = effect_power > _MIN_MOVED_EFFECT_POWER_RATIO
    share_explained_by_other_regressors = 1.0 - power_unexplained_by_other_regressors / np.minimum(
        np.where(has_moved, effect_power, 1.0), _EFFECT_NOISE_POWER_RATIO_CAP
    )
    return np.where(has_moved, np.maximum(share_explained_by_other_regressors, 0.0), 1.0)


def effect_power_unexplained_by_other_regressors(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]], model: Model
) -> Floats:
    """Power of each group's effect on the rates that nothing else makes up, in variances of the noise a
    sample, (G,)."""
    return _effect_and_unexplained_powers(flights_with_used_rows, model)[1]


def _effect_and_unexplained_powers(
    flights_with_used_rows: Sequence[tuple[Samples, Mask]], model: Model
) -> tuple[Floats, Floats]:
    """Power of each group's effect on the rates, in variances of the noise a sample, (G,), and of what past,
    signals and the other groups do not make up of it, (G,)."""
    surface_indices_by_group = regression.surface_indices_of_each_group(model)
    lag_counts_and_label_scaling = (
        model.n_rate_lags,
        model.n_command_lags,
        True,
        model.vehicle.n_signal_lags(model.n_rate_lags),
    )
    regressors_and_predictability_by_flight = [
        regression.build_regressors(flight, surface_indices_by_group, *lag_counts_and_label_scaling)
        for flight, _ in flights_with_used_rows
    ]
    is_row_used_by_flight = [
        is_used & is_predictable
        for (_, is_used), (_, _, is_predictable) in zip(
            flights_with_used_rows, regressors_and_predictability_by_flight, strict=True
        )
    ]
    past_regressors = np.vstack(
        [
            regressors[0][is_row_used]
            for regressors, is_row_used in zip(
                regressors_and_predictability_by_flight, is_row_used_by_flight, strict=True
            )
        ]
    )
    lagged_group_commands = np.vstack(
        [
            regressors[1][is_row_used]
            for regressors, is_row_used in zip(
                regressors_and_predictability_by_flight, is_row_used_by_flight, strict=True
            )
        ]
    )
    response_coefficients = np.array(model.command_response)
    residual_covariance = np.array(model.residual_covariance)
    whitening_matrix = np.linalg.inv(np.linalg.cholesky(residual_covariance)).T
    effect_power = np.zeros(len(surface_indices_by_group))
    power_unexplained_by_other_regressors = np.zeros(len(surface_indices_by_group))
    for group_index in range(len(surface_indices_by_group)):
        other_lagged_commands = [
            lagged_group_commands[:, other_group_index]
            for other_group_index in range(len(surface_indices_by_group))
            if other_group_index != group_index
        ]
        other_regressors = np.column_stack(
            [np.ones(len(past_regressors)), past_regressors, *other_lagged_commands]
        )
        whitened_effect = (
            lagged_group_commands[:, group_index] @ response_coefficients[group_index] @ whitening_matrix
        )
        whitened_effect = whitened_effect - whitened_effect.mean(axis=0)
        effect_power[group_index] = float((whitened_effect**2).sum()) / len(whitened_effect)
        if effect_power[group_index] > _MIN_MOVED_EFFECT_POWER_RATIO:
            effect_unexplained_by_other_regressors = (
                whitened_effect
                - other_regressors @ np.linalg.lstsq(other_regressors, whitened_effect, rcond=None)[0]
            )
            power_unexplained_by_other_regressors[group_index] = float(
                (effect_unexplained_by_other_regressors**2).sum()
            ) / len(whitened_effect)
    return effect_power, power_unexplained_by_other_regressors


def is_group_effect_known(model: Model) -> list[bool]:
    """Whether anything is said of each group."""
    if model.fitted_ranges is None or not model.fitted_ranges.effect_share_explained_by_other_regressors:
        return [True] * len(model.groups)
    return [
        explained_share_of_group < _MAX_SHARE_EXPLAINED_BY_OTHERS
        for explained_share_of_group in model.fitted_ranges.effect_share_explained_by_other_regressors
    ]


def is_group_gain_known(model: Model) -> list[bool]:
    """Whether the effect of each group is known under any law: the model may not err by all of it."""
    group_has_known_effect = is_group_effect_known(model)
    if (
        model.fitted_ranges is None
        or not model.fitted_ranges.group_gain_standard_error
        or not model.vehicle.other_laws
    ):
        return group_has_known_effect
    return [
        is_effect_known and regression.BOUND_MARGIN_STANDARD_ERRORS * gain_standard_error < 1.0
        for is_effect_known, gain_standard_error in zip(
            group_has_known_effect, model.fitted_ranges.group_gain_standard_error, strict=True
        )
    ]


def surfaces_of_unknown_effect(model: Model) -> set[str]:
    """The surfaces of which nothing is said."""
    groups_and_flags = zip(model.groups, is_group_effect_known(model), strict=True)
    return {
        name
        for group, group_has_known_effect in groups_and_flags
        if not group_has_known_effect
        for name in group
    }


def unknown_effect_sentences(model: Model) -> list[str]:
    """Why nothing is said of some groups."""
    if model.fitted_ranges is None:
        return []
    sentence_start_template = (
        "of what {} does, {:.1%} follows from the rates, signals and other surfaces of the flights fitted"
    )
    return [
        f"{sentence_start_template.format('+'.join(group), explained_share_of_group)}: its effect cannot "
        "be told, nothing is said of it"
        for group, explained_share_of_group, group_has_known_effect in zip(
            model.groups,
            model.fitted_ranges.effect_share_explained_by_other_regressors,
            is_group_effect_known(model),
            strict=False,
        )
        if not group_has_known_effect
    ]


def refuse_rates_in_other_unit(samples: Samples, fitted_ranges: FittedRanges | None) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if fitted_ranges is None or not fitted_ranges.rate_sd_rad_s:
        return
    if not np.isfinite(samples.rates).any(axis=0).all():  # an axis without a number has no spread
        return
    rate_sd_ratios = np.nanstd(samples.rates, axis=0) / np.maximum(fitted_ranges.rate_sd_rad_s, MIN_DIVISOR)
    geometric_mean_sd_ratio = float(np.exp(np.mean(np.log(np.maximum(rate_sd_ratios, MIN_DIVISOR)))))
    for unit, units_per_rad in (("deg/s", 180.0 / np.pi), ("cdeg/s", 18000.0 / np.pi), ("mrad/s", 1000.0)):
        is_ratio_alike_on_axes = rate_sd_ratios.max() < _MAX_AXIS_RATIO_OF_ONE_UNIT * rate_sd_ratios.min()
        if (
            is_ratio_alike_on_axes
            and 1.0 / _UNIT_TOLERANCE_FACTOR_ROOT**2
            < geometric_mean_sd_ratio / units_per_rad
            < _UNIT_TOLERANCE_FACTOR_ROOT**2
        ):
            raise BadInput(
                f"{samples.name}: rates spread {geometric_mean_sd_ratio:.3g} times as widely as in the "
                "flights of the model, "
                f"allowed: rates in rad/s; a factor of {1.0 / units_per_rad:.4g} (`unit: {unit}`) fits"
            )
        if (
            is_ratio_alike_on_axes
            and 1.0 / _UNIT_TOLERANCE_FACTOR_ROOT**2
            < geometric_mean_sd_ratio * units_per_rad
            < _UNIT_TOLERANCE_FACTOR_ROOT**2
        ):
            raise BadInput(
                f"{samples.name}: rates spread {geometric_mean_sd_ratio:.3g} times as widely as in the "
                "flights of the model, "
                f"allowed: rates in rad/s; a factor of {units_per_rad:.4g} fits: the model's "
                f"own were in {unit}?"
            )


def refuse_commands_in_other_unit(
    flight_name: str, commands: Floats, rates: Floats, fitted_ranges: FittedRanges, surfaces: Sequence[str]
) -> None:
    """Raise BadInput where a command moves so much more or less than in the flights of the model, while every
    rate moves alike, that it is in another unit; or so much more than any rate does.

    Shapes: commands (n, S), rates (n, 3).
    """
    rate_width_ratios = _range_widths(central_ranges(rates)) / np.maximum(
        _range_widths(fitted_ranges.rate_ranges_rad_s), MIN_DIVISOR
    )
    is_rate_motion_as_fitted = (
        rate_width_ratios.min() > 1.0 / _MAX_ALIKE_MOTION_FACTOR
        and rate_width_ratios.max() < _MAX_ALIKE_MOTION_FACTOR
    )
    allowed_command_width_ratio = _MIN_OTHER_UNIT_FACTOR * (
        1.0 if is_rate_motion_as_fitted else max(rate_width_ratios.max(), 1.0)
    )
    command_width_ratios = _range_widths(central_ranges(commands)) / np.maximum(
        _range_widths(fitted_ranges.command_ranges), MIN_DIVISOR
    )
    for surface, width_ratio in zip(surfaces, command_width_ratios.tolist(), strict=True):
        if allowed_command_width_ratio < width_ratio < 1e4 or (
            is_rate_motion_as_fitted and 1e-4 < width_ratio < 1.0 / _MIN_OTHER_UNIT_FACTOR
        ):
            raise BadInput(
                f"{flight_name}: the command of {surface} moves {width_ratio:.3g} times as much as "
                "in the other flights, "
                f"the rates {rate_width_ratios.max():.2g} times at most, allowed: one unit "
                "(57.3 is deg for rad, 100 "
                "percent: `unit`, `scale`)"
            )


class _GainBoundsOverFlight(NamedTuple):
    """Answers in all parts of a flight: at most, and at least, how much of the model's answer to each group's
    command, (G,), there is; and the log likelihood of a sample of each part, (4,), but for what all colours
    have alike."""

    largest_group_gain_upper_bounds: list[float]
    smallest_group_gain_lower_bounds: list[float]
    sample_log_likelihood_by_part: Floats


def refuse_columns_not_as_identified(samples: Samples, model: Model) -> None:
    """Raise BadInput where in every part of a flight the rates answer a command or another column as in no
    flight of the model, or do what no trim and no effectiveness explain: columns, signs or units are others,
    since no fault has always been there and changes what is not its own.

    What a law answers to gusts or to a gyro's noise looks like a command that works the other way round: an
    answer is refused only where it is wrong by each colour of the noise that is likelier, too. A model that
    knows the effect of no surface says nothing of any flight, and refuses none."""
    if not any(is_group_effect_known(model)):
        return
    if (whitened_flight_and_model := _whiten_by_likeliest_noise(samples, model)) is None:
        return
    likeliest_whitened_flight, likeliest_model = whitened_flight_and_model
    gain_bounds = _bound_gains_over_flight_parts(likeliest_whitened_flight, likeliest_model)
    if gain_bounds is None:
        return
    mistakes = _column_mistake_texts(samples, model, gain_bounds)
    for noise_ma_coefficients in NOISE_MA_CANDIDATES if mistakes else ():
        other_gain_bounds = _bound_gains_over_flight_parts(
            whiten_samples(samples, noise_ma_coefficients), model
        )
        if (
            other_gain_bounds is not None
            and other_gain_bounds.sample_log_likelihood_by_part.mean()
            > gain_bounds.sample_log_likelihood_by_part.mean()
        ):
            mistakes_by_likelier_noise = _column_mistake_texts(samples, model, other_gain_bounds)
            mistakes = {
                mistake_key: mistake_text
                for mistake_key, mistake_text in mistakes.items()
                if mistake_key in mistakes_by_likelier_noise
            }
    mistake_text = next(iter(mistakes.values()), None) or _likelier_column_mistake_text(
        likeliest_whitened_flight, likeliest_model
    )
    if mistake_text is not None:
        allowed_columns_text = "allowed: columns, signs and units as in the flights of the model"
        raise BadInput(f"{samples.name}: {mistake_text}, {allowed_columns_text}")


def _whiten_by_likeliest_noise(samples: Samples, model: Model) -> tuple[Samples, Model] | None:
    """Return the flight whitened by the noise of the model that makes it likeliest, and the model with this
    noise alone; None where a part of the flight is too short."""
    whitened_flights_and_models = [
        (whiten_samples(samples, noise_model.ma_coefficients), model.with_single_noise_model(noise_model))
        for noise_model in model.noise_models
    ]
    flights_and_log_likelihoods = [
        (whitened_flight_and_model, log_likelihoods_and_sample_count)
        for whitened_flight_and_model in whitened_flights_and_models or [(samples, model)]
        if (
            log_likelihoods_and_sample_count := _part_log_likelihoods_and_sample_count(
                *whitened_flight_and_model
            )
        )
    ]
    if not flights_and_log_likelihoods:
        return None
    return max(flights_and_log_likelihoods, key=lambda one: one[1][0].mean())[0]


def groups_with_reversed_gain(samples: Samples, model: Model) -> list[list[str]]:
    """The groups of known effect to whose command the rates answer the other way round, by least squares
    over all of a flight: a gain nearer to -1 than to 0, which is that of a lost surface."""
    if (whitened_flight_and_model := _whiten_by_likeliest_noise(samples, model)) is None:
        return []
    is_predictable, rates_unexplained_by_past, group_responses = regression.whitened_rates_and_responses(
        *whitened_flight_and_model
    )
    regressors, targets = _trim_and_gain_regression_data(
        np.flatnonzero(is_predictable),
        rates_unexplained_by_past,
        group_responses,
        _whitening_sample_share_and_log_noise(*whitened_flight_and_model)[0],
    )
    group_gains = np.linalg.lstsq(regressors, targets, rcond=None)[0][3:]
    return [
        group
        for group, gain, has_known_effect in zip(
            model.groups, group_gains, is_group_effect_known(model), strict=True
        )
        if has_known_effect and gain < _REVERSED_GAIN_LIMIT
    ]


def _column_mistake_texts(
    samples: Samples, model: Model, gain_bounds: _GainBoundsOverFlight
) -> dict[str, str]:
    """Return the mistakes in the rates' answers to a flight's columns, by kind and column, the surest
    first."""
    mistakes, gain_is_known_by_group = {}, is_group_gain_known(model)
    for group, has_known_gain, gain_upper_bound, gain_lower_bound in zip(
        model.groups,
        gain_is_known_by_group,
        gain_bounds.largest_group_gain_upper_bounds,
        gain_bounds.smallest_group_gain_lower_bounds,
        strict=True,
    ):
        surface_group_name = "+".join(group)
        relative_motion = _relative_group_command_motion(samples, model, group)
        command_text = f"the command of {surface_group_name}"
        motion_text = f"moves {relative_motion:.3g} times as much as in the flights of the"
        if gain_upper_bound < MAX_REVERSED_GAIN:
            mistake_text = (
                f"the rates answer {command_text} the other way round in all of it (does `scale: -1` fit?)"
            )
            mistakes[f"sign {surface_group_name}"] = mistake_text
        elif (
            has_known_gain
            and gain_upper_bound < _MIN_COMMAND_GAIN
            and relative_motion > _MAX_ALIKE_MOTION_FACTOR
        ):
            effect_size_text = f"does at most {gain_upper_bound:.2g} of what it did"
            mistakes[f"unit {surface_group_name}"] = (
                f"{command_text} {motion_text} model, and {effect_size_text}{_COMMAND_UNIT_HINT}"
            )
        elif (
            has_known_gain
            and gain_lower_bound > 1.0 / _MIN_COMMAND_GAIN
            and 0.0 < relative_motion < 1.0 / _MAX_ALIKE_MOTION_FACTOR
        ):
            effect_size_text = f"does at least {gain_lower_bound:.3g} times what it did"
            mistakes[f"unit {surface_group_name}"] = (
                f"{command_text} {motion_text} model, and {effect_size_text}{_COMMAND_UNIT_HINT}"
            )
    return mistakes


def _likelier_column_mistake_text(samples: Samples, model: Model) -> str | None:
    """The mistake in the columns without which a flight is likelier in every part of it, where there is one.

    By chance a wrong reading is K times as likely as the true one in at most one part of K (Markov's
    inequality for a likelihood ratio); all readings together have the chance
    `_MAX_FALSE_MISTAKE_PROBABILITY`. That holds for a correct model. The flight must be likelier by as much
    more as flights were that the model was not fitted on, whose columns are right, and by as much again for
    another law (`FittedRanges.misread`).
    """
    min_sample_log_likelihood_gain_by_correction, n_effective_part_samples = (
        min_log_likelihood_gains_and_part_size(samples, model)
    )
    if not min_sample_log_likelihood_gain_by_correction:
        return None
    correction_text, max_log_likelihood_gain_per_sample = max(
        min_sample_log_likelihood_gain_by_correction.items(), key=lambda one: one[1]
    )
    allowed_log_likelihood_gain_per_sample = (
        2.0 * model.fitted_ranges.max_column_mistake_log_likelihood_gain
        if model.fitted_ranges is not None
        else 0.0
    )
    if (
        max_log_likelihood_gain_per_sample * n_effective_part_samples
        <= np.log(len(min_sample_log_likelihood_gain_by_correction) / _MAX_FALSE_MISTAKE_PROBABILITY)
        + allowed_log_likelihood_gain_per_sample * n_effective_part_samples
    ):
        return None
    log10_likelihood_ratio = max_log_likelihood_gain_per_sample * n_effective_part_samples / np.log(10.0)
    return (
        f"each part of the flight is at least 10^{log10_likelihood_ratio:.0f} times as likely with "
        f"{correction_text}"
    )


def min_log_likelihood_gains_and_part_size(samples: Samples, model: Model) -> tuple[dict[str, float], float]:
    """By each mistake in the columns how much likelier a sample is without it, in natural logarithms, in the
    part of the flight where that is least; and as how many samples a part counts.

    A mended signal must also be likelier than no signal, by as much in all parts together. Where the model
    errs in a signal's effect, a smaller or reversed effect may be likelier than the modelled one, while none
    is likelier still.
    """
    log_likelihoods_and_sample_count = _part_log_likelihoods_and_sample_count(samples, model)
    if log_likelihoods_and_sample_count is None:
        return {}, 0.0
    logged_log_likelihoods, n_effective_part_samples = log_likelihoods_and_sample_count
    log_likelihoods_without_signal = {
        signal: _part_log_likelihoods(log_without_signal(samples, model.vehicle, signal), model)
        for signal in model.vehicle.signal_column_names
    }
    min_sample_log_likelihood_gain_by_correction = {}
    for corrected_log in logs_with_one_mistake_corrected(
        samples, model.vehicle, surfaces_of_unknown_effect(model)
    ):
        corrected_log_likelihoods = (
            _part_log_likelihoods(corrected_log.samples, model) + corrected_log.log_jacobian
        )
        gain = float((corrected_log_likelihoods - logged_log_likelihoods).min())
        if signal := corrected_log.scaled_signal:
            gain_over_no_signal = corrected_log_likelihoods - log_likelihoods_without_signal[signal]
            gain = min(gain, float(gain_over_no_signal.sum()))
        min_sample_log_likelihood_gain_by_correction[corrected_log.correction_text] = gain
    return min_sample_log_likelihood_gain_by_correction, n_effective_part_samples


def _part_log_likelihoods(samples: Samples, model: Model) -> Floats:
    """Log likelihood of a sample of each part of the flight; minus infinity where a part is too short."""
    found = _part_log_likelihoods_and_sample_count(samples, model)
    return np.array(-np.inf) if found is None else found[0]


def _part_log_likelihoods_and_sample_count(samples: Samples, model: Model) -> tuple[Floats, float] | None:
    """Log likelihood of a sample of each part of the flight, as in `_GainBoundsOverFlight`, and the effective
    number of white samples of a part; of a long flight every k-th sample is taken. None where a part is too
    short."""
    whitening_matrix, effective_sample_share, log_unfiltered_noise_sd_product = (
        _whitening_sample_share_and_log_noise(samples, model)
    )
    is_predictable, rates_unexplained_by_past, group_responses = regression.whitened_rates_and_responses(
        samples, model
    )
    predictable_rows = np.flatnonzero(is_predictable)
    if (
        rows_by_part := regression.split_into_parts_for_bounds(
            predictable_rows[:: max(len(predictable_rows) // _MAX_COMPARED_SAMPLES, 1)]
        )
    ) is None:
        return None
    regressors_and_targets_by_part = [
        _trim_and_gain_regression_data(
            part_rows, rates_unexplained_by_past, group_responses, whitening_matrix
        )
        for part_rows in rows_by_part
    ]
    noise_variance_scales = [
        noise_variance_scale(
            regression.coefficient_upper_bounds_and_squared_residuals(
                regressors, targets, effective_sample_share
            )[1]
        )
        for regressors, targets in regressors_and_targets_by_part
    ]
    return -log_unfiltered_noise_sd_product - 1.5 * np.log(
        noise_variance_scales
    ), effective_sample_share * min(map(len, rows_by_part))


def _whitening_sample_share_and_log_noise(samples: Samples, model: Model) -> tuple[Floats, float, float]:
    """Return the matrix that whitens the residual of a flight of a colour, (3, 3), as how many white samples
    one counts, and the logarithm of the size of the noise of a sample that is not filtered."""
    covariance_inflation_of_fitted_noise = model.covariance_inflation_of_noise_model(
        samples.noise_ma_coefficients
    )
    noise_covariance_root = np.linalg.cholesky(
        model.with_inflated_covariance_of_noise_model(
            samples.noise_ma_coefficients
        ).intercept_past_response_noise()[3]
        / covariance_inflation_of_fitted_noise
    )
    log_unfiltered_noise_sd_product = float(
        np.log(np.diag(noise_covariance_root)).sum()
        - 3.0 * np.log(sum(samples.noise_ma_coefficients or (1.0,)))
    )
    return (
        np.linalg.inv(noise_covariance_root).T,
        model.settings.effective_sample_share / covariance_inflation_of_fitted_noise,
        log_unfiltered_noise_sd_product,
    )


def _trim_and_gain_regression_data(
    part_rows: NDArray[np.int64],
    rates_unexplained_by_past: Floats,
    responses: Floats,
    whitening_matrix: Floats,
) -> tuple[Floats, Floats]:
    """Regressors (3 n, 3 + K) of trim and responses (n, K, 3), and what they are to explain, (3 n,)."""
    trim_regressors = np.broadcast_to(np.eye(3), (len(part_rows), 3, 3))
    regressors = np.concatenate([trim_regressors, responses[part_rows]], axis=1) @ whitening_matrix
    return regressors.transpose(0, 2, 1).reshape(3 * len(part_rows), -1), (
        rates_unexplained_by_past[part_rows] @ whitening_matrix
    ).ravel()


def noise_variance_scale(squared_residuals: Floats) -> float:
    """The scale of the noise by the squares of what is left, (3 n,)."""
    return float(np.median(squared_residuals.reshape(-1, 3).sum(axis=1)) / _MEDIAN_CHI_SQUARE_3_DOF)


def _bound_gains_over_flight_parts(samples: Samples, model: Model) -> _GainBoundsOverFlight | None:
    """None where a part is too short."""
    is_predictable, rates_unexplained_by_past, group_responses = regression.whitened_rates_and_responses(
        samples, model
    )
    if (rows_by_part := regression.split_into_parts_for_bounds(np.flatnonzero(is_predictable))) is None:
        return None
    (whitening_matrix, effective_sample_share, log_unfiltered_noise_sd_product), n_groups = (
        _whitening_sample_share_and_log_noise(samples, model),
        len(model.groups),
    )
    gain_upper_bounds = np.full(n_groups, -np.inf)
    gain_lower_bounds = np.full(n_groups, np.inf)
    noise_variance_scales = []
    for part_rows in rows_by_part:
        regressors, whitened_targets = _trim_and_gain_regression_data(
            part_rows, rates_unexplained_by_past, group_responses, whitening_matrix
        )
        part_coefficient_upper_bounds, squared_residuals = (
            regression.coefficient_upper_bounds_and_squared_residuals(
                regressors, whitened_targets, effective_sample_share
            )
        )
        negated_part_coefficient_lower_bounds, _ = regression.coefficient_upper_bounds_and_squared_residuals(
            -regressors, whitened_targets, effective_sample_share
        )
        gain_upper_bounds = np.maximum(gain_upper_bounds, part_coefficient_upper_bounds[3:])
        gain_lower_bounds = np.minimum(gain_lower_bounds, -negated_part_coefficient_lower_bounds[3:])
        noise_variance_scales.append(noise_variance_scale(squared_residuals))
    return _GainBoundsOverFlight(
        gain_upper_bounds.tolist(),
        gain_lower_bounds.tolist(),
        -log_unfiltered_noise_sd_product - 1.5 * np.log(noise_variance_scales),
    )


def _relative_group_command_motion(samples: Samples, model: Model, group: list[str]) -> float:
    """Return how many times as far as in the flights of the model a group's command moves; 0 where these are
    not known."""
    if model.fitted_ranges is None or not model.fitted_ranges.command_ranges:
        return 0.0
    width_ratios = _range_widths(central_ranges(samples.commands)) / np.maximum(
        _range_widths(model.fitted_ranges.command_ranges), MIN_DIVISOR
    )
    return max(float(width_ratios[list(model.vehicle.surfaces).index(name)]) for name in group)


def _range_widths(ranges: Sequence[Sequence[float]]) -> Floats:
    return np.ptp(np.array(ranges, dtype=float).reshape(-1, 2), axis=1)


def rows_not_credible_by_reason(samples: Samples, model: Model) -> dict[str, Mask]:
    """Rows that are not credible, by reason."""
    rows_by_reason: dict[str, Mask] = {}
    for column_name, max_unchanged_time_s in _max_unchanged_time_s_by_column(samples, model).items():
        rows_by_reason[f"{column_name} stands still, for longer than {max_unchanged_time_s:.3g} s"] = (
            samples.time_since_change_s_by_column[column_name] > max_unchanged_time_s
        )
    if samples.is_rate_clipped is not None:
        rows_by_reason[f"a rate was clipped in the last {_DISTRUST_AFTER_CLIPPING_S:g} s"] = (
            _was_clipped_recently(samples.is_rate_clipped, samples.dt_s)
        )
    if model.fitted_ranges is None:
        return _drop_empty_reasons(rows_by_reason)
    return _drop_empty_reasons(
        rows_by_reason | _rows_out_of_fitted_ranges_by_reason(samples, model, model.fitted_ranges)
    )


def _was_clipped_recently(is_clipped: Mask, dt_s: float) -> Mask:
    """Whether a condition held in the last half minute."""
    row_index = np.arange(len(is_clipped))
    n_rows_since_clipping = row_index - np.maximum.accumulate(
        np.where(is_clipped, row_index, -len(is_clipped) - round(_DISTRUST_AFTER_CLIPPING_S / dt_s))
    )
    return np.asarray(n_rows_since_clipping * dt_s <= _DISTRUST_AFTER_CLIPPING_S)


def _drop_empty_reasons(rows_by_reason: dict[str, Mask]) -> dict[str, Mask]:
    return {reason: rows for reason, rows in rows_by_reason.items() if rows.any()}


def _rows_out_of_fitted_ranges_by_reason(
    samples: Samples, model: Model, fitted_ranges: FittedRanges
) -> dict[str, Mask]:
    command_names = [f"command of {surface}" for surface in model.vehicle.surfaces]
    names_values_and_ranges = [
        *zip(command_names, samples.commands.T, fitted_ranges.command_ranges, strict=False),
        *zip(_rate_column_names(model), samples.rates.T, fitted_ranges.rate_ranges_rad_s, strict=False),
    ]
    rows_by_reason = {}
    for name, values, (low, high) in names_values_and_ranges:
        margin = _RANGE_MARGIN_SHARE * (high - low) + MIN_DIVISOR
        rows_by_reason[_outside_range_text(name, low, high)] = _mostly_true_recently(
            ~_is_within_or_unknown(values, low - margin, high + margin), samples
        )
    if fitted_ranges.airspeed_range_mps is not None and samples.airspeed is not None:
        low, high = fitted_ranges.airspeed_range_mps
        is_airspeed_out_of_range = ~_is_within_or_unknown(
            samples.airspeed,
            (1.0 - _AIRSPEED_MARGIN_SHARE_OF_LIMIT) * low,
            (1.0 + _AIRSPEED_MARGIN_SHARE_OF_LIMIT) * high,
        )
        rows_by_reason[_outside_range_text("airspeed", low, high)] = _mostly_true_recently(
            is_airspeed_out_of_range, samples
        )
    return rows_by_reason


def _outside_range_text(name: str, low: float, high: float) -> str:
    return f"{name} is outside {low:.3g} to {high:.3g}, where the model was fitted"


def _is_within_or_unknown(values: Floats, low: float, high: float) -> Mask:
    return np.asarray(~np.isfinite(values) | ((values >= low) & (values <= high)))


def _mostly_true_recently(is_true: Mask, samples: Samples) -> Mask:
    """Return the rows at which a condition held in half of the last seconds, or of the flight so far."""
    window_samples = max(round(_RANGE_WINDOW_S / samples.dt_s), 1)
    cumulated_true = np.concatenate([[0], np.cumsum(is_true)])
    window_end_rows = np.arange(1, len(is_true) + 1)
    window_begin_rows = np.maximum(window_end_rows - window_samples, 0)
    return np.asarray(
        cumulated_true[1:] - cumulated_true[window_begin_rows]
        > _MIN_OUTSIDE_SHARE * (window_end_rows - window_begin_rows)
    )


def _rate_column_names(model: Model) -> list[str]:
    return [getattr(model.vehicle.rates, axis).column for axis in "pqr"]


def _max_unchanged_time_s_by_column(samples: Samples, model: Model) -> dict[str, float]:
    """For how long each column may stand still, s: a measured rate hardly, another thrice as long as in the
    flights of the model; a rate of which these are known, from a third of MIN_STILL_S on."""
    fitted_unchanged_time_s_by_column = (
        model.fitted_ranges.longest_unchanged_time_s_by_column if model.fitted_ranges else {}
    )
    fitted_or_default_unchanged_time_s_by_column = {
        column_name: 0.0 if column_name in _rate_column_names(model) else np.inf
        for column_name in samples.time_since_change_s_by_column
    } | fitted_unchanged_time_s_by_column
    min_unchanged_time_limit_s_by_column = {
        column_name: MIN_STILL_S / 3.0
        if column_name in fitted_unchanged_time_s_by_column and column_name in _rate_column_names(model)
        else MIN_STILL_S
        for column_name in fitted_or_default_unchanged_time_s_by_column
    }
    return {
        column_name: max(
            min_unchanged_time_limit_s_by_column[column_name],
            _MAX_UNCHANGED_TIME_FACTOR * fitted_or_default_unchanged_time_s_by_column[column_name],
        )
        for column_name in samples.time_since_change_s_by_column
    }


def is_row_frozen_or_clipped(samples: Samples, model: Model) -> Mask:
    """Samples with a signal that does not live: what the filter is not to learn from."""
    is_any_column_frozen = np.zeros(len(samples.t_s), dtype=bool)
    for column_name, max_unchanged_time_s in _max_unchanged_time_s_by_column(samples, model).items():
        is_any_column_frozen |= samples.time_since_change_s_by_column[column_name] > max_unchanged_time_s
    return (
        is_any_column_frozen
        if samples.is_rate_clipped is None
        else is_any_column_frozen | samples.is_rate_clipped
    )


def with_rates_unknown_where_frozen_or_clipped(samples: Samples, model: Model) -> Samples:
    """The flight with nothing known where a signal does not live."""
    is_frozen_or_clipped = is_row_frozen_or_clipped(samples, model)
    if not is_frozen_or_clipped.any():
        return samples
    return replace(samples, rates=np.where(is_frozen_or_clipped[:, None], np.nan, samples.rates))


def credibility_entry(rows_by_reason: Mapping[str, Mask], is_credible: NDArray[np.int64]) -> Document:
    """Return the entry of verdict.json with the share of credible rows, and the reasons for the others with
    their shares."""
    share_of_reason = {reason: float(rows.mean()) for reason, rows in rows_by_reason.items()}
    reasons_largest_share_first = sorted(share_of_reason, key=lambda reason: -share_of_reason[reason])
    return {
        "share": float(is_credible.mean()) if len(is_credible) else 0.0,
        "reasons": [
            {"says": reason, "share": share_of_reason[reason]} for reason in reasons_largest_share_first
        ],
    }
