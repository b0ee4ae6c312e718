"""The standard atmosphere up to 20 km [ISA]."""

from math import exp, log

from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2

# Standard atmosphere [ISA]: temperature and pressure at sea level, lapse rate, exponent g / (R lapse) of the
# pressure, height of the tropopause; gas constant of air, J/(kg K).
T0_K, LAPSE_K_M, P0_HPA, SCALE, STRATOSPHERE_M = 288.15, 0.0065, 1013.25, 5.2558797, 11000.0
R_AIR, PA_PER_HPA, KELVIN_AT_0_C = 287.05287, 100.0, 273.15


def standard_air(altitude_m: float) -> tuple[float, float]:
    """Pressure, hPa, and temperature, deg C, of the standard atmosphere at an altitude h, m:

    T = T0 - lapse h,    p = P0 (T / T0)^SCALE              up to the tropopause
    T constant,          p falls with exp(-g h / (R T))     above it
    """
    low_m = min(altitude_m, STRATOSPHERE_M)
    kelvin = T0_K - LAPSE_K_M * low_m
    pressure = P0_HPA * (kelvin / T0_K) ** SCALE
    return pressure * exp(-GRAVITY_MPS2 * (altitude_m - low_m) / (R_AIR * kelvin)), kelvin - KELVIN_AT_0_C


def standard_density(altitude_m: float) -> float:
    """Density of the standard atmosphere at an altitude, kg/m3: p / (R T)."""
    pressure_hpa, celsius = standard_air(altitude_m)
    return PA_PER_HPA * pressure_hpa / (R_AIR * (celsius + KELVIN_AT_0_C))


def altitude_of(density_kg_m3: float) -> float:
    """The altitude at which the air has this density, m: the inverse of `standard_density`."""
    tropopause = standard_density(STRATOSPHERE_M)
    if density_kg_m3 >= tropopause:
        share = density_kg_m3 / standard_density(0.0)
        return T0_K / LAPSE_K_M * (1.0 - share ** (1.0 / (SCALE - 1.0)))
    scale_m = R_AIR * (T0_K - LAPSE_K_M * STRATOSPHERE_M) / GRAVITY_MPS2
    return STRATOSPHERE_M + scale_m * log(tropopause / density_kg_m3)
