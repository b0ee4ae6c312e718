"""Kalman filters with the surfaces' effectiveness as states: what they share, and how each names a fault.

    z = (p, q, r, theta of the surface that leads roll, pitch, yaw)
    x[k+1] = x[k] + dt (f + G u + sum_s theta_s G_s u_s),     theta[k+1] = theta[k] + a random walk

theta is the lost effectiveness of the fault class [Zhang2005, eq. (4)]. The declared bound on the
uncertainty is taken for a standard deviation, times `noise`: it is no white noise, which is what the
filters assume. Declared gyro noise is the measurement's; declared turbulence adds states (kalman.py).
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.diagnosis.rivals import options_of
from beaver_ftc.diagnosis.rivals.kalman import Air, sigma_points, unexplained, update

_STEP = 1e-6  # rad/s, for df/dx: f is quadratic in x, so a central difference is exact to rounding
N = 6
DEFAULTS = {
    "noise": 3.0,  # standard deviation of the acceleration error over its declared bound
    "drift_per_s": 0.1,  # random walk of theta, 1/sqrt(s)
    "measurement_rad_s": 1e-5,  # standard deviation of the measured rates
    "misfit": 3.0,  # times its expected value: a mean innovation square above it fits no surface
    "misfit_s": 0.5,  # over which the innovation square is averaged
}


class EffectivenessFilter:
    """Base of the augmented filters; they differ in `propagate` and in `statistic`."""

    name: ClassVar[str] = ""
    defaults: ClassVar[Mapping[str, float]] = DEFAULTS

    def reset(self, context: Context) -> None:
        """Start healthy, with theta known to a tenth."""
        self.context, self.option = context, options_of(self.name, self.defaults, context)
        self.leading = list(context.leading)
        self.air = Air(context)
        self.n = N + self.air.n
        rates = context.declared.rate_variance(self.option["measurement_rad_s"])
        self.z = np.zeros(self.n)
        self.P = np.diag(np.concatenate((rates, [0.01] * 3, self.air.variance)))
        self.R = np.diag(rates)
        self.Q_theta = self.option["drift_per_s"] ** 2 * context.dt_s
        self.fade = exp(-context.dt_s / self.option["misfit_s"])
        self.square, self.detected, self.first = 3.0, False, True

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Predict over the elapsed frame, update with the measured rates, decide."""
        if self.first:
            self.first = False
            self.z[:3] = measured.x
            return self.verdict(measured, 0.0)
        self.propagate(measured)
        nu = measured.x - self.z[:3]
        self.z, self.P, S = update(self.z, self.P, nu, self.R)
        self.z[3:N] = np.clip(self.z[3:N], -1.0, 1.0)
        square = float(nu @ np.linalg.solve(S, nu))
        self.square = self.fade * self.square + (1.0 - self.fade) * min(square, 1e6)
        return self.verdict(measured, self.statistic(square))

    def propagate(self, measured: Measured) -> None:
        """Bring z and P over the elapsed frame."""
        raise NotImplementedError

    def statistic(self, square: float) -> float:
        """The decision statistic, 1 at the alarm; square is the normalised innovation squared."""
        raise NotImplementedError

    def process_noise(self, measured: Measured) -> np.ndarray:
        """Q (n,), the diagonal: of the rates from the declared bound, of theta a random walk, of the air."""
        size = unexplained(self.context, measured.eta_bar)
        rates = (self.context.dt_s * self.option["noise"] * size) ** 2
        return np.concatenate((rates, np.full(3, self.Q_theta), self.air.noise))

    def significance(self) -> np.ndarray:
        """theta^2 / variance of each surface, chi-square with one degree of freedom when healthy, (3,)."""
        return self.z[3:N] ** 2 / np.diagonal(self.P)[3:N]

    def verdict(self, measured: Measured, statistic: float) -> Verdict:
        """Name the surface whose theta is most significantly off, or none: innovations misfit, or a surface
        would have gained."""
        self.detected = self.detected or statistic > 1.0
        if not self.detected:
            return Verdict(statistic=statistic)
        effectiveness = np.ones(len(self.context.surfaces))
        effectiveness[self.leading] += np.clip(self.z[3:N], -1.0, 0.0)
        worst = int(np.argmax(self.significance()))
        if self.square > 3.0 * self.option["misfit"] or self.z[3 + worst] > 0.0:
            return Verdict(True, None, "unanticipated", "unanticipated", None, None, statistic)
        surface = self.leading[worst]
        theta, name = float(effectiveness[surface] - 1.0), self.context.surfaces[surface]
        return Verdict(True, "pqr"[worst], name, "loss_of_effectiveness", theta, effectiveness, statistic)


class AugmentedEkf(EffectivenessFilter):
    """Extended Kalman filter of effectiveness, chi-square test on the estimates [Jazwinski1970]."""

    name: ClassVar[str] = "augmented-ekf"
    # alarm: chi-square value of the largest theta^2 / variance
    defaults: ClassVar[Mapping[str, float]] = DEFAULTS | {"alarm": 20.0}

    def propagate(self, measured: Measured) -> None:
        """z- = g(z), P- = F P F' + Q with the Jacobian F at the estimate."""
        F = self.jacobian(measured)
        dt = self.context.dt_s
        self.z[:3] += dt * (measured.acceleration + measured.contribution[:, self.leading] @ self.z[3:N])
        if self.air.n:
            self.z[:3] += self.air.effect @ self.z[N:]
            self.z[N:] *= self.air.keep
        self.P = F @ self.P @ F.T
        self.P[np.diag_indices(self.n)] += self.process_noise(measured)

    def jacobian(self, measured: Measured) -> np.ndarray:
        """F (n, n): [[1 + dt df/dx, dt G_s u_s], [0, 1]], and with the air [.., dt B] and its decay."""
        f, y, dt = self.context.model.f, measured.y, self.context.dt_s
        F = np.eye(self.n)
        step = _STEP * np.eye(3)
        there = f(np.concatenate((measured.x + step, measured.x - step)), y)
        F[:3, :3] += dt * (there[:3] - there[3:]).T / (2.0 * _STEP)
        F[:3, 3:N] = dt * measured.contribution[:, self.leading]
        F[:3, N:] = self.air.effect
        F[range(N, self.n), range(N, self.n)] = self.air.keep
        return F

    def statistic(self, square: float) -> float:
        """The largest theta^2 / variance over the alarm level."""
        return float(self.significance().max() / self.option["alarm"])


class AugmentedUkf(EffectivenessFilter):
    """Unscented Kalman filter of effectiveness, CUSUM on the innovation squared [Julier2004]."""

    name: ClassVar[str] = "augmented-ukf"
    defaults: ClassVar[Mapping[str, float]] = DEFAULTS | {"alarm": 20.0, "allowance": 3.0, "spread": float(N)}

    def reset(self, context: Context) -> None:
        """As the base does, with an empty sum."""
        super().reset(context)
        self.sum = 0.0

    def propagate(self, measured: Measured) -> None:
        """Move the sigma points through the dynamics; their mean and covariance are z- and P-."""
        points, weights = sigma_points(self.z, self.P, self.option["spread"] + self.air.n)
        points = self.dynamics(points, measured)
        self.z = weights @ points
        off = points - self.z
        self.P = (off.T * weights) @ off
        self.P[np.diag_indices(self.n)] += self.process_noise(measured)

    def dynamics(self, points: np.ndarray, measured: Measured) -> np.ndarray:
        """Each sigma point a frame later; f differs between points by its change from the measured state."""
        dt, f = self.context.dt_s, self.context.model.f
        moved = points.copy()
        away = f(points[:, :3], measured.y) - f(measured.x, measured.y)
        loss = np.array([measured.contribution[:, self.leading] @ point[3:N] for point in points])
        moved[:, :3] += dt * (measured.acceleration + away + loss)
        if self.air.n:
            moved[:, :3] += points[:, N:] @ self.air.effect.T
            moved[:, N:] *= self.air.keep
        return moved

    def statistic(self, square: float) -> float:
        """g = max(0, g + (square - 3 allowance)) over the alarm level; 3 is what a healthy flight expects."""
        self.sum = max(0.0, self.sum + min(square, 1e6) - 3.0 * self.option["allowance"])
        return self.sum / self.option["alarm"]
