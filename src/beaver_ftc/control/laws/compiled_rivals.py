"""The kernels of the rivals lqr.py and indi.py, which have the equations; their classes fly by these too.

The surfaces that lead roll, pitch and yaw move; the others stay in trim.
"""

import numpy as np

from beaver_ftc.compiled import apart, copy, kernel, record, sized
from beaver_ftc.control import CompiledLaw
from beaver_ftc.control.allocation import take_command

# Filled by `compile_into` of the rival's class. incremental: whether it is incremental inversion, else the
# regulator. The regulator: gains K, rad per rad/s and rad per rad, on error and integral; the linear model A,
# 1/s, and inverse of B, rad per rad/s2; the trim, rad/s. Incremental inversion: gains Kp 1/s, Ki 1/s2, and
# the share that its filter keeps from frame to frame.
CONFIG = record(
    incremental=int, K=(3, 6), A=(3, 3), B_inverse=(3, 3), trim_x=3, Kp=float, Ki=float, keep=float
)
# integral (3,) rad: of the tracking error. saturated: number of surfaces whose command a stop cuts off.
# begun: whether there is a frame before. Incremental inversion has x_before (3,) rad/s, the rates of that
# frame, and the filters of the measured acceleration and of the surfaces' share of it, rad/s2. inherited (3,)
# rad/s2: what the law before attributed to no model.
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
    law = control.compiled_rivals
    reference = control.reference
    layout = control.layout
    allocated = control.allocation.output
    target = reference.output
    u = allocated.command
    copy(layout.trim, u)
    add_command(
        law, reference.config.dt, target.model_rate, target.model_acceleration, layout.main, measured.x,
        prediction.means.Gu, prediction.G, control.axes.demand, u,
    )  # fmt: skip
    take_command(allocated, layout, u)
    law.memory.saturated = allocated.saturated.sum()


@kernel
def add_command(law, dt, rate, acceleration, main, x, Gu, G, demand, u):
    """Add to u (n,) rad, in trim, what the law commands of the surfaces main (3,) that lead the axes.

    dt s: a frame; rate (3,) rad/s, acceleration (3,) rad/s2: xm and xm'; x (3,) rad/s: measured; Gu (3, n)
    rad/s2: effect of each surface over the elapsed frame; G (3, n) rad/s2 per rad. Incremental inversion
    fills demand (3,) rad/s2.
    """
    if law.config.incremental:
        increment(law, dt, rate, acceleration, main, x, Gu, G, demand, u)
    else:
        regulate(law, dt, rate, acceleration, main, x, u)


@kernel
def integrate_error(memory, dt, i, e):
    """Integrate the tracking error e of axis i, rad/s, unless a surface is at its stop; returns the integral,
    rad."""
    if not memory.saturated:
        memory.integral[i] += dt * e
    return memory.integral[i]


@kernel
def regulate(law, dt, rate, acceleration, main, x, u):
    """The regulator, for the leading surfaces of u (n,) rad:

    u <- u + B^-1 (xm' - A (xm - x_trim)) + K (e, int e),    e = xm - x, rad/s
    """
    config = law.config
    for i in range(3):
        e = rate[i] - x[i]
        integral = integrate_error(law.memory, dt, i, e)
        needed = acceleration[i]
        for j in range(3):
            needed -= config.A[i, j] * (rate[j] - config.trim_x[j])
        for s in range(3):
            feedback = config.K[s, i] * e + config.K[s, 3 + i] * integral
            u[main[s]] += config.B_inverse[s, i] * needed + feedback


@kernel
def increment(law, dt, rate, acceleration, main, x, Gu, G, demand, u):
    """Incremental inversion, for the leading surfaces of u (n,) rad; fills demand = nu - xdot0, rad/s2:

        u <- G^-1 (nu - xdot0 + G u0),    nu = xm' + Kp e + Ki int e,    e = xm - x

    xdot0: measured acceleration; G u0: acceleration by the positions of these surfaces over the elapsed
    frame. Both pass the same filter. In the first frame, both have their initial values.
    """
    config = law.config
    memory = law.memory
    for i in range(3):
        e = rate[i] - x[i]
        integral = integrate_error(memory, dt, i, e)
        xdot0 = memory.rate_filter[1, i]
        G_u0 = memory.surface_filter[1, i]
        if memory.begun:
            xdot0 = smooth(memory.rate_filter, i, (x[i] - memory.x_before[i]) / dt, config.keep)
            by_surfaces = 0.0
            for s in main:
                by_surfaces += Gu[i, s]
            G_u0 = smooth(memory.surface_filter, i, by_surfaces, config.keep)
        demand[i] = acceleration[i] + config.Kp * e + config.Ki * integral - xdot0 + G_u0
    solve(G, main, demand, u)
    for i in range(3):
        demand[i] -= memory.surface_filter[1, i]
    memory.begun = 1
    copy(x, memory.x_before)


@kernel
def smooth(filtered, i, value, keep):
    """Pass a value of axis i through two equal filters in series, y <- keep y + (1 - keep) input; filtered
    (2, 3): their outputs, in place. Returns the output of the second."""
    filtered[0, i] = keep * filtered[0, i] + (1.0 - keep) * value
    filtered[1, i] = keep * filtered[1, i] + (1.0 - keep) * filtered[0, i]
    return filtered[1, i]


@kernel
def cross(G, i, j, k):
    """Component k of column i x column j of G (3, n)."""
    a = (k + 1) % 3
    b = (k + 2) % 3
    return G[a, i] * G[b, j] - G[b, i] * G[a, j]


@kernel
def solve(G, main, demand, out):
    """Put into out the deflections of the surfaces main (3,) that give demand (3,), by Cramer's rule:

        u_s = demand . (G_s+1 x G_s+2) / (G_0 . (G_1 x G_2))

    G_s: column of G (3, n) rad/s2 per rad of surface main[s], s modulo 3.
    """
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
    return np.array(control["compiled_rivals"]["memory"]["inherited"])


def begin(control: np.void, before: np.void, unexplained: np.ndarray, learnt: np.ndarray) -> None:
    """Take over in flight (control.CompiledLaw)."""
    control["compiled_rivals"]["memory"]["inherited"] = unexplained


LAW = CompiledLaw(rival_dtype, command, unexplained=unexplained, begin=begin)
