"""Sweep files: what varies and how, what each mistake is called, and what a sweep makes of its base."""

import pytest

from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.scenario.sweeps import SweepFile, load_sweep_text

HEAD = "base: elevator-partial-loss\nruns: 3\n"
LONG = "n" * 120
WRONG = {
    "two kinds": HEAD + "vary: {rate_hz: {uniform: [50, 100], choice: [50]}}",
    "no kind": HEAD + "vary: {rate_hz: {within: [50, 100]}}",
    "equal ends": HEAD + "vary: {rate_hz: {uniform: [50, 50]}, duration_s: {loguniform: [40, 30]}}",
    "cut to nothing": HEAD + "vary: {rate_hz: {normal: [60, 1], within: [70, 60]}}",
    "cut without a normal": HEAD + "vary: {rate_hz: {choice: [60], within: [60, 70]}}",
    "no logarithm": HEAD + "vary: {rate_hz: {loguniform: [0, 30]}}",
    "no spread": HEAD + "vary: {rate_hz: {normal: [60, 0]}}",
    "outside at one end": HEAD + "vary:\n  rate_hz: {uniform: [10, 50]}\n  seed: {choice: [3]}",
    "outside at both": HEAD + "vary:\n  faults[0].magnitude: {uniform: [-1, 2]}",
    "outside in the middle": HEAD + "vary:\n  faults[0].magnitude: {choice: [0.5, 7, 0.2, 7]}",
    "last of a table": HEAD + "vary: {rate_hz: {linspace: [50, 1001, 3]}}",
    "normal at its cut": HEAD + "vary: {rate_hz: {normal: [60, 9], within: [19, 80]}}",
    "twice": HEAD + "vary:\n  faults[0].at_s: {choice: [1]}\n  faults[0]: {choice: [{type: float}]}",
    "twice below": HEAD + "vary:\n  sensors: {choice: [ideal]}\n  sensors.p: {choice: [{}]}",
    "not twice": HEAD + "vary:\n  faults[0].at_s: {choice: [1]}\n  faults[1].at_s: {choice: [1]}",
    "name": HEAD + "set: {name: a, duration_s: 20}\nvary: {name: {choice: [b]}}",
    "set and set": HEAD + "set:\n  rate_hz: 10\n  substeps: 0\n  faults[0].magnitude: 3",
    "set below": HEAD + "set:\n  substeps: 2\n  faults: [{type: float, actuator: flap, at_s: 77}]",
    "set beside": HEAD + "set:\n  duration_s: 5\n  substeps: 2",
    "set nowhere": HEAD + "set:\n  substeps: 2\n  'faults[4].at_s': 3\n  '..': 4",
    "inline": "runs: 2\nbase:\n  duration_s: 20\n  faults:\n  - {type: float, actuator: flap, at_s: 21}\n",
    "a grid of one": "base: fault-free\nvary: {rate_hz: {linspace: [50, 60, 1]}}",
    "a grid too large": (
        "base: fault-free\nvary: {rate_hz: {linspace: [50, 60, 1000000]}, seed: {linspace: [1, 2, 11]}}"
    ),
    "a scenario": "name: x\nduration_s: 3",
    "nothing of both": "nam: x",
    "no base": "vary: {rate_hz: {choice: [50]}}\nruns: 2",
    "long name of nothing": f"base: {LONG}\nruns: 2",
    "long path to nothing": f"base: {LONG}.yaml\nruns: 2",
    "long path outside": f"base: ../{LONG}.yaml\nruns: 2",
    "longer than any name of a file": f"base: {'n' * 300}.yaml\nruns: 2",
    "a sweep": "base: elevator-effectiveness\nruns: 2",
    "bounds nothing": HEAD + "expect: {detection_rate: {confidence: 0.9}}",
}


def test_what_mistakes_are_called(changed):
    found = {}
    for case, text in WRONG.items():
        with pytest.raises(ScenarioError) as caught:
            load_sweep_text(text, "s.yaml")
        found[case] = [line[:200] for line in caught.value.lines]
    assert not changed(found)


@pytest.mark.parametrize(
    ("given", "grid", "flights"),
    [
        ({"runs": 2}, 1, 2),
        ({"vary": {"a": {"linspace": (1, 2, 5)}, "b": {"linspace": (1, 2, 3)}}}, 15, 15),
        ({"vary": {"a": {"linspace": (1, 2, 1_000_000)}, "b": {"linspace": (1, 2, 10)}}}, 10**7, 10**7),
        ({"runs": 4, "vary": {"a": {"choice": (1, 2)}}}, 1, 4),
        ({"sampling": "grid", "vary": {"a": {"choice": (1, 2)}, "b": {"choice": (1, 2, 3)}}}, 6, 6),
    ],
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
