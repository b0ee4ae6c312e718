"""The Generic Transport Model, written from its specification, without any code of the converter.

The module reads the data base and `parameters.yaml` of one folder (`BEAVER_FTC_GTM`, or
../shared/reference/gtm beside the checkout). A table is interpolated over all axes at once. Bogacki and
Shampine's third-order method integrates the flight in steps of 5 ms, over a flat Earth with the gravity of
the source, in the US standard atmosphere of 1976 below 11 km. Units: ft, slug, lbf, s; angles of tables and
surfaces in deg, throttles in %.
"""

import os
from bisect import bisect_right
from dataclasses import dataclass, field
from math import asin, atan2, cos, degrees, pi, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from tools.data import yaml_of

WHERE = "BEAVER_FTC_GTM"
DATABASE = "T2_polynomial_aerodatabase.mat"
SURFACES = (
    "ELLOB", "ELLIB", "ELROB", "ELRIB", "AILL", "AILR", "RUDU", "RUDL",
    "SPLLIB", "SPLLOB", "SPLRIB", "SPLROB", "FLAPLIB", "FLAPLOB", "FLAPRIB", "FLAPROB", "STAB",
)  # fmt: skip
_MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
_LONGITUDINAL, _LATERAL = [0, 2, 4], [1, 3, 5]
STEP_S = 0.005


def folder() -> Path | None:
    """The folder with data base and parameters; None if they are not there."""
    found = Path(os.environ.get(WHERE) or Path(__file__).parents[3] / "shared" / "reference" / "gtm")
    there = (found / DATABASE).is_file() and (found / "parameters.yaml").is_file()
    return found if there else None


def axes_of(alpha: float, beta: float) -> np.ndarray:
    """Unit vector of the airspeed in body axes at these flow angles, rad."""
    return np.array([cos(alpha) * cos(beta), sin(beta), sin(alpha) * cos(beta)])


def multilinear(data: np.ndarray, axes: list[list[float]], at: list[float], hold: bool) -> np.ndarray:
    """The value of a table at a point, by multilinear interpolation. Beyond the breakpoints, the last cell is
    extended, or its end value is held."""
    for grid, place in zip(axes, at, strict=True):
        x = min(max(place, grid[0]), grid[-1]) if hold else place
        i = min(max(bisect_right(grid, x) - 1, 0), len(grid) - 2)
        share = (x - grid[i]) / (grid[i + 1] - grid[i])
        data = (1.0 - share) * data[i] + share * data[i + 1]
    return data


@dataclass
class Controls:
    """Deflections of the surfaces, deg, and throttles that the engines follow, %."""

    surfaces: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SURFACES, 0.0))
    throttles: tuple[float, float] = (40.0, 40.0)


class Specification:
    """The aircraft. gravity: ft/s2; that of the source if none is given."""

    def __init__(self, where: Path, gravity: float | None = None) -> None:
        self.of: dict[str, Any] = yaml_of(where / "parameters.yaml")
        self.base = loadmat(where / DATABASE, struct_as_record=False, squeeze_me=True)
        self.gravity = gravity or self.of["mass"]["gravity"]["value"]
        self._tables: dict[str, tuple[np.ndarray, list[list[float]]]] = {}

    def _table(self, name: str, *axes: str) -> tuple[np.ndarray, list[list[float]]]:
        if name not in self._tables:
            of: Any = self.base
            for part in name.split("."):
                of = of[part] if isinstance(of, dict) else getattr(of, part)
            self._tables[name] = (
                np.asarray(of.data, float),
                [[float(x) for x in getattr(of, a)] for a in axes],
            )
        return self._tables[name]

    def _look(
        self, name: str, axes: str, at: list[float], hold: bool = False, row: int | None = None
    ) -> np.ndarray:
        """Of a table at these places of its axes. row: on the axis behind these, where there is one."""
        data, grids = self._table(name, *axes.split())
        return multilinear(data if row is None else data.take(row, len(grids)), grids, at, hold)

    def coefficients(
        self, alpha: float, beta: float, V: float, rates: np.ndarray, deg: dict[str, float], case: int = 0,
        gear: bool = False,
    ) -> np.ndarray:  # fmt: skip
        """The coefficients CX, CY, CZ, Cl, Cm, Cn; alpha and beta in rad."""
        a, b = degrees(alpha), degrees(beta)
        c = self._look("C6_bas", "alpha beta", [a, b])
        if case:
            c = c + self._look("dC6_damage.bas", "alpha beta", [a, b], hold=True, row=case - 1)
        gone = self.of["damage"]["cases"][case]["gain_0"] if case else []
        c = c + self._surfaces(a, b, {name: 0.0 if name in gone else deg[name] for name in deg}, deg["STAB"])
        if gear:
            c[_LONGITUDINAL] += self._look("dC3_lgr", "alpha", [a], row=1)
        return c + self._rates(a, b, alpha, beta, V, rates, case)

    def _surfaces(self, a: float, b: float, deg: dict[str, float], stab: float) -> np.ndarray:
        """Increments; a lost surface stands at zero here, `stab` is where the stabiliser really stands. A
        table of ailerons, rudders or spoilers has one side: it is mirrored for the other.
        """
        c = np.zeros(6)
        shares = self.of["aero_shares"]
        s0 = self._look("dC3_ele", "alpha beta stab elev", [a, b, stab, 0.0])
        if deg["STAB"] == stab:
            c[_LONGITUDINAL] += s0
        for name, arm in shares["elevator_arm_spans"].items():
            if deg[name]:
                part = 0.25 * (self._look("dC3_ele", "alpha beta stab elev", [a, b, stab, deg[name]]) - s0)
                c[_LONGITUDINAL] += part
                c[3] += arm * part[1]
                c[5] -= arm * part[0]
        parts = [("ail", deg["AILR"], False, 1.0), ("ail", deg["AILL"], True, 1.0)]
        for name, which in (("RUDU", "upper"), ("RUDL", "lower")):
            parts.append(("rud", -abs(deg[name]), deg[name] >= 0.0, shares[f"rudder_{which}"]))
        for name in ("SPLLIB", "SPLLOB", "SPLRIB", "SPLROB"):
            which = "inboard" if name.endswith("IB") else "outboard"
            parts += [("spo", deg[name], name[3] == "L", shares[f"spoiler_{which}"])] * bool(deg[name])
        for kind, angle, mirrored, share in parts:
            at = [a, -b if mirrored else b, angle]
            c += (_MIRROR if mirrored else 1.0) * self._look(f"dC6_{kind}", f"alpha beta {kind}", at) * share
        for name in ("FLAPLIB", "FLAPLOB", "FLAPRIB", "FLAPROB"):
            c += deg[name] * np.asarray(getattr(self.base["flaps"], name.lower()))
        return c

    def _rates(
        self, a: float, b: float, alpha: float, beta: float, V: float, rates: np.ndarray, case: int
    ) -> np.ndarray:
        """Of body rates. Without damage, the part that turns about the flow has a table of its own."""
        knots = min(max(V * 0.592487, 1.0), 10000.0)
        over = np.array([6.8488, 0.9153, 6.8488]) / (2.0 * knots * 1.689)
        along = axes_of(alpha, beta)
        omega = 0.0 if case else _about_flow(rates, along)
        hats, scale, c = (rates - omega * along) * over, np.ones((3, 6)), np.zeros(6)
        if case:
            scale = self._look("dC6_damage.ddscale", "alpha", [a], hold=True, row=case - 1)
        else:
            what = float(np.clip(omega * over[0], -0.5, 0.5))
            c += self._look("dC6_w", "alpha what beta", [a, what, b])
        for k, (name, hat, outputs) in enumerate(_OF_RATES):
            found = self._look(name, f"alpha {hat}", [a, hats[k]], hold=bool(case))
            c[outputs] += found * scale[k][outputs]
        if case:
            c[1] += self._look("dC6_damage.ddinc", "alpha", [a], row=case - 1)[:, 1] @ hats
        return c

    def mass(self, case: int = 0) -> tuple[float, np.ndarray, np.ndarray]:
        """Weight, lbf, centre of gravity, ft, and inertia, slug ft2, as the source computes them."""
        of = self.of["mass"]
        i = dict(of["inertia"])
        for name, polynomial in of["inertia_fuel_polynomials"].items():
            if name in i:
                i[name] += polynomial[-1]
        weight, shift = of["weight"]["value"], np.zeros(3)
        if case:
            damage = self.of["damage"]["cases"][case]
            weight, shift = weight + damage["dweight_lbf"], np.array(damage["dCG_in"]) / 12.0
            i = {name: i[name] + damage[f"d{name}"] for name in ("Ixx", "Iyy", "Izz", "Ixz", "Iyz", "Ixy")}
        cg = of["weight"]["value"] * np.array(of["cg"]["value"]) / weight + shift
        x, y, z, xy, xz, yz = (i[name] for name in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"))
        tensor = np.array([[x, -xy, -xz], [-xy, y, -yz], [-xz, -yz, z]])
        return weight, cg, tensor

    def air(self, altitude: float) -> tuple[float, float]:
        """Pressure, lbf/ft2, and density, slug/ft3, of the air."""
        earth = self.of["constants"]["earth_radius_atmosphere_ft"]
        warm = 1.0 - 6.8755856e-6 * earth * altitude / (earth + altitude)
        pressure = 2116.22 * warm**5.2558797
        return pressure, pressure / (self.of["constants"]["gas_constant"] * 518.67 * warm)

    def rates_of_change(self, x: np.ndarray, controls: Controls, case: int) -> np.ndarray:
        """The derivative of a state x (10,): u, v, w, ft/s; p, q, r, rad/s; phi, theta, psi, rad; altitude,
        ft."""
        velocity, omega, (phi, theta, _), altitude = x[:3], x[3:6], x[6:9], x[9]
        V = float(np.linalg.norm(velocity))
        alpha, beta = atan2(velocity[2], velocity[0]), asin(velocity[1] / V)
        weight, cg, inertia = self.mass(case)
        pressure, density = self.air(altitude)
        load = 0.5 * density * V * V * 5.9018
        c = self.coefficients(alpha, beta, V, omega, controls.surfaces, case)
        force = load * c[:3]
        moment = load * np.array([6.8488, 0.9153, 6.8488]) * c[3:]
        moment += np.cross(np.array(self.of["geometry"]["ref_cg"]["value"]) - cg, force)
        rotors = np.zeros(3)
        for side, throttle in zip(("left", "right"), controls.throttles, strict=True):
            push, place, turning = self._engine(side, throttle, pressure, load)
            force, moment, rotors = force + push, moment + np.cross(place - cg, push), rotors + turning
        moment += np.cross(omega, rotors)
        down = np.array([-sin(theta), sin(phi) * cos(theta), cos(phi) * cos(theta)])
        mass = weight / self.of["mass"]["gravity"]["value"]
        accelerated = force / mass + self.gravity * down - np.cross(omega, velocity)
        turned = np.linalg.solve(inertia, moment - np.cross(omega, inertia @ omega))
        p, q, r = omega
        heading = (q * sin(phi) + r * cos(phi)) / cos(theta)
        angles = [p + heading * sin(theta), q * cos(phi) - r * sin(phi), heading]
        return np.array([*accelerated, *turned, *angles, -float(down @ velocity)])

    def _engine(self, side: str, throttle: float, pressure: float, load: float) -> tuple[np.ndarray, ...]:
        """Thrust, its point of attack and the angular momentum of the rotor of one engine."""
        of = self.of["engines"]
        rpm = np.polyval(of["rpm_percent"]["polynomial"], throttle)
        thrust = max(0.0, np.polyval(of["thrust"]["polynomial"], rpm) * pressure / 2116.22 - 0.010 * load)
        _, a2, a3 = map(radians, of[side]["angles"])
        along = axes_of(-a2, a3)
        shaft = of["rotor"]
        inertia = pi * shaft["shaft_dia"] ** 4 / 32.0 * shaft["shaft_len"] * shaft["density"]
        spin = inertia * 2.0 * pi / 60.0 * rpm / 100.0 * 123000.0
        return thrust * along, np.array(of[side]["position"]), spin * along

    def step(self, x: np.ndarray, controls: Controls, case: int, dt: float = STEP_S) -> np.ndarray:
        """One step of Bogacki and Shampine's third-order method."""
        k1 = self.rates_of_change(x, controls, case)
        k2 = self.rates_of_change(x + 0.5 * dt * k1, controls, case)
        k3 = self.rates_of_change(x + 0.75 * dt * k2, controls, case)
        return np.asarray(x + dt * (2.0 * k1 + 3.0 * k2 + 4.0 * k3) / 9.0)


def _about_flow(rates: np.ndarray, along: np.ndarray) -> float:
    """The rate about the flow, rad/s, whose removal makes neither p nor r larger nor changes its sign; 0 if
    there is none."""
    omega = 0.0
    for i, j in ((0, 2), (2, 0)):
        if along[i] != 0.0 and rates[i] != 0.0:
            left = rates[j] - rates[i] / along[i] * along[j]
            omega = rates[i] / along[i] if abs(left) <= abs(rates[j]) and left * rates[j] >= 0.0 else omega
    return float(omega)


_OF_RATES = (("dC3_p", "phat", _LATERAL), ("dC3_q", "qhat", _LONGITUDINAL), ("dC3_r", "rhat", _LATERAL))
