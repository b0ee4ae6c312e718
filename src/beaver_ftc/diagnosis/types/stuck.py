"""A jam: p = c, c anywhere in the travel.

What was concluded of c while a return from it may already have been on its way is not certain. So the set as
it was before the earliest return still possible is kept, and comes back when health does.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import release, sets
from beaver_ftc.diagnosis.types.release import EARLIER, LATER

NAME = "stuck"
CONSTANT = True
MEMORY = (("kept_low", "f8", (2,)), ("kept_high", "f8", (2,)))  # rad, by EARLIER and LATER


@kernel
def begin(surface, kind):
    """It may be anywhere in its travel."""
    surface.set_low[kind], surface.set_high[kind] = surface.travel_low, surface.travel_high
    surface.stuck.kept_low[:], surface.stuck.kept_high[:] = surface.travel_low, surface.travel_high
    release.start(surface, kind)


@kernel
def judge(fdi, surface, kind, frame):
    """It stays where it is."""
    if release.holds(fdi, surface, kind, surface.set_low[kind], surface.set_high[kind]):
        sets.intersect(surface, kind, surface.low_then, surface.high_then)


@kernel
def let_go(fdi, surface, kind):
    """It may be let go where it is jammed."""
    renew(surface, kind)
    low, high, _ = release.beginning(fdi, surface)
    release.let_go(surface, kind, max(low, surface.set_low[kind]), min(high, surface.set_high[kind]))


@kernel
def renew(surface, kind):
    """When no earlier release is possible any more, the later ones are the earlier ones."""
    held, jam = surface.release, surface.stuck
    if not release.any_release(surface, EARLIER, kind):
        held.low[EARLIER, kind], held.high[EARLIER, kind] = held.low[LATER, kind], held.high[LATER, kind]
        jam.kept_low[EARLIER], jam.kept_high[EARLIER] = jam.kept_low[LATER], jam.kept_high[LATER]
        jam.kept_low[LATER], jam.kept_high[LATER] = surface.set_low[kind], surface.set_high[kind]
        release.forget(surface, LATER, kind)


@kernel
def bring_back(fdi, surface, kind):
    """Where the surface looks healthy the jam may take hold again, where it was before."""
    if not surface.wrong_then:
        settle(surface, kind)
    release.bring_back(fdi, surface, kind)


@kernel
def settle(surface, kind):
    """Return to the set as it was before the earliest release still possible."""
    for which in (EARLIER, LATER):
        if release.any_release(surface, which, kind):
            surface.set_low[kind] = surface.stuck.kept_low[which]
            surface.set_high[kind] = surface.stuck.kept_high[which]
            return


@kernel
def deflection(fdi, surface, kind):
    """Where it is jammed."""
    return surface.set_low[kind], surface.set_high[kind]


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return sets.middle_of(fdi, s, kind)


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of the deflection, rad."""
    return sets.set_of(fdi, s, kind)
