"""The bank of filters by itself: convolutions, and what a fault can have done to it by corners."""

import numpy as np
import pytest
from kernels import DT, POLES, estimator, new_fdi, on, weights

from beaver_ftc.diagnosis.detection import filters, intervals


@pytest.mark.parametrize("seed", range(4))
def test_what_a_fault_can_have_done_is_the_filtered_extreme_of_what_it_does(seed):
    """By corners: theta at an end of its set or no fault at all, give or take the spread."""
    rng = np.random.default_rng(seed)
    fdi = new_fdi()
    fie = estimator(fdi, low=-1.0, high=0.5)
    effect, fie["parity_direction"] = fie["effect"], (0.6, 0.0, -0.8)
    effect["h"], effect["Z"] = 0.2 * rng.normal(size=3), rng.normal(size=3)
    effect["r"] = rng.uniform(0, 0.3, 3)
    for _ in range(3):
        on(intervals.advance_reach, fdi, fie)
    across = np.vstack([np.eye(3), fie["parity_direction"]])
    at_ends = [effect["h"] + theta * effect["Z"] for theta in (-1.0, 0.5)]
    does = np.array([*at_ends, np.zeros(3)]) @ across.T
    spread = np.abs(across) @ effect["r"]
    for m, decay in enumerate(np.exp(-POLES * DT)):
        kept = DT * weights(decay, 3).sum()
        assert fie["reach_lo"][m] == pytest.approx(kept * (does.min(axis=0) - spread))
        assert fie["reach_hi"][m] == pytest.approx(kept * (does.max(axis=0) + spread))


@pytest.mark.parametrize(("share", "axis"), [(1.0, -1), (-1.0, -1), (1.001, 1), (-1.001, 1)])
def test_a_filter_at_its_bound_is_within_and_beyond_it_alarms(share, axis):
    fdi = new_fdi()
    bank = fdi["bank"]["output"]
    bank["threshold"][:3] = 0.5
    bank["residual"][1, 1] = share * 0.5
    assert on(filters.bank_axis, fdi) == axis
