"""The noise model of the statistical detector. Page: statistical.md (state model, unknown constants).

Arrays have a row for each instant. What is said of a frame is that of the instant at which it starts, unless
it is a mean over the frame.
"""

from math import hypot, sqrt
from statistics import NormalDist

import numpy as np

from reference.bounds import (
    DPT_0,
    KW_TO_DPT,
    SEA_LEVEL_KG_M3,
    Bounds,
    gusts_of,
    power_errors,
    published_bound,
)
from reference.declaration import NOISE_LIMIT_SIGMA, Declaration
from reference.directions import ONSETS, directions_of, uses_forces
from reference.gusts import Gusts, L
from reference.prediction import powers, signals_of

EXACT_GYRO_RAD_S, LEAST_BOUND_RAD_S2, MOST_MAPPED_RAD_S2 = 1e-9, 1e-3, 100.0
FULL_CHANGE_SHARE_OF_TRAVEL = 0.25  # a derived model's error goes from one end of its bound to the other
AIR_DATA = ("alpha", "beta", "V", "qdyn")


def tests_of_groups(declaration: Declaration) -> int:
    """Tests of the groups in a frame: pitch once, roll and yaw twice; a loss has one sign, a step two; at
    each onset."""
    pitch = [declaration.aircraft.main_axis[one.surface] == 1 for one in declaration.losses]
    lateral = len(pitch) - sum(pitch)
    return ONSETS * ((sum(pitch) + 2) + 2 * (lateral + 4))


def drift_power(eta_bar: float, omega: float, sigma: float, z: float, dt: float) -> float:
    """Intensity of the drift over eta_bar^2, 1/s.

    An error eta_bar sin(omega t) changes a test by less than half of z (statistical.md). With the density of
    the gyro noise n = sigma^2 dt:

        i_loss = 4 (1.204 eta_bar / z)^2 omega           w = 8 sqrt(2) (eta_bar omega / z)^2
        i_step = (w n^(1/4))^(4/5)                       i = max(hypot(i_step, i_loss), w dt)
    """
    eta_bar = max(eta_bar, LEAST_BOUND_RAD_S2)
    w = 8.0 * sqrt(2.0) * (eta_bar * omega / z) ** 2
    i_loss = 4.0 * (1.204 * eta_bar / z) ** 2 * omega
    i_step = (w * (sigma**2 * dt) ** 0.25) ** 0.8
    return max(hypot(i_step, i_loss), w * dt) / eta_bar**2


class Noise:
    """What is not a fault: drift, variance of f + G u, bounded error, unknown constants; of one flight."""

    def __init__(
        self, declaration: Declaration, bounds: Bounds, attitude: np.ndarray, force: np.ndarray,
        trim: tuple[np.ndarray, ...],
    ) -> None:  # fmt: skip
        self.declaration, self.model, self.bounds, self.trim = declaration, bounds.model, bounds, trim
        self.x, self.y, self.u = bounds.x, bounds.y, bounds.u
        self.parity_directions = directions_of(declaration)
        tests = tests_of_groups(declaration) + sum(one.tests for one in self.parity_directions)
        self.false_alarm = declaration["statistical.false_alarms_per_h"] * declaration.dt / 3600.0 / tests
        z = self.z = -NormalDist().inv_cdf(self.false_alarm)
        self.exact = np.array([declaration.error(gyro).random for gyro in "pqr"])
        self.gyro = np.maximum(self.exact, EXACT_GYRO_RAD_S)
        self.omega = declaration["statistical.uncertainty_rad_s"]
        b, dt = declaration.per_axis("bounds.constant_rad_s2").max(), declaration.dt
        self.intensity = drift_power(b, self.omega, self.exact.max(), z, dt)
        window = 2 ** (ONSETS - 1) * dt
        self.length = trim[1][2] * sqrt(2.0 * window / self.intensity) / z  # m, of the drift that returns
        self.gusts = None
        if declaration["bounds.turbulence"] != "none":
            self.gusts = Gusts(self, attitude, force if uses_forces(declaration) else None)
            self.length = self.gusts.length
        self.eta_bar = self._bounded()
        self.change = self._change()
        self.slopes = self._slopes()
        self.variance = self._variance()
        self.coefficients, self.tolerance = self._coefficients(), self._tolerance()

    def _bounded(self) -> np.ndarray:
        """eta_bar of the tests: the published part, deflections at trim, mu of a derived model. The rest of
        eta_bar is unknown constants."""
        G = np.abs(self.model.nonlinear_G(self.trim[1]))
        found = published_bound(self.declaration, self.model, np.abs(self.x))
        found = found + self.bounds.du @ G.T
        return found + np.minimum(self.bounds.mu, MOST_MAPPED_RAD_S2)

    def _change(self) -> np.ndarray:
        """Largest change of the bounded error in a frame, as a share of its bound: omega dt; of a derived
        model also 2 for each quarter of its travel that a surface moves, at most 2."""
        n = self.declaration.n
        u, share = self.u[::n], self.omega * self.declaration.dt
        if self.bounds.box is None:
            return np.full(len(u), share)
        low, high = self.bounds.mapped_travel()
        moved = np.abs(np.diff(u, axis=0, prepend=np.zeros((1, u.shape[1])))) / np.maximum(high - low, 1e-6)
        return np.minimum(share + 2.0 / FULL_CHANGE_SHARE_OF_TRAVEL * moved.max(axis=1), 2.0)

    def _slopes(self) -> np.ndarray:
        """(instants, 5, 3): change of f + G u by one unit of each reading, by complex steps."""
        step = 1e-30
        found = []
        for direction in self.directions(self.y):
            y = self.y + 1j * step * direction
            moved = (
                self.model.nonlinear_f(self.x, y) + (self.model.nonlinear_G(y) @ self.u[..., None])[..., 0]
            )
            found.append(moved.imag / step)
        return np.stack(found, axis=1)

    def directions(self, y: np.ndarray) -> np.ndarray:
        """(5, *y.shape): change of y by one unit of alpha, beta, V, qdyn, and engine power in kW.

        dpt follows from the last three if errors of the engine's instruments are declared, with
        r = 191.18 / (qdyn V) times the error of the power for the whole density times rho / 1.225:

            d dpt / d V = (2 r - (dpt - 0.08696)) / V,   d dpt / d qdyn = -(r + dpt - 0.08696) / qdyn
        """
        directions = np.zeros((5, *y.shape))
        for j in range(4):
            directions[j, ..., j] = 1.0
        given = power_errors(self.declaration)
        if given:
            V, qdyn, dpt = y[..., 2], y[..., 3], y[..., 4]
            per_kw = KW_TO_DPT / (qdyn * V)
            r = per_kw * given[1] * 2.0 * qdyn / V**2 / SEA_LEVEL_KG_M3
            directions[2, ..., 4] = (2.0 * r - (dpt - DPT_0)) / V
            directions[3, ..., 4] = -(r + dpt - DPT_0) / qdyn
            directions[4, ..., 4] = per_kw
        return directions

    @property
    def reading_sigma(self) -> np.ndarray:
        """(5,): standard deviations of the air data, and of the power, whose error is four of them."""
        power = power_errors(self.declaration)
        sigmas = [self.declaration.error(name).random for name in AIR_DATA]
        return np.array([*sigmas, power[0] / NOISE_LIMIT_SIGMA if power else 0.0])

    def _variance(self) -> np.ndarray:
        """(instants, 3): variance of f + G u by noise of the readings; of gyros with the slopes at trim."""
        x0, y0, u0 = self.trim
        f_x = self.model.derivatives(x0, y0, u0)[0]
        of_gusts = self.gusts.variance if self.gusts else 0.0
        of_readings = ((self.slopes * self.reading_sigma[:, None]) ** 2).sum(axis=1)
        return of_gusts + f_x**2 @ self.exact**2 + of_readings

    def _coefficients(self) -> np.ndarray:
        """(instants, terms, 3): acceleration that each moment coefficient multiplies."""
        model, signal = self.model, signals_of(self.model.aircraft, self.x, self.y)
        found = np.zeros((len(self.x), len(model.terms), 3))
        for j, t in enumerate(model.terms):
            at = 1.0 if t.surface is None else self.u[:, t.surface]
            moment = self.y[:, 3] * model.aircraft.S * model.aircraft.arm[t.axis] * powers(t, signal) * at
            found[:, j] = moment[:, None] * model.per_moment[t.axis]
        return found

    def _tolerance(self) -> np.ndarray:
        """(terms,): tol of each coefficient. Besides its own error it covers, as a share of the coefficient,
        the error of the inertia (of the larger of Pl, Qm, Rn), the slope errors of dynamic pressure, of the
        gyro of its axis and of the signals that it multiplies (a normalised rate has those of airspeed and
        of its gyro, the gyro of its axis counted once). The constant term of an axis covers the biases of
        the gyros, times the slope of the coefficient over the normalised rate at trim."""
        model, declared, (_, y0, u0) = self.model, self.declaration, self.trim
        inertia = max(self.bounds.inertia_error[K] / abs(model.inertia[K]) for K in ("Pl", "Qm", "Rn"))
        slope_of = {name: declared.error(name).slope for name in ("p", "q", "r", *AIR_DATA)}
        rates = {"ph": "p", "qh": "q", "rh": "r"}
        found = []
        for t in model.terms:
            own = "pqr"[t.axis]
            share = inertia + slope_of[own] + slope_of["qdyn"]
            for name, power in t.powers:
                if name in rates:
                    share += power * slope_of["V"]
                if (sensor := rates.get(name, name)) in slope_of and sensor != own:
                    share += power * slope_of[sensor]
            tolerance = declared.coefficient_share(t.name) * abs(t.value) + share * abs(t.value)
            if t.surface is None and not t.powers:
                for i, (name, sensor) in enumerate(rates.items()):
                    normalised = (model.aircraft.b / 2, model.aircraft.c, model.aircraft.b / 2)[i] / y0[2]
                    bias = abs(declared.error(sensor).bias) * normalised
                    tolerance += bias * abs(model.coefficient_slope(t.axis, name, y0, u0))
            found.append(tolerance)
        return np.array(found)

    def known(self, k: int, terms: list[int]) -> np.ndarray:
        """(constants, 3): regressors of the frame that ends at k, means over it: terms, then readings."""
        of_it = slice((k - 1) * self.declaration.n, k * self.declaration.n)
        both = self.coefficients[of_it][:, terms], self.slopes[of_it]
        return np.concatenate(both, axis=1).mean(axis=0)

    @property
    def angle_walk(self) -> float:
        """3 sigma^2 / (L V), V in trim: intensity of the walk of a flow angle by gusts, rad2/s."""
        return float(3.0 * gusts_of(self.declaration)[0] ** 2 / (L * self.trim[1][2]))

    @property
    def steady(self) -> np.ndarray:
        """(5,): tol of the air data and of the power: their biases."""
        power = power_errors(self.declaration)
        biases = [abs(self.declaration.error(name).bias) for name in AIR_DATA]
        return np.array([*biases, power[0] if power else 0.0])
