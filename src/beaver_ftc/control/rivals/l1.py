"""L1 adaptive control with piecewise-constant adaptation [Hovakimyan2010, sec. 3.3].

    xhat' = f + G u + sigma - a e,    e = xhat - x
    sigma = -A / Phi e,      A = e^{-a dt},  Phi = (1 - A) / a
    G_lead u_lead = nu - f - C sigma - G_others u_trim,      C a first-order low-pass filter
    nu = xm' + Kp e_m + Ki int e_m,    e_m = xm - x

    x, xhat, xm     (3,) rad/s     body rates: measured, predicted, of the reference model
    sigma           (3,) rad/s2    acceleration that the design model f + G u does not explain
    a; A, Phi       1/s; 1, s      pole of the predictor; its decay and its integral over a frame
    u               (n,) rad       all surfaces; those that lead roll, pitch and yaw are commanded, the others
                                   stay in trim

The adaptation is as fast as the frame allows; only C limits the bandwidth of the compensation.

The predictor of a frame, with the measured x[k], and f + G u of the frame:

    e <- A e + Phi sigma + dt (f + G u) - (x[k] - x[k-1])

Departure from the source: its map is exact for terms that are constant over the frame, and multiplies the
last two terms by Phi / dt, which is 1 - a dt / 2 to first order.
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.control.rivals.kernel_law import GAINS
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options


class Predictor:
    """The state predictor and its adaptation."""

    def __init__(self, pole_per_s: float, dt_s: float) -> None:
        self._dt = dt_s
        self._decay = exp(-pole_per_s * dt_s)
        self._Phi = (1.0 - self._decay) / pole_per_s
        self.error = np.zeros(3)
        self.sigma = np.zeros(3)

    def step(self, dx: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """e <- A e + dt acceleration + Phi sigma - dx,    sigma = -A / Phi e; returns sigma (3,) rad/s2.

        dx (3,) rad/s: change of the measured rates over the frame; acceleration (3,) rad/s2: f + G u in
        it.
        """
        self.error = self._decay * self.error + self._dt * acceleration + self._Phi * self.sigma - dx
        self.sigma = -self._decay / self._Phi * self.error
        return self.sigma


class L1Adaptive:
    """L1 adaptive control, piecewise-constant adaptation behind a low-pass filter [Hovakimyan2010]."""

    name: ClassVar[str] = "l1-adaptive"
    defaults: ClassVar[Mapping[str, float]] = GAINS | {"predictor_per_s": 1.0, "bandwidth_per_s": 20.0}
    fault_tolerant = False

    def reset(self, context: Context) -> None:
        """Prepare for a flight: no error, and nothing unexplained yet."""
        self.context = context
        self.option = rival_options(self.name, self.defaults, context)
        self.predictor = Predictor(self.option["predictor_per_s"], context.dt_s)
        self.keep = exp(-self.option["bandwidth_per_s"] * context.dt_s)
        self.compensated = np.zeros(3)
        self.integral = np.zeros(3)
        self.saturated = False
        self.before: np.ndarray | None = None

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Adapt sigma to the elapsed frame, and return the command (surfaces,) rad, within the travel."""
        if self.before is not None:
            sigma = self.predictor.step(measured.x - self.before, measured.acceleration)
            self.compensated = self.keep * self.compensated + (1.0 - self.keep) * sigma
        self.before = measured.x
        context = self.context
        leading = list(self.context.leading)
        nu = self.demand(measured.x, reference)
        G = context.model.G(measured.y)
        wanted = context.trim_rad.copy()
        wanted[leading] = 0.0
        needed = nu - context.model.f(measured.x, measured.y) - self.compensated - G @ wanted
        wanted[leading] = np.linalg.solve(G[:, leading], needed)
        command: np.ndarray = np.clip(wanted, *context.travel_rad)
        self.saturated = bool((command != wanted).any())
        return command

    def demand(self, x: np.ndarray, reference: Reference) -> np.ndarray:
        """nu = xm' + Kp e_m + Ki int e_m (3,) rad/s2. The integral of the error does not change while a
        surface is at its stop."""
        error = reference.rate - x
        option = self.option
        if not self.saturated:
            self.integral = self.integral + self.context.dt_s * error
        following: np.ndarray = reference.acceleration + option["proportional_per_s"] * error
        return following + option["integral_per_s2"] * self.integral
