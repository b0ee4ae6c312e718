"""Unscented Kalman filter with effectiveness as states, and a CUSUM [Page1954] on its innovations."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured
from beaver_ftc.diagnosis.rivals.effectiveness import DEFAULTS, EffectivenessFilter, N
from beaver_ftc.diagnosis.rivals.kalman import sigma_points


class AugmentedUkf(EffectivenessFilter):
    """Unscented Kalman filter of effectiveness, CUSUM on the innovation squared [Julier2004]."""

    name: ClassVar[str] = "augmented-ukf"
    defaults: ClassVar[Mapping[str, float]] = DEFAULTS | {"alarm": 20.0, "allowance": 3.0, "spread": float(N)}

    def reset(self, context: Context) -> None:
        """As the base does, with an empty sum."""
        super().reset(context)
        self.sum = 0.0

    def propagate(self, measured: Measured) -> None:
        """Move the sigma points through the dynamics; their mean and covariance are z- and P-."""
        points, weights = sigma_points(self.z, self.P, self.option["spread"] + self.air.n)
        points = self.dynamics(points, measured)
        self.z = weights @ points
        off = points - self.z
        self.P = (off.T * weights) @ off
        self.P[np.diag_indices(self.n)] += self.process_noise(measured)

    def dynamics(self, points: np.ndarray, measured: Measured) -> np.ndarray:
        """Each sigma point a frame later; f differs between points by its change from the measured state."""
        dt, f = self.context.dt_s, self.context.model.f
        moved = points.copy()
        away = f(points[:, :3], measured.y) - f(measured.x, measured.y)
        loss = np.array([measured.contribution[:, self.leading] @ point[3:N] for point in points])
        moved[:, :3] += dt * (measured.acceleration + away + loss)
        if self.air.n:
            moved[:, :3] += points[:, N:] @ self.air.effect.T
            moved[:, N:] *= self.air.keep
        return moved

    def statistic(self, square: float) -> float:
        """g = max(0, g + (square - 3 allowance)) over the alarm level; 3 is what a healthy flight expects."""
        self.sum = max(0.0, self.sum + min(square, 1e6) - 3.0 * self.option["allowance"])
        return self.sum / self.option["alarm"]
