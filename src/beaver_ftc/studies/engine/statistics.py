"""What a number of flights can say with confidence: bounds for rates, counts and quantiles.

All are functions of counts alone. A bound that the flights do not give is infinite.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Estimate:
    """An estimate with its two-sided interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """A rate with its two-sided score interval [Wilson1927]."""
    if trials == 0:
        return Estimate(math.nan, 0.0, 1.0)
    low, high = (wilson_bound(successes, trials, (1.0 + confidence) / 2, upper) for upper in (False, True))
    return Estimate(successes / trials, low, high)


def wilson_bound(successes: int, trials: int, confidence: float, upper: bool) -> float:
    """The rate's one-sided score bound: (p + z^2/2n +- z sqrt(p(1-p)/n + z^2/4n^2)) / (1 + z^2/n)."""
    if trials == 0:
        return 1.0 if upper else 0.0
    if successes == (trials if upper else 0):
        return float(upper)  # exactly, not up to rounding
    z, p, n = NormalDist().inv_cdf(confidence), successes / trials, trials
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (p + z * z / (2 * n) + (half if upper else -half)) / (1 + z * z / n)


def poisson(events: int, exposure: float, confidence: float = CONFIDENCE) -> Estimate:
    """Events per unit of exposure with their two-sided exact interval [Garwood1936]."""
    if exposure <= 0:
        return Estimate(math.nan, 0.0, math.inf)
    low, high = (poisson_bound(events, exposure, (1.0 + confidence) / 2, upper) for upper in (False, True))
    return Estimate(events / exposure, low, high)


def poisson_bound(events: int, exposure: float, confidence: float, upper: bool) -> float:
    """The rate's one-sided exact bound: the mean at which so few (so many) events get improbable."""
    from scipy.special import gammaincinv

    if exposure <= 0:
        return math.inf if upper else 0.0
    if upper:
        return float(gammaincinv(events + 1, confidence)) / exposure
    return float(gammaincinv(events, 1 - confidence)) / exposure if events else 0.0


def binomial(events: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """A probability with its two-sided exact interval [ClopperPearson1934]."""
    if trials == 0:
        return Estimate(math.nan, 0.0, 1.0)
    one_sided = (1.0 + confidence) / 2.0
    low = 1.0 - binomial_upper(trials - events, trials, one_sided)
    return Estimate(events / trials, low, binomial_upper(events, trials, one_sided))


def sign_test(wins: int, losses: int) -> float:
    """Probability of a result at least as uneven between equals, two-sided and exact [Conover1999]."""
    from scipy.special import bdtr

    n = wins + losses
    return min(1.0, 2.0 * float(bdtr(min(wins, losses), n, 0.5))) if n else 1.0


def binomial_upper(events: int, trials: int, confidence: float = CONFIDENCE) -> float:
    """Exact upper limit of a probability after `events` in `trials` [ClopperPearson1934]."""
    from scipy.special import betaincinv

    return float(betaincinv(events + 1, trials - events, confidence)) if events < trials else 1.0


def quantile(ordered: np.ndarray, q: float) -> float:
    """The q quantile of ordered values (n,): the smallest one that a share q does not exceed."""
    if not ordered.size:
        return math.nan
    return float(ordered[max(0, math.ceil(q * ordered.size - 1e-9) - 1)])


def quantile_bound(ordered: np.ndarray, q: float, confidence: float, upper: bool) -> float:
    """The quantile's one-sided bound, free of any distribution: an order statistic.

    The r-th smallest of n values is at or above the q quantile with probability P(Binomial(n, q) < r), and at
    or below it with probability P(Binomial(n, q) >= r) [Wilks1941].
    """
    from scipy.special import bdtr

    n = ordered.size
    below = bdtr(np.arange(n), n, q) if n else np.empty(0)  # P(Binomial <= k), k = 0 .. n - 1
    if upper:
        enough = np.flatnonzero(below >= confidence)
        return float(ordered[enough[0]]) if enough.size else math.inf
    enough = np.flatnonzero(below <= 1 - confidence)
    return float(ordered[enough[-1]]) if enough.size else -math.inf
