"""Hypotheses, their estimators, and the four tests that exclude them. Page: isolation.md.

    phi_i = h_i + theta Z_i,   theta_- <= theta <= theta_+

Arrays have a row for each hypothesis and a column for each axis.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from reference.bounds import Bounds
from reference.declaration import POSITION, Declaration, Hypothesis
from reference.detection import Bank
from reference.prediction import Frames, mean_of_frames

EMPTY = (1.0, -1.0)
WIDENING_ROUNDS = 4


class Frame(NamedTuple):
    """What frame k, which ends at t s, says. All but k and t (3,).

    x_before, x: measured rates at its start and end, rad/s. F: predicted acceleration, nu: innovation,
    eta_bar: bound on the model error, bound: eta_bar + (n[k] + n[k-1]) / dt, rad/s2. n_before, n: changing
    gyro error, rad/s.
    """

    k: int
    t: float
    x_before: np.ndarray
    x: np.ndarray
    F: np.ndarray
    nu: np.ndarray
    eta_bar: np.ndarray
    bound: np.ndarray
    n_before: np.ndarray
    n: np.ndarray


@dataclass
class Effect:
    """h, Z, r (hypotheses, 3): known part, effect of one unit of theta, tolerance; rad/s2."""

    h: np.ndarray
    Z: np.ndarray
    r: np.ndarray


def theta_interval(measured: float, bound: float, Z: float, low: float, high: float) -> tuple[float, float]:
    """The theta of [low, high] with |measured - theta Z| <= bound; low > high if there is none."""
    if Z == 0.0:
        return (low, high) if abs(measured) <= bound else EMPTY
    ends = sorted(((measured - bound) / Z, (measured + bound) / Z))
    return max(low, ends[0]), min(high, ends[1])


class Widening:
    """fault-types.md, uncertain effect of a surface: r of a position grows with the distance from neutral.

    per_rad, at_command (frames, 3, surfaces): part of eta_bar that a radian of each surface adds, and what
    eta_bar has of it at the commanded position; more (frames, levels, 3): what a derived model's error is
    larger with a surface in each share of its travel. All are means over the frame.

    On the axis of the largest Z, the frame itself says how far from neutral, delta, the surface can be:

        |nu - h - theta Z| <= bound + r + max(per_rad (delta + delta_0) - at_command, 0) + more

    for some theta with |theta| <= delta. Four rounds, from the whole travel inwards. delta_0 is 0 with one
    JSBSim step in a frame, else 2 / n_s of the delta of the frame before: in the first step the surface may
    still be there.
    """

    def __init__(self, declaration: Declaration, bounds: Bounds) -> None:
        n = self.n = declaration.n
        per_rad = bounds.per_rad()
        self.per_rad = mean_of_frames(n, per_rad)
        self.at_command = mean_of_frames(n, per_rad * np.abs(bounds.u)[:, None, :])
        self.has_map = bounds.box is not None
        self.more = np.zeros((len(self.per_rad), 1, 3))
        if self.has_map:
            given = declaration.aircraft.file["model_error_map"]
            self.shares, (self.stop_lo, self.stop_hi) = given["travel_share"], bounds.mapped_travel()
            self.more = mean_of_frames(n, bounds.more_at_level())
        self.delta_before, self.share_before = (
            np.zeros(2 * len(declaration.aircraft.surfaces)) for _ in range(2)
        )

    def of(self, frame: Frame, row: int, one: Hypothesis, of: "Effect") -> np.ndarray:
        """(3,): what r grows by."""
        k, s, low, high = frame.k, one.surface, one.low, one.high
        i = int(np.abs(of.Z[row]).argmax())
        delta_0 = 2.0 * self.delta_before[row] / self.n if self.n > 1 else 0.0
        delta, interval = max(abs(low), abs(high)), (low, high)
        level = self._level(row, s, interval)
        for _ in range(WIDENING_ROUNDS):
            extra = max(self.per_rad[k, i, s] * (delta + delta_0) - self.at_command[k, i, s], 0.0)
            extra += self.more[k, level, i]
            found = theta_interval(
                frame.nu[i] - of.h[row, i], frame.bound[i] + of.r[row, i] + extra, of.Z[row, i], low, high
            )
            if found[0] > found[1]:
                break
            delta, interval = min(delta, max(abs(found[0]), abs(found[1]))), found
            level = self._level(row, s, interval)
        if self.has_map:
            self.share_before[row] = self._share(row, s, interval)
        self.delta_before[row] = delta
        grown = np.maximum(self.per_rad[k, :, s] * (delta + delta_0) - self.at_command[k, :, s], 0.0)
        return grown + self.more[k, level]

    def _level(self, row: int, s: int, interval: tuple[float, float]) -> int:
        if not self.has_map:
            return 0
        return min(int(np.searchsorted(self.shares, self._share(row, s, interval))), len(self.shares) - 1)

    def _share(self, row: int, s: int, interval: tuple[float, float]) -> float:
        """Largest share of its travel that the surface can have used at any instant of the frame, for a mean
        position in the interval: if it began at the share b, at most max(b, (n share + b) / (n - 1))."""
        share = max(
            interval[1] / self.stop_hi[s] if interval[1] > 0.0 else 0.0,
            interval[0] / self.stop_lo[s] if interval[0] < 0.0 else 0.0,
        )
        if self.n > 1:
            b = self.share_before[row]
            share = max(b, (self.n * share + b) / (self.n - 1))
        return min(share, 1.0)


class Isolation:
    """The bank of estimators of one flight, frame by frame."""

    def __init__(
        self, declaration: Declaration, bank: Bank, frames: Frames, bounds: Bounds, G_0: np.ndarray
    ) -> None:
        self.declaration, self.bank, self.frames = declaration, bank, frames
        self.of = declaration.hypotheses
        self.low = np.array([one.low for one in self.of])
        self.high = np.array([one.high for one in self.of])
        self.ranges = [(one.low, one.high) for one in self.of]
        self.surface = [one.surface for one in self.of]
        self.is_position = np.array([one.kind == POSITION for one in self.of])
        self.a = declaration.memory(declaration["isolation_pole_per_s"])
        self.adaptive = declaration["options.adaptive_threshold"]
        self.forget = np.exp(-declaration.dt / declaration["forgetting_time_s"])
        self.shared = declaration.sharpen("shared_effectiveness")
        self.remembers = declaration.sharpen("memory")
        constant = declaration["fault_profile"] == "abrupt" and not declaration["pairs"]
        self.narrows = constant and declaration.sharpen("set_membership")
        self.m = self._parity_directions(G_0)
        shape = len(self.of), bank.a.size, 4
        self.L, self.U = np.zeros(shape), np.zeros(shape)  # the fourth column is along the parity direction
        self.widening = Widening(declaration, bounds) if declaration.all_types else None
        self.excluded = np.zeros(len(self.of), dtype=bool)
        self.excluded[
            [int(declaration["options.leave_out"]) - 1] if declaration["options.leave_out"] else []
        ] = True
        self.excluded_at = np.full(len(self.of), -np.inf)
        self.counts = np.ones((len(self.of), 3), dtype=bool)
        if declaration["pairs"]:  # each plane by itself
            pitch = np.array([declaration.aircraft.main_axis[s] == 1 for s in self.surface])
            self.counts = np.where(pitch[:, None], [False, True, False], [True, False, True])

    def _parity_directions(self, G: np.ndarray) -> np.ndarray:
        """m = (G_r, 0, -G_p) / sqrt(G_p^2 + G_r^2) of each hypothesis, from G at the start of the flight."""
        m = np.zeros((len(self.of), 3))
        for row, s in enumerate(self.surface):
            size = np.hypot(G[0, s], G[2, s])
            if size > 0.0:
                m[row] = G[2, s] / size, 0.0, -G[0, s] / size
        return m

    def effect(self, frame: Frame) -> Effect:
        """Table 1: loss h = 0, Z = G_s u_s; position h = -G_s u_s, Z = G_s; means over the frame."""
        G, Gu, r = (part[frame.k].T[self.surface] for part in (self.frames.G, self.frames.Gu, self.frames.r))
        at = self.is_position[:, None]
        of = Effect(np.where(at, -Gu, 0.0), np.where(at, G, Gu), r)
        if self.widening:
            for row in np.flatnonzero(self.is_position):
                of.r[row] += self.widening.of(frame, row, self.of[row], of)
        return of

    def remember(self, of: Effect) -> None:
        """Test 2: L <- a L + dt (min(0, h + theta_- Z, h + theta_+ Z) - r), and U; along m as well."""
        if not self.remembers:
            return
        a, dt, m = self.bank.a[:, 0], self.declaration.dt, self.m
        along = Effect(
            (m * of.h).sum(axis=1, keepdims=True),
            (m * of.Z).sum(axis=1, keepdims=True),
            np.abs(m * of.r).sum(axis=1, keepdims=True),
        )
        h, Z, r = (np.hstack([getattr(of, name), getattr(along, name)]) for name in ("h", "Z", "r"))
        ends = np.array([np.zeros_like(h), h + self.low[:, None] * Z, h + self.high[:, None] * Z])
        least, most = ends.min(axis=0) - r, ends.max(axis=0) + r
        self.L = a[:, None] * self.L + dt * least[:, None, :]
        self.U = a[:, None] * self.U + dt * most[:, None, :]

    def start(self, frame: Frame) -> None:
        """At the alarm: x_hat = x, T_n = n, everything else 0; theta_hat = 0 with the variance of a uniform
        distribution over its range; the feasible set is the whole range."""
        shape = self.counts.shape
        self.x_hat = np.broadcast_to(frame.x, shape).copy()
        self.T_n = np.broadcast_to(frame.n, shape).copy()
        self.Omega, self.R_plus, self.R_minus, self.B_eta, self.B, self.theta = (
            np.zeros(shape) for _ in range(6)
        )
        if not self.adaptive:
            self.B += self.declaration["options.constant_threshold_rad_s"]
        self.theta += self.declaration["options.initial_theta"]
        self.prior = (self.high - self.low) ** 2 / 12.0
        self.variance = np.repeat(self.prior[:, None], 3, axis=1)
        self.eps = np.zeros(shape)
        self.set_low, self.set_high = (np.repeat(end[:, None], 3, axis=1) for end in (self.low, self.high))

    def advance(self, of: Effect, frame: Frame) -> None:
        """Test 1, the recursions.

        x_hat[k] = x[k-1] + dt (F + h + Z theta_hat) + a (x_hat - x)[k-1] + Omega[k] Delta
        """
        a, dt, x = self.a, self.declaration.dt, frame.x_before
        self.x_hat = x + dt * (frame.F + of.h + of.Z * self.theta) + a * (self.x_hat - x)
        Delta = self.descend() if self.declaration.to_the_letter else self.correct(of.Z)
        self.Omega = a * self.Omega + dt * of.Z
        self.x_hat = self.x_hat + self.Omega * Delta
        self.R_plus = a * self.R_plus + dt * np.maximum(of.Z, 0.0)
        self.R_minus = a * self.R_minus + dt * np.minimum(of.Z, 0.0)
        self.B_eta = a * self.B_eta + dt * (frame.eta_bar + of.r)
        self.T_n = a * self.T_n + (1.0 - a) * frame.n_before
        self.B = self.B_eta + self.T_n + frame.n
        if not self.adaptive:
            self.B[:] = self.declaration["options.constant_threshold_rad_s"]

    def descend(self) -> np.ndarray:
        """[Zhang2005, sec. IV] theta_hat' = P{Gamma Omega' eps}, by an Euler step, each axis by itself; the
        step.

        P limits theta_hat to its range, unless it is switched off."""
        before, gain = self.theta, self.declaration["options.adaptation_gain"]
        self.theta = before + self.declaration.dt * gain * self.Omega * self.eps
        if self.declaration["options.projection"]:
            self.theta = np.clip(self.theta, self.low[:, None], self.high[:, None])
        return self.theta - before

    def correct(self, Z: np.ndarray) -> np.ndarray:
        """Least squares with forgetting (isolation.md), limited to the feasible set: the step Delta.

            S = B^2 + Omega P Omega,   theta_hat <- theta_hat + P Omega eps / S,   P <- P B^2 / S / forget

        with residual, Omega and B of the frame before; P at most that of the start. If all axes share one
        parameter they correct it one after the other, those with an effect, each with the residual that the
        ones before leave, and P is divided once.
        """
        Delta = np.zeros_like(self.theta)
        for row in range(len(self.of)):
            forget, moved = self.forget, 0.0
            for i in range(3):
                if self.shared and i > 0:
                    self.theta[row, i], self.variance[row, i] = (
                        self.theta[row, i - 1],
                        self.variance[row, i - 1],
                    )
                if self.shared and Z[row, i] == 0.0:
                    continue
                left = self.eps[row, i] - self.Omega[row, i] * moved
                Delta[row, i] = self._step(row, i, left, forget)
                if self.shared:
                    moved, forget = moved + Delta[row, i], 1.0
            if self.shared:
                self.theta[row], self.variance[row] = self.theta[row, 2], self.variance[row, 2]
                Delta[row] = moved
        return Delta

    def _step(self, row: int, i: int, eps: float, forget: float) -> float:
        P, Omega, R, before = (
            self.variance[row, i],
            self.Omega[row, i],
            self.B[row, i] ** 2,
            self.theta[row, i],
        )
        S = R + Omega * P * Omega
        if S <= 0.0:
            return 0.0
        self.theta[row, i] = min(
            max(before + P * Omega / S * eps, self.set_low[row, i]), self.set_high[row, i]
        )
        self.variance[row, i] = min(P * R / S / forget, self.prior[row])
        return self.theta[row, i] - before

    def limits(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Test 1, the interval of the residual eps = x - x_hat; published: |eps| <= k |Omega| + B."""
        self.eps = x - self.x_hat
        low, high = self.low[:, None], self.high[:, None]
        if not self.adaptive:
            return -self.B, self.B
        if self.declaration.norm_bound:
            mu = np.maximum(self.theta - low, high - self.theta) * np.abs(self.Omega) + self.B
            return -mu, mu
        moved = self.Omega * self.theta
        return (
            low * self.R_plus + high * self.R_minus - moved - self.B,
            high * self.R_plus + low * self.R_minus - moved + self.B,
        )

    def exclude(self, of: Effect, frame: Frame, started: bool, by_worst_case: bool, detector: Any) -> None:
        """All tests in a frame; started: the estimators began before it. by_worst_case: whether tests 1 to 4
        exclude. detector: statistical detector that may exclude losses once it has raised its alarm, or
        None."""
        self.lower, self.upper = self.limits(frame.x)
        outside = (self.eps < self.lower) | (self.eps > self.upper)
        excluded = (outside & self.counts).any(axis=1)
        if self.remembers:
            excluded |= self.contradicts_memory(frame.k)
        for row in np.flatnonzero(~excluded):
            one = self.is_position[row] or self.shared
            if one and (started or self.remembers) and not self.some_theta(row, of, frame):
                excluded[row] = True
            elif self.narrows and started and not self.is_position[row]:
                excluded[row] = not self.narrow(row, of, frame)
        for row in range(len(self.of)):
            out = excluded[row] and by_worst_case
            if not out and detector:
                gone = {self.surface[j] for j in np.flatnonzero(self.excluded)}
                out = detector.excludes(frame.k, self.surface[row], gone)
            if out and not self.excluded[row]:
                self.excluded[row], self.excluded_at[row] = True, frame.t

    def contradicts_memory(self, k: int) -> np.ndarray:
        """Test 2: E < L - T or E > U + T on an axis, or along m with sum |m_i| T_i for T."""
        E, T = self.bank.E[k], self.bank.T[k]
        outside = (self.L[..., :3] - T > E) | (self.U[..., :3] + T < E)
        found = (outside & self.counts[:, None, :]).any(axis=(1, 2))
        if self.shared:
            mE, mT = self.m @ E.T, np.abs(self.m) @ T.T
            found |= ((mE < self.L[..., 3] - mT) | (mE > self.U[..., 3] + mT)).any(axis=1)
        return found

    def of_one_frame(self, row: int, i: int, of: Effect, frame: Frame) -> tuple[float, float]:
        """Test 3: the theta that one axis of one frame leaves, |nu_i - h_i - theta Z_i| <= bound_i + r_i."""
        if not self.counts[row, i]:
            return self.low[row], self.high[row]
        return theta_interval(
            frame.nu[i] - of.h[row, i], frame.bound[i] + of.r[row, i], of.Z[row, i], *self.ranges[row]
        )

    def some_theta(self, row: int, of: Effect, frame: Frame) -> bool:
        """Test 3: whether one theta, or no fault, explains the innovation on all axes."""
        if (np.abs(frame.nu) <= frame.bound).all():
            return True
        ends = np.array([self.of_one_frame(row, i, of, frame) for i in range(3)])
        return max(self.low[row], ends[:, 0].max()) <= min(self.high[row], ends[:, 1].min())

    def narrow(self, row: int, of: Effect, frame: Frame) -> bool:
        """Test 4: intersect the feasible set with the frame's and with the estimator's, whose ends are
        (eps + Omega theta_hat -+ B) / Omega; whether any theta is left. Without a shared parameter each axis
        has a set of its own."""
        for i in range(3):
            zeta = self.eps[row, i] + self.Omega[row, i] * self.theta[row, i]
            found = (
                self.of_one_frame(row, i, of, frame),
                theta_interval(zeta, self.B[row, i], self.Omega[row, i], *self.ranges[row]),
            )
            axes = slice(None) if self.shared else i
            for low, high in found:
                self.set_low[row, axes] = np.maximum(self.set_low[row, axes], low)
                self.set_high[row, axes] = np.minimum(self.set_high[row, axes], high)
        return bool((self.set_low[row] <= self.set_high[row]).all())

    def decide(self, detector: Any) -> str | None:
        """Decision: the surface of the only hypothesis left, `unanticipated` if none is, None if several, or
        if the likelihoods exclude the only one weakly and have not confirmed it."""
        left = np.flatnonzero(~self.excluded)
        if left.size > 1 or (
            left.size and detector and self.surface[left[0]] in detector.weak - detector.confirmed
        ):
            return None
        return self.of[left[0]].name if left.size else "unanticipated"
