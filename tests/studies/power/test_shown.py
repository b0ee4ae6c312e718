"""The survey as document, rows, words and pictures: of traces made by hand, all that there is of each."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.power import shown
from beaver_ftc.studies.power.probabilities import document_of
from beaver_ftc.studies.power.survey import (
    BOTH,
    ESTIMATORS,
    GRIDS,
    Block,
    Condition,
    Watched,
    scenario_of,
)
from beaver_ftc.studies.present.page import contents
from kept import in_short, picture

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


def test_the_document(surveyed, changed):
    document = dict(surveyed[0])
    assert set(document.pop("versions")) >= {"beaver-ftc", "jsbsim"}
    cells = document.pop("cells")
    assert len(cells) == 2 * 2 * 2 * 2 * len(SCHEMES)
    numbers = [[cell["flights"], cell["median_delay_s"] or -1.0] for cell in cells]
    shares = [[of["value"], of["low"], of["high"]] for cell in cells for of in cell["within"].values()]
    assert not changed(document | {"first cells": cells[:2], "cells": [in_short(numbers), in_short(shares)]})


def test_the_text(surveyed, changed):
    assert not changed(shown.as_text(surveyed[0]).splitlines())
    nothing = {name: [] for name in ("levels", "totals", "cells", "limits", "comparison", "failures")}
    assert not changed(shown.as_text(surveyed[0] | nothing).splitlines(), part="nothing")


@pytest.fixture(scope="module")
def files(surveyed):
    """Of the survey without the rudder in light turbulence, as if that had not been flown."""
    document, rows = surveyed
    flown = [row for row in rows if (row["turbulence"], row["surface"]) != ("light", "rudder")]
    return flown, contents(shown.FILES, (document, flown))


@pytest.mark.parametrize("name", ["map-both", "map-a-scheme", "schemes-ideal"])
def test_the_pictures(files, name, changed):
    figure = files[1]["figures"][f"{name}.png"]
    assert not changed(picture(figure))


def test_a_grid_elsewhere_is_of_another_aircraft_and_one_surface():
    there = GRID.elsewhere("beaver-split", 40.0, None, "aileron_right")
    assert there.surfaces == ("aileron_right",)
    flight = scenario_of(Block(GRID.conditions[0], 5.0, 7), 12.0, where=there.where)
    assert (flight.airframe.name, flight.initial.airspeed_mps) == ("beaver-split", 40.0)
    assert GRID.elsewhere(None, None, None, None) == GRID
    with pytest.raises(BadInput, match="--surface 'flap': allowed: aileron, elevator, rudder"):
        GRID.elsewhere(None, None, None, "flap")
