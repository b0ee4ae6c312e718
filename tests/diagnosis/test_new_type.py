"""A new fault type is one file: a copy of the package with it, and nothing else."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import beaver_ftc
from beaver_ftc.diagnosis.types import contract, registry
from beaver_ftc.documents.paths import data_root

HERE = Path(__file__).parent

# A surface that follows its command with the sign reversed: p = -u.
REVERSED = '''
"""A surface rigged the wrong way round: p = -u."""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types.contract import FaultType


@kernel
def judge(config, surface, kind, k):
    """Whether the mirrored command explains this frame."""
    if not surface.low_then <= -surface.command_then <= surface.high_then:
        surface.type_excluded[kind] = 1


@kernel
def deflection(config, surface, kind, k):
    """The mirrored command."""
    return -surface.command, -surface.command


def estimate(fdi, s, kind):
    """It has none but itself."""
    return -1.0


TYPES = (FaultType(name="reversed", constant=True, judge=judge, deflection=deflection, estimate=estimate),)
'''
FLIGHT = """
import sys
sys.path.insert(0, {folder!r})
from design_plant import UNCERTAINTIES, DesignPlant
from beaver_ftc.diagnosis.types.findings import found
reverse = lambda k, u: -u if k >= 20 else u
plant = DesignPlant(4, 50.0, surface=2, position=reverse, fault_class="all")
plant.fly(220, UNCERTAINTIES["random"], until=lambda plant: found(plant.fdi)["isolation_type"])
said = found(plant.fdi)
print(said["isolated"], said["isolation_type"], said["estimate"])
"""


def test_a_new_type_is_found_and_named(tmp_path):
    package = tmp_path / "beaver_ftc"
    shutil.copytree(beaver_ftc.__path__[0], package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(data_root() / "aircraft", package / "data" / "aircraft")
    shutil.copytree(data_root() / "scenarios", package / "data" / "scenarios")
    (package / "diagnosis" / "types" / "table" / "backwards.py").write_text(REVERSED)
    done = subprocess.run(
        [sys.executable, "-c", FLIGHT.format(folder=str(HERE))],
        env={**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["rudder", "reversed", "-1.0"]


def test_every_type_keeps_the_contract():
    for row in registry.TYPES:
        assert callable(row.judge)
        assert row.deflection is not contract.anywhere or not row.constant
        assert bool(row.memory) == bool(row.record)


def test_types_of_a_constant_parameter_come_first():
    constant = [row.constant for row in registry.TYPES]
    assert constant == sorted(constant, reverse=True)
    assert sum(constant) == registry.N_CONSTANT
