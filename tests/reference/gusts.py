"""The gusts that vanes measure, and what they leave unmeasured. Page: statistical.md (gusts that the vanes
measure).

Arrays have a row for each instant, unless they are of frames. Level axes: forward, right, down, with the
heading of the instant. Gusts roll (0), pitch (1) and yaw (2). Not here: a heading that turns faster than
V sqrt(pi / (b L)), so that turned (advance) reaches 1.
"""

from math import hypot, pi, sqrt
from typing import Any

import numpy as np

from reference.bounds import GUST_FT_S, M_PER_FT, OMEGA_E, ROLLING, SCALE_FT
from reference.declaration import Declaration
from reference.prediction import DesignModel, mean_of_frames

Array = np.ndarray
L, G = SCALE_FT * M_PER_FT, 9.80665  # m, m/s2
ROLLING_LAG, LEAST_COSINE, MOST_SIGMA, FAST_SHARE = 2.6, 0.5, 4.0, 0.01
LEFT_BY_VANES = np.array([1.0, 0.003, 0.03])


def about(axis: int, angle: Array) -> Array:
    """(instants, 3, 3): components of a vector in axes that are turned by an angle, rad, about one of them."""
    found, i, j = np.zeros((len(angle), 3, 3)), (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, i, i] = found[:, j, j] = np.cos(angle)
    found[:, i, j] = np.sin(angle)
    found[:, j, i] = -found[:, i, j]
    return found


def times(matrix: Array, v: Array) -> Array:
    """A matrix (instants, 3, n) times a vector (instants, n)."""
    return (matrix @ v[..., None])[..., 0]


def squares(slopes: Array, Q: Array) -> Array:
    """(instants, 3, 3): sum_j slopes_ij slopes_kj Q_j."""
    return slopes * Q[:, None] @ slopes.swapaxes(1, 2)


def changes(y: Array, f: Array, attitude: Array, dt: float) -> list[Array]:
    """v, dv (instants, 3) m/s in level axes: velocity against the air, and change of the gust in a step.

        dv = v[k-1] + dt (3 a[k-1] - a[k-2]) / 2 - v,   a = f + gravity    in axes that do not turn

    f (instants, 3) m/s2 in body axes: force over mass. In the first step a[k-2] is a[k-1].
    """
    (phi, theta, psi), level = attitude.T, about(2, attitude[:, 2])
    to_fixed = (about(0, phi) @ about(1, theta) @ level).swapaxes(1, 2)
    v = y[:, 2:3] * (to_fixed @ about(1, y[:, 0]) @ about(2, -y[:, 1]))[..., 0]
    a = times(to_fixed, f) + np.array([0.0, 0.0, G])
    still = v + dt * (1.5 * a - 0.5 * np.concatenate([a[:1], a[:-1]]))
    dv = np.concatenate([0.0 * v[:1], still[:-1] - v[1:]])
    return [times(level, of_it) for of_it in (v, dv)]


def advance(
    v: Array, dv: Array, psi_dot: Array, lags: Array, decay: float, limit: float, dt: float
) -> tuple[Array, ...]:  # fmt: skip
    """Step by step: V (instants,) m/s; w (instants, 2) rad/s, rotation of the air; turned (instants,).

        v_g <- clip(e^(-decay dt) v_g + dv, limit)        V = max(|v + v_g|, |v| / 2)
        w_q <- e^(-dt / tau_q) w_q + dv_z / (V tau_q)     w_r alike, with dv_y
        turned <- max(e^(-dt / tau_r) turned, s[k], s[k-1]),   s = psi_dot^2 b L / (pi V^2)

    turned: share of the yawing gust that turns of the heading hide. lags (2,) m: V tau_q and V tau_r.
    """
    (V, s, turned), w, v_g = np.zeros((3, len(v))), np.zeros((len(v), 2)), np.zeros(3)
    for k, airspeed in enumerate(np.linalg.norm(v, axis=1)):
        v_g = np.clip(np.exp(-decay * dt) * v_g + dv[k], -limit, limit)
        V[k] = max(np.linalg.norm(v[k] + v_g), airspeed / 2.0)
        fade, s[k] = np.exp(-dt * V[k] / lags), (psi_dot[k] / V[k]) ** 2 * lags[1] * L / 3.0
        turned[k] = max(fade[1] * turned[k - 1], s[k], s[k - 1])
        w[k] = fade * w[k - 1] + dv[k, [2, 1]] / lags
    return V, w, turned


class Gusts:
    """What the detector knows of declared turbulence in one flight.

    measured: whether the design model has forces. lengths (3,) m: lag of each gust times the airspeed. Of
    frames, rad/s2: acceleration, that is subtracted from nu, and coarse, by which evidence is corrected.
    drift: its intensity (instants, 3, 3) (rad/s2)^2/s, and that of gusts as slow as the rolling one; by_turn
    (frames, 3, 3) (rad/s2)^2: variance that a fast turn of the gusts' axes adds to it. noise (3,): variance.

        share_j = (1, 0.003, 0.03)_j + (z / 4)^2 var_V / V^2 + turned     at most 1
        drift_ik = max(V_read, V) sum_j (D C)_ij (D C)_kj share_j Q_j

    D: slope of the accelerations with the rates, C: from the gusts' axes to body axes. The second term is not
    of the rolling gust, the third of the yawing one alone. Without forces each share is 1.
    """

    def __init__(
        self, declaration: Declaration, model: DesignModel, of_flight: tuple[Any, ...], y0: Array, z: float
    ) -> None:
        """of_flight: x, y, u, attitude; y0: at trim; z: alarm level."""
        (x, y, u, attitude), b, n = of_flight, model.aircraft.b, declaration.n
        sigma, dt = M_PER_FT * GUST_FT_S[declaration["bounds.turbulence"]], declaration.dt / n
        lengths = self.lengths = np.array([sqrt(L * b) / ROLLING_LAG, 4.0 * b / pi, 3.0 * b / pi])
        Q = 3.0 * sigma**2 / L / lengths**2
        Q[0] = 2.0 * ROLLING**2 * ROLLING_LAG * sigma**2 / (L * b) ** 1.5
        T = about(0, attitude[:, 0]) @ about(1, attitude[:, 1])
        turn = np.diff(attitude[:, 2], prepend=attitude[0, 2])
        turn -= 2.0 * pi * np.round(turn / (2.0 * pi))
        C, D, V_read = T @ about(2, turn), model.rate_damping(y), y[:, 2]
        measured = self.measured = bool(model.forces)
        decay, var_V = speed_error(declaration, model, sigma, y0[2])
        f, limit = np.zeros_like(x), MOST_SIGMA * sigma * measured
        f[:, 2] = -G / np.maximum(T[:, 2, 2], LEAST_COSINE)
        if measured:
            f = model.specific_force(x, y, u)
        V, w, turned = advance(*changes(y, f, attitude, dt), turn / dt, lengths[1:], decay, limit, dt)
        by_speed = (z / 4.0) ** 2 * var_V / V**2
        share = LEFT_BY_VANES + np.stack([0.0 * V, by_speed, by_speed + turned], axis=1)
        walk = np.minimum(share if measured else 1.0, 1.0) * Q * np.maximum(V_read, V)[:, None]
        slower = 1.0 if measured else (lengths / lengths[0]) ** 2
        self.drift = squares(D @ C, walk), squares(D @ C, walk * slower)
        effect = -times(D @ C[..., 1:], w)
        none = 0.0 * mean_of_frames(n, effect)
        self.effects = np.array([mean_of_frames(n, effect), none])
        if not measured:
            self.effects = np.array([none, [*none[:1], *effect[n - 1 : -1 : n]]])
        self.noise = noise_variance(declaration, model.rate_damping(y0), lengths, y0[2])
        C_dot = np.diff(C, axis=0, prepend=C[:1]) / dt
        fast = (np.abs(C_dot).max(axis=(1, 2)) * lengths[0] / V) ** 2 / 2.0 > FAST_SHARE
        hidden = np.stack([fast, 0.0 * V, fast * turned], axis=1) * Q * lengths**2 / V_read[:, None]
        now = n * np.nan_to_num(mean_of_frames(n, squares(D @ C_dot, dt / 2.0 * hidden)))
        self.by_turn = now + np.concatenate([now[:1], now[:-1]])


def speed_error(declaration: Declaration, model: DesignModel, sigma: float, V: float) -> tuple[float, float]:
    """a, 1/s: with which the sum of changes decays; var_V, (m/s)^2: variance of the error of the speed.

        a^3 = 2 e^2 V / (L sigma^2),   e = 2 omega_E V + 0.3 * 0.03 m/s2 + 0.3 g (coefficients + 0.05)
        var_V = sigma^2 a / (a + V / L) + (e / a)^2 + sigma_V^2 + (|bias_V| + slope_V V)^2

    e, m/s2: error of the acceleration; coefficients: largest relative error; V m/s at trim.
    """
    error, share = declaration.error("V"), max(declaration.coefficient_share(t.name) for t in model.terms)
    e = 2.0 * OMEGA_E * V + 0.3 * (0.03 + G * (share + 0.05))
    a = (2.0 * e**2 * V / (L * sigma**2)) ** (1.0 / 3.0)
    missed = sigma**2 * a / (a + V / L) + (e / a) ** 2
    return a, missed + error.random**2 + (abs(error.bias) + error.slope * V) ** 2


def noise_variance(declaration: Declaration, D: Array, lengths: Array, V: float) -> Array:
    """(3,): variance of the effect of the gusts by noise of the readings, (rad/s2)^2.

        (D_q s_q)^2 + (D_r s_r)^2,   s_q = sigma_a / tau_q,   s_r = sigma_b / tau_r
        sigma_a = hypot(sigma_alpha, sigma_theta) + 0.3 (sigma_V / V + sigma_phi)

    sigma_b alike, with beta and psi; D (3, 3) and V of trim.
    """
    alpha, beta, of_V, phi, theta, psi = (declaration.error(name).random for name in FLOW)
    s = np.array([hypot(alpha, theta), hypot(beta, psi)]) + 0.3 * (of_V / V + phi)
    return (D[:, 1:] * s * V / lengths[1:]) ** 2 @ np.ones(2)


FLOW = ("alpha", "beta", "V", "phi", "theta", "psi")
