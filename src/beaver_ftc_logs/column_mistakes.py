"""Mistakes in the columns of a log: exchanged columns, another sign or unit. A log with one is refused.

A large residual may come from a fault, from the air, or from such a mistake. There are two tests (a third
compares the size of the motions: `motion_units`):

1. The gain of a command is opposite to that of the model, or as small or large as its motion is large or
   small (`_command_mistakes`).
2. The log has a higher score with one mistake corrected (`mistake_gains`).

A mistake is there from the first sample to the last, so a test must find it in each of four parts.

    lo, hi          lowest lower and highest upper bound of a group's gain over the parts, 1 in the model
    R, ma           covariance and moving average of the noise, as in `regression`
    q               variance of the residual of each part over R (4,), after least squares (`noise_scale`)
    ll              score of each part (4,), used as the mean log likelihood of a sample:

    ll = -log det(R)^1/2 + 3 log sum(ma) - 1.5 log q

It is no likelihood, since q comes from a median, on which faults of few samples have hardly an effect. The
log likelihood, at its maximum over trim, gains and variance, has the mean square instead.
"""

from itertools import compress
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs import regression
from beaver_ftc_logs.corrected_logs import altered_log, corrected_logs
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.motion_units import MAX_ALIKE_FACTOR, ONE_UNIT, relative_motion
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.trust import known_effects, known_gains, unknown_surfaces
from beaver_ftc_logs.whitening import NOISE_MA_CANDIDATES, whiten_samples

# The text of each kind of mistake. group: its name; motion: over that in the flights of the model.
_COMMAND_MISTAKES = {
    "sign": "the rates answer the command of {group} the other way round in all of it "
    "(does `scale: -1` fit?)",
    "weak": "the command of {group} moves {motion:.3g} times as much as in the flights of the model, and "
    "does at most {gain:.2g} of what it did: " + ONE_UNIT,
    "strong": "the command of {group} moves {motion:.3g} times as much as in the flights of the model, and "
    "does at least {gain:.3g} times what it did: " + ONE_UNIT,
}
# A command whose upper bound on the gain is below this has the opposite effect. In 576 correct logs with
# faults of any kind, the least of these bounds was 0.98, in light turbulence 0.93 (`own_logs.py`, seeds 31 to
# 42; 71 to 201).
MAX_REVERSED_GAIN = -0.3
# A command whose upper bound is below this has hardly any effect (same logs).
_MIN_COMMAND_GAIN = 0.2
# Half-way from the gain of a wrong sign, -1, to that of a lost surface, 0.
_REVERSED_GAIN_LIMIT = -0.5
# Largest probability that a correct log seems to have a mistake in its columns, if the scores were
# likelihoods.
_FALSE_MISTAKE_CHANCE = 0.001
# A flight of at least twice as many samples is reduced, to no fewer than these, to save computing time.
_MAX_COMPARED_SAMPLES = 8000


# Key: kind of the mistake (_COMMAND_MISTAKES), and name of the group. Value: motion of the command over that
# in the flights of the model, and its gain.
CommandMistakes = dict[tuple[str, str], tuple[float, float]]


class Answers(NamedTuple):
    """The response to the commands in each of four parts of a flight.

    lower, upper (4, G): bounds of the gain of each group, 1 in the model. score (4,): ll. n_white: number of
    white samples that have the information of the shortest part.
    """

    lower: Floats
    upper: Floats
    score: Floats
    n_white: float


def answers(samples: Samples, model: Model, least_samples: float = np.inf) -> Answers | None:
    """The responses in the parts of a flight; None if a part is too short.

    least_samples: if a flight has at least twice as many, only every `step`-th is used, so that no fewer than
    these remain.
    """
    flight = regression.innovations(samples, model)
    rows = np.flatnonzero(flight.is_known)
    step = max(int(len(rows) // least_samples), 1)
    if (parts := regression.split_parts(rows[::step])) is None:
        return None
    share = model.settings.power / flight.noise.wider
    bounds = [flight.at(part).gain_bounds(share) for part in parts]
    lower, upper, q = (np.array(values) for values in zip(*bounds, strict=True))
    ll = -flight.log_size - 1.5 * np.log(q)
    return Answers(lower, upper, ll, share * min(map(len, parts)))


def refuse_columns(samples: Samples, model: Model) -> None:
    """Raise BadInput if a test finds a mistake in the columns of a flight.

    A model that knows the effect of no surface refuses no flight.
    """
    if not any(known_effects(model)):
        return
    flight, own_model = _whiten_best(samples, model)
    measured = answers(flight, own_model)
    if measured is None:
        return
    mistakes = _lasting_mistakes(samples, model, measured)
    texts = (
        _COMMAND_MISTAKES[kind].format(group=group, motion=motion, gain=gain)
        for (kind, group), (motion, gain) in mistakes.items()
    )
    if text := next(texts, None) or _likelier_mistake(flight, own_model):
        raise refusal(samples.name, text, "columns, signs and units as in the flights of the model")


def _lasting_mistakes(samples: Samples, model: Model, measured: Answers) -> CommandMistakes:
    """The mistakes by `_command_mistakes` that remain if the flight is whitened by any other moving average
    that increases its score. A law's response to gusts or to gyro noise can look like a command with the
    opposite effect."""
    mistakes = _command_mistakes(samples, model, measured)
    if not mistakes:
        return mistakes
    for ma in NOISE_MA_CANDIDATES:
        trial = answers(whiten_samples(samples, ma), model)
        if trial is not None and trial.score.mean() > measured.score.mean():
            again = _command_mistakes(samples, model, trial)
            mistakes = {key: sizes for key, sizes in mistakes.items() if key in again}
    return mistakes


def _whiten_best(samples: Samples, model: Model) -> tuple[Samples, Model]:
    """The flight whitened by the noise model with the highest score, and the model with this noise alone."""
    return max(regression.by_noise(samples, model), key=lambda pair: _scores(*pair).mean())


def find_reversed(samples: Samples, model: Model) -> list[list[str]]:
    """The groups of known effect whose gain in the whole flight, by least squares, is nearer to -1 (another
    sign) than to 0 (a lost surface)."""
    flight = regression.innovations(*_whiten_best(samples, model))
    rows = np.flatnonzero(flight.is_known)
    if regression.split_parts(rows) is None:
        return []
    is_reversed = known_effects(model) & (flight.at(rows).gains() < _REVERSED_GAIN_LIMIT)
    return list(compress(model.groups, is_reversed))


def _command_mistakes(samples: Samples, model: Model, measured: Answers) -> CommandMistakes:
    """The commands with the wrong sign or in another unit.

    kind        condition
    sign        hi < MAX_REVERSED_GAIN
    weak        hi < _MIN_COMMAND_GAIN, and the command moves more than MAX_ALIKE_FACTOR times as much
    strong      lo > 1 / _MIN_COMMAND_GAIN, and the command moves, but less than 1 / MAX_ALIKE_FACTOR as much

    Kinds weak and strong require that the gain is known (`known_gains`).
    """
    mistakes = {}
    surfaces = list(model.vehicle.surfaces)
    fitted = model.fitted.commands
    motions = relative_motion(samples.commands, fitted) if fitted else np.zeros(len(surfaces))
    highest = measured.upper.max(axis=0)
    lowest = measured.lower.min(axis=0)
    for group, is_known, hi, lo in zip(model.groups, known_gains(model), highest, lowest, strict=True):
        name = "+".join(group)
        motion = max(motions[surfaces.index(surface)] for surface in group)
        if hi < MAX_REVERSED_GAIN:
            mistakes["sign", name] = motion, hi
        elif is_known and hi < _MIN_COMMAND_GAIN and motion > MAX_ALIKE_FACTOR:
            mistakes["weak", name] = motion, hi
        elif is_known and lo > 1.0 / _MIN_COMMAND_GAIN and 0.0 < motion < 1.0 / MAX_ALIKE_FACTOR:
            mistakes["strong", name] = motion, lo
    return mistakes


def _likelier_mistake(samples: Samples, model: Model) -> str | None:
    """The text of the correction with the largest gain; None if no gain is decisive.

    The limit is that of a likelihood ratio. If the model is correct, a wrong correction makes the log K times
    as likely with a probability of at most 1 / K (Markov's inequality). With N corrections,
    K = N / _FALSE_MISTAKE_CHANCE. A part counts as K times as likely if gain n > log K, with n white samples
    in it. The scores are no likelihoods, so this probability is not ensured.
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
    """For each correction of the columns, the gain of the score, in the part of the flight with the least
    gain; and the number of white samples that a part counts as.

    A corrected signal must also have a higher score than no signal: its gain is at most the gain over a log
    without the signal, in the sum over the parts. Where the model errs in the effect of a signal, a smaller
    or reversed effect may score higher than the modelled one, and no effect higher still.
    """
    measured = answers(samples, model, _MAX_COMPARED_SAMPLES)
    if measured is None:
        return {}, 0.0
    without = {
        signal: _scores(altered_log(samples, model.vehicle, {}, {signal: 0.0}), model)
        for signal in model.vehicle.signal_columns
    }
    gains = {}
    for log in corrected_logs(samples, model.vehicle, unknown_surfaces(model)):
        ll = _scores(log.samples, model) + log.log_jacobian
        gain = float((ll - measured.score).min())
        if signal := log.scaled_signal:
            gain = min(gain, float((ll - without[signal]).sum()))
        gains[log.correction_text] = gain
    return gains, measured.n_white


def _scores(samples: Samples, model: Model) -> Floats:
    """The score of each part of the flight, (4,); one minus infinity for all if a part is too short."""
    measured = answers(samples, model, _MAX_COMPARED_SAMPLES)
    return np.array(-np.inf) if measured is None else measured.score
