"""Engine power as a pitch effector about the trim, linear: its moment, and the margins of its law."""

import numpy as np

from beaver_ftc.control.laws.loop_design import margins as margins_of
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.linear import LinearModel, differences, engine_slope
from beaver_ftc.plant.trim import trim
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.airframe import Initial
from beaver_ftc.scenario.diagnosis import EnginePower
from beaver_ftc.studies.linear_systems import LONGITUDINAL, zeros
from beaver_ftc.studies.present.tables import finite

POWER = EnginePower()
FREQUENCIES_RAD_S = np.geomspace(1e-3, 1e2, 20001)
SLOW_RAD_S = 1.0  # the phugoid is slower, the short period faster


def margins(airspeed_mps: float) -> Document:
    """The margins of the loop through engine power at one airspeed, with elevator and flap at rest.

    - phugoid_damping: without and with the law.
    - gain_margin_db, phase_margin_deg: the smallest over all crossings, null if there is none.
    - attitude_zero_rad_s: the right-half-plane zero from power to pitch attitude.
    - worth_deg: pitching moment of the lowest and the highest power less that in trim, in deg of elevator.
    """
    model, power, trim_inhg = about_trim(airspeed_mps)
    A = model.A
    F, b, k = with_law(A, power)
    q = LONGITUDINAL.index("q")
    upper_db, lower_db, phase_deg = margins_of(loop_response(F, b, k))
    from_trim_inhg = np.array([POWER.lowest_inhg, POWER.highest_inhg]) - trim_inhg
    return {
        "airspeed_mps": airspeed_mps,
        "phugoid_damping": [_phugoid_damping(system) for system in (A, F + np.outer(b, k))],
        "gain_margin_db": finite(float(min(upper_db, lower_db))),
        "phase_margin_deg": finite(float(phase_deg)),
        "attitude_zero_rad_s": float(zeros(A, power, LONGITUDINAL.index("theta")).real.max()),
        "worth_deg": np.rad2deg(
            from_trim_inhg * power[q] / model.B[q, model.inputs.index("elevator")]
        ).tolist(),
    }


def about_trim(airspeed_mps: float) -> tuple[LinearModel, np.ndarray, float]:
    """The linear aircraft over LONGITUDINAL, the effect (4,) of manifold pressure on them, per inHg, and the
    pressure in trim, inHg."""
    plant = Plant(100)
    point = trim(airspeed_mps, Initial().altitude_m)
    model = differences(plant, point)
    rows = [model.states.index(name) for name in LONGITUDINAL]
    return model.of(LONGITUDINAL), engine_slope(plant, point)[rows], point.manifold_pressure_inhg


def with_law(A: np.ndarray, power: np.ndarray) -> tuple[np.ndarray, ...]:
    """The aircraft x' = A x + power u and the law that commands u, inHg, with the time constants s, w, m and
    the gains a, c of POWER:

        v' = (V - v) / s,    v0' = (v - v0) / w,    e' = q - e / m,    u = a (v0 - v) + c e

    v: smoothed airspeed; v0: its slow mean; e: missed attitude. Of the states (x, v, v0, e): system matrix
    F (7, 7), column b (7,) of u, and row k (7,) of the law, u = k (x, v, v0, e).
    """
    V, q = LONGITUDINAL.index("airspeed"), LONGITUDINAL.index("q")
    n = len(LONGITUDINAL)
    v, v0, e = range(n, n + 3)
    F = np.zeros((n + 3, n + 3))
    F[:n, :n] = A
    F[v, [V, v]] = np.array([1.0, -1.0]) / POWER.smoothing_s
    F[v0, [v, v0]] = np.array([1.0, -1.0]) / POWER.washout_s
    F[e, [q, e]] = 1.0, -1.0 / POWER.attitude_memory_s
    a = POWER.speed_gain_inhg_per_mps
    c = np.rad2deg(POWER.attitude_gain_inhg_per_deg)
    return F, np.append(power, np.zeros(3)), np.append(np.zeros(n), (-a, a, c))


def loop_response(F: np.ndarray, b: np.ndarray, k: np.ndarray) -> np.ndarray:
    """The loop cut at the manifold pressure, over FREQUENCIES_RAD_S:

        L = -k (s I - F)^-1 b

    The roots of 1 + L = 0 are the poles of F + b k.
    """
    s = 1j * FREQUENCIES_RAD_S[:, None, None]
    return -np.linalg.solve(s * np.eye(len(F)) - F, b[:, None])[..., 0] @ k


def _phugoid_damping(system: np.ndarray) -> float:
    """Smallest damping ratio of the oscillations slower than SLOW_RAD_S; 1 if there is none."""
    poles = np.linalg.eigvals(system)
    slow = poles[(np.abs(poles) < SLOW_RAD_S) & (poles.imag > 1e-6)]
    return float(min(-slow.real / np.abs(slow), default=1.0))
