"""The published network of state and deflection (x, u), of the scheme and the law `zhang2005`.

    fhat_i = th_i^T Z_i,    Z_i[a, b, c] = g_a(v1) g_b(v2) g_c(v3),    th_i' = P{Gamma Z_i eps_i}

Each axis i has a network with three inputs: v1 is alpha (pitch) or beta, rad; v2 the rate of the axis, rad/s;
v3 the deflection of the surface that leads the axis, rad. g (centres,): a Gaussian at each centre of the
input, together of unit length.
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import ALPHA, BETA
from beaver_ftc.diagnosis.detection.fdae import fill_gaussians, train

# Centres of the network's basis functions on each axis of the aircraft: of alpha (pitch) or beta, rad; of the
# rate of the axis, rad/s; of the deflection of the surface that leads the axis, as a share of its travel.
ALPHA_CENTRES_RAD, BETA_CENTRES_RAD = np.linspace(-0.1, 0.5, 9), np.linspace(-0.4, 0.4, 9)
RATE_CENTRES_RAD_S, TRAVEL_SHARE_CENTRES = np.linspace(-0.3, 0.3, 3), np.linspace(0.0, 1.0, 3)
N_CENTRES = (len(ALPHA_CENTRES_RAD), len(RATE_CENTRES_RAD_S), len(TRAVEL_SHARE_CENTRES))
N_NODES = N_CENTRES[0] * N_CENTRES[1] * N_CENTRES[2]

# c0, dc: first centre and spacing, by axis and input. w_max: greatest size of a weight, rad/s2, to which the
# projection P limits it, or infinite. part: Gaussians of each input. output: fhat, rad/s2.
STATE_NETWORK_RECORD = record(
    config=record(gain=float, w_max=float, c0=(3, 3), dc=(3, 3)),
    memory=record(part=(3, max(N_CENTRES)), weights=(3, N_NODES), basis=(3, N_NODES)),
    output=3,
)


def configure_network(net: np.void, gain: float, w_max: float, travel: np.ndarray) -> None:
    """Fill the network's record. gain: Gamma, 1/s2; w_max rad/s2: largest size of a weight; travel (2, 3)
    rad: lower and upper stop of the surfaces that lead roll, pitch and yaw.
    """
    cfg = net["config"]
    cfg["gain"] = gain
    cfg["w_max"] = w_max
    for i in range(3):
        angles = ALPHA_CENTRES_RAD if i == PITCH else BETA_CENTRES_RAD
        deflections = travel[0, i] + TRAVEL_SHARE_CENTRES * (travel[1, i] - travel[0, i])
        inputs = angles, RATE_CENTRES_RAD_S, deflections
        first, second = np.transpose([centres[:2] for centres in inputs])
        cfg["c0"][i] = first
        cfg["dc"][i] = second - first


@kernel
def fill_input_basis(net, i, j, v):
    """part[j, k] = exp(-(z - k)^2 / 2) / |.|, z = (v - c0) / dc: Gaussians of input j of axis i at v.

    If v is outside the centres, they are those at the nearest edge. Elements from N_CENTRES[j] on are unused.
    """
    n = N_CENTRES[j]
    part = net.memory.part[j]
    norm = np.sqrt(fill_gaussians(v, net.config.c0[i, j], net.config.dc[i, j], n, 0, part))
    for k in range(n):
        part[k] /= norm


@kernel
def evaluate_state_network(net, main, x, y, u):
    """Fill basis, of unit length on each axis, and fhat = th^T basis, (3,) rad/s2, at (x, u).

    x (3,) rad/s: rates; y: readings, with alpha and beta in rad; u (n,) rad: deflections; main (3,): the
    surface that leads each axis.
    """
    for i in range(3):
        for j, v in enumerate((y[ALPHA] if i == PITCH else y[BETA], x[i], u[main[i]])):
            fill_input_basis(net, i, j, v)
        n = 0
        fhat = 0.0
        part = net.memory.part
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
        train(net.memory.weights[i], net.memory.basis[i], 1.0, step, net.config.w_max)
