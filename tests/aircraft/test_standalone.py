"""The aircraft in JSBSim's own stand-alone runner, with the repository as root."""

import re
import subprocess
import sys
from math import cos, radians, sin
from pathlib import Path
from xml.etree import ElementTree

import pytest

from beaver_ftc.documents.files import data_root

RUNNER = Path(sys.executable).with_name("jsbsim")
SCRIPT = "aircraft/beaver/scripts/elevator-doublet.xml"


def values(output, event):
    """The properties a script's event reported, by name."""
    block = re.search(rf"{event} \(Event \d+\) executed at time[^\n]*\n((?: .*\n)+)", output)[1]
    return {name: float(value) for name, value in re.findall(r"(\S+) = (\S+)", block)}


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    folder = tmp_path_factory.mktemp("standalone")
    run = subprocess.run(
        [RUNNER, f"--root={data_root()}", f"--script={SCRIPT}", "--nohighlight"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert list(folder.iterdir()) == [], "a run of the script writes no file"
    return run.stdout


def test_the_normalised_command_adds_and_moves_the_aircraft(output):
    up = values(output, "second half of the doublet")
    assert up["fcs/elevator-pos-rad"] == pytest.approx(-0.0414248 - 0.05 * 0.49, abs=1e-7)
    assert up["velocities/q-rad_sec"] > 0.02
    assert values(output, "end of the doublet")["velocities/q-rad_sec"] < -0.02


def test_a_failure_property_set_by_the_script_acts(output):
    lost = values(output, "half a second later")
    assert lost["fcs/elevator-effective-rad"] == pytest.approx(0.6 * -0.0414248, abs=1e-7)
    assert lost["velocities/q-rad_sec"] < -0.01


def test_the_initial_file_is_the_trim_point(trim_point):
    root = ElementTree.parse(data_root() / "aircraft" / "beaver" / "reset00.xml").getroot()
    given = {child.tag: float(child.text) for child in root}
    feet = trim_point.airspeed_mps / 0.3048
    a, b = trim_point.alpha_rad, trim_point.beta_rad
    assert given["ubody"] == pytest.approx(feet * cos(a) * cos(b), abs=1e-5)
    assert given["vbody"] == pytest.approx(feet * sin(b), abs=1e-5)
    assert given["wbody"] == pytest.approx(feet * sin(a) * cos(b), abs=1e-5)
    assert radians(given["theta"]) == pytest.approx(trim_point.theta_rad, abs=1e-8)
    assert given["altitudeMSL"] == trim_point.altitude_m
