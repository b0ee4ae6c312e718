"""From traces to rows, one a flight and scheme, and from rows to probabilities."""

from collections.abc import Iterable, Sequence
from math import inf, isfinite
from statistics import fmean
from typing import Any

from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.tally import share_within
from beaver_ftc.studies.engine.statistics import Estimate, binomial
from beaver_ftc.studies.engine.told import chance
from beaver_ftc.studies.power.flying import Watched
from beaver_ftc.studies.power.grid import WITHIN_S
from beaver_ftc.studies.power.levels import Level, level_at, level_for

Row = dict[str, Any]
Document = dict[str, Any]
Key = tuple[str, str, str]  # sensors, turbulence, scheme


def levels_of(healthy: Iterable[Watched], per_h: float) -> dict[Key, Level]:
    """The level of each scheme under each condition at the false-alarm rate all are held to."""
    return {key: level_for(traces, per_h) for key, traces in _by_condition(healthy).items()}


def own_levels_of(healthy: Iterable[Watched]) -> dict[Key, Level]:
    """What each scheme costs at the level it ships with."""
    return {key: level_at(traces, 1.0) for key, traces in _by_condition(healthy).items()}


def held_out(faulted: Iterable[Watched], levels: dict[Key, Level]) -> dict[Key, Level]:
    """False alarms at those levels before the faults: flights that had no part in setting them."""
    return {key: level_at(of, levels[key].level) for key, of in _by_condition(faulted).items()}


def _by_condition(watched: Iterable[Watched]) -> dict[Key, list[Trace]]:
    """The first trace of each bout: its flights are the same as long as there is no fault."""
    traces: dict[Key, list[Trace]] = {}
    for one in watched:
        for scheme, of in one.traces.items():
            traces.setdefault((*one.bout.condition, scheme), []).append(of[0])
    return traces


def rows_of(faulted: Iterable[Watched], levels: dict[Key, Level]) -> list[Row]:
    """One row a flight and scheme.

    delay_s at the common level, own_delay_s at the scheme's own; None where there is no alarm. An alarm
    before the fault is a false_alarm and no detection.
    """
    return [
        {
            "sensors": one.bout.condition.sensors,
            "turbulence": one.bout.condition.turbulence,
            "excitation_deg_s": one.bout.excitation_deg_s,
            "seed": one.bout.seed,
            "surface": surface,
            "magnitude": magnitude,
            "scheme": scheme,
            **_alarms(trace, levels[(*one.bout.condition, scheme)].level),
            **{f"deflection_{s:g}": d for s, d in zip(WITHIN_S, deflections, strict=True)},
        }
        for one in faulted
        for scheme, traces in one.traces.items()
        for (surface, magnitude), trace, deflections in zip(one.faults, traces, one.deflections, strict=True)
        if trace.faulted
    ]


def _alarms(trace: Trace, level: float) -> Row:
    delay_s, own_delay_s = trace.delay_s(level), trace.delay_s(1.0)
    return {
        "false_alarm": trace.false_alarm(level),
        "delay_s": delay_s if isfinite(delay_s) else None,
        "own_false_alarm": trace.false_alarm(1.0),
        "own_delay_s": own_delay_s if isfinite(own_delay_s) else None,
    }


def summary(rows: Sequence[Row], own: bool = False) -> Document:
    """Detection probability within each of WITHIN_S, with exact limits, and the median delay.

    own: at the level each scheme ships with. Flights with an alarm before the fault do not count.
    """
    prefix = "own_" if own else ""
    delays = [
        inf if row[f"{prefix}delay_s"] is None else row[f"{prefix}delay_s"]
        for row in rows
        if not row[f"{prefix}false_alarm"]
    ]
    shares = {f"{within_s:g}": _share(delays, within_s) for within_s in WITHIN_S}
    median_s = share_within(delays, 0.5)
    return {
        "flights": len(delays),
        "within": {name: vars(share) for name, share in shares.items()} if delays else {},
        "median_delay_s": median_s if isfinite(median_s) else None,
    }


def _share(delays: Sequence[float], within_s: float) -> Estimate:
    return binomial(sum(delay <= within_s + 1e-9 for delay in delays), len(delays))


def limit(rows: Sequence[Row], per_h: float) -> Document:
    """What a test that is told the fault would find of the same flights, within each of WITHIN_S."""
    one_each = {(row["excitation_deg_s"], row["seed"], row["surface"], row["magnitude"]): row for row in rows}
    flights = list(one_each.values())
    return {
        f"{within_s:g}": fmean(chance(row[f"deflection_{within_s:g}"], within_s, per_h) for row in flights)
        for within_s in WITHIN_S
    }


def grouped(rows: Iterable[Row], *names: str) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by the values of some columns, in order of appearance."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups
