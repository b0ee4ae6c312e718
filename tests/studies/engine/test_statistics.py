import math

import numpy as np
import pytest

from beaver_ftc.studies.engine.statistics import (
    counted,
    median,
    poisson,
    quantile,
    quantile_bound,
    wilson_bound,
)


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
    assert counted(0, 0) == {"count": 0, "of": 0, "value": None, "low": 0.0, "high": 1.0}
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
