"""How often a healthy flight alarms: the tail of the alarm statistic on parts that were not fitted.

The statistic is Page's sum of evidence for a fault [Page1954]. It starts again whenever it falls to zero, so
the highest values between two such times are independent of one another. Those over a level u are Poisson in
time, and their excess has the generalised Pareto distribution [Coles2001, section 4.2]:

    rate of x and more, an hour = rate(u) (1 + xi (x - u) / sigma)^(-1 / xi)

Shape, scale and rate are known by their posterior on a grid: the threshold for a rate asked is where the mean
of the rate, with all that is not known of the tail, is that rate. A log likelihood ratio has an exponential
tail, xi = 0, where the model is right [Wald1945]: the prior of the shape is about it. Flights that differ
more than chance lets them count for fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from beaver_ftc.documents import Number, Section
from beaver_ftc_logs.recording import TINY, Floats

_SHAPE_SD, _SHAPES = 0.2, np.linspace(-0.5, 0.5, 41)
_SCALES = np.geomspace(0.2, 5.0, 61)
"""The grid of the shape, and of the scale over the mean excess."""
_RATES = (np.arange(40) + 0.5) / 40.0
_LEAST, _PER_ROOT = 10, 2.0
"""Peaks over the level: so many at least, else so many times the root of their number."""
_SURE = (0.05, 0.95)
SHOWN = 3.0
"""-ln 0.05: with no alarm in so many of the hours asked for one, the rate is shown without a tail."""
_HIGHEST = 1e4
_ROUNDING = 1e-9  # of a sum of probabilities: a quantile between two rates must not hang on its last digits

Part = tuple[Floats, float]
"""Peaks of what is left out in one, and its hours."""


class Tail(Section):
    """The highest peaks of the alarm statistic on parts not fitted."""

    level: Number = Field(description="the level, in natural logarithms of odds")
    excess: list[Number] = Field(min_length=1, description="by how much each peak is over it")
    minutes: Number = Field(gt=0, description="of healthy flight they were seen in")
    dispersion: Number = Field(1.0, ge=1, description="how much more the flights differ than by chance")


@dataclass(frozen=True)
class Expected:
    """False alarms an hour: mean, and what 90 % of the posterior lies between."""

    value: float
    low: float
    high: float


def peaks_of(statistic: Floats) -> Floats:
    """The highest value of each stretch above zero, (k,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], statistic > 0.0, [0]]).astype(np.int8)))
    return np.array([statistic[begin:end].max() for begin, end in zip(edges[::2], edges[1::2], strict=True)])


def tail_of(parts: Sequence[Part]) -> Tail | None:
    """The tail of parts left out: each one's peaks and its hours; None where they are fewer than ten."""
    peaks = np.sort(np.concatenate([one for one, _ in parts]) if parts else [])[::-1]
    if len(peaks) <= _LEAST:
        return None
    count = min(max(_LEAST, int(_PER_ROOT * np.sqrt(len(peaks)))), len(peaks) - 1)
    level = float(peaks[count])
    return Tail(
        level=level,
        excess=(peaks[:count] - level).tolist(),
        minutes=60.0 * sum(hours for _, hours in parts),
        dispersion=_dispersion([(one[one > level] - level, hours) for one, hours in parts]),
    )


def _dispersion(parts: Sequence[Part]) -> float:
    """Chi-square by degree of freedom of what each part's excess comes to, 1 at least: sums of exponential
    excess at Poisson times have twice the variance that their number alone would give."""
    sums, hours = np.array([one.sum() for one, _ in parts]), np.array([hours for _, hours in parts])
    number, share = sum(len(one) for one, _ in parts), hours / hours.sum()
    if len(parts) < 2 or sums.sum() <= 0.0:
        return 1.0
    expected, size = share * sums.sum(), sums.sum() / number
    square = (sums - expected) ** 2 / np.maximum(2.0 * expected * size, TINY)
    return max(float(square.sum()) / (len(parts) - 1), 1.0)


def expected(tail: Tail, threshold: float) -> Expected:
    """False alarms an hour at a threshold not below the tail's level."""
    shape, scale, weight = _posterior(tail)
    rates = (_above(threshold - tail.level, shape, scale)[:, None] * _rates(tail)[None, :]).ravel()
    order, mass = np.argsort(rates), np.repeat(weight, len(_RATES)) / len(_RATES)
    within = np.searchsorted(np.cumsum(mass[order]), np.array(_SURE) - _ROUNDING)
    low, high = rates[order][np.minimum(within, len(rates) - 1)]
    return Expected(float(rates @ mass), float(low), float(high))


def threshold_for(tail: Tail, per_hour: float) -> float:
    """The threshold at which so many false alarms an hour are expected; the level where that has fewer."""
    shape, scale, weight = _posterior(tail)
    level_rate = float(_rates(tail).mean())

    def too_low(excess: float) -> bool:
        return level_rate * float(_above(excess, shape, scale) @ weight) > per_hour

    low, high = 0.0, 1.0
    if not too_low(low):
        return tail.level
    while too_low(high) and high < _HIGHEST:
        low, high = high, 2.0 * high
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_low(middle) else (low, middle)
    return tail.level + high


def sure_threshold(rate_hz: float, per_hour: float) -> float:
    """The threshold with so many false alarms an hour at most where the model is right, whatever the tail:
    Page's sum of a log likelihood ratio passes h once in exp(h) samples or less often [Lorden1971]."""
    return float(np.log(max(3600.0 * rate_hz / per_hour, 1.0)))


def minutes_missing(tail: Tail, per_hour: float) -> float:
    """Minutes of health by which the rate asked would show without any tail, less those there are."""
    return max(60.0 * SHOWN / per_hour - tail.minutes, 0.0)


def _rates(tail: Tail) -> Floats:
    """Peaks over the level an hour, at even steps of their posterior."""
    from scipy.stats import gamma

    shape = len(tail.excess) / tail.dispersion + 0.5
    return np.asarray(gamma.ppf(_RATES, shape) * tail.dispersion / (tail.minutes / 60.0))


def _posterior(tail: Tail) -> tuple[Floats, Floats, Floats]:
    """Shape, scale and the weight of both, each over the whole grid."""
    from scipy.stats import genpareto

    excess = np.array(tail.excess)
    scales = max(float(excess.mean()), TINY) * _SCALES
    shape, scale = (part.ravel() for part in np.meshgrid(_SHAPES, scales, indexing="ij"))
    log = genpareto.logpdf(excess[:, None], shape, scale=scale).sum(axis=0) / tail.dispersion
    log -= 0.5 * (shape / _SHAPE_SD) ** 2
    weight = np.exp(log - log.max())
    return shape, scale, weight / weight.sum()


def _above(excess: float, shape: Floats, scale: Floats) -> Floats:
    """Probability that a peak over the level exceeds it by more."""
    from scipy.stats import genpareto

    return np.asarray(genpareto.sf(excess, shape, scale=scale))
