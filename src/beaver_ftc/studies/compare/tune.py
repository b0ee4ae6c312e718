"""Tunes the rivals: the procedure behind rivals/tuned.json and tuned_for_errors.json, the same for all of
them.

Detectors, on recorded flights of the calibration set (its seeds are in no set that is compared):

1. For each candidate of a small grid of the parameters a method leaves open, take the largest value of its
statistic
   on every healthy flight. The alarm level is put where the false-alarm rate is the target: for a target
   below one alarm in all of them, `MARGIN` times the largest value seen. Flights in different air each have
   a level of their own; the largest is what the rival ships with.
2. Of the candidates, keep the one with the smallest mean delay on the faulted flights, a miss counting as
the rest of
   the flight.

Laws: the candidate with the smallest mean RMS error after the fault on the faulted flights, a departure
counting 10 deg/s.

With errors of instruments and air declared only the detectors are tuned anew, on a set of its own, and over a
grid that suits it.
"""

import itertools
import json
from collections.abc import Sequence
from functools import cache, partial
from math import isfinite
from pathlib import Path
from statistics import fmean
from typing import Any

from beaver_ftc.diagnosis.rivals import TUNED, TUNED_FOR_ERRORS
from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.studies.compare.replay import Trace, record, replay
from beaver_ftc.studies.compare.trial import (
    CALIBRATION,
    CALIBRATION_ERRORS,
    SCHEME,
    Entry,
    SetFlight,
    of_set,
    result_of,
    with_entry,
)
from beaver_ftc.studies.engine.study import Progress, fly_all

Options = dict[str, float]
Grid = dict[str, list[float]]  # values of each option that are tried

MARGIN = 1.2
DEPARTED_DEG_S = 10.0
LEVEL = "alarm"
# The level at which the statistic is 1 per unit of itself: traces at any level follow from it.
_UNIT = {LEVEL: 1.0}


@cache
def grids() -> dict[str, dict[str, Grid]]:
    """The grid of each rival: of "detectors", of "detectors for errors", of "laws"."""
    found: dict[str, dict[str, Grid]] = json.loads(Path(__file__).with_name("grids.json").read_text("utf-8"))
    return found


def candidates(grid: Grid) -> list[Options]:
    """Every combination of a grid."""
    return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]


def tune(
    target_per_h: float, workers: int, most: int | None, progress: Progress | None, errors: bool
) -> dict[str, Any]:
    """The document of tuned.json. most: flights of each calibration sweep; None is all of them.

    errors: that of tuned_for_errors.json.
    """
    cases = of_set(CALIBRATION_ERRORS if errors else CALIBRATION, most)
    detectors = grids()["detectors for errors" if errors else "detectors"]
    laws = {} if errors else grids()["laws"]
    played = fly_all(partial(_play, grids=detectors), cases, workers, progress)
    air = [Declared.of(case.scenario).air.severity for case in cases]
    options = {
        name: _best_detector(name, grid, played, air, target_per_h) for name, grid in detectors.items()
    }
    faulted = [case for case in cases if case.scenario.faults]
    options |= {name: _best_law(name, grid, faulted, workers) for name, grid in laws.items()}
    hours = sum(flight["observer-constant"][0].healthy_s for flight in played) / 3600.0
    return {
        "procedure": f"beaver-ftc compare --tune{' --errors' if errors else ''}; docs/results/benchmark.md",
        "target_false_alarms_per_h": target_per_h,
        "healthy_hours": hours,
        "flights": len(cases),
        "options": options,
    }


def write_tuned(document: dict[str, Any], errors: bool) -> None:
    """Keep what was found where the rivals read it."""
    path = TUNED_FOR_ERRORS if errors else TUNED
    path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _play(case: SetFlight, grids: dict[str, Grid]) -> dict[str, list[Trace]]:
    """A flight played to every candidate of every detector."""
    recording = record(case.scenario)
    return {
        name: [replay(recording, name, {**option, **_UNIT}) for option in candidates(grid)]
        for name, grid in grids.items()
    }


def _best_detector(
    name: str, grid: Grid, played: Sequence[dict[str, list[Trace]]], air: Sequence[str], target_per_h: float
) -> Options:
    """The candidate with the least delay at its own alarm level; air: what each flight declares of it."""
    found = []
    for i, option in enumerate(candidates(grid)):
        traces = [(condition, flight[name][i]) for condition, flight in zip(air, played, strict=True)]
        level = {
            condition: alarm_level([t for c, t in traces if c == condition and not t.faulted], target_per_h)
            for condition in dict.fromkeys(air)
        }
        cost = fmean(_cost(trace, level[condition]) for condition, trace in traces if trace.faulted)
        found.append((cost, {**option, LEVEL: max(level.values())}))
    return min(found, key=lambda pair: pair[0])[1]


def alarm_level(healthy: Sequence[Trace], target_per_h: float) -> float:
    """The level of the statistic with at most the target's false alarms on healthy flights."""
    hours = sum(trace.healthy_s for trace in healthy) / 3600.0
    allowed = int(target_per_h * hours)
    largest = sorted((trace.before for trace in healthy), reverse=True)
    level = largest[min(allowed, len(largest) - 1)] if allowed else MARGIN * largest[0]
    return round(level, 6)


def _cost(trace: Trace, level: float) -> float:
    """The delay, a miss counting as all the time there was after the fault."""
    delay = trace.delay_s(level)
    return delay if isfinite(delay) else 10.0


def _best_law(name: str, grid: Grid, faulted: Sequence[SetFlight], workers: int) -> Options:
    def cost(option: Options) -> float:
        return fmean(fly_all(partial(_law_cost, name=name, option=option), faulted, workers))

    return min(candidates(grid), key=cost)


def _law_cost(case: SetFlight, name: str, option: Options) -> float:
    entry = Entry(SCHEME, name)
    scenario = with_entry(case.scenario, entry)
    control = scenario.control.model_copy(update={"options": option})
    result = result_of(fly(scenario.model_copy(update={"control": control})), entry, 0.0)
    return min(result.rms_deg_s, DEPARTED_DEG_S)
