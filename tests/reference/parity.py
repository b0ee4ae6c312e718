"""Innovation along parity directions. Page: statistical.md (parity directions).

Rows: roll, pitch, yaw, side force, normal force; rad/s2.
"""

from math import exp, sqrt

import numpy as np

from reference.directions import INERTIAL, RAW, SIDE_FORCE, VANED, VANELESS, Direction
from reference.forces import VANE, Force
from reference.gusts import LEFT_BY_VANES, Estimate
from reference.likelihood import LOSS, STEP, Fault, Filter, Seen
from reference.noise import Noise
from reference.oscillations import LARGEST_ANGLE_RAD, Oscillations
from reference.prediction import Frames

LEAST_LENGTH_SHARE, VANE_SHARE, PEAK_MEMORIES, FORCE_PART = 0.1, 0.1, 5.0, 0.9
ROUNDING_SHARE = 1e-9
LEFT_BY_FORCES = np.minimum(LEFT_BY_VANES + 0.01, 1.0)


class Rows:
    """What each frame says on the five rows: all arrays have a row for each frame, from the first one on.

    nu, std (frames, 4, 5): innovation, and deviation of its noise, by what a direction reads. eta_bar
    (frames, 5). G, e_G (frames, columns, 5): at the start of the frame before, and its error. Gu (frames,
    surfaces, 5). estimates: of the gust, by what a direction reads.
    """

    def __init__(
        self, noise: Noise, frames: Frames, forces: list[Force], nu: np.ndarray,
        attitude: np.ndarray, force: np.ndarray,
    ) -> None:  # fmt: skip
        self.noise, self.forces, bounds, n = noise, forces, noise.bounds, noise.u.shape[1]
        if not noise.parity_directions:
            return
        zeros = [np.zeros((len(nu) - 1, *shape)) for shape in ((4, 5), (4, 5), (5,), (n + 2, 5), (n + 2, 5))]
        self.nu, self.std, self.eta_bar, self.G, self.e_G = zeros
        self.nu[..., :3], self.std[..., :3] = nu[1:, None], np.sqrt(noise.variance[:-1, None])
        self.eta_bar[:, :3] = noise.eta_bar[:-1]
        if bounds.box is not None:
            self.eta_bar[:, :3] += bounds.more_at_level()[:-1, -1]
        self.G[1:, :n, :3], self.e_G[:, :n, :3] = (
            of.swapaxes(1, 2) for of in (frames.G[1:-1], bounds.per_rad()[:-1])
        )
        by_flow = noise.model.derivatives(*noise.trim)[1]
        for one in forces:
            row, axis, vane = one.row, 2 - one.i, VANE[one.i]
            self.nu[..., row], self.std[..., row], self.eta_bar[:, row] = (
                one.e[:-1],
                one.std[:-1],
                one.eta_bar[:-1],
            )
            self.G[1:, :n, row], self.e_G[:, :n, row] = one.G[:-2], one.e_G[:-1]
            by_vane = np.array([-by_flow[0, vane], -by_flow[axis, vane], one.of_vane])
            self.G[:, n + one.i, [0, axis, row]], self.e_G[:, n + one.i, [0, axis, row]] = (
                by_vane,
                VANE_SHARE * np.abs(by_vane),
            )
        self.Gu = self.G[:, :n] * frames.u[1:, :, None]
        if gusts := noise.gusts:
            self.estimates = [gusts.estimate] * 4
            if forces:
                self.estimates[2:] = [
                    Estimate(noise, attitude, force, self.without_vanes, LEFT_BY_FORCES)
                ] * 2
                by_force = [
                    one.own.random / (noise.model.aircraft.c * abs(one.of_vane)) for one in forces[::-1]
                ]
                self.std[:, VANELESS, :3] += gusts.noise_of(noise, np.array(by_force))
                for reads in (VANED, VANELESS):
                    self.nu[:, reads, :3] -= self.estimates[reads].effect[:-1]

    def without_vanes(self, k: int, w: np.ndarray) -> np.ndarray:
        """y with the flow angles that the forces give: y - (e / q + L w) / of_vane."""
        y = self.noise.y[k].copy()
        for one in self.forces:
            y[VANE[one.i]] -= (one.e[k, VANED] / one.q[k] + one.L @ w) / one.of_vane
        return y


class View(Filter):
    """The tests in one parity direction m."""

    def __init__(self, rows: Rows, direction: Direction) -> None:
        noise, self.rows, self.direction, in_pitch = rows.noise, rows, direction, 1 in direction.plane
        self.force = rows.forces[direction.rows[-1] - SIDE_FORCE] if direction.of_force else None
        self.reads, axis = direction.reads, direction.alarm_axis
        losses = [] if noise.gusts and 1 in direction.rows else direction.losses
        faults = [Fault(STEP, -1, axis), *(Fault(LOSS, s, axis) for s in losses)]
        self.constants = slice(None, None if self.reads == INERTIAL else -1)
        tol = [*(self.force.tol[self.constants] if self.force else []), 1.0]
        rates = (1,) if in_pitch else (0, 2)
        super().__init__(noise, (axis,), rates, faults, tol, noise.gyro[list(rates)].max(keepdims=True) ** 2)
        self.m, self.of_column, self.peak, self.largest = np.zeros(5), np.zeros(5), 0.0, 0.0
        self.m[list(direction.rows)] = 1.0
        change = 2.0 if noise.declaration.aircraft.file.get("model_error_rad_s2") else noise.omega * self.dt
        self.change, self.oscillations = change, Oscillations(self, change)

    def turn(self, j: int) -> float:
        """m = (-g_j, g_i) / |g| in the plane of i and j, with the column g; and the share of the innovation
        along g that shows along m if g has the error e.

            |m|' e / max(|g| - |g|' e / |g|, 0.1 |g|)

        In moving air, m = g x q / |g x q| on roll, yaw and side force across an error of the side vane. q:
        effect of the rolling gust, 1/s. j: row of the frame.
        """
        if self.direction.column is None:
            return 0.0
        sees_roll = self.noise.gusts and self.reads == VANELESS and self.axes == [2]
        plane = [0, 2, 3] if sees_roll else list(self.direction.plane)
        g, e = (of[j, self.direction.column, plane] for of in (self.rows.G, self.rows.e_G))
        across = np.array([-g[1], g[0]])
        if sees_roll:
            air = self.noise.gusts.estimate
            across = np.cross(g, np.append((air.D[j] @ air.C[j])[[0, 2], 0], 0.0))
        length, size = np.linalg.norm(g), np.linalg.norm(across)
        if size == 0.0:
            return 0.0
        self.m, self.of_column = np.zeros((2, 5))
        self.m[plane], self.of_column[plane] = across / size, g / length
        left = max(length - np.abs(g) @ e / length, LEAST_LENGTH_SHARE * length)
        return float(np.abs(across / size) @ e / left)

    def walk(self, j: int, V: float) -> float:
        """Intensity of the drift besides that of the bounded error, (rad/s2)2/s; of the integrated angle, and
        of moving air at the airspeed V, m/s:

            (m_f q)^2 Q_e + max(V, V_estimate) sum_j (sqrt(share_j) |m D C_j| + q |m_f L C_j|)^2 Q_j

        Without a gust estimate that is subtracted, share is 1; (tau_p m D C_dot_j)^2 / 2 is added to the
        square if the axes of the gusts turn fast.
        """
        of_force, L_force = 0.0, np.zeros(3)
        if self.force:
            part = self.m[self.force.row] * self.force.q[j]
            of_force, L_force = (self.reads == INERTIAL) * part**2 * self.force.Q_e, part * self.force.L
        if not self.noise.gusts:
            return of_force
        of, raw = self.rows.estimates[self.reads], self.reads == RAW
        L_rate = self.m[:3] @ self.noise.gusts.estimate.D[j]
        L = np.sqrt(np.maximum(of.share[j], raw)) * np.abs(L_rate @ of.C[j]) + np.abs(L_force @ of.C[j])
        tau = raw * of.fast[j] * of.lags[0] / V
        squared = L**2 + (tau * (L_rate @ of.C_dot[j])) ** 2 / 2.0
        return of_force + max(V, of.V[j]) * float(squared @ self.noise.gusts.Q[j])

    def seen(self, k: int) -> Seen:
        """What frame k says along m."""
        j, rows, noise = k - 1, self.rows, self.noise
        leak, m, size = self.turn(j), self.m, np.abs(self.m)
        nu, Gu, turns = rows.nu[j, self.reads], rows.Gu[j] @ m, np.zeros((1, 1))
        known = noise.known(k, self.terms) @ m[:3]
        if self.force:
            known = np.append(known, m[self.force.row] * self.force.Z[j, self.constants])
        if noise.gusts:
            turns = turns + m[:3] @ noise.gusts.walks[0, 0, j] @ m[:3]
        one = (
            m @ nu,
            size @ rows.eta_bar[j],
            m[:3] ** 2 @ noise.gyro**2,
            (size @ rows.std[j, self.reads]) ** 2,
        )
        return Seen(
            *np.array(one)[:, None], self.walk(j, noise.y[k, 2]), turns, 1.0, self.change,
            np.where(np.abs(Gu) > ROUNDING_SHARE * (np.abs(rows.Gu[j]) @ size), Gu, 0.0)[None], 0.0,
            np.append(known, leak * (self.of_column @ nu))[:, None],
        )  # fmt: skip

    def add(self, k: int, inside: bool, forget: float, forget_peak: float) -> None:
        """Add frame k; score and peak. The integrated angle oscillates with the aircraft: it is not tested
        for oscillations."""
        seen = self.seen(k)
        self.take(seen, forget)
        self.judge()
        if self.reads != INERTIAL:
            self.oscillations.take(float(seen.eta_bar[0]), inside)
        self.largest = max(self.oscillations.score, *self.score)
        self.peak = max(forget_peak * self.peak, self.largest)


class Parity:
    """All parity directions of a flight, frame by frame. level: z over the level of the isolation."""

    def __init__(self, rows: Rows, margin: float) -> None:
        noise = self.noise = rows.noise
        self.rows, self.level = rows, noise.z / sqrt(2.0 * margin)
        self.views = [View(rows, one) for one in noise.parity_directions]
        memory_s = noise.declaration["forgetting_time_s"]
        self.forget_peak = 1.0 - (1.0 - exp(-noise.declaration.dt / memory_s)) / PEAK_MEMORIES

    def take(self, k: int, forget: float, restart: bool) -> None:
        """Add frame k to all directions; those of forces from the second frame on."""
        y, V0 = self.noise.y[k], self.noise.trim[1][2]
        inside = V0 / 2.0 < y[2] < 2.0 * V0 and bool((np.abs(y[:2]) < LARGEST_ANGLE_RAD).all())
        for view in self.views:
            if not (view.force and k == 1):
                if restart:
                    view.restart(k)
                view.add(k, inside, forget, self.forget_peak)

    def confirmed(self, view: View) -> float:
        """Score of a direction: with vanes and forces limited by those without vanes of the same force."""
        if view.reads != VANED or not self.rows.forces:
            return view.largest
        row = max(view.direction.plane[1], SIDE_FORCE)  # of roll and yaw: the side force
        of_row = [other for other in self.views if other.direction.plane[1] == row]
        return min(view.peak, self.level * max(other.peak for other in of_row if other.reads > VANED))

    def alarm_score(self, view: View) -> float:
        """Score with which a direction raises the alarm: where no group of axes tests."""
        if view.direction.column is None:
            return view.oscillations.score
        mainly_force = view.force and abs(view.m[view.force.row]) > FORCE_PART
        return self.confirmed(view) if mainly_force and view.reads == VANED else 0.0

    def excludes(self, s: int, G: np.ndarray, j: int) -> bool:
        """Whether a direction that a fault of surface s cannot change shows a fault. G (3,): its effect on
        the rates in the frame; on the forces: at the start of the frame, row j."""
        effect = np.append(G, [one.G[j, s] for one in self.rows.forces] or [0.0, 0.0])
        return any(
            view.reads <= VANED
            and (view.direction.column == s or view.m @ effect == 0.0)
            and self.confirmed(view) > self.noise.z
            for view in self.views
        )
