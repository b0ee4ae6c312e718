"""What a sweep shows: the document `summary.json`.

A rate comes with its count, what it is of, and its 95 % interval. What the flights do not tell is null.
"""

import math
import re
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.studies.engine.statistics import CONFIDENCE, poisson, quantile, wilson
from beaver_ftc.studies.sweep import sensitivity
from beaver_ftc.studies.sweep.flights import NO_FAULT, Flights
from beaver_ftc.studies.sweep.table import AXES

if TYPE_CHECKING:
    from beaver_ftc.scenario.sweep_loader import Sweep

Document = dict[str, Any]

QUANTILES = {"median": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "max": 1.0}
FALSE_ALARM, NO_ALARM, NOT_ISOLATED = "false alarm", "no alarm", "not isolated"
UNANTICIPATED = "unanticipated"
MOST_REASONS = 20
_NUMBERS = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def summarise(flights: Flights, sweep: "Sweep") -> Document:
    """The statistics of a sweep's flights."""
    return {
        "sweep": sweep.name,
        "description": sweep.file.description,
        "seed": sweep.file.seed,
        "sampling": sweep.file.sampling,
        "flights": len(flights),
        "flown_h": number(float(np.nansum(flights["flown_s"])) / 3600),
        "statuses": _statuses(flights),
        "reasons": _reasons(flights),
        "detection": _detection(flights, flights.faulted),
        "isolation": _isolation(flights, flights.faulted),
        "false_alarms": _false_alarms(flights),
        "departures": rate(flights.departed, flights.measured),
        "passes": rate(flights["passed"], flights.measured),
        "guarantee": _guarantee(flights),
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
    count, trials = int((hits & of).sum()), int(of.sum())
    found = wilson(count, trials)
    return {
        "count": count,
        "of": trials,
        "rate": number(found.value),
        "low": number(found.low),
        "high": number(found.high),
        "confidence": CONFIDENCE,
    }


def quantiles(values: np.ndarray) -> Document:
    """Quantiles of values (n,); infinity stands for what never came; an infinite quantile is null."""
    ordered = np.sort(values[~np.isnan(values)])
    return {"of": int(ordered.size), **{name: number(quantile(ordered, q)) for name, q in QUANTILES.items()}}


def _statuses(flights: Flights) -> dict[str, int]:
    return dict(sorted(Counter(flights["status"].tolist()).items()))


def _reasons(flights: Flights) -> list[Document]:
    """Why flights have no metrics, the most frequent reason first, said in the words of its first flight.

    Reasons that differ in their numbers alone are one.
    """
    failed = np.flatnonzero(~flights.measured)
    kinds = [_NUMBERS.sub("#", reason) for reason in flights["reason"][failed]]
    first = dict(zip(reversed(kinds), reversed(failed.tolist()), strict=True))
    return [
        {"reason": flights["reason"][i], "count": count, "first_run": int(flights["run"][i])}
        for kind, count in Counter(kinds).most_common(MOST_REASONS)
        for i in (first[kind],)
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
    count = int((flights["false_alarm"] & flights.measured).sum())
    hours = float(np.nansum(flights["fault_free_s"][flights.measured])) / 3600
    found = poisson(count, hours)
    return {
        "count": count,
        "hours": number(hours),
        "per_hour": number(found.value),
        "low": number(found.low),
        "high": number(found.high),
        "confidence": CONFIDENCE,
        "closest_residual_ratio": number(float(np.nanmax(flights["worst_residual_ratio"], initial=0.0))),
    }


def _guarantee(flights: Flights) -> Document:
    """Whether every fault was detected by the instant from which theory says detection is certain.

    A fault begins with the first frame at or after its time, from which the promise counts: up to a frame
    later.
    """
    promised = flights.faulted & np.isfinite(flights["detection.guaranteed_delay_s"])
    frame_s = flights["flown_s"] / flights["frames"]
    late = flights.detection_delay_s >= flights["detection.guaranteed_delay_s"] + frame_s - 1e-9
    return {"promised": int(promised.sum()), "broken": int((promised & late).sum())}


def _by_fault(flights: Flights) -> list[Document]:
    labels = flights.fault_labels
    return [
        {
            "fault": label,
            "flights": int((labels == label).sum()),
            "detection": _detection(flights, flights.faulted & (labels == label)),
            "isolation": _isolation(flights, flights.faulted & (labels == label)),
        }
        for label in sorted(set(labels[flights.faulted]))
    ]


def _confusion(flights: Flights) -> Document:
    """Declared fault against diagnosis, of all flights that have metrics."""
    said = np.where(flights["isolation.fault"] != "", flights["isolation.fault"], NOT_ISOLATED)
    said = np.where(flights["detection.detected"], said, NO_ALARM)
    said = np.where(flights["false_alarm"] & (flights.fault_labels != NO_FAULT), FALSE_ALARM, said)
    rows = sorted(set(flights.fault_labels[flights.measured]))
    found = set(said[flights.measured])
    last = [name for name in (UNANTICIPATED, NOT_ISOLATED, NO_ALARM, FALSE_ALARM) if name in found]
    columns = [*sorted(found.difference(last)), *last]
    pairs = Counter(zip(flights.fault_labels[flights.measured], said[flights.measured], strict=True))
    return {
        "faults": rows,
        "diagnoses": columns,
        "counts": [[pairs[row, col] for col in columns] for row in rows],
    }


def _tracking(flights: Flights, axis: str) -> Document:
    group = flights.faulted
    return {
        "pre_fault_rms_deg_s": quantiles(flights[f"tracking.pre_fault_rms_deg_s.{axis}"][flights.measured]),
        "post_fault_rms_deg_s": quantiles(flights.post_fault_rms_deg_s(axis)[group]),
        "ratio": quantiles(flights.tracking_ratio(axis)[group]),
    }


def _sensitivity(flights: Flights) -> dict[str, sensitivity.Ranking]:
    """Outcome -> the varied keys by how much of it they explain."""
    tracked = flights.faulted & ~np.isnan(flights.worst_rms_deg_s)
    outcomes = {
        "detection_delay": (flights.faulted, flights.detection_delay_s),
        "missed_detection": (flights.faulted, (~flights.detected).astype(float)),
        "tracking_error": (tracked, flights.worst_rms_deg_s),
        "residual_before_fault": (flights.measured, flights["worst_residual_ratio"]),
    }
    return {
        name: sensitivity.rank({key: flights.values(key)[group] for key in flights.vary}, outcome[group])
        for name, (group, outcome) in outcomes.items()
    }
