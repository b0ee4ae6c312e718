"""What the designer believes of the aircraft: at this instant, and in the mean over the frame that elapsed.

The order is JSBSim's: after `run()` number k the rates x[k] and the accelerations a[k] = F(x[k], u[k]) are
there, u[k] being the command written before that run; the next run moves the rates by dt a[k]. With n JSBSim
frames in one of ours the rates move by dt/n a[k], and then by the accelerations on the way, already under
u[k+1]: the truth is a left sum over n instants, the first under the old command, and so are these means.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.actuators import actuators_dtype, move
from beaver_ftc.design.model import design_dtype
from beaver_ftc.design.variants import response
from beaver_ftc.diagnosis.derived import changing_error, derived_bound, slack_per_rad
from beaver_ftc.diagnosis.error_map import add_model_error
from beaver_ftc.diagnosis.thresholds import uncertainty_bound


@lru_cache
def sums_dtype(n: int) -> np.dtype:
    """Sums over the instants of a frame, n surfaces: f, G, G u and the bound; own errors as in state.py."""
    fields = [
        ("f", "f8", (3,)), ("G", "f8", (3, n)), ("Gu", "f8", (3, n)), ("eta_bar", "f8", (3,)),
        ("own_per_rad", "f8", (3, n)), ("own", "f8", (3, n)),
        ("Gu_first", "f8", (3, n)),  # of the first instant alone
        ("G_least", "f8", (n,)), ("G_most", "f8", (n,)),  # on each surface's dominant axis
        ("u_least", "f8", (n,)), ("u_most", "f8", (n,)),  # rad
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def means_dtype(n: int) -> np.dtype:
    """Means over the elapsed frame. acceleration: f + G u; Gu_spread: see `spread`. Within it, where faults
    of every type are in question: G_least, G_most on each surface's dominant axis, and u_least, u_most, where
    a healthy one was."""
    fields = [
        ("G", "f8", (3, n)), ("Gu", "f8", (3, n)), ("Gu_spread", "f8", (3, n)), ("acceleration", "f8", (3,)),
        ("G_least", "f8", (n,)), ("G_most", "f8", (n,)), ("u_least", "f8", (n,)), ("u_most", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def belief_dtype(n: int) -> np.dtype:
    """The belief about an aircraft with n surfaces; rad, rad/s, rad/s2."""
    fields = [
        ("design", design_dtype(n)), ("actuators", actuators_dtype(n)),
        ("share", "f8"),  # one over the instants in a frame
        ("commanded", "f8", (n,)),
        ("u", "f8", (n,)), ("u_then", "f8", (n,)),  # where healthy surfaces are under it, and where they were
        ("f", "f8", (3,)), ("G", "f8", (3, n)),  # at this instant
        ("x_then", "f8", (3,)),  # measured as the elapsed frame began
        ("sums", sums_dtype(n)), ("means", means_dtype(n)),
        ("expected", "f8", (3,)),  # mean acceleration with the known faults in it
        ("surprise", "f8", (3,)),  # what the rates did beyond it
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@kernel
def respond(belief, measured):
    """Fill f (3,) and G (3, n) with what the design model makes of this instant."""
    response(belief.design, measured.x, measured.y, belief.f, belief.G)


@kernel
def bound_now(fdi, belief, measured):
    """Fill fdi.bound.eta_bar_now (3,) rad/s2, the bound on the uncertainty at this instant."""
    x = measured.x
    fdi.bound.eta_bar_now[:] = 0.0
    if fdi.bound.admitted.any:
        derived_bound(fdi.bound.admitted, belief.design, x, measured.y, belief.u, fdi.bound.eta_bar_now)
        if fdi.bound.own_errors:
            for s in range(belief.u.size):
                slack_per_rad(fdi.bound.admitted, belief.design, s)
        x = fdi.bound.admitted.far_x
    if fdi.bound.error_map.n_boxes > 0:
        add_model_error(fdi.bound.error_map, measured.x, measured.y, belief.u, fdi.bound.eta_bar_now)
    uncertainty_bound(
        x, belief.design, fdi.bound.inertia, fdi.bound.constant, fdi.bound.earth_rate, fdi.bound.eta_bar_now
    )


@kernel
def sum_up(fdi, belief):
    """Add what the design model makes of this instant to the sums over the frame."""
    total, G, u = belief.sums, belief.G, belief.u
    for i in range(3):
        total.f[i] += belief.f[i]
        total.eta_bar[i] += fdi.bound.eta_bar_now[i]
        for s in range(u.size):
            total.G[i, s] += G[i, s]
            total.Gu[i, s] += G[i, s] * u[s]
    if fdi.config.every_type:
        note_extremes(fdi.layout.dominant_axis, G, u, total)
    if fdi.bound.own_errors:
        sum_up_own_errors(fdi.bound.admitted.per_rad, u, total)


@kernel
def note_extremes(dominant_axis, G, u, total):
    """Keep the least and greatest effectiveness and deflection within the frame."""
    for s in range(dominant_axis.size):
        now = G[dominant_axis[s], s]
        total.G_least[s], total.G_most[s] = min(total.G_least[s], now), max(total.G_most[s], now)
        total.u_least[s], total.u_most[s] = min(total.u_least[s], u[s]), max(total.u_most[s], u[s])


@kernel
def sum_up_own_errors(per_rad, u, total):
    """Add what the declared errors do to the surfaces' own terms now, per rad and at the command."""
    for i in range(3):
        for s in range(u.size):
            total.own_per_rad[i, s] += per_rad[i, s]
            total.own[i, s] += per_rad[i, s] * abs(u[s])


@kernel
def elapse(fdi, belief):
    """Means over the frame that has elapsed: G, the moment of each surface, f + G u, and the bound."""
    share, total, mean = belief.share, belief.sums, belief.means
    for i in range(3):
        rate = share * total.f[i]
        for s in range(belief.u.size):
            mean.G[i, s] = share * total.G[i, s]
            mean.Gu[i, s] = share * total.Gu[i, s]
            rate += mean.Gu[i, s]
        mean.acceleration[i] = rate
        fdi.bound.eta_bar[i] = share * total.eta_bar[i]
    mean.G_least[:], mean.G_most[:] = total.G_least, total.G_most
    mean.u_least[:], mean.u_most[:] = total.u_least, total.u_most
    if fdi.bound.own_errors:
        fdi.bound.own_per_rad[:] = share * total.own_per_rad
        fdi.bound.own[:] = share * total.own
    if share < 1.0:
        spread(belief)


@kernel
def spread(belief):
    """Fill Gu_spread (3, n) rad/s2: by how much the mean over the frame can mislead about a fault that
    changed in it.

    A fault grows, begins or ends from one frame to the next, so the first JSBSim frame and the others may
    differ in it. With z0 and z the moments of a surface in the first and the others, the mean effect lies
    no further outside the extremes for the mean moment than |z0 - z| / n.
    """
    share, total = belief.share, belief.sums
    for i in range(3):
        for s in range(belief.u.size):
            first = total.Gu_first[i, s]
            others = (total.Gu[i, s] - first) * share / (1.0 - share)
            belief.means.Gu_spread[i, s] = share * abs(first - others)


@kernel
def look_back(fdi, belief, measured, k):
    """What the design model makes of the frame that has elapsed: its bound and its means; k: its number."""
    fdi.bound.error_map.time_s = k * fdi.config.dt
    bound_now(fdi, belief, measured)
    fdi.bound.eta_bar[:] = fdi.bound.eta_bar_now
    if fdi.bound.admitted.any:
        for i in range(3):
            fdi.bound.noise[i] = changing_error(fdi.bound.admitted, i, measured.x[i])
    if k > 0:
        elapse(fdi, belief)


@kernel
def begin_frame(fdi, belief, measured):
    """Begin the next frame's sums with this instant, the command in effect still the old one."""
    belief.x_then[:] = measured.x
    fdi.bound.noise_then[:] = fdi.bound.noise
    total = belief.sums
    total.f[:], total.eta_bar[:] = 0.0, 0.0
    total.G[:], total.Gu[:] = 0.0, 0.0
    total.G_least[:], total.G_most[:] = np.inf, -np.inf
    total.u_least[:], total.u_most[:] = np.inf, -np.inf
    if fdi.bound.own_errors:
        total.own_per_rad[:], total.own[:] = 0.0, 0.0
    sum_up(fdi, belief)
    total.Gu_first[:] = total.Gu


@kernel
def look(fdi, belief, measured):
    """Take an instant inside the frame into the means over it; the surfaces move on."""
    bound_now(fdi, belief, measured)
    sum_up(fdi, belief)
    move(belief.actuators, belief.commanded, belief.u)


@kernel
def follow_command(belief, command):
    """Move the healthy surfaces by one JSBSim frame towards the new command (n,) rad."""
    for s in range(command.size):
        belief.commanded[s] = command[s]
    belief.u_then[:] = belief.u
    move(belief.actuators, belief.commanded, belief.u)
