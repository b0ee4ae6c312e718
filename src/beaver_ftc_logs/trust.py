"""Credible or silent: where a model may be believed, and why not elsewhere.

What a model was fitted on is in its file (`FittedRanges`). A row is credible where the commands, rates and
the airspeed of the last seconds are such as the fit has seen, and where every signal lives. Elsewhere nothing
is said: no name, and bounds of 0 and 1. The size of the residual does not count, since a fault makes it large
too: where it is larger than in the flights of the model, the filter takes the noise to be as much larger, and
a sample counts for less. A log is refused only where a mistake in its columns explains it.
A row uses nothing later than its time.

    flights, used   each flight, and its samples that were used
    y, F            unexplained rates (n, 3), rad/s, and responses (n, G, 3), as in `regression`
    Z, v            regressors (3 n, 3 + G) of trim and responses, and what they explain, whitened (3 n,)
    W, share        whitening matrix (3, 3), and as how many white samples one counts
    lo, hi          least and largest gain of a group, 1 in the model
    ll              log likelihood of a sample
    known           which groups have an effect that is known (G,)
    reasons         rows that are not credible, by reason
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import energy, regression
from beaver_ftc_logs.column_mistakes import corrected_logs, log_without_signal
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Mask, Reasons
from beaver_ftc_logs.regression import Parts
from beaver_ftc_logs.runs import trailing_sums
from beaver_ftc_logs.samples import NOISE_MA_CANDIDATES, Samples, whiten_samples
from beaver_ftc_logs.signals import MIN_STILL_S
from beaver_ftc_logs.units import RATE, SI_UNITS, nearest_unit

_RANGE_MARGIN_SHARE = 0.5
"""Share of its span by which a range is passed before a row is outside."""
_AIRSPEED_MARGIN = 0.15
_RANGE_WINDOW_S, _MIN_OUTSIDE_SHARE = 5.0, 0.5
_MAX_STILL_FACTOR = 3.0
_FALSE_MISTAKE_CHANCE, _MAX_COMPARED_SAMPLES = 0.001, 8000
"""Probability with which chance alone may look like a mistake in the columns; samples that are compared."""
_CLIPPING_MEMORY_S = 30.0
_MAX_TIED_SHARE = 0.98
_MAX_AXIS_RATIO, _UNIT_FACTOR_ROOT = 10.0, 1.6
_MAX_ALIKE_FACTOR, _MIN_UNIT_FACTOR = 3.0, 12.0
_COMMAND_UNIT_HINT = ": one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)"
_RANGE_QUANTILES = (0.001, 0.999)
MAX_REVERSED_GAIN, _MIN_COMMAND_GAIN = -0.3, 0.2
"""Gains below which a command works the other way round, or hardly. Of 576 correct logs with faults of any
kind none was below 0.98, in light turbulence 0.93 (`own_logs.py`, seeds 31 to 42; 71 to 201)."""
_REVERSED_GAIN_LIMIT = -0.5
"""Half-way from the gain of a wrong sign, -1, to that of a lost surface, 0."""


def compute_fitted_ranges(parts: Parts, tied: Floats, gain_sd: Floats) -> FittedRanges:
    """Compute the ranges in which a model was fitted. tied (G,): as of `orders.tied_shares`; gain_sd (G,):
    standard errors, of parts not fitted."""

    def usable(name: str) -> Floats:
        return np.concatenate([getattr(part.samples, name)[part.is_usable] for part in parts])

    airspeeds, climbs = usable("airspeed"), usable("energy_height_rate_mps")
    climbs = climbs[np.isfinite(climbs)]
    is_airspeed_known = np.isfinite(airspeeds).any()
    still: dict[str, float] = {}
    for part in parts:
        for name, still_s in part.samples.unchanged_s.items():
            still[name] = max(still.get(name, 0.0), float(still_s.max(initial=0.0)))
    return FittedRanges(
        commands=central_ranges(usable("commands")),
        rates=central_ranges(usable("rates")),
        airspeed=central_ranges(airspeeds[:, None])[0] if is_airspeed_known else None,
        tied=tied.tolist(),
        gain_sd=gain_sd.tolist(),
        still_s=still,
        energy_climb=float(np.quantile(climbs, energy.UNPOWERED_SHARE)) if climbs.size else None,
    )


def central_ranges(values: Floats) -> list[list[float]]:
    """Least and largest of each column but for the rarest, [0, 0] where nothing is known."""
    if not values.shape[1]:
        return []
    known = np.where(np.isfinite(values).any(axis=0), values, 0.0)
    return np.nanquantile(known, _RANGE_QUANTILES, axis=0).T.tolist()


def known_effects(model: Model) -> Mask:
    """Whether anything is said of each group, (G,)."""
    return np.array(model.fitted.tied or [0.0] * len(model.groups)) < _MAX_TIED_SHARE


def known_gains(model: Model) -> Mask:
    """Whether the effect of each group is known under any law, (G,): the model may not err by all of it."""
    known = known_effects(model)
    if not model.fitted.gain_sd or not model.vehicle.other_laws:
        return known
    return known & (regression.BOUND_MARGIN * np.array(model.fitted.gain_sd) < 1.0)


def unknown_surfaces(model: Model) -> set[str]:
    """The surfaces of which nothing is said."""
    return {name for group in compress(model.groups, ~known_effects(model)) for name in group}


def unknown_sentences(model: Model) -> list[str]:
    """Why nothing is said of some groups."""
    start = "of what {} does, {:.1%} follows from the rates, signals and other surfaces of the flights fitted"
    rows = zip(model.group_names, model.fitted.tied, known_effects(model), strict=False)
    return [
        f"{start.format(name, share)}: its effect cannot be told, nothing is said of it"
        for name, share, known in rows
        if not known
    ]


def refuse_rate_unit(samples: Samples, ranges: FittedRanges) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if not ranges.rates:
        return
    ratios = _relative_motion(samples.rates, ranges.rates)
    if not ratios.max() < _MAX_AXIS_RATIO * ratios.min():  # an axis without a number does not move
        return
    ratio = float(np.exp(np.mean(np.log(ratios))))
    hints = (
        (1.0 / ratio, "a factor of {0:.4g} (`unit: {2}`) fits"),
        (ratio, "a factor of {1:.4g} fits: the model's own were in {2}?"),
    )
    for size, hint in hints:
        unit = nearest_unit(RATE, size, _UNIT_FACTOR_ROOT**2)
        if unit not in (None, "rad/s"):
            text = hint.format(SI_UNITS[unit][1], 1.0 / SI_UNITS[unit][1], unit)
            motion = f"rates spread {ratio:.3g} times as widely as in the flights of the model"
            raise BadInput(f"{samples.name}: {motion}, allowed: rates in rad/s; {text}")


def refuse_command_unit(
    name: str, commands: Floats, rates: Floats, ranges: FittedRanges, surfaces: Sequence[str]
) -> None:
    """Raise BadInput where a command moves so much more or less than in the flights of the model, while every
    rate moves alike, that it is in another unit; or so much more than any rate does.

    Shapes: commands (n, S), rates (n, 3).
    """
    rate_ratios = _relative_motion(rates, ranges.rates)
    alike = rate_ratios.min() > 1.0 / _MAX_ALIKE_FACTOR and rate_ratios.max() < _MAX_ALIKE_FACTOR
    allowed = _MIN_UNIT_FACTOR * (1.0 if alike else max(rate_ratios.max(), 1.0))
    ratios = _relative_motion(commands, ranges.commands)
    for surface, ratio in zip(surfaces, ratios.tolist(), strict=True):
        if allowed < ratio < 1e4 or (alike and 1e-4 < ratio < 1.0 / _MIN_UNIT_FACTOR):
            raise BadInput(
                f"{name}: the command of {surface} moves {ratio:.3g} times as much as in the other flights, "
                f"the rates {rate_ratios.max():.2g} times at most, allowed{_COMMAND_UNIT_HINT}"
            )


class Answers(NamedTuple):
    """How the rates of each part of a flight answer the groups' commands: bounds of the gains lower and
    upper, (4, G), 1 as in the model; log likelihood of a sample (4,), but for what all colours have alike;
    as how many white samples a part counts."""

    lower: Floats
    upper: Floats
    likelihood: Floats
    n_white: float


def answers(samples: Samples, model: Model, most: int | None = None) -> Answers | None:
    """The answers in all parts of a flight, of a long one by every k-th sample, so that about `most` are
    left; None where a part is too short."""
    flight = regression.innovations(samples, model)
    rows = np.flatnonzero(flight.is_known)
    step = max(len(rows) // most, 1) if most else 1
    if (parts := regression.split_parts(rows[::step])) is None:
        return None
    share = model.settings.power / flight.noise.wider
    bounds = [flight.at(part).gain_bounds(share) for part in parts]
    lower, upper, scales = (np.array(each) for each in zip(*bounds, strict=True))
    likelihood = -flight.log_size - 1.5 * np.log(scales)
    return Answers(lower, upper, likelihood, share * min(map(len, parts)))


def refuse_columns(samples: Samples, model: Model) -> None:
    """Raise BadInput where in every part of a flight the rates answer a command or another column as in no
    flight of the model, or do what no trim and no effectiveness explain: columns, signs or units are others,
    since no fault has always been there and changes what is not its own.

    What a law answers to gusts or to a gyro's noise looks like a command that works the other way round: an
    answer is refused only where it is wrong by each colour of the noise that is likelier, too. A model that
    knows the effect of no surface says nothing of any flight, and refuses none."""
    if not any(known_effects(model)):
        return
    flight, likeliest = _whiten_likeliest(samples, model)
    if (found := answers(flight, likeliest)) is None:
        return
    mistakes = _mistake_texts(samples, model, found)
    for ma in NOISE_MA_CANDIDATES if mistakes else ():
        other = answers(whiten_samples(samples, ma), model)
        if other is not None and other.likelihood.mean() > found.likelihood.mean():
            likelier = _mistake_texts(samples, model, other)
            mistakes = {key: text for key, text in mistakes.items() if key in likelier}
    text = next(iter(mistakes.values()), None) or _likelier_mistake(flight, likeliest)
    if text is not None:
        allowed = "allowed: columns, signs and units as in the flights of the model"
        raise BadInput(f"{samples.name}: {text}, {allowed}")


def _whiten_likeliest(samples: Samples, model: Model) -> tuple[Samples, Model]:
    """Return the flight whitened by the noise of the model that makes it likeliest, and the model with this
    noise alone."""
    return max(regression.by_noise(samples, model), key=lambda pair: _likelihoods(*pair).mean())


def find_reversed(samples: Samples, model: Model) -> list[list[str]]:
    """The groups of known effect to whose command the rates answer the other way round, by least squares
    over all of a flight: a gain nearer to -1 than to 0, which is that of a lost surface."""
    flight = regression.innovations(*_whiten_likeliest(samples, model))
    rows = np.flatnonzero(flight.is_known)
    if regression.split_parts(rows) is None:
        return []
    is_reversed = known_effects(model) & (flight.at(rows).gains() < _REVERSED_GAIN_LIMIT)
    return list(compress(model.groups, is_reversed))


def _mistake_texts(samples: Samples, model: Model, found: Answers) -> dict[str, str]:
    """Return the mistakes in the rates' answers to a flight's columns, by kind and column, the surest
    first."""
    mistakes = {}
    known, surfaces = known_gains(model), list(model.vehicle.surfaces)
    motions = np.zeros(len(surfaces))
    if model.fitted.commands:
        motions = _relative_motion(samples.commands, model.fitted.commands)
    highest, lowest = found.upper.max(axis=0), found.lower.min(axis=0)
    for group, sure, hi, lo in zip(model.groups, known, highest, lowest, strict=True):
        name = "+".join(group)
        motion = max(motions[surfaces.index(surface)] for surface in group)
        command = f"the command of {name}"
        moves = f"{command} moves {motion:.3g} times as much as in the flights of the model, and does"
        if hi < MAX_REVERSED_GAIN:
            text = f"the rates answer {command} the other way round in all of it (does `scale: -1` fit?)"
            mistakes[f"sign {name}"] = text
        elif sure and hi < _MIN_COMMAND_GAIN and motion > _MAX_ALIKE_FACTOR:
            mistakes[f"unit {name}"] = f"{moves} at most {hi:.2g} of what it did{_COMMAND_UNIT_HINT}"
        elif sure and lo > 1.0 / _MIN_COMMAND_GAIN and 0.0 < motion < 1.0 / _MAX_ALIKE_FACTOR:
            mistakes[f"unit {name}"] = f"{moves} at least {lo:.3g} times what it did{_COMMAND_UNIT_HINT}"
    return mistakes


def _likelier_mistake(samples: Samples, model: Model) -> str | None:
    """The mistake in the columns without which a flight is likelier in every part of it, where there is one.

    By chance a wrong reading is K times as likely as the true one in at most one part of K (Markov's
    inequality for a likelihood ratio); all readings together have the chance `_FALSE_MISTAKE_CHANCE`. That
    holds for a correct model.
    """
    gains, n = mistake_gains(samples, model)
    if not gains:
        return None
    text, gain = max(gains.items(), key=lambda one: one[1])
    if gain * n <= np.log(len(gains) / _FALSE_MISTAKE_CHANCE):
        return None
    log10 = gain * n / np.log(10.0)
    return f"each part of the flight is at least 10^{log10:.0f} times as likely with {text}"


def mistake_gains(samples: Samples, model: Model) -> tuple[dict[str, float], float]:
    """By each mistake in the columns how much likelier a sample is without it, in natural logarithms, in the
    part of the flight where that is least; and as how many samples a part counts.

    A mended signal must also be likelier than no signal, by as much in all parts together. Where the model
    errs in a signal's effect, a smaller or reversed effect may be likelier than the modelled one, while none
    is likelier still.
    """
    found = answers(samples, model, _MAX_COMPARED_SAMPLES)
    if found is None:
        return {}, 0.0
    without = {
        signal: _likelihoods(log_without_signal(samples, model.vehicle, signal), model)
        for signal in model.vehicle.signal_columns
    }
    gains = {}
    for log in corrected_logs(samples, model.vehicle, unknown_surfaces(model)):
        ll = _likelihoods(log.samples, model) + log.log_jacobian
        gain = float((ll - found.likelihood).min())
        if signal := log.scaled_signal:
            gain = min(gain, float((ll - without[signal]).sum()))
        gains[log.correction_text] = gain
    return gains, found.n_white


def _likelihoods(samples: Samples, model: Model) -> Floats:
    """Log likelihood of a sample of each part of the flight; minus infinity where a part is too short."""
    found = answers(samples, model, _MAX_COMPARED_SAMPLES)
    return np.array(-np.inf) if found is None else found.likelihood


def _relative_motion(values: Floats, fitted: Sequence[Sequence[float]]) -> Floats:
    """Return how many times as far as in the model's flights each column of values (n, S) moves, (S,)."""
    spans = [np.ptp(np.array(ranges).reshape(-1, 2), axis=1) for ranges in (central_ranges(values), fitted)]
    return spans[0] / np.maximum(spans[1], MIN_DIVISOR)


def untrusted_rows(samples: Samples, model: Model) -> Reasons:
    """Rows that are not credible, by reason."""
    reasons: Reasons = _still_rows(samples, model)
    n = np.floor(_CLIPPING_MEMORY_S / samples.dt_s) + 1.0
    recent, _ = trailing_sums(samples.is_rate_clipped, n)
    reasons[f"a rate was clipped in the last {_CLIPPING_MEMORY_S:g} s"] = recent > 0
    return reasons | _rows_out_of_range(samples, model)


def _rows_out_of_range(samples: Samples, model: Model) -> Reasons:
    """Rows in which a command, a rate or the airspeed was outside for most of the last seconds, or of the
    flight so far, by reason."""
    ranges = model.fitted
    commands = [f"command of {surface}" for surface in model.vehicle.surfaces]
    channels = [
        *zip(commands, samples.commands.T, ranges.commands, strict=False),
        *zip(model.vehicle.rate_columns, samples.rates.T, ranges.rates, strict=False),
    ]
    if ranges.airspeed is not None:
        channels.append(("airspeed", samples.airspeed, ranges.airspeed))
    reasons = {}
    for name, values, (lo, hi) in channels:
        margin = _RANGE_MARGIN_SHARE * (hi - lo) + MIN_DIVISOR
        margins = _AIRSPEED_MARGIN * np.array([lo, hi]) if name == "airspeed" else (margin, margin)
        outside = (values < lo - margins[0]) | (values > hi + margins[1])
        reason = f"{name} is outside {lo:.3g} to {hi:.3g}, where the model was fitted"
        sums, n = trailing_sums(outside, _RANGE_WINDOW_S / samples.dt_s)
        reasons[reason] = sums > _MIN_OUTSIDE_SHARE * n
    return reasons


def _still_rows(samples: Samples, model: Model) -> Reasons:
    """Rows in which a column has stood still for too long, by reason: a measured rate may hardly, another
    thrice as long as in the model's flights; a rate of which these are known, from MIN_STILL_S / 3 on."""
    fitted = model.fitted.still_s
    rates = model.vehicle.rate_columns
    reasons = {}
    for name, unchanged_s in samples.unchanged_s.items():
        still_s = fitted.get(name, 0.0 if name in rates else np.inf)
        least_s = MIN_STILL_S / 3.0 if name in fitted and name in rates else MIN_STILL_S
        limit_s = max(least_s, _MAX_STILL_FACTOR * still_s)
        reasons[f"{name} stands still, for longer than {limit_s:.3g} s"] = unchanged_s > limit_s
    return reasons


def without_dead_rows(samples: Samples, model: Model) -> Samples:
    """The flight with nothing known where a signal does not live: the filter is not to learn from it."""
    dead = np.any([*_still_rows(samples, model).values(), samples.is_rate_clipped], axis=0)
    if not dead.any():
        return samples
    return replace(samples, rates=np.where(dead[:, None], np.nan, samples.rates))
