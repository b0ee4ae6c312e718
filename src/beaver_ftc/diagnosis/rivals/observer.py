"""Observer residual against a constant threshold: the textbook scheme [Chen1999, ch. 2].

    eps[k+1] = a eps[k] + dt nu,   a = exp(-pole dt)        alarm when |eps_i| > alarm constant_i / pole

The residual is that of the published detection estimator; only the threshold does not move with the state.
From the alarm on, a residual started again is fitted by the filtered effect of each surface, by least squares
over a fading window; the best fit names the fault, and a window after the alarm the name stands.

What is declared of gyros and air has a known deviation behind that filter; the threshold is `alarm` times all
of it together:

    gyro  n[k+1] - n[k], white      -> sigma^2 2 / (1 + a)
    air   first order, r = exp(-dt / tau) -> dt^2 sigma^2 (1 + a r) / ((1 - a^2) (1 - a r))
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.diagnosis.rivals import options_of


class Fit:
    """Fading sums of residual and regressors, and what each surface makes of them.

    J_s = min over theta in [-1, 0] of sum |eps - theta Omega_s|^2, in units of the threshold.
    """

    def __init__(self, fade: float) -> None:
        self._fade = fade
        self.count, self.residual = 0.0, 0.0
        self.cross, self.regressor = np.zeros(3), np.zeros(3)

    def step(self, eps: np.ndarray, Omega: np.ndarray) -> None:
        """Add one frame: eps (3,) and Omega (3, 3), a column a surface, both over the threshold."""
        self.count = self._fade * self.count + 1.0
        self.residual = self._fade * self.residual + float(eps @ eps)
        self.cross = self._fade * self.cross + eps @ Omega
        self.regressor = self._fade * self.regressor + (Omega**2).sum(axis=0)

    def best(self) -> tuple[int, float, float]:
        """(surface, theta, mean misfit square of an axis) of the surface that fits best."""
        theta = np.clip(self.cross / np.maximum(self.regressor, 1e-300), -1.0, 0.0)
        J = self.residual - 2.0 * theta * self.cross + theta**2 * self.regressor
        s = int(np.argmin(J))
        return s, float(theta[s]), float(J[s] / (3.0 * self.count))


def residual_deviation(context: Context, a: float) -> np.ndarray:
    """Standard deviation (3,) rad/s of the healthy residual behind the filter, by what is declared."""
    declared, dt = context.declared, context.dt_s
    steady = np.hypot(np.maximum(context.constant_rad_s2, 1e-4), declared.model_rad_s2) * dt / (1.0 - a)
    r = np.exp(-dt / np.maximum(declared.turbulence_time_s, dt))
    air = dt * declared.turbulence_rad_s2 * np.sqrt((1.0 + a * r) / ((1.0 - a * a) * (1.0 - a * r)))
    gyro = declared.gyro_rad_s * sqrt(2.0 / (1.0 + a))
    return np.sqrt(steady**2 + air**2 + gyro**2)


class ConstantThresholdObserver:
    """Observer residual with a constant threshold, surface named by least squares [Chen1999]."""

    name: ClassVar[str] = "observer-constant"
    defaults: ClassVar[Mapping[str, float]] = {"alarm": 2.0, "pole_per_s": 10.0, "window_s": 0.5}

    def reset(self, context: Context) -> None:
        """No residual."""
        self.option = options_of(self.name, self.defaults, context)
        self.leading, self.leaders = list(context.leading), context.leaders
        pole = self.option["pole_per_s"]
        self.dt, self.a = context.dt_s, exp(-pole * context.dt_s)
        # a declared bound of zero would make any rounding an alarm
        self.scale = self.option["alarm"] * np.maximum(context.constant_rad_s2, 1e-4) / pole
        if context.declared.errors:
            self.scale = self.option["alarm"] * residual_deviation(context, self.a)
        self.eps, self.since, self.Omega = np.zeros(3), np.zeros(3), np.zeros((3, 3))
        self.before: np.ndarray | None = None
        self.fit = Fit(exp(-context.dt_s / self.option["window_s"]))
        self.alarm_s: float | None = None
        self.axis, self.named = "p", Verdict()

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Filter the innovation, compare, and from the alarm on ask whose effect it is."""
        if self.before is not None:
            innovation = measured.x - self.before - self.dt * measured.acceleration
            self.eps = self.a * self.eps + innovation
            self.since = self.a * self.since + innovation
            self.Omega = self.a * self.Omega + self.dt * measured.contribution[:, self.leading]
        self.before = measured.x
        share = np.abs(self.eps) / self.scale
        statistic = float(share.max())
        if statistic > 1.0 and self.alarm_s is None:
            self.alarm_s, self.axis = measured.t_s, "pqr"[int(np.argmax(share))]
            self.since, self.Omega = np.zeros(3), np.zeros((3, 3))
        if self.alarm_s is None:
            return Verdict(statistic=statistic)
        if measured.t_s <= self.alarm_s + self.option["window_s"]:
            self.named = self.verdict()
        return self.named._replace(statistic=statistic)

    def verdict(self) -> Verdict:
        """The surface that fits; none fits if what it leaves is still over the threshold in the mean."""
        self.fit.step(self.since / self.scale, self.Omega / self.scale[:, None])
        s, theta, misfit = self.fit.best()
        if misfit > 1.0:
            return Verdict(True, self.axis, "unanticipated", "unanticipated")
        return Verdict(True, self.axis, self.leaders[s], "loss_of_effectiveness", theta)
