"""The design model against FDC's own state derivatives, and against itself taken apart."""

import csv
from pathlib import Path

import numpy as np

from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.model import design_record, nonlinear_response

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
    nonlinear_response(design, x, y, f, G)
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
