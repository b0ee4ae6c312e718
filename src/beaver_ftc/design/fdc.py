"""The Beaver on a flat Earth: the twelve nonlinear state equations of the FDC toolbox, [FDC].

An independent road to what JSBSim flies, for linear analysis. Everything is analytic in its arguments, so
complex steps give its Jacobian to rounding.

State (12,), in the log's order: airspeed m/s, alpha, beta rad, p, q, r rad/s, phi, theta, psi rad, north,
east, altitude m. Surfaces (4,) rad: aileron, elevator, rudder, flap.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import Term, load
from beaver_ftc.aircraft.aircraft import FORCES, GRAVITY_MPS2, MOMENTS
from beaver_ftc.design.model import engine_power_kw, inertia_coefficients, slipstream

_AIRCRAFT = load()  # the equations are those of any aircraft, the engine is that of the built-in one
GEOMETRY, MASS = _AIRCRAFT.geometry, _AIRCRAFT.mass
TERMS, TRAVEL = _AIRCRAFT.terms, _AIRCRAFT.travel
COEFFICIENTS = (*FORCES, *MOMENTS)
STATES = ("airspeed", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi", "north", "east", "altitude")
SURFACES = _AIRCRAFT.surfaces

# Atmosphere as FDC has it: the standard troposphere over geometric altitude, with the gravity of that
# altitude in the pressure's exponent. Next to the standard's geopotential altitude it changes density by
# 0.02 % at 3 km.
_SEA_LEVEL_TEMPERATURE_K = 288.15
_SEA_LEVEL_PRESSURE_PA = 101325.0
_LAPSE_K_PER_M = 0.0065
_GAS_J_PER_KG_K = 287.053
# Gravity as FDC has it: the standard value, falling with the square of the distance.
_EARTH_RADIUS_M = 6371020.0
_STEP = 1e-30  # complex


def value(name: str) -> float:
    """The coefficient of one term, e.g. value("Cm_de"); KeyError for a name the file lacks."""
    return TERMS[name].value


def coefficient_terms(coefficient: str) -> tuple[Term, ...]:
    """The terms whose sum is `coefficient` (one of COEFFICIENTS)."""
    return tuple(term for term in TERMS.values() if term.coefficient == coefficient)


@dataclass(frozen=True)
class Engine:
    """Engine setting: speed rpm, manifold pressure inHg."""

    speed_rpm: float
    manifold_pressure_inhg: float


def atmosphere(altitude_m):
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
    """CX, CY (without the betadot term), CZ, Cl, Cm, Cn and qdyn Pa; ratio multiplies single terms."""
    V, alpha, beta, p, q, r = state[:6]
    density = atmosphere(state[11])
    power = engine_power_kw(engine.speed_rpm, engine.manifold_pressure_inhg, density)
    b, c = GEOMETRY.span_m, GEOMETRY.chord_m
    of = {
        "alpha": alpha, "beta": beta, "ph": p * b / (2 * V), "qh": q * c / V, "rh": r * b / (2 * V),
        "dpt": slipstream(power, density, V), "betadoth": 0.0,
        **dict(zip(SURFACES, surfaces, strict=True)),
    }  # fmt: skip
    summed = {name: _AIRCRAFT.coefficient(name, of, ratio) for name in COEFFICIENTS}
    return summed | {"qdyn": 0.5 * density * V * V}


def derivatives(
    state: np.ndarray, surfaces: np.ndarray, engine: Engine, ratio: Mapping[str, float] | None = None
) -> np.ndarray:
    """Time derivative of the state, (12,) per s [FDC, chapter 3]."""
    of = aerodynamic_coefficients(state, surfaces, engine, ratio)
    betadot_ratio = (ratio or {}).get("CY_betadot", 1.0)
    linear, angular = _flow_rates(state, of, betadot_ratio), _body_accelerations(state, of)
    return np.concatenate([linear, angular, _euler_rates(state), _track(state)])


def _flow_rates(state: np.ndarray, of: Mapping, betadot_ratio: float) -> np.ndarray:
    """Vdot, alphadot, betadot; the force of betadot acts across the flight path: it changes betadot alone."""
    V, alpha, beta, p, q, r, phi, theta = state[:8]
    weight, area = MASS.mass_kg * gravity(state[11]), of["qdyn"] * GEOMETRY.wing_area_m2
    X = area * of["CX"] - weight * np.sin(theta)
    Y = area * of["CY"] + weight * np.cos(theta) * np.sin(phi)
    Z = area * of["CZ"] + weight * np.cos(theta) * np.cos(phi)
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    mV = MASS.mass_kg * V
    Vdot = (X * ca * cb + Y * sb + Z * sa * cb) / MASS.mass_kg
    alphadot = (Z * ca - X * sa) / (mV * cb) + q - (p * ca + r * sa) * sb / cb
    betadot = (Y * cb - (X * ca + Z * sa) * sb) / mV + p * sa - r * ca
    side = betadot_ratio * _CY_BETADOT * area * GEOMETRY.span_m / (2 * V) / mV
    return np.array([Vdot, alphadot, betadot / (1.0 - side)])


_CY_BETADOT = _AIRCRAFT.terms["CY_betadot"].value


def _body_accelerations(state: np.ndarray, of: Mapping) -> np.ndarray:
    """pdot, qdot, rdot."""
    p, q, r = state[3:6]
    i, area = inertia_coefficients(MASS), of["qdyn"] * GEOMETRY.wing_area_m2
    L, N = area * GEOMETRY.span_m * of["Cl"], area * GEOMETRY.span_m * of["Cn"]
    M = area * GEOMETRY.chord_m * of["Cm"]
    pdot = i.Ppq * p * q + i.Pqr * q * r + i.Pl * L + i.Pn * N
    qdot = i.Qpp * p * p + i.Qpr * p * r + i.Qrr * r * r + i.Qm * M
    rdot = i.Rpq * p * q + i.Rqr * q * r + i.Rl * L + i.Rn * N
    return np.array([pdot, qdot, rdot])


def _euler_rates(state: np.ndarray) -> np.ndarray:
    """phidot, thetadot, psidot."""
    p, q, r, phi, theta = state[3:8]
    turn = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
    return np.array([p + turn * np.sin(theta), q * np.cos(phi) - r * np.sin(phi), turn])


def _track(state: np.ndarray) -> np.ndarray:
    """Velocity over the ground: north, east, up, in still air."""
    V, alpha, beta = state[:3]
    phi, theta, psi = state[6:9]
    u, v, w = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    across, down = v * np.cos(phi) - w * np.sin(phi), v * np.sin(phi) + w * np.cos(phi)
    ahead = u * np.cos(theta) + down * np.sin(theta)
    north, east = ahead * np.cos(psi) - across * np.sin(psi), ahead * np.sin(psi) + across * np.cos(psi)
    return np.array([north, east, u * np.sin(theta) - down * np.cos(theta)])


def linearise(
    state: np.ndarray, surfaces: np.ndarray, engine: Engine, ratio: Mapping[str, float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A (12, 12) and B (12, 4) of the state equations, by complex steps."""
    A = [derivatives(state + 1j * _STEP * e, surfaces + 0j, engine, ratio).imag / _STEP for e in np.eye(12)]
    B = [derivatives(state + 0j, surfaces + 1j * _STEP * e, engine, ratio).imag / _STEP for e in np.eye(4)]
    return np.column_stack(A), np.column_stack(B)
