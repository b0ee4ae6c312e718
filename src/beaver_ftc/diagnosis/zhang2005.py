"""The published scheme, to the letter (`fdi.scheme: zhang2005`) [Zhang2005, sec. IV, eq. (3) and (4)].

    FDAE         xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat(x, u, th0),     eps0 = x - xhat0
                 th0' = P{Gamma Z^T D[eps0]},   Z = d fhat / d th0,   th0 = 0 until Td
    detection    Td = inf {t: |eps0_i(t)| > ebar_i(t), some i},   ebar_i = int e^{-lam (t-tau)} eta_bar_i dtau
    FIE s        xhats' = -Lambdas (xhats - x) + f + G u + fhats(x, u, ths) + Oms ths',   from Td on
                 Oms' = -Lambdas Oms + Zs,   Oms(Td) = 0,   ths' = P{Gammas Oms^T epss}
    thresholds   mu_i^s = k_i^s |Om_i^s| + int_Td^t e^{-lam (t-tau)} eta_bar_i dtau + e^{-lam (t-Td)} w_i
    isolation    s is excluded once |eps_i^s| > mu_i^s, some i; the one left is the fault; none: not isolable

The estimators are those of detection.py and isolation.py, whose residuals and thresholds these are; here is
what differs: Euler steps, a network of (x, u), gradients in the place of least squares, and no alarm but the
FDAE's. D[eps] is eps outside the thresholds and 0 within [Zhang2002]. w is 0, since xhats(Td) = x(Td); of
noisy gyros, what they admit. What the paper leaves open is an option (plugins.yaml has them, with how each
was chosen); some take a part of the scheme out, to see what it was good for.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis.detection.fdae import gaussians, take_output
from beaver_ftc.diagnosis.state import CONSTANT, PITCH
from beaver_ftc.plugins import DETECTORS, settings
from beaver_ftc.scenario.schema import Scenario

# Centres of the network's basis functions on each axis of the aircraft: alpha (pitch) or beta, rad; the rate
# of the axis, rad/s; the deflection of the surface that leads it, as a share of its travel.
ALPHA_CENTRES, BETA_CENTRES = np.linspace(-0.1, 0.5, 9), np.linspace(-0.4, 0.4, 9)
RATE_CENTRES, SHARES = np.linspace(-0.3, 0.3, 3), np.linspace(0.0, 1.0, 3)
PLACES = (len(ALPHA_CENTRES), len(RATE_CENTRES), len(SHARES))
N_NODES = PLACES[0] * PLACES[1] * PLACES[2]

# first, step: of the centres, by axis and input. limit: of a weight, projection P; infinite without one.
# output: fhat, rad/s2.
NETWORK = record(
    config=record(gain=float, limit=float, first=(3, 3), step=(3, 3)),
    memory=record(along=(3, PLACES[0]), weights=(3, N_NODES), basis=(3, N_NODES)),
    output=3,
)

# dead_zone: whether the network waits for a residual outside the threshold; constant: rad/s, in the place of
# all adaptive thresholds, or 0.
CONFIG = record(dead_zone=int, constant=float)
PUBLISHED = record(config=CONFIG, network=NETWORK)


def configure_network(network: np.void, gain: float, limit: float, travel: np.ndarray) -> None:
    """Fill the record (dtype NETWORK); travel (2, 3) rad: of the surfaces that lead roll, pitch and yaw."""
    network["config"]["gain"], network["config"]["limit"] = gain, limit
    for i in range(3):
        reach = travel[0, i] + SHARES * (travel[1, i] - travel[0, i])
        for j, centres in enumerate((ALPHA_CENTRES if i == PITCH else BETA_CENTRES, RATE_CENTRES, reach)):
            network["config"]["first"][i, j], network["config"]["step"][i, j] = (
                centres[0],
                centres[1] - centres[0],
            )


def configure(fdi: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Turn the stages of a diagnosis (scheme.py), filled in already, into the published scheme; travel (2, n)
    rad: the stops."""
    config, dt, isolation = scenario.fdi, 1.0 / scenario.rate_hz, fdi["isolation"]
    option, published = settings(DETECTORS, config.scheme, config.options), fdi["published"]
    published["config"]["dead_zone"] = option["dead_zone"]
    limit = option["network_limit_rad_s2"] if option["projection"] else np.inf
    configure_network(published["network"], option["network_gain"], limit, travel[:, fdi["layout"]["main"]])
    fdi["fdae"]["config"]["decay"] = fdi["bank"]["config"]["decay"][0] = euler(
        config.detection_pole_per_s, dt
    )
    isolation["config"]["decay"] = euler(config.isolation_pole_per_s, dt)
    isolation["config"]["by_gradient"], isolation["config"]["gradient"] = 1, option["adaptation_gain"]
    isolation["estimator"]["theta"] = option["initial_theta"]
    isolation["config"]["unprojected"] = not option["projection"]
    if not option["adaptive_threshold"]:
        published["config"]["constant"], isolation["config"]["thresholds"] = (
            option["constant_threshold_rad_s"],
            CONSTANT,
        )
    if option["leave_out"]:
        isolation["estimator"]["excluded"][int(option["leave_out"]) - 1] = 1


def euler(pole_per_s: float, dt_s: float) -> float:
    """What a step of Euler keeps of a filter's state; a pole beyond the frame rate keeps nothing."""
    return max(1.0 - pole_per_s * dt_s, 0.0)


@kernel
def place(network, i, j, count, value):
    """Fill along[j] with the Gaussians of input j of axis i at `value`; their squares add up to 1."""
    at = min(max((value - network.config.first[i, j]) / network.config.step[i, j], 0.0), count - 1.0)
    norm = np.sqrt(gaussians(at, count, 0, network.memory.along[j]))
    for k in range(count):
        network.memory.along[j, k] /= norm


@kernel
def evaluate(network, main, x, y, u):
    """Fill basis, of unit length on each axis, and network.output (3,) rad/s2 at (x, u).

    x (3,) rad/s; y: measured signals; u (n,) rad; main (3,): the surface that leads each axis.
    """
    for i in range(3):
        place(network, i, 0, PLACES[0], y[ALPHA] if i == PITCH else y[BETA])
        place(network, i, 1, PLACES[1], x[i])
        place(network, i, 2, PLACES[2], u[main[i]])
        node, total = 0, 0.0
        for a in range(PLACES[0]):
            for b in range(PLACES[1]):
                for c in range(PLACES[2]):
                    phi = network.memory.along[0, a] * network.memory.along[1, b] * network.memory.along[2, c]
                    network.memory.basis[i, node] = phi
                    total += network.memory.weights[i, node] * phi
                    node += 1
        network.output[i] = total


@kernel
def learn(network, signal, dt):
    """th' = P{Gamma Z^T signal}, by a step of dt s; signal (3,), Z: the basis as it was evaluated."""
    for i in range(3):
        for j in range(N_NODES):
            weight = (
                network.memory.weights[i, j]
                + dt * network.config.gain * network.memory.basis[i, j] * signal[i]
            )
            network.memory.weights[i, j] = min(max(weight, -network.config.limit), network.config.limit)


@kernel
def approximate(published, fdae, detected, dt):
    """The FDAE's network learns from the residual the frame began with, once a fault is detected.

    Without the dead zone it learns from the first frame on, whatever the residual.
    """
    outside = False
    for i in range(3):
        outside = outside or abs(fdae.output.residual[i]) > fdae.output.threshold[i]
    if not published.config.dead_zone or (detected and outside):
        learn(published.network, fdae.output.residual, dt)


@kernel
def respond(published, fdae, main, x, y, u):
    """Bring fhat to this frame, where the FDAE and the log read it; arguments as of `evaluate`."""
    evaluate(published.network, main, x, y, u)
    take_output(fdae.network, published.network.output)


@kernel
def detect(fdae):
    """The first axis on which the residual of the FDAE exceeds its threshold, or -1."""
    for i in range(3):
        if abs(fdae.output.residual[i]) > fdae.output.threshold[i]:
            return i
    return -1
