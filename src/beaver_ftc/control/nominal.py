"""Feedback linearisation with proportional-integral feedback [Zhang2005, sec. V].

    demand = xm' + Kp e + Ki int e - f - fhat,    e = xm - x,    then G u = demand

All laws share it; they differ in fhat, in the effectiveness they believe and in who carries the demand.
"""

from beaver_ftc.compiled import kernel


@kernel
def demand(control, x, f, fhat):
    """Fill control.demand (3,) rad/s2: what the surfaces must give. x (3,) rad/s; f, fhat (3,) rad/s2."""
    for i in range(3):
        error = control.governed_rate[i] - x[i]
        feedback = control.Kp * error + control.Ki * control.integral[i]
        control.demand[i] = control.governed_acceleration[i] + feedback - f[i] - fhat[i]
        control.hold[i] = -f[i] - fhat[i]


@kernel
def integrate(control, x, G, u):
    """Advance the integrators; what the limited surfaces u (n,) rad could not give is taken back
    (anti-windup).

    G (3, n) includes the believed effectiveness. The back-calculation gain 1/Kp unwinds within one
    closed-loop time constant.
    """
    for i in range(3):
        given = 0.0
        for s in range(u.size):
            given += G[i, s] * u[s]
        error = control.governed_rate[i] - x[i]
        control.integral[i] += control.dt * (error + (given - control.demand[i]) / control.Kp)
