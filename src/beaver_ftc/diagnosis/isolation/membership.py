"""Set membership: the parameters theta of a fault that are consistent with the innovation.

    theta is consistent with a frame on axis i if |nu_i - base_i - theta Z_i| <= eta_bar_i

nu, base, Z and eta_bar are in rad/s2 (Z per unit of theta). One surface has one parameter, so one theta must
be consistent on all axes. For a parameter that may change in any way, no test frame by frame is sharper. For
a constant parameter (`fdi.fault_profile: abrupt`) the sets of all frames since the alarm are intersected.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.bounds.worst_case import covering, share_used

NOTHING = (1.0, -1.0)
ROUNDS = 4  # each round reduces the remaining travel to the share of it that the tolerance is


@kernel
def healthy(innovation, bound):
    """True if the admitted uncertainty alone explains an innovation (3,): |nu| <= bound (3,), rad/s2."""
    within = True
    for i in range(3):
        within = within and abs(innovation[i]) <= bound[i]
    return within


@kernel
def solve(value, bound, slope, low, high):
    """The theta of [low, high] with |value - theta slope| <= bound, as (low, high); low > high if none."""
    if slope == 0.0:
        return (low, high) if abs(value) <= bound else NOTHING
    one, other = (value - bound) / slope, (value + bound) / slope
    return max(low, min(one, other)), min(high, max(one, other))


@kernel
def agreeing(innovation, bound, fie, effect, i):
    """The interval of theta that is consistent with an innovation (3,) rad/s2 on axis i.

    It is the whole known set if the axis is ignored. bound (3,) rad/s2: on the innovation without a fault;
    effect: acceleration by the fault, of dtype EFFECT.
    """
    if fie.ignored_axes[i]:
        return fie.low, fie.high
    value, room = innovation[i] - effect.offset[i], bound[i] + effect.spread[i]
    return solve(value, room, effect.Z[i], fie.low, fie.high)


@kernel
def dominant(Z):
    """The axis on which a regressor Z (3,) is largest."""
    axis = 0
    for i in range(1, 3):
        if abs(Z[i]) > abs(Z[axis]):
            axis = i
    return axis


@kernel
def allow_for_own_errors(fie, bound, innovation, instants):
    """Widen the tolerance of a position by the errors of the surface's own terms at that position.

    eta_bar contains these errors at the commanded position. They grow with the distance from neutral. How far
    the surface can have been follows from the frame itself, in a few rounds from its travel inwards; every
    round gives a valid bound. If a frame has several instants, the surface may still be where it was a frame
    before at the first of them. The same holds for a map of the model's error, which is for healthy surfaces.
    """
    s, effect = fie.surface, fie.effect
    axis = dominant(effect.Z)
    before, reach = fie.furthest, max(abs(fie.low), abs(fie.high))
    room, mapped, where = effect.spread[axis], bound.error_map, (fie.low, fie.high)
    level = within(mapped, fie, where, instants)
    value = innovation[axis] - effect.offset[axis]
    earlier = 2.0 * before / instants if instants > 1 else 0.0
    for _ in range(ROUNDS):
        own = max(bound.own_per_rad[axis, s] * (reach + earlier) - bound.own[axis, s], 0.0)
        own += bound.beyond[level, axis]
        low, high = solve(value, bound.frame[axis] + room + own, effect.Z[axis], fie.low, fie.high)
        if low > high:
            break
        reach, where = min(reach, max(abs(low), abs(high))), (low, high)
        level = within(mapped, fie, where, instants)
    fie.furthest = reach
    if mapped.anywhere:
        fie.used = share_used(mapped, s, where, fie.used, instants)
    for i in range(3):
        effect.spread[i] += max(bound.own_per_rad[i, s] * (reach + earlier) - bound.own[i, s], 0.0)
        effect.spread[i] += bound.beyond[level, i]


@kernel
def within(mapped, fie, where, instants):
    """The level of the error map that covers a surface at a mean position within `where`, (low, high) rad.

    It is 0 without a map.
    """
    if not mapped.anywhere:
        return 0
    return covering(mapped, share_used(mapped, fie.surface, where, fie.used, instants))


@kernel
def agree(fie, innovation, frame_bound):
    """True if one theta, or no fault at all, is consistent with the elapsed frame on every axis."""
    if healthy(innovation, frame_bound):
        return True
    low, high = fie.low, fie.high
    for i in range(3):
        axis_low, axis_high = agreeing(innovation, frame_bound, fie, fie.effect, i)
        low, high = max(low, axis_low), min(high, axis_high)
    return low <= high


@kernel
def start(fie, unprojected):
    """Start with the known set of theta on every axis, or, if `unprojected`, without limits."""
    fie.theta_low[:], fie.theta_high[:] = fie.low, fie.high
    if unprojected:
        fie.theta_low[:], fie.theta_high[:] = -np.inf, np.inf


@kernel
def intersect(fie, i, interval, shared):
    """Intersect the set of theta on axis i, or on every axis if `shared`, with `interval`."""
    low, high = interval
    for j in range(3):
        if shared or j == i:
            fie.theta_low[j] = max(fie.theta_low[j], low)
            fie.theta_high[j] = min(fie.theta_high[j], high)


@kernel
def narrow(fie, innovation, frame_bound, shared):
    """Intersect the set of a constant theta with those of frame and filtered residual; false if it is empty.

    Filtered: eps + Omega thetahat = Omega theta + filtered uncertainty, for any course of the estimate.
    """
    for i in range(3):
        frame = agreeing(innovation, frame_bound, fie, fie.effect, i)
        intersect(fie, i, frame, shared)
        filtered = fie.residual[i] + fie.omega[i] * fie.theta[i]
        intersect(fie, i, solve(filtered, fie.bound[i], fie.omega[i], fie.low, fie.high), shared)
    left = True
    for i in range(3):
        left = left and fie.theta_low[i] <= fie.theta_high[i]
    return left


@kernel
def set_spread(effect, spread, s):
    """Fill the spread of a fault's effect by that of its surface s; spread (3, n) rad/s2."""
    for i in range(3):
        effect.spread[i] = spread[i, s]


@kernel
def clear_mean(mean):
    """Begin the mean of a fault's effect over a block of frames (dtype EFFECT)."""
    mean.offset[:], mean.Z[:], mean.spread[:] = 0.0, 0.0, 0.0


@kernel
def add_to_mean(mean, effect, share):
    """Add the effect of a frame, a `share` of the block, to the mean over the block."""
    for i in range(3):
        mean.offset[i] += share * effect.offset[i]
        mean.Z[i] += share * effect.Z[i]
        mean.spread[i] += share * effect.spread[i]
