"""The informed test, which is given the fault and its onset: no test detects the fault more often.

All that is declared is taken as Gaussian. A Kalman filter turns the measurements that plug-ins are given into
independent innovations of covariance S. A fault phi, rad/s2, adds a known signature s to them. The likelihood
ratio of "this fault since its onset" against "no fault" has the deflection

    d^2 = sum s' S^-1 s,        s = H delta,  delta[k+1] = F (1 - K H) delta[k] + dt phi[k]

At a false-alarm probability alpha it detects the fault with probability Phi(d - Phi^-1(1 - alpha)), and no
test of these measurements detects it more often [Kay1998, sec. 4.4]. If the test is made once every T seconds
with r false alarms per hour, alpha = r T / 3600.

Errors that are constant but unknown, c normal of standard deviation sigma, times known regressors, pass
through the same filter as R c. The part of the fault that they can explain is no evidence [Kay1998, sec.
10.5]:

    d^2 = s' s - s' R (R' R + diag(1 / sigma^2))^-1 R' s,

with s and R scaled by S^-1/2 and the frames stacked.

The unexplained acceleration of the published bound is a sinusoid of unknown frequency; here it is a
first-order process of the same power with a memory of UNEXPLAINED_S.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import prod
from statistics import NormalDist
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.design.context import Context
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.diagnosis.gusts import UNMEASURED_SHARES

UNEXPLAINED_S = 0.1
LEAST_RATE_RAD_S = 1e-5  # what perfect instruments are taken for
_SETTLING_FRAMES = 400


FlightColumns = Mapping[str, np.ndarray]  # columns of a log, (frames,) each


class Whitening:
    """The Kalman filter of rates, air and the unexplained, once it has settled."""

    def __init__(self, context: Context) -> None:
        declared, dt = context.declared, context.dt_s
        time_s = np.concatenate((declared.gust_time_s, np.full(3, UNEXPLAINED_S)))
        size = np.concatenate((declared.gust_rad_s, context.constant_rad_s2 / np.sqrt(2.0)))
        keep = np.exp(-dt / time_s)
        self.F = np.eye(9)
        self.F[:3, 3:6], self.F[:3, 6:] = dt * declared.gust_effect, dt * np.eye(3)
        self.F[range(3, 9), range(3, 9)] = keep
        self.dt = dt
        self.R = np.diag(declared.rate_variance(LEAST_RATE_RAD_S))
        steady = (dt * declared.model_rad_s2) ** 2
        Q = np.diag(np.concatenate((steady, (1.0 - keep**2) * size**2)))
        P = np.diag(np.concatenate((np.diagonal(self.R), size**2)))
        for _ in range(_SETTLING_FRAMES):
            P = self._updated(P)
            P = self.F @ P @ self.F.T + Q
        self.S = P[:3, :3] + self.R
        self.K = np.linalg.solve(self.S, P[:3]).T

    def _updated(self, P: np.ndarray) -> np.ndarray:
        K = np.linalg.solve(P[:3, :3] + self.R, P[:3]).T
        return P - K @ P[:3]

    def respond(self, phi: np.ndarray) -> np.ndarray:
        """What accelerations phi (n, 3, ...) rad/s2 add to the innovations, scaled to variance one."""
        step = self.F @ (np.eye(9) - self.K @ np.eye(3, 9))
        whitener = np.linalg.cholesky(np.linalg.inv(self.S)).T
        delta, response = np.zeros((9, *phi.shape[2:])), np.empty_like(phi)
        for k, effect in enumerate(phi):
            delta = step @ delta
            delta[:3] += self.dt * effect
            response[k] = whitener @ delta[:3]
        return response

    def deflection(self, phi: np.ndarray) -> np.ndarray:
        """d after each frame, (n,), of a fault phi (n, 3) rad/s2 that begins with the first of them."""
        return np.sqrt(np.cumsum(np.square(self.respond(phi)).sum(axis=1)))

    def deflection_with_unknowns(self, phi: np.ndarray, regressors: np.ndarray, sigma: np.ndarray) -> float:
        """d of a fault phi (n, 3) rad/s2 with unknown constants in all frames.

        The constants, of standard deviation sigma (m,) > 0, multiply regressors (n, 3, m).
        """
        s = self.respond(phi).ravel()
        R = self.respond(regressors).reshape(s.size, sigma.size) * sigma
        explained = R.T @ s
        d2 = s @ s - explained @ np.linalg.solve(R.T @ R + np.eye(sigma.size), explained)
        return float(np.sqrt(max(d2, 0.0)))


def with_measured_gust(context: Context, noise_rad_s2: np.ndarray) -> Context:
    """What is declared to one who is shown the gusts the vanes see, with their noise (3,) rad/s2."""
    declared = context.declared
    if not declared.air:
        return context
    seen = replace(
        declared,
        gust_rad_s=declared.gust_rad_s * np.sqrt(UNMEASURED_SHARES),
        model_rad_s2=np.hypot(declared.model_rad_s2, noise_rad_s2),
    )
    return replace(context, declared=seen)


def detection_probability(d: float, within_s: float, per_h: float) -> float:
    """Probability of detection by that test, made once every within_s, at so many false alarms per hour."""
    normal = NormalDist()
    if per_h <= 0.0:
        return 0.0  # noise that has no bound leaves nothing certain
    return normal.cdf(d - normal.inv_cdf(1.0 - min(per_h * within_s / 3600.0, 0.5)))


def healthy_positions(context: Context, kept: FlightColumns, surface: str) -> np.ndarray:
    """Where a healthy surface would have been under the commands of a flight, (frames,) rad."""
    s, command = context.surfaces.index(surface), kept[f"{surface}_cmd_rad"]
    bandwidth, rate = context.declared.bandwidth_rad_s[s], context.declared.rate_limit_rad_s[s]
    approach = 1.0 - np.exp(-bandwidth * context.dt_s) if bandwidth else 1.0
    step = rate * context.dt_s if rate else np.inf
    low, high = context.travel_rad[:, s]
    there, places = kept[f"{surface}_effective_rad"][0], np.empty_like(command)
    for k, wanted in enumerate(np.clip(command, low, high)):
        there += min(max((wanted - there) * approach, -step), step)
        places[k] = there
    return places


def term_accelerations(
    aircraft: Aircraft, term: Term, kept: FlightColumns, deflection_rad: np.ndarray | None
) -> np.ndarray:
    """What a coefficient's term of value one does, (frames, 3) rad/s2; deflection_rad: of its surface."""
    V, size, i = kept["airspeed_mps"], aircraft.geometry, inertia_coefficients(aircraft.mass)
    of: dict[str | None, Any] = {
        **{name: kept[name] for name in aircraft.signals},
        "alpha": kept["alpha_rad"], "beta": kept["beta_rad"],
        "ph": kept["p_rad_s"] * size.span_m / (2.0 * V), "qh": kept["q_rad_s"] * size.chord_m / V,
        "rh": kept["r_rad_s"] * size.span_m / (2.0 * V), term.surface: deflection_rad,
    }  # fmt: skip
    value = kept["qdyn_pa"] * size.wing_area_m2 * prod(of[factor] for factor in term.factors)
    along = {
        "Cl": (i.Pl * size.span_m, 0.0, i.Rl * size.span_m),
        "Cm": (0.0, i.Qm * size.chord_m, 0.0),
        "Cn": (i.Pn * size.span_m, 0.0, i.Rn * size.span_m),
    }[term.coefficient]
    return np.multiply.outer(value, along)
