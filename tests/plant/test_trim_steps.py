"""The steps of trim one by one, what is said where there is none, and the truth's slopes about it."""

from dataclasses import replace
from math import cos

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant import trim as steps
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import differences, own
from beaver_ftc.plant.trim import trim
from beaver_ftc.scenario.schema import load as load_scenario


def said(call, *arguments, error=BadInput):
    with pytest.raises(error) as caught:
        call(*arguments)
    return str(caught.value)


def test_a_quick_look_is_the_full_start_s_accelerations():
    truth = Plant(rate_hz=100)
    point = trim(45.0, 1000.0, plant=truth)
    names = ("alpha_rad", "beta_rad", "theta_rad", "aileron_rad", "elevator_rad", "rudder_rad")
    look = steps._looking(truth, point)
    off = np.array([0.01, 0.02, -0.03, 0.04, -0.05, 0.06])
    x = np.array([getattr(point, name) for name in names]) + off
    for _ in range(3):  # the side force of betadot lags a look
        quick = look(x)
    truth.start(replace(point, **dict(zip(names, x.tolist(), strict=True))))
    assert quick == pytest.approx([truth.read(n) * factor for n, factor in steps.ACCELERATIONS], abs=1e-5)
    assert len(steps.ACCELERATIONS) == 6


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
