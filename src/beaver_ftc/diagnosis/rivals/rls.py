"""Recursive least-squares fault monitor: no model of the aircraft, only what went in and what came out.

For each pair (surface, rate) a linear input-output model is learnt in flight; the error of its one-step
prediction is compared with the errors before, and the alarm is a score z = (error - mean) / deviation
beyond a limit [Keipour2019]. The pair that raises the alarm is what is isolated. Departures: two past
samples of input and output instead of a longer window; mean and deviation fade exponentially.

Learnt by recursive least squares with exponential forgetting [Ljung1999, sec. 11.2]:

    K = P phi / (lam + phi' P phi),   w += K (y - w' phi),   P = (P - K phi' P) / lam
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict
from beaver_ftc.diagnosis.rivals import options_of


class RecursiveLeastSquares:
    """y = w' phi, learnt sample by sample.

    n: parameters. forgetting: lam in (0, 1]. prior: variance of the parameters at the start; it also bounds
    P, which would otherwise grow without excitation.
    """

    def __init__(self, n: int, forgetting: float, prior: float) -> None:
        self.w, self.P = np.zeros(n), np.eye(n) * prior
        self._forgetting, self._prior = forgetting, prior

    def step(self, phi: np.ndarray, y: float) -> float:
        """Learn from one sample; returns the error of the prediction made before it."""
        Pphi = self.P @ phi
        gain = Pphi / (self._forgetting + phi @ Pphi)
        error = y - float(self.w @ phi)
        self.w = self.w + gain * error
        P = (self.P - np.outer(gain, Pphi)) / self._forgetting
        largest = float(P.diagonal().max())
        self.P = P if largest <= self._prior else P * (self._prior / largest)
        return error


class Pair:
    """One input, one output: y[k] from y[k-1], y[k-2], u[k-1], u[k-2] and a constant."""

    def __init__(self, forgetting: float, fade: float, floor: float) -> None:
        self._model = RecursiveLeastSquares(5, forgetting, 1e4)
        self._fade, self._floor = fade, floor
        self._past = np.zeros(5)
        self._past[4] = 1.0
        self.mean, self.variance = 0.0, 0.0

    def step(self, u: float, y: float) -> float:
        """|z| of the newest output; then learn from it."""
        error = self._model.step(self._past, y)
        score = abs(error - self.mean) / sqrt(self.variance + self._floor**2)
        self.mean += (1.0 - self._fade) * (error - self.mean)
        self.variance = self._fade * self.variance + (1.0 - self._fade) * (error - self.mean) ** 2
        self._past = np.array([y, self._past[0], u, self._past[2], 1.0])
        return score


class RlsMonitor:
    """Recursive least-squares monitor of each surface and its rate, without a model [Keipour2019]."""

    name: ClassVar[str] = "rls-monitor"
    defaults: ClassVar[Mapping[str, float]] = {
        "alarm": 8.0,  # |z|
        "forgetting_s": 5.0,
        "score_s": 2.0,
        "floor_rad_s": 1e-5,  # smallest deviation: a perfect prediction is no reason for an alarm
        "warm_up_s": 4.0,  # before it, the models have seen too little
    }

    def reset(self, context: Context) -> None:
        """Know nothing."""
        self.option = options_of(self.name, self.defaults, context)
        forgetting = exp(-context.dt_s / self.option["forgetting_s"])
        fade = exp(-context.dt_s / self.option["score_s"])
        floor = np.hypot(self.option["floor_rad_s"], context.declared.gyro_rad_s)
        self.pairs = [Pair(forgetting, fade, float(floor[i])) for i in range(3)]
        self.leading, self.leaders = context.leading, context.leaders
        self.verdict = Verdict()

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Score every pair; the first beyond the limit is the fault."""
        scores = [
            pair.step(float(command[s]), float(rate))
            for pair, s, rate in zip(self.pairs, self.leading, measured.x, strict=True)
        ]
        if measured.t_s < self.option["warm_up_s"]:
            return Verdict(statistic=0.0)
        worst = int(np.argmax(scores))
        statistic = scores[worst] / self.option["alarm"]
        if statistic > 1.0 and not self.verdict.detected:
            surface = self.leaders[worst]
            self.verdict = Verdict(True, "pqr"[worst], surface, candidates=(surface,))
        return self.verdict._replace(statistic=statistic)
