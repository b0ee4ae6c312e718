import math

import numpy as np
import pytest

from beaver_ftc.studies.engine.statistics import (
    binomial,
    median,
    poisson,
    poisson_bound,
    quantile,
    quantile_bound,
    sign_test,
    wilson,
    wilson_bound,
)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_rates_have_the_intervals_of_newcombes_table(successes, trials, low, high):
    """R.G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3."""
    found = wilson(successes, trials)
    assert (round(found.low, 4), round(found.high, 4)) == (low, high)
    assert found.value == successes / trials


@pytest.mark.parametrize(("successes", "trials"), [(81, 263), (1, 29), (7, 8)])
def test_beyond_an_exact_interval_so_few_or_so_many_are_improbable(successes, trials):
    """At each end the tail of the binomial distribution, added up term by term, is 2.5 %."""

    def tail(p, counts):
        return sum(math.comb(trials, k) * p**k * (1 - p) ** (trials - k) for k in counts)

    found = binomial(successes, trials)
    assert tail(found.low, range(successes, trials + 1)) == pytest.approx(0.025)
    assert tail(found.high, range(successes + 1)) == pytest.approx(0.025)
    assert found.low < found.value < found.high


def test_none_of_twenty_leaves_the_lower_end_at_nothing():
    found = binomial(0, 20)
    assert (found.low, found.high) == (0.0, pytest.approx(1 - 0.025 ** (1 / 20)))
    assert binomial(20, 20).low == pytest.approx(0.025 ** (1 / 20))


def test_between_equals_the_sign_test_counts_coin_throws():
    assert sign_test(6, 0) == sign_test(0, 6) == pytest.approx(2 / 64)
    assert sign_test(1, 7) == pytest.approx(2 * 9 / 256)
    assert sign_test(5, 5) == sign_test(0, 0) == 1.0


@pytest.mark.parametrize(
    ("events", "low", "high"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.390)]
)
def test_counts_have_the_exact_poisson_intervals_of_the_tables(events, low, high):
    """F. Garwood, Biometrika 28 (1936), the table for 95 %."""
    found = poisson(events, 2.0)
    assert found.low * 2 == pytest.approx(low, abs=6e-4)
    assert found.high * 2 == pytest.approx(high, abs=6e-4)


def test_no_event_in_three_units_bounds_the_rate_at_one():
    assert poisson_bound(0, 2.9957, 0.95, upper=True) == pytest.approx(1.0, abs=1e-4)  # the rule of three


def test_wilks_number_of_flights_bounds_a_quantile():
    """S.S. Wilks (1941): the largest of 59 bounds the 95 % quantile with 95 % confidence; of 58 not."""
    assert quantile_bound(np.arange(59.0), 0.95, 0.95, upper=True) == 58.0
    assert quantile_bound(np.arange(58.0), 0.95, 0.95, upper=True) == math.inf
    assert quantile_bound(np.arange(59.0), 0.05, 0.95, upper=False) == 0.0


def test_a_quantile_bound_keeps_its_confidence():
    generator = np.random.default_rng(1)
    samples = np.sort(generator.random((2000, 100)), axis=1)
    over = np.mean([quantile_bound(sample, 0.8, 0.9, upper=True) >= 0.8 for sample in samples])
    under = np.mean([quantile_bound(sample, 0.8, 0.9, upper=False) <= 0.8 for sample in samples])
    assert 0.88 <= over <= 0.96  # at least 0.9, and not much more: order statistics are coarse
    assert 0.88 <= under <= 0.96


def test_a_quantile_is_the_smallest_value_that_enough_do_not_exceed():
    values = np.array([1.0, 2.0, 3.0, 4.0])
    assert [quantile(values, q) for q in (0.25, 0.26, 0.5, 0.75, 0.99, 1.0)] == [1, 2, 2, 3, 4, 4]
    assert math.isnan(quantile(np.empty(0), 0.5))


def test_bounds_without_flights_say_nothing():
    assert (wilson_bound(0, 0, 0.95, upper=True), wilson_bound(0, 0, 0.95, upper=False)) == (1.0, 0.0)
    assert poisson(0, 0.0).high == math.inf
    assert (binomial(0, 0).low, binomial(0, 0).high) == (0.0, 1.0)
    assert quantile_bound(np.empty(0), 0.5, 0.9, upper=True) == math.inf


def test_wilson_bounds_are_those_whose_test_is_just_passed():
    for successes, trials in ((3, 40), (37, 40), (20, 40)):
        for upper in (False, True):
            p = wilson_bound(successes, trials, 0.95, upper)
            z = (successes / trials - p) / math.sqrt(p * (1 - p) / trials)
            assert abs(z) == pytest.approx(1.6449, abs=1e-4)


@pytest.mark.parametrize("n", [5, 6, 20])
def test_the_interval_of_a_median_is_that_of_the_sign_test(n):
    """The r-th smallest is below the median with at least 97.5 %: counted by binomial coefficients."""
    values = np.random.default_rng(n).permutation(n).astype(float)
    found = median(values)
    tail = [sum(math.comb(n, k) for k in range(r + 1)) / 2**n for r in range(n)]
    low = max((r for r in range(n) if tail[r] <= 0.025), default=None)
    assert found["low"] == (None if low is None else float(low))
    assert found["high"] == (None if low is None else float(n - 1 - low))
    assert median([*values, *[None] * (n + 1)])["value"] is None
