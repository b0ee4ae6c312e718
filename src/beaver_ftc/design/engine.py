"""The built-in aircraft's engine, an R-985 Wasp Junior, and its slipstream [FDC, Power]."""

from beaver_ftc.compiled import kernel
from beaver_ftc.design.table import AIRSPEED, DPT, QDYN

SEA_LEVEL_DENSITY_KG_M3 = 1.225
DPT_0, KW_TO_DPT = 0.08696, 191.18  # dpt = DPT_0 + KW_TO_DPT P / (qdyn V)


def engine_power_kw(engine_rpm: float, manifold_pressure_inhg: float, density_kg_m3: float) -> float:
    """Shaft power, kW, by a fit to the engine's chart, with the manifold pressure p, inHg, and rho0 at sea
    level:

    0.7355 (-326.5 + 0.00412 (p + 7.4) (rpm + 2010) + (408 - 0.0965 rpm) (1 - rho / rho0))        [FDC]
    """
    thin_air = (408.0 - 0.0965 * engine_rpm) * (1.0 - density_kg_m3 / SEA_LEVEL_DENSITY_KG_M3)
    return 0.7355 * (-326.5 + 0.00412 * (manifold_pressure_inhg + 7.4) * (engine_rpm + 2010.0) + thin_air)


def slipstream(power_kw: float, density_kg_m3: float, airspeed_mps: float) -> float:
    """dpt, the dimensionless rise of total pressure across the propeller:

    DPT_0 + KW_TO_DPT P / (rho V^3 / 2),    P in kW, not W
    """
    return DPT_0 + KW_TO_DPT * 2.0 * power_kw / (density_kg_m3 * airspeed_mps**3)


_power_kw = kernel(engine_power_kw)


@kernel
def measured_slipstream(engine_rpm, manifold_pressure_inhg, airspeed_mps, qdyn_pa):
    """dpt as by `slipstream`, from the engine's instruments and the air data: the density is 2 qdyn / V^2."""
    power_kw = _power_kw(engine_rpm, manifold_pressure_inhg, 2.0 * qdyn_pa / airspeed_mps**2)
    return DPT_0 + KW_TO_DPT * power_kw / (qdyn_pa * airspeed_mps)


@kernel
def density_ratio(y):
    """Density over that at sea level, from the air data in y."""
    return 2.0 * y[QDYN] / y[AIRSPEED] ** 2 / SEA_LEVEL_DENSITY_KG_M3


@kernel
def slipstream_slopes(y, k):
    """Derivatives of dpt with airspeed, s/m, with dynamic pressure, 1/Pa, and with shaft power P, 1/kW.

        dpt = DPT_0 + KW_TO_DPT P / (qdyn V)

    k kW: by how much P falls as the density ratio 2 qdyn / (V^2 rho0) rises by 1.
    """
    V, qdyn = y[AIRSPEED], y[QDYN]
    per_kw = KW_TO_DPT / (qdyn * V)
    thin = per_kw * k * density_ratio(y)
    return (2.0 * thin - (y[DPT] - DPT_0)) / V, -(thin + y[DPT] - DPT_0) / qdyn, per_kw


def power_error_kw(
    engine_rpm: float, manifold_pressure_inhg: float, rpm_error: float, inhg_error: float
) -> tuple[float, float]:
    """Largest error of `engine_power_kw`, kW: by the errors of the instruments, at a density of at most that
    at sea level; and per 1 of error in the density ratio. The true speed and pressure are within rpm_error
    and inhg_error of the given ones.
    """
    rpm, pressure = engine_rpm + rpm_error, manifold_pressure_inhg + 7.4 + inhg_error
    by_chart = 0.00412 * (pressure * rpm_error + (rpm + 2010.0) * inhg_error)
    by_air = 408.0 - 0.0965 * (engine_rpm - rpm_error)
    return 0.7355 * (by_chart + 0.0965 * rpm_error), 0.7355 * max(by_air, 0.0)
