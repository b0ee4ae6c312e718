"""The actuators as the designer has them: a first-order lag, a rate limit and stops.

    u[k+1] = u[k] + limited((command - u[k]) (1 - exp(-bandwidth dt))),   |limited| <= rate dt

the discretisation of aircraft/actuator.xml, one step a JSBSim frame, so that a healthy surface is where the
model has it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized


@sized
def actuators_dtype(n: int) -> np.dtype:
    """The actuators of n surfaces."""
    return record(
        real=int,
        approach=n,  # share of the way to the command in one JSBSim frame; 1 without lag
        step=n,  # rad, the farthest in one JSBSim frame
        low=n, high=n,
        # least and greatest approach and step by the declared errors; band rad: how far from its command a
        # surface may stay
        uncertain=int, approaches=(n, 2), steps=(n, 2), band=n,
    )  # fmt: skip


@kernel
def nearer(u, wanted, approach, step):
    """Where a surface at u (rad) is one JSBSim frame later; it rises with u, and never passes `wanted`."""
    return u + min(max((wanted - u) * approach, -step), step)


@kernel
def farthest(u, command, sign, approaches, steps, band, low, high):
    """The greatest (sign 1) or least (-1) position, rad, that a surface at u can have one JSBSim frame later.

    approaches, steps (2,): least and greatest of its actuator. It goes as far as it can to that side, and
    comes back from it as slowly as it can.
    """
    wanted = min(max(command + sign * band, low), high)
    fast = 1 if sign * (wanted - u) > 0.0 else 0
    return nearer(u, wanted, approaches[fast], steps[fast])


@kernel
def move(actuators, command, u):
    """Move the surfaces u (n,) rad by one JSBSim frame towards command (n,) rad."""
    if not actuators.real:
        u[:] = command
        return
    for s in range(u.size):
        wanted = min(max(command[s], actuators.low[s]), actuators.high[s])
        there = nearer(u[s], wanted, actuators.approach[s], actuators.step[s])
        u[s] = min(max(there, actuators.low[s]), actuators.high[s])


@kernel
def move_ends(act, command, lo, hi):
    """Move lo and hi (n,) rad, between which the surfaces are, by one JSBSim frame towards command (n,)."""
    for s in range(lo.size):
        of = act.approaches[s], act.steps[s], act.band[s], act.low[s], act.high[s]
        lo[s] = farthest(lo[s], command[s], -1.0, *of)
        hi[s] = farthest(hi[s], command[s], 1.0, *of)
