"""Errors that sensors have had since the monitor began: how large they can be, and which tests refute them.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. There is one hypothesis for each
reading from which others are predicted (alpha, beta, airspeed, phi, theta): that this sensor alone is broken.
The error x of the sensor is counted as

    alpha, beta, phi, theta    x = 2 sin((reading - truth) / 2): by so much the angle turns a unit vector
    airspeed                   x = reading / truth - 1

For each hypothesis b (the sensor that is broken), test j and filter pole m the record holds

    H    bound on |effect on residual j in one sample| / |x|: initial_effects.py
    C    lower bound on the effect of a unit of x on the tests of a row of EVIDENCE together: there, too
    H_m  H through the filter, H_m <- decay_m H_m + H        C_m likewise
    E    bound on |x|. At the first sample it is as large as an aircraft can fly (E_start). Then, at each
         sample,
             E <- min(E + (1 - decay_slow) dx, E_start)
         and for each row of EVIDENCE
             E <- min(E, (r_m + B_m + 2 dx H_m) / (EFFECT_LEFT C_m))
    dx   bound on the change of x within the memory of the slowest filter,
             dx = min(r_m + B_m + E H_m, E_start)
         where r_m, B_m and H_m are of the test CHANGE_TEST, which a change of x moves at once; for the
         airspeed the sum is multiplied by (1 + E) / V, which makes a share of m/s

r_m: |filtered residual|; B_m: bound on it for sound sensors, both in the unit of the residual; decay_m: decay
of the filter per sample. `tighten_bounds` says what r_m + B_m is for several tests and for the airspeed. A
test refutes a hypothesis with

    r_m > B_m + (E + dx) H_m
    r_m > (1 + E + dx) B_m + (E + dx) H_m   for the airspeed, in SPEED and the tests after it

since a residual is the sum of the effect of sound sensors, at most B_m, and of the effect of the error. So an
error from the start, of any size, never excludes the broken sensor. suspects.py and flow_or_force.py exclude
a sensor by the effect that its error would have from now on. Their limit is B_m + E_alarm H_m, with E_alarm
the E at the alarm.

mon: record of the monitor (records.py); initial: its part of that name (INITIAL_RECORD); y (N_SENSORS,):
readings, SI; V m/s: airspeed in the sample before.
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel, record
from beaver_ftc.design.engine import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.diagnosis.monitors.initial_effects import (
    ALPHA_IN_BETA,
    BETA_IN_ALPHA,
    FORCE_ON_ALPHA,
    FORCE_ON_BETA,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    H_THETA,
    MAX_SPEED_RATIO,
    N_EFFECTS,
    N_INITIAL,
    PHI_IN_FLOW,
    THETA_IN_FLOW,
    V_IN_DENSITY,
    angle_of_chord,
    fill_effects,
)
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_QDYN,
    N_POLES,
    N_TESTS,
    RPM_TEST,
    SENSOR_OF,
    SPEED_TEST,
    TURN_TEST,
)
from beaver_ftc.diagnosis.monitors.residual_bounds import MIN_QDYN_PA, speed, too_steep
from beaver_ftc.plant.instruments import ALTITUDE

# Largest flow angle of an aircraft whose attitude and flow are tested, to either side
MAX_FLOW_ANGLE_RAD = 0.7
MAX_CHORD = 2.0  # largest x of an attitude, 2 sin(error / 2): it may be off by half a turn
DENSITY_SHARE = 0.25  # largest difference of the density from the standard atmosphere, as a share of that
MIN_TEMPERATURE_RATIO = 0.05  # temperature over that at sea level, below which none is extrapolated
# Least share of an effect that remains when speed and flow have changed within a filter's memory
EFFECT_LEFT = 0.8
SLOW_POLE = 2  # index of the slowest filter in FILTER_POLES_PER_S
# Troposphere of the standard atmosphere (ISO 2533): lapse rate over the temperature at sea level, 1/m; the
# density ratio is the temperature ratio to this power, g / (R lapse rate) - 1
LAPSE_PER_M, DENSITY_POWER = 2.25577e-5, 4.2559

# Evidence of an error, in the order of the rows of C: the hypothesis, the first and the last of the tests in
# which the error shows.
EVIDENCE = (
    (H_PHI, TURN_TEST + 1, TURN_TEST + 2),
    (H_PHI, SPEED_TEST, BETA_TEST),
    (H_THETA, TURN_TEST, TURN_TEST + 2),
    (H_THETA, SPEED_TEST, BETA_TEST),
    (H_ALPHA, BETA_TEST, BETA_TEST),
    (H_BETA, ALPHA_TEST, ALPHA_TEST),
    (H_ALPHA, CLIMB_TEST, CLIMB_TEST),
    (H_AIRSPEED, ALPHA_TEST, ALPHA_TEST),
    (H_AIRSPEED, BETA_TEST, BETA_TEST),
    (H_AIRSPEED, DENSITY_TEST, DENSITY_TEST),
)
# By hypothesis, the tests that react at once to a change of its error. The residual of the first test is that
# change.
AT_ONCE = (
    (SPEED_TEST, DENSITY_TEST),
    (ALPHA_TEST,),
    (BETA_TEST,),
    (ANGLE_TEST, TURN_TEST, TURN_TEST + 1, TURN_TEST + 2),
    (ANGLE_TEST + 1, TURN_TEST, TURN_TEST + 1, TURN_TEST + 2),
)
CHANGE_TEST = tuple(tests[0] for tests in AT_ONCE)
INITIAL_SENSOR = tuple(SENSOR_OF[j] for j in CHANGE_TEST)  # the broken sensor of each hypothesis
REACTS = np.array([[j in tests for j in range(N_TESTS)] for tests in AT_ONCE])

# E, dx, H, C, H_m, C_m: see the top. E_start, E_alarm: E at the first sample, and at the alarm; refuted:
# whether a test has refuted a hypothesis since the alarm. Tests from RPM_TEST on do not depend on the errors.
INITIAL_RECORD = record(
    E_start=N_INITIAL, E=N_INITIAL, E_alarm=N_INITIAL, dx=N_INITIAL,
    H=(N_INITIAL, RPM_TEST), H_m=(N_INITIAL, RPM_TEST, N_POLES),
    C=(complex, N_EFFECTS), C_m=(complex, N_EFFECTS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),
)  # fmt: skip


@kernel
def exceeds(r, factor, B, x, H):
    """Whether no error of at most x explains a filtered residual: |r_m| > factor B_m + x H_m for some pole m.

    r (poles,): filtered residual; B (poles,): bound on it for sound sensors, which counts `factor` times;
    H (poles,): bound on the effect of a unit of the error. r and B in the unit of the residual.
    """
    for m in range(r.size):
        if abs(r[m]) > factor * B[m] + x * H[m]:
            return True
    return False


@kernel
def start_bounds(mon, y):
    """Set E and E_start to the largest errors with which an aircraft can fly at the truth:

        alpha, beta    2 sin(min(|reading| + MAX_FLOW_ANGLE_RAD, pi) / 2)
        phi, theta     MAX_CHORD
        airspeed       max(V / V_air sqrt(1 + DENSITY_SHARE) - 1, 1 - V / V_air sqrt(1 - DENSITY_SHARE))

    V: reading of the airspeed; V_air: airspeed by dynamic pressure and the density of the standard
    troposphere, m/s. The two values of the airspeed are for the thickest and for the thinnest air;
    MAX_SPEED_RATIO - 1 limits them.
    """
    E = mon.initial.E
    temperature = max(1.0 - LAPSE_PER_M * y[ALTITUDE], MIN_TEMPERATURE_RATIO)
    density = SEA_LEVEL_DENSITY_KG_M3 * temperature**DENSITY_POWER
    ratio = speed(y) / np.sqrt(2.0 * max(y[I_QDYN], MIN_QDYN_PA) / density)
    x = max(ratio * np.sqrt(1.0 + DENSITY_SHARE) - 1.0, 1.0 - ratio * np.sqrt(1.0 - DENSITY_SHARE))
    E[H_AIRSPEED] = min(x, MAX_SPEED_RATIO - 1.0)
    for b in (H_ALPHA, H_BETA):
        angle = abs(y[INITIAL_SENSOR[b]]) + MAX_FLOW_ANGLE_RAD
        E[b] = 2.0 * np.sin(0.5 * min(angle, np.pi))
    E[H_PHI] = E[H_THETA] = MAX_CHORD
    copy(E, mon.initial.E_start)


@kernel
def allowed_effect(tests, j, m):
    """r_m + B_m of test j and pole m: bound on the effect of any error through the filter, in the unit of the
    residual."""
    return abs(tests.r[j, m]) + tests.B[j, m]


@kernel
def widen_bounds(mon):
    """Update dx, and widen E by the part of it that the slowest filter m forgets in a sample:

    dx <- min(r_m + B_m + E H_m, E_start),    of the airspeed (1 + E) / V times the sum
    E <- min(E + (1 - decay_m) dx, E_start)
    """
    initial = mon.initial
    m = SLOW_POLE
    E = initial.E
    for b, j in enumerate(CHANGE_TEST):
        dx = allowed_effect(mon.tests, j, m) + E[b] * initial.H_m[b, j, m]
        if b == H_AIRSPEED:  # from m/s to a share of the truth, which is at least V / (1 + E)
            dx *= (1.0 + E[b]) / speed(mon.sample.y_past)
        initial.dx[b] = min(dx, initial.E_start[b])
        E[b] = min(E[b] + (1.0 - mon.config.decay[m]) * initial.dx[b], initial.E_start[b])


@kernel
def tighten_bounds(mon):
    """Lower the bound on each error to what the tests allow, for each pole m and each row of EVIDENCE:

        E <- min(E, s / (EFFECT_LEFT per_x)) if per_x > 0
        s^2 = sum over the tests of (r_m + B_m + 2 dx H_m)^2        per_x = |C_m|

    dx: while the filter summed the effect, the error was up to dx larger or smaller than the present one. s
    and per_x differ for these rows:

        PHI_IN_FLOW, THETA_IN_FLOW      ALPHA and BETA count V times in s, so that all three terms are in m/s:
                                        together, SPEED, ALPHA and BETA show a velocity
        V_IN_DENSITY                    s + 2 (1 + E) / V (r_m + B_m of SPEED): a change of the error shows in
                                        the density, too, and SPEED limits it
        V_IN_ALPHA, V_IN_BETA           (1 + E) s: B_m is for a right airspeed, and a true airspeed that is
                                        1 + E times smaller makes it larger by that factor
        ALPHA_IN_BETA, BETA_IN_ALPHA    per_x = cos(error / 2) |Re C_m| - sin(error / 2) |Im C_m| -
                                        FORCE_ON_*: the effect of a vane on the other has a part of the
                                        force in it
    """
    initial = mon.initial
    tests = mon.tests
    E = initial.E
    V = speed(mon.sample.y_past)
    for m in range(mon.config.decay.size):
        ratio = 1.0 + E[H_AIRSPEED]
        for row, (b, first, last) in enumerate(EVIDENCE):
            C_m = initial.C_m[row, m]
            s2 = 0.0
            for j in range(first, last + 1):
                effect = allowed_effect(tests, j, m) + 2.0 * initial.dx[b] * initial.H_m[b, j, m]
                in_m_s = row in (PHI_IN_FLOW, THETA_IN_FLOW) and j != SPEED_TEST
                s2 += (effect * V if in_m_s else effect) ** 2
            s = np.sqrt(s2)
            per_x = abs(C_m)
            if row == V_IN_DENSITY:
                s += 2.0 * ratio * allowed_effect(tests, SPEED_TEST, m) / V
            elif b == H_AIRSPEED:
                s *= ratio
            elif row in (ALPHA_IN_BETA, BETA_IN_ALPHA):
                half = 0.5 * angle_of_chord(E[b])
                force = initial.C_m[FORCE_ON_ALPHA if b == H_ALPHA else FORCE_ON_BETA, m].real
                per_x = np.cos(half) * abs(C_m.real) - np.sin(half) * abs(C_m.imag) - force
            if per_x > 0.0:
                E[b] = min(E[b], s / (EFFECT_LEFT * per_x))


@kernel
def update_bounds(mon, y):
    """Update all bounds by the sample y, which has just been tested.

    In a steep attitude the tests of turning and of the angles restart, so that nothing shows a change of phi
    or theta. Their E is then E_start, what the filters have summed of their C restarts, and H_m = 1 in the
    tests of the angles says that these have missed a change: dx is E, until the filters have forgotten it.
    """
    initial = mon.initial
    decay = mon.config.decay
    widen_bounds(mon)
    fill_effects(mon, y)
    for row, C in enumerate(initial.C):
        leak(initial.C_m[row], decay, C)
    for b in range(N_INITIAL):
        for j in range(RPM_TEST):
            leak(initial.H_m[b, j], decay, initial.H[b, j])
    if too_steep(mon, y):
        copy(initial.E_start[H_PHI:], initial.E[H_PHI:])
        initial.C_m[:ALPHA_IN_BETA] = 0.0
        initial.H_m[H_PHI:, ANGLE_TEST:SPEED_TEST] = 1.0
    tighten_bounds(mon)


@kernel
def refutes_initial(mon, b, j):
    """Whether a test's residual is larger than sound sensors and the error of hypothesis b explain: for a
    pole m, r_m > factor B_m + x H_m, x = E + dx. No hypothesis has an effect on the engine's tests and later
    ones, which refute it if they exceed their bounds.
    """
    initial = mon.initial
    tests = mon.tests
    if j >= RPM_TEST:
        return tests.ratio[j] > 1.0
    x = initial.E[b] + initial.dx[b]
    factor = 1.0 + x if b == H_AIRSPEED and j >= SPEED_TEST else 1.0
    return exceeds(tests.r[j], factor, tests.B[j], x, initial.H_m[b, j])


@kernel
def latch_refuted(mon, exceeded):
    """Record by which of `exceeded` (N_TESTS,) each hypothesis is refuted."""
    for b in range(N_INITIAL):
        for j in range(N_TESTS):
            mon.initial.refuted[b, j] |= exceeded[j] and refutes_initial(mon, b, j)


@kernel
def explains_exceeded(mon, b, alarm):
    """Whether an error that the sensor of hypothesis b has had from the start, and that may change, explains
    all tests exceeded since the alarm.

    If the test that raised the alarm reacts at once to a change of this error, the other rules of suspects.py
    judge changes. The error is then taken as constant here, and any refuting test counts. Otherwise the error
    may have changed, and the tests that react at once do not count.
    """
    for j in range(N_TESTS):
        if mon.initial.refuted[b, j] and (REACTS[b, alarm] or not REACTS[b, j]):
            return False
    return True
