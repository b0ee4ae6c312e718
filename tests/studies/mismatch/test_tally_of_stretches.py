"""What is kept of a split flight, against the same over the whole flight at once."""

import numpy as np
import pytest

from beaver_ftc.studies.mismatch import split
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import UNEXPLAINED, Stretch

FRAME_S = 0.1
PLACE = ("airspeed_mps", "altitude_m", "alpha_rad")


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


def ratios(*shares, noted=None):
    """An axis' bound that has seen stretches of ratios."""
    bound, t_s = split.AxisBound() if noted is None else noted, 0.0
    for ratio in shares:
        n = len(ratio)
        times = t_s + FRAME_S * np.arange(n)
        place = np.stack([40.0 + times, 1000.0 + times, 0.1 + times], 1)
        none = {name: np.zeros((n, 3)) for name in SOURCES}
        none["sinusoids" if "sinusoids" in none else SOURCES[0]][:, 1] = 1.0
        stretch = _stretch(times, place, none)
        split._note(bound, np.array(ratio), stretch, 1, FRAME_S)
        t_s += FRAME_S * n
    return bound


def _stretch(t_s, place, contributions):
    stretch = object.__new__(Stretch)
    for name, value in (("t_s", t_s), ("place", place), ("contributions", contributions)):
        object.__setattr__(stretch, name, value)
    return stretch


def test_the_first_of_the_worst_is_noted_and_one_is_within():
    bound = ratios([0.5, 0.9, 0.9], [0.9, 0.2])
    assert (bound.worst_ratio, bound.worst_at_s) == (0.9, pytest.approx(0.1))
    assert (bound.exceeded_frames, bound.stays, bound.outside) == (0, 0, False)
    assert ratios([1.0, 1.0]).exceeded_frames == 0


def test_a_stay_that_goes_on_in_the_next_stretch_is_one():
    bound = ratios([0.5, 1.5], [2.5, 2.0, 0.5, 1.25], [0.5, 1.1])
    assert (bound.exceeded_frames, bound.stays, bound.outside) == (5, 3, True)
    first, second, third = bound.exceedances
    assert (first["start_s"], first["end_s"]) == (pytest.approx(0.1), pytest.approx(0.4))
    assert (first["peak_ratio"], first["peak_s"]) == (2.5, pytest.approx(0.2))
    assert (first["airspeed_mps"], first["altitude_m"], first["alpha_rad"]) == pytest.approx(
        (40.2, 1000.2, 0.3)
    )
    assert (second["start_s"], second["end_s"], second["peak_ratio"]) == (
        pytest.approx(0.5),
        pytest.approx(0.6),
        1.25,
    )
    assert (third["start_s"], third["end_s"]) == (pytest.approx(0.7), pytest.approx(0.8))


def test_a_stay_that_goes_on_lower_or_as_high_keeps_its_first_peak():
    for later in (1.25, 1.5):
        (stay,) = ratios([0.5, 1.5], [later, 0.5]).exceedances
        assert (stay["peak_ratio"], stay["peak_s"]) == (1.5, pytest.approx(0.1))
        assert stay["end_s"] == pytest.approx(0.3)


def test_of_very_many_stays_the_first_are_kept_and_all_are_counted():
    bound = ratios([1.5, 0.5] * split.MAX_EXCEEDANCES)
    assert (len(bound.exceedances), bound.stays) == (split.MAX_EXCEEDANCES, split.MAX_EXCEEDANCES)
    last = bound.exceedances[-1]["end_s"]
    ratios([1.5], [9.0, 0.5], noted=bound)
    assert (len(bound.exceedances), bound.stays) == (split.MAX_EXCEEDANCES, split.MAX_EXCEEDANCES + 1)
    assert bound.exceedances[-1]["end_s"] == last, "what goes on is another stay than the last one kept"


def test_a_flight_is_beyond_its_bound_if_any_axis_is():
    bounds = tuple(split.AxisBound(exceeded_frames=n) for n in (0, 3, 0))
    assert split.Tally(np.zeros(3), FRAME_S, bounds=bounds).exceeded
    assert not split.Tally(np.zeros(3), FRAME_S).exceeded
    assert UNEXPLAINED != split.TOTAL
