"""The worst-case detector: a bank of filters. Page: detection.md (residual and threshold, a bank of poles).

E[k]     = a E[k-1] + dt nu[k]                 E[0] = 0
T_eta[k] = a T_eta[k-1] + dt eta_bar[k]        T_eta[0] = 0
T_n[k]   = a T_n[k-1] + (1 - a) n[k-1]         T_n[0] = n[0]
T[k]     = T_eta[k] + T_n[k] + n[k]            a = exp(-lambda dt)
"""

from math import exp, log

import numpy as np

from reference.declaration import NOISE_LIMIT_SIGMA, Declaration

DESIGN_DELAYS_S = (0.1, 0.5, 2.0)
MOST_FILTERS = 6


def pole_for_delay(tau: float, n_bar: float, b: float) -> float:
    """The pole lambda, 1/s, that finds the smallest constant fault phi within tau s:

    lambda = max(ln(phi tau / n_bar), 0.1) / tau,   phi = (n_bar lambda + b) / (1 - exp(-lambda tau))
    """
    phi = b + 8.0 * n_bar / tau
    for _ in range(50):
        lam = max(log(phi * tau / n_bar), 0.1) / tau
        phi = (n_bar * lam + b) / (1.0 - exp(-lam * tau))
    return lam


def poles(declaration: Declaration) -> list[float]:
    """The published pole, those of the scenario, and three for gyro noise if any is declared; at most six."""
    found = [declaration["detection_pole_per_s"]]
    if not declaration.sharpen("pole_bank"):
        return found
    found += declaration["pole_bank_per_s"]
    n_bar = 2.0 * NOISE_LIMIT_SIGMA * max(declaration.error(gyro).sigma for gyro in "pqr")
    b = declaration.per_axis("bounds.constant_rad_s2").max()
    if n_bar > 0.0:
        found += [pole_for_delay(tau, n_bar, b) for tau in DESIGN_DELAYS_S]
    return found[:MOST_FILTERS]


class Bank:
    """E, T (frames, filters, 3) rad/s of a whole flight.

    nu, eta_bar, n (frames, 3): innovation rad/s2, its bound rad/s2, changing gyro error rad/s.
    """

    def __init__(self, declaration: Declaration, nu: np.ndarray, eta_bar: np.ndarray, n: np.ndarray) -> None:
        dt = declaration.dt
        self.a = declaration.memory(poles(declaration))[:, None]
        frames = len(nu)
        self.E, T_eta = (np.zeros((frames, self.a.size, 3)) for _ in range(2))
        T_n = np.broadcast_to(n[0], (frames, self.a.size, 3)).copy()
        for k in range(1, frames):
            self.E[k] = self.a * self.E[k - 1] + dt * nu[k]
            T_eta[k] = self.a * T_eta[k - 1] + dt * eta_bar[k]
            T_n[k] = self.a * T_n[k - 1] + (1.0 - self.a) * n[k - 1]
        self.T = T_eta + T_n + n[:, None, :]
        if not declaration["options.adaptive_threshold"]:
            self.T[:, 0] = declaration["options.constant_threshold_rad_s"]
        self.T[0] = 0.0

    def alarm_axis(self, k: int) -> int | None:
        """The first axis on which |E_i| > T_i in any filter, or None."""
        beyond = (np.abs(self.E[k]) > self.T[k]).any(axis=0)
        return int(beyond.argmax()) if beyond.any() else None

    def nearest_to_alarm(self) -> tuple[np.ndarray, np.ndarray]:
        """(frames, 3) each: residual and threshold of the filter with the largest |E_i| / T_i; of the first
        filter if none is above a millionth."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(self.T > 0.0, np.abs(self.E) / self.T, 0.0)
        m = np.where(share > 1e-6, share, 0.0).argmax(axis=1)[:, None, :]
        return np.take_along_axis(self.E, m, 1)[:, 0], np.take_along_axis(self.T, m, 1)[:, 0]
