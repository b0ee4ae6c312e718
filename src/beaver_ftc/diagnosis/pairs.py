"""Two faults on different surfaces (`fdi.pairs`), at the same time or one after the other.

Elevator and flap move pitch alone, ailerons and rudder roll and yaw alone: each plane has its own verdict.

*Roll and yaw*: two unknown deflections in two equations. Where both surfaces were follows exactly in every
frame, whoever is at fault, and a surface is judged in those frames in which it was certainly off. One is
named when the other alone cannot explain the flight; both are when neither can and each has a type left.

*Pitch*: two unknowns in one equation. A constant that explains everything on one surface is taken for one
fault. Once that was named, with its constant, a second fault that refutes it is found on the other surface,
whose deflection follows from what is known of the first, taken to last. Anything else stays open.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.model import AILERON, ELEVATOR, FLAP, RUDDER
from beaver_ftc.diagnosis import fault_types as ft
from beaver_ftc.diagnosis import release
from beaver_ftc.diagnosis.state import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FLOAT,
    NOT_ISOLATED,
    OSCILLATORY,
    STUCK,
    UNANTICIPATED,
    UP,
    VARYING_LOSS,
)

IN_PITCH, IN_ROLL_AND_YAW = 0, 1
ROLL, YAW = 0, 2
NOBODY = -1


@kernel
def note_alarms(fdi):
    """In which plane a filter of the bank has left its bound."""
    for i in range(3):
        plane = IN_PITCH if i == ft.PITCH else IN_ROLL_AND_YAW
        for m in range(fdi.n_poles):
            if abs(fdi.bank_residual[m, i]) > fdi.bank_threshold[m, i]:
                fdi.alarmed[plane] = 1


@kernel
def place(surface, middle, slack):
    """A surface was off its command by middle +- slack (rad). False: nowhere in its travel."""
    surface.low = max(surface.travel_low, surface.command + middle - slack)
    surface.high = min(surface.travel_high, surface.command + middle + slack)
    surface.wrong = abs(middle) > slack
    return surface.low <= surface.high


@kernel
def solve_roll_and_yaw(fdi):
    """Where ailerons and rudder were in the elapsed frame: nu = G (p - u) + eta solved for p."""
    aileron = fdi.estimator[ft.POSITION_FIRST + AILERON]
    rudder = fdi.estimator[ft.POSITION_FIRST + RUDDER]
    a_p, a_r, r_p, r_r = aileron.Z[ROLL], aileron.Z[YAW], rudder.Z[ROLL], rudder.Z[YAW]
    p, r = fdi.innovation[ROLL], fdi.innovation[YAW]
    slack_p = fdi.frame_bound[ROLL] + aileron.spread[ROLL] + rudder.spread[ROLL]
    slack_r = fdi.frame_bound[YAW] + aileron.spread[YAW] + rudder.spread[YAW]
    determinant = a_p * r_r - a_r * r_p
    size = abs(determinant)
    off, slack = (p * r_r - r * r_p) / determinant, (slack_p * abs(r_r) + slack_r * abs(r_p)) / size
    fits = place(fdi.surface[AILERON], off, slack)
    off, slack = (r * a_p - p * a_r) / determinant, (slack_r * abs(a_p) + slack_p * abs(a_r)) / size
    if not (place(fdi.surface[RUDDER], off, slack) and fits):
        fdi.no_lateral_pair = 1


@kernel
def held_by(fdi, surface, kind):
    """Least and greatest deflection (rad) of a surface under a type with the constant in its set."""
    low, high, u = surface.set_low[kind], surface.set_high[kind], surface.command
    if kind == CONSTANT_LOSS:
        return min(low * u, high * u), max(low * u, high * u)
    if kind == STUCK:
        return low, high
    if kind == FLOAT:
        return 0.0, 0.0
    if kind == BIAS:
        return u + low, u + high
    least, greatest = release.run_at_least(fdi, surface, fdi.frame)
    return (least, surface.travel_high) if kind == UP else (surface.travel_low, greatest)


@kernel
def whereabouts(fdi, surface):
    """The same over all types of a constant that are left."""
    least, greatest = np.inf, -np.inf
    for kind in range(ft.N_CONSTANT):
        if not surface.type_excluded[kind]:
            low, high = held_by(fdi, surface, kind)
            least, greatest = min(least, low), max(greatest, high)
    low, high = surface.travel_low, surface.travel_high
    return min(max(least, low), high), min(max(greatest, low), high)


@kernel
def solve_pitch(fdi):
    """Where the surface beside the first fault was in the elapsed frame, and whether pitch shows a fault."""
    if fdi.first == NOBODY or fdi.surface[fdi.first].in_question:
        for s in (ELEVATOR, FLAP):
            fdi.surface[s].wrong = abs(fdi.innovation[ft.PITCH]) > fdi.frame_bound[ft.PITCH]
        return
    first, second = fdi.first, ELEVATOR + FLAP - fdi.first
    known, other = fdi.estimator[ft.POSITION_FIRST + first], fdi.estimator[ft.POSITION_FIRST + second]
    surface = fdi.surface[first]
    surface.low, surface.high = whereabouts(fdi, surface)
    surface.wrong = 0
    Z, Z_known = other.Z[ft.PITCH], known.Z[ft.PITCH]
    explained = Z_known * (0.5 * (surface.low + surface.high) - surface.command)
    slack = abs(Z_known) * 0.5 * (surface.high - surface.low)
    slack += fdi.frame_bound[ft.PITCH] + known.spread[ft.PITCH] + other.spread[ft.PITCH]
    if not place(fdi.surface[second], (fdi.innovation[ft.PITCH] - explained) / Z, slack / abs(Z)):
        fdi.surface[second].standing = ft.RULED_OUT


@kernel
def examine(fdi):
    """Take in the elapsed frame, plane by plane, and judge the one before."""
    note_alarms(fdi)
    ft.take_in(fdi)
    solve_roll_and_yaw(fdi)
    solve_pitch(fdi)
    ft.judge_all(fdi)


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
    """Who is at fault there, if anybody. Returns whether the plane's fault is outside the class."""
    aileron, rudder = fdi.surface[AILERON], fdi.surface[RUDDER]
    left = ft.possible(fdi, AILERON), ft.possible(fdi, RUDDER)
    both = not left[0] and not left[1]
    outside = both and (fdi.no_lateral_pair == 1 or no_type(aileron) or no_type(rudder))
    open_yet = both and (only_a_swing(aileron) or only_a_swing(rudder))
    for s, other in ((AILERON, left[1]), (RUDDER, left[0])):
        named = fdi.alarmed[IN_ROLL_AND_YAW] == 1 and not (other or outside or open_yet)
        name(fdi.surface[s], named, type_of(fdi, s), t)
    return outside


@kernel
def no_type(surface):
    """Whether every type is excluded on a surface."""
    left = False
    for kind in range(len(ft.TYPES)):
        left = left or not surface.type_excluded[kind]
    return not left


@kernel
def only_a_swing(surface):
    """Whether nothing but an oscillation is left, and it has not swung for long enough."""
    left = False
    for kind in range(len(ft.TYPES)):
        left = left or (kind != OSCILLATORY and not surface.type_excluded[kind])
    return not left and not ft.swings_by(surface)


@kernel
def type_of(fdi, s):
    """The type of the fault on surface s, taken to be at fault, or -1 while that is open."""
    surface = fdi.surface[s]
    standing = surface.standing
    surface.standing = ft.BY_DEDUCTION
    kind = ft.type_at_fault(fdi, s)
    surface.standing = standing
    return kind


@kernel
def note_first(fdi, s):
    """Keep what is known of the one pitch fault, and again when fewer types have been left for a while.

    What refutes a type may be a second fault that begins to show, and is about to refute all of them.
    """
    surface, changed = fdi.surface[s], False
    for kind in range(ft.N_CONSTANT):
        changed = changed or surface.type_excluded[kind] != surface.known_not[kind]
    fdi.unsettled = fdi.unsettled + 1 if changed else 0
    if fdi.first != s or fdi.unsettled >= fdi.patience:
        fdi.first, fdi.unsettled = s, 0
        surface.known_low[:], surface.known_high[:] = surface.set_low, surface.set_high
        surface.known_not[:] = 1
        surface.known_not[: ft.N_CONSTANT] = surface.type_excluded[: ft.N_CONSTANT]


@kernel
def begin_second(fdi):
    """The one known pitch fault no longer explains the flight: there is another beside it."""
    first, second = fdi.surface[fdi.first], fdi.surface[ELEVATOR + FLAP - fdi.first]
    first.set_low[:], first.set_high[:] = first.known_low, first.known_high
    first.type_excluded[:] = first.known_not
    ft.begin(second)
    for surface in (first, second):
        surface.in_question, surface.standing = 0, ft.BY_DEDUCTION
        surface.wrong = surface.wrong_then = surface.wrong_before = 0


@kernel
def patient(fdi, s):
    """Whether a slow oscillation of surface s, a slow surface or a growing bias would have shown by now."""
    waits = 2 if ft.alive(fdi, s, OSCILLATORY) else 1
    growing = ft.may_be_growing(fdi, s, ft.one_type(fdi, s))
    return fdi.surface[s].evidence >= waits * fdi.patience and not growing and not ft.may_be_slow(fdi, s)


@kernel
def two_in_pitch(fdi):
    """Whether a second pitch fault has shown beside one that was known."""
    if fdi.first == NOBODY:
        return False
    if fdi.surface[fdi.first].in_question and not ft.any_constant(fdi, fdi.first):
        begin_second(fdi)
    return not fdi.surface[fdi.first].in_question


@kernel
def type_in_pitch(fdi, s):
    """The type of the one fault of pitch, or -1 while it is open.

    A jam may as well be a trailing surface or one at its stop, if the other surface is off by a constant.
    """
    kind = ft.type_at_fault(fdi, s)
    return -1 if kind in (STUCK, UP, DOWN) else kind


@kernel
def decide_pitch(fdi, t):
    """Who is at fault there, if anybody."""
    if two_in_pitch(fdi):
        first, second = fdi.first, ELEVATOR + FLAP - fdi.first
        shows = fdi.surface[second].evidence > 0 and ft.explained(fdi, second)
        name(fdi.surface[first], 1, fdi.surface[first].type, t)
        name(fdi.surface[second], shows, ft.type_at_fault(fdi, second), t)
        return
    s = ft.surface_at_fault(fdi) if fdi.alarmed[IN_PITCH] else NOBODY
    s = s if s >= 0 and ft.any_constant(fdi, s) else NOBODY
    if s >= 0 and patient(fdi, s):
        note_first(fdi, s)
    for member in (ELEVATOR, FLAP):
        name(fdi.surface[member], member == s, type_in_pitch(fdi, s) if member == s else -1, t)


@kernel
def decide(fdi, t):
    """Name surfaces and types plane by plane; t s. `isolated` is the one named first, the law acts on all."""
    outside = decide_roll_and_yaw(fdi, t)
    decide_pitch(fdi, t)
    earliest = NOBODY
    for s in range(4):
        surface = fdi.surface[s]
        if surface.named and (earliest < 0 or surface.named_at_s < fdi.surface[earliest].named_at_s):
            earliest = s
    summarise(fdi, earliest, outside, t)
    act(fdi)


@kernel
def summarise(fdi, s, outside, t):
    """The verdict on surface s, the first named, as that of a single fault."""
    before = fdi.isolated
    if s < 0:
        fdi.isolated, fdi.type = UNANTICIPATED if outside else NOT_ISOLATED, -1
    else:
        surface = fdi.surface[s]
        loses = surface.type in (CONSTANT_LOSS, VARYING_LOSS)
        fdi.isolated = s if loses else ft.POSITION_FIRST + s
        fdi.type, fdi.type_at_s = surface.type, surface.type_at_s
        fdi.isolated_at_s = surface.named_at_s
    if s < 0 and fdi.isolated != before:
        fdi.isolated_at_s = t


@kernel
def acted_upon(fdi, s):
    """Whether the law acts on surface s: it is named, or the likeliest in pitch."""
    if fdi.surface[s].named:
        return True
    in_pitch = s in (ELEVATOR, FLAP)
    pitch_open = not fdi.surface[ELEVATOR].named and not fdi.surface[FLAP].named
    if not (in_pitch and pitch_open and fdi.alarmed[IN_PITCH]):
        return False
    likeliest = ft.sole(fdi, True)
    return s == (likeliest if likeliest >= 0 else ELEVATOR)


@kernel
def act(fdi):
    """What the law does about each surface. The supervisor heeds the lead: a replaced elevator first."""
    fdi.lead, fdi.lead_kind = NOBODY, -1
    for s in range(4):
        surface = fdi.surface[s]
        surface.measure = -1
        if acted_upon(fdi, s):
            standing = surface.standing
            surface.standing = ft.BY_DEDUCTION if surface.named else standing
            measure = ft.measure_for(fdi, s)
            if ft.still_there(fdi, s, measure):
                surface.measure = measure
                replaced = s == ELEVATOR and measure in (ft.LOSES, ft.FIXED)
                if fdi.lead == NOBODY or replaced:
                    fdi.lead, fdi.lead_kind = s, measure
            surface.standing = standing
