"""Errors that sensors have had since the monitor began: bounds on them, and on their effect on its tests.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. There is one hypothesis for each
reading from which others are predicted (alpha, beta, airspeed, phi, theta): that this sensor alone is broken.
The error x of the sensor is counted as

    alpha, beta, phi, theta    x = 2 sin((reading - truth) / 2): by so much the angle turns a unit vector
    airspeed                   x = reading / truth - 1

For each hypothesis h, test j and filter pole m the record holds

    H    bound on |effect on residual j in one sample| / |x|
    H_m  the same through the filter, H_m <- decay_m H_m + H
    C    lower bound, with sign, on the effect of a unit of x in one sample on the tests of a row of EVIDENCE
         together; complex if the effect has two parts at right angles. C_m: the same through the filter
    E    bound on |x|. At the first sample it is as large as an aircraft can fly (E_start). Then, at each
         sample,
             E <- min(E + (1 - decay_slow) d, E_start)
         and for each row of EVIDENCE
             E <- min(E, (r_m + B_m + 2 d H_m) / (EFFECT_LEFT C_m))
    d    bound on the change of x within the memory of the slowest filter,
             d = min(r_m + B_m + E H_m, E_start)
         where r_m, B_m and H_m are of the test CHANGE_TEST, which a change of x moves at once; for the
         airspeed the sum is multiplied by (1 + E) / V, which makes a share of m/s

r_m: |filtered residual|; B_m: bound on it for sound sensors, both in the unit of the residual; decay_m: decay
of the filter per sample; dt s: time between two samples, `mon.h`. `tighten_bounds` says what r_m + B_m is for
several tests and for the airspeed. A test refutes a hypothesis with

    r_m > B_m + (E + d) H_m
    r_m > (1 + E + d) B_m + (E + d) H_m     for the airspeed, in SPEED and the tests after it

since a residual is the sum of the effect of sound sensors, at most B_m, and of the effect of the error. So an
error from the start, of any size, never excludes the broken sensor. suspects.py and flow_or_force.py exclude
a sensor by the effect that its error would have from now on. Their limit is B_m + E_alarm H_m, with E_alarm
the E at the alarm.

What each effect follows from (v m/s: velocity, V its length; a m/s2: acceleration, gravity g included; both
in body axes; p, q, r rad/s; tests without their _TEST):

    attitude     with phi off, (q, r) is turned about the body's first axis; with theta off, the vertical
                 unit vector, about which the aircraft turns at psi'
    gravity      with phi off, its part g cos(theta) across the body's first axis is turned; with theta off,
                 all of it; both in a, and so in SPEED, ALPHA and BETA
    SPEED        V' = a . v / V
    ALPHA        alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
                          + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    BETA         beta' = p sin(alpha) - r cos(alpha)
                         + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    DENSITY      log(density) = log(2 qdyn) - 2 log V: log V changes by (1 + x) times what its reading shows,
                 if the error of the airspeed is a constant in m/s
    CLIMB        altitude' = V (cos(beta) (cos(alpha) sin(theta) - sin(alpha) cos(phi) cos(theta))
                                - sin(beta) sin(phi) cos(theta))

Gyros need no such hypothesis: all of a gyro's error is in the test of its own axis in every sample. Neither
does the dynamic pressure: only the density shows it.

mon: record of the monitor; initial: its part of that name (INITIAL_RECORD); y (N_SENSORS,): readings, SI;
y_past: those of the sample before. Letters of the kernels that fill H and C:

    A        bound on |a| in the step, times dt2, m/s         A_V = A / V, rad
    G        gravity times dt2, m/s
    dt2      dt and what is of second order in it, s
    rate     `in_plane` of (p, q, r), rad/s: the part of the rate along the flow, + i that against the axis
             across it
    sec      1 / cos(beta) by its reading
    x, E     error of the hypothesis, and the bound on it
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel, record
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
from beaver_ftc.plant.instruments import ALTITUDE, PHI

# Largest flow angle of an aircraft whose attitude and flow are tested, to either side
MAX_FLOW_ANGLE_RAD = 0.7
MAX_SPEED_RATIO = 10.0  # largest reading / truth of an airspeed, and largest truth / reading
MAX_CHORD = 2.0  # largest x of an attitude, 2 sin(error / 2): it may be off by half a turn
DENSITY_SHARE = 0.25  # largest difference of the density from the standard atmosphere, as a share of that
MIN_TEMPERATURE_RATIO = 0.05  # temperature over that at sea level, below which none is extrapolated
# Least share of an effect that remains when speed and flow have changed within a filter's memory
EFFECT_LEFT = 0.8
SLOW_POLE = 2  # index of the slowest filter in FILTER_POLES_PER_S
# Troposphere of the standard atmosphere (ISO 2533): lapse rate over the temperature at sea level, 1/m; the
# density ratio is the temperature ratio to this power, g / (R lapse rate) - 1
LAPSE_PER_M, DENSITY_POWER = 2.25577e-5, 4.2559

# The hypotheses: this sensor has been broken since the monitor began.
H_AIRSPEED, H_ALPHA, H_BETA, H_PHI, H_THETA = range(5)
N_INITIAL = 5
# Rows of C. Each of the first ten is named by an error and the tests in which the error shows, and has the
# row of the same number in EVIDENCE. The last two are the parts of the force in ALPHA_IN_BETA and
# BETA_IN_ALPHA, which can have either sign.
PHI_IN_TURN, PHI_IN_FLOW, THETA_IN_TURN, THETA_IN_FLOW, ALPHA_IN_BETA, BETA_IN_ALPHA = range(6)
ALPHA_IN_CLIMB, V_IN_ALPHA, V_IN_BETA, V_IN_DENSITY, FORCE_ON_ALPHA, FORCE_ON_BETA = range(6, 12)
N_EFFECTS = 12
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

# Letters as at the top. E_start, E_alarm: E at the first sample, and at the alarm; refuted: whether a test
# has refuted a hypothesis since the alarm. Tests from RPM_TEST on do not depend on these errors.
INITIAL_RECORD = record(
    E_start=N_INITIAL, E=N_INITIAL, E_alarm=N_INITIAL, d=N_INITIAL,
    H=(N_INITIAL, RPM_TEST), H_m=(N_INITIAL, RPM_TEST, N_POLES),
    C=(complex, N_EFFECTS), C_m=(complex, N_EFFECTS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),
)  # fmt: skip


@kernel
def speed(y):
    """The airspeed V of the readings, m/s, at least MIN_AIRSPEED_MPS because others are divided by it."""
    return max(y[I_AIRSPEED], MIN_AIRSPEED_MPS)


@kernel
def exceeds(r, k, B, x, H):
    """Whether no error of at most x explains a filtered residual: |r_m| > k B_m + x H_m for some pole m.

    r (poles,): filtered residual; B (poles,): bound on it for sound sensors, which counts k times;
    H (poles,): bound on the effect of a unit of the error. r and B in the unit of the residual.
    """
    for m in range(r.size):
        if abs(r[m]) > k * B[m] + x * H[m]:
            return True
    return False


@kernel
def angle_of_chord(x):
    """The angle, rad, with 2 sin(angle / 2) = x; pi for x > 2."""
    return 2.0 * np.arcsin(min(0.5 * x, 1.0))


@kernel
def start_bounds(mon, y):
    """Set E and E_start to the largest errors with which an aircraft can fly at the truth:

        alpha, beta    2 sin(min(|reading| + MAX_FLOW_ANGLE_RAD, pi) / 2)
        phi, theta     MAX_CHORD
        airspeed       max(V / V_air sqrt(1 + DENSITY_SHARE) - 1, 1 - V / V_air sqrt(1 - DENSITY_SHARE))

    V_air: airspeed by dynamic pressure and the density of the standard troposphere, m/s. The two values of
    the airspeed are for the thickest and for the thinnest air; MAX_SPEED_RATIO - 1 limits them.
    """
    E = mon.initial.E
    temperature = max(1.0 - LAPSE_PER_M * y[ALTITUDE], MIN_TEMPERATURE_RATIO)
    density = SEA_LEVEL_DENSITY_KG_M3 * temperature**DENSITY_POWER
    ratio = speed(y) / np.sqrt(2.0 * max(y[I_QDYN], MIN_QDYN_PA) / density)
    x = max(ratio * np.sqrt(1.0 + DENSITY_SHARE) - 1.0, 1.0 - ratio * np.sqrt(1.0 - DENSITY_SHARE))
    E[H_AIRSPEED] = min(x, MAX_SPEED_RATIO - 1.0)
    for h in (H_ALPHA, H_BETA):
        angle = abs(y[INITIAL_SENSOR[h]]) + MAX_FLOW_ANGLE_RAD
        E[h] = 2.0 * np.sin(0.5 * min(angle, np.pi))
    E[H_PHI] = E[H_THETA] = MAX_CHORD
    copy(E, mon.initial.E_start)


@kernel
def allowed_effect(mon, j, m):
    """r_m + B_m of test j and pole m: bound on the effect of any error through the filter, in the unit of the
    residual."""
    return abs(mon.r[j, m]) + mon.B[j, m]


@kernel
def widen_bounds(mon):
    """Update d, and widen E by the part of it that the slowest filter m forgets in a sample:

    d <- min(r_m + B_m + E H_m, E_start),    of the airspeed (1 + E) / V times the sum
    E <- min(E + (1 - decay_m) d, E_start)
    """
    initial = mon.initial
    m = SLOW_POLE
    E = initial.E
    for h, j in enumerate(CHANGE_TEST):
        d = allowed_effect(mon, j, m) + E[h] * initial.H_m[h, j, m]
        if h == H_AIRSPEED:  # from m/s to a share of the truth, which is at least V / (1 + E)
            d *= (1.0 + E[h]) / speed(mon.y_past)
        initial.d[h] = min(d, initial.E_start[h])
        E[h] = min(E[h] + (1.0 - mon.decay[m]) * initial.d[h], initial.E_start[h])


@kernel
def fill_attitude_effects(mon, y, w):
    """Fill H and C of the tests of turning (TURN_TEST and the two after it) and of the angles (ANGLE_TEST
    and the two after it: phi, theta, psi).

    turn: q + i r about the level axes, as phi turns them, rad/s, so theta' = turn.real and
    psi' = turn.imag / cos(theta). w: bound on the rate, rad/s; second = (dt w)^2, rad2: the axes turn during
    the step.

                     phi off by x                             theta off by x
        turning      (q, r) is turned about the first axis,   the vertical, about which the aircraft turns at
                     which changes it by x |(q, r)|           psi', is turned, which changes it by x psi'
        angles       no Euler angle changes by more than      phi' = p + turn.imag tan(theta) and
                     the body turns, over cos(theta)          psi' = turn.imag / cos(theta): tangents, and
                                                              secants, of reading and truth differ by at most
                                                              x over both cosines; theta' has no theta
    """
    dt, H, C = mon.h, mon.initial.H, mon.initial.C
    rates = vector(y)[1]
    turn = rates * unit(y[PHI])
    second = (dt * w) ** 2
    # 1 / cos(theta) by its reading, and the largest one if theta is off
    sec = secant(y[THETA])
    sec_max = secant(abs(y[THETA]) + angle_of_chord(mon.initial.E[H_THETA]))
    # Rotation in a step, rad: about the body's second and third axes; about the vertical, psi' dt
    qr = dt * abs(turn)
    heading = dt * abs(turn.imag) * sec_max
    by_phi = sec * (qr + sec * second)
    by_theta = sec * sec_max * second
    H[H_PHI, :SPEED_TEST] = second, second + qr, second + qr, by_phi, by_phi, by_phi
    H[H_THETA, :ANGLE_TEST] = second + heading
    H[H_THETA, ANGLE_TEST:SPEED_TEST] = sec * heading + by_theta, by_theta, sec * heading + by_theta
    C[PHI_IN_TURN] = dt * rates
    C[THETA_IN_TURN] = dt * turn.imag


@kernel
def in_plane(y, v):
    """The part of a vector v in the plane of symmetry, turned by alpha: along the flow, and (imaginary)
    against the axis across it."""
    return unit(y[I_ALPHA]) * complex(v[0].imag, -v[1].imag)


@kernel
def share_across(y):
    """cos(theta) |(sin(beta), sin(alpha) cos(beta))|: the largest part along the flow of the vertical's part
    across the body's first axis, if phi is off."""
    return np.cos(y[THETA]) * np.hypot(np.sin(y[I_BETA]), np.sin(y[I_ALPHA]) * np.cos(y[I_BETA]))


@kernel
def fill_flow_effects(mon, y, rate, dt2, a_max):
    """Fill H and C of the tests of flow, rad; sec_max: 1 / cos(beta_max), beta_max the largest |beta| if beta
    is off. In the code: acc: `in_plane` of a; side: exp(i beta), and sb its |sin|; secs: sec sec_max.

                 ALPHA                                     BETA
        V        sec A_V                                   sec A_V
        alpha    sec (A_V + dt2 |rate| |sin(beta)|)        dt2 |rate| + A_V |sin(beta)|
        beta     sec sec_max (dt2 |rate.real| + A_V)       A_V
        phi      sec G cos(theta) / V                      sec G cos(theta) / V
        theta    sec G / V                                 G (|sin(phi)| + |sin(beta)|) / V

    V        alpha' and beta' have the part a / V, and a / truth = (1 + x) a / reading
    alpha    alpha' contains (a_z, a_x) / (V cos(beta)) and tan(beta) (p, r), both turned by alpha. beta'
             contains (p, r) and sin(beta) (a_x, a_z) / V, both turned by alpha. The rate changes beta' by
             x (rate.real cos(error / 2) + rate.imag sin(error / 2)); the force has either sign
    beta     alpha' contains tan(beta) and 1 / cos(beta). Those of reading and truth differ by at most x over
             both cosines: the rate changes alpha' by x cos(error / 2) rate.real over both cosines, and the
             force has either sign. beta' contains a turned by beta
    phi      a has the error x g cos(theta), and each of alpha' and beta' at most all of it, over V
    theta    a has the error x g. alpha' has at most all of it, over V; beta' has the part sin(phi) along the
             second axis, and sin(beta) of the rest
    """
    dt, H, C = mon.h, mon.initial.H, mon.initial.C
    V = speed(y)
    G = dt2 * mon.g
    A_V = dt2 * a_max / V
    acc = in_plane(y, mon.a)
    side = unit(y[I_BETA])
    sb = abs(side.imag)
    sec = secant(y[I_BETA])
    beta_max = abs(y[I_BETA]) + angle_of_chord(mon.initial.E[H_BETA])
    secs = sec * secant(beta_max)
    turned = dt2 * abs(rate)
    by_phi = sec * G * np.cos(y[THETA]) / V
    by_beta = secs * (dt2 * abs(rate.real) + A_V)
    H[:, ALPHA_TEST] = sec * A_V, sec * (A_V + turned * sb), by_beta, by_phi, sec * G / V
    H[:, BETA_TEST] = sec * A_V, turned + A_V * sb, A_V, by_phi, G * (abs(np.sin(y[PHI])) + sb) / V
    C[ALPHA_IN_BETA] = dt * rate
    C[BETA_IN_ALPHA] = dt * rate.real
    C[V_IN_ALPHA] = -dt * acc.imag * sec / V
    C[V_IN_BETA] = dt * (mon.a[1].real * side.real - acc.real * side.imag) / V
    C[FORCE_ON_ALPHA] = dt * sb * a_max / V
    C[FORCE_ON_BETA] = dt * (np.sin(min(beta_max, 0.5 * np.pi)) * abs(acc.imag)) * secs / V


@kernel
def fill_climb_effects(mon, y):
    """Fill H and C of CLIMB, m:

        hypothesis    V        alpha    beta                            phi                  theta
        H             climb    lift     dt V |(vertical.real, d_y)|     dt V share_across    dt V

    d: the vertical unit vector downwards; vertical: `in_plane` of it; lift = dt V cos(beta) |vertical|.

    V        climb is the true change of the altitude, which is the predicted one over 1 + x: they differ by
             x times the true one
    alpha    altitude' contains V cos(beta) (cos(alpha), sin(alpha)), which is turned, along
             (sin(theta), -cos(phi) cos(theta)): altitude' = V cos(beta) |vertical| sin(gamma - alpha) + ...,
             where tan(gamma) = tan(theta) / cos(phi). The sines of reading and truth differ by
             x cos(mean of gamma - alpha)
    beta     altitude' contains V (cos(beta), -sin(beta)), which is turned
    phi      altitude' contains the vertical's part cos(theta), which is turned; the flow is along it by
             `share_across`
    theta    altitude' contains the vertical, which is turned against v
    """
    initial = mon.initial
    d = down(y)
    vertical = in_plane(y, d)
    step = mon.h * speed(y)
    slower = 1.0 - min(initial.E[H_AIRSPEED], 1.0 - 1.0 / MAX_SPEED_RATIO)
    climb = abs(mon.y_pred[ALTITUDE] - y[ALTITUDE]) / slower
    lift = step * np.cos(y[I_BETA]) * abs(vertical)
    by_beta = step * np.hypot(vertical.real, d[1].real)
    initial.H[:, CLIMB_TEST] = climb, lift, by_beta, step * share_across(y), step
    mean = abs(np.angle(complex(-vertical.imag, vertical.real))) + 0.5 * angle_of_chord(initial.E[H_ALPHA])
    initial.C[ALPHA_IN_CLIMB] = lift * np.cos(min(mean, 0.5 * np.pi))


@kernel
def fill_effects(mon, y_now):
    """Fill H (N_INITIAL, RPM_TEST) and C (N_EFFECTS,): those of SPEED, m/s, and of DENSITY here, those of the
    other tests by the functions above. They are evaluated at the sample before, y, from which y_now is
    predicted.

        dt2 = dt (1 + dt (a_max / V + w))        a_max, w: bounds on |a| and on the rate in the step
        hypothesis    V                       alpha    beta    phi               theta
        H, SPEED      0                       A        A       G share_across    G
        H, DENSITY    |2 log(V_now / V)|      0        0       0                 0

    V        the true log V changes by (1 + x) times what the reading shows. The density contains -2 log V,
             so its residual has the error 2 x log(V_now / V)
    alpha    in V' = a . v / V the direction of v is turned, and changes by x at most
    beta     likewise
    phi      a has the error x g cos(theta) across the body's first axis; V' takes its part along v
    theta    a has the error x g, in the plane of the body's first axis and the vertical: V' takes at most all
             of it. Along the first axis it is g (sin(reading) - sin(truth)) = x g cos(mean of both), which C
             has. That mean is at most half the error away from the reading, and at most (reading + a right
             angle) / 2
    """
    dt, y, H, C = mon.h, mon.y_past, mon.initial.H, mon.initial.C
    V = speed(y)
    w = abs(y[P]) + abs(y[Q]) + abs(y[R])
    a_max = max(mon.a_size[0], length(mon.a))
    rate = in_plane(y, vector(y))
    dt2 = dt * (1.0 + dt * (a_max / V + w))
    A = dt2 * a_max
    G = dt2 * mon.g
    H[:, SPEED_TEST] = 0.0, A, A, G * share_across(y), G
    pitch = abs(y[THETA])
    mean = min(pitch + 0.5 * angle_of_chord(mon.initial.E[H_THETA]), 0.5 * pitch + 0.25 * np.pi)
    C[PHI_IN_FLOW] = dt * mon.g * down(y)[1]
    C[THETA_IN_FLOW] = dt * mon.g * np.cos(mean)
    C[V_IN_DENSITY] = 2.0 * np.log(speed(y_now) / V)
    H[H_AIRSPEED, DENSITY_TEST] = abs(C[V_IN_DENSITY])
    fill_attitude_effects(mon, y, w)
    fill_flow_effects(mon, y, rate, dt2, a_max)
    fill_climb_effects(mon, y)


@kernel
def tighten_bounds(mon):
    """Lower the bound on each error to what the tests allow, for each pole m and each row of EVIDENCE:

        E <- min(E, s / (EFFECT_LEFT c)) if c > 0,    s^2 = sum over the tests of (r_m + B_m + 2 d H_m)^2

    d: while the filter summed the effect, the error was up to d larger or smaller than the present one. c is
    |C_m|, and s as above, but for these rows:

        PHI_IN_FLOW, THETA_IN_FLOW      ALPHA and BETA count V times in s, so that all three terms are in m/s:
                                        together, SPEED, ALPHA and BETA show a velocity
        V_IN_DENSITY                    s + 2 (1 + E) / V (r_m + B_m of SPEED): a change of the error shows in
                                        the density, too, and SPEED limits it
        V_IN_ALPHA, V_IN_BETA           (1 + E) s: B_m is for a right airspeed, and a true airspeed that is
                                        1 + E times smaller makes it larger by that factor
        ALPHA_IN_BETA, BETA_IN_ALPHA    c = cos(error / 2) |Re C_m| - sin(error / 2) |Im C_m| - FORCE_ON_*:
                                        the effect of a vane on the other has a part of the force in it
    """
    initial = mon.initial
    E = initial.E
    V = speed(mon.y_past)
    for m in range(mon.decay.size):
        ratio = 1.0 + E[H_AIRSPEED]
        for n, (h, first, last) in enumerate(EVIDENCE):
            C_m = initial.C_m[n, m]
            s2 = 0.0
            for j in range(first, last + 1):
                effect = allowed_effect(mon, j, m) + 2.0 * initial.d[h] * initial.H_m[h, j, m]
                s2 += (effect * V if n in (PHI_IN_FLOW, THETA_IN_FLOW) and j != SPEED_TEST else effect) ** 2
            s = np.sqrt(s2)
            c = abs(C_m)
            if n == V_IN_DENSITY:
                s += 2.0 * ratio * allowed_effect(mon, SPEED_TEST, m) / V
            elif h == H_AIRSPEED:
                s *= ratio
            elif n in (ALPHA_IN_BETA, BETA_IN_ALPHA):
                half = 0.5 * angle_of_chord(E[h])
                force = initial.C_m[FORCE_ON_ALPHA if h == H_ALPHA else FORCE_ON_BETA, m].real
                c = np.cos(half) * abs(C_m.real) - np.sin(half) * abs(C_m.imag) - force
            if c > 0.0:
                E[h] = min(E[h], s / (EFFECT_LEFT * c))


@kernel
def update_bounds(mon, y):
    """Update all bounds by the sample y, which has just been tested.

    In a steep attitude the tests of turning and of the angles restart, so that nothing shows a change of phi
    or theta. Their E is then E_start, what the filters have summed of their C restarts, and H_m = 1 in the
    tests of the angles says that these have missed a change: d is E, until the filters have forgotten it.
    """
    initial = mon.initial
    widen_bounds(mon)
    fill_effects(mon, y)
    for n, C in enumerate(initial.C):
        leak(initial.C_m[n], mon.decay, C)
    for h in range(N_INITIAL):
        for j in range(RPM_TEST):
            leak(initial.H_m[h, j], mon.decay, initial.H[h, j])
    if too_steep(mon, y):
        copy(initial.E_start[H_PHI:], initial.E[H_PHI:])
        initial.C_m[:ALPHA_IN_BETA] = 0.0
        initial.H_m[H_PHI:, ANGLE_TEST:SPEED_TEST] = 1.0
    tighten_bounds(mon)


@kernel
def refutes_initial(mon, h, j):
    """Whether a test's residual is larger than sound sensors and the error of hypothesis h explain: for a
    pole m, r_m > factor B_m + x H_m, x = E + d. No hypothesis has an effect on the engine's tests and later
    ones, which refute it if they exceed their bounds.
    """
    initial = mon.initial
    if j >= RPM_TEST:
        return mon.ratio[j] > 1.0
    x = initial.E[h] + initial.d[h]
    factor = 1.0 + x if h == H_AIRSPEED and j >= SPEED_TEST else 1.0
    return exceeds(mon.r[j], factor, mon.B[j], x, initial.H_m[h, j])


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

    If the test that raised the alarm reacts at once to a change of this error, the other rules of suspects.py
    judge changes. The error is then taken as constant here, and any refuting test counts. Otherwise the error
    may have changed, and the tests that react at once do not count.
    """
    for j in range(N_TESTS):
        if mon.initial.refuted[h, j] and (REACTS[h, alarm] or not REACTS[h, j]):
            return False
    return True
