"""Sweeps flown in this very process: what they leave; what is drawn, to the number; rows of made flights."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.scenario.sweeps import Variation
from beaver_ftc.studies.sweep import one_flight, store
from beaver_ftc.studies.sweep.one_flight import Keep, as_cell, kind_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan
from beaver_ftc.studies.sweep.search import Evolution

from .conftest import SHORT, sweep_of


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], None),
        (["sweep.json"], None),
        ([".lock"], None),
        (["lock"], None),
        (["flights"], None),
        ([".x.partial", "sweep.json"], None),
        (["parts", "figures", "sweep.json", "report.html"], None),
        (["figures"], r"no sweep\.json, but other files"),
        (["report.html", "parts"], r"no sweep\.json, but other files"),
        (["sweep.json", "my.txt"], r"my\.txt, which is no part of a sweep"),
    ],
)
def test_whose_folder_it_is(names, said, tmp_path):
    for name in names:
        (tmp_path / name).touch()
    if said is None:
        store._refuse_foreign(tmp_path)
        return
    with pytest.raises(SimulationFailed, match=f"it holds {said}; move it away"):
        store._refuse_foreign(tmp_path)


def test_a_file_in_the_folders_place_is_left(tmp_path):
    (tmp_path / "short").touch()
    with pytest.raises(SimulationFailed, match="it exists and is not a folder"):
        store._refuse_foreign(tmp_path / "short")


@pytest.mark.parametrize("sampling", ["random", "lhs", "sobol", "grid"])
def test_what_is_drawn_is_what_it_was(sampling, changed):
    """A sweep that is resumed goes on with the same flights."""
    vary = "  duration_s: {linspace: [1, 2, 3]}\n  faults[0].at_s: {loguniform: [0.1, 0.9]}\n"
    if sampling == "grid":
        text = SHORT[: SHORT.index("vary")].replace("runs: 48\n", "sampling: grid\n") + (
            "vary:\n  duration_s: {linspace: [1, 2, 3]}\n  faults[0].actuator: {choice: [aileron, rudder]}\n"
        )
    else:
        text = SHORT.replace("runs: 48", f"runs: 12\nsampling: {sampling}") + vary
    sweep = sweep_of(text)
    plan = Plan(sweep)
    indices = [0, 1, 2, 5]
    assert not changed([list(flight.values.values()) for flight in plan.assignments(indices)])
    assert plan.assignments([2, 5]) == plan.assignments(indices)[2:]
    assert plan.assignments([]) == []


def test_a_trial_as_good_as_its_parent_takes_its_place():
    evolution = Evolution(3, 2)
    evolution.select(np.zeros(16))
    first, second = evolution._points.copy(), evolution.trials()
    evolution.select(np.array([0.0, -1.0, 1.0]))
    np.testing.assert_array_equal(evolution._points[[0, 1, 2, 3]], [second[0], first[1], second[2], first[3]])
    assert evolution._scores[:4].tolist() == [0.0, 0.0, 1.0, 0.0]
    assert evolution.generation == 2


@pytest.mark.parametrize(
    ("choice", "kind", "cells"),
    [
        ([True, False], "flag", [True, False]),
        ([1, 2.5], "float", [1.0, 2.5]),
        ([True, 1], "text", ["true", "1"]),
        (["a", {"b": 1}], "text", ["a", '{"b": 1}']),
    ],
)
def test_how_a_choice_stands_in_its_column(choice, kind, cells):
    assert kind_of(Variation(choice=choice)) == kind
    assert [as_cell(value, kind) for value in choice] == cells
    assert kind_of(Variation(uniform=[0, 1])) == "float"


def test_of_a_flight_that_fails_the_scenario_is_kept(short, tmp_path, monkeypatch):
    (flight,) = Plan(short).assignments([7])
    given = []

    def fail(scenario, folder, report, certified):
        given.append((scenario.name, report))
        raise RuntimeError

    monkeypatch.setattr("beaver_ftc.results.writer.run", fail)
    one_flight.keep_flight(short, flight, Keep(folder=tmp_path))
    assert [path.name for path in (tmp_path / "short-0007").iterdir()] == ["scenario.yaml"]
    assert given == [("short-0007", False)]
    one_flight.keep_flight(short, Assignment(3, {"faults[0].at_s": 2.0}), Keep(folder=tmp_path))
    assert len(given) == 1
    assert one_flight.flight_name(SimpleNamespace(name="x", flights=10_001), 3) == "x-00003"
    assert one_flight.flight_name(SimpleNamespace(name="x", flights=10_000), 3) == "x-0003"


@pytest.mark.parametrize(
    ("policy", "changes", "wanted"),
    [
        ("missed", {"fault.type": None, "detection.detected": False, "isolation.correct": None}, False),
        ("missed", {"status": "departed"}, True),
        ("failed", {"passed": None}, False),
        ("worst", {"passed": False}, False),
        ("none", {"run": 4}, True),
    ],
)
def test_which_flights_are_kept(policy, changes, wanted):
    row = {"run": 1, "status": "flown", "passed": True, "fault.type": "bias", "detection.detected": True,
           "isolation.correct": True}  # fmt: skip
    assert Keep(policy, frozenset({4})).wants(row | changes) is wanted
