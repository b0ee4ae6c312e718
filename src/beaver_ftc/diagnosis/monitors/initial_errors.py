"""Errors that sensors have had since the monitor began: bounds on them, and on their effect on its tests.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. There is one hypothesis for each
reading from which others are predicted (alpha, beta, airspeed, phi, theta): that this sensor alone is broken.
The error x of the sensor is counted as

    alpha, beta, phi, theta    x = 2 sin((reading - truth) / 2): by so much the angle turns a unit vector
    airspeed                   x = reading / truth - 1

Of each hypothesis h the record holds, for test j and filter pole m,

    H    bound on |effect on residual j in one sample| / |x|
    H_m  the same through the filter, H_m <- a_m H_m + H
    C    lower bound, with sign, on the effect of a unit of x in one sample; C_m the same through the filter
    e    bound on |x|. At the first sample it is as large as an aircraft can fly (e_start). Then, at each
         sample,
             e <- min(e + (1 - a_slow) d, e_start)
         and for each test, or pair of tests, that couples with the error
             e <- min(e, (r + B + 2 d H_m) / (EFFECT_LEFT C_m))
    d    bound on the change of x within the memory of the slowest filter,
             d = min(r + B + e H_m, e_start)
         of the test that a change of x moves at once; for the airspeed r + B + e H_m times (1 + e) / V

r: |filtered residual|; B: bound on it for sound sensors; a_m: decay of the filter per sample; h also the time
between two samples, s, in the formulas of the effects. Of several tests r + B + 2 d H_m is the root of the
sum of squares. For the airspeed it counts 1 + e times in the tests of flow; in that of the density
2 (1 + e) / V times r + B of SPEED is added to it. A test refutes a hypothesis with

    r > B + (e + d) H_m
    r > (1 + e + d) B + (e + d) H_m     for the airspeed, in SPEED and the tests after it

since a residual is the sum of the effect of sound sensors, at most B, and of the effect of the error. So an
error from the start, of any size, never excludes the broken sensor. Where sensor_monitor.py excludes a sensor
by the effect that its error would have from now on, the limit is B + e_alarm H_m, e as of the alarm.

What each effect follows from (v m/s: velocity, V its length; a m/s2: acceleration, gravity g included; both
in body axes; p, q, r rad/s):

    attitude     with phi off, (q, r) is turned about the body's first axis; with theta off, the vertical
                 unit vector, about which the aircraft turns at psi'
    gravity      with phi off, its part g cos(theta) across the body's first axis is turned; with theta off,
                 all of it; both in a, and so in SPEED, ALPHA_FLOW and BETA_FLOW
    SPEED        V' = a . v / V
    ALPHA_FLOW   alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
                          + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    BETA_FLOW    beta' = p sin(alpha) - r cos(alpha)
                         + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    DENSITY      log(density) = log(2 qdyn) - 2 log V: log V changes by (1 + x) times what its reading shows,
                 if the error of the airspeed is a constant in m/s
    CLIMB        altitude' = V (cos(beta) (cos(alpha) sin(theta) - sin(alpha) cos(phi) cos(theta))
                                - sin(beta) sin(phi) cos(theta))

Gyros need no such hypothesis: all of a gyro's error is in the test of its own axis in every sample. Neither
does the dynamic pressure: only the density shows it.

red: record of the tests (redundancy.py, which says y and y_past); ini: record of the hypotheses.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    ANGLE_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    H_THETA,
    MIN_AIRSPEED_MPS,
    MIN_QDYN_PA,
    N_EFFECTS,
    N_INITIAL,
    QDYN,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    TURN_TEST,
    down,
    secant,
    too_steep,
    vector_length,
)
from beaver_ftc.plant.instruments import ALTITUDE, PHI

MAX_FLOW_ANGLE_RAD = 0.7  # an aircraft whose attitude and flow are tested flies at less, to either side
MAX_SPEED_RATIO = 10.0  # largest reading / truth of an airspeed, and largest truth / reading
MAX_CHORD = 2.0  # of 2 sin(error / 2): an attitude may be off by half a turn
DENSITY_SHARE = 0.25  # of the density from the standard atmosphere at a height, as a share of it
MIN_TEMPERATURE_RATIO = 0.05  # temperature over that at sea level, below which none is extrapolated
# Share of an effect that is left, at least, when speed and flow have changed within a filter's memory
EFFECT_LEFT = 0.8
SLOW_POLE = 2  # index in redundancy.FILTER_POLES_PER_S

# Places in C. Two of them, at right angles, make the effect of phi on the attitude, and on the velocity. The
# reading that is off comes first; VANE: of alpha and of beta.
(
    PHI_Q,  # h q
    PHI_R,  # h r
    PHI_DOWN,  # h g cos(theta) cos(phi)
    PHI_SIDE,  # h g cos(theta) sin(phi)
    THETA_G,  # h g cos(largest mean of reading and truth)
    # h V cos(beta) |(sin(theta), cos(phi) cos(theta))| cos(largest mean of an angle)
    ALPHA_CLIMB,
    VANE_ROLL,  # h (p cos(alpha) + r sin(alpha))
    VANE_YAW,  # h (p sin(alpha) - r cos(alpha))
    # of the effect of alpha on BETA_FLOW, of beta on ALPHA_FLOW: bound on the part of the force
    ALPHA_FORCE,
    BETA_FORCE,
    SPEED_ALPHA,  # h (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    # h (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    SPEED_BETA,
    SPEED_DENSITY,  # 2 (log V - log V before)
    THETA_TURN,  # h (q sin(phi) + r cos(phi)) = h psi' cos(theta)
) = range(14)


@kernel
def angle_of_chord(x):
    """The angle, rad, with 2 sin(angle / 2) = x; half a turn for x > 2."""
    return 2.0 * np.arcsin(min(0.5 * x, 1.0))


@kernel
def chord_of_angle(angle):
    """2 sin(|angle| / 2) of an angle, rad; of more than half a turn as of half a turn."""
    return 2.0 * np.sin(0.5 * min(abs(angle), np.pi))


@kernel
def standard_density(h):
    """Density of the standard troposphere, kg/m3, at the height h m."""
    T = max(1.0 - 2.25577e-5 * h, MIN_TEMPERATURE_RATIO)
    return 1.225 * T**4.2559


@kernel
def start_bounds(ini, y):
    """e_start: bound each error at the first sample: an aircraft can fly at the truth.

    V_air: airspeed by dynamic pressure and height in the standard atmosphere, m/s; most, least: reading over
    truth in the thickest and in the thinnest air.
    """
    e = ini.e_start
    e[H_ALPHA] = chord_of_angle(abs(y[ALPHA]) + MAX_FLOW_ANGLE_RAD)
    e[H_BETA] = chord_of_angle(abs(y[BETA]) + MAX_FLOW_ANGLE_RAD)
    V_air = np.sqrt(2.0 * max(y[QDYN], MIN_QDYN_PA) / standard_density(y[ALTITUDE]))
    ratio = max(y[AIRSPEED], MIN_AIRSPEED_MPS) / V_air
    most, least = ratio * np.sqrt(1.0 + DENSITY_SHARE), ratio * np.sqrt(1.0 - DENSITY_SHARE)
    e[H_AIRSPEED] = min(max(most - 1.0, 1.0 - least), MAX_SPEED_RATIO - 1.0)
    e[H_PHI] = e[H_THETA] = MAX_CHORD
    ini.e[:] = e


@kernel
def change_test(h):
    """The test whose residual is, at once, the change of the error of a hypothesis."""
    return (ALPHA_TEST, BETA_TEST, SPEED_TEST, ANGLE_TEST, ANGLE_TEST + 1)[h]


@kernel
def widen_bounds(red, ini):
    """Update d, and widen e by the part of it that the slowest filter forgets in a sample."""
    lost = 1.0 - red.config.decay[SLOW_POLE]
    for i in range(N_INITIAL):
        j = change_test(i)
        d = allowed_effect(red, j, SLOW_POLE) + ini.e[i] * ini.H_m[i, j, SLOW_POLE]
        if i == H_AIRSPEED:  # from m/s to a share of the truth, which is at least V / (1 + e)
            d *= (1.0 + ini.e[i]) / max(red.memory.y_past[AIRSPEED], MIN_AIRSPEED_MPS)
        ini.d[i] = min(d, ini.e_start[i])
        ini.e[i] = min(ini.e[i] + lost * ini.d[i], ini.e_start[i])


@kernel
def fill_effects(red, ini, y):
    """Fill H (N_INITIAL, RPM_TEST) and C (N_EFFECTS,), taken at the sample before, from which y is
    predicted.
    """
    y_past, h, H, C = red.memory.y_past, red.config.sample_time_s, ini.H, ini.C
    p, q, r = y_past[0], y_past[1], y_past[2]
    V = max(y_past[AIRSPEED], MIN_AIRSPEED_MPS)
    # 1 / cos(theta) by its reading, and the largest one if theta is off
    sec = secant(y_past[THETA])
    sec_max = secant(abs(y_past[THETA]) + angle_of_chord(ini.e[H_THETA]))
    second = (h * (abs(p) + abs(q) + abs(r))) ** 2  # rad2: the axes turn during the step
    # Rotation in a step, rad: about the body's second and third axes; about the vertical, psi' h
    C[PHI_Q] = h * q
    C[PHI_R] = h * r
    C[THETA_TURN] = h * (q * np.sin(y_past[PHI]) + r * np.cos(y_past[PHI]))
    qr = h * np.hypot(q, r)
    heading = abs(C[THETA_TURN]) * sec_max
    for i in range(3):
        # Body axes. phi off by e: (q, r) is turned by e about the first axis, which changes it by
        # 2 sin(e / 2) |(q, r)|. theta off: the vertical, about which the aircraft turns at psi', likewise.
        H[H_PHI, TURN_TEST + i] = second + (qr if i > 0 else 0.0)
        H[H_THETA, TURN_TEST + i] = second + heading
        # Angles. phi off: no Euler angle changes by more than the body turns over cos(theta). theta off by e:
        # phi' = p + m tan(theta), psi' = m / cos(theta), with m = q sin(phi) + r cos(phi). The tangents, or
        # secants, of reading and truth differ by at most 2 sin(e / 2) over both cosines; in
        # theta' = q cos(phi) - r sin(phi) there is no theta.
        H[H_PHI, ANGLE_TEST + i] = sec * (qr + sec * second)
        H[H_THETA, ANGLE_TEST + i] = sec * ((heading if i != 1 else 0.0) + sec_max * second)
    fill_flow_effects(red, ini, V, p, q, r)
    # log V changes by (1 + x) times the change of the reading's logarithm: the density, with -2 log V, by x
    # times twice that.
    C[SPEED_DENSITY] = 2.0 * np.log(max(y[AIRSPEED], MIN_AIRSPEED_MPS) / V)
    H[H_AIRSPEED, DENSITY_TEST] = abs(C[SPEED_DENSITY])


@kernel
def fill_flow_effects(red, ini, V, p, q, r):
    """Fill H and C for the tests of speed, flow and climb, and by gravity.

    V m/s; p, q, r rad/s: of the sample before. h2: h times 1 + h (|a| / V + |p| + |q| + |r|), the second
    order in h. sa, ca, sb, cb, ct: sines and cosines of alpha, beta, theta; d0, d1, d2: the vertical. x: the
    error of the row's hypothesis.
    """
    M, h, g, H, C = red.memory, red.config.sample_time_s, red.config.g, ini.H, ini.C
    y, a = M.y_past, M.a
    sa, ca = np.sin(y[ALPHA]), np.cos(y[ALPHA])
    sb, cb = np.sin(y[BETA]), np.cos(y[BETA])
    ct, (d0, d1, d2) = np.cos(y[THETA]), down(y)
    # the largest |beta| if beta is off; 1 / cos of it by its reading, and the largest one
    beta_max = abs(y[BETA]) + angle_of_chord(ini.e[H_BETA])
    sec, sec_max = secant(y[BETA]), secant(beta_max)
    # m/s2: a across the flow, downwards and sideways; bound on |a| in the step
    a_normal = a[2] * ca - a[0] * sa
    a_side = a[1] * cb - (a[0] * ca + a[2] * sa) * sb
    a_max = max(M.a_size[0], vector_length(a))
    # rad/s: rate about the flow's projection on the plane of symmetry; minus that about the axis across it
    roll, yaw = p * ca + r * sa, p * sa - r * ca
    h2 = h * (1.0 + h * (a_max / V + abs(p) + abs(q) + abs(r)))
    pr, n = np.hypot(p, r), a_max / V  # rad/s
    climb = M.predicted_reading[ALTITUDE] - y[ALTITUDE]
    vert, across = np.hypot(d0, d2), np.hypot(sb, sa * cb)
    # By row: SPEED, ALPHA_FLOW, BETA_FLOW, DENSITY, CLIMB.
    # alpha off: V' = a . v / V, the direction of v is turned by alpha and changes by x at most; in alpha'
    # (a_z, a_x) / (V cos(beta)) and tan(beta) (p, r) are turned by alpha, in beta' (p, r) and sin(beta)
    # (a_x, a_z) / V; in altitude' (cos(alpha), sin(alpha)), times V cos(beta), along (sin(theta), -cos(phi)
    # cos(theta))
    H[H_ALPHA, SPEED_TEST:] = (
        h2 * a_max,
        h2 * sec * (n + pr * abs(sb)),
        h2 * (pr + n * abs(sb)),
        0.0,
        h * V * cb * vert,
    )
    # beta off: V' likewise; in alpha' tangents, and secants, of reading and truth differ by x over both
    # cosines; in beta' a is turned by beta; in altitude' (cos(beta), -sin(beta)), times V
    H[H_BETA, SPEED_TEST:] = (
        h2 * a_max,
        h2 * sec * sec_max * (abs(roll) + n),
        h2 * n,
        0.0,
        h * V * np.hypot(ca * d0 + sa * d2, d1),
    )
    # V off: in alpha', beta' a / truth = (1 + x) a / reading; the true climb is the predicted one over 1 + x,
    # which differ by x / (1 + x) of the latter
    H[H_AIRSPEED, SPEED_TEST:] = (
        0.0,
        h2 * sec * n,
        h2 * sec * n,
        0.0,
        abs(climb) / (1.0 - min(ini.e[H_AIRSPEED], 1.0 - 1.0 / MAX_SPEED_RATIO)),
    )
    # phi off: a has the error x g cos(theta) across the body's first axis. V' takes its part along v, of
    # which |(sin(beta), sin(alpha) cos(beta))| lies there; alpha' and beta' take at most all of it. The
    # vertical's part cos(theta) is turned, against the part of v across the first axis
    H[H_PHI, SPEED_TEST:] = (
        h2 * g * ct * across,
        h2 * g * ct * sec / V,
        h2 * g * ct * sec / V,
        0.0,
        h * V * ct * across,
    )
    # theta off: a has the error x g, in the plane of the body's first axis and the vertical. V' and alpha'
    # take at most all of it, beta' the part sin(phi) along the second axis, and sin(beta) of the rest. The
    # vertical is turned, against v
    H[H_THETA, SPEED_TEST:] = (
        h2 * g,
        h2 * sec * g / V,
        h2 * g * (abs(np.sin(y[PHI])) + abs(sb)) / V,
        0.0,
        h * V,
    )
    # Signed effects. phi: the error of gravity across the first axis, exactly: g cos(theta) (sin(phi),
    # cos(phi)) is turned by the error
    C[PHI_DOWN] = h * g * d2
    C[PHI_SIDE] = h * g * d1
    # theta: along the first axis, g (sin(reading) - sin(truth)) = x g cos(mean of both). The mean is at most
    # half the error away from the reading, and at most (reading + a right angle) / 2
    pitch = abs(y[THETA])
    mean = min(pitch + 0.5 * angle_of_chord(ini.e[H_THETA]), 0.5 * pitch + 0.25 * np.pi)
    C[THETA_G] = h * g * np.cos(mean)
    # alpha: altitude' = V cos(beta) vert sin(gamma - alpha) + ..., where
    # tan(gamma) = tan(theta) / cos(phi). The sines of reading and truth differ by x cos(mean of gamma -
    # alpha)
    path = abs(np.arctan2(-d0, d2) - y[ALPHA]) + (0.5 * angle_of_chord(ini.e[H_ALPHA]))
    C[ALPHA_CLIMB] = h * V * cb * vert * np.cos(min(path, 0.5 * np.pi))
    # alpha off by e: beta' changes by x (roll cos(e / 2) + yaw sin(e / 2)). beta
    # off by e: alpha' changes by x cos(e / 2) roll over both cosines. The part of the force, of
    # either sign, is an uncertainty of both
    C[VANE_ROLL] = h * roll
    C[VANE_YAW] = h * yaw
    C[ALPHA_FORCE] = h * abs(sb) * n
    C[BETA_FORCE] = h * np.sin(min(beta_max, 0.5 * np.pi)) * sec * sec_max * abs(a_normal) / V
    # V: a across the flow, over the airspeed
    C[SPEED_ALPHA] = h * a_normal * sec / V
    C[SPEED_BETA] = h * a_side / V


@kernel
def filter_effects(red, ini):
    """H_m <- a_m H_m + H, and C_m <- a_m C_m + C."""
    a = red.config.decay
    for i in range(N_INITIAL):
        for j in range(RPM_TEST):
            leak(ini.H_m[i, j], a, ini.H[i, j])
    for n in range(N_EFFECTS):
        leak(ini.C_m[n], a, ini.C[n])


@kernel
def allowed_effect(red, j, m):
    """r + B: bound on the effect of any error on a test through a filter, in the unit of the residual."""
    test = red.test[j]
    return abs(test.r[m]) + test.B[m]


@kernel
def constant_effect(red, ini, h, j, m):
    """r + B + 2 d H_m: bound on the effect of the present error of hypothesis h, had it been constant, on a
    test through a filter. The error was up to d larger or smaller while the filter summed it.
    """
    return allowed_effect(red, j, m) + 2.0 * ini.d[h] * ini.H_m[h, j, m]


@kernel
def tighten(ini, h, most, c):
    """Lower e of hypothesis h, whose effect is at most `most`, and at least c a unit: e <- most / (0.8 c)."""
    if c > 0.0:
        ini.e[h] = min(ini.e[h], most / (EFFECT_LEFT * c))


@kernel
def velocity_effect(red, ini, h, m):
    """The bound of `constant_effect` on the velocity, m/s, in any direction."""
    V = max(red.memory.y_past[AIRSPEED], MIN_AIRSPEED_MPS)
    angle = np.hypot(constant_effect(red, ini, h, ALPHA_TEST, m), constant_effect(red, ini, h, BETA_TEST, m))
    return np.hypot(constant_effect(red, ini, h, SPEED_TEST, m), V * angle)


@kernel
def turn_effect(red, ini, h, m):
    """The bound of `constant_effect` on the rotation about the body's second and third axes, rad."""
    return np.hypot(
        constant_effect(red, ini, h, TURN_TEST + 1, m), constant_effect(red, ini, h, TURN_TEST + 2, m)
    )


@kernel
def tighten_all(red, ini):
    """Lower the bound on each error to what the tests allow, filter by filter."""
    for m in range(red.config.decay.size):
        C = ini.C_m[:, m]
        tighten(ini, H_PHI, turn_effect(red, ini, H_PHI, m), np.hypot(C[PHI_Q], C[PHI_R]))
        tighten(ini, H_PHI, velocity_effect(red, ini, H_PHI, m), np.hypot(C[PHI_DOWN], C[PHI_SIDE]))
        tighten(ini, H_THETA, velocity_effect(red, ini, H_THETA, m), C[THETA_G])
        turn = np.hypot(constant_effect(red, ini, H_THETA, TURN_TEST, m), turn_effect(red, ini, H_THETA, m))
        tighten(ini, H_THETA, turn, abs(C[THETA_TURN]))
        tighten_vanes(red, ini, m)
        tighten_airspeed(red, ini, m)


@kernel
def tighten_vanes(red, ini, m):
    """Lower the bounds on the errors of incidence and sideslip to what climb and flow allow."""
    C = ini.C_m[:, m]
    half = 0.5 * angle_of_chord(ini.e[H_ALPHA])
    c = np.cos(half) * abs(C[VANE_ROLL]) - np.sin(half) * abs(C[VANE_YAW]) - C[ALPHA_FORCE]
    tighten(ini, H_ALPHA, constant_effect(red, ini, H_ALPHA, CLIMB_TEST, m), C[ALPHA_CLIMB])
    tighten(ini, H_ALPHA, constant_effect(red, ini, H_ALPHA, BETA_TEST, m), c)
    c = np.cos(0.5 * angle_of_chord(ini.e[H_BETA])) * abs(C[VANE_ROLL]) - C[BETA_FORCE]
    tighten(ini, H_BETA, constant_effect(red, ini, H_BETA, ALPHA_TEST, m), c)


@kernel
def tighten_airspeed(red, ini, m):
    """Lower the bound on the error of the airspeed to what flow and density allow.

    The tests of the flow have bounds for a right airspeed: a true one that is 1 + e times smaller makes them
    larger by that. The density shows changes of the error in addition: those are in the airspeed's own test.
    """
    C = ini.C_m[:, m]
    ratio = 1.0 + ini.e[H_AIRSPEED]
    tighten(
        ini, H_AIRSPEED, ratio * constant_effect(red, ini, H_AIRSPEED, ALPHA_TEST, m), abs(C[SPEED_ALPHA])
    )
    tighten(ini, H_AIRSPEED, ratio * constant_effect(red, ini, H_AIRSPEED, BETA_TEST, m), abs(C[SPEED_BETA]))
    change = (
        2.0 * ratio * allowed_effect(red, SPEED_TEST, m) / max(red.memory.y_past[AIRSPEED], MIN_AIRSPEED_MPS)
    )
    tighten(
        ini,
        H_AIRSPEED,
        constant_effect(red, ini, H_AIRSPEED, DENSITY_TEST, m) + change,
        abs(C[SPEED_DENSITY]),
    )


@kernel
def update_bounds(red, ini, y):
    """Update all bounds by the sample y, which has just been tested."""
    if too_steep(red, y):
        ini.C_m[:] = 0.0
        return
    widen_bounds(red, ini)
    fill_effects(red, ini, y)
    filter_effects(red, ini)
    tighten_all(red, ini)


@kernel
def refutes_initial(red, ini, h, j):
    """Whether a test's residual is larger than sound sensors and the error of hypothesis h explain: for a
    pole m, r > factor B + x H_m, x = e + d. No hypothesis has an effect on the engine's tests and later
    ones.
    """
    test = red.test[j]
    x = ini.e[h] + ini.d[h]
    if j >= RPM_TEST:
        return test.ratio > 1.0
    factor = 1.0 + (x if h == H_AIRSPEED and j >= SPEED_TEST else 0.0)
    for m in range(red.config.decay.size):
        effect = x * ini.H_m[h, j, m]
        if abs(test.r[m]) > factor * test.B[m] + effect:
            return True
    return False


@kernel
def effect_at_alarm(ini, h, j, m):
    """e_alarm H_m: bound on the effect, on a test through a filter, of an error as large as that of
    hypothesis h could be at the alarm; in the unit of the residual.
    """
    return ini.e_alarm[h] * ini.H_m[h, j, m]


@kernel
def latch_refuted(red, ini, exceeded):
    """Record by which of `exceeded` (N_TESTS,) each hypothesis is refuted."""
    refuted = ini.refuted
    for i in range(N_INITIAL):
        for j in range(exceeded.size):
            if exceeded[j] and not refuted[i, j] and refutes_initial(red, ini, i, j):
                refuted[i, j] = 1


@kernel
def reacts_at_once(h, j):
    """Whether a test reacts at once to a change of the error of a hypothesis."""
    if h in (H_PHI, H_THETA):
        return j < ANGLE_TEST or j == change_test(h)
    return j == change_test(h) or (h == H_AIRSPEED and j == DENSITY_TEST)


@kernel
def explains_exceeded(ini, h, alarm):
    """Whether an error that the sensor of a hypothesis has had from the start, and that may change, explains
    all tests exceeded since the alarm.

    If the test that raised the alarm reacts at once to such a change, sensor_monitor.py judges changes: here
    the error is constant then, and any refuting test counts. Otherwise those that react at once do not count.
    """
    for j in range(ini.refuted.shape[1]):
        if ini.refuted[h, j] and (reacts_at_once(h, alarm) or not reacts_at_once(h, j)):
            return False
    return True
