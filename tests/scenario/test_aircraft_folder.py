"""Mistakes in a folder of one's own aircraft."""

import shutil

import pytest

import needs
from beaver_ftc.aircraft.aircraft import load as load_aircraft
from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.scenario.schema import Scenario, load
from trainer import TRAINER


def test_an_aircraft_without_its_model_is_bad_input(tmp_path):
    lines = (load_aircraft("beaver").folder / "aircraft.yaml").read_text().splitlines()
    (tmp_path / "aircraft.yaml").write_text("\n".join(lines))
    at = next(i for i, line in enumerate(lines, 1) if line.startswith("jsbsim:"))
    with pytest.raises(
        BadInput, match=rf"aircraft.yaml:{at}: jsbsim: 'beaver.xml' is not there, allowed: a file"
    ):
        read(tmp_path)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with an aircraft in it, and a cache of its own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    shutil.copytree(TRAINER, tmp_path / "mine" / "trainer")
    return tmp_path / "mine"


def changed(folder, old, new):
    """The lines that are said of the aircraft with one text of its file replaced by another."""
    file = folder / "trainer" / "aircraft.yaml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput) as error:
        find_aircraft("./trainer", folder)
    return [line.removeprefix(f"{file}:") for line in str(error.value).splitlines()]


PROPERTY = "text of letters, digits, -, ., /, [, ] and _ of at most 200 characters"
STOP = "is out of range, allowed: a number from -3.2 to 3.2"


@needs.service("compare")
@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("{command: fcs/ai", "{comand: fcs/ai", [
            "7: surfaces.aileron.comand: unknown key, did you mean command? "
            "allowed: command, position, effective, travel_rad",
            f"7: surfaces.aileron.command: required key is missing, allowed: {PROPERTY}",
        ]),
        ("[-0.4, 0.4]", "[-23, 23]", [
            f"7: surfaces.aileron.travel_rad[0]: -23 {STOP}", f"7: surfaces.aileron.travel_rad[1]: 23 {STOP}",
        ]),
        ("fcs/aileron-cmd-rad", "fcs/aileron-cmd-grad", [
            "7: surfaces.aileron.command: 'fcs/aileron-cmd-grad' is no property of trainer.xml, "
            "allowed: one that it has",
        ]),
        ("{throttle: propulsion/thrust-n}", "{throttle: fcs/no}", [
            "14: trim.throttle: 'fcs/no' is no property of trainer.xml, allowed: one that it has",
        ]),
        ("jsbsim: trainer.xml", "jsbsim: ../x.xml", [
            "5: jsbsim: '../x.xml' has characters that are not allowed, "
            "allowed: text of letters, digits, -, . and _ that ends in .xml of at most 200 characters",
        ]),
    ],
)  # fmt: skip
def test_a_mistake_is_said_at_its_line(folder, old, new, says):
    assert sorted(changed(folder, old, new)) == says


@pytest.mark.parametrize("linked", ["aircraft.yaml", "trainer.xml"])
def test_a_link_out_of_the_scenarios_folder_is_refused(folder, linked):
    (folder / "trainer" / linked).unlink(missing_ok=True)
    (folder / "trainer" / linked).symlink_to(TRAINER / linked)
    with pytest.raises(BadInput, match=f"'./trainer/{linked}' leads outside, allowed: files below"):
        find_aircraft("./trainer", folder)


def test_an_unknown_aircraft_is_the_one_mistake_and_a_scenario_keeps_its_own():
    """Of an aircraft nobody knows nothing else is held against: names are checked against the built-in."""
    with pytest.raises(BadInput) as error:
        load({"name": "x", "aircraft": "bever", "faults": [{"type": "float", "actuator": "nose", "at_s": 1}]})
    first, second = str(error.value).splitlines()
    assert first.startswith("aircraft: 'bever' is not known, did you mean beaver")
    assert second.startswith("faults[0].actuator: 'nose' is not known")
    split = load({"name": "x", "aircraft": "beaver-split"})
    assert split.airframe.name == "beaver-split"
    assert Scenario.model_validate(split).airframe is split.airframe
    assert (
        split.with_({"faults": [{"type": "float", "actuator": "flap_left", "at_s": 1}]}).airframe
        is split.airframe
    )
    assert load({"name": "x"}).airframe.name == "beaver"
