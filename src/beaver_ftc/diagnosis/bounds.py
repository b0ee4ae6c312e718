"""The declared uncertainty: the worst case that it allows in xdot.

The design model is a sum of products: inertia coefficient times dynamic pressure times aerodynamic
coefficient times powers of measured signals. If every factor f is known to within e, then

    |prod (f + e) - prod f| <= prod (|f| + |e|) - prod |f|

and the sum of these over the terms bounds |F(truth) - F(measured)| at this state. The sum of prod |f| is the
design model with |f| in place of each factor, and that of prod (|f| + |e|) the same with |f| + |e|: the bound
is the difference of two evaluations of one model. If all errors have one sign, each term reaches its bound.
The same bound serves the isolation estimators: a lost share of a surface multiplies its terms by 1 + theta in
[0, 1], and with them their error.

A gyro's error appears once more, because xdot is computed from the gyro's readings. Its constant part drops
out of the difference. Of the changing part n with |n| <= nbar the filter eps[k+1] = a eps[k] + n[k+1] - n[k]
keeps n[k] - m[k], m[k+1] = a m[k] + (1 - a) n[k]. This is at most nbar[k] plus the filtered nbar: 2 nbar at
any frame rate.

A derived aircraft declares a map of its model's error. The map has a few boxes of states, one inside the
other. Each box has the largest error found in it for surfaces within a share of their travel (stand-ins:
within less). Healthy surfaces are where their commands put them, and a surface that has lost effectiveness
acts like one with a smaller deflection: the bound is that of the share of travel in use. A stuck surface may
be anywhere: the additional error of its share, `extra`, belongs to the hypothesis that it is off its command
(isolation.py). If two surfaces may be off, the bound itself takes the whole travel. Outside all boxes nothing
has been measured, so nothing is concluded.

The same as variances: deviations.py.

Symbols of the kernels (err: of `errors_dtype`, emap: of `map_dtype`, model: the design model):

    x (3,) rad/s, y, u (n,) rad   rates, readings, deflections; in err [0] is the magnitude as measured, [1]
                                  the worst that the errors allow
    eta (3,) rad/s2               bound on the uncertainty
    z (coordinates,)              place in the map: x, then y with the density in place of dynamic pressure
    b, j, k                       box, level of travel, row of time of the map
    s, i                          surface, axis
"""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import exp, log, pi
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_BOXES, MAX_LEVELS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design import LEAST_HEIGHT_M
from beaver_ftc.design.engine import DPT_0, KW_TO_DPT, density_ratio, power_error_kw
from beaver_ftc.design.model import (
    InertiaCoefficients,
    acceleration,
    design_dtype,
    inertia_coefficients,
    mass_of,
    nonlinear_response_from_table,
)
from beaver_ftc.design.table import AIRSPEED, DPT, N_Y, QDYN, evaluate
from beaver_ftc.diagnosis.state import fill
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.sensors import ENGINE, NOISE_LIMIT_SIGMA

Y0 = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
_MIN_V_SHARE = 0.1
# Double precision leaves 1e-16 of a rate below 6 rad/s, divided by a frame of 1 ms or more, and of the terms
# of f + G u, which stay below 100 rad/s2; a few operations each. Where a frame is of fifty instants it leaves
# more, 1e-10: the Earth's rate squared, 5e-9, covers that.
ROUNDING_RAD_S2 = 1e-11
UNMAPPED_ERROR_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
# The same for filters with a covariance, whose noise is 1e-4: above the acceleration of any aircraft.
OFF_MAP_RAD_S2 = 100.0
_EDGE = 1e-9
N_MAP_COORDINATES = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@sized
def errors_dtype(n: int) -> np.dtype:
    """The declared errors beyond the published bound, of an aircraft with n surfaces."""
    return record(
        given=int,
        # error of a signal: offset + slope |signal|
        e0=7, e1=7,
        steady=3,  # of the offset of a gyro, what does not change
        wg=3,
        du0=float, du=n,  # of a deflection, rad: not by its actuator; all of it now
        # of the air's rotation, rad/s: above 2000 ft; below 1000 ft, times the root of the height in m; how
        # far the reading of the altitude can be off: offset, m, and slope
        wg_aloft=float, wg_1m=float, h0=float, h1=float,
        # of dpt: see `slipstream_bound`
        engine=int, kw0=float, kw1=float,
        # the design model of magnitudes [0], and of the largest magnitudes that the errors allow [1]
        model=(design_dtype(n), 2),
        # the same of rates, also relative to the air, of readings and deflections; what the models give there
        x=(2, 3), x_air=(2, 3), y=(2, N_Y), u=(2, n), f=(2, 3), G=(2, 3, n), F=(2, 3), eG=(3, n),
    )  # fmt: skip


@sized
def map_dtype(n: int, boxes: int = MAX_BOXES) -> np.dtype:
    """The map of the error of an aircraft's model, with n surfaces.

    one_free: one surface may be anywhere in its travel; two_free: more than one may. lo, hi: ends of each
    box; share: of the travel, by level; e: error by row of time, box, level and axis, rad/s2. outside:
    whether the state is outside all boxes; box, row: where it is in the map; e_now: error there, rad/s2.
    u_old: deflections in the frame before, rad. yaw, yaw_now: bound on the yawing moment of healthy engines,
    by box and here.
    """
    return record(
        n_boxes=int, n_levels=int, n_rows=int, one_free=int, two_free=int, outside=int, box=int, row=int,
        time_s=float, until_s=MAX_AGES, lo=(boxes, N_MAP_COORDINATES), hi=(boxes, N_MAP_COORDINATES),
        share=MAX_LEVELS, e=(MAX_AGES, boxes, MAX_LEVELS, 3), stop_lo=n, stop_hi=n, u_old=n,
        coordinates=N_MAP_COORDINATES, e_now=3, yaw=boxes, yaw_now=float,
    )  # fmt: skip


@sized
def bound_dtype(n: int, boxes: int = MAX_BOXES) -> np.dtype:
    """Bounds on the uncertainty.

    eta_bar, eta_now: over the elapsed frame and at this instant, rad/s2. n_gyro, n_old: on the changing part
    of a gyro's error now and a frame ago, rad/s. nu_max: on the innovation of one frame, rad/s2. eG, eGu: on
    the error of each surface's own terms in the acceleration, per rad of deflection (rad/s2 per rad) and at
    the command (rad/s2), means over the frame. extra: by how much the map's error with a surface at each
    share of its travel exceeds that in eta_bar.
    """
    return record(
        inertia_coupling_error_share=3, const=3, earth_rate_rad_s=float, declared_errors=errors_dtype(n),
        error_map=map_dtype(n, boxes), eta_bar=3, eta_now=3, n_gyro=3, n_old=3, nu_max=3, has_eG=int,
        eG=(3, n), eGu=(3, n), extra=(MAX_LEVELS, 3),
    )  # fmt: skip


def fill_map(emap: np.void, aircraft: Aircraft, one_free: bool, two_free: bool) -> None:
    """Write the map of the aircraft, if it has one; one_free, two_free: see `map_dtype`."""
    declared = aircraft.file.model_error_map
    if declared is None:
        return
    n_levels, n_rows = len(declared.travel_share), len(declared.until_s)
    share = np.array([declared.stand_ins if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces])
    lo, hi = np.transpose([(travel.min_rad, travel.max_rad) for travel in aircraft.travel.values()])
    fill(
        emap, one_free=one_free, two_free=two_free, n_boxes=len(declared.boxes), n_levels=n_levels,
        n_rows=n_rows, stop_lo=share * lo, stop_hi=share * hi,
    )  # fmt: skip
    emap["until_s"][:n_rows] = declared.until_s
    emap["share"][:n_levels] = declared.travel_share
    for b, box in enumerate(declared.boxes):
        ends = np.transpose(box.ends(aircraft.signals))
        emap["lo"][b, : ends.shape[1]], emap["hi"][b, : ends.shape[1]] = ends
        tables = box.error_p_rad_s2, box.error_q_rad_s2, box.error_r_rad_s2
        emap["e"][:n_rows, b, :n_levels] = np.stack(tables, axis=-1)
        emap["yaw"][b] = box.engines_apart or 0.0


@kernel
def reading_bound(err, j, y):
    """(e0 + e1 |y|) / (1 - e1): bound on the error of reading j, in its unit."""
    return (err.e0[j] + err.e1[j] * abs(y)) / (1.0 - err.e1[j])


@kernel
def n_gyro(err, i, x):
    """e0 - steady + e1 (|x| + e): bound on the changing error of gyro i, rad/s: noise, resolution, slope."""
    n0 = err.e0[i] - err.steady[i]
    return n0 + err.e1[i] * (abs(x) + reading_bound(err, i, x))


@kernel
def slipstream_bound(err, y):
    """Bound the error of dpt = a + b P / (qdyn V) [FDC], computed from the engine's instruments and the air
    data.

        grown b kW / (q V) + (grown - 1) |dpt - a|,   grown = 1 / ((1 - eq) (1 - eV)),   kW = kw0 + kw1 rho d

    eq, eV, rho: relative errors of dynamic pressure, airspeed and density. kw0: error of the power by the
    instruments, kW; kw1: by the density, for all of it; d: density over that at sea level.
    """
    eq = reading_bound(err, Y0 + QDYN, y[QDYN]) / y[QDYN]
    eV = reading_bound(err, Y0 + AIRSPEED, y[AIRSPEED]) / y[AIRSPEED]
    grown = 1.0 / ((1.0 - min(eq, 0.9)) * (1.0 - min(eV, 0.9)))
    rho = (1.0 + eq) / (1.0 - min(eV, 0.9)) ** 2 - 1.0
    kw = err.kw0 + err.kw1 * rho * density_ratio(y)
    return grown * KW_TO_DPT * kw / (y[QDYN] * y[AIRSPEED]) + (grown - 1.0) * abs(y[DPT] - DPT_0)


@kernel
def fill_magnitudes(err, x, y, u):
    """Fill x, y, u with |signal| as measured, and with the largest |signal| that the errors allow; for
    airspeed, the smallest. x_air: these rates with the air's rotation.
    """
    for v in range(2):
        for i in range(3):
            err.x[v, i] = abs(x[i]) + v * reading_bound(err, i, x[i])
            err.x_air[v, i] = err.x[v, i] + v * err.wg[i]
        for i in range(y.size):
            err.y[v, i] = abs(y[i]) + (v * reading_bound(err, Y0 + i, y[i]) if i < DPT else 0.0)
        for s in range(u.size):
            err.u[v, s] = abs(u[s]) + v * err.du[s]
    if err.engine:
        err.y[1, DPT] += slipstream_bound(err, y)
    V = y[AIRSPEED]
    err.y[1, AIRSPEED] = max(2.0 * V - err.y[1, AIRSPEED], _MIN_V_SHARE * V)


@kernel
def add_declared_bound(err, x, y, u, eta):
    """Add to eta the bound by the declared errors, and fill eG, that on the effect of each surface, per rad.

        eta <- eta + F_1 - F_0      eG = G_1 - G_0      F = f + G u

    F_0, F_1: the design model of magnitudes, at the magnitudes as measured and at the largest possible ones.
    """
    fill_magnitudes(err, x, y, u)
    for v in range(2):
        evaluate(err.model[v].moments, err.x_air[v], err.y[v])
        nonlinear_response_from_table(err.model[v], err.x[v], err.y[v], err.f[v], err.G[v])
        acceleration(err.f[v], err.G[v], err.u[v], err.F[v])
    for i in range(3):
        eta[i] += err.F[1, i] - err.F[0, i]
        for s in range(u.size):
            err.eG[i, s] = err.G[1, i, s] - err.G[0, i, s]


@kernel
def is_between(lo, z, hi):
    """lo <= z <= hi, but for rounding."""
    slack = _EDGE * (1.0 + abs(z))
    return lo - slack <= z <= hi + slack


@kernel
def in_box(emap, b):
    """Whether the state is in box b of the map."""
    for i in range(emap.coordinates.size):
        if not is_between(emap.lo[b, i], emap.coordinates[i], emap.hi[b, i]):
            return False
    return True


@kernel
def outside_span(emap, i):
    """Whether coordinate i of the state is outside the range that the boxes span together."""
    lo, hi = np.inf, -np.inf
    for b in range(emap.n_boxes):  # compiled code with a reduction of an array loads scipy.linalg
        lo, hi = min(lo, emap.lo[b, i]), max(hi, emap.hi[b, i])
    return not is_between(lo, emap.coordinates[i], hi)


@kernel
def travel_share(emap, s, u):
    """The share of its travel that surface s uses at u rad; 1 if it has no travel there."""
    if u == 0.0:
        return 0.0
    stop = emap.stop_hi[s] if u > 0.0 else emap.stop_lo[s]
    return u / stop if stop != 0.0 else 1.0


@kernel
def level_of_positions(emap, u, du):
    """Index of the least share of the travel that covers surfaces within du of u; the last index if all of
    the travel may be used."""
    if emap.two_free:
        return emap.n_levels - 1
    share = 0.0
    for s in range(u.size):
        for end in (u[s] - du[s], u[s] + du[s]):
            share = max(share, travel_share(emap, s, end))
    return level_of_share(emap, share)


@kernel
def level_of_share(emap, share):
    """Index of the least share of the travel in the map that is not below `share`; else the last."""
    last = emap.n_levels - 1
    for j in range(last):
        if share <= emap.share[j]:
            return j
    return last


@kernel
def share_used(emap, s, between, before, n):
    """The largest share of its travel that surface s can use at any of n instants of a frame.

    between: (low, high) rad, of the mean position over the instants; before: the share at the start of the
    frame, where the surface may still be at the first instant.
    """
    share = max(travel_share(emap, s, between[0]), travel_share(emap, s, between[1]))
    if n > 1:
        share = max(before, (n * share + before) / (n - 1))
    return min(share, 1.0)


@kernel
def map_row(emap):
    """The row of the map for the present flight time, -1 if the map ends before."""
    for k in range(emap.n_rows):
        if emap.time_s <= emap.until_s[k]:
            return k
    return -1


@kernel
def look_up_map(emap, x, y, u, du):
    """Fill z and e_now, the mapped error at this state."""
    z = emap.coordinates
    z[:3], z[3 : 3 + y.size] = x, y
    z[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])
    j = level_of_positions(emap, u, du)
    k = map_row(emap)
    for b in range(emap.n_boxes if k >= 0 else 0):
        if in_box(emap, b):
            emap.outside = 0
            emap.e_now[:] = emap.e[k, b, j]
            emap.box, emap.row = (b, k)
            emap.yaw_now = emap.yaw[b]
            return
    emap.outside = 1
    emap.e_now[:] = UNMAPPED_ERROR_RAD_S2
    emap.yaw_now = UNMAPPED_ERROR_RAD_S2


@kernel
def extra_bound(emap, j, i):
    """By how much the mapped error of axis i at this instant is larger if a surface is at level j of travel,
    rad/s2.
    """
    if emap.outside:
        return 0.0
    return max(emap.e[emap.row, emap.box, j, i] - emap.e_now[i], 0.0)


@kernel
def add_published_bound(x, model, share, const, earth, eta):
    """Add to eta the published bound, and what the Earth's rotation adds.

        eta_i <- eta_i + share_i |cross_i| + const_i + earth ((1 + k) (|p| + |q| + |r|) + k earth) + rounding

    [Zhang2005, sec. VII] for the first two. JSBSim integrates rates against inertial space and reports them
    against the Earth: the difference turns with the body, at no more than earth |x| on any axis. k >= 1: the
    largest sum, over an axis, of the factors by which the inertia coupling multiplies products of rates.
    """
    p, q, r = x[0], x[1], x[2]
    w = abs(p) + abs(q) + abs(r)
    cross = model.Pqr * q * r, model.Qpr * p * r, model.Rpq * p * q
    factor = (
        abs(model.Ppq) + abs(model.Pqr),
        abs(model.Qpr) + 2.0 * max(abs(model.Qpp), abs(model.Qrr)),
        abs(model.Rpq) + abs(model.Rqr),
    )
    for i in range(3):
        k = max(factor[i], 1.0)
        eta[i] += share[i] * abs(cross[i]) + const[i] + earth * ((1.0 + k) * w + k * earth) + ROUNDING_RAD_S2


@kernel
def least_height(h, h0, h1):
    """h - (h0 + h1 |h|) / (1 - h1): the least true height, m, for a reading h whose error is up to h0 + h1
    |truth|.

    The ground is at sea level; the model of turbulence has no height below LEAST_HEIGHT_M.
    """
    return max(h - (h0 + h1 * abs(h)) / (1.0 - h1), LEAST_HEIGHT_M)


@kernel
def set_air_rotation(err, h):
    """Set the bound on the air's rotation, rad/s, for altitude h, m."""
    if err.wg_1m > 0.0:
        least = least_height(h, err.h0, err.h1)
        err.wg[:] = max(err.wg_aloft, err.wg_1m / np.sqrt(least))


@kernel
def fill_bound(bound, model, meas, u):
    """Fill eta_now, the bound on the uncertainty at this instant."""
    x, y, err, emap, eta = meas.x, meas.y, bound.declared_errors, bound.error_map, bound.eta_now
    eta[:] = 0.0
    if err.given:
        set_air_rotation(err, meas.altitude)
        add_declared_bound(err, x, y, u, eta)
    else:
        err.x[1, :] = x
    if emap.n_boxes > 0:
        look_up_map(emap, x, y, u, err.du)
        for i in range(3):
            eta[i] += emap.e_now[i]
    share, const, earth = bound.inertia_coupling_error_share, bound.const, bound.earth_rate_rad_s
    add_published_bound(err.x[1], model, share, const, earth, eta)


GUST_LIMIT_SIGMA = 6.0  # exceeded once in 5e8 independent samples
_INERTIA_NAMES = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
POLE_DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


@lru_cache(maxsize=64)
def inertia_bounds(tol: float, mass: MassProperties) -> np.ndarray:
    """Largest change of the twelve inertia coefficients for every inertia within its tolerance.

    Each coefficient is monotonic in each inertia while the others are constant, so the largest change is at a
    corner.
    """
    nominal = np.array(inertia_coefficients(mass))
    worst = np.zeros(12)
    for signs in product((-1.0, 1.0), repeat=4):
        inertias = {
            name: getattr(mass, name) * (1 + tol * sign)
            for name, sign in zip(_INERTIA_NAMES, signs, strict=True)
        }
        changed = np.array(inertia_coefficients(replace(mass, **inertias)))
        worst = np.maximum(worst, np.abs(changed - nominal))
    worst.flags.writeable = False  # kept: the same for every flight of a design
    return worst


def configure_bound(bound: np.void, declared: Declared, model: np.void) -> None:
    """Fill in the declared bound and the error of the aircraft's design model: its map, or else one constant
    for all states. model: its record.
    """
    aircraft, all_types = declared.aircraft, declared.fdi.fault_class == "all"
    const = np.array(declared.constant_rad_s2)
    if aircraft.file.model_error_map is None:
        const += aircraft.model_error_rad_s2
    fill_map(bound["error_map"], aircraft, all_types, all_types and declared.fdi.pairs)
    err = bound["declared_errors"]
    fill_errors(err, declared, model, mass_of(declared.design_model, aircraft))
    fill_engine_errors(err, declared)
    fill(
        bound, inertia_coupling_error_share=declared.coupling, earth_rate_rad_s=EARTH_RATE_RAD_S, const=const,
        has_eG=err["given"] and all_types,
    )  # fmt: skip


def fill_errors(err: np.void, declared: Declared, model: np.void, mass: MassProperties) -> None:
    """Fill the declared errors; model, mass: record and mass properties of the design model."""
    errors, air, b = declared.sensors, declared.air, declared.aircraft.geometry.span_m
    aloft = GUST_LIMIT_SIGMA * air.rotation_limit_rad_s(b)
    dC = declared.coefficients.absolute(declared.aircraft.moments, model["moments"]["value"])
    dI, du = inertia_bounds(declared.inertia, mass), declared.deflections_rad
    err["model"] = model
    err["model"]["moments"]["value"] = np.abs(model["moments"]["value"])
    err["model"]["moments"]["value"][1, : dC.size] += dC
    for name, e in zip(InertiaCoefficients._fields, dI, strict=True):
        err["model"][name] = abs(model[name]) + np.array([0.0, e])
    known = errors.is_ideal and declared.servo_errors.is_none
    fill(
        err, du=du, du0=declared.deflection_rad, wg=aloft, wg_aloft=aloft,
        wg_1m=GUST_LIMIT_SIGMA * air.low_rotation_limit_rad_s(b),
        h0=errors["altitude"].worst, h1=errors["altitude"].slope,
        e0=errors.each("worst"), e1=errors.each("slope"), steady=errors.each("steady", AXES),
        given=not known or any(np.any(e) for e in (dC, dI, du, np.array(aloft))),
    )  # fmt: skip


def fill_engine_errors(err: np.void, declared: Declared) -> None:
    """Fill in the errors of dpt if errors are declared of an instrument from which dpt is computed.

    The engine may have any setting between the initial one and its highest manifold pressure.
    """
    errors = declared.sensors
    erring = any(not getattr(errors.declared, name).is_ideal for name in OF_THE_SLIPSTREAM)
    if not (erring and declared.aircraft.has_engine_instruments):
        return
    initial: Any = declared.initial
    inhg = declared.aircraft.engine.settings["manifold_pressure_inhg"].range[1]
    largest = dict(zip(ENGINE, (initial.engine_rpm, inhg), strict=True))
    bounds = [errors[name].of_reading(reading) for name, reading in largest.items()]
    kw0, kw1 = power_error_kw(initial.engine_rpm, inhg, *bounds)
    fill(err, engine=1, kw0=kw0, kw1=kw1)


def poles_for_delays(errors: SensorErrors, eta: float) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of POLE_DELAYS_S, despite gyro noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta / lam + 2 nbar. The excess of
    one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    n2 = 2 * NOISE_LIMIT_SIGMA * float(errors.each("noise", AXES).max())
    return tuple(_pole_for_delay(T, n2, eta) for T in POLE_DELAYS_S) if n2 > 0 else ()


def _pole_for_delay(T: float, n2: float, eta: float) -> float:
    phi = eta + 8.0 * n2 / T
    for _ in range(50):
        lam = max(log(phi * T / n2) / T, 0.1 / T)
        phi = (n2 * lam + eta) / (1.0 - exp(-lam * T))
    return lam


DEFAULT_RATE_RAD_S = pi / 3.0  # of an actuator with no declared rate limit: the aircraft's default


def servo_data(declared: Declared) -> dict[str, np.ndarray]:
    """The declared actuators and their errors, (surfaces,) each, by the names of `DeclaredErrors`."""
    servos, off = (
        [getattr(of, s) for s in declared.aircraft.surfaces]
        for of in (declared.servos, declared.servo_errors)
    )
    return {
        "bandwidth_rad_s": np.array([servo.bandwidth_rad_s for servo in servos]),
        "rate_limit_rad_s": np.radians([servo.rate_limit_deg_s for servo in servos]),
        "bandwidth_error": np.array([error.bandwidth for error in off]),
        "rate_limit_error": np.array([error.rate_limit for error in off]),
        "dead_band_rad": np.radians([error.dead_band_deg for error in off]),
    }
