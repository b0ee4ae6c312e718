"""The worst-case bound's record, filled with what a scenario declares, for any aircraft and instrument."""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import exp, log
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import AXES, MassProperties
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.design.engine import power_error_kw
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.design.variants import mass_of
from beaver_ftc.diagnosis.bounds.worst_case import fill_error_map
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.sensors import ENGINE, NOISE_LIMIT_SIGMA

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

GUST_LIMIT_SIGMA = 6.0  # once in 5e8 samples beyond, were they independent
_INERTIA = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


@lru_cache(maxsize=64)
def inertia_slack(tolerance: float, mass: MassProperties) -> np.ndarray:
    """Largest change of the twelve inertia coefficients for every inertia within its tolerance.

    Each is monotonic in each inertia as long as the others stay put, so the corners tell.
    """
    nominal = np.array(inertia_coefficients(mass))
    worst = np.zeros(12)
    for signs in product((-1.0, 1.0), repeat=4):
        change = {
            name: getattr(mass, name) * (1 + tolerance * s) for name, s in zip(_INERTIA, signs, strict=True)
        }
        there = np.array(inertia_coefficients(replace(mass, **change)))
        worst = np.maximum(worst, np.abs(there - nominal))
    worst.flags.writeable = False  # kept: the same for every flight of a design
    return worst


def configure(bound: np.void, scenario: "Scenario", declared: Declared, design: np.void) -> None:
    """Fill in the declared bound, and what the aircraft's terms leave: where it is mapped, or everywhere the
    same; design: the designer's record."""
    config, aircraft = scenario.fdi, declared.aircraft
    bound["inertia"], bound["earth_rate"] = declared.coupling, EARTH_RATE_RAD_S
    bound["constant"] = declared.constant_rad_s2
    every_type = config.fault_class == "all"
    fill_error_map(bound["error_map"], aircraft, every_type, whole=every_type and config.pairs)
    if aircraft.file.model_error_map is None:
        bound["constant"] += aircraft.model_error_rad_s2
    admitted = bound["admitted"]
    admit(admitted, declared, design, mass_of(scenario.design_model, aircraft))
    admit_engine(admitted, scenario, declared)
    bound["own_errors"] = admitted["any"] and every_type


def admit(admitted: np.void, declared: Declared, design: np.void, mass: MassProperties) -> None:
    """Fill the record; the design record and mass are the designer's."""
    tolerance = declared.coefficients.absolute(declared.aircraft.moments, design["moments"]["value"])
    admitted["tolerance"][: tolerance.size] = tolerance
    admitted["inertia"] = inertia_slack(declared.inertia, mass)
    admitted["deflection"] = declared.actuators.deflection_rad
    errors, air, span_m = declared.sensors, declared.air, declared.aircraft.geometry.span_m
    admitted["gust_aloft"] = GUST_LIMIT_SIGMA * air.rotation_limit_rad_s(span_m)
    admitted["gust_low"] = GUST_LIMIT_SIGMA * air.low_rotation_limit_rad_s(span_m)
    admitted["gust"] = admitted["gust_aloft"]
    admitted["altitude_off"], admitted["altitude_slope"] = errors["altitude"].worst, errors["altitude"].slope
    admitted["offset"], admitted["slope"] = errors.each("worst"), errors.each("slope")
    admitted["steady"] = errors.each("steady", AXES)
    parts = (admitted["tolerance"], admitted["inertia"], admitted["deflection"], admitted["gust"])
    admitted["any"] = any(np.any(part) for part in parts) or not errors.is_ideal


def admit_engine(admitted: np.void, scenario: "Scenario", declared: Declared) -> None:
    """Admit errors of dpt where those are declared of which it is worked out.

    The engine may be set anywhere between here and its highest manifold pressure.
    """
    sensors = declared.sensors
    flawed = any(not getattr(sensors.declared, name).is_ideal for name in OF_THE_SLIPSTREAM)
    if not (flawed and declared.aircraft.has_engine_instruments):
        return
    initial: Any = scenario.initial
    highest = declared.aircraft.engine.settings["manifold_pressure_inhg"].range[1]
    largest = dict(zip(ENGINE, (initial.engine_rpm, highest), strict=True))
    errors = [sensors[name].of_reading(most) for name, most in largest.items()]
    admitted["engine"] = 1
    admitted["engine_kw"], admitted["thin_air_kw"] = power_error_kw(initial.engine_rpm, highest, *errors)


def poles_for_noise(sensors: SensorErrors, constant_rad_s2: float) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of DELAYS_S, despite gyro noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta_bar / lam + 2 nbar. The excess
    of one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    nbar = 2 * NOISE_LIMIT_SIGMA * float(sensors.each("noise", AXES).max())
    return tuple(_pole(delay_s, nbar, constant_rad_s2) for delay_s in DELAYS_S) if nbar > 0 else ()


def _pole(delay_s: float, noise: float, eta_bar: float) -> float:
    phi = eta_bar + 8.0 * noise / delay_s
    for _ in range(50):
        pole = max(log(phi * delay_s / noise) / delay_s, 0.1 / delay_s)
        phi = (noise * pole + eta_bar) / (1.0 - exp(-pole * delay_s))
    return pole
