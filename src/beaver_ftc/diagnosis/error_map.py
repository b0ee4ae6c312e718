"""The error of a derived design model, where in the envelope the aircraft is: measured, and looked up here.

The map is a few boxes of states, one inside the other, with the largest error found in each for surfaces
within a share of their travel. A surface that has lost effectiveness gives no more than what it is taken to
be at, so its error is within the same share; one that is stuck may be anywhere, so that the whole travel
counts where such faults are in question. Outside of all boxes nobody has measured: nothing is concluded.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_BOXES, MAX_LEVELS
from beaver_ftc.compiled import kernel
from beaver_ftc.design.terms import AIRSPEED, N_Y, QDYN

UNKNOWN_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
# The same to filters that carry a covariance, beside noise of 1e-4: more than any aircraft does, and no more.
UNKNOWN_TO_FILTERS_RAD_S2 = 100.0
_ROUNDING = 1e-9
_N = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@lru_cache
def error_map_dtype(n: int) -> np.dtype:
    """The map for an aircraft with n surfaces. whole: surfaces may be anywhere. outside: of all boxes. now:
    the error here, rad/s2."""
    fields = [
        ("n_boxes", "i8"), ("n_levels", "i8"), ("n_ages", "i8"), ("whole", "i8"), ("outside", "i8"),
        ("time_s", "f8"), ("until_s", "f8", (MAX_AGES,)),
        ("low", "f8", (MAX_BOXES, _N)), ("high", "f8", (MAX_BOXES, _N)),
        ("share", "f8", (MAX_LEVELS,)), ("error", "f8", (MAX_AGES, MAX_BOXES, MAX_LEVELS, 3)),
        ("travel_low", "f8", (n,)), ("travel_high", "f8", (n,)), ("place", "f8", (_N,)),
        ("now", "f8", (3,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


def fill_error_map(record: np.void, aircraft: Aircraft, whole: bool) -> None:
    """Write an aircraft's map, if it has one; whole: surfaces may be anywhere in their travel."""
    given = aircraft.file.model_error_map
    if given is None:
        return
    record["whole"], record["n_boxes"], record["n_levels"] = whole, len(given.boxes), len(given.travel_share)
    record["n_ages"] = len(given.until_s)
    record["until_s"][: len(given.until_s)] = given.until_s
    record["share"][: len(given.travel_share)] = given.travel_share
    record["travel_low"] = [travel.min_rad for travel in aircraft.travel.values()]
    record["travel_high"] = [travel.max_rad for travel in aircraft.travel.values()]
    for k, box in enumerate(given.boxes):
        ends = np.array(box.ends(aircraft.signals))
        record["low"][k, : len(ends)], record["high"][k, : len(ends)] = ends.T
        errors = box.error_p_rad_s2, box.error_q_rad_s2, box.error_r_rad_s2
        record["error"][: len(given.until_s), k, : len(given.travel_share)] = np.moveaxis(
            np.array(errors), 0, -1
        )


@kernel
def find_place(error_map, x, y):
    """Fill `place` from x (3,) rad/s and y (4 + declared,)."""
    place = error_map.place
    for i in range(3):
        place[i] = x[i]
    for i in range(y.size):
        place[3 + i] = y[i]
    place[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])


@kernel
def is_inside(error_map, k):
    """Whether `place` is in box k."""
    inside = True
    for i in range(error_map.place.size):
        room = _ROUNDING * (1.0 + abs(error_map.place[i]))
        inside = inside and error_map.low[k, i] - room <= error_map.place[i] <= error_map.high[k, i] + room
    return inside


@kernel
def level_of(error_map, u):
    """The first share of the travel that covers surfaces u (n,) rad; the last if all of it may be used."""
    last = error_map.n_levels - 1
    if error_map.whole:
        return last
    used = 0.0
    for s in range(u.size):
        if u[s] != 0.0:
            end = error_map.travel_high[s] if u[s] > 0.0 else error_map.travel_low[s]
            used = max(used, u[s] / end) if end != 0.0 else 1.0
    for j in range(last):
        if used <= error_map.share[j]:
            return j
    return last


@kernel
def age_of(error_map):
    """The row for the flight as old as it is, -1 if none was measured so late."""
    for a in range(error_map.n_ages):
        if error_map.time_s <= error_map.until_s[a]:
            return a
    return -1


@kernel
def look_up(error_map, x, y, u):
    """Fill `now` with the error measured about this state; x (3,) rad/s, y, u (n,) rad."""
    find_place(error_map, x, y)
    level, age = level_of(error_map, u), age_of(error_map)
    for k in range(error_map.n_boxes if age >= 0 else 0):
        if is_inside(error_map, k):
            error_map.outside, error_map.now[:] = 0, error_map.error[age, k, level]
            return
    error_map.outside, error_map.now[:] = 1, UNKNOWN_RAD_S2


@kernel
def add_model_error(error_map, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 the error measured about this state; x (3,) rad/s, y, u (n,) rad."""
    look_up(error_map, x, y, u)
    for i in range(3):
        eta_bar[i] += error_map.now[i]
