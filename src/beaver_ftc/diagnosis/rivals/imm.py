"""Interacting multiple models: one Kalman filter a hypothesis, and the probability of each.

Hypotheses: healthy; each surface with little and with much of its effectiveness lost; and one that explains
anything badly, by noise alone, for faults outside the class. Mixing, filtering, combination as in
[Blom1988]; actuator faults as modes as in [Zhang1998]. Declared turbulence is a state of each (kalman.py).
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.diagnosis.rivals import options_of
from beaver_ftc.diagnosis.rivals.kalman import Air, log_likelihood, unexplained, update

LEVELS = (-0.25, -0.5, -0.9)
# (leader of roll, pitch or yaw, theta); the last one is noise
MODES = ((None, 0.0), *((s, level) for s in range(3) for level in LEVELS))
N_MODES = len(MODES) + 1
_LEAST = 1e-12  # no probability below it: a mode must be able to come back


def transition(stay: float, n: int) -> np.ndarray:
    """Markov chain (n, n): stay with probability `stay`, else go anywhere alike."""
    chain = np.full((n, n), (1.0 - stay) / (n - 1))
    np.fill_diagonal(chain, stay)
    return chain


def mix(
    x: np.ndarray, P: np.ndarray, probability: np.ndarray, chain: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mixed states (M, n), covariances (M, n, n) and predicted probabilities (M,) [Blom1988, steps 1 and
    2]."""
    predicted = probability @ chain
    weight = chain * probability[:, None] / predicted[None, :]
    mean = weight.T @ x
    off = x[:, None, :] - mean[None, :, :]
    spread = P[:, None] + off[..., :, None] * off[..., None, :]
    return mean, np.einsum("ij,ijab->jab", weight, spread), predicted


def posterior(predicted: np.ndarray, log_likelihoods: np.ndarray) -> np.ndarray:
    """Bayes' rule, in logarithms so that nothing underflows."""
    score = np.log(predicted) + log_likelihoods
    score = np.exp(score - score.max())
    score = np.maximum(score / score.sum(), _LEAST)
    return score / score.sum()


class InteractingMultipleModels:
    """Interacting multiple models of lost effectiveness, alarm on the odds of a fault [Blom1988]."""

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
        self.context, self.option = context, options_of(self.name, self.defaults, context)
        self.dt = context.dt_s
        self.chain = transition(self.option["stay"], N_MODES)
        self.probability = np.full(N_MODES, _LEAST)
        self.probability[0] = 1.0 - (N_MODES - 1) * _LEAST
        self.air = Air(context)
        rates = context.declared.rate_variance(self.option["measurement_rad_s"])
        self.R = np.diag(rates)
        self.x = np.zeros((N_MODES, 3 + self.air.n))
        self.P = np.tile(np.diag(np.concatenate((rates, self.air.variance))), (N_MODES, 1, 1))
        self.F = np.eye(3 + self.air.n)
        self.F[:3, 3:], self.F[3:, 3:] = self.air.effect, np.diag(self.air.keep)
        self.noise = np.full(N_MODES, self.option["noise"])
        self.noise[-1] = self.option["unknown_noise"]
        self.detected = False
        self.first = True

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Mix, filter, weigh, decide."""
        if self.first:
            self.first, self.x[:, :3] = False, measured.x
            return Verdict(statistic=0.0)
        x, P, predicted = mix(self.x, self.P, self.probability, self.chain)
        if self.air.n:
            x, P = x @ self.F.T, self.F @ P @ self.F.T
            P[:, range(3, 6), range(3, 6)] += self.air.noise
        x[:, :3] += self.dt * self.accelerations(measured)
        size = unexplained(self.context, measured.eta_bar)
        P[:, :3, :3] += np.einsum("m,ij->mij", (self.dt * self.noise) ** 2, np.diag(size**2))
        nu = measured.x - x[:, :3]
        self.x, self.P, S = update(x, P, nu, self.R)
        self.probability = posterior(predicted, log_likelihood(nu, S))
        return self.verdict()

    def accelerations(self, measured: Measured) -> np.ndarray:
        """What each hypothesis makes of the elapsed frame, (M, 3) rad/s2."""
        each = np.tile(measured.acceleration, (N_MODES, 1))
        for m, (leader, theta) in enumerate(MODES):
            if leader is not None:
                each[m] += theta * measured.contribution[:, self.context.leading[leader]]
        return each

    def verdict(self) -> Verdict:
        """The alarm by the odds of any fault; the surface by the sum of its hypotheses."""
        healthy = self.probability[0]
        statistic = float(np.log((1.0 - healthy) / healthy) / self.option["alarm"])
        self.detected = self.detected or statistic > 1.0
        if not self.detected:
            return Verdict(statistic=statistic)
        unknown, known = float(self.probability[-1]), self.probability[1:-1].reshape(3, len(LEVELS))
        likely = known.sum(axis=1)
        if unknown > self.option["isolate"]:
            return Verdict(True, None, "unanticipated", "unanticipated", statistic=statistic)
        worst = int(np.argmax(likely))
        if likely[worst] < self.option["isolate"]:
            least = 1.0 - self.option["isolate"]
            left = tuple(s for s, p in zip(self.context.leaders, likely, strict=True) if p > least)
            return Verdict(True, "pqr"[worst], statistic=statistic, candidates=left)
        theta = float(known[worst] @ LEVELS / likely[worst])
        name = self.context.leaders[worst]
        return Verdict(True, "pqr"[worst], name, "loss_of_effectiveness", theta, None, statistic)
