"""Thrust over power, and power over thrust.

Of a piston engine whose slipstream is among the forces, the slope of thrust over power where it is now; of
any other, a table of steady thrust over airspeed and power, as the aircraft's file has it. Power is in the
units of its setting.
"""

from typing import Any

import numpy as np

from beaver_ftc.aircraft.schema import MAX_THRUST
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import DPT, QDYN

LEAST_PUSH = 1e-3  # m/s2 per inHg
LEAST_RISE = 1e-4  # m/s2 from one setting to the next, so that each has its own

# Settings and airspeeds (m/s) there are, thrust over mass (m/s2) at these, and at the airspeed of the frame.
ENGINE = record(
    settings=int, airspeeds=int, setting=MAX_THRUST, airspeed=MAX_THRUST, table=(MAX_THRUST, MAX_THRUST),
    now=MAX_THRUST,
)  # fmt: skip


def set_up_engine(engine: np.void, thrust: Any, mass_kg: float) -> None:
    """Fill the record (dtype ENGINE) from a file's `engine.thrust`; None leaves it empty."""
    if thrust is None:
        return
    m, n = len(thrust.airspeed_mps), len(thrust.setting)
    engine["airspeeds"], engine["settings"] = m, n
    engine["airspeed"][:m], engine["setting"][:n] = thrust.airspeed_mps, thrust.setting
    engine["table"][:m, :n] = np.array(thrust.force_n) / mass_kg + LEAST_RISE * np.arange(n)


@kernel
def between(at, n, x, y):
    """y (n,) at `at`, linear between the rising x (n,); beyond its ends the nearest."""
    k = 0
    while k < n - 2 and at > x[k + 1]:
        k += 1
    part = min(max((at - x[k]) / (x[k + 1] - x[k]), 0.0), 1.0)
    return y[k] + part * (y[k + 1] - y[k])


@kernel
def look_up(engine, airspeed):
    """Fill engine.now for an airspeed, m/s."""
    for j in range(engine.settings):
        engine.now[j] = between(airspeed, engine.airspeeds, engine.airspeed, engine.table[:, j])


@kernel
def thrust_per_inhg(thrust, alpha, airspeed, power, y):
    """Acceleration along the path per inHg of manifold pressure, m/s2; thrust (2,): of the slipstream."""
    dpt_per_inhg = power.config.dpt_factor / (2.0 * y[QDYN] * airspeed)
    slope = thrust[0] + 2.0 * thrust[1] * alpha * y[DPT]
    return max(y[QDYN] * slope * dpt_per_inhg, LEAST_PUSH)


@kernel
def gained(engine, push, trim, power):
    """The acceleration by which a power exceeds that in trim, m/s2; push: its slope if there is no table."""
    if engine.settings == 0:
        return push * (power - trim)
    there = between(power, engine.settings, engine.setting, engine.now)
    return there - between(trim, engine.settings, engine.setting, engine.now)


@kernel
def power_for(engine, push, trim, acceleration):
    """The power whose acceleration exceeds that in trim by so much, m/s2: the inverse of `gained`."""
    if engine.settings == 0:
        return trim + acceleration / push
    wanted = acceleration + between(trim, engine.settings, engine.setting, engine.now)
    return between(wanted, engine.settings, engine.now, engine.setting)
