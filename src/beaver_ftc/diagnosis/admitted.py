"""From what a scenario declares in `fdi.bounds` to the numbers of derived.py."""

from dataclasses import astuple, replace
from functools import lru_cache
from itertools import product
from math import exp, log, radians, sqrt

import numpy as np

from beaver_ftc.aircraft import Aircraft, MassProperties
from beaver_ftc.design.inertia import inertia_coefficients
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA, SIGNALS
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.sensors import Sensors

# Largest vertical gust (standard deviation) above 2000 ft and its scale [MIL-F-8785C, fig. 7, 3.7.2].
GUST_FT_S = {"none": 0.0, "light": 7.4, "moderate": 10.6, "severe": 23.6}
SCALE_FT = 1750.0
ROLLING = 1.9  # of the rotating gusts the strongest [Yeager1998, eq. 8]; pitching and yawing are weaker
GUST_LIMIT_SIGMA = 6.0  # once in 5e8 samples beyond, were they independent
_INERTIA = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


def gust_sigma_rad_s(turbulence: str, span_m: float) -> float:
    """Standard deviation of the air's rotation, rad/s, on any axis of an aircraft of this span."""
    span_ft = span_m / 0.3048
    return ROLLING * GUST_FT_S[turbulence] / sqrt(SCALE_FT * span_ft)


@lru_cache(maxsize=64)
def inertia_slack(tolerance: float, mass: MassProperties) -> np.ndarray:
    """Largest change of the twelve inertia coefficients for every inertia within its tolerance.

    Each is monotonic in each inertia as long as the others stay put, so the corners tell.
    """
    nominal = np.array(astuple(inertia_coefficients(mass)))
    worst = np.zeros(12)
    for signs in product((-1.0, 1.0), repeat=4):
        change = {
            name: getattr(mass, name) * (1 + tolerance * s) for name, s in zip(_INERTIA, signs, strict=True)
        }
        there = np.array(astuple(inertia_coefficients(replace(mass, **change))))
        worst = np.maximum(worst, np.abs(there - nominal))
    worst.flags.writeable = False  # kept: the same for every flight of a design
    return worst


def tolerances(given: float | dict[str, float], aircraft: Aircraft, values: np.ndarray) -> np.ndarray:
    """Tolerance of each moment coefficient, absolute; values: the designer's, as `Aircraft.moments`."""
    share = [given.get(term.name, 0.0) if isinstance(given, dict) else given for term in aircraft.moments]
    return np.array(share) * np.abs(values[: len(share)])


def admit(
    admitted: np.void, bounds: Bounds, aircraft: Aircraft, design: np.void, mass: MassProperties
) -> None:
    """Fill the record; the design record and mass are the designer's."""
    tolerance = tolerances(bounds.coefficients, aircraft, design["moments"]["value"])
    admitted["tolerance"][: tolerance.size] = tolerance
    admitted["inertia"] = inertia_slack(bounds.inertia, mass)
    admitted["deflection"] = radians(bounds.deflection_deg)
    admitted["gust"] = GUST_LIMIT_SIGMA * gust_sigma_rad_s(bounds.turbulence, aircraft.geometry.span_m)
    for i, name in enumerate(SIGNALS):
        sensor = getattr(bounds.sensors, name)
        noise, bias, quantum = sensor.noise_bias_quantum
        admitted["offset"][i] = NOISE_LIMIT_SIGMA * noise + abs(bias) + quantum / 2
        admitted["slope"][i] = abs(sensor.scale_error)
        if i < 3:
            admitted["steady"][i] = abs(bias)
    declared = (admitted["tolerance"], admitted["inertia"], admitted["deflection"], admitted["gust"])
    admitted["any"] = any(np.any(part) for part in declared) or not bounds.sensors.is_ideal


def poles_for_noise(sensors: Sensors, constant_rad_s2: float) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of DELAYS_S, despite gyro noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta_bar / lam + 2 nbar. The excess
    of one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    nbar = max(2 * NOISE_LIMIT_SIGMA * getattr(sensors, axis).noise_bias_quantum[0] for axis in "pqr")
    return tuple(_pole(delay_s, nbar, constant_rad_s2) for delay_s in DELAYS_S) if nbar > 0 else ()


def gyros_vary(sensors: Sensors) -> bool:
    """Whether the error of some gyro is more than a constant."""
    gyros = [getattr(sensors, axis) for axis in "pqr"]
    return any(gyro.noise_bias_quantum[0] or gyro.noise_bias_quantum[2] or gyro.scale_error for gyro in gyros)


def _pole(delay_s: float, noise: float, eta_bar: float) -> float:
    phi = eta_bar + 8.0 * noise / delay_s
    for _ in range(50):
        pole = max(log(phi * delay_s / noise) / delay_s, 0.1 / delay_s)
        phi = (noise * pole + eta_bar) / (1.0 - exp(-pole * delay_s))
    return pole
