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

Letters of the kernels. i is the force, f its record, k a term or an axis, s a surface; a force over m c,
like e, is in rad/s2.

    e, f_hat       innovation; force of the model
    per_C          qdyn S / m c: e of a coefficient of one
    G              e per rad of a surface
    L              force of the model per rad/s of the aircraft against the air, 1/s
    angle, vane    flow angle from inertial motion, rad; of a vane's error, per rad: (acceleration, e)
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Term
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, FORCES
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS_OF_ONE, SIDESLIP_RATE
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.engine import slipstream_slopes
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, DPT, N_Y, QDYN
from beaver_ftc.diagnosis.gusts import drop_accelerometers
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_M_S2
from beaver_ftc.diagnosis.state import PITCH, ROLL, SIDE_FORCE, YAW
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors
from beaver_ftc.scenario.sensors import ACCELEROMETERS


class Force(NamedTuple):
    """A force: its coefficient; its vane, in y and by name; the axis that it turns; its accelerometer."""

    coefficient: str
    vane: int
    vane_name: str
    axis: int
    accelerometer: str


SIDE_INDEX, NORMAL_INDEX = range(2)  # across the body, and normal to it
MEASURED_FORCES = (
    Force("CY", BETA, "beta", YAW, ACCELEROMETERS[1]),
    Force("CZ", ALPHA, "alpha", PITCH, ACCELEROMETERS[2]),
)
FORCE_NAMES = tuple(force.coefficient for force in MEASURED_FORCES)
VANES = tuple(force.vane for force in MEASURED_FORCES)
SIDE_ROW = FORCES.index("CY")
TYPICAL_RATE_RAD_S, TYPICAL_SLOPE_RAD = 0.2, 0.3  # typical rates and path slope, for the drift
MIN_UPDATES = 2  # from the second one on the rate of sideslip of the run before is known
# Time between force and flow of one instant in JSBSim, at most; 0.001 was measured.
MAX_FORCE_LAG_S = 0.002
DRIFT_CHANGE_PER_S = 0.3  # share of a drift that may change within a second
# Tolerance of the term in the rate of sideslip, by whether the air moves: gusts have a part in it.
SIDESLIP_RATE_TOLERANCES = {False: 0.05, True: 0.2}
VANE_TOLERANCE = 0.1  # relative error of the effect of a vane's error: its column is that of the trim
# The rate of sideslip, the bias of the accelerometer and the force as a whole come last.
MAX_FORCE_REGRESSORS = MAX_TERMS_OF_ONE + 3

TrimState = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y and u rad

FORCE_RECORD = record(
    innovation=float,  # e at the start of the elapsed frame
    angle=float,  # flow angle from inertial motion, rad
    e_drift=float,  # e per rad/s of the drift of that angle
    Q_e=float,  # intensity of the drift of e at that angle by errors and gusts, (rad/s2)2/s
    G=MAX_SURFACES,  # e per rad of each surface, now
    # of an error of the vane, per rad: angular acceleration and e, angular acceleration in roll
    vane=2, vane_roll=float,
    var_trim=2,  # variance of f_hat in trim by noise, with that of the vane and without it, (rad/s2)2
    L=3, f_hat=float,
    G_trim=MAX_SURFACES,  # magnitude of e by each surface in trim, per rad
    var_acc=float,  # variance of e by noise of the accelerometer; independent of the pressure
    n_Z=int,  # its columns in rows.py, without that of the drift
)  # fmt: skip
FORCES_RECORD = record(
    in_use=int, c_inv=float,  # whether forces are used; one over the chord, 1/m
    q_trim=float, q_noise=float, q_ratio=float,  # dynamic pressure: in trim, noise, Pa; over that in trim
    # coefficient of the rate of sideslip; rates of sideslip and incidence of the instant before, rad/s
    CY_bdot=float, angle_rate=2,
    n_seen=int,  # updates so far, up to MIN_UPDATES
    gust_noise=3,  # noise of the gust estimate from forces, rad/s2
    y_free=N_Y, component=(FORCE_RECORD, 2),
)  # fmt: skip


@kernel
def fill_vaneless_y(forces, w, y):
    """Fill `y_free` with the readings y, but alpha and beta worked out from the forces.

        y_free = y - (e / q_ratio + L' w) / vane[1]

    w (3,) rad/s: rotation of the air in body axes. The aircraft turns at x - w against it: e = -L' w.
    """
    forces.y_free[:] = y
    for i in range(2):
        f = forces.component[i]
        e_w = 0.0
        for k in range(3):
            e_w += f.L[k] * w[k]
        forces.y_free[VANES[i]] -= (f.innovation / forces.q_ratio + e_w) / f.vane[1]


@kernel
def drop_forces(forces, gust, vaneless, vaned):
    """Stop using forces, and estimate the gust without accelerometers."""
    drop_accelerometers(gust)
    vaneless.output.gusty = vaned.output.gusty = 0
    forces.in_use = 0


@kernel
def update_inertial(forces, f, i, y, dt):
    """Integrate the flow angle of a vane from inertial motion, and return the innovation of force i at it.

    angle <- angle + dt angle_rate      returned: e - slope (y - angle)      e_drift = sum dt slope
    """
    angle = y[VANES[i]]
    slope = f.vane[1] * forces.q_ratio
    f.angle = f.angle + dt * forces.angle_rate[i] if forces.n_seen else angle
    f.e_drift += dt * slope
    return f.innovation - slope * (angle - f.angle)


@kernel
def fill_angle_rates(forces, gravity, meas):
    """Fill `angle_rate` with d beta / dt and d alpha / dt in still air, rad/s.

        a = f + g      V_dot = e' a      (u, v, w)_dot = a - x x V e      e = V vector / V
        beta_dot = (v_dot - V_dot e_y) / (V cos beta)
        alpha_dot = (w_dot cos alpha - u_dot sin alpha) / (V cos beta)

    f (3,) m/s2: accelerometers; g (3,): gravity in body axes, its size `gravity` m/s2; x (3,) rad/s.
    """
    g, x, f = gravity, meas.x, meas.force
    phi, th = meas.attitude[0], meas.attitude[1]
    alpha, beta, V = meas.y[ALPHA], meas.y[BETA], meas.y[AIRSPEED]
    e_x, e_y = np.cos(alpha) * np.cos(beta), np.sin(beta)
    e_z = np.sin(alpha) * np.cos(beta)
    a_x = f[0] - g * np.sin(th)
    a_y = f[1] + g * np.cos(th) * np.sin(phi)
    a_z = f[2] + g * np.cos(th) * np.cos(phi)
    V_dot = e_x * a_x + e_y * a_y + e_z * a_z
    v_dot = a_y + V * (x[0] * e_z - x[2] * e_x)
    forces.angle_rate[SIDE_INDEX] = (v_dot - V_dot * e_y) / (V * np.cos(beta))
    u_dot = a_x + V * (x[2] * e_y - x[1] * e_z)
    w_dot = a_z + V * (x[1] * e_x - x[0] * e_y)
    forces.angle_rate[NORMAL_INDEX] = (w_dot * np.cos(alpha) - u_dot * np.sin(alpha)) / (V * np.cos(beta))


def terms_of_force(aircraft: Aircraft, i: int) -> list[Term]:
    """The terms of force i, as `update_force` goes through them."""
    return [term for term in aircraft.measurable_forces if term.coefficient == FORCE_NAMES[i]]


def configure_forces(
    fdi: np.void, declared: Declared, trim: TrimState, slopes: np.ndarray, dt: float
) -> None:
    """Fill the record of the forces from what is declared.

    slopes (3, y.size): of the angular accelerations with y, in trim. dt s a frame.
    """
    y = trim[1]
    stat = fdi["statistical"]
    aircraft = declared.aircraft
    errors = declared.sensors
    forces = stat["forces"]
    forces["c_inv"] = 1.0 / aircraft.geometry.chord_m
    forces["q_trim"] = y[QDYN]
    forces["q_noise"] = errors["qdyn"].random
    CY_bdot = [t.value for t in aircraft.forces if t.coefficient == "CY" and t.of == ((SIDESLIP_RATE, 1),)]
    forces["CY_bdot"] = sum(CY_bdot)
    for i in range(2):
        _configure_force(fdi, declared, trim, slopes, i, dt)


def _configure_force(
    fdi: np.void, declared: Declared, trim: TrimState, slopes: np.ndarray, i: int, dt: float
) -> None:
    """Fill the record of one force; the arguments are those of `configure_forces`."""
    y = trim[1]
    aircraft = declared.aircraft
    errors = declared.sensors
    forces = fdi["statistical"]["forces"]
    cfg = fdi["statistical"]["gust"]["config"]
    f = forces["component"][i]
    terms = terms_of_force(aircraft, i)
    force = MEASURED_FORCES[i]
    per_C = y[QDYN] * cfg["S_m"] * forces["c_inv"]
    f_all = per_C * _force_slopes(aircraft, force.coefficient, trim)
    f_y = f_all[:-1]
    f["vane"] = (-slopes[force.axis, force.vane], -f_y[force.vane])
    f["vane_roll"] = -slopes[ROLL, force.vane]
    f["L"] = f_y[3:]
    f["var_trim"] = _force_variances(fdi, errors, y, f_all, force.vane)
    std = errors[force.accelerometer].random
    f["var_acc"] = (forces["c_inv"] * std) ** 2
    drift = _drift_bound(errors, cfg["gravity"], y[AIRSPEED], i)
    _configure_columns(fdi["statistical"]["rows"], f, declared, terms, y, f_y[force.vane] / per_C, drift, i)
    for term in terms:
        if term.surface:
            f["G_trim"][aircraft.surfaces.index(term.surface)] += per_C * abs(term.value)
    Q_angle = (DRIFT_CHANGE_PER_S * drift) ** 2 + dt * (std / y[AIRSPEED]) ** 2
    f["Q_e"] = f_y[force.vane] ** 2 * (Q_angle + declared.air.angle_walk(y[AIRSPEED]))


def _force_variances(
    fdi: np.void, errors: SensorErrors, y: np.ndarray, f_all: np.ndarray, vane: int
) -> tuple[float, float]:
    """Variance of a predicted force by the noise of all readings, and without that of its vane.

    f_all (7,): slopes of the force as of `_force_slopes`.
    """
    f_y = f_all[:-1].copy()
    f_dpt = f_all[-1]
    dpt_V, var_dpt = _slipstream_noise(y, fdi["bound"]["declared_errors"], errors)
    f_y[AIRSPEED] += f_dpt * dpt_V
    parts = (f_y * errors.each("random", ("alpha", "beta", "V", *AXES))) ** 2
    var = parts.sum() + f_dpt**2 * var_dpt
    return var, var - parts[vane]


def _slipstream_noise(y: np.ndarray, declared_errors: np.void, errors: SensorErrors) -> tuple[float, float]:
    """How dpt moves with the reading of the airspeed, s/m; its variance by those of pressure and power."""
    if not declared_errors["engine"]:
        return 0.0, 0.0
    dpt_V, dpt_q, dpt_kw = slipstream_slopes(y, declared_errors["kw1"])
    noise_kw = declared_errors["kw0"] / NOISE_LIMIT_SIGMA
    return dpt_V, float((dpt_q * errors["qdyn"].random) ** 2 + (dpt_kw * noise_kw) ** 2)


def _drift_bound(errors: SensorErrors, gravity: float, V: float, i: int) -> float:
    """Bound the drift of the flow angle from inertial motion, rad/s. Gravity acts along the path's slope only
    on the incidence, and in full on sideslip."""
    attitude = errors["phi"].steady + errors["theta"].steady
    gyros = sum(errors[name].steady + TYPICAL_RATE_RAD_S * errors[name].slope for name in AXES)
    # how far accelerometers can be off across the flow in level flight: that of the axis, and of the one
    # ahead as much as the flow's angle lets it
    acc = errors[MEASURED_FORCES[i].accelerometer]
    a_acc = (
        acc.steady
        + TYPICAL_SLOPE_RAD * errors["ax"].steady
        + gravity * (acc.slope if i == NORMAL_INDEX else 0.0)
    )
    a_all = gravity * attitude * (TYPICAL_SLOPE_RAD if i == NORMAL_INDEX else 1.0) + EARTH_M_S2 + a_acc
    return float(EARTH_RATE_RAD_S + gyros + a_all / V)


def _configure_columns(
    rows: np.void,
    f: np.void,
    declared: Declared,
    terms: list[Term],
    y: np.ndarray,
    C_vane: float,
    drift: float,
    i: int,
) -> None:
    """Fill the tolerances of the force's columns: of each term, by that of the coefficients and by constant
    errors of vane and pressure; of the rate of sideslip; of the accelerometer's bias, m/s2; of the whole; of
    the drift, rad/s. Fill the columns of an error of the vane."""
    tol_C = declared.coefficients.largest
    errors = declared.sensors
    force = MEASURED_FORCES[i]
    vane = errors[force.vane_name]
    acc = errors[force.accelerometer]
    tol_q = errors["qdyn"].steady / y[QDYN] + errors["qdyn"].slope
    tol = [
        (tol_C + tol_q + vane.slope) * abs(t.value) + t.is_constant * vane.steady * abs(C_vane) for t in terms
    ]
    first = int(rows["first"][i])
    if i == SIDE_INDEX:
        tol.append(tol_C + SIDESLIP_RATE_TOLERANCES[declared.air.moves])
    if acc.steady:
        rows["Z"][first + len(tol), SIDE_FORCE + i] = 1.0 / declared.aircraft.geometry.chord_m
        tol.append(acc.steady)
    tol += [MASS_TOLERANCE + acc.slope, drift]
    f["n_Z"], rows["tol"][first : first + len(tol)] = len(tol) - 1, tol
    of_vane = rows["G"][MAX_SURFACES + i]
    of_vane[[ROLL, force.axis, SIDE_FORCE + i]] = f["vane_roll"], *f["vane"]
    rows["e_G"][MAX_SURFACES + i] = VANE_TOLERANCE * np.abs(of_vane)


def _force_coefficient(aircraft: Aircraft, name: str, state: TrimState) -> float:
    """The force coefficient `name` at x (3,) rad/s, y, u rad."""
    x, y, u = state
    geometry = aircraft.geometry
    V = y[AIRSPEED]
    rates = x * (geometry.span_m / (2.0 * V), geometry.chord_m / V, geometry.span_m / (2.0 * V))
    values = dict(zip(aircraft.surfaces, u, strict=True)) | dict(zip(aircraft.signals, y[4:], strict=True))
    values |= dict(
        zip(("alpha", "beta", "ph", "qh", "rh", SIDESLIP_RATE), (y[0], y[1], *rates, 0.0), strict=True)
    )
    return float(aircraft.coefficient(name, values))


def _force_slopes(aircraft: Aircraft, name: str, trim: TrimState) -> np.ndarray:
    """(7,): its derivatives with alpha, beta (1/rad), airspeed (s/m), rates (s/rad), dpt, by differences."""
    (x, y, u), step = trim, 1e-5
    states = [(x, y + step * e, u) for e in np.eye(3, y.size)]
    states += [(x + step * e, y, u) for e in np.eye(3)]
    states += [(x, y + step * (np.arange(y.size) == DPT), u)]
    C = _force_coefficient(aircraft, name, trim)
    return np.array([(_force_coefficient(aircraft, name, state) - C) / step for state in states])
