"""Incremental nonlinear dynamic inversion: measure the acceleration instead of modelling it.

    u = u0 + G^-1 (nu - xdot0)          [Sieberling2010]

    u, u0   (3,) rad              surfaces that lead roll, pitch and yaw: command, and the positions that
                                  caused xdot0
    nu      (3,) rad/s2           demanded acceleration, xm' + Kp e + Ki int e, e = xm - x
    xdot0   (3,) rad/s2           difference of the measured rates over the frame, over dt
    G       (3, 3) rad/s2 per rad their effectiveness

The positions are those of the model of the declared actuators, not the commands. G u0 of the elapsed frame is
the sum of the columns of these surfaces in measured.contribution, so that

    G u = nu - xdot0 + G u0

xdot0 and G u0 pass the same filter, twice in series [Smeur2016, sec. III]:

    y <- keep y + (1 - keep) input,    keep = exp(-filter_per_s dt)

The kernels are in control/laws/compiled_rivals.py.
"""

from collections.abc import Mapping
from math import exp
from typing import ClassVar

import numpy as np

from beaver_ftc.compiled import fill
from beaver_ftc.control.rivals.kernel_law import GAINS, KernelLaw


class IncrementalInversion(KernelLaw):
    """Incremental nonlinear dynamic inversion on filtered angular acceleration [Sieberling2010]."""

    name: ClassVar[str] = "indi"
    defaults: ClassVar[Mapping[str, float]] = GAINS | {"filter_per_s": 50.0}

    def compile_into(self, law: np.void) -> None:
        """Fill gains and filters; the filter of G u0 begins with what the leading surfaces give in trim."""
        option = self.option
        context = self.context
        fill(
            law["config"], incremental=1, keep=exp(-option["filter_per_s"] * context.dt_s),
            Kp=option["proportional_per_s"], Ki=option["integral_per_s2"],
        )  # fmt: skip
        effects = context.model.G(context.trim_y) * context.trim_rad
        law["memory"]["surface_filter"] = effects[:, list(context.leading)].sum(axis=1)
