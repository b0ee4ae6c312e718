"""The ground under an aircraft that can be told of one: laid out, and stood upon."""

from dataclasses import replace
from math import radians

import numpy as np

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plant.adapter import FT_PER_M, FlightState, Plant

_AT_REST = ("accelerations/wdot-ft_sec2", "accelerations/qdot-rad_sec2")
_AIR = ("atmosphere/turb-type", *(f"atmosphere/gust-{axis}-fps" for axis in ("north", "east", "down")))
_STEPS = 1e-4, 1e-5  # m, rad: for differences
_GOAL, _MOST_STEPS = 1e-5, 20  # ft/s2 and rad/s2: JSBSim finds friction to some 1e-7


def lay(plant: Plant, ground_m: float) -> None:
    """Have a ground from now on, at this height above sea level. The aircraft has a section `ground`."""
    plant.write(plant.aircraft.file.ground.present, 1.0)  # type: ignore[union-attr]
    plant.write("position/terrain-elevation-asl-ft", ground_m * FT_PER_M)


def stand(plant: Plant, neutral: FlightState, ground_m: float) -> None:
    """Put the aircraft onto a ground of this height, at rest: surfaces and engine as in `neutral`.

    Height and pitch are where the wheels carry the weight, found by Newton's method from what its file says;
    along the ground friction holds it. Wings level, heading north; in still air, the wind comes back after.
    """
    lay(plant, ground_m)
    air = {name: plant.read(name) for name in _AIR}
    for name in air:
        plant.write(name, 0.0)
    ground = plant.aircraft.file.ground
    x = np.array([ground_m + ground.height_m, radians(ground.pitch_deg)])  # type: ignore[union-attr]
    at = replace(neutral, airspeed_mps=0.0, alpha_rad=0.0, beta_rad=0.0, phi_rad=0.0, psi_rad=0.0)

    for name, setting in plant.aircraft.engine.settings.items():
        plant.write(setting.property, neutral.settings[name])

    def look(x: np.ndarray) -> np.ndarray:
        plant.hold(replace(at, altitude_m=float(x[0]), theta_rad=float(x[1])))
        return np.array([plant.read(name) for name in _AT_REST])

    here = look(x)
    for _ in range(_MOST_STEPS):
        if np.abs(here).max() <= _GOAL:
            break
        slopes = [(look(x + step) - here) / step.sum() for step in np.diag(_STEPS)]
        x = x - np.linalg.solve(np.column_stack(slopes), here)
        here = look(x)
    else:
        raise SimulationFailed(f"{plant.aircraft.name} does not come to rest on its wheels")
    for name, value in air.items():
        plant.write(name, value)
