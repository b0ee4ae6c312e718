"""The bank of filters: one causal pass through a flight, with all hypotheses in parallel.

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
    V               covariance of a sample with its scale, q r R, where r is at least that of `recent_scale`
    e, S, K         residual y - C' x (3,), its covariance (3, 3), gain (N, 3)
    d2              e' S^-1 e
    ll              log likelihood of a sample

The states belong to the flight: each hypothesis estimates them with a Kalman filter. The common gain
multiplies the sum of the intercept and all responses. This sum vanishes in trimmed flight. So the common gain
changes the motion about the trim, as the dynamic pressure does, and not the trim. One hypothesis changes to
another at random times (interacting multiple models [Blom1988]). The new one takes over trim and gains, plus
an offset of the rates if a surface may be stuck. The last hypothesis is that nothing answers the commands, as
on the ground: it estimates no trim and no gain.

The pass is repeated for each noise model, or else for each delay of the commands that the flight may have.
The results are averaged with the probabilities of these alternatives (`bank_posterior`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import HypothesisBank, build_noise, build_states
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import Innovations, by_noise, innovations
from beaver_ftc_logs.runs import trailing_sums
from beaver_ftc_logs.samples import Samples

_EVIDENCE_MEMORY_S = 600.0  # memory of the comparison of delays or noise models
# Least probability of a hypothesis; also the rounding error of a sum of probabilities.
_MIN_PROBABILITY = 1e-15
_MIN_NOISE_SCALE = 0.3  # limits of the running scale r
_MAX_NOISE_SCALE = 6.0
_SQUARE_CLIP = 3.0  # limit of d2 per axis in the running scale
_SUM_SPANS_S = (0.0, 0.1)  # `recent_scale` sums the residual over each of these; 0: a single sample
_VARIANCE_WINDOW_S = 2.0  # `recent_scale` takes the variance of the sums over the last 2 s
# Mean of the clipped d2 per axis if the running scale is right: between 0.91, of a t distribution with 8
# degrees of freedom and the covariance S, and 0.98, of a normal one.
_MEAN_SQUARE = 0.93
# Probability of a noise model below which a sample leaves it out.
_MIN_NOISE_WEIGHT = 1e-3

# The two results of `run_bank`: probabilities (n, H) and log likelihoods (n,).
BankRun = tuple[Floats, Floats]


def bank_posterior(samples: Samples, model: Model, bank: HypothesisBank) -> Floats:
    """Probability of each hypothesis by sample, (n, H).

    It is a weighted average of several runs of the bank. If the model has noise models (`colours`) and the
    flight is not yet whitened, there is a run for each noise model, otherwise for each command delay of the
    settings. The weights are the probabilities of the runs given the last minutes (`model_weights`): of a
    delay by the likelihood of its run, of a noise model by that of a healthy flight (`_noise_likelihood`). A
    noise model is run only up to the last sample at which its weight is at least _MIN_NOISE_WEIGHT: within a
    second most become far less likely than another.
    """
    if not model.colours or samples.noise_ma_coefficients:
        delays = model.settings.delays_s
        flights = [innovations(_with_command_delay(samples, delay_s), model) for delay_s in delays]
        runs = [run_flight(flight, model, bank) for flight in flights]
        weights = model_weights([ll for _, ll in runs], model.rate_hz)
        return (weights[:, :, None] * np.array([p for p, _ in runs])).sum(axis=0)
    pairs = [(innovations(white, own_model), own_model) for white, own_model in by_noise(samples, model)]
    weights = model_weights([_noise_likelihood(*pair) for pair in pairs], model.rate_hz)
    kept = np.where(weights < _MIN_NOISE_WEIGHT, 0.0, weights)
    kept /= kept.sum(axis=0)
    mean = np.zeros((len(samples.t_s), len(bank.transition_share)))
    for w, (flight, own_model) in zip(kept, pairs, strict=True):
        if n := int(np.flatnonzero(w).max(initial=-1)) + 1:
            p, _ = run_flight(flight.at(slice(n)), own_model, bank)
            mean[:n] += w[:n, None] * p
    return mean


def _noise_likelihood(flight: Innovations, model: Model) -> Floats:
    """Log likelihood of each sample (n,), but for a constant, if all surfaces are healthy, for a flight that
    is whitened by the model's noise; 0 where the sample is not known:

        -power ((nu + 3) log(1 + d2 / nu) + 3 log q + log det R) / 2 + power 3 log sum(ma),   d2 = |e W|^2 / q

    R: covariance of the noise in the fit, without its inflation. ma: moving average of the noise.
    """
    q = flight.quick_scale(model)
    d2 = ((flight.e @ flight.W) ** 2).sum(axis=1) / q
    nu = model.settings.tail
    ll = -0.5 * ((nu + 3.0) * np.log1p(d2 / nu) + 3.0 * np.log(q)) - flight.log_size
    return np.where(flight.is_known, model.settings.power * ll, 0.0)


def fault_evidence(p: Floats, bank: HypothesisBank) -> Floats:
    """Increase of the log odds of a fault by each sample, (n,), from the probabilities p (n, H):

        z[k] = log odds(f[k]) - log odds((1 - change) f[k-1] + entry)

    f: probability of a loss of effectiveness (`is_fault_hypothesis`: not of an unknown offset), at least
    _MIN_PROBABILITY from 0 and 1; change: probability that the hypothesis changes within a sample; entry: the
    probability of a change to a fault. Before the first sample, the prior probability of a fault is used. The
    sum of z is the logarithm of a likelihood ratio.
    """
    is_fault = bank.is_fault_hypothesis
    share = bank.transition_share
    change = bank.change_probability_per_sample
    fault = np.clip(p[:, is_fault].sum(axis=1), _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY)
    entry = change * share[is_fault].sum() / share.sum()
    prior = np.append(bank.prior_probability[is_fault].sum(), (1.0 - change) * fault[:-1] + entry)
    return np.log(fault / (1.0 - fault)) - np.log(prior / (1.0 - prior))


@kernel(allocates=True)
def page_cusum(z, top):
    """Page's sum of the evidence z (n,), between 0 and top:

    sums[k] = min(max(sums[k-1] + z[k], 0), top)
    """
    page = 0.0
    sums = np.zeros(len(z))
    for k in range(len(z)):
        page = min(max(page + z[k], 0.0), top)
        sums[k] = page
    return sums


def _with_command_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act delay_s later than in the model. A negative delay acts earlier; the
    magnitude counts up to one sample.

    A delayed command is interpolated between two samples. The model uses commands from one sample before the
    rates, so a negative delay needs no later command than that of the same sample.
    """
    if delay_s == 0.0:
        return samples
    share = min(abs(delay_s) / samples.dt_s, 1.0)
    u = samples.commands
    neighbour = np.vstack([u[:1], u[:-1]] if delay_s > 0 else [u[1:], u[-1:]])
    return replace(samples, commands=(1.0 - share) * u + share * neighbour)


def model_weights(ll: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each of J alternative models at each sample, (J, n), from their log likelihoods ll, (n,)
    each. Older samples are forgotten exponentially, with the time constant _EVIDENCE_MEMORY_S."""
    from scipy.signal import lfilter

    pole = np.exp(-1.0 / (_EVIDENCE_MEMORY_S * rate_hz))
    sums = lfilter([1.0], [1.0, -pole], np.array(ll), axis=1)
    p = np.exp(sums - sums.max(axis=0))
    return p / p.sum(axis=0)


def run_flight(flight: Innovations, model: Model, bank: HypothesisBank) -> BankRun:
    """The result of `run_bank` for one flight. Under other laws, the scale of the noise has the lower bound
    of `recent_scale`."""
    q = flight.quick_scale(model)
    r_min = np.zeros(len(q))
    if model.vehicle.other_laws:
        white = flight.e @ flight.W / np.sqrt(flight.noise.wider * q[:, None])
        r_min = recent_scale(white, flight.is_known, model.rate_hz)
    states = build_states(model, flight.noise)
    noise = build_noise(model, flight.noise, flight.c)
    run: BankRun = run_bank(flight.y, flight.F, flight.is_known, bank, states, noise, r_min, q)
    return run


def recent_scale(g: Floats, ok: np.ndarray, rate_hz: float) -> Floats:
    """Variance of a flight's residual over the last _VARIANCE_WINDOW_S, over that of the noise, (n,):

        max over the spans of the mean of |sum of g over the span|^2 / (3 number of ok samples in the span)

    g (n, 3): residual in standard deviations of the noise, 0 where a sample is not ok (n,). The mean is over
    the rows of the window whose span has an ok sample; 0 without such a row.

    Air, gyros or a law that no fitted flight had leave a larger residual, and evidence must then count less
    at once. A fault leaves a larger residual, too; the right hypothesis explains it.
    """
    ratio = np.zeros(len(g))
    for span_s in _SUM_SPANS_S:
        sums, _ = trailing_sums(np.column_stack([g, ok]), span_s * rate_hz)
        n_ok = sums[:, 3]
        squares = (sums[:, :3] ** 2).sum(axis=1) / (3.0 * np.maximum(n_ok, 1.0))
        totals, _ = trailing_sums(np.column_stack([squares, n_ok > 0.0]), _VARIANCE_WINDOW_S * rate_hz)
        ratio = np.maximum(ratio, totals[:, 0] / np.maximum(totals[:, 1], 1.0))
    return ratio


@kernel(allocates=True)
def run_bank(y, F, ok, bank, states, noise, r_min, q):
    """Posterior probabilities (n, H), and the log likelihood of each sample given all before it, but for a
    constant, (n,): log sum_h prior_h exp(ll_h), as in `_correct`; 0 for a sample that is not used.

    ok (n,): whether the sample may be used. bank: HypothesisBank, states: StateModel, noise: ResidualNoise,
    as in `bank`; r_min (n,): lower bound of the scale of the noise; q (n,). After each sample that is used

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
    p = np.maximum(prior * np.exp(ll - top), _MIN_PROBABILITY)
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
