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
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options
from beaver_ftc.diagnosis.rivals.gust import VaneGust


class FadingSurfaceFits:
    """Fading sums of residual and regressors, and what each surface makes of them.

    J_s = min over theta in [-1, 0] of sum |eps - theta Omega_s|^2, in units of the threshold.
    """

    def __init__(self, fading_factor: float) -> None:
        self._fading_factor = fading_factor
        self.weight_sum, self.residual_square_sum = 0.0, 0.0
        self.cross_sums, self.regressor_square_sums = np.zeros(3), np.zeros(3)

    def step(self, residual_over_threshold: np.ndarray, effects_over_threshold: np.ndarray) -> None:
        """Add one frame: eps (3,) and Omega (3, 3), a column a surface, each divided by the threshold."""
        self.weight_sum = self._fading_factor * self.weight_sum + 1.0
        self.residual_square_sum = self._fading_factor * self.residual_square_sum + float(
            residual_over_threshold @ residual_over_threshold
        )
        self.cross_sums = (
            self._fading_factor * self.cross_sums + residual_over_threshold @ effects_over_threshold
        )
        self.regressor_square_sums = self._fading_factor * self.regressor_square_sums + (
            effects_over_threshold**2
        ).sum(axis=0)

    def fit_best_surface(self) -> tuple[int, float, float]:
        """(surface, theta, mean misfit square of an axis) of the surface that fits best."""
        theta_by_surface = np.clip(
            self.cross_sums / np.maximum(self.regressor_square_sums, 1e-300), -1.0, 0.0
        )
        misfit_square_sum_by_surface = (
            self.residual_square_sum
            - 2.0 * theta_by_surface * self.cross_sums
            + theta_by_surface**2 * self.regressor_square_sums
        )
        best_surface_index = int(np.argmin(misfit_square_sum_by_surface))
        return (
            best_surface_index,
            float(theta_by_surface[best_surface_index]),
            float(misfit_square_sum_by_surface[best_surface_index] / (3.0 * self.weight_sum)),
        )


def healthy_residual_std(context: Context, decay_factor: float) -> np.ndarray:
    """Standard deviation (3,) rad/s of the healthy residual behind the filter, by what is declared."""
    declared_uncertainty, dt = context.declared, context.dt_s
    residual_std_from_model_error = (
        np.hypot(np.maximum(context.constant_rad_s2, 1e-4), declared_uncertainty.model_rad_s2)
        * dt
        / (1.0 - decay_factor)
    )
    gust_correlation = np.exp(-dt / np.maximum(declared_uncertainty.turbulence_time_s, dt))
    residual_std_from_gust = (
        dt
        * declared_uncertainty.turbulence_rad_s2
        * np.sqrt(
            (1.0 + decay_factor * gust_correlation)
            / ((1.0 - decay_factor * decay_factor) * (1.0 - decay_factor * gust_correlation))
        )
    )
    residual_std_from_gyro = declared_uncertainty.gyro_rad_s * sqrt(2.0 / (1.0 + decay_factor))
    return np.sqrt(residual_std_from_model_error**2 + residual_std_from_gust**2 + residual_std_from_gyro**2)


class ConstantThresholdObserver:
    """Observer residual with a constant threshold; least squares name the surface [Chen1999]."""

    name: ClassVar[str] = "observer-constant"
    defaults: ClassVar[Mapping[str, float]] = {"alarm": 2.0, "pole_per_s": 10.0, "window_s": 0.5}

    def reset(self, context: Context) -> None:
        """No residual."""
        self.options, self.vane_gust = rival_options(self.name, self.defaults, context), VaneGust(context)
        context = self.vane_gust.context
        self.leading_surface_indices, self.leaders = list(context.leading), context.leaders
        pole_per_s = self.options["pole_per_s"]
        self.dt_s, self.a = context.dt_s, exp(-pole_per_s * context.dt_s)
        # a declared bound of zero would make any rounding an alarm
        self.threshold = self.options["alarm"] * np.maximum(context.constant_rad_s2, 1e-4) / pole_per_s
        if context.declared.errors:
            self.threshold = self.options["alarm"] * healthy_residual_std(context, self.a)
        self.eps, self.residual_since_alarm, self.filtered_effects = (
            np.zeros(3),
            np.zeros(3),
            np.zeros((3, 3)),
        )
        self.previous_rates: np.ndarray | None = None
        self.surface_fit = FadingSurfaceFits(exp(-context.dt_s / self.options["window_s"]))
        self.alarm_at_s: float | None = None
        self.alarm_axis, self.isolation_verdict = "p", Verdict()

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Filter the innovation, compare, and from the alarm on ask whose effect it is."""
        measured = self.vane_gust.subtracted(measured)
        if self.previous_rates is not None:
            rate_innovation = measured.x - self.previous_rates - self.dt_s * measured.acceleration
            self.eps = self.a * self.eps + rate_innovation
            self.residual_since_alarm = self.a * self.residual_since_alarm + rate_innovation
            self.filtered_effects = (
                self.a * self.filtered_effects
                + self.dt_s * measured.contribution[:, self.leading_surface_indices]
            )
        self.previous_rates = measured.x
        residual_threshold_ratio_by_axis = np.abs(self.eps) / self.threshold
        statistic = float(residual_threshold_ratio_by_axis.max())
        if statistic > 1.0 and self.alarm_at_s is None:
            self.alarm_at_s, self.alarm_axis = (
                measured.t_s,
                "pqr"[int(np.argmax(residual_threshold_ratio_by_axis))],
            )
            self.residual_since_alarm, self.filtered_effects = np.zeros(3), np.zeros((3, 3))
        if self.alarm_at_s is None:
            return Verdict(statistic=statistic)
        if measured.t_s <= self.alarm_at_s + self.options["window_s"]:
            self.isolation_verdict = self.update_fit_and_decide_verdict()
        return self.isolation_verdict._replace(statistic=statistic)

    def update_fit_and_decide_verdict(self) -> Verdict:
        """The surface that fits; none fits if what it leaves is still over the threshold in the mean."""
        self.surface_fit.step(
            self.residual_since_alarm / self.threshold, self.filtered_effects / self.threshold[:, None]
        )
        surface_index, theta, mean_misfit_square = self.surface_fit.fit_best_surface()
        if mean_misfit_square > 1.0:
            return Verdict(True, self.alarm_axis, "unanticipated", "unanticipated")
        return Verdict(True, self.alarm_axis, self.leaders[surface_index], "loss_of_effectiveness", theta)
