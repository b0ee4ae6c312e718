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
from itertools import count
from math import exp, log

import numpy as np

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import Range

EDGE = 0.02  # of a range on its own scale: a result so near a limit is on the edge
WIDENINGS = 3
TIE = 0.005  # share of the lowest cost
FIRST_STEP = 0.1  # of Nelder-Mead in the first search, share of a range
NEAR = 0.05  # of a restart: share of a range to each side, and its first step
SETTLED, LITTLE = 2, 0.01  # restarts in a row; share of the lowest cost

Values = dict[str, float]
Cost = Callable[[Values], float]


@dataclass(frozen=True)
class Found:
    """The result of a search: the values, their cost, the cost at the start, the ranges, trials made.

    restarts: searches after the first. settled: whether the last of them gained nothing; if not, the budget
    ended the search, and a longer one may find more.
    """

    values: Values
    cost: float
    start_cost: float
    ranges: dict[str, Range]
    trials: int
    widened: tuple[str, ...] = ()
    restarts: int = 0
    settled: bool = False


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


_SCALES: Mapping[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "log": (log, exp),
    "odds": (lambda x: log(x / (1.0 - x)), lambda y: 1.0 / (1.0 + exp(-y))),
}


def on_edge(values: Values, ranges: Mapping[str, Range]) -> dict[str, bool]:
    """Parameters that lie within `EDGE` of a limit of their range: whether it is the upper one."""
    places = {name: on_scale(of, values[name]) for name, of in ranges.items()}
    return {name: place > 0.5 for name, place in places.items() if not EDGE < place < 1.0 - EDGE}


def search(
    cost: Cost, ranges: Mapping[str, Range], start: Values, trials: int, seed: int, restarts: int
) -> Found:
    """The values with the lowest cost, by searches of so many trials each. restarts: the most after the
    first; a widened range does not count. Raises SimulationFailed if one has to be widened too often."""
    ranges, widened, made, best = dict(ranges), list[str](), 0, dict(start)
    lowest, start_cost, widenings, quiet, done = None, 0.0, 0, 0, 0
    for number in count(seed):
        tried = _Trials(cost, ranges, best, lowest)
        tried.search(trials, number)
        start_cost = tried.costs[0] if lowest is None else start_cost
        made += len(tried.costs) - (lowest is not None)  # the best so far is not tried again
        before, (best, lowest) = lowest, tried.best()
        if edges := on_edge(best, ranges):
            if widenings == WIDENINGS:
                break
            widenings, widened = widenings + 1, [*widened, *edges]
            ranges |= {name: widen(ranges[name], upper) for name, upper in edges.items()}
            continue
        gains = before is None or lowest < before - LITTLE * abs(before)
        quiet = 0 if gains else quiet + 1
        if quiet == SETTLED or done == restarts:
            return Found(best, lowest, start_cost, ranges, made, tuple(widened), done, quiet == SETTLED)
        done += 1
    raise SimulationFailed(f"on the edge of its range after {WIDENINGS} widenings: {', '.join(edges)}")


def widen(of: Range, upper: bool) -> Range:
    """A range that reaches half as far again, on its own scale, at one end."""
    limit = value_at(of, 1.5 if upper else -0.5)
    return replace(of, high=limit) if upper else replace(of, low=limit)


class _Trials:
    """Trials of one search, each at a point (n,) of the unit cube. known: the cost of the start, if it has
    been tried: the search is a restart."""

    def __init__(
        self, cost: Cost, ranges: Mapping[str, Range], start: Values, known: float | None = None
    ) -> None:
        self._cost, self._ranges, self._known = cost, ranges, known
        self.points: list[np.ndarray] = []
        self.costs: list[float] = []
        self._start = np.clip([on_scale(of, start[name]) for name, of in ranges.items()], 0.0, 1.0)

    def search(self, trials: int, seed: int) -> None:
        """Spend the trials as the module says."""
        from scipy.optimize import minimize

        self._try(self._start, self._known)
        n = len(self._ranges)
        for point in self._spread((trials - 1) // 2, seed):
            self._try(point)
        while (left := trials - len(self.costs)) > n:
            begin = self.points[int(np.argmin(self.costs))]
            corners = np.vstack((begin, *(begin + step for step in self._steps(begin))))
            options = {"maxfev": left, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5}
            minimize(self._try, begin, method="Nelder-Mead", bounds=[(0.0, 1.0)] * n, options=options)

    def _spread(self, points: int, seed: int) -> np.ndarray:
        """Points (points, n) of a Latin hypercube; of a restart, every other one near the start."""
        from scipy.stats.qmc import LatinHypercube

        spread = LatinHypercube(len(self._ranges), rng=seed).random(points)
        if self._known is not None:
            spread[::2] = np.clip(self._start + NEAR * (2.0 * spread[::2] - 1.0), 0.0, 1.0)
        return spread

    def _steps(self, begin: np.ndarray) -> np.ndarray:
        """First steps, towards the middle of each range."""
        step = FIRST_STEP if self._known is None else NEAR
        return np.diag(np.where(begin < 0.5, step, -step))

    def _try(self, point: Sequence[float] | np.ndarray, known: float | None = None) -> float:
        point = np.asarray(point, dtype=float)
        self.points.append(point.copy())
        self.costs.append(self._cost(self._values(point)) if known is None else known)
        return self.costs[-1]

    def _values(self, point: np.ndarray) -> Values:
        places = zip(self._ranges.items(), point, strict=True)
        return {name: value_at(of, float(place)) for (name, of), place in places}

    def best(self) -> tuple[Values, float]:
        """The values of the lowest cost, and that cost; of several within `TIE` of it, those nearest the
        middle."""
        costs = np.array(self.costs)
        ties = np.flatnonzero(costs <= costs.min() + TIE * abs(costs.min()))
        nearest = ties[int(np.argmin([np.abs(self.points[i] - 0.5).max() for i in ties]))]
        return self._values(self.points[nearest]), self.costs[nearest]
