"""Inversion with a disturbance observer: gusts and model errors are rejected from the first frame on.

    z' = f + G u + d + 2 w (x - z),   d' = w^2 (x - z)                 [Han2009, Chen2016]
    demand = xm' + Kp (xm - x+) - f - d,                                then G u = demand

d is what the model does not explain: rotation of the air, wrong coefficients, a fault nobody has named yet.
u is where the actuators are, not what they were told, so that neither their lag nor their stops is taken
for a disturbance: there is nothing that could wind up. x+ is the rate at the instant from which the command
acts, one JSBSim frame from now, and xm is taken there too.

Discrete: z and d are corrected by `pull` = 1 - e^{-2 w dt} and `learn` = (1 - e^{-w dt})^2 / dt of what the
observer missed. gains.py derives w, Kp and the lead.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.control.laws import left
from beaver_ftc.control.laws.state import PITCH, STAND_IN
from beaver_ftc.control.reference_model import advance
from beaver_ftc.design.model import QDYN

PATIENCE_S, LONG_PATIENCE_S, RETRY_S = 0.5, 1.0, 20.0


@kernel
def schedule(rejection, qdyn):
    """Gains for a dynamic pressure (Pa), held beyond the ends of the table; pitch also for who carries it."""
    points = rejection.qdyn
    last = points.size - 1
    j = 0
    while j < last - 1 and qdyn > points[j + 1]:
        j += 1
    part = min(max((qdyn - points[j]) / (points[j + 1] - points[j]), 0.0), 1.0)
    for i in range(3):
        rejection.Kp[i] = between(rejection.Kp_at, i, j, part)
        rejection.pull[i] = between(rejection.pull_at, i, j, part)
        rejection.learn[i] = between(rejection.learn_at, i, j, part)
    lost = rejection.lost
    if lost > 0.0:
        rejection.Kp[PITCH] += lost * (between(rejection.Kp_at, STAND_IN, j, part) - rejection.Kp[PITCH])
        rejection.pull[PITCH] += lost * (
            between(rejection.pull_at, STAND_IN, j, part) - rejection.pull[PITCH]
        )
        learn = between(rejection.learn_at, STAND_IN, j, part)
        rejection.learn[PITCH] += lost * (learn - rejection.learn[PITCH])


@kernel
def between(table, i, j, part):
    """Row i of a table, `part` of the way from point j to the next."""
    return table[i, j] + part * (table[i, j + 1] - table[i, j])


@kernel
def hand_over(control, remains):
    """The share of pitch its stand-in carries, once handed over: what the main surface has lost."""
    given = control.hand_over if remains > 0.0 else 1.0
    lost = 1.0 - remains if remains >= control.least_effectiveness else 1.0
    control.rejection.lost = given * given * (3.0 - 2.0 * given) * lost


@kernel
def is_replaced(control, s):
    """Whether another surface can take the place of surface s."""
    return s == control.main[PITCH] or s == control.stand_in


@kernel
def hesitate(control, s):
    """Take a loss of a surface that nothing replaces for no larger than the observer sees it."""
    for i in range(3):
        if s == control.main[i] and control.target[s] < 1.0 and not is_replaced(control, s):
            left.hesitate(control, s, i)


@kernel
def acts(control, s):
    """Whether the law's observer sees surface s act."""
    for i in range(3):
        if s == control.main[i] and left.acts(control, i):
            return True
    return False


@kernel
def abandon(control, s, suspected):
    """Give up surface s if it is suspected of a fault and has stood at its stop for a while.

    It does not give what it is told, and at its stop it is told nothing that would show why: jams, offsets
    and losses look alike. In trim it shows; where another takes its place, it is tried again after RETRY_S.
    """
    rejection = control.rejection
    rejection.at_stop_s[s] += control.dt
    if not suspected:
        rejection.abandoned[s], rejection.at_stop_s[s] = 0, 0.0
    elif rejection.abandoned[s]:
        if rejection.at_stop_s[s] > RETRY_S and is_replaced(control, s):
            rejection.abandoned[s], rejection.at_stop_s[s] = 0, 0.0
    elif not control.saturated[s]:
        rejection.at_stop_s[s] = max(rejection.at_stop_s[s] - 1.5 * control.dt, 0.0)  # a dead one swings
    elif rejection.at_stop_s[s] > (PATIENCE_S if is_replaced(control, s) else LONG_PATIENCE_S):
        rejection.abandoned[s], rejection.at_stop_s[s] = 1, 0.0
    if rejection.abandoned[s]:
        control.target[s] = control.effectiveness[s] = 0.0


@kernel
def explained(control, i, design, given, G):
    """Acceleration of axis i that the law believes in, rad/s2: the design model's with the faults in it."""
    total = design[i]
    for s in range(G.shape[1]):
        total += (control.effectiveness[s] - 1.0) * given[i, s] + G[i, s] * control.offset[s]
    return total


@kernel
def observe(control, x, design, given, G):
    """Bring rate and disturbance to this frame: x (3,) rad/s; design (3,) rad/s2, given, G (3, n): f + G u
    of healthy surfaces, their moments and effectiveness, means over the frame that has elapsed."""
    rejection = control.rejection
    if not rejection.begun:
        rejection.begun = 1
        rejection.rate[:] = x
        return
    for i in range(3):
        expected = explained(control, i, design, given, G) + rejection.disturbance[i]
        rejection.rate[i] += control.dt * expected
        missed = x[i] - rejection.rate[i]
        left.learn(control, i, given, missed)
        rejection.rate[i] += rejection.pull[i] * missed
        rejection.disturbance[i] += rejection.learn[i] * missed


@kernel
def demand(control, belief, measured):
    """Fill control.demand and control.hold (3,) rad/s2."""
    rejection, means = control.rejection, belief.means
    schedule(rejection, measured.y[QDYN])
    observe(control, measured.x, means.acceleration, means.Gu, means.G)
    for i in range(3):
        look_ahead(control, i, belief.f, belief.G, belief.u)
        target, after = targets(control, i, rejection.share)
        feedback = rejection.Kp[i] * (target - rejection.ahead[i])
        control.hold[i] = -belief.f[i] - rejection.disturbance[i]
        control.demand[i] = (after - target) / control.dt + feedback + control.hold[i]


@kernel
def look_ahead(control, i, f, G, u):
    """Rate of axis i when the command acts; f (3,), G (3, n), u (n,) rad: of this instant."""
    rejection = control.rejection
    now = f[i] + rejection.disturbance[i]
    for s in range(u.size):
        now += G[i, s] * (control.effectiveness[s] * u[s] + control.offset[s])
    rejection.ahead[i] = rejection.rate[i] + rejection.share * control.dt * now


@kernel
def targets(control, i, share):
    """The reference of axis i when the command acts, and a frame later, rad/s."""
    rate = control.governed_rate[i]
    wanted = control.reference_scale[i] * control.commanded_rate[i]
    following, acceleration = advance(control, rate, control.governed_acceleration[i], wanted)
    last, _ = advance(control, following, acceleration, wanted)
    return rate + share * (following - rate), following + share * (last - following)


@kernel
def hurry(control, u):
    """Command beyond what is wanted, so that a lagging actuator at u (n,) rad is there sooner."""
    lead = control.rejection.lead
    for s in range(u.size):
        if lead[s] > 1.0:
            command = u[s] + lead[s] * (control.command[s] - u[s])
            control.command[s] = min(max(command, control.low[s]), control.high[s])
