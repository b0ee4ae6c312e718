"""Which instruments may have been broken when the monitor began, and what that can do to its tests.

A reading that was off by a constant from the first look on has leapt in no test of its own: it shows through
the kinematics of the others alone, in tests that are held to be theirs. For each reading that others are
predicted from, on the hypothesis that it alone is broken,

    off        how far it can still be off: at first as far as an aircraft flies, from then on
                   off <= (|residual| + bound) / coupling         for each filter of a test it is coupled to
    changed    what it may have moved by since: what its own test shows, and that test's bound; it adds to off
    reach      how much a unit of its error adds to each test's residual in a look, at most
    reached    the same through the filters

A test beyond bound + (off + changed) reached refutes the hypothesis: a residual is the sum of what sound
instruments make, at most bound, and of what the error makes, at most the rest. So the broken instrument is
never ruled out by what its first error does, of whatever size. Where instruments.py rules one out by what it
would do from now on, bound + off reached is in the place of the bound.

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

Gyros need none of it: all of a gyro's error is in the test of its own axis at every look. Nor does the
dynamic pressure: nothing but the density shows it.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.redundancy import STEEPEST_RAD, steepest
from beaver_ftc.diagnosis.monitors.sensor_records import (
    AIRSPEED,
    ALPHA,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    OF_ALPHA,
    OF_BETA,
    OF_PHI,
    OF_SPEED,
    OF_THETA,
    QDYN,
    RPM,
    SPEED,
    STARTERS,
    THETA,
    TURN,
)
from beaver_ftc.plant.instruments import ALTITUDE, PHI

SIDEWAYS_RAD = 0.7  # no aircraft whose attitude and flow are followed flies at more, to either side
TIMES = 10.0  # what is read may be so many times the truth, or a part of it
WEATHER = 0.25  # share by which the air is thicker or thinner than the standard has it at a height
STEADY = 0.8  # share of a coupling that is left when speed and flow have changed within a filter's memory
SLOW = 2  # of monitor.POLES_PER_S

# Couplings that are followed with their sign
Q_TURNS, R_TURNS, G_DOWN, G_ASIDE, G_AHEAD, CLIMBS, ROLLS, YAWS, BESIDE_ALPHA, BESIDE_BETA = range(10)
PULLS, PUSHES, FASTER, HEADS = range(10, 14)


@kernel
def angle_of(size):
    """The angle whose 2 sin(angle / 2) this is, rad."""
    return 2.0 * np.arcsin(min(0.5 * size, 1.0))


@kernel
def size_of(angle):
    """2 sin(angle / 2), of no more than half a turn."""
    return 2.0 * np.sin(0.5 * min(abs(angle), np.pi))


@kernel
def density(altitude):
    """Of the standard troposphere, kg/m3."""
    return 1.225 * max(1.0 - 2.25577e-5 * altitude, 0.05) ** 4.2559


@kernel
def begin(since, signal):
    """With the first look at readings (N_SENSORS,) each may be off as far as an aircraft may fly."""
    since.first[OF_ALPHA] = size_of(abs(signal[ALPHA]) + SIDEWAYS_RAD)
    since.first[OF_BETA] = size_of(abs(signal[BETA]) + SIDEWAYS_RAD)
    # the airspeed that the dynamic pressure and the height leave
    V = max(signal[AIRSPEED], 1.0)
    true = np.sqrt(2.0 * max(signal[QDYN], 1.0) / density(signal[ALTITUDE]))
    faster, slower = V / true * np.sqrt(1.0 + WEATHER), V / true * np.sqrt(1.0 - WEATHER)
    since.first[OF_SPEED] = min(max(faster - 1.0, 1.0 - slower), TIMES - 1.0)
    since.first[OF_PHI] = since.first[OF_THETA] = 2.0
    since.off[:] = since.first


@kernel
def own_test(i):
    """The test that shows at once by how much the error of hypothesis i has changed."""
    return (ALPHA_FLOW, BETA_FLOW, SPEED, ANGLE, ANGLE + 1)[i]


@kernel
def bound_changes(step, since):
    """By how much each may have moved: within the slowest filter's memory, and what that has forgotten."""
    for i in range(STARTERS):
        changed = most(step, own_test(i), SLOW) + since.off[i] * since.reached[i, own_test(i), SLOW]
        if i == OF_SPEED:
            changed *= (1.0 + since.off[i]) / max(step.memory.then[AIRSPEED], 1.0)
        since.changed[i] = min(changed, since.first[i])
        grown = since.off[i] + (1.0 - step.config.decay[SLOW]) * since.changed[i]
        since.off[i] = min(grown, since.first[i])


@kernel
def reach(step, since, signal):
    """Fill reach (STARTERS, RPM): what a unit of each error adds to a residual in this look, at most; and
    `coupling`: what it adds, with its sign. Of the look before, from which this one was predicted."""
    then, h = step.memory.then, step.config.h
    p, q, r = then[0], then[1], then[2]
    V, phi, theta = max(then[AIRSPEED], 1.0), then[PHI], then[THETA]
    to, c = since.reach, since.coupling
    to[:] = 0.0
    # the attitude, by turning; of the second order in h what turns meanwhile
    tilt = 1.0 / np.cos(min(abs(theta), STEEPEST_RAD))
    tilt_true = 1.0 / np.cos(min(abs(theta) + angle_of(since.off[OF_THETA]), STEEPEST_RAD))
    meanwhile = (h * (abs(p) + abs(q) + abs(r))) ** 2
    across, heading = h * np.hypot(q, r), h * abs(q * np.sin(phi) + r * np.cos(phi)) * tilt_true
    for i in range(3):
        to[OF_PHI, TURN + i] = meanwhile + (across if i > 0 else 0.0)
        to[OF_THETA, TURN + i] = meanwhile + heading
        to[OF_PHI, ANGLE + i] = tilt * (across + tilt * meanwhile)
        to[OF_THETA, ANGLE + i] = tilt * ((heading if i != 1 else 0.0) + tilt_true * meanwhile)
    c[Q_TURNS], c[R_TURNS], c[HEADS] = h * q, h * r, h * (q * np.sin(phi) + r * np.cos(phi))
    reach_flow(step, since, V, p, q, r)
    speeds_up = np.log(max(signal[AIRSPEED], 1.0) / V)
    to[OF_SPEED, DENSITY], c[FASTER] = 2.0 * abs(speeds_up), 2.0 * speeds_up


@kernel
def reach_flow(step, since, V, p, q, r):
    """The same of flow and climb, at V m/s and rates p, q, r rad/s."""
    then, h, s, g = step.memory.then, step.config.h, step.memory.acceleration, step.config.gravity
    to, c = since.reach, since.coupling
    sa, ca, sb, cb = np.sin(then[ALPHA]), np.cos(then[ALPHA]), np.sin(then[BETA]), np.cos(then[BETA])
    sp, cp, st, ct = np.sin(then[PHI]), np.cos(then[PHI]), np.sin(then[THETA]), np.cos(then[THETA])
    slip, wide = abs(then[BETA]), abs(then[BETA]) + angle_of(since.off[OF_BETA])
    aslant, aslant_true = 1.0 / np.cos(min(slip, STEEPEST_RAD)), 1.0 / np.cos(min(wide, STEEPEST_RAD))
    normal, pull = s[2] * ca - s[0] * sa, max(step.memory.size, np.sqrt(s[0] ** 2 + s[1] ** 2 + s[2] ** 2))
    aside = s[1] * cb - (s[0] * ca + s[2] * sa) * sb
    roll, yaw = p * ca + r * sa, p * sa - r * ca
    coarse = h * (1.0 + h * (pull / V + abs(p) + abs(q) + abs(r)))
    rates, climbed = np.hypot(p, r), step.memory.predicted[ALTITUDE] - then[ALTITUDE]
    to[OF_ALPHA, SPEED] = to[OF_BETA, SPEED] = coarse * pull
    to[OF_ALPHA, ALPHA_FLOW] = coarse * aslant * (pull / V + rates * abs(sb))
    to[OF_ALPHA, BETA_FLOW] = coarse * (rates + pull * abs(sb) / V)
    to[OF_BETA, ALPHA_FLOW] = coarse * aslant * aslant_true * (abs(roll) + pull / V)
    to[OF_BETA, BETA_FLOW] = coarse * pull / V
    to[OF_SPEED, ALPHA_FLOW] = to[OF_SPEED, BETA_FLOW] = coarse * aslant * pull / V
    to[OF_PHI, SPEED] = coarse * g * ct * np.hypot(sb, sa * cb)
    to[OF_PHI, ALPHA_FLOW] = to[OF_PHI, BETA_FLOW] = coarse * g * ct * aslant / V
    to[OF_THETA, SPEED], to[OF_THETA, ALPHA_FLOW] = coarse * g, coarse * aslant * g / V
    to[OF_THETA, BETA_FLOW] = coarse * g * (abs(sp) + abs(sb)) / V
    flat = np.hypot(st, cp * ct)
    to[OF_ALPHA, CLIMB] = h * V * cb * flat
    to[OF_BETA, CLIMB] = h * V * np.hypot(ca * st - sa * cp * ct, sp * ct)
    to[OF_SPEED, CLIMB] = abs(climbed) / (1.0 - min(since.off[OF_SPEED], 1.0 - 1.0 / TIMES))
    to[OF_PHI, CLIMB] = h * V * ct * np.hypot(sb, sa * cb)
    to[OF_THETA, CLIMB] = h * V
    c[G_DOWN], c[G_ASIDE] = h * g * ct * cp, h * g * ct * sp
    nose = abs(then[THETA])  # the difference of two pitch angles is felt across the one between them
    c[G_AHEAD] = h * g * np.cos(min(nose + 0.5 * angle_of(since.off[OF_THETA]), 0.5 * nose + 0.25 * np.pi))
    steep = abs(np.arctan2(st, cp * ct) - then[ALPHA]) + 0.5 * angle_of(since.off[OF_ALPHA])
    c[CLIMBS] = h * V * cb * flat * np.cos(min(steep, 0.5 * np.pi))
    c[ROLLS], c[YAWS] = h * roll, h * yaw
    c[BESIDE_ALPHA] = h * abs(sb) * pull / V
    c[BESIDE_BETA] = h * np.sin(min(wide, 0.5 * np.pi)) * aslant * aslant_true * abs(normal) / V
    c[PULLS], c[PUSHES] = h * normal * aslant / V, h * aside / V


@kernel
def accumulate(step, since):
    """Pass reach and coupling through the filters."""
    for i in range(STARTERS):
        for t in range(RPM):
            for m in range(step.config.decay.size):
                since.reached[i, t, m] = step.config.decay[m] * since.reached[i, t, m] + since.reach[i, t]
    for j in range(since.coupling.size):
        for m in range(step.config.decay.size):
            since.coupled[j, m] = step.config.decay[m] * since.coupled[j, m] + since.coupling[j]


@kernel
def most(step, t, m):
    """What an error may have added to test t through filter m, at most."""
    return abs(step.test[t].filtered[m]) + step.test[t].bound[m]


@kernel
def shown(step, since, i, t, m):
    """What the error that hypothesis i has now has added to test t through filter m, at most: what is there,
    and what the error was less or more by while the filter residual_sum it."""
    return most(step, t, m) + 2.0 * since.changed[i] * since.reached[i, t, m]


@kernel
def tighten_by(since, i, shown, coupling):
    """An error that adds at least `coupling` a unit has added no more than `shown`."""
    if coupling > 0.0:
        since.off[i] = min(since.off[i], shown / (STEADY * coupling))


@kernel
def pulled(step, since, i, m):
    """The same of the velocity, m/s, whatever its direction."""
    V = max(step.memory.then[AIRSPEED], 1.0)
    flow = np.hypot(shown(step, since, i, ALPHA_FLOW, m), shown(step, since, i, BETA_FLOW, m))
    return np.hypot(shown(step, since, i, SPEED, m), V * flow)


@kernel
def turned(step, since, i, m):
    """The same of the turning about the axes other than the body's first."""
    return np.hypot(shown(step, since, i, TURN + 1, m), shown(step, since, i, TURN + 2, m))


@kernel
def narrow(step, since):
    """Bring down how far each may be off."""
    for m in range(step.config.decay.size):
        c = since.coupled[:, m]
        tighten_by(since, OF_PHI, turned(step, since, OF_PHI, m), np.hypot(c[Q_TURNS], c[R_TURNS]))
        tighten_by(since, OF_PHI, pulled(step, since, OF_PHI, m), np.hypot(c[G_DOWN], c[G_ASIDE]))
        tighten_by(since, OF_THETA, pulled(step, since, OF_THETA, m), c[G_AHEAD])
        about = np.hypot(shown(step, since, OF_THETA, TURN, m), turned(step, since, OF_THETA, m))
        tighten_by(since, OF_THETA, about, abs(c[HEADS]))
        tighten_vanes(step, since, m)
        tighten_speed(step, since, m)


@kernel
def tighten_vanes(step, since, m):
    """The same of incidence and sideslip."""
    c, half = since.coupled[:, m], 0.5 * angle_of(since.off[OF_ALPHA])
    rolled = np.cos(half) * abs(c[ROLLS]) - np.sin(half) * abs(c[YAWS]) - c[BESIDE_ALPHA]
    tighten_by(since, OF_ALPHA, shown(step, since, OF_ALPHA, CLIMB, m), c[CLIMBS])
    tighten_by(since, OF_ALPHA, shown(step, since, OF_ALPHA, BETA_FLOW, m), rolled)
    rolled = np.cos(0.5 * angle_of(since.off[OF_BETA])) * abs(c[ROLLS]) - c[BESIDE_BETA]
    tighten_by(since, OF_BETA, shown(step, since, OF_BETA, ALPHA_FLOW, m), rolled)


@kernel
def tighten_speed(step, since, m):
    """The same of the airspeed. Bounds of the flow are for one that is right; the density shows its changes,
    and so does its own test: a scale error is in both alike."""
    c, slower = since.coupled[:, m], 1.0 + since.off[OF_SPEED]
    tighten_by(since, OF_SPEED, slower * shown(step, since, OF_SPEED, ALPHA_FLOW, m), abs(c[PULLS]))
    tighten_by(since, OF_SPEED, slower * shown(step, since, OF_SPEED, BETA_FLOW, m), abs(c[PUSHES]))
    changes = 2.0 * slower * most(step, SPEED, m) / max(step.memory.then[AIRSPEED], 1.0)
    tighten_by(since, OF_SPEED, shown(step, since, OF_SPEED, DENSITY, m) + changes, abs(c[FASTER]))


@kernel
def follow(step, since, signal):
    """Bring all this to the look whose readings (N_SENSORS,) have just been tested."""
    if steepest(step, signal) > STEEPEST_RAD:  # turning is not tested
        since.coupled[:] = 0.0
        return
    bound_changes(step, since)
    reach(step, since, signal)
    accumulate(step, since)
    narrow(step, since)


@kernel
def beyond(step, since, i, t):
    """Whether test t is further beyond its bound than a first error of hypothesis i could make it."""
    test, off = step.test[t], since.off[i] + since.changed[i]
    if t >= RPM:
        return test.share > 1.0
    room = 1.0 + (off if i == OF_SPEED and t >= SPEED else 0.0)
    for m in range(step.config.decay.size):
        if abs(test.filtered[m]) > room * test.bound[m] + off * since.reached[i, t, m]:
            return True
    return False


@kernel
def hold(since):
    """Keep how far each was off before the alarm: what shows afterwards may be another's."""
    since.held[:] = since.off


@kernel
def hidden(since, i, t, m):
    """What the error that hypothesis i had at the alarm adds to test t through filter m, at most."""
    return since.held[i] * since.reached[i, t, m]


@kernel
def record_refuted(step, since, fired):
    """Since the alarm: note the tests, of those that have `fired`, that a first error does not explain."""
    for i in range(STARTERS):
        for t in range(fired.size):
            if fired[t] and not since.refuted[i, t] and beyond(step, since, i, t):
                since.refuted[i, t] = 1


@kernel
def moves(i, t):
    """Whether test t moves at once when the error of hypothesis i does."""
    if i in (OF_PHI, OF_THETA):
        return t < ANGLE or t == own_test(i)
    return t == own_test(i) or (i == OF_SPEED and t == DENSITY)


@kernel
def explains(since, i, lead):
    """Whether what has shown since the alarm, led by test `lead`, may be the first error of hypothesis i, and
    one that moves. Where its moves show in `lead`, those are for instruments.py: here it has not moved."""
    for t in range(since.refuted.shape[1]):
        if since.refuted[i, t] and (moves(i, lead) or not moves(i, t)):
            return False
    return True
