"""The records of the forces, as they follow from what a scenario declares.

x, y, u     of a `TrimState`: rates, readings and deflections in trim
i, f        number of a force, and its record (forces.py)
e           innovation of a force, rad/s2; per_C: e of a coefficient of one
std         standard deviation of the noise of a reading
"""

from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, ROLL
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.aircraft.schema import MAX_SURFACES, SIDESLIP_RATE
from beaver_ftc.compiled import fill
from beaver_ftc.design.engine import slipstream_slopes
from beaver_ftc.design.table import AIRSPEED, DPT, QDYN
from beaver_ftc.diagnosis.detection.blocks import SIDE_FORCE
from beaver_ftc.diagnosis.detection.flow_angles import VANES
from beaver_ftc.diagnosis.detection.forces import MEASURED_FORCES, NORMAL_INDEX, SIDE_INDEX, terms_of_force
from beaver_ftc.diagnosis.monitors.residual_bounds import EARTH_M_S2
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors

TYPICAL_RATE_RAD_S, TYPICAL_SLOPE_RAD = 0.2, 0.3  # typical rates and path slope, for the drift
DRIFT_CHANGE_PER_S = 0.3  # share of a drift that may change within a second
# Tolerance of the term in the rate of sideslip, by whether the air moves: gusts have a part in it.
SIDESLIP_RATE_TOLERANCES = {False: 0.05, True: 0.2}
VANE_TOLERANCE = 0.1  # relative error of the effect of a vane's error: its column is that of the trim

TrimState = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y (readings), u rad


def configure_forces(
    fdi: np.void, declared: Declared, trim: TrimState, slopes: np.ndarray, dt: float
) -> None:
    """Fill the record of the forces from what is declared.

        f_all = per_C dC / d(alpha, beta, V, p, q, r, dpt),      per_C = qdyn S / m c
        Q_e = f_vane^2 (Q_angle + walk),      Q_angle = (DRIFT_CHANGE_PER_S drift)^2 + dt (std / V)^2

    slopes (3, y.size): of the angular accelerations with y, in trim. dt s a frame. f_all (7,): slopes of the
    predicted force, in the order of `_force_slopes`; f_vane rad/s2 per rad: that with the force's vane;
    Q_angle rad2/s: intensity of the drift of the flow angle from inertial motion, its first part by the
    change of the drift in 1 s, squared, in each second; drift rad/s: bound on that drift; walk rad2/s:
    intensity of the change of that angle by gusts; std m/s2: noise of the accelerometer. G_trim takes the
    signals of a term, besides the deflection, as 1.
    """
    stat = fdi["statistical"]
    err = fdi["bound"]["declared_errors"]
    forces = stat["forces"]
    cfg = stat["gust"]["config"]
    aircraft = declared.aircraft
    errors = declared.sensors
    y = trim[1]
    c_inv = 1.0 / aircraft.geometry.chord_m
    per_C = y[QDYN] * cfg["S_m"] * c_inv
    CY_bdot = sum(
        declared.terms[term.name]
        for term in aircraft.forces
        if term.coefficient == "CY" and term.of == ((SIDESLIP_RATE, 1),)
    )
    fill(forces, c_inv=c_inv, q_trim=y[QDYN], q_noise=errors["qdyn"].random, CY_bdot=CY_bdot)
    for i, (force, f) in enumerate(zip(MEASURED_FORCES, forces["component"], strict=True)):
        f_all = per_C * _force_slopes(declared, force.coefficient, trim)
        f_vane = f_all[VANES[i]]
        std = errors[force.accelerometer].random
        drift = _drift_bound(errors, cfg["gravity"], y[AIRSPEED], i)
        Q_angle = (DRIFT_CHANGE_PER_S * drift) ** 2 + dt * (std / y[AIRSPEED]) ** 2
        fill(
            f, e_vane=-f_vane, L=f_all[3:6], var_trim=_force_variances(err, errors, y, f_all, VANES[i]),
            var_acc=(c_inv * std) ** 2, Q_e=f_vane**2 * (Q_angle + declared.air.angle_walk(y[AIRSPEED])),
        )  # fmt: skip
        for term in terms_of_force(aircraft, i):
            if term.surface:
                f["G_trim"][aircraft.surfaces.index(term.surface)] += per_C * abs(declared.terms[term.name])
        _configure_columns(stat["rows"], f, declared, y, f_vane / per_C, drift, i)
        _configure_vane(stat["rows"], f, slopes, i)


def _force_variances(
    err: np.void, errors: SensorErrors, y: np.ndarray, f_all: np.ndarray, vane: int
) -> tuple[float, float]:
    """Variance of a predicted force by the noise of all readings, (rad/s2)2; the same without its vane. Of
    the dynamic pressure only the part through dpt counts here: `forces.fill_innovation` adds the rest.

        sum_k (f_k sigma_k)^2 + f_dpt^2 var_dpt,      k: alpha, beta, V, p, q, r

    err: record of the declared errors; f_all (7,): slopes of the force as of `_force_slopes`, that of dpt
    last. dpt moves with the airspeed, which counts in f_V; var_dpt is its variance by the noise of dynamic
    pressure and power. Without declared errors of the engine's instruments dpt has neither.
    """
    f = f_all[:-1].copy()
    var_dpt = 0.0
    if err["engine"]:
        dpt_V, dpt_q, dpt_kw = slipstream_slopes(y, err["kw1"])
        f[AIRSPEED] += f_all[-1] * dpt_V
        noise_kw = err["kw0"] / NOISE_LIMIT_SIGMA
        var_dpt = float((dpt_q * errors["qdyn"].random) ** 2 + (dpt_kw * noise_kw) ** 2)
    parts = (f * errors.each("random", ("alpha", "beta", "V", *AXES))) ** 2
    var = parts.sum() + f_all[-1] ** 2 * var_dpt
    return var, var - parts[vane]


def _drift_bound(errors: SensorErrors, gravity: float, V: float, i: int) -> float:
    """Bound on the drift of the flow angle from inertial motion, rad/s: w_E + gyros + a / V.

    w_E: rate of the Earth; gyros: sum of their constant errors, with the slope at TYPICAL_RATE_RAD_S; a m/s2:
    error of the acceleration across the flow. An error of the attitude turns gravity, which then has an error
    across the flow: all of it in the sideslip, and its part by the slope of the path in the incidence. The
    normal accelerometer reads about one g, so its slope counts, too.
    """
    attitude = errors["phi"].steady + errors["theta"].steady
    gyros = sum(errors[name].steady + TYPICAL_RATE_RAD_S * errors[name].slope for name in AXES)
    # Errors of two accelerometers act across the flow: all of that along the force, and of the error of the
    # one ahead the part by the slope of the flow.
    acc = errors[MEASURED_FORCES[i].accelerometer]
    a = acc.steady + TYPICAL_SLOPE_RAD * errors["ax"].steady + EARTH_M_S2
    a += gravity * (acc.slope + attitude * TYPICAL_SLOPE_RAD if i == NORMAL_INDEX else attitude)
    return float(EARTH_RATE_RAD_S + gyros + a / V)


def _configure_columns(
    rows: np.void, f: np.void, declared: Declared, y: np.ndarray, C_vane: float, drift: float, i: int
) -> None:
    """Fill the tolerances of the columns of force i.

    C_vane: slope of the force's coefficient with the flow angle, 1/rad; drift rad/s: of `_drift_bound`.

    The columns follow each other in Z from `first` on. forces.py fills all but the bias, which is constant:

        column            there                     tolerance                        Z filled by
        each term         always                    coefficients, vane, pressure     add_terms
        rate of sideslip  in the side force         coefficients, motion of the air  add_terms, after them
        bias              if the sensor has one     m/s2                             here, after those
        whole force       always                    mass, slope of the sensor        predict_force, n_Z - 1
        drift             always                    rad/s                            update_forces, n_Z
    """
    force = MEASURED_FORCES[i]
    tol_C = declared.coefficients.largest
    errors = declared.sensors
    vane = errors[force.vane]
    acc = errors[force.accelerometer]
    tol_q = errors["qdyn"].steady / y[QDYN] + errors["qdyn"].slope
    tol = [
        (tol_C + tol_q + vane.slope) * abs(declared.terms[t.name]) + t.is_constant * vane.steady * abs(C_vane)
        for t in terms_of_force(declared.aircraft, i)
    ]
    first = int(rows["first"][i])
    if i == SIDE_INDEX:
        tol.append(tol_C + SIDESLIP_RATE_TOLERANCES[declared.air.moves])
    if acc.steady:
        rows["Z"][first + len(tol), SIDE_FORCE + i] = 1.0 / declared.aircraft.geometry.chord_m
        tol.append(acc.steady)
    tol += [MASS_TOLERANCE + acc.slope, drift]
    f["n_Z"] = len(tol) - 1
    rows["tol"][first : first + len(tol)] = tol


def _configure_vane(rows: np.void, f: np.void, slopes: np.ndarray, i: int) -> None:
    """Fill G and e_G of an error of the vane of force i: its effect on roll, on the axis of the force and on
    the force, per rad, and the bound on the error of each. slopes: as of `configure_forces`."""
    axis = MEASURED_FORCES[i].axis
    G = rows["G"][MAX_SURFACES + i]
    G[[ROLL, axis, SIDE_FORCE + i]] = -slopes[ROLL, VANES[i]], -slopes[axis, VANES[i]], f["e_vane"]
    rows["e_G"][MAX_SURFACES + i] = VANE_TOLERANCE * np.abs(G)


def _force_coefficient(declared: Declared, name: str, state: TrimState) -> Any:
    """The force coefficient `name` at x (3,) rad/s, y, u rad; x and y may be complex."""
    x, y, u = state
    aircraft = declared.aircraft
    geometry = aircraft.geometry
    V = y[AIRSPEED]
    rates = x * (geometry.span_m / (2.0 * V), geometry.chord_m / V, geometry.span_m / (2.0 * V))
    names = (*aircraft.surfaces, *aircraft.signals, "alpha", "beta", "ph", "qh", "rh", SIDESLIP_RATE)
    values = dict(zip(names, (*u, *y[4:], *y[:2], *rates, 0.0), strict=True))
    return aircraft.coefficient(name, values, declared.scale)


def _force_slopes(declared: Declared, name: str, trim: TrimState) -> np.ndarray:
    """(7,): the derivatives of coefficient `name` with alpha, beta (1/rad), airspeed (s/m), rates (s/rad) and
    dpt, by complex steps."""
    x, y, u = trim
    step = 1e-30j
    states = [(x, y + step * e, u) for e in np.eye(3, y.size)]
    states += [(x + step * e, y, u) for e in np.eye(3)]
    states += [(x, y + step * (np.arange(y.size) == DPT), u)]
    return np.array([(_force_coefficient(declared, name, state) / step).real for state in states])
