"""What a scenario declares in `fdi.bounds`, read once, for any aircraft and instrument; its worst case."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import exp, log, pi, radians, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties
from beaver_ftc.aircraft.units import M_PER_FT
from beaver_ftc.design.engine import power_error_kw
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.design.variants import mass_of
from beaver_ftc.diagnosis.bounds.worst_case import fill_error_map
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA, SENSORS, SIGNALS
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.sensors import ENGINE, Sensors

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

# Largest vertical gust (standard deviation) above 2000 ft and its scale [MIL-F-8785C, fig. 7, 3.7.2].
GUST_FT_S = {"none": 0.0, "light": 7.4, "moderate": 10.6, "severe": 23.6}
SCALE_FT = 1750.0
# That below 1000 ft, a tenth of the wind at 20 ft [MIL-F-8785C, 3.7.3]; its scale is the height. Between 1000
# and 2000 ft both go from the one to the other, and what follows from them is below that above.
LOW_GUST_FT_S = {"none": 0.0, "light": 2.53, "moderate": 5.06, "severe": 7.6}
SCALE_M = M_PER_FT * SCALE_FT
ROLLING = 1.9  # of the rotating gusts the strongest [Yeager1998, eq. 8]; pitching and yawing are weaker
GUST_LIMIT_SIGMA = 6.0  # once in 5e8 samples beyond, were they independent
EARTH_RATE_RAD_S = 2.0 * pi / 86164.0905  # one turn per sidereal day [WGS84]
_INERTIA = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


class Error(NamedTuple):
    """What is declared of one instrument, SI.

    noise: standard deviation of a sample's; steady: size of a constant error; slope: as a share. random:
    noise and rounding together, a standard deviation. worst: how far a reading of zero can be off.
    """

    noise: float
    steady: float
    resolution: float
    slope: float
    random: float
    worst: float

    def of_reading(self, largest: float) -> float:
        """How far a reading of at most `largest` can be off."""
        return (self.worst + self.slope * largest) / (1.0 - self.slope)


class Errors(dict[str, Error]):
    """Those of all instruments, by their names in SENSORS."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__()
        for name in SENSORS:
            sensor = getattr(sensors, name)
            noise, bias, resolution = sensor.noise_bias_quantum
            worst, slope = NOISE_LIMIT_SIGMA * noise + abs(bias) + resolution / 2, abs(sensor.scale_error)
            self[name] = Error(noise, abs(bias), resolution, slope, sensor.random_error, worst)

    def each(self, of_it: str, names: Iterable[str] = SIGNALS) -> np.ndarray:
        """One number of several instruments, (n,)."""
        return np.array([getattr(self[name], of_it) for name in names])


def gust_mps(turbulence: str) -> float:
    """Standard deviation of the vertical gusts, m/s; their scale is SCALE_M."""
    return M_PER_FT * GUST_FT_S[turbulence]


def low_gust_mps(turbulence: str) -> float:
    """The same below 1000 ft, where their scale is the height."""
    return M_PER_FT * LOW_GUST_FT_S[turbulence]


def gust_sigma_rad_s(turbulence: str, span_m: float) -> float:
    """Standard deviation of the air's rotation, rad/s, on any axis of an aircraft of this span."""
    span_ft = span_m / M_PER_FT
    return ROLLING * GUST_FT_S[turbulence] / sqrt(SCALE_FT * span_ft)


def low_gust_sigma_rad_s(turbulence: str, span_m: float) -> float:
    """The same below 1000 ft times the root of the height in m, rad/s m^0.5."""
    return ROLLING * low_gust_mps(turbulence) / sqrt(span_m)


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


def tolerances(given: float | dict[str, float], aircraft: Aircraft, values: np.ndarray) -> np.ndarray:
    """Tolerance of each moment coefficient, absolute; values: the designer's, as `Aircraft.moments`."""
    share = [given.get(term.name, 0.0) if isinstance(given, dict) else given for term in aircraft.moments]
    return np.array(share) * np.abs(values[: len(share)])


def configure(bound: np.void, scenario: "Scenario", design: np.void) -> None:
    """Fill in the declared bound, and what the aircraft's terms leave: where it is mapped, or everywhere the
    same; design: the designer's record."""
    config, aircraft = scenario.fdi, scenario.airframe
    bound["inertia"], bound["earth_rate"] = config.bounds.inertia_coupling.as_tuple(), EARTH_RATE_RAD_S
    bound["constant"] = config.bounds.constant_rad_s2.as_tuple()
    every_type = config.fault_class == "all"
    fill_error_map(bound["error_map"], aircraft, every_type, whole=every_type and config.pairs)
    if aircraft.file.model_error_map is None:
        bound["constant"] += aircraft.model_error_rad_s2
    admitted = bound["admitted"]
    admit(admitted, config.bounds, aircraft, design, mass_of(scenario.design_model, aircraft))
    admit_engine(admitted, scenario)
    bound["own_errors"] = admitted["any"] and every_type


def admit(
    admitted: np.void, bounds: Bounds, aircraft: Aircraft, design: np.void, mass: MassProperties
) -> None:
    """Fill the record; the design record and mass are the designer's."""
    tolerance = tolerances(bounds.coefficients, aircraft, design["moments"]["value"])
    admitted["tolerance"][: tolerance.size] = tolerance
    admitted["inertia"] = inertia_slack(bounds.inertia, mass)
    admitted["deflection"] = radians(bounds.deflection_deg)
    errors, span_m = Errors(bounds.sensors), aircraft.geometry.span_m
    admitted["gust_aloft"] = GUST_LIMIT_SIGMA * gust_sigma_rad_s(bounds.turbulence, span_m)
    admitted["gust_low"] = GUST_LIMIT_SIGMA * low_gust_sigma_rad_s(bounds.turbulence, span_m)
    admitted["gust"] = admitted["gust_aloft"]
    admitted["altitude_off"], admitted["altitude_slope"] = errors["altitude"].worst, errors["altitude"].slope
    admitted["offset"], admitted["slope"] = errors.each("worst"), errors.each("slope")
    admitted["steady"] = errors.each("steady", AXES)
    declared = (admitted["tolerance"], admitted["inertia"], admitted["deflection"], admitted["gust"])
    admitted["any"] = any(np.any(part) for part in declared) or not bounds.sensors.is_ideal


def admit_engine(admitted: np.void, scenario: "Scenario") -> None:
    """Admit errors of dpt where those are declared of which it is worked out.

    The engine may be set anywhere between here and its highest manifold pressure.
    """
    sensors = scenario.fdi.bounds.sensors
    declared = any(not getattr(sensors, name).is_ideal for name in OF_THE_SLIPSTREAM)
    if not (declared and scenario.airframe.has_engine_instruments):
        return
    initial: Any = scenario.initial
    highest = scenario.airframe.engine.settings["manifold_pressure_inhg"].range[1]
    largest = dict(zip(ENGINE, (initial.engine_rpm, highest), strict=True))
    errors = [Errors(sensors)[name].of_reading(most) for name, most in largest.items()]
    admitted["engine"] = 1
    admitted["engine_kw"], admitted["thin_air_kw"] = power_error_kw(initial.engine_rpm, highest, *errors)


def poles_for_noise(sensors: Sensors, constant_rad_s2: float) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of DELAYS_S, despite gyro noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta_bar / lam + 2 nbar. The excess
    of one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    nbar = 2 * NOISE_LIMIT_SIGMA * float(Errors(sensors).each("noise", AXES).max())
    return tuple(_pole(delay_s, nbar, constant_rad_s2) for delay_s in DELAYS_S) if nbar > 0 else ()


def _pole(delay_s: float, noise: float, eta_bar: float) -> float:
    phi = eta_bar + 8.0 * noise / delay_s
    for _ in range(50):
        pole = max(log(phi * delay_s / noise) / delay_s, 0.1 / delay_s)
        phi = (noise * pole + eta_bar) / (1.0 - exp(-pole * delay_s))
    return pole
