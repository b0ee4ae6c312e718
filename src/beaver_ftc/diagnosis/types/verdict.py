"""From the types left to a verdict: the surface at fault, the type of its fault, and what the law does."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, UNANTICIPATED
from beaver_ftc.diagnosis.types.candidates import (
    NO_SURFACE,
    any_constant,
    anything_left,
    explained,
    held_elsewhere,
    is_fixed,
    left,
    loses,
    may_be_growing,
    may_be_slow,
    may_creep,
    one_type,
    possible,
    sole,
    sole_type,
    swings,
    would_have_swung,
)
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.diagnosis.types.registry import (
    BIAS,
    CONSTANT_LOSS,
    FLOAT,
    GROWING_BIAS,
    OSCILLATORY,
    SLOW,
    STUCK,
    VARYING_LOSS,
)
from beaver_ftc.diagnosis.types.sets import middle, within_travel

ABSENT_S = 0.2  # a fault that has not shown for so long is let go
_ROUNDING = 1e-9


@kernel
def surface_at_fault(fdi):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    What acts on pitch alone shows no direction, so a surface left over there must also have a type that
    explains it. Of elevator and flap, each of which can do what the other does if it only moves accordingly,
    the one is named for which a constant suffices, once a slow oscillation of the other would have shown.
    """
    s = sole(fdi, False)
    if s == NO_SURFACE:
        return UNANTICIPATED
    if s >= 0:
        return s if fdi.layout.dominant_axis[s] != PITCH or explained(fdi.types.surface[s]) else NOT_ISOLATED
    s = sole(fdi, True)
    return s if s >= 0 and others_refuted(fdi, s) else NOT_ISOLATED


@kernel
def others_refuted(fdi, chosen):
    """Whether nothing but a fault that follows the chosen one's commands is left on the other surfaces.

    An oscillation is given one half-cycle of the slowest to show, a whole one if still possible. An offset
    that grows is as good as constant in the end, whatever the commands; where errors are declared that a
    course can hide in, every type of the others must have been excluded.
    """
    waits = 1
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        if s != chosen and surface.in_question and possible(fdi, s):
            if left(surface, GROWING_BIAS) or (fdi.bound.own_errors and anything_left(surface)):
                return False
            if not would_have_swung(fdi, surface):
                return False
            if left(surface, VARYING_LOSS):
                waits = 2
    return fdi.types.surface[chosen].evidence >= waits * fdi.types.config.patience


@kernel
def type_at_fault(fdi, surface):
    """The type of the fault on a surface, taken to be at fault; -1 while more than one fits or an
    oscillation may yet show."""
    if surface.evidence < fdi.types.config.patience or may_be_slow(fdi, surface):
        return -1
    if fdi.bound.own_errors:
        return sole_type(surface)
    patient = would_have_swung(fdi, surface)
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
def decide(fdi, t):
    """Name the surface and, when it is certain, the type; t s."""
    s = surface_at_fault(fdi)
    before = (
        fdi.isolation.estimator[fdi.verdict.isolated].surface
        if fdi.verdict.isolated >= 0
        else fdi.verdict.isolated
    )
    kind = type_at_fault(fdi, fdi.types.surface[s]) if s >= 0 else -1
    if s != before:
        fdi.verdict.isolated_at_s = t
    if kind != fdi.verdict.type:
        fdi.verdict.type, fdi.verdict.type_at_s = kind, t
    fdi.verdict.isolated = estimator_for(fdi, s, kind) if s >= 0 else s
    take_the_lead(fdi)


@kernel
def estimator_for(fdi, s, kind):
    """The estimator that stands for a fault of this type (-1 if open) on surface s."""
    return fdi.layout.loss_of[s] if kind in (CONSTANT_LOSS, VARYING_LOSS) else fdi.layout.position_of[s]


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
def presumed(fdi):
    """The surface the law acts upon: the one at fault, or the likeliest; NO_SURFACE yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if fdi.verdict.isolated >= 0:
        return fdi.isolation.estimator[fdi.verdict.isolated].surface
    s = sole(fdi, True)
    if s >= 0:
        return s
    for s in range(fdi.types.surface.size):
        if fdi.layout.dominant_axis[s] == PITCH and possible(fdi, s):
            return s
    return NO_SURFACE


@kernel
def take_the_lead(fdi):
    """Settle on which surface the law acts and how."""
    s = presumed(fdi)
    for other in range(fdi.types.surface.size):
        fdi.types.surface[other].measure = -1
    fdi.verdict.lead, fdi.verdict.lead_kind = NO_SURFACE, -1
    if s >= 0:
        surface = fdi.types.surface[s]
        fdi.verdict.lead_kind = measure_for(surface)
        if still_there(fdi, surface, fdi.verdict.lead_kind, True):
            fdi.verdict.lead, surface.measure = s, fdi.verdict.lead_kind


@kernel
def still_there(fdi, surface, measure, at_fault):
    """Whether the fault of a surface shows, or did a moment ago; one that has gone is let go."""
    deflection = deflection_error(surface, at_fault) + surface.command
    there = surface.low <= deflection <= surface.high or measure == LOSES
    surface.absent = 0 if there else surface.absent + 1
    return surface.absent * fdi.config.dt < ABSENT_S - _ROUNDING


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
def effectiveness_left(fdi, s):
    """What surface s has left of its effectiveness.

    The estimator fits both axes of a surface, so beside another fault the set of the constant is asked.
    """
    if fdi.types.pair.enabled and possible(fdi, s) and left(fdi.types.surface[s], CONSTANT_LOSS):
        return middle(fdi.types.surface[s], CONSTANT_LOSS)
    return 1.0 + fdi.isolation.estimator[fdi.layout.loss_of[s]].theta[fdi.layout.dominant_axis[s]]
