"""The control stage in one frame, as studies read it. `control` is a record of `state.control_dtype`."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from beaver_ftc.diagnosis.readout import Readout, value


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


class ControlReadout(Readout):
    """Each part of the control stage, as it is in the frame in which this part is read first.

    main        number of the surface that leads roll, pitch and yaw, (3,)
    stand_in    number of the surface that stands in for the one that leads pitch, -1 for none
    trim_rad    the surfaces in trim, (surfaces,) rad
    """

    main = value(np.array, "layout", "main")
    stand_in = value(int, "layout", "stand_in")
    trim_rad = value(np.array, "layout", "trim")

    @cached_property
    def default_law(self) -> DefaultLaw:
        """Gains of the default law, and what it assumes."""
        law = self._record["rejecting"]["config"]
        names = "qdyn", "Kp_at", "L_rate_at", "L_disturbance_at", "lead"
        return DefaultLaw._make((*(law[name].copy() for name in names), float(law["share"])))
