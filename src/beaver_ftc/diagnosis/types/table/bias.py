"""Bias: p = u + b, cut off by the stops; the offset b, rad, is constant.

`consistent_interval` reads the judged frame (srf.judged, srf.commands[1]), `deflection_range` the elapsed one
(srf.last, srf.commands[0]). With blocks, each is a block of frames.

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.sets import NO_THETA
from beaver_ftc.diagnosis.types import (
    SUBTRACT_OFFSET,
    DeflectionRelation,
    FaultType,
    clip_travel,
    feasible_set,
    middle_estimate,
    set_middle,
)
from beaver_ftc.diagnosis.types.observations import judged_error


@kernel
def consistent_interval(c, srf, h, k):
    """b = p - u of the surface in the judged frame, (lo, hi) rad; open at a stop:

        lo = judged.lo - u    -inf if judged.lo - max(u - u_min, 0) <= stop_lo
        hi = judged.hi - u    +inf if judged.hi + max(u_max - u, 0) >= stop_hi

    u_min, u_max: extremes of u within the frame: p was at most u - u_min below its mean. A surface that was
    at its stop at any instant of the frame may have a larger offset than it shows. An offset takes no surface
    beyond its stop: NO_THETA.
    """
    judged = srf.judged
    cmd = srf.commands
    act = srf.actuator
    if judged.hi < act.stop_lo or judged.lo > act.stop_hi:
        return NO_THETA
    lo, hi = judged_error(srf)
    if judged.lo - max(judged.u - cmd.u_min[1], 0.0) <= act.stop_lo:
        lo = -np.inf
    if judged.hi + max(cmd.u_max[1] - judged.u, 0.0) >= act.stop_hi:
        hi = np.inf
    return lo, hi


@kernel
def deflection_range(c, srf, h, k):
    """u + b in the elapsed frame, cut off by the stops, least and greatest over the set of b, rad."""
    lo = mean_with_offset(srf, srf.sets.low[h], srf.commands.u_min[0])
    return lo, mean_with_offset(srf, srf.sets.high[h], srf.commands.u_max[0])


@kernel
def mean_with_offset(srf, b, u_end):
    """Mean of u + b over the elapsed frame, rad. If u + b meets a stop in the frame, the stop cuts off an
    unknown part of it; u_end + b, cut off, then bounds the mean (u_end: the extreme of u on this side)."""
    cmd = srf.commands
    act = srf.actuator
    stops = cmd.u_min[0] + b < act.stop_lo or cmd.u_max[0] + b > act.stop_hi
    return clip_travel(srf, u_end + b) if stops else srf.last.u + b


def estimate_interval(fdi: np.void, s: int, h: int) -> tuple[float, float] | None:
    """The interval of b, rad; None while one end is open."""
    lo, hi = feasible_set(fdi, s, h)
    return (lo, hi) if np.isfinite(hi - lo) else None


TYPES = (
    FaultType(
        name="bias", has_constant_parameter=True, sort_rank=6,
        consistent_interval=consistent_interval, deflection_range=deflection_range,
        # the middle of the set is not finite, so not known, while an end of the set is open
        accommodation_mode=SUBTRACT_OFFSET, deflection_error=set_middle, deflection_error_precedence=2,
        deflection_relation=DeflectionRelation(
            1.0, theta_is_share=False, theta_span=lambda low, high: (low - high, high - low)
        ),
        frames_test="offset", estimate_parameter=middle_estimate,
        estimate_parameter_interval=estimate_interval,
    ),
)  # fmt: skip
