"""From the types left to a verdict: surface, type, and what the law does; findings.py puts it in words.

No type is named here: the columns of the table (`FaultType`) say what distinguishes one from another. Kernels
of one surface assume that it is at fault; `can_be_faulty` says whether it can be.

types: of `fault_types_dtype`; past: of `conclusion_dtype`, of the frame before; kind: a type, TYPE_UNDECIDED
or NO_TYPE; mode: of accommodation. A finding is a tuple of four: an estimator, NOT_ISOLATED or UNANTICIPATED;
the instant of its isolation, s; the kind; the instant since which it is of this kind, s. In
has_shown(h, srf, h) the first h selects the kernel of the type, and the second is its argument. Other
symbols: types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, PITCH_GROUP, UNANTICIPATED
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    last_error,
    registry,
    set_middle,
)
from beaver_ftc.diagnosis.types.registry import (
    ALL,
    CAN_LOOK_LIKE,
    CONSTANT,
    END_TYPE,
    ERROR_TYPES,
    FOLLOWS_COMMAND,
    HIDDEN_AT_REST,
    MODE,
    N_CONSTANT,
    N_TYPES,
    NAMED,
    SAME_NAME,
    SERVES,
    SHOW_HALF_CYCLES,
    STOP_SIDE,
    VARYING_LIKE,
    VARYING_OF_MODE,
    VARYING_QUIET,
    VARYING_SHOWN,
    WAIT_HALF_CYCLES,
    has_shown,
    motion_rules_out,
)

NO_SURFACE, SEVERAL_SURFACES = -1, -2
TYPE_UNDECIDED, NO_TYPE = -1, -2  # the type of a fault of which more than one type is left, or none
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, DEDUCED_FAULTY, DEDUCED_HEALTHY = range(3)
MAX_SILENCE_S = 0.2  # a fault that has not shown for as long is taken for gone
_TIME_TOLERANCE_S = 1e-9


@kernel
def record_exclusions(surfs, layout, est):
    """Keep for every surface whether its estimator is excluded."""
    for s, srf in enumerate(surfs):
        srf.not_at_position = est[layout.position[s]].excluded


@kernel
def can_be_faulty(srf):
    """Whether anything on a surface can be the fault."""
    if srf.status.basis != BY_ESTIMATOR:
        return srf.status.basis == DEDUCED_FAULTY
    return not srf.not_at_position


@kernel
def type_remains(srf, h):
    """Whether a type is not excluded."""
    return not srf.sets.excluded[h]


@kernel
def any_remains(srf, mask):
    """Whether any type of a mask (N_TYPES,) is left."""
    # A loop: compiled code with np.any loads scipy.linalg, which takes longer than the flight.
    for h in range(N_TYPES):
        if mask[h] and type_remains(srf, h):
            return True
    return False


@kernel
def constant_remains(srf):
    """Whether a type with a constant parameter is left."""
    return any_remains(srf, CONSTANT)


@kernel
def name_remains(srf, named):
    """Whether a type of this name is left; with TYPE_UNDECIDED, one of any name."""
    return any_remains(srf, NAMED[named])


@kernel
def explains_flight(srf):
    """Whether some type explains the flight: it is left, and if it must show itself it has."""
    for h in range(N_TYPES):
        if type_remains(srf, h) and has_shown(h, srf, h):
            return True
    return False


@kernel
def would_have_shown(c, srf):
    """Whether each type that must show itself is excluded, or has had the time to, hidden by no stop."""
    for h in range(N_TYPES):
        if type_remains(srf, h) and srf.evidence.n_unhidden < SHOW_HALF_CYCLES[h] * c.half_frames:
            return False
    return True


@kernel
def sole_type(srf, mask):
    """The one type of a mask that is left, NO_TYPE, or TYPE_UNDECIDED if there are several; of several of one
    name, the first."""
    kind = NO_TYPE
    for h in range(N_TYPES):
        if mask[h] and type_remains(srf, h):
            if kind >= 0 and SAME_NAME[h] != SAME_NAME[kind]:
                return TYPE_UNDECIDED
            kind = h if kind < 0 else kind
    return kind


@kernel
def sole_shown_type(srf, mask):
    """The one type of a mask that is left, if it has shown itself; else TYPE_UNDECIDED."""
    kind = sole_type(srf, mask)
    return kind if kind >= 0 and has_shown(kind, srf, kind) else TYPE_UNDECIDED


@kernel
def may_be_hidden(c, srf):
    """Whether what a constant explains may be a type that does not show in a surface at rest, such as a slow
    surface that has come to where it is commanded: it has not stood off its command for long."""
    return (
        constant_remains(srf)
        and srf.evidence.n_anomalous - srf.evidence.n_rest < c.half_frames
        and any_remains(srf, HIDDEN_AT_REST)
    )


@kernel
def can_be_another(srf, apparent, dependent):
    """Whether what looks like the constant type `apparent`, or another left of its name, may be a varying
    type that is left; unless `dependent`, one that does not follow the command.
    """
    for h in range(N_CONSTANT, N_TYPES):
        if apparent >= 0 and type_remains(srf, h) and (dependent or not FOLLOWS_COMMAND[h]):
            for j in range(N_CONSTANT):
                alike = SAME_NAME[j] == SAME_NAME[apparent] and CAN_LOOK_LIKE[h, j] and type_remains(srf, j)
                if alike and not motion_rules_out(h, srf, h, STOP_SIDE[j]):
                    return True
    return False


@kernel
def sole_surface(surfs, constant):
    """The one possible surface, with a type of constant parameter left if so asked; NO_SURFACE or
    SEVERAL_SURFACES."""
    sole = NO_SURFACE
    for s, srf in enumerate(surfs):
        if srf.status.may_be_sole and can_be_faulty(srf) and (constant_remains(srf) or not constant):
            sole = s if sole == NO_SURFACE else SEVERAL_SURFACES
    return sole


@kernel
def find_surface(types, layout):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    1. No surface can be at fault: UNANTICIPATED.
    2. One can: that surface. What acts on pitch alone shows no direction, so there a type must explain the
       flight as well.
    3. Several can. If elevator or flap moves in a certain way, it has the effect of a constant fault of the
       other. So the one surface that a constant fault explains is isolated, once `others_dismissed`.

    In all other cases NOT_ISOLATED.
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
    """Whether every other surface than `sole` can only have a fault that depends on its command.

    A type that must show itself is given the time to. If errors of the surfaces' effects are declared
    (has_eG), a varying fault can hide in them, and every type of the others must have been excluded.
    """
    c, n = types.config, 1
    for s, srf in enumerate(types.surface):
        if s != sole and srf.status.may_be_sole and can_be_faulty(srf):
            if c.has_eG and any_remains(srf, ALL):
                return False
            if not would_have_shown(c, srf):
                return False
            for h in range(N_TYPES):
                if type_remains(srf, h):
                    if not FOLLOWS_COMMAND[h]:
                        return False
                    n = max(n, WAIT_HALF_CYCLES[h])
    return types.surface[sole].evidence.n_anomalous >= n * c.half_frames


@kernel
def type_on_surface(c, srf):
    """The type of the fault on a surface, taken to be at fault; TYPE_UNDECIDED while more than one fits or
    one may yet show itself.

        errors of effects (has_eG)       the sole type left, once it has shown itself
        a constant type left             the sole constant type, unless it can be another
        no constant type left            the sole varying type that need not show itself, unless it can be
                                         another; if there is none, the sole one that has shown itself
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
    """The finding on the surface and, when it is certain, on the type, for
    `conclusion.record_decision`.

    past: that of the frame before, which gives the instants of what has not changed; t s.
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
    """The finding on surface s, or if s is NOT_ISOLATED or UNANTICIPATED."""
    if s >= 0:
        status = types.surface[s].status
        kind = status.fault_type
        return (estimator_of_fault(layout, s, kind), status.isolated_at_s, kind, status.typed_at_s)
    return (s, t if s != past.isolated_estimator else past.isolated_at_s, TYPE_UNDECIDED, past.typed_at_s)


@kernel
def estimator_of_fault(layout, s, h):
    """The estimator that stands for a fault of this type (TYPE_UNDECIDED if open) on surface s."""
    return layout.loss[s] if h >= 0 and MODE[h] == SCALE_COMMAND else layout.position[s]


@kernel
def choose_mode(srf):
    """The mode of accommodation for a surface at fault as far as is known.

    SUBTRACT_OFFSET subtracts what the last frame shows to be off. It serves a type of another mode meanwhile,
    and moves the command, so that a surface that does not follow shows in the next frame.
    """
    if constant_remains(srf):
        for mode in (GIVE_UP, SCALE_COMMAND, WAIT_FOR_SURFACE):
            if serves_constants(srf, mode):
                return mode
    else:
        for mode in (SCALE_COMMAND, WAIT_FOR_SURFACE, GIVE_UP):
            if any_remains(srf, VARYING_OF_MODE[mode]):
                return mode
    return SUBTRACT_OFFSET


@kernel
def serves_constants(srf, mode):
    """Whether a mode is that of some type of constant parameter left, and serves all of them."""
    is_own = False
    for h in range(N_CONSTANT):
        if type_remains(srf, h):
            is_own = is_own or MODE[h] == mode
            serves_end = END_TYPE[h] >= 0 and type_remains(srf, END_TYPE[h]) and SERVES[mode, END_TYPE[h]]
            if not (SERVES[mode, h] or serves_end):
                return False
    return is_own


@kernel
def presumed_surface(types, layout):
    """The surface that the law acts upon while none is isolated, in pairs none of pitch: the likeliest, or
    NO_SURFACE.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    pair = types.pair
    if pair.enabled and not pair.group_alarm[PITCH_GROUP]:
        return NO_SURFACE
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated and (layout.group[s] == PITCH_GROUP or not pair.enabled):
            return NO_SURFACE
    sole = sole_surface(types.surface, True)
    if sole >= 0:
        return sole
    for s, srf in enumerate(types.surface):
        first = s == layout.main[PITCH] if pair.enabled else can_be_faulty(srf)
        if layout.group[s] == PITCH_GROUP and first:
            return s
    return NO_SURFACE


@kernel
def clear_modes(surfs):
    """Let the law act upon no surface."""
    for srf in surfs:
        srf.accommodation.mode = -1


@kernel
def accommodate(types, layout):
    """Settle what the law does about each surface whose fault shows, or did less than MAX_SILENCE_S ago.
    Returns the lead, which the supervisor follows, and what is done about it: a replaced elevator leads
    before all others."""
    lead, mode, presumed = NO_SURFACE, -1, presumed_surface(types, layout)
    clear_modes(types.surface)
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated or s == presumed:
            possible = srf.status.is_isolated == 1 or can_be_faulty(srf)
            own = choose_mode(srf) if possible else SUBTRACT_OFFSET
            count_silence(srf, own, possible)
            if srf.accommodation.n_silent * types.config.dt < MAX_SILENCE_S - _TIME_TOLERANCE_S:
                srf.accommodation.mode = own
                leads = s == layout.main[PITCH] and own in (SCALE_COMMAND, GIVE_UP)
                if lead == NO_SURFACE or leads:
                    lead, mode = s, own
    return lead, mode


@kernel
def count_silence(srf, mode, possible):
    """Count the frames since the fault of a surface has shown, n_silent. It shows in a frame that agrees with
    its deflection error (`deflection_error`), and always if the mode scales the command.

    possible: whether the surface can be faulty.
    """
    last, acc = srf.last, srf.accommodation
    p = deflection_error(srf, possible) + last.u
    agrees = last.lo <= p <= last.hi or mode == SCALE_COMMAND
    acc.n_silent = 0 if agrees else acc.n_silent + 1


@kernel
def deflection_error(srf, possible):
    """Return the deflection error of a surface, rad: by the types left if it is at fault, or as the last
    frame shows it."""
    if possible:
        for h in ERROR_TYPES:
            if type_remains(srf, h):
                e = registry.deflection_error(h, srf, h)
                if np.isfinite(e):
                    return e
                break
    return last_error(srf)


@kernel
def remaining_effectiveness(types, layout, est, s):
    """Return the remaining effectiveness of surface s, dimensionless.

    The estimator fits both axes of a surface, so with a second fault the set of a constant loss is used. When
    all types are diagnosed, every surface has an estimator of its loss (isolation.py).
    """
    srf = types.surface[s]
    if types.pair.enabled and can_be_faulty(srf):
        for h in range(N_CONSTANT):
            if MODE[h] == SCALE_COMMAND and type_remains(srf, h):
                return set_middle(srf, h)
    return 1.0 + est[layout.loss[s]].theta[layout.dominant_axis[s]]
