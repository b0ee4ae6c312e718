"""The search that tunes every method: its scales, its budget, its seed, and the edges of its ranges."""

from math import log, sqrt

import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import Range
from beaver_ftc.studies.compare.search import WIDENINGS, on_edge, on_scale, search, value_at

WIDE = Range(1e-3, 1e3)


def bowl(**best):
    """A cost that is lowest, 1, at these values: squares of logarithms."""

    def cost(values):
        return 1.0 + sum((log(values[name]) - log(at)) ** 2 for name, at in best.items())

    return cost


def test_scales_go_from_limit_to_limit():
    assert value_at(WIDE, 0.5) == pytest.approx(1.0)
    odds = Range(0.5, 0.999, "odds")
    middle = value_at(odds, 0.5)
    assert middle / (1.0 - middle) == pytest.approx(sqrt(1.0 * 999.0))
    for of in (WIDE, odds):
        assert [on_scale(of, value_at(of, place)) for place in (0.0, 0.3, 1.0)] == pytest.approx(
            [0.0, 0.3, 1.0]
        )


@pytest.mark.parametrize("best", [{"a": 20.0}, {"a": 0.05, "b": 3.0}, {"a": 9.0, "b": 0.2, "c": 1.0}])
def test_the_lowest_cost_is_found_within_the_budget(best):
    tried = []
    cost = bowl(**best)
    ranges = dict.fromkeys(best, WIDE)
    found = search(
        lambda values: tried.append(values) or cost(values), ranges, dict.fromkeys(best, 1.0), 60, 7
    )
    assert found.values == pytest.approx(best, rel=0.25)
    assert found.cost < found.start_cost
    assert 60 - len(best) <= len(tried) <= 60
    assert found.trials == len(tried)
    assert tried[0] == pytest.approx(dict.fromkeys(best, 1.0))


def test_a_seed_makes_the_same_search_again_and_another_one_another():
    def values(seed):
        return search(bowl(a=3.0, b=0.4), {"a": WIDE, "b": WIDE}, {"a": 1.0, "b": 1.0}, 30, seed).values

    assert values(1) == values(1) != values(2)


def test_a_parameter_on_which_nothing_depends_stays_off_the_limits():
    found = search(bowl(a=3.0), {"a": WIDE, "idle": WIDE}, {"a": 1.0, "idle": 900.0}, 60, 1)
    assert found.values["a"] == pytest.approx(3.0, rel=0.3)
    assert not on_edge(found.values, found.ranges)
    assert found.widened == ()


def test_a_range_that_holds_the_result_at_its_limit_is_widened():
    narrow = Range(0.1, 10.0)
    found = search(bowl(a=30.0), {"a": narrow}, {"a": 1.0}, 40, 1)
    assert found.values["a"] == pytest.approx(30.0, rel=0.05)
    assert (found.widened, found.ranges["a"].low) == (("a",), 0.1)
    assert found.start_cost == pytest.approx(1.0 + log(30.0) ** 2)
    assert found.ranges["a"].high == pytest.approx(100.0, rel=1e-3)


def test_a_result_that_runs_from_every_limit_is_refused():
    with pytest.raises(SimulationFailed, match=rf"on the edge of its range after {WIDENINGS} widenings: a"):
        search(lambda values: -log(values["a"]), {"a": Range(0.5, 2.0)}, {"a": 1.0}, 20, 1)
