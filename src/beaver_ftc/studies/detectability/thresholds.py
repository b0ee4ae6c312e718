"""The size that a given share of flights find, with an interval that assumes no shape of the curve.

Each flight i has a smallest size X_i at which its fault is found: its noise, its air and the instant of the
fault are kept while the size changes. The share of flights in which size m is found is P(X <= m), so the size
found in 90 % of flights is the 0.9 quantile of X, whatever the curve of that share over m looks like. An
order statistic of n flights bounds it, free of any distribution [Wilks1941; studies/engine/statistics.py].

X_i itself is not needed, only three order statistics. Each is found by bisection over the size, as in
quickselect: once a flight has found size a, it is not flown at larger ones, and once it has missed b not at
smaller ones. So a flight far from the quantile flies once or twice.

Flights are added in stages until the interval is narrow. The error probability is divided equally among the
stages: by the union bound, the interval covers the quantile with the declared confidence however the stage at
which it stops follows from the flights.

Sizes are whole per cent; a size is the smallest of these at which the fault is found.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isinf

import numpy as np

from beaver_ftc.studies.engine.statistics import CONFIDENCE, quantile, quantile_bound

LARGEST = 100  # per cent: a total loss
NEVER = LARGEST + 1  # not even that is found
STAGES = (60, 120, 240, 480)  # flights in all after each stage
RELATIVE_WIDTH = 0.15  # of an interval that is narrow enough, over its size
LEAST_WIDTH = 2.0  # per cent: of one that is narrow enough whatever its size

IsFound = Callable[[Sequence[int], int], Sequence[bool]]
"""Whether each of these flights finds its fault at this size, per cent."""


@dataclass(frozen=True)
class Threshold:
    """A size with its interval, per cent; infinite where not even a total loss is found. flights: of the
    answer."""

    size: float
    low: float
    high: float
    flights: int

    @property
    def is_narrow(self) -> bool:
        """Whether more flights are not worth it; a size beyond every loss cannot be told more exactly."""
        if isinf(self.size):
            return isinf(self.low)
        return self.high - self.low <= max(RELATIVE_WIDTH * self.size, LEAST_WIDTH)


class Sizes:
    """Limits of the smallest size at which each flight finds its fault: it is above `_missed`, and at most
    `_found`. flights: how many of them count."""

    def __init__(self, is_found: IsFound, most: int) -> None:
        self._is_found = is_found
        self.flights = most
        self._missed = np.zeros(most, int)
        self._found = np.full(most, NEVER)

    def count(self, size: int) -> int:
        """How many flights find this size; those of which it is not known are flown."""
        missed = self._missed[: self.flights]
        found = self._found[: self.flights]
        unknown = np.flatnonzero((missed < size) & (size < found))
        if len(unknown):
            is_found = np.array(self._is_found(unknown.tolist(), size), bool)
            found[unknown[is_found]] = size
            missed[unknown[~is_found]] = size
        return int((found <= size).sum())

    def ordered(self, rank: int) -> float:
        """The rank-th smallest size, of 1 to the number of flights."""
        if self.count(LARGEST) < rank:
            return inf
        low, high = 0, LARGEST
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self.count(middle) >= rank else (middle, high)
        return float(high)


def threshold(is_found: IsFound, share: float, stages: Sequence[int] = STAGES) -> Threshold:
    """The size found in a share of flights, with its two-sided interval."""
    sizes = Sizes(is_found, stages[-1])
    one_sided = 1.0 - 0.5 * (1.0 - CONFIDENCE) / len(stages)
    for flights in stages:
        sizes.flights = flights
        ranks = np.arange(1, flights + 1, dtype=float)
        bounds = [quantile_bound(ranks, share, one_sided, upper) for upper in (False, True)]
        low, high = (sizes.ordered(int(rank)) if np.isfinite(rank) else rank for rank in bounds)
        size = sizes.ordered(int(quantile(ranks, share)))
        found = Threshold(size, max(low, 0.0), high, flights)
        if found.is_narrow:
            break
    return found


def of_all(is_found: IsFound, flights: int) -> float:
    """The size from which on every one of so many flights finds its fault, per cent; infinite if none is."""
    return Sizes(is_found, flights).ordered(flights)
