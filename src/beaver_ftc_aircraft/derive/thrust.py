"""What power gives an aircraft: the force along the body that it adds, over airspeed and setting; its lag.

The aircraft is put back where it was time and again, so that it flies nowhere while its engines settle. Not
so for the lag: JSBSim lets turbines jump to their speed whenever it initialises.
"""

from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.aircraft import M_PER_FT, N_PER_LBF
from beaver_ftc.plant import LEVER_DIFFERENCE as DIFFERENCE
from beaver_ftc.plant import FlightState, Plant
from beaver_ftc_aircraft.derive.engines import BETWEEN_S, hold, run_between

OF_ENGINES = "forces/fbx-prop-lbs"
# The force along the body's x axis, weight excepted: while the state is held, only the engines' part changes.
FORCE = "forces/fbx-total-lbs"
SPEEDS, SETTINGS = 5, 6
SETTLED_S, LONGEST_S = 6.0, 8.0  # after a step of the power; and of the step that shows the lag
_FROM, _TO = 0.4, 0.7  # of the range: that step
_STEP = 0.2  # of one engine's lever
_MOMENTS = ("moments/m-prop-lbsft", "moments/n-prop-lbsft")
LEAST_ARM_M = 0.2  # beside the centre of gravity
_AFTER_TIME_CONSTANT = 1.0 - np.exp(-1.0)  # share of a first-order change


def thrust_of(plant: Plant, trim: FlightState) -> dict[str, Any] | None:
    """The section `engine.thrust` of the aircraft's file; None where no setting moves the power, or no mass
    is known that it would move.

    Zeros where nothing runs, or not for long. The plant is left in trim.
    """
    named = plant.aircraft.file.power_setting
    if named is None or not isfinite(plant.aircraft.mass.mass_kg):
        return None
    (low, high), airspeed_mps = named[1].range, np.linspace(*plant.aircraft.envelope.airspeed_mps, SPEEDS)
    setting, rows = np.linspace(low, high, SETTINGS), []
    for speed in airspeed_mps.tolist():
        state = replace(trim, airspeed_mps=speed)
        plant.start(state)
        row = []
        for power in setting.tolist():
            hold(plant, state, SETTLED_S, power)
            row.append(plant.read(FORCE) * N_PER_LBF)
        rows.append(np.maximum.accumulate(row) - row[0])
    lag_s = _lag_s(plant, trim, low, high)
    plant.start(trim)
    return {
        "airspeed_mps": _rounded(airspeed_mps), "setting": _rounded(setting),
        "force_n": [_rounded(row) for row in rows], "lag_s": round(lag_s, 2),
    }  # fmt: skip


def effectors_of(plant: Plant, trim: FlightState) -> dict[str, dict[str, Any]]:
    """The section `effectors`: of each engine its share of a change of thrust, and its arms, by what its own
    lever changes of the engines' moments about the centre of gravity. The plant is left in trim."""
    changes = []
    for i in range(plant.n_engines):
        seen = []
        for difference in (0.0, -_STEP):
            plant.start(trim)
            plant.write(DIFFERENCE.format(i=i), difference)
            hold(plant, trim, SETTLED_S, plant.read(plant.aircraft.trim.throttle))
            seen.append(np.array([plant.read(name) for name in (OF_ENGINES, *_MOMENTS)]))
        plant.write(DIFFERENCE.format(i=i), 0.0)
        changes.append(seen[0] - seen[1])
    plant.start(trim)
    whole = sum(force for force, _, _ in changes)
    return {
        f"engine_{i + 1}": {
            "throttle": DIFFERENCE.format(i=i), "share": round(float(force / whole), 4),
            "right_m": round(float(-yaw / force) * M_PER_FT, 3),
            "down_m": round(float(pitch / force) * M_PER_FT, 3),
        }
        for i, (force, pitch, yaw) in enumerate(changes)
    }  # fmt: skip


def _lag_s(plant: Plant, trim: FlightState, low: float, high: float) -> float:
    """When the engines have gone 63 % of the way after a step of the power, s; 0 where there are none."""
    if not plant.has(OF_ENGINES):
        return 0.0
    plant.start(trim)
    hold(plant, trim, SETTLED_S, low + _FROM * (high - low))
    before = plant.read(OF_ENGINES)
    plant.write(plant.aircraft.trim.throttle, low + _TO * (high - low))
    force = np.empty(round(LONGEST_S / BETWEEN_S))
    for k in range(force.size):
        run_between(plant)
        force[k] = plant.read(OF_ENGINES)
    there = np.abs(force - before) >= _AFTER_TIME_CONSTANT * abs(force[-1] - before)
    return float(np.argmax(there) * BETWEEN_S)


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.5g}") for value in values]
