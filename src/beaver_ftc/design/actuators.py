"""What the diagnosis believes of the actuators: the aircraft's own first-order lag, rate limit and stops.

    u[k+1] = u[k] + limited((command - u[k]) (1 - exp(-bandwidth dt))),   |limited| <= rate dt

the discretisation of aircraft/actuator.xml, one step a JSBSim frame, so that a healthy surface is where
the model has it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized


@sized
def actuators_dtype(n: int) -> np.dtype:
    """The actuators of n surfaces."""
    return record(
        real=int,
        approach=n,  # share of the way to the command in one JSBSim frame; 1 without lag
        step=n,  # rad, the furthest in one JSBSim frame
        low=n, high=n,
    )  # fmt: skip


@kernel
def nearer(u, wanted, approach, step):
    """Where a surface at u (rad) is one JSBSim frame later; it rises with u, and never passes `wanted`."""
    return u + min(max((wanted - u) * approach, -step), step)


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
