"""What a surface cannot have done: directions in which its fault, whatever its course, shows nothing."""

from statistics import NormalDist

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.studies.matrix.fault_matrix import declared
from flying import SINES, scenario

AIRCRAFT = load()
AILERON, ELEVATOR, RUDDER, FLAP = range(4)
PITCH_AXIS, ROLL_AXIS, YAW_AXIS, PAST_AILERON, PAST_RUDDER = range(5)
FLOW = np.array([0.05, 0.0, 45.0, 1200.0, 0.1])  # alpha, beta, airspeed, pressure, dpt
G = np.array([[-9.0, 0.0, 1.2, 0.0], [0.0, -8.0, 0.0, -1.5], [-0.4, 0.0, -3.0, 0.0]])


@pytest.mark.parametrize(
    ("changes", "instants", "counts"),
    [
        ({}, 1, True), ({"authority": "statistical"}, 1, True), ({}, 0, True), ({}, 2, False),
        ({"pairs": True}, 1, False), ({"authority": "worst-case"}, 1, False),
        ({"fault_class": "published"}, 1, False),
    ],
)  # fmt: skip
def test_views_are_there_only_where_something_is_concluded_from_them(changes, instants, counts):
    """Of two faults one may move what the other does not; within a frame of instants a column turns."""
    config = FdiConfig.model_validate({"fault_class": "all", "statistical": {}, **changes})
    assert config.compares_across(instants) == counts


@pytest.mark.parametrize("substeps", [1, 2])
def test_a_flight_has_them_or_not(substeps):
    loop = Loop(scenario(duration_s=1, substeps=substeps, **declared("light")))
    detector = loop.frames["fdi"]["statistical"][0]
    assert detector["n_views"] == (13 if substeps == 1 else 0)
    # one share of the false alarms each, of a tone as of a step: exp(-l^2 / 2) beyond a level l of two parts
    share = NormalDist().cdf(-detector["test"]["alarm_level"]) if substeps == 1 else 1.0
    assert np.exp(-(detector["tone_test_config"]["alarm_level"] ** 2) / 2.0) == pytest.approx(share, rel=1e-6)
    loop.release()


def test_in_moving_air_no_view_of_pitch_tries_what_answers_the_gusts():
    """A law that goes by the vanes moves the elevator before the gyros feel a gust."""
    loop = Loop(scenario(duration_s=1, **declared("light")))
    views = loop.frames["fdi"]["statistical"]["views"][0]
    assert [int(view["block"]["n_h"]) for view in views[:5]] == [1, 3, 3, 2, 2]
    loop.release()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_rudder_that_floats_in_a_gust_stays_a_candidate(seed):
    """With ideal gyros at 200 Hz the elevator, which answered the gusts, ruled it out within seconds."""
    flown = fly(scenario(
        duration_s=6, rate_hz=201, seed=seed, initial={"airspeed_mps": 51.7, "altitude_m": 2138},
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
    flight = fly(scenario(**declared("light") | given))
    assert flight.detection_time_s > 6.0
    named = {flight.isolated} if flight.isolated else {word.split(":")[0] for word in flight.candidates}
    assert named == left
