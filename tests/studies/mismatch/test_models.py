"""The many-frames design model against the compiled one; a body at rest against a turning Earth."""

import numpy as np
import pytest

from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import acceleration_at, design_of, inertia_coefficients, response
from beaver_ftc.design.plain_model import anchor, inertial
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.studies.mismatch.sources import (
    earth_in_body,
    earth_rotation,
)
from flying import scenario

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
    design = design_of(Declared.of(case))[0]
    anchor(design, x[0], y[0], u[0])
    found = acceleration_at(design, x, y, u)
    record = np.array([design]).view(np.recarray)[0]
    for k in range(len(x)):
        f, G = np.zeros(3), np.zeros((3, 4))
        response(record, x[k], y[k], f, G)
        assert found[k] == pytest.approx(f + G @ u[k], rel=1e-12, abs=1e-12)


def test_a_body_at_rest_among_the_stars_keeps_its_rates_against_the_earth():
    attitude = np.array([[0.4, -0.3, 2.0]])
    latitude = np.array([0.7])
    at_rest = -earth_in_body(attitude, latitude)
    inertia = inertia_coefficients(MASS)
    total = inertial(inertia, at_rest) + earth_rotation(inertia, at_rest, attitude, latitude)
    assert total == pytest.approx(np.zeros((1, 3)), abs=1e-20)
