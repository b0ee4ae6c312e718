"""A flight under the nominal law, played back to any detector.

The nominal law reads no verdict, so that one recorded flight serves all detectors. Of the statistic of a
detector, `Trace` keeps the values that decide about alarms at any level: before the fault, and again from it
on, each value that is larger than all before.
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
from beaver_ftc.results.judgement import Onset, Truth
from beaver_ftc.scenario.schema import Scenario

Rises = tuple[tuple[float, float], ...]
"""(time s, value) of each value that is larger than all before it."""
Seen = list[tuple[Measured, np.ndarray]]
"""The arguments of a detector in each frame: the measured signals, and the command (surfaces,) rad."""


class Recorder:
    """A detector that keeps its context, and its arguments where its steps are called; it raises no alarm."""

    def __init__(self) -> None:
        self.seen: Seen = []

    def reset(self, context: Context) -> None:
        """Keep the context, which a detector that replays the flight needs."""
        self.context = context

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Keep the arguments."""
        self.seen.append((measured, command))
        return Verdict()


@dataclass(frozen=True)
class Trace:
    """The statistic of a detector over one flight. A detector as it ships alarms above the level 1.

    - before: largest value before the fault, or in a whole healthy flight; at least 0.
    - records: (delay s, value) of each value since the fault that is larger than all since the fault.
    - faulted: whether the fault begins in the flight. healthy_s: time until then.
    - rises: (time s, value) of each value before the fault that is larger than all before it.
    """

    before: float
    records: Rises
    faulted: bool
    healthy_s: float
    rises: Rises = ()

    def fault_free_s(self, level: float) -> float:
        """Time in which an alarm would have been false, s: until the fault, the end or the alarm at this
        level."""
        return next((at_s for at_s, value in self.rises if value > level), self.healthy_s)

    def false_alarm(self, level: float) -> bool:
        """Whether the detector raises an alarm without a fault, at this level of the statistic."""
        return self.before > level

    def delay_s(self, level: float = 1.0) -> float:
        """Time from the fault to the alarm at this level, s; infinite without an alarm, or after a false
        one."""
        at_s = (at_s for at_s, value in self.records if value > level)
        return inf if self.false_alarm(level) else next(at_s, inf)


def alarms_at(traces: Sequence[Trace], level: float) -> tuple[int, float]:
    """Number of false alarms at a level of the statistic, and the hours in which an alarm would have been
    false."""
    hours = sum(trace.fault_free_s(level) for trace in traces) / 3600.0
    return sum(trace.false_alarm(level) for trace in traces), hours


@dataclass
class Recording:
    """A flight under the nominal law: the context and the arguments of a detector in each frame.

    built_in (frames,): the statistic of the scheme that was flown. onset: begin of the fault. known
    (frames,): whether the flight is inside the map of the model error. error (frames, 3) rad/s2: the bound of
    this map.
    """

    context: Context
    seen: Seen
    built_in: np.ndarray
    onset: Onset
    known: np.ndarray
    error: np.ndarray

    @property
    def fault_at_s(self) -> float:
        """Begin of the fault as declared, s; infinite without a fault."""
        return inf if self.onset.at_s is None else self.onset.at_s


def record(scenario: Scenario) -> Recording:
    """Fly a scenario under the nominal law and record the arguments of a detector."""
    nominal = scenario.control.model_copy(update={"law": "nominal"})
    recorder = Recorder()  # only for its context: Notes replaces its steps by compiled frames
    loop = Loop(scenario.model_copy(update={"control": nominal}), recorder)
    try:
        # the flight with a plug-in has switched them off
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
    """The trace of a scheme over a recorded flight. The statistic of our own scheme is in the recording; a
    plug-in is run over it."""
    if scheme == "adaptive-estimators":
        return trace(recording, recording.built_in)
    detector: Detector = made(DETECTORS, scheme)
    detector.reset(replace(recording.context, options=options or {}))
    return trace(recording, np.array(_statistics(detector, recording.seen)))


def _statistics(detector: Detector, seen: Seen) -> list[float]:
    """The statistic of each frame. A detector without a statistic counts as 1e6 with an alarm, else 0. The
    detector receives copies, so that it cannot change the recording."""
    verdicts = [detector.step(*deepcopy(arguments)) for arguments in seen]
    return [1e6 * verdict.detected if isnan(verdict.statistic) else verdict.statistic for verdict in verdicts]


def trace(recording: Recording, statistic: np.ndarray) -> Trace:
    """The trace of a statistic (frames,)."""
    times_s = np.array([measured.t_s for measured, _ in recording.seen])
    healthy = recording.onset.is_false(times_s)
    early = statistic[healthy]
    since = np.array([recording.onset.delay_s(time_s) for time_s in times_s[~healthy]])
    return Trace(
        before=float(early.max(initial=0.0)), records=_records(since, statistic[~healthy]),
        faulted=not healthy.all(), healthy_s=float(healthy.sum()) * recording.context.dt_s,
        rises=_records(times_s[healthy], early),
    )  # fmt: skip


def _records(t: np.ndarray, values: np.ndarray) -> Rises:
    """(time, value) of each value (n,) that is larger than all before it."""
    largest = np.maximum.accumulate(values) if values.size else values
    news = np.flatnonzero(np.diff(largest, prepend=-inf) > 0.0)
    return tuple((float(t[i]), float(values[i])) for i in news)
