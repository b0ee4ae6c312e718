"""Derived bounds: never exceeded by any admitted error, and attained where all errors conspire."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.design.model import design_record, nonlinear_response
from beaver_ftc.diagnosis.bounds import add_declared_bound
from beaver_ftc.diagnosis.bounds_design import inertia_bounds
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.scenario.schema import Scenario
from samples import samples

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
TERMS_USED = (
    "Cl_p",
    "Cl_da",
    "Cl_daa",
    "Cl_beta",
    "Cm_0",
    "Cm_alpha",
    "Cm_q",
    "Cm_de",
    "Cm_df",
    "Cn_p",
    "Cn_dr",
)


def acceleration(x, y, u, **changes):
    design = design_record(**changes)[0]
    f, G = np.zeros(3), np.zeros((3, 4))
    nonlinear_response(design, x, y, f, G)
    return f + G @ u


def bound(x, y, u, **bounds):
    scenario = Scenario.model_validate({"name": "x", "fdi": {"bounds": bounds}})
    frame = configure_design(scenario, TRAVEL_RAD)[0]
    out = np.zeros(3)
    add_declared_bound(frame["fdi"]["bound"]["declared_errors"], x, y, u, out)
    return out


def state(rng):
    x = rng.uniform(-0.3, 0.3, 3)
    V = rng.uniform(32, 55)
    y = np.array([rng.uniform(-0.05, 0.25), rng.uniform(-0.1, 0.1), V, 0.5 * V * V, rng.uniform(0.2, 0.6)])
    return x, y, rng.uniform(-0.3, 0.3, 4)


SENSORS = {
    "p": {"noise_std_deg_s": 0.2, "bias_deg_s": 0.1, "scale_error": 0.02},
    "alpha": {"bias_deg": 1.0, "noise_std_deg": 0.1},
    "beta": {"bias_deg": 0.5},
    "V": {"bias_mps": 1.5},
    "qdyn": {"bias_pa": 20.0, "scale_error": 0.01},
}


@settings(max_examples=samples(300), deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_no_admitted_error_exceeds_the_bound(seed, at_the_corner):
    rng = np.random.default_rng(seed)

    def within(size):
        return size * (rng.choice([-1.0, 1.0]) if at_the_corner else rng.uniform(-1, 1))

    x, y, u = state(rng)
    tolerance, deflection_deg = 0.1, 0.3
    scale = {name: 1 + within(tolerance) for name in TERMS_USED}
    xm, ym = x.copy(), y.copy()
    xm[0] = x[0] * (1 + within(0.02)) + np.radians(within(4 * 0.2 + 0.1))
    ym[0] += np.radians(within(1.4))
    ym[1] += np.radians(within(0.5))
    ym[2] += within(1.5)
    ym[3] = y[3] * (1 + within(0.01)) + within(20.0)
    moved = u + np.radians([within(deflection_deg) for _ in range(4)])
    error = acceleration(x, y, moved, scale=scale) - acceleration(xm, ym, u)
    declared_errors = bound(xm, ym, u, coefficients=tolerance, sensors=SENSORS, deflection_deg=deflection_deg)
    assert (np.abs(error) <= declared_errors * (1 + 1e-9)).all()


def test_one_coefficient_alone_attains_its_bound():
    x, y, u = state(np.random.default_rng(2))
    error = acceleration(x, y, u, scale={"Cm_alpha": 1.05}) - acceleration(x, y, u)
    assert bound(x, y, u, coefficients={"Cm_alpha": 0.05})[1] == pytest.approx(abs(error[1]), rel=1e-9)


@settings(max_examples=samples(100), deadline=None)
@given(st.integers(0, 2**32))
def test_inertia_coefficients_are_extreme_at_the_corners(seed):
    from dataclasses import replace

    from beaver_ftc.design.fdc import MASS
    from beaver_ftc.design.model import inertia_coefficients

    rng, tolerance = np.random.default_rng(seed), 0.08
    names = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
    change = {n: getattr(MASS, n) * (1 + rng.uniform(-tolerance, tolerance)) for n in names}
    there, nominal = (np.array(inertia_coefficients(m)) for m in (replace(MASS, **change), MASS))
    assert (np.abs(there - nominal) <= inertia_bounds(tolerance, MASS) * (1 + 1e-12)).all()
