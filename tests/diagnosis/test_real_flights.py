"""Real sensors, servos, coefficients and air, flown: what is declared raises no alarm, a fault does."""

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import Scenario
from flying import SINES, Memory

COEFFICIENTS = {"Cm_alpha": 1.05, "Cm_de": 0.95, "Cl_p": 0.95, "Cl_da": 1.05, "Cn_p": 1.05, "Cm_0": 1.05}
CONDITIONS = {
    "tactical": ({"sensors": "tactical-grade"}, {"sensors": "tactical-grade"}),
    "consumer": ({"sensors": "consumer-grade"}, {"sensors": "consumer-grade"}),
    "servo": ({"actuators": "servo"}, {}),
    "slow servo in coarse frames": ({"actuators": {"bandwidth_rad_s": 10}, "rate_hz": 50, "substeps": 4}, {}),
    "coefficients": ({"uncertainty": {"coefficients": COEFFICIENTS}}, {"coefficients": 0.05}),
    "inertia": ({"uncertainty": {"inertia": {"Ix": 1.05, "Iy": 0.95, "Iz": 1.05}}}, {"inertia": 0.05}),
    "air": ({"environment": {"turbulence": "dryden", "severity": "light"}}, {"turbulence": "light"}),
    "gust": ({"environment": {"gust": {"at_s": 3, "velocity_mps": [0, 4, -6]}, "wind_mps": [9, 3, 1]}}, {}),
}
LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": 6.0}


def flight(truth, bounds, **more):
    given = {"name": "x", "duration_s": 12, "reference": SINES, "fdi": {"bounds": bounds}, **truth, **more}
    return Scenario.model_validate(given)


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_declared_raises_no_alarm(condition, seed):
    flown = fly(flight(*CONDITIONS[condition], seed=seed))
    assert flown.detection_time_s is None
    assert flown.worst_residual_ratio < 1.0


@pytest.mark.parametrize("condition", ["tactical", "consumer", "coefficients", "air"])
def test_the_same_undeclared_does(condition):
    assert fly(flight(CONDITIONS[condition][0], {})).detection_time_s is not None


@pytest.mark.parametrize("condition", [c for c in CONDITIONS if c not in ("air", "consumer", "gust")])
def test_a_lost_elevator_is_found_and_named(condition):
    flown = fly(flight(*CONDITIONS[condition], faults=[LOSS]))
    assert 6.0 <= flown.detection_time_s < 7.5
    assert flown.isolated == "elevator"


def test_the_model_of_a_servo_is_where_the_servo_is():
    memory = Memory()
    truth = {"actuators": {"bandwidth_rad_s": 15, "rate_limit_deg_s": 6}}
    fly(flight(truth, {"constant_rad_s2": {"p": 1e-9, "q": 1e-9, "r": 1e-9}}), memory)
    lag = np.abs(memory["elevator_cmd_rad"] - memory["elevator_pos_rad"]).max()
    assert lag > 1e-3
    for axis in "pqr":
        assert (
            np.abs(memory[f"{axis}_residual_rad_s"]).max() < 5e-6
        )  # the Earth turns; the lag alone would give 1e-3


def test_the_same_seed_flies_the_same_flight_and_another_does_not():
    truth = {"sensors": "consumer-grade", "environment": {"turbulence": "dryden", "severity": "light"}}
    logs = [Memory() for _ in range(3)]
    for seed, memory in zip((4, 4, 5), logs, strict=True):
        fly(flight(truth, {}, seed=seed, duration_s=3), memory)
    assert np.array_equal(logs[0].rows, logs[1].rows, equal_nan=True)
    assert not np.array_equal(logs[0]["q_measured_rad_s"], logs[2]["q_measured_rad_s"])


def test_noise_travels_the_surfaces_little():
    """Noise times the published law's gain is all that moves a surface: |n' - n| times Kp / G a frame."""
    law = {"control": {"law": "fault-tolerant-published"}}
    still, noisy = (fly(flight(truth, bounds, **law)) for truth, bounds in (({}, {}), CONDITIONS["tactical"]))
    added = noisy.surface_travel_rad["elevator"] - still.surface_travel_rad["elevator"]
    sigma, frames, gain = np.radians(0.0208), 1200, 6.0 / 9.0  # (Kp + pitch damping) / |G|, about
    assert 0.0 < added < 2.0 * gain * frames * sigma * 2 / np.sqrt(np.pi)
