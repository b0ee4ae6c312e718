"""Kalman filter steps, one or many filters at a time: leading axes are filters.

    predict    P- = F P F' + Q           update    S = H P H' + R,  K = P H' S^-1,  z+ = z + K nu,  P+ = P -
    K S K'

[Simon2006, ch. 5], sigma points [Julier2004]. H picks the first states: what is measured are the body rates.
"""

import numpy as np


def update(
    z: np.ndarray, P: np.ndarray, nu: np.ndarray, R: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Condition (z, P) on the innovation nu (..., m) of the first m states; returns z, P and S (..., m,
    m)."""
    m = nu.shape[-1]
    S = P[..., :m, :m] + R
    K = np.linalg.solve(S, P[..., :m, :]).swapaxes(-1, -2)
    z = z + (K @ nu[..., None])[..., 0]
    P = P - K @ P[..., :m, :]
    return z, 0.5 * (P + P.swapaxes(-1, -2)), S


def normalised_square(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """nu' S^-1 nu: chi-square with as many degrees of freedom as nu has entries, if the filter is right."""
    return np.einsum("...i,...i->...", nu, np.linalg.solve(S, nu[..., None])[..., 0])


def log_likelihood(nu: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Logarithm of the Gaussian density of the innovation."""
    m = nu.shape[-1]
    return -0.5 * (normalised_square(nu, S) + np.linalg.slogdet(S)[1] + m * np.log(2.0 * np.pi))


def sigma_points(z: np.ndarray, P: np.ndarray, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """2 n + 1 points (2 n + 1, n) and their weights (2 n + 1,) with the mean z and the covariance P.

    spread is n + kappa [Julier2004, eq. 12]; 3 matches the fourth moment of a Gaussian in one dimension.
    """
    n = len(z)
    root = _root(spread * P).T
    points = np.concatenate((z[None], z + root, z - root))
    weights = np.full(2 * n + 1, 0.5 / spread)
    weights[0] = 1.0 - n / spread
    return points, weights


def _root(P: np.ndarray) -> np.ndarray:
    """L with L L' = P. Where rounding has cost P its definiteness, as after a reading far beyond what the
    filter expects, what is below zero counts as nothing."""
    try:
        return np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
        root: np.ndarray = vectors * np.sqrt(np.maximum(values, 0.0))
        return root
