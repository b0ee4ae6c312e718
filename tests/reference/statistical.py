"""The statistical detector: likelihood ratios on the whitened innovation. Page: statistical.md.

    g = e + dt (nu - d)        e <- g - K_x g        d <- alpha_d d + K_d g
    N = sum w' g,   D = sum w' g_chi,   w = S^-1 g_chi

g is the whitened innovation (nu-tilde of the page), e the error of the estimated rate (x-tilde), g_chi the
response to a signature. Hypotheses are rows, onsets columns. For the published class.
"""

from collections.abc import Callable
from math import exp, sqrt
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from reference.declaration import Declaration
from reference.gusts import Gusts
from reference.noise import LEAST_BOUND_RAD_S2, ONSETS, Noise
from reference.prediction import Frames

LOSS, STEP, CUBE, GROWING, ENDING = "loss", "step", "alpha^3", "growing", "ending"
SENSE = {LOSS: -1.0, GROWING: -1.0, ENDING: 1.0, STEP: 0.0, CUBE: 0.0}
GROWTH_PER_S, RINGING, NOISE_SHARE, LEAST_SHARE = 1.5, 1.2, 0.5, 0.25
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


class Group:
    """The Kalman filter and the tests of a group of axes."""

    def __init__(self, noise: Noise, axes: tuple[int, ...], returns: bool, gusts: Gusts | None) -> None:
        declaration = self.declaration = noise.declaration
        self.noise, self.z, self.dt = noise, noise.z, declaration.dt
        self.axes, self.returns, self.calm = list(axes), returns, None
        if gusts:
            self.walks = gusts.walks[int(returns)][..., axes, :][..., axes]
            self.calm, self.of_calm = Group(noise, axes, False, None), np.zeros(2)
        self.faults = faults_of(declaration, axes)
        n, h = len(axes), len(self.faults)
        self.terms = [j for j, t in enumerate(noise.model.terms) if t.axis in axes]
        self.tol = np.concatenate([noise.tolerance[self.terms], noise.steady])
        self.R = np.diag(noise.gyro[self.axes] ** 2)
        self.P_xx, self.P_xd, self.P_dd = self.R.copy(), np.zeros((n, n)), PRIOR_DRIFT_RAD_S2**2 * np.eye(n)
        self.e, self.d = np.zeros(n), np.zeros(n)
        self.e_chi, self.d_chi, self.w = (np.zeros((h, ONSETS, n)) for _ in range(3))
        self.e_j, self.d_j = (np.zeros((len(self.tol), n)) for _ in range(2))
        self.sums, self.N_j = np.zeros((6, h, ONSETS)), np.zeros((h, ONSETS, len(self.tol)))
        # Until its first restart a slot takes a growing loss for fully grown, and has no end of a loss.
        self.left, self.at_end = np.zeros((h, ONSETS)), np.zeros((h, ONSETS, n))
        self.upper, self.theta, self.information = np.zeros(h), np.zeros(h), np.zeros(h)
        self.sense = np.array([SENSE[fault.kind] for fault in self.faults])[:, None]
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

    def gains(self, start: int) -> None:
        """Covariances over a frame, then K_x = P_xx S^-1, K_d = P_xd' S^-1, P <- P - K S K'. start: the
        instant at which the frame starts. Per axis, eta_bar^2 times the intensity drives the drift; so does
        what is unmeasured of gusts, whose axes may turn fast. S is kept symmetric, against rounding."""
        noise, dt = self.noise, self.dt
        a = self.alpha = exp(-dt * noise.y[start, 2] / noise.length) if self.returns else 1.0
        turns = drift = 0.0
        if self.calm:
            self.calm.gains(start)
            turns, drift = self.walks[:, start // self.declaration.n]
        self.P_dd = self.P_dd + turns
        bound = np.maximum(noise.eta_bar[start, self.axes], LEAST_BOUND_RAD_S2)
        jitter = np.diag(noise.variance[start, self.axes])
        P_xx = self.P_xx + dt * (self.P_xd + self.P_xd.T) + dt**2 * self.P_dd + dt**2 * jitter
        P_xd = a * (self.P_xd + dt * self.P_dd)
        P_dd = a * a * self.P_dd + dt * (np.diag(noise.intensity * bound**2) + drift)
        S_inv = self.S_inv = np.linalg.inv((P_xx + P_xx.T) / 2.0 + self.R)
        self.K_x, self.K_d = P_xx @ S_inv, P_xd.T @ S_inv
        self.P_xx, self.P_xd = P_xx - self.K_x @ P_xx, P_xd - self.K_x @ P_xd
        self.P_dd = P_dd - self.K_d @ P_xd

    def predictable(self, nu: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Calm air: lambda p, what is predictable of g, rad/s. Sums fade with 2 s.

            p = g - g_calm,   lambda = (sum p' S^-1 g + 4 + 2 sqrt(D)) / D,   D = 4 + sum p' S^-1 p

        lambda: at most 1, and not negative. g_calm: of a filter without gusts, whose drift is a random walk.
        """
        calm = self.calm
        g_calm, calm.e, calm.d = calm.white(calm.e, calm.d, nu)
        p = g - g_calm
        self.of_calm = exp(-self.dt / 2.0) * self.of_calm + np.array([g, p]) @ self.S_inv @ p
        pg, D = self.of_calm + np.array([0.0, PRIOR_CALM])
        return p * np.clip((pg + PRIOR_CALM + 2.0 * sqrt(D)) / D, 0.0, 1.0)

    def white(
        self, e: np.ndarray, d: np.ndarray, nu: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """g, and the new e and d, of inputs nu (..., axes) rad/s2."""
        g = e + self.dt * (nu - d)
        return g, g - g @ self.K_x.T, self.alpha * d + g @ self.K_d.T

    def responses(self, start: int) -> None:
        """Bounded error (room): eta_bar |g_0| and eta_bar 1.2 / K_d of each axis, rad/s; on two axes the
        inverse of K_d.

            g_0 = dt (1 - alpha_d) / (K_x (1 - alpha_d) + dt K_d)
        """
        eta_bar, lost = self.noise.eta_bar[start, self.axes], 1.0 - self.alpha
        self.transient = RINGING * np.abs(np.linalg.inv(self.K_d)) @ eta_bar
        self.constant = np.zeros_like(eta_bar)
        if lost > 0.0:
            K_x, K_d = np.diag(self.K_x), np.diag(self.K_d)
            self.constant = self.dt * lost / (K_x * lost + self.dt * K_d) * eta_bar

    def signatures(self, Gu: np.ndarray, cube: float) -> np.ndarray:
        """Table 2: chi (faults, onsets, axes) rad/s2. Gu: G of the frame before times u; cube: pitch
        acceleration of a coefficient 1 on alpha^3."""
        chi = np.zeros_like(self.w)
        for row, fault in enumerate(self.faults):
            of_it = Gu[self.axes, fault.surface]
            if fault.kind == STEP:
                chi[row] = [float(axis == fault.axis) for axis in self.axes]
            elif fault.kind == CUBE:
                chi[row] = cube
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

    def take(self, frame: int, nu: np.ndarray, chi: np.ndarray, known: np.ndarray, forget: float) -> None:
        """Add a frame to all sums; known (constants, axes): regressors; forget: factor on the sums before."""
        start = (frame - 1) * self.declaration.n
        self.gains(start)
        self.responses(start)
        g, self.e, self.d = self.white(self.e, self.d, nu[self.axes])
        g_j, self.e_j, self.d_j = self.white(self.e_j, self.d_j, known)
        p = self.predictable(nu[self.axes], g) if self.calm else 0.0 * g
        g_chi, self.e_chi, self.d_chi = self.white(self.e_chi, self.d_chi, chi)
        w = g_chi @ self.S_inv.T
        self.N_j = forget * self.N_j + w @ g_j.T
        settled, varying = np.abs(w) @ self.constant, np.abs(w - self.w) @ self.transient
        slow = self.noise.change[frame - 1] * (np.abs(w) @ self.transient)
        now = w @ g, w @ p, (w * g_chi).sum(axis=-1), settled, varying, slow
        self.sums, self.w = forget * self.sums + np.array(now), w

    def judge(self, forget_upper: float, mapped: bool) -> None:
        """Scores and bounds on the log-likelihood ratios of each hypothesis, over its onsets.

            score = (evidence - allowed) / max(sqrt(D), room / z + sqrt(D) / 2)

        allowed: sum tol_j |N_j|, and what calm air (N_p) says for a loss. room: constant part, and the
        smaller of the sum of changes (with the last drop of w to 0) and the sum for a slow error.
        forget_upper: if a loss may end, factor on upper bounds of frames before; the bounds then leave room
        out, except those of other hypotheses than losses on a derived aircraft (`mapped`).
        """
        N, N_p, D, settled, varying, slow = self.sums
        allowed = np.abs(self.N_j) @ self.tol + np.maximum(self.sense * N_p, 0.0)
        room = settled + np.minimum(varying + np.abs(self.w) @ self.transient, slow)
        one_sided = self.sense != 0.0
        evidence = np.where(one_sided, self.sense * N, np.abs(N))
        there = D > 0.0
        D = np.where(there, D, 1.0)
        sigma = np.sqrt(D)
        limit = np.where(room > 0.0, np.maximum(sigma, room / self.z + self.noise_share * sigma), sigma)
        self.score = np.where(there, (evidence - allowed) / limit, 0.0).max(axis=1).clip(min=0.0)
        counts = np.where(~one_sided & mapped, 1.0, 0.0 if forget_upper > 0.0 else 1.0)
        error = allowed + counts * room

        def ratio(of: np.ndarray) -> np.ndarray:
            found = np.where(one_sided & (of > D), of - D / 2.0, of**2 / (2.0 * D))
            return np.where(of > 0.0, found, 0.0)

        self.lower = np.where(there, ratio(evidence - error), 0.0).max(axis=1)
        upper = np.where(there, ratio(evidence + error), 0.0).max(axis=1)
        self.upper = np.maximum(forget_upper * self.upper, upper)
        best = np.where(there, ratio(evidence), -1.0)
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


class Statistical:
    """The detector of one flight, frame by frame."""

    def __init__(self, declaration: Declaration, noise: Noise, frames: Frames) -> None:
        self.declaration, self.frames, self.noise, self.z = declaration, frames, noise, noise.z
        share = declaration["statistical.misnaming"] * declaration.dt / noise.tests
        self.margin = NormalDist().inv_cdf(share) ** 2 / 2.0
        self.groups = [Group(noise, axes, j == 2, noise.gusts) for j, axes in enumerate(GROUPS)]
        self.alarmed, self.axis, self.largest = False, None, 0.0
        self.confirmed: set[int] = set()
        self.weak: set[int] = set()
        self.abrupt = declaration["fault_profile"] == "abrupt"

    def effects(self, k: int) -> tuple[np.ndarray, float]:
        """G of the frame before times the mean positions of this one, (3, surfaces), 0 in the first frame;
        and the pitch acceleration of a coefficient 1 on alpha^3."""
        G, u = self.frames.G, self.frames.u
        before = G[k - 1] if k > 1 else np.zeros_like(G[k])
        model, y = self.noise.model, self.noise.y[k * self.declaration.n]
        return before * u[k], model.inertia["Qm"] * y[3] * model.aircraft.S * model.aircraft.c * y[0] ** 3

    def take(self, k: int, nu: np.ndarray) -> dict[str, float]:
        """Frame k; the shares of the alarm level by column. Outside the boxes of a derived model no alarm."""
        Gu, cube = self.effects(k)
        box = self.noise.bounds.box
        concludes = box is None or box[k * self.declaration.n] >= 0
        forgetting = exp(-self.declaration.dt / self.declaration["forgetting_time_s"])
        forget = forgetting if self.alarmed else 1.0
        air = self.noise.gusts.effect[k] if self.noise.gusts else 0.0
        mapped = self.noise.bounds.box is not None and not self.declaration.aircraft.file.get("damage")
        for group in self.groups:
            if not self.alarmed:
                group.restart(k)
            known = self.noise.known(k, group.terms, group.axes)
            group.take(k, nu - air, group.signatures(Gu, cube), known, forget)
            group.judge(0.0 if self.abrupt else forgetting, mapped)
        self.largest, self.axis = 0.0, None
        columns = dict.fromkeys(
            [f"{one.name}_loss_likelihood_share" for one in self.declaration.losses]
            + [f"{axis}_step_likelihood_share" for axis in "pqr"],
            0.0,
        )
        for group in self.groups:
            for fault, score in zip(group.faults, group.score / self.z, strict=True):
                if fault.alarms:
                    name = (
                        self.declaration.aircraft.surfaces[fault.surface]
                        if fault.kind == LOSS
                        else "pqr"[fault.axis]
                    )
                    key = f"{name}_{fault.kind}_likelihood_share"
                    columns[key] = max(columns[key], score)
                    if concludes and score > self.largest:
                        self.largest, self.axis = score, fault.axis
        self.alarmed |= self.largest > 1.0
        return columns

    def alternative(self, group: Group, s: int, excluded: set[int]) -> float:
        """Largest lower bound of what is no loss of surface s; excluded losses do not count."""
        return group.largest(
            "lower",
            lambda fault: (
                fault.kind in (STEP, CUBE)
                or (fault.kind == LOSS and fault.surface != s and fault.surface not in excluded)
            ),
        )

    def excludes(self, s: int, excluded: set[int]) -> bool:
        """Which fault: whether the likelihoods exclude a loss of surface s, which is not confirmed.

        A loss whose exclusion only the end of a loss in pitch would prevent is weak: it is not named."""
        if s not in self.confirmed and (s in self.weak or not self.abrupt) and self.confirms(s, excluded):
            self.confirmed.add(s)
        if s in self.confirmed or not self._beaten(s, excluded, False):
            return False
        self.weak.add(s)
        return self._beaten(s, excluded, True)

    def confirms(self, s: int, excluded: set[int]) -> bool:
        """Confirmed loss: in a group, its lower bound exceeds that of all others by the margin."""
        return any(
            group.largest("lower", lambda fault: fault.surface == s and fault.kind in (LOSS, GROWING))
            - self.alternative(group, s, excluded)
            > self.margin
            for group in self.groups
        )

    def _beaten(self, s: int, excluded: set[int], with_end_in_pitch: bool) -> bool:
        """Margin: each group of roll and yaw is judged with that of pitch. Upper bounds of the loss, and of
        its end, against the lower bound of the best alternative."""
        pitch, one_step = self.groups[0], self.declaration.n == 1
        loss_share = 1.0 if self.abrupt and one_step else LEAST_SHARE
        end_share = 1.0 if one_step else LEAST_SHARE
        for lateral in self.groups[1:]:
            best = max(self.alternative(group, s, excluded) for group in (pitch, lateral))

            def upper(group: Group, end: bool) -> float:
                return group.largest("upper", lambda f: f.surface == s and (f.kind == ENDING) == end)

            loss = max(upper(pitch, False), upper(lateral, False))
            end = max(upper(lateral, True), upper(pitch, True) if with_end_in_pitch else 0.0)
            if loss < loss_share * best and end < end_share * best and best - max(loss, end) > self.margin:
                return True
        return False

    def theta(self, s: int) -> float:
        """Estimate of a loss: that of the group with the most information."""
        found, most = 0.0, 0.0
        for group in self.groups:
            for fault, theta, D in zip(group.faults, group.theta, group.information, strict=True):
                if fault.kind == LOSS and fault.surface == s and most < D:
                    found, most = theta, D
        return float(found)
