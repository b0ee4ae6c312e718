"""The noise model of a flight with noisier gyros than the fitted ones, from the model of the rates.

A gyro's noise v adds to the measured rates, and the model predicts from these. With process noise e of
covariance Q and gyros of variance s2 the residual is

    w[k] = e[k] + v[k] - A1 v[k-1] - ... - Ah v[k-h]

a moving average whose autocovariance is known. The predictor of w[k] from earlier residuals solves the
Yule-Walker equations. The residual of this prediction is white, so no past command is correlated with it,
whatever the law feeds back [Ljung1999, section 13.4].

Q (3, 3): (rad/s)2. s: standard deviation of a gyro, rad/s. A (h, 3, 3). M (h + 1, 3, 3) = (1, -A1, ..., -Ah).
Rows 3 (j - 1) to 3 j of the model's `past` are Aj', since `past` multiplies from the right.
"""

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats


def yule_walker_predictor(model: Model, Q: Floats, s: float, L: int) -> tuple[Floats, Floats]:
    """Coefficients B (3 L, 3), latest lag first, that predict the residual from L earlier ones, and the
    covariance (3, 3) of the prediction error, (rad/s)2:

        P B = S,   covariance = R[0] - S' B

    R (L + 1, 3, 3): autocovariance of the residual. P (3 L, 3 L): covariance of the earlier residuals,
    (rad/s)2. S (3 L, 3): covariance of these with the residual, (rad/s)2. B has no unit.
    """
    R = _autocovariance(model, Q, s, L)
    R_two_sided = np.concatenate([R[:0:-1].transpose(0, 2, 1), R])  # R at lags -L to L: R[-t] = R[t]'
    lags = np.arange(L)
    P = R_two_sided[L + lags - lags[:, None]].transpose(0, 2, 1, 3).reshape(3 * L, 3 * L)
    S = R_two_sided[L - 1 - lags].reshape(3 * L, 3)
    B = np.linalg.solve(P, S)
    return B, R[0] - S.T @ B


def _autocovariance(model: Model, Q: Floats, s: float, L: int) -> Floats:
    """R[t] = E w[k] w[k-t]' for lags t = 0 ... L, (L + 1, 3, 3): s2 sum_j M[t+j] M[j]', and Q at t = 0."""
    A = np.array(model.past)[: 3 * model.history].reshape(model.history, 3, 3).transpose(0, 2, 1)
    M = np.concatenate([np.eye(3)[None], -A])
    R = np.zeros((max(L, model.history) + 1, 3, 3))
    for t in range(len(M)):
        R[t] = s**2 * np.einsum("jab,jcb->ac", M[t:], M[: len(M) - t])
    R[0] += Q
    return R[: L + 1]
