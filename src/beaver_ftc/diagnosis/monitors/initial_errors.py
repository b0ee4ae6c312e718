"""Errors that sensors had when the monitor began, and their largest effect on its tests.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. For each reading from which others
are predicted, on the hypothesis that it alone is broken,

    error_bound           bound on its error: at first as far as an aircraft flies, later
                          error_bound <= (|residual| + bound) / coupling, for each filter of a coupled test
    change_bound          bound on its change since: what its own test shows, plus that test's bound
    unit_effect           what a unit of its error adds to each test's residual in one sample, at most
    filtered_unit_effect  the same through the filters

A test beyond bound + (error_bound + change_bound) filtered_unit_effect refutes the hypothesis: a residual is
the sum of the effect of sound sensors, at most bound, and of the effect of the error, at most the rest. So
the broken sensor is never excluded by the effect of its first error, of any size. Where
sensor_monitor.py excludes a sensor by what its error would do from now on, bound + error_bound
filtered_unit_effect replaces the bound.

The error of an angle is counted as 2 sin(error / 2), by which it turns a vector of length one; that of the
airspeed as reading / truth - 1. With s the acceleration, gravity included, and errors that are differences of
these sines,

    attitude     an error of phi adds the difference of (q, r) turned by it; of theta, that of psi' turned
    gravity      of the length of g cos theta, or of g, turned by it; in SPEED, ALPHA_FLOW and BETA_FLOW
    SPEED        s . v / V
    ALPHA_FLOW   q - tan beta (p cos alpha + r sin alpha) + (s_z cos alpha - s_x sin alpha) / V cos beta
    BETA_FLOW    p sin alpha - r cos alpha + (s_y cos beta - (s_x cos alpha + s_z sin alpha) sin beta) / V
    DENSITY      log V: an error x scales its change by 1 + x
    CLIMB        V (cos beta (cos alpha sin theta - sin alpha cos phi cos theta) - sin beta sin phi cos theta)

Gyros need no such hypothesis: all of a gyro's error is in the test of its own axis at every sample. Neither
does the dynamic pressure: only the density shows it.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    AIRSPEED_ERROR,
    ALPHA,
    ALPHA_ERROR,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_ERROR,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    N_INITIAL,
    PHI_ERROR,
    QDYN,
    RPM,
    SPEED,
    STEEPEST_RAD,
    THETA,
    THETA_ERROR,
    TURN,
    steepest_pitch_angle,
)
from beaver_ftc.plant.instruments import ALTITUDE, PHI

MAX_FLOW_ANGLE_RAD = 0.7  # no aircraft whose attitude and flow are followed flies at more, to either side
MAX_READING_RATIO = 10.0  # what is read may be so many times the truth, or a part of it
DENSITY_TOLERANCE = 0.25  # share by which the air is thicker or thinner than the standard has it at a height
COUPLING_SHARE = (
    0.8  # share of a coupling that is left when speed and flow have changed within a filter's memory
)
SLOWEST_POLE = 2  # of monitor.POLES_PER_S

# Couplings that are followed with their sign
Q_TURNS, R_TURNS, G_DOWN, G_ASIDE, G_AHEAD, CLIMBS, ROLLS, YAWS, ALPHA_COUPLING_ERROR, BETA_COUPLING_ERROR = (
    range(10)
)
PULLS, PUSHES, FASTER, HEADS = range(10, 14)


@kernel
def angle_of_chord(size):
    """The angle whose 2 sin(angle / 2) this is, rad."""
    return 2.0 * np.arcsin(min(0.5 * size, 1.0))


@kernel
def chord_of_angle(angle):
    """2 sin(angle / 2), of no more than half a turn."""
    return 2.0 * np.sin(0.5 * min(abs(angle), np.pi))


@kernel
def standard_density(altitude):
    """Of the standard troposphere, kg/m3."""
    return 1.225 * max(1.0 - 2.25577e-5 * altitude, 0.05) ** 4.2559


@kernel
def begin_initial_errors(initial, signal):
    """At the first sample of the readings (N_SENSORS,) each may be off as far as an aircraft may fly."""
    initial.initial_bound[ALPHA_ERROR] = chord_of_angle(abs(signal[ALPHA]) + MAX_FLOW_ANGLE_RAD)
    initial.initial_bound[BETA_ERROR] = chord_of_angle(abs(signal[BETA]) + MAX_FLOW_ANGLE_RAD)
    # the airspeed that the dynamic pressure and the height leave
    V = max(signal[AIRSPEED], 1.0)
    true = np.sqrt(2.0 * max(signal[QDYN], 1.0) / standard_density(signal[ALTITUDE]))
    faster, slower = V / true * np.sqrt(1.0 + DENSITY_TOLERANCE), V / true * np.sqrt(1.0 - DENSITY_TOLERANCE)
    initial.initial_bound[AIRSPEED_ERROR] = min(max(faster - 1.0, 1.0 - slower), MAX_READING_RATIO - 1.0)
    initial.initial_bound[PHI_ERROR] = initial.initial_bound[THETA_ERROR] = 2.0
    initial.error_bound[:] = initial.initial_bound


@kernel
def test_of_error(i):
    """The test that shows at once by how much the error of hypothesis i has changed."""
    return (ALPHA_FLOW, BETA_FLOW, SPEED, ANGLE, ANGLE + 1)[i]


@kernel
def bound_changes(step, initial):
    """By how much each may have moved: within the slowest filter's memory, and what that has forgotten."""
    for i in range(N_INITIAL):
        changed = (
            largest_error_part(step, test_of_error(i), SLOWEST_POLE)
            + initial.error_bound[i] * initial.filtered_unit_effect[i, test_of_error(i), SLOWEST_POLE]
        )
        if i == AIRSPEED_ERROR:
            changed *= (1.0 + initial.error_bound[i]) / max(step.memory.previous[AIRSPEED], 1.0)
        initial.change_bound[i] = min(changed, initial.initial_bound[i])
        grown = initial.error_bound[i] + (1.0 - step.config.decay[SLOWEST_POLE]) * initial.change_bound[i]
        initial.error_bound[i] = min(grown, initial.initial_bound[i])


@kernel
def fill_reach(step, initial, signal):
    """Fill `unit_effect` (N_INITIAL, RPM): what a unit of each error adds to a residual in this sample, at
    most; and `coupling`: what it adds, with its sign. Both at the sample
    before, from which this one is predicted."""
    then, h = step.memory.previous, step.config.h
    p, q, r = then[0], then[1], then[2]
    V, phi, theta = max(then[AIRSPEED], 1.0), then[PHI], then[THETA]
    to, c = initial.unit_effect, initial.coupling
    to[:] = 0.0
    # the attitude, by turning; of the second order in h what turns meanwhile
    tilt = 1.0 / np.cos(min(abs(theta), STEEPEST_RAD))
    tilt_true = 1.0 / np.cos(min(abs(theta) + angle_of_chord(initial.error_bound[THETA_ERROR]), STEEPEST_RAD))
    meanwhile = (h * (abs(p) + abs(q) + abs(r))) ** 2
    across, heading = h * np.hypot(q, r), h * abs(q * np.sin(phi) + r * np.cos(phi)) * tilt_true
    for i in range(3):
        to[PHI_ERROR, TURN + i] = meanwhile + (across if i > 0 else 0.0)
        to[THETA_ERROR, TURN + i] = meanwhile + heading
        to[PHI_ERROR, ANGLE + i] = tilt * (across + tilt * meanwhile)
        to[THETA_ERROR, ANGLE + i] = tilt * ((heading if i != 1 else 0.0) + tilt_true * meanwhile)
    c[Q_TURNS], c[R_TURNS], c[HEADS] = h * q, h * r, h * (q * np.sin(phi) + r * np.cos(phi))
    fill_flow_reach(step, initial, V, p, q, r)
    speeds_up = np.log(max(signal[AIRSPEED], 1.0) / V)
    to[AIRSPEED_ERROR, DENSITY], c[FASTER] = 2.0 * abs(speeds_up), 2.0 * speeds_up


@kernel
def fill_flow_reach(step, initial, V, p, q, r):
    """The same of flow and climb, at V m/s and rates p, q, r rad/s."""
    then, h, s, g = step.memory.previous, step.config.h, step.memory.acceleration, step.config.gravity
    to, c = initial.unit_effect, initial.coupling
    sa, ca, sb, cb = np.sin(then[ALPHA]), np.cos(then[ALPHA]), np.sin(then[BETA]), np.cos(then[BETA])
    sp, cp, st, ct = np.sin(then[PHI]), np.cos(then[PHI]), np.sin(then[THETA]), np.cos(then[THETA])
    slip, wide = abs(then[BETA]), abs(then[BETA]) + angle_of_chord(initial.error_bound[BETA_ERROR])
    aslant, aslant_true = 1.0 / np.cos(min(slip, STEEPEST_RAD)), 1.0 / np.cos(min(wide, STEEPEST_RAD))
    normal, pull = s[2] * ca - s[0] * sa, max(step.memory.size, np.sqrt(s[0] ** 2 + s[1] ** 2 + s[2] ** 2))
    aside = s[1] * cb - (s[0] * ca + s[2] * sa) * sb
    roll, yaw = p * ca + r * sa, p * sa - r * ca
    coarse = h * (1.0 + h * (pull / V + abs(p) + abs(q) + abs(r)))
    rates, climbed = np.hypot(p, r), step.memory.predicted[ALTITUDE] - then[ALTITUDE]
    to[ALPHA_ERROR, SPEED] = to[BETA_ERROR, SPEED] = coarse * pull
    to[ALPHA_ERROR, ALPHA_FLOW] = coarse * aslant * (pull / V + rates * abs(sb))
    to[ALPHA_ERROR, BETA_FLOW] = coarse * (rates + pull * abs(sb) / V)
    to[BETA_ERROR, ALPHA_FLOW] = coarse * aslant * aslant_true * (abs(roll) + pull / V)
    to[BETA_ERROR, BETA_FLOW] = coarse * pull / V
    to[AIRSPEED_ERROR, ALPHA_FLOW] = to[AIRSPEED_ERROR, BETA_FLOW] = coarse * aslant * pull / V
    to[PHI_ERROR, SPEED] = coarse * g * ct * np.hypot(sb, sa * cb)
    to[PHI_ERROR, ALPHA_FLOW] = to[PHI_ERROR, BETA_FLOW] = coarse * g * ct * aslant / V
    to[THETA_ERROR, SPEED], to[THETA_ERROR, ALPHA_FLOW] = coarse * g, coarse * aslant * g / V
    to[THETA_ERROR, BETA_FLOW] = coarse * g * (abs(sp) + abs(sb)) / V
    flat = np.hypot(st, cp * ct)
    to[ALPHA_ERROR, CLIMB] = h * V * cb * flat
    to[BETA_ERROR, CLIMB] = h * V * np.hypot(ca * st - sa * cp * ct, sp * ct)
    to[AIRSPEED_ERROR, CLIMB] = abs(climbed) / (
        1.0 - min(initial.error_bound[AIRSPEED_ERROR], 1.0 - 1.0 / MAX_READING_RATIO)
    )
    to[PHI_ERROR, CLIMB] = h * V * ct * np.hypot(sb, sa * cb)
    to[THETA_ERROR, CLIMB] = h * V
    c[G_DOWN], c[G_ASIDE] = h * g * ct * cp, h * g * ct * sp
    nose = abs(then[THETA])  # the difference of two pitch angles acts across their mean
    c[G_AHEAD] = (
        h
        * g
        * np.cos(
            min(nose + 0.5 * angle_of_chord(initial.error_bound[THETA_ERROR]), 0.5 * nose + 0.25 * np.pi)
        )
    )
    steep = abs(np.arctan2(st, cp * ct) - then[ALPHA]) + 0.5 * angle_of_chord(
        initial.error_bound[ALPHA_ERROR]
    )
    c[CLIMBS] = h * V * cb * flat * np.cos(min(steep, 0.5 * np.pi))
    c[ROLLS], c[YAWS] = h * roll, h * yaw
    c[ALPHA_COUPLING_ERROR] = h * abs(sb) * pull / V
    c[BETA_COUPLING_ERROR] = h * np.sin(min(wide, 0.5 * np.pi)) * aslant * aslant_true * abs(normal) / V
    c[PULLS], c[PUSHES] = h * normal * aslant / V, h * aside / V


@kernel
def filter_reach(step, initial):
    """Pass reach and coupling through the filters."""
    for i in range(N_INITIAL):
        for t in range(RPM):
            for m in range(step.config.decay.size):
                initial.filtered_unit_effect[i, t, m] = (
                    step.config.decay[m] * initial.filtered_unit_effect[i, t, m] + initial.unit_effect[i, t]
                )
    for j in range(initial.coupling.size):
        for m in range(step.config.decay.size):
            initial.filtered_coupling[j, m] = (
                step.config.decay[m] * initial.filtered_coupling[j, m] + initial.coupling[j]
            )


@kernel
def largest_error_part(step, t, m):
    """What an error may have added to test t through filter m, at most."""
    return abs(step.test[t].filtered[m]) + step.test[t].bound[m]


@kernel
def current_error_part(step, initial, i, t, m):
    """What the error that hypothesis i has now has added to test t through filter m, at most: what is there,
    and what the error was less or more by while the filter summed it."""
    return (
        largest_error_part(step, t, m) + 2.0 * initial.change_bound[i] * initial.filtered_unit_effect[i, t, m]
    )


@kernel
def tighten_error_bound(initial, i, error_part, coupling):
    """An error that adds at least `coupling` a unit has added no more than `error_part`."""
    if coupling > 0.0:
        initial.error_bound[i] = min(initial.error_bound[i], error_part / (COUPLING_SHARE * coupling))


@kernel
def velocity_error_part(step, initial, i, m):
    """The same of the velocity, m/s, in any direction."""
    V = max(step.memory.previous[AIRSPEED], 1.0)
    flow = np.hypot(
        current_error_part(step, initial, i, ALPHA_FLOW, m),
        current_error_part(step, initial, i, BETA_FLOW, m),
    )
    return np.hypot(current_error_part(step, initial, i, SPEED, m), V * flow)


@kernel
def turn_error_part(step, initial, i, m):
    """The same of the turning about the axes other than the body's first."""
    return np.hypot(
        current_error_part(step, initial, i, TURN + 1, m), current_error_part(step, initial, i, TURN + 2, m)
    )


@kernel
def tighten_errors(step, initial):
    """Bring down how far each may be off."""
    for m in range(step.config.decay.size):
        c = initial.filtered_coupling[:, m]
        tighten_error_bound(
            initial, PHI_ERROR, turn_error_part(step, initial, PHI_ERROR, m), np.hypot(c[Q_TURNS], c[R_TURNS])
        )
        tighten_error_bound(
            initial,
            PHI_ERROR,
            velocity_error_part(step, initial, PHI_ERROR, m),
            np.hypot(c[G_DOWN], c[G_ASIDE]),
        )
        tighten_error_bound(
            initial, THETA_ERROR, velocity_error_part(step, initial, THETA_ERROR, m), c[G_AHEAD]
        )
        about = np.hypot(
            current_error_part(step, initial, THETA_ERROR, TURN, m),
            turn_error_part(step, initial, THETA_ERROR, m),
        )
        tighten_error_bound(initial, THETA_ERROR, about, abs(c[HEADS]))
        tighten_vanes(step, initial, m)
        tighten_speed(step, initial, m)


@kernel
def tighten_vanes(step, initial, m):
    """The same of incidence and sideslip."""
    c, half = initial.filtered_coupling[:, m], 0.5 * angle_of_chord(initial.error_bound[ALPHA_ERROR])
    rolled = np.cos(half) * abs(c[ROLLS]) - np.sin(half) * abs(c[YAWS]) - c[ALPHA_COUPLING_ERROR]
    tighten_error_bound(
        initial, ALPHA_ERROR, current_error_part(step, initial, ALPHA_ERROR, CLIMB, m), c[CLIMBS]
    )
    tighten_error_bound(
        initial, ALPHA_ERROR, current_error_part(step, initial, ALPHA_ERROR, BETA_FLOW, m), rolled
    )
    rolled = (
        np.cos(0.5 * angle_of_chord(initial.error_bound[BETA_ERROR])) * abs(c[ROLLS]) - c[BETA_COUPLING_ERROR]
    )
    tighten_error_bound(
        initial, BETA_ERROR, current_error_part(step, initial, BETA_ERROR, ALPHA_FLOW, m), rolled
    )


@kernel
def tighten_speed(step, initial, m):
    """The same of the airspeed. Bounds of the flow are for one that is right; the density shows its changes,
    and so does its own test: a scale error is in both alike."""
    c, slower = initial.filtered_coupling[:, m], 1.0 + initial.error_bound[AIRSPEED_ERROR]
    tighten_error_bound(
        initial,
        AIRSPEED_ERROR,
        slower * current_error_part(step, initial, AIRSPEED_ERROR, ALPHA_FLOW, m),
        abs(c[PULLS]),
    )
    tighten_error_bound(
        initial,
        AIRSPEED_ERROR,
        slower * current_error_part(step, initial, AIRSPEED_ERROR, BETA_FLOW, m),
        abs(c[PUSHES]),
    )
    changes = 2.0 * slower * largest_error_part(step, SPEED, m) / max(step.memory.previous[AIRSPEED], 1.0)
    tighten_error_bound(
        initial,
        AIRSPEED_ERROR,
        current_error_part(step, initial, AIRSPEED_ERROR, DENSITY, m) + changes,
        abs(c[FASTER]),
    )


@kernel
def update_initial_errors(step, initial, signal):
    """Update all errors for the sample whose readings (N_SENSORS,) have just been tested."""
    if steepest_pitch_angle(step, signal) > STEEPEST_RAD:  # turning is not tested
        initial.filtered_coupling[:] = 0.0
        return
    bound_changes(step, initial)
    fill_reach(step, initial, signal)
    filter_reach(step, initial)
    tighten_errors(step, initial)


@kernel
def exceeds_initial_error_bound(step, initial, i, t):
    """Whether test t is further beyond its bound than a first error of hypothesis i could make it."""
    test, error_bound = step.test[t], initial.error_bound[i] + initial.change_bound[i]
    if t >= RPM:
        return test.share > 1.0
    room = 1.0 + (error_bound if i == AIRSPEED_ERROR and t >= SPEED else 0.0)
    for m in range(step.config.decay.size):
        if abs(test.filtered[m]) > room * test.bound[m] + error_bound * initial.filtered_unit_effect[i, t, m]:
            return True
    return False


@kernel
def hold_errors_at_alarm(initial):
    """Keep how far each was off before the alarm: what shows afterwards may be another's."""
    initial.bound_at_alarm[:] = initial.error_bound


@kernel
def held_error_part(initial, i, t, m):
    """What the error that hypothesis i had at the alarm adds to test t through filter m, at most."""
    return initial.bound_at_alarm[i] * initial.filtered_unit_effect[i, t, m]


@kernel
def record_refuted(step, initial, exceeded):
    """Since the alarm: record the tests, of those `exceeded`, that a first error does not explain."""
    for i in range(N_INITIAL):
        for t in range(exceeded.size):
            if exceeded[t] and not initial.refuted[i, t] and exceeds_initial_error_bound(step, initial, i, t):
                initial.refuted[i, t] = 1


@kernel
def test_moves_with_error(i, t):
    """Whether test t moves at once when the error of hypothesis i does."""
    if i in (PHI_ERROR, THETA_ERROR):
        return t < ANGLE or t == test_of_error(i)
    return t == test_of_error(i) or (i == AIRSPEED_ERROR and t == DENSITY)


@kernel
def initial_error_explains(initial, i, lead):
    """Whether what has shown since the alarm, led by test `lead`, may be the first error of hypothesis i, and
    one that moves. Where its moves show in `lead`, those are for sensor_monitor.py: here it has not moved."""
    for t in range(initial.refuted.shape[1]):
        if initial.refuted[i, t] and (test_moves_with_error(i, lead) or not test_moves_with_error(i, t)):
            return False
    return True
