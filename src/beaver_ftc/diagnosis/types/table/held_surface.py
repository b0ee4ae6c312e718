"""Surfaces that do not follow their command: stuck, float and hardover.

    stuck      p = c, the position of the jam, which is the parameter
    float      p = 0, neutral, or the stop that is nearest to it
    hardover   p runs to a stop and stays there; by each frame it has come at least as far as the least rate
               of a runaway takes it

The three share one way of being judged: a row says where its type holds the surface (`deflection_range`), and
release.py tests whether the judged frame agrees with this, or with a return after a release.

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    REST_POSITION_IS_PARAMETER,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    DeflectionRelation,
    FaultType,
    clip_travel,
    feasible_set,
    middle_estimate,
    set_middle,
)


@kernel
def travel_range(srf, h):
    """The whole travel of the surface, rad."""
    return srf.actuator.stop_lo, srf.actuator.stop_hi


@kernel
def stuck_range(c, srf, h, k):
    """It stays where it is: the set of the jammed position, rad."""
    return srf.sets.low[h], srf.sets.high[h]


@kernel
def stuck_error(srf, h):
    """p - u, rad: p in the middle of the interval of the jammed position."""
    return set_middle(srf, h) - srf.last.u


def neutral_of(lo: float, hi: float) -> float:
    """Neutral, or the stop that is nearest to it, rad."""
    return min(max(0.0, lo), hi)


@kernel
def float_range(c, srf, h, k):
    """At neutral, or at the stop that is nearest to it, rad."""
    p = clip_travel(srf, 0.0)
    return p, p


@kernel
def float_error(srf, h):
    """p - u, rad: p at neutral."""
    return clip_travel(srf, 0.0) - srf.last.u


def float_parameter(fdi: np.void, s: int, h: int) -> float | None:
    """Deflection of surface s when it floats, rad."""
    return neutral_of(lower_stop(fdi, s, h), upper_stop(fdi, s, h))


def upper_stop(fdi: np.void, s: int, h: int) -> float:
    """Upper stop of surface s, rad, where a hardover upwards ends."""
    return float(fdi["types"]["surface"][s]["actuator"]["stop_hi"])


def lower_stop(fdi: np.void, s: int, h: int) -> float:
    """Lower stop of surface s, rad, where a hardover downwards ends."""
    return float(fdi["types"]["surface"][s]["actuator"]["stop_lo"])


@kernel
def runaway_distance(c, srf, k):
    """The least distance d (rad) that a runaway has gone by frame k since it first showed in frame k_first.

        d = rate T n,    n = k - k_first

    rate rad/s: the slowest runaway; T s: duration of a block of frames. A block shows the mean of its frames,
    which lies between its first and its last position. From the mean of one block to that of another, a
    surface has surely moved only in the n - 1 blocks between them: of several frames a block, n is one less.
    """
    n = k - srf.evidence.k_first
    if c.frames_per_block > 1:
        n = max(n - 1, 0)
    return srf.actuator.runaway * c.block_duration_s * n


@kernel
def up_range(c, srf, h, k):
    """min(hi, p0 + d) <= p <= hi, rad, once the runaway has shown; anywhere before.

    lo, hi: the stops; p0: the lowest position at which it first showed; d: `runaway_distance`.
    """
    act = srf.actuator
    ev = srf.evidence
    lo = ev.first_lo + runaway_distance(c, srf, k) if ev.k_first >= 0 else act.stop_lo
    return min(act.stop_hi, lo), act.stop_hi


@kernel
def down_range(c, srf, h, k):
    """lo <= p <= max(lo, p0 - d), the same downwards, rad; p0: the highest position at which it first
    showed."""
    act = srf.actuator
    ev = srf.evidence
    hi = ev.first_hi - runaway_distance(c, srf, k) if ev.k_first >= 0 else act.stop_hi
    return act.stop_lo, max(act.stop_lo, hi)


TYPES = (
    FaultType(
        name="stuck", has_constant_parameter=True, sort_rank=2, holds_surface=True,
        parameter_range=travel_range, deflection_range=stuck_range,
        evidence_at_rest=REST_POSITION_IS_PARAMETER,
        accommodation_mode=GIVE_UP, deflection_error=stuck_error, deflection_error_precedence=3,
        deflection_relation=DeflectionRelation(
            0.0, theta_is_share=False, theta_span=lambda low, high: (low, high)
        ),
        estimate_parameter=middle_estimate, estimate_parameter_interval=feasible_set,
    ),
    FaultType(
        name="float", has_constant_parameter=True, sort_rank=3, holds_surface=True,
        deflection_range=float_range,
        # While a surface floats, stuck and total loss remain too, and choose the mode. Float alone remains
        # only for frames that a return after a repair explains: it has the mode of an open type.
        accommodation_mode=SUBTRACT_OFFSET, other_accommodation_modes=(GIVE_UP, SCALE_COMMAND),
        deflection_error=float_error,
        deflection_error_precedence=1,
        deflection_relation=DeflectionRelation(
            0.0, theta_is_share=False, theta_span=lambda low, high: (neutral_of(low, high),) * 2
        ),
        estimate_parameter=float_parameter,
    ),
    FaultType(
        name="hardover", description="hardover up", has_constant_parameter=True, sort_rank=4,
        holds_surface=True, deflection_range=up_range, stop_direction=1,
        accommodation_mode=GIVE_UP, frames_test="runaway",
        estimate_parameter=upper_stop,
    ),
    FaultType(
        name="hardover", description="hardover down", has_constant_parameter=True, sort_rank=5,
        holds_surface=True, deflection_range=down_range, stop_direction=-1,
        accommodation_mode=GIVE_UP, frames_test="runaway",
        estimate_parameter=lower_stop,
    ),
)  # fmt: skip
