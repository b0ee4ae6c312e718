"""The doublet of least amplitude that brings surfaces to given deflections and back, within every limit.

Over a short horizon the rates follow dx/dt = G u. Travel, actuators, rates and angle of attack are then
linear in the commands, and a linear programme finds the least amplitude. The horizon is the shortest of a few
that has a solution.
"""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

LONGEST_S = 0.5  # until the frame in which the surfaces are there


@dataclass(frozen=True)
class Situation:
    """The aircraft at the end of a flight, with n surfaces, and what limits a doublet that begins there.

    G (3, n), rad/s2 per rad: effectiveness of the surfaces. u (n,), rad: their deflections. x (3,), rad/s:
    body rates. rate, rad/s: largest allowed size of a body rate. bound (3,), rad/s2: on the innovation of a
    frame without a fault, as long as the rates stay below `rate`. stops (2, n), rad: ends of travel. In a
    JSBSim frame, of which a frame has `instants`, an actuator goes the share `approach` (n,) of its way, and
    `step` (n,) rad at most. in_blocks: whether types are tested by blocks of frames. dt, s: length of a
    frame. alpha, alpha_range, rad: angle of attack and its range.
    """

    G: np.ndarray
    u: np.ndarray
    x: np.ndarray
    rate: float
    bound: np.ndarray
    stops: np.ndarray
    approach: np.ndarray
    step: np.ndarray
    instants: int
    in_blocks: bool
    dt: float
    alpha: float
    alpha_range: tuple[float, float]

    @property
    def held(self) -> int:
        """Number of frames for which the deflection must hold: 3 if a frame has several JSBSim frames, as
        `History.is_unexplained` then requires the frames before and after too."""
        return 1 if self.instants == 1 else 3

    def remaining_way(self, s: int) -> tuple[float, float]:
        """Shares of the way to its command that surface s has not gone, if its rate limit does not act: at
        the end of a frame, and on average over the frame. In the first of several instants the surface is
        where it was."""
        stays = 1.0 - self.approach[s]
        if self.instants == 1:
            return stays, stays
        return stays**self.instants, float(np.mean(stays ** np.arange(self.instants)))


def doublet(targets: dict[int, float], at: Situation) -> tuple[np.ndarray, int] | None:
    """Commands (frames, n), rad, that bring surfaces to these deflections and back, and the frame in which
    they are there; None if no doublet does within the limits.

    targets: deflection, rad, by place of the surface.

    The times to the deflection are 1, 4, 16, ... frames, and LONGEST_S. The first time that has a doublet is
    taken, with the least amplitude. A longer time never lacks a doublet that a shorter one has: it can wait.
    """
    tells = 1
    longest = max(int(LONGEST_S / at.dt), 1)
    while (found := _least_amplitude(targets, at, tells)) is None:
        if tells == longest:
            return None
        tells = min(4 * tells, longest)
    return found, tells + at.held - 1


def _least_amplitude(targets: dict[int, float], at: Situation, tells: int) -> np.ndarray | None:
    """Commands (frames, n), rad, of the doublet that is there in frame `tells` - 1; None if there is none.

    The linear programme. Its unknowns are blocks, one value a frame k, each less the present value: of each
    surface the command u; of each its deflection p at the end of the frame; the rates x = p, q, r; the pitch
    angle. After them the amplitude A, which is least. In the code, each letter is the matrix that takes it
    from the unknowns. With the shares a, b of `Situation.remaining_way`, and the mean deflection m over a
    frame:

        p[k] = a p[k-1] + (1 - a) u[k]            m[k] = b p[k-1] + (1 - b) u[k]
        x[k] = x[k-1] + dt G m[k]                 pitch[k] = pitch[k-1] + dt q[k]
        |m[k] - m[k-1]| <= instants step          |u[k]| <= A
        |m[k]| >= |target|, u[k] constant         in the frames in which the deflection must hold
        x = 0                                     in the last frame
    """
    from scipy.sparse import csr_array, eye_array, vstack

    if (np.abs(at.x) > at.rate).any() or not at.alpha_range[0] <= at.alpha <= at.alpha_range[1]:
        return None
    frames = 2 * (tells + at.held - 1)
    surfaces = [*targets]
    n = len(surfaces)
    there = slice(tells - 1, tells + at.held - 1)
    every = np.arange(frames)
    unknowns = (2 * n + 4) * frames + 1
    blocks = [eye_array(frames, unknowns, k=block * frames, format="csr") for block in range(2 * n + 4)]
    A = csr_array((np.ones(frames), (every, np.full(frames, unknowns - 1))), shape=(frames, unknowns))
    before = eye_array(frames, k=-1, format="csr")  # times a block: its values a frame earlier, 0 at first
    *x, pitch = blocks[2 * n :]
    turning = [rate - before @ rate for rate in x]
    equal: list[Any] = []  # rows that are zero
    above: list[tuple[Any, float]] = []  # rows, and what they are at most
    for u, p, s in zip(blocks[:n], blocks[n:], surfaces, strict=False):
        away = targets[s] - at.u[s]
        (a, b) = at.remaining_way(s)
        m = b * (before @ p) + (1.0 - b) * u
        equal += [p - a * (before @ p) - (1.0 - a) * u, (u - before @ u)[there][1:]]
        above.append((-np.sign(away) * m[there], -abs(away)))
        for sign in (1.0, -1.0):
            above.append((sign * u - A, 0.0))
            if np.isfinite(at.step[s]):
                above.append((sign * (m - before @ m), at.step[s] * at.instants))
        turning = [row - at.dt * g * m for row, g in zip(turning, at.G[:, s], strict=True)]
    equal += [*turning, pitch - before @ pitch - at.dt * x[1]]
    most = np.repeat([limit for _, limit in above], [rows.shape[0] for rows, _ in above])
    rows = vstack([rows for rows, _ in above], format="csc")
    found = _solved(rows, most, vstack(equal, format="csc"), _limits(at, surfaces, frames))
    if found is None:
        return None
    commands = np.tile(at.u, (frames, 1))
    commands[:, surfaces] += found[: n * frames].reshape(n, frames).T
    return commands


def _limits(at: Situation, surfaces: list[int], frames: int) -> np.ndarray:
    """Least and greatest value of each unknown, (unknowns, 2): a command within the travel, a deflection
    anywhere, a rate within at.rate, and 0 in the last frame, the pitch angle such that the angle of attack
    stays in its range, A at least 0."""
    n = len(surfaces)
    stops = [at.stops[:, s] - at.u[s] for s in surfaces]
    rates = [(-at.rate - x, at.rate - x) for x in at.x]
    ends = [*stops, *[(-inf, inf)] * n, *rates, np.subtract(at.alpha_range, at.alpha)]
    limits = np.vstack([np.repeat(ends, frames, axis=0), (0.0, inf)])
    limits[[(block + 1) * frames - 1 for block in range(2 * n, 2 * n + 3)]] = 0.0
    return limits


def _solved(above: Any, most: np.ndarray, equal: Any, bounds: np.ndarray) -> np.ndarray | None:
    """The unknowns with the least amplitude, of which rows `above` give at most `most`, and `equal` zero;
    None where there are none within the limits.
    """
    from scipy.optimize import linprog

    weight = np.r_[np.zeros(len(bounds) - 1), 1.0]
    for method in ("highs-ds", "highs-ipm"):  # the second where rounding stops the first
        result = linprog(weight, above, most, equal, np.zeros(equal.shape[0]), bounds, method=method)
        if result.status in (0, 2):  # solved, or infeasible
            break
    return np.asarray(result.x) if result.status == 0 else None
