"""Generalised likelihood ratio tests on the whitened innovation [Willsky1976].

The innovation is whitened by a Kalman filter:

    x[k+1] = x[k] + dt (F[k] + d[k] + phi[k])      d[k+1] = a d[k] + drift      measured: x + gyro noise

x are the rates, rad/s; F, rad/s2, is the acceleration of the design model; d, rad/s2, is the drift: a slow
error of F by rotation of the air, by bounded uncertainty, by unknown constants. phi, rad/s2, is a fault. With
a = 1 the drift is a random walk, so a constant error does not appear in the whitened innovation. The filter
is linear, so the response to a fault or to an error of a coefficient is worked out by itself and compared
with the innovation:

    g = e + dt (nu - d)      e <- g - K_x g      d <- a d + K_d g

nu, rad/s2, is the innovation of the frame as an acceleration; e, rad/s, is the remaining error of the rate.

A hypothesis is a fault phi = theta s(t) from an onset on, with s(t) a known signature. g_s is the response of
the whitening filter to the signature, g the whitened innovation, rad/s, S its covariance:

    N = sum g_s' S^-1 g,  D = sum g_s' S^-1 g_s:      theta_hat = N / D,   log likelihood ratio N^2 / 2 D

Without a fault N / sqrt(D) is standard normal (or smaller, if the noise is smaller than declared). The alarm
level follows from the declared rate of false alarms by the union bound over hypotheses, onsets and frames.

Errors of coefficients are constants c_j, |c_j| <= tol_j, times known regressors r_j. Through the same filter
they add sum_j c_j R_j to N, with R_j = sum g_s' S^-1 g_rj. That is at most sum_j tol_j |R_j|, which is
subtracted from the evidence.

A bounded uncertainty |d| <= eta_bar is not noise. g_d is its response of the filter. The response to a unit
constant settles at g_0; the response to a unit step also has a transient whose sum is 1 / K_d and whose
magnitudes sum to at most RINGING / K_d. With w = S^-1 g_s, summation by parts gives

    |sum w' g_d| <= eta_bar (|g_0| sum |w| + RINGING / K_d TV(w)),     TV(w) = sum |w[k] - w[k-1]|

d changes by at most eta_bar omega dt in a frame, so omega dt sum |w| may replace TV(w). An alarm requires
more evidence than this bound explains.

A growing loss is a loss times 1 - exp(-kappa t). The end of a loss is a step of the opposite sign, of the
size that the signature had at the onset. These hypotheses raise no alarm; they are needed to decide whether
a fault of a surface can explain the data.

The declared drift is an upper limit. In calmer air the filter interprets gyro noise as gust, and its
innovation g is then partly predictable: from p = g - g_0, where g_0 is the innovation of a second filter
without gust. The control law reacts to the same noise, so a loss would seem to be present without one. The
fraction of p in g is estimated, lambda = sum p' S^-1 g / sum p' S^-1 p: 0 in air as declared, 1 in calm air.
The evidence that lambda p contributes is subtracted.

A gust may be visible to the vanes only roughly, if no force separates it from the aircraft's own motion
(gusts.py). It correlates with the surfaces of a law that uses the vanes. Its response is whitened likewise,
and the evidence that it contributes is subtracted.

Onsets: slot j restarts every 2^(j+1) frames (the last one every 2^j), so that onsets of about every age exist
at any time. After an alarm no slot restarts, and old evidence decays slowly.

Letters of the kernels. A block b has n axes, 1 or 2; i is an axis, j a regressor, k an onset test; a digit
at the end is an axis.

    nu, v          innovation of the frame; input of a filter, rad/s2
    x              state of a filter: e of two axes, rad/s, then d of two axes, rad/s2
    g              whitened response, rad/s: to nu; g_Z to a regressor, g_c to a coarse gust, g_s to s
    a              decay of the drift d in a frame
    P, Q, R_y      covariance of e (xx) and d (dd); noise of e (Q_x), (rad/s2)2, of d (Q_d), (rad/s2)2/s,
                   and of the readings, (rad/s)2
    S_inv, K       S^-1, s2/rad2; gains of e (K_x) and of d (K_d), 1/s
    s, w           signature since the onset, rad/s2; S^-1 g_s, s/rad
    N, D           sums as above; N_p, N_c: shares of N by p = lambda (g - g_0) and by a coarse gust
    Z, tol, R      regressor, rad/s2; its tolerance; R_j
    e_R            sum tol |R|
    eta, eta_0     eta_bar, rad/s2; eta_bar |g_0|, rad/s
    eta_r          eta_bar RINGING / K_d, rad/s
    eta_rate       omega dt
    e_0, e_tv, e_w shares of |N| by eta_bar: sums of eta_0 |w|, eta_r TV(w), eta_r eta_rate |w|
    th             theta

statistical.md writes nu~ for g, nu~_chi for g_s, x~ for e, alpha_d for a, chi for s, N_j for R_j, room for
the share of |N| by eta_bar, z for the alarm level.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel, plain, record, sized
from beaver_ftc.diagnosis.state import LOSS

# A block is a set of axes with correlated noise: pitch, roll with yaw, and roll with yaw again, with a drift
# that returns to zero.
PITCH_BLOCK, LATERAL_BLOCK, REVERTING_BLOCK = range(3)
N_FILTER_BLOCKS = 3
D0 = 2  # in the state of a filter: the place of d, after e of two axes
N_SLOTS = 10
N_INPUT_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power: rows.py
N_ROWS = 5  # roll, pitch, yaw, side force, normal force: rows.py
USUAL_HYPOTHESES = 8  # of a block of the rates of most aircraft: three losses, and the alternatives to them
MIN_ETA_RAD_S2 = 1e-3  # lower limit of the bound that sets the drift: the bound may pass zero
STEP_FAULT, ALPHA_CUBED_MOMENT, GROWING_LOSS, LOSS_END = 2, 3, 4, 5  # further kinds of hypothesis
# Sign of N that supports a hypothesis: a loss removes moment, its end restores moment; 0: both signs.
SIGN_OF_KIND = {LOSS: -1.0, STEP_FAULT: 0.0, ALPHA_CUBED_MOMENT: 0.0, GROWING_LOSS: -1.0, LOSS_END: 1.0}

DRIFT_PRIOR_RAD_S2 = 1.0  # standard deviation of the drift at the start of a flight; soon irrelevant
LOSS_PRIOR = 12.0  # one over the variance of a loss that is uniform on [0, 1]
# The magnitudes of a second-order transient of damping 0.7 sum to 1.09 times its sum; on two axes to more.
RINGING_FACTOR = 1.2

# Time constant, s, of the estimate of lambda: long compared with a filter's memory, short compared with
# changes of the weather.
CALM_MEMORY_S = 2.0
CALM_PRIOR = 4.0  # prior information for lambda = 1 (calm air), units of sum p' S^-1 p
CALM_STDS = 2.0  # standard deviations by which lambda is taken larger than estimated

HYPOTHESIS_RECORD = record(
    kind=int, surface=int, axis=int, alarms=int, column=int,
    signature=2,  # s of this frame, rad/s2 per unit of theta
    decay=float,  # exp(-kappa dt) of a growing loss
    score=float,  # largest normalised evidence over the onsets, standard deviations
    th=float, D=float,  # estimate at the likeliest onset; one over its variance
    llr_lo=float, llr_hi=float,  # bounds on the log-likelihood ratio against no fault
)  # fmt: skip


class BlockCapacity(NamedTuple):
    """The numbers of regressors and hypotheses for which a block has memory."""

    max_regressors: int
    max_hypotheses: int


# An onset test is one hypothesis with one onset. Those of a few hypotheses lie side by side for vector
# instructions: test (h % GROUP_SIZE) * N_SLOTS + slot in group h // GROUP_SIZE. A group has the same size in
# every record, so compiled code knows that its arrays do not overlap. Checking that in each frame took a
# tenth of the detector's time.
GROUP_SIZE = 4
N_GROUP_TESTS = GROUP_SIZE * N_SLOTS
TESTS_RECORD = record(
    supporting_correlation_sign=N_GROUP_TESTS,  # sign of N that supports the hypothesis, or 0
    # signature since the onset, rad/s2; state of its filter; g_s of the frame
    s=(2, N_GROUP_TESTS), x_s=(4, N_GROUP_TESTS), g_s=(2, N_GROUP_TESTS),
    w=(2, N_GROUP_TESTS), correlation=N_GROUP_TESTS, information=N_GROUP_TESTS,  # w; N; D
    e_R=N_GROUP_TESTS,
    left=N_GROUP_TESTS,  # exp(-kappa t) of a growing loss; 1 until a loss has ended
    e_0=N_GROUP_TESTS, e_tv=N_GROUP_TESTS, e_w=N_GROUP_TESTS,
    N_p=N_GROUP_TESTS, correlation_from_coarse_gust=N_GROUP_TESTS,  # N_p; N_c
    score=N_GROUP_TESTS, llr_lo=N_GROUP_TESTS, llr_hi=N_GROUP_TESTS,
    llr=N_GROUP_TESTS,  # log-likelihood ratio
)  # fmt: skip


_FILTER_FIELDS = {
    "n": int, "a": float, "state": 4, "g": 2, "P_xx": (2, 2), "P_xd": (2, 2), "P_dd": (2, 2), "Q_d": (2, 2),
    "Q_x": 2, "R_y": 2, "S_inv": (2, 2), "K_x": (2, 2), "K_d": (2, 2),
}  # fmt: skip
FILTER_RECORD = record(**_FILTER_FIELDS)


def set_signs(b: np.void, kinds: Sequence[int]) -> None:
    """Fill the sign of N that supports each hypothesis of a block, in all of its onset tests."""
    signs = np.zeros(GROUP_SIZE * len(b["tests"]))
    signs[: len(kinds)] = [SIGN_OF_KIND[kind] for kind in kinds]
    b["tests"]["supporting_correlation_sign"] = signs.repeat(N_SLOTS).reshape(-1, N_GROUP_TESTS)


@sized
def block_dtype(size: BlockCapacity) -> np.dtype:
    """A block: its whitening filter and its hypotheses."""
    n_groups = plain(n_test_groups)(size.max_hypotheses)
    return record(
        axes=(int, 2),  # first: a record that begins as another does is taken for one
        **_FILTER_FIELDS,
        # what is subtracted from the rows that it sees, and its directions; bound on the uncertainty there,
        # rad/s2, and whether it holds wherever one surface may be: rows.py
        source=int, m=(2, N_ROWS), eta=2, any_position=int,
        # length of the drift's memory, m, 0 for none; factor on the intensity of a gust
        drift_correlation_length_m=float, Q_scale=float,
        x_known=4, nu=2,  # state of the filter after known faults
        calm=FILTER_RECORD, p=2, pg=float, pp=float,  # in turbulence: filter without gust; p; sums of lambda
        has_coarse=int, g_c=2, x_c=4,  # whether vanes show a gust roughly; state of its filter
        # alarm level, standard deviations; share of it reserved for noise beyond a bounded uncertainty
        alarm_level=float, noise_share=float, eta_rate=float, eta_0=2, eta_r=2,
        n_Z=int, columns=(int, size.max_regressors), tol=size.max_regressors,
        regressor=(size.max_regressors, 2), x_Z=(size.max_regressors, 4), g_Z=(size.max_regressors, 2),
        n_h=int, hypothesis=(HYPOTHESIS_RECORD, size.max_hypotheses),
        tests=(TESTS_RECORD, n_groups),
        R=(n_groups, size.max_regressors, N_GROUP_TESTS),
    )  # fmt: skip


def new_filter_block(P: np.ndarray, R: np.ndarray) -> np.ndarray:
    """A block (1,) that filters n rates and has no hypotheses.

    P (2 n, 2 n): covariance of rates and their drift; R (n,): variance of a reading's noise.
    """
    blocks, n = np.zeros(1, block_dtype(BlockCapacity(1, 1))), len(R)
    b, x, d = blocks[0], slice(0, n), slice(n, 2 * n)
    b["n"], b["axes"], b["R_y"][:n] = n, (0, 1), R
    for name, i, j in (("P_xx", x, x), ("P_xd", x, d), ("P_dd", d, d)):
        b[name][:n, :n] = P[i, j]
    return blocks


@kernel
def invert_symmetric(n, S):
    """S <- S^-1, in place; S (n, n) symmetric, n at most 2."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    a, c, d = S[0, 0], 0.5 * (S[0, 1] + S[1, 0]), S[1, 1]
    det = a * d - c * c
    S[0, 0], S[1, 1] = d / det, a / det
    S[0, 1] = S[1, 0] = -c / det


@kernel
def predict_covariance(b, dt):
    """Predict the covariances over a frame of dt s:

        P <- F P F' + Q,  F = [1 dt; 0 a],  Q = [dt^2 Q_x 0; 0 dt Q_d]        S = P_xx + R_y

    `S_inv` is filled with S, yet to be inverted.
    """
    P_xx, P_xd, P_dd, S = b.P_xx, b.P_xd, b.P_dd, b.S_inv
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
    """P_dd <- P_dd + Q_scale m var_turn m': what a fast turn of the gusts' axes may change in the drift."""
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
            b.K_x[i, j], b.K_d[i, j] = K_x, K_d


@kernel
def update_covariance(b):
    """Update the covariances for the measurement: P <- P - K S K'."""
    K_x, K_d = b.K_x, b.K_d
    for j in range(2):  # a column follows from itself alone
        xx_0, xx_1 = b.P_xx[0, j], b.P_xx[1, j]
        xd_0, xd_1 = b.P_xd[0, j], b.P_xd[1, j]
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

    x (4,): e, rad/s, and d, rad/s2; advanced in place. g (2,) rad/s, filled: with v = nu it has the
    covariance S and is nu~ in statistical.md; e is x~ there, and a alpha_d.
    """
    for i in range(b.n):
        g[i] = x[i] + dt * (v[i] - x[D0 + i])
    for i in range(b.n):
        e, d = g[i], 0.0
        for j in range(b.n):
            e -= b.K_x[i, j] * g[j]
            d += b.K_d[i, j] * g[j]
        x[i] = e
        x[D0 + i] = b.a * x[D0 + i] + d


@kernel
def whiten_calm(b, dt):
    """Whiten nu by the filter without gust; dt s."""
    advance_covariance(b.calm, dt)
    whiten_step(b.calm, b.calm.state, b.nu, dt, b.calm.g)


@kernel
def update_calm_part(b, dt):
    """Fill `p` (2,) rad/s with lam p, the part of g that calm air makes predictable.

        p = g - g_0      pg = sum p' S^-1 g      pp = sum p' S^-1 p
        lam = (pg + CALM_PRIOR + CALM_STDS sqrt D) / D in [0, 1],      D = pp + CALM_PRIOR

    The sums are over the last CALM_MEMORY_S. g_0: of `whiten_calm`, which ran before. lam is that of the
    least squares, with a prior for calm air, and CALM_STDS standard deviations larger.
    """
    p, g, decay = b.p, b.g, np.exp(-dt / CALM_MEMORY_S)
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


@kernel
def restarting_slot(k):
    """The slot that restarts at frame k: slot j at odd multiples of 2^j, the last at all other frames."""
    j = 0
    while k % 2 == 0 and j < N_SLOTS - 1:
        k //= 2
        j += 1
    return j


@kernel
def tests_in_group(b, i):
    """The number of onset tests in use in group i: the first entries of each array."""
    return min(b.n_h - i * GROUP_SIZE, GROUP_SIZE) * N_SLOTS


@kernel
def n_test_groups(n_h):
    """The number of groups of onset tests that n_h hypotheses need."""
    return (n_h + (GROUP_SIZE - 1)) // GROUP_SIZE


@kernel
def reset_slot(b, slot):
    """Restart a slot: its onset is the next frame, without evidence."""
    for group in range(n_test_groups(b.n_h)):
        t = b.tests[group]
        for k in range(slot, tests_in_group(b, group), N_SLOTS):
            t.left[k] = 1.0
            t.correlation[k] = t.information[k] = t.N_p[k] = t.correlation_from_coarse_gust[k] = 0.0
            t.e_0[k] = t.e_tv[k] = t.e_w[k] = t.w[:, k] = t.x_s[:, k] = b.R[group, : b.n_Z, k] = 0.0


@kernel
def bound_responses(b, dt):
    """Fill eta_0 = eta |g_0| and eta_r = RINGING_FACTOR |K_d^-1| eta, (2,) rad/s.

        g_0 = dt (1 - a) / (K_x (1 - a) + dt K_d)      |K_d^-1|: magnitudes of the cofactors c, over det

    g_0 s: what the drift leaves of a unit constant, on an axis by itself.
    """
    K_d, lost = b.K_d, 1.0 - b.a
    det = K_d[0, 0] * K_d[1, 1] - K_d[0, 1] * K_d[1, 0] if b.n > 1 else K_d[0, 0]
    for i in range(b.n):
        b.eta_r[i] = 0.0
        for j in range(b.n):
            c = 1.0 if b.n == 1 else (K_d[1 - i, 1 - i] if i == j else K_d[i, j])
            b.eta_r[i] += RINGING_FACTOR * abs(c / det) * b.eta[j]
        b.eta_0[i] = b.eta[i] * dt * lost / (b.K_x[i, i] * lost + dt * K_d[i, i])


@kernel
def update_signatures(h, t, first):
    """Fill s (2,) rad/s2 of hypothesis h for each of its onsets, tests first, first + 1, ...

    It is the signature of the frame; for a growing loss times 1 - left, left = exp(-kappa t); for the end of
    a loss that of the onset.
    """
    for k in range(first, first + N_SLOTS):
        grown = 1.0
        if h.kind == GROWING_LOSS:
            t.left[k] *= h.decay
            grown -= t.left[k]
        elif h.kind == LOSS_END:
            if t.left[k] == 0.0:
                continue
            t.left[k] = 0.0
        for i in range(2):
            t.s[i, k] = grown * h.signature[i]


@kernel
def accumulate_tests(b, t, n, dt, decay):
    """Whiten s of the first n tests of a group t, and add the frame to their sums, axis by axis:

        w = S^-1 g_s      N <- decay N + w' g      D <- decay D + w' g_s
        N_p <- decay N_p + w' p                    N_c <- decay N_c + w' g_c
        e_0 <- decay e_0 + eta_0' |w|              e_tv <- decay e_tv + eta_r' |w - w_before|
        e_w <- decay e_w + eta_rate eta_r' |w|

    In a block of one axis all values of a second axis are zero.
    """
    x, g_s, w, a, N_c = t.x_s, t.g_s, t.w, b.a, t.correlation_from_coarse_gust
    for i in range(b.n):
        for k in range(n):
            g_s[i, k] = x[i, k] + dt * (t.s[i, k] - x[D0 + i, k])
            x[i, k] = g_s[i, k]
            x[D0 + i, k] *= a
    for i in range(b.n):
        for j in range(b.n):
            K_x, K_d = b.K_x[i, j], b.K_d[i, j]
            for k in range(n):
                x[i, k] -= K_x * g_s[j, k]
                x[D0 + i, k] += K_d * g_s[j, k]
        S_0, S_1, g, p, g_c = b.S_inv[i, 0], b.S_inv[i, 1], b.g[i], b.p[i], b.g_c[i]
        keep = 1.0 if i else decay  # the sums of both axes decay once a frame
        c, r, r_w = b.eta_0[i], b.eta_r[i], b.eta_rate * b.eta_r[i]
        for k in range(n):
            w_i = S_0 * g_s[0, k] + S_1 * g_s[1, k]
            t.correlation[k] = keep * t.correlation[k] + w_i * g
            t.information[k] = keep * t.information[k] + w_i * g_s[i, k]
            t.N_p[k] = keep * t.N_p[k] + w_i * p
            N_c[k] = keep * N_c[k] + w_i * g_c
            t.e_0[k] = keep * t.e_0[k] + c * abs(w_i)
            t.e_tv[k] = keep * t.e_tv[k] + r * abs(w_i - w[i, k])
            t.e_w[k] = keep * t.e_w[k] + r_w * abs(w_i)
            w[i, k] = w_i


@kernel
def accumulate_regressors(b, t, R, n, decay):
    """Add the frame to R (regressors, tests) of the first n tests of a group t, and fill their e_R:

        R_j <- decay R_j + w' g_Zj      e_R = sum_j tol_j |R_j|

    R_j is N_j in statistical.md.
    """
    w, e_R, g = t.w, t.e_R, b.g_Z
    e_R[:n] = 0.0
    for j in range(b.n_Z):
        g_0, g_1, tol_j = g[j, 0], g[j, 1], b.tol[j]
        for k in range(n):
            R_j = decay * R[j, k] + (w[0, k] * g_0 + w[1, k] * g_1)
            R[j, k] = R_j
            e_R[k] += tol_j * abs(R_j)


@kernel
def accumulate_evidence(b, dt, decay):
    """Add the frame just whitened to the sums of every hypothesis and onset; decay: factor on earlier frames,
    1 before the alarm."""
    for h in range(b.n_h):
        update_signatures(b.hypothesis[h], b.tests[h // GROUP_SIZE], (h % GROUP_SIZE) * N_SLOTS)
    for i in range(n_test_groups(b.n_h)):
        t, n = b.tests[i], tests_in_group(b, i)
        accumulate_tests(b, t, n, dt, decay)
        accumulate_regressors(b, t, b.R[i], n, decay)


@kernel
def uncertain_share(t, k, r0, r1):
    """The share of |N| in test k that a bounded uncertainty explains, the room of statistical.md:

        room = eta_bar (|g_0| sum |w| + 1.2 / K_d sum |dw|) = e_0 + min(e_tv + eta_r' |w|, e_w)

    dw: change of w from frame to frame; r0, r1: eta_r. eta_r' |w| is the change when the weight drops to zero
    at the end; e_w takes the place of the changes if the uncertainty is slow.
    """
    drop = r0 * abs(t.w[0, k]) + r1 * abs(t.w[1, k])
    return t.e_0[k] + min(t.e_tv[k] + drop, t.e_w[k])


@kernel
def max_llr(signed, N, D):
    """Largest log-likelihood ratio of a fault against none, over all sizes theta:

        max_theta theta N - theta^2 D / 2 = N^2 / 2 D

    If signed, |theta| is at most 1, as that of a loss: N - D / 2 where N > D. 0 for an N of the other sign.
    """
    llr = 0.5 * N * N / D
    if signed and N > D:
        llr = N - 0.5 * D
    # The zero is not returned earlier: each way out would be a division of its own.
    return llr if N > 0.0 else 0.0


@kernel
def evidence_ratio(z, share, N, room, D):
    """The score of a test: evidence over what noise, and uncertainty with noise, allow.

        N / max(sqrt(D), room / z + share sqrt(D))

    N: evidence after the allowances; D: its variance; room: what a bounded uncertainty explains of it. z:
    alarm level, with which the score is compared; share: share of z that is reserved for noise in addition to
    room.
    """
    std = sqrt(D)
    return N / (std if room <= 0.0 else max(std, room / z + share * std))


@kernel
def evaluate_tests(b, t, n, without_eta, mapped):
    """Fill the score and the log-likelihood ratios of the first n tests of a group t; 0 without information.

        score = (N_s - e) / max(sqrt(D), room / z + share sqrt(D))
        llr = max_llr(N_s)      llr_lo, llr_hi = max_llr(N_s -+ (e + room))

    N_s: sign N, or |N| without a sign; e = e_R + max(sign N_p, 0) + max(sign N_c, 0); room: of
    `uncertain_share`; z: the alarm level.
    without_eta: the bounds on the ratios leave out room. mapped: the bounds on hypotheses other than a loss
    always include it, because the model's error is mapped: it is then large and lasting.
    """
    z, share, r0, r1 = b.alarm_level, b.noise_share, b.eta_r[0], b.eta_r[1]
    for k in range(n):
        N, D, sign = t.correlation[k], t.information[k], t.supporting_correlation_sign[k]
        signed, known = sign != 0.0, D > 0.0
        N_s = sign * N if signed else abs(N)
        e = t.e_R[k] + max(sign * t.N_p[k], 0.0) + max(sign * t.correlation_from_coarse_gust[k], 0.0)
        room = uncertain_share(t, k, r0, r1)
        score = evidence_ratio(z, share, N_s - e, room, D)
        e += 0.0 if without_eta and (signed or not mapped) else room
        llr, lo, hi = max_llr(signed, N_s, D), max_llr(signed, N_s - e, D), max_llr(signed, N_s + e, D)
        t.score[k] = score if known else 0.0
        t.llr_lo[k] = lo if known else 0.0
        t.llr_hi[k] = hi if known else 0.0
        t.llr[k] = llr if known else -1.0


@kernel
def evaluate_hypotheses(b, decay=0.0, mapped=False):
    """Fill the score, the estimate and the bounds on the log-likelihood ratio of each hypothesis.

    They are the largest over its onsets. decay: if a loss may end, the factor by which earlier upper bounds
    decay; else 0. mapped: see `evaluate_tests`.
    """
    for i in range(n_test_groups(b.n_h)):
        evaluate_tests(b, b.tests[i], tests_in_group(b, i), decay > 0.0, mapped)
    for h, hyp in enumerate(b.hypothesis[: b.n_h]):
        t, first = b.tests[h // GROUP_SIZE], (h % GROUP_SIZE) * N_SLOTS
        k_best = first
        hyp.score, hyp.llr_lo, hyp.llr_hi = 0.0, 0.0, decay * hyp.llr_hi
        for k in range(first, first + N_SLOTS):
            hyp.score = max(hyp.score, t.score[k])
            hyp.llr_lo, hyp.llr_hi = max(hyp.llr_lo, t.llr_lo[k]), max(hyp.llr_hi, t.llr_hi[k])
            if t.llr[k] > t.llr[k_best]:
                k_best = k
        if t.llr[k_best] > -1.0:
            N, hyp.D = t.correlation[k_best], t.information[k_best]
            hyp.th = estimate_theta(hyp.kind, N, hyp.D)


@kernel
def update_block(b, dt, decay, hi_decay=0.0, mapped=False):
    """Update a block with one frame of the innovation nu: whiten it and test every hypothesis; dt s.

    Noise, bound, drift, signatures and regressors are those of the frame. decay:
    `accumulate_evidence`; hi_decay and mapped: `evaluate_hypotheses`.
    """
    advance_covariance(b, dt)
    if b.alarm_level > 0.0:
        bound_responses(b, dt)
    whiten_step(b, b.state, b.nu, dt, b.g)
    if b.calm.n > 0:
        update_calm_part(b, dt)
    if b.has_coarse:
        whiten_step(b, b.x_c, b.g_c, dt, b.g_c)
    for j in range(b.n_Z):
        whiten_step(b, b.x_Z[j], b.regressor[j], dt, b.g_Z[j])
    accumulate_evidence(b, dt, decay)
    evaluate_hypotheses(b, hi_decay, mapped)


@kernel
def estimate_theta(kind, N, D):
    """The most likely theta: N / D; of a loss, in [-1, 0], with the mean and variance that a uniform one has:

    th = (N - LOSS_PRIOR / 2) / (D + LOSS_PRIOR)
    """
    if kind not in (LOSS, GROWING_LOSS, LOSS_END):
        return N / D
    th = (N - 0.5 * LOSS_PRIOR) / (D + LOSS_PRIOR)
    return min(max(th, -1.0), 0.0)
