"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. Where both surfaces were follows exactly in every
frame, whichever is at fault, and a surface is judged in those frames in which it was certainly off. One is
named when the other alone cannot explain the flight; both are when neither can and each has a type left.

*Pitch*: two unknowns in one equation. A constant that explains everything on one surface is taken for one
fault. Once that was named, with its constant, a second fault that refutes it is found on the other surface,
whose deflection follows from what is known of the first, taken to last. Anything else stays open.

A surface's group and the other surface in it are looked up: `fdi.group`, `fdi.partner`.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, ROLL, UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types.candidates import (
    BY_DEDUCTION,
    NO_SURFACE,
    RULED_OUT,
    any_constant,
    anything_left,
    explained,
    left,
    may_be_growing,
    may_be_slow,
    one_type,
    only_a_swing,
    possible,
    sole,
    would_have_swung,
)
from beaver_ftc.diagnosis.types.examine import (
    FIXED,
    LOSES,
    SHIFTED,
    begin,
    judge_all,
    note_stops,
    take_in_frame,
)
from beaver_ftc.diagnosis.types.registry import DOWN, N_CONSTANT, STUCK, UP, deflection
from beaver_ftc.diagnosis.types.verdict import (
    estimator_for,
    measure_for,
    still_there,
    surface_at_fault,
    type_at_fault,
)

IN_PITCH, IN_ROLL_AND_YAW = 0, 1


@kernel
def note_alarms(fdi):
    """In which plane a filter of the bank has left its bound."""
    for i in range(3):
        plane = IN_PITCH if i == PITCH else IN_ROLL_AND_YAW
        for m in range(fdi.bank.n):
            if abs(fdi.bank.residual[m, i]) > fdi.bank.threshold[m, i]:
                fdi.types.pair.alarmed[plane] = 1


@kernel
def effect_of(fdi, s):
    """What the position estimator of surface s supposes of the elapsed frame."""
    return fdi.isolation.estimator[fdi.layout.position_of[s]].effect


@kernel
def place(surface, middle, slack):
    """A surface was off its command by middle +- slack (rad). False: nowhere within its reach."""
    surface.low = max(surface.reach_low, surface.command + middle - slack)
    surface.high = min(surface.reach_high, surface.command + middle + slack)
    surface.wrong = abs(middle) > slack
    note_stops(surface, 2.0 * slack)
    return surface.low <= surface.high


@kernel
def solve_roll_and_yaw(fdi):
    """Where ailerons and rudder were in the elapsed frame: nu = G (p - u) + eta solved for p."""
    one, other = effect_of(fdi, fdi.layout.main[ROLL]), effect_of(fdi, fdi.layout.main[YAW])
    a_p, a_r, r_p, r_r = one.Z[ROLL], one.Z[YAW], other.Z[ROLL], other.Z[YAW]
    p, r = fdi.bank.innovation[ROLL], fdi.bank.innovation[YAW]
    slack_p = fdi.bound.frame[ROLL] + one.spread[ROLL] + other.spread[ROLL]
    slack_r = fdi.bound.frame[YAW] + one.spread[YAW] + other.spread[YAW]
    determinant = a_p * r_r - a_r * r_p
    size = abs(determinant)
    off, slack = (p * r_r - r * r_p) / determinant, (slack_p * abs(r_r) + slack_r * abs(r_p)) / size
    fits = place(fdi.types.surface[fdi.layout.main[ROLL]], off, slack)
    off, slack = (r * a_p - p * a_r) / determinant, (slack_r * abs(a_p) + slack_p * abs(a_r)) / size
    if not (place(fdi.types.surface[fdi.layout.main[YAW]], off, slack) and fits):
        fdi.types.pair.no_lateral_pair = 1


@kernel
def whereabouts(fdi, surface):
    """Least and greatest deflection (rad) of a surface over all types of a constant that are left."""
    least, greatest = np.inf, -np.inf
    for kind in range(N_CONSTANT):
        if left(surface, kind):
            low, high = deflection(fdi, surface, kind)
            least, greatest = min(least, low), max(greatest, high)
    low, high = surface.reach_low, surface.reach_high
    return min(max(least, low), high), min(max(greatest, low), high)


@kernel
def first_is_settled(fdi):
    """Whether one pitch fault was named and a second has begun beside it."""
    return fdi.types.pair.first != NO_SURFACE and not fdi.types.surface[fdi.types.pair.first].in_question


@kernel
def solve_pitch(fdi):
    """Where the surface beside the first fault was in the elapsed frame, and whether pitch shows a fault."""
    if first_is_settled(fdi):
        solve_beside_the_first(fdi)
        return
    for s in range(fdi.types.surface.size):
        if fdi.layout.group[s] == IN_PITCH:
            fdi.types.surface[s].wrong = abs(fdi.bank.innovation[PITCH]) > fdi.bound.frame[PITCH]


@kernel
def solve_beside_the_first(fdi):
    """Where the second surface was, given what is known of the first."""
    first, second = fdi.types.pair.first, fdi.layout.partner[fdi.types.pair.first]
    known, other = effect_of(fdi, first), effect_of(fdi, second)
    surface = fdi.types.surface[first]
    surface.low, surface.high = whereabouts(fdi, surface)
    surface.wrong = 0
    Z, Z_known = other.Z[PITCH], known.Z[PITCH]
    share = Z_known * (0.5 * (surface.low + surface.high) - surface.command)
    slack = abs(Z_known) * 0.5 * (surface.high - surface.low)
    slack += fdi.bound.frame[PITCH] + known.spread[PITCH] + other.spread[PITCH]
    if not place(fdi.types.surface[second], (fdi.bank.innovation[PITCH] - share) / Z, slack / abs(Z)):
        fdi.types.surface[second].standing = RULED_OUT


@kernel
def examine(fdi):
    """Take in the elapsed frame, plane by plane, and judge the one before."""
    note_alarms(fdi)
    take_in_frame(fdi)
    solve_roll_and_yaw(fdi)
    solve_pitch(fdi)
    judge_all(fdi)


@kernel
def name(surface, named, kind, t):
    """Name a surface and the type of its fault (-1 if open), or take the name back; t s."""
    kind = kind if named else -1
    if named and not surface.named:
        surface.named_at_s = t
    if kind != surface.type:
        surface.type_at_s = t
    surface.named, surface.type = named, kind


@kernel
def decide_roll_and_yaw(fdi, t):
    """Which of the two is at fault, if any. Returns whether the plane's fault is outside the class."""
    a, r = fdi.layout.main[ROLL], fdi.layout.main[YAW]
    one, other = fdi.types.surface[a], fdi.types.surface[r]
    one_left, other_left = possible(fdi, a), possible(fdi, r)
    both = not one_left and not other_left
    no_pair = fdi.types.pair.no_lateral_pair == 1 or not anything_left(one) or not anything_left(other)
    outside = both and no_pair
    open_yet = both and (only_a_swing(one) or only_a_swing(other))
    certain = fdi.types.pair.alarmed[IN_ROLL_AND_YAW] == 1 and not (outside or open_yet)
    name(one, certain and not other_left, type_at_fault(fdi, one), t)
    name(other, certain and not one_left, type_at_fault(fdi, other), t)
    return outside


@kernel
def note_first(fdi, s):
    """Keep what is known of the one pitch fault, and again when fewer types have been left for a while.

    What refutes a type may be a second fault that begins to show, and is about to refute all of them.
    """
    surface, known, changed = fdi.types.surface[s], fdi.types.surface[s].known, False
    for kind in range(N_CONSTANT):
        changed = changed or surface.type_excluded[kind] != known.excluded[kind]
    fdi.types.pair.unsettled = fdi.types.pair.unsettled + 1 if changed else 0
    if fdi.types.pair.first != s or fdi.types.pair.unsettled >= fdi.types.config.patience:
        fdi.types.pair.first, fdi.types.pair.unsettled = s, 0
        known.low[:], known.high[:] = surface.set_low, surface.set_high
        known.excluded[:] = 1
        known.excluded[:N_CONSTANT] = surface.type_excluded[:N_CONSTANT]


@kernel
def begin_second(fdi):
    """The one known pitch fault no longer explains the flight: there is another beside it."""
    first, second = (
        fdi.types.surface[fdi.types.pair.first],
        fdi.types.surface[fdi.layout.partner[fdi.types.pair.first]],
    )
    first.set_low[:], first.set_high[:] = first.known.low, first.known.high
    first.type_excluded[:] = first.known.excluded
    begin(second)
    for surface in (first, second):
        surface.in_question, surface.standing = 0, BY_DEDUCTION
        surface.wrong = surface.wrong_then = surface.wrong_before = 0


@kernel
def patient(fdi, surface):
    """Whether a slow oscillation, a slow surface or a growing bias would have shown by now."""
    growing = may_be_growing(surface, one_type(surface)) or may_be_slow(fdi, surface)
    return surface.evidence >= fdi.types.config.patience and would_have_swung(fdi, surface) and not growing


@kernel
def two_in_pitch(fdi):
    """Whether a second pitch fault has shown beside one that was known."""
    if fdi.types.pair.first == NO_SURFACE or fdi.layout.partner[fdi.types.pair.first] < 0:
        return False
    surface = fdi.types.surface[fdi.types.pair.first]
    if surface.in_question and not (possible(fdi, fdi.types.pair.first) and any_constant(surface)):
        begin_second(fdi)
    return not surface.in_question


@kernel
def type_in_pitch(fdi, surface):
    """The type of the one fault of pitch, or -1 while it is open.

    A jam may as well be a trailing surface or one at its stop, if the other surface is off by a constant.
    """
    kind = type_at_fault(fdi, surface)
    return -1 if kind in (STUCK, UP, DOWN) else kind


@kernel
def decide_pitch(fdi, t):
    """Which surface of pitch is at fault, if any."""
    if two_in_pitch(fdi):
        first, s = fdi.types.surface[fdi.types.pair.first], fdi.layout.partner[fdi.types.pair.first]
        second = fdi.types.surface[s]
        name(first, 1, first.type, t)
        shows = second.evidence > 0 and possible(fdi, s) and explained(second)
        name(second, shows, type_at_fault(fdi, second), t)
        return
    s = one_in_pitch(fdi)
    for member in range(fdi.types.surface.size):
        if fdi.layout.group[member] == IN_PITCH:
            surface = fdi.types.surface[member]
            name(surface, member == s, type_in_pitch(fdi, surface) if member == s else -1, t)


@kernel
def one_in_pitch(fdi):
    """The surface of pitch at fault if a constant explains everything on it, or NO_SURFACE."""
    s = surface_at_fault(fdi) if fdi.types.pair.alarmed[IN_PITCH] else NO_SURFACE
    if s < 0 or not any_constant(fdi.types.surface[s]):
        return NO_SURFACE
    if patient(fdi, fdi.types.surface[s]):
        note_first(fdi, s)
    return s


@kernel
def decide(fdi, t):
    """Name surfaces and types plane by plane; t s. `isolated` is the one named first, the law acts on all."""
    outside = decide_roll_and_yaw(fdi, t)
    decide_pitch(fdi, t)
    earliest = NO_SURFACE
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        if surface.named and (earliest < 0 or surface.named_at_s < fdi.types.surface[earliest].named_at_s):
            earliest = s
    summarise(fdi, earliest, outside, t)
    act(fdi)


@kernel
def summarise(fdi, s, outside, t):
    """The verdict on surface s, the first named, as that of a single fault."""
    before = fdi.verdict.isolated
    if s < 0:
        fdi.verdict.isolated, fdi.verdict.type = UNANTICIPATED if outside else NOT_ISOLATED, -1
    else:
        surface = fdi.types.surface[s]
        fdi.verdict.isolated = estimator_for(fdi, s, surface.type)
        fdi.verdict.type, fdi.verdict.type_at_s = surface.type, surface.type_at_s
        fdi.verdict.isolated_at_s = surface.named_at_s
    if s < 0 and fdi.verdict.isolated != before:
        fdi.verdict.isolated_at_s = t


@kernel
def named_in_pitch(fdi):
    """Whether a surface of pitch is named."""
    for s in range(fdi.types.surface.size):
        if fdi.layout.group[s] == IN_PITCH and fdi.types.surface[s].named:
            return True
    return False


@kernel
def acted_upon(fdi, s):
    """Whether the law acts on surface s: it is named, or the likeliest in pitch."""
    if fdi.types.surface[s].named:
        return True
    if fdi.layout.group[s] != IN_PITCH or named_in_pitch(fdi) or not fdi.types.pair.alarmed[IN_PITCH]:
        return False
    likeliest = sole(fdi, True)
    return s == (likeliest if likeliest >= 0 else fdi.layout.main[PITCH])


@kernel
def act(fdi):
    """What the law does about each surface. The supervisor follows the lead: a replaced elevator first."""
    fdi.verdict.lead, fdi.verdict.lead_kind = NO_SURFACE, -1
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        surface.measure = -1
        if acted_upon(fdi, s):
            at_fault = surface.named == 1 or possible(fdi, s)
            measure = measure_for(surface) if at_fault else SHIFTED
            if still_there(fdi, surface, measure, at_fault):
                surface.measure = measure
                replaced = s == fdi.layout.main[PITCH] and measure in (LOSES, FIXED)
                if fdi.verdict.lead == NO_SURFACE or replaced:
                    fdi.verdict.lead, fdi.verdict.lead_kind = s, measure
