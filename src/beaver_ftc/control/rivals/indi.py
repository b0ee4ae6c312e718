"""Incremental nonlinear dynamic inversion: measure the acceleration instead of modelling it.

    u = u0 + G^-1 (nu - xdot0)          [Sieberling2010]

xdot0 is the filtered difference of the measured rates. u0 are the positions of the surfaces that gave it,
through the same filter [Smeur2016, sec. III]: those that the declared actuators' model gives, not the
commands. G u0 of the elapsed frame is measured.contribution, so that

    G u = nu - xdot0 + G u0

A scenario that names the law flies the same in kernels (laws/compiled_rivals.py). `step` flies an object of
this class that is given to the loop, or that a plug-in registers by another name.
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.control.rivals.tracking import GAINS, RivalLaw
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict


class LowPass:
    """Two equal low-pass filters of first order in series, each of which holds its input over the frame."""

    def __init__(self, pole_per_s: float, dt_s: float, start: np.ndarray) -> None:
        self._keep = exp(-pole_per_s * dt_s)
        self._first, self.value = start.copy(), start.copy()

    def step(self, value: np.ndarray) -> np.ndarray:
        """The filtered value."""
        self._first = self._keep * self._first + (1.0 - self._keep) * value
        self.value = self._keep * self.value + (1.0 - self._keep) * self._first
        return self.value


class IncrementalInversion(RivalLaw):
    """Incremental nonlinear dynamic inversion on filtered angular acceleration [Sieberling2010]."""

    name: ClassVar[str] = "indi"
    defaults: ClassVar[Mapping[str, float]] = GAINS | {"filter_per_s": 50.0}

    def reset(self, context: Context) -> None:
        """In trim: no acceleration, trimmed surfaces."""
        self.begin(context)
        pole, dt = self.option["filter_per_s"], context.dt_s
        self.acceleration = LowPass(pole, dt, np.zeros(3))
        self.leading = list(context.leading)
        self.by_surfaces = LowPass(pole, dt, self.trimmed())

    def trimmed(self) -> np.ndarray:
        """Acceleration (3,) rad/s2 that the leading surfaces give in trim."""
        context = self.context
        given: np.ndarray = (context.model.G(context.trim_y) * context.trim_rad)[:, self.leading].sum(axis=1)
        return given

    def compile_into(self, law: np.void) -> None:
        """Fill the record of compiled_rivals.py, in trim."""
        config = law["config"]
        config["incremental"] = 1
        config["Kp"], config["Ki"] = self.option["proportional_per_s"], self.option["integral_per_s2"]
        config["keep"] = exp(-self.option["filter_per_s"] * self.context.dt_s)
        law["memory"]["surface_filter"] = self.trimmed()

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """G^-1 (nu - xdot0 + G u0)."""
        moved = self.moved(measured)
        if moved is not None:
            self.acceleration.step(moved / self.context.dt_s)
            self.by_surfaces.step(measured.contribution[:, self.leading].sum(axis=1))
        nu = self.demand(measured, reference)
        G = self.context.model.G(measured.y)[:, self.leading]
        return self.command(np.linalg.solve(G, nu - self.acceleration.value + self.by_surfaces.value))
