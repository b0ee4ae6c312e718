"""Types that hold a surface somewhere, and let it go: does the judged frame agree with either?

*Return.* A repaired surface returns from where it was held, by lag and rate limit of its actuator: for a
while it is neither at fault nor where a healthy one would be. The step of the actuator p <- f(p) rises with
p, and the declared actuators bound it. So the positions that past releases can have led to form an interval,
whose ends are advanced exactly. A type that no longer holds the surface is excluded only if no such return
explains the frame either.

*Two intervals.* There is one of later releases and, where the parameter is the position (*Sets*), one of
earlier ones. Nothing is observed before the alarm, so a release may have happened before it. Each frame in
which something is wrong excludes some releases. After a release a type does not hold the surface again until
the surface has been observed healthy. In a block of frames the release may happen at any instant of the
block: at each instant the surface is where it was held, or where the actuator has moved it from there.

*Mean of a frame.* A frame shows the mean of a moving position p, weighted by the effectiveness G at each
instant. This mean differs from the plain mean by the covariance of G and p, over the mean of G, so by no more
than

    kappa (p_max - p_min),    kappa = (G_max - G_min) / (4 |mean G|)                       [Gruess1935]

*Sets.* Where the parameter is the position itself (stuck), conclusions about it are not certain if the
surface may already have been returning after a repair. So its set before the earliest return still possible
is kept, and is restored when the surface looks healthy.

    srf, h      record of a surface (records.py), number of a type
    b           slot of releases, EARLIER or LATER
    rel         record of the releases (records.RELEASE_RECORD)
    lo, hi      rad, interval of positions: where a type holds the surface, or where returns begin in a frame
    low, high   rad, means over the frame of the returns that begin at lo and at hi

In a frame, examination.judge_frame calls `begin_release`, then `held_set` if the frame is judged, then
`advance_returns`.
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
    """Replace the interval of the positions of returns in slot b, rad. min and max are there because rounding
    may swap ends that meet."""
    rel.back_lo[b, h] = min(lo, hi)
    rel.back_hi[b, h] = max(lo, hi)


@kernel
def forget_return(rel, b, h):
    """Make the interval of slot b empty: no release of this type in this slot is possible."""
    rel.back_lo[b, h], rel.back_hi[b, h] = EMPTY_SET


@kernel
def may_return(rel, b, h):
    """Whether a release of this type in slot b is possible."""
    return rel.back_lo[b, h] <= rel.back_hi[b, h]


@kernel
def allow_before(srf, h):
    """Allow a release before the alarm, from anywhere in the travel, in the slot LATER."""
    rel = srf.release
    forget_return(rel, EARLIER, h)
    set_return(rel, LATER, h, srf.actuator.stop_lo, srf.actuator.stop_hi)
    rel.held_lo[h], rel.held_hi[h] = EMPTY_SET
    rel.set_lo[:, h] = srf.sets.low[h]
    rel.set_hi[:, h] = srf.sets.high[h]


@kernel
def is_position(srf, h):
    """Whether the parameter of a type is the position at which it holds the surface: of the types that hold a
    surface, only such a type limits its set (`parameter_range`)."""
    return srf.sets.low[h] > -np.inf


@kernel
def simulate_return(c, srf, p0, end, anywhere=False):
    """Simulate the judged frame of a surface on its return, at p0 rad as the frame begins. Returns, in rad,
    the mean of p over the frame, p at its end, and kappa (p_max - p_min), by which the mean may be off.

    p <- f(p): one step of the actuator towards u; of the declared actuators, the one that takes the surface
    farthest to one side, end 1 (up) or -1 (down). If the release may be `anywhere` in the frame, p0 is at
    every step a possible position, too: p <- max(p, p0) for end 1, min for end -1.
    """
    act = srf.actuator
    total = 0.0
    p = p0
    p_min = p0
    p_max = p0
    for frame in range(c.frames_per_block):
        u = srf.commands.history[1, frame]
        for _ in range(c.n_substeps):
            total += p
            p_min = min(p_min, p)
            p_max = max(p_max, p)
            p = farthest(p, u, end, act.approaches, act.steps, act.band, act.stop_lo, act.stop_hi)
            if anywhere:
                p = min(p, p0) if end < 0.0 else max(p, p0)
    return total / (c.frames_per_block * c.n_substeps), p, srf.judged.kappa * (p_max - p_min)


@kernel
def simulate_ends(c, srf, lo, hi, anywhere=False):
    """`simulate_return` from both ends of an interval (lo, hi) rad, each as far as it can go to its side.
    Returns three pairs (of lo, of hi), rad: the means, by how much each may be off, and the positions at the
    end of the frame."""
    low, lo, tol_low = simulate_return(c, srf, lo, -1.0, anywhere)
    high, hi, tol_high = simulate_return(c, srf, hi, 1.0, anywhere)
    return (low, high), (tol_low, tol_high), (lo, hi)


@kernel
def release_explains(c, srf, h):
    """Whether a release at an instant of the judged block, from where the type held the surface by then
    (held_lo, held_hi), explains the block; false of a single frame."""
    lo, hi = srf.release.held_lo[h], srf.release.held_hi[h]
    if c.frames_per_block == 1 or lo > hi:
        return False
    (low, high), tol, _ = simulate_ends(c, srf, lo, hi, True)
    return low - tol[0] <= srf.judged.hi and high + tol[1] >= srf.judged.lo


@kernel
def keep_returns(c, srf, h):
    """Whether a return from this type explains the judged frame. Forget the releases whose returns do not."""
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
    """Whether the judged frame agrees with some return in slot b; cut off the part of its interval that does
    not:

        lo <- lo + max(judged.lo - low - tol, 0),    hi <- hi - max(high - tol - judged.hi, 0)

    The cut needs an actuator without declared errors: the mean over the frame then rises with where the
    return began, and by no more than that. A return that is over (`healthy`) cannot be why the frame is
    anomalous.
    """
    judged = srf.judged
    lo = srf.release.back_lo[b, h]
    hi = srf.release.back_hi[b, h]
    (low, high), tols, _ = simulate_ends(c, srf, lo, hi)
    tol = max(tols)
    healthy = max(abs(low - tol - judged.u), abs(high + tol - judged.u)) <= HEALTHY_RAD
    if healthy or low - tol > judged.hi or high + tol < judged.lo:
        return False
    if not srf.actuator.uncertain:
        set_return(
            srf.release, b, h, lo + max(judged.lo - low - tol, 0.0), hi - max(high - tol - judged.hi, 0.0)
        )
    return True


@kernel
def held_set(c, srf, h, lo, hi):
    """The parameters of type h that explain the judged frame, where it holds the surface in (lo, hi) rad:

        holds it, and the frame meets (lo, hi)       all, or the positions of the frame if `is_position`
        otherwise, and a return explains the frame   all; from now on the surface is released
        otherwise                                    none

    A type holds the surface until it has released it. The returns, if there can be any, are tested in any
    case, because those that do not explain the frame must be forgotten.
    """
    returns = c.returns_lagged and keep_returns(c, srf, h)
    released = srf.release.released
    judged = srf.judged
    if lo <= judged.hi and hi >= judged.lo and not released[h]:
        return (judged.lo, judged.hi) if is_position(srf, h) else UNLIMITED_SET
    if not returns:
        return EMPTY_SET
    released[h] = 1
    return UNLIMITED_SET


@kernel
def begin_release(c, srf, h, lo, hi, stop):
    """Add to the later releases one that may have happened as the judged frame began, or within the frame
    before, if a frame has several instants; none once the type has released the surface. It begins where the
    type held the surface, (lo, hi), and where the surface was seen. Within a frame the surface may have been
    further towards the stop (1 upper, -1 lower) to which the type runs, so that this end is not narrowed by
    what was seen.

    If the parameter is the position, and no earlier release is possible any more, the later ones become the
    earlier ones.
    """
    rel = srf.release
    seen = srf.judged if c.single_instant else srf.earlier
    if is_position(srf, h) and not may_return(rel, EARLIER, h):
        for ends in (rel.back_lo, rel.back_hi, rel.set_lo, rel.set_hi):
            ends[EARLIER, h] = ends[LATER, h]
        forget_return(rel, LATER, h)
        rel.set_lo[LATER, h] = srf.sets.low[h]
        rel.set_hi[LATER, h] = srf.sets.high[h]
    rel.held_lo[h], rel.held_hi[h] = EMPTY_SET
    if max(lo, seen.lo) <= min(hi, seen.hi) and not rel.released[h]:
        if c.single_instant or stop != -1:
            lo = max(lo, seen.lo)
        if c.single_instant or stop != 1:
            hi = min(hi, seen.hi)
        rel.held_lo[h] = lo
        rel.held_hi[h] = hi
        widen_later(rel, h, lo, hi)


@kernel
def widen_later(rel, h, lo, hi):
    """Widen the interval of the later releases by (lo, hi), rad."""
    rel.back_lo[LATER, h] = min(rel.back_lo[LATER, h], lo)
    rel.back_hi[LATER, h] = max(rel.back_hi[LATER, h], hi)


@kernel
def advance_returns(c, srf, h):
    """Carry the intervals of returns to the end of the judged frame. A surface that looks healthy in it may
    be held again; its set is then that from before the earliest return still possible. Hence the order of the
    slots: what EARLIER puts replaces what LATER has put. A release within the judged block then joins the
    later ones.
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
