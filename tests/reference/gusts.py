"""The gusts that vanes measure, and what they leave unmeasured. Page: statistical.md (gusts that the vanes
measure).

Arrays have a row for each instant, unless they are of frames. Level axes: forward, right, down, with the
heading of the instant. Gusts roll (0), pitch (1) and yaw (2). Not here: aircraft without a model of forces;
a V below half the airspeed.
"""

from collections.abc import Callable
from math import pi, sqrt
from typing import Any

import numpy as np

from reference.bounds import M_PER_FT, OMEGA_E, ROLLING, SCALE_FT, gusts_of, least_height
from reference.prediction import mean_of_frames

Array = np.ndarray
L, G = SCALE_FT * M_PER_FT, 9.80665  # m, m/s2
STEP_GAIN = 1.6  # sqrt(1.5^2 + 0.5^2), of the two-step method
Flow = Callable[[int, Array], Array]
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


def velocity(y: Array) -> Array:
    """V (cos(alpha) cos(beta), sin(beta), sin(alpha) cos(beta)): against the air, m/s in body axes."""
    alpha, beta, V = y[:3]
    return V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])


class Estimate:
    """One estimate of the gust. For each instant: V m/s; w (2,) rad/s, pitching and yawing rotation of the
    air in level axes with the heading of the instant before; C (3, 3): from these to body axes; C_dot, 1/s;
    share (3,): what is unmeasured of the intensities Q; hidden (3,): shares that count where axes turn fast;
    effect (3,) rad/s2 on the rates; D: of `Gusts`."""

    def __init__(self, noise: Any, attitude: Array, force: Array, flow: Flow, left: Array) -> None:
        """From the flow, step by step, with the force over mass (instants, 3), m/s2 in body axes.

            dv = v[k-1] + dt (3 a[k-1] - a[k-2]) / 2 - v,   a = T' force + gravity    in axes that do not turn
            v_g <- clip(keep v_g + dv, 4 sigma)                 V = |v + v_g|
            w_q <- e^(-dt / tau_q) w_q + dv_z / (V tau_q)       w_r alike, with dv_y
            h <- min(max(e^(-dt / tau_r) h, s[k], s[k-1]), 1),  s = psi_dot^2 b L / (pi V^2)
            lost <- keep^2 lost
            share_j = left_j + (z / 4)^2 (var_V + lost sigma^2) / V^2 + h, at most 1
            effect = -D C w

        In the first step a[k-2] is a[k-1]. h: share of the yawing gust that turns of the heading hide. If
        s[k] or s[k-1] reaches 1, w_r only decays, v_g is 0 and lost, the share of sigma^2 that v_g misses, 1.
        The second part of the share is of pitch and yaw, h of yaw. flow(k, w): y at instant k, of which w
        (3,) is the rotation of the air in body axes in the instant before.
        """
        self.sigma = gusts_of(noise.declaration)[0]
        dt, b, n = noise.declaration.dt / noise.declaration.n, noise.model.aircraft.b, len(force)
        self.lags = np.array([sqrt(L * b) / 2.6, 4.0 * b / pi, 3.0 * b / pi])
        a_v, var_V = speed_error(noise, self.sigma)
        bank, pitch, psi = np.unwrap(attitude, axis=0).T
        T, level, turn = about(0, bank) @ about(1, pitch), about(2, psi), np.diff(psi, prepend=psi[0])
        self.C = T @ about(2, turn)
        self.C_dot = np.diff(self.C, axis=0, prepend=self.C[:1]) / dt
        to_fixed = (T @ level).swapaxes(1, 2)
        a = times(to_fixed, force) + np.array([0.0, 0.0, G])
        gained = dt * (1.5 * a - 0.5 * np.concatenate([a[:1], a[:-1]]))
        self.V, s, h, lost = np.zeros((4, n))
        self.w, v_g, v, keep, limit = (
            np.zeros((n, 2)),
            0.0,
            np.zeros((n, 3)),
            np.exp(-a_v * dt),
            4.0 * self.sigma,
        )
        y, rotation = np.zeros_like(noise.y), np.zeros(3)
        for k in range(n):
            y[k] = flow(k, rotation)
            v[k] = to_fixed[k] @ velocity(y[k])
            dv = level[k] @ (v[k - 1] + gained[k - 1] - v[k]) if k else np.zeros(3)
            v_g = np.clip(keep * v_g + dv, -limit, limit)
            V = self.V[k] = np.linalg.norm(level[k] @ v[k] + v_g)
            lost[k], fade = keep**2 * lost[k - 1], np.exp(-dt * V / self.lags[1:])
            s[k] = (turn[k] / dt / V) ** 2 * self.lags[2] * L / 3.0
            larger = max(s[k], s[k - 1])
            h[k] = min(max(fade[1] * h[k - 1], larger), 1.0)
            self.w[k] = fade * self.w[k - 1] + dv[[2, 1]] / self.lags[1:] * [1.0, larger < 1.0]
            rotation = self.C[k, :, 1:] @ self.w[k]
            if larger >= 1.0:
                v_g, lost[k] = 0.0, 1.0
        self.D = noise.model.rate_damping(y)
        self.effect = -times(self.D @ self.C[..., 1:], self.w)
        by_speed = (noise.z / 4.0) ** 2 * (var_V + lost * self.sigma**2) / self.V**2
        self.share = np.minimum(left + np.array([0.0 * h, by_speed, by_speed + h]).T, 1.0)
        self.hidden = np.array([np.ones(n), 0.0 * h, h]).T

    @property
    def fast(self) -> Array:
        """(instants,): whether the axes of the gusts turn fast, (max |C_dot| tau_p)^2 / 2 > 0.01."""
        return np.abs(self.C_dot).max(axis=(1, 2)) > sqrt(0.02) * self.V / self.lags[0]


def intensities(sigma: float, scale: Array, b: float) -> Array:
    """(instants, 3): 2 1.9^2 2.6 sigma^2 / (L b)^(3/2), 3 sigma^2 pi^2 / (16 L b^2), and with 9 for 16."""
    rolling = 2.0 * ROLLING**2 * 2.6 * sigma**2 / (scale * b) ** 1.5
    pitching, yawing = (3.0 * (sigma * pi / b) ** 2 / (of * scale) for of in (16.0, 9.0))
    return np.array([rolling, pitching, yawing]).T


class Gusts:
    """What the detector knows of declared turbulence in one flight, whose noise model is `noise`.

    Q (instants, 3): intensities of the gusts, over V, at the height at which the frame starts. effect
    (frames, 3) rad/s2: of the measured gust. variance (3,)
    (rad/s2)^2: of the effect, by the readings. length m: of the drift that returns. walks (2, 2, frames, 3,
    3): variance that fast turns of the gusts' axes add to the drift, (rad/s2)^2, and intensity of the drift,
    (rad/s2)^2/s; then the same of the drift that returns, times (L_p / length)^2.
    """

    def __init__(self, noise: Any, attitude: Array, accelerometers: Array | None) -> None:
        """The force is that of the accelerometers, or else of the design model. D: slopes of the
        accelerations with the rates.

            drift_ik = max(V_read, V) sum_j (D C)_ij (D C)_kj share_j Q_j
            turns_ik = sum dt V_read sum_j (D C_dot)_ij (D C_dot)_kj tau_j^2 Q_j hidden_j / 2
        """
        y, dt, n = noise.y, noise.declaration.dt / noise.declaration.n, noise.declaration.n
        force = noise.model.specific_force(noise.x, y, noise.u) if accelerometers is None else accelerometers
        of = self.estimate = Estimate(noise, attitude, force, lambda k, _: y[k], LEFT_BY_VANES)
        aloft, low = gusts_of(noise.declaration)
        h = least_height(noise.declaration, noise.bounds.altitude)[np.arange(len(y)) // n * n]
        b = noise.model.aircraft.b
        self.Q = np.maximum(intensities(aloft, 0.0 * h + L, b), intensities(low, h, b))
        self.effect = mean_of_frames(n, of.effect)
        self.length, V_read = min(noise.length, of.lags[0]), y[:, 2]
        sigma = flow_noise(noise)
        if accelerometers is not None:
            in_step = [noise.declaration.error(name).random for name in ("az", "ay")]
            sigma = sigma + STEP_GAIN * np.array(in_step) * noise.declaration.dt / noise.trim[1][2]
        self.variance = self.noise_of(noise, sigma) ** 2
        drift = squares(of.D @ of.C, of.share * np.maximum(V_read, of.V)[:, None] * self.Q)[:-1:n]
        by_turn = of.fast[:, None] * of.hidden * (dt / 2.0 / V_read)[:, None] * self.Q * of.lags**2
        turns = n * np.nan_to_num(mean_of_frames(n, squares(of.D @ of.C_dot, by_turn)))
        walks = np.array([turns[1:] + turns[:-1], drift])
        self.walks = np.array([walks, (of.lags[0] / self.length) ** 2 * walks])

    def noise_of(self, noise: Any, sigma: Array) -> Array:
        """(3,) rad/s2, of the effect by noise sigma (2,) rad of the angles of the flow, all in trim.

        sqrt((D_q s_q)^2 + (D_r s_r)^2),   s = V sigma / (V tau)
        """
        y0 = noise.trim[1]
        D, s = noise.model.rate_damping(y0), y0[2] * sigma / self.estimate.lags[1:]
        return np.sqrt((D[:, 1:] * s) ** 2 @ np.ones(2))


def flow_noise(noise: Any) -> Array:
    """(2,) rad: hypot(sigma_alpha, sigma_pitch) + 0.3 (sigma_V / V + sigma_bank); of sideslip and heading."""
    random = [noise.declaration.error(name).random for name in ("alpha", "beta", "theta", "psi", "V", "phi")]
    return np.hypot(random[:2], random[2:4]) + 0.3 * (random[4] / noise.trim[1][2] + random[5])


def speed_error(noise: Any, sigma: float) -> list[float]:
    """a, 1/s: with which the sum of changes decays; var_V, (m/s)^2: variance of the error of the speed.

        a^3 = 2 e^2 V / (L sigma^2),
        e = 2 omega_E V + 0.3 * 0.03 m/s2 + g (|bias_bank| + |bias_pitch| + 0.3 (coefficients + 0.05))
        var_V = sigma^2 a / (a + V / L) + (e / a)^2 + sigma_V^2 + (|bias_V| + slope_V V)^2

    e, m/s2: error of the acceleration; coefficients: largest relative error; V m/s at trim.
    """
    V, declared = noise.trim[1][2], noise.declaration
    error = declared.error("V")
    attitude = abs(declared.error("phi").bias) + abs(declared.error("theta").bias)
    e = 2.0 * OMEGA_E * V + 0.3 * 0.03 + G * (attitude + 0.3 * (0.05 + declared.largest_share))
    a = (2.0 * e**2 * V / (L * sigma**2)) ** (1.0 / 3.0)
    missed = sigma**2 * a / (a + V / L) + (e / a) ** 2
    return [a, missed + error.random**2 + (abs(error.bias) + error.slope * V) ** 2]
