"""What a detector is told of errors, against the aircraft's coefficients and closed forms."""

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design import SCALE_FT, Dryden
from beaver_ftc.design.model import design_record
from beaver_ftc.diagnosis.bounds import (
    plugin_errors,
)
from beaver_ftc.scenario.diagnosis import Bounds
from flying import declared_in

AIRCRAFT = load()
Y = np.array([0.1, 0.03, 45.0, 1036.0, 0.3, 0.0, 0.0, 0.0])
U = np.array([0.1, -0.15, 0.05, 0.2])


@pytest.fixture
def design():
    return design_record()


def acceleration(design, y, u, off=()):
    """Without rates: the aircraft's own coefficients, over the design model's inertia; rad/s2."""
    neutral = {factor: 0.0 for term in AIRCRAFT.terms.values() for factor in term.factors}
    of = neutral | {"alpha": y[0], "beta": y[1], "dpt": y[4]} | dict(zip(AIRCRAFT.surfaces, u, strict=True))
    Cl, Cm, Cn = (AIRCRAFT.coefficient(name, of, dict(off)) for name in ("Cl", "Cm", "Cn"))
    of_it, geometry = design[0], AIRCRAFT.geometry
    force, span, chord = y[3] * geometry.wing_area_m2, geometry.span_m, geometry.chord_m
    roll, pitch, yaw = force * span * Cl, force * chord * Cm, force * span * Cn
    return np.array(
        [
            of_it["Pl"] * roll + of_it["Pn"] * yaw,
            of_it["Qm"] * pitch,
            of_it["Rl"] * roll + of_it["Rn"] * yaw,
        ]
    )


def declared(design, **bounds):
    return plugin_errors(declared_in(Bounds.model_validate(bounds), AIRCRAFT), design, Y, U)


def test_of_an_air_datum_noise_bias_and_rounding_count(design):
    sensors = {"alpha": {"noise_std_deg": 0.3, "bias_deg": -0.4, "quantum_deg": 0.9, "scale_error": -0.02}}
    told = declared(design, sensors=sensors)
    size = np.radians(np.sqrt(0.3**2 + 0.4**2 + 0.9**2 / 12.0))
    off = Y.copy()
    off[0] += size
    expected = np.abs(acceleration(design, off, U) - acceleration(design, Y, U))
    assert told.model_rad_s2 == pytest.approx(expected)
    assert told.noise[3] == pytest.approx(np.radians(0.3))
    assert told.bias[3] == pytest.approx(np.radians(0.4))
    assert told.resolution[3] == pytest.approx(np.radians(0.9))
    assert told.slope.tolist() == [0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0]
    assert declared(design, sensors={"p": {"noise_std_deg_s": 0.3}}).model_rad_s2.tolist() == [0.0] * 3


@pytest.mark.parametrize(("severity", "feet_a_s"), [("light", 7.4), ("severe", 23.6)])
@pytest.mark.parametrize("b", [14.6, 60.0])
def test_gusts_turn_the_air_as_their_spectra_say(b, severity, feet_a_s):
    """Pitch and yaw: the variance of a lagged slope behind Dryden's gusts, by quadrature in u = arctan of
    the frequency; roll: 1.9 sigma / sqrt(L b), and its lag sqrt(L b) / 2.6 V [Yeager1998]."""
    V, L, sigma = 45.0, SCALE_FT * 0.3048, feet_a_s * 0.3048
    rotation, time_s = Dryden(severity).rotation(V, b)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    u = 0.25 * np.pi * (nodes + 1.0)
    w, dw = np.tan(u) * V / L, 0.25 * np.pi * weights / np.cos(u) ** 2 * V / L
    gust = sigma**2 * L / (np.pi * V) * (1.0 + 3.0 * (L * w / V) ** 2) / (1.0 + (L * w / V) ** 2) ** 2
    for axis, length in ((1, 4.0 * b / np.pi), (2, 3.0 * b / np.pi)):
        variance = (gust * (w / V) ** 2 / (1.0 + (length * w / V) ** 2)) @ dw
        assert rotation[axis] ** 2 == pytest.approx(variance, rel=1e-6)
        assert time_s[axis] == pytest.approx(length / V)
    assert rotation[0] == pytest.approx(1.9 * sigma / np.sqrt(L * b))
    assert time_s[0] == pytest.approx(np.sqrt(L * b) / 2.6 / V)
