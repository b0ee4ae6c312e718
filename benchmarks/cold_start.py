"""How long the command line takes to answer, and how much memory it takes.

    python benchmarks/cold_start.py [--rounds N]

Whole processes, started one after the other in turn, by the wall and by the processor time they used; peak
memory is the largest of any. The first run on a machine, which compiles, is timed once, in an empty cache.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

PROGRAM = Path(sys.executable).with_name("beaver-ftc")
SCENARIO = "elevator-partial-loss"  # 30 s at 100 Hz
COMMANDS = {
    "--help": ["--help"],
    "list": ["list"],
    "validate": ["validate", SCENARIO],
    "trim": ["trim"],
    "run --no-report": ["run", SCENARIO, "--no-report", "--out", "{out}"],
    "run": ["run", SCENARIO, "--out", "{out}"],
}


@dataclass(frozen=True)
class Process:
    """What one process took."""

    wall_s: float
    processor_s: float
    peak_mb: float


def run(arguments: Sequence[str], out: str, environment: Mapping[str, str] = os.environ) -> Process:
    """Start the command, wait for it, and read what it used."""
    command = [str(PROGRAM), *(argument.format(out=out) for argument in arguments)]
    start = time.perf_counter()
    process = subprocess.Popen(command, env=dict(environment), stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}")
    return Process(wall_s, used.ru_utime + used.ru_stime, _megabytes(used))


def _megabytes(used: resource.struct_rusage) -> float:
    return used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as out:
        cold = run(COMMANDS["run --no-report"], out, {**os.environ, "NUMBA_CACHE_DIR": f"{out}/cache"})
        for arguments in COMMANDS.values():
            run(arguments, out)
        taken = [[run(arguments, out) for arguments in COMMANDS.values()] for _ in range(rounds)]
    print(f"median of {rounds} processes     wall        processor   peak memory")
    for name, processes in zip(COMMANDS, zip(*taken, strict=True), strict=True):
        print(line(name, processes))
    print(line("run --no-report, first ever", [cold]))
    return 0


def line(name: str, processes: Sequence[Process]) -> str:
    """One row: medians, and the largest peak."""
    wall, processor = (
        statistics.median(getattr(process, what) for process in processes)
        for what in ("wall_s", "processor_s")
    )
    peak = max(process.peak_mb for process in processes)
    return f"{name:28}{wall:8.3f} s  {processor:8.3f} s  {peak:8.0f} MB"


if __name__ == "__main__":
    sys.exit(main())
