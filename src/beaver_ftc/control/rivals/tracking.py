"""What the rival laws share: a proportional-integral demand, and surfaces from it.

    nu = xm' + Kp e + Ki int e,   e = xm - x

Kp and Ki are options of each law, tuned for it as its other options are. Only the surfaces that lead roll,
pitch and yaw move; the others stay in trim.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.rivals import rival_options

GAINS = {"proportional_per_s": 2.0, "integral_per_s2": 1.0}


class RivalLaw:
    """A law that moves the surfaces that lead roll, pitch and yaw."""

    name: ClassVar[str]
    defaults: ClassVar[Mapping[str, float]]
    fault_tolerant = False

    def begin(self, context: Context) -> None:
        """Before a flight: nothing missed yet."""
        self.context, self.option = context, rival_options(self.name, self.defaults, context)
        self.integral, self.saturated = np.zeros(3), False
        self._before: np.ndarray | None = None

    def moved(self, measured: Measured) -> np.ndarray | None:
        """Change (3,) rad/s of the measured rates since the frame before; None in the first frame."""
        before, self._before = self._before, measured.x
        return None if before is None else measured.x - before

    def missed(self, measured: Measured, reference: Reference) -> np.ndarray:
        """Error of the rates (3,) rad/s; its integral stands still while a surface is at its stop."""
        error: np.ndarray = reference.rate - measured.x
        if not self.saturated:
            self.integral = self.integral + self.context.dt_s * error
        return error

    def demand(self, measured: Measured, reference: Reference) -> np.ndarray:
        """nu (3,) rad/s2."""
        error, option = self.missed(measured, reference), self.option
        following: np.ndarray = reference.acceleration + option["proportional_per_s"] * error
        return following + option["integral_per_s2"] * self.integral

    def command(self, three: np.ndarray) -> np.ndarray:
        """(surfaces,) rad, within the travel: the leaders as near to (3,) rad as it lets them."""
        wanted = with_others(three, self.context)
        command: np.ndarray = np.clip(wanted, *self.context.travel_rad)
        self.saturated = bool((command != wanted).any())
        return command


def with_others(three: np.ndarray, context: Context) -> np.ndarray:
    """The leaders of roll, pitch and yaw at (3,) rad, all others in trim: (surfaces,) rad."""
    deflections = context.trim_rad.copy()
    deflections[list(context.leading)] = three
    return deflections
