"""The expectations of a sweep, each a limit for a rate or a quantile, and whether its flights meet them."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.scenario.sweeps import AxisLevels, Level, QuantileLevel, SweepExpect
from beaver_ftc.studies.engine import statistics
from beaver_ftc.studies.engine.statistics import quantile, wilson
from beaver_ftc.studies.sweep.outcomes import Flights
from beaver_ftc.studies.sweep.summary import counts, number, sorted_without_nan

SIDES = ("at_least", "at_most")  # keys of the limits of a level
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
            for side in SIDES:
                if limits is not None and getattr(limits, side) is not None:
                    yield full_name, limits, side


def _verdict(flights: Flights, name: str, level: Level, side: str) -> Document:
    """The evaluation of one limit. With a confidence, the one-sided bound of the estimate must keep the
    limit: the upper bound for `at_most`, the lower one for `at_least`. A limit without flights is not met."""
    n_flights, value, bound = estimate_of(flights, name, level)
    limit = getattr(level, side)
    actual = value if level.confidence is None else bound(level.confidence, side == "at_most")
    passed = actual >= limit if side == "at_least" else actual <= limit
    return {
        "name": name,
        "passed": bool(n_flights > 0 and passed),
        "expected": level.model_dump(exclude_none=True, exclude={*SIDES} - {side}),
        "actual": number(actual),
        "of": n_flights,
    }


def estimate_of(flights: Flights, name: str, level: Level) -> tuple[int, float, Bound]:
    """(number of flights, estimate, its bound) of a quantity: a quantile, a rate of _RATES, or
    `false_alarms_per_hour`."""
    if isinstance(level, QuantileLevel):
        quantity, _, axis = name.partition(".")
        values = getattr(flights, quantity)  # a column, or a function from an axis to one
        ordered = sorted_without_nan((values(axis) if axis else values)[flights.faulted])
        value = quantile(ordered, level.quantile)
        return ordered.size, value, partial(statistics.quantile_bound, ordered, level.quantile)
    if name in _RATES:
        count, trials = counts(*_RATES[name](flights))
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
