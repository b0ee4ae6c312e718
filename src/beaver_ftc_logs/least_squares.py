"""Plain least squares, and statistics of its residual.

X = Z / s,    y = X b + e,    b = P X' y;    the coefficients of Z are b / s

n, m    samples; columns
Z, y    regressors (n, m); the values to explain, (n,) or (n, k)
s, X    root mean square of each column (m,); the columns divided by it
b, e    coefficients of X (m,) or (m, k); residuals (n,) or (n, k)
P       inverse of X' X (m, m); in `fit_ols` the pseudo-inverse, since columns may depend on one another; in
        `coefficient_bounds` with a floor
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints
from beaver_ftc_logs.runs import runs_between

# Floor of the eigenvalues of X' X. `fit_ols` takes those that are smaller, over the largest, as 0;
# `coefficient_bounds` adds the floor times the number of rows to each.
EIGENVALUE_FLOOR = 1e-10
_RANK_TOLERANCE = 1e-12  # a column or an eigenvalue that is smaller, over the largest, is rounding
# Median of the chi-squared law with three degrees of freedom.
_MEDIAN_CHI2 = 2.366


@dataclass(frozen=True)
class Regression:
    """The result of `fit_ols`.

    coefficients (m, 3). residual_covariance (3, 3). standard_errors (m, 3) of the coefficients.
    standard_error_inflation (m, 3): standard errors over those for a white residual.
    coefficient_error_correlation (m, m): correlation of the errors of the coefficients, the same on each
    axis.
    """

    coefficients: Floats
    residual_covariance: Floats
    standard_errors: Floats
    standard_error_inflation: Floats
    coefficient_error_correlation: Floats


def fit_ols(Z: Floats, y: Floats, stretch: Ints, lag: int) -> Regression:
    """Ordinary least squares of the rates y (n, 3) on Z (n, m), with Newey-West standard errors:

        X = Z / s,   P = (X' X)^+,   b = P X' y,   e = y - X b,   R = e' e / max(n - m, 1)

    stretch (n,): number of the gap-free stretch of each row; the standard errors use products of residuals
    that are up to `lag` samples apart, within one stretch only. The coefficients of Z are b / s. Where the
    columns of Z depend on one another, b is the smallest of all solutions; a column that is only rounding
    gets 0.
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


def coefficient_bounds(Z: Floats, y: Floats, share: float, margin: float) -> tuple[Floats, Floats, float]:
    """Lower and upper bound on each coefficient of Z, (m,) each, and `noise_scale` of the residual. The rows
    of Z (3 n, m) and y (3 n,) are whitened, three a sample.

        P = (X' X + eps 3 n I)^-1,   b = P X' y,   e = y - X b
        bounds = (b -+ margin sqrt(diag(P) mean(e^2) / share)) / s

    eps: EIGENVALUE_FLOOR; it keeps the bounds finite, and far apart, where the columns depend on one another.
    share: number of white samples that have the information of one sample. margin: from a coefficient to its
    bounds, in standard errors.
    """
    s = rms_of_columns(Z)
    X = Z / s
    P = np.linalg.inv(X.T @ X + EIGENVALUE_FLOOR * len(X) * np.eye(X.shape[1]))
    b = P @ (X.T @ y)
    e2 = (y - X @ b) ** 2
    d = margin * np.sqrt(np.maximum(np.diag(P), 0.0) * e2.mean() / share)
    return (b - d) / s, (b + d) / s, noise_scale(e2)


def _newey_west(X: Floats, e: Floats, P: Floats, stretch: Ints, lag: int) -> Floats:
    """Standard errors (m,) that hold for autocorrelated residuals e (n,), with the weights of Bartlett:

        sqrt(diag(P S P)),    S = sum over l = -lag..lag of (1 - |l| / w) sum_k g[k] g[k-l]',    w = lag + 1

    g[k] = X[k] e[k] (m,): score of a sample. S is also the sum of windows[k] windows[k]' / w, with the sums
    windows[k] of w successive scores in a stretch.
    """
    scores = X * e[:, None]
    w = lag + 1
    S = np.zeros((X.shape[1], X.shape[1]))
    for begin, end in runs_between(np.diff(stretch) != 0):
        sums = np.cumsum(np.pad(scores[begin:end], ((w, w - 1), (0, 0))), axis=0)
        windows = sums[w:] - sums[:-w]
        S += windows.T @ windows / w
    return np.sqrt(np.maximum(np.diag(P @ S @ P), 0.0))


def rms_of_columns(Z: Floats) -> Floats:
    """Root mean square of each column of Z (n, m), above 0."""
    return np.maximum(np.sqrt((Z**2).mean(axis=0)), MIN_DIVISOR)


def left_by(Z: Floats, y: Floats) -> Floats:
    """Residual of the least squares of y, (n,) or (n, k), on Z (n, m)."""
    return y - Z @ np.linalg.lstsq(Z, y, rcond=None)[0]


def noise_scale(e2: Floats) -> float:
    """Scale of the variance of the noise, by the squares of a whitened residual (3 n,) or (n, 3). Faults of
    few samples hardly change it: it is the median of the sums over three axes, over the median of a
    chi-squared variable with three degrees of freedom."""
    return float(np.median(e2.reshape(-1, 3).sum(axis=1)) / _MEDIAN_CHI2)


def variance_inflation(Z: Floats) -> Floats:
    """Factor (m,) by which the other columns of Z (n, m) inflate the variance of each coefficient: 1 if a
    column is independent of the others, inf if they determine it or if it is constant.

        diag(C^-1) = sum over j of V[:, j]^2 / lam_j,    C = V diag(lam) V': correlation of the columns
    """
    X = Z - Z.mean(axis=0)
    norms = np.sqrt((X**2).sum(axis=0))
    factors = np.full(Z.shape[1], np.inf)
    varying = norms > _RANK_TOLERANCE * np.sqrt((Z**2).sum(axis=0))
    X = X[:, varying] / norms[varying]
    lam, V = np.linalg.eigh(X.T @ X)
    # An eigenvalue of 0 is so small instead that the columns in its direction get a factor of inf.
    lam = np.where(lam > _RANK_TOLERANCE * lam.max(initial=0.0), lam, _RANK_TOLERANCE**2)
    factors[varying] = (V**2 / lam).sum(axis=1)
    return np.where(factors < 1.0 / _RANK_TOLERANCE, factors, np.inf)


def spectral_density(e: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Frequencies, Hz, and one-sided spectral density of a residual e (n, 3) at each, by averaged
    periodograms of at most 256 samples."""
    from scipy import signal

    f, density = signal.welch(e, fs=rate_hz, nperseg=min(256, len(e)), axis=0)
    return f, density
