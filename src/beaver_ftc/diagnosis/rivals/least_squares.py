"""Recursive least squares with exponential forgetting [Ljung1999, sec. 11.2].

K = P phi / (lam + phi' P phi),   w += K (y - w' phi),   P = (P - K phi' P) / lam
"""

import numpy as np


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
