"""Sign conventions: what moves which way. Body axes X forward, Y right, Z down."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest


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
