"""The Beaver on a flat Earth: the twelve nonlinear state equations of the FDC toolbox, [FDC].

They are independent of JSBSim, and serve linear analysis. All functions are analytic in their arguments, so
complex steps give the Jacobian to rounding.

State (12,), in the log's order: airspeed m/s, alpha, beta rad, p, q, r rad/s, phi, theta, psi rad, north,
east, altitude m. Surfaces (4,) rad: aileron, elevator, rudder, flap.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES, GRAVITY_MPS2, MOMENTS
from beaver_ftc.design.engine import engine_power_kw, slipstream

_AIRCRAFT = load()  # the equations are those of any aircraft, the engine is that of the built-in one
GEOMETRY, MASS = _AIRCRAFT.geometry, _AIRCRAFT.mass
TERMS, TRAVEL = _AIRCRAFT.terms, _AIRCRAFT.travel
COEFFICIENTS = (*FORCES, *MOMENTS)
STATES = ("airspeed", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "north", "east", "altitude")
SURFACES = _AIRCRAFT.surfaces

# Atmosphere of FDC: the standard troposphere over geometric altitude, with the gravity of that altitude in
# the exponent of the pressure. At 3 km its density differs by 0.02 % from that of the standard, which is over
# geopotential altitude.
_SEA_LEVEL_TEMPERATURE_K = 288.15
_SEA_LEVEL_PRESSURE_PA = 101325.0
_LAPSE_K_PER_M = 0.0065
_GAS_J_PER_KG_K = 287.053
# Gravity of FDC: the standard value at sea level, over the square of the distance from the Earth's centre.
_EARTH_RADIUS_M = 6371020.0
_STEP = 1e-30  # of a complex step


def value(name: str) -> float:
    """The coefficient of one term, e.g. value("Cm_de"); KeyError for a name the file lacks."""
    return TERMS[name].value


@dataclass(frozen=True)
class Engine:
    """Engine setting: speed rpm, manifold pressure inHg."""

    speed_rpm: float
    manifold_pressure_inhg: float


def air_density(altitude_m):
    """Density kg/m3 at an altitude m."""
    temperature = _SEA_LEVEL_TEMPERATURE_K - _LAPSE_K_PER_M * altitude_m
    exponent = gravity(altitude_m) / (_LAPSE_K_PER_M * _GAS_J_PER_KG_K)
    pressure = _SEA_LEVEL_PRESSURE_PA * (temperature / _SEA_LEVEL_TEMPERATURE_K) ** exponent
    return pressure / (_GAS_J_PER_KG_K * temperature)


def gravity(altitude_m):
    """Gravity m/s2 at an altitude m [FDC]."""
    return GRAVITY_MPS2 * (_EARTH_RADIUS_M / (_EARTH_RADIUS_M + altitude_m)) ** 2


def aerodynamic_coefficients(
    state: np.ndarray, surfaces: np.ndarray, engine: Engine, ratio: Mapping[str, float] | None = None
) -> dict:
    """CX, CY (without the betadot term), CZ, Cl, Cm, Cn and qdyn, Pa, by name; state (12,), surfaces (4,)
    rad; `ratio` multiplies single terms."""
    V, alpha, beta, p, q, r = state[:6]
    density = air_density(state[11])
    power = engine_power_kw(engine.speed_rpm, engine.manifold_pressure_inhg, density)
    b, c = GEOMETRY.span_m, GEOMETRY.chord_m
    signals = {
        "alpha": alpha, "beta": beta, "ph": p * b / (2 * V), "qh": q * c / V, "rh": r * b / (2 * V),
        "dpt": slipstream(power, density, V), "betadoth": 0.0,
        **dict(zip(SURFACES, surfaces, strict=True)),
    }  # fmt: skip
    summed = {name: _AIRCRAFT.coefficient(name, signals, ratio) for name in COEFFICIENTS}
    return summed | {"qdyn": 0.5 * density * V * V}


def derivatives(
    state: np.ndarray, surfaces: np.ndarray, engine: Engine, ratio: Mapping[str, float] | None = None
) -> np.ndarray:
    """Time derivative of the state, (12,) per s [FDC, chapter 3]."""
    coef = aerodynamic_coefficients(state, surfaces, engine, ratio)
    betadot_ratio = (ratio or {}).get("CY_betadot", 1.0)
    flow = _flow_rates(state, coef, betadot_ratio)
    return np.concatenate([flow, _body_accelerations(state, coef), _euler_rates(state), _track(state)])


def _flow_rates(state: np.ndarray, coef: Mapping, betadot_ratio: float) -> np.ndarray:
    """Vdot m/s2, alphadot, betadot rad/s:

        Vdot = F . t / m
        alphadot = (Z cos(alpha) - X sin(alpha)) / (m V cos(beta))
                   + q - (p cos(alpha) + r sin(alpha)) tan(beta)
        betadot = betadot_0 / (1 - side),    side = CY_betadot qdyn S b / (2 V) / (m V)
        betadot_0 = (Y cos(beta) - (X cos(alpha) + Z sin(alpha)) sin(beta)) / (m V)
                    + p sin(alpha) - r cos(alpha)

    F = (X, Y, Z) N: aerodynamic force and weight, body axes; t (3,): direction of flight. The force by
    betadot acts across the flight path, so it changes betadot alone.
    """
    V, alpha, beta, p, q, r = state[:6]
    area, down = coef["qdyn"] * GEOMETRY.wing_area_m2, _to_body(*state[6:9])[:, 2]
    force = area * np.array([coef[name] for name in FORCES]) + MASS.mass_kg * gravity(state[11]) * down
    X, Y, Z = force
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    mV = MASS.mass_kg * V
    Vdot = force @ _flow(alpha, beta) / MASS.mass_kg
    alphadot = (Z * ca - X * sa) / (mV * cb) + q - (p * ca + r * sa) * sb / cb
    betadot = (Y * cb - (X * ca + Z * sa) * sb) / mV + p * sa - r * ca
    side = betadot_ratio * value("CY_betadot") * area * GEOMETRY.span_m / (2 * V) / mV
    return np.array([Vdot, alphadot, betadot / (1.0 - side)])


LENGTHS_M = np.array([GEOMETRY.span_m, GEOMETRY.chord_m, GEOMETRY.span_m])
INERTIA_KG_M2 = np.array(
    [[MASS.Ix_kg_m2, 0.0, -MASS.Jxz_kg_m2], [0.0, MASS.Iy_kg_m2, 0.0], [-MASS.Jxz_kg_m2, 0.0, MASS.Iz_kg_m2]]
)


def _body_accelerations(state: np.ndarray, coef: Mapping) -> np.ndarray:
    """pdot, qdot, rdot, rad/s2: I x' = M - cross(x, I x), with x = (p, q, r), M (3,) N m."""
    x = state[3:6]
    arms = coef["qdyn"] * GEOMETRY.wing_area_m2 * LENGTHS_M
    M = arms * np.array([coef[name] for name in MOMENTS])
    return np.linalg.solve(INERTIA_KG_M2, M - np.cross(x, INERTIA_KG_M2 @ x))


def _flow(alpha: complex, beta: complex) -> np.ndarray:
    """Direction of the velocity in body axes, (3,)."""
    return np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])


def _to_body(phi: complex, theta: complex, psi: complex) -> np.ndarray:
    """Rotation (3, 3) from north, east, down to body axes."""
    sf, cf, st, ct, sp, cp = (f(a) for a in (phi, theta, psi) for f in (np.sin, np.cos))
    roll = np.array([[1, 0, 0], [0, cf, sf], [0, -sf, cf]])
    pitch = np.array([[ct, 0, -st], [0, 1, 0], [st, 0, ct]])
    yaw = np.array([[cp, sp, 0], [-sp, cp, 0], [0, 0, 1]])
    return roll @ pitch @ yaw


def _euler_rates(state: np.ndarray) -> np.ndarray:
    """phidot, thetadot, psidot, rad/s:

    psidot = (q sin(phi) + r cos(phi)) / cos(theta)
    phidot = p + psidot sin(theta),    thetadot = q cos(phi) - r sin(phi)
    """
    p, q, r, phi, theta = state[3:8]
    turn = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
    return np.array([p + turn * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), turn])


def _track(state: np.ndarray) -> np.ndarray:
    """Velocity over the ground (3,) m/s in still air: north, east, up."""
    north, east, down = state[0] * _flow(*state[1:3]) @ _to_body(*state[6:9])
    return np.array([north, east, -down])


def linearise(
    state: np.ndarray, surfaces: np.ndarray, engine: Engine, ratio: Mapping[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A (12, 12) and B (12, 4) of the state equations, by complex steps."""
    A = [derivatives(state + 1j * _STEP * e, surfaces + 0j, engine, ratio).imag / _STEP for e in np.eye(12)]
    B = [derivatives(state + 0j, surfaces + 1j * _STEP * e, engine, ratio).imag / _STEP for e in np.eye(4)]
    return np.column_stack(A), np.column_stack(B)
