"""The network that learns an unknown fault: Gaussian radial basis functions of alpha and of beta, linear in
its weights.

    fhat_i = W_i^T Phi(alpha, beta)       W_i' = P{gain Phi D[eps_i] - leak W_i},   |Phi| = 1

[Zhang2005, sec. IV and V]. Phi is normalised, so that `gain` alone sets the bandwidth of learning wherever
the state is. D is a continuous dead zone at the detection threshold: the network cannot learn what the
admitted uncertainty explains.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import ALPHA_CENTRES, BETA_CENTRES, N_BASIS

_PER_STEP = np.exp(-1.0)
_N_ALPHA = len(ALPHA_CENTRES)
_N_BETA = len(BETA_CENTRES)
_ALPHA_FIRST, _ALPHA_STEP = ALPHA_CENTRES[0], ALPHA_CENTRES[1] - ALPHA_CENTRES[0]
_BETA_FIRST, _BETA_STEP = BETA_CENTRES[0], BETA_CENTRES[1] - BETA_CENTRES[0]


@kernel
def gaussians(place, count, first, out):
    """Fill out[first : first + count] with exp(-(place - j)^2 / 2), j = 0, 1, ...; return the squares' sum.

    From one to the next they change by exp(place - j - 1/2), and that by 1/e: two exponentials do for all.
    """
    value, change = np.exp(-0.5 * place * place), np.exp(place - 0.5)
    square = 0.0
    for j in range(count):
        out[first + j] = value
        square += value * value
        value *= change
        change *= _PER_STEP
    return square


@kernel
def basis(alpha, beta, out):
    """Fill out (N_BASIS,) with the normalised radial basis functions at (alpha, beta), rad.

    Each width equals the spacing of its centres; outside the grid the nearest edge answers.
    """
    a = min(max((alpha - _ALPHA_FIRST) / _ALPHA_STEP, 0.0), _N_ALPHA - 1.0)
    b = min(max((beta - _BETA_FIRST) / _BETA_STEP, 0.0), _N_BETA - 1.0)
    norm = np.sqrt(gaussians(a, _N_ALPHA, 0, out) + gaussians(b, _N_BETA, _N_ALPHA, out))
    for j in range(N_BASIS):
        out[j] /= norm


@kernel
def dead_zone(residual, threshold):
    """D[eps]: zero inside the threshold, the excess over it outside."""
    if residual > threshold:
        return residual - threshold
    if residual < -threshold:
        return residual + threshold
    return 0.0


@kernel
def evaluate(network, alpha, beta):
    """Fill network.output (3,) rad/s2 for the present alpha and beta."""
    basis(alpha, beta, network.basis)
    for i in range(3):
        total = 0.0
        for j in range(N_BASIS):
            total += network.weights[i, j] * network.basis[j]
        network.output[i] = total


@kernel
def learn(network, residual, threshold, leaking, dt):
    """Advance the weights by one frame; residual and threshold (3,) rad/s, dt s.

    `leaking` lets go of what was learnt once another estimate explains the fault.
    """
    keep = np.exp(-network.leak_per_s * dt) if leaking else 1.0
    limit = network.weight_limit
    for i in range(3):
        drive = dt * network.gain * dead_zone(residual[i], threshold[i])
        for j in range(N_BASIS):
            weight = keep * network.weights[i, j] + drive * network.basis[j]
            network.weights[i, j] = min(max(weight, -limit), limit)
