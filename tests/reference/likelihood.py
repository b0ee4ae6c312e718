"""Likelihood ratios on the whitened innovation. Page: statistical.md.

    g = e + dt (nu - d)        e <- g - K_x g        d <- alpha_d d + K_d g
    N = sum w' g,   D = sum w' g_chi,   w = S^-1 g_chi

g is the whitened innovation (nu-tilde of the page), e the error of the estimated rate (x-tilde), g_chi the
response to a signature. Hypotheses are rows, onsets columns. For the published class.
"""

from collections.abc import Callable
from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from reference.declaration import Declaration
from reference.directions import ONSETS
from reference.noise import LEAST_BOUND_RAD_S2, Noise

LOSS, STEP, CUBE, GROWING, ENDING = "loss", "step", "alpha^3", "growing", "ending"
SENSE = {LOSS: -1.0, GROWING: -1.0, ENDING: 1.0, STEP: 0.0, CUBE: 0.0}
GROWTH_PER_S, RINGING, NOISE_SHARE = 1.5, 1.2, 0.5
PRIOR_DRIFT_RAD_S2, PRIOR_LOSS, PRIOR_CALM = 1.0, 12.0, 4.0


class Fault(NamedTuple):
    """A hypothesis: its kind, surface (-1 for none) and axis."""

    kind: str
    surface: int
    axis: int

    @property
    def alarms(self) -> bool:
        """Whether it can raise the alarm."""
        return self.kind in (LOSS, STEP)


def faults_of(declaration: Declaration, axes: tuple[int, ...]) -> list[Fault]:
    """Table 2, on the axes of a group; a loss that is declared constant neither grows nor ends."""
    aircraft = declaration.aircraft
    lost = [one.surface for one in declaration.losses if aircraft.main_axis[one.surface] in axes]
    found = [Fault(LOSS, s, int(aircraft.main_axis[s])) for s in lost]
    found += [Fault(STEP, -1, axis) for axis in axes]
    found += [Fault(CUBE, -1, 1)] if axes == (1,) else []
    if declaration["fault_profile"] != "abrupt":
        found += [Fault(kind, s, int(aircraft.main_axis[s])) for s in lost for kind in (GROWING, ENDING)]
    return found


GROUPS = ((1,), (0, 2), (0, 2))  # table 1; the drift of the last one returns


class Seen(NamedTuple):
    """What a filter of n directions reads of a frame.

    nu, eta_bar (n,): innovation, and the bound on its error, rad/s2. R, jitter (n,): variance of the gyros'
    noise, (rad/s)2, and of nu by other noise, (rad/s2)2. drift, turns (n, n): intensity of the drift besides
    that of the bounded error, (rad/s2)2/s, and variance added to it, (rad/s2)2. alpha: factor of the drift.
    change: of the bounded error, as a share of its bound. Gu (n, surfaces): effect of surfaces, cube: pitch
    acceleration of a coefficient 1 on alpha^3, rad/s2. known (constants, n): regressors.
    """

    nu: np.ndarray
    eta_bar: np.ndarray
    R: np.ndarray
    jitter: np.ndarray
    drift: Any
    turns: Any
    alpha: float
    change: float
    Gu: np.ndarray
    cube: float
    known: np.ndarray


class Filter:
    """A Kalman filter of n directions, and the tests of faults in them. Its constants are the terms of the
    moments about `rates`, the readings, and further ones, of the tolerances tol."""

    def __init__(
        self, noise: Noise, axes: tuple[int, ...], rates: tuple[int, ...], faults: list[Fault],
        tol: list[float], R: np.ndarray,
    ) -> None:  # fmt: skip
        declaration = self.declaration = noise.declaration
        self.noise, self.z, self.dt, self.axes = noise, noise.z, declaration.dt, list(axes)
        self.terms = [j for j, t in enumerate(noise.model.terms) if t.axis in rates]
        self.faults, self.tol = faults, np.concatenate([noise.tolerance[self.terms], noise.steady, tol])
        n, h = len(axes), len(faults)
        self.P_xx, self.P_xd, self.P_dd = np.diag(R), np.zeros((n, n)), PRIOR_DRIFT_RAD_S2**2 * np.eye(n)
        self.e, self.d = np.zeros(n), np.zeros(n)
        self.e_chi, self.d_chi, self.w = (np.zeros((h, ONSETS, n)) for _ in range(3))
        self.e_j, self.d_j = (np.zeros((len(self.tol), n)) for _ in range(2))
        self.sums, self.N_j = np.zeros((6, h, ONSETS)), np.zeros((h, ONSETS, len(self.tol)))
        # Until its first restart a slot takes a growing loss for fully grown, and has no end of a loss.
        self.left, self.at_end = np.zeros((h, ONSETS)), np.zeros((h, ONSETS, n))
        self.sense = np.array([SENSE[fault.kind] for fault in faults])[:, None]
        exact = declaration["bounds.sensors"] == "ideal" and not noise.gusts
        self.noise_share = 0.0 if exact else NOISE_SHARE

    def restart(self, k: int) -> None:
        """Slot j restarts in the odd multiples of 2^j frames, slot 9 in all others."""
        slot = 0
        while k % 2 == 0 and slot < ONSETS - 1:
            k, slot = k // 2, slot + 1
        self.sums[:, :, slot] = 0.0
        for states in (self.e_chi, self.d_chi, self.w, self.N_j):
            states[:, slot] = 0.0
        self.left[:, slot] = 1.0

    def gains(self, seen: Seen) -> None:
        """Covariances over a frame, then K_x = P_xx S^-1, K_d = P_xd' S^-1, P <- P - K S K'. Per direction,
        eta_bar^2 times the intensity drives the drift; so does what is unmeasured of gusts, whose axes may
        turn fast. S is kept symmetric, against rounding."""
        a, dt = seen.alpha, self.dt
        self.P_dd = self.P_dd + seen.turns
        bound = np.maximum(seen.eta_bar, LEAST_BOUND_RAD_S2)
        P_xx = self.P_xx + dt * (self.P_xd + self.P_xd.T) + dt**2 * (self.P_dd + np.diag(seen.jitter))
        P_xd = a * (self.P_xd + dt * self.P_dd)
        P_dd = a * a * self.P_dd + dt * (np.diag(self.noise.intensity * bound**2) + seen.drift)
        S_inv = self.S_inv = np.linalg.inv((P_xx + P_xx.T) / 2.0 + np.diag(seen.R))
        self.K_x, self.K_d = P_xx @ S_inv, P_xd.T @ S_inv
        self.P_xx, self.P_xd = P_xx - self.K_x @ P_xx, P_xd - self.K_x @ P_xd
        self.P_dd = P_dd - self.K_d @ P_xd
        self.alpha = a

    def predictable(self, seen: Seen, g: np.ndarray) -> np.ndarray:
        """What is predictable of g in calm air, rad/s."""
        return np.zeros_like(g)

    def white(
        self, e: np.ndarray, d: np.ndarray, nu: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, and the new e and d, of inputs nu (..., n) rad/s2."""
        g = e + self.dt * (nu - d)
        return g, g - g @ self.K_x.T, self.alpha * d + g @ self.K_d.T

    def responses(self, eta_bar: np.ndarray) -> None:
        """Bounded error (room): eta_bar |g_0| and eta_bar 1.2 / K_d of each axis, rad/s; on two axes the
        inverse of K_d.

            g_0 = dt (1 - alpha_d) / (K_x (1 - alpha_d) + dt K_d)
        """
        lost = 1.0 - self.alpha
        self.transient = RINGING * np.abs(np.linalg.inv(self.K_d)) @ eta_bar
        self.constant = np.zeros_like(eta_bar)
        if lost > 0.0:
            K_x, K_d = np.diag(self.K_x), np.diag(self.K_d)
            self.constant = self.dt * lost / (K_x * lost + self.dt * K_d) * eta_bar

    def signatures(self, seen: Seen) -> np.ndarray:
        """Table 2: chi (faults, onsets, n) rad/s2. G is that of the frame before."""
        chi = np.zeros_like(self.w)
        for row, fault in enumerate(self.faults):
            of_it = seen.Gu[:, fault.surface]
            if fault.kind == STEP:
                chi[row] = [float(axis == fault.axis) for axis in self.axes]
            elif fault.kind == CUBE:
                chi[row] = seen.cube
            elif fault.kind == GROWING:
                self.left[row] *= exp(-GROWTH_PER_S * self.dt)
                chi[row] = (1.0 - self.left[row])[:, None] * of_it
            elif fault.kind == ENDING:
                self.at_end[row, self.left[row] > 0.0] = of_it
                self.left[row] = 0.0
                chi[row] = self.at_end[row]
            else:
                chi[row] = of_it
        return chi

    def take(self, seen: Seen, forget: float) -> None:
        """Add a frame to all sums; forget: factor on the sums before."""
        self.gains(seen)
        self.responses(seen.eta_bar)
        g, self.e, self.d = self.white(self.e, self.d, seen.nu)
        g_j, self.e_j, self.d_j = self.white(self.e_j, self.d_j, seen.known)
        g_chi, self.e_chi, self.d_chi = self.white(self.e_chi, self.d_chi, self.signatures(seen))
        p, w = self.predictable(seen, g), g_chi @ self.S_inv.T
        self.N_j = forget * self.N_j + w @ g_j.T
        settled, varying = np.abs(w) @ self.constant, np.abs(w - self.w) @ self.transient
        slow = seen.change * (np.abs(w) @ self.transient)
        now = w @ g, w @ p, (w * g_chi).sum(axis=-1), settled, varying, slow
        self.sums, self.w, self.g, self.g_j = forget * self.sums + np.array(now), w, g, g_j

    def judge(self) -> None:
        """Score of each hypothesis, over its onsets.

            score = (evidence - allowed) / max(sqrt(D), room / z + sqrt(D) / 2)

        allowed: sum tol_j |N_j|, and what calm air (N_p) says for a loss. room: constant part, and the
        smaller of the sum of changes (with the last drop of w to 0) and the sum for a slow error.
        """
        N, N_p, D, settled, varying, slow = self.sums
        self.allowed = np.abs(self.N_j) @ self.tol + np.maximum(self.sense * N_p, 0.0)
        self.room = settled + np.minimum(varying + np.abs(self.w) @ self.transient, slow)
        self.evidence, self.there = np.where(self.sense, self.sense * N, np.abs(N)), D > 0.0
        sigma = np.sqrt(np.where(self.there, D, 1.0))
        limit = np.maximum(sigma, (self.room > 0.0) * (self.room / self.z + self.noise_share * sigma))
        self.score = (
            np.where(self.there, (self.evidence - self.allowed) / limit, 0.0).max(axis=1).clip(min=0.0)
        )


class Group(Filter):
    """The filter and the tests of a group of axes, whose drift may return. In declared turbulence a second
    filter, `calm`, assumes no gusts; its drift is a random walk."""

    def __init__(self, noise: Noise, axes: tuple[int, ...], returns: bool) -> None:
        R = noise.gyro[list(axes)] ** 2
        super().__init__(noise, axes, axes, faults_of(noise.declaration, axes), [], R)
        self.upper, self.theta, self.information = np.zeros((3, len(self.faults)))
        self.returns, self.calm, self.of_calm = returns, Filter(noise, axes, axes, [], [], R), np.zeros(2)

    def seen(self, k: int, nu: np.ndarray, Gu: np.ndarray, cube: float) -> Seen:
        """Frame k: what holds at its start."""
        noise, axes, start = self.noise, self.axes, (k - 1) * self.declaration.n
        returns, drift, turns = self.returns, 0.0, 0.0
        if noise.gusts:
            turns, drift = noise.gusts.walks[int(returns)][:, k - 1, axes][..., axes]
        alpha = exp(-self.dt * noise.y[start, 2] / noise.length) if returns else 1.0
        return Seen(
            nu[axes], noise.eta_bar[start, axes], noise.gyro[axes] ** 2, noise.variance[start, axes], drift,
            turns, alpha, noise.change[k - 1], Gu[axes], cube, noise.known(k, self.terms)[:, axes],
        )  # fmt: skip

    def predictable(self, seen: Seen, g: np.ndarray) -> np.ndarray:
        """Calm air: lambda p, what is predictable of g, rad/s. Sums fade with 2 s.

            p = g - g_calm,   lambda = (sum p' S^-1 g + 4 + 2 sqrt(D)) / D,   D = 4 + sum p' S^-1 p

        lambda: at most 1, and not negative. g_calm: of the filter without gusts.
        """
        calm = self.calm
        if not self.noise.gusts:
            return np.zeros_like(g)
        calm.gains(seen._replace(turns=0.0, drift=0.0, alpha=1.0))
        g_calm, calm.e, calm.d = calm.white(calm.e, calm.d, seen.nu)
        p = g - g_calm
        self.of_calm = exp(-self.dt / 2.0) * self.of_calm + np.array([g, p]) @ self.S_inv @ p
        pg, D = self.of_calm + np.array([0.0, PRIOR_CALM])
        return p * np.clip((pg + PRIOR_CALM + 2.0 * sqrt(D)) / D, 0.0, 1.0)

    def compare(self, forget_upper: float, mapped: bool) -> None:
        """Bounds on the log-likelihood ratios of each hypothesis, over its onsets, and estimates.

        forget_upper: if a loss may end, factor on upper bounds of frames before; the bounds then leave room
        out, except those of other hypotheses than losses on a derived aircraft (`mapped`).
        """
        N, D, one_sided, there = (
            self.sums[0],
            np.where(self.there, self.sums[2], 1.0),
            self.sense != 0.0,
            self.there,
        )
        counts = np.where(~one_sided & mapped, 1.0, 0.0 if forget_upper > 0.0 else 1.0)
        error = self.allowed + counts * self.room

        def ratio(of: np.ndarray) -> np.ndarray:
            found = np.where(one_sided & (of > D), of - D / 2.0, of**2 / (2.0 * D))
            return np.where(of > 0.0, found, 0.0)

        self.lower = np.where(there, ratio(self.evidence - error), 0.0).max(axis=1)
        upper = np.where(there, ratio(self.evidence + error), 0.0).max(axis=1)
        self.upper = np.maximum(forget_upper * self.upper, upper)
        best = np.where(there, ratio(self.evidence), -1.0)
        for row in np.flatnonzero(there.any(axis=1)):
            slot = best[row].argmax()
            self.theta[row] = self._estimate(row, N[row, slot], D[row, slot])
            self.information[row] = D[row, slot]

    def _estimate(self, row: int, N: float, D: float) -> float:
        """theta_hat = N / D; of a loss with a prior that is uniform on [-1, 0], variance 1/12."""
        if self.sense[row, 0] == 0.0:
            return N / D
        return min(max((N - PRIOR_LOSS / 2.0) / (D + PRIOR_LOSS), -1.0), 0.0)

    def largest(self, bound: str, wanted: Callable[[Fault], bool]) -> float:
        """Largest lower or upper bound of the hypotheses for which wanted(fault) holds, at least 0."""
        of_them = [v for fault, v in zip(self.faults, getattr(self, bound), strict=True) if wanted(fault)]
        return max(0.0, *of_them) if of_them else 0.0
