"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. In every frame the deflections of both surfaces
follow from them, within the declared errors, whichever surface is at fault. A surface is judged in the frames
in which it was certainly off its command. One surface is named if the other alone cannot explain the flight.
Both are named if neither can, and a type remains on each.

*Pitch*: two unknown deflections in one equation, so an assumption is necessary:

    1  A constant fault that explains everything on one surface is taken for the only fault (`sole_pitch`).
    2  Once it can be no varying fault, its sets are stored (`store_first`), and it is taken to last.
    3  If the flight refutes it, a second fault begins on the other surface (`begin_second_if_shown`). The
       deflection of that surface follows from the stored sets of the first (`locate_second`).
    4  If nothing on the other surface explains the flight, the name of the first is withdrawn
       (`update_second`).

In any other case the plane of pitch stays open.

    types           record of `fault_types_dtype`
    past            record of `conclusion_dtype`, of the frame before
    bank            detection filters
    layout          gives the group of a surface and the other surface in it (partner)
    srf1, srf2      surfaces of the first and of the second fault in pitch

Other symbols: verdict.py, types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.diagnosis.detection.filters import leaves_bound
from beaver_ftc.diagnosis.state import LATERAL_GROUP, PITCH, PITCH_GROUP, ROLL, UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    examination,
    forget_anomalies,
    last_error,
    observe_error,
    set_anomalous,
    verdict,
)
from beaver_ftc.diagnosis.types.registry import ALL, CONSTANT, MODE, N_CONSTANT, deflection_range
from beaver_ftc.diagnosis.types.verdict import NO_SURFACE, can_be_faulty, constant_remains, type_remains


@kernel
def latch_groups(pair, bank):
    """Latch for each group of surfaces whether a residual of the bank has exceeded its threshold on an axis
    of the group."""
    for i in range(3):
        if leaves_bound(bank, i):
            pair.group_alarm[PITCH_GROUP if i == PITCH else LATERAL_GROUP] = 1


@kernel
def locate_one(srf, eff, eff_other, nu, nu_max):
    """Find where one of ailerons and rudder was in the elapsed frame: nu = G (p - u) + eta, two equations,
    solved for this surface by Cramer's rule. False if it was nowhere within its reach.

        p - u = (nu_L N - nu_N L) / det +- (e_L |N| + e_N |L|) / |det|,    det = L1 N - N1 L

    nu_L, nu_N         rad/s2            innovation in roll and yaw
    L1, N1; L, N       rad/s2 per rad    effect in roll and yaw: of this surface, eff; of the other, eff_other
    e_L, e_N           rad/s2            nu_max of the axis, and the tolerances r of both effects
    """
    L1, N1 = eff.Z[ROLL], eff.Z[YAW]
    L, N = eff_other.Z[ROLL], eff_other.Z[YAW]
    det = L1 * N - N1 * L
    e_L = nu_max[ROLL] + eff.r[ROLL] + eff_other.r[ROLL]
    e_N = nu_max[YAW] + eff.r[YAW] + eff_other.r[YAW]
    return observe_error(srf, (nu[ROLL] * N - nu[YAW] * L) / det, (e_L * abs(N) + e_N * abs(L)) / abs(det))


@kernel
def locate_lateral(types, layout, est, nu, nu_max):
    """Find where ailerons and rudder were in the elapsed frame, two deflections in two equations."""
    a, r = layout.main[ROLL], layout.main[YAW]
    for s, s_other in ((a, r), (r, a)):
        eff, eff_other = est[layout.position[s]].effect, est[layout.position[s_other]].effect
        if not locate_one(types.surface[s], eff, eff_other, nu, nu_max):
            types.pair.lateral_outside = 1


@kernel
def constant_range(c, srf, k):
    """Least and greatest deflection of a surface by frame k over the constant types that remain, within its
    reach, rad."""
    lo, hi = np.inf, -np.inf
    for h in range(N_CONSTANT):
        if type_remains(srf, h):
            h_lo, h_hi = deflection_range(h, c, srf, h, k)
            lo = min(lo, h_lo)
            hi = max(hi, h_hi)
    reach_lo, reach_hi = srf.actuator.reach_lo, srf.actuator.reach_hi
    return (min(max(lo, reach_lo), reach_hi), min(max(hi, reach_lo), reach_hi))


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
def locate_second(types, layout, est, nu, nu_max):
    """Find where the second surface was, given the interval (lo, hi) of the first (`constant_range`), rad:

        p2 - u2 = (nu - M1 (p1 - u1)) / M2 +- (|M1| (hi - lo) / 2 + nu_max + r1 + r2) / |M2|

    p1 = (lo + hi) / 2; M1, M2: pitch acceleration by each surface, rad/s2 per rad; nu, nu_max, r1, r2 of
    pitch, rad/s2. If no deflection within reach fits, the second surface is deduced to be healthy.
    """
    s1 = types.pair.first_pitch
    s2 = layout.partner[s1]
    eff1 = est[layout.position[s1]].effect
    eff2 = est[layout.position[s2]].effect
    srf1 = types.surface[s1]
    lo, hi = constant_range(types.config, srf1, types.frame_index)
    srf1.last.lo, srf1.last.hi = lo, hi
    set_anomalous(srf1, 0)
    M1, M2 = eff1.Z[PITCH], eff2.Z[PITCH]
    acc1 = M1 * last_error(srf1)
    tol = 0.5 * abs(M1) * (hi - lo) + nu_max[PITCH] + eff1.r[PITCH] + eff2.r[PITCH]
    if not observe_error(types.surface[s2], (nu[PITCH] - acc1) / M2, tol / abs(M2)):
        types.surface[s2].status.basis = verdict.DEDUCED_HEALTHY


@kernel
def observe_pairs(types, layout, est, bank, nu_max):
    """Observe the elapsed frame and judge the one before. The order matters: `locate_lateral` and
    `observe_pitch` replace what `observe_surfaces` has found as if each surface were alone at fault."""
    nu = bank.output.innovation
    latch_groups(types.pair, bank)
    examination.observe_surfaces(types, layout, est, nu, nu_max)
    locate_lateral(types, layout, est, nu, nu_max)
    observe_pitch(types, layout, est, nu, nu_max)
    examination.judge_frame(types)


@kernel
def isolate_lateral(types, layout, t):
    """Set the isolation of the surfaces of roll and yaw; returns whether the fault of this plane is outside
    the class: neither alone can be faulty (`both`), and both together are refuted.

        isolated    a surface, if the other alone cannot be faulty
        none        before the plane's alarm; and if neither alone can be faulty, but both together are
                    refuted (by deflections out of reach, or since all types of one are excluded), or a type
                    that has to show itself has not
    """
    roller, yawer = types.surface[layout.main[ROLL]], types.surface[layout.main[YAW]]
    both = not can_be_faulty(roller) and not can_be_faulty(yawer)
    refuted, explained = types.pair.lateral_outside == 1, True
    for srf in (roller, yawer):
        refuted = refuted or not verdict.any_remains(srf, ALL)
        explained = explained and verdict.explains_flight(srf)
    isolates = types.pair.group_alarm[LATERAL_GROUP] == 1 and not (both and (refuted or not explained))
    for srf, other in ((roller, yawer), (yawer, roller)):
        at_fault = isolates and not can_be_faulty(other)
        verdict.update_status(srf, at_fault, verdict.type_on_surface(types.config, srf), t)
    return both and refuted


@kernel
def store_first(types, s):
    """Store the sets of the first pitch fault; store them again once types that they contain have been
    excluded for `half_frames`.

    The wait is necessary because a second fault that begins to show may refute one type first, and all of
    them soon after: the sets from before it began must then still be there.
    """
    pair, srf, newly_excluded = types.pair, types.surface[s], False
    stored = srf.first_sets
    for h in range(N_CONSTANT):
        newly_excluded = newly_excluded or srf.sets.excluded[h] != stored.excluded[h]
    pair.n_unstored = pair.n_unstored + 1 if newly_excluded else 0
    if pair.first_pitch != s or pair.n_unstored >= types.config.half_frames:
        pair.first_pitch, pair.n_unstored = s, 0
        stored.low = srf.sets.low
        stored.high = srf.sets.high
        stored.excluded[:] = 1
        copy(srf.sets.excluded[:N_CONSTANT], stored.excluded[:N_CONSTANT])


@kernel
def has_second(types):
    """Whether a second pitch fault has begun."""
    s1 = types.pair.first_pitch
    return s1 != NO_SURFACE and not types.surface[s1].status.may_be_sole


@kernel
def begin_second_if_shown(types, layout):
    """Begin the diagnosis of a second pitch fault once no constant type on the first surface explains the
    flight, if that surface has a partner: the first gets its stored sets back, and the partner starts with no
    knowledge."""
    s1 = types.pair.first_pitch
    if s1 == NO_SURFACE or layout.partner[s1] < 0 or has_second(types):
        return
    srf1, srf2 = types.surface[s1], types.surface[layout.partner[s1]]
    if can_be_faulty(srf1) and constant_remains(srf1):
        return
    srf1.sets.low = srf1.first_sets.low
    srf1.sets.high = srf1.first_sets.high
    srf1.sets.excluded = srf1.first_sets.excluded
    examination.restart_surface(srf2)
    for srf in (srf1, srf2):
        srf.status.may_be_sole, srf.status.basis = 0, verdict.DEDUCED_FAULTY
        forget_anomalies(srf)


@kernel
def dismiss_varying(c, srf):
    """Whether no varying type needs to be considered any more: a slow oscillation, a slow surface or a
    growing bias would have shown by now. No growing bias (not in FOLLOWS_COMMAND) can look like the constant
    type, no type is hidden, and the flight has been anomalous for half a cycle."""
    imitated = verdict.can_be_another(srf, verdict.sole_type(srf, CONSTANT), False)
    in_doubt = imitated or verdict.may_be_hidden(c, srf)
    long_enough = srf.evidence.n_anomalous >= c.half_frames
    return long_enough and verdict.would_have_shown(c, srf) and not in_doubt


@kernel
def update_second(types, layout, t):
    """Update which of the two surfaces of pitch are at fault, at t s, after a second fault has begun: the
    first (srf1) unless nothing on the second (srf2) explains what refuted it; the second once a type on it
    shows."""
    srf1 = types.surface[types.pair.first_pitch]
    srf2 = types.surface[layout.partner[types.pair.first_pitch]]
    anomalous = srf2.evidence.n_anomalous > 0
    possible = can_be_faulty(srf2) and verdict.any_remains(srf2, ALL)
    verdict.update_status(srf1, possible or not anomalous, srf1.status.fault_type, t)
    shows = anomalous and possible and verdict.explains_flight(srf2)
    verdict.update_status(srf2, shows, verdict.type_on_surface(types.config, srf2), t)


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
            kind = verdict.type_on_surface(types.config, srf) if s == sole else verdict.TYPE_UNDECIDED
            # a jam may as well be a trailing surface or one at its stop, if the other is off by a constant
            open_yet = kind >= 0 and MODE[kind] == GIVE_UP
            verdict.update_status(srf, s == sole, verdict.TYPE_UNDECIDED if open_yet else kind, t)


@kernel
def sole_pitch(types, layout):
    """The surface of pitch at fault if a constant type explains everything on it, or NO_SURFACE; its sets are
    stored once varying types are dismissed."""
    s = verdict.find_surface(types, layout) if types.pair.group_alarm[PITCH_GROUP] else NO_SURFACE
    if s < 0 or not constant_remains(types.surface[s]):
        return NO_SURFACE
    if dismiss_varying(types.config, types.surface[s]):
        store_first(types, s)
    return s


@kernel
def decide_pairs(types, past, layout, t):
    """Isolate surfaces and types plane by plane, at t s. Returns the finding on the surface that was isolated
    first, for `conclusion.record_decision`; if there is none, that of UNANTICIPATED or NOT_ISOLATED."""
    outside = isolate_lateral(types, layout, t)
    isolate_pitch(types, layout, t)
    first, earliest_s = NO_SURFACE, np.inf
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated and srf.status.isolated_at_s < earliest_s:
            first, earliest_s = s, srf.status.isolated_at_s
    if first == NO_SURFACE and outside:
        first = UNANTICIPATED
    return verdict.finding_on_surface(types, past, layout, first, t)
