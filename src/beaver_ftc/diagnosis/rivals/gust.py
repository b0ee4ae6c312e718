"""The gusts that vanes show, from what every plug-in is given: air data, attitude, accelerometers.

    dw = L' v[k-1] + dt (L' f + g) - L' v[k]     change of the air's velocity, m/s, in level axes
    tau q_g' + q_g = w_g' / V,  tau r_g' + r_g = v_g' / V     rotation of the air, rad/s [MIL-F-8785C, 3.7]

v: velocity relative to the air, m/s, by airspeed and vanes; f: accelerometers, m/s2; L: from level to body
axes. The level axes of a frame point where the nose did at its beginning. No vane shows the rolling gust.
"""

from math import cos, exp, sin

import numpy as np

from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.informed_test import with_measured_gust

PITCHING, YAWING = 1, 2
_TURNED_SHARE = 0.3  # of noises of airspeed and bank in the flow's angles: attitudes and incidences of 17 deg


class VaneGust:
    """The effect of the measured gust, frame by frame. context: that of a detector that subtracts it."""

    def __init__(self, context: Context) -> None:
        declared = context.declared
        self._dt = context.dt_s
        self._effect, self._lag_s = declared.gust_effect, declared.gust_time_s
        self._airspeed = float(context.trim_y[2])
        self._air_rotation = np.zeros(3)  # rad/s in level axes
        self._before: tuple[np.ndarray, np.ndarray, float] | None = None  # velocity, force, heading
        self._is_measured = declared.air and self._airspeed > 0.0
        self.context = context
        if self._is_measured:
            self.context = with_measured_gust(context, self._noise(context))

    def _noise(self, context: Context) -> np.ndarray:
        """Standard deviation (3,) rad/s2 of the effect, by the noise of a sample of each instrument."""
        declared, V = context.declared, self._airspeed
        air = np.hypot(declared.noise[3:], declared.resolution[3:] / np.sqrt(12.0))
        further = np.hypot(declared.further_noise, declared.further_resolution / np.sqrt(12.0))
        turned = _TURNED_SHARE * (air[2] / V + further[0])
        angles = np.hypot(air[:2], further[1:3]) + turned + further[[5, 4]] * self._dt / V
        rotation = angles / self._lag_s[PITCHING:]
        of_level_axes = self._effect @ _level_axes(0.0, float(context.trim_y[0])).T  # straight and level
        return np.hypot(*(of_level_axes[:, PITCHING:] * rotation).T)

    def subtracted(self, measured: Measured) -> Measured:
        """The measurements, with the effect of the gust in the acceleration of the elapsed frame."""
        if not self._is_measured:
            return measured
        phi, theta, psi = measured.attitude.tolist()
        alpha, beta, V = measured.y[:3].tolist()
        to_level = _level_axes(phi, theta)
        flow = np.array([cos(alpha) * cos(beta), sin(beta), sin(alpha) * cos(beta)])
        velocity, force = V * (to_level @ flow), to_level @ measured.force
        before, self._before = self._before, (velocity, force, psi)
        if before is None:
            return measured
        acting = self._air_rotation @ to_level  # in body axes: that at the beginning of the frame
        self._air_rotation = self._after(before, velocity, psi, V)
        air = (V / self._airspeed) * (self._effect @ acting)
        return measured._replace(acceleration=measured.acceleration + air)

    def _after(self, before: tuple[np.ndarray, np.ndarray, float], velocity: np.ndarray, psi: float, V: float
    ) -> np.ndarray:  # fmt: skip
        """The rotation (3,) rad/s of the air at the end of a frame; velocity m/s in its own level axes."""
        (_, right, down), (_, force_right, force_down), psi_before = before
        dt, turn = self._dt, psi - psi_before
        now_right = sin(turn) * velocity[0] + cos(turn) * velocity[1]
        change_right = right + dt * force_right - now_right
        change_down = down + dt * (force_down + GRAVITY_MPS2) - velocity[2]
        after = np.zeros(3)
        for axis, change in ((PITCHING, change_down), (YAWING, change_right)):
            lag_s = self._lag_s[axis] * self._airspeed / V
            after[axis] = exp(-dt / lag_s) * self._air_rotation[axis] + change / (V * lag_s)
        return after


def _level_axes(phi: float, theta: float) -> np.ndarray:
    """L' (3, 3): a vector in body axes, times this, is one in level axes: ahead, right, down."""
    sf, cf, st, ct = sin(phi), cos(phi), sin(theta), cos(theta)
    return np.array([[ct, sf * st, cf * st], [0.0, cf, -sf], [-st, sf * ct, cf * ct]])
