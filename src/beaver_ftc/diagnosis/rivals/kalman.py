"""Kalman filter steps, one or many filters at a time: leading axes are filters.

    predict    P- = F P F' + Q
    update     S = H P H' + R,  K = P H' S^-1,  z+ = z + K nu,  P+ = P - K S K'

[Simon2006, ch. 5], sigma points [Julier2004]. H picks the first states: what is measured are the body rates.

Turbulence is the rotation of the air as three more states, a first-order process for each axis, as declared
(design/context.py):

    g[k+1] = a g[k] + sqrt(1 - a^2) sigma w[k],   a = exp(-dt / tau),      xdot = f + G u + B g
"""

import numpy as np

from beaver_ftc.design.context import Context


class TurbulenceModel:
    """The model of turbulence: rotation of the air about n_states axes, 3, or 0 if no turbulence is declared.

    a (n,): a, over a frame. process_noise_variance (n,), initial_variance (n,): (rad/s)^2.
    rate_effect (3, n): dt B, change of the rates over a frame per rad/s of the air.
    """

    def __init__(self, context: Context) -> None:
        declared_uncertainty, dt = context.declared, context.dt_s
        self.n_states = 3 if declared_uncertainty.air else 0
        self.a = np.exp(-dt / declared_uncertainty.gust_time_s[: self.n_states])
        self.initial_variance = declared_uncertainty.gust_rad_s[: self.n_states] ** 2
        self.process_noise_variance = (1.0 - self.a**2) * self.initial_variance
        self.rate_effect = dt * declared_uncertainty.gust_effect[:, : self.n_states]


def unexplained_acceleration_size(context: Context, eta_bar: np.ndarray) -> np.ndarray:
    """Return the assumed size (3,) rad/s2 of the acceleration that nothing explains.

    The declared bound, eta_bar, as long as it is the published one; with more declared that bound is the sum
    of all worst cases, instruments and air included, which have states or a variance of their own here.
    """
    declared_uncertainty = context.declared
    return (
        np.hypot(context.constant_rad_s2, declared_uncertainty.model_rad_s2)
        if declared_uncertainty.errors
        else eta_bar
    )


def update_state_and_covariance(
    state: np.ndarray, P: np.ndarray, nu: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Condition (state, P) on the innovation nu (..., m) of the first m states; returns state, P and
    S (..., m, m)."""
    n_measured = nu.shape[-1]
    S = P[..., :n_measured, :n_measured] + R
    K = np.linalg.solve(S, P[..., :n_measured, :]).swapaxes(-1, -2)
    state = state + (K @ nu[..., None])[..., 0]
    P = P - K @ P[..., :n_measured, :]
    return state, 0.5 * (P + P.swapaxes(-1, -2)), S


def normalised_innovation_square(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """nu' S^-1 nu: chi-square with as many degrees of freedom as nu has entries, if the filter is right."""
    return np.einsum("...i,...i->...", nu, np.linalg.solve(S, nu[..., None])[..., 0])


def log_likelihood(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Logarithm of the Gaussian density of the innovation."""
    n_measured = nu.shape[-1]
    return -0.5 * (
        normalised_innovation_square(nu, S) + np.linalg.slogdet(S)[1] + n_measured * np.log(2.0 * np.pi)
    )


def sigma_points(state: np.ndarray, P: np.ndarray, covariance_factor: float) -> tuple[np.ndarray, np.ndarray]:
    """2 n + 1 points (2 n + 1, n) and their weights (2 n + 1,) with the mean `state` and the covariance P.

    covariance_factor is n + kappa [Julier2004, eq. 12]; 3 matches the fourth moment of a Gaussian in one
    dimension.
    """
    n_states = len(state)
    point_offsets = _matrix_root(covariance_factor * P).T
    state_points = np.concatenate((state[None], state + point_offsets, state - point_offsets))
    point_weights = np.full(2 * n_states + 1, 0.5 / covariance_factor)
    point_weights[0] = 1.0 - n_states / covariance_factor
    return state_points, point_weights


def _matrix_root(P: np.ndarray) -> np.ndarray:
    """L with L L' = P. Where rounding has cost P its definiteness, as after a reading far beyond what the
    filter expects, what is below zero counts as nothing."""
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        eigenvalues, eigenvectors = np.linalg.eigh(P)
        matrix_root: np.ndarray = eigenvectors * np.sqrt(np.maximum(eigenvalues, 0.0))
        return matrix_root
