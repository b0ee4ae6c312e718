"""From demanded angular accelerations to surfaces: lateral pair, elevator, and the hand-over from elevator
to flap."""

from beaver_ftc.compiled import kernel
from beaver_ftc.design.model import AILERON, ELEVATOR, FLAP, RUDDER


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
    roll, yaw = control.demand[0], control.demand[2]
    determinant = G[0, AILERON] * G[2, RUDDER] - G[0, RUDDER] * G[2, AILERON]
    aileron = divide(roll * G[2, RUDDER] - yaw * G[0, RUDDER], determinant)
    u[AILERON] = clip(control, AILERON, aileron)
    u[RUDDER] = clip(control, RUDDER, divide(yaw - G[2, AILERON] * u[AILERON], G[2, RUDDER]))
    u[AILERON] = clip(control, AILERON, divide(roll - G[0, RUDDER] * u[RUDDER], G[0, AILERON]))


@kernel
def smooth(share):
    """3 s^2 - 2 s^3: from 0 to 1 with no kink at either end."""
    return share * share * (3.0 - 2.0 * share)


@kernel
def pitch(control, G, u):
    """Elevator and flap for the pitch demand.

    Before the hand-over the elevator carries all. After it, the elevator holds its trimmed moment, the flap
    carries what moves, and what the flap's short upward travel cannot give goes back to what is left of the
    elevator.
    """
    needed = control.demand[1]
    share = smooth(control.hand_over)
    hold = divide(G[1, ELEVATOR], control.effectiveness[ELEVATOR]) * control.trim[ELEVATOR]
    flap = control.trim[FLAP] + share * (divide(needed - hold, G[1, FLAP]) - control.trim[FLAP])
    u[FLAP] = clip(control, FLAP, flap + control.probe)
    u[ELEVATOR] = clip(control, ELEVATOR, divide(needed - G[1, FLAP] * u[FLAP], G[1, ELEVATOR]))


@kernel
def allocate(control, G, u):
    """Fill u (4,) rad for control.demand; G (3, 4) rad/s2 per rad with the believed effectiveness in it."""
    lateral(control, G, u)
    pitch(control, G, u)
