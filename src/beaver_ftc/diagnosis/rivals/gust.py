"""The gusts that vanes measure, from signals that every plug-in receives: air data, attitude, accelerometers.

    dw = L'[k-1] v[k-1] + dt (L'[k-1] f[k-1] + g) - L'[k] v[k]     in frame k, by an Euler step
    tau q_g' + q_g = w_g' / V,  tau r_g' + r_g = v_g' / V     rotation of the air, rad/s [MIL-F-8785C, 3.7]
    tau = tau_trim V_trim / V     time constants, s, at the measured airspeed V, m/s

    dw         m/s     change of the air's velocity, in level axes
    v          m/s     velocity relative to the air, in body axes, by airspeed and vanes
    f, g       m/s2    accelerometers, in body axes; gravity, in level axes
    L          (3, 3)  rotation from level to body axes
    w_g, v_g   m/s     velocity of the air downwards and to the right
    p_g, q_g, r_g  rad/s   rotation of the air; no vane measures p_g

The level axes of a frame point ahead, to the right and down, with the heading that the nose had at the
beginning of the frame.
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

_MEASURED = slice(1, 3)  # q_g and r_g, of the rotation (p_g, q_g, r_g)
_AZ_AY = [5, 4]  # places among the further instruments: three angles, accelerations (a_x, a_y, a_z), altitude
# Share of the noises of airspeed and bank that enters the angles of the flow: the sine of an attitude, or of
# a flow angle, of 17 deg.
_TURNED_SHARE = 0.3
_LEAST_AIRSPEED_MPS = 1.0  # least divisor: a broken sensor may read 0
_GRAVITY = np.array([0.0, 0.0, GRAVITY_MPS2])


class VaneGust:
    """The effect of the measured gust, frame by frame. Its attribute `context` is for a detector that
    subtracts this effect: it declares only the rest of the turbulence."""

    def __init__(self, context: Context) -> None:
        declared = context.declared
        self._dt = context.dt_s
        self._effect = declared.gust_effect
        self._lag_s = declared.gust_time_s
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

        Standard deviation, rad/s, that the noises of a sample of alpha, theta, V, phi and a_z give q_g:

            (hypot(alpha, theta) + 0.3 (V_noise / V + phi) + dt a_z / V) / tau_q

        Those of beta, psi and a_y take the place of alpha, theta and a_z in that of r_g.
        """
        declared = context.declared
        V = self._airspeed
        air = np.hypot(declared.noise[3:], declared.resolution[3:] / np.sqrt(12.0))
        further = np.hypot(declared.further_noise, declared.further_resolution / np.sqrt(12.0))
        phi = further[0]
        theta_psi = further[1:3]
        az_ay = further[_AZ_AY]
        angles = np.hypot(air[:2], theta_psi) + _TURNED_SHARE * (air[2] / V + phi) + az_ay * self._dt / V
        rotation = angles / self._lag_s[_MEASURED]
        of_level_axes = self._effect @ _level_axes(0.0, float(context.trim_y[0])).T  # straight and level
        return np.hypot(*(of_level_axes[:, _MEASURED] * rotation).T)

    def subtracted(self, measured: Measured) -> Measured:
        """The measurements, with the effect of the gust in the acceleration of the elapsed frame, from which
        the rotation of the air moves on:

            acceleration + V / V_trim B (0, q_g, r_g)
            (q_g, r_g) <- exp(-dt / tau) (q_g, r_g) + (dw_z, dw_y) / (V tau)

        B 1/s: gust_effect; dw m/s: change of the air's velocity, downwards and to the right of the heading at
        the beginning of the frame; tau s. The first frame has no effect.
        """
        if not self._is_measured:
            return measured
        phi, theta, psi = measured.attitude.tolist()
        alpha, beta, V = measured.y[:3].tolist()
        V = max(V, _LEAST_AIRSPEED_MPS)
        to_level = _level_axes(phi, theta)
        flow = np.array([cos(alpha) * cos(beta), sin(beta), sin(alpha) * cos(beta)])
        velocity = V * (to_level @ flow)
        force = to_level @ measured.force
        expected = self._expected
        turn = psi - self._heading
        self._expected = velocity + self._dt * (force + _GRAVITY)
        self._heading = psi
        if expected is None:
            return measured
        # The rotation at the beginning of the frame, in the body axes of its end: the same to first order.
        acting = self._rotation @ to_level
        velocity[1] = sin(turn) * velocity[0] + cos(turn) * velocity[1]  # to the right of the old heading
        dw = (expected - velocity)[[2, 1]]  # downwards, which pitches the air; to the right, which yaws it
        tau = self._lag_s[_MEASURED] * self._airspeed / V
        self._rotation[_MEASURED] = np.exp(-self._dt / tau) * self._rotation[_MEASURED] + dw / (V * tau)
        air = (V / self._airspeed) * (self._effect @ acting)
        return measured._replace(acceleration=measured.acceleration + air)


def _level_axes(phi: float, theta: float) -> np.ndarray:
    """L' (3, 3): L' times a vector in body axes is the same in level axes: ahead, right, down."""
    L = np.empty((3, 3))
    plain(fill_rotation)(phi, theta, L)
    return L.T
