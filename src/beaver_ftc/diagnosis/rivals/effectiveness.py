"""What the effectiveness filters share: the augmented state, its noise, and how it names a fault.

    z = (p, q, r, theta of the surface that leads roll, pitch, yaw)
    x[k+1] = x[k] + dt (f + G u + sum_s theta_s G_s u_s),     theta[k+1] = theta[k] + a random walk

theta is the lost effectiveness of the fault class [Zhang2005, eq. (4)]. The declared bound on the
uncertainty is taken for a standard deviation, times `noise`: it is no white noise, which is what the
filters assume. Declared gyro noise is the measurement's; declared turbulence adds states (air.py).
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.diagnosis.rivals.air import Air, rate_variance, unexplained
from beaver_ftc.diagnosis.rivals.kalman import update
from beaver_ftc.diagnosis.rivals.options import options_of

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
        rates = rate_variance(context.declared, self.option["measurement_rad_s"])
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
