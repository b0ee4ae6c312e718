"""A compiled law is its own file and a row of plugins.yaml: the package with one more law, in a copy.

The law is not like those there: a sliding mode, with a boundary layer and an integral of its own.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc
from beaver_ftc.documents.files import data_root

SOURCE = Path(beaver_ftc.__path__[0])
FILE, ROWS = "control/laws/sliding.py", "plugins.yaml"

# u = G^-1 (xm' - f + c e + K sat(s)),  s = (e + c int e) / layer
SLIDING = '''
"""A sliding mode with a boundary layer [Slotine1991, ch. 7]."""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.control import CompiledLaw, allocation, laws

CONFIG = record(slope=float, reach=float, layer=float)
MEMORY = record(integral=3, frames=int)
OUTPUT = record(surface=3)


@sized
def sliding_dtype(n):
    return record(config=CONFIG, memory=MEMORY, output=OUTPUT, travelled=n)


def configure(law, control, prediction, scenario, y):
    law["config"] = scenario.control.proportional_per_s, 0.1, 0.05


@apart
def command(control, assessment, faults, prediction, measured, mode, t):
    laws.prepare(control, assessment, prediction, mode, t)
    slide(control.sliding, control.axes, control.reference, measured.x, prediction.f)
    laws.command_surfaces(control, assessment, faults, prediction, False)
    laws.complete(control, assessment, measured, t)


@kernel
def slide(law, axes, reference, x, f):
    config, memory, out = law.config, law.memory, law.output
    memory.frames += 1
    for i in range(3):
        error = reference.output.governed_rate[i] - x[i]
        memory.integral[i] += reference.config.dt * error
        out.surface[i] = error + config.slope * memory.integral[i]
        switched = min(max(out.surface[i] / config.layer, -1.0), 1.0)
        wanted = reference.output.governed_acceleration[i] + config.slope * error
        allocation.set_demand(axes, i, wanted + config.reach * switched - f[i], -f[i], 0.0)


def unexplained(control):
    config, surface = control["sliding"]["config"], control["sliding"]["output"]["surface"]
    return -config["reach"] * np.clip(surface / config["layer"], -1.0, 1.0)


LAW = CompiledLaw(sliding_dtype, command, configure=configure, unexplained=unexplained)
'''
ROW = """  sliding-mode:
    says: Inversion with a sliding mode of the rates [Slotine1991].
    kernels: beaver_ftc.control.laws.sliding
    uses_verdict: true
"""
FLY = """
import json, sys
import numpy as np
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load

def flown(law, **more):
    loss = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 1.0}
    keys = {"duration_s": 3.0, "rate_hz": 50, "faults": [loss], "control": {"law": law}, **more}
    pitch = {"q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.5}}]}
    loop = Loop(load({"name": "x", "reference": pitch, **keys}))
    rows = np.concatenate([chunk.copy() for chunk in loop.chunks()])
    log = dict(zip(loop.columns, rows.T))
    error = log["q_model_rad_s"] - log["q_measured_rad_s"]
    own = loop.frames[0]["control"]["sliding"]
    return {
        "missed": float(np.abs(error[100:]).max()), "frames": int(own["memory"]["frames"]),
        "surface": own["output"]["surface"].tolist(), "integral": own["memory"]["integral"].tolist(),
        "last": float(error[-1]), "used": log["elevator_effectiveness_used"][-1],
    }

then = [{"at_s": 1.5, "law": "fault-tolerant"}]
print(json.dumps({
    "sliding": flown("sliding-mode"), "left": flown("sliding-mode", changes=then),
    "begun": flown("nominal", changes=[{"at_s": 1.0, "law": "sliding-mode"}]),
}))
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package with the law; returns its folder."""
    root = tmp_path_factory.mktemp("copy") / "beaver_ftc"
    shutil.copytree(SOURCE, root)
    for folder in ("aircraft", "scenarios"):
        if not (root / "data" / folder).exists():
            shutil.copytree(data_root() / folder, root / "data" / folder)
    (root / FILE).write_text(SLIDING)
    rows = (root / ROWS).read_text()
    (root / ROWS).write_text(rows.replace("  indi:\n", ROW + "  indi:\n"))
    return root


def touched(one, other):
    """Files of the second folder that the first has otherwise, or not at all."""
    files = [path.relative_to(other) for path in other.rglob("*") if path.is_file()]
    return {
        file.as_posix()
        for file in files
        if not {"__pycache__", "data"} & set(file.parts)
        and not ((one / file).is_file() and (one / file).read_bytes() == (other / file).read_bytes())
    }


def test_a_compiled_law_is_its_own_file_and_a_row(copy):
    assert touched(SOURCE, copy) == {FILE, ROWS}


@pytest.fixture(scope="module")
def found(copy):
    """What its flights have shown, uncompiled."""
    env = {**os.environ, "PYTHONPATH": str(copy.parent), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", FLY], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_it_flies_by_its_own_equation_and_memory(found):
    """s = e + c int e at the last frame, within the layer; after the loss the reference is followed again."""
    flight = found["sliding"]
    assert flight["frames"] == 150
    assert flight["surface"][1] == pytest.approx(flight["last"] + 2.0 * flight["integral"][1], abs=1e-12)
    assert flight["missed"] < 0.1 * np.radians(3.0)


def test_it_takes_over_in_flight_and_is_taken_over(found):
    assert found["begun"]["frames"] == 100
    assert found["left"]["frames"] == 0  # its records begin anew with the other law's
    assert max(found[which]["missed"] for which in ("begun", "left")) < 0.2 * np.radians(3.0)


def test_it_uses_the_verdict_as_its_row_says(found):
    assert found["sliding"]["used"] == pytest.approx(0.6, abs=0.05)
