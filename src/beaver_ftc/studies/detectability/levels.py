"""The alarm level of each scheme, and the row of each flight at this level.

Levels are chosen on the healthy flights of a condition. All schemes then have the same rate of false alarms.
"""

from collections.abc import Iterable, Sequence

from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace, alarms_at
from beaver_ftc.studies.detectability.grid import WITHIN_S
from beaver_ftc.studies.detectability.schemes import Watched
from beaver_ftc.studies.engine.statistics import poisson
from beaver_ftc.studies.present.tables import finite

COLUMNS = (
    "sensors", "turbulence", "excitation_deg_s", "seed", "surface", "magnitude", "scheme", "false_alarm",
    "delay_s", "own_false_alarm", "own_delay_s", *(f"deflection_{s:g}" for s in WITHIN_S),
)  # fmt: skip
OWN_LEVEL = 1.0  # with which every scheme ships
Key = tuple[str, str, str]  # sensors, turbulence and scheme
Row = Document


def first_traces(watched: Iterable[Watched]) -> dict[Key, list[Trace]]:
    """The first trace of each block and scheme, by condition. All flights of a block are the same before the
    fault."""
    first: dict[Key, list[Trace]] = {}
    for outcome in watched:
        for scheme, traces in outcome.traces.items():
            first.setdefault((*outcome.block.condition, scheme), []).append(traces[0])
    return first


def level_for(healthy: Sequence[Trace], per_h: float) -> float:
    """The lowest level with at most `per_h` false alarms per hour. A flight has at most one, when its
    statistic before the fault exceeds the level: only these values, `before`, can be the level."""
    best, *others = sorted({trace.before for trace in healthy}, reverse=True)
    for level in others:
        alarms, hours = alarms_at(healthy, level)
        if alarms > per_h * hours + 1e-9:
            break
        best = level
    return best


def level_line(key: Key, level: float, healthy: Sequence[Trace], faulted: Sequence[Trace]) -> Document:
    """A level with its false alarms: in the healthy flights that set it, before the faults of other flights,
    and at OWN_LEVEL in the healthy flights."""
    return {
        **dict(zip(("sensors", "turbulence", "scheme"), key, strict=True)),
        "level": level,
        "calibration": _counted(healthy, level),
        "before_faults": _counted(faulted, level) if faulted else None,
        "own_level": _counted(healthy, OWN_LEVEL),
    }


def _counted(traces: Sequence[Trace], level: float) -> Document:
    """False alarms at a level, and their rate with exact limits."""
    alarms, hours = alarms_at(traces, level)
    rates = vars(poisson(alarms, hours)).values()
    names = ("per_h", "per_h_low", "per_h_high")
    return {"alarms": alarms, "hours": hours, **dict(zip(names, map(finite, rates), strict=True))}


def rows_of(faulted: Iterable[Watched], levels: dict[Key, float]) -> list[Row]:
    """A row for each flight and scheme. Schemes without a level, and blocks that our own schemes could not
    fly, have no rows: the failures have the reasons. Flights that end before their fault have none either.

    delay_s: at the level of the common rate. own_delay_s: at OWN_LEVEL. None without an alarm. An alarm
    before the fault is a false_alarm and no detection.
    """
    rows = []
    for outcome in faulted:
        block = outcome.block
        for scheme, traces in outcome.traces.items() if outcome.deflections else ():
            level = levels.get((*block.condition, scheme))
            if level is None:
                continue
            for fault, trace, deflections in zip(outcome.faults, traces, outcome.deflections, strict=True):
                if trace.faulted:
                    place = *block.condition, block.excitation_deg_s, block.seed, *fault, scheme
                    cells = *place, *_alarm(trace, level), *_alarm(trace, OWN_LEVEL), *deflections
                    rows.append(dict(zip(COLUMNS, cells, strict=True)))
    return rows


def _alarm(trace: Trace, level: float) -> tuple[bool, float | None]:
    """Whether the alarm at a level is false; its delay, s, or None."""
    return trace.false_alarm(level), finite(trace.delay_s(level))
