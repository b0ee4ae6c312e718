"""Plain least squares, and statistics of what it leaves.

y = Z b + e,    X = Z / s,    b = P X' y / s

n, m    samples; columns
Z, y    regressors (n, m); what they explain, (n,) or (n, k)
s, X    root mean square of each column (m,); the columns divided by it
b, e    coefficients (m,) or (m, k); residuals (n,) or (n, k)
P       inverse of X' X (m, m); the pseudo-inverse in `fit_ols`, where columns may depend on one another
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints
from beaver_ftc_logs.runs import runs_between

# Least eigenvalue of X' X that counts, over the largest, or over the number of samples.
EIGENVALUE_FLOOR = 1e-10
_RANK_TOLERANCE = 1e-12  # of a column or an eigenvalue, over the largest: a smaller one is rounding
# Median of the chi-squared law with three degrees of freedom.
_MEDIAN_CHI2 = 2.366


@dataclass(frozen=True)
class Regression:
    """coefficients (m, 3); residual_covariance (3, 3); standard_errors (m, 3); standard_error_inflation: the
    factor by which the residuals' colour widens them over those of white ones, (m, 3);
    coefficient_error_correlation (m, m): of the coefficients' errors, alike on every axis."""

    coefficients: Floats
    residual_covariance: Floats
    standard_errors: Floats
    standard_error_inflation: Floats
    coefficient_error_correlation: Floats


def fit_ols(Z: Floats, y: Floats, stretch: Ints, lag: int) -> Regression:
    """Ordinary least squares of the rates y (n, 3) on Z (n, m), with Newey-West standard errors:

        X = Z / s,   P = (X' X)^+,   b = P X' y,   e = y - X b,   R = e' e / (n - m)

    stretch (n,): products of e over up to `lag` samples are formed within one gap-free stretch only.
    Directions that Z does not excite get the least coefficients that fit, and a column of nothing but
    rounding gets 0.
    """
    rms = rms_of_columns(Z)
    s = np.where(rms > _RANK_TOLERANCE * rms.max(), rms, np.inf)
    X = Z / s
    P: Floats = np.asarray(np.linalg.pinv(X.T @ X, rcond=EIGENVALUE_FLOOR), dtype=np.float64)
    b = P @ (X.T @ y)
    e = y - X @ b
    dof = max(len(y) - Z.shape[1], 1)
    R = e.T @ e / dof
    white = np.sqrt(np.maximum(np.outer(np.diag(P), np.diag(R)), 0.0))
    coloured = np.column_stack([_newey_west(X, e[:, i], P, stretch, lag) for i in range(y.shape[1])])
    inflation = np.divide(coloured, white, out=np.ones_like(coloured), where=white > 0)
    d = np.sqrt(np.maximum(np.diag(P), MIN_DIVISOR))
    return Regression(b / s[:, None], R, coloured / s[:, None], inflation, P / np.outer(d, d))


def _newey_west(X: Floats, e: Floats, P: Floats, stretch: Ints, lag: int) -> Floats:
    """Standard errors (m,) that hold for autocorrelated residuals e (n,), the root of diag(P S P): S sums the
    products of the scores X e with Bartlett's weights over `lag` lags."""
    scores = X * e[:, None]
    w = lag + 1
    S = np.zeros((X.shape[1], X.shape[1]))
    for begin, end in runs_between(np.diff(stretch) != 0):
        # Bartlett's weights are those of products of running sums
        sums = np.cumsum(np.pad(scores[begin:end], ((w, w - 1), (0, 0))), axis=0)
        windows = sums[w:] - sums[:-w]
        S += windows.T @ windows / w
    return np.sqrt(np.maximum(np.diag(P @ S @ P), 0.0))


def rms_of_columns(Z: Floats) -> Floats:
    """Root mean square of each column of Z (n, m), above 0."""
    return np.maximum(np.sqrt((Z**2).mean(axis=0)), MIN_DIVISOR)


def left_by(Z: Floats, y: Floats) -> Floats:
    """What least squares on Z (n, m) leaves of y (n,) or (n, k)."""
    return y - Z @ np.linalg.lstsq(Z, y, rcond=None)[0]


def noise_scale(e2: Floats) -> float:
    """The scale of the noise by the squares of what is left, (3 n,), which faults of few samples do not
    change."""
    return float(np.median(e2.reshape(-1, 3).sum(axis=1)) / _MEDIAN_CHI2)


def variance_inflation(Z: Floats) -> Floats:
    """How much the variance of each column's coefficient is inflated by the other columns of Z (n, m): 1
    alone, inf dependent. That is the diagonal of the inverse of the correlation C = V lam V'."""
    X = Z - Z.mean(axis=0)
    norms = np.sqrt((X**2).sum(axis=0))
    factors = np.full(Z.shape[1], np.inf)
    varying = norms > 1e-12
    X = X[:, varying] / norms[varying]
    lam, V = np.linalg.eigh(X.T @ X)
    lam = np.where(lam > _RANK_TOLERANCE * lam.max(initial=0.0), lam, _RANK_TOLERANCE**2)
    factors[varying] = (V**2 / lam).sum(axis=1)
    return np.where(factors < 1.0 / _RANK_TOLERANCE, factors, np.inf)


def spectral_density(e: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and one-sided spectral density of a residual e (n, 3) at each, by averaged
    periodograms of at most 256 samples."""
    from scipy import signal

    f, density = signal.welch(e, fs=rate_hz, nperseg=min(256, len(e)), axis=0)
    return f, density
