"""What a sweep's `expect:` asserts, held against the flights.

Without a confidence the estimate itself must keep the bound. With one, the flights must show it: the
one-sided confidence bound on the estimate's worse side must keep it, so few flights prove little.
"""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.scenario.sweep_schema import AxisLevels, Level, QuantileLevel, SweepExpect
from beaver_ftc.studies.engine.statistics import (
    poisson,
    poisson_bound,
    quantile,
    quantile_bound,
    wilson,
    wilson_bound,
)
from beaver_ftc.studies.sweep.flights import Flights
from beaver_ftc.studies.sweep.summary import number

if TYPE_CHECKING:
    from numpy.typing import NDArray

Document = dict[str, Any]
Bound = Callable[[float, bool], float]  # (confidence, upper) -> one-sided bound


def evaluate(expect: SweepExpect, flights: Flights) -> list[Document]:
    """One {name, passed, expected, actual, of} for each bound set, in the file's order.

    actual: what was held against the bound, null where the flights do not tell; `of` how many flights tell.
    """
    return [
        _verdict(name, level, side, *estimate_of(flights, name, level))
        for name, level, side in _bounds(expect)
    ]


def names(expect: SweepExpect) -> list[str]:
    """A name for each bound set, `departure_rate.at_most`, in the order of `evaluate`."""
    return [f"{name}.{side}" for name, _, side in _bounds(expect)]


def _bounds(expect: SweepExpect) -> Iterator[tuple[str, Level, str]]:
    for name, level in _levels(expect):
        for side in ("at_least", "at_most"):
            if getattr(level, side) is not None:
                yield name, level, side


def _levels(expect: SweepExpect) -> Iterator[tuple[str, Level]]:
    for name, level in expect:
        if isinstance(level, AxisLevels):
            yield from ((f"{name}.{axis}", own) for axis, own in level if own is not None)
        elif level is not None:
            yield name, level


def _verdict(name: str, level: Level, side: str, of: int, value: float, bound: Bound) -> Document:
    limit = getattr(level, side)
    actual = value if level.confidence is None else bound(level.confidence, side == "at_most")
    kept = actual >= limit if side == "at_least" else actual <= limit
    return {
        "name": name,
        "passed": bool(of > 0 and kept),
        "expected": {key: value for key, value in _asked(level).items() if key not in _other(side)},
        "actual": number(actual),
        "of": of,
    }


def _asked(level: Level) -> Document:
    return level.model_dump(exclude_none=True)


def _other(side: str) -> tuple[str, ...]:
    return ("at_most",) if side == "at_least" else ("at_least",)


def estimate_of(flights: Flights, name: str, level: Level) -> tuple[int, float, Bound]:
    """(number of flights, estimate, its bounds) of a named quantity."""
    if name in _RATES:
        hits, of = _RATES[name](flights)
        return _rate(int((hits & of).sum()), int(of.sum()))
    if name == "false_alarms_per_hour":
        return _false_alarms(flights)
    assert isinstance(level, QuantileLevel)
    return _quantile(_values(flights, name), level.quantile)


def _rate(count: int, of: int) -> tuple[int, float, Bound]:
    return of, wilson(count, of).value, lambda confidence, upper: wilson_bound(count, of, confidence, upper)


def _false_alarms(flights: Flights) -> tuple[int, float, Bound]:
    count = int((flights["false_alarm"] & flights.measured).sum())
    hours = float(np.nansum(flights["fault_free_s"][flights.measured])) / 3600
    of = int(flights.measured.sum()) if hours > 0 else 0
    return of, poisson(count, hours).value, lambda c, upper: poisson_bound(count, hours, c, upper)


def _quantile(values: "NDArray[np.float64]", q: float) -> tuple[int, float, Bound]:
    ordered = np.sort(values[~np.isnan(values)])
    return ordered.size, quantile(ordered, q), lambda c, upper: quantile_bound(ordered, q, c, upper)


def _values(flights: Flights, name: str) -> "NDArray[np.float64]":
    quantity, _, axis = name.partition(".")
    return {
        "detection_delay_s": lambda: flights.detection_delay_s,
        "isolation_delay_s": lambda: flights.isolation_delay_s,
        "post_fault_rms_deg_s": lambda: flights.post_fault_rms_deg_s(axis),
        "tracking_ratio": lambda: flights.tracking_ratio(axis),
    }[quantity]()[flights.faulted]


_RATES: dict[str, Callable[[Flights], tuple[np.ndarray, np.ndarray]]] = {
    "detection_rate": lambda flights: (flights.detected, flights.faulted),
    "isolation_rate": lambda flights: (flights.isolated, flights.faulted),
    "departure_rate": lambda flights: (flights.departed, flights.measured),
    "failure_rate": lambda flights: (~flights.measured, np.ones(len(flights), bool)),
    "pass_rate": lambda flights: (flights["passed"], flights.measured),
}
