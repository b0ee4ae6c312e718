"""A crew that is dismissed leaves at once and in silence, whatever its workers are doing."""

import subprocess
import sys
import time

import pytest

PROGRAM = """
import sys, time
from beaver_ftc.studies.engine.crew import Case, Task, Work, _Worker

def nap(case):
    time.sleep(20.0)

if __name__ == "__main__":
    workers = [_Worker(Work(nap)) for _ in range(3)]
    for number, worker in enumerate(workers):
        worker.fly(Task(number, (Case(0, None),)))
    time.sleep(float(sys.argv[1]))
    for worker in workers:
        worker.end()
"""


@pytest.mark.parametrize("seconds", [0.0, 3.0])
def test_workers_end_before_and_after_they_have_started(tmp_path, seconds):
    program = tmp_path / "dismissed.py"
    program.write_text(PROGRAM)
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, program, str(seconds)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert time.monotonic() - begun < 18.0
