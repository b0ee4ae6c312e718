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
from beaver_ftc.diagnosis.types import (
    EMPTY_SET,
    GIVE_UP,
    REST_POSITION_IS_PARAMETER,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    UNLIMITED_SET,
    DeflectionRelation,
    FaultType,
    feasible_set,
    feasible_set_midpoint,
    limit_to_travel,
    midpoint_parameter_estimate,
)

EARLIER_RELEASES_SLOT, LATER_RELEASES_SLOT = 0, 1
STATUS_HELD, STATUS_RETURNING, STATUS_REFUTED = range(3)
# A surface nearer than this to a healthy one counts as healthy: its effect is below the rounding bound.
HEALTHY_POSITION_TOLERANCE_RAD = 1e-14


@kernel
def clear_releases(surface, release_slot_index, type_index):
    """No release of this type is possible: the empty interval."""
    (
        surface.release.return_position_low[release_slot_index, type_index],
        surface.release.return_position_high[release_slot_index, type_index],
    ) = np.inf, -np.inf


@kernel
def is_release_possible(surface, release_slot_index, type_index):
    """Whether a release of this type is possible."""
    return (
        surface.release.return_position_low[release_slot_index, type_index]
        <= surface.release.return_position_high[release_slot_index, type_index]
    )


@kernel
def allow_release_before_alarm(surface, type_index):
    """Allow a release before the alarm, from anywhere in the travel."""
    clear_releases(surface, EARLIER_RELEASES_SLOT, type_index)
    surface.release.return_position_low[LATER_RELEASES_SLOT, type_index] = surface.actuator.travel_low
    surface.release.return_position_high[LATER_RELEASES_SLOT, type_index] = surface.actuator.travel_high
    set_held_position_interval_empty(surface, type_index)


@kernel
def set_held_position_interval_empty(surface, type_index):
    """This type does not hold the surface in the judged frame: the empty interval."""
    surface.release.held_position_min[type_index], surface.release.held_position_max[type_index] = (
        np.inf,
        -np.inf,
    )


@kernel
def simulate_return_in_frame(config, surface, start_position, mean_extreme_sign=0):
    """Mean position over the judged frame of a surface released at `start_position` (rad), its position at
    the end of the frame, and the possible error of the mean where the effectiveness changes meanwhile.

    The release is at the beginning of the frame; with a mean_extreme_sign, at any instant of it: the least
    mean if it is -1, the greatest if it is 1.
    """
    position_sum = 0.0
    n_positions = 0
    position = start_position
    min_position = start_position
    max_position = start_position
    for frame_in_block in range(config.frames_per_block):
        command = surface.commands.command_history[1, frame_in_block]
        for _ in range(config.n_substeps):
            position_sum += position
            n_positions += 1
            min_position, max_position = min(min_position, position), max(max_position, position)
            position = nearer(
                position,
                command,
                surface.actuator.approach_share_per_substep,
                surface.actuator.max_motion_per_substep,
            )
            if mean_extreme_sign != 0:
                position = (
                    min(position, start_position)
                    if mean_extreme_sign == -1
                    else max(position, start_position)
                )
    return (
        position_sum / n_positions,
        position,
        surface.judged_observation.weighted_mean_error_per_position_range * (max_position - min_position),
    )


@kernel
def release_within_block_explains_block(config, surface, type_index):
    """Whether a release at an instant of the judged block explains the block."""
    held_position_min = surface.release.held_position_min[type_index]
    held_position_max = surface.release.held_position_max[type_index]
    if config.frames_per_block == 1 or held_position_min > held_position_max:
        return False
    lowest_mean_position, _, tolerance_of_lowest_mean = simulate_return_in_frame(
        config, surface, held_position_min, -1
    )
    highest_mean_position, _, tolerance_of_highest_mean = simulate_return_in_frame(
        config, surface, held_position_max, 1
    )
    return (
        lowest_mean_position - tolerance_of_lowest_mean <= surface.judged_observation.position_high
        and highest_mean_position + tolerance_of_highest_mean >= surface.judged_observation.position_low
    )


@kernel
def drop_refuted_releases_and_test_return(config, surface, type_index):
    """Whether a return after this type explains the judged frame; forget the releases that do not."""
    is_explained = release_within_block_explains_block(config, surface, type_index)
    if not is_explained:
        set_held_position_interval_empty(surface, type_index)
    for release_slot_index in (EARLIER_RELEASES_SLOT, LATER_RELEASES_SLOT):
        if is_release_possible(surface, release_slot_index, type_index):
            if narrow_and_test_return_interval(config, surface, release_slot_index, type_index):
                is_explained = True
            else:
                clear_releases(surface, release_slot_index, type_index)
    return is_explained


@kernel
def narrow_and_test_return_interval(config, surface, release_slot_index, type_index):
    """Whether the judged frame agrees with a return; drop the part of its interval that does not.

    The mean over the frame rises with where the return began, and by no more than that.
    """
    releases_by_type = surface.release
    mean_position_from_low, _, mean_position_tolerance_from_low = simulate_return_in_frame(
        config, surface, releases_by_type.return_position_low[release_slot_index, type_index]
    )
    mean_position_from_high, _, mean_position_tolerance_from_high = simulate_return_in_frame(
        config, surface, releases_by_type.return_position_high[release_slot_index, type_index]
    )
    mean_position_tolerance = max(mean_position_tolerance_from_low, mean_position_tolerance_from_high)
    healthy_position = surface.judged_observation.healthy_position
    if (
        max(
            abs(mean_position_from_low - mean_position_tolerance - healthy_position),
            abs(mean_position_from_high + mean_position_tolerance - healthy_position),
        )
        <= HEALTHY_POSITION_TOLERANCE_RAD
    ):
        return False
    if (
        mean_position_from_low - mean_position_tolerance > surface.judged_observation.position_high
        or mean_position_from_high + mean_position_tolerance < surface.judged_observation.position_low
    ):
        return False
    narrowed_low = releases_by_type.return_position_low[release_slot_index, type_index] + max(
        surface.judged_observation.position_low - mean_position_from_low - mean_position_tolerance, 0.0
    )
    narrowed_high = releases_by_type.return_position_high[release_slot_index, type_index] - max(
        mean_position_from_high - mean_position_tolerance - surface.judged_observation.position_high, 0.0
    )
    set_returning_position_interval(
        releases_by_type, release_slot_index, type_index, narrowed_low, narrowed_high
    )
    return True


@kernel
def replace_earlier_releases_by_later(surface, type_index):
    """Take the later releases for the earlier ones, when no earlier one is possible any more."""
    releases_by_type = surface.release
    (
        releases_by_type.return_position_low[EARLIER_RELEASES_SLOT, type_index],
        releases_by_type.return_position_high[EARLIER_RELEASES_SLOT, type_index],
    ) = (
        releases_by_type.return_position_low[LATER_RELEASES_SLOT, type_index],
        releases_by_type.return_position_high[LATER_RELEASES_SLOT, type_index],
    )
    clear_releases(surface, LATER_RELEASES_SLOT, type_index)


@kernel
def set_returning_position_interval(
    releases_by_type, release_slot_index, type_index, return_position_low, return_position_high
):
    """Replace the interval of the positions of a return, rad; rounding may have swapped ends that meet."""
    (
        releases_by_type.return_position_low[release_slot_index, type_index],
        releases_by_type.return_position_high[release_slot_index, type_index],
    ) = (
        min(return_position_low, return_position_high),
        max(return_position_low, return_position_high),
    )


@kernel
def update_held_status(config, surface, type_index, held_position_min, held_position_max):
    """Whether a type holds the surface between these positions (rad) in the judged frame: STATUS_HELD; or has
    released it, and the actuator may be bringing it back: STATUS_RETURNING; or neither explains it:
    STATUS_REFUTED."""
    is_return_possible = (
        config.released_surface_returns_via_actuator
        and drop_refuted_releases_and_test_return(config, surface, type_index)
    )
    has_released_by_type = surface.release.has_released
    if (
        held_position_min <= surface.judged_observation.position_high
        and held_position_max >= surface.judged_observation.position_low
        and not has_released_by_type[type_index]
    ):
        return STATUS_HELD
    if not is_return_possible:
        return STATUS_REFUTED
    has_released_by_type[type_index] = 1
    return STATUS_RETURNING


@kernel
def update_releases_returning_consistent_interval(
    config, surface, type_index, held_position_min, held_position_max
):
    """The parameters that explain the judged frame: all if the surface is held there or returns from there,
    none otherwise."""
    return (
        EMPTY_SET
        if update_held_status(config, surface, type_index, held_position_min, held_position_max)
        == STATUS_REFUTED
        else UNLIMITED_SET
    )


@kernel
def position_interval_at_frame_start_and_its_frame(config, surface, k):
    """Return the possible position at the start of the judged frame, (low, high) rad, and the frame that
    shows it.

    With several JSBSim frames in one of ours the release may have been within it: the frame before is used.
    """
    if config.frame_shows_single_instant:
        return surface.judged_observation.position_low, surface.judged_observation.position_high, k
    return surface.earlier_observation.position_low, surface.earlier_observation.position_high, k - 1


@kernel
def add_release(surface, type_index, held_position_min, held_position_max):
    """Add a release from between held_position_min and held_position_max (rad), where a type may hold the
    surface, if the interval is not empty."""
    releases_by_type = surface.release
    set_held_position_interval_empty(surface, type_index)
    if held_position_min <= held_position_max and not releases_by_type.has_released[type_index]:
        releases_by_type.held_position_min[type_index], releases_by_type.held_position_max[type_index] = (
            held_position_min,
            held_position_max,
        )
        releases_by_type.return_position_low[LATER_RELEASES_SLOT, type_index] = min(
            releases_by_type.return_position_low[LATER_RELEASES_SLOT, type_index], held_position_min
        )
        releases_by_type.return_position_high[LATER_RELEASES_SLOT, type_index] = max(
            releases_by_type.return_position_high[LATER_RELEASES_SLOT, type_index], held_position_max
        )


@kernel
def propagate_returns(config, surface, type_index):
    """Carry the intervals of returns to the next frame; a surface that looks healthy may be held again."""
    releases_by_type = surface.release
    if not surface.judged_observation.is_anomalous:
        releases_by_type.has_released[type_index] = 0
    for release_slot_index in (EARLIER_RELEASES_SLOT, LATER_RELEASES_SLOT):
        if is_release_possible(surface, release_slot_index, type_index):
            _, frame_end_position_low, _ = simulate_return_in_frame(
                config, surface, releases_by_type.return_position_low[release_slot_index, type_index]
            )
            _, frame_end_position_high, _ = simulate_return_in_frame(
                config, surface, releases_by_type.return_position_high[release_slot_index, type_index]
            )
            set_returning_position_interval(
                releases_by_type,
                release_slot_index,
                type_index,
                frame_end_position_low,
                frame_end_position_high,
            )
    if (
        config.frames_per_block > 1
        and releases_by_type.held_position_min[type_index] <= releases_by_type.held_position_max[type_index]
    ):
        _, frame_end_position_low, _ = simulate_return_in_frame(
            config, surface, releases_by_type.held_position_min[type_index], -1
        )
        _, frame_end_position_high, _ = simulate_return_in_frame(
            config, surface, releases_by_type.held_position_max[type_index], 1
        )
        releases_by_type.return_position_low[LATER_RELEASES_SLOT, type_index] = min(
            releases_by_type.return_position_low[LATER_RELEASES_SLOT, type_index], frame_end_position_low
        )
        releases_by_type.return_position_high[LATER_RELEASES_SLOT, type_index] = max(
            releases_by_type.return_position_high[LATER_RELEASES_SLOT, type_index], frame_end_position_high
        )


@kernel
def travel_range(surface):
    """Return the whole travel of the surface as its possible interval, rad."""
    return surface.actuator.travel_low, surface.actuator.travel_high


@kernel
def reset_stuck_memory(surface, type_index):
    """Set the possible jammed positions to the whole travel of the surface."""
    surface.stuck.feasible_low_before_release[:], surface.stuck.feasible_high_before_release[:] = (
        travel_range(surface)
    )
    allow_release_before_alarm(surface, type_index)


@kernel
def update_stuck_returning_consistent_interval(config, surface, type_index, k):
    """It stays where it is."""
    held_status = update_held_status(
        config,
        surface,
        type_index,
        surface.feasible_sets.low[type_index],
        surface.feasible_sets.high[type_index],
    )
    if held_status == STATUS_HELD:
        return surface.judged_observation.position_low, surface.judged_observation.position_high
    return EMPTY_SET if held_status == STATUS_REFUTED else UNLIMITED_SET


@kernel
def add_stuck_release(config, surface, type_index, k):
    """Add a release from the interval of the jammed position."""
    replace_impossible_release_and_store_set(surface, type_index)
    frame_start_position_low, frame_start_position_high, _ = position_interval_at_frame_start_and_its_frame(
        config, surface, k
    )
    add_release(
        surface,
        type_index,
        max(frame_start_position_low, surface.feasible_sets.low[type_index]),
        min(frame_start_position_high, surface.feasible_sets.high[type_index]),
    )


@kernel
def replace_impossible_release_and_store_set(surface, type_index):
    """When no earlier release is possible any more, the later ones are the earlier ones."""
    memory = surface.stuck
    if not is_release_possible(surface, EARLIER_RELEASES_SLOT, type_index):
        (
            memory.feasible_low_before_release[EARLIER_RELEASES_SLOT],
            memory.feasible_high_before_release[EARLIER_RELEASES_SLOT],
        ) = (
            memory.feasible_low_before_release[LATER_RELEASES_SLOT],
            memory.feasible_high_before_release[LATER_RELEASES_SLOT],
        )
        (
            memory.feasible_low_before_release[LATER_RELEASES_SLOT],
            memory.feasible_high_before_release[LATER_RELEASES_SLOT],
        ) = (
            surface.feasible_sets.low[type_index],
            surface.feasible_sets.high[type_index],
        )
        replace_earlier_releases_by_later(surface, type_index)


@kernel
def stuck_set_after_frame(surface, type_index):
    """Return the set of a jam that may begin again where the surface looks healthy: its set as it was before
    the earliest release still possible."""
    if not surface.judged_observation.is_anomalous:
        for release_slot_index in (EARLIER_RELEASES_SLOT, LATER_RELEASES_SLOT):
            if is_release_possible(surface, release_slot_index, type_index):
                return surface.stuck.feasible_low_before_release[
                    release_slot_index
                ], surface.stuck.feasible_high_before_release[release_slot_index]
    return surface.feasible_sets.low[type_index], surface.feasible_sets.high[type_index]


@kernel
def stuck_deflection_range(config, surface, type_index, k):
    """Return the interval of the jammed position, rad."""
    return surface.feasible_sets.low[type_index], surface.feasible_sets.high[type_index]


@kernel
def update_float_returning_consistent_interval(config, surface, type_index, k):
    """It is at neutral, or at the stop that is nearest to it."""
    neutral_position = limit_to_travel(surface, 0.0)
    return update_releases_returning_consistent_interval(
        config, surface, type_index, neutral_position, neutral_position
    )


@kernel
def add_float_release(config, surface, type_index, k):
    """Add a release from the neutral position."""
    frame_start_position_low, frame_start_position_high, _ = position_interval_at_frame_start_and_its_frame(
        config, surface, k
    )
    neutral_position = limit_to_travel(surface, 0.0)
    add_release(
        surface,
        type_index,
        max(frame_start_position_low, neutral_position),
        min(frame_start_position_high, neutral_position),
    )


@kernel
def float_deflection_range(config, surface, type_index, k):
    """At neutral."""
    neutral_position = limit_to_travel(surface, 0.0)
    return neutral_position, neutral_position


def neutral_position_rad(travel_low: float, travel_high: float) -> float:
    """Neutral, or the stop that is nearest to it, rad."""
    return min(max(0.0, travel_low), travel_high)


def neutral_deflection_rad(fdi: np.void, s: int, type_index: int) -> float | None:
    """Deflection, rad."""
    surface = fdi["types"]["surface"][s]
    return float(neutral_position_rad(surface["actuator"]["travel_low"], surface["actuator"]["travel_high"]))


@kernel
def stuck_deflection_error(surface, type_index):
    """Middle of the interval of the jammed position minus the command, rad."""
    return feasible_set_midpoint(surface, type_index) - surface.last_observation.healthy_position


@kernel
def float_deflection_error(surface, type_index):
    """Neutral position minus the command, rad."""
    return limit_to_travel(surface, 0.0) - surface.last_observation.healthy_position


STUCK = FaultType(
    name="stuck", has_constant_parameter=True, sort_rank=2,
    parameter_range=travel_range, reset_memory=reset_stuck_memory,
    consistent_interval=update_stuck_returning_consistent_interval,
    feasible_set_after_frame=stuck_set_after_frame,
    # rad; EARLIER and LATER
    memory_record_name="stuck", memory_dtype=record(feasible_low_before_release=2,
    feasible_high_before_release=2),
    on_possible_release=add_stuck_release, propagate_release=propagate_returns,
    possible_deflection_range=stuck_deflection_range,
    evidence_at_rest=REST_POSITION_IS_PARAMETER,
    accommodation_mode=GIVE_UP, deflection_error=stuck_deflection_error, deflection_error_precedence=3,
    deflection_relation=DeflectionRelation(
        0.0, theta_is_share=False, theta_range_for_travel=lambda low, high: (low, high)
    ),
    estimate_parameter=midpoint_parameter_estimate, estimate_parameter_interval=feasible_set,
)  # fmt: skip
FLOAT = FaultType(
    name="float", has_constant_parameter=True, sort_rank=3,
    reset_memory=allow_release_before_alarm, consistent_interval=update_float_returning_consistent_interval,
    on_possible_release=add_float_release, propagate_release=propagate_returns,
    possible_deflection_range=float_deflection_range,
    accommodation_mode=SUBTRACT_OFFSET, other_accommodation_modes=(GIVE_UP, SCALE_COMMAND),
    deflection_error=float_deflection_error,
    deflection_error_precedence=1,
    deflection_relation=DeflectionRelation(
        0.0,
        theta_is_share=False,
        theta_range_for_travel=lambda low, high: (neutral_position_rad(low, high),) * 2
    ),
    estimate_parameter=neutral_deflection_rad,
)  # fmt: skip


@kernel
def min_runaway_distance(config, surface, k):
    """The least way (rad) a runaway has gone by a frame; over a block the mean was reached within it."""
    min_runaway_frames = k - surface.evidence.first_anomalous_frame
    if config.frames_per_block > 1:
        min_runaway_frames = max(min_runaway_frames - 1, 0)
    return surface.actuator.min_runaway_rate * config.block_duration_s * min_runaway_frames


@kernel
def runaway_up_lower_limit(config, surface, frame_index):
    """Return the least upward deflection of a runaway by a frame, rad; the stop at most."""
    if surface.evidence.first_anomalous_frame < 0:
        return surface.actuator.travel_low
    return min(
        surface.actuator.travel_high,
        surface.evidence.first_anomalous_position_low + min_runaway_distance(config, surface, frame_index),
    )


@kernel
def runaway_down_upper_limit(config, surface, frame_index):
    """Return the least downward deflection of a runaway by a frame, rad; the stop at most."""
    if surface.evidence.first_anomalous_frame < 0:
        return surface.actuator.travel_high
    return max(
        surface.actuator.travel_low,
        surface.evidence.first_anomalous_position_high - min_runaway_distance(config, surface, frame_index),
    )


@kernel
def update_hardover_up_and_interval(config, surface, type_index, k):
    """Interval of a runaway upwards: beyond its travel at the least rate, or at the stop, rad."""
    return update_releases_returning_consistent_interval(
        config,
        surface,
        type_index,
        runaway_up_lower_limit(config, surface, k),
        surface.actuator.travel_high,
    )


@kernel
def update_hardover_down_and_interval(config, surface, type_index, k):
    """The same downwards."""
    return update_releases_returning_consistent_interval(
        config,
        surface,
        type_index,
        surface.actuator.travel_low,
        runaway_down_upper_limit(config, surface, k),
    )


@kernel
def add_hardover_up_release(config, surface, type_index, k):
    """It may be released on its way; within a frame of several instants, further on."""
    start_position_low, start_position_high, start_position_frame_index = (
        position_interval_at_frame_start_and_its_frame(config, surface, k)
    )
    start_position_low = max(
        start_position_low, runaway_up_lower_limit(config, surface, start_position_frame_index)
    )
    if not config.frame_shows_single_instant and start_position_low <= start_position_high:
        start_position_high = surface.actuator.travel_high
    add_release(surface, type_index, start_position_low, start_position_high)


@kernel
def add_hardover_down_release(config, surface, type_index, k):
    """The same downwards."""
    start_position_low, start_position_high, start_position_frame_index = (
        position_interval_at_frame_start_and_its_frame(config, surface, k)
    )
    start_position_high = min(
        start_position_high, runaway_down_upper_limit(config, surface, start_position_frame_index)
    )
    if not config.frame_shows_single_instant and start_position_low <= start_position_high:
        start_position_low = surface.actuator.travel_low
    add_release(surface, type_index, start_position_low, start_position_high)


@kernel
def hardover_up_deflection_range(config, surface, type_index, k):
    """Between its least way and the stop."""
    return runaway_up_lower_limit(config, surface, k), surface.actuator.travel_high


@kernel
def hardover_down_deflection_range(config, surface, type_index, k):
    """The same downwards."""
    return surface.actuator.travel_low, runaway_down_upper_limit(config, surface, k)


def upper_stop_deflection_rad(fdi: np.void, s: int, type_index: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_high"])


def lower_stop_deflection_rad(fdi: np.void, s: int, type_index: int) -> float | None:
    """Deflection, rad."""
    return float(fdi["types"]["surface"][s]["actuator"]["travel_low"])


HARDOVER_UP = FaultType(
    name="hardover", description="hardover up", has_constant_parameter=True, sort_rank=4,
    reset_memory=allow_release_before_alarm, consistent_interval=update_hardover_up_and_interval,
    on_possible_release=add_hardover_up_release,
    propagate_release=propagate_returns, possible_deflection_range=hardover_up_deflection_range,
    stop_direction=1,
    accommodation_mode=GIVE_UP, multi_frame_exclusion_test_name="runaway",
    estimate_parameter=upper_stop_deflection_rad,
)  # fmt: skip
HARDOVER_DOWN = FaultType(
    name="hardover", description="hardover down", has_constant_parameter=True, sort_rank=5,
    reset_memory=allow_release_before_alarm, consistent_interval=update_hardover_down_and_interval,
    on_possible_release=add_hardover_down_release,
    propagate_release=propagate_returns, possible_deflection_range=hardover_down_deflection_range,
    stop_direction=-1,
    accommodation_mode=GIVE_UP, multi_frame_exclusion_test_name="runaway",
    estimate_parameter=lower_stop_deflection_rad,
)  # fmt: skip
TYPES = STUCK, FLOAT, HARDOVER_UP, HARDOVER_DOWN
