"""L1 adaptive control with piecewise-constant adaptation [Hovakimyan2010, sec. 3.3].

    xhat' = f + G u + sigma - a e,    e = xhat - x
    sigma = -A / Phi e,      A = e^{-a dt},  Phi = (1 - A) / a
    G_lead u_lead = nu - f - C sigma - G_others u_trim,      C a first-order low-pass filter

u: all surfaces, of which those that lead roll, pitch and yaw are commanded and the others stay in trim.
The adaptation is as fast as the frame allows; what reaches the surfaces is limited by C alone.

The predictor of a frame, with x[k] measured and f + G u as it was in the frame:

    e <- A e + Phi sigma + dt (f + G u) - (x[k] - x[k-1])

Departure: the source's map, exact for what is constant over the frame, multiplies the last two terms by
Phi / dt, which is 1 - a dt / 2 to first order.
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.control.rivals.tracking import GAINS, RivalLaw, with_others
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict


class Predictor:
    """The state predictor and its adaptation; sigma (3,) rad/s2 is what the model does not explain."""

    def __init__(self, pole_per_s: float, dt_s: float) -> None:
        self._dt, self._decay = dt_s, exp(-pole_per_s * dt_s)
        self._Phi = (1.0 - self._decay) / pole_per_s
        self.error, self.sigma = np.zeros(3), np.zeros(3)

    def step(self, moved: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """moved (3,) rad/s: change of the measured rates over the frame; acceleration (3,) rad/s2: f + G u
        in it."""
        self.error = self._decay * self.error + self._dt * acceleration + self._Phi * self.sigma - moved
        self.sigma = -self._decay / self._Phi * self.error
        return self.sigma


class L1Adaptive(RivalLaw):
    """L1 adaptive control, piecewise-constant adaptation behind a low-pass filter [Hovakimyan2010]."""

    name: ClassVar[str] = "l1-adaptive"
    defaults: ClassVar[Mapping[str, float]] = GAINS | {"predictor_per_s": 1.0, "bandwidth_per_s": 20.0}

    def reset(self, context: Context) -> None:
        """Nothing unexplained yet."""
        self.begin(context)
        self.predictor = Predictor(self.option["predictor_per_s"], context.dt_s)
        self.keep = exp(-self.option["bandwidth_per_s"] * context.dt_s)
        self.compensated = np.zeros(3)

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Learn what the elapsed frame did not explain, and demand the rest."""
        moved = self.moved(measured)
        if moved is not None:
            sigma = self.predictor.step(moved, measured.acceleration)
            self.compensated = self.keep * self.compensated + (1.0 - self.keep) * sigma
        nu = self.demand(measured, reference)
        model, G = self.context.model, self.context.model.G(measured.y)
        others = G @ with_others(np.zeros(3), self.context)
        rest = nu - model.f(measured.x, measured.y) - self.compensated - others
        return self.command(np.linalg.solve(G[:, self.context.leading], rest))
