"""The sensor monitor: the tests 0 to 10 between instruments, and their thresholds. Page: instruments.md.

Y (14, steps): readings in the order INSTRUMENTS, in rad, rad/s, m, m/s, m/s2, Pa. Index k - 1 of an equation
is the step before. The tests have the numbers of table 1; arrays by step begin with the second.
"""

from math import radians
from typing import Any

import numpy as np
from numpy import abs as size
from numpy import array, cos, diff, exp, insert, maximum, sin, transpose
from numpy.linalg import norm
from scipy.spatial.transform import Rotation

from reference.bounds import GUST_FT_S, GUST_LIMIT_SIGMA, M_PER_FT, SCALE_FT
from reference.declaration import READINGS

Array = np.ndarray
INSTRUMENTS = (*READINGS, "phi", "theta", "psi", "altitude", "ax", "ay", "az")
POLES_PER_S = array([[1e6], [10.0], [1.0]])  # table "constants" of glossary.md, as the next two
EARTH_TURN = 4e-5  # rad/s
H_RHO = 6300.0  # m
GRAVITY = 9.80665  # m/s2
EARTH_RADIUS = 6371000.0  # m
FORCE_JUMP = 8.0  # m/s2, before the start


def largest(v: Array) -> Array:
    """The largest value of this step and the one before."""
    return maximum(v[..., 1:], v[..., :-1])


def ratios(declaration: Any, Y: Array, h: float, V_0: float, altitude: float) -> Array:
    """(steps, 11): of each test, the largest |E| / T over the three filters. h s: length of a step; V_0 m/s:
    airspeed in trim; altitude m: that of the start. A residual is a measured value minus the predicted one:

    q^ = q[k-1] step,   v^ = step^-1 (v[k-1] + h a),   altitude^ = altitude[k-1] + h v_up
    a = 3/2 a[k-1] - 1/2 a[k-2], the latter turned by the step between; at the start a[k-2] = a[k-1]
    E[k] = a E[k-1] + residual[k],   T_b[k] = a T_b[k-1] + h b[k],   T_n[k] = a T_n[k-1] + (1 - a) n[k-1]
    T[k] = T_b[k] + T_n[k] + n[k] + gusts[k],   T_b[0] = 0, T_n[0] = n[0]
    """
    g = GRAVITY / (1.0 + altitude / EARTH_RADIUS) ** 2
    q = Rotation.from_euler("ZYX", Y[9:6:-1].T)
    step = Rotation.from_quat(insert(h / 2.0 * Y[:3], 3, 1.0, axis=0).T)[:-1]
    a = Y[11:].T + q.inv().apply([0.0, 0.0, g])
    past = insert(step.inv().apply(a[:-1]), 0, a[0], axis=0)
    a = (1.5 * a - 0.5 * past)[:-1]

    q_now = q[:-1] * step
    turned = 2.0 * (q_now.inv() * q[1:]).as_quat(canonical=True).T[:3]
    angles = np.angle(exp(1j * (Y[9:6:-1, 1:] - q_now.as_euler("ZYX").T)))[::-1]
    alpha, beta, V = Y[3:6, :-1]
    v = (V * [cos(alpha) * cos(beta), sin(beta), sin(alpha) * cos(beta)]).T
    x, y, z = step.inv().apply(v + h * a).T
    V_now = norm([x, y, z], axis=0)
    flow = Y[[5, 3, 4], 1:] - [V_now, np.arctan2(z, x), np.arcsin(y / V_now)]
    density = diff(np.log(Y[6] / Y[5] ** 2))
    climb = diff(Y[10]) + h * q[:-1].apply(v).T[2]

    gust = GUST_LIMIT_SIGMA * M_PER_FT * GUST_FT_S[declaration["bounds.turbulence"]]
    n, b, per_gust = thresholds(declaration, Y, h, g, norm(a, axis=1), norm(past[:-1], axis=1), gust)
    keep, E, T_b, T_n, found = exp(-h * POLES_PER_S), 0.0, 0.0, n[0], []
    gusts = gust * (4.2 * V_0 / (M_PER_FT * SCALE_FT) * h / (1.0 - keep**2)) ** 0.5
    for k, residual in enumerate(transpose([*turned, *angles, *flow, density, climb])):
        E = keep * E + residual
        T_b = keep * T_b + h * b[k]
        T_n = keep * T_n + (1.0 - keep) * n[k]
        effect = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, per_gust[k], per_gust[k], 0.0, 0.0]
        found.append((size(E) / (T_b + T_n + n[k + 1] + gusts * effect)).max(axis=0))
    return array(found)


def thresholds(declaration: Any, Y: Array, h: float, g: float, A_0: Array, A_past: Array, gust: float) -> Any:
    """n, from the start, and b, (steps, 11) each, table 4; effect of a gust of 1 m/s on the angles, (steps,).

    A_F = 0.03 + sqrt(sum e_F^2) + g (e_phi + e_theta) + h omega sum bias + h/2 e_omega |a[k-2]|
    """
    declared = [declaration.error(name) for name in INSTRUMENTS]
    e = array([error.e(y) for error, y in zip(declared, Y, strict=True)])
    bias = size([[error.bias] for error in declared])
    n = e - bias + 1e-10 * size(Y)
    drift = radians(declaration["bounds.sensors"].get("phi", {}).get("drift_deg_h", 0.0)) / 3600.0
    e[7:10] += drift * h * np.arange(e[0].size)
    least = Y - e
    V = -largest(-least[5])
    sec = 1.0 / cos(largest(size(Y) + e))
    s_phi, s_theta = size(sin(Y[7:9])) + n[7:9]
    coupled = [s_theta * n[9], s_phi * n[9], s_phi * n[8]]
    density = [2.0, 1.0] @ (n[5:7] / least[5:7])
    n_bar = [*(n[7:10] + coupled), *n[7:10], *n[[5, 3, 4]], density, n[10]]

    past = insert(e, 0, e[:, 0], axis=1)[:, :-2]
    e = e[:, :-1]
    twice = 1.5 * e + 0.5 * past - bias
    turn = sum(size(diff(Y[7:9]))) * sum((e - bias + n[:, 1:])[8:10]) / h
    e_V = e[5]
    e_omega = sum(e[:3])
    vanes = sum(e[3:5])
    level = sum(e[7:9])
    omega = sum(size(Y[:3, :-1])) + e_omega
    axes = omega * (level + e[9] + e[8] * sec[8]) + turn + h * omega * e_omega
    angle = e_omega * (1.0 + h * omega * sec[8]) + 2.0 * sec[8] * omega * level + EARTH_TURN

    A_F = 0.03 + norm(twice[11:], axis=0) + g * sum(twice[7:9])
    A_F += h * (omega * (g * sum(bias[7:9]) + sum(bias[11:])) + e_omega * A_past / 2.0)
    A_F[0] += FORCE_JUMP / 2.0
    A = A_0 + A_F
    more = 1.0 + h * (2.0 * A_0 / V + omega)
    speed = A_F + more * A * vanes + h * (A / V) ** 2 * e_V
    across = (A_F + A * (vanes + e_V / V)) / V + omega * vanes
    flow = more * (sec[4] ** 2 * across + sec[4] * e_omega)

    V_high = Y[5, :-1] + e_V
    V_w = declaration["bounds.vertical_wind_mps"] + gust
    share = bias[5:7] / Y[5:7]
    density = (V_high + V_w) / H_RHO + [2.0, 1.0] @ (size(diff(share)) / (1.0 - largest(share))) / h
    A = maximum(A, largest(insert(A_0, 0, [A_0[0] + FORCE_JUMP] * 2))[:-1])
    climb = V_high * (level + vanes) + e_V + V_w + 4.0 / 3.0 * h * A
    turning = e[:3] + axes + 2.0 * drift + EARTH_TURN
    b = transpose([*turning, *[sec[8] * angle + drift] * 3, speed, flow, flow, density, climb])
    return transpose(n_bar), b, sec[4] / V
