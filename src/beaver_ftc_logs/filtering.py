"""The kernels of the bank of filters: one causal pass through a flight, with all hypotheses in parallel.

Under hypothesis h, with effectiveness a_h of the groups, the part of the rates unexplained by the past is

    y = b + s (c + sum_g a_hg F_g) + sum_g d_g kappa_hg F_g + noise = C_h' x + noise,      noise ~ t(0, q r R)

    n, H, G         samples, hypotheses, groups; N = 4 + G states
    y, F, c         unexplained rates (n, 3), healthy responses (n, G, 3), intercept (3,), rad/s, as in
                    `regression`
    a, kappa        effectiveness (H, G), and share of a response that the group's own gain multiplies (H, G)
    x, P            state: trim b (3,) rad/s, common gain s, gain d (G,) of each group; its covariance
    C               effect of the states on y, (N, 3)
    p               probability of each hypothesis (H,)
    R               covariance of the noise (3, 3), (rad/s)2; W whitens it
    nu              degrees of freedom of the t distribution of the noise
    r               running scale of the variance of the noise
    q               variance of a sample over that of the noise, larger after quick commands (`quick_scale`)
    V               covariance of a sample with its scale, q r R, where r is at least `posterior.recent_scale`
    e, S, K         residual y - C' x (3,), its covariance (3, 3), gain (N, 3)
    d2              e' S^-1 e
    ll              log likelihood of a sample

The states belong to the flight: each hypothesis estimates them with a Kalman filter. The common gain
multiplies the sum of the intercept and all responses. This sum vanishes in trimmed flight. So the common gain
changes the motion about the trim, as the dynamic pressure does, and not the trim. One hypothesis changes to
another at random times (interacting multiple models [Blom1988]). The new one takes over trim and gains, plus
an offset of the rates if a surface may be stuck. The last hypothesis is that nothing answers the commands, as
on the ground: it estimates no trim and no gain.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import MIN_PROBABILITY

_MIN_NOISE_SCALE = 0.3  # limits of the running scale r
_MAX_NOISE_SCALE = 6.0
_SQUARE_CLIP = 3.0  # limit of d2 per axis in the running scale
# Mean of the clipped d2 per axis if the running scale is right: between 0.91, of a t distribution with 8
# degrees of freedom and the covariance S, and 0.98, of a normal one.
_MEAN_SQUARE = 0.93


@kernel(allocates=True)
def run_bank(y, F, ok, bank, states, noise, r_min, q):
    """Posterior probabilities (n, H), and the log likelihood of each sample given all before it, but for a
    constant, (n,): log sum_h prior_h exp(ll_h), as in `_correct`; 0 for a sample that is not used.

    ok (n,): whether the sample may be used. bank: HypothesisBank of `bank`; states: StateModel, noise:
    ResidualNoise, both of `flight_states`; r_min (n,): lower bound of the scale of the noise; q (n,). After
    each sample that is used

        r <- r exp((1 - p_none) (d2 / 3 - _MEAN_SQUARE) / scale_memory_samples)

    between _MIN_NOISE_SCALE and _MAX_NOISE_SCALE, with the probability p_none that nothing answers, and d2
    clipped and averaged over the hypotheses.
    """
    n = len(y)
    H = len(bank.transition_share)
    N = len(states.initial_mean)
    last = H - 1
    p = bank.prior_probability.copy()
    x = np.zeros((H, N)) + states.initial_mean
    P = np.zeros((H, N, N)) + states.initial_covariance
    lo = states.initial_mean - states.max_deviation
    hi = states.initial_mean + states.max_deviation
    post = np.zeros((n, H))
    ll = np.zeros(n)
    r = 1.0
    for k in range(n):
        prior = _mix(p, x, P, bank, states.random_walk_variance)
        _relax(x, P, states)
        x[last] = states.initial_mean  # the hypothesis that nothing answers estimates no state
        P[last] = states.initial_covariance
        if ok[k]:
            p, d2, ll[k] = _correct(prior, x, P, y[k], F[k], bank, noise, q[k] * max(r, r_min[k]))
            x[:] = np.minimum(np.maximum(x, lo), hi)  # bounded, so that no hypothesis adapts to a fault
            r *= np.exp((1.0 - p[last]) * (d2 / 3.0 - _MEAN_SQUARE) / noise.scale_memory_samples)
            r = min(max(r, _MIN_NOISE_SCALE), _MAX_NOISE_SCALE)
        else:
            p = prior
        post[k] = p
    return post, ll


@kernel(allocates=True)
def _mix(p, x, P, bank, walk):
    """Interaction of the hypotheses: each may change to any other. x (H, N) and P (H, N, N) are replaced.
    Returns the prior probabilities (H,):

        prior_h = (1 - change) p_h + change share_h
        m = sum_h p_h x_h,    M = sum_h p_h (P_h + (x_h - m)(x_h - m)')

    m (N,), M (N, N): mean and covariance of the mixture of all hypotheses.
    """
    H, N = x.shape
    change = bank.change_probability_per_sample
    kept = (1.0 - change) * p
    prior = kept + change * bank.transition_share
    m = p @ x
    M = np.zeros((N, N))
    for h in range(H):
        M += p[h] * (P[h] + np.outer(x[h] - m, x[h] - m))
    for h in range(H):
        _merge(kept[h] / prior[h], x[h], P[h], m, M, bank.rate_offset_variance[h], walk)
    return prior / prior.sum()


@kernel(allocates=True)
def _merge(w, x, P, m, M, offset, walk):
    """Replace two Gaussians by one with the same moments: (x, P) of the hypothesis, with weight w, and (m, M)
    of the mixture of all hypotheses, with weight v = 1 - w:

        x <- w x + v m,    P <- w P + v (M + offset) + w v dx dx' + walk,    dx = x - m

    x (N,) and P (N, N) are replaced. offset (3,): variance of the offset of the rates that comes with a
    change to this hypothesis, added to that of the trim; walk (N,): variance added a sample.
    """
    v = 1.0 - w
    dx = x - m
    P[:] = w * P + v * M + (w * v) * np.outer(dx, dx)
    x[:] = w * x + v * m
    for i in range(len(walk)):
        P[i, i] += walk[i]
    for i in range(len(offset)):
        P[i, i] += v * offset[i]


@kernel(allocates=True)
def _relax(x, P, states):
    """Move all trims and gains towards those m of the model, by one sample, with the retention rho (N,):

    x <- m + rho (x - m),    P_ij <- rho_i rho_j P_ij,    x (H, N) and P (H, N, N) are replaced
    """
    m = states.initial_mean
    rho = states.deviation_retention
    x[:] = m + rho * (x - m)
    P *= np.outer(rho, rho)


@kernel(allocates=True)
def _correct(prior, x, P, y, F, bank, noise, scale):
    """Kalman correction of every hypothesis by one sample y (3,), F (G, 3); x and P are replaced. The last
    hypothesis has no states: nothing answers.

        ll_h = effective_sample_share (-((nu + 3) / 2) log(1 + min(d2_h, d2_max) / nu) - log(det S_h) / 2)
        p_h ~ prior_h exp(ll_h)

    scale: q r, so V = scale R. d2_max: max_squared_residual. Returns the posterior probabilities (H,), d2 (in
    the covariance without its inflation) clipped to 3 _SQUARE_CLIP and averaged over them, and log sum_h
    prior_h exp(ll_h).
    """
    H, N = x.shape
    ll = np.empty(H)
    d2 = np.empty(H)
    none = np.zeros((N, 3))
    V = noise.covariance * scale
    nu = noise.t_degrees_of_freedom
    for h in range(H):
        C = _sensitivities(bank.effectiveness[h], bank.own_gain_share[h], F, noise.intercept_rad_s, N)
        d2[h], log_det = _update(x[h], P[h], y, none if h == H - 1 else C, V, noise)
        log_t = -0.5 * (nu + 3.0) * np.log(1.0 + min(d2[h], noise.max_squared_residual) / nu)
        ll[h] = noise.effective_sample_share * (log_t - 0.5 * log_det)
    top = ll.max()
    p = np.maximum(prior * np.exp(ll - top), MIN_PROBABILITY)
    total = p.sum()
    p /= total
    mean = p @ np.minimum(noise.covariance_inflation * d2, 3.0 * _SQUARE_CLIP)
    return p, mean, top + np.log(total)


@kernel(allocates=True)
def _sensitivities(a, kappa, F, c, N):
    """Effect of the states on the unexplained rates, C (N, 3):

        rows 0 to 2     1                           trim
        row 3           c + sum_g a_g F_g           common gain
        row 4 + g       kappa_g F_g                 own gain of group g

    a, kappa (G,): those of one hypothesis; F (G, 3), c (3,).
    """
    C = np.zeros((N, 3))
    C[:3] = np.eye(3)
    C[3] = c
    for g in range(len(a)):
        C[4 + g] = kappa[g] * F[g]
        C[3] += a[g] * F[g]
    return C


@kernel(allocates=True)
def _update(x, P, y, C, V, noise):
    """Correct one Gaussian, x (N,) and P (N, N), by y (3,) = C' x + noise of covariance V; both are replaced:

        e = y - C' x,   D = P C,   S = V + C' D,   d2 = e' S^-1 e,   K = D S^-1 min(1, (nu + 3) / (nu + d2))
        x <- x + K e,   P <- P - K D'

    The last factor of K reduces it for a residual in the tail of the t distribution. K is 0 if d2 is at least
    max_squared_residual. Returns d2 and log(det S).
    """
    nu = noise.t_degrees_of_freedom
    D = P @ C
    e = y - x @ C
    S_inv, det = _invert(V + C.T @ D)
    d2 = e @ S_inv @ e
    K = D @ S_inv
    K *= min(1.0, (nu + 3.0) / (nu + d2)) if d2 < noise.max_squared_residual else 0.0
    x += K @ e
    P -= K @ D.T
    P[:] = 0.5 * (P + P.T)  # an asymmetry from rounding would grow without bound
    return d2, np.log(det)


@kernel(allocates=True)
def _invert(S):
    """Inverse and determinant of a symmetric matrix S (3, 3), by its cofactors A:

        A_i = S_i+1 x S_i+2  (rows, cyclically),    det S = S_0.A_0,    S^-1 = A / det S, since A = A'

    A negative index of an array counts from its end: i - 2 and i - 1 are i + 1 and i + 2 modulo 3.
    """
    A = np.empty((3, 3))
    for i in range(3):
        u = S[i - 2]
        v = S[i - 1]
        for j in range(3):
            A[i, j] = u[j - 2] * v[j - 1] - u[j - 1] * v[j - 2]
    det = S[0] @ A[0]
    return A / det, det
