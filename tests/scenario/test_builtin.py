"""The scenarios that ship: each loads, says what it shows and what it expects, and fits a screen."""

import pytest

from beaver_ftc.scenario.builtin import builtin_names, builtin_path, builtin_sweeps, described, resolve
from beaver_ftc.scenario.schema import Expect, load_scenario
from beaver_ftc.scenario.sweeps import load_sweep

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


def test_descriptions_are_those_of_the_files_read_whole():
    scenarios = {name: load_scenario(name).description for name in builtin_names()}
    sweeps = {name: load_sweep(name).file.description for name in builtin_sweeps()}
    for kind, whole in (("scenario", scenarios), ("sweep", sweeps)):
        assert dict(described(kind)) == {name: says.strip() for name, says in whole.items()}


@pytest.mark.parametrize("name", ["elevator-partial-loss", "unanticipated"])
def test_a_case_and_its_nominal_twin_differ_in_the_law_alone(name):
    case, twin = (load_scenario(n).model_dump() for n in (name, f"{name}-nominal"))
    different = {key for key in case if case[key] != twin[key]}
    assert different <= {"name", "description", "control", "expect"}
    assert twin["control"]["law"] == "nominal"


@pytest.mark.parametrize("name", sorted(REQUIRED))
def test_the_uncertainty_is_the_published_one(name):
    uncertainty = load_scenario(name).uncertainty
    assert [abs(theta) for _, theta in uncertainty.inertia_coupling] == [0.25] * 3
    assert [s.amplitude_rad_s2 for _, s in uncertainty.sinusoid] == [0.02] * 3
    assert [s.frequency_rad_s for _, s in uncertainty.sinusoid] == [10, 15, 10]


def test_a_name_is_a_builtin_and_a_path_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fault-free").write_text("name: mine")
    assert resolve("fault-free") == builtin_path("fault-free")
    assert load_scenario("./fault-free").name == "mine"
    assert resolve("other.yaml").name == "other.yaml"
