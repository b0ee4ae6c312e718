"""The default law's loop in closed form, broken at one surface, a frequency at a time.

    u_s = -L_s v_s

v_s: deflection of surface s. u_s: deflection that the loop then commands, with all other loops closed. The
aircraft is linear, with inputs held over a frame. studies/margins.py has the numbers of a flight condition.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.studies.linear_systems import held_over_frame

N_FREQUENCIES = 600
LOWEST_RAD_S = 0.3  # at lower frequencies the autopilot controls: the rates hardly show a phugoid


@dataclass(frozen=True)
class OpenLoop:
    """The law and the aircraft at one flight condition: n surfaces, m measured signals, the rates first.

    - A (states, states), B (states, n), C (m, states): the aircraft and its measured signals.
    - f (3, m), G (3, n): the model of the law of the angular accelerations, f y + G u. G contains the
      effectiveness.
    - effectiveness (n,): of the surfaces of the aircraft.
    - approach (n,): share of the way to its command that an actuator moves in a frame.
    - delay_s, keep (m,): delay of each sensor, s, and pole of its lag; 0 without a lag.
    - Kp (3,) 1/s, L_rate (3,), L_disturbance (3,) 1/s: gains of the law and of its observer.
    - demand (n, 3): command of each surface for a demanded acceleration, rad per rad/s2.
    - lead (n,): (command - position) / (wanted position - position) of each surface.
    - share: share of a frame until a command acts. dt_s: length of a frame, s.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    f: np.ndarray
    G: np.ndarray
    effectiveness: np.ndarray
    approach: np.ndarray
    delay_s: np.ndarray
    keep: np.ndarray
    dt_s: float
    Kp: np.ndarray
    L_rate: np.ndarray
    L_disturbance: np.ndarray
    demand: np.ndarray
    lead: np.ndarray
    share: float


def law_response(loop: OpenLoop, z: np.ndarray) -> np.ndarray:
    """Positions p (n,) of the surfaces, rad, per measured signal of y (m,), (..., n, m), at each z (...):

        x = K (x / z + dt d / z + dt s (f y + G p)) + L_rate y_pqr
        d = d / z + L_disturbance (y_pqr - x / z - dt d / z - dt s (f y + G p))
        p = -a (D Kp x + D (1 + share dt Kp) (d + f y) + (D Kp G share dt + lead - 1) p)

    x (3,) rad/s: estimated rates. y_pqr: the measured rates. d (3,) rad/s2: estimated disturbance. a =
    approach / (z - 1 + approach): actuators. D = lead demand, K = 1 - L_rate, s = share / z + 1 - share:
    weight of f y + G p over the elapsed frame. M (x, d, p) = driven y is solved for x, d and p, and p is
    returned.
    """
    n, m, dt = len(loop.effectiveness), len(loop.C), loop.dt_s
    z = z[..., None, None]
    z_inv = 1.0 / z
    s = loop.share * z_inv + 1.0 - loop.share
    approach = loop.approach[:, None]
    a = approach / (z - 1.0 + approach)
    identity = np.eye(3)
    rates = np.eye(3, m)
    K, L_rate, L_disturbance = map(np.diag, (1.0 - loop.L_rate, loop.L_rate, loop.L_disturbance))
    Kp = np.diag(loop.Kp)
    lead = np.diag(loop.lead)
    D = lead @ loop.demand
    ahead = identity + loop.share * dt * Kp
    moved = D @ Kp @ loop.G * loop.share * dt + lead - np.eye(n)
    # columns: x, d, p; rows: their equations
    M = [
        [identity - K * z_inv, -K * dt * z_inv, -K @ loop.G * dt * s],  # x
        [L_disturbance * z_inv, identity - identity * z_inv + L_disturbance * dt * z_inv,
         L_disturbance @ loop.G * dt * s],  # d
        [a * (D @ Kp), a * (D @ ahead), np.eye(n) + a * moved],  # p
    ]  # fmt: skip
    driven = [
        [L_rate @ rates + K @ loop.f * dt * s],
        [L_disturbance @ (rates - loop.f * dt * s)],
        [-a * (D @ ahead @ loop.f)],
    ]
    return np.linalg.solve(_joined(M), _joined(driven))[..., 6:, :]


def _joined(rows: list[list[np.ndarray]]) -> np.ndarray:
    """The matrix of these blocks at each z, (..., rows, columns). A block without the dimensions of z is the
    same at every z."""
    shape = np.broadcast_shapes(*(block.shape[:-2] for row in rows for block in row))
    return np.block([[np.broadcast_to(block, (*shape, *block.shape[-2:])) for block in row] for row in rows])


def loops(loop: OpenLoop, omega: np.ndarray) -> np.ndarray:
    """L_s (omega, n) of each surface with the other loops closed. omega (omega,) rad/s.

    aircraft (omega, m, n) = C (z - Ad)^-1 Bd (share + (1 - share) z): from deflections to measured signals. A
    sensor is z^(-delay / dt) (1 - keep) / (1 - keep / z). around (omega, n, n): law, sensors and aircraft in
    series.
    """
    Ad, Bd = held_over_frame(loop.A, loop.B * loop.effectiveness, loop.dt_s)
    z = np.exp(1j * omega * loop.dt_s)
    z_signals = z[:, None]
    z_states = z_signals[..., None]
    sensors = z_signals ** (-loop.delay_s / loop.dt_s) * (1.0 - loop.keep) / (1.0 - loop.keep / z_signals)
    held = np.broadcast_to(Bd, (len(omega), *Bd.shape))
    to_states = np.linalg.solve(z_states * np.eye(len(Ad)) - Ad, held)
    aircraft = loop.C @ to_states * (loop.share + (1.0 - loop.share) * z_states)
    around = law_response(loop, z) @ (sensors[..., None] * aircraft)
    return np.stack([-_others_closed(around, s) for s in range(len(loop.effectiveness))], axis=1)


def _others_closed(N: np.ndarray, s: int) -> Any:
    """Response -L_s that returns to surface s, (...), with the loops of the other surfaces r closed. N =
    around, (..., n, n):

    N_ss + N_sr (I - N_rr)^-1 N_rs
    """
    others = np.delete(np.arange(N.shape[-1]), s)
    inner = np.eye(len(others)) - N[..., others[:, None], others]
    answered = np.linalg.solve(inner, N[..., others, s][..., None])
    return N[..., s, s] + (N[..., [s], others][..., None, :] @ answered)[..., 0, 0]


def frequencies(dt_s: float) -> np.ndarray:
    """N_FREQUENCIES from LOWEST_RAD_S to the Nyquist frequency pi / dt, rad/s, evenly spaced in their
    logarithm."""
    return np.geomspace(LOWEST_RAD_S, np.pi / dt_s, N_FREQUENCIES)
