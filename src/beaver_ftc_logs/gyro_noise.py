"""The noise of a flight with noisier gyros than the fitted ones: its colour follows from the model.

A gyro's noise v adds to the measured rates, and the model predicts from these. With process noise e of
covariance Q and gyros of variance s2 the residual is

    w[k] = e[k] + v[k] - A1 v[k-1] - ... - Ah v[k-h]

a moving average whose autocovariance is known. The predictor of w[k] from earlier residuals solves the
Yule-Walker equations; a white residual is left, which no command of the past is correlated with, whatever the
law feeds back [Ljung1999, section 13.4].
"""

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats


def whitener(model: Model, process: Floats, gyro_rad_s: float, order: int) -> tuple[Floats, Floats]:
    """Coefficients (3 order, 3), latest lag first, that predict the residual from earlier ones, and the
    covariance (3, 3) of the rest. process: Q (3, 3), (rad/s)2; gyro_rad_s: standard deviation of a gyro."""
    gamma = _autocovariance(model, process, gyro_rad_s, order)
    lags = np.arange(order)
    blocks = np.array([[_at(gamma, int(j - i)) for j in lags] for i in lags])
    known = blocks.transpose(0, 2, 1, 3).reshape(3 * order, 3 * order)
    wanted = np.concatenate([_at(gamma, -int(i) - 1) for i in lags])
    by = np.linalg.solve(known, wanted)
    return np.asarray(by), np.asarray(gamma[0] - wanted.T @ by)


def _autocovariance(model: Model, process: Floats, gyro_rad_s: float, order: int) -> NDArray[np.float64]:
    """E w[k] w[k-t]' for t = 0 ... order, (order + 1, 3, 3)."""
    by_past = np.array(model.past)[: 3 * model.history].reshape(model.history, 3, 3)
    moving = np.concatenate([np.eye(3)[None], -by_past.transpose(0, 2, 1)])
    found = np.zeros((max(order, model.history) + 1, 3, 3))
    for t in range(len(moving)):
        found[t] = gyro_rad_s**2 * np.einsum("jab,jcb->ac", moving[t:], moving[: len(moving) - t])
    found[0] += process
    return found[: order + 1]


def _at(gamma: Floats, lag: int) -> Floats:
    """E w[k] w[k-lag]' at any lag."""
    return np.asarray(gamma[lag] if lag >= 0 else gamma[-lag].T)
