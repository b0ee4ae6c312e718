"""Two faults in the plane of pitch: two unknown deflections in one equation, so an assumption is necessary.

    1  A constant fault that explains everything on one surface is taken for the only fault (`sole_pitch`).
    2  Once it can be no varying fault, its sets are stored (`store_first`), and it is taken to last.
    3  If the flight refutes it, a second fault begins on the other surface (`begin_second_if_shown`). The
       deflection of that surface follows from the stored sets of the first (`locate_second`).
    4  If nothing on the other surface explains the flight, the name of the first is withdrawn
       (`update_second`).

In any other case the plane of pitch stays open.

    types           record of `fault_types_dtype`
    layout          gives the group of a surface and the other surface in it (partner)
    s, srf          surface, and its record (records.py); 1, 2: of the first and of the second fault
    est             estimators of the isolation; eff: effect of the fault of one of them
    nu, nu_max      (3,) rad/s2: innovation, and its bound without a fault
    lo, hi          interval of a deflection, rad
    sole            the only type that remains
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.isolation import PITCH_GROUP
from beaver_ftc.diagnosis.types import GIVE_UP, examination, remaining
from beaver_ftc.diagnosis.types.observations import forget_anomalies, last_error, observe_error, set_anomalous
from beaver_ftc.diagnosis.types.registry import ALL, CONSTANT, MODE, N_CONSTANT, N_TYPES, deflection_range
from beaver_ftc.diagnosis.types.remaining import (
    TYPE_UNDECIDED,
    constant_remains,
    type_on_surface,
    type_remains,
)
from beaver_ftc.diagnosis.types.verdict import (
    DEDUCED_FAULTY,
    DEDUCED_HEALTHY,
    NO_SURFACE,
    can_be_faulty,
    find_surface,
    update_status,
)


@kernel
def observe_pitch(types, layout, est, nu, nu_max):
    """Set whether the frame is anomalous in pitch; after a second fault has begun, find where the second
    surface was."""
    if has_second(types):
        locate_second(types, layout, est, nu, nu_max)
        return
    for s, srf in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP:
            set_anomalous(srf, abs(nu[PITCH]) > nu_max[PITCH])


@kernel
def has_second(types):
    """Whether a second fault has begun."""
    s1 = types.pair.first_pitch
    return s1 != NO_SURFACE and not types.surface[s1].status.may_be_sole


@kernel
def locate_second(types, layout, est, nu, nu_max):
    """Find where the second surface was, given the interval (lo, hi) of the first (`constant_range`), rad:

        p2 - u2 = (nu - M1 (p1 - u1)) / M2 +- (|M1| (hi - lo) / 2 + nu_max + r1 + r2) / |M2|

    p1 = (lo + hi) / 2; M1, M2: pitch acceleration by each surface, rad/s2 per rad; nu, nu_max, r1, r2 of
    pitch, rad/s2. If no deflection within reach fits, the second surface is deduced to be healthy.
    """
    s1 = types.pair.first_pitch
    s2 = layout.partner[s1]
    srf1 = types.surface[s1]
    srf2 = types.surface[s2]
    eff1 = est[layout.position[s1]].effect
    eff2 = est[layout.position[s2]].effect
    M1 = eff1.Z[PITCH]
    M2 = eff2.Z[PITCH]
    lo, hi = constant_range(types.config, srf1, types.frame_index)
    srf1.last.lo = lo
    srf1.last.hi = hi
    set_anomalous(srf1, 0)
    e = (nu[PITCH] - M1 * last_error(srf1)) / M2
    tol = 0.5 * abs(M1) * (hi - lo) + nu_max[PITCH] + eff1.r[PITCH] + eff2.r[PITCH]
    if not observe_error(srf2, e, tol / abs(M2)):
        srf2.status.basis = DEDUCED_HEALTHY


@kernel
def constant_range(c, srf, k):
    """Least and greatest deflection of a surface by frame k over the constant types that remain, within its
    reach, rad."""
    lo = np.inf
    hi = -np.inf
    act = srf.actuator
    for h in range(N_CONSTANT):
        if type_remains(srf, h):
            h_lo, h_hi = deflection_range(h, c, srf, h, k)
            lo, hi = min(lo, h_lo), max(hi, h_hi)
    return min(max(lo, act.reach_lo), act.reach_hi), min(max(hi, act.reach_lo), act.reach_hi)


@kernel
def isolate_pitch(types, layout, t):
    """Update which surfaces of pitch are at fault, at t s: the only one, or both after a second fault has
    begun."""
    begin_second_if_shown(types, layout)
    if has_second(types):
        update_second(types, layout, t)
        return
    sole = sole_pitch(types, layout)
    for s, srf in enumerate(types.surface):
        if layout.group[s] == PITCH_GROUP:
            kind = type_on_surface(types.config, srf) if s == sole else TYPE_UNDECIDED
            # a jam may as well be a trailing surface or one at its stop, if the other is off by a constant
            open_yet = kind >= 0 and MODE[kind] == GIVE_UP
            update_status(srf, s == sole, TYPE_UNDECIDED if open_yet else kind, t)


@kernel
def sole_pitch(types, layout):
    """The surface of pitch at fault if a constant type explains everything on it, or NO_SURFACE; its sets are
    stored once varying types are dismissed."""
    s = find_surface(types, layout) if types.pair.group_alarm[PITCH_GROUP] else NO_SURFACE
    if s < 0 or not constant_remains(types.surface[s]):
        return NO_SURFACE
    if dismiss_varying(types.config, types.surface[s]):
        store_first(types, s)
    return s


@kernel
def dismiss_varying(c, srf):
    """Whether no varying type needs to be considered any more: a slow oscillation, a slow surface or a
    growing bias would have shown by now. No growing bias (not in FOLLOWS_COMMAND) can look like the constant
    type, no type is hidden, and the flight has been anomalous for half a cycle."""
    imitated = remaining.can_be_another(srf, remaining.sole_type(srf, CONSTANT), False)
    in_doubt = imitated or remaining.may_be_hidden(c, srf)
    long_enough = srf.evidence.n_anomalous >= c.half_frames
    return long_enough and remaining.would_have_shown(c, srf) and not in_doubt


@kernel
def store_first(types, s):
    """Store the sets of the first fault, which has no varying type; store them again once constant types that
    they contain have been excluded for `half_frames`.

    The wait is necessary because a second fault that begins to show may refute one type first, and all of
    them soon after: the sets from before it began must then still be there.
    """
    pair = types.pair
    srf = types.surface[s]
    newly_excluded = False
    for h in range(N_CONSTANT):
        newly_excluded = newly_excluded or srf.sets.excluded[h] != srf.first_sets.excluded[h]
    pair.n_unstored = pair.n_unstored + 1 if newly_excluded else 0
    if pair.first_pitch != s or pair.n_unstored >= types.config.half_frames:
        pair.first_pitch = s
        pair.n_unstored = 0
        copy_sets(srf.first_sets, srf.sets)
        for h in range(N_CONSTANT, N_TYPES):
            srf.first_sets.excluded[h] = 1


@kernel
def copy_sets(new, old):
    """Copy the feasible sets `old` into `new`."""
    new.low = old.low
    new.high = old.high
    new.excluded = old.excluded


@kernel
def begin_second_if_shown(types, layout):
    """Begin the diagnosis of a second fault once no constant type on the first surface explains the flight,
    if that surface has a partner: the first gets its stored sets back, and the partner starts with no
    knowledge."""
    s1 = types.pair.first_pitch
    if s1 == NO_SURFACE or layout.partner[s1] < 0 or has_second(types):
        return
    srf1 = types.surface[s1]
    srf2 = types.surface[layout.partner[s1]]
    if can_be_faulty(srf1) and constant_remains(srf1):
        return
    copy_sets(srf1.sets, srf1.first_sets)
    examination.restart_surface(srf2)
    for srf in (srf1, srf2):
        srf.status.may_be_sole = 0
        srf.status.basis = DEDUCED_FAULTY
        forget_anomalies(srf)


@kernel
def update_second(types, layout, t):
    """Update which of the two surfaces are at fault, at t s, after a second fault has begun: the first (srf1)
    unless nothing on the second (srf2) explains what refuted it; the second once a type on it shows."""
    s1 = types.pair.first_pitch
    srf1 = types.surface[s1]
    srf2 = types.surface[layout.partner[s1]]
    anomalous = srf2.evidence.n_anomalous > 0
    possible = can_be_faulty(srf2) and remaining.any_remains(srf2, ALL)
    update_status(srf1, possible or not anomalous, srf1.status.fault_type, t)
    shows = anomalous and possible and remaining.explains_flight(srf2)
    update_status(srf2, shows, type_on_surface(types.config, srf2), t)
