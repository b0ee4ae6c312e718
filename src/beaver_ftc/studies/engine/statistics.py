"""Bounds, with a confidence, for rates, counts and quantiles that are estimated from a number of flights.

All functions depend on counts or ordered values alone. A bound that the flights do not give is the end of the
range: 0 or 1 of a share, 0 or infinite of a rate, infinite of a quantile.
"""

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from beaver_ftc.documents.files import Document
from beaver_ftc.studies.present.tables import all_finite, finite

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """An estimate with its two-sided interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """successes / trials with its two-sided score interval [Wilson1927]."""
    return _rate(successes, trials, confidence, "wilson")


def binomial(events: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """events / trials with its two-sided exact interval [ClopperPearson1934]."""
    return _rate(events, trials, confidence, "exact")


@functools.cache  # a study needs the same few counts in every table, 3 ms each
def _rate(count: int, trials: int, confidence: float, method: str) -> Estimate:
    """count / trials with its two-sided interval by this method of scipy; NaN with (0, 1) without a trial."""
    from scipy.stats import binomtest

    if trials == 0:
        return Estimate(math.nan, 0.0, 1.0)
    limits = binomtest(count, trials).proportion_ci(confidence, method)
    return Estimate(count / trials, float(limits.low), float(limits.high))


def counted(events: int, trials: int) -> Document:
    """A count for a document: count, trials, and the share with its exact interval."""
    return {"count": events, "of": trials, **all_finite(vars(binomial(events, trials)))}


def wilson_bound(successes: int, trials: int, confidence: float, upper: bool) -> float:
    """The one-sided score bound of a rate: a limit of the two-sided interval with confidence 2 c - 1."""
    estimate = wilson(successes, trials, 2.0 * confidence - 1.0)
    return estimate.high if upper else estimate.low


def duel(pairs: Iterable[tuple[float, float]]) -> tuple[int, int, float]:
    """The sign test: in how many pairs the first number is larger, in how many it is smaller, and the
    probability of a result at least as uneven between equals, two-sided and exact [Conover1999]. Ties are
    left out."""
    from scipy.stats import binomtest

    larger = [a > b for a, b in pairs if a != b]
    n_larger = sum(larger)
    n = len(larger)
    return n_larger, n - n_larger, float(binomtest(n_larger, n).pvalue) if n else 1.0


def or_never(value: float | None) -> float:
    """A number; infinite for None, which stands for an event that never comes."""
    return math.inf if value is None else value


def poisson(events: int, exposure: float) -> Estimate:
    """events / exposure with its two-sided exact interval [Garwood1936]."""
    if exposure <= 0:
        return Estimate(math.nan, 0.0, math.inf)
    low, high = (poisson_bound(events, exposure, (1.0 + CONFIDENCE) / 2, upper) for upper in (False, True))
    return Estimate(events / exposure, low, high)


def poisson_bound(events: int, exposure: float, confidence: float, upper: bool) -> float:
    """The one-sided exact bound of a rate, mu / exposure, with N of a Poisson distribution of mean mu:

        upper:  P(N <= events) = 1 - confidence        lower:  P(N >= events) = 1 - confidence

    A quantile of the gamma distribution solves both. The lower bound without an event is 0.
    """
    from scipy.stats import gamma

    if exposure <= 0:
        return math.inf if upper else 0.0
    if upper:
        return float(gamma.ppf(confidence, events + 1)) / exposure
    return float(gamma.ppf(1 - confidence, events)) / exposure if events else 0.0


def quantile(ordered: np.ndarray, q: float) -> float:
    """The q quantile of ordered values (n,): the smallest value that at least a share q of the values do not
    exceed."""
    if not ordered.size:
        return math.nan
    # 1e-9: rounding must not lift a whole number q n to the next one
    return float(ordered[max(0, math.ceil(q * ordered.size - 1e-9) - 1)])


def median(values: Iterable[float | None]) -> dict[str, float | None]:
    """A median for a document with its two-sided interval. A value None counts as infinite; an infinite
    result is None."""
    ordered = np.sort([*map(or_never, values)])
    ends = [quantile_bound(ordered, 0.5, (1.0 + CONFIDENCE) / 2, upper) for upper in (False, True)]
    estimate = quantile(ordered, 0.5), *ends
    return {key: finite(value) for key, value in zip(("value", "low", "high"), estimate, strict=True)}


def share_within(values: Iterable[float | None], share: float) -> float:
    """The smallest value that at least this share of the values do not exceed. A value None counts as
    infinite; without values the result is infinite."""
    ordered = np.sort([*map(or_never, values)])
    return quantile(ordered, share) if ordered.size else math.inf


def quantile_bound(ordered: np.ndarray, q: float, confidence: float, upper: bool) -> float:
    """The one-sided bound of a quantile, an order statistic, without an assumption about the distribution.

    The r-th smallest of n values is at or above the q quantile with probability P(Binomial(n, q) < r), and at
    or below it with probability P(Binomial(n, q) >= r) [Wilks1941].
    """
    from scipy.stats import binom

    n = ordered.size
    below = binom.cdf(np.arange(n), n, q) if n else np.empty(0)  # P(Binomial <= k), k = 0 .. n - 1
    if upper:
        enough = np.flatnonzero(below >= confidence)
        return float(ordered[enough[0]]) if enough.size else math.inf
    enough = np.flatnonzero(below <= 1 - confidence)
    return float(ordered[enough[-1]]) if enough.size else -math.inf
