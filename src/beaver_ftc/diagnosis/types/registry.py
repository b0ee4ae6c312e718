"""The rows of the fault types as arrays, their records, and the examination of a frame by every type.

Every file under `table/` is read, in the order of its name: a new type is one more row.

*Examination.* In each frame, or block of frames: where was each surface, and was anything wrong? A frame is
judged one frame later: with several JSBSim frames in one of ours a fault may begin or end within a frame,
which then shows a part of it; such a frame, next to a healthy one, is skipped.

Where the noise of a gyro makes single frames uninformative, frames are examined in blocks. Summed over a
block the innovation holds the noise of its two ends alone, n[k+N] - n[k]. So the mean over N frames has the
bound

    mean eta_bar + (nbar[k] + nbar[k+N]) / (N dt)

which gives the mean position of the surface, weighted by its effectiveness G, whose sign stays. The weighted
mean of a constant position, offset or effectiveness is exact; that of a varying one lies between its
extremes. To the types a block is like a frame that consists of several JSBSim frames: a block next to a
healthy one is skipped.

types: of `fault_types_dtype`. estimators: those of the isolation, by the layout. bound: of `bound_dtype`.
"""

import pkgutil
from functools import lru_cache
from importlib import import_module
from math import ceil, pi, radians
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.state import PITCH_GROUP
from beaver_ftc.diagnosis.types import (
    EMPTY_SET,
    GIVE_UP,
    OBSERVATION_RECORD,
    REST_EXCLUDES_TYPE,
    REST_POSITION_IS_PARAMETER,
    FaultType,
    Kernel,
    fill_last_observation_from_innovation,
    intersect_set_or_exclude_type,
    mark_type_excluded,
    reset_feasible_sets_and_exclusions,
    set_feasible_set,
    set_is_anomalous,
    set_last_position_to_reachable_range,
    shift_observations,
    table,
)
from beaver_ftc.scenario.declared import Declared

BLOCK_DURATION_S = (
    0.2  # of frames examined together where gyros are noisy: much less than the slowest half-cycle, 3.1 s
)
DEFAULT_ACTUATOR_RATE_LIMIT_RAD_S = (
    pi / 3.0
)  # of an actuator with no declared rate limit: the aircraft's default


def _load_ordered_types() -> tuple[FaultType, ...]:
    """Those of a constant parameter first, then by rank: a type's number is its place."""
    module_names = sorted(
        f"{table.__name__}.{module_info.name}" for module_info in pkgutil.iter_modules(table.__path__)
    )
    rows = [row for module_name in module_names for row in import_module(module_name).TYPES]
    return tuple(sorted(rows, key=lambda row: (not row.has_constant_parameter, row.sort_rank, row.name)))


TYPES = _load_ordered_types()
N_TYPES = len(TYPES)
N_CONSTANT_PARAMETER_TYPES = sum(row.has_constant_parameter for row in TYPES)
TYPE_NAMES: tuple[str, ...] = tuple(row.name for row in TYPES)
DESCRIPTIONS_IN_TYPE_ORDER: tuple[str, ...] = tuple(row.description or row.name for row in TYPES)
FIRST_TYPE_WITH_SAME_NAME = tuple(
    TYPE_NAMES.index(name) for name in TYPE_NAMES
)  # the first type of the same name


def _column_of_types(column_name: str) -> np.ndarray:
    """A column of whole numbers or flags of the table, by type."""
    return np.array([int(getattr(row, column_name)) for row in TYPES])


def _kernels_by_type(part_name: str) -> dict[int, Kernel]:
    """This part of each type that has it."""
    part_by_type = {type_index: getattr(row, part_name) for type_index, row in enumerate(TYPES)}
    return {type_index: part for type_index, part in part_by_type.items() if part is not None}


def _can_look_like(fault_type: FaultType, other_type: FaultType) -> bool:
    return other_type.name in fault_type.can_look_like


# The columns that verdict.py reads; `FaultType` says what they are.
ACCOMMODATION_MODE_BY_TYPE, STOP_DIRECTION_BY_TYPE, MEANING_OF_REST_BY_TYPE = (
    _column_of_types(name) for name in ("accommodation_mode", "stop_direction", "evidence_at_rest")
)
SHOWS_WITHIN_HALF_CYCLES = _column_of_types("shows_within_half_cycles")
HALF_CYCLES_BEFORE_ISOLATING_OTHER_SURFACE = _column_of_types("half_cycles_before_isolating_other_surface")
ERROR_DEPENDS_ON_COMMAND = _column_of_types("error_depends_on_command")
MUST_SHOW_ITSELF = np.array([row.has_shown is not None for row in TYPES])
CAN_LOOK_LIKE = np.array(
    [[_can_look_like(fault_type, other_type) for other_type in TYPES] for fault_type in TYPES]
)
MODE_SERVES_TYPE = np.array(
    [
        [
            accommodation_mode == row.accommodation_mode
            or accommodation_mode in row.other_accommodation_modes
            for row in TYPES
        ]
        for accommodation_mode in range(4)
    ]
)
# Types that give the deflection error of a surface, in the order in which they are used.
DEFLECTION_ERROR_TYPES_BY_PRECEDENCE = np.array(
    sorted(
        _kernels_by_type("deflection_error"),
        key=lambda type_index: TYPES[type_index].deflection_error_precedence,
    ),
    dtype=int,
)
TYPE_INDEX_AT_END_OF_RANGE = np.array(
    [
        TYPE_NAMES.index(row.type_name_at_end_of_range) if row.type_name_at_end_of_range else -1
        for row in TYPES
    ]
)


def type_index_of(name: str, *, has_constant_parameter: bool = True, stop_direction: int = 0) -> int:
    """The number of a type, by its name in the table; stop_direction: of the stop to which it runs."""
    sought_type_attributes = (name, has_constant_parameter, stop_direction)
    return [(row.name, row.has_constant_parameter, row.stop_direction) for row in TYPES].index(
        sought_type_attributes
    )


def _compile_kernel(
    name: str, argument_list: str, body_lines: list[str], namespace: dict[str, Any]
) -> Kernel:
    """A kernel whose body is `body_lines`, in which `part_3` is a part of type 3.

    Compiled code calls only what it can name, so the calls are written out, one a type.
    """
    source_code = "\n    ".join([f"def {name}({argument_list}):", *body_lines])
    exec(compile(source_code, __file__, "exec"), namespace)
    return kernel(namespace[name])


def _call_expression(type_index: int, argument_list: str) -> str:
    """The call of a part of type `type_index`; the argument of that name is its number."""
    call_arguments = (
        str(type_index) if argument == "type_index" else argument for argument in argument_list.split(", ")
    )
    return f"part_{type_index}({', '.join(call_arguments)})"


def _kernel_namespace(part_kernels: dict[int, Kernel], **other_names: Any) -> dict[str, Any]:
    """The names that a kernel which calls these parts needs."""
    return {
        "__name__": __name__,
        **{f"part_{type_index}": part for type_index, part in part_kernels.items()},
        **other_names,
    }


def _kernel_calling_each_type(
    part_name: str, argument_list: str, result_kernel: Kernel | None = None
) -> Kernel:
    """A kernel that calls this part of every type; result_kernel(surface, type_index, interval): called with
    what that returns."""
    part_kernels = _kernels_by_type(part_name)
    parameter_list = ", ".join(argument for argument in argument_list.split(", ") if argument != "type_index")
    call_expressions = {
        type_index: _call_expression(type_index, argument_list) for type_index in part_kernels
    }
    body_lines = [
        f"result_kernel(surface, {type_index}, {call_expression})" if result_kernel else call_expression
        for type_index, call_expression in call_expressions.items()
    ]
    return _compile_kernel(
        f"{part_name}_each",
        parameter_list,
        [*body_lines, "return"],
        _kernel_namespace(part_kernels, result_kernel=result_kernel),
    )


def _kernel_calling_one_type(part_name: str, argument_list: str, default_result: Any) -> Kernel:
    """A kernel that returns what this part of the type `type_index` returns; `default_result` for
    a type without it."""
    part_kernels = _kernels_by_type(part_name)
    body_lines = [
        f"if type_index == {type_index}: return {_call_expression(type_index, argument_list)}"
        for type_index in part_kernels
    ]
    parameter_list = (
        argument_list if "type_index" in argument_list.split(", ") else f"{argument_list}, type_index"
    )
    return _compile_kernel(
        f"{part_name}_of",
        parameter_list,
        [*body_lines, "return default"],
        _kernel_namespace(part_kernels, default=default_result),
    )


_FRAME_KERNEL_ARGUMENTS = "config, surface, type_index, k"
reset_memory_each = _kernel_calling_each_type("reset_memory", "surface, type_index")
set_parameter_range_each = _kernel_calling_each_type("parameter_range", "surface", set_feasible_set)
before_judging_frame_each = _kernel_calling_each_type("before_judging_frame", "config, surface, type_index")
on_skipped_frame_each = _kernel_calling_each_type("on_skipped_frame", _FRAME_KERNEL_ARGUMENTS)
intersect_consistent_interval_each = _kernel_calling_each_type(
    "consistent_interval", _FRAME_KERNEL_ARGUMENTS, intersect_set_or_exclude_type
)
on_possible_release_each = _kernel_calling_each_type("on_possible_release", _FRAME_KERNEL_ARGUMENTS)
set_feasible_set_after_frame_each = _kernel_calling_each_type(
    "feasible_set_after_frame", "surface, type_index", set_feasible_set
)
propagate_release_each = _kernel_calling_each_type("propagate_release", "config, surface, type_index")
has_shown = _kernel_calling_one_type("has_shown", "surface", True)
motion_rules_out = _kernel_calling_one_type("motion_rules_out", "surface, stop_direction", False)
possible_deflection_range = _kernel_calling_one_type(
    "possible_deflection_range", _FRAME_KERNEL_ARGUMENTS, EMPTY_SET
)
deflection_error_under_type = _kernel_calling_one_type("deflection_error", "surface, type_index", np.nan)

MAX_FRAMES_PER_BLOCK = 256  # frames of a block
N_COMMAND_BLOCKS_KEPT = (
    3  # frames, or blocks, of which the orders are kept: the elapsed one and two before it
)

# Commands to one surface, rad; [0] belongs to the elapsed frame or block, [1] to the one before.
COMMANDS_RECORD = record(
    command_history=(N_COMMAND_BLOCKS_KEPT, MAX_FRAMES_PER_BLOCK), min_command=N_COMMAND_BLOCKS_KEPT,
    max_command=N_COMMAND_BLOCKS_KEPT,
    min_healthy_position=2, max_healthy_position=2,  # where a healthy surface was within it
    # G of the surface within the elapsed frame or block, on its dominant axis, rad/s2 per rad
    min_acceleration_per_rad=float, max_acceleration_per_rad=float,
)  # fmt: skip

# Configuration: the actuator of one surface, rad. It acts where it can reach: a part of its travel is nearer
# to zero.
ACTUATOR_CONFIG_RECORD = record(
    travel_low=float, travel_high=float, reachable_low=float, reachable_high=float, min_runaway_rate=float,
    approach_share_per_substep=float, max_motion_per_substep=float, min_rate_limited_motion_per_substep=float,
)  # fmt: skip

# The set of each type's parameter: types/__init__.py.
FEASIBLE_SETS_RECORD = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# Counts of frames in which something was wrong: all; those in which a surface that was given up stayed at its
# rest position; those since a stop could last hide a deflection. The first such frame, and where the surface
# was in it, rad.
ANOMALOUS_FRAME_EVIDENCE_RECORD = record(
    n_anomalous_frames=int,
    n_rest_frames=int,
    n_anomalous_frames_since_stop_could_hide=int,
    first_anomalous_frame=int,
    first_anomalous_position_low=float,
    first_anomalous_position_high=float,
)

# Whether the surface may be the only one at fault; what decides whether it can be at fault:
# ESTIMATOR_DECIDES_POSSIBLE_FAULT, DEDUCED_FAULTY or DEDUCED_HEALTHY (verdict.py);
# whether it is isolated, of which type, -1 if open, and since when, s: pairs.py.
SURFACE_FINDING_RECORD = record(
    may_be_sole_fault=int,
    can_be_at_fault_basis=int,
    is_isolated=int,
    isolated_at_s=float,
    fault_type=int,
    typed_at_s=float,
)

# The mode of accommodation, -1 for none; frames since the fault last showed: verdict.py.
ACCOMMODATION_RECORD = record(mode=int, n_frames_without_sign_of_fault=int)

# Where a surface can be that a type has held and released, rad: table/held_surface.py.
POSSIBLE_RELEASES_BY_TYPE_RECORD = record(
    return_position_low=(2, N_TYPES), return_position_high=(2, N_TYPES), has_released=(int, N_TYPES),
    held_position_min=N_TYPES, held_position_max=N_TYPES,  # where it is held by then
)  # fmt: skip

# What was known of the first of two faults when it was named: pairs.py.
FIRST_PITCH_FAULT_SETS_RECORD = record(low=N_TYPES, high=N_TYPES, excluded=(int, N_TYPES))

# What the types go by: whether a frame shows one instant, instants in it, whether a surface returns by its
# actuator, frames of half of the slowest oscillation, whether a fault is declared to stay as it is and errors
# of the surfaces' own terms are; frames of a block and its duration; dt s.
TYPES_CONFIG_RECORD = record(
    frame_shows_single_instant=int, n_substeps=int, released_surface_returns_via_actuator=int,
    slowest_half_cycle_frames=int,
    abrupt=int,
    has_eG=int, frames_per_block=int, block_duration_s=float,
    dt=float,
)  # fmt: skip

# Two faults at once: pairs.py; alarms of the groups, and what is known of the first fault in pitch.
# n_frames_since_unstored_exclusion: frames since a type was excluded on its surface that is not yet excluded
# in the stored sets.
FAULT_PAIR_RECORD = record(
    enabled=int,
    group_has_alarm=(int, 2),
    lateral_fault_outside_class=int,
    first_pitch_fault_surface=int,
    n_frames_since_unstored_exclusion=int,
)

# Blocks of frames.
FRAME_BLOCK_RECORD = record(
    n_frames_so_far=int, mean_innovation=3, mean_innovation_bound=3, changing_gyro_error_bound_at_start=3
)


@lru_cache
def surface_types_dtype() -> np.dtype:
    """One surface's records: configuration, observations (types/__init__.py), the memories of the types, and
    what is concluded. position_estimator_excluded: as verdict.py keeps it."""
    memory_dtype_by_name = {row.memory_record_name: row.memory_dtype for row in TYPES if row.memory_dtype}
    return record(
        actuator=ACTUATOR_CONFIG_RECORD, commands=COMMANDS_RECORD, last_observation=OBSERVATION_RECORD,
        judged_observation=OBSERVATION_RECORD, earlier_observation=OBSERVATION_RECORD,
        evidence=ANOMALOUS_FRAME_EVIDENCE_RECORD, feasible_sets=FEASIBLE_SETS_RECORD,
        release=POSSIBLE_RELEASES_BY_TYPE_RECORD,
        **memory_dtype_by_name,
        position_estimator_excluded=int, status=SURFACE_FINDING_RECORD, accommodation=ACCOMMODATION_RECORD,
        first_pitch_fault_sets=FIRST_PITCH_FAULT_SETS_RECORD,
    )  # fmt: skip


@sized
def fault_types_dtype(n_surfaces: int) -> np.dtype:
    """Faults of every type on n surfaces: types/."""
    return record(
        config=TYPES_CONFIG_RECORD,
        frame_index=int,
        pair=FAULT_PAIR_RECORD,
        block=FRAME_BLOCK_RECORD,
        surface=(surface_types_dtype(), n_surfaces),
    )


def configure_fault_types(
    types: np.void,
    layout: np.void,
    prediction_actuators: np.void,
    declared: Declared,
    travel_low_and_high: np.ndarray,
) -> None:
    """Fill the configuration of the types and the actuator of each surface; travel_low_and_high (2, n): the
    stops, rad."""
    config, types_config, dt = declared.fdi, types["config"], 1.0 / declared.rate_hz
    types_config["frames_per_block"] = frames_per_block = (
        ceil(BLOCK_DURATION_S / dt) if declared.sensors.declared.gyros_vary else 1
    )
    types_config["frame_shows_single_instant"] = declared.substeps == 1 and frames_per_block == 1
    types_config["block_duration_s"] = frames_per_block * dt
    half_cycle_frames = pi / config.slowest_oscillation_rad_s / (frames_per_block * dt)
    types_config["slowest_half_cycle_frames"] = ceil(min(half_cycle_frames, 1e9))  # longer than any flight
    types_config["n_substeps"], types_config["released_surface_returns_via_actuator"], types_config["dt"] = (
        declared.substeps,
        prediction_actuators["real"],
        dt,
    )
    types_config["abrupt"] = config.fault_profile == "abrupt"
    types["pair"]["first_pitch_fault_surface"], types["pair"]["enabled"] = -1, config.pairs
    surface_names, substep_s = declared.aircraft.surfaces, dt / declared.substeps
    for s, (surface_name, surface_record, travel_low, travel_high) in enumerate(
        zip(surface_names, types["surface"], *travel_low_and_high, strict=True)
    ):
        rate_limit_deg_s = getattr(declared.servos, surface_name).rate_limit_deg_s
        actuator_record = surface_record["actuator"]
        actuator_record["travel_low"], actuator_record["travel_high"] = travel_low, travel_high
        actuator_record["reachable_low"], actuator_record["reachable_high"] = (
            min(travel_low, 0.0),
            max(travel_high, 0.0),
        )
        actuator_record["approach_share_per_substep"], actuator_record["max_motion_per_substep"] = (
            prediction_actuators["approach"][s],
            prediction_actuators["step"][s],
        )
        actuator_record["min_runaway_rate"] = 0.5 * (
            radians(rate_limit_deg_s) or DEFAULT_ACTUATOR_RATE_LIMIT_RAD_S
        )
        actuator_record["min_rate_limited_motion_per_substep"] = min(
            radians(config.slowest_rate_deg_s) * substep_s, actuator_record["max_motion_per_substep"]
        )
        surface_record["status"]["may_be_sole_fault"] = not config.pairs or layout["group"][s] == PITCH_GROUP
        surface_record["accommodation"]["mode"] = surface_record["status"]["fault_type"] = -1


@kernel
def restart_fault_types(types):
    """Nothing is known of any surface yet."""
    for surface in types.surface:
        restart_surface_sets_and_evidence(surface)


@kernel
def restart_surface_sets_and_evidence(surface):
    """Nothing is known of this surface yet."""
    reset_feasible_sets_and_exclusions(surface)
    set_parameter_range_each(surface)
    set_last_position_to_reachable_range(surface)
    surface.evidence.first_anomalous_frame = -1
    surface.evidence.n_anomalous_frames = surface.evidence.n_rest_frames = (
        surface.evidence.n_anomalous_frames_since_stop_could_hide
    ) = 0
    reset_memory_each(surface)


@kernel
def record_commands(types, commanded_rad, effectiveness_and_position_extremes):
    """Add a frame to the commands of the surfaces: commanded_rad (n,); positions of healthy surfaces and
    their least and greatest effectiveness within it: effectiveness_and_position_extremes, of a
    `model_prediction.frame_means_dtype`.
    """
    frames_per_block = types.config.frames_per_block
    for s, surface in enumerate(types.surface):
        command_record = surface.commands
        if types.block.n_frames_so_far == 0:
            for blocks_ago in range(N_COMMAND_BLOCKS_KEPT - 1, 0, -1):
                command_record.command_history[blocks_ago, :frames_per_block] = (
                    command_record.command_history[blocks_ago - 1, :frames_per_block]
                )
                command_record.min_command[blocks_ago], command_record.max_command[blocks_ago] = (
                    command_record.min_command[blocks_ago - 1],
                    command_record.max_command[blocks_ago - 1],
                )
            command_record.min_command[0], command_record.max_command[0] = np.inf, -np.inf
            command_record.min_healthy_position[1], command_record.max_healthy_position[1] = (
                command_record.min_healthy_position[0],
                command_record.max_healthy_position[0],
            )
            command_record.min_healthy_position[0], command_record.max_healthy_position[0] = np.inf, -np.inf
            command_record.min_acceleration_per_rad, command_record.max_acceleration_per_rad = np.inf, -np.inf
        limited_command = min(
            max(commanded_rad[s], surface.actuator.travel_low), surface.actuator.travel_high
        )
        command_record.command_history[0, types.block.n_frames_so_far] = limited_command
        command_record.min_command[0], command_record.max_command[0] = (
            min(command_record.min_command[0], limited_command),
            max(command_record.max_command[0], limited_command),
        )
        command_record.min_healthy_position[0] = min(
            command_record.min_healthy_position[0], effectiveness_and_position_extremes.u_min[s]
        )
        command_record.max_healthy_position[0] = max(
            command_record.max_healthy_position[0], effectiveness_and_position_extremes.u_max[s]
        )
        command_record.min_acceleration_per_rad = min(
            command_record.min_acceleration_per_rad, effectiveness_and_position_extremes.G_min[s]
        )
        command_record.max_acceleration_per_rad = max(
            command_record.max_acceleration_per_rad, effectiveness_and_position_extremes.G_max[s]
        )


@kernel
def shift_observations_and_infer_positions(
    types, layout, estimators, innovation_by_axis, innovation_bound_by_axis
):
    """Find where each surface was in the elapsed frame, or block, if it alone is at fault.

    innovation_bound_by_axis (3,): on innovation_by_axis (3,) without a fault, rad/s2.
    """
    innovation_exceeds_uncertainty = not isolation.eta_explains(innovation_by_axis, innovation_bound_by_axis)
    for s, surface in enumerate(types.surface):
        shift_observations(surface)
        set_is_anomalous(surface, innovation_exceeds_uncertainty)
        fie, axis = estimators[layout.position[s]], layout.dominant_axis[s]
        mean_effect_record = fie.mean_effect if types.config.frames_per_block > 1 else fie.effect
        fill_last_observation_from_innovation(
            types.config, surface, fie, axis, innovation_by_axis, innovation_bound_by_axis, mean_effect_record
        )


@kernel
def increment_anomalous_frame_counts(surface):
    """Count a frame as evidence, and as evidence since a stop could last hide a swing
    (`judge_previous_and_advance_frame`)."""
    surface.evidence.n_anomalous_frames += 1
    surface.evidence.n_anomalous_frames_since_stop_could_hide += 1


@kernel
def store_first_anomaly_and_narrow_sets(config, surface, k):
    """Test every type of one surface with the judged frame, in which something was wrong."""
    anomaly_evidence, judged_observation = surface.evidence, surface.judged_observation
    if judged_observation.position_low > judged_observation.position_high:
        return
    if anomaly_evidence.first_anomalous_frame < 0:
        (
            anomaly_evidence.first_anomalous_frame,
            anomaly_evidence.first_anomalous_position_low,
            anomaly_evidence.first_anomalous_position_high,
        ) = (
            k,
            judged_observation.position_low,
            judged_observation.position_high,
        )
    intersect_consistent_interval_each(config, surface, k)


@kernel
def judge_previous_and_advance_frame(types):
    """Judge the frame before the elapsed one."""
    config, k = types.config, types.frame_index - 1
    for s, surface in enumerate(types.surface):
        before_judging_frame_each(config, surface)
        if config.released_surface_returns_via_actuator and types.frame_index > 0:
            on_possible_release_each(config, surface, k)
        if (
            config.abrupt
            and surface.accommodation.mode == GIVE_UP
            and not surface.judged_observation.is_anomalous
        ):
            count_rest_evidence_and_exclude_types(types, s)
        elif surface.judged_observation.is_anomalous and (
            config.frame_shows_single_instant
            or (surface.earlier_observation.is_anomalous and surface.last_observation.is_anomalous)
        ):
            increment_anomalous_frame_counts(surface)
            store_first_anomaly_and_narrow_sets(config, surface, k)
        else:
            on_skipped_frame_each(config, surface, k)
        if config.released_surface_returns_via_actuator and types.frame_index > 0:
            set_feasible_set_after_frame_each(surface)
            propagate_release_each(config, surface)
        if (
            surface.judged_observation.stop_can_hide_deflection[0]
            or surface.judged_observation.stop_can_hide_deflection[1]
        ):
            surface.evidence.n_anomalous_frames_since_stop_could_hide = 0
    types.frame_index += 1


@kernel
def observe_frame_and_judge_previous(types, layout, estimators, innovation_by_axis, bound_record):
    """Observe the elapsed frame, or the block that it completes, and judge the one before."""
    if types.config.frames_per_block > 1:
        advance_block_and_judge_previous(types, layout, estimators, innovation_by_axis, bound_record)
        return
    shift_observations_and_infer_positions(types, layout, estimators, innovation_by_axis, bound_record.nu_max)
    judge_previous_and_advance_frame(types)


@kernel
def begin_frame_block(types, layout, estimators, n_bar_old):
    """Begin a block with the elapsed frame; n_old (3,) rad/s: as it began."""
    block = types.block
    block.mean_innovation[:], block.mean_innovation_bound[:] = 0.0, 0.0
    block.changing_gyro_error_bound_at_start[:] = n_bar_old
    for estimator_index in layout.position:
        isolation.clear_mean_effect(estimators[estimator_index].mean_effect)


@kernel
def add_frame_to_block(types, layout, estimators, innovation_by_axis, eta_bar):
    """Add the elapsed frame to the means over the block."""
    block, frame_share_of_block = types.block, 1.0 / types.config.frames_per_block
    for i in range(3):
        block.mean_innovation[i] += frame_share_of_block * innovation_by_axis[i]
        block.mean_innovation_bound[i] += frame_share_of_block * eta_bar[i]
    for estimator_index in layout.position:
        isolation.add_to_mean(
            estimators[estimator_index].mean_effect,
            estimators[estimator_index].effect,
            frame_share_of_block,
        )


@kernel
def advance_block_and_judge_previous(types, layout, estimators, innovation_by_axis, bound_record):
    """Add the elapsed frame to its block; with the last frame, observe the block and judge the one before."""
    config, block = types.config, types.block
    if block.n_frames_so_far == 0:
        begin_frame_block(types, layout, estimators, bound_record.n_old)
    add_frame_to_block(types, layout, estimators, innovation_by_axis, bound_record.eta_bar)
    block.n_frames_so_far += 1
    if block.n_frames_so_far < config.frames_per_block:
        return
    block.n_frames_so_far = 0
    for i in range(3):
        block.mean_innovation_bound[i] += (
            block.changing_gyro_error_bound_at_start[i] + bound_record.n_gyro[i]
        ) / config.block_duration_s
    shift_observations_and_infer_positions(
        types, layout, estimators, block.mean_innovation, block.mean_innovation_bound
    )
    judge_previous_and_advance_frame(types)


@kernel
def count_rest_evidence_and_exclude_types(types, surface_index):
    """A surface given up, and commanded to where it happens to be, shows by its quiet that it does not swing.

    That is evidence against the other surfaces too, as far as only one of them all is in question. It takes a
    fault that is declared to stay: of one that may go, the quiet may be that of health.
    """
    surface = types.surface[surface_index]
    if not judged_position_agrees_with_rest_position(surface):
        return
    for each_surface_index, each_surface in enumerate(types.surface):
        if each_surface_index == surface_index or (
            surface.status.may_be_sole_fault and each_surface.status.may_be_sole_fault
        ):
            increment_anomalous_frame_counts(each_surface)
    surface.evidence.n_rest_frames += 1
    if surface.evidence.n_rest_frames > types.config.slowest_half_cycle_frames and not types.config.has_eG:
        for type_index in range(N_TYPES):
            if MEANING_OF_REST_BY_TYPE[type_index] == REST_EXCLUDES_TYPE:
                mark_type_excluded(surface, type_index)


@kernel
def judged_position_agrees_with_rest_position(surface):
    """Whether the judged frame agrees with where the surface is known to stand."""
    for type_index in range(N_TYPES):
        set_low, set_high = surface.feasible_sets.low[type_index], surface.feasible_sets.high[type_index]
        judged_position_is_outside_set = (
            surface.judged_observation.position_low > set_high
            or surface.judged_observation.position_high < set_low
        )
        if (
            MEANING_OF_REST_BY_TYPE[type_index] == REST_POSITION_IS_PARAMETER
            and judged_position_is_outside_set
        ):
            return False
    return True
