"""A bank of filters over what may have happened to the surfaces: causal, one pass, all hypotheses at once.

Under hypothesis h with effectiveness e_h of the groups, what the past does not explain of the rates is

    y = c + s (sum_g e_hg F_g) + noise,      noise ~ t(0, r R)

with the flight's own trim c (3,) and control gain s, which each hypothesis estimates by a Kalman filter,
and r the running scale of the noise. A hypothesis passes to another at random times (interacting multiple
models [Blom1988]): the one that takes over inherits trim and gain, plus an offset where a surface may be
stuck.
"""

import numpy as np

from beaver_ftc.compiled import kernel

_FLOOR = 1e-15
_CLIP = 3.0
_EXPECTED = 0.93
"""Mean of the clipped square of a residual per axis when the scale is right."""


@kernel
def run_bank(y, f, ok, e, reach, stay, offset, fresh, start, m0, p0, walk, noise, options):
    """Posterior probability of each hypothesis, and mean trim, gain and noise scale, after each sample.

    Shapes: y (n, 3); f (n, G, 3) responses; ok (n,) the sample may be used; e (H, G) effectiveness;
    reach (H,) probability of passing to each hypothesis in a sample; stay: of none; offset (H, 3) variance
    added to the trim on passing to it; fresh: probability of a new trim and gain in a sample; start (H,) at
    first; m0 (4,) and p0 (4,) mean and variance of trim and gain; walk (4,) variance added a sample; noise
    (3, 3).
    options: power of the likelihood, degrees of freedom, memory in samples, least and largest noise scale.
    """
    n, hypotheses = len(y), len(e)
    power, dof, memory, least, most = options
    mu = start.copy()
    m = np.zeros((hypotheses, 4))
    p = np.zeros((hypotheses, 4, 4))
    for h in range(hypotheses):
        m[h] = m0
        for i in range(4):
            p[h, i, i] = p0[i]
    posterior = np.zeros((n, hypotheses))
    trim = np.zeros((n, 4))
    scales = np.zeros(n)
    scale = 1.0
    for k in range(n):
        prior = _mix(mu, m, p, reach, stay, offset, fresh, m0, p0, walk)
        if ok[k]:
            mu, square = _correct(prior, m, p, y[k], f[k], e, noise * scale, power, dof)
            scale *= np.exp((square / 3.0 - _EXPECTED) / memory)
            scale = min(max(scale, least), most)
        else:
            mu = prior
        posterior[k] = mu
        scales[k] = scale
        for h in range(hypotheses):
            trim[k] += mu[h] * m[h]
    return posterior, trim, scales


@kernel
def _mix(mu, m, p, reach, stay, offset, fresh, m0, p0, walk):
    """Let each hypothesis pass to any other; m and p are replaced, the prior probabilities returned."""
    mean = np.zeros(4)
    spread = np.zeros((4, 4))
    for h in range(len(mu)):
        mean += mu[h] * m[h]
    for h in range(len(mu)):
        d = m[h] - mean
        spread += mu[h] * (p[h] + np.outer(d, d))
    prior = np.empty(len(mu))
    for h in range(len(mu)):
        renewed = fresh if h == 0 else 0.0
        prior[h] = stay * mu[h] + reach[h] + renewed
        a, b, c = stay * mu[h] / prior[h], reach[h] / prior[h], renewed / prior[h]
        centre = a * m[h] + b * mean + c * m0
        d0, d1, d2 = m[h] - centre, mean - centre, m0 - centre
        p[h] = a * (p[h] + np.outer(d0, d0)) + b * (spread + np.outer(d1, d1)) + c * np.outer(d2, d2)
        for i in range(4):
            p[h, i, i] += walk[i] + c * p0[i]
        for i in range(3):
            p[h, i, i] += b * offset[h, i]
        m[h] = centre
    return prior / prior.sum()


@kernel
def _correct(prior, m, p, y, f, e, noise, power, dof):
    """Kalman correction of every hypothesis by one sample; m and p are replaced.

    Returns the posterior probabilities and the clipped square of the residual under them.
    """
    hypotheses, groups = e.shape
    log = np.empty(hypotheses)
    squares = np.empty(hypotheses)
    c = np.zeros((3, 4))
    for i in range(3):
        c[i, i] = 1.0
    for h in range(hypotheses):
        for i in range(3):
            c[i, 3] = 0.0
            for g in range(groups):
                c[i, 3] += e[h, g] * f[g, i]
        pc = p[h] @ c.T
        s = c @ pc + noise
        inverse = np.linalg.inv(s)
        v = y - c @ m[h]
        square = v @ (inverse @ v)
        weight = min(1.0, (dof + 3.0) / (dof + square))
        gain = pc @ inverse
        m[h] = m[h] + weight * (gain @ v)
        p[h] = p[h] - weight * (gain @ pc.T)
        log[h] = power * (-0.5 * (dof + 3.0) * np.log(1.0 + square / dof) - 0.5 * np.log(np.linalg.det(s)))
        squares[h] = square
    mu = np.maximum(prior * np.exp(log - log.max()), _FLOOR)
    mu /= mu.sum()
    clipped = 0.0
    for h in range(hypotheses):
        clipped += mu[h] * min(squares[h], 3.0 * _CLIP)
    return mu, clipped
