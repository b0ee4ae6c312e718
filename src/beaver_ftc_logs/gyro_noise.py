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


def residual_predictor_by_yule_walker(
    model: Model, process_covariance: Floats, gyro_noise_rad_s: float, n_lags: int
) -> tuple[Floats, Floats]:
    """Coefficients (3 n_lags, 3), latest lag first, that predict the residual from earlier ones, and the
    covariance (3, 3) of the rest. process_covariance: Q (3, 3), (rad/s)2; gyro_noise_rad_s: standard
    deviation of a gyro."""
    autocovariance = _residual_autocovariance(model, process_covariance, gyro_noise_rad_s, n_lags)
    lag_indices_from_zero = np.arange(n_lags)
    covariance_blocks = np.array(
        [
            [_autocovariance_at_lag(autocovariance, int(j - i)) for j in lag_indices_from_zero]
            for i in lag_indices_from_zero
        ]
    )
    past_residual_covariance = covariance_blocks.transpose(0, 2, 1, 3).reshape(3 * n_lags, 3 * n_lags)
    cross_covariance = np.concatenate(
        [_autocovariance_at_lag(autocovariance, -int(i) - 1) for i in lag_indices_from_zero]
    )
    predictor_coefficients = np.linalg.solve(past_residual_covariance, cross_covariance)
    return np.asarray(predictor_coefficients), np.asarray(
        autocovariance[0] - cross_covariance.T @ predictor_coefficients
    )


def _residual_autocovariance(
    model: Model, process_covariance: Floats, gyro_noise_rad_s: float, n_lags: int
) -> NDArray[np.float64]:
    """E w[k] w[k-t]' for lags t = 0 ... n_lags, (n_lags + 1, 3, 3)."""
    lagged_rate_coefficients = np.array(model.lagged_rate_and_signal_coefficients)[
        : 3 * model.n_rate_lags
    ].reshape(model.n_rate_lags, 3, 3)
    ma_coefficients = np.concatenate([np.eye(3)[None], -lagged_rate_coefficients.transpose(0, 2, 1)])
    autocovariance = np.zeros((max(n_lags, model.n_rate_lags) + 1, 3, 3))
    for lag in range(len(ma_coefficients)):
        autocovariance[lag] = gyro_noise_rad_s**2 * np.einsum(
            "jab,jcb->ac", ma_coefficients[lag:], ma_coefficients[: len(ma_coefficients) - lag]
        )
    autocovariance[0] += process_covariance
    return autocovariance[: n_lags + 1]


def _autocovariance_at_lag(autocovariance: Floats, lag: int) -> Floats:
    """E w[k] w[k-lag]' at any lag."""
    return np.asarray(autocovariance[lag] if lag >= 0 else autocovariance[-lag].T)
