"""Effectiveness of the surface that leads an axis, from the innovation of the default law's observer.

A surface with effectiveness 1 + theta gives theta G u more than a healthy one. theta is the least-squares fit
of G u, as the observer filters it (psi), to the innovation e of an observer that assumes a healthy surface
[Ljung1999, ch. 13: a prediction error in a closed loop]:

    theta = (sum psi e + lam (diagnosed - 1)) / (sum psi^2 + lam),   lam = mean e^2 / UNSURE^2

The last MEMORY_S count; lam is the weight of the effectiveness `diagnosed`. An equation error in a closed
loop estimates a surface as weaker than it is, since the command answers the gust that hides it. This estimate
errs the other way, with what the gyro's noise commands. The law uses the larger of both: a loop is then no
faster than its margins allow.
"""

from math import exp

from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.laws.effectiveness_estimator import observer_response
from beaver_ftc.diagnosis.state import PITCH

MEMORY_S = 5.0  # of the effectiveness seen by the observer: a slow reference's swing
UNSURE = 0.2  # standard deviation of the diagnosis' estimate that is assumed: it settles the start
# An effectiveness below it counts as a lost surface: half of the default `least_effectiveness`, whatever a
# scenario sets
NOTHING_LEFT = 0.05

# Of the main surface of each axis, fading sums over frames: of psi e, psi^2 and e^2, (rad/s)^2, and of 1.
# named: whether the diagnosis has ever named it.
SUMS = record(product=3, square=3, innovation=3, frames=3, named=(int, 3))


def derive_fading(dt_s: float) -> float:
    """Share of the past that is forgotten in a frame of dt_s seconds."""
    return 1.0 - exp(-dt_s / MEMORY_S)


@kernel
def is_replaced(layout, s):
    """Whether another surface can take the place of surface s."""
    return s == layout.main[PITCH] or s == layout.stand_in


@kernel
def clamp_to_observer_estimate(sums, layout, s, target, least):
    """Effectiveness of surface s: of a loss reported as `target`, of a main surface that nothing replaces, no
    less than the observer sees. least: of the effectiveness that is used."""
    for i in range(3):
        if s == layout.main[i] and target < 1.0 and not is_replaced(layout, s):
            forget_health(sums, i)
            target = larger_estimate(sums, target, i, least)
    return target


@kernel
def forget_health(sums, i):
    """At the first naming of the main surface of axis i, what was seen of it when healthy no longer
    counts."""
    if not sums.named[i]:
        sums.named[i], sums.product[i], sums.square[i] = 1, 0.0, 0.0


@kernel
def larger_estimate(sums, diagnosed, i, least):
    """The larger of both estimates of the main surface of axis i, `diagnosed` and the observer's.

    A law gives up a surface below `least`. If both estimates are below NOTHING_LEFT, the larger is returned
    as it is. From NOTHING_LEFT on it is raised to `least`, so that the law keeps a weak surface in use.
    """
    larger = max(diagnosed, min(effectiveness_seen(sums, i, diagnosed), 1.0))
    return larger if larger < NOTHING_LEFT else max(larger, least)


@kernel
def effectiveness_seen(sums, i, diagnosed):
    """Effectiveness of the main surface of axis i by the observer, 1 + theta:

        theta = (sum psi e + lam (diagnosed - 1)) / (sum psi^2 + lam),    lam = sum e^2 / frames / UNSURE^2

    diagnosed: by the diagnosis, which is returned while nothing has been seen.
    """
    if sums.frames[i] == 0.0:
        return diagnosed
    prior = sums.innovation[i] / sums.frames[i] / (UNSURE * UNSURE)
    weight = sums.square[i] + prior
    return 1.0 + (sums.product[i] + prior * (diagnosed - 1.0)) / weight if weight > 0.0 else diagnosed


@kernel
def is_effective(sums, main, s, least):
    """Whether the law's observer sees surface s act, enough to be divided by: theta = product / square
    exceeds least - 1. False for a surface that leads no axis. main (3,); least: of the effectiveness."""
    for i in range(3):
        if s == main[i] and sums.product[i] > (least - 1.0) * sums.square[i]:
            return True
    return False


@kernel
def accumulate(config, memory, i, effectiveness, moment, innovation):
    """Add this frame to the sums of axis i, sum <- sum + term - fading sum, for psi e, psi^2, e^2 and 1.

    psi, e, rad/s: the observer's answers to moment and to innovation + (effectiveness - 1) moment; innovation
    rad/s: of the law's observer; effectiveness: that the law assumes, of the main surface; moment: G u of a
    healthy one, rad/s2.
    """
    sums, fading, dt = memory.sums, config.fading, config.dt
    L_rate, L_disturbance = memory.L_rate[i], memory.L_disturbance[i]
    assumed = (effectiveness - 1.0) * moment
    psi = observer_response(memory.healthy, i, moment, L_rate, L_disturbance, dt)
    e = innovation + observer_response(memory.assumed, i, assumed, L_rate, L_disturbance, dt)
    sums.product[i] += psi * e - fading * sums.product[i]
    sums.square[i] += psi * psi - fading * sums.square[i]
    sums.innovation[i] += e * e - fading * sums.innovation[i]
    sums.frames[i] += 1.0 - fading * sums.frames[i]
