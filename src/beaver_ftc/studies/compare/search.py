"""A bounded search over a method's parameters: seeded, the same for everyone, restarted until nothing gains.

    trial 1                  the values that the search starts with
    half of the rest         a Latin hypercube over all ranges; of a restart, half of it over the
                             neighbourhood of the best so far, `NEAR` of a range to each side
    the other half           Nelder-Mead [Nelder1965] from the best of these, again where it has converged

A search of few trials often ends where another seed would not. It is therefore restarted, from the best so
far and with the next seed, until `SETTLED` restarts in a row gain less than `LITTLE`, or the budget of
restarts is spent; the result says which.

Every parameter is searched on the scale of its range (0 to 1 between its limits). Of the trials whose cost is
within `TIE` of the lowest, the one nearest the middle of the ranges is taken: where the cost does not depend
on a parameter, the parameter does not drift to a limit. A range with the result within `EDGE` of a limit is
widened there, and the search goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import Range

EDGE = 0.02  # of a range on its own scale: a result so near a limit is on the edge
WIDENINGS = 3
TIE = 0.005  # share of the lowest cost
FIRST_STEP = 0.1  # of Nelder-Mead in the first search, share of a range
NEAR = 0.05  # of a restart: share of a range to each side, and its first step
SETTLED = 2  # restarts in a row
LITTLE = 0.01  # share of the lowest cost

Values = dict[str, float]
Cost = Callable[[Values], float]
Ranges = Mapping[str, Range]


@dataclass(frozen=True)
class Found:
    """The result of a search: the cost at the start, the values found and their cost, the ranges as widened,
    the names of widened ranges, one a widening, and the number of trials.

    cost: that of the chosen tie, at most the share `TIE` above the lowest of its last search. A restart
    begins there, so that the cost may rise by as much at each restart.

    restarts: searches after the first. settled: whether the last of them gained nothing; if not, the budget
    ended the search, and a longer one may find more.
    """

    start_cost: float
    cost: float
    found: Values
    ranges: dict[str, Range]
    widened: tuple[str, ...]
    trials: int
    restarts: int
    settled: bool


# The scale of a range: from a value to the scale, and back.
_SCALES: Mapping[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "log": (log, exp),
    "odds": (lambda x: log(x / (1.0 - x)), lambda y: 1.0 / (1.0 + exp(-y))),
}


def on_scale(of: Range, value: float) -> float:
    """Where in its range a value lies, 0 to 1 between its limits."""
    forward = _SCALES[of.scale][0]
    return (forward(value) - forward(of.low)) / (forward(of.high) - forward(of.low))


def value_at(of: Range, place: float) -> float:
    """The value at a place (0 to 1) of a range."""
    forward, back = _SCALES[of.scale]
    low, high = forward(of.low), forward(of.high)
    value = back(low + place * (high - low))
    return float(f"{value:.6g}") if of.scale == "log" else value


def on_edge(values: Values, ranges: Ranges) -> dict[str, bool]:
    """Parameters that lie within `EDGE` of a limit of their range: whether it is the upper one."""
    places = {name: on_scale(of, values[name]) for name, of in ranges.items()}
    return {name: place > 0.5 for name, place in places.items() if not EDGE < place < 1.0 - EDGE}


def search(cost: Cost, ranges: Ranges, start: Values, trials: int, seed: int, restarts: int) -> Found:
    """The values with the lowest cost, by searches of so many trials each. restarts: the most after the
    first; a widened range does not count. Raises SimulationFailed if one has to be widened too often."""
    ranges = dict(ranges)
    widened = list[str]()
    values = dict(start)
    cost_now = None
    start_cost = 0.0
    # made: trials. widenings: searches that ended on an edge. done: restarts. quiet: restarts in a row that
    # gained nothing.
    made = widenings = done = quiet = 0
    while True:
        cost_before = cost_now
        values, cost_now, costs = _searched(cost, ranges, values, cost_before, trials, seed)
        seed += 1
        start_cost = costs[0] if cost_before is None else start_cost
        made += len(costs) - (cost_before is not None)  # a restart does not try its start again
        if edges := on_edge(values, ranges):
            if widenings == WIDENINGS:
                raise SimulationFailed(
                    f"on the edge of its range after {WIDENINGS} widenings: {', '.join(edges)}"
                )
            widenings += 1
            widened += edges
            ranges |= {name: widen(ranges[name], upper) for name, upper in edges.items()}
            continue
        gains = cost_before is None or cost_now < cost_before - LITTLE * abs(cost_before)
        quiet = 0 if gains else quiet + 1
        if quiet == SETTLED or done == restarts:
            return Found(start_cost, cost_now, values, ranges, tuple(widened), made, done, quiet == SETTLED)
        done += 1


def widen(of: Range, upper: bool) -> Range:
    """A range that reaches half as far again, on its own scale, at one end."""
    limit = value_at(of, 1.5 if upper else -0.5)
    return replace(of, high=limit) if upper else replace(of, low=limit)


def _searched(
    cost: Cost, ranges: Ranges, start: Values, known: float | None, trials: int, seed: int
) -> tuple[Values, float, list[float]]:
    """One search, as the module says: the values found, their cost, and the costs of all trials. known: the
    cost of the start, if it has been tried: the search is a restart. A trial is at a point (n,) of the unit
    cube."""
    from scipy.optimize import minimize
    from scipy.stats.qmc import LatinHypercube

    n = len(ranges)
    costs = list[float]()
    points = list[np.ndarray]()

    def values_at(point: np.ndarray) -> Values:
        places = zip(ranges.items(), point, strict=True)
        return {name: value_at(of, float(place)) for (name, of), place in places}

    def attempt(point: np.ndarray) -> float:
        points.append(point.copy())
        costs.append(cost(values_at(point)))
        return costs[-1]

    first = np.clip([on_scale(of, start[name]) for name, of in ranges.items()], 0.0, 1.0)
    spread = LatinHypercube(n, rng=seed).random((trials - 1) // 2)
    step = FIRST_STEP
    if known is None:
        attempt(first)
    else:  # every other point of a restart is near its start, which is not tried again
        points.append(first)
        costs.append(known)
        spread[::2] = np.clip(first + NEAR * (2.0 * spread[::2] - 1.0), 0.0, 1.0)
        step = NEAR
    for point in spread:
        attempt(point)
    while (left := trials - len(costs)) > n:  # Nelder-Mead again, from the best so far
        begin = points[int(np.argmin(costs))]
        steps = np.diag(np.where(begin < 0.5, step, -step))  # towards the middle of each range
        corners = np.vstack((begin, begin + steps))
        options = {"maxfev": left, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5}
        minimize(attempt, begin, method="Nelder-Mead", bounds=[(0.0, 1.0)] * n, options=options)
    chosen = _chosen(points, costs)
    return values_at(points[chosen]), costs[chosen], costs


def _chosen(points: Sequence[np.ndarray], costs: Sequence[float]) -> int:
    """Of the trials within `TIE` of the lowest cost, the one nearest the middle of the ranges."""
    lowest = min(costs)
    ties = np.flatnonzero(np.array(costs) <= lowest + TIE * abs(lowest)).tolist()
    return min(ties, key=lambda i: np.abs(points[i] - 0.5).max())
