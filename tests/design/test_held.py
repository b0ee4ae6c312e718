"""The equations and the design models at states where nothing is zero, to the last digits that are kept."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.design import fdc, model
from beaver_ftc.design.context import Context, Declared
from beaver_ftc.scenario.schema import load as load_scenario
from kept import in_short, of_record
from trainer import trainer

STATE = np.array([47.0, 0.11, -0.07, 0.3, -0.2, 0.15, 0.4, 0.12, 1.1, 300.0, -200.0, 1700.0])
SURFACES = np.array([0.06, -0.08, 0.07, 0.2])
SETTING = fdc.Engine(1900.0, 22.0)
RATIO = {"CY_betadot": 1.3, "Cm_alpha": 0.9, "CX_0": 1.2}
X, Y = np.array([0.3, -0.2, 0.15]), np.array([0.11, -0.07, 47.0, 1100.0, 0.4])


def test_the_published_equations(changed):
    A, B = fdc.linearise(STATE, SURFACES, SETTING, RATIO)
    assert not changed({
        "derivatives": fdc.derivatives(STATE, SURFACES, SETTING),
        "with errors": fdc.derivatives(STATE, SURFACES, SETTING, RATIO),
        "coefficients": fdc.aerodynamic_coefficients(STATE, SURFACES, SETTING, RATIO),
        "A": A, "B": B,
        "air": [[fdc.atmosphere(h), fdc.gravity(h)] for h in (-300.0, 0.0, 1828.8, 6000.0)],
        "terms": [term.name for term in fdc.coefficient_terms("CY")], "Cm_de": fdc.value("Cm_de"),
        "inertia": model.inertia_coefficients(load().mass)._asdict(),
        "turning": model.inertial(model.inertia_coefficients(load().mass), np.array([X, -2 * X])),
    })  # fmt: skip


def test_the_engine_and_its_slipstream(changed):
    y = Y.copy()
    assert not changed({
        "power": [model.engine_power_kw(*of) for of in ((1800.0, 20.0, 1.225), (2100.0, 30.0, 0.9))],
        "slipstream": model.slipstream(150.0, 1.1, 42.0),
        "measured": model.measured_slipstream(1900.0, 22.0, 47.0, 1100.0),
        "density": model.density_ratio(y), "slopes": model.slipstream_slopes(y, 130.0),
        "errors": [model.power_error_kw(rpm, 22.0, 15.0, 0.2) for rpm in (1900.0, 4500.0)],
    })  # fmt: skip
    assert model.power_error_kw(4500.0, 22.0, 15.0, 0.2)[1] == 0.0  # so fast no chart goes


MODELS = {
    "table": {},
    "wrong": {"engine_terms": False, "mass": 1.2, "inertia": {"Ix": 1.1, "Jxz": -2.0},
              "coefficients": {"Cm_q": 0.9}},
    "frozen": {"frozen_alpha": True},
    "linear": {"linearised": True},
    "linear and frozen": {"linearised": True, "frozen_alpha": True},
}  # fmt: skip


@pytest.mark.parametrize("of", MODELS)
def test_what_a_designer_believes(of, changed):
    believed = load_scenario({"design_model": MODELS[of]}).design_model
    design = model.design_of(believed)[0]
    trim_y = np.array([0.09, 0.01, 45.0, 1020.0, 0.45])
    model.anchor(design, 0.1 * X, trim_y, SURFACES)
    f, G = np.zeros(3), np.zeros((3, 4))
    model.response(design, X, Y, f, G)
    each, slopes = np.zeros((2, 3)), np.zeros((3, 4))
    model.responses(design, np.array([X, -X]), Y, each, slopes)
    found = {
        "record": of_record(design), "f": f, "G": G, "each": each, "mass": vars(model.mass_of(believed)),
        "effectiveness": model.effectiveness(design, Y), "damping": model.own_damping(design, Y),
    }  # fmt: skip
    if of in ("table", "wrong"):
        jacobian = model.jacobian(design, X, Y, SURFACES)
        found |= {"jacobian": jacobian, "slopes": model.coefficient_slopes(design, X, Y, SURFACES)}
        damping = np.zeros((3, 3))
        model.rate_damping(design, X, Y, SURFACES, np.zeros(64), damping)
        found |= {"rates": damping, "unanticipated": model.unanticipated_pitch(design, Y, 10.0)}
    assert (slopes == G).all()
    assert not changed(found)


def test_of_another_aircraft(changed):
    """One whose coefficients have other terms, no slipstream and three surfaces."""
    aircraft = trainer()
    design = model.design_of(load_scenario({}).design_model, aircraft)[0]
    jacobian = model.jacobian(design, X, Y[:4], SURFACES[:3])
    assert not changed(
        {"record": of_record(design), "jacobian": list(map(in_short, jacobian)), "f_y": jacobian[3]}
    )


def numbers(n, step=0.01):
    return step * np.arange(1, n + 1)


def test_what_a_plug_in_is_told_of_errors():
    declared = Declared(noise=numbers(7), resolution=numbers(7, 0.02), gust_rad_s=numbers(3),
                        gust_time_s=np.array([1.0, 2.0, 4.0]),
                        gust_effect=np.array([[1.0, 0, 0], [0, 2.0, 1.0], [0, 0, 0]]))  # fmt: skip
    assert declared.gyro_rad_s == pytest.approx(numbers(3) * np.sqrt(1 + 4 / 12))
    assert declared.rate_variance(0.5) == pytest.approx(0.25 + numbers(3) ** 2 * (1 + 4 / 12))
    assert declared.turbulence_rad_s2 == pytest.approx([0.01, np.hypot(2 * 0.02, 0.03), 0.0])
    weighted = (16e-4 * 2.0 + 9e-4 * 4.0) / 25e-4
    assert declared.turbulence_time_s == pytest.approx([1.0, weighted, 0.0])
    assert (declared.errors, declared.air) == (True, True)
    assert (Declared().errors, Declared().air) == (False, False)
    for said in (
        {"inertia": 0.1},
        {"deflection_rad": 0.1},
        {"coefficients": np.array([0, 0.1])},
        {"slope": numbers(7)},
    ):
        assert Declared(**said).errors
        assert not Declared(**said).air
    for name, of_instruments_or_air in (
        ("noise", True), ("bias", True), ("resolution", True), ("slope", True), ("gust_rad_s", True),
        ("gust_time_s", False), ("gust_effect", False), ("coefficients", False), ("inertia", False),
        ("deflection_rad", False), ("model_rad_s2", False), ("bandwidth_rad_s", False),
    ):  # fmt: skip
        one = 0.1 if name in ("inertia", "deflection_rad") else np.array([0.0, -0.1, 0.0])
        assert Declared(**{name: one}).noisy is of_instruments_or_air, name
    still = Declared()
    names = ("noise", "gust_time_s", "gust_effect", "coefficients", "model_rad_s2", "bandwidth_rad_s")
    sizes = [getattr(still, name).shape for name in (*names, "rate_limit_rad_s")]
    assert sizes == [(7,), (3,), (3, 3), (0,), (3,), (4,), (4,)]


def test_who_leads():
    nothing = np.zeros(3)
    told = Context(0.01, 1, None, nothing, nothing, nothing, nothing, nothing, nothing)
    assert replace(told, leading=(2, 0, 3)).leaders == ("rudder", "aileron", "flap")
    assert told.surfaces == ("aileron", "elevator", "rudder", "flap")
    assert told.leaders == ("aileron", "elevator", "rudder")
    assert (dict(told.options), told.leading) == ({}, (0, 1, 2))
