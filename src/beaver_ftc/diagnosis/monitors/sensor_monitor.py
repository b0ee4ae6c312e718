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
    several, or none       not isolated  none is isolated; after UNANTICIPATED_VERDICT_DELAY_S the verdict is
                                         "unanticipated"
    alarm long after that  isolated or   the conclusion about surfaces stays (MIN_SURFACE_ALARM_LEAD_S)
    of the surfaces        not, as above

An isolated sensor is replaced by an estimate from the others (`estimate_reading`), for the diagnosis and for
the laws, until the end of the flight. Accelerometers are not replaced: the diagnosis uses none that may be
broken (`measured.inertial`).

*Gyro or attitude?* Both move the same tests. The dynamics of the rates separate them: a jump of a gyro is an
acceleration that no model explains, a jump of the attitude is none. With D the damping of the rates (3, 3),
1/s, the filter W' = -D W + innovation follows a gyro's error exactly, and stays within its bound for an error
of the attitude (`judge_gyro_errors`).

*Accelerometers or flow sensor?* A test of the flow (airspeed, incidence, sideslip) compares a flow sensor
with the accelerometers, so an error of either moves it. An accelerometer's error e integrates into a velocity
error e t; an error of a flow sensor is a step, which its own reading contains. From the alarm on

    the accelerometers are cleared if the reading of the flow sensor jumps as the test does, soon after the
    alarm, while no accelerometer has jumped; if the flow sensor is frozen; for the airspeed, if the test of
    the density is exceeded
    the flow sensor is cleared if the residuals add up to many times the range of its reading; if an airspeed,
    or incidence, of that error would exceed the test of the density, or of the climb; if an accelerometer is
    frozen

The direction of the spurious velocity, which the residuals add up to, says which accelerometer is broken.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.detection.filters import advance_residual_bound, bank_alarm_axis
from beaver_ftc.diagnosis.monitors.initial_errors import (
    initial_error_explains_exceeded_tests,
    latch_refuted_hypotheses,
    max_error_effect_at_alarm,
    set_error_bounds_at_start,
    store_error_bounds_at_alarm,
    update_initial_error_bounds,
)
from beaver_ftc.diagnosis.monitors.redundancy import (
    ADAMS_BASHFORTH_WEIGHT,
    AIRSPEED,
    AIRSPEED_DIVISOR_FLOOR_MPS,
    AIRSPEED_HYPOTHESIS,
    ALPHA,
    ALPHA_FLOW_TEST,
    ALPHA_HYPOTHESIS,
    BETA,
    BETA_FLOW_TEST,
    BETA_HYPOTHESIS,
    CLIMB_TEST,
    DENSITY_TEST,
    DUPLICATE_SENSOR_INDEX,
    DUPLICATED_READING_INDEX,
    DUPLICATED_READING_TEST_INDEX,
    FILTER_POLES_PER_S,
    FIRST_ANGLE_TEST,
    FIRST_TURN_TEST,
    GYRO_ERROR_CONFIRMED,
    GYRO_ERROR_REFUTED,
    GYRO_ERROR_UNDECIDED,
    MANIFOLD_PRESSURE_TEST,
    MIN_FAULTY_FORCE_JUMP_M_S2,
    N_INITIAL_ERROR_HYPOTHESES,
    N_TESTS,
    N_TESTS_WITH_EQUATION,
    NO_SENSOR,
    PHI_HYPOTHESIS,
    QDYN,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    UNREACHABLE_FROZEN_SAMPLES,
    body_turn_per_euler_angle,
    compare_duplicate_sensors,
    pitch_is_too_steep,
    run_tests_with_equation,
    set_accumulated_attitude_drift_bound,
    start_redundancy_tests,
    store_sample_as_previous,
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
FLOW_JUMP_WINDOW_AFTER_ALARM_S = 1.0  # after the alarm: later, a jump by chance is too likely
ACCELEROMETER_JUMP_MEMORY_TIME_S = 2.0  # time constant with which the largest jump of an accelerometer fades
MIN_READING_JUMP_PER_RESIDUAL = 0.5  # of the residual, by which the flow sensor's own reading jumps, at least
MIN_RESIDUAL_SUM_PER_READING_RANGE = 30.0  # ratio; a scale error within 3 % of -1 gives so much
# An effect that a sensor's error would have clears the sensor only beyond so many times the bound on it
MIN_EFFECT_OVER_BOUND_TO_CLEAR = 3.0
# of the spurious velocity, along the axis of a suspected accelerometer
MIN_SHARE_OF_LARGEST_VELOCITY_COMPONENT = 0.5
TIME_ROUNDING_S = 1e-9


@kernel
def flow_sensor_index_of_test(test_index):
    """The flow sensor that a test compares with the accelerometers."""
    if test_index == SPEED_TEST:
        return AIRSPEED
    return ALPHA if test_index == ALPHA_FLOW_TEST else BETA


@kernel
def initial_error_hypothesis_of_test(test_index):
    """The hypothesis that the flow sensor of a test was broken when the monitor began (initial_errors.py)."""
    if test_index == SPEED_TEST:
        return AIRSPEED_HYPOTHESIS
    return ALPHA_HYPOTHESIS if test_index == ALPHA_FLOW_TEST else BETA_HYPOTHESIS


@kernel
def is_flow_test(test_index):
    """Whether accelerometers take part in a test."""
    return SPEED_TEST <= test_index <= BETA_FLOW_TEST


@kernel
def update_identical_counts_and_accelerometer_jump(monitor, readings):
    """Count the samples for which each reading (N_SENSORS,) has been the very same, and find the largest jump
    of an accelerometer from one sample to the next, m/s2, which fades within
    ACCELEROMETER_JUMP_MEMORY_TIME_S."""
    memory, previous_reading = monitor.memory, monitor.redundancy.memory.previous_reading
    memory.fading_max_accelerometer_jump *= (
        1.0 - monitor.redundancy.config.sample_time_s / ACCELEROMETER_JUMP_MEMORY_TIME_S
    )
    for i in range(N_SENSORS):
        memory.n_identical_samples[i] = (
            memory.n_identical_samples[i] + 1 if readings[i] == previous_reading[i] else 0
        )
        if AX <= i < N_IN_EQUATIONS:
            memory.fading_max_accelerometer_jump = max(
                memory.fading_max_accelerometer_jump, abs(readings[i] - previous_reading[i])
            )


@kernel
def is_frozen(monitor, sensor_index):
    """Whether a sensor is frozen: no sound one gives the same reading for so many samples."""
    return monitor.memory.n_identical_samples[sensor_index] >= monitor.config.min_frozen_samples[sensor_index]


@kernel
def update_cleared_sensors(monitor, readings):
    """Clear the flow sensor, or the accelerometers, by this sample, that of the alarm or a later one."""
    memory, alarm_test_index = monitor.memory, monitor.output.alarm_test_index
    if not is_flow_test(alarm_test_index):
        return
    since_alarm_s = memory.n_samples_since_alarm * monitor.redundancy.config.sample_time_s
    is_within_jump_window = since_alarm_s < FLOW_JUMP_WINDOW_AFTER_ALARM_S - TIME_ROUNDING_S
    if is_within_jump_window and flow_reading_jumped(monitor, readings):
        clear_accelerometers(monitor)
    update_flow_evidence_since_alarm(monitor, readings)
    flow_sensor_index = flow_sensor_index_of_test(alarm_test_index)
    if is_frozen(monitor, flow_sensor_index) or (
        alarm_test_index == SPEED_TEST and memory.tests_exceeded_since_alarm[DENSITY_TEST]
    ):
        clear_accelerometers(monitor)
    accelerometer_is_frozen = False
    for i in range(AX, N_IN_EQUATIONS):
        accelerometer_is_frozen = accelerometer_is_frozen or is_frozen(monitor, i)
    if (
        accelerometer_is_frozen
        or residual_sum_exceeds_reading_range(monitor)
        or flow_sensor_error_would_exceed_other_test(monitor, readings)
    ):
        memory.is_cleared[flow_sensor_index] = 1


@kernel
def clear_accelerometers(monitor):
    """Clear all accelerometers."""
    monitor.memory.is_cleared[AX:] = 1


@kernel
def flow_reading_jumped(monitor, readings):
    """Whether the residual exceeds any jump of an accelerometer in one sample, and the flow sensor's reading
    jumps with it."""
    alarm_test_index, redundancy, memory = monitor.output.alarm_test_index, monitor.redundancy, monitor.memory
    flow_sensor_index = flow_sensor_index_of_test(alarm_test_index)
    previous_reading = redundancy.memory.previous_reading
    alarm_test = redundancy.test[alarm_test_index]
    # residual for a velocity error of 1 m/s, and for an acceleration error of 1 m/s2 in one sample
    residual_per_velocity_error = (
        1.0
        if alarm_test_index == SPEED_TEST
        else 1.0 / max(previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    )
    residual_per_acceleration_error = redundancy.config.sample_time_s * residual_per_velocity_error
    reading_second_difference = (
        readings[flow_sensor_index]
        - 2.0 * previous_reading[flow_sensor_index]
        + memory.reading_two_samples_ago[flow_sensor_index]
    )
    min_reading_jump = MIN_READING_JUMP_PER_RESIDUAL * abs(alarm_test.residual)
    max_accelerometer_jump_effect = (
        ADAMS_BASHFORTH_WEIGHT * memory.fading_max_accelerometer_jump * residual_per_acceleration_error
    )
    return (
        abs(alarm_test.residual)
        > alarm_test.filtered_bound[0] + MIN_FAULTY_FORCE_JUMP_M_S2 * residual_per_acceleration_error
        and abs(reading_second_difference) >= min_reading_jump > max_accelerometer_jump_effect
    )


@kernel
def update_flow_evidence_since_alarm(monitor, readings):
    """Add up, after the sample of the alarm, the residuals of the flow (3,), the part of sound sensors and
    that of an error that a reading has had from the start; and find the range of each reading."""
    redundancy, memory, initial_errors = monitor.redundancy, monitor.memory, monitor.initial_errors
    config = redundancy.config
    for j in range(3):
        flow_reading = readings[flow_sensor_index_of_test(SPEED_TEST + j)]
        test = redundancy.test[SPEED_TEST + j]
        if memory.n_samples_since_alarm == 0:
            memory.min_flow_reading_since_alarm[j] = memory.max_flow_reading_since_alarm[j] = flow_reading
            memory.flow_bound_sum_since_alarm[j] = (  # noise of the first and of the last sample
                2.0 * test.bound_per_sample + test.residual_per_gust_speed_change * config.max_gust_speed_mps
            )
            continue
        memory.flow_residual_sum_since_alarm[j] += test.residual
        flow_hypothesis_index = initial_error_hypothesis_of_test(SPEED_TEST + j)
        memory.flow_bound_sum_since_alarm[j] += config.sample_time_s * test.bound_per_s
        memory.initial_error_effect_sum_since_alarm[j] += (
            initial_errors.error_bound_at_alarm[flow_hypothesis_index]
            * initial_errors.max_effect_per_unit_error[flow_hypothesis_index, SPEED_TEST + j]
        )
        memory.min_flow_reading_since_alarm[j], memory.max_flow_reading_since_alarm[j] = (
            min(memory.min_flow_reading_since_alarm[j], flow_reading),
            max(memory.max_flow_reading_since_alarm[j], flow_reading),
        )
    unexplained_alpha_error = np.sign(memory.flow_residual_sum_since_alarm[1]) * max(
        abs(memory.flow_residual_sum_since_alarm[1])
        - memory.flow_bound_sum_since_alarm[1]
        - memory.initial_error_effect_sum_since_alarm[1],
        0.0,
    )
    climb_error_in_sample_m = (
        config.sample_time_s
        * readings[AIRSPEED]
        * unexplained_alpha_error
        * np.cos(readings[PHI])
        * np.cos(readings[THETA])
    )
    for m in range(config.filter_decay_by_pole.size):
        memory.filtered_climb_error_m[m] = (
            config.filter_decay_by_pole[m] * memory.filtered_climb_error_m[m] + climb_error_in_sample_m
        )
    memory.n_samples_since_alarm += 1


@kernel
def residual_sum_exceeds_reading_range(monitor):
    """Whether the residuals add up to more than an error of a flow sensor whose reading has this range."""
    memory, j = monitor.memory, monitor.output.alarm_test_index - SPEED_TEST
    flow_reading_range_since_alarm = (
        memory.max_flow_reading_since_alarm[j] - memory.min_flow_reading_since_alarm[j]
    )
    max_residual_sum_without_new_error = (
        memory.flow_bound_sum_since_alarm[j] + memory.initial_error_effect_sum_since_alarm[j]
    )
    return (
        flow_reading_range_since_alarm > 0.0
        and abs(memory.flow_residual_sum_since_alarm[j])
        > MIN_RESIDUAL_SUM_PER_READING_RANGE * flow_reading_range_since_alarm
        + MIN_EFFECT_OVER_BOUND_TO_CLEAR * max_residual_sum_without_new_error
    )


@kernel
def flow_sensor_error_would_exceed_other_test(monitor, readings):
    """Whether an airspeed of this error would exceed the test of the density, or an incidence that of the
    climb, while that test is within its bound."""
    redundancy, initial_errors = monitor.redundancy, monitor.initial_errors
    alarm_test_index = monitor.output.alarm_test_index
    other_test_index = DENSITY_TEST if alarm_test_index == SPEED_TEST else CLIMB_TEST
    if alarm_test_index == BETA_FLOW_TEST or monitor.memory.tests_exceeded_since_alarm[other_test_index]:
        return False
    flow_hypothesis_index = initial_error_hypothesis_of_test(alarm_test_index)
    for m in range(redundancy.config.filter_decay_by_pole.size):
        expected_residual = abs(monitor.memory.filtered_climb_error_m[m])
        speed_test = redundancy.test[SPEED_TEST]
        if (
            alarm_test_index == SPEED_TEST
        ):  # log(density) changes by twice the relative change of the airspeed
            expected_residual = (
                2.0
                * (abs(speed_test.filtered_residual[m]) - speed_test.filtered_bound[m])
                / max(readings[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
            )
            expected_residual *= 1.0 - min(initial_errors.error_bound_at_alarm[flow_hypothesis_index], 1.0)
        if expected_residual > MIN_EFFECT_OVER_BOUND_TO_CLEAR * (
            redundancy.test[other_test_index].filtered_bound[m]
            + max_error_effect_at_alarm(initial_errors, flow_hypothesis_index, other_test_index, m)
        ):
            return True
    return False


@kernel
def suspect_accelerometers(monitor, gyro_explains_residual):
    """Suspect the accelerometers along whose axis most of the spurious velocity is, unless a gyro explains
    it."""
    memory, is_suspect = monitor.memory, monitor.output.is_suspect
    previous_reading = monitor.redundancy.memory.previous_reading
    flow_residual_sum_since_alarm = memory.flow_residual_sum_since_alarm
    flow_bound_sum_since_alarm = memory.flow_bound_sum_since_alarm
    alpha = previous_reading[ALPHA]
    beta = previous_reading[BETA]
    V = max(previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    # m/s: along the flow, across it downwards and sideways; then along the flow's projection on the plane of
    # symmetry
    spurious_velocity_along_flow = flow_residual_sum_since_alarm[0]
    spurious_velocity_across_flow_down = V * np.cos(beta) * flow_residual_sum_since_alarm[1]
    spurious_velocity_across_flow_sideways = V * flow_residual_sum_since_alarm[2]
    spurious_velocity = memory.spurious_velocity
    largest_component_magnitude = 0.0
    spurious_velocity_along_projected_flow = (
        np.cos(beta) * spurious_velocity_along_flow - np.sin(beta) * spurious_velocity_across_flow_sideways
    )
    spurious_velocity[0] = (
        np.cos(alpha) * spurious_velocity_along_projected_flow
        - np.sin(alpha) * spurious_velocity_across_flow_down
    )
    spurious_velocity[1] = (
        np.sin(beta) * spurious_velocity_along_flow + np.cos(beta) * spurious_velocity_across_flow_sideways
    )
    spurious_velocity[2] = (
        np.sin(alpha) * spurious_velocity_along_projected_flow
        + np.cos(alpha) * spurious_velocity_across_flow_down
    )
    spurious_velocity_bound_if_healthy = flow_bound_sum_since_alarm[0] + V * (
        flow_bound_sum_since_alarm[1] + flow_bound_sum_since_alarm[2]
    )  # m/s, of sound sensors
    frozen_accelerometer_index = NO_SENSOR
    for i in range(3):
        largest_component_magnitude = max(largest_component_magnitude, abs(spurious_velocity[i]))
        frozen_accelerometer_index = AX + i if is_frozen(monitor, AX + i) else frozen_accelerometer_index
    for i in range(AX, N_IN_EQUATIONS):
        may_be_cause = frozen_accelerometer_index == i or (
            frozen_accelerometer_index < 0
            and abs(spurious_velocity[i - AX]) + spurious_velocity_bound_if_healthy
            >= MIN_SHARE_OF_LARGEST_VELOCITY_COMPONENT * largest_component_magnitude
        )
        is_suspect[i] = may_be_cause and not gyro_explains_residual and not memory.is_cleared[i]


@kernel
def disable_accelerometers_if_suspect(monitor, measured):
    """Mark the accelerometers as unusable once one of them may be broken."""
    for i in range(AX, N_IN_EQUATIONS):
        if monitor.output.is_reading_unused[i] or (monitor.output.alarmed and monitor.output.is_suspect[i]):
            set_inertial(measured, 0)


# A smaller share of the largest of three residuals is the effect of its error on the two other axes or angles
MIN_SHARE_OF_LARGEST_RESIDUAL = 0.03
# start_stage: 1 after the first sample and while the pitch is too steep, 2 with the first whole frame, 3 from
# the next frame on: only then the innovation contains the change of a gyro's error between two frames
START_STAGE_SHOWING_GYRO_ERROR_CHANGE = 3
MIN_SURFACE_ALARM_LEAD_S = 0.5  # before the alarm: a surface detected earlier was detected with sound sensors
INITIAL_ERROR_WINDOW_S = 1.0  # from the start: an alarm of the surfaces may be caused by an initial error
VANE_ESTIMATE_RETURN_TO_TRIM_TIME_S = 20.0  # of the return to trim of a replaced vane: kinematics alone drift
# index in FILTER_POLES_PER_S: of the filter that gives the first value of a replaced rate
INITIAL_RATE_ESTIMATE_POLE_INDEX = 1

# Gyro or attitude (judge_gyro_errors)
RATE_DAMPING_RELATIVE_TOLERANCE = 0.2  # relative error of the damping away from trim, of W
# innovation, rad/s2, that an error of 1 rad/s of the gyro itself causes, at most
MAX_INNOVATION_TO_GYRO_ERROR_RATIO_PER_S = 10.0
GYRO_JUMP_TOLERANCE_SHARE = 0.1  # share of a gyro's jump by which the innovation may differ from it
MIN_GYRO_ERROR_SHARE_ESTIMATED = 0.7  # of a gyro's error, which W shows
N_NOISY_SAMPLES_IN_JUMP = 4.0  # a jump is the difference of two residuals, each with the noise of two samples
MIN_TRANSIENT_NOISE_RATIO = (
    2.0  # of the size of a transient to the bound on noise: else noise may be all of it
)
MAX_REMAINING_TRANSIENT_SHARE = 0.003  # of a jump of the attitude within a frame, in the next frame
RATE_AND_ACCELERATION_ROUNDING = 1e-6  # rad/s, and rad/s2: the part of the bounds that covers rounding

# Errors that a test within its bound B hides: the effect of sound sensors, up to B, may have the other sign
MAX_HIDDEN_ERROR_PER_TEST_BOUND = 2.0
# Margin on the bound of the flow's test, for the gyro that turns the flow by all of its error
FLOW_BOUND_FACTOR_FOR_FULLY_ACTING_GYRO = 2.0


@kernel
def check_sensors_and_replace_readings(
    monitor, prediction_record, measured, surface_conclusion, detection_filter_bank, bound_record, dt, t
):
    """Test the sensors at t s, and replace in `measured` the readings of broken ones.

    detection_filter_bank: with the innovation of the elapsed frame, of dt s; bound_record: with the bound on
    that innovation. surface_conclusion: about the surfaces, so far.
    """
    redundancy, initial_errors, readings = monitor.redundancy, monitor.initial_errors, measured.signal
    memory = monitor.memory
    if not memory.start_stage:
        begin_monitor(monitor, measured, t)
        return
    if memory.substep == 0:
        update_gyro_error_from_dynamics(
            monitor, detection_filter_bank.output.innovation, bound_record.eta_bar, dt
        )
    run_tests_with_equation(redundancy, readings, monitor.config.has_engine_sensors)
    if N_TESTS > N_TESTS_WITH_EQUATION:
        compare_duplicate_sensors(redundancy, readings, measured.fresh)
        latch_duplicates_agreeing_before_alarm(monitor, measured.fresh)
    update_initial_error_bounds(redundancy, initial_errors, readings)
    update_identical_counts_and_accelerometer_jump(monitor, readings)
    if memory.substep == 0:
        memory.previous_apparent_gyro_error[:], memory.earlier_substep_gyro_error_peak[:] = (
            memory.apparent_gyro_error,
            memory.previous_substep_gyro_error_peak,
        )
        memory.previous_substep_gyro_error_peak[:] = memory.substep_gyro_error_peak
        memory.previous_substep_gyro_error_floor[:] = memory.substep_gyro_error_floor
        memory.substep_gyro_error_peak[:], memory.substep_gyro_error_floor[:] = 0.0, 0.0
    for i in range(3):
        gyro_error_by_attitude = (
            -redundancy.test[FIRST_TURN_TEST + i].residual / redundancy.config.sample_time_s
        )
        if memory.substep == 0:
            memory.apparent_gyro_error[i] = gyro_error_by_attitude
        else:
            memory.substep_gyro_error_peak[i] = max(
                memory.substep_gyro_error_peak[i], abs(gyro_error_by_attitude)
            )
            memory.substep_gyro_error_floor[i] = (
                abs(gyro_error_by_attitude)
                if memory.substep == 1
                else min(memory.substep_gyro_error_floor[i], abs(gyro_error_by_attitude))
            )
    if pitch_is_too_steep(redundancy, readings):
        restart_comparison_of_gyros_and_attitude(memory)
    elif memory.start_stage < START_STAGE_SHOWING_GYRO_ERROR_CHANGE:
        advance_start_stage_and_widen_gyro_error_bound(monitor)
    if monitor.config.attitude_is_noisy and not pitch_is_too_steep(redundancy, readings):
        exclude_all_gyros_on_turn_difference(monitor)
    raise_alarm_and_isolate_broken_sensor(
        monitor, measured, surface_conclusion, detection_filter_bank, bound_record, dt, t
    )
    replace_isolated_and_missing_readings(monitor, prediction_record, measured)
    disable_accelerometers_if_suspect(monitor, measured)
    memory.reading_two_samples_ago[:] = redundancy.memory.previous_reading
    store_sample_as_previous(redundancy, readings, measured.force)
    memory.substep = (memory.substep + 1) % monitor.config.substeps


@kernel
def add_turn_beyond_gyros(monitor, att, readings):
    """Add to the comparison of attitude and rates what the attitude has turned beyond the gyros in this
    sample; near the vertical it shows no turn."""
    if pitch_is_too_steep(monitor.redundancy, readings):
        attitude.restart(att)
        return
    for i in range(3):
        att.turn[i] += monitor.redundancy.test[FIRST_TURN_TEST + i].residual


@kernel
def set_expected_manifold_pressure(monitor, manifold_pressure_inhg):
    """Predict the engine's manifold pressure from the command of the law in charge of the engine."""
    monitor.redundancy.memory.commanded_engine_readings[1] = manifold_pressure_inhg


@kernel
def begin_monitor(monitor, measured, t):
    """Take the first sample, at t s: there is none to compare it with."""
    memory, redundancy = monitor.memory, monitor.redundancy
    memory.start_stage, memory.started_at_s = 1, t
    set_accumulated_attitude_drift_bound(redundancy, t)
    start_redundancy_tests(redundancy, measured.signal, measured.force)
    set_error_bounds_at_start(monitor.initial_errors, measured.signal)
    memory.reading_two_samples_ago[:] = redundancy.memory.previous_reading
    memory.substep = (memory.substep + 1) % monitor.config.substeps


@kernel
def advance_start_stage_and_widen_gyro_error_bound(monitor):
    """Widen the bound on W by a gyro's error of the first sample, which has caused no innovation. The first
    frame shows no change of an error."""
    memory = monitor.memory
    if memory.substep == 0:
        memory.start_stage += 1
    if memory.start_stage == START_STAGE_SHOWING_GYRO_ERROR_CHANGE - 1 and memory.substep == 0:
        for i in range(3):
            memory.sound_gyro_estimate_bound[i] += abs(memory.apparent_gyro_error[i])


@kernel
def restart_comparison_of_gyros_and_attitude(memory):
    """Compare W with the attitude only from the next sample on: a test that restarts has no residual, and
    shows neither an error nor its absence."""
    memory.start_stage = 1
    memory.filtered_turn_difference[:] = 0.0
    memory.filtered_turn_difference_bound[:] = 0.0
    memory.filtered_turn_beyond_angle[:] = 0.0
    memory.filtered_angle_residual_size[:] = 0.0
    memory.max_turn_per_angle[:] = 0.0


@kernel
def update_gyro_error_from_dynamics(monitor, innovation, eta_bar, dt):
    """Advance W (3,) rad/s, the gyro error if the dynamics are right, and its bound by the frame of dt s with
    innovation and eta_bar (3,) rad/s2."""
    memory, D = monitor.memory, monitor.config.rate_damping_per_s
    gyro_error = memory.gyro_error_estimate
    sound_gyro_estimate_bound = memory.sound_gyro_estimate_bound
    previous_frame_gyro_error = memory.previous_gyro_error_estimate
    previous_sound_gyro_estimate_bound = memory.previous_sound_gyro_estimate_bound
    previous_sound_gyro_estimate_bound[:] = sound_gyro_estimate_bound
    previous_frame_gyro_error[:] = gyro_error
    for i in range(3):
        damping_deceleration, bound_growth_rate_from_damping = 0.0, 0.0
        for j in range(3):
            damping_deceleration += D[i, j] * previous_frame_gyro_error[j]
            bound_growth_rate_from_damping += (
                -D[i, j] if i == j else abs(D[i, j])
            ) * previous_sound_gyro_estimate_bound[j]
        gyro_error[i] += dt * (innovation[i] - damping_deceleration)
        sound_gyro_estimate_bound[i] = max(
            previous_sound_gyro_estimate_bound[i] + dt * (eta_bar[i] + bound_growth_rate_from_damping), 0.0
        )


@kernel
def exclude_all_gyros_on_turn_difference(monitor):
    """Record that no gyro can be broken: W and the attitude disagree by more than both bounds.

    Where the attitude is noisy, a surface is isolated only after that.
    """
    memory, config = monitor.memory, monitor.redundancy.config
    for i in range(3):
        test = monitor.redundancy.test[FIRST_TURN_TEST + i]
        gyro_estimate_error_bound = memory.sound_gyro_estimate_bound[
            i
        ] + RATE_DAMPING_RELATIVE_TOLERANCE * abs(memory.gyro_error_estimate[i])
        for m, decay in enumerate(config.filter_decay_by_pole):
            memory.filtered_turn_difference[i, m] = (
                decay * memory.filtered_turn_difference[i, m]
                + test.residual
                + config.sample_time_s * memory.gyro_error_estimate[i]
            )
            memory.filtered_turn_difference_bound[i, m] = advance_residual_bound(
                memory.filtered_turn_difference_bound[i, m],
                gyro_estimate_error_bound,
                decay,
                config.sample_time_s,
            )
            if (
                abs(memory.filtered_turn_difference[i, m])
                > memory.filtered_turn_difference_bound[i, m] + test.filtered_bound[m]
            ):
                memory.gyros_excluded = 1


@kernel
def raise_alarm_and_isolate_broken_sensor(
    monitor, measured, surface_conclusion, detection_filter_bank, bound_record, dt, t
):
    """Raise the alarm, and isolate the sensor once it is the only suspect."""
    output, memory = monitor.output, monitor.memory
    update_worst_test_of_frame(monitor)
    if output.isolated_sensor != NO_SENSOR:
        return
    for i in range(N_SENSORS):
        if measured.missing[i] and output.isolated_sensor == NO_SENSOR:
            raise_alarm_and_judge_surface_conclusion(monitor, surface_conclusion, t)
            mark_sensor_isolated(monitor, i, t)
    if output.isolated_sensor != NO_SENSOR:
        return
    if output.worst_residual_bound_ratio > 1.0 and not output.alarmed:
        raise_alarm_and_judge_surface_conclusion(monitor, surface_conclusion, t)
        output.alarm_test_index = output.worst_test_index
        store_error_bounds_at_alarm(monitor.initial_errors)
    if output.alarmed:
        update_turn_beyond_each_angle(monitor, measured.signal)
        if memory.substep == 0 and memory.start_stage == START_STAGE_SHOWING_GYRO_ERROR_CHANGE:
            judge_gyro_errors(monitor, detection_filter_bank, bound_record, dt)
        latch_exceeded_tests_and_refutations(monitor)
        update_cleared_sensors(monitor, measured.signal)
        find_suspects(monitor)
        n_suspects, last_suspect_index = 0, NO_SENSOR
        for i in range(N_SENSORS):
            if output.is_suspect[i]:
                n_suspects, last_suspect_index = n_suspects + 1, i
        if n_suspects == 1:
            mark_sensor_isolated(monitor, last_suspect_index, t)


@kernel
def update_worst_test_of_frame(monitor):
    """Find the test with the largest ratio of residual to bound, of the samples of this frame."""
    output = monitor.output
    if monitor.memory.substep == 0:
        output.worst_test_index, output.worst_residual_bound_ratio = 0, 0.0
    for test_index in range(N_TESTS):
        if monitor.redundancy.test[test_index].residual_bound_ratio > output.worst_residual_bound_ratio:
            output.worst_test_index, output.worst_residual_bound_ratio = (
                test_index,
                monitor.redundancy.test[test_index].residual_bound_ratio,
            )


@kernel
def raise_alarm_and_judge_surface_conclusion(monitor, surface_conclusion, t):
    """Raise the alarm of the sensors at t s. A surface detected long before was detected with sound sensors,
    and stays detected. Otherwise the conclusion about surfaces is void."""
    output = monitor.output
    if output.alarmed:
        return
    output.alarmed, output.alarmed_at_s = 1, t
    if surface_conclusion.detected and surface_conclusion.detected_at_s < t - MIN_SURFACE_ALARM_LEAD_S:
        output.keeps_surface_conclusion = 1
        return
    if surface_conclusion.detected:
        # the same fault, which the rates have shown first
        output.alarmed_at_s = surface_conclusion.detected_at_s
    output.surface_was_isolated_at_alarm = surface_conclusion.isolated_estimator >= 0


@kernel
def mark_sensor_isolated(monitor, sensor_index, t):
    """Isolate a sensor at t s."""
    monitor.output.isolated_sensor, monitor.output.isolated_at_s = sensor_index, t
    monitor.output.is_reading_unused[sensor_index] = 1


@kernel
def judge_gyro_errors(monitor, detection_filter_bank, bound_record, dt):
    """Decide, by axis, whether the error that the attitude shows is a gyro's, once that is certain.

        the innovation changes as by this jump of the gyro   the dynamics show an error   verdict
        no                                                   yes or no                    refuted
        yes                                                  yes                          confirmed
        yes     no; the error is a transient, or so large that W would show it            refuted
        yes     no; neither                                                               undecided

    A transient appears inside a frame, and is absent in all samples of the next. It is no gyro's: an error of
    a gyro stays, and one that varies is not as small in every sample. If an error is there in every sample
    and varies between them, as noise does, the innovation cannot be compared with its jump: the innovation
    contains the errors as the frames begin, and the attitude shows those of the samples before.
    """
    memory, innovation = monitor.memory, detection_filter_bank.output.innovation
    filter_bank_alarm_axis = bank_alarm_axis(detection_filter_bank)
    for i in range(3):
        if memory.gyro_error_verdict_by_axis[i] != GYRO_ERROR_UNDECIDED:
            continue
        gyro_error_by_attitude = memory.apparent_gyro_error[i]
        previous_frame_gyro_error_by_attitude = memory.previous_apparent_gyro_error[i]
        jump_acceleration = (gyro_error_by_attitude - previous_frame_gyro_error_by_attitude) / dt  # rad/s2
        jump_acceleration_tolerance = MAX_INNOVATION_TO_GYRO_ERROR_RATIO_PER_S * max(
            abs(gyro_error_by_attitude), abs(previous_frame_gyro_error_by_attitude)
        ) + GYRO_JUMP_TOLERANCE_SHARE * abs(jump_acceleration)
        attitude_rate_noise_bound = (  # of gyro_error_by_attitude, rad/s, by the attitude's noise
            N_NOISY_SAMPLES_IN_JUMP
            * monitor.redundancy.test[FIRST_TURN_TEST + i].bound_per_sample
            / monitor.redundancy.config.sample_time_s
        )
        innovation_bound = bound_record.frame_innovation_bound[i] + RATE_AND_ACCELERATION_ROUNDING
        error_shows_in_dynamics = (
            abs(innovation[i]) > innovation_bound
            or filter_bank_alarm_axis >= 0
            or abs(memory.gyro_error_estimate[i])
            > memory.sound_gyro_estimate_bound[i] + RATE_AND_ACCELERATION_ROUNDING
        )
        earlier_gyro_error_peak = memory.earlier_substep_gyro_error_peak[i]
        later_gyro_error_peak = max(
            abs(previous_frame_gyro_error_by_attitude),
            memory.previous_substep_gyro_error_peak[i],
            abs(gyro_error_by_attitude),
        )
        gyro_error_is_transient = (
            later_gyro_error_peak < MAX_REMAINING_TRANSIENT_SHARE * earlier_gyro_error_peak
            and earlier_gyro_error_peak > MIN_TRANSIENT_NOISE_RATIO * attitude_rate_noise_bound
        )
        innovation_fits_gyro_jump = (
            abs(innovation[i] - jump_acceleration)
            <= innovation_bound + jump_acceleration_tolerance + attitude_rate_noise_bound / dt
        )
        smallest_gyro_error = memory.previous_substep_gyro_error_floor[i]
        gyro_error_varies = (
            smallest_gyro_error > attitude_rate_noise_bound
            and memory.previous_substep_gyro_error_peak[i]
            > (1.0 + GYRO_JUMP_TOLERANCE_SHARE) * smallest_gyro_error
        )
        gyro_error_estimate_allows_error = (
            MIN_GYRO_ERROR_SHARE_ESTIMATED * abs(gyro_error_by_attitude)
            <= memory.sound_gyro_estimate_bound[i]
            + abs(memory.gyro_error_estimate[i])
            + attitude_rate_noise_bound
        )
        if not (innovation_fits_gyro_jump or gyro_error_varies) or (
            not error_shows_in_dynamics and (gyro_error_is_transient or not gyro_error_estimate_allows_error)
        ):
            memory.gyro_error_verdict_by_axis[i] = GYRO_ERROR_REFUTED
        elif error_shows_in_dynamics and innovation_fits_gyro_jump:
            memory.gyro_error_verdict_by_axis[i] = GYRO_ERROR_CONFIRMED


@kernel
def exceeds_bound_beyond_cross_coupling(monitor, test_index, first_test_index):
    """Whether a test, one of the three from first_test_index on, exceeds its bound by more than an error
    on one of the other two axes explains."""
    largest_residual = 0.0
    for i in range(3):
        largest_residual = max(
            largest_residual, abs(monitor.redundancy.test[first_test_index + i].filtered_residual[0])
        )
    test = monitor.redundancy.test[test_index]
    return (
        test.residual_bound_ratio > 1.0
        and abs(test.filtered_residual[0]) > MIN_SHARE_OF_LARGEST_RESIDUAL * largest_residual
    )


@kernel
def latch_exceeded_tests_and_refutations(monitor):
    """Record the tests that have exceeded their bounds since the alarm."""
    redundancy, tests_exceeded_since_alarm = monitor.redundancy, monitor.memory.tests_exceeded_since_alarm
    for test_index in range(N_TESTS):
        first_test_index = FIRST_TURN_TEST if test_index < FIRST_ANGLE_TEST else FIRST_ANGLE_TEST
        is_exceeded = (
            exceeds_bound_beyond_cross_coupling(monitor, test_index, first_test_index)
            if test_index < SPEED_TEST
            else redundancy.test[test_index].residual_bound_ratio > 1.0
        )
        if is_exceeded:
            tests_exceeded_since_alarm[test_index] = 1
    latch_refuted_hypotheses(redundancy, monitor.initial_errors, tests_exceeded_since_alarm)


@kernel
def find_suspects(monitor):
    """Fill is_suspect (N_SENSORS,): the sensors whose error explains all tests."""
    is_suspect, alarm_test_index = monitor.output.is_suspect, monitor.output.alarm_test_index
    tests_exceeded_since_alarm = monitor.memory.tests_exceeded_since_alarm
    is_suspect[:] = 0
    if alarm_test_index >= N_TESTS_WITH_EQUATION:
        suspect_disagreeing_sensors(monitor, alarm_test_index - N_TESTS_WITH_EQUATION)
        return
    if alarm_test_index < SPEED_TEST:
        suspect_gyros_and_attitude(monitor)
    if alarm_test_index == SPEED_TEST:
        suspect_accelerometers(monitor, False)
        is_suspect[AIRSPEED] = not monitor.memory.is_cleared[AIRSPEED]
    elif alarm_test_index == DENSITY_TEST:
        airspeed_may_be_frozen = (
            monitor.memory.n_identical_samples[AIRSPEED] > 0
        )  # its test need not show an error then
        is_suspect[AIRSPEED] = (
            tests_exceeded_since_alarm[SPEED_TEST] == 1
            or not airspeed_error_would_exceed_speed_test(monitor)
            or airspeed_may_be_frozen
        )
    is_suspect[QDYN] = alarm_test_index == DENSITY_TEST and no_other_test_exceeded(monitor, DENSITY_TEST)
    find_suspects_of_flow_test(monitor, ALPHA, ALPHA_FLOW_TEST, 1)
    find_suspects_of_flow_test(monitor, BETA, BETA_FLOW_TEST, 2)
    is_suspect[ALTITUDE] = alarm_test_index == CLIMB_TEST and no_other_test_exceeded(monitor, CLIMB_TEST)
    is_suspect[ENGINE_SPEED] = alarm_test_index == RPM_TEST
    is_suspect[MANIFOLD] = alarm_test_index == MANIFOLD_PRESSURE_TEST
    has_frozen_suspect = any_suspect_is_frozen(monitor)
    for i in range(N_INITIAL_ERROR_HYPOTHESES):
        if not has_frozen_suspect and initial_error_explains_exceeded_tests(
            monitor.initial_errors, i, alarm_test_index
        ):
            is_suspect[(ALPHA, BETA, AIRSPEED, PHI, THETA)[i]] = 1


@kernel
def latch_duplicates_agreeing_before_alarm(monitor, is_fresh_by_sampled_sensor):
    """Record which sensors have agreed, before any alarm, with the reading that they should equal."""
    for duplicate_index in range(DUPLICATE_SENSOR_INDEX.size):
        agrees_with_duplicate = (
            monitor.redundancy.test[N_TESTS_WITH_EQUATION + duplicate_index].residual_bound_ratio <= 1.0
        )
        if (
            is_fresh_by_sampled_sensor[DUPLICATE_SENSOR_INDEX[duplicate_index] - N_IN_EQUATIONS]
            and agrees_with_duplicate
            and not monitor.output.alarmed
        ):
            monitor.memory.has_duplicate_agreed[duplicate_index] = 1


@kernel
def suspect_disagreeing_sensors(monitor, duplicate_index):
    """Suspect a duplicate sensor, or the reading that it no longer equals.

    The reading is suspected if its own test shows an error, the sensor if an error of the reading of this
    size would have exceeded that test, both if neither is certain.

    No test shows an error that a reading has had from the first sample on, nor a frozen reading.
    """
    redundancy, memory = monitor.redundancy, monitor.memory
    duplicated_reading_index = DUPLICATED_READING_INDEX[duplicate_index]
    duplicated_reading_test_index = DUPLICATED_READING_TEST_INDEX[duplicate_index]
    reading_test_record = redundancy.test[duplicated_reading_test_index]
    duplicate_test_record = redundancy.test[N_TESTS_WITH_EQUATION + duplicate_index]
    # of the reading, if it is the broken one
    min_reading_error = abs(duplicate_test_record.residual) - duplicate_test_record.filtered_bound[0]
    error_may_be_hidden = min_reading_error <= MAX_HIDDEN_ERROR_PER_TEST_BOUND * max(
        reading_test_record.filtered_bound[0], redundancy.memory.reading_error_bound[duplicated_reading_index]
    )
    reading_is_frozen = is_frozen(monitor, duplicated_reading_index)
    monitor.output.is_suspect[
        DUPLICATE_SENSOR_INDEX[duplicate_index]
    ] = not memory.tests_exceeded_since_alarm[duplicated_reading_test_index]
    monitor.output.is_suspect[duplicated_reading_index] = (
        memory.tests_exceeded_since_alarm[duplicated_reading_test_index] == 1
        or error_may_be_hidden
        or reading_is_frozen
        or not memory.has_duplicate_agreed[duplicate_index]
    )


@kernel
def no_other_test_exceeded(monitor, test_index):
    """Whether no other test has exceeded its bound: the sensor of this one takes part in no other."""
    for other_test_index in range(RPM_TEST):
        if other_test_index != test_index and monitor.memory.tests_exceeded_since_alarm[other_test_index]:
            return False
    return True


@kernel
def any_suspect_is_frozen(monitor):
    """Whether a suspect is frozen, which an error of another sensor from the start does not explain. A sound
    sensor may read zero."""
    for i in range(N_SENSORS):
        if (
            monitor.output.is_suspect[i]
            and monitor.redundancy.memory.previous_reading[i] != 0.0
            and is_frozen(monitor, i)
        ):
            return True
    return False


@kernel
def find_suspects_of_flow_test(monitor, vane_index, flow_test_index, fully_acting_gyro_index):
    """Suspect a vane, an accelerometer, or a gyro whose error may be hidden in the tests of the attitude; all
    of fully_acting_gyro_index's error turns the flow. No flow sensor moves the attitude's tests."""
    if monitor.output.alarm_test_index != flow_test_index:
        return
    tests_exceeded_since_alarm = monitor.memory.tests_exceeded_since_alarm
    is_suspect = monitor.output.is_suspect
    n_exceeded_turn_tests = (
        tests_exceeded_since_alarm[FIRST_TURN_TEST]
        + tests_exceeded_since_alarm[FIRST_TURN_TEST + 1]
        + tests_exceeded_since_alarm[FIRST_TURN_TEST + 2]
    )
    suspect_accelerometers(monitor, n_exceeded_turn_tests > 0)
    is_suspect[vane_index] = not (n_exceeded_turn_tests > 0 or monitor.memory.is_cleared[vane_index])
    for i in range(3):
        turn_test_shows_gyro = (
            n_exceeded_turn_tests == 1 and tests_exceeded_since_alarm[FIRST_TURN_TEST + i] == 1
        )
        is_suspect[i] = turn_test_shows_gyro or (
            n_exceeded_turn_tests == 0
            and gyro_error_may_be_hidden(monitor, flow_test_index, i, i == fully_acting_gyro_index)
        )


@kernel
def gyro_error_may_be_hidden(monitor, flow_test_index, gyro_index, acts_fully_on_flow):
    """Whether an error of a gyro explains the test of the flow, and stays within the bound of the test of its
    axis; acts_fully_on_flow: all of its error turns the flow. Of another gyro's error a share does, by
    kinematics."""
    redundancy, previous_reading = monitor.redundancy, monitor.redundancy.memory.previous_reading
    alpha = previous_reading[ALPHA]
    stability_roll_share = np.cos(alpha) if gyro_index == 0 else np.sin(alpha)
    share_of_gyro_error_acting_on_flow = (
        abs(np.tan(previous_reading[BETA]) * stability_roll_share)
        if flow_test_index == ALPHA_FLOW_TEST
        else abs(np.sin(alpha))
    )
    flow_test_record = redundancy.test[flow_test_index]
    turn_test = redundancy.test[FIRST_TURN_TEST + gyro_index]
    for m in range(flow_test_record.filtered_residual.size):
        flow_residual_bound = (
            FLOW_BOUND_FACTOR_FOR_FULLY_ACTING_GYRO * flow_test_record.filtered_bound[m]
            if acts_fully_on_flow
            else flow_test_record.filtered_bound[m]
        )
        max_flow_effect_of_hidden_error = (
            MAX_HIDDEN_ERROR_PER_TEST_BOUND
            * (1.0 if acts_fully_on_flow else share_of_gyro_error_acting_on_flow)
            * turn_test.filtered_bound[m]
        )
        if abs(flow_test_record.filtered_residual[m]) > max_flow_effect_of_hidden_error + flow_residual_bound:
            return False
    # q does not act on the sideslip
    return acts_fully_on_flow or gyro_index == 0 or flow_test_index == ALPHA_FLOW_TEST


@kernel
def airspeed_error_would_exceed_speed_test(monitor):
    """Whether the airspeed error that the density shows would exceed the bound of the airspeed's own test."""
    density_test, speed_test = monitor.redundancy.test[DENSITY_TEST], monitor.redundancy.test[SPEED_TEST]
    max_airspeed_reading_over_truth = 1.0 + monitor.initial_errors.error_bound_at_alarm[AIRSPEED_HYPOTHESIS]
    for m in range(density_test.filtered_residual.size):
        residual_beyond_initial_error_effect = abs(
            density_test.filtered_residual[m]
        ) - max_error_effect_at_alarm(monitor.initial_errors, AIRSPEED_HYPOTHESIS, DENSITY_TEST, m)
        # a relative change of the airspeed changes log(density) by twice as much
        airspeed_error_mps = (
            0.5 * monitor.redundancy.memory.previous_reading[AIRSPEED] * residual_beyond_initial_error_effect
        )
        if (
            airspeed_error_mps
            > MAX_HIDDEN_ERROR_PER_TEST_BOUND * max_airspeed_reading_over_truth * speed_test.filtered_bound[m]
        ):
            return True
    return False


@kernel
def suspect_gyros_and_attitude(monitor):
    """Suspect gyros and attitude: one axis alone, or one angle alone. A gyro's error may appear in an angle
    first. A frozen angle excludes the gyros; it is suspected until it is known not to be frozen."""
    memory, is_suspect = monitor.memory, monitor.output.is_suspect
    tests_exceeded_since_alarm = memory.tests_exceeded_since_alarm
    gyro_error_verdict_by_axis = memory.gyro_error_verdict_by_axis
    n_exceeded_turn_tests, any_angle_is_frozen = 0, False
    for i in range(3):
        n_exceeded_turn_tests += tests_exceeded_since_alarm[FIRST_TURN_TEST + i]
        any_angle_is_frozen = any_angle_is_frozen or is_frozen(monitor, PHI + i)
    for i in range(3):
        no_other_axis_exceeded = n_exceeded_turn_tests == 0 or (
            tests_exceeded_since_alarm[FIRST_TURN_TEST + i] == 1 and n_exceeded_turn_tests == 1
        )
        is_suspect[i] = (
            no_other_axis_exceeded
            and gyro_error_verdict_by_axis[i] != GYRO_ERROR_REFUTED
            and not any_angle_is_frozen
        )
        angle_explains_turning = angle_error_explains_turn_tests(monitor, i)
        may_be_only_this_angle = angle_error_explains_other_angle_tests(monitor, i) and (
            tests_exceeded_since_alarm[FIRST_ANGLE_TEST + i] == 1 or angle_explains_turning
        )
        angle_may_be_wrong = (
            may_be_only_this_angle
            and gyro_error_verdict_by_axis[axis_of_worst_turn_test(monitor, i)] != GYRO_ERROR_CONFIRMED
        )
        n_identical_samples = memory.n_identical_samples[PHI + i]
        min_frozen_samples = monitor.config.min_frozen_samples[PHI + i]
        # too early to say
        may_be_frozen = 0 < n_identical_samples < min_frozen_samples < UNREACHABLE_FROZEN_SAMPLES
        is_suspect[PHI + i] = angle_may_be_wrong or (angle_explains_turning and may_be_frozen)


@kernel
def angle_error_explains_other_angle_tests(monitor, angle_index):
    """Whether no test of another angle (0, 1, 2: phi, theta, psi) shows an error that one of this angle from
    the start does not explain."""
    for j in range(3):
        is_exceeded = (
            monitor.memory.tests_exceeded_since_alarm[FIRST_ANGLE_TEST + j]
            if angle_index == 2
            else monitor.initial_errors.refutations_by_hypothesis_and_test[
                PHI_HYPOTHESIS + angle_index, FIRST_ANGLE_TEST + j
            ]
        )
        if j != angle_index and is_exceeded:
            return False
    return True


@kernel
def update_turn_beyond_each_angle(monitor, readings):
    """Filter what the tests of turning show beyond an error of one angle, for each of phi, theta and psi.

    An error that changes by e within a sample moves the residual of its angle by e and that of body axis j by
    c_j e (body_turn_per_euler_angle). If this angle alone is wrong, r_j - c_j r_angle contains noise alone.
    """
    redundancy, memory = monitor.redundancy, monitor.memory
    for i in range(3):
        angle_residual = redundancy.test[FIRST_ANGLE_TEST + i].residual
        for m, decay in enumerate(redundancy.config.filter_decay_by_pole):
            memory.filtered_angle_residual_size[i, m] = decay * memory.filtered_angle_residual_size[
                i, m
            ] + abs(angle_residual)
        for j in range(3):
            turn_per_angle = body_turn_per_euler_angle(readings, j, i)
            memory.max_turn_per_angle[i, j] = max(memory.max_turn_per_angle[i, j], abs(turn_per_angle))
            turn_beyond_angle = (
                redundancy.test[FIRST_TURN_TEST + j].residual - turn_per_angle * angle_residual
            )
            for m, decay in enumerate(redundancy.config.filter_decay_by_pole):
                memory.filtered_turn_beyond_angle[i, j, m] = (
                    decay * memory.filtered_turn_beyond_angle[i, j, m] + turn_beyond_angle
                )


@kernel
def angle_error_explains_turn_tests(monitor, angle_index):
    """Whether an error of an angle (0, 1, 2: phi, theta, psi) explains the tests of the axes: one as large as
    the residual of the angle's own test allows now, or as its residuals since the alarm have shown."""
    memory = monitor.memory
    redundancy, angle_test = monitor.redundancy, monitor.redundancy.test[FIRST_ANGLE_TEST + angle_index]
    reading_error_bound = redundancy.memory.reading_error_bound
    tilt_error_bound = reading_error_bound[PHI] + reading_error_bound[THETA]
    for j in range(3):
        turn_test = redundancy.test[FIRST_TURN_TEST + j]
        turn_per_angle = body_turn_per_euler_angle(redundancy.memory.previous_reading, j, angle_index)
        max_turn_per_angle = abs(turn_per_angle) + tilt_error_bound
        for m in range(redundancy.config.filter_decay_by_pole.size):
            max_angle_error = abs(angle_test.filtered_residual[m]) + angle_test.filtered_bound[m]
            max_initial_error_effect = (
                max_error_effect_at_alarm(
                    monitor.initial_errors, PHI_HYPOTHESIS + angle_index, FIRST_TURN_TEST + j, m
                )
                if angle_index < 2
                else 0.0
            )
            max_sound_turn = turn_test.filtered_bound[m] + max_initial_error_effect
            max_turn_beyond_angle = (
                max_sound_turn
                + memory.max_turn_per_angle[angle_index, j] * angle_test.filtered_bound[m]
                + tilt_error_bound * memory.filtered_angle_residual_size[angle_index, m]
            )
            if (
                memory.tests_exceeded_since_alarm[FIRST_TURN_TEST + j]
                and abs(turn_test.filtered_residual[m])
                > max_turn_per_angle * max_angle_error + max_sound_turn
                and abs(memory.filtered_turn_beyond_angle[angle_index, j, m]) > max_turn_beyond_angle
            ):
                return False
    return True


@kernel
def axis_of_worst_turn_test(monitor, default_axis):
    """The body axis (0, 1, 2) whose test of turning has the largest ratio of residual to bound; default_axis
    if none is larger than its own."""
    axis, tests = default_axis, monitor.redundancy.test
    for j in range(3):
        if (
            tests[FIRST_TURN_TEST + j].residual_bound_ratio
            > tests[FIRST_TURN_TEST + axis].residual_bound_ratio
        ):
            axis = j
    return axis


@kernel
def allows_surface_isolation(monitor, surface_alarm_is_from_earlier_frame):
    """Whether a surface may be isolated; surface_alarm_is_from_earlier_frame: the alarm was a frame or more
    ago."""
    if not monitor.config.enabled:
        return True
    return (
        surface_alarm_is_from_earlier_frame == 1
        and (monitor.memory.gyros_excluded == 1 or not monitor.config.attitude_is_noisy)
        and not any_flow_sensor_is_frozen(monitor)
    )


@kernel
def surface_alarm_may_be_initial_sensor_error(monitor, detected_at_s):
    """Whether the alarm of the surfaces is so early that an error which a flow sensor has had from the start
    may have caused it: the design model uses its reading from the first frame on."""
    return monitor.config.enabled and detected_at_s < monitor.memory.started_at_s + INITIAL_ERROR_WINDOW_S


@kernel
def any_flow_sensor_is_frozen(monitor):
    """Whether a flow sensor is frozen: a surface that moves the aircraft moves its reading. In symmetric
    flight a sideslip of zero stays zero."""
    for i in (ALPHA, BETA, AIRSPEED, QDYN):
        if monitor.redundancy.memory.previous_reading[i] != 0.0 and is_frozen(monitor, i):
            return True
    return False


@kernel
def has_alarm(monitor):
    """Whether the monitor has raised its alarm: no surface is isolated then."""
    return monitor.config.enabled and monitor.output.alarmed


@kernel
def replace_isolated_and_missing_readings(monitor, prediction_record, measured):
    """Replace the readings of isolated or missing sensors by estimates from the others. Accelerometers are
    not replaced: then none of them is used."""
    readings, any_reading_replaced, slipstream_input_replaced = measured.signal, False, False
    for i in range(N_SENSORS):
        if measured.missing[i]:
            monitor.output.is_reading_unused[i] = 1
        if monitor.output.is_reading_unused[i] and i < AX:
            readings[i] = estimate_reading(monitor, prediction_record, readings, i)
            any_reading_replaced = True
            slipstream_input_replaced = slipstream_input_replaced or i in (
                AIRSPEED,
                QDYN,
                ENGINE_SPEED,
                MANIFOLD,
            )
    if any_reading_replaced:
        share_out(measured)
    if slipstream_input_replaced and monitor.config.has_engine_sensors:
        note_slipstream(measured)


@kernel
def estimate_reading(monitor, prediction_record, readings, sensor_index):
    """The estimate of a sensor's reading from the other sensors, in its unit."""
    memory = monitor.redundancy.memory
    if sensor_index < 3:
        return estimate_rate_and_mark_replaced(monitor, prediction_record, sensor_index)
    if sensor_index in (ALPHA, BETA):
        return memory.predicted_reading[
            sensor_index
        ] + monitor.redundancy.config.sample_time_s / VANE_ESTIMATE_RETURN_TO_TRIM_TIME_S * (
            monitor.config.trim_reading[sensor_index] - memory.predicted_reading[sensor_index]
        )
    previous_density = 2.0 * memory.previous_reading[QDYN] / memory.previous_reading[AIRSPEED] ** 2
    if sensor_index == AIRSPEED:
        return np.sqrt(max(2.0 * readings[QDYN] / previous_density, AIRSPEED_DIVISOR_FLOOR_MPS**2))
    if sensor_index == QDYN:
        return 0.5 * previous_density * readings[AIRSPEED] ** 2
    if sensor_index >= ENGINE_SPEED:
        return memory.commanded_engine_readings[sensor_index - ENGINE_SPEED]
    return memory.predicted_reading[sensor_index]


@kernel
def estimate_rate_and_mark_replaced(monitor, prediction_record, axis):
    """Body rate about an axis (0, 1, 2), rad/s: that of the attitude by the sample before, and the model's
    change since, with the surface faults that stay isolated.

    The rate itself is used for the next sample: its own error shows there.
    """
    config = monitor.redundancy.config
    memory = monitor.redundancy.memory
    test = monitor.redundancy.test[FIRST_TURN_TEST + axis]
    u = prediction_record.u_before if monitor.memory.substep == 0 else prediction_record.u
    predicted_acceleration = prediction_record.f[axis]
    for s in range(u.size):
        predicted_acceleration += prediction_record.G[axis, s] * u[s]
    if monitor.output.keeps_surface_conclusion:
        predicted_acceleration += (
            prediction_record.acceleration_with_known_faults[axis]
            - prediction_record.frame_means.predicted_acceleration[axis]
        )
    angle_correction_rad = monitor.config.replaced_rate_correction_share * test.residual
    if not monitor.memory.is_rate_replaced[axis] and monitor.config.replaced_rate_correction_share < 1.0:
        angle_correction_rad = (
            config.sample_time_s
            * FILTER_POLES_PER_S[INITIAL_RATE_ESTIMATE_POLE_INDEX]
            * test.filtered_residual[INITIAL_RATE_ESTIMATE_POLE_INDEX]
        )
    monitor.memory.is_rate_replaced[axis] = 1
    corrected_previous_rate = memory.previous_reading[axis] + angle_correction_rad / config.sample_time_s
    return corrected_previous_rate + config.sample_time_s * predicted_acceleration
