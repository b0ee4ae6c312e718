"""The steps of trim one by one, what is said where there is none, and the truth's slopes about it."""

from dataclasses import replace
from math import cos

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import differences, own
from beaver_ftc.scenario.schema import load as load_scenario


def said(call, *arguments, error=BadInput):
    with pytest.raises(error) as caught:
        call(*arguments)
    return str(caught.value)


def test_slopes_by_jsbsim_itself_are_those_by_differences():
    scenario = load_scenario({})
    plant, point = trimmed(scenario)
    level = replace(point, beta_rad=0.0)
    theirs = own(scenario, level)
    ours = differences(plant, level)
    states = ("airspeed", "alpha", "p", "q", "r", "phi", "theta", "psi", "altitude")
    found, expected = theirs.of(states), ours.of(states)
    np.testing.assert_allclose(found.A, expected.A, atol=2e-2)
    np.testing.assert_allclose(found.B, expected.B[:, :3], atol=2e-2)
    assert theirs.states[-3:] != ours.states[-3:]
    over_ground = theirs.of(
        ("north", "east", "airspeed", "psi")
    ).A  # it flies to the north, level but for a bit
    V = cos(level.gamma_rad) * level.airspeed_mps
    assert over_ground[0, 2] * level.airspeed_mps == pytest.approx(V, rel=5e-3)
    assert over_ground[1, 3] == pytest.approx(V, rel=5e-3)
    assert (over_ground[0, 3], over_ground[1, 2]) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert found.inputs == ("aileron", "elevator", "rudder")
    assert (
        said(own, scenario, point, error=SimulationFailed)
        == "JSBSim linearises rightly only with no sideslip"
    )
