"""The published law, to the letter (`control.law: zhang2005`) [Zhang2005, sec. V and VI].

    nominal    feedback linearisation with proportional-integral feedback (published.py), until Td
    from Td    G (1 + thetahat) u = xm' + Kp e + Ki int e - f - fhat(x, u, W),    e = xm - x
               thetahat_s' = P{-gamma sum_i s_i G_is u_s}        first part: effectiveness of each surface
               W_i' = P{-Gamma Phi(x, u) s_i}                    second part: a network
               s = e + c int e

The paper leaves the design to its reference [11]; this is its pattern. With v = thetahat - theta and w = fhat
- phi the error obeys e' = -Kp e - Ki int e + G v u + w - eta, and V = z' P z + |v|^2 / gamma + |W - W*|^2 /
Gamma, z = (int e, e), falls along these two laws if s is the second row of P z, where A' P + P A = -Q for the
error's A. For Q = diag(1, q), that row is, but for a factor, e + c int e with c = Kp / (q Ki + 1). There is
no feedback of the FDAE's residual beside the two. From Tisol on the flap takes over from an elevator that is
isolated (supervisor.py, allocation.py); the structure of the law stays.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.control.laws import ADAPTIVE
from beaver_ftc.diagnosis.zhang2005 import NETWORK, configure_network, learn
from beaver_ftc.plugins import LAWS, settings
from beaver_ftc.scenario.control import ControlConfig

# adapts: whether anything does; networks: and a network. gain: of effectiveness, s3/rad2. integral_weight: c.
# signal: what both parts learn from, -s, rad/s. least, most: of an effectiveness, projection P, or infinite.
ADAPTATION = record(
    adapts=int, networks=int, gain=float, integral_weight=float, signal=3, least=float, most=float,
    network=NETWORK,
)  # fmt: skip


def configure(control: np.void, config: ControlConfig, travel: np.ndarray) -> None:
    """Fill `adaptation` of a law's record, filled in otherwise; travel (2, n) rad: the stops."""
    option, adaptation = settings(LAWS, config.law, config.options), control["adaptation"]
    if not option["hand_over"]:
        control["law"] = ADAPTIVE
    adaptation["adapts"], adaptation["networks"] = option["adaptation"], option["network"]
    adaptation["gain"] = option["parametric_gain"]
    Kp, Ki = config.proportional_per_s, config.integral_per_s2
    adaptation["integral_weight"] = Kp / (option["rate_weight"] * Ki + 1.0)
    limit = option["network_limit_rad_s2"] if option["projection"] else np.inf
    main = control["layout"]["main"]
    configure_network(adaptation["network"], option["network_gain"], limit, travel[:, main])
    adaptation["least"], adaptation["most"] = -np.inf, np.inf
    if option["projection"]:
        adaptation["least"], adaptation["most"] = config.least_effectiveness, 1.0


@kernel
def adapt(adaptation, feedback, surfaces, layout, saturated, error, G, u, dt):
    """Both parts, by a step of dt s. error (3,) rad/s: e; G (3, n) rad/s2 per rad; u (n,) rad.

    While the surface that leads an axis is at its stop, what the axis misses teaches nothing.
    """
    main, signal = layout.main, adaptation.signal
    for i in range(3):
        signal[i] = -(error[i] + adaptation.integral_weight * feedback.integral[i])
        if saturated[main[i]]:
            signal[i] = 0.0
    for s in main:
        slope = 0.0
        for i in range(3):
            slope += signal[i] * G[i, s] * u[s]
        moved = surfaces.effectiveness[s] + dt * adaptation.gain * slope
        surfaces.effectiveness[s] = min(max(moved, adaptation.least), adaptation.most)
        surfaces.target[s] = surfaces.effectiveness[s]
    if adaptation.networks:
        learn(adaptation.network, signal, dt)
