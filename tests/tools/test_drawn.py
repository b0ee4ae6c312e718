"""Scenarios drawn from the schema: every pair is there, new keys take part, flights keep their promises."""

from argparse import Namespace
from itertools import combinations, islice
from multiprocessing import Barrier, get_context

import numpy as np
import pytest
from pydantic import Field
from tools.drawn import __main__ as command
from tools.drawn.array import CoveringArray, Factor
from tools.drawn.campaign import Outcome, fly
from tools.drawn.compose import EVERYTHING, array_of, drawn_flights
from tools.drawn.promises import broken, told_alike

import beaver_ftc as bf
from beaver_ftc.documents.document import Flag, Number, Section, number
from beaver_ftc.scenario.schema import Scenario, Uncertainty, json_schema

AIRCRAFT = ("beaver", "jsbsim:c172p")
SEED = 2026
ALWAYS = {"name", "aircraft", "duration_s", "rate_hz", "substeps", "seed", "faults"}


def pairs_of(rows):
    return {frozenset(pair) for row in rows for pair in combinations(row.items(), 2)}


def test_every_pair_of_levels_stands_together_in_some_row():
    factors = [
        Factor(name, tuple("abcd"[:n])) for name, n in (("one", 4), ("two", 3), ("three", 3), ("four", 2))
    ]
    rows = list(CoveringArray(factors, lambda *pair: False, np.random.default_rng(1)).rows())
    wanted = {
        frozenset([(one.name, a), (other.name, b)])
        for one, other in combinations(factors, 2)
        for a in one.levels
        for b in other.levels
    }
    assert pairs_of(rows) == wanted
    assert len(rows) <= 16  # 4 times 3 is the least there can be


def test_what_may_not_stand_together_does_not_and_what_means_nothing_is_left_out():
    factors = [
        Factor("fault", ("none", "jam")),
        Factor("surface", ("1", "2"), {"fault": frozenset({"jam"})}),
        Factor("air", ("still", "gust")),
    ]

    def forbidden(name, level, other, there):
        return (name, level, other, there) == ("surface", "2", "air", "gust")

    rows = list(CoveringArray(factors, forbidden, np.random.default_rng(1)).rows())
    assert all(("surface" in row) == (row["fault"] == "jam") for row in rows)
    assert {("2", "still"), ("1", "gust"), ("1", "still")} == {
        (row["surface"], row["air"]) for row in rows if "surface" in row
    }


def test_the_scenarios_have_every_pair_of_what_the_issue_names():
    """Read off the scenarios, not off the rows."""
    found = set()
    for drawn in islice(drawn_flights(SEED, AIRCRAFT), len(list(rows_of(SEED)))):
        scenario = drawn.scenario()
        fault = next((one for one in scenario.faults if not hasattr(one, "sensor")), None)
        sensor = next((one for one in scenario.faults if hasattr(one, "sensor")), None)
        found |= pairs_of([{
            "aircraft": scenario.aircraft, "substeps": min(scenario.substeps, 3),
            "air": scenario.environment.severity, "gusts": min(len(scenario.environment.gusts), 2),
            "class": scenario.fdi.fault_class, "scheme": scenario.fdi.scheme, "law": scenario.control.law,
            "chance": scenario.fdi.statistical is not None, "authority": scenario.fdi.authority,
            "autopilot": bool(scenario.autopilot), "changes": bool(scenario.changes),
            "type": fault and fault.type, "sensor fault": sensor and sensor.type,
        }])  # fmt: skip
    schemes, laws = len({s for s, in_ in scheme_pairs(found)}), 10
    types = {dict(pair).get("type") for pair in found if "type" in dict(pair)}
    assert schemes == 8
    assert len(types) == 9  # eight, and none
    of = [dict(pair) for pair in found]
    assert len({(one["scheme"], one["law"]) for one in of if one.keys() == {"scheme", "law"}}) == 8 * laws
    assert len({(one["type"], one["law"]) for one in of if one.keys() == {"type", "law"}}) == 9 * laws
    assert (
        len({(one["air"], one["sensor fault"]) for one in of if one.keys() == {"air", "sensor fault"}})
        == 4 * 6
    )


def rows_of(seed):
    return array_of(json_schema(), AIRCRAFT, EVERYTHING, np.random.default_rng([seed, 0])).rows()


def scheme_pairs(found):
    return [(dict(pair)["scheme"], pair) for pair in found if "scheme" in dict(pair)]


class Icing(Section):
    """A section that does not exist yet."""

    thickness_mm: Number = number(..., unit="mm", says="ice", ge=0, le=20)
    boots: Flag = Field(default=True)


class WiderUncertainty(Uncertainty):
    roughness: Number = number(1.0, unit="share of 1", says="of the skin", ge=0.5, le=4)


class Wider(Scenario):
    icing: Icing = Field(default_factory=lambda: Icing(thickness_mm=0.0))
    uncertainty: WiderUncertainty = Field(default_factory=WiderUncertainty)


def test_a_new_key_takes_part_by_itself():
    drawn = [one.words for one in islice(drawn_flights(1, ("beaver",), Wider.model_json_schema()), 40)]
    assert {words["icing"]["boots"] for words in drawn if "boots" in words.get("icing", {})} == {True, False}
    thick = [words["icing"]["thickness_mm"] for words in drawn if "thickness_mm" in words.get("icing", {})]
    assert thick
    assert 0 <= min(thick) < max(thick) <= 20
    rough = [
        words["uncertainty"]["roughness"] for words in drawn if "roughness" in words.get("uncertainty", {})
    ]
    assert rough
    assert 0.5 <= min(rough) < max(rough) <= 2.0  # within a factor of two of its default


def test_every_key_of_the_schema_is_drawn_sometime():
    """But for text, and the options of plug-ins, which only these know."""
    schema, met = json_schema(), set()
    for drawn in islice(drawn_flights(3, ("beaver",)), 500):
        met |= set(paths(drawn.words))
    missing = {path for path in keys(schema, schema["properties"]) if path not in met}
    assert missing <= {"description", "fdi.options", "control.options"}


def keys(schema, properties):
    """The keys of the scenario and of its plain sections."""
    for name, node in properties.items():
        below = schema["$defs"].get(node.get("$ref", "").rpartition("/")[2], {})
        yield name
        if "properties" in below and name != "expect":
            yield from (f"{name}.{key}" for key in below["properties"])


def paths(words, path=""):
    for key, value in words.items():
        here = f"{path}.{key}" if path else key
        yield here
        if isinstance(value, dict):
            yield from paths(value, here)


def test_what_is_declared_covers_the_truth():
    """By the scenario's own warnings, which know another way."""
    loose = []
    for drawn in islice(drawn_flights(4, AIRCRAFT, kinds=(EVERYTHING,)), 120):
        said = drawn.scenario().warnings()
        loose += [
            line
            for line in said
            if "fdi.bounds" in line and not line.startswith(("environment.gust", "faults: "))
        ]
    assert loose == []


def test_the_same_number_is_the_same_scenario():
    first, second = (next(islice(drawn_flights(5, AIRCRAFT), 37, 38)).words for _ in range(2))
    assert first == second


@pytest.fixture(scope="module")
def published():
    return bf.fly(bf.load("elevator-partial-loss").with_({"duration_s": 14.0}))


def altered(metrics, **sections):
    return {**metrics, **{name: {**metrics[name], **keys} for name, keys in sections.items()}}


@pytest.mark.parametrize(
    ("sections", "kind"),
    [
        ({"detection": {"time_s": 3.0}}, "false alarm"),
        ({"detection": {"guaranteed_delay_s": 0.001, "delay_s": 0.5}}, "late"),
        ({"detection": {"detected": False, "time_s": None, "delay_s": None}}, "isolation"),
        ({"isolation": {"fault": "rudder"}}, "wrong name"),
        ({"isolation": {"fault": "unanticipated"}}, "excluded"),
        ({"isolation": {"fault": None, "isolated": False, "candidates": ["rudder"]}}, "excluded"),
        ({"detection": {"delay_s": 0.02}}, "verdict"),
        ({"isolation": {"delay_s": 0.03}}, "verdict"),
        ({"isolation": {"correct": False}}, "verdict"),
    ],
)
def test_a_broken_promise_is_seen(published, sections, kind):
    assert list(broken(published.scenario, published.metrics, True)) == []
    found = broken(published.scenario, altered(published.metrics, **sections), True)
    assert kind in {line.partition(":")[0] for line in found}


def test_a_false_alarm_that_is_none_is_seen(published):
    (line,) = broken(published.scenario, published.metrics | {"false_alarm": True}, False)
    assert line.startswith("verdict: false_alarm True")


def test_an_alarm_is_held_against_the_diagnosis_that_raised_it(published):
    """One of our own early in a flight, and that of a rival which took its place: only the first promises."""
    to_rival = {"time_s": 2.0, "law": None, "scheme": "rls-monitor", "sensors": False}
    for ours_s, rivals_s, broken_then in ((1.0, 12.01, True), (None, 2.0, False)):
        told = altered(published.metrics, detection={"time_s": rivals_s})
        told["changes"] = [{**to_rival, "detection_time_s": ours_s, "isolated": None}]
        found = list(broken(published.scenario, told, True))
        assert any(line.startswith("false alarm") for line in found) == broken_then


def test_an_instrument_is_held_against_the_diagnosis_that_has_watched_it():
    """One that was broken before the diagnosis began anew, with other sensors, may be taken for another."""
    fault = {"type": "bias", "sensor": "q", "at_s": 1.0, "magnitude": 4.0}
    flight = bf.fly({"duration_s": 2.0, "faults": [fault], "fdi": {"fault_class": "all"}}, log=False)
    wrong = altered(flight.metrics, isolation={"fault": "sensor theta"})
    change = {"time_s": 1.5, "law": None, "scheme": None, "sensors": True}
    for changes, misnamed in (([], True), ([change], True), ([{**change, "detection_time_s": 1.1}], False)):
        found = list(broken(flight.scenario, {**wrong, "changes": changes}, True))
        assert any(line.startswith("wrong name") for line in found) == misnamed


def test_a_surface_that_ran_to_both_stops_has_no_one_type(published):
    up = {"type": "hardover", "actuator": "elevator", "direction": 1, "at_s": 12.0}
    for direction, promised in ((1, True), (-1, False)):
        faults = [up, {**up, "direction": direction, "at_s": 12.4}]
        fdi = {"fault_class": "all", "fault_profile": "any"}
        scenario = published.scenario.with_({"faults": faults, "fdi": fdi})
        told = altered(published.metrics, isolation={"fault": "elevator", "type": "bias", "candidates": []})
        assert any(line.startswith("wrong type") for line in broken(scenario, told, True)) == promised


@pytest.mark.parametrize(
    ("column", "says"),
    [
        ("detected", "`detected`"),
        ("mode", "modes"),
        ("elevator_saturated", "saturated"),
        ("q_model_rad_s", "missed"),
    ],
)
def test_a_log_that_tells_another_story_is_seen(published, column, says):
    assert list(told_alike(published)) == []
    other = bf.Flight(published.scenario, published.metrics)
    other.__dict__["log"] = published.log.assign(**{column: published.log[column].shift(3, fill_value=1.0)})
    assert any(says in line for line in told_alike(other))


@pytest.mark.parametrize("every", [1, 10])
def test_a_covering_array_of_flights_breaks_no_promise(every):
    """All of it at night, each tenth flight of it every day."""
    rows = len(list(rows_of(SEED)))
    found = [fly(drawn) for drawn in islice(drawn_flights(SEED, AIRCRAFT), 0, rows, every)]
    assert [(one.index, one.broken) for one in found if one.broken] == []


def test_workers_fly_at_the_same_time(monkeypatch):
    """Each waits for the other before every flight."""
    together = Barrier(2)

    def slices(seed, aircraft, first, end, step, keep, shrink):
        for index in range(first, end, step):
            together.wait(timeout=10)
            yield Outcome(index, declared=True)

    monkeypatch.setattr(command, "fly_slice", slices)
    monkeypatch.setattr(command, "WORKERS_BEGIN_AS", get_context("fork"))  # so that they have this `slices`
    args = Namespace(seed=1, aircraft=AIRCRAFT, first=3, flights=4, workers=2, keep=None, shrink=False)
    assert sorted(outcome.index for outcome in command.outcomes(args)) == [3, 4, 5, 6]
