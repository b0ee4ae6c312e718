"""What remains on a surface, taken to be at fault, and of which type its fault is.

No type is named here: the columns of the table (`FaultType`) say what distinguishes one from another.

    remains     the type is not excluded
    sole        the only type that remains
    shown       the type need not show itself, or has done so (`has_shown`)
    hidden      a surface at rest would not show the type
    anomalous   a frame that more than the declared uncertainty must explain; counted in `evidence`

    kind        a type, TYPE_UNDECIDED or NO_TYPE
    mask        types, (N_TYPES,) bool

    srf, h      record of a surface (records.py), number of a type
    c           configuration of the types (TYPES_CONFIG_RECORD)

In has_shown(h, srf, h) the first h selects the kernel of the type, and the second is its argument.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types.registry import (
    ALL,
    CAN_LOOK_LIKE,
    CONSTANT,
    FOLLOWS_COMMAND,
    HIDDEN_AT_REST,
    N_CONSTANT,
    N_TYPES,
    SAME_NAME,
    SHOW_HALF_CYCLES,
    STOP_SIDE,
    VARYING_LIKE,
    VARYING_QUIET,
    VARYING_SHOWN,
    has_shown,
    motion_rules_out,
)

TYPE_UNDECIDED, NO_TYPE = -1, -2  # more than one type remains, or none


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
    half-cycles of anomalous frames since a stop could last hide it (`n_unhidden`)."""
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
    """The sole type of a mask, of several of one name the first, if it is shown; else TYPE_UNDECIDED."""
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
def type_on_surface(c, srf):
    """The type of the fault on a surface, taken to be at fault, after half a cycle of anomalous frames,
    unless a hidden type may explain it (`may_be_hidden`); TYPE_UNDECIDED while more than one fits or one may
    yet show itself.

        errors of effects (has_eG)   the sole type, once it is shown
        a constant type remains      the sole constant type, once those that must show would have, unless it
                                     can be another
        no constant type remains     the sole varying type that need not show itself, once those that must
                                     would have, unless another can look like it; if there is none, the sole
                                     one that must and has
    """
    if srf.evidence.n_anomalous < c.half_frames or may_be_hidden(c, srf):
        return TYPE_UNDECIDED
    if c.has_eG:  # a set is wide then: that a constant type remains does not show that it is constant
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
