"""The actuators that the designer assumes: a first-order lag, a rate limit and stops.

    u[k+1] = u[k] + limited((command - u[k]) (1 - exp(-bandwidth dt))),   |limited| <= rate dt

This is the discretisation of aircraft/actuator.xml, one step a JSBSim frame, so that a healthy surface whose
actuator is the declared one is exactly where the model predicts it. u; command, within the stops: rad.
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel, record, sized


@sized
def actuators_dtype(n: int) -> np.dtype:
    """The actuators of n surfaces."""
    return record(
        real=int,  # whether an actuator has a lag or a rate limit; else u is the command
        approach=n,  # 1 - exp(-bandwidth dt): share of the way to the command in one JSBSim frame
        step=n,  # rad, largest motion in one JSBSim frame
        low=n, high=n,  # rad, stops
        # uncertain: whether errors of the actuators are declared; least and greatest approach and step with
        # them; band rad: distance from its command at which a surface may stay
        uncertain=int, approaches=(n, 2), steps=(n, 2), band=n,
    )  # fmt: skip


@kernel
def nearer(u, target, approach, step):
    """Where a surface at u rad is one JSBSim frame later, rad. It rises with u and never passes `target`, so
    that the ends of an interval of u can be moved one by one."""
    return u + min(max((target - u) * approach, -step), step)


@kernel
def farthest(u, command, sign, approaches, steps, band, low, high):
    """The greatest (sign 1) or least (-1) position, rad, that a surface at u can have one JSBSim frame later.

    approaches, steps (2,): least and greatest of its actuator. Towards that side the surface moves as fast as
    it can, away from it as slowly as it can. Its target is `band` beyond the command on that side, within the
    stops.
    """
    target = min(max(command + sign * band, low), high)
    fast = 1 if sign * (target - u) > 0.0 else 0
    return nearer(u, target, approaches[fast], steps[fast])


@kernel
def move(actuators, command, u):
    """Move the surfaces u (n,) rad by one JSBSim frame towards command (n,) rad."""
    if not actuators.real:
        copy(command, u)
        return
    for s in range(u.size):
        target = min(max(command[s], actuators.low[s]), actuators.high[s])
        reached = nearer(u[s], target, actuators.approach[s], actuators.step[s])
        u[s] = min(max(reached, actuators.low[s]), actuators.high[s])


@kernel
def move_ends(act, command, lo, hi):
    """Move lo and hi (n,) rad, between which the surfaces are, by one JSBSim frame towards command (n,)."""
    for s in range(lo.size):
        actuator = act.approaches[s], act.steps[s], act.band[s], act.low[s], act.high[s]
        lo[s] = farthest(lo[s], command[s], -1.0, *actuator)
        hi[s] = farthest(hi[s], command[s], 1.0, *actuator)
