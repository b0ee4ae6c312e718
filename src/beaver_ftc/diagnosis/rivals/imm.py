"""Interacting multiple models: one Kalman filter a hypothesis, and the probability of each.

Hypotheses: healthy; each surface with little and with much of its effectiveness lost; and one that explains
anything badly, by noise alone, for faults outside the class. Mixing, filtering, combination as in
[Blom1988]; actuator faults as modes as in [Zhang1998]. Declared turbulence is a state of each (kalman.py).
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options
from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.diagnosis.rivals.kalman import (
    TurbulenceModel,
    log_likelihood,
    unexplained_acceleration_size,
    update_state_and_covariance,
)

LOSS_THETA_LEVELS = (-0.25, -0.5, -0.9)
# (leader of roll, pitch or yaw, theta); the first mode is healthy, and the last one is noise
LOSS_MODES = tuple((leading_axis, theta) for leading_axis in range(3) for theta in LOSS_THETA_LEVELS)
_LOSS_THETAS = np.array([[theta] for _, theta in LOSS_MODES])
N_MODES = 1 + len(LOSS_MODES) + 1
_RATES, _GUSTS = np.arange(3), np.arange(3, 6)  # places of the states
_MIN_MODE_PROBABILITY = 1e-12  # no probability below it: a mode must be able to come back


def transition_matrix(stay_probability: float, n_modes: int) -> np.ndarray:
    """Markov chain (n, n): stay with that probability, else go anywhere alike."""
    transition_probabilities = np.full((n_modes, n_modes), (1.0 - stay_probability) / (n_modes - 1))
    np.fill_diagonal(transition_probabilities, stay_probability)
    return transition_probabilities


def mix_states(
    x: np.ndarray, P: np.ndarray, mode_probabilities: np.ndarray, transition_probabilities: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mixed states (M, n), covariances (M, n, n) and predicted probabilities (M,) [Blom1988, steps 1 and
    2]."""
    predicted_probabilities = mode_probabilities @ transition_probabilities
    mixing_weights = transition_probabilities * mode_probabilities[:, None] / predicted_probabilities[None, :]
    mixed_states = mixing_weights.T @ x
    state_deviations = x[:, None, :] - mixed_states[None, :, :]
    covariances_with_spread = P[:, None] + state_deviations[..., :, None] * state_deviations[..., None, :]
    return (
        mixed_states,
        np.einsum("ij,ijab->jab", mixing_weights, covariances_with_spread),
        predicted_probabilities,
    )


def posterior_probabilities(predicted_probabilities: np.ndarray, log_likelihoods: np.ndarray) -> np.ndarray:
    """Bayes' rule, in logarithms so that nothing underflows."""
    log_posteriors = np.log(predicted_probabilities) + log_likelihoods
    posteriors = np.exp(log_posteriors - log_posteriors.max())
    posteriors = np.maximum(posteriors / posteriors.sum(), _MIN_MODE_PROBABILITY)
    return posteriors / posteriors.sum()


class InteractingMultipleModels:
    """Interacting multiple models, one for each loss; the odds of a fault raise the alarm [Blom1988]."""

    name: ClassVar[str] = "multiple-models"
    defaults: ClassVar[Mapping[str, float]] = {
        "alarm": 5.0,  # logarithm of the odds of a fault
        "isolate": 0.9,  # probability at which a surface is named
        "noise": 3.0,  # as in effectiveness.py
        "unknown_noise": 30.0,  # the same of the hypothesis that explains anything badly
        "stay": 0.9999,  # a frame
        "measurement_rad_s": 1e-5,
    }

    def reset(self, context: Context) -> None:
        """Healthy, almost certainly."""
        self.options, self.vane_gust = rival_options(self.name, self.defaults, context), VaneGust(context)
        self.context = context = self.vane_gust.context
        self.dt = context.dt_s
        self.transition_probabilities = transition_matrix(self.options["stay"], N_MODES)
        self.mode_probabilities = np.full(N_MODES, _MIN_MODE_PROBABILITY)
        self.mode_probabilities[0] = 1.0 - (N_MODES - 1) * _MIN_MODE_PROBABILITY
        self.turbulence_model = TurbulenceModel(context)
        measured_rate_variance = context.declared.rate_variance(self.options["measurement_rad_s"])
        self.R = np.diag(measured_rate_variance)
        self.x = np.zeros((N_MODES, 3 + self.turbulence_model.n_states))
        self.P = np.tile(
            np.diag(np.concatenate((measured_rate_variance, self.turbulence_model.initial_variance))),
            (N_MODES, 1, 1),
        )
        self.F = np.eye(3 + self.turbulence_model.n_states)
        self.F[:3, 3:], self.F[3:, 3:] = (
            self.turbulence_model.rate_effect,
            np.diag(self.turbulence_model.a),
        )
        acceleration_noise_scale = np.full(N_MODES, self.options["noise"])
        acceleration_noise_scale[-1] = self.options["unknown_noise"]
        self.process_noise_scale = (self.dt * acceleration_noise_scale) ** 2
        self.detected = False
        self.is_first_frame = True

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Mix, filter, weigh, decide."""
        measured = self.vane_gust.subtracted(measured)
        if self.is_first_frame:
            self.is_first_frame, self.x[:, :3] = False, measured.x
            return Verdict(statistic=0.0)
        x, P, predicted_probabilities = mix_states(
            self.x, self.P, self.mode_probabilities, self.transition_probabilities
        )
        if self.turbulence_model.n_states:
            x, P = x @ self.F.T, self.F @ P @ self.F.T
            P[:, _GUSTS, _GUSTS] += self.turbulence_model.process_noise_variance
        x[:, :3] += self.dt * self.accelerations(measured)
        unexplained_acceleration = unexplained_acceleration_size(self.context, measured.eta_bar)
        P[:, _RATES, _RATES] += self.process_noise_scale[:, None] * unexplained_acceleration**2
        nu = measured.x - x[:, :3]
        self.x, self.P, S = update_state_and_covariance(x, P, nu, self.R)
        self.mode_probabilities = posterior_probabilities(predicted_probabilities, log_likelihood(nu, S))
        return self.latch_alarm_and_decide_verdict()

    def accelerations(self, measured: Measured) -> np.ndarray:
        """Compute each hypothesis' acceleration in the elapsed frame, (M, 3) rad/s2."""
        mode_accelerations = np.tile(measured.acceleration, (N_MODES, 1))
        lost_surfaces = [self.context.leading[leading_axis] for leading_axis, _ in LOSS_MODES]
        mode_accelerations[1:-1] += _LOSS_THETAS * measured.contribution.T[lost_surfaces]
        return mode_accelerations

    def latch_alarm_and_decide_verdict(self) -> Verdict:
        """The alarm by the odds of any fault; the surface by the sum of its hypotheses."""
        healthy_probability = self.mode_probabilities[0]
        statistic = float(np.log((1.0 - healthy_probability) / healthy_probability) / self.options["alarm"])
        self.detected = self.detected or statistic > 1.0
        if not self.detected:
            return Verdict(statistic=statistic)
        unknown_fault_probability = float(self.mode_probabilities[-1])
        loss_mode_probabilities = self.mode_probabilities[1:-1].reshape(3, len(LOSS_THETA_LEVELS))
        main_surface_loss_probabilities = loss_mode_probabilities.sum(axis=1)
        if unknown_fault_probability > self.options["isolate"]:
            return Verdict(True, None, "unanticipated", "unanticipated", statistic=statistic)
        most_likely_axis = int(np.argmax(main_surface_loss_probabilities))
        if main_surface_loss_probabilities[most_likely_axis] < self.options["isolate"]:
            min_candidate_probability = 1.0 - self.options["isolate"]
            candidates = tuple(
                main_surface_name
                for main_surface_name, loss_probability in zip(
                    self.context.leaders, main_surface_loss_probabilities, strict=True
                )
                if loss_probability > min_candidate_probability
            )
            return Verdict(True, "pqr"[most_likely_axis], statistic=statistic, candidates=candidates)
        effectiveness_change = float(
            loss_mode_probabilities[most_likely_axis]
            @ LOSS_THETA_LEVELS
            / main_surface_loss_probabilities[most_likely_axis]
        )
        surface_name = self.context.leaders[most_likely_axis]
        return Verdict(
            True,
            "pqr"[most_likely_axis],
            surface_name,
            "loss_of_effectiveness",
            effectiveness_change,
            None,
            statistic,
        )
