"""The profile that the autopilot flies: legs of altitude, airspeed, heading and bank; deviations from it.

A *channel* c is one of these four signals, in m, m/s and rad. A leg begins at an instant and moves the
command of its channel to a value, at most at its rate. The functions here write the fields of the autopilot's
record (autopilot_setup.py) that AUTOPILOT lists under "Profile" and "Deviations".
"""

from math import inf, nan, radians

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.plant.instruments import wrapped
from beaver_ftc.scenario.autopilot import MEAN_S
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.instants import TIME_TOLERANCE_S

ALTITUDE, SPEED, HEADING, BANK = range(4)
N_CHANNELS = 4
MAX_LEGS = 100
CHANNELS = ("altitude_m", "airspeed_mps", "heading_deg", "bank_deg")
_UNIT = dict(zip(CHANNELS, (1.0, 1.0, radians(1.0), radians(1.0)), strict=True))
NOT_JUDGED = -1.0  # largest deviation of a channel of which no frame has counted
AT_ONE_INSTANT = "airspeed_at_one_instant_mps"  # key of the largest deviation in a frame, not of the mean
LIMITED = "airspeed_limited_mps"  # column of the airspeed to fly: the command, as far as it can be held
COLUMNS = (
    "altitude_command_m", "airspeed_command_mps", "heading_command_rad", "bank_command_rad", LIMITED,
)  # fmt: skip
SETTLED_S = 30.0  # time after a change of the command of an angle before its deviation counts


@kernel
def clamp(value, limit):
    """The value, limited to -limit and limit."""
    return min(max(value, -limit), limit)


@kernel
def begin_leg(autopilot, c, measured, t):
    """Begin the next leg of channel c at t s; measured: the signal, from which the command begins
    with the first leg. A heading goes to the value by the shorter turn. A leg without a value (NaN) keeps the
    command."""
    j = autopilot.next_leg_index[c]
    autopilot.next_leg_index[c] = j + 1
    if not autopilot.is_commanded[c]:
        autopilot.is_commanded[c] = 1
        autopilot.command[c] = measured
    value = autopilot.leg_value[c, j]
    autopilot.goal[c] = autopilot.command[c]
    if not np.isnan(value):
        change = value - autopilot.command[c]
        autopilot.goal[c] += wrapped(change) if c == HEADING else change
        autopilot.changed_at_s[c] = t
    autopilot.max_command_rate[c] = autopilot.leg_max_rate[c, j]


@kernel
def advance_commands(autopilot, measured, t):
    """Bring the command of each channel to t s, one step towards its goal, at most at its rate; measured
    (N_CHANNELS,): the signals. A command that may change at once has the rate 0."""
    for c in range(N_CHANNELS):
        while (
            autopilot.next_leg_index[c] < autopilot.n_legs[c]
            and t >= autopilot.leg_starts_at_s[c, autopilot.next_leg_index[c]] - TIME_TOLERANCE_S
        ):
            begin_leg(autopilot, c, measured[c], t)
        if autopilot.is_commanded[c]:
            max_step = autopilot.max_command_rate[c] * autopilot.dt
            step = clamp(autopilot.goal[c] - autopilot.command[c], max_step)
            autopilot.command[c] += step
            autopilot.command_rate[c] = step / autopilot.dt if max_step < np.inf else 0.0


@kernel
def record_deviations(autopilot, altitude_m, airspeed_mps, heading, bank, t):
    """Update the deviations of each commanded channel, signal - command, at t s:

        mean_deviation <- mean_deviation + dt / MEAN_S (deviation - mean_deviation)
        largest_deviation <- max(largest_deviation, |deviation|, for the airspeed |mean_deviation|)

    Of an angle, the largest deviation counts once SETTLED_S have passed since the last change of its goal.
    """
    signals = (altitude_m, airspeed_mps, heading, bank)
    for c in range(N_CHANNELS):
        if not autopilot.is_commanded[c]:
            continue
        deviation = signals[c] - autopilot.command[c]
        if c == HEADING:
            deviation = wrapped(deviation)
        autopilot.mean_deviation[c] += autopilot.dt / MEAN_S * (deviation - autopilot.mean_deviation[c])
        if c == SPEED:
            record_airspeed_deviations(autopilot, airspeed_mps, deviation)
            deviation = autopilot.mean_deviation[c]
        if c in (ALTITUDE, SPEED) or t >= autopilot.changed_at_s[c] + SETTLED_S:
            autopilot.largest_deviation[c] = max(autopilot.largest_deviation[c], abs(deviation))


@kernel
def record_airspeed_deviations(autopilot, airspeed_mps, deviation):
    """Update two more largest deviations of the airspeed: from the command at one instant (deviation, m/s),
    and of the mean over MEAN_S from the airspeed to fly."""
    autopilot.largest_instant_deviation = max(autopilot.largest_instant_deviation, abs(deviation))
    mean = autopilot.mean_limited_deviation
    mean += autopilot.dt / MEAN_S * (airspeed_mps - autopilot.airspeed_to_fly - mean)
    autopilot.mean_limited_deviation = mean
    autopilot.largest_limited_deviation = max(autopilot.largest_limited_deviation, abs(mean))


def set_up_profile(autopilot: np.void, declared: Declared) -> None:
    """Fill the legs. A change in flight fills them again; the legs that have begun must then be the same."""
    for c, (name, unit) in enumerate(_UNIT.items()):
        legs = getattr(declared.autopilot, name)
        autopilot["n_legs"][c] = len(legs)
        for j, leg in enumerate(legs):
            autopilot["leg_starts_at_s"][c, j] = leg.at_s
            autopilot["leg_value"][c, j] = nan if leg.value is None else leg.value * unit
            rate = getattr(leg, "climb_mps", getattr(leg, "change_mps2", inf))
            autopilot["leg_max_rate"][c, j] = rate
