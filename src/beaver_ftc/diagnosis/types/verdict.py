"""From the types left to a verdict: surface, type, and what the law does; and the findings in words.

No type is named here: the columns of the table (`FaultType`) say what distinguishes one from another. Kernels
of one surface assume that it is at fault; `estimator_or_deduction_allows_fault` says whether it can be.
types: of `fault_types_dtype`; previous_conclusion: of `conclusion_dtype`; estimators: those of the isolation.

`fault_finding_dict` puts the verdict in words: surface, type, candidates, estimate. What the estimate is, and
in which unit, the type's row says (`FaultType.estimate_parameter`).
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, PITCH_GROUP, UNANTICIPATED
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    REST_HIDES_TYPE,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    feasible_set_midpoint,
    last_midpoint_deflection_error,
    registry,
)
from beaver_ftc.diagnosis.types.registry import (
    ACCOMMODATION_MODE_BY_TYPE,
    CAN_LOOK_LIKE,
    DEFLECTION_ERROR_TYPES_BY_PRECEDENCE,
    ERROR_DEPENDS_ON_COMMAND,
    FIRST_TYPE_WITH_SAME_NAME,
    HALF_CYCLES_BEFORE_ISOLATING_OTHER_SURFACE,
    MEANING_OF_REST_BY_TYPE,
    MODE_SERVES_TYPE,
    MUST_SHOW_ITSELF,
    N_CONSTANT_PARAMETER_TYPES,
    N_TYPES,
    SHOWS_WITHIN_HALF_CYCLES,
    STOP_DIRECTION_BY_TYPE,
    TYPE_INDEX_AT_END_OF_RANGE,
    deflection_error_under_type,
    has_shown,
    motion_rules_out,
)

NO_SURFACE, SEVERAL_SURFACES = -1, -2
TYPE_UNDECIDED, NO_TYPE = -1, -2  # the type of a fault of which more than one type is left, or none
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
ESTIMATOR_DECIDES_POSSIBLE_FAULT, DEDUCED_FAULTY, DEDUCED_HEALTHY = range(3)
MAX_TIME_WITHOUT_FAULT_SIGN_S = 0.2  # a fault that has not shown for so long is taken for gone
_TIME_TOLERANCE_S = 1e-9


@kernel
def record_position_estimator_exclusions(surfaces, layout, estimators):
    """Keep for every surface whether its estimator is excluded."""
    for s, surface in enumerate(surfaces):
        surface.position_estimator_excluded = estimators[layout.position[s]].excluded


@kernel
def estimator_or_deduction_allows_fault(surface):
    """Whether anything on a surface can be the fault."""
    if surface.status.can_be_at_fault_basis != ESTIMATOR_DECIDES_POSSIBLE_FAULT:
        return surface.status.can_be_at_fault_basis == DEDUCED_FAULTY
    return not surface.position_estimator_excluded


@kernel
def type_is_not_excluded(surface, type_index):
    """Whether a type is not excluded."""
    return not surface.feasible_sets.excluded[type_index]


@kernel
def any_constant_parameter_type_remains(surface):
    """Whether a type with a constant parameter is left."""
    # A loop: compiled code with np.all loads scipy.linalg, which takes longer than the flight.
    for type_index in range(N_CONSTANT_PARAMETER_TYPES):
        if type_is_not_excluded(surface, type_index):
            return True
    return False


@kernel
def any_type_remains(surface):
    """Whether any type is left."""
    return not np.all(surface.feasible_sets.excluded)


@kernel
def any_type_of_name_remains(surface, first_type_of_name):
    """Whether a type of this name is left; with TYPE_UNDECIDED, one of any name."""
    for type_index in range(N_TYPES):
        if type_is_not_excluded(surface, type_index) and first_type_of_name in (
            FIRST_TYPE_WITH_SAME_NAME[type_index],
            TYPE_UNDECIDED,
        ):
            return True
    return False


@kernel
def any_type_explains_flight(surface):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for type_index in range(N_TYPES):
        if type_is_not_excluded(surface, type_index) and has_shown(surface, type_index):
            return True
    return False


@kernel
def types_would_have_shown(config, surface):
    """Whether each type that must show itself is excluded, or has had the time to, hidden by no stop."""
    for type_index in range(N_TYPES):
        if (
            type_is_not_excluded(surface, type_index)
            and surface.evidence.n_anomalous_frames_since_stop_could_hide
            < SHOWS_WITHIN_HALF_CYCLES[type_index] * config.slowest_half_cycle_frames
        ):
            return False
    return True


@kernel
def sole_remaining_type_or_undecided(surface, n_considered_types):
    """The one of the first n_considered_types that is left, or TYPE_UNDECIDED; of several of one name, the
    first."""
    remaining_type = TYPE_UNDECIDED
    for type_index in range(n_considered_types):
        if type_is_not_excluded(surface, type_index):
            if (
                remaining_type >= 0
                and FIRST_TYPE_WITH_SAME_NAME[type_index] != FIRST_TYPE_WITH_SAME_NAME[remaining_type]
            ):
                return TYPE_UNDECIDED
            remaining_type = type_index if remaining_type < 0 else remaining_type
    return remaining_type


@kernel
def sole_constant_type_or_undecided(surface):
    """The one type of constant parameter left, or TYPE_UNDECIDED."""
    return sole_remaining_type_or_undecided(surface, N_CONSTANT_PARAMETER_TYPES)


@kernel
def sole_remaining_type_once_it_shows_itself(surface):
    """The one type left, constant or varying, or TYPE_UNDECIDED: in coarse sets a constant proves nothing."""
    remaining_type = sole_remaining_type_or_undecided(surface, N_TYPES)
    return remaining_type if remaining_type >= 0 and has_shown(surface, remaining_type) else TYPE_UNDECIDED


@kernel
def short_anomaly_may_be_rest_hidden_type(config, surface):
    """Whether what a constant explains may be a type that does not show in a surface at rest, such as a slow
    surface that has come to where it is commanded: it has not stood off its command for long."""
    if (
        not any_constant_parameter_type_remains(surface)
        or surface.evidence.n_anomalous_frames - surface.evidence.n_rest_frames
        >= config.slowest_half_cycle_frames
    ):
        return False
    for type_index in range(N_TYPES):
        if MEANING_OF_REST_BY_TYPE[type_index] == REST_HIDES_TYPE and type_is_not_excluded(
            surface, type_index
        ):
            return True
    return False


@kernel
def can_look_like_apparent_type(surface, type_index, apparent_type):
    """Whether a fault of type `type_index` may look like one of `apparent_type`, or of another type left of
    that name and of constant parameter."""
    for other_type in range(N_CONSTANT_PARAMETER_TYPES):
        given_type_can_look_like_other = (
            FIRST_TYPE_WITH_SAME_NAME[other_type] == FIRST_TYPE_WITH_SAME_NAME[apparent_type]
            and CAN_LOOK_LIKE[type_index, other_type]
            and type_is_not_excluded(surface, other_type)
        )
        if given_type_can_look_like_other and not motion_rules_out(
            surface, STOP_DIRECTION_BY_TYPE[other_type], type_index
        ):
            return True
    return False


@kernel
def can_be_another_type(surface, apparent_type, includes_command_dependent_types):
    """Whether what looks like the constant `apparent_type` may be another type that is left; unless
    `includes_command_dependent_types`, one that does not follow the command."""
    if apparent_type >= 0:
        for type_index in range(N_CONSTANT_PARAMETER_TYPES, N_TYPES):
            is_alternative = type_is_not_excluded(surface, type_index) and (
                includes_command_dependent_types or not ERROR_DEPENDS_ON_COMMAND[type_index]
            )
            if is_alternative and can_look_like_apparent_type(surface, type_index, apparent_type):
                return True
    return False


@kernel
def sole_possible_surface(surfaces, needs_constant_parameter_type):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or
    SEVERAL_SURFACES."""
    sole_surface_index = NO_SURFACE
    for s, surface in enumerate(surfaces):
        if (
            surface.status.may_be_sole_fault
            and estimator_or_deduction_allows_fault(surface)
            and (any_constant_parameter_type_remains(surface) or not needs_constant_parameter_type)
        ):
            sole_surface_index = s if sole_surface_index == NO_SURFACE else SEVERAL_SURFACES
    return sole_surface_index


@kernel
def find_isolated_surface_or_unanticipated(types, layout):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    What acts on pitch alone shows no direction, so a surface left over there must also have a type that
    explains it. Of elevator and flap, each of which can do what the other does if it only moves accordingly,
    the one is named for which a constant suffices, once a type of the other that must show itself would have.
    """
    surface_index = sole_possible_surface(types.surface, False)
    if surface_index == NO_SURFACE:
        return UNANTICIPATED
    if surface_index >= 0:
        return (
            surface_index
            if layout.dominant_axis[surface_index] != PITCH
            or any_type_explains_flight(types.surface[surface_index])
            else NOT_ISOLATED
        )
    surface_index = sole_possible_surface(types.surface, True)
    return (
        surface_index
        if surface_index >= 0 and other_surfaces_can_be_dismissed(types, surface_index)
        else NOT_ISOLATED
    )


@kernel
def other_surfaces_can_be_dismissed(types, candidate_surface_index):
    """Whether every other surface can only have a fault that depends on the command of the chosen one.

    A type that must show itself is given the time to. Where errors are declared that a course can hide in,
    every type of the others must have been excluded.
    """
    config, required_half_cycles = types.config, 1
    for s, surface in enumerate(types.surface):
        if (
            s != candidate_surface_index
            and surface.status.may_be_sole_fault
            and estimator_or_deduction_allows_fault(surface)
        ):
            if config.has_eG and any_type_remains(surface):
                return False
            if not types_would_have_shown(config, surface):
                return False
            for type_index in range(N_TYPES):
                if type_is_not_excluded(surface, type_index):
                    if not ERROR_DEPENDS_ON_COMMAND[type_index]:
                        return False
                    required_half_cycles = max(
                        required_half_cycles, HALF_CYCLES_BEFORE_ISOLATING_OTHER_SURFACE[type_index]
                    )
    return (
        types.surface[candidate_surface_index].evidence.n_anomalous_frames
        >= required_half_cycles * config.slowest_half_cycle_frames
    )


@kernel
def fault_type_on_surface(config, surface):
    """The type of the fault on a surface, taken to be at fault; TYPE_UNDECIDED while more than one fits or
    one may yet show itself."""
    if (
        surface.evidence.n_anomalous_frames < config.slowest_half_cycle_frames
        or short_anomaly_may_be_rest_hidden_type(config, surface)
    ):
        return TYPE_UNDECIDED
    if config.has_eG:
        return sole_remaining_type_once_it_shows_itself(surface)
    types_have_had_time_to_show = types_would_have_shown(config, surface)
    if any_constant_parameter_type_remains(surface):
        remaining_type = sole_constant_type_or_undecided(surface)
        return (
            remaining_type
            if types_have_had_time_to_show and not can_be_another_type(surface, remaining_type, True)
            else TYPE_UNDECIDED
        )
    return varying_parameter_fault_type_on_surface(surface, types_have_had_time_to_show)


@kernel
def varying_parameter_fault_type_on_surface(surface, types_have_had_time_to_show):
    """The same when no constant explains it: the one type left that need not show itself; else the one that
    has."""
    remaining_type = sole_remaining_varying_parameter_type(surface, False)
    if remaining_type == NO_TYPE:
        remaining_type = sole_remaining_varying_parameter_type(surface, True)
        return (
            remaining_type if remaining_type >= 0 and has_shown(surface, remaining_type) else TYPE_UNDECIDED
        )
    if remaining_type < 0 or not types_have_had_time_to_show:
        return TYPE_UNDECIDED
    for type_index in range(N_CONSTANT_PARAMETER_TYPES, N_TYPES):
        if type_is_not_excluded(surface, type_index) and CAN_LOOK_LIKE[type_index, remaining_type]:
            return TYPE_UNDECIDED
    return remaining_type


@kernel
def sole_remaining_varying_parameter_type(surface, among_types_that_must_show):
    """The one type of a parameter that varies which is left, of those that must show themselves or of those
    that need not; NO_TYPE, or TYPE_UNDECIDED if there are several."""
    remaining_type = NO_TYPE
    for type_index in range(N_CONSTANT_PARAMETER_TYPES, N_TYPES):
        if (
            type_is_not_excluded(surface, type_index)
            and MUST_SHOW_ITSELF[type_index] == among_types_that_must_show
        ):
            remaining_type = type_index if remaining_type == NO_TYPE else TYPE_UNDECIDED
            if remaining_type == TYPE_UNDECIDED:
                return TYPE_UNDECIDED
    return remaining_type


@kernel
def decide_isolation_and_accommodation(types, previous_conclusion, layout, estimators, t):
    """The finding on the surface and, when it is certain, on the type, for
    `conclusion.record_decision`.

    previous_conclusion: that of the frame before, which gives the instants of what has not changed; t s.
    """
    surface_index = find_isolated_surface_or_unanticipated(types, layout)
    previous_estimator_index = previous_conclusion.isolated_estimator
    previous_surface_index = (
        estimators[previous_estimator_index].surface
        if previous_estimator_index >= 0
        else previous_estimator_index
    )
    fault_type = (
        fault_type_on_surface(types.config, types.surface[surface_index]) if surface_index >= 0 else -1
    )
    isolated_at_s = t if surface_index != previous_surface_index else previous_conclusion.isolated_at_s
    type_decided_at_s = t if fault_type != previous_conclusion.fault_type else previous_conclusion.typed_at_s
    isolated_estimator_index = (
        estimator_of_fault(layout, surface_index, fault_type) if surface_index >= 0 else surface_index
    )
    accommodated_surface_index, accommodation_mode = decide_accommodated_surface_and_mode(
        types, isolated_estimator_index, layout, estimators
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
def estimator_of_fault(layout, s, type_index):
    """The estimator that stands for a fault of this type (TYPE_UNDECIDED if open) on surface s."""
    return (
        layout.loss[s]
        if type_index >= 0 and ACCOMMODATION_MODE_BY_TYPE[type_index] == SCALE_COMMAND
        else layout.position[s]
    )


@kernel
def choose_accommodation_mode(surface):
    """The mode of accommodation for a surface at fault as far as is known.

    SUBTRACT_OFFSET subtracts what the last frame shows to be off. It serves a type of another mode meanwhile,
    and moves the command, so that a surface that does not follow shows in the next frame.
    """
    constant_parameter_type_remains = any_constant_parameter_type_remains(surface)
    for candidate_mode in (GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE):
        if constant_parameter_type_remains and is_mode_serving_all_constant_types(surface, candidate_mode):
            return candidate_mode
    for candidate_mode in (SCALE_COMMAND, WAIT_FOR_SURFACE, GIVE_UP):
        if not constant_parameter_type_remains and is_mode_of_some_varying_type(surface, candidate_mode):
            return candidate_mode
    return SUBTRACT_OFFSET


@kernel
def is_mode_serving_all_constant_types(surface, accommodation_mode):
    """Whether a mode is that of some type of constant parameter left, and serves all of them."""
    is_mode_of_remaining_type = False
    for type_index in range(N_CONSTANT_PARAMETER_TYPES):
        if type_is_not_excluded(surface, type_index):
            is_mode_of_remaining_type = (
                is_mode_of_remaining_type or ACCOMMODATION_MODE_BY_TYPE[type_index] == accommodation_mode
            )
            serves_type_at_end_of_range = (
                TYPE_INDEX_AT_END_OF_RANGE[type_index] >= 0
                and type_is_not_excluded(surface, TYPE_INDEX_AT_END_OF_RANGE[type_index])
                and MODE_SERVES_TYPE[accommodation_mode, TYPE_INDEX_AT_END_OF_RANGE[type_index]]
            )
            if not (MODE_SERVES_TYPE[accommodation_mode, type_index] or serves_type_at_end_of_range):
                return False
    return is_mode_of_remaining_type


@kernel
def is_mode_of_some_varying_type(surface, accommodation_mode):
    """Whether a mode is that of some type left whose parameter varies."""
    for type_index in range(N_CONSTANT_PARAMETER_TYPES, N_TYPES):
        if (
            type_is_not_excluded(surface, type_index)
            and ACCOMMODATION_MODE_BY_TYPE[type_index] == accommodation_mode
        ):
            return True
    return False


@kernel
def find_presumed_faulty_surface(types, isolated_estimator_index, layout, estimators):
    """The surface the law acts upon: the one at fault, or the likeliest; NO_SURFACE yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if isolated_estimator_index >= 0:
        return estimators[isolated_estimator_index].surface
    s = sole_possible_surface(types.surface, True)
    if s >= 0:
        return s
    for s, surface in enumerate(types.surface):
        if layout.dominant_axis[s] == PITCH and estimator_or_deduction_allows_fault(surface):
            return s
    return NO_SURFACE


@kernel
def set_accommodation_mode(surface, accommodation_mode):
    """Replace the mode of accommodation of a surface, -1 for none."""
    surface.accommodation.mode = accommodation_mode


@kernel
def clear_all_accommodation_modes(surfaces):
    """Let the law act upon no surface."""
    for surface in surfaces:
        set_accommodation_mode(surface, -1)


@kernel
def decide_accommodated_surface_and_mode(types, isolated_estimator_index, layout, estimators):
    """The surface on which the law acts, or NO_SURFACE, and how; isolated_estimator_index: if any."""
    surface_index = find_presumed_faulty_surface(types, isolated_estimator_index, layout, estimators)
    clear_all_accommodation_modes(types.surface)
    if surface_index < 0:
        return NO_SURFACE, -1
    surface = types.surface[surface_index]
    accommodation_mode = choose_accommodation_mode(surface)
    if update_fault_presence(types.config, surface, accommodation_mode, True):
        set_accommodation_mode(surface, accommodation_mode)
        return surface_index, accommodation_mode
    return NO_SURFACE, accommodation_mode


@kernel
def update_fault_presence(config, surface, accommodation_mode, fault_is_possible):
    """Whether the fault of a surface shows, or did a moment ago."""
    last_observation, accommodation = surface.last_observation, surface.accommodation
    expected_deflection_rad = deflection_error(surface, fault_is_possible) + last_observation.healthy_position
    frame_agrees_with_fault = (
        last_observation.position_low <= expected_deflection_rad <= last_observation.position_high
        or accommodation_mode == SCALE_COMMAND
    )
    accommodation.n_frames_without_sign_of_fault = (
        0 if frame_agrees_with_fault else accommodation.n_frames_without_sign_of_fault + 1
    )
    fault_absence_s = accommodation.n_frames_without_sign_of_fault * config.dt
    return fault_absence_s < MAX_TIME_WITHOUT_FAULT_SIGN_S - _TIME_TOLERANCE_S


@kernel
def deflection_error(surface, fault_is_possible):
    """Return the deflection error of a surface, rad: by the types left if it is at fault, or as the last
    frame shows it."""
    if fault_is_possible:
        for type_index in DEFLECTION_ERROR_TYPES_BY_PRECEDENCE:
            if type_is_not_excluded(surface, type_index):
                deflection_error_rad = deflection_error_under_type(surface, type_index)
                if np.isfinite(deflection_error_rad):
                    return deflection_error_rad
                break
    return last_midpoint_deflection_error(surface)


@kernel
def remaining_effectiveness(types, layout, estimators, s):
    """Return the remaining effectiveness of surface s, dimensionless.

    The estimator fits both axes of a surface, so with a second fault the set of a constant loss is used.
    """
    surface = types.surface[s]
    if types.pair.enabled and estimator_or_deduction_allows_fault(surface):
        for type_index in range(N_CONSTANT_PARAMETER_TYPES):
            if ACCOMMODATION_MODE_BY_TYPE[type_index] == SCALE_COMMAND and type_is_not_excluded(
                surface, type_index
            ):
                return feasible_set_midpoint(surface, type_index)
    return 1.0 + estimators[layout.loss[s]].theta[layout.dominant_axis[s]]


FindingDict = dict[str, Any]
_NO_FINDINGS: FindingDict = {
    "isolated": None, "isolation_type": None, "estimate": None, "isolation_time_s": None,
    "candidates": (), "faults": (),
}  # fmt: skip


def fault_finding_dict(fdi: np.void, surface_names: Sequence[str]) -> FindingDict:
    """isolated, isolation_type, candidates, estimate and more of a Flight diagnosed for every type.

    surface_names: in the order of the aircraft.
    """
    if not fdi["verdict"]["detected"]:
        return dict(_NO_FINDINGS)
    if fdi["types"]["pair"]["enabled"]:
        return _findings_assuming_pair(fdi, surface_names)
    return _findings_assuming_one_fault(fdi, surface_names)


def _findings_assuming_pair(fdi: np.void, surface_names: Sequence[str]) -> FindingDict:
    """The fault named first as if it were alone, and all of them; what is open in a plane where none is."""
    surface_finding_records = fdi["types"]["surface"]["status"]
    isolated_surface_indices = sorted(
        np.flatnonzero(surface_finding_records["is_isolated"]).tolist(),
        key=lambda s: surface_finding_records["isolated_at_s"][s],
    )
    faults = [
        _finding_on_surface(fdi, s, int(surface_finding_records["fault_type"][s]), surface_names)
        for s in isolated_surface_indices
    ]
    group_has_alarm = fdi["types"]["pair"]["group_has_alarm"]
    surface_indices_by_group = [
        np.flatnonzero(fdi["layout"]["group"] == group_index).tolist()
        for group_index in range(len(group_has_alarm))
    ]
    if not group_has_alarm.any() and not faults and int(fdi["verdict"]["isolated_estimator"]) == NOT_ISOLATED:
        group_has_alarm = np.ones_like(
            group_has_alarm
        )  # a statistical alarm by itself says of no plane that it is there
    undecided_surface_group_findings = [
        {
            **_NO_FINDINGS,
            "candidates": tuple(_remaining_candidate_texts(fdi, group_surface_indices, surface_names)),
        }
        for group_alarm, group_surface_indices in zip(group_has_alarm, surface_indices_by_group, strict=True)
        if group_alarm and not set(group_surface_indices) & set(isolated_surface_indices)
    ]
    if faults:
        return {**faults[0], "faults": (*faults, *undecided_surface_group_findings)}
    if int(fdi["verdict"]["isolated_estimator"]) == UNANTICIPATED:
        return {
            **_findings_assuming_one_fault(fdi, surface_names),
            "faults": tuple(undecided_surface_group_findings),
        }
    candidate_texts = tuple(
        candidate_text
        for undecided_surface_group_finding in undecided_surface_group_findings
        for candidate_text in undecided_surface_group_finding["candidates"]
    )
    return {**_NO_FINDINGS, "candidates": candidate_texts, "faults": tuple(undecided_surface_group_findings)}


def _findings_assuming_one_fault(fdi: np.void, surface_names: Sequence[str]) -> FindingDict:
    isolated_estimator_index = int(fdi["verdict"]["isolated_estimator"])
    isolated_at_s = float(fdi["verdict"]["isolated_at_s"])
    if isolated_estimator_index == NOT_ISOLATED:
        return {
            **_NO_FINDINGS,
            "candidates": tuple(_remaining_candidate_texts(fdi, range(len(surface_names)), surface_names)),
        }
    if isolated_estimator_index == UNANTICIPATED:
        unanticipated_label = "unanticipated"
        return {
            **_NO_FINDINGS,
            "isolated": unanticipated_label,
            "isolation_type": unanticipated_label,
            "isolation_time_s": isolated_at_s,
        }
    s = int(fdi["isolation"]["estimator"][isolated_estimator_index]["surface"])
    fault_type = int(fdi["verdict"]["fault_type"])
    return {
        **_finding_on_surface(fdi, s, fault_type, surface_names),
        "isolation_time_s": isolated_at_s,
        "type_time_s": float(fdi["verdict"]["typed_at_s"]) if fault_type >= 0 else None,
    }


def _finding_on_surface(fdi: np.void, s: int, fault_type: int, surface_names: Sequence[str]) -> FindingDict:
    """Return the finding on surface s, which is at fault; fault_type: of which type, -1 if open."""
    surface = fdi["types"]["surface"][s]
    return {
        "isolated": surface_names[s],
        "isolation_time_s": float(surface["status"]["isolated_at_s"]),
        "isolation_type": registry.TYPE_NAMES[fault_type] if fault_type >= 0 else None,
        "type_time_s": float(surface["status"]["typed_at_s"]) if fault_type >= 0 else None,
        "candidates": (registry.TYPE_NAMES[fault_type],)
        if fault_type >= 0
        else tuple(_remaining_type_names(fdi, s)),
        "estimate": estimate_fault_parameter(fdi, s, fault_type),
        "estimate_interval": _call_type_attribute(
            fault_type, "estimate_parameter_interval", fdi, s, fault_type
        ),
        "frequency_rad_s": _call_type_attribute(fault_type, "estimate_frequency_rad_s", fdi, s, fault_type),
    }


def estimate_fault_parameter(fdi: np.void, s: int, type_index: int) -> float | None:
    """Estimate the size of a fault of this type on surface s; None if it has none."""
    estimate: float | None = _call_type_attribute(type_index, "estimate_parameter", fdi, s, type_index)
    return estimate


def _call_type_attribute(type_index: int, attribute_name: str, *arguments: Any) -> Any:
    """Return an attribute of a type's row; None while the type is open."""
    return getattr(registry.TYPES[type_index], attribute_name)(*arguments) if type_index >= 0 else None


def _can_be_at_fault(fdi: np.void, s: int) -> bool:
    surface = fdi["types"]["surface"][s]
    if surface["status"]["is_isolated"] or surface["status"]["can_be_at_fault_basis"] == DEDUCED_FAULTY:
        return True
    return not (
        surface["status"]["can_be_at_fault_basis"] == DEDUCED_HEALTHY
        or surface["position_estimator_excluded"]
    )


def _remaining_type_names(fdi: np.void, s: int) -> list[str]:
    """Types still possible on surface s, each once.

    Where a constant explains the flight, a type that varies and need not show itself counts only until the
    constant has been seen for long enough, or until those types are excluded that it can look like.
    """
    surface = fdi["types"]["surface"][s]
    type_indices = [
        type_index
        for type_index, type_is_excluded in enumerate(surface["feasible_sets"]["excluded"])
        if _can_be_at_fault(fdi, s) and not type_is_excluded
    ]
    constant_parameter_type_indices = [
        type_index for type_index in type_indices if type_index < registry.N_CONSTANT_PARAMETER_TYPES
    ]
    if constant_parameter_type_indices and not fdi["types"]["config"]["has_eG"]:
        anomaly_evidence = surface["evidence"]
        slowest_half_cycle_frames = fdi["types"]["config"]["slowest_half_cycle_frames"]
        anomaly_is_shorter_than_half_cycle = (
            anomaly_evidence["n_anomalous_frames"] - anomaly_evidence["n_rest_frames"]
            < slowest_half_cycle_frames
        )
        type_indices = [
            type_index
            for type_index in type_indices
            if type_index in constant_parameter_type_indices
            or anomaly_is_shorter_than_half_cycle
            or _counts_with_constant_parameter_types(type_index, constant_parameter_type_indices)
        ]
    is_pitch_surface_assuming_pair = (
        fdi["types"]["pair"]["enabled"] and fdi["layout"]["group"][s] == PITCH_GROUP
    )
    if is_pitch_surface_assuming_pair and any(
        registry.ACCOMMODATION_MODE_BY_TYPE[type_index] == GIVE_UP
        for type_index in constant_parameter_type_indices
    ):
        # if the other surface is off as well, each constant may be one of another type
        type_indices += sorted(
            range(registry.N_CONSTANT_PARAMETER_TYPES),
            key=lambda type_index: registry.ACCOMMODATION_MODE_BY_TYPE[type_index] == SCALE_COMMAND,
        )
    return list(dict.fromkeys(registry.TYPE_NAMES[type_index] for type_index in type_indices))


def _counts_with_constant_parameter_types(
    type_index: int, constant_parameter_type_indices: list[int]
) -> bool:
    """Whether a varying type counts together with these constant ones: it may yet show itself, or looks like
    one of them."""
    return bool(
        registry.MUST_SHOW_ITSELF[type_index]
        or registry.CAN_LOOK_LIKE[type_index, constant_parameter_type_indices].any()
    )


def _remaining_candidate_texts(
    fdi: np.void, surface_indices: Iterable[int], surface_names: Sequence[str]
) -> Iterator[str]:
    """`surface:type` for each that is possible; bare surfaces and `unanticipated` where no type fits.

    Of one plane also both its surfaces, as `elevator+flap`.
    """
    first_fault_surface = int(fdi["types"]["pair"]["first_pitch_fault_surface"])
    if fdi["types"]["pair"]["enabled"] and first_fault_surface in surface_indices:
        status = fdi["types"]["surface"]["status"][first_fault_surface]
        if not (status["may_be_sole_fault"] or status["is_isolated"]):
            yield "unanticipated"  # no second fault explains what the first one leaves
            return
    possible_surface_indices = [s for s in surface_indices if _can_be_at_fault(fdi, s)]
    for s in possible_surface_indices:
        type_names = _remaining_type_names(fdi, s)
        yield from (
            (f"{surface_names[s]}:{type_name}" for type_name in type_names)
            if type_names
            else (surface_names[s],)
        )
    if fdi["types"]["pair"]["enabled"]:
        yield "+".join(surface_names[s] for s in surface_indices)
    if not any(_remaining_type_names(fdi, s) for s in possible_surface_indices):
        yield "unanticipated"
