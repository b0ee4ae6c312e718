"""The published law, to the letter (`control.law: zhang2005`) [Zhang2005, sec. V and VI].

    nominal    feedback linearisation with proportional-integral feedback (published.py), until Td
    from Td    G (1 + thetahat) u = xm' + Kp e + Ki int e - f - fhat(x, u, W),    e = xm - x
               thetahat_s' = Proj{-gamma sum_i sigma_i G_is u_s}    first part: effectiveness of each surface
               W_i' = Proj{-Gamma Phi(x, u) sigma_i}                second part: a network
               sigma = e + c int e

    Td, Tisol      s             times of detection and of isolation
    e, sigma       rad/s         tracking error; signal from which both parts learn
    thetahat_s     1             1 + thetahat is the estimated effectiveness of surface s
    W, Phi         weights and basis of the network fhat, which estimates the unknown acceleration phi, rad/s2
    gamma, Gamma   s2/rad2; of the network: gains of both parts
    c              1/s           weight of the integral

The paper leaves the design to its reference [11]; this is its pattern. With v = thetahat - theta and w = fhat
- phi, the error obeys e' = -Kp e - Ki int e + G v u + w - eta. The function V = z' P z + |v|^2 / gamma +
|W - W*|^2 / Gamma, with z = (int e, e) and the best weights W*, falls along both laws if sigma is the second
row of P z, where A' P + P A = -Q for the A of the error's equation. For Q = diag(1, q), this row is a
multiple of e + c int e with c = Kp / (q Ki + 1). There is no further feedback of the residual of the FDAE.
From Tisol on the flap takes over from an elevator that is isolated (accommodation.py, allocation.py); the
structure of the law stays.
"""

import numpy as np

from beaver_ftc.compiled import apart, fill, kernel, record, sized
from beaver_ftc.control import CompiledLaw
from beaver_ftc.control.accommodation import begin_frame
from beaver_ftc.control.laws import published
from beaver_ftc.control.laws.published import FEEDBACK
from beaver_ftc.diagnosis.detection.state_network import (
    STATE_NETWORK_RECORD,
    configure_network,
    evaluate_state_network,
    train_state_network,
)
from beaver_ftc.plugins import LAWS, settings
from beaver_ftc.scenario.declared import Declared

# adapts: whether any part adapts; networks: whether the second part does too. gain: gamma, s2/rad2.
# integral_weight: c, 1/s. least, most: limits of an effectiveness, the projection; infinite without it.
CONFIG = record(adapts=int, networks=int, gain=float, integral_weight=float, least=float, most=float)
MEMORY = record(signal=3)  # -sigma, rad/s, from which both parts learn


@sized
def zhang2005_dtype(n: int) -> np.dtype:
    """The law's records: its own, and those of the feedback and of the network, the second part."""
    return record(config=CONFIG, memory=MEMORY, feedback=FEEDBACK, network=STATE_NETWORK_RECORD)


def configure(law: np.void, control: np.void, prediction: np.void, declared: Declared, y: np.ndarray) -> None:
    """Fill the law's configuration (control.CompiledLaw)."""
    settled = declared.control
    option = settings(LAWS, settled.law, settled.options)
    published.configure(law["feedback"], control, prediction, declared, y)
    if not option["hand_over"]:
        control["config"]["reallocates"] = 0
    Kp = settled.proportional_per_s
    Ki = settled.integral_per_s2
    projects = option["projection"]
    fill(
        law["config"], adapts=option["adaptation"], networks=option["network"],
        gain=option["parametric_gain"], integral_weight=Kp / (option["rate_weight"] * Ki + 1.0),
        least=settled.least_effectiveness if projects else -np.inf, most=1.0 if projects else np.inf,
    )  # fmt: skip
    limit = option["network_limit_rad_s2"] if projects else np.inf
    layout = control["layout"]
    travel = np.array([layout["low"], layout["high"]])[:, layout["main"]]
    configure_network(law["network"], option["network_gain"], limit, travel)


@apart
def accommodate(control, assessment, faults, prediction, measured):
    """Bring both parts, effectiveness and network, to this frame (control.CompiledLaw); they adapt while the
    alarm stands, if the option `adaptation` is set."""
    law = control.zhang2005
    surfaces = control.surfaces
    main = control.layout.main
    x = measured.x
    begin_frame(surfaces.output, False)
    if assessment.detected and law.config.adapts:
        saturated = control.allocation.output.saturated
        reference = control.reference
        wanted = reference.output.governed_rate
        adapt(law, surfaces, main, saturated, wanted, x, prediction.G, prediction.u, reference.config.dt)
    evaluate_state_network(law.network, main, x, measured.y, prediction.u)


@kernel
def adapt(law, surfaces, main, saturated, wanted, x, G, u, dt):
    """Advance both parts by a step of dt s, with signal = -sigma (3,), rad/s:

        sigma = e + c int e    e = wanted - x
        effectiveness_s <- Proj(effectiveness_s + dt gamma sum_i signal_i G_is u_s)

    s: the surfaces main (3,) that lead the axes; the network only if config.networks. wanted, x (3,) rad/s; G
    (3, n) rad/s2 per rad; u (n,) rad; gamma: config.gain, c: config.integral_weight. While the surface that
    leads an axis is at its stop, what the axis misses teaches nothing.
    """
    config = law.config
    signal = law.memory.signal
    for i in range(3):
        signal[i] = -(wanted[i] - x[i] + config.integral_weight * law.feedback.memory.integral[i])
        if saturated[main[i]]:
            signal[i] = 0.0
    for s in main:
        slope = 0.0
        for i in range(3):
            slope += signal[i] * G[i, s] * u[s]
        updated = surfaces.output.effectiveness[s] + dt * config.gain * slope
        estimate = min(max(updated, config.least), config.most)
        surfaces.output.target[s] = surfaces.output.effectiveness[s] = estimate
    if config.networks:
        train_state_network(law.network, signal, dt)


@apart
def command(control, assessment, faults, prediction, measured, mode, t):
    """From what is measured to the command of each surface (control.CompiledLaw)."""
    law = control.zhang2005
    published.command_by(
        law.feedback, law.network.output, control, assessment, faults, prediction, measured, mode, t
    )


def unexplained(control: np.void) -> np.ndarray:
    """What the law attributes to no model, (3,) rad/s2 (control.CompiledLaw)."""
    law = control["zhang2005"]
    return published.unexplained_by(law["feedback"], law["network"]["output"])


def begin(control: np.void, before: np.void, unexplained: np.ndarray, learnt: np.ndarray) -> None:
    """Take over in flight: the integrators begin where the demand is (control.CompiledLaw)."""
    published.begin_integrators(control["zhang2005"]["feedback"], unexplained, np.zeros(3))


LAW = CompiledLaw(zhang2005_dtype, command, accommodate, configure, unexplained=unexplained, begin=begin)
