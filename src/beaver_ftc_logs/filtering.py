"""The bank of filters: one causal pass through a flight, with all hypotheses in parallel.

Under hypothesis h, with effectiveness e_h of the groups, the part of the rates unexplained by the past is

    y = c + s (b + sum_g e_hg F_g) + sum_g d_g e_hg F_g + noise,      noise ~ t(0, q r R)

with the intercept b of the model. The trim c (3,), the common gain s and the additional gain d (G,) of each
group belong to the flight: each hypothesis estimates them with a Kalman filter. r is the running scale of the
noise, and q the variance of a sample over that of the noise, larger after quick commands
(`quick_scale`). The common gain multiplies the intercept and all responses, whose sum
vanishes in trimmed flight: it shows in the motion about trim, as the dynamic pressure does, and not in the
trim. One hypothesis changes to another at random times (interacting multiple models [Blom1988]); the new one
inherits trim and gains, plus an offset of the rates if a surface may be stuck. The last hypothesis is that
nothing answers the commands, as on the ground: it estimates no trim and no gain.

The pass is repeated for each delay of the commands that the flight may have; the results are averaged with
the probabilities of the delays.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import HypothesisBank, build_noise, build_states
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import whitened_rates
from beaver_ftc_logs.samples import Samples, first_samples, whiten_samples

_EVIDENCE_MEMORY_S = 600.0
_MIN_PROBABILITY = 1e-15
_SQUARE_CLIP = 3.0
_SUM_SPANS_S, _VARIANCE_WINDOW_S = (0.0, 0.1), 2.0
"""Spans over which a residual is summed, and the window in which its variance is taken."""
_QUICK_SPAN_S = 0.5
"""A response is quick if it differs from its mean over so many seconds."""
_MEAN_SQUARE = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""
_MIN_NOISE_WEIGHT = 1e-3
"""Probability of a noise model below which it is left out."""

BankRun = tuple[Floats, Floats, Floats, Floats]
"""As `run_bank` returns it."""


def bank_posterior(samples: Samples, model: Model, bank: HypothesisBank) -> tuple[Floats, Floats, Floats]:
    """Probability of each hypothesis (n, H), trim and gains (n, 4 + G) and noise scale (n,), by sample.

    All are averages over the command delays of the model's settings and, if the flight is not yet whitened,
    over its noise models. The weights are their probabilities given the last minutes.
    """
    if model.noise_models and not samples.noise_ma_coefficients:
        return _average_noises(samples, model, bank)
    noisy = model.with_noise_of(samples.noise_ma_coefficients)
    delays = model.settings.command_delays_s
    runs = [_run_flight(_with_command_delay(samples, delay_s), noisy, bank) for delay_s in delays]
    return _average_runs(list(_model_weights([run[3] for run in runs], model.rate_hz)), runs)


def _average_noises(samples: Samples, model: Model, bank: HypothesisBank) -> tuple[Floats, Floats, Floats]:
    """The average over the noise models. The bank is run with each up to the last sample at which its weight
    is not negligible: within a second most become far less likely than another, and stay so."""
    pairs = [
        (whiten_samples(samples, noise.ma_coefficients), model.with_single_noise_model(noise))
        for noise in model.noise_models
    ]
    ll = [_noise_likelihood(flight, one, one.noise_models[0]) for flight, one in pairs]
    p = _model_weights(ll, model.rate_hz)
    kept = np.where(np.asarray(p) < _MIN_NOISE_WEIGHT, 0.0, p)
    kept /= kept.sum(axis=0)
    counts = [int(np.flatnonzero(w).max(initial=-1)) + 1 for w in kept]
    runs = [
        _run_flight(first_samples(flight, n), one.with_noise_of(flight.noise_ma_coefficients), bank)
        for (flight, one), n in zip(pairs, counts, strict=True)
        if n
    ]
    return _average_runs([w for w, n in zip(kept, counts, strict=True) if n], runs)


def _average_runs(weights: Sequence[Floats], runs: Sequence[BankRun]) -> tuple[Floats, Floats, Floats]:
    """Weighted average of runs; weights (n,) each. A run may be shorter than n where its weight stays 0."""
    averages: list[Floats] = []
    for i in range(3):
        shape = (len(weights[0]), *runs[0][i].shape[1:])
        mean = np.zeros(shape)
        for w, run in zip(weights, runs, strict=True):
            output = run[i]
            mean[: len(output)] += w[: len(output)].reshape(-1, *[1] * (output.ndim - 1)) * output
        averages.append(mean)
    return averages[0], averages[1], averages[2]


def _noise_likelihood(flight: Samples, model: Model, noise: NoiseModel) -> Floats:
    """Log likelihood (n,) of a noise model for a flight that is whitened by it, with all surfaces healthy; by
    the R of the fit, without its inflation. The filter multiplied the samples by C(1)."""
    ok, y, F = whitened_rates(flight, model)
    e = np.nan_to_num(y - F.sum(axis=1) - model.whitened_intercept(noise.ma_coefficients))
    R = np.array(noise.residual_covariance)
    q = quick_scale(np.nan_to_num(F), model, noise.ma_coefficients)
    d2 = np.einsum("na,ab,nb->n", e, np.linalg.inv(R), e)
    d2 /= q
    nu = model.settings.t_degrees_of_freedom
    log_det = np.linalg.slogdet(R)[1] + 3.0 * np.log(q)
    ll = -0.5 * ((nu + 3.0) * np.log1p(d2 / nu) + log_det) + 3.0 * np.log(sum(noise.ma_coefficients))
    return np.where(ok, model.settings.effective_sample_share * ll, 0.0)


def fault_evidence(p: Floats, bank: HypothesisBank) -> Floats:
    """Return the increase of the log odds of any fault by each sample, beyond that by the prior of a change,
    (n,). Its sum is the logarithm of a likelihood ratio."""
    fault = np.clip(p[:, bank.is_fault_hypothesis].sum(axis=1), _MIN_PROBABILITY, 1.0 - _MIN_PROBABILITY)
    entry = (
        bank.change_probability_per_sample
        * bank.transition_share[bank.is_fault_hypothesis].sum()
        / bank.transition_share.sum()
    )
    prior = np.concatenate(
        [
            [bank.prior_probability[bank.is_fault_hypothesis].sum()],
            (1.0 - bank.change_probability_per_sample) * fault[:-1] + entry,
        ]
    )
    return np.asarray(np.log(fault / (1.0 - fault)) - np.log(prior / (1.0 - prior)))


@kernel
def page_cusum(z, top):
    """Page's sum of z (n,): never below zero, where it starts again, and never above
    top, (n,)."""
    s, S = 0.0, np.zeros(len(z))
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
    a, u = min(abs(delay_s) / samples.dt_s, 1.0), samples.commands
    other = np.vstack([u[:1], u[:-1]] if delay_s > 0 else [u[1:], u[-1:]])
    return replace(samples, commands=(1.0 - a) * u + a * other)


def _model_weights(ll: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each alternative model (D of them) at each sample, (D, n), from its log likelihoods
    (n,), forgotten exponentially within minutes."""
    from scipy.signal import lfilter

    a = np.exp(-1.0 / (_EVIDENCE_MEMORY_S * rate_hz))
    sums = lfilter([1.0], [1.0, -a], np.array(ll), axis=1)
    p = np.exp(sums - sums.max(axis=0))
    return np.asarray(p / p.sum(axis=0))


def _run_flight(samples: Samples, model: Model, bank: HypothesisBank) -> BankRun:
    """The result of `run_bank` for one flight."""
    ok, *rest = whitened_rates(samples, model)
    y, F = (np.ascontiguousarray(np.nan_to_num(v)) for v in rest)
    noise = build_noise(model, samples.noise_ma_coefficients)
    q = quick_scale(F, model, samples.noise_ma_coefficients)
    r_min = np.zeros(len(ok))
    if model.vehicle.other_laws:
        e = np.where(ok[:, None], y - noise.intercept_rad_s - F.sum(axis=1), 0.0) / np.sqrt(q[:, None])
        r_min = recent_scale(e, ok, noise.covariance, model.rate_hz)
    run: BankRun = run_bank(
        y, F, ok, bank, build_states(model, samples.noise_ma_coefficients), noise, r_min, q
    )
    return run


def quick_scale(F: Floats, model: Model, ma: Sequence[float]) -> Floats:
    """Return the variance of the residual over that of the noise, (n,): above 1 where responses (n, G, 3) are
    quicker than usual in the fit, since a share of the quick part may be missing, or be too much.

    Slow commands of healthy flight hardly show how a surface responds to a step. The error after a step is no
    noise: it has the same sign in many samples.
    """
    power = quick_power(F, model.covariance_of_noise_model(ma), model.rate_hz)
    excess = np.maximum(power - model.usual_quick_power(ma), 0.0)
    return np.asarray(1.0 + model.settings.quick_error_share**2 * excess)


def quick_power(F: Floats, R: Floats, rate_hz: float) -> Floats:
    """Return the power of the quick part of the responses (n, G, 3) an axis, in variances of the noise, (n,).

    The quick part is the difference from the mean over the last half second.
    """
    end = np.arange(1, len(F) + 1)
    begin = np.maximum(end - max(round(_QUICK_SPAN_S * rate_hz), 1), 0)
    sums = np.concatenate([np.zeros((1, *F.shape[1:])), np.cumsum(F, axis=0)])
    slow = (sums[end] - sums[begin]) / (end - begin)[:, None, None]
    W = np.linalg.inv(np.linalg.cholesky(R)).T
    return np.asarray((((F - slow) @ W) ** 2).sum(axis=(1, 2)) / 3.0)


def recent_scale(e: Floats, ok: np.ndarray, R: Floats, rate_hz: float) -> Floats:
    """Return the ratio of the variance of a flight's residual (n, 3) in the last seconds to that of the
    fitted noise, (n,): of single samples, or of sums of several if that is larger.

    Air, gyros or a law that no fitted flight had leave a larger residual, and evidence must then count less
    at once. A fault leaves a larger residual, too; the right hypothesis explains it.
    """
    g = e @ np.linalg.inv(np.linalg.cholesky(R)).T
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), g]), axis=0)
    counts = np.concatenate([[0], np.cumsum(ok)])
    end = np.arange(1, len(g) + 1)
    ratio = np.zeros(len(g))
    for span_s in _SUM_SPANS_S:
        begin = np.maximum(end - max(round(span_s * rate_hz), 1), 0)
        squares = ((sums[end] - sums[begin]) ** 2).sum(axis=1) / (
            3.0 * np.maximum(counts[end] - counts[begin], 1)
        )
        total = np.concatenate([[0.0], np.cumsum(squares)])
        start = np.maximum(end - max(round(_VARIANCE_WINDOW_S * rate_hz), 1), 0)
        ratio = np.maximum(ratio, (total[end] - total[start]) / (end - start))
    return ratio


@kernel
def run_bank(y, F, ok, bank, states, noise, r_min, q):
    """Posterior probabilities (n, H), mean trim and gains (n, N), noise scale (n,) and ll
    (n,): the log likelihood of a sample given all before it, times effective_sample_share.

    Shapes: y (n, 3); F (n, G, 3) while healthy; ok (n,) the
    sample may be used. bank: HypothesisBank, states: StateModel, noise:
    ResidualNoise (bank.py); r_min (n,): lower bound of the scale of the noise;
    q (n,): by `quick_scale`.
    """
    n = len(y)
    H = len(bank.transition_share)
    N = len(states.initial_mean)
    last = H - 1
    p = bank.prior_probability.copy()
    x = np.zeros((H, N))
    P = np.zeros((H, N, N))
    x[:] = states.initial_mean
    P[:] = states.initial_covariance
    post = np.zeros((n, H))
    means = np.zeros((n, N))
    scales = np.zeros(n)
    ll = np.zeros(n)
    r = 1.0
    for k in range(n):
        prior = _mix(p, x, P, bank, states.random_walk_variance)
        _relax(x, P, states)
        x[last], P[last] = (
            states.initial_mean,
            states.initial_covariance,
        )  # while nothing answers, nothing is learnt
        if ok[k]:
            p, d2, ll[k] = _correct(prior, x, P, y[k], F[k], bank, noise, q[k] * max(r, r_min[k]))
            _limit_states(
                x, states.initial_mean - states.max_deviation, states.initial_mean + states.max_deviation
            )
            r *= np.exp((1.0 - p[last]) * (d2 / 3.0 - _MEAN_SQUARE) / noise.scale_memory_samples)
            r = min(max(r, noise.min_variance_scale), noise.max_variance_scale)
        else:
            p = prior
        post[k] = p
        scales[k] = r
        for h in range(H):
            means[k] += p[h] * x[h]
    return post, means, scales, ll


@kernel
def _mix(p, x, P, bank, walk):
    """Interaction of the hypotheses: each may change to any other. x (H, N) and P
    (H, N, N) are replaced. Returns the prior probabilities (H,)."""
    H, N = x.shape
    stay = 1.0 - bank.change_probability_per_sample
    m = np.zeros(N)
    M = np.zeros((N, N))
    for h in range(H):
        m += p[h] * x[h]
    for h in range(H):
        for i in range(N):
            for j in range(N):
                M[i, j] += p[h] * (P[h, i, j] + (x[h, i] - m[i]) * (x[h, j] - m[j]))
    prior = np.empty(H)
    total = 0.0
    for h in range(H):
        prior[h] = stay * p[h] + bank.change_probability_per_sample * bank.transition_share[h]
        total += prior[h]
        _merge(stay * p[h] / prior[h], x[h], P[h], m, M, bank.rate_offset_variance[h], walk)
    return prior / total


@kernel
def _merge(w, x, P, m, M, offset, walk):
    """Replace two Gaussians by one with the same moments: that of the hypothesis, with weight `w`,
    and the mixture of all hypotheses, with the rest of the weight.

    x (N,) and P (N, N) are replaced. The mixture gets the variance of the offset of
    the rates, offset (3,), that comes with a change to this hypothesis.
    """
    v, N = 1.0 - w, len(x)
    for i in range(N):
        for j in range(N):
            d = (x[i] - m[i]) * (x[j] - m[j])
            P[i, j] = w * P[i, j] + v * M[i, j] + w * v * d
        P[i, i] += walk[i]
    for i in range(N):
        x[i] = w * x[i] + v * m[i]
    for i in range(len(offset)):
        P[i, i] += v * offset[i]


@kernel
def _relax(x, P, states):
    """Move all trims and gains towards those of the model, by one sample. x (H, N) and
    P (H, N, N) are replaced."""
    for h in range(len(x)):
        for i in range(len(states.deviation_retention)):
            x[h, i] = states.initial_mean[i] + states.deviation_retention[i] * (
                x[h, i] - states.initial_mean[i]
            )
            for j in range(len(states.deviation_retention)):
                P[h, i, j] *= states.deviation_retention[i] * states.deviation_retention[j]


@kernel
def _correct(prior, x, P, y, F, bank, noise, r):
    """Kalman correction of every hypothesis by one sample; x and P are replaced.

    Returns the posterior probabilities (H,), the clipped squared residual averaged over them (in the
    covariance without its inflation), and the log likelihood of the sample.
    """
    H, N = x.shape
    ll = np.empty(H)
    d2 = np.empty(H)
    x0, P0 = np.zeros(N), np.zeros((N, N))
    R = noise.covariance * r
    nu = noise.t_degrees_of_freedom
    for h in range(H):
        C = _sensitivities(bank.effectiveness[h], bank.own_gain_share[h], F, noise.intercept_rad_s, N)
        if h == H - 1:
            d2[h], log_det = _update(x0, P0, y, C, R, noise)
        else:
            d2[h], log_det = _update(x[h], P[h], y, C, R, noise)
        clipped = min(d2[h], noise.max_squared_residual)
        ll[h] = noise.effective_sample_share * (
            -0.5 * (nu + 3.0) * np.log(1.0 + clipped / nu) - 0.5 * log_det
        )
    top = ll.max()
    p = np.maximum(prior * np.exp(ll - top), _MIN_PROBABILITY)
    total = p.sum()
    p /= total
    mean = 0.0
    for h in range(H):
        mean += p[h] * min(noise.covariance_inflation * d2[h], 3.0 * _SQUARE_CLIP)
    return (p, mean, top + np.log(total))


@kernel
def _sensitivities(a, k, F, b, N):
    """Sensitivity of the unexplained rates to the states, (N, 3): to the trim; to the common gain, which
    multiplies the intercept and all F (G, 3) times a (G,); and to each group's own
    gain, which multiplies the share k (G,) of its response."""
    C = np.zeros((N, 3))
    C[:3] = np.eye(3)
    C[3] = b
    for g in range(len(a)):
        C[4 + g] = k[g] * F[g]
        C[3] += a[g] * F[g]
    return C


@kernel
def _limit_states(x, lo, hi):
    """Limit trim and gains of every hypothesis, so that they do not adapt to a fault."""
    for h in range(len(x)):
        x[h] = np.minimum(np.maximum(x[h], lo), hi)


@kernel
def _update(x, P, y, C, R, noise):
    """Correct one Gaussian (x (N,), P (N, N), replaced) by
    y (3,) = C' x + noise, with
    C (N, 3).

    Returns the squared residual, normalised by its covariance, and the log det of that covariance.
    The gain is reduced for a residual in the tail of the t distribution, and 0 above max_squared_residual.
    """
    N, nu = len(x), noise.t_degrees_of_freedom
    D = np.zeros((N, 3))
    S = R.copy()
    e = y.copy()
    for i in range(N):
        for j in range(3):
            e[j] -= x[i] * C[i, j]
            for k in range(N):
                D[i, j] += P[i, k] * C[k, j]
    for i in range(N):
        for j in range(3):
            for k in range(3):
                S[j, k] += C[i, j] * D[i, k]
    S_inv, det = _invert(S)
    K = np.zeros((N, 3))
    d2 = 0.0
    for j in range(3):
        for k in range(3):
            d2 += e[j] * S_inv[j, k] * e[k]
            for i in range(N):
                K[i, j] += D[i, k] * S_inv[k, j]
    K *= min(1.0, (nu + 3.0) / (nu + d2)) if d2 < noise.max_squared_residual else 0.0
    for j in range(3):
        for i in range(N):
            x[i] += K[i, j] * e[j]
            # symmetric by construction: an asymmetry from rounding would grow without bound
            for k in range(i + 1):
                P[i, k] -= K[i, j] * D[k, j]
                P[k, i] = P[i, k]
    return d2, np.log(det)


@kernel
def _invert(S):
    """Inverse and det of a symmetric (3, 3) matrix, by its cofactors."""
    A = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            i1, i2 = (i + 1) % 3, (i + 2) % 3
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            A[j, i] = S[i1, j1] * S[i2, j2] - S[i1, j2] * S[i2, j1]
    det = S[0, 0] * A[0, 0] + S[0, 1] * A[1, 0] + S[0, 2] * A[2, 0]
    return A / det, det
