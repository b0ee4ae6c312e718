"""The declared uncertainty: the worst case that it allows in xdot, and the same as variances.

The design model is a sum of products: inertia coefficient times dynamic pressure times aerodynamic
coefficient times powers of measured signals. If every factor f is known to within e, then

    |prod (f + e) - prod f| <= prod (|f| + |e|) - prod |f|

and the sum of these over the terms bounds |F(truth) - F(measured)| at this state. If all errors have one
sign, each term reaches its bound. The same bound serves the isolation estimators: a lost share of a surface
multiplies its terms by 1 + theta in [0, 1], and with them their error.

A gyro's error appears once more, because xdot is computed from the gyro's readings. Its constant part drops
out of the difference. Of the changing part n with |n| <= nbar the filter eps[k+1] = a eps[k] + n[k+1] - n[k]
keeps n[k] - m[k], m[k+1] = a m[k] + (1 - a) n[k]. This is at most nbar[k] plus the filtered nbar: 2 nbar at
any frame rate.

A derived aircraft declares a map of its model's error. The map has a few boxes of states, one inside the
other. Each box has the largest error found in it for surfaces within a share of their travel (stand-ins:
within less). Healthy surfaces are where their commands put them, and a surface that has lost effectiveness
acts like one with a smaller deflection: the bound is that of the share of travel in use. A stuck surface may
be anywhere: the additional error of its share, `further_error`, belongs to the hypothesis that it is off its
command (isolation.py). If two surfaces may be off, the bound itself takes the whole travel. Outside all boxes
nothing has been measured, so nothing is concluded.

Variances: for plug-ins, and for the filters and tests of the statistical detector.
"""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import exp, hypot, log, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties, Term
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, MOMENTS
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_BOXES, MAX_LEVELS, MAX_MONOMIALS, MAX_TERMS, RATE_SIGNALS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.air import LEAST_HEIGHT_M
from beaver_ftc.design.context import DeclaredErrors, DesignFunctions
from beaver_ftc.design.model import (
    AIRSPEED,
    DPT,
    DPT_0,
    KW_TO_DPT,
    N_SIGNALS,
    N_Y,
    PH,
    QDYN,
    QH,
    RH,
    coefficient_slopes,
    density_ratio,
    inertia_coefficients,
    jacobian,
    mass_of,
    monomials,
    power_error_kw,
    signals,
)
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.scenario.airframe import Actuators
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.sensors import ENGINE, NOISE_LIMIT_SIGMA

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
_LEAST_AIRSPEED_SHARE = 0.1
# Double precision leaves 1e-16 of a rate below 6 rad/s, divided by a frame of 1 ms or more, and of the terms
# of f + G u, which stay below 100 rad/s2; a few operations each. Where a frame is of fifty instants it leaves
# more, 1e-10: the Earth's rate squared, 5e-9, covers that.
ROUNDING_RAD_S2 = 1e-11
UNKNOWN_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
# The same for filters with a covariance, whose noise is 1e-4: above the acceleration of any aircraft.
UNKNOWN_IN_FILTERS_RAD_S2 = 100.0
_ROUNDING = 1e-9
N_PLACES = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@sized
def declared_errors_dtype(n: int) -> np.dtype:
    """The declared errors beyond the published bound, of an aircraft with n surfaces."""
    return record(
        any=int,
        tolerance=MAX_TERMS,  # of each moment coefficient, as the design model has them
        inertia=12,  # of each inertia coefficient, in the order of design.model
        offset=7, slope=7,  # error of a signal: offset + slope |signal|
        steady=3,  # of the offset of a gyro, what does not change
        gust=3, deflection=float,
        # of the air's rotation, rad/s: above 2000 ft; below 1000 ft, times the root of the height in m; how
        # far the reading of the altitude can be off, m, and as a share
        gust_aloft=float, gust_low=float, altitude_off=float, altitude_slope=float,
        engine=int, engine_kw=float, thin_air_kw=float,  # of dpt: see `slipstream_error`
        # scratch: magnitudes as measured, and as large as they can be
        measured_x=3, measured_y=N_Y, measured_u=n, largest_x=3, largest_y=N_Y, largest_u=n, largest_aero=3,
        signal=N_SIGNALS,
        near=MAX_MONOMIALS, far=MAX_MONOMIALS, per_rad=(3, n), moment=3, slack=3,
    )  # fmt: skip


@sized
def error_map_dtype(n: int, boxes: int = MAX_BOXES) -> np.dtype:
    """The map for an aircraft with n surfaces. anywhere: one surface may be, or, whole, more. outside: of all
    boxes; box, age: where this is in the map. before: the surfaces in the frame before, rad. now: the error
    here, rad/s2. apart: `engines_apart`."""
    return record(
        n_boxes=int, n_levels=int, n_ages=int, anywhere=int, whole=int, outside=int, box=int, age=int,
        time_s=float, until_s=MAX_AGES, low=(boxes, N_PLACES), high=(boxes, N_PLACES), share=MAX_LEVELS,
        error=(MAX_AGES, boxes, MAX_LEVELS, 3), travel_low=n, travel_high=n, before=n, place=N_PLACES, now=3,
        apart=boxes, apart_now=float,
    )  # fmt: skip


@sized
def bound_dtype(n: int, boxes: int = MAX_BOXES) -> np.dtype:
    """Bounds on the uncertainty. eta_bar, eta_bar_now: over the elapsed frame and at this instant, rad/s2.
    noise: on what a gyro's error changes by, rad/s. frame: on one frame's innovation, rad/s2. own: of the
    errors of n surfaces' own terms, per rad of deflection and at the command, means over the frame. beyond:
    by how much the map's error with a surface at each share of its travel exceeds that in eta_bar."""
    return record(
        inertia=3, constant=3, earth_rate=float, declared_errors=declared_errors_dtype(n),
        error_map=error_map_dtype(n, boxes), eta_bar=3, eta_bar_now=3, noise=3, noise_before=3, frame=3,
        has_surface_errors=int, surface_error_per_rad=(3, n), own=(3, n), further_error=(MAX_LEVELS, 3),
    )  # fmt: skip


def fill_error_map(error_map: np.void, aircraft: Aircraft, anywhere: bool, whole: bool) -> None:
    """Write an aircraft's map, if it has one; anywhere: one surface may be, in its travel; whole: more."""
    given = aircraft.file.model_error_map
    if given is None:
        return
    n_levels, n_ages = len(given.travel_share), len(given.until_s)
    error_map["anywhere"], error_map["whole"], error_map["n_boxes"] = anywhere, whole, len(given.boxes)
    error_map["n_levels"], error_map["n_ages"] = n_levels, n_ages
    error_map["until_s"][:n_ages], error_map["share"][:n_levels] = given.until_s, given.travel_share
    least = np.array([given.stand_ins if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces])
    error_map["travel_low"] = least * [travel.min_rad for travel in aircraft.travel.values()]
    error_map["travel_high"] = least * [travel.max_rad for travel in aircraft.travel.values()]
    for k, box in enumerate(given.boxes):
        ends = np.array(box.ends(aircraft.signals))
        error_map["low"][k, : len(ends)], error_map["high"][k, : len(ends)] = ends.T
        errors = box.error_p_rad_s2, box.error_q_rad_s2, box.error_r_rad_s2
        error_map["error"][:n_ages, k, :n_levels] = np.stack(errors, axis=-1)
        error_map["apart"][k] = box.engines_apart or 0.0


@kernel
def reading_error(declared_errors, i, reading):
    """How far the truth of signal i can be from its reading."""
    return (declared_errors.offset[i] + declared_errors.slope[i] * abs(reading)) / (
        1.0 - declared_errors.slope[i]
    )


@kernel
def changing_gyro_error(declared_errors, i, reading):
    """How far gyro i can be off, rad/s, but for a constant: noise, resolution, slope times the true rate."""
    changing = declared_errors.offset[i] - declared_errors.steady[i]
    return changing + declared_errors.slope[i] * (abs(reading) + reading_error(declared_errors, i, reading))


@kernel
def slipstream_error(declared_errors, y):
    """How far dpt can be off that is worked out from the engine's instruments and the air data.

    dpt = a + b P / (qdyn V) [FDC]: the power's error, by the instruments engine_kw and by the density
    thin_air_kw for all of it; and the share that dynamic pressure and airspeed are off.
    """
    pressure = reading_error(declared_errors, _AIR_DATA + QDYN, y[QDYN]) / y[QDYN]
    speed = reading_error(declared_errors, _AIR_DATA + AIRSPEED, y[AIRSPEED]) / y[AIRSPEED]
    stretch = 1.0 / ((1.0 - min(pressure, 0.9)) * (1.0 - min(speed, 0.9)))
    density = (1.0 + pressure) / (1.0 - min(speed, 0.9)) ** 2 - 1.0
    power_kw = declared_errors.engine_kw + declared_errors.thin_air_kw * density * density_ratio(y)
    return stretch * KW_TO_DPT * power_kw / (y[QDYN] * y[AIRSPEED]) + (stretch - 1.0) * abs(y[DPT] - DPT_0)


@kernel
def fill_magnitudes(declared_errors, x, y, u):
    """Fill the scratch with |signal| as measured and as large as it may be; for airspeed, as small."""
    for i in range(3):
        declared_errors.measured_x[i] = abs(x[i])
        declared_errors.largest_x[i] = abs(x[i]) + reading_error(declared_errors, i, x[i])
        declared_errors.largest_aero[i] = declared_errors.largest_x[i] + declared_errors.gust[i]
    for i in range(DPT):
        declared_errors.measured_y[i] = abs(y[i])
        declared_errors.largest_y[i] = abs(y[i]) + reading_error(declared_errors, _AIR_DATA + i, y[i])
    for i in range(DPT, y.size):
        declared_errors.measured_y[i] = declared_errors.largest_y[i] = abs(y[i])
    if declared_errors.engine:
        declared_errors.largest_y[DPT] += slipstream_error(declared_errors, y)
    for s in range(u.size):
        declared_errors.measured_u[s] = abs(u[s])
        declared_errors.largest_u[s] = abs(u[s]) + declared_errors.deflection
    V = y[AIRSPEED]
    declared_errors.largest_y[AIRSPEED] = max(
        2.0 * V - declared_errors.largest_y[AIRSPEED], _LEAST_AIRSPEED_SHARE * V
    )


@kernel
def fill_moments(declared_errors, design):
    """Fill moment (3,), the sum of the magnitudes of a moment's terms, and slack (3,), their error; N m."""
    near_q, far_q = declared_errors.measured_y[QDYN], declared_errors.largest_y[QDYN]
    table = design.moments
    for i in range(3):
        near, far = 0.0, 0.0
        for k in range(table.free_from[i], table.surface_to[i]):
            size, s = abs(table.value[k]), table.surface[k]
            near += (
                size
                * declared_errors.near[table.monomial[k]]
                * (declared_errors.measured_u[s] if s >= 0 else 1.0)
            )
            largest = declared_errors.far[table.monomial[k]] * (
                declared_errors.largest_u[s] if s >= 0 else 1.0
            )
            far += (size + declared_errors.tolerance[k]) * largest
        arm = design.S * (design.c if i == 1 else design.b)
        declared_errors.moment[i] = arm * near_q * near
        declared_errors.slack[i] = arm * (far_q * far - near_q * near)


@kernel
def product_error(size, tolerance, near, far):
    """Error of a coefficient times a signal."""
    return (abs(size) + tolerance) * far - abs(size) * near


@kernel
def moment_error(declared_errors, i, size, tolerance):
    """Error of an inertia coefficient times moment i."""
    near = declared_errors.moment[i]
    return product_error(size, tolerance, near, near + declared_errors.slack[i])


@kernel
def rate_product_error(declared_errors, i, j, size, tolerance):
    """Error of an inertia coefficient times rates i and j."""
    near, far = declared_errors.measured_x, declared_errors.largest_x
    return product_error(size, tolerance, near[i] * near[j], far[i] * far[j])


@kernel
def moment_per_rad(declared_errors, design, i, s):
    """Of moment i, what surface s adds per rad: its magnitude, and with all errors; N m."""
    near, far = 0.0, 0.0
    table = design.moments
    for k in range(table.free_to[i], table.surface_to[i]):
        if table.surface[k] == s:
            size = abs(table.value[k])
            near += size * declared_errors.near[table.monomial[k]]
            far += (size + declared_errors.tolerance[k]) * declared_errors.far[table.monomial[k]]
    arm = design.S * (design.c if i == 1 else design.b)
    return arm * declared_errors.measured_y[QDYN] * near, arm * declared_errors.largest_y[QDYN] * far


@kernel
def fill_error_per_rad(declared_errors, design, s):
    """Fill per_rad (3, s) rad/s2 per rad: what the declared errors can do to the effect of surface s.

    The bound is affine in |u_s|; this is its slope. `add_declared_errors` comes first.
    """
    t, per_rad = declared_errors.inertia, declared_errors.per_rad
    roll, roll_far = moment_per_rad(declared_errors, design, 0, s)
    pitch, pitch_far = moment_per_rad(declared_errors, design, 1, s)
    yaw, yaw_far = moment_per_rad(declared_errors, design, 2, s)
    per_rad[0, s] = product_error(design.Pl, t[2], roll, roll_far)
    per_rad[0, s] += product_error(design.Pn, t[3], yaw, yaw_far)
    per_rad[1, s] = product_error(design.Qm, t[7], pitch, pitch_far)
    per_rad[2, s] = product_error(design.Rl, t[10], roll, roll_far)
    per_rad[2, s] += product_error(design.Rn, t[11], yaw, yaw_far)


@kernel
def add_declared_errors(declared_errors, design, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 what the declared errors can do; x (3,), y, u (surfaces,) as measured."""
    fill_magnitudes(declared_errors, x, y, u)
    signals(design.moments, declared_errors.measured_x, declared_errors.measured_y, declared_errors.signal)
    monomials(design.moments, declared_errors.signal, declared_errors.near)
    signals(design.moments, declared_errors.largest_aero, declared_errors.largest_y, declared_errors.signal)
    monomials(design.moments, declared_errors.signal, declared_errors.far)
    fill_moments(declared_errors, design)
    t = declared_errors.inertia
    eta_bar[0] += moment_error(declared_errors, 0, design.Pl, t[2]) + moment_error(
        declared_errors, 2, design.Pn, t[3]
    )
    eta_bar[0] += rate_product_error(declared_errors, 0, 1, design.Ppq, t[0]) + rate_product_error(
        declared_errors, 1, 2, design.Pqr, t[1]
    )
    eta_bar[1] += moment_error(declared_errors, 1, design.Qm, t[7]) + rate_product_error(
        declared_errors, 0, 2, design.Qpr, t[5]
    )
    eta_bar[1] += rate_product_error(declared_errors, 0, 0, design.Qpp, t[4]) + rate_product_error(
        declared_errors, 2, 2, design.Qrr, t[6]
    )
    eta_bar[2] += moment_error(declared_errors, 0, design.Rl, t[10]) + moment_error(
        declared_errors, 2, design.Rn, t[11]
    )
    eta_bar[2] += rate_product_error(declared_errors, 0, 1, design.Rpq, t[8]) + rate_product_error(
        declared_errors, 1, 2, design.Rqr, t[9]
    )


@kernel
def is_inside_box(error_map, k):
    """Whether `place` is in box k."""
    inside = True
    for i in range(error_map.place.size):
        room = _ROUNDING * (1.0 + abs(error_map.place[i]))
        inside = inside and error_map.low[k, i] - room <= error_map.place[i] <= error_map.high[k, i] + room
    return inside


@kernel
def is_outside_all_boxes(error_map, i):
    """Whether quantity i of `place` is outside what any box spans."""
    low, high = np.inf, -np.inf
    for k in range(error_map.n_boxes):
        low, high = min(low, error_map.low[k, i]), max(high, error_map.high[k, i])
    room = _ROUNDING * (1.0 + abs(error_map.place[i]))
    return not low - room <= error_map.place[i] <= high + room


@kernel
def travel_level(error_map, u):
    """The first share of the travel that covers surfaces u (n,) rad; the last if all of it may be used."""
    if error_map.whole:
        return error_map.n_levels - 1
    used = 0.0
    for s in range(u.size):
        if u[s] != 0.0:
            end = error_map.travel_high[s] if u[s] > 0.0 else error_map.travel_low[s]
            used = max(used, u[s] / end) if end != 0.0 else 1.0
    return level_covering(error_map, used)


@kernel
def level_covering(error_map, used):
    """The first level of the map for so large a share of the travel."""
    last = error_map.n_levels - 1
    for j in range(last):
        if used <= error_map.share[j]:
            return j
    return last


@kernel
def travel_share_used(error_map, s, where, before, instants):
    """The largest share of its travel that surface s can use at any of so many instants of a frame.

    where: (low, high) rad, in the mean over them; before: the share as the frame began, where it may be yet
    at the first.
    """
    used, (low, high) = 0.0, where
    if high > 0.0:
        used = high / error_map.travel_high[s] if error_map.travel_high[s] != 0.0 else 1.0
    if low < 0.0:
        used = max(used, low / error_map.travel_low[s] if error_map.travel_low[s] != 0.0 else 1.0)
    if instants > 1:
        used = max(before, (instants * used + before) / (instants - 1))
    return min(used, 1.0)


@kernel
def time_row(error_map):
    """The row for the flight as old as it is, -1 if none was measured so late."""
    for a in range(error_map.n_ages):
        if error_map.time_s <= error_map.until_s[a]:
            return a
    return -1


@kernel
def look_up_map_error(error_map, x, y, u):
    """Fill `place` and `now`, the error measured about this state; x (3,) rad/s, y (4 + declared,), u (n,)
    rad."""
    place = error_map.place
    place[:3], place[3 : 3 + y.size] = x, y
    place[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])
    level, age = travel_level(error_map, u), time_row(error_map)
    for k in range(error_map.n_boxes if age >= 0 else 0):
        if is_inside_box(error_map, k):
            error_map.outside, error_map.now[:] = 0, error_map.error[age, k, level]
            error_map.box, error_map.age = k, age
            error_map.apart_now = error_map.apart[k]
            return
    error_map.outside, error_map.now[:], error_map.apart_now = 1, UNKNOWN_RAD_S2, UNKNOWN_RAD_S2


@kernel
def further_map_error(error_map, j, i):
    """By how much the error of axis i at this instant is larger with a surface at level j, rad/s2."""
    if error_map.outside:
        return 0.0
    return max(error_map.error[error_map.age, error_map.box, j, i] - error_map.now[i], 0.0)


@kernel
def add_map_error(error_map, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 the error measured about this state; x (3,) rad/s, y, u (n,) rad."""
    look_up_map_error(error_map, x, y, u)
    for i in range(3):
        eta_bar[i] += error_map.now[i]


@kernel
def add_published_bound(x, design, inertia, constant, earth_rate, eta_bar):
    """Add to eta_bar (3,) rad/s2 the published bound, and what the Earth's rotation adds.

    Published: inertia_i |cross term_i| + constant_i [Zhang2005, sec. VII]. JSBSim integrates rates against
    inertial space and reports them against the Earth: the difference turns with the body, at no more than
    earth_rate |x| on any axis, and the inertia coupling makes `rate_coupling` times as much of it.
    """
    p, q, r = x[0], x[1], x[2]
    rates = abs(p) + abs(q) + abs(r)
    roll, pitch, yaw = rate_coupling(design)
    eta_bar[0] += (
        inertia[0] * abs(design.Pqr * q * r) + constant[0] + earth_rotation_bound(earth_rate, rates, roll)
    )
    eta_bar[1] += (
        inertia[1] * abs(design.Qpr * p * r) + constant[1] + earth_rotation_bound(earth_rate, rates, pitch)
    )
    eta_bar[2] += (
        inertia[2] * abs(design.Rpq * p * q) + constant[2] + earth_rotation_bound(earth_rate, rates, yaw)
    )


@kernel
def rate_coupling(design):
    """How much of one rate times another the inertia coupling makes on each axis, at most; 1 where it is
    less, as it is of most aircraft."""
    roll, yaw = abs(design.Ppq) + abs(design.Pqr), abs(design.Rpq) + abs(design.Rqr)
    pitch = abs(design.Qpr) + 2.0 * max(abs(design.Qpp), abs(design.Qrr))
    return max(roll, 1.0), max(pitch, 1.0), max(yaw, 1.0)


@kernel
def earth_rotation_bound(earth_rate, rates, share):
    """What the Earth's rotation and rounding add on an axis, rad/s2; rates: |p| + |q| + |r|, rad/s."""
    return earth_rate * ((1.0 + share) * rates + share * earth_rate) + ROUNDING_RAD_S2


@kernel
def lowest_height(altitude, off, slope):
    """The least height, m, that a measured altitude leaves: off by so much and by a share. The ground is at
    sea level; the model of turbulence has no height below LEAST_HEIGHT_M."""
    return max(altitude - (off + slope * abs(altitude)) / (1.0 - slope), LEAST_HEIGHT_M)


@kernel
def set_gust_bound(declared_errors, altitude):
    """Bring the bound on the air's rotation to this altitude, m as measured."""
    if declared_errors.gust_low > 0.0:
        height = lowest_height(altitude, declared_errors.altitude_off, declared_errors.altitude_slope)
        declared_errors.gust[:] = max(declared_errors.gust_aloft, declared_errors.gust_low / np.sqrt(height))


@kernel
def fill_bound_now(bound, design, measured, u):
    """Fill eta_bar_now (3,) rad/s2, the bound on the uncertainty at this instant; u (n,) rad."""
    x, y = measured.x, measured.y
    bound.eta_bar_now[:] = 0.0
    if bound.declared_errors.any:
        set_gust_bound(bound.declared_errors, measured.altitude)
        add_declared_errors(bound.declared_errors, design, x, y, u, bound.eta_bar_now)
        if bound.has_surface_errors:
            for s in range(u.size):
                fill_error_per_rad(bound.declared_errors, design, s)
    if bound.error_map.n_boxes > 0:
        add_map_error(bound.error_map, x, y, u, bound.eta_bar_now)
    far = bound.declared_errors.largest_x if bound.declared_errors.any else x
    add_published_bound(far, design, bound.inertia, bound.constant, bound.earth_rate, bound.eta_bar_now)


GUST_LIMIT_SIGMA = 6.0  # once in 5e8 samples beyond, were they independent
_INERTIA = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
DESIGN_DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


@lru_cache(maxsize=64)
def inertia_coefficient_errors(tolerance: float, mass: MassProperties) -> np.ndarray:
    """Largest change of the twelve inertia coefficients for every inertia within its tolerance.

    Each is monotonic in each inertia as long as the others stay put, so the corners tell.
    """
    nominal = np.array(inertia_coefficients(mass))
    worst = np.zeros(12)
    for signs in product((-1.0, 1.0), repeat=4):
        change = {
            name: getattr(mass, name) * (1 + tolerance * s) for name, s in zip(_INERTIA, signs, strict=True)
        }
        there = np.array(inertia_coefficients(replace(mass, **change)))
        worst = np.maximum(worst, np.abs(there - nominal))
    worst.flags.writeable = False  # kept: the same for every flight of a design
    return worst


def configure_bound(bound: np.void, scenario: "Scenario", declared: Declared, design: np.void) -> None:
    """Fill in the declared bound, and what the aircraft's terms leave: where it is mapped, or everywhere the
    same; design: the designer's record."""
    config, aircraft = scenario.fdi, declared.aircraft
    bound["inertia"], bound["earth_rate"] = declared.coupling, EARTH_RATE_RAD_S
    bound["constant"] = declared.constant_rad_s2
    every_type = config.fault_class == "all"
    fill_error_map(bound["error_map"], aircraft, every_type, whole=every_type and config.pairs)
    if aircraft.file.model_error_map is None:
        bound["constant"] += aircraft.model_error_rad_s2
    declared_errors = bound["declared_errors"]
    fill_declared_errors(declared_errors, declared, design, mass_of(scenario.design_model, aircraft))
    fill_declared_engine_errors(declared_errors, scenario, declared)
    bound["has_surface_errors"] = declared_errors["any"] and every_type


def fill_declared_errors(
    declared_errors: np.void, declared: Declared, design: np.void, mass: MassProperties
) -> None:
    """Fill the record; the design record and mass are the designer's."""
    tolerance = declared.coefficients.absolute(declared.aircraft.moments, design["moments"]["value"])
    declared_errors["tolerance"][: tolerance.size] = tolerance
    declared_errors["inertia"] = inertia_coefficient_errors(declared.inertia, mass)
    declared_errors["deflection"] = declared.actuators.deflection_rad
    errors, air, span_m = declared.sensors, declared.air, declared.aircraft.geometry.span_m
    declared_errors["gust_aloft"] = GUST_LIMIT_SIGMA * air.rotation_limit_rad_s(span_m)
    declared_errors["gust_low"] = GUST_LIMIT_SIGMA * air.low_rotation_limit_rad_s(span_m)
    declared_errors["gust"] = declared_errors["gust_aloft"]
    declared_errors["altitude_off"], declared_errors["altitude_slope"] = (
        errors["altitude"].worst,
        errors["altitude"].slope,
    )
    declared_errors["offset"], declared_errors["slope"] = errors.each("worst"), errors.each("slope")
    declared_errors["steady"] = errors.each("steady", AXES)
    parts = (
        declared_errors["tolerance"],
        declared_errors["inertia"],
        declared_errors["deflection"],
        declared_errors["gust"],
    )
    declared_errors["any"] = any(np.any(part) for part in parts) or not errors.is_ideal


def fill_declared_engine_errors(declared_errors: np.void, scenario: "Scenario", declared: Declared) -> None:
    """Admit errors of dpt where those are declared of which it is worked out.

    The engine may be set anywhere between here and its highest manifold pressure.
    """
    sensors = declared.sensors
    flawed = any(not getattr(sensors.declared, name).is_ideal for name in OF_THE_SLIPSTREAM)
    if not (flawed and declared.aircraft.has_engine_instruments):
        return
    initial: Any = scenario.initial
    highest = declared.aircraft.engine.settings["manifold_pressure_inhg"].range[1]
    largest = dict(zip(ENGINE, (initial.engine_rpm, highest), strict=True))
    errors = [sensors[name].of_reading(most) for name, most in largest.items()]
    declared_errors["engine"] = 1
    declared_errors["engine_kw"], declared_errors["thin_air_kw"] = power_error_kw(
        initial.engine_rpm, highest, *errors
    )


def poles_for_noise(sensors: SensorErrors, constant_rad_s2: float) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of DELAYS_S, despite gyro noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta_bar / lam + 2 nbar. The excess
    of one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    nbar = 2 * NOISE_LIMIT_SIGMA * float(sensors.each("noise", AXES).max())
    return tuple(_pole(delay_s, nbar, constant_rad_s2) for delay_s in DESIGN_DELAYS_S) if nbar > 0 else ()


def _pole(delay_s: float, noise: float, eta_bar: float) -> float:
    phi = eta_bar + 8.0 * noise / delay_s
    for _ in range(50):
        pole = max(log(phi * delay_s / noise) / delay_s, 0.1 / delay_s)
        phi = (noise * pole + eta_bar) / (1.0 - exp(-pole * delay_s))
    return pole


_GYRO_OF = dict(zip(RATE_SIGNALS, AXES, strict=True))


def variances_of(
    declared: Declared, actuators: Actuators, design: np.ndarray, y: np.ndarray, u: np.ndarray
) -> DeclaredErrors:
    """What is declared as a plug-in is given it, of a flight trimmed at y and u rad; design: the designer's
    record, (1,)."""
    aircraft, errors = declared.aircraft, declared.sensors
    noise, bias, resolution = (errors.each(of_it) for of_it in ("noise", "steady", "resolution"))
    coefficients = declared.coefficients.absolute(aircraft.moments, design["moments"]["value"][0])
    rotation, time_s = declared.air.rotation(float(y[2]), aircraft.geometry.span_m)
    air_data = np.sqrt(noise**2 + bias**2 + resolution**2 / 12.0)[_AIR_DATA:]
    deflection_rad = declared.actuators.deflection_rad
    return DeclaredErrors(
        noise=noise,
        bias=bias,
        resolution=resolution,
        slope=errors.each("slope"),
        gust_rad_s=rotation,
        gust_time_s=time_s,
        gust_effect=gust_effect(DesignFunctions(design.copy()), y),
        coefficients=coefficients,
        inertia=declared.inertia,
        deflection_rad=deflection_rad,
        model_rad_s2=model_error_deviation(design, y, u, air_data, coefficients, deflection_rad),
        bandwidth_rad_s=np.array([getattr(actuators, s).bandwidth_rad_s for s in aircraft.surfaces]),
        rate_limit_rad_s=np.radians([getattr(actuators, s).rate_limit_deg_s for s in aircraft.surfaces]),
    )


def gust_effect(model: DesignFunctions, y: np.ndarray) -> np.ndarray:
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates."""
    step = 1e-4
    columns = [(model.f(step * e, y) - model.f(-step * e, y)) / (2.0 * step) for e in np.eye(3)]
    return -np.column_stack(columns)


def model_error_deviation(
    design: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    air_data: np.ndarray,
    coefficients: np.ndarray,
    deflection_rad: float,
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of f + G u at y and u, every error standing for itself.

    air_data (4,): errors of alpha, beta, airspeed, dynamic pressure. coefficients: absolute errors.
    """
    here = _acceleration(design, y, u)
    errors = np.pad(np.diag(air_data), ((0, 0), (0, y.size - air_data.size)))
    apart = [_acceleration(design, y + error, u) - here for error in errors]
    apart += [_acceleration(design, y, u + deflection_rad * e) - here for e in np.eye(u.size)]
    for place in np.flatnonzero(coefficients):
        changed = design.copy()
        changed["moments"]["value"][0][place] += coefficients[place]
        apart.append(_acceleration(changed, y, u) - here)
    return np.sqrt(np.square(apart).sum(axis=0))


def _acceleration(design: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    model = DesignFunctions(design)
    return model.f(np.zeros(3), y) + model.G(y) @ u


def flow_angle_noise(errors: SensorErrors, airspeed_mps: float) -> np.ndarray:
    """Of the flow's angles (2,) against the level axes, as vanes, airspeed and attitude have them, standard
    deviation in rad: what pitch attitude and heading are off turns the flow as much as what a vane is off."""
    through = 0.3  # attitudes and incidences of up to 17 deg
    pairs = (("alpha", "theta"), ("beta", "psi"))
    vanes = [hypot(errors[vane].random, errors[angle].random) for vane, angle in pairs]
    return np.array(vanes) + through * (errors["V"].random / airspeed_mps + errors["phi"].random)


def gust_estimate_noise(
    flow: np.ndarray, design: np.void, y: np.ndarray, u: np.ndarray, span_m: float
) -> np.ndarray:
    """Standard deviation, rad/s2 on each axis, of what noise of the flow's angles (2,) rad adds to a gust."""
    V, b = y[AIRSPEED], span_m
    pitching, yawing = flow * pi * V / (np.array([4.0, 3.0]) * b)
    damping = jacobian(design, np.zeros(3), y, u)[2]  # without rates all of it is aerodynamic
    return np.sqrt((damping[:, 1] * pitching) ** 2 + (damping[:, 2] * yawing) ** 2)


def axis_of_term(term: Term) -> int:
    """The axis of a moment's term."""
    return MOMENTS.index(term.coefficient)


def coefficient_tolerances(
    declared: Declared, design: np.void, mass: MassProperties, y: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Tolerance of each moment's term that covers every declared constant error but those of the air data
    (noise_model.py); y, u in trim."""
    aircraft, errors = declared.aircraft, declared.sensors
    size = np.abs(design["moments"]["value"][: len(aircraft.moments)])
    slack, nominal = inertia_coefficient_errors(declared.inertia, mass), np.abs(inertia_coefficients(mass))
    of_own_axis = (2, 7, 11)  # what multiplies a moment there
    share = np.full(size.shape, max(slack[i] / nominal[i] for i in of_own_axis))
    share += [_measured_share(errors, term) for term in aircraft.moments]
    total = declared.coefficients.absolute(aircraft.moments, size) + share * size
    slopes = np.abs(coefficient_slopes(design, np.zeros(3), y, u))
    span, chord = aircraft.geometry.span_m, aircraft.geometry.chord_m
    for name, place, length in zip(AXES, (PH, QH, RH), (span / 2, chord, span / 2), strict=True):
        error = errors[name].steady * length / y[AIRSPEED]
        for k, term in enumerate(aircraft.moments):
            if term.is_constant:
                total[k] += error * slopes[axis_of_term(term), place]
    return total


def _measured_share(errors: SensorErrors, term: Term) -> float:
    """Relative error of what a term multiplies, by the slopes of gyros, vanes, airspeed and pressure."""
    own = AXES[axis_of_term(term)]  # a gyro's slope is counted once for all terms of its own axis
    share = errors[own].slope + errors["qdyn"].slope
    for signal, power in term.of:
        if signal in _GYRO_OF:
            share += power * errors["V"].slope
        error = errors.get(_GYRO_OF.get(signal, signal))
        if error is not None and _GYRO_OF.get(signal) != own:
            share += power * error.slope
    return share
