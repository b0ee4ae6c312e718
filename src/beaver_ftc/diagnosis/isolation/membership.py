"""Set membership: which parameters of a fault agree with the innovation, and have agreed all along.

    theta agrees with a frame on axis i if |nu_i - base_i - theta Z_i| <= eta_bar_i

One surface has one parameter, so its axes must agree on one theta. Frame by frame this is the sharpest test
there is of a parameter that may change in any way; of a constant one (`fdi.fault_profile: abrupt`) the
sets of all frames since the alarm may be intersected.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.bounds.worst_case import covering, share_used

NOTHING = (1.0, -1.0)
ROUNDS = 4  # each narrows what is left of the travel to the tolerance's share of it


@kernel
def healthy(innovation, bound):
    """Whether the admitted uncertainty alone explains an innovation (3,) bounded by `bound` (3,), rad/s2."""
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
    """The interval of theta that agrees with an innovation (3,) on axis i, if that axis is asked.

    bound (3,): on the innovation without a fault, rad/s2. effect: what the fault does, of dtype EFFECT.
    """
    if fie.unasked[i]:
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
    """Widen the room of a position by what the errors of the surface's own terms do where it can have been.

    eta_bar holds them at the command. The further the surface is from neutral, the more they do; how far it
    can have been follows from the frame itself, in a few rounds from its travel inwards, each of them valid.
    Of several JSBSim frames in one of ours (instants) the first may have seen it where it was a frame before.
    So with a map of the model's error, which is for healthy surfaces.
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
    """The level of the map of errors, 0 without one, that covers a surface which was in the mean over the
    frame at `where`, (low, high) rad."""
    if not mapped.anywhere:
        return 0
    return covering(mapped, share_used(mapped, fie.surface, where, fie.used, instants))


@kernel
def agree(fie, innovation, frame_bound):
    """Whether one theta, or no fault at all, explains the elapsed frame on every axis."""
    if healthy(innovation, frame_bound):
        return True
    low, high = fie.low, fie.high
    for i in range(3):
        axis_low, axis_high = agreeing(innovation, frame_bound, fie, fie.effect, i)
        low, high = max(low, axis_low), min(high, axis_high)
    return low <= high


@kernel
def start(fie, unprojected):
    """Begin with the known set of theta on every axis; `unprojected`: with no limit."""
    fie.theta_low[:], fie.theta_high[:] = fie.low, fie.high
    if unprojected:
        fie.theta_low[:], fie.theta_high[:] = -np.inf, np.inf


@kernel
def intersect(fie, i, interval, shared):
    """Keep of the set of theta on axis i, or of every axis if shared, what is also in `interval`."""
    low, high = interval
    for j in range(3):
        if shared or j == i:
            fie.theta_low[j] = max(fie.theta_low[j], low)
            fie.theta_high[j] = min(fie.theta_high[j], high)


@kernel
def narrow(fie, innovation, frame_bound, shared):
    """Intersect with what frame and filtered residual say of a constant theta; False when nothing is left.

    Filtered: eps + Omega thetahat = Omega theta + filtered uncertainty, whatever the estimate thetahat did.
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
