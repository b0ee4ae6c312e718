"""The summary of a sweep: the document `summary.json`, and the evaluation of its expectations.

A rate has its count, the number of flights `of` which it is a rate, and its 95 % interval. A number that the
flights do not give is null. Arrays are columns of the flights (flights,), groups are masks of the same shape.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.hints import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.judgement import is_late
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
    count, trials = _counts(hits, group)
    return {"count": count, "of": trials, **_estimate("rate", wilson(count, trials))}


def _counts(hits: np.ndarray, group: np.ndarray) -> tuple[int, int]:
    """Number of hits in a group, and of flights in it."""
    return int((hits & group).sum()), int(group.sum())


def _estimate(name: str, estimate: Estimate) -> Document:
    """An estimate for the document, its value under `name`."""
    value, low, high = map(number, vars(estimate).values())
    return {name: value, "low": low, "high": high, "confidence": CONFIDENCE}


def quantiles(values: np.ndarray) -> Document:
    """QUANTILES of the values (n,) without NaN, and their number. An event that never came has an infinite
    value; an infinite quantile is null."""
    ordered = _sorted_without_nan(values)
    return {"of": ordered.size, **{name: number(quantile(ordered, q)) for name, q in QUANTILES.items()}}


def _sorted_without_nan(values: np.ndarray) -> np.ndarray:
    """The values without NaN, sorted."""
    return np.sort(values[~np.isnan(values)])


def _reasons(flights: Flights) -> list[Document]:
    """At most MOST_REASONS reasons why flights have no metrics, the most frequent first. Reasons that differ
    only in numbers are counted together, and have the text of their first flight."""
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
        **_estimate("per_hour", statistics.poisson(count, hours)),
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
    labels = flights.fault_labels
    groups = {label: labels == label for label in sorted(set(labels[flights.faulted]))}
    return [
        {
            "fault": label,
            "flights": int(has_fault.sum()),
            "detection": _detection(flights, flights.faulted & has_fault),
            "isolation": _isolation(flights, flights.faulted & has_fault),
        }
        for label, has_fault in groups.items()
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


Bound = Callable[[float, bool], float]  # from (confidence, upper) to the one-sided bound of an estimate


def evaluate(expect: SweepExpect, flights: Flights) -> list[Document]:
    """A mapping {name, passed, expected, actual, of} for each expected limit, in the order of the file.

    actual: the number that is compared with the limit, null if the flights do not give it. of: number of
    flights on which it is based.
    """
    return [_verdict(flights, *bound) for bound in _bounds(expect)]


def names(expect: SweepExpect) -> list[str]:
    """The name of each expected limit, such as `departure_rate.at_most`, in the order of `evaluate`."""
    return [f"{name}.{side}" for name, _, side in _bounds(expect)]


def _bounds(expect: SweepExpect) -> Iterator[tuple[str, Level, str]]:
    """(name, level, side) of each expected limit. side: `at_least` or `at_most`, the key of the limit in the
    level."""
    for name, level in expect:
        axes = level if isinstance(level, AxisLevels) else ()
        levels = [(f"{name}.{axis}", limits) for axis, limits in axes] or [(name, level)]
        for full_name, limits in levels:
            for side in ("at_least", "at_most"):
                if limits is not None and getattr(limits, side) is not None:
                    yield full_name, limits, side


def _verdict(flights: Flights, name: str, level: Level, side: str) -> Document:
    """The evaluation of one limit. With a confidence, the one-sided bound of the estimate must keep the
    limit: the upper bound for `at_most`, the lower one for `at_least`. A limit without flights is not met."""
    n_flights, value, bound = estimate_of(flights, name, level)
    limit = getattr(level, side)
    actual = value if level.confidence is None else bound(level.confidence, side == "at_most")
    passed = actual >= limit if side == "at_least" else actual <= limit
    other_side = "at_most" if side == "at_least" else "at_least"
    return {
        "name": name,
        "passed": bool(n_flights > 0 and passed),
        "expected": level.model_dump(exclude_none=True, exclude={other_side}),
        "actual": number(actual),
        "of": n_flights,
    }


def estimate_of(flights: Flights, name: str, level: Level) -> tuple[int, float, Bound]:
    """(number of flights, estimate, its bound) of a quantity: a quantile, a rate of _RATES, or
    `false_alarms_per_hour`."""
    if isinstance(level, QuantileLevel):
        quantity, _, axis = name.partition(".")
        values = getattr(flights, quantity)  # a column, or a function from an axis to one
        ordered = _sorted_without_nan((values(axis) if axis else values)[flights.faulted])
        value = quantile(ordered, level.quantile)
        return ordered.size, value, partial(statistics.quantile_bound, ordered, level.quantile)
    if name in _RATES:
        count, trials = _counts(*_RATES[name](flights))
        return trials, wilson(count, trials).value, partial(statistics.wilson_bound, count, trials)
    count, hours = flights.false_alarms
    n = int(flights.measured.sum()) if hours > 0 else 0
    return n, statistics.poisson(count, hours).value, partial(statistics.poisson_bound, count, hours)


# By name of a rate: its hits, and the group in which they are counted.
_RATES: dict[str, Callable[[Flights], tuple[np.ndarray, np.ndarray]]] = {
    "detection_rate": lambda flights: (flights.detected, flights.faulted),
    "isolation_rate": lambda flights: (flights.isolated, flights.faulted),
    "departure_rate": lambda flights: (flights.departed, flights.measured),
    "failure_rate": lambda flights: (~flights.measured, np.ones(len(flights), bool)),
    "pass_rate": lambda flights: (flights["passed"], flights.measured),
}
