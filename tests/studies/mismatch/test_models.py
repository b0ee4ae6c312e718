"""The many-frames models of the analysis against the compiled design model, Euler and a turning Earth."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import anchor, anchored, design_of, inertia_coefficients, response
from beaver_ftc.studies.mismatch import models
from beaver_ftc.studies.mismatch.models import DesignModelOfFlight, designed_moments
from beaver_ftc.studies.mismatch.sources import (
    EARTH_RATE_RAD_S,
    HealthyActuators,
    earth_in_body,
    earth_rotation,
)
from flying import scenario

DATA = Path(__file__).parents[2] / "data"
INERTIA = np.array([
    [MASS.Ix_kg_m2, 0.0, -MASS.Jxz_kg_m2], [0.0, MASS.Iy_kg_m2, 0.0], [-MASS.Jxz_kg_m2, 0.0, MASS.Iz_kg_m2],
])  # fmt: skip
DESIGNS = (
    {}, {"engine_terms": False}, {"frozen_alpha": True}, {"linearised": True},
    {"linearised": True, "frozen_alpha": True},
    {"mass": 1.2, "inertia": {"Ix": 0.8, "Jxz": -2.0}, "coefficients": {"Cl_p": 0.7, "Cm_q": 1.3}},
)  # fmt: skip


def random_states(n=40, seed=3):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-0.5, 0.5, (n, 3))
    y = np.column_stack([
        rng.uniform(-0.1, 0.3, n), rng.uniform(-0.3, 0.3, n), rng.uniform(30, 55, n),
        rng.uniform(400, 1900, n), rng.uniform(0.1, 4.0, n),
    ])  # fmt: skip
    return x, y, rng.uniform(-0.4, 0.4, (n, 4))


@pytest.mark.parametrize("keys", DESIGNS)
def test_belief_is_what_the_compiled_loop_evaluates(keys):
    case = scenario(design_model=keys)
    x, y, u = random_states()
    design = design_of(case.design_model)[0]
    anchor(design, x[0], y[0], u[0])
    found = DesignModelOfFlight(designed_moments(case), anchored(design))
    record = np.array([design]).view(np.recarray)[0]
    for k in range(len(x)):
        f, G = np.zeros(3), np.zeros((3, 4))
        response(record, x[k], y[k], f, G)
        one = slice(k, k + 1)
        assert found.acceleration(x[one], y[one], u[one])[0] == pytest.approx(
            f + G @ u[k], rel=1e-12, abs=1e-12
        )
        assert found.effectiveness(y[one])[0] == pytest.approx(G, rel=1e-12, abs=1e-10)


def test_inertial_part_is_eulers_equation():
    x, _, _ = random_states()
    euler = [np.linalg.solve(INERTIA, -np.cross(w, INERTIA @ w)) for w in x]
    assert models.inertial(inertia_coefficients(MASS), x) == pytest.approx(
        np.array(euler), rel=1e-9, abs=1e-12
    )


def test_weights_are_the_inverse_inertia():
    """A unit of Cl, Cm, Cn is a moment qdyn S (b, c, b) about x, y, z."""
    for i, (name, length) in enumerate((("Cl", 14.63), ("Cm", 1.5875), ("Cn", 14.63))):
        moment = 900.0 * 23.23 * length * np.eye(3)[i]
        found = models.weights(inertia_coefficients(MASS), name, np.array([900.0]))[0]
        assert found == pytest.approx(np.linalg.solve(INERTIA, moment), rel=1e-12, abs=1e-12)


def test_the_terms_of_all_moments_are_those_of_the_table():
    assert len(models.MOMENT_TERMS) == 26
    assert models.ENGINE_TERMS == ("Cl_a2dpt", "Cm_dpt", "Cn_dpt3")


@given(st.tuples(*[st.floats(-3, 3)] * 3), st.floats(-1.5, 1.5))
def test_earth_in_body_is_a_rotation_of_the_earths(attitude, latitude):
    phi, theta, psi = attitude
    ned = EARTH_RATE_RAD_S * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    expected = Rotation.from_euler("ZYX", [psi, theta, phi]).inv().apply(ned)
    found = earth_in_body(np.array([attitude]), np.array([latitude]))[0]
    assert found == pytest.approx(expected, abs=1e-18)


def test_a_body_at_rest_among_the_stars_keeps_its_rates_against_the_earth():
    attitude, latitude = np.array([[0.4, -0.3, 2.0]]), np.array([0.7])
    at_rest = -earth_in_body(attitude, latitude)
    inertia = inertia_coefficients(MASS)
    total = models.inertial(inertia, at_rest) + earth_rotation(inertia, at_rest, attitude, latitude)
    assert total == pytest.approx(np.zeros((1, 3)), abs=1e-20)


def test_earth_rotation_is_the_derivative_of_the_rates_of_a_free_body():
    """Integrate a body free of moments among the stars, over an Earth so fast that differences show it."""
    scale, step = 1e4, 1e-4
    inertia, latitude = inertia_coefficients(MASS), np.array([0.7])
    attitude = np.array([0.4, -0.3, 2.0])
    earth = (
        scale * EARTH_RATE_RAD_S * np.array([np.cos(0.7), 0.0, -np.sin(0.7)])
    )  # in axes fixed at the start
    turn = Rotation.from_euler("ZYX", attitude[::-1])
    rate = np.array([0.3, -0.2, 0.25])

    def against_earth(time):
        body, n = np.array(rate) + turn.inv().apply(earth), 20
        orientation, h = turn, time / n
        for _ in range(n):  # midpoint rule
            middle = body + 0.5 * h * models.inertial(inertia, body[None])[0]
            orientation = orientation * Rotation.from_rotvec(middle * h)
            body = body + h * models.inertial(inertia, middle[None])[0]
        return body - orientation.inv().apply(earth)

    slope = (against_earth(step) - against_earth(-step)) / (2 * step)
    exaggerated = scaled_rotation(scale, inertia, rate[None], attitude[None], latitude)
    assert slope - models.inertial(inertia, rate[None])[0] == pytest.approx(
        exaggerated[0], rel=1e-4, abs=1e-6
    )


def scaled_rotation(scale, inertia, x, attitude, latitude):
    """earth_rotation with an Earth `scale` times as fast: the same with another unit of time."""
    found = earth_rotation(inertia, x / scale, attitude, latitude)
    return scale**2 * found


class TestHealthyActuators:
    def test_ideal_ones_are_where_they_are_told_within_their_stops(self):
        commands = np.array([[0.1, -0.2, 0.3, 0.4], [0.9, -0.9, 0.9, -0.9]])
        followed = HealthyActuators(scenario()).follow(commands)
        assert np.array_equal(followed, [[0.1, -0.2, 0.3, 0.4], [0.52, -0.49, 0.44, -0.1]])

    def test_a_lag_approaches_a_step_exponentially_whatever_the_frames(self):
        for substeps in (1, 4):
            case = scenario(actuators={"bandwidth_rad_s": 20.0}, substeps=substeps)
            commands = np.zeros((50, 4))
            commands[1:] = 0.1
            followed = HealthyActuators(case).follow(commands)
            t = np.arange(50) / 100
            assert followed[:, 1] == pytest.approx(0.1 * (1 - np.exp(-20 * t)), abs=1e-12)

    def test_a_rate_limit_ramps(self):
        commands = np.zeros((50, 4))
        commands[1:] = -0.2
        followed = HealthyActuators(scenario(actuators={"rate_limit_deg_s": 60})).follow(commands)
        ramp = np.maximum(-0.2, -np.radians(60) * np.arange(50) / 100)
        assert followed[:, 2] == pytest.approx(ramp, abs=1e-12)

    def test_a_flight_in_pieces_is_the_flight(self):
        rng = np.random.default_rng(1)
        commands = rng.uniform(-0.6, 0.6, (300, 4))
        whole = HealthyActuators(scenario(actuators="servo")).follow(commands)
        pieces = HealthyActuators(scenario(actuators="servo"))
        joined = np.concatenate([pieces.follow(commands[a : a + 37]) for a in range(0, 300, 37)])
        assert np.array_equal(whole, joined)

    def test_a_declared_travel_stops_them_at_either_end(self):
        travel = {"rudder": {"travel_deg": [-7.0, 11.0]}, "flap": {"travel_deg": [3.0, 17.0]}}
        commands = np.array([[0.0, 0.0, -0.5, 0.01], [0.0, 0.0, 0.5, 0.5]])
        followed = HealthyActuators(scenario(actuators=travel)).follow(commands)
        assert np.degrees(followed[:, 2:]) == pytest.approx(np.array([[-7.0, 3.0], [11.0, 17.0]]))
