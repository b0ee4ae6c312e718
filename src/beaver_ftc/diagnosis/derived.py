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
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel
from beaver_ftc.design.engine import DPT_0, KW_TO_DPT, density_ratio
from beaver_ftc.design.terms import AIRSPEED, DPT, N_SIGNALS, N_Y, QDYN, monomials, signals

_AIR_DATA = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
_LEAST_AIRSPEED_SHARE = 0.1


@lru_cache
def admitted_dtype(n: int) -> np.dtype:
    """What else than the published bound is admitted, for an aircraft with n surfaces."""
    return np.dtype(
        [
            ("any", "i8"),
            ("tolerance", "f8", (MAX_TERMS,)),  # of each moment coefficient, as the design model has them
            ("inertia", "f8", (12,)),  # of each inertia coefficient, in the order of design.inertia
            ("offset", "f8", (7,)), ("slope", "f8", (7,)),  # error of a signal: offset + slope |signal|
            ("steady", "f8", (3,)),  # of the offset of a gyro, what does not change
            ("gust", "f8", (3,)), ("deflection", "f8"),
            ("engine", "i8"), ("engine_kw", "f8"), ("thin_air_kw", "f8"),  # of dpt: see `slipstream_error`
            # scratch: magnitudes as measured, and the furthest they can be from there
            ("near_x", "f8", (3,)), ("near_y", "f8", (N_Y,)), ("near_u", "f8", (n,)),
            ("far_x", "f8", (3,)), ("far_y", "f8", (N_Y,)), ("far_u", "f8", (n,)), ("far_aero", "f8", (3,)),
            ("signal", "f8", (N_SIGNALS,)),
            ("near", "f8", (MAX_MONOMIALS,)), ("far", "f8", (MAX_MONOMIALS,)),
            ("per_rad", "f8", (3, n)),
            ("moment", "f8", (3,)), ("slack", "f8", (3,)),
        ],
        align=True,
    )  # fmt: skip


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
