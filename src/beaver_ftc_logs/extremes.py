"""Rate of false alarms in healthy flight, from the tail of the alarm statistic on held-out flights.

The statistic is Page's sum of evidence for a fault [Page1954]. It restarts whenever it falls to zero, so the
highest values between two restarts (the peaks) are independent of one another. The peaks over a level u are a
Poisson process, and their excess over u has the generalised Pareto distribution [Coles2001, section 4.2]:

    rate of x and more, an hour = rate(u) (1 + xi z / sigma)^(-1 / xi),      z = x - u

    u, z            level of the tail, and excess of a peak over it, natural logarithms of odds
    xi, sigma, p    shape and scale of the Pareto distribution at each point of a grid (g,), and their
                    posterior probability
    rate            false alarms an hour
    flights         peaks and healthy hours of each held-out flight

The posterior of shape, scale and rate is computed on a grid. The threshold for a requested rate is the x at
which the posterior mean of the rate is that rate. If the model is right, a log likelihood ratio has an
exponential tail, xi = 0 [Wald1945], so the prior of the shape is centred there. If flights differ by more
than chance, their number of peaks is divided by this ratio (`dispersion`).
"""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from beaver_ftc.documents import Number, Section
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.runs import true_runs

# Standard deviation of the prior of the shape, whose mean is 0.
_SHAPE_SD = 0.2
_SHAPE_GRID = np.linspace(-0.5, 0.5, 41)
# Grid of the scale, as a multiple of the mean excess.
_SCALE_RATIOS = np.geomspace(0.2, 5.0, 61)
# Probabilities at which the posterior of the rate is evaluated.
_RATE_QUANTILES = (np.arange(40) + 0.5) / 40.0
_MIN_PEAKS = 10  # least number of peaks in the tail
# Number of peaks over the level: this times the root of the number of all peaks, at least _MIN_PEAKS.
_PEAKS_PER_ROOT = 2.0
_INTERVAL = (0.05, 0.95)  # probabilities of the bounds of the rate
# Probability that the requested rate itself raises more alarms in the held-out flights than are permitted.
_MORE_ALARMS_CHANCE = 0.05
# -ln 0.05: no alarm in this many times the requested hours for one alarm shows the rate without a tail.
RULED_OUT_COUNT = 3.0
_MAX_EXCESS = 1e4  # end of the search, natural logarithm of odds
# Tolerance of a sum of probabilities: its rounding must not decide which of two rates is a quantile.
_PROBABILITY_ROUNDING = 1e-9

# Peaks (k,) of the alarm statistic in one held-out flight, and its healthy hours.
PeaksAndHours = tuple[Floats, float]


class PeakTail(Section):
    """The highest peaks of the alarm statistic on held-out flights."""

    level: Number = Field(description="the level, in natural logarithms of odds")
    excess: list[Number] = Field(min_length=1, description="by how much each peak is over it")
    minutes: Number = Field(gt=0, description="of healthy flight they were seen in")
    dispersion: Number = Field(1.0, ge=1, description="how much more the flights differ than by chance")


def peaks_between_zeros(s: Floats) -> Floats:
    """The highest value of each stretch of a statistic s (n,) above zero, (k,)."""
    return np.array([s[begin:end].max() for begin, end in true_runs(s > 0.0)])


def fit_peak_tail(flights: Sequence[PeaksAndHours]) -> PeakTail | None:
    """The tail of the peaks of all held-out flights; None if there are at most ten peaks."""
    peaks = np.sort(np.concatenate([p for p, _ in flights]) if flights else [])[::-1]
    if len(peaks) <= _MIN_PEAKS:
        return None
    n = min(max(_MIN_PEAKS, int(_PEAKS_PER_ROOT * np.sqrt(len(peaks)))), len(peaks) - 1)
    u = float(peaks[n])
    return PeakTail(
        level=u,
        excess=(peaks[:n] - u).tolist(),
        minutes=60.0 * sum(hours for _, hours in flights),
        dispersion=_overdispersion([(p[p > u] - u, hours) for p, hours in flights]),
    )


def _overdispersion(flights: Sequence[PeaksAndHours]) -> float:
    """Chi-square per degree of freedom of the sums of excess of the held-out flights, at least 1. A sum of
    exponential excesses at Poisson times has twice the variance that their number alone would give."""
    sums = np.array([z.sum() for z, _ in flights])
    hours = np.array([h for _, h in flights])
    if len(flights) < 2 or sums.sum() <= 0.0:
        return 1.0
    expected = hours / hours.sum() * sums.sum()
    mean = sums.sum() / sum(len(z) for z, _ in flights)
    squares = (sums - expected) ** 2 / np.maximum(2.0 * expected * mean, MIN_DIVISOR)
    return max(float(squares.sum()) / (len(flights) - 1), 1.0)


def false_alarm_rate(tail: PeakTail, threshold: float) -> dict[str, float]:
    """False alarms an hour at a threshold not below the tail's level: posterior mean (value), and bounds low
    and high of the central 90 % of the posterior."""
    xi, sigma, p = _pareto_posterior(tail)
    rates = np.outer(_exceedance(threshold - tail.level, xi, sigma), _rate_quantiles(tail)).ravel()
    order = np.argsort(rates)
    weights = np.repeat(p, len(_RATE_QUANTILES)) / len(_RATE_QUANTILES)
    index = np.searchsorted(np.cumsum(weights[order]), np.array(_INTERVAL) - _PROBABILITY_ROUNDING)
    low, high = rates[order][np.minimum(index, len(rates) - 1)]
    return {"value": float(rates @ weights), "low": float(low), "high": float(high)}


def threshold_for_rate(tail: PeakTail, rate: float) -> float:
    """The threshold for a requested rate of false alarms, 1/h, natural logarithm of odds: the largest of

        the level of the tail,
        the threshold at which the posterior mean of the rate is the requested one,
        the highest peak that is not among the n highest.

    n: number of alarms in the held-out flights that the requested rate exceeds with a probability of at most
    _MORE_ALARMS_CHANCE. If a few flights are far from the others, no Pareto tail fits them, and the tail
    alone would expect fewer alarms than there were.
    """
    from scipy.stats import poisson

    expected = rate * tail.minutes / 60.0
    n = int(poisson.ppf(1.0 - _MORE_ALARMS_CHANCE, expected))
    z = sorted(tail.excess, reverse=True)
    observed = z[n] if n < len(z) else 0.0
    return tail.level + max(observed, _excess_for_rate(tail, rate))


def _excess_for_rate(tail: PeakTail, rate: float) -> float:
    """Excess z over the level of the tail at which the posterior mean of the rate is the requested one; 0 if
    the rate at the level is lower, and the end of the search if it is still higher there (about
    _MAX_EXCESS)."""
    from scipy.optimize import brentq

    xi, sigma, p = _pareto_posterior(tail)
    mean = float(_rate_quantiles(tail).mean())

    def excess_rate(z: float) -> float:
        """Posterior mean of the rate at an excess z less the requested rate, 1/h."""
        return mean * float(_exceedance(z, xi, sigma) @ p) - rate

    if excess_rate(0.0) <= 0.0:
        return 0.0
    hi = 1.0
    while excess_rate(hi) > 0.0 and hi < _MAX_EXCESS:
        hi *= 2.0
    return float(brentq(excess_rate, 0.0, hi)) if excess_rate(hi) <= 0.0 else hi


def lorden_threshold(rate_hz: float, rate: float) -> float:
    """The threshold h at which the rate of false alarms, 1/h, is at most the given one for any tail, if the
    model is right: Page's sum of a log likelihood ratio exceeds h on average at most once in exp(h) samples
    [Lorden1971]. So h = log(3600 rate_hz / rate), at least 0. rate_hz: sample rate."""
    return float(np.log(max(3600.0 * rate_hz / rate, 1.0)))


def _rate_quantiles(tail: PeakTail) -> Floats:
    """Quantiles of the posterior of the rate of peaks over the level, 1/h, at _RATE_QUANTILES: a gamma
    distribution with shape (number of peaks) / dispersion + 1/2."""
    from scipy.stats import gamma

    shape = len(tail.excess) / tail.dispersion + 0.5
    return gamma.ppf(_RATE_QUANTILES, shape) * tail.dispersion / (tail.minutes / 60.0)


def _pareto_posterior(tail: PeakTail) -> tuple[Floats, Floats, Floats]:
    """xi, sigma and p at each point of the grid: the likelihood of the excess, to the power 1 / dispersion,
    times the normal prior of the shape."""
    from scipy.stats import genpareto

    z = np.array(tail.excess)
    scales = max(float(z.mean()), MIN_DIVISOR) * _SCALE_RATIOS
    xi, sigma = (grid.ravel() for grid in np.meshgrid(_SHAPE_GRID, scales, indexing="ij"))
    ll = genpareto.logpdf(z[:, None], xi, scale=sigma).sum(axis=0) / tail.dispersion
    ll -= 0.5 * (xi / _SHAPE_SD) ** 2
    p = np.exp(ll - ll.max())
    return xi, sigma, p / p.sum()


def _exceedance(z: float, xi: Floats, sigma: Floats) -> Floats:
    """Probability that a peak over the level exceeds it by more than z, (g,)."""
    from scipy.stats import genpareto

    return genpareto.sf(z, xi, scale=sigma)
