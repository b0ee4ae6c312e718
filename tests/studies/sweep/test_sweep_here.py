"""Sweeps flown in this very process: what they leave; what is drawn, to the number; rows of made flights."""

import numpy as np
import pytest

from beaver_ftc.scenario.sweeps import Variation
from beaver_ftc.studies.sweep.one_flight import Keep, as_cell, kind_of
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.search import Evolution

from .conftest import SHORT, sweep_of


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
