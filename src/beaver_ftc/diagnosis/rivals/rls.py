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
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options


class RecursiveLeastSquaresFit:
    """y = w' phi, learnt sample by sample.

    forget: lam in (0, 1]. prior_variance: of the parameters at the start; it also bounds P, which
    would otherwise grow without excitation.
    """

    def __init__(self, n_parameters: int, forgetting_factor: float, prior_variance: float) -> None:
        self.weights, self.P = np.zeros(n_parameters), np.eye(n_parameters) * prior_variance
        self._forgetting_factor, self._prior_variance = forgetting_factor, prior_variance

    def step(self, phi: np.ndarray, y: float) -> float:
        """Learn from one sample; returns the error of the prediction made before it."""
        Pphi = self.P @ phi
        gain = Pphi / (self._forgetting_factor + phi @ Pphi)
        prediction_error = y - float(self.weights @ phi)
        self.weights = self.weights + gain * prediction_error
        P = (self.P - np.outer(gain, Pphi)) / self._forgetting_factor
        largest_variance = float(P.diagonal().max())
        self.P = (
            P if largest_variance <= self._prior_variance else P * (self._prior_variance / largest_variance)
        )
        return prediction_error


class InputOutputPredictionTest:
    """Test of the prediction of one output by one input: y[k] from y[k-1], y[k-2], u[k-1], u[k-2] and a
    constant."""

    def __init__(self, forgetting_factor: float, averaging_decay: float, min_error_std: float) -> None:
        self._model = RecursiveLeastSquaresFit(5, forgetting_factor, 1e4)
        self._averaging_decay, self._min_error_std = averaging_decay, min_error_std
        self._regressor = np.zeros(5)
        self._regressor[4] = 1.0
        self.error_mean, self.error_variance = 0.0, 0.0

    def step(self, u: float, y: float) -> float:
        """Return |z| of the newest output, then learn from it."""
        prediction_error = self._model.step(self._regressor, y)
        score = abs(prediction_error - self.error_mean) / sqrt(self.error_variance + self._min_error_std**2)
        self.error_mean += (1.0 - self._averaging_decay) * (prediction_error - self.error_mean)
        self.error_variance = (
            self._averaging_decay * self.error_variance
            + (1.0 - self._averaging_decay) * (prediction_error - self.error_mean) ** 2
        )
        self._regressor = np.array([y, self._regressor[0], u, self._regressor[2], 1.0])
        return score


class RlsMonitor:
    """Recursive least squares between each surface and its rate, without an aircraft model [Keipour2019]."""

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
        self.options = rival_options(self.name, self.defaults, context)
        forgetting_factor = exp(-context.dt_s / self.options["forgetting_s"])
        averaging_decay = exp(-context.dt_s / self.options["score_s"])
        min_error_std = np.hypot(self.options["floor_rad_s"], context.declared.gyro_rad_s)
        self.prediction_tests = [
            InputOutputPredictionTest(forgetting_factor, averaging_decay, float(min_error_std[i]))
            for i in range(3)
        ]
        self.leading_surface_indices, self.leaders = context.leading, context.leaders
        self.verdict = Verdict()

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Score every pair; the first beyond the limit is the fault."""
        scores = [
            prediction_test.step(float(command[surface_index]), float(measured_rate))
            for prediction_test, surface_index, measured_rate in zip(
                self.prediction_tests, self.leading_surface_indices, measured.x, strict=True
            )
        ]
        if measured.t_s < self.options["warm_up_s"]:
            return Verdict(statistic=0.0)
        worst_axis = int(np.argmax(scores))
        statistic = scores[worst_axis] / self.options["alarm"]
        if statistic > 1.0 and not self.verdict.detected:
            surface_name = self.leaders[worst_axis]
            self.verdict = Verdict(True, "pqr"[worst_axis], surface_name, candidates=(surface_name,))
        return self.verdict._replace(statistic=statistic)
