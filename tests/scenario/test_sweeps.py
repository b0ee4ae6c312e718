"""Sweep files: what varies and how, what each mistake is called, and what a sweep makes of its base."""

import pytest

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.sweeps import SweepFile, load_sweep_text
from given import given

GIVEN = given(__file__)

HEAD = "base: elevator-partial-loss\nruns: 3\n"
LONG = "n" * 120
WRONG = GIVEN["wrong"]


def test_what_mistakes_are_called(changed):
    found = {}
    for case, text in WRONG.items():
        with pytest.raises(ScenarioError) as caught:
            load_sweep_text(text, "s.yaml")
        found[case] = [line[:200] for line in caught.value.lines]
    assert not changed(found)


@pytest.mark.parametrize(
    ("given", "grid", "flights"),
    GIVEN["points of a grid and flights"],
)
def test_points_of_a_grid_and_flights(given, grid, flights):
    file = SweepFile.model_validate({"name": "x", "base": "fault-free", **given})
    assert (file.grid_size, file.flights) == (grid, flights)


@pytest.mark.parametrize("key", ["sensors", "sensors.q.delay_s"])
def test_a_law_does_not_know_the_sensors_of_its_flight(key):
    value = 0.03 if key != "sensors" else {"q": {"delay_s": 0.03}}
    flown = load_sweep_text(HEAD + f"vary:\n  {key}: {{choice: [{value}]}}\n").scenario({key: value})
    assert (flown.sensors.q.delay_s, flown.known_sensors.q.delay_s) == (0.03, 0.0)


def test_the_designer_knows_the_actuators_of_its_flight_only_if_its_own_model_has_them():
    vary = "vary:\n  actuators: {choice: [servo]}\n  design_model: {choice: [{}, {actuators: servo}]}\n"
    untold, told = (
        load_sweep_text(HEAD + vary).scenario({"actuators": "servo", "design_model": model})
        for model in ({}, {"actuators": "servo"})
    )
    assert untold.known_actuators != untold.actuators == told.known_actuators
