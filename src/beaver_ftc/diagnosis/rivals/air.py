"""Turbulence as a filter knows it: the rotation of the air as three more states.

    g[k+1] = a g[k] + sqrt(1 - a^2) sigma w[k],   a = exp(-dt / tau),      xdot = f + G u + B g

a first-order process for each axis, as declared (design/context.py). Without a declaration there are none.
"""

import numpy as np

from beaver_ftc.design.context import Context, Declared


class Air:
    """n: states, 3 or none. keep (n,): their decay over a frame. noise (n,): their process noise, variance.

    effect (3, n): what they add to the rates over a frame. variance (n,): what is known of them at the start.
    """

    def __init__(self, context: Context) -> None:
        declared, dt = context.declared, context.dt_s
        self.n = 3 if declared.air else 0
        self.keep = np.exp(-dt / declared.gust_time_s[: self.n])
        self.variance = declared.gust_rad_s[: self.n] ** 2
        self.noise = (1.0 - self.keep**2) * self.variance
        self.effect = dt * declared.gust_effect[:, : self.n]


def rate_variance(declared: Declared, least_rad_s: float) -> np.ndarray:
    """Variance (3,) of a measured rate; least_rad_s: what a filter takes for perfect."""
    return least_rad_s**2 + declared.gyro_rad_s**2


def unexplained(context: Context, eta_bar: np.ndarray) -> np.ndarray:
    """What is taken for the size (3,) rad/s2 of the acceleration that nothing explains.

    The declared bound, eta_bar, as long as it is the published one; with more declared that bound is the sum
    of all worst cases, instruments and air included, which have states or a variance of their own here.
    """
    declared = context.declared
    return np.hypot(context.constant_rad_s2, declared.model_rad_s2) if declared.errors else eta_bar
