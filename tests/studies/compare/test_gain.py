"""`compare --tune --draw`: what retuning gains, from parts made by hand and on flights of their own."""

from math import exp, log, sqrt
from statistics import NormalDist

import numpy as np
import pytest

from beaver_ftc.plugins import DETECTORS, LAWS
from beaver_ftc.studies.compare import gain
from beaver_ftc.studies.compare.criteria import flights
from beaver_ftc.studies.compare.gain import JUDGED, gain_of, relative_gain
from beaver_ftc.studies.compare.trial import CALIBRATION, of_set, set_names


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


@pytest.mark.parametrize(("group", "costs"), [(DETECTORS, 1), (LAWS, JUDGED)])
def test_both_settings_fly_the_draws_after_the_one_that_tunes(monkeypatch, group, costs):
    made = []

    class Cost:
        def __init__(self, name, *given):
            assert name == "mine"
            made.append(given)

        def parts(self, values):
            return [values["a"], 2.0 * values["a"]]

    monkeypatch.setattr(gain, "DetectorCost", Cost)
    monkeypatch.setattr(gain, "LawCost", Cost)
    monkeypatch.setattr(gain, "flights", lambda grade, most, draw: (draw,))
    found = gain_of(group, "mine", "exact", ({"a": 0.0}, {"a": 0.0}), 3)
    draws = made[0][0] if group == DETECTORS else [given[-1] for given in made]
    assert (len(made), draws) == (costs, [*range(4, 4 + JUDGED)])
    assert (found["gain"], found["flights"], found["judged"]) == (0.0, 2 * costs, JUDGED)
    made.clear()
    found = gain_of(group, "mine", "exact", ({"a": 0.4}, {"a": 0.3}), 3)
    # parts of a and 2 a: their sum is 3 a, as logarithms their geometric mean is exp(1.5 a)
    sizes = (1.2, 0.9) if group == DETECTORS else (exp(0.6), exp(0.45))
    assert (found["built_in"], found["retuned"]) == pytest.approx(sizes)
    assert found["gain"] == pytest.approx(1.0 - sizes[1] / sizes[0])
    assert found["gain_low"] <= found["gain"] <= found["gain_high"]
    given = [("exact", None, draw) for draw in range(4, 4 + JUDGED)]
    assert group == DETECTORS or made == given
