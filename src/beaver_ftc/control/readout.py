"""The control stage in one frame, as studies read it. `control` is a record of `state.control_dtype`."""

from functools import cached_property
from typing import NamedTuple

import numpy as np


class DefaultLaw(NamedTuple):
    """The default law's gains, over dynamic pressure, and what it assumes of actuators and frames.

    - `qdyn_pa` (points,): dynamic pressure, Pa, ascending.
    - `Kp` 1/s, `L_rate` 1, `L_disturbance` 1/s (loops, points): gains of feedback and observer.
    - `lead` (surfaces,): command beyond the actuator's position over what is wanted beyond it.
    - `share`: part of a frame until a command acts.
    """

    qdyn_pa: np.ndarray
    Kp: np.ndarray
    L_rate: np.ndarray
    L_disturbance: np.ndarray
    lead: np.ndarray
    share: float


class ControlReadout:
    """Each part of the control stage, as it is in the frame in which this part is read first."""

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
    def default_law(self) -> DefaultLaw:
        """Gains of the default law, and what it assumes."""
        law = self._control["rejecting"]["config"]
        names = "qdyn", "Kp_at", "L_rate_at", "L_disturbance_at", "lead"
        return DefaultLaw._make((*(law[name].copy() for name in names), float(law["share"])))
