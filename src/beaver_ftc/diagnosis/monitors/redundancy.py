"""Redundancy tests: relations that sound sensors satisfy in any flight (kinematics, air data, engine).

    turning     attitude[k+1] = attitude[k] turned by h (p, q, r)[k]         in body axes, and angle by angle
    flow        v[k+1] = v[k] turned by -h (p, q, r), + h (force + gravity)  v from alpha, beta, airspeed
    density     2 qdyn / V^2 changes with height only
    climb       altitude[k+1] = altitude[k] + h (v upwards)
    engine      speed and manifold pressure are as commanded
    equal       a sensor that no equation uses, and the reading that its row says it should equal

h is the time between two samples, a JSBSim frame. The integration is that of JSBSim (rates held over the
step; velocity by Adams and Bashforth's second order), so that residuals of sound sensors contain only what is
left out here: the Earth turns and is round. Every residual passes filters of several poles, with a bound on
the effect of the declared errors of all sensors together, as in detection/filters.py. Declared turbulence
widens the bounds of flow and climb by the effect of its gusts within a filter's memory.

This file also has the records of the sensor monitor, their configuration, and its finding in words.
"""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design import LEAST_HEIGHT_M, Dryden
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA, acceleration_per_air_rotation
from beaver_ftc.diagnosis.detection.filters import advance_gyro_error_bound, advance_residual_bound
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    SENSORS,
    SIGNALS,
    wrapped,
)
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS, frames_apart, sensor_words

FIRST_TURN_TEST = 0
FIRST_ANGLE_TEST = 3
SPEED_TEST = 6
ALPHA_FLOW_TEST = 7
BETA_FLOW_TEST = 8
DENSITY_TEST = 9
CLIMB_TEST = 10
RPM_TEST = 11
MANIFOLD_PRESSURE_TEST = 12
N_TESTS_WITH_EQUATION = 13  # tests with an equation; then those of sensors that should equal another reading
DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE = tuple(
    (SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None
)
N_TESTS = N_TESTS_WITH_EQUATION + len(DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE)
# The test in which a jump of a reading appears at once, as the rows of the sensors name it.
TEST_INDEX_BY_NAME = {
    "roll": FIRST_TURN_TEST, "pitch": FIRST_TURN_TEST + 1, "yaw": FIRST_TURN_TEST + 2,
    "bank angle": FIRST_ANGLE_TEST, "pitch angle": FIRST_ANGLE_TEST + 1, "heading": FIRST_ANGLE_TEST + 2,
    "speed": SPEED_TEST, "incidence": ALPHA_FLOW_TEST, "sideslip": BETA_FLOW_TEST, "density": DENSITY_TEST,
    "climb": CLIMB_TEST, "engine speed": RPM_TEST, "manifold pressure": MANIFOLD_PRESSURE_TEST,
}  # fmt: skip
# Of each sensor that should equal another reading (its row in scenario/sensors.py says which): its place in
# the readings, the place of that reading, the test that an error of that reading exceeds, and the largest
# difference of the two quantities, SI.
DUPLICATE_SENSOR_INDEX = np.array([i for i, _ in DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE], np.int64)
DUPLICATED_READING_INDEX = np.array(
    [
        SENSORS.index(counterpart_and_tolerance.reading)
        for _, counterpart_and_tolerance in DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE
    ],
    np.int64,
)
DUPLICATED_READING_TEST_INDEX = np.array(
    [
        TEST_INDEX_BY_NAME[ROWS[SENSORS.index(counterpart_and_tolerance.reading)].test]
        for _, counterpart_and_tolerance in DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE
    ],
    np.int64,
)
DUPLICATE_TOLERANCE = np.array(
    [
        counterpart_and_tolerance.within
        for _, counterpart_and_tolerance in DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE
    ],
    float,
)
FILTER_POLES_PER_S = (1e6, 10.0, 1.0)  # of the filters of each test; the first is the residual itself
N_POLES = len(FILTER_POLES_PER_S)
NO_SENSOR = -1
MIN_FAULTY_FORCE_JUMP_M_S2 = 8.0  # a sound specific force changes by less from one sample to the next
GYRO_ERROR_UNDECIDED, GYRO_ERROR_CONFIRMED, GYRO_ERROR_REFUTED = 0, 1, 2  # of `gyro_error_verdict_by_axis`
MAX_AIRSPEED_OVER_TRIM = 1.4  # largest airspeed of a flight, as a share of that in trim
# at which the attitude corrects a replaced rate, if its noise is declared
REPLACED_RATE_CORRECTION_PER_S = 3.0
# Number of samples of a sensor that are never identical without resolution
MIN_FROZEN_SAMPLES_WITHOUT_ROUNDING = 3
MIN_FROZEN_NOISY_ROUNDED_SAMPLES = 50  # the same with noise of more than a quarter of the resolution
UNREACHABLE_FROZEN_SAMPLES = (
    1_000_000_000  # JSBSim frames: a sound reading may repeat, if its steps exceed its noise
)
UNANTICIPATED_VERDICT_DELAY_S = (
    1.0  # from the alarm; a sensor not isolated by then makes the fault unanticipated
)
P, Q, R, ALPHA, BETA, AIRSPEED, QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2

# Hypotheses of initial_errors.py: this sensor has been broken since the monitor began
ALPHA_HYPOTHESIS, BETA_HYPOTHESIS, AIRSPEED_HYPOTHESIS, PHI_HYPOTHESIS, THETA_HYPOTHESIS = range(5)
N_INITIAL_ERROR_HYPOTHESES, N_SIGNED_INITIAL_ERROR_EFFECTS = 5, 14

# One test; units: of the residual. bound_per_s, bound_per_sample: parts of the bound on the residual of one
# sample, the first for each second of it. residual_per_gust_speed_change: effect on the residual of 1 m/s
# that a gust changes by. filtered_bound: on filtered_residual; filtered_bound_per_s_part,
# filtered_bound_per_sample_part: its parts. residual_bound_ratio: largest |filtered_residual| /
# filtered_bound over the poles.
TEST_RECORD = record(
    residual=float, bound_per_s=float, bound_per_sample=float, previous_bound_per_sample=float,
    residual_per_gust_speed_change=float, filtered_bound=N_POLES,
    filtered_residual=N_POLES, filtered_bound_per_s_part=N_POLES, filtered_bound_per_sample_part=N_POLES,
    residual_bound_ratio=float,
)  # fmt: skip

REDUNDANCY_RECORD = record(
    config=record(
        sample_time_s=float, filter_decay_by_pole=N_POLES, gravity_m_s2=float,
        # Declared turbulence: bound on a gust's speed; bound on its changes through each filter, which holds
        # up to max_airspeed_mps, and above low_altitude_limit_m: below it a gust changes faster
        max_gust_speed_mps=float, gust_change_bound_mps=N_POLES, max_airspeed_mps=float,
        low_altitude_limit_m=float, max_vertical_wind_mps=float,
        # Declared errors of a reading z, SI: |error| <= error_bound_at_zero_reading +
        # error_bound_per_unit_reading |z|, of which constant_error_bound does not change
        error_bound_at_zero_reading=N_SENSORS, error_bound_per_unit_reading=N_SENSORS,
        constant_error_bound=N_SENSORS, attitude_drift_rad_s=float,
    ),
    memory=record(
        # bounds on the error of each reading in this sample, and on the part of it that changes
        reading_error_bound=N_SENSORS, changing_reading_error_bound=N_SENSORS,
        attitude_drift_bound_rad=float, previous_error_bound=N_SENSORS, error_bound_two_samples_ago=N_SENSORS,
        # the sample before: readings; attitude; velocity m/s and acceleration m/s2, gravity included, in body
        # axes; and the acceleration of the sample before that. advance_motion_and_predict_readings advances
        # the last two vectors
        previous_reading=N_SENSORS, previous_quaternion=4, body_velocity=3, body_acceleration=3,
        previous_body_acceleration=3,
        # m/s2: in the elapsed step, in the two steps before it; of previous_body_acceleration
        acceleration_magnitude=float, earlier_acceleration_magnitudes=2,
        previous_acceleration_magnitude=float,
        first_acceleration_error_bound=float,  # m/s2, in the first step only: no sample precedes it
        predicted_reading=N_SENSORS, scratch=4, predicted_quaternion=4,
        commanded_engine_readings=2,  # engine speed rpm, manifold pressure inHg
    ),
    test=(TEST_RECORD, N_TESTS),
)  # fmt: skip

INITIAL_ERRORS_RECORD = record(
    # of each hypothesis, bounds on the sensor's error: at the first sample, now, at the alarm; and on the
    # change of the error since. Units: see initial_errors.py
    error_bound_at_start=N_INITIAL_ERROR_HYPOTHESES, error_bound=N_INITIAL_ERROR_HYPOTHESES,
    error_bound_at_alarm=N_INITIAL_ERROR_HYPOTHESES, error_change_bound=N_INITIAL_ERROR_HYPOTHESES,
    # bound on the effect of a unit of the error on a residual: in one sample, and through the filters
    max_effect_per_unit_error=(N_INITIAL_ERROR_HYPOTHESES, RPM_TEST),
    filtered_max_effect_per_unit_error=(N_INITIAL_ERROR_HYPOTHESES, RPM_TEST, N_POLES),
    # effects of a unit with their sign
    signed_effect_per_unit_error=N_SIGNED_INITIAL_ERROR_EFFECTS,
    filtered_signed_effect_per_unit_error=(N_SIGNED_INITIAL_ERROR_EFFECTS, N_POLES),
    refutations_by_hypothesis_and_test=(int, N_INITIAL_ERROR_HYPOTHESES, N_TESTS),  # since the alarm
)  # fmt: skip

MONITOR_CONFIG_RECORD = record(
    enabled=int, substeps=int, has_engine_sensors=int, trim_reading=N_SENSORS,
    replaced_rate_correction_share=float,  # share of its error that a replaced rate corrects in one sample
    attitude_is_noisy=int,  # then a surface is isolated only once no gyro can be the cause
    min_frozen_samples=(int, N_SENSORS),  # number of identical samples from which a reading counts as frozen
    rate_damping_per_s=(3, 3),  # D: body rates decay with rate' = -D rate
)  # fmt: skip

MONITOR_MEMORY_RECORD = record(
    start_stage=int, started_at_s=float, substep=int, tests_exceeded_since_alarm=(int, N_TESTS),
    # since the alarm, rad: by angle, body axis and pole, filtered residual of turning beyond the part of the
    # angle's own residual; by angle and pole, filtered size of the angle's residual; by angle and body axis,
    # largest size of body_turn_per_euler_angle
    filtered_turn_beyond_angle=(3, 3, N_POLES), filtered_angle_residual_size=(3, N_POLES),
    max_turn_per_angle=(3, 3),
    # by axis, rad/s: error of the gyro if the attitude is right, as this frame and the one before began; its
    # largest size in the other samples of this frame, of the one before, of the one before that; its smallest
    # size there, of this frame and the one before
    apparent_gyro_error=3, previous_apparent_gyro_error=3,
    substep_gyro_error_peak=3, previous_substep_gyro_error_peak=3, earlier_substep_gyro_error_peak=3,
    substep_gyro_error_floor=3, previous_substep_gyro_error_floor=3,
    # W of sensor_monitor.py, rad/s, by axis: the gyro's error if the dynamics are right; and its bound
    gyro_error_estimate=3, sound_gyro_estimate_bound=3, previous_sound_gyro_estimate_bound=3,
    previous_gyro_error_estimate=3,
    # a sensor with the reading that it should equal
    has_duplicate_agreed=(int, max(len(DUPLICATE_INDEX_COUNTERPART_AND_TOLERANCE), 1)),
    # by axis and pole, rad: filtered difference of the turn that the attitude and W show, and its bound;
    # beyond it no gyro can be broken
    gyros_excluded=int, filtered_turn_difference=(3, N_POLES), filtered_turn_difference_bound=(3, N_POLES),
    gyro_error_verdict_by_axis=(int, 3), is_rate_replaced=(int, 3),
    n_identical_samples=(int, N_SENSORS), reading_two_samples_ago=N_SENSORS, is_cleared=(int, N_SENSORS),
    fading_max_accelerometer_jump=float,  # m/s2, which fades
    # since the alarm, of speed, incidence, sideslip: number of samples; sums of the residuals, of the part of
    # sound sensors, of the part of an initial error; range of the readings
    n_samples_since_alarm=int, flow_residual_sum_since_alarm=3, flow_bound_sum_since_alarm=3,
    initial_error_effect_sum_since_alarm=3, min_flow_reading_since_alarm=3,
    max_flow_reading_since_alarm=3,
    filtered_climb_error_m=N_POLES,  # of an incidence with the error that its residuals show
    spurious_velocity=3,  # m/s, body axes: what the residuals add up to
)  # fmt: skip

MONITOR_OUTPUT_RECORD = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface_conclusion=int,  # a surface was found long before, with sound sensors: it stays found
    surface_was_isolated_at_alarm=int,  # a surface had been isolated just before the alarm
    alarm_test_index=int,  # index of the test that has raised the alarm
    # test with the largest residual_bound_ratio of this frame, and that ratio
    worst_test_index=int, worst_residual_bound_ratio=float,
    is_suspect=(int, N_SENSORS), isolated_sensor=int, isolated_at_s=float, is_reading_unused=(int, N_SENSORS),
)  # fmt: skip

SENSOR_MONITOR_RECORD = record(
    config=MONITOR_CONFIG_RECORD,
    memory=MONITOR_MEMORY_RECORD,
    output=MONITOR_OUTPUT_RECORD,
    redundancy=REDUNDANCY_RECORD,
    initial_errors=INITIAL_ERRORS_RECORD,
)


def configure_sensor_monitor(
    monitor: np.void, declared: Declared, design_model_record: np.void, y: np.ndarray
) -> None:
    """Fill the monitor's record at the trim: y, the measured signals there; design_model_record: of the
    designer.

    A monitor that is not declared has found nothing, and its record holds no more than that.
    """
    output, config = monitor["output"], monitor["config"]
    output["isolated_sensor"], output["alarmed_at_s"], output["isolated_at_s"] = NO_SENSOR, -1.0, -1.0
    config["enabled"] = declared.monitors_sensors
    if not declared.monitors_sensors:
        return
    initial_state = cast("Any", declared.initial)  # whose keys the aircraft names
    config["substeps"], config["has_engine_sensors"] = (
        declared.substeps,
        declared.aircraft.has_engine_instruments,
    )
    config["trim_reading"][3:7] = y[:4]
    config["rate_damping_per_s"] = acceleration_per_air_rotation(
        DesignFunctions(np.array([design_model_record])), y
    )
    monitor["memory"]["substep"] = declared.substeps - 1  # the first JSBSim frame ends a frame of the loop
    if config["has_engine_sensors"]:
        monitor["redundancy"]["memory"]["commanded_engine_readings"] = (
            initial_state.engine_rpm,
            initial_state.manifold_pressure_inhg,
        )
    configure_redundancy_tests(monitor["redundancy"]["config"], declared)
    configure_error_bounds_and_frozen_limits(
        monitor, declared, monitor["redundancy"]["config"]["sample_time_s"]
    )


def configure_redundancy_tests(config: np.void, declared: Declared) -> None:
    """Fill the constants of the equations of motion and of the gusts; a sample is a JSBSim frame."""
    initial_state, sample_time_s = declared.initial, 1.0 / declared.rate_hz / declared.substeps
    config["sample_time_s"] = sample_time_s
    config["filter_decay_by_pole"] = [exp(-pole * sample_time_s) for pole in FILTER_POLES_PER_S]
    config["gravity_m_s2"] = GRAVITY_MPS2 * (1.0 + initial_state.altitude_m / EARTH_RADIUS_M) ** -2
    config["max_gust_speed_mps"], config["gust_change_bound_mps"] = gust_speed_and_filtered_change_bounds(
        declared.air, initial_state.airspeed_mps, sample_time_s
    )
    config["max_airspeed_mps"] = MAX_AIRSPEED_OVER_TRIM * initial_state.airspeed_mps
    config["low_altitude_limit_m"] = declared.air.low_m
    config["max_vertical_wind_mps"] = declared.vertical_wind_mps


def configure_error_bounds_and_frozen_limits(
    monitor: np.void, declared: Declared, sample_time_s: float
) -> None:
    """Fill the declared errors of the readings, and from how many identical samples each is frozen; a sample
    is a JSBSim frame."""
    redundancy_config = monitor["redundancy"]["config"]
    monitor_config = monitor["config"]
    sensor_errors = declared.sensors
    for i, name in enumerate(SENSORS):
        sensor_error = sensor_errors[name]
        (
            redundancy_config["error_bound_at_zero_reading"][i],
            redundancy_config["error_bound_per_unit_reading"][i],
            redundancy_config["constant_error_bound"][i],
        ) = (
            sensor_error.worst,
            sensor_error.slope,
            sensor_error.steady,
        )
        monitor_config["min_frozen_samples"][i] = min_frozen_samples(
            sensor_error.noise, sensor_error.resolution
        ) * frames_apart(i, sample_time_s)
        drift_rad_s = getattr(getattr(sensor_errors.declared, name), "drift_rad_s", 0.0)
        redundancy_config["attitude_drift_rad_s"] = max(
            redundancy_config["attitude_drift_rad_s"], abs(drift_rad_s)
        )
    attitude_indices = slice(PHI, PHI + 3)
    monitor_config["attitude_is_noisy"] = np.any(
        redundancy_config["error_bound_at_zero_reading"][attitude_indices]
        > redundancy_config["constant_error_bound"][attitude_indices]
    )
    monitor_config["replaced_rate_correction_share"] = (
        min(1.0, sample_time_s * REPLACED_RATE_CORRECTION_PER_S)
        if monitor_config["attitude_is_noisy"]
        else 1.0
    )


def min_frozen_samples(noise_std: float, resolution: float) -> int:
    """Number of identical samples that a sound sensor of this noise and resolution does not give."""
    if resolution == 0.0:
        return MIN_FROZEN_SAMPLES_WITHOUT_ROUNDING
    return MIN_FROZEN_NOISY_ROUNDED_SAMPLES if noise_std > resolution / 4.0 else UNREACHABLE_FROZEN_SAMPLES


def gust_speed_and_filtered_change_bounds(
    turbulence: Dryden, trim_airspeed_mps: float, sample_time_s: float
) -> tuple[float, np.ndarray]:
    """Bounds on the speed of gusts, m/s, and on their changes through each filter (poles,), m/s.

    The speed of a gust changes like a random walk (`Dryden.velocity_walk`); a filter with a pole of lam 1/s
    keeps 1 / 2 lam of its intensity.
    """
    sigma_mps = turbulence.sigma_mps
    velocity_walk_intensity = turbulence.velocity_walk(trim_airspeed_mps, MAX_AIRSPEED_OVER_TRIM)
    variances_per_intensity_s = [
        sample_time_s / (1.0 - exp(-2.0 * pole * sample_time_s)) for pole in FILTER_POLES_PER_S
    ]
    return GUST_LIMIT_SIGMA * sigma_mps, GUST_LIMIT_SIGMA * np.sqrt(
        velocity_walk_intensity * np.array(variances_per_intensity_s)
    )


def sensor_monitor_finding(monitor: np.void, t_s: float) -> dict[str, Any] | None:
    """The verdict's parts as of t_s, where a sensor is found broken; None where none is."""
    output = monitor["output"]
    if not output["alarmed"]:
        return None
    finding: dict[str, Any] = {
        "isolated": None, "isolation_type": None, "estimate": None, "candidates": (),
        "detection_time_s": float(output["alarmed_at_s"]), "isolation_time_s": None,
    }  # fmt: skip
    if output["isolated_sensor"] >= 0:
        finding["isolated"] = sensor_words(SENSORS[int(output["isolated_sensor"])])
        finding["isolation_time_s"] = float(output["isolated_at_s"])
    elif t_s > finding["detection_time_s"] + UNANTICIPATED_VERDICT_DELAY_S:
        finding["isolated"] = finding["isolation_type"] = "unanticipated"
        finding["isolation_time_s"] = finding["detection_time_s"] + UNANTICIPATED_VERDICT_DELAY_S
    else:
        sensor_names_and_suspicions = zip(SENSORS, output["is_suspect"], strict=True)
        finding["candidates"] = tuple(
            sensor_words(name) for name, is_suspected in sensor_names_and_suspicions if is_suspected
        )
    return finding


# The rates are against the rotating Earth; the level turns as the aircraft flies over the round Earth.
EARTH_RATE_BOUND_RAD_S = 4e-5
EARTH_ACCELERATION_BOUND_M_S2 = 0.03  # Coriolis, centrifugal, and gravity's change with place
DENSITY_SCALE_HEIGHT_M = 6300.0  # over which the density falls by a factor e at most: in the stratosphere
MAX_PITCH_RAD = 1.3  # beyond it, roll and heading cannot be distinguished: the attitude tests restart
AIRSPEED_DIVISOR_FLOOR_MPS = 1.0  # at least so much where an airspeed divides
DYNAMIC_PRESSURE_DIVISOR_FLOOR_PA = 1.0  # the same of the dynamic pressure
MIN_QDYN_PER_AIRSPEED_SQUARED = 1e-9  # kg/m3, of which the logarithm is taken: far below half a density
MIN_PREDICTED_SPEED_MPS = 1e-3  # at least so much where a predicted speed divides
# of a reading that its constant error leaves, at least, under a logarithm
MIN_READING_SHARE_LEFT_BY_ERROR = 0.01
READING_ROUNDING_SHARE = 1e-10  # of a reading: the part of each bound that covers rounding
COMPARISON_ROUNDING = 1e-6  # in the unit of the reading: the same where two readings are compared directly
# JSBSim integrates the velocity by Adams and Bashforth's second order, v + h (3/2 a - 1/2 a_before).
ADAMS_BASHFORTH_WEIGHT, ADAMS_BASHFORTH_SUBTRACTED_WEIGHT = 1.5, 0.5
# It integrates the position by their third order, h (23 v - 16 v_before + 5 v_earlier) / 12. That differs
# from h v, which predicts the altitude, by at most h^2 (11 + 5) / 12 of the largest acceleration.
POSITION_INTEGRATION_ERROR_FACTOR = 4.0 / 3.0


@kernel
def fill_quaternion(phi, theta, psi, out):
    """Fill out (4,): the rotation from body to level axes, scalar first; Euler angles rad."""
    cos_half_phi, cos_half_theta, cos_half_psi = np.cos(phi / 2), np.cos(theta / 2), np.cos(psi / 2)
    sin_half_phi, sin_half_theta, sin_half_psi = np.sin(phi / 2), np.sin(theta / 2), np.sin(psi / 2)
    out[0] = cos_half_phi * cos_half_theta * cos_half_psi + sin_half_phi * sin_half_theta * sin_half_psi
    out[1] = sin_half_phi * cos_half_theta * cos_half_psi - cos_half_phi * sin_half_theta * sin_half_psi
    out[2] = cos_half_phi * sin_half_theta * cos_half_psi + sin_half_phi * cos_half_theta * sin_half_psi
    out[3] = cos_half_phi * cos_half_theta * sin_half_psi - sin_half_phi * sin_half_theta * cos_half_psi


@kernel
def fill_advanced_quaternion(previous_quaternion, rates, duration_s, out):
    """Fill out (4,): the previous unit quaternion (4,) after duration_s at body rates (3,) rad/s: one Euler
    step."""
    half_angle_x = 0.5 * duration_s * rates[0]
    half_angle_y = 0.5 * duration_s * rates[1]
    half_angle_z = 0.5 * duration_s * rates[2]
    q = previous_quaternion
    length_after_step = np.sqrt(
        1.0 + half_angle_x * half_angle_x + half_angle_y * half_angle_y + half_angle_z * half_angle_z
    )
    out[0] = (q[0] - q[1] * half_angle_x - q[2] * half_angle_y - q[3] * half_angle_z) / length_after_step
    out[1] = (q[1] + q[0] * half_angle_x + q[2] * half_angle_z - q[3] * half_angle_y) / length_after_step
    out[2] = (q[2] + q[0] * half_angle_y + q[3] * half_angle_x - q[1] * half_angle_z) / length_after_step
    out[3] = (q[3] + q[0] * half_angle_z + q[1] * half_angle_y - q[2] * half_angle_x) / length_after_step


@kernel
def small_rotation_angle(from_quaternion, to_quaternion, quaternion_component):
    """Component (1, 2, 3) in body axes of the small rotation from one attitude (4,) to the other, rad."""
    q_from = from_quaternion
    q_to = to_quaternion
    i = quaternion_component
    j = quaternion_component % 3 + 1
    k = (quaternion_component + 1) % 3 + 1
    half_angle = q_from[0] * q_to[i] - q_from[i] * q_to[0] - q_from[j] * q_to[k] + q_from[k] * q_to[j]
    scalar_part = q_from[0] * q_to[0] + q_from[1] * q_to[1] + q_from[2] * q_to[2] + q_from[3] * q_to[3]
    return 2.0 * half_angle if scalar_part >= 0.0 else -2.0 * half_angle


@kernel
def body_turn_per_euler_angle(readings, axis, angle_index):
    """Rotation about a body axis (0, 1, 2) for a change of phi, theta or psi (angle_index 0, 1, 2), rad/rad,
    at the attitude of the readings (N_SENSORS,)."""
    phi, theta = readings[PHI], readings[THETA]
    if axis == 0:
        return (1.0, 0.0, -np.sin(theta))[angle_index]
    if axis == 1:
        return (0.0, np.cos(phi), np.sin(phi) * np.cos(theta))[angle_index]
    return (0.0, -np.sin(phi), np.cos(phi) * np.cos(theta))[angle_index]


@kernel
def fill_vector_in_turned_axes(rates, duration_s, vector_before_turn, out):
    """Fill out (3,): the components of a constant vector (3,) in body axes that have turned at rates (3,)
    rad/s for duration_s."""
    total_rate = np.sqrt(rates[0] ** 2 + rates[1] ** 2 + rates[2] ** 2)
    turn_angle = 2.0 * np.arctan(0.5 * duration_s * total_rate)
    sine_per_rate = np.sin(turn_angle) / total_rate if total_rate > 0.0 else 0.0
    versine_per_rate_squared = (1.0 - np.cos(turn_angle)) / total_rate**2 if total_rate > 0.0 else 0.0
    rates_dot_vector = (
        rates[0] * vector_before_turn[0] + rates[1] * vector_before_turn[1] + rates[2] * vector_before_turn[2]
    )
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rates_cross_vector = rates[j] * vector_before_turn[k] - rates[k] * vector_before_turn[j]
        out[i] = (
            vector_before_turn[i]
            - sine_per_rate * rates_cross_vector
            + versine_per_rate_squared * (rates[i] * rates_dot_vector - total_rate**2 * vector_before_turn[i])
        )


@kernel
def fill_reading_error_bounds(redundancy, readings):
    """Fill the bounds on the error of each of the readings (N_SENSORS,), and on the part that changes."""
    config, memory = redundancy.config, redundancy.memory
    for i in range(N_SENSORS):
        reading_magnitude = abs(wrapped(readings[i])) if i == PSI else abs(readings[i])
        total_error_bound = (
            config.error_bound_at_zero_reading[i] + config.error_bound_per_unit_reading[i] * reading_magnitude
        ) / (1.0 - config.error_bound_per_unit_reading[i])
        memory.reading_error_bound[i] = total_error_bound
        memory.changing_reading_error_bound[i] = (
            total_error_bound - config.constant_error_bound[i] + READING_ROUNDING_SHARE * abs(readings[i])
        )
    for i in range(PHI, PHI + 3):
        memory.reading_error_bound[i] += memory.attitude_drift_bound_rad


@kernel
def store_sample_as_previous(redundancy, readings, specific_force):
    """Store this sample for the next one; readings (N_SENSORS,) SI, specific_force (3,) m/s2."""
    memory, gravity_m_s2 = redundancy.memory, redundancy.config.gravity_m_s2
    memory.previous_reading[:], memory.error_bound_two_samples_ago[:] = readings, memory.previous_error_bound
    memory.previous_error_bound[:] = memory.reading_error_bound
    fill_quaternion(readings[PHI], readings[THETA], readings[PSI], memory.previous_quaternion)
    alpha, beta, V = readings[ALPHA], readings[BETA], readings[AIRSPEED]
    memory.body_velocity[0] = V * np.cos(alpha) * np.cos(beta)
    memory.body_velocity[1], memory.body_velocity[2] = V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    theta, phi = readings[THETA], readings[PHI]
    memory.body_acceleration[0] = specific_force[0] - gravity_m_s2 * np.sin(theta)
    memory.body_acceleration[1] = specific_force[1] + gravity_m_s2 * np.cos(theta) * np.sin(phi)
    memory.body_acceleration[2] = specific_force[2] + gravity_m_s2 * np.cos(theta) * np.cos(phi)


@kernel
def vector_length(vector):
    """The length of a vector (3,)."""
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel
def advance_motion_and_predict_readings(redundancy):
    """Fill predicted_reading (N_SENSORS,): attitude, flow and altitude now, from the sample before.

    Afterwards body_velocity is the predicted one, and previous_body_acceleration that of the sample before in
    the present body axes.
    """
    memory, h = redundancy.memory, redundancy.config.sample_time_s
    previous_rates = memory.previous_reading[:3]
    predicted_reading = memory.predicted_reading
    scratch_vector = memory.scratch[:3]
    fill_advanced_quaternion(memory.previous_quaternion, previous_rates, h, memory.predicted_quaternion)
    q0 = memory.predicted_quaternion[0]
    q1 = memory.predicted_quaternion[1]
    q2 = memory.predicted_quaternion[2]
    q3 = memory.predicted_quaternion[3]
    predicted_reading[PHI] = np.arctan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    predicted_reading[THETA] = np.arcsin(min(max(2.0 * (q0 * q2 - q1 * q3), -1.0), 1.0))
    predicted_reading[PSI] = np.arctan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    previous_theta = memory.previous_reading[THETA]
    previous_phi = memory.previous_reading[PHI]
    body_velocity = memory.body_velocity
    climb_rate = (
        body_velocity[0] * np.sin(previous_theta)
        - body_velocity[1] * np.sin(previous_phi) * np.cos(previous_theta)
        - body_velocity[2] * np.cos(previous_phi) * np.cos(previous_theta)
    )
    predicted_reading[ALTITUDE] = memory.previous_reading[ALTITUDE] + h * climb_rate
    memory.earlier_acceleration_magnitudes[1], memory.earlier_acceleration_magnitudes[0] = (
        memory.earlier_acceleration_magnitudes[0],
        memory.acceleration_magnitude,
    )
    memory.previous_acceleration_magnitude = vector_length(memory.previous_body_acceleration)
    for i in range(3):
        scratch_vector[i] = (
            ADAMS_BASHFORTH_WEIGHT * memory.body_acceleration[i]
            - ADAMS_BASHFORTH_SUBTRACTED_WEIGHT * memory.previous_body_acceleration[i]
        )
    memory.acceleration_magnitude = vector_length(scratch_vector)
    for i in range(3):
        scratch_vector[i] = body_velocity[i] + h * scratch_vector[i]
    fill_vector_in_turned_axes(previous_rates, h, scratch_vector, body_velocity)
    fill_vector_in_turned_axes(previous_rates, h, memory.body_acceleration, memory.previous_body_acceleration)
    predicted_speed = vector_length(body_velocity)
    predicted_reading[AIRSPEED] = predicted_speed
    predicted_reading[ALPHA] = np.arctan2(body_velocity[2], body_velocity[0])
    predicted_reading[BETA] = np.arcsin(body_velocity[1] / max(predicted_speed, MIN_PREDICTED_SPEED_MPS))


@kernel
def fill_residuals(redundancy, readings):
    """Fill the residual of each test: readings (N_SENSORS,) minus their prediction."""
    tests, memory, predicted_reading = redundancy.test, redundancy.memory, redundancy.memory.predicted_reading
    fill_quaternion(readings[PHI], readings[THETA], readings[PSI], memory.scratch)
    for i in range(3):
        tests[FIRST_TURN_TEST + i].residual = small_rotation_angle(
            memory.predicted_quaternion, memory.scratch, i + 1
        )
        tests[FIRST_ANGLE_TEST + i].residual = wrapped(readings[PHI + i] - predicted_reading[PHI + i])
    tests[SPEED_TEST].residual = readings[AIRSPEED] - predicted_reading[AIRSPEED]
    tests[ALPHA_FLOW_TEST].residual = readings[ALPHA] - predicted_reading[ALPHA]
    tests[BETA_FLOW_TEST].residual = readings[BETA] - predicted_reading[BETA]
    half_density = readings[QDYN] / readings[AIRSPEED] ** 2
    previous_half_density = memory.previous_reading[QDYN] / memory.previous_reading[AIRSPEED] ** 2
    tests[DENSITY_TEST].residual = np.log(
        max(half_density, MIN_QDYN_PER_AIRSPEED_SQUARED)
        / max(previous_half_density, MIN_QDYN_PER_AIRSPEED_SQUARED)
    )
    tests[CLIMB_TEST].residual = readings[ALTITUDE] - predicted_reading[ALTITUDE]


@kernel
def max_pitch_angle(redundancy, readings):
    """Bound |theta| in this sample and the one before, rad, by readings and their errors."""
    memory = redundancy.memory
    return max(
        abs(readings[THETA]) + memory.reading_error_bound[THETA],
        abs(memory.previous_reading[THETA]) + memory.previous_error_bound[THETA],
    )


@kernel
def pitch_is_too_steep(redundancy, readings):
    """Whether the tests of turning and of the angles restart, in this sample and the one before."""
    return max_pitch_angle(redundancy, readings) > MAX_PITCH_RAD


@kernel
def extrapolated_error_bound(redundancy, sensor_index):
    """Bound the error of 3/2 a - 1/2 a_before by the errors of the reading of a sensor in the two samples. A
    constant error counts once."""
    return (
        ADAMS_BASHFORTH_WEIGHT * redundancy.memory.previous_error_bound[sensor_index]
        + ADAMS_BASHFORTH_SUBTRACTED_WEIGHT * redundancy.memory.error_bound_two_samples_ago[sensor_index]
        - redundancy.config.constant_error_bound[sensor_index]
    )


@kernel
def acceleration_error_bound(redundancy, max_turn_rate, gyro_error_bound_sum):
    """Bound the error of the acceleration of the elapsed step, m/s2.

    Its parts: errors of the accelerometers; gravity in the direction that the attitude gives it; turning the
    previous acceleration into the present axes. max_turn_rate, gyro_error_bound_sum, rad/s: see
    bound_residuals.
    """
    config, memory = redundancy.config, redundancy.memory
    tilt_error_bound = extrapolated_error_bound(redundancy, PHI) + extrapolated_error_bound(redundancy, THETA)
    gravity_m_s2 = config.gravity_m_s2
    squared_force_error_bound_sum = 0.0
    constant_acceleration_error_bound = gravity_m_s2 * (
        config.constant_error_bound[PHI] + config.constant_error_bound[THETA]
    )
    for i in range(AX, AX + 3):
        squared_force_error_bound_sum += extrapolated_error_bound(redundancy, i) ** 2
        constant_acceleration_error_bound += config.constant_error_bound[i]
    axis_turning_error_bound = config.sample_time_s * (
        max_turn_rate * constant_acceleration_error_bound
        + ADAMS_BASHFORTH_SUBTRACTED_WEIGHT * gyro_error_bound_sum * memory.previous_acceleration_magnitude
    )
    return (
        EARTH_ACCELERATION_BOUND_M_S2
        + memory.first_acceleration_error_bound
        + gravity_m_s2 * tilt_error_bound
        + np.sqrt(squared_force_error_bound_sum)
        + axis_turning_error_bound
    )


@kernel
def bound_attitude_tests(redundancy, readings, max_turn_rate, gyro_error_bound_sum):
    """Fill the bounds of `bound_residuals` for the tests of the attitude.

    A constant error of the attitude turns with the aircraft: in the rates J(phi, theta) (phi', theta', psi')
    it changes J. A momentary error turns an axis when it begins, and back when it ends with another J.
    """
    tests, config, memory = redundancy.test, redundancy.config, redundancy.memory
    previous_error_bound = memory.previous_error_bound
    changing_error_bound = memory.changing_reading_error_bound
    max_pitch_secant = 1.0 / np.cos(min(max_pitch_angle(redundancy, readings), MAX_PITCH_RAD))
    attitude_error_bound_sum = (
        previous_error_bound[PHI] + previous_error_bound[THETA] + previous_error_bound[PSI]
    )
    max_turn_angle = config.sample_time_s * max_turn_rate
    tilt_reading_change = abs(readings[PHI] - memory.previous_reading[PHI]) + abs(
        readings[THETA] - memory.previous_reading[THETA]
    )
    momentary_theta_and_psi_error_bound = (
        previous_error_bound[THETA]
        - config.constant_error_bound[THETA]
        + previous_error_bound[PSI]
        - config.constant_error_bound[PSI]
        + changing_error_bound[THETA]
        + changing_error_bound[PSI]
    )
    for i in range(3):
        rate_error_bound_from_attitude_error = (
            max_turn_rate * (attitude_error_bound_sum + max_pitch_secant * previous_error_bound[THETA])
            + tilt_reading_change * momentary_theta_and_psi_error_bound / config.sample_time_s
        )
        tests[FIRST_TURN_TEST + i].bound_per_s = (
            EARTH_RATE_BOUND_RAD_S
            + 2.0 * config.attitude_drift_rad_s
            + previous_error_bound[P + i]
            + max_turn_angle * gyro_error_bound_sum
            + rate_error_bound_from_attitude_error
        )
        rate_error_bound_from_attitude_error = (
            2.0 * max_pitch_secant * max_turn_rate * (previous_error_bound[PHI] + previous_error_bound[THETA])
        )
        total_rate_error_bound = (
            EARTH_RATE_BOUND_RAD_S
            + (1.0 + max_pitch_secant * max_turn_angle) * gyro_error_bound_sum
            + rate_error_bound_from_attitude_error
        )
        tests[FIRST_ANGLE_TEST + i].bound_per_s, tests[FIRST_ANGLE_TEST + i].bound_per_sample = (
            max_pitch_secant * total_rate_error_bound + config.attitude_drift_rad_s,
            changing_error_bound[PHI + i],
        )
    max_sin_theta = abs(np.sin(readings[THETA])) + changing_error_bound[THETA]
    max_sin_phi = abs(np.sin(readings[PHI])) + changing_error_bound[PHI]
    tests[FIRST_TURN_TEST].bound_per_sample = (
        changing_error_bound[PHI] + max_sin_theta * changing_error_bound[PSI]
    )
    tests[FIRST_TURN_TEST + 1].bound_per_sample = (
        changing_error_bound[THETA] + max_sin_phi * changing_error_bound[PSI]
    )
    tests[FIRST_TURN_TEST + 2].bound_per_sample = (
        changing_error_bound[PSI] + max_sin_phi * changing_error_bound[THETA]
    )


@kernel
def min_altitude_of_two_samples_m(redundancy, readings):
    """Lower bound on the height in this sample and the one before, m, within the altimeter's error."""
    memory = redundancy.memory
    min_altitude_m = readings[ALTITUDE] - memory.reading_error_bound[ALTITUDE]
    previous_min_altitude_m = memory.previous_reading[ALTITUDE] - memory.previous_error_bound[ALTITUDE]
    return max(min(min_altitude_m, previous_min_altitude_m), LEAST_HEIGHT_M)


@kernel
def bound_flow_tests(redundancy, readings, max_turn_rate, gyro_error_bound_sum):
    """Fill the bounds of `bound_residuals` for the tests of flow and climb: the largest derivative of their
    kinematics with respect to each reading, times the bound on the reading's error."""
    tests, config, memory = redundancy.test, redundancy.config, redundancy.memory
    reading_error_bound, previous_error_bound = memory.reading_error_bound, memory.previous_error_bound
    changing_error_bound, previous_reading = memory.changing_reading_error_bound, memory.previous_reading
    min_airspeed = max(
        min(
            readings[AIRSPEED] - reading_error_bound[AIRSPEED],
            previous_reading[AIRSPEED] - previous_error_bound[AIRSPEED],
        ),
        AIRSPEED_DIVISOR_FLOOR_MPS,
    )
    max_sideslip = max(
        abs(readings[BETA]) + reading_error_bound[BETA],
        abs(previous_reading[BETA]) + previous_error_bound[BETA],
    )
    max_sideslip_secant = 1.0 / np.cos(min(max_sideslip, MAX_PITCH_RAD))
    previous_vane_error_bound_sum = previous_error_bound[ALPHA] + previous_error_bound[BETA]
    max_acceleration_error = acceleration_error_bound(redundancy, max_turn_rate, gyro_error_bound_sum)
    max_acceleration = memory.acceleration_magnitude + max_acceleration_error
    second_order_factor = 1.0 + config.sample_time_s * (
        2.0 * memory.acceleration_magnitude / min_airspeed + max_turn_rate
    )
    gust_change_bound_inflation_factor = np.sqrt(
        max(readings[AIRSPEED] / config.max_airspeed_mps, 1.0)
        * max(config.low_altitude_limit_m / min_altitude_of_two_samples_m(redundancy, readings), 1.0)
    )
    flow_angle_rate_error_bound = (
        max_sideslip_secant**2
        * (
            (
                max_acceleration_error
                + max_acceleration
                * (previous_vane_error_bound_sum + previous_error_bound[AIRSPEED] / min_airspeed)
            )
            / min_airspeed
            + max_turn_rate * previous_vane_error_bound_sum
        )
        + max_sideslip_secant * gyro_error_bound_sum
    )
    tests[SPEED_TEST].residual_per_gust_speed_change, tests[SPEED_TEST].bound_per_sample = (
        gust_change_bound_inflation_factor,
        changing_error_bound[AIRSPEED],
    )
    tests[SPEED_TEST].bound_per_s = (
        max_acceleration_error
        + second_order_factor * max_acceleration * previous_vane_error_bound_sum
        + config.sample_time_s * (max_acceleration / min_airspeed) ** 2 * previous_error_bound[AIRSPEED]
    )
    for test_index, vane_index in ((ALPHA_FLOW_TEST, ALPHA), (BETA_FLOW_TEST, BETA)):
        (
            tests[test_index].residual_per_gust_speed_change,
            tests[test_index].bound_per_sample,
            tests[test_index].bound_per_s,
        ) = (
            gust_change_bound_inflation_factor * max_sideslip_secant / min_airspeed,
            changing_error_bound[vane_index],
            second_order_factor * flow_angle_rate_error_bound,
        )
    previous_tilt_error_bound_sum = previous_error_bound[PHI] + previous_error_bound[THETA]
    max_recent_acceleration = max(
        max_acceleration,
        memory.earlier_acceleration_magnitudes[0],
        memory.earlier_acceleration_magnitudes[1],
    )
    climb_rate_error_bound = (previous_reading[AIRSPEED] + previous_error_bound[AIRSPEED]) * (
        previous_tilt_error_bound_sum + previous_vane_error_bound_sum
    ) + previous_error_bound[AIRSPEED]
    tests[CLIMB_TEST].bound_per_s = (
        config.max_vertical_wind_mps
        + config.max_gust_speed_mps
        + climb_rate_error_bound
        + POSITION_INTEGRATION_ERROR_FACTOR * config.sample_time_s * max_recent_acceleration
    )
    tests[CLIMB_TEST].bound_per_sample = changing_error_bound[ALTITUDE]


@kernel
def log_change_error_bound(redundancy, readings, sensor_index):
    """Bound the apparent change of the logarithm of the reading of a sensor (qdyn or airspeed), by its
    constant error."""
    constant_error_bound = redundancy.config.constant_error_bound[sensor_index]
    previous_reading = redundancy.memory.previous_reading[sensor_index]
    smaller_reading = max(min(readings[sensor_index], previous_reading), 1.0)
    first_order_log_change_bound = constant_error_bound * abs(
        1.0 / max(readings[sensor_index], 1.0) - 1.0 / max(previous_reading, 1.0)
    )
    return first_order_log_change_bound / max(
        1.0 - constant_error_bound / smaller_reading, MIN_READING_SHARE_LEFT_BY_ERROR
    )


@kernel
def bound_density_change_test(redundancy, readings):
    """Fill the bounds of `bound_residuals` for the logarithm of the density."""
    test, config, memory = redundancy.test[DENSITY_TEST], redundancy.config, redundancy.memory
    reading_error_bound = memory.reading_error_bound
    changing_error_bound = memory.changing_reading_error_bound
    max_climb_rate = (
        memory.previous_reading[AIRSPEED]
        + memory.previous_error_bound[AIRSPEED]
        + config.max_vertical_wind_mps
        + config.max_gust_speed_mps
    )
    log_change_bound_from_reading_errors = log_change_error_bound(
        redundancy, readings, QDYN
    ) + 2.0 * log_change_error_bound(redundancy, readings, AIRSPEED)
    test.bound_per_s = (
        max_climb_rate / DENSITY_SCALE_HEIGHT_M + log_change_bound_from_reading_errors / config.sample_time_s
    )
    test.bound_per_sample = changing_error_bound[QDYN] / max(
        readings[QDYN] - reading_error_bound[QDYN], DYNAMIC_PRESSURE_DIVISOR_FLOOR_PA
    )
    test.bound_per_sample += (
        2.0
        * changing_error_bound[AIRSPEED]
        / max(readings[AIRSPEED] - reading_error_bound[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    )


@kernel
def bound_residuals(redundancy, readings):
    """Fill bound_per_s and bound_per_sample of each test: the largest effect of sound sensors with the
    declared errors.

    The errors of the previous sample act through the prediction, those of this sample, readings (N_SENSORS,),
    through the reading that is compared with it. gyro_error_bound_sum: sum of the bounds of the three gyros;
    max_turn_rate: bound on |p| + |q| + |r|; rad/s.
    """
    previous_error_bound = redundancy.memory.previous_error_bound
    previous_reading = redundancy.memory.previous_reading
    gyro_error_bound_sum = previous_error_bound[P] + previous_error_bound[Q] + previous_error_bound[R]
    max_turn_rate = (
        abs(previous_reading[P]) + abs(previous_reading[Q]) + abs(previous_reading[R]) + gyro_error_bound_sum
    )
    bound_attitude_tests(redundancy, readings, max_turn_rate, gyro_error_bound_sum)
    bound_flow_tests(redundancy, readings, max_turn_rate, gyro_error_bound_sum)
    bound_density_change_test(redundancy, readings)


@kernel
def filter_residual_and_update_bound_ratio(redundancy, test):
    """Pass one test's residual through its filters, and find its largest ratio to the bound."""
    config = redundancy.config
    test.residual_bound_ratio = 0.0
    for m, decay in enumerate(config.filter_decay_by_pole):
        test.filtered_residual[m] = decay * test.filtered_residual[m] + test.residual
        test.filtered_bound_per_s_part[m] = advance_residual_bound(
            test.filtered_bound_per_s_part[m], test.bound_per_s, decay, config.sample_time_s
        )
        test.filtered_bound_per_sample_part[m] = advance_gyro_error_bound(
            test.filtered_bound_per_sample_part[m], test.previous_bound_per_sample, decay
        )
        filtered_per_sample_bound = test.filtered_bound_per_sample_part[m] + test.bound_per_sample
        test.filtered_bound[m] = (
            test.filtered_bound_per_s_part[m]
            + filtered_per_sample_bound
            + test.residual_per_gust_speed_change * config.gust_change_bound_mps[m]
        )
        test.residual_bound_ratio = max(
            test.residual_bound_ratio, abs(test.filtered_residual[m]) / test.filtered_bound[m]
        )
    test.previous_bound_per_sample = test.bound_per_sample


@kernel
def restart_test(test):
    """Restart a test with this sample: its filters are empty, and the whole bound per sample is still due."""
    test.residual_bound_ratio = test.residual = 0.0
    test.filtered_residual[:], test.filtered_bound_per_s_part[:] = 0.0, 0.0
    test.filtered_bound_per_sample_part[:] = test.bound_per_sample
    test.previous_bound_per_sample = test.bound_per_sample


@kernel
def compare_engine_sensors(redundancy, readings):
    """Compare the engine's readings with the command. There is no filter: each sample is judged alone."""
    memory = redundancy.memory
    redundancy.test[RPM_TEST].residual = readings[ENGINE_SPEED] - memory.commanded_engine_readings[0]
    redundancy.test[RPM_TEST + 1].residual = readings[MANIFOLD] - memory.commanded_engine_readings[1]
    for i in range(2):
        residual_bound = memory.reading_error_bound[ENGINE_SPEED + i] + COMPARISON_ROUNDING
        redundancy.test[RPM_TEST + i].residual_bound_ratio = (
            abs(redundancy.test[RPM_TEST + i].residual) / residual_bound
        )


@kernel
def compare_duplicate_sensors(redundancy, readings, is_fresh_by_sampled_sensor):
    """Compare each sensor that should equal another reading with that reading, in the samples in which it is
    fresh; is_fresh_by_sampled_sensor (sampled sensors,). If they differ by more than the errors of both and
    the tolerance of the two quantities, one of the two is broken."""
    memory = redundancy.memory
    for duplicate_index in range(DUPLICATE_SENSOR_INDEX.size):
        duplicate_sensor_index = DUPLICATE_SENSOR_INDEX[duplicate_index]
        duplicated_reading_index = DUPLICATED_READING_INDEX[duplicate_index]
        test = redundancy.test[N_TESTS_WITH_EQUATION + duplicate_index]
        test.residual_bound_ratio = 0.0
        if is_fresh_by_sampled_sensor[duplicate_sensor_index - N_IN_EQUATIONS]:
            test.residual = readings[duplicate_sensor_index] - readings[duplicated_reading_index]
            if PHI <= duplicated_reading_index <= PSI:
                test.residual = wrapped(test.residual)
            test.filtered_bound[0] = (
                DUPLICATE_TOLERANCE[duplicate_index]
                + memory.reading_error_bound[duplicate_sensor_index]
                + memory.reading_error_bound[duplicated_reading_index]
                + COMPARISON_ROUNDING
            )
            test.residual_bound_ratio = abs(test.residual) / test.filtered_bound[0]


@kernel
def start_redundancy_tests(redundancy, readings, specific_force):
    """Start with the first sample, before which no reading is known: readings (N_SENSORS,),
    specific_force (3,) m/s2."""
    memory = redundancy.memory
    fill_reading_error_bounds(redundancy, readings)
    store_sample_as_previous(redundancy, readings, specific_force)
    memory.error_bound_two_samples_ago[:], memory.previous_body_acceleration[:] = (
        memory.previous_error_bound,
        memory.body_acceleration,
    )
    memory.acceleration_magnitude = memory.earlier_acceleration_magnitudes[0] = (
        vector_length(memory.body_acceleration) + MIN_FAULTY_FORCE_JUMP_M_S2
    )
    memory.first_acceleration_error_bound = ADAMS_BASHFORTH_SUBTRACTED_WEIGHT * MIN_FAULTY_FORCE_JUMP_M_S2
    bound_residuals(redundancy, readings)
    for test_index in range(RPM_TEST):
        restart_test(redundancy.test[test_index])


@kernel
def run_tests_with_equation(redundancy, readings, has_engine_sensors):
    """Compare this sample of the readings (N_SENSORS,) with the one before."""
    config, memory = redundancy.config, redundancy.memory
    memory.attitude_drift_bound_rad += config.sample_time_s * config.attitude_drift_rad_s
    fill_reading_error_bounds(redundancy, readings)
    advance_motion_and_predict_readings(redundancy)
    fill_residuals(redundancy, readings)
    bound_residuals(redundancy, readings)
    memory.first_acceleration_error_bound = 0.0
    attitude_tests_restart = pitch_is_too_steep(redundancy, readings)
    for test_index in range(RPM_TEST):
        if attitude_tests_restart and test_index < SPEED_TEST:
            restart_test(redundancy.test[test_index])
        else:
            filter_residual_and_update_bound_ratio(redundancy, redundancy.test[test_index])
    if has_engine_sensors:
        compare_engine_sensors(redundancy, readings)


@kernel
def set_accumulated_attitude_drift_bound(redundancy, t):
    """Fill the bound on the attitude's drift by t s, which begins with the flight."""
    redundancy.memory.attitude_drift_bound_rad = redundancy.config.attitude_drift_rad_s * t
