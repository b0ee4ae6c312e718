"""The fault detection and approximation estimator (FDAE), always on, and the network that learns a fault.

    xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat,  eps0 = x - xhat0,  alarm when |eps0_i| > ebar_i, some i

[Zhang2005, sec. IV]. Until the alarm eps0 is filter 0 of the bank (bank.py), which raises it. Written for
the discrete truth: xhat0[k+1] = x[k] + dt F[k] + exp(-Lambda0 dt) (xhat0[k] - x[k]).

The network: Gaussian radial basis functions of alpha and of beta, linear in its weights.

    fhat_i = W_i^T Phi(alpha, beta)       W_i' = P{gain Phi D[eps_i] - leak W_i},   |Phi| = 1

[Zhang2005, sec. IV and V]. Phi is normalised, so that `gain` alone sets the bandwidth of learning wherever
the state is. D is a continuous dead zone at the detection threshold: the network cannot learn what the
admitted uncertainty explains.
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.detection.bank import alarm
from beaver_ftc.diagnosis.detection.thresholds import bound_step, noise_step
from beaver_ftc.diagnosis.state import STATISTICS, WORST_CASE
from beaver_ftc.scenario.schema import Scenario

# Centres of the network's basis functions, rad; and its record. gain 1/s2, weight_limit rad/s2; output: fhat,
# rad/s2.
ALPHA_CENTRES = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES = np.linspace(-0.3, 0.3, 5)
N_BASIS = len(ALPHA_CENTRES) + len(BETA_CENTRES)
NETWORK = record(
    config=record(gain=float, leak_per_s=float, weight_limit=float),
    memory=record(weights=(3, N_BASIS), basis=N_BASIS),
    output=3,
)

# pole 1/s; decay: a. xhat: the estimate of the rates, rad/s; threshold_eta, threshold_noise rad/s: parts of
# the threshold. residual, threshold rad/s.
CONFIG = record(pole=3, decay=3)
MEMORY = record(xhat=3, threshold_eta=3, threshold_noise=3)
OUTPUT = record(residual=3, threshold=3)
FDAE = record(config=CONFIG, memory=MEMORY, output=OUTPUT, network=NETWORK)

_PER_STEP = np.exp(-1.0)
_N_ALPHA, _N_BETA = len(ALPHA_CENTRES), len(BETA_CENTRES)
_ALPHA_FIRST, _ALPHA_STEP = ALPHA_CENTRES[0], ALPHA_CENTRES[1] - ALPHA_CENTRES[0]
_BETA_FIRST, _BETA_STEP = BETA_CENTRES[0], BETA_CENTRES[1] - BETA_CENTRES[0]


def configure(fdae: np.void, scenario: Scenario) -> None:
    """Fill in the estimator's pole, and how its network learns."""
    config, network = scenario.control, fdae["network"]
    fdae["config"]["pole"] = scenario.fdi.detection_pole_per_s
    fdae["config"]["decay"] = exp(-scenario.fdi.detection_pole_per_s * (1.0 / scenario.rate_hz))
    network["config"]["gain"], network["config"]["leak_per_s"] = (
        config.network_gain_per_s2,
        config.network_leak_per_s,
    )
    network["config"]["weight_limit"] = config.network_weight_limit_rad_s2


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
    basis(alpha, beta, network.memory.basis)
    for i in range(3):
        total = 0.0
        for j in range(N_BASIS):
            total += network.memory.weights[i, j] * network.memory.basis[j]
        network.output[i] = total


@kernel
def learn(network, residual, threshold, leaking, dt):
    """Advance the weights by one frame; residual and threshold (3,) rad/s, dt s.

    `leaking` lets go of what was learnt once another estimate explains the fault.
    """
    keep = np.exp(-network.config.leak_per_s * dt) if leaking else 1.0
    limit = network.config.weight_limit
    for i in range(3):
        drive = dt * network.config.gain * dead_zone(residual[i], threshold[i])
        for j in range(N_BASIS):
            weight = keep * network.memory.weights[i, j] + drive * network.memory.basis[j]
            network.memory.weights[i, j] = min(max(weight, -limit), limit)


@kernel
def begin(fdae, noise, x):
    """Start at the first measurement x (3,) rad/s: no residual, and all of the gyro's error still to come.

    noise (3,) rad/s: by how much the gyros' errors may change.
    """
    fdae.memory.xhat[:], fdae.memory.threshold_noise[:] = x, noise


@kernel
def hold_threshold(fdae, constant):
    """Replace the threshold by a constant, rad/s."""
    fdae.output.threshold[:] = constant


@kernel
def take_output(network, fhat):
    """Replace the output of the network by that of another, fhat (3,) rad/s2."""
    network.output[:] = fhat


@kernel
def reset_network(network):
    """Discard what the network has learnt."""
    network.memory.weights[:], network.output[:] = 0.0, 0.0


@kernel
def form_residual(fdae, x):
    """Fill the residual for the measured x (3,) rad/s."""
    for i in range(3):
        fdae.output.residual[i] = x[i] - fdae.memory.xhat[i]


@kernel
def detect(bank, authority, statistical_alarm):
    """The axis on which a detector in authority raises the alarm, or -1.

    statistical_alarm: `ALARM` of the statistical detector.
    """
    axis = alarm(bank) if authority != STATISTICS else -1
    if axis < 0 and authority != WORST_CASE and statistical_alarm.score > 1.0:
        axis = statistical_alarm.axis
    return axis


@kernel
def predict(fdae, bound, x, believed, detected, leaking, dt):
    """Advance the FDAE and its threshold by one frame; once `detected`, the network learns what exceeds the
    threshold.

    x (3,) rad/s; `believed` (3,) rad/s2 is f + G u, with the isolated fault once there is one.
    """
    if detected:
        learn(fdae.network, fdae.output.residual, fdae.output.threshold, leaking, dt)
    for i in range(3):
        rate, decay = believed[i] + fdae.network.output[i], fdae.config.decay[i]
        fdae.memory.xhat[i] = x[i] + dt * rate + decay * (fdae.memory.xhat[i] - x[i])
        fdae.memory.threshold_eta[i] = bound_step(fdae.memory.threshold_eta[i], bound.eta_bar[i], decay, dt)
        fdae.memory.threshold_noise[i] = noise_step(
            fdae.memory.threshold_noise[i], bound.noise_then[i], decay
        )
        fdae.output.threshold[i] = (
            fdae.memory.threshold_eta[i] + fdae.memory.threshold_noise[i] + bound.noise[i]
        )


@kernel
def unknown_acceleration(fdae, noise, out):
    """Fill out (3,) rad/s2 with what the FDAE believes beyond the model: learnt, and about to be learnt.

    The residual settles at (phi - fhat) / Lambda0, so Lambda0 eps0 is the part of the fault not yet in the
    weights, at the bandwidth of the estimator. What the gyro's noise (3,) rad/s alone explains stays out of
    it, and off the surfaces.
    """
    for i in range(3):
        explained = fdae.memory.threshold_noise[i] + noise[i]
        out[i] = fdae.network.output[i] + fdae.config.pole[i] * dead_zone(fdae.output.residual[i], explained)
