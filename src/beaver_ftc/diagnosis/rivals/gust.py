"""The gusts that vanes show, from what every plug-in is given: air data, attitude, accelerometers.

    dw = L' v[k-1] + dt (L' f + g) - L' v[k]     change of the air's velocity, m/s, in level axes
    tau q_g' + q_g = w_g' / V,  tau r_g' + r_g = v_g' / V     rotation of the air, rad/s [MIL-F-8785C, 3.7]
    tau = tau_trim V_trim / V     time constants, s, at the measured airspeed V, m/s

v: velocity relative to the air, m/s, by airspeed and vanes; f: accelerometers, m/s2; L: from level to body
axes; w_g and v_g: velocity of the air downwards and to the right, m/s. The level axes of a frame point where
the nose did at its beginning. No vane shows the rolling gust p_g.
"""

from math import cos, sin

import numpy as np

from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2
from beaver_ftc.compiled import plain
from beaver_ftc.design.context import Context
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.gusts import fill_rotation
from beaver_ftc.diagnosis.informed_test import with_measured_gust

_SHOWN = slice(1, 3)  # q_g and r_g, of the rotation (p_g, q_g, r_g)
_AZ_AY = [5, 4]  # of the further instruments: three angles, accelerations (a_x, a_y, a_z), altitude
_TURNED_SHARE = 0.3  # of noises of airspeed and bank in the flow's angles: attitudes and incidences of 17 deg
_LEAST_AIRSPEED_MPS = 1.0  # a broken sensor may read 0, and the rotation of the air is over the airspeed
_GRAVITY = np.array([0.0, 0.0, GRAVITY_MPS2])


class VaneGust:
    """The effect of the measured gust, frame by frame. context: that of a detector that subtracts it."""

    def __init__(self, context: Context) -> None:
        declared = context.declared
        self._dt = context.dt_s
        self._effect, self._lag_s = declared.gust_effect, declared.gust_time_s
        self._airspeed = float(context.trim_y[AIRSPEED])
        self._rotation = np.zeros(3)  # of the air: (0, q_g, r_g) rad/s, in level axes
        self._expected: np.ndarray | None = None  # velocity now in still air, in the level axes of _heading
        self._heading = 0.0
        self._is_measured = declared.air and self._airspeed > 0.0
        self.context = context
        if self._is_measured:
            self.context = with_measured_gust(context, self._noise(context))

    def _noise(self, context: Context) -> np.ndarray:
        """Standard deviation (3,) rad/s2 of the effect, by the noise of a sample of each instrument.

        Standard deviations, rad/s, of the change of q_g in a frame, by those of alpha, theta, V, phi and a_z:

            (hypot(alpha, theta) + 0.3 (V_noise / V + phi) + dt a_z / V) / tau_q

        Those of beta, psi and a_y take the place of alpha, theta and a_z in that of r_g.
        """
        declared, V = context.declared, self._airspeed
        air = np.hypot(declared.noise[3:], declared.resolution[3:] / np.sqrt(12.0))
        further = np.hypot(declared.further_noise, declared.further_resolution / np.sqrt(12.0))
        phi, theta_psi, az_ay = further[0], further[1:3], further[_AZ_AY]
        angles = np.hypot(air[:2], theta_psi) + _TURNED_SHARE * (air[2] / V + phi) + az_ay * self._dt / V
        rotation = angles / self._lag_s[_SHOWN]
        of_level_axes = self._effect @ _level_axes(0.0, float(context.trim_y[0])).T  # straight and level
        return np.hypot(*(of_level_axes[:, _SHOWN] * rotation).T)

    def subtracted(self, measured: Measured) -> Measured:
        """The measurements, with the effect of the gust in the acceleration of the elapsed frame, from which
        the rotation of the air moves on:

            acceleration + V / V_trim B (0, q_g, r_g)
            (q_g, r_g) <- exp(-dt / tau) (q_g, r_g) + (dw_z, dw_y) / (V tau)

        B: gust_effect; dw, m/s: the air's, downwards and to the right of the heading as the frame began; tau
        s.
        """
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
        # The rotation at the beginning of the frame, in body axes; those of its end serve, to first order.
        acting = self._rotation @ to_level
        velocity[1] = sin(turn) * velocity[0] + cos(turn) * velocity[1]  # to the right of the old heading
        dw = (expected - velocity)[[2, 1]]  # downwards, which pitches the air; to the right, which yaws it
        tau = self._lag_s[_SHOWN] * self._airspeed / V
        self._rotation[_SHOWN] = np.exp(-self._dt / tau) * self._rotation[_SHOWN] + dw / (V * tau)
        air = (V / self._airspeed) * (self._effect @ acting)
        return measured._replace(acceleration=measured.acceleration + air)


def _level_axes(phi: float, theta: float) -> np.ndarray:
    """L' (3, 3): a vector in body axes, times this, is one in level axes: ahead, right, down."""
    L = np.empty((3, 3))
    plain(fill_rotation)(phi, theta, L)
    return L.T
