"""Types that hold a surface somewhere, and let it go: does the judged frame agree with either?

A repaired surface returns from where it was held, by lag and rate limit of its actuator: for a while it is
neither at fault nor where a healthy one would be. The actuator's step a' = f(a) is known and rises with a, so
the set of positions a that a past release can have led to is an interval; its ends are advanced exactly. A
type that no longer holds the surface is excluded only if no such return explains the frame either.

There are two such intervals, of earlier and of later releases. Nothing is observed before the alarm, so a
release may have happened before it; each frame in which something is wrong excludes some releases. After a
release a type does not hold the surface again until the surface has been observed healthy. In a block of
frames the release may happen at any instant of the block: at each instant the surface is where it was held,
or where the actuator has moved it from there.

A frame shows the mean of a moving position a, weighted by the effectiveness G at each instant. This mean
differs from the plain mean by the covariance of G and a, over the mean of G, so by no more than

    (G_max - G_min) / (4 |mean G|)  (a_max - a_min)                                        [Gruess1935]

Where the parameter is the position itself (stuck), conclusions about it are not certain if the surface may
already have been returning after a repair. So its set before the earliest return still possible is kept, and
is restored when the surface looks healthy.

b: slot of releases, EARLIER or LATER; rel: record of the releases (records.RELEASE_RECORD); lo, hi: where a
type holds the surface, rad. Symbols: types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.actuators import farthest
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import put_set

EARLIER, LATER = 0, 1
# A surface nearer than this to a healthy one counts as healthy: its effect is below the rounding bound.
HEALTHY_RAD = 1e-14


@kernel
def set_return(rel, b, h, lo, hi):
    """Replace the interval of the positions of a return, rad; rounding may have swapped ends that meet."""
    rel.back_lo[b, h], rel.back_hi[b, h] = min(lo, hi), max(lo, hi)


@kernel
def forget_return(rel, b, h):
    """No release of this type is possible: the empty interval."""
    rel.back_lo[b, h], rel.back_hi[b, h] = EMPTY_SET


@kernel
def may_return(rel, b, h):
    """Whether a release of this type is possible."""
    return rel.back_lo[b, h] <= rel.back_hi[b, h]


@kernel
def allow_before(srf, h):
    """Allow a release before the alarm, from anywhere in the travel."""
    rel = srf.release
    forget_return(rel, EARLIER, h)
    set_return(rel, LATER, h, srf.actuator.stop_lo, srf.actuator.stop_hi)
    rel.held_lo[h], rel.held_hi[h] = EMPTY_SET
    rel.set_lo[:, h], rel.set_hi[:, h] = srf.sets.low[h], srf.sets.high[h]


@kernel
def is_position(srf, h):
    """Whether the parameter of a type is the position at which it holds the surface."""
    return srf.sets.low[h] > -np.inf


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
def simulate_ends(c, srf, lo, hi, anywhere=False):
    """`simulate_return` from both ends of an interval (lo, hi) rad, as far as it can go to that side: the
    means, by how much each may be off, the positions at the end of the frame; each (of lo, of hi), rad."""
    low, lo, tol_low = simulate_return(c, srf, lo, -1.0, anywhere)
    high, hi, tol_high = simulate_return(c, srf, hi, 1.0, anywhere)
    return (low, high), (tol_low, tol_high), (lo, hi)


@kernel
def release_explains(c, srf, h):
    """Whether a release at an instant of the judged block explains the block."""
    lo, hi = srf.release.held_lo[h], srf.release.held_hi[h]
    if c.frames_per_block == 1 or lo > hi:
        return False
    (low, high), tol, _ = simulate_ends(c, srf, lo, hi, True)
    return low - tol[0] <= srf.judged.hi and high + tol[1] >= srf.judged.lo


@kernel
def keep_returns(c, srf, h):
    """Whether a return after this type explains the judged frame; forget the releases that do not."""
    rel = srf.release
    explained = release_explains(c, srf, h)
    if not explained:
        rel.held_lo[h], rel.held_hi[h] = EMPTY_SET
    for b in (EARLIER, LATER):
        if may_return(rel, b, h):
            if narrow_return(c, srf, b, h):
                explained = True
            else:
                forget_return(rel, b, h)
    return explained


@kernel
def narrow_return(c, srf, b, h):
    """Whether the judged frame agrees with a return; drop the part of its interval that does not.

    The mean over the frame rises with where the return began, and by no more than that, if the actuator is
    known. low, high: means of the returns from the ends of the interval.
    """
    seen, lo, hi = srf.judged, srf.release.back_lo[b, h], srf.release.back_hi[b, h]
    (low, high), tols, _ = simulate_ends(c, srf, lo, hi)
    tol = max(tols)
    healthy = max(abs(low - tol - seen.u), abs(high + tol - seen.u)) <= HEALTHY_RAD
    if healthy or low - tol > seen.hi or high + tol < seen.lo:
        return False
    if not srf.actuator.uncertain:
        set_return(srf.release, b, h, lo + max(seen.lo - low - tol, 0.0), hi - max(high - tol - seen.hi, 0.0))
    return True


@kernel
def held_set(c, srf, h, lo, hi):
    """The parameters that explain the judged frame: all if the type holds the surface there, those of the
    frame if the parameter is the position; all if it has released the surface, and the actuator may be
    bringing it back; else none.
    """
    returns = c.returns_lagged and keep_returns(c, srf, h)
    released, seen = srf.release.released, srf.judged
    if lo <= seen.hi and hi >= seen.lo and not released[h]:
        return (seen.lo, seen.hi) if is_position(srf, h) else UNLIMITED_SET
    if not returns:
        return EMPTY_SET
    released[h] = 1
    return UNLIMITED_SET


@kernel
def begin_release(c, srf, h, lo, hi, stop):
    """A repair may have released the surface as the judged frame began; with several JSBSim frames in one of
    ours within the frame before, further towards the stop (1 upper, -1 lower) to which the type runs.

    A known position is that of the earlier releases: when none is possible any more, the later ones are
    earlier.
    """
    rel, seen = srf.release, srf.judged if c.single_instant else srf.earlier
    if is_position(srf, h) and not may_return(rel, EARLIER, h):
        for ends in (rel.back_lo, rel.back_hi, rel.set_lo, rel.set_hi):
            ends[EARLIER, h] = ends[LATER, h]
        forget_return(rel, LATER, h)
        rel.set_lo[LATER, h], rel.set_hi[LATER, h] = srf.sets.low[h], srf.sets.high[h]
    rel.held_lo[h], rel.held_hi[h] = EMPTY_SET
    if max(lo, seen.lo) <= min(hi, seen.hi) and not rel.released[h]:
        if c.single_instant or stop != -1:
            lo = max(lo, seen.lo)
        if c.single_instant or stop != 1:
            hi = min(hi, seen.hi)
        rel.held_lo[h], rel.held_hi[h] = lo, hi
        widen_later(rel, h, lo, hi)


@kernel
def widen_later(rel, h, lo, hi):
    """Widen the interval of the later releases by (lo, hi), rad."""
    rel.back_lo[LATER, h] = min(rel.back_lo[LATER, h], lo)
    rel.back_hi[LATER, h] = max(rel.back_hi[LATER, h], hi)


@kernel
def advance_returns(c, srf, h):
    """Carry the intervals of returns to the next frame; a surface that looks healthy may be held again, where
    it can have been before the earliest return still possible.
    """
    rel = srf.release
    for b in (LATER, EARLIER):
        if may_return(rel, b, h):
            _, _, ends = simulate_ends(c, srf, rel.back_lo[b, h], rel.back_hi[b, h])
            set_return(rel, b, h, *ends)
            if not srf.judged.anomalous:
                put_set(srf, h, (rel.set_lo[b, h], rel.set_hi[b, h]))
    if not srf.judged.anomalous:
        rel.released[h] = 0
    if c.frames_per_block > 1 and rel.held_lo[h] <= rel.held_hi[h]:
        _, _, ends = simulate_ends(c, srf, rel.held_lo[h], rel.held_hi[h], True)
        widen_later(rel, h, *ends)
