"""A surface that has been let go: between the fault and health it is where its actuator brings it.

A jammed, trailing or runaway surface that is repaired comes back from where it was held, by lag and rate
limit: for a while it is neither at fault nor where a healthy one would be. The actuator's step a' = f(a) is
known and rises with a, so the set of positions a that a release within the past can have led to is an
interval, carried along exactly by its ends. A type that no longer holds the surface is excluded only when no
such return explains the frame either.

There are two such intervals, of earlier and of later releases: see stuck.py for what the second is for.
Nothing is seen before the alarm, so any release may have gone before it; each frame in which something is
wrong says where it cannot have led.

Once let go, a type does not take hold again before the surface has been seen healthy.

In a block of frames the release may lie at any instant inside: at each, the surface is where it is held, or
where the actuator brings it from there.

What a frame shows of a position a that moves within it is the mean weighted by the effectiveness G then. It
differs from the plain mean by the covariance of G and a, over the mean of G, so by no more than

    (G_max - G_min) / (4 |mean G|)  (a_max - a_min)                                        [Gruess1935]
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.actuators import nearer
from beaver_ftc.diagnosis.types.contract import ANYTHING, NOTHING

EARLIER, LATER = 0, 1
HELD, RETURNING, REFUTED = range(3)
# What is nearer to a healthy surface acts as one: it must do less than the bound allows for rounding.
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
    """It may have been let go before the alarm, anywhere."""
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
    """Mean position over the judged frame of a surface that is at `held` (rad) as it begins; and as it ends;
    and by how much the mean may be off, where the effectiveness changes meanwhile.

    It is let go as the frame begins; or, with a side, at any instant inside: the least if side < 0, or the
    greatest.
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
    """Whether a release inside the judged block explains it."""
    held_low, held_high = surface.release.held_low[kind], surface.release.held_high[kind]
    if config.length == 1 or held_low > held_high:
        return False
    low, _, low_room = carried(config, surface, held_low, -1)
    high, _, high_room = carried(config, surface, held_high, 1)
    return low - low_room <= surface.judged.high and high + high_room >= surface.judged.low


@kernel
def possible(config, surface, kind):
    """Whether a return from this type explains the judged frame; forget those releases that do not."""
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
    """Take [low, high] for where a return can be; ends that meet may have passed by rounding."""
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

    With several JSBSim frames in one of ours it may have been let go within it: the frame before is used.
    """
    if config.whole:
        return surface.judged.low, surface.judged.high, k
    return surface.earlier.low, surface.earlier.high, k - 1


@kernel
def note_release(surface, kind, low, high):
    """A type that holds the surface between low and high (rad) may let go of it there; none if low > high."""
    held = surface.release
    not_held(surface, kind)
    if low <= high and not held.released[kind]:
        held.held_low[kind], held.held_high[kind] = low, high
        held.low[LATER, kind] = min(held.low[LATER, kind], low)
        held.high[LATER, kind] = max(held.high[LATER, kind], high)


@kernel
def propagate(config, surface, kind):
    """Carry what has been let go to the next frame; a surface that looks healthy may be held again."""
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
