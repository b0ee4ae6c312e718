"""A flight condition has what it is given; what is left out is neutral, or as usual."""

from beaver_ftc.aircraft import load
from beaver_ftc.plant.adapter import FlightState, neutral


def test_what_is_left_out_is_neutral_or_usual_whatever_else_is_given():
    surfaces, settings = neutral(load())
    both = FlightState(45.0, 1000.0)
    assert (both.surfaces_rad, both.settings) == (surfaces, settings)
    deflected = FlightState(45.0, 1000.0, surfaces_rad={"elevator": -0.05})
    assert (deflected.surfaces_rad, deflected.settings) == ({"elevator": -0.05}, settings)
    idle = FlightState(45.0, 1000.0, settings={"throttle": 0.1}, elevator_rad=-0.05)
    assert (idle.surfaces_rad, idle.settings) == ({**surfaces, "elevator": -0.05}, {"throttle": 0.1})
    assert (idle.elevator_rad, idle.throttle, idle.flap_rad) == (-0.05, 0.1, 0.0)
