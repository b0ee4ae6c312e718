"""Observer residual against a constant threshold: the textbook scheme [Chen1999, ch. 2].

    eps[k+1] = a eps[k] + nu,   a = exp(-pole dt)        alarm when |eps_i| > alarm constant_i / pole
    nu = x[k+1] - x[k] - dt (f + G u),   rad/s

The residual is that of the published detection estimator, but the threshold does not follow the state. At the
alarm a second residual starts from zero. The filtered effect of each surface is fitted to it by least squares
over a fading window. The best fit names the fault; one window after the alarm the name is final.

Declared errors of gyros, air and model have a known variance behind the filter, (rad/s)^2. If any error is
declared, the threshold is `alarm` times the root of their sum instead:

    gyro     white noise n, as n[k+1] - n[k]         2 sigma^2 / (1 + a)
    air      first order, r = exp(-dt / tau)         dt^2 sigma^2 (1 + a r) / ((1 - a^2) (1 - a r))
    model    constant or slow                        dt^2 (bound^2 + sigma^2) / (1 - a)^2

sigma: rad/s of a gyro, rad/s2 of air and model; bound rad/s2.
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals.rival import UNANTICIPATED, RivalDetector

_LEAST_BOUND_RAD_S2 = 1e-4  # a declared bound of zero would make any rounding an alarm
_TINY = 1e-300  # in place of a divisor of zero
_N_AXES = 3


def healthy_residual_std(context: Context, a: float) -> np.ndarray:
    """Standard deviation (3,) rad/s of the healthy residual behind the filter, by what is declared."""
    declared = context.declared
    dt = context.dt_s
    r = np.exp(-dt / np.maximum(declared.turbulence_time_s, dt))
    by_air = declared.turbulence_rad_s2 * np.sqrt((1.0 + a * r) / ((1.0 - a * a) * (1.0 - a * r)))
    bound = np.maximum(context.constant_rad_s2, _LEAST_BOUND_RAD_S2)
    by_model = np.hypot(bound, declared.model_rad_s2) / (1.0 - a)
    by_gyro = declared.gyro_rad_s * sqrt(2.0 / (1.0 + a))
    return np.sqrt((dt * by_model) ** 2 + (dt * by_air) ** 2 + by_gyro**2)


class ConstantThresholdObserver(RivalDetector):
    """Observer residual with a constant threshold; least squares name the surface [Chen1999].

        J_s = min over theta in [-1, 0] of sum |eps - theta Omega_s|^2, in units of the threshold

    filtered (3, 5) rad/s    eps since the start; eps and Omega_s since the alarm, a column for each surface
    sums (4, 4)              fading sums of the products of the last four columns, in units of the threshold
    weight                   fading number of frames in these sums
    """

    name: ClassVar[str] = "observer-constant"
    defaults: ClassVar[Mapping[str, float]] = {"alarm": 2.0, "pole_per_s": 10.0, "window_s": 0.5}

    def start(self) -> None:
        """Start with residuals of zero."""
        pole = self.options["pole_per_s"]
        context = self.context
        self.a = exp(-pole * self.dt)
        level = np.maximum(context.constant_rad_s2, _LEAST_BOUND_RAD_S2) / pole
        if context.declared.errors:
            level = healthy_residual_std(context, self.a)
        self.threshold = self.options["alarm"] * level
        self.fade = exp(-self.dt / self.options["window_s"])
        self.filtered = np.zeros((3, 5))
        self.sums = np.zeros((4, 4))
        self.weight = 0.0
        self.previous: np.ndarray | None = None
        self.verdict = Verdict()

    def advance(self, measured: Measured, command: np.ndarray) -> np.ndarray:
        """Filter the innovation and the effects, and compare the residual with the threshold."""
        if self.previous is not None:
            nu = measured.x - self.previous - self.dt * measured.acceleration
            effects = self.dt * measured.contribution[:, self.leading]
            self.filtered = self.a * self.filtered + np.column_stack((nu, nu, effects))
        self.previous = measured.x
        return np.abs(self.filtered[:, 0]) / self.threshold

    def begin_isolation(self) -> None:
        """Start the residual and the effects again."""
        self.filtered[:, 1:] = 0.0

    def isolate(self, measured: Measured) -> Verdict:
        """The surface with the smallest misfit, until a window after the alarm; afterwards the last verdict.
        UNANTICIPATED if the remaining residual exceeds the threshold in the mean of axes and frames:

            misfit_s > N_AXES weight

        theta_s = N_s / M_s within [-1, 0],    misfit_s = sum eps^2 - 2 theta_s N_s + theta_s^2 M_s

        N_s = sum eps Omega_s, M_s = sum Omega_s^2: fading sums, in units of the threshold.
        """
        if measured.t_s > self.alarm_s + self.options["window_s"]:
            return self.verdict
        if not self.filtered[:, 1:].any():  # in the frame of the alarm the residual starts again
            return Verdict(True, "pqr"[self.alarm_axis])
        scaled = self.filtered[:, 1:] / self.threshold[:, None]
        self.sums = self.fade * self.sums + scaled.T @ scaled
        self.weight = self.fade * self.weight + 1.0
        N = self.sums[0, 1:]
        M = np.diagonal(self.sums)[1:]
        theta = np.clip(N / np.maximum(M, _TINY), -1.0, 0.0)
        misfit = self.sums[0, 0] - 2.0 * theta * N + theta**2 * M
        s = int(np.argmin(misfit))
        fits = misfit[s] <= _N_AXES * self.weight
        verdict = self.loss(s, float(theta[s])) if fits else UNANTICIPATED
        self.verdict = verdict._replace(axis="pqr"[self.alarm_axis])
        return self.verdict
