"""The gust estimate from vanes and airspeed: rotation of the air, rad/s, and its effect on the rates.

A vertical gust that varies along the flight path acts like a pitch rate q_g, a lateral one like a yaw rate
r_g, both rad/s [MIL-F-8785C, 3.7]:

    tau_q q_g' + q_g = g_z' / V,  tau_q = 4 b / pi V        tau_r r_g' + r_g = g_y' / V,  tau_r = 3 b / pi V

g_z, g_y, m/s, are the gust downwards and to the right; b, m, is the span; V, m/s, the speed. Vanes and
airspeed give the aircraft's velocity relative to the moving air. Forces, attitude and gravity predict how
this velocity would change in still air. The predicted minus the measured velocity is the change of the gust:
air that begins to move downwards lowers the aircraft's downward velocity relative to it. The rolling gust,
which varies across the span, cannot be measured.

If the design model has no forces (as that of the GTM), the accelerometers supply them. Without either, a
change of the aircraft's own velocity cannot be distinguished from a gust; no gust estimate is then subtracted
from the rates. A coarse estimate, for which lift balances the weight, is still computed. A law that uses the
vanes moves the surfaces with the gust, which looks like a loss; the detector corrects its evidence by the
coarse estimate (likelihood.py).

V is the speed relative to the field of gusts. The mean wind carries that field [MIL-F-8785C, 3.7.1], so V is
the speed relative to the mean air. The airspeed differs from V by the gust itself. The gust velocity is the
sum of its changes, apart from its initial value and the drift of accelerometers and attitude, which are
unknown. The record's `v_g` is that sum, with a decay as slow as this drift permits. A relative error e of V
leaves at most e^2 / 4 of the gust's intensity unmeasured (`gusts_design.speed_error_share`).

The intensity of turbulence is that above 2000 ft, or that at the height flown if it is larger.

The velocity is integrated as in JSBSim, by the two-step method of Adams and Bashforth:
v <- v + dt (3 a - a_prev) / 2.

gust_drift.py has the drift by the part of a gust that stays unmeasured. gusts_design.py fills the record from
what a scenario declares.

Letters of the kernels. i is a body axis, j an axis of the gusts, about which they roll, pitch or yaw. An
index _q or _r at the end of a letter is pitch or yaw. w holds q_g and r_g.

    v, v_g         velocity relative to the air; gust (3,) since the start, m/s in level axes
    V              speed relative to the mean air, m/s
    f, a           specific force, m/s2 in body axes; acceleration in level axes
    T, C           rotations (3, 3): from level axes to body axes; from the gusts' axes to body axes
    w, tau         rotation of the air in the gusts' axes, rad/s; its lag, s
    acc            effect of w on the rates, rad/s2
    L              rate damping, angular acceleration per rad/s (3, 3), 1/s
    Q              intensity of the drift of w over V, rad2/s3 per m/s
    share          part of Q, or of a variance, that the vanes leave unmeasured
    b              span, m
"""

from math import pi

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL, YAW
from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import rate_damping
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA, QDYN, TABLE, evaluate, whole_sum
from beaver_ftc.diagnosis.bounds import least_height
from beaver_ftc.diagnosis.gust_drift import (
    add_turn_variance,
    add_variance,
    finish_turn_variance,
    gust_lag,
    project_gust,
)
from beaver_ftc.plant.instruments import wrapped

# Share of the intensity of the rolling, pitching and yawing gust that remains unmeasured with vanes. With
# exact vanes and over a filter's memory it is smaller (`tests/diagnosis/test_gusts.py`).
MIN_UNMEASURED_SHARES = (1.0, 0.003, 0.03)
MIN_BANK_COSINE = 0.5  # cosine of the steepest bank at which lift is assumed to balance the weight
# Share of a gust's own intensity below which the turn of its axes is ignored
FAST_TURN_SHARE = 0.01

GUST_CONFIG_RECORD = record(
    has_forces=int, coarse_only=int,  # whether the design model has forces; whether the estimate is coarse
    S_m=float, gravity=float, span=float,  # wing area over mass, m2/kg; m/s2; b, m
    Q_aloft=3, Q_1m=3,  # Q above 2000 ft, and at a height of 1 m
    h0=float, h1=float,  # bound on the altimeter's error: offset, m, and slope
    v_max=float, a_v=float,  # limit of a component of v_g, m/s; decay rate of v_g, 1/s
    # var_V, var_v: variance of the error of V, and of the gust, (m/s)2. speed_error_share: share of a gust's
    # intensity that a relative error of V leaves unmeasured, over the variance of that error.
    var_V=float, var_v=float, speed_error_share=float,
    L_roll=float, L_gust=float,  # correlation lengths of the rolling gust and of the gusts, m
)  # fmt: skip

GUST_MEMORY_RECORD = record(
    # Whether a_prev is valid; reading of the accelerometers, m/s2; coefficients of the forces
    has_prev=int, f_read=3, table=TABLE, scratch=MAX_MONOMIALS,
    # a_prev: a of the instant before, in the level axes of this instant; heading rad
    v=3, f=3, T=(3, 3), heading=float, a_prev=3,
    w=3, w_body=3, acc_sum=3,  # w_body: w in body axes; acc_sum: sum of acc over the instants of a frame
    Q=3, share=3,  # at this altitude; what vanes leave of it in any case (MIN_UNMEASURED_SHARES)
    v_g=3, start_left=float,  # start_left: share of the variance of the initial gust that still counts
    # Further unmeasured shares. turn_now, turn_past: of the yawing gust, by the turn of the heading at this
    # instant, and by earlier turns, decaying; start_share: of the pitching gust that was present when the
    # diagnosis started, decaying.
    turn_now=float, turn_past=float, start_share=float,
    C_dot=(3, 3), turns_fast=int,  # turn of C, 1/s; whether it counts
    # Variance of acc by that turn, (rad/s2)2, of this frame and of the one before
    var_now=(3, 3), var_prev=(3, 3),
)  # fmt: skip

GUST_OUTPUT_RECORD = record(
    # Whether turbulence is declared; whether accelerometers are used; whether the gust is measured. The
    # configuration fills these. `drop_accelerometers` may clear the last two, and `forces.drop_forces` clears
    # the first of the estimates of the views.
    gusty=int, uses_accelerometers=int, measured=int,
    acc=3, acc_mean=3, acc_coarse=3,  # by the measured gust: now, and mean over the frame; by a coarse one
    var_turn=(3, 3), V=float,  # var_turn: var_now plus var_prev
    rate_damping=(3, 3), C=(3, 3),  # rate_damping: L
)  # fmt: skip

GUST_RECORD = record(config=GUST_CONFIG_RECORD, memory=GUST_MEMORY_RECORD, output=GUST_OUTPUT_RECORD)


@kernel
def fill_force(gust, x, y, u, f):
    """Fill f (3,) m/s2 with the aerodynamic and propulsive force over mass in body axes, by the model.

        f_i = qdyn S / m C_i(x, y, u)

    x (3,) rad/s, y (4 + declared,), u (n,) rad. The term of the rate of sideslip is omitted: it is below a
    hundredth of the side force.
    """
    table = gust.memory.table
    evaluate(table, x, y)
    for i in range(3):
        f[i] = y[QDYN] * gust.config.S_m * whole_sum(table, i, table.power, u)


@kernel
def fill_rotation(phi, th, T):
    """Fill T (3, 3), the rotation from level axes (forward, right, down) to body axes; angles rad."""
    s_phi = np.sin(phi)
    c_phi = np.cos(phi)
    s_th = np.sin(th)
    c_th = np.cos(th)
    T[0, :] = c_th, 0.0, -s_th
    T[1, :] = s_phi * s_th, c_phi, s_phi * c_th
    T[2, :] = c_phi * s_th, -s_phi, c_phi * c_th


@kernel
def to_level(v, T):
    """T' v: a vector v (3,) in body axes, in level axes."""
    return project_gust(v, T, 0), project_gust(v, T, 1), project_gust(v, T, 2)


@kernel
def fill_velocity(gust, y, attitude):
    """Fill T, the heading, and v = T' V (cos(alpha) cos(beta), sin(beta), sin(alpha) cos(beta)) of this
    instant, in level axes.

    y (4 + signals,) and attitude (3,) rad as measured; V m/s: airspeed.
    """
    mem = gust.memory
    V = y[AIRSPEED]
    alpha = y[ALPHA]
    beta = y[BETA]
    fill_rotation(attitude[0], attitude[1], mem.T)
    mem.heading = attitude[2]
    v = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    mem.v[:] = to_level(v, mem.T)


@kernel
def start_gust(gust, y, attitude):
    """Start at the first frame of a diagnosis, whose record is new: the estimated gust is zero.

    If the diagnosis begins in flight, a gust may be present already; it counts as unmeasured and decays
    (`schemes.prepare_takeover`).
    """
    fill_velocity(gust, y, attitude)
    gust.output.V = y[AIRSPEED]
    update_axes(gust, 1.0 + 0.0j, np.inf)


@kernel
def turned(v, z):
    """v (3,) in level axes, turned by an angle about the vertical; z = exp(i angle)."""
    level = complex(v[0], v[1]) * z
    return level.real, level.imag, v[2]


@kernel
def update_axes(gust, z, dt):
    """Fill C for this instant, its rate of change C_dot, 1/s, over the dt s since the instant before, and
    whether the axes turn fast.

    z = exp(-i change of heading). The axes of JSBSim's gusts have the heading of the step before, so C has
    the rows of T in the level axes of that step.

    A constant unmeasured gust of deviation sigma = sqrt(Q tau / 2) changes in body axes at the rate
    sigma C_dot. Over its lag tau this equals a random walk of (C_dot tau)^2 / 2 times its intensity. The turn
    is fast if that exceeds FAST_TURN_SHARE for the largest C_dot and the tau of the rolling gust.
    """
    mem = gust.memory
    C = gust.output.C
    fastest = 0.0
    for i in range(3):
        row = turned(mem.T[i], z.conjugate())
        for j in range(3):
            mem.C_dot[i, j] = (row[j] - C[i, j]) / dt
            fastest = max(fastest, abs(mem.C_dot[i, j]))
        C[i, :] = row
    mem.turns_fast = 0.5 * (fastest * gust_lag(gust, ROLL, gust.output.V)) ** 2 > FAST_TURN_SHARE


@kernel
def advance_gust(gust, y, attitude, dt):
    """Update w (3,) rad/s for the elapsed dt s; the rolling gust stays unknown.

        v_still = v + dt (3 a - a_prev) / 2,  a = T' f + gravity,  turned to the level axes of now
        dv = v_still - v,  v as measured now: change of the gust

    At the first update a_prev is a. y (4 + signals,) and attitude (3,) rad as measured now. The order
    matters: f and T in memory are still those of dt s ago, until `fill_velocity` replaces T and v; f is
    replaced later, by `fill_gust_effect`.
    """
    mem = gust.memory
    v = mem.v
    prev = mem.a_prev
    turn = wrapped(attitude[2] - mem.heading)
    z = complex(np.cos(turn), -np.sin(turn))
    a_x, a_y, a_z = to_level(mem.f, mem.T)
    a = a_x, a_y, a_z + gust.config.gravity
    for i in range(3):
        v[i] += dt * (1.5 * a[i] - 0.5 * (prev[i] if mem.has_prev else a[i]))
    mem.has_prev = 1
    prev[:] = turned(a, z)
    v_still = turned(v, z)
    fill_velocity(gust, y, attitude)  # v is as measured now
    dv = v_still[0] - v[0], v_still[1] - v[1], v_still[2] - v[2]
    update_gust_speed(gust, dv, y[AIRSPEED], dt)
    update_axes(gust, z, dt)
    update_rotation(gust, dv, turn / dt, dt)


@kernel
def update_rotation(gust, dv, psi_dot, dt):
    """Let the pitching and yawing rotation of the air decay, and add what the change of the gust shows of it.

        w_q <- decay_q w_q + dv_z / V tau_q      w_r <- decay_r w_r + dv_y / V tau_r
        start_share <- decay_q start_share

    decay_q = exp(-dt / tau_q), decay_r = exp(-dt / tau_r); dv (3,) m/s: change of the gust in level axes;
    psi_dot rad/s: rate of the heading; dt s.

    The gusts turn with the aircraft: a gust from ahead, of deviation sigma, becomes one from the side, at the
    rate psi_dot sigma. The gust itself is a walk of intensity 3 sigma^2 V / L. The square of that rate over
    this intensity, times the lag of the yawing gust, 3 b / pi V, is the share of the intensity that is
    unmeasured:

        share = psi_dot^2 b L / (pi V^2)        turn_past <- min(max(decay_r turn_past, larger), 1)

    larger: the larger share of this instant and of the one before, because JSBSim's gusts turn a step after
    the heading. If `larger` reaches 1, as when the nose passes the vertical, the vanes mostly measure the
    turn: the yawing gust then only decays, and the sum of changes v_g starts again, with start_left 1.
    """
    cfg = gust.config
    mem = gust.memory
    V = gust.output.V
    tau_q = gust_lag(gust, PITCH, V)
    tau_r = gust_lag(gust, YAW, V)
    decay_q = np.exp(-dt / tau_q)
    decay_r = np.exp(-dt / tau_r)
    share = psi_dot * psi_dot * cfg.span * cfg.L_gust / (pi * V * V)
    larger = max(mem.turn_now, share)
    mem.turn_now = share
    mem.turn_past = min(max(decay_r * mem.turn_past, larger), 1.0)
    mem.start_share *= decay_q
    mem.w[PITCH] = decay_q * mem.w[PITCH] + dv[2] / (V * tau_q)
    mem.w[YAW] *= decay_r
    if larger < 1.0:
        mem.w[YAW] += dv[1] / (V * tau_r)
    else:
        mem.v_g[:] = 0.0
        mem.start_left = 1.0


@kernel
def update_gust_speed(gust, dv, V, dt):
    """Update v_g and V for the elapsed dt s.

        v_g <- clip(decay v_g + dv, -v_max, v_max)      gust.output.V = max(|v + v_g|, V / 2)
        start_left <- decay^2 start_left                decay = exp(-a_v dt)

    dv (3,) m/s: change of the gust in level axes. V m/s: airspeed, which is the speed if no gust is measured.
    """
    mem = gust.memory
    cfg = gust.config
    gust.output.V = V
    if not gust.output.measured:
        return
    decay = np.exp(-cfg.a_v * dt)
    V2 = 0.0
    mem.start_left *= decay * decay
    for i in range(3):
        mem.v_g[i] = min(max(decay * mem.v_g[i] + dv[i], -cfg.v_max), cfg.v_max)
        V2 += (mem.v[i] + mem.v_g[i]) ** 2
    gust.output.V = max(np.sqrt(V2), 0.5 * V)


@kernel
def set_intensity(gust, altitude):
    """Fill Q at this altitude, m: Q_j = max(Q_aloft_j, Q_1m_j / h), of the rolling gust Q_1m_j / h^(3/2).

    h m: the least height for that reading. Near the ground the gusts' scale is the height, sigma constant.
    """
    cfg = gust.config
    h = least_height(altitude, cfg.h0, cfg.h1)
    for j in range(3):
        gust.memory.Q[j] = max(cfg.Q_aloft[j], cfg.Q_1m[j] / (h**1.5 if j == ROLL else h))


@kernel
def step_gust(gust, y, attitude, dt, k):
    """Start at frame k = 0, and update the gust at later frames; arguments as in `advance_gust`."""
    if k > 0:
        advance_gust(gust, y, attitude, dt)
    else:
        start_gust(gust, y, attitude)


@kernel
def fill_gust_effect(gust, design, x, y, u):
    """Fill acc (3,) rad/s2, the effect -L C w of the measured gust from now on, or acc_coarse, that of a gust
    known coarsely; the other is 0. Without any estimate both are 0. Also fill L, and f for the next instant.

    x (3,) rad/s and y (4 + signals,) as measured; u (n,) rad: positions of healthy surfaces.
    """
    mem = gust.memory
    out = gust.output
    fill_specific_force(gust, x, y, u)
    rate_damping(design, x, y, u, mem.scratch, out.rate_damping)
    mem.w_body[:] = out.acc[:] = out.acc_coarse[:] = 0.0
    if out.measured or gust.config.coarse_only:
        for i in range(3):
            mem.w_body[i] = out.C[i, PITCH] * mem.w[PITCH] + out.C[i, YAW] * mem.w[YAW]
    acc = out.acc if out.measured else out.acc_coarse
    for i in range(3):
        acc[i] = -project_gust(mem.w_body, out.rate_damping.T, i)


@kernel
def fill_specific_force(gust, x, y, u):
    """Fill f (3,) m/s2, of this instant: by accelerometers, by a lift that balances the weight and turns with
    the bank, or by the design model; arguments as in `fill_force`."""
    mem = gust.memory
    if gust.output.uses_accelerometers:
        mem.f = mem.f_read
    elif gust.config.coarse_only:
        mem.f[0] = mem.f[1] = 0.0
        mem.f[2] = -gust.config.gravity / max(mem.T[2, 2], MIN_BANK_COSINE)
    else:
        fill_force(gust, x, y, u, mem.f)


@kernel
def begin_gust_sums(gust, V, dt):
    """Start acc_sum of the next frame with this instant, and add to var_now what the turn of C does in the
    dt s to the next instant; V m/s."""
    gust.memory.acc_sum = gust.output.acc
    add_turn_variance(gust, V, dt)


@kernel
def update_gust(gust, design, x, y, u, attitude, dt):
    """Update gust and sums for an instant inside a frame, dt s after the instant before.

    Arguments as in `fill_gust_effect`; attitude (3,) rad.
    """
    advance_gust(gust, y, attitude, dt)
    fill_gust_effect(gust, design, x, y, u)
    for i in range(3):
        gust.memory.acc_sum[i] += gust.output.acc[i]
    add_turn_variance(gust, y[AIRSPEED], dt)


@kernel
def drop_accelerometers(gust):
    """Stop using the accelerometers.

    Without a model of the forces the gust is then unmeasured, and all of its variance counts as unknown.
    """
    mem = gust.memory
    out = gust.output
    out.uses_accelerometers = 0
    if out.measured and not gust.config.has_forces:
        out.measured = 0
        mem.share[:] = 1.0
        for j in (PITCH, YAW):
            add_variance(gust, out.C, j, 0.5 * gust_lag(gust, j, 1.0) * mem.Q[j])


@kernel
def finish_gust(gust, share):
    """Fill acc_mean = share acc_sum, and var_turn, for the elapsed frame; share: one over its instants."""
    for i in range(3):
        gust.output.acc_mean[i] = share * gust.memory.acc_sum[i]
    finish_turn_variance(gust)
