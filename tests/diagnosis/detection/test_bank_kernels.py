"""The bank of filters by itself: convolutions, and what a fault can have done to it by corners."""

import numpy as np
import pytest
from kernels import DT, POLES, estimator, new_fdi, on, weights

from beaver_ftc.diagnosis.detection import filters


def with_shares(*shares):
    """A bank whose filters (m, 3) reach these shares of their bounds."""
    fdi = new_fdi()
    shares = np.array(shares)
    fdi["bank"]["output"]["threshold"][:3] = [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]
    fdi["bank"]["output"]["residual"][:3] = shares * fdi["bank"]["output"]["threshold"][:3]
    return fdi


CALM, LEAVES = [[0.1, -0.2, 0.3]] * 3, [[0.1, 0.5, 0.2], [0.3, -1.5, 0.1], [0.4, 1.1, 1.2]]


def test_the_alarm_is_of_the_first_axis_on_which_a_filter_leaves_its_bound():
    assert on(filters.bank_axis, with_shares(*CALM)) == -1
    assert on(filters.bank_axis, with_shares([1.0, -1.0, 1.0], *CALM[:2])) == -1  # at its bound is within
    assert on(filters.bank_axis, with_shares(*LEAVES)) == 1
    assert [filters.nearest_filter(with_shares(*LEAVES)["bank"], i) for i in range(3)] == [2, 1, 2]
    assert on(filters.bank_share, with_shares(*LEAVES)) == pytest.approx(1.5)


def reach_of(offset, Z, spread, low=-1.0, high=0.5, across=(0.6, 0.0, -0.8)):
    fdi = new_fdi()
    fie = estimator(fdi, low=low, high=high)
    (
        fie["effect"]["base"],
        fie["effect"]["regressor"],
        fie["effect"]["e"],
    ) = (
        offset,
        Z,
        spread,
    )
    fie["parity_direction"] = across
    return fdi, fie


@pytest.mark.parametrize("seed", range(4))
def test_what_a_fault_can_have_done_is_the_filtered_extreme_of_what_it_does(seed):
    """By corners: theta at an end of its set or no fault at all, give or take the spread."""
    rng = np.random.default_rng(seed)
    fdi, fie = reach_of(0.2 * rng.normal(size=3), rng.normal(size=3), rng.uniform(0, 0.3, 3))
    for _ in range(3):
        on(filters.advance_reach, fdi, fie)
    effect, across = fie["effect"], np.vstack([np.eye(3), fie["parity_direction"]])
    at_ends = [effect["base"] + theta * effect["regressor"] for theta in (-1.0, 0.5)]
    does = np.array([*at_ends, np.zeros(3)]) @ across.T
    spread = np.abs(across) @ effect["e"]
    for m, decay in enumerate(np.exp(-POLES * DT)):
        kept = DT * weights(decay, 3).sum()
        assert fie["reach_lo"][m] == pytest.approx(kept * (does.min(axis=0) - spread))
        assert fie["reach_hi"][m] == pytest.approx(kept * (does.max(axis=0) + spread))


@pytest.mark.parametrize("m", range(3))
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_fault_explains_what_is_within_its_reach_and_the_bound(m, axis, side):
    def explained(beyond, ignored_axes=False):
        fdi, fie = reach_of(0.0, 0.0, 0.0, across=(0.0, 0.0, 0.0))
        (
            fie["reach_lo"],
            fie["reach_hi"],
            fdi["bank"]["output"]["threshold"],
        ) = (
            -0.3,
            0.5,
            0.1,
        )
        fie["skip"][axis] = ignored_axes
        limit = -0.4 if side < 0 else 0.6
        fdi["bank"]["output"]["residual"][m, axis] = limit + side * beyond
        return bool(on(filters.is_reachable, fdi, fie, True))

    assert explained(-1e-9)
    assert not explained(1e-9)
    assert explained(1e-9, ignored_axes=True)
