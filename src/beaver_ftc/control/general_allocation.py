"""Allocation to any set of surfaces, by constrained least squares (least_squares.py) within stops and rates.

The problem is started from the frame before. The weight of each surface takes the place of the hand-over of
allocation.py, which has the words for surfaces and the records.

    G                (3, n) rad/s2 per rad, with the effectiveness of each surface in it
    effectiveness    (n,)
    prediction       u (n,) rad, where the surfaces are, and their actuators; w: length of a JSBSim frame in
                     frames
    share            as in `allocation.pitch`
    probe            rad; if it is not 0, the stand-in is held at its trim + probe
"""

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import apart, kernel
from beaver_ftc.control.allocation import within_stops
from beaver_ftc.control.authority import remaining
from beaver_ftc.control.least_squares import FREE, LOW, solve

RELUCTANT = 1e-4  # least factor on a backup's weight, when nothing is handed over to it; largest: 1 / it
TINY = 1e-300  # in place of a divisor of zero


@apart
def allocate_generally(axes, allocation, layout, effectiveness, prediction, share, probe):
    """Fill the command (n,) rad for axes.demand (3,) rad/s2. With several elevators (the main one has less
    than the whole authority of pitch) the backups take over no more than the share that the elevators have
    lost."""
    problem = allocation.memory.problem
    output = allocation.output
    if layout.authority[PITCH, layout.main[PITCH]] < 1.0:
        share = min(share, 1.0 - remaining(layout, effectiveness, PITCH))
    set_problem(problem, axes.G, layout, effectiveness, prediction, share)
    if probe != 0.0 and layout.stand_in >= 0:
        hold_probe(problem, layout.stand_in, layout.trim[layout.stand_in] + probe)
    solve(problem, axes.G, axes.demand)
    for s in range(output.command.size):
        output.command[s] = problem.u[s]
        side = problem.side[s]
        stop = layout.low[s] if side == LOW else layout.high[s]
        output.saturated[s] = side != FREE and problem.u[s] == stop


@kernel
def set_problem(problem, G, layout, effectiveness, prediction, share):
    """Fill the problem of this frame: the limits of each surface, rad, the deflection that it prefers, rad,
    and the weight of its motion away from that (a larger one moves more), rad2.

        low, high = u -+ reach, within the stops        reach: by the rate limit in a frame, rad
        u_preferred = trim / E, within the stops        E: effectiveness; trim if E is 0
        weight = half^2,  of a backup half^2 ratio      half: half the travel, rad
        ratio = share others / ((1 - share) backups)    within RELUCTANT and 1 / RELUCTANT

    With trim / E a weakened surface keeps its trimmed moment. others, backups: sums of half^2 G_pitch^2 over
    the surfaces that are no backups, and over the backups.

    Why this ratio: the backups then give `share` of what pitch demands beyond the trimmed moments. With two
    surfaces that move pitch alone this is the hand-over of `allocation.pitch`, up to the limits.
    """
    others = 0.0
    backups = 0.0
    u = prediction.u
    for s in range(u.size):
        reach = prediction.actuators.step[s] / prediction.w
        half = 0.5 * (layout.high[s] - layout.low[s])
        E = effectiveness[s]
        trim = layout.trim[s] / E if E > 0.0 else layout.trim[s]
        problem.u_preferred[s] = within_stops(layout, s, trim)
        problem.weight[s] = half * half
        problem.low[s] = within_stops(layout, s, u[s] - reach)
        problem.high[s] = max(min(layout.high[s], u[s] + reach), problem.low[s])
        moment = half * half * G[PITCH, s] ** 2
        if layout.is_backup[s]:
            backups += moment
        else:
            others += moment
    ratio = share * others / max((1.0 - share) * backups, TINY)
    for s in range(u.size):
        if layout.is_backup[s]:
            problem.weight[s] *= min(max(ratio, RELUCTANT), 1.0 / RELUCTANT)


@kernel
def hold_probe(problem, f, u_f):
    """Hold the stand-in f at u_f rad, as far as its limits allow; the other surfaces give the rest."""
    u_f = min(max(u_f, problem.low[f]), problem.high[f])
    problem.u_preferred[f] = problem.low[f] = problem.high[f] = u_f
