"""The size of a fault that a given share of flights finds, with an interval that assumes no shape of the
curve.

Each flight i has a smallest size X_i at which its fault is found, and is assumed to find it at all larger
sizes. Its noise, its air and the begin of the fault are kept while the size changes. The share of flights
that find size m is P(X <= m). The size that 90 % of the flights find is therefore the 0.9 quantile of X,
whatever the shape of P(X <= m). Order statistics of n flights bound it without an assumption about the
distribution [Wilks1941; studies/engine/statistics.py].

Only three order statistics of X are needed, not each X_i. Each is found by bisection over the size, as in
quickselect. A flight that has found size a is not flown at larger sizes, and one that has missed size b not
at smaller ones. A flight far from the quantile is therefore flown once or twice.

Flights are added in stages until the interval is narrow, or the last stage is flown. The error probability is
divided equally among the stages. By the union bound, the interval then covers the quantile with the declared
confidence, although the number of stages depends on the flights.

Sizes are in whole per cent: a size is the smallest of these at which the fault is found.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isinf

import numpy as np

from beaver_ftc.studies.engine.statistics import CONFIDENCE, quantile, quantile_bound

LARGEST = 100  # per cent: a total loss
NEVER = LARGEST + 1  # in place of a size: not even a total loss is found
STAGES = (60, 120, 240, 480)  # number of flights after each stage
RELATIVE_WIDTH = 0.15  # an interval is narrow if its width is at most this share of the size
LEAST_WIDTH = 2.0  # per cent: such an interval is narrow whatever the size

IsFound = Callable[[Sequence[int], int], Sequence[bool]]
"""Whether each of these flights finds its fault at this size, per cent."""


@dataclass(frozen=True)
class Threshold:
    """A size with its interval, per cent; infinite if not even a total loss is found. flights: their
    number."""

    size: float
    low: float
    high: float
    flights: int

    @property
    def is_narrow(self) -> bool:
        """Whether the interval is narrow enough. A size above a total loss is, if its lower end is above it,
        too."""
        if isinf(self.size):
            return isinf(self.low)
        return self.high - self.low <= max(RELATIVE_WIDTH * self.size, LEAST_WIDTH)


class Sizes:
    """Bounds on the size X_i that each flight i finds: _missed < X_i <= _found, (n,) per cent. flights: the
    first so many of the n flights are counted."""

    def __init__(self, is_found: IsFound, n: int) -> None:
        self._is_found = is_found
        self.flights = n
        self._missed = np.zeros(n, int)
        self._found = np.full(n, NEVER)

    def count(self, size: int) -> int:
        """How many flights find this size. Flights for which this is not known are flown."""
        missed = self._missed[: self.flights]
        found = self._found[: self.flights]
        unknown = np.flatnonzero((missed < size) & (size < found))
        if len(unknown):
            is_found = np.array(self._is_found(unknown.tolist(), size), bool)
            found[unknown[is_found]] = size
            missed[unknown[~is_found]] = size
        return int((found <= size).sum())

    def ordered(self, rank: int) -> float:
        """The order statistic X_(rank), rank from 1 to the number of flights, per cent; infinite above a
        total loss."""
        if self.count(LARGEST) < rank:
            return inf
        low, high = 0, LARGEST
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if self.count(middle) >= rank else (middle, high)
        return float(high)


def threshold(is_found: IsFound, share: float, stages: Sequence[int] = STAGES) -> Threshold:
    """The size found in a share of flights, with its two-sided interval. stages: number of flights after each
    stage; a further stage is flown only if the interval is not narrow."""
    sizes = Sizes(is_found, stages[-1])
    one_sided = 1.0 - 0.5 * (1.0 - CONFIDENCE) / len(stages)
    for flights in stages:
        sizes.flights = flights
        ranks = np.arange(1, flights + 1, dtype=float)
        bounds = [quantile_bound(ranks, share, one_sided, upper) for upper in (False, True)]
        low, high = (sizes.ordered(int(rank)) if np.isfinite(rank) else rank for rank in bounds)
        size = sizes.ordered(int(quantile(ranks, share)))
        result = Threshold(size, max(low, 0.0), high, flights)
        if result.is_narrow:
            break
    return result


def size_for_all(is_found: IsFound, flights: int) -> float:
    """The smallest size that all of so many flights find, per cent; infinite if there is none."""
    return Sizes(is_found, flights).ordered(flights)
