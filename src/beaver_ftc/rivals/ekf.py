"""Extended Kalman filter with the surfaces' effectiveness as states, and a chi-square test on them."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.diagnosis.base import Measured
from beaver_ftc.rivals.effectiveness import DEFAULTS, EffectivenessFilter, N

_STEP = 1e-6  # rad/s, for df/dx: f is quadratic in x, so a central difference is exact to rounding


class AugmentedEkf(EffectivenessFilter):
    """Extended Kalman filter of effectiveness, chi-square test on the estimates [Jazwinski1970]."""

    name: ClassVar[str] = "augmented-ekf"
    defaults: ClassVar[Mapping[str, float]] = DEFAULTS | {
        "alarm": 20.0
    }  # chi-square value of the largest theta^2 / variance

    def propagate(self, measured: Measured) -> None:
        """z- = g(z), P- = F P F' + Q with the Jacobian F at the estimate."""
        F = self.jacobian(measured)
        dt = self.context.dt_s
        self.z[:3] += dt * (measured.acceleration + measured.contribution[:, :3] @ self.z[3:])
        self.P = F @ self.P @ F.T
        self.P[np.diag_indices(N)] += self.process_noise(measured)

    def jacobian(self, measured: Measured) -> np.ndarray:
        """F (N, N): [[1 + dt df/dx, dt G_s u_s], [0, 1]]."""
        f, y, dt = self.context.model.f, measured.y, self.context.dt_s
        F = np.eye(N)
        for j in range(3):
            step = np.zeros(3)
            step[j] = _STEP
            F[:3, j] += dt * (f(measured.x + step, y) - f(measured.x - step, y)) / (2.0 * _STEP)
        F[:3, 3:] = dt * measured.contribution[:, :3]
        return F

    def statistic(self, square: float) -> float:
        """The largest theta^2 / variance over the alarm level."""
        return float(self.significance().max() / self.option["alarm"])
