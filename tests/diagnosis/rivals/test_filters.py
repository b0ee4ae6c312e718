"""The filters on their own ground: against closed forms, batch solutions and the statistics they promise."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.rivals.imm import (
    mix_states,
    posterior_probabilities,
    transition_matrix,
)
from beaver_ftc.diagnosis.rivals.kalman import (
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


@pytest.mark.parametrize("spread", [3.0, 6.0, 7.5])
def test_sigma_points_have_the_mean_and_the_covariance(spread):
    z, P = RNG.normal(size=6), _covariance(6)
    points, weights = sigma_points(z, P, spread)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ points == pytest.approx(z)
    assert (points - z).T @ np.diag(weights) @ (points - z) == pytest.approx(P)


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
