"""What the designer believes of the aircraft: at this instant, and in the mean over the frame that elapsed.

The order is JSBSim's: after `run()` number k the rates x[k] and the accelerations a[k] = F(x[k], u[k]) are
there, u[k] being the command written before that run; the next run moves the rates by dt a[k]. With n JSBSim
frames in one of ours the rates move by dt/n a[k], and then by the accelerations on the way, already under
u[k+1]: the truth is a left sum over n instants, the first under the old command, and so are these means.
"""

from math import exp, radians

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.actuators import actuators_dtype, move
from beaver_ftc.design.model import design_dtype
from beaver_ftc.design.variants import design_of, response
from beaver_ftc.diagnosis.bounds.worst_case import beyond, bound_now, changing_error
from beaver_ftc.scenario.schema import Scenario


@sized
def sums_dtype(n: int) -> np.dtype:
    """Sums over the instants of a frame, n surfaces: f, G, G u and the bound; own errors as in state.py."""
    return record(
        f=3, G=(3, n), Gu=(3, n), eta_bar=3, own_per_rad=(3, n), own=(3, n),
        Gu_first=(3, n),  # of the first instant alone
        G_least=n, G_most=n,  # on each surface's dominant axis
        u_least=n, u_most=n,  # rad
    )  # fmt: skip


@sized
def means_dtype(n: int) -> np.dtype:
    """Means over the elapsed frame. acceleration: f + G u; Gu_spread: see `spread`. G_foreseen, Gu_foreseen:
    with G of the frame before, of which the readings of this one know nothing: a law answers what they are
    off by, and chance would take its answer for the work of a broken surface. Within it, where faults
    of every type are in question: G_least, G_most on each surface's dominant axis, and u_least, u_most, where
    a healthy one was."""
    return record(
        G=(3, n), Gu=(3, n), Gu_spread=(3, n), acceleration=3, G_foreseen=(3, n), Gu_foreseen=(3, n),
        G_least=n, G_most=n, u_least=n, u_most=n,
    )  # fmt: skip


@sized
def belief_dtype(n: int) -> np.dtype:
    """The belief about an aircraft with n surfaces; rad, rad/s, rad/s2."""
    return record(
        design=design_dtype(n), actuators=actuators_dtype(n),
        share=float,  # one over the instants in a frame
        commanded=n,
        u=n, u_then=n,  # where healthy surfaces are under it, and where they were
        f=3, G=(3, n),  # at this instant
        x_then=3,  # measured as the elapsed frame began
        sums=sums_dtype(n), means=means_dtype(n),
        expected=3,  # mean acceleration with the known faults in it
        innovation_after_known_faults=3,  # what the rates did beyond it
    )  # fmt: skip


def configure(belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill in the design model and the declared actuators; travel (2, n) rad."""
    belief["share"] = 1.0 / scenario.substeps
    belief["design"] = design_of(scenario.design_model, scenario.airframe)[0]
    actuators, dt = belief["actuators"], 1.0 / scenario.rate_hz / scenario.substeps
    actuators["real"] = not scenario.actuators.is_ideal
    actuators["low"], actuators["high"] = travel
    for s, surface in enumerate(scenario.airframe.surfaces):
        dynamics = getattr(scenario.actuators, surface)
        bandwidth, rate = dynamics.bandwidth_rad_s, radians(dynamics.rate_limit_deg_s)
        actuators["approach"][s] = 1.0 - exp(-bandwidth * dt) if bandwidth else 1.0
        actuators["step"][s] = rate * dt if rate else np.inf


@kernel
def respond(belief, measured):
    """Fill f (3,) and G (3, n) with what the design model makes of this instant."""
    response(belief.design, measured.x, measured.y, belief.f, belief.G)


@kernel
def sum_up(belief, bound, layout, every_type):
    """Add what the design model makes of this instant to the sums over the frame, with extremes where faults
    of every type are in question."""
    total, G, u = belief.sums, belief.G, belief.u
    for i in range(3):
        total.f[i] += belief.f[i]
        total.eta_bar[i] += bound.eta_bar_now[i]
        for s in range(u.size):
            total.G[i, s] += G[i, s]
            total.Gu[i, s] += G[i, s] * u[s]
            if bound.own_errors:  # per rad and at the command
                total.own_per_rad[i, s] += bound.admitted.per_rad[i, s]
                total.own[i, s] += bound.admitted.per_rad[i, s] * abs(u[s])
    if bound.error_map.anywhere:
        for j in range(bound.error_map.n_levels):
            for i in range(3):
                bound.beyond[j, i] += belief.share * beyond(bound.error_map, j, i)
    if every_type:
        for s, axis in enumerate(layout.dominant_axis):
            now = G[axis, s]
            total.G_least[s], total.G_most[s] = min(total.G_least[s], now), max(total.G_most[s], now)
            total.u_least[s], total.u_most[s] = min(total.u_least[s], u[s]), max(total.u_most[s], u[s])


@kernel
def elapse(belief, bound):
    """Means over the frame that has elapsed: G, the moment of each surface, f + G u, and the bound."""
    share, total, mean = belief.share, belief.sums, belief.means
    for i in range(3):
        rate = share * total.f[i]
        for s in range(belief.u.size):
            mean.G_foreseen[i, s] = mean.G[i, s]
            mean.G[i, s] = share * total.G[i, s]
            mean.Gu[i, s] = share * total.Gu[i, s]
            rate += mean.Gu[i, s]
        mean.acceleration[i] = rate
        bound.eta_bar[i] = share * total.eta_bar[i]
    mean.G_least[:], mean.G_most[:] = total.G_least, total.G_most
    mean.u_least[:], mean.u_most[:] = total.u_least, total.u_most
    if bound.own_errors:
        bound.own_per_rad[:] = share * total.own_per_rad
        bound.own[:] = share * total.own
    if share < 1.0:
        spread(belief)


@kernel
def foresee(mean):
    """Fill Gu_foreseen (3, n) rad/s2, for those who ask."""
    for i in range(3):
        for s in range(mean.G_least.size):
            moved = mean.G_foreseen[i, s] / mean.G[i, s] if mean.G[i, s] != 0.0 else 0.0
            mean.Gu_foreseen[i, s] = moved * mean.Gu[i, s]


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
def look_back(belief, bound, measured, k, dt):
    """What the design model makes of the frame that has elapsed, of dt s: its bound and its means; k: its
    number."""
    bound.error_map.time_s = k * dt
    bound_now(bound, belief.design, measured, belief.u)
    bound.eta_bar[:] = bound.eta_bar_now
    if bound.admitted.any:
        for i in range(3):
            bound.noise[i] = changing_error(bound.admitted, i, measured.x[i])
    if k > 0:
        elapse(belief, bound)


@kernel
def begin_frame(belief, bound, layout, every_type, measured):
    """Begin the next frame's sums with this instant, the command in effect still the old one."""
    belief.x_then[:] = measured.x
    bound.noise_then[:] = bound.noise
    total = belief.sums
    total.f[:], total.eta_bar[:] = 0.0, 0.0
    total.G[:], total.Gu[:] = 0.0, 0.0
    total.G_least[:], total.G_most[:] = np.inf, -np.inf
    total.u_least[:], total.u_most[:] = np.inf, -np.inf
    if bound.own_errors:
        total.own_per_rad[:], total.own[:] = 0.0, 0.0
    bound.beyond[:] = 0.0
    sum_up(belief, bound, layout, every_type)
    total.Gu_first[:] = total.Gu


@kernel
def look(belief, bound, layout, every_type, measured):
    """Take an instant inside the frame into the means over it; the surfaces move on."""
    bound_now(bound, belief.design, measured, belief.u)
    sum_up(belief, bound, layout, every_type)
    move(belief.actuators, belief.commanded, belief.u)


@kernel
def expect(belief, known, effectiveness, offset, offsets_count):
    """Fill expected (3,) rad/s2: f + G u, mean over the elapsed frame, with the faults that are `known`.

    effectiveness (n,): of each surface; offset (n,) rad: its bias, where offsets_count.
    """
    expected, mean = belief.expected, belief.means
    expected[:] = mean.acceleration
    if not known:
        return
    for s in range(effectiveness.size):
        lost = 1.0 - effectiveness[s]
        for i in range(3):
            expected[i] -= lost * mean.Gu[i, s]
    if offsets_count:
        for s in range(offset.size):
            for i in range(3):
                expected[i] += mean.G[i, s] * offset[s]


@kernel
def form_innovation(belief, x, dt):
    """Fill innovation_after_known_faults (3,) rad/s2 of the elapsed frame, of dt s; x (3,) rad/s now."""
    for i in range(3):
        belief.innovation_after_known_faults[i] = (x[i] - belief.x_then[i]) / dt - belief.expected[i]


@kernel
def follow_command(belief, command):
    """Move the healthy surfaces by one JSBSim frame towards the new command (n,) rad."""
    for s in range(command.size):
        belief.commanded[s] = command[s]
    belief.u_then[:] = belief.u
    move(belief.actuators, belief.commanded, belief.u)
