"""The learned example: its level by conformal prediction, its network as scikit-learn's, a flight with it."""

import sys
from pathlib import Path

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from flying import loss, scenario

EXAMPLE = Path(__file__).parents[2] / "examples" / "learned-detector"


@pytest.fixture(scope="module")
def learned():
    """The package and its training, imported from the example's folder."""
    pytest.importorskip("sklearn")
    sys.path.insert(0, str(EXAMPLE / "src"))
    try:
        import learned_detector
        from learned_detector import train
    finally:
        sys.path.pop(0)
    return learned_detector, train


def flights(n, faulted):
    """Short flights at airspeeds of their own, the surfaces in turn."""
    surfaces = ("aileron", "elevator", "rudder")
    given = {"duration_s": 3, "rate_hz": 50}
    return [
        scenario(
            initial={"airspeed_mps": 42 + i % 7}, seed=i, **given,
            faults=[loss(surfaces[i % 3], 0.9, at_s=1.5)] if faulted else [],
        )
        for i in range(n)
    ]  # fmt: skip


@pytest.mark.parametrize(("n", "alpha", "rank"), [(9, 0.1, 9), (19, 0.1, 18), (99, 0.05, 95)])
def test_a_level_is_the_order_statistic_that_keeps_the_rate(learned, n, alpha, rank):
    values = np.random.default_rng(3).permutation(n) + 1.0
    assert learned[1].conformal_level(values, alpha) == rank


def test_a_network_trained_on_few_flights_finds_what_it_has_seen(learned):
    """A few seconds of training; its products are scikit-learn's own probabilities."""
    package, train = learned
    network = train.calibrated(train.fit(flights(9, True)), flights(9, False), 0.1)
    assert network.level > 0.0

    class Trained(package.LearnedNetwork):
        pass

    Trained.network = network
    named = [fly(each, detector=Trained()) for each in flights(3, True)]
    assert [flight.isolated for flight in named].count("aileron") <= 1
    assert sum(flight.detection_time_s is not None for flight in named) >= 2
