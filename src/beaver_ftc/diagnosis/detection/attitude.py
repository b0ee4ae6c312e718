"""Whether the attitude shows the turn that the rates show: if so no gyro is broken, if not one is.

About each body axis let xi, rad/s, be the true rate less that of the gyro, and psi, rad, its integral:

    psi' = xi      xi' = d + phi - nu - D xi      measured: A = psi + v

nu, rad/s2, is the innovation of the rates; d, rad/s2, the drift of the whitening filters (whitening.py);
D, 1/s, the damping of the rates; A, rad, the turn of the attitude beyond that of the gyros; v, rad, the noise
of the attitude; phi, rad/s2, a fault of a surface. An error of a gyro is part of nu for any course of it. So
the Kalman filter of (psi, xi, d) with the input nu predicts A with a broken gyro, too, and its innovation g,
of variance S, is white. A fault of a surface is part of nu as well, but the attitude turns with the gyro: g
contains its response.

Two kinds of sums gather what g contains. Leaky sums z suit any course of a fault. N is the correlation with
the response g_s to a loss of surface s, summed over roll and yaw. It begins at the alarm of the rates, since
what was before the fault only adds noise:

    z <- a z + g / sqrt S          N <- b N + g_s g / S      M <- b M + g_s^2 / S

Unknown constants c_j, |c_j| <= tol_j, multiply known accelerations r_j: the errors of coefficients, and for
each axis by itself a share of the bounded uncertainty, taken as constant, and errors of the damping. Through
the same filter they add c_j z_j and c_j N_j to the sums. Without a fault of a surface

    (|z| - sum_j tol_j |z_j|) sqrt(1 - a^2)          (|N| - sum_j tol_j |N_j|) / sqrt M

are at most standard normal. If one exceeds level = sqrt(2 margin), with the margin of isolation, no gyro is
the cause.

gyro_turn.py finds a gyro that is broken.

A loss acts on roll and yaw together, so an axis i has a `row` in a block of the rates: pitch is row 0 of its
block, roll is row 0 and yaw row 1 of theirs.

Letters of the record and of the kernels, for each axis i. Input j = 0 is that of g; inputs j = 1, ... are the
known accelerations, so z_0 = z, N_0 = N:

    u_j, g_j        input of a filter, rad/s2: u_0 is -nu less the damping by the other axes, others are r_j;
                    its response over sqrt S
    s_j, s_h        states (psi rad, xi rad/s, d rad/s2) of the filters of g_j and of the g_s of loss h
    P, K, S         covariance (3, 3) and gain (3,) of these filters; variance of g, rad2
    n               number of the inputs: of g, of the constants of the block, and the N_FURTHER
    z_j             leaky sums of g_j; a (m,): their leaks per frame
    M, N_j          correlations with the loss h; b: their leak per frame
    a_d             factor of the drift d per frame (`a` of the block)
    blk, row        block of the rates (blocks.py) and row of the axis in it
"""

from math import exp, sqrt

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import copy, fill, kernel, record, sized
from beaver_ftc.diagnosis.detection.blocks import (
    DRIFT_PRIOR_RAD_S2,
    LATERAL_BLOCK,
    LOSS,
    PITCH_BLOCK,
    BlockCapacity,
)
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.diagnosis.detection.gyro_turn import (
    ANGLES,
    LEAK_TIMES_S,
    TURN_FIELDS,
    configure_turns,
    find_gyro,
    sum_turns,
)
from beaver_ftc.scenario.declared import SensorErrors

LOSS_MEMORY_S = 30.0  # time constant of the correlations with a loss
DAMPING_TOLERANCE = 0.2  # relative error of D away from trim
N_FURTHER = 4  # after the regressors of a block: the bounded uncertainty, and the axis' row of D
BLOCK_ROWS = (0, 0, 1)  # row of roll, pitch and yaw in the block that has the axis


@sized
def attitude_dtype(capacity: BlockCapacity) -> np.dtype:
    """The comparison of attitude and rates, for the capacity of a block of the rates."""
    n = 1 + capacity.max_regressors + N_FURTHER
    n_h = capacity.max_hypotheses
    n_a = len(LEAK_TIMES_S)
    return record(
        enabled=int, level=float,  # level of both sums, standard deviations
        D=(3, 3), R=float, a=n_a, b=float,  # 1/s; variance of v, rad2; factors per frame
        P_start=3, P=(3, 3, 3), F_P=(3, 3),  # P_start: diagonal of P at the start; F_P: the product F P
        turn=3, A=3,  # turn of the attitude beyond that of the gyros, rad: in this frame, and in all frames
        s=(3, n, 3), s_h=(3, n_h, 3),
        n=(int, 3), u=n, tol=(3, n), g=n, xi=3, z=(3, n, n_a), M=(3, n_h), N=(3, n_h, n),
        score=float,  # largest of the sums of both kinds, over their level; 0 in frames that do not need it
        **TURN_FIELDS,
    )  # fmt: skip


def configure_attitude(att: np.void, D: np.ndarray, errors: SensorErrors, margin: float, dt_s: float) -> None:
    """Fill the comparison at frames of dt_s; D (3, 3) 1/s. margin: difference of log-likelihood ratios that
    names a surface, so the level of the sums is sqrt(2 margin) standard deviations.

    v rad, w rad/s: largest noise of an angle and of a gyro.
    """
    v = errors.each("random", ANGLES).max()
    w = errors.each("random", AXES).max()
    a = np.exp(-dt_s / np.array(LEAK_TIMES_S))
    P_start = v**2, w**2, DRIFT_PRIOR_RAD_S2**2
    fill(
        att, enabled=1, level=sqrt(2.0 * margin), D=D, R=v**2, a=a, b=exp(-dt_s / LOSS_MEMORY_S),
        P_start=P_start, P=np.diag(P_start),
    )  # fmt: skip
    configure_turns(att, errors, v, w, dt_s)


@kernel
def restart(att):
    """Restart all filters and sums: near the vertical the attitude shows no turn."""
    att.turn[:] = att.A[:] = att.P[:] = 0.0
    att.s[:] = att.s_h[:] = 0.0
    att.z[:] = att.M[:] = att.N[:] = 0.0
    att.T[:] = att.E[:] = 0.0
    for i in range(3):
        for k in range(3):
            att.P[i, k, k] = att.P_start[k]


@kernel
def add_turn(att, turn):
    """Add what the attitude has turned beyond the gyros in a sample: turn (3,) or more, rad, by axis."""
    for i in range(3):
        att.turn[i] += turn[i]


@kernel
def compare_attitude(att, blocks, eta, x, dt, detected):
    """Advance the comparison by a frame of dt s that the blocks have whitened.

    eta (3,) rad/s2: bound of the uncertainty; x (3,) rad/s: measured rates. `score` and `gyro` are filled
    after an alarm of the rates, `detected`, or if a turn is beyond its level; else they are 0 and -1.
    """
    pitch = blocks[PITCH_BLOCK]
    lateral = blocks[LATERAL_BLOCK]
    block_of_axis = lateral, pitch, lateral
    sum_turns(att, x, dt)
    copy(att.s[:, 0, 1], att.xi)
    for i, blk in enumerate(block_of_axis):
        advance_axis(att, i, blk, BLOCK_ROWS[i], eta[i], dt, detected)
    att.score = 0.0
    att.gyro = -1
    worst = np.argmax(att.turn_score)
    if detected or att.turn_score[worst] > 1.0:
        att.score = max(largest_correlation(att, pitch, 1), largest_correlation(att, lateral, 0))
        for i in range(3):
            att.score = max(att.score, largest_sum(att, i))
        find_gyro(att, worst)


@kernel
def advance_axis(att, i, blk, row, eta, dt, detected):
    """Advance filter, responses and sums of axis i, which is this row of its block.

        z_j <- a z_j + g_j      M <- b M + g_s^2      N_j <- b N_j + g_s g_j      g over sqrt S

    M and N_j are added to once the rates have raised an alarm (`detected`). eta rad/s2: bound on the
    uncertainty of the axis.
    """
    D = att.D[i, i]
    a_d = blk.a
    att.A[i] += att.turn[i]
    att.turn[i] = 0.0
    fill_inputs(att, i, blk, row, eta)
    K, S = advance_P(att, i, blk, row, dt)
    std = np.sqrt(S)
    n = att.n[i]
    for j in range(n):
        A = att.A[i] if j == 0 else 0.0
        att.g[j] = respond(att.s[i, j], A, att.u[j], D, a_d, K, dt) / std
        leak(att.z[i, j], att.a, att.g[j])
    for h, hypothesis in enumerate(blk.hypothesis[: blk.n_h]):
        if hypothesis.kind == LOSS:
            g_s = respond(att.s_h[i, h], 0.0, hypothesis.signature[row], D, a_d, K, dt) / std
            if detected:
                att.M[i, h] = att.b * att.M[i, h] + g_s * g_s
                for j in range(n):
                    att.N[i, h, j] = att.b * att.N[i, h, j] + g_s * att.g[j]


@kernel
def fill_inputs(att, i, blk, row, eta):
    """Fill the inputs u (n,) of axis i, rad/s2, their tolerances and their number n.

        u_0 = -nu - sum_j D_ij xi_j,  j != i
        u_1, ... = regressors of the block, eta, D_i0 xi_0, D_i1 xi_1, D_i2 xi_2

    tol: as in the block, then 1 of the bounded uncertainty, whose input is its bound, then DAMPING_TOLERANCE
    of the damping by the three rates. eta rad/s2: bound on the uncertainty; xi (3,) rad/s: of the frame
    before.
    """
    u = att.u
    tol = att.tol[i]
    u[0] = -blk.nu[row]
    for j in range(blk.n_Z):
        u[1 + j] = blk.regressor[j, row]
        tol[1 + j] = blk.tol[j]
    k = 1 + blk.n_Z
    u[k] = eta
    tol[k] = 1.0
    for j in range(3):
        k += 1
        u[k] = att.D[i, j] * att.xi[j]
        tol[k] = DAMPING_TOLERANCE
        if j != i:
            u[0] -= u[k]
    att.n[i] = k + 1


@kernel
def largest_sum(att, i):
    """The part of the leaky sums of axis i that no constants explain, largest over the leaks, over the level:

    max (|z| - sum_j tol_j |z_j|) sqrt(1 - a^2) / level
    """
    largest = 0.0
    for m, a in enumerate(att.a):
        excess = abs(att.z[i, 0, m])
        for j in range(1, att.n[i]):
            excess -= att.tol[i, j] * abs(att.z[i, j, m])
        largest = max(largest, excess * np.sqrt(1.0 - a * a))
    return largest / att.level


@kernel
def largest_correlation(att, blk, first):
    """The part of the correlations with losses that no constants explain, largest over the losses of a block,
    over the level:

        max (|N| - sum_j tol_j |N_j|) / (level sqrt M)

    N_j, M: sums over the axes of the block, which are first, first + 2, ...: pitch (first 1), or roll and
    yaw (first 0). For the uncertainty and the damping, |N_j| is the sum of the axes' magnitudes: each axis
    has a constant of its own.
    """
    largest = 0.0
    n = att.n[first]
    for h, hypothesis in enumerate(blk.hypothesis[: blk.n_h]):
        if hypothesis.kind != LOSS:
            continue
        N = M = 0.0
        for i in range(first, 3, 2):
            N += att.N[i, h, 0]
            M += att.M[i, h]
        excess = abs(N)
        for j in range(1, n):
            N_j = 0.0
            for i in range(first, 3, 2):
                N_j += abs(att.N[i, h, j]) if j >= n - N_FURTHER else att.N[i, h, j]
            excess -= att.tol[first, j] * abs(N_j)
        if M > 0.0:
            largest = max(largest, excess / np.sqrt(M))
    return largest / att.level


@kernel
def respond(s, A, u, D, a_d, K, dt):
    """Advance a state s (psi, xi, d) by one frame of acceleration u, rad/s2, and measurement A, rad; return
    the innovation g, rad:

        psi <- psi + dt xi      xi <- xi + dt (d + u - D xi)      d <- a_d d
        g = A - psi             s <- s + K g
    """
    psi = s[0] + dt * s[1]
    xi = s[1] + dt * (s[2] + u - D * s[1])
    d = a_d * s[2]
    g = A - psi
    s[0] = psi + K[0] * g
    s[1] = xi + K[1] * g
    s[2] = d + K[2] * g
    return g


@kernel
def dot(a, b):
    """a' b; a, b (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def advance_P(att, i, blk, row, dt):
    """Advance P of axis i by a frame of dt s; row: of the axis in its block. Return K (3,) and S, rad2.

        P <- F P F' + Q,  F = [1 dt 0; 0 1 - dt D dt; 0 0 a_d],  Q = diag(0, dt^2 Q_x, dt Q_d)
        S = P_00 + R,  K = P_0 / S      P <- P - K P_0'      P_0: the first column, and row, of P

    Q_x (rad/s2)2, Q_d (rad/s2)2/s: noise of the rate and of the drift in the block; R rad2: variance of v.
    """
    P = att.P[i]
    F_P = att.F_P
    F = (1.0, dt, 0.0), (0.0, 1.0 - dt * att.D[i, i], dt), (0.0, 0.0, blk.a)
    for r in range(3):
        for c in range(3):
            F_P[r, c] = dot(F[r], P[:, c])
    for r in range(3):
        for c in range(3):
            P[r, c] = dot(F[c], F_P[r])
    P[1, 1] += dt * dt * blk.Q_x[row]
    P[2, 2] += dt * blk.Q_d[row, row]
    S = P[0, 0] + att.R
    K = P[0, 0] / S, P[1, 0] / S, P[2, 0] / S
    for c in range(3):
        P_0c = P[0, c]
        for r in range(3):
            P[r, c] -= K[r] * P_0c
    return K, S
