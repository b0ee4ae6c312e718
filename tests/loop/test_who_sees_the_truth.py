"""No kernel of the diagnosis or of a law is ever given the truth: neither its record nor a part of it.

Shown by type and by address: flights in the plain form, in which every kernel call can be watched.
"""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc
from beaver_ftc.control.state import control_dtype
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.diagnosis.schemes import fdi_dtype
from beaver_ftc.loop.frame import true_faults_dtype
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.plant.sensing import truth_dtype
from beaver_ftc.scenario.schema import load

PROGRAM = """
import json, sys
import numpy as np
from beaver_ftc import compiled

calls, inside = {}, [0, 0]  # kernel -> what it was given; where the truth's record is in memory
plain = compiled.kernel

def address_of(given):
    # Not by the array interface, which would describe all fields of a record.
    return (given if isinstance(given, np.ndarray) else np.frombuffer(given, np.uint8)).ctypes.data

def watched(function, for_size=False):
    call, name = plain(function), f"{function.__module__}.{function.__name__}"
    def spy(*arguments):
        for argument in arguments:
            if isinstance(argument, (np.ndarray, np.void)):
                address = address_of(argument)
                whose = "truth" if inside[0] <= address < inside[1] else "other"
                kind = "record" if argument.dtype.names == RECORD else "plain"
                given = calls.setdefault(name, [])
                given += [[whose, kind]] * ([whose, kind] not in given)
        return call(*arguments)
    spy.py_func = function
    return spy

compiled.kernel = watched
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant.sensing import truth_dtype
from beaver_ftc.scenario.schema import Scenario

RECORD = truth_dtype(4).names
for words in json.loads(sys.argv[1]):
    loop = Loop(Scenario.model_validate(words))
    truth = loop.frames["truth"]
    start = truth.__array_interface__["data"][0]
    inside[:] = [start, start + truth.dtype.itemsize]
    for _ in loop.chunks():
        pass
print(json.dumps(calls))
"""
STUCK = [{"actuator": "elevator", "type": "stuck", "at_s": 0.3}]
LOSS = [{"actuator": "aileron", "type": "loss_of_effectiveness", "magnitude": 0.8, "at_s": 0.3}]
COMMON = {"name": "watched", "duration_s": 0.5, "rate_hz": 20}
GYRO = [{"sensor": "q", "type": "bias", "magnitude": 2, "at_s": 0.3}]
WEIGHED = {"fault_class": "all", "statistical": {}, "bounds": {"turbulence": "light"}}
FLIGHTS = [
    {"faults": GYRO, "sensors": {"V": {"bias_mps": 1.0}}},
    {"faults": STUCK, "fdi": {"fault_class": "all", "pairs": True}},
    {"faults": STUCK, "control": {"law": "oracle"}},
    {"faults": LOSS, "fdi": {"statistical": {}, "bounds": {"turbulence": "light"}}},
    {"faults": STUCK, "sensors": {"az": {"bias_mps2": 0.1}}, "fdi": WEIGHED},
    {"faults": [{"sensor": "az", "type": "scale", "magnitude": 0.3, "at_s": 0.3}], "fdi": WEIGHED},
]


@pytest.fixture(scope="module")
def calls():
    """Kernel -> [whose memory, which kind of record] of each array and record it was given."""
    flights = json.dumps([COMMON | flight for flight in FLIGHTS])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, flights],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def of(calls, folder):
    return {name: given for name, given in calls.items() if name.startswith(f"beaver_ftc.{folder}.")}


@pytest.mark.parametrize("folder", ["diagnosis", "control", "design"])
def test_no_kernel_is_given_the_truth(calls, folder):
    assert len(of(calls, folder)) > 5
    for name, given in of(calls, folder).items():
        for whose, kind in given:
            assert (whose, kind) == ("other", "plain"), name


def test_what_is_meant_to_see_the_truth_does(calls):
    """The watch would notice: sensing, accounts and the log are given the record."""
    for name in ("plant.sensing.measure", "loop.accounts.track", "loop.log_row.record_truth"):
        assert ["truth", "record"] in calls[f"beaver_ftc.{name}"]


def test_the_truth_has_a_type_of_its_own():
    others = prediction_dtype(4), fdi_dtype(4), control_dtype(4), true_faults_dtype(4), MEASURED
    assert truth_dtype(4) not in others


def test_forces_are_those_of_the_accelerometers(calls):
    """What is weighed has the errors of the instruments, as what is compared with the model has."""
    assert of(calls, "diagnosis")["beaver_ftc.diagnosis.detection.forces.update_forces"] == [
        ["other", "plain"]
    ]
    errors = {"ax": {"bias_mps2": 0.3}, "ay": {"scale_error": -0.5}, "az": {"quantum_mps2": 2.0}}
    given = {"name": "x", "duration_s": 0.5, "reference": {}, "fdi": WEIGHED}
    true, read = (Loop(load(given | {"sensors": sensors})) for sensors in ("ideal", errors))
    for loop in (true, read):
        loop.fly_frames(1, 0)
    force, seen = (loop.frames["measured"]["force"][0].copy() for loop in (true, read))
    assert force[2] < -5.0
    assert seen == pytest.approx([force[0] + 0.3, 0.5 * force[1], 2.0 * np.round(force[2] / 2.0)])
    for loop in (true, read):
        loop.release()


@pytest.mark.parametrize("folder", ["diagnosis", "control"])
def test_no_module_knows_where_the_truth_keeps_what(folder):
    root = Path(beaver_ftc.__path__[0]) / folder
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert node.module not in ("beaver_ftc.plant.sensing", "beaver_ftc.plant.channels"), path
