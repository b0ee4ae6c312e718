"""Recursive least-squares fault monitor: no model of the aircraft, only what went in and what came out.

For each pair (surface, rate) a linear input-output model is learnt in flight. The error of its one-step
prediction is compared with the errors before: z = (error - mean) / deviation. If |z| exceeds a limit, the
alarm is raised, and the surface of the pair is isolated [Keipour2019]. Departures: two past samples of input
and output instead of a longer window; mean and deviation fade exponentially.

The model y = w' phi is learnt by recursive least squares with exponential forgetting [Ljung1999, sec. 11.2]:

    K = P phi / (lam + phi' P phi),   w <- w + K (y - w' phi),   P <- (P - K phi' P) / lam
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import ClassVar

import numpy as np

from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals.rival import RivalDetector


class RecursiveLeastSquaresFit:
    """The model y = w' phi, learnt sample by sample; w, phi (n,), P (n, n).

    lam: forgetting factor of a sample, in (0, 1]. prior: variance of the weights w at the start. It is also
    the upper limit of the diagonal of P, which would otherwise grow without excitation.
    """

    def __init__(self, n: int, lam: float, prior: float) -> None:
        self.weights = np.zeros(n)
        self.P = np.eye(n) * prior
        self._lam = lam
        self._prior = prior

    def step(self, phi: np.ndarray, y: float) -> float:
        """Update w and P by one sample; return y - w' phi with the w before it, in the unit of y."""
        Pphi = self.P @ phi
        K = Pphi / (self._lam + phi @ Pphi)
        error = y - float(self.weights @ phi)
        self.weights = self.weights + K * error
        P = (self.P - np.outer(K, Pphi)) / self._lam
        self.P = P * min(1.0, self._prior / float(P.diagonal().max()))
        return error


class InputOutputPredictionTest:
    """Test of the prediction of one output by one input: y[k] from phi = (y[k-1], y[k-2], u[k-1], u[k-2], 1).

    lam: forgetting factor of the model. fade: share of mean and variance that remains after a sample.
    least: smallest standard deviation of the error, in the unit of y.
    """

    def __init__(self, lam: float, fade: float, least: float) -> None:
        self._model = RecursiveLeastSquaresFit(5, lam, 1e4)  # 1e4: the weights are not known at the start
        self._fade = fade
        self._least = least
        self._phi = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
        self.mean = 0.0
        self.variance = 0.0

    def step(self, u: float, y: float) -> float:
        """Return |z| of the output y, with mean m and variance v before it; then update the model, m and v:

        |z| = |error - m| / sqrt(v + least^2)
        m <- m + (1 - fade) (error - m),    v <- fade v + (1 - fade) (error - m)^2        with the new m
        """
        error = self._model.step(self._phi, y)
        score = abs(error - self.mean) / sqrt(self.variance + self._least**2)
        self.mean += (1.0 - self._fade) * (error - self.mean)
        self.variance = self._fade * self.variance + (1.0 - self._fade) * (error - self.mean) ** 2
        self._phi = np.array([y, self._phi[0], u, self._phi[2], 1.0])
        return score


class RlsMonitor(RivalDetector):
    """Recursive least squares between each surface and its rate, without an aircraft model [Keipour2019]."""

    name: ClassVar[str] = "rls-monitor"
    defaults: ClassVar[Mapping[str, float]] = {
        "alarm": 8.0,  # |z|
        "forgetting_s": 5.0,  # time constant with which the models forget
        "score_s": 2.0,  # time constant of mean and deviation
        "floor_rad_s": 1e-5,  # smallest deviation: a perfect prediction is no reason for an alarm
        "warm_up_s": 4.0,  # before it, the models have seen too little
    }

    def start(self) -> None:
        """Start without a model."""
        lam, fade = (exp(-self.dt / self.options[name]) for name in ("forgetting_s", "score_s"))
        least = np.hypot(self.options["floor_rad_s"], self.context.declared.gyro_rad_s)
        self.tests = [InputOutputPredictionTest(lam, fade, float(std)) for std in least]

    def advance(self, measured: Measured, command: np.ndarray) -> float | np.ndarray:
        """Score every pair."""
        pairs = zip(self.tests, command[self.leading], measured.x, strict=True)
        scores = [test.step(float(u), float(y)) for test, u, y in pairs]
        if measured.t_s < self.options["warm_up_s"]:
            return 0.0
        return np.array(scores) / self.options["alarm"]

    def isolate(self, measured: Measured) -> Verdict:
        """The verdict on the surface of the pair that raised the alarm."""
        surface = self.context.leaders[self.alarm_axis]
        return Verdict(True, "pqr"[self.alarm_axis], surface, candidates=(surface,))
