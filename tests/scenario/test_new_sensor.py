"""Sensors that are unlike those there are added to a copy of the package: by their rows, and presets.

A radio altimeter measures in feet, five times a second. A vertical speed indicator has an equation of its
own. Nothing else of the copy is touched: scenarios, schema, log and the sensor monitor follow from the rows.
"""

import filecmp
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beaver_ftc
from beaver_ftc.documents.files import data_root

ERRORS = '''@_reads("ft", "ft", 1000, 0.3048)
class RadioAltimeter(_Sensor):
    """Height above the ground."""


@_reads("mps", "m/s", 50)
class VerticalSpeed(_Sensor):
    """Rate of climb."""


class Equal(NamedTuple):'''
ROW = """    Row(
        "radio_altitude", RadioAltimeter, 500.0, truth=("position/h-agl-ft", 0.3048),
        column="radio_altitude_measured_m", rate_hz=5.0, equal=Equal("altitude", 0.5),
    ),
    Row(
        "vertical_speed", VerticalSpeed, 100.0, "vertical speed", truth=("velocities/h-dot-fps", 0.3048),
        column="vertical_speed_measured_mps",
    ),
)
"""
# An error of another sensor contradicts the altitude, or the flow, but not both.
EQUATION = '''from beaver_ftc.diagnosis.monitors.numbering import CLIMB_TEST
from beaver_ftc.diagnosis.monitors.residual_bounds import set_bound

VERTICAL_TEST = N_EQUATIONS - 1
VERTICAL = SENSOR_OF[VERTICAL_TEST]


@kernel
def judge_vertical_speed(mon, y):
    """Judge h times the vertical speed by the change of the altitude, filtered, and by that of the flow."""
    j, tests, past, h = VERTICAL_TEST, mon.tests, mon.sample.y_past, mon.config.h
    climbed = h * past[VERTICAL]
    tests.residual[j] = y[ALTITUDE] - past[ALTITUDE] - climbed
    set_bound(tests, j, tests.per_s[CLIMB_TEST] + mon.errors.e_past[VERTICAL], tests.per_sample[CLIMB_TEST])
    filter_test(mon, j)
    by_flow = abs(mon.sample.y_pred[ALTITUDE] - past[ALTITUDE] - climbed) / (h * tests.per_s[j])
    tests.ratio[j] = min(tests.ratio[j], by_flow)


@kernel
def start_tests('''
CALL = "    judge_vertical_speed(mon, y)\n    if mon.config.has_engine:\n"
PRESET = "consumer-grade:\n  radio_altitude: {noise_std_ft: 0.5, bias_ft: 1.0, quantum_ft: 0.1}\n"
FLIGHT = """
import json, sys
import beaver_ftc as bf
from beaver_ftc.scenario.schema import json_schema
sensors = {"altitude": {"noise_std_m": 0.2}, "radio_altitude": {"noise_std_ft": 0.3, "bias_ft": 1.0}}
said = {
    "name": "radio", "duration_s": 4, "rate_hz": 20, "seed": 3, "sensors": sensors,
    "reference": {"q": [{"step": {"amplitude_deg_s": 6, "start_s": 0.5}}]},
    "fdi": {"bounds": {"sensors": sensors}, "sensor_monitor": "always"},
}
told = {}
for name, more in json.loads(sys.argv[1]).items():
    flight = bf.fly(said | more)
    columns = ("t_s", "altitude_m", "radio_altitude_measured_m")
    told[name] = {column: flight.log[column].tolist() for column in columns}
    told[name] |= {what: flight.metrics[what] for what in ("isolation", "detection")}
known = bf.load({"name": "x", "sensors": "consumer-grade"}).sensors.radio_altitude
told["preset"] = known.noise_std_ft, known.noise_bias_quantum
told["schema"] = "noise_std_ft" in json.dumps(json_schema())
fault = {"sensor": "radio_altitude", "type": "bias", "magnitude": 501, "at_s": 1}
try: bf.load({"name": "x", "faults": [fault]})
except bf.BadInput as error: told["refused"] = str(error)
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package with the sensor in it."""
    root = tmp_path_factory.mktemp("copied")
    package = root / "beaver_ftc"
    shutil.copytree(beaver_ftc.__path__[0], package)
    for folder in ("aircraft", "scenarios"):
        shutil.copytree(data_root() / folder, package / "data" / folder, dirs_exist_ok=True)
    rows = package / "scenario" / "sensors.py"
    text = rows.read_text().replace("class Equal(NamedTuple):", ERRORS)
    rows.write_text(text.replace(")\n# The first rows:", ROW + "# The first rows:"))
    equations = package / "diagnosis" / "monitors" / "redundancy.py"
    text = equations.read_text().replace("@kernel\ndef start_tests(", EQUATION)
    equations.write_text(text.replace("    if mon.config.has_engine:\n", CALL))
    presets = rows.with_name("presets.yaml")
    presets.write_text(presets.read_text().replace("consumer-grade:\n", PRESET))
    return root


def fault(kind, sensor="radio_altitude", **more):
    return {"faults": [{"sensor": sensor, "type": kind, "at_s": 2.0, **more}]}


BROKEN = {  # what happens, who is named, and how soon the alarm comes, s
    "bias": (fault("bias", magnitude=60.0), "radio_altitude", 0.2),
    "freeze": (fault("freeze"), "radio_altitude", 2.0),
    "altimeter": (fault("bias", sensor="altitude", magnitude=-18.0), "altitude", 0.2),
    "vertical speed": (fault("bias", sensor="vertical_speed", magnitude=9.0), "vertical_speed", 1.0),
}


@pytest.fixture(scope="module")
def flown(copied):
    """By name what became of the flight of each fault, and of one without; what scenarios know of it."""
    asked = {"healthy": {}} | {name: more for name, (more, _, _) in BROKEN.items()}
    done = subprocess.run(
        [sys.executable, "-c", FLIGHT, json.dumps(asked)], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(copied), "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_three_files_are_touched(copied):
    ours, package = Path(beaver_ftc.__path__[0]), copied / "beaver_ftc"
    touched = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*")
        if path.is_file() and "data" not in path.parts and "__pycache__" not in path.parts
        and not filecmp.cmp(path, ours / path.relative_to(package), shallow=False)
    ]  # fmt: skip
    assert sorted(touched) == [
        "diagnosis/monitors/redundancy.py", "scenario/presets.yaml", "scenario/sensors.py",
    ]  # fmt: skip


def test_it_is_read_at_its_own_rate_and_logged_in_metres(flown):
    found = flown["healthy"]
    assert found["detection"]["time_s"] is None
    readings, truth = found["radio_altitude_measured_m"], found["altitude_m"]
    changes = [k for k in range(1, len(readings)) if readings[k] != readings[k - 1]]
    assert changes == list(range(4, len(readings), 4))  # of 20 frames a second
    for k in (0, *changes):
        assert abs(readings[k] - truth[k] - 0.3048) <= 4 * 0.3 * 0.3048
    stale = [abs(readings[k] - truth[k] - 0.3048) for k in range(len(readings) - 4, len(readings))]
    assert max(stale) > 0.3  # the aircraft has climbed since the last sample


@pytest.mark.parametrize("name", BROKEN)
def test_the_monitor_names_the_one_that_is_broken(flown, name):
    _, broken, soon_s = BROKEN[name]
    found = flown[name]
    assert found["isolation"]["fault"] == f"sensor {broken}"
    assert 2.0 <= found["detection"]["time_s"] <= 2.0 + soon_s


def test_scenarios_and_schema_know_it(flown):
    assert flown["schema"]
    assert flown["preset"] == [0.5, [0.5 * 0.3048, 0.3048, 0.1 * 0.3048]]
    assert flown["refused"].endswith("501 is out of range, allowed: at most 500 ft for radio_altitude")
