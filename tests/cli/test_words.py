"""What people read: it says what is so, and leads to what they wanted."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc as bf
import commands
from beaver_ftc.scenario.schema import load_text

ROOT = Path(__file__).parents[2]


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


def test_why_a_surface_that_is_named_is_kept_in_use_is_said(beaver):
    mission = bf.load("mission-elevator-jammed").with_({"duration_s": 53, "expect": {}})
    flight = bf.fly(mission, log=False)
    (taken_s,) = (change.time_s for change in flight.supervisor if change.mode == "reallocated")
    assert taken_s > flight.isolation.time_s + 1.0  # the flight is one of those that wait
    named_s = flight.isolation.time_s
    told = f"elevator was named at {named_s:.2f} s; its demand was reallocated at {taken_s:.2f} s"
    assert [told in hint for hint in flight.metrics["hints"]] == [True]
    assert told in repr(flight)
    at_once = bf.fly(bf.load("elevator-stuck").with_({"duration_s": 14, "expect": {}}), log=False)
    assert not any("was reallocated" in hint for hint in at_once.metrics["hints"])


def _documented(name):
    """Field -> shape as text, of one of the tables of docs/reference/plugins.md."""
    page = (ROOT / "docs/reference/plugins.md").read_text()
    table = page.partition(f"`{name}` (`beaver_ftc")[2].partition("|\n\n")[0]
    for names, says in re.findall(r"^\| ?(`[^|]*?) ?\| ?(.*?) ?\|$", f"{table}|", re.MULTILINE):
        fields, shapes = (
            re.findall(r"`(\w+)`", names),
            re.findall(r"(\((?:\d|\w+ \+ \w+|surfaces),[\w ]*\))", says),
        )
        if len(shapes) == len(fields):
            yield from zip(fields, shapes, strict=True)


@pytest.mark.parametrize("aircraft", ["beaver", "./trainer"])
def test_arrays_of_a_plug_in_have_the_documented_shapes(aircraft, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "tests/data/aircraft/trainer", tmp_path / "trainer")
    monkeypatch.chdir(tmp_path)
    seen = {}

    class Looks:
        def reset(self, context):
            seen["context"] = context

        def step(self, measured, command):
            seen["measured"] = measured
            return bf.Verdict()

    flown = bf.fly({"duration_s": 0.05, "aircraft": aircraft}, log=False, detector=Looks())
    made = flown.scenario.airframe
    sizes = {"surfaces": len(made.surfaces), "signals": len(made.signals)}
    documented = {(name, field): shape for name in seen for field, shape in _documented(name)}
    assert {("context", "trim_y"), ("measured", "y"), ("measured", "contribution")} <= documented.keys()
    found = {(name, field): np.shape(getattr(seen[name], field)) for name, field in documented}
    assert found == {of: eval(shape, {}, sizes) for of, shape in documented.items()}
