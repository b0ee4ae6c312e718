"""The rivals that fly compiled, so that a comparison is of laws: lqr.py and indi.py have their equations.

The surfaces that lead roll, pitch and yaw move; the others stay in trim.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.control import CompiledLaw
from beaver_ftc.control.allocation import set_demand, take_command

# Filled by `compile_into` of the rival's class. incremental: whether it is incremental inversion, else the
# regulator. The regulator: gains on error and integral, the linear model, its inverse, the trim. Incremental
# inversion: gains, and what its filter keeps from frame to frame.
CONFIG = record(
    incremental=int, K=(3, 6), A=(3, 3), B_inverse=(3, 3), trim_x=3, Kp=float, Ki=float, keep=float
)
# Of incremental inversion: the rates of the frame before, and the filters of the measured acceleration and of
# the surfaces' share of it. inherited (3,) rad/s2: what the law before attributed to no model.
MEMORY = record(
    integral=3, saturated=int, begun=int, x_before=3, rate_filter=(2, 3), surface_filter=(2, 3), inherited=3
)


@sized
def rival_dtype(n: int) -> np.dtype:
    """The rivals' records; they do not depend on the number of surfaces n."""
    return record(config=CONFIG, memory=MEMORY)


@apart
def command(control, assessment, faults, prediction, measured, mode, t):
    """From what is measured to the command of each surface (control.CompiledLaw)."""
    law, reference, layout, x = control.compiled_rivals, control.reference, control.layout, measured.x
    memory, allocated = law.memory, control.allocation.output
    u = allocated.command
    u[:] = layout.trim
    if law.config.incremental:
        increment(law, reference, layout.main, prediction, x, control.axes, u)
    else:
        regulate(law, reference, layout.main, x, u)
    take_command(allocated, layout, u)
    memory.saturated = 0
    for s in range(u.size):
        memory.saturated += allocated.saturated[s]


@kernel
def missed(memory, reference, i, x):
    """Tracking error of axis i, rad/s. Its integral is held while a surface is at its stop."""
    error = reference.output.model_rate[i] - x[i]
    if not memory.saturated:
        memory.integral[i] += reference.config.dt * error
    return error


@kernel
def regulate(law, reference, main, x, u):
    """Add to the command u (n,) rad, in trim, what the linear model asks for to follow the reference, and K
    times what is missing."""
    config, memory, target = law.config, law.memory, reference.output
    for i in range(3):
        error = missed(memory, reference, i, x)
        needed = target.model_acceleration[i]
        for j in range(3):
            needed -= config.A[i, j] * (target.model_rate[j] - config.trim_x[j])
        for s in range(3):
            back = config.K[s, i] * error + config.K[s, 3 + i] * memory.integral[i]
            u[main[s]] += config.B_inverse[s, i] * needed + back


@kernel
def increment(law, reference, main, prediction, x, axes, u):
    """G^-1 (nu - xdot0 + G u0), into the command u (n,) rad; the demand of the axes: nu - xdot0."""
    config, memory = law.config, law.memory
    for i in range(3):
        error = missed(memory, reference, i, x)
        xdot0, given = memory.rate_filter[1, i], memory.surface_filter[1, i]
        if memory.begun:
            change = (x[i] - memory.x_before[i]) / reference.config.dt
            xdot0 = smooth(memory.rate_filter, i, change, config.keep)
            moved = 0.0  # acceleration by the positions of these surfaces over the elapsed frame
            for s in main:
                moved += prediction.means.Gu[i, s]
            given = smooth(memory.surface_filter, i, moved, config.keep)
        nu = reference.output.model_acceleration[i] + config.Kp * error + config.Ki * memory.integral[i]
        set_demand(axes, i, nu - xdot0 + given, 0.0, 0.0)
    solve(prediction.G, main, axes.demand, u)
    for i in range(3):
        set_demand(axes, i, axes.demand[i] - memory.surface_filter[1, i], 0.0, 0.0)
    memory.begun, memory.x_before[:] = 1, x


@kernel
def smooth(filtered, i, value, keep):
    """Two equal filters in series, each holds its input over the frame; filtered (2, 3), in place."""
    filtered[0, i] = keep * filtered[0, i] + (1.0 - keep) * value
    filtered[1, i] = keep * filtered[1, i] + (1.0 - keep) * filtered[0, i]
    return filtered[1, i]


@kernel
def cross(G, i, j, k):
    """Component k of column i x column j of G (3, n)."""
    a, b = (k + 1) % 3, (k + 2) % 3
    return G[a, i] * G[b, j] - G[b, i] * G[a, j]


@kernel
def solve(G, main, demand, out):
    """Put into out the deflections of the surfaces main (3,) that give demand (3,), by Cramer's rule."""
    determinant = 0.0
    for k in range(3):
        determinant += G[k, main[0]] * cross(G, main[1], main[2], k)
    for s in range(3):
        total = 0.0
        for k in range(3):
            total += demand[k] * cross(G, main[(s + 1) % 3], main[(s + 2) % 3], k)
        out[main[s]] = total / determinant


def unexplained(control: np.void) -> np.ndarray:
    """What the law attributes to no model, (3,) rad/s2: the rivals estimate nothing, and hand on what the law
    before them had found (control.CompiledLaw)."""
    inherited: np.ndarray = control["compiled_rivals"]["memory"]["inherited"].copy()
    return inherited


def begin(control: np.void, before: np.void, unexplained: np.ndarray, learnt: np.ndarray) -> None:
    """Take over in flight (control.CompiledLaw)."""
    control["compiled_rivals"]["memory"]["inherited"] = unexplained


LAW = CompiledLaw(rival_dtype, command, unexplained=unexplained, begin=begin)
