"""Generalised likelihood ratio tests on the whitened innovation [Willsky1976].

The filter of whitening.py whitens the innovation. It is linear, so the response to a fault or to an error of
a coefficient is worked out by itself and compared with the whitened innovation.

A hypothesis is a fault phi = theta s(t) from an onset on, with s(t) a known signature. g_s is the response of
the whitening filter to the signature, g the whitened innovation, rad/s, S its covariance:

    N = sum g_s' S^-1 g,  D = sum g_s' S^-1 g_s:      theta_hat = N / D,   log likelihood ratio N^2 / 2 D

Without a fault N / sqrt(D) is standard normal (or smaller, if the noise is smaller than declared). The alarm
level follows from the declared rate of false alarms by the union bound over hypotheses, onsets and frames.

Errors of coefficients are constants c_j, |c_j| <= tol_j, times known regressors r_j. Through the same filter
they add sum_j c_j R_j to N, with R_j = sum g_s' S^-1 g_rj. That is at most sum_j tol_j |R_j|, which is
subtracted from the evidence.

A bounded uncertainty |delta| <= eta_bar is not noise. g_delta is the response of the filter to it. The
response to a unit constant settles at g_inf; the response to a unit step also has a transient whose sum is
1 / K_d and whose magnitudes sum to at most RINGING / K_d (RINGING_FACTOR). With w = S^-1 g_s, summation by
parts gives

    |sum w' g_delta| <= eta_bar (|g_inf| sum |w| + RINGING / K_d TV(w)),     TV(w) = sum |w - w_before|

delta changes by at most eta_bar omega dt in a frame, so omega dt sum |w| may replace TV(w). An alarm requires
more evidence than this bound explains.

A growing loss is a loss times 1 - exp(-kappa t). The end of a loss is a step of the opposite sign, of the
size that the signature had at the onset. These hypotheses raise no alarm; they are needed to decide whether
a fault of a surface can explain the data.

In air that is calmer than declared, a part p of g is predictable, to which the control law reacts
(whitening.py). The evidence that this part contributes is subtracted from that of hypotheses with a sign,
which follow the commands of the law.

A gust may be visible to the vanes only roughly, if no force separates it from the aircraft's own motion
(gusts.py). It correlates with the surfaces of a law that uses the vanes. Its response is whitened likewise,
and the evidence that it contributes is subtracted likewise.

blocks.py has the records, and the onsets that are tested.

Letters of the kernels. b is a block, i an axis, j a regressor, k an onset test, h a hypothesis, t a group of
onset tests; a digit at the end of g or S is an axis.

    nu             innovation of the frame, rad/s2
    g              whitened response, rad/s: to nu; g_Z to a regressor, g_c to a coarse gust, g_s to s
    x              state of a filter, in the same way: x_Z, x_c, x_s; of two axes first the rates, from D0 on
                   the drift
    K_x, K_d       gains of the filter: on the rate, without unit, and on the drift, 1/s
    S, S_inv       covariance of g, rad2/s2, and its inverse
    a              decay of the drift in a frame
    s, w           signature since the onset, rad/s2; S^-1 g_s, s/rad
    N, D           sums as above; N_p, N_c: shares of N by p and by a coarse gust
    Z, tol, R      regressor, rad/s2; its tolerance; R_j
    e_R            sum tol |R|
    eta, eta_0     eta_bar, rad/s2; eta_bar |g_inf|, rad/s
    eta_r          eta_bar RINGING / K_d, rad/s
    eta_rate       omega dt
    e_0, e_tv, e_w shares of |N| by eta_bar: sums of eta_0 |w|, eta_r TV(w), eta_r eta_rate |w|
    th             theta

statistical.md writes nu~_chi for g_s, chi for s, N_j for R_j, d for delta, room for the share of |N| by
eta_bar, z for the alarm level.
"""

from math import sqrt

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.blocks import (
    GROUP_SIZE,
    GROWING_LOSS,
    LOSS,
    LOSS_END,
    N_SLOTS,
    n_test_groups,
    tests_in_group,
)
from beaver_ftc.diagnosis.detection.whitening import D0, advance_covariance, update_calm_part, whiten_step

LOSS_PRIOR = 12.0  # one over the variance of a loss that is uniform on [0, 1]
# The magnitudes of a second-order transient of damping 0.7 sum to 1.09 times its sum; on two axes to more.
RINGING_FACTOR = 1.2


@kernel
def reset_slot(b, slot):
    """Restart a slot of every hypothesis: its onset is the frame that is added next, its evidence zero."""
    for group in range(n_test_groups(b.n_h)):
        t = b.tests[group]
        for k in range(slot, tests_in_group(b, group), N_SLOTS):
            t.left[k] = 1.0
            t.x_s[:, k] = t.w[:, k] = 0.0
            t.N[k] = t.D[k] = t.N_p[k] = t.N_c[k] = 0.0
            t.e_0[k] = t.e_tv[k] = t.e_w[k] = b.R[group, : b.n_Z, k] = 0.0


@kernel
def bound_responses(b, dt):
    """Fill eta_0 = eta |g_inf| and eta_r = RINGING_FACTOR |K_d^-1| eta, (2,) rad/s.

        g_inf = dt (1 - a) / (K_x (1 - a) + dt K_d)      |K_d^-1|_ij = |c_ij / det|

    g_inf s: response to a unit constant that the drift leaves in the end, on an axis by itself; c_ij:
    cofactors of K_d, det: its determinant.
    """
    K_d = b.K_d
    lost = 1.0 - b.a
    det = K_d[0, 0] * K_d[1, 1] - K_d[0, 1] * K_d[1, 0] if b.n > 1 else K_d[0, 0]
    for i in range(b.n):
        b.eta_r[i] = 0.0
        for j in range(b.n):
            c = 1.0 if b.n == 1 else (K_d[1 - i, 1 - i] if i == j else K_d[i, j])
            b.eta_r[i] += RINGING_FACTOR * abs(c / det) * b.eta[j]
        b.eta_0[i] = b.eta[i] * dt * lost / (b.K_x[i, i] * lost + dt * K_d[i, i])


@kernel
def update_signatures(h, t, first):
    """Fill s (2,) rad/s2 of hypothesis h for each of its onsets, which are the tests first, first + 1, ... of
    group t.

        GROWING_LOSS    left <- left exp(-kappa dt), then s = (1 - left) signature
        LOSS_END        s = the signature in the frame of the onset, in which left turns from 1 to 0
        others          s = signature
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

    g_s follows `whiten_step` with v = s, which is written out for vectors of tests. In a block of one axis
    all values of a second axis are zero. decay: factor on the evidence of earlier frames.
    """
    x = t.x_s
    g_s = t.g_s
    w = t.w
    a = b.a
    for i in range(b.n):
        for k in range(n):
            g_s[i, k] = x[i, k] + dt * (t.s[i, k] - x[D0 + i, k])
            x[i, k] = g_s[i, k]
            x[D0 + i, k] *= a
    for i in range(b.n):
        for j in range(b.n):
            K_x = b.K_x[i, j]
            K_d = b.K_d[i, j]
            for k in range(n):
                x[i, k] -= K_x * g_s[j, k]
                x[D0 + i, k] += K_d * g_s[j, k]
        S_0 = b.S_inv[i, 0]
        S_1 = b.S_inv[i, 1]
        g = b.g[i]
        p = b.p[i]
        g_c = b.g_c[i]
        keep = 1.0 if i else decay  # the sums of both axes decay once a frame
        c = b.eta_0[i]
        r = b.eta_r[i]
        r_w = b.eta_rate * b.eta_r[i]
        for k in range(n):
            w_i = S_0 * g_s[0, k] + S_1 * g_s[1, k]
            t.N[k] = keep * t.N[k] + w_i * g
            t.D[k] = keep * t.D[k] + w_i * g_s[i, k]
            t.N_p[k] = keep * t.N_p[k] + w_i * p
            t.N_c[k] = keep * t.N_c[k] + w_i * g_c
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
    w = t.w
    e_R = t.e_R
    g_Z = b.g_Z
    e_R[:n] = 0.0
    for j in range(b.n_Z):
        g_0 = g_Z[j, 0]
        g_1 = g_Z[j, 1]
        tol_j = b.tol[j]
        for k in range(n):
            R_j = decay * R[j, k] + (w[0, k] * g_0 + w[1, k] * g_1)
            R[j, k] = R_j
            e_R[k] += tol_j * abs(R_j)


@kernel
def accumulate_evidence(b, dt, decay):
    """Add the frame just whitened to the sums of every hypothesis and onset. decay: factor on the evidence of
    earlier frames, 1 before the alarm."""
    for h in range(b.n_h):
        update_signatures(b.hypothesis[h], b.tests[h // GROUP_SIZE], (h % GROUP_SIZE) * N_SLOTS)
    for i in range(n_test_groups(b.n_h)):
        t = b.tests[i]
        n = tests_in_group(b, i)
        accumulate_tests(b, t, n, dt, decay)
        accumulate_regressors(b, t, b.R[i], n, decay)


@kernel
def uncertain_share(t, k, r0, r1):
    """The share of |N| in test k that a bounded uncertainty explains, the room of statistical.md:

        room = e_0 + min(e_tv + eta_r' |w|, e_w)  <=  eta_bar (|g_inf| sum |w| + RINGING / K_d TV(w))

    r0, r1: eta_r of the two axes. eta_r' |w| is the change when the
    weight drops to zero after the last frame. The changes of a slow uncertainty itself may be less: then e_w
    takes the place of those of w.
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

    N: evidence after the allowances; D: its variance; room: part of N that a bounded uncertainty explains; z:
    alarm level, with which the score is compared; share: part of z that is reserved for noise in addition to
    the room.
    """
    std = sqrt(D)
    return N / (std if room <= 0.0 else max(std, room / z + share * std))


@kernel
def evaluate_tests(b, t, n, without_eta, mapped):
    """Fill the score and the log-likelihood ratios of the first n tests of a group t; without information
    they are 0, and llr is -1.

        score = (N_s - allowed) / max(sqrt(D), room / z + share sqrt(D))
        llr = max_llr(N_s)      llr_lo, llr_hi = max_llr(N_s -+ (allowed + room))

    N_s: sign N, or |N| if sign is 0; allowed = e_R + max(sign N_p, 0) + max(sign N_c, 0); room: of
    `uncertain_share`; z: alarm level; share: `noise_share`.

    without_eta: the bounds on the ratios leave out the room. mapped: for hypotheses that have no sign they
    include it even then, because the mapped error of a model is large and lasting.
    """
    z = b.alarm_level
    share = b.noise_share
    r0 = b.eta_r[0]
    r1 = b.eta_r[1]
    for k in range(n):
        D = t.D[k]
        sign = t.sign[k]
        signed = sign != 0.0
        known = D > 0.0
        N_s = sign * t.N[k] if signed else abs(t.N[k])
        allowed = t.e_R[k] + max(sign * t.N_p[k], 0.0) + max(sign * t.N_c[k], 0.0)
        room = uncertain_share(t, k, r0, r1)
        score = evidence_ratio(z, share, N_s - allowed, room, D)
        allowed += 0.0 if without_eta and (signed or not mapped) else room
        llr = max_llr(signed, N_s, D)
        lo = max_llr(signed, N_s - allowed, D)
        hi = max_llr(signed, N_s + allowed, D)
        t.score[k] = score if known else 0.0
        t.llr_lo[k] = lo if known else 0.0
        t.llr_hi[k] = hi if known else 0.0
        t.llr[k] = llr if known else -1.0


@kernel
def evaluate_hypotheses(b, decay, mapped):
    """Fill the score and the bounds on the log-likelihood ratio of each hypothesis, the largest over its
    onsets, and of a loss the most likely theta in [-1, 0], at its likeliest onset, and D there:

        th = (N - LOSS_PRIOR / 2) / (D + LOSS_PRIOR)    prior: mean -1/2 and variance of a uniform theta

    decay: if a loss may end, the factor by which earlier upper bounds decay and still count, and the bounds
    leave out the room; else 0. mapped: see `evaluate_tests`.
    """
    for i in range(n_test_groups(b.n_h)):
        evaluate_tests(b, b.tests[i], tests_in_group(b, i), decay > 0.0, mapped)
    for h, hyp in enumerate(b.hypothesis[: b.n_h]):
        t = b.tests[h // GROUP_SIZE]
        first = (h % GROUP_SIZE) * N_SLOTS
        k_best = first
        hyp.score = hyp.llr_lo = 0.0
        hyp.llr_hi *= decay
        for k in range(first, first + N_SLOTS):
            hyp.score = max(hyp.score, t.score[k])
            hyp.llr_lo = max(hyp.llr_lo, t.llr_lo[k])
            hyp.llr_hi = max(hyp.llr_hi, t.llr_hi[k])
            if t.llr[k] > t.llr[k_best]:
                k_best = k
        if hyp.kind == LOSS and t.llr[k_best] > -1.0:
            hyp.D = t.D[k_best]
            th = (t.N[k_best] - 0.5 * LOSS_PRIOR) / (hyp.D + LOSS_PRIOR)
            hyp.th = min(max(th, -1.0), 0.0)


@kernel
def update_block(b, dt, decay, hi_decay=0.0, mapped=False):
    """Update a block with one frame of the innovation nu: whiten it and test every hypothesis; dt s.

    Noise, bound, drift, signatures and regressors in the block are those of the frame. The order matters: the
    gains come first, and the evidence uses all responses. decay: of `accumulate_evidence`; hi_decay, mapped:
    decay and mapped of `evaluate_hypotheses`.
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
