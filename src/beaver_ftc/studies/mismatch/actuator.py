"""The healthy actuator, driven by the logged command: what the surfaces would have done with no fault.

    a' = a + min(max(w (demand - a), -rate dt), rate dt),  w = 1 - exp(-bandwidth dt)

every JSBSim frame of dt, within the stops; with neither lag nor rate limit a is the demand. The command
of a row was in force in all JSBSim frames that led to it; at the start the actuator rests at its command.
"""

from dataclasses import dataclass
from math import exp, inf, radians
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.coefficients import SURFACES, TRAVEL

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


@dataclass
class HealthyActuators:
    """Four actuators and where they are: `follow` moves them on, a stretch of commands at a time."""

    gain: np.ndarray  # (4,) share of the way to the demand in one JSBSim frame
    reach: np.ndarray  # (4,) rad, the longest way in one JSBSim frame
    low: np.ndarray  # (4,) rad
    high: np.ndarray
    runs: int  # JSBSim frames per row
    at_rad: np.ndarray | None = None

    @classmethod
    def of(cls, scenario: "Scenario") -> "HealthyActuators":
        """The scenario's actuators, before the first command."""
        dt = 1.0 / (scenario.rate_hz * scenario.substeps)
        dynamics = [getattr(scenario.actuators, surface) for surface in SURFACES]
        stops = np.array([_stops(surface, of) for surface, of in zip(SURFACES, dynamics, strict=True)])
        return cls(
            gain=np.array(
                [1.0 - exp(-d.bandwidth_rad_s * dt) if d.bandwidth_rad_s else 1.0 for d in dynamics]
            ),
            reach=np.array(
                [radians(d.rate_limit_deg_s) * dt if d.rate_limit_deg_s else inf for d in dynamics]
            ),
            low=stops[:, 0],
            high=stops[:, 1],
            runs=scenario.substeps,
        )

    @property
    def _ideal(self) -> np.ndarray:
        """Which follow their command at once, (4,) bool."""
        return (self.gain == 1.0) & np.isinf(self.reach)

    def follow(self, commands: np.ndarray) -> np.ndarray:
        """Positions (n, 4) rad at rows with these commands (n, 4) rad, following those given before."""
        if self._ideal.all():
            return np.clip(commands, self.low, self.high)
        if self.at_rad is None:
            self.at_rad = np.clip(commands[0], self.low, self.high)
        positions = np.empty_like(commands)
        _follow(commands, self.gain, self.reach, self.low, self.high, self.runs, self.at_rad, positions)
        return positions


def _stops(surface: str, dynamics) -> tuple[float, float]:
    if dynamics.travel_deg is not None:
        low, high = dynamics.travel_deg
        return radians(low), radians(high)
    return TRAVEL[surface].min_rad, TRAVEL[surface].max_rad


@kernel
def _follow(commands, gain, reach, low, high, runs, at, positions):
    """Fill positions (n, 4) rad, `runs` JSBSim frames a row, and leave `at` (4,) rad at the last."""
    for k in range(commands.shape[0]):
        for s in range(4):
            demand = min(max(commands[k, s], low[s]), high[s])
            ideal = gain[s] == 1.0 and reach[s] == np.inf
            for _ in range(runs):
                way = min(max(gain[s] * (demand - at[s]), -reach[s]), reach[s])
                at[s] = demand if ideal else min(max(at[s] + way, low[s]), high[s])
            positions[k, s] = at[s]
