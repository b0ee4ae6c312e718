"""An aircraft's own file against its JSBSim model: said where they differ, kept until a file changes."""

import shutil

import pytest

from beaver_ftc.aircraft.aircraft import read
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc_aircraft.derive import first_use
from trainer import TRAINER, change


@pytest.fixture
def trainer(tmp_path, monkeypatch):
    """A copy of the trainer to change, and a cache of its own."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    shutil.copytree(TRAINER, tmp_path / "trainer")
    return tmp_path / "trainer"


def test_a_file_that_says_what_the_model_does_is_said_nothing_of(trainer):
    assert first_use.kept_or_compared(read(trainer)) == []


def test_a_wrong_term_is_said_with_its_axis_and_size(trainer):
    """Roll damping 30 % too large: at p = 0.6 rad/s roll is off by what it says; Jxz hands yaw a share."""
    change(trainer / "aircraft.yaml", "name: Cl_p, value: -0.47", "name: Cl_p, value: -0.61")
    line, yaw = first_use.kept_or_compared(read(trainer))
    assert yaw.startswith("r: ")
    assert line.startswith("p: the terms are ")
    off, density, V = float(line.split()[4]), 1.12, float(line.split(" m/s")[0].split()[-1])
    expected = 0.14 * 0.5 * density * V * 15.1 * 10.4**2 / 2.0 * 0.6 / 1310.0
    assert off == pytest.approx(expected, rel=0.2)
    assert "0.02" in line


def test_another_inertia_of_the_model_is_said(trainer):
    """Pitch inertia half as large again in the model alone: pitch is off, and the others by its coupling."""
    model = trainer / "trainer.xml"
    iyy = next(part for part in model.read_text().split("<iyy")[1].split("<")[0].split(">")[1:])
    change(model, iyy, f" {1.5 * float(iyy)} ")
    assert "q" in [line[0] for line in first_use.kept_or_compared(read(trainer))]


def test_what_cannot_be_trimmed_is_said_not_to_be_compared(trainer):
    change(trainer / "aircraft.yaml", "airspeed_mps: [35, 65]", "airspeed_mps: [5, 8]")
    (line,) = first_use.kept_or_compared(read(trainer))
    assert line.startswith("it is not compared with trainer.xml: ")


def test_a_scenario_that_names_the_folder_hears_of_it_once(trainer, capsys):
    change(trainer / "aircraft.yaml", "name: Cm_alpha, value: -0.72", "name: Cm_alpha, value: -0.5")
    for _ in range(2):
        find_aircraft("./trainer", trainer.parent)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("beaver-ftc: trainer/aircraft.yaml: warning: q: the terms are ")


def test_a_rudder_that_rolls_more_than_it_yaws_leads_the_yaw_axis_all_the_same(trainer):
    """Nobody else does: without a leader of yaw there is no trim, as an F-16 and an XB-70 had none."""
    change(trainer / "aircraft.yaml", "name: Cl_rudder, value: 0.012", "name: Cl_rudder, value: 0.12")
    aircraft = read(trainer)
    assert aircraft.dominant_axis == (0, 1, 2)
    assert aircraft.primary == ("aileron", "elevator", "rudder")
