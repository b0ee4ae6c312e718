"""The survey as one document: what table, figures and `--format json` are made from."""

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

from beaver_ftc.results.metrics import versions
from beaver_ftc.studies.engine.statistics import sign_test
from beaver_ftc.studies.power.contenders import BUILT_IN
from beaver_ftc.studies.power.flying import Watched
from beaver_ftc.studies.power.grid import WATCHED_S, Grid
from beaver_ftc.studies.power.levels import Level
from beaver_ftc.studies.power.tally import (
    Key,
    Row,
    grouped,
    held_out,
    levels_of,
    limit,
    own_levels_of,
    rows_of,
    summary,
)

Document = dict[str, Any]

PLACE = ("sensors", "turbulence", "surface")
CELL = (*PLACE, "excitation_deg_s", "magnitude", "scheme")
SIGNIFICANT = 0.05
JUDGED_S = 1.0


def document_of(
    grid: Grid, healthy: Sequence[Watched], faulted: Sequence[Watched]
) -> tuple[Document, list[Row]]:
    """The document, and the rows behind it."""
    levels = levels_of(healthy, grid.per_h)
    rows = rows_of(faulted, levels)
    totals = grouped(rows, *PLACE, "scheme")
    cells = grouped(rows, *CELL)
    document = {
        "grid": asdict(grid),
        "watched_s": WATCHED_S,
        "false_alarms_per_h": grid.per_h,
        "levels": _levels(levels, held_out(faulted, levels), own_levels_of(healthy)),
        "totals": [_line((*PLACE, "scheme"), key, of, own=True) for key, of in totals.items()],
        "cells": [_line(CELL, key, of) for key, of in cells.items()],
        "limits": [
            {**dict(zip(PLACE, key, strict=True)), "within": limit(of, grid.per_h)}
            for key, of in grouped(rows, *PLACE).items()
        ],
        "comparison": _comparison(rows),
        "failures": sorted({failure for one in (*healthy, *faulted) for failure in one.failures}),
        "versions": dict(versions()),
    }
    return document, rows


def _levels(common: dict[Key, Level], apart: dict[Key, Level], own: dict[Key, Level]) -> list[Document]:
    return [
        {
            **dict(zip(("sensors", "turbulence", "scheme"), key, strict=True)),
            "level": level.level,
            "calibration": _alarms(level),
            "before_faults": _alarms(apart[key]) if key in apart else None,
            "own_level": _alarms(own[key]),
        }
        for key, level in common.items()
    ]


def _alarms(level: Level) -> Document:
    rate = {f"per_h{end}": value for end, value in zip(("", "_low", "_high"), _ends(level), strict=True)}
    return {"alarms": level.alarms, "hours": level.hours, **rate}


def _ends(level: Level) -> list[float | None]:
    rate = level.per_h
    return [value if isfinite(value) else None for value in (rate.value, rate.low, rate.high)]


def _line(names: Sequence[str], key: tuple[Any, ...], rows: Sequence[Row], own: bool = False) -> Document:
    line = {**dict(zip(names, key, strict=True)), **summary(rows)}
    return line | {"own_level": summary(rows, own=True)} if own else line


def _comparison(rows: Sequence[Row]) -> list[Document]:
    """Our schemes against every other on the same flights, by how many faults each finds within JUDGED_S.

    Flights of a seed share their noise, so a seed counts once: for who finds more of its faults.
    """
    compared = []
    for place, here in grouped(rows, *PLACE).items():
        found = {scheme: _found_by_seed(of) for (scheme,), of in grouped(here, "scheme").items()}
        compared += [
            {
                **dict(zip(PLACE, place, strict=True)),
                "ours": ours,
                "against": scheme,
                **_duel(found[ours], theirs),
            }
            for ours in BUILT_IN
            for scheme, theirs in found.items()
            if ours in found and scheme not in BUILT_IN
        ]
    return compared


def _found_by_seed(rows: Sequence[Row]) -> dict[int, int]:
    return {
        seed: sum(row["delay_s"] is not None and row["delay_s"] <= JUDGED_S + 1e-9 for row in of)
        for (seed,), of in grouped(rows, "seed").items()
    }


def _duel(ours: dict[int, int], theirs: dict[int, int]) -> Document:
    pairs = [(found, theirs[seed]) for seed, found in ours.items() if seed in theirs]
    wins, losses = sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)
    p = sign_test(wins, losses)
    verdict = "even" if p >= SIGNIFICANT else "better" if wins > losses else "worse"
    return {
        "within_s": JUDGED_S, "seeds_ours": wins, "seeds_theirs": losses, "p": p, "verdict": verdict,
    }  # fmt: skip
