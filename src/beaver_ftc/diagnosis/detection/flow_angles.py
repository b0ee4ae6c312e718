"""Flow angles without the vanes: by integrating the inertial motion, and by the forces.

The angles are beta and alpha, rad, in the order of the forces, side and normal (forces.py):

    i, f        number of the force, and its record
    e           innovation of a force, rad/s2; e_vane: e per rad of a vane's error, in trim
    q_ratio     dynamic pressure over that in trim
    y           readings (4 + signals,)
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.detection.directions import project

VANES = (BETA, ALPHA)  # place in y of the flow angle of each force


@kernel
def fill_angle_rates(forces, g, meas):
    """Fill `angle_rate` with beta' and alpha' in still air, rad/s.

        beta' = p sin(alpha) - r cos(alpha)
                + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
        alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
                 + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))

    a (3,) m/s2: reading of the accelerometers plus gravity, of size g m/s2, in body axes; p, q, r rad/s:
    rates; V m/s: airspeed.
    """
    a = meas.force
    V = meas.y[AIRSPEED]
    beta = meas.y[BETA]
    p = meas.x[0]
    q = meas.x[1]
    r = meas.x[2]
    phi = meas.attitude[0]
    th = meas.attitude[1]
    c = np.cos(meas.y[ALPHA])
    s = np.sin(meas.y[ALPHA])
    a_x = a[0] - g * np.sin(th)
    a_y = a[1] + g * np.cos(th) * np.sin(phi)
    a_z = a[2] + g * np.cos(th) * np.cos(phi)
    rate = forces.angle_rate
    rate[0] = p * s - r * c + (a_y * np.cos(beta) - (a_x * c + a_z * s) * np.sin(beta)) / V
    rate[1] = q - np.tan(beta) * (p * c + r * s) + (a_z * c - a_x * s) / (V * np.cos(beta))


@kernel
def update_inertial(forces, f, i, y, dt):
    """Integrate the flow angle of a vane from inertial motion, and return the innovation of force i at it.

        angle <- angle + dt angle_rate      e_drift <- e_drift + dt slope      slope = e_vane q_ratio
        returned: e - slope (vane - angle)

    y (4 + signals,): readings; vane rad: that of the force's vane, at which the angle starts in the first
    update; slope rad/s2 per rad: e of an error of the vane.
    """
    vane = y[VANES[i]]
    slope = f.e_vane * forces.q_ratio
    f.angle = f.angle + dt * forces.angle_rate[i] if forces.n_seen else vane
    f.e_drift += dt * slope
    return f.innovation - slope * (vane - f.angle)


@kernel
def fill_vaneless_y(forces, w, y):
    """Fill `y_free` with the readings y, but alpha and beta worked out from the forces.

        y_free = y - (e / q_ratio + L' w) / e_vane

    The equation is for the two vanes, with the force of each. w (3,) rad/s: rotation of the air in body axes.
    The aircraft turns at x - w relative to the air, so e / q_ratio contains -L' w, which is no effect of the
    angle.
    """
    copy(y, forces.y_free)
    for i, f in enumerate(forces.component):
        e_w = project(f.L, w)
        forces.y_free[VANES[i]] -= (f.innovation / forces.q_ratio + e_w) / f.e_vane
