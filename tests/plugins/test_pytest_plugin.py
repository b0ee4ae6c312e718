"""Scenario files as pytest items, in a pytest of their own."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from commands import beaver, run_pytest

pytestmark = pytest.mark.usefixtures("figures_in_short")

MEETS = """
name: meets
duration_s: 4
reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.5}}]}
faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.5, at_s: 2}]
expect: {detected_within_s: 0.5, isolated_as: elevator, post_fault_rms_deg_s: {q: 5, p: 5}}
"""
MISSES = MEETS.replace("meets", "misses").replace("isolated_as: elevator", "isolated_as: rudder")
SWEEP = """
name: many
base: fault-free
set: {duration_s: 1}
runs: 3
vary: {initial.airspeed_mps: {uniform: [40, 45]}}
expect: {departure_rate: {at_most: 0, at_least: 1}, pass_rate: {at_least: 1}}
"""


def _pytest(folder, *arguments):
    return run_pytest(*arguments, cwd=folder)


def _pytest_alone(folder, *arguments):
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--basetemp", "tmp", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "meets.scenario.yaml").write_text(MEETS)
    (tmp_path / "misses.yaml").write_text(MISSES)
    (tmp_path / "many.yaml").write_text(SWEEP)
    (tmp_path / "unrelated.yaml").write_text("services: {web: {image: nginx}}\n")
    return tmp_path


def test_marked_files_are_collected_by_themselves_and_what_expects_nothing_must_complete(folder):
    (folder / "plain.scenario.yaml").write_text("name: plain\nduration_s: 1\n")
    (folder / "broken.scenario.yaml").write_text("name: broken\nduration_s: 1\nfdi: {scheme: broken}\n")
    (folder / "plug.py").write_text("class Broken:\n  def reset(self, c): 0/0\n  def step(self, m, c): 0\n")
    done = _pytest(folder, "-v", "--beaver-plugin", "plug:Broken")
    assert re.findall(r"(\w+)\.scenario\.yaml::(\S+) (PASSED|FAILED) ", done.stdout) == [
        ("broken", "completes", "FAILED"),
        *(("meets", name, "PASSED") for name in (
            "detected_within_s", "isolated_as", "post_fault_rms_deg_s.p", "post_fault_rms_deg_s.q"
        )),
        ("plain", "completes", "PASSED"),
    ]  # fmt: skip
    assert "plug-in broken at 0 s: reset raised ZeroDivisionError" in done.stdout
    assert "misses" not in done.stdout


@pytest.mark.parametrize("workers", [(), ("-n", "2", "--dist", "loadgroup")], ids=["one", "two workers"])
def test_a_missed_expectation_is_one_item_with_both_values_and_the_result_is_kept(folder, workers):
    done = (_pytest_alone if workers else _pytest)(folder, "--beaver", ".", *workers)
    assert done.returncode == 1
    assert "7 passed" in done.stdout
    assert "1 failed" in done.stdout
    assert "isolated_as: expected rudder, actual elevator" in done.stdout
    assert "Traceback" not in done.stdout
    kept = Path(re.search(r"kept: (\S+)", done.stdout)[1])
    assert (kept / "report.html").is_file()
    assert list((kept / "figures").glob("*.png"))
    assert "many" not in done.stdout
    assert "unrelated" not in done.stdout


def _collected(folder, *arguments):
    return _pytest(folder, "--collect-only", "-q", *arguments).stdout.splitlines()


def test_result_folders_are_not_collected_unless_a_file_in_one_is_named(folder):
    before = _collected(folder, "--beaver", ".")
    for command in (("run", "meets.scenario.yaml"), ("sweep", "many.yaml", "--keep-logs", "1")):
        beaver(*command, "--no-report", cwd=folder)
    assert (folder / "runs" / "meets" / "scenario.yaml").is_file()
    assert list((folder / "runs" / "many" / "flights").glob("*/scenario.yaml"))
    assert _collected(folder, "--beaver", ".")[:-1] == before[:-1]  # the last line has the time it took
    named = _collected(folder, "runs/meets/scenario.yaml")
    assert "runs/meets/scenario.yaml::isolated_as" in named


def test_a_sweep_that_is_named_is_a_test_bound_by_bound(folder):
    done = _pytest(folder, "-v", "many.yaml", "unrelated.yaml", "--beaver")
    assert "unrelated.yaml" in done.stderr  # which pytest cannot find a test in
    done = _pytest(folder, "-v", "many.yaml")
    assert done.returncode == 1
    assert re.findall(r"many\.yaml::(\S+) (PASSED|FAILED) ", done.stdout) == [
        ("departure_rate.at_least", "FAILED"),
        ("departure_rate.at_most", "PASSED"),
        ("pass_rate.at_least", "PASSED"),
    ]
    assert "departure_rate.at_least: expected ≥ 1, actual 0 of 3 flights" in done.stdout
    assert "Traceback" not in done.stdout
    kept = Path(re.search(r"kept: (\S+)", done.stdout)[1])
    assert (kept / "report.html").is_file()
    assert (kept / "results.parquet").is_file()


def test_a_plug_in_that_is_none_is_wrong_usage(folder):
    done = _pytest(folder, "--beaver-plugin", "json:tool")
    assert done.returncode == 4
    assert "--beaver-plugin json:tool: cannot load json:tool: AttributeError" in done.stderr


FORMS = {
    "bom": "\ufeffname: bom\nduration_s: 1\n",
    "flow": "{name: flow, duration_s: 1}\n",
    "quoted": "\"name\": quoted\n'duration_s': 1\n",
    "spaced": "name : spaced\nduration_s : 1\n",
    "indented": "  name: indented\n  duration_s: 1\n",
    "explicit": "---\n? name\n: explicit\n? duration_s\n: 1\n...\n",
    "bare": "name: bare\n",
}
WRONG = {
    "mistyped": "nmae: mistyped\nduration_s: 1\n",
    "nameless": "faults: []\n",
    "near": "name: near\nfautls: []\n",
    "long": "name: long\nduration_s: -1\n",
    "binary": "name: binary\0",
    "unclosed": "name: [unclosed\n",
}
OTHERS = {
    "workflow": "name: flights\non: [push]\njobs: {fly: {steps: []}}\n",
    "compose": "name: shop\nservices: {web: {image: nginx}}\n",
    "sweep": "name: many\nbase: elevator-partial-loss\nduration_s: 1\nflights: 4\n",
    "list": "- a\n- b\n",
    "empty": "",
}


def test_what_is_a_scenario_for_run_is_one_for_pytest_and_what_cannot_be_read_is_an_error(tmp_path):
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    for name, text in (FORMS | WRONG | OTHERS).items():
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "latin.yaml").write_bytes("name: caf\xe9\n".encode("latin-1"))
    done = _pytest(tmp_path, "--beaver", "--collect-only", "-q", ".")
    assert sorted(re.findall(r"(\w+)\.yaml::completes", done.stdout)) == sorted(FORMS)
    assert sorted(re.findall(r"ERROR (\w+)\.yaml", done.stdout)) == sorted([*WRONG, "latin"])
    assert re.search(r"long\.yaml:2: duration_s: -1 is out of range", done.stdout)
    assert done.returncode == 2
    assert "Traceback" not in done.stdout


def test_unused_it_imports_nothing_of_the_testbed(folder):
    (folder / "test_nothing.py").write_text(
        "import sys\ndef test_lean():\n"
        "    ours = {m for m in sys.modules if m.startswith('beaver_ftc')}\n"
        "    plugin = 'beaver_ftc.pytest_plugin'\n"
        "    light = {'beaver_ftc', 'beaver_ftc.documents', 'beaver_ftc.documents.errors'}\n"
        "    light |= {'beaver_ftc.plugins', 'beaver_ftc.public'}\n"
        "    assert ours <= light | {plugin}\n"
        "    assert not {'numpy', 'pydantic', 'numba', 'jsbsim'} & set(sys.modules)\n"
    )
    done = _pytest_alone(folder, "test_nothing.py", "-p", "no:hypothesispytest")
    assert done.returncode == 0, done.stdout
