"""Thrust over power, and power over thrust.

If the engine is a piston engine whose slipstream is among the forces, its thrust has a slope over the
manifold pressure, taken at the present state. Any other engine has a table of steady thrust over airspeed and
setting, `engine.thrust` of the aircraft's file.

    power       setting of the engine, in its own unit: inHg of a piston engine
    trim        the setting in trim, same unit
    push        slope of the acceleration over the setting, m/s2 per unit; used if there is no table
    engine      record, ENGINE
    gain        acceleration along the path, m/s2, by a setting in addition to that by another
"""

from typing import Any

import numpy as np

from beaver_ftc.aircraft.schema import MAX_THRUST
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import DPT, QDYN

LEAST_PUSH = 1e-3  # smallest push, m/s2 per inHg: power_for divides by it
LEAST_RISE = 1e-4  # added from one setting to the next, m/s2, so that no two settings have the same thrust

# The table of an engine; `settings` is 0 if there is none.
ENGINE = record(
    settings=int, airspeeds=int,  # how many of each are in use
    setting=MAX_THRUST, airspeed=MAX_THRUST,  # points of the table, both ascending; unit of the setting, m/s
    table=(MAX_THRUST, MAX_THRUST),  # [airspeed, setting]: thrust over mass, m/s2
    now=MAX_THRUST,  # by setting, at the airspeed of the frame: thrust over mass, m/s2
)  # fmt: skip


def set_up_engine(engine: np.void, thrust: Any, mass_kg: float) -> None:
    """Fill the record (dtype ENGINE) from a file's `engine.thrust`; None leaves it empty."""
    if thrust is None:
        return
    m = len(thrust.airspeed_mps)
    n = len(thrust.setting)
    engine["airspeeds"] = m
    engine["settings"] = n
    engine["airspeed"][:m] = thrust.airspeed_mps
    engine["setting"][:n] = thrust.setting
    engine["table"][:m, :n] = np.array(thrust.force_n) / mass_kg + LEAST_RISE * np.arange(n)


@kernel
def between(at, n, x, y):
    """y at x = `at`, linear between the points (x, y) (n,) with rising x; beyond the ends the nearest y:

    y_k + (at - x_k) / (x_k+1 - x_k) (y_k+1 - y_k),    x_k <= at <= x_k+1
    """
    k = 0
    while k < n - 2 and at > x[k + 1]:
        k += 1
    part = min(max((at - x[k]) / (x[k + 1] - x[k]), 0.0), 1.0)
    return y[k] + part * (y[k + 1] - y[k])


@kernel
def look_up(engine, airspeed):
    """Fill engine.now (settings,), m/s2, from the table at an airspeed, m/s."""
    for j in range(engine.settings):
        engine.now[j] = between(airspeed, engine.airspeeds, engine.airspeed, engine.table[:, j])


@kernel
def thrust_per_inhg(thrust, alpha, airspeed, power, y):
    """The push of a piston engine, m/s2 per inHg of manifold pressure P, and no less than LEAST_PUSH:

        d/dP [qdyn (thrust[0] dpt + thrust[1] alpha dpt^2)],    d dpt / d P = dpt_factor / (2 qdyn V)

    thrust (2,), m/s2 per Pa: acceleration by dpt, and by dpt^2 per rad of alpha, over qdyn. alpha rad,
    airspeed V m/s; power: POWER record of power.py; y: measured signals.
    """
    dpt_per_inhg = power.config.dpt_factor / (2.0 * y[QDYN] * airspeed)
    slope = thrust[0] + 2.0 * thrust[1] * alpha * y[DPT]
    return max(y[QDYN] * slope * dpt_per_inhg, LEAST_PUSH)


@kernel
def gained(engine, push, trim, power):
    """The gain of the setting `power` over the setting `trim`, m/s2: push (power - trim), or the difference
    of both in the table at the airspeed of the frame (`look_up`)."""
    if engine.settings == 0:
        return push * (power - trim)
    acceleration = between(power, engine.settings, engine.setting, engine.now)
    return acceleration - between(trim, engine.settings, engine.setting, engine.now)


@kernel
def power_for(engine, push, trim, acceleration):
    """The setting whose gain over the setting `trim` is `acceleration`, m/s2: the inverse of `gained`, within
    the table."""
    if engine.settings == 0:
        return trim + acceleration / push
    total = acceleration + between(trim, engine.settings, engine.setting, engine.now)
    return between(total, engine.settings, engine.now, engine.setting)
