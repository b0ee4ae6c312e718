"""The part of a gust that the vanes leave unmeasured: the drift of accelerations that it causes.

The rotation w_j of the air about each axis j of the gusts is a first-order process of lag tau_j. Its
unmeasured share acts on the rates like a drift of the model's acceleration, of the intensity

    V_max sum_j (L C)_ij (L C)_kj share_j Q_j        on the body axes i and k, (rad/s2)2/s

V_max, m/s, is the larger of the airspeed and the estimated speed V of gusts.py.
If the axes of the gusts turn fast, the unmeasured gust changes with them in body axes, faster than this
drift. The variance of that change is added to the drift in the frames of the turn: `var_turn`, which
`whitening.add_turn_to_drift` reads.

gusts.py computes the estimate. Letters of the kernels:

    i, k, j    body axes; axis of the gusts, about which they roll, pitch or yaw
    w, tau     rotation of the air in the gusts' axes, rad/s; its lag, s
    L          rate damping, angular acceleration per rad/s (3, 3), 1/s; of a view (3,)
    C          rotation (3, 3) from the gusts' axes to body axes
    Q          intensity of the drift of w over V, rad2/s3 per m/s
    Q_V        intensity of the drift of an acceleration over V, (rad/s2)2/s per m/s
    share      part of Q, or of a variance, that the vanes leave unmeasured
    b          span, m
"""

from math import pi

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL, YAW
from beaver_ftc.compiled import kernel


@kernel
def project_gust(v, C, j):
    """v' C_j, with C_j (3,) the column j of a rotation C (3, 3) to body axes.

    It is component j of a vector v (3,) that is given in body axes, in the axes from which C turns. Or, if v
    is a sensitivity to rotation about the body axes, it is the sensitivity to the gust about axis j.
    """
    return v[0] * C[0, j] + v[1] * C[1, j] + v[2] * C[2, j]


@kernel
def gust_lag(gust, j, V):
    """The lag of the gust about axis j, s, at a speed V m/s:

    L_roll / V      tau_q = 4 b / pi V      tau_r = 3 b / pi V
    """
    if j == ROLL:
        return gust.config.L_roll / V
    return (4.0 if j == PITCH else 3.0) * gust.config.span / (pi * V)


@kernel
def effect_product(gust, C, i, k, j):
    """Product of the effects of the gust about axis j on two accelerations, (L C)_ij (L C)_kj.

    C (3, 3): rotation from the axes of the gusts, for a product in 1/s2; or C_dot, for one in 1/s4.
    """
    L = gust.output.rate_damping
    return project_gust(L[i], C, j) * project_gust(L[k], C, j)


@kernel
def unmeasured_share(gust, j):
    """Share of the intensity of the gust about axis j that is unmeasured in this frame, at most 1:

        share_j + speed_error_share (var_V + start_left var_v) / V^2 + passing

    share_j: what vanes leave in any case. The second term is by the error of V, if the gust is measured.
    passing: of the pitching gust start_share, of the yawing gust turn_past. The rolling gust has only the
    first term. V is `gust.output.V`, at least 1 m/s, because it divides.
    """
    cfg = gust.config
    mem = gust.memory
    V = max(gust.output.V, 1.0)
    if j == ROLL:
        return min(mem.share[j], 1.0)
    var = cfg.var_V + mem.start_left * cfg.var_v if gust.output.measured else 0.0
    passing = mem.start_share if j == PITCH else mem.turn_past
    return min(mem.share[j] + cfg.speed_error_share * var / V**2 + passing, 1.0)


@kernel
def unmeasured_drift(gust, V, i, k, as_rolling):
    """Intensity, (rad/s2)2/s, of the drift of accelerations i and k by the unmeasured rotation; V m/s:
    airspeed.

        max(V, gust.output.V) sum_j (L C)_ij (L C)_kj share_j Q_j

    as_rolling: if the gust is declared to be visible only coarsely (`coarse_only`), of a gust with the
    correlation length of the rolling gust and equal power at low frequency: Q_j is scaled by (tau_j V /
    L_roll)^2. What vanes leave of a gust has an unknown spectrum, so otherwise its intensity stays, even
    after `drop_accelerometers`.
    """
    cfg = gust.config
    C = gust.output.C
    Q_V = 0.0
    for j in range(3):
        Q = unmeasured_share(gust, j) * gust.memory.Q[j]
        scale = (gust_lag(gust, j, 1.0) / cfg.L_roll) ** 2 if as_rolling and cfg.coarse_only else 1.0
        Q_V += effect_product(gust, C, i, k, j) * Q * scale
    return Q_V * max(V, gust.output.V)


@kernel
def view_drift(gust, V, L_rate, L_force, subtracted):
    """Intensity, (rad/s2)2/s, of the drift of a view by the rotation of the air, at an airspeed of V m/s:

        max(V, gust.output.V) sum_j (sqrt(share_j) |L_rate' C_j| + |L_force' C_j|)^2 Q_j

    L_rate, L_force (3,) 1/s: sensitivity of the view's rates and of its forces to rotation about the body
    axes. subtracted: the gust estimate is subtracted from the rates, so that only a share of the gust acts on
    them. Otherwise share is 1, and each j adds (tau L_rate' C_dot_j)^2 Q_j / 2 if C turns fast, with tau of
    the rolling gust, as in `gusts.update_axes`. The forces always contain the whole gust.
    """
    C = gust.output.C
    mem = gust.memory
    Q_V = 0.0
    tau = 0.0 if subtracted or not mem.turns_fast else gust_lag(gust, ROLL, V)
    for j in range(3):
        share = unmeasured_share(gust, j) if subtracted else 1.0
        L = np.sqrt(share) * abs(project_gust(L_rate, C, j)) + abs(project_gust(L_force, C, j))
        Q_V += (L**2 + 0.5 * (tau * project_gust(L_rate, mem.C_dot, j)) ** 2) * mem.Q[j]
    return Q_V * max(V, gust.output.V)


@kernel
def add_turn_variance(gust, V, dt):
    """Add to var_now the effect of the turn of the gusts' axes in dt s, if they turn fast; V m/s: airspeed.

        dt V sum_j (L C_dot)_ij (L C_dot)_kj tau_j^2 Q_j share_j / 2      j: roll, yaw

    share: 1 for the rolling gust, which no vane measures; turn_past for the yawing gust.
    """
    mem = gust.memory
    if mem.turns_fast:
        for j, share in ((ROLL, 1.0), (YAW, mem.turn_past)):
            walk = 0.5 * dt * V * gust_lag(gust, j, V) ** 2 * mem.Q[j] * share
            add_variance(gust, mem.C_dot, j, walk)


@kernel
def add_variance(gust, C, j, q):
    """Add to var_now the variance of the accelerations by a variance q of the gust about axis j: q times
    `effect_product`."""
    for i in range(3):
        for k in range(3):
            gust.memory.var_now[i, k] += q * effect_product(gust, C, i, k, j)


@kernel
def finish_turn_variance(gust):
    """Fill var_turn = var_prev + var_now for the elapsed frame, and start var_now of the next.

    The axes may turn in the middle of a frame. A part of the effect is then in this frame and the rest in the
    next, so the variance counts in both frames.
    """
    mem = gust.memory
    for i in range(3):
        for k in range(3):
            gust.output.var_turn[i, k] = mem.var_prev[i, k] + mem.var_now[i, k]
    mem.var_prev = mem.var_now
    mem.var_now[:] = 0.0
