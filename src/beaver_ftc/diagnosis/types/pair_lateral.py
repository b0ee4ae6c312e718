"""Two faults in the plane of roll and yaw: two unknown deflections in two equations.

In every frame the deflections of ailerons and rudder follow from the equations, within the declared errors,
whichever surface is at fault. A surface is judged in the frames in which it was certainly off its command.
One surface is named if the other alone cannot explain the flight. Both are named if neither can, and a type
remains on each.

    types     record of `fault_types_dtype`
    layout    gives the surfaces that lead roll and yaw (main)
    s, srf    surface, and its record (records.py)
    est       estimators of the isolation; eff: effect of the fault of one of them
    nu        (3,) rad/s2: innovation; nu_max: its bound without a fault
    lo, hi    interval of a deflection, rad
"""

from beaver_ftc.aircraft import ROLL, YAW
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.isolation import LATERAL_GROUP
from beaver_ftc.diagnosis.types.observations import observe_error
from beaver_ftc.diagnosis.types.registry import ALL
from beaver_ftc.diagnosis.types.remaining import any_remains, explains_flight, type_on_surface
from beaver_ftc.diagnosis.types.verdict import can_be_faulty, update_status


@kernel
def locate_lateral(types, layout, est, nu, nu_max):
    """Find where ailerons and rudder were in the elapsed frame; set `lateral_outside` for good if one was
    nowhere within its reach."""
    a = layout.main[ROLL]
    r = layout.main[YAW]
    for s, s_other in ((a, r), (r, a)):
        eff = est[layout.position[s]].effect
        eff_other = est[layout.position[s_other]].effect
        if not locate_one(types.surface[s], eff, eff_other, nu, nu_max):
            types.pair.lateral_outside = 1


@kernel
def locate_one(srf, eff, eff_other, nu, nu_max):
    """Find where one of ailerons and rudder was in the elapsed frame: nu = G (p - u) + eta, two equations,
    solved for this surface by Cramer's rule. False if it was nowhere within its reach.

        p - u = (nu_L N - nu_N L) / det +- (e_L |N| + e_N |L|) / |det|,    det = L1 N - N1 L

    nu_L, nu_N         rad/s2            innovation in roll and yaw
    L1, N1; L, N       rad/s2 per rad    effect in roll and yaw: of this surface, eff; of the other, eff_other
    e_L, e_N           rad/s2            nu_max of the axis, and the tolerances r of both effects
    """
    L1 = eff.Z[ROLL]
    N1 = eff.Z[YAW]
    L = eff_other.Z[ROLL]
    N = eff_other.Z[YAW]
    det = L1 * N - N1 * L
    e_L = nu_max[ROLL] + eff.r[ROLL] + eff_other.r[ROLL]
    e_N = nu_max[YAW] + eff.r[YAW] + eff_other.r[YAW]
    return observe_error(srf, (nu[ROLL] * N - nu[YAW] * L) / det, (e_L * abs(N) + e_N * abs(L)) / abs(det))


@kernel
def isolate_lateral(types, layout, t):
    """Set the isolation of the surfaces of roll and yaw, at t s; returns whether the fault of this plane is
    outside the class: neither can be the only faulty one (`both`), and both together are refuted.

        isolated    a surface, if the other alone cannot be faulty
        none        before the plane's alarm; and if neither alone can be faulty, but both together are
                    refuted (by deflections out of reach, or since all types of one are excluded), or one of
                    them has no type left that has shown itself or need not (`explains_flight`)
    """
    roller = types.surface[layout.main[ROLL]]
    yawer = types.surface[layout.main[YAW]]
    both = not can_be_faulty(roller) and not can_be_faulty(yawer)
    refuted = types.pair.lateral_outside == 1
    explained = True
    for srf in (roller, yawer):
        refuted = refuted or not any_remains(srf, ALL)
        explained = explained and explains_flight(srf)
    isolates = types.pair.group_alarm[LATERAL_GROUP] == 1 and not (both and (refuted or not explained))
    for srf, other in ((roller, yawer), (yawer, roller)):
        at_fault = isolates and not can_be_faulty(other)
        update_status(srf, at_fault, type_on_surface(types.config, srf), t)
    return both and refuted
