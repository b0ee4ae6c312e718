"""Envelope protection: what can still be held with what is left of the surfaces.

Level flight takes an elevator that depends on dynamic pressure and flap (setup.py). What acts like the
elevator now is estimated from the balance of the pitch moments,

    acting = offset + left u + d / G,    d: what the law's observer finds unexplained

so a jam is known where it stands before its type is. The speeds at which the flap, less a reserve to fly
with, makes up for the rest are those that can be held; the commanded airspeed is brought among them.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.outer.state import BANK_LIMIT, FASTEST, N_FLAP, N_QDYN, SLOWEST, SPEED
from beaver_ftc.design.model import AIRSPEED, QDYN
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW

ACTING_S = 4.0  # over which the balance is averaged: gusts pitch within a second
SETTLED_S = 0.5  # and before which nothing is concluded from it
NOTED_MPS, NOTED_RAD = 0.5, 0.02  # a limit that bites by so much is announced


@kernel
def protect(autopilot, layout, surfaces, u, unexplained, y, t):
    """Bring autopilot.held, the airspeed to fly, to this frame: the commanded one where it can be held.

    u (n,) rad: where the surfaces are. unexplained rad: the elevator that would give what the law's observer
    finds in pitch.
    """
    hold, e, f = autopilot.holding, layout.main[PITCH], layout.stand_in
    hold.fastest, hold.slowest = np.inf, 0.0
    effectiveness, offset = surfaces.output.effectiveness, surfaces.output.offset
    left = effectiveness[e]
    whole = left >= 1.0 and (f < 0 or effectiveness[f] >= 1.0)
    if whole or not hold.known:
        hold.frames = 0
    else:
        watch(hold, autopilot.dt, offset[e], left * u[e], unexplained)
        if hold.frames * autopilot.dt > SETTLED_S:
            find(hold, layout, surfaces, y)
    approach(autopilot)
    announce(autopilot, layout.main, effectiveness, t)


@kernel
def watch(hold, dt, offset, commanded, unexplained):
    """Average the elevator that would account for the pitch moments there are, rad: it is off by `offset`,
    what is left of it gives `commanded`."""
    acting = offset + commanded + unexplained
    hold.frames += 1
    weight = max(dt / ACTING_S, 1.0 / hold.frames)
    hold.acting += weight * (acting - hold.acting)
    hold.centre += weight * (commanded - hold.centre)


@kernel
def find(hold, layout, surfaces, y):
    """The fastest and the slowest airspeed that can be held, m/s."""
    e, f = layout.main[PITCH], layout.stand_in
    left, effectiveness = surfaces.output.effectiveness[e], surfaces.output.effectiveness[f]
    least = hold.acting - hold.centre + left * layout.low[e]
    greatest = hold.acting - hold.centre + left * layout.high[e]
    up, down = layout.low[f] + hold.reserve, layout.high[f] - hold.reserve
    if effectiveness < surfaces.config.least_effectiveness:
        up = down = min(max(surfaces.output.offset[f], layout.low[f]), layout.high[f])
    per_pa = 2.0 * y[QDYN] / y[AIRSPEED] ** 2
    hold.fastest = np.sqrt(2.0 * limit_of(hold, up, greatest, True) / per_pa)
    hold.slowest = np.sqrt(2.0 * limit_of(hold, down, least, False) / per_pa)


@kernel
def limit_of(hold, flap, elevator, highest):
    """The highest (or lowest) dynamic pressure, Pa, of level flight with flap and elevator (rad): where the
    elevator it takes is the one there is. Infinite (or zero) where the table does not bound it."""
    before = needed(hold, 0, flap)
    if before > elevator:
        return hold.qdyn[0] if highest else 0.0
    for j in range(1, N_QDYN):
        after = needed(hold, j, flap)
        if after > elevator:
            part = (elevator - before) / (after - before)
            return hold.qdyn[j - 1] + part * (hold.qdyn[j] - hold.qdyn[j - 1])
        before = after
    return np.inf if highest else hold.qdyn[N_QDYN - 1]


@kernel
def needed(hold, j, flap):
    """Elevator for level flight at dynamic pressure j of the table and flap rad, between its columns."""
    k = 0
    while k < N_FLAP - 2 and flap > hold.flap[k + 1]:
        k += 1
    part = (flap - hold.flap[k]) / (hold.flap[k + 1] - hold.flap[k])
    return hold.elevator[j, k] + part * (hold.elevator[j, k + 1] - hold.elevator[j, k])


@kernel
def approach(autopilot):
    """Bring the airspeed to fly towards the nearest to the commanded one that can be held, without a bump."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    wanted = min(max(command, hold.slowest), hold.fastest)
    if wanted == command and not hold.limiting:
        autopilot.held, autopilot.held_moving = command, autopilot.moving[SPEED]
        return
    most = hold.pace * autopilot.dt
    step = min(max(wanted - autopilot.held, -most), most)
    autopilot.held += step
    autopilot.held_moving = step / autopilot.dt
    hold.limiting = autopilot.held != command


@kernel
def announce(autopilot, main, effectiveness, t):
    """Note since when a limit has bitten, and what it is at last; main (3,): who leads each axis."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    if autopilot.commanded[SPEED]:
        note(hold, FASTEST, hold.fastest, hold.fastest < command - NOTED_MPS, t)
        note(hold, SLOWEST, hold.slowest, hold.slowest > command + NOTED_MPS, t)
    if effectiveness[main[ROLL]] < 1.0 or effectiveness[main[YAW]] < 1.0:
        hold.bank += autopilot.dt / ACTING_S * (autopilot.bank_limit - hold.bank)
        note(hold, BANK_LIMIT, hold.bank, hold.bank < autopilot.most_bank - NOTED_RAD, t)


@kernel
def note(hold, kind, value, bites, t):
    """Keep a limit that bites now."""
    hold.in_force[kind] = bites
    if bites:
        if hold.from_s[kind] < 0.0:
            hold.from_s[kind] = t
        hold.value[kind] = value
