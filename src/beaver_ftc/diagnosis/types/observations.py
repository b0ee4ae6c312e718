"""Observations: where a surface was, if it alone is at fault (or by pairs.py).

A surface has those of three frames or blocks: `last` is of the elapsed frame, `judged` of the one before it,
`earlier` of the one before that.

    srf             record of a surface (records.py)
    nu, nu_max      (3,) rad/s2: innovation, and its bound without a fault
    eff             effect of a fault of this surface (estimators.EFFECT_RECORD)
    u, p, lo, hi    rad: deflection of a healthy surface, of this one, and the interval of p
"""

from beaver_ftc.compiled import copy, kernel, record
from beaver_ftc.diagnosis import estimators

# u           where a healthy surface was, rad
# lo, hi      where this one can have been, rad
# anomalous   whether more than the declared uncertainty must explain the frame
# kappa       (G_max - G_min) / (4 |mean G|): a mean weighted by G may be off by kappa times the range of p
# hides       whether the lower and the upper stop can cut off a deflection without this being visible
OBSERVATION_RECORD = record(u=float, lo=float, hi=float, anomalous=int, kappa=float, hides=(int, 2))


@kernel
def copy_observation(new, old):
    """Copy the observation `old` into `new`."""
    new.u = old.u
    new.lo = old.lo
    new.hi = old.hi
    new.anomalous = old.anomalous
    new.kappa = old.kappa
    copy(old.hides, new.hides)


@kernel
def set_anomalous(srf, anomalous):
    """Set `anomalous` of the last observation of a surface."""
    srf.last.anomalous = anomalous


@kernel
def forget_anomalies(srf):
    """Set that the declared uncertainty explains all three observations of a surface."""
    srf.last.anomalous = srf.judged.anomalous = srf.earlier.anomalous = 0


@kernel
def observe_surface(c, srf, fie, m, nu, nu_max, eff, anomalous):
    """Move the observations on by one, and fill `last`: where a healthy surface was, u = -h_m / Z_m, and
    where this one can have been, the interval of the deflections p within reach, rad, with

        |nu - G (p - u)| <= nu_max + r        on every axis; over a block on axis m alone

    from the innovation nu = eta + G (p - u) and |eta| <= nu_max, (3,) rad/s2. m: the axis on which the
    surface has most effect; eff: Z = G, rad/s2 per rad, h = -G u, rad/s2, tolerance r, rad/s2; fie: the
    estimator of its position. Over a block the axes weigh a varying position differently, so that they need
    not agree on its mean.
    """
    last = srf.last
    cmd = srf.commands
    G_m = eff.Z[m]
    copy_observation(srf.earlier, srf.judged)
    copy_observation(srf.judged, last)
    last.anomalous = anomalous
    last.u = -eff.h[m] / G_m
    last.kappa = 0.25 * (cmd.G_max - cmd.G_min) / abs(G_m)
    axis = m if c.frames_per_block > 1 else -1
    last.lo, last.hi = estimators.consistent_on_axes(nu, nu_max, fie, eff, axis)
    mark_stops(srf, 2.0 * (nu_max[m] + eff.r[m]) / abs(G_m))


@kernel
def observe_error(srf, e, tol):
    """Fill `last`, but for u and kappa, of a surface with p - u = e +- tol, rad:

        p in [u + e - tol, u + e + tol] within its reach,    anomalous if |e| > tol

    Returns whether there is such a p.
    """
    last = srf.last
    act = srf.actuator
    last.lo = max(act.reach_lo, last.u + e - tol)
    last.hi = min(act.reach_hi, last.u + e + tol)
    last.anomalous = abs(e) > tol
    mark_stops(srf, 2.0 * tol)
    return last.lo <= last.hi


@kernel
def mark_stops(srf, width):
    """Fill `hides`: a stop can cut off a deflection without this being visible if it is nearer to a healthy
    surface than the width, rad, of the interval of the true deflection.
    """
    srf.last.hides[0] = srf.commands.u_min[0] - srf.actuator.stop_lo < width
    srf.last.hides[1] = srf.actuator.stop_hi - srf.commands.u_max[0] < width


@kernel
def judged_error(srf):
    """p - u of the surface in the judged frame, (lo, hi) rad."""
    return srf.judged.lo - srf.judged.u, srf.judged.hi - srf.judged.u


@kernel
def last_error(srf):
    """p - u in the elapsed frame, rad, with p in the middle of its interval."""
    return 0.5 * (srf.last.lo + srf.last.hi) - srf.last.u
