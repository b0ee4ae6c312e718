"""Incremental nonlinear dynamic inversion: measure the acceleration instead of modelling it.

    u = u0 + G^-1 (nu - xdot0)          [Sieberling2010]

xdot0 is the filtered difference of the measured rates and u0 the command that gave it, through the same
filter [Smeur2016, sec. III]. A rate measured now shows the command given two steps ago (JSBSim's frame of
delay, and the difference's), so that is the u0 that belongs to it.
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.control.base import Reference
from beaver_ftc.control.rivals.tracking import DELAY_FRAMES, GAINS, Rival
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict


class LowPass:
    """Second-order low-pass filter with two equal poles, exact for an input held over the frame."""

    def __init__(self, pole_per_s: float, dt_s: float, start: np.ndarray) -> None:
        self._a = exp(-pole_per_s * dt_s)
        self._first, self.value = start.copy(), start.copy()

    def step(self, value: np.ndarray) -> np.ndarray:
        """The filtered value."""
        self._first = self._a * self._first + (1.0 - self._a) * value
        self.value = self._a * self.value + (1.0 - self._a) * self._first
        return self.value


class IncrementalInversion(Rival):
    """Incremental nonlinear dynamic inversion on filtered angular acceleration [Sieberling2010]."""

    name: ClassVar[str] = "indi"
    defaults: ClassVar[Mapping[str, float]] = GAINS | {"filter_per_s": 50.0}

    def reset(self, context: Context) -> None:
        """In trim: no acceleration, trimmed surfaces."""
        self.begin(context)
        pole, dt = self.option["filter_per_s"], context.dt_s
        self.acceleration = LowPass(pole, dt, np.zeros(3))
        self.leading = list(context.leading)
        trim = context.trim_rad[self.leading]
        self.commanded = LowPass(pole, dt, trim)
        self.given = [trim] * (DELAY_FRAMES + 1)
        self.before: np.ndarray | None = None

    def compile_into(self, law: np.void) -> None:
        """Fill the record of compiled_rivals.py, in trim."""
        config, memory, trim = law["config"], law["memory"], self.context.trim_rad[self.leading]
        config["incremental"] = 1
        config["Kp"], config["Ki"] = self.option["proportional_per_s"], self.option["integral_per_s2"]
        config["keep"] = exp(-self.option["filter_per_s"] * self.context.dt_s)
        memory["commanded"] = memory["command_filter"] = trim

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """u0 + G^-1 (nu - xdot0)."""
        before = measured.x if self.before is None else self.before
        xdot0 = self.acceleration.step((measured.x - before) / self.context.dt_s)
        u0 = self.commanded.step(self.given[-DELAY_FRAMES])
        nu = self.demand(measured, reference)
        G = self.context.model.G(measured.y)[:, self.leading]
        command = self.command(u0 + np.linalg.solve(G, nu - xdot0))
        self.before = measured.x
        self.given = [*self.given[1:], command[self.leading]]
        return command
