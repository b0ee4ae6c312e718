"""What `detectability` says and draws of each kind of document made by hand, no two numbers alike."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.detectability.certain import MAGNITUDES
from beaver_ftc.studies.detectability.certain import document_of as places_of
from beaver_ftc.studies.detectability.isolability import DOUBLET_COLUMNS, LOSS_COLUMNS
from beaver_ftc.studies.detectability.probabilities import document_of
from beaver_ftc.studies.detectability.schemes import (
    BOTH,
    ESTIMATORS,
    GRIDS,
    Condition,
    Watched,
)
from beaver_ftc.studies.detectability.shown import OF_PLACES, OF_SCHEMES, OF_SIZES, page_of
from beaver_ftc.studies.present.page import as_text, contents
from kept import page, picture


def rows_made():
    rows = []
    for i, fault in enumerate(("aileron", "elevator")):
        for j, (V, h, scale) in enumerate(
            (V, h, s) for V in (38.0, 45.5) for h in (0.0, 1000.0) for s in (0.5, 2.0)
        ):
            found = [0.1 + (i + 2 * j) / 30, 0.05 + j / 40, 0.3 + j / 20, 0.25 + i / 10]
            least = [None if (i + j) % 5 == k else m for k, m in enumerate(found)]
            place = {"airspeed_mps": V, "altitude_m": h, "excitation": scale, "fault": fault}
            why = f"for the reason {i}{j}"
            rows.append(
                {**place, **dict(zip(MAGNITUDES, least, strict=True)), "confused_with": None, "why": why}
            )
    return rows


def pairs_made():
    """Of two places and three excitations: always at one place, never by a doublet at the other."""
    found = []
    for fault, other in (("aileron", "elevator"), ("elevator", "aileron")):
        for j, (V, scale) in enumerate((V, s) for V in (38.0, 45.5) for s in (0.5, 1.0, 2.0)):
            seen = None if j == 4 else 0.3 + j / 10, 0.2 + j / 20, None if j == 4 else 0.4, 0.1
            told = (None, None, "no travel") if V == 45.5 and scale == 2.0 else (1.25 + j, 0.03, "")
            place = {
                "airspeed_mps": V,
                "altitude_m": 0.0,
                "excitation": scale,
                "fault": fault,
                "other": other,
            }
            values = dict(zip((*LOSS_COLUMNS, *DOUBLET_COLUMNS), (*seen, *told), strict=True))
            found.append(place | values)
    return found


@pytest.fixture(scope="module")
def places():
    rows, pairs = rows_made(), pairs_made()
    parts = {"points": rows[:8], "pairs": pairs[:6]}, {"points": rows[8:], "pairs": pairs[6:]}
    return places_of("made", parts)


def test_what_is_certain(places, changed):
    none = [row | dict.fromkeys(MAGNITUDES) for row in places["points"][:1]]
    texts = [as_text(page_of(one)[1]) for one in (places, places | {"points": none, "pairs": []})]
    assert not changed([text.splitlines() for text in texts])


@pytest.mark.parametrize("name", ["detectability", "isolability"])
def test_pictures_of_what_is_certain(places, name, changed):
    assert not changed(picture(OF_PLACES[f"{name}.png"](places)))


def row(variant, size, low, high, flights, certain, total=(0.97, 0.91, 0.99, 38, 39)):
    value, least, most, count, of = total
    return {
        "variant": variant,
        "found": {"size": size, "low": low, "high": high, "flights": flights},
        "certain": {"size": certain, "flights": 17, "at_total_loss": 13},
        "total_loss": {"value": value, "low": least, "high": most, "count": count, "of": of},
    }


COMPARED = (
    row("without turbulence", 0.12, 0.08, 0.16, 61, 0.31),
    row("with exact gyros", 0.22, 0.18, 0.27, 53, 0.43),
    row("with twice the reference", 0.15, 0.11, 0.19, 47, 0.37),
    row("with half the reference", 0.57, 0.49, 0.65, 43, None),
)  # fmt: skip


def document(found=(0.34, 0.28, 0.41), certain=0.52, compared=COMPARED, **changes):
    whole = row("as it is", *found, 83, certain)
    whole |= {
        "scenario": "brisk", "surface": "aileron", "within_s": 0.5, "share": 0.9, "inconclusive": [],
        "bound_used": 0.29, "false_alarms": 0, "failed": 0, "compared": list(compared),
    }  # fmt: skip
    return whole | changes


CASES = {
    "all known": document(),
    "doubts": document(
        inconclusive=["airspeed above 80 m/s, 12 % of the frames"], bound_used=0.998, false_alarms=3, failed=5
    ),
    "nothing certain": document(certain=None, compared=COMPARED[3:]),
    "none found": document(
        found=(None, None, None), certain=None, total_loss=row("", *[None] * 5, (0.62, 0.46, 0.75, 24, 38))[
            "total_loss"
        ],
    ),
    "an open end": document(found=(0.95, 0.9, None), compared=()),
    "to a percent": document(found=(0.34, 0.34, 0.34)),
}  # fmt: skip


def test_what_is_said_of_every_size(changed):
    assert not changed({name: as_text(page_of(of)[1]).splitlines() for name, of in CASES.items()})


GRID = replace(
    GRIDS["quick"], conditions=(Condition("ideal", "none"), Condition("tactical-grade", "light")),
    surfaces=("aileron", "rudder"), magnitudes=(0.25, 1.0), excitations_deg_s=(2.0, 5.0), blocks=3,
    healthy_h=8 * 90.0 / 3600.0, healthy_flight_s=90.0, per_h=24.0,
)  # fmt: skip
SCHEMES = {ESTIMATORS: 0.4, BOTH: 0.9, "a:scheme": 2.0}  # and how long they take at most to find anything


def watched(block, faults, rng):
    """A block in which each scheme sees each fault, sooner or later or not, and some raise false alarms."""
    traces = {}
    for scheme, slow in SCHEMES.items():
        before, at_s = rng.uniform(0.2, 1.1), rng.uniform(1.0, 8.0)
        rises, healthy_s = ((0.5, 0.5 * before), (at_s, before)), 8.5 if faults else 90.0
        traces[scheme] = []
        for _, magnitude in faults or (("", 0.0),):
            first, later = slow * rng.uniform(0.1, 0.5), slow * rng.uniform(0.5, 3.0)
            rising = (first, rng.uniform(0.1, 1.0) + 0.4 * magnitude), (later, rng.uniform(0.5, 2.5))
            traces[scheme].append(Trace(before, rising, magnitude > 0.0, healthy_s, rises=rises))
    deflections = [[m * d * block.excitation_deg_s for d in (0.5, 0.8, 1.1)] for _, m in faults]
    return Watched(block, faults, traces, deflections)


@pytest.fixture(scope="module")
def surveyed():
    rng = np.random.default_rng(8)
    healthy = [watched(block, (), rng) for block in GRID.healthy()]
    faulted = [watched(block, GRID.faults, rng) for block in GRID.faulted()]
    for one in faulted:  # the slow scheme finds nothing in calm air
        if one.block.condition.turbulence == "none":
            one.traces["a:scheme"] = [Trace(0.1, (), True, 8.5) for _ in GRID.faults]
    healthy[0].failures.append("a:scheme: broke")
    faulted[1].failures += ["a:scheme: broke", "a:scheme: again"]
    return document_of(GRID, healthy, faulted)


def test_what_is_said_of_schemes(surveyed, changed):
    assert not changed(as_text(page_of(surveyed[0])[1]).splitlines())
    nothing = {name: [] for name in ("levels", "totals", "cells", "limits", "comparison", "failures")}
    assert not changed(as_text(page_of(surveyed[0] | nothing)[1]).splitlines(), part="nothing")


def test_the_picture_of_schemes_where_not_all_was_flown(surveyed, changed):
    document, rows = surveyed
    flown = [row for row in rows if (row["turbulence"], row["surface"]) != ("light", "rudder")]
    assert not changed(picture(OF_SCHEMES["detectability.png"]((document, flown))))


def test_files_of_every_kind(places, surveyed, changed):
    for name, files, document in (
        ("places", OF_PLACES, places), ("sizes", OF_SIZES, CASES["all known"]),
        ("schemes", OF_SCHEMES, surveyed),
    ):  # fmt: skip
        of = contents(files, document)
        whole = surveyed[0] if name == "schemes" else document
        assert json.loads(of["detectability.json"]) == json.loads(json.dumps(whole))
        assert not changed(of["detectability.csv"].splitlines()[:20], part=f"{name}-csv")
    of = contents(OF_SIZES, CASES["all known"])
    assert not changed(page(of["detectability.html"](Path())), part="page")
