"""Uncertainty inputs, slipstream and envelope flag: exact, and on their own axis alone."""

from dataclasses import replace
from math import sin

import pytest

from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.fdc import GEOMETRY, MASS
from beaver_ftc.design.model import inertia_coefficients

AXES = "pqr"


PA_PER_PSF = 4.4482216152605 / 0.3048**2


def angular(plant):
    return {axis: plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in AXES}


def quantities(plant):
    """What the terms multiply, from the state alone."""
    V = plant.read("velocities/vt-fps") * 0.3048
    half_span, chord = GEOMETRY.span_m / 2 / V, GEOMETRY.chord_m / V
    density = plant.read("atmosphere/rho-slugs_ft3") * 515.3788184
    power = engine_power_kw(
        plant.read("engine/speed-rpm"), plant.read("engine/manifold-pressure-inhg"), density
    )
    return {
        "alpha": plant.read("aero/alpha-rad"),
        "beta": plant.read("aero/beta-rad"),
        "ph": plant.read("velocities/p-rad_sec") * half_span,
        "qh": plant.read("velocities/q-rad_sec") * chord,
        "rh": plant.read("velocities/r-rad_sec") * half_span,
        "betadoth": plant.read("aero/betadot-rad_sec") * half_span,
        "aileron": plant.read("fcs/aileron-effective-rad"),
        "elevator": plant.read("fcs/elevator-effective-rad"),
        "rudder": plant.read("fcs/rudder-effective-rad"),
        "flap": plant.read("fcs/flap-effective-rad"),
        "dpt": slipstream(power, density, V),
    }


@pytest.mark.parametrize(
    ("axis", "name", "others"), [("p", "Pqr", "qr"), ("q", "Qpr", "pr"), ("r", "Rpq", "pq")]
)
def test_inertia_coupling_error_acts_on_its_axis_alone(banked, axis, name, others):
    before = angular(banked)
    banked.write(f"uncertainty/inertia-coupling/{axis}", 0.25)
    banked.settle()
    first, second = (banked.read(f"velocities/{other}-rad_sec") for other in others)
    wanted = dict.fromkeys(AXES, 0.0) | {
        axis: 0.25 * getattr(inertia_coefficients(MASS), name) * first * second
    }
    after = angular(banked)
    assert abs(wanted[axis]) > 1e-3
    assert {each: after[each] - before[each] for each in AXES} == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("axis", AXES)
def test_sinusoid_acts_on_its_axis_alone(banked, axis):
    before = angular(banked)
    banked.write(f"uncertainty/sinusoid/{axis}-amplitude-rad_sec2", 0.02)
    banked.write(f"uncertainty/sinusoid/{axis}-frequency-rad_sec", 15.0)
    for t in (0.0, 0.07, 1.234):
        banked.fdm.set_sim_time(t)
        banked.settle()
        after = angular(banked)
        wanted = dict.fromkeys(AXES, 0.0) | {axis: 0.02 * sin(15.0 * t)}
        assert {each: after[each] - before[each] for each in AXES} == pytest.approx(wanted, abs=1e-12)


def test_the_unanticipated_fault_is_a_pitching_moment_on_alpha_cubed(banked):
    before = angular(banked)
    banked.write("failures/unanticipated/Cm-alpha3", 10.0)
    banked.settle()
    alpha = banked.read("aero/alpha-rad")
    qdyn = banked.read("aero/qbar-psf") * PA_PER_PSF
    moment = qdyn * GEOMETRY.wing_area_m2 * GEOMETRY.chord_m * 10 * alpha**3
    wanted = {"p": 0.0, "q": moment / MASS.Iy_kg_m2, "r": 0.0}
    after = angular(banked)
    assert {each: after[each] - before[each] for each in AXES} == pytest.approx(wanted, rel=1e-6, abs=1e-12)


def test_slipstream_is_of_the_current_frame(beaver):
    beaver.write("engine/speed-rpm", 2100)
    for _ in range(20):
        beaver.run()
        assert beaver.read("aero/dpt") == pytest.approx(quantities(beaver)["dpt"], rel=1e-9)


@pytest.mark.parametrize(
    ("change", "valid"),
    [
        ({"airspeed_mps": 30.01}, 1),
        ({"airspeed_mps": 29.99}, 0),
        ({"airspeed_mps": 54.99}, 1),
        ({"airspeed_mps": 55.01}, 0),
        ({"alpha_rad": 0.279}, 1),
        ({"alpha_rad": 0.281}, 0),
        ({"alpha_rad": -0.099}, 1),
        ({"alpha_rad": -0.101}, 0),
    ],
)
def test_envelope_flag(beaver, trim_point, change, valid):
    beaver.start(replace(trim_point, **change))
    assert beaver.read("aero/envelope-valid") == valid
