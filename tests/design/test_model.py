"""The design model against FDC's own state derivatives, and against itself taken apart."""

import csv
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.design import model
from beaver_ftc.design.model import (
    both_responses,
    coefficient_slopes,
    design_record,
    engine_power_kw,
    evaluate,
    regressors,
    slipstream,
)

REFERENCE = Path(__file__).parents[1] / "data" / "fdc_state_derivatives.csv"


def rows():
    with REFERENCE.open() as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def density(altitude_m):
    """FDC's atmosphere: 6.5 K/km, R = 287.05, and the gravity of the altitude itself in the pressure law."""
    T = 288.15 - 0.0065 * altitude_m
    g = 9.80665 * (6371020.0 / (6371020.0 + altitude_m)) ** 2
    return 101325.0 * (T / 288.15) ** (g / (287.05 * 0.0065)) / (287.05 * T)


def measured(row):
    rho = density(row["h_m"])
    power = engine_power_kw(row["engine_rpm"], row["manifold_pressure_inHg"], rho)
    V = row["V_mps"]
    y = np.array([row["alpha_rad"], row["beta_rad"], V, 0.5 * rho * V**2, slipstream(power, rho, V)])
    x = np.array([row["p_rad_s"], row["q_rad_s"], row["r_rad_s"]])
    u = np.array([row[f"{s}_rad"] for s in ("aileron", "elevator", "rudder", "flap")])
    return x, y, u


def split(design, x, y):
    f, G = np.zeros(3), np.zeros((3, 4))
    both_responses(design, x, y, f, G)
    return f, G


def test_it_gives_the_angular_accelerations_of_fdc():
    design = design_record()[0]
    ours, theirs = [], []
    for row in rows():
        x, y, u = measured(row)
        f, G = split(design, x, y)
        ours.append(f + G @ u)
        theirs.append([row["pdot_rad_s2"], row["qdot_rad_s2"], row["rdot_rad_s2"]])
    error = np.sqrt(np.mean((np.array(ours) - theirs) ** 2, axis=0))
    assert np.all(error <= 2e-5 * np.sqrt(np.mean(np.square(theirs), axis=0)))


def moment_form(design, x, y, u):
    """Euler's equations with the inertia tensor and the table of terms: no inertia constant is used."""
    table, terms = np.zeros(MAX_TERMS), load().moments
    evaluate(design["moments"], x, y)
    regressors(design["moments"], design["moments"]["power"], u, table)
    parts = table * design["moments"]["value"]
    Cl, Cm, Cn = (
        sum(part for part, term in zip(parts, terms, strict=False) if term.coefficient == name)
        for name in ("Cl", "Cm", "Cn")
    )
    S, b, c = design["S"], design["b"], design["c"]
    moments = y[3] * S * np.array([b * Cl, c * Cm, b * Cn])
    inertia = np.array([[5368.39, 0, -117.64], [0, 6928.93, 0], [-117.64, 0, 11158.75]])
    return np.linalg.solve(inertia, moments - np.cross(x, inertia @ x))


rates = st.floats(-1, 1)
deflections = st.floats(-0.4, 0.4)


@given(
    x=st.tuples(rates, rates, rates),
    y=st.tuples(
        st.floats(-0.1, 0.3),
        st.floats(-0.3, 0.3),
        st.floats(25, 60),
        st.floats(300, 2200),
        st.floats(-0.1, 0.6),
    ),
    u=st.tuples(deflections, deflections, deflections, deflections),
)
def test_split_equals_eulers_equations(x, y, u):
    x, y, u = map(np.array, (x, y, u))
    design = design_record()[0]
    f, G = split(design, x, y)
    assert f + G @ u == pytest.approx(moment_form(design, x, y, u), rel=1e-9, abs=1e-9)


def published(x, y, u):
    """Cl, Cm, Cn as the source prints them [TM88]: a second writing of what the aircraft's file says."""
    (a, be, V, _, dpt), (da, de, dr, df) = y, u
    ph, qh, rh = x[0] * 14.63 / (2 * V), x[1] * 1.5875 / V, x[2] * 14.63 / (2 * V)
    return np.array([
        0.0005910 - 0.06180 * be - 0.5045 * ph + 0.1695 * rh - 0.09917 * da + 0.006934 * dr
        - 0.08269 * da * a - 0.01406 * a**2 * dpt,
        0.09448 - 0.6028 * a - 2.140 * a**2 - 15.56 * qh - 1.921 * de + 0.6921 * be**2 - 0.3118 * rh
        + 0.4072 * df - 0.07895 * dpt,
        -0.003117 + 0.006719 * be - 0.1585 * ph - 0.1112 * rh - 0.003872 * da - 0.08265 * dr + 0.1595 * qh
        + 0.1373 * be**3 - 0.003026 * dpt**3,
    ])  # fmt: skip


def test_the_slopes_of_the_coefficients_are_those_of_the_published_polynomials():
    """By central differences of the printed polynomials, signal by signal."""
    rng, design = np.random.default_rng(5), design_record()[0]
    for _ in range(20):
        x, u = rng.uniform(-0.5, 0.5, 3), rng.uniform(-0.3, 0.3, 4)
        y = np.array([*rng.uniform(-0.1, 0.25, 2), rng.uniform(30, 55), 1000.0, rng.uniform(0, 0.6)])
        found = coefficient_slopes(design, x, y, u)
        per_rate = np.array([14.63 / (2 * y[2]), 1.5875 / y[2], 14.63 / (2 * y[2])])
        for column, place in ((0, 0), (1, 1), (5, 4)):
            step = 1e-5 * np.eye(5)[place]
            wanted = (published(x, y + step, u) - published(x, y - step, u)) / 2e-5
            assert found[:, column] == pytest.approx(wanted, abs=1e-8)
        for axis in range(3):
            step = 1e-5 * np.eye(3)[axis]
            wanted = (published(x + step, y, u) - published(x - step, y, u)) / 2e-5
            assert found[:, 2 + axis] * per_rate[axis] == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_damping_is_the_derivative_of_the_aerodynamic_moments_with_the_rates(seed):
    """By differences; what is left without dynamic pressure is the coupling of inertia, not of the air."""
    design, rng = design_record()[0], np.random.default_rng(seed)
    x, u = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 4)
    y = np.array([0.1, 0.05, 45.0, 1000.0, 0.5]) * rng.uniform(0.8, 1.2, 5)
    still = y * [1, 1, 1, 0, 1]

    def moments(x):
        f, G = split(design, x, y)
        return f + G @ u - split(design, x, still)[0]

    found, h = np.zeros((3, 3)), 1e-5
    model.rate_damping(design, x, y, u, np.zeros(MAX_MONOMIALS), found)
    for j, step in enumerate(h * np.eye(3)):
        assert found[:, j] == pytest.approx(
            (moments(x + step) - moments(x - step)) / (2 * h), rel=1e-6, abs=1e-8
        )


def test_the_unanticipated_moment_grows_with_the_cube_of_alpha():
    """10 alpha^3 qdyn S c / Iy of the Beaver."""
    y = np.array([0.2, 0.1, 45.0, 1000.0, 0.5])
    expected = 10.0 * 0.2**3 * 1000.0 * 23.23 * 1.5875 / 6928.93
    assert model.unanticipated_pitch(design_record()[0], y, 10.0) == pytest.approx(expected, rel=1e-12)
