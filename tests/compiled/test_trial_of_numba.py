"""A version of Numba that is not known is tried: kernels come to what their plain form does."""

import os
import subprocess
import sys

import pytest

from beaver_ftc.compiled import target


def outcome(before=""):
    command = [sys.executable, "-c", before + target.CODE]
    environment = {**os.environ, target.VARIABLE: "trial"}
    return subprocess.run(command, env=environment, capture_output=True, check=False).returncode


def test_this_version_passes():
    assert outcome() == 0


NOTHING_LINKED = "from beaver_ftc.compiled import target; target._all_called = lambda library: []\n"
RENAMED = "from numba.core.codegen import CPUCodeLibrary as L; del L._optimize_final_module\n"


@pytest.mark.parametrize("change", [NOTHING_LINKED, RENAMED])
def test_one_whose_inside_is_another_does_not(change):
    assert hasattr(target, "_all_called")
    assert outcome(change) != 0


WITHOUT_A_PART = """
import numba.core.imputils as inside
del inside.lower_getattr_generic
import beaver_ftc.loop.loop
from beaver_ftc import compiled
raise SystemExit(compiled.borrows())
"""


def test_one_without_a_part_that_is_borrowed_compiles_by_its_own_means():
    done = subprocess.run([sys.executable, "-c", WITHOUT_A_PART], capture_output=True, text=True, check=True)
    assert "has other parts than are known" in done.stderr
