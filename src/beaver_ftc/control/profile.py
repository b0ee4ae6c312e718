"""The profile that the autopilot flies: legs of altitude, airspeed, heading and bank, and how far it is off.

A leg begins at an instant and moves its channel's command to a value, at most at its rate. The functions
here write the fields of the autopilot's record (autopilot.py) that AUTOPILOT lists under "profile" and
"deviations".
"""

from math import inf, nan, radians

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.signals import MEAN_S, TIME_TOLERANCE_S

ALTITUDE, SPEED, HEADING, BANK = range(4)
N_CHANNELS = 4
MAX_LEGS = 100
CHANNELS = ("altitude_m", "airspeed_mps", "heading_deg", "bank_deg")
_UNIT = dict(zip(CHANNELS, (1.0, 1.0, radians(1.0), radians(1.0)), strict=True))
NOT_JUDGED = -1.0  # a deviation that no frame has counted for
AT_ONE_INSTANT = "airspeed_at_one_instant_mps"  # the largest deviation, where `airspeed_mps` is of the mean
LIMITED = "airspeed_limited_mps"  # the commanded one, as far as it can be held
COLUMNS = (
    "altitude_command_m", "airspeed_command_mps", "heading_command_rad", "bank_command_rad", LIMITED,
)  # fmt: skip
SETTLED_S = 30.0  # after the command of an angle has changed, before its deviation counts


@kernel
def clamp(value, most):
    """value within -most and most."""
    return min(max(value, -most), most)


@kernel
def wrap_to_half_turn(angle):
    """The same direction within half a turn, rad."""
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@kernel
def begin_leg(autopilot, c, now, t):
    """Take up the next leg of channel c, which is at `now` as measured."""
    j = autopilot.next_leg_index[c]
    autopilot.next_leg_index[c] = j + 1
    if not autopilot.is_commanded[c]:
        autopilot.is_commanded[c] = 1
        autopilot.command[c] = now
    value = autopilot.leg_value[c, j]
    autopilot.goal[c] = autopilot.command[c]
    if not np.isnan(value):
        away = value - autopilot.command[c]
        autopilot.goal[c] += wrap_to_half_turn(away) if c == HEADING else away
        autopilot.changed_at_s[c] = t
    autopilot.max_command_rate[c] = autopilot.leg_max_command_rate[c, j]


@kernel
def advance_commands(autopilot, measured, t):
    """Bring every channel's command to t s; measured (N_CHANNELS,): where they are."""
    for c in range(N_CHANNELS):
        while (
            autopilot.next_leg_index[c] < autopilot.n_legs[c]
            and t >= autopilot.leg_starts_at_s[c, autopilot.next_leg_index[c]] - TIME_TOLERANCE_S
        ):
            begin_leg(autopilot, c, measured[c], t)
        if autopilot.is_commanded[c]:
            away = autopilot.goal[c] - autopilot.command[c]
            most = autopilot.max_command_rate[c] * autopilot.dt
            step = clamp(away, most)
            autopilot.command[c] += step
            autopilot.command_rate[c] = step / autopilot.dt if most < np.inf else 0.0


@kernel
def record_deviations(autopilot, altitude_m, airspeed_mps, heading, bank, t):
    """Update each commanded channel's deviation: `mean_deviation`, and the largest one so far. Of angles, it
    counts once SETTLED_S have passed since the last change; of the airspeed, the mean counts."""
    where = (altitude_m, airspeed_mps, heading, bank)
    for c in range(N_CHANNELS):
        if not autopilot.is_commanded[c]:
            continue
        away = where[c] - autopilot.command[c]
        if c == HEADING:
            away = wrap_to_half_turn(away)
        autopilot.mean_deviation[c] += autopilot.dt / MEAN_S * (away - autopilot.mean_deviation[c])
        if c == SPEED:
            record_airspeed_deviations(autopilot, airspeed_mps, away)
            away = autopilot.mean_deviation[c]
        if c in (ALTITUDE, SPEED) or t >= autopilot.changed_at_s[c] + SETTLED_S:
            autopilot.largest_deviation[c] = max(autopilot.largest_deviation[c], abs(away))


@kernel
def record_airspeed_deviations(autopilot, airspeed_mps, away):
    """Update the largest deviation at one instant, of `away` m/s, and that of the mean from the airspeed to
    fly."""
    autopilot.largest_instant_airspeed_deviation = max(
        autopilot.largest_instant_airspeed_deviation, abs(away)
    )
    mean = autopilot.mean_deviation_from_airspeed_to_fly
    mean += autopilot.dt / MEAN_S * (airspeed_mps - autopilot.airspeed_to_fly - mean)
    autopilot.mean_deviation_from_airspeed_to_fly = mean
    autopilot.largest_deviation_from_airspeed_to_fly = max(
        autopilot.largest_deviation_from_airspeed_to_fly, abs(mean)
    )


def set_up_profile(autopilot: np.void, declared: Declared) -> None:
    """Fill in the legs; in flight too, where those that have been begun are the same as before."""
    for c, (name, unit) in enumerate(_UNIT.items()):
        legs = getattr(declared.autopilot, name)
        autopilot["n_legs"][c] = len(legs)
        for j, leg in enumerate(legs):
            autopilot["leg_starts_at_s"][c, j] = leg.at_s
            autopilot["leg_value"][c, j] = nan if leg.value is None else leg.value * unit
            most = getattr(leg, "climb_mps", getattr(leg, "change_mps2", inf))
            autopilot["leg_max_command_rate"][c, j] = most
