"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. Where both surfaces were follows exactly in every
frame, whichever is at fault, and a surface is judged in those frames in which it was certainly off. One is
named when the other alone cannot explain the flight; both are when neither can and each has a type left.

*Pitch*: two unknowns in one equation. A constant that explains everything on one surface is taken for one
fault. Once that was named, with its constant, a second fault that refutes it is found on the other surface,
whose deflection follows from what is known of the first, taken to last. Anything else stays open.

A surface's group and the other surface in it are looked up in the layout. types: of `types_dtype`;
conclusion: of `conclusion_dtype`; estimators: those of the isolation.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import state
from beaver_ftc.diagnosis.state import LATERAL_GROUP, PITCH, PITCH_GROUP, ROLL, YAW
from beaver_ftc.diagnosis.types import contract, verdict
from beaver_ftc.diagnosis.types import registry as frames
from beaver_ftc.diagnosis.types.contract import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET
from beaver_ftc.diagnosis.types.registry import ACCOMMODATION, N_CONSTANT, deflection
from beaver_ftc.diagnosis.types.verdict import (
    NO_SURFACE,
    any_constant_type_remains,
    can_be_at_fault,
    type_remains,
)


@kernel
def record_plane_alarms(pair, bank):
    """In which plane a filter of the bank has left its bound."""
    for i in range(3):
        plane = PITCH_GROUP if i == PITCH else LATERAL_GROUP
        for m in range(bank.config.n):
            if abs(bank.output.residual[m, i]) > bank.output.threshold[m, i]:
                pair.alarmed[plane] = 1


@kernel
def solve_roll_and_yaw(types, layout, estimators, innovation, frame_bound):
    """Where ailerons and rudder were in the elapsed frame: nu = G (p - u) + eta solved for p; nu: innovation
    (3,), |eta| <= frame_bound (3,) rad/s2."""
    a, b = layout.main[ROLL], layout.main[YAW]
    one, other = (
        estimators[layout.position_estimator[a]].effect,
        estimators[layout.position_estimator[b]].effect,
    )
    a_p, a_r, r_p, r_r = one.Z[ROLL], one.Z[YAW], other.Z[ROLL], other.Z[YAW]
    p, r = innovation[ROLL], innovation[YAW]
    slack_p = frame_bound[ROLL] + one.spread[ROLL] + other.spread[ROLL]
    slack_r = frame_bound[YAW] + one.spread[YAW] + other.spread[YAW]
    determinant = a_p * r_r - a_r * r_p
    size = abs(determinant)
    off, slack = (p * r_r - r * r_p) / determinant, (slack_p * abs(r_r) + slack_r * abs(r_p)) / size
    fits = contract.set_deflection(types.surface[a], off, slack)
    off, slack = (r * a_p - p * a_r) / determinant, (slack_r * abs(a_p) + slack_p * abs(a_r)) / size
    if not (contract.set_deflection(types.surface[b], off, slack) and fits):
        types.pair.no_lateral_pair = 1


@kernel
def deflection_range(config, surface, k):
    """Least and greatest deflection (rad) of a surface by the elapsed frame, of this number, over all types
    of a constant that are left."""
    least, greatest = np.inf, -np.inf
    for kind in range(N_CONSTANT):
        if type_remains(surface, kind):
            low, high = deflection(config, surface, kind, k)
            least, greatest = min(least, low), max(greatest, high)
    low, high = surface.actuator.reach_low, surface.actuator.reach_high
    return min(max(least, low), high), min(max(greatest, low), high)


@kernel
def solve_pitch(types, layout, estimators, innovation, frame_bound):
    """Whether pitch shows a fault; after the begin of a second fault, where the second surface was."""
    first = types.pair.first
    if first != NO_SURFACE and not types.surface[first].status.is_candidate:
        solve_second_in_pitch(types, layout, estimators, innovation, frame_bound)
        return
    for s, surface in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP:
            contract.set_anomalous(surface, abs(innovation[PITCH]) > frame_bound[PITCH])


@kernel
def solve_second_in_pitch(types, layout, estimators, innovation, frame_bound):
    """Where the second surface was, given what is known of the first."""
    first = types.pair.first
    second = layout.partner[first]
    known = estimators[layout.position_estimator[first]].effect
    other = estimators[layout.position_estimator[second]].effect
    surface = types.surface[first]
    low, high = deflection_range(types.config, surface, types.frame)
    contract.set_known_deflection(surface, low, high)
    Z, Z_known = other.Z[PITCH], known.Z[PITCH]
    share = Z_known * contract.observed_error(surface)
    slack = abs(Z_known) * 0.5 * (high - low)
    slack += frame_bound[PITCH] + known.spread[PITCH] + other.spread[PITCH]
    if not contract.set_deflection(types.surface[second], (innovation[PITCH] - share) / Z, slack / abs(Z)):
        types.surface[second].status.decided_by = verdict.RULED_OUT


@kernel
def examine_pairs(types, layout, estimators, bank, frame_bound):
    """Observe the elapsed frame, plane by plane, and judge the one before; frame_bound (3,): bound on it."""
    record_plane_alarms(types.pair, bank)
    frames.observe_frame(types, layout, estimators, bank.output.innovation, frame_bound)
    solve_roll_and_yaw(types, layout, estimators, bank.output.innovation, frame_bound)
    solve_pitch(types, layout, estimators, bank.output.innovation, frame_bound)
    frames.judge_frame(types)


@kernel
def set_named(surface, named, kind, t):
    """Name a surface and the type of its fault (-1 if open), or take the name back; t s."""
    kind = kind if named else -1
    status = surface.status
    if named and not status.named:
        status.named_at_s = t
    if kind != status.type:
        status.type_at_s = t
    status.named, status.type = named, kind


@kernel
def decide_roll_and_yaw(types, layout, t):
    """Which of the two is at fault, if any. Returns whether the plane's fault is outside the class."""
    config, pair = types.config, types.pair
    one, other = types.surface[layout.main[ROLL]], types.surface[layout.main[YAW]]
    one_left, other_left = can_be_at_fault(one), can_be_at_fault(other)
    both = not one_left and not other_left
    no_pair = (
        pair.no_lateral_pair == 1 or not verdict.any_type_remains(one) or not verdict.any_type_remains(other)
    )
    outside = both and no_pair
    open_yet = both and not (verdict.is_explained(one) and verdict.is_explained(other))
    certain = pair.alarmed[LATERAL_GROUP] == 1 and not (outside or open_yet)
    set_named(one, certain and not other_left, verdict.type_at_fault(config, one), t)
    set_named(other, certain and not one_left, verdict.type_at_fault(config, other), t)
    return outside


@kernel
def store_first_fault(types, s):
    """Keep what is known of the one pitch fault, and again when fewer types have been left for a while.

    What refutes a type may be a second fault that begins to show, and is about to refute all of them.
    """
    pair, surface, changed = types.pair, types.surface[s], False
    known = surface.known
    for kind in range(N_CONSTANT):
        changed = changed or surface.feasible.excluded[kind] != known.excluded[kind]
    pair.frames_since_change = pair.frames_since_change + 1 if changed else 0
    if pair.first != s or pair.frames_since_change >= types.config.half_cycle_frames:
        pair.first, pair.frames_since_change = s, 0
        known.low[:], known.high[:] = surface.feasible.low, surface.feasible.high
        known.excluded[:] = 1
        known.excluded[:N_CONSTANT] = surface.feasible.excluded[:N_CONSTANT]


@kernel
def begin_second_fault(types, layout):
    """The one known pitch fault no longer explains the flight: there is a second fault."""
    first, second = types.surface[types.pair.first], types.surface[layout.partner[types.pair.first]]
    contract.restore_known_sets(first)
    frames.restart_surface(second)
    for surface in (first, second):
        surface.status.is_candidate, surface.status.decided_by = 0, verdict.BY_DEDUCTION
        contract.clear_anomalies(surface)


@kernel
def evidence_is_long_enough(config, surface):
    """Whether a slow oscillation, a slow surface or a growing bias would have shown by now."""
    growing = verdict.can_be_another_type(surface, verdict.sole_constant_type(surface), False)
    open_yet = growing or verdict.can_hide_at_rest(config, surface)
    long = surface.evidence.frames >= config.half_cycle_frames
    return long and verdict.types_would_have_shown(config, surface) and not open_yet


@kernel
def has_second_fault_in_pitch(types, layout):
    """Whether a second pitch fault has shown in addition to the known one."""
    if types.pair.first == NO_SURFACE or layout.partner[types.pair.first] < 0:
        return False
    surface = types.surface[types.pair.first]
    if surface.status.is_candidate and not (can_be_at_fault(surface) and any_constant_type_remains(surface)):
        begin_second_fault(types, layout)
    return not surface.status.is_candidate


@kernel
def type_in_pitch(config, surface):
    """The type of the one fault of pitch, or -1 while it is open.

    A jam may as well be a trailing surface or one at its stop, if the other surface is off by a constant.
    """
    kind = verdict.type_at_fault(config, surface)
    return verdict.TYPE_OPEN if kind >= 0 and ACCOMMODATION[kind] == GIVE_UP else kind


@kernel
def decide_pitch(types, layout, t):
    """Which surface of pitch is at fault, if any."""
    if has_second_fault_in_pitch(types, layout):
        first, s = types.surface[types.pair.first], layout.partner[types.pair.first]
        second = types.surface[s]
        set_named(first, 1, first.status.type, t)
        shows = second.evidence.frames > 0 and can_be_at_fault(second) and verdict.is_explained(second)
        set_named(second, shows, verdict.type_at_fault(types.config, second), t)
        return
    s = sole_fault_in_pitch(types, layout)
    for member, surface in enumerate(types.surface):
        if layout.group[member] == PITCH_GROUP:
            set_named(surface, member == s, type_in_pitch(types.config, surface) if member == s else -1, t)


@kernel
def sole_fault_in_pitch(types, layout):
    """The surface of pitch at fault if a constant explains everything on it, or NO_SURFACE."""
    s = verdict.surface_at_fault(types, layout) if types.pair.alarmed[PITCH_GROUP] else NO_SURFACE
    if s < 0 or not any_constant_type_remains(types.surface[s]):
        return NO_SURFACE
    if evidence_is_long_enough(types.config, types.surface[s]):
        store_first_fault(types, s)
    return s


@kernel
def decide_pairs(types, conclusion, layout, t):
    """Name surfaces and types plane by plane; t s. Returns the finding for `conclusion.record_finding`:
    `isolated` is the one named first, the law acts on all. conclusion: that of the frame before."""
    outside = decide_roll_and_yaw(types, layout, t)
    decide_pitch(types, layout, t)
    earliest = NO_SURFACE
    for s, surface in enumerate(types.surface):
        status, first = surface.status, types.surface[max(earliest, 0)].status
        if status.named and (earliest < 0 or status.named_at_s < first.named_at_s):
            earliest = s
    isolated, isolated_at_s, kind, type_at_s = first_fault_finding(
        types, conclusion, layout, earliest, outside, t
    )
    lead, lead_kind = choose_accommodation(types, layout)
    return isolated, isolated_at_s, kind, type_at_s, lead, lead_kind


@kernel
def first_fault_finding(types, conclusion, layout, s, outside, t):
    """The finding on surface s, the first named, as that of a single fault: estimator, its instant, type, its
    instant. NO_SURFACE: none is named, and the fault of roll and yaw may be `outside` the class."""
    if s >= 0:
        status = types.surface[s].status
        isolated = verdict.estimator_of_fault(layout, s, status.type)
        return isolated, status.named_at_s, status.type, status.type_at_s
    isolated = state.UNANTICIPATED if outside else state.NOT_ISOLATED
    isolated_at_s = t if isolated != conclusion.isolated else conclusion.isolated_at_s
    return isolated, isolated_at_s, -1, conclusion.type_at_s


@kernel
def is_named_in_pitch(types, layout):
    """Whether a surface of pitch is named."""
    for s, surface in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP and surface.status.named:
            return True
    return False


@kernel
def law_acts_on(types, layout, s):
    """Whether the law acts on surface s: it is named, or the likeliest in pitch."""
    if types.surface[s].status.named:
        return True
    if (
        layout.group[s] != PITCH_GROUP
        or is_named_in_pitch(types, layout)
        or not types.pair.alarmed[PITCH_GROUP]
    ):
        return False
    likeliest = verdict.sole_surface(types.surface, True)
    return s == (likeliest if likeliest >= 0 else layout.main[PITCH])


@kernel
def choose_accommodation(types, layout):
    """Settle what the law does about each surface. Returns the lead, which the supervisor follows, and what
    is done about it: a replaced elevator leads before all others."""
    lead, lead_kind = NO_SURFACE, -1
    for s, surface in enumerate(types.surface):
        verdict.set_mode(surface, -1)
        if law_acts_on(types, layout, s):
            at_fault = surface.status.named == 1 or can_be_at_fault(surface)
            mode = verdict.accommodation_mode(surface) if at_fault else SUBTRACT_OFFSET
            if verdict.fault_is_present(types.config, surface, mode, at_fault):
                verdict.set_mode(surface, mode)
                replaced = s == layout.main[PITCH] and mode in (SCALE_COMMAND, GIVE_UP)
                if lead == NO_SURFACE or replaced:
                    lead, lead_kind = s, mode
    return lead, lead_kind
