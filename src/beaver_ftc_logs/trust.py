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
from beaver_ftc_logs.column_mistakes import logs_with_one_mistake_corrected
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.samples import NOISE_MA_CANDIDATES, Samples, whiten_samples
from beaver_ftc_logs.signals import MIN_STILL_S

Mask = NDArray[np.bool_]

_RANGE_MARGIN_SHARE = 0.5
"""Share of its span by which a range is passed before a row is outside."""
_AIRSPEED_MARGIN_SHARE = 0.15
_RANGE_WINDOW_S, _MIN_OUTSIDE_SHARE = 5.0, 0.5
_MAX_UNCHANGED_TIME_FACTOR = 3.0
_MISREAD_PROBABILITY, _MAX_COMPARED_SAMPLES = 0.001, 8000
"""Probability with which chance alone may look like a mistake in the columns; samples that are compared."""
_DISTRUST_AFTER_CLIPPING_S = 30.0
_MIN_EFFECT_NOISE_POWER_RATIO = 1e-6
_MAX_EXPLAINED_SHARE, _MAX_EFFECT_NOISE_POWER_RATIO = 0.98, 12.5
"""Of an effect of so many variances of the noise a sample, a fiftieth is half a standard deviation."""
_MAX_RATE_SPREAD_RATIO, _RATE_SPREAD_FACTOR = 10.0, 1.6
_ALIKE_MOTION_FACTOR, _OTHER_UNIT_FACTOR = 3.0, 12.0
_COMMAND_UNIT_HINT = ": one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)"
_RANGE_QUANTILES = (0.001, 0.999)
_MEDIAN_CHI_SQUARE_3 = 2.366
"""The median of a square of three axes."""
MAX_REVERSED_GAIN, _MIN_COMMAND_GAIN, _MIN_COLUMN_GAIN = -0.3, 0.2, 0.5
"""Gains below which a command works the other way round, or hardly, and another column is another. Of 576
correct logs with faults of any kind none was below 0.98 and 0.87, in light turbulence 0.93 and 0.99
(`own_logs.py`, seeds 31 to 42; 71 to 201)."""


def fitted_ranges(
    flights: Sequence[tuple[Samples, Mask]],
    model: Model,
    gain_standard_error: Floats,
    noise_variance_scale: float,
) -> FittedRanges:
    """Compute the ranges in which a model was fitted. flights: with the samples used; gain_standard_error
    (G,) and noise_variance_scale: of parts not fitted."""
    groups = regression.surface_indices_by_group(model)
    rates = np.vstack([samples.rates[is_used] for samples, is_used in flights])
    commands = np.vstack([samples.commands[is_used] for samples, is_used in flights])
    known_airspeeds = [
        samples.airspeed[is_used] for samples, is_used in flights if samples.airspeed is not None
    ]
    group_commands = np.column_stack([commands[:, group].sum(axis=1) for group in groups])
    return FittedRanges(
        commands=central_ranges(commands),
        rates=central_ranges(rates),
        airspeed=central_ranges(np.concatenate(known_airspeeds)[:, None])[0] if known_airspeeds else None,
        spread=np.nanstd(rates, axis=0).tolist(),
        correlation=_correlation_matrix(group_commands).tolist(),
        tied=effect_share_explained_by_others(flights, model).tolist(),
        gain_sd=gain_standard_error.tolist(),
        still_s=_longest_unchanged_time_s_by_column(flights),
        scale=noise_variance_scale,
        energy_climb=_unpowered_energy_height_rate_mps(flights),
        minutes=sum(int(is_used.sum()) * samples.dt_s for samples, is_used in flights) / 60.0,
    )


def _unpowered_energy_height_rate_mps(flights: Sequence[tuple[Samples, Mask]]) -> float | None:
    """Return the rate of the energy height in the lowest part of healthy flight, m/s; None if not known."""
    known_climbs = [
        one.energy_height_rate_mps[is_used]
        for one, is_used in flights
        if one.energy_height_rate_mps is not None
    ]
    values = np.concatenate(known_climbs) if known_climbs else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.quantile(values, energy.UNPOWERED_ENERGY_HEIGHT_RATE_QUANTILE)) if values.size else None


def central_ranges(values: Floats) -> list[list[float]]:
    """Least and largest of each column but for the rarest, [0, 0] where nothing is known."""
    if not values.shape[1]:
        return []
    known = np.where(np.isfinite(values).any(axis=0), values, 0.0)
    return np.nanquantile(known, _RANGE_QUANTILES, axis=0).T.tolist()


def _correlation_matrix(values: Floats) -> Floats:
    centred = np.nan_to_num(values - np.nanmean(values, axis=0))
    size = np.sqrt((centred**2).sum(axis=0))
    return np.asarray(centred.T @ centred / np.maximum(np.outer(size, size), MIN_DIVISOR))


def _longest_unchanged_time_s_by_column(flights: Sequence[tuple[Samples, Mask]]) -> dict[str, float]:
    names = dict.fromkeys(name for samples, _ in flights for name in samples.time_since_change_s)
    return {
        name: max(
            (
                float(one.time_since_change_s[name].max(initial=0.0))
                for one, _ in flights
                if name in one.time_since_change_s
            )
        )
        for name in names
    }


def effect_share_explained_by_others(flights: Sequence[tuple[Samples, Mask]], model: Model) -> Floats:
    """Share of each group's effect on the rates that past, signals and the other groups make up, (G,): where
    it is near 1 the law ties the group to what it answers to, and its effect cannot be told; 1 where the
    group never moved. An effect far above the noise may be made up to a larger share: what is left counts."""
    effect_power, unexplained_power = _effect_powers(flights, model)
    has_moved = effect_power > _MIN_EFFECT_NOISE_POWER_RATIO
    explained_share = 1.0 - unexplained_power / np.minimum(
        np.where(has_moved, effect_power, 1.0), _MAX_EFFECT_NOISE_POWER_RATIO
    )
    return np.where(has_moved, np.maximum(explained_share, 0.0), 1.0)


def effect_power_unexplained_by_others(flights: Sequence[tuple[Samples, Mask]], model: Model) -> Floats:
    """Power of each group's effect on the rates that nothing else makes up, in variances of the noise a
    sample, (G,)."""
    return _effect_powers(flights, model)[1]


def _effect_powers(flights: Sequence[tuple[Samples, Mask]], model: Model) -> tuple[Floats, Floats]:
    """Power of each group's effect on the rates, in variances of the noise a sample, (G,), and of what past,
    signals and the other groups do not make up of it, (G,)."""
    groups = regression.surface_indices_by_group(model)
    regressor_order = (
        model.n_rate_lags,
        model.n_command_lags,
        True,
        model.vehicle.n_signal_lags(model.n_rate_lags),
    )
    regressor_parts = [regression.build_regressors(one, groups, *regressor_order) for one, _ in flights]
    is_used = [
        mask & is_predictable
        for (_, mask), (_, _, is_predictable) in zip(flights, regressor_parts, strict=True)
    ]
    past = np.vstack([part[0][used_rows] for part, used_rows in zip(regressor_parts, is_used, strict=True)])
    commands = np.vstack(
        [part[1][used_rows] for part, used_rows in zip(regressor_parts, is_used, strict=True)]
    )
    response, noise = np.array(model.command_response), np.array(model.residual_covariance)
    whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
    effect_power, unexplained_power = np.zeros(len(groups)), np.zeros(len(groups))
    for g in range(len(groups)):
        other_commands = [commands[:, other] for other in range(len(groups)) if other != g]
        other_regressors = np.column_stack([np.ones(len(past)), past, *other_commands])
        effect = commands[:, g] @ response[g] @ whiten
        effect = effect - effect.mean(axis=0)
        effect_power[g] = float((effect**2).sum()) / len(effect)
        if effect_power[g] > _MIN_EFFECT_NOISE_POWER_RATIO:
            unexplained_effect = (
                effect - other_regressors @ np.linalg.lstsq(other_regressors, effect, rcond=None)[0]
            )
            unexplained_power[g] = float((unexplained_effect**2).sum()) / len(effect)
    return effect_power, unexplained_power


def is_group_effect_known(model: Model) -> list[bool]:
    """Whether anything is said of each group."""
    if model.fitted_ranges is None or not model.fitted_ranges.effect_share_explained_by_others:
        return [True] * len(model.groups)
    return [share < _MAX_EXPLAINED_SHARE for share in model.fitted_ranges.effect_share_explained_by_others]


def is_group_gain_known(model: Model) -> list[bool]:
    """Whether the effect of each group is known under any law: the model may not err by all of it."""
    has_known_effect = is_group_effect_known(model)
    if (
        model.fitted_ranges is None
        or not model.fitted_ranges.group_gain_standard_error
        or not model.vehicle.other_laws
    ):
        return has_known_effect
    return [
        known_effect and regression.BOUND_WIDTH_STANDARD_ERRORS * gain_sd < 1.0
        for known_effect, gain_sd in zip(
            has_known_effect, model.fitted_ranges.group_gain_standard_error, strict=True
        )
    ]


def surfaces_of_unknown_effect(model: Model) -> set[str]:
    """The surfaces of which nothing is said."""
    pairs = zip(model.groups, is_group_effect_known(model), strict=True)
    return {name for group, has_known_effect in pairs if not has_known_effect for name in group}


def unknown_effect_sentences(model: Model) -> list[str]:
    """Why nothing is said of some groups."""
    if model.fitted_ranges is None:
        return []
    says = "of what {} does, {:.1%} follows from the rates, signals and other surfaces of the flights fitted"
    return [
        f"{says.format('+'.join(group), share)}: its effect cannot be told, nothing is said of it"
        for group, share, has_known_effect in zip(
            model.groups,
            model.fitted_ranges.effect_share_explained_by_others,
            is_group_effect_known(model),
            strict=False,
        )
        if not has_known_effect
    ]


def check_rate_units(samples: Samples, fitted: FittedRanges | None) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if fitted is None or not fitted.rate_sd_rad_s:
        return
    if not np.isfinite(samples.rates).any(axis=0).all():  # an axis without a number has no spread
        return
    spread_ratio = np.nanstd(samples.rates, axis=0) / np.maximum(fitted.rate_sd_rad_s, MIN_DIVISOR)
    mean_ratio = float(np.exp(np.mean(np.log(np.maximum(spread_ratio, MIN_DIVISOR)))))
    for unit, units_per_rad in (("deg/s", 180.0 / np.pi), ("cdeg/s", 18000.0 / np.pi), ("mrad/s", 1000.0)):
        are_axes_alike = spread_ratio.max() < _MAX_RATE_SPREAD_RATIO * spread_ratio.min()
        if (
            are_axes_alike
            and 1.0 / _RATE_SPREAD_FACTOR**2 < mean_ratio / units_per_rad < _RATE_SPREAD_FACTOR**2
        ):
            raise BadInput(
                f"{samples.name}: rates spread {mean_ratio:.3g} times as widely as in the "
                "flights of the model, "
                f"allowed: rates in rad/s; a factor of {1.0 / units_per_rad:.4g} (`unit: {unit}`) fits"
            )
        if (
            are_axes_alike
            and 1.0 / _RATE_SPREAD_FACTOR**2 < mean_ratio * units_per_rad < _RATE_SPREAD_FACTOR**2
        ):
            raise BadInput(
                f"{samples.name}: rates spread {mean_ratio:.3g} times as widely as in the "
                "flights of the model, "
                f"allowed: rates in rad/s; a factor of {units_per_rad:.4g} fits: the model's "
                f"own were in {unit}?"
            )


def check_command_units(
    flight_name: str, commands: Floats, rates: Floats, fitted: FittedRanges, surfaces: Sequence[str]
) -> None:
    """Raise BadInput where a command moves so much more or less than in the flights of the model, while every
    rate moves alike, that it is in another unit; or so much more than any rate does.

    Shapes: commands (n, S), rates (n, 3).
    """
    rate_width_ratios = _range_widths(central_ranges(rates)) / np.maximum(
        _range_widths(fitted.rate_ranges_rad_s), MIN_DIVISOR
    )
    move_rates_alike = (
        rate_width_ratios.min() > 1.0 / _ALIKE_MOTION_FACTOR
        and rate_width_ratios.max() < _ALIKE_MOTION_FACTOR
    )
    max_ratio = _OTHER_UNIT_FACTOR * (1.0 if move_rates_alike else max(rate_width_ratios.max(), 1.0))
    command_width_ratios = _range_widths(central_ranges(commands)) / np.maximum(
        _range_widths(fitted.command_ranges), MIN_DIVISOR
    )
    for surface, ratio in zip(surfaces, command_width_ratios.tolist(), strict=True):
        if max_ratio < ratio < 1e4 or (move_rates_alike and 1e-4 < ratio < 1.0 / _OTHER_UNIT_FACTOR):
            raise BadInput(
                f"{flight_name}: the command of {surface} moves {ratio:.3g} times as much as "
                "in the other flights, "
                f"the rates {rate_width_ratios.max():.2g} times at most, allowed: one unit "
                "(57.3 is deg for rad, 100 "
                "percent: `unit`, `scale`)"
            )


class _GainBoundsOverFlight(NamedTuple):
    """Answers in all parts of a flight: at most, and at least, how much of the model's answer to each group's
    command, (G,), and at most to each column, by its name, there is; the least scale of the noise; and the
    log likelihood of a sample of each part, (4,), but for what all colours have alike."""

    group_gain_upper_bounds: list[float]
    group_gain_lower_bounds: list[float]
    column_gain_upper_bounds: dict[str, float]
    min_noise_variance_scale: float
    log_likelihood_by_part: Floats


def check_columns_as_identified(samples: Samples, model: Model) -> None:
    """Raise BadInput where in every part of a flight the rates answer a command or another column as in no
    flight of the model, or do what no trim and no effectiveness explain: columns, signs or units are others,
    since no fault has always been there and changes what is not its own.

    What a law answers to gusts or to a gyro's noise looks like a command that works the other way round: an
    answer is refused only where it is wrong by each colour of the noise that is likelier, too. A model that
    knows the effect of no surface says nothing of any flight, and refuses none."""
    if not any(is_group_effect_known(model)):
        return
    whitened_flights = [
        (whiten_samples(samples, one.ma_coefficients), model.with_single_noise_model(one))
        for one in model.noise_models
    ]
    compared = [
        (one, found)
        for one in whitened_flights or [(samples, model)]
        if (found := _log_likelihood_by_flight_part(*one))
    ]
    if not compared:
        return
    flight, likeliest_model = max(compared, key=lambda one: one[1][0].mean())[0]
    gain_bounds = _bound_gains_over_flight_parts(flight, likeliest_model)
    if gain_bounds is None:
        return
    mistakes = _column_mistake_texts(samples, model, gain_bounds)
    for noise_ma_coefficients in NOISE_MA_CANDIDATES if mistakes else ():
        other_gains = _bound_gains_over_flight_parts(whiten_samples(samples, noise_ma_coefficients), model)
        if (
            other_gains is not None
            and other_gains.log_likelihood_by_part.mean() > gain_bounds.log_likelihood_by_part.mean()
        ):
            other_mistakes = _column_mistake_texts(samples, model, other_gains)
            mistakes = {what: says for what, says in mistakes.items() if what in other_mistakes}
    says = next(iter(mistakes.values()), None) or _likelier_column_mistake_text(flight, likeliest_model)
    if says is not None:
        allowed = "allowed: columns, signs and units as in the flights of the model"
        raise BadInput(f"{samples.name}: {says}, {allowed}")


def _column_mistake_texts(
    samples: Samples, model: Model, gain_bounds: _GainBoundsOverFlight
) -> dict[str, str]:
    """Return the mistakes in the rates' answers to a flight's columns, by kind and column, the surest
    first."""
    mistakes, gain_known = {}, is_group_gain_known(model)
    for group, has_known_gain, max_gain, min_gain in zip(
        model.groups,
        gain_known,
        gain_bounds.group_gain_upper_bounds,
        gain_bounds.group_gain_lower_bounds,
        strict=True,
    ):
        name, relative_motion = "+".join(group), _relative_command_motion(samples, model, group)
        command, motion_text = (
            f"the command of {name}",
            f"moves {relative_motion:.3g} times as much as in the flights of the",
        )
        if max_gain < MAX_REVERSED_GAIN:
            says = f"the rates answer {command} the other way round in all of it (does `scale: -1` fit?)"
            mistakes[f"sign {name}"] = says
        elif has_known_gain and max_gain < _MIN_COMMAND_GAIN and relative_motion > _ALIKE_MOTION_FACTOR:
            effect_text = f"does at most {max_gain:.2g} of what it did"
            mistakes[f"unit {name}"] = f"{command} {motion_text} model, and {effect_text}{_COMMAND_UNIT_HINT}"
        elif (
            has_known_gain
            and min_gain > 1.0 / _MIN_COMMAND_GAIN
            and 0.0 < relative_motion < 1.0 / _ALIKE_MOTION_FACTOR
        ):
            effect_text = f"does at least {min_gain:.3g} times what it did"
            mistakes[f"unit {name}"] = f"{command} {motion_text} model, and {effect_text}{_COMMAND_UNIT_HINT}"
    if odd_columns := [
        name
        for name, share in gain_bounds.column_gain_upper_bounds.items()
        if share < _min_plausible_column_gain(model, name)
    ]:
        says = (
            f"what the rates answer to {', '.join(odd_columns)} is not what it is in the model, in all of it"
        )
        mistakes["columns"] = says
    return mistakes


def _min_plausible_column_gain(model: Model, column_name: str) -> float:
    """The gain of what the rates answer to a column below which it is another: below what the model's error
    explains; none where that may be all of it."""
    gain_sd = (
        model.fitted_ranges.gain_standard_error_by_column.get(column_name, 0.0)
        if model.fitted_ranges is not None
        else 0.0
    )
    min_gain = 1.0 - regression.BOUND_WIDTH_STANDARD_ERRORS * gain_sd
    return min(_MIN_COLUMN_GAIN, min_gain) if min_gain > 0.0 else -np.inf


def _likelier_column_mistake_text(samples: Samples, model: Model) -> str | None:
    """The mistake in the columns without which a flight is likelier in every part of it, where there is one.

    By chance a wrong reading is K times as likely as the true one in at most one part of K (Markov's
    inequality for a likelihood ratio); all readings together have the chance `_MISREAD_PROBABILITY`. That
    holds for a correct model. The flight must be likelier by as much more as flights were that the model was
    not fitted on, whose columns are right, and by as much again for another law (`FittedRanges.misread`).
    """
    gain_of_mistake, n_part_samples = log_likelihood_gain_of_corrections(samples, model)
    if not gain_of_mistake:
        return None
    says, largest_gain = max(gain_of_mistake.items(), key=lambda one: one[1])
    usual_gain = (
        2.0 * model.fitted_ranges.max_column_mistake_log_likelihood_gain
        if model.fitted_ranges is not None
        else 0.0
    )
    if (
        largest_gain * n_part_samples
        <= np.log(len(gain_of_mistake) / _MISREAD_PROBABILITY) + usual_gain * n_part_samples
    ):
        return None
    log10_ratio = largest_gain * n_part_samples / np.log(10.0)
    return f"each part of the flight is at least 10^{log10_ratio:.0f} times as likely with {says}"


def log_likelihood_gain_of_corrections(samples: Samples, model: Model) -> tuple[dict[str, float], float]:
    """By each mistake in the columns how much likelier a sample is without it, in natural logarithms, in the
    part of the flight where that is least; and as how many samples a part counts."""
    corrected = list(
        logs_with_one_mistake_corrected(samples, model.vehicle, surfaces_of_unknown_effect(model))
    )
    log_likelihood = _log_likelihood_by_flight_part(samples, model)
    if log_likelihood is None:
        return {}, 0.0
    part_likelihoods, n_part_samples = log_likelihood
    gain_of_mistake = {}
    for correction in corrected:
        corrected_likelihood = _log_likelihood_by_flight_part(correction.samples, model)
        gain_of_mistake[correction.correction_text] = (
            -np.inf
            if corrected_likelihood is None
            else float((corrected_likelihood[0] + correction.log_jacobian - part_likelihoods).min())
        )
    return gain_of_mistake, n_part_samples


def _log_likelihood_by_flight_part(samples: Samples, model: Model) -> tuple[Floats, float] | None:
    """Log likelihood of a sample of each part of the flight, as in `_GainBoundsOverFlight`, and the effective
    number of white samples of a part; of a long flight every k-th sample is taken. None where a part is too
    short."""
    whitening, effective_sample_share, log_noise_size = _flight_noise_whitening(samples, model)
    is_predictable, unexplained, responses = regression.whitened_rates_and_responses(samples, model)
    rows = np.flatnonzero(is_predictable)
    if (
        parts := regression.split_into_flight_parts(rows[:: max(len(rows) // _MAX_COMPARED_SAMPLES, 1)])
    ) is None:
        return None
    fits = [_trim_and_gain_regression(part, unexplained, responses, whitening) for part in parts]
    noise_scales = [
        _noise_variance_scale(regression.coefficient_upper_bounds(x, y, effective_sample_share)[1])
        for x, y in fits
    ]
    return -log_noise_size - 1.5 * np.log(noise_scales), effective_sample_share * min(map(len, parts))


def _flight_noise_whitening(samples: Samples, model: Model) -> tuple[Floats, float, float]:
    """Return the matrix that whitens the residual of a flight of a colour, (3, 3), as how many white samples
    one counts, and the logarithm of the size of the noise of a sample that is not filtered."""
    noise_inflation = model.noise_inflation(samples.noise_ma_coefficients)
    noise_root = np.linalg.cholesky(
        model.with_noise_model(samples.noise_ma_coefficients).coefficient_arrays()[3] / noise_inflation
    )
    log_noise_size = float(
        np.log(np.diag(noise_root)).sum() - 3.0 * np.log(sum(samples.noise_ma_coefficients or (1.0,)))
    )
    return (
        np.linalg.inv(noise_root).T,
        model.settings.effective_sample_share / noise_inflation,
        log_noise_size,
    )


def _trim_and_gain_regression(
    part_rows: NDArray[np.int64], unexplained: Floats, responses: Floats, whitening: Floats
) -> tuple[Floats, Floats]:
    """Regressors (3 n, 3 + K) of trim and responses (n, K, 3), and what they are to explain, (3 n,)."""
    trim = np.broadcast_to(np.eye(3), (len(part_rows), 3, 3))
    regressors = np.concatenate([trim, responses[part_rows]], axis=1) @ whitening
    return regressors.transpose(0, 2, 1).reshape(3 * len(part_rows), -1), (
        unexplained[part_rows] @ whitening
    ).ravel()


def _noise_variance_scale(squared_residual: Floats) -> float:
    """The scale of the noise by the squares of what is left, (3 n,)."""
    return float(np.median(squared_residual.reshape(-1, 3).sum(axis=1)) / _MEDIAN_CHI_SQUARE_3)


def _bound_gains_over_flight_parts(samples: Samples, model: Model) -> _GainBoundsOverFlight | None:
    """None where a part is too short."""
    is_predictable, unexplained, responses = regression.whitened_rates_and_responses(samples, model)
    if (parts := regression.split_into_flight_parts(np.flatnonzero(is_predictable))) is None:
        return None
    columns, names = _column_contributions_to_rates(samples, model)
    columns = regression.subtract_noise_prediction(
        columns, model.residual_ar_coefficients(samples.noise_ma_coefficients)
    )
    (whitening, effective_sample_share, log_noise_size), n_groups = (
        _flight_noise_whitening(samples, model),
        len(model.groups),
    )
    max_gains, min_gains, column_gain_upper_bounds = (
        np.full(n_groups, -np.inf),
        np.full(n_groups, np.inf),
        np.full(len(names), -np.inf),
    )
    noise_scales, all_responses = [], np.concatenate([responses, columns], axis=1)
    for part in parts:
        regressors, whitened_residual = _trim_and_gain_regression(part, unexplained, all_responses, whitening)
        max_gain, squared_residual = regression.coefficient_upper_bounds(
            regressors[:, : 3 + n_groups], whitened_residual, effective_sample_share
        )
        negated_min_gain, _ = regression.coefficient_upper_bounds(
            -regressors[:, : 3 + n_groups], whitened_residual, effective_sample_share
        )
        column_gain, _ = regression.coefficient_upper_bounds(
            regressors, whitened_residual, effective_sample_share
        )
        max_gains, min_gains = (
            np.maximum(max_gains, max_gain[3:]),
            np.minimum(min_gains, -negated_min_gain[3:]),
        )
        column_gain_upper_bounds = np.maximum(
            column_gain_upper_bounds, 1.0 + column_gain[3 + n_groups :]
        )  # what the past does is taken off already
        noise_scales.append(_noise_variance_scale(squared_residual))
    return _GainBoundsOverFlight(
        max_gains.tolist(),
        min_gains.tolist(),
        dict(zip(names, column_gain_upper_bounds.tolist(), strict=True)),
        min(noise_scales),
        -log_noise_size - 1.5 * np.log(noise_scales),
    )


def _relative_command_motion(samples: Samples, model: Model, group: list[str]) -> float:
    """Return how many times as far as in the flights of the model a group's command moves; 0 where these are
    not known."""
    if model.fitted_ranges is None or not model.fitted_ranges.command_ranges:
        return 0.0
    width_ratios = _range_widths(central_ranges(samples.commands)) / np.maximum(
        _range_widths(model.fitted_ranges.command_ranges), MIN_DIVISOR
    )
    return max(float(width_ratios[list(model.vehicle.surfaces).index(name)]) for name in group)


def _column_contributions_to_rates(samples: Samples, model: Model) -> tuple[Floats, list[str]]:
    """Compute the contribution of each column to each predicted sample: rates of the other axes, and signals,
    (n, C, 3); and their names."""
    n_signal_lags = model.vehicle.n_signal_lags(model.n_rate_lags)
    past, _, _ = regression.build_regressors(samples, [[0]], model.n_rate_lags, 1, False, n_signal_lags)
    parts = cross_axis_coefficients(model)
    return np.stack([past[:, rows] @ coefficients for rows, coefficients in parts.values()], axis=1), list(
        parts
    )


def cross_axis_coefficients(model: Model) -> dict[str, tuple[list[int], Floats]]:
    """By column of rates and signals its rows of `past`, and their coefficients (K, 3) but for those of a
    rate on its own axis."""
    rates = [getattr(model.vehicle.rates, axis).column for axis in "pqr"]
    names = rates * model.n_rate_lags + model.vehicle.signal_regressor_names * model.vehicle.n_signal_lags(
        model.n_rate_lags
    )
    coefficients, rows_of_column = np.array(model.past_coefficients), dict[str, list[int]]()
    for row, name in enumerate(names):
        rows_of_column.setdefault(name.removesuffix(" by airspeed"), []).append(row)
        if row < 3 * model.n_rate_lags:
            coefficients[row, row % 3] = 0.0
    return {name: (column_rows, coefficients[column_rows]) for name, column_rows in rows_of_column.items()}


def _range_widths(ranges: Sequence[Sequence[float]]) -> Floats:
    return np.ptp(np.array(ranges, dtype=float).reshape(-1, 2), axis=1)


def rows_not_credible_by_reason(samples: Samples, model: Model) -> dict[str, Mask]:
    """Rows that are not credible, by reason."""
    reasons: dict[str, Mask] = {}
    for name, max_unchanged_time_s in _max_unchanged_time_s_by_column(samples, model).items():
        reasons[f"{name} stands still, for longer than {max_unchanged_time_s:.3g} s"] = (
            samples.time_since_change_s[name] > max_unchanged_time_s
        )
    if samples.is_rate_clipped is not None:
        reasons[f"a rate was clipped in the last {_DISTRUST_AFTER_CLIPPING_S:g} s"] = _was_clipped_recently(
            samples.is_rate_clipped, samples.dt_s
        )
    if model.fitted_ranges is None:
        return _drop_empty_reasons(reasons)
    return _drop_empty_reasons(
        reasons | _rows_out_of_fitted_ranges_by_reason(samples, model, model.fitted_ranges)
    )


def _was_clipped_recently(is_clipped: Mask, dt_s: float) -> Mask:
    """Whether a condition held in the last half minute."""
    row_index = np.arange(len(is_clipped))
    rows_since = row_index - np.maximum.accumulate(
        np.where(is_clipped, row_index, -len(is_clipped) - round(_DISTRUST_AFTER_CLIPPING_S / dt_s))
    )
    return np.asarray(rows_since * dt_s <= _DISTRUST_AFTER_CLIPPING_S)


def _drop_empty_reasons(reasons: dict[str, Mask]) -> dict[str, Mask]:
    return {reason: rows for reason, rows in reasons.items() if rows.any()}


def _rows_out_of_fitted_ranges_by_reason(
    samples: Samples, model: Model, fitted: FittedRanges
) -> dict[str, Mask]:
    names = [f"command of {surface}" for surface in model.vehicle.surfaces]
    columns = [
        *zip(names, samples.commands.T, fitted.command_ranges, strict=False),
        *zip(_rate_column_names(model), samples.rates.T, fitted.rate_ranges_rad_s, strict=False),
    ]
    reasons = {}
    for name, values, (low, high) in columns:
        margin = _RANGE_MARGIN_SHARE * (high - low) + MIN_DIVISOR
        reasons[_outside_range_text(name, low, high)] = _mostly_true_recently(
            ~_is_within_or_unknown(values, low - margin, high + margin), samples
        )
    if fitted.airspeed_range_mps is not None and samples.airspeed is not None:
        low, high = fitted.airspeed_range_mps
        is_outside = ~_is_within_or_unknown(
            samples.airspeed, (1.0 - _AIRSPEED_MARGIN_SHARE) * low, (1.0 + _AIRSPEED_MARGIN_SHARE) * high
        )
        reasons[_outside_range_text("airspeed", low, high)] = _mostly_true_recently(is_outside, samples)
    return reasons


def _outside_range_text(name: str, low: float, high: float) -> str:
    return f"{name} is outside {low:.3g} to {high:.3g}, where the model was fitted"


def _is_within_or_unknown(values: Floats, low: float, high: float) -> Mask:
    return np.asarray(~np.isfinite(values) | ((values >= low) & (values <= high)))


def _mostly_true_recently(is_true: Mask, samples: Samples) -> Mask:
    """Return the rows at which a condition held in half of the last seconds, or of the flight so far."""
    window_samples = max(round(_RANGE_WINDOW_S / samples.dt_s), 1)
    n_true, end = np.concatenate([[0], np.cumsum(is_true)]), np.arange(1, len(is_true) + 1)
    begin = np.maximum(end - window_samples, 0)
    return np.asarray(n_true[1:] - n_true[begin] > _MIN_OUTSIDE_SHARE * (end - begin))


def _rate_column_names(model: Model) -> list[str]:
    return [getattr(model.vehicle.rates, axis).column for axis in "pqr"]


def _max_unchanged_time_s_by_column(samples: Samples, model: Model) -> dict[str, float]:
    """For how long each column may stand still, s: a measured rate hardly, another thrice as long as in the
    flights of the model; a rate of which these are known, from a third of MIN_STILL_S on."""
    fitted_unchanged_time_s = (
        model.fitted_ranges.longest_unchanged_time_s_by_column if model.fitted_ranges else {}
    )
    usual_unchanged_time_s = {
        name: 0.0 if name in _rate_column_names(model) else np.inf for name in samples.time_since_change_s
    } | fitted_unchanged_time_s
    min_unchanged_time_s = {
        name: MIN_STILL_S / 3.0
        if name in fitted_unchanged_time_s and name in _rate_column_names(model)
        else MIN_STILL_S
        for name in usual_unchanged_time_s
    }
    return {
        name: max(min_unchanged_time_s[name], _MAX_UNCHANGED_TIME_FACTOR * usual_unchanged_time_s[name])
        for name in samples.time_since_change_s
    }


def is_frozen_or_clipped_sample(samples: Samples, model: Model) -> Mask:
    """Samples with a signal that does not live: what the filter is not to learn from."""
    is_dead = np.zeros(len(samples.t_s), dtype=bool)
    for name, max_unchanged_time_s in _max_unchanged_time_s_by_column(samples, model).items():
        is_dead |= samples.time_since_change_s[name] > max_unchanged_time_s
    return is_dead if samples.is_rate_clipped is None else is_dead | samples.is_rate_clipped


def with_rates_unknown_where_frozen_or_clipped(samples: Samples, model: Model) -> Samples:
    """The flight with nothing known where a signal does not live."""
    is_dead = is_frozen_or_clipped_sample(samples, model)
    if not is_dead.any():
        return samples
    return replace(samples, rates=np.where(is_dead[:, None], np.nan, samples.rates))


def credibility_entry(reasons: Mapping[str, Mask], is_credible: NDArray[np.int64]) -> Document:
    """Return the entry of verdict.json with the share of credible rows, and the reasons for the others with
    their shares."""
    shares = {reason: float(rows.mean()) for reason, rows in reasons.items()}
    reasons_by_share = sorted(shares, key=lambda reason: -shares[reason])
    return {
        "share": float(is_credible.mean()) if len(is_credible) else 0.0,
        "reasons": [{"says": reason, "share": shares[reason]} for reason in reasons_by_share],
    }
