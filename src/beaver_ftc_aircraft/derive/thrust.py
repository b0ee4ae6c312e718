"""What power gives an aircraft: the force along the body that it adds, over airspeed and setting; its lag.

The aircraft is put back where it was time and again, so that it flies nowhere while its engines settle. Not
so for the lag: JSBSim lets turbines jump to their speed whenever it initialises.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.aircraft import M_PER_FT, N_PER_LBF
from beaver_ftc.plant import LEVER_DIFFERENCE as DIFFERENCE
from beaver_ftc.plant import FlightState, Plant

OF_ENGINES = "forces/fbx-prop-lbs"
# The force along the body's x axis, weight excepted: while the state is held, only the engines' part changes.
FORCE = "forces/fbx-total-lbs"
SPEEDS, SETTINGS = 5, 6
SETTLED_S, LONGEST_S = 6.0, 8.0  # after a step of the power; and of the step that shows the lag
_FROM, _TO = 0.4, 0.7  # of the range: that step
_BETWEEN_S = 0.1
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
        row = [list(_settling(plant, state, power, SETTLED_S))[-1] for power in setting.tolist()]
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
            for _ in _settling(plant, trim, plant.read(plant.aircraft.trim.throttle), SETTLED_S):
                pass
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
    for _ in _settling(plant, trim, low + _FROM * (high - low), SETTLED_S):
        pass
    before = plant.read(OF_ENGINES)
    plant.write(plant.aircraft.trim.throttle, low + _TO * (high - low))
    force = np.array([_later(plant, OF_ENGINES) for _ in range(round(LONGEST_S / _BETWEEN_S))])
    there = np.abs(force - before) >= _AFTER_TIME_CONSTANT * abs(force[-1] - before)
    return float(np.argmax(there) * _BETWEEN_S)


def _settling(plant: Plant, state: FlightState, power: float, for_s: float) -> Iterator[float]:
    """The force at a setting, N, each tenth of a second, the aircraft held in a state."""
    for _ in range(round(for_s / _BETWEEN_S)):
        plant.hold(state)
        plant.write(plant.aircraft.trim.throttle, power)
        yield _later(plant, FORCE) * N_PER_LBF


def _later(plant: Plant, name: str) -> float:
    """A property a tenth of a second on."""
    for _ in range(round(_BETWEEN_S / plant.dt_s)):
        plant.run()
    return plant.read(name)


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.5g}") for value in values]
