"""Damage as a fault: when which property is set, what is refused, what a verdict is held against."""

from dataclasses import replace

import pytest

from beaver_ftc import Simulation
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.schema import load
from scenario.damageable import damageable

CASE = {"type": "damage", "case": "tail-off", "at_s": 0.1}


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A scenario with faults on an aircraft that can be damaged."""
    damageable(tmp_path / "plane")

    def of(*faults):
        text = f"name: broken\naircraft: ./plane\nduration_s: 1\nfaults: {list(faults)!r}\n"
        (tmp_path / "broken.yaml").write_text(text)
        return load(tmp_path / "broken.yaml")

    return of


def seen(scenario, *names):
    """The values of properties with which each frame begins."""
    sim, rows = Simulation(scenario), []
    while not sim.done:
        rows.append([sim[name] for name in names])
        sim.step()
    return rows


def test_a_case_is_there_from_its_frame_to_its_end(written):
    scenario = written(CASE | {"end_s": 0.3}, {"type": "damage", "case": "dented", "at_s": 0.2})
    rows = seen(scenario, "failures/damage/tail-off", "failures/damage/dented")
    assert [row[0] for row in rows] == [float(10 <= k < 30) for k in range(len(rows))]
    assert [row[1] for row in rows] == [float(k >= 20) for k in range(len(rows))]


def test_in_flight_it_is_inflicted_and_repaired(written):
    sim = Simulation(written())
    for _ in range(5):
        sim.step()
    sim.inject({"type": "damage", "case": "tail-off"})
    sim.step()
    assert sim["failures/damage/tail-off"] == 1.0
    sim.repair("damage")
    sim.step()
    assert sim["failures/damage/tail-off"] == 0.0


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({"case": "wing-off"}, "'wing-off' is not known"),
        ({}, "case"),
        ({"case": "dented", "actuator": "elevator"}, "actuator"),
        ({"case": "dented", "profile": "incipient"}, "profile"),
    ],
)
def test_what_no_damage_is(written, fault, says):
    with pytest.raises(BadInput, match=says):
        written({"type": "damage", "at_s": 0.1} | fault)


@pytest.mark.parametrize(("name", "right"), [("unanticipated", True), ("rudder", True), ("aileron", False)])
def test_right_is_outside_of_every_class_or_a_surface_that_went_with_it(written, name, right):
    flight = replace(fly(written(CASE)), isolated=name, isolation_time_s=0.5)
    assert metrics(flight)["isolation"]["correct"] is right


@pytest.mark.parametrize(("kind", "right"), [("loss_of_effectiveness", True), ("stuck", False), (None, None)])
def test_a_surface_that_is_gone_has_lost_all_its_effect(written, kind, right):
    flight = replace(fly(written(CASE)), isolated="rudder", isolation_type=kind, isolation_time_s=0.5)
    assert metrics(flight)["isolation"]["type_correct"] is right
