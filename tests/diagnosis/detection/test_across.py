"""What a surface cannot have done: directions in which its fault, whatever its course, shows nothing."""

import pytest

from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.studies.matrix.fault_matrix import declared_errors
from flying import SINES, scenario


def test_in_moving_air_no_view_of_pitch_tries_what_answers_the_gusts():
    """A law that goes by the vanes moves the elevator before the gyros feel a gust."""
    loop = Loop(scenario(duration_s=1, **declared_errors("light")))
    views = loop.frames["fdi"]["statistical"]["views"][0]
    assert [int(view["block"]["n_h"]) for view in views[:5]] == [1, 3, 3, 2, 2]
    loop.release()


def test_a_rudder_that_floats_in_a_gust_stays_a_candidate():
    """With ideal gyros at 200 Hz the elevator, which answered the gusts, ruled it out within seconds."""
    flown = fly(scenario(
        duration_s=6, rate_hz=201, seed=1, initial={"airspeed_mps": 51.7, "altitude_m": 2138},
        uncertainty={},
        faults=[{"actuator": "rudder", "type": "float", "at_s": 2}], control={"law": "nominal"},
        environment={"turbulence": "dryden", "severity": "light"},
        fdi={
            "fault_class": "all", "statistical": {}, "authority": "statistical",
            "bounds": {"turbulence": "light"},
        },
    ))  # fmt: skip
    assert flown.detection_time_s is not None
    assert flown.isolated in ("rudder", None)


@pytest.mark.parametrize(
    ("fault", "left"),
    [
        ({"actuator": "elevator", "type": "bias", "bias_deg": 3.0}, {"elevator"}),
        ({"actuator": "rudder", "type": "loss_of_effectiveness", "magnitude": 0.7}, {"rudder"}),
        ({"actuator": "aileron", "type": "stuck", "position_deg": 5.0}, {"aileron"}),
    ],
)
def test_in_declared_turbulence_a_fault_is_left_to_those_that_can_have_done_it(fault, left):
    given = {"duration_s": 16, "seed": 12, "reference": SINES, "faults": [fault | {"at_s": 6}]}
    flight = fly(scenario(**declared_errors("light") | given))
    assert flight.detection_time_s > 6.0
    named = {flight.isolated} if flight.isolated else {word.split(":")[0] for word in flight.candidates}
    assert named == left
