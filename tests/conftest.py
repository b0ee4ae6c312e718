"""What all tests share: the helpers of tests/flying.py, and property tests that repeat themselves."""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))

import kept

# No deadline: a first call compiles. Derandomised: a red build can be repeated.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


def pytest_addoption(parser):
    parser.addoption("--keep", action="store_true", help="write anew what differs from tests/kept/")


@pytest.fixture
def changed(request):
    """changed(document): how it differs from what an earlier revision made, kept below tests/kept/; see
    tests/kept.py. part: of several of a test.
    """
    file = Path(request.node.path).relative_to(Path(__file__).parent).with_suffix("")

    def differences(document, part=""):
        name = request.node.name.replace("/", "-") + (f"-{part}" if part else "")
        return kept.differences(f"{file}/{name}", document, request.config.getoption("--keep"))

    return differences


def pytest_sessionstart(session):
    """Compile what flights use before the first test: what is said meanwhile is a test by itself."""
    from beaver_ftc.compiled import cache_folder

    folder = cache_folder()
    worker, plain = hasattr(session.config, "workerinput"), os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"
    if worker or plain or folder is None or (folder / "warm").exists():
        return
    from beaver_ftc.control.rivals.indi import IncrementalInversion
    from beaver_ftc.diagnosis.rivals.rls import RlsMonitor
    from beaver_ftc.loop.loop import fly
    from flying import scenario

    for plugged in ({}, {"detector": RlsMonitor()}, {"law": IncrementalInversion()}):
        fly(scenario(duration_s=0.2, substeps=2, fdi={"statistical": {}}), **plugged)
    (folder / "warm").touch()
