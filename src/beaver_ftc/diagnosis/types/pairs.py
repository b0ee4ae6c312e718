"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. Where both surfaces were follows exactly in every
frame, whichever is at fault, and a surface is judged in those frames in which it was certainly off. One is
named when the other alone cannot explain the flight; both are when neither can and each has a type left.

*Pitch*: two unknowns in one equation. A constant that explains everything on one surface is taken for one
fault. Once that was named, with its constant, a second fault that refutes it is found on the other surface,
whose deflection follows from what is known of the first, taken to last. If nothing on the other surface
explains that either, the name of the first is withdrawn. Anything else stays open.

A surface's group and the other surface in it are looked up in the layout. types: of `fault_types_dtype`;
past: of `conclusion_dtype`, of the frame before; bank: the detection filters. Other symbols:
types/__init__.py.
"""

import numpy as np

from beaver_ftc.compiled import kernel
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
    """Latch for each group of surfaces whether a residual of the bank has exceeded its threshold."""
    for i in range(3):
        if leaves_bound(bank, i):
            pair.group_alarm[PITCH_GROUP if i == PITCH else LATERAL_GROUP] = 1


@kernel
def locate_one(srf, own, other, nu, nu_max):
    """Find where one of ailerons and rudder was in the elapsed frame: nu = G (p - u) + eta solved for p, with

    p - u = (nu_L N - nu_N L) / (L1 N - N1 L),    |eta| <= nu_max + e

    L, N: roll and yaw acceleration, rad/s2; L1, N1 per rad of this surface (own), L, N of the other. False:
    nowhere within its reach.
    """
    L, N = other.Z[ROLL], other.Z[YAW]
    det = own.Z[ROLL] * N - own.Z[YAW] * L
    e_L = nu_max[ROLL] + own.r[ROLL] + other.r[ROLL]
    e_N = nu_max[YAW] + own.r[YAW] + other.r[YAW]
    return observe_error(srf, (nu[ROLL] * N - nu[YAW] * L) / det, (e_L * abs(N) + e_N * abs(L)) / abs(det))


@kernel
def locate_lateral(types, layout, est, nu, nu_max):
    """Find where ailerons and rudder were in the elapsed frame, two deflections in two equations."""
    a, r = layout.main[ROLL], layout.main[YAW]
    for s, other in ((a, r), (r, a)):
        own, effect = est[layout.position[s]].effect, est[layout.position[other]].effect
        if not locate_one(types.surface[s], own, effect, nu, nu_max):
            types.pair.lateral_outside = 1


@kernel
def constant_range(c, srf, k):
    """Least and greatest deflection of a surface by frame k over the types of a constant left, rad."""
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
    """Find the position of the second surface, given the sets of the first: p - u = (nu - M1 (p1 - u1)) /
    M2.

    M1, M2: pitch acceleration by the first and by the second surface, rad/s2 per rad.
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
    """Observe the elapsed frame, plane by plane, and judge the one before."""
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
    roll, yaw = types.surface[layout.main[ROLL]], types.surface[layout.main[YAW]]
    both = not can_be_faulty(roll) and not can_be_faulty(yaw)
    refuted, explained = types.pair.lateral_outside == 1, True
    for srf in (roll, yaw):
        refuted = refuted or not verdict.any_remains(srf, ALL)
        explained = explained and verdict.explains_flight(srf)
    isolates = types.pair.group_alarm[LATERAL_GROUP] == 1 and not (both and (refuted or not explained))
    for srf, other in ((roll, yaw), (yaw, roll)):
        at_fault = isolates and not can_be_faulty(other)
        verdict.update_status(srf, at_fault, verdict.type_on_surface(types.config, srf), t)
    return both and refuted


@kernel
def store_first(types, s):
    """Store the sets of the first pitch fault; store them again once fewer types have been left for
    `half_frames`.

    What refutes a type may be a second fault that begins to show, and is about to refute all of them.
    """
    pair, srf, new = types.pair, types.surface[s], False
    kept = srf.first_sets
    for h in range(N_CONSTANT):
        new = new or srf.sets.excluded[h] != kept.excluded[h]
    pair.n_unstored = pair.n_unstored + 1 if new else 0
    if pair.first_pitch != s or pair.n_unstored >= types.config.half_frames:
        pair.first_pitch, pair.n_unstored = s, 0
        kept.low[:], kept.high[:] = srf.sets.low, srf.sets.high
        kept.excluded[:] = 1
        kept.excluded[:N_CONSTANT] = srf.sets.excluded[:N_CONSTANT]


@kernel
def has_second(types):
    """Whether a second pitch fault has begun."""
    s1 = types.pair.first_pitch
    return s1 != NO_SURFACE and not types.surface[s1].status.may_be_sole


@kernel
def begin_second_if_shown(types, layout):
    """Begin the diagnosis of a second pitch fault when the one known fault no longer explains the flight."""
    s1 = types.pair.first_pitch
    if s1 == NO_SURFACE or layout.partner[s1] < 0 or has_second(types):
        return
    srf1, srf2 = types.surface[s1], types.surface[layout.partner[s1]]
    if can_be_faulty(srf1) and constant_remains(srf1):
        return
    srf1.sets.low[:] = srf1.first_sets.low
    srf1.sets.high[:] = srf1.first_sets.high
    srf1.sets.excluded[:] = srf1.first_sets.excluded
    examination.restart_surface(srf2)
    for srf in (srf1, srf2):
        srf.status.may_be_sole, srf.status.basis = 0, verdict.DEDUCED_FAULTY
        forget_anomalies(srf)


@kernel
def dismiss_varying(c, srf):
    """Whether a slow oscillation, a slow surface or a growing bias would have shown by now: the constant
    that is left looks like none of them, none is hidden, and the flight has been anomalous for half a
    cycle."""
    imitated = verdict.can_be_another(srf, verdict.sole_type(srf, CONSTANT), False)
    doubt = imitated or verdict.may_be_hidden(c, srf)
    long_enough = srf.evidence.n_anomalous >= c.half_frames
    return long_enough and verdict.would_have_shown(c, srf) and not doubt


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
    """Which surface of pitch is at fault, if any."""
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
    """The surface of pitch at fault if a constant explains everything on it, or NO_SURFACE."""
    s = verdict.find_surface(types, layout) if types.pair.group_alarm[PITCH_GROUP] else NO_SURFACE
    if s < 0 or not constant_remains(types.surface[s]):
        return NO_SURFACE
    if dismiss_varying(types.config, types.surface[s]):
        store_first(types, s)
    return s


@kernel
def decide_pairs(types, past, layout, t):
    """Name surfaces and types plane by plane; t s. Returns the finding on the one named first, for
    `conclusion.record_decision`.
    """
    outside = isolate_lateral(types, layout, t)
    isolate_pitch(types, layout, t)
    first, earliest_s = NO_SURFACE, np.inf
    for s, srf in enumerate(types.surface):
        if srf.status.is_isolated and srf.status.isolated_at_s < earliest_s:
            first, earliest_s = s, srf.status.isolated_at_s
    if first == NO_SURFACE and outside:
        first = UNANTICIPATED
    return verdict.finding_on_surface(types, past, layout, first, t)
