"""The scenarios that ship: each loads, says what it shows and what it expects, and fits a screen."""

import pytest

from beaver_ftc.scenario.builtin import builtin_names, builtin_path
from beaver_ftc.scenario.expect import Expect
from beaver_ftc.scenario.schema import load_scenario

REQUIRED = {
    "fault-free",
    "elevator-partial-loss",
    "elevator-partial-loss-nominal",
    "aileron-partial-loss",
    "rudder-partial-loss",
    "unanticipated",
    "unanticipated-nominal",
}


def test_the_published_cases_are_there():
    assert set(builtin_names()) >= REQUIRED


@pytest.mark.parametrize("name", builtin_names())
def test_a_builtin_scenario(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert len(scenario.description) > 40
    assert scenario.expect != Expect()
    assert scenario.warnings() == ()
    assert len(builtin_path(name).read_text().splitlines()) <= 40


@pytest.mark.parametrize("name", ["elevator-partial-loss", "unanticipated"])
def test_a_case_and_its_nominal_twin_differ_in_the_law_alone(name):
    case, twin = (load_scenario(n).model_dump() for n in (name, f"{name}-nominal"))
    different = {key for key in case if case[key] != twin[key]}
    assert different <= {"name", "description", "control", "expect"}
    assert twin["control"]["law"] == "nominal"
