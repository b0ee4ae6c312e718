"""The gusts that vanes show, from what every plug-in is given: air data, attitude, accelerometers.

    dw = L' v[k-1] + dt (L' f + g) - L' v[k]     change of the air's velocity, m/s, in level axes
    tau q_g' + q_g = w_g' / V,  tau r_g' + r_g = v_g' / V     rotation of the air, rad/s [MIL-F-8785C, 3.7]

v: velocity relative to the air, m/s, by airspeed and vanes; f: accelerometers, m/s2; L: from level to body
axes. The level axes of a frame point where the nose did at its beginning. No vane shows the rolling gust.
"""

from math import cos, sin

import numpy as np

from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2
from beaver_ftc.compiled import plain
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.gusts import fill_rotation
from beaver_ftc.diagnosis.informed_test import with_measured_gust

PITCHING, YAWING = 1, 2
_TURNED_SHARE = 0.3  # of noises of airspeed and bank in the flow's angles: attitudes and incidences of 17 deg
_LEAST_AIRSPEED_MPS = 1.0  # a broken sensor may read 0, and the rotation of the air is over the airspeed
_GRAVITY = np.array([0.0, 0.0, GRAVITY_MPS2])


class VaneGust:
    """The effect of the measured gust, frame by frame. context: that of a detector that subtracts it."""

    def __init__(self, context: Context) -> None:
        declared = context.declared
        self._dt = context.dt_s
        self._effect, self._lag_s = declared.gust_effect, declared.gust_time_s
        self._airspeed = float(context.trim_y[2])
        self._air_rotation = np.zeros(3)  # rad/s in level axes
        self._expected: np.ndarray | None = None  # velocity now in still air, in the level axes of _heading
        self._heading = 0.0
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
        V = max(V, _LEAST_AIRSPEED_MPS)
        to_level = _level_axes(phi, theta)
        flow = np.array([cos(alpha) * cos(beta), sin(beta), sin(alpha) * cos(beta)])
        velocity, force = V * (to_level @ flow), to_level @ measured.force
        expected, turn = self._expected, psi - self._heading
        self._expected, self._heading = velocity + self._dt * (force + _GRAVITY), psi
        if expected is None:
            return measured
        acting = self._air_rotation @ to_level  # in body axes: that at the beginning of the frame
        velocity[1] = sin(turn) * velocity[0] + cos(turn) * velocity[1]
        lag_s = self._lag_s * self._airspeed / V
        change = (expected - velocity)[[0, 2, 1]]  # that downwards pitches the air, that to the right yaws it
        self._air_rotation = np.exp(-self._dt / lag_s) * self._air_rotation + change / (V * lag_s)
        self._air_rotation[0] = 0.0
        air = (V / self._airspeed) * (self._effect @ acting)
        return measured._replace(acceleration=measured.acceleration + air)


def _level_axes(phi: float, theta: float) -> np.ndarray:
    """L' (3, 3): a vector in body axes, times this, is one in level axes: ahead, right, down."""
    L = np.empty((3, 3))
    plain(fill_rotation)(phi, theta, L)
    return L.T
