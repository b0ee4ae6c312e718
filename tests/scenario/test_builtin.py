"""The scenarios that ship: each loads, says what it shows and what it expects, and fits a screen."""

import pytest

from beaver_ftc.scenario import builtin
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


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Built-in files of the test's own: two scenarios, a sweep, a plan."""
    files = {
        "scenarios/one-loss.yaml": "name: one-loss\ndescription: >\n  A loss,\n  alone.\nfaults: []\n",
        "scenarios/healthy.yaml": "name: healthy\nseed: 3\n",
        "scenarios/notes.txt": "none", "scenarios/sweeps/all-losses.yaml": "base: one-loss\nruns: 2\n",
        "evidence/whole-plan.yaml": "name: whole-plan\ndescription: ' The plan '\n",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(builtin, "data_root", lambda: tmp_path)
    return tmp_path


def test_what_is_built_in_is_found_by_its_kind_and_in_the_order_of_names(own):
    assert builtin.builtin_names() == ["healthy", "one-loss"]
    assert (builtin.builtin_sweeps(), builtin.builtin_plans()) == (["all-losses"], ["whole-plan"])
    assert builtin.builtin_path("healthy") == own / "scenarios" / "healthy.yaml"
    found = {kind: builtin.described(kind) for kind in ("scenario", "sweep", "plan")}
    assert found == {
        "scenario": [("healthy", ""), ("one-loss", "A loss, alone.")], "sweep": [("all-losses", "")],
        "plan": [("whole-plan", "The plan")],
    }  # fmt: skip
    for name, kind, key, there in (
        ("healthy", "scenario", "seed", True), ("healthy", "scenario", "base", False),
        ("all-losses", "sweep", "base", True), ("all-losses", "scenario", "base", False),
        (own / "scenarios" / "healthy.yaml", "plan", "seed", True), (own / "none", "plan", "seed", False),
    ):  # fmt: skip
        assert builtin.has_key(name, kind, key) is there


@pytest.mark.parametrize(
    ("given", "kind", "says"),
    [
        ("all-losses", "scenario",
         "all-losses is a sweep, allowed: a scenario; `beaver-ftc sweep all-losses` flies it"),
        ("healthy", "sweep", "healthy is a scenario, allowed: a sweep; `beaver-ftc run healthy` flies it"),
        ("whole-plan", "sweep",
         "whole-plan is a plan, allowed: a sweep; `beaver-ftc evidence whole-plan` flies it"),
        ("helthy", "scenario", "no such file or built-in scenario: 'helthy', did you mean healthy? "
         "allowed: a file, or one of the 2 names that `beaver-ftc list` prints"),
        ("one-los", "plan", "no such file or built-in plan: 'one-los', did you mean the scenario one-loss? "
         "allowed: a file, or one of the 1 names that `beaver-ftc list` prints"),
        ("x" * 101, "sweep", f"no such file or built-in sweep: '{'x' * 100}', "
         "allowed: a file, or one of the 1 names that `beaver-ftc list` prints"),
    ],
)  # fmt: skip
def test_a_name_that_is_none_is_said_to_be_of_another_kind_or_near_to_one(own, given, kind, says):
    assert builtin.no_such(given, kind) == says
