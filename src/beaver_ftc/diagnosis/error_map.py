"""The map of the error of an aircraft's design model.

A derived aircraft declares a map of its model's error. The map has a few boxes of states, one inside the
other. Each box has the largest error found in it for surfaces within a share of their travel. Stand-ins,
which take over from the surface that leads pitch, stay within less. Healthy surfaces are where their
commands put them, and a surface that has lost effectiveness acts like one with a smaller deflection: the
bound is that of the share of travel in use. A stuck surface may be anywhere: the additional error of its
share, `extra_bound`, belongs to the hypothesis that it is off its command (isolation.py). If two surfaces may
be off, the bound itself takes the whole travel. Outside all boxes nothing has been measured, so nothing is
concluded.

Symbols of the kernels (emap: of `map_dtype`):

    x (3,) rad/s, y, u (n,) rad   rates, readings, deflections
    z (N_MAP_COORDINATES,)        `coordinates`, the place in the map: x, then y with the density of
                                  the air in place of dynamic pressure
    b, j, k                       box, level of travel, row of time of the map
    s, i                          surface, axis
"""

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_LEVELS
from beaver_ftc.compiled import copy, fill, kernel, record, sized
from beaver_ftc.design.table import AIRSPEED, N_Y, QDYN

UNMAPPED_ERROR_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
UNMAPPED_CN = 1e6
_EDGE = 1e-9  # tolerance of the edges of a box, by which rounding may move the state
N_MAP_COORDINATES = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@sized
def map_dtype(n: int, boxes: int) -> np.dtype:
    """The map of the error of an aircraft's model, with n surfaces.

    one_free: one surface may be anywhere in its travel; two_free: more than one may. lo, hi: ends of each
    box; share: the share of the travel, by level; e: error by row of time, box, level and axis, rad/s2.
    stop_lo, stop_hi: the stops, rad, of a stand-in times its share. outside: whether the state is outside all
    boxes; box, row: where it is in the map, of no meaning if outside; e_now: error there, rad/s2. Cn, Cn_now:
    bound on the coefficient of the yawing moment of healthy engines, by box and here. Other stages write
    time_s, the flight time, s, and u_old, the deflections in the frame before, rad.
    """
    return record(
        n_boxes=int, n_levels=int, n_rows=int, one_free=int, two_free=int, outside=int, box=int, row=int,
        time_s=float, until_s=MAX_AGES, lo=(boxes, N_MAP_COORDINATES), hi=(boxes, N_MAP_COORDINATES),
        share=MAX_LEVELS, e=(MAX_AGES, boxes, MAX_LEVELS, 3), stop_lo=n, stop_hi=n, u_old=n,
        coordinates=N_MAP_COORDINATES, e_now=3, Cn=boxes, Cn_now=float,
    )  # fmt: skip


def fill_map(emap: np.void, aircraft: Aircraft, one_free: bool, two_free: bool) -> None:
    """Write the map of the aircraft, if it has one; one_free, two_free: see `map_dtype`.

    reach: the share of its travel that a stand-in may use, 1 for other surfaces.
    """
    declared = aircraft.file.model_error_map
    if declared is None:
        return
    n_levels = len(declared.travel_share)
    n_rows = len(declared.until_s)
    reach = np.array([declared.stand_ins if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces])
    lo, hi = np.transpose([(travel.min_rad, travel.max_rad) for travel in aircraft.travel.values()])
    fill(
        emap, one_free=one_free, two_free=two_free, n_boxes=len(declared.boxes), n_levels=n_levels,
        n_rows=n_rows, stop_lo=reach * lo, stop_hi=reach * hi,
    )  # fmt: skip
    emap["until_s"][:n_rows] = declared.until_s
    emap["share"][:n_levels] = declared.travel_share
    for b, box in enumerate(declared.boxes):
        for i, end in enumerate(box.ends(aircraft.signals)):
            emap["lo"][b, i], emap["hi"][b, i] = end
        for i, error in enumerate((box.error_p_rad_s2, box.error_q_rad_s2, box.error_r_rad_s2)):
            emap["e"][:n_rows, b, :n_levels, i] = error
        emap["Cn"][b] = box.engines_apart or 0.0


@kernel
def is_between(lo, z, hi):
    """lo <= z <= hi, but for rounding."""
    slack = _EDGE * (1.0 + abs(z))
    return lo - slack <= z <= hi + slack


@kernel
def in_box(emap, b):
    """Whether the state is in box b of the map."""
    for i in range(emap.coordinates.size):
        if not is_between(emap.lo[b, i], emap.coordinates[i], emap.hi[b, i]):
            return False
    return True


@kernel
def travel_share(emap, s, u):
    """The share of its travel that surface s uses at u rad, u over the stop on that side; 1 if it has no
    travel on that side."""
    if u == 0.0:
        return 0.0
    stop = emap.stop_hi[s] if u > 0.0 else emap.stop_lo[s]
    return u / stop if stop != 0.0 else 1.0


@kernel
def level_of_positions(emap, u, du):
    """Level of travel, an index of `share`: the smallest whose share covers all surfaces within du of u, rad;
    the last if more than one surface may be anywhere."""
    if emap.two_free:
        return emap.n_levels - 1
    share = 0.0
    for s in range(u.size):
        for end in (u[s] - du[s], u[s] + du[s]):
            share = max(share, travel_share(emap, s, end))
    return level_of_share(emap, share)


@kernel
def level_of_share(emap, share):
    """The smallest level of travel whose share is not below this `share`; the last if none is."""
    last = emap.n_levels - 1
    for j in range(last):
        if share <= emap.share[j]:
            return j
    return last


@kernel
def share_used(emap, s, between, before, n):
    """The largest share of its travel that surface s can use in a frame of n instants, if it stays at one
    position p from the second instant on, at most 1:

        |p| <= (n |mean| + |before|) / (n - 1)      n = 1: |mean|

    All are shares of the travel. between: (low, high), rad, of the mean position over the instants; before:
    share at the start of the frame, which may still hold at the first instant.
    """
    share = max(travel_share(emap, s, between[0]), travel_share(emap, s, between[1]))
    if n > 1:
        share = max(before, (n * share + before) / (n - 1))
    return min(share, 1.0)


@kernel
def map_row(emap):
    """The row of the map for the present flight time, -1 if the map ends before."""
    for k in range(emap.n_rows):
        if emap.time_s <= emap.until_s[k]:
            return k
    return -1


@kernel
def look_up_map(emap, x, y, u, du):
    """Fill `coordinates`, `outside`, `box` and `row`, and the bounds e_now and Cn_now at this state: those of
    the smallest box that contains it, at the row k of the present time and the level j of the travel in use.

    Outside all boxes, or after the last row, the bounds are the UNMAPPED ones. Density: 2 qdyn / V^2.
    """
    z = emap.coordinates
    copy(x, z[:3])
    copy(y, z[3 : 3 + y.size])
    z[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])
    j = level_of_positions(emap, u, du)
    k = map_row(emap)
    for b in range(emap.n_boxes if k >= 0 else 0):
        if in_box(emap, b):
            emap.outside = 0
            copy(emap.e[k, b, j], emap.e_now)
            emap.box = b
            emap.row = k
            emap.Cn_now = emap.Cn[b]
            return
    emap.outside = 1
    emap.e_now[:] = UNMAPPED_ERROR_RAD_S2
    emap.Cn_now = UNMAPPED_CN


@kernel
def outside_span(emap, i):
    """Whether coordinate i of the state is outside the range that all boxes together cover."""
    lo, hi = np.inf, -np.inf
    for b in range(emap.n_boxes):  # compiled code with a reduction of an array loads scipy.linalg
        lo, hi = min(lo, emap.lo[b, i]), max(hi, emap.hi[b, i])
    return not is_between(lo, emap.coordinates[i], hi)


@kernel
def extra_bound(emap, j, i):
    """By how much the mapped error of axis i at this instant is larger if a surface is at level j of travel,
    rad/s2; 0 outside the map.
    """
    if emap.outside:
        return 0.0
    return max(emap.e[emap.row, emap.box, j, i] - emap.e_now[i], 0.0)
