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
from beaver_ftc.design.air import LEAST_HEIGHT_M, Dryden
from beaver_ftc.design.context import DesignFunctions
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA, gust_effect
from beaver_ftc.diagnosis.detection.filters import bound_step, noise_step
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
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS, frames_apart, sensor_words

TURN, ANGLE, SPEED, ALPHA_FLOW, BETA_FLOW, DENSITY, CLIMB, RPM, MANIFOLD_PRESSURE = (
    0,
    3,
    6,
    7,
    8,
    9,
    10,
    11,
    12,
)
N_COMPUTED = 13  # tests with an equation; then those of sensors that should equal another reading
EQUAL = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_COMPUTED + len(EQUAL)
# The test in which a jump of a reading appears at once, as the rows of the sensors name it.
TESTS = {
    "roll": TURN, "pitch": TURN + 1, "yaw": TURN + 2,
    "bank angle": ANGLE, "pitch angle": ANGLE + 1, "heading": ANGLE + 2,
    "speed": SPEED, "incidence": ALPHA_FLOW, "sideslip": BETA_FLOW, "density": DENSITY, "climb": CLIMB,
    "engine speed": RPM, "manifold pressure": MANIFOLD_PRESSURE,
}  # fmt: skip
# Of each sensor that should equal another reading: its place, that of the reading, the test in which the
# reading's own errors appear, and by how much the quantities may differ, SI.
EQUAL_SENSOR = np.array([i for i, _ in EQUAL], np.int64)
EQUAL_READING = np.array([SENSORS.index(to.reading) for _, to in EQUAL], np.int64)
EQUAL_READING_TEST = np.array([TESTS[ROWS[SENSORS.index(to.reading)].test] for _, to in EQUAL], np.int64)
EQUAL_TOLERANCE = np.array([to.within for _, to in EQUAL], float)
POLES_PER_S = (1e6, 10.0, 1.0)
N_POLES = len(POLES_PER_S)
NO_SENSOR = -1
MAX_FORCE_JUMP_M_S2 = 8.0  # by which no specific force changes from one sample to the next
UNDECIDED, YES, NO = 0, 1, 2
MAX_SPEED_RATIO = 1.4  # than in trim a flight may become
ATTITUDE_CORRECTION_PER_S = 3.0  # a rate that it replaces, where the attitude's own noise is declared
NEVER_FROZEN = 1_000_000_000  # JSBSim frames: of a reading that resolves less than it scatters
NAMING_LIMIT_S = 1.0  # for the instrument to be found; then the fault is outside what can be named
P, Q, R, ALPHA, BETA, AIRSPEED, QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2

# Hypotheses of initial_errors.py: the sensors that may be broken when the monitor begins
ALPHA_ERROR, BETA_ERROR, AIRSPEED_ERROR, PHI_ERROR, THETA_ERROR = range(5)
N_INITIAL, N_COUPLINGS = 5, 14

TEST = record(
    residual=float, rate=float, noise=float, noise_before=float,  # of the elapsed step
    air=float, bound=N_POLES,  # share of `gust_change_bound` in it; the whole bound
    filtered=N_POLES, bound_rate=N_POLES, bound_noise=N_POLES, share=float,
)  # fmt: skip

STEP = record(
    config=record(
        h=float, decay=N_POLES, gravity=float,
        # of the declared turbulence: its speed at most, m/s, and what passes each filter of a gust's changes
        # up to an airspeed m/s
        max_gust_speed=float, gust_change_bound=N_POLES, max_airspeed=float,
        low=float,  # height below which a gust changes faster than those of 2000 ft, m
        max_vertical_wind=float,  # vertical wind at most, m/s
        # declared: the whole error of a reading, and what of it changes; drift of the attitude
        offset=N_SENSORS, slope=N_SENSORS, steady=N_SENSORS, drift=float,
    ),
    memory=record(
        error=N_SENSORS, changing=N_SENSORS,  # how far a reading can be off, and by how much that changes
        # drift so far, rad; the errors at the sample before, and at the one before that
        attitude_drift=float, previous_error=N_SENSORS, earlier_error=N_SENSORS,
        # the sample before: readings, attitude as a quaternion, velocity, acceleration there and before that
        previous=N_SENSORS, previous_attitude=4, velocity=3, acceleration=3, previous_acceleration=3,
        # m/s2: size of the acceleration of the elapsed step, and of those before it; of acceleration_then
        size=float, earlier_sizes=2, previous_size=float,
        unknown=float,  # of the acceleration of the first step, for want of the instant before
        predicted=N_SENSORS, scratch=4, now=4,
        command=2,  # engine speed rpm, manifold pressure inHg
    ),
    test=(TEST, N_TESTS),
)  # fmt: skip

INITIAL_ERRORS = record(
    # of each hypothesis, bounds on its error: at the first sample, now, at the alarm; on its change
    initial_bound=N_INITIAL, error_bound=N_INITIAL, bound_at_alarm=N_INITIAL, change_bound=N_INITIAL,
    # largest effect of a unit of the error on a test: in this sample, through the filters; with its sign
    unit_effect=(N_INITIAL, RPM), filtered_unit_effect=(N_INITIAL, RPM, N_POLES),
    coupling=N_COUPLINGS, filtered_coupling=(N_COUPLINGS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),  # since the alarm, and by which test
)  # fmt: skip

MONITOR_CONFIG = record(
    enabled=int, instants=int, engine=int, trim=N_SENSORS,
    attitude_correction_share=float,  # share of its error that a replaced rate corrects in one sample
    noisy_attitude=int,  # the attitude is noisy: a surface is named only once no gyro can be the cause
    longest_identical=(int, N_SENSORS),  # number of identical samples from which a reading counts as frozen
    damping=(3, 3),
)  # fmt: skip

MONITOR_MEMORY = record(
    begun=int, started_at_s=float, substep=int, exceeded=(int, N_TESTS),
    # what tells a gyro from the attitude, by axis
    gyro_error=3, previous_gyro_error=3,  # as each frame began, rad/s
    spike=3, previous_spike=3, earlier_spike=3, W=3, W_bound=3, previous_W_bound=3, before=3,
    # no gyro can be what the rates show: what attitude and W make of that, and how far one gyro goes
    agreed=(int, max(len(EQUAL), 1)),  # whether a sensor has equalled the reading that it should
    gyros_excluded=int, rate_difference=(3, N_POLES), rate_difference_bound=(3, N_POLES),
    rates_confirm=(int, 3), rate_replaced=(int, 3),
    # accelerometers or flow sensor: number of identical samples; readings two samples ago; sensors cleared
    identical=(int, N_SENSORS), earlier=N_SENSORS, cleared=(int, N_SENSORS),
    # largest jump of an accelerometer of late. Since the alarm: samples, residuals of speed, incidence and
    # sideslip, how much of them is sound, how much is of a first error; least and most of the readings; the
    # climb that such an incidence makes up; the velocity made up, body axes
    largest_jump=float, n_summed=int, residual_sum=3, bound_sum=3, first=3, least=3, most=3,
    climb_error=N_POLES, spurious_velocity=3,
)  # fmt: skip

MONITOR_OUTPUT = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface=int,  # a surface was found long before, with sound sensors: it stays found
    surface_was_isolated=int,  # a surface had been named in the moment before the alarm
    lead=int,  # the test that has raised the alarm
    largest_test=int, share=float,  # of this frame: the test nearest its bound, and how near
    suspect=(int, N_SENSORS), named=int, named_at_s=float, replaced=(int, N_SENSORS),
)  # fmt: skip

SENSOR_MONITOR = record(
    config=MONITOR_CONFIG, memory=MONITOR_MEMORY, output=MONITOR_OUTPUT, step=STEP, initial=INITIAL_ERRORS
)


def configure_monitor(
    monitor: np.void, scenario: Scenario, design: np.void, y: np.ndarray, enabled: bool
) -> None:
    """Fill the monitor's record at the trim: y, the measured signals there; design: the designer's record.

    A monitor that is not `enabled` has found nothing, and its record holds no more than that.
    """
    output, config = monitor["output"], monitor["config"]
    output["named"], output["alarmed_at_s"], output["named_at_s"] = NO_SENSOR, -1.0, -1.0
    config["enabled"] = enabled
    if not enabled:
        return
    declared, initial = Declared.of(scenario), cast("Any", scenario.initial)  # whose keys the aircraft names
    config["instants"], config["engine"] = scenario.substeps, scenario.airframe.has_engine_instruments
    config["trim"][3:7] = y[:4]
    config["damping"] = gust_effect(DesignFunctions(np.array([design])), y)
    monitor["memory"]["substep"] = scenario.substeps - 1  # the first JSBSim frame ends a frame of the loop
    if config["engine"]:
        monitor["step"]["memory"]["command"] = initial.engine_rpm, initial.manifold_pressure_inhg
    configure_step(monitor["step"]["config"], declared, scenario)
    configure_readings(monitor, declared, monitor["step"]["config"]["h"])


def configure_step(step: np.void, declared: Declared, scenario: Scenario) -> None:
    """Fill what the equations of motion and the gusts are stepped with, a JSBSim frame a step."""
    initial, h = scenario.initial, 1.0 / scenario.rate_hz / scenario.substeps
    step["h"], step["decay"] = h, [exp(-pole * h) for pole in POLES_PER_S]
    step["gravity"] = GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2
    step["max_gust_speed"], step["gust_change_bound"] = gust_bounds(declared.air, initial.airspeed_mps, h)
    step["max_airspeed"] = MAX_SPEED_RATIO * initial.airspeed_mps
    step["low"], step["max_vertical_wind"] = declared.air.low_m, declared.vertical_wind_mps


def configure_readings(monitor: np.void, declared: Declared, h: float) -> None:
    """Fill the declared errors of the readings; h: seconds of a JSBSim frame."""
    step, config, errors = monitor["step"]["config"], monitor["config"], declared.sensors
    for i, name in enumerate(SENSORS):
        error = errors[name]
        step["offset"][i], step["slope"][i], step["steady"][i] = error.worst, error.slope, error.steady
        config["longest_identical"][i] = longest_identical(error.noise, error.resolution) * frames_apart(i, h)
        drift_rad_s = getattr(getattr(errors.declared, name), "drift_rad_s", 0.0)
        step["drift"] = max(step["drift"], abs(drift_rad_s))
    attitude = slice(PHI, PHI + 3)
    config["noisy_attitude"] = np.any(step["offset"][attitude] > step["steady"][attitude])
    config["attitude_correction_share"] = (
        min(1.0, h * ATTITUDE_CORRECTION_PER_S) if config["noisy_attitude"] else 1.0
    )


def longest_identical(noise: float, quantum: float) -> int:
    """For how many samples no sound sensor, of this noise and resolution, gives the very same reading."""
    if quantum == 0.0:
        return 3
    return 50 if noise > quantum / 4.0 else NEVER_FROZEN


def gust_bounds(air: Dryden, airspeed_mps: float, h: float) -> tuple[float, np.ndarray]:
    """Bounds on the speed of gusts, m/s, and on what passes each filter of their changes in h s.

    The speed of a gust changes like a random walk (`Dryden.velocity_walk`); a filter with a pole of lam 1/s
    keeps 1 / 2 lam of it.
    """
    sigma_mps, intensity = air.sigma_mps, air.velocity_walk(airspeed_mps, MAX_SPEED_RATIO)
    kept_s = [h / (1.0 - exp(-2.0 * pole * h)) for pole in POLES_PER_S]
    return GUST_LIMIT_SIGMA * sigma_mps, GUST_LIMIT_SIGMA * np.sqrt(intensity * np.array(kept_s))


def sensor_finding(monitor: np.void, t_s: float) -> dict[str, Any] | None:
    """The verdict's parts as of t_s, where an instrument is found broken; None where none is."""
    if not monitor["output"]["alarmed"] or monitor["output"]["keeps_surface"]:
        return None
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["detection_time_s"], said["isolation_time_s"] = float(monitor["output"]["alarmed_at_s"]), None
    if monitor["output"]["named"] >= 0:
        said["isolated"] = sensor_words(SENSORS[int(monitor["output"]["named"])])
        said["isolation_time_s"] = float(monitor["output"]["named_at_s"])
    elif t_s > said["detection_time_s"] + NAMING_LIMIT_S:
        said["isolated"] = said["isolation_type"] = "unanticipated"
        said["isolation_time_s"] = said["detection_time_s"] + NAMING_LIMIT_S
    else:
        left = zip(SENSORS, monitor["output"]["suspect"], strict=True)
        said["candidates"] = tuple(sensor_words(name) for name, possible in left if possible)
    return said


EARTH_TURN_RAD_S = 4e-5  # Earth rate is in the rates; the level turns with the flight over the round Earth
EARTH_ACCELERATION_M_S2 = 0.03  # Coriolis, centrifugal, and gravity's change with place
DENSITY_SCALE_HEIGHT_M = (
    6300.0  # over which the density falls by no more than a factor e: in the stratosphere
)
STEEPEST_RAD = 1.3  # beyond it, roll and heading cannot be distinguished


@kernel
def fill_quaternion(phi, theta, psi, out):
    """Fill out (4,): the rotation from body to level axes, scalar first."""
    a, b, c = np.cos(phi / 2), np.cos(theta / 2), np.cos(psi / 2)
    d, e, f = np.sin(phi / 2), np.sin(theta / 2), np.sin(psi / 2)
    out[0] = a * b * c + d * e * f
    out[1] = d * b * c - a * e * f
    out[2] = a * e * c + d * b * f
    out[3] = a * b * f - d * e * c


@kernel
def advance_quaternion(q, x, h, out):
    """Fill out (4,) with q after h s at the rates x (3,) rad/s, one step of Euler's, to unit length."""
    p, r, s = 0.5 * h * x[0], 0.5 * h * x[1], 0.5 * h * x[2]
    length = np.sqrt(1.0 + p * p + r * r + s * s)
    out[0] = (q[0] - q[1] * p - q[2] * r - q[3] * s) / length
    out[1] = (q[1] + q[0] * p + q[2] * s - q[3] * r) / length
    out[2] = (q[2] + q[0] * r + q[3] * p - q[1] * s) / length
    out[3] = (q[3] + q[0] * s + q[1] * r - q[2] * p) / length


@kernel
def angle_between(one, other, axis):
    """Component (1, 2, 3) along a body axis of the small rotation from one attitude to the other, rad."""
    a, b, c = axis, axis % 3 + 1, (axis + 1) % 3 + 1
    along = one[0] * other[a] - one[a] * other[0] - one[b] * other[c] + one[c] * other[b]
    same = one[0] * other[0] + one[1] * other[1] + one[2] * other[2] + one[3] * other[3]
    return 2.0 * along if same >= 0.0 else -2.0 * along


@kernel
def axis_turn_per_angle(step, axis, i):
    """By how much a body axis turns for what angle i changes by."""
    bank, tilt = step.memory.previous[PHI], step.memory.previous[THETA]
    if axis == 0:
        return (1.0, 0.0, -np.sin(tilt))[i]
    if axis == 1:
        return (0.0, np.cos(bank), np.sin(bank) * np.cos(tilt))[i]
    return (0.0, -np.sin(bank), np.cos(bank) * np.cos(tilt))[i]


@kernel
def rotate_to_new_axes(x, h, vector, out):
    """Fill out (3,): a vector (3,) that stays put, in body axes that turned at x (3,) rad/s for h s."""
    size = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    angle = 2.0 * np.arctan(0.5 * h * size)
    sine = np.sin(angle) / size if size > 0.0 else 0.0
    rest = (1.0 - np.cos(angle)) / size**2 if size > 0.0 else 0.0
    along = x[0] * vector[0] + x[1] * vector[1] + x[2] * vector[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = x[j] * vector[k] - x[k] * vector[j]
        out[i] = vector[i] - sine * across + rest * (x[i] * along - size**2 * vector[i])


@kernel
def fill_reading_errors(step, signal):
    """Fill error and changing (N_SENSORS,): how far each reading can be off, and by how much that changes."""
    for i in range(N_SENSORS):
        size = abs(wrapped(signal[i])) if i == PSI else abs(signal[i])
        whole = (step.config.offset[i] + step.config.slope[i] * size) / (1.0 - step.config.slope[i])
        step.memory.error[i] = whole
        step.memory.changing[i] = whole - step.config.steady[i] + 1e-10 * abs(signal[i])
    for i in range(PHI, PHI + 3):
        step.memory.error[i] += step.memory.attitude_drift


@kernel
def store_sample(step, signal, force):
    """Store this sample for the next one; signal (N_SENSORS,) SI, force (3,) m/s2."""
    step.memory.previous[:], step.memory.earlier_error[:] = signal, step.memory.previous_error
    step.memory.previous_error[:] = step.memory.error
    fill_quaternion(signal[PHI], signal[THETA], signal[PSI], step.memory.previous_attitude)
    alpha, beta, V = signal[ALPHA], signal[BETA], signal[AIRSPEED]
    step.memory.velocity[0] = V * np.cos(alpha) * np.cos(beta)
    step.memory.velocity[1], step.memory.velocity[2] = V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    tilt, bank = signal[THETA], signal[PHI]
    step.memory.acceleration[0] = force[0] - step.config.gravity * np.sin(tilt)
    step.memory.acceleration[1] = force[1] + step.config.gravity * np.cos(tilt) * np.sin(bank)
    step.memory.acceleration[2] = force[2] + step.config.gravity * np.cos(tilt) * np.cos(bank)


@kernel
def vector_length(vector):
    """The length of a vector (3,)."""
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel
def predict_readings(step):
    """Fill predicted (N_SENSORS,): attitude, flow and altitude now, from the sample before."""
    rates, h, out, moved = (
        step.memory.previous[:3],
        step.config.h,
        step.memory.predicted,
        step.memory.scratch[:3],
    )
    advance_quaternion(step.memory.previous_attitude, rates, h, step.memory.now)
    a, b, c, d = step.memory.now[0], step.memory.now[1], step.memory.now[2], step.memory.now[3]
    out[PHI] = np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c))
    out[THETA] = np.arcsin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    out[PSI] = np.arctan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
    tilt, bank, v = step.memory.previous[THETA], step.memory.previous[PHI], step.memory.velocity
    up = v[0] * np.sin(tilt) - v[1] * np.sin(bank) * np.cos(tilt) - v[2] * np.cos(bank) * np.cos(tilt)
    out[ALTITUDE] = step.memory.previous[ALTITUDE] + h * up
    step.memory.earlier_sizes[1], step.memory.earlier_sizes[0] = (
        step.memory.earlier_sizes[0],
        step.memory.size,
    )
    step.memory.previous_size = vector_length(step.memory.previous_acceleration)
    for i in range(3):
        moved[i] = 1.5 * step.memory.acceleration[i] - 0.5 * step.memory.previous_acceleration[i]
    step.memory.size = vector_length(moved)
    for i in range(3):
        moved[i] = v[i] + h * moved[i]
    rotate_to_new_axes(rates, h, moved, v)
    rotate_to_new_axes(rates, h, step.memory.acceleration, step.memory.previous_acceleration)
    speed = vector_length(v)
    out[AIRSPEED] = speed
    out[ALPHA], out[BETA] = np.arctan2(v[2], v[0]), np.arcsin(v[1] / max(speed, 1e-3))


@kernel
def fill_residuals(step, signal):
    """Fill the residual of each test with what the readings (N_SENSORS,) are beyond what was predicted."""
    test, predicted = step.test, step.memory.predicted
    fill_quaternion(signal[PHI], signal[THETA], signal[PSI], step.memory.scratch)
    for i in range(3):
        test[TURN + i].residual = angle_between(step.memory.now, step.memory.scratch, i + 1)
        test[ANGLE + i].residual = wrapped(signal[PHI + i] - predicted[PHI + i])
    test[SPEED].residual = signal[AIRSPEED] - predicted[AIRSPEED]
    test[ALPHA_FLOW].residual = signal[ALPHA] - predicted[ALPHA]
    test[BETA_FLOW].residual = signal[BETA] - predicted[BETA]
    dense, dense_then = (
        signal[QDYN] / signal[AIRSPEED] ** 2,
        step.memory.previous[QDYN] / step.memory.previous[AIRSPEED] ** 2,
    )
    test[DENSITY].residual = np.log(max(dense, 1e-9) / max(dense_then, 1e-9))
    test[CLIMB].residual = signal[ALTITUDE] - predicted[ALTITUDE]


@kernel
def steepest_pitch_angle(step, signal):
    """How far from level the nose can have been since the sample before, rad."""
    return max(
        abs(signal[THETA]) + step.memory.error[THETA],
        abs(step.memory.previous[THETA]) + step.memory.previous_error[THETA],
    )


@kernel
def two_step_error(step, i):
    """How far off 3/2 a - 1/2 a_then can be by what reading i is off at the two instants: a constant counts
    once."""
    return 1.5 * step.memory.previous_error[i] + 0.5 * step.memory.earlier_error[i] - step.config.steady[i]


@kernel
def acceleration_error(step, turning, rates):
    """How far off the acceleration of the elapsed step can be, m/s2: by accelerometers, by gravity sought
    where the attitude has it, by turning the one before back. turning; rates: of gyros, errors; rad/s."""
    tilt, g = two_step_error(step, PHI) + two_step_error(step, THETA), step.config.gravity
    felt, steady = 0.0, g * (step.config.steady[PHI] + step.config.steady[THETA])
    for i in range(AX, AX + 3):
        felt += two_step_error(step, i) ** 2
        steady += step.config.steady[i]
    back = step.config.h * (turning * steady + 0.5 * rates * step.memory.previous_size)
    return EARTH_ACCELERATION_M_S2 + step.memory.unknown + g * tilt + np.sqrt(felt) + back


@kernel
def bound_attitude_tests(step, signal, turning, rates):
    """The same as `bound_residuals`, of attitude.

    A constant error of the attitude turns with the aircraft: in the rates J(phi, theta) (phi', theta', psi')
    it changes J. A momentary error turns an axis when it begins, and back when it ends with another J.
    """
    test, E, n = step.test, step.memory.previous_error, step.memory.changing
    level = 1.0 / np.cos(min(steepest_pitch_angle(step, signal), STEEPEST_RAD))
    tilt, around = E[PHI] + E[THETA] + E[PSI], step.config.h * turning
    tipped = abs(signal[PHI] - step.memory.previous[PHI]) + abs(signal[THETA] - step.memory.previous[THETA])
    momentary = E[THETA] - step.config.steady[THETA] + E[PSI] - step.config.steady[PSI] + n[THETA] + n[PSI]
    for i in range(3):
        by_attitude = turning * (tilt + level * E[THETA]) + tipped * momentary / step.config.h
        test[TURN + i].rate = (
            EARTH_TURN_RAD_S + 2.0 * step.config.drift + E[P + i] + around * rates + by_attitude
        )
        by_attitude = 2.0 * level * turning * (E[PHI] + E[THETA])
        off = EARTH_TURN_RAD_S + (1.0 + level * around) * rates + by_attitude
        test[ANGLE + i].rate, test[ANGLE + i].noise = level * off + step.config.drift, n[PHI + i]
    tilted, banked = abs(np.sin(signal[THETA])) + n[THETA], abs(np.sin(signal[PHI])) + n[PHI]
    test[TURN].noise = n[PHI] + tilted * n[PSI]
    test[TURN + 1].noise = n[THETA] + banked * n[PSI]
    test[TURN + 2].noise = n[PSI] + banked * n[THETA]


@kernel
def lowest_sample_height(step, signal):
    """The least height of the two samples, m, within the altimeter's error."""
    now, then = (
        signal[ALTITUDE] - step.memory.error[ALTITUDE],
        step.memory.previous[ALTITUDE] - step.memory.previous_error[ALTITUDE],
    )
    return max(min(now, then), LEAST_HEIGHT_M)


@kernel
def bound_flow_tests(step, signal, turning, rates):
    """The same, of flow and climb: slopes of their kinematics with each reading, where they are greatest."""
    test, e, E, n = step.test, step.memory.error, step.memory.previous_error, step.memory.changing
    slow = max(min(signal[AIRSPEED] - e[AIRSPEED], step.memory.previous[AIRSPEED] - E[AIRSPEED]), 1.0)
    slip = max(abs(signal[BETA]) + e[BETA], abs(step.memory.previous[BETA]) + E[BETA])
    aslant, vanes = 1.0 / np.cos(min(slip, STEEPEST_RAD)), E[ALPHA] + E[BETA]
    off = acceleration_error(step, turning, rates)
    pull, coarse = step.memory.size + off, 1.0 + step.config.h * (2.0 * step.memory.size / slow + turning)
    gusty = np.sqrt(
        max(signal[AIRSPEED] / step.config.max_airspeed, 1.0)
        * max(step.config.low / lowest_sample_height(step, signal), 1.0)
    )
    flow = aslant**2 * ((off + pull * (vanes + E[AIRSPEED] / slow)) / slow + turning * vanes) + aslant * rates
    test[SPEED].air, test[SPEED].noise = gusty, n[AIRSPEED]
    test[SPEED].rate = off + coarse * pull * vanes + step.config.h * (pull / slow) ** 2 * E[AIRSPEED]
    for c, vane in ((ALPHA_FLOW, ALPHA), (BETA_FLOW, BETA)):
        test[c].air, test[c].noise, test[c].rate = gusty * aslant / slow, n[vane], coarse * flow
    tilt, hardest = E[PHI] + E[THETA], max(pull, step.memory.earlier_sizes[0], step.memory.earlier_sizes[1])
    climb = (step.memory.previous[AIRSPEED] + E[AIRSPEED]) * (tilt + vanes) + E[AIRSPEED]
    test[CLIMB].rate = (
        step.config.max_vertical_wind
        + step.config.max_gust_speed
        + climb
        + 4.0 / 3.0 * step.config.h * hardest
    )
    test[CLIMB].noise = n[ALTITUDE]


@kernel
def log_change_error(step, signal, i):
    """How far the logarithm of a quantity can seem to move, the reading of which is off by a constant."""
    least = max(min(signal[i], step.memory.previous[i]), 1.0)
    moved = step.config.steady[i] * abs(1.0 / max(signal[i], 1.0) - 1.0 / max(step.memory.previous[i], 1.0))
    return moved / max(1.0 - step.config.steady[i] / least, 0.01)


@kernel
def bound_density_test(step, signal):
    """The same, of the logarithm of the density."""
    test, e, n = step.test[DENSITY], step.memory.error, step.memory.changing
    fastest = (
        step.memory.previous[AIRSPEED]
        + step.memory.previous_error[AIRSPEED]
        + step.config.max_vertical_wind
        + step.config.max_gust_speed
    )
    seems = log_change_error(step, signal, QDYN) + 2.0 * log_change_error(step, signal, AIRSPEED)
    test.rate = fastest / DENSITY_SCALE_HEIGHT_M + seems / step.config.h
    test.noise = n[QDYN] / max(signal[QDYN] - e[QDYN], 1.0)
    test.noise += 2.0 * n[AIRSPEED] / max(signal[AIRSPEED] - e[AIRSPEED], 1.0)


@kernel
def bound_residuals(step, signal):
    """Fill what sound instruments with the declared errors may add to each residual: per second, at all.

    The prediction is off by the errors of the readings from which it was made (E, of the sample before),
    what it is held against by those of now.
    """
    E = step.memory.previous_error
    rates = E[P] + E[Q] + E[R]
    turning = (
        abs(step.memory.previous[P]) + abs(step.memory.previous[Q]) + abs(step.memory.previous[R]) + rates
    )
    bound_attitude_tests(step, signal, turning, rates)
    bound_flow_tests(step, signal, turning, rates)
    bound_density_test(step, signal)


@kernel
def filter_test(step, test):
    """Pass one residual through its filters; note the largest share of a bound."""
    test.share = 0.0
    for m, a in enumerate(step.config.decay):
        test.filtered[m] = a * test.filtered[m] + test.residual
        test.bound_rate[m] = bound_step(test.bound_rate[m], test.rate, a, step.config.h)
        test.bound_noise[m] = noise_step(test.bound_noise[m], test.noise_before, a)
        noise = test.bound_noise[m] + test.noise
        test.bound[m] = test.bound_rate[m] + noise + test.air * step.config.gust_change_bound[m]
        test.share = max(test.share, abs(test.filtered[m]) / test.bound[m])
    test.noise_before = test.noise


@kernel
def start_test(test):
    """Begin a test with this sample: its filters are empty, and all of the noise may still appear."""
    test.share = test.residual = 0.0
    test.filtered[:], test.bound_rate[:], test.bound_noise[:] = 0.0, 0.0, test.noise
    test.noise_before = test.noise


@kernel
def test_engine(step, signal):
    """The engine's instruments against what was commanded: no filter, an error is there or not."""
    step.test[RPM].residual = signal[ENGINE_SPEED] - step.memory.command[0]
    step.test[RPM + 1].residual = signal[MANIFOLD] - step.memory.command[1]
    for which in range(2):
        size = step.memory.error[ENGINE_SPEED + which] + 1e-6
        step.test[RPM + which].share = abs(step.test[RPM + which].residual) / size


@kernel
def test_equal_sensors(step, signal, fresh):
    """Compare each sensor that should equal a reading with that reading, when it gives a new sample, `fresh`:
    beyond what the errors of both and the two quantities may differ by, one of the two is broken."""
    for k in range(EQUAL_SENSOR.size):
        i, reading, test = EQUAL_SENSOR[k], EQUAL_READING[k], step.test[N_COMPUTED + k]
        test.share = 0.0
        if fresh[i - N_IN_EQUATIONS]:
            test.residual = signal[i] - signal[reading]
            if PHI <= reading <= PSI:
                test.residual = wrapped(test.residual)
            test.bound[0] = EQUAL_TOLERANCE[k] + step.memory.error[i] + step.memory.error[reading] + 1e-6
            test.share = abs(test.residual) / test.bound[0]


@kernel
def begin_tests(step, signal, force):
    """Begin with the first sample: the readings before it are not known."""
    fill_reading_errors(step, signal)
    store_sample(step, signal, force)
    step.memory.earlier_error[:], step.memory.previous_acceleration[:] = (
        step.memory.previous_error,
        step.memory.acceleration,
    )
    step.memory.size = step.memory.earlier_sizes[0] = (
        vector_length(step.memory.acceleration) + MAX_FORCE_JUMP_M_S2
    )
    step.memory.unknown = 0.5 * MAX_FORCE_JUMP_M_S2
    bound_residuals(step, signal)
    for c in range(RPM):
        start_test(step.test[c])


@kernel
def run_tests(step, signal, engine):
    """Compare this sample of the readings (N_SENSORS,) with the one before; engine: it has instruments."""
    step.memory.attitude_drift += step.config.h * step.config.drift
    fill_reading_errors(step, signal)
    predict_readings(step)
    fill_residuals(step, signal)
    bound_residuals(step, signal)
    step.memory.unknown = 0.0
    steep = steepest_pitch_angle(step, signal) > STEEPEST_RAD
    for c in range(RPM):
        if steep and c < SPEED:
            start_test(step.test[c])
        else:
            filter_test(step, step.test[c])
    if engine:
        test_engine(step, signal)


@kernel
def set_drift(step, t):
    """Fill the bound on the attitude's drift by t s, which begins with the flight."""
    step.memory.attitude_drift = step.config.drift * t
