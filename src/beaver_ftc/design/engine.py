"""The R-985 Wasp Junior and its slipstream, as FDC has them [FDC, Power]."""

from beaver_ftc.compiled import kernel

SEA_LEVEL_DENSITY_KG_M3 = 1.225


def engine_power_kw(engine_rpm: float, manifold_pressure_inhg: float, density_kg_m3: float) -> float:
    """Shaft power from the engine's chart fit: kW from rpm, inHg and kg/m3."""
    thin_air = (408.0 - 0.0965 * engine_rpm) * (1.0 - density_kg_m3 / SEA_LEVEL_DENSITY_KG_M3)
    return 0.7355 * (-326.5 + 0.00412 * (manifold_pressure_inhg + 7.4) * (engine_rpm + 2010.0) + thin_air)


def slipstream(power_kw: float, density_kg_m3: float, airspeed_mps: float) -> float:
    """dpt, the dimensionless total pressure rise across the propeller: power in kW, not W."""
    return 0.08696 + 191.18 * 2.0 * power_kw / (density_kg_m3 * airspeed_mps**3)


@kernel
def measured_slipstream(engine_rpm, manifold_pressure_inhg, airspeed_mps, qdyn_pa):
    """dpt from the engine's instruments and the air data, whose density is 2 qdyn / V^2."""
    density = 2.0 * qdyn_pa / airspeed_mps**2
    thin_air = (408.0 - 0.0965 * engine_rpm) * (1.0 - density / SEA_LEVEL_DENSITY_KG_M3)
    chart = 0.00412 * (manifold_pressure_inhg + 7.4) * (engine_rpm + 2010.0)
    power_kw = 0.7355 * (-326.5 + chart + thin_air)
    return 0.08696 + 191.18 * power_kw / (qdyn_pa * airspeed_mps)
