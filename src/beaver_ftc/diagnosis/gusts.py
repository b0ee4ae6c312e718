"""The gust estimate from vanes and airspeed: rotation of the air, rad/s, and its effect on the rates.

A vertical gust that varies along the flight path acts like a pitch rate q_g, a lateral one like a yaw rate
r_g, both rad/s [MIL-F-8785C, 3.7]:

    tau_q q_g' + q_g = w_g' / V,  tau_q = 4 b / pi V        tau_r r_g' + r_g = v_g' / V,  tau_r = 3 b / pi V

w_g, v_g, m/s, are the gust downwards and to the right; b, m, is the span; V, m/s, the speed. Vanes and
airspeed give the aircraft's velocity relative to the moving air. Forces, attitude and gravity predict how
this velocity would change in still air. The difference is the change of the gust. The rolling gust, which
varies across the span, cannot be measured.

If the design model has no forces (as that of the GTM), the accelerometers supply them. Without either, a
change of the aircraft's own velocity cannot be distinguished from a gust; no gust estimate is then subtracted
from the rates. A coarse estimate, for which lift balances the weight, is still computed. A law that uses the
vanes moves the surfaces with the gust, which looks like a loss; the detector corrects its evidence by the
coarse estimate (likelihood.py).

V is the speed relative to the field of gusts. The mean wind carries that field [MIL-F-8785C, 3.7.1], so V is
the speed relative to the mean air. The airspeed differs from V by the gust itself. The gust velocity is the
sum of its changes; unknown are its initial value and the drift of accelerometers and attitude. The record's
`gust_velocity_change_since_start` is that sum, with a decay as slow as this drift permits. A relative error e
of V leaves at most e^2 / 4 of the gust's intensity unmeasured (`unmeasured_share_per_speed_error_variance`).

The intensity of turbulence is that above 2000 ft, or that at the height flown if it is larger.

The velocity is integrated as in JSBSim, by the two-step method of Adams and Bashforth:
v' = v + dt (3 a - a_before) / 2.
"""

from math import pi

import numpy as np

from beaver_ftc.aircraft import MassProperties
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, FORCES, GRAVITY_MPS2
from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design import SCALE_M, rotation_lengths
from beaver_ftc.design.model import (
    AIRSPEED,
    ALPHA,
    BETA,
    QDYN,
    TABLE,
    evaluate,
    fill_table,
    rate_damping,
    whole_sum,
)
from beaver_ftc.diagnosis.bounds import (
    angular_acceleration_by_gust_noise_std,
    flow_angle_in_level_axes_noise_std,
    min_true_height_m,
)
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_ACCELERATION_BOUND_M_S2
from beaver_ftc.plant.instruments import wrapped
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors

# Share of the intensity of the rolling, pitching and yawing gust that remains unmeasured with vanes. With
# exact vanes and over a filter's memory it is smaller (`tests/diagnosis/test_gusts.py`).
MIN_UNMEASURED_GUST_INTENSITY_SHARES = (1.0, 0.003, 0.03)
UNMEASURED_SHARE_FROM_FORCE_ERROR = 0.01  # share left unmeasured by an error of a tenth in the forces
ADAMS_BASHFORTH_NOISE_GAIN = 1.6  # noise gain of the two-step method: sqrt(1.5^2 + 0.5^2)
MIN_BANK_COSINE = 0.5  # cosine of the steepest bank at which lift is assumed to balance the weight
MAX_GUST_VELOCITY_OVER_STD = 4.0  # limit of the estimated gust velocity, standard deviations
MAX_PATH_SLOPE_RAD = 0.3  # of the path, along which gravity acts
MAX_DRAG_OVER_WEIGHT = 0.3  # upper limit of drag over weight: errors of coefficients are a share of it
# share of a gust's own intensity below which the turn of its axes is ignored
MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN = 0.01

GUST_CONFIG_RECORD = record(
    has_force_model=int,  # whether the design model has forces
    has_only_coarse_estimate=int,  # whether only a coarse estimate of the gust is possible
    wing_area_per_mass=float, gravity=float, wing_span=float,  # m2/kg, m/s2, m
    # Intensity over airspeed of the drift of the rotation: above 2000 ft; at a height of 1 m.
    gust_rotation_intensity_per_airspeed_aloft=3, gust_rotation_intensity_per_airspeed_at_1_m=3,
    altitude_error_bound_at_zero_m=float,
    altitude_error_bound_per_m=float,  # bound on the altimeter's error: offset, m; slope
    # limit of a gust component, m/s; decay of `gust_velocity_change_since_start`, 1/s
    max_gust_velocity=float, gust_velocity_decay_rate=float,
    # Error variance of the speed, (m/s)2; variance of the gust, (m/s)2; share of a gust's intensity that a
    # relative error of the speed leaves, over the variance of that error.
    speed_error_variance=float, gust_velocity_variance=float, unmeasured_share_per_speed_error_variance=float,
    rolling_gust_correlation_length=float,  # lag of the rolling gust times airspeed, m
    turbulence_scale_length=float,  # of the gusts, m
    starts_in_flight=int,  # whether the diagnosis starts in flight, where a gust may already be present
)  # fmt: skip

GUST_MEMORY_RECORD = record(
    has_acceleration_before=int,  # whether `acceleration_in_level_axes_before` is valid
    accelerometer_reading=3,  # reading of the accelerometers, m/s2
    force_table=TABLE, scratch=MAX_MONOMIALS,  # force coefficients, evaluated at this instant
    # Velocity relative to the air, m/s in level axes; specific force, m/s2 in body axes; attitude.
    air_relative_velocity=3, specific_force=3, level_to_body=(3, 3), heading=float,
    # an instant before, by forces and gravity, m/s2 in the level axes of this one
    acceleration_in_level_axes_before=3,
    air_rotation_in_level_axes=3, air_rotation_in_body_axes=3,  # rad/s
    # sum of `angular_acceleration_by_gust` over the instants of a frame, rad/s2
    angular_acceleration_by_gust_sum=3,
    # intensity over airspeed of the drift of the rotation at this height, rad2/s3 per m/s
    gust_rotation_intensity_per_airspeed=3,
    unmeasured_intensity_share=3,  # share of it that the vanes do not measure
    # Change of the gust's velocity since the start, m/s ahead, right, down; share of the variance of the
    # initial gust that still counts.
    gust_velocity_change_since_start=3, remaining_initial_gust_variance_share=float,
    # Unmeasured shares: of the yawing gust by the turn at this instant, and decaying since earlier turns; of
    # the pitching gust that was present when the diagnosis started.
    unmeasured_yawing_share_by_turn_now=float, unmeasured_yawing_share_by_past_turns=float,
    unmeasured_pitching_share_by_start=float,
    # turn of the gusts' axes in the body, 1/s; whether it counts
    gust_axes_rate=(3, 3), has_fast_axes_turn=int,
    # Variance of the accelerations by that turn, (rad/s2)2: in the current frame, in the frame before; number
    # of frames for which there is any.
    acceleration_variance_by_axes_turn_now=(3, 3), acceleration_variance_by_axes_turn_before=(3, 3),
    n_frames_left_with_axes_turn_variance=int,
)  # fmt: skip

GUST_OUTPUT_RECORD = record(
    # Whether there is turbulence; whether accelerometers are used; whether the gust is measured. These are
    # filled by configure, and end with the accelerometers.
    accounts_for_gusts=int, uses_accelerometers=int, is_gust_measured=int,
    # effect of the measured gust, rad/s2: at this instant; mean of the elapsed frame
    angular_acceleration_by_gust=3, mean_angular_acceleration_by_gust=3,
    angular_acceleration_by_coarse_gust=3,  # effect of the coarse estimate, rad/s2
    # `acceleration_variance_by_axes_turn_now` plus `acceleration_variance_by_axes_turn_before`, (rad/s2)2
    acceleration_variance_by_axes_turn=(3, 3),
    speed_relative_to_mean_air=float,  # relative to the mean air, m/s
    rate_damping=(3, 3), gust_axes_in_body=(3, 3),  # 1/s; rotation from the gusts' axes to body axes
)  # fmt: skip

GUST_RECORD = record(config=GUST_CONFIG_RECORD, memory=GUST_MEMORY_RECORD, output=GUST_OUTPUT_RECORD)


@kernel
def fill_specific_force(gust, x, y, u, out):
    """Fill out (3,) m/s2 with the aerodynamic and propulsive force over mass in body axes, by the model.

    x (3,) rad/s, y (4 + declared,), u (n,) rad. The term of the rate of sideslip is omitted: it is below a
    hundredth of the side force.
    """
    force_table = gust.memory.force_table
    evaluate(force_table, x, y)
    for i in range(3):
        out[i] = y[QDYN] * gust.config.wing_area_per_mass * whole_sum(force_table, i, force_table.power, u)


@kernel
def fill_level_to_body_rotation(phi, theta, level_to_body):
    """Fill level_to_body (3, 3), the rotation from level axes (forward, right, down) to body axes; angles
    rad."""
    sin_phi, cos_phi, sin_theta, cos_theta = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    level_to_body[0, 0], level_to_body[0, 1], level_to_body[0, 2] = cos_theta, 0.0, -sin_theta
    level_to_body[1, 0] = sin_phi * sin_theta
    level_to_body[1, 1] = cos_phi
    level_to_body[1, 2] = sin_phi * cos_theta
    level_to_body[2, 0] = cos_phi * sin_theta
    level_to_body[2, 1] = -sin_phi
    level_to_body[2, 2] = cos_phi * cos_theta


@kernel
def component_in_level_axes(level_to_body, body_vector, level_axis):
    """Component along a level axis of a vector (3,) in body axes."""
    return (
        level_to_body[0, level_axis] * body_vector[0]
        + level_to_body[1, level_axis] * body_vector[1]
        + level_to_body[2, level_axis] * body_vector[2]
    )


@kernel
def fill_attitude_and_air_relative_velocity(gust, y, attitude):
    """Fill attitude, heading and velocity relative to the air, m/s in level axes, of this instant.

    y (5,) and attitude (3,) rad as measured.
    """
    alpha, beta, V = y[ALPHA], y[BETA], y[AIRSPEED]
    fill_level_to_body_rotation(attitude[0], attitude[1], gust.memory.level_to_body)
    gust.memory.heading = attitude[2]
    body_forward_velocity = V * np.cos(alpha) * np.cos(beta)
    body_right_velocity = V * np.sin(beta)
    body_down_velocity = V * np.sin(alpha) * np.cos(beta)
    for i in range(3):
        gust.memory.air_relative_velocity[i] = (
            gust.memory.level_to_body[0, i] * body_forward_velocity
            + gust.memory.level_to_body[1, i] * body_right_velocity
            + gust.memory.level_to_body[2, i] * body_down_velocity
        )


@kernel
def start_gust_estimate(gust, y, attitude):
    """Start at the first frame of a diagnosis: the estimated gust is zero.

    If the diagnosis begins in flight, a gust may be present already; it counts as unmeasured and decays.
    """
    fill_attitude_and_air_relative_velocity(gust, y, attitude)
    update_gust_axes_keeping_previous(gust, 0.0, 1.0)
    gust.memory.air_rotation_in_level_axes[:] = 0.0
    gust.memory.has_acceleration_before, gust.memory.unmeasured_yawing_share_by_turn_now = 0, 0.0
    gust.memory.unmeasured_yawing_share_by_past_turns = gust.memory.unmeasured_pitching_share_by_start = (
        gust.memory.remaining_initial_gust_variance_share
    ) = float(gust.config.starts_in_flight)
    gust.memory.gust_velocity_change_since_start[:], gust.output.speed_relative_to_mean_air = 0.0, y[AIRSPEED]
    gust.memory.acceleration_variance_by_axes_turn_now[:] = 0.0
    gust.memory.acceleration_variance_by_axes_turn_before[:] = 0.0
    gust.output.acceleration_variance_by_axes_turn[:] = 0.0
    gust.memory.n_frames_left_with_axes_turn_variance = 0


@kernel
def update_gust_axes_keeping_previous(gust, sin_heading_change, cos_heading_change):
    """Fill `gust_axes_in_body` for this instant, and keep those of the instant before in `gust_axes_rate`.

    sin, cos_heading_change: of the change of heading. JSBSim's gusts have the heading of the step before.
    """
    gust.memory.gust_axes_rate[:] = gust.output.gust_axes_in_body
    for i in range(3):
        level_ahead_on_body_axis = gust.memory.level_to_body[i, 0]
        level_right_on_body_axis = gust.memory.level_to_body[i, 1]
        gust.output.gust_axes_in_body[i, 0] = (
            level_ahead_on_body_axis * cos_heading_change - level_right_on_body_axis * sin_heading_change
        )
        gust.output.gust_axes_in_body[i, 1] = (
            level_ahead_on_body_axis * sin_heading_change + level_right_on_body_axis * cos_heading_change
        )
        gust.output.gust_axes_in_body[i, 2] = gust.memory.level_to_body[i, 2]


@kernel
def fill_axes_rate_and_fast_turn(gust, dt, V):
    """Fill `gust_axes_rate`, 1/s: how fast the axes of the gusts turn in the body; dt s since the instant
    before.

    A constant unmeasured gust of deviation sigma = sqrt(intensity lag / 2) then changes in body axes at the
    rate sigma gust_axes_rate. Over its lag this equals a random walk of (gust_axes_rate lag)^2 / 2 times its
    intensity.
    """
    largest_turn_rate_magnitude_so_far = 0.0
    for i in range(3):
        for gust_axis in range(3):
            gust.memory.gust_axes_rate[i, gust_axis] = (
                gust.output.gust_axes_in_body[i, gust_axis] - gust.memory.gust_axes_rate[i, gust_axis]
            ) / dt
            largest_turn_rate_magnitude_so_far = max(
                largest_turn_rate_magnitude_so_far, abs(gust.memory.gust_axes_rate[i, gust_axis])
            )
    gust.memory.has_fast_axes_turn = (
        0.5 * (largest_turn_rate_magnitude_so_far * gust.config.rolling_gust_correlation_length / V) ** 2
        > MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN
    )


@kernel
def unmeasured_yawing_share_from_heading_rate(gust, V, heading_rate):
    """Share of the yawing gust's intensity that is unmeasured while the heading turns at `heading_rate`
    rad/s.

    The gusts turn with the aircraft: a gust from ahead, of deviation sigma, becomes one from the side. This
    adds a change of rate sigma to the walk of intensity 3 sigma^2 V / turbulence_scale_length. The share is
    the ratio of their squares over the lag of the yawing gust, 3 span / pi V.
    """
    return (
        heading_rate
        * heading_rate
        * gust.config.wing_span
        * gust.config.turbulence_scale_length
        / (pi * V * V)
    )


@kernel
def advance_gust_estimate(gust, y, attitude, dt):
    """Update `air_rotation_in_level_axes` (3,) rad/s for the elapsed dt s; the rolling gust stays unknown.

    y (5,) and attitude (3,) rad as measured now; `specific_force` and attitude in memory are those dt s ago.
    If the heading turns so fast that the vanes mostly measure this turn, as when the nose passes the
    vertical, the yawing gust only decays, and the sum of changes `gust_velocity_change_since_start` starts
    again. It does so one instant longer: JSBSim's gusts turn a step after the heading.
    """
    acceleration_in_level_axes = gust.memory.scratch
    for i in range(3):
        acceleration_in_level_axes[i] = component_in_level_axes(
            gust.memory.level_to_body, gust.memory.specific_force, i
        )
    acceleration_in_level_axes[2] += gust.config.gravity
    if not gust.memory.has_acceleration_before:
        gust.memory.acceleration_in_level_axes_before[:] = acceleration_in_level_axes[:3]
        gust.memory.has_acceleration_before = 1
    for i in range(3):
        gust.memory.air_relative_velocity[i] += dt * (
            1.5 * acceleration_in_level_axes[i] - 0.5 * gust.memory.acceleration_in_level_axes_before[i]
        )
    heading_change = wrapped(attitude[2] - gust.memory.heading)
    sin_heading_change, cos_heading_change = np.sin(heading_change), np.cos(heading_change)
    predicted_horizontal_velocity_ahead = (
        gust.memory.air_relative_velocity[0] * cos_heading_change
        + gust.memory.air_relative_velocity[1] * sin_heading_change
    )
    predicted_horizontal_velocity_right = (
        gust.memory.air_relative_velocity[1] * cos_heading_change
        - gust.memory.air_relative_velocity[0] * sin_heading_change
    )
    predicted_vertical_velocity_down = gust.memory.air_relative_velocity[2]
    gust.memory.acceleration_in_level_axes_before[0] = (
        acceleration_in_level_axes[0] * cos_heading_change
        + acceleration_in_level_axes[1] * sin_heading_change
    )
    gust.memory.acceleration_in_level_axes_before[1] = (
        acceleration_in_level_axes[1] * cos_heading_change
        - acceleration_in_level_axes[0] * sin_heading_change
    )
    gust.memory.acceleration_in_level_axes_before[2] = acceleration_in_level_axes[2]
    fill_attitude_and_air_relative_velocity(gust, y, attitude)
    update_gust_velocity_and_speed(
        gust,
        predicted_horizontal_velocity_ahead,
        predicted_horizontal_velocity_right,
        predicted_vertical_velocity_down,
        y[AIRSPEED],
        dt,
    )
    V = gust.output.speed_relative_to_mean_air
    update_gust_axes_keeping_previous(gust, sin_heading_change, cos_heading_change)
    fill_axes_rate_and_fast_turn(gust, dt, V)
    update_air_rotation_and_unmeasured_shares(
        gust, predicted_horizontal_velocity_right, predicted_vertical_velocity_down, heading_change / dt, dt
    )


@kernel
def update_air_rotation_and_unmeasured_shares(
    gust, predicted_horizontal_velocity_right, predicted_vertical_velocity_down, heading_rate, dt
):
    """Let the pitching and yawing rotation of the air decay, and add what the change of the gust shows of it.

    predicted_horizontal_velocity_right, predicted_vertical_velocity_down, m/s: velocity relative to the air
    if the gust had not changed. heading_rate rad/s; dt s.
    """
    V = gust.output.speed_relative_to_mean_air
    pitching_lag_s, yawing_lag_s = gust_correlation_time_s(gust, 1, V), gust_correlation_time_s(gust, 2, V)
    previous_unmeasured_yawing_share = gust.memory.unmeasured_yawing_share_by_turn_now
    gust.memory.unmeasured_yawing_share_by_turn_now = unmeasured_yawing_share_from_heading_rate(
        gust, V, heading_rate
    )
    larger_unmeasured_yawing_share = max(
        previous_unmeasured_yawing_share, gust.memory.unmeasured_yawing_share_by_turn_now
    )
    gust.memory.unmeasured_yawing_share_by_past_turns = min(
        max(
            np.exp(-dt / yawing_lag_s) * gust.memory.unmeasured_yawing_share_by_past_turns,
            larger_unmeasured_yawing_share,
        ),
        1.0,
    )
    gust.memory.unmeasured_pitching_share_by_start *= np.exp(-dt / pitching_lag_s)
    gust.memory.air_rotation_in_level_axes[1] = np.exp(
        -dt / pitching_lag_s
    ) * gust.memory.air_rotation_in_level_axes[1] + (
        predicted_vertical_velocity_down - gust.memory.air_relative_velocity[2]
    ) / (V * pitching_lag_s)
    gust.memory.air_rotation_in_level_axes[2] = (
        np.exp(-dt / yawing_lag_s) * gust.memory.air_rotation_in_level_axes[2]
    )
    if larger_unmeasured_yawing_share < 1.0:
        gust.memory.air_rotation_in_level_axes[2] += (
            predicted_horizontal_velocity_right - gust.memory.air_relative_velocity[1]
        ) / (V * yawing_lag_s)
    else:
        gust.memory.gust_velocity_change_since_start[:], gust.memory.remaining_initial_gust_variance_share = (
            0.0,
            1.0,
        )


@kernel
def update_gust_velocity_and_speed(
    gust,
    predicted_horizontal_velocity_ahead,
    predicted_horizontal_velocity_right,
    predicted_vertical_velocity_down,
    airspeed,
    dt,
):
    """Update `gust_velocity_change_since_start` and `speed_relative_to_mean_air` for the elapsed dt s.

    predicted_horizontal_velocity_ahead, _right and predicted_vertical_velocity_down, m/s: velocity relative
    to the air if the gust had not changed. airspeed m/s: it is the speed if no gust is measured.
    """
    gust.output.speed_relative_to_mean_air = airspeed
    if not gust.output.is_gust_measured:
        return
    decay_factor = np.exp(-gust.config.gust_velocity_decay_rate * dt)
    gust.memory.remaining_initial_gust_variance_share *= decay_factor * decay_factor
    gust.memory.gust_velocity_change_since_start[0] = (
        decay_factor * gust.memory.gust_velocity_change_since_start[0]
        + predicted_horizontal_velocity_ahead
        - gust.memory.air_relative_velocity[0]
    )
    gust.memory.gust_velocity_change_since_start[1] = (
        decay_factor * gust.memory.gust_velocity_change_since_start[1]
        + predicted_horizontal_velocity_right
        - gust.memory.air_relative_velocity[1]
    )
    gust.memory.gust_velocity_change_since_start[2] = (
        decay_factor * gust.memory.gust_velocity_change_since_start[2]
        + predicted_vertical_velocity_down
        - gust.memory.air_relative_velocity[2]
    )
    squared_speed_relative_to_mean_air = 0.0
    for i in range(3):
        gust.memory.gust_velocity_change_since_start[i] = min(
            max(gust.memory.gust_velocity_change_since_start[i], -gust.config.max_gust_velocity),
            gust.config.max_gust_velocity,
        )
        squared_speed_relative_to_mean_air += (
            gust.memory.air_relative_velocity[i] + gust.memory.gust_velocity_change_since_start[i]
        ) ** 2
    gust.output.speed_relative_to_mean_air = max(np.sqrt(squared_speed_relative_to_mean_air), 0.5 * airspeed)


@kernel
def set_gust_intensity_at_altitude(gust, measured_altitude_m):
    """Fill the intensity of turbulence at this altitude."""
    min_height_m = min_true_height_m(
        measured_altitude_m,
        gust.config.altitude_error_bound_at_zero_m,
        gust.config.altitude_error_bound_per_m,
    )
    gust.memory.gust_rotation_intensity_per_airspeed[0] = max(
        gust.config.gust_rotation_intensity_per_airspeed_aloft[0],
        gust.config.gust_rotation_intensity_per_airspeed_at_1_m[0] / min_height_m**1.5,
    )
    for gust_axis in range(1, 3):
        gust.memory.gust_rotation_intensity_per_airspeed[gust_axis] = max(
            gust.config.gust_rotation_intensity_per_airspeed_aloft[gust_axis],
            gust.config.gust_rotation_intensity_per_airspeed_at_1_m[gust_axis] / min_height_m,
        )


@kernel
def start_or_advance_gust_estimate(gust, y, attitude, dt, frame_index):
    """Start at frame 0, and update the gust at later frames; arguments as in `advance_gust_estimate`."""
    if frame_index > 0:
        advance_gust_estimate(gust, y, attitude, dt)
    else:
        start_gust_estimate(gust, y, attitude)


@kernel
def fill_gust_effect_and_specific_force(gust, design, x, y, u):
    """Fill `angular_acceleration_by_gust` (3,) rad/s2, the effect of the gust from now on, and
    `specific_force`, m/s2.

    x (3,) rad/s and y (5,) as measured; u (n,) rad: positions of healthy surfaces.
    """
    if gust.output.uses_accelerometers:
        gust.memory.specific_force[:] = gust.memory.accelerometer_reading
    elif gust.config.has_only_coarse_estimate:  # lift balances the weight, and turns with the bank
        gust.memory.specific_force[0] = gust.memory.specific_force[1] = 0.0
        gust.memory.specific_force[2] = -gust.config.gravity / max(
            gust.memory.level_to_body[2, 2], MIN_BANK_COSINE
        )
    else:
        fill_specific_force(gust, x, y, u, gust.memory.specific_force)
    rate_damping(design, x, y, u, gust.memory.scratch, gust.output.rate_damping)
    for i in range(3):
        air_rotation_about_body_axis = (
            gust.output.gust_axes_in_body[i, 1] * gust.memory.air_rotation_in_level_axes[1]
            + gust.output.gust_axes_in_body[i, 2] * gust.memory.air_rotation_in_level_axes[2]
        )
        gust.memory.air_rotation_in_body_axes[i] = (
            air_rotation_about_body_axis
            if gust.output.is_gust_measured or gust.config.has_only_coarse_estimate
            else 0.0
        )
    for i in range(3):
        acceleration_from_gust = 0.0
        for j in range(3):
            acceleration_from_gust -= (
                gust.output.rate_damping[i, j] * gust.memory.air_rotation_in_body_axes[j]
            )
        gust.output.angular_acceleration_by_gust[i], gust.output.angular_acceleration_by_coarse_gust[i] = (
            (acceleration_from_gust, 0.0) if gust.output.is_gust_measured else (0.0, acceleration_from_gust)
        )


@kernel
def begin_gust_sums_with_instant(gust, V, dt):
    """Start the sums over the next frame's instants, dt s apart, with this instant; V m/s."""
    gust.memory.angular_acceleration_by_gust_sum[:] = gust.output.angular_acceleration_by_gust
    add_acceleration_variance_by_axes_turn(gust, V, dt)


@kernel
def update_gust_and_sums(gust, design, x, y, u, attitude, dt):
    """Update gust and sums for an instant inside a frame, dt s after the instant before.

    Arguments as in `fill_gust_effect_and_specific_force`; attitude (3,) rad.
    """
    advance_gust_estimate(gust, y, attitude, dt)
    fill_gust_effect_and_specific_force(gust, design, x, y, u)
    for i in range(3):
        gust.memory.angular_acceleration_by_gust_sum[i] += gust.output.angular_acceleration_by_gust[i]
    add_acceleration_variance_by_axes_turn(gust, y[AIRSPEED], dt)


@kernel
def store_accelerometer_reading(gust, specific_force):
    """Keep the reading of the accelerometers, specific_force (3,) m/s2."""
    gust.memory.accelerometer_reading[:] = specific_force


@kernel
def stop_gust_estimate(gust):
    """Stop estimating the gust."""
    gust.output.accounts_for_gusts = 0


@kernel
def stop_using_accelerometers(gust):
    """Stop using the accelerometers.

    Without a model of the forces the gust is then unmeasured, and all of its variance counts as unknown.
    """
    gust.output.uses_accelerometers = 0
    if gust.output.is_gust_measured and not gust.config.has_force_model:
        gust.output.is_gust_measured, gust.memory.unmeasured_intensity_share[:] = 0, 1.0
        half_pitching_correlation_length_m = 0.5 * gust_correlation_length(gust, 1)
        half_yawing_correlation_length_m = 0.5 * gust_correlation_length(gust, 2)
        for i in range(3):
            for j in range(3):
                gust.memory.acceleration_variance_by_axes_turn_now[i, j] += (
                    half_pitching_correlation_length_m
                    * gust.memory.gust_rotation_intensity_per_airspeed[1]
                    * gust_effect_product(gust, gust.output.gust_axes_in_body, i, j, 1)
                )
                gust.memory.acceleration_variance_by_axes_turn_now[i, j] += (
                    half_yawing_correlation_length_m
                    * gust.memory.gust_rotation_intensity_per_airspeed[2]
                    * gust_effect_product(gust, gust.output.gust_axes_in_body, i, j, 2)
                )
        gust.memory.n_frames_left_with_axes_turn_variance = 3


@kernel
def unmeasured_gust_intensity_share(gust, gust_axis):
    """Share of the intensity of the gust about a gust axis that is unmeasured in this frame."""
    if gust_axis == 0:
        return min(gust.memory.unmeasured_intensity_share[gust_axis], 1.0)
    unmeasured_share_from_speed_error = (
        gust.config.unmeasured_share_per_speed_error_variance
        * (
            gust.config.speed_error_variance
            + gust.memory.remaining_initial_gust_variance_share * gust.config.gust_velocity_variance
        )
        / max(gust.output.speed_relative_to_mean_air, 1.0) ** 2
        if gust.output.is_gust_measured
        else 0.0
    )
    return min(
        gust.memory.unmeasured_intensity_share[gust_axis]
        + unmeasured_share_from_speed_error
        + (
            gust.memory.unmeasured_pitching_share_by_start
            if gust_axis == 1
            else gust.memory.unmeasured_yawing_share_by_past_turns
        ),
        1.0,
    )


@kernel
def intensity_scale_for_rolling_length(gust, gust_axis):
    """Power of the gust about a gust axis at low frequency, over that with the correlation length of the
    rolling gust.

    A gust of the rolling gust's length and with this share of the intensity has the same power at low
    frequency. It is 1 if vanes measure the gust: the spectrum of the unmeasured rest is not known.
    """
    return (
        (gust_correlation_length(gust, gust_axis) / gust.config.rolling_gust_correlation_length) ** 2
        if gust.config.has_only_coarse_estimate
        else 1.0
    )


@kernel
def gust_correlation_time_s(gust, gust_axis, V):
    """Lag of the gust about a gust axis, s, at a speed V m/s: its correlation length over V."""
    if gust_axis == 0:
        return gust.config.rolling_gust_correlation_length / V
    return (4.0 if gust_axis == 1 else 3.0) * gust.config.wing_span / (pi * V)


@kernel
def gust_correlation_length(gust, gust_axis):
    """Correlation length of the gust about a gust axis, m, as in `design.rotation_lengths`: lag at 1 m/s."""
    return gust_correlation_time_s(gust, gust_axis, 1.0)


@kernel
def unmeasured_gust_drift_intensity(gust, V, axis_i, axis_j, with_rolling_correlation_length=False):
    """Intensity, (rad/s2)2/s, of the drift of two accelerations by the unmeasured rotation; V m/s.

    with_rolling_correlation_length: that of a gust with the correlation length of the rolling gust and equal
    power at low frequency.
    """
    drift_intensity_per_airspeed = 0.0
    for gust_axis in range(3):
        intensity_scale = (
            intensity_scale_for_rolling_length(gust, gust_axis) if with_rolling_correlation_length else 1.0
        )
        drift_intensity_per_airspeed += (
            gust_effect_product(gust, gust.output.gust_axes_in_body, axis_i, axis_j, gust_axis)
            * unmeasured_gust_intensity_share(gust, gust_axis)
            * gust.memory.gust_rotation_intensity_per_airspeed[gust_axis]
            * intensity_scale
        )
    return drift_intensity_per_airspeed * max(V, gust.output.speed_relative_to_mean_air)


@kernel
def add_acceleration_variance_by_axes_turn(gust, V, dt):
    """Add to `acceleration_variance_by_axes_turn_now` the effect of the turn of the gusts' axes in dt s; V
    m/s."""
    if not gust.memory.has_fast_axes_turn:
        return
    rolling_intensity_per_squared_axes_rate = (
        0.5 * gust_correlation_time_s(gust, 0, V) ** 2 * gust.memory.gust_rotation_intensity_per_airspeed[0]
    )
    yawing_intensity_per_squared_axes_rate = (
        0.5
        * gust_correlation_time_s(gust, 2, V) ** 2
        * gust.memory.gust_rotation_intensity_per_airspeed[2]
        * gust.memory.unmeasured_yawing_share_by_past_turns
    )
    for i in range(3):
        for j in range(3):
            rolling_effect_rate_product = gust_effect_product(gust, gust.memory.gust_axes_rate, i, j, 0)
            yawing_effect_rate_product = gust_effect_product(gust, gust.memory.gust_axes_rate, i, j, 2)
            gust.memory.acceleration_variance_by_axes_turn_now[i, j] += (
                dt
                * V
                * (
                    rolling_intensity_per_squared_axes_rate * rolling_effect_rate_product
                    + yawing_intensity_per_squared_axes_rate * yawing_effect_rate_product
                )
            )
    gust.memory.n_frames_left_with_axes_turn_variance = 3


@kernel
def finish_gust_mean_and_turn_variance(gust, frame_share_per_instant):
    """Fill `mean_angular_acceleration_by_gust` and `acceleration_variance_by_axes_turn` for the elapsed
    frame.

    frame_share_per_instant: one over the number of instants. Axes may turn in the middle of a frame. A part
    of the effect is then in this frame and the rest in the next, so the variance counts in both frames.
    """
    for i in range(3):
        gust.output.mean_angular_acceleration_by_gust[i] = (
            frame_share_per_instant * gust.memory.angular_acceleration_by_gust_sum[i]
        )
    if gust.memory.n_frames_left_with_axes_turn_variance > 0:
        gust.memory.n_frames_left_with_axes_turn_variance -= 1
        for i in range(3):
            for j in range(3):
                gust.output.acceleration_variance_by_axes_turn[i, j] = (
                    gust.memory.acceleration_variance_by_axes_turn_before[i, j]
                    + gust.memory.acceleration_variance_by_axes_turn_now[i, j]
                )
                gust.memory.acceleration_variance_by_axes_turn_before[i, j] = (
                    gust.memory.acceleration_variance_by_axes_turn_now[i, j]
                )
                gust.memory.acceleration_variance_by_axes_turn_now[i, j] = 0.0


@kernel
def full_gust_drift_intensity(gust, V, body_axes_rate_sensitivity, body_axes_force_sensitivity):
    """Intensity, (rad/s2)2/s, of the drift by the whole rotation of the air, for a view without vanes.

    body_axes_rate_sensitivity, body_axes_force_sensitivity (3,) 1/s: gust sensitivity of the rates and of
    the forces, about the body axes.
    """
    drift_intensity_per_airspeed, rolling_lag_s = 0.0, gust_correlation_time_s(gust, 0, V)
    for gust_axis in range(3):
        rate_plus_force_sensitivity = abs(
            project_on_gust_axis(body_axes_rate_sensitivity, gust.output.gust_axes_in_body, gust_axis)
        ) + abs(project_on_gust_axis(body_axes_force_sensitivity, gust.output.gust_axes_in_body, gust_axis))
        drift_intensity_per_airspeed += (
            rate_plus_force_sensitivity**2 * gust.memory.gust_rotation_intensity_per_airspeed[gust_axis]
        )
        if gust.memory.has_fast_axes_turn:
            drift_intensity_per_airspeed += (
                0.5
                * rolling_lag_s
                * rolling_lag_s
                * gust.memory.gust_rotation_intensity_per_airspeed[gust_axis]
                * project_on_gust_axis(body_axes_rate_sensitivity, gust.memory.gust_axes_rate, gust_axis) ** 2
            )
    return drift_intensity_per_airspeed * max(V, gust.output.speed_relative_to_mean_air)


@kernel
def remaining_gust_drift_intensity(gust, V, body_axes_rate_sensitivity, body_axes_force_sensitivity):
    """Intensity, (rad/s2)2/s, of the drift that remains with the gust estimate subtracted from the rates.

    body_axes_rate_sensitivity, body_axes_force_sensitivity (3,) 1/s: gust sensitivities about the body axes.
    On the forces the whole rotation acts.
    """
    drift_intensity_per_airspeed = 0.0
    for gust_axis in range(3):
        unmeasured_sensitivity = np.sqrt(unmeasured_gust_intensity_share(gust, gust_axis)) * abs(
            project_on_gust_axis(body_axes_rate_sensitivity, gust.output.gust_axes_in_body, gust_axis)
        )
        drift_intensity_per_airspeed += (
            unmeasured_sensitivity
            + abs(project_on_gust_axis(body_axes_force_sensitivity, gust.output.gust_axes_in_body, gust_axis))
        ) ** 2 * gust.memory.gust_rotation_intensity_per_airspeed[gust_axis]
    return drift_intensity_per_airspeed * max(V, gust.output.speed_relative_to_mean_air)


@kernel
def project_on_gust_axis(body_axes_sensitivity, gust_axes_or_their_rate, gust_axis):
    """Sensitivity to the gust about a gust axis, from that (3,) to rotation about the body axes."""
    return (
        body_axes_sensitivity[0] * gust_axes_or_their_rate[0, gust_axis]
        + body_axes_sensitivity[1] * gust_axes_or_their_rate[1, gust_axis]
        + body_axes_sensitivity[2] * gust_axes_or_their_rate[2, gust_axis]
    )


@kernel
def gust_effect_product(gust, gust_axes_or_their_rate, axis_i, axis_j, gust_axis):
    """Product of the effects of the gust about a gust axis on two accelerations, per (rad/s)2.

    gust_axes_or_their_rate (3, 3): of the gusts, giving 1/s2; or their rate, 1/s, giving 1/s4.
    """
    effect_on_i, effect_on_j = 0.0, 0.0
    for k in range(3):
        effect_on_i += gust.output.rate_damping[axis_i, k] * gust_axes_or_their_rate[k, gust_axis]
        effect_on_j += gust.output.rate_damping[axis_j, k] * gust_axes_or_their_rate[k, gust_axis]
    return effect_on_i * effect_on_j


def configure_gust_estimate(gust: np.void, declared: Declared, mass_properties: MassProperties) -> None:
    """Fill the record with the declared turbulence, for an aircraft of this mass."""
    turbulence, sensor_errors, aircraft = declared.air, declared.sensors, declared.aircraft
    span_m = aircraft.geometry.span_m
    gust["output"]["accounts_for_gusts"] = turbulence.moves
    gust["config"]["has_force_model"] = bool(aircraft.measurable_forces)
    gust["output"]["is_gust_measured"] = (
        gust["config"]["has_force_model"] or gust["output"]["uses_accelerometers"]
    )  # only where forces are known
    gust["config"]["has_only_coarse_estimate"] = (
        gust["output"]["accounts_for_gusts"] and not gust["output"]["is_gust_measured"]
    )
    fill_table(gust["memory"]["force_table"], aircraft, aircraft.measurable_forces, FORCES)
    gust["config"]["wing_area_per_mass"] = aircraft.geometry.wing_area_m2 / mass_properties.mass_kg
    gust["config"]["gravity"] = GRAVITY_MPS2  # standard; what is constant has no part in a change of the gust
    gust["config"]["wing_span"] = span_m
    gust["config"]["gust_rotation_intensity_per_airspeed_aloft"] = turbulence.rotation_walk(span_m)
    gust["config"]["gust_rotation_intensity_per_airspeed_at_1_m"] = turbulence.rotation_walk_at_1_m(span_m)
    gust["memory"]["gust_rotation_intensity_per_airspeed"], gust["memory"]["unmeasured_intensity_share"] = (
        gust["config"]["gust_rotation_intensity_per_airspeed_aloft"],
        MIN_UNMEASURED_GUST_INTENSITY_SHARES if gust["output"]["is_gust_measured"] else 1.0,
    )
    gust["config"]["altitude_error_bound_at_zero_m"] = sensor_errors["altitude"].worst
    gust["config"]["altitude_error_bound_per_m"] = sensor_errors["altitude"].slope
    gust["config"]["turbulence_scale_length"] = SCALE_M
    gust["config"]["rolling_gust_correlation_length"] = rotation_lengths(span_m)[0]


def fill_and_add_gust_estimate_noise(
    statistical_detector: np.void,
    sensor_errors: SensorErrors,
    design: np.void,
    y: np.ndarray,
    u: np.ndarray,
    dt_s: float,
) -> None:
    """Add the noise of the gust estimate to the model noise of the detector.

    It is the noise of the vanes and of the force that predicts the velocity; for the estimate without vanes
    that of the forces as well. y, u: in trim.
    """
    flow_angle_noise_std = flow_angle_in_level_axes_noise_std(sensor_errors, y[AIRSPEED])
    span_m = float(statistical_detector["gust"]["config"]["wing_span"])
    if (
        statistical_detector["forces"]["in_use"]
        or statistical_detector["gust"]["output"]["uses_accelerometers"]
    ):
        flow_angle_noise_std += (
            ADAMS_BASHFORTH_NOISE_GAIN * sensor_errors.each("random", ("az", "ay")) * dt_s / y[AIRSPEED]
        )
    if statistical_detector["forces"]["in_use"]:
        force_records_normal_first = statistical_detector["forces"]["component"][
            ::-1
        ]  # normal to the body, and across
        flow_angle_noise_std_from_forces = np.sqrt(
            force_records_normal_first["accelerometer_innovation_variance"]
        ) / np.abs(force_records_normal_first["axis_and_force_innovation_per_vane_error"][:, 1])
        statistical_detector["forces"]["angular_acceleration_by_gust_noise_std"] = (
            angular_acceleration_by_gust_noise_std(flow_angle_noise_std_from_forces, design, y, u, span_m)
        )
    for field_name in ("acceleration_variance_without_air_data", "acceleration_variance_by_input_noise"):
        statistical_detector["noise"][field_name] += (
            angular_acceleration_by_gust_noise_std(flow_angle_noise_std, design, y, u, span_m) ** 2
        )


def configure_gust_velocity_and_speed_error(
    gust: np.void, declared: Declared, alarm_level: float, airspeed_mps: float
) -> None:
    """Fill the decay rate of the gust velocity and the error variance of the speed; airspeed_mps: in trim.

    alarm_level: of the alarm, standard deviations. An acceleration error b, m/s2, gives the sum, of
    decay rate a, 1/s, an error b / a. Of a gust of deviation sigma and return rate V / L the sum misses the
    variance sigma^2 a / (a + V / L). Their total is least near a^3 = 2 b^2 V / (L sigma^2).
    """
    gust_velocity_std_mps, sensor_errors = declared.air.sigma_mps, declared.sensors
    if not (gust["output"]["accounts_for_gusts"] and gust["output"]["is_gust_measured"]):
        return
    gust_return_rate_per_s, airspeed_errors = airspeed_mps / SCALE_M, sensor_errors["V"]
    acceleration_error_bound = (
        2.0 * EARTH_RATE_RAD_S * airspeed_mps + MAX_PATH_SLOPE_RAD * EARTH_ACCELERATION_BOUND_M_S2
    )  # Coriolis; gravity with place
    acceleration_error_bound += GRAVITY_MPS2 * (sensor_errors["phi"].steady + sensor_errors["theta"].steady)
    if gust["output"]["uses_accelerometers"]:
        acceleration_error_bound += (
            sensor_errors["ax"].steady + GRAVITY_MPS2 * MAX_DRAG_OVER_WEIGHT * sensor_errors["ax"].slope
        )
    else:
        acceleration_error_bound += (
            GRAVITY_MPS2 * MAX_DRAG_OVER_WEIGHT * (declared.coefficients.largest + MASS_TOLERANCE)
        )
    gust_velocity_decay_rate = (
        2.0 * acceleration_error_bound**2 * gust_return_rate_per_s / gust_velocity_std_mps**2
    ) ** (1.0 / 3.0)
    gust["config"]["gust_velocity_variance"] = gust_velocity_std_mps**2
    gust["config"]["max_gust_velocity"] = MAX_GUST_VELOCITY_OVER_STD * gust_velocity_std_mps
    gust["config"]["gust_velocity_decay_rate"] = gust_velocity_decay_rate
    gust["config"]["speed_error_variance"] = (
        gust_velocity_std_mps**2
        * gust_velocity_decay_rate
        / (gust_velocity_decay_rate + gust_return_rate_per_s)
        + (acceleration_error_bound / gust_velocity_decay_rate) ** 2
        + airspeed_errors.random**2
    )
    gust["config"]["speed_error_variance"] += (
        airspeed_errors.steady + airspeed_errors.slope * airspeed_mps
    ) ** 2
    gust["config"]["unmeasured_share_per_speed_error_variance"] = unmeasured_share_per_speed_error_variance(
        alarm_level
    )


def unmeasured_share_per_speed_error_variance(alarm_level: float) -> float:
    """Share of a gust's intensity that a relative error e of the speed leaves, over the variance of e.

    The error adds (e / tau) q to the gust's equation. Its spectrum is e^2 (w / tau)^2 / (w^2 + 1 / tau^2)^2
    times that of a random walk of the gust's intensity: e^2 / 4 at most. e is normal and independent of the
    noise. The product of two normal numbers exceeds x deviations with a probability of exp(-x). This equals
    that of the alarm level, exp(-level^2 / 2), if e is taken to be level / 2 deviations.
    """
    return (0.5 * alarm_level) ** 2 / 4.0
