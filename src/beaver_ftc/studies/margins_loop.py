"""The default law's loop in closed form, broken at one surface, a frequency at a time.

    u_s = L_s v_s,   v_s the deflection of surface s, u_s where the loop then wants it, all others closed

The aircraft is linear and held over a frame. studies/margins.py has the numbers of a flight condition.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.studies.linear_systems import held_over_frame

N_FREQUENCIES = 600
LOWEST_RAD_S = 0.3  # below, the autopilot flies: a body rate says little of a phugoid


@dataclass(frozen=True)
class OpenLoop:
    """The law, and what it is closed around, at one condition; n surfaces, m measured signals, rates first.

    A, B: aircraft; C (m, states). f (3, m): the law's model of the rates' accelerations; G (3, n) with the
    effectiveness (n,) in it. approach (n,): part of its way to the command that an actuator goes in a
    frame. delay_s, keep (m,): of each sensor, its delay and the pole of its lag, 0 without one. Kp 1/s,
    L_rate 1, L_disturbance 1/s (3,); demand (n, 3): command of each surface for a demanded acceleration, rad
    per rad/s2; lead (n,): command beyond the surface's position over what is wanted beyond it; share: part of
    a frame until a command acts.
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

    x (3,) rad/s: estimated rates; d (3,) rad/s2: estimated disturbance; a = approach / (z - 1 + approach): of
    the actuators; D = lead demand, K = 1 - L_rate, s = share / z + 1 - share.
    """
    n, m, dt = len(loop.effectiveness), len(loop.C), loop.dt_s
    z = z[..., None, None]
    back = 1.0 / z
    s = loop.share * back + 1.0 - loop.share  # of what acts over the elapsed frame
    approach = loop.approach[:, None]
    a = approach / (z - 1.0 + approach)
    one = np.eye(3)
    rates = np.eye(3, m)
    K, L_rate, L_disturbance = map(np.diag, (1.0 - loop.L_rate, loop.L_rate, loop.L_disturbance))
    Kp = np.diag(loop.Kp)
    lead = np.diag(loop.lead)
    D = lead @ loop.demand
    ahead = one + loop.share * dt * Kp
    moved = D @ Kp @ loop.G * loop.share * dt + lead - np.eye(n)
    # columns x, d, p of what is unknown = what is measured; rows:
    M = [
        [one - K * back, -K * dt * back, -K @ loop.G * dt * s],  # x
        [L_disturbance * back, one - one * back + L_disturbance * dt * back,
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
    """The matrix of these blocks at each z; a block without z is the same at all."""
    shape = np.broadcast_shapes(*(of.shape[:-2] for row in rows for of in row))
    return np.block([[np.broadcast_to(of, (*shape, *of.shape[-2:])) for of in row] for row in rows])


def loops(loop: OpenLoop, omega: np.ndarray) -> np.ndarray:
    """L_s (omega, n) of every surface, the others' loops closed."""
    Ad, Bd = held_over_frame(loop.A, loop.B * loop.effectiveness, loop.dt_s)
    z = np.exp(1j * omega * loop.dt_s)
    z_signals = z[:, None]
    z_states = z_signals[..., None]
    sensors = z_signals ** (-loop.delay_s / loop.dt_s) * (1.0 - loop.keep) / (1.0 - loop.keep / z_signals)
    held = np.broadcast_to(Bd, (len(omega), *Bd.shape))
    whole = np.linalg.solve(z_states * np.eye(len(Ad)) - Ad, held)
    aircraft = loop.C @ whole * (loop.share + (1.0 - loop.share) * z_states)
    around = law_response(loop, z) @ (sensors[..., None] * aircraft)
    return np.stack([-_others_closed(around, s) for s in range(len(loop.effectiveness))], axis=1)


def _others_closed(around: np.ndarray, s: int) -> Any:
    """Response that returns to surface s, (...), from the response around all surfaces, (..., n, n)."""
    rest = np.delete(np.arange(around.shape[-1]), s)
    inner = np.eye(len(rest)) - around[..., rest[:, None], rest]
    answered = np.linalg.solve(inner, around[..., rest, s][..., None])
    return around[..., s, s] + (around[..., [s], rest][..., None, :] @ answered)[..., 0, 0]


def frequencies(dt_s: float) -> np.ndarray:
    """From LOWEST_RAD_S to Nyquist, rad/s."""
    return np.geomspace(LOWEST_RAD_S, np.pi / dt_s, N_FREQUENCIES)
