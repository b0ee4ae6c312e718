"""The search that tunes every method: its scales, its budget, its seed, and the edges of its ranges."""

from math import log

import numpy as np
import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import Range
from beaver_ftc.studies.compare.search import (
    SETTLED,
    WIDENINGS,
    on_edge,
    search,
)

WIDE = Range(1e-3, 1e3)


def bowl(**best):
    """A cost that is lowest, 1, at these values: squares of logarithms."""

    def cost(values):
        return 1.0 + sum((log(values[name]) - log(at)) ** 2 for name, at in best.items())

    return cost


@pytest.mark.parametrize("best", [{"a": 20.0}, {"a": 0.05, "b": 3.0}, {"a": 9.0, "b": 0.2, "c": 1.0}])
def test_the_lowest_cost_is_found_within_the_budget(best):
    tried = []
    cost = bowl(**best)
    ranges = dict.fromkeys(best, WIDE)
    found = search(
        lambda values: tried.append(values) or cost(values), ranges, dict.fromkeys(best, 1.0), 60, 7, 0
    )
    assert found.found == pytest.approx(best, rel=0.25)
    assert found.cost < found.start_cost
    assert 60 - len(best) <= len(tried) <= 60
    assert found.trials == len(tried)
    assert tried[0] == pytest.approx(dict.fromkeys(best, 1.0))


def test_a_seed_makes_the_same_search_again_and_another_one_another():
    def values(seed):
        return search(bowl(a=3.0, b=0.4), {"a": WIDE, "b": WIDE}, {"a": 1.0, "b": 1.0}, 30, seed, 1).found

    assert values(1) == values(1) != values(2)


def valley(values):
    """A narrow curved valley over wide ranges, in steps as costs of few flights have: lowest 0.292."""
    a, b, c, d = (log(values[name]) for name in "abcd")
    cost = 0.3 + 0.05 * (a - 1.0) ** 2 + 0.3 * (b - a) ** 2 + 0.2 * abs(c + 2.0 * a) + 0.1 * (d + 3.0) ** 2
    return round(24.0 * cost) / 24.0


def searched(seed, restarts):
    ranges = dict.fromkeys("abcd", Range(1e-3, 1e4))
    return search(valley, ranges, dict.fromkeys("abcd", 1.0), 24, seed, restarts)


def test_a_search_is_restarted_until_none_gains():
    """A stranger's search from the values found, with other seeds, then gains little; one without restarts
    leaves much."""
    once, whole = ([searched(seed, restarts) for seed in range(1, 600, 100)] for restarts in (0, 20))
    assert np.mean([found.cost for found in whole]) < 0.6 * np.mean([found.cost for found in once])
    for found in whole:
        assert found.settled
        assert SETTLED <= found.restarts < 20
    again = [search(valley, found.ranges, found.found, 50, 1234, 0).cost / found.cost for found in whole]
    assert np.mean(again) >= 0.85
    assert not any(found.settled for found in once)


def test_a_parameter_on_which_nothing_depends_stays_off_the_limits():
    found = search(bowl(a=3.0), {"a": WIDE, "idle": WIDE}, {"a": 1.0, "idle": 900.0}, 60, 1, 0)
    assert found.found["a"] == pytest.approx(3.0, rel=0.3)
    assert not on_edge(found.found, found.ranges)
    assert found.widened == ()


def test_a_range_that_holds_the_result_at_its_limit_is_widened():
    narrow = Range(0.1, 10.0)
    found = search(bowl(a=30.0), {"a": narrow}, {"a": 1.0}, 40, 1, 0)
    assert found.found["a"] == pytest.approx(30.0, rel=0.1)
    assert (found.widened, found.ranges["a"].low) == (("a",), 0.1)
    assert found.start_cost == pytest.approx(1.0 + log(30.0) ** 2)
    assert found.ranges["a"].high == pytest.approx(100.0, rel=1e-3)


def test_a_result_that_runs_from_every_limit_is_refused():
    with pytest.raises(SimulationFailed, match=rf"on the edge of its range after {WIDENINGS} widenings: a"):
        search(lambda values: -log(values["a"]), {"a": Range(0.5, 2.0)}, {"a": 1.0}, 20, 1, 0)
