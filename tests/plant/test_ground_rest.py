"""Newton's method for an aircraft at rest on its wheels: found where there is rest on both axes, else not."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plant import ground
from beaver_ftc.plant.adapter import FlightState, Plant
from beaver_ftc.plant.ground import _finds_rest, stand

ABOUT = np.array([101.5, 0.2])  # height, m, and pitch, rad


@pytest.mark.parametrize(
    ("look", "rests"),
    [
        (lambda x: np.array([3.0 * (x[0] - 101.2) + 0.4 * x[1], 0.1 * (x[0] - 101.2) - 7.0 * x[1]]), True),
        (lambda x: np.array([x[0] - 101.2 + x[1] ** 2, np.sin(x[1]) - 0.1]), True),
        (lambda x: np.array([x[0] - 101.5, 0.3 + (x[1] - 0.2) ** 2]), False),  # never without a moment
        (lambda x: np.array([0.5 + (x[0] - 101.5) ** 2, x[1] - 0.2]), False),  # never carried
    ],
)
def test_rest_is_where_neither_force_nor_moment_is_left(look, rests):
    seen = []

    def recorded(x):
        seen.append(look(x))
        return seen[-1]

    assert _finds_rest(recorded, ABOUT) is rests
    assert bool(np.abs(seen[-1]).max() <= 1e-5) is rests


def test_an_aircraft_that_never_rests_is_said(monkeypatch):
    monkeypatch.setattr(ground, "_finds_rest", lambda look, about: False)
    with pytest.raises(SimulationFailed, match=r"^beaver does not come to rest on its wheels$"):
        stand(Plant(100), FlightState(45.0, 900.0), 0.0)
