"""What a detector or a law is told before a flight: the frame, the design model, the trim, the bounds."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from beaver_ftc.design.coefficients import SURFACES


class DesignModel:
    """The design model as two functions, xdot = f(x, y) + G(y) u (see design/model.py for the order of y)."""

    def __init__(self, record: np.ndarray) -> None:
        from beaver_ftc.design.variants import response  # compiled: nothing for those who only list plug-ins

        self._record, self._fill = record[0], response

    def f(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Angular acceleration (3,) rad/s2 at neutral surfaces; x (3,) rad/s, y (5,)."""
        return self._response(x, y)[0]

    def G(self, y: np.ndarray) -> np.ndarray:
        """Angular acceleration of each surface, (3, 4) rad/s2 per rad; y (5,)."""
        return self._response(np.zeros(3), y)[1]

    def _response(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        f, G = np.empty(3), np.zeros((3, 4))
        self._fill(self._record, x, y, f, G)
        return f, G


@dataclass(frozen=True)
class Context:
    """Everything a plug-in may know before the flight; arrays are its own.

    dt_s: length of a frame. substeps: JSBSim frames in it. model: what the designer believes.
    trim_x (3,) rad/s, trim_y (5,), trim_rad (4,): the flight condition at the start.
    travel_rad (2, 4): lower and upper stops. constant_rad_s2 (3,), inertia_coupling (3,): declared bounds of
    the uncertainty. seed: of everything random. options: `fdi.options` or `control.options` of the scenario.
    """

    dt_s: float
    substeps: int
    model: DesignModel
    trim_x: np.ndarray
    trim_y: np.ndarray
    trim_rad: np.ndarray
    travel_rad: np.ndarray
    constant_rad_s2: np.ndarray
    inertia_coupling: np.ndarray
    seed: int = 0
    options: Mapping[str, float] = field(default_factory=dict)
    surfaces: tuple[str, ...] = SURFACES
