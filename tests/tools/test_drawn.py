"""Scenarios drawn from the schema: every pair is there, new keys take part, flights keep their promises."""

from itertools import islice

import numpy as np
import pytest
from tools.drawn.campaign import fly
from tools.drawn.compose import EVERYTHING, array_of, drawn_flights
from tools.drawn.promises import broken

import beaver_ftc as bf
from beaver_ftc.scenario.schema import json_schema

AIRCRAFT = ("beaver", "jsbsim:c172p")
SEED = 2026


def rows_of(seed):
    return array_of(json_schema(), AIRCRAFT, EVERYTHING, np.random.default_rng([seed, 0])).rows()


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
    ],
)
def test_a_broken_promise_is_seen(published, sections, kind):
    assert list(broken(published.scenario, published.metrics, True)) == []
    found = broken(published.scenario, altered(published.metrics, **sections), True)
    assert kind in {line.partition(":")[0] for line in found}


@pytest.mark.parametrize("every", [1, 10])
def test_a_covering_array_of_flights_breaks_no_promise(every):
    """All of it at night, each tenth flight of it every day."""
    rows = len(list(rows_of(SEED)))
    found = [fly(drawn) for drawn in islice(drawn_flights(SEED, AIRCRAFT), 0, rows, every)]
    assert [(one.index, one.broken) for one in found if one.broken] == []
