"""Accelerometers or flow sensor? The course of the residuals since the alarm says whose error they show.

A test of the flow (airspeed, incidence, sideslip) compares a flow sensor with the accelerometers, so an error
of either moves it. An error e of an accelerometer, m/s2, integrates into an error e t of the velocity. An
error of a flow sensor is a step, which its own reading contains. From the alarm on, `clear_sensors` records
that a sensor cannot be the broken one:

    cleared          if
    accelerometers   the reading of the flow sensor jumps as the residual does, soon after the alarm, and no
                     accelerometer has jumped (`flow_jumped`)
                     the flow sensor is frozen
                     the alarm is that of the airspeed, and the test of the density is exceeded
    flow sensor      the residuals add up to many times the range of its reading (`sum_exceeds_range`)
                     an airspeed, or incidence, of that error would exceed the test of the density, or of the
                     climb (`contradicted`)
                     an accelerometer is frozen
    gyro of an axis  the attitude shows no such turn about the axis (`clear_gyros`)

Whether a sensor is frozen is judged here, too.

    y, y_past    (N_SENSORS,) readings now, and in the sample before, SI
    h            time between two samples, s
    i, j, m      sensor, test (redundancy.py), pole of a filter
    b, f         number of a flow sensor (0 airspeed, 1 incidence, 2 sideslip), and its record
    residual     residual of a test in this sample; r, B: the same through a filter, and the bound on it
    V            airspeed, m/s
    mon          record of the monitor (records.py)
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.detection.filters import leak
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_AIRSPEED,
    N_POLES,
    NO_SENSOR,
    SENSOR_OF,
    SPEED_TEST,
    THETA,
)
from beaver_ftc.diagnosis.monitors.redundancy import FORCE_JUMP_M_S2
from beaver_ftc.diagnosis.monitors.residual_bounds import AB_NOW, speed, too_steep
from beaver_ftc.plant.instruments import AX, N_SENSORS, PHI

# Number of repeated readings of a sensor that is never called frozen: its resolution exceeds its noise, so
# that a sound reading may repeat.
N_FROZEN_NEVER = 1_000_000_000
JUMP_WINDOW_S = 1.0  # a jump counts within this time after the alarm: later, one by chance is too likely
JUMP_MEMORY_S = 2.0  # time constant with which the largest jump of an accelerometer fades
MIN_JUMP_SHARE = 0.5  # the flow sensor's own reading jumps by at least this share of the residual
# Least ratio of summed residuals to the range of the reading: a scale error within 3 % of -1 gives so much
MIN_SUM_RATIO = 30.0
CLEAR_FACTOR = 3.0  # an effect clears a sensor only beyond so many times the bound on it
TIME_ROUNDING_S = 1e-9  # a time is shorter than a window only if it is shorter by more than this

FORCES = (AX, AX + 1, AX + 2)

# One flow sensor (airspeed, incidence or sideslip) since the alarm. r_sum, B_sum, H_sum: sums of the
# residuals, of the bound on the part of sound sensors, and of that on an error from the start, in the unit of
# the residual; y_min, y_max: range of the reading. The three flow sensors, their hypotheses (H_AIRSPEED, ...)
# and their tests (SPEED_TEST, ...) have the same order: number b stands for all.
FLOW_RECORD = record(r_sum=float, B_sum=float, H_sum=float, y_min=float, y_max=float)

# The comparison as a whole.
#     flow        the flow sensors
#     cleared     whether each sensor is cleared
#     turn_max    largest turn of the attitude by sound sensors, rad, 0 if unknown (gyro_turn.py)
#     n_since     samples since the alarm
#     climb       filtered effect on the altitude of the error that the incidence's sums show, m
COURSE_RECORD = record(
    flow=(FLOW_RECORD, 3), cleared=(int, N_SENSORS), turn_max=float, n_since=int, climb=N_POLES,
)  # fmt: skip


@kernel
def count_same(mon, y):
    """Count in n_same how many samples in a row each reading has equalled the one before; update the largest
    jump of an accelerometer between two samples, m/s2, which fades:

        jump <- max((1 - h / JUMP_MEMORY_S) jump, |y_i - y_past_i|)        i: the three accelerometers
    """
    sample = mon.sample
    sample.jump *= 1.0 - mon.config.h / JUMP_MEMORY_S
    for i in range(N_SENSORS):
        sample.n_same[i] = sample.n_same[i] + 1 if y[i] == sample.y_past[i] else 0
    for i in FORCES:
        sample.jump = max(sample.jump, abs(y[i] - sample.y_past[i]))


@kernel
def is_frozen(mon, i):
    """Whether sensor i is frozen: it has repeated its reading more often than a sound one."""
    return mon.sample.n_same[i] >= mon.config.n_frozen[i]


@kernel
def last_frozen(mon, sensors):
    """The last of these sensors that is frozen, or NO_SENSOR."""
    last = NO_SENSOR
    for i in sensors:
        last = i if is_frozen(mon, i) else last
    return last


@kernel
def stands_still(mon, i):
    """Whether a sensor is frozen at a reading that is not zero: a sound sensor may read zero all the time."""
    return mon.sample.y_past[i] != 0.0 and is_frozen(mon, i)


@kernel
def clear_sensors(mon, y):
    """Clear sensors by this sample, that of the alarm or a later one, as the table at the top says.

    The order matters: `flow_jumped` reads n_since, the time since the alarm, before `sum_flow` advances it.
    """
    alarm = mon.output.alarm_test
    course = mon.course
    flow = SENSOR_OF[alarm]
    by_density = alarm == SPEED_TEST and mon.tests.exceeded[DENSITY_TEST]
    if is_frozen(mon, flow) or flow_jumped(mon, y, flow) or by_density:
        course.cleared[AX:] = 1
    sum_flow(mon, y)
    is_integrated = sum_exceeds_range(course.flow[alarm - SPEED_TEST])
    if is_integrated or contradicted(mon, y) or last_frozen(mon, FORCES) >= 0:
        course.cleared[flow] = 1
    clear_gyros(mon, y)


@kernel
def flow_jumped(mon, y, i):
    """Whether, soon after the alarm, the residual exceeds the effect of a sound accelerometer's jump in one
    sample, and of the largest jump seen of late, and the reading of the flow sensor i jumps with it.

        |residual| > B + FORCE_JUMP_M_S2 per_a
        |ddy| >= MIN_JUMP_SHARE |residual| > AB_NOW jump per_a

    residual, B: in m/s for the speed, else rad; per_a: residual by an acceleration error of 1 m/s2 in one
    sample, h or h / V; ddy: second difference of the reading, with which a step shows at any slope of the
    reading; jump: of `count_same`, m/s2; AB_NOW: weight of the present acceleration in the integration
    (redundancy.py).
    """
    j = mon.output.alarm_test
    sample = mon.sample
    h = mon.config.h
    per_a = h / (1.0 if j == SPEED_TEST else speed(sample.y_past))
    ddy = abs(y[i] - 2.0 * sample.y_past[i] + sample.y_older[i])
    residual = abs(mon.tests.residual[j])
    soon = mon.course.n_since * h < JUMP_WINDOW_S - TIME_ROUNDING_S
    exceeds_forces = residual > mon.tests.B[j, 0] + FORCE_JUMP_M_S2 * per_a
    return soon and exceeds_forces and ddy >= MIN_JUMP_SHARE * residual > AB_NOW * sample.jump * per_a


@kernel
def sum_flow(mon, y):
    """Add up the residuals of speed, incidence and sideslip since the alarm, with the bounds on their parts,
    and find the range of each reading.

        r_sum <- r_sum + residual,    B_sum <- B_sum + h per_s,    H_sum <- H_sum + E H
        alpha = r_sum - clip(r_sum, -(B_sum + H_sum), B_sum + H_sum)        of the incidence
        climb <- decay climb + h V alpha cos(phi) cos(theta)

    E, H: bound on an error from the start, as of the alarm, and its effect (initial_errors.py). r_sum and
    H_sum are 0 until the alarm; then B_sum starts at the noise of two samples and the effect of a gust.
    alpha, rad, is the error of the incidence that sound sensors do not explain; climb, m, is its effect on
    the altitude through each filter of this decay per sample.
    """
    course = mon.course
    tests = mon.tests
    h = mon.config.h
    for b, f in enumerate(course.flow):
        j = SPEED_TEST + b
        reading = y[SENSOR_OF[j]]
        if course.n_since == 0:
            f.y_min = f.y_max = reading
            # noise of the first and of the last sample
            f.B_sum = 2.0 * tests.per_sample[j] + tests.gust[j] * mon.air.gust_max
        else:
            f.r_sum += tests.residual[j]
            f.B_sum += h * tests.per_s[j]
            f.H_sum += mon.initial.E_alarm[b] * mon.initial.H[b, j]
            f.y_min = min(f.y_min, reading)
            f.y_max = max(f.y_max, reading)
    f = course.flow[ALPHA_TEST - SPEED_TEST]
    explained = f.B_sum + f.H_sum
    alpha = f.r_sum - min(max(f.r_sum, -explained), explained)
    climbed = h * y[I_AIRSPEED] * alpha * np.cos(y[PHI]) * np.cos(y[THETA])
    leak(course.climb, mon.config.decay, climbed)
    course.n_since += 1


@kernel
def sum_exceeds_range(f):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range:

    |r_sum| > MIN_SUM_RATIO (y_max - y_min) + CLEAR_FACTOR (B_sum + H_sum)

    A reading without a range (y_max = y_min) is judged by `is_frozen` instead.
    """
    span = f.y_max - f.y_min
    return span > 0.0 and abs(f.r_sum) > MIN_SUM_RATIO * span + CLEAR_FACTOR * (f.B_sum + f.H_sum)


@kernel
def contradicted(mon, y):
    """Whether the error that the alarm shows, if it were the flow sensor's, would exceed another test that is
    within its bound: of the density for the airspeed, of the climb for the incidence, none for the sideslip.

        effect > CLEAR_FACTOR (B_other + E H)        for some pole

        incidence    effect = |climb|                        m, of `sum_flow`
        airspeed     effect = 2 (1 - E) / V (|r| - B)        of log(density)

    r, B m/s: of the speed; B_other: bound of the other test; E, H: bound on an error of the flow sensor from
    the start, as of the alarm, and its effect on the other test (initial_errors.py); E in the airspeed's
    effect is at most 1.
    """
    alarm = mon.output.alarm_test
    other = DENSITY_TEST if alarm == SPEED_TEST else CLIMB_TEST
    if alarm == BETA_TEST or mon.tests.exceeded[other]:
        return False
    b = alarm - SPEED_TEST
    E = mon.initial.E_alarm[b]
    r = mon.tests.r[alarm]
    B = mon.tests.B[alarm]
    # log(density) changes by twice the relative change of the airspeed
    share = 2.0 * (1.0 - min(E, 1.0)) / speed(y)
    for m, climb in enumerate(mon.course.climb):
        effect = abs(climb) if alarm == ALPHA_TEST else share * (abs(r[m]) - B[m])
        if effect > CLEAR_FACTOR * (mon.tests.B[other, m] + E * mon.initial.H_m[b, other, m]):
            return True
    return False


@kernel
def clear_gyros(mon, y):
    """Clear each gyro i that does not show, in this sample, the error that would explain the test of the
    incidence, or of the sideslip:

        |residual_i| < turn_max < |residual| - B        residual, B: of the test of the alarm, rad

    turn_max, rad, is the largest turn by noise and constant errors with the declared probability
    (gyro_turn.py), 0 if unknown. Near the vertical the attitude shows no turn.
    """
    alarm = mon.output.alarm_test
    residual = mon.tests.residual
    turn_max = mon.course.turn_max
    unexplained = abs(residual[alarm]) - mon.tests.B[alarm, 0]
    if alarm == SPEED_TEST or too_steep(mon, y) or not 0.0 < turn_max < unexplained:
        return
    for i in range(3):
        mon.course.cleared[i] |= abs(residual[i]) < turn_max
