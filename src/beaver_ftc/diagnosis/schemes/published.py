"""The published scheme, to the letter (`fdi.scheme: zhang2005`) [Zhang2005, sec. IV, eq. (3) and (4)].

    FDAE         xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat(x, u, th0),     eps0 = x - xhat0
                 th0' = P{Gamma Z^T D[eps0]},   Z = d fhat / d th0,   th0 = 0 until Td
    detection    Td = inf {t: |eps0_i(t)| > ebar_i(t), some i},   ebar_i = int e^{-lam (t-tau)} eta_bar_i dtau
    FIE s        xhats' = -Lambdas (xhats - x) + f + G u + fhats(x, u, ths) + Oms ths',   from Td on
                 Oms' = -Lambdas Oms + Zs,   Oms(Td) = 0,   ths' = P{Gammas Oms^T epss}
    thresholds   mu_i^s = k_i^s |Om_i^s| + int_Td^t e^{-lam (t-tau)} eta_bar_i dtau + e^{-lam (t-Td)} w_i
    isolation    s is excluded once |eps_i^s| > mu_i^s, some i; the one left is the fault; none: not isolable

The estimators are those of detection/filters.py and isolation.py, whose residuals and thresholds these are.
This file has the differences: Euler steps, a network of (x, u), gradients instead of least squares, and no
alarm but the FDAE's. D[eps] is eps outside the thresholds and 0 within [Zhang2002]. w is 0, since xhats(Td) =
x(Td); with noisy gyros w is the bound on their noise. What the paper leaves open is an option (plugins.yaml
lists them, with how each was chosen); some options remove a part of the scheme, to measure the effect of that
part.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion, isolation
from beaver_ftc.diagnosis.detection import filters
from beaver_ftc.diagnosis.detection.filters import fill_gaussians, replace_network_output
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import adaptive_estimators, contract
from beaver_ftc.diagnosis.schemes.adaptive_estimators import begin
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.state import CONSTANT_THRESHOLD, PITCH
from beaver_ftc.plugins import DETECTORS, settings
from beaver_ftc.scenario.schema import Scenario

# Centres of the network's basis functions on each axis of the aircraft: alpha (pitch) or beta, rad; the rate
# of the axis, rad/s; the deflection of the surface that leads it, as a share of its travel.
ALPHA_CENTRES, BETA_CENTRES = np.linspace(-0.1, 0.5, 9), np.linspace(-0.4, 0.4, 9)
RATE_CENTRES, TRAVEL_SHARES = np.linspace(-0.3, 0.3, 3), np.linspace(0.0, 1.0, 3)
N_CENTRES = (len(ALPHA_CENTRES), len(RATE_CENTRES), len(TRAVEL_SHARES))
N_NODES = N_CENTRES[0] * N_CENTRES[1] * N_CENTRES[2]

# first, step: of the centres, by axis and input. limit: of a weight, projection P; infinite without one.
# output: fhat, rad/s2.
STATE_NETWORK = record(
    config=record(gain=float, limit=float, first=(3, 3), step=(3, 3)),
    memory=record(along=(3, N_CENTRES[0]), weights=(3, N_NODES), basis=(3, N_NODES)),
    output=3,
)

# dead_zone: whether the network waits for a residual outside the threshold; constant: rad/s, in the place of
# all adaptive thresholds, or 0.
PUBLISHED_CONFIG = record(dead_zone=int, constant=float)
PUBLISHED_RECORD = record(config=PUBLISHED_CONFIG, network=STATE_NETWORK)


def configure_network(network: np.void, gain: float, limit: float, travel: np.ndarray) -> None:
    """Fill the network's record; travel (2, 3) rad: of the surfaces that lead roll, pitch and yaw."""
    network["config"]["gain"], network["config"]["limit"] = gain, limit
    for i in range(3):
        reach = travel[0, i] + TRAVEL_SHARES * (travel[1, i] - travel[0, i])
        for j, centres in enumerate((ALPHA_CENTRES if i == PITCH else BETA_CENTRES, RATE_CENTRES, reach)):
            network["config"]["first"][i, j], network["config"]["step"][i, j] = (
                centres[0],
                centres[1] - centres[0],
            )


def configure_published(fdi: np.void, scenario: Scenario, travel: np.ndarray) -> None:
    """Turn the stages of a diagnosis, filled in already, into the published scheme; travel (2, n)
    rad: the stops."""
    config, dt, isolation = scenario.fdi, 1.0 / scenario.rate_hz, fdi["isolation"]
    option, published = settings(DETECTORS, config.scheme, config.options), fdi["published"]
    published["config"]["dead_zone"] = option["dead_zone"]
    limit = option["network_limit_rad_s2"] if option["projection"] else np.inf
    configure_network(published["network"], option["network_gain"], limit, travel[:, fdi["layout"]["main"]])
    fdi["fdae"]["config"]["decay"] = fdi["bank"]["config"]["decay"][0] = euler_decay(
        config.detection_pole_per_s, dt
    )
    isolation["config"]["decay"] = euler_decay(config.isolation_pole_per_s, dt)
    isolation["config"]["by_gradient"], isolation["config"]["gradient"] = 1, option["adaptation_gain"]
    isolation["estimator"]["theta"] = option["initial_theta"]
    isolation["config"]["unprojected"] = not option["projection"]
    if not option["adaptive_threshold"]:
        published["config"]["constant"], isolation["config"]["thresholds"] = (
            option["constant_threshold_rad_s"],
            CONSTANT_THRESHOLD,
        )
    if option["leave_out"]:
        isolation["estimator"]["excluded"][int(option["leave_out"]) - 1] = 1


def euler_decay(pole_per_s: float, dt_s: float) -> float:
    """What a step of Euler keeps of a filter's state; a pole beyond the frame rate keeps nothing."""
    return max(1.0 - pole_per_s * dt_s, 0.0)


@kernel
def fill_input_basis(network, i, j, count, value):
    """Fill along[j] with the Gaussians of input j of axis i at `value`; their squares add up to 1."""
    at = min(max((value - network.config.first[i, j]) / network.config.step[i, j], 0.0), count - 1.0)
    norm = np.sqrt(fill_gaussians(at, count, 0, network.memory.along[j]))
    for k in range(count):
        network.memory.along[j, k] /= norm


@kernel
def evaluate_state_network(network, main, x, y, u):
    """Fill basis, of unit length on each axis, and network.output (3,) rad/s2 at (x, u).

    x (3,) rad/s; y: measured signals; u (n,) rad; main (3,): the surface that leads each axis.
    """
    for i in range(3):
        fill_input_basis(network, i, 0, N_CENTRES[0], y[ALPHA] if i == PITCH else y[BETA])
        fill_input_basis(network, i, 1, N_CENTRES[1], x[i])
        fill_input_basis(network, i, 2, N_CENTRES[2], u[main[i]])
        node, total = 0, 0.0
        for a in range(N_CENTRES[0]):
            for b in range(N_CENTRES[1]):
                for c in range(N_CENTRES[2]):
                    phi = network.memory.along[0, a] * network.memory.along[1, b] * network.memory.along[2, c]
                    network.memory.basis[i, node] = phi
                    total += network.memory.weights[i, node] * phi
                    node += 1
        network.output[i] = total


@kernel
def train_state_network(network, signal, dt):
    """th' = P{Gamma Z^T signal}, by a step of dt s; signal (3,), Z: the basis as it was evaluated."""
    for i in range(3):
        for j in range(N_NODES):
            weight = (
                network.memory.weights[i, j]
                + dt * network.config.gain * network.memory.basis[i, j] * signal[i]
            )
            network.memory.weights[i, j] = min(max(weight, -network.config.limit), network.config.limit)


@kernel
def train_fdae_network(published, fdae, detected, dt):
    """The FDAE's network learns from the residual the frame began with, once a fault is detected.

    Without the dead zone it learns from the first frame on, with any residual.
    """
    outside = False
    for i in range(3):
        outside = outside or abs(fdae.output.residual[i]) > fdae.output.threshold[i]
    if not published.config.dead_zone or (detected and outside):
        train_state_network(published.network, fdae.output.residual, dt)


@kernel
def update_fdae_output(published, fdae, main, x, y, u):
    """Evaluate fhat for this frame, for the FDAE and the log; arguments as of `evaluate_state_network`."""
    evaluate_state_network(published.network, main, x, y, u)
    replace_network_output(fdae.network, published.network.output)


@kernel
def fdae_alarm_axis(fdae):
    """The first axis on which the residual of the FDAE exceeds its threshold, or -1."""
    for i in range(3):
        if abs(fdae.output.residual[i]) > fdae.output.threshold[i]:
            return i
    return -1


@apart
def predict(fdi, belief, measured, k, t):
    """Bring isolation, FDAE and its network to this frame (contract.CompiledScheme)."""
    published, bound, dt = fdi.published, fdi.bound, fdi.config.dt
    filters.update_bank(fdi.bank, bound, measured.x, belief.x_before, belief.means.acceleration, dt)
    contract.update_estimators(fdi, belief)
    train_fdae_network(published, fdi.fdae, fdi.verdict.detected, dt)
    filters.predict_fdae(fdi.fdae, bound, belief.x_before, belief.means.acceleration, False, False, dt)
    if published.config.constant > 0.0:
        set_all_thresholds(fdi, published.config.constant)


@kernel
def set_all_thresholds(fdi, constant):
    """Replace all adaptive thresholds by a constant, rad/s."""
    filters.set_fdae_threshold(fdi.fdae, constant)
    filters.set_bank_threshold(fdi.bank, constant)
    isolation.set_isolation_thresholds(fdi.isolation, constant)


@apart
def conclude(fdi, belief, measured, t):
    """Raise the alarm by the FDAE, evaluate its network, and isolate (contract.CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    known, found = fdi.verdict.detected, fdi.verdict
    filters.form_fdae_residual(fdi.fdae, measured.x)
    axis = fdae_alarm_axis(fdi.fdae)
    update_fdae_output(fdi.published, fdi.fdae, fdi.layout.main, measured.x, measured.y, belief.u)
    if axis >= 0:
        conclusion.latch_alarm(found, axis, t)
    if found.detected:
        adaptive_estimators.isolate_fault(fdi, measured, t, known)


SCHEME = CompiledScheme(begin, predict, conclude, contract.prepare_nothing, contract.accumulate_nothing)
