"""Kalman filters with the surfaces' effectiveness as states: what they share, and how each names a fault.

    z = (p, q, r, theta of the surface that leads roll, pitch, yaw)
    x[k+1] = x[k] + dt (f + G u + sum_s theta_s G_s u_s),     theta[k+1] = theta[k] + a random walk

    x = (p, q, r)   rad/s             f    rad/s2        acceleration without surfaces
    G_s u_s         rad/s2            effect of surface s
    theta           1, in [-1, 0]     minus the lost share of the effectiveness [Zhang2005, eq. (4)]
    nu, S           rad/s, (rad/s)2   innovation and its covariance

The filters assume white noise, and the declared bound on the uncertainty describes none. `noise` times this
bound (`KalmanRival.add_noise`) is taken for the standard deviation. The declared gyro noise is that of the
measurement; declared turbulence adds states (kalman.py).
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals.kalman import KalmanRival, normalised_innovation_square, sigma_points
from beaver_ftc.diagnosis.rivals.rival import UNANTICIPATED

_STEP_RAD_S = 1e-6  # for df/dx: f is quadratic in x, so a central difference is exact to rounding
_STEPS = _STEP_RAD_S * np.vstack((np.eye(3), -np.eye(3)))
N_RATES, THETA, N_STATES_WITHOUT_GUSTS = 3, slice(3, 6), 6
_MAX_SQUARE = 1e6  # limit of nu' S^-1 nu, so that its mean recovers after wrong readings of a broken sensor
DEFAULT_OPTIONS = {
    "noise": 3.0,  # standard deviation of the acceleration error over its declared bound
    "drift_per_s": 0.1,  # random walk of theta, 1/sqrt(s)
    "measurement_rad_s": 1e-5,  # standard deviation of the measured rates
    "misfit": 3.0,  # mean nu' S^-1 nu over its expected value, above which no surface fits
    "misfit_s": 0.5,  # time over which nu' S^-1 nu is averaged
}


class EffectivenessFilter(KalmanRival):
    """Base of the augmented filters; they differ in `predict` and in `statistic`.

    KalmanRival provides z (n,) and P (n, n), mean and covariance of the state; F (n, n), the constant part of
    the transition; `fill_model`, `move` and `add_noise`. RivalDetector provides options, context, dt, s, and
    `leading` (3,), the index of the surface that leads each axis.
    """

    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS

    def start(self) -> None:
        """Start healthy, with a standard deviation of 0.1 of theta."""
        self.fill_model(n_theta=3, theta_variance=0.01, walk=self.options["drift_per_s"] ** 2 * self.dt)
        self.fade = exp(-self.dt / self.options["misfit_s"])
        self.mean_square = float(N_RATES)
        self.cusum = 0.0

    def transition(self, measured: Measured) -> np.ndarray:
        """F (n, n) of this frame, without df/dx, for (p, q, r), theta and, if declared, g of kalman.py:

        F = [1, dt G_s u_s, dt B; 0, 1, 0; 0, 0, a]
        """
        F = self.F.copy()
        F[:3, THETA] = self.dt * measured.contribution[:, self.leading]
        return F

    def update_statistic(self, nu: np.ndarray, S: np.ndarray) -> float:
        """Limit theta to [-1, 1], update the mean of nu' S^-1 nu, and return the decision statistic."""
        self.z[THETA] = np.clip(self.z[THETA], -1.0, 1.0)
        square = min(float(normalised_innovation_square(nu, S)), _MAX_SQUARE)
        self.mean_square = self.fade * self.mean_square + (1.0 - self.fade) * square
        return self.statistic(square)

    def statistic(self, square: float) -> float:
        """The decision statistic, 1 at the alarm, by nu' S^-1 nu."""
        raise NotImplementedError

    def wald_statistics(self) -> np.ndarray:
        """theta^2 / variance of each surface, chi-square with one degree of freedom when healthy, (3,)."""
        wald: np.ndarray = self.z[THETA] ** 2 / np.diagonal(self.P)[THETA]
        return wald

    def isolate(self, measured: Measured) -> Verdict:
        """The verdict on the surface with the largest theta^2 / variance; UNANTICIPATED if the mean
        innovation is too large for any surface, or if that surface would have gained effectiveness."""
        i = int(np.argmax(self.wald_statistics()))
        theta = self.z[THETA]
        if self.mean_square > N_RATES * self.options["misfit"] or theta[i] > 0.0:
            return UNANTICIPATED
        effectiveness = np.ones(len(self.context.surfaces))
        effectiveness[self.leading] += np.clip(theta, -1.0, 0.0)
        return self.loss(i, float(effectiveness[self.leading[i]] - 1.0), effectiveness)


class AugmentedEkf(EffectivenessFilter):
    """Extended Kalman filter that estimates effectiveness, with a chi-square test [Jazwinski1970]."""

    name: ClassVar[str] = "augmented-ekf"
    # alarm: chi-square value of the largest theta^2 / variance
    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS | {"alarm": 20.0}

    def predict(self, measured: Measured, before: Measured) -> None:
        """z- = F z + dt (xdot - J x), P- = F P F' + Q; J = df/dx at x, measured in the frame before."""
        F = self.transition(measured)
        x = before.x
        f = self.context.model.f(x + _STEPS, before.y)
        J = (f[:3] - f[3:]).T / (2.0 * _STEP_RAD_S)
        F[:3, :3] += self.dt * J
        self.z = self.move(self.z, F, measured.acceleration - J @ x)
        self.P = self.add_noise(F @ self.P @ F.T, measured, self.options["noise"])

    def statistic(self, square: float) -> float:
        """The largest theta^2 / variance over the alarm level."""
        return float(self.wald_statistics().max() / self.options["alarm"])


class AugmentedUkf(EffectivenessFilter):
    """Unscented Kalman filter that estimates effectiveness, with a CUSUM test [Julier2004]."""

    name: ClassVar[str] = "augmented-ukf"
    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS | {
        "alarm": 20.0,  # level of the CUSUM g
        "allowance": 3.0,  # of nu' S^-1 nu in a frame, as a multiple of its mean in a healthy flight
        "spread": float(N_STATES_WITHOUT_GUSTS),  # n + kappa of the sigma points, without gusts
    }

    def predict(self, measured: Measured, before: Measured) -> None:
        """Move the sigma points through the dynamics; their mean and covariance are z- and P-:

        acceleration of a point = acceleration of the elapsed frame + f(point) - f(x before)
        """
        points, weights = sigma_points(self.z, self.P, self.options["spread"] + self.n_air)
        f = self.context.model.f(np.concatenate((points[:, :3], before.x[None])), before.y)
        points = self.move(points, self.transition(measured), measured.acceleration + f[:-1] - f[-1])
        self.z = weights @ points
        deviation = points - self.z
        self.P = self.add_noise((deviation.T * weights) @ deviation, measured, self.options["noise"])

    def statistic(self, square: float) -> float:
        """g over the alarm level, with g <- max(0, g + square - N_RATES allowance). N_RATES is the mean of
        nu' S^-1 nu in a healthy flight."""
        self.cusum = max(0.0, self.cusum + square - N_RATES * self.options["allowance"])
        return self.cusum / self.options["alarm"]
