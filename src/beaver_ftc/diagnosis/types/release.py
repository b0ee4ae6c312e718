"""The return of a surface after a repair: between the fault and health its actuator moves it.

A jammed, trailing or runaway surface that is repaired (released) returns from where it was held, by lag and
rate limit: for a while it is neither at fault nor where a healthy one would be. The actuator's step
a' = f(a) is known and rises with a, so the set of positions a that a past release can have led to is an
interval, carried along exactly by its ends. A type that no longer holds the surface is excluded only when no
such return explains the frame either.

There are two such intervals, of earlier and of later releases: stuck.py says why. Nothing is observed before
the alarm, so a release may have happened before it; each frame in which something is wrong excludes some
releases.

After a release a type does not hold the surface again until the surface has been observed healthy.

In a block of frames the release may happen at any instant of the block: at each instant the surface is where
it was held, or where the actuator has moved it from there.

A frame shows the mean of a moving position a, weighted by the effectiveness G at each instant. This mean
differs from the plain mean by the covariance of G and a, over the mean of G, so by no more than

    (G_max - G_min) / (4 |mean G|)  (a_max - a_min)                                        [Gruess1935]
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.actuators import nearer
from beaver_ftc.diagnosis.types.contract import ANYTHING, NOTHING

EARLIER, LATER = 0, 1
HELD, RETURNING, REFUTED = range(3)
# A surface nearer than this to a healthy one counts as healthy: its effect is below the rounding bound.
NOT_BACK_RAD = 1e-14


@kernel
def forget(surface, which, kind):
    """No release of this type is possible: the empty interval."""
    surface.release.low[which, kind], surface.release.high[which, kind] = np.inf, -np.inf


@kernel
def any_release(surface, which, kind):
    """Whether a release of this type is possible."""
    return surface.release.low[which, kind] <= surface.release.high[which, kind]


@kernel
def start(surface, kind):
    """Allow a release before the alarm, from anywhere in the travel."""
    forget(surface, EARLIER, kind)
    surface.release.low[LATER, kind] = surface.actuator.travel_low
    surface.release.high[LATER, kind] = surface.actuator.travel_high
    not_held(surface, kind)


@kernel
def not_held(surface, kind):
    """This type does not hold the surface in the judged frame: the empty interval."""
    surface.release.held_low[kind], surface.release.held_high[kind] = np.inf, -np.inf


@kernel
def carried(config, surface, held, side=0):
    """Mean position over the judged frame of a surface released at `held` (rad), its position at the end of
    the frame, and the possible error of the mean where the effectiveness changes meanwhile.

    The release is at the beginning of the frame; with a side, at any instant of it: the least mean if
    side < 0, else the greatest.
    """
    total, count, a, least, greatest = 0.0, 0, held, held, held
    for k in range(config.length):
        order = surface.orders.given[1, k]
        for _ in range(config.instants):
            total += a
            count += 1
            least, greatest = min(least, a), max(greatest, a)
            a = nearer(a, order, surface.actuator.approach, surface.actuator.step)
            if side != 0:
                a = min(a, held) if side < 0 else max(a, held)
    return total / count, a, surface.judged.uneven * (greatest - least)


@kernel
def released_within(config, surface, kind):
    """Whether a release at an instant of the judged block explains the block."""
    held_low, held_high = surface.release.held_low[kind], surface.release.held_high[kind]
    if config.length == 1 or held_low > held_high:
        return False
    low, _, low_room = carried(config, surface, held_low, -1)
    high, _, high_room = carried(config, surface, held_high, 1)
    return low - low_room <= surface.judged.high and high + high_room >= surface.judged.low


@kernel
def possible(config, surface, kind):
    """Whether a return after this type explains the judged frame; forget the releases that do not."""
    left = released_within(config, surface, kind)
    if not left:
        not_held(surface, kind)
    for which in (EARLIER, LATER):
        if any_release(surface, which, kind):
            if agrees(config, surface, which, kind):
                left = True
            else:
                forget(surface, which, kind)
    return left


@kernel
def agrees(config, surface, which, kind):
    """Whether the judged frame agrees with a return; drop the part of its interval that does not.

    The mean over the frame rises with where the return began, and by no more than that.
    """
    held = surface.release
    low, _, low_room = carried(config, surface, held.low[which, kind])
    high, _, high_room = carried(config, surface, held.high[which, kind])
    room, command = max(low_room, high_room), surface.judged.command
    if max(abs(low - room - command), abs(high + room - command)) <= NOT_BACK_RAD:
        return False
    if low - room > surface.judged.high or high + room < surface.judged.low:
        return False
    least = held.low[which, kind] + max(surface.judged.low - low - room, 0.0)
    greatest = held.high[which, kind] - max(high - room - surface.judged.high, 0.0)
    keep(held, which, kind, least, greatest)
    return True


@kernel
def renew(surface, kind):
    """Take the later releases for the earlier ones, when no earlier one is possible any more."""
    held = surface.release
    held.low[EARLIER, kind], held.high[EARLIER, kind] = held.low[LATER, kind], held.high[LATER, kind]
    forget(surface, LATER, kind)


@kernel
def keep(held, which, kind, low, high):
    """Replace the interval of a return by [low, high]; rounding may have swapped ends that meet."""
    held.low[which, kind], held.high[which, kind] = min(low, high), max(low, high)


@kernel
def status(config, surface, kind, least, greatest):
    """Whether a type holds the surface between least and greatest (rad) in the judged frame: HELD; or has
    released it, and the actuator may be bringing it back: RETURNING; or neither explains it: REFUTED."""
    returning = config.returns and possible(config, surface, kind)
    released = surface.release.released
    if least <= surface.judged.high and greatest >= surface.judged.low and not released[kind]:
        return HELD
    if not returning:
        return REFUTED
    released[kind] = 1
    return RETURNING


@kernel
def explains(config, surface, kind, least, greatest):
    """The parameters that explain the judged frame: all if the surface is held there or returns from there,
    none otherwise."""
    return NOTHING if status(config, surface, kind, least, greatest) == REFUTED else ANYTHING


@kernel
def beginning(config, surface, k):
    """Where the surface can have been as the judged frame began, (low, high) rad, and which frame shows it.

    With several JSBSim frames in one of ours the release may have been within it: the frame before is used.
    """
    if config.whole:
        return surface.judged.low, surface.judged.high, k
    return surface.earlier.low, surface.earlier.high, k - 1


@kernel
def note_release(surface, kind, low, high):
    """Add a release from between low and high (rad), where a type may hold the surface, if low <= high."""
    held = surface.release
    not_held(surface, kind)
    if low <= high and not held.released[kind]:
        held.held_low[kind], held.held_high[kind] = low, high
        held.low[LATER, kind] = min(held.low[LATER, kind], low)
        held.high[LATER, kind] = max(held.high[LATER, kind], high)


@kernel
def propagate(config, surface, kind):
    """Carry the intervals of returns to the next frame; a surface that looks healthy may be held again."""
    held = surface.release
    if not surface.judged.wrong:
        held.released[kind] = 0
    for which in (EARLIER, LATER):
        if any_release(surface, which, kind):
            _, low, _ = carried(config, surface, held.low[which, kind])
            _, high, _ = carried(config, surface, held.high[which, kind])
            keep(held, which, kind, low, high)
    if config.length > 1 and held.held_low[kind] <= held.held_high[kind]:
        _, low, _ = carried(config, surface, held.held_low[kind], -1)
        _, high, _ = carried(config, surface, held.held_high[kind], 1)
        held.low[LATER, kind] = min(held.low[LATER, kind], low)
        held.high[LATER, kind] = max(held.high[LATER, kind], high)
