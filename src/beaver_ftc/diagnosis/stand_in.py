"""What stands in for an instrument that is broken: what the others say of it."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.watch import AIRSPEED, ALPHA, BETA, QDYN, TURN
from beaver_ftc.plant.instruments import AX, ENGINE_SPEED, MANIFOLD, N_SENSORS
from beaver_ftc.plant.readings import note_slipstream, share_out

QUICK_PER_S = 10.0  # the second of watch.POLES_PER_S
FORGETTING_S = 20.0  # of a vane that is replaced, back to trim: kinematics alone drift


@kernel
def replace(watch, belief, measured):
    """Put what the other instruments say in the place of those that are named or missing. Accelerometers are
    not replaced: then none of them is used."""
    signal, changed = measured.signal, 0
    for i in range(N_SENSORS):
        if measured.missing[i]:
            watch.replaced[i] = 1
        if watch.replaced[i] and i < AX:
            signal[i] = stand_in(watch, belief, signal, i)
            changed = 2 if i in (AIRSPEED, QDYN, ENGINE_SPEED, MANIFOLD) else max(changed, 1)
    if changed > 0:
        share_out(measured)
    if changed > 1 and watch.engine:
        note_slipstream(measured)


@kernel
def stand_in(watch, belief, signal, i):
    """What the other instruments say of instrument i."""
    step = watch.step
    if i < 3:
        return rate_from_attitude(watch, belief, i)
    if i in (ALPHA, BETA):
        return step.predicted[i] + step.h / FORGETTING_S * (watch.trim[i] - step.predicted[i])
    density = 2.0 * step.then[QDYN] / step.then[AIRSPEED] ** 2
    if i == AIRSPEED:
        return np.sqrt(max(2.0 * signal[QDYN] / density, 1.0))
    if i == QDYN:
        return 0.5 * density * signal[AIRSPEED] ** 2
    if i >= ENGINE_SPEED:
        return step.command[i - ENGINE_SPEED]
    return step.predicted[i]


@kernel
def rate_from_attitude(watch, belief, i):
    """Rate i, rad/s: what the attitude has shown of it by the look before, and the model's change since.

    The rate itself is used for the next look: its own error shows there.
    """
    step = watch.step
    u = belief.u_then if watch.past == 0 else belief.u
    acceleration = belief.f[i]
    for s in range(u.size):
        acceleration += belief.G[i, s] * u[s]
    shown = watch.follows * step.test[TURN + i].residual
    if not watch.taken_over[i] and watch.follows < 1.0:
        shown = step.h * QUICK_PER_S * step.test[TURN + i].filtered[1]
    watch.taken_over[i] = 1
    known = step.then[i] + shown / step.h
    return known + step.h * acceleration
