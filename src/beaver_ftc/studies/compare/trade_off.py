"""The trade-off of a scheme between false alarms and detections, over the levels of its statistic."""

from collections.abc import Sequence
from math import inf
from operator import itemgetter

from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace, alarms_at
from beaver_ftc.studies.engine.statistics import share_within


def trade_off(traces: Sequence[Trace]) -> list[Document]:
    """The points at each level at which the number of false alarms changes, and at level 1, with which the
    scheme ships; from the highest level to the lowest."""
    levels = sorted({1.0, *(trace.before for trace in traces if trace.before > 0.0)}, reverse=True)
    return [point_at(traces, level) for level in levels]


def point_at(traces: Sequence[Trace], level: float) -> Document:
    """False alarms and detections of a scheme at a level of its statistic.

    Detections and delays are counted in the flights without a false alarm before the fault. None: a rate in
    no flight, or in no time.
    """
    alarms, hours = alarms_at(traces, level)
    delays = [trace.delay_s(level) for trace in traces if trace.faulted and not trace.false_alarm(level)]
    return {
        "level": level,
        "false_alarms_per_h": alarms / hours if hours else None,
        "detection_rate": sum(delay < inf for delay in delays) / len(delays) if delays else None,
        "delay_median_s": share_within(delays, 0.5),
    }


def matched(points: Sequence[Document]) -> Document | None:
    """The most sensitive level without a false alarm; None if no alarm could have been false."""
    return min((p for p in points if p["false_alarms_per_h"] == 0.0), key=itemgetter("level"), default=None)
