"""The highest engine power whose propeller the rudder can hold.

    |Cn_dpt3| dpt^3 = YAW_SHARE |Cn_dr| rudder_rad        dpt: slipstream; rudder_rad: travel of the rudder

The propeller yaws with dpt^3. In slow flight at full power this is more than the rudder can hold. P is the
manifold pressure, inHg, V the airspeed, m/s, and rho the density, kg/m3.
"""

from typing import Any

import numpy as np

from beaver_ftc.aircraft import YAW
from beaver_ftc.compiled import kernel
from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.table import AIRSPEED, DPT, QDYN
from beaver_ftc.scenario.declared import Declared

YAW_SHARE = 0.5  # share of the rudder's travel that engine power may need; the rest is there to fly with


def slipstream_limits(declared: Declared, layout: np.void) -> tuple[float, float]:
    """Two values of the slipstream:

        dpt_factor     rho V^3 d dpt / d P of the engine [FDC], kg/m3 (m/s)^3 per inHg: constant at a given
                       rpm, so it is computed at rho = 1 kg/m3 and V = 1 m/s
        highest_dpt    the dpt at which the propeller's yawing moment takes YAW_SHARE of the rudder's travel
                       to its nearer stop; infinite if the propeller has no yawing moment

    Cn_dr: sum over the terms of all surfaces that move mainly yaw, without signals.
    """
    initial: Any = declared.initial  # the keys of its engine differ between aircraft
    aircraft = declared.aircraft
    rudder = layout["main"][YAW]
    rpm = initial.engine_rpm
    Cn = [term for term in aircraft.terms.values() if term.coefficient == "Cn"]
    rudders = {s for s, axis in zip(aircraft.surfaces, aircraft.dominant_axis, strict=True) if axis == YAW}
    Cn_dr = sum(declared.terms[term.name] for term in Cn if not term.of and term.surface in rudders)
    Cn_dpt3 = sum(declared.terms[term.name] for term in Cn if term.of == (("dpt", 3),))
    rudder_rad = min(-layout["low"][rudder], layout["high"][rudder])
    dpt3 = abs(YAW_SHARE * Cn_dr * rudder_rad / Cn_dpt3) if Cn_dpt3 else np.inf
    kw_per_inhg = engine_power_kw(rpm, 1.0, 1.0) - engine_power_kw(rpm, 0.0, 1.0)
    return slipstream(kw_per_inhg, 1.0, 1.0) - slipstream(0.0, 1.0, 1.0), dpt3 ** (1.0 / 3.0)


@kernel
def ceiling(power, y, highest_dpt):
    """Highest manifold pressure, inHg, with at most this slipstream, from the present one:

        P + (highest_dpt - dpt) / (d dpt / d P),    d dpt / d P = dpt_factor / (2 qdyn V)

    power: record POWER of power.py; y: measured signals. Without a slipstream (dpt_factor 0) there is no
    limit.
    """
    if power.config.dpt_factor == 0.0:
        return np.inf
    per_inhg = power.config.dpt_factor / (2.0 * y[QDYN] * y[AIRSPEED])
    return power.output.command[0] + (highest_dpt - y[DPT]) / per_inhg
