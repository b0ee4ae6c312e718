"""Sets of parameters that agree with an innovation: inequalities solved by trying, and by hand."""

import numpy as np
import pytest
from kernels import estimator, new_fdi, on

from beaver_ftc.diagnosis import isolation


@pytest.mark.parametrize("slope", [2.0, -2.0])
def test_the_parameters_that_agree_solve_the_inequality(slope):
    low, high = isolation.consistent_theta(0.6, 0.2, slope, -5.0, 5.0)
    theta = np.linspace(-1, 1, 2001)
    agrees = theta[np.abs(0.6 - theta * slope) <= 0.2 + 1e-12]
    assert (low, high) == pytest.approx((agrees[0], agrees[-1]))
    low, high = isolation.consistent_theta(0.6, 0.2, slope, -0.25, 0.25)
    assert sorted([abs(low), abs(high)]) == pytest.approx([0.2, 0.25])


def agreeing(innovation, **fields):
    fdi = new_fdi()
    fie = estimator(fdi, low=-1.0, high=0.0)
    fdi["bank"]["output"]["innovation"], fdi["bound"]["nu_max"] = innovation, 0.1
    (
        fie["effect"]["regressor"],
        fie["effect"]["base"],
        fie["effect"]["e"],
    ) = (
        (1.0, 2.0, -1.0),
        0.3,
        0.05,
    )
    for name, value in fields.items():
        fie[name] = value
    return fdi, fie


def test_one_theta_has_to_explain_all_axes():
    theta = -0.5
    exact = 0.3 + theta * np.array([1.0, 2.0, -1.0])
    assert on(isolation.theta_explains, *agreeing(exact))
    assert on(isolation.theta_explains, *agreeing(exact + np.array([0.149, 0.149, -0.149])))
    # axis 0 allows theta up to -0.35 - ..., axis 2 asks for one below: no theta is left
    assert not on(isolation.theta_explains, *agreeing(exact + np.array([0.16, 0.0, 0.16])))
    assert on(
        isolation.theta_explains,
        *agreeing(exact + np.array([0.16, 0.0, 0.16]), skip=(0, 0, 1)),
    )
    assert on(isolation.theta_explains, *agreeing(np.full(3, 0.1)))  # what is healthy agrees
    assert not on(
        isolation.theta_explains, *agreeing(0.3 + 0.2 * np.array([1.0, 2.0, -1.0]))
    )  # a gain is no loss


@pytest.mark.parametrize("shared", [False, True])
def test_of_a_constant_theta_every_frame_leaves_what_it_agrees_with(shared):
    exact = 0.3 - 0.5 * np.array([1.0, 2.0, -1.0])
    fdi, fie = agreeing(exact)
    fdi["isolation"]["config"]["shared"] = shared
    fie["Om"], fie["theta"], fie["e"] = (0.5, 0.0, 1.0), -0.2, 0.05
    fie["residual"] = fie["Om"] * (-0.5 + 0.2)
    assert on(isolation.narrow_sets, fdi, fie)
    # frame: (0.1 + 0.05) / |Z|; filtered: 0.05 / |omega|
    half = np.minimum(0.15 / np.array([1.0, 2.0, 1.0]), [0.1, np.inf, 0.05])
    half = np.full(3, half.min()) if shared else half
    assert fie["set_lo"] == pytest.approx(-0.5 - half)
    assert fie["set_hi"] == pytest.approx(-0.5 + half)
    fie["set_lo"][2], fie["set_hi"][2] = -0.2, -0.1
    assert not on(isolation.narrow_sets, fdi, fie)
