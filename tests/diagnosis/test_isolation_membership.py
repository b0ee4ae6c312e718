"""Sets of parameters that agree with an innovation: inequalities solved by trying, and by hand."""

import numpy as np
import pytest
from kernels import estimator, new_fdi, on

from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.state import POSITION_HYPOTHESIS


@pytest.mark.parametrize("slope", [2.0, -2.0])
def test_the_parameters_that_agree_solve_the_inequality(slope):
    low, high = isolation.consistent_theta_interval(0.6, 0.2, slope, -5.0, 5.0)
    theta = np.linspace(-1, 1, 2001)
    agrees = theta[np.abs(0.6 - theta * slope) <= 0.2 + 1e-12]
    assert (low, high) == pytest.approx((agrees[0], agrees[-1]))
    low, high = isolation.consistent_theta_interval(0.6, 0.2, slope, -0.25, 0.25)
    assert sorted([abs(low), abs(high)]) == pytest.approx([0.2, 0.25])


def test_without_an_effect_every_parameter_agrees_or_none():
    assert isolation.consistent_theta_interval(-0.2, 0.2, 0.0, -1.0, 0.5) == (-1.0, 0.5)
    low, high = isolation.consistent_theta_interval(-0.21, 0.2, 0.0, -1.0, 0.5)
    assert low > high


def agreeing(innovation, **fields):
    fdi = new_fdi()
    fie = estimator(fdi, low=-1.0, high=0.0)
    fdi["bank"]["output"]["innovation"], fdi["bound"]["frame_innovation_bound"] = innovation, 0.1
    (
        fie["frame_mean_effect"]["regressor"],
        fie["frame_mean_effect"]["acceleration_at_zero_theta"],
        fie["frame_mean_effect"]["error_bound"],
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
    assert on(isolation.some_theta_explains_innovation, *agreeing(exact))
    assert on(isolation.some_theta_explains_innovation, *agreeing(exact + np.array([0.149, 0.149, -0.149])))
    # axis 0 allows theta up to -0.35 - ..., axis 2 asks for one below: no theta is left
    assert not on(isolation.some_theta_explains_innovation, *agreeing(exact + np.array([0.16, 0.0, 0.16])))
    assert on(
        isolation.some_theta_explains_innovation,
        *agreeing(exact + np.array([0.16, 0.0, 0.16]), ignored_axes=(0, 0, 1)),
    )
    assert on(isolation.some_theta_explains_innovation, *agreeing(np.full(3, 0.1)))  # what is healthy agrees
    assert not on(
        isolation.some_theta_explains_innovation, *agreeing(0.3 + 0.2 * np.array([1.0, 2.0, -1.0]))
    )  # a gain is no loss


@pytest.mark.parametrize("shared", [False, True])
def test_of_a_constant_theta_every_frame_leaves_what_it_agrees_with(shared):
    exact = 0.3 - 0.5 * np.array([1.0, 2.0, -1.0])
    fdi, fie = agreeing(exact)
    fdi["isolation"]["config"]["shares_theta_across_axes"] = shared
    fie["filtered_regressor"], fie["theta"], fie["filtered_uncertainty_bound"] = (0.5, 0.0, 1.0), -0.2, 0.05
    fie["residual"] = fie["filtered_regressor"] * (-0.5 + 0.2)
    assert on(isolation.narrow_feasible_theta_sets, fdi, fie)
    # frame: (0.1 + 0.05) / |Z|; filtered: 0.05 / |omega|
    half = np.minimum(0.15 / np.array([1.0, 2.0, 1.0]), [0.1, np.inf, 0.05])
    half = np.full(3, half.min()) if shared else half
    assert fie["feasible_theta_min"] == pytest.approx(-0.5 - half)
    assert fie["feasible_theta_max"] == pytest.approx(-0.5 + half)
    fie["feasible_theta_min"][2], fie["feasible_theta_max"][2] = -0.2, -0.1
    assert not on(isolation.narrow_feasible_theta_sets, fdi, fie)


def test_the_dominant_axis_is_that_of_the_largest_effect():
    effects = np.array([(3.0, 1, 2), (1, -3.0, 2), (1, 2, -3.0), (2, 2, 1)])
    assert [isolation.axis_of_largest_regressor(Z) for Z in effects] == [0, 1, 2, 0]


@pytest.mark.parametrize("instants", [1, 4])
def test_how_far_a_surface_can_have_been_is_narrowed_round_by_round(instants):
    """A position whose terms' errors grow with it: the room is a fixed point of where it can have been."""
    fdi = new_fdi()
    fie = estimator(fdi, POSITION_HYPOTHESIS, surface=1, low=-0.6, high=0.5)
    (
        fdi["config"]["n_substeps"],
        fdi["bank"]["output"]["innovation"],
        fdi["bound"]["frame_innovation_bound"],
    ) = (
        instants,
        (0.0, 0.9, 0.0),
        0.05,
    )
    (
        fdi["bound"]["surface_term_error_bound_per_rad"][:, 1],
        fdi["bound"]["surface_term_error_bound_at_command"][:, 1],
    ) = (
        (0.1, 0.4, 0.2),
        (0.01, 0.02, 0.2),
    )
    (
        fie["frame_mean_effect"]["regressor"],
        fie["frame_mean_effect"]["acceleration_at_zero_theta"],
        fie["frame_mean_effect"]["error_bound"],
    ) = (
        (0.1, 5.0, 1.0),
        -0.1,
        0.01,
    )
    fie["max_abs_deflection_in_last_frame"] = 0.3
    earlier = 2.0 * 0.3 / instants if instants > 1 else 0.0
    reach = 0.6
    for _ in range(isolation.N_DEFLECTION_BOUND_ITERATIONS):
        room = 0.05 + 0.01 + max(0.4 * (reach + earlier) - 0.02, 0.0)
        reach = min(reach, (1.0 + room) / 5.0)
    on(isolation.bound_deflection_and_widen_error, fdi, fie)
    assert fie["max_abs_deflection_in_last_frame"] == pytest.approx(reach)
    own = np.maximum(np.array([0.1, 0.4, 0.2]) * (reach + earlier) - [0.01, 0.02, 0.2], 0.0)
    assert fie["frame_mean_effect"]["error_bound"] == pytest.approx(0.01 + own)


def test_where_no_position_agrees_the_whole_travel_stays_possible():
    fdi = new_fdi()
    fie = estimator(fdi, POSITION_HYPOTHESIS, surface=1, low=-0.6, high=0.5)
    (
        fdi["config"]["n_substeps"],
        fdi["bank"]["output"]["innovation"],
        fdi["bound"]["frame_innovation_bound"],
    ) = (
        1,
        (0.0, 9.0, 0.0),
        0.05,
    )
    fdi["bound"]["surface_term_error_bound_per_rad"][:, 1] = 0.1
    fie["frame_mean_effect"]["regressor"] = 0.1, 5.0, 1.0
    on(isolation.bound_deflection_and_widen_error, fdi, fie)
    assert fie["max_abs_deflection_in_last_frame"] == 0.6
    assert fie["frame_mean_effect"]["error_bound"] == pytest.approx([0.06] * 3)
