"""The twelve FDC equations against an independent implementation's data, and their Jacobian."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from beaver_ftc.design import fdc

DATA = Path(__file__).parents[1] / "data"
STATE = (
    "V_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad", "psi_rad",
    "x_m", "y_m", "h_m",
)  # fmt: skip
SURFACES = ("aileron_rad", "elevator_rad", "rudder_rad", "flap_rad")
DERIVATIVES = {
    "Vdot_mps2": 1e-6, "alphadot_rad_s": 1e-6, "betadot_rad_s": 5e-5,
    "pdot_rad_s2": 1e-6, "qdot_rad_s2": 1e-6, "rdot_rad_s2": 1e-6,
    "phidot_rad_s": 1e-9, "thetadot_rad_s": 1e-9, "psidot_rad_s": 1e-9,
    "xdot_mps": 1e-9, "ydot_mps": 1e-9, "hdot_mps": 1e-9,
}  # fmt: skip
"""RMS error over RMS value. betadot: FDC solves for the force of betadot to first order only."""


def table(name):
    return np.genfromtxt(DATA / name, delimiter=",", names=True)


def condition(row):
    state, surfaces = np.array([row[n] for n in STATE]), np.array([row[n] for n in SURFACES])
    return state, surfaces, fdc.Engine(row["engine_rpm"], row["manifold_pressure_inHg"])


def test_derivatives_at_three_hundred_random_states():
    rows = table("fdc_state_derivatives.csv")
    found = np.array([fdc.derivatives(*condition(row)) for row in rows])
    for i, (name, bar) in enumerate(DERIVATIVES.items()):
        error = np.sqrt(np.mean((found[:, i] - rows[name]) ** 2) / np.mean(rows[name] ** 2))
        assert error <= bar, name


@pytest.mark.parametrize("surface", ["elevator", "aileron"])
def test_a_doublet_flown_with_runge_kutta_ends_where_the_data_do(surface):
    rows, dt = table(f"fdc_{surface}_doublet.csv"), 0.05
    state = condition(rows[0])[0]
    for row, following in pairwise(rows[:101]):
        _, surfaces, engine = condition(row)
        for _ in range(5):  # the data hold a command over each 0.01 s and are sampled every 0.05 s
            state = runge_kutta(state, surfaces, engine, dt / 5)
        assert state == pytest.approx([following[n] for n in STATE], rel=2e-4, abs=2e-4)


def runge_kutta(state, surfaces, engine, h):
    def rate(x):
        return fdc.derivatives(x, surfaces, engine)

    a = rate(state)
    b = rate(state + 0.5 * h * a)
    c = rate(state + 0.5 * h * b)
    return state + h / 6.0 * (a + 2 * b + 2 * c + rate(state + h * c))


def test_jacobian_agrees_with_central_differences():
    state, surfaces, engine = condition(table("fdc_state_derivatives.csv")[7])
    A, B = fdc.linearise(state, surfaces, engine)
    h = np.array([1e-3, *[1e-5] * 8, 1.0, 1.0, 1.0])
    for j in range(12):
        step = h[j] * np.eye(12)[j]
        slope = fdc.derivatives(state + step, surfaces, engine) - fdc.derivatives(
            state - step, surfaces, engine
        )
        assert A[:, j] == pytest.approx(slope / (2 * h[j]), rel=1e-5, abs=1e-6)
    for j in range(4):
        step = 1e-5 * np.eye(4)[j]
        slope = fdc.derivatives(state, surfaces + step, engine) - fdc.derivatives(
            state, surfaces - step, engine
        )
        assert B[:, j] == pytest.approx(slope / 2e-5, rel=1e-6, abs=1e-8)


def test_a_ratio_scales_its_own_term_alone():
    state, surfaces, engine = condition(table("fdc_state_derivatives.csv")[3])
    plain = fdc.aerodynamic_coefficients(state, surfaces, engine)
    scaled = fdc.aerodynamic_coefficients(state, surfaces, engine, {"Cm_alpha": 1.1})
    assert scaled["Cm"] - plain["Cm"] == pytest.approx(0.1 * -0.6028 * state[1], rel=1e-12)
    assert {k: v for k, v in scaled.items() if k != "Cm"} == {k: v for k, v in plain.items() if k != "Cm"}
