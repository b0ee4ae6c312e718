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
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import nearer
from beaver_ftc.diagnosis.types.contract import (
    EMPTY_SET,
    GIVE_UP,
    REST_AGREES,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    UNLIMITED_SET,
    FaultType,
    feasible_set,
    set_middle,
    set_middle_of,
    within_travel,
)

EARLIER_RELEASE, LATER_RELEASE = 0, 1
HELD, RETURNING, REFUTED = range(3)
# A surface nearer than this to a healthy one counts as healthy: its effect is below the rounding bound.
RETURNED_WITHIN_RAD = 1e-14


@kernel
def clear_releases(surface, which, kind):
    """No release of this type is possible: the empty interval."""
    surface.release.low[which, kind], surface.release.high[which, kind] = np.inf, -np.inf


@kernel
def has_release(surface, which, kind):
    """Whether a release of this type is possible."""
    return surface.release.low[which, kind] <= surface.release.high[which, kind]


@kernel
def start_releases(surface, kind):
    """Allow a release before the alarm, from anywhere in the travel."""
    clear_releases(surface, EARLIER_RELEASE, kind)
    surface.release.low[LATER_RELEASE, kind] = surface.actuator.travel_low
    surface.release.high[LATER_RELEASE, kind] = surface.actuator.travel_high
    clear_held_range(surface, kind)


@kernel
def clear_held_range(surface, kind):
    """This type does not hold the surface in the judged frame: the empty interval."""
    surface.release.held_low[kind], surface.release.held_high[kind] = np.inf, -np.inf


@kernel
def mean_return_position(config, surface, held, side=0):
    """Mean position over the judged frame of a surface released at `held` (rad), its position at the end of
    the frame, and the possible error of the mean where the effectiveness changes meanwhile.

    The release is at the beginning of the frame; with a side, at any instant of it: the least mean if
    side < 0, else the greatest.
    """
    total, count, a, least, greatest = 0.0, 0, held, held, held
    for k in range(config.length):
        order = surface.commands.given[1, k]
        for _ in range(config.instants):
            total += a
            count += 1
            least, greatest = min(least, a), max(greatest, a)
            a = nearer(a, order, surface.actuator.approach, surface.actuator.step)
            if side != 0:
                a = min(a, held) if side < 0 else max(a, held)
    return total / count, a, surface.judged.effectiveness_variation * (greatest - least)


@kernel
def block_release_explains(config, surface, kind):
    """Whether a release at an instant of the judged block explains the block."""
    held_low, held_high = surface.release.held_low[kind], surface.release.held_high[kind]
    if config.length == 1 or held_low > held_high:
        return False
    low, _, low_room = mean_return_position(config, surface, held_low, -1)
    high, _, high_room = mean_return_position(config, surface, held_high, 1)
    return low - low_room <= surface.judged.high and high + high_room >= surface.judged.low


@kernel
def return_explains(config, surface, kind):
    """Whether a return after this type explains the judged frame; forget the releases that do not."""
    left = block_release_explains(config, surface, kind)
    if not left:
        clear_held_range(surface, kind)
    for which in (EARLIER_RELEASE, LATER_RELEASE):
        if has_release(surface, which, kind):
            if narrow_return(config, surface, which, kind):
                left = True
            else:
                clear_releases(surface, which, kind)
    return left


@kernel
def narrow_return(config, surface, which, kind):
    """Whether the judged frame agrees with a return; drop the part of its interval that does not.

    The mean over the frame rises with where the return began, and by no more than that.
    """
    held = surface.release
    low, _, low_room = mean_return_position(config, surface, held.low[which, kind])
    high, _, high_room = mean_return_position(config, surface, held.high[which, kind])
    room, command = max(low_room, high_room), surface.judged.command
    if max(abs(low - room - command), abs(high + room - command)) <= RETURNED_WITHIN_RAD:
        return False
    if low - room > surface.judged.high or high + room < surface.judged.low:
        return False
    least = held.low[which, kind] + max(surface.judged.low - low - room, 0.0)
    greatest = held.high[which, kind] - max(high - room - surface.judged.high, 0.0)
    set_release_interval(held, which, kind, least, greatest)
    return True


@kernel
def promote_later_releases(surface, kind):
    """Take the later releases for the earlier ones, when no earlier one is possible any more."""
    held = surface.release
    held.low[EARLIER_RELEASE, kind], held.high[EARLIER_RELEASE, kind] = (
        held.low[LATER_RELEASE, kind],
        held.high[LATER_RELEASE, kind],
    )
    clear_releases(surface, LATER_RELEASE, kind)


@kernel
def set_release_interval(held, which, kind, low, high):
    """Replace the interval of a return by [low, high]; rounding may have swapped ends that meet."""
    held.low[which, kind], held.high[which, kind] = min(low, high), max(low, high)


@kernel
def hold_status(config, surface, kind, least, greatest):
    """Whether a type holds the surface between least and greatest (rad) in the judged frame: HELD; or has
    released it, and the actuator may be bringing it back: RETURNING; or neither explains it: REFUTED."""
    returning = config.released_returns and return_explains(config, surface, kind)
    released = surface.release.released
    if least <= surface.judged.high and greatest >= surface.judged.low and not released[kind]:
        return HELD
    if not returning:
        return REFUTED
    released[kind] = 1
    return RETURNING


@kernel
def hold_or_return_explains(config, surface, kind, least, greatest):
    """The parameters that explain the judged frame: all if the surface is held there or returns from there,
    none otherwise."""
    return EMPTY_SET if hold_status(config, surface, kind, least, greatest) == REFUTED else UNLIMITED_SET


@kernel
def position_at_frame_start(config, surface, k):
    """Where the surface can have been as the judged frame began, (low, high) rad, and which frame shows it.

    With several JSBSim frames in one of ours the release may have been within it: the frame before is used.
    """
    if config.whole:
        return surface.judged.low, surface.judged.high, k
    return surface.earlier.low, surface.earlier.high, k - 1


@kernel
def add_release(surface, kind, low, high):
    """Add a release from between low and high (rad), where a type may hold the surface, if low <= high."""
    held = surface.release
    clear_held_range(surface, kind)
    if low <= high and not held.released[kind]:
        held.held_low[kind], held.held_high[kind] = low, high
        held.low[LATER_RELEASE, kind] = min(held.low[LATER_RELEASE, kind], low)
        held.high[LATER_RELEASE, kind] = max(held.high[LATER_RELEASE, kind], high)


@kernel
def propagate_returns(config, surface, kind):
    """Carry the intervals of returns to the next frame; a surface that looks healthy may be held again."""
    held = surface.release
    if not surface.judged.anomalous:
        held.released[kind] = 0
    for which in (EARLIER_RELEASE, LATER_RELEASE):
        if has_release(surface, which, kind):
            _, low, _ = mean_return_position(config, surface, held.low[which, kind])
            _, high, _ = mean_return_position(config, surface, held.high[which, kind])
            set_release_interval(held, which, kind, low, high)
    if config.length > 1 and held.held_low[kind] <= held.held_high[kind]:
        _, low, _ = mean_return_position(config, surface, held.held_low[kind], -1)
        _, high, _ = mean_return_position(config, surface, held.held_high[kind], 1)
        held.low[LATER_RELEASE, kind] = min(held.low[LATER_RELEASE, kind], low)
        held.high[LATER_RELEASE, kind] = max(held.high[LATER_RELEASE, kind], high)


@kernel
def travel_range(surface):
    """It may be anywhere in its travel, rad."""
    return surface.actuator.travel_low, surface.actuator.travel_high


@kernel
def begin_stuck(surface, kind):
    """It may be anywhere in its travel."""
    surface.stuck.kept_low[:], surface.stuck.kept_high[:] = travel_range(surface)
    start_releases(surface, kind)


@kernel
def judge_stuck(config, surface, kind, k):
    """It stays where it is."""
    status = hold_status(config, surface, kind, surface.feasible.low[kind], surface.feasible.high[kind])
    if status == HELD:
        return surface.judged.low, surface.judged.high
    return EMPTY_SET if status == REFUTED else UNLIMITED_SET


@kernel
def on_release_stuck(config, surface, kind, k):
    """It may be released where it is jammed."""
    promote_kept_sets(surface, kind)
    low, high, _ = position_at_frame_start(config, surface, k)
    add_release(surface, kind, max(low, surface.feasible.low[kind]), min(high, surface.feasible.high[kind]))


@kernel
def promote_kept_sets(surface, kind):
    """When no earlier release is possible any more, the later ones are the earlier ones."""
    jam = surface.stuck
    if not has_release(surface, EARLIER_RELEASE, kind):
        jam.kept_low[EARLIER_RELEASE], jam.kept_high[EARLIER_RELEASE] = (
            jam.kept_low[LATER_RELEASE],
            jam.kept_high[LATER_RELEASE],
        )
        jam.kept_low[LATER_RELEASE], jam.kept_high[LATER_RELEASE] = (
            surface.feasible.low[kind],
            surface.feasible.high[kind],
        )
        promote_later_releases(surface, kind)


@kernel
def restored_set(surface, kind):
    """Where the surface looks healthy the jam may take hold again: its set as it was before the earliest
    release still possible."""
    if not surface.judged.anomalous:
        for which in (EARLIER_RELEASE, LATER_RELEASE):
            if has_release(surface, which, kind):
                return surface.stuck.kept_low[which], surface.stuck.kept_high[which]
    return surface.feasible.low[kind], surface.feasible.high[kind]


@kernel
def stuck_deflection(config, surface, kind, k):
    """Where it is jammed."""
    return surface.feasible.low[kind], surface.feasible.high[kind]


@kernel
def judge_float(config, surface, kind, k):
    """It is at neutral, or at the stop that is nearest to it."""
    neutral = within_travel(surface, 0.0)
    return hold_or_return_explains(config, surface, kind, neutral, neutral)


@kernel
def on_release_float(config, surface, kind, k):
    """It may be released at neutral."""
    low, high, _ = position_at_frame_start(config, surface, k)
    neutral = within_travel(surface, 0.0)
    add_release(surface, kind, max(low, neutral), min(high, neutral))


@kernel
def float_deflection(config, surface, kind, k):
    """At neutral."""
    neutral = within_travel(surface, 0.0)
    return neutral, neutral


def neutral_deflection(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    surface = fdi["types"]["surface"][s]
    return float(min(max(0.0, surface["actuator"]["travel_low"]), surface["actuator"]["travel_high"]))


@kernel
def stuck_error(surface, kind):
    """Off its command, rad, by the middle of where it can be jammed."""
    return set_middle(surface, kind) - surface.elapsed.command


@kernel
def float_error(surface, kind):
    """Off its command, rad: at neutral."""
    return within_travel(surface, 0.0) - surface.elapsed.command


STUCK = FaultType(
    name="stuck", constant=True, rank=2,
    whole_range=travel_range, begin=begin_stuck, judge=judge_stuck, restored=restored_set,
    record="stuck", memory=record(kept_low=2, kept_high=2),  # rad; EARLIER and LATER
    on_release=on_release_stuck, propagate_release=propagate_returns, deflection=stuck_deflection,
    at_rest=REST_AGREES,
    accommodation=GIVE_UP, expected_error=stuck_error, error_rank=3, estimate=set_middle_of,
    interval=feasible_set,
)  # fmt: skip
FLOAT = FaultType(
    name="float", constant=True, rank=3,
    begin=start_releases, judge=judge_float, on_release=on_release_float, propagate_release=propagate_returns,
    deflection=float_deflection,
    accommodation=SUBTRACT_OFFSET, also=(GIVE_UP, SCALE_COMMAND), expected_error=float_error, error_rank=1,
    estimate=neutral_deflection,
)  # fmt: skip


@kernel
def runaway_travel(config, surface, k):
    """The least way (rad) a runaway has gone by a frame; over a block the mean was reached within it."""
    elapsed = k - surface.evidence.started_at
    if config.length > 1:
        elapsed = max(elapsed - 1, 0)
    return surface.actuator.least_runaway_rate * config.block_s * elapsed


@kernel
def least_upward_deflection(config, surface, k):
    """How far up a runaway has come by a frame, at least: rad, the stop at most."""
    if surface.evidence.started_at < 0:
        return surface.actuator.travel_low
    return min(surface.actuator.travel_high, surface.evidence.start_low + runaway_travel(config, surface, k))


@kernel
def least_downward_deflection(config, surface, k):
    """How far down one has come: rad, the stop at most."""
    if surface.evidence.started_at < 0:
        return surface.actuator.travel_high
    return max(surface.actuator.travel_low, surface.evidence.start_high - runaway_travel(config, surface, k))


@kernel
def judge_hardover_up(config, surface, kind, k):
    """It is beyond where its least rate takes it, or at the stop."""
    return hold_or_return_explains(
        config, surface, kind, least_upward_deflection(config, surface, k), surface.actuator.travel_high
    )


@kernel
def judge_hardover_down(config, surface, kind, k):
    """The same downwards."""
    return hold_or_return_explains(
        config, surface, kind, surface.actuator.travel_low, least_downward_deflection(config, surface, k)
    )


@kernel
def on_release_hardover_up(config, surface, kind, k):
    """It may be released on its way; within a frame of several instants, further on."""
    low, high, shown = position_at_frame_start(config, surface, k)
    low = max(low, least_upward_deflection(config, surface, shown))
    if not config.whole and low <= high:
        high = surface.actuator.travel_high
    add_release(surface, kind, low, high)


@kernel
def on_release_hardover_down(config, surface, kind, k):
    """The same downwards."""
    low, high, shown = position_at_frame_start(config, surface, k)
    high = min(high, least_downward_deflection(config, surface, shown))
    if not config.whole and low <= high:
        low = surface.actuator.travel_low
    add_release(surface, kind, low, high)


@kernel
def hardover_up_deflection(config, surface, kind, k):
    """Between its least way and the stop."""
    return least_upward_deflection(config, surface, k), surface.actuator.travel_high


@kernel
def hardover_down_deflection(config, surface, kind, k):
    """The same downwards."""
    return surface.actuator.travel_low, least_downward_deflection(config, surface, k)


def upper_stop_rad(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_high"])


def lower_stop_rad(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_low"])


HARDOVER_UP = FaultType(
    name="hardover", words="hardover up", constant=True, rank=4,
    begin=start_releases, judge=judge_hardover_up, on_release=on_release_hardover_up,
    propagate_release=propagate_returns, deflection=hardover_up_deflection, direction=1,
    accommodation=GIVE_UP, estimate=upper_stop_rad,
)  # fmt: skip
HARDOVER_DOWN = FaultType(
    name="hardover", words="hardover down", constant=True, rank=5,
    begin=start_releases, judge=judge_hardover_down, on_release=on_release_hardover_down,
    propagate_release=propagate_returns, deflection=hardover_down_deflection, direction=-1,
    accommodation=GIVE_UP, estimate=lower_stop_rad,
)  # fmt: skip
TYPES = STUCK, FLOAT, HARDOVER_UP, HARDOVER_DOWN
