"""Which type of fault is on which surface: from the remaining types to the finding. modes.py then chooses
what the law does, and findings.py puts the finding in words.

No type is named here: the columns of the table (`FaultType`) say what distinguishes one from another. Kernels
of one surface assume that it is at fault; `can_be_faulty` says whether it can be.

    remains     the type is not excluded
    sole        the only surface, or type, that remains
    shown       the type need not show itself, or has done so (`has_shown`)
    hidden      a surface at rest would not show the type
    anomalous   a frame that more than the declared uncertainty must explain; counted in `evidence`

    types       record of `fault_types_dtype`
    past        record of `conclusion_dtype`, of the frame before
    layout      record of `state.layout_dtype`
    kind        a type, TYPE_UNDECIDED or NO_TYPE
    mask        types, (N_TYPES,) bool
    finding     four values: an estimator, NOT_ISOLATED or UNANTICIPATED; the time of its isolation, s; the
                kind; the time since which the fault is of this kind, s

In has_shown(h, srf, h) the first h selects the kernel of the type, and the second is its argument. Other
symbols: types/__init__.py.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, UNANTICIPATED
from beaver_ftc.diagnosis.types import SCALE_COMMAND
from beaver_ftc.diagnosis.types.registry import (
    ALL,
    CAN_LOOK_LIKE,
    CONSTANT,
    FOLLOWS_COMMAND,
    HIDDEN_AT_REST,
    MODE,
    N_CONSTANT,
    N_TYPES,
    SAME_NAME,
    SHOW_HALF_CYCLES,
    STOP_SIDE,
    VARYING_LIKE,
    VARYING_QUIET,
    VARYING_SHOWN,
    WAIT_HALF_CYCLES,
    has_shown,
    motion_rules_out,
)

NO_SURFACE, SEVERAL_SURFACES = -1, -2
TYPE_UNDECIDED, NO_TYPE = -1, -2  # more than one type remains, or none
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
def type_remains(srf, h):
    """Whether a type is not excluded."""
    return not srf.sets.excluded[h]


@kernel
def any_remains(srf, mask):
    """Whether any type of a mask (N_TYPES,) remains."""
    # A loop: compiled code with np.any loads scipy.linalg, which takes longer than the flight.
    for h in range(N_TYPES):
        if mask[h] and type_remains(srf, h):
            return True
    return False


@kernel
def constant_remains(srf):
    """Whether a type with a constant parameter remains."""
    return any_remains(srf, CONSTANT)


@kernel
def explains_flight(srf):
    """Whether some type explains the flight: it remains and is shown."""
    for h in range(N_TYPES):
        if type_remains(srf, h) and has_shown(h, srf, h):
            return True
    return False


@kernel
def would_have_shown(c, srf):
    """Whether each type that must show itself is excluded, or has been waited for: SHOW_HALF_CYCLES
    half-cycles of anomalous frames in which no stop could hide it (`n_unhidden`)."""
    for h in range(N_TYPES):
        if type_remains(srf, h) and srf.evidence.n_unhidden < SHOW_HALF_CYCLES[h] * c.half_frames:
            return False
    return True


@kernel
def sole_type(srf, mask):
    """The sole type of a mask, NO_TYPE if none remains, or TYPE_UNDECIDED if types of several names remain;
    of several of one name, the first."""
    kind = NO_TYPE
    for h in range(N_TYPES):
        if mask[h] and type_remains(srf, h):
            if kind >= 0 and SAME_NAME[h] != SAME_NAME[kind]:
                return TYPE_UNDECIDED
            kind = h if kind < 0 else kind
    return kind


@kernel
def sole_shown_type(srf, mask):
    """The sole type of a mask if it is shown, else TYPE_UNDECIDED."""
    kind = sole_type(srf, mask)
    return kind if kind >= 0 and has_shown(kind, srf, kind) else TYPE_UNDECIDED


@kernel
def may_be_hidden(c, srf):
    """Whether the fault may be a hidden type although a constant type explains it. An example is a slow
    surface that has reached its command. The surface has then been off its command for less than half a
    cycle: n_anomalous - n_rest < half_frames."""
    return (
        constant_remains(srf)
        and srf.evidence.n_anomalous - srf.evidence.n_rest < c.half_frames
        and any_remains(srf, HIDDEN_AT_REST)
    )


@kernel
def can_be_another(srf, apparent, with_dependent):
    """Whether what looks like the constant type `apparent` may be a varying type h: h remains, can look like
    a constant type j that remains and has the name of `apparent`, and the motion does not rule h out.

    with_dependent: whether types in FOLLOWS_COMMAND count as well.
    """
    for h in range(N_CONSTANT, N_TYPES):
        if apparent >= 0 and type_remains(srf, h) and (with_dependent or not FOLLOWS_COMMAND[h]):
            for j in range(N_CONSTANT):
                alike = SAME_NAME[j] == SAME_NAME[apparent] and CAN_LOOK_LIKE[h, j] and type_remains(srf, j)
                if alike and not motion_rules_out(h, srf, h, STOP_SIDE[j]):
                    return True
    return False


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
    c, wait_half_cycles = types.config, 1
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
def type_on_surface(c, srf):
    """The type of the fault on a surface, taken to be at fault, after half a cycle of anomalous frames in
    which it is not hidden; TYPE_UNDECIDED while more than one fits or one may yet show itself.

        errors of effects (has_eG)   the sole type, once it is shown
        a constant type remains      the sole constant type, once those that must show would have, unless it
                                     can be another
        no constant type remains     the sole varying type that need not show itself, at the same time, unless
                                     another can look like it; if there is none, the sole one that must and
                                     has
    """
    if srf.evidence.n_anomalous < c.half_frames or may_be_hidden(c, srf):
        return TYPE_UNDECIDED
    if c.has_eG:  # in coarse sets a constant proves nothing
        return sole_shown_type(srf, ALL)
    shown = would_have_shown(c, srf)
    if constant_remains(srf):
        kind = sole_type(srf, CONSTANT)
        return kind if shown and not can_be_another(srf, kind, True) else TYPE_UNDECIDED
    kind = sole_type(srf, VARYING_QUIET)
    if kind == NO_TYPE:
        return sole_shown_type(srf, VARYING_SHOWN)
    if kind < 0 or not shown or any_remains(srf, VARYING_LIKE[kind]):
        return TYPE_UNDECIDED
    return kind


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
