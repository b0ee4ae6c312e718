"""A bank of filters over what may have happened to the surfaces: causal, one pass, all hypotheses at once.

Under hypothesis h with effectiveness e_h of the groups, what the past does not explain of the rates is

    y = c + s (b + sum_g e_hg F_g) + sum_g d_g e_hg F_g + noise,      noise ~ t(0, r R)

with the model's constant b, and of the flight its own trim c (3,), gain s, and what each group has more of it
than the others, d (G,): each hypothesis estimates them by a Kalman filter. r is the running scale of the
noise. The gain acts on what a trimmed flight balances: it shows by the motion alone, as dynamic pressure
does, and not in the trim. A hypothesis passes to another at random
times (interacting multiple models [Blom1988]): the one that takes over inherits trim and gain, plus an offset
where a surface may be stuck. One hypothesis says that nothing answers the commands, as on the ground: it
learns no trim and no gain.
"""

import numpy as np

from beaver_ftc.compiled import kernel

_FLOOR = 1e-15
_CLIP = 3.0
_EXPECTED = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""


@kernel
def run_bank(y, f, base, ok, e, reach, stay, offset, idle, start, m0, p0, bound, keep, walk, noise, options):
    """Posterior probability of each hypothesis, mean trim and gain, noise scale, and evidence, by sample.

    Evidence is the log likelihood of the sample given all before it, raised to the power.

    Shapes: y (n, 3); f (n, G, 3) responses; base (3,) constant; ok (n,) the sample may be used; e (H, G)
    effectiveness; reach (H,) probability of passing to each hypothesis in a sample; stay: of none; offset
    (H, 3) variance added to the trim on passing to it; idle: the hypothesis that nothing answers the
    commands; start (H,) at first; m0 (N,) and p0 (N, N) mean and covariance of the N = 4 + G states: trim,
    gain, the groups' own; bound (N,) how far they may go from m0; keep (N,) share of what they are off m0
    that is left a sample later; walk (N,) variance added a sample; noise (3, 3).
    options: power of the likelihood, degrees of freedom, memory in samples, least and largest noise scale.
    """
    n, hypotheses = len(y), len(e)
    power, dof, memory, least, most = options
    mu = start.copy()
    m = np.zeros((hypotheses, len(m0)))
    p = np.zeros((hypotheses, len(m0), len(m0)))
    for h in range(hypotheses):
        m[h] = m0
        p[h] = p0
    posterior = np.zeros((n, hypotheses))
    trim = np.zeros((n, len(m0)))
    scales = np.zeros(n)
    evidence = np.zeros(n)
    scale = 1.0
    for k in range(n):
        prior = _mix(mu, m, p, reach, stay, offset, walk)
        _relax(m, p, m0, keep)
        _forget(m[idle], p[idle], m0, p0)
        if ok[k]:
            mu, square, evidence[k] = _correct(
                prior, m, p, y[k], f[k], base, e, idle, noise * scale, power, dof
            )
            _bound(m, m0, bound)
            scale *= np.exp((1.0 - mu[idle]) * (square / 3.0 - _EXPECTED) / memory)
            scale = min(max(scale, least), most)
        else:
            mu = prior
        posterior[k] = mu
        scales[k] = scale
        for h in range(hypotheses):
            trim[k] += mu[h] * m[h]
    return posterior, trim, scales, evidence


@kernel
def _mix(mu, m, p, reach, stay, offset, walk):
    """Let each hypothesis pass to any other; m and p are replaced, the prior probabilities returned."""
    hypotheses, states = m.shape
    mean = np.zeros(states)
    spread = np.zeros((states, states))
    for h in range(hypotheses):
        for i in range(states):
            mean[i] += mu[h] * m[h, i]
    for h in range(hypotheses):
        for i in range(states):
            for j in range(states):
                spread[i, j] += mu[h] * (p[h, i, j] + (m[h, i] - mean[i]) * (m[h, j] - mean[j]))
    prior = np.empty(hypotheses)
    total = 0.0
    for h in range(hypotheses):
        prior[h] = stay * mu[h] + reach[h]
        total += prior[h]
        _merge(stay * mu[h] / prior[h], m[h], p[h], mean, spread, offset[h], walk)
    return prior / total


@kernel
def _merge(own, m, p, mean, spread, offset, walk):
    """One Gaussian for two: the hypothesis' own (m, p) with weight `own`, everyone's with the rest.

    m (N,) and p (N, N) are replaced; who comes from elsewhere brings the offset (3,) along.
    """
    rest = 1.0 - own
    for i in range(len(m)):
        for j in range(len(m)):
            between = (m[i] - mean[i]) * (m[j] - mean[j])
            p[i, j] = own * p[i, j] + rest * spread[i, j] + own * rest * between
    for i in range(len(m)):
        m[i] = own * m[i] + rest * mean[i]
        p[i, i] += walk[i]
    for i in range(len(offset)):
        p[i, i] += rest * offset[i]


@kernel
def _relax(m, p, m0, keep):
    """Let trim and gain of every hypothesis return towards m0; m (H, N) and p (H, N, N) are replaced."""
    for h in range(len(m)):
        for i in range(len(m0)):
            m[h, i] = m0[i] + keep[i] * (m[h, i] - m0[i])
            for j in range(len(m0)):
                p[h, i, j] *= keep[i] * keep[j]


@kernel
def _correct(prior, m, p, y, f, base, e, idle, noise, power, dof):
    """Kalman correction of every hypothesis by one sample; m and p are replaced.

    Returns the posterior probabilities, the clipped square of the residual under them, and the evidence.
    """
    hypotheses, states = m.shape
    log = np.empty(hypotheses)
    squares = np.empty(hypotheses)
    nothing, certain = np.zeros(states), np.zeros((states, states))
    for h in range(hypotheses):
        seen = _seen(e[h], f, base, states)
        if h == idle:
            squares[h], log_det = _update(nothing, certain, y, seen, noise, dof)
        else:
            squares[h], log_det = _update(m[h], p[h], y, seen, noise, dof)
        log[h] = power * (-0.5 * (dof + 3.0) * np.log(1.0 + squares[h] / dof) - 0.5 * log_det)
    most = log.max()
    mu = np.maximum(prior * np.exp(log - most), _FLOOR)
    total = mu.sum()
    mu /= total
    clipped = 0.0
    for h in range(hypotheses):
        clipped += mu[h] * min(squares[h], 3.0 * _CLIP)
    return mu, clipped, most + np.log(total)


@kernel
def _seen(e, f, base, states):
    """How the rates show the states, (N, 3): trim, the gain of the constant and of all groups' answers f
    (G, 3), each as effective as e (G,) says, and of each group's own."""
    seen = np.zeros((states, 3))
    for i in range(3):
        seen[i, i] = 1.0
        seen[3, i] = base[i]
        for g in range(len(e)):
            seen[3, i] += e[g] * f[g, i]
            seen[4 + g, i] = e[g] * f[g, i]
    return seen


@kernel
def _forget(m, p, m0, p0):
    """Trim and gain as before any flight: while nothing answers, nothing is learnt."""
    for i in range(len(m0)):
        m[i] = m0[i]
        for j in range(len(m0)):
            p[i, j] = p0[i, j]


@kernel
def _bound(m, m0, bound):
    """Keep every hypothesis' trim and gain near those of the model: a fault is not to be learnt away."""
    for h in range(len(m)):
        for i in range(len(m0)):
            m[h, i] = min(max(m[h, i], m0[i] - bound[i]), m0[i] + bound[i])


@kernel
def _update(m, p, y, seen, noise, dof):
    """Correct one Gaussian (m (N,), p (N, N), replaced) by y (3,) = seen' m + noise, seen (N, 3).

    Returns the square of the residual in its own covariance, and the log determinant of that. A residual far
    out in the tail of the t distribution counts less.
    """
    states = len(m)
    cross = np.zeros((states, 3))
    s = noise.copy()
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
    weight = min(1.0, (dof + 3.0) / (dof + square))
    for i in range(states):
        for j in range(3):
            m[i] += weight * gain[i, j] * v[j]
            for k in range(states):
                p[i, k] -= weight * gain[i, j] * cross[k, j]
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
