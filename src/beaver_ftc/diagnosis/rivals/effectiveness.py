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
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options
from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.diagnosis.rivals.kalman import (
    TurbulenceModel,
    sigma_points,
    unexplained_acceleration_size,
    update_state_and_covariance,
)

_DIFFERENCE_STEP_RAD_S = (
    1e-6  # rad/s, for df/dx: f is quadratic in x, so a central difference is exact to rounding
)
N_STATES_WITHOUT_GUSTS = 6
DEFAULT_OPTIONS = {
    "noise": 3.0,  # standard deviation of the acceleration error over its declared bound
    "drift_per_s": 0.1,  # random walk of theta, 1/sqrt(s)
    "measurement_rad_s": 1e-5,  # standard deviation of the measured rates
    "misfit": 3.0,  # times its expected value: a mean innovation square above it fits no surface
    "misfit_s": 0.5,  # over which the innovation square is averaged
}


class EffectivenessFilter:
    """Base of the augmented filters; they differ in `propagate` and in `update_statistic`."""

    name: ClassVar[str] = ""
    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS

    def reset(self, context: Context) -> None:
        """Start healthy, with theta known to a tenth."""
        self.options, self.vane_gust = rival_options(self.name, self.defaults, context), VaneGust(context)
        self.context = context = self.vane_gust.context
        self.leading_surface_indices = list(context.leading)
        self.turbulence_model = TurbulenceModel(context)
        self.n_states = N_STATES_WITHOUT_GUSTS + self.turbulence_model.n_states
        measured_rate_variance = context.declared.rate_variance(self.options["measurement_rad_s"])
        self.z, self.diagonal = np.zeros(self.n_states), np.diag_indices(self.n_states)
        self.P = np.diag(
            np.concatenate((measured_rate_variance, [0.01] * 3, self.turbulence_model.initial_variance))
        )
        self.R = np.diag(measured_rate_variance)
        self.theta_walk_variance = self.options["drift_per_s"] ** 2 * context.dt_s
        self.averaging_decay = exp(-context.dt_s / self.options["misfit_s"])
        self.mean_normalised_innovation_square, self.detected, self.is_first_frame = 3.0, False, True

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Predict over the elapsed frame, update with the measured rates, decide."""
        measured = self.vane_gust.subtracted(measured)
        if self.is_first_frame:
            self.is_first_frame = False
            self.z[:3] = measured.x
            return self.latch_alarm_and_decide_verdict(measured, 0.0)
        self.propagate(measured)
        nu = measured.x - self.z[:3]
        self.z, self.P, S = update_state_and_covariance(self.z, self.P, nu, self.R)
        self.z[3:N_STATES_WITHOUT_GUSTS] = np.clip(self.z[3:N_STATES_WITHOUT_GUSTS], -1.0, 1.0)
        normalised_innovation_square = float(nu @ np.linalg.solve(S, nu))
        self.mean_normalised_innovation_square = (
            self.averaging_decay * self.mean_normalised_innovation_square
            + (1.0 - self.averaging_decay) * min(normalised_innovation_square, 1e6)
        )
        return self.latch_alarm_and_decide_verdict(
            measured, self.update_statistic(normalised_innovation_square)
        )

    def propagate(self, measured: Measured) -> None:
        """Predict z and P over the elapsed frame."""
        raise NotImplementedError

    def update_statistic(self, normalised_innovation_square: float) -> float:
        """The decision statistic, 1 at the alarm, by nu' S^-1 nu."""
        raise NotImplementedError

    def process_noise_variances(self, measured: Measured) -> np.ndarray:
        """Q (n,), the diagonal: of the rates from the declared bound, of theta a random walk, of the air."""
        unexplained_acceleration = unexplained_acceleration_size(self.context, measured.eta_bar)
        rate_process_noise_variance = (
            self.context.dt_s * self.options["noise"] * unexplained_acceleration
        ) ** 2
        return np.concatenate(
            (
                rate_process_noise_variance,
                np.full(3, self.theta_walk_variance),
                self.turbulence_model.process_noise_variance,
            )
        )

    def wald_statistics(self) -> np.ndarray:
        """theta^2 / variance of each surface, chi-square with one degree of freedom when healthy, (3,)."""
        return self.z[3:N_STATES_WITHOUT_GUSTS] ** 2 / np.diagonal(self.P)[3:N_STATES_WITHOUT_GUSTS]

    def latch_alarm_and_decide_verdict(self, measured: Measured, statistic: float) -> Verdict:
        """Name the surface whose theta is most significantly off, or none: innovations misfit, or a surface
        would have gained."""
        self.detected = self.detected or statistic > 1.0
        if not self.detected:
            return Verdict(statistic=statistic)
        surface_effectiveness_estimates = np.ones(len(self.context.surfaces))
        surface_effectiveness_estimates[self.leading_surface_indices] += np.clip(
            self.z[3:N_STATES_WITHOUT_GUSTS], -1.0, 0.0
        )
        most_significant_axis = int(np.argmax(self.wald_statistics()))
        if (
            self.mean_normalised_innovation_square > 3.0 * self.options["misfit"]
            or self.z[3 + most_significant_axis] > 0.0
        ):
            return Verdict(True, None, "unanticipated", "unanticipated", None, None, statistic)
        surface_index = self.leading_surface_indices[most_significant_axis]
        effectiveness_change = float(surface_effectiveness_estimates[surface_index] - 1.0)
        surface_name = self.context.surfaces[surface_index]
        return Verdict(
            True,
            "pqr"[most_significant_axis],
            surface_name,
            "loss_of_effectiveness",
            effectiveness_change,
            surface_effectiveness_estimates,
            statistic,
        )


class AugmentedEkf(EffectivenessFilter):
    """Extended Kalman filter that estimates effectiveness, with a chi-square test [Jazwinski1970]."""

    name: ClassVar[str] = "augmented-ekf"
    # alarm: chi-square value of the largest theta^2 / variance
    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS | {"alarm": 20.0}

    def reset(self, context: Context) -> None:
        """As the base does, with what the Jacobian is in every frame."""
        super().reset(context)
        gusts = slice(N_STATES_WITHOUT_GUSTS, None)
        self.constant_jacobian = np.eye(self.n_states)
        self.constant_jacobian[:3, gusts] = self.turbulence_model.rate_effect
        self.constant_jacobian[gusts, gusts] = np.diag(self.turbulence_model.a)

    def propagate(self, measured: Measured) -> None:
        """z- = g(z), P- = F P F' + Q with the Jacobian F at the estimate."""
        F = self.jacobian(measured)
        dt = self.context.dt_s
        self.z[:3] += dt * (
            measured.acceleration
            + measured.contribution[:, self.leading_surface_indices] @ self.z[3:N_STATES_WITHOUT_GUSTS]
        )
        if self.turbulence_model.n_states:
            self.z[:3] += self.turbulence_model.rate_effect @ self.z[N_STATES_WITHOUT_GUSTS:]
            self.z[N_STATES_WITHOUT_GUSTS:] *= self.turbulence_model.a
        self.P = F @ self.P @ F.T
        self.P[self.diagonal] += self.process_noise_variances(measured)

    def jacobian(self, measured: Measured) -> np.ndarray:
        """F (n, n): [[1 + dt df/dx, dt G_s u_s], [0, 1]], and with the air [.., dt B] and its decay."""
        f, y, dt = self.context.model.f, measured.y, self.context.dt_s
        F = self.constant_jacobian.copy()
        rate_steps = _DIFFERENCE_STEP_RAD_S * np.eye(3)
        f_at_steps = f(np.concatenate((measured.x + rate_steps, measured.x - rate_steps)), y)
        F[:3, :3] += dt * (f_at_steps[:3] - f_at_steps[3:]).T / (2.0 * _DIFFERENCE_STEP_RAD_S)
        F[:3, 3:N_STATES_WITHOUT_GUSTS] = dt * measured.contribution[:, self.leading_surface_indices]
        return F

    def update_statistic(self, normalised_innovation_square: float) -> float:
        """The largest theta^2 / variance over the alarm level."""
        return float(self.wald_statistics().max() / self.options["alarm"])


class AugmentedUkf(EffectivenessFilter):
    """Unscented Kalman filter that estimates effectiveness, with a CUSUM test [Julier2004]."""

    name: ClassVar[str] = "augmented-ukf"
    defaults: ClassVar[Mapping[str, float]] = DEFAULT_OPTIONS | {
        "alarm": 20.0,
        "allowance": 3.0,
        "spread": float(N_STATES_WITHOUT_GUSTS),
    }

    def reset(self, context: Context) -> None:
        """As the base does, with an empty sum."""
        super().reset(context)
        self.cusum = 0.0

    def propagate(self, measured: Measured) -> None:
        """Move the sigma points through the dynamics; their mean and covariance are z- and P-."""
        state_points, point_weights = sigma_points(
            self.z, self.P, self.options["spread"] + self.turbulence_model.n_states
        )
        state_points = self.propagate_points(state_points, measured)
        self.z = point_weights @ state_points
        point_deviations = state_points - self.z
        self.P = (point_deviations.T * point_weights) @ point_deviations
        self.P[self.diagonal] += self.process_noise_variances(measured)

    def propagate_points(self, state_points: np.ndarray, measured: Measured) -> np.ndarray:
        """Each sigma point a frame later; f differs between points by its change from the measured state."""
        dt, f = self.context.dt_s, self.context.model.f
        propagated_points = state_points.copy()
        rates = np.concatenate((state_points[:, :3], measured.x[None]))
        f_at_rates = f(rates, measured.y)
        f_change_from_measured = f_at_rates[:-1] - f_at_rates[-1]
        contribution = measured.contribution[:, self.leading_surface_indices]
        acceleration_changes_from_loss = state_points[:, 3:N_STATES_WITHOUT_GUSTS] @ contribution.T
        propagated_points[:, :3] += dt * (
            measured.acceleration + f_change_from_measured + acceleration_changes_from_loss
        )
        if self.turbulence_model.n_states:
            propagated_points[:, :3] += (
                state_points[:, N_STATES_WITHOUT_GUSTS:] @ self.turbulence_model.rate_effect.T
            )
            propagated_points[:, N_STATES_WITHOUT_GUSTS:] *= self.turbulence_model.a
        return propagated_points

    def update_statistic(self, normalised_innovation_square: float) -> float:
        """g = max(0, g + (normalised_innovation_square - 3 allowance)) over the alarm level; 3 is what a
        healthy flight expects."""
        self.cusum = max(
            0.0, self.cusum + min(normalised_innovation_square, 1e6) - 3.0 * self.options["allowance"]
        )
        return self.cusum / self.options["alarm"]
