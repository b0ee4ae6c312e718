"""Constrained least squares: the deflections within limits that give a demand best.

    min  |B u - d|^2 + slack sum (u - p)^2 / v        low <= u <= high        [Harkegard2002, Bodson2002]

B (3, n) rad/s2 per rad: remaining effectiveness of each surface; d (3,) rad/s2: the demand; p (n,) rad:
where a surface is that has nothing to do; v (n,) rad2: the weight of its movement, 0 for none. slack is small
compared with B v B', so u gives as much of d as it can, and p and v choose among the ways to give it.

Primal active set [Nocedal2006, alg. 16.3]. With the surfaces at their limits held, the others follow from
a system of three equations,

    (B v B' + slack I) y = d - B u0,      u = p + v B' y        u0: p, or the limit

and y is the multiplier as well: a surface at its limit stays there while (u - p) / v - B' y pushes
outwards. The set of the frame before is tried first: as a rule it is right, and one system is solved.
"""

from math import sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record, sized

LOW, FREE, HIGH = -1, 0, 1
SLACK = 1e-10  # of the mean of B v B'
LEAST_SLACK = 1e-14  # (rad/s2)^2, as B v B'
ROUNDING = 1e-12  # rad: a surface this little inside of its limit stays there


@sized
def problem_dtype(n: int) -> np.dtype:
    """A problem of n surfaces and its solution u. side: LOW or HIGH where a limit holds the surface, else
    FREE, kept for the next frame; y: the multipliers; S (3, 3): the matrix of their system, then its factor
    L."""
    return record(u_preferred=n, weight=n, low=n, high=n, u=n, side=(int, n), y=3, S=(3, 3), slack=float)


@kernel
def solve(problem, B, demand):
    """Fill u (n,) rad, from B (3, n) rad/s2 per rad and a demand d (3,) rad/s2.

    Each pass moves one surface onto a limit or off it. When the passes are used up, u is within the limits
    but perhaps not the minimum.
    """
    warm_start(problem, B)
    n, u = problem.u.size, problem.u
    for _ in range(4 * n + 4):
        multipliers(problem, B, demand)
        blocking, share = blocking_surface(problem, B)
        for s in range(n):
            if problem.side[s] == FREE:
                there = wanted(problem, B, s)
                u[s] = u[s] + share * (there - u[s]) if blocking >= 0 else there
        if blocking >= 0:  # it is put on the limit it has met
            below = wanted(problem, B, blocking) < problem.low[blocking]
            problem.side[blocking] = LOW if below else HIGH
            u[blocking] = problem.low[blocking] if below else problem.high[blocking]
        elif not release(problem, B):
            return


@kernel
def warm_start(problem, B):
    """Begin with the limits that held in the frame before: put u on them, and all within; and fill slack,
    SLACK of the mean of the diagonal of B v B'."""
    total = 0.0
    for s in range(problem.u.size):
        if problem.side[s] == LOW:
            problem.u[s] = problem.low[s]
        elif problem.side[s] == HIGH:
            problem.u[s] = problem.high[s]
        problem.u[s] = min(max(problem.u[s], problem.low[s]), problem.high[s])
        for i in range(3):
            total += B[i, s] * B[i, s] * problem.weight[s]
    problem.slack = max(SLACK * total / 3.0, LEAST_SLACK)


@kernel
def wanted(problem, B, s):
    """Where surface s goes without limits, rad: p + v B' y."""
    y = problem.y
    along = B[0, s] * y[0] + B[1, s] * y[1] + B[2, s] * y[2]
    return problem.u_preferred[s] + problem.weight[s] * along


@kernel
def multipliers(problem, B, demand):
    """Fill y (3,), what is left of the demand over slack: the solution of

        S y = d - B u0,    S = B v B' + slack I        v of free surfaces alone; u0: p if free, else the limit

    by Cholesky: S = L L', L z = d - B u0, L' y = z. L takes the place of S, and z that of y in between.
    """
    S, y, slack = problem.S, problem.y, problem.slack
    S[:], y[:] = 0.0, demand
    for i in range(3):
        S[i, i] = slack
    for s in range(problem.u.size):
        free = problem.side[s] == FREE
        u0 = problem.u_preferred[s] if free else problem.u[s]
        for i in range(3):
            y[i] -= B[i, s] * u0
            for j in range(i + 1):
                S[i, j] += problem.weight[s] * B[i, s] * B[j, s] if free else 0.0
    for i in range(3):
        for j in range(i + 1):
            for k in range(j):
                S[i, j] -= S[i, k] * S[j, k]
            S[i, j] = sqrt(max(S[i, j], slack)) if i == j else S[i, j] / S[j, j]
            if j < i:
                y[i] -= S[i, j] * y[j]
        y[i] /= S[i, i]
    for i in (2, 1, 0):
        for k in range(i + 1, 3):
            y[i] -= S[k, i] * y[k]
        y[i] /= S[i, i]


@kernel
def blocking_surface(problem, B):
    """The free surface that meets a limit first on its way, or -1, and which share of the way that is."""
    blocking, share = -1, 1.0
    for s in range(problem.u.size):
        there, now = wanted(problem, B, s), problem.u[s]
        if problem.side[s] == FREE and (there < problem.low[s] or there > problem.high[s]):
            limit = problem.low[s] if there < problem.low[s] else problem.high[s]
            part = (limit - now) / (there - now) if there != now else 0.0
            if blocking < 0 or part < share:
                blocking, share = s, part
    return blocking, share


@kernel
def release(problem, B):
    """Free the surface whose limit holds it back most, by side (u - (p + v B' y)) rad; returns whether there
    is one."""
    worst, most = -1, ROUNDING
    for s in range(problem.u.size):
        # in rad: how far inside of its limit it would be; nothing of one that is free
        inside = problem.side[s] * (problem.u[s] - wanted(problem, B, s))
        if inside > most:
            worst, most = s, inside
    if worst >= 0:
        problem.side[worst] = FREE
    return worst >= 0
