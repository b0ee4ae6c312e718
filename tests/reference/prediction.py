"""The design model and what it predicts of a frame. Pages: detection.md (the innovation). Equations: [FDC].

    xdot = f(x, y) + G(y) u        x (3,) rates rad/s; y = (alpha, beta, V, qdyn, signals); u surfaces, rad

Arrays have one row for each instant (a JSBSim step), the last axis is that of the components.
"""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from reference.declaration import AircraftFile, Declaration, Term

RATE_PRODUCTS = (
    ((0, 1, "Ppq"), (1, 2, "Pqr")),
    ((0, 0, "Qpp"), (0, 2, "Qpr"), (2, 2, "Qrr")),
    ((0, 1, "Rpq"), (1, 2, "Rqr")),
)
MOMENT_FACTORS = ((0, "Pl"), (2, "Pn")), ((1, "Qm"),), ((0, "Rl"), (2, "Rn"))
ACTUATOR_ERRORS = ("bandwidth", "rate_limit", "dead_band_deg")
MAIN_PRODUCT = ((1, 2, "Pqr"), (0, 2, "Qpr"), (0, 1, "Rpq"))  # detection.md: C_i x_j x_l


def inertia_coefficients(Ix: float, Iy: float, Iz: float, Jxz: float) -> dict[str, float]:
    """[FDC]: what multiplies rate products and moments."""
    Ir = Ix * Iz - Jxz**2
    return {
        "Ppq": (Ix - Iy + Iz) * Jxz / Ir, "Pqr": ((Iy - Iz) * Iz - Jxz**2) / Ir,
        "Pl": Iz / Ir, "Pn": Jxz / Ir,
        "Qpp": -Jxz / Iy, "Qpr": (Iz - Ix) / Iy, "Qrr": Jxz / Iy, "Qm": 1.0 / Iy,
        "Rpq": ((Ix - Iy) * Ix + Jxz**2) / Ir, "Rqr": (Iy - Iz - Ix) * Jxz / Ir,
        "Rl": Jxz / Ir, "Rn": Ix / Ir,
    }  # fmt: skip


def powers(term: Term, signal: dict[str, np.ndarray]) -> np.ndarray:
    """The product of powers of signals that a term multiplies."""
    found = np.ones_like(signal["alpha"])
    for name, power in term.powers:
        found = found * signal[name] ** power
    return found


def signals_of(aircraft: AircraftFile, x: np.ndarray, y: np.ndarray) -> dict[str, np.ndarray]:
    """ph = p b / 2V, qh = q c / V, rh = r b / 2V, flow angles, and the declared signals."""
    V = y[..., 2]
    found = {"alpha": y[..., 0], "beta": y[..., 1], "ph": x[..., 0] * aircraft.b / (2 * V)}
    found |= {"qh": x[..., 1] * aircraft.c / V, "rh": x[..., 2] * aircraft.b / (2 * V)}
    return found | {name: y[..., 4 + j] for j, name in enumerate(aircraft.signals)}


def slopes(of: Callable[..., Any], x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d of(x, y) / dx (..., 3) and / dy (..., signals), by complex steps."""
    dx, dy = np.hsplit(1e-30j * np.eye(3 + y.size), [3])
    along = np.array([of(x + dx_j, y + dy_j) for dx_j, dy_j in zip(dx, dy, strict=True)]).imag.T / 1e-30
    return along[..., :3], along[..., 3:]


class DesignModel:
    """f and G of the aircraft's file, with the designer's deliberate errors (`design_model`)."""

    def __init__(self, declaration: Declaration) -> None:
        wrong, self.aircraft = declaration.design_model, declaration.aircraft
        mass, ratio = wrong.get("mass", 1.0), wrong.get("inertia") or {}
        self.masses = [
            self.aircraft.file["mass"][f"{name}_kgm2"] * mass * ratio.get(name, 1.0)
            for name in ("Ix", "Iy", "Iz", "Jxz")
        ]
        self.inertia = inertia_coefficients(*self.masses)
        scale, neglected = wrong.get("coefficients") or {}, not wrong.get("engine_terms", True)
        self.terms = [
            term._replace(
                value=0.0
                if neglected and any(name in self.aircraft.signals for name, _ in term.powers)
                else term.value * scale.get(term.name, 1.0)
            )
            for term in self.aircraft.terms
        ]
        self.mass = self.aircraft.file["mass"]["mass_kg"] * mass
        self.linearised, self.frozen_alpha = wrong.get("linearised", False), wrong.get("frozen_alpha", False)

    def anchor(self, x0: np.ndarray, y0: np.ndarray, u0: np.ndarray) -> None:
        """The trim that a linearised model is tied to: f0, G0 and the derivatives of f + G u there."""
        self.x0, self.y0 = x0, y0
        self.f0, self.G0 = self.nonlinear_f(x0, y0), self.nonlinear_G(y0)
        self.f_x, self.f_y = self.derivatives(x0, y0, u0)

    def derivatives(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """d(f + G u) / dx (3, 3) and / dy (3, signals)."""
        return slopes(lambda x, y: self.nonlinear_f(x, y) + self.nonlinear_G(y) @ u, x, y)

    @property
    def per_moment(self) -> np.ndarray:
        """(3, 3): acceleration (columns p, q, r) of one N m about each axis (rows)."""
        found = np.zeros((3, 3))
        for axis in range(3):
            for i, name in MOMENT_FACTORS[axis]:
                found[i, axis] = self.inertia[name]
        return found

    def coefficient_slope(self, axis: int, name: str, y: np.ndarray, u: np.ndarray) -> float:
        """d C / d signal of the coefficient of an axis, without rates, by a complex step."""
        signal = signals_of(self.aircraft, np.zeros(3), y + 0j)
        signal[name] = signal[name] + 1e-30j
        of_axis = [t for t in self.terms if t.axis == axis]
        total = sum(
            t.value * powers(t, signal) * (1.0 if t.surface is None else u[t.surface]) for t in of_axis
        )
        return float(np.imag(total) / 1e-30)

    def f(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """f(x, y) (..., 3) rad/s2; linearised: f0 + f_x (x - x0) + f_y (y - y0)."""
        if self.linearised:
            f_y = self.f_y.copy()
            if self.frozen_alpha:
                f_y[:, 0] = 0.0
            return self.f0 + (x - self.x0) @ self.f_x.T + (y - self.y0) @ f_y.T
        return self.nonlinear_f(x, self._frozen(y))

    def G(self, y: np.ndarray) -> np.ndarray:
        """G(y) (..., 3, surfaces) rad/s2 per rad; linearised: that of the trim."""
        if self.linearised:
            return np.broadcast_to(self.G0, (*y.shape[:-1], *self.G0.shape)).copy()
        return self.nonlinear_G(self._frozen(y))

    def _frozen(self, y: np.ndarray) -> np.ndarray:
        if not self.frozen_alpha:
            return y
        held = y.copy()
        held[..., 0] = self.y0[0]
        return held

    def nonlinear_f(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """[FDC]: rate products and moments of the terms without a surface."""
        C, moment = self.coefficients(self.terms, x, y)[:, -1], self._per_coefficient(y)
        return np.stack(
            [
                sum(self.inertia[K] * x[..., i] * x[..., j] for i, j, K in RATE_PRODUCTS[axis])
                + sum(self.inertia[K] * moment[i] * C[i] for i, K in MOMENT_FACTORS[axis])
                for axis in range(3)
            ],
            axis=-1,
        )

    def nonlinear_G(self, y: np.ndarray) -> np.ndarray:
        """The same of one radian of each surface."""
        C, moment = self.coefficients(self.terms, np.zeros(3), y)[:, :-1], self._per_coefficient(y)
        G = [sum(self.inertia[K] * moment[i] * C[i] for i, K in MOMENT_FACTORS[axis]) for axis in range(3)]
        return np.moveaxis(np.array(G), (0, 1), (-2, -1))

    def _per_coefficient(self, y: np.ndarray) -> list[np.ndarray]:
        """qdyn S b, qdyn S c, qdyn S b: moment of a coefficient of 1, N m."""
        return [y[..., 3] * self.aircraft.S * arm for arm in self.aircraft.arm]

    def coefficients(self, terms: list[Term], x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(3, surfaces + 1, ...): sum of the terms of a radian of each surface, then of those without."""
        signal = signals_of(self.aircraft, x, y)
        C = np.zeros((3, len(self.aircraft.surfaces) + 1, *y.shape[:-1]), dtype=signal["ph"].dtype)
        for t in terms:
            C[t.axis, -1 if t.surface is None else t.surface] += t.value * powers(t, signal)
        return C

    def specific_force(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """(instants, 3) m/s2, body axes: force over mass, qdyn S C(x, y, u) / m."""
        C = self.coefficients(self.aircraft.forces, x, y)
        return y[:, 3:4] * self.aircraft.S / self.mass * (C[:, -1] + (C[:, :-1] * u.T).sum(axis=1)).T

    def rate_damping(self, y: np.ndarray) -> np.ndarray:
        """D (..., 3, 3) 1/s: slope of the accelerations by the moments (rows) with the rates against the air
        (columns), by complex steps. Without rates, because the moments are linear in them."""
        along = [self.nonlinear_f(direction, y).imag for direction in 1e-30j * np.eye(3)]
        return np.stack(along, axis=-1) / 1e-30

    def inertia_errors(self, share: float) -> dict[str, float]:
        """Largest change of each inertia coefficient for Ix, Iy, Iz, Jxz within a share: it is at a corner,
        because a coefficient is monotonic in each inertia."""
        largest = dict.fromkeys(self.inertia, 0.0)
        for signs in product((-1.0, 1.0), repeat=4):
            corner = inertia_coefficients(*(np.array(self.masses) * (1 + share * np.array(signs))))
            largest = {K: max(largest[K], abs(corner[K] - self.inertia[K])) for K in largest}
        return largest


class Servos:
    """The actuators of an aircraft as they are declared, with factors on bandwidth and rate limit.

        u <- u + limited((target - u) (1 - exp(-bandwidth dt_s))),   |limited| <= rate limit times dt_s

    within the travel. Ideal surfaces are at their command.
    """

    def __init__(self, declaration: Declaration, of_bandwidth: np.ndarray, of_limit: np.ndarray) -> None:
        given = declaration.design_model.get("actuators") or declaration.scenario.get("actuators") or "ideal"
        of_all = given if isinstance(given, dict) else {}
        one = [of_all.get(s, of_all) for s in declaration.aircraft.surfaces]
        bandwidth = np.array([of.get("bandwidth_rad_s", 0.0) for of in one]) * of_bandwidth
        limit = np.radians([of.get("rate_limit_deg_s", 0.0) for of in one]) * of_limit
        dt_s = declaration.dt / declaration.n
        self.travel, self.ideal = declaration.aircraft.travel, not (bandwidth.any() or limit.any())
        self.share = np.where(bandwidth > 0, 1.0 - np.exp(-bandwidth * dt_s), 1.0)
        self.step = np.where(limit > 0, limit * dt_s, np.inf)

    def moved(self, u: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Where surfaces at u (surfaces,) rad are a JSBSim step later."""
        if self.ideal:
            return np.broadcast_to(target, self.share.shape)
        way = (within(self.travel, target) - u) * self.share
        return within(self.travel, u + within((-self.step, self.step), way))


def within(ends: tuple[np.ndarray, np.ndarray], value: np.ndarray) -> np.ndarray:
    """A value, or the end that is nearest to it."""
    return np.minimum(np.maximum(value, ends[0]), ends[1])


def possible_servos(declaration: Declaration) -> tuple[Servos, np.ndarray, np.ndarray]:
    """The four extremes of the actuators by the declared errors of bandwidth and rate limit, a row each; the
    dead bands, rad, and the errors of the rate limits, a column for each surface."""
    errors = declaration["bounds.actuators"]
    each = [{**errors, **errors.get(s, {})} for s in declaration.aircraft.surfaces]
    w, r, d = (np.array([of.get(key, 0.0) for of in each]) for key in ACTUATOR_ERRORS)
    signs = np.array([*product((-1.0, 1.0), repeat=2)])
    return Servos(declaration, 1.0 + signs[:, :1] * w, 1.0 + signs[:, 1:] * r), np.radians(d), r


def servo_positions(
    declaration: Declaration, command: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions u (instants, surfaces) rad of healthy surfaces under the command (instants, surfaces) rad
    that acts in each JSBSim step, and how far from u they may be by the declared errors, du.

    The ends of where a surface may be go by the farthest of all steps that errors of bandwidth and rate limit
    allow, to a target within the dead band of the command."""
    (possible, band, _), travel = possible_servos(declaration), declaration.aircraft.travel
    known = Servos(declaration, 1.0 + 0.0 * band, 1.0 + 0.0 * band)
    u = command.copy()
    u[0] = start
    for j in range(1, len(command)):
        u[j] = known.moved(u[j - 1], command[j])
    du = np.radians(declaration["bounds.deflection_deg"]) + np.zeros_like(u)
    if not declaration["bounds.actuators"]:
        return u, du
    low, high = within(travel, command - band), within(travel, command + band)
    low[0], high[0] = within(travel, start - band), within(travel, start + band)
    for j in range(1, len(command)):
        low[j] = possible.moved(low[j - 1], low[j]).min(axis=0)
        high[j] = possible.moved(high[j - 1], high[j]).max(axis=0)
    return u, du + np.maximum(high - u, u - low)


class Frames(NamedTuple):
    """Means over the frames that end at k = 0, 1, ...; row 0 is not a number.

    F, G, Gu, u: f + G u, G, the effect of each surface, its position; r: tolerance for a fault that changes
    in the frame.
    """

    F: np.ndarray
    G: np.ndarray
    Gu: np.ndarray
    u: np.ndarray
    r: np.ndarray


def mean_of_frames(n: int, of_instants: np.ndarray) -> np.ndarray:
    """Mean over the n instants of the frame before each k: those from its start to the last one inside. The
    first of them is still under the old command."""
    means = of_instants[:-1].reshape(-1, n, *of_instants.shape[1:]).mean(axis=1)
    return np.concatenate([np.full((1, *of_instants.shape[1:]), np.nan), means])


def frames_of(declaration: Declaration, f: np.ndarray, G: np.ndarray, u: np.ndarray) -> Frames:
    """Means over frames. Tolerance r_s (isolation.md): with z0 the effect G u of a healthy surface in the
    first step and z its mean over the others, r_s = |z0 - z| / n_s, and 0 with one step."""
    n, Gu = declaration.n, G * u[:, None, :]
    r = np.zeros_like(Gu[: len(Gu[:-1]) // n])
    if n > 1:
        by_frame = Gu[:-1].reshape(-1, n, *Gu.shape[1:])
        r = np.abs(by_frame[:, 0] - by_frame[:, 1:].mean(axis=1)) / n
    return Frames(
        mean_of_frames(n, f + Gu.sum(axis=-1)), mean_of_frames(n, G), mean_of_frames(n, Gu),
        mean_of_frames(n, u), np.concatenate([np.zeros((1, *Gu.shape[1:])), r]),
    )  # fmt: skip
