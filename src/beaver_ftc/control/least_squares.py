"""Allocation to any number of surfaces: constrained least squares, started from the frame before.

    min  |B u - d|^2 + slack sum (u - p)^2 / v        low <= u <= high        [Harkegard2002, Bodson2002]

B (3, n) rad/s2 per rad: what is left of each surface; d (3,) rad/s2; p (n,) rad: where a surface is that has
nothing to do; v (n,) rad2: the weight of its movement, 0 for none. slack is small beside B v B', so that
what can be given is given, and p and v choose among the ways to give it.

Primal active set [Nocedal2006, alg. 16.3]. With the surfaces at their limits held, the others follow from a
system of three equations,

    (B v B' + slack I) y = d - B u0,      u = p + v B' y        u0: p, or the limit

and y is the multiplier as well: a surface at its limit stays there while (u - p) / v - B' y pushes outwards.
The set of the frame before is tried first: as a rule it is right, and one system is solved.
"""

from math import sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record, sized

LOW, FREE, HIGH = -1, 0, 1
SLACK = 1e-10  # of the mean of B v B'
LEAST_SLACK = 1e-14
ROUNDING = 1e-12  # of a multiplier


@sized
def problem_dtype(n: int) -> np.dtype:
    """A problem of n surfaces and its solution u. at: which limits hold, kept for the next frame; y: the
    multipliers; steps: systems solved."""
    return record(
        u_preferred=n, weight=n, low=n, high=n, u=n, at=(int, n), y=3, S=(3, 3), steps=int, slack=float
    )


@kernel
def solve(problem, B, demand):
    """Fill u (n,) rad, from B (3, n) rad/s2 per rad and a demand (3,) rad/s2."""
    begin(problem, B)
    n, u, target = problem.u.size, problem.u, problem.u_preferred
    problem.steps = 0
    for _ in range(4 * n + 4):
        problem.steps += 1
        multipliers(problem, B, demand)
        blocking, share = furthest(problem, B)
        for s in range(n):
            if problem.at[s] == FREE:
                wanted = target[s] + problem.weight[s] * along(B, s, problem.y)
                u[s] = u[s] + share * (wanted - u[s]) if blocking >= 0 else wanted
        if blocking >= 0:
            hold(problem, B, blocking)
        elif not release(problem, B):
            return


@kernel
def begin(problem, B):
    """Put u within the limits, on those that held in the frame before, and find how small slack is."""
    total = 0.0
    for s in range(problem.u.size):
        if problem.at[s] == LOW:
            problem.u[s] = problem.low[s]
        elif problem.at[s] == HIGH:
            problem.u[s] = problem.high[s]
        problem.u[s] = min(max(problem.u[s], problem.low[s]), problem.high[s])
        for i in range(3):
            total += B[i, s] * B[i, s] * problem.weight[s]
    problem.slack = max(SLACK * total / 3.0, LEAST_SLACK)


@kernel
def along(B, s, y):
    """B' y of surface s."""
    return B[0, s] * y[0] + B[1, s] * y[1] + B[2, s] * y[2]


@kernel
def multipliers(problem, B, demand):
    """Fill y (3,): what is left of the demand, over slack."""
    S, y = problem.S, problem.y
    a, b, c = problem.slack, problem.slack, problem.slack  # of the diagonal
    ba, ca, cb = 0.0, 0.0, 0.0
    y0, y1, y2 = demand[0], demand[1], demand[2]
    for s in range(problem.u.size):
        p, q, r = B[0, s], B[1, s], B[2, s]
        at = problem.u[s]
        if problem.at[s] == FREE:
            at, v = problem.u_preferred[s], problem.weight[s]
            a, b, c = a + v * p * p, b + v * q * q, c + v * r * r
            ba, ca, cb = ba + v * q * p, ca + v * r * p, cb + v * r * q
        y0, y1, y2 = y0 - p * at, y1 - q * at, y2 - r * at
    S[0, 0] = sqrt(a)  # Cholesky
    S[1, 0], S[2, 0] = ba / S[0, 0], ca / S[0, 0]
    S[1, 1] = sqrt(max(b - S[1, 0] * S[1, 0], problem.slack))
    S[2, 1] = (cb - S[2, 0] * S[1, 0]) / S[1, 1]
    S[2, 2] = sqrt(max(c - S[2, 0] * S[2, 0] - S[2, 1] * S[2, 1], problem.slack))
    y0 = y0 / S[0, 0]
    y1 = (y1 - S[1, 0] * y0) / S[1, 1]
    y2 = (y2 - S[2, 0] * y0 - S[2, 1] * y1) / S[2, 2]
    y[2] = y2 / S[2, 2]
    y[1] = (y1 - S[2, 1] * y[2]) / S[1, 1]
    y[0] = (y0 - S[1, 0] * y[1] - S[2, 0] * y[2]) / S[0, 0]


@kernel
def furthest(problem, B):
    """The free surface that meets a limit first on its way, or -1, and which share of the way that is."""
    blocking, share = -1, 1.0
    for s in range(problem.u.size):
        if problem.at[s] != FREE:
            continue
        wanted, now = problem.u_preferred[s] + problem.weight[s] * along(B, s, problem.y), problem.u[s]
        limit = problem.low[s] if wanted < problem.low[s] else problem.high[s]
        if wanted < problem.low[s] or wanted > problem.high[s]:
            part = (limit - now) / (wanted - now) if wanted != now else 0.0
            if blocking < 0 or part < share:
                blocking, share = s, part
    return blocking, share


@kernel
def hold(problem, B, s):
    """Put surface s on the limit it has met."""
    wanted = problem.u_preferred[s] + problem.weight[s] * along(B, s, problem.y)
    problem.at[s] = LOW if wanted < problem.low[s] else HIGH
    problem.u[s] = problem.low[s] if wanted < problem.low[s] else problem.high[s]


@kernel
def release(problem, B):
    """Free the surface whose limit holds it back most; whether there is one."""
    worst, most = -1, ROUNDING
    for s in range(problem.u.size):
        if problem.at[s] == FREE:
            continue
        # in rad: how far inside of its limit it would be
        wanted = problem.u_preferred[s] + problem.weight[s] * along(B, s, problem.y)
        inside = problem.at[s] * (problem.u[s] - wanted)
        if inside > most:
            worst, most = s, inside
    if worst >= 0:
        problem.at[worst] = FREE
    return worst >= 0
