"""The suspects: the sensors whose error, one at a time, explains all tests since the alarm.

The test that raised the alarm names the suspects; other tests, and the two comparisons of gyro_or_attitude.py
and flow_or_force.py, exclude some of them:

    test of the alarm      suspects                     excluded by
    turning, angles        gyro of an axis, one angle   the dynamics of the rates (gyro_or_attitude.py); tests
                                                        of other axes and angles
    speed                  airspeed, accelerometers     being cleared (flow_or_force.py)
    incidence, sideslip    vane, accelerometers, gyros  being cleared; the tests of turning, which leave
                                                        one gyro at most
    density                airspeed, dynamic pressure   for the airspeed its own test; for the pressure any
                                                        other test before those of the engine
    climb                  altitude                     any other test before those of the engine
    engine                 the sensor of the test
    equation of a row      the sensor of the row
    equal                  the sensor, the reading      that reading's own test
                           that it should equal
    any but equal          alpha, beta, airspeed, phi,  the tests that an error from the start does not
                           theta                        explain (initial_errors.py); a frozen suspect

    exceeded     (N_TESTS,): which tests have exceeded their bounds since the alarm
    alarm        number of the test that raised it
    i, j, m, d   sensor, axis or angle; test; pole of a filter; duplicate sensor
    b, E, H      hypothesis of an error from the start, the bound on it as of the alarm, and its effect on a
                 test through a filter (initial_errors.py)
    r, B         filtered residual of a test (redundancy.py), and the bound on it for sound sensors
    e            bound on the error of a reading, SI
    V            airspeed in the sample before, m/s
    mon          record of the monitor (records.py)
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.flow_or_force import (
    FORCES,
    N_FROZEN_NEVER,
    is_frozen,
    last_frozen,
    stands_still,
)
from beaver_ftc.diagnosis.monitors.gyro_or_attitude import GYRO_CONFIRMED, GYRO_REFUTED, turn_share
from beaver_ftc.diagnosis.monitors.initial_effects import H_AIRSPEED, H_PHI, N_INITIAL
from beaver_ftc.diagnosis.monitors.initial_errors import (
    INITIAL_SENSOR,
    exceeds,
    explains_exceeded,
    latch_refuted,
)
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    COUNTERPART,
    COUNTERPART_TEST,
    DENSITY_TEST,
    DUPLICATE,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    N_EQUATIONS,
    N_TESTS,
    PSI,
    RPM_TEST,
    SENSOR_OF,
    SPEED_TEST,
    THETA,
)
from beaver_ftc.diagnosis.monitors.residual_bounds import speed
from beaver_ftc.diagnosis.monitors.rotation import unit
from beaver_ftc.plant.instruments import AX, N_SENSORS, PHI

# A residual below this share of the largest of the three axes, or angles, is taken for the coupling of that
COUPLING_SHARE = 0.03
# Least spurious velocity along the axis of a suspected accelerometer, a share of the largest component.
MIN_AXIS_SHARE = 0.5
# A test within its bound B hides an error whose effect is up to this factor times B, because the effect of
# sound sensors, up to B, may have the other sign. For the gyro that turns the flow by all of its error it is
# also the margin on the bound of the flow's test.
HIDDEN_FACTOR = 2.0


@kernel
def latch_exceeded(mon):
    """Record the tests that have exceeded their bounds since the alarm, and which hypotheses they refute.

    The tests of turning, and those of the angles, come in threes. An error on one axis moves the two others a
    little, so a residual of this sample, through filter 0, counts only if it is larger than COUPLING_SHARE
    times the largest of its three.
    """
    tests = mon.tests
    for j in range(N_TESTS):
        counts = tests.ratio[j] > 1.0
        if j < SPEED_TEST:
            first = j - j % 3  # of the three axes, or angles
            for i in range(first, first + 3):
                counts &= abs(tests.r[j, 0]) > COUPLING_SHARE * abs(tests.r[i, 0])
        tests.exceeded[j] |= counts
    latch_refuted(mon, tests.exceeded)


@kernel
def find_suspects(mon):
    """Fill suspect (N_SENSORS,): the sensors whose error explains all tests since the alarm.

    Errors from the start come last: another sensor's error from the start does not explain why a suspect
    stands still, so none is added to such a suspect. None is added to the suspects of a duplicate sensor,
    either.
    """
    suspect = mon.output.suspect
    alarm = mon.output.alarm_test
    suspect[:] = 0
    if alarm >= N_EQUATIONS:
        suspect_duplicate(mon, alarm - N_EQUATIONS)
        return
    if alarm < SPEED_TEST:
        suspect_attitude(mon)
    elif alarm < DENSITY_TEST:
        suspect_flow(mon, alarm)
    else:
        suspect_lone(mon, alarm)
    for i in range(N_SENSORS):
        if suspect[i] and stands_still(mon, i):
            return
    for b, i in enumerate(INITIAL_SENSOR):
        suspect[i] |= explains_exceeded(mon, b, alarm)


@kernel
def suspect_duplicate(mon, d):
    """Suspect duplicate sensor number d, or the reading i that it no longer equals.

        test of the reading   the sensor       the reading
        exceeded              not suspected    suspected
        within its bound      suspected        suspected if its error may be hidden, if it is frozen, or if
                                               both have never agreed (an error from the first sample on)

        hidden    |residual| - B <= HIDDEN_FACTOR max(B_own, e_i)

    residual, B: of the comparison of both; the left side is the least error of the reading that explains it.
    B_own: bound of the reading's own test.
    """
    suspect = mon.output.suspect
    tests = mon.tests
    i = COUNTERPART[d]
    own_test = COUNTERPART_TEST[d]
    j = N_EQUATIONS + d
    least_error = abs(tests.residual[j]) - tests.B[j, 0]
    hidden = least_error <= HIDDEN_FACTOR * max(tests.B[own_test, 0], mon.errors.e[i])
    suspect[DUPLICATE[d]] = not tests.exceeded[own_test]
    suspect[i] = tests.exceeded[own_test] == 1 or hidden or is_frozen(mon, i) or not tests.agreed[d]


@kernel
def alone(exceeded, i):
    """Whether none of these tests but test i shows an error; exceeded (tests,)."""
    return exceeded.sum() == exceeded[i]


@kernel
def suspect_attitude(mon):
    """Suspect the gyro of axis i, and the angle i (phi, theta, psi), for each i:

        gyro     if no other test of turning shows an error (a gyro's error may appear in an angle first), the
                 gyro is not refuted, and no angle is frozen
        angle    if no test of another angle shows an error that this angle's error from the start does not
                 explain (of psi: any error), the error explains the tests of turning (`explains_turns`) or
                 its own test shows it, and the gyro that would be at fault instead is not confirmed
                 also if it can be called frozen, its reading repeats, but too shortly for that, and its
                 error explains the tests of turning

    turns, angles (3,): which tests of turning, and of the angles, have been exceeded; refuted (2, 3): which
    of the angles' tests refute an error from the start of phi, and of theta; axis: of the gyro that would be
    at fault instead, that with the largest ratio.
    """
    suspect = mon.output.suspect
    exceeded = mon.tests.exceeded
    ratio = mon.tests.ratio[:ANGLE_TEST]
    turns = exceeded[:ANGLE_TEST]
    angles = exceeded[ANGLE_TEST:SPEED_TEST]
    refuted = mon.initial.refuted[H_PHI:, ANGLE_TEST:SPEED_TEST]
    frozen = last_frozen(mon, (PHI, THETA, PSI)) >= 0
    worst = np.argmax(ratio)
    for i in range(3):
        suspect[i] = alone(turns, i) and mon.gyro[i].verdict != GYRO_REFUTED and not frozen
        explains = explains_turns(mon, i)
        sensor = PHI + i
        unshared = alone(angles, i) if i == 2 else alone(refuted[i], i)
        is_sole = unshared and (explains or angles[i] == 1)
        axis = worst if ratio[worst] > ratio[i] else i
        early = 0 < mon.sample.n_same[sensor] < mon.config.n_frozen[sensor] < N_FROZEN_NEVER
        suspect[sensor] = (is_sole and mon.gyro[axis].verdict != GYRO_CONFIRMED) or (explains and early)


@kernel
def explains_turns(mon, i):
    """Whether an error of angle i (phi, theta, psi) explains the tests of turning. Its size is limited by the
    residual of the angle's own test: as it is now, or as its residuals since the alarm have shown.

    It does not if for some axis j, whose test has been exceeded, and some pole m both

        now      |r_j| > c (|r_own| + B_own) + B_j + E H
        since    |beyond_j| > B_j + E H + c_max B_own + tilt swing

    r_own, B_own rad: of the angle's own test; r_j, B_j: of the test of turning about axis j; c: |turn_share|
    + tilt, rad/rad: the attitude may be off by tilt = e_phi + e_theta, rad; beyond, c_max, swing: of the
    angle (`gyro_or_attitude.filter_beyond`); E is 0 for psi.
    """
    tests = mon.tests
    own_test = ANGLE_TEST + i
    angle = mon.angle[i]
    b = min(H_PHI + i, N_INITIAL - 1)  # psi has no hypothesis: any b, as E is 0
    E = mon.initial.E_alarm[b] if i < 2 else 0.0
    tilt = mon.errors.e[PHI] + mon.errors.e[THETA]
    for j in range(3):
        c = abs(turn_share(mon.sample.y_past, j, i)) + tilt
        for m in range(tests.r.shape[1]):
            B = tests.B[own_test, m]
            sound = tests.B[j, m] + E * mon.initial.H_m[b, j, m]
            now = abs(tests.r[j, m]) > c * (abs(tests.r[own_test, m]) + B) + sound
            since = abs(angle.beyond[j, m]) > sound + angle.c_max[j] * B + tilt * angle.swing[m]
            if tests.exceeded[j] and now and since:
                return False
    return True


@kernel
def suspect_flow(mon, alarm):
    """Suspect the flow sensor of the test, the accelerometers, and, of the incidence or the sideslip, gyros.

    If a test of turning is exceeded, only a gyro can be the cause of an alarm of incidence or sideslip,
    because flow sensors and accelerometers do not move the tests of the attitude. Otherwise a gyro is
    suspected if its error may be hidden in the test of its axis. Cleared sensors (flow_or_force.py) are no
    suspects.
    """
    suspect = mon.output.suspect
    turns = mon.tests.exceeded[:ANGLE_TEST]
    by_gyro = alarm > SPEED_TEST and turns.any()
    flow = SENSOR_OF[alarm]
    for i in range(3 if alarm > SPEED_TEST else 0):
        suspect[i] = alone(turns, i) if by_gyro else gyro_hidden(mon, alarm, i)
    if not by_gyro:
        suspect_accelerometers(mon)
        suspect[flow] = 1
    for i in range(N_SENSORS):
        suspect[i] &= not mon.course.cleared[i]


@kernel
def gyro_hidden(mon, j, i):
    """Whether an error of gyro i may explain the test j of the flow while it is hidden in the test of its
    axis: |r_j| <= factor B_j + HIDDEN_FACTOR |share| B_i for each pole.

        alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha)) + ...
        beta' = p sin(alpha) - r cos(alpha) + ...

    share: of the error of p, q or r in the flow's rate, by these equations. The gyro across the flow (q for
    the incidence, r for the sideslip) counts with a share of 1 and factor = HIDDEN_FACTOR; for the others
    factor = 1, and q does not turn the sideslip.
    """
    tests = mon.tests
    alpha = unit(mon.sample.y_past[I_ALPHA])
    tan_beta = np.tan(mon.sample.y_past[I_BETA])
    if j == ALPHA_TEST:
        share = (tan_beta * alpha.real, 1.0, tan_beta * alpha.imag)[i]
    else:
        share = (alpha.imag, 0.0, 1.0)[i]
    across = i == j - SPEED_TEST  # q (1) for the incidence, r (2) for the sideslip
    factor = HIDDEN_FACTOR if across else 1.0
    shows = exceeds(tests.r[j], factor, tests.B[j], HIDDEN_FACTOR * abs(share), tests.B[i])
    return (across or i != 1) and not shows


@kernel
def suspect_accelerometers(mon):
    """Suspect the accelerometers along whose axis the spurious velocity dv, m/s, is about half of its
    largest component or more:

        dv_i >= MIN_AXIS_SHARE max(dv) - B,    B = B_V + V (B_alpha + B_beta)

    B_V, B_alpha, B_beta: B_sum of the three flow sensors, the part of sound sensors. If accelerometers are
    frozen, the last of them is suspected, and no other accelerometer.

    dV, da, db: records of speed, incidence and sideslip; their r_sum, m/s and rad, add up to dv in axes along
    the flow. plane: dv turned by beta; its imaginary part is along the second body axis. body: then turned by
    alpha; its parts are along the first and the third body axis.
    """
    y = mon.sample.y_past
    dV = mon.course.flow[0]
    da = mon.course.flow[1]
    db = mon.course.flow[2]
    V = speed(y)
    frozen = last_frozen(mon, FORCES)
    plane = complex(dV.r_sum, V * db.r_sum) * unit(y[I_BETA])
    body = complex(plane.real, V * np.cos(y[I_BETA]) * da.r_sum) * unit(y[I_ALPHA])
    dv = abs(body.real), abs(plane.imag), abs(body.imag)
    limit = MIN_AXIS_SHARE * max(dv) - dV.B_sum - V * (da.B_sum + db.B_sum)
    for i in FORCES:
        mon.output.suspect[i] = frozen == i or (frozen < 0 and dv[i - AX] >= limit)


@kernel
def suspect_lone(mon, alarm):
    """Suspect the sensor of a test that has a sensor of its own: of the density or the climb if no other test
    before those of the engine is exceeded; of the engine, and of the equations of rows, always.

    The alarm of the density suspects the airspeed, too, unless such an error would exceed the bound of the
    airspeed's own test while that test shows none:

        |r| > 2 HIDDEN_FACTOR (1 + E) / V B_speed + E H        for some pole

    r: of the density; E, H: of the hypothesis H_AIRSPEED, E a share, H on the density. The test of a frozen
    airspeed need not show an error, so an airspeed whose reading has just repeated is suspected.
    """
    suspect = mon.output.suspect
    tests = mon.tests
    sample = mon.sample
    suspect[SENSOR_OF[alarm]] = alarm >= RPM_TEST or alone(tests.exceeded[:RPM_TEST], alarm)
    if alarm == DENSITY_TEST:
        E = mon.initial.E_alarm[H_AIRSPEED]
        H = mon.initial.H_m[H_AIRSPEED, alarm]
        # 2: a relative change of the airspeed changes log(density) by twice as much
        factor = 2.0 * HIDDEN_FACTOR * (1.0 + E) / speed(sample.y_past)
        hidden = not exceeds(tests.r[alarm], factor, tests.B[SPEED_TEST], E, H)
        suspect[I_AIRSPEED] = tests.exceeded[SPEED_TEST] == 1 or hidden or sample.n_same[I_AIRSPEED] > 0
