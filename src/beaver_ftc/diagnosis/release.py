"""A surface that has been let go: between the fault and health it is where its actuator brings it.

A jammed, trailing or runaway surface that is repaired comes back from where it was held, by lag and rate
limit: for a while it is neither at fault nor where a healthy one would be. The actuator's step a' = f(a) is
known and rises with a, so the set of positions a that a release within the past can have led to is an
interval, carried along exactly by its ends. A type that no longer holds the surface is excluded only when no
such return explains the frame either.

What was concluded of a jam's position while a return may already have been on its way is not certain. So
there are two such intervals, of earlier and of later releases, each with the set as it was before the first
of them; when health comes back, the set returns to what it was before the earliest return still possible.

Once let go, a type does not take hold again before the surface has been seen healthy.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.actuators import nearer
from beaver_ftc.diagnosis.state import DOWN, FLOAT, STUCK, UP

EARLIER, LATER = 0, 1
HELD = (STUCK, FLOAT, UP, DOWN)
UNEVENNESS = 0.05  # a surface's effectiveness does not change by more within a block
NOT_BACK_RAD = 1e-12  # what is nearer to a healthy surface acts within rounding as one


@kernel
def forget(surface, which, kind):
    """No release of this type is possible: the empty interval."""
    surface.free_low[which, kind], surface.free_high[which, kind] = np.inf, -np.inf


@kernel
def any_release(surface, which, kind):
    """Whether a release of this type is possible."""
    return surface.free_low[which, kind] <= surface.free_high[which, kind]


@kernel
def start(surface):
    """Nothing has been held yet."""
    for kind in HELD:
        forget(surface, EARLIER, kind)
        forget(surface, LATER, kind)
    surface.kept_low[:], surface.kept_high[:] = surface.travel_low, surface.travel_high


@kernel
def carried(fdi, surface, a):
    """Mean position over the judged frame of a surface that is at a (rad) as it begins; and as it ends."""
    total, count = 0.0, 0
    for k in range(fdi.block):
        order = surface.orders[1, k]
        for _ in range(fdi.instants):
            total += a
            count += 1
            a = nearer(a, order, surface.approach, surface.step)
    return total / count, a


@kernel
def possible(fdi, surface, kind):
    """Whether a return from this type explains the judged frame; forget those releases that do not."""
    left = False
    for which in (EARLIER, LATER):
        if any_release(surface, which, kind):
            low, end = carried(fdi, surface, surface.free_low[which, kind])
            high, other_end = carried(fdi, surface, surface.free_high[which, kind])
            if fdi.block > 1:
                low -= UNEVENNESS * abs(end - surface.free_low[which, kind])
                high += UNEVENNESS * abs(other_end - surface.free_high[which, kind])
            away = max(abs(low - surface.command_then), abs(high - surface.command_then)) > NOT_BACK_RAD
            if away and low <= surface.high_then and high >= surface.low_then:
                left = True
            else:
                forget(surface, which, kind)
    return left


@kernel
def renew(surface):
    """When no earlier release of a jam is possible any more, the later ones are the earlier ones."""
    if not any_release(surface, EARLIER, STUCK):
        surface.free_low[EARLIER, STUCK] = surface.free_low[LATER, STUCK]
        surface.free_high[EARLIER, STUCK] = surface.free_high[LATER, STUCK]
        surface.kept_low[EARLIER], surface.kept_high[EARLIER] = (
            surface.kept_low[LATER],
            surface.kept_high[LATER],
        )
        surface.kept_low[LATER], surface.kept_high[LATER] = surface.set_low[STUCK], surface.set_high[STUCK]
        forget(surface, LATER, STUCK)


@kernel
def settle(surface):
    """The surface looks healthy: every type may take hold again, the jam where it was before."""
    surface.released[:] = 0
    for which in (EARLIER, LATER):
        if any_release(surface, which, STUCK):
            surface.set_low[STUCK], surface.set_high[STUCK] = (
                surface.kept_low[which],
                surface.kept_high[which],
            )
            return


@kernel
def run_at_least(fdi, surface, frame):
    """How far up a runaway has come by a frame, and how far down one has: rad, the stop at most."""
    if surface.started_at < 0:
        return surface.travel_low, surface.travel_high
    elapsed = frame - surface.started_at
    if fdi.block > 1:
        elapsed = max(elapsed - 1, 0)  # the mean over a block was reached within it
    way = surface.least_runaway_rate * fdi.span_s * elapsed
    return (
        min(surface.travel_high, surface.start_low + way),
        max(surface.travel_low, surface.start_high - way),
    )


@kernel
def holding(fdi, surface, kind):
    """Where a type can have held the surface as the judged frame began, rad.

    With several JSBSim frames in one of ours it may have let go within it: the frame before tells.
    """
    low, high = surface.low_before, surface.high_before
    frame = fdi.frame - 2
    if fdi.whole:
        low, high, frame = surface.low_then, surface.high_then, fdi.frame - 1
    if kind == STUCK:
        return max(low, surface.set_low[STUCK]), min(high, surface.set_high[STUCK])
    if kind == FLOAT:
        return max(low, 0.0), min(high, 0.0)
    least, greatest = run_at_least(fdi, surface, frame)
    low, high = (max(low, least), high) if kind == UP else (low, min(high, greatest))
    if fdi.whole or low > high:
        return low, high
    # a runaway has meanwhile come further than that
    return (low, surface.travel_high) if kind == UP else (surface.travel_low, high)


@kernel
def let_go(fdi, surface):
    """What holds the surface as the judged frame begins may let go of it there."""
    renew(surface)
    for kind in HELD:
        low, high = holding(fdi, surface, kind)
        if low <= high and not surface.released[kind]:
            surface.free_low[LATER, kind] = min(surface.free_low[LATER, kind], low)
            surface.free_high[LATER, kind] = max(surface.free_high[LATER, kind], high)


@kernel
def bring_back(fdi, surface):
    """Carry what has been let go to the next frame."""
    if not surface.wrong_then:
        settle(surface)
    for kind in HELD:
        for which in (EARLIER, LATER):
            if any_release(surface, which, kind):
                _, surface.free_low[which, kind] = carried(fdi, surface, surface.free_low[which, kind])
                _, surface.free_high[which, kind] = carried(fdi, surface, surface.free_high[which, kind])
