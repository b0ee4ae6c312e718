"""A surface that stays where it is: a jam, p = c anywhere in the travel, or one that trails freely, p = 0.

What was concluded of c while a return from it may already have been on its way is not certain. So the set as
it was before the earliest return still possible is kept, and comes back when health does.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.types import release
from beaver_ftc.diagnosis.types.contract import FaultType, intersect, middle_of, set_of, within_travel
from beaver_ftc.diagnosis.types.release import EARLIER, LATER


@kernel
def begin(surface, kind):
    """It may be anywhere in its travel."""
    surface.set_low[kind], surface.set_high[kind] = surface.travel_low, surface.travel_high
    surface.stuck.kept_low[:], surface.stuck.kept_high[:] = surface.travel_low, surface.travel_high
    release.start(surface, kind)


@kernel
def judge(config, surface, kind, k):
    """It stays where it is."""
    if release.holds(config, surface, kind, surface.set_low[kind], surface.set_high[kind]):
        intersect(surface, kind, surface.low_then, surface.high_then)


@kernel
def let_go(config, surface, kind, k):
    """It may be let go where it is jammed."""
    renew(surface, kind)
    low, high, _ = release.beginning(config, surface, k)
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
def bring_back(config, surface, kind):
    """Where the surface looks healthy the jam may take hold again, where it was before."""
    if not surface.wrong_then:
        settle(surface, kind)
    release.bring_back(config, surface, kind)


@kernel
def settle(surface, kind):
    """Return to the set as it was before the earliest release still possible."""
    for which in (EARLIER, LATER):
        if release.any_release(surface, which, kind):
            surface.set_low[kind] = surface.stuck.kept_low[which]
            surface.set_high[kind] = surface.stuck.kept_high[which]
            return


@kernel
def deflection(config, surface, kind, k):
    """Where it is jammed."""
    return surface.set_low[kind], surface.set_high[kind]


@kernel
def judge_float(config, surface, kind, k):
    """It is at neutral, or at the stop that is nearest to it."""
    neutral = within_travel(surface, 0.0)
    release.holds(config, surface, kind, neutral, neutral)


@kernel
def let_go_float(config, surface, kind, k):
    """It may be let go at neutral."""
    low, high, _ = release.beginning(config, surface, k)
    neutral = within_travel(surface, 0.0)
    release.let_go(surface, kind, max(low, neutral), min(high, neutral))


@kernel
def deflection_float(config, surface, kind, k):
    """At neutral."""
    neutral = within_travel(surface, 0.0)
    return neutral, neutral


def neutral_of(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    surface = fdi["types"]["surface"][s]
    return float(min(max(0.0, surface["travel_low"]), surface["travel_high"]))


STUCK = FaultType(
    name="stuck", constant=True, rank=2, begin=begin, judge=judge, let_go=let_go, bring_back=bring_back,
    record="stuck", memory=record(kept_low=2, kept_high=2),  # rad; EARLIER and LATER
    deflection=deflection, estimate=middle_of, interval=set_of,
)  # fmt: skip
FLOAT = FaultType(
    name="float", constant=True, rank=3, begin=release.start, judge=judge_float, let_go=let_go_float,
    bring_back=release.bring_back, deflection=deflection_float, estimate=neutral_of,
)  # fmt: skip
TYPES = STUCK, FLOAT
