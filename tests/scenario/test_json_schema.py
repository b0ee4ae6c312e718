"""The JSON Schema an editor uses agrees with the loader."""

import jsonschema
import pytest

from beaver_ftc.documents.document import Section, parse
from beaver_ftc.scenario.builtin import builtin_names, builtin_path
from beaver_ftc.scenario.schema import Scenario, json_schema

from .drawn import COUNT, scenarios

SCHEMA = json_schema()
OWN_HOME = ("beaver_ftc.scenario.diagnosis", "beaver_ftc.scenario.diagnosis")
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def refusals(data):
    """What an editor would underline."""
    return [error.message for error in VALIDATOR.iter_errors(data)]


@pytest.mark.parametrize("name", builtin_names())
def test_it_accepts_the_builtin_scenarios(name):
    assert refusals(parse(builtin_path(name).read_text()).data) == []


@pytest.mark.parametrize("number", range(COUNT))
def test_it_accepts_what_the_loader_accepts(number):
    data = scenarios()[number]
    Scenario.model_validate(data)
    assert refusals(data) == []


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"name": "a b"},
        {"name": "x", "seeds": 1},
        {"name": "x", "duration_s": "30"},
        {"name": "x", "initial": {"airspeed_mps": 71}},
        {"name": "x", "faults": [{"type": "stuk", "at_s": 1}]},
        {"name": "x", "faults": [{"type": "bias", "actuator": "elevator", "at_s": 1}]},
        {"name": "x", "reference": {"q": [{"sine": {"amplitude_deg_s": 1, "frequency_hz": 1}, "step": {}}]}},
        {"name": "x", "reference": {"q": [{}]}},
        {"name": "x", "actuators": "perfect"},
        {"name": "x", "actuators": {"bandwidth_rad_s": -1}},
        {"name": "x", "sensors": {"q": {"noise": 1}}},
        {"name": "x", "environment": {"wind_mps": [1, 2]}},
    ],
)
def test_it_refuses_what_the_loader_refuses(data):
    assert not VALIDATOR.is_valid(data)
    with pytest.raises(ValueError, match="validation error"):
        Scenario.model_validate(data)


def sections(parent: type[Section] = Section) -> set[str]:
    """The names of all sections of a scenario but diagnosis and control, which have their own home."""
    children = [child for child in parent.__subclasses__() if child.__module__ not in OWN_HOME]
    return {child.__name__ for child in children}.union(*map(sections, children))


@pytest.mark.parametrize("name", sorted(sections() & set(SCHEMA["$defs"])))
def test_every_number_of_a_scenario_has_a_unit_and_a_description(name):
    for key, node in SCHEMA["$defs"][name].get("properties", {}).items():
        kinds = {branch.get("type") for branch in node.get("anyOf", [node])}
        if "number" in kinds:
            assert node["unit"], (name, key)
            assert node["description"].endswith(node["unit"]), (name, key)
