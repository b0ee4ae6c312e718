"""Other days, made from a recorded flight: changes between two flights of one vehicle are put into its log.

The commands are changed to those that would have caused the rates on another day; a change of the excitation
scales both, and a change of the noise adds noise to the rates. Labels stay as they are. A model is identified
from one half of a labelled flight and scored on the other half, altered; if there are several flights, from
all but one. The levels of effectiveness are fitted to the whole of a single flight. The settings were chosen
on the first drawn days (TUNING_SEEDS); the result is that of the others (TEST_SEEDS).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import scoring
from beaver_ftc_logs.detectors import OUR_DETECTOR, diagnose_with_detector
from beaver_ftc_logs.fit_parts import FitPart, fit_parts
from beaver_ftc_logs.fitting import fit_model
from beaver_ftc_logs.folds import validation_folds
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recorded import benchmark
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.runs import shifted
from beaver_ftc_logs.samples import Samples, mixer_matrix

TUNING_SEEDS = range(8)
TEST_SEEDS = range(8, 16)
_SEED = 20  # of all draws, with the seed of a drawn day
_RIVAL_DETECTOR = "sliding-least-squares"
_TRIM_MEAN_S = 30.0  # the running mean over this time is the trim
_DRIFT_TIME_S = 300.0  # correlation time of the drift of the trim


@dataclass(frozen=True)
class DayChanges:
    """Changes from the recorded day to another one.

    trim_shift_commands (S,): moment of another loading or rigging, as a command of each surface; a
    surface with a loss of effectiveness needs more command for it. neutral_shift_commands (S,): the same, not
    affected by a loss. common_gain: factor on the effect of all surfaces on the motion about trim (airspeed).
    surface_gains (S,): factor of each surface. command_delay_s: additional delay of the commands.
    motion_scale: factor on all motion; above 1, it is a factor on the noise of the recorded rates, too.
    noise_ratio: standard deviation of the noise in the rates, over that of the recorded day, while
    motion_scale is at most 1. trim_drift_sd_commands: standard deviation of the drift of the trim, in
    commands.
    """

    name: str
    trim_shift_commands: Floats | float = 0.0
    neutral_shift_commands: Floats | float = 0.0
    surface_gains: Floats | float = 1.0
    common_gain: float = 1.0
    command_delay_s: float = 0.0
    motion_scale: float = 1.0
    noise_ratio: float = 1.0
    trim_drift_sd_commands: float = 0.0


def one_change_days(mixer: Floats, commands: list[str]) -> list[DayChanges]:
    """The recorded day, and days on which one thing is changed. mixer (S, C): share of each command in each
    surface."""
    days = [DayChanges("as it was")]
    for command, shares in zip(commands, mixer.T, strict=True):
        for shift in (-0.04, 0.04):
            name = f"of {command} {shift:+.2f}"
            days.append(DayChanges(f"trim {name}", trim_shift_commands=shift * shares))
            days.append(DayChanges(f"neutral {name}", neutral_shift_commands=shift * shares))
    days += [DayChanges(f"gain {gain:.2f}", common_gain=gain) for gain in (0.85, 1.15)]
    days += [DayChanges(f"commands {delay:+.2f} s", command_delay_s=delay) for delay in (-0.04, 0.04)]
    days += [DayChanges(f"excitation {scale:.1f}", motion_scale=scale) for scale in (0.6, 1.5)]
    days.append(DayChanges("noise 1.5", noise_ratio=1.5))
    days.append(DayChanges("trim drifts", trim_drift_sd_commands=0.01))
    for i, unit in enumerate(np.eye(len(mixer))):
        for gain in (0.94, 1.06):
            name = f"surface {i + 1} by {gain:.2f}"
            days.append(DayChanges(name, surface_gains=np.where(unit, gain, 1.0)))
    return days


def random_days(n: int, seeds: range) -> list[DayChanges]:
    """Days on which everything differs a little from the recorded day. n: number of surfaces."""
    draws = [(seed, np.random.default_rng([_SEED, seed]).standard_normal) for seed in seeds]
    return [
        DayChanges(
            name=f"drawn {seed}",
            trim_shift_commands=0.015 * draw(n),
            neutral_shift_commands=0.01 * draw(n),
            surface_gains=np.exp(0.03 * draw(n)),
            common_gain=np.exp(0.1 * draw()),
            command_delay_s=0.02 * draw(),
            motion_scale=np.exp(0.25 * draw()),
            noise_ratio=1.0 + 0.3 * abs(draw()),
            trim_drift_sd_commands=0.006 * abs(draw()),
        )
        for seed, draw in draws
    ]


def apply_day_changes(day: DayChanges, samples: Samples, A: Floats, Q: Floats) -> Samples:
    """The flight as it might have been on that day, with commands u (n, S) and rates x (n, 3):

        u <- mean(u) + motion (u - mean(u)) / gain + neutral + (trim + drift) / e,    u delayed before
        x <- mean(x) + motion (x - mean(x)) + extra noise
        extra^2 = max(noise_ratio^2 - min(motion, 1)^2, 0)

    The noise in x has sqrt(motion^2 + extra^2) times the standard deviation of the recorded day.

    mean: running mean over _TRIM_MEAN_S; motion, neutral, trim: of the day; gain: common gain times that of
    each surface; drift: coloured noise, of correlation time _DRIFT_TIME_S; e (n, S): effectiveness, 1 where
    it is unknown, and where it is 0, since no command makes up for a total loss. A (3 h, 3): how its model's
    rates answer their own past, Q (3, 3) (rad/s)2: covariance of its noise.
    """
    rng = np.random.default_rng(_SEED)
    e = np.where(samples.labels > 0.0, samples.labels, 1.0)
    commands = shifted(samples.commands, day.command_delay_s / samples.dt_s)
    trim = _running_mean(commands, round(_TRIM_MEAN_S / samples.dt_s))
    commands = trim + day.motion_scale * (commands - trim) / (day.common_gain * day.surface_gains)
    drift = day.trim_drift_sd_commands * _coloured_noise(rng, commands.shape, _DRIFT_TIME_S / samples.dt_s)
    commands = commands + day.neutral_shift_commands + (day.trim_shift_commands + drift) / e
    mean = _running_mean(samples.rates, round(_TRIM_MEAN_S / samples.dt_s))
    rates = mean + day.motion_scale * (samples.rates - mean)
    extra = np.sqrt(max(day.noise_ratio**2 - min(day.motion_scale, 1.0) ** 2, 0.0))
    rates = rates + extra * _response_to_noise(rng, A, Q, len(rates))
    return replace(samples, commands=commands, rates=rates)


def _running_mean(values: Floats, n: int) -> Floats:
    """Centred running mean over n rows, (n_rows, S)."""
    from scipy.ndimage import uniform_filter1d

    return uniform_filter1d(values, n, axis=0, mode="nearest")


def _coloured_noise(rng: np.random.Generator, shape: tuple[int, ...], n: float) -> Floats:
    """Coloured noise x[k] = a x[k-1] + w[k] of standard deviation 1 and correlation time n samples,
    a = exp(-1/n)."""
    from scipy.signal import lfilter

    a = np.exp(-1.0 / n)
    w = rng.standard_normal(shape) * np.sqrt(1.0 - a**2)
    return lfilter([1.0], [1.0, -a], w, axis=0)


def _response_to_noise(rng: np.random.Generator, A: Floats, Q: Floats, n: int) -> Floats:
    """The rates x (n, 3), rad/s, of the model without commands, under white noise w (n, 3) of covariance Q,
    (rad/s)2:

        x[k] = A' (x[k-1], ..., x[k-h]) + w[k]
    """
    w = rng.standard_normal((n, 3)) @ np.linalg.cholesky(Q).T
    h = len(A) // 3
    x = np.zeros((n + h, 3))
    for k in range(n):
        x[k + h] = x[k : k + h][::-1].ravel() @ A + w[k]
    return x[h:]


def run_other_days(folder: Path) -> Document:
    """The document: an entry for each data set whose first flight has labels, with a row for each day. Raises
    BadInput if there is none."""
    all_sets = benchmark.load_data_sets(folder)
    labelled = [data for data in all_sets if np.isfinite(data.flights[0].labels).any()]
    if not labelled:
        raise refusal("compare", f"--other-days: {folder} holds no labelled flight", "one with labels")
    return {"sets": [_test_data_set(data) for data in labelled]}


def _test_data_set(data: benchmark.DataSet) -> Document:
    """The scores of a data set on each other day, with a summary for each kind of day."""
    usable = fit_parts(data.flights)
    settings = benchmark.settings_of_single(usable, data)
    folds = [
        (fit_model(fitted, data.vehicle, settings), held_out)
        for fitted, held_out, _ in validation_folds(usable)
    ]
    model = fit_model(usable, data.vehicle, settings)
    n = len(data.vehicle.surfaces)
    kinds = {
        "one change": one_change_days(mixer_matrix(data.vehicle), data.vehicle.command_columns),
        "drawn, settings chosen on these": random_days(n, TUNING_SEEDS),
        "drawn, not looked at": random_days(n, TEST_SEEDS),
    }
    scores = [day for kind, days in kinds.items() for day in _score_days(kind, days, folds, model)]
    summary = [_summarize_days(kind, [day for day in scores if day["kind"] == kind]) for kind in kinds]
    return {"set": data.name, "rows": scores, "summary": summary}


def _score_days(
    kind: str, days: Sequence[DayChanges], folds: Sequence[tuple[Model, FitPart]], whole: Model
) -> Iterator[Document]:
    """Yield the scores of each day, with `classes` of the rival detector under `beside`. whole: the model of
    all flights, whose past and noise make the additional noise.
    """
    A = np.array(whole.past)[: 3 * whole.history]  # the rows of the rates, without those of the signals
    Q = np.array(whole.noise)
    for day in days:
        scores: dict[str, list[Document]] = {OUR_DETECTOR: [], _RIVAL_DETECTOR: []}
        for model, held_out in folds:
            altered = apply_day_changes(day, held_out.samples, A, Q)
            labels = benchmark.labels_in_span(held_out)
            for detector, scores_of_folds in scores.items():
                rows = diagnose_with_detector(detector, altered, model)
                scores_of_folds.append(scoring.score_against_labels(rows, labels))
        ours, rival = (benchmark.summarize_labels(scores[name]) for name in (OUR_DETECTOR, _RIVAL_DETECTOR))
        yield {"kind": kind, "day": day.name, **ours, "beside": rival["classes"]}


def _summarize_days(kind: str, days: Sequence[Document]) -> Document:
    """Mean and worst of each score over the days of a kind."""
    values = {key: [day[key] for day in days] for key in (*benchmark.LABEL_TITLES, "beside")}
    return {
        "kind": kind,
        "mean": {key: float(np.mean(of_days)) for key, of_days in values.items()},
        "worst": {key: scoring.worst_of(key, of_days) for key, of_days in values.items()},
    }
