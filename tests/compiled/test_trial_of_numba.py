"""A version of Numba that is not known is tried: kernels come to what their plain form does."""

import os
import subprocess
import sys

import pytest

from beaver_ftc.compiled import library


def outcome(before=""):
    command = [sys.executable, "-c", before + library.CODE]
    environment = {**os.environ, library.VARIABLE: "trial"}
    return subprocess.run(command, env=environment, capture_output=True, check=False).returncode


def test_this_version_passes():
    assert outcome() == 0


NOTHING_LINKED = "from beaver_ftc.compiled import library; library._all_called = lambda library: []\n"
RENAMED = "from numba.core.codegen import CPUCodeLibrary as L; del L._optimize_final_module\n"


@pytest.mark.parametrize("change", [NOTHING_LINKED, RENAMED])
def test_one_whose_inside_is_another_does_not(change):
    assert hasattr(library, "_all_called")
    assert outcome(change) != 0
