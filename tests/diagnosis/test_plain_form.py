"""Compiled kernels and their plain Python form give the same numbers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PROGRAM = """
import json, sys
sys.path.insert(0, {folder!r})
from design_plant import UNCERTAINTIES, DesignPlant
numbers = []
for seed, surface, profile in ((1, 0, "any"), (2, 1, "abrupt"), (3, 2, "any")):
    plant = DesignPlant(seed, 50.0, surface=surface, theta=lambda k: -0.6 if k > 20 else 0.0,
                        fault_profile=profile, pole_bank_per_s=[3.0, 1e6])
    plant.fly(90, UNCERTAINTIES["random"])
    fdi = plant.fdi
    verdict = fdi["verdict"]
    numbers += [float(verdict["detected_at_s"]), float(verdict["isolated_at_s"])]
    numbers += map(float, fdi["fdae"]["output"]["residual"])
    of_bank = fdi["bank"]["output"]
    numbers += [*map(float, of_bank["residual"].ravel()), *map(float, of_bank["threshold"].ravel())]
    for fie in fdi["isolation"]["estimator"][:3]:
        for name in ("residual", "lower", "upper", "theta", "reach_low", "theta_low", "theta_high"):
            numbers += map(float, fie[name].ravel())
print(json.dumps(numbers))
"""


def _numbers(**environment):
    program = PROGRAM.format(folder=str(HERE))
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def test_plain_and_compiled_agree_to_rounding():
    compiled, plain = _numbers(), _numbers(NUMBA_DISABLE_JIT="1")
    assert len(compiled) > 300
    assert plain == pytest.approx(compiled, rel=1e-12, abs=1e-12)
