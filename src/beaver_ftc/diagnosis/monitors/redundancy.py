"""Redundancy tests: relations that sound sensors satisfy in any flight (kinematics, air data, engine).

    turning     attitude[k+1] = attitude[k] turned by h (p, q, r)[k]         in body axes, and angle by angle
    flow        v[k+1] = v[k] turned by -h (p, q, r), + h (force + gravity)  v from alpha, beta, airspeed
    density     2 qdyn / V^2 changes with height only
    climb       altitude[k+1] = altitude[k] + h (v upwards)
    engine      speed and manifold pressure are as commanded
    equal       a sensor that no equation uses, and the reading that its row says it should equal

The integration is that of JSBSim (rates held over the step; velocity by Adams and Bashforth's second order),
so that residuals of sound sensors contain only what is left out here: the Earth turns and is round. Every
residual, except those of the tests `engine` and `equal`, passes filters of several poles, with a bound on the
effect of the declared errors of all sensors together, as in detection/filters.py. Declared turbulence widens
the bounds of flow and climb by the effect of its gusts within a filter's memory.

    y, y_past, y_pred  (N_SENSORS,)  readings now, in the sample before, as predicted from that; SI
    w                  (2,)          vector (rotation.py): body rates, rad/s
    v, a, a_past       (2,)          vectors: velocity m/s, acceleration m/s2 with gravity, that of before
    q                  (z1, z2)      attitude (rotation.py)
    h                                time between two samples, s: a JSBSim frame
    i, j, m, d                       sensor or axis, test, pole of a filter, duplicate sensor
    mon                              record of the monitor (records.py)
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel, record
from beaver_ftc.diagnosis.detection.filters import advance_bound, leak
from beaver_ftc.diagnosis.monitors.numbering import (
    ANGLE_TEST,
    COUNTERPART,
    DENSITY_TEST,
    DUPLICATE,
    DUPLICATE_TOLERANCE,
    DUPLICATES,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    N_EQUATIONS,
    N_POLES,
    N_TESTS,
    PRESSURE_TEST,
    PSI,
    RPM_TEST,
    SENSOR_OF,
    SPEED_TEST,
    THETA,
)
from beaver_ftc.diagnosis.monitors.residual_bounds import (
    AB_NOW,
    AB_PAST,
    bound_readings,
    bound_residuals,
    too_steep,
)
from beaver_ftc.diagnosis.monitors.rotation import (
    attitude,
    combined,
    components,
    down,
    inverse,
    length,
    times,
    turned,
    unit,
    vector,
)
from beaver_ftc.plant.instruments import ALTITUDE, N_SENSORS, PHI, wrapped
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

MIN_HALF_DENSITY = 1e-9  # kg/m3: lower limit of qdyn / V^2 in the logarithm, far below half a density of air
MIN_SPEED_MPS = 1e-3  # lower limit of a predicted speed that divides
COMPARISON_ROUNDING = (
    1e-6  # for rounding, in the bound on two readings that are compared directly, in their unit
)
FORCE_JUMP_M_S2 = 8.0  # a sound specific force changes by less from one sample to the next

# The samples before, and the prediction of this one, SI.
#     y_past, y_older    readings in the sample before, and in that before it
#     y_pred             predicted readings; those of the engine are the commands
#     a, a_past          accelerations as vectors (rotation.py): in the sample before, and in that before it,
#                        turned by `predict_readings` into the axes of the next one
#     a_size             |a| in the elapsed step and in the two before it; a_size_past: |a_past|
#     e_first            error of the acceleration in the first step: no sample precedes that step
#     n_same, jump       of `flow_or_force.count_same`
SAMPLE_RECORD = record(
    y_past=N_SENSORS, y_older=N_SENSORS, y_pred=N_SENSORS, a=(complex, 2), a_past=(complex, 2), a_size=3,
    a_size_past=float, e_first=float, n_same=(int, N_SENSORS), jump=float,
)  # fmt: skip
# By test, in the unit of the residual:
#     per_s, per_sample    bound on the residual of one sample: h per_s + per_sample + past
#     past                 per_sample of the sample before
#     gust                 effect on the residual of a gust that changes by 1 m/s
#     r, B                 filtered residual, and the bound on |r|; e_sum: part of B, summed by the filter
#     ratio                largest |r| / B over the poles
#     exceeded             whether the ratio has exceeded 1 since the alarm (suspects.py)
# agreed: whether each duplicate sensor has agreed, before any alarm, with the reading that it should equal.
TESTS_RECORD = record(
    residual=N_TESTS, per_s=N_TESTS, per_sample=N_TESTS, past=N_TESTS, gust=N_TESTS, r=(N_TESTS, N_POLES),
    B=(N_TESTS, N_POLES), e_sum=(N_TESTS, N_POLES), ratio=N_TESTS, exceeded=(int, N_TESTS),
    agreed=(int, max(len(DUPLICATES), 1)),
)  # fmt: skip


@kernel
def store_sample(mon, y, force):
    """Take y and the specific force (3,) m/s2 as the sample before, for the next one."""
    sample = mon.sample
    errors = mon.errors
    sample.y_older = sample.y_past
    copy(y, sample.y_past)
    errors.e_older = errors.e_past
    errors.e_past = errors.e
    sample.a[:] = combined(1.0, vector(force), mon.config.g, down(y))


@kernel
def predict_readings(sample, h):
    """Fill y_pred: attitude, altitude and flow now, from the sample before. Returns the attitude as q.

        step = (1, h w / 2) / |...|                       turn of an Euler step
        q <- q step                                       q = z1 + z2 j, of which
        phi = arg(z1^2 - z2*^2),  2 z1 z2 = sin(theta) + i cos(theta) sin(psi)
        altitude <- altitude + h (v upwards)
        v <- v + h (3/2 a - 1/2 a_past)                   in the axes before the step; then turned by step

    A vector of fixed direction, turned by step, is q* v q: its components in the axes after the step. At the
    end a, turned by step, is the a_past of the next sample.
    """
    y = sample.y_pred
    past = sample.y_past
    w = vector(past)
    s1 = 1.0 + 0.5 * h * w[0]
    s2 = 0.5 * h * w[1]
    size = length((s1, s2))
    step = s1 / size, s2 / size
    q = times(attitude(past), step)
    roll = q[0] ** 2 - q[1].conjugate() ** 2
    nose = 2.0 * q[0] * q[1]
    y[PHI] = np.angle(roll)
    y[THETA] = np.arcsin(min(max(nose.real, -1.0), 1.0))
    y[PSI] = np.arctan2(nose.imag, abs(q[0]) ** 2 - abs(q[1]) ** 2)
    flow = past[I_AIRSPEED] * unit(past[I_BETA])
    plane = flow.real * unit(past[I_ALPHA])
    v = complex(0.0, plane.real), complex(flow.imag, plane.imag)
    climb = times(v, down(past))[0].real  # the real part of v d is -(v . d): upwards
    y[ALTITUDE] = past[ALTITUDE] + h * climb
    a = combined(AB_NOW, sample.a, -AB_PAST, sample.a_past)
    sample.a_size_past = length(sample.a_past)
    sample.a_size[:] = length(a), sample.a_size[0], sample.a_size[1]
    sample.a_past[:] = turned(step, sample.a)
    v = turned(step, combined(1.0, v, h, a))
    y[I_AIRSPEED] = length(v)
    y[I_ALPHA] = np.arctan2(v[1].imag, v[0].imag)
    y[I_BETA] = np.arcsin(v[1].real / max(y[I_AIRSPEED], MIN_SPEED_MPS))
    return q


@kernel
def half_density(y):
    """qdyn / V^2, kg/m3, at least MIN_HALF_DENSITY."""
    return max(y[I_QDYN] / y[I_AIRSPEED] ** 2, MIN_HALF_DENSITY)


@kernel
def fill_residuals(residual, sample, y, q):
    """Fill the residual (N_TESTS,) of each test:

        turning    2 (q* q_now), rad: the vector part, small, is half the turn; -q_now is the same attitude
        density    log(rho / rho_past),  rho = qdyn / V^2
        others     y - y_pred, of an angle wrapped

    q, q_now: the attitude as predicted, and as measured. The tests of the engine and of duplicate sensors
    have their residuals of `compare`.
    """
    turn = times(inverse(q), attitude(y))
    side = 2.0 if turn[0].real >= 0.0 else -2.0
    residual[:ANGLE_TEST] = components(combined(side, turn, 0.0, turn))
    for j in range(ANGLE_TEST, RPM_TEST):
        r = y[SENSOR_OF[j]] - sample.y_pred[SENSOR_OF[j]]
        residual[j] = wrapped(r) if j < SPEED_TEST else r
    residual[DENSITY_TEST] = np.log(half_density(y) / half_density(sample.y_past))


@kernel
def filter_test(mon, j):
    """Pass the residual of test j through its filters, decay = exp(-pole h) of each; find its largest ratio
    to the bound:

        r <- decay r + residual,    B = e_sum + per_sample + gust gust_change,    ratio = max |r| / B
        e_sum <- decay e_sum + h per_s + (1 - decay) past        `filters.advance_bound`

    per_s: in the unit of the residual over s; past: per_sample of the sample before.
    """
    tests = mon.tests
    r = tests.r[j]
    e_sum = tests.e_sum[j]
    B = tests.B[j]
    tests.ratio[j] = 0.0
    leak(r, mon.config.decay, tests.residual[j])
    for m, decay in enumerate(mon.config.decay):
        e_sum[m] = advance_bound(e_sum[m], tests.per_s[j], decay, mon.config.h, tests.past[j])
        B[m] = e_sum[m] + tests.per_sample[j] + tests.gust[j] * mon.air.gust_change[m]
        tests.ratio[j] = max(tests.ratio[j], abs(r[m]) / B[m])
    tests.past[j] = tests.per_sample[j]


@kernel
def restart_tests(tests, end):
    """Restart the tests before number `end` with this sample: their filters are empty, and e_sum has the
    error that the reading of this sample brings into the next prediction."""
    tests.ratio[:end] = tests.residual[:end] = tests.r[:end] = 0.0
    for j in range(end):
        tests.e_sum[j] = tests.past[j] = tests.per_sample[j]


@kernel
def compare(tests, j, residual, bound):
    """Judge the residual of test j alone, without a filter, by the bound on it."""
    tests.residual[j] = residual
    tests.B[j, 0] = bound + COMPARISON_ROUNDING
    tests.ratio[j] = abs(residual) / tests.B[j, 0]


@kernel
def compare_duplicates(mon, y, fresh):
    """Compare each duplicate sensor i with the reading j that it should equal, in the samples in which sensor
    i is read; fresh (sampled sensors,): whether each is. One of the two is broken if they differ by more than
    tolerance + e_i + e_j; e: bounds on the errors of both (residual_bounds.py). `agreed` records the pairs
    that have agreed before any alarm.
    """
    tests = mon.tests
    e = mon.errors.e
    for d in range(DUPLICATE.size):
        i = DUPLICATE[d]
        j = COUNTERPART[d]
        test = N_EQUATIONS + d
        tests.ratio[test] = 0.0
        if fresh[i - N_IN_EQUATIONS]:
            r = wrapped(y[i] - y[j]) if PHI <= j <= PSI else y[i] - y[j]
            compare(tests, test, r, DUPLICATE_TOLERANCE[d] + e[i] + e[j])
            tests.agreed[d] |= tests.ratio[test] <= 1.0 and not mon.output.alarmed


@kernel
def start_tests(mon, y, force):
    """Start with the first sample, before which no reading is known; force (3,) m/s2."""
    sample = mon.sample
    bound_readings(mon.errors, y)
    store_sample(mon, y, force)
    store_sample(mon, y, force)  # twice: y_older and e_older are those of this sample, too
    sample.a_past = sample.a
    sample.a_size[:2] = length(sample.a) + FORCE_JUMP_M_S2
    sample.e_first = AB_PAST * FORCE_JUMP_M_S2
    bound_residuals(mon, y)
    restart_tests(mon.tests, N_EQUATIONS)


@kernel
def run_tests(mon, y, fresh):
    """Compare this sample y with the one before; fresh (sampled sensors,): those that are read now."""
    sample = mon.sample
    errors = mon.errors
    errors.e_drift += mon.config.h * errors.drift
    bound_readings(errors, y)
    q = predict_readings(sample, mon.config.h)
    fill_residuals(mon.tests.residual, sample, y, q)
    bound_residuals(mon, y)
    sample.e_first = 0.0
    first = SPEED_TEST if too_steep(mon, y) else 0
    restart_tests(mon.tests, first)
    for j in range(first, RPM_TEST):
        filter_test(mon, j)
    if mon.config.has_engine:
        for j in (RPM_TEST, PRESSURE_TEST):
            i = SENSOR_OF[j]
            compare(mon.tests, j, y[i] - sample.y_pred[i], errors.e[i])
    if N_TESTS > N_EQUATIONS:
        compare_duplicates(mon, y, fresh)
