"""The sensor monitor: finds the broken sensor by the redundancy of all sensors (redundancy.py).

It assumes that one sensor fails at a time. The test with the largest share of its bound says of which kind
the sensor is; the tests within their bounds exclude others. A gyro and the attitude move the same tests. The
dynamics of the rates separate them: a jump of a gyro is an acceleration that no model explains, a jump of the
attitude is none. With D the damping of the axis, the filter W' = -D W + innovation follows a gyro's error e
exactly, and stays within its bound for an error of the attitude.

After the alarm no surface is isolated. A named sensor is replaced by an estimate from the others
(`substitute_of`), for the diagnosis and for the laws, until the end of the flight.

*Accelerometers or flow sensor?* A test of the flow (airspeed, incidence, sideslip) compares a flow sensor
with the accelerometers, so an error of either moves it. An accelerometer's error e integrates into a velocity
error e t; an error of a flow sensor is a step, which its own reading contains. From the alarm on

    the accelerometers are cleared if the reading of the flow sensor jumps as the test does, soon after the
    alarm, while no accelerometer has jumped; if the flow sensor is frozen; for the airspeed, if the test of
    the density is exceeded
    the flow sensor is cleared if the residuals add up to many times the range of its reading; if an airspeed,
    or incidence, of that error would exceed the test of the density, or of the climb; if an accelerometer is
    frozen

The direction of the spurious velocity says which accelerometer is broken. If neither is cleared, no sensor is
named. The diagnosis uses no accelerometer that may be broken: `measured.inertial`.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.filters import bank_alarm_axis, bound_step
from beaver_ftc.diagnosis.monitors import initial_errors, redundancy
from beaver_ftc.diagnosis.monitors.initial_errors import held_error_part
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    AIRSPEED_ERROR,
    ALPHA,
    ALPHA_ERROR,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_ERROR,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    EQUAL_READING,
    EQUAL_READING_TEST,
    EQUAL_SENSOR,
    MANIFOLD_PRESSURE,
    MAX_FORCE_JUMP_M_S2,
    N_COMPUTED,
    N_INITIAL,
    N_TESTS,
    NEVER_FROZEN,
    NO,
    NO_SENSOR,
    PHI_ERROR,
    QDYN,
    RPM,
    SPEED,
    THETA,
    TURN,
    UNDECIDED,
    YES,
)
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    note_slipstream,
    share_out,
)
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

JUMP_WINDOW_S = 1.0  # after the alarm: later, a jump by chance is too likely
JUMP_MEMORY_S = 2.0  # time constant with which the largest jump of an accelerometer fades
GROWTH_FACTOR = 30.0  # residual sum over the range of the reading: a scale error within 3 % of -1 gives that
CLEAR_EXCESS = 3.0  # times the bound of a test that is not exceeded
_ROUNDING_S = 1e-9


@kernel
def flow_sensor_of(test):
    """The flow sensor that a test compares with the accelerometers."""
    if test == SPEED:
        return AIRSPEED
    return ALPHA if test == ALPHA_FLOW else BETA


@kernel
def hypothesis_of(test):
    """The hypothesis that this sensor was broken when the monitor began (initial_errors.py)."""
    if test == SPEED:
        return AIRSPEED_ERROR
    return ALPHA_ERROR if test == ALPHA_FLOW else BETA_ERROR


@kernel
def is_flow_test(test):
    """Whether accelerometers take part in a test."""
    return SPEED <= test <= BETA_FLOW


@kernel
def count_identical_samples(monitor, signal):
    """Count the samples for which each reading (N_SENSORS,) has been the very same, and find the largest jump
    of an accelerometer from one sample to the next, m/s2, which fades within CALMED_S."""
    memory, before = monitor.memory, monitor.step.memory.previous
    memory.largest_jump *= 1.0 - monitor.step.config.h / JUMP_MEMORY_S
    for i in range(N_SENSORS):
        memory.identical[i] = memory.identical[i] + 1 if signal[i] == before[i] else 0
        if AX <= i < N_IN_EQUATIONS:
            memory.largest_jump = max(memory.largest_jump, abs(signal[i] - before[i]))


@kernel
def is_frozen(monitor, i):
    """Whether sensor i is frozen: no sound one gives the same reading for so many samples."""
    return monitor.memory.identical[i] >= monitor.config.longest_identical[i]


@kernel
def clear_by_sample(monitor, signal):
    """Clear the flow sensor, or the accelerometers, by this sample, that of the alarm or a later one."""
    if not is_flow_test(monitor.output.lead):
        return
    since_alarm_s = monitor.memory.n_summed * monitor.step.config.h
    if since_alarm_s < JUMP_WINDOW_S - _ROUNDING_S and reading_jumped(monitor, signal):
        clear_accelerometers(monitor)
    sum_residuals(monitor, signal)
    flow = flow_sensor_of(monitor.output.lead)
    if is_frozen(monitor, flow) or (monitor.output.lead == SPEED and monitor.memory.exceeded[DENSITY]):
        clear_accelerometers(monitor)
    frozen = False
    for i in range(AX, N_IN_EQUATIONS):
        frozen = frozen or is_frozen(monitor, i)
    if frozen or residual_keeps_growing(monitor) or error_would_show_elsewhere(monitor, signal):
        monitor.memory.cleared[flow] = 1


@kernel
def clear_accelerometers(monitor):
    """Clear all accelerometers."""
    monitor.memory.cleared[AX:] = 1


@kernel
def reading_jumped(monitor, signal):
    """Whether the residual exceeds any jump of an accelerometer in one sample, and the flow sensor's reading
    jumps with it."""
    i, step = flow_sensor_of(monitor.output.lead), monitor.step
    per_m_s = 1.0 if monitor.output.lead == SPEED else 1.0 / max(step.memory.previous[AIRSPEED], 1.0)
    test, per_m_s2 = step.test[monitor.output.lead], step.config.h * per_m_s
    second = signal[i] - 2.0 * step.memory.previous[i] + monitor.memory.earlier[i]
    half, theirs = 0.5 * abs(test.residual), 1.5 * monitor.memory.largest_jump * per_m_s2
    return 2.0 * half > test.bound[0] + MAX_FORCE_JUMP_M_S2 * per_m_s2 and abs(second) >= half > theirs


@kernel
def sum_residuals(monitor, signal):
    """Add up, after the sample of the alarm, the residuals of the flow (3,), the part of sound sensors and
    that of an error that a reading has had from the start; and find the range of each reading."""
    step = monitor.step
    for j in range(3):
        i, test = flow_sensor_of(SPEED + j), step.test[SPEED + j]
        if monitor.memory.n_summed == 0:
            monitor.memory.least[j] = monitor.memory.most[j] = signal[i]
            monitor.memory.bound_sum[j] = 2.0 * test.noise + test.air * step.config.max_gust_speed
            continue
        monitor.memory.residual_sum[j] += test.residual
        of = hypothesis_of(SPEED + j)
        monitor.memory.bound_sum[j] += step.config.h * test.rate
        monitor.memory.first[j] += (
            monitor.initial.bound_at_alarm[of] * monitor.initial.unit_effect[of, SPEED + j]
        )
        monitor.memory.least[j], monitor.memory.most[j] = (
            min(monitor.memory.least[j], signal[i]),
            max(monitor.memory.most[j], signal[i]),
        )
    excess = np.sign(monitor.memory.residual_sum[1]) * max(
        abs(monitor.memory.residual_sum[1]) - monitor.memory.bound_sum[1] - monitor.memory.first[1], 0.0
    )
    fallen = step.config.h * signal[AIRSPEED] * excess * np.cos(signal[PHI]) * np.cos(signal[PHI + 1])
    for m in range(step.config.decay.size):
        monitor.memory.climb_error[m] = step.config.decay[m] * monitor.memory.climb_error[m] + fallen
    monitor.memory.n_summed += 1


@kernel
def residual_keeps_growing(monitor):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range."""
    j = monitor.output.lead - SPEED
    moved = monitor.memory.most[j] - monitor.memory.least[j]
    sound = monitor.memory.bound_sum[j] + monitor.memory.first[j]
    return moved > 0.0 and abs(monitor.memory.residual_sum[j]) > GROWTH_FACTOR * moved + CLEAR_EXCESS * sound


@kernel
def error_would_show_elsewhere(monitor, signal):
    """Whether an airspeed of this error would exceed the test of the density, or an incidence that of the
    climb, while that test is within its bound."""
    step = monitor.step
    elsewhere = DENSITY if monitor.output.lead == SPEED else CLIMB
    if monitor.output.lead == BETA_FLOW or monitor.memory.exceeded[elsewhere]:
        return False
    of = hypothesis_of(monitor.output.lead)
    for m in range(step.config.decay.size):
        error, speed = abs(monitor.memory.climb_error[m]), step.test[SPEED]
        if monitor.output.lead == SPEED:
            error = 2.0 * (abs(speed.filtered[m]) - speed.bound[m]) / max(signal[AIRSPEED], 1.0)
            error *= 1.0 - min(monitor.initial.bound_at_alarm[of], 1.0)
        if error > CLEAR_EXCESS * (
            step.test[elsewhere].bound[m] + held_error_part(monitor.initial, of, elsewhere, m)
        ):
            return True
    return False


@kernel
def suspect_accelerometers(monitor, shown):
    """Suspect the accelerometers along whose axis most of the spurious velocity is; shown: a gyro explains
    it."""
    step, who = monitor.step, monitor.output.suspect
    alpha, beta, V = (
        step.memory.previous[ALPHA],
        step.memory.previous[BETA],
        max(step.memory.previous[AIRSPEED], 1.0),
    )
    faster, down, aside = (
        monitor.memory.residual_sum[0],
        V * np.cos(beta) * monitor.memory.residual_sum[1],
        V * monitor.memory.residual_sum[2],
    )
    velocity, size, ahead = (
        monitor.memory.spurious_velocity,
        0.0,
        np.cos(beta) * faster - np.sin(beta) * aside,
    )
    velocity[0] = np.cos(alpha) * ahead - np.sin(alpha) * down
    velocity[1] = np.sin(beta) * faster + np.cos(beta) * aside
    velocity[2] = np.sin(alpha) * ahead + np.cos(alpha) * down
    doubt = monitor.memory.bound_sum[0] + V * (monitor.memory.bound_sum[1] + monitor.memory.bound_sum[2])
    frozen = -1
    for i in range(3):
        size = max(size, abs(velocity[i]))
        frozen = AX + i if is_frozen(monitor, AX + i) else frozen
    for i in range(AX, N_IN_EQUATIONS):
        along = frozen == i or (frozen < 0 and abs(velocity[i - AX]) + doubt >= 0.5 * size)
        who[i] = along and not shown and not monitor.memory.cleared[i]


@kernel
def discard_accelerometers(monitor, measured):
    """Mark the accelerometers as unusable once one of them may be broken."""
    for i in range(AX, N_IN_EQUATIONS):
        if monitor.output.replaced[i] or (monitor.output.alarmed and monitor.output.suspect[i]):
            measured.inertial = 0


INVOLVED_SHARE = (
    0.03  # share of the largest residual of its kind: less is the effect of an error on its neighbours
)
MONITOR_RUNNING = 3  # `begun`: after the first sample 1, with the first whole frame 2, from the next one on 3
KEPT_SURFACE_S = 0.5  # before the alarm: a surface detected earlier was detected with sound sensors
SETTLED_S = 1.0  # after the monitor has begun: an earlier alarm of the surfaces may be a sensor's
DAMPING_TOLERANCE = 0.2  # tolerance of the damping, away from trim
GONE_SHARE = 0.003  # share of a jump of the attitude that may be left in the next frame
QUICK_PER_S = 10.0  # the second of POLES_PER_S
FORGETTING_S = 20.0  # time constant with which a replaced vane returns to trim: kinematics alone drift
CROSS_DAMPING_PER_S = 10.0  # by which a gyro's own error moves the innovation


@kernel
def monitor_sensors(monitor, belief, measured, conclusion, bank, bound, dt, t):
    """Test the sensors at t s, and replace in `measured` the readings of broken ones.

    bank, bound: of the innovation of the elapsed frame, of dt s. conclusion: about the surfaces, so far.
    """
    step, signal = monitor.step, measured.signal
    if not monitor.memory.begun:
        begin_monitor(monitor, measured, t)
        return
    if monitor.memory.substep == 0:
        update_rate_filter(monitor, bank.output.innovation, bound.eta_bar, dt)
    redundancy.run_tests(step, signal, monitor.config.engine)
    if N_TESTS > N_COMPUTED:
        redundancy.test_equal_sensors(step, signal, measured.fresh)
        record_agreement(monitor, measured.fresh)
    initial_errors.update_initial_errors(step, monitor.initial, signal)
    count_identical_samples(monitor, signal)
    if monitor.memory.substep == 0:
        monitor.memory.previous_gyro_error[:], monitor.memory.earlier_spike[:] = (
            monitor.memory.gyro_error,
            monitor.memory.previous_spike,
        )
        monitor.memory.previous_spike[:] = monitor.memory.spike
        monitor.memory.spike[:] = 0.0
    for i in range(3):
        error = -step.test[TURN + i].residual / step.config.h
        if monitor.memory.substep == 0:
            monitor.memory.gyro_error[i] = error
        else:
            monitor.memory.spike[i] = max(monitor.memory.spike[i], abs(error))
    if monitor.memory.begun < MONITOR_RUNNING:
        allow_for_first_errors(monitor)
    if monitor.config.noisy_attitude:
        exclude_gyros(monitor)
    decide_sensor(monitor, measured, conclusion, bank, bound, dt, t)
    replace_readings(monitor, belief, measured)
    discard_accelerometers(monitor, measured)
    monitor.memory.earlier[:] = step.memory.previous
    redundancy.store_sample(step, signal, measured.force)
    monitor.memory.substep = (monitor.memory.substep + 1) % monitor.config.instants


@kernel
def set_expected_manifold_pressure(monitor, manifold_pressure_inhg):
    """Predict the engine's sensors from the command of the law in charge of the engine."""
    monitor.step.memory.command[1] = manifold_pressure_inhg


@kernel
def begin_monitor(monitor, measured, t):
    """Take the first sample, at t s: there is none to compare it with."""
    monitor.memory.begun, monitor.memory.started_at_s = 1, t
    redundancy.set_drift(monitor.step, t)
    redundancy.begin_tests(monitor.step, measured.signal, measured.force)
    initial_errors.begin_initial_errors(monitor.initial, measured.signal)
    monitor.memory.earlier[:] = monitor.step.memory.previous
    monitor.memory.substep = (monitor.memory.substep + 1) % monitor.config.instants


@kernel
def allow_for_first_errors(monitor):
    """Widen the bound on W by a gyro's error of the first sample, which has caused no innovation. The first
    frame shows no change of an error."""
    if monitor.memory.substep == 0:
        monitor.memory.begun += 1
    if monitor.memory.begun == MONITOR_RUNNING - 1 and monitor.memory.substep == 0:
        for i in range(3):
            monitor.memory.W_bound[i] += abs(monitor.memory.gyro_error[i])


@kernel
def update_rate_filter(monitor, innovation, eta_bar, dt):
    """Bring W (3,) rad/s and its bound to the frame whose innovation is there."""
    W, bound, D = monitor.memory.W, monitor.memory.W_bound, monitor.config.damping
    monitor.memory.previous_W_bound[:] = bound
    before = monitor.memory.before
    before[:] = W
    for i in range(3):
        lost, spread = 0.0, 0.0
        for j in range(3):
            lost += D[i, j] * before[j]
            spread += (-D[i, j] if i == j else abs(D[i, j])) * monitor.memory.previous_W_bound[j]
        W[i] += dt * (innovation[i] - lost)
        bound[i] = max(monitor.memory.previous_W_bound[i] + dt * (eta_bar[i] + spread), 0.0)


@kernel
def exclude_gyros(monitor):
    """Record that no gyro can be broken: W and the attitude disagree by more than both bounds.

    Where the attitude is noisy, a surface is isolated only after that.
    """
    step = monitor.step
    for i in range(3):
        test, rate = (
            step.test[TURN + i],
            monitor.memory.W_bound[i] + DAMPING_TOLERANCE * abs(monitor.memory.W[i]),
        )
        for m, a in enumerate(step.config.decay):
            monitor.memory.rate_difference[i, m] = (
                a * monitor.memory.rate_difference[i, m] + test.residual + step.config.h * monitor.memory.W[i]
            )
            monitor.memory.rate_difference_bound[i, m] = bound_step(
                monitor.memory.rate_difference_bound[i, m], rate, a, step.config.h
            )
            if (
                abs(monitor.memory.rate_difference[i, m])
                > monitor.memory.rate_difference_bound[i, m] + test.bound[m]
            ):
                monitor.memory.gyros_excluded = 1


@kernel
def decide_sensor(monitor, measured, conclusion, bank, bound, dt, t):
    """Raise the alarm, and name the sensor once it is the only suspect."""
    find_largest_share(monitor)
    if monitor.output.named != NO_SENSOR:
        return
    for i in range(N_SENSORS):
        if measured.missing[i] and monitor.output.named == NO_SENSOR:
            raise_alarm(monitor, conclusion, t)
            name_sensor(monitor, i, t)
    if monitor.output.named != NO_SENSOR:
        return
    if monitor.output.share > 1.0 and not monitor.output.alarmed:
        raise_alarm(monitor, conclusion, t)
        monitor.output.lead = monitor.output.largest_test
        initial_errors.hold_errors_at_alarm(monitor.initial)
    if monitor.output.alarmed:
        if monitor.memory.substep == 0 and monitor.memory.begun == MONITOR_RUNNING:
            compare_rates_with_dynamics(monitor, bank, bound, dt)
        record_exceeded_tests(monitor)
        clear_by_sample(monitor, measured.signal)
        find_suspects(monitor)
        left, last = 0, NO_SENSOR
        for i in range(N_SENSORS):
            if monitor.output.suspect[i]:
                left, last = left + 1, i
        if left == 1:
            name_sensor(monitor, last, t)


@kernel
def find_largest_share(monitor):
    """Find the test with the largest share of its bound, of the samples of this frame."""
    if monitor.memory.substep == 0:
        monitor.output.largest_test, monitor.output.share = 0, 0.0
    for c in range(N_TESTS):
        if monitor.step.test[c].share > monitor.output.share:
            monitor.output.largest_test, monitor.output.share = c, monitor.step.test[c].share


@kernel
def raise_alarm(monitor, conclusion, t):
    """Raise the alarm of the sensors at t s. A surface detected long before was detected with sound sensors,
    and stays detected. Otherwise the conclusion about surfaces is void."""
    if monitor.output.alarmed:
        return
    monitor.output.alarmed, monitor.output.alarmed_at_s = 1, t
    if conclusion.detected and conclusion.detected_at_s < t - KEPT_SURFACE_S:
        monitor.output.keeps_surface = 1
        return
    if conclusion.detected:
        monitor.output.alarmed_at_s = conclusion.detected_at_s  # the same fault, seen first in the rates
    monitor.output.surface_was_isolated = conclusion.isolated >= 0


@kernel
def name_sensor(monitor, i, t):
    """Name sensor i at t s."""
    monitor.output.named, monitor.output.named_at_s = i, t
    monitor.output.replaced[i] = 1


@kernel
def compare_rates_with_dynamics(monitor, bank, bound, dt):
    """Decide, by axis, whether the rates' dynamics confirm the error that the attitude shows: YES or NO, once
    it is certain.

    An error that appears inside a frame and is absent in all of the next is no gyro's: an error of a gyro
    stays, and one that varies is not as small in every sample.
    """
    alarmed, innovation = bank_alarm_axis(bank), bank.output.innovation
    for i in range(3):
        if monitor.memory.rates_confirm[i] != UNDECIDED:
            continue
        error, jump = (
            monitor.memory.gyro_error[i],
            (monitor.memory.gyro_error[i] - monitor.memory.previous_gyro_error[i]) / dt,
        )
        own = CROSS_DAMPING_PER_S * max(abs(error), abs(monitor.memory.previous_gyro_error[i])) + 0.1 * abs(
            jump
        )
        blur = (
            4.0 * monitor.step.test[TURN + i].noise / monitor.step.config.h
        )  # of `error`, by the attitude's noise
        most = bound.frame[i] + 1e-6
        seen = (
            abs(innovation[i]) > most
            or alarmed >= 0
            or abs(monitor.memory.W[i]) > monitor.memory.W_bound[i] + 1e-6
        )
        spike, left = (
            monitor.memory.earlier_spike[i],
            max(abs(monitor.memory.previous_gyro_error[i]), monitor.memory.previous_spike[i], abs(error)),
        )
        sudden = left < GONE_SHARE * spike and spike > 2.0 * blur
        explained = abs(innovation[i] - jump) <= most + own + blur / dt
        slow = 0.7 * abs(error) <= monitor.memory.W_bound[i] + abs(monitor.memory.W[i]) + blur
        if not explained or (not seen and (sudden or not slow)):
            monitor.memory.rates_confirm[i] = NO
        elif seen:
            monitor.memory.rates_confirm[i] = YES


@kernel
def is_involved(monitor, c, first):
    """Whether test c, one of the three from `first` on, exceeds its bound by more than an error of its
    neighbours explains."""
    size = 0.0
    for i in range(3):
        size = max(size, abs(monitor.step.test[first + i].filtered[0]))
    test = monitor.step.test[c]
    return test.share > 1.0 and abs(test.filtered[0]) > INVOLVED_SHARE * size


@kernel
def record_exceeded_tests(monitor):
    """Record the tests that have exceeded their bounds since the alarm."""
    for c in range(N_TESTS):
        triple = TURN if c < ANGLE else ANGLE
        beyond = is_involved(monitor, c, triple) if c < SPEED else monitor.step.test[c].share > 1.0
        if beyond:
            monitor.memory.exceeded[c] = 1
    initial_errors.record_refuted(monitor.step, monitor.initial, monitor.memory.exceeded)


@kernel
def find_suspects(monitor):
    """Fill suspect (N_SENSORS,): the sensors whose error explains all tests."""
    who, lead, fired = monitor.output.suspect, monitor.output.lead, monitor.memory.exceeded
    who[:] = 0
    if lead >= N_COMPUTED:
        suspect_unequal_sensors(monitor, lead - N_COMPUTED)
        return
    if lead < SPEED:
        suspect_attitude(monitor)
    if lead == SPEED:
        suspect_accelerometers(monitor, False)
        who[AIRSPEED] = not monitor.memory.cleared[AIRSPEED]
    elif lead == DENSITY:
        may_be_frozen = monitor.memory.identical[AIRSPEED] > 0  # then it need not show how it is wrong
        who[AIRSPEED] = fired[SPEED] == 1 or not airspeed_error_would_show(monitor) or may_be_frozen
    who[QDYN] = lead == DENSITY and is_only_exceeded(monitor, DENSITY)
    suspect_vane(monitor, ALPHA, ALPHA_FLOW, 1)
    suspect_vane(monitor, BETA, BETA_FLOW, 2)
    who[ALTITUDE] = lead == CLIMB and is_only_exceeded(monitor, CLIMB)
    who[ENGINE_SPEED], who[MANIFOLD] = lead == RPM, lead == MANIFOLD_PRESSURE
    frozen = any_suspect_frozen(monitor)
    for i in range(N_INITIAL):
        if not frozen and initial_errors.initial_error_explains(monitor.initial, i, lead):
            who[(ALPHA, BETA, AIRSPEED, PHI, THETA)[i]] = 1


@kernel
def record_agreement(monitor, fresh):
    """Record which sensors have agreed, before any alarm, with the reading that they should equal."""
    for k in range(EQUAL_SENSOR.size):
        equal = monitor.step.test[N_COMPUTED + k].share <= 1.0
        if fresh[EQUAL_SENSOR[k] - N_IN_EQUATIONS] and equal and not monitor.output.alarmed:
            monitor.memory.agreed[k] = 1


@kernel
def suspect_unequal_sensors(monitor, k):
    """Suspect a sensor, or the reading that it no longer equals: the reading if its own test shows an error,
    the sensor if an error of the reading of this size would have shown there, both if neither is certain.

    No test shows an error that a reading has had from the first sample on, nor a frozen reading.
    """
    step, reading, shows = monitor.step, EQUAL_READING[k], EQUAL_READING_TEST[k]
    own, test = step.test[shows], step.test[N_COMPUTED + k]
    least = abs(test.residual) - test.bound[0]  # of the error, if it is the reading's
    hidden = least <= 2.0 * max(own.bound[0], step.memory.error[reading])
    frozen = is_frozen(monitor, reading)
    monitor.output.suspect[EQUAL_SENSOR[k]] = not monitor.memory.exceeded[shows]
    monitor.output.suspect[reading] = (
        monitor.memory.exceeded[shows] == 1 or hidden or frozen or not monitor.memory.agreed[k]
    )


@kernel
def is_only_exceeded(monitor, test):
    """Whether no other test has exceeded its bound: the sensor of this one takes part in no other."""
    for c in range(RPM):
        if c != test and monitor.memory.exceeded[c]:
            return False
    return True


@kernel
def any_suspect_frozen(monitor):
    """Whether a suspect is frozen, which an error of another sensor from the start does not explain. A sound
    sensor may read zero."""
    for i in range(N_SENSORS):
        if monitor.output.suspect[i] and monitor.step.memory.previous[i] != 0.0 and is_frozen(monitor, i):
            return True
    return False


@kernel
def suspect_vane(monitor, vane, flow, gyro):
    """Suspect a vane, an accelerometer, or the gyro that turns the flow, if its error need not show in the
    attitude yet. No flow sensor moves the attitude's tests."""
    if monitor.output.lead != flow:
        return
    exceeded = monitor.memory.exceeded
    turns = exceeded[TURN] + exceeded[TURN + 1] + exceeded[TURN + 2]
    suspect_accelerometers(monitor, turns > 0)
    monitor.output.suspect[vane] = not (turns > 0 or monitor.memory.cleared[vane])
    for i in range(3):
        shown = turns == 1 and exceeded[TURN + i] == 1
        monitor.output.suspect[i] = shown or (turns == 0 and gyro_may_be_hidden(monitor, flow, i, i == gyro))


@kernel
def gyro_may_be_hidden(monitor, flow, i, own):
    """Whether an error of gyro i explains the test of the flow, and stays within the bound of the test of its
    axis; own: all of its error turns the flow. Of another gyro's error a share does, by kinematics."""
    step, alpha = monitor.step, monitor.step.memory.previous[ALPHA]
    along = np.cos(alpha) if i == 0 else np.sin(alpha)
    share = abs(np.tan(step.memory.previous[BETA]) * along) if flow == ALPHA_FLOW else abs(np.sin(alpha))
    test, turn = step.test[flow], step.test[TURN + i]
    for m in range(test.filtered.size):
        room = 2.0 * test.bound[m] if own else test.bound[m]
        if abs(test.filtered[m]) > 2.0 * (1.0 if own else share) * turn.bound[m] + room:
            return False
    return own or i == 0 or flow == ALPHA_FLOW  # the sideslip does not feel q


@kernel
def airspeed_error_would_show(monitor):
    """Whether the airspeed error that the density shows would exceed the bound of the airspeed's own test."""
    density, speed = monitor.step.test[DENSITY], monitor.step.test[SPEED]
    most = 1.0 + monitor.initial.bound_at_alarm[AIRSPEED_ERROR]
    for m in range(density.filtered.size):
        shown = abs(density.filtered[m]) - initial_errors.held_error_part(
            monitor.initial, AIRSPEED_ERROR, DENSITY, m
        )
        if 0.5 * monitor.step.memory.previous[AIRSPEED] * shown > 2.0 * most * speed.bound[m]:
            return True
    return False


@kernel
def suspect_attitude(monitor):
    """Suspect gyros and attitude: one axis alone, or one angle alone. A gyro's error may appear in an angle
    first. A frozen angle excludes the gyros; it is suspected until it is known not to be frozen."""
    fired, who = monitor.memory.exceeded, monitor.output.suspect
    turns, frozen = 0, False
    for i in range(3):
        turns += fired[TURN + i]
        frozen = frozen or is_frozen(monitor, PHI + i)
    for i in range(3):
        alone = turns == 0 or (fired[TURN + i] == 1 and turns == 1)
        who[i] = alone and monitor.memory.rates_confirm[i] != NO and not frozen
        fits = angle_explains(monitor, i)
        mine = no_other_angle_moved(monitor, i) and (fired[ANGLE + i] == 1 or fits)
        moved = mine and monitor.memory.rates_confirm[axis_showing_angle(monitor, i)] != YES
        still, longest = monitor.memory.identical[PHI + i], monitor.config.longest_identical[PHI + i]
        may_be_frozen = 0 < still < longest < NEVER_FROZEN  # too early to say
        who[PHI + i] = moved or (fits and may_be_frozen)


@kernel
def no_other_angle_moved(monitor, i):
    """Whether no test of another angle shows an error that one of angle i from the start does not explain."""
    for j in range(3):
        shown = (
            monitor.memory.exceeded[ANGLE + j]
            if i == 2
            else monitor.initial.refuted[PHI_ERROR + i, ANGLE + j]
        )
        if j != i and shown:
            return False
    return True


@kernel
def angle_explains(monitor, i):
    """Whether an error of angle i, as large as its own test can hide, explains the tests of the axes."""
    step, angle = monitor.step, monitor.step.test[ANGLE + i]
    unsure = step.memory.error[PHI] + step.memory.error[PHI + 1]
    for j in range(3):
        turn, per_angle = step.test[TURN + j], abs(redundancy.axis_turn_per_angle(step, j, i)) + unsure
        for m in range(step.config.decay.size):
            most = abs(angle.filtered[m]) + angle.bound[m]
            hidden = (
                initial_errors.held_error_part(monitor.initial, PHI_ERROR + i, TURN + j, m) if i < 2 else 0.0
            )
            if (
                monitor.memory.exceeded[TURN + j]
                and abs(turn.filtered[m]) > per_angle * most + turn.bound[m] + hidden
            ):
                return False
    return True


@kernel
def axis_showing_angle(monitor, i):
    """The body axis whose rate shows the error of angle i: the one with the largest share of its bound."""
    axis = i
    for j in range(3):
        if monitor.step.test[TURN + j].share > monitor.step.test[TURN + axis].share:
            axis = j
    return axis


@kernel
def allows_isolation(monitor, known):
    """Whether a surface may be isolated; known: the alarm was a frame or more ago."""
    if not monitor.config.enabled:
        return True
    return (
        known == 1
        and (monitor.memory.gyros_excluded == 1 or not monitor.config.noisy_attitude)
        and not flow_is_frozen(monitor)
    )


@kernel
def alarm_is_at_start(monitor, detected_at_s):
    """Whether the alarm of the surfaces is so early that an error which a flow sensor has had from the start
    may have caused it: the design model uses its reading from the first frame on."""
    return monitor.config.enabled and detected_at_s < monitor.memory.started_at_s + SETTLED_S


@kernel
def flow_is_frozen(monitor):
    """Whether a flow sensor is frozen: a surface that moves the aircraft moves its reading. In symmetric
    flight a sideslip of zero stays zero."""
    for i in (ALPHA, BETA, AIRSPEED, QDYN):
        if monitor.step.memory.previous[i] != 0.0 and is_frozen(monitor, i):
            return True
    return False


@kernel
def has_alarm(monitor):
    """Whether the monitor has raised its alarm: no surface is isolated then."""
    return monitor.config.enabled and monitor.output.alarmed


@kernel
def replace_readings(monitor, belief, measured):
    """Replace the readings of named or missing sensors by estimates from the others. Accelerometers are not
    replaced: then none of them is used."""
    signal, changed = measured.signal, 0
    for i in range(N_SENSORS):
        if measured.missing[i]:
            monitor.output.replaced[i] = 1
        if monitor.output.replaced[i] and i < AX:
            signal[i] = substitute_of(monitor, belief, signal, i)
            changed = 2 if i in (AIRSPEED, QDYN, ENGINE_SPEED, MANIFOLD) else max(changed, 1)
    if changed > 0:
        share_out(measured)
    if changed > 1 and monitor.config.engine:
        note_slipstream(measured)


@kernel
def substitute_of(monitor, belief, signal, i):
    """The estimate of sensor i's reading from the other sensors."""
    step = monitor.step
    if i < 3:
        return rate_from_attitude(monitor, belief, i)
    if i in (ALPHA, BETA):
        return step.memory.predicted[i] + step.config.h / FORGETTING_S * (
            monitor.config.trim[i] - step.memory.predicted[i]
        )
    density = 2.0 * step.memory.previous[QDYN] / step.memory.previous[AIRSPEED] ** 2
    if i == AIRSPEED:
        return np.sqrt(max(2.0 * signal[QDYN] / density, 1.0))
    if i == QDYN:
        return 0.5 * density * signal[AIRSPEED] ** 2
    if i >= ENGINE_SPEED:
        return step.memory.command[i - ENGINE_SPEED]
    return step.memory.predicted[i]


@kernel
def rate_from_attitude(monitor, belief, i):
    """Rate i, rad/s: that of the attitude by the sample before, and the model's change since.

    The rate itself is used for the next sample: its own error shows there.
    """
    step = monitor.step
    u = belief.u_before if monitor.memory.substep == 0 else belief.u
    acceleration = belief.f[i]
    for s in range(u.size):
        acceleration += belief.G[i, s] * u[s]
    shown = monitor.config.attitude_correction_share * step.test[TURN + i].residual
    if not monitor.memory.rate_replaced[i] and monitor.config.attitude_correction_share < 1.0:
        shown = step.config.h * QUICK_PER_S * step.test[TURN + i].filtered[1]
    monitor.memory.rate_replaced[i] = 1
    known = step.memory.previous[i] + shown / step.config.h
    return known + step.config.h * acceleration
