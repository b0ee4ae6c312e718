"""The cost of the flights of sweeps, by kind and by part of a flight."""

import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.plant import conditions
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.sweeps import Sweep, load_sweep
from beaver_ftc.studies.sweep.one_flight import row_of, scenario_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan

STAGES = ("scenario", "aircraft, trim, record", "frames", "metrics and row")
# Times of STAGES (4,), s; JSBSim frames; time of as many frames of JSBSim alone, s.
Times = tuple[np.ndarray, int, float]


class Kind(NamedTuple):
    """Flights of a built-in sweep. changes: further keys of their scenarios. alike: whether each flight is
    the first of the sweep, so that all begin in the same trim, as flights of `matrix` at one airspeed do."""

    sweep: str
    changes: Document | None = None
    alike: bool = False


KINDS = {
    "published": Kind("elevator-effectiveness"),
    "class all": Kind(
        "elevator-effectiveness",
        {"fdi.fault_class": "all", "fdi.sensor_monitor": "never"},
    ),
    "real air, sensors, statistical": Kind("robust-elevator-all"),
    "class all, every error declared": Kind(
        "robust-elevator-all",
        {
            "fdi.fault_class": "all",
            "fdi.sensor_monitor": "always",
            "sensors": "consumer-grade",
            "fdi.bounds.sensors": "consumer-grade",
            "fdi.bounds.inertia": 0.05,
            "fdi.bounds.deflection_deg": 0.2,
        },
    ),
    "autopilot": Kind(
        "elevator-effectiveness",
        {"autopilot": {"altitude_m": [{"hold": True}], "heading_deg": [{"hold": True}]}},
    ),
    "one beginning": Kind("elevator-effectiveness", alike=True),
}


def by_kind(rounds: int) -> dict[str, Document]:
    """The cost of a flight of each kind, all kinds in each round.

    Medians of processor times over the rounds; ratios are formed within a round:

        parts_ms                       each of STAGES
        bare_ms                        the JSBSim frames of the flight alone
        frames_ratio, flight_ratio     the stage `frames`, and all stages, over the time of bare_ms
        frame_us, own_part_us          the stage `frames` for each JSBSim frame; the same less JSBSim
    """
    sweeps = {name: load_sweep(kind.sweep) for name, kind in KINDS.items()}
    times_of_kind: dict[str, list[Times]] = {name: [] for name in KINDS}
    for run in (0, *range(rounds)):  # the first is the warm-up
        for name, kind in KINDS.items():
            times_of_kind[name].append(_flown(sweeps[name], kind, run))
    return {name: _medians(rows[1:]) for name, rows in times_of_kind.items()}


def _flown(sweep: Sweep, kind: Kind, run: int) -> Times:
    """The times of one flight, with all that `sweep` does for it. The trim is computed within the second
    stage; if all flights of a kind begin alike, before the timing.
    """
    (assignment,) = Plan(sweep).assignments([0 if kind.alike else run])
    conditions.forget_trims()
    if kind.alike:
        conditions.find_trim(scenario_of(sweep, assignment))
    took_s: list[float] = []

    def timed(stage: Callable[[], Any]) -> Any:
        """The result of a stage, whose processor time is added to the list."""
        began_s = time.process_time()
        result = stage()
        took_s.append(time.process_time() - began_s)
        return result

    scenario = timed(lambda: scenario_of(sweep, assignment))
    if kind.changes:  # not timed: a sweep has these keys in its base
        scenario = scenario.with_(kind.changes)
    loop = timed(lambda: Loop(scenario))
    timed(lambda: deque(loop.chunks(), maxlen=0))
    flight = timed(lambda: _landed(loop, assignment))
    runs = flight.frames * scenario.substeps
    timed(lambda: _run(loop.plant.run, runs))
    loop.release()
    *stages_s, alone_s = took_s
    return np.array(stages_s), runs, alone_s


def _run(frame: Callable[[], object], runs: int) -> None:
    """Run so many JSBSim frames."""
    for _ in range(runs):
        frame()


def _landed(loop: Loop, assignment: Assignment) -> Landing:
    """The outcome of the flight, after its metrics and its row of the table are computed."""
    flight = loop.land()
    row_of(assignment, measure(flight), flight)
    return flight


def _medians(rows: list[Times]) -> Document:
    """The document of a kind, from the times in all rounds."""
    parts, runs, bare_s = (np.array(column) for column in zip(*rows, strict=True))
    frames_s = parts[:, STAGES.index("frames")]
    return {
        "parts_ms": dict(zip(STAGES, (1e3 * np.median(parts, axis=0)).round(3).tolist(), strict=True)),
        "bare_ms": round(1e3 * float(np.median(bare_s)), 3),
        "frames_ratio": round(float(np.median(frames_s / bare_s)), 3),
        "flight_ratio": round(float(np.median(parts.sum(axis=1) / bare_s)), 3),
        "frame_us": round(1e6 * float(np.median(frames_s / runs)), 3),
        "own_part_us": round(1e6 * float(np.median((frames_s - bare_s) / runs)), 3),
    }
