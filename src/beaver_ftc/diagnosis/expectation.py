"""The predicted acceleration f + G u of the designer's model: at this instant, and its mean over a frame.

    F = f(x, y) + G(x, y) u,    x rates (3,) rad/s, y measurements, u surfaces (n,) rad, F (3,) rad/s2

The order of evaluation is that of JSBSim. After `run()` number k the rates are x[k] and the accelerations
a[k] = F(x[k], u[k]), where u[k] is the command written before that run. The next run adds dt a[k] to the
rates. If a frame has n JSBSim steps (instants), the rates first change by dt/n a[k], under the old command,
and then by the accelerations of the other instants, under u[k+1]. The mean over a frame is therefore a left
sum over its n instants, the first of them under the old command.
"""

from math import exp, radians

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.model import actuators_dtype, design_dtype, design_of, move, response
from beaver_ftc.diagnosis.bounds import changing_gyro_error, fill_bound_now, further_map_error
from beaver_ftc.scenario.schema import Scenario


@sized
def sums_dtype(n: int) -> np.dtype:
    """Sums over the instants of a frame, n surfaces: f, G, G u and bounds; own errors as in bounds.py."""
    return record(
        f=3, G=(3, n), Gu=(3, n), eta_bar=3, surface_error_per_rad=(3, n), own=(3, n),
        Gu_first=(3, n),  # of the first instant alone
        G_least=n, G_most=n,  # on each surface's dominant axis
        u_least=n, u_most=n,  # rad
    )  # fmt: skip


@sized
def means_dtype(n: int) -> np.dtype:
    """Means over the elapsed frame, of an aircraft with n surfaces."""
    return record(
        G=(3, n), Gu=(3, n), Gu_spread=(3, n),  # rad/s2 per rad; rad/s2; see `fill_effect_spread`, rad/s2
        acceleration=3,  # f + G u, rad/s2
        # With G of the frame before. It does not depend on the measurement noise of this frame, to which the
        # control law reacts: with G of this frame that reaction would correlate with the noise.
        G_predicted=(3, n), Gu_predicted=(3, n),
        # If faults of every type are examined, extremes within the frame: of G on each surface's dominant
        # axis, and of the position of the healthy surface, rad.
        G_least=n, G_most=n, u_least=n, u_most=n,
    )  # fmt: skip


@sized
def belief_dtype(n: int) -> np.dtype:
    """The designer's model of an aircraft with n surfaces and its predictions; rad, rad/s, rad/s2."""
    return record(
        design=design_dtype(n), actuators=actuators_dtype(n),
        share=float,  # one over the number of instants in a frame
        commanded=n,
        u=n, u_before=n,  # positions of healthy surfaces under the command: now, and an instant before
        f=3, G=(3, n),  # at this instant
        x_before=3,  # rates measured at the start of the elapsed frame
        sums=sums_dtype(n), means=means_dtype(n),
        expected=3,  # mean acceleration of the elapsed frame, known faults included
        innovation_after_known_faults=3,  # measured minus expected mean acceleration
    )  # fmt: skip


def configure(belief: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Fill the design model and the declared actuators; travel (2, n) rad: the stops."""
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
def evaluate_design(belief, measured):
    """Fill f (3,) rad/s2 and G (3, n) rad/s2 per rad of the design model at this instant."""
    response(belief.design, measured.x, measured.y, belief.f, belief.G)


@kernel
def add_instant_to_sums(belief, bound, layout, every_type):
    """Add this instant to the sums over the frame and, for faults of `every_type`, to the extremes."""
    total, G, u = belief.sums, belief.G, belief.u
    for i in range(3):
        total.f[i] += belief.f[i]
        total.eta_bar[i] += bound.eta_bar_now[i]
        for s in range(u.size):
            total.G[i, s] += G[i, s]
            total.Gu[i, s] += G[i, s] * u[s]
            if bound.has_surface_errors:
                total.surface_error_per_rad[i, s] += bound.declared_errors.per_rad[i, s]
                total.own[i, s] += bound.declared_errors.per_rad[i, s] * abs(u[s])
    if bound.error_map.anywhere:
        for j in range(bound.error_map.n_levels):
            for i in range(3):
                bound.further_error[j, i] += belief.share * further_map_error(bound.error_map, j, i)
    if every_type:
        for s, axis in enumerate(layout.dominant_axis):
            now = G[axis, s]
            total.G_least[s], total.G_most[s] = min(total.G_least[s], now), max(total.G_most[s], now)
            total.u_least[s], total.u_most[s] = min(total.u_least[s], u[s]), max(total.u_most[s], u[s])


@kernel
def fill_frame_means(belief, bound):
    """Fill the means over the elapsed frame: G, the effect G u of each surface, f + G u, and the bound."""
    share, total, mean = belief.share, belief.sums, belief.means
    for i in range(3):
        rate = share * total.f[i]
        for s in range(belief.u.size):
            mean.G_predicted[i, s] = mean.G[i, s]
            mean.G[i, s] = share * total.G[i, s]
            mean.Gu[i, s] = share * total.Gu[i, s]
            rate += mean.Gu[i, s]
        mean.acceleration[i] = rate
        bound.eta_bar[i] = share * total.eta_bar[i]
    mean.G_least[:], mean.G_most[:] = total.G_least, total.G_most
    mean.u_least[:], mean.u_most[:] = total.u_least, total.u_most
    if bound.has_surface_errors:
        bound.surface_error_per_rad[:] = share * total.surface_error_per_rad
        bound.own[:] = share * total.own
    if share < 1.0:
        fill_effect_spread(belief)


@kernel
def predict_control_effect(mean):
    """Fill `Gu_predicted` (3, n) rad/s2: the effect of each surface with G of the frame before."""
    for i in range(3):
        for s in range(mean.G_least.size):
            moved = mean.G_predicted[i, s] / mean.G[i, s] if mean.G[i, s] != 0.0 else 0.0
            mean.Gu_predicted[i, s] = moved * mean.Gu[i, s]


@kernel
def fill_effect_spread(belief):
    """Fill `Gu_spread` (3, n) rad/s2: the error of the mean effect if a fault changes within the frame.

    A fault changes between frames, that is between the first JSBSim step of a frame and the others. z0 and z
    are the effects of a healthy surface in the first and in the other n - 1 steps. The mean effect of the
    fault then exceeds the extremes for the mean of z0 and z by at most |z0 - z| / n.
    """
    share, total = belief.share, belief.sums
    for i in range(3):
        for s in range(belief.u.size):
            first = total.Gu_first[i, s]
            others = (total.Gu[i, s] - first) * share / (1.0 - share)
            belief.means.Gu_spread[i, s] = share * abs(first - others)


@kernel
def evaluate_frame(belief, bound, measured, k, dt):
    """Fill the bound on the uncertainty at this instant, and the means over the elapsed frame, k, of dt s."""
    bound.error_map.time_s = k * dt
    fill_bound_now(bound, belief.design, measured, belief.u)
    bound.eta_bar[:] = bound.eta_bar_now
    if bound.declared_errors.any:
        for i in range(3):
            bound.noise[i] = changing_gyro_error(bound.declared_errors, i, measured.x[i])
    if k > 0:
        fill_frame_means(belief, bound)


@kernel
def begin_sums(belief, bound, layout, every_type, measured):
    """Start the next frame's sums with this instant, at which the old command is still in effect."""
    belief.x_before[:] = measured.x
    bound.noise_before[:] = bound.noise
    total = belief.sums
    total.f[:], total.eta_bar[:] = 0.0, 0.0
    total.G[:], total.Gu[:] = 0.0, 0.0
    total.G_least[:], total.G_most[:] = np.inf, -np.inf
    total.u_least[:], total.u_most[:] = np.inf, -np.inf
    if bound.has_surface_errors:
        total.surface_error_per_rad[:], total.own[:] = 0.0, 0.0
    bound.further_error[:] = 0.0
    add_instant_to_sums(belief, bound, layout, every_type)
    total.Gu_first[:] = total.Gu


@kernel
def accumulate_substep(belief, bound, layout, every_type, measured):
    """Add an instant inside the frame to its sums, and move the healthy surfaces on."""
    fill_bound_now(bound, belief.design, measured, belief.u)
    add_instant_to_sums(belief, bound, layout, every_type)
    move(belief.actuators, belief.commanded, belief.u)


@kernel
def predict_acceleration(belief, known, effectiveness, offset, offsets_count):
    """Fill `expected` (3,) rad/s2: mean of f + G u over the elapsed frame, with the faults if `known`.

    effectiveness (n,): estimate for each surface; offset (n,) rad: its bias, used if `offsets_count`.
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
    """Fill `innovation_after_known_faults` (3,) rad/s2 of the elapsed frame, of dt s; x (3,) rad/s: now."""
    for i in range(3):
        belief.innovation_after_known_faults[i] = (x[i] - belief.x_before[i]) / dt - belief.expected[i]


@kernel
def move_healthy_surfaces(belief, command):
    """Move the healthy surfaces by one JSBSim frame towards the new command (n,) rad."""
    for s in range(command.size):
        belief.commanded[s] = command[s]
    belief.u_before[:] = belief.u
    move(belief.actuators, belief.commanded, belief.u)
