"""What the accelerometers tell in flight: whose fault it is, and that it is no vane's."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.diagnosis.detection import forces
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_M_S2
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.studies.matrix.fault_matrix import declared
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
    return scenario(**declared(turbulence) | given | changes)


def test_jsbsim_s_forces_are_those_of_the_aircraft_s_file():
    """Without errors next to nothing is left, in flight with rates and sideslip."""
    everything = {"fault_class": "all", "statistical": {}}
    loop = Loop(flown(sensors="ideal", uncertainty={}, actuators="ideal", fdi=everything))
    left, forces = [], loop.frames["fdi"]["statistical"]["forces"][0]
    for k in range(300):
        loop.sample_references(k, 1)
        loop.fly_frames(1, 1 if k else 0)
        left.append((*forces["component"]["innovation"], *forces["component"]["e_inertial"]))
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


def test_how_fast_a_flow_angle_may_drift_is_by_gyros_attitude_and_accelerometers():
    """Of the incidence with slopes of the path and of the normal accelerometer; of sideslip in full."""
    steady = {
        "phi": 0.011,
        "theta": 0.013,
        "p": 0.001,
        "q": 0.002,
        "r": 0.004,
        "ax": 0.3,
        "ay": 0.5,
        "az": 0.7,
    }
    slopes = {"p": 0.01, "q": 0.02, "r": 0.04, "ay": 0.08, "az": 0.16}
    errors = {
        name: SimpleNamespace(steady=value, slope=slopes.get(name, 9.0)) for name, value in steady.items()
    }
    gyros = 0.007 + 0.2 * 0.07
    side = 9.7 * 0.024 + 0.5 + 0.3 * 0.3 + EARTH_M_S2
    normal = 0.3 * 9.7 * 0.024 + 0.7 + 0.3 * 0.3 + 9.7 * 0.16 + EARTH_M_S2
    for component, acceleration in (
        (forces.SIDE_INDEX, side),
        (forces.NORMAL_INDEX, normal),
    ):
        found = forces._drift_bound(errors, 9.7, 45.0, component)
        assert found == pytest.approx(EARTH_RATE_RAD_S + gyros + acceleration / 45.0)
