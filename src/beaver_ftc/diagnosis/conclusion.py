"""The conclusion about the surfaces, and the assessment of each surface that the laws read.

The conclusion holds the alarm, surface and type of the fault, and the surface on which the law acts. The
stages of the diagnosis return their findings: a detector the axis of its alarm, the isolation the estimator
that is left, the fault types a surface with its type, a monitor whether the cause is no surface. The frame
(loop/frame.py) hands each of them to a kernel of this file, and no other file writes the conclusion.

The assessment holds effectiveness, offset and lag of each surface, by whichever stage estimates them. It is
the output of the diagnosis. No other file writes it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, WORST_CASE_DETECTOR
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    last_midpoint_deflection_error,
    verdict,
)

MAX_WITHDRAWN_ISOLATIONS = 16

# Why an isolation is withdrawn: an estimator refutes the surface, all types are excluded on it, a sensor is
# found broken, a plug-in says so; or none of these, and it is one of several that are possible.
SURFACE_REFUTED, TYPES_REFUTED, SENSOR_BROKEN, PLUGIN_DECIDES, SEVERAL_POSSIBLE = range(5)

# An isolation that was withdrawn, or the type of one: surface and type, -1 if open, from when to when, s.
WITHDRAWN_ISOLATION_RECORD = record(surface=int, fault_type=int, from_s=float, to_s=float, reason=int)


@sized
def conclusion_dtype(n_surfaces: int) -> np.dtype:
    """The conclusion about n surfaces. isolated_estimator: that of the isolated fault, NOT_ISOLATED or
    UNANTICIPATED. fault_type: of the isolated fault, -1 if open. accommodated_surface, accommodation_mode:
    the surface the law acts upon, and its accommodation mode. effectiveness: of every surface, where a
    plug-in estimates it (has_effectiveness). isolated_from_s: since when each surface is isolated, -1 if it
    is not; isolated_type, type_from_s: its type, -1 if open, and since when. withdrawn_isolations,
    withdrawn_types: what was isolated before, and of which other type."""
    return record(
        detected=int, detected_at_s=float, detected_axis=int, isolated_estimator=int, isolated_at_s=float,
        fault_type=int, type_decided_at_s=float, accommodated_surface=int, accommodation_mode=int,
        has_effectiveness=int,
        effectiveness=n_surfaces, isolated_from_s=n_surfaces,
        isolated_type=(int, n_surfaces), type_from_s=n_surfaces,
        n_withdrawn_isolations=int, n_withdrawn_types=int,
        withdrawn_isolations=(WITHDRAWN_ISOLATION_RECORD, MAX_WITHDRAWN_ISOLATIONS),
        withdrawn_types=(WITHDRAWN_ISOLATION_RECORD, MAX_WITHDRAWN_ISOLATIONS),
    )  # fmt: skip


def reset_conclusion(conclusion: np.void) -> None:
    """Fill the record of a diagnosis that has concluded nothing."""
    conclusion["detected_at_s"] = conclusion["isolated_at_s"] = -1.0
    conclusion["isolated_estimator"], conclusion["isolated_from_s"] = NOT_ISOLATED, -1.0
    conclusion["isolated_type"], conclusion["type_from_s"] = -1, -1.0
    conclusion["fault_type"] = conclusion["accommodated_surface"] = conclusion[
        "accommodation_mode"
    ] = conclusion["type_decided_at_s"] = -1


@kernel
def latch_alarm(conclusion, axis, t):
    """Latch an alarm at t s on an axis, -1 if it has no axis: only the first alarm is recorded."""
    if not conclusion.detected:
        conclusion.detected, conclusion.detected_at_s, conclusion.detected_axis = 1, t, axis


@kernel
def set_isolated_estimator_and_time(conclusion, isolated_estimator, t):
    """Replace the isolated fault; if it is another one, its time of isolation becomes t s."""
    if isolated_estimator != conclusion.isolated_estimator:
        conclusion.isolated_estimator, conclusion.isolated_at_s = isolated_estimator, t


@kernel
def record_isolation_and_accommodation(conclusion, isolation_and_accommodation):
    """Replace isolated fault, type and accommodation by those that the fault types found.

    isolation_and_accommodation: (isolated, isolated_at_s, type, type_at_s, accommodated_surface,
    accommodation_mode).
    """
    conclusion.isolated_estimator, conclusion.isolated_at_s = (
        isolation_and_accommodation[0],
        isolation_and_accommodation[1],
    )
    conclusion.fault_type, conclusion.type_decided_at_s = (
        isolation_and_accommodation[2],
        isolation_and_accommodation[3],
    )
    conclusion.accommodated_surface, conclusion.accommodation_mode = (
        isolation_and_accommodation[4],
        isolation_and_accommodation[5],
    )


@kernel
def record_plugin_verdict(conclusion, plugin_verdict, t):
    """Replace the built-in conclusion at t s by the verdict of a plug-in."""
    if plugin_verdict.detected:
        latch_alarm(conclusion, plugin_verdict.axis, t)
    set_isolated_estimator_and_time(
        conclusion, plugin_verdict.isolated if conclusion.detected else NOT_ISOLATED, t
    )
    conclusion.has_effectiveness = plugin_verdict.has_effectiveness
    conclusion.effectiveness[:] = plugin_verdict.effectiveness


@kernel
def withdraw_conclusion_for_sensor_fault(conclusion):
    """Withdraw alarm, isolation and type, because a sensor is broken and no surface; times of isolation of
    single surfaces and withdrawn isolations stay."""
    conclusion.detected, conclusion.isolated_estimator, conclusion.fault_type = 0, NOT_ISOLATED, -1
    conclusion.detected_at_s = conclusion.isolated_at_s = -1.0
    conclusion.accommodated_surface = conclusion.accommodation_mode = -1


@kernel
def update_isolation_interval(conclusion, surface_index, is_isolated, t, isolated_type, reason):
    """Record at t s whether a surface is isolated, and of which type (-1 if open); store what is withdrawn,
    and why. If a store is full, the latest one replaces the last."""
    isolated_from_s = conclusion.isolated_from_s[surface_index]
    earlier_type = conclusion.isolated_type[surface_index]
    if is_isolated and isolated_from_s < 0.0:
        conclusion.isolated_from_s[surface_index] = t
    elif isolated_from_s >= 0.0 and not is_isolated:
        store_withdrawn(
            conclusion.withdrawn_isolations, conclusion.n_withdrawn_isolations, surface_index, earlier_type,
            isolated_from_s, t, reason,
        )  # fmt: skip
        conclusion.n_withdrawn_isolations += 1
        conclusion.isolated_from_s[surface_index] = -1.0
    elif earlier_type >= 0 and isolated_type != earlier_type:
        store_withdrawn(
            conclusion.withdrawn_types, conclusion.n_withdrawn_types, surface_index, earlier_type,
            conclusion.type_from_s[surface_index], t, reason,
        )  # fmt: skip
        conclusion.n_withdrawn_types += 1
    isolated_type = isolated_type if is_isolated else -1
    if isolated_type != earlier_type:
        conclusion.isolated_type[surface_index], conclusion.type_from_s[surface_index] = isolated_type, t


@kernel
def store_withdrawn(store, n_stored, surface_index, withdrawn_type, from_s, to_s, reason):
    """Fill the next record of a store (MAX_WITHDRAWN_ISOLATIONS,)."""
    withdrawn = store[min(n_stored, MAX_WITHDRAWN_ISOLATIONS - 1)]
    withdrawn.surface, withdrawn.fault_type, withdrawn.reason = surface_index, withdrawn_type, reason
    withdrawn.from_s, withdrawn.to_s = from_s, to_s


@kernel
def reason_of_withdrawal(conclusion_is_by_plugin, sensor_is_broken, estimator_is_excluded, any_type_is_left):
    """Why a surface, or its type, is isolated no longer: the first of the reasons that is given."""
    if sensor_is_broken:
        return SENSOR_BROKEN
    if conclusion_is_by_plugin:
        return PLUGIN_DECIDES
    if estimator_is_excluded:
        return SURFACE_REFUTED
    return SEVERAL_POSSIBLE if any_type_is_left else TYPES_REFUTED


@kernel
def isolated_surface(conclusion, estimators):
    """The surface of the isolated fault, or -1."""
    return estimators[conclusion.isolated_estimator].surface if conclusion.isolated_estimator >= 0 else -1


@kernel
def has_no_surface_to_accommodate(conclusion):
    """True if the law has no surface to accommodate: none is isolated or accommodated, and no plug-in
    estimates effectiveness."""
    return (
        conclusion.isolated_estimator < 0
        and conclusion.accommodated_surface < 0
        and not conclusion.has_effectiveness
    )


# 1 / variance of an effectiveness that is known to 0.05: it is precise enough to be applied at once
MIN_LOSS_INFORMATION_TO_APPLY_IMMEDIATELY = 400.0


@sized
def assessment_dtype(n_surfaces: int) -> np.dtype:
    """The assessment of n surfaces.

    detected: a fault; no_surface_to_accommodate: true without a fault as well; isolated_surface: -1 for
    none. any_surface_lags: a surface follows its command late. accommodation_mode: of each surface, -1 where
    open, or where faults of every type are not diagnosed; effectiveness; apply_immediately: whether the law
    applies it at once, not gradually; deflection_offset, deflection_lag rad. unknown_acceleration (3,)
    rad/s2: explained by no known fault. pitch_undecided: elevator or flap is at fault, and it has long been
    open which. is_held: the surfaces are assessed as before a sensor broke.
    """
    return record(
        detected=int, no_surface_to_accommodate=int, diagnoses_all_types=int, isolated_surface=int,
        any_surface_lags=int,
        accommodation_mode=(int, n_surfaces),
        effectiveness=n_surfaces, apply_immediately=(int, n_surfaces), deflection_offset=n_surfaces,
        deflection_lag=n_surfaces,
        unknown_acceleration=3,
        pitch_undecided=int, is_held=int,
    )  # fmt: skip


@kernel
def assess_surfaces(assessment, config, conclusion, types, layout, estimators, statistical_detector):
    """Fill the assessment of this frame from the outputs of the stages; statistical_detector: of
    `statistical_dtype`."""
    diagnoses_all_types = config.diagnoses_all_types
    isolated_surface_index = isolated_surface(conclusion, estimators)
    assessment.is_held = 0
    assessment.detected, assessment.diagnoses_all_types = conclusion.detected, diagnoses_all_types
    assessment.isolated_surface, assessment.any_surface_lags, assessment.no_surface_to_accommodate = (
        isolated_surface_index,
        0,
        has_no_surface_to_accommodate(conclusion),
    )
    for s in range(assessment.accommodation_mode.size):
        assessment.accommodation_mode[s] = types.surface[s].accommodation.mode if diagnoses_all_types else -1
        assessment.effectiveness[s], assessment.apply_immediately[s] = 1.0, 0
        assessment.deflection_offset[s], assessment.deflection_lag[s] = 0.0, 0.0
        if conclusion.has_effectiveness and conclusion.detected:
            assessment.effectiveness[s] = conclusion.effectiveness[s]
        elif assessment.accommodation_mode[s] >= 0:
            assess_accommodated_surface(assessment, types, layout, estimators, s)
        elif s == isolated_surface_index and not diagnoses_all_types:
            uses_statistics = uses_statistical_estimates(
                statistical_detector.test_config, config.alarm_authority
            )
            is_loss_precise = (
                uses_statistics
                and statistical.estimate_loss_theta_and_information(statistical_detector.block, s)[1]
                > MIN_LOSS_INFORMATION_TO_APPLY_IMMEDIATELY
            )
            estimated_theta = estimated_theta_of_isolated_loss(
                config, conclusion, layout, estimators, statistical_detector, s
            )
            assessment.effectiveness[s] = 1.0 + estimated_theta
            assessment.apply_immediately[s] = is_loss_precise


@kernel
def hold_assessment(assessment, types):
    """Go on with the assessment from before a sensor broke: effectiveness, and offsets of constant faults.

    What varies from frame to frame cannot be estimated without the sensor, and is taken for zero.
    """
    assessment.is_held, assessment.any_surface_lags, assessment.deflection_lag[:] = 1, 0, 0.0
    for s, surface in enumerate(types.surface):
        if assessment.accommodation_mode[s] != GIVE_UP and not verdict.any_constant_parameter_type_remains(
            surface
        ):
            assessment.deflection_offset[s] = 0.0


@kernel
def assess_accommodated_surface(assessment, types, layout, estimators, s):
    """Fill the assessment of surface s, which the diagnosis of every type accommodates."""
    type_diagnosis = types.surface[s]
    can_be_at_fault = verdict.estimator_or_deduction_allows_fault(type_diagnosis)
    accommodation_mode = type_diagnosis.accommodation.mode
    if accommodation_mode == SCALE_COMMAND:
        assessment.effectiveness[s] = verdict.remaining_effectiveness(types, layout, estimators, s)
    elif accommodation_mode == GIVE_UP:
        assessment.effectiveness[s], assessment.apply_immediately[s] = 0.0, 1
        assessment.deflection_offset[s] = (
            type_diagnosis.last_observation.healthy_position
            + verdict.deflection_error(type_diagnosis, can_be_at_fault)
        )
    elif accommodation_mode == SUBTRACT_OFFSET:
        assessment.deflection_offset[s] = verdict.deflection_error(type_diagnosis, can_be_at_fault)
    elif accommodation_mode == WAIT_FOR_SURFACE:
        assessment.deflection_lag[s] = last_midpoint_deflection_error(type_diagnosis)
        assessment.any_surface_lags = 1


@kernel
def estimated_theta_of_isolated_loss(config, conclusion, layout, estimators, statistical_detector, s):
    """Estimated theta of the isolated loss of surface s: under noise, the most likely one."""
    if uses_statistical_estimates(statistical_detector.test_config, config.alarm_authority):
        return statistical.estimate_loss_theta_and_information(statistical_detector.block, s)[0]
    return estimators[conclusion.isolated_estimator].theta[layout.dominant_axis[s]]


@kernel
def uses_statistical_estimates(test_config, alarm_authority):
    """Whether the estimates of the statistical detector are used."""
    return test_config.enabled and alarm_authority != WORST_CASE_DETECTOR


@kernel
def assess_unknown_acceleration_and_pitch(
    assessment,
    config,
    conclusion,
    types,
    layout,
    statistical_detector,
    fault_approximation_estimator,
    bound_record,
):
    """Fill unknown_acceleration and pitch_undecided; fault_approximation_estimator: of `FDAE_RECORD`;
    bound_record: what is declared.

    The lag of a slow surface gives no unknown acceleration: to compensate it would wind up the command.
    """
    unknown_acceleration, diagnoses_all_types = assessment.unknown_acceleration, config.diagnoses_all_types
    unknown_acceleration[:] = 0.0
    waits_for_lagging_surface = (
        conclusion.accommodated_surface >= 0 and conclusion.accommodation_mode == WAIT_FOR_SURFACE
    )
    if (
        conclusion.detected
        and not waits_for_lagging_surface
        and uses_statistical_estimates(statistical_detector.test_config, config.alarm_authority)
    ):
        statistical.fill_statistical_unmodelled_acceleration(
            statistical_detector.block, statistical_detector.gust, unknown_acceleration
        )
    elif conclusion.detected and not waits_for_lagging_surface:
        filters.fill_fdae_unmodelled_acceleration_estimate(
            fault_approximation_estimator, bound_record.changing_gyro_error_bound, unknown_acceleration
        )
    fault_is_not_isolated = (
        diagnoses_all_types and conclusion.detected and conclusion.isolated_estimator == NOT_ISOLATED
    )
    pitch_anomaly_spans_half_cycle = (
        types.surface[layout.main[PITCH]].evidence.n_anomalous_frames
        >= types.config.slowest_half_cycle_frames
    )
    assessment.pitch_undecided = fault_is_not_isolated and pitch_anomaly_spans_half_cycle
