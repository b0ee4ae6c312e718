"""The rivals that fly compiled, so that a comparison is of laws: lqr.py and indi.py have their equations.

The surfaces that lead roll, pitch and yaw move; the others stay in trim.
"""

from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.allocation import clip
from beaver_ftc.control.laws import LQR
from beaver_ftc.control.rivals.tracking import DELAY_FRAMES

# What a rival keeps that flies compiled: its gains, and its memory of the flight.
RIVAL = record(
    Kp=float, Ki=float, integral=3, saturated=int, begun=int,
    # the regulator: gains on error and integral, the linear model, its inverse, the trim
    K=(3, 6), A=(3, 3), B_inverse=(3, 3), trim_x=3,
    # incremental inversion: the filter's pole, rates and commands of before, and both filters
    keep=float, x_before=3, given=(DELAY_FRAMES, 3), rate_filter=(2, 3), command_filter=(2, 3),
)  # fmt: skip


@kernel
def command(inner, rival, reference, axes, allocation, layout, G, x):
    """Fill the command (n,) rad by the rival `inner`; G (3, n) rad/s2 per rad, x (3,) rad/s."""
    main, out = layout.main, allocation.command
    out[:] = layout.trim
    if inner == LQR:
        regulate(rival, reference, main, x, out)
    else:
        increment(rival, reference, axes.demand, main, G, x, out)
    rival.saturated = 0
    for s in range(out.size):
        out[s] = clip(allocation, layout, s, out[s])
        rival.saturated += allocation.saturated[s]
    if inner != LQR:
        remember(rival, out, main, x)


@kernel
def missed(rival, reference, i, x):
    """Error of axis i, rad/s; its integral stands still while a surface is at its stop."""
    error = reference.model_rate[i] - x[i]
    if not rival.saturated:
        rival.integral[i] += reference.dt * error
    return error


@kernel
def regulate(rival, reference, main, x, out):
    """Add to out, in trim, what the linear model asks for to follow the reference, and K times what is
    missing."""
    for i in range(3):
        error = missed(rival, reference, i, x)
        needed = reference.model_acceleration[i]
        for j in range(3):
            needed -= rival.A[i, j] * (reference.model_rate[j] - rival.trim_x[j])
        for s in range(3):
            back = rival.K[s, i] * error + rival.K[s, 3 + i] * rival.integral[i]
            out[main[s]] += rival.B_inverse[s, i] * needed + back


@kernel
def increment(rival, reference, demand, main, G, x, out):
    """u0 + G^-1 (nu - xdot0), into out; nu - xdot0 into demand (3,) rad/s2."""
    if not rival.begun:
        rival.begun, rival.x_before[:] = 1, x
    for i in range(3):
        error = missed(rival, reference, i, x)
        xdot0 = smooth(rival.rate_filter, i, (x[i] - rival.x_before[i]) / reference.dt, rival.keep)
        nu = reference.model_acceleration[i] + rival.Kp * error + rival.Ki * rival.integral[i]
        demand[i] = nu - xdot0
    solve(G, main, demand, out)
    for i in range(3):
        u0 = smooth(rival.command_filter, i, rival.given[0, i], rival.keep)
        out[main[i]] += u0


@kernel
def smooth(filtered, i, value, keep):
    """Two equal poles, exact for an input held over the frame; filtered (2, 3), in place."""
    filtered[0, i] = keep * filtered[0, i] + (1.0 - keep) * value
    filtered[1, i] = keep * filtered[1, i] + (1.0 - keep) * filtered[0, i]
    return filtered[1, i]


@kernel
def remember(rival, command, main, x):
    """Keep the rates and the last commands for the frames to come."""
    for i in range(3):
        for k in range(DELAY_FRAMES - 1):
            rival.given[k, i] = rival.given[k + 1, i]
        rival.given[DELAY_FRAMES - 1, i] = command[main[i]]
        rival.x_before[i] = x[i]


@kernel
def cross(G, i, j, k):
    """Cofactor sum of three columns of the leading rows: component k of column i x column j."""
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
