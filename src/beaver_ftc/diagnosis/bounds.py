"""The declared uncertainty: the worst case that it allows in xdot.

The design model is a sum of products: inertia coefficient times dynamic pressure times aerodynamic
coefficient times powers of measured signals. If every factor v has an error dv of at most e, then

    |prod (v + dv) - prod v| <= prod (|v| + e) - prod |v|

and the sum of these over the terms bounds |F(truth) - F(measured)| at this state. The sum of prod |v| is the
design model with |v| in place of each factor, and that of prod (|v| + e) the same with |v| + e, or |v| - e of
the airspeed, which divides the rates: the bound is the difference of two evaluations of one model. If each
error has the sign of its factor, each term reaches its bound.
The same bound serves the isolation estimators: a lost share of a surface multiplies its terms by 1 + theta in
[0, 1], and with them their error.

A gyro's error appears once more, because xdot is computed from the gyro's readings. Its constant part drops
out of the difference. Of the changing part c with |c| <= n the filter E[k] = a E[k-1] + c[k] - c[k-1] keeps
c[k] - m[k], m[k] = a m[k-1] + (1 - a) c[k-1]. This is at most n[k] plus the filtered n: 2 n at any frame
rate.

The error of a derived aircraft's model: error_map.py. bounds_design.py fills the records from what a scenario
declares.

Symbols of the kernels (err: of `errors_dtype`, model: the design model):

    x (3,) rad/s, y, u (n,) rad   rates, readings, deflections; in err, [MEASURED] is the magnitude as
                                  measured, [WORST] the worst that the errors allow
    eta (3,) rad/s2               bound on the uncertainty
    s, i                          surface, axis
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_LEVELS
from beaver_ftc.compiled import copy, kernel, record, sized
from beaver_ftc.design.engine import DPT_0, KW_TO_DPT, density_ratio
from beaver_ftc.design.model import acceleration, design_dtype, nonlinear_response_from_table
from beaver_ftc.design.table import AIRSPEED, DPT, N_Y, QDYN, evaluate
from beaver_ftc.design.turbulence import LEAST_HEIGHT_M
from beaver_ftc.diagnosis.error_map import look_up_map, map_dtype

Y0 = 3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
MEASURED, WORST = 0, 1  # places of the two designs of magnitudes
_MIN_V_SHARE = 0.1  # smallest airspeed of the worst case, as a share of its reading: others are divided by it
MAX_ERROR_SHARE = 0.9  # largest relative error of a factor that divides
# Double precision leaves 1e-16 of a rate below 6 rad/s, divided by a frame of 1 ms or more, and of the terms
# of f + G u, which stay below 100 rad/s2; a few operations each. Where a frame is of fifty instants it leaves
# more, 1e-10: the Earth's rate squared, 5e-9, covers that.
ROUNDING_RAD_S2 = 1e-11


@sized
def errors_dtype(n: int) -> np.dtype:
    """The declared errors beyond the published bound, of an aircraft with n surfaces."""
    return record(
        given=int,  # whether any error is declared
        e0=7, e1=7,  # bound on the error of a signal: offset + slope |signal|
        steady=3,  # part of the offset of a gyro that does not change, rad/s
        wg=3,  # bound on the air's rotation now, rad/s
        du0=float, du=n,  # error of a deflection, rad: without that of its actuator; all of it now
        # wg above 2000 ft; wg below 1000 ft, times the root of the height in m; error of the altitude's
        # reading: offset, m, and slope
        wg_aloft=float, wg_1m=float, h0=float, h1=float,
        engine=int, kw0=float, kw1=float,  # errors of dpt: `slipstream_bound`
        # The design model of magnitudes, MEASURED and WORST; magnitudes of rates, also relative to the air,
        # of readings and of deflections; f, G and F = f + G u of both models there; eG: their difference in G
        model=(design_dtype(n), 2),
        x=(2, 3), x_air=(2, 3), y=(2, N_Y), u=(2, n), f=(2, 3), G=(2, 3, n), F=(2, 3), eG=(3, n),
    )  # fmt: skip


@sized
def bound_dtype(n: int, boxes: int) -> np.dtype:
    """Bounds on the uncertainty.

    eta_bar, eta_now     bound over the elapsed frame, and at this instant, rad/s2
    n_gyro, n_old        bound on the changing part of a gyro's error, now and a frame ago, rad/s
    nu_max               bound on the innovation of one frame, rad/s2
    has_eG, eG, eGu      bound on the error of each surface's own terms in the acceleration: whether it is
                         filled (errors are declared, and faults of all types are examined), per rad of
                         deflection (rad/s2 per rad), at the command (rad/s2); means over the frame
    extra                by how much the map's error, with a surface at each share of its travel, exceeds that
                         in eta_bar, rad/s2; mean over the frame
    const, earth_rate_rad_s, coupling_share: b, w_E, c of `add_published_bound`
    """
    return record(
        coupling_share=3, const=3, earth_rate_rad_s=float, declared_errors=errors_dtype(n),
        error_map=map_dtype(n, boxes), eta_bar=3, eta_now=3, n_gyro=3, n_old=3, nu_max=3, has_eG=int,
        eG=(3, n), eGu=(3, n), extra=(MAX_LEVELS, 3),
    )  # fmt: skip


@kernel
def largest_error(o, s, v):
    """e = (o + s |v|) / (1 - s): bound on the error of a reading v that differs from the truth by at most
    o + s |truth|, in the unit of v: |truth| is at most |v| + e, hence the divisor."""
    return (o + s * abs(v)) / (1.0 - s)


@kernel
def reading_bound(err, j, v):
    """Bound on the error of reading j, whose value is v, in its unit, by the declared `e0` and `e1`."""
    return largest_error(err.e0[j], err.e1[j], v)


@kernel
def n_gyro(err, i, x):
    """n_i = o - |bias| + s (|x_i| + e): bound on the changing error of gyro i, rad/s.

    o, s, e: as of `largest_error`; |bias|: `steady`, what does not change of o; x rad/s: the reading.
    """
    return err.e0[i] - err.steady[i] + err.e1[i] * (abs(x) + reading_bound(err, i, x))


@kernel
def slipstream_bound(err, y):
    """Bound the error of dpt = DPT_0 + KW_TO_DPT P / (qdyn V) [FDC], computed from the engine's instruments
    and the air data.

        s KW_TO_DPT e_P / (qdyn V) + (s - 1) |dpt - DPT_0|,      s = 1 / ((1 - e_q) (1 - e_V))
        e_P = kw0 + kw1 e_rho d,      1 + e_rho = (1 + e_q) / (1 - e_V)^2

    e_q, e_V, e_rho: relative errors of dynamic pressure, airspeed and density; where they are subtracted, e_q
    and e_V count as MAX_ERROR_SHARE at most, so that the bound stays finite. e_P kW: error of the power P;
    kw0: by the instruments; kw1: per 1 of error of d, the density over that at sea level.
    """
    e_q = reading_bound(err, Y0 + QDYN, y[QDYN]) / y[QDYN]
    e_V = reading_bound(err, Y0 + AIRSPEED, y[AIRSPEED]) / y[AIRSPEED]
    least_V = 1.0 - min(e_V, MAX_ERROR_SHARE)
    s = 1.0 / ((1.0 - min(e_q, MAX_ERROR_SHARE)) * least_V)
    e_rho = (1.0 + e_q) / least_V**2 - 1.0
    e_P = err.kw0 + err.kw1 * e_rho * density_ratio(y)
    return s * KW_TO_DPT * e_P / (y[QDYN] * y[AIRSPEED]) + (s - 1.0) * abs(y[DPT] - DPT_0)


@kernel
def fill_magnitudes(err, x, y, u):
    """Fill x, y, u with the magnitudes |v| as measured, and with the largest that the errors allow, |v| + e;
    for airspeed, which divides, with the smallest, V - e, at least _MIN_V_SHARE V. x_air: these rates with
    the air's rotation. Signals from dpt on count as exact, except dpt if the engine's instruments have
    errors.
    """
    for i in range(3):
        err.x[:, i] = err.x_air[:, i] = abs(x[i])
        err.x[WORST, i] += reading_bound(err, i, x[i])
        err.x_air[WORST, i] = err.x[WORST, i] + err.wg[i]
    for i in range(y.size):
        err.y[:, i] = abs(y[i])
        if i < DPT:
            err.y[WORST, i] += reading_bound(err, Y0 + i, y[i])
    for s in range(u.size):
        err.u[:, s] = abs(u[s])
        err.u[WORST, s] += err.du[s]
    if err.engine:
        err.y[WORST, DPT] += slipstream_bound(err, y)
    V = y[AIRSPEED]
    err.y[WORST, AIRSPEED] = max(2.0 * V - err.y[WORST, AIRSPEED], _MIN_V_SHARE * V)


@kernel
def add_declared_bound(err, x, y, u, eta):
    """Add to eta the bound eta_e by the declared errors, and fill eG, that on the effect of each surface, per
    rad.

        eta_e = sum over the terms of prod (|v| + e) - prod |v| = F_worst - F_measured      F = f + G u
        eG = G_worst - G_measured

    F_measured, F_worst (3,) rad/s2: the design model of magnitudes, at the magnitudes |v| as measured and at
    the worst ones, |v| + e, of the airspeed V - e.
    """
    fill_magnitudes(err, x, y, u)
    for v in range(2):
        evaluate(err.model[v].moments, err.x_air[v], err.y[v])
        nonlinear_response_from_table(err.model[v], err.x[v], err.y[v], err.f[v], err.G[v])
        acceleration(err.f[v], err.G[v], err.u[v], err.F[v])
    for i in range(3):
        eta[i] += err.F[WORST, i] - err.F[MEASURED, i]
        for s in range(u.size):
            err.eG[i, s] = err.G[WORST, i, s] - err.G[MEASURED, i, s]


@kernel
def add_published_bound(x, model, c, b, w_E, eta):
    """Add to eta the published bound, and what the Earth's rotation adds.

        eta_i <- eta_i + c_i |C_i x_j x_l| + b_i + w_E ((1 + kappa_i) (|p| + |q| + |r|) + kappa_i w_E) + rho

    [Zhang2005, sec. VII] for the first two. JSBSim integrates rates against inertial space and reports them
    against the Earth: the difference turns with the body, at no more than w_E |x| on any axis.

    x (3,) rad/s: rates p, q, r; c (3,): error share of the inertia coupling; C_i x_j x_l rad/s2: its main
    product, Pqr q r, Qpr p r or Rpq p q; b (3,) rad/s2: constant; w_E rad/s: rate of the Earth; kappa_i: sum
    of the magnitudes of the factors of products of two rates on axis i, in pitch with twice the larger of
    those of p^2 and r^2, at least 1; rho: ROUNDING_RAD_S2.
    """
    p = x[0]
    q = x[1]
    r = x[2]
    total = abs(p) + abs(q) + abs(r)
    coupling = model.Pqr * q * r, model.Qpr * p * r, model.Rpq * p * q
    factor = (
        abs(model.Ppq) + abs(model.Pqr),
        abs(model.Qpr) + 2.0 * max(abs(model.Qpp), abs(model.Qrr)),
        abs(model.Rpq) + abs(model.Rqr),
    )
    for i in range(3):
        kappa = max(factor[i], 1.0)
        by_earth = w_E * ((1.0 + kappa) * total + kappa * w_E)
        eta[i] += c[i] * abs(coupling[i]) + b[i] + by_earth + ROUNDING_RAD_S2


@kernel
def least_height(h, h0, h1):
    """max(h - e, LEAST_HEIGHT_M): the least true height, m, for a reading h whose error is up to
    h0 + h1 |truth|, and so up to e (`largest_error`).

    The ground is at sea level; the model of turbulence has no height below LEAST_HEIGHT_M.
    """
    return max(h - largest_error(h0, h1, h), LEAST_HEIGHT_M)


@kernel
def set_air_rotation(err, h):
    """wg = max(wg_aloft, wg_1m / sqrt(h_least)): bound on the air's rotation, rad/s, for altitude h, m."""
    err.wg[:] = max(err.wg_aloft, err.wg_1m / np.sqrt(least_height(h, err.h0, err.h1)))


@kernel
def fill_bound(bound, model, meas, u):
    """Fill eta_now (3,) rad/s2, the bound on the uncertainty at this instant (detection.md, Table 1):

        eta_i = c_i |C_i x_j x_l| + b_i + w_E ((1 + kappa_i) (|p| + |q| + |r|) + kappa_i w_E) + rho
                + eta_e,i + mu_i

    eta_e: of `add_declared_bound`; mu: of the map of the model's error, `e_now`; the others: of
    `add_published_bound`, at the worst rates. model: the design model; u (n,) rad: deflections.
    """
    x = meas.x
    y = meas.y
    err = bound.declared_errors
    emap = bound.error_map
    eta = bound.eta_now
    eta[:] = 0.0
    if err.given:
        set_air_rotation(err, meas.altitude)
        add_declared_bound(err, x, y, u, eta)
    else:
        copy(x, err.x[WORST])  # without errors, the worst rates are those measured
    if emap.n_boxes > 0:
        look_up_map(emap, x, y, u, err.du)
        for i in range(3):
            eta[i] += emap.e_now[i]
    c = bound.coupling_share
    b = bound.const
    w_E = bound.earth_rate_rad_s
    add_published_bound(err.x[WORST], model, c, b, w_E, eta)
