"""Extended Kalman filter with the surfaces' effectiveness as states, and a chi-square test on them."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.diagnosis.base import Measured
from beaver_ftc.diagnosis.rivals.effectiveness import DEFAULTS, EffectivenessFilter, N

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
        self.z[:3] += dt * (measured.acceleration + measured.contribution[:, self.leading] @ self.z[3:N])
        if self.air.n:
            self.z[:3] += self.air.effect @ self.z[N:]
            self.z[N:] *= self.air.keep
        self.P = F @ self.P @ F.T
        self.P[np.diag_indices(self.n)] += self.process_noise(measured)

    def jacobian(self, measured: Measured) -> np.ndarray:
        """F (n, n): [[1 + dt df/dx, dt G_s u_s], [0, 1]], and with the air [.., dt B] and its decay."""
        f, y, dt = self.context.model.f, measured.y, self.context.dt_s
        F = np.eye(self.n)
        step = _STEP * np.eye(3)
        there = f(np.concatenate((measured.x + step, measured.x - step)), y)
        F[:3, :3] += dt * (there[:3] - there[3:]).T / (2.0 * _STEP)
        F[:3, 3:N] = dt * measured.contribution[:, self.leading]
        F[:3, N:] = self.air.effect
        F[range(N, self.n), range(N, self.n)] = self.air.keep
        return F

    def statistic(self, square: float) -> float:
        """The largest theta^2 / variance over the alarm level."""
        return float(self.significance().max() / self.option["alarm"])
