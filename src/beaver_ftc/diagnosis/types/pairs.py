"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. Where both surfaces were follows exactly in every
frame, whichever is at fault, and a surface is judged in those frames in which it was certainly off. One is
named when the other alone cannot explain the flight; both are when neither can and each has a type left.

*Pitch*: two unknowns in one equation. A constant that explains everything on one surface is taken for one
fault. Once that was named, with its constant, a second fault that refutes it is found on the other surface,
whose deflection follows from what is known of the first, taken to last. If nothing on the other surface
explains that either, the name of the first is withdrawn. Anything else stays open.

A surface's group and the other surface in it are looked up in the layout. types: of `fault_types_dtype`;
previous_conclusion: of `conclusion_dtype`; estimators: those of the isolation.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import state
from beaver_ftc.diagnosis.state import LATERAL_GROUP, PITCH, PITCH_GROUP, ROLL, YAW
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    fill_observation_and_check_reach,
    last_midpoint_deflection_error,
    mark_observations_not_anomalous,
    registry,
    restore_first_pitch_fault_sets,
    set_is_anomalous,
    set_known_position_and_clear_anomaly,
    verdict,
)
from beaver_ftc.diagnosis.types.registry import (
    ACCOMMODATION_MODE_BY_TYPE,
    N_CONSTANT_PARAMETER_TYPES,
    possible_deflection_range,
)
from beaver_ftc.diagnosis.types.verdict import (
    NO_SURFACE,
    any_constant_parameter_type_remains,
    estimator_or_deduction_allows_fault,
    type_is_not_excluded,
)


@kernel
def latch_group_alarms(pair_record, filter_bank):
    """Latch for each group of surfaces whether a residual of the bank has exceeded its threshold."""
    for axis in range(3):
        group_index = PITCH_GROUP if axis == PITCH else LATERAL_GROUP
        for filter_index in range(filter_bank.config.n_filters):
            if (
                abs(filter_bank.output.residual[filter_index, axis])
                > filter_bank.output.threshold[filter_index, axis]
            ):
                pair_record.group_has_alarm[group_index] = 1


@kernel
def locate_lateral_and_flag_unreachable(
    types, layout, estimators, innovation_by_axis, innovation_bound_by_axis
):
    """Find the positions of ailerons and rudder in the elapsed frame: nu = G (p - u) + eta solved for p; nu:
    innovation_by_axis (3,), |eta| <= innovation_bound_by_axis (3,) rad/s2."""
    aileron_index, rudder_index = layout.main[ROLL], layout.main[YAW]
    aileron_effect_record = estimators[layout.position[aileron_index]].effect
    rudder_effect_record = estimators[layout.position[rudder_index]].effect
    aileron_roll_acceleration_per_rad = aileron_effect_record.regressor[ROLL]
    aileron_yaw_acceleration_per_rad = aileron_effect_record.regressor[YAW]
    rudder_roll_acceleration_per_rad = rudder_effect_record.regressor[ROLL]
    rudder_yaw_acceleration_per_rad = rudder_effect_record.regressor[YAW]
    roll_innovation, yaw_innovation = innovation_by_axis[ROLL], innovation_by_axis[YAW]
    roll_innovation_tolerance = (
        innovation_bound_by_axis[ROLL] + aileron_effect_record.e[ROLL] + rudder_effect_record.e[ROLL]
    )
    yaw_innovation_tolerance = (
        innovation_bound_by_axis[YAW] + aileron_effect_record.e[YAW] + rudder_effect_record.e[YAW]
    )
    determinant = (
        aileron_roll_acceleration_per_rad * rudder_yaw_acceleration_per_rad
        - aileron_yaw_acceleration_per_rad * rudder_roll_acceleration_per_rad
    )
    abs_determinant = abs(determinant)
    aileron_deflection_error = (
        roll_innovation * rudder_yaw_acceleration_per_rad - yaw_innovation * rudder_roll_acceleration_per_rad
    ) / determinant
    aileron_deflection_error_tolerance = (
        roll_innovation_tolerance * abs(rudder_yaw_acceleration_per_rad)
        + yaw_innovation_tolerance * abs(rudder_roll_acceleration_per_rad)
    ) / abs_determinant
    aileron_is_within_reach = fill_observation_and_check_reach(
        types.surface[aileron_index], aileron_deflection_error, aileron_deflection_error_tolerance
    )
    rudder_deflection_error = (
        yaw_innovation * aileron_roll_acceleration_per_rad
        - roll_innovation * aileron_yaw_acceleration_per_rad
    ) / determinant
    rudder_deflection_error_tolerance = (
        yaw_innovation_tolerance * abs(aileron_roll_acceleration_per_rad)
        + roll_innovation_tolerance * abs(aileron_yaw_acceleration_per_rad)
    ) / abs_determinant
    if not (
        fill_observation_and_check_reach(
            types.surface[rudder_index], rudder_deflection_error, rudder_deflection_error_tolerance
        )
        and aileron_is_within_reach
    ):
        types.pair.lateral_fault_outside_class = 1


@kernel
def constant_parameter_types_deflection_range(config, surface, k):
    """Least and greatest deflection (rad) of a surface by the elapsed frame, of this number, over all types
    of a constant that are left."""
    min_deflection, max_deflection = np.inf, -np.inf
    for type_index in range(N_CONSTANT_PARAMETER_TYPES):
        if type_is_not_excluded(surface, type_index):
            type_min_deflection, type_max_deflection = possible_deflection_range(
                config, surface, type_index, k
            )
            min_deflection = min(min_deflection, type_min_deflection)
            max_deflection = max(max_deflection, type_max_deflection)
    reachable_low, reachable_high = surface.actuator.reachable_low, surface.actuator.reachable_high
    return (
        min(max(min_deflection, reachable_low), reachable_high),
        min(max(max_deflection, reachable_low), reachable_high),
    )


@kernel
def flag_pitch_anomaly_or_locate_second(
    types, layout, estimators, innovation_by_axis, innovation_bound_by_axis
):
    """Set whether the frame is anomalous in pitch; after a second fault has begun, find where the second
    surface was."""
    first_fault_surface_index = types.pair.first_pitch_fault_surface
    if (
        first_fault_surface_index != NO_SURFACE
        and not types.surface[first_fault_surface_index].status.may_be_sole_fault
    ):
        locate_second_pitch_or_deduce_healthy(
            types, layout, estimators, innovation_by_axis, innovation_bound_by_axis
        )
        return
    for s, surface in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP:
            set_is_anomalous(surface, abs(innovation_by_axis[PITCH]) > innovation_bound_by_axis[PITCH])


@kernel
def locate_second_pitch_or_deduce_healthy(
    types, layout, estimators, innovation_by_axis, innovation_bound_by_axis
):
    """Find the position of the second surface, given the sets of the first."""
    first_fault_surface_index = types.pair.first_pitch_fault_surface
    second_surface_index = layout.partner[first_fault_surface_index]
    first_effect_record = estimators[layout.position[first_fault_surface_index]].effect
    second_effect_record = estimators[layout.position[second_surface_index]].effect
    first_surface = types.surface[first_fault_surface_index]
    first_surface_min_deflection, first_surface_max_deflection = constant_parameter_types_deflection_range(
        types.config, first_surface, types.frame_index
    )
    set_known_position_and_clear_anomaly(
        first_surface, first_surface_min_deflection, first_surface_max_deflection
    )
    second_pitch_acceleration_per_rad = second_effect_record.regressor[PITCH]
    first_pitch_acceleration_per_rad = first_effect_record.regressor[PITCH]
    first_fault_acceleration = first_pitch_acceleration_per_rad * last_midpoint_deflection_error(
        first_surface
    )
    acceleration_tolerance = (
        abs(first_pitch_acceleration_per_rad)
        * 0.5
        * (first_surface_max_deflection - first_surface_min_deflection)
    )
    acceleration_tolerance += (
        innovation_bound_by_axis[PITCH] + first_effect_record.e[PITCH] + second_effect_record.e[PITCH]
    )
    if not fill_observation_and_check_reach(
        types.surface[second_surface_index],
        (innovation_by_axis[PITCH] - first_fault_acceleration) / second_pitch_acceleration_per_rad,
        acceleration_tolerance / abs(second_pitch_acceleration_per_rad),
    ):
        types.surface[second_surface_index].status.can_be_at_fault_basis = verdict.DEDUCED_HEALTHY


@kernel
def observe_pairs_and_judge_previous(types, layout, estimators, filter_bank, innovation_bound_by_axis):
    """Observe the elapsed frame, plane by plane, and judge the one before; innovation_bound_by_axis (3,):
    bound on the innovation."""
    latch_group_alarms(types.pair, filter_bank)
    registry.shift_observations_and_infer_positions(
        types, layout, estimators, filter_bank.output.innovation, innovation_bound_by_axis
    )
    locate_lateral_and_flag_unreachable(
        types, layout, estimators, filter_bank.output.innovation, innovation_bound_by_axis
    )
    flag_pitch_anomaly_or_locate_second(
        types, layout, estimators, filter_bank.output.innovation, innovation_bound_by_axis
    )
    registry.judge_previous_and_advance_frame(types)


@kernel
def update_isolation_type_and_times(surface, is_isolated, type_index, t):
    """Name a surface and the type of its fault (-1 if open), or take the name back; t s."""
    type_index = type_index if is_isolated else -1
    finding_record = surface.status
    if is_isolated and not finding_record.is_isolated:
        finding_record.isolated_at_s = t
    if type_index != finding_record.fault_type:
        finding_record.typed_at_s = t
    finding_record.is_isolated, finding_record.fault_type = is_isolated, type_index


@kernel
def isolate_lateral_or_find_unanticipated(types, layout, t):
    """Set the isolation of the surfaces of roll and yaw. Returns whether the fault of this plane is outside
    the class."""
    config, pair_record = types.config, types.pair
    roll_surface, yaw_surface = types.surface[layout.main[ROLL]], types.surface[layout.main[YAW]]
    roll_alone_can_be_at_fault = estimator_or_deduction_allows_fault(roll_surface)
    yaw_alone_can_be_at_fault = estimator_or_deduction_allows_fault(yaw_surface)
    both_must_be_at_fault = not roll_alone_can_be_at_fault and not yaw_alone_can_be_at_fault
    class_is_refuted = (
        pair_record.lateral_fault_outside_class == 1
        or not verdict.any_type_remains(roll_surface)
        or not verdict.any_type_remains(yaw_surface)
    )
    fault_is_outside_class = both_must_be_at_fault and class_is_refuted
    types_do_not_explain_flight_yet = both_must_be_at_fault and not (
        verdict.any_type_explains_flight(roll_surface) and verdict.any_type_explains_flight(yaw_surface)
    )
    can_isolate = pair_record.group_has_alarm[LATERAL_GROUP] == 1 and not (
        fault_is_outside_class or types_do_not_explain_flight_yet
    )
    update_isolation_type_and_times(
        roll_surface,
        can_isolate and not yaw_alone_can_be_at_fault,
        verdict.fault_type_on_surface(config, roll_surface),
        t,
    )
    update_isolation_type_and_times(
        yaw_surface,
        can_isolate and not roll_alone_can_be_at_fault,
        verdict.fault_type_on_surface(config, yaw_surface),
        t,
    )
    return fault_is_outside_class


@kernel
def update_first_fault_surface_and_sets(types, s):
    """Keep what is known of the one pitch fault, and again when fewer types have been left for a while.

    What refutes a type may be a second fault that begins to show, and is about to refute all of them.
    """
    pair_record, surface, has_new_exclusion = types.pair, types.surface[s], False
    stored_sets = surface.first_pitch_fault_sets
    for type_index in range(N_CONSTANT_PARAMETER_TYPES):
        has_new_exclusion = (
            has_new_exclusion
            or surface.feasible_sets.excluded[type_index] != stored_sets.excluded[type_index]
        )
    pair_record.n_frames_since_unstored_exclusion = (
        pair_record.n_frames_since_unstored_exclusion + 1 if has_new_exclusion else 0
    )
    if (
        pair_record.first_pitch_fault_surface != s
        or pair_record.n_frames_since_unstored_exclusion >= types.config.slowest_half_cycle_frames
    ):
        pair_record.first_pitch_fault_surface, pair_record.n_frames_since_unstored_exclusion = s, 0
        stored_sets.low[:], stored_sets.high[:] = surface.feasible_sets.low, surface.feasible_sets.high
        stored_sets.excluded[:] = 1
        stored_sets.excluded[:N_CONSTANT_PARAMETER_TYPES] = surface.feasible_sets.excluded[
            :N_CONSTANT_PARAMETER_TYPES
        ]


@kernel
def begin_second_pitch_fault(types, layout):
    """The one known pitch fault no longer explains the flight: there is a second fault."""
    first_surface = types.surface[types.pair.first_pitch_fault_surface]
    second_surface = types.surface[layout.partner[types.pair.first_pitch_fault_surface]]
    restore_first_pitch_fault_sets(first_surface)
    registry.restart_surface_sets_and_evidence(second_surface)
    for surface in (first_surface, second_surface):
        surface.status.may_be_sole_fault, surface.status.can_be_at_fault_basis = 0, verdict.DEDUCED_FAULTY
        mark_observations_not_anomalous(surface)


@kernel
def varying_types_can_be_dismissed(config, surface):
    """Whether a slow oscillation, a slow surface or a growing bias would have shown by now."""
    command_independent_type_may_imitate = verdict.can_be_another_type(
        surface, verdict.sole_constant_type_or_undecided(surface), False
    )
    varying_type_may_imitate = (
        command_independent_type_may_imitate or verdict.short_anomaly_may_be_rest_hidden_type(config, surface)
    )
    anomaly_spans_half_cycle = surface.evidence.n_anomalous_frames >= config.slowest_half_cycle_frames
    return (
        anomaly_spans_half_cycle
        and verdict.types_would_have_shown(config, surface)
        and not varying_type_may_imitate
    )


@kernel
def detect_and_begin_second_pitch_fault(types, layout):
    """Whether a second pitch fault has shown in addition to the known one."""
    if (
        types.pair.first_pitch_fault_surface == NO_SURFACE
        or layout.partner[types.pair.first_pitch_fault_surface] < 0
    ):
        return False
    first_surface = types.surface[types.pair.first_pitch_fault_surface]
    if first_surface.status.may_be_sole_fault and not (
        estimator_or_deduction_allows_fault(first_surface)
        and any_constant_parameter_type_remains(first_surface)
    ):
        begin_second_pitch_fault(types, layout)
    return not first_surface.status.may_be_sole_fault


@kernel
def pitch_type_unless_mode_gives_up(config, surface):
    """The type of the one fault of pitch, or -1 while it is open.

    A jam may as well be a trailing surface or one at its stop, if the other surface is off by a constant.
    """
    fault_type = verdict.fault_type_on_surface(config, surface)
    return (
        verdict.TYPE_UNDECIDED
        if fault_type >= 0 and ACCOMMODATION_MODE_BY_TYPE[fault_type] == GIVE_UP
        else fault_type
    )


@kernel
def decide_pitch_isolation(types, layout, t):
    """Which surface of pitch is at fault, if any."""
    if detect_and_begin_second_pitch_fault(types, layout):
        first_surface = types.surface[types.pair.first_pitch_fault_surface]
        second_surface_index = layout.partner[types.pair.first_pitch_fault_surface]
        second_surface = types.surface[second_surface_index]
        second_is_anomalous = second_surface.evidence.n_anomalous_frames > 0
        second_may_be_at_fault = estimator_or_deduction_allows_fault(
            second_surface
        ) and verdict.any_type_remains(second_surface)
        update_isolation_type_and_times(
            first_surface,
            second_may_be_at_fault or not second_is_anomalous,
            first_surface.status.fault_type,
            t,
        )
        second_shows_fault = (
            second_is_anomalous
            and second_may_be_at_fault
            and verdict.any_type_explains_flight(second_surface)
        )
        update_isolation_type_and_times(
            second_surface, second_shows_fault, verdict.fault_type_on_surface(types.config, second_surface), t
        )
        return
    sole_surface_index = find_and_store_sole_pitch_fault(types, layout)
    for surface_index, surface in enumerate(types.surface):
        if layout.group[surface_index] == PITCH_GROUP:
            update_isolation_type_and_times(
                surface,
                surface_index == sole_surface_index,
                pitch_type_unless_mode_gives_up(types.config, surface)
                if surface_index == sole_surface_index
                else -1,
                t,
            )


@kernel
def find_and_store_sole_pitch_fault(types, layout):
    """The surface of pitch at fault if a constant explains everything on it, or NO_SURFACE."""
    s = (
        verdict.find_isolated_surface_or_unanticipated(types, layout)
        if types.pair.group_has_alarm[PITCH_GROUP]
        else NO_SURFACE
    )
    if s < 0 or not any_constant_parameter_type_remains(types.surface[s]):
        return NO_SURFACE
    if varying_types_can_be_dismissed(types.config, types.surface[s]):
        update_first_fault_surface_and_sets(types, s)
    return s


@kernel
def decide_pair_isolation_and_accommodation(types, previous_conclusion, layout, t):
    """Name surfaces and types plane by plane; t s. Returns the finding for
    `conclusion.record_decision`: its isolated estimator is of the one named first, the law
    acts on all. previous_conclusion: that of the frame before."""
    lateral_fault_outside_class = isolate_lateral_or_find_unanticipated(types, layout, t)
    decide_pitch_isolation(types, layout, t)
    first_isolated_surface_index = NO_SURFACE
    for s, surface in enumerate(types.surface):
        finding_record = surface.status
        first_finding_record = types.surface[max(first_isolated_surface_index, 0)].status
        if finding_record.is_isolated and (
            first_isolated_surface_index < 0
            or finding_record.isolated_at_s < first_finding_record.isolated_at_s
        ):
            first_isolated_surface_index = s
    isolated_estimator_index, isolated_at_s, fault_type, type_decided_at_s = (
        first_fault_estimator_type_and_times(
            types, previous_conclusion, layout, first_isolated_surface_index, lateral_fault_outside_class, t
        )
    )
    accommodated_surface_index, accommodation_mode = accommodate_isolated_surfaces_and_choose_lead(
        types, layout
    )
    return (
        isolated_estimator_index,
        isolated_at_s,
        fault_type,
        type_decided_at_s,
        accommodated_surface_index,
        accommodation_mode,
    )


@kernel
def first_fault_estimator_type_and_times(
    types, previous_conclusion, layout, s, lateral_fault_outside_class, t
):
    """The finding on surface s, the first named, as that of a single fault: estimator, its instant, type, its
    instant. NO_SURFACE: none is named, and the fault of roll and yaw may be outside the class."""
    if s >= 0:
        finding_record = types.surface[s].status
        isolated_estimator_index = verdict.estimator_of_fault(layout, s, finding_record.fault_type)
        return (
            isolated_estimator_index,
            finding_record.isolated_at_s,
            finding_record.fault_type,
            finding_record.typed_at_s,
        )
    isolated_estimator_index = state.UNANTICIPATED if lateral_fault_outside_class else state.NOT_ISOLATED
    isolated_at_s = (
        t
        if isolated_estimator_index != previous_conclusion.isolated_estimator
        else previous_conclusion.isolated_at_s
    )
    return isolated_estimator_index, isolated_at_s, -1, previous_conclusion.typed_at_s


@kernel
def any_pitch_surface_is_isolated(types, layout):
    """Whether a surface of pitch is named."""
    for s, surface in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP and surface.status.is_isolated:
            return True
    return False


@kernel
def is_isolated_or_likeliest_in_pitch(types, layout, s):
    """Whether the law is to act on surface s: it is isolated, or it is the most likely one in pitch."""
    if types.surface[s].status.is_isolated:
        return True
    if (
        layout.group[s] != PITCH_GROUP
        or any_pitch_surface_is_isolated(types, layout)
        or not types.pair.group_has_alarm[PITCH_GROUP]
    ):
        return False
    sole_possible_surface_index = verdict.sole_possible_surface(types.surface, True)
    return s == (sole_possible_surface_index if sole_possible_surface_index >= 0 else layout.main[PITCH])


@kernel
def accommodate_isolated_surfaces_and_choose_lead(types, layout):
    """Settle what the law does about each surface. Returns the lead, which the supervisor follows, and what
    is done about it: a replaced elevator leads before all others."""
    accommodated_surface_index, accommodation_mode = NO_SURFACE, -1
    for s, surface in enumerate(types.surface):
        verdict.set_accommodation_mode(surface, -1)
        if is_isolated_or_likeliest_in_pitch(types, layout, s):
            fault_is_possible = surface.status.is_isolated == 1 or estimator_or_deduction_allows_fault(
                surface
            )
            surface_mode = (
                verdict.choose_accommodation_mode(surface) if fault_is_possible else SUBTRACT_OFFSET
            )
            if verdict.update_fault_presence(types.config, surface, surface_mode, fault_is_possible):
                verdict.set_accommodation_mode(surface, surface_mode)
                elevator_is_scaled_or_given_up = s == layout.main[PITCH] and surface_mode in (
                    SCALE_COMMAND,
                    GIVE_UP,
                )
                if accommodated_surface_index == NO_SURFACE or elevator_is_scaled_or_given_up:
                    accommodated_surface_index, accommodation_mode = s, surface_mode
    return accommodated_surface_index, accommodation_mode
