"""A surface that stays where it is: a jam, p = c anywhere in the travel, or one that trails freely, p = 0.

Conclusions about c are not certain if the surface may already have been returning after a repair. So the set
before the earliest return still possible is kept, and is restored when the surface looks healthy.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.types import release
from beaver_ftc.diagnosis.types.contract import (
    ANYTHING,
    FIXED,
    LOSES,
    NOTHING,
    SHIFTED,
    STANDS,
    FaultType,
    middle,
    middle_of,
    set_of,
    within_travel,
)
from beaver_ftc.diagnosis.types.release import EARLIER, HELD, LATER, REFUTED


@kernel
def travel(surface):
    """It may be anywhere in its travel, rad."""
    return surface.actuator.travel_low, surface.actuator.travel_high


@kernel
def begin(surface, kind):
    """It may be anywhere in its travel."""
    surface.stuck.kept_low[:], surface.stuck.kept_high[:] = travel(surface)
    release.start(surface, kind)


@kernel
def judge(config, surface, kind, k):
    """It stays where it is."""
    status = release.status(config, surface, kind, surface.feasible.low[kind], surface.feasible.high[kind])
    if status == HELD:
        return surface.judged.low, surface.judged.high
    return NOTHING if status == REFUTED else ANYTHING


@kernel
def on_release(config, surface, kind, k):
    """It may be released where it is jammed."""
    renew(surface, kind)
    low, high, _ = release.beginning(config, surface, k)
    release.note_release(
        surface, kind, max(low, surface.feasible.low[kind]), min(high, surface.feasible.high[kind])
    )


@kernel
def renew(surface, kind):
    """When no earlier release is possible any more, the later ones are the earlier ones."""
    jam = surface.stuck
    if not release.any_release(surface, EARLIER, kind):
        jam.kept_low[EARLIER], jam.kept_high[EARLIER] = jam.kept_low[LATER], jam.kept_high[LATER]
        jam.kept_low[LATER], jam.kept_high[LATER] = surface.feasible.low[kind], surface.feasible.high[kind]
        release.renew(surface, kind)


@kernel
def restored(surface, kind):
    """Where the surface looks healthy the jam may take hold again: its set as it was before the earliest
    release still possible."""
    if not surface.judged.wrong:
        for which in (EARLIER, LATER):
            if release.any_release(surface, which, kind):
                return surface.stuck.kept_low[which], surface.stuck.kept_high[which]
    return surface.feasible.low[kind], surface.feasible.high[kind]


@kernel
def deflection(config, surface, kind, k):
    """Where it is jammed."""
    return surface.feasible.low[kind], surface.feasible.high[kind]


@kernel
def judge_float(config, surface, kind, k):
    """It is at neutral, or at the stop that is nearest to it."""
    neutral = within_travel(surface, 0.0)
    return release.explains(config, surface, kind, neutral, neutral)


@kernel
def on_release_float(config, surface, kind, k):
    """It may be released at neutral."""
    low, high, _ = release.beginning(config, surface, k)
    neutral = within_travel(surface, 0.0)
    release.note_release(surface, kind, max(low, neutral), min(high, neutral))


@kernel
def deflection_float(config, surface, kind, k):
    """At neutral."""
    neutral = within_travel(surface, 0.0)
    return neutral, neutral


def neutral_of(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    surface = fdi["types"]["surface"][s]
    return float(min(max(0.0, surface["actuator"]["travel_low"]), surface["actuator"]["travel_high"]))


@kernel
def error(surface, kind):
    """Off its command, rad, by the middle of where it can be jammed."""
    return middle(surface, kind) - surface.elapsed.command


@kernel
def error_of_float(surface, kind):
    """Off its command, rad: at neutral."""
    return within_travel(surface, 0.0) - surface.elapsed.command


STUCK = FaultType(
    name="stuck", constant=True, rank=2,
    whole_range=travel, begin=begin, judge=judge, restored=restored,
    record="stuck", memory=record(kept_low=2, kept_high=2),  # rad; EARLIER and LATER
    on_release=on_release, propagate_release=release.propagate, deflection=deflection, at_rest=STANDS,
    accommodation=FIXED, expected_error=error, error_rank=3, estimate=middle_of, interval=set_of,
)  # fmt: skip
FLOAT = FaultType(
    name="float", constant=True, rank=3,
    begin=release.start, judge=judge_float, on_release=on_release_float, propagate_release=release.propagate,
    deflection=deflection_float,
    accommodation=SHIFTED, also=(FIXED, LOSES), expected_error=error_of_float, error_rank=1,
    estimate=neutral_of,
)  # fmt: skip
TYPES = STUCK, FLOAT
