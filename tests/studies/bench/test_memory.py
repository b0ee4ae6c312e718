"""A flight's memory does not grow with its length: the log passes through."""

import json
import subprocess
import sys

import pytest

PROGRAM = """
import json, re, sys, tempfile
from pathlib import Path
from beaver_ftc.loop.stepping import fly_on
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.scenario.schema import Scenario
def peak_mb():  # of this program alone: getrusage would count the process that started it as well
    return int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024
peaks = []
for duration_s in (20, 80):
    with tempfile.TemporaryDirectory() as folder, ParquetLog(Path(folder) / "log.parquet") as log:
        flight = fly(Scenario(name="long", duration_s=duration_s, rate_hz=1000), log)
    peaks.append([flight.frames, peak_mb()])
print(json.dumps([peaks, len(fly_on.overloads)]))
"""


def _peaks():
    """(frames, peak memory in MB) of both flights, in a process that did not have to compile."""
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
        peaks, compiled = json.loads(done.stdout)
        if not compiled:
            return peaks
    pytest.fail("every process compiles: nothing is kept")


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak from /proc")
def test_four_times_as_long_in_the_same_memory():
    (short, first_mb), (long, second_mb) = _peaks()
    log_mb = (long - short) * 90 * 8 / 2**20
    assert second_mb - first_mb < 0.15 * log_mb
    assert second_mb < 300
