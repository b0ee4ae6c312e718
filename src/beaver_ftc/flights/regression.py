"""Least squares with what a coloured residual does to its covariance, and which regressors are collinear."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.flights.recording import Floats

_RIDGE = 1e-10


@dataclass(frozen=True)
class Fit:
    """coefficients (m, 3); residuals (n, 3); covariance (3, 3) of the residuals; standard errors (m, 3) and
    the factor by which the residuals' colour widens them over those of white ones, (m, 3); correlation (m, m)
    of the coefficients' errors, alike on every axis."""

    coefficients: Floats
    residuals: Floats
    covariance: Floats
    standard_errors: Floats
    colour: Floats
    correlation: Floats


def least_squares(x: Floats, y: Floats, run: NDArray[np.int64], reach: int) -> Fit:
    """Ordinary least squares of y (n, 3) on x (n, m), with Newey-West standard errors over `reach` lags.

    run (n,): products of residuals are formed within one gap-free stretch only. Directions that x does not
    excite get the least coefficients that fit.
    """
    scale = np.maximum(np.sqrt((x**2).mean(axis=0)), 1e-300)
    z = x / scale
    inverse = np.linalg.pinv(z.T @ z, rcond=_RIDGE, hermitian=True)
    coefficients = inverse @ (z.T @ y)
    residuals = y - z @ coefficients
    free = max(len(y) - x.shape[1], 1)
    covariance = residuals.T @ residuals / free
    white = np.sqrt(np.maximum(np.outer(np.diag(inverse), np.diag(covariance)), 0.0))
    robust = np.column_stack(
        [_newey_west(z, residuals[:, i], inverse, run, reach) for i in range(y.shape[1])]
    )
    colour = np.divide(robust, white, out=np.ones_like(robust), where=white > 0)
    size = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return Fit(
        coefficients / scale[:, None], residuals, covariance, robust / scale[:, None], colour,
        inverse / np.outer(size, size),
    )  # fmt: skip


def _newey_west(z: Floats, e: Floats, inverse: Floats, run: NDArray[np.int64], reach: int) -> Floats:
    """Standard errors that hold for autocorrelated residuals: Bartlett weights over `reach` lags."""
    score = z * e[:, None]
    middle = score.T @ score
    for lag in range(1, min(reach, len(e) - 1) + 1):
        together = (run[lag:] == run[:-lag])[:, None]
        product = (score[lag:] * together).T @ score[:-lag]
        middle += (1.0 - lag / (reach + 1.0)) * (product + product.T)
    return np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 0.0))


def variance_inflation(x: Floats) -> Floats:
    """How much each column's coefficient's variance is inflated by the others: 1 alone, inf dependent."""
    z = x - x.mean(axis=0)
    norm = np.sqrt((z**2).sum(axis=0))
    factors = np.full(x.shape[1], np.inf)
    live = norm > 1e-12
    correlation = (z[:, live] / norm[live]).T @ (z[:, live] / norm[live])
    factors[live] = np.diag(np.linalg.pinv(correlation, rcond=1e-12, hermitian=True))
    return factors


def spectrum(residuals: Floats, dt_s: float, segment: int = 256) -> tuple[Floats, Floats]:
    """One-sided spectral density of each residual, (f,) Hz and (f, 3), by averaged periodograms."""
    from scipy import signal

    length = min(segment, len(residuals))
    frequency, density = signal.welch(residuals, fs=1.0 / dt_s, nperseg=length, axis=0, detrend="constant")
    return frequency, density
