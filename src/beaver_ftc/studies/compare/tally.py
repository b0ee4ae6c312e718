"""From the results of many flights to one line an entry, with the uncertainty of counting."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from statistics import median

import numpy as np

from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.trial import ORACLE, SCHEME, Entry, Result, Trial
from beaver_ftc.studies.engine.statistics import CONFIDENCE, poisson_bound, quantile, wilson_bound


@dataclass(frozen=True)
class Line:
    """One entry over one set. A rate is None where there was nothing to count."""

    entry: Entry
    flights: int
    failed: int
    false_alarms: int
    healthy_h: float
    false_alarms_per_h: float | None
    false_alarms_per_h_upper: float | None
    faults: int
    detection_rate: float | None
    detection_rate_lower: float | None
    delay_median_s: float
    delay_90_s: float
    isolation_rate: float | None
    isolation_delay_median_s: float
    ratio_median: float | None
    ratio_90: float | None
    departures: int
    us: float
    before_median: float | None = None
    before_90: float | None = None
    after_median: float | None = None
    after_90: float | None = None
    travel_median: float | None = None
    energy_median: float | None = None


def line_of(entry: Entry, results: Sequence[Result], oracle: Sequence[Result]) -> Line:
    """Tally one entry; oracle: the yardstick's results of the same flights, in the same order."""
    flown = [(mine, best) for mine, best in zip(results, oracle, strict=True) if mine.error is None]
    mine = [result for result, _ in flown]
    faulted = [result for result in mine if result.faulted]
    alarms, hours = sum(r.false_alarm for r in mine), sum(r.healthy_s for r in mine) / 3600.0
    detected = sum(r.delay_s < inf for r in faulted)
    ratios = [m.rms_deg_s / o.rms_deg_s for m, o in flown if o.error is None and 0 < o.rms_deg_s < inf]
    return Line(
        entry=entry,
        flights=len(mine),
        failed=len(results) - len(mine),
        false_alarms=alarms,
        healthy_h=hours,
        false_alarms_per_h=alarms / hours if hours else None,
        false_alarms_per_h_upper=poisson_bound(alarms, hours, CONFIDENCE, upper=True) if hours else None,
        faults=len(faulted),
        detection_rate=detected / len(faulted) if faulted else None,
        detection_rate_lower=wilson_bound(detected, len(faulted), CONFIDENCE, upper=False)
        if faulted
        else None,
        delay_median_s=share_within([r.delay_s for r in faulted], 0.5),
        delay_90_s=share_within([r.delay_s for r in faulted], 0.9),
        isolation_rate=sum(r.correct for r in faulted) / len(faulted) if faulted else None,
        isolation_delay_median_s=share_within([r.isolation_delay_s for r in faulted], 0.5),
        ratio_median=share_within(ratios, 0.5) if ratios else None,
        ratio_90=share_within(ratios, 0.9) if ratios else None,
        departures=sum(r.departed for r in mine),
        us=median(r.us for r in mine) if mine else 0.0,
        before_median=share_within([r.before_deg_s for r in mine], 0.5) if mine else None,
        before_90=share_within([r.before_deg_s for r in mine], 0.9) if mine else None,
        after_median=share_within([r.after_deg_s for r in faulted], 0.5) if faulted else None,
        after_90=share_within([r.after_deg_s for r in faulted], 0.9) if faulted else None,
        travel_median=share_within([r.travel_deg_s for r in mine], 0.5) if mine else None,
        energy_median=share_within([r.energy_deg2_s2 for r in mine], 0.5) if mine else None,
    )


def lines_of(trials: Sequence[Trial], entries: Sequence[Entry]) -> list[Line]:
    """One line an entry, in their order."""
    yardstick = _results(trials, Entry(SCHEME, ORACLE))
    return [line_of(entry, _results(trials, entry), yardstick) for entry in entries]


def _results(trials: Iterable[Trial], entry: Entry) -> list[Result]:
    return [result for trial in trials for result in trial.results if result.entry == entry]


def share_within(values: Sequence[float], share: float) -> float:
    """The smallest value that at least this share of the flights do not exceed; infinite of none."""
    return quantile(np.sort(np.asarray(values, dtype=float)), share) if len(values) else inf


@dataclass(frozen=True)
class Point:
    """One level of a scheme's statistic: what it costs in false alarms, and what it buys."""

    level: float
    false_alarms_per_h: float
    detection_rate: float
    delay_median_s: float


def trade_off(traces: Sequence[Trace]) -> list[Point]:
    """Every level at which the number of false alarms changes, from the strictest; and the scheme's own,
    1."""
    levels = sorted({1.0, *(trace.before for trace in traces if trace.before > 0.0)}, reverse=True)
    return [point_at(traces, level) for level in levels]


def point_at(traces: Sequence[Trace], level: float) -> Point:
    """False alarms, detections and delay at a level of the statistic.

    Detections and delays are of the flights in which the fault was still to be detected: no false alarm
    before it.
    """
    hours = sum(trace.watched_s(level) for trace in traces) / 3600.0
    alarms = sum(trace.false_alarm(level) for trace in traces)
    delays = [trace.delay_s(level) for trace in traces if trace.faulted and not trace.false_alarm(level)]
    rate = sum(delay < inf for delay in delays) / len(delays) if delays else 0.0
    return Point(level, alarms / hours if hours else 0.0, rate, share_within(delays, 0.5))


def matched(traces: Sequence[Trace], per_hour: float = 0.0) -> Point:
    """The most sensitive level with no more false alarms than this."""
    points = [point for point in trade_off(traces) if point.false_alarms_per_h <= per_hour]
    return min(points, key=lambda point: point.level)
