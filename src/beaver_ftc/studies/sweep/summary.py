"""The statistics of a sweep for the document `summary.json`.

A rate has its count, the number of flights `of` which it is a rate, and its 95 % interval. A number that the
flights do not give is null. Arrays are columns of the flights (flights,), groups are masks of the same shape.
"""

import math
import re
from collections import Counter

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.hints import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.judgement import is_late
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.statistics import CONFIDENCE, Estimate, poisson, quantile, wilson
from beaver_ftc.studies.sweep.outcomes import NO_FAULT, Flights
from beaver_ftc.studies.sweep.ranking import Ranking, rank

QUANTILES = {"median": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "max": 1.0}
FALSE_ALARM, NO_ALARM, NOT_ISOLATED = "false alarm", "no alarm", "not isolated"
OUTCOMES = {
    "detection_delay": "detection delay",
    "missed_detection": "missed detection",
    "tracking_error": "tracking error",
    "residual_before_fault": "residual before the fault",
}  # outcomes by which keys are ranked, and their titles
MOST_REASONS = 20  # reasons of failed flights that are listed
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
    """A finite number with ten significant digits; None for any other."""
    return float(f"{value:.10g}") if math.isfinite(value) else None


def rate(hits: np.ndarray, group: np.ndarray) -> Document:
    """The rate of hits in a group, with Wilson's interval."""
    count, trials = counts(hits, group)
    return {"count": count, "of": trials, **_estimate("rate", wilson(count, trials))}


def counts(hits: np.ndarray, group: np.ndarray) -> tuple[int, int]:
    """Number of hits in a group, and of flights in it."""
    return int((hits & group).sum()), int(group.sum())


def _estimate(name: str, estimate: Estimate) -> Document:
    """An estimate for the document, its value under `name`."""
    value, low, high = map(number, vars(estimate).values())
    return {name: value, "low": low, "high": high, "confidence": CONFIDENCE}


def quantiles(values: np.ndarray) -> Document:
    """QUANTILES of the values (n,) without NaN, and their number. An event that never came has an infinite
    value; an infinite quantile is null."""
    ordered = sorted_without_nan(values)
    return {"of": ordered.size, **{name: number(quantile(ordered, q)) for name, q in QUANTILES.items()}}


def sorted_without_nan(values: np.ndarray) -> np.ndarray:
    """The values without NaN, sorted."""
    return np.sort(values[~np.isnan(values)])


def _reasons(flights: Flights) -> list[Document]:
    """At most MOST_REASONS reasons why flights have no metrics, the most frequent first. Reasons that differ
    only in numbers are counted together, and have the text of their first flight."""
    failed = np.flatnonzero(~flights.measured)
    kinds = [_NUMBERS.sub("#", reason) for reason in flights["reason"][failed]]
    first = dict(zip(reversed(kinds), reversed(failed.tolist()), strict=True))
    reasons, runs = flights["reason"], flights["run"]
    return [
        {"reason": reasons[first[kind]], "count": count, "first_run": int(runs[first[kind]])}
        for kind, count in Counter(kinds).most_common(MOST_REASONS)
    ]


def _detection(flights: Flights, group: np.ndarray) -> Document:
    """Rate of detection in a group, and delays: of all faults, and of the detected ones."""
    return {
        **rate(flights.detected, group),
        "delay_s": quantiles(flights.detection_delay_s[group]),
        "delay_of_detected_s": quantiles(flights.detection_delay_s[group & flights.detected]),
    }


def _isolation(flights: Flights, group: np.ndarray) -> Document:
    """Rate of right names in a group, rate of wrong names among all names, and delays."""
    isolated = group & (flights["isolation.fault"] != "")
    return {
        **rate(flights.isolated, group),
        "wrong": rate(~flights["isolation.correct"], isolated),
        "delay_s": quantiles(flights.isolation_delay_s[group]),
        "delay_of_isolated_s": quantiles(flights.isolation_delay_s[group & flights.isolated]),
    }


def _false_alarms(flights: Flights) -> Document:
    """False alarms, their rate per hour in which an alarm would have been false, and the largest |residual| /
    threshold in healthy flight, or score / alarm level of the statistical detector."""
    count, hours = flights.false_alarms
    return {
        "count": count,
        "hours": number(hours),
        **_estimate("per_hour", poisson(count, hours)),
        "closest_residual_ratio": number(float(np.nanmax(flights["worst_residual_ratio"], initial=0.0))),
    }


def _guarantee(flights: Flights) -> Document:
    """In how many faulted flights detection was guaranteed, and in how many of these it came later than
    guaranteed."""
    promised = flights.faulted & np.isfinite(flights["detection.guaranteed_delay_s"])
    frame_s = flights["flown_s"] / flights["frames"]
    late = is_late(flights.detection_delay_s, flights["detection.guaranteed_delay_s"], frame_s)
    return {"promised": int(promised.sum()), "broken": int((promised & late).sum())}


def _by_fault(flights: Flights) -> list[Document]:
    """Detection and isolation of each kind of fault."""
    return [
        {
            "fault": label,
            "flights": int(has_fault.sum()),
            "detection": _detection(flights, flights.faulted & has_fault),
            "isolation": _isolation(flights, flights.faulted & has_fault),
        }
        for label, has_fault in flights.by_fault.items()
    ]


def _confusion(flights: Flights) -> Document:
    """The numbers of flights by true fault (rows) and diagnosis (columns). The last columns are no names of
    surfaces."""
    faults = flights.fault_labels
    diagnoses = flights["isolation.fault"]
    diagnoses = np.where(diagnoses != "", diagnoses, NOT_ISOLATED)
    diagnoses = np.where(flights["detection.detected"], diagnoses, NO_ALARM)
    diagnoses = np.where(flights["false_alarm"] & (faults != NO_FAULT), FALSE_ALARM, diagnoses)
    pairs = Counter(zip(faults[flights.measured], diagnoses[flights.measured], strict=True))
    rows = sorted({fault for fault, _ in pairs})
    diagnosed = {diagnosis for _, diagnosis in pairs}
    last = [name for name in (UNANTICIPATED, NOT_ISOLATED, NO_ALARM, FALSE_ALARM) if name in diagnosed]
    columns = [*sorted(diagnosed.difference(last)), *last]
    counts = [[pairs[row, column] for column in columns] for row in rows]
    return {"faults": rows, "diagnoses": columns, "counts": counts}


def _tracking(flights: Flights, axis: str) -> Document:
    """Quantiles of the tracking errors of an axis, deg/s, and of their ratio after and before the fault.
    Those before the fault are of all measured flights, the others of the faulted ones."""
    group = flights.faulted
    return {
        "pre_fault_rms_deg_s": quantiles(flights[f"tracking.pre_fault_rms_deg_s.{axis}"][flights.measured]),
        "post_fault_rms_deg_s": quantiles(flights.post_fault_rms_deg_s(axis)[group]),
        "ratio": quantiles(flights.tracking_ratio(axis)[group]),
    }


def _sensitivity(flights: Flights) -> dict[str, Ranking]:
    """By outcome, the ranking of the varied keys."""
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
