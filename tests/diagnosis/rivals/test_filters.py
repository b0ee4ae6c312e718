"""The filters on their own ground: against closed forms, batch solutions and the statistics they promise."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from beaver_ftc.diagnosis.rivals.imm import (
    InteractingMultipleModels,
    mix_states,
    posterior_probabilities,
    transition_matrix,
)
from beaver_ftc.diagnosis.rivals.kalman import (
    log_likelihood,
    normalised_innovation_square,
    sigma_points,
    update_state_and_covariance,
)
from beaver_ftc.diagnosis.rivals.rls import RecursiveLeastSquaresFit

RNG = np.random.default_rng(7)


def _covariance(n):
    A = RNG.normal(size=(n, n))
    return A @ A.T + 0.1 * np.eye(n)


def test_an_update_is_the_conditional_gaussian():
    """Condition the joint Gaussian of (state, measurement) by Schur's complement."""
    z, P, R = RNG.normal(size=5), _covariance(5), _covariance(2)
    y = RNG.normal(size=2)
    H = np.eye(2, 5)
    S = H @ P @ H.T + R
    mean = z + P @ H.T @ np.linalg.inv(S) @ (y - H @ z)
    covariance = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)  # the information form
    got_z, got_P, got_S = update_state_and_covariance(z, P, y - z[:2], R)
    assert got_z == pytest.approx(mean)
    assert got_P == pytest.approx(covariance)
    assert got_S == pytest.approx(S)


def test_a_filter_run_is_the_batch_posterior():
    """A random walk seen in noise: the last filtered state is the marginal of one big Gaussian problem."""
    n, q, r = 30, 0.3, 0.7
    y = RNG.normal(size=n)
    z, P = np.zeros(1), np.eye(1)
    for value in y:
        P = P + q
        z, P, _ = update_state_and_covariance(z, P, np.array([value]) - z, np.array([[r]]))
    walk = 1.0 + q * (1.0 + np.minimum.outer(np.arange(n), np.arange(n)))
    gain = walk @ np.linalg.inv(walk + r * np.eye(n))
    assert z[0] == pytest.approx((gain @ y)[-1])
    assert P[0, 0] == pytest.approx((walk - gain @ walk)[-1, -1])


def test_the_variance_settles_at_the_riccati_equations_root():
    q, r = 0.02, 0.5
    P = np.eye(1)
    for _ in range(500):
        _, P, _ = update_state_and_covariance(np.zeros(1), P + q, np.zeros(1), np.array([[r]]))
    assert P[0, 0] == pytest.approx((-q + np.sqrt(q * q + 4 * q * r)) / 2)


def test_a_stack_of_filters_is_each_filter_alone():
    z, nu, R = RNG.normal(size=(4, 3)), RNG.normal(size=(4, 3)), _covariance(3)
    P = np.array([_covariance(3) for _ in range(4)])
    together = update_state_and_covariance(z, P, nu, R)
    for i in range(4):
        for all_of_them, alone in zip(
            together, update_state_and_covariance(z[i], P[i], nu[i], R), strict=True
        ):
            assert all_of_them[i] == pytest.approx(alone)


def test_likelihood_and_square_are_the_gaussians():
    S = _covariance(3)
    nu = RNG.multivariate_normal(np.zeros(3), S, size=20_000)
    assert log_likelihood(nu[:5], S) == pytest.approx(multivariate_normal(np.zeros(3), S).logpdf(nu[:5]))
    share = np.mean(normalised_innovation_square(nu, S) > chi2.ppf(0.99, 3))
    assert share == pytest.approx(0.01, abs=0.002)


@pytest.mark.parametrize("spread", [3.0, 6.0, 7.5])
def test_sigma_points_have_the_mean_and_the_covariance(spread):
    z, P = RNG.normal(size=6), _covariance(6)
    points, weights = sigma_points(z, P, spread)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ points == pytest.approx(z)
    assert (points - z).T @ np.diag(weights) @ (points - z) == pytest.approx(P)


def test_sigma_points_carry_a_square_exactly():
    """E[x' A x] = z' A z + trace(A P) for any quadratic: what a linearisation misses."""
    z, P, A = RNG.normal(size=4), _covariance(4), RNG.normal(size=(4, 4))
    points, weights = sigma_points(z, P, 4.0)
    squares = np.einsum("ki,ij,kj->k", points, A, points)
    assert weights @ squares == pytest.approx(z @ A @ z + np.trace(A @ P))


def test_recursive_least_squares_is_the_weighted_batch_solution():
    forgetting, prior, n = 0.97, 1e3, 200
    phi, w = RNG.normal(size=(n, 4)), RNG.normal(size=4)
    y = phi @ w + 0.3 * RNG.normal(size=n)
    rls = RecursiveLeastSquaresFit(4, forgetting, prior)
    for row, value in zip(phi, y, strict=True):
        rls.step(row, value)
    weight = forgetting ** np.arange(n)[::-1]
    information = phi.T @ (phi * weight[:, None]) + np.eye(4) * forgetting**n / prior
    # the cap on P touches the first samples only, which are all but forgotten
    assert rls.weights == pytest.approx(np.linalg.solve(information, phi.T @ (weight * y)), rel=1e-4)


def test_recursive_least_squares_does_not_wind_up_without_excitation():
    rls = RecursiveLeastSquaresFit(2, 0.9, 100.0)
    for _ in range(5000):
        rls.step(np.array([1.0, 0.0]), 1.0)
    assert np.isfinite(rls.P).all()
    assert rls.P.max() <= 100.0


def test_without_switching_the_modes_are_weighed_by_bayes_rule():
    """Probabilities after many samples are prior times the product of likelihoods."""
    likelihoods = RNG.normal(size=(15, 3))
    probability = np.array([0.2, 0.3, 0.5])
    for row in likelihoods:
        probability = posterior_probabilities(probability, row)
    expected = np.array([0.2, 0.3, 0.5]) * np.exp(likelihoods.sum(axis=0))
    assert probability == pytest.approx(expected / expected.sum(), abs=1e-9)


def test_mixing_keeps_the_mixtures_mean_and_covariance():
    """What is mixed and weighed again is the same distribution in its first two moments."""
    x, P = RNG.normal(size=(3, 2)), np.array([_covariance(2) for _ in range(3)])
    probability, chain = np.array([0.5, 0.3, 0.2]), transition_matrix(0.9, 3)

    def moments(p, mean, covariance):
        centre = p @ mean
        off = mean - centre
        return centre, np.einsum("i,iab->ab", p, covariance + off[:, :, None] * off[:, None, :])

    mixed_x, mixed_P, predicted = mix_states(x, P, probability, chain)
    assert predicted == pytest.approx(probability @ chain)
    for before, after in zip(moments(probability, x, P), moments(predicted, mixed_x, mixed_P), strict=True):
        assert after == pytest.approx(before)


def test_a_chain_keeps_probability():
    chain = transition_matrix(0.99, 5)
    assert chain.sum(axis=1) == pytest.approx(np.ones(5))
    assert np.linalg.matrix_power(chain, 5000)[0] == pytest.approx(np.full(5, 0.2), abs=1e-6)


def test_sigma_points_of_a_covariance_that_rounding_has_bent_are_still_those_of_it():
    """1e6 along one direction and, by rounding, a little less than nothing along another."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    P = turn @ np.diag([1e6, 1.0, -1e-9]) @ turn.T
    points, weights = sigma_points(np.array([1.0, 2.0, 3.0]), P, 3.0)
    off = points - weights @ points
    assert (off.T * weights) @ off == pytest.approx(P, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("losses", "unknown", "says"),
    [
        ([(0.1, 0.2, 0.2), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)], 0.1, {"detected": False}),
        ([(0.0, 0.0, 0.01), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)], 0.98, {"isolated": "unanticipated"}),
        (
            [(0.0, 0.0, 0.01), (0.5, 0.2, 0.2), (0.0, 0.03, 0.0)], 0.05,
            {"isolated": "elevator", "axis": "q", "estimate": -(0.25 * 0.5 + 0.5 * 0.2 + 0.9 * 0.2) / 0.9},
        ),
        (
            [(0.1, 0.1, 0.04), (0.05, 0.04, 0.01), (0.2, 0.2, 0.1)], 0.15,
            {"isolated": None, "axis": "r", "candidates": ("aileron", "rudder")},
        ),
        ([(0.1, 0.05, 0.04), (0.05, 0.2, 0.01), (0.2, 0.2, 0.1)], 0.04,
         {"isolated": None, "axis": "r", "candidates": ("elevator", "rudder")}),
    ],
)  # fmt: skip
def test_multiple_models_name_the_surface_that_their_probabilities_add_up_to(losses, unknown, says):
    """Named from 0.8 on; else all above 0.2 are candidates, by the sum over the levels of a loss."""
    imm = object.__new__(InteractingMultipleModels)
    imm.options, imm.detected = {"alarm": 2.0, "isolate": 0.8}, False
    imm.context = SimpleNamespace(leaders=("aileron", "elevator", "rudder"))
    healthy = 1.0 - np.sum(losses) - unknown
    imm.mode_probabilities = np.array([healthy, *np.ravel(losses), unknown])
    found = imm.latch_alarm_and_decide_verdict()
    assert found.statistic == pytest.approx(np.log((1.0 - healthy) / healthy) / 2.0)
    assert found.detected is says.pop("detected", True)
    for name, value in says.items():
        assert getattr(found, name) == (pytest.approx(value) if name == "estimate" else value), name
