"""What is kept of a split flight, against the same over the whole flight at once."""

import numpy as np
import pytest

from beaver_ftc.studies.mismatch import split

FRAME_S = 0.1


def test_figures_are_those_of_all_frames_whatever_the_stretches():
    rng = np.random.default_rng(4)
    values, bound = rng.normal(size=(40, 3)), rng.uniform(0.5, 2.0, (40, 3))
    values[3], bound[3] = 0.0, 0.0  # nothing of nothing is no share
    figures = split.Figures()
    for part in (slice(0, 7), slice(7, 8), slice(8, 40)):
        figures.add(values[part], bound[part])
    share = np.abs(values) / np.where(bound > 0.0, bound, 1.0)
    assert figures.square_sum == pytest.approx((values**2).sum(axis=0))
    assert figures.largest == pytest.approx(np.abs(values).max(axis=0))
    assert figures.bound_share == pytest.approx(share.max(axis=0))


def test_something_beside_a_bound_of_nothing_is_beyond_it():
    figures = split.Figures()
    figures.add(np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3)))
    assert figures.bound_share.tolist() == [np.inf, 0.0, 0.0]


def test_a_flight_is_beyond_its_bound_if_any_axis_is():
    bounds = tuple(split.AxisBound(exceeded_frames=n) for n in (0, 3, 0))
    assert split.Tally(np.zeros(3), FRAME_S, bounds=bounds).exceeded
    assert not split.Tally(np.zeros(3), FRAME_S).exceeded
