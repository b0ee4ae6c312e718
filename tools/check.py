"""`python -m tools.check`: within a minute, the tests nearest to the modules that you have changed.

Test files that you have changed run first, then those of the folders that mirror the modules'. What a minute
leaves no time for is skipped, and counted.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tools.mutants.scope import BY_DAY, COMPILED, PLAIN, ROOT, SOURCES, TESTS, nearest, plain

BUDGET_S = 50.0
OPTIONS = ("-q", "-n", "2", "--dist", "loadfile", "-p", "tools.check", "-m", BY_DAY)
_BEGAN = "BEAVER_FTC_CHECK_BEGAN"  # when the whole check began, s since the epoch


def pytest_runtest_setup() -> None:
    """In the child, as a plug-in of pytest: skip what there is no time for."""
    if time.time() - float(os.environ[_BEGAN]) > BUDGET_S:
        pytest.skip("a minute is over")


def changed() -> list[Path]:
    """The modules and test files that differ from the last commit, new ones too."""
    listed = ["git", "status", "--porcelain", "--no-renames", "--untracked-files=all", "--", "src", "tests"]
    said = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found = [ROOT / line[3:].strip('"') for line in said.splitlines()]
    return [file for file in found if file.suffix == ".py" and file.exists()]


def main() -> int:
    """Run them, plain kernels and compiled ones apart; exit status 1 if one fails."""
    files = changed()
    tests = {file for file in files if file.is_relative_to(TESTS) and file.name.startswith("test_")}
    near = {test for file in files if file.is_relative_to(SOURCES) for test in nearest(file)}
    environment, failed = os.environ | {_BEGAN: str(time.time())}, False
    for some in (tests, near - tests):
        for mode, of_mode in ((PLAIN, some & plain()), (COMPILED, some - plain())):
            if of_mode:
                print(f"{mode}: {len(of_mode)} files", flush=True)
                command = [sys.executable, "-m", "pytest", *OPTIONS, *sorted(map(str, of_mode))]
                environment["NUMBA_DISABLE_JIT"] = str(int(mode == PLAIN))
                done = subprocess.run(command, cwd=ROOT, env=environment, check=False)
                failed |= done.returncode not in (0, 5)  # 5: all are left out by their marks
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
