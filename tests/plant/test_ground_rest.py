"""Newton's method for an aircraft at rest on its wheels: found where there is rest on both axes, else not."""

from math import radians

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


def test_it_is_put_onto_the_ground_as_it_is_told_in_still_air_and_the_air_comes_back():
    """Of the flight it is handed, surfaces and engine stay; the wheels carry it at 137 m."""
    plant = Plant(100)
    air = {"atmosphere/turb-type": 4.0, "atmosphere/gust-north-fps": 7.0, "atmosphere/gust-east-fps": -3.0,
           "atmosphere/gust-down-fps": 2.0}  # fmt: skip
    for name, value in air.items():
        plant.write(name, value)
    rolled = FlightState(
        45.0, 900.0, alpha_rad=0.1, beta_rad=0.2, phi_rad=0.3, theta_rad=0.4, psi_rad=0.5, rudder_rad=-0.11,
        elevator_rad=0.07, engine_rpm=900.0, manifold_pressure_inhg=13.0,
    )  # fmt: skip
    winds, hold = [], plant.hold
    plant.hold = lambda state: (winds.append([plant.read(name) for name in air]), hold(state))
    stand(plant, rolled, 137.0)
    assert set(map(tuple, winds)) == {(0.0, 0.0, 0.0, 0.0)}
    assert {name: plant.read(name) for name in air} == air
    for name in ("accelerations/wdot-ft_sec2", "accelerations/qdot-rad_sec2"):
        assert abs(plant.read(name)) < 1e-4, name
    found = [plant.read(name) for name in (
        "velocities/vt-fps", "attitude/phi-rad", "attitude/psi-rad", "fcs/rudder-pos-rad",
        "fcs/elevator-pos-rad", "engine/speed-rpm", "engine/manifold-pressure-inhg",
    )]  # fmt: skip
    assert found == pytest.approx([0.0, 0.0, 0.0, -0.11, 0.07, 900.0, 13.0], abs=1e-9)
    assert plant.read("position/terrain-elevation-asl-ft") * 0.3048 == pytest.approx(137.0)
    assert plant.read("position/h-sl-ft") * 0.3048 == pytest.approx(137.0 + 1.65, abs=0.03)
    assert plant.read("attitude/theta-rad") == pytest.approx(radians(11.5), abs=0.005)


def test_an_aircraft_that_never_rests_is_said(monkeypatch):
    monkeypatch.setattr(ground, "_finds_rest", lambda look, about: False)
    with pytest.raises(SimulationFailed, match=r"^beaver does not come to rest on its wheels$"):
        stand(Plant(100), FlightState(45.0, 900.0), 0.0)
