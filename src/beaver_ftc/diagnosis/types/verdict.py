"""From the types left to a verdict: the surface at fault, the type of its fault, and what the law does.

No type is named here: the columns of the table (contract.py) say what distinguishes one from another. Kernels
of one surface answer under the premise that it is at fault; `possible` says whether it can be. types: of
`types_dtype`; conclusion: of `conclusion_dtype`; estimators: those of the isolation.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, UNANTICIPATED
from beaver_ftc.diagnosis.types.contract import FIXED, LAGS, LOSES, SHIFTED, UNSEEN, middle
from beaver_ftc.diagnosis.types.observation import middle_error
from beaver_ftc.diagnosis.types.registry import (
    ACCOMMODATION,
    AT_REST,
    DIRECTION,
    ERROR_ORDER,
    FAMILY,
    FOLLOWS_COMMAND,
    HALF_CYCLES,
    LIMIT,
    MISTAKEN_FOR,
    MUST_SHOW,
    N_CONSTANT,
    N_TYPES,
    SERVES,
    SHOWS_WITHIN,
    differs,
    expected_error,
    has_shown,
)

NO_SURFACE, SEVERAL = -1, -2
OPEN, NO_TYPE = -1, -2  # the type of a fault of which more than one type is left, or none
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, BY_DEDUCTION, RULED_OUT = range(3)
ABSENT_S = 0.2  # a fault that has not shown for so long is taken for gone
_ROUNDING = 1e-9


@kernel
def note_refuted(surfaces, layout, estimators):
    """Keep for every surface whether its estimator is excluded."""
    for s, surface in enumerate(surfaces):
        surface.refuted = estimators[layout.position_of[s]].excluded


@kernel
def possible(surface):
    """Whether anything on a surface can be the fault."""
    if surface.status.source != BY_ESTIMATOR:
        return surface.status.source == BY_DEDUCTION
    return not surface.refuted


@kernel
def left(surface, kind):
    """Whether a type is not excluded."""
    return not surface.feasible.excluded[kind]


@kernel
def any_constant(surface):
    """Whether a type with a constant parameter is left."""
    return not np.all(surface.feasible.excluded[:N_CONSTANT])


@kernel
def anything_left(surface):
    """Whether any type is left."""
    return not np.all(surface.feasible.excluded)


@kernel
def explained(surface):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for kind in range(N_TYPES):
        if left(surface, kind) and has_shown(surface, kind):
            return True
    return False


@kernel
def would_have_shown(config, surface):
    """Whether each type that must show itself is excluded, or has had the time to, hidden by no stop."""
    for kind in range(N_TYPES):
        if left(surface, kind) and surface.evidence.unhidden < SHOWS_WITHIN[kind] * config.patience:
            return False
    return True


@kernel
def one_of(surface, n):
    """The one of the first n types that is left, or OPEN; of one name, such as a runaway's two, the first."""
    found = OPEN
    for kind in range(n):
        if left(surface, kind):
            if found >= 0 and FAMILY[kind] != FAMILY[found]:
                return OPEN
            found = kind if found < 0 else found
    return found


@kernel
def one_constant(surface):
    """The one type of constant parameter left, or OPEN."""
    return one_of(surface, N_CONSTANT)


@kernel
def sole_type(surface):
    """The one type left whatever its course, or OPEN: in coarse sets a constant proves nothing."""
    found = one_of(surface, N_TYPES)
    return found if found >= 0 and has_shown(surface, found) else OPEN


@kernel
def may_be_unseen(config, surface):
    """Whether what a constant explains may be a type that does not show in a surface at rest, such as a slow
    surface that has come to where it is commanded: it has not stood off its command for long."""
    if not any_constant(surface) or surface.evidence.frames - surface.evidence.quiet >= config.patience:
        return False
    for kind in range(N_TYPES):
        if AT_REST[kind] == UNSEEN and left(surface, kind):
            return True
    return False


@kernel
def may_look_like(surface, kind, found):
    """Whether a fault of type `kind` may look like one of the type `found`, or of another type left of that
    name and of constant parameter."""
    for other in range(N_CONSTANT):
        alike = FAMILY[other] == FAMILY[found] and MISTAKEN_FOR[kind, other] and left(surface, other)
        if alike and not differs(surface, DIRECTION[other], kind):
            return True
    return False


@kernel
def may_be_mistaken(surface, found, whatever):
    """Whether what looks like the constant type `found` may be another type that is left; unless `whatever`,
    one that does not follow the command."""
    if found >= 0:
        for kind in range(N_CONSTANT, N_TYPES):
            counts = left(surface, kind) and (whatever or not FOLLOWS_COMMAND[kind])
            if counts and may_look_like(surface, kind, found):
                return True
    return False


@kernel
def sole(surfaces, constant):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or SEVERAL."""
    found = NO_SURFACE
    for s, surface in enumerate(surfaces):
        if surface.status.is_candidate and possible(surface) and (any_constant(surface) or not constant):
            found = s if found == NO_SURFACE else SEVERAL
    return found


@kernel
def surface_at_fault(types, layout):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    What acts on pitch alone shows no direction, so a surface left over there must also have a type that
    explains it. Of elevator and flap, each of which can do what the other does if it only moves accordingly,
    the one is named for which a constant suffices, once a slow oscillation of the other would have shown.
    """
    s = sole(types.surface, False)
    if s == NO_SURFACE:
        return UNANTICIPATED
    if s >= 0:
        return s if layout.dominant_axis[s] != PITCH or explained(types.surface[s]) else NOT_ISOLATED
    s = sole(types.surface, True)
    return s if s >= 0 and others_refuted(types, s) else NOT_ISOLATED


@kernel
def others_refuted(types, chosen):
    """Whether every other surface can only have a fault that depends on the command of the chosen one.

    A type that must show itself is given the time to. Where errors are declared that a course can hide in,
    every type of the others must have been excluded.
    """
    config, half_cycles = types.config, 1
    for s, surface in enumerate(types.surface):
        if s != chosen and surface.status.is_candidate and possible(surface):
            if config.own_errors and anything_left(surface):
                return False
            if not would_have_shown(config, surface):
                return False
            for kind in range(N_TYPES):
                if left(surface, kind):
                    if not FOLLOWS_COMMAND[kind]:
                        return False
                    half_cycles = max(half_cycles, HALF_CYCLES[kind])
    return types.surface[chosen].evidence.frames >= half_cycles * config.patience


@kernel
def type_at_fault(config, surface):
    """The type of the fault on a surface, taken to be at fault; OPEN while more than one fits or one may yet
    show itself."""
    if surface.evidence.frames < config.patience or may_be_unseen(config, surface):
        return OPEN
    if config.own_errors:
        return sole_type(surface)
    patient = would_have_shown(config, surface)
    if any_constant(surface):
        found = one_constant(surface)
        return found if patient and not may_be_mistaken(surface, found, True) else OPEN
    return one_course(surface, patient)


@kernel
def one_course(surface, patient):
    """The same when no constant explains it: the one type left that need not show itself; else the one that
    has."""
    found = sole_course(surface, False)
    if found == NO_TYPE:
        found = sole_course(surface, True)
        return found if found >= 0 and has_shown(surface, found) else OPEN
    if found < 0 or not patient:
        return OPEN
    for kind in range(N_CONSTANT, N_TYPES):
        if left(surface, kind) and MISTAKEN_FOR[kind, found]:
            return OPEN
    return found


@kernel
def sole_course(surface, must_show):
    """The one type of a parameter that varies which is left, of those that must show themselves or of those
    that need not; NO_TYPE, or OPEN if there are several."""
    found = NO_TYPE
    for kind in range(N_CONSTANT, N_TYPES):
        if left(surface, kind) and MUST_SHOW[kind] == must_show:
            found = kind if found == NO_TYPE else OPEN
            if found == OPEN:
                return OPEN
    return found


@kernel
def decide(types, conclusion, layout, estimators, t):
    """The finding on the surface and, when it is certain, on the type, as `conclusion.note_type` takes it.

    conclusion: that of the frame before, which gives the instants of what has not changed; t s.
    """
    s, before = surface_at_fault(types, layout), conclusion.isolated
    if before >= 0:
        before = estimators[before].surface
    kind = type_at_fault(types.config, types.surface[s]) if s >= 0 else -1
    isolated_at_s = t if s != before else conclusion.isolated_at_s
    type_at_s = t if kind != conclusion.type else conclusion.type_at_s
    isolated = estimator_for(layout, s, kind) if s >= 0 else s
    lead, lead_kind = take_the_lead(types, isolated, layout, estimators)
    return isolated, isolated_at_s, kind, type_at_s, lead, lead_kind


@kernel
def estimator_for(layout, s, kind):
    """The estimator that stands for a fault of this type (OPEN if open) on surface s."""
    return layout.loss_of[s] if kind >= 0 and ACCOMMODATION[kind] == LOSES else layout.position_of[s]


@kernel
def mode_for(surface):
    """The mode of accommodation for a surface at fault as far as is known: LOSES, FIXED, LAGS or SHIFTED.

    SHIFTED subtracts what the last frame shows to be off: that is right for a bias and an oscillation, serves
    a loss of effectiveness meanwhile, and moves the command so that a jam shows in the next frame.
    """
    constant = any_constant(surface)
    for mode in (FIXED, LOSES, LAGS):
        if constant and serves_all_constant(surface, mode):
            return mode
    for mode in (LOSES, LAGS, FIXED):
        if not constant and suits_a_course(surface, mode):
            return mode
    return SHIFTED


@kernel
def serves_all_constant(surface, mode):
    """Whether a mode is that of some type of constant parameter left, and serves all of them."""
    suits = False
    for kind in range(N_CONSTANT):
        if left(surface, kind):
            suits = suits or ACCOMMODATION[kind] == mode
            at_limit = LIMIT[kind] >= 0 and left(surface, LIMIT[kind]) and SERVES[mode, LIMIT[kind]]
            if not (SERVES[mode, kind] or at_limit):
                return False
    return suits


@kernel
def suits_a_course(surface, mode):
    """Whether a mode is that of some type left whose parameter varies."""
    for kind in range(N_CONSTANT, N_TYPES):
        if left(surface, kind) and ACCOMMODATION[kind] == mode:
            return True
    return False


@kernel
def presumed(types, isolated, layout, estimators):
    """The surface the law acts upon: the one at fault, or the likeliest; NO_SURFACE yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if isolated >= 0:
        return estimators[isolated].surface
    s = sole(types.surface, True)
    if s >= 0:
        return s
    for s, surface in enumerate(types.surface):
        if layout.dominant_axis[s] == PITCH and possible(surface):
            return s
    return NO_SURFACE


@kernel
def set_mode(surface, mode):
    """Replace the mode of accommodation of a surface, -1 for none."""
    surface.accommodation.mode = mode


@kernel
def clear_modes(surfaces):
    """Let the law act upon no surface."""
    for surface in surfaces:
        set_mode(surface, -1)


@kernel
def take_the_lead(types, isolated, layout, estimators):
    """The surface on which the law acts, or NO_SURFACE, and how; isolated: an estimator, if any."""
    s = presumed(types, isolated, layout, estimators)
    clear_modes(types.surface)
    if s < 0:
        return NO_SURFACE, -1
    surface = types.surface[s]
    mode = mode_for(surface)
    if still_there(types.config, surface, mode, True):
        set_mode(surface, mode)
        return s, mode
    return NO_SURFACE, mode


@kernel
def still_there(config, surface, mode, at_fault):
    """Whether the fault of a surface shows, or did a moment ago."""
    seen, accommodation = surface.elapsed, surface.accommodation
    deflection = deflection_error(surface, at_fault) + seen.command
    there = seen.low <= deflection <= seen.high or mode == LOSES
    accommodation.absent = 0 if there else accommodation.absent + 1
    return accommodation.absent * config.dt < ABSENT_S - _ROUNDING


@kernel
def deflection_error(surface, at_fault):
    """How far a surface is off its command, rad: by the types left if it is at fault, or as the last frame
    shows it."""
    if at_fault:
        for kind in ERROR_ORDER:
            if left(surface, kind):
                error = expected_error(surface, kind)
                if np.isfinite(error):
                    return error
                break
    return middle_error(surface)


@kernel
def effectiveness_left(types, layout, estimators, s):
    """What surface s has left of its effectiveness.

    The estimator fits both axes of a surface, so beside another fault the set of a constant loss says it.
    """
    surface = types.surface[s]
    if types.pair.enabled and possible(surface):
        for kind in range(N_CONSTANT):
            if ACCOMMODATION[kind] == LOSES and left(surface, kind):
                return middle(surface, kind)
    return 1.0 + estimators[layout.loss_of[s]].theta[layout.dominant_axis[s]]
