"""What is borrowed from inside Numba is there, is called as it was, and is not needed.

A version that fails here is not `target.KNOWN`: with it Numba makes the machine code by its own means.
"""

import os
import subprocess
import sys

import numba
import pytest

from beaver_ftc import compiled


@pytest.mark.parametrize("version", ["0.67.2", "0.680.0", "1.0.0"])
def test_of_another_version_nothing_is_borrowed(monkeypatch, version):
    monkeypatch.setattr(numba, "__version__", version)
    assert compiled._own_target.__wrapped__() is None


KERNELS = """
import sys
from pathlib import Path
import numpy as np
from beaver_ftc import compiled
from beaver_ftc.compiled import target

compiled.cache_folder = lambda: Path(__file__).parent / "cache"

@compiled.apart
def halve(record):
    record.value *= 0.5

@compiled.kernel
def step(records, log):
    halve(records[0])
    for i in range(2):
        log[1, i] = records[0].value[i] / 0.0
    return records[0].value.sum() / records.size

if __name__ == "__main__":
    records = np.zeros(1, [("before", "f8", (int(sys.argv[1]),)), ("value", "f8", (2,))])
    records["value"] = 3.0, -5.0
    log = np.zeros((2, 2))
    call = compiled.direct(step, records, log)
    print(call(records, log), *log[1], type(step).__name__, sum(step.stats.cache_hits.values()))
"""


def run(command, compiler=""):
    environment = {**os.environ, compiled.VARIABLE: compiler}
    done = subprocess.run(
        [sys.executable, *command], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.split(), done.stderr


def test_kernels_come_to_the_same_either_way_and_are_kept(tmp_path):
    """Records of two shapes: the process that loads both must not take the code of one for the other's."""
    kernels = tmp_path / "few_kernels.py"
    kernels.write_text(KERNELS)
    assert run([kernels, "1"])[0] == ["-1.0", "inf", "-inf", "Kernel", "0"]
    assert run([kernels, "4"])[0][:3] == ["-1.0", "inf", "-inf"]
    again, said = run([kernels, "1"])
    assert again[:3] == ["-1.0", "inf", "-inf"]
    assert said == ""
    assert {path.name.partition("-")[0] for path in (tmp_path / "cache").glob("*-*")} == {"step", "halve"}
    by_numba, said = run([kernels, "1"], "numba")
    assert by_numba[:4] == ["-1.0", "inf", "-inf", "CPUDispatcher"]
    assert "compiles by its own means" in said


WITHOUT_A_PART = """
import numba.core.imputils as inside
del inside.lower_getattr_generic
import beaver_ftc.loop.loop
from beaver_ftc import compiled
print(compiled.borrows())
"""


def test_a_known_version_without_a_part_that_is_borrowed_compiles_by_its_own_means():
    borrows, said = run(["-c", WITHOUT_A_PART])
    assert borrows == ["False"]
    assert "compiles by its own means" in said


FLIGHT = """
from beaver_ftc import fly, load
log = fly(load({"name": "short", "duration_s": 0.5, "faults": [
    {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 0.2}]})).log
print(*(f"{name}={log[name].to_numpy().tobytes().hex()}" for name in log))
"""


def test_a_flight_without_what_is_borrowed_is_the_same():
    flights = [run(["-c", FLIGHT], compiler)[0] for compiler in ("", "numba")]
    assert len(flights[0]) > 100
    assert flights[0] == flights[1]
