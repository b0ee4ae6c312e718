"""What the suite costs, of a run of one test."""

import subprocess
import sys
from pathlib import Path

ONE = "tests/tools/test_suite_lists.py::test_of_what_there_are_many_cases_there_is_such_a_test"


def test_the_time_of_a_test_stands_in_the_table():
    pytest = [sys.executable, "-m", "pytest", "-q", "-n0", ONE]
    command = [sys.executable, "-m", "tools.suite_cost", "--", *pytest]
    root = Path(__file__).parents[2]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"1 x  {ONE}" in done.stdout
