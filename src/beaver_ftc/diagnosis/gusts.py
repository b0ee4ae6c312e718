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
`gust_velocity` is that sum, with a decay as slow as this drift permits. A relative error e of V leaves at
most e^2 / 4 of the gust's intensity unmeasured (`speed_error_share`).

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
from beaver_ftc.design.air import SCALE_M, rotation_lengths
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
from beaver_ftc.diagnosis.bounds import flow_angle_noise, gust_estimate_noise, lowest_height
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_ACCELERATION_M_S2
from beaver_ftc.plant.instruments import wrapped
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors

# Share of the intensity of the rolling, pitching and yawing gust that remains unmeasured with vanes. With
# exact vanes and over a filter's memory it is smaller (`tests/diagnosis/belief/test_air.py`).
UNMEASURED_SHARES = (1.0, 0.003, 0.03)
FORCE_ERROR_SHARE = 0.01  # share left unmeasured by an error of a tenth in the forces
TWO_STEP_NOISE = 1.6  # noise gain of the two-step method: sqrt(1.5^2 + 0.5^2)
MIN_BANK_COSINE = 0.5  # cosine of the steepest bank at which lift is assumed to balance the weight
MAX_GUST_SIGMA = 4.0  # limit of the estimated gust velocity, standard deviations
MAX_PATH_SLOPE_RAD = 0.3  # of the path, along which gravity acts
MAX_DRAG_OVER_WEIGHT = 0.3  # upper limit of drag over weight: errors of coefficients are a share of it
MIN_AXES_TURN = 0.01  # share of a gust's own intensity below which the turn of its axes is ignored

CONFIG = record(
    has_force_model=int,  # whether the design model has forces
    coarse=int,  # whether only a coarse estimate of the gust is possible
    area_per_mass=float, gravity=float, span=float,  # m2/kg, m/s2, m
    # Intensity over airspeed of the drift of the rotation: above 2000 ft; at a height of 1 m.
    intensity_aloft=3, intensity_at_1_m=3,
    altitude_error=float, altitude_slope=float,  # bound on the altimeter's error: m; share of the reading
    max_gust=float, decay_rate=float,  # limit of a gust component, m/s; decay of `gust_velocity`, 1/s
    # Error variance of the speed, (m/s)2; variance of the gust, (m/s)2; share of a gust's intensity that a
    # relative error of the speed leaves, over the variance of that error.
    speed_variance=float, gust_variance=float, error_gain=float,
    rolling_length=float,  # lag of the rolling gust times airspeed, m
    turbulence_length=float,  # of the gusts, m
    in_flight=int,  # whether the diagnosis starts in flight, where a gust may already be present
)  # fmt: skip

MEMORY = record(
    started=int,  # whether `acceleration_before` is valid
    measured=3,  # reading of the accelerometers, m/s2
    force_table=TABLE, scratch=MAX_MONOMIALS,  # force coefficients, evaluated at this instant
    # Velocity relative to the air, m/s in level axes; specific force, m/s2 in body axes; attitude.
    velocity=3, force=3, level_to_body=(3, 3), heading=float,
    acceleration_before=3,  # an instant before, by forces and gravity, m/s2 in the level axes of this one
    gust=3, rotation=3,  # rotation of the air, rad/s: in level axes, in body axes
    acceleration_sum=3,  # sum of `acceleration` over the instants of a frame, rad/s2
    intensity=3,  # intensity over airspeed of the drift of the rotation at this height, rad2/s3 per m/s
    unmeasured_share=3,  # share of it that the vanes do not measure
    # Change of the gust's velocity since the start, m/s ahead, right, down; share of the variance of the
    # initial gust that still counts.
    gust_velocity=3, initial_share=float,
    # Unmeasured shares: of the yawing gust by the turn at this instant, and decaying since earlier turns; of
    # the pitching gust that was present when the diagnosis started.
    lost_share=float, turning_share=float, start_share=float,
    axes_rate=(3, 3), axes_turn_fast=int,  # turn of the gusts' axes in the body, 1/s; whether it counts
    # Variance of the accelerations by that turn, (rad/s2)2: in the current frame, in the frame before; number
    # of frames for which there is any.
    turn_variance_now=(3, 3), turn_variance_before=(3, 3), turn_frames=int,
)  # fmt: skip

OUTPUT = record(
    # Whether there is turbulence; whether accelerometers are used; whether the gust is measured. These are
    # filled by configure, and end with the accelerometers.
    moving=int, uses_accelerometers=int, measures_gust=int,
    acceleration=3, mean=3,  # effect of the measured gust, rad/s2: at this instant; mean of the elapsed frame
    coarse_acceleration=3,  # effect of the coarse estimate, rad/s2
    turn_variance=(3, 3),  # `turn_variance_now` plus `turn_variance_before`, (rad/s2)2
    speed=float,  # relative to the mean air, m/s
    damping=(3, 3), axes=(3, 3),  # 1/s; rotation from the gusts' axes to body axes
)  # fmt: skip

GUST_RECORD = record(config=CONFIG, memory=MEMORY, output=OUTPUT)


@kernel
def fill_specific_force(air, x, y, u, out):
    """Fill out (3,) m/s2 with the aerodynamic and propulsive force over mass in body axes, by the model.

    x (3,) rad/s, y (4 + declared,), u (n,) rad. The term of the rate of sideslip is omitted: it is below a
    hundredth of the side force.
    """
    table = air.memory.force_table
    evaluate(table, x, y)
    for i in range(3):
        out[i] = y[QDYN] * air.config.area_per_mass * whole_sum(table, i, table.power, u)


@kernel
def fill_level_axes(phi, theta, turn):
    """Fill turn (3, 3), the rotation from level axes (forward, right, down) to body axes; angles rad."""
    sin_phi, cos_phi, sin_theta, cos_theta = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    turn[0, 0], turn[0, 1], turn[0, 2] = cos_theta, 0.0, -sin_theta
    turn[1, 0], turn[1, 1], turn[1, 2] = sin_phi * sin_theta, cos_phi, sin_phi * cos_theta
    turn[2, 0], turn[2, 1], turn[2, 2] = cos_phi * sin_theta, -sin_phi, cos_phi * cos_theta


@kernel
def to_level(turn, body, i):
    """Component i in level axes of a vector (3,) in body axes."""
    return turn[0, i] * body[0] + turn[1, i] * body[1] + turn[2, i] * body[2]


@kernel
def measure_air_velocity(air, y, attitude):
    """Fill attitude, heading and velocity relative to the air, m/s in level axes, of this instant.

    y (5,) and attitude (3,) rad as measured.
    """
    alpha, beta, V = y[ALPHA], y[BETA], y[AIRSPEED]
    fill_level_axes(attitude[0], attitude[1], air.memory.level_to_body)
    air.memory.heading = attitude[2]
    u, v, w = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    for i in range(3):
        air.memory.velocity[i] = (
            air.memory.level_to_body[0, i] * u
            + air.memory.level_to_body[1, i] * v
            + air.memory.level_to_body[2, i] * w
        )


@kernel
def start_gust_estimate(air, y, attitude):
    """Start at the first frame of a diagnosis: the estimated gust is zero.

    If the diagnosis begins in flight, a gust may be present already; it counts as unmeasured and decays.
    """
    measure_air_velocity(air, y, attitude)
    update_gust_axes(air, 0.0, 1.0)
    air.memory.gust[:] = 0.0
    air.memory.started, air.memory.lost_share = 0, 0.0
    air.memory.turning_share = air.memory.start_share = air.memory.initial_share = float(air.config.in_flight)
    air.memory.gust_velocity[:], air.output.speed = 0.0, y[AIRSPEED]
    (
        air.memory.turn_variance_now[:],
        air.memory.turn_variance_before[:],
        air.output.turn_variance[:],
        air.memory.turn_frames,
    ) = 0.0, 0.0, 0.0, 0


@kernel
def update_gust_axes(air, sin, cos):
    """Fill `axes` for this instant, and keep those of the instant before in `axes_rate`.

    sin, cos: of the change of heading. JSBSim's gusts have the heading of the step before.
    """
    air.memory.axes_rate[:] = air.output.axes
    for i in range(3):
        ahead, right = air.memory.level_to_body[i, 0], air.memory.level_to_body[i, 1]
        air.output.axes[i, 0], air.output.axes[i, 1] = ahead * cos - right * sin, ahead * sin + right * cos
        air.output.axes[i, 2] = air.memory.level_to_body[i, 2]


@kernel
def update_axes_rate(air, dt, V):
    """Fill `axes_rate`, 1/s: how fast the axes of the gusts turn in the body; dt s since the instant before.

    A constant unmeasured gust of deviation sigma = sqrt(intensity lag / 2) then changes in body axes at the
    rate sigma axes_rate. Over its lag this equals a random walk of (axes_rate lag)^2 / 2 times its intensity.
    """
    most = 0.0
    for i in range(3):
        for g in range(3):
            air.memory.axes_rate[i, g] = (air.output.axes[i, g] - air.memory.axes_rate[i, g]) / dt
            most = max(most, abs(air.memory.axes_rate[i, g]))
    air.memory.axes_turn_fast = 0.5 * (most * air.config.rolling_length / V) ** 2 > MIN_AXES_TURN


@kernel
def share_lost_by_turning(air, V, rate):
    """Share of the yawing gust's intensity that is unmeasured while the heading turns at `rate` rad/s.

    The gusts turn with the aircraft: a gust from ahead, of deviation sigma, becomes one from the side. This
    adds a change of rate sigma to the walk of intensity 3 sigma^2 V / turbulence_length. The share is the
    ratio of their squares over the lag of the yawing gust, 3 span / pi V.
    """
    return rate * rate * air.config.span * air.config.turbulence_length / (pi * V * V)


@kernel
def update_gust(air, y, attitude, dt):
    """Update `gust` (3,) rad/s in level axes for the elapsed dt s; the rolling gust stays unknown.

    y (5,) and attitude (3,) rad as measured now; `force` and attitude in memory are those dt s ago. If the
    heading turns so fast that the vanes mostly measure this turn, as when the nose passes the vertical, the
    yawing gust only decays. It does so one instant longer: JSBSim's gusts turn a step after the heading.
    """
    pulled = air.memory.scratch
    for i in range(3):
        pulled[i] = to_level(air.memory.level_to_body, air.memory.force, i)
    pulled[2] += air.config.gravity
    if not air.memory.started:
        air.memory.acceleration_before[:] = pulled[:3]
        air.memory.started = 1
    for i in range(3):
        air.memory.velocity[i] += dt * (1.5 * pulled[i] - 0.5 * air.memory.acceleration_before[i])
    turned = wrapped(attitude[2] - air.memory.heading)
    sin, cos = np.sin(turned), np.cos(turned)
    ahead, right = (
        air.memory.velocity[0] * cos + air.memory.velocity[1] * sin,
        air.memory.velocity[1] * cos - air.memory.velocity[0] * sin,
    )
    down = air.memory.velocity[2]
    air.memory.acceleration_before[0], air.memory.acceleration_before[1] = (
        pulled[0] * cos + pulled[1] * sin,
        pulled[1] * cos - pulled[0] * sin,
    )
    air.memory.acceleration_before[2] = pulled[2]
    measure_air_velocity(air, y, attitude)
    update_speed(air, ahead, right, down, y[AIRSPEED], dt)
    V = air.output.speed
    update_gust_axes(air, sin, cos)
    update_axes_rate(air, dt, V)
    pitching, yawing = 4.0 * air.config.span / (pi * V), 3.0 * air.config.span / (pi * V)  # lags, s
    before, air.memory.lost_share = air.memory.lost_share, share_lost_by_turning(air, V, turned / dt)
    lost = max(before, air.memory.lost_share)
    air.memory.turning_share = min(max(np.exp(-dt / yawing) * air.memory.turning_share, lost), 1.0)
    air.memory.start_share *= np.exp(-dt / pitching)
    air.memory.gust[1] = np.exp(-dt / pitching) * air.memory.gust[1] + (down - air.memory.velocity[2]) / (
        V * pitching
    )
    air.memory.gust[2] = np.exp(-dt / yawing) * air.memory.gust[2]
    if lost < 1.0:
        air.memory.gust[2] += (right - air.memory.velocity[1]) / (V * yawing)
    else:
        air.memory.gust_velocity[:], air.memory.initial_share = 0.0, 1.0


@kernel
def update_speed(air, ahead, right, down, V, dt):
    """Update `gust_velocity` and `speed` for the elapsed dt s.

    ahead, right, down, m/s: the velocity relative to the air if the gust had not changed. V m/s: airspeed; it
    is the speed if no gust is measured.
    """
    air.output.speed = V
    if not air.output.measures_gust:
        return
    kept = np.exp(-air.config.decay_rate * dt)
    air.memory.initial_share *= kept * kept
    air.memory.gust_velocity[0] = kept * air.memory.gust_velocity[0] + ahead - air.memory.velocity[0]
    air.memory.gust_velocity[1] = kept * air.memory.gust_velocity[1] + right - air.memory.velocity[1]
    air.memory.gust_velocity[2] = kept * air.memory.gust_velocity[2] + down - air.memory.velocity[2]
    squared = 0.0
    for i in range(3):
        air.memory.gust_velocity[i] = min(
            max(air.memory.gust_velocity[i], -air.config.max_gust), air.config.max_gust
        )
        squared += (air.memory.velocity[i] + air.memory.gust_velocity[i]) ** 2
    air.output.speed = max(np.sqrt(squared), 0.5 * V)


@kernel
def set_gust_intensity(air, altitude):
    """Fill the intensity of turbulence at this altitude, m as measured."""
    height = lowest_height(altitude, air.config.altitude_error, air.config.altitude_slope)
    air.memory.intensity[0] = max(air.config.intensity_aloft[0], air.config.intensity_at_1_m[0] / height**1.5)
    for g in range(1, 3):
        air.memory.intensity[g] = max(air.config.intensity_aloft[g], air.config.intensity_at_1_m[g] / height)


@kernel
def update_gust_estimate(air, y, attitude, dt, k):
    """Start at frame k = 0, and update the gust at later frames; arguments as in `update_gust`."""
    if k > 0:
        update_gust(air, y, attitude, dt)
    else:
        start_gust_estimate(air, y, attitude)


@kernel
def fill_gust_effect(air, design, x, y, u):
    """Fill `acceleration` (3,) rad/s2, the effect of the gust from this instant on, and `force`, m/s2.

    x (3,) rad/s and y (5,) as measured; u (n,) rad: positions of healthy surfaces.
    """
    if air.output.uses_accelerometers:
        air.memory.force[:] = air.memory.measured
    elif air.config.coarse:  # lift balances the weight, and turns with the bank
        air.memory.force[0] = air.memory.force[1] = 0.0
        air.memory.force[2] = -air.config.gravity / max(air.memory.level_to_body[2, 2], MIN_BANK_COSINE)
    else:
        fill_specific_force(air, x, y, u, air.memory.force)
    rate_damping(design, x, y, u, air.memory.scratch, air.output.damping)
    for i in range(3):
        known = air.output.axes[i, 1] * air.memory.gust[1] + air.output.axes[i, 2] * air.memory.gust[2]
        air.memory.rotation[i] = known if air.output.measures_gust or air.config.coarse else 0.0
    for i in range(3):
        moved = 0.0
        for j in range(3):
            moved -= air.output.damping[i, j] * air.memory.rotation[j]
        air.output.acceleration[i], air.output.coarse_acceleration[i] = (
            (moved, 0.0) if air.output.measures_gust else (0.0, moved)
        )


@kernel
def begin_gust_sums(air, V, dt):
    """Start the sums over the next frame's instants, dt s apart, with this instant; V m/s."""
    air.memory.acceleration_sum[:] = air.output.acceleration
    add_axes_turn_variance(air, V, dt)


@kernel
def accumulate_gust_substep(air, design, x, y, u, attitude, dt):
    """Update gust and sums for an instant inside a frame, dt s after the instant before.

    Arguments as in `fill_gust_effect`; attitude (3,) rad.
    """
    update_gust(air, y, attitude, dt)
    fill_gust_effect(air, design, x, y, u)
    for i in range(3):
        air.memory.acceleration_sum[i] += air.output.acceleration[i]
    add_axes_turn_variance(air, y[AIRSPEED], dt)


@kernel
def store_accelerometers(air, force):
    """Keep the reading of the accelerometers, force (3,) m/s2."""
    air.memory.measured[:] = force


@kernel
def stop_gust_filter(air):
    """Stop estimating the gust."""
    air.output.moving = 0


@kernel
def stop_accelerometers(air):
    """Stop using the accelerometers.

    Without a model of the forces the gust is then unmeasured, and all of its variance counts as unknown.
    """
    air.output.uses_accelerometers = 0
    if air.output.measures_gust and not air.config.has_force_model:
        air.output.measures_gust, air.memory.unmeasured_share[:] = 0, 1.0
        pitching, yawing = 0.5 * return_length(air, 1), 0.5 * return_length(air, 2)
        for i in range(3):
            for j in range(3):
                air.memory.turn_variance_now[i, j] += (
                    pitching * air.memory.intensity[1] * effect_product(air, air.output.axes, i, j, 1)
                )
                air.memory.turn_variance_now[i, j] += (
                    yawing * air.memory.intensity[2] * effect_product(air, air.output.axes, i, j, 2)
                )
        air.memory.turn_frames = 3


@kernel
def unmeasured_share(air, g):
    """Share of the intensity of the gust about axis g that is unmeasured in this frame."""
    if g == 0:
        return min(air.memory.unmeasured_share[g], 1.0)
    off = (
        air.config.error_gain
        * (air.config.speed_variance + air.memory.initial_share * air.config.gust_variance)
        / max(air.output.speed, 1.0) ** 2
        if air.output.measures_gust
        else 0.0
    )
    return min(
        air.memory.unmeasured_share[g]
        + off
        + (air.memory.start_share if g == 1 else air.memory.turning_share),
        1.0,
    )


@kernel
def low_frequency_power_ratio(air, g):
    """Power of the gust about axis g at low frequency, over that with the return length of the rolling gust.

    It is 1 if vanes measure the gust: the spectrum of the unmeasured rest is not known.
    """
    return (return_length(air, g) / air.config.rolling_length) ** 2 if air.config.coarse else 1.0


@kernel
def return_length(air, g):
    """Return length of the gust about axis g, m: lag times speed, as in `design.dryden.rotation_lengths`."""
    return air.config.rolling_length if g == 0 else (4.0 if g == 1 else 3.0) * air.config.span / pi


@kernel
def unmeasured_gust_drift(air, V, i, j, slow=False):
    """Intensity, (rad/s2)2/s, of the drift of accelerations i and j by the unmeasured rotation; V m/s.

    slow: that of a gust with the return length of the rolling gust and equal power at low frequency.
    """
    total = 0.0
    for g in range(3):
        share = low_frequency_power_ratio(air, g) if slow else 1.0
        total += (
            effect_product(air, air.output.axes, i, j, g)
            * unmeasured_share(air, g)
            * air.memory.intensity[g]
            * share
        )
    return total * max(V, air.output.speed)


@kernel
def add_axes_turn_variance(air, V, dt):
    """Add to `turn_variance_now` the effect of the turn of the gusts' axes in dt s; V m/s."""
    if not air.memory.axes_turn_fast:
        return
    rolling = 0.5 * (air.config.rolling_length / V) ** 2 * air.memory.intensity[0]
    yawing = (
        0.5 * (3.0 * air.config.span / (pi * V)) ** 2 * air.memory.intensity[2] * air.memory.turning_share
    )
    for i in range(3):
        for j in range(3):
            roll, yaw = (
                effect_product(air, air.memory.axes_rate, i, j, 0),
                effect_product(air, air.memory.axes_rate, i, j, 2),
            )
            air.memory.turn_variance_now[i, j] += dt * V * (rolling * roll + yawing * yaw)
    air.memory.turn_frames = 3


@kernel
def average_gust_frame(air, share):
    """Fill `mean` and `turn_variance` for the elapsed frame; share: one over its number of instants.

    Axes may turn in the middle of a frame. A part of the effect is then in this frame and the rest in the
    next, so the variance counts in both frames.
    """
    for i in range(3):
        air.output.mean[i] = share * air.memory.acceleration_sum[i]
    if air.memory.turn_frames > 0:
        air.memory.turn_frames -= 1
        for i in range(3):
            for j in range(3):
                air.output.turn_variance[i, j] = (
                    air.memory.turn_variance_before[i, j] + air.memory.turn_variance_now[i, j]
                )
                air.memory.turn_variance_before[i, j], air.memory.turn_variance_now[i, j] = (
                    air.memory.turn_variance_now[i, j],
                    0.0,
                )


@kernel
def full_gust_drift(air, V, sensitivity, gust_on_forces):
    """Intensity, (rad/s2)2/s, of the drift by the whole rotation of the air, for a view without vanes.

    sensitivity, by_forces (3,) 1/s: gust sensitivity of the rates and of the forces, about the body axes.
    """
    total, longest_s = 0.0, air.config.rolling_length / V
    for g in range(3):
        by_both = abs(project_on_axis(sensitivity, air.output.axes, g)) + abs(
            project_on_axis(gust_on_forces, air.output.axes, g)
        )
        total += by_both**2 * air.memory.intensity[g]
        if air.memory.axes_turn_fast:
            total += (
                0.5
                * longest_s
                * longest_s
                * air.memory.intensity[g]
                * project_on_axis(sensitivity, air.memory.axes_rate, g) ** 2
            )
    return total * max(V, air.output.speed)


@kernel
def remaining_gust_drift(air, V, gust_on_rates, gust_on_forces):
    """Intensity, (rad/s2)2/s, of the drift that remains with the gust estimate subtracted from the rates.

    gust_on_rates, gust_on_forces (3,) 1/s: gust sensitivities about the body axes. On the forces the whole
    rotation acts.
    """
    total = 0.0
    for g in range(3):
        of_rates = np.sqrt(unmeasured_share(air, g)) * abs(project_on_axis(gust_on_rates, air.output.axes, g))
        total += (
            of_rates + abs(project_on_axis(gust_on_forces, air.output.axes, g))
        ) ** 2 * air.memory.intensity[g]
    return total * max(V, air.output.speed)


@kernel
def project_on_axis(sensitivity, axes, g):
    """Sensitivity to the gust about its axis g, from the sensitivity (3,) to rotation about the body axes."""
    return sensitivity[0] * axes[0, g] + sensitivity[1] * axes[1, g] + sensitivity[2] * axes[2, g]


@kernel
def effect_product(air, axes, i, j, g):
    """Product of the effects of the gust about axis g on accelerations i and j, per (rad/s)2.

    axes (3, 3): of the gusts, giving 1/s2; or their rate, 1/s, giving 1/s4.
    """
    on_i, on_j = 0.0, 0.0
    for k in range(3):
        on_i += air.output.damping[i, k] * axes[k, g]
        on_j += air.output.damping[j, k] * axes[k, g]
    return on_i * on_j


def configure_gusts(air: np.void, declared: Declared, mass: MassProperties) -> None:
    """Fill the record with the declared turbulence, for an aircraft of this mass."""
    turbulence, errors, aircraft = declared.air, declared.sensors, declared.aircraft
    span_m = aircraft.geometry.span_m
    air["output"]["moving"], air["config"]["has_force_model"] = (
        turbulence.moves,
        bool(aircraft.measurable_forces),
    )
    air["output"]["measures_gust"] = (
        air["config"]["has_force_model"] or air["output"]["uses_accelerometers"]
    )  # only where forces are known
    air["config"]["coarse"] = air["output"]["moving"] and not air["output"]["measures_gust"]
    fill_table(air["memory"]["force_table"], aircraft, aircraft.measurable_forces, FORCES)
    air["config"]["area_per_mass"] = aircraft.geometry.wing_area_m2 / mass.mass_kg
    air["config"]["gravity"] = GRAVITY_MPS2  # standard; what is constant has no part in a change of the gust
    air["config"]["span"] = span_m
    air["config"]["intensity_aloft"], air["config"]["intensity_at_1_m"] = (
        turbulence.rotation_walk(span_m),
        turbulence.rotation_walk_at_1_m(span_m),
    )
    air["memory"]["intensity"], air["memory"]["unmeasured_share"] = (
        air["config"]["intensity_aloft"],
        UNMEASURED_SHARES if air["output"]["measures_gust"] else 1.0,
    )
    air["config"]["altitude_error"], air["config"]["altitude_slope"] = (
        errors["altitude"].worst,
        errors["altitude"].slope,
    )
    air["config"]["turbulence_length"] = SCALE_M
    air["config"]["rolling_length"] = rotation_lengths(span_m)[0]


def add_gust_jitter(
    statistical: np.void, errors: SensorErrors, design: np.void, y: np.ndarray, u: np.ndarray, dt_s: float
) -> None:
    """Add the noise of the gust estimate to the jitter of the detector.

    It is the noise of the vanes and of the force that predicts the velocity; for the estimate without vanes
    that of the forces as well. y, u: in trim.
    """
    flow, span_m = flow_angle_noise(errors, y[AIRSPEED]), float(statistical["air"]["config"]["span"])
    if statistical["forces"]["known"] or statistical["air"]["output"]["uses_accelerometers"]:
        flow += TWO_STEP_NOISE * errors.each("random", ("az", "ay")) * dt_s / y[AIRSPEED]
    if statistical["forces"]["known"]:
        forces = statistical["forces"]["component"][::-1]  # normal to the body, and across
        by_force = np.sqrt(forces["accelerometer_variance"]) / np.abs(forces["vane"][:, 1])
        statistical["forces"]["gust_noise"] = gust_estimate_noise(by_force, design, y, u, span_m)
    for name in ("own_jitter", "jitter"):
        statistical["noise"][name] += gust_estimate_noise(flow, design, y, u, span_m) ** 2


def configure_speed_error(air: np.void, declared: Declared, level: float, airspeed_mps: float) -> None:
    """Fill the decay rate of the gust velocity and the error variance of the speed; airspeed_mps: in trim.

    level: of the alarm, standard deviations. An acceleration error b, m/s2, gives the sum, of
    decay rate a, 1/s, an error b / a. Of a gust of deviation sigma and return rate V / L the sum misses the
    variance sigma^2 a / (a + V / L). Their total is least near a^3 = 2 b^2 V / (L sigma^2).
    """
    sigma, errors = declared.air.sigma_mps, declared.sensors
    if not (air["output"]["moving"] and air["output"]["measures_gust"]):
        return
    return_rate, V = airspeed_mps / SCALE_M, errors["V"]
    drift = (
        2.0 * EARTH_RATE_RAD_S * airspeed_mps + MAX_PATH_SLOPE_RAD * EARTH_ACCELERATION_M_S2
    )  # Coriolis; gravity with place
    drift += GRAVITY_MPS2 * (errors["phi"].steady + errors["theta"].steady)
    if air["output"]["uses_accelerometers"]:
        drift += errors["ax"].steady + GRAVITY_MPS2 * MAX_DRAG_OVER_WEIGHT * errors["ax"].slope
    else:
        drift += GRAVITY_MPS2 * MAX_DRAG_OVER_WEIGHT * (declared.coefficients.largest + MASS_TOLERANCE)
    decay_rate = (2.0 * drift**2 * return_rate / sigma**2) ** (1.0 / 3.0)
    air["config"]["gust_variance"], air["config"]["max_gust"], air["config"]["decay_rate"] = (
        sigma**2,
        MAX_GUST_SIGMA * sigma,
        decay_rate,
    )
    air["config"]["speed_variance"] = (
        sigma**2 * decay_rate / (decay_rate + return_rate) + (drift / decay_rate) ** 2 + V.random**2
    )
    air["config"]["speed_variance"] += (V.steady + V.slope * airspeed_mps) ** 2
    air["config"]["error_gain"] = speed_error_share(level)


def speed_error_share(level: float) -> float:
    """Share of a gust's intensity that a relative error e of the speed leaves, over the variance of e.

    The error adds (e / tau) q to the gust's equation. Its spectrum is e^2 (w / tau)^2 / (w^2 + 1 / tau^2)^2
    times that of a random walk of the gust's intensity: e^2 / 4 at most. e is normal and independent of the
    noise. The product of two normal numbers exceeds x deviations with a probability of exp(-x). This equals
    that of the alarm level, exp(-level^2 / 2), if e is taken to be level / 2 deviations.
    """
    return (0.5 * level) ** 2 / 4.0
