"""What a flight costs beside flying: taken apart, in four kinds of flight, in units of JSBSim's plain frame.

    python benchmarks/flight_cost.py [--rounds N] [--check FILE | --record FILE]

Each round flies every kind once and then lets JSBSim alone fly as many frames of the same aircraft, in the
same air, surfaces held; ratios are formed within a round, medians over the rounds. A flight in a sweep is all
that `sweep` does for one: scenario, aircraft, trim, record, frames, metrics, row. The trim is a new one each
time. `--check benchmarks/ratios.json` ends with status 1 if a ratio is over a tenth above the recorded one,
and still is when all is measured again.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from aircraft_cost import Variant, jsbsim_alone, write_variant
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import conditions
from beaver_ftc.plant.conditions import trim
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.sweep_loader import Sweep, load_sweep
from beaver_ftc.studies.sweep.flying import scenario_of
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.table import row_of

ALLOWED_RISE = 0.10
PLAIN_FRAMES = 1000
KINDS = {
    "published": ("elevator-effectiveness", {}),
    "class all": ("elevator-effectiveness", {"fdi.fault_class": "all"}),
    "real air, sensors, statistical": ("robust-elevator-all", {}),
    "autopilot": (
        "elevator-effectiveness",
        {"autopilot": {"altitude_m": [{"hold": True}], "heading_deg": [{"hold": True}]}},
    ),
}
PARTS = ("scenario", "aircraft, trim, record", "frames", "metrics and row")
Clock = Callable[[], float]


def flown(sweep: Sweep, changes: dict[str, Any], run: int) -> tuple[np.ndarray, int, float]:
    """Seconds of each part of one flight, JSBSim frames flown, and seconds of as many by JSBSim alone."""
    (assignment,) = Plan(sweep).assignments([run])
    conditions._trims.clear()
    marks = [time.process_time()]
    scenario = scenario_of(sweep, assignment)
    marks.append(time.process_time())
    if changes:
        scenario = scenario.with_(changes)
        marks = [marks[0] + time.process_time() - marks[1], time.process_time()]
    loop = Loop(scenario)
    marks.append(time.process_time())
    for _ in loop.chunks():
        pass
    marks.append(time.process_time())
    flight = loop.land()
    row_of(assignment.run, assignment.values, scenario.seed, metrics(flight), flight)
    marks.append(time.process_time())
    runs = flight.frames * scenario.substeps
    alone = _alone(loop.plant.run, runs)
    loop.release()
    return np.diff(marks), runs, alone


def _alone(run: Callable[[], object], runs: int) -> float:
    began = time.process_time()
    for _ in range(runs):
        run()
    return time.process_time() - began


def measure(rounds: int) -> dict[str, Any]:
    """By kind: parts in ms, and the ratios of frames and of the whole flight to JSBSim alone."""
    sweeps = {kind: load_sweep(name) for kind, (name, _) in KINDS.items()}
    seen: dict[str, list[tuple[np.ndarray, int, float]]] = {kind: [] for kind in KINDS}
    plain: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        unit = Variant(write_variant(Path(folder) / "plain", jsbsim_alone), trim())
        for run in range(-1, rounds):
            unit.prepare()
            began = time.process_time()
            unit.fly(PLAIN_FRAMES)
            plain.append((time.process_time() - began) / PLAIN_FRAMES)
            for kind, (_, changes) in KINDS.items():
                taken = flown(sweeps[kind], changes, max(run, 0))
                if run >= 0:  # the first is the warm-up
                    seen[kind].append(taken)
    unit_s = float(np.median(plain[1:]))
    return {"unit_us": 1e6 * unit_s, "kinds": {kind: _summary(rows, unit_s) for kind, rows in seen.items()}}


def _summary(rows: list[tuple[np.ndarray, int, float]], unit_s: float) -> dict[str, Any]:
    parts, runs, alone = (np.array(column) for column in zip(*rows, strict=True))
    frames_s = parts[:, PARTS.index("frames")]
    return {
        "parts_ms": dict(zip(PARTS, (1e3 * np.median(parts, axis=0)).round(3).tolist(), strict=True)),
        "bare_ms": round(1e3 * float(np.median(alone)), 3),
        "frames_ratio": round(float(np.median(frames_s / alone)), 3),
        "flight_ratio": round(float(np.median(parts.sum(axis=1) / alone)), 3),
        "own_part_units": round(float(np.median((frames_s - alone) / runs)) / unit_s, 3),
    }


def risen(now: dict[str, Any], recorded: dict[str, Any]) -> list[str]:
    """Which ratios are more than a tenth above the recorded ones."""
    return [
        f"{kind}: {name} is {now['kinds'][kind][name]:.3f}, recorded {was[name]:.3f}"
        for kind, was in recorded["kinds"].items()
        for name in ("frames_ratio", "flight_ratio")
        if now["kinds"][kind][name] > (1.0 + ALLOWED_RISE) * was[name]
    ]


def main() -> int:
    """Print the table; record or check."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--check", type=Path)
    parser.add_argument("--record", type=Path)
    given = parser.parse_args()
    now = measure(given.rounds)
    print(f"unit, JSBSim's plain frame: {now['unit_us']:.2f} us; medians of {given.rounds} rounds, ms")
    for kind, of in now["kinds"].items():
        parts = ", ".join(f"{name} {ms:.2f}" for name, ms in of["parts_ms"].items())
        print(f"{kind}: {parts}; bare frames {of['bare_ms']:.2f}")
        print(
            f"    frames / bare {of['frames_ratio']:.3f}, flight / bare {of['flight_ratio']:.3f}, "
            f"the loop's own part {of['own_part_units']:.2f} units a JSBSim frame"
        )
    if given.record:
        given.record.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    if given.check is None:
        return 0
    recorded = json.loads(given.check.read_text(encoding="utf-8"))
    found = risen(now, recorded) and risen(measure(given.rounds), recorded)
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
