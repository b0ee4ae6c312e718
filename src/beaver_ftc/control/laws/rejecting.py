"""Inversion with a disturbance observer: gusts and model errors are rejected from the first frame on.

    z' = f + G u + d + 2 w (x - z),   d' = w^2 (x - z)                 [Han2009, Chen2016]
    demand = xm' + Kp (xm - x+) - f - d,                                then G u = demand

d is what the model does not explain: rotation of the air, wrong coefficients, a fault nobody has named yet.
u is where the actuators are, not what they were told, so that neither their lag nor their stops is taken
for a disturbance: there is nothing that could wind up. x+ is the rate at the instant from which the command
acts, one JSBSim frame from now, and xm is taken there too.

Discrete: z and d are corrected by `pull` = 1 - e^{-2 w dt} and `learn` = (1 - e^{-w dt})^2 / dt of what the
observer missed. gains.py derives w, Kp and the lead.

How much of a surface is left, the observer sees as well, in what it misses (answering.py). A surface with
effectiveness 1 + theta gives theta G u more than a healthy one: theta is the least-squares fit of that, so
filtered, to what was missed [Ljung1999, ch. 13: a prediction error in a closed loop]. The last MEMORY_S
count.

An equation error in a closed loop takes a surface for weaker than it is, since the command answers the gust
it is hidden in. This one errs the other way, with what the gyro's noise commands. The larger of both is
believed: a loop is then no faster than its margins allow.
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.control.laws import answering
from beaver_ftc.control.laws.answering import ANSWER, answer, answering_dtype
from beaver_ftc.control.reference import advance
from beaver_ftc.design.model import QDYN
from beaver_ftc.diagnosis.state import PITCH

N_POINTS = 5  # of the schedule over dynamic pressure
N_LOOPS, STAND_IN = 4, 3  # roll, pitch, yaw, and pitch by the surface that stands in
PATIENCE_S, LONG_PATIENCE_S, RETRY_S = 0.5, 1.0, 20.0
MEMORY_S = 5.0  # a slow reference's swing
UNSURE = 0.2  # standard deviation of the diagnosis' estimate reckoned with: it settles the start
NOTHING_LEFT = 0.05  # half of what the law divides by

# The sums of the least squares.
FOUND = record(fading=float, product=3, square=3, missed=3, frames=3, named=(int, 3))


@sized
def rejection_dtype(surfaces: int) -> np.dtype:
    """The law's record for an aircraft with so many surfaces.

    qdyn (N_POINTS,) Pa: the schedule's points, ascending. Kp 1/s, pull 1, learn 1/s (N_LOOPS, N_POINTS):
    feedback, and the observer's corrections of rate and disturbance for what it missed.
    rate (3,) rad/s, disturbance (3,) rad/s2: its estimates. ahead (3,) rad/s: the rate when the command
    acts. lost: share of pitch that the stand-in carries; part: the same once all is handed over. lead (n,):
    command beyond the actuator's position over what is wanted beyond it. at_stop_s, withdrawn (n,): see
    `withdraw`. missed (3,) rad/s: what the estimates were off.
    """
    return record(
        begun=int, dt=float, share=float, lost=float, part=float, qdyn=N_POINTS, Kp_at=(N_LOOPS, N_POINTS),
        pull_at=(N_LOOPS, N_POINTS), learn_at=(N_LOOPS, N_POINTS), Kp=3, pull=3, learn=3, rate=3,
        disturbance=3, ahead=3, lead=surfaces, at_stop_s=surfaces, withdrawn=(int, surfaces),
        healthy=ANSWER, believed=ANSWER, found=FOUND, missed=3, answering=answering_dtype(surfaces),
    )  # fmt: skip


def fading(dt_s: float) -> float:
    """Share of the past that goes in a frame of dt_s seconds."""
    return 1.0 - exp(-dt_s / MEMORY_S)


@kernel
def schedule(rejection, qdyn):
    """Gains for a dynamic pressure (Pa), held beyond the ends of the table; pitch also for who carries it."""
    points = rejection.qdyn
    last = points.size - 1
    j = 0
    while j < last - 1 and qdyn > points[j + 1]:
        j += 1
    part = min(max((qdyn - points[j]) / (points[j + 1] - points[j]), 0.0), 1.0)
    look_up(rejection.Kp, rejection.Kp_at, j, part, rejection.lost)
    look_up(rejection.pull, rejection.pull_at, j, part, rejection.lost)
    look_up(rejection.learn, rejection.learn_at, j, part, rejection.lost)


@kernel
def look_up(gains, table, j, part, lost):
    """Fill gains (3,) from a table; lost: the share of pitch that its stand-in carries."""
    for i in range(3):
        gains[i] = between(table, i, j, part)
    if lost > 0.0:
        gains[PITCH] += lost * (between(table, STAND_IN, j, part) - gains[PITCH])


@kernel
def between(table, i, j, part):
    """Row i of a table, `part` of the way from point j to the next."""
    return table[i, j] + part * (table[i, j + 1] - table[i, j])


@kernel
def hand_over(rejection, given, reallocated, remains, least):
    """The share of pitch its stand-in carries, once `given` is handed over: what the main surface has lost.

    remains: its effectiveness; less than `least` is none. While pitch is handed back, `reallocated` no
    longer, that of before counts: the main surface may be believed whole at once, and nothing is to leap.
    """
    given = given if remains > 0.0 else 1.0
    if reallocated or remains <= 0.0:
        rejection.part = 1.0 - remains if remains >= least else 1.0
    rejection.lost = given * given * (3.0 - 2.0 * given) * rejection.part


@kernel
def is_replaced(layout, s):
    """Whether another surface can take the place of surface s."""
    return s == layout.main[PITCH] or s == layout.stand_in


@kernel
def believe_larger(rejection, surfaces, layout, s):
    """Take a loss of a surface that nothing replaces for no larger than the observer sees it."""
    for i in range(3):
        if s == layout.main[i] and surfaces.target[s] < 1.0 and not is_replaced(layout, s):
            believe_larger_of(rejection.found, surfaces, s, i)


@kernel
def believe_larger_of(found, surfaces, s, i):
    """Believe the larger of both estimates of surface s, main one of axis i; nothing of it is nothing."""
    named = surfaces.target[s]
    if not found.named[i]:  # it is not what it was: what was seen before counts no longer
        found.named[i], found.product[i], found.square[i] = 1, 0.0, 0.0
    larger = max(named, min(effectiveness_seen(found, i, named), 1.0))
    least = surfaces.least_effectiveness
    surfaces.target[s] = larger if larger < NOTHING_LEFT else max(larger, least)


@kernel
def effectiveness_seen(found, i, named):
    """Effectiveness of the main surface of axis i; named: what the diagnosis takes it for."""
    if found.frames[i] == 0.0:
        return named
    prior = found.missed[i] / found.frames[i] / (UNSURE * UNSURE)
    weight = found.square[i] + prior
    return 1.0 + (found.product[i] + prior * (named - 1.0)) / weight if weight > 0.0 else named


@kernel
def acts(found, main, s, least):
    """Whether the law's observer sees surface s act, enough to be divided by; main (3,), least: of the
    effectiveness."""
    for i in range(3):
        if s == main[i] and found.product[i] > (least - 1.0) * found.square[i]:
            return True
    return False


@kernel
def withdraw(rejection, surfaces, layout, s, saturated, suspected):
    """Give up surface s if it is suspected of a fault and has stood at its stop for a while.

    It does not give what it is told, and at its stop it is told nothing that would show why: jams, offsets
    and losses look alike. In trim it shows; where another takes its place, it is tried again after RETRY_S.
    """
    rejection.at_stop_s[s] += rejection.dt
    if not suspected:
        rejection.withdrawn[s], rejection.at_stop_s[s] = 0, 0.0
    elif rejection.withdrawn[s]:
        if rejection.at_stop_s[s] > RETRY_S and is_replaced(layout, s):
            rejection.withdrawn[s], rejection.at_stop_s[s] = 0, 0.0
    elif not saturated:
        rejection.at_stop_s[s] = max(rejection.at_stop_s[s] - 1.5 * rejection.dt, 0.0)  # a dead one swings
    elif rejection.at_stop_s[s] > (PATIENCE_S if is_replaced(layout, s) else LONG_PATIENCE_S):
        rejection.withdrawn[s], rejection.at_stop_s[s] = 1, 0.0
    if rejection.withdrawn[s]:
        surfaces.target[s] = surfaces.effectiveness[s] = 0.0


@kernel
def look_for_losses(rejection, layout, detected):
    """Listen from the alarm on which surfaces answer, where more move than lead an axis or stand in."""
    if not (detected and layout.general and rejection.answering.found.size > 1):
        rejection.answering.listening = 0
    elif not rejection.answering.listening:
        answering.begin(rejection.answering, rejection.found.missed, rejection.found.frames, rejection.dt)


@kernel
def explained(surfaces, i, design, given, G):
    """Acceleration of axis i that the law believes in, rad/s2: the design model's with the faults in it."""
    total = design[i]
    for s in range(G.shape[1]):
        total += (surfaces.effectiveness[s] - 1.0) * given[i, s] + G[i, s] * surfaces.offset[s]
    return total


@kernel
def observe(rejection, surfaces, main, x, design, given, G):
    """Bring rate and disturbance to this frame: x (3,) rad/s; design (3,) rad/s2, given, G (3, n): f + G u
    of healthy surfaces, their moments and effectiveness, means over the frame that has elapsed."""
    if not rejection.begun:
        rejection.begun = 1
        rejection.rate[:] = x
        return
    for i in range(3):
        expected = explained(surfaces, i, design, given, G) + rejection.disturbance[i]
        rejection.rate[i] += rejection.dt * expected
        missed = rejection.missed[i] = x[i] - rejection.rate[i]
        learn(rejection, i, surfaces.effectiveness[main[i]], given[i, main[i]], missed)
        rejection.rate[i] += rejection.pull[i] * missed
        rejection.disturbance[i] += rejection.learn[i] * missed


@kernel
def learn(rejection, i, effectiveness, given, missed):
    """Take in what was missed of axis i, rad/s; effectiveness: believed of its main surface, given: moment
    of a healthy one, rad/s2."""
    found = rejection.found
    pull, into, dt = rejection.pull[i], rejection.learn[i], rejection.dt
    believed = (effectiveness - 1.0) * given
    psi = answer(rejection.healthy, i, given, pull, into, dt)
    missed += answer(rejection.believed, i, believed, pull, into, dt)
    found.product[i] += psi * missed - found.fading * found.product[i]
    found.square[i] += psi * psi - found.fading * found.square[i]
    found.missed[i] += missed * missed - found.fading * found.missed[i]
    found.frames[i] += 1.0 - found.fading * found.frames[i]


@kernel
def demand(rejection, axes, reference, surfaces, main, belief, measured):
    """Fill axes.demand and axes.hold (3,) rad/s2; main (3,): the surface that leads each axis."""
    means = belief.means
    schedule(rejection, measured.y[QDYN])
    observe(rejection, surfaces, main, measured.x, means.acceleration, means.Gu, means.G)
    if rejection.answering.listening:
        answering.listen(
            rejection.answering, rejection.missed, rejection.pull, rejection.learn, rejection.dt, measured.x,
            measured.y, surfaces.effectiveness, means.Gu,
        )  # fmt: skip
    for i in range(3):
        look_ahead(rejection, surfaces, i, belief.f, belief.G, belief.u)
        target, after = targets(reference, i, rejection.share)
        feedback = rejection.Kp[i] * (target - rejection.ahead[i])
        axes.hold[i] = -belief.f[i] - rejection.disturbance[i]
        axes.demand[i] = (after - target) / rejection.dt + feedback + axes.hold[i]


@kernel
def look_ahead(rejection, surfaces, i, f, G, u):
    """Rate of axis i when the command acts; f (3,), G (3, n), u (n,) rad: of this instant."""
    now = f[i] + rejection.disturbance[i]
    for s in range(u.size):
        now += G[i, s] * (surfaces.effectiveness[s] * u[s] + surfaces.offset[s])
    rejection.ahead[i] = rejection.rate[i] + rejection.share * rejection.dt * now


@kernel
def targets(reference, i, share):
    """The reference of axis i when the command acts, and a frame later, rad/s."""
    rate = reference.governed_rate[i]
    wanted = reference.scale[i] * reference.commanded_rate[i]
    following, acceleration = advance(reference, rate, reference.governed_acceleration[i], wanted)
    last, _ = advance(reference, following, acceleration, wanted)
    return rate + share * (following - rate), following + share * (last - following)


@kernel
def lead_actuators(rejection, layout, command, u):
    """Command (n,) rad beyond what is wanted, so that a lagging actuator at u (n,) rad is there sooner."""
    lead = rejection.lead
    for s in range(u.size):
        if lead[s] > 1.0:
            command[s] = min(max(u[s] + lead[s] * (command[s] - u[s]), layout.low[s]), layout.high[s])
