"""From the rows of a survey to its document: probabilities of detection, and schemes against one another.

At the common rate of false alarms (levels.py), each faulted flight has a row for each scheme. Groups of rows
give probabilities of detection, and pairs of schemes are compared.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import product
from statistics import fmean

from beaver_ftc.diagnosis.informed_test import detection_probability
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.detectability.grid import WATCHED_S, WITHIN_S, Grid
from beaver_ftc.studies.detectability.levels import Row, first_traces, level_for, level_line, rows_of
from beaver_ftc.studies.detectability.schemes import BUILT_IN, Watched
from beaver_ftc.studies.engine.statistics import binomial, duel, or_never, share_within
from beaver_ftc.studies.present.page import Summary
from beaver_ftc.studies.present.tables import finite, grouped

Rows = Sequence[Row]
PLACE = ("sensors", "turbulence", "surface")
CELL = (*PLACE, "excitation_deg_s", "magnitude", "scheme")
BySeed = dict[int, int]  # number of faults found, by seed
SIGNIFICANT = 0.05  # with a smaller p, a scheme counts as better or worse
JUDGED_S = 1.0  # the delay within which figures and comparisons count what is detected
DUELS_S = (JUDGED_S, WATCHED_S)


def summary(rows: Rows, own: bool = False) -> Document:
    """Probability of detection within each of WITHIN_S, with exact limits, and the median delay.

    own: at the level with which each scheme ships. Flights with an alarm before the fault are left out.
    """
    prefix = "own_" if own else ""
    flights = [row[f"{prefix}delay_s"] for row in rows if not row[f"{prefix}false_alarm"]]
    delays = [*map(or_never, flights)]
    counts = {s: sum(delay <= s + 1e-9 for delay in delays) for s in WITHIN_S} if delays else {}
    return {
        "flights": len(delays),
        "within": {f"{s:g}": vars(binomial(count, len(delays))) for s, count in counts.items()},
        "median_delay_s": finite(share_within(delays, 0.5)),
    }


def informed_shares(rows: Rows, per_h: float) -> Document:
    """Mean probability that an informed test detects the faults of these flights, within each of WITHIN_S.
    per_h: its rate of false alarms."""
    row_of_flight = {
        (row["excitation_deg_s"], row["seed"], row["surface"], row["magnitude"]): row for row in rows
    }
    flights = list(row_of_flight.values())
    return {
        f"{within_s:g}": fmean(
            detection_probability(row[f"deflection_{within_s:g}"], within_s, per_h) for row in flights
        )
        for within_s in WITHIN_S
    }


def document_of(grid: Grid, healthy: Sequence[Watched], faulted: Sequence[Watched]) -> Summary:
    """The document, with the rows of `rows_of` behind it. Raises BadInput if no healthy flight could be
    judged."""
    watched, faulted_traces = first_traces(healthy), first_traces(faulted)
    failures = sorted({failure for outcome in (*healthy, *faulted) for failure in outcome.failures})
    if failures and not watched:
        raise BadInput(f"detectability: no flight could be judged: {failures[0]}")
    levels = {key: level_for(traces, grid.per_h) for key, traces in watched.items()}
    rows = rows_of(faulted, levels)
    document = {
        "grid": {  # `where` only if it is not the usual place
            "bouts" if key == "blocks" else key: value
            for key, value in asdict(grid).items()
            if key != "where" or value
        },
        "watched_s": WATCHED_S,
        "false_alarms_per_h": grid.per_h,
        "levels": [
            level_line(key, level, watched[key], faulted_traces.get(key, ())) for key, level in levels.items()
        ],
        "totals": _lines(
            rows, (*PLACE, "scheme"), lambda group: summary(group) | {"own_level": summary(group, own=True)}
        ),
        "cells": _lines(rows, CELL, summary),
        "limits": _lines(rows, PLACE, lambda group: {"within": informed_shares(group, grid.per_h)}),
        "comparison": _comparison(rows),
        "failures": failures,
        "versions": dict(versions()),
    }
    return Summary(document, rows)


def _lines(rows: Rows, names: Sequence[str], summarise: Callable[[Rows], Document]) -> list[Document]:
    """A line for each group of rows with the same values in these columns: the values, and what `summarise`
    makes of the group."""
    return [
        {**dict(zip(names, key, strict=True)), **summarise(group)}
        for key, group in grouped(rows, *names).items()
    ]


def _comparison(rows: Rows) -> list[Document]:
    """Each of our schemes against each scheme that is not ours, in the same flights, by the faults found
    within each of DUELS_S.

    The flights of a seed have the same noise. A seed therefore counts once, for the scheme that finds more of
    its faults.
    """
    compared = []
    for place, rows_of_place in grouped(rows, *PLACE).items():
        for within_s in DUELS_S:
            by_scheme = grouped(rows_of_place, "scheme").items()
            by_seed_of = {scheme: _found_by_seed(group, within_s) for (scheme,), group in by_scheme}
            others = [scheme for scheme in by_seed_of if scheme not in BUILT_IN]
            for ours, scheme in product([scheme for scheme in BUILT_IN if scheme in by_seed_of], others):
                line = {**dict(zip(PLACE, place, strict=True)), "ours": ours, "against": scheme}
                line["within_s"] = within_s
                compared.append(line | _duel(by_seed_of[ours], by_seed_of[scheme]))
    return compared


def _found_by_seed(rows: Rows, within_s: float) -> BySeed:
    """The faults that a scheme finds in time, by seed."""
    return {
        seed: sum(or_never(row["delay_s"]) <= within_s + 1e-9 for row in group)
        for (seed,), group in grouped(rows, "seed").items()
    }


def _duel(ours: BySeed, theirs: BySeed) -> Document:
    """The seeds for each of two schemes, p between equals, and the verdict on ours."""
    pairs = [(our_count, theirs[seed]) for seed, our_count in ours.items() if seed in theirs]
    wins, losses, p = duel(pairs)
    verdict = "even" if p >= SIGNIFICANT else "better" if wins > losses else "worse"
    return {"seeds_ours": wins, "seeds_theirs": losses, "p": p, "verdict": verdict}
