"""The rows of the forces (rows.py): side force and normal force, from accelerometers.

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

flow_angles.py has the flow angles without the vanes. forces_design.py fills the records from what a scenario
declares.

Letters of the kernels. Forces are over m c, like e, and so in rad/s2.

    i, f, r        number of the force, its record (FORCE_RECORD), its row
    k, s           term of the force; surface
    e, f_hat       innovation; force of the model
    per_C          qdyn S / m c: e of a coefficient of one
    G              e per rad of a surface
    L              force of the model per rad/s of the aircraft against the air, 1/s
    e_vane         e per rad of a vane's error
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import PITCH, YAW, Aircraft, Term
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.aircraft.schema import MAX_SURFACES
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import AIRSPEED, N_Y, QDYN, evaluate
from beaver_ftc.diagnosis.detection.blocks import SIDE_FORCE
from beaver_ftc.diagnosis.detection.directions import project
from beaver_ftc.diagnosis.detection.flow_angles import fill_angle_rates, update_inertial
from beaver_ftc.diagnosis.detection.rows import INERTIAL, N_SOURCES
from beaver_ftc.diagnosis.gusts import drop_accelerometers
from beaver_ftc.scenario.sensors import ACCELEROMETERS


class Force(NamedTuple):
    """A force: its coefficient; the vane that measures its flow angle; the axis about which that angle turns
    the aircraft; its accelerometer."""

    coefficient: str
    vane: str
    axis: int
    accelerometer: str


SIDE_INDEX, NORMAL_INDEX = range(2)  # numbers of the forces across the body, and normal to it
MEASURED_FORCES = (
    Force("CY", "beta", YAW, ACCELEROMETERS[1]),
    Force("CZ", "alpha", PITCH, ACCELEROMETERS[2]),
)
FORCE_NAMES = tuple(force.coefficient for force in MEASURED_FORCES)
_SIDE_ROW = FORCES.index("CY")  # of the table of the forces
# A force counts from its second update on: only then the rate of sideslip of the run before is known.
MIN_UPDATES = 2
# Largest time between the force and the flow of one instant in JSBSim; 0.001 s was measured.
MAX_FORCE_LAG_S = 0.002

FORCE_RECORD = record(
    innovation=float,  # e at the start of the elapsed frame
    angle=float,  # flow angle from inertial motion, rad
    e_drift=float,  # e per rad/s of the drift of that angle
    Q_e=float,  # intensity of the drift of e at that angle by errors and gusts, (rad/s2)2/s
    G=MAX_SURFACES,  # e per rad of each surface, now
    e_vane=float,  # in trim
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


def terms_of_force(aircraft: Aircraft, i: int) -> list[Term]:
    """The terms of force i, in the order of their columns (`add_terms`)."""
    return [term for term in aircraft.measurable_forces if term.coefficient == FORCE_NAMES[i]]


@kernel
def drop_forces(forces, gust, vaneless, vaned):
    """Stop using forces and the gust estimates of the views; estimate the gust without accelerometers."""
    drop_accelerometers(gust)
    vaneless.output.gusty = vaned.output.gusty = 0
    forces.in_use = 0


@kernel
def update_forces(rows, forces, gust, du, meas, u, dt):
    """Update the rows of the forces at this instant, dt s after the last.

        eta = q_ratio sum_s G_trim_s du_s + MAX_FORCE_LAG_S |f_hat'|

    u (n,) rad: surfaces; du (n,) rad: bounds on their errors; f_hat' rad/s3: change of the force over dt, 0
    at the first instant.

    The order matters: the force uses the flow's rates of the instant before, so `fill_angle_rates` comes
    last. At the first instant those are not known; the rates of this instant are used.
    """
    if forces.n_seen == 0:
        fill_angle_rates(forces, gust.config.gravity, meas)
    evaluate(gust.memory.table, meas.x, meas.y)
    forces.q_ratio = meas.y[QDYN] / forces.q_trim
    for i, f in enumerate(forces.component):
        r = SIDE_FORCE + i
        f_prev = f.f_hat
        predict_force(rows, forces, f, gust, i, meas, u)
        e_inertial = update_inertial(forces, f, i, meas.y, dt)
        rows.Z[rows.first[i] + f.n_Z, r] = f.e_drift
        fill_innovation(rows, forces, f, r, e_inertial, meas.y[QDYN])
        e_lag = MAX_FORCE_LAG_S * abs(f.f_hat - f_prev) / dt if forces.n_seen else 0.0
        rows.eta[0, r] = rows.eta[1, r] = project(du, f.G_trim) * forces.q_ratio + e_lag
    fill_angle_rates(forces, gust.config.gravity, meas)
    forces.n_seen = min(forces.n_seen + 1, MIN_UPDATES)


@kernel
def fill_innovation(rows, forces, f, r, e_inertial, qdyn):
    """Fill nu and std of row r, of the force f, for every source:

        nu = e, or e_inertial at the angle from inertial motion, for INERTIAL
        std^2 = var_trim q_ratio^2 + (f_hat q_noise / qdyn)^2 + var_acc

    var_trim: with the noise of the vane, but for INERTIAL, which reads no vane; q_noise, qdyn Pa: noise and
    value of the dynamic pressure; var_acc: by the accelerometer.
    """
    by_q = f.f_hat * forces.q_noise / qdyn
    for source in range(N_SOURCES):
        inertial = source == INERTIAL
        var = f.var_trim[int(inertial)] * forces.q_ratio**2 + by_q * by_q + f.var_acc
        rows.nu[source, r] = e_inertial if inertial else f.innovation
        rows.std[source, r] = np.sqrt(var)


@kernel
def predict_force(rows, forces, f, gust, i, meas, u):
    """Predict force i, whose record is f, and fill its innovation e and the effects of surfaces:

        e = a / c - f_hat      Gu_s = G_s u_s,  G_s of the instant before; at the first instant: of this one

    a m/s2: reading of the force's accelerometer; 1 / c is `c_inv`. The rows have the effects of the frame
    before, as for the rates: the law reacts to the noise of a reading, which must not be in a signature too
    (statistical.md, "Signature from the previous frame").
    """
    r = SIDE_FORCE + i
    for s in range(u.size):
        rows.G[s, r] = f.G[s]
    f.f_hat = f_hat = add_terms(rows, forces, f, gust, i, meas, u)
    rows.Z[rows.first[i] + f.n_Z - 1, r] = f_hat
    for s in range(u.size):
        if forces.n_seen == 0:
            rows.G[s, r] = f.G[s]
        rows.Gu[s, r] = rows.G[s, r] * u[s]
    f.innovation = meas.force[1 + i] * forces.c_inv - f_hat


@kernel
def add_terms(rows, forces, f, gust, i, meas, u):
    """Fill the columns of the terms of force i, and the effects G of surfaces with the bounds e_G on their
    errors; return the predicted force f_hat, rad/s2.

        f_hat = sum_k C_k Z_k      Z_k = per_C monomial_k [u_s]      per_C = qdyn S / m c
        G_s = sum_k C_k per_C monomial_k      e_G_s = sum_k tol_k |per_C monomial_k|      k: terms in u_s

    The column of term k is offset + k, so that the first term has the first column of the force. After the
    terms of the side force comes that in the rate of sideslip, f_bdot, which is added to f_hat, too.
    """
    table = gust.memory.table
    r = SIDE_FORCE + i
    first = table.free_from[_SIDE_ROW + i]
    end = table.surface_to[_SIDE_ROW + i]
    offset = rows.first[i] - first
    f_hat = 0.0
    per_C = meas.y[QDYN] * gust.config.S_m * forces.c_inv
    for s in range(u.size):
        rows.e_G[s, r] = f.G[s] = 0.0
    for k in range(first, end):
        s = table.surface[k]
        Z = per_C * table.power[table.monomial[k]]
        if s >= 0:
            f.G[s] += table.value[k] * Z
            rows.e_G[s, r] += rows.tol[offset + k] * abs(Z)
            Z *= u[s]
        rows.Z[offset + k, r] = Z
        f_hat += table.value[k] * Z
    if i == SIDE_INDEX:
        span_over_2V = gust.config.span / (2.0 * meas.y[AIRSPEED])
        f_bdot = per_C * forces.CY_bdot * forces.angle_rate[SIDE_INDEX] * span_over_2V
        rows.Z[offset + end, r] = f_bdot
        f_hat += f_bdot
    return f_hat
