"""The gusts that vanes measure, and what they leave unmeasured. Page: statistical.md (gusts that the vanes
measure).

Arrays have a row for each instant, unless they are of frames. Level axes: forward, right, down, with the
heading of the instant. Gusts roll (0), pitch (1) and yaw (2). Not here: aircraft without a model of forces;
errors of the attitude; a V below half the airspeed.
"""

from math import pi, sqrt
from typing import Any

import numpy as np

from reference.bounds import GUST_FT_S, M_PER_FT, OMEGA_E, ROLLING, SCALE_FT
from reference.prediction import mean_of_frames

Array = np.ndarray
L, G = SCALE_FT * M_PER_FT, 9.80665  # m, m/s2
LEFT_BY_VANES = np.array([1.0, 0.003, 0.03])


def about(axis: int, angle: Array) -> Array:
    """(instants, 3, 3): I + sin(angle) E + (1 - cos(angle)) E^2: components in axes turned about one axis."""
    E, by = np.cross(np.eye(3)[axis], np.eye(3)), angle[:, None, None]
    return np.eye(3) + np.sin(by) * E + (1.0 - np.cos(by)) * E @ E


def times(matrix: Array, v: Array) -> Array:
    """A matrix (instants, 3, n) times a vector (instants, n)."""
    return (matrix @ v[..., None])[..., 0]


def squares(slopes: Array, Q: Array) -> Array:
    """(instants, 3, 3): sum_j slopes_ij slopes_kj Q_j."""
    return slopes * Q[:, None] @ slopes.swapaxes(1, 2)


def changes(y: Array, f: Array, T: Array, psi: Array, dt: float) -> list[Array]:
    """v, dv (instants, 3) m/s in level axes: velocity against the air, and change of the gust in a step.

        dv = v[k-1] + dt (3 a[k-1] - a[k-2]) / 2 - v,   a = T' f + gravity    in axes that do not turn

    f (instants, 3) m/s2 in body axes: force over mass. In the first step a[k-2] is a[k-1].
    """
    level = about(2, psi)
    to_fixed = (T @ level).swapaxes(1, 2)
    v = y[:, 2:3] * (to_fixed @ about(1, y[:, 0]) @ about(2, -y[:, 1]))[..., 0]
    a = times(to_fixed, f) + np.array([0.0, 0.0, G])
    still = v + dt * (1.5 * a - 0.5 * np.concatenate([a[:1], a[:-1]]))
    return [times(level, of_it) for of_it in (v, np.concatenate([v[:1], still[:-1]]) - v)]


def advance(
    v: Array, dv: Array, psi_dot: Array, lags: Array, keep: float, limit: float, dt: float
) -> list[Array]:  # fmt: skip
    """Step by step: V (instants,) m/s; w (instants, 2) rad/s, rotation of the air; h, lost (instants,).

        v_g <- clip(keep v_g + dv, limit)                   V = |v + v_g|
        w_q <- e^(-dt / tau_q) w_q + dv_z / (V tau_q)       w_r alike, with dv_y
        h <- min(max(e^(-dt / tau_r) h, s[k], s[k-1]), 1),  s = psi_dot^2 b L / (pi V^2)
        lost <- keep^2 lost

    h: share of the yawing gust that turns of the heading hide. If s[k] or s[k-1] reaches 1, w_r only decays,
    v_g is 0 and lost, the share of sigma^2 that v_g misses, 1. lags (2,) m: V tau_q and V tau_r.
    """
    (V, s, h, lost), w, v_g = np.zeros((4, len(v))), np.zeros((len(v), 2)), 0.0
    for k in range(len(v)):
        v_g = np.clip(keep * v_g + dv[k], -limit, limit)
        V[k], lost[k] = np.linalg.norm(v[k] + v_g), keep**2 * lost[k - 1]
        fade, s[k] = np.exp(-dt * V[k] / lags), (psi_dot[k] / V[k]) ** 2 * lags[1] * L / 3.0
        larger = max(s[k], s[k - 1])
        h[k] = min(max(fade[1] * h[k - 1], larger), 1.0)
        w[k] = fade * w[k - 1] + dv[k, [2, 1]] / lags * [1.0, larger < 1.0]
        if larger >= 1.0:
            v_g, lost[k] = 0.0, 1.0
    return [V, w, h, lost]


class Gusts:
    """What the detector knows of declared turbulence in one flight, whose noise model is `noise`.

    effect (frames, 3) rad/s2: of the measured gust. variance (3,) (rad/s2)^2: of the effect, by the readings.
    length m: of the drift that returns. walks (2, 2, frames, 3, 3): variance that fast turns of the gusts'
    axes add to the drift, (rad/s2)^2, and intensity of the drift, (rad/s2)^2/s; then the same of the drift
    that returns, times (L_p / length)^2.
    """

    def __init__(self, noise: Any, attitude: Array) -> None:
        """Lags, effect, and what vanes leave of the intensities Q:

            share_j = (1, 0.003, 0.03)_j + (z / 4)^2 (var_V + lost sigma^2) / V^2 + h, at most 1
            drift_ik = max(V_read, V) sum_j (D C)_ij (D C)_kj share_j Q_j
            turns_ik = sum dt V_read sum_j (D C')_ij (D C')_kj tau_j^2 Q_j (1, 0, h)_j / 2
            variance = (D_q s_q)^2 + (D_r s_r)^2,   s_q = (V sigma_alpha + 0.3 sigma_V) / (V tau_q)    at trim

        The second share is of pitch and yaw, h of yaw. D: slopes of the accelerations with the rates; C: from
        the gusts' axes to body axes, C': its change, 1/s. Turns count if (max |C'| tau_p)^2 / 2 > 0.01, in
        the frame and the next. s_r: with sigma_beta.
        """
        declaration, model, y = noise.declaration, noise.model, noise.y
        sigma, n, b = M_PER_FT * GUST_FT_S[declaration["bounds.turbulence"]], declaration.n, model.aircraft.b
        dt, lengths = declaration.dt / n, np.array([sqrt(L * b) / 2.6, 4.0 * b / pi, 3.0 * b / pi])
        Q = sigma**2 / L / lengths**2 * [2.0 * ROLLING**2 / b * lengths[0], 3.0, 3.0]
        phi, theta, psi = np.unwrap(attitude, axis=0).T
        T = about(0, phi) @ about(1, theta)
        v, dv = changes(y, model.specific_force(noise.x, y, noise.u), T, psi, dt)
        turn, (a, var_V) = np.diff(psi, prepend=psi[0]), speed_error(noise, sigma)
        V, w, h, lost = advance(v, dv, turn / dt, lengths[1:], np.exp(-a * dt), 4.0 * sigma, dt)
        C, D, V_read = T @ about(2, turn), model.rate_damping(y), y[:, 2]
        self.effect = -mean_of_frames(n, times(D @ C[..., 1:], w))
        self.length, sigmas, y0 = min(noise.length, lengths[0]), noise.reading_sigma, noise.trim[1]
        s = (y0[2] * sigmas[:2] + 0.3 * sigmas[2]) / lengths[1:]
        self.variance = (model.rate_damping(y0)[:, 1:] * s) ** 2 @ np.ones(2)
        by_speed = (noise.z / 4.0) ** 2 * (var_V + lost * sigma**2) / V**2
        share = LEFT_BY_VANES + np.array([0.0 * V, by_speed, by_speed + h]).T
        drift = squares(D @ C, np.minimum(share, 1.0) * np.outer(np.maximum(V_read, V), Q))[:-1:n]
        change = np.diff(C, axis=0, prepend=C[:1]) / dt
        fast = np.abs(change).max(axis=(1, 2)) > sqrt(0.02) * V / lengths[0]
        hidden = np.array([fast, 0.0 * V, fast * h]).T * np.outer(dt / 2.0 / V_read, Q * lengths**2)
        turns = n * np.nan_to_num(mean_of_frames(n, squares(D @ change, hidden)))
        walks = np.array([turns[1:] + turns[:-1], drift])
        self.walks = np.array([walks, (lengths[0] / self.length) ** 2 * walks])


def speed_error(noise: Any, sigma: float) -> list[float]:
    """a, 1/s: with which the sum of changes decays; var_V, (m/s)^2: variance of the error of the speed.

        a^3 = 2 e^2 V / (L sigma^2),   e = 2 omega_E V + 0.3 * 0.03 m/s2 + 0.3 g (coefficients + 0.05)
        var_V = sigma^2 a / (a + V / L) + (e / a)^2 + sigma_V^2 + (|bias_V| + slope_V V)^2

    e, m/s2: error of the acceleration; coefficients: largest relative error; V m/s at trim.
    """
    V, error, of = noise.trim[1][2], noise.declaration.error("V"), noise.declaration.coefficient_share
    e = 2.0 * OMEGA_E * V + 0.3 * (0.03 + G * (0.05 + max(of(t.name) for t in noise.model.terms)))
    a = (2.0 * e**2 * V / (L * sigma**2)) ** (1.0 / 3.0)
    missed = sigma**2 * a / (a + V / L) + (e / a) ** 2
    return [a, missed + error.random**2 + (abs(error.bias) + error.slope * V) ** 2]
