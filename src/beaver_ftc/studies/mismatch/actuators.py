"""Healthy actuators, which follow the logged commands as the surfaces would without a fault.

With the position a (rad), in each JSBSim frame of length dt (s), within the stops,

    a <- a + min(max(w e, -rate dt), rate dt),  w = 1 - exp(-bandwidth dt),  e = demand - a less the dead band

An actuator without lag, rate limit and dead band has a = demand. The command of a row was in force in all
JSBSim frames that led to it. At the start, the actuator rests at its command.
"""

from math import exp, inf, radians

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.fdc import SURFACES, TRAVEL
from beaver_ftc.scenario.schema import Scenario


def healthy_positions(scenario: Scenario, commands: np.ndarray) -> np.ndarray:
    """Positions (n, 4) rad of healthy actuators at the rows of a log with these commands (n, 4) rad."""
    dt = 1.0 / (scenario.rate_hz * scenario.substeps)
    share, reach, band, low, high = np.array([_servo(scenario, surface, dt) for surface in SURFACES]).T
    positions = np.empty_like(commands)
    _follow(commands, share, reach, band, low, high, scenario.substeps, positions)
    return positions


def _servo(scenario: Scenario, surface: str, dt: float) -> tuple[float, ...]:
    """The servo of a surface in a JSBSim frame of dt s: share w, then reach = rate dt, dead band, lower and
    upper stop, rad."""
    servo = getattr(scenario.actuators, surface)
    errors = getattr(scenario.uncertainty.actuators, surface)
    bandwidth = servo.bandwidth_rad_s * errors.bandwidth
    rate = servo.rate_limit_deg_s * errors.rate_limit
    stops = TRAVEL[surface].min_rad, TRAVEL[surface].max_rad
    if servo.travel_deg is not None:
        stops = radians(servo.travel_deg[0]), radians(servo.travel_deg[1])
    share = 1.0 - exp(-bandwidth * dt) if bandwidth else 1.0
    reach = radians(rate) * dt if rate else inf
    return share, reach, radians(errors.dead_band_deg), *stops


@kernel(allocates=True)
def _follow(commands, share, reach, band, low, high, runs, positions):
    """Fill positions (n, 4) rad with a, by the recursion of the module. runs: JSBSim frames in a row.

    commands (n, 4) rad. For each surface (4,): share w; reach = rate dt, dead band to each side, and stops
    low and high, rad.
    """
    at = np.minimum(np.maximum(commands[0], low), high)
    ideal = (share == 1.0) & (reach == np.inf) & (band == 0.0)
    for k in range(commands.shape[0]):
        demand = np.minimum(np.maximum(commands[k], low), high)
        for _ in range(runs):
            e = demand - at
            e -= np.minimum(np.maximum(e, -band), band)
            way = np.minimum(np.maximum(share * e, -reach), reach)
            at = np.where(ideal, demand, np.minimum(np.maximum(at + way, low), high))
        positions[k] = at
