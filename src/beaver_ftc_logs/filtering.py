"""A flight through the bank of filters: causal, one pass, all hypotheses at once.

Under hypothesis h with effectiveness e_h of the groups, what the past does not explain of the rates is

    y = c + s (b + sum_g e_hg F_g) + sum_g d_g e_hg F_g + noise,      noise ~ t(0, r R)

with the model's constant b, and of the flight its own trim c (3,), gain s, and what each group has more of it
than the others, d (G,): each hypothesis estimates them by a Kalman filter. r is the running scale of the
noise. The gain acts on what a trimmed flight balances: it shows by the motion alone, as dynamic pressure
does, and not in the trim. A hypothesis passes to another at random
times (interacting multiple models [Blom1988]): the one that takes over inherits trim and gain, plus an offset
where a surface may be stuck. The last hypothesis says that nothing answers the commands, as on the ground: it
learns no trim and no gain.

This is done once for each delay the flight may have; the likelier delay counts more.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import Bank, adaptation_of, noise_of
from beaver_ftc_logs.model import Colour, Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import in_white
from beaver_ftc_logs.samples import Samples, first, whitened

_DELAY_MEMORY_S = 600.0
_FLOOR = 1e-15
_CLIP = 3.0
_SPANS_S, _LATELY_S = (0.0, 0.1), 2.0
"""Spans over which a residual is summed, and the seconds in which its size is taken."""
_EXPECTED = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""
_LEAST_WEIGHT = 1e-3
"""Probability of a colour of the noise below which it is left out."""

Run = tuple[Floats, Floats, Floats, Floats]
"""As `run_bank` returns it."""


def posterior_of(samples: Samples, model: Model, bank: Bank) -> tuple[Floats, Floats, Floats]:
    """Probability of each hypothesis (n, H), trim and gains (n, 4 + G) and noise scale (n,), by sample.

    The mean over the delays of the model's settings, and the colours of its noise where the flight is not yet
    whitened, each weighted by how well it explains the last minutes.
    """
    if model.colours and not samples.colour:
        return _by_colours(samples, model, bank)
    own, delays_s = model.with_noise_model(samples.colour), model.settings.delays_s
    runs = [_filtered(_with_delay(samples, delay_s), own, bank) for delay_s in delays_s]
    return _mean(list(_weights([run[3] for run in runs], model.rate_hz)), runs)


def _by_colours(samples: Samples, model: Model, bank: Bank) -> tuple[Floats, Floats, Floats]:
    """The mean over the colours of the noise. A colour is filtered up to the last sample at which its weight
    counts: within a second most are far less likely than another, and stay so."""
    flights = [(whitened(samples, one.average), model.alone_with(one)) for one in model.colours]
    likely = [_likelihood(flight, of, of.colours[0]) for flight, of in flights]
    weights = _weights(likely, model.rate_hz)
    kept = np.where(np.asarray(weights) < _LEAST_WEIGHT, 0.0, weights)
    kept /= kept.sum(axis=0)
    last = [int(np.flatnonzero(weight).max(initial=-1)) + 1 for weight in kept]
    runs = [
        _filtered(first(flight, count), of.with_noise_model(flight.colour), bank)
        for (flight, of), count in zip(flights, last, strict=True) if count
    ]  # fmt: skip
    return _mean([weight for weight, count in zip(kept, last, strict=True) if count], runs)


def _mean(weights: Sequence[Floats], runs: Sequence[Run]) -> tuple[Floats, Floats, Floats]:
    """Runs with weights (n,) each; a run ends where its weight stays 0."""
    found: list[Floats] = []
    for part in range(3):
        shape = (len(weights[0]), *runs[0][part].shape[1:])
        total = np.zeros(shape)
        for weight, run in zip(weights, runs, strict=True):
            values = run[part]
            total[: len(values)] += weight[: len(values)].reshape(-1, *[1] * (values.ndim - 1)) * values
        found.append(total)
    return found[0], found[1], found[2]


def _likelihood(flight: Samples, model: Model, of: Colour) -> Floats:
    """Log likelihood of a colour at each sample of a flight that is whitened by it, all in health, (n,): by
    its noise as it was, not as much wider as gains differ. Filtering made a sample C(1) times as large."""
    ok, unexplained, answers = in_white(flight, model)
    e = np.nan_to_num(unexplained - answers.sum(axis=1) - model.constant(of.average))
    square = np.einsum("na,ab,nb->n", e, np.linalg.inv(of.noise), e)
    dof, size = model.settings.tail, np.linalg.slogdet(of.noise)[1]
    found = -0.5 * ((dof + 3.0) * np.log1p(square / dof) + size) + 3.0 * np.log(sum(of.average))
    return np.where(ok, model.settings.power * found, 0.0)


def evidence(posterior: Floats, bank: Bank) -> Floats:
    """What each sample adds to the log odds of a fault, beyond what a change at random does, (n,): the sum of
    it is the log of a likelihood ratio, in which one who believes in no fault gains nothing on the mean."""
    fault = np.clip(posterior[:, bank.faults].sum(axis=1), _FLOOR, 1.0 - _FLOOR)
    changes = bank.change * bank.weight[bank.faults].sum() / bank.weight.sum()
    before = np.concatenate([[bank.start[bank.faults].sum()], (1.0 - bank.change) * fault[:-1] + changes])
    return np.asarray(np.log(fault / (1.0 - fault)) - np.log(before / (1.0 - before)))


@kernel
def accumulated(gained, most):
    """Page's sum of gained (n,): never below zero, where it starts again, and never above most, (n,)."""
    total, found = 0.0, np.zeros(len(gained))
    for k in range(len(gained)):
        total = min(max(total + gained[k], 0.0), most)
        found[k] = total
    return found


def _with_delay(samples: Samples, delay_s: float) -> Samples:
    """The flight with commands that act by so much later, less than a sample, than the model says.

    Sooner takes from the command of the same sample, which is known; never from a later one: a command enters
    from one sample back.
    """
    if delay_s == 0.0:
        return samples
    share, commands = min(abs(delay_s) / samples.dt_s, 1.0), samples.commands
    other = np.vstack([commands[:1], commands[:-1]] if delay_s > 0 else [commands[1:], commands[-1:]])
    return replace(samples, commands=(1.0 - share) * commands + share * other)


def _weights(evidence: Sequence[Floats], rate_hz: float) -> Floats:
    """Probability of each delay at each sample, (D, n), by the evidence of some minutes."""
    from scipy.signal import lfilter

    fade = np.exp(-1.0 / (_DELAY_MEMORY_S * rate_hz))
    total = lfilter([1.0], [1.0, -fade], np.array(evidence), axis=1)
    weights = np.exp(total - total.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


def _filtered(samples: Samples, model: Model, bank: Bank) -> Run:
    """As the kernel gives it."""
    ok, *parts = in_white(samples, model)
    unexplained, answers = (np.ascontiguousarray(np.nan_to_num(part)) for part in parts)
    noise = noise_of(model, samples.colour)
    least = np.zeros(len(ok))
    if model.vehicle.other_laws:
        residual = np.where(ok[:, None], unexplained - noise.constant - answers.sum(axis=1), 0.0)
        least = least_scale(residual, ok, noise.covariance, model.rate_hz)
    found: Run = run_bank(unexplained, answers, ok, bank, adaptation_of(model), noise, least)
    return found


def least_scale(residual: Floats, ok: np.ndarray, covariance: Floats, rate_hz: float) -> Floats:
    """How many times the covariance of the fitted noise that of a flight's residual (n, 3) was in the last
    seconds, (n,), at each sample: of a sample, or of the sum of some per sample where these are alike.

    Air, gyros or a law that the fit has not seen leave more unexplained, and evidence is to weigh less at
    once. A fault leaves more, too; the hypothesis that is right explains it, and gains as much a sample.
    """
    white = residual @ np.linalg.inv(np.linalg.cholesky(covariance)).T
    total = np.cumsum(np.vstack([np.zeros((1, 3)), white]), axis=0)
    known = np.concatenate([[0], np.cumsum(ok)])
    end = np.arange(1, len(white) + 1)
    found = np.zeros(len(white))
    for span_s in _SPANS_S:
        begin = np.maximum(end - max(round(span_s * rate_hz), 1), 0)
        square = ((total[end] - total[begin]) ** 2).sum(axis=1) / (
            3.0 * np.maximum(known[end] - known[begin], 1)
        )
        sums = np.concatenate([[0.0], np.cumsum(square)])
        begin = np.maximum(end - max(round(_LATELY_S * rate_hz), 1), 0)
        found = np.maximum(found, (sums[end] - sums[begin]) / (end - begin))
    return found


@kernel
def run_bank(y, f, ok, bank, own, noise, least):
    """Posterior probability of each hypothesis, mean trim and gain, noise scale, and evidence, by sample.

    Evidence is the log likelihood of the sample given all before it, raised to the power.

    Shapes: y (n, 3); f (n, G, 3) responses; ok (n,) the sample may be used. bank: Bank, own: Adaptation,
    noise: Noise (bank.py); least (n,): scale of the noise at least.
    """
    n, hypotheses, states = len(y), len(bank.weight), len(own.mean)
    idle = hypotheses - 1
    mu = bank.start.copy()
    m = np.zeros((hypotheses, states))
    p = np.zeros((hypotheses, states, states))
    m[:] = own.mean
    p[:] = own.covariance
    posterior = np.zeros((n, hypotheses))
    trim = np.zeros((n, states))
    scales = np.zeros(n)
    evidence = np.zeros(n)
    scale = 1.0
    for k in range(n):
        prior = _mix(mu, m, p, bank, own.walk)
        _relax(m, p, own)
        m[idle], p[idle] = own.mean, own.covariance  # while nothing answers, nothing is learnt
        if ok[k]:
            mu, square, evidence[k] = _correct(prior, m, p, y[k], f[k], bank, noise, max(scale, least[k]))
            _bound(m, own.mean - own.bound, own.mean + own.bound)
            scale *= np.exp((1.0 - mu[idle]) * (square / 3.0 - _EXPECTED) / noise.memory)
            scale = min(max(scale, noise.least), noise.largest)
        else:
            mu = prior
        posterior[k] = mu
        scales[k] = scale
        for h in range(hypotheses):
            trim[k] += mu[h] * m[h]
    return posterior, trim, scales, evidence


@kernel
def _mix(mu, m, p, bank, walk):
    """Let each hypothesis pass to any other; m and p are replaced, the prior probabilities returned."""
    hypotheses, states = m.shape
    stay = 1.0 - bank.change
    mean = np.zeros(states)
    spread = np.zeros((states, states))
    for h in range(hypotheses):
        mean += mu[h] * m[h]
    for h in range(hypotheses):
        for i in range(states):
            for j in range(states):
                spread[i, j] += mu[h] * (p[h, i, j] + (m[h, i] - mean[i]) * (m[h, j] - mean[j]))
    prior = np.empty(hypotheses)
    total = 0.0
    for h in range(hypotheses):
        prior[h] = stay * mu[h] + bank.change * bank.weight[h]
        total += prior[h]
        _merge(stay * mu[h] / prior[h], m[h], p[h], mean, spread, bank.offset[h], walk)
    return prior / total


@kernel
def _merge(own, m, p, mean, spread, offset, walk):
    """One Gaussian for two: the hypothesis' own (m, p) with weight `own`, everyone's with the rest.

    m (N,) and p (N, N) are replaced; who comes from elsewhere brings the offset (3,) along.
    """
    rest, states = 1.0 - own, len(m)
    for i in range(states):
        for j in range(states):
            away = (m[i] - mean[i]) * (m[j] - mean[j])
            p[i, j] = own * p[i, j] + rest * spread[i, j] + own * rest * away
        p[i, i] += walk[i]
    for i in range(states):
        m[i] = own * m[i] + rest * mean[i]
    for i in range(len(offset)):
        p[i, i] += rest * offset[i]


@kernel
def _relax(m, p, own):
    """Let all trims and gains return towards the model's; m (H, N) and p (H, N, N) are replaced."""
    for h in range(len(m)):
        for i in range(len(own.keep)):
            m[h, i] = own.mean[i] + own.keep[i] * (m[h, i] - own.mean[i])
            for j in range(len(own.keep)):
                p[h, i, j] *= own.keep[i] * own.keep[j]


@kernel
def _correct(prior, m, p, y, f, bank, noise, scale):
    """Kalman correction of every hypothesis by one sample; m and p are replaced.

    Returns the posterior probabilities, the clipped square of the residual under them, as if the noise were
    no wider than residuals are, and the evidence.
    """
    hypotheses, states = m.shape
    log = np.empty(hypotheses)
    squares = np.empty(hypotheses)
    nothing, certain = np.zeros(states), np.zeros((states, states))
    covariance, dof = noise.covariance * scale, noise.tail
    for h in range(hypotheses):
        seen = _seen(bank.effectiveness[h], bank.own[h], f, noise.constant, states)
        if h == hypotheses - 1:
            squares[h], log_det = _update(nothing, certain, y, seen, covariance, noise)
        else:
            squares[h], log_det = _update(m[h], p[h], y, seen, covariance, noise)
        square = min(squares[h], noise.farthest)
        log[h] = noise.power * (-0.5 * (dof + 3.0) * np.log(1.0 + square / dof) - 0.5 * log_det)
    most = log.max()
    mu = np.maximum(prior * np.exp(log - most), _FLOOR)
    total = mu.sum()
    mu /= total
    clipped = 0.0
    for h in range(hypotheses):
        clipped += mu[h] * min(noise.wider * squares[h], 3.0 * _CLIP)
    return mu, clipped, most + np.log(total)


@kernel
def _seen(e, own, f, base, states):
    """How the rates show the states, (N, 3): trim, the gain of the constant and of all groups' answers f
    (G, 3), each as effective as e (G,) says, and each group's own gain of a share (G,) of its answer."""
    seen = np.zeros((states, 3))
    seen[:3] = np.eye(3)
    seen[3] = base
    for g in range(len(e)):
        seen[4 + g] = own[g] * f[g]
        seen[3] += e[g] * f[g]
    return seen


@kernel
def _bound(m, low, high):
    """Keep every hypothesis' trim and gain near those of the model: a fault is not to be learnt away."""
    for h in range(len(m)):
        m[h] = np.minimum(np.maximum(m[h], low), high)


@kernel
def _update(m, p, y, seen, covariance, noise):
    """Correct one Gaussian (m (N,), p (N, N), replaced) by y (3,) = seen' m + noise, seen (N, 3).

    Returns the square of the residual in its own covariance, and the log determinant of that. A residual far
    out in the tail of the t distribution counts less, and one that is too far nothing.
    """
    states, dof = len(m), noise.tail
    cross = np.zeros((states, 3))
    s = covariance.copy()
    v = y.copy()
    for i in range(states):
        for j in range(3):
            v[j] -= m[i] * seen[i, j]
            for k in range(states):
                cross[i, j] += p[i, k] * seen[k, j]
    for i in range(states):
        for j in range(3):
            for k in range(3):
                s[j, k] += seen[i, j] * cross[i, k]
    inverse, determinant = _inverse(s)
    gain = np.zeros((states, 3))
    square = 0.0
    for j in range(3):
        for k in range(3):
            square += v[j] * inverse[j, k] * v[k]
            for i in range(states):
                gain[i, j] += cross[i, k] * inverse[k, j]
    gain *= min(1.0, (dof + 3.0) / (dof + square)) if square < noise.farthest else 0.0
    for j in range(3):
        for i in range(states):
            m[i] += gain[i, j] * v[j]
            for k in range(i + 1):  # mirrored: what rounding makes of an unsymmetric p grows without bound
                p[i, k] -= gain[i, j] * cross[k, j]
                p[k, i] = p[i, k]
    return square, np.log(determinant)


@kernel
def _inverse(s):
    """Inverse and determinant of a symmetric (3, 3) matrix, by its cofactors."""
    c = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            d, e = (j + 1) % 3, (j + 2) % 3
            c[j, i] = s[a, d] * s[b, e] - s[a, e] * s[b, d]
    determinant = s[0, 0] * c[0, 0] + s[0, 1] * c[1, 0] + s[0, 2] * c[2, 0]
    return c / determinant, determinant
