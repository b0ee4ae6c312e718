"""Feedback linearisation with proportional-integral feedback [Zhang2005, sec. V].

    demand = xm' + Kp e + Ki int e - f - fhat,    e = xm - x,    then G u = demand

The published laws share it; they differ in fhat, in the effectiveness they believe and in who carries the
demand.
"""

from beaver_ftc.compiled import kernel, record

# Gains 1/s, 1/s2; the integral of the error, rad; fhat, what the unknown is taken for, rad/s2.
FEEDBACK = record(Kp=float, Ki=float, integral=3, fhat=3)


@kernel
def demand(feedback, axes, reference, x, f):
    """Fill axes.demand (3,) rad/s2: what the surfaces must give. x (3,) rad/s; f (3,) rad/s2."""
    fhat = feedback.fhat
    for i in range(3):
        error = reference.governed_rate[i] - x[i]
        pulled = feedback.Kp * error + feedback.Ki * feedback.integral[i]
        axes.demand[i] = reference.governed_acceleration[i] + pulled - f[i] - fhat[i]
        axes.hold[i] = -f[i] - fhat[i]


@kernel
def integrate(feedback, axes, reference, allocation, x):
    """Advance the integrators; what the limited surfaces could not give is taken back (anti-windup).

    x (3,) rad/s. The back-calculation gain 1/Kp unwinds within one closed-loop time constant.
    """
    G, u = allocation.G, allocation.command
    for i in range(3):
        given = 0.0
        for s in range(u.size):
            given += G[i, s] * u[s]
        error = reference.governed_rate[i] - x[i]
        feedback.integral[i] += reference.dt * (error + (given - axes.demand[i]) / feedback.Kp)
