"""Effectiveness of the surface that leads an axis, from the innovation of the law's observer.

A surface with effectiveness 1 + theta gives theta G u more than a healthy one. theta is the least-squares fit
of psi, the observer's answer to G u, to the innovation e of an observer that assumes a healthy surface
[Ljung1999, ch. 13: a prediction error in a closed loop]:

    theta = (sum psi e + lam (diagnosed - 1)) / (sum psi^2 + lam),   lam = mean e^2 / UNSURE^2

    e, psi      rad/s            innovation, and answer to G u, of one axis
    G u         rad/s2           angular acceleration by the healthy surface
    lam         (rad/s)^2        weight of the diagnosis' estimate
    diagnosed                    the diagnosis' estimate of the effectiveness, 0 to 1

The sums fade over MEMORY_S. Why two estimates: the diagnosis estimates by an equation error. In a closed loop
this estimate is too low in gusts, because the command answers the gust, which hides what the surface gives.
The fit is too high with a noisy gyro, because the noise is in the command as well as in the innovation. The
law divides by the larger of both, so that a loop is no faster than its margins allow.
"""

from math import exp

from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.laws.effectiveness_estimator import observer_response

MEMORY_S = 5.0  # time constant of the sums: the swing of a slow reference
UNSURE = 0.2  # assumed standard deviation of the diagnosis' estimate
# A surface with less effectiveness counts as lost: half of the default `least_effectiveness`, also if a
# scenario sets another one.
NOTHING_LEFT = 0.05

# Fading sums over frames (3,), for the main surface of each axis: product, of psi e; square, of psi^2;
# innovation, of e^2, all (rad/s)^2; frames, of 1. named: whether the diagnosis has named the surface before.
SUMS = record(product=3, square=3, innovation=3, frames=3, named=(int, 3))


def derive_fading(dt_s: float) -> float:
    """Share of the past that is forgotten in a frame of dt_s seconds."""
    return 1.0 - exp(-dt_s / MEMORY_S)


@kernel
def restart_at_naming(sums, i):
    """When the main surface of axis i is named for the first time, restart the sums of psi e and psi^2, which
    come from its healthy time. The noise level, sum e^2 / frames, is kept."""
    if not sums.named[i]:
        sums.named[i] = 1
        sums.product[i] = 0.0
        sums.square[i] = 0.0


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

    `diagnosed` is returned while the sums are empty.
    """
    if sums.frames[i] == 0.0:
        return diagnosed
    prior = sums.innovation[i] / sums.frames[i] / (UNSURE * UNSURE)
    weight = sums.square[i] + prior
    return 1.0 + (sums.product[i] + prior * (diagnosed - 1.0)) / weight if weight > 0.0 else diagnosed


@kernel
def is_effective(sums, main, s, least):
    """Whether the law's observer sees surface s act, enough to be divided by: theta = product / square
    exceeds least - 1. False for a surface that leads no axis. main (3,): surface that leads each axis; least:
    the smallest effectiveness that a law uses."""
    for i in range(3):
        if s == main[i] and sums.product[i] > (least - 1.0) * sums.square[i]:
            return True
    return False


@kernel
def accumulate(config, memory, i, effectiveness, moment, innovation):
    """Add this frame to the sums of axis i, for the terms psi e, psi^2, e^2 and 1:

        sum <- sum + term - fading sum
        psi = observer(moment),    e = innovation + observer((effectiveness - 1) moment)        rad/s

    observer: `observer_response`; innovation rad/s: that of the law's observer; effectiveness: what the law
    assumes of the main surface; moment rad/s2: G u of a healthy main surface.
    """
    sums = memory.sums
    fading = config.fading
    dt = config.dt
    L_rate = memory.L_rate[i]
    L_disturbance = memory.L_disturbance[i]
    assumed = (effectiveness - 1.0) * moment
    psi = observer_response(memory.healthy, i, moment, L_rate, L_disturbance, dt)
    e = innovation + observer_response(memory.assumed, i, assumed, L_rate, L_disturbance, dt)
    for total, term in (
        (sums.product, psi * e),
        (sums.square, psi * psi),
        (sums.innovation, e * e),
        (sums.frames, 1.0),
    ):
        total[i] += term - fading * total[i]
