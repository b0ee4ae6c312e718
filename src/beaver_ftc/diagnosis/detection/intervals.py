"""Intervals that hold a residual if an isolation estimator has the fault: its own residual, and the bank's.

The fault of an estimator is h + theta Z +- r, rad/s2 (EFFECT_RECORD of estimators.py), with theta in
[theta_min, theta_max]. The *reach* of the fault, (L, U), is what it can have added to the residual of a
filter since the start of the flight. If the fault is present, L - T <= E <= U + T.

Symbols of the kernels:

    fie             record of the estimator
    E, T            residual of a filter of the bank and its threshold, rad/s (filters.py)
    lo, hi          ends of an interval
    d (3,)          parity direction of the estimator, along which its fault at the start has no effect
    a, m, i         decay per frame; number of a filter; axis, or ALONG: along d
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.directions import project, project_size

ALONG = 3  # after the three axes, the place of the parity direction in the reach of an estimator


@kernel
def residual_interval(lo, hi, R_pos, R_neg, Om, th, B):
    """The interval (low, high), rad/s, that holds the residual of the true estimator.

        lo R_pos + hi R_neg - Om th - B  <=  eps  <=  hi R_pos + lo R_neg - Om th + B

    The parameter may move anywhere within [lo, hi] at every instant, so an incipient or intermittent fault is
    covered. R_pos, R_neg, Om rad/s: filtered positive part, negative part (at most 0) and whole of Z; th:
    estimate; B rad/s: bound on the filtered uncertainty.
    """
    eps_lo = lo * R_pos + hi * R_neg - Om * th - B
    eps_hi = hi * R_pos + lo * R_neg - Om * th + B
    return eps_lo, eps_hi


@kernel
def published_interval(lo, hi, Om, th, B):
    """(-mu, mu), mu = k |Om| + B rad/s, k = max(th - lo, hi - th) bounds |theta - th| [Zhang2005, via
    Zhang2002].
    """
    mu = max(th - lo, hi - th) * abs(Om) + B
    return -mu, mu


@kernel
def fault_range(fie, h, Z, r):
    """(lo, hi), the least and greatest acceleration by the fault on one axis, or along d, rad/s2:

        lo = min(0, h + theta_min Z, h + theta_max Z) - r
        hi = max(0, h + theta_min Z, h + theta_max Z) + r

    The 0 is for the frames before the fault.
    """
    at_lo, at_hi = h + fie.theta_min * Z, h + fie.theta_max * Z
    return min(0.0, at_lo, at_hi) - r, max(0.0, at_lo, at_hi) + r


@kernel
def advance_interval(bank, fie, i, interval, dt):
    """L <- a L + dt lo      U <- a U + dt hi      for each filter, with (lo, hi) of `fault_range`, on axis i.

    L, U rad/s: reach_lo and reach_hi of the estimator, (MAX_POLES, 4).
    """
    lo, hi = interval
    for m, a in enumerate(bank.config.a[: bank.config.n_filters]):
        fie.reach_lo[m, i] = a * fie.reach_lo[m, i] + dt * lo
        fie.reach_hi[m, i] = a * fie.reach_hi[m, i] + dt * hi


@kernel
def advance_reach(bank, fie, dt):
    """Advance the reach of the fault in each filter by a frame of dt s, on each axis and along d."""
    fault = fie.effect
    d = fie.parity_direction
    for i in range(3):
        advance_interval(bank, fie, i, fault_range(fie, fault.h[i], fault.Z[i], fault.r[i]), dt)
    along = fault_range(fie, project(d, fault.h), project(d, fault.Z), project_size(d, fault.r))
    advance_interval(bank, fie, ALONG, along, dt)


@kernel
def within_reach(fie, m, i, E, T):
    """Whether L - T <= E <= U + T for filter m on axis i."""
    return fie.reach_lo[m, i] - T <= E <= fie.reach_hi[m, i] + T


@kernel
def is_reachable(bank, fie, shared):
    """True if each filter is within reach on each axis that the estimator does not skip.

    shared: the axes share one parameter. Then the residual along d, d' E with the threshold |d|' T, must be
    within reach as well.
    """
    d = fie.parity_direction
    for m in range(bank.config.n_filters):
        E = bank.output.residual[m]
        T = bank.output.threshold[m]
        for i in range(3):
            if not (fie.skip[i] or within_reach(fie, m, i, E[i], T[i])):
                return False
        if shared and not within_reach(fie, m, ALONG, project(d, E), project_size(d, T)):
            return False
    return True
