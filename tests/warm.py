"""Compiles what most flights use: `python tests/warm.py`, from the checkout's root.

conftest.py starts it before the first test. Kernels on plain arrays are tried meanwhile; what is compiled by
then is found by the tests that fly.
"""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from beaver_ftc.compiled import cache_folder
from beaver_ftc.documents.paths import PACKAGE
from beaver_ftc.documents.sources import digest_of_files


def mark():
    """The file that says that it was done for the package's sources as they are; None without a cache."""
    folder = cache_folder()
    return folder and folder / f"warm-{digest_of_files(*sorted(PACKAGE.rglob('*.py')))}"


def main():
    from beaver_ftc.control.rivals.indi import IncrementalInversion
    from beaver_ftc.diagnosis.rivals.rls import RlsMonitor
    from beaver_ftc.loop.loop import fly
    from flying import scenario

    for plugged in ({}, {"detector": RlsMonitor()}, {"law": IncrementalInversion()}):
        fly(scenario(duration_s=0.2, substeps=2, fdi={"statistical": {}}), **plugged)
    mark().touch()


def plain():
    """Whether this process compiles nothing."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") != "0"


if __name__ == "__main__":
    main()
