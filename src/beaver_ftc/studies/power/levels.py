"""The level of a scheme's statistic at a given false-alarm rate, on flights without a fault."""

from collections.abc import Sequence
from dataclasses import dataclass

from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.engine.statistics import Estimate, poisson


@dataclass(frozen=True)
class Level:
    """An alarm level, and the false alarms it costs: counted, in so many hours, per hour with limits."""

    level: float
    alarms: int
    hours: float

    @property
    def per_h(self) -> Estimate:
        """False alarms per hour with their exact two-sided limits."""
        return poisson(self.alarms, self.hours)


def level_for(healthy: Sequence[Trace], per_h: float) -> Level:
    """The most sensitive level with no more false alarms than this; a flight raises one at most."""
    strictest, *others = sorted({trace.before for trace in healthy}, reverse=True)
    best = level_at(healthy, strictest)
    for found in (level_at(healthy, level) for level in others):
        if found.alarms > per_h * found.hours + 1e-9:
            break
        best = found
    return best


def level_at(healthy: Sequence[Trace], level: float) -> Level:
    """What a level costs in false alarms, over the time until they were raised."""
    hours = sum(trace.watched_s(level) for trace in healthy) / 3600.0
    return Level(level, sum(trace.false_alarm(level) for trace in healthy), hours)
