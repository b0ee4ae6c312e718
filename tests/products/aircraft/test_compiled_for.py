"""`derive` and `import` compile what a first flight of their aircraft would wait for."""

import shutil
from pathlib import Path

import pytest

from beaver_ftc.loop import loop
from beaver_ftc_aircraft.commands import MOMENT_S, _compile_for

TRAINER = Path(__file__).parents[2] / "data" / "aircraft" / "trainer"


@pytest.mark.parametrize("flies", [True, False])
def test_an_aircraft_that_was_made_is_flown_for_a_moment(flies, tmp_path, monkeypatch, capsys):
    flown, folder = [], tmp_path / "made"
    if flies:
        shutil.copytree(TRAINER, folder)
    monkeypatch.setattr(loop, "fly", flown.append)
    _compile_for(folder, "deriving")
    assert capsys.readouterr().err == "deriving: compile\n"
    assert [(scenario.airframe.folder, scenario.duration_s) for scenario in flown] == [
        (folder, MOMENT_S)
    ] * flies
