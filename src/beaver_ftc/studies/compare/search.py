"""A bounded search over the parameters of a method. The same seed gives the same search for all methods.

    trial 1                  the values that the search starts with
    half of the others       a Latin hypercube over all ranges; in a restart, every second point is moved
                             near the start, within `NEAR` of a range to each side
    the other half           Nelder-Mead [Nelder1965] from the best of these; restarted when it has converged

The result of a short search depends on its seed. The search is therefore restarted, from the best values so
far and with the next seed, until `SETTLED` restarts in a row gain less than `LITTLE`, or until the budget of
restarts is spent. `Found.settled` says which.

Every parameter is searched on the scale of its range, 0 to 1 between its limits. Among the trials whose cost
is within `TIE` of the lowest, the one nearest the middle of the ranges is taken. A parameter on which the
cost does not depend therefore does not drift to a limit. If the result is within `EDGE` of a limit, the range
is widened there, and the search continues.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import Range

EDGE = 0.02  # share of a range on its scale: a result so near a limit is on the edge
WIDENINGS = 3  # at most
TIE = 0.005  # share of the lowest cost by which a tie may cost more
FIRST_STEP = 0.1  # first step of Nelder-Mead in the first search, share of a range
NEAR = 0.05  # share of a range: neighbourhood of the start of a restart, and first step of its Nelder-Mead
SETTLED = 2  # so many restarts in a row without a gain end the search
LITTLE = 0.01  # share of the cost: a smaller decrease is no gain

Values = dict[str, float]
Cost = Callable[[Values], float]
Ranges = Mapping[str, Range]


@dataclass(frozen=True)
class Found:
    """The result of a search: the cost at the start, the values found and their cost, the ranges as widened,
    the names of widened ranges, one a widening, and the number of trials.

    cost: that of the chosen tie, at most the share `TIE` above the lowest of its last search. A restart
    begins there, so that the cost may rise by as much at each restart.

    restarts: searches after the first, without those in a widened range. settled: whether the last `SETTLED`
    searches gained nothing; if not, the budget ended the search, and a longer one may find more.
    """

    start_cost: float
    cost: float
    found: Values
    ranges: dict[str, Range]
    widened: tuple[str, ...]
    trials: int
    restarts: int
    settled: bool


# Scales of a range: the function from a value to the scale, and its inverse.
_SCALES: Mapping[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "log": (log, exp),
    "odds": (lambda x: log(x / (1.0 - x)), lambda y: 1.0 / (1.0 + exp(-y))),
}


def on_scale(range_: Range, value: float) -> float:
    """Where in its range a value lies, 0 to 1 between its limits."""
    forward = _SCALES[range_.scale][0]
    return (forward(value) - forward(range_.low)) / (forward(range_.high) - forward(range_.low))


def value_at(range_: Range, place: float) -> float:
    """The value at a place of a range, 0 to 1 between its limits; six digits of it on a logarithmic scale."""
    forward, inverse = _SCALES[range_.scale]
    low, high = forward(range_.low), forward(range_.high)
    value = inverse(low + place * (high - low))
    return float(f"{value:.6g}") if range_.scale == "log" else value


def on_edge(values: Values, ranges: Ranges) -> dict[str, bool]:
    """Parameters that lie within `EDGE` of a limit of their range: whether it is the upper one."""
    places = {name: on_scale(range_, values[name]) for name, range_ in ranges.items()}
    return {name: place > 0.5 for name, place in places.items() if not EDGE < place < 1.0 - EDGE}


def search(cost: Cost, ranges: Ranges, start: Values, trials: int, seed: int, restarts: int) -> Found:
    """The values with the lowest cost, or a tie of it. trials: of each search. restarts: the largest number
    of searches after the first; a search in a widened range does not count. Raises SimulationFailed after
    WIDENINGS widenings."""
    ranges = dict(ranges)
    widened = list[str]()
    # widenings: searches that ended on an edge. restarted: restarts. quiet: searches in a row without a gain.
    widenings = restarted = quiet = 0
    before = None  # cost before the last search
    values, now, costs = _searched(cost, ranges, start, before, trials, seed)
    start_cost, tried = costs[0], len(costs)
    while True:
        if edges := on_edge(values, ranges):
            if widenings == WIDENINGS:
                raise SimulationFailed(
                    f"on the edge of its range after {WIDENINGS} widenings: {', '.join(edges)}"
                )
            widenings += 1
            widened += edges
            ranges |= {name: widen(ranges[name], upper) for name, upper in edges.items()}
        else:
            gains = before is None or now < before - LITTLE * abs(before)
            quiet = 0 if gains else quiet + 1
            if quiet == SETTLED or restarted == restarts:
                return Found(
                    start_cost, now, values, ranges, tuple(widened), trials=tried, restarts=restarted,
                    settled=quiet == SETTLED,
                )  # fmt: skip
            restarted += 1
        before = now
        seed += 1
        values, now, costs = _searched(cost, ranges, values, before, trials, seed)
        tried += len(costs) - 1  # a restart does not try its start again


def widen(range_: Range, upper: bool) -> Range:
    """A range with one limit moved outwards by half of the range, on its scale."""
    limit = value_at(range_, 1.5 if upper else -0.5)
    return replace(range_, high=limit) if upper else replace(range_, low=limit)


def _searched(
    cost: Cost, ranges: Ranges, start: Values, known_cost: float | None, trials: int, seed: int
) -> tuple[Values, float, list[float]]:
    """One search: the values found, their cost, and the costs of all trials.

    known_cost: the cost of the start, if it has been tried; the search is then a restart. A trial is at a
    point (n,) of the unit cube.
    """
    from scipy.optimize import minimize
    from scipy.stats.qmc import LatinHypercube

    n = len(ranges)
    costs = list[float]()
    points = list[np.ndarray]()

    def values_at(point: np.ndarray) -> Values:
        places = zip(ranges.items(), point, strict=True)
        return {name: value_at(range_, float(place)) for (name, range_), place in places}

    def attempt(point: np.ndarray) -> float:
        """The cost at a point (n,), which is noted with its cost."""
        points.append(point.copy())
        costs.append(cost(values_at(point)))
        return costs[-1]

    first = np.clip([on_scale(range_, start[name]) for name, range_ in ranges.items()], 0.0, 1.0)
    spread = LatinHypercube(n, rng=seed).random((trials - 1) // 2)
    step = FIRST_STEP
    if known_cost is None:
        attempt(first)
    else:  # every other point of a restart is near its start, which is not tried again
        points.append(first)
        costs.append(known_cost)
        spread[::2] = np.clip(first + NEAR * (2.0 * spread[::2] - 1.0), 0.0, 1.0)
        step = NEAR
    for point in spread:
        attempt(point)
    while (remaining := trials - len(costs)) > n:  # Nelder-Mead again, from the best so far
        begin = points[int(np.argmin(costs))]
        steps = np.diag(np.where(begin < 0.5, step, -step))  # towards the middle of each range
        corners = np.vstack((begin, begin + steps))
        options = {"maxfev": remaining, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5}
        minimize(attempt, begin, method="Nelder-Mead", bounds=[(0.0, 1.0)] * n, options=options)
    chosen = _chosen(points, costs)
    return values_at(points[chosen]), costs[chosen], costs


def _chosen(points: Sequence[np.ndarray], costs: Sequence[float]) -> int:
    """The index of the trial nearest the middle of the ranges, among those within `TIE` of the lowest
    cost."""
    lowest = min(costs)
    ties = np.flatnonzero(np.array(costs) <= lowest + TIE * abs(lowest)).tolist()
    return min(ties, key=lambda i: np.abs(points[i] - 0.5).max())
