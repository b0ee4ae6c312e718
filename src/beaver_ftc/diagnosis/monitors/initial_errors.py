"""Errors that sensors had when the monitor began, and their largest effect on its tests.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. For each reading from which others
are predicted, on the hypothesis that it alone is broken,

    off        bound on its error: at first as far as an aircraft flies, later off <= (|residual| + bound) /
    coupling         for each filter of a test to which it is coupled changed    bound on its change since:
    what its own test shows, plus that test's bound; it adds to off reach      what a unit of its error adds
    to each test's residual in one sample, at most reached    the same through the filters

A test beyond bound + (off + changed) reached refutes the hypothesis: a residual is the sum of the effect of
sound sensors, at most bound, and of the effect of the error, at most the rest. So the broken sensor is never
excluded by the effect of its first error, of whatever size. Where sensor_monitor.py excludes a sensor by what
its error would do from now on, bound + off reached replaces the bound.

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
Q_TURNS, R_TURNS, G_DOWN, G_ASIDE, G_AHEAD, CLIMBS, ROLLS, YAWS, BESIDE_ALPHA, BESIDE_BETA = range(10)
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
def begin_initial_errors(since, signal):
    """With the first look at readings (N_SENSORS,) each may be off as far as an aircraft may fly."""
    since.first[ALPHA_ERROR] = chord_of_angle(abs(signal[ALPHA]) + MAX_FLOW_ANGLE_RAD)
    since.first[BETA_ERROR] = chord_of_angle(abs(signal[BETA]) + MAX_FLOW_ANGLE_RAD)
    # the airspeed that the dynamic pressure and the height leave
    V = max(signal[AIRSPEED], 1.0)
    true = np.sqrt(2.0 * max(signal[QDYN], 1.0) / standard_density(signal[ALTITUDE]))
    faster, slower = V / true * np.sqrt(1.0 + DENSITY_TOLERANCE), V / true * np.sqrt(1.0 - DENSITY_TOLERANCE)
    since.first[AIRSPEED_ERROR] = min(max(faster - 1.0, 1.0 - slower), MAX_READING_RATIO - 1.0)
    since.first[PHI_ERROR] = since.first[THETA_ERROR] = 2.0
    since.off[:] = since.first


@kernel
def own_test(i):
    """The test that shows at once by how much the error of hypothesis i has changed."""
    return (ALPHA_FLOW, BETA_FLOW, SPEED, ANGLE, ANGLE + 1)[i]


@kernel
def bound_changes(step, since):
    """By how much each may have moved: within the slowest filter's memory, and what that has forgotten."""
    for i in range(N_INITIAL):
        changed = (
            largest_error_part(step, own_test(i), SLOWEST_POLE)
            + since.off[i] * since.reached[i, own_test(i), SLOWEST_POLE]
        )
        if i == AIRSPEED_ERROR:
            changed *= (1.0 + since.off[i]) / max(step.memory.then[AIRSPEED], 1.0)
        since.changed[i] = min(changed, since.first[i])
        grown = since.off[i] + (1.0 - step.config.decay[SLOWEST_POLE]) * since.changed[i]
        since.off[i] = min(grown, since.first[i])


@kernel
def fill_reach(step, since, signal):
    """Fill reach (STARTERS, RPM): what a unit of each error adds to a residual in this look, at most; and
    `coupling`: what it adds, with its sign. Of the look before, from which this one was predicted."""
    then, h = step.memory.then, step.config.h
    p, q, r = then[0], then[1], then[2]
    V, phi, theta = max(then[AIRSPEED], 1.0), then[PHI], then[THETA]
    to, c = since.reach, since.coupling
    to[:] = 0.0
    # the attitude, by turning; of the second order in h what turns meanwhile
    tilt = 1.0 / np.cos(min(abs(theta), STEEPEST_RAD))
    tilt_true = 1.0 / np.cos(min(abs(theta) + angle_of_chord(since.off[THETA_ERROR]), STEEPEST_RAD))
    meanwhile = (h * (abs(p) + abs(q) + abs(r))) ** 2
    across, heading = h * np.hypot(q, r), h * abs(q * np.sin(phi) + r * np.cos(phi)) * tilt_true
    for i in range(3):
        to[PHI_ERROR, TURN + i] = meanwhile + (across if i > 0 else 0.0)
        to[THETA_ERROR, TURN + i] = meanwhile + heading
        to[PHI_ERROR, ANGLE + i] = tilt * (across + tilt * meanwhile)
        to[THETA_ERROR, ANGLE + i] = tilt * ((heading if i != 1 else 0.0) + tilt_true * meanwhile)
    c[Q_TURNS], c[R_TURNS], c[HEADS] = h * q, h * r, h * (q * np.sin(phi) + r * np.cos(phi))
    fill_flow_reach(step, since, V, p, q, r)
    speeds_up = np.log(max(signal[AIRSPEED], 1.0) / V)
    to[AIRSPEED_ERROR, DENSITY], c[FASTER] = 2.0 * abs(speeds_up), 2.0 * speeds_up


@kernel
def fill_flow_reach(step, since, V, p, q, r):
    """The same of flow and climb, at V m/s and rates p, q, r rad/s."""
    then, h, s, g = step.memory.then, step.config.h, step.memory.acceleration, step.config.gravity
    to, c = since.reach, since.coupling
    sa, ca, sb, cb = np.sin(then[ALPHA]), np.cos(then[ALPHA]), np.sin(then[BETA]), np.cos(then[BETA])
    sp, cp, st, ct = np.sin(then[PHI]), np.cos(then[PHI]), np.sin(then[THETA]), np.cos(then[THETA])
    slip, wide = abs(then[BETA]), abs(then[BETA]) + angle_of_chord(since.off[BETA_ERROR])
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
        1.0 - min(since.off[AIRSPEED_ERROR], 1.0 - 1.0 / MAX_READING_RATIO)
    )
    to[PHI_ERROR, CLIMB] = h * V * ct * np.hypot(sb, sa * cb)
    to[THETA_ERROR, CLIMB] = h * V
    c[G_DOWN], c[G_ASIDE] = h * g * ct * cp, h * g * ct * sp
    nose = abs(then[THETA])  # the difference of two pitch angles is felt across the one between them
    c[G_AHEAD] = (
        h * g * np.cos(min(nose + 0.5 * angle_of_chord(since.off[THETA_ERROR]), 0.5 * nose + 0.25 * np.pi))
    )
    steep = abs(np.arctan2(st, cp * ct) - then[ALPHA]) + 0.5 * angle_of_chord(since.off[ALPHA_ERROR])
    c[CLIMBS] = h * V * cb * flat * np.cos(min(steep, 0.5 * np.pi))
    c[ROLLS], c[YAWS] = h * roll, h * yaw
    c[BESIDE_ALPHA] = h * abs(sb) * pull / V
    c[BESIDE_BETA] = h * np.sin(min(wide, 0.5 * np.pi)) * aslant * aslant_true * abs(normal) / V
    c[PULLS], c[PUSHES] = h * normal * aslant / V, h * aside / V


@kernel
def filter_reach(step, since):
    """Pass reach and coupling through the filters."""
    for i in range(N_INITIAL):
        for t in range(RPM):
            for m in range(step.config.decay.size):
                since.reached[i, t, m] = step.config.decay[m] * since.reached[i, t, m] + since.reach[i, t]
    for j in range(since.coupling.size):
        for m in range(step.config.decay.size):
            since.coupled[j, m] = step.config.decay[m] * since.coupled[j, m] + since.coupling[j]


@kernel
def largest_error_part(step, t, m):
    """What an error may have added to test t through filter m, at most."""
    return abs(step.test[t].filtered[m]) + step.test[t].bound[m]


@kernel
def current_error_part(step, since, i, t, m):
    """What the error that hypothesis i has now has added to test t through filter m, at most: what is there,
    and what the error was less or more by while the filter residual_sum it."""
    return largest_error_part(step, t, m) + 2.0 * since.changed[i] * since.reached[i, t, m]


@kernel
def tighten_by(since, i, shown, coupling):
    """An error that adds at least `coupling` a unit has added no more than `shown`."""
    if coupling > 0.0:
        since.off[i] = min(since.off[i], shown / (COUPLING_SHARE * coupling))


@kernel
def velocity_error_part(step, since, i, m):
    """The same of the velocity, m/s, whatever its direction."""
    V = max(step.memory.then[AIRSPEED], 1.0)
    flow = np.hypot(
        current_error_part(step, since, i, ALPHA_FLOW, m), current_error_part(step, since, i, BETA_FLOW, m)
    )
    return np.hypot(current_error_part(step, since, i, SPEED, m), V * flow)


@kernel
def turn_error_part(step, since, i, m):
    """The same of the turning about the axes other than the body's first."""
    return np.hypot(
        current_error_part(step, since, i, TURN + 1, m), current_error_part(step, since, i, TURN + 2, m)
    )


@kernel
def tighten_errors(step, since):
    """Bring down how far each may be off."""
    for m in range(step.config.decay.size):
        c = since.coupled[:, m]
        tighten_by(
            since, PHI_ERROR, turn_error_part(step, since, PHI_ERROR, m), np.hypot(c[Q_TURNS], c[R_TURNS])
        )
        tighten_by(
            since, PHI_ERROR, velocity_error_part(step, since, PHI_ERROR, m), np.hypot(c[G_DOWN], c[G_ASIDE])
        )
        tighten_by(since, THETA_ERROR, velocity_error_part(step, since, THETA_ERROR, m), c[G_AHEAD])
        about = np.hypot(
            current_error_part(step, since, THETA_ERROR, TURN, m),
            turn_error_part(step, since, THETA_ERROR, m),
        )
        tighten_by(since, THETA_ERROR, about, abs(c[HEADS]))
        tighten_vanes(step, since, m)
        tighten_speed(step, since, m)


@kernel
def tighten_vanes(step, since, m):
    """The same of incidence and sideslip."""
    c, half = since.coupled[:, m], 0.5 * angle_of_chord(since.off[ALPHA_ERROR])
    rolled = np.cos(half) * abs(c[ROLLS]) - np.sin(half) * abs(c[YAWS]) - c[BESIDE_ALPHA]
    tighten_by(since, ALPHA_ERROR, current_error_part(step, since, ALPHA_ERROR, CLIMB, m), c[CLIMBS])
    tighten_by(since, ALPHA_ERROR, current_error_part(step, since, ALPHA_ERROR, BETA_FLOW, m), rolled)
    rolled = np.cos(0.5 * angle_of_chord(since.off[BETA_ERROR])) * abs(c[ROLLS]) - c[BESIDE_BETA]
    tighten_by(since, BETA_ERROR, current_error_part(step, since, BETA_ERROR, ALPHA_FLOW, m), rolled)


@kernel
def tighten_speed(step, since, m):
    """The same of the airspeed. Bounds of the flow are for one that is right; the density shows its changes,
    and so does its own test: a scale error is in both alike."""
    c, slower = since.coupled[:, m], 1.0 + since.off[AIRSPEED_ERROR]
    tighten_by(
        since,
        AIRSPEED_ERROR,
        slower * current_error_part(step, since, AIRSPEED_ERROR, ALPHA_FLOW, m),
        abs(c[PULLS]),
    )
    tighten_by(
        since,
        AIRSPEED_ERROR,
        slower * current_error_part(step, since, AIRSPEED_ERROR, BETA_FLOW, m),
        abs(c[PUSHES]),
    )
    changes = 2.0 * slower * largest_error_part(step, SPEED, m) / max(step.memory.then[AIRSPEED], 1.0)
    tighten_by(
        since,
        AIRSPEED_ERROR,
        current_error_part(step, since, AIRSPEED_ERROR, DENSITY, m) + changes,
        abs(c[FASTER]),
    )


@kernel
def update_initial_errors(step, since, signal):
    """Bring all this to the look whose readings (N_SENSORS,) have just been tested."""
    if steepest_pitch_angle(step, signal) > STEEPEST_RAD:  # turning is not tested
        since.coupled[:] = 0.0
        return
    bound_changes(step, since)
    fill_reach(step, since, signal)
    filter_reach(step, since)
    tighten_errors(step, since)


@kernel
def exceeds_initial_error(step, since, i, t):
    """Whether test t is further beyond its bound than a first error of hypothesis i could make it."""
    test, off = step.test[t], since.off[i] + since.changed[i]
    if t >= RPM:
        return test.share > 1.0
    room = 1.0 + (off if i == AIRSPEED_ERROR and t >= SPEED else 0.0)
    for m in range(step.config.decay.size):
        if abs(test.filtered[m]) > room * test.bound[m] + off * since.reached[i, t, m]:
            return True
    return False


@kernel
def hold_errors_at_alarm(since):
    """Keep how far each was off before the alarm: what shows afterwards may be another's."""
    since.held[:] = since.off


@kernel
def held_error_part(since, i, t, m):
    """What the error that hypothesis i had at the alarm adds to test t through filter m, at most."""
    return since.held[i] * since.reached[i, t, m]


@kernel
def record_refuted(step, since, fired):
    """Since the alarm: note the tests, of those that have `fired`, that a first error does not explain."""
    for i in range(N_INITIAL):
        for t in range(fired.size):
            if fired[t] and not since.refuted[i, t] and exceeds_initial_error(step, since, i, t):
                since.refuted[i, t] = 1


@kernel
def moves_with(i, t):
    """Whether test t moves at once when the error of hypothesis i does."""
    if i in (PHI_ERROR, THETA_ERROR):
        return t < ANGLE or t == own_test(i)
    return t == own_test(i) or (i == AIRSPEED_ERROR and t == DENSITY)


@kernel
def initial_error_explains(since, i, lead):
    """Whether what has shown since the alarm, led by test `lead`, may be the first error of hypothesis i, and
    one that moves. Where its moves show in `lead`, those are for sensor_monitor.py: here it has not moved."""
    for t in range(since.refuted.shape[1]):
        if since.refuted[i, t] and (moves_with(i, lead) or not moves_with(i, t)):
            return False
    return True
