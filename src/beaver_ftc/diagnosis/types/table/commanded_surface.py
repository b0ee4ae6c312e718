"""Surfaces that move by their command, but wrongly: loss, bias, oscillation, rate limit.

*Loss of effectiveness*: p = (1 + theta) u, one 1 + theta in [0, 1], or any in every frame (incipient).

*Bias*: p = u + b, cut off by the stops; b constant, or of one sign and never smaller than before. At a stop
an offset that grows looks like a runaway. The speed on the way to the stop distinguishes them: an offset that
grows almost as fast as a runaway counts as one.

*Oscillation*: p - u swings about 0, no half-cycle longer than that of the slowest oscillation. Counting
half-cycles above a level that noise cannot reach is how oscillatory failures are monitored in service
[Goupil2010].

*Rate limit*: p moves only towards its command, at any rate down to the slowest declared. A slower surface
counts as stuck: the two types are each other's limit, and only a least rate distinguishes them.
"""

from math import pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.types import (
    EMPTY_SET,
    REST_EXCLUDES_TYPE,
    REST_HIDES_TYPE,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    UNLIMITED_SET,
    WAIT_FOR_SURFACE,
    DeflectionRelation,
    FaultType,
    feasible_set,
    feasible_set_midpoint,
    limit_to_travel,
    midpoint_parameter_estimate,
    read_last_midpoint_deflection_error,
)


@kernel
def effectiveness_interval_of_judged_frame(surface):
    """The interval of 1 + theta in [0, 1] that agrees with the judged frame; low > high if none."""
    position_low = surface.judged_observation.position_low
    position_high = surface.judged_observation.position_high
    return isolation.consistent_theta(
        0.5 * (position_low + position_high),
        0.5 * (position_high - position_low),
        surface.judged_observation.healthy_position,
        0.0,
        1.0,
    )


@kernel
def effectiveness_range(surface):
    """Return the range of 1 + theta: 0 to 1."""
    return 0.0, 1.0


@kernel
def consistent_loss_interval(config, surface, type_index, k):
    """The effectiveness that explains this frame."""
    return effectiveness_interval_of_judged_frame(surface)


@kernel
def loss_deflection_range(config, surface, type_index, k):
    """The command times what can be left."""
    effectiveness_low = surface.feasible_sets.low[type_index]
    effectiveness_high = surface.feasible_sets.high[type_index]
    healthy_position = surface.last_observation.healthy_position
    return min(effectiveness_low * healthy_position, effectiveness_high * healthy_position), max(
        effectiveness_low * healthy_position, effectiveness_high * healthy_position
    )


@kernel
def varying_loss_unlimited_or_empty_set(config, surface, type_index, k):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    effectiveness_low, effectiveness_high = effectiveness_interval_of_judged_frame(surface)
    healthy_position_changed_sign = (
        config.frames_per_block > 1
        and surface.commands.min_healthy_position[1] < 0.0 < surface.commands.max_healthy_position[1]
    )
    return (
        EMPTY_SET
        if effectiveness_low > effectiveness_high and not healthy_position_changed_sign
        else UNLIMITED_SET
    )


def effectiveness_minus_one_estimate(fdi: np.void, s: int, type_index: int) -> float | None:
    """theta; with a second fault present the estimator, which fits all axes of its surface, is not used."""
    return (
        midpoint_parameter_estimate(fdi, s, type_index) - 1.0
        if fdi["types"]["pair"]["enabled"]
        else effectiveness_minus_one_from_estimator(fdi, s, type_index)
    )


def effectiveness_minus_one_from_estimator(fdi: np.void, s: int, type_index: int) -> float:
    """theta as the estimator of a loss has it."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def effectiveness_minus_one_interval(fdi: np.void, s: int, type_index: int) -> tuple[float, float] | None:
    """Return the interval of theta, or None."""
    effectiveness_low, effectiveness_high = feasible_set(fdi, s, type_index)
    return effectiveness_low - 1.0, effectiveness_high - 1.0


LOSS_DEFLECTION_RELATION = DeflectionRelation(
    command_gain=1.0, theta_is_share=True, theta_range_for_travel=lambda low, high: (-1.0, 0.0)
)
LOSS = FaultType(
    name="loss_of_effectiveness", has_constant_parameter=True, sort_rank=1,
    parameter_range=effectiveness_range, consistent_interval=consistent_loss_interval,
    possible_deflection_range=loss_deflection_range,
    accommodation_mode=SCALE_COMMAND, type_name_at_end_of_range="float",
    deflection_relation=LOSS_DEFLECTION_RELATION, estimate_parameter=effectiveness_minus_one_estimate,
    estimate_parameter_interval=effectiveness_minus_one_interval,
)  # fmt: skip
VARYING_LOSS = FaultType(
    name="loss_of_effectiveness", description="loss_of_effectiveness that varies",
    has_constant_parameter=False, sort_rank=1,
    consistent_interval=varying_loss_unlimited_or_empty_set, half_cycles_before_isolating_other_surface=2,
    accommodation_mode=SCALE_COMMAND, deflection_relation=LOSS_DEFLECTION_RELATION,
    estimate_parameter=effectiveness_minus_one_from_estimator,
)  # fmt: skip


# times the least rate of a runaway, half of the rate limit at which it runs
MAX_BIAS_GROWTH_PER_MIN_RUNAWAY_RATE = 1.8


@kernel
def offset_interval_of_judged_frame(surface):
    """Return the deflection error of the surface in the judged frame, (low, high) rad: unlimited at a stop.

    A surface at its stop may be off by more than it shows; so may one that was there at an instant of it.
    Nothing but a loss takes it beyond.
    """
    position_low = surface.judged_observation.position_low
    position_high = surface.judged_observation.position_high
    healthy_position = surface.judged_observation.healthy_position
    command_record = surface.commands
    if position_high < surface.actuator.travel_low or position_low > surface.actuator.travel_high:
        return isolation.NO_THETA
    min_actual_position_within_frame = position_low - max(
        healthy_position - command_record.min_healthy_position[1], 0.0
    )
    max_actual_position_within_frame = position_high + max(
        command_record.max_healthy_position[1] - healthy_position, 0.0
    )
    offset_low = (
        position_low - healthy_position
        if min_actual_position_within_frame > surface.actuator.travel_low
        else -np.inf
    )
    return (
        offset_low,
        position_high - healthy_position
        if max_actual_position_within_frame < surface.actuator.travel_high
        else np.inf,
    )


@kernel
def bias_interval_of_judged_frame(config, surface, type_index, k):
    """The offsets that explain this frame."""
    return offset_interval_of_judged_frame(surface)


@kernel
def bias_midpoint_or_infinity(surface, type_index):
    """Off its command, rad, by the middle of its set; unlimited while an end of that is open."""
    offset_low, offset_high = surface.feasible_sets.low[type_index], surface.feasible_sets.high[type_index]
    return feasible_set_midpoint(surface, type_index) if offset_high - offset_low < np.inf else np.inf


@kernel
def bias_deflection_range(config, surface, type_index, k):
    """The command and the offset, cut off by the stops."""
    deflection_low = mean_deflection_with_offset(
        surface, surface.feasible_sets.low[type_index], surface.commands.min_healthy_position[0]
    )
    return deflection_low, mean_deflection_with_offset(
        surface, surface.feasible_sets.high[type_index], surface.commands.max_healthy_position[0]
    )


@kernel
def mean_deflection_with_offset(surface, offset_rad, extreme_healthy_position):
    """Return the mean deflection with an offset (rad); if a stop is met at an instant, that at
    `extreme_healthy_position`."""
    command_record = surface.commands
    actuator_limits = surface.actuator
    mean_deflection = surface.last_observation.healthy_position + offset_rad
    meets_stop = (
        command_record.min_healthy_position[0] + offset_rad < actuator_limits.travel_low
        or command_record.max_healthy_position[0] + offset_rad > actuator_limits.travel_high
    )
    return limit_to_travel(surface, extreme_healthy_position + offset_rad) if meets_stop else mean_deflection


def bias_interval(fdi: np.void, s: int, type_index: int) -> tuple[float, float] | None:
    """Return the interval of the offset, rad; None while one end is open."""
    offset_low, offset_high = feasible_set(fdi, s, type_index)
    return (offset_low, offset_high) if np.isfinite(offset_low) and np.isfinite(offset_high) else None


@kernel
def reset_growing_bias_memory(surface, type_index):
    """It has not grown yet."""
    memory = surface.growing_bias
    memory.min_growth_up = memory.min_growth_down = 0.0
    memory.has_run_towards_stop[:] = 0
    set_offset_interval_unlimited(memory)


@kernel
def set_offset_interval_unlimited(memory):
    """Its offset is not known."""
    memory.offset_low, memory.offset_high = -np.inf, np.inf


@kernel
def max_bias_growth_per_frame(config, surface):
    """Return the largest motion between judged frames of an offset slower than a runaway, rad."""
    return MAX_BIAS_GROWTH_PER_MIN_RUNAWAY_RATE * surface.actuator.min_runaway_rate * config.block_duration_s


@kernel
def widen_offset_interval(config, surface, type_index):
    """Widen the interval of the offset by what one that is slower than a runaway moves in a frame."""
    max_growth_per_frame = max_bias_growth_per_frame(config, surface)
    surface.growing_bias.offset_low -= max_growth_per_frame
    surface.growing_bias.offset_high += max_growth_per_frame


@kernel
def forget_bias_offset_interval(config, surface, type_index, k):
    """The fault may have gone, and begin again with any offset."""
    set_offset_interval_unlimited(surface.growing_bias)


@kernel
def detect_runaway_speed_and_narrow_offset(config, surface, judged_offset_low, judged_offset_high):
    """Hold an offset between judged_offset_low and judged_offset_high (rad) against what a slower one can be.

    A mean over several instants may be that of the last of them."""
    memory = surface.growing_bias
    if judged_offset_high < memory.offset_low:
        memory.has_run_towards_stop[0] = 1
    if judged_offset_low > memory.offset_high:
        memory.has_run_towards_stop[1] = 1
    growth_tolerance_within_frame = (
        0.0 if config.frame_shows_single_instant else max_bias_growth_per_frame(config, surface)
    )
    memory.offset_low, memory.offset_high = (
        max(memory.offset_low, judged_offset_low - growth_tolerance_within_frame),
        min(memory.offset_high, judged_offset_high + growth_tolerance_within_frame),
    )


@kernel
def update_growing_bias_returning_consistent_interval(config, surface, type_index, k):
    """It keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    judged_offset_low, judged_offset_high = offset_interval_of_judged_frame(surface)
    if judged_offset_low <= judged_offset_high:
        detect_runaway_speed_and_narrow_offset(config, surface, judged_offset_low, judged_offset_high)
    if np.isinf(judged_offset_low) or np.isinf(judged_offset_high):
        return UNLIMITED_SET
    memory = surface.growing_bias
    memory.min_growth_up, memory.min_growth_down = (
        max(memory.min_growth_up, judged_offset_low),
        min(memory.min_growth_down, judged_offset_high),
    )
    offset_has_been_positive = memory.min_growth_up > 0.0
    offset_has_been_negative = memory.min_growth_down < 0.0
    offset_shrinks = (offset_has_been_positive and judged_offset_high < memory.min_growth_up) or (
        offset_has_been_negative and judged_offset_low > memory.min_growth_down
    )
    return (
        EMPTY_SET
        if judged_offset_low > judged_offset_high
        or (offset_has_been_positive and offset_has_been_negative)
        or offset_shrinks
        else UNLIMITED_SET
    )


@kernel
def has_run_towards_stop(surface, stop_direction):
    """Whether the surface has moved towards that stop as fast as only a runaway does."""
    if stop_direction == 0:
        return False
    return surface.growing_bias.has_run_towards_stop[1 if stop_direction == 1 else 0] == 1


def last_offset_rad(fdi: np.void, s: int, type_index: int) -> float | None:
    """Offset in the last frame, rad."""
    return read_last_midpoint_deflection_error(fdi["types"]["surface"][s])


BIAS = FaultType(
    name="bias", has_constant_parameter=True, sort_rank=6,
    consistent_interval=bias_interval_of_judged_frame, possible_deflection_range=bias_deflection_range,
    accommodation_mode=SUBTRACT_OFFSET, deflection_error=bias_midpoint_or_infinity,
    deflection_error_precedence=2,
    deflection_relation=DeflectionRelation(
        1.0, theta_is_share=False, theta_range_for_travel=lambda low, high: (low - high, high - low)
    ),
    multi_frame_exclusion_test_name="offset", estimate_parameter=midpoint_parameter_estimate,
    estimate_parameter_interval=bias_interval,
)  # fmt: skip
GROWING_BIAS = FaultType(
    name="bias", description="bias that grows", has_constant_parameter=False, sort_rank=4,
    reset_memory=reset_growing_bias_memory, before_judging_frame=widen_offset_interval,
    consistent_interval=update_growing_bias_returning_consistent_interval,
    on_skipped_frame=forget_bias_offset_interval,
    memory_record_name="growing_bias",
    memory_dtype=record(
        min_growth_up=float, min_growth_down=float,  # how far it has certainly grown, rad
        # between what a slower one lies, rad; whether it has certainly run as fast as a runaway, down and up
        offset_low=float, offset_high=float, has_run_towards_stop=(int, 2),
    ),
    # an offset that grows ends as good as constant, with any commands
    error_depends_on_command=False,
    # as the command happens to go it looks like a jam or a loss; come to the stop by and by, like a runaway
    can_look_like=("loss_of_effectiveness", "stuck", "float", "hardover"),
    motion_rules_out=has_run_towards_stop,
    accommodation_mode=SUBTRACT_OFFSET, multi_frame_exclusion_test_name="growing offset",
    estimate_parameter=last_offset_rad,
)  # fmt: skip


MIN_OSCILLATION_HALF_CYCLE_ENDS = 3


@kernel
def reset_oscillation_memory(surface, type_index):
    """No half-cycle has been seen."""
    surface.oscillatory.n_half_cycles = surface.oscillatory.error_sign = 0


@kernel
def add_squared_deflection_error(config, surface, type_index):
    """Sum the squares of the deflection error."""
    deflection_error = (
        0.5 * (surface.judged_observation.position_low + surface.judged_observation.position_high)
        - surface.judged_observation.healthy_position
    )
    surface.oscillatory.half_cycle_error_square_sum += deflection_error**2


@kernel
def update_oscillation_returning_consistent_interval(config, surface, type_index, k):
    """Count half-cycles; a sign that stays for longer than the slowest half-cycle is no oscillation.

    At a stop half of a swing is hidden: where several instants are seen at once, the mean of a quick one
    keeps its sign.
    """
    memory = surface.oscillatory
    deflection_error_low = (
        surface.judged_observation.position_low - surface.judged_observation.healthy_position
    )
    deflection_error_high = (
        surface.judged_observation.position_high - surface.judged_observation.healthy_position
    )
    error_sign = 1 if deflection_error_low > 0.0 else (-1 if deflection_error_high < 0.0 else 0)
    if error_sign == 0 or (
        not config.frame_shows_single_instant
        and surface.judged_observation.stop_can_hide_deflection[0 if error_sign == 1 else 1]
    ):
        memory.sign_since_frame = k + 1
        return UNLIMITED_SET
    if error_sign != memory.error_sign:
        end_oscillation_half_cycle(memory, k)
        memory.error_sign, memory.sign_since_frame = error_sign, k
    return EMPTY_SET if k - memory.sign_since_frame > config.slowest_half_cycle_frames else UNLIMITED_SET


@kernel
def end_oscillation_half_cycle(memory, k):
    """A half-cycle ends here; the first one is cut off at its beginning and does not count."""
    if memory.error_sign != 0:
        if memory.n_half_cycles == 0:
            memory.first_half_cycle_end_frame = k
        else:
            memory.earlier_error_square_sum += memory.half_cycle_error_square_sum
        memory.last_half_cycle_end_frame = k
        memory.n_half_cycles += 1
        memory.half_cycle_error_square_sum = 0.0


@kernel
def restart_error_sign_duration(config, surface, type_index, k):
    """In a frame that is not judged it may have swung to the other side, unseen."""
    surface.oscillatory.sign_since_frame = k + 1


@kernel
def oscillation_has_shown(surface):
    """Whether it has swung for two half-cycles and more."""
    return surface.oscillatory.n_half_cycles >= MIN_OSCILLATION_HALF_CYCLE_ENDS


def oscillation_amplitude_rad(fdi: np.void, s: int, type_index: int) -> float | None:
    """Amplitude, rad."""
    memory = fdi["types"]["surface"][s]["oscillatory"]
    return float(
        sqrt(
            2.0
            * memory["earlier_error_square_sum"]
            / (memory["last_half_cycle_end_frame"] - memory["first_half_cycle_end_frame"])
        )
    )


def oscillation_frequency_rad_s(fdi: np.void, s: int, type_index: int) -> float | None:
    """From the half-cycles counted."""
    memory = fdi["types"]["surface"][s]["oscillatory"]
    n_counted_half_cycles = int(memory["n_half_cycles"]) - 1
    n_frames_in_half_cycles = int(memory["last_half_cycle_end_frame"] - memory["first_half_cycle_end_frame"])
    return (
        n_counted_half_cycles
        * pi
        / (float(fdi["types"]["config"]["block_duration_s"]) * n_frames_in_half_cycles)
    )


OSCILLATORY = FaultType(
    name="oscillatory", has_constant_parameter=False, sort_rank=2,
    reset_memory=reset_oscillation_memory, before_judging_frame=add_squared_deflection_error,
    consistent_interval=update_oscillation_returning_consistent_interval,
    on_skipped_frame=restart_error_sign_duration, memory_record_name="oscillatory",
    memory_dtype=record(
        error_sign=int, sign_since_frame=int,
        n_half_cycles=int, first_half_cycle_end_frame=int, last_half_cycle_end_frame=int,
        # ends of half-cycles, frames
        # of the deflection error, rad2: this half-cycle, those before
        half_cycle_error_square_sum=float, earlier_error_square_sum=float,
    ),
    has_shown=oscillation_has_shown, shows_within_half_cycles=2, evidence_at_rest=REST_EXCLUDES_TYPE,
    can_look_like=("rate_limit",),
    accommodation_mode=SUBTRACT_OFFSET, multi_frame_exclusion_test_name="swing",
    estimate_parameter=oscillation_amplitude_rad,
    estimate_frequency_rad_s=oscillation_frequency_rad_s,
)  # fmt: skip


@kernel
def reset_rate_limit_memory(surface, type_index):
    """No frame has been seen, and none before it."""
    surface.rate_limit.last_known_frame = -2


@kernel
def update_rate_limit_returning_consistent_interval(config, surface, type_index, k):
    """It never moves away from its command, so while it stands on one side it comes nearer.

    Of several JSBSim frames in one of ours the first is the old command's.
    """
    position_low = surface.judged_observation.position_low
    position_high = surface.judged_observation.position_high
    memory = surface.rate_limit
    side_of_command, moves_away_from_command = surface_side_of_commands(config, surface), False
    if side_of_command == 0 or side_of_command != memory.side_of_command or k != memory.last_known_frame + 1:
        memory.position_low, memory.position_high = position_low, position_high
    else:
        moves_away_from_command = (
            position_low > memory.position_high
            if side_of_command == 1
            else position_high < memory.position_low
        )
        narrow_position_by_min_rate(config, surface, memory, side_of_command)
    memory.position_low, memory.position_high = (
        max(memory.position_low, position_low),
        min(memory.position_high, position_high),
    )
    memory.side_of_command, memory.last_known_frame = side_of_command, k
    return EMPTY_SET if moves_away_from_command else UNLIMITED_SET


@kernel
def narrow_position_by_min_rate(config, surface, memory, side_of_command):
    """Take off what the slowest one comes nearer by within the judged frame: a least step an instant, until
    its lag makes the steps smaller. Where it was at an instant bounds where it is a frame later.

    side_of_command: 1 if the surface is above its command, -1 if it is below."""
    min_motion_in_frame = (
        config.n_substeps * config.frames_per_block * surface.actuator.min_rate_limited_motion_per_substep
    )
    distance_where_lag_slows_approach = (
        surface.actuator.min_rate_limited_motion_per_substep / surface.actuator.approach_share_per_substep
    )
    min_command, max_command = command_range_for_judged_frame(config, surface)
    if side_of_command == 1:
        memory.position_high = min(
            memory.position_high,
            max(memory.position_high - min_motion_in_frame, max_command + distance_where_lag_slows_approach),
        )
    else:
        memory.position_low = max(
            memory.position_low,
            min(memory.position_low + min_motion_in_frame, min_command - distance_where_lag_slows_approach),
        )


@kernel
def command_range_for_judged_frame(config, surface):
    """The least and greatest order that moved it towards and within the judged frame, rad."""
    command_record = surface.commands
    newest_blocks_ago = 2 if config.frame_shows_single_instant else 1
    return min(command_record.min_command[2], command_record.min_command[newest_blocks_ago]), max(
        command_record.max_command[2], command_record.max_command[newest_blocks_ago]
    )


@kernel
def surface_side_of_commands(config, surface):
    """1 for a surface certainly above all it was ordered to, -1 below, 0 otherwise."""
    min_command, max_command = command_range_for_judged_frame(config, surface)
    return (
        1
        if surface.judged_observation.position_low > max_command
        else (-1 if surface.judged_observation.position_high < min_command else 0)
    )


RATE_LIMIT = FaultType(
    name="rate_limit", has_constant_parameter=False, sort_rank=3,
    reset_memory=reset_rate_limit_memory, consistent_interval=update_rate_limit_returning_consistent_interval,
    memory_record_name="rate_limit",
    memory_dtype=record(
        # where it can be while it stands on one side of its command, rad
        position_low=float, position_high=float,
        side_of_command=int, last_known_frame=int,  # which side, and the last frame of which that is known
    ),
    # a slow surface that has not been seen to creep looks as if it stood still
    evidence_at_rest=REST_HIDES_TYPE, can_look_like=("stuck", "float", "hardover"),
    accommodation_mode=WAIT_FOR_SURFACE,
    multi_frame_exclusion_test_name="approach",
)  # fmt: skip
TYPES = LOSS, VARYING_LOSS, BIAS, GROWING_BIAS, OSCILLATORY, RATE_LIMIT
