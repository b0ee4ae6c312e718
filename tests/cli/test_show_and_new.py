"""Built-in scenarios to look at, and new ones to begin with."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from beaver_ftc.cli import catalogue
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.builtin import builtin_names, builtin_path, builtin_sweeps, described
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.scenario.sweeps import load_sweep_text
from commands import beaver

BEAVER = Path(sys.executable).with_name("beaver-ftc")


def _beaver(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=True)


def test_a_short_list_has_every_name_and_no_more():
    listed = json.loads(_beaver("list", "--format", "json").stdout)
    said, kind = {}, None
    for line in _beaver("list", "--short").stdout.splitlines():
        if line.startswith("  "):
            said[kind] += [name for name in line.strip().rstrip(",").split(", ") if name]
        else:
            kind = line
            said[kind] = []
    assert said == {kind: [entry["name"] for entry in entries] for kind, entries in listed.items()}
    for kind in ("scenario", "sweep", "plan"):
        assert said[f"{kind}s"] == [name for name, _ in described(kind)]


def test_what_is_shown_is_the_file():
    for name in builtin_names():
        assert _beaver("show", name).stdout == builtin_path(name).read_text()
    for name in builtin_sweeps():
        assert load_sweep_text(_beaver("show", name).stdout, name=name).name == name


@pytest.mark.parametrize("like", [None, "rudder-stuck"])
def test_a_new_scenario_is_one_and_replaces_nothing(tmp_path, like):
    options = ["--like", like] if like else []
    assert _beaver("new", "mine", "--out", tmp_path, *options).exit_code == 0
    scenario = load_scenario(tmp_path / "mine.yaml")
    assert scenario.name == "mine"
    if like:
        assert scenario.faults == load_scenario(like).faults
    else:
        assert scenario.expect.isolated_as == scenario.faults[0].actuator == "elevator"
    (tmp_path / "all.yaml").mkdir()
    assert _beaver("new", "mine", "--out", tmp_path / "all.yaml", *options).exit_code == 0
    assert (tmp_path / "all.yaml" / "mine.yaml").read_text() == (tmp_path / "mine.yaml").read_text()
    (tmp_path / "mine.yaml").write_text("precious")
    refused = beaver("new", "mine", cwd=tmp_path)
    assert (refused.returncode, refused.stderr) == (2, "new: mine.yaml exists, allowed: another name\n")
    assert (tmp_path / "mine.yaml").read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "status"), [("a b", 2), ("../x", 2), ("", 2), ("x" * 101, 2), ("nowhere/x", 2)]
)
def test_a_name_that_cannot_be_a_scenarios_is_bad_input(tmp_path, name, status):
    done = beaver("new", name, cwd=tmp_path)
    assert done.returncode == status
    assert list(tmp_path.iterdir()) == []


def test_help_has_examples_on_lines_of_their_own():
    for name, command in typer.main.get_command(app).commands.items():
        shown = [line.strip() for line in _beaver(name, "--help").stdout.splitlines()]
        assert set(map(str.strip, (command.epilog or "").splitlines()[2:])) <= set(shown)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shell_is_told_commands_and_scenarios(shell):
    asked = {
        "_BEAVER_FTC_COMPLETE": f"complete_{shell}",
        "COMP_WORDS": "beaver-ftc run elevator-p", "COMP_CWORD": "2",
        "_TYPER_COMPLETE_ARGS": "beaver-ftc run elevator-p", "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }  # fmt: skip
    done = subprocess.run([BEAVER], env={**os.environ, **asked}, capture_output=True, text=True, check=False)
    assert "elevator-partial-loss" in done.stdout


def test_a_list_that_is_none_is_cut_and_those_there_are_are_named():
    with pytest.raises(BadInput) as refused:
        catalogue.list_choices("x" * 99)
    known = "scenarios, sweeps, plans, aircraft, schemes, laws, faults, signals"
    assert str(refused.value) == f"there is no list of '{'x' * 60}', allowed: {known}"
