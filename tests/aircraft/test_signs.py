"""Sign conventions: what moves which way. Body axes X forward, Y right, Z down."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from beaver_ftc.design.fdc import MASS, TERMS
from beaver_ftc.design.model import inertia_coefficients


class Accelerations(NamedTuple):
    """Body accelerations: linear in ft/s2, angular in rad/s2."""

    u: float
    v: float
    w: float
    p: float
    q: float
    r: float


def accelerations(plant):
    linear = [plant.read(f"accelerations/{axis}dot-ft_sec2") for axis in "uvw"]
    return Accelerations(*linear, *(plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in "pqr"))


def change(plant, **properties):
    """What the accelerations change by when properties are set, the state standing still."""
    before = accelerations(plant)
    for name, value in properties.items():
        plant.write(name, value)
    plant.settle()
    return Accelerations(*np.subtract(accelerations(plant), before))


def deflect(plant, surface, by_rad):
    name = f"fcs/{surface}-cmd-rad"
    return change(plant, **{name: plant.read(name) + by_rad})


def test_elevator_up_pitches_up(beaver):
    assert deflect(beaver, "elevator", -0.05).q > 0.1


def test_positive_aileron_rolls_left(beaver):
    assert deflect(beaver, "aileron", 0.05).p < -0.1


def test_positive_rudder_yaws_left_and_pushes_right(beaver):
    changed = deflect(beaver, "rudder", 0.05)
    assert changed.r < -0.05
    assert changed.v > 0.1


def test_flap_down_lifts_and_pitches_up(beaver):
    changed = deflect(beaver, "flap", 0.05)
    assert changed.w < -0.5
    assert changed.q > 0.02


def test_positive_aileron_yaws_left_too(beaver):
    """Cn_da and, through Jxz, Cl_da both turn the nose the way the aircraft rolls."""
    assert deflect(beaver, "aileron", 0.05).r < -0.001


def restarted(plant, point, **state):
    plant.start(replace(point, **state))
    return accelerations(plant)


def test_dihedral_and_weathercock(beaver, trim_point):
    """Wind from the right (beta > 0) rolls the aircraft left and turns its nose right, into the wind."""
    slip = restarted(beaver, trim_point, beta_rad=trim_point.beta_rad + 0.1)
    assert slip.v < -1
    assert slip.p < -0.3
    assert slip.r > 0.01


def test_nose_up_is_stable(beaver, trim_point):
    assert restarted(beaver, trim_point, alpha_rad=trim_point.alpha_rad + 0.02).q < -0.05


@pytest.mark.parametrize("axis", ["p", "q", "r"])
def test_rates_are_damped(beaver, trim_point, axis):
    for rate in (0.2, -0.2):
        result = restarted(beaver, trim_point, **{f"{axis}_rad_s": rate})
        assert getattr(result, axis) * rate < 0


@pytest.mark.parametrize(
    ("surface", "only", "driven", "coupled", "ratio"),
    [
        ("aileron", "Cn_da", "p", "r", MASS.Jxz_kg_m2 / MASS.Iz_kg_m2),
        ("rudder", "Cl_dr", "r", "p", MASS.Jxz_kg_m2 / MASS.Ix_kg_m2),
    ],
)
def test_a_pure_moment_couples_through_Jxz(beaver, surface, only, driven, coupled, ratio):
    """A pure rolling moment also yaws, Iz rdot = Jxz pdot; a pure yawing one rolls, Ix pdot = Jxz rdot."""
    change(beaver, **{f"uncertainty/{only}-scale": 0.0})
    changed = deflect(beaver, surface, 0.1)
    assert abs(getattr(changed, driven)) > 0.1
    assert getattr(changed, coupled) / getattr(changed, driven) == pytest.approx(ratio, rel=1e-6)


def test_without_moments_the_rates_couple_as_a_rigid_body(beaver, trim_point):
    """Euler's equations with Jxz at random rates: inertial rates and accelerations, no aerodynamic moment."""
    for name, term in TERMS.items():
        if term.coefficient in ("Cl", "Cm", "Cn"):
            beaver.write(f"uncertainty/{name}-scale", 0.0)
    j = inertia_coefficients(MASS)
    rng = np.random.default_rng(3)
    for rates in rng.uniform(-1, 1, (20, 3)):
        restarted(beaver, trim_point, **dict(zip(("p_rad_s", "q_rad_s", "r_rad_s"), rates, strict=True)))
        p, q, r = (beaver.read(f"velocities/{axis}i-rad_sec") for axis in "pqr")
        wanted = [
            j.Ppq * p * q + j.Pqr * q * r,
            j.Qpp * p**2 + j.Qpr * p * r + j.Qrr * r**2,
            j.Rpq * p * q + j.Rqr * q * r,
        ]
        found = [beaver.read(f"accelerations/{axis}idot-rad_sec2") for axis in "pqr"]
        assert found == pytest.approx(wanted, abs=1e-10)
