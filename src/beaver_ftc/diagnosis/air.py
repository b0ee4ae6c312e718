"""What the vanes and the airspeed know of the air's rotation.

A gust that changes along the flight path pitches the aircraft like a pitch rate, and so does one that changes
sideways in yaw [MIL-F-8785C, 3.7]:

    tau_q q_g' + q_g = w_g' / V,  tau_q = 4 b / pi V        tau_r r_g' + r_g = v_g' / V,  tau_r = 3 b / pi V

Vanes and airspeed give the velocity through the moving air; the forces, attitude and gravity say how that
through still air would have changed. The difference is the gust's own change. The rolling gust, which
changes across the span, is seen by no instrument.
"""

from math import pi

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.model import AILERON, AIRSPEED, ALPHA, BETA, DPT, ELEVATOR, FLAP, QDYN, RUDDER


@kernel
def specific_force(air, x, y, u, out):
    """Fill out (3,) m/s2: aerodynamic and propulsive force over mass, body axes [TM88]; x (3,) rad/s, y (5,),
    u (4,) rad. The term in the rate of sideslip is left out: it is below a hundredth of the side force."""
    alpha, beta, V, dpt = y[ALPHA], y[BETA], y[AIRSPEED], y[DPT]
    ph, qh, rh = x[0] * air.span / (2 * V), x[1] * air.chord / V, x[2] * air.span / (2 * V)
    da, de, dr, df = u[AILERON], u[ELEVATOR], u[RUDDER], u[FLAP]
    X, Y, Z = air.longitudinal, air.side, air.normal
    scale = y[QDYN] * air.area_per_mass
    out[0] = scale * (
        X[0] + X[1] * alpha + X[2] * alpha * alpha + X[3] * alpha * alpha * alpha + X[4] * qh + X[5] * dr
        + X[6] * df + X[7] * df * alpha + X[8] * dpt + X[9] * alpha * dpt * dpt
    )  # fmt: skip
    out[1] = scale * (
        Y[0] + Y[1] * beta + Y[2] * ph + Y[3] * rh + Y[4] * da + Y[5] * dr + Y[6] * dr * alpha
    )  # fmt: skip
    out[2] = scale * (
        Z[0] + Z[1] * alpha + Z[2] * alpha * alpha * alpha + Z[3] * qh + Z[4] * de + Z[5] * de * beta * beta
        + Z[6] * df + Z[7] * df * alpha + Z[8] * dpt
    )  # fmt: skip


@kernel
def level_axes(phi, theta, turn):
    """Fill turn (3, 3), from level axes to body axes; level: forward, right, down. Angles rad."""
    sin_phi, cos_phi, sin_theta, cos_theta = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    turn[0, 0], turn[0, 1], turn[0, 2] = cos_theta, 0.0, -sin_theta
    turn[1, 0], turn[1, 1], turn[1, 2] = sin_phi * sin_theta, cos_phi, sin_phi * cos_theta
    turn[2, 0], turn[2, 1], turn[2, 2] = cos_phi * sin_theta, -sin_phi, cos_phi * cos_theta


@kernel
def to_level(turn, body, i):
    """Component i of a body vector (3,) in level axes."""
    return turn[0, i] * body[0] + turn[1, i] * body[1] + turn[2, i] * body[2]


@kernel
def heading_change(now, then):
    """By how much the heading turned, rad, wherever north lies."""
    change = now - then
    return change - 2.0 * pi * np.floor(change / (2.0 * pi) + 0.5)


@kernel
def damping(design, y, out):
    """Fill out (3, 3) 1/s: angular acceleration for each rate of the aircraft against the air; y (5,)."""
    k, V = design.coefficient, y[AIRSPEED]
    lateral, longitudinal = y[QDYN] * design.S * design.b, design.Qm * y[QDYN] * design.S * design.c
    half_span, chord = design.b / (2 * V), design.c / V
    Cl_p, Cl_r, Cn_p, Cn_q, Cn_r = k[0, 2], k[0, 3], k[2, 2], k[2, 4], k[2, 3]
    out[0, 0] = lateral * half_span * (design.Pl * Cl_p + design.Pn * Cn_p)
    out[0, 1] = lateral * chord * design.Pn * Cn_q
    out[0, 2] = lateral * half_span * (design.Pl * Cl_r + design.Pn * Cn_r)
    out[1, 0], out[1, 1], out[1, 2] = 0.0, longitudinal * chord * k[1, 3], longitudinal * half_span * k[1, 5]
    out[2, 0] = lateral * half_span * (design.Rl * Cl_p + design.Rn * Cn_p)
    out[2, 1] = lateral * chord * design.Rn * Cn_q
    out[2, 2] = lateral * half_span * (design.Rl * Cl_r + design.Rn * Cn_r)


@kernel
def advance_axes(air, y, attitude):
    """Bring `turn`, `heading` and the `velocity` through the air, m/s in level axes, to this frame.

    y (5,) and attitude (3,) rad as measured. Of the first frame that is all: no gust has changed yet.
    """
    alpha, beta, V = y[ALPHA], y[BETA], y[AIRSPEED]
    level_axes(attitude[0], attitude[1], air.turn)
    air.heading = attitude[2]
    u, v, w = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    for i in range(3):
        air.velocity[i] = air.turn[0, i] * u + air.turn[1, i] * v + air.turn[2, i] * w


@kernel
def observe(air, y, attitude, dt):
    """Follow the gust over the elapsed frame: `gust` (3,) rad/s in level axes, the rolling one unknown.

    y (5,) and attitude (3,) rad as measured now; `force` and `turn` are still the frame's beginning.
    """
    ahead = air.velocity[0] + dt * to_level(air.turn, air.force, 0)
    right = air.velocity[1] + dt * to_level(air.turn, air.force, 1)
    down = air.velocity[2] + dt * (to_level(air.turn, air.force, 2) + air.gravity)
    turned = heading_change(attitude[2], air.heading)
    advance_axes(air, y, attitude)
    right = right * np.cos(turned) - ahead * np.sin(turned)
    V = y[AIRSPEED]
    pitching, yawing = 4.0 * air.span / (pi * V), 3.0 * air.span / (pi * V)  # lags, s
    air.gust[1] = np.exp(-dt / pitching) * air.gust[1] + (down - air.velocity[2]) / (V * pitching)
    air.gust[2] = np.exp(-dt / yawing) * air.gust[2] + (right - air.velocity[1]) / (V * yawing)


@kernel
def effect(air, design, x, y, u):
    """Fill `acceleration` (3,) rad/s2 with what the gust seen does from here on, and `force` for next time.

    x (3,) rad/s, y (5,), u (4,) rad: measured, and the surfaces in effect.
    """
    specific_force(air, x, y, u, air.force)
    damping(design, y, air.damping)
    for i in range(3):
        air.rotation[i] = air.turn[i, 1] * air.gust[1] + air.turn[i, 2] * air.gust[2]
    for i in range(3):
        air.acceleration[i] = 0.0
        for j in range(3):
            air.acceleration[i] -= air.damping[i, j] * air.rotation[j]


@kernel
def unseen_drift(air, V, i, j):
    """Intensity, (rad/s2)2/s, with which the air's unseen rotation moves accelerations i and j; V m/s."""
    total = 0.0
    for g in range(3):
        on_i, on_j = 0.0, 0.0
        for k in range(3):
            on_i += air.damping[i, k] * air.turn[k, g]
            on_j += air.damping[j, k] * air.turn[k, g]
        total += on_i * on_j * air.unseen[g] * air.per_metre[g]
    return total * V
