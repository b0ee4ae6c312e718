"""JSBSim's turboprop reads memory before it has written it: a flight must not depend on what was there."""

import os
import subprocess
import sys

import pytest

# What memory holds when it is taken, glibc fills in: bytes of 0x7f are numbers of 1e306.
FLOWN = """
import sys
from math import isfinite
from pathlib import Path
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.trim import trim
from beaver_ftc_aircraft.derive import outline

travel = {name: (-0.3, 0.3) for name in ("aileron", "elevator", "rudder")}
model = instrumented.instrument(instrumented.source_of("fokker50"), Path(sys.argv[1]), travel)
data = outline.outline("fokker50", model, travel, 0.45)
data["engine"]["start"] = "off"
plant = outline.plant_of(data, model.parent)
assert isfinite(trim(95.0, 1500.0, plant=plant, throttle=0.6).alpha_rad)
"""


@pytest.mark.parametrize("fill", ["1", "128"])
def test_a_turboprop_starts_whatever_memory_held(tmp_path, fill):
    run = subprocess.run(
        [sys.executable, "-c", FLOWN, str(tmp_path / "copy")],
        env=os.environ | {"MALLOC_PERTURB_": fill, "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-500:]
