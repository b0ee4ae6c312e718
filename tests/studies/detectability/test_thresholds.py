"""The size found in a share of flights: by a curve that is known, by sorting, and its interval's coverage."""

from math import inf, log

import numpy as np
import pytest

from beaver_ftc.studies.detectability.thresholds import STAGES, Sizes, Threshold, size_for_all, threshold
from beaver_ftc.studies.engine.statistics import binomial

MIDDLE, SLOPE = 30.0, 4.0  # of a logistic curve, per cent
NINETY = MIDDLE + SLOPE * log(9.0)  # where it is 0.9


def drawn(seed, n=STAGES[-1], middle=MIDDLE):
    """The smallest size of each flight, from the logistic curve."""
    u = np.random.default_rng(seed).random(n)
    return middle + SLOPE * np.log(u / (1.0 - u))


def finder(sizes, calls=None):
    def is_found(runs, size):
        if calls is not None:
            calls.extend((run, size) for run in runs)
        return [sizes[run] <= size for run in runs]

    return is_found


def test_the_interval_covers_the_known_quantile():
    """600 campaigns: no more misses than an error of 5 % allows, by the exact limits of their number."""
    truth = np.ceil(NINETY)
    answers = [threshold(finder(drawn(seed)), 0.9) for seed in range(600)]
    missed = sum(not found.low <= truth <= found.high for found in answers)
    assert binomial(missed, len(answers)).low <= 0.05
    widths = [found.high - found.low for found in answers]
    assert np.median(widths) <= 0.25 * NINETY
    assert np.mean([found.size for found in answers]) == pytest.approx(truth, abs=1.5)


def test_an_order_statistic_is_that_of_the_sorted_sizes():
    sizes = drawn(7, 120)
    known = Sizes(finder(sizes), 120)
    for rank in (1, 60, 108, 120):
        assert known.ordered(rank) == np.ceil(np.sort(sizes)[rank - 1])


def test_where_not_even_a_total_loss_is_found_the_size_is_infinite():
    found = threshold(finder(np.full(500, 150.0)), 0.9)
    assert (found.size, found.low, found.high, found.flights) == (inf, inf, inf, STAGES[0])
    half = threshold(finder(np.where(np.arange(500) % 2, 20.0, 150.0)), 0.9)
    assert half.size == inf


def test_certain_is_the_largest_size_of_all():
    sizes = drawn(11, 60)
    assert size_for_all(finder(sizes), 60) == np.ceil(sizes.max())
    sizes[17] = 140.0
    assert size_for_all(finder(sizes), 60) == inf


@pytest.mark.parametrize(
    ("size", "low", "high", "narrow"),
    [
        (40.0, 37.5, 43.4, True), (40.0, 37.5, 43.6, False), (8.0, 7.0, 8.9, True), (8.0, 6.9, 9.1, False),
        (95.0, 88.0, inf, False), (inf, inf, inf, True), (inf, 46.0, inf, False),
    ],
)  # fmt: skip
def test_an_interval_is_narrow_beside_its_size_or_by_itself(size, low, high, narrow):
    """15 % of the size, or two per cent of effectiveness, whichever is more; beyond every loss it is."""
    assert Threshold(size, low, high, 60).is_narrow is narrow
