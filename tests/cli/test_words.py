"""What people read: it says what is so, and leads to what they wanted."""

import re
from pathlib import Path

import pytest

import commands
from beaver_ftc.scenario.schema import load_text


@pytest.fixture
def beaver(monkeypatch, tmp_path):
    """Runs a command in a folder of its own: (exit status, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        done = commands.beaver(*map(str, arguments), cwd=tmp_path)
        return done.returncode, done.stdout, done.stderr

    return run


def _validated(beaver, text):
    Path("x.yaml").write_text(text)
    return beaver("validate", "x.yaml")


def test_the_editors_schema_offers_nothing_that_a_scenario_refuses(beaver):
    status, schema, _ = beaver("schema")
    assert status == 0
    assert "module:" not in schema.lower()
    for key, path in (("scheme", "fdi"), ("law", "control")):
        status, _, said = _validated(beaver, f"name: x\n{path}: {{{key}: 'some.module:Class'}}\n")
        assert (status, "is a class; a scenario names what is registered" in said) == (2, True)


def test_the_schema_of_two_kinds_is_refused(beaver):
    assert beaver("schema", "--sweep", "--plan")[0] == 2


def test_a_severity_given_as_turbulence_is_told_where_it_belongs(beaver):
    status, _, said = _validated(beaver, "name: x\nenvironment: {turbulence: moderate}\n")
    assert status == 2
    assert said.startswith("x.yaml:2: environment.turbulence: 'moderate' is a severity, allowed: ")
    meant = re.search(r"turbulence: dryden with severity: moderate", said)[0].replace(" with", ",")
    assert _validated(beaver, f"name: x\nenvironment: {{{meant}}}\n")[0] == 0


@pytest.mark.parametrize(
    ("sensors", "says"),
    [
        ("q: {noise_std_deg_s: 0.05}", "sensors.q: its errors"),
        ("q: {noise_std_deg_s: 0.05}, alpha: {bias_deg: 0.2}", "sensors: the errors of q, alpha"),
    ],
)
def test_the_smallest_grade_that_covers_them_is_named(sensors, says):
    (line,) = load_text(f"name: x\nsensors: {{{sensors}}}\n").warnings()
    assert line.startswith(says)
    assert "consumer-grade" in line
    (line,) = load_text("name: x\nsensors: {q: {noise_std_deg_s: 9}}\n").warnings()
    assert "grade" not in line  # no preset is as bad as that
    assert "the same keys there declare them" in line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("sweep", "fault-free"), "fault-free is a scenario, allowed: a sweep; `beaver-ftc run fault-free`"),
        (
            ("run", "elevator-effectiveness"),
            "is a sweep, allowed: a scenario; `beaver-ftc sweep elevator-effectiveness`",
        ),
        (("new", "mine", "--like", "elevator-effectiveness"), "elevator-effectiveness is a sweep, allowed: "),
        (("run", "elevator-effectivenes"), "did you mean the sweep elevator-effectiveness?"),
        (("sweep", "fault-fre"), "did you mean the scenario fault-free?"),
        (("sweep", "elevator-effectivenes"), "did you mean elevator-effectiveness?"),
    ],
)
def test_a_scenario_given_for_a_sweep_and_the_other_way_round_are_told(beaver, arguments, says):
    status, out, said = beaver(*arguments)
    assert (status, out) == (2, "")
    assert says in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("sensors: tactical", "'tactical' is not known, did you mean tactical-grade?"),
        ("faults: [{actuator: elevator, type: loss, at_s: 1}]", "did you mean loss_of_effectiveness?"),
        ("fdi: {scheme: adaptive}", "did you mean adaptive-estimators?"),
        ("aircraft: c172p", "jsbsim:NAME as `beaver-ftc list aircraft` has them"),
        (
            "faults: {actuator: elevator, type: float, at_s: 1}",
            "a list of at most 1000 items, each begun with `- `",
        ),
    ],
)
def test_what_was_meant_is_said_of_a_beginning_a_lone_name_and_a_missing_dash(beaver, written, says):
    status, _, said = _validated(beaver, f"name: x\n{written}\n")
    assert status == 2
    assert says in said
