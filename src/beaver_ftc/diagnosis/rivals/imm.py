"""Interacting multiple models: one Kalman filter a hypothesis, and the probability of each.

The hypotheses, or modes, j = 0 ... M - 1 in this order (M is N_MODES):

    healthy
    a loss of 25, 50 and 90 % of the surface that leads roll; the same for pitch; the same for yaw
    unknown: large noise explains any flight, but badly; for faults outside the class

    z (M, n), P (M, n, n)   mean and covariance of the state of each mode (kalman.py)
    mu (M,)                 probability of each mode

Mixing, filtering and combination are those of [Blom1988], actuator faults as modes those of [Zhang1998].
Declared turbulence adds states (kalman.py).
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals.kalman import KalmanRival, log_likelihood
from beaver_ftc.diagnosis.rivals.rival import UNANTICIPATED

LOSS_THETA_LEVELS = (-0.25, -0.5, -0.9)
N_LEVELS = len(LOSS_THETA_LEVELS)
# The order of the modes: healthy; each level of the surfaces that lead roll, pitch and yaw; unknown.
N_MODES = 1 + 3 * N_LEVELS + 1
_MIN_MODE_PROBABILITY = 1e-12  # no probability below it: a mode must be able to come back


def transition_matrix(stay: float, n: int) -> np.ndarray:
    """Markov chain (n, n) of the modes: `stay` on the diagonal, (1 - stay) / (n - 1) elsewhere."""
    chain = np.full((n, n), (1.0 - stay) / (n - 1))
    np.fill_diagonal(chain, stay)
    return chain


def mix_states(
    z: np.ndarray, P: np.ndarray, mu: np.ndarray, chain: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mixed states (M, n), covariances (M, n, n) and predicted probabilities (M,) [Blom1988, steps 1 and 2]:

        predicted_j = sum_i mu_i chain_ij,    w_ij = chain_ij mu_i / predicted_j
        mixed_j = sum_i w_ij z_i,    P_j = sum_i w_ij (P_i + (z_i - mixed_j) (z_i - mixed_j)')

    mu (M,): probabilities.
    """
    predicted = mu @ chain
    weights = chain * mu[:, None] / predicted
    mixed = weights.T @ z
    deviation = z[:, None, :] - mixed
    spread = P[:, None] + deviation[..., :, None] * deviation[..., None, :]
    return mixed, np.einsum("ij,ijab->jab", weights, spread), predicted


def posterior_probabilities(predicted: np.ndarray, log_likelihoods: np.ndarray) -> np.ndarray:
    """Bayes' rule, mu_j ~ predicted_j exp(log_likelihoods_j), in logarithms so that nothing underflows; all
    (M,). None is below _MIN_MODE_PROBABILITY before the last division by the sum."""
    log_mu = np.log(predicted) + log_likelihoods
    mu = np.exp(log_mu - log_mu.max())
    mu = np.maximum(mu / mu.sum(), _MIN_MODE_PROBABILITY)
    return mu / mu.sum()


class InteractingMultipleModels(KalmanRival):
    """Interacting multiple models, one for each loss; the odds of a fault raise the alarm [Blom1988]."""

    name: ClassVar[str] = "multiple-models"
    defaults: ClassVar[Mapping[str, float]] = {
        "alarm": 5.0,  # logarithm of the odds of a fault
        "isolate": 0.9,  # probability at which a surface is named
        "noise": 3.0,  # standard deviation of the acceleration error over its declared bound
        "unknown_noise": 30.0,  # the same of the unknown mode
        "stay": 0.9999,  # probability that the hypothesis stays true for a frame
        "measurement_rad_s": 1e-5,  # standard deviation of the rate measured by a perfect gyro
    }

    def start(self) -> None:
        """Start with the healthy mode, whose probability is almost 1."""
        self.fill_model()
        self.chain = transition_matrix(self.options["stay"], N_MODES)
        self.mu = np.full(N_MODES, _MIN_MODE_PROBABILITY)
        self.mu[0] = 1.0 - (N_MODES - 1) * _MIN_MODE_PROBABILITY
        self.z = np.zeros((N_MODES, self.n))
        self.P = np.tile(self.P, (N_MODES, 1, 1))
        self.noise = np.full(N_MODES, self.options["noise"])
        self.noise[-1] = self.options["unknown_noise"]

    def predict(self, measured: Measured, before: Measured) -> None:
        """Mix the hypotheses, and predict each over the elapsed frame."""
        z, P, self.predicted_mu = mix_states(self.z, self.P, self.mu, self.chain)
        acceleration = np.tile(measured.acceleration, (N_MODES, 1))
        effects = measured.contribution.T[self.leading]
        acceleration[1:-1] += np.einsum("l,ia->ila", LOSS_THETA_LEVELS, effects).reshape(-1, 3)
        self.z = self.move(z, self.F, acceleration)
        self.P = self.add_noise(self.F @ P @ self.F.T, measured, self.noise)

    def update_statistic(self, nu: np.ndarray, S: np.ndarray) -> float:
        """The logarithm of the odds of any fault, over the alarm level."""
        self.mu = posterior_probabilities(self.predicted_mu, log_likelihood(nu, S))
        return float(np.log((1.0 - self.mu[0]) / self.mu[0]) / self.options["alarm"])

    def isolate(self, measured: Measured) -> Verdict:
        """The verdict by the probabilities, with the level `isolate`:

        unknown mode above `isolate`                       unanticipated
        modes of one surface together at least `isolate`   this surface, with their mean theta
        otherwise                                          candidates: surfaces above 1 - `isolate`
        """
        level = self.options["isolate"]
        levels = self.mu[1:-1].reshape(3, N_LEVELS)
        if self.mu[-1] > level:
            return UNANTICIPATED
        lost = levels.sum(axis=1)
        i = int(np.argmax(lost))
        if lost[i] < level:
            candidates = tuple(self.context.leaders[j] for j in range(3) if lost[j] > 1.0 - level)
            return Verdict(True, "pqr"[i], candidates=candidates)
        return self.loss(i, float(levels[i] @ LOSS_THETA_LEVELS / lost[i]))
