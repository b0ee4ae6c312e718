"""The survey as document, rows, words and pictures: of traces made by hand, all that there is of each."""

import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.power import shown, survey
from beaver_ftc.studies.power.probabilities import answers, document_of
from beaver_ftc.studies.power.survey import (
    BOTH,
    ESTIMATORS,
    GRIDS,
    Block,
    Condition,
    Watched,
    fly_block,
    scenario_of,
    strikes_at_s,
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


def test_every_row_is_written(files, changed):
    flown, written = files
    assert set(written) == {"power.json", "power.txt", "power.parquet", "figures"}
    assert sorted({name.rpartition(".")[0] for name in written["figures"]}) == [
        "map-a-scheme", "map-adaptive-estimators", "map-both", "schemes-ideal", "schemes-tactical-grade"
    ]  # fmt: skip
    assert {name.rpartition(".")[2] for name in written["figures"]} == {"png", "svg"}
    table = pq.read_table(io.BytesIO(written["power.parquet"]))
    assert table.to_pylist() == flown
    types = {field.name: str(field.type) for field in table.schema}
    numbers = [name for name, kind in types.items() if kind in ("double", "int64")]
    assert not changed({
        "types": types, "first": flown[:2],
        "in short": {name: in_short(np.array(table[name].to_pylist(), float)) for name in numbers},
        "false alarms": sum(row["false_alarm"] + 100 * row["own_false_alarm"] for row in flown),
    })  # fmt: skip


@pytest.mark.parametrize("name", ["map-both", "map-a-scheme", "schemes-ideal"])
def test_the_pictures(files, name, changed):
    figure = files[1]["figures"][f"{name}.png"]
    assert not changed(picture(figure))


def test_a_map_has_a_row_a_surface_and_a_column_a_condition(surveyed):
    document, rows = surveyed
    grid = document["grid"] | {"conditions": document["grid"]["conditions"][:1]}
    here = [row for row in rows if row["sensors"] == "ideal" and row["scheme"] == BOTH]
    figure = shown._maps(document | {"grid": grid}, BOTH, here)
    assert figure.axes[0].get_subplotspec().get_geometry()[:2] == (2, 1)


def test_a_flight_of_the_survey(changed):
    block = Block(GRID.conditions[1], 5.0, 1002)
    at_s = strikes_at_s(block)
    assert 8.0 <= at_s <= 10.0
    flight = scenario_of(block, 14.0, [survey.loss("rudder", 0.25, at_s)])
    assert not changed(flight.model_dump(mode="json", exclude_unset=True))
    assert len(GRID.healthy()) == 2 * 8
    assert [one.excitation_deg_s for one in GRID.healthy()[:4]] == [2.0, 5.0, 2.0, 5.0]
    assert [one.seed for one in GRID.healthy()[8:11]] == [1_000_000, 1_000_001, 1_000_002]
    assert [one.seed for one in GRID.faulted()[:7]] == [0, 1, 2, 1000, 1001, 1002, 0]


def test_what_comes_of_a_block_in_short_flights(changed, monkeypatch):
    """A quarter of a second after a fault at a tenth, and a second without a fault."""
    monkeypatch.setattr(survey, "STRIKES_S", (0.1, 0.1))
    monkeypatch.setattr(survey, "WATCHED_S", 0.25)
    grid = replace(GRID, surfaces=("elevator",), magnitudes=(0.5, 1.0), healthy_flight_s=0.5)
    block = Block(GRID.conditions[1], 5.0, 7)
    for faulted in (True, False):
        found = fly_block((block, faulted), grid, (ESTIMATORS, BOTH))
        assert found.failures == []
        traces = {
            scheme: [
                [one.before, one.faulted, one.healthy_s, in_short(one.records), in_short(one.rises)]
                for one in of
            ]
            for scheme, of in found.traces.items()
        }
        document = {"faults": found.faults, "deflections": found.deflections, "traces": traces}
        assert not changed(document, part="faulted" if faulted else "healthy")


def test_a_survey_flies_the_healthy_blocks_first(monkeypatch, tmp_path):
    """Its document is made of these as healthy ones and of the rest as faulted ones."""
    asked = []

    def run_study(study, out, workers, progress):
        asked.append((study, out, workers, progress))
        return "document", "rows"

    monkeypatch.setattr(shown, "run_study", run_study)
    monkeypatch.setattr(shown, "document_of", lambda grid, healthy, faulted: (healthy, faulted))
    assert shown.run_power(tmp_path, GRID, [BOTH], 3) == "document"
    ((study, out, workers, progress),) = asked
    assert (study.name, out, workers, progress) == ("power", tmp_path, 3, None)
    assert [faulted for _, faulted in study.cases] == [False] * 16 + [True] * 12
    assert study.document(list(range(28))) == (list(range(16)), list(range(16, 28)))
    shown.run_power(tmp_path, GRID, [BOTH])
    assert asked[1][2] == 1
    lost = survey.lost(SimpleNamespace(what=study.cases[-1]), "gone")
    assert lost.failures == ["tactical-grade light, seed 1002: gone"]


def test_a_fault_after_which_nothing_was_seen_stands_out_of_nothing():
    seen = [(SimpleNamespace(t_s=1.0), None)]
    assert survey.deflections(SimpleNamespace(seen=seen, fault_at_s=1.0), "rudder", 1.0, (0.5, 1.0)) == [
        0.0,
        0.0,
    ]


def test_some_conditions_of_a_grid():
    assert GRID.only("ideal", None).conditions == GRID.only(None, "none").conditions == GRID.conditions[:1]
    assert GRID.only(None, None) == GRID
    with pytest.raises(BadInput, match="allowed: ideal, none; tactical-grade, light"):
        GRID.only("ideal", "light")


def test_a_grid_elsewhere_is_of_another_aircraft_and_one_surface():
    there = GRID.elsewhere("beaver-split", 40.0, None, "aileron_right")
    assert there.surfaces == ("aileron_right",)
    flight = scenario_of(Block(GRID.conditions[0], 5.0, 7), 12.0, where=there.where)
    assert (flight.airframe.name, flight.initial.airspeed_mps) == ("beaver-split", 40.0)
    assert GRID.elsewhere(None, None, None, None) == GRID
    with pytest.raises(BadInput, match="--surface 'flap': allowed: aileron, elevator, rudder"):
        GRID.elsewhere(None, None, None, "flap")


def test_an_answer_is_a_line_for_each_size():
    cell = {"sensors": "ideal", "turbulence": "none", "surface": "rudder", "scheme": "both", "flights": 8}
    within = {
        "0.5": {"value": 0.25, "low": 0.03, "high": 0.65},
        "1": {"value": 1.0, "low": 0.63, "high": 1.0},
    }
    cell |= {"excitation_deg_s": 3.0, "magnitude": 0.4, "within": within}
    document = {"cells": [cell, cell | {"scheme": "worst-case"}, cell | {"surface": "elevator"}]}
    assert answers(document, "rudder") == [
        "ideal sensors, still air, 3 deg/s: a loss of rudder of 40% is found within 0.5 s in 25% (3 to 65%), "
        "within 1 s in 100% (63 to 100%) of 8 flights",
        "In brackets 95 % intervals. `beaver-ftc smallest SCENARIO` finds the size found in 90 % of flights.",
    ]
    assert answers(document, "aileron") == []
