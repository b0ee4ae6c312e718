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

from beaver_ftc.compiled import apart, kernel, record, row_of
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion
from beaver_ftc.diagnosis.detection import filters
from beaver_ftc.diagnosis.detection.filters import fill_gaussians, train
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import adaptive_estimators
from beaver_ftc.diagnosis.state import CONSTANT_THRESHOLD, PITCH
from beaver_ftc.plugins import DETECTORS, settings
from beaver_ftc.scenario.declared import Declared

# Centres of the network's basis functions on each axis of the aircraft: alpha (pitch) or beta, rad; the rate
# of the axis, rad/s; the deflection of the surface that leads it, as a share of its travel.
ALPHA_CENTRES_RAD, BETA_CENTRES_RAD = np.linspace(-0.1, 0.5, 9), np.linspace(-0.4, 0.4, 9)
RATE_CENTRES_RAD_S, TRAVEL_SHARE_CENTRES = np.linspace(-0.3, 0.3, 3), np.linspace(0.0, 1.0, 3)
N_CENTRES = (len(ALPHA_CENTRES_RAD), len(RATE_CENTRES_RAD_S), len(TRAVEL_SHARE_CENTRES))
N_NODES = N_CENTRES[0] * N_CENTRES[1] * N_CENTRES[2]

# c0, dc: first centre and spacing, by axis and input. w_max: of a weight, projection P; infinite without one.
# part: Gaussians of each input. output: fhat, rad/s2.
STATE_NETWORK_RECORD = record(
    config=record(gain=float, w_max=float, c0=(3, 3), dc=(3, 3)),
    memory=record(part=(3, N_CENTRES[0]), weights=(3, N_NODES), basis=(3, N_NODES)),
    output=3,
)

# waits: whether the network waits for a residual outside the threshold; mu0: rad/s, in the place of all
# adaptive thresholds, or 0.
PUBLISHED_CONFIG_RECORD = record(waits=int, mu0=float)
PUBLISHED_RECORD = record(config=PUBLISHED_CONFIG_RECORD, network=STATE_NETWORK_RECORD)


def configure_network(net: np.void, gain: float, W_max: float, travel: np.ndarray) -> None:
    """Fill the network's record; travel (2, 3) rad: of the surfaces that lead roll, pitch and yaw."""
    cfg = net["config"]
    cfg["gain"], cfg["w_max"] = gain, W_max
    for i in range(3):
        angles = ALPHA_CENTRES_RAD if i == PITCH else BETA_CENTRES_RAD
        deflections = travel[0, i] + TRAVEL_SHARE_CENTRES * (travel[1, i] - travel[0, i])
        first, second = np.transpose([each[:2] for each in (angles, RATE_CENTRES_RAD_S, deflections)])
        cfg["c0"][i], cfg["dc"][i] = first, second - first


def reconfigure_published(fdi: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Turn the stages of a diagnosis, filled in already, into the published scheme; travel (2, n) rad: the
    stops.
    """
    config, dt, iso = declared.fdi, 1.0 / declared.rate_hz, fdi["isolation"]
    options, pub = settings(DETECTORS, config.scheme, config.options), fdi["published"]
    cfg = iso["config"]
    pub["config"]["waits"] = options["dead_zone"]
    W_max = options["network_limit_rad_s2"] if options["projection"] else np.inf
    configure_network(pub["network"], options["network_gain"], W_max, travel[:, fdi["layout"]["main"]])
    fdi["fdae"]["config"]["a"] = fdi["bank"]["config"]["a"][0] = euler_decay(config.detection_pole_per_s, dt)
    cfg["a"] = euler_decay(config.isolation_pole_per_s, dt)
    cfg["gradient"], cfg["gain"] = 1, options["adaptation_gain"]
    iso["estimator"]["theta"] = options["initial_theta"]
    cfg["free"] = not options["projection"]
    if not options["adaptive_threshold"]:
        pub["config"]["mu0"], cfg["mu_kind"] = options["constant_threshold_rad_s"], CONSTANT_THRESHOLD
    if options["leave_out"]:
        iso["estimator"]["excluded"][int(options["leave_out"]) - 1] = 1


def euler_decay(lam: float, dt_s: float) -> float:
    """Return the decay of a filter's state in an Euler step; 0 for a pole beyond the frame rate."""
    return max(1.0 - lam * dt_s, 0.0)


@kernel
def fill_input_basis(net, i, j, n, v):
    """part[j, k] = exp(-(z - k)^2 / 2) / |.|, z = (v - c0) / dc: Gaussians of input j of axis i at v."""
    part = row_of(net.memory.part, j)
    norm = np.sqrt(fill_gaussians(v, net.config.c0[i, j], net.config.dc[i, j], n, 0, part))
    for k in range(n):
        part[k] /= norm


@kernel
def evaluate_state_network(net, main, x, y, u):
    """Fill basis, of unit length on each axis, and fhat = th^T basis, (3,) rad/s2, at (x, u).

    main (3,): the surface that leads each axis.
    """
    for i in range(3):
        for j, v in enumerate((y[ALPHA] if i == PITCH else y[BETA], x[i], u[main[i]])):
            fill_input_basis(net, i, j, N_CENTRES[j], v)
        n, fhat, part = 0, 0.0, net.memory.part
        for a in range(N_CENTRES[0]):
            for b in range(N_CENTRES[1]):
                for c in range(N_CENTRES[2]):
                    net.memory.basis[i, n] = part[0, a] * part[1, b] * part[2, c]
                    fhat += net.memory.weights[i, n] * net.memory.basis[i, n]
                    n += 1
        net.output[i] = fhat


@kernel
def train_state_network(net, eps, dt):
    """th <- clip(th + dt Gamma Z eps, w_max), Z: the basis as it was evaluated; eps (3,) rad/s."""
    for i in range(3):
        step = dt * net.config.gain * eps[i]
        train(row_of(net.memory.weights, i), row_of(net.memory.basis, i), 1.0, step, net.config.w_max)


@kernel
def train_if_due(pub, fdae, detected, dt):
    """The FDAE's network learns once a fault is detected, from residuals outside the threshold.

    Without the dead zone it learns from the first frame on, with any residual.
    """
    if not pub.config.waits or (detected and fdae_axis(fdae) >= 0):
        train_state_network(pub.network, fdae.output.residual, dt)


@kernel
def fdae_axis(fdae):
    """The first axis on which the residual of the FDAE exceeds its threshold, or -1."""
    for i in range(3):
        if abs(fdae.output.residual[i]) > fdae.output.threshold[i]:
            return i
    return -1


@apart
def advance_estimators_to_frame(fdi, prediction, measured):
    """Bring isolation, FDAE and its network to this frame."""
    pub, dt, mu = fdi.published, fdi.config.dt, fdi.published.config.mu0
    adaptive_estimators.update_filters(fdi, prediction, measured)
    adaptive_estimators.update_estimators(fdi, prediction)
    train_if_due(pub, fdi.fdae, fdi.verdict.detected, dt)
    filters.advance_fdae(
        fdi.fdae, fdi.bank, fdi.bound, prediction.x_before, prediction.means.F, False, False, dt
    )
    if mu > 0.0:
        fdi.fdae.output.threshold[:], fdi.bank.output.threshold[0] = mu, mu
        for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
            fie.B[:] = mu


@apart
def update_verdict(fdi, prediction, measured, t):
    """Raise the alarm by the FDAE, evaluate its network, and isolate."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    before, found, net = fdi.verdict.detected, fdi.verdict, fdi.published.network
    filters.fdae_residual(fdi.fdae, measured.x)
    axis = fdae_axis(fdi.fdae)
    evaluate_state_network(net, fdi.layout.main, measured.x, measured.y, prediction.u)
    fdi.fdae.network.output[:] = net.output
    if axis >= 0:
        conclusion.latch_alarm(found, axis, t)
    if found.detected:
        adaptive_estimators.continue_isolation(fdi, measured, t, before)
