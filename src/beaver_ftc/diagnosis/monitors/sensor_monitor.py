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
    equation of a row      the sensor of the row
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
acceleration that no model explains, a jump of the attitude is none. With D_x the damping of the rates (3, 3),
1/s, and nu the innovation (3,), rad/s2, the filter

    W' = nu - D_x W        `advance_gyro_estimate`

follows a gyro's error exactly, and stays within its bound for an error of the attitude (`judge_gyros`). W is
`w` in the record, rad/s.

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
initial_errors.py. mon: record of the monitor; o: its output; found: the conclusion about surfaces; bank: the
detection filters; pred: the prediction of the model.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.table import DPT
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.detection.filters import bank_axis, leak
from beaver_ftc.diagnosis.monitors.initial_errors import (
    H_AIRSPEED,
    H_PHI,
    INITIAL_SENSOR,
    N_INITIAL,
    exceeds,
    explains_exceeded,
    latch_refuted,
    speed,
    start_bounds,
    update_bounds,
)
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    COUNTERPART,
    DENSITY_TEST,
    DUPLICATE,
    FILTER_POLES_PER_S,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    N_EQUATIONS,
    N_POLES,
    N_TESTS,
    NO_SENSOR,
    PSI,
    RPM_TEST,
    SENSOR_OF,
    SPEED_TEST,
    TEST_NAMES,
    THETA,
)
from beaver_ftc.diagnosis.monitors.redundancy import (
    AB_NOW,
    FORCE_JUMP_M_S2,
    MIN_AIRSPEED_MPS,
    run_tests,
    start_tests,
    store_sample,
    too_steep,
)
from beaver_ftc.diagnosis.monitors.rotation import components, down, unit
from beaver_ftc.plant.instruments import (
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    set_inertial,
    share_out,
    slipstream_read,
)
from beaver_ftc.scenario.sensors import ROWS

# A residual below this share of the largest of the three axes, or angles, is taken for its coupling
COUPLING_SHARE = 0.03
# stage: 1 after the first sample and while the pitch is too steep, 2 with the first whole frame, 3 from
# the next frame on: only then the innovation contains the change of a gyro's error between two frames
FULL_STAGE = 3
MIN_LEAD_S = 0.5  # a surface detected this long before the alarm was detected with sound sensors
N_FROZEN_NEVER = 1_000_000_000  # JSBSim frames: a sound reading may repeat, if its steps exceed its noise
INITIAL_WINDOW_S = 1.0  # an alarm of the surfaces within this time from the start may be an initial error's

ANGLES, FORCES = (PHI, THETA, PSI), (AX, AX + 1, AX + 2)


# One gyro. shown, shown_past, rad/s: its error if the attitude is right, as this frame begins and as the one
# before began; most, least: the largest and smallest size of the error in the other samples of this frame, of
# the one before (most_past, least_past), and the largest in the one before that (most_older). gap, B_gap
# (poles,) rad: filtered difference of the turn that the attitude and w show, and its bound; beyond it no gyro
# can be broken. verdict: GYRO_OPEN, GYRO_CONFIRMED or GYRO_REFUTED. replaced: whether its reading is.
GYRO_RECORD = record(
    shown=float, shown_past=float, most=float, most_past=float, most_older=float,
    least=float, least_past=float, gap=N_POLES, B_gap=N_POLES, verdict=int, replaced=int,
)  # fmt: skip

# One flow sensor (speed, incidence or sideslip) since the alarm. r_sum, B_sum, H_sum: sums of the residuals,
# of the bound on the part of sound sensors, and on that of an error from the start, in the unit of the
# residual; y_min, y_max: range of the reading.
FLOW_RECORD = record(r_sum=float, B_sum=float, H_sum=float, y_min=float, y_max=float)

# What isolation keeps, in the record of the monitor.
ISOLATION_FIELDS = {
    "stage": int, "t_start": float, "substep": int, "exceeded": (int, N_TESTS),
    # since the alarm, rad: by angle, body axis and pole, filtered residual of turning beyond the part of the
    # angle's own residual; by angle and pole, filtered size of the angle's residual; by angle and body axis,
    # largest size of turn_share
    "beyond": (3, 3, N_POLES), "swing": (3, N_POLES), "c_max": (3, 3),
    # by axis, rad/s: error of the gyro if the dynamics are right (`advance_gyro_estimate`), and its bound
    "w": 3, "w_bound": 3, "gyro": (GYRO_RECORD, 3), "flow": (FLOW_RECORD, 3),
    "gyros_excluded": int, "n_same": (int, N_SENSORS), "cleared": (int, N_SENSORS), "turn_max": float,
    "jump": float,  # of the accelerometers, m/s2, which fades
    "n_since": int,  # samples since the alarm
    # m, filtered: error of the climb, of an incidence with the error that its residuals show
    "climb": N_POLES,
}  # fmt: skip


# The monitor: alarm, isolation, and what others ask of it


@kernel
def expect_pressure(mon, pressure):
    """Predict the manifold pressure, inHg, from the command of the law in charge of the engine."""
    mon.y_pred[MANIFOLD] = pressure


@kernel
def check_sensors(mon, pred, measured, found, bank, bound, dt, t):
    """Test the sensors at t s, and replace in `measured` the readings of broken ones.

    bank: with the innovation of the elapsed frame, of dt s; bound: with the bound on that innovation.
    """
    y = measured.signal
    if not mon.stage:
        start_monitor(mon, y, measured.force, t)
    else:
        if mon.substep == 0:
            advance_gyro_estimate(mon, bank.output.innovation, bound.eta_bar, dt)
        run_tests(mon, y, measured.fresh)
        update_bounds(mon, y)
        count_same(mon, y)
        follow_gyro_errors(mon)
        if too_steep(mon, y):
            restart_comparison(mon)
        else:
            advance_stage(mon)
            if mon.config.noisy:
                exclude_gyros(mon)
        isolate_sensor(mon, measured, found, bank, bound, dt, t)
        replace_readings(mon, pred, measured)
        store_sample(mon, y, measured.force)
    mon.substep = (mon.substep + 1) % mon.config.substeps


@kernel
def start_monitor(mon, y, force, t):
    """Start with the first sample, at t s: there is none to compare it with; force (3,) m/s2."""
    mon.stage, mon.t_start, mon.e_drift = 1, t, mon.drift * t
    start_tests(mon, y, force)
    start_bounds(mon, y)


@kernel
def isolate_sensor(mon, measured, found, bank, bound, dt, t):
    """Raise the alarm, and isolate the sensor once it is the only suspect.

    A missing reading isolates its sensor. The test with the largest ratio beyond 1 raises the alarm; from
    then on each sample adds to what gyros, flow sensors and tests have shown, until all but one are excluded.
    """
    o = mon.output
    worst = np.argmax(mon.ratio)
    if mon.substep == 0 or mon.ratio[worst] > o.top_ratio:  # of the samples of this frame
        o.worst_test_index, o.top_ratio = worst, mon.ratio[worst]
    for i in range(N_SENSORS):
        if measured.missing[i] and o.isolated_sensor == NO_SENSOR:
            mark_isolated(mon, found, i, t)
    if o.isolated_sensor != NO_SENSOR:
        return
    if o.top_ratio > 1.0 and not o.alarmed:
        raise_alarm(mon, found, t)
        o.alarm_test = o.worst_test_index
        mon.initial.E_alarm[:] = mon.initial.E
    if o.alarmed:
        filter_beyond(mon, measured.signal)
        if mon.substep == 0 and mon.stage == FULL_STAGE:
            judge_gyros(mon, bank, bound, dt)
        latch_exceeded(mon)
        if SPEED_TEST <= o.alarm_test <= BETA_TEST:
            clear_sensors(mon, measured.signal)
        find_suspects(mon)
        if o.suspect.sum() == 1:
            mark_isolated(mon, found, np.argmax(o.suspect), t)


@kernel
def raise_alarm(mon, found, t):
    """Raise the alarm of the sensors at t s. A surface detected long before was detected with sound sensors,
    and stays detected. Otherwise the conclusion about surfaces is void."""
    o = mon.output
    if o.alarmed:
        return
    o.alarmed, o.alarmed_at_s = 1, t
    if found.detected:
        o.keeps_surface = found.detected_at_s < t - MIN_LEAD_S
        if not o.keeps_surface:  # the same fault, which the rates have shown first
            o.alarmed_at_s = found.detected_at_s


@kernel
def mark_isolated(mon, found, i, t):
    """Isolate a sensor at t s; its alarm is raised by then."""
    raise_alarm(mon, found, t)
    mon.output.isolated_sensor = i
    mon.output.isolated_at_s = t
    mon.output.is_reading_unused[i] = 1


@kernel
def latch_exceeded(mon):
    """Record the tests that have exceeded their bounds since the alarm; of turning, and of the angles, those
    that exceed them by more than an error on another axis explains.
    """
    exceeded = mon.exceeded
    for j in range(N_TESTS):
        least = -1.0
        if j < SPEED_TEST:  # the largest of the three axes, or angles, of this test
            least = COUPLING_SHARE * np.abs(mon.r[j - j % 3 : j - j % 3 + 3, 0]).max()
        exceeded[j] |= mon.ratio[j] > 1.0 and abs(mon.r[j, 0]) > least
    latch_refuted(mon, exceeded)


@kernel
def name_gyro(mon, found, i, t):
    """Isolate gyro i at t s. What was concluded of surfaces is void, unless one was isolated before."""
    o = mon.output
    mark_isolated(mon, found, i, t)
    if o.keeps_surface and found.isolated_estimator < 0:
        o.keeps_surface = 0
        o.alarmed_at_s = found.detected_at_s


@kernel
def has_alarm(mon):
    """Whether the monitor has raised its alarm, as only an enabled one does: no surface is isolated then."""
    return mon.output.alarmed


@kernel
def doubts_gyros(mon):
    """Whether a gyro may be the cause of the alarm of the surfaces; of a monitor that is not enabled `noisy`
    is 0."""
    return mon.config.noisy == 1 and mon.gyros_excluded == 0


@kernel
def allows_isolation(mon, is_earlier, detected_at_s):
    """Whether the data may speak about surfaces, whose alarm was raised at detected_at_s; is_earlier: a frame
    or more ago.

    They do not while a flow sensor is frozen: a surface that moves the aircraft moves its reading. In
    symmetric flight a sideslip of zero stays zero. Nor do they after an alarm so early that an error which a
    flow sensor has had from the start may have caused it: the design model uses its reading from the first
    frame on.
    """
    if not mon.config.enabled:
        return True
    if detected_at_s < mon.t_start + INITIAL_WINDOW_S:
        return False
    for i in (I_ALPHA, I_BETA, I_AIRSPEED, I_QDYN):
        if stands_still(mon, i):
            return False
    return is_earlier == 1 or doubts_gyros(mon)


@kernel
def add_turn(mon, att, y):
    """Add to the comparison of attitude and rates what the attitude has turned beyond the gyros in this
    sample; near the vertical it shows no turn."""
    if too_steep(mon, y):
        attitude.restart(att)
        return
    for i in range(3):
        attitude.add_turn(att, i, mon.residual[i])
    mon.turn_max = att.turn_max


@kernel
def count_same(mon, y):
    """Count the samples for which each reading has been the very same, and find the largest jump of an
    accelerometer from one sample to the next, m/s2, which fades within JUMP_MEMORY_S.
    """
    mon.jump *= 1.0 - mon.h / JUMP_MEMORY_S
    for i in range(N_SENSORS):
        mon.n_same[i] = mon.n_same[i] + 1 if y[i] == mon.y_past[i] else 0
    for i in FORCES:
        mon.jump = max(mon.jump, abs(y[i] - mon.y_past[i]))


@kernel
def is_frozen(mon, i):
    """Whether sensor i is frozen."""
    return mon.n_same[i] >= mon.config.n_frozen[i]


@kernel
def last_frozen(mon, sensors):
    """The last of these sensors that is frozen, or NO_SENSOR."""
    last = NO_SENSOR
    for i in sensors:
        last = i if is_frozen(mon, i) else last
    return last


@kernel
def stands_still(mon, i):
    """Whether a sensor is frozen at a reading that is not zero: a sound one may read zero."""
    return mon.y_past[i] != 0.0 and is_frozen(mon, i)


# Gyro or attitude?

GYRO_OPEN, GYRO_CONFIRMED, GYRO_REFUTED = 0, 1, 2  # verdicts of a gyro
MAX_DYNAMICS_PER_S = 10.0  # largest innovation, rad/s2, by 1 rad/s of a gyro's error itself
JUMP_TOLERANCE = 0.1  # share of a gyro's jump by which the innovation may differ from it
MIN_ESTIMATED_SHARE = 0.7  # w shows at least this share of a gyro's error
SAMPLES_IN_JUMP = 4.0  # a jump is the difference of two residuals, each with the noise of two samples
MIN_TRANSIENT = 2.0  # least size of a transient over the bound on noise: noise may be all of a smaller one
TRANSIENT_LEFT = 0.003  # largest share of a transient that is left in the next frame
RATE_ROUNDING = 1e-6  # rad/s, and rad/s2: the part of the bounds that covers rounding


@kernel
def turn_share(y, i, j):
    """c: rotation about body axis i for a change of phi, theta or psi (j 0, 1, 2), rad/rad, at attitude y:
    that of phi turns about the first body axis, of theta about the level second axis, of psi about the
    vertical."""
    across = 0.0, np.cos(y[PHI]), -np.sin(y[PHI])
    return ((1.0, 0.0, 0.0), across, components(down(y)))[j][i]


@kernel
def advance_gyro_estimate(mon, nu, eta, dt):
    """Advance W, the gyro's error (3,) rad/s if the dynamics are right, W' = nu - D_x W, and its bound B by a
    frame of dt s:

    W <- A W + dt nu,    B <- |A| B + dt eta,    A = I - dt D_x

    nu, eta (3,): innovation and its bound, rad/s2.
    """
    w, B = mon.w, mon.w_bound
    w0, B0 = np.copy(w), np.copy(B)
    for i in range(3):
        w[i] = dt * nu[i]
        B[i] = dt * eta[i]
        for j in range(3):
            A = (i == j) - dt * mon.config.D[i, j]
            w[i] += A * w0[j]
            B[i] += abs(A) * B0[j]


@kernel
def follow_gyro_errors(mon):
    """Keep what the attitude shows of each gyro's error, rad/s, if it is right itself: -residual / h."""
    for i, g in enumerate(mon.gyro):
        w = -mon.residual[i] / mon.h
        if mon.substep == 0:
            g.shown_past, g.shown = g.shown, w
            g.most_older, g.most_past, g.most = g.most_past, g.most, 0.0
            g.least_past, g.least = g.least, np.inf
        else:
            g.most, g.least = max(g.most, abs(w)), min(g.least, abs(w))


@kernel
def restart_comparison(mon):
    """Compare w with the attitude only from the next sample on: a test that restarts has no residual, and
    shows neither an error nor its absence.
    """
    mon.stage = 1
    mon.beyond[:] = mon.swing[:] = mon.c_max[:] = 0.0
    for g in mon.gyro:
        g.gap[:] = g.B_gap[:] = 0.0


@kernel
def advance_stage(mon):
    """Widen the bound on w by a gyro's error of the first sample, which has caused no innovation. The first
    frame shows no change of an error.
    """
    if mon.stage < FULL_STAGE and mon.substep == 0:
        mon.stage += 1
        if mon.stage < FULL_STAGE:
            for i, g in enumerate(mon.gyro):
                mon.w_bound[i] += abs(g.shown)


@kernel
def exclude_gyros(mon):
    """Record that no gyro can be broken: W and the attitude disagree by more than both bounds.

        gap <- a gap + residual + h W,    B_gap <- a B_gap + h (W_bound + DAMPING_TOLERANCE |W|)
        |gap| > B_gap + B        for some pole

    Where the attitude is noisy, a surface is isolated only after that.
    """
    for i, g in enumerate(mon.gyro):
        w = mon.w[i]
        leak(g.gap, mon.decay, mon.residual[i] + mon.h * w)
        leak(g.B_gap, mon.decay, mon.h * (mon.w_bound[i] + attitude.DAMPING_TOLERANCE * abs(w)))
        if exceeds(g.gap, 1.0, g.B_gap, 1.0, mon.B[i]):
            rule_out_gyros(mon)


@kernel
def rule_out_gyros(mon):
    """No gyro can be broken: a surface may be isolated."""
    mon.gyros_excluded = 1


@kernel
def filter_beyond(mon, y):
    """Filter what the tests of turning show beyond an error of one angle i, for each of phi, theta and psi.

    An error that changes by x within a sample moves the residual of its angle by x and that of body axis j by
    c_j x (turn_share). If this angle alone is wrong, r_j - c_j r_i contains noise alone.
    """
    for i in range(3):
        r = mon.residual[ANGLE_TEST + i]
        leak(mon.swing[i], mon.decay, abs(r))
        for j in range(3):
            c = turn_share(y, j, i)
            mon.c_max[i, j] = max(mon.c_max[i, j], abs(c))
            leak(mon.beyond[i, j], mon.decay, mon.residual[j] - c * r)


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

        shows      |nu| > nu_max, or a residual of the bank exceeds its threshold, or |W| > W_bound
        fits       |nu - jump| <= nu_max + tol + noise / dt,    jump = (shown - shown_past) / dt
        allowed    MIN_ESTIMATED_SHARE |shown| <= W_bound + |W| + noise

    shown: error by the attitude, rad/s; noise: of `shown`, by the attitude's noise, rad/s; tol: by the
    dynamics and by rounding of the jump, rad/s2; dt s.

    A transient appears inside a frame, and is absent in all samples of the next. It is no gyro's: an error of
    a gyro stays, and one that varies is not as small in every sample. If an error is there in every sample
    and varies between them, as noise does (varies), the innovation cannot be compared with its jump: the
    innovation contains the errors as the frames begin, and the attitude shows those of the samples before.
    """
    nu = bank.output.innovation
    for i, g in enumerate(mon.gyro):
        if g.verdict != GYRO_OPEN:
            continue
        estimate, B = abs(mon.w[i]), mon.w_bound[i]
        largest, jump = max(abs(g.shown), abs(g.shown_past)), (g.shown - g.shown_past) / dt
        noise = SAMPLES_IN_JUMP * mon.per_sample[i] / mon.h
        nu_max = bound.nu_max[i] + RATE_ROUNDING
        shows = abs(nu[i]) > nu_max or bank_axis(bank) >= 0 or estimate > B + RATE_ROUNDING
        tol = MAX_DYNAMICS_PER_S * largest + JUMP_TOLERANCE * abs(jump)
        fits = abs(nu[i] - jump) <= nu_max + tol + noise / dt
        varies = noise < g.least_past < g.most_past / (1.0 + JUMP_TOLERANCE)
        gone = max(largest, g.most_past) < TRANSIENT_LEFT * g.most_older
        brief = gone and g.most_older > MIN_TRANSIENT * noise
        allowed = MIN_ESTIMATED_SHARE * abs(g.shown) <= B + estimate + noise
        if fits and shows:
            g.verdict = GYRO_CONFIRMED
        elif not (fits or varies) or (not shows and (brief or not allowed)):
            g.verdict = GYRO_REFUTED


# Accelerometers or flow sensor?

JUMP_WINDOW_S = 1.0  # a jump counts within this time after the alarm: later, one by chance is too likely
JUMP_MEMORY_S = 2.0  # time constant with which the largest jump of an accelerometer fades
MIN_JUMP_SHARE = 0.5  # the flow sensor's own reading jumps by at least this share of the residual
# Least ratio of summed residuals to the range of the reading: a scale error within 3 % of -1 gives so much
MIN_SUM_RATIO = 30.0
CLEAR_FACTOR = 3.0  # an effect clears a sensor only beyond so many times the bound on it
TIME_ROUNDING_S = 1e-9


@kernel
def clear_sensors(mon, y):
    """Clear the flow sensor, or the accelerometers, by this sample, that of the alarm or a later one."""
    alarm = mon.output.alarm_test
    flow = SENSOR_OF[alarm]
    by_density = alarm == SPEED_TEST and mon.exceeded[DENSITY_TEST]
    if is_frozen(mon, flow) or flow_jumped(mon, y, flow) or by_density:
        mon.cleared[AX:] = 1
    sum_flow(mon, y)
    ranges = sum_exceeds_range(mon.flow[alarm - SPEED_TEST])
    if ranges or contradicted(mon, y) or last_frozen(mon, FORCES) >= 0:
        mon.cleared[flow] = 1
    clear_gyros(mon, y)


@kernel
def flow_jumped(mon, y, i):
    """Whether, soon after the alarm, the residual exceeds any jump of an accelerometer in one sample, and the
    reading of the flow sensor i jumps with it.

        |r| > B + FORCE_JUMP_M_S2 per_a,    |ddy| >= MIN_JUMP_SHARE |r| > 3/2 jump per_a

    r: residual of the sample; per_a: residual for an acceleration error of 1 m/s2 in one sample; ddy: second
    difference of the reading; jump: largest of an accelerometer, m/s2; 3/2: its weight in the integration.
    """
    j = mon.output.alarm_test
    per_a = mon.h / (1.0 if j == SPEED_TEST else speed(mon.y_past))
    ddy = abs(y[i] - 2.0 * mon.y_past[i] + mon.y_older[i])
    r = abs(mon.residual[j])
    soon = mon.n_since * mon.h < JUMP_WINDOW_S - TIME_ROUNDING_S
    leaps = r > mon.B[j, 0] + FORCE_JUMP_M_S2 * per_a
    return soon and leaps and ddy >= MIN_JUMP_SHARE * r > AB_NOW * mon.jump * per_a


@kernel
def sum_flow(mon, y):
    """Add up, after the sample of the alarm, the residuals of speed, incidence and sideslip, the part of
    sound sensors and that of an error from the start; and find the range of each reading.

        r_sum <- r_sum + residual,    B_sum <- B_sum + h per_s,    H_sum <- H_sum + E H
        climb <- a climb + h V alpha cos(phi) cos(theta)

    alpha: error of the incidence that the sums leave unexplained, rad: r_sum beyond B_sum + H_sum; climb: its
    effect on the altitude, m, filtered.
    """
    for n, f in enumerate(mon.flow):
        j = SPEED_TEST + n
        now = y[SENSOR_OF[j]]
        if mon.n_since == 0:
            f.y_min = f.y_max = now
            # noise of the first and of the last sample
            f.B_sum = 2.0 * mon.per_sample[j] + mon.gust[j] * mon.gust_max
        else:
            f.r_sum += mon.residual[j]
            f.B_sum += mon.h * mon.per_s[j]
            f.H_sum += mon.initial.E_alarm[n] * mon.initial.H[n, j]
            f.y_min, f.y_max = min(f.y_min, now), max(f.y_max, now)
    f = mon.flow[ALPHA_TEST - SPEED_TEST]
    most = f.B_sum + f.H_sum
    alpha = f.r_sum - min(max(f.r_sum, -most), most)
    leak(mon.climb, mon.decay, mon.h * y[I_AIRSPEED] * alpha * np.cos(y[PHI]) * np.cos(y[THETA]))
    mon.n_since += 1


@kernel
def sum_exceeds_range(f):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range:

    |r_sum| > MIN_SUM_RATIO (y_max - y_min) + CLEAR_FACTOR (B_sum + H_sum)
    """
    span = f.y_max - f.y_min
    return span > 0.0 and abs(f.r_sum) > MIN_SUM_RATIO * span + CLEAR_FACTOR * (f.B_sum + f.H_sum)


@kernel
def contradicted(mon, y):
    """Whether an airspeed of this error would exceed the test of the density, or an incidence that of the
    climb, while that test is within its bound, for some pole by

        effect > CLEAR_FACTOR (B + e H)

    effect: |climb| of `sum_flow`, m, or of the airspeed 2 (1 - e) / V (|r| - B_speed); e, H: bound on an
    error from the start, and its effect.
    """
    alarm = mon.output.alarm_test
    other = DENSITY_TEST if alarm == SPEED_TEST else CLIMB_TEST
    if alarm == BETA_TEST or mon.exceeded[other]:
        return False
    h = alarm - SPEED_TEST
    e, r, B = mon.initial.E_alarm[h], mon.r[alarm], mon.B[alarm]
    # log(density) changes by twice the relative change of the airspeed
    share = 2.0 * (1.0 - min(e, 1.0)) / speed(y)
    for m, climb in enumerate(mon.climb):
        effect = abs(climb) if alarm == ALPHA_TEST else share * (abs(r[m]) - B[m])
        if effect > CLEAR_FACTOR * (mon.B[other, m] + e * mon.initial.H_m[h, other, m]):
            return True
    return False


@kernel
def clear_gyros(mon, y):
    """Clear each gyro whose axis does not turn in this sample as an error would that explains the incidence,
    or the sideslip. Near the vertical the attitude shows no turn.

    turn_max, rad: by noise and constant errors with the declared probability (attitude.py), 0 if unknown.
    """
    alarm = mon.output.alarm_test
    least = abs(mon.residual[alarm]) - mon.B[alarm, 0]
    if alarm == SPEED_TEST or too_steep(mon, y) or not 0.0 < mon.turn_max < least:
        return
    for i in range(3):
        mon.cleared[i] |= abs(mon.residual[i]) < mon.turn_max


# The suspects

MIN_AXIS_SHARE = 0.5  # least share of the spurious velocity along the axis of a suspected accelerometer
# A test within its bound B hides an error whose effect is up to this factor times B, because the effect of
# sound sensors, up to B, may have the other sign. For the gyro that turns the flow by all of its error it is
# also the margin on the bound of the flow's test.
HIDDEN_FACTOR = 2.0
# of the reading that a duplicate sensor should equal: the test that an error of it exceeds
COUNTERPART_TEST = np.array([TEST_NAMES.index(ROWS[i].test) for i in COUNTERPART], np.int64)


@kernel
def find_suspects(mon):
    """Fill suspect (N_SENSORS,): the sensors whose error explains all tests. An error of another sensor from
    the start does not explain a frozen suspect."""
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
    for h, i in enumerate(INITIAL_SENSOR):
        suspect[i] |= explains_exceeded(mon, h, alarm)


@kernel
def suspect_duplicate(mon, d):
    """Suspect a duplicate sensor, or the reading that it no longer equals.

    The reading is suspected if its own test shows an error, the sensor if an error of the reading of this
    size would have exceeded that test, both if neither is certain.

    No test shows an error that a reading has had from the first sample on, nor a frozen reading.
    """
    suspect = mon.output.suspect
    i, own, j = COUNTERPART[d], COUNTERPART_TEST[d], N_EQUATIONS + d
    # of the reading, if it is the broken one
    least = abs(mon.residual[j]) - mon.B[j, 0]
    hidden = least <= HIDDEN_FACTOR * max(mon.B[own, 0], mon.e[i])
    suspect[DUPLICATE[d]] = not mon.exceeded[own]
    suspect[i] = mon.exceeded[own] == 1 or hidden or is_frozen(mon, i) or not mon.agreed[d]


@kernel
def alone(shown, i):
    """Whether none of these tests but test i shows an error; shown (tests,)."""
    return shown.sum() == shown[i]


@kernel
def suspect_attitude(mon):
    """Suspect gyros and attitude: one axis alone, or one angle alone, but for what an error of phi or theta
    from the start explains. A gyro's error may appear in an angle first. A frozen angle excludes the gyros;
    it is suspected until it is known not to be frozen.

    turns, angles (3,): which tests of turning and of the angles have been exceeded; refuted (2, 3): by which
    of the latter an error from the start of phi, and of theta; axis: of the gyro that would be at fault
    instead.
    """
    suspect, ratio = mon.output.suspect, mon.ratio[:ANGLE_TEST]
    turns, angles = mon.exceeded[:ANGLE_TEST], mon.exceeded[ANGLE_TEST:SPEED_TEST]
    refuted = mon.initial.refuted[H_PHI:, ANGLE_TEST:SPEED_TEST]
    frozen = last_frozen(mon, ANGLES) >= 0
    worst = np.argmax(ratio)
    for i in range(3):
        suspect[i] = alone(turns, i) and mon.gyro[i].verdict != GYRO_REFUTED and not frozen
        explains = explains_turns(mon, i)
        k = PHI + i
        unshared = alone(angles, i) if i == 2 else alone(refuted[i], i)
        only = unshared and (explains or angles[i] == 1)
        axis = worst if ratio[worst] > ratio[i] else i
        # too early to say
        early = 0 < mon.n_same[k] < mon.config.n_frozen[k] < N_FROZEN_NEVER
        suspect[k] = (only and mon.gyro[axis].verdict != GYRO_CONFIRMED) or (explains and early)


@kernel
def explains_turns(mon, i):
    """Whether an error of angle i (phi, theta, psi) explains the tests of the axes: one as large as the
    residual of the angle's own test allows now, or as its residuals since the alarm have shown.

    It does not if an axis j that has exceeded its bound has for some pole m

        now      |r_j| > c (|r_own| + B_own) + B_j + E H
        since    |beyond_ij| > B_j + E H + c_max B_own + tilt swing_i

    c: |turn_share| + tilt, rad/rad: the attitude may be off by tilt = e_phi + e_theta, rad; E, H: bound on an
    error from the start and its effect (initial_errors.py), of psi none.
    """
    own, h = ANGLE_TEST + i, min(H_PHI + i, N_INITIAL - 1)
    initial = mon.initial.E_alarm[h] if i < 2 else 0.0
    tilt = mon.e[PHI] + mon.e[THETA]
    for j in range(3):
        r, c = mon.r[j], abs(turn_share(mon.y_past, j, i)) + tilt
        for m in range(r.size):
            B = mon.B[own, m]
            sound = mon.B[j, m] + initial * mon.initial.H_m[h, j, m]
            now = abs(r[m]) > c * (abs(mon.r[own, m]) + B) + sound
            since = abs(mon.beyond[i, j, m]) > sound + mon.c_max[i, j] * B + tilt * mon.swing[i, m]
            if mon.exceeded[j] and now and since:
                return False
    return True


@kernel
def suspect_flow(mon, alarm):
    """Suspect a flow sensor, an accelerometer, or a gyro whose error may be hidden in the tests of the
    attitude. No flow sensor moves the attitude's tests.
    """
    suspect, turns = mon.output.suspect, mon.exceeded[:ANGLE_TEST]
    by_gyro = alarm > SPEED_TEST and turns.any()
    flow = SENSOR_OF[alarm]
    for i in range(3 if alarm > SPEED_TEST else 0):
        suspect[i] = alone(turns, i) if by_gyro else gyro_hidden(mon, alarm, i)
    if not by_gyro:
        suspect_accelerometers(mon)
        suspect[flow] = 1
    for i in range(N_SENSORS):
        suspect[i] &= not mon.cleared[i]


@kernel
def gyro_hidden(mon, j, i):
    """Whether an error of gyro i explains the test j of the flow, and stays within the bound of the test of
    its axis: |r_j| <= k B_j + HIDDEN_FACTOR |share| B_i for each pole.

        alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha)) + ...
        beta' = p sin(alpha) - r cos(alpha) + ...

    share: of the error of p, q, r by these kinematics; all of that of the gyro across the flow (q for the
    incidence, r for the sideslip) turns it, and k is then HIDDEN_FACTOR, else 1.
    """
    z, t = unit(mon.y_past[I_ALPHA]), np.tan(mon.y_past[I_BETA])
    share = (t * z.real, 1.0, t * z.imag)[i] if j == ALPHA_TEST else (z.imag, 0.0, 1.0)[i]
    full = i == j - SPEED_TEST
    k = HIDDEN_FACTOR if full else 1.0
    return (full or i != 1) and not exceeds(mon.r[j], k, mon.B[j], HIDDEN_FACTOR * abs(share), mon.B[i])


@kernel
def suspect_accelerometers(mon):
    """Suspect the accelerometers along whose axis most of the spurious velocity dv is, m/s:

        dv_i >= MIN_AXIS_SHARE max(dv) - B,    B = B_V + V (B_alpha + B_beta)        of sound sensors

    The residuals of the flow add up to dv in its axes, m/s and rad; plane: turned by beta; body: then by
    alpha.
    """
    y, dV, da, db = mon.y_past, mon.flow[0], mon.flow[1], mon.flow[2]
    V = speed(y)
    frozen = last_frozen(mon, FORCES)
    plane = complex(dV.r_sum, V * db.r_sum) * unit(y[I_BETA])
    body = complex(plane.real, V * np.cos(y[I_BETA]) * da.r_sum) * unit(y[I_ALPHA])
    dv = abs(body.real), abs(plane.imag), abs(body.imag)
    least = MIN_AXIS_SHARE * max(dv) - dV.B_sum - V * (da.B_sum + db.B_sum)
    for i in FORCES:
        mon.output.suspect[i] = frozen == i or (frozen < 0 and dv[i - AX] >= least)


@kernel
def suspect_lone(mon, alarm):
    """Suspect the sensor that takes part in no other test, of kinematics if none is exceeded; and the
    airspeed, unless the error that the density shows would exceed the bound of the airspeed's own test:

        |r_density| > 2 HIDDEN_FACTOR (1 + e) / V B_speed + e H

    e: bound on an error of the airspeed from the start, a share; H: its effect.
    """
    suspect = mon.output.suspect
    suspect[SENSOR_OF[alarm]] = alarm >= RPM_TEST or alone(mon.exceeded[:RPM_TEST], alarm)
    if alarm == DENSITY_TEST:
        e = mon.initial.E_alarm[H_AIRSPEED]
        H = mon.initial.H_m[H_AIRSPEED, alarm]
        # 2: a relative change of the airspeed changes log(density) by twice as much
        k = 2.0 * HIDDEN_FACTOR * (1.0 + e) / speed(mon.y_past)
        hidden = not exceeds(mon.r[alarm], k, mon.B[SPEED_TEST], e, H)
        # its test need not show an error if it is frozen
        suspect[I_AIRSPEED] = mon.exceeded[SPEED_TEST] == 1 or hidden or mon.n_same[I_AIRSPEED] > 0


# Substitutes of broken sensors

VANE_RETURN_S = 20.0  # time constant with which a replaced vane returns to trim: kinematics alone drift
RATE_POLE = 1  # index in FILTER_POLES_PER_S of the filter that gives the first value of a replaced rate


@kernel
def replace_readings(mon, pred, measured):
    """Replace the readings of isolated or missing sensors by estimates from the others. Accelerometers are
    not replaced: none of them is used once one of them may be broken."""
    o, unused = mon.output, mon.output.is_reading_unused
    for i in range(N_SENSORS):
        unused[i] |= measured.missing[i]
        if unused[i] and i < AX:
            measured.signal[i] = estimate_reading(mon, pred, measured.signal, i)
    for i in FORCES:
        if unused[i] or (o.alarmed and o.suspect[i]):
            set_inertial(measured, 0)
    if unused[:AX].any():
        share_out(measured)
    slipstream = unused[I_AIRSPEED] or unused[I_QDYN] or unused[ENGINE_SPEED] or unused[MANIFOLD]
    if slipstream and mon.config.has_engine:
        measured.y[DPT] = slipstream_read(measured)


@kernel
def estimate_reading(mon, pred, y, i):
    """The estimate of a sensor's reading from the other sensors, in its unit:

    rates       `estimate_rate`
    airspeed    sqrt(2 qdyn / rho)
    qdyn        rho airspeed^2 / 2,    rho = 2 qdyn / airspeed^2 of the sample before
    others      the prediction of redundancy.py, which of a vane returns to trim
    """
    if i < 3:
        return estimate_rate(mon, pred, i)
    rho = 2.0 * mon.y_past[I_QDYN] / mon.y_past[I_AIRSPEED] ** 2
    if i == I_AIRSPEED:
        return np.sqrt(max(2.0 * y[I_QDYN] / rho, MIN_AIRSPEED_MPS**2))
    if i == I_QDYN:
        return 0.5 * rho * y[I_AIRSPEED] ** 2
    back = mon.h / VANE_RETURN_S if i in (I_ALPHA, I_BETA) else 0.0
    return mon.y_pred[i] + back * (mon.config.y_trim[i] - mon.y_pred[i])


@kernel
def estimate_rate(mon, pred, i):
    """Body rate about axis i, rad/s: that of the attitude by the sample before, and the model's change since,
    with the surface faults that stay isolated:

        y_i = y_past_i + gain residual_i / h + h acc_i,    acc = f + G u [+ F_known - F]

    When it is replaced first, the filtered residual times its pole takes the place of the second term.

    The rate itself is used for the next sample: its own error shows there.
    """
    gain = mon.config.rate_gain
    acc = pred.f[i]
    u = pred.u_old if mon.substep == 0 else pred.u
    for s in range(u.size):
        acc += pred.G[i, s] * u[s]
    if mon.output.keeps_surface:
        acc += pred.F_known[i] - pred.means.F[i]
    rate = gain * mon.residual[i] / mon.h
    if not mon.gyro[i].replaced and gain < 1.0:
        rate = FILTER_POLES_PER_S[RATE_POLE] * mon.r[i, RATE_POLE]
    mon.gyro[i].replaced = 1
    return mon.y_past[i] + rate + mon.h * acc
