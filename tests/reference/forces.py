"""Forces that accelerometers measure. Page: statistical.md (forces).

Arrays have a row for each instant. Forces, side (0) and normal (1), are divided by mass and chord, so their
unit is rad/s2. Their vanes measure sideslip and angle of attack.
"""

import numpy as np

from reference.bounds import OMEGA_E
from reference.directions import INERTIAL, SIDE_FORCE
from reference.noise import Noise
from reference.prediction import powers, signals_of, slopes

Array = np.ndarray
GRAVITY, EARTH_M_S2, LAG_S, MASS_SHARE = 9.80665, 0.03, 0.002, 0.05
USUAL_RATE_RAD_S, USUAL_SLOPE, CHANGE_PER_S = 0.2, 0.3, 0.3
VANE, VANES, INSTRUMENTS = (1, 0), ("beta", "alpha"), ("ay", "az")


def flow_rates(x: Array, y: Array, attitude: Array, force: Array) -> list[Array]:
    """Change of sideslip and of angle of attack in still air, rad/s, with a = force + gravity in body axes.

    beta' = p sin(alpha) - r cos(alpha)
            + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
             + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    """
    (p, q, r), (alpha, beta, V), (bank, pitch, _) = x.T, y[:, :3].T, attitude.T
    down = np.array([-np.sin(pitch), np.sin(bank) * np.cos(pitch), np.cos(bank) * np.cos(pitch)])
    a_x, a_y, a_z = force.T + GRAVITY * down
    c, s = np.cos(alpha), np.sin(alpha)
    return [
        p * s - r * c + (a_y * np.cos(beta) - (a_x * c + a_z * s) * np.sin(beta)) / V,
        q - np.tan(beta) * (p * c + r * s) + (a_z * c - a_x * s) / (V * np.cos(beta)),
    ]


class Force:
    """The row of force i in one flight.

    q: dynamic pressure over that in trim. e, std (instants, 4): innovation, and deviation of its noise, by
    what a direction reads: at the angle of the vane, or the integrated one (INERTIAL); eta_bar: bound on its
    error, rad/s2. G, e_G (instants, surfaces): effect of surfaces, and its error, rad/s2 per rad. Z
    (instants, constants), tol (constants,): unknown constants, the last one of the integrated angle. of_vane:
    e by an error of the vane, rad/s2 per rad; L (3,): by rotation of the air, 1/s; Q_e: intensity of the
    drift at the integrated angle.
    """

    def __init__(self, noise: Noise, i: int, attitude: Array, force: Array) -> None:
        """e = a / c - f_hat, at the integrated angle - of_vane q (vane - integral of its rate)

        std^2 = q^2 var + (f_hat sigma_q / qdyn)^2 + (sigma_a / c)^2,   var in trim, by the other readings
        eta_bar = q sum_s |C_s| du_s + 0.002 s |f_hat'|
        Q_e = of_vane^2 ((0.3 drift)^2 + dt (sigma_a / V)^2 + 3 sigma^2 / (L V))
        """
        self.noise, self.i, self.declaration, self.model = noise, i, noise.declaration, noise.model
        self.row, self.own = SIDE_FORCE + i, self.declaration.error(INSTRUMENTS[i])
        y, y0, dt, chord, vane = noise.y, noise.trim[1], noise.declaration.dt, self.model.aircraft.c, VANE[i]
        of_x, of_y = (self.per_coefficient(y0) * of for of in slopes(self.coefficient, *noise.trim[:2]))
        self.L, self.of_vane, self.q = of_x, -of_y[vane], y[:, 3] / y0[3]
        rate = flow_rates(noise.x, y, attitude, force)[i]
        f_hat, per_radian = self.predict(np.concatenate([rate[:1], rate[:-1]]))
        e = self.e = np.repeat((force[:, 1 + i] / chord - f_hat)[:, None], 4, axis=1)
        slope = self.of_vane * self.q
        angle = y[0, vane] + dt * np.concatenate([[0.0], np.cumsum(rate[:-1])])
        e[:, INERTIAL] -= slope * (y[:, vane] - angle)
        own, drift = self.own, self.angle_drift()
        self.Z = np.array([*self.known, np.full_like(f_hat, 1.0 / chord), f_hat, dt * np.cumsum(slope)]).T
        self.tol = np.array([*self.tolerances, abs(own.bias), MASS_SHARE + own.slope, drift])
        by_reading = (noise.directions(y0) @ of_y * noise.reading_sigma) ** 2
        var = by_reading.sum() + (of_x * noise.exact) @ (of_x * noise.exact)
        by_q = f_hat * self.declaration.error("qdyn").random / y[:, 3]
        of_flow = np.outer(self.q**2, var - by_reading[vane] * np.array([0, 0, 0, 1]))
        self.std = np.sqrt(of_flow + (by_q**2 + (own.random / chord) ** 2)[:, None])
        change = np.abs(np.diff(f_hat, prepend=f_hat[0])) / dt
        self.eta_bar = self.q * (noise.bounds.du @ per_radian) + LAG_S * change
        walk = (CHANGE_PER_S * drift) ** 2 + dt * (own.random / y0[2]) ** 2 + noise.angle_walk
        self.Q_e = self.of_vane**2 * walk

    def coefficient(self, x: Array, y: Array) -> Array:
        """C, with the surfaces as in trim."""
        C = self.model.coefficients(self.model.aircraft.forces, x, y)[1 + self.i]
        return C[-1] + C[:-1] @ self.noise.trim[2]

    def per_coefficient(self, y: Array) -> Array:
        """qdyn S / (m c)."""
        return y[..., 3] * self.model.aircraft.S / (self.model.mass * self.model.aircraft.c)

    def predict(self, rate: Array) -> tuple[Array, Array]:
        """f_hat = qdyn S C / (m c), and what a radian of each surface gives at most in trim; fills known,
        tolerances, G, e_G. rate: of sideslip, an instant before, with a term of its own.

            tol_j = |C_j| (share + bias_q / qdyn + slope_q + slope_vane), of a constant + bias_vane |C_vane|
        """
        y, u, aircraft, i = self.noise.y, self.noise.u, self.model.aircraft, self.i
        y0, vane, qdyn = self.noise.trim[1], self.declaration.error(VANES[i]), self.declaration.error("qdyn")
        largest = self.declaration.largest_share
        share = largest + abs(qdyn.bias) / y0[3] + qdyn.slope + vane.slope
        per_C, signal = self.per_coefficient(y), signals_of(aircraft, self.noise.x, y)
        self.known, self.tolerances = [], []
        self.G, self.e_G = np.zeros((2, *u.shape))
        f_hat, per_radian = np.zeros(len(y)), np.zeros(u.shape[1])
        for t in aircraft.forces:
            if t.axis == 1 + i:
                Z, tol = per_C * powers(t, signal), share * abs(t.value)
                if t.surface is not None:
                    self.G[:, t.surface] += t.value * Z
                    self.e_G[:, t.surface] += tol * np.abs(Z)
                    per_radian[t.surface] += abs(t.value) * self.per_coefficient(y0)
                    Z = Z * u[:, t.surface]
                elif not t.powers:
                    tol += abs(vane.bias * self.of_vane) / self.per_coefficient(y0)
                self.known.append(Z)
                self.tolerances.append(tol)
                f_hat += t.value * Z
        if i == 0:
            self.known.append(per_C * aircraft.by_sideslip_rate * rate * aircraft.b / (2.0 * y[:, 2]))
            self.tolerances.append(largest + (0.2 if self.noise.gusts else 0.05))
            f_hat += self.known[-1]
        return f_hat, per_radian

    def angle_drift(self) -> float:
        """Largest rate of the error of the integrated flow angle, rad/s: omega_E + gyros + e_a / V."""
        error, own = self.declaration.error, self.own
        gyros = sum(abs(error(name).bias) + USUAL_RATE_RAD_S * error(name).slope for name in "pqr")
        attitude = abs(error("phi").bias) + abs(error("theta").bias)
        by_gravity = own.slope + USUAL_SLOPE * attitude if self.i else attitude
        e_a = abs(own.bias) + USUAL_SLOPE * abs(error("ax").bias) + EARTH_M_S2 + GRAVITY * by_gravity
        return float(OMEGA_E + gyros + e_a / self.noise.trim[1][2])
