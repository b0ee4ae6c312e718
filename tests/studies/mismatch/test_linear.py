"""Linear analysis: JSBSim's modes and surfaces against FDC's over the envelope."""

import dataclasses

import numpy as np
import pytest

from beaver_ftc.design import fdc
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plant.adapter import FlightState
from beaver_ftc.plant.linear import own
from beaver_ftc.studies.linear_systems import (
    MODES,
)
from beaver_ftc.studies.mismatch.linear import analyse, in_fdc
from flying import scenario

ENVELOPE = [(30, 0), (35, 1828.8), (45, 1828.8), (50, 3000), (55, 4000)]

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


def test_jsbsims_own_linearisation_is_refused_where_it_would_be_wrong():
    with pytest.raises(SimulationFailed, match="sideslip"):
        own(scenario(), FlightState(45.0, 1000.0, beta_rad=0.01))
