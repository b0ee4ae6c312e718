"""Innovations of the side force and the normal force from accelerometers, as an addition to the rates.

Elevator and flap both pitch the aircraft, so the rates alone do not separate their faults. Their forces do.
The innovation of a force, i = Y (side) or Z (normal), is scaled as if the force acted at the chord c, m:

    e_i = (a_i - qdyn S C_i / m) / c       rad/s2

a_i, m/s2, is the reading; qdyn, Pa, the dynamic pressure; S, m2, the wing area; m, kg, the mass; C_i the
model's coefficient at the measured flow and the commanded surfaces. A fault of a surface changes e_i and the
angular acceleration in the ratio of the surface's terms. An error of a vane changes both in another ratio.
Terms of forces have the same declared tolerance as those of moments, and the whole force has that of the
mass. Noise of the accelerometers is model noise; their declared bias and slope are tolerated constants.

The side force has a term in the rate of sideslip. It is worked out from the accelerometers. JSBSim uses the
rate of the run before.

forces_design.py fills the records from what a scenario declares.

Letters of the kernels. i is the number of the force, f its record (FORCE_RECORD), k a term or an axis, s a
surface. Forces are over m c, like e, and so in rad/s2.

    e, f_hat       innovation; force of the model
    per_C          qdyn S / m c: e of a coefficient of one
    G              e per rad of a surface
    L              force of the model per rad/s of the aircraft against the air, 1/s
    angle, vane    flow angle from inertial motion, rad; of a vane's error, per rad: (acceleration, e)
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS_OF_ONE
from beaver_ftc.compiled import copy, kernel, record
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, N_Y
from beaver_ftc.diagnosis.detection.directions import project
from beaver_ftc.diagnosis.gusts import drop_accelerometers
from beaver_ftc.diagnosis.state import PITCH, YAW
from beaver_ftc.scenario.sensors import ACCELEROMETERS


class Force(NamedTuple):
    """A force: its coefficient; the place in y and the name of the vane that measures its flow angle; the
    axis about which that angle turns the aircraft; its accelerometer."""

    coefficient: str
    vane: int
    vane_name: str
    axis: int
    accelerometer: str


SIDE_INDEX, NORMAL_INDEX = range(2)  # numbers of the forces across the body, and normal to it
MEASURED_FORCES = (
    Force("CY", BETA, "beta", YAW, ACCELEROMETERS[1]),
    Force("CZ", ALPHA, "alpha", PITCH, ACCELEROMETERS[2]),
)
FORCE_NAMES = tuple(force.coefficient for force in MEASURED_FORCES)
VANES = tuple(force.vane for force in MEASURED_FORCES)
VANE_E = 1  # place of e in `vane` of FORCE_RECORD
# A force counts from its second update on: only then the rate of sideslip of the run before is known.
MIN_UPDATES = 2
# Columns of a force: its terms, the rate of sideslip, the bias of the accelerometer, the force as a whole.
MAX_FORCE_REGRESSORS = MAX_TERMS_OF_ONE + 3

FORCE_RECORD = record(
    innovation=float,  # e at the start of the elapsed frame
    angle=float,  # flow angle from inertial motion, rad
    e_drift=float,  # e per rad/s of the drift of that angle
    Q_e=float,  # intensity of the drift of e at that angle by errors and gusts, (rad/s2)2/s
    G=MAX_SURFACES,  # e per rad of each surface, now
    # effects of an error of the vane, per rad: vane: on the axis of the force, and on e; vane_roll: on roll
    vane=2, vane_roll=float,
    var_trim=2,  # variance of f_hat in trim by noise, with that of the vane and without it, (rad/s2)2
    L=3, f_hat=float,
    G_trim=MAX_SURFACES,  # bound on e by each surface, per rad, in trim with signals of at most 1
    var_acc=float,  # variance of e by noise of the accelerometer, which does not change with the pressure
    n_Z=int,  # number of its columns in rows.py, without that of the drift
)  # fmt: skip
FORCES_RECORD = record(
    in_use=int, c_inv=float,  # whether forces are used; one over the chord, 1/m
    # dynamic pressure in trim, and its noise, Pa; dynamic pressure now over that in trim
    q_trim=float, q_noise=float, q_ratio=float,
    # coefficient of the rate of sideslip; rates of sideslip and incidence of the instant before, rad/s
    CY_bdot=float, angle_rate=2,
    n_seen=int,  # updates so far, up to MIN_UPDATES
    gust_noise=3,  # deviation of the acceleration that is computed from the gust by forces, rad/s2
    y_free=N_Y, component=(FORCE_RECORD, 2),
)  # fmt: skip


@kernel
def fill_vaneless_y(forces, w, y):
    """Fill `y_free` with the readings y, but alpha and beta worked out from the forces.

        y_free = y - (e / q_ratio + L' w) / e_vane      e_vane = vane[VANE_E]: e per rad of the vane's error

    The equation is for the two vanes, with the force of each. w (3,) rad/s: rotation of the air in body axes.
    The aircraft turns at x - w relative to the air, so e / q_ratio contains -L' w, which is no effect of the
    angle.
    """
    copy(y, forces.y_free)
    for i, f in enumerate(forces.component):
        e_w = project(f.L, w, False)
        forces.y_free[VANES[i]] -= (f.innovation / forces.q_ratio + e_w) / f.vane[VANE_E]


@kernel
def drop_forces(forces, gust, vaneless, vaned):
    """Stop using forces and the gust estimates of the views; estimate the gust without accelerometers."""
    drop_accelerometers(gust)
    vaneless.output.gusty = vaned.output.gusty = 0
    forces.in_use = 0


@kernel
def update_inertial(forces, f, i, y, dt):
    """Integrate the flow angle of a vane from inertial motion, and return the innovation of force i at it.

        angle <- angle + dt angle_rate      e_drift <- e_drift + dt slope
        returned: e - slope (vane - angle)

    y (4 + signals,): readings; vane rad: that of the force's vane, at which the angle starts in the first
    update; slope rad/s2 per rad: e of an error of the vane.
    """
    vane = y[VANES[i]]
    slope = f.vane[VANE_E] * forces.q_ratio
    f.angle = f.angle + dt * forces.angle_rate[i] if forces.n_seen else vane
    f.e_drift += dt * slope
    return f.innovation - slope * (vane - f.angle)


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
    p, q, r = meas.x[0], meas.x[1], meas.x[2]
    phi, th = meas.attitude[0], meas.attitude[1]
    c, s = np.cos(meas.y[ALPHA]), np.sin(meas.y[ALPHA])
    a_x = a[0] - g * np.sin(th)
    a_y = a[1] + g * np.cos(th) * np.sin(phi)
    a_z = a[2] + g * np.cos(th) * np.cos(phi)
    rate = forces.angle_rate
    rate[SIDE_INDEX] = p * s - r * c + (a_y * np.cos(beta) - (a_x * c + a_z * s) * np.sin(beta)) / V
    rate[NORMAL_INDEX] = q - np.tan(beta) * (p * c + r * s) + (a_z * c - a_x * s) / (V * np.cos(beta))


def terms_of_force(aircraft: Aircraft, i: int) -> list[Term]:
    """The terms of force i, in the order of their columns (`rows.add_terms`)."""
    return [term for term in aircraft.measurable_forces if term.coefficient == FORCE_NAMES[i]]
