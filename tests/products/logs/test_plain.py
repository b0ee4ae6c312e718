"""Plain least squares on recorded flights: what its sums remember, against convolutions and recursions."""

from statistics import NormalDist

import numpy as np
import pytest

from beaver_ftc_logs import detectors

DT_S, LENGTH = 0.5, 40  # 20 s


@pytest.fixture
def values():
    return np.random.default_rng(3).normal(size=(100, 2))


def test_a_sliding_memory_is_the_sum_of_the_last_20_s(values):
    found = detectors._memory_sums(values, DT_S, fades=False)
    expected = [values[max(k + 1 - LENGTH, 0) : k + 1].sum(axis=0) for k in range(len(values))]
    assert found == pytest.approx(np.array(expected), abs=1e-12)


def test_a_forgetting_memory_keeps_one_over_e_of_what_was_20_s_ago(values):
    found = detectors._memory_sums(values, DT_S, fades=True)
    age_s = DT_S * np.subtract.outer(np.arange(len(values)), np.arange(len(values)))
    weight = np.where(age_s >= 0.0, np.exp(-age_s / 20.0), 0.0)
    assert found == pytest.approx(weight @ values, abs=1e-12)


def test_bounds_hold_nine_in_ten():
    assert pytest.approx(NormalDist().inv_cdf(0.95), abs=1e-3) == detectors._SD_OF_90_PERCENT
