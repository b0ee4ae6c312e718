"""Other days, made of a flight we have: what changes between two flights of one vehicle, put into its log.

The rates are kept and the commands made those that would have given them, or the other way round: the log
stays one that the vehicle's equation of motion allows. Labels stay as they are. How a model holds on such a
day: halves of a labelled flight, the other half altered. The settings were chosen on the first drawn days;
what counts is the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import scoring
from beaver_ftc_logs.detectors import BANK, diagnose_with
from beaver_ftc_logs.fitting import Stretch, fit_model, folds, stretches_of
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recorded import benchmark
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.samples import Samples, mixer

CHOSEN_ON, JUDGED_ON = range(8), range(8, 16)
_BESIDE = "sliding-least-squares"
_WORST = {"mean_error": max}
_SLOW_S = 30.0  # of the mean that is called slow


@dataclass(frozen=True)
class Day:
    """What another day changes.

    trim (S,): moment of another loading or rigging, in commands of each surface, behind the fault: a weak
    surface needs more command for it. neutral (S,): the same ahead of the fault. gain: of all surfaces on the
    motion about trim (airspeed). own (S,): gain of each surface. late_s: by which commands act later.
    excitation: size of all motion, at the same noise. noise: standard deviation of the air's share in the
    rates, over that of the day we have. drift: wander of the trim, in commands.
    """

    name: str
    trim: Floats
    neutral: Floats
    own: Floats
    gain: float = 1.0
    late_s: float = 0.0
    excitation: float = 1.0
    noise: float = 1.0
    drift: float = 0.0


def nominal(surfaces: int) -> Day:
    """The day as it was."""
    return Day("as it was", np.zeros(surfaces), np.zeros(surfaces), np.ones(surfaces))


def grid(mixer: Floats, commands: list[str]) -> list[Day]:
    """One thing changed at a time. mixer (S, C)."""
    same = nominal(len(mixer))
    days = [same]
    for command, moves in zip(commands, mixer.T, strict=True):
        for shift in (-0.04, 0.04):
            days.append(replace(same, name=f"trim of {command} {shift:+.2f}", trim=shift * moves))
            days.append(replace(same, name=f"neutral of {command} {shift:+.2f}", neutral=shift * moves))
    days += [replace(same, name=f"gain {gain:.2f}", gain=gain) for gain in (0.85, 1.15)]
    days += [replace(same, name=f"commands {late:+.2f} s", late_s=late) for late in (-0.04, 0.04)]
    days += [replace(same, name=f"excitation {size:.1f}", excitation=size) for size in (0.6, 1.5)]
    days += [replace(same, name="noise 1.5", noise=1.5), replace(same, name="trim drifts", drift=0.01)]
    for i, surface in enumerate(np.eye(len(mixer))):
        for gain in (0.94, 1.06):
            own = np.where(surface, gain, 1.0)
            days.append(replace(same, name=f"surface {i + 1} by {gain:.2f}", own=own))
    return days


def drawn(surfaces: int, seeds: range) -> list[Day]:
    """Days on which everything differs a little."""
    return [_draw(surfaces, seed) for seed in seeds]


def _draw(surfaces: int, seed: int) -> Day:
    rng = np.random.default_rng([20, seed])
    return Day(
        name=f"drawn {seed}",
        trim=0.015 * rng.standard_normal(surfaces),
        neutral=0.01 * rng.standard_normal(surfaces),
        own=np.exp(0.03 * rng.standard_normal(surfaces)),
        gain=float(np.exp(0.1 * rng.standard_normal())),
        late_s=float(0.02 * rng.standard_normal()),
        excitation=float(np.exp(0.25 * rng.standard_normal())),
        noise=float(1.0 + 0.3 * abs(rng.standard_normal())),
        drift=float(0.006 * abs(rng.standard_normal())),
    )


def on(day: Day, samples: Samples, past: Floats, noise: Floats) -> Samples:
    """The flight as it might have been on that day. past (3 h, 3) and noise (3, 3) of its model."""
    rng = np.random.default_rng(20)
    effectiveness = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    commands = _shifted(samples.commands, day.late_s / samples.dt_s)
    slow = _running_mean(commands, round(_SLOW_S / samples.dt_s))
    commands = slow + day.excitation * (commands - slow) / (day.gain * day.own)
    wander = day.drift * _wander(rng, commands.shape, 300.0 / samples.dt_s)
    commands = commands + day.neutral + (day.trim + wander) / effectiveness
    mean = _running_mean(samples.rates, round(_SLOW_S / samples.dt_s))
    rates = mean + day.excitation * (samples.rates - mean)
    extra = np.sqrt(max(day.noise**2 - min(day.excitation, 1.0) ** 2, 0.0))
    rates = rates + extra * _air(rng, past, noise, len(rates))
    return replace(samples, commands=commands, rates=rates)


def _shifted(values: Floats, length: float) -> Floats:
    """Values that act `length` samples later than these: logged earlier by as much, (n, S)."""
    at = np.arange(len(values)) + length
    return np.column_stack([np.interp(at, np.arange(len(values)), column) for column in values.T])


def _running_mean(values: Floats, length: int) -> Floats:
    """Centred running mean, (n, S)."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, length, axis=0, mode="nearest"))


def _wander(rng: np.random.Generator, shape: tuple[int, ...], length: float) -> Floats:
    """Coloured noise of standard deviation 1 and correlation time `length`."""
    from scipy.signal import lfilter

    keep = np.exp(-1.0 / length)
    white = rng.standard_normal(shape) * np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], white, axis=0))


def _air(rng: np.random.Generator, past: Floats, noise: Floats, n: int) -> Floats:
    """What white moments of the model's noise make of the rates, (n, 3)."""
    moments = rng.standard_normal((n, 3)) @ np.linalg.cholesky(noise).T
    history = len(past) // 3
    rates = np.zeros((n + history, 3))
    for k in range(n):
        rates[k + history] = rates[k : k + history][::-1].ravel() @ past[: 3 * history] + moments[k]
    return rates[history:]


def run_other_days(folder: Path) -> Document:
    """The document: of each labelled data set a part, a row a day. Raises BadInput where none has labels."""
    labelled = [data for data in benchmark.data_sets(folder) if np.isfinite(data.flights[0].labels).any()]
    if not labelled:
        raise BadInput(f"compare: --other-days: {folder} holds no labelled flight, allowed: one with labels")
    return {"sets": [_part(data) for data in labelled]}


def _part(data: benchmark.DataSet) -> Document:
    stretches = stretches_of(data.flights)
    settings = benchmark.settings_of(stretches, data)
    models = [(fit_model(fitted, data.vehicle, settings), kept) for fitted, kept, _ in folds(stretches)]
    whole = fit_model(stretches, data.vehicle, settings)
    surfaces = len(data.vehicle.surfaces)
    kinds = {
        "one change": grid(mixer(data.vehicle), data.vehicle.command_names),
        "drawn, settings chosen on these": drawn(surfaces, CHOSEN_ON),
        "drawn, not looked at": drawn(surfaces, JUDGED_ON),
    }
    rows = [row for kind, days in kinds.items() for row in _rows(kind, days, models, whole)]
    summaries = [_summary(kind, [row for row in rows if row["kind"] == kind]) for kind in kinds]
    return {"set": data.name, "rows": rows, "summary": summaries}


def _rows(
    kind: str, days: Sequence[Day], models: Sequence[tuple[Model, Stretch]], whole: Model
) -> Iterator[Document]:
    past, noise = whole.arrays()[1], whole.arrays()[3]
    for day in days:
        scores: dict[str, list[Document]] = {BANK: [], _BESIDE: []}
        for model, kept in models:
            altered, labels = on(day, kept.samples, past, noise), benchmark.kept_labels(kept)
            for name, found in scores.items():
                found.append(scoring.by_labels(diagnose_with(name, altered, model), labels))
        beside = benchmark.by_labels(scores[_BESIDE])["classes"]
        yield {"kind": kind, "day": day.name, **benchmark.by_labels(scores[BANK]), "beside": beside}


def _summary(kind: str, rows: Sequence[Document]) -> Document:
    """Mean and worst of each figure."""
    values = {key: [row[key] for row in rows] for key in (*benchmark.FIGURES, "beside")}
    mean = {key: float(np.mean(of)) for key, of in values.items()}
    return {"kind": kind, "mean": mean, "worst": {k: _WORST.get(k, min)(of) for k, of in values.items()}}
