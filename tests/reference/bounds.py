"""The bound on the model error, from the declaration. Page: detection.md (the bound on the model error).

eta_bar_i = c_i |C_i x_j x_l| + b_i + omega_E ((1 + kappa_i)(|p| + |q| + |r|) + kappa_i omega_E)
            + rho + eta_bar_e,i + mu_i
"""

from math import pi, sqrt

import numpy as np

from reference.declaration import READINGS, Declaration
from reference.prediction import (
    MAIN_PRODUCT,
    MOMENT_FACTORS,
    RATE_PRODUCTS,
    DesignModel,
    powers,
    signals_of,
)

OMEGA_E = 2.0 * pi / 86164.0905  # rad/s: a turn in a sidereal day
RHO = 1e-11  # rad/s2
GUST_LIMIT_SIGMA = 6.0
OUTSIDE_RAD_S2 = 1e6  # mu outside the boxes of a derived model
EDGE = 1e-9  # share by which the boxes are larger, for rounding
GUST_FT_S = {"none": 0.0, "light": 7.4, "moderate": 10.6, "severe": 23.6}  # MIL-F-8785C, above 2000 ft
LOW_GUST_FT_S = {"none": 0.0, "light": 2.53, "moderate": 5.06, "severe": 7.6}  # a tenth of the wind at 20 ft
SCALE_FT, M_PER_FT, ROLLING = 1750.0, 0.3048, 1.9  # Yeager1998, eq. 8


def kappa(K: dict[str, float]) -> np.ndarray:
    """Factor of the Earth's rate: sum of the magnitudes of the coefficients of the inertia coupling, in which
    a square counts twice, and the two squares of pitch as the larger of them; at least 1."""
    roll, yaw = abs(K["Ppq"]) + abs(K["Pqr"]), abs(K["Rpq"]) + abs(K["Rqr"])
    pitch = abs(K["Qpr"]) + 2.0 * max(abs(K["Qpp"]), abs(K["Qrr"]))
    return np.maximum([roll, pitch, yaw], 1.0)


def gusts_of(declaration: Declaration) -> tuple[float, float]:
    """sigma_w, m/s: above 2000 ft, where its scale is 1750 ft; below 1000 ft, where it is the height."""
    severity = declaration["bounds.turbulence"]
    return M_PER_FT * GUST_FT_S[severity], M_PER_FT * LOW_GUST_FT_S[severity]


def least_height(declaration: Declaration, altitude: np.ndarray) -> np.ndarray:
    """Least height of the aircraft, m: altitude less its error, at least 10 ft."""
    return np.maximum(altitude - declaration.error("altitude").e(altitude), 10.0 * M_PER_FT)


def air_rotation(declaration: Declaration, altitude: np.ndarray) -> np.ndarray:
    """6 standard deviations of the air's rotation about any axis, rad/s: that of the rolling gust,
    1.9 sigma_w / sqrt(L b), above 2000 ft or near the ground, whichever is larger."""
    (aloft, low), b = gusts_of(declaration), declaration.aircraft.b
    near = low / np.sqrt(least_height(declaration, altitude) * b)
    return GUST_LIMIT_SIGMA * ROLLING * np.maximum(aloft / sqrt(SCALE_FT * M_PER_FT * b), near)


def gyro_error(declaration: Declaration, x: np.ndarray) -> np.ndarray:
    """Changing part of the gyro errors: n_i = o - |bias| + slope (|x_i| + e), rad/s."""
    n = np.empty_like(x)
    for i, error in enumerate(map(declaration.error, "pqr")):
        v = x[:, i]
        n[:, i] = error.o - abs(error.bias) + error.slope * (np.abs(v) + error.e(v))
    return n


DPT_0, KW_TO_DPT, SEA_LEVEL_KG_M3 = 0.08696, 191.18, 1.225  # FDC: dpt = 0.08696 + 191.18 P / (qdyn V)


def power_errors(declaration: Declaration) -> tuple[float, float] | None:
    """Largest errors of the engine's power, kW: by its instruments, and for the whole of the density rho /
    1.225.

        P = 0.7355 (-326.5 + 0.00412 (pz + 7.4)(n + 2010) + (408.0 - 0.0965 n)(1 - rho / 1.225))

    n is that at the start, pz anything up to the engine's largest. None if no error of an instrument from
    which dpt is computed is declared.
    """
    used = [declaration.error(name) for name in ("V", "qdyn", "engine_rpm", "manifold_pressure")]
    settings = (declaration.aircraft.file.get("engine") or {}).get("settings") or {}
    if not any(map(any, used)) or not {"engine_rpm", "manifold_pressure_inhg"} <= set(settings):
        return None
    rpm = (declaration.scenario.get("initial") or {}).get("engine_rpm", settings["engine_rpm"]["default"])
    inhg = settings["manifold_pressure_inhg"]["range"][1]
    e_rpm, e_inhg = used[2].e(rpm), used[3].e(inhg)
    by_chart = 0.00412 * ((inhg + 7.4 + e_inhg) * e_rpm + (rpm + e_rpm + 2010.0) * e_inhg)
    return 0.7355 * (by_chart + 0.0965 * e_rpm), 0.7355 * max(408.0 - 0.0965 * (rpm - e_rpm), 0.0)


def slipstream_error(declaration: Declaration, y: np.ndarray) -> np.ndarray:
    """Bound on the error of dpt, which is computed from the engine's instruments and the air data.

        dpt = 0.08696 + 191.18 P / (qdyn V),   rho = 2 qdyn / V^2

    With e_q, e_V, e_rho the relative errors
    (those of airspeed and pressure at most 0.9), s = 1 / ((1 - e_q)(1 - e_V)), e_P the error of the power:

        e = s 191.18 e_P / (qdyn V) + (s - 1) |dpt - 0.08696|,   1 + e_rho = (1 + e_q) / (1 - e_V)^2
    """
    given = power_errors(declaration)
    if not given:
        return np.zeros(len(y))
    by_instruments, by_density = given
    used = [declaration.error(name) for name in ("V", "qdyn")]
    V, qdyn, dpt = y[:, 2], y[:, 3], y[:, 4]
    e_V, e_q = np.minimum(used[0].e(V) / V, 0.9), used[1].e(qdyn) / qdyn
    s = 1.0 / ((1.0 - np.minimum(e_q, 0.9)) * (1.0 - e_V))
    e_rho = (1.0 + e_q) / (1.0 - e_V) ** 2 - 1.0
    e_P = by_instruments + by_density * e_rho * 2.0 * qdyn / V**2 / SEA_LEVEL_KG_M3
    return s * KW_TO_DPT * e_P / (qdyn * V) + (s - 1.0) * np.abs(dpt - DPT_0)


class Magnitudes:
    """|v| of every factor as measured (`as_read`), and as large as its error allows (`largest`).

    The airspeed divides, so its smallest value counts, but at least a tenth of the reading. The aerodynamic
    moments depend on the rates against the air, which may rotate.
    """

    def __init__(
        self, declaration: Declaration, model: DesignModel, x: np.ndarray, y: np.ndarray, altitude: np.ndarray
    ) -> None:  # fmt: skip
        read = np.concatenate([x, y[:, :4]], axis=1)
        e = np.stack([declaration.error(name).e(read[:, j]) for j, name in enumerate(READINGS)], axis=1)
        self.x, self.x_largest = np.abs(x), np.abs(x) + e[:, :3]
        y_read, y_largest = np.abs(y), np.abs(y)
        y_largest[:, :4] += e[:, 3:]
        if "dpt" in model.aircraft.signals:
            y_largest[:, 4] += slipstream_error(declaration, y)
        y_largest[:, 2] = np.maximum(y[:, 2] - e[:, 5], 0.1 * y[:, 2])
        against_air = self.x_largest + air_rotation(declaration, altitude)[:, None]
        self.as_read = signals_of(model.aircraft, self.x, y_read)
        self.largest = signals_of(model.aircraft, against_air, y_largest)
        self.qdyn, self.qdyn_largest = y_read[:, 3], y_largest[:, 3]


def published_bound(declaration: Declaration, model: DesignModel, x: np.ndarray) -> np.ndarray:
    """c_i |C_i x_j x_l| + b_i + the Earth part + rho, for magnitudes of the rates x; without a map b_i has
    the error of the aircraft's model too."""
    K = model.inertia
    c, b = declaration.per_axis("bounds.inertia_coupling"), declaration.per_axis("bounds.constant_rad_s2")
    if not declaration.aircraft.file.get("model_error_map"):
        given = declaration.aircraft.file.get("model_error_rad_s2") or {}
        b = b + [given.get(axis, 0.0) for axis in "pqr"]
    product = np.stack([abs(K[C]) * x[:, i] * x[:, j] for i, j, C in MAIN_PRODUCT], axis=1)
    total, k = x.sum(axis=1, keepdims=True), kappa(K)
    return c * product + b + OMEGA_E * ((1.0 + k) * total + k * OMEGA_E) + RHO


class Bounds:
    """The bounds of one flight, at every instant. x (instants, 3), y, u, du: readings, healthy
    positions and their tolerances."""

    def __init__(
        self, declaration: Declaration, model: DesignModel,
        x: np.ndarray, y: np.ndarray, u: np.ndarray, du: np.ndarray, altitude: np.ndarray,
    ) -> None:  # fmt: skip
        self.declaration, self.model = declaration, model
        self.altitude, self.sizes = altitude, Magnitudes(declaration, model, x, y, altitude)
        self.tolerance = [declaration.coefficient_share(t.name) * abs(t.value) for t in model.terms]
        self.inertia_error = model.inertia_errors(declaration["bounds.inertia"])
        self.level = self.box = self.row = None
        self.x, self.y, self.u, self.du = x, y, u, du
        self.mu = self._mapped(x, y, u)
        self.now = published_bound(declaration, model, self.sizes.x_largest) + self._declared(u) + self.mu

    def _declared(self, u: np.ndarray) -> np.ndarray:
        """eta_bar_e: sum over the products of the model of prod(|v| + e) - prod |v|."""
        sizes, K, dK = self.sizes, self.model.inertia, self.inertia_error
        moment, largest = self.moments(np.abs(u), np.abs(u) + self.du)
        found = np.zeros((len(u), 3))
        for axis in range(3):
            for i, j, name in RATE_PRODUCTS[axis]:
                X, x = sizes.x_largest, sizes.x
                found[:, axis] += (abs(K[name]) + dK[name]) * X[:, i] * X[:, j]
                found[:, axis] -= abs(K[name]) * x[:, i] * x[:, j]
            for i, name in MOMENT_FACTORS[axis]:
                found[:, axis] += (abs(K[name]) + dK[name]) * largest[i] - abs(K[name]) * moment[i]
        return found

    def moments(self, u: np.ndarray, u_largest: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Sum of the magnitudes of each moment's terms, N m: as read, and with all errors."""
        sizes, aircraft = self.sizes, self.model.aircraft
        read, largest = ([np.zeros(len(u)) for _ in range(3)] for _ in range(2))
        for t, tol in zip(self.model.terms, self.tolerance, strict=True):
            at = 1.0 if t.surface is None else u[:, t.surface]
            at_most = 1.0 if t.surface is None else u_largest[:, t.surface]
            read[t.axis] += abs(t.value) * powers(t, sizes.as_read) * at
            largest[t.axis] += (abs(t.value) + tol) * powers(t, sizes.largest) * at_most
        per = [aircraft.S * arm for arm in aircraft.arm]
        return (
            [sizes.qdyn * per[i] * read[i] for i in range(3)],
            [sizes.qdyn_largest * per[i] * largest[i] for i in range(3)],
        )

    def per_rad(self) -> np.ndarray:
        """(instants, 3, surfaces): the part of eta_bar_e that one radian of each surface adds."""
        sizes, aircraft = self.sizes, self.model.aircraft
        n = len(sizes.qdyn)
        read, largest = (np.zeros((3, len(aircraft.surfaces), n)) for _ in range(2))
        for t, tol in zip(self.model.terms, self.tolerance, strict=True):
            if t.surface is not None:
                per = aircraft.S * aircraft.arm[t.axis]
                read[t.axis, t.surface] += sizes.qdyn * per * abs(t.value) * powers(t, sizes.as_read)
                at_most = (abs(t.value) + tol) * powers(t, sizes.largest)
                largest[t.axis, t.surface] += sizes.qdyn_largest * per * at_most
        K, dK = self.model.inertia, self.inertia_error
        found = np.array(
            [
                sum((abs(K[k]) + dK[k]) * largest[i] - abs(K[k]) * read[i] for i, k in MOMENT_FACTORS[axis])
                for axis in range(3)
            ]
        )
        return np.moveaxis(found, -1, 0)

    def more_at_level(self) -> np.ndarray:
        """(instants, levels, 3): what mu grows by, with a surface anywhere in each share of its travel."""
        given = self.declaration.aircraft.file["model_error_map"]
        table = self.table(given)
        here = table[np.minimum(self.row, len(table) - 1), self.box]
        now = np.take_along_axis(here, self.level[:, None, None].repeat(3, axis=2), axis=1)
        return np.where((self.box < 0)[:, None, None], 0.0, np.maximum(here - now, 0.0))

    def _mapped(self, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        """mu: error of a derived model in the innermost box that contains the state, at the least share of
        the travel that covers all healthy surfaces. Rows of the map are times, of which the first not past
        counts."""
        given = self.declaration.aircraft.file.get("model_error_map")
        if not given:
            return np.zeros((len(x), 3))
        self.level = self._level_of(given, u)
        times = np.arange(len(x)) // self.declaration.n * self.declaration.dt
        row = np.searchsorted(given["until_s"], times)
        rows = len(given["until_s"])
        place = self._coordinates(x, y)
        self.box, self.row = np.full(len(x), -1), row
        for number, box in reversed(list(enumerate(given["boxes"]))):
            inside = np.ones(len(x), dtype=bool)
            for key, value in place.items():
                low, high = box["signals"][key] if key in self.declaration.aircraft.signals else box[key]
                edge = EDGE * (1.0 + np.abs(value))
                inside &= (low - edge <= value) & (value <= high + edge)
            self.box[inside & (row < rows)] = number
        table = self.table(given)
        found = table[np.minimum(row, rows - 1), self.box, self.level]
        found[self.box < 0] = OUTSIDE_RAD_S2
        return found

    @staticmethod
    def table(given: dict) -> np.ndarray:
        """(times, boxes, levels, 3) rad/s2."""
        by_axis = [[box[f"error_{axis}_rad_s2"] for box in given["boxes"]] for axis in "pqr"]
        return np.moveaxis(np.array(by_axis), (0, 1, 2, 3), (3, 1, 0, 2))

    def _coordinates(self, x: np.ndarray, y: np.ndarray) -> dict[str, np.ndarray]:
        """Quantities of a box: rates, flow, airspeed, density of the air 2 qdyn / V^2, signals."""
        names = ("alpha_rad", "beta_rad", "airspeed_mps")
        place = {f"{axis}_rad_s": x[:, i] for i, axis in enumerate("pqr")}
        place |= {name: y[:, j] for j, name in enumerate(names)}
        place["density_kg_m3"] = 2.0 * y[:, 3] / y[:, 2] ** 2
        return place | {name: y[:, 4 + j] for j, name in enumerate(self.declaration.aircraft.signals)}

    def mapped_travel(self) -> np.ndarray:
        """(2, surfaces): travel, of stand-ins times the map's factor."""
        aircraft = self.declaration.aircraft
        factor = aircraft.file["model_error_map"].get("stand_ins", 1.0)
        return aircraft.travel * [factor if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces]

    def _level_of(self, given: dict, u: np.ndarray) -> np.ndarray:
        """Index of the least share that covers surfaces within du of u; the last if two may be anywhere."""
        shares = given["travel_share"]
        if self.declaration.all_types and self.declaration["pairs"]:
            return np.full(len(u), len(shares) - 1)
        low, high = self.mapped_travel()
        used = np.maximum(
            *((end > 0) * end / high + (end < 0) * end / low for end in (u - self.du, u + self.du))
        )
        used = used.max(axis=1)
        return np.minimum(np.searchsorted(shares, used), len(shares) - 1)
