"""From demanded angular accelerations to surfaces: lateral pair, elevator, the hand-over from elevator to
flap, the probe that moves both against each other; and what the surfaces can give at all.

The attainable moment set is the image of the travels under G, with what is given up and what is off already
in it [Durham1993]; here the interval it spans on each axis. A demand outside it no law can meet.

Where more surfaces move than one an axis and a stand-in, least squares with limits and rates take the place
of these few lines (least_squares.py); the hand-over is there a matter of how willingly each moves.

The probe is active diagnosis: a healthy aircraft feels nothing of it. The flap goes down and back by
(1 - cos) / 2; the allocation gives the elevator what the flap does not leave. A surface that does not follow
then shows.
"""

from math import pi, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.control import least_squares
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW, leaders_of
from beaver_ftc.scenario.control import ControlConfig
from beaver_ftc.scenario.diagnosis import Probing

# Of each axis, rad/s2: what is demanded, what of it only holds the rates, what of it was not given; and
# whether not even the rates can be held.
AXES = record(demand=3, hold=3, shortfall=3, beyond=(int, 3))

RELUCTANT, TINY = 1e-4, 1e-300  # how willingly a stand-in moves that is not asked, beside the others

# deflection rad of the flap, by step rad of phase a frame; frames: how many at most, 0 for no probe at all;
# probed: those of the present movement.
PROBE = record(
    amplitude=float, step=float, frames=int, deflection=float, probed=int, from_s=float, to_s=float,
)  # fmt: skip


@sized
def layout_dtype(n: int) -> np.dtype:
    """n surfaces: the one that leads each axis, who stands in for pitch's, or -1; trim and stops, rad. aside:
    which of them wait until pitch is handed over; authority: what part of the authority about each axis is
    whose, those aside without part in pitch; beside: the least and the greatest that engines give about each
    axis, rad/s2. general: there are more than lead or stand in first."""
    return record(
        main=(int, 3),
        stand_in=int,
        trim=n,
        low=n,
        high=n,
        general=int,
        aside=(int, n),
        authority=(3, n),
        beside=(2, 3),
    )


@sized
def allocation_dtype(n: int) -> np.dtype:
    """n surfaces: effectiveness matrix with what is believed of each in it; the command, rad, and which stand
    at a stop; how far pitch is handed over, and by how much that changes in a frame; the least squares."""
    return record(
        G=(3, n), command=n, saturated=(int, n), hand_over=float, hand_over_step=float,
        problem=problem_dtype(n),
    )  # fmt: skip


def configure(control: np.void, config: ControlConfig, travel: np.ndarray, aircraft: Aircraft) -> None:
    """Fill `layout` and `allocation` of a law's record; travel (2, n) rad."""
    layout = control["layout"]
    layout["low"], layout["high"] = travel
    layout["main"], layout["stand_in"] = leaders_of(aircraft), _stand_in(aircraft)
    layout["aside"] = [surface in aircraft.stand_ins for surface in aircraft.surfaces]
    layout["authority"], layout["general"] = _authority(aircraft, layout), _is_general(aircraft)
    control["allocation"]["hand_over_step"] = control["reference"]["dt"] / config.hand_over_s


def configure_probe(probe: np.void, probing: Probing | None, dt: float) -> None:
    """Fill the record (dtype PROBE) for frames of dt s."""
    if probing is not None:
        probe["amplitude"] = radians(probing.amplitude_deg)
        probe["step"] = 2.0 * pi * probing.frequency_hz * dt
        probe["frames"] = round(probing.duration_s / dt)
        probe["from_s"] = probe["to_s"] = -1.0


def _stand_in(aircraft: Aircraft) -> int:
    """The surface that takes over from the one that leads pitch, or -1."""
    return aircraft.surfaces.index(aircraft.stand_ins[0]) if aircraft.stand_ins else -1


def _is_general(aircraft: Aircraft) -> bool:
    """Whether there are more surfaces than lead an axis or stand in for pitch's leader first."""
    return aircraft.n > len(aircraft.primary) + min(len(aircraft.stand_ins), 1)


def _authority(aircraft: Aircraft, layout: np.void) -> np.ndarray:
    """(3, n): what part of the authority about each axis is whose, of the surfaces that turn most about it;
    where one leads each, it has all."""
    shares = np.zeros((3, aircraft.n))
    if not _is_general(aircraft):
        shares[range(3), layout["main"]] = 1.0
        return shares
    for s, (surface, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
        if axis != PITCH or not layout["aside"][s]:
            travel = aircraft.travel[surface]
            shares[axis, s] = abs(aircraft.effect[surface][axis]) * (travel.max_rad - travel.min_rad)
    return shares / shares.sum(axis=1, keepdims=True)


@kernel
def remaining(layout, effectiveness, i):
    """What part of the authority about axis i is left; effectiveness (n,)."""
    left = 0.0
    for s in range(effectiveness.size):
        left += layout.authority[i, s] * effectiveness[s]
    return left


@kernel
def clip(allocation, layout, s, deflection):
    """Limit a deflection (rad) to the travel of surface s and note saturation."""
    limited = min(max(deflection, layout.low[s]), layout.high[s])
    allocation.saturated[s] = limited != deflection
    return limited


@kernel
def divide(moment, effectiveness):
    """moment / effectiveness; a surface given up (no effectiveness left) is not asked for anything."""
    return moment / effectiveness if effectiveness != 0.0 else 0.0


@kernel
def lateral(allocation, layout, demand):
    """Aileron and rudder for the roll and yaw demand; when one saturates the other makes the best of its
    own axis."""
    G, u = allocation.G, allocation.command
    a, r = layout.main[ROLL], layout.main[YAW]
    roll, yaw = demand[ROLL], demand[YAW]
    determinant = G[ROLL, a] * G[YAW, r] - G[ROLL, r] * G[YAW, a]
    u[a] = clip(allocation, layout, a, divide(roll * G[YAW, r] - yaw * G[ROLL, r], determinant))
    u[r] = clip(allocation, layout, r, divide(yaw - G[YAW, a] * u[a], G[YAW, r]))
    u[a] = clip(allocation, layout, a, divide(roll - G[ROLL, r] * u[r], G[ROLL, a]))


@kernel
def smooth(share):
    """3 s^2 - 2 s^3: from 0 to 1 with no kink at either end."""
    return share * share * (3.0 - 2.0 * share)


@kernel
def pitch(allocation, layout, needed, effectiveness, share, probe):
    """Elevator and flap for the pitch demand `needed`, rad/s2.

    Before the hand-over (share 0) the elevator carries all. After it (1), the elevator holds its trimmed
    moment, the flap carries what moves, and what the flap's short upward travel cannot give goes back to what
    is left of the elevator. Without a flap the elevator carries what it can. effectiveness: of the elevator;
    probe: rad of the flap.
    """
    G, u = allocation.G, allocation.command
    e, f = layout.main[PITCH], layout.stand_in
    if f >= 0:
        hold = divide(G[PITCH, e], effectiveness) * layout.trim[e]
        flap = layout.trim[f] + share * (divide(needed - hold, G[PITCH, f]) - layout.trim[f])
        u[f] = clip(allocation, layout, f, flap + probe)
        needed -= G[PITCH, f] * u[f]
    u[e] = clip(allocation, layout, e, divide(needed, G[PITCH, e]))


@kernel
def allocate(allocation, layout, demand, effectiveness, share, probe):
    """Fill the command (n,) rad for a demand (3,) rad/s2; effectiveness (n,); the rest: see `pitch`."""
    lateral(allocation, layout, demand)
    pitch(allocation, layout, demand[PITCH], effectiveness[layout.main[PITCH]], share, probe)


@kernel
def set_problem(allocation, layout, effectiveness, belief, share, probe):
    """Say where the surfaces may go within a frame, where they had rather be, and how willingly they leave
    that; effectiveness (n,); share, probe: as in `pitch`.

    A stand-in gives `share` of what pitch demands beyond the trimmed moments: of two that move pitch alone
    that is the published hand-over. A probe is held, and the others give what it does not leave.
    """
    problem, own, waiting, u = allocation.problem, 0.0, 0.0, belief.u
    for s in range(u.size):
        reach = belief.actuators.step[s] / belief.share
        half, left = 0.5 * (layout.high[s] - layout.low[s]), effectiveness[s]
        hold = layout.trim[s] / left if left > 0.0 else layout.trim[s]
        problem.preferred[s] = min(max(hold, layout.low[s]), layout.high[s])
        problem.willing[s] = half * half
        problem.low[s] = min(max(layout.low[s], u[s] - reach), layout.high[s])
        problem.high[s] = max(min(layout.high[s], u[s] + reach), problem.low[s])
        moment = half * half * allocation.G[PITCH, s] ** 2
        own, waiting = own + (0.0 if layout.aside[s] else moment), waiting + moment * layout.aside[s]
    ratio = share * own / max((1.0 - share) * waiting, TINY)
    for s in range(u.size):
        if layout.aside[s]:
            problem.willing[s] *= min(max(ratio, RELUCTANT), 1.0 / RELUCTANT)
    if probe != 0.0 and layout.stand_in >= 0:
        f = layout.stand_in
        held = min(max(layout.trim[f] + probe, problem.low[f]), problem.high[f])
        problem.preferred[f] = problem.low[f] = problem.high[f] = held


@apart
def allocate_generally(allocation, layout, surfaces, axes, belief, share, probe):
    """Fill the command (n,) rad for any number of surfaces, within stops and rates (least_squares.py).

    axes: of dtype AXES; share, probe: as in `pitch`. With several elevators the stand-ins take over no
    more than what they have lost.
    """
    left = remaining(layout, surfaces.effectiveness, PITCH)
    if layout.authority[PITCH, layout.main[PITCH]] < 1.0:
        share = min(share, 1.0 - left)
    set_problem(allocation, layout, surfaces.effectiveness, belief, share, probe)
    least_squares.solve(allocation.problem, allocation.G, axes.demand)
    for s in range(allocation.command.size):
        allocation.command[s] = allocation.problem.u[s]
        at = allocation.problem.at[s]
        stop = layout.low[s] if at < 0 else layout.high[s]
        allocation.saturated[s] = at != 0 and allocation.problem.u[s] == stop


@kernel
def relieve(allocation, layout, demand):
    """Give the flap what an elevator at its stop leaves of the pitch demand (rad/s2), as allocated.

    The observer has by then found what the elevator does not do, jammed or too weak, and asked it for more
    than it can give: the flap need not wait until that has a name.
    """
    G, u = allocation.G, allocation.command
    e, f = layout.main[PITCH], layout.stand_in
    if f >= 0 and allocation.saturated[e]:
        u[f] = clip(allocation, layout, f, divide(demand - G[PITCH, e] * u[e], G[PITCH, f]))


@kernel
def advance_hand_over(allocation, reallocated, at_once, lost):
    """Hand the pitch demand to the flap, or back, as soon as nothing is `reallocated` any more, by the same
    step. `at_once`: the share that is lost, by a jam."""
    if reallocated:
        allocation.hand_over = min(allocation.hand_over + allocation.hand_over_step, 1.0)
        if at_once:
            allocation.hand_over = max(allocation.hand_over, lost)
    else:
        allocation.hand_over = max(allocation.hand_over - allocation.hand_over_step, 0.0)


@kernel
def attainable(G, layout, i):
    """Least and greatest acceleration of axis i, rad/s2, within the travel; G (3, n)."""
    least, greatest = layout.beside[0, i], layout.beside[1, i]
    for s in range(layout.low.size):
        one, other = G[i, s] * layout.low[s], G[i, s] * layout.high[s]
        least += min(one, other)
        greatest += max(one, other)
    return least, greatest


@kernel
def note_shortfall(axes, allocation, layout, lag):
    """What was demanded and is not given; and whether the rates could at least be held. lag (n,) rad: of
    surfaces behind their command."""
    G, u = allocation.G, allocation.command
    for i in range(3):
        given = 0.0
        for s in range(u.size):
            given += G[i, s] * (u[s] + lag[s])
        axes.shortfall[i] = axes.demand[i] - given
        least, greatest = attainable(G, layout, i)
        axes.beyond[i] = not least <= axes.hold[i] <= greatest


@kernel
def advance_probe(probe, wanted, t):
    """Bring the probe to the next frame, t s: begin when wanted, end with the movement when no longer."""
    if probe.probed == 0:
        if not wanted or probe.from_s >= 0.0:
            return
        probe.from_s = t
    phase = probe.step * probe.probed
    at_rest = phase % (2.0 * np.pi) < probe.step
    if probe.probed > 0 and at_rest and (not wanted or probe.probed >= probe.frames):
        probe.deflection, probe.probed, probe.to_s = 0.0, 0, t
        return
    probe.deflection = 0.5 * probe.amplitude * (1.0 - np.cos(phase))
    probe.probed += 1


@kernel
def take_command(allocation, layout, deflections):
    """Take a plug-in's command (n,) rad, within the travel of each surface."""
    for s in range(deflections.size):
        allocation.command[s] = clip(allocation, layout, s, deflections[s])
