"""The whitening filter of a block: a Kalman filter of the innovation, with a drift.

    x[k] = x[k-1] + dt (F[k] + d[k] + phi[k])      d[k+1] = a d[k] + drift      measured: x + gyro noise

x are the rates, rad/s; F, rad/s2, is the acceleration of the design model; d, rad/s2, is the drift: a slow
error of F by rotation of the air, by bounded uncertainty, by unknown constants. phi, rad/s2, is a fault. With
a = 1 the drift is a random walk, so a constant error does not appear in the whitened innovation. The filter
is linear, so the response to a fault or to an error of a coefficient is worked out by itself and compared
with the innovation:

    g = e + dt (nu - d)      e <- g - K_x g      d <- a d + K_d g

nu, rad/s2, is the innovation of the frame as an acceleration; e, rad/s, is the remaining error of the rate.
For nu of the flight, g is the whitened innovation; for a signature or a regressor in place of nu, g is its
response.

The declared drift is an upper limit. In calmer air the filter interprets gyro noise as gust, and its
innovation g is then partly predictable: from p = g - g_calm, where g_calm is the innovation of a second
filter without gust, `calm`. The control law reacts to the same noise, so a loss would seem to be present
without one. The fraction of p in g is estimated, lambda = sum p' S^-1 g / sum p' S^-1 p: 0 in air as
declared, 1 in calm air; `update_calm_part` takes it larger, to be safe. The evidence that lambda p
contributes is subtracted (likelihood.py).

Letters of the kernels. A block b has n axes, 1 or 2; i and j are axes; a digit at the end is an axis.

    nu, v          innovation of the frame; input of a filter, rad/s2
    x              state of a filter: e of two axes, rad/s, then d of two axes, rad/s2
    g              whitened response, rad/s
    a              decay of the drift d in a frame
    P, Q, R_y      covariance of e (xx) and d (dd); noise of e (Q_x), (rad/s2)2, of d (Q_d), (rad/s2)2/s,
                   and of the readings, (rad/s)2
    S_inv, K       S^-1, s2/rad2, with S the covariance of g; gains of e (K_x) and of d (K_d), 1/s

statistical.md writes nu~ for g, x~ for e, alpha_d for a.
"""

from math import sqrt

import numpy as np

from beaver_ftc.compiled import kernel

D0 = 2  # in the state of a filter: the place of d, after e of two axes
# Time constant, s, of the estimate of lambda: long compared with a filter's memory, short compared with
# changes of the weather.
CALM_MEMORY_S = 2.0
CALM_PRIOR = 4.0  # prior information for lambda = 1 (calm air), units of sum p' S^-1 p
CALM_STDS = 2.0  # standard deviations by which lambda is taken larger than estimated

# What a filter keeps, in the record of a block or of `calm`.
FILTER_FIELDS = {
    "n": int, "a": float, "state": 4, "g": 2, "P_xx": (2, 2), "P_xd": (2, 2), "P_dd": (2, 2), "Q_d": (2, 2),
    "Q_x": 2, "R_y": 2, "S_inv": (2, 2), "K_x": (2, 2), "K_d": (2, 2),
}  # fmt: skip


@kernel
def invert_symmetric(n, S):
    """S <- S^-1, in place; S (n, n) symmetric, n at most 2."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    a = S[0, 0]
    c = 0.5 * (S[0, 1] + S[1, 0])
    d = S[1, 1]
    det = a * d - c * c
    S[0, 0] = d / det
    S[1, 1] = a / det
    S[0, 1] = S[1, 0] = -c / det


@kernel
def predict_covariance(b, dt):
    """Predict the covariances over a frame of dt s:

        P <- F P F' + Q,  F = [1 dt; 0 a],  Q = [dt^2 Q_x 0; 0 dt Q_d]        S = P_xx + R_y

    `S_inv` is filled with S, which `invert_symmetric` inverts next. The order matters: P_xx needs P_xd and
    P_dd of before, and P_xd needs P_dd of before.
    """
    P_xx = b.P_xx
    P_xd = b.P_xd
    P_dd = b.P_dd
    S = b.S_inv
    for i in range(b.n):
        for j in range(b.n):
            P_xx[i, j] += dt * (P_xd[i, j] + P_xd[j, i]) + dt * dt * P_dd[i, j]
        P_xx[i, i] += dt * dt * b.Q_x[i]
    for i in range(b.n):
        for j in range(b.n):
            P_xd[i, j] = b.a * (P_xd[i, j] + dt * P_dd[i, j])
            P_dd[i, j] = b.a * b.a * P_dd[i, j] + dt * b.Q_d[i, j]
            S[i, j] = P_xx[i, j]
        S[i, i] += b.R_y[i]


@kernel
def add_turn_to_drift(b, gust):
    """Add to the drift the variance that a fast turn of the gusts' axes causes:

        P_dd <- P_dd + Q_scale m var_turn m'

    m (n, 3): the block's directions on the three rates; var_turn (3, 3) (rad/s2)2: of the gust estimate.
    """
    for i in range(b.n):
        for j in range(b.n):
            for r in range(3):
                for q in range(3):
                    b.P_dd[i, j] += b.Q_scale * b.m[i, r] * b.m[j, q] * gust.output.var_turn[r, q]


@kernel
def fill_kalman_gains(b):
    """Fill the Kalman gains K_x = P_xx S^-1 and K_d = P_xd' S^-1, (n, n)."""
    for i in range(b.n):
        for j in range(b.n):
            K_x = K_d = 0.0
            for k in range(b.n):
                K_x += b.P_xx[i, k] * b.S_inv[k, j]
                K_d += b.P_xd[k, i] * b.S_inv[k, j]
            b.K_x[i, j] = K_x
            b.K_d[i, j] = K_d


@kernel
def update_covariance(b):
    """Update the covariances for the measurement: P <- P - K S K'."""
    K_x = b.K_x
    K_d = b.K_d
    for j in range(2):  # a column follows from itself alone
        xx_0 = b.P_xx[0, j]
        xx_1 = b.P_xx[1, j]
        xd_0 = b.P_xd[0, j]
        xd_1 = b.P_xd[1, j]
        for i in range(b.n):
            b.P_dd[i, j] -= K_d[i, 0] * xd_0 + K_d[i, 1] * xd_1
            b.P_xx[i, j] -= K_x[i, 0] * xx_0 + K_x[i, 1] * xx_1
            b.P_xd[i, j] -= K_x[i, 0] * xd_0 + K_x[i, 1] * xd_1


@kernel
def advance_covariance(b, dt):
    """Predict the covariances, fill the gains, update the covariances for the frame just measured; dt s."""
    predict_covariance(b, dt)
    invert_symmetric(b.n, b.S_inv)
    fill_kalman_gains(b)
    update_covariance(b)


@kernel
def whiten_step(b, x, v, dt, g):
    """Advance the filter of a block by one frame of the input v (2,) rad/s2:

        g = e + dt (v - d)      e <- g - K_x g      d <- a d + K_d g

    x (4,): e, rad/s, and d, rad/s2; advanced in place. g (2,) rad/s: filled; with v = nu it has the
    covariance S. v and g may be the same array.
    """
    for i in range(b.n):
        g[i] = x[i] + dt * (v[i] - x[D0 + i])
    for i in range(b.n):
        e = g[i]
        d = 0.0
        for j in range(b.n):
            e -= b.K_x[i, j] * g[j]
            d += b.K_d[i, j] * g[j]
        x[i] = e
        x[D0 + i] = b.a * x[D0 + i] + d


@kernel
def whiten_calm(b, dt):
    """Whiten nu by the filter without gust, `calm`, which fills its g; dt s."""
    advance_covariance(b.calm, dt)
    whiten_step(b.calm, b.calm.state, b.nu, dt, b.calm.g)


@kernel
def update_calm_part(b, dt):
    """Fill `p` (2,) rad/s with lam p, the part of g that calm air makes predictable.

        p = g - g_calm      pg = sum p' S^-1 g      pp = sum p' S^-1 p
        lam = (pg + CALM_PRIOR + CALM_STDS sqrt D) / D in [0, 1],      D = pp + CALM_PRIOR

    The sums fade with the time constant CALM_MEMORY_S. g_calm: g of `calm`, which `whiten_calm` has filled
    in this frame. lam is the estimate of least squares with a prior for calm air, CALM_STDS standard
    deviations larger.
    """
    p = b.p
    g = b.g
    decay = np.exp(-dt / CALM_MEMORY_S)
    b.pg *= decay
    b.pp *= decay
    for i in range(b.n):
        p[i] = g[i] - b.calm.g[i]
    for i in range(b.n):
        for j in range(b.n):
            b.pg += p[i] * b.S_inv[i, j] * g[j]
            b.pp += p[i] * b.S_inv[i, j] * p[j]
    D = b.pp + CALM_PRIOR
    lam = min(max((b.pg + CALM_PRIOR + CALM_STDS * sqrt(D)) / D, 0.0), 1.0)
    for i in range(b.n):
        p[i] *= lam
