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
from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from statistics import fmean
from typing import Any

from beaver_ftc.diagnosis.rivals import TUNED, TUNED_FOR_ERRORS
from beaver_ftc.loop.loop import fly
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
from beaver_ftc.studies.engine.study import fly_all

Options = dict[str, float]

MARGIN = 1.2
DEPARTED_DEG_S = 10.0
LEVEL = "alarm"
DETECTORS: dict[str, dict[str, tuple[float, ...]]] = {
    "rls-monitor": {"forgetting_s": (0.5, 2.0, 10.0), "score_s": (0.5, 1.0, 4.0)},
    "augmented-ekf": {"noise": (1.0, 3.0, 10.0), "drift_per_s": (0.1, 0.5, 2.0)},
    "augmented-ukf": {"noise": (1.0, 3.0), "drift_per_s": (0.03, 0.3), "allowance": (1.0, 3.0)},
    "multiple-models": {"noise": (0.25, 0.5, 1.0), "stay": (0.99, 0.999)},
    "observer-constant": {"pole_per_s": (10.0, 100.0, 1e4)},
}
DETECTORS_FOR_ERRORS: dict[str, dict[str, tuple[float, ...]]] = {
    "rls-monitor": {"forgetting_s": (2.0, 10.0, 40.0), "score_s": (0.2, 0.5, 1.0)},
    "augmented-ekf": {"noise": (0.3, 1.0, 3.0), "drift_per_s": (0.1, 0.3, 1.0)},
    "augmented-ukf": {"noise": (0.3, 1.0), "drift_per_s": (0.03, 0.3), "allowance": (1.5, 2.5)},
    "multiple-models": {"noise": (1.0, 3.0, 10.0), "stay": (0.999, 0.9999)},
    "observer-constant": {"pole_per_s": (1.0, 3.0, 10.0, 30.0)},
}
LAWS: dict[str, dict[str, tuple[float, ...]]] = {
    "indi": {"filter_per_s": (100.0, 200.0, 400.0)},
    "l1-adaptive": {"bandwidth_per_s": (20.0, 40.0, 80.0)},
    "lqr": {"deflection_deg": (3.0, 10.0, 30.0)},
}
# The level at which the statistic is 1 per unit of itself: traces at any level follow from it.
_UNIT = {LEVEL: 1.0}


def candidates(grid: dict[str, tuple[float, ...]]) -> list[Options]:
    """Every combination of a grid."""
    return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]


def tune(
    target_per_h: float,
    workers: int = 1,
    most: int | None = None,
    progress: Callable[[float], None] | None = None,
    errors: bool = False,
) -> dict[str, Any]:
    """The document of tuned.json. most: flights of each calibration sweep; None is all of them.

    errors: that of tuned_for_errors.json.
    """
    cases = of_set(CALIBRATION_ERRORS if errors else CALIBRATION, most)
    grids = DETECTORS_FOR_ERRORS if errors else DETECTORS
    played = fly_all(partial(_play, grids=grids), cases, workers, progress)
    air = [case.scenario.fdi.bounds.turbulence for case in cases]
    options = {name: _best_detector(name, grid, played, air, target_per_h) for name, grid in grids.items()}
    faulted = [case for case in cases if case.scenario.faults]
    options |= {name: _best_law(name, faulted, workers) for name in LAWS if not errors}
    hours = sum(trace.healthy_s for flight in played for trace in [flight["observer-constant"][0]]) / 3600.0
    return {
        "procedure": f"beaver-ftc compare --tune{' --errors' if errors else ''}; docs/benchmark.md",
        "target_false_alarms_per_h": target_per_h,
        "healthy_hours": hours,
        "flights": len(cases),
        "options": options,
    }


def write_tuned(document: dict[str, Any], path: Path | None = None, errors: bool = False) -> None:
    """Keep what was found where the rivals read it."""
    path = path or (TUNED_FOR_ERRORS if errors else TUNED)
    path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _play(case: SetFlight, grids: dict[str, dict[str, tuple[float, ...]]]) -> dict[str, list[Trace]]:
    """A flight played to every candidate of every detector."""
    recording = record(case.scenario)
    return {
        name: [replay(recording, name, {**option, **_UNIT}) for option in candidates(grid)]
        for name, grid in grids.items()
    }


def _best_detector(
    name: str,
    grid: dict[str, tuple[float, ...]],
    played: Sequence[dict[str, list[Trace]]],
    air: Sequence[str],
    target_per_h: float,
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
    if allowed == 0:
        return round(MARGIN * largest[0], 6)
    return round(largest[min(allowed, len(largest) - 1)], 6)


def _cost(trace: Trace, level: float) -> float:
    """The delay, a miss counting as all the time there was after the fault."""
    delay = trace.delay_s(level)
    return delay if isfinite(delay) else 10.0


def _best_law(name: str, faulted: Sequence[SetFlight], workers: int) -> Options:
    costs = [
        fmean(fly_all(partial(_law_cost, name=name, option=option), faulted, workers))
        for option in candidates(LAWS[name])
    ]
    return candidates(LAWS[name])[costs.index(min(costs))]


def _law_cost(case: SetFlight, name: str, option: Options) -> float:
    entry = Entry(SCHEME, name)
    scenario = with_entry(case.scenario, entry)
    control = scenario.control.model_copy(update={"options": option})
    result = result_of(fly(scenario.model_copy(update={"control": control})), entry, 0.0)
    return min(result.rms_deg_s, DEPARTED_DEG_S)
