"""How much of a surface is left, as the law's observer sees it.

An acceleration a that the law does not reckon with shows in what its observer misses, through the observer's
own error dynamics

    e' = a - dd,   missed = e before correction,   e <- (1 - pull) missed,   dd <- dd + learn missed

which take out what changes slowly: gusts, wrong coefficients. A surface with effectiveness 1 + theta gives
theta G u more than a healthy one: theta is the least-squares fit of that, so filtered, to what was missed
[Ljung1999, ch. 13: a prediction error in a closed loop]. The last MEMORY_S count.

An equation error in a closed loop takes a surface for weaker than it is, since the command answers the gust
it is hidden in. This one errs the other way, with what the gyro's noise commands. The larger of both is
believed: a loop is then no faster than its margins allow.
"""

from math import exp

from beaver_ftc.compiled import kernel

MEMORY_S = 5.0  # a slow reference's swing
UNSURE = 0.2  # standard deviation of the diagnosis' estimate reckoned with: it settles the start
NOTHING_LEFT = 0.05  # half of what the law divides by


@kernel
def answer(memory, i, acceleration, pull, learn, dt):
    """What the observer misses in a frame for an acceleration (rad/s2) of axis i; memory: dtype ANSWER."""
    missed = memory.rate[i] + dt * (acceleration - memory.disturbance[i])
    memory.rate[i] = (1.0 - pull) * missed
    memory.disturbance[i] += learn * missed
    return missed


@kernel
def learn(control, i, given, missed):
    """Take in what was missed of axis i, rad/s; given (3, n) rad/s2: moments of healthy surfaces."""
    rejection = control.rejection
    found, s = rejection.found, control.main[i]
    pull, into, dt = rejection.pull[i], rejection.learn[i], control.dt
    believed = (control.effectiveness[s] - 1.0) * given[i, s]
    psi = answer(rejection.healthy, i, given[i, s], pull, into, dt)
    missed += answer(rejection.believed, i, believed, pull, into, dt)
    found.product[i] += psi * missed - found.fading * found.product[i]
    found.square[i] += psi * psi - found.fading * found.square[i]
    found.missed[i] += missed * missed - found.fading * found.missed[i]
    found.frames[i] += 1.0 - found.fading * found.frames[i]


@kernel
def left_of(control, i, named):
    """Effectiveness of the main surface of axis i; named: what the diagnosis takes it for."""
    found = control.rejection.found
    if found.frames[i] == 0.0:
        return named
    prior = found.missed[i] / found.frames[i] / (UNSURE * UNSURE)
    weight = found.square[i] + prior
    return 1.0 + (found.product[i] + prior * (named - 1.0)) / weight if weight > 0.0 else named


@kernel
def acts(control, i):
    """Whether the main surface of axis i gives enough to be divided by."""
    found = control.rejection.found
    return found.product[i] > (control.least_effectiveness - 1.0) * found.square[i]


@kernel
def hesitate(control, s, i):
    """Believe the larger of both estimates of surface s, main one of axis i; nothing of it is nothing."""
    named, found = control.target[s], control.rejection.found
    if not found.named[i]:  # it is not what it was: what was seen before counts no longer
        found.named[i], found.product[i], found.square[i] = 1, 0.0, 0.0
    left = max(named, min(left_of(control, i, named), 1.0))
    control.target[s] = left if left < NOTHING_LEFT else max(left, control.least_effectiveness)


def fading(dt_s: float) -> float:
    """Share of the past that goes in a frame of dt_s seconds."""
    return 1.0 - exp(-dt_s / MEMORY_S)
