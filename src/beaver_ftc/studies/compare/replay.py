"""A flight under the nominal law, and what any detector would have made of it.

The nominal law reads no verdict, so one flight under it serves all detectors: it is recorded once and played
back to each. What is kept of a detector's statistic is exact and short: its largest value before
the fault, and each value after it that was larger than all before.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from math import inf, isnan

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.noting import Notes
from beaver_ftc.loop.readout import switch_statistical_tests
from beaver_ftc.plugins import DETECTORS, made
from beaver_ftc.results.metrics import Onset, Truth
from beaver_ftc.scenario.schema import Scenario

Rises = tuple[tuple[float, float], ...]
"""(time s, value) of each value that is larger than all before it."""
Seen = list[tuple[Measured, np.ndarray]]
"""What a detector is shown in each frame: the measured signals, and the command (surfaces,) rad."""


class Recorder:
    """A detector that keeps what it is shown and never raises an alarm."""

    def __init__(self) -> None:
        self.seen: Seen = []

    def reset(self, context: Context) -> None:
        """Keep the context as well: a detector that replays the flight needs it."""
        self.context = context

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Keep, say nothing."""
        self.seen.append((measured, command))
        return Verdict()


@dataclass(frozen=True)
class Trace:
    """A detector's statistic over one flight; alarm where it exceeds 1.

    before: largest value before the fault (or in all of a healthy flight). records: (delay s, value), each
    larger than all before it since the fault. healthy_s: time without a fault. rises: (time s, value), each
    larger than all before it, while there is no fault.
    """

    before: float
    records: Rises
    faulted: bool
    healthy_s: float
    rises: Rises = ()

    def fault_free_s(self, level: float) -> float:
        """Time in which an alarm would have been false: until the fault, the end or the alarm itself."""
        return next((at_s for at_s, value in self.rises if value > level), self.healthy_s)

    def false_alarm(self, level: float) -> bool:
        """Whether it raises an alarm without a fault, at this level of the statistic."""
        return self.before > level

    def delay_s(self, level: float = 1.0) -> float:
        """From the fault to the alarm at this level; infinite where there is none, or was one before."""
        at_s = (at_s for at_s, value in self.records if value > level)
        return inf if self.false_alarm(level) else next(at_s, inf)


def alarms_at(traces: Sequence[Trace], level: float) -> tuple[int, float]:
    """False alarms at a level of the statistic, and the hours until they were raised."""
    hours = sum(trace.fault_free_s(level) for trace in traces) / 3600.0
    return sum(trace.false_alarm(level) for trace in traces), hours


@dataclass
class Recording:
    """A flight under the nominal law as a detector sees it, with the built-in statistic beside it.

    known (frames,): whether the flight is inside the aircraft's map of the model's error; error (frames, 3)
    rad/s2: the bound that the map gives there.
    """

    context: Context
    seen: Seen
    built_in: np.ndarray
    onset: Onset
    known: np.ndarray
    error: np.ndarray

    @property
    def fault_at_s(self) -> float:
        """When the fault begins, as declared; infinite where nothing breaks."""
        return inf if self.onset.at_s is None else self.onset.at_s


def record(scenario: Scenario) -> Recording:
    """Fly a scenario under the nominal law and keep what a detector would see."""
    nominal = scenario.control.model_copy(update={"law": "nominal"})
    recorder = Recorder()
    loop = Loop(scenario.model_copy(update={"control": nominal}), recorder)
    try:
        switch_statistical_tests(loop.frames[0], scenario.fdi.statistical is not None)
        notes = Notes(loop)
        for _ in loop.chunks():
            pass
        notes.read()
        onset = Truth.of(scenario).onset
        return Recording(recorder.context, notes.seen, notes.statistic, onset, notes.inside, notes.error)
    finally:
        loop.release()


def replay(recording: Recording, scheme: str, options: Mapping[str, float] | None = None) -> Trace:
    """The trace of a scheme, built in or plugged in, over a recorded flight."""
    if scheme == "adaptive-estimators":
        return trace(recording, recording.built_in)
    detector: Detector = made(DETECTORS, scheme)
    detector.reset(replace(recording.context, options=options or {}))
    return trace(recording, np.array(_statistics(detector, recording.seen)))


def _statistics(detector: Detector, seen: Seen) -> list[float]:
    """The statistic of each frame, of which alone the detector is shown a copy; that of a detector with an
    alarm alone is well above the level, or well below."""
    verdicts = [detector.step(*deepcopy(shown)) for shown in seen]
    return [1e6 * each.detected if isnan(each.statistic) else each.statistic for each in verdicts]


def trace(recording: Recording, statistic: np.ndarray) -> Trace:
    """Boil a statistic (frames,) down to what decides about alarms at any level."""
    t = np.array([measured.t_s for measured, _ in recording.seen])
    healthy = recording.onset.is_false(t)
    early = statistic[healthy]
    since = np.array([recording.onset.delay_s(one) for one in t[~healthy]])
    return Trace(
        before=float(early.max(initial=0.0)), records=_records(since, statistic[~healthy]),
        faulted=not healthy.all(), healthy_s=float(healthy.sum()) * recording.context.dt_s,
        rises=_records(t[healthy], early),
    )  # fmt: skip


def _records(t: np.ndarray, values: np.ndarray) -> Rises:
    """(time, value) of each value (n,) that is larger than all before it."""
    largest = np.maximum.accumulate(values) if values.size else values
    news = np.flatnonzero(np.diff(largest, prepend=-inf) > 0.0)
    return tuple((float(t[i]), float(values[i])) for i in news)
