"""Errors that sensors have had since the monitor began: bounds on them, and on their effect on its tests.

A reading that was off by a constant from the first sample on has jumped in no test of its own: it shows only
through the kinematics of the other sensors, in tests that belong to those. There is one hypothesis for each
reading from which others are predicted (alpha, beta, airspeed, phi, theta): that this sensor alone is broken.
The error x of the sensor is counted as

    alpha, beta, phi, theta    x = 2 sin((reading - truth) / 2): by so much the angle turns a unit vector
    airspeed                   x = reading / truth - 1

The record of the hypotheses (INITIAL_ERRORS_RECORD) holds for each hypothesis, with h the time between two
samples, s; test t; and filter pole m

    max_effect_per_unit_error           W_t: bound on |effect on residual t in one sample| / |x|
    filtered_max_effect_per_unit_error  W_tm: the same through the filter, W_tm <- decay_m W_tm + W_t
    error_bound                     b: bound on |x|. At the first sample it is as large as an aircraft can fly
                                    (error_bound_at_start). Then, at each sample,
                                      b <- min(b + (1 - decay_slow) d, error_bound_at_start)
                                    and for each test, or pair of tests, that couples with the error
                                      b <- min(b, (r + B + 2 d W_tm)
                                                  / (MIN_EFFECT_SHARE_WITHIN_FILTER_MEMORY C))
    error_change_bound              d: bound on the change of x within the memory of the slowest filter,
                                    d = min(r + B + b W_tm, error_bound_at_start), of the test that a change
                                    of x moves at once; for the airspeed r + B + b W_tm times (1 + b) / V

r: |filtered residual|; B: bound on it for sound sensors; C: filtered signed effect, a lower bound on the
effect of a unit of x. Of several tests r + B + 2 d W_tm is the root of the sum of squares. For the airspeed
it counts 1 + b times in the tests of flow; in that of the density 2 (1 + b) / V times r + B of SPEED is added
to it. A test refutes a hypothesis with

    r > B + (b + d) W_tm
    r > (1 + b + d) B + (b + d) W_tm     for the airspeed, in SPEED and the tests after it

since a residual is the sum of the effect of sound sensors, at most B, and of the effect of the error. So an
error from the start, of any size, never excludes the broken sensor. Where sensor_monitor.py excludes a sensor
by the effect that its error would have from now on, the limit is B + b W_tm with b as of the alarm.

What each effect follows from (v m/s: velocity, V its length; a m/s2: acceleration, gravity g included; both
in body axes; p, q, r rad/s):

    attitude     with phi off, (q, r) is turned about the body's first axis; with theta off, the vertical
                 unit vector, about which the aircraft turns at psi'
    gravity      with phi off, its part g cos(theta) across the body's first axis is turned; with theta off,
                 all of it; both in a, and so in SPEED, ALPHA_FLOW and BETA_FLOW
    SPEED        V' = a . v / V
    ALPHA_FLOW   alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
                          + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    BETA_FLOW    beta' = p sin(alpha) - r cos(alpha)
                         + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    DENSITY      log(density) = log(2 qdyn) - 2 log V: log V changes by (1 + x) times what its reading shows,
                 if the error of the airspeed is a constant in m/s
    CLIMB        altitude' = V (cos(beta) (cos(alpha) sin(theta) - sin(alpha) cos(phi) cos(theta))
                                - sin(beta) sin(phi) cos(theta))

Gyros need no such hypothesis: all of a gyro's error is in the test of its own axis in every sample. Neither
does the dynamic pressure: only the density shows it.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.redundancy import (
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
    DYNAMIC_PRESSURE_DIVISOR_FLOOR_PA,
    FIRST_ANGLE_TEST,
    FIRST_TURN_TEST,
    MAX_PITCH_RAD,
    N_INITIAL_ERROR_HYPOTHESES,
    PHI_HYPOTHESIS,
    QDYN,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    THETA_HYPOTHESIS,
    pitch_is_too_steep,
)
from beaver_ftc.plant.instruments import ALTITUDE, PHI

MAX_FLOW_ANGLE_RAD = 0.7  # an aircraft whose attitude and flow are tested flies at less, to either side
MAX_AIRSPEED_READING_RATIO = 10.0  # largest reading / truth of an airspeed, and largest truth / reading
MAX_CHORD_OF_ATTITUDE_ERROR = 2.0  # of 2 sin(error / 2): an attitude may be off by half a turn
MAX_DENSITY_DEVIATION_SHARE = (
    0.25  # of the density from the standard atmosphere at a height, as a share of it
)
MIN_TEMPERATURE_RATIO_TO_SEA_LEVEL = (
    0.05  # temperature over that at sea level, below which none is extrapolated
)
# Share of an effect that is left, at least, when speed and flow have changed within a filter's memory
MIN_EFFECT_SHARE_WITHIN_FILTER_MEMORY = 0.8
SLOWEST_POLE_INDEX = 2  # index in redundancy.FILTER_POLES_PER_S

# Places in `signed_effect_per_unit_error`: effects of a unit of an error that are followed with their sign,
# per sample. Two of them, at right angles, make the effect of phi on the attitude, and on the velocity. The
# reading that is off comes first; VANE: of alpha and of beta.
(
    PHI_ERROR_EFFECT_BY_PITCH_RATE_INDEX,  # h q
    PHI_ERROR_EFFECT_BY_YAW_RATE_INDEX,  # h r
    PHI_ERROR_EFFECT_BY_GRAVITY_DOWN_INDEX,  # h g cos(theta) cos(phi)
    PHI_ERROR_EFFECT_BY_GRAVITY_SIDE_INDEX,  # h g cos(theta) sin(phi)
    THETA_ERROR_EFFECT_BY_GRAVITY_INDEX,  # h g cos(largest mean of reading and truth)
    # h V cos(beta) |(sin(theta), cos(phi) cos(theta))| cos(largest mean of an angle)
    ALPHA_ERROR_EFFECT_ON_CLIMB_INDEX,
    VANE_ERROR_EFFECT_BY_FLOW_ROLL_RATE_INDEX,  # h (p cos(alpha) + r sin(alpha))
    VANE_ERROR_EFFECT_BY_FLOW_YAW_RATE_INDEX,  # h (p sin(alpha) - r cos(alpha))
    # of the effect of alpha on BETA_FLOW, of beta on ALPHA_FLOW: bound on the part of the force
    ALPHA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX,
    BETA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX,
    AIRSPEED_ERROR_EFFECT_ON_ALPHA_FLOW_INDEX,  # h (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    # h (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    AIRSPEED_ERROR_EFFECT_ON_BETA_FLOW_INDEX,
    AIRSPEED_ERROR_EFFECT_ON_DENSITY_INDEX,  # 2 (log V - log V before)
    THETA_ERROR_EFFECT_BY_HEADING_RATE_INDEX,  # h (q sin(phi) + r cos(phi)) = h psi' cos(theta)
) = range(14)


@kernel
def angle_of_chord(chord):
    """The angle, rad, whose 2 sin(angle / 2) is `chord`; half a turn for a longer one than 2."""
    return 2.0 * np.arcsin(min(0.5 * chord, 1.0))


@kernel
def chord_of_angle(angle_rad):
    """2 sin(|angle| / 2) of an angle, rad; of more than half a turn as of half a turn."""
    return 2.0 * np.sin(0.5 * min(abs(angle_rad), np.pi))


@kernel
def standard_air_density(altitude_m):
    """Return the density of the standard troposphere, kg/m3, at altitude_m."""
    temperature_ratio = max(1.0 - 2.25577e-5 * altitude_m, MIN_TEMPERATURE_RATIO_TO_SEA_LEVEL)
    return 1.225 * temperature_ratio**4.2559


@kernel
def set_error_bounds_at_start(initial_errors, readings):
    """Bound each error at the first sample of the readings (N_SENSORS,): an aircraft can fly at the truth."""
    error_bound_at_start = initial_errors.error_bound_at_start
    error_bound_at_start[ALPHA_HYPOTHESIS] = chord_of_angle(abs(readings[ALPHA]) + MAX_FLOW_ANGLE_RAD)
    error_bound_at_start[BETA_HYPOTHESIS] = chord_of_angle(abs(readings[BETA]) + MAX_FLOW_ANGLE_RAD)
    V = max(readings[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    airspeed_in_standard_atmosphere = np.sqrt(  # by dynamic pressure and height, in the standard atmosphere
        2.0
        * max(readings[QDYN], DYNAMIC_PRESSURE_DIVISOR_FLOOR_PA)
        / standard_air_density(readings[ALTITUDE])
    )
    (
        max_reading_over_truth,
        min_reading_over_truth,
    ) = (  # of reading and truth, in the thickest and in the thinnest air
        V / airspeed_in_standard_atmosphere * np.sqrt(1.0 + MAX_DENSITY_DEVIATION_SHARE),
        V / airspeed_in_standard_atmosphere * np.sqrt(1.0 - MAX_DENSITY_DEVIATION_SHARE),
    )
    error_bound_at_start[AIRSPEED_HYPOTHESIS] = min(
        max(max_reading_over_truth - 1.0, 1.0 - min_reading_over_truth), MAX_AIRSPEED_READING_RATIO - 1.0
    )
    error_bound_at_start[PHI_HYPOTHESIS] = error_bound_at_start[THETA_HYPOTHESIS] = (
        MAX_CHORD_OF_ATTITUDE_ERROR
    )
    initial_errors.error_bound[:] = error_bound_at_start


@kernel
def index_of_test_showing_error_change(hypothesis_index):
    """The test whose residual is, at once, the change of the error of a hypothesis."""
    return (ALPHA_FLOW_TEST, BETA_FLOW_TEST, SPEED_TEST, FIRST_ANGLE_TEST, FIRST_ANGLE_TEST + 1)[
        hypothesis_index
    ]


@kernel
def update_recent_change_and_widen_bounds(redundancy, initial_errors):
    """Update d, the bound on each error's change within the memory of the slowest filter; and widen b by the
    part of it that this filter forgets in a sample."""
    share_forgotten_per_sample = 1.0 - redundancy.config.filter_decay_by_pole[SLOWEST_POLE_INDEX]
    for i in range(N_INITIAL_ERROR_HYPOTHESES):
        test_index = index_of_test_showing_error_change(i)
        error_bound_at_start = initial_errors.error_bound_at_start[i]
        recent_change_bound = (
            max_error_effect_allowed_by_residual(redundancy, test_index, SLOWEST_POLE_INDEX)
            + initial_errors.error_bound[i]
            * initial_errors.filtered_max_effect_per_unit_error[i, test_index, SLOWEST_POLE_INDEX]
        )
        if i == AIRSPEED_HYPOTHESIS:  # from m/s to a share of the truth, which is at least V / (1 + b)
            recent_change_bound *= (1.0 + initial_errors.error_bound[i]) / max(
                redundancy.memory.previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS
            )
        initial_errors.error_change_bound[i] = min(recent_change_bound, error_bound_at_start)
        widened_bound = (
            initial_errors.error_bound[i] + share_forgotten_per_sample * initial_errors.error_change_bound[i]
        )
        initial_errors.error_bound[i] = min(widened_bound, error_bound_at_start)


@kernel
def fill_effects_per_unit_error(redundancy, initial_errors, readings):
    """Fill `max_effect_per_unit_error` (N_INITIAL_ERROR_HYPOTHESES, RPM_TEST) and, with signs,
    `signed_effect_per_unit_error` (N_SIGNED_INITIAL_ERROR_EFFECTS,).

    Both are taken at the sample before, from which this sample, readings (N_SENSORS,), is predicted.
    """
    previous_reading, h = redundancy.memory.previous_reading, redundancy.config.sample_time_s
    p, q, r = previous_reading[0], previous_reading[1], previous_reading[2]
    V = max(previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    previous_phi = previous_reading[PHI]
    previous_theta = previous_reading[THETA]
    max_effect_per_unit = initial_errors.max_effect_per_unit_error
    signed_effect_per_unit = initial_errors.signed_effect_per_unit_error
    max_effect_per_unit[:] = 0.0
    # 1 / cos(theta) by its reading, and the largest one if theta is off
    theta_secant = 1.0 / np.cos(min(abs(previous_theta), MAX_PITCH_RAD))
    max_theta_secant = 1.0 / np.cos(
        min(abs(previous_theta) + angle_of_chord(initial_errors.error_bound[THETA_HYPOTHESIS]), MAX_PITCH_RAD)
    )
    second_order_turn_rad2 = (h * (abs(p) + abs(q) + abs(r))) ** 2  # rad2: the axes turn during the step
    # Rotation in a step, rad: about the body's second and third axes; about the vertical, psi' h
    pitch_yaw_turn = h * np.hypot(q, r)
    max_heading_turn = h * abs(q * np.sin(previous_phi) + r * np.cos(previous_phi)) * max_theta_secant
    for i in range(3):
        # Body axes. phi off by e: (q, r) is turned by e about the first axis, which changes it by
        # 2 sin(e / 2) |(q, r)|. theta off: the vertical, about which the aircraft turns at psi', likewise.
        max_effect_per_unit[PHI_HYPOTHESIS, FIRST_TURN_TEST + i] = second_order_turn_rad2 + (
            pitch_yaw_turn if i > 0 else 0.0
        )
        max_effect_per_unit[THETA_HYPOTHESIS, FIRST_TURN_TEST + i] = second_order_turn_rad2 + max_heading_turn
        # Angles. phi off: no Euler angle changes by more than the body turns over cos(theta). theta off by e:
        # phi' = p + m tan(theta), psi' = m / cos(theta), with m = q sin(phi) + r cos(phi). The tangents, or
        # secants, of reading and truth differ by at most 2 sin(e / 2) over both cosines; in
        # theta' = q cos(phi) - r sin(phi) there is no theta.
        max_effect_per_unit[PHI_HYPOTHESIS, FIRST_ANGLE_TEST + i] = theta_secant * (
            pitch_yaw_turn + theta_secant * second_order_turn_rad2
        )
        max_effect_per_unit[THETA_HYPOTHESIS, FIRST_ANGLE_TEST + i] = theta_secant * (
            (max_heading_turn if i != 1 else 0.0) + max_theta_secant * second_order_turn_rad2
        )
    (
        signed_effect_per_unit[PHI_ERROR_EFFECT_BY_PITCH_RATE_INDEX],
        signed_effect_per_unit[PHI_ERROR_EFFECT_BY_YAW_RATE_INDEX],
        signed_effect_per_unit[THETA_ERROR_EFFECT_BY_HEADING_RATE_INDEX],
    ) = (
        h * q,
        h * r,
        h * (q * np.sin(previous_phi) + r * np.cos(previous_phi)),
    )
    fill_flow_and_climb_effects(redundancy, initial_errors, V, p, q, r)
    # log V changes by (1 + x) times the change of the reading's logarithm: the density, with -2 log V, by x
    # times twice that.
    log_airspeed_change = np.log(max(readings[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS) / V)
    max_effect_per_unit[AIRSPEED_HYPOTHESIS, DENSITY_TEST] = 2.0 * abs(log_airspeed_change)
    signed_effect_per_unit[AIRSPEED_ERROR_EFFECT_ON_DENSITY_INDEX] = 2.0 * log_airspeed_change


@kernel
def fill_flow_and_climb_effects(redundancy, initial_errors, V, p, q, r):
    """Fill `max_effect_per_unit_error` and `signed_effect_per_unit_error` for the tests of speed, flow and
    climb, and by gravity.

    V m/s; p, q, r rad/s: of the sample before. Each row times h, and times 1 + h (|a| / V + |p| + |q| + |r|)
    for the second order in h. x: the error of the row's hypothesis.
    """
    memory, h, g = redundancy.memory, redundancy.config.sample_time_s, redundancy.config.gravity_m_s2
    previous_reading, a = memory.previous_reading, memory.body_acceleration
    max_effect_per_unit = initial_errors.max_effect_per_unit_error
    signed_effect_per_unit = initial_errors.signed_effect_per_unit_error
    sin_alpha, cos_alpha = np.sin(previous_reading[ALPHA]), np.cos(previous_reading[ALPHA])
    sin_beta, cos_beta = np.sin(previous_reading[BETA]), np.cos(previous_reading[BETA])
    sin_phi, cos_phi = np.sin(previous_reading[PHI]), np.cos(previous_reading[PHI])
    sin_theta, cos_theta = np.sin(previous_reading[THETA]), np.cos(previous_reading[THETA])
    # |beta| by its reading, and the largest one if beta is off; 1 / cos of each
    sideslip_magnitude = abs(previous_reading[BETA])
    max_sideslip = abs(previous_reading[BETA]) + angle_of_chord(initial_errors.error_bound[BETA_HYPOTHESIS])
    beta_secant = 1.0 / np.cos(min(sideslip_magnitude, MAX_PITCH_RAD))
    max_beta_secant = 1.0 / np.cos(min(max_sideslip, MAX_PITCH_RAD))
    # m/s2: a across the flow, downwards and sideways; bound on |a| in the step
    a_normal = a[2] * cos_alpha - a[0] * sin_alpha
    a_side = a[1] * cos_beta - (a[0] * cos_alpha + a[2] * sin_alpha) * sin_beta
    a_max = max(
        memory.acceleration_magnitude,
        np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2),
    )
    # rad/s: rate about the flow's projection on the plane of symmetry; minus that about the axis across it
    flow_roll_rate, negative_flow_yaw_rate = p * cos_alpha + r * sin_alpha, p * sin_alpha - r * cos_alpha
    widened_step_s = h * (1.0 + h * (a_max / V + abs(p) + abs(q) + abs(r)))
    roll_yaw_rate = np.hypot(p, r)
    predicted_climb_m = memory.predicted_reading[ALTITUDE] - previous_reading[ALTITUDE]
    # V' = a . v / V: the direction of v is turned by alpha, or beta, and changes by x at most
    max_effect_per_unit[ALPHA_HYPOTHESIS, SPEED_TEST] = max_effect_per_unit[BETA_HYPOTHESIS, SPEED_TEST] = (
        widened_step_s * a_max
    )
    # alpha' with alpha off: (a_z, a_x) / (V cos(beta)), and tan(beta) (p, r), each turned by alpha
    max_effect_per_unit[ALPHA_HYPOTHESIS, ALPHA_FLOW_TEST] = (
        widened_step_s * beta_secant * (a_max / V + roll_yaw_rate * abs(sin_beta))
    )
    # beta' with alpha off: (p, r), and sin(beta) (a_x, a_z) / V, each turned by alpha
    max_effect_per_unit[ALPHA_HYPOTHESIS, BETA_FLOW_TEST] = widened_step_s * (
        roll_yaw_rate + a_max * abs(sin_beta) / V
    )
    # alpha' with beta off: tangents, and secants, of reading and truth differ by x over both cosines
    max_effect_per_unit[BETA_HYPOTHESIS, ALPHA_FLOW_TEST] = (
        widened_step_s * beta_secant * max_beta_secant * (abs(flow_roll_rate) + a_max / V)
    )
    # beta' with beta off: a turned by beta
    max_effect_per_unit[BETA_HYPOTHESIS, BETA_FLOW_TEST] = widened_step_s * a_max / V
    # alpha', beta' with V off: a / truth = (1 + x) a / reading
    max_effect_per_unit[AIRSPEED_HYPOTHESIS, ALPHA_FLOW_TEST] = max_effect_per_unit[
        AIRSPEED_HYPOTHESIS, BETA_FLOW_TEST
    ] = widened_step_s * beta_secant * a_max / V
    # phi off: a has the error x g cos(theta) across the body's first axis. V' takes its part along v, of
    # which |(sin(beta), sin(alpha) cos(beta))| lies there; alpha' and beta' take at most all of it
    max_effect_per_unit[PHI_HYPOTHESIS, SPEED_TEST] = (
        widened_step_s * g * cos_theta * np.hypot(sin_beta, sin_alpha * cos_beta)
    )
    max_effect_per_unit[PHI_HYPOTHESIS, ALPHA_FLOW_TEST] = max_effect_per_unit[
        PHI_HYPOTHESIS, BETA_FLOW_TEST
    ] = widened_step_s * g * cos_theta * beta_secant / V
    # theta off: a has the error x g, in the plane of the body's first axis and the vertical. V' and alpha'
    # take at most all of it, beta' the part sin(phi) along the second axis, and sin(beta) of the rest
    max_effect_per_unit[THETA_HYPOTHESIS, SPEED_TEST] = widened_step_s * g
    max_effect_per_unit[THETA_HYPOTHESIS, ALPHA_FLOW_TEST] = widened_step_s * beta_secant * g / V
    max_effect_per_unit[THETA_HYPOTHESIS, BETA_FLOW_TEST] = (
        widened_step_s * g * (abs(sin_phi) + abs(sin_beta)) / V
    )
    # altitude' with alpha off: (cos(alpha), sin(alpha)) turned, times V cos(beta), along
    # (sin(theta), -cos(phi) cos(theta))
    vertical_length_in_symmetry_plane = np.hypot(sin_theta, cos_phi * cos_theta)
    max_effect_per_unit[ALPHA_HYPOTHESIS, CLIMB_TEST] = h * V * cos_beta * vertical_length_in_symmetry_plane
    # with beta off: (cos(beta), -sin(beta)) turned, times V
    max_effect_per_unit[BETA_HYPOTHESIS, CLIMB_TEST] = (
        h * V * np.hypot(cos_alpha * sin_theta - sin_alpha * cos_phi * cos_theta, sin_phi * cos_theta)
    )
    # with V off: the true climb is the predicted one over 1 + x, which differ by x / (1 + x) of the latter
    max_effect_per_unit[AIRSPEED_HYPOTHESIS, CLIMB_TEST] = abs(predicted_climb_m) / (
        1.0 - min(initial_errors.error_bound[AIRSPEED_HYPOTHESIS], 1.0 - 1.0 / MAX_AIRSPEED_READING_RATIO)
    )
    # with phi off: the vertical's part cos(theta) is turned, against the part of v across the first axis
    max_effect_per_unit[PHI_HYPOTHESIS, CLIMB_TEST] = (
        h * V * cos_theta * np.hypot(sin_beta, sin_alpha * cos_beta)
    )
    # with theta off: the vertical is turned, against v
    max_effect_per_unit[THETA_HYPOTHESIS, CLIMB_TEST] = h * V
    # Signed effects. phi: the error of gravity across the first axis, exactly: g cos(theta) (sin(phi),
    # cos(phi)) is turned by the error
    signed_effect_per_unit[PHI_ERROR_EFFECT_BY_GRAVITY_DOWN_INDEX] = h * g * cos_theta * cos_phi
    signed_effect_per_unit[PHI_ERROR_EFFECT_BY_GRAVITY_SIDE_INDEX] = h * g * cos_theta * sin_phi
    # theta: along the first axis, g (sin(reading) - sin(truth)) = x g cos(mean of both). The mean is at most
    # half the error away from the reading, and at most (reading + a right angle) / 2
    pitch_magnitude = abs(previous_reading[THETA])
    signed_effect_per_unit[THETA_ERROR_EFFECT_BY_GRAVITY_INDEX] = (
        h
        * g
        * np.cos(
            min(
                pitch_magnitude + 0.5 * angle_of_chord(initial_errors.error_bound[THETA_HYPOTHESIS]),
                0.5 * pitch_magnitude + 0.25 * np.pi,
            )
        )
    )
    # alpha: altitude' = V cos(beta) vertical_length_in_symmetry_plane sin(gamma - alpha) + ..., where
    # tan(gamma) = tan(theta) / cos(phi). The sines of reading and truth differ by x cos(mean of gamma -
    # alpha)
    max_path_angle_midway_to_truth = abs(
        np.arctan2(sin_theta, cos_phi * cos_theta) - previous_reading[ALPHA]
    ) + (0.5 * angle_of_chord(initial_errors.error_bound[ALPHA_HYPOTHESIS]))
    signed_effect_per_unit[ALPHA_ERROR_EFFECT_ON_CLIMB_INDEX] = (
        h
        * V
        * cos_beta
        * vertical_length_in_symmetry_plane
        * np.cos(min(max_path_angle_midway_to_truth, 0.5 * np.pi))
    )
    # alpha off by e: beta' changes by x (flow_roll_rate cos(e / 2) + negative_flow_yaw_rate sin(e / 2)). beta
    # off by e: alpha' changes by x cos(e / 2) flow_roll_rate over both cosines. The part of the force, of
    # either sign, is an uncertainty of both
    signed_effect_per_unit[VANE_ERROR_EFFECT_BY_FLOW_ROLL_RATE_INDEX] = h * flow_roll_rate
    signed_effect_per_unit[VANE_ERROR_EFFECT_BY_FLOW_YAW_RATE_INDEX] = h * negative_flow_yaw_rate
    signed_effect_per_unit[ALPHA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX] = h * abs(sin_beta) * a_max / V
    signed_effect_per_unit[BETA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX] = (
        h * np.sin(min(max_sideslip, 0.5 * np.pi)) * beta_secant * max_beta_secant * abs(a_normal) / V
    )
    # V: a across the flow, over the airspeed
    signed_effect_per_unit[AIRSPEED_ERROR_EFFECT_ON_ALPHA_FLOW_INDEX] = h * a_normal * beta_secant / V
    signed_effect_per_unit[AIRSPEED_ERROR_EFFECT_ON_BETA_FLOW_INDEX] = h * a_side / V


@kernel
def update_filtered_effects_per_unit_error(redundancy, initial_errors):
    """Pass effects per unit error, largest and signed, through the filters of the tests."""
    filter_decay_by_pole = redundancy.config.filter_decay_by_pole
    for i in range(N_INITIAL_ERROR_HYPOTHESES):
        for test_index in range(RPM_TEST):
            for m in range(filter_decay_by_pole.size):
                initial_errors.filtered_max_effect_per_unit_error[i, test_index, m] = (
                    filter_decay_by_pole[m]
                    * initial_errors.filtered_max_effect_per_unit_error[i, test_index, m]
                    + initial_errors.max_effect_per_unit_error[i, test_index]
                )
    for signed_effect_index in range(initial_errors.signed_effect_per_unit_error.size):
        for m in range(filter_decay_by_pole.size):
            initial_errors.filtered_signed_effect_per_unit_error[signed_effect_index, m] = (
                filter_decay_by_pole[m]
                * initial_errors.filtered_signed_effect_per_unit_error[signed_effect_index, m]
                + initial_errors.signed_effect_per_unit_error[signed_effect_index]
            )


@kernel
def max_error_effect_allowed_by_residual(redundancy, test_index, pole_index):
    """Bound the effect of any error on a test through a filter: r + B, in the unit of the residual."""
    test = redundancy.test[test_index]
    return abs(test.filtered_residual[pole_index]) + test.filtered_bound[pole_index]


@kernel
def max_error_effect_if_constant(redundancy, initial_errors, hypothesis_index, test_index, pole_index):
    """Bound the effect that the present error of a hypothesis, had it been constant, would have on a test
    through a filter: r + B + 2 d W_tm. The error was up to d larger or smaller while the filter summed it."""
    return (
        max_error_effect_allowed_by_residual(redundancy, test_index, pole_index)
        + 2.0
        * initial_errors.error_change_bound[hypothesis_index]
        * initial_errors.filtered_max_effect_per_unit_error[hypothesis_index, test_index, pole_index]
    )


@kernel
def tighten_error_bound(initial_errors, hypothesis_index, max_effect, min_effect_per_unit_error):
    """Lower the bound on an error whose effect is at most max_effect, and at least min_effect_per_unit_error
    a unit."""
    if min_effect_per_unit_error > 0.0:
        initial_errors.error_bound[hypothesis_index] = min(
            initial_errors.error_bound[hypothesis_index],
            max_effect / (MIN_EFFECT_SHARE_WITHIN_FILTER_MEMORY * min_effect_per_unit_error),
        )


@kernel
def max_error_effect_on_velocity_mps(redundancy, initial_errors, hypothesis_index, pole_index):
    """The bound of `max_error_effect_if_constant` on the velocity, m/s, in any direction."""
    V = max(redundancy.memory.previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    max_flow_angle_effect = np.hypot(
        max_error_effect_if_constant(
            redundancy, initial_errors, hypothesis_index, ALPHA_FLOW_TEST, pole_index
        ),
        max_error_effect_if_constant(
            redundancy, initial_errors, hypothesis_index, BETA_FLOW_TEST, pole_index
        ),
    )
    return np.hypot(
        max_error_effect_if_constant(redundancy, initial_errors, hypothesis_index, SPEED_TEST, pole_index),
        V * max_flow_angle_effect,
    )


@kernel
def max_error_effect_on_pitch_yaw_turn(redundancy, initial_errors, hypothesis_index, pole_index):
    """The bound of `max_error_effect_if_constant` on the rotation about the body's second and third axes,
    rad."""
    return np.hypot(
        max_error_effect_if_constant(
            redundancy, initial_errors, hypothesis_index, FIRST_TURN_TEST + 1, pole_index
        ),
        max_error_effect_if_constant(
            redundancy, initial_errors, hypothesis_index, FIRST_TURN_TEST + 2, pole_index
        ),
    )


@kernel
def tighten_all_error_bounds(redundancy, initial_errors):
    """Lower the bound on each error to what the tests allow, filter by filter."""
    for m in range(redundancy.config.filter_decay_by_pole.size):
        filtered_signed_effects_at_pole = initial_errors.filtered_signed_effect_per_unit_error[:, m]
        tighten_error_bound(
            initial_errors,
            PHI_HYPOTHESIS,
            max_error_effect_on_pitch_yaw_turn(redundancy, initial_errors, PHI_HYPOTHESIS, m),
            np.hypot(
                filtered_signed_effects_at_pole[PHI_ERROR_EFFECT_BY_PITCH_RATE_INDEX],
                filtered_signed_effects_at_pole[PHI_ERROR_EFFECT_BY_YAW_RATE_INDEX],
            ),
        )
        tighten_error_bound(
            initial_errors,
            PHI_HYPOTHESIS,
            max_error_effect_on_velocity_mps(redundancy, initial_errors, PHI_HYPOTHESIS, m),
            np.hypot(
                filtered_signed_effects_at_pole[PHI_ERROR_EFFECT_BY_GRAVITY_DOWN_INDEX],
                filtered_signed_effects_at_pole[PHI_ERROR_EFFECT_BY_GRAVITY_SIDE_INDEX],
            ),
        )
        tighten_error_bound(
            initial_errors,
            THETA_HYPOTHESIS,
            max_error_effect_on_velocity_mps(redundancy, initial_errors, THETA_HYPOTHESIS, m),
            filtered_signed_effects_at_pole[THETA_ERROR_EFFECT_BY_GRAVITY_INDEX],
        )
        max_rotation_effect = np.hypot(
            max_error_effect_if_constant(redundancy, initial_errors, THETA_HYPOTHESIS, FIRST_TURN_TEST, m),
            max_error_effect_on_pitch_yaw_turn(redundancy, initial_errors, THETA_HYPOTHESIS, m),
        )
        tighten_error_bound(
            initial_errors,
            THETA_HYPOTHESIS,
            max_rotation_effect,
            abs(filtered_signed_effects_at_pole[THETA_ERROR_EFFECT_BY_HEADING_RATE_INDEX]),
        )
        tighten_vane_error_bounds(redundancy, initial_errors, m)
        tighten_airspeed_error_bound(redundancy, initial_errors, m)


@kernel
def tighten_vane_error_bounds(redundancy, initial_errors, pole_index):
    """Lower the bounds on the errors of incidence and sideslip to what climb and flow allow."""
    filtered_signed_effects_at_pole = initial_errors.filtered_signed_effect_per_unit_error[:, pole_index]
    max_half_alpha_error = 0.5 * angle_of_chord(initial_errors.error_bound[ALPHA_HYPOTHESIS])
    min_effect_per_unit_error = (
        np.cos(max_half_alpha_error)
        * abs(filtered_signed_effects_at_pole[VANE_ERROR_EFFECT_BY_FLOW_ROLL_RATE_INDEX])
        - np.sin(max_half_alpha_error)
        * abs(filtered_signed_effects_at_pole[VANE_ERROR_EFFECT_BY_FLOW_YAW_RATE_INDEX])
        - filtered_signed_effects_at_pole[ALPHA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX]
    )
    tighten_error_bound(
        initial_errors,
        ALPHA_HYPOTHESIS,
        max_error_effect_if_constant(redundancy, initial_errors, ALPHA_HYPOTHESIS, CLIMB_TEST, pole_index),
        filtered_signed_effects_at_pole[ALPHA_ERROR_EFFECT_ON_CLIMB_INDEX],
    )
    tighten_error_bound(
        initial_errors,
        ALPHA_HYPOTHESIS,
        max_error_effect_if_constant(
            redundancy, initial_errors, ALPHA_HYPOTHESIS, BETA_FLOW_TEST, pole_index
        ),
        min_effect_per_unit_error,
    )
    min_effect_per_unit_error = (
        np.cos(0.5 * angle_of_chord(initial_errors.error_bound[BETA_HYPOTHESIS]))
        * abs(filtered_signed_effects_at_pole[VANE_ERROR_EFFECT_BY_FLOW_ROLL_RATE_INDEX])
        - filtered_signed_effects_at_pole[BETA_EFFECT_UNCERTAINTY_BY_FORCE_INDEX]
    )
    tighten_error_bound(
        initial_errors,
        BETA_HYPOTHESIS,
        max_error_effect_if_constant(
            redundancy, initial_errors, BETA_HYPOTHESIS, ALPHA_FLOW_TEST, pole_index
        ),
        min_effect_per_unit_error,
    )


@kernel
def tighten_airspeed_error_bound(redundancy, initial_errors, pole_index):
    """Lower the bound on the error of the airspeed to what flow and density allow.

    The tests of the flow have bounds for a right airspeed: a true one that is 1 + b times smaller makes them
    larger by that. The density shows changes of the error in addition: those are in the airspeed's own test.
    """
    filtered_signed_effects_at_pole = initial_errors.filtered_signed_effect_per_unit_error[:, pole_index]
    max_reading_over_truth = 1.0 + initial_errors.error_bound[AIRSPEED_HYPOTHESIS]
    tighten_error_bound(
        initial_errors,
        AIRSPEED_HYPOTHESIS,
        max_reading_over_truth
        * max_error_effect_if_constant(
            redundancy, initial_errors, AIRSPEED_HYPOTHESIS, ALPHA_FLOW_TEST, pole_index
        ),
        abs(filtered_signed_effects_at_pole[AIRSPEED_ERROR_EFFECT_ON_ALPHA_FLOW_INDEX]),
    )
    tighten_error_bound(
        initial_errors,
        AIRSPEED_HYPOTHESIS,
        max_reading_over_truth
        * max_error_effect_if_constant(
            redundancy, initial_errors, AIRSPEED_HYPOTHESIS, BETA_FLOW_TEST, pole_index
        ),
        abs(filtered_signed_effects_at_pole[AIRSPEED_ERROR_EFFECT_ON_BETA_FLOW_INDEX]),
    )
    max_error_change_effect_on_density = (
        2.0
        * max_reading_over_truth
        * max_error_effect_allowed_by_residual(redundancy, SPEED_TEST, pole_index)
        / max(redundancy.memory.previous_reading[AIRSPEED], AIRSPEED_DIVISOR_FLOOR_MPS)
    )
    tighten_error_bound(
        initial_errors,
        AIRSPEED_HYPOTHESIS,
        max_error_effect_if_constant(
            redundancy, initial_errors, AIRSPEED_HYPOTHESIS, DENSITY_TEST, pole_index
        )
        + max_error_change_effect_on_density,
        abs(filtered_signed_effects_at_pole[AIRSPEED_ERROR_EFFECT_ON_DENSITY_INDEX]),
    )


@kernel
def update_initial_error_bounds(redundancy, initial_errors, readings):
    """Update all bounds by the sample whose readings (N_SENSORS,) have just been tested."""
    if pitch_is_too_steep(redundancy, readings):
        initial_errors.filtered_signed_effect_per_unit_error[:] = 0.0
        return
    update_recent_change_and_widen_bounds(redundancy, initial_errors)
    fill_effects_per_unit_error(redundancy, initial_errors, readings)
    update_filtered_effects_per_unit_error(redundancy, initial_errors)
    tighten_all_error_bounds(redundancy, initial_errors)


@kernel
def exceeds_bound_with_initial_error(redundancy, initial_errors, hypothesis_index, test_index):
    """Whether a test's residual is larger than sound sensors and the error of a hypothesis explain: for a
    pole m, r > factor B + (b + d) W_tm. No hypothesis has an effect on the engine's tests and later ones."""
    test = redundancy.test[test_index]
    error_bound_with_recent_change = (
        initial_errors.error_bound[hypothesis_index] + initial_errors.error_change_bound[hypothesis_index]
    )
    if test_index >= RPM_TEST:
        return test.residual_bound_ratio > 1.0
    bound_factor = 1.0 + (
        error_bound_with_recent_change
        if hypothesis_index == AIRSPEED_HYPOTHESIS and test_index >= SPEED_TEST
        else 0.0
    )
    for m in range(redundancy.config.filter_decay_by_pole.size):
        max_error_effect = (
            error_bound_with_recent_change
            * initial_errors.filtered_max_effect_per_unit_error[hypothesis_index, test_index, m]
        )
        if abs(test.filtered_residual[m]) > bound_factor * test.filtered_bound[m] + max_error_effect:
            return True
    return False


@kernel
def store_error_bounds_at_alarm(initial_errors):
    """Keep the bounds of the moment of the alarm: later residuals may be the effect of another error."""
    initial_errors.error_bound_at_alarm[:] = initial_errors.error_bound


@kernel
def max_error_effect_at_alarm(initial_errors, hypothesis_index, test_index, pole_index):
    """Bound the effect on a test, through a filter, of an error as large as that of a hypothesis could be at
    the alarm: b W_tm, in the unit of the residual."""
    return (
        initial_errors.error_bound_at_alarm[hypothesis_index]
        * initial_errors.filtered_max_effect_per_unit_error[hypothesis_index, test_index, pole_index]
    )


@kernel
def latch_refuted_hypotheses(redundancy, initial_errors, tests_exceeded_since_alarm):
    """Record by which of `tests_exceeded_since_alarm` (N_TESTS,) each hypothesis is refuted."""
    refutations_by_hypothesis_and_test = initial_errors.refutations_by_hypothesis_and_test
    for i in range(N_INITIAL_ERROR_HYPOTHESES):
        for test_index in range(tests_exceeded_since_alarm.size):
            if (
                tests_exceeded_since_alarm[test_index]
                and not refutations_by_hypothesis_and_test[i, test_index]
                and exceeds_bound_with_initial_error(redundancy, initial_errors, i, test_index)
            ):
                refutations_by_hypothesis_and_test[i, test_index] = 1


@kernel
def test_reacts_to_error_change(hypothesis_index, test_index):
    """Whether a test reacts at once to a change of the error of a hypothesis."""
    if hypothesis_index in (PHI_HYPOTHESIS, THETA_HYPOTHESIS):
        return test_index < FIRST_ANGLE_TEST or test_index == index_of_test_showing_error_change(
            hypothesis_index
        )
    return test_index == index_of_test_showing_error_change(hypothesis_index) or (
        hypothesis_index == AIRSPEED_HYPOTHESIS and test_index == DENSITY_TEST
    )


@kernel
def initial_error_explains_exceeded_tests(initial_errors, hypothesis_index, alarm_test_index):
    """Whether an error that the sensor of a hypothesis has had from the start, and that may change, explains
    all tests exceeded since the alarm.

    If the test that raised the alarm reacts at once to such a change, sensor_monitor.py judges changes: here
    the error is constant then, and any refuting test counts. Otherwise those that react at once do not count.
    """
    for test_index in range(initial_errors.refutations_by_hypothesis_and_test.shape[1]):
        if initial_errors.refutations_by_hypothesis_and_test[hypothesis_index, test_index] and (
            test_reacts_to_error_change(hypothesis_index, alarm_test_index)
            or not test_reacts_to_error_change(hypothesis_index, test_index)
        ):
            return False
    return True
