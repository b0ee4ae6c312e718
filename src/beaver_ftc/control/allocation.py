"""From demanded angular accelerations to surfaces: lateral pair, elevator, and the hand-over from elevator
to flap."""

from beaver_ftc.compiled import kernel
from beaver_ftc.control.laws.state import REJECTING
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW


@kernel
def clip(control, surface, deflection):
    """Limit a deflection (rad) to the surface's travel and note saturation."""
    limited = min(max(deflection, control.low[surface]), control.high[surface])
    control.saturated[surface] = limited != deflection
    return limited


@kernel
def divide(moment, effectiveness):
    """moment / effectiveness; a surface given up (no effectiveness left) is not asked for anything."""
    return moment / effectiveness if effectiveness != 0.0 else 0.0


@kernel
def lateral(control, G, u):
    """Aileron and rudder for the roll and yaw demand; when one saturates the other makes the best of its
    own axis."""
    a, r = control.main[ROLL], control.main[YAW]
    roll, yaw = control.demand[ROLL], control.demand[YAW]
    determinant = G[ROLL, a] * G[YAW, r] - G[ROLL, r] * G[YAW, a]
    u[a] = clip(control, a, divide(roll * G[YAW, r] - yaw * G[ROLL, r], determinant))
    u[r] = clip(control, r, divide(yaw - G[YAW, a] * u[a], G[YAW, r]))
    u[a] = clip(control, a, divide(roll - G[ROLL, r] * u[r], G[ROLL, a]))


@kernel
def smooth(share):
    """3 s^2 - 2 s^3: from 0 to 1 with no kink at either end."""
    return share * share * (3.0 - 2.0 * share)


@kernel
def pitch(control, G, u):
    """Elevator and flap for the pitch demand.

    Before the hand-over the elevator carries all. After it, the elevator holds its trimmed moment, the flap
    carries what moves, and what the flap's short upward travel cannot give goes back to what is left of the
    elevator. Without a flap the elevator carries what it can.
    """
    e, f = control.main[PITCH], control.stand_in
    needed = control.demand[PITCH]
    if f >= 0:
        share = control.rejection.lost if control.inner == REJECTING else smooth(control.hand_over)
        hold = divide(G[PITCH, e], control.effectiveness[e]) * control.trim[e]
        flap = control.trim[f] + share * (divide(needed - hold, G[PITCH, f]) - control.trim[f])
        u[f] = clip(control, f, flap + control.probe)
        needed -= G[PITCH, f] * u[f]
    u[e] = clip(control, e, divide(needed, G[PITCH, e]))


@kernel
def allocate(control, G, u):
    """Fill u (n,) rad for control.demand; G (3, n) rad/s2 per rad with the believed effectiveness in it."""
    lateral(control, G, u)
    pitch(control, G, u)


@kernel
def relieve(control, G, u):
    """Give the flap what an elevator at its stop leaves of the pitch demand; u (n,) rad as allocated.

    The observer has by then found what the elevator does not do, jammed or too weak, and asked it for more
    than it can give: the flap need not wait until that has a name.
    """
    e, f = control.main[PITCH], control.stand_in
    if f >= 0 and control.saturated[e]:
        u[f] = clip(control, f, divide(control.demand[PITCH] - G[PITCH, e] * u[e], G[PITCH, f]))
