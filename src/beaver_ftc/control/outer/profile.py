"""The commanded profile: where each channel should be now, from the legs of the scenario."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.outer.state import HEADING, N_CHANNELS

INSTANT_S = 1e-9  # frame times are k / rate in floating point


@kernel
def turn(angle):
    """The same direction within half a turn, rad."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@kernel
def begin_leg(autopilot, c, now, t):
    """Take up the next leg of channel c, which is at `now` as measured."""
    j = autopilot.leg[c]
    autopilot.leg[c] = j + 1
    if not autopilot.commanded[c]:
        autopilot.commanded[c] = 1
        autopilot.command[c] = now
    value = autopilot.value[c, j]
    autopilot.goal[c] = autopilot.command[c]
    if not np.isnan(value):
        away = value - autopilot.command[c]
        autopilot.goal[c] += turn(away) if c == HEADING else away
        autopilot.changed_at_s[c] = t
    autopilot.pace[c] = autopilot.speed[c, j]


@kernel
def advance(autopilot, measured, t):
    """Bring every channel's command to t s; measured (N_CHANNELS,): where they are."""
    for c in range(N_CHANNELS):
        while autopilot.leg[c] < autopilot.legs[c] and t >= autopilot.at_s[c, autopilot.leg[c]] - INSTANT_S:
            begin_leg(autopilot, c, measured[c], t)
        if autopilot.commanded[c]:
            away, most = autopilot.goal[c] - autopilot.command[c], autopilot.pace[c] * autopilot.dt
            step = min(max(away, -most), most)
            autopilot.command[c] += step
            autopilot.moving[c] = step / autopilot.dt if most < np.inf else 0.0
