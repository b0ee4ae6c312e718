"""From the types left to a verdict: the surface at fault, the type of its fault, and what the law does.

Kernels of one surface answer under the premise that it is at fault; `possible` says whether it can be.
types: of `types_dtype`; conclusion: of `conclusion_dtype`; estimators: those of the isolation.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, UNANTICIPATED
from beaver_ftc.diagnosis.types.contract import middle, within_travel
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.diagnosis.types.registry import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FAMILY,
    FLOAT,
    GROWING_BIAS,
    N_CONSTANT,
    N_TYPES,
    OSCILLATORY,
    SLOW,
    STUCK,
    UP,
    VARYING_LOSS,
    shown,
)

NO_SURFACE, SEVERAL = -1, -2
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, BY_DEDUCTION, RULED_OUT = range(3)
ABSENT_S = 0.2  # a fault that has not shown for so long is let go
_ROUNDING = 1e-9


@kernel
def note_refuted(surfaces, layout, estimators):
    """Keep for every surface whether its estimator is excluded."""
    for s, surface in enumerate(surfaces):
        surface.refuted = estimators[layout.position_of[s]].excluded


@kernel
def possible(surface):
    """Whether anything on a surface can be the fault."""
    if surface.standing != BY_ESTIMATOR:
        return surface.standing == BY_DEDUCTION
    return not surface.refuted


@kernel
def left(surface, kind):
    """Whether a type is not excluded."""
    return not surface.type_excluded[kind]


@kernel
def any_constant(surface):
    """Whether a type with a constant parameter is left."""
    return not np.all(surface.type_excluded[:N_CONSTANT])


@kernel
def anything_left(surface):
    """Whether any type is left."""
    return not np.all(surface.type_excluded)


@kernel
def explained(surface):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for kind in range(N_TYPES):
        if left(surface, kind) and shown(surface, kind):
            return True
    return False


@kernel
def swings(surface):
    """Whether the surface is known to have swung for two half-cycles and more."""
    return left(surface, OSCILLATORY) and shown(surface, OSCILLATORY)


@kernel
def would_have_swung(config, surface):
    """Whether there is no oscillation, or a whole one of the slowest would have shown, hidden by no stop."""
    return not left(surface, OSCILLATORY) or surface.unhidden >= 2 * config.patience


@kernel
def only_a_swing(surface):
    """Whether nothing but an oscillation is left, and it has not swung for long enough."""
    for kind in range(N_TYPES):
        if kind != OSCILLATORY and left(surface, kind):
            return False
    return not swings(surface)


@kernel
def loses(surface):
    """Whether a loss of effectiveness is left; one that varies counts only when no constant explains it."""
    varies = left(surface, VARYING_LOSS) and not any_constant(surface)
    return left(surface, CONSTANT_LOSS) or varies


@kernel
def held_elsewhere(surface):
    """Whether a jam or a runaway is left."""
    return left(surface, STUCK) or left(surface, UP) or left(surface, DOWN)


@kernel
def is_fixed(surface):
    """Whether the surface is known to ignore its command."""
    other = left(surface, BIAS) or (loses(surface) and not left(surface, FLOAT))
    return held_elsewhere(surface) and not other


@kernel
def one_of(surface, n):
    """The one of the first n types that is left, or -1; of one name, such as a runaway's two, the first."""
    found = -1
    for kind in range(n):
        if left(surface, kind):
            if found >= 0 and FAMILY[kind] != FAMILY[found]:
                return -1
            found = kind if found < 0 else found
    return found


@kernel
def one_type(surface):
    """The one type of constant parameter left, or -1."""
    return one_of(surface, N_CONSTANT)


@kernel
def sole_type(surface):
    """The one type left whatever its course, or -1: in coarse sets a constant proves nothing."""
    found = one_of(surface, N_TYPES)
    return found if found >= 0 and shown(surface, found) else -1


@kernel
def may_be_slow(config, surface):
    """Whether what looks like a jam may be a slow surface that has come to where it is commanded: it has not
    stood off its command for long."""
    loud = surface.evidence - surface.quiet
    return any_constant(surface) and left(surface, SLOW) and loud < config.patience


@kernel
def may_creep(surface, found):
    """Whether what stands still may be a slow surface that has not been seen to do so for long enough."""
    return found in (STUCK, FLOAT, UP, DOWN) and left(surface, SLOW)


@kernel
def may_be_growing(surface, found):
    """Whether what looks like a jam or a loss may be a bias that grows as the command happens to go; or what
    looks like a runaway, one that has come to the stop by and by."""
    if found in (UP, DOWN):
        ran = surface.growing_bias.ran
        slowly = (left(surface, UP) and not ran[1]) or (left(surface, DOWN) and not ran[0])
        return slowly and left(surface, GROWING_BIAS)
    return found in (CONSTANT_LOSS, STUCK, FLOAT) and left(surface, GROWING_BIAS)


@kernel
def sole(surfaces, constant):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or SEVERAL."""
    found = NO_SURFACE
    for s, surface in enumerate(surfaces):
        if surface.in_question and possible(surface) and (any_constant(surface) or not constant):
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
    """Whether nothing but a fault that follows the chosen one's commands is left on the other surfaces.

    An oscillation is given one half-cycle of the slowest to show, a whole one if still possible. An offset
    that grows is as good as constant in the end, whatever the commands; where errors are declared that a
    course can hide in, every type of the others must have been excluded.
    """
    config, waits = types.config, 1
    for s, surface in enumerate(types.surface):
        if s != chosen and surface.in_question and possible(surface):
            if left(surface, GROWING_BIAS) or (config.own_errors and anything_left(surface)):
                return False
            if not would_have_swung(config, surface):
                return False
            if left(surface, VARYING_LOSS):
                waits = 2
    return types.surface[chosen].evidence >= waits * config.patience


@kernel
def type_at_fault(config, surface):
    """The type of the fault on a surface, taken to be at fault; -1 while more than one fits or an
    oscillation may yet show."""
    if surface.evidence < config.patience or may_be_slow(config, surface):
        return -1
    if config.own_errors:
        return sole_type(surface)
    patient = would_have_swung(config, surface)
    if any_constant(surface):
        found = one_type(surface)
        open_yet = may_be_growing(surface, found) or may_creep(surface, found)
        return found if patient and not open_yet else -1
    return one_course(surface, patient)


@kernel
def one_course(surface, patient):
    """The same when no constant explains it: a loss, pace or bias that varies, or an oscillation."""
    fading, slow, growing = left(surface, VARYING_LOSS), left(surface, SLOW), left(surface, GROWING_BIAS)
    if fading + slow + growing > 1 or (slow and left(surface, OSCILLATORY)):
        return -1
    if slow:
        return SLOW
    if fading or growing:
        return (VARYING_LOSS if fading else GROWING_BIAS) if patient else -1
    return OSCILLATORY if swings(surface) else -1


@kernel
def decide(types, conclusion, layout, estimators, t):
    """Name the surface and, when it is certain, the type; t s."""
    s, before = surface_at_fault(types, layout), conclusion.isolated
    if before >= 0:
        before = estimators[before].surface
    kind = type_at_fault(types.config, types.surface[s]) if s >= 0 else -1
    if s != before:
        conclusion.isolated_at_s = t
    if kind != conclusion.type:
        conclusion.type, conclusion.type_at_s = kind, t
    conclusion.isolated = estimator_for(layout, s, kind) if s >= 0 else s
    take_the_lead(types, conclusion, layout, estimators)


@kernel
def estimator_for(layout, s, kind):
    """The estimator that stands for a fault of this type (-1 if open) on surface s."""
    return layout.loss_of[s] if kind in (CONSTANT_LOSS, VARYING_LOSS) else layout.position_of[s]


@kernel
def measure_for(surface):
    """What is to be done about a surface at fault as far as is known: LOSES, FIXED, LAGS or SHIFTED.

    To add what the last frame shows to be off is right for a bias and an oscillation, serves a loss of
    effectiveness meanwhile, and moves the command so that a jam shows in the next frame.
    """
    if is_fixed(surface):
        return FIXED
    if not any_constant(surface) and not left(surface, VARYING_LOSS):
        return LAGS if left(surface, SLOW) else SHIFTED
    open_yet = held_elsewhere(surface) or left(surface, BIAS)
    return LOSES if loses(surface) and not open_yet else SHIFTED


@kernel
def presumed(types, conclusion, layout, estimators):
    """The surface the law acts upon: the one at fault, or the likeliest; NO_SURFACE yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if conclusion.isolated >= 0:
        return estimators[conclusion.isolated].surface
    s = sole(types.surface, True)
    if s >= 0:
        return s
    for s, surface in enumerate(types.surface):
        if layout.dominant_axis[s] == PITCH and possible(surface):
            return s
    return NO_SURFACE


@kernel
def take_the_lead(types, conclusion, layout, estimators):
    """Settle on which surface the law acts and how."""
    s = presumed(types, conclusion, layout, estimators)
    for other in types.surface:
        other.measure = -1
    conclusion.lead, conclusion.lead_kind = NO_SURFACE, -1
    if s >= 0:
        surface = types.surface[s]
        conclusion.lead_kind = measure_for(surface)
        if still_there(types.config, surface, conclusion.lead_kind, True):
            conclusion.lead, surface.measure = s, conclusion.lead_kind


@kernel
def still_there(config, surface, measure, at_fault):
    """Whether the fault of a surface shows, or did a moment ago; one that has gone is let go."""
    deflection = deflection_error(surface, at_fault) + surface.command
    there = surface.low <= deflection <= surface.high or measure == LOSES
    surface.absent = 0 if there else surface.absent + 1
    return surface.absent * config.dt < ABSENT_S - _ROUNDING


@kernel
def deflection_error(surface, at_fault):
    """How far a surface is off its command, rad: by the types left if it is at fault, or as the last frame
    shows it."""
    if at_fault:
        if left(surface, FLOAT):
            return within_travel(surface, 0.0) - surface.command
        stuck, biased = left(surface, STUCK), left(surface, BIAS)
        if stuck and not biased:
            return middle(surface, STUCK) - surface.command
        if biased and surface.set_high[BIAS] - surface.set_low[BIAS] < np.inf:
            return middle(surface, BIAS)
    return 0.5 * (surface.low + surface.high) - surface.command


@kernel
def effectiveness_left(types, layout, estimators, s):
    """What surface s has left of its effectiveness.

    The estimator fits both axes of a surface, so beside another fault the set of the constant is asked.
    """
    surface = types.surface[s]
    if types.pair.enabled and possible(surface) and left(surface, CONSTANT_LOSS):
        return middle(surface, CONSTANT_LOSS)
    return 1.0 + estimators[layout.loss_of[s]].theta[layout.dominant_axis[s]]
