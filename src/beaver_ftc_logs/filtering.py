"""The bank of filters: one causal pass through a flight, with all hypotheses in parallel.

Under hypothesis h, with effectiveness a_h of the groups, the part of the rates unexplained by the past is

    y = b + s (c + sum_g a_hg F_g) + sum_g d_g k_hg F_g + noise = C_h' x + noise,      noise ~ t(0, q r R)

    n, H, G         samples, hypotheses, groups; N = 4 + G states
    y, F, c         unexplained rates (n, 3), healthy responses (n, G, 3), intercept (3,), rad/s, as in
                    `regression`
    a, k            effectiveness (H, G), and share of a response that the group's own gain multiplies (H, G)
    x, P            state: trim b (3,) rad/s, common gain s, gain d (G,) of each group; its covariance
    C               what the states do to y, (N, 3)
    p               probability of each hypothesis (H,)
    R               covariance of the noise (3, 3), (rad/s)2; W whitens it
    nu              degrees of freedom of the t distribution of the noise
    r               running scale of the variance of the noise
    q               variance of a sample over that of the noise, larger after quick commands (`quick_scale`)
    e, S, K         residual y - C' x (3,), its covariance (3, 3), gain (N, 3)
    d2              e' S^-1 e
    ll              log likelihood of a sample

The states belong to the flight: each hypothesis estimates them with a Kalman filter. The common gain
multiplies the intercept and all responses, whose sum vanishes in trimmed flight: it shows in the motion about
trim, as the dynamic pressure does, and not in the trim. One hypothesis changes to another at random times
(interacting multiple models [Blom1988]); the new one inherits trim and gains, plus an offset of the rates if
a surface may be stuck. The last hypothesis is that nothing answers the commands, as on the ground: it
estimates no trim and no gain.

The pass is repeated for each delay of the commands that the flight may have; the results are averaged with
the probabilities of the delays.
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

_EVIDENCE_MEMORY_S = 600.0  # in which delays and noise models are compared
_MIN_PROBABILITY = 1e-15  # the least of a hypothesis, and the rounding of a sum
_MIN_NOISE_SCALE = 0.3
_MAX_NOISE_SCALE = 6.0
_SQUARE_CLIP = 3.0  # of d2 per axis, for the running scale
_SUM_SPANS_S = (0.0, 0.1)  # over which a residual is summed
_VARIANCE_WINDOW_S = 2.0  # in which the variance of the sums is taken
# Mean of the clipped square of a residual per axis when the scale is right.
_MEAN_SQUARE = 0.93
# Probability of a noise model below which it is left out.
_MIN_NOISE_WEIGHT = 1e-3

# As `run_bank` returns it.
BankRun = tuple[Floats, Floats]


def bank_posterior(samples: Samples, model: Model, bank: HypothesisBank) -> Floats:
    """Probability of each hypothesis by sample, (n, H).

    It is the average over the command delays of the model's settings or, if the flight is not yet whitened,
    over its noise models. The weights are their probabilities given the last minutes. A noise model is run up
    to the last sample at which its weight is not negligible: within a second most become far less likely than
    another, and stay so.
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
    for w, (flight, one) in zip(kept, pairs, strict=True):
        if n := int(np.flatnonzero(w).max(initial=-1)) + 1:
            p, _ = run_flight(flight.at(slice(n)), one, bank)
            mean[:n] += w[:n, None] * p
    return mean


def _noise_likelihood(flight: Innovations, model: Model) -> Floats:
    """Log likelihood (n,) of the model's noise for a flight that is whitened by it, with all surfaces
    healthy; by the covariance of the fit, without its inflation."""
    q = flight.quick_scale(model)
    d2 = ((flight.e @ flight.W) ** 2).sum(axis=1) / q
    nu = model.settings.tail
    ll = -0.5 * ((nu + 3.0) * np.log1p(d2 / nu) + 3.0 * np.log(q)) - flight.log_size
    return np.where(flight.is_known, model.settings.power * ll, 0.0)


def fault_evidence(p: Floats, bank: HypothesisBank) -> Floats:
    """Return the increase of the log odds of any fault by each sample, beyond that by the prior of a change,
    (n,), from the probabilities p (n, H). Its sum is the logarithm of a likelihood ratio."""
    is_fault = bank.is_fault_hypothesis
    share = bank.transition_share
    change = bank.change_probability_per_sample
    fault = np.clip(p[:, is_fault].sum(axis=1), _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY)
    entry = change * share[is_fault].sum() / share.sum()
    prior = np.append(bank.prior_probability[is_fault].sum(), (1.0 - change) * fault[:-1] + entry)
    return np.log(fault / (1.0 - fault)) - np.log(prior / (1.0 - prior))


@kernel
def page_cusum(z, top):
    """Page's sum of the evidence z (n,), never below zero, where it starts again, and never above top:

    S[k] = min(max(S[k-1] + z[k], 0), top)
    """
    s = 0.0
    S = np.zeros(len(z))
    for k in range(len(z)):
        s = min(max(s + z[k], 0.0), top)
        S[k] = s
    return S


def _with_command_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act delay_s later than in the model; at most a sample, may be negative.

    The model uses commands from one sample before the rates, so a negative delay needs no later command than
    that of the same sample.
    """
    if delay_s == 0.0:
        return samples
    a = min(abs(delay_s) / samples.dt_s, 1.0)
    u = samples.commands
    other = np.vstack([u[:1], u[:-1]] if delay_s > 0 else [u[1:], u[-1:]])
    return replace(samples, commands=(1.0 - a) * u + a * other)


def model_weights(ll: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each alternative model (D of them) at each sample, (D, n), from its log likelihoods ll
    (n,), forgotten exponentially within minutes."""
    from scipy.signal import lfilter

    a = np.exp(-1.0 / (_EVIDENCE_MEMORY_S * rate_hz))
    sums = lfilter([1.0], [1.0, -a], np.array(ll), axis=1)
    p = np.exp(sums - sums.max(axis=0))
    return p / p.sum(axis=0)


def run_flight(flight: Innovations, model: Model, bank: HypothesisBank) -> BankRun:
    """The result of `run_bank` for one flight."""
    q = flight.quick_scale(model)
    r_min = np.zeros(len(q))
    if model.vehicle.other_laws:
        white = flight.e @ flight.W / np.sqrt(flight.noise.wider * q[:, None])
        r_min = recent_scale(white, flight.is_known, model.rate_hz)
    y, F = (np.ascontiguousarray(values) for values in (flight.y, flight.F))
    states = build_states(model, flight.noise)
    noise = build_noise(model, flight.noise, flight.c)
    run: BankRun = run_bank(y, F, flight.is_known, bank, states, noise, r_min, q)
    return run


def recent_scale(g: Floats, ok: np.ndarray, rate_hz: float) -> Floats:
    """Return the ratio of the variance of a flight's residual g (n, 3), in standard deviations of the fitted
    noise, in the last seconds to that of this noise, (n,): of single samples, or of sums of several if that
    is larger. ok (n,): which samples count.

    Air, gyros or a law that no fitted flight had leave a larger residual, and evidence must then count less
    at once. A fault leaves a larger residual, too; the right hypothesis explains it.
    """
    ratio = np.zeros(len(g))
    for span_s in _SUM_SPANS_S:
        sums, _ = trailing_sums(np.column_stack([g, ok]), span_s * rate_hz)
        squares = (sums[:, :3] ** 2).sum(axis=1) / (3.0 * np.maximum(sums[:, 3], 1.0))
        total, n = trailing_sums(squares, _VARIANCE_WINDOW_S * rate_hz)
        ratio = np.maximum(ratio, total / n)
    return ratio


@kernel
def run_bank(y, F, ok, bank, states, noise, r_min, q):
    """Posterior probabilities (n, H) and ll (n,): the log likelihood of a sample given all before it, times
    effective_sample_share.

    ok (n,): the sample may be used. bank: HypothesisBank, states: StateModel, noise: ResidualNoise, as in
    `bank`; r_min (n,): lower bound of the scale of the noise; q (n,).
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
        x[last] = states.initial_mean  # while nothing answers, nothing is learnt
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


@kernel
def _mix(p, x, P, bank, walk):
    """Interaction of the hypotheses: each may change to any other. x (H, N) and P (H, N, N) are replaced.
    Returns the prior probabilities (H,):

        prior_h = (1 - change) p_h + change share_h,    m, M: mean and covariance of the mixture of all
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


@kernel
def _merge(w, x, P, m, M, offset, walk):
    """Replace two Gaussians by one with the same moments: (x, P) of the hypothesis, with weight w, and (m, M)
    of the mixture of all hypotheses, with weight v = 1 - w:

        x <- w x + v m,    P <- w P + v (M + offset) + w v (x - m)(x - m)' + walk

    x (N,) and P (N, N) are replaced. offset (3,): variance of the offset of the rates that comes with a
    change to this hypothesis; walk (N,): variance added a sample.
    """
    v = 1.0 - w
    d = x - m
    P[:] = w * P + v * M + (w * v) * np.outer(d, d)
    x[:] = w * x + v * m
    for i in range(len(walk)):
        P[i, i] += walk[i]
    for i in range(len(offset)):
        P[i, i] += v * offset[i]


@kernel
def _relax(x, P, states):
    """Move all trims and gains towards those m of the model, by one sample, with the retention a (N,):

    x <- m + a (x - m),    P_ij <- a_i a_j P_ij,    x (H, N) and P (H, N, N) are replaced
    """
    m = states.initial_mean
    a = states.deviation_retention
    x[:] = m + a * (x - m)
    P *= np.outer(a, a)


@kernel
def _correct(prior, x, P, y, F, bank, noise, r):
    """Kalman correction of every hypothesis by one sample y (3,), F (G, 3); x and P are replaced. The last
    hypothesis has no states: nothing answers.

        ll_h = -((nu + 3) / 2) log(1 + d2_h / nu) - log(det S_h) / 2,      p_h ~ prior_h exp(ll_h)

    r: scale of the noise. Returns the posterior probabilities (H,), the clipped d2 averaged over them (in the
    covariance without its inflation), and the log likelihood of the sample.
    """
    H, N = x.shape
    ll = np.empty(H)
    d2 = np.empty(H)
    none = np.zeros((N, 3))
    R = noise.covariance * r
    nu = noise.t_degrees_of_freedom
    for h in range(H):
        C = _sensitivities(bank.effectiveness[h], bank.own_gain_share[h], F, noise.intercept_rad_s, N)
        d2[h], log_det = _update(x[h], P[h], y, none if h == H - 1 else C, R, noise)
        log_t = -0.5 * (nu + 3.0) * np.log(1.0 + min(d2[h], noise.max_squared_residual) / nu)
        ll[h] = noise.effective_sample_share * (log_t - 0.5 * log_det)
    top = ll.max()
    p = np.maximum(prior * np.exp(ll - top), _MIN_PROBABILITY)
    total = p.sum()
    p /= total
    mean = p @ np.minimum(noise.covariance_inflation * d2, 3.0 * _SQUARE_CLIP)
    return p, mean, top + np.log(total)


@kernel
def _sensitivities(a, k, F, c, N):
    """What the states do to the unexplained rates, C (N, 3): the trim; the common gain, which multiplies
    c + sum_g a_g F_g; each group's own gain, which multiplies k_g F_g. a, k (G,); F (G, 3); c (3,)."""
    C = np.zeros((N, 3))
    C[:3] = np.eye(3)
    C[3] = c
    for g in range(len(a)):
        C[4 + g] = k[g] * F[g]
        C[3] += a[g] * F[g]
    return C


@kernel
def _update(x, P, y, C, R, noise):
    """Correct one Gaussian, x (N,) and P (N, N), by y (3,) = C' x + noise of covariance R; both are replaced:

        e = y - C' x,   D = P C,   S = R + C' D,   K = D S^-1,   x <- x + K e,   P <- P - K D'

    Returns d2 and log(det S). K is reduced for a residual in the tail of the t distribution, and 0 above
    max_squared_residual.
    """
    nu = noise.t_degrees_of_freedom
    D = P @ C
    e = y - x @ C
    S_inv, det = _invert(R + C.T @ D)
    d2 = e @ S_inv @ e
    K = D @ S_inv
    K *= min(1.0, (nu + 3.0) / (nu + d2)) if d2 < noise.max_squared_residual else 0.0
    x += K @ e
    P -= K @ D.T
    P[:] = 0.5 * (P + P.T)  # an asymmetry from rounding would grow without bound
    return d2, np.log(det)


@kernel
def _invert(S):
    """Inverse and determinant of a symmetric matrix S (3, 3), by its cofactors A."""
    A = np.empty((3, 3))
    for i in range(3):
        a = S[i - 2]  # the next rows, cyclically
        b = S[i - 1]
        for j in range(3):
            A[i, j] = a[j - 2] * b[j - 1] - a[j - 1] * b[j - 2]
    det = S[0] @ A[0]
    return A / det, det
