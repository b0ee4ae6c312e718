"""Constrained least squares: the deflections within limits that give a demand best.

    min  |B u - d|^2 + slack sum (u - p)^2 / v        low <= u <= high        [Harkegard2002, Bodson2002]

    B            (3, n) rad/s2 per rad    remaining effect of each surface
    d            (3,) rad/s2              demand
    p            (n,) rad                 deflection that each surface prefers (u_preferred)
    v            (n,) rad2                weight of its movement; with 0 it does not move from p
    slack        (rad/s2)2                small compared with B v B'

So u gives as much of d as it can, and p and v choose among the ways to give it. engines.py solves the same
problem for the accelerations of engines, in other units.

Primal active set [Nocedal2006, alg. 16.3]. With the surfaces at their limits held, the others follow from
a system of three equations,

    (B v B' + slack I) y = d - B u0,      u = p + v B' y        u0: p, or the limit

and y (3,) is the multiplier as well: a surface at its limit stays there while (u - p) / v - B' y pushes
outwards. The active set of the frame before is tried first. As a rule it is right, and one system is solved.
"""

from math import sqrt

import numpy as np

from beaver_ftc.compiled import copy, kernel, record, sized

LOW, FREE, HIGH = -1, 0, 1
SLACK = 1e-10  # of the mean of the diagonal of B v B'
LEAST_SLACK = 1e-14  # (rad/s2)^2, as B v B'
ROUNDING = 1e-12  # rad: a surface that would move inside its limit by less stays there


@sized
def problem_dtype(n: int) -> np.dtype:
    """A problem of n surfaces and its solution u (n,) rad. u_preferred, weight: p, v. side (n,): LOW or HIGH
    where a limit holds the surface, else FREE; it is kept for the next frame. y (3,): the multipliers; S (3,
    3): the matrix of their system, then its factor L."""
    return record(u_preferred=n, weight=n, low=n, high=n, u=n, side=(int, n), y=3, S=(3, 3), slack=float)


@kernel
def solve(problem, B, demand):
    """Fill u (n,) rad, from B (3, n) rad/s2 per rad and a demand d (3,) rad/s2.

    Each pass solves the system with the present active set, and then moves one surface onto a limit or off
    it; without such a surface u is the minimum. After 4 n + 4 passes, u is within the limits, but perhaps not
    the minimum.
    """
    warm_start(problem, B)
    n = problem.u.size
    u = problem.u
    for _ in range(4 * n + 4):
        multipliers(problem, B, demand)
        blocking, share = blocking_surface(problem, B)
        for s in range(n):
            if problem.side[s] == FREE:
                target = wanted(problem, B, s)
                u[s] = u[s] + share * (target - u[s]) if blocking >= 0 else target
        if blocking >= 0:  # the surface stays at the limit that it has met
            below = wanted(problem, B, blocking) < problem.low[blocking]
            problem.side[blocking] = LOW if below else HIGH
            u[blocking] = problem.low[blocking] if below else problem.high[blocking]
        elif not release(problem, B):
            return


@kernel
def warm_start(problem, B):
    """Begin with the active set of the frame before: put its surfaces at their limits, and the others within
    theirs. Fill slack, SLACK times the mean of the diagonal of B v B'."""
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
    """Deflection of surface s without limits, rad: p + v B' y."""
    y = problem.y
    along = B[0, s] * y[0] + B[1, s] * y[1] + B[2, s] * y[2]
    return problem.u_preferred[s] + problem.weight[s] * along


@kernel
def multipliers(problem, B, demand):
    """Fill y (3,), the part of the demand that u does not give, over slack: the solution of

        S y = d - B u0,    S = B v B' + slack I        v of free surfaces alone; u0: p if free, else the limit

    by Cholesky: S = L L', L z = d - B u0, L' y = z. L takes the place of S, and z that of y in between.
    """
    S = problem.S
    y = problem.y
    slack = problem.slack
    S[:] = 0.0
    copy(demand, y)
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
    """The free surface that meets a limit first on its way to `wanted`, -1 for none, and the share of the way
    up to the limit, 0 to 1."""
    blocking = -1
    share = 1.0
    for s in range(problem.u.size):
        target = wanted(problem, B, s)
        u_s = problem.u[s]
        if problem.side[s] == FREE and (target < problem.low[s] or target > problem.high[s]):
            limit = problem.low[s] if target < problem.low[s] else problem.high[s]
            share_s = (limit - u_s) / (target - u_s) if target != u_s else 0.0
            if blocking < 0 or share_s < share:
                blocking = s
                share = share_s
    return blocking, share


@kernel
def release(problem, B):
    """Free the surface that would move farthest inside its limit, by side (u - (p + v B' y)) rad, and by more
    than ROUNDING; returns whether there is one. side is 0 for a free surface."""
    farthest = -1
    largest = ROUNDING
    for s in range(problem.u.size):
        inside = problem.side[s] * (problem.u[s] - wanted(problem, B, s))
        if inside > largest:
            farthest = s
            largest = inside
    if farthest >= 0:
        problem.side[farthest] = FREE
    return farthest >= 0
