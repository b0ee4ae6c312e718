"""What a declared uncertainty of coefficients, inertia, measurements, deflections and air can do to xdot.

The design model is a sum of products: inertia coefficient times dynamic pressure times aerodynamic
coefficient times powers of measured signals. If every factor f is known to within e, then

    |prod (f + e) - prod f| <= prod (|f| + |e|) - prod |f|

and the sum of these over the terms bounds |F(truth) - F(measured)| at this very state; with all errors of
one sign it is attained term by term. The same bound serves the isolation estimators: a lost share of a
surface multiplies its terms by 1 + theta in [0, 1], and with them their error.

A gyro's error enters once more, as xdot is taken from its readings. Its constant part drops out of the
difference; of what changes, n with |n| <= nbar, the filter eps[k+1] = a eps[k] + n[k+1] - n[k] keeps
n[k] - m[k], m[k+1] = a m[k] + (1 - a) n[k], so no more than nbar[k] and the filtered nbar: twice nbar,
however fast the frames.

The error of a derived design model, where in the envelope the aircraft is, is measured, and looked up here.
Its map is a few boxes of states, one inside the other, with the largest error found in each for surfaces
within a share of their travel, those that stand in within less. Healthy surfaces are where their commands
put them, and one that has lost effectiveness gives no more than what it is taken to be at: the bound is that
of the share these use. One that is stuck may be anywhere: what its share adds, `beyond`, belongs to the
hypothesis that it is off (membership.py). Where two may be, the whole travel counts for the bound itself.
Outside of all boxes nobody has measured: nothing is concluded.
"""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_BOXES, MAX_LEVELS, MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.dryden import LEAST_HEIGHT_M
from beaver_ftc.design.engine import DPT_0, KW_TO_DPT, density_ratio
from beaver_ftc.design.terms import AIRSPEED, DPT, N_SIGNALS, N_Y, QDYN, monomials, signals

_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
_LEAST_AIRSPEED_SHARE = 0.1
# Double precision leaves 1e-16 of a rate below 6 rad/s, divided by a frame of 1 ms or more, and of the terms
# of f + G u, which stay below 100 rad/s2; a few operations each. Where a frame is of fifty instants it leaves
# more, 1e-10: the Earth's rate squared, 5e-9, covers that.
ROUNDING_RAD_S2 = 1e-11
UNKNOWN_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
# The same to filters that carry a covariance, beside noise of 1e-4: more than any aircraft does, and no more.
UNKNOWN_TO_FILTERS_RAD_S2 = 100.0
_ROUNDING = 1e-9
N_PLACES = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@sized
def admitted_dtype(n: int) -> np.dtype:
    """What else than the published bound is admitted, for an aircraft with n surfaces."""
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
        # scratch: magnitudes as measured, and the furthest they can be from there
        near_x=3, near_y=N_Y, near_u=n, far_x=3, far_y=N_Y, far_u=n, far_aero=3, signal=N_SIGNALS,
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
        inertia=3, constant=3, earth_rate=float, admitted=admitted_dtype(n),
        error_map=error_map_dtype(n, boxes), eta_bar=3, eta_bar_now=3, noise=3, noise_then=3, frame=3,
        own_errors=int, own_per_rad=(3, n), own=(3, n), beyond=(MAX_LEVELS, 3),
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
def error(admitted, i, reading):
    """How far the truth of signal i can be from its reading."""
    return (admitted.offset[i] + admitted.slope[i] * abs(reading)) / (1.0 - admitted.slope[i])


@kernel
def changing_error(admitted, i, reading):
    """How far gyro i can be off, rad/s, but for a constant: noise, resolution, slope times the true rate."""
    changing = admitted.offset[i] - admitted.steady[i]
    return changing + admitted.slope[i] * (abs(reading) + error(admitted, i, reading))


@kernel
def slipstream_error(admitted, y):
    """How far dpt can be off that is worked out from the engine's instruments and the air data.

    dpt = a + b P / (qdyn V) [FDC]: the power's error, by the instruments engine_kw and by the density
    thin_air_kw for all of it; and the share that dynamic pressure and airspeed are off.
    """
    pressure = error(admitted, _AIR_DATA + QDYN, y[QDYN]) / y[QDYN]
    speed = error(admitted, _AIR_DATA + AIRSPEED, y[AIRSPEED]) / y[AIRSPEED]
    stretch = 1.0 / ((1.0 - min(pressure, 0.9)) * (1.0 - min(speed, 0.9)))
    density = (1.0 + pressure) / (1.0 - min(speed, 0.9)) ** 2 - 1.0
    power_kw = admitted.engine_kw + admitted.thin_air_kw * density * density_ratio(y)
    return stretch * KW_TO_DPT * power_kw / (y[QDYN] * y[AIRSPEED]) + (stretch - 1.0) * abs(y[DPT] - DPT_0)


@kernel
def magnitudes(admitted, x, y, u):
    """Fill the scratch with |signal| as measured and as large as it may be; for airspeed, as small."""
    for i in range(3):
        admitted.near_x[i] = abs(x[i])
        admitted.far_x[i] = abs(x[i]) + error(admitted, i, x[i])
        admitted.far_aero[i] = admitted.far_x[i] + admitted.gust[i]
    for i in range(DPT):
        admitted.near_y[i] = abs(y[i])
        admitted.far_y[i] = abs(y[i]) + error(admitted, _AIR_DATA + i, y[i])
    for i in range(DPT, y.size):
        admitted.near_y[i] = admitted.far_y[i] = abs(y[i])
    if admitted.engine:
        admitted.far_y[DPT] += slipstream_error(admitted, y)
    for s in range(u.size):
        admitted.near_u[s] = abs(u[s])
        admitted.far_u[s] = abs(u[s]) + admitted.deflection
    V = y[AIRSPEED]
    admitted.far_y[AIRSPEED] = max(2.0 * V - admitted.far_y[AIRSPEED], _LEAST_AIRSPEED_SHARE * V)


@kernel
def moments(admitted, design):
    """Fill moment (3,), the sum of the magnitudes of a moment's terms, and slack (3,), their error; N m."""
    near_q, far_q = admitted.near_y[QDYN], admitted.far_y[QDYN]
    table = design.moments
    for i in range(3):
        near, far = 0.0, 0.0
        for k in range(table.free_from[i], table.surface_to[i]):
            size, s = abs(table.value[k]), table.surface[k]
            near += size * admitted.near[table.monomial[k]] * (admitted.near_u[s] if s >= 0 else 1.0)
            largest = admitted.far[table.monomial[k]] * (admitted.far_u[s] if s >= 0 else 1.0)
            far += (size + admitted.tolerance[k]) * largest
        arm = design.S * (design.c if i == 1 else design.b)
        admitted.moment[i] = arm * near_q * near
        admitted.slack[i] = arm * (far_q * far - near_q * near)


@kernel
def product_slack(size, tolerance, near, far):
    """Error of a coefficient times a signal."""
    return (abs(size) + tolerance) * far - abs(size) * near


@kernel
def moment_slack(admitted, i, size, tolerance):
    """Error of an inertia coefficient times moment i."""
    near = admitted.moment[i]
    return product_slack(size, tolerance, near, near + admitted.slack[i])


@kernel
def rate_slack(admitted, i, j, size, tolerance):
    """Error of an inertia coefficient times rates i and j."""
    near, far = admitted.near_x, admitted.far_x
    return product_slack(size, tolerance, near[i] * near[j], far[i] * far[j])


@kernel
def moment_per_rad(admitted, design, i, s):
    """Of moment i, what surface s adds per rad: its magnitude, and with all errors; N m."""
    near, far = 0.0, 0.0
    table = design.moments
    for k in range(table.free_to[i], table.surface_to[i]):
        if table.surface[k] == s:
            size = abs(table.value[k])
            near += size * admitted.near[table.monomial[k]]
            far += (size + admitted.tolerance[k]) * admitted.far[table.monomial[k]]
    arm = design.S * (design.c if i == 1 else design.b)
    return arm * admitted.near_y[QDYN] * near, arm * admitted.far_y[QDYN] * far


@kernel
def slack_per_rad(admitted, design, s):
    """Fill per_rad (3, s) rad/s2 per rad: what the declared errors can do to the effect of surface s.

    The bound is affine in |u_s|; this is its slope. `derived_bound` comes first.
    """
    t, per_rad = admitted.inertia, admitted.per_rad
    roll, roll_far = moment_per_rad(admitted, design, 0, s)
    pitch, pitch_far = moment_per_rad(admitted, design, 1, s)
    yaw, yaw_far = moment_per_rad(admitted, design, 2, s)
    per_rad[0, s] = product_slack(design.Pl, t[2], roll, roll_far)
    per_rad[0, s] += product_slack(design.Pn, t[3], yaw, yaw_far)
    per_rad[1, s] = product_slack(design.Qm, t[7], pitch, pitch_far)
    per_rad[2, s] = product_slack(design.Rl, t[10], roll, roll_far)
    per_rad[2, s] += product_slack(design.Rn, t[11], yaw, yaw_far)


@kernel
def derived_bound(admitted, design, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 what the declared errors can do; x (3,), y, u (surfaces,) as measured."""
    magnitudes(admitted, x, y, u)
    signals(design.moments, admitted.near_x, admitted.near_y, admitted.signal)
    monomials(design.moments, admitted.signal, admitted.near)
    signals(design.moments, admitted.far_aero, admitted.far_y, admitted.signal)
    monomials(design.moments, admitted.signal, admitted.far)
    moments(admitted, design)
    t = admitted.inertia
    eta_bar[0] += moment_slack(admitted, 0, design.Pl, t[2]) + moment_slack(admitted, 2, design.Pn, t[3])
    eta_bar[0] += rate_slack(admitted, 0, 1, design.Ppq, t[0]) + rate_slack(admitted, 1, 2, design.Pqr, t[1])
    eta_bar[1] += moment_slack(admitted, 1, design.Qm, t[7]) + rate_slack(admitted, 0, 2, design.Qpr, t[5])
    eta_bar[1] += rate_slack(admitted, 0, 0, design.Qpp, t[4]) + rate_slack(admitted, 2, 2, design.Qrr, t[6])
    eta_bar[2] += moment_slack(admitted, 0, design.Rl, t[10]) + moment_slack(admitted, 2, design.Rn, t[11])
    eta_bar[2] += rate_slack(admitted, 0, 1, design.Rpq, t[8]) + rate_slack(admitted, 1, 2, design.Rqr, t[9])


@kernel
def is_inside(error_map, k):
    """Whether `place` is in box k."""
    inside = True
    for i in range(error_map.place.size):
        room = _ROUNDING * (1.0 + abs(error_map.place[i]))
        inside = inside and error_map.low[k, i] - room <= error_map.place[i] <= error_map.high[k, i] + room
    return inside


@kernel
def is_beyond(error_map, i):
    """Whether quantity i of `place` is outside what any box spans."""
    low, high = np.inf, -np.inf
    for k in range(error_map.n_boxes):
        low, high = min(low, error_map.low[k, i]), max(high, error_map.high[k, i])
    room = _ROUNDING * (1.0 + abs(error_map.place[i]))
    return not low - room <= error_map.place[i] <= high + room


@kernel
def level_of(error_map, u):
    """The first share of the travel that covers surfaces u (n,) rad; the last if all of it may be used."""
    if error_map.whole:
        return error_map.n_levels - 1
    used = 0.0
    for s in range(u.size):
        if u[s] != 0.0:
            end = error_map.travel_high[s] if u[s] > 0.0 else error_map.travel_low[s]
            used = max(used, u[s] / end) if end != 0.0 else 1.0
    return covering(error_map, used)


@kernel
def covering(error_map, used):
    """The first level of the map for so large a share of the travel."""
    last = error_map.n_levels - 1
    for j in range(last):
        if used <= error_map.share[j]:
            return j
    return last


@kernel
def share_used(error_map, s, where, before, instants):
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
def age_of(error_map):
    """The row for the flight as old as it is, -1 if none was measured so late."""
    for a in range(error_map.n_ages):
        if error_map.time_s <= error_map.until_s[a]:
            return a
    return -1


@kernel
def look_up(error_map, x, y, u):
    """Fill `place` and `now`, the error measured about this state; x (3,) rad/s, y (4 + declared,), u (n,)
    rad."""
    place = error_map.place
    place[:3], place[3 : 3 + y.size] = x, y
    place[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])
    level, age = level_of(error_map, u), age_of(error_map)
    for k in range(error_map.n_boxes if age >= 0 else 0):
        if is_inside(error_map, k):
            error_map.outside, error_map.now[:] = 0, error_map.error[age, k, level]
            error_map.box, error_map.age = k, age
            error_map.apart_now = error_map.apart[k]
            return
    error_map.outside, error_map.now[:], error_map.apart_now = 1, UNKNOWN_RAD_S2, UNKNOWN_RAD_S2


@kernel
def beyond(error_map, j, i):
    """By how much the error of axis i at this instant is larger with a surface at level j, rad/s2."""
    if error_map.outside:
        return 0.0
    return max(error_map.error[error_map.age, error_map.box, j, i] - error_map.now[i], 0.0)


@kernel
def add_model_error(error_map, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 the error measured about this state; x (3,) rad/s, y, u (n,) rad."""
    look_up(error_map, x, y, u)
    for i in range(3):
        eta_bar[i] += error_map.now[i]


@kernel
def uncertainty_bound(x, design, inertia, constant, earth_rate, eta_bar):
    """Add to eta_bar (3,) rad/s2 the published bound, and what the Earth's rotation adds.

    Published: inertia_i |cross term_i| + constant_i [Zhang2005, sec. VII]. JSBSim integrates rates against
    inertial space and reports them against the Earth: the difference turns with the body, at no more than
    earth_rate |x| on any axis, and the inertia coupling makes `coupled` times as much of it.
    """
    p, q, r = x[0], x[1], x[2]
    rates = abs(p) + abs(q) + abs(r)
    roll, pitch, yaw = coupled(design)
    eta_bar[0] += inertia[0] * abs(design.Pqr * q * r) + constant[0] + by_earth(earth_rate, rates, roll)
    eta_bar[1] += inertia[1] * abs(design.Qpr * p * r) + constant[1] + by_earth(earth_rate, rates, pitch)
    eta_bar[2] += inertia[2] * abs(design.Rpq * p * q) + constant[2] + by_earth(earth_rate, rates, yaw)


@kernel
def coupled(design):
    """How much of one rate times another the inertia coupling makes on each axis, at most; 1 where it is
    less, as it is of most aircraft."""
    roll, yaw = abs(design.Ppq) + abs(design.Pqr), abs(design.Rpq) + abs(design.Rqr)
    pitch = abs(design.Qpr) + 2.0 * max(abs(design.Qpp), abs(design.Qrr))
    return max(roll, 1.0), max(pitch, 1.0), max(yaw, 1.0)


@kernel
def by_earth(earth_rate, rates, share):
    """What the Earth's rotation and rounding add on an axis, rad/s2; rates: |p| + |q| + |r|, rad/s."""
    return earth_rate * ((1.0 + share) * rates + share * earth_rate) + ROUNDING_RAD_S2


@kernel
def least_height(altitude, off, slope):
    """The least height, m, that a measured altitude leaves: off by so much and by a share. The ground is at
    sea level; turbulence knows no height below LEAST_HEIGHT_M."""
    return max(altitude - (off + slope * abs(altitude)) / (1.0 - slope), LEAST_HEIGHT_M)


@kernel
def set_gust_bound(admitted, altitude):
    """Bring the bound on the air's rotation to this altitude, m as measured."""
    if admitted.gust_low > 0.0:
        height = least_height(altitude, admitted.altitude_off, admitted.altitude_slope)
        admitted.gust[:] = max(admitted.gust_aloft, admitted.gust_low / np.sqrt(height))


@kernel
def bound_now(bound, design, measured, u):
    """Fill eta_bar_now (3,) rad/s2, the bound on the uncertainty at this instant; u (n,) rad."""
    x, y = measured.x, measured.y
    bound.eta_bar_now[:] = 0.0
    if bound.admitted.any:
        set_gust_bound(bound.admitted, measured.altitude)
        derived_bound(bound.admitted, design, x, y, u, bound.eta_bar_now)
        if bound.own_errors:
            for s in range(u.size):
                slack_per_rad(bound.admitted, design, s)
    if bound.error_map.n_boxes > 0:
        add_model_error(bound.error_map, x, y, u, bound.eta_bar_now)
    far = bound.admitted.far_x if bound.admitted.any else x
    uncertainty_bound(far, design, bound.inertia, bound.constant, bound.earth_rate, bound.eta_bar_now)
