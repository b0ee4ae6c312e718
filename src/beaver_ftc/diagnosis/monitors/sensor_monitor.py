"""The sensor monitor: finds the broken sensor by the redundancy of all sensors (redundancy.py).

It assumes that one sensor fails at a time. The test with the largest ratio of residual to bound raises the
alarm, and says which sensors are suspects. A suspect is excluded if its error would exceed another test too,
and that test is within its bound.

    test of the alarm      suspects                     excluded by
    turning, angles        gyro of an axis, one angle   the dynamics of the rates (below); other axes, angles
    speed                  airspeed, accelerometers     the rules of clearing (below)
    incidence, sideslip    vane, accelerometers, gyros  the same; for vane and gyros the tests of turning
    density                airspeed, dynamic pressure   for the airspeed its own test; for the pressure any
                                                        other test
    climb                  altitude                     any other test
    engine                 the sensor of the test
    equal                  the sensor, the reading      that reading's own test
                           that it should equal
    any                    alpha, beta, airspeed, phi,  the tests that an error from the start does not
                           theta                        explain (initial_errors.py)

    outcome                sensor        surfaces
    a reading is missing   isolated      none is isolated
    one suspect            isolated      none is isolated
    several, or none       not isolated  none is isolated; after UNANTICIPATED_DELAY_S the verdict is
                                         "unanticipated"
    alarm long after that  isolated or   the conclusion about surfaces stays (MIN_LEAD_S)
    of the surfaces        not, as above

An isolated sensor is replaced by an estimate from the others (`estimate_reading`), for the diagnosis and for
the laws, until the end of the flight. Accelerometers are not replaced: the diagnosis uses none that may be
broken (`measured.inertial`).

*Gyro or attitude?* Both move the same tests. The dynamics of the rates separate them: a jump of a gyro is an
acceleration that no model explains, a jump of the attitude is none. With D the damping of the rates (3, 3),
1/s, and nu the innovation, rad/s2, the filter w' = -D w + nu follows a gyro's error exactly, and stays within
its bound for an error of the attitude (`judge_gyros`).

*Accelerometers or flow sensor?* A test of the flow (airspeed, incidence, sideslip) compares a flow sensor
with the accelerometers, so an error of either moves it. An accelerometer's error e integrates into a velocity
error e t; an error of a flow sensor is a step, which its own reading contains. From the alarm on

    the accelerometers are cleared if the reading of the flow sensor jumps as the test does, soon after the
    alarm, while no accelerometer has jumped; if the flow sensor is frozen; for the airspeed, if the test of
    the density is exceeded
    the flow sensor is cleared if the residuals add up to many times the range of its reading; if an airspeed,
    or incidence, of that error would exceed the test of the density, or of the climb; if an accelerometer is
    frozen

The direction of the spurious velocity dv, which the residuals add up to, says which accelerometer is broken.

Symbols: redundancy.py and initial_errors.py; i sensor or axis, j test, m pole, d duplicate, h hypothesis of
initial_errors.py. mon: record of the monitor; M its memory, o its output, red the tests, ini the hypotheses,
found the conclusion about surfaces, bank the detection filters, pred the prediction of the model.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.detection.filters import bank_axis, leak
from beaver_ftc.diagnosis.monitors.initial_errors import (
    effect_at_alarm,
    explains_exceeded,
    latch_refuted,
    start_bounds,
    update_bounds,
)
from beaver_ftc.diagnosis.monitors.redundancy import (
    AB_NOW,
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    ANGLE_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    COUNTERPART,
    COUNTERPART_TEST,
    DENSITY_TEST,
    DUPLICATE,
    FILTER_POLES_PER_S,
    FORCE_JUMP_M_S2,
    GYRO_CONFIRMED,
    GYRO_OPEN,
    GYRO_REFUTED,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    MIN_AIRSPEED_MPS,
    N_EQUATIONS,
    N_FROZEN_NEVER,
    N_INITIAL,
    N_TESTS,
    NO_SENSOR,
    PRESSURE_TEST,
    QDYN,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    TURN_TEST,
    compare_duplicates,
    run_tests,
    start_tests,
    store_sample,
    too_steep,
    turn_share,
)
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    note_slipstream,
    set_inertial,
    share_out,
)
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

# Accelerometers or flow sensor
JUMP_WINDOW_S = 1.0  # after the alarm: later, a jump by chance is too likely
JUMP_MEMORY_S = 2.0  # time constant with which the largest jump of an accelerometer fades
MIN_JUMP_SHARE = 0.5  # of the residual, by which the flow sensor's own reading jumps, at least
MIN_SUM_RATIO = 30.0  # ratio; a scale error within 3 % of -1 gives so much
# An effect that a sensor's error would have clears the sensor only beyond so many times the bound on it
CLEAR_FACTOR = 3.0
# of the spurious velocity, along the axis of a suspected accelerometer
MIN_AXIS_SHARE = 0.5
TIME_ROUNDING_S = 1e-9


# By the test of the flow, from SPEED_TEST on: the flow sensor that it compares with the accelerometers, and
# the hypothesis that this sensor was broken when the monitor began (initial_errors.py)
FLOW_SENSOR, FLOW_HYPOTHESIS = (AIRSPEED, ALPHA, BETA), (H_AIRSPEED, H_ALPHA, H_BETA)
# The sensor of each such hypothesis
INITIAL_SENSOR = ALPHA, BETA, AIRSPEED, PHI, THETA


@kernel
def count_same(mon, y):
    """Count the samples for which each reading has been the very same, and find the largest jump of an
    accelerometer from one sample to the next, m/s2, which fades within JUMP_MEMORY_S.
    """
    M, y_past = mon.memory, mon.redundancy.memory.y_past
    M.jump *= 1.0 - mon.redundancy.config.sample_time_s / JUMP_MEMORY_S
    for i in range(N_SENSORS):
        M.n_same[i] = M.n_same[i] + 1 if y[i] == y_past[i] else 0
        if AX <= i < N_IN_EQUATIONS:
            M.jump = max(M.jump, abs(y[i] - y_past[i]))


@kernel
def is_frozen(mon, i):
    """Whether a sensor is frozen: no sound one gives the same reading for so many samples."""
    return mon.memory.n_same[i] >= mon.config.n_frozen[i]


@kernel
def clear_sensors(mon, y):
    """Clear the flow sensor, or the accelerometers, by this sample, that of the alarm or a later one."""
    M, alarm = mon.memory, mon.output.alarm_test
    if not SPEED_TEST <= alarm <= BETA_TEST:
        return
    flow = FLOW_SENSOR[alarm - SPEED_TEST]
    soon = M.n_since * mon.redundancy.config.sample_time_s < JUMP_WINDOW_S - TIME_ROUNDING_S
    sound = soon and flow_jumped(mon, y)
    sum_flow(mon, y)
    if sound or is_frozen(mon, flow) or (alarm == SPEED_TEST and M.exceeded[DENSITY_TEST]):
        M.cleared[AX:] = 1
    broken = sum_exceeds_range(mon) or other_test_contradicts(mon, y)
    for i in range(AX, N_IN_EQUATIONS):
        broken = broken or is_frozen(mon, i)
    if broken:
        M.cleared[flow] = 1
    clear_gyros(mon, y)


@kernel
def clear_gyros(mon, y):
    """Clear each gyro whose axis does not turn in this sample as an error would that explains the incidence,
    or the sideslip. Near the vertical the attitude shows no turn.

    turn_max, rad: by noise and constant errors with the declared probability (attitude.py), 0 if unknown.
    """
    M, red, alarm = mon.memory, mon.redundancy, mon.output.alarm_test
    if alarm == SPEED_TEST or too_steep(red, y) or M.turn_max == 0.0:
        return
    for i in range(3):
        turn = abs(red.test[TURN_TEST + i].residual)
        if turn < M.turn_max < abs(red.test[alarm].residual) - red.test[alarm].B[0]:
            M.cleared[i] = 1


@kernel
def flow_jumped(mon, y):
    """Whether the residual exceeds any jump of an accelerometer in one sample, and the flow sensor's reading
    jumps with it.

    per_v, per_a: residual for a velocity error of 1 m/s, for an acceleration error of 1 m/s2 in one sample.
    ddy: second difference of the reading.
    """
    alarm, red, M = mon.output.alarm_test, mon.redundancy, mon.memory
    i, y_past, test = FLOW_SENSOR[alarm - SPEED_TEST], red.memory.y_past, red.test[alarm]
    per_v = 1.0 if alarm == SPEED_TEST else 1.0 / max(y_past[AIRSPEED], MIN_AIRSPEED_MPS)
    per_a = red.config.sample_time_s * per_v
    ddy = abs(y[i] - 2.0 * y_past[i] + M.y_older[i])
    r = abs(test.residual)
    return r > test.B[0] + FORCE_JUMP_M_S2 * per_a and ddy >= MIN_JUMP_SHARE * r > AB_NOW * M.jump * per_a


@kernel
def sum_flow(mon, y):
    """Add up, after the sample of the alarm, the residuals of the flow (r_sum), the part of sound sensors
    (B_sum) and that of an error from the start (e_sum); and find the range of each reading.

    alpha: error of the incidence that the sums leave unexplained, rad; climb: its effect in a sample, m.
    """
    red, M, ini = mon.redundancy, mon.memory, mon.initial_errors
    h = red.config.sample_time_s
    for n in range(3):
        j, y_n, k = SPEED_TEST + n, y[FLOW_SENSOR[n]], FLOW_HYPOTHESIS[n]
        test = red.test[j]
        if M.n_since == 0:
            M.y_min[n] = M.y_max[n] = y_n
            # noise of the first and of the last sample
            M.B_sum[n] = 2.0 * test.bound_per_sample + test.gust_gain * red.config.gust_max
            continue
        M.r_sum[n] += test.residual
        M.B_sum[n] += h * test.bound_per_s
        M.e_sum[n] += ini.e_alarm[k] * ini.H[k, j]
        M.y_min[n] = min(M.y_min[n], y_n)
        M.y_max[n] = max(M.y_max[n], y_n)
    alpha = np.sign(M.r_sum[1]) * max(abs(M.r_sum[1]) - M.B_sum[1] - M.e_sum[1], 0.0)
    climb = h * y[AIRSPEED] * alpha * np.cos(y[PHI]) * np.cos(y[THETA])
    leak(M.climb, red.config.decay, climb)
    M.n_since += 1


@kernel
def sum_exceeds_range(mon):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range."""
    M, j = mon.memory, mon.output.alarm_test - SPEED_TEST
    span = M.y_max[j] - M.y_min[j]
    sound = M.B_sum[j] + M.e_sum[j]
    return span > 0.0 and abs(M.r_sum[j]) > MIN_SUM_RATIO * span + CLEAR_FACTOR * sound


@kernel
def other_test_contradicts(mon, y):
    """Whether an airspeed of this error would exceed the test of the density, or an incidence that of the
    climb, while that test is within its bound."""
    red, ini = mon.redundancy, mon.initial_errors
    alarm = mon.output.alarm_test
    other = DENSITY_TEST if alarm == SPEED_TEST else CLIMB_TEST
    if alarm == BETA_TEST or mon.memory.exceeded[other]:
        return False
    h = FLOW_HYPOTHESIS[alarm - SPEED_TEST]
    for m in range(red.config.decay.size):
        r = abs(mon.memory.climb[m])
        speed = red.test[SPEED_TEST]
        if alarm == SPEED_TEST:  # log(density) changes by twice the relative change of the airspeed
            r = 2.0 * (abs(speed.r[m]) - speed.B[m]) / max(y[AIRSPEED], MIN_AIRSPEED_MPS)
            r *= 1.0 - min(ini.e_alarm[h], 1.0)
        if r > CLEAR_FACTOR * (red.test[other].B[m] + effect_at_alarm(ini, h, other, m)):
            return True
    return False


@kernel
def suspect_accelerometers(mon, by_gyro):
    """Suspect the accelerometers along whose axis most of the spurious velocity dv is, unless a gyro explains
    it. along, down, side: of dv, m/s, along and across the flow; sound: bound on |dv| of sound sensors.
    """
    M, y_past, r, B = mon.memory, mon.redundancy.memory.y_past, mon.memory.r_sum, mon.memory.B_sum
    alpha, beta, V = y_past[ALPHA], y_past[BETA], max(y_past[AIRSPEED], MIN_AIRSPEED_MPS)
    along, down, side = r[0], V * np.cos(beta) * r[1], V * r[2]
    plane = np.cos(beta) * along - np.sin(beta) * side  # along the flow's projection on the plane of symmetry
    dv = (
        np.cos(alpha) * plane - np.sin(alpha) * down,
        np.sin(beta) * along + np.cos(beta) * side,
        np.sin(alpha) * plane + np.cos(alpha) * down,
    )
    sound = B[0] + V * (B[1] + B[2])
    most, frozen = max(abs(dv[0]), abs(dv[1]), abs(dv[2])), NO_SENSOR
    for i in range(AX, N_IN_EQUATIONS):
        frozen = i if is_frozen(mon, i) else frozen
    for i in range(AX, N_IN_EQUATIONS):
        cause = frozen == i or (frozen < 0 and abs(dv[i - AX]) + sound >= MIN_AXIS_SHARE * most)
        mon.output.suspect[i] = cause and not by_gyro and not M.cleared[i]


@kernel
def disable_suspects(mon, measured):
    """Mark the accelerometers as unusable once one of them may be broken."""
    for i in range(AX, N_IN_EQUATIONS):
        if mon.output.is_reading_unused[i] or (mon.output.alarmed and mon.output.suspect[i]):
            set_inertial(measured, 0)


# A smaller share of the largest of three residuals is the effect of its error on the two other axes or angles
COUPLING_SHARE = 0.03
# stage: 1 after the first sample and while the pitch is too steep, 2 with the first whole frame, 3 from
# the next frame on: only then the innovation contains the change of a gyro's error between two frames
FULL_STAGE = 3
MIN_LEAD_S = 0.5  # before the alarm: a surface detected earlier was detected with sound sensors
INITIAL_WINDOW_S = 1.0  # from the start: an alarm of the surfaces may be caused by an initial error
VANE_RETURN_S = 20.0  # of the return to trim of a replaced vane: kinematics alone drift
# index in FILTER_POLES_PER_S: of the filter that gives the first value of a replaced rate
RATE_POLE = 1

# Gyro or attitude (judge_gyros)
# innovation, rad/s2, that an error of 1 rad/s of the gyro itself causes, at most
MAX_DYNAMICS_PER_S = 10.0
JUMP_TOLERANCE = 0.1  # share of a gyro's jump by which the innovation may differ from it
MIN_ESTIMATED_SHARE = 0.7  # of a gyro's error, which w shows
SAMPLES_IN_JUMP = 4.0  # a jump is the difference of two residuals, each with the noise of two samples
MIN_TRANSIENT = 2.0  # of the size of a transient to the bound on noise: else noise may be all of it
TRANSIENT_LEFT = 0.003  # of a jump of the attitude within a frame, in the next frame
RATE_ROUNDING = 1e-6  # rad/s, and rad/s2: the part of the bounds that covers rounding

# Errors that a test within its bound B hides: the effect of sound sensors, up to B, may have the other sign
HIDDEN_FACTOR = 2.0
# Margin on the bound of the flow's test, for the gyro that turns the flow by all of its error
FULL_GYRO_FACTOR = 2.0


@kernel
def check_sensors(mon, pred, measured, found, bank, bound, dt, t):
    """Test the sensors at t s, and replace in `measured` the readings of broken ones.

    bank: with the innovation of the elapsed frame, of dt s; bound: with the bound on that innovation.
    """
    red, ini, y = mon.redundancy, mon.initial_errors, measured.signal
    M = mon.memory
    if not M.stage:
        begin_monitor(mon, measured, t)
        return
    if M.substep == 0:
        advance_gyro_estimate(mon, bank.output.innovation, bound.eta_bar, dt)
    run_tests(red, y, mon.config.has_engine)
    if N_TESTS > N_EQUATIONS:
        compare_duplicates(red, y, measured.fresh)
        latch_agreed(mon, measured.fresh)
    update_bounds(red, ini, y)
    count_same(mon, y)
    if M.substep == 0:
        M.w_att_past[:] = M.w_att
        M.peak_older[:] = M.peak_past
        M.peak_past[:] = M.peak
        M.floor_past[:] = M.floor
        M.peak[:] = M.floor[:] = 0.0
    for i in range(3):
        w = -red.test[TURN_TEST + i].residual / red.config.sample_time_s
        if M.substep == 0:
            M.w_att[i] = w
        else:
            M.peak[i] = max(M.peak[i], abs(w))
            M.floor[i] = abs(w) if M.substep == 1 else min(M.floor[i], abs(w))
    if too_steep(red, y):
        restart_comparison(M)
    elif M.stage < FULL_STAGE:
        advance_stage(mon)
    if mon.config.noisy and not too_steep(red, y):
        exclude_gyros(mon)
    isolate_sensor(mon, measured, found, bank, bound, dt, t)
    replace_readings(mon, pred, measured)
    disable_suspects(mon, measured)
    M.y_older[:] = red.memory.y_past
    store_sample(red, y, measured.force)
    M.substep = (M.substep + 1) % mon.config.substeps


@kernel
def add_turn(mon, att, y):
    """Add to the comparison of attitude and rates what the attitude has turned beyond the gyros in this
    sample; near the vertical it shows no turn."""
    if too_steep(mon.redundancy, y):
        attitude.restart(att)
        return
    for i in range(3):
        attitude.add_turn(att, i, mon.redundancy.test[TURN_TEST + i].residual)
    mon.memory.turn_max = att.turn_max


@kernel
def name_gyro(mon, found, i, t):
    """Isolate gyro i at t s. What was concluded of surfaces is void, unless one was isolated before."""
    o = mon.output
    raise_alarm(mon, found, t)
    if o.keeps_surface and found.isolated_estimator < 0:
        o.keeps_surface, o.alarmed_at_s = 0, found.detected_at_s
    mark_isolated(mon, i, t)


@kernel
def rule_out_gyros(mon):
    """No gyro can be broken: a surface may be isolated."""
    mon.memory.gyros_excluded = 1


@kernel
def expect_pressure(mon, pressure):
    """Predict the engine's manifold pressure from the command of the law in charge of the engine."""
    mon.redundancy.memory.engine_commands[1] = pressure


@kernel
def begin_monitor(mon, measured, t):
    """Take the first sample, at t s: there is none to compare it with."""
    M, red = mon.memory, mon.redundancy
    M.stage, M.t_start = 1, t
    red.memory.e_drift = red.config.drift * t
    start_tests(red, measured.signal, measured.force)
    start_bounds(mon.initial_errors, measured.signal)
    M.y_older[:] = red.memory.y_past
    M.substep = (M.substep + 1) % mon.config.substeps


@kernel
def advance_stage(mon):
    """Widen the bound on w by a gyro's error of the first sample, which has caused no innovation. The first
    frame shows no change of an error.
    """
    M = mon.memory
    if M.substep == 0:
        M.stage += 1
    if M.stage == FULL_STAGE - 1 and M.substep == 0:
        for i in range(3):
            M.w_bound[i] += abs(M.w_att[i])


@kernel
def restart_comparison(M):
    """Compare w with the attitude only from the next sample on: a test that restarts has no residual, and
    shows neither an error nor its absence.
    """
    M.stage = 1
    M.gap[:] = 0.0
    M.gap_bound[:] = 0.0
    M.beyond[:] = 0.0
    M.swing[:] = 0.0
    M.c_max[:] = 0.0


@kernel
def advance_gyro_estimate(mon, nu, eta, dt):
    """Advance w, the gyro's error (3,) rad/s if the dynamics are right, and its bound B by a frame of dt s:

    w <- w + dt (nu - D w),    B <- B + dt (eta + |D| B), with -D_ii on the diagonal of |D|

    nu, eta (3,): innovation and its bound, rad/s2.
    """
    w, B, D = mon.memory.w, mon.memory.w_bound, mon.config.D
    w_past, B_past = (w[0], w[1], w[2]), (B[0], B[1], B[2])
    for i in range(3):
        for j in range(3):
            w[i] -= dt * D[i, j] * w_past[j]
            B[i] += dt * (-D[i, j] if i == j else abs(D[i, j])) * B_past[j]
        w[i] += dt * nu[i]
        B[i] = max(B[i] + dt * eta[i], 0.0)


@kernel
def exclude_gyros(mon):
    """Record that no gyro can be broken: w and the attitude disagree by more than both bounds.

    gap <- a gap + residual + h w. Where the attitude is noisy, a surface is isolated only after that.
    """
    M, c = mon.memory, mon.redundancy.config
    h = c.sample_time_s
    for i in range(3):
        test = mon.redundancy.test[TURN_TEST + i]
        leak(M.gap[i], c.decay, test.residual + h * M.w[i])
        leak(M.gap_bound[i], c.decay, h * (M.w_bound[i] + attitude.DAMPING_TOLERANCE * abs(M.w[i])))
        for m in range(c.decay.size):
            if abs(M.gap[i, m]) > M.gap_bound[i, m] + test.B[m]:
                rule_out_gyros(mon)


@kernel
def isolate_sensor(mon, measured, found, bank, bound, dt, t):
    """Raise the alarm, and isolate the sensor once it is the only suspect."""
    o, M = mon.output, mon.memory
    find_worst(mon)
    if o.isolated_sensor != NO_SENSOR:
        return
    for i in range(N_SENSORS):
        if measured.missing[i] and o.isolated_sensor == NO_SENSOR:
            raise_alarm(mon, found, t)
            mark_isolated(mon, i, t)
    if o.isolated_sensor != NO_SENSOR:
        return
    if o.top_ratio > 1.0 and not o.alarmed:
        raise_alarm(mon, found, t)
        o.alarm_test = o.worst_test_index
        mon.initial_errors.e_alarm[:] = mon.initial_errors.e
    if o.alarmed:
        filter_beyond(mon, measured.signal)
        if M.substep == 0 and M.stage == FULL_STAGE:
            judge_gyros(mon, bank, bound, dt)
        latch_exceeded(mon)
        clear_sensors(mon, measured.signal)
        find_suspects(mon)
        n, last = 0, NO_SENSOR
        for i in range(N_SENSORS):
            if o.suspect[i]:
                n, last = n + 1, i
        if n == 1:
            mark_isolated(mon, last, t)


@kernel
def find_worst(mon):
    """Find the test with the largest ratio of residual to bound, of the samples of this frame."""
    o = mon.output
    if mon.memory.substep == 0:
        o.worst_test_index, o.top_ratio = 0, 0.0
    for j, test in enumerate(mon.redundancy.test):
        if test.ratio > o.top_ratio:
            o.worst_test_index, o.top_ratio = j, test.ratio


@kernel
def raise_alarm(mon, found, t):
    """Raise the alarm of the sensors at t s. A surface detected long before was detected with sound sensors,
    and stays detected. Otherwise the conclusion about surfaces is void."""
    o = mon.output
    if o.alarmed:
        return
    o.alarmed, o.alarmed_at_s = 1, t
    if found.detected and found.detected_at_s < t - MIN_LEAD_S:
        o.keeps_surface = 1
        return
    if found.detected:
        # the same fault, which the rates have shown first
        o.alarmed_at_s = found.detected_at_s
    o.had_surface = found.isolated_estimator >= 0


@kernel
def mark_isolated(mon, i, t):
    """Isolate a sensor at t s."""
    mon.output.isolated_sensor, mon.output.isolated_at_s = i, t
    mon.output.is_reading_unused[i] = 1


@kernel
def judge_gyros(mon, bank, bound, dt):
    """Decide, by axis, whether the error that the attitude shows is a gyro's, once that is certain.

        innovation changes as   the dynamics     verdict
        by this jump of a gyro  show an error
        (fits)                  (shows)
        no                      yes or no        refuted
        yes                     yes              confirmed
        yes                     no               refuted if the error is a transient (brief), or so large that
                                                 w would show it (not allowed)
        yes                     no               undecided otherwise

    A transient appears inside a frame, and is absent in all samples of the next. It is no gyro's: an error of
    a gyro stays, and one that varies is not as small in every sample. If an error is there in every sample
    and varies between them, as noise does (varies), the innovation cannot be compared with its jump: the
    innovation contains the errors as the frames begin, and the attitude shows those of the samples before.
    """
    M, nu = mon.memory, bank.output.innovation
    axis = bank_axis(bank)
    for i in range(3):
        if M.gyro_verdict[i] != GYRO_OPEN:
            continue
        w = M.w_att[i]
        w_past = M.w_att_past[i]
        jump = (w - w_past) / dt  # rad/s2
        tol = MAX_DYNAMICS_PER_S * max(abs(w), abs(w_past)) + JUMP_TOLERANCE * abs(jump)
        noise = (  # of w, rad/s, by the attitude's noise
            SAMPLES_IN_JUMP
            * mon.redundancy.test[TURN_TEST + i].bound_per_sample
            / mon.redundancy.config.sample_time_s
        )
        nu_max = bound.nu_max[i] + RATE_ROUNDING
        shows = abs(nu[i]) > nu_max or axis >= 0 or abs(M.w[i]) > M.w_bound[i] + RATE_ROUNDING
        early = M.peak_older[i]
        late = max(abs(w_past), M.peak_past[i], abs(w))
        brief = late < TRANSIENT_LEFT * early and early > MIN_TRANSIENT * noise
        fits = abs(nu[i] - jump) <= nu_max + tol + noise / dt
        least = M.floor_past[i]
        varies = least > noise and M.peak_past[i] > (1.0 + JUMP_TOLERANCE) * least
        allowed = MIN_ESTIMATED_SHARE * abs(w) <= M.w_bound[i] + abs(M.w[i]) + noise
        if not (fits or varies) or (not shows and (brief or not allowed)):
            M.gyro_verdict[i] = GYRO_REFUTED
        elif shows and fits:
            M.gyro_verdict[i] = GYRO_CONFIRMED


@kernel
def latch_exceeded(mon):
    """Record the tests that have exceeded their bounds since the alarm; of turning, and of the angles, those
    that exceed them by more than an error on another axis explains.
    """
    tests, exceeded = mon.redundancy.test, mon.memory.exceeded
    for j in range(N_TESTS):
        most, first = 0.0, TURN_TEST if j < ANGLE_TEST else ANGLE_TEST
        for i in range(3):
            most = max(most, abs(tests[first + i].r[0]))
        coupled = j < SPEED_TEST and abs(tests[j].r[0]) <= COUPLING_SHARE * most
        if tests[j].ratio > 1.0 and not coupled:
            exceeded[j] = 1
    latch_refuted(mon.redundancy, mon.initial_errors, exceeded)


@kernel
def find_suspects(mon):
    """Fill suspect (N_SENSORS,): the sensors whose error explains all tests."""
    suspect, alarm = mon.output.suspect, mon.output.alarm_test
    exceeded = mon.memory.exceeded
    suspect[:] = 0
    if alarm >= N_EQUATIONS:
        suspect_duplicate(mon, alarm - N_EQUATIONS)
        return
    if alarm < SPEED_TEST:
        suspect_attitude(mon)
    if alarm == SPEED_TEST:
        suspect_accelerometers(mon, False)
        suspect[AIRSPEED] = not mon.memory.cleared[AIRSPEED]
    elif alarm == DENSITY_TEST:
        same = mon.memory.n_same[AIRSPEED] > 0  # its test need not show an error then
        suspect[AIRSPEED] = exceeded[SPEED_TEST] == 1 or not speed_contradicts(mon) or same
    suspect[QDYN] = alarm == DENSITY_TEST and alone_exceeded(mon, DENSITY_TEST)
    suspect_flow(mon, ALPHA, ALPHA_TEST, 1)
    suspect_flow(mon, BETA, BETA_TEST, 2)
    suspect[ALTITUDE] = alarm == CLIMB_TEST and alone_exceeded(mon, CLIMB_TEST)
    suspect[ENGINE_SPEED] = alarm == RPM_TEST
    suspect[MANIFOLD] = alarm == PRESSURE_TEST
    frozen = frozen_suspect(mon)
    for i in range(N_INITIAL):
        if not frozen and explains_exceeded(mon.initial_errors, i, alarm):
            suspect[INITIAL_SENSOR[i]] = 1


@kernel
def latch_agreed(mon, fresh):
    """Record which sensors have agreed, before any alarm, with the reading that they should equal."""
    for d in range(DUPLICATE.size):
        agrees = mon.redundancy.test[N_EQUATIONS + d].ratio <= 1.0
        if fresh[DUPLICATE[d] - N_IN_EQUATIONS] and agrees and not mon.output.alarmed:
            mon.memory.agreed[d] = 1


@kernel
def suspect_duplicate(mon, d):
    """Suspect a duplicate sensor, or the reading that it no longer equals.

    The reading is suspected if its own test shows an error, the sensor if an error of the reading of this
    size would have exceeded that test, both if neither is certain.

    No test shows an error that a reading has had from the first sample on, nor a frozen reading.
    """
    red, M = mon.redundancy, mon.memory
    i = COUNTERPART[d]
    j = COUNTERPART_TEST[d]
    own = red.test[j]
    test = red.test[N_EQUATIONS + d]
    # of the reading, if it is the broken one
    least = abs(test.residual) - test.B[0]
    hidden = least <= HIDDEN_FACTOR * max(own.B[0], red.memory.reading_bound[i])
    frozen = is_frozen(mon, i)
    mon.output.suspect[DUPLICATE[d]] = not M.exceeded[j]
    mon.output.suspect[i] = M.exceeded[j] == 1 or hidden or frozen or not M.agreed[d]


@kernel
def alone_exceeded(mon, j):
    """Whether no other test has exceeded its bound: the sensor of this one takes part in no other."""
    for k in range(RPM_TEST):
        if k != j and mon.memory.exceeded[k]:
            return False
    return True


@kernel
def frozen_suspect(mon):
    """Whether a suspect is frozen, which an error of another sensor from the start does not explain. A sound
    sensor may read zero."""
    for i in range(N_SENSORS):
        if mon.output.suspect[i] and mon.redundancy.memory.y_past[i] != 0.0 and is_frozen(mon, i):
            return True
    return False


@kernel
def suspect_flow(mon, vane, j, full):
    """Suspect a vane, an accelerometer, or a gyro whose error may be hidden in the tests of the attitude;
    all of the error of gyro `full` turns the flow. No flow sensor moves the attitude's tests.
    """
    if mon.output.alarm_test != j:
        return
    exceeded = mon.memory.exceeded
    suspect = mon.output.suspect
    n = exceeded[TURN_TEST] + exceeded[TURN_TEST + 1] + exceeded[TURN_TEST + 2]
    suspect_accelerometers(mon, n > 0)
    suspect[vane] = not (n > 0 or mon.memory.cleared[vane])
    for i in range(3):
        shown = n == 1 and exceeded[TURN_TEST + i] == 1
        suspect[i] = (shown or (n == 0 and gyro_hidden(mon, j, i, i == full))) and not mon.memory.cleared[i]


@kernel
def gyro_hidden(mon, j, i, full):
    """Whether an error of gyro i explains the test j of the flow, and stays within the bound of the test of
    its axis; full: all of its error turns the flow. Of another gyro's error a share does, by kinematics.
    """
    red, y_past = mon.redundancy, mon.redundancy.memory.y_past
    alpha = y_past[ALPHA]
    roll = np.cos(alpha) if i == 0 else np.sin(alpha)
    share = abs(np.tan(y_past[BETA]) * roll) if j == ALPHA_TEST else abs(np.sin(alpha))
    flow = red.test[j]
    turn = red.test[TURN_TEST + i]
    for m in range(flow.r.size):
        B = FULL_GYRO_FACTOR * flow.B[m] if full else flow.B[m]
        hidden = HIDDEN_FACTOR * (1.0 if full else share) * turn.B[m]
        if abs(flow.r[m]) > hidden + B:
            return False
    # q does not act on the sideslip
    return full or i == 0 or j == ALPHA_TEST


@kernel
def speed_contradicts(mon):
    """Whether the airspeed error that the density shows would exceed the bound of the airspeed's own test."""
    density, speed = mon.redundancy.test[DENSITY_TEST], mon.redundancy.test[SPEED_TEST]
    ratio = 1.0 + mon.initial_errors.e_alarm[H_AIRSPEED]
    for m in range(density.r.size):
        r = abs(density.r[m]) - effect_at_alarm(mon.initial_errors, H_AIRSPEED, DENSITY_TEST, m)
        # a relative change of the airspeed changes log(density) by twice as much
        dV = 0.5 * mon.redundancy.memory.y_past[AIRSPEED] * r
        if dV > HIDDEN_FACTOR * ratio * speed.B[m]:
            return True
    return False


@kernel
def suspect_attitude(mon):
    """Suspect gyros and attitude: one axis alone, or one angle alone. A gyro's error may appear in an angle
    first. A frozen angle excludes the gyros; it is suspected until it is known not to be frozen."""
    M, suspect = mon.memory, mon.output.suspect
    exceeded = M.exceeded
    verdict = M.gyro_verdict
    n, frozen = 0, False
    for i in range(3):
        n += exceeded[TURN_TEST + i]
        frozen = frozen or is_frozen(mon, PHI + i)
    for i in range(3):
        alone = n == 0 or (exceeded[TURN_TEST + i] == 1 and n == 1)
        suspect[i] = alone and verdict[i] != GYRO_REFUTED and not frozen
        explains = explains_turns(mon, i)
        only = explains_angles(mon, i) and (exceeded[ANGLE_TEST + i] == 1 or explains)
        wrong = only and verdict[worst_turn_axis(mon, i)] != GYRO_CONFIRMED
        n_same = M.n_same[PHI + i]
        n_frozen = mon.config.n_frozen[PHI + i]
        # too early to say
        early = 0 < n_same < n_frozen < N_FROZEN_NEVER
        suspect[PHI + i] = wrong or (explains and early)


@kernel
def explains_angles(mon, i):
    """Whether no test of another angle shows an error that one of angle i (phi, theta, psi) from the start
    does not explain.
    """
    for j in range(3):
        over = (
            mon.memory.exceeded[ANGLE_TEST + j]
            if i == 2
            else mon.initial_errors.refuted[H_PHI + i, ANGLE_TEST + j]
        )
        if j != i and over:
            return False
    return True


@kernel
def filter_beyond(mon, y):
    """Filter what the tests of turning show beyond an error of one angle i, for each of phi, theta and psi.

    An error that changes by x within a sample moves the residual of its angle by x and that of body axis j by
    c_j x (turn_share). If this angle alone is wrong, r_j - c_j r_i contains noise alone.
    """
    red, M = mon.redundancy, mon.memory
    for i in range(3):
        r = red.test[ANGLE_TEST + i].residual
        leak(M.swing[i], red.config.decay, abs(r))
        for j in range(3):
            c = turn_share(y, j, i)
            M.c_max[i, j] = max(M.c_max[i, j], abs(c))
            leak(M.beyond[i, j], red.config.decay, red.test[TURN_TEST + j].residual - c * r)


@kernel
def explains_turns(mon, i):
    """Whether an error x of angle i (phi, theta, psi) explains the tests of the axes: one as large as the
    residual of the angle's own test allows now, or as its residuals since the alarm have shown.
    """
    M = mon.memory
    red, angle = mon.redundancy, mon.redundancy.test[ANGLE_TEST + i]
    e = red.memory.reading_bound
    e_tilt = e[PHI] + e[THETA]
    for j in range(3):
        turn = red.test[TURN_TEST + j]
        c = turn_share(red.memory.y_past, j, i)
        c_max = abs(c) + e_tilt
        for m in range(red.config.decay.size):
            x = abs(angle.r[m]) + angle.B[m]
            initial = effect_at_alarm(mon.initial_errors, H_PHI + i, TURN_TEST + j, m) if i < 2 else 0.0
            sound = turn.B[m] + initial
            beyond = sound + M.c_max[i, j] * angle.B[m] + e_tilt * M.swing[i, m]
            if (
                M.exceeded[TURN_TEST + j]
                and abs(turn.r[m]) > c_max * x + sound
                and abs(M.beyond[i, j, m]) > beyond
            ):
                return False
    return True


@kernel
def worst_turn_axis(mon, i):
    """The body axis whose test of turning has the largest ratio; i if none is larger than its own."""
    axis, tests = i, mon.redundancy.test
    for j in range(3):
        if tests[TURN_TEST + j].ratio > tests[TURN_TEST + axis].ratio:
            axis = j
    return axis


@kernel
def allows_isolation(mon, is_earlier):
    """Whether a surface may be isolated; is_earlier: the alarm was a frame or more ago."""
    if not mon.config.enabled:
        return True
    return (
        is_earlier == 1 and (mon.memory.gyros_excluded == 1 or not mon.config.noisy) and not flow_frozen(mon)
    )


@kernel
def may_be_initial(mon, detected_at_s):
    """Whether the alarm of the surfaces is so early that an error which a flow sensor has had from the start
    may have caused it: the design model uses its reading from the first frame on."""
    return mon.config.enabled and detected_at_s < mon.memory.t_start + INITIAL_WINDOW_S


@kernel
def flow_frozen(mon):
    """Whether a flow sensor is frozen: a surface that moves the aircraft moves its reading. In symmetric
    flight a sideslip of zero stays zero."""
    for i in (ALPHA, BETA, AIRSPEED, QDYN):
        if mon.redundancy.memory.y_past[i] != 0.0 and is_frozen(mon, i):
            return True
    return False


@kernel
def has_alarm(mon):
    """Whether the monitor has raised its alarm: no surface is isolated then."""
    return mon.config.enabled and mon.output.alarmed


@kernel
def replace_readings(mon, pred, measured):
    """Replace the readings of isolated or missing sensors by estimates from the others. Accelerometers are
    not replaced: then none of them is used."""
    y, any_replaced, slipstream = measured.signal, False, False
    for i in range(N_SENSORS):
        if measured.missing[i]:
            mon.output.is_reading_unused[i] = 1
        if mon.output.is_reading_unused[i] and i < AX:
            y[i] = estimate_reading(mon, pred, y, i)
            any_replaced = True
            slipstream = slipstream or i in (AIRSPEED, QDYN, ENGINE_SPEED, MANIFOLD)
    if any_replaced:
        share_out(measured)
    if slipstream and mon.config.has_engine:
        note_slipstream(measured)


@kernel
def estimate_reading(mon, pred, y, i):
    """The estimate of a sensor's reading from the other sensors, in its unit."""
    M = mon.redundancy.memory
    if i < 3:
        return estimate_rate(mon, pred, i)
    if i in (ALPHA, BETA):
        return M.predicted_reading[i] + mon.redundancy.config.sample_time_s / VANE_RETURN_S * (
            mon.config.y_trim[i] - M.predicted_reading[i]
        )
    rho = 2.0 * M.y_past[QDYN] / M.y_past[AIRSPEED] ** 2
    if i == AIRSPEED:
        return np.sqrt(max(2.0 * y[QDYN] / rho, MIN_AIRSPEED_MPS**2))
    if i == QDYN:
        return 0.5 * rho * y[AIRSPEED] ** 2
    if i >= ENGINE_SPEED:
        return M.engine_commands[i - ENGINE_SPEED]
    return M.predicted_reading[i]


@kernel
def estimate_rate(mon, pred, i):
    """Body rate about axis i, rad/s: that of the attitude by the sample before, and the model's change since,
    with the surface faults that stay isolated.

    The rate itself is used for the next sample: its own error shows there.
    """
    c = mon.redundancy.config
    M = mon.redundancy.memory
    test = mon.redundancy.test[TURN_TEST + i]
    u = pred.u_old if mon.memory.substep == 0 else pred.u
    acc = pred.f[i]
    for s in range(u.size):
        acc += pred.G[i, s] * u[s]
    if mon.output.keeps_surface:
        acc += pred.F_known[i] - pred.means.F[i]
    angle = mon.config.rate_gain * test.residual
    if not mon.memory.replaced[i] and mon.config.rate_gain < 1.0:
        angle = c.sample_time_s * FILTER_POLES_PER_S[RATE_POLE] * test.r[RATE_POLE]
    mon.memory.replaced[i] = 1
    rate = M.y_past[i] + angle / c.sample_time_s
    return rate + c.sample_time_s * acc
