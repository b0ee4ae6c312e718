"""Innovations of the side force and the normal force from accelerometers, as an addition to the rates.

Elevator and flap both pitch the aircraft, so the rates alone do not separate their faults. Their forces do.
The innovation of a force, i = Y (side) or Z (normal), is scaled as if the force acted at the chord c, m:

    e_i = (a_i - qdyn S C_i / m) / c       rad/s2

a_i, m/s2, is the reading; qdyn, Pa, the dynamic pressure; S, m2, the wing area; m, kg, the mass; C_i the
model's coefficient at the measured flow and the commanded surfaces. A fault of a surface changes e_i and the
angular acceleration in the ratio of the surface's terms. An error of a vane changes both in another ratio.
Terms of forces have the same declared tolerance as those of moments, and the whole force has that of the
mass. Noise of the accelerometers is jitter; their declared bias and slope are tolerated constants.

The side force has a term in the rate of sideslip. It is worked out from the accelerometers. JSBSim uses the
rate of the run before.
"""

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Term
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, FORCES
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS_OF_ONE, SIDESLIP_RATE
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, N_Y, QDYN, evaluate, slipstream_slopes
from beaver_ftc.diagnosis.gusts import stop_accelerometers, stop_gust_filter
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_ACCELERATION_M_S2
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors
from beaver_ftc.scenario.sensors import ACCELEROMETERS

SIDE, NORMAL = range(2)  # across the body, and normal to it
COMPONENTS = ("CY", "CZ")
CY = FORCES.index("CY")
TYPICAL_RATE_RAD_S, TYPICAL_SLOPE_RAD = 0.2, 0.3  # typical rates and path slope, for the drift
SETTLED_UPDATES = 2  # updates: from the second one on the rate of sideslip of the run before is known
MODEL_LAG_S = 0.002  # time between force and flow of one instant in JSBSim, at most; 0.001 was measured
DRIFT_CHANGE_SHARE = 0.3  # share of a drift that may change within a second
RATE_TOLERANCE = {False: 0.05, True: 0.2}  # of the term in the rate of sideslip: gusts have a part in it
# The rate of sideslip, the bias of the accelerometer and the force as a whole come last.
MAX_ERRORS = MAX_TERMS_OF_ONE + 3

Trim = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y and u rad

FORCE = record(
    innovation=float,  # e at the start of the elapsed frame, rad/s2
    # e at the flow angle from inertial motion; that angle, rad; bound on its drift, rad/s; integral of the
    # force's slope, e per rad/s of drift; intensity of the drift of e by errors and gusts, (rad/s2)2/s
    inertial=float, angle=float, drift=float, angle_sensitivity=float, drift_intensity=float,
    # of each surface: e per rad, now and with the readings before; e at the command; error of e per rad
    column=MAX_SURFACES, column_predicted=MAX_SURFACES, effect=MAX_SURFACES, column_error=MAX_SURFACES,
    # of an error of the vane, per rad: angular acceleration and e, angular acceleration in roll
    vane=2, vane_roll=float,
    trim_variance=2, jitter=2,  # variance of e in trim and now: with the vane, without it; (rad/s2)2
    damping=3, deflection=float,  # e per rad/s of rotation of the air; bound by errors of deflections
    model=float, lag_error=float,  # e of the model; bound on its error by a time lag, rad/s2
    accelerometer_variance=float,  # of e, by noise of the accelerometer; independent of the pressure
    n=int, tolerance=MAX_ERRORS, regressor=MAX_ERRORS,
)  # fmt: skip
MEASURED_FORCES = record(
    known=int, per_chord=float,  # whether forces are used; one over the chord, 1/m
    gravity=float, span=float,  # m/s2; m
    pressure=float, pressure_noise=float,  # Pa: in trim, and noise of its reading
    pressure_ratio=float,  # dynamic pressure over that in trim: forces scale with it
    # coefficient of the rate of sideslip; rates of sideslip and incidence of the instant before, rad/s
    sideslip_rate_coefficient=float, rate=2, n_updates=int,  # updates so far, up to SETTLED
    gust_noise=3,  # noise of the gust estimate from forces, rad/s2
    y=N_Y, component=(FORCE, 2),
)  # fmt: skip


@kernel
def update_forces(forces, air, measured, u, dt):
    """Update the innovations of the forces at this instant, dt s after the last; u (n,) rad: surfaces.

    At the first instant the rate of sideslip of the run before is not known; that of this instant is used.
    """
    if forces.n_updates == 0:
        fill_flow_rates(forces, measured)
    evaluate(air.memory.force_table, measured.x, measured.y)
    forces.pressure_ratio = measured.y[QDYN] / forces.pressure
    for f in range(2):
        before = forces.component[f].model
        update_force(forces, air, f, measured, u)
        fill_lag_error(forces.component[f], before, forces.n_updates, dt)
        integrate_flow_angle(forces, forces.component[f], f, measured.y, dt)
    fill_flow_rates(forces, measured)
    forces.n_updates = min(forces.n_updates + 1, SETTLED_UPDATES)


@kernel
def fill_lag_error(force, before, begun, dt):
    """Fill `lag_error` from the change of the model's e since `before`: force and flow differ in time."""
    force.lag_error = MODEL_LAG_S * abs(force.model - before) / dt if begun else 0.0


@kernel
def fill_readings_without_vanes(forces, rotation, y):
    """Fill `y` with the readings y, but alpha and beta worked out from the forces.

    rotation (3,) rad/s: of the air in body axes; it damps like the aircraft's own rotation.
    """
    forces.y[:] = y
    for f in range(2):
        force, place, damped = forces.component[f], BETA if f == SIDE else ALPHA, 0.0
        for k in range(3):
            damped += force.damping[k] * rotation[k]
        forces.y[place] -= (force.innovation / forces.pressure_ratio + damped) / force.vane[1]


@kernel
def stop_forces(forces, air, inertial_air):
    """Stop using forces, and estimate the gust without accelerometers."""
    stop_accelerometers(air)
    stop_gust_filter(inertial_air)
    forces.known = 0


@kernel
def integrate_flow_angle(forces, force, f, y, dt):
    """Integrate the flow angle of a vane from inertial motion, and fill the force's innovation at it."""
    reading, slope = y[BETA if f == SIDE else ALPHA], force.vane[1] * forces.pressure_ratio
    force.angle = force.angle + dt * forces.rate[f] if forces.n_updates else reading
    force.angle_sensitivity += dt * slope
    force.inertial = force.innovation - slope * (reading - force.angle)


@kernel
def update_force(forces, air, f, measured, u):
    """Update one force: its innovation e, the effects of surfaces, and the regressors of its errors."""
    table, force = air.memory.force_table, forces.component[f]
    first, last = table.free_from[CY + f], table.surface_to[CY + f]
    scale, whole = measured.y[QDYN] * air.config.area_per_mass * forces.per_chord, 0.0
    force.column_predicted[:] = force.column
    force.column[:], force.column_error[:] = 0.0, 0.0
    for k in range(first, last):
        s, of_one = table.surface[k], scale * table.power[table.monomial[k]]
        if s >= 0:
            force.column[s] += table.value[k] * of_one
            force.column_error[s] += force.tolerance[k - first] * abs(of_one)
            of_one *= u[s]
        force.regressor[k - first] = of_one
        whole += table.value[k] * of_one
    if f == SIDE:
        turning = (
            scale
            * forces.sideslip_rate_coefficient
            * forces.rate[SIDE]
            * forces.span
            / (2.0 * measured.y[AIRSPEED])
        )
        force.regressor[last - first] = turning
        whole += turning
    force.regressor[force.n - 1], force.model = whole, whole
    if forces.n_updates == 0:
        force.column_predicted[:] = force.column
    for s in range(u.size):
        force.effect[s] = force.column_predicted[s] * u[s]
    force.innovation = measured.force[1 + f] * forces.per_chord - whole
    by_pressure = whole * forces.pressure_noise / measured.y[QDYN]
    for k in range(2):
        force.jitter[k] = (
            force.trim_variance[k] * forces.pressure_ratio**2
            + by_pressure * by_pressure
            + force.accelerometer_variance
        )


@kernel
def fill_flow_rates(forces, measured):
    """Fill `rate` with d beta / dt and d alpha / dt in still air, rad/s.

    They follow from accelerometers, rates, attitude and flow.
    """
    gravity, x, a = forces.gravity, measured.x, measured.force
    phi, theta = measured.attitude[0], measured.attitude[1]
    alpha, beta, V = measured.y[ALPHA], measured.y[BETA], measured.y[AIRSPEED]
    ahead, right = np.cos(alpha) * np.cos(beta), np.sin(beta)
    down = np.sin(alpha) * np.cos(beta)
    pull = a[0] - gravity * np.sin(theta)
    push = a[1] + gravity * np.cos(theta) * np.sin(phi)
    fall = a[2] + gravity * np.cos(theta) * np.cos(phi)
    faster = ahead * pull + right * push + down * fall
    sideways = push + V * (x[0] * down - x[2] * ahead)
    forces.rate[SIDE] = (sideways - faster * right) / (V * np.cos(beta))
    forwards, downwards = pull + V * (x[2] * right - x[1] * down), fall + V * (x[1] * ahead - x[0] * right)
    forces.rate[NORMAL] = (downwards * np.cos(alpha) - forwards * np.sin(alpha)) / (V * np.cos(beta))


def force_terms(aircraft: Aircraft, f: int) -> list[Term]:
    """The terms of one direction, as `update_force` goes through them."""
    return [term for term in aircraft.measurable_forces if term.coefficient == COMPONENTS[f]]


def configure_forces(fdi: np.void, declared: Declared, trim: Trim, along_y: np.ndarray, dt_s: float) -> None:
    """Fill the record of forces that are `known` from what is declared.

    along_y (3, y.size): the slopes of the angular accelerations with y. dt_s: of a frame.
    """
    y, statistical, aircraft, sensors = trim[1], fdi["statistical"], declared.aircraft, declared.sensors
    forces, air, size = statistical["forces"], statistical["air"], aircraft.geometry
    forces["per_chord"], forces["gravity"] = 1.0 / size.chord_m, air["config"]["gravity"]
    forces["pressure"], forces["pressure_noise"] = y[QDYN], sensors["qdyn"].random
    rates = [t.value for t in aircraft.forces if t.coefficient == "CY" and t.of == ((SIDESLIP_RATE, 1),)]
    forces["span"], forces["sideslip_rate_coefficient"] = size.span_m, sum(rates)
    scale = y[QDYN] * air["config"]["area_per_mass"] * forces["per_chord"]
    errors = sensors.each("random", ("alpha", "beta", "V", *AXES))
    by_airspeed, by_others = _slipstream_noise(y, fdi["bound"]["declared_errors"], sensors)
    for f, (vane, axis) in enumerate(((BETA, 2), (ALPHA, 1))):
        force, terms = forces["component"][f], force_terms(aircraft, f)
        every = scale * _coefficient_slopes(aircraft, COMPONENTS[f], trim)
        slopes, slipstream = every[:-1], every[-1]
        force["vane"], force["vane_roll"] = (-along_y[axis, vane], -slopes[vane]), -along_y[0, vane]
        force["damping"] = slopes[3:]
        total = slopes.copy()
        total[AIRSPEED] += slipstream * by_airspeed
        parts = (total * errors) ** 2
        quiet = parts.sum() + slipstream**2 * by_others
        force["trim_variance"] = quiet, quiet - parts[vane]
        noise = sensors[ACCELEROMETERS[1 + f]].random
        force["accelerometer_variance"] = (forces["per_chord"] * noise) ** 2
        _configure_force_tolerances(force, declared, terms, y, slopes[vane] / scale, f, forces["per_chord"])
        turned = scale * sum(abs(term.value) for term in terms if term.surface)
        force["deflection"] = turned * declared.actuators.deflection_rad
        force["drift"] = _angle_drift(sensors, air["config"]["gravity"], y[AIRSPEED], f)
        drift_intensity = (DRIFT_CHANGE_SHARE * force["drift"]) ** 2 + dt_s * (noise / y[AIRSPEED]) ** 2
        force["drift_intensity"] = slopes[vane] ** 2 * (
            drift_intensity + declared.air.angle_walk(y[AIRSPEED])
        )


def _slipstream_noise(y: np.ndarray, declared_errors: np.void, declared: SensorErrors) -> tuple[float, float]:
    """How dpt moves with the reading of the airspeed, s/m; its variance by those of pressure and power."""
    if not declared_errors["engine"]:
        return 0.0, 0.0
    by_airspeed, by_pressure, per_kw = slipstream_slopes(y, declared_errors["thin_air_kw"])
    power_kw = declared_errors["engine_kw"] / NOISE_LIMIT_SIGMA
    return by_airspeed, float((by_pressure * declared["qdyn"].random) ** 2 + (per_kw * power_kw) ** 2)


def _angle_drift(errors: SensorErrors, gravity: float, airspeed_mps: float, f: int) -> float:
    """How fast the angle that is followed can drift, rad/s. Gravity acts along the path's slope only on the
    incidence, and in full on sideslip."""
    tilt = errors["phi"].steady + errors["theta"].steady
    turning = sum(errors[gyro].steady + TYPICAL_RATE_RAD_S * errors[gyro].slope for gyro in AXES)
    # how far accelerometers can be off across the flow in level flight: that of the axis, and of the one
    # ahead as much as the flow's angle lets it
    own = errors[ACCELEROMETERS[1 + f]]
    across_flow = (
        own.steady + TYPICAL_SLOPE_RAD * errors["ax"].steady + gravity * (own.slope if f == NORMAL else 0.0)
    )
    falls = (
        gravity * tilt * (TYPICAL_SLOPE_RAD if f == NORMAL else 1.0) + EARTH_ACCELERATION_M_S2 + across_flow
    )
    return float(EARTH_RATE_RAD_S + turning + falls / airspeed_mps)


def _configure_force_tolerances(
    force: np.void,
    declared: Declared,
    terms: list[Term],
    y: np.ndarray,
    vane_slope: float,
    f: int,
    per_chord: float,
) -> None:
    """Of each term: that of the coefficients, and what constant errors of vane and pressure do; of the
    accelerometer's bias, m/s2; of the whole."""
    share, errors = declared.coefficients.largest, declared.sensors
    vane, accelerometer = errors["alpha" if f == NORMAL else "beta"], errors[ACCELEROMETERS[1 + f]]
    pressure = errors["qdyn"].steady / y[QDYN] + errors["qdyn"].slope
    for k, term in enumerate(terms):
        force["tolerance"][k] = (share + pressure + vane.slope) * abs(term.value)
        if term.is_constant:
            force["tolerance"][k] += vane.steady * abs(vane_slope)
    n = len(terms)
    if f == SIDE:
        force["tolerance"][n], n = share + RATE_TOLERANCE[declared.air.moves], n + 1
    if accelerometer.steady:
        force["tolerance"][n], force["regressor"][n], n = accelerometer.steady, per_chord, n + 1
    force["tolerance"][n], force["n"] = MASS_TOLERANCE + accelerometer.slope, n + 1


def _force_coefficient(aircraft: Aircraft, name: str, at: Trim) -> float:
    """A force coefficient at x (3,) rad/s, y, u rad."""
    x, y, u = at
    size, V = aircraft.geometry, y[AIRSPEED]
    hats = x * (size.span_m / (2.0 * V), size.chord_m / V, size.span_m / (2.0 * V))
    of = dict(zip(aircraft.surfaces, u, strict=True)) | dict(zip(aircraft.signals, y[4:], strict=True))
    of |= dict(zip(("alpha", "beta", "ph", "qh", "rh", SIDESLIP_RATE), (y[0], y[1], *hats, 0.0), strict=True))
    return float(aircraft.coefficient(name, of))


def _coefficient_slopes(aircraft: Aircraft, name: str, trim: Trim) -> np.ndarray:
    """(7,): its derivatives with alpha, beta (1/rad), airspeed (s/m), rates (s/rad), dpt, by differences."""
    (x, y, u), step = trim, 1e-5
    states = [(x, y + step * e, u) for e in np.eye(3, y.size)]
    states += [(x + step * e, y, u) for e in np.eye(3)]
    states += [(x, y + step * (np.arange(y.size) == DPT), u)]
    here = _force_coefficient(aircraft, name, trim)
    return np.array([(_force_coefficient(aircraft, name, state) - here) / step for state in states])
