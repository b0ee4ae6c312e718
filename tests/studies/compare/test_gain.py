"""`compare --tune --draw`: what retuning gains, from parts made by hand and on flights of their own."""

from math import exp, log, sqrt
from statistics import NormalDist

import numpy as np
import pytest

from beaver_ftc.studies.compare import gain
from beaver_ftc.studies.compare.criteria import flights
from beaver_ftc.studies.compare.gain import JUDGED, relative_gain
from beaver_ftc.studies.compare.sets import CALIBRATION, of_set, set_names


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [([2.0, 4.0], [1.0, 2.0], 0.5), ([1.0, 3.0], [1.0, 3.0], 0.0), ([0.0, 0.0], [0.0, 0.0], 0.0),
     ([0.0, 0.0], [1.0, 1.0], -np.inf), ([1.0, 1.0], [2.0, 2.0], -1.0)],
)  # fmt: skip
def test_the_gain_is_the_share_that_is_saved(before, after, expected):
    found = relative_gain(np.array(before), np.array(after), np.sum)
    assert (found.value, found.low, found.high) == (expected,) * 3


def test_its_interval_is_that_of_the_mean_of_pairs():
    """Of a geometric mean the limits are those of the mean logarithm of the pairs' ratios."""
    rng = np.random.default_rng(7)
    before = rng.normal(0.0, 3.0, 400)
    ratios = rng.normal(log(0.9), 0.2, 400)
    found = relative_gain(before, before + ratios, gain.geometric_mean)
    half = NormalDist().inv_cdf(0.975) * ratios.std() / sqrt(400)
    assert found.value == pytest.approx(1.0 - exp(ratios.mean()))
    assert found.low == pytest.approx(1.0 - exp(ratios.mean() + half), abs=0.005)
    assert found.high == pytest.approx(1.0 - exp(ratios.mean() - half), abs=0.005)


def test_every_draw_has_flights_that_no_other_draw_and_no_table_has():
    seeds = [{case.scenario.seed for case in flights("exact", None, draw)} for draw in range(2 + JUDGED)]
    seeds += [{case.scenario.seed for case in of_set(name)} for name in set_names()]
    assert len(set().union(*seeds)) == sum(map(len, seeds))
    assert of_set(CALIBRATION + "exact", 1) == of_set(CALIBRATION + "exact", 1, 0)


def test_several_draws_together_are_the_flights_of_each():
    seeds = [
        sorted(case.scenario.seed for case in flights("exact", None, *draws))
        for draws in ((3,), (4,), (3, 2))
    ]
    assert sorted(seeds[0] + seeds[1]) == seeds[2]
