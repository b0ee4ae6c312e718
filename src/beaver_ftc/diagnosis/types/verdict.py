"""Which surface is at fault: from what remains on each surface (remaining.py) to the finding. modes.py then
chooses what the law does, and findings.py puts the finding in words.

    sole        the only surface that remains

    types       record of `fault_types_dtype`
    past        record of `conclusion_dtype`, of the frame before
    layout      record of `isolation.layout_dtype`
    finding     four values: an estimator, NOT_ISOLATED or UNANTICIPATED; the time of its isolation, s; the
                kind; the time since which the fault is of this kind, s
    kind        a type, TYPE_UNDECIDED or NO_TYPE (remaining.py)
    s, srf, t   surface, and its record (records.py); time, s
"""

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.types import SCALE_COMMAND
from beaver_ftc.diagnosis.types.registry import ALL, FOLLOWS_COMMAND, MODE, N_TYPES, WAIT_HALF_CYCLES
from beaver_ftc.diagnosis.types.remaining import (
    TYPE_UNDECIDED,
    any_remains,
    constant_remains,
    explains_flight,
    type_on_surface,
    type_remains,
    would_have_shown,
)

NO_SURFACE, SEVERAL_SURFACES = -1, -2
# `status.basis`: what decides whether a surface can be at fault: its estimator, or what pairs.py deduces from
# the other surface of its plane.
BY_ESTIMATOR, DEDUCED_FAULTY, DEDUCED_HEALTHY = range(3)


@kernel
def can_be_faulty(srf):
    """Whether a surface can be at fault: as pairs.py has deduced, or else if the estimator of its position is
    not excluded."""
    if srf.status.basis != BY_ESTIMATOR:
        return srf.status.basis == DEDUCED_FAULTY
    return not srf.not_at_position


@kernel
def sole_surface(surfs, constant):
    """The sole surface that can be at fault, of those that `may_be_sole`; or NO_SURFACE or SEVERAL_SURFACES.
    With `constant`, only surfaces on which a constant type remains count."""
    sole = NO_SURFACE
    for s, srf in enumerate(surfs):
        if srf.status.may_be_sole and can_be_faulty(srf) and (constant_remains(srf) or not constant):
            sole = s if sole == NO_SURFACE else SEVERAL_SURFACES
    return sole


@kernel
def find_surface(types, layout):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

        surfaces that can be at fault                               isolated
        none                                                        UNANTICIPATED
        one, not of pitch                                           that surface
        one of pitch, on which a type explains the flight           that surface
        several, a constant type remains on one, and the others     the one with the constant type
        are dismissed (`others_dismissed`)
        otherwise                                                   NOT_ISOLATED

    Surfaces of pitch act on pitch alone, so the direction of the acceleration does not distinguish them. If
    elevator or flap moves in a certain way, it has the effect of a constant fault of the other: this is why
    the constant type decides between several.
    """
    s = sole_surface(types.surface, False)
    if s == NO_SURFACE:
        return UNANTICIPATED
    if s >= 0:
        return s if layout.dominant_axis[s] != PITCH or explains_flight(types.surface[s]) else NOT_ISOLATED
    s = sole_surface(types.surface, True)
    return s if s >= 0 and others_dismissed(types, s) else NOT_ISOLATED


@kernel
def others_dismissed(types, sole):
    """Whether every surface other than `sole` can only have a fault whose deflection error cannot stay
    constant (FOLLOWS_COMMAND), and there have been enough anomalous frames to say so:

        n_anomalous of `sole` >= half_frames max(1, WAIT_HALF_CYCLES of the types that remain on the others)

    A type that must show itself has been waited for (`would_have_shown`). If errors of the surfaces' effects
    are declared (has_eG), a varying fault can hide in them, and every type of the others must be excluded.
    """
    c = types.config
    wait_half_cycles = 1
    for s, srf in enumerate(types.surface):
        if s != sole and srf.status.may_be_sole and can_be_faulty(srf):
            if (c.has_eG and any_remains(srf, ALL)) or not would_have_shown(c, srf):
                return False
            for h in range(N_TYPES):
                if type_remains(srf, h):
                    if not FOLLOWS_COMMAND[h]:
                        return False
                    wait_half_cycles = max(wait_half_cycles, WAIT_HALF_CYCLES[h])
    return types.surface[sole].evidence.n_anomalous >= wait_half_cycles * c.half_frames


@kernel
def decide_single(types, past, layout, t):
    """The finding on the surface and, when it is certain, on the type, for `conclusion.record_decision`.

    past gives the times of what has not changed since the frame before; t s.
    """
    s = find_surface(types, layout)
    for i, srf in enumerate(types.surface):
        update_status(srf, i == s, type_on_surface(types.config, srf), t)
    return finding_on_surface(types, past, layout, s, t)


@kernel
def update_status(srf, is_isolated, kind, t):
    """Record at t s whether a surface is isolated, and, if so, the kind of its fault."""
    kind = kind if is_isolated else TYPE_UNDECIDED
    status = srf.status
    if is_isolated and not status.is_isolated:
        status.isolated_at_s = t
    if kind != status.fault_type:
        status.typed_at_s = t
    status.is_isolated = is_isolated
    status.fault_type = kind


@kernel
def finding_on_surface(types, past, layout, s, t):
    """The finding on surface s, or that of s = NOT_ISOLATED or UNANTICIPATED. A type whose command is scaled
    has the estimator of the loss, any other, and an open one, that of the position."""
    if s >= 0:
        status = types.surface[s].status
        kind = status.fault_type
        j = layout.loss[s] if kind >= 0 and MODE[kind] == SCALE_COMMAND else layout.position[s]
        return (j, status.isolated_at_s, kind, status.typed_at_s)
    return (s, t if s != past.isolated_estimator else past.isolated_at_s, TYPE_UNDECIDED, past.typed_at_s)
