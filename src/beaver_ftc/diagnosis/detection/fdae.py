"""The fault detection and approximation estimator (FDAE), which is always on, and its network.

    xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat,  eps0 = x - xhat0,  alarm when |eps0_i| > mu_i, some i

[Zhang2005, sec. IV]. Until the alarm eps0 is filter 0 of the bank, which raises it. In discrete time
xhat0[k+1] = x[k] + dt (F[k] + fhat[k]) + exp(-Lambda0 dt) (xhat0[k] - x[k]).

Its network approximates the fault by Gaussian radial basis functions of alpha and of beta, linear in its
weights:

    fhat_i = W_i^T Phi(alpha, beta)       W_i' = P{gain Phi D[eps_i] [- leak W_i]},   |Phi| = 1

[Zhang2005, sec. IV and V]. Phi is normalised, so that `gain` alone sets the bandwidth of learning at any
state. The leak acts once another estimate explains the fault. D is a continuous dead zone at the detection
threshold: the network cannot learn what the declared uncertainty explains.

Symbols of the kernels:

    x, F          measured rates (3,) rad/s; mean acceleration of the design model (3,) rad/s2
    i, j          axis, basis function
    bank, bound   detection filters (filters.py), record of `bound_dtype`
    net, M        record of FDAE_NETWORK_RECORD, memory of the FDAE
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import copy, fill, kernel, record
from beaver_ftc.diagnosis.detection.directions import project
from beaver_ftc.diagnosis.detection.filters import advance_bound
from beaver_ftc.scenario.declared import Declared

# Centres of the network's basis functions, rad; and its record. gain 1/s2, w_max rad/s2; output fhat, rad/s2.
ALPHA_CENTRES_RAD = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES_RAD = np.linspace(-0.3, 0.3, 5)
N_BASIS = len(ALPHA_CENTRES_RAD) + len(BETA_CENTRES_RAD)
FDAE_NETWORK_RECORD = record(
    config=record(gain=float, leak=float, w_max=float),
    memory=record(weights=(3, N_BASIS), Phi=N_BASIS),
    output=3,
)

# xhat: the estimate of the rates, rad/s; residual, threshold rad/s; m: see `advance_fdae`.
FDAE_RECORD = record(
    config=record(pole_per_s=3, a=3), memory=record(xhat=3, m=3), output=record(residual=3, threshold=3),
    network=FDAE_NETWORK_RECORD,
)  # fmt: skip

_GAUSS_RATIO = np.exp(-1.0)
# c0, dc, n of `fill_gaussians`
_ALPHA_GRID, _BETA_GRID = ((c[0], c[1] - c[0], len(c)) for c in (ALPHA_CENTRES_RAD, BETA_CENTRES_RAD))


def configure_fdae(fdae: np.void, declared: Declared) -> None:
    """Fill in the estimator's pole, and how its network learns."""
    control = declared.control
    lam = declared.fdi.detection_pole_per_s
    fill(fdae["config"], pole_per_s=lam, a=exp(-lam * (1.0 / declared.rate_hz)))
    fill(
        fdae["network"]["config"], gain=control.network_gain_per_s2, leak=control.network_leak_per_s,
        w_max=control.network_weight_limit_rad_s2,
    )  # fmt: skip


@kernel
def start(bank, fdae, x, n):
    """Start FDAE and bank at the first measurement x (3,) rad/s; n (3,) rad/s: bounds on the changing part of
    the errors of the gyros, which the filters contain from the start."""
    copy(x, fdae.memory.xhat)
    copy(n, fdae.memory.m)
    for e in bank.memory.e[: bank.config.n_filters]:
        copy(n, e)


@kernel
def fill_gaussians(v, c0, dc, n, first, out):
    """Fill out from `first` on with exp(-(z - j)^2 / 2), j < n; return the sum of their squares.

    z = (v - c0) / dc: place of v among n centres from c0 on, dc apart; outside them the nearest edge answers.
    The ratio of a value and the one before is exp(z - j - 1/2). The ratio of two successive ratios is 1 / e.
    So two exponentials are enough for all values.
    """
    z = min(max((v - c0) / dc, 0.0), n - 1.0)
    g = np.exp(-0.5 * z * z)
    ratio = np.exp(z - 0.5)
    total = 0.0
    for j in range(n):
        out[first + j] = g
        total += g * g
        g *= ratio
        ratio *= _GAUSS_RATIO
    return total


@kernel
def fill_basis(alpha, beta, out):
    """Fill out (N_BASIS,) with Phi, the normalised radial basis functions at (alpha, beta), rad.

    Each width equals the spacing of its centres.
    """
    norm = np.sqrt(
        fill_gaussians(alpha, *_ALPHA_GRID, 0, out) + fill_gaussians(beta, *_BETA_GRID, _ALPHA_GRID[2], out)
    )
    for j in range(N_BASIS):
        out[j] /= norm


@kernel
def beyond_bound(eps, mu):
    """D[eps] = eps - clip(eps, -mu, mu): zero within the threshold mu, the excess over it outside."""
    return eps - min(max(eps, -mu), mu)


@kernel
def evaluate_network(net, alpha, beta):
    """fhat = W^T Phi, rad/s2, at the present alpha and beta."""
    fill_basis(alpha, beta, net.memory.Phi)
    for i in range(3):
        net.output[i] = project(net.memory.weights[i], net.memory.Phi)


@kernel
def train(W, Phi, a, step, W_max):
    """W <- clip(a W + step Phi, W_max): a row of weights, and of the basis."""
    for j in range(Phi.size):
        W[j] = min(max(a * W[j] + step * Phi[j], -W_max), W_max)


@kernel
def train_network(net, eps, mu, leaks, dt):
    """W <- clip(exp(-leak dt) W + dt gain D[eps] Phi, w_max): the weights after a frame.

    eps (3,) rad/s: residual; mu (3,) rad/s: its threshold; leaks: whether the weights decay, because another
    estimate explains the fault; otherwise exp(-leak dt) is 1.
    """
    a = np.exp(-net.config.leak * dt) if leaks else 1.0
    for i in range(3):
        step = dt * net.config.gain * beyond_bound(eps[i], mu[i])
        train(net.memory.weights[i], net.memory.Phi, a, step, net.config.w_max)


@kernel
def reset_network(net):
    """Set the weights and the output of the network to zero."""
    net.memory.weights[:] = net.output[:] = 0.0


@kernel
def fdae_residual(fdae, x):
    """Fill eps0 = x - xhat0, (3,) rad/s, of the FDAE."""
    for i in range(3):
        fdae.output.residual[i] = x[i] - fdae.memory.xhat[i]


@kernel
def advance_fdae(fdae, bank, bound, x, F, detected, leaks, dt):
    """Advance the FDAE by a frame; after detection, the network first learns what exceeds mu, from residual,
    mu and basis of the frame before.

        xhat <- x + dt (F + fhat) + a (xhat - x)      m <- a m + (1 - a) n_old

    x (3,) rad/s: at the start of the frame; F (3,) rad/s2: with the isolated fault once there is one. The new
    mu is that of filter 0 of the bank, which is at this frame. An error of a gyro adds at most m + n to a
    residual.
    """
    M = fdae.memory
    mu = fdae.output.threshold
    if detected:
        train_network(fdae.network, fdae.output.residual, mu, leaks, dt)
    for i in range(3):
        a = fdae.config.a[i]
        M.xhat[i] = x[i] + dt * (F[i] + fdae.network.output[i]) + a * (M.xhat[i] - x[i])
        M.m[i] = advance_bound(M.m[i], 0.0, a, dt, bound.n_old[i])
        mu[i] = bank.output.threshold[0, i]


@kernel
def fdae_unmodelled(fdae, n, out):
    """Fill out = fhat + Lambda0 D[eps0], (3,) rad/s2: estimated acceleration in addition to the model.

    The residual settles at (phi - fhat) / Lambda0, so Lambda0 eps0 is the part of the fault not yet in the
    weights, at the bandwidth of the estimator. The dead zone m + n is what the gyro's error alone explains:
    it stays out of the estimate, and off the surfaces.
    """
    for i in range(3):
        eps = beyond_bound(fdae.output.residual[i], fdae.memory.m[i] + n[i])
        out[i] = fdae.network.output[i] + fdae.config.pole_per_s[i] * eps
