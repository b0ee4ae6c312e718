"""The records of bounds.py, as they follow from what a scenario declares."""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, MassProperties
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S
from beaver_ftc.compiled import fill
from beaver_ftc.design.engine import power_error_kw
from beaver_ftc.design.model import InertiaCoefficients, inertia_coefficients
from beaver_ftc.diagnosis.bounds import WORST
from beaver_ftc.diagnosis.error_map import fill_map
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import ENGINE, OF_THE_SLIPSTREAM

GUST_LIMIT_SIGMA = 6.0  # standard deviations, which a gust exceeds once in 5e8 independent samples
_INERTIA_NAMES = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")


@lru_cache(maxsize=64)
def inertia_bounds(tol: float, mass: MassProperties) -> np.ndarray:
    """Largest change (12,) of the inertia coefficients, for every inertia within its relative tolerance
    `tol`.

    Each coefficient of an aircraft's inertias is monotonic in each of them while the others are constant, so
    the largest change is at a corner.
    """
    inertias = np.array([getattr(mass, name) for name in _INERTIA_NAMES])
    corners = []
    for scales in product((1 - tol, 1 + tol), repeat=4):
        at_corner = dict(zip(_INERTIA_NAMES, (inertias * scales).tolist(), strict=True))
        corners.append(inertia_coefficients(replace(mass, **at_corner)))
    worst = np.abs(np.array(corners) - inertia_coefficients(mass)).max(axis=0)
    worst.flags.writeable = False  # kept: the same for every flight of a design
    return worst


def configure_bound(bound: np.void, declared: Declared, model: np.void) -> None:
    """Fill in the declared bound and the error of the aircraft's design model: its map, or else one constant
    for all states. model: its record.
    """
    aircraft = declared.aircraft
    all_types = declared.fdi.fault_class == "all"
    const = np.array(declared.constant_rad_s2)
    if aircraft.file.model_error_map is None:
        const += aircraft.model_error_rad_s2
    fill_map(bound["error_map"], aircraft, all_types, all_types and declared.fdi.pairs)
    err = bound["declared_errors"]
    fill_errors(err, declared, model)
    fill_engine_errors(err, declared)
    fill(
        bound, coupling_share=declared.coupling, earth_rate_rad_s=EARTH_RATE_RAD_S, const=const,
        has_eG=err["given"] and all_types,
    )  # fmt: skip


def fill_errors(err: np.void, declared: Declared, model: np.void) -> None:
    """Fill the declared errors; model: record of the design model."""
    errors = declared.sensors
    air = declared.air
    b = declared.aircraft.geometry.span_m
    aloft = GUST_LIMIT_SIGMA * air.rotation_limit_rad_s(b)
    dC = declared.coefficients.absolute(declared.aircraft.moments, model["moments"]["value"])
    dI = inertia_bounds(declared.inertia, declared.mass)
    du = declared.deflections_rad
    err["model"] = model
    C = err["model"]["moments"]["value"]
    C[:] = np.abs(C)
    C[WORST, : dC.size] += dC
    for name, e in zip(InertiaCoefficients._fields, dI, strict=True):
        err["model"][name] = abs(model[name]) + np.array([0.0, e])  # measured, worst
    no_errors = errors.is_ideal and declared.servo_errors.is_none
    fill(
        err, du=du, du0=declared.deflection_rad, wg_aloft=aloft,
        wg_1m=GUST_LIMIT_SIGMA * air.low_rotation_limit_rad_s(b),
        h0=errors["altitude"].worst, h1=errors["altitude"].slope,
        e0=errors.each("worst"), e1=errors.each("slope"), steady=errors.each("steady", AXES),
        given=not no_errors or any(np.any(e) for e in (dC, dI, du, aloft)),
    )  # fmt: skip


def fill_engine_errors(err: np.void, declared: Declared) -> None:
    """Fill in the errors of dpt if the aircraft has instruments of the engine, and errors are declared of one
    from which dpt is computed.

    The engine may have any setting between the initial one and its highest manifold pressure.
    """
    errors = declared.sensors
    erring = any(not getattr(errors.declared, name).is_ideal for name in OF_THE_SLIPSTREAM)
    if not (erring and declared.aircraft.has_engine_instruments):
        return
    initial: Any = declared.initial
    largest = initial.engine_rpm, declared.aircraft.engine.settings["manifold_pressure_inhg"].range[1]
    bounds = [errors[name].of_reading(reading) for name, reading in zip(ENGINE, largest, strict=True)]
    kw0, kw1 = power_error_kw(*largest, *bounds)
    fill(err, engine=1, kw0=kw0, kw1=kw1)
