"""The kinematics the instruments are held against, by another road: rotation matrices and SciPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.diagnosis.monitors.sensor_records import STEP, TEST
from beaver_ftc.plant.instruments import N_SENSORS

RNG = np.random.default_rng(3)


def attitudes(count):
    """phi, theta, psi, rad."""
    return RNG.uniform([-1.5, -1.2, -3.0], [1.5, 1.2, 3.0], (count, 3))


def as_rotation(angles):
    phi, theta, psi = angles
    return Rotation.from_euler("ZYX", [psi, theta, phi])


@pytest.mark.parametrize("angles", attitudes(20))
def test_a_quaternion_is_the_rotation_of_its_angles(angles):
    out = np.zeros(4)
    redundancy.quaternion(*angles, out)
    ours = Rotation.from_quat([*out[1:], out[0]])
    assert (ours.inv() * as_rotation(angles)).magnitude() < 1e-14


@pytest.mark.parametrize("angles", attitudes(10))
def test_turning_and_looking_back_agree_with_rotations(angles):
    rates, h = RNG.uniform(-1.0, 1.0, 3), 0.01
    one, other = np.zeros(4), np.zeros(4)
    redundancy.quaternion(*angles, one)
    redundancy.turn(one, rates, h, other)
    size = np.linalg.norm(rates)
    by = Rotation.from_rotvec(rates / size * 2.0 * np.arctan(0.5 * h * size))
    turned = as_rotation(angles) * by
    assert (Rotation.from_quat([*other[1:], other[0]]).inv() * turned).magnitude() < 1e-14
    seen = [redundancy.angle_between(one, other, axis) for axis in (1, 2, 3)]
    assert seen == pytest.approx(2.0 * np.sin(by.magnitude() / 2.0) * rates / size, abs=1e-15)
    vector, back = RNG.normal(size=3), np.zeros(3)
    redundancy.turn_back(rates, h, vector, back)
    assert back == pytest.approx(by.inv().apply(vector), abs=1e-14)


def flown(attitude, alpha, beta, V, altitude, rates):
    signal = np.zeros(N_SENSORS)
    signal[:3], signal[3:6], signal[6] = rates, (alpha, beta, V), 1000.0
    signal[7:10], signal[10] = attitude, altitude
    return signal


def test_a_ball_thrown_into_the_air_is_predicted():
    """No force, no rotation: velocity falls, altitude and flow follow from mechanics in closed form."""
    step = np.zeros(1, STEP)[0]
    step["config"]["h"], step["config"]["gravity"] = 0.01, 9.8
    attitude, alpha, beta, V = np.array([0.3, 0.2, 1.0]), 0.1, 0.05, 45.0
    rotation = as_rotation(attitude)
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    redundancy.look(step, flown(attitude, alpha, beta, V, 1000.0, np.zeros(3)), np.zeros(3))
    step["memory"]["acceleration_then"] = step["memory"]["acceleration"]
    redundancy.predict(step)
    down = rotation.apply(v)[2]
    after = rotation.inv().apply(rotation.apply(v) + np.array([0.0, 0.0, 9.8 * 0.01]))
    predicted = step["memory"]["predicted"]
    assert predicted[3] == pytest.approx(np.arctan2(after[2], after[0]), abs=1e-14)
    assert predicted[4] == pytest.approx(np.arcsin(after[1] / np.linalg.norm(after)), abs=1e-14)
    assert predicted[5] == pytest.approx(np.linalg.norm(after), abs=1e-12)
    assert predicted[10] == pytest.approx(1000.0 - 0.01 * down, abs=1e-12)
    assert predicted[7:10] == pytest.approx(attitude, abs=1e-14)


def test_a_bound_covers_the_worst_course_of_what_it_is_told():
    """Extreme inputs, one by one: a residual is never beyond its bound, and can come near it."""
    test, step = np.zeros(1, TEST)[0], np.zeros(1, STEP)[0]
    step["config"]["h"], step["config"]["decay"] = 0.01, [np.exp(-pole * 0.01) for pole in (1e6, 10.0, 1.0)]
    test["noise_then"] = 0.02
    test["bound_noise"] = 0.02
    reading, largest = 0.02, 0.0
    for k in range(400):
        new = 0.02 * (1 if k % 2 else -1)
        test["residual"], test["rate"], test["noise"] = new - reading + 0.01 * 0.5, 0.5, 0.02
        reading = new
        redundancy.follow(step, test)
        largest = max(largest, test["share"])
    assert 0.9 < largest <= 1.0 + 1e-12
