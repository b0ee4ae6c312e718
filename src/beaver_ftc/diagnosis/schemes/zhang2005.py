"""The published scheme, to the letter (`fdi.scheme: zhang2005`) [Zhang2005, sec. IV, eq. (3) and (4)].

    FDAE         xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat(x, u, th0),     eps0 = x - xhat0
                 th0' = P{Gamma Z^T D[eps0]},   Z = d fhat / d th0,   th0 = 0 until Td (option dead_zone)
    detection    Td = inf {t: |eps0_i(t)| > ebar_i(t), some i},   ebar_i = int e^{-lam (t-tau)} eta_bar_i dtau
    FIE s        xhats' = -Lambdas (xhats - x) + f + G u + fhats(x, u, ths) + Oms ths',   from Td on
                 Oms' = -Lambdas Oms + Zs,   Oms(Td) = 0,   ths' = P{Gammas Oms^T epss}
    thresholds   mu_i^s = k_i^s |Om_i^s| + int_Td^t e^{-lam (t-tau)} eta_bar_i dtau + e^{-lam (t-Td)} w_i
    isolation    s is excluded once |eps_i^s| > mu_i^s, some i; the one left is the fault; none: not isolable

    x, xhat0, xhats    rad/s     measured rates; states of the FDAE and of FIE s
    f + G u            rad/s2    acceleration of the design model
    fhat, fhats        rad/s2    network of the FDAE; effect of the fault of FIE s
    th0, ths           weights of the network; loss parameter
    eps0, epss         rad/s     residuals; ebar, mu: their thresholds
    lam                1/s       pole of the filter, an element of Lambda
    k_i^s              1         largest distance between theta and its estimate

The FDAE is that of detection/fdae.py, with the threshold of filter 0 of detection/filters.py; the FIEs are
those of estimators.py. This file has the differences: Euler steps, a network of (x, u)
(detection/state_network.py), gradients instead of least squares, and alarms by the FDAE alone. D[eps] is 0
while the residuals of all axes are within their thresholds, and the whole of eps otherwise [Zhang2002];
without the option `dead_zone` it is always eps, also before Td. w is 0, since xhats(Td) = x(Td); with noisy
gyros w is the bound on their noise. Where the paper leaves a choice open, it is an option (plugins.yaml lists
the options, and how each was chosen). Some options remove a part of the scheme, to measure its effect.
"""

import numpy as np

from beaver_ftc.compiled import apart, fill, kernel, record
from beaver_ftc.diagnosis.detection.fdae import advance_fdae, fdae_residual
from beaver_ftc.diagnosis.detection.state_network import (
    STATE_NETWORK_RECORD,
    configure_network,
    evaluate_state_network,
    train_state_network,
)
from beaver_ftc.diagnosis.estimators import CONSTANT_THRESHOLD
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import adaptive_estimators
from beaver_ftc.plugins import DETECTORS, settings
from beaver_ftc.scenario.declared import Declared

# waits: whether the network waits for a residual outside the threshold; mu0: rad/s, in the place of all
# adaptive thresholds, or 0.
PUBLISHED_RECORD = record(config=record(waits=int, mu0=float), network=STATE_NETWORK_RECORD)


def reconfigure(fdi: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Turn the stages of a diagnosis, which are filled in already, into this scheme, with its options; travel
    (2, n) rad: the stops."""
    config = declared.fdi
    dt = 1.0 / declared.rate_hz
    options = settings(DETECTORS, config.scheme, config.options)
    scheme = fdi["published"]
    isolation = fdi["isolation"]
    limit = options["network_limit_rad_s2"] if options["projection"] else np.inf
    configure_network(scheme["network"], options["network_gain"], limit, travel[:, fdi["layout"]["main"]])
    scheme["config"]["waits"] = options["dead_zone"]
    fdi["fdae"]["config"]["a"] = fdi["bank"]["config"]["a"][0] = euler_decay(config.detection_pole_per_s, dt)
    fill(
        isolation["config"], a=euler_decay(config.isolation_pole_per_s, dt), gradient=1,
        gain=options["adaptation_gain"], free=not options["projection"],
    )  # fmt: skip
    isolation["estimator"]["theta"] = options["initial_theta"]
    if not options["adaptive_threshold"]:
        scheme["config"]["mu0"] = options["constant_threshold_rad_s"]
        isolation["config"]["mu_kind"] = CONSTANT_THRESHOLD
    if options["leave_out"]:  # the number of an estimator, the first is 1
        isolation["estimator"]["excluded"][int(options["leave_out"]) - 1] = 1


def euler_decay(lam: float, dt_s: float) -> float:
    """Return the decay of a filter's state in an Euler step; 0 for a pole beyond the frame rate."""
    return max(1.0 - lam * dt_s, 0.0)


@kernel
def train_if_due(pub, fdae, detected, dt):
    """Train the network of the FDAE, with the dead zone D only after detection and in frames in which the
    residual of some axis is outside its threshold. Without the dead zone (`waits` is 0), train it in every
    frame. One axis is enough for all three axes to learn.
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
    """Bring isolation, FDAE and its network to this frame. A constant threshold mu0 > 0 then replaces all
    adaptive ones.

    The network learns from residual, threshold and basis of the frame before, and xhat0 moves with the output
    that `update_verdict` computed there. The network of fdae.py itself never learns (detected: False).
    """
    pub = fdi.published
    dt = fdi.config.dt
    mu = pub.config.mu0
    adaptive_estimators.update_filters(fdi, prediction, measured)
    adaptive_estimators.update_estimators(fdi, prediction)
    train_if_due(pub, fdi.fdae, fdi.verdict.detected, dt)
    x = prediction.x_before
    F = prediction.means.F
    advance_fdae(fdi.fdae, fdi.bank, fdi.bound, x, F, False, False, dt)
    if mu > 0.0:
        fdi.fdae.output.threshold[:] = fdi.bank.output.threshold[0] = mu
        for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
            fie.B[:] = mu


@apart
def update_verdict(fdi, prediction, measured, t):
    """Unless a sensor is found broken, raise the alarm by the FDAE, evaluate its network for the next frame,
    and isolate."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    net = fdi.published.network
    fdae_residual(fdi.fdae, measured.x)
    evaluate_state_network(net, fdi.layout.main, measured.x, measured.y, prediction.u)
    fdi.fdae.network.output = net.output
    adaptive_estimators.follow_alarm(fdi, measured, fdae_axis(fdi.fdae), t)
