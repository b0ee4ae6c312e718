"""Turbulence by Dryden's spectra: its speed [MIL-F-8785C, 3.7] and its rotation [Yeager1998].

The vertical gust has the standard deviation sigma_w, m/s, and the scale L, m; the lateral gust is similar.
Both are functions of the height:

    above 2000 ft            constant
    below 1000 ft            sigma_w is a tenth of the wind at 20 ft, and L is the height
    between these heights    both change from the one to the other; all quantities derived from them are below
                             those above 2000 ft

A gust is, over times that are short compared with its correlation time, a *random walk*. Its *intensity* is
the variance that it gains in a second.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Literal

import numpy as np

from beaver_ftc.aircraft.aircraft import M_PER_FT

Severity = Literal["none", "light", "moderate", "severe"]
SEVERITIES: tuple[Severity, ...] = ("none", "light", "moderate", "severe")

# Largest vertical gust (standard deviation, ft/s) above 2000 ft, and its scale [MIL-F-8785C, fig. 7, 3.7.2].
GUST_FT_S = {"none": 0.0, "light": 7.4, "moderate": 10.6, "severe": 23.6}
SCALE_FT = 1750.0
SCALE_M = M_PER_FT * SCALE_FT
# Below 1000 ft: the wind at 20 ft (15, 30 and 45 kt), and the standard deviation of the vertical gust, a
# tenth of it; ft/s [MIL-F-8785C, 3.7.3].
WIND_AT_20_FT = {"light": 25.3, "moderate": 50.6, "severe": 76.0}
LOW_GUST_FT_S = {"none": 0.0, "light": 2.53, "moderate": 5.06, "severe": 7.6}
EXCEEDENCE = {"light": 3, "moderate": 4, "severe": 6}  # JSBSim's number of the curve in fig. 7
LEAST_HEIGHT_M = 3.048  # 10 ft: below this height turbulence is as at this height
# The rolling gust is the strongest rotation of the air: sigma_p = ROLLING sigma_w / sqrt(L b), with the time
# constant sqrt(L b) / (ROLLING_LAG V), for a span b, m, and an airspeed V, m/s [Yeager1998, eq. 8].
ROLLING, ROLLING_LAG = 1.9, 2.6


@dataclass(frozen=True)
class Dryden:
    """Turbulence of one severity; `none` is still air. Spans and lengths in m, speeds in m/s. A quantity is
    that above 2000 ft, unless its docstring names another height."""

    severity: Severity = "none"

    @property
    def moves(self) -> bool:
        """Whether there is any turbulence."""
        return self.severity != "none"

    @property
    def rank(self) -> int:
        """0 for still air, then one more for each severity."""
        return SEVERITIES.index(self.severity)

    @property
    def sigma_mps(self) -> float:
        """Standard deviation of the vertical gusts above 2000 ft; their scale is SCALE_M."""
        return M_PER_FT * GUST_FT_S[self.severity]

    @property
    def low_sigma_mps(self) -> float:
        """The same below 1000 ft, where their scale is the height."""
        return M_PER_FT * LOW_GUST_FT_S[self.severity]

    def rotation_limit_rad_s(self, span_m: float) -> float:
        """Largest standard deviation of the air's rotation about an axis, that of the rolling gust, rad/s."""
        span_ft = span_m / M_PER_FT
        return ROLLING * GUST_FT_S[self.severity] / sqrt(SCALE_FT * span_ft)

    def low_rotation_limit_rad_s(self, span_m: float) -> float:
        """The same below 1000 ft times the root of the height in m, rad/s m^0.5."""
        return ROLLING * self.low_sigma_mps / sqrt(span_m)

    def rotation(self, airspeed_mps: float, span_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviation (3,) rad/s and correlation time tau (3,) s of the air's rotation [Yeager1998].

        Rolling: a first-order process of its own (eq. 8 to 10). Pitching and yawing: the slope of the
        vertical and the lateral gusts along the flight path, with the transfer function (s / V) / (1 + tau
        s). Through Dryden's spectrum their variance is

            sigma^2 / (2 L^2) (3 / (k (1 + k)) - 1 / (1 + k)^2),    k = tau V / L
        """
        sigma, L, length = self.sigma_mps, SCALE_M, rotation_lengths(span_m)
        k = length / L
        rotation = sigma / L * np.sqrt(1.5 / (k * (1.0 + k)) - 0.5 / (1.0 + k) ** 2)
        rotation[0] = ROLLING * sigma / sqrt(L * span_m)
        return rotation, length / airspeed_mps

    def rotation_walk(self, span_m: float) -> np.ndarray:
        """Intensity of the random walk of the rolling, pitching and yawing gust, over the airspeed V; (3,)
        rad2/s3 per m/s (`_rotation_walk`)."""
        return _rotation_walk(self.sigma_mps, SCALE_M, span_m)

    def rotation_walk_at_1_m(self, span_m: float) -> np.ndarray:
        """The same by the formulas below 1000 ft, at a height h of 1 m. At another height, the rolling one is
        divided by h^1.5, and the pitching and the yawing one by h. The yawing one is a bound: the lateral
        gust has sigma_v^2 / L_v = sigma_w^2 / h (0.177 + 0.000823 h / ft)^0.4, which is less.
        """
        return _rotation_walk(self.low_sigma_mps, 1.0, span_m)

    def velocity_walk(self, airspeed_mps: float, faster: float) -> float:
        """Intensity, m2/s3, of the random walk of a vertical or lateral gust: 3 sigma_w^2 V / L
        [MIL-F-8785C, 3.7.1]; V = faster airspeed_mps, m/s."""
        return 3.0 * self.sigma_mps**2 * faster * airspeed_mps / SCALE_M

    def angle_walk(self, airspeed_mps: float) -> float:
        """Intensity, rad2/s, of the random walk of the angle of the flow: 3 sigma_w^2 / (L V)."""
        return 3.0 * self.sigma_mps**2 / (SCALE_M * airspeed_mps)

    @property
    def low_m(self) -> float:
        """Height, m, below which gusts change faster than above 2000 ft, as their intensity sigma^2 / h is
        larger there [MIL-F-8785C, 3.7.3]; 0 in still air."""
        return SCALE_M * (self.low_sigma_mps / self.sigma_mps) ** 2 if self.moves else 0.0


def rotation_lengths(span_m: float) -> np.ndarray:
    """Correlation length tau V (3,) m of the rolling, pitching and yawing gust [Yeager1998]."""
    return np.array([sqrt(SCALE_M * span_m) / ROLLING_LAG, 4.0 * span_m / pi, 3.0 * span_m / pi])


def _rotation_walk(sigma_w: float, L: float, b: float) -> np.ndarray:
    """Intensity of the random walk of each rotating gust, over the airspeed V: (3,) rad2/s3 per m/s.

        rolling     2 sigma_p^2 / tau: a first-order process [Yeager1998, eq. 8]
        others      3 sigma_w^2 V / L / (V tau)^2: lagged slopes of the velocity of a gust [MIL-F-8785C, 3.7]

    sigma_w m/s; L m: scale; b m: span; V tau: `rotation_lengths`.
    """
    rolling = 2.0 * ROLLING**2 * ROLLING_LAG * sigma_w**2 / (L * b) ** 1.5
    velocity = 3.0 * sigma_w**2 / L
    return np.array([rolling, velocity * (pi / (4 * b)) ** 2, velocity * (pi / (3 * b)) ** 2])
