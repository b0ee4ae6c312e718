"""The summary of a sweep: the document `summary.json`.

A rate comes with its count, what it is of, and its 95 % interval. What the flights do not tell is null.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.metrics import NEAR_THRESHOLD_SHARE, is_late
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.sweeps import AxisLevels, Level, QuantileLevel, Sweep, SweepExpect
from beaver_ftc.studies.engine import statistics
from beaver_ftc.studies.engine.statistics import CONFIDENCE, Estimate, quantile, wilson
from beaver_ftc.studies.sweep.outcomes import NO_FAULT, Flights
from beaver_ftc.studies.sweep.ranking import Ranking, rank

QUANTILES = {"median": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "max": 1.0}
FALSE_ALARM, NO_ALARM, NOT_ISOLATED = "false alarm", "no alarm", "not isolated"
OUTCOMES = {
    "detection_delay": "detection delay",
    "missed_detection": "missed detection",
    "tracking_error": "tracking error",
    "residual_before_fault": "residual before the fault",
}  # what keys are ranked by, and its title
MOST_REASONS = 20
_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def summarise(flights: Flights, sweep: Sweep) -> Document:
    """The statistics of a sweep's flights."""
    return {
        "sweep": sweep.name,
        "description": sweep.file.description,
        "seed": sweep.file.seed,
        "sampling": sweep.file.sampling,
        "flights": len(flights),
        "flown_h": number(float(np.nansum(flights["flown_s"])) / 3600),
        "statuses": dict(sorted(Counter(flights["status"].tolist()).items())),
        "reasons": _reasons(flights),
        "detection": _detection(flights, flights.faulted),
        "isolation": _isolation(flights, flights.faulted),
        "false_alarms": _false_alarms(flights),
        "departures": rate(flights.departed, flights.measured),
        "passes": rate(flights["passed"], flights.measured),
        "guarantee": _guarantee(flights),
        "on_the_bound": rate(flights["worst_residual_ratio"] >= NEAR_THRESHOLD_SHARE, flights.faulted),
        "inconclusive": rate(flights["detection.inconclusive.share"] > 0.0, flights.measured),
        "by_fault": _by_fault(flights),
        "confusion": _confusion(flights),
        "tracking": {axis: _tracking(flights, axis) for axis in AXES},
        "sensitivity": _sensitivity(flights),
    }


def number(value: float) -> float | None:
    """A finite number, rounded to what is worth saying, or null."""
    return float(f"{value:.10g}") if math.isfinite(value) else None


def rate(hits: np.ndarray, of: np.ndarray) -> Document:
    """How many of a group are hits, with Wilson's interval."""
    count, trials = _counts(hits, of)
    return {"count": count, "of": trials, **_estimate("rate", wilson(count, trials))}


def _counts(hits: np.ndarray, of: np.ndarray) -> tuple[int, int]:
    return int((hits & of).sum()), int(of.sum())


def _estimate(name: str, found: Estimate) -> Document:
    value, low, high = map(number, vars(found).values())
    return {name: value, "low": low, "high": high, "confidence": CONFIDENCE}


def quantiles(values: np.ndarray) -> Document:
    """Quantiles of values (n,); infinity stands for what never came; an infinite quantile is null."""
    ordered = _told(values)
    return {"of": int(ordered.size), **{name: number(quantile(ordered, q)) for name, q in QUANTILES.items()}}


def _told(values: np.ndarray) -> np.ndarray:
    """The values of the flights that have one, sorted: NaN is left out."""
    return np.sort(values[~np.isnan(values)])


def _reasons(flights: Flights) -> list[Document]:
    """Why flights have no metrics, the most frequent reason first, said in the words of its first flight.

    Reasons that differ in their numbers alone are one.
    """
    failed = np.flatnonzero(~flights.measured)
    kinds = [_NUMBERS.sub("#", reason) for reason in flights["reason"][failed]]
    first = dict(zip(reversed(kinds), reversed(failed.tolist()), strict=True))
    return [
        {
            "reason": flights["reason"][first[kind]],
            "count": count,
            "first_run": int(flights["run"][first[kind]]),
        }
        for kind, count in Counter(kinds).most_common(MOST_REASONS)
    ]


def _detection(flights: Flights, group: np.ndarray) -> Document:
    return {
        **rate(flights.detected, group),
        "delay_s": quantiles(flights.detection_delay_s[group]),
        "delay_of_detected_s": quantiles(flights.detection_delay_s[group & flights.detected]),
    }


def _isolation(flights: Flights, group: np.ndarray) -> Document:
    named = group & (flights["isolation.fault"] != "")
    return {
        **rate(flights.isolated, group),
        "wrong": rate(~flights["isolation.correct"], named),
        "delay_s": quantiles(flights.isolation_delay_s[group]),
        "delay_of_isolated_s": quantiles(flights.isolation_delay_s[group & flights.isolated]),
    }


def _false_alarms(flights: Flights) -> Document:
    """Alarms without a fault, per hour of flight in which one would have been false."""
    count, hours = flights.false_alarms
    return {
        "count": count,
        "hours": number(hours),
        **_estimate("per_hour", statistics.poisson(count, hours)),
        "closest_residual_ratio": number(float(np.nanmax(flights["worst_residual_ratio"], initial=0.0))),
    }


def _guarantee(flights: Flights) -> Document:
    """Whether every fault was detected by the instant from which theory says detection is certain."""
    promised = flights.faulted & np.isfinite(flights["detection.guaranteed_delay_s"])
    frame_s = flights["flown_s"] / flights["frames"]
    late = is_late(flights.detection_delay_s, flights["detection.guaranteed_delay_s"], frame_s)
    return {"promised": int(promised.sum()), "broken": int((promised & late).sum())}


def _by_fault(flights: Flights) -> list[Document]:
    labels = flights.fault_labels
    groups = {label: labels == label for label in sorted(set(labels[flights.faulted]))}
    return [
        {
            "fault": label,
            "flights": int(alike.sum()),
            "detection": _detection(flights, flights.faulted & alike),
            "isolation": _isolation(flights, flights.faulted & alike),
        }
        for label, alike in groups.items()
    ]


def _confusion(flights: Flights) -> Document:
    """Declared fault against diagnosis, of all flights that have metrics."""
    faults = flights.fault_labels
    said = flights["isolation.fault"]
    said = np.where(said != "", said, NOT_ISOLATED)
    said = np.where(flights["detection.detected"], said, NO_ALARM)
    said = np.where(flights["false_alarm"] & (faults != NO_FAULT), FALSE_ALARM, said)
    pairs = Counter(zip(faults[flights.measured], said[flights.measured], strict=True))
    rows = sorted({fault for fault, _ in pairs})
    found = {diagnosis for _, diagnosis in pairs}
    last = [name for name in (UNANTICIPATED, NOT_ISOLATED, NO_ALARM, FALSE_ALARM) if name in found]
    columns = [*sorted(found.difference(last)), *last]
    counts = [[pairs[row, column] for column in columns] for row in rows]
    return {"faults": rows, "diagnoses": columns, "counts": counts}


def _tracking(flights: Flights, axis: str) -> Document:
    group = flights.faulted
    return {
        "pre_fault_rms_deg_s": quantiles(flights[f"tracking.pre_fault_rms_deg_s.{axis}"][flights.measured]),
        "post_fault_rms_deg_s": quantiles(flights.post_fault_rms_deg_s(axis)[group]),
        "ratio": quantiles(flights.tracking_ratio(axis)[group]),
    }


def _sensitivity(flights: Flights) -> dict[str, Ranking]:
    """Outcome -> the varied keys by how much of it they explain."""
    tracked = flights.faulted & ~np.isnan(flights.worst_rms_deg_s)
    outcomes = {
        "detection_delay": (flights.faulted, flights.detection_delay_s),
        "missed_detection": (flights.faulted, (~flights.detected).astype(float)),
        "tracking_error": (tracked, flights.worst_rms_deg_s),
        "residual_before_fault": (flights.measured, flights["worst_residual_ratio"]),
    }
    return {
        name: rank({key: flights[key][group] for key in flights.vary}, outcome[group])
        for name, (group, outcome) in outcomes.items()
    }


Bound = Callable[[float, bool], float]  # (confidence, upper) -> one-sided bound


def evaluate(expect: SweepExpect, flights: Flights) -> list[Document]:
    """One {name, passed, expected, actual, of} for each bound set, in the file's order.

    actual: what was held against the bound, null where the flights do not tell; `of` how many flights tell.
    """
    return [_verdict(flights, *bound) for bound in _bounds(expect)]


def names(expect: SweepExpect) -> list[str]:
    """A name for each bound set, `departure_rate.at_most`, in the order of `evaluate`."""
    return [f"{name}.{side}" for name, _, side in _bounds(expect)]


def _bounds(expect: SweepExpect) -> Iterator[tuple[str, Level, str]]:
    for name, level in expect:
        axes = level if isinstance(level, AxisLevels) else ()
        levels = [(f"{name}.{axis}", own) for axis, own in axes] or [(name, level)]
        for full_name, own in levels:
            for side in ("at_least", "at_most"):
                if own is not None and getattr(own, side) is not None:
                    yield full_name, own, side


def _verdict(flights: Flights, name: str, level: Level, side: str) -> Document:
    of, value, bound = estimate_of(flights, name, level)
    limit = getattr(level, side)
    actual = value if level.confidence is None else bound(level.confidence, side == "at_most")
    kept = actual >= limit if side == "at_least" else actual <= limit
    other = "at_most" if side == "at_least" else "at_least"
    return {
        "name": name,
        "passed": bool(of > 0 and kept),
        "expected": level.model_dump(exclude_none=True, exclude={other}),
        "actual": number(actual),
        "of": of,
    }


def estimate_of(flights: Flights, name: str, level: Level) -> tuple[int, float, Bound]:
    """(number of flights, estimate, its bounds) of a named quantity."""
    if isinstance(level, QuantileLevel):
        quantity, _, axis = name.partition(".")
        values = getattr(flights, quantity)  # an array, or a function of the axis
        ordered = _told((values(axis) if axis else values)[flights.faulted])
        found = quantile(ordered, level.quantile)
        return ordered.size, found, partial(statistics.quantile_bound, ordered, level.quantile)
    if name in _RATES:
        count, trials = _counts(*_RATES[name](flights))
        return trials, wilson(count, trials).value, partial(statistics.wilson_bound, count, trials)
    count, hours = flights.false_alarms  # the one quantity that is left: false_alarms_per_hour
    told = int(flights.measured.sum()) if hours > 0 else 0
    return told, statistics.poisson(count, hours).value, partial(statistics.poisson_bound, count, hours)


_RATES: dict[str, Callable[[Flights], tuple[np.ndarray, np.ndarray]]] = {
    "detection_rate": lambda flights: (flights.detected, flights.faulted),
    "isolation_rate": lambda flights: (flights.isolated, flights.faulted),
    "departure_rate": lambda flights: (flights.departed, flights.measured),
    "failure_rate": lambda flights: (~flights.measured, np.ones(len(flights), bool)),
    "pass_rate": lambda flights: (flights["passed"], flights.measured),
}
