"""Built-in scenarios to look at, and new ones to begin with."""

import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.scenario.builtin import builtin_names, builtin_path, builtin_sweeps
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.scenario.sweeps import load_sweep_text
from commands import beaver


def _beaver(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=True)


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
