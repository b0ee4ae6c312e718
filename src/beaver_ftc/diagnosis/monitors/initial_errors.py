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
    C    lower bound, with sign, on the effect of a unit of x in one sample, on one test or on several
         together (EVIDENCE), complex if of two parts at right angles; C_m the same through the filter
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
error from the start, of any size, never excludes the broken sensor. Where flow_errors.py or suspects.py
excludes a sensor by the effect that its error would have from now on, the limit is B + e_alarm H_m, e as of
the alarm.

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

mon: record of the monitor; its part `initial` has H, H_m, C, C_m and d; e is its E; y, y_past: redundancy.py.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.engine import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    N_POLES,
    N_TESTS,
    RPM_TEST,
    SENSOR_OF,
    SPEED_TEST,
    THETA,
    TURN_TEST,
    P,
    Q,
    R,
)
from beaver_ftc.diagnosis.monitors.redundancy import MIN_AIRSPEED_MPS, MIN_QDYN_PA, secant, too_steep
from beaver_ftc.diagnosis.monitors.rotation import down, length, unit, vector
from beaver_ftc.diagnosis.sets import explain
from beaver_ftc.plant.instruments import ALTITUDE, PHI

MAX_FLOW_ANGLE_RAD = 0.7  # an aircraft whose attitude and flow are tested flies at less, to either side
MAX_SPEED_RATIO = 10.0  # largest reading / truth of an airspeed, and largest truth / reading
MAX_CHORD = 2.0  # of 2 sin(error / 2): an attitude may be off by half a turn
DENSITY_SHARE = 0.25  # of the density from the standard atmosphere at a height, as a share of it
MIN_TEMPERATURE_RATIO = 0.05  # temperature over that at sea level, below which none is extrapolated
# Share of an effect that is left, at least, when speed and flow have changed within a filter's memory
EFFECT_LEFT = 0.8
SLOW_POLE = 2  # index in FILTER_POLES_PER_S
# Troposphere of the standard atmosphere (ISO 2533): lapse rate over the temperature at sea level, 1/m; the
# density ratio is the temperature ratio to this power, g / (R lapse rate) - 1
LAPSE_PER_M, DENSITY_POWER = 2.25577e-5, 4.2559

# The hypotheses: this sensor has been broken since the monitor began.
H_AIRSPEED, H_ALPHA, H_BETA, H_PHI, H_THETA = range(5)
N_INITIAL = 5
# What bounds such an error: its hypothesis, and the tests, first to last, in which its effect shows. Entry n
# of C is the effect of row n; after the rows C has the parts of the force, of alpha and of beta.
EVIDENCE = (
    (H_PHI, TURN_TEST + 1, TURN_TEST + 2),  # turns (q, r)
    (H_PHI, SPEED_TEST, BETA_TEST),  # turns the part of gravity across the first axis
    (H_THETA, TURN_TEST, TURN_TEST + 2),  # turns the vertical, about which the aircraft turns at psi'
    (H_THETA, SPEED_TEST, BETA_TEST),  # turns gravity
    (H_ALPHA, BETA_TEST, BETA_TEST),
    (H_BETA, ALPHA_TEST, ALPHA_TEST),
    (H_ALPHA, CLIMB_TEST, CLIMB_TEST),
    (H_AIRSPEED, ALPHA_TEST, ALPHA_TEST),
    (H_AIRSPEED, BETA_TEST, BETA_TEST),
    (H_AIRSPEED, DENSITY_TEST, DENSITY_TEST),
)
N_EFFECTS = len(EVIDENCE) + 2  # and the parts of the force
# Of each hypothesis, the tests that react at once to a change of its error; the residual of the first is that
# change
AT_ONCE = (
    (SPEED_TEST, DENSITY_TEST),
    (ALPHA_TEST,),
    (BETA_TEST,),
    (ANGLE_TEST, TURN_TEST, TURN_TEST + 1, TURN_TEST + 2),
    (ANGLE_TEST + 1, TURN_TEST, TURN_TEST + 1, TURN_TEST + 2),
)
CHANGE_TEST = tuple(tests[0] for tests in AT_ONCE)
INITIAL_SENSOR = tuple(SENSOR_OF[j] for j in CHANGE_TEST)  # of each hypothesis
REACTS = np.array([[j in tests for j in range(N_TESTS)] for tests in AT_ONCE])

INITIAL_RECORD = record(
    E_start=N_INITIAL, E=N_INITIAL, E_alarm=N_INITIAL, d=N_INITIAL,
    H=(N_INITIAL, RPM_TEST), H_m=(N_INITIAL, RPM_TEST, N_POLES),
    C=(complex, N_EFFECTS), C_m=(complex, N_EFFECTS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),  # since the alarm
)  # fmt: skip


@kernel
def speed(y):
    """V, m/s, of a reading: where it divides."""
    return max(y[I_AIRSPEED], MIN_AIRSPEED_MPS)


@kernel
def exceeds(r, k, B, x, H):
    """Whether no error of a set explains a filtered residual: |r_m| > k B_m + x H_m for some pole m.

    B (poles,): bound for sound sensors; H (poles,): on the effect of a unit of an error, of at most x.
    """
    for m in range(r.size):
        if abs(r[m]) > k * B[m] + x * H[m]:
            return True
    return False


@kernel
def angle_of_chord(x):
    """The angle, rad, with 2 sin(angle / 2) = x; half a turn for x > 2."""
    return 2.0 * np.arcsin(min(0.5 * x, 1.0))


@kernel
def start_bounds(mon, y):
    """e_start: bound each error at the first sample: an aircraft can fly at the truth.

        alpha, beta    2 sin((|reading| + MAX_FLOW_ANGLE_RAD) / 2)
        phi, theta     MAX_CHORD
        airspeed       max(V / V_air sqrt(1 + s) - 1, 1 - V / V_air sqrt(1 - s))        s: DENSITY_SHARE

    T: temperature of the standard troposphere, over that at sea level. V_air: airspeed by dynamic pressure
    and standard density, m/s; off: reading over truth, less 1, in the thickest or in the thinnest air.
    """
    E = mon.initial.E_start
    T = max(1.0 - LAPSE_PER_M * y[ALTITUDE], MIN_TEMPERATURE_RATIO)
    V_air = np.sqrt(2.0 * max(y[I_QDYN], MIN_QDYN_PA) / (SEA_LEVEL_DENSITY_KG_M3 * T**DENSITY_POWER))
    ratio = speed(y) / V_air
    off = max(ratio * np.sqrt(1.0 + DENSITY_SHARE) - 1.0, 1.0 - ratio * np.sqrt(1.0 - DENSITY_SHARE))
    E[H_AIRSPEED] = min(off, MAX_SPEED_RATIO - 1.0)
    for h in (H_ALPHA, H_BETA):
        angle = abs(y[INITIAL_SENSOR[h]]) + MAX_FLOW_ANGLE_RAD
        E[h] = 2.0 * np.sin(0.5 * min(angle, np.pi))
    E[H_PHI:] = MAX_CHORD
    mon.initial.E[:] = E


@kernel
def allowed_effect(mon, j, m):
    """r + B of test j and pole m: bound on the effect of any error through the filter, in the unit of the
    residual."""
    return abs(mon.r[j, m]) + mon.B[j, m]


@kernel
def widen_bounds(mon):
    """Update d, and widen e by the part of it that the slowest filter m forgets in a sample:

    d <- min(r + B + e H_m, e_start),    of the airspeed (1 + e) / V times the sum
    e <- min(e + (1 - a_m) d, e_start)
    """
    own = mon.initial
    m = SLOW_POLE
    e = own.E
    for h, j in enumerate(CHANGE_TEST):
        d = allowed_effect(mon, j, m) + e[h] * own.H_m[h, j, m]
        if h == H_AIRSPEED:  # from m/s to a share of the truth, which is at least V / (1 + e)
            d *= (1.0 + e[h]) / speed(mon.y_past)
        own.d[h] = min(d, own.E_start[h])
        e[h] = min(e[h] + (1.0 - mon.decay[m]) * own.d[h], own.E_start[h])


@kernel
def fill_attitude_effects(mon, y, turn, second):
    """Fill H for the tests of the attitude; turn: q + i r about the level axes, as phi turns them, rad/s;
    second, rad2: the axes turn during the step.

    Body axes. phi off by e: (q, r) is turned by e about the first axis, which changes it by
    2 sin(e / 2) |(q, r)|. theta off: the vertical, about which the aircraft turns at psi', likewise.

    Angles. phi off: no Euler angle changes by more than the body turns over cos(theta). theta off by e:
    phi' = p + m tan(theta), psi' = m / cos(theta), with m = q sin(phi) + r cos(phi). The tangents, or
    secants, of reading and truth differ by at most 2 sin(e / 2) over both cosines; in
    theta' = q cos(phi) - r sin(phi) there is no theta.
    """
    H = mon.initial.H
    # 1 / cos(theta) by its reading, and the largest one if theta is off
    sec, sec_max = secant(y[THETA]), secant(abs(y[THETA]) + angle_of_chord(mon.initial.E[H_THETA]))
    # Rotation in a step, rad: about the body's second and third axes; about the vertical, psi' h
    qr, heading = mon.h * abs(turn), mon.h * abs(turn.imag) * sec_max
    by_phi, by_theta = sec * (qr + sec * second), sec * sec_max * second
    H[H_PHI, :SPEED_TEST] = second, second + qr, second + qr, by_phi, by_phi, by_phi
    H[H_THETA, :ANGLE_TEST] = second + heading
    H[H_THETA, ANGLE_TEST:SPEED_TEST] = sec * heading + by_theta, by_theta, sec * heading + by_theta


@kernel
def in_plane(z, v):
    """The part of a vector in the plane of symmetry, turned by the incidence: along the flow, and
    (imaginary) against the axis across it."""
    return z * complex(v[0].imag, -v[1].imag)


@kernel
def fill_effects(mon, y_now):
    """Fill H (N_INITIAL, RPM_TEST) and C, taken at the sample before, y, from which y_now is predicted.

    H      SPEED      ALPHA_FLOW                 BETA_FLOW            DENSITY    CLIMB
    V      0          sec n                      sec n                |density|  climb
    alpha  A          sec (n + P_h sb)           P_h + n sb           0          vert = h V cb |vertical|
    beta   A          secs (h2 |rate.real| + n)  n                    0          h V |(vertical.real, d_y)|
    phi    G across   sec G ct / V               sec G ct / V         0          h V across
    theta  G          sec G / V                  G (s_phi + sb) / V   0          h V

    h2: h and the second order in h. A, n: bound on |a| in the step, and over V; G: gravity; P_h: |(p, r)|;
    each times h2. ct, cb: cosines of theta and beta; sb, s_phi: sizes of the sines of beta and phi; d: the
    vertical; rate, vertical, acc: `in_plane` of (p, q, r), d and a. sec: 1 / cos(beta) by its reading; secs:
    that times the largest if beta is off. Why, with x the error of the hypothesis:

    V        in alpha', beta' a / truth = (1 + x) a / reading. The true climb is the predicted one over 1 + x,
             which differ by x / (1 + x) of the latter. log V changes by (1 + x) times the change of the
             reading's logarithm: the density, with -2 log V, by x times twice that
    alpha    in V' = a . v / V the direction of v is turned by alpha, and changes by x at most. In alpha'
             (a_z, a_x) / (V cos(beta)) and tan(beta) (p, r) are turned by alpha, in beta' (p, r) and
             sin(beta) (a_x, a_z) / V. In altitude' (cos(alpha), sin(alpha)), times V cos(beta), is turned
             along (sin(theta), -cos(phi) cos(theta))
    beta     V' likewise. In alpha' tangents, and secants, of reading and truth differ by x over both cosines.
             In beta' a is turned by beta, in altitude' (cos(beta), -sin(beta)), times V
    phi      a has the error x g cos(theta) across the body's first axis. V' takes its part along v: the share
             of v there is |(sin(beta), sin(alpha) cos(beta))|, which times ct is `across`. alpha' and beta'
             take at most all of it. In altitude' the vertical's part cos(theta) is turned, against `across`
    theta    a has the error x g, in the plane of the body's first axis and the vertical. V' and alpha' take
             at most all of it, beta' the part sin(phi) along the second axis, and sin(beta) of the rest. In
             altitude' the vertical is turned, against v
    """
    h, g, e, H, y, a = mon.h, mon.g, mon.initial.E, mon.initial.H, mon.y_past, mon.a
    V, ct, side, z, d = speed(y), np.cos(y[THETA]), unit(y[I_BETA]), unit(y[I_ALPHA]), down(y)
    cb, sb, s_phi = side.real, abs(side.imag), abs(np.sin(y[PHI]))
    beta_max = abs(y[I_BETA]) + angle_of_chord(e[H_BETA])
    sec, secs = secant(y[I_BETA]), secant(y[I_BETA]) * secant(beta_max)
    rate, acc, vertical = in_plane(z, vector(y)), in_plane(z, a), in_plane(z, d)
    turn = complex(y[Q], y[R]) * unit(y[PHI])
    w, a_max = abs(y[P]) + abs(y[Q]) + abs(y[R]), max(mon.a_size[0], length(a))
    h2 = h * (1.0 + h * (a_max / V + w))
    A, n, G, P_h = h2 * a_max, h2 * a_max / V, h2 * g, h2 * abs(rate)
    vert, across = h * V * cb * abs(vertical), ct * np.hypot(sb, z.imag * cb)
    slower = 1.0 - min(e[H_AIRSPEED], 1.0 - 1.0 / MAX_SPEED_RATIO)
    climb = abs(mon.y_pred[ALTITUDE] - y[ALTITUDE]) / slower
    density = 2.0 * np.log(speed(y_now) / V)
    fill_attitude_effects(mon, y, turn, (h * w) ** 2)
    by_phi = sec * G * ct / V
    H[:, SPEED_TEST] = 0.0, A, A, G * across, G
    H[:, ALPHA_TEST] = sec * n, sec * (n + P_h * sb), secs * (h2 * abs(rate.real) + n), by_phi, sec * G / V
    H[:, BETA_TEST] = sec * n, P_h + n * sb, n, by_phi, G * (s_phi + sb) / V
    H[H_AIRSPEED, DENSITY_TEST] = abs(density)
    H[:, CLIMB_TEST] = climb, vert, h * V * np.hypot(vertical.real, d[1].real), h * V * across, h * V
    # theta: along the first axis, g (sin(reading) - sin(truth)) = x g cos(mean of both). The mean is at most
    # half the error away from the reading, and at most (reading + a right angle) / 2
    pitch = abs(y[THETA])
    mean = min(pitch + 0.5 * angle_of_chord(e[H_THETA]), 0.5 * pitch + 0.25 * np.pi)
    # alpha: altitude' = V cos(beta) vert sin(gamma - alpha) + ..., where
    # tan(gamma) = tan(theta) / cos(phi). The sines of reading and truth differ by x cos(mean of gamma -
    # alpha)
    path = abs(np.angle(complex(-vertical.imag, vertical.real))) + 0.5 * angle_of_chord(e[H_ALPHA])
    # In the order of EVIDENCE. alpha off by e: beta' changes by x (rate.real cos(e / 2) + rate.imag
    # sin(e / 2)). beta off by e: alpha' changes by x cos(e / 2) rate.real over both cosines
    mon.initial.C[:] = (
        h * vector(y)[1],  # phi turns (q, r)
        h * g * d[1],  # phi turns the part of gravity across the first axis
        h * complex(turn.imag),  # theta turns the vertical, about which the aircraft turns at psi'
        h * g * complex(np.cos(mean)),  # theta turns gravity
        h * rate,  # alpha in BETA_FLOW
        h * complex(rate.real),  # beta in ALPHA_FLOW
        vert * complex(np.cos(min(path, 0.5 * np.pi))),  # alpha in CLIMB
        -h * complex(acc.imag) * sec / V,  # V in ALPHA_FLOW
        h * complex(a[1].real * cb - acc.real * side.imag) / V,  # V in BETA_FLOW
        complex(density),  # V in DENSITY
        # the part of the force, of either sign: in that of alpha in BETA_FLOW, of beta in ALPHA_FLOW
        h * complex(sb) * a_max / V,
        h * complex(np.sin(min(beta_max, 0.5 * np.pi)) * abs(acc.imag)) * secs / V,
    )


@kernel
def tighten_bounds(mon):
    """Lower the bound on each error to what the tests allow, filter by filter: of each row of EVIDENCE

        e <- min(e, s / (EFFECT_LEFT c)),    s^2 = sum over its tests of (r + B + 2 d H_m)^2,    c = |C_m|

        density       s + 2 (1 + e) / V (r + B of SPEED)                        in place of s
        flow by V     (1 + e) s                                                 in place of s
        vane, flow    cos(e / 2) |Re C_m| - sin(e / 2) |Im C_m| - force         in place of c

    The present error was up to d larger or smaller while the filter summed its effect. Together, the tests of
    speed and flow show a velocity, m/s. The effect of a vane on the other has a part of the force in it.

    The tests of the flow have bounds for a right airspeed: a true one that is 1 + e times smaller makes them
    larger by that. The density shows changes of its error in addition: those are in the airspeed's own test.
    """
    own = mon.initial
    e = own.E
    V = speed(mon.y_past)
    for m in range(mon.decay.size):
        ratio = 1.0 + e[H_AIRSPEED]
        for n, (h, first, last) in enumerate(EVIDENCE):
            C, s2 = own.C_m[n, m], 0.0
            for j in range(first, last + 1):
                effect = allowed_effect(mon, j, m) + 2.0 * own.d[h] * own.H_m[h, j, m]
                s2 += (effect * V if j > first == SPEED_TEST else effect) ** 2
            s, c = np.sqrt(s2), abs(C)
            if first == DENSITY_TEST:
                s += 2.0 * ratio * allowed_effect(mon, SPEED_TEST, m) / V
            elif h == H_AIRSPEED:
                s *= ratio
            elif h <= H_BETA and first < CLIMB_TEST:
                half = 0.5 * angle_of_chord(e[h])
                force = own.C_m[len(EVIDENCE) + h - H_ALPHA, m].real
                c = np.cos(half) * abs(C.real) - np.sin(half) * abs(C.imag) - force
            e[h] = explain(0.0, s, EFFECT_LEFT * max(c, 0.0), -e[h], e[h])[1]


@kernel
def update_bounds(mon, y):
    """Update all bounds by the sample y, which has just been tested."""
    own = mon.initial
    if too_steep(mon, y):
        own.C_m[:] = 0.0
        return
    widen_bounds(mon)
    fill_effects(mon, y)
    for n, C in enumerate(own.C):
        leak(own.C_m[n], mon.decay, C)
    for h in range(N_INITIAL):
        for j in range(RPM_TEST):
            leak(own.H_m[h, j], mon.decay, own.H[h, j])
    tighten_bounds(mon)


@kernel
def refutes_initial(mon, h, j):
    """Whether a test's residual is larger than sound sensors and the error of hypothesis h explain: for a
    pole m, r > factor B + x H_m, x = e + d. No hypothesis has an effect on the engine's tests and later
    ones.
    """
    own = mon.initial
    if j >= RPM_TEST:
        return mon.ratio[j] > 1.0
    x = own.E[h] + own.d[h]
    factor = 1.0 + x if h == H_AIRSPEED and j >= SPEED_TEST else 1.0
    return exceeds(mon.r[j], factor, mon.B[j], x, own.H_m[h, j])


@kernel
def latch_refuted(mon, exceeded):
    """Record by which of `exceeded` (N_TESTS,) each hypothesis is refuted."""
    for h in range(N_INITIAL):
        for j in range(N_TESTS):
            mon.initial.refuted[h, j] |= exceeded[j] and refutes_initial(mon, h, j)


@kernel
def explains_exceeded(mon, h, alarm):
    """Whether an error that the sensor of a hypothesis has had from the start, and that may change, explains
    all tests exceeded since the alarm.

    If the test that raised the alarm reacts at once to such a change, sensor_monitor.py judges changes: here
    the error is constant then, and any refuting test counts. Otherwise those that react at once do not count.
    """
    for j in range(N_TESTS):
        if mon.initial.refuted[h, j] and (REACTS[h, alarm] or not REACTS[h, j]):
            return False
    return True
