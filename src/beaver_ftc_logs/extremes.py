"""Rate of false alarms in healthy flight, from the tail of the alarm statistic on held-out flights.

The statistic is Page's sum of evidence for a fault [Page1954]. It restarts whenever it falls to zero, so the
highest values between two restarts (the peaks) are independent of one another. The peaks over a level u are a
Poisson process, and their excess over u has the generalised Pareto distribution [Coles2001, section 4.2]:

    rate of x and more, an hour = rate(u) (1 + xi (x - u) / sigma)^(-1 / xi)

The posterior of shape, scale and rate is computed on a grid. The threshold for a requested rate is the x at
which the posterior mean of the rate is that rate. If the model is right, a log likelihood ratio has an
exponential tail, xi = 0 [Wald1945], so the prior of the shape is centred there. If flights differ by more
than chance, they count for fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from beaver_ftc.documents import Number, Section
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats

_PARETO_SHAPE_PRIOR_SD, _PARETO_SHAPE_GRID = 0.2, np.linspace(-0.5, 0.5, 41)
_PARETO_SCALE_RATIO_GRID = np.geomspace(0.2, 5.0, 61)
"""The grid of the shape, and of the scale over the mean excess."""
_PEAK_RATE_QUANTILE_PROBABILITIES = (np.arange(40) + 0.5) / 40.0
_MIN_PEAKS, _PEAKS_PER_ROOT_OF_COUNT = 10, 2.0
"""Peaks over the level: so many at least, else so many times the root of their number."""
_CREDIBLE_INTERVAL_PROBABILITIES = (0.05, 0.95)
_CHANCE_OF_MORE_ALARMS = 0.05
"""Chance that the declared rate itself raises more alarms in the held-out flights than are permitted."""
EXPECTED_COUNT_RULED_OUT_BY_NO_ALARM = 3.0
"""-ln 0.05: with no alarm in so many of the hours asked for one, the rate is shown without a tail."""
_MAX_SEARCHED_EXCESS = 1e4
_PROBABILITY_ROUNDING = (
    1e-9  # of a sum of probabilities: a quantile between two rates must not hang on its last digits
)

PeaksAndHours = tuple[Floats, float]
"""Peaks (k,) of the alarm statistic in one held-out flight, and its healthy hours."""


class PeakTail(Section):
    """The highest peaks of the alarm statistic on held-out flights."""

    tail_start_level: Number = Field(description="the level, in natural logarithms of odds", alias="level")
    excess_over_level: list[Number] = Field(
        min_length=1, description="by how much each peak is over it", alias="excess"
    )
    healthy_minutes: Number = Field(gt=0, description="of healthy flight they were seen in", alias="minutes")
    overdispersion: Number = Field(
        1.0, ge=1, description="how much more the flights differ than by chance", alias="dispersion"
    )


@dataclass(frozen=True)
class ExpectedFalseAlarmsPerHour:
    """False alarms an hour: posterior mean (value), and bounds of the central 90 % of the posterior."""

    value: float
    low: float
    high: float


def peaks_between_zeros(statistic: Floats) -> Floats:
    """The highest value of each stretch above zero, (k,)."""
    stretch_edges = np.flatnonzero(np.diff(np.concatenate([[0], statistic > 0.0, [0]]).astype(np.int8)))
    return np.array(
        [
            statistic[begin:end].max()
            for begin, end in zip(stretch_edges[::2], stretch_edges[1::2], strict=True)
        ]
    )


def fit_peak_tail(held_out_peaks_and_hours: Sequence[PeaksAndHours]) -> PeakTail | None:
    """The tail of the peaks of all held-out flights; None if there are at most ten peaks."""
    descending_peaks = np.sort(
        np.concatenate([peaks_of_flight for peaks_of_flight, _ in held_out_peaks_and_hours])
        if held_out_peaks_and_hours
        else []
    )[::-1]
    if len(descending_peaks) <= _MIN_PEAKS:
        return None
    n_peaks_over_level = min(
        max(_MIN_PEAKS, int(_PEAKS_PER_ROOT_OF_COUNT * np.sqrt(len(descending_peaks)))),
        len(descending_peaks) - 1,
    )
    tail_start_level = float(descending_peaks[n_peaks_over_level])
    return PeakTail(
        level=tail_start_level,
        excess=(descending_peaks[:n_peaks_over_level] - tail_start_level).tolist(),
        minutes=60.0 * sum(hours for _, hours in held_out_peaks_and_hours),
        dispersion=_excess_overdispersion(
            [
                (peaks_of_flight[peaks_of_flight > tail_start_level] - tail_start_level, hours)
                for peaks_of_flight, hours in held_out_peaks_and_hours
            ]
        ),
    )


def _excess_overdispersion(excesses_and_hours_by_flight: Sequence[PeaksAndHours]) -> float:
    """Chi-square per degree of freedom of the sums of excess of the held-out flights, at least 1. A sum of
    exponential excesses at Poisson times has twice the variance that their number alone would give."""
    excess_sum_by_flight = np.array([excesses.sum() for excesses, _ in excesses_and_hours_by_flight])
    hours_by_flight = np.array([hours for _, hours in excesses_and_hours_by_flight])
    n_peaks_over_level = sum(len(excesses) for excesses, _ in excesses_and_hours_by_flight)
    hours_share_by_flight = hours_by_flight / hours_by_flight.sum()
    if len(excesses_and_hours_by_flight) < 2 or excess_sum_by_flight.sum() <= 0.0:
        return 1.0
    expected_excess_sum_by_flight = hours_share_by_flight * excess_sum_by_flight.sum()
    mean_excess_of_peaks = excess_sum_by_flight.sum() / n_peaks_over_level
    squared_standardized_deviations = (
        excess_sum_by_flight - expected_excess_sum_by_flight
    ) ** 2 / np.maximum(2.0 * expected_excess_sum_by_flight * mean_excess_of_peaks, MIN_DIVISOR)
    return max(float(squared_standardized_deviations.sum()) / (len(excesses_and_hours_by_flight) - 1), 1.0)


def expected_false_alarms_per_hour(tail: PeakTail, threshold: float) -> ExpectedFalseAlarmsPerHour:
    """False alarms an hour at a threshold not below the tail's level."""
    pareto_shapes, pareto_scales, grid_probabilities = _pareto_posterior(tail)
    false_alarm_rates = (
        _exceedance_probability(threshold - tail.tail_start_level, pareto_shapes, pareto_scales)[:, None]
        * _peaks_per_hour_quantiles(tail)[None, :]
    ).ravel()
    order_by_rate = np.argsort(false_alarm_rates)
    probability_of_each_rate = np.repeat(grid_probabilities, len(_PEAK_RATE_QUANTILE_PROBABILITIES)) / len(
        _PEAK_RATE_QUANTILE_PROBABILITIES
    )
    bound_indices = np.searchsorted(
        np.cumsum(probability_of_each_rate[order_by_rate]),
        np.array(_CREDIBLE_INTERVAL_PROBABILITIES) - _PROBABILITY_ROUNDING,
    )
    low, high = false_alarm_rates[order_by_rate][np.minimum(bound_indices, len(false_alarm_rates) - 1)]
    return ExpectedFalseAlarmsPerHour(
        float(false_alarm_rates @ probability_of_each_rate), float(low), float(high)
    )


def threshold_for_false_alarms(tail: PeakTail, false_alarms_per_hour: float) -> float:
    """The threshold at which this rate of false alarms is expected, but not below any peak by which the
    held-out flights raise more alarms than the rate does by chance; the level of the tail if that is higher.

    If a few flights are far from the others, no Pareto tail fits them: it expects fewer alarms than there
    were.
    """
    from scipy.stats import poisson

    expected_count = false_alarms_per_hour * tail.healthy_minutes / 60.0
    n_permitted = int(poisson.ppf(1.0 - _CHANCE_OF_MORE_ALARMS, expected_count))
    descending_excesses = sorted(tail.excess_over_level, reverse=True)
    observed_excess = descending_excesses[n_permitted] if n_permitted < len(descending_excesses) else 0.0
    return tail.tail_start_level + max(observed_excess, _excess_of_expected_rate(tail, false_alarms_per_hour))


def _excess_of_expected_rate(tail: PeakTail, false_alarms_per_hour: float) -> float:
    """Excess over the level of the tail at which the posterior mean of the rate is this; 0 if the rate at the
    level is lower."""
    pareto_shapes, pareto_scales, grid_probabilities = _pareto_posterior(tail)
    mean_peaks_per_hour = float(_peaks_per_hour_quantiles(tail).mean())

    def has_too_many_alarms(excess: float) -> bool:
        return (
            mean_peaks_per_hour
            * float(_exceedance_probability(excess, pareto_shapes, pareto_scales) @ grid_probabilities)
            > false_alarms_per_hour
        )

    low_excess, high_excess = 0.0, 1.0
    if not has_too_many_alarms(low_excess):
        return 0.0
    while has_too_many_alarms(high_excess) and high_excess < _MAX_SEARCHED_EXCESS:
        low_excess, high_excess = high_excess, 2.0 * high_excess
    for _ in range(40):
        middle_excess = 0.5 * (low_excess + high_excess)
        low_excess, high_excess = (
            (middle_excess, high_excess)
            if has_too_many_alarms(middle_excess)
            else (low_excess, middle_excess)
        )
    return high_excess


def threshold_by_lorden_bound(rate_hz: float, false_alarms_per_hour: float) -> float:
    """The threshold at which the rate of false alarms is at most this, if the model is right, whatever the
    tail: Page's sum of a log likelihood ratio passes h on average at most once in exp(h) samples
    [Lorden1971]."""
    return float(np.log(max(3600.0 * rate_hz / false_alarms_per_hour, 1.0)))


def missing_healthy_minutes(tail: PeakTail, false_alarms_per_hour: float) -> float:
    """Minutes of healthy flight that are missing to show the requested rate without a fitted tail."""
    return max(
        60.0 * EXPECTED_COUNT_RULED_OUT_BY_NO_ALARM / false_alarms_per_hour - tail.healthy_minutes, 0.0
    )


def _peaks_per_hour_quantiles(tail: PeakTail) -> Floats:
    """Quantiles of the posterior of the number of peaks over the level in an hour, at even probabilities."""
    from scipy.stats import gamma

    gamma_shape = len(tail.excess_over_level) / tail.overdispersion + 0.5
    return np.asarray(
        gamma.ppf(_PEAK_RATE_QUANTILE_PROBABILITIES, gamma_shape)
        * tail.overdispersion
        / (tail.healthy_minutes / 60.0)
    )


def _pareto_posterior(tail: PeakTail) -> tuple[Floats, Floats, Floats]:
    """Shape, scale and posterior weight of each point of the grid."""
    from scipy.stats import genpareto

    excesses = np.array(tail.excess_over_level)
    scale_grid = max(float(excesses.mean()), MIN_DIVISOR) * _PARETO_SCALE_RATIO_GRID
    pareto_shapes, pareto_scales = (
        mesh_array.ravel() for mesh_array in np.meshgrid(_PARETO_SHAPE_GRID, scale_grid, indexing="ij")
    )
    log_posterior = (
        genpareto.logpdf(excesses[:, None], pareto_shapes, scale=pareto_scales).sum(axis=0)
        / tail.overdispersion
    )
    log_posterior -= 0.5 * (pareto_shapes / _PARETO_SHAPE_PRIOR_SD) ** 2
    grid_probabilities = np.exp(log_posterior - log_posterior.max())
    return pareto_shapes, pareto_scales, grid_probabilities / grid_probabilities.sum()


def _exceedance_probability(excess: float, pareto_shapes: Floats, pareto_scales: Floats) -> Floats:
    """Probability that a peak over the level exceeds it by more than `excess`."""
    from scipy.stats import genpareto

    return np.asarray(genpareto.sf(excess, pareto_shapes, scale=pareto_scales))
