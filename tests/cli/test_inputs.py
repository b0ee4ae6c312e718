"""What is found out of a scenario before its flight is not found out again in it."""

import pytest

from beaver_ftc.cli import load_all
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import conditions


@pytest.fixture
def searched(monkeypatch):
    """The scenarios whose trim was searched for, also that of the designer's aircraft without errors."""
    found, find = [], conditions.trim_of
    monkeypatch.setattr(conditions, "_trims", {})
    monkeypatch.setattr(
        conditions, "trim_of", lambda scenario, plant: found.append(scenario) or find(scenario, plant)
    )
    return found


def test_the_trim_that_is_checked_is_the_one_that_is_flown(searched):
    (scenario,) = load_all(["elevator-partial-loss"])
    checked = list(conditions._trims.values())
    assert [Loop(scenario).trim] == checked
    assert searched.count(scenario) == 1


def test_a_flight_that_cannot_be_trimmed_is_named_by_file_and_line(searched, tmp_path):
    file = tmp_path / "slow.yaml"
    file.write_text("name: slow\ninitial: {airspeed_mps: 20, altitude_m: 6000}\n")
    with pytest.raises(BadInput, match=rf"{file}:2: initial: "):
        load_all([str(file)])
    assert [scenario.name for scenario in searched] == ["slow"]
    assert conditions._trims == {}
