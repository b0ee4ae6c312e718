"""Lost authority: what the surfaces that are left can give, and a reference bent to it.

The attainable moment set is the image of the travels under G, with what is given up and what is off already
in it [Durham1993]; here the interval it spans on each axis. A demand outside it no law can meet.

Two things then happen to the reference. It is hedged [Johnson2000]: what was demanded and could not be given
is taken off the reference model's acceleration, so that model and integrator wait for the aircraft instead of
winding up. And it is scaled: following only the half of a swing that is within reach would ratchet the
attitude, so what is missed on one side is asked for on neither.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.control.reference_model import advance

MISSED_RAD_S = 0.1  # a rate missed in all by this much: the reference is given up
RECOVERY_S = 30.0  # and asked for again within this time: several periods of a slow reference


@kernel
def attainable(G, low, high, i):
    """Least and greatest acceleration of axis i (rad/s2) for deflections from low to high (n,) rad."""
    least, greatest = 0.0, 0.0
    for s in range(low.size):
        one, other = G[i, s] * low[s], G[i, s] * high[s]
        least += min(one, other)
        greatest += max(one, other)
    return least, greatest


@kernel
def note_shortfall(control, G, u):
    """What was demanded and is not given by u (n,) rad; and whether the rates could at least be held."""
    for i in range(3):
        given = 0.0
        for s in range(u.size):
            given += G[i, s] * (u[s] + control.lag[s])
        control.shortfall[i] = control.demand[i] - given
        least, greatest = attainable(G, control.low, control.high, i)
        control.beyond[i] = not least <= control.hold[i] <= greatest


@kernel
def govern(control, reference):
    """Bring the reference the law follows to the next frame; reference (3,) rad/s as commanded."""
    if not control.hedging:
        control.governed_rate[:] = control.model_rate
        control.governed_acceleration[:] = control.model_acceleration
        return
    for i in range(3):
        scale = control.reference_scale[i] - control.dt * abs(control.shortfall[i]) / MISSED_RAD_S
        if not control.steered:  # outer loops ask again for what was missed
            control.reference_scale[i] = max(scale + control.dt / RECOVERY_S * (1.0 - scale), 0.0)
        rate, acceleration = control.governed_rate[i], control.governed_acceleration[i]
        rate, acceleration = advance(control, rate, acceleration, control.reference_scale[i] * reference[i])
        control.governed_rate[i] = rate - control.dt * control.shortfall[i]
        control.governed_acceleration[i] = acceleration
