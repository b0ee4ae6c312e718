"""From traces to alarm levels at an equal false-alarm rate, rows, probabilities, and one document."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from itertools import product
from statistics import fmean

from beaver_ftc.diagnosis.informed_test import detection_probability
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace, alarms_at
from beaver_ftc.studies.detectability.schemes import BUILT_IN, WATCHED_S, WITHIN_S, Grid, Watched
from beaver_ftc.studies.engine.statistics import binomial, duel, or_never, poisson, share_within
from beaver_ftc.studies.present.page import Summary
from beaver_ftc.studies.present.tables import finite, grouped


def level_for(healthy: Sequence[Trace], per_h: float) -> float:
    """The most sensitive level with no more false alarms than this; a flight raises one at most."""
    best, *others = sorted({trace.before for trace in healthy}, reverse=True)
    for level in others:
        alarms, hours = alarms_at(healthy, level)
        if alarms > per_h * hours + 1e-9:
            break
        best = level
    return best


def _counted(traces: Sequence[Trace], level: float) -> Document:
    """The false alarms of a level, over the time until they were raised, with exact limits."""
    alarms, hours = alarms_at(traces, level)
    rates = vars(poisson(alarms, hours)).values()
    names = ("per_h", "per_h_low", "per_h_high")
    return {"alarms": alarms, "hours": hours, **dict(zip(names, map(finite, rates), strict=True))}


Row = Document
Rows = Sequence[Row]
COLUMNS = (
    "sensors", "turbulence", "excitation_deg_s", "seed", "surface", "magnitude", "scheme", "false_alarm",
    "delay_s", "own_false_alarm", "own_delay_s", *(f"deflection_{s:g}" for s in WITHIN_S),
)  # fmt: skip
Key = tuple[str, str, str]  # sensors, turbulence, scheme


def _by_condition(watched: Iterable[Watched]) -> dict[Key, list[Trace]]:
    """The first trace of each block: its flights are the same as long as there is no fault."""
    traces: dict[Key, list[Trace]] = {}
    for one in watched:
        for scheme, of in one.traces.items():
            traces.setdefault((*one.block.condition, scheme), []).append(of[0])
    return traces


def rows_of(faulted: Iterable[Watched], levels: dict[Key, float]) -> list[Row]:
    """One row a flight and scheme, of schemes with a level, and of blocks that our own could fly: what the
    others lack is among the failures.

    delay_s at the common level, own_delay_s at the scheme's own; None where there is no alarm. An alarm
    before the fault is a false_alarm and no detection.
    """
    rows = []
    for one in faulted:
        block = one.block
        for scheme, traces in one.traces.items() if one.deflections else ():
            level = levels.get((*block.condition, scheme))
            if level is None:
                continue
            for fault, trace, deflections in zip(one.faults, traces, one.deflections, strict=True):
                if trace.faulted:
                    place = *block.condition, block.excitation_deg_s, block.seed, *fault, scheme
                    cells = *place, *_alarm(trace, level), *_alarm(trace, 1.0), *deflections
                    rows.append(dict(zip(COLUMNS, cells, strict=True)))
    return rows


def _alarm(trace: Trace, level: float) -> tuple[bool, float | None]:
    """Whether the alarm at a level is a false one, and its delay, s."""
    return trace.false_alarm(level), finite(trace.delay_s(level))


def summary(rows: Rows, own: bool = False) -> Document:
    """Detection probability within each of WITHIN_S, with exact limits, and the median delay.

    own: at the level each scheme ships with. Flights with an alarm before the fault do not count.
    """
    prefix = "own_" if own else ""
    flights = [row[f"{prefix}delay_s"] for row in rows if not row[f"{prefix}false_alarm"]]
    delays = [*map(or_never, flights)]
    found = {s: sum(delay <= s + 1e-9 for delay in delays) for s in WITHIN_S} if delays else {}
    return {
        "flights": len(delays),
        "within": {f"{s:g}": vars(binomial(count, len(delays))) for s, count in found.items()},
        "median_delay_s": finite(share_within(delays, 0.5)),
    }


def limit(rows: Rows, per_h: float) -> Document:
    """Shares of the same flights in which an informed test detects the fault, within each of WITHIN_S."""
    one_each = {(row["excitation_deg_s"], row["seed"], row["surface"], row["magnitude"]): row for row in rows}
    flights = list(one_each.values())
    return {
        f"{within_s:g}": fmean(
            detection_probability(row[f"deflection_{within_s:g}"], within_s, per_h) for row in flights
        )
        for within_s in WITHIN_S
    }


PLACE = ("sensors", "turbulence", "surface")
CELL = (*PLACE, "excitation_deg_s", "magnitude", "scheme")
SIGNIFICANT = 0.05
JUDGED_S = 1.0
DUELS_S = (JUDGED_S, WATCHED_S)


def document_of(grid: Grid, healthy: Sequence[Watched], faulted: Sequence[Watched]) -> Summary:
    """The document, with the rows of `rows_of` behind it. Raises BadInput where not one flight could be
    judged."""
    watched, struck = _by_condition(healthy), _by_condition(faulted)
    failures = sorted({failure for one in (*healthy, *faulted) for failure in one.failures})
    if failures and not watched:
        raise BadInput(f"detectability: no flight could be judged: {failures[0]}")
    levels = {key: level_for(traces, grid.per_h) for key, traces in watched.items()}
    rows = rows_of(faulted, levels)
    document = {
        "grid": {  # nothing of a place where it is the usual one
            "bouts" if key == "blocks" else key: value
            for key, value in asdict(grid).items()
            if key != "where" or value
        },
        "watched_s": WATCHED_S,
        "false_alarms_per_h": grid.per_h,
        "levels": [
            {
                **dict(zip(("sensors", "turbulence", "scheme"), key, strict=True)),
                "level": level,
                "calibration": _counted(watched[key], level),
                # on flights that had no part in setting it
                "before_faults": _counted(struck[key], level) if key in struck else None,
                "own_level": _counted(watched[key], 1.0),
            }
            for key, level in levels.items()
        ],
        "totals": _lines(
            rows, (*PLACE, "scheme"), lambda of: summary(of) | {"own_level": summary(of, own=True)}
        ),
        "cells": _lines(rows, CELL, summary),
        "limits": _lines(rows, PLACE, lambda of: {"within": limit(of, grid.per_h)}),
        "comparison": _comparison(rows),
        "failures": failures,
        "versions": dict(versions()),
    }
    return Summary(document, rows)


def title_of(sensors: str, turbulence: str) -> str:
    """A condition in words."""
    air = "still air" if turbulence == "none" else f"{turbulence} turbulence"
    return f"{sensors} sensors, {air}"


def _lines(rows: Rows, names: Sequence[str], what: Callable[[Rows], Document]) -> list[Document]:
    """A row for each group of rows that are alike in these columns."""
    return [{**dict(zip(names, key, strict=True)), **what(of)} for key, of in grouped(rows, *names).items()]


def _comparison(rows: Rows) -> list[Document]:
    """Our schemes against every other on the same flights, by how many faults each finds in each of DUELS_S.

    Flights of a seed share their noise, so a seed counts once: for who finds more of its faults.
    """
    compared = []
    for place, here in grouped(rows, *PLACE).items():
        for within_s in DUELS_S:
            of_each = grouped(here, "scheme").items()
            found = {scheme: _found_by_seed(of, within_s) for (scheme,), of in of_each}
            others = [scheme for scheme in found if scheme not in BUILT_IN]
            for ours, scheme in product([scheme for scheme in BUILT_IN if scheme in found], others):
                duel = {**dict(zip(PLACE, place, strict=True)), "ours": ours, "against": scheme}
                duel["within_s"] = within_s
                compared.append(duel | _duel(found[ours], found[scheme]))
    return compared


BySeed = dict[int, int]
"""Number of faults found, by seed."""


def _found_by_seed(rows: Rows, within_s: float) -> BySeed:
    return {
        seed: sum(or_never(row["delay_s"]) <= within_s + 1e-9 for row in of)
        for (seed,), of in grouped(rows, "seed").items()
    }


def _duel(ours: BySeed, theirs: BySeed) -> Document:
    pairs = [(found, theirs[seed]) for seed, found in ours.items() if seed in theirs]
    wins, losses, p = duel(pairs)
    verdict = "even" if p >= SIGNIFICANT else "better" if wins > losses else "worse"
    return {"seeds_ours": wins, "seeds_theirs": losses, "p": p, "verdict": verdict}
