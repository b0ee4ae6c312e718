"""Allocation: the surfaces that give the demanded angular accelerations.

An aircraft with one surface an axis and at most one stand-in needs a few lines: the lateral pair, the
elevator, and the hand-over from elevator to flap (`allocate`). general_allocation.py serves any other set of
surfaces; authority.py computes what surfaces can give at all.

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

from beaver_ftc.aircraft import AXES, PITCH, ROLL, YAW, Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import copy, fill, kernel, record, sized
from beaver_ftc.control.accommodation import usable_effectiveness
from beaver_ftc.control.authority import authority_shares
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.scenario.declared import Declared


@sized
def layout_dtype(n: int) -> np.dtype:
    """Configuration of n surfaces.

    main (3,)             the surface that leads each axis
    stand_in              the surface that takes the place of the main surface of pitch, -1 for none
    trim, low, high (n,)  rad, deflection in trim, and stops
    is_backup (n,)        whether a surface waits until pitch is handed over
    authority (3, n)      share of each surface in the authority about each axis; backups have none in pitch
    general               whether general_allocation.py is necessary (`_is_general`)
    """
    return record(
        main=(int, 3), stand_in=int, trim=n, low=n, high=n, general=int, is_backup=(int, n), authority=(3, n)
    )


@sized
def axes_dtype(n: int) -> np.dtype:
    """What the surfaces are to do about each axis (3,), rad/s2.

    G (3, n)        rad/s2 per rad, times the effectiveness of each surface
    demand, hold    what the law demands, and the part that only holds the rates; after `subtract_offsets`
                    both less the moments of offsets
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
    lost_share       the part of the authority in pitch that is lost, 0 to 1
    transfer_share   the part of pitch that the stand-in carries under a law with an observer, 0 to 1
                     (`hand_over_pitch`)
    """
    return record(
        config=record(hand_over_step=float), memory=record(problem=problem_dtype(n)),
        output=record(command=n, saturated=(int, n), hand_over=float, lost_share=float, transfer_share=float),
    )  # fmt: skip


def configure(control: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill `layout`, except its trim (loop/assembly.py), and `allocation` of a law's record; travel (2, n)
    rad."""
    layout = control["layout"]
    aircraft = declared.aircraft
    fill(
        layout, low=travel[0], high=travel[1], main=main_surface_index_by_axis(aircraft),
        stand_in=aircraft.surfaces.index(aircraft.stand_ins[0]) if aircraft.stand_ins else -1,
        is_backup=[surface in aircraft.stand_ins for surface in aircraft.surfaces],
        general=_is_general(aircraft),
    )  # fmt: skip
    layout["authority"] = authority_shares(declared, layout)
    step = control["reference"]["config"]["dt"] / declared.control.hand_over_s
    control["allocation"]["config"]["hand_over_step"] = step


def _is_general(aircraft: Aircraft) -> bool:
    """Whether there are more surfaces than those that lead an axis and the first stand-in, or one surface
    leads two axes."""
    several = aircraft.n > len(aircraft.primary) + min(len(aircraft.stand_ins), 1)
    return several or len(aircraft.primary) < len(AXES)


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
    axes.demand[i] = demand
    axes.hold[i] = hold
    axes.disturbance[i] = disturbance


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
    G = axes.G
    u = output.command
    a = layout.main[ROLL]
    r = layout.main[YAW]
    roll = axes.demand[ROLL]
    yaw = axes.demand[YAW]
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

        u_f = trim_f + share ((demand - trimmed) / G_f - trim_f) + probe
        trimmed = G_e / effectiveness trim_e
        u_e = (demand - G_f u_f) / G_e

    An elevator that is given up (G_e = 0) leaves the flap the whole demand. G_e, G_f: of pitch, rad/s2 per
    rad, with the effectiveness of each surface in it; effectiveness: of the elevator; probe: rad of the flap.
    """
    G = axes.G
    u = output.command
    demand = axes.demand[PITCH]
    e = layout.main[PITCH]
    f = layout.stand_in
    if f >= 0:
        trimmed = divide(G[PITCH, e], effectiveness) * layout.trim[e]
        flap = layout.trim[f] + share * (divide(demand - trimmed, G[PITCH, f]) - layout.trim[f])
        u[f] = clip(output, layout, f, flap + probe)
        demand -= G[PITCH, f] * u[f]
    u[e] = clip(output, layout, e, divide(demand, G[PITCH, e]))


@kernel
def allocate(axes, output, layout, effectiveness, share, probe):
    """Fill the command (n,) rad for axes.demand (3,) rad/s2; effectiveness (n,); share, probe: see
    `pitch`."""
    lateral(axes, output, layout)
    pitch(axes, output, layout, effectiveness[layout.main[PITCH]], share, probe)


@kernel
def spill_to_flap(axes, output, layout):
    """Give the flap the part of the pitch demand that an elevator at its stop does not give:

        u_f = (demand - G_e u_e) / G_f        if the elevator is saturated

    If the elevator is jammed or too weak, the observer of the law finds what it does not do, and the law
    demands more than it can give. The flap need not wait until the fault is named.
    """
    G = axes.G
    u = output.command
    e = layout.main[PITCH]
    f = layout.stand_in
    if f >= 0 and output.saturated[e]:
        shortfall = axes.demand[PITCH] - G[PITCH, e] * u[e]
        u[f] = clip(output, layout, f, divide(shortfall, G[PITCH, f]))


@kernel
def park(output, layout, parked):
    """Command each surface that is `parked` (n,) to its trim."""
    for s in range(layout.trim.size):
        if parked[s]:
            output.command[s] = layout.trim[s]
            output.saturated[s] = 0


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

        hand_over <- hand_over + step, at_once at least 1 - remains      if reallocated
        hand_over <- hand_over - step                                    otherwise; within 0 and 1
        lost_share = 1 - remains, or 1 if remains < least        if reallocated, or if nothing remains
        transfer_share = smoothstep(hand_over) lost_share        smoothstep(1) if nothing remains

    at_once: whether hand_over starts at the lost part, 1 - remains, as after a jam. remains: remaining share
    of the authority in pitch (`authority.remaining`). Else lost_share stays while pitch is handed back: the
    estimate of the main surface may return to 1 in one frame, but the command must not jump.
    """
    output = allocation.output
    step = allocation.config.hand_over_step
    output.hand_over = min(max(output.hand_over + (step if reallocated else -step), 0.0), 1.0)
    if reallocated and at_once:
        output.hand_over = max(output.hand_over, 1.0 - remains)
    progress = output.hand_over if remains > 0.0 else 1.0
    if reallocated or remains <= 0.0:
        output.lost_share = 1.0 - remains if remains >= least else 1.0
    output.transfer_share = smoothstep(progress) * output.lost_share


@kernel
def take_command(output, layout, deflections):
    """Take a command (n,) rad from outside, within the travel of each surface."""
    for s in range(deflections.size):
        output.command[s] = clip(output, layout, s, deflections[s])
