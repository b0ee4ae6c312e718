"""Allocation: the surfaces that give the demanded angular accelerations, and what they can give at all.

An aircraft with one surface an axis and a stand-in needs a few lines: the lateral pair, the elevator, and the
hand-over from elevator to flap (`allocate`). Any other set of surfaces is allocated by constrained least
squares (least_squares.py), started from the frame before (`allocate_generally`); the weight of each surface
then takes the place of the hand-over.

The attainable moment set is the image of the travels under G [Durham1993]. Here it is the interval that it
spans on each axis (`attainable`), with the effectiveness of each surface in G. No law can meet a demand
outside of it.

Words for surfaces:

    main        the surface that leads an axis
    stand-in    the surface that takes the place of the main surface of pitch: the flap of the Beaver
    backup      any surface that waits until pitch is handed over; the stand-in is one
    share       of pitch that is handed over to the backups, 0 to 1

    G           (3, n) rad/s2 per rad; in `axes.G` times the effectiveness of each surface
    u           (n,) rad, command
    output      record, output of `allocation_dtype`
"""

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import apart, copy, fill, kernel, record, sized
from beaver_ftc.control.accommodation import usable_effectiveness
from beaver_ftc.control.least_squares import FREE, LOW, problem_dtype, solve
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.scenario.declared import Declared

RELUCTANT = 1e-4  # least factor on a backup's weight, when nothing is handed over to it; largest: 1 / it
TINY = 1e-300  # in place of a divisor of zero


@sized
def layout_dtype(n: int) -> np.dtype:
    """Configuration of n surfaces.

    main (3,)             the surface that leads each axis
    stand_in              the surface that takes the place of the main surface of pitch, -1 for none
    trim, low, high (n,)  rad, deflection in trim, and stops
    is_backup (n,)        whether a surface waits until pitch is handed over
    authority (3, n)      share of each surface in the authority about each axis; backups have none in pitch
    general               whether `allocate_generally` is necessary (`_is_general`)
    """
    return record(
        main=(int, 3), stand_in=int, trim=n, low=n, high=n, general=int, is_backup=(int, n), authority=(3, n)
    )


@sized
def axes_dtype(n: int) -> np.dtype:
    """What the surfaces are to do about each axis (3,), rad/s2.

    G (3, n)        rad/s2 per rad, times the effectiveness of each surface
    demand, hold    what the law demands, and the part that only holds the rates; both less the moments of
                    offsets
    disturbance     what the law's observer finds, if it has one
    shortfall       the part of the demand that was not given
    beyond          whether not even the rates can be held
    """
    return record(G=(3, n), demand=3, hold=3, disturbance=3, shortfall=3, beyond=(int, 3))


@sized
def allocation_dtype(n: int) -> np.dtype:
    """The stage's records for n surfaces.

    hand_over_step   change of hand_over in a frame
    problem          of least_squares.py, used if `layout.general`
    command (n,)     rad
    saturated (n,)   whether a stop limits the command of a surface
    hand_over        how far pitch is handed over to the stand-in, 0 to 1
    lost_share       the part of pitch that the main surface has lost, 0 to 1
    transfer_share   the part of pitch that the stand-in carries now, 0 to 1 (`hand_over_pitch`)
    """
    return record(
        config=record(hand_over_step=float), memory=record(problem=problem_dtype(n)),
        output=record(command=n, saturated=(int, n), hand_over=float, lost_share=float, transfer_share=float),
    )  # fmt: skip


def configure(control: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill `layout`, except its trim (loop/assembly.py), and `allocation` of a law's record; travel (2, n)
    rad."""
    layout, aircraft = control["layout"], declared.aircraft
    fill(
        layout, low=travel[0], high=travel[1], main=main_surface_index_by_axis(aircraft),
        stand_in=aircraft.surfaces.index(aircraft.stand_ins[0]) if aircraft.stand_ins else -1,
        is_backup=[surface in aircraft.stand_ins for surface in aircraft.surfaces],
        general=_is_general(aircraft),
    )  # fmt: skip
    layout["authority"] = _authority(declared, layout)
    step = control["reference"]["config"]["dt"] / declared.control.hand_over_s
    control["allocation"]["config"]["hand_over_step"] = step


def _is_general(aircraft: Aircraft) -> bool:
    """Whether there are more surfaces than those that lead an axis and the first stand-in, or one surface
    leads two axes."""
    several = aircraft.n > len(aircraft.primary) + min(len(aircraft.stand_ins), 1)
    return several or len(aircraft.primary) < len(AXES)


def _authority(declared: Declared, layout: np.void) -> np.ndarray:
    """Share (3, n) of each surface s in the authority about each axis i:

        |G_is| travel_s / their sum        over the surfaces whose largest effect is about this axis

    The surface that leads the axis has the share 1 if the aircraft is not general, or if no surface has its
    largest effect about the axis. Backups have none in pitch.
    """
    aircraft = declared.aircraft
    shares = np.zeros((3, aircraft.n))
    if not _is_general(aircraft):
        shares[range(3), layout["main"]] = 1.0
        return shares
    effects = aircraft.effects(declared.scale)
    for s, (surface, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
        if axis != PITCH or not layout["is_backup"][s]:
            travel = aircraft.travel[surface]
            shares[axis, s] = abs(effects[surface][axis]) * (travel.max_rad - travel.min_rad)
    for axis, s in enumerate(layout["main"]):
        shares[axis, s] = shares[axis, s] or float(not shares[axis].any())
    return shares / shares.sum(axis=1, keepdims=True)


@kernel
def remaining(layout, effectiveness, i):
    """Remaining share of the authority about axis i, 0 to 1: sum_s authority_is effectiveness_s."""
    share = 0.0
    for s in range(effectiveness.size):
        share += layout.authority[i, s] * effectiveness[s]
    return share


@kernel
def within_stops(layout, s, deflection):
    """The deflection, rad, of surface s that is nearest to this one within its travel."""
    return min(max(deflection, layout.low[s]), layout.high[s])


@kernel
def clip(output, layout, s, deflection):
    """Limit a deflection (rad) to the travel of surface s; saturated: whether this changes it."""
    limited = within_stops(layout, s, deflection)
    output.saturated[s] = limited != deflection
    return limited


@kernel
def divide(moment, divisor):
    """moment / divisor, and 0 for a divisor of 0, as that of a surface that is given up."""
    return moment / divisor if divisor != 0.0 else 0.0


@kernel
def set_demand(axes, i, demand, hold, disturbance):
    """Set what a law demands about axis i, the part that only holds the rates, and the disturbance that its
    observer finds, rad/s2."""
    axes.demand[i], axes.hold[i], axes.disturbance[i] = demand, hold, disturbance


@kernel
def subtract_offsets(axes, offset, G):
    """Subtract the moments of offsets, G offset, from demand and hold of the law; offset (n,) rad."""
    for i in range(3):
        for s in range(G.shape[1]):
            axes.demand[i] -= G[i, s] * offset[s]
            axes.hold[i] -= G[i, s] * offset[s]


@kernel
def form_effectiveness_matrix(axes, G, surfaces, uses_verdict):
    """Fill axes.G: the design model's G, times the `usable_effectiveness` of each surface if the law uses the
    verdict."""
    if not uses_verdict:
        copy(G, axes.G)
        return
    for s in range(G.shape[1]):
        effectiveness = usable_effectiveness(surfaces, s)
        for i in range(3):
            axes.G[i, s] = G[i, s] * effectiveness


@kernel
def lateral(axes, output, layout):
    """Aileron a and rudder r for the roll and yaw demand, rad/s2: the solution of

        G_roll,a u_a + G_roll,r u_r = roll,    G_yaw,a u_a + G_yaw,r u_r = yaw

    If the determinant is 0, a is 0 at first. When one saturates, the other gives as much of its own axis as
    it can. The order is therefore a, r, a: r is computed with the a that the stops allow, and a again with
    the r that they allow.
    """
    G, u = axes.G, output.command
    a, r = layout.main[ROLL], layout.main[YAW]
    roll, yaw = axes.demand[ROLL], axes.demand[YAW]
    determinant = G[ROLL, a] * G[YAW, r] - G[ROLL, r] * G[YAW, a]
    u[a] = clip(output, layout, a, divide(roll * G[YAW, r] - yaw * G[ROLL, r], determinant))
    u[r] = clip(output, layout, r, divide(yaw - G[YAW, a] * u[a], G[YAW, r]))
    u[a] = clip(output, layout, a, divide(roll - G[ROLL, r] * u[r], G[ROLL, a]))


@kernel
def smoothstep(share):
    """3 s^2 - 2 s^3 of a share s: from 0 to 1 with slope 0 at either end."""
    return share * share * (3.0 - 2.0 * share)


@kernel
def pitch(axes, output, layout, effectiveness, share, probe):
    """Elevator and flap for the pitch demand, rad/s2.

    Before the hand-over (share 0), the elevator e carries the whole demand. After it (share 1), the flap f
    carries all but the trimmed moment of a healthy elevator, which the elevator keeps. The upward travel of
    the flap is short: what it cannot give returns to the elevator. Without a flap the elevator carries what
    it can. Both are limited to their travel.

        u_f = trim_f + share ((demand - hold) / G_f - trim_f) + probe,    hold = G_e / effectiveness trim_e
        u_e = (demand - G_f u_f) / G_e

    G_e, G_f: of pitch, rad/s2 per rad, with the effectiveness of each surface in it; effectiveness: of the
    elevator; probe: rad of the flap.
    """
    G, u, demand = axes.G, output.command, axes.demand[PITCH]
    e, f = layout.main[PITCH], layout.stand_in
    if f >= 0:
        hold = divide(G[PITCH, e], effectiveness) * layout.trim[e]
        flap = layout.trim[f] + share * (divide(demand - hold, G[PITCH, f]) - layout.trim[f])
        u[f] = clip(output, layout, f, flap + probe)
        demand -= G[PITCH, f] * u[f]
    u[e] = clip(output, layout, e, divide(demand, G[PITCH, e]))


@kernel
def allocate(axes, output, layout, effectiveness, share, probe):
    """Fill the command (n,) rad for axes.demand (3,) rad/s2; share, probe: see `pitch`."""
    lateral(axes, output, layout)
    pitch(axes, output, layout, effectiveness[layout.main[PITCH]], share, probe)


@kernel
def set_problem(problem, G, layout, effectiveness, prediction, share, probe):
    """Fill the problem of least_squares.py for this frame: the limits of each surface, rad, the deflection
    that it prefers, rad, and the weight with which it leaves that, rad2.

        low, high = u -+ reach, within the stops        reach: by the rate limit in a frame, rad
        u_preferred = trim / E, within the stops        E: effectiveness; trim if E is 0
        weight = half^2,  of a backup half^2 ratio      half: half the travel, rad
        ratio = share others / ((1 - share) backups)    within RELUCTANT and 1 / RELUCTANT

    others, backups: sums of half^2 G_pitch^2 over the surfaces that are no backups, and over the backups.
    G (3, n) rad/s2 per rad; effectiveness (n,); share, probe: as in `pitch`. prediction: u, where the
    surfaces are, and their actuators; w: length of a JSBSim frame in frames.

    Why this ratio: the backups then give `share` of what pitch demands beyond the trimmed moments. With two
    surfaces that move pitch alone this is the published hand-over. During a probe the stand-in is held at its
    trim + probe, and the other surfaces give the rest of the demand.
    """
    others, backups, u = 0.0, 0.0, prediction.u
    for s in range(u.size):
        reach = prediction.actuators.step[s] / prediction.w
        half, E = 0.5 * (layout.high[s] - layout.low[s]), effectiveness[s]
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
    if probe != 0.0 and layout.stand_in >= 0:
        f = layout.stand_in
        u_probe = min(max(layout.trim[f] + probe, problem.low[f]), problem.high[f])
        problem.u_preferred[f] = problem.low[f] = problem.high[f] = u_probe


@apart
def allocate_generally(axes, allocation, layout, effectiveness, prediction, share, probe):
    """Fill the command (n,) rad for any number of surfaces, within stops and rates, by least squares.

    effectiveness (n,); share, probe: as in `pitch`. With several elevators (the main one has less than the
    whole authority of pitch) the backups take over no more than the share that the elevators have lost.
    """
    problem = allocation.memory.problem
    output = allocation.output
    remains = remaining(layout, effectiveness, PITCH)
    if layout.authority[PITCH, layout.main[PITCH]] < 1.0:
        share = min(share, 1.0 - remains)
    set_problem(problem, axes.G, layout, effectiveness, prediction, share, probe)
    solve(problem, axes.G, axes.demand)
    for s in range(output.command.size):
        output.command[s], side = problem.u[s], problem.side[s]
        stop = layout.low[s] if side == LOW else layout.high[s]
        output.saturated[s] = side != FREE and problem.u[s] == stop


@kernel
def spill_to_flap(axes, output, layout):
    """Give the flap the part of the pitch demand that an elevator at its stop does not give:

        u_f = (demand - G_e u_e) / G_f        if the elevator is saturated

    The observer of the law finds what an elevator does not do that is jammed or too weak. The law then
    demands more than the elevator can give. The flap need not wait until the fault is named.
    """
    G, u = axes.G, output.command
    e, f = layout.main[PITCH], layout.stand_in
    if f >= 0 and output.saturated[e]:
        shortfall = axes.demand[PITCH] - G[PITCH, e] * u[e]
        u[f] = clip(output, layout, f, divide(shortfall, G[PITCH, f]))


@kernel
def park(output, layout, parked):
    """Command each surface that is `parked` (n,) to its trim."""
    for s in range(layout.trim.size):
        if parked[s]:
            output.command[s], output.saturated[s] = layout.trim[s], 0


@kernel
def lead_compensate(output, layout, lead, u):
    """Command each surface beyond the wanted deflection, so that a lagging actuator reaches it sooner:

    command <- u + lead (command - u), within the stops        if lead > 1; u (n,) rad: actuators; lead (n,)
    """
    command = output.command
    for s in range(u.size):
        if lead[s] > 1.0:
            command[s] = within_stops(layout, s, u[s] + lead[s] * (command[s] - u[s]))


@kernel
def hand_over_pitch(allocation, reallocated, at_once, remains, least):
    """Hand the pitch demand over to the flap while it is `reallocated`, else back, by the same step a frame:

        hand_over <- min(hand_over + step, 1), at_once at least 1 - remains      if reallocated
        hand_over <- max(hand_over - step, 0)                                    otherwise
        lost_share = 1 - remains, or 1 if remains < least
        transfer_share = smoothstep(hand_over) lost_share        smoothstep(1) if nothing remains

    at_once: whether the lost part is handed over in one frame, as after a jam. remains: remaining share of
    the authority in pitch (`remaining`). While pitch is handed back, lost_share stays: the estimate of the
    main surface may return to 1 in one frame, but the command must not jump.
    """
    config, output = allocation.config, allocation.output
    if reallocated:
        output.hand_over = min(output.hand_over + config.hand_over_step, 1.0)
        if at_once:
            output.hand_over = max(output.hand_over, 1.0 - remains)
    else:
        output.hand_over = max(output.hand_over - config.hand_over_step, 0.0)
    progress = output.hand_over if remains > 0.0 else 1.0
    if reallocated or remains <= 0.0:
        output.lost_share = 1.0 - remains if remains >= least else 1.0
    output.transfer_share = smoothstep(progress) * output.lost_share


@kernel
def attainable(G, layout, engine_authority, i):
    """Least and greatest acceleration of axis i, rad/s2, within the travel [Durham1993]:

        sum_s min(G_is low_s, G_is high_s),    sum_s max(G_is low_s, G_is high_s)

    G (3, n); engine_authority (2, 3) rad/s2: what engines give at least and at most, added to both.
    """
    least, greatest = engine_authority[0, i], engine_authority[1, i]
    for s in range(layout.low.size):
        at_low, at_high = G[i, s] * layout.low[s], G[i, s] * layout.high[s]
        least += min(at_low, at_high)
        greatest += max(at_low, at_high)
    return least, greatest


@kernel
def note_shortfall(axes, command, layout, lag, engine_authority):
    """Fill the shortfall of the command u (n,) rad, and `beyond`, whether `hold` is not attainable:

        shortfall = demand - G (u + lag),    rad/s2

    lag (n,) rad: position of a slow surface less that of a healthy one; engine_authority: as in `attainable`.
    """
    G = axes.G
    for i in range(3):
        acceleration = 0.0
        for s in range(command.size):
            acceleration += G[i, s] * (command[s] + lag[s])
        axes.shortfall[i] = axes.demand[i] - acceleration
        least, greatest = attainable(G, layout, engine_authority, i)
        axes.beyond[i] = not least <= axes.hold[i] <= greatest


@kernel
def take_command(output, layout, deflections):
    """Take a command (n,) rad from outside, within the travel of each surface."""
    for s in range(deflections.size):
        output.command[s] = clip(output, layout, s, deflections[s])
