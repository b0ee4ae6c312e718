"""Surfaces that do not follow their command: stuck (p = c), float (p = 0), hardover (p runs to a stop).

*Release.* A repaired surface returns from where it was held, by lag and rate limit of its actuator: for a
while it is neither at fault nor where a healthy one would be. The actuator's step a' = f(a) is known and
rises with a, so the set of positions a that a past release can have led to is an interval; its ends are
advanced exactly. A type that no longer holds the surface is excluded only if no such return explains the
frame either.

There are two such intervals, of earlier and of later releases. Nothing is observed before the alarm, so a
release may have happened before it; each frame in which something is wrong excludes some releases. After a
release a type does not hold the surface again until the surface has been observed healthy. In a block of
frames the release may happen at any instant of the block: at each instant the surface is where it was held,
or where the actuator has moved it from there.

A frame shows the mean of a moving position a, weighted by the effectiveness G at each instant. This mean
differs from the plain mean by the covariance of G and a, over the mean of G, so by no more than

    (G_max - G_min) / (4 |mean G|)  (a_max - a_min)                                        [Gruess1935]

*Stuck*: conclusions about c are not certain if the surface may already have been returning after a repair. So
the set before the earliest return still possible is kept, and is restored when the surface looks healthy.

*Hardover*: by each frame the surface has come at least as far as its least rate takes it, and it stays.

b: slot of releases, EARLIER_SLOT or LATER_SLOT; rel: record of the releases. Symbols: types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import farthest
from beaver_ftc.diagnosis.types import (
    EMPTY_SET,
    GIVE_UP,
    REST_POSITION_IS_PARAMETER,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    UNLIMITED_SET,
    DeflectionRelation,
    FaultType,
    clip_travel,
    feasible_set,
    middle_estimate,
    set_middle,
)

EARLIER_SLOT, LATER_SLOT = 0, 1
IS_HELD, IS_RETURNING, IS_REFUTED = range(3)
# A surface nearer than this to a healthy one counts as healthy: its effect is below the rounding bound.
HEALTHY_RAD = 1e-14


@kernel
def clear_releases(srf, b, h):
    """No release of this type is possible: the empty interval."""
    srf.release.back_lo[b, h], srf.release.back_hi[b, h] = EMPTY_SET


@kernel
def may_return(srf, b, h):
    """Whether a release of this type is possible."""
    return srf.release.back_lo[b, h] <= srf.release.back_hi[b, h]


@kernel
def allow_before(srf, h):
    """Allow a release before the alarm, from anywhere in the travel."""
    clear_releases(srf, EARLIER_SLOT, h)
    srf.release.back_lo[LATER_SLOT, h] = srf.actuator.stop_lo
    srf.release.back_hi[LATER_SLOT, h] = srf.actuator.stop_hi
    empty_held(srf, h)


@kernel
def empty_held(srf, h):
    """This type does not hold the surface in the judged frame: the empty interval."""
    srf.release.held_lo[h], srf.release.held_hi[h] = EMPTY_SET


@kernel
def simulate_return(c, srf, p0, end, anywhere=False):
    """Mean of p over the judged frame of a surface released at p0 (rad), p at the end of the frame, and
    kappa times the range of p, by which the mean may be off.

    p <- f(p), f a step of the actuator towards u: of those declared the one that takes it farthest to one
    side, end 1 or -1. The release is at the beginning of the frame, or `anywhere` in it, where p is farthest.
    """
    act = srf.actuator
    total, p, p_min, p_max = 0.0, p0, p0, p0
    for k in range(c.frames_per_block):
        u = srf.commands.history[1, k]
        for _ in range(c.n_substeps):
            total += p
            p_min, p_max = min(p_min, p), max(p_max, p)
            p = farthest(p, u, end, act.approaches, act.steps, act.band, act.stop_lo, act.stop_hi)
            if anywhere:
                p = min(p, p0) if end < 0.0 else max(p, p0)
    return total / (c.frames_per_block * c.n_substeps), p, srf.judged.kappa * (p_max - p_min)


@kernel
def release_explains(c, srf, h):
    """Whether a release at an instant of the judged block explains the block."""
    lo, hi = srf.release.held_lo[h], srf.release.held_hi[h]
    if c.frames_per_block == 1 or lo > hi:
        return False
    low, _, tol_low = simulate_return(c, srf, lo, -1.0, True)
    high, _, tol_high = simulate_return(c, srf, hi, 1.0, True)
    return low - tol_low <= srf.judged.hi and high + tol_high >= srf.judged.lo


@kernel
def keep_returns(c, srf, h):
    """Whether a return after this type explains the judged frame; forget the releases that do not."""
    explained = release_explains(c, srf, h)
    if not explained:
        empty_held(srf, h)
    for b in (EARLIER_SLOT, LATER_SLOT):
        if may_return(srf, b, h):
            if narrow_return(c, srf, b, h):
                explained = True
            else:
                clear_releases(srf, b, h)
    return explained


@kernel
def narrow_return(c, srf, b, h):
    """Whether the judged frame agrees with a return; drop the part of its interval that does not.

    The mean over the frame rises with where the return began, and by no more than that, if the actuator is
    known. low, high: means of the returns from the ends of the interval.
    """
    rel, seen = srf.release, srf.judged
    low, _, tol_low = simulate_return(c, srf, rel.back_lo[b, h], -1.0)
    high, _, tol_high = simulate_return(c, srf, rel.back_hi[b, h], 1.0)
    tol = max(tol_low, tol_high)
    healthy = max(abs(low - tol - seen.u), abs(high + tol - seen.u)) <= HEALTHY_RAD
    if healthy or low - tol > seen.hi or high + tol < seen.lo:
        return False
    if srf.actuator.uncertain:
        return True
    lo = rel.back_lo[b, h] + max(seen.lo - low - tol, 0.0)
    hi = rel.back_hi[b, h] - max(high - tol - seen.hi, 0.0)
    set_return(rel, b, h, lo, hi)
    return True


@kernel
def set_return(rel, b, h, lo, hi):
    """Replace the interval of the positions of a return, rad; rounding may have swapped ends that meet."""
    rel.back_lo[b, h], rel.back_hi[b, h] = min(lo, hi), max(lo, hi)


@kernel
def judge_held(c, srf, h, lo, hi):
    """Whether a type holds the surface between lo and hi in the judged frame: IS_HELD; or has released it,
    and the actuator may be bringing it back: IS_RETURNING; or neither explains it: IS_REFUTED.
    """
    returns = c.returns_lagged and keep_returns(c, srf, h)
    released = srf.release.released
    if lo <= srf.judged.hi and hi >= srf.judged.lo and not released[h]:
        return IS_HELD
    if not returns:
        return IS_REFUTED
    released[h] = 1
    return IS_RETURNING


@kernel
def held_interval(c, srf, h, lo, hi):
    """The parameters that explain the judged frame: all if the surface is held there or returns from there,
    none otherwise."""
    return EMPTY_SET if judge_held(c, srf, h, lo, hi) == IS_REFUTED else UNLIMITED_SET


@kernel
def frame_start(c, srf, k):
    """The possible position at the start of the judged frame, (lo, hi) rad, and the frame that shows it.

    With several JSBSim frames in one of ours the release may have been within it: the frame before is used.
    """
    if c.single_instant:
        return srf.judged.lo, srf.judged.hi, k
    return srf.earlier.lo, srf.earlier.hi, k - 1


@kernel
def add_release(srf, h, lo, hi):
    """Add a release from between lo and hi, where a type may hold the surface, unless lo > hi."""
    rel = srf.release
    empty_held(srf, h)
    if lo <= hi and not rel.released[h]:
        rel.held_lo[h], rel.held_hi[h] = lo, hi
        widen_later(rel, h, lo, hi)


@kernel
def widen_later(rel, h, lo, hi):
    """Widen the interval of the later releases by (lo, hi), rad."""
    rel.back_lo[LATER_SLOT, h] = min(rel.back_lo[LATER_SLOT, h], lo)
    rel.back_hi[LATER_SLOT, h] = max(rel.back_hi[LATER_SLOT, h], hi)


@kernel
def propagate_returns(c, srf, h):
    """Carry the intervals of returns to the next frame; a surface that looks healthy may be held again."""
    rel = srf.release
    if not srf.judged.anomalous:
        rel.released[h] = 0
    for b in (EARLIER_SLOT, LATER_SLOT):
        if may_return(srf, b, h):
            _, lo, _ = simulate_return(c, srf, rel.back_lo[b, h], -1.0)
            _, hi, _ = simulate_return(c, srf, rel.back_hi[b, h], 1.0)
            set_return(rel, b, h, lo, hi)
    if c.frames_per_block > 1 and rel.held_lo[h] <= rel.held_hi[h]:
        _, lo, _ = simulate_return(c, srf, rel.held_lo[h], -1.0, True)
        _, hi, _ = simulate_return(c, srf, rel.held_hi[h], 1.0, True)
        widen_later(rel, h, lo, hi)


@kernel
def travel_range(srf):
    """Return the whole travel of the surface as its possible interval, rad."""
    return srf.actuator.stop_lo, srf.actuator.stop_hi


@kernel
def reset_stuck(srf, h):
    """Set the possible jammed positions to the whole travel of the surface."""
    srf.stuck.lo_before[:], srf.stuck.hi_before[:] = travel_range(srf)
    allow_before(srf, h)


@kernel
def update_stuck(c, srf, h, k):
    """It stays where it is."""
    status = judge_held(c, srf, h, srf.sets.low[h], srf.sets.high[h])
    if status == IS_HELD:
        return srf.judged.lo, srf.judged.hi
    return EMPTY_SET if status == IS_REFUTED else UNLIMITED_SET


@kernel
def add_stuck_release(c, srf, h, k):
    """Add a release from the interval of the jammed position. When no earlier release is possible any more,
    the later ones are the earlier ones.
    """
    M, rel = srf.stuck, srf.release
    if not may_return(srf, EARLIER_SLOT, h):
        for ends, end in ((M.lo_before, srf.sets.low[h]), (M.hi_before, srf.sets.high[h])):
            ends[EARLIER_SLOT], ends[LATER_SLOT] = ends[LATER_SLOT], end
        rel.back_lo[EARLIER_SLOT, h] = rel.back_lo[LATER_SLOT, h]
        rel.back_hi[EARLIER_SLOT, h] = rel.back_hi[LATER_SLOT, h]
        clear_releases(srf, LATER_SLOT, h)
    lo, hi, _ = frame_start(c, srf, k)
    add_release(srf, h, max(lo, srf.sets.low[h]), min(hi, srf.sets.high[h]))


@kernel
def stuck_after(srf, h):
    """Return the set of a jam that may begin again where the surface looks healthy: its set as it was before
    the earliest release still possible."""
    if not srf.judged.anomalous:
        for b in (EARLIER_SLOT, LATER_SLOT):
            if may_return(srf, b, h):
                return srf.stuck.lo_before[b], srf.stuck.hi_before[b]
    return srf.sets.low[h], srf.sets.high[h]


@kernel
def stuck_range(c, srf, h, k):
    """Return the interval of the jammed position, rad."""
    return srf.sets.low[h], srf.sets.high[h]


@kernel
def update_float(c, srf, h, k):
    """It is at neutral, or at the stop that is nearest to it."""
    p = clip_travel(srf, 0.0)
    return held_interval(c, srf, h, p, p)


@kernel
def add_float_release(c, srf, h, k):
    """Add a release from the neutral position."""
    lo, hi, _ = frame_start(c, srf, k)
    p = clip_travel(srf, 0.0)
    add_release(srf, h, max(lo, p), min(hi, p))


@kernel
def float_range(c, srf, h, k):
    """At neutral."""
    p = clip_travel(srf, 0.0)
    return p, p


def neutral_of(lo: float, hi: float) -> float:
    """Neutral, or the stop that is nearest to it, rad."""
    return min(max(0.0, lo), hi)


def float_deflection(fdi: np.void, s: int, h: int) -> float | None:
    """Deflection, rad."""
    srf = fdi["types"]["surface"][s]
    return float(neutral_of(srf["actuator"]["stop_lo"], srf["actuator"]["stop_hi"]))


@kernel
def stuck_error(srf, h):
    """Middle of the interval of the jammed position minus the command, rad."""
    return set_middle(srf, h) - srf.last.u


@kernel
def float_error(srf, h):
    """Neutral position minus the command, rad."""
    return clip_travel(srf, 0.0) - srf.last.u


STUCK = FaultType(
    name="stuck", has_constant_parameter=True, sort_rank=2,
    parameter_range=travel_range, reset_memory=reset_stuck,
    consistent_interval=update_stuck,
    set_after_frame=stuck_after,
    # rad; EARLIER and LATER
    memory_record_name="stuck", memory_dtype=record(lo_before=2,
    hi_before=2),
    on_possible_release=add_stuck_release, propagate_release=propagate_returns,
    possible_deflection_range=stuck_range,
    evidence_at_rest=REST_POSITION_IS_PARAMETER,
    accommodation_mode=GIVE_UP, deflection_error=stuck_error, deflection_error_precedence=3,
    deflection_relation=DeflectionRelation(
        0.0, theta_is_share=False, theta_span=lambda low, high: (low, high)
    ),
    estimate_parameter=middle_estimate, estimate_parameter_interval=feasible_set,
)  # fmt: skip
FLOAT = FaultType(
    name="float", has_constant_parameter=True, sort_rank=3,
    reset_memory=allow_before, consistent_interval=update_float,
    on_possible_release=add_float_release, propagate_release=propagate_returns,
    possible_deflection_range=float_range,
    accommodation_mode=SUBTRACT_OFFSET, other_accommodation_modes=(GIVE_UP, SCALE_COMMAND),
    deflection_error=float_error,
    deflection_error_precedence=1,
    deflection_relation=DeflectionRelation(
        0.0,
        theta_is_share=False,
        theta_span=lambda low, high: (neutral_of(low, high),) * 2
    ),
    estimate_parameter=float_deflection,
)  # fmt: skip


@kernel
def runaway_distance(c, srf, k):
    """The least way (rad) that a runaway has gone by a frame, runaway block_duration_s n; over a block the
    mean was reached within it.
    """
    n = k - srf.evidence.k_first
    if c.frames_per_block > 1:
        n = max(n - 1, 0)
    return srf.actuator.runaway * c.block_duration_s * n


@kernel
def runaway_interval(c, srf, k, stop):
    """Where a runaway can be by frame k, rad: beyond its way at the least rate, or at the stop (1 upper, -1
    lower)."""
    act, ev = srf.actuator, srf.evidence
    way = runaway_distance(c, srf, k)
    if ev.k_first < 0:
        return act.stop_lo, act.stop_hi
    if stop == 1:
        return min(act.stop_hi, ev.first_lo + way), act.stop_hi
    return act.stop_lo, max(act.stop_lo, ev.first_hi - way)


@kernel
def release_runaway(c, srf, h, k, stop):
    """It may be released on its way; within a frame of several instants, further on."""
    lo, hi, k0 = frame_start(c, srf, k)
    way_lo, way_hi = runaway_interval(c, srf, k0, stop)
    lo, hi = max(lo, way_lo), min(hi, way_hi)
    if not c.single_instant and lo <= hi:
        lo, hi = (lo, way_hi) if stop == 1 else (way_lo, hi)
    add_release(srf, h, lo, hi)


@kernel
def judge_up(c, srf, h, k):
    """Upwards."""
    lo, hi = runaway_interval(c, srf, k, 1)
    return held_interval(c, srf, h, lo, hi)


@kernel
def judge_down(c, srf, h, k):
    """Downwards."""
    lo, hi = runaway_interval(c, srf, k, -1)
    return held_interval(c, srf, h, lo, hi)


@kernel
def release_up(c, srf, h, k):
    """Upwards."""
    release_runaway(c, srf, h, k, 1)


@kernel
def release_down(c, srf, h, k):
    """Downwards."""
    release_runaway(c, srf, h, k, -1)


@kernel
def range_up(c, srf, h, k):
    """Upwards."""
    return runaway_interval(c, srf, k, 1)


@kernel
def range_down(c, srf, h, k):
    """Downwards."""
    return runaway_interval(c, srf, k, -1)


def upper_stop(fdi: np.void, s: int, h: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["stop_hi"])


def lower_stop(fdi: np.void, s: int, h: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["stop_lo"])


HARDOVER_UP = FaultType(
    name="hardover", description="hardover up", has_constant_parameter=True, sort_rank=4,
    reset_memory=allow_before, consistent_interval=judge_up,
    on_possible_release=release_up,
    propagate_release=propagate_returns, possible_deflection_range=range_up,
    stop_direction=1,
    accommodation_mode=GIVE_UP, frames_test="runaway",
    estimate_parameter=upper_stop,
)  # fmt: skip
HARDOVER_DOWN = FaultType(
    name="hardover", description="hardover down", has_constant_parameter=True, sort_rank=5,
    reset_memory=allow_before, consistent_interval=judge_down,
    on_possible_release=release_down,
    propagate_release=propagate_returns, possible_deflection_range=range_down,
    stop_direction=-1,
    accommodation_mode=GIVE_UP, frames_test="runaway",
    estimate_parameter=lower_stop,
)  # fmt: skip
TYPES = STUCK, FLOAT, HARDOVER_UP, HARDOVER_DOWN
