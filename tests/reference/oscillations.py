"""Tests for an oscillation of unknown frequency, amplitude and phase. Page: statistical.md (oscillations).

N = sum e^((i omega - 1 / tau) t) g / sqrt(S)
"""

from math import exp, log, pi, sqrt

import numpy as np

from reference.directions import TONES
from reference.likelihood import NOISE_SHARE, Filter

OMEGA = np.linspace(1.0, 13.0, TONES)
TAU_S, INTERVAL_S, LARGEST_ANGLE_RAD = 2.5, 0.04, 0.5


class Oscillations:
    """The sums of one direction, whose filter has one row; arrays have a column for each frequency."""

    def __init__(self, of: Filter, change: float) -> None:
        """change: of the bounded error in a frame, as a share of its bound. Level of these tests, share of
        the larger part of the variance, largest mean of cos(omega t) times an error:

            z_t = sqrt(-2 ln P)        share = (1 + (1 - a^2) / |1 - rho^2|) / 2
            c = 2 sin(min(x, pi / 2)) / (pi x),   x = omega dt / change
        """
        dt = of.dt
        self.of, self.level = of, sqrt(-2.0 * log(of.noise.false_alarm))
        self.frames = max(round(INTERVAL_S / dt), 1)
        self.z = np.exp(1j * OMEGA * dt)
        self.a = exp(-self.frames * dt / TAU_S)
        self.rho, self.rho_2 = self.a * self.z**self.frames, self.a * self.z ** (2 * self.frames)
        self.share = (1.0 + (1.0 - self.a**2) / np.abs(1.0 - self.rho**2)) / 2.0
        x = OMEGA * dt / change
        self.c = 2.0 * np.sin(np.minimum(x, pi / 2.0)) / (pi * x)
        n = len(of.tol)
        self.N, self.N_j = np.zeros(TONES, complex), np.zeros((n, TONES), complex)
        self.B_0, self.B_2, self.D, self.score, self.count = np.zeros(TONES), np.zeros(TONES), 0.0, 0.0, 0
        self.new = np.zeros(3), np.zeros(n)

    def gain(self) -> np.ndarray:
        """|W|: amplitude of g, rad/s, by an oscillation of 1 rad/s2, z = e^(i omega dt).

        W = dt / (1 - (1 - K_x) / z + dt K_d / (z - alpha_d))
        """
        of, z = self.of, self.z
        return of.dt / np.abs(1.0 - (1.0 - of.K_x[0, 0]) / z + of.dt * of.K_d[0, 0] / (z - of.alpha))

    def take(self, eta_bar: float, inside: bool) -> None:
        """Add a frame, which counts as 0 unless the flow is `inside` its limits; once in 0.04 s test.

        score = z / z_t (|N| - sum tol_j |N_j|) / max(s, room / z_t + s / 2),   s = sqrt(share D)
        room = c (B_0 + |B_2|)
        """
        of, weight = self.of, inside * np.sqrt(self.of.S_inv[0, 0])
        self.count += 1
        of_frame = np.array([weight * of.g[0], weight * eta_bar, inside])
        self.new = self.new[0] + of_frame, self.new[1] + weight * of.g_j[:, 0]
        if self.count % self.frames:
            return
        (g, eta_bar, n), g_j = self.new
        self.new = 0.0 * self.new[0], 0.0 * g_j
        self.N, self.N_j = self.rho * self.N + g, self.rho * self.N_j + g_j[:, None]
        self.D, by_error = self.a**2 * self.D + n, self.gain() * eta_bar
        self.B_0, self.B_2 = self.a * self.B_0 + by_error, self.rho_2 * self.B_2 + by_error
        evidence = np.abs(self.N) - of.tol @ size(self.N_j)
        s, room = np.sqrt(self.share * self.D), self.c * (self.B_0 + np.abs(self.B_2))
        limit = np.where(room > 0.0, np.maximum(s, room / self.level + NOISE_SHARE * s), s)
        self.score = max(0.0, float((evidence / limit).max()) * of.z / self.level)


def size(N: np.ndarray) -> np.ndarray:
    """At least |N|: the larger of the two parts, and sqrt(2) - 1 of the smaller one."""
    parts = np.abs([N.real, N.imag])
    return parts.max(axis=0) + (sqrt(2.0) - 1.0) * parts.min(axis=0)
