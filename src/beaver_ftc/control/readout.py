"""The law at one frame, as studies read it. `control` is a record of `state.control_dtype`."""

from functools import cached_property
from typing import NamedTuple

import numpy as np


class Schedule(NamedTuple):
    """Gains of the default law over dynamic pressure. qdyn_pa (points,), ascending; Kp 1/s, L_rate 1 and
    L_disturbance 1/s (loops, points): feedback and observer."""

    qdyn_pa: np.ndarray
    Kp: np.ndarray
    L_rate: np.ndarray
    L_disturbance: np.ndarray


class ControlReadout:
    """The law at the frame in which it is read first."""

    def __init__(self, control: np.void) -> None:
        self._control = control

    @cached_property
    def main(self) -> np.ndarray:
        """Number of the surface that leads roll, pitch and yaw, (3,)."""
        return np.array(self._control["layout"]["main"])

    @cached_property
    def stand_in(self) -> int:
        """Number of the surface that stands in for the one that leads pitch, -1 for none."""
        return int(self._control["layout"]["stand_in"])

    @cached_property
    def trim_rad(self) -> np.ndarray:
        """The surfaces in trim, (surfaces,) rad."""
        return np.array(self._control["layout"]["trim"])

    @cached_property
    def schedule(self) -> Schedule:
        """Gains of the default law."""
        law = self._control["rejecting"]["config"]
        return Schedule(*(law[name].copy() for name in ("qdyn", "Kp_at", "L_rate_at", "L_disturbance_at")))

    @cached_property
    def lead(self) -> np.ndarray:
        """Of the default law: command beyond the actuator's position over what is wanted beyond it,
        (surfaces,)."""
        return np.array(self._control["rejecting"]["config"]["lead"])

    @cached_property
    def share(self) -> float:
        """Of the default law: share of a frame until a command acts."""
        return float(self._control["rejecting"]["config"]["share"])
