"""Show the elapsed frame, or block of frames, to every type: where was each surface, and was anything wrong?

A frame is judged when the next one is there: with several JSBSim frames in one of ours a fault may begin or
end within a frame, which then shows a part of it; such a frame, next to a healthy one, is passed over.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import membership
from beaver_ftc.diagnosis.types.memory import HISTORY
from beaver_ftc.diagnosis.types.registry import (
    OSCILLATORY,
    STUCK,
    begin_each,
    bring_back_each,
    judge_each,
    let_go_each,
    pass_over_each,
    watch_each,
)

# What is done about a fault: scale the command, give the surface up, add an offset, or leave it to its pace.
LOSES, FIXED, SHIFTED, LAGS = range(4)


@kernel
def start(fdi):
    """Nothing is known of any surface yet."""
    for s in range(fdi.types.surface.size):
        begin(fdi.types.surface[s])


@kernel
def begin(surface):
    """Nothing is known of this surface yet."""
    surface.set_low[:], surface.set_high[:] = -np.inf, np.inf
    surface.type_excluded[:] = 0
    surface.low, surface.high = surface.reach_low, surface.reach_high
    surface.started_at = -1
    surface.evidence = surface.quiet = surface.unhidden = 0
    begin_each(surface)


@kernel
def note_orders(fdi, commanded, means):
    """What the surfaces have been ordered to do, commanded (n,) rad, since the elapsed frame began; where
    healthy ones were, and their least and greatest effectiveness, within it: means of a `belief.means_dtype`.
    """
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        orders = surface.orders
        if fdi.types.block.filled == 0:
            for age in range(HISTORY - 1, 0, -1):
                orders.given[age, : fdi.types.config.length] = orders.given[
                    age - 1, : fdi.types.config.length
                ]
                orders.low[age], orders.high[age] = orders.low[age - 1], orders.high[age - 1]
            orders.low[0], orders.high[0] = np.inf, -np.inf
            orders.least[1], orders.greatest[1] = orders.least[0], orders.greatest[0]
            orders.least[0], orders.greatest[0] = np.inf, -np.inf
            surface.G_least, surface.G_most = np.inf, -np.inf
        order = min(max(commanded[s], surface.travel_low), surface.travel_high)
        orders.given[0, fdi.types.block.filled] = order
        orders.low[0], orders.high[0] = min(orders.low[0], order), max(orders.high[0], order)
        orders.least[0] = min(orders.least[0], means.u_least[s])
        orders.greatest[0] = max(orders.greatest[0], means.u_most[s])
        surface.G_least = min(surface.G_least, means.G_least[s])
        surface.G_most = max(surface.G_most, means.G_most[s])


@kernel
def locate(fdi, s, innovation, bound, effect):
    """Find where surface s can have been (rad): what agrees with the innovation (3,) within its bound (3,).

    effect: what the surface's estimator supposes of the same frame or block, dtype EFFECT.
    """
    surface, fie, axis = (
        fdi.types.surface[s],
        fdi.isolation.estimator[fdi.layout.position_of[s]],
        fdi.layout.dominant_axis[s],
    )
    surface.low_before, surface.high_before = surface.low_then, surface.high_then
    surface.low_then, surface.high_then, surface.command_then = surface.low, surface.high, surface.command
    surface.command = -effect.offset[axis] / effect.Z[axis]
    surface.uneven_then = surface.uneven
    surface.uneven = 0.25 * (surface.G_most - surface.G_least) / abs(effect.Z[axis])
    surface.low, surface.high = fie.low, fie.high
    for i in range(3):
        if fdi.types.config.length > 1 and i != axis and effect.Z[i] != 0.0:
            continue  # over a block the axes weigh what varies differently
        low, high = membership.agreeing(innovation, bound, fie, effect, i)
        surface.low, surface.high = max(surface.low, low), min(surface.high, high)
    surface.hides_then[:] = surface.hides
    note_stops(surface, 2.0 * (bound[axis] + effect.spread[axis]) / abs(effect.Z[axis]))


@kernel
def note_stops(surface, width):
    """Which stops can cut a deflection off unseen: those nearer to a healthy surface than `width` (rad), that
    of the interval which holds the true deflection."""
    surface.hides[0] = surface.orders.least[0] - surface.travel_low < width
    surface.hides[1] = surface.travel_high - surface.orders.greatest[0] < width


@kernel
def note_wrong(fdi, innovation, bound):
    """Keep for every surface whether more than the admitted uncertainty was at work."""
    wrong = not membership.healthy(innovation, bound)
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        surface.wrong_before, surface.wrong_then, surface.wrong = surface.wrong_then, surface.wrong, wrong


@kernel
def take_in_frame(fdi):
    """Find where each surface was in the elapsed frame, if it alone is at fault."""
    note_wrong(fdi, fdi.bank.innovation, fdi.bound.frame)
    for s in range(fdi.types.surface.size):
        effect = fdi.isolation.estimator[fdi.layout.position_of[s]].effect
        locate(fdi, s, fdi.bank.innovation, fdi.bound.frame, effect)


@kernel
def note_evidence(surface):
    """Count a frame as evidence; see `judge_all` for that which no stop can have hidden."""
    surface.evidence += 1
    surface.unhidden += 1


@kernel
def judge(fdi, surface, frame):
    """Hold every type of one surface against the frame before the elapsed one: something was wrong in it."""
    if surface.low_then > surface.high_then:
        return
    if surface.started_at < 0:
        surface.started_at, surface.start_low, surface.start_high = frame, surface.low_then, surface.high_then
    judge_each(fdi, surface, frame)


@kernel
def judge_all(fdi):
    """Judge the frame before the elapsed one."""
    for s in range(fdi.types.surface.size):
        surface = fdi.types.surface[s]
        watch_each(fdi, surface)
        if fdi.types.config.returns and fdi.types.frame > 0:
            let_go_each(fdi, surface)
        if fdi.config.abrupt and surface.measure == FIXED and not surface.wrong_then:
            note_quiet(fdi, s)
        elif surface.wrong_then and (fdi.types.config.whole or (surface.wrong_before and surface.wrong)):
            note_evidence(surface)
            judge(fdi, surface, fdi.types.frame - 1)
        else:
            pass_over_each(fdi, surface)
        if fdi.types.config.returns and fdi.types.frame > 0:
            bring_back_each(fdi, surface)
        if surface.hides_then[0] or surface.hides_then[1]:
            surface.unhidden = 0
    fdi.types.frame += 1


@kernel
def examine(fdi):
    """Take in the elapsed frame, and judge the one before."""
    take_in_frame(fdi)
    judge_all(fdi)


@kernel
def note_quiet(fdi, s):
    """A surface given up, and commanded to where it happens to be, shows by its quiet that it does not swing.

    That is evidence against the others too, as far as one of them all is in question. It takes a fault that
    is declared to stay: of one that may go, the quiet may be that of health.
    """
    surface = fdi.types.surface[s]
    if surface.low_then > surface.set_high[STUCK] or surface.high_then < surface.set_low[STUCK]:
        return
    for other in range(fdi.types.surface.size):
        if other == s or (surface.in_question and fdi.types.surface[other].in_question):
            note_evidence(fdi.types.surface[other])
    surface.quiet += 1
    if surface.quiet > fdi.types.config.patience and not fdi.bound.own_errors:
        surface.type_excluded[OSCILLATORY] = 1
