"""The loop of aircraft, actuators, sensors and default law, broken at one surface, a frequency at a time.

    u_s = L_s v_s,   v_s the deflection of surface s, u_s where the loop then wants it, all others closed

The aircraft is the truth linearised by differences (plant/linear.py), held over a frame; the law is that of
control/laws/rejecting.py with the design model's own derivatives. A loss of effectiveness that is known
scales the surface and what the law takes it for alike; of a surface that is given up nothing is asked.
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.control.laws.state import STAND_IN
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW

N_FREQUENCIES = 600
LOWEST_RAD_S = 0.3  # below, the autopilot flies: a body rate says little of a phugoid
RATES = ("p", "q", "r")


@dataclass(frozen=True)
class LawGains:
    """Of one flight condition. Kp 1/s, pull 1, learn 1/s (3,); demand (n, 3): command of each surface for a
    demanded acceleration, rad per rad/s2; lead (n,); share: of a frame until a command acts."""

    Kp: np.ndarray
    pull: np.ndarray
    learn: np.ndarray
    demand: np.ndarray
    lead: np.ndarray
    share: float


@dataclass(frozen=True)
class Parts:
    """The loop's parts at one condition; n surfaces, m measured signals, the rates first.

    A, B: aircraft; C (m, states). f (3, m): the law's model of the rates' accelerations; G (3, n) with the
    effectiveness in it. left (n,): effectiveness. approach (n,): of the actuators in a frame. delay_s, keep
    (m,): of the sensors.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    f: np.ndarray
    G: np.ndarray
    left: np.ndarray
    approach: np.ndarray
    delay_s: np.ndarray
    keep: np.ndarray
    dt_s: float


def interpolated(rejection: np.void, qdyn: float, lost: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Kp, pull and learn (3,) of the schedule at a dynamic pressure (Pa), a share `lost` of pitch handed
    over."""
    found = []
    for name in ("Kp_at", "pull_at", "learn_at"):
        rows = np.array([np.interp(qdyn, rejection["qdyn"], row) for row in rejection[name]])
        rows[PITCH] += lost * (rows[STAND_IN] - rows[PITCH])
        found.append(rows[:3])
    return found[0], found[1], found[2]


def allocation(G: np.ndarray, main: np.ndarray, stand_in: int, lost: float) -> np.ndarray:
    """Commands per demanded acceleration, (n, 3), as control/allocation.py gives them within the travels."""
    a, e, r = main[ROLL], main[PITCH], main[YAW]
    commands = np.zeros((G.shape[1], 3))
    determinant = G[ROLL, a] * G[YAW, r] - G[ROLL, r] * G[YAW, a]
    if determinant != 0.0:
        commands[a, [ROLL, YAW]] = G[YAW, r] / determinant, -G[ROLL, r] / determinant
        commands[r, [ROLL, YAW]] = -G[YAW, a] / determinant, G[ROLL, a] / determinant
    else:
        for axis, s in ((ROLL, a), (YAW, r)):
            commands[s, axis] = 1.0 / G[axis, s] if G[axis, s] else 0.0
    flap = lost if stand_in >= 0 else 0.0
    if flap:
        commands[stand_in, PITCH] = flap / G[PITCH, stand_in]
    if G[PITCH, e]:
        commands[e, PITCH] = (1.0 - flap) / G[PITCH, e]
    return commands


def held_over_frame(A: np.ndarray, B: np.ndarray, dt_s: float) -> tuple[np.ndarray, np.ndarray]:
    """The discrete aircraft for inputs held over a frame."""
    from scipy.linalg import expm

    n, m = B.shape
    whole = expm(np.block([[A, B], [np.zeros((m, n + m))]]) * dt_s)
    return whole[:n, :n], whole[:n, n:]


def law_response(parts: Parts, law: LawGains, z: complex) -> np.ndarray:
    """Where the surfaces go for what is measured, (n, m), at z."""
    n, dt, one = len(parts.left), parts.dt_s, np.eye(3)
    back = 1.0 / z
    mean = law.share * back + 1.0 - law.share  # of what acts over the elapsed frame
    keep, learn, Kp = np.diag(1.0 - law.pull), np.diag(law.learn), np.diag(law.Kp)
    actuator = np.diag(parts.approach / (z - 1.0 + parts.approach))
    ahead = one + law.share * dt * Kp
    lead, none = np.diag(law.lead), np.zeros
    of_position = lead @ law.demand @ Kp @ parts.G * law.share * dt + lead - np.eye(n)
    # unknowns: rate, disturbance, position, command; driven by what is measured
    M = np.block(
        [
            [one - keep * back, -keep * dt * back, -keep @ parts.G * dt * mean, none((3, n))],
            [learn * back, one - one * back + learn * dt * back, learn @ parts.G * dt * mean, none((3, n))],
            [none((n, 3)), none((n, 3)), np.eye(n), -actuator],
            [lead @ law.demand @ Kp, lead @ law.demand @ ahead, of_position, np.eye(n)],
        ]
    )
    rates = np.eye(3, parts.C.shape[0])
    driven = np.vstack(
        [
            np.diag(law.pull) @ rates + keep @ parts.f * dt * mean,
            learn @ (rates - parts.f * dt * mean),
            none((n, len(parts.C))),
            -lead @ law.demand @ ahead @ parts.f,
        ]
    )
    return np.linalg.solve(M, driven)[6 : 6 + n]


def loops(parts: Parts, law: LawGains, omega: np.ndarray) -> np.ndarray:
    """L_s (omega, n) of every surface, the others' loops closed."""
    Ad, Bd = held_over_frame(parts.A, parts.B * parts.left, parts.dt_s)
    found = np.empty((len(omega), len(parts.left)), complex)
    for k, z in enumerate(np.exp(1j * omega * parts.dt_s)):
        sensors = z ** (-parts.delay_s / parts.dt_s) * (1.0 - parts.keep) / (1.0 - parts.keep / z)
        aircraft = (
            parts.C @ np.linalg.solve(z * np.eye(len(Ad)) - Ad, Bd) * (law.share + (1.0 - law.share) * z)
        )
        around = law_response(parts, law, z) @ (sensors[:, None] * aircraft)
        for s in range(len(parts.left)):
            found[k, s] = -_others_closed(around, s)
    return found


def _others_closed(around: np.ndarray, s: int) -> complex:
    rest = np.delete(np.arange(len(around)), s)
    inner = np.eye(len(rest)) - around[np.ix_(rest, rest)]
    return around[s, s] + around[s, rest] @ np.linalg.solve(inner, around[rest, s])


def frequencies(dt_s: float) -> np.ndarray:
    """From LOWEST_RAD_S to Nyquist, rad/s."""
    return np.geomspace(LOWEST_RAD_S, np.pi / dt_s, N_FREQUENCIES)
