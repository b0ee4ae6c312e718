"""What the accelerometers tell in flight: whose fault it is, and that it is no vane's."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.detection.blocks import SIDE_FORCE
from beaver_ftc.diagnosis.detection.rows import INERTIAL, RAW
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.studies.matrix.fault_matrix import declared_errors
from flying import SINES, scenario

FAULTS = {
    "elevator": {"actuator": "elevator", "type": "bias", "bias_deg": 2.0},
    "flap": {"actuator": "flap", "type": "bias", "bias_deg": 2.0},
    "rudder": {"actuator": "rudder", "type": "bias", "bias_deg": 2.0},
    "swinging flap": {
        "actuator": "flap", "type": "oscillatory", "amplitude_deg": 0.5, "frequency_rad_s": 10.0
    },
}  # fmt: skip


def flown(fault=None, turbulence="none", **changes):
    faults = [fault | {"at_s": 6.0}] if fault else []
    given = {"duration_s": 12, "reference": SINES, "faults": faults}
    return scenario(**declared_errors(turbulence) | given | changes)


def test_jsbsim_s_forces_are_those_of_the_aircraft_s_file():
    """Without errors next to nothing is left, in flight with rates and sideslip."""
    everything = {"fault_class": "all", "statistical": {}}
    loop = Loop(flown(sensors="ideal", uncertainty={}, actuators="ideal", fdi=everything))
    left, rows = [], loop.frames["fdi"]["statistical"]["rows"][0]
    for k in range(300):
        loop.sample_references(k, 1)
        loop.fly_frames(1, 1 if k else 0)
        left.append((*rows["nu"][RAW, SIDE_FORCE:], *rows["nu"][INERTIAL, SIDE_FORCE:]))
    loop.release()
    assert np.abs(loop.frames["measured"]["force"][0]).max() > 8.0
    assert np.abs(left)[:, :2].max() < 1e-4
    assert np.abs(left).max() < 0.03, "followed for three seconds"


@pytest.mark.parametrize("name", FAULTS)
def test_elevator_and_flap_are_told_apart_by_their_lift_and_the_rudder_is_seen_by_its_side_force(name):
    """With sound sensors: a force alone raises no alarm if the accelerometers may break."""
    given = flown(FAULTS[name])
    flight = fly(given.with_({"fdi.sensor_monitor": "never"}))
    assert 6.0 < flight.detection_time_s < 8.0
    assert flight.isolated == FAULTS[name]["actuator"]


def test_a_healthy_flight_with_wrong_forces_stays_quiet():
    """Coefficients of the forces off by their tolerance, and a mass that nobody declares."""
    wrong = {"CZ_alpha": 1.05, "CZ_df": 0.95, "CY_beta": 0.95, "CY_dr": 1.05}
    flight = fly(flown(uncertainty={"coefficients": wrong, "mass": 1.04}))
    assert flight.detection_time_s is None


@pytest.mark.parametrize("sensor", ["alpha", "beta"])
@pytest.mark.parametrize("course", [{"type": "bias", "magnitude": 0.5}, {"type": "freeze"}])
def test_a_vane_that_fails_is_no_surface(sensor, course):
    flight = fly(flown({"sensor": sensor, **course}))
    assert flight.isolated not in FAULTS
    assert flight.isolated != "aileron"
