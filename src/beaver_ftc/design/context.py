"""What a detector or a law receives before a flight: the frame, the design model, the trim, the bounds."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import load

if TYPE_CHECKING:
    from beaver_ftc.design.model import DesignFunctions


_ZEROS = {shape: partial(np.zeros, shape) for shape in (0, 3, 4, 7, (3, 3))}


@dataclass(frozen=True)
class DeclaredErrors:
    """The errors that `fdi.bounds` declares in addition to the published bounds, and the data of the
    actuators.

    A plug-in receives this record as `Context.declared`. An error that is not declared is zero. Defaults are
    for four surfaces.

    - `noise`, `bias`, `resolution`, `slope` (7,): errors of the instruments for p, q, r (rad/s), angle of
      attack, sideslip (rad), airspeed (m/s) and dynamic pressure (Pa). `noise` is the standard deviation of a
      sample. `slope` is the relative error of the scale factor, without unit.
    - `further_noise`, `further_bias`, `further_resolution`, `further_slope` (7,): the same of the instruments
      for the attitude (rad, three angles), the accelerations (m/s², three axes) and the altitude (m).
    - `gust_rad_s`, `gust_time_s` (3,): standard deviation, rad/s, and correlation time, s, of the rotation of
      the air about each axis.
    - `gust_effect` (3, 3) 1/s: angular acceleration for each rad/s of this rotation.
    - `coefficients`: absolute tolerance of each moment coefficient, in the order of `Aircraft.moments`.
    - `inertia`: relative tolerance of the moments of inertia: 0.05 is 5 %.
    - `deflection_rad`: largest difference between a surface and its actuator, rad.
    - `model_rad_s2` (3,): standard deviation of the model error in trim, rad/s², from the errors of angle of
      attack, sideslip, airspeed and dynamic pressure, of coefficients and of deflections.
    - `bandwidth_rad_s`, `rate_limit_rad_s` (surfaces,): bandwidth, rad/s, and rate limit, rad/s, of the
      actuators; 0 if the actuator is ideal.
    - `bandwidth_error`, `rate_limit_error` (surfaces,): their relative tolerances.
    - `dead_band_rad` (surfaces,): largest distance from the commanded position at which an actuator does not
      move, rad.
    """

    noise: np.ndarray = field(default_factory=_ZEROS[7])
    bias: np.ndarray = field(default_factory=_ZEROS[7])
    resolution: np.ndarray = field(default_factory=_ZEROS[7])
    slope: np.ndarray = field(default_factory=_ZEROS[7])
    further_noise: np.ndarray = field(default_factory=_ZEROS[7])
    further_bias: np.ndarray = field(default_factory=_ZEROS[7])
    further_resolution: np.ndarray = field(default_factory=_ZEROS[7])
    further_slope: np.ndarray = field(default_factory=_ZEROS[7])
    gust_rad_s: np.ndarray = field(default_factory=_ZEROS[3])
    gust_time_s: np.ndarray = field(default_factory=_ZEROS[3])
    gust_effect: np.ndarray = field(default_factory=_ZEROS[3, 3])
    coefficients: np.ndarray = field(default_factory=_ZEROS[0])
    inertia: float = 0.0
    deflection_rad: float = 0.0
    model_rad_s2: np.ndarray = field(default_factory=_ZEROS[3])
    bandwidth_rad_s: np.ndarray = field(default_factory=_ZEROS[4])
    rate_limit_rad_s: np.ndarray = field(default_factory=_ZEROS[4])
    bandwidth_error: np.ndarray = field(default_factory=_ZEROS[4])
    rate_limit_error: np.ndarray = field(default_factory=_ZEROS[4])
    dead_band_rad: np.ndarray = field(default_factory=_ZEROS[4])

    @cached_property
    def errors(self) -> bool:
        """Whether an error that changes the rates' residual is declared: of the first seven instruments,
        turbulence, coefficients, inertia or actuators."""
        servos = self.bandwidth_error, self.rate_limit_error, self.dead_band_rad
        others = self.coefficients, *servos, self.deflection_rad, self.inertia
        return self.noisy or any(np.any(error) for error in others)

    @property
    def noisy(self) -> bool:
        """Whether errors of instruments or turbulence are declared."""
        errors = self.noise, self.bias, self.resolution, self.slope, self.gust_rad_s
        return any(np.any(error) for error in errors)

    @property
    def air(self) -> bool:
        """Whether turbulence is declared."""
        return bool(np.any(self.gust_rad_s))

    @property
    def gyro_rad_s(self) -> np.ndarray:
        """Standard deviation (3,) of a sample of each gyro, from noise and rounding, rad/s."""
        return np.hypot(self.noise[:3], self.resolution[:3] / np.sqrt(12.0))

    def rate_variance(self, least_rad_s: float) -> np.ndarray:
        """Variance (3,) of the measured rates, rad²/s².

        - `least_rad_s`: standard deviation that a filter assumes for a perfect gyro, rad/s.
        """
        return least_rad_s**2 + self.gyro_rad_s**2

    @property
    def turbulence_rad_s2(self) -> np.ndarray:
        """Standard deviation of the angular acceleration that turbulence causes, per axis, (3,)."""
        return np.sqrt((self.gust_effect**2) @ self.gust_rad_s**2)

    @property
    def turbulence_time_s(self) -> np.ndarray:
        """Its correlation time, (3,): the mean of those of the gusts that cause it, by their variance."""
        share = self.gust_effect**2 * self.gust_rad_s**2
        # where no gust acts on an axis, 0 s
        return share @ self.gust_time_s / np.maximum(share.sum(axis=1), 1e-300)


def __getattr__(name: str) -> type[DeclaredErrors]:
    """The former name of DeclaredErrors."""
    if name != "Declared":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("Declared is now DeclaredErrors, and will be removed", DeprecationWarning, stacklevel=2)
    return DeclaredErrors


@dataclass(frozen=True)
class Context:
    """The data that a plug-in receives before the flight. The arrays are copies.

    - `dt_s`: length of a frame, s.
    - `substeps`: number of JSBSim steps in a frame.
    - `model`: the design model. `model.f(x, y)` (3,) rad/s² is the angular acceleration at neutral surfaces,
      for rates x (3,) rad/s and signals y as in `Measured.y`. `model.G(y)` (3, surfaces) rad/s² for each rad
      is the effect of each surface.
    - `trim_x` (3,) rad/s, `trim_y` (4 + signals,): rates and signals in the trim that the designer knows.
      `trim_y` has the order and units of `Measured.y`.
    - `trim_rad` (surfaces,) rad: deflections in force at the start, which hold the true aircraft.
    - `travel_rad` (2, surfaces) rad: lower and upper limit of each surface.
    - `constant_rad_s2` (3,) rad/s²: declared bound on the constant error of the angular acceleration.
      `inertia_coupling` (3,): declared bound on the relative error of the inertia coupling.
    - `options`: the mapping `fdi.options` for a detector, `control.options` for a law.
    - `surfaces`: names of the surfaces.
    - `leading`: indices of the main surfaces of roll, pitch and yaw. `leaders` contains their names.
    - `declared`: the other errors that `fdi.bounds` declares, and the data of the actuators.
    """

    dt_s: float
    substeps: int
    model: "DesignFunctions"
    trim_x: np.ndarray
    trim_y: np.ndarray
    trim_rad: np.ndarray
    travel_rad: np.ndarray
    constant_rad_s2: np.ndarray
    inertia_coupling: np.ndarray
    options: Mapping[str, float] = field(default_factory=dict)
    surfaces: tuple[str, ...] = field(default_factory=lambda: load().surfaces)
    leading: tuple[int, int, int] = (0, 1, 2)
    declared: DeclaredErrors = field(default_factory=DeclaredErrors)

    @property
    def seed(self) -> int:
        """A former field, always 0 now: the noise of the instruments follows from the seed of a scenario."""
        warnings.warn("Context.seed is always 0, and will be removed", DeprecationWarning, stacklevel=2)
        return 0

    @property
    def leaders(self) -> tuple[str, ...]:
        """Names of the surfaces that lead roll, pitch and yaw."""
        return tuple(self.surfaces[s] for s in self.leading)
