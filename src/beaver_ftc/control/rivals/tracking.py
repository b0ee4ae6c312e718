"""What the rival laws share: a proportional-integral demand, and surfaces from it.

    nu = xm' + Kp e + Ki int e,   e = xm - x        [the built-in laws' own, with their default gains]

so that the laws differ in what they make of the demand, not in what they demand. Only the surfaces that lead
roll, pitch and yaw move; the others stay in trim.
"""

import numpy as np

from beaver_ftc.control.base import Reference
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured

GAINS = {"proportional_per_s": 2.0, "integral_per_s2": 1.0}
DELAY_FRAMES = 2  # from a command to the measured rates that show it, for incremental inversion

# What a rival keeps that flies compiled (compiled.py): its gains, and its memory of the flight.
RIVAL = np.dtype(
    [
        ("Kp", "f8"), ("Ki", "f8"), ("integral", "f8", (3,)), ("saturated", "i8"), ("begun", "i8"),
        # the regulator: gains on error and integral, the linear model, its inverse, the trim
        ("K", "f8", (3, 6)), ("A", "f8", (3, 3)), ("B_inverse", "f8", (3, 3)), ("trim_x", "f8", (3,)),
        # incremental inversion: the filter's pole, rates and commands of before, and both filters
        ("keep", "f8"), ("x_before", "f8", (3,)), ("given", "f8", (DELAY_FRAMES, 3)),
        ("rate_filter", "f8", (2, 3)), ("command_filter", "f8", (2, 3)),
    ],
    align=True,
)  # fmt: skip


class Demand:
    """The demanded angular acceleration, with conditional integration against wind-up."""

    def __init__(self, context: Context, option: dict[str, float]) -> None:
        self._dt = context.dt_s
        self._Kp, self._Ki = option["proportional_per_s"], option["integral_per_s2"]
        self.integral = np.zeros(3)

    def of(self, measured: Measured, reference: Reference, saturated: bool) -> np.ndarray:
        """nu (3,) rad/s2; the integral stands still while a surface is at its stop."""
        error = reference.rate - measured.x
        if not saturated:
            self.integral = self.integral + self._dt * error
        return reference.acceleration + self._Kp * error + self._Ki * self.integral


def limited(deflections: np.ndarray, context: Context) -> np.ndarray:
    """(surfaces,) rad, within the travel."""
    return np.clip(deflections, context.travel_rad[0], context.travel_rad[1])


def with_others(three: np.ndarray, context: Context) -> np.ndarray:
    """The leaders of roll, pitch and yaw at (3,) rad, all others in trim: (surfaces,) rad."""
    deflections = context.trim_rad.copy()
    deflections[list(context.leading)] = three
    return deflections
