"""Linear analysis: JSBSim's modes against FDC's over the envelope, the linear tools against closed forms."""

import dataclasses
import subprocess
import sys
from importlib.metadata import version

import numpy as np
import pytest

from beaver_ftc.design import fdc
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plant.adapter import FlightState
from beaver_ftc.plant.linear import own
from beaver_ftc.studies.linear_systems import (
    CLASSICAL,
    MODES,
    deviation,
    modes,
    pulse_response,
    response,
    zeros,
)
from beaver_ftc.studies.mismatch.linear import analyse, in_fdc
from flying import scenario

ENVELOPE = [(30, 0), (35, 1828.8), (45, 1828.8), (50, 3000), (55, 4000)]

# (s + 2) / ((s + 1)(s + 3)), the output being the first state
A = np.array([[-4.0, 1.0], [-3.0, 0.0]])
B = np.array([1.0, 2.0])


@pytest.fixture(scope="module", params=ENVELOPE, ids=str)
def analysis(request):
    airspeed, altitude = request.param
    return analyse(scenario(initial={"airspeed_mps": airspeed, "altitude_m": altitude}))


def test_modes_of_jsbsim_agree_with_fdc_within_one_percent(analysis):
    found = analysis.deviation("fdc")
    assert set(found) == set(MODES)
    assert max(found.values()) <= 0.01, found


def test_jsbsims_own_linearisation_agrees_with_fdc_within_one_percent(analysis):
    assert max(analysis.own_deviation.values()) <= 0.01, analysis.own_deviation


def test_surfaces_act_in_jsbsims_linear_models_as_in_fdc(analysis):
    """Angular acceleration per rad of each surface, from differences and from JSBSim's own linearisation."""
    rates = ("p", "q", "r")
    straight = dataclasses.replace(analysis.point, beta_rad=0.0)
    _, B = fdc.linearise(*in_fdc(straight))
    found = own(scenario(), straight).of(rates).B
    assert found == pytest.approx(B[3:6, :3], rel=2e-3, abs=1e-3)
    differenced = analysis.models["truth"].of(rates).B
    assert differenced == pytest.approx(analysis.models["fdc"].of(rates).B, rel=2e-3, abs=1e-3)


def test_a_design_model_with_all_terms_has_the_truths_modes(analysis):
    assert max(analysis.deviation("design").values()) <= 0.01


def test_declared_coefficient_errors_move_truth_and_fdc_alike_and_not_the_design():
    """By differences and by JSBSim's own linearisation, which begins with an aircraft of its own."""
    wrong = {"Cm_alpha": 1.3, "Cl_p": 0.8, "Cn_beta": 1.2}
    found = analyse(scenario(uncertainty={"coefficients": wrong}))
    assert max(found.deviation("fdc").values()) <= 0.01
    assert max(found.own_deviation.values()) <= 0.01
    assert found.deviation("design")["short_period"] > 0.05
    assert found.deviation("design")["roll"] > 0.05


@pytest.mark.parametrize(
    ("model", "mode", "least"),
    [({"engine_terms": False}, "phugoid", 0.01), ({"frozen_alpha": True}, "short_period", 0.5),
     ({"inertia": {"Ix": 1.2}}, "roll", 0.1), ({"mass": 1.2}, "short_period", 0.02)],
)  # fmt: skip
def test_a_wrong_design_has_wrong_modes(model, mode, least):
    assert analyse(scenario(design_model=model)).deviation("design")[mode] > least


def test_linearising_changes_no_mode():
    plain, linear = (
        analyse(scenario(design_model={"linearised": wanted})).models["design"].A for wanted in (False, True)
    )
    assert linear == pytest.approx(plain, abs=1e-12)


def test_jsbsims_own_linearisation_is_refused_where_it_would_be_wrong():
    with pytest.raises(SimulationFailed, match="sideslip"):
        own(scenario(), FlightState(45.0, 1000.0, beta_rad=0.01))


@pytest.mark.skipif(version("jsbsim") != "1.3.3", reason="what is known of 1.3.3")
def test_jsbsim_cannot_linearise_an_aircraft_with_no_engine():
    """Why the aircraft is copied with an inert engine: without, the process is lost."""
    script = (
        "import jsbsim\nfrom beaver_ftc.plant.adapter import Plant\nfrom beaver_ftc.plant.trim import trim\n"
        "p = Plant(100)\np.start(trim(45, 1000, plant=p))\njsbsim.FGLinearization(p.fdm)"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, check=False).returncode != 0


def test_modes_are_told_apart_by_size_and_by_the_states_they_move():
    """Two blocks with known poles: longitudinal -2 +- 3i, -0.02 +- 0.2i; lateral -5, -0.5 +- 1i, -0.04."""

    def block(real, imaginary):
        return np.array([[real, imaginary], [-imaginary, real]])

    A = np.zeros((8, 8))
    A[:2, :2], A[2:4, 2:4] = block(-0.02, 0.2), block(-2.0, 3.0)
    A[4, 4], A[5, 5], A[6:, 6:] = -5.0, -0.04, block(-0.5, 1.0)
    mix = np.zeros((8, 8))
    rng = np.random.default_rng(2)
    mix[:4, :4], mix[4:, 4:] = rng.normal(size=(4, 4)), rng.normal(size=(4, 4))
    found = modes(mix @ A @ np.linalg.inv(mix))
    expected = {
        "short_period": -2 + 3j,
        "phugoid": -0.02 + 0.2j,
        "roll": -5,
        "dutch_roll": -0.5 + 1j,
        "spiral": -0.04,
    }
    for name, pole in expected.items():
        assert deviation(found[name].pole, pole) < 1e-9, name
    assert found["short_period"].frequency_rad_s == pytest.approx(np.sqrt(13))
    assert found["short_period"].damping == pytest.approx(2 / np.sqrt(13))
    assert found["roll"].damping == 1.0
    assert len(CLASSICAL) == 8


def test_zeros_and_frequency_response_are_those_of_the_transfer_function():
    assert zeros(A, B, 0) == pytest.approx([-2.0], abs=1e-9)
    w = np.array([0.1, 1.0, 10.0])
    s = 1j * w
    assert response(A, B, 0, w) == pytest.approx((s + 2) / ((s + 1) * (s + 3)), rel=1e-12)


def test_pulse_response_is_the_closed_form():
    """(s + 2)/((s + 1)(s + 3)) = 1/2 (1/(s + 1) + 1/(s + 3)): a step gives 2/3 - e^-t/2 - e^-3t/6."""
    t = np.arange(0, 4, 0.05)

    def step(time):
        return np.where(time > 0, 2 / 3 - np.exp(-time) / 2 - np.exp(-3 * time) / 6, 0.0)

    assert pulse_response(A, B, 0, t, 1.0) == pytest.approx(step(t) - step(t - 1.0), abs=1e-12)
