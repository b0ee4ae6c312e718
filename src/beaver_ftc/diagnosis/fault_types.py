"""Which type of fault has befallen a surface: exact feasible sets, frame by frame.

The innovation nu = eta + G_s (p_s - u_s) and |eta| <= eta_bar put the surface's true deflection p_s of each
frame in an interval, its axes agreeing on one. A type is a statement about p_s that holds in every frame in
which something is wrong; the set of its one parameter is the intersection over those frames, and the type is
excluded when nothing is left. For a bound that holds instant by instant this is the exact feasible set: no
test can exclude a type sooner without excluding a true one some day.

    loss            p = (1 + theta) u      1 + theta in [0, 1], constant
    varying loss    the same               1 + theta anywhere in [0, 1] in every frame (incipient)
    stuck           p = c                  c in the travel
    float           p = 0
    hardover        p reaches its stop at no less than half its rate limit, and stays
    bias            p = u + b              b constant; cut off by the stops
    oscillatory     p - u swings about 0   no half-cycle longer than pi / slowest oscillation
    rate limit      p moves to u only      at any rate
    growing bias    p = u + b              b of one sign and never smaller (incipient)

A frame that admits eta alone tells nothing: so a fault may be intermittent. The promise: the type, constant
while it is there, is never excluded, and so never misnamed. What cannot be told apart stays a candidate.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import membership, release
from beaver_ftc.diagnosis.state import (
    BIAS,
    CONSTANT_LOSS,
    DOWN,
    FLOAT,
    GROWING_BIAS,
    N_TYPES,
    NOT_ISOLATED,
    OSCILLATORY,
    SLOW,
    STUCK,
    UNANTICIPATED,
    UP,
    VARYING_LOSS,
)

TYPES = (
    "loss_of_effectiveness", "stuck", "float", "hardover", "hardover", "bias",
    "loss_of_effectiveness", "oscillatory", "rate_limit", "bias",
)  # fmt: skip
N_CONSTANT = 6  # of these the parameter is constant: what they say of one frame, the next can refute
POSITION_FIRST = 4  # estimators 0 to 3 are losses of effectiveness, 4 to 7 positions, in surface order
DOMINANT_AXIS = (0, 1, 2, 1)  # what a surface is there for: aileron p, elevator and flap q, rudder r
PITCH = 1
ELEVATOR, FLAP = 1, 3
# What is done about it: scale the command, give the surface up, add an offset, or leave it to its pace.
LOSES, FIXED, SHIFTED, LAGS = range(4)
ABSENT_FRAMES = 20
FLIPS_OF_AN_OSCILLATION = 3
# What decides whether a surface can be at fault: its estimator, or what is known of the other (pairs.py).
BY_ESTIMATOR, BY_DEDUCTION, RULED_OUT = range(3)


@kernel
def start(fdi):
    """Nothing is known of any surface yet."""
    for s in range(4):
        begin(fdi.surface[s])


@kernel
def begin(surface):
    """Nothing is known of this surface yet."""
    surface.set_low[:], surface.set_high[:] = -np.inf, np.inf
    surface.low, surface.high = surface.travel_low, surface.travel_high
    surface.run_at = -2
    surface.set_low[STUCK], surface.set_high[STUCK] = surface.travel_low, surface.travel_high
    surface.set_low[CONSTANT_LOSS], surface.set_high[CONSTANT_LOSS] = 0.0, 1.0
    surface.started_at = -1
    surface.type_excluded[:] = 0
    surface.evidence = surface.quiet = surface.flips = surface.sign = 0
    surface.grown_up = surface.grown_down = 0.0
    release.start(surface)


@kernel
def note_orders(fdi, commanded):
    """What the surfaces have been told to do, commanded (4,) rad, since the elapsed frame began."""
    for s in range(4):
        surface = fdi.surface[s]
        if fdi.in_block == 0:
            for age in (2, 1):
                surface.orders[age, : fdi.block] = surface.orders[age - 1, : fdi.block]
                surface.order_low[age], surface.order_high[age] = (
                    surface.order_low[age - 1],
                    surface.order_high[age - 1],
                )
            surface.order_low[0], surface.order_high[0] = np.inf, -np.inf
        order = min(max(commanded[s], surface.travel_low), surface.travel_high)
        surface.orders[0, fdi.in_block] = order
        surface.order_low[0] = min(surface.order_low[0], order)
        surface.order_high[0] = max(surface.order_high[0], order)


@kernel
def locate(fdi, s):
    """The set of positions of surface s (rad) that agree with the elapsed frame on every axis."""
    fie, surface = fdi.estimator[POSITION_FIRST + s], fdi.surface[s]
    axis = DOMINANT_AXIS[s]
    surface.low_before, surface.high_before = surface.low_then, surface.high_then
    surface.low_then, surface.high_then, surface.command_then = surface.low, surface.high, surface.command
    surface.command = -fie.offset[axis] / fie.Z[axis]
    surface.low, surface.high = fie.low, fie.high
    for i in range(3):
        if fdi.block > 1 and i != axis and fie.Z[i] != 0.0:
            continue  # over a block the axes weigh what varies differently
        low, high = membership.agreeing(fdi, fie, i)
        surface.low, surface.high = max(surface.low, low), min(surface.high, high)


@kernel
def intersect(surface, kind, low, high):
    """Keep of a type's set what is also in [low, high]; exclude the type when nothing is left."""
    surface.set_low[kind] = max(surface.set_low[kind], low)
    surface.set_high[kind] = min(surface.set_high[kind], high)
    if surface.set_low[kind] > surface.set_high[kind]:
        surface.type_excluded[kind] = 1


@kernel
def judge_loss(fdi, surface, low, high, u):
    """Hold both kinds of loss against a position in [low, high] rad under the command u rad."""
    one, other = membership.solve(0.5 * (low + high), 0.5 * (high - low), u, 0.0, 1.0)
    swung = fdi.block > 1 and surface.least_command[1] < 0.0 < surface.greatest_command[1]
    if one > other and not swung:
        surface.type_excluded[VARYING_LOSS] = 1
    intersect(surface, CONSTANT_LOSS, one, other)


@kernel
def hold(fdi, surface, kind, least, greatest):
    """Whether a type can be holding the surface between least and greatest (rad) in the judged frame.

    If not, it may have let go, and the actuator be bringing the surface back; else the type is excluded.
    """
    returning = fdi.returns and release.possible(fdi, surface, kind)
    if least <= surface.high_then and greatest >= surface.low_then and not surface.released[kind]:
        return True
    if returning:
        surface.released[kind] = 1
    else:
        surface.type_excluded[kind] = 1
    return False


@kernel
def judge_held(fdi, surface):
    """A jam stays where it is; a runaway has by now come at least as far as its least rate takes it, or to
    the stop."""
    if hold(fdi, surface, STUCK, surface.set_low[STUCK], surface.set_high[STUCK]):
        intersect(surface, STUCK, surface.low_then, surface.high_then)
    hold(fdi, surface, FLOAT, 0.0, 0.0)
    least, greatest = release.run_at_least(fdi, surface, fdi.frame - 1)
    hold(fdi, surface, UP, least, surface.travel_high)
    hold(fdi, surface, DOWN, surface.travel_low, greatest)


@kernel
def clear_of_stops(fdi, surface, low, high, u):
    """Whether a surface off by a constant stayed off its lower and its upper stop throughout."""
    if fdi.block > 1:
        low, high = low - (u - surface.least_command[1]), high + (surface.greatest_command[1] - u)
    return low > surface.travel_low, high < surface.travel_high


@kernel
def judge_bias(fdi, surface, low, high, u):
    """At a stop a bias may be larger than it shows."""
    off_low, off_high = clear_of_stops(fdi, surface, low, high, u)
    least = low - u if off_low else -np.inf
    greatest = high - u if off_high else np.inf
    intersect(surface, BIAS, least, greatest)


@kernel
def judge_oscillation(fdi, surface, low, high, frame):
    """Count half-cycles; a sign that stays for longer than the slowest half-cycle is no oscillation.

    low, high rad: of the deflection error. Counting half-cycles above a level that noise cannot reach is how
    oscillatory failures are monitored in service [Goupil2010].
    """
    sign = 1 if low > 0.0 else (-1 if high < 0.0 else 0)
    if sign == 0:
        surface.steady_since = frame + 1
        return
    if sign != surface.sign:
        note_flip(surface, frame)
        surface.sign, surface.steady_since = sign, frame
    if frame - surface.steady_since > fdi.patience:
        surface.type_excluded[OSCILLATORY] = 1


@kernel
def note_flip(surface, frame):
    """A half-cycle ends here; the first one is cut off at its beginning and counts for nothing."""
    if surface.sign != 0:
        if surface.flips == 0:
            surface.first_flip = frame
        else:
            surface.squares += surface.square
        surface.last_flip = frame
        surface.flips += 1
        surface.square = 0.0


@kernel
def judge_pace(fdi, surface, low, high, frame):
    """A slow surface never moves away from its command, so while it stands on one side it comes nearer.

    Of several JSBSim frames in one of ours the first is the old command's.
    """
    newest = 2 if fdi.whole else 1
    lowest = min(surface.order_low[2], surface.order_low[newest])
    highest = max(surface.order_high[2], surface.order_high[newest])
    sign = 1 if low > highest else (-1 if high < lowest else 0)
    if sign == 0 or sign != surface.run_sign or frame != surface.run_at + 1:
        surface.run_low, surface.run_high = low, high
    elif (sign > 0 and low > surface.run_high) or (sign < 0 and high < surface.run_low):
        surface.type_excluded[SLOW] = 1
    surface.run_low, surface.run_high = max(surface.run_low, low), min(surface.run_high, high)
    surface.run_sign, surface.run_at = sign, frame


@kernel
def judge_growth(fdi, surface, low, high, u):
    """An incipient bias keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    off_low, off_high = clear_of_stops(fdi, surface, low, high, u)
    if off_low and off_high:
        if low - u > 0.0:
            surface.grown_up = max(surface.grown_up, low - u)
        if high - u < 0.0:
            surface.grown_down = min(surface.grown_down, high - u)
        above, below = surface.grown_up > 0.0, surface.grown_down < 0.0
        less_above, less_below = high - u < surface.grown_up, low - u > surface.grown_down
        if (above and below) or (above and less_above) or (below and less_below):
            surface.type_excluded[GROWING_BIAS] = 1


@kernel
def judge(fdi, surface, frame):
    """Hold every type of one surface against the frame before the elapsed one: something was wrong in it."""
    low, high, u = surface.low_then, surface.high_then, surface.command_then
    if low > high:
        return
    if surface.started_at < 0:
        surface.started_at, surface.start_low, surface.start_high = frame, low, high
    judge_loss(fdi, surface, low, high, u)
    judge_held(fdi, surface)
    judge_bias(fdi, surface, low, high, u)
    judge_oscillation(fdi, surface, low - u, high - u, frame)
    judge_pace(fdi, surface, low, high, frame)
    judge_growth(fdi, surface, low, high, u)


@kernel
def take_in(fdi):
    """Where each surface was in the elapsed frame, if it alone is at fault, and whether something was."""
    wrong = not membership.healthy(fdi)
    for s in range(4):
        surface = fdi.surface[s]
        surface.wrong_before, surface.wrong_then, surface.wrong = surface.wrong_then, surface.wrong, wrong
        locate(fdi, s)


@kernel
def judge_all(fdi):
    """Judge the frame before the elapsed one.

    With several JSBSim frames in one of ours a fault may begin or end within a frame, which then shows a
    part of it: such a frame, next to a healthy one, is passed over.
    """
    for s in range(4):
        surface = fdi.surface[s]
        surface.square += (0.5 * (surface.low_then + surface.high_then) - surface.command_then) ** 2
        if fdi.returns and fdi.frame > 0:
            release.let_go(fdi, surface)
        if surface.measure == FIXED and not surface.wrong_then:
            note_quiet(fdi, s)
        elif surface.wrong_then and (fdi.whole or (surface.wrong_before and surface.wrong)):
            surface.evidence += 1
            judge(fdi, surface, fdi.frame - 1)
        else:
            surface.steady_since = fdi.frame  # it may have swung to the other side, unseen
        if fdi.returns and fdi.frame > 0:
            release.bring_back(fdi, surface)
    fdi.frame += 1


@kernel
def examine(fdi):
    """Take in the elapsed frame, and judge the one before."""
    take_in(fdi)
    judge_all(fdi)


@kernel
def note_quiet(fdi, s):
    """A surface given up and commanded to where it happens to be says by its quiet that it does not swing.

    That is evidence against the others too, as far as one of them all is in question.
    """
    surface = fdi.surface[s]
    if surface.low_then > surface.set_high[STUCK] or surface.high_then < surface.set_low[STUCK]:
        return
    for other in range(4):
        if other == s or (surface.in_question and fdi.surface[other].in_question):
            fdi.surface[other].evidence += 1
    surface.quiet += 1
    if surface.quiet > fdi.patience and not fdi.own_errors:
        surface.type_excluded[OSCILLATORY] = 1


@kernel
def possible(fdi, s):
    """Whether anything on surface s can be the fault."""
    standing = fdi.surface[s].standing
    if standing != BY_ESTIMATOR:
        return standing == BY_DEDUCTION
    return not fdi.estimator[POSITION_FIRST + s].excluded


@kernel
def alive(fdi, s, kind):
    """Whether this type on surface s can be the fault."""
    return possible(fdi, s) and not fdi.surface[s].type_excluded[kind]


@kernel
def any_constant(fdi, s):
    """Whether a type with a constant parameter is left on surface s."""
    left = False
    for kind in range(N_CONSTANT):
        left = left or alive(fdi, s, kind)
    return left


@kernel
def swings(fdi, s):
    """Whether surface s is known to have swung for two half-cycles and more."""
    return possible(fdi, s) and swings_by(fdi.surface[s])


@kernel
def swings_by(surface):
    """The same of a surface known to be at fault."""
    return not surface.type_excluded[OSCILLATORY] and surface.flips >= FLIPS_OF_AN_OSCILLATION


@kernel
def explained(fdi, s):
    """Whether some type on surface s is left."""
    courses = alive(fdi, s, VARYING_LOSS) or alive(fdi, s, SLOW) or alive(fdi, s, GROWING_BIAS)
    return any_constant(fdi, s) or courses or swings(fdi, s)


@kernel
def sole(fdi, constant):
    """The one possible surface, with a type of constant parameter left if so asked; -1 none, -2 several."""
    found = -1
    for s in range(4):
        if fdi.surface[s].in_question and possible(fdi, s) and (any_constant(fdi, s) or not constant):
            found = s if found == -1 else -2
    return found


@kernel
def surface_at_fault(fdi):
    """The surface the fault is on, NOT_ISOLATED or UNANTICIPATED.

    What acts on pitch alone shows no direction, so a surface left over there must also have a type that
    explains it. Of elevator and flap, each of which can do what the other does if it only moves accordingly,
    the one is named for which a constant suffices, once a slow oscillation of the other would have shown.
    """
    s = sole(fdi, False)
    if s == -1:
        return UNANTICIPATED
    if s >= 0:
        return s if DOMINANT_AXIS[s] != PITCH or explained(fdi, s) else NOT_ISOLATED
    s = sole(fdi, True)
    return s if s >= 0 and others_refuted(fdi, s) else NOT_ISOLATED


@kernel
def others_refuted(fdi, chosen):
    """Whether nothing but a fault that follows the chosen one's commands is left on the other surfaces.

    An oscillation is given one half-cycle of the slowest to betray itself, a whole one if still possible;
    where errors are declared that a course can hide in, every type of the others must have been excluded.
    """
    waits = 1
    for s in range(4):
        if s != chosen and fdi.surface[s].in_question:
            if fdi.own_errors and possible(fdi, s) and anything_left(fdi.surface[s]):
                return False
            if alive(fdi, s, OSCILLATORY) or alive(fdi, s, VARYING_LOSS):
                waits = 2
    return fdi.surface[chosen].evidence >= waits * fdi.patience


@kernel
def loses(fdi, s):
    """Whether a loss of effectiveness is left; one that varies counts only when no constant explains it."""
    varies = alive(fdi, s, VARYING_LOSS) and not any_constant(fdi, s)
    return alive(fdi, s, CONSTANT_LOSS) or varies


@kernel
def one_type(fdi, s):
    """The one type of constant parameter left on surface s, or -1; a runaway is one, whichever the stop."""
    found, several = -1, False
    for kind in range(N_CONSTANT):
        if alive(fdi, s, kind):
            several = several or (found >= 0 and not (found == UP and kind == DOWN))
            found = kind
    return -1 if several else found


@kernel
def may_be_slow(fdi, s):
    """Whether what looks like a jam may be a slow surface that has come to where it is commanded: it has not
    stood off its command for long."""
    loud = fdi.surface[s].evidence - fdi.surface[s].quiet
    return any_constant(fdi, s) and alive(fdi, s, SLOW) and loud < fdi.patience


@kernel
def may_be_growing(fdi, s, found):
    """Whether what looks like a jam or a loss may be a bias that grows as the command happens to go."""
    return found in (CONSTANT_LOSS, STUCK, FLOAT) and alive(fdi, s, GROWING_BIAS)


@kernel
def anything_left(surface):
    """Whether any type of a surface is not excluded."""
    left = False
    for kind in range(N_TYPES):
        left = left or not surface.type_excluded[kind]
    return left


@kernel
def sole_type(fdi, s):
    """The one type left on surface s whatever its course, or -1: in coarse sets a constant proves nothing."""
    losing = alive(fdi, s, CONSTANT_LOSS) or alive(fdi, s, VARYING_LOSS)
    biased = alive(fdi, s, BIAS) or alive(fdi, s, GROWING_BIAS)
    running = alive(fdi, s, UP) or alive(fdi, s, DOWN)
    stuck, trailing = alive(fdi, s, STUCK), alive(fdi, s, FLOAT)
    swinging, slow = alive(fdi, s, OSCILLATORY), alive(fdi, s, SLOW)
    if losing + biased + running + stuck + trailing + swinging + slow != 1:
        return -1
    if losing:
        return CONSTANT_LOSS if alive(fdi, s, CONSTANT_LOSS) else VARYING_LOSS
    if biased:
        return BIAS if alive(fdi, s, BIAS) else GROWING_BIAS
    if swinging:
        return OSCILLATORY if swings(fdi, s) else -1
    if running:
        return UP if alive(fdi, s, UP) else DOWN
    return STUCK if stuck else (FLOAT if trailing else SLOW)


@kernel
def type_at_fault(fdi, s):
    """The type of the fault on surface s, or -1 while more than one fits or an oscillation may yet show."""
    found, evidence = one_type(fdi, s), fdi.surface[s].evidence
    if evidence < fdi.patience or may_be_slow(fdi, s):
        return -1
    if fdi.own_errors:
        return sole_type(fdi, s)
    patient = not alive(fdi, s, OSCILLATORY) or evidence >= 2 * fdi.patience
    if any_constant(fdi, s):
        return found if patient and not may_be_growing(fdi, s, found) else -1
    return one_course(fdi, s, patient)


@kernel
def one_course(fdi, s, patient):
    """The same when no constant explains it: a loss, pace or bias that varies, or an oscillation."""
    fading, slow, growing = alive(fdi, s, VARYING_LOSS), alive(fdi, s, SLOW), alive(fdi, s, GROWING_BIAS)
    if fading + slow + growing > 1 or (slow and alive(fdi, s, OSCILLATORY)):
        return -1
    if slow:
        return SLOW
    if fading or growing:
        return (VARYING_LOSS if fading else GROWING_BIAS) if patient else -1
    return OSCILLATORY if swings(fdi, s) else -1


@kernel
def decide(fdi, t):
    """Name the surface and, when it is certain, the type; t s."""
    s = surface_at_fault(fdi)
    before = fdi.estimator[fdi.isolated].surface if fdi.isolated >= 0 else fdi.isolated
    kind = type_at_fault(fdi, s) if s >= 0 else -1
    if s != before:
        fdi.isolated_at_s = t
    if kind != fdi.type:
        fdi.type, fdi.type_at_s = kind, t
    fdi.isolated = s
    if s >= 0 and kind not in (CONSTANT_LOSS, VARYING_LOSS):
        fdi.isolated = POSITION_FIRST + s
    take_the_lead(fdi)


@kernel
def is_fixed(fdi, s):
    """Whether surface s is known to ignore its command."""
    stays = alive(fdi, s, STUCK) or alive(fdi, s, UP) or alive(fdi, s, DOWN)
    return stays and not alive(fdi, s, BIAS) and (not loses(fdi, s) or alive(fdi, s, FLOAT))


@kernel
def measure_for(fdi, s):
    """What is to be done about surface s as far as is known: LOSES, FIXED, LAGS or SHIFTED.

    To add what the last frame shows to be off is right for a bias and an oscillation, serves a loss of
    effectiveness meanwhile, and moves the command so that a jam betrays itself in the next frame.
    """
    if is_fixed(fdi, s):
        return FIXED
    if not any_constant(fdi, s) and not alive(fdi, s, VARYING_LOSS):
        return LAGS if alive(fdi, s, SLOW) else SHIFTED
    fixed = alive(fdi, s, STUCK) or alive(fdi, s, UP) or alive(fdi, s, DOWN)
    return LOSES if loses(fdi, s) and not fixed and not alive(fdi, s, BIAS) else SHIFTED


@kernel
def presumed(fdi):
    """The surface the law acts upon: the one at fault, or the likeliest; -1 none yet.

    It acts before all doubt is gone, since it can take it back. Of elevator and flap it does not matter which
    is thought to be off, as long as both follow their commands: the moment is the same.
    """
    if fdi.isolated >= 0:
        return fdi.estimator[fdi.isolated].surface
    s = sole(fdi, True)
    if s >= 0:
        return s
    return ELEVATOR if possible(fdi, ELEVATOR) else (FLAP if possible(fdi, FLAP) else -1)


@kernel
def take_the_lead(fdi):
    """Settle on which surface the law acts and how."""
    s = presumed(fdi)
    for other in range(4):
        fdi.surface[other].measure = -1
    fdi.lead_kind = measure_for(fdi, s) if s >= 0 else -1
    fdi.lead = s if fdi.lead_kind >= 0 else -1
    if fdi.lead >= 0:
        if still_there(fdi, s, fdi.lead_kind):
            fdi.surface[s].measure = fdi.lead_kind
        else:
            fdi.lead = -1


@kernel
def still_there(fdi, s, measure):
    """Whether the fault of surface s shows, or did a moment ago; one that has gone is let go."""
    surface = fdi.surface[s]
    deflection = deflection_error(fdi, s) + surface.command
    there = surface.low <= deflection <= surface.high or measure == LOSES
    surface.absent = 0 if there else surface.absent + 1
    return surface.absent < ABSENT_FRAMES


@kernel
def middle(surface, kind):
    """The middle of a type's set."""
    return 0.5 * (surface.set_low[kind] + surface.set_high[kind])


@kernel
def deflection_error(fdi, s):
    """How far surface s is off its command, rad, by the types left, or as the last frame shows it."""
    surface = fdi.surface[s]
    if alive(fdi, s, FLOAT):
        return -surface.command
    stuck, biased = alive(fdi, s, STUCK), alive(fdi, s, BIAS)
    if stuck and not biased:
        return middle(surface, STUCK) - surface.command
    if biased and surface.set_high[BIAS] - surface.set_low[BIAS] < np.inf:
        return middle(surface, BIAS)
    return 0.5 * (surface.low + surface.high) - surface.command


@kernel
def effectiveness_left(fdi, s):
    """What surface s has left of its effectiveness.

    The estimator fits both axes of a surface, so beside another fault the set of the constant is asked.
    """
    if fdi.pairs and alive(fdi, s, CONSTANT_LOSS):
        return middle(fdi.surface[s], CONSTANT_LOSS)
    return 1.0 + fdi.estimator[s].theta[DOMINANT_AXIS[s]]
