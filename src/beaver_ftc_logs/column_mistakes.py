"""Mistakes in the columns of a log: exchanged columns, another sign or unit. A log with one is refused.

A large residual may come from a fault, from the air, or from such a mistake. There are three tests:

1. All rates, or a command, move much more or less than in the flights of the model (`refuse_rate_unit`,
   `refuse_command_unit`).
2. The gain of a command is opposite to that of the model, or as small or large as its motion is large or
   small (`_command_mistakes`).
3. The log is likelier with one mistake corrected (`mistake_gains`).

A mistake is there from the first sample to the last, so tests 2 and 3 must find it in each of four parts.

    lo, hi          lowest lower and highest upper bound of a group's gain over the parts, 1 in the model
    ll              log likelihood of a sample (4,), a mean over each part
"""

from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import regression
from beaver_ftc_logs.corrected_logs import altered_log, corrected_logs
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.trust import central_ranges, known_effects, known_gains, unknown_surfaces
from beaver_ftc_logs.units import RATE, SI_UNITS, nearest_unit
from beaver_ftc_logs.whitening import NOISE_MA_CANDIDATES, whiten_samples

# All rates are in the same unit if their motions, relative to the flights of the model, differ by less than
# this factor.
_MAX_AXIS_RATIO = 10.0
# The motions may differ by the square of this factor from those of the unit that is guessed from them.
_UNIT_FACTOR_ROOT = 1.6
# A motion differs between flights by this factor at most.
_MAX_ALIKE_FACTOR = 3.0
# Another unit changes a motion by this factor at least.
_MIN_UNIT_FACTOR = 12.0
# The text of each kind of mistake. group: its name; motion: over that in the flights of the model.
_COMMAND_MISTAKES = {
    "sign": "the rates answer the command of {group} the other way round in all of it "
    "(does `scale: -1` fit?)",
    "weak": "the command of {group} moves {motion:.3g} times as much as in the flights of the model, and "
    "does at most {gain:.2g} of what it did: one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)",
    "strong": "the command of {group} moves {motion:.3g} times as much as in the flights of the model, and "
    "does at least {gain:.3g} times what it did: one unit (57.3 is deg for rad, 100 percent: `unit`, "
    "`scale`)",
}
# Below this gain a command has the opposite effect. Of 576 correct logs with faults of any kind, the least
# gain was 0.98, in light turbulence 0.93 (`own_logs.py`, seeds 31 to 42; 71 to 201).
MAX_REVERSED_GAIN = -0.3
# Below this gain a command has hardly any effect (same logs).
_MIN_COMMAND_GAIN = 0.2
# Half-way from the gain of a wrong sign, -1, to that of a lost surface, 0.
_REVERSED_GAIN_LIMIT = -0.5
# Largest probability that a correct log seems to have a mistake in its columns.
_FALSE_MISTAKE_CHANCE = 0.001
# A flight is reduced to less than twice this number of samples, to save computing time.
_MAX_COMPARED_SAMPLES = 8000


def refuse_rate_unit(samples: Samples, ranges: FittedRanges) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if not ranges.rates:
        return
    ratios = _relative_motion(samples.rates, ranges.rates)
    if not ratios.max() < _MAX_AXIS_RATIO * ratios.min():  # also if an axis has no number: its ratio is 0
        return
    ratio = float(np.exp(np.mean(np.log(ratios))))
    hints = (
        (1.0 / ratio, "a factor of {to_si:.4g} (`unit: {unit}`) fits"),
        (ratio, "a factor of {from_si:.4g} fits: the model's own were in {unit}?"),
    )
    for size, hint in hints:
        unit = nearest_unit(RATE, size, _UNIT_FACTOR_ROOT**2)
        if unit not in (None, "rad/s"):
            to_si = SI_UNITS[unit][1]
            text = hint.format(to_si=to_si, from_si=1.0 / to_si, unit=unit)
            motion = f"rates spread {ratio:.3g} times as widely as in the flights of the model"
            raise BadInput(f"{samples.name}: {motion}, allowed: rates in rad/s; {text}")


def refuse_command_unit(flight: Samples, first: Samples, surfaces: Sequence[str]) -> None:
    """Raise BadInput where the motion of a command, over that in another flight, `first`, shows another unit.

    rates                               motion of the command that is refused
    each between 1 / 3 and 3 times      below 1 / 12, or above 12 times
    otherwise                           above 12 times the largest motion of a rate, or 12 if that is larger

    The factors are _MAX_ALIKE_FACTOR and _MIN_UNIT_FACTOR. A motion beyond 1e-4 to 1e4 is not judged here.
    """
    rate_ratios = _relative_motion(flight.rates, central_ranges(first.rates))
    alike = rate_ratios.min() > 1.0 / _MAX_ALIKE_FACTOR and rate_ratios.max() < _MAX_ALIKE_FACTOR
    allowed = _MIN_UNIT_FACTOR * (1.0 if alike else max(rate_ratios.max(), 1.0))
    ratios = _relative_motion(flight.commands, central_ranges(first.commands))
    for surface, ratio in zip(surfaces, ratios.tolist(), strict=True):
        if allowed < ratio < 1e4 or (alike and 1e-4 < ratio < 1.0 / _MIN_UNIT_FACTOR):
            raise BadInput(
                f"{flight.name}: the command of {surface} moves {ratio:.3g} times as much as in the other "
                f"flights, the rates {rate_ratios.max():.2g} times at most, allowed: one unit (57.3 is deg "
                "for rad, 100 percent: `unit`, `scale`)"
            )


def _relative_motion(values: Floats, fitted: Sequence[Sequence[float]]) -> Floats:
    """Central range of each column of values (n, S) over that in the flights of the model, (S,)."""
    spans = [np.ptp(np.array(ranges).reshape(-1, 2), axis=1) for ranges in (central_ranges(values), fitted)]
    return spans[0] / np.maximum(spans[1], MIN_DIVISOR)


# Key: kind of the mistake (_COMMAND_MISTAKES), and name of the group. Value: motion of the command over that
# in the flights of the model, and its gain.
CommandMistakes = dict[tuple[str, str], tuple[float, float]]


class Answers(NamedTuple):
    """The response to the commands in each of four parts of a flight.

    lower, upper (4, G): bounds of the gain of each group, 1 in the model. likelihood (4,): mean log
    likelihood of a sample, without a constant. n_white: number of white samples that have the information of
    the shortest part.
    """

    lower: Floats
    upper: Floats
    likelihood: Floats
    n_white: float


def answers(samples: Samples, model: Model, max_samples: float = np.inf) -> Answers | None:
    """The responses in the parts of a flight; None if a part is too short.

    max_samples: half of the largest number of samples to use. Of a longer flight, only every `step`-th is
    used.
    """
    flight = regression.innovations(samples, model)
    rows = np.flatnonzero(flight.is_known)
    step = max(int(len(rows) // max_samples), 1)
    if (parts := regression.split_parts(rows[::step])) is None:
        return None
    share = model.settings.power / flight.noise.wider
    bounds = [flight.at(part).gain_bounds(share) for part in parts]
    lower, upper, scales = (np.array(values) for values in zip(*bounds, strict=True))
    likelihood = -flight.log_size - 1.5 * np.log(scales)
    return Answers(lower, upper, likelihood, share * min(map(len, parts)))


def refuse_columns(samples: Samples, model: Model) -> None:
    """Raise BadInput if tests 2 or 3 find a mistake in the columns of a flight.

    A model that knows the effect of no surface refuses no flight.
    """
    if not any(known_effects(model)):
        return
    flight, likeliest = _whiten_likeliest(samples, model)
    measured = answers(flight, likeliest)
    if measured is None:
        return
    mistakes = _lasting_mistakes(samples, model, measured)
    texts = [
        _COMMAND_MISTAKES[kind].format(group=group, motion=motion, gain=gain)
        for (kind, group), (motion, gain) in mistakes.items()
    ]
    text = texts[0] if texts else _likelier_mistake(flight, likeliest)
    if text is not None:
        allowed = "allowed: columns, signs and units as in the flights of the model"
        raise BadInput(f"{samples.name}: {text}, {allowed}")


def _lasting_mistakes(samples: Samples, model: Model, measured: Answers) -> CommandMistakes:
    """The mistakes by `_command_mistakes` that remain if the flight is whitened by any other moving average
    that makes it likelier. A law's response to gusts or to gyro noise can look like a command with the
    opposite effect."""
    mistakes = _command_mistakes(samples, model, measured)
    if not mistakes:
        return mistakes
    for ma in NOISE_MA_CANDIDATES:
        likelier = answers(whiten_samples(samples, ma), model)
        if likelier is not None and likelier.likelihood.mean() > measured.likelihood.mean():
            again = _command_mistakes(samples, model, likelier)
            mistakes = {key: sizes for key, sizes in mistakes.items() if key in again}
    return mistakes


def _whiten_likeliest(samples: Samples, model: Model) -> tuple[Samples, Model]:
    """The flight whitened by the noise model that makes it likeliest, and the model with this noise alone."""
    return max(regression.by_noise(samples, model), key=lambda pair: _likelihoods(*pair).mean())


def find_reversed(samples: Samples, model: Model) -> list[list[str]]:
    """The groups of known effect whose gain in the whole flight, by least squares, is nearer to -1 (another
    sign) than to 0 (a lost surface)."""
    flight = regression.innovations(*_whiten_likeliest(samples, model))
    rows = np.flatnonzero(flight.is_known)
    if regression.split_parts(rows) is None:
        return []
    is_reversed = known_effects(model) & (flight.at(rows).gains() < _REVERSED_GAIN_LIMIT)
    return list(compress(model.groups, is_reversed))


def _command_mistakes(samples: Samples, model: Model, measured: Answers) -> CommandMistakes:
    """The commands with the wrong sign or in another unit.

    kind        condition
    sign        hi < MAX_REVERSED_GAIN
    weak        hi < _MIN_COMMAND_GAIN, and the command moves more than _MAX_ALIKE_FACTOR times as much
    strong      lo > 1 / _MIN_COMMAND_GAIN, and the command moves, but less than 1 / _MAX_ALIKE_FACTOR as much

    Kinds weak and strong require that the gain is known (`known_gains`).
    """
    mistakes = {}
    surfaces = list(model.vehicle.surfaces)
    fitted = model.fitted.commands
    motions = _relative_motion(samples.commands, fitted) if fitted else np.zeros(len(surfaces))
    highest = measured.upper.max(axis=0)
    lowest = measured.lower.min(axis=0)
    for group, is_known, hi, lo in zip(model.groups, known_gains(model), highest, lowest, strict=True):
        name = "+".join(group)
        motion = max(motions[surfaces.index(surface)] for surface in group)
        if hi < MAX_REVERSED_GAIN:
            mistakes["sign", name] = motion, hi
        elif is_known and hi < _MIN_COMMAND_GAIN and motion > _MAX_ALIKE_FACTOR:
            mistakes["weak", name] = motion, hi
        elif is_known and lo > 1.0 / _MIN_COMMAND_GAIN and 0.0 < motion < 1.0 / _MAX_ALIKE_FACTOR:
            mistakes["strong", name] = motion, lo
    return mistakes


def _likelier_mistake(samples: Samples, model: Model) -> str | None:
    """The text of the correction that makes the flight likeliest; None if none makes every part decisively
    likelier.

    If the model is correct, a wrong correction makes the log K times as likely with a probability of at most
    1 / K (Markov's inequality). With N corrections, K = N / _FALSE_MISTAKE_CHANCE. A part is K times as
    likely if gain n > log K, with n white samples in it.
    """
    gains, n = mistake_gains(samples, model)
    if not gains:
        return None
    text, gain = max(gains.items(), key=lambda item: item[1])
    if gain * n <= np.log(len(gains) / _FALSE_MISTAKE_CHANCE):
        return None
    log10 = gain * n / np.log(10.0)
    return f"each part of the flight is at least 10^{log10:.0f} times as likely with {text}"


def mistake_gains(samples: Samples, model: Model) -> tuple[dict[str, float], float]:
    """For each correction of the columns, the gain of the log likelihood of a sample, in the part of the
    flight with the least gain; and the number of white samples that a part counts as.

    A corrected signal must also be likelier than no signal: its gain is at most the gain over a log without
    the signal, in the sum over the parts. Where the model errs in the effect of a signal, a smaller or
    reversed effect may be likelier than the modelled one, and no effect likelier still.
    """
    measured = answers(samples, model, _MAX_COMPARED_SAMPLES)
    if measured is None:
        return {}, 0.0
    without = {
        signal: _likelihoods(altered_log(samples, model.vehicle, {}, {signal: 0.0}), model)
        for signal in model.vehicle.signal_columns
    }
    gains = {}
    for log in corrected_logs(samples, model.vehicle, unknown_surfaces(model)):
        ll = _likelihoods(log.samples, model) + log.log_jacobian
        gain = float((ll - measured.likelihood).min())
        if signal := log.scaled_signal:
            gain = min(gain, float((ll - without[signal]).sum()))
        gains[log.correction_text] = gain
    return gains, measured.n_white


def _likelihoods(samples: Samples, model: Model) -> Floats:
    """Log likelihood of a sample of each part of the flight; minus infinity where a part is too short."""
    measured = answers(samples, model, _MAX_COMPARED_SAMPLES)
    return np.array(-np.inf) if measured is None else measured.likelihood
