"""A flight of a sweep taken apart, in four kinds, beside as many frames of JSBSim alone in the same air."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import conditions
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.sweep_loader import Sweep, load_sweep
from beaver_ftc.studies.sweep.flying import scenario_of
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.table import row_of

PARTS = ("scenario", "aircraft, trim, record", "frames", "metrics and row")
# kind -> a built-in sweep, and what its flights have besides
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "published": ("elevator-effectiveness", {}),
    "class all": ("elevator-effectiveness", {"fdi.fault_class": "all"}),
    "real air, sensors, statistical": ("robust-elevator-all", {}),
    "autopilot": (
        "elevator-effectiveness",
        {"autopilot": {"altitude_m": [{"hold": True}], "heading_deg": [{"hold": True}]}},
    ),
}
Taken = tuple[np.ndarray, int, float]


def by_kind(rounds: int, between: Callable[[], object] = lambda: None) -> dict[str, dict[str, Any]]:
    """What a flight of each kind costs, all kinds in each round; `between` is called before every round.

    Processor time: `parts_ms` by part, `bare_ms` for JSBSim's frames alone, `frames_ratio` and `flight_ratio`
    to those, and `own_part_us`, what the loop adds to a JSBSim frame. Ratios are formed within a round; all
    are medians over the rounds.
    """
    sweeps = {kind: load_sweep(name) for kind, (name, _) in KINDS.items()}
    seen: dict[str, list[Taken]] = {kind: [] for kind in KINDS}
    for run in range(-1, rounds):
        between()
        for kind, (_, changes) in KINDS.items():
            taken = _flown(sweeps[kind], changes, max(run, 0))
            if run >= 0:  # the first is the warm-up
                seen[kind].append(taken)
    return {kind: _medians(rows) for kind, rows in seen.items()}


def _flown(sweep: Sweep, changes: dict[str, Any], run: int) -> Taken:
    """Seconds of each part of one flight, JSBSim frames flown, and seconds of as many by JSBSim alone.

    All that `sweep` does for a flight; its trim is a new one each time.
    """
    (assignment,) = Plan(sweep).assignments([run])
    conditions._trims.clear()
    marks = [time.process_time()]
    scenario = scenario_of(sweep, assignment)
    marks.append(time.process_time())
    if changes:  # not a part of a flight that a sweep makes
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


def _medians(rows: list[Taken]) -> dict[str, Any]:
    parts, runs, alone = (np.array(column) for column in zip(*rows, strict=True))
    frames_s = parts[:, PARTS.index("frames")]
    return {
        "parts_ms": dict(zip(PARTS, (1e3 * np.median(parts, axis=0)).round(3).tolist(), strict=True)),
        "bare_ms": round(1e3 * float(np.median(alone)), 3),
        "frames_ratio": round(float(np.median(frames_s / alone)), 3),
        "flight_ratio": round(float(np.median(parts.sum(axis=1) / alone)), 3),
        "own_part_us": round(1e6 * float(np.median((frames_s - alone) / runs)), 3),
    }
