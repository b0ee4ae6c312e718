"""Tables of performance.md: what a flight, a frame and a command cost, on the machine that measures."""

import re
import subprocess
import sys

from beaver_ftc.studies.bench.measure import bench
from beaver_ftc.studies.bench.sweep_flights import by_kind
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.pages import ROOT
from tools.docs.tables import table_of

KINDS = {
    "published": "published",
    "class all": "all fault types",
    "real air, sensors, statistical": "turbulence, sensors, servos, statistical detector",
    "class all, every error declared": "all fault types, consumer-grade sensors, every error declared",
    "autopilot": "autopilot",
}
ALTERNATIVES = {
    "properties_through_python": "the same, properties through JSBSim's Python binding",
    "python_detector": "with the smallest detector in Python plugged in",
    "python_law": "with a law in Python plugged in",
    "straightforward": "all in NumPy, properties by name",
}
ROUNDS = 40
WAITS = ("command", "elapsed, s", "processor, s", "memory, MB", "largest allowed, s")


def performance_flights() -> str:
    """Flights of a sweep, each beside as many of JSBSim's own frames."""
    kinds = by_kind(ROUNDS)
    rows = [kinds[kind] | {"name": name, "sum_ms": sum(kinds[kind]["parts_ms"].values())}
            for kind, name in KINDS.items()]  # fmt: skip
    return table_of(rows, {
        "flight of 15 s": "name", "frames, ratio": "frames_ratio .2f", "flight, ratio": "flight_ratio .2f",
        "flight, ms": "sum_ms .0f",
    })  # fmt: skip


def performance_frames() -> str:
    """The closed loop, and other ways to write it, beside the bare aircraft."""
    found = bench(ROUNDS, with_parts=False)
    rows = {
        "closed loop, before the alarm": found["before_alarm"]["ratio"],
        "closed loop, after the alarm": found["ratio"],
        "whole flight with a log file": found["whole_flight"]["with_log_file_ratio"],
        **{name: found["alternatives"][key]["ratio"] for key, name in ALTERNATIVES.items()},
    }
    return table_of(list(map(list, rows.items())), {"frame": "0", "ratio": "1 .2f"})


def performance_waits() -> str:
    """Each wait as `make waits` prints it: whole processes by the wall and the processor, and their bars."""
    _, *lines = _printed("waits.py", "--rounds", "3").splitlines()
    found = [re.fullmatch(r"(.+?)\s+([\d.-]+)\s+([\d.-]+)\s+([\d.-]+)\s+([\d.]+)", line) for line in lines]
    rows = [row.groups() for row in found if row]
    return markdown_table(WAITS, rows)


def _printed(script: str, *arguments: str) -> str:
    command = [sys.executable, str(ROOT / "benchmarks" / script), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
