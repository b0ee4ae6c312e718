"""Which type of fault is on a surface: exact feasible sets, frame by frame.

The innovation nu = eta + G_s (p_s - u_s) and |eta| <= eta_bar put the surface's true deflection p_s of each
frame in an interval, its axes agreeing on one. A type is a statement about p_s that holds in every frame in
which something is wrong; the set of its one parameter is the intersection over those frames, and the type is
excluded when nothing is left. For a bound that holds instant by instant this is the exact feasible set: no
test can exclude a type sooner without excluding a true one at some time.

    loss            p = (1 + theta) u      1 + theta in [0, 1], constant
    varying loss    the same               1 + theta anywhere in [0, 1] in every frame (incipient)
    stuck           p = c                  c in the travel
    float           p = 0
    hardover        p reaches its stop at no less than half its rate limit, and stays
    bias            p = u + b              b constant; cut off by the stops
    oscillatory     p - u swings about 0   no half-cycle longer than pi / slowest oscillation
    rate limit      p moves to u only      at any rate
    growing bias    p = u + b              b of one sign and never smaller (incipient)

A frame that eta alone explains gives no information: so a fault may be intermittent. The promise: the type,
constant while it is there, is never excluded, and so never misnamed. What cannot be distinguished stays a
candidate.

A file under table/ describes fault types; its `TYPES` are the rows. This file says what is in a row
(`FaultType`) and has two parts of a surface's record, which no other file writes:

- Feasible sets: the set (low, high) of each type's parameter; low > high is the empty set. A type is excluded
  once its set is empty, and stays excluded until the surface's diagnosis restarts.
- Observations: where the surface was, if it alone is at fault, in three frames or blocks:
  `last_observation` is of the elapsed frame, `judged_observation` of the one before it,
  `earlier_observation` of the one before that. Positions in rad.

registry.py reads the rows into arrays and records; in each frame it finds where each surface was and tests
every type. verdict.py and pairs.py conclude; they name no type.

type_index: the number of a type, the same in every array over types. config: TYPES_CONFIG of registry.py;
surface: a record of its `surface_types_dtype`. k: number of the judged frame, which is the frame before the
elapsed one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis import isolation

Kernel = Callable[..., Any]

# Accommodation modes, what the law does about a surface at fault: scale its command, give the surface up,
# subtract its offset, or wait for it at the rate that it has.
SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET, WAIT_FOR_SURFACE = range(4)

UNLIMITED_SET, EMPTY_SET = (-np.inf, np.inf), (np.inf, -np.inf)  # an unlimited set, and an empty one

# `evidence_at_rest`: what a surface says of a type that was given up, stays where it was and shows nothing
# wrong.
REST_IS_UNINFORMATIVE, REST_EXCLUDES_TYPE, REST_HIDES_TYPE, REST_POSITION_IS_PARAMETER = range(4)


@kernel
def reachable_range(config, surface, type_index, k):
    """Anywhere within reach."""
    return surface.actuator.reachable_low, surface.actuator.reachable_high


class DeflectionRelation(NamedTuple):
    """The deflection p of a surface under a type, by its command u and one parameter theta, all in rad:

    p = command_gain u + theta, or p = (command_gain + theta) u where theta is a share of the command
    (theta_is_share).

    theta_range_for_travel(low, high): returns the least and greatest theta; low, high: the travel, rad.
    """

    command_gain: float
    theta_is_share: bool
    theta_range_for_travel: Callable[[float, float], tuple[float, float]]


def _return_none_as_estimate(fdi: np.void, s: int, type_index: int) -> None:
    """No parameter to estimate."""


@dataclass(frozen=True, kw_only=True)
class FaultType:
    """One fault type. A part that is left out has nothing to do.

    name                    in scenarios, reports and metrics
    description             the type in words, where the name does not say which of two types it is
    has_constant_parameter  whether its parameter is constant: if so, a frame can refute what another frame
                            allows
    sort_rank               place among the types of its sort (constant or not), in numbers and in lists

    The feasible set; kernels:

    consistent_interval(config, surface, type_index, k)
                            the parameters (low, high) that explain the judged frame, in which something was
                            wrong; UNLIMITED_SET if every one does, EMPTY_SET (low > high) excludes the
                            type
    parameter_range(surface)
                            the parameters (low, high) that there are; unlimited if left out
    feasible_set_after_frame(surface, type_index)
                            the set (low, high) to go on with after a frame; the one there is if left out
    memory_dtype, memory_record_name
                            a record of its own, found at `surface.<memory_record_name>`
    reset_memory(surface, type_index)
                            its memory is reset: nothing is known yet
    before_judging_frame(config, surface, type_index)
                            called for every frame, before it is judged
    on_skipped_frame(config, surface, type_index, k)  called for a frame that is not judged
    on_possible_release(config, surface, type_index, k)
                            a repair may have released the surface as the frame began
    propagate_release(config, surface, type_index)    advance such a release by a frame (held_surface.py)
    possible_deflection_range(config, surface, type_index, k)
                            least and greatest deflection under it by the elapsed frame, rad; of a constant
                            type

    The evidence that a verdict needs:

    has_shown(surface)      kernel: whether the type has shown itself. A type with this part explains a flight
                            only once it has shown itself
    shows_within_half_cycles
                            half-cycles of the slowest oscillation within which such a type shows itself
    evidence_at_rest        what a surface that was given up, and stays where it was, says of the type:
                            REST_IS_UNINFORMATIVE, REST_EXCLUDES_TYPE, REST_HIDES_TYPE (it may be there all
                            the same) or REST_POSITION_IS_PARAMETER (its parameter is the deflection at
                            which the surface stands)
    half_cycles_before_isolating_other_surface
                            half-cycles of evidence that a fault on another surface needs while this type is
                            left here
    error_depends_on_command
                            whether the deflection error depends on the command. While a type that does not
                            is left on one surface, no other surface is isolated in its place
    can_look_like           names of types that this one can look like: they are not named while it is left
    motion_rules_out(surface, stop_direction)
                            kernel: whether the surface has moved as this type cannot, towards the stop
                            of that direction (0: of a type without one)
    stop_direction          the stop that it runs to: 1 upper, -1 lower, 0 neither

    The accommodation:

    accommodation_mode      SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET or WAIT_FOR_SURFACE
    other_accommodation_modes
                            other modes that serve it
    type_name_at_end_of_range
                            name of the type that it becomes at the end of its range: where both are left, the
                            modes of that one serve this one too
    deflection_error(surface, type_index)
                            kernel: how far the surface is off its command, rad; not finite if not known
    deflection_error_precedence
                            of the types left, the one with the least number gives the deflection error

    What shows from outside that it is excluded, and by which deflections it differs from another:

    deflection_relation     deflection by command and one parameter, where that is all that the type says; of
                            a type that is not constant theta may differ from frame to frame
    multi_frame_exclusion_test_name
                            name of the comparison of frames that excludes it, where one frame or two do not
                            suffice: "offset", "growing offset", "runaway", "swing" or "approach"

    Words, Python functions (verdict.py):

    estimate_parameter(fdi, s, type_index)
                            its parameter, None without one
    estimate_parameter_interval(fdi, s, type_index)
                            the set that the parameter is certain to lie in, or None
    estimate_frequency_rad_s(fdi, s, type_index)
                            of a periodic type, or None
    """

    name: str
    has_constant_parameter: bool
    consistent_interval: Kernel
    description: str = ""
    sort_rank: int = 100
    parameter_range: Kernel | None = None
    feasible_set_after_frame: Kernel | None = None
    memory_dtype: np.dtype | None = None
    memory_record_name: str = ""
    reset_memory: Kernel | None = None
    before_judging_frame: Kernel | None = None
    on_skipped_frame: Kernel | None = None
    on_possible_release: Kernel | None = None
    propagate_release: Kernel | None = None
    possible_deflection_range: Kernel = reachable_range
    has_shown: Kernel | None = None
    shows_within_half_cycles: int = 0
    evidence_at_rest: int = REST_IS_UNINFORMATIVE
    half_cycles_before_isolating_other_surface: int = 1
    error_depends_on_command: bool = True
    can_look_like: tuple[str, ...] = ()
    motion_rules_out: Kernel | None = None
    stop_direction: int = 0
    accommodation_mode: int = SUBTRACT_OFFSET
    other_accommodation_modes: tuple[int, ...] = ()
    type_name_at_end_of_range: str = ""
    deflection_error: Kernel | None = None
    deflection_error_precedence: int = 100
    deflection_relation: DeflectionRelation | None = None
    multi_frame_exclusion_test_name: str = ""
    estimate_parameter: Callable[[np.void, int, int], float | None] = _return_none_as_estimate
    estimate_parameter_interval: Callable[[np.void, int, int], tuple[float, float] | None] = (
        _return_none_as_estimate
    )
    estimate_frequency_rad_s: Callable[[np.void, int, int], float | None] = _return_none_as_estimate


@kernel
def limit_to_travel(surface, deflection_rad):
    """A deflection (rad), cut off by the stops."""
    return min(max(deflection_rad, surface.actuator.travel_low), surface.actuator.travel_high)


@kernel
def feasible_set_midpoint(surface, type_index):
    """The middle of a type's set."""
    return 0.5 * (surface.feasible_sets.low[type_index] + surface.feasible_sets.high[type_index])


def feasible_set(fdi: np.void, s: int, type_index: int) -> tuple[float, float]:
    """The set of a type's parameter on surface s."""
    surface = fdi["types"]["surface"][s]
    return float(surface["feasible_sets"]["low"][type_index]), float(
        surface["feasible_sets"]["high"][type_index]
    )


def midpoint_parameter_estimate(fdi: np.void, s: int, type_index: int) -> float:
    """The middle of the feasible set of a type's parameter on surface s."""
    set_low, set_high = feasible_set(fdi, s, type_index)
    return 0.5 * (set_low + set_high)


@kernel
def reset_feasible_sets_and_exclusions(surface):
    """Allow every type with any parameter."""
    surface.feasible_sets.low[:], surface.feasible_sets.high[:] = -np.inf, np.inf
    surface.feasible_sets.excluded[:] = 0


@kernel
def set_feasible_set(surface, type_index, interval):
    """Put an interval in place of the set of a type."""
    surface.feasible_sets.low[type_index], surface.feasible_sets.high[type_index] = interval


@kernel
def intersect_set_or_exclude_type(surface, type_index, other_interval):
    """Keep of the set of a type what is also in other_interval; exclude the type when nothing is left. The
    set then holds the two bounds that contradict each other. EMPTY_SET has no such bounds: a type
    that it excludes keeps its set."""
    interval_low, interval_high = other_interval
    if interval_low == np.inf:
        surface.feasible_sets.excluded[type_index] = 1
        return
    surface.feasible_sets.low[type_index] = max(surface.feasible_sets.low[type_index], interval_low)
    surface.feasible_sets.high[type_index] = min(surface.feasible_sets.high[type_index], interval_high)
    if surface.feasible_sets.low[type_index] > surface.feasible_sets.high[type_index]:
        surface.feasible_sets.excluded[type_index] = 1


@kernel
def mark_type_excluded(surface, type_index):
    """Exclude a type."""
    surface.feasible_sets.excluded[type_index] = 1


@kernel
def restore_first_pitch_fault_sets(surface):
    """Restore the sets that were stored when the surface was isolated (pairs.py)."""
    surface.feasible_sets.low[:], surface.feasible_sets.high[:] = (
        surface.first_pitch_fault_sets.low,
        surface.first_pitch_fault_sets.high,
    )
    surface.feasible_sets.excluded[:] = surface.first_pitch_fault_sets.excluded


# healthy_position: where a healthy surface was; position_low, position_high: where this one can have been;
# is_anomalous: whether more than the declared uncertainty was at work;
# weighted_mean_error_per_position_range: (G_max - G_min) / (4 |mean G|), by so much of the range of its
# positions a mean weighted by G may be off; stop_can_hide_deflection: whether
# the lower and the upper stop can cut a deflection off unseen.
OBSERVATION_RECORD = record(
    healthy_position=float,
    position_low=float,
    position_high=float,
    is_anomalous=int,
    weighted_mean_error_per_position_range=float,
    stop_can_hide_deflection=(int, 2),
)


@kernel
def set_last_position_to_reachable_range(surface):
    """The surface may have been anywhere within reach."""
    surface.last_observation.position_low, surface.last_observation.position_high = (
        surface.actuator.reachable_low,
        surface.actuator.reachable_high,
    )


@kernel
def shift_observations(surface):
    """Shift the observations by one frame: the last becomes the judged one, and that one the earlier one."""
    copy_observation(surface.earlier_observation, surface.judged_observation)
    copy_observation(surface.judged_observation, surface.last_observation)


@kernel
def copy_observation(target_observation, source_observation):
    """Copy one observation to another."""
    (
        target_observation.healthy_position,
        target_observation.position_low,
        target_observation.position_high,
        target_observation.is_anomalous,
        target_observation.weighted_mean_error_per_position_range,
    ) = (
        source_observation.healthy_position,
        source_observation.position_low,
        source_observation.position_high,
        source_observation.is_anomalous,
        source_observation.weighted_mean_error_per_position_range,
    )
    target_observation.stop_can_hide_deflection[:] = source_observation.stop_can_hide_deflection


@kernel
def fill_last_observation_from_innovation(
    config,
    surface,
    fie,
    most_affected_axis,
    innovation_by_axis,
    innovation_bound_by_axis,
    fault_effect_record,
):
    """Find where a surface can have been: what agrees with innovation_by_axis (3,) within
    innovation_bound_by_axis (3,), rad/s2.

    fie: its estimator of a position; most_affected_axis: on which it has most effect;
    fault_effect_record: what that supposes of the same frame or block, dtype EFFECT_RECORD.
    """
    last_observation, command_record = surface.last_observation, surface.commands
    last_observation.healthy_position = (
        -fault_effect_record.base[most_affected_axis] / fault_effect_record.regressor[most_affected_axis]
    )
    last_observation.weighted_mean_error_per_position_range = (
        0.25
        * (command_record.max_acceleration_per_rad - command_record.min_acceleration_per_rad)
        / abs(fault_effect_record.regressor[most_affected_axis])
    )
    last_observation.position_low, last_observation.position_high = fie.theta_min, fie.theta_max
    for i in range(3):
        if (
            config.frames_per_block > 1
            and i != most_affected_axis
            and fault_effect_record.regressor[i] != 0.0
        ):
            continue  # over a block the axes weigh what varies differently
        axis_position_low, axis_position_high = isolation.consistent_on(
            innovation_by_axis, innovation_bound_by_axis, fie, fault_effect_record, i
        )
        last_observation.position_low, last_observation.position_high = (
            max(last_observation.position_low, axis_position_low),
            min(last_observation.position_high, axis_position_high),
        )
    mark_stops_that_can_hide_deflection(
        surface,
        2.0
        * (innovation_bound_by_axis[most_affected_axis] + fault_effect_record.e[most_affected_axis])
        / abs(fault_effect_record.regressor[most_affected_axis]),
    )


@kernel
def mark_stops_that_can_hide_deflection(surface, position_interval_width):
    """Which stops can cut a deflection off unseen: those nearer to a healthy surface than
    `position_interval_width` (rad), that of the interval which holds the true deflection."""
    surface.last_observation.stop_can_hide_deflection[0] = (
        surface.commands.min_healthy_position[0] - surface.actuator.travel_low < position_interval_width
    )
    surface.last_observation.stop_can_hide_deflection[1] = (
        surface.actuator.travel_high - surface.commands.max_healthy_position[0] < position_interval_width
    )


@kernel
def fill_observation_and_check_reach(surface, deflection_error, deflection_error_tolerance):
    """A surface was off its command by deflection_error +- deflection_error_tolerance (rad). False:
    nowhere within its reach."""
    last_observation, actuator_limits = surface.last_observation, surface.actuator
    last_observation.position_low = max(
        actuator_limits.reachable_low,
        last_observation.healthy_position + deflection_error - deflection_error_tolerance,
    )
    last_observation.position_high = min(
        actuator_limits.reachable_high,
        last_observation.healthy_position + deflection_error + deflection_error_tolerance,
    )
    last_observation.is_anomalous = abs(deflection_error) > deflection_error_tolerance
    mark_stops_that_can_hide_deflection(surface, 2.0 * deflection_error_tolerance)
    return last_observation.position_low <= last_observation.position_high


@kernel
def set_known_position_and_clear_anomaly(surface, position_low, position_high):
    """Set the interval (position_low, position_high) rad in which a surface with a known fault was;
    the frame is no longer anomalous for it."""
    (
        surface.last_observation.position_low,
        surface.last_observation.position_high,
        surface.last_observation.is_anomalous,
    ) = position_low, position_high, 0


@kernel
def set_is_anomalous(surface, innovation_exceeds_uncertainty):
    """Set whether the elapsed frame is anomalous: more than the declared uncertainty was at work."""
    surface.last_observation.is_anomalous = innovation_exceeds_uncertainty


@kernel
def mark_observations_not_anomalous(surface):
    """Mark all three observations as not anomalous."""
    surface.last_observation.is_anomalous = surface.judged_observation.is_anomalous = (
        surface.earlier_observation.is_anomalous
    ) = 0


@kernel
def last_midpoint_deflection_error(surface):
    """Return the deflection error of the surface in the elapsed frame, rad: the middle of where it can have
    been."""
    return (
        0.5 * (surface.last_observation.position_low + surface.last_observation.position_high)
        - surface.last_observation.healthy_position
    )


def read_last_midpoint_deflection_error(surface: np.void) -> float:
    """`last_midpoint_deflection_error` of a record outside compiled code, rad."""
    last_observation = surface["last_observation"]
    return float(
        0.5 * (last_observation["position_low"] + last_observation["position_high"])
        - last_observation["healthy_position"]
    )
