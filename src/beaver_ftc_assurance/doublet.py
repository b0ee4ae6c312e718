"""The doublet of least amplitude that brings surfaces to given deflections and back, within every limit.

Over a short time the rates follow dx/dt = G m, with the deflections m less the present ones. Deflections,
rates and angle of attack are then linear in the commands, and a linear programme finds the least amplitude.
The time to the target is the shortest of a few for which there is a solution.
"""

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

LONGEST_S = 0.5  # longest time until the surfaces have their target deflections


@dataclass(frozen=True)
class Situation:
    """The aircraft at the end of a flight, with n surfaces, and what limits a doublet that begins there.

    G (3, n)        effectiveness of the surfaces, rad/s2 per rad
    u (n,)          deflections of the surfaces, rad
    x (3,)          body rates, rad/s
    rate            largest allowed size of a body rate, rad/s
    bound (3,)      on the innovation of a frame without a fault, while the rates stay below `rate`, rad/s2
    stops (2, n)    ends of travel, rad
    approach (n,)   share of the way to its command that an actuator goes in a JSBSim frame ("instant")
    step (n,)       largest movement of an actuator in a JSBSim frame, rad; infinite without a rate limit
    instants        JSBSim frames in a frame
    in_blocks       whether types are tested by blocks of frames; `distinguish` then asks for no doublet that
                    distinguishes types
    dt              length of a frame, s
    alpha           angle of attack, rad
    alpha_range     its range, rad
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
    def frames_held(self) -> int:
        """Number of frames for which the deflection must hold: 3 if a frame has several instants, as
        `History.is_unexplained` then requires the frames before and after too."""
        return 1 if self.instants == 1 else 3

    def remaining_way(self, s: int) -> tuple[float, float]:
        """Shares of the way to a new command that surface s has still to go, if its rate limit does not act:
        at the end of a frame, and on average over its instants j:

            (1 - approach)^instants,    mean over j = 0 .. instants - 1 of (1 - approach)^j

        With one instant, both are 1 - approach.
        """
        stays = 1.0 - self.approach[s]
        if self.instants == 1:
            return stays, stays
        return stays**self.instants, float(np.mean(stays ** np.arange(self.instants)))


def doublet(targets: dict[int, float], at: Situation) -> tuple[np.ndarray, int] | None:
    """Commands (frames, n), rad, that bring surfaces to these deflections and back, and the number of frames
    to the last one in which they hold, counted from 1; None if no doublet does within the limits.

    targets: number of the surface -> deflection, rad.

    The times to the target that are tried are 1, 4, 16, ... frames, and LONGEST_S. The first one with a
    doublet is taken. It needs no finer search: if there is a doublet for a time, there is one for each longer
    time, because the commands may begin later.
    """
    frames_to_target = 1
    longest = max(int(LONGEST_S / at.dt), 1)
    while (commands := _least_amplitude(targets, at, frames_to_target)) is None:
        if frames_to_target == longest:
            return None
        frames_to_target = min(4 * frames_to_target, longest)
    return commands, frames_to_target + at.frames_held - 1


def _least_amplitude(targets: dict[int, float], at: Situation, frames_to_target: int) -> np.ndarray | None:
    """Commands (frames, n), rad, of the doublet of least amplitude that has its target from frame
    frames_to_target on, counted from 1; None if there is none.

    The unknowns of the linear programme are blocks of one value for each frame k, less the present value: for
    each surface the command u; for each surface the deflection p at the end of the frame; the body rates x
    (3,); the pitch angle. The last unknown is the amplitude A, which is minimised. In the code, each letter
    is the matrix that selects its block from the unknowns. With the shares a, b of `Situation.remaining_way`,
    and the mean deflection m over a frame:

        p[k] = a p[k-1] + (1 - a) u[k]            m[k] = b p[k-1] + (1 - b) u[k]
        x[k] = x[k-1] + dt G m[k]                 pitch[k] = pitch[k-1] + dt x_2[k]
        |m[k] - m[k-1]| <= instants step          |u[k]| <= A
        |m[k]| >= |target|, u[k] constant         in the frames in which the deflection must hold
        x = 0                                     in the last frame
    """
    from scipy.sparse import csr_array, eye_array, vstack

    if (np.abs(at.x) > at.rate).any() or not at.alpha_range[0] <= at.alpha <= at.alpha_range[1]:
        return None
    frames = 2 * (frames_to_target + at.frames_held - 1)
    surfaces = [*targets]
    n = len(surfaces)
    hold = slice(frames_to_target - 1, frames_to_target + at.frames_held - 1)
    every = np.arange(frames)
    unknowns = (2 * n + 4) * frames + 1
    blocks = [eye_array(frames, unknowns, k=block * frames, format="csr") for block in range(2 * n + 4)]
    A = csr_array((np.ones(frames), (every, np.full(frames, unknowns - 1))), shape=(frames, unknowns))
    # The product before @ block is the block one frame earlier, 0 in the first frame.
    before = eye_array(frames, k=-1, format="csr")
    *x, pitch = blocks[2 * n :]
    dx = [rate - before @ rate for rate in x]  # x[k] - x[k-1], less dt G m[k], surface by surface
    equal: list[Any] = []  # rows of equations: row @ unknowns = 0
    above: list[tuple[Any, float]] = []  # rows of inequalities with their limits: row @ unknowns <= limit
    for u, p, s in zip(blocks[:n], blocks[n:], surfaces, strict=False):
        away = targets[s] - at.u[s]
        a, b = at.remaining_way(s)
        m = b * (before @ p) + (1.0 - b) * u
        equal += [
            p - a * (before @ p) - (1.0 - a) * u,  # p[k] = a p[k-1] + (1 - a) u[k]
            (u - before @ u)[hold][1:],  # u[k] constant while the deflection holds
        ]
        above.append((-np.sign(away) * m[hold], -abs(away)))  # |m[k]| >= |target|, on its side
        for sign in (1.0, -1.0):
            above.append((sign * u - A, 0.0))  # |u[k]| <= A
            if np.isfinite(at.step[s]):
                above.append((sign * (m - before @ m), at.step[s] * at.instants))  # |m[k] - m[k-1]|
        dx = [row - at.dt * g * m for row, g in zip(dx, at.G[:, s], strict=True)]
    equal += [*dx, pitch - before @ pitch - at.dt * x[1]]  # pitch[k] = pitch[k-1] + dt x_2[k]
    limits = np.repeat([limit for _, limit in above], [rows.shape[0] for rows, _ in above])
    rows = vstack([rows for rows, _ in above], format="csc")
    solution = _solved(rows, limits, vstack(equal, format="csc"), _limits(at, surfaces, frames))
    if solution is None:
        return None
    commands = np.tile(at.u, (frames, 1))
    commands[:, surfaces] += solution[: n * frames].reshape(n, frames).T
    return commands


def _limits(at: Situation, surfaces: list[int], frames: int) -> np.ndarray:
    """Least and greatest value of each unknown, (unknowns, 2), all but A less the present value:

    command         within the travel
    deflection      free
    body rate       within +-at.rate; in the last frame as at present
    pitch angle     so that the angle of attack stays in its range
    A               at least 0
    """
    n = len(surfaces)
    stops = [at.stops[:, s] - at.u[s] for s in surfaces]
    rates = [(-at.rate - x, at.rate - x) for x in at.x]
    ends = [*stops, *[(-inf, inf)] * n, *rates, np.subtract(at.alpha_range, at.alpha)]
    limits = np.vstack([np.repeat(ends, frames, axis=0), (0.0, inf)])
    limits[[(block + 1) * frames - 1 for block in range(2 * n, 2 * n + 3)]] = 0.0
    return limits


def _solved(above: Any, limits: np.ndarray, equal: Any, bounds: np.ndarray) -> np.ndarray | None:
    """The unknowns y within `bounds` with the least amplitude, the last of them, so that above @ y <= limits
    and equal @ y = 0; None if there are none.
    """
    from scipy.optimize import linprog

    weight = np.r_[np.zeros(len(bounds) - 1), 1.0]
    for method in ("highs-ds", "highs-ipm"):  # the second method is used if rounding stops the first
        result = linprog(weight, above, limits, equal, np.zeros(equal.shape[0]), bounds, method=method)
        if result.status in (0, 2):  # solved, or infeasible
            break
    return np.asarray(result.x) if result.status == 0 else None
