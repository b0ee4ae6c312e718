"""Redundancy tests: relations that sound sensors satisfy in any flight (kinematics, air data, engine).

    turning     attitude[k+1] = attitude[k] turned by h (p, q, r)[k]         in body axes, and angle by angle
    flow        v[k+1] = v[k] turned by -h (p, q, r), + h (force + gravity)  v from alpha, beta, airspeed
    density     2 qdyn / V^2 changes with height only
    climb       altitude[k+1] = altitude[k] + h (v upwards)
    engine      speed and manifold pressure are as commanded
    equal       a sensor that no equation uses, and the reading that its row says it should equal

The integration is that of JSBSim (rates held over the step; velocity by Adams and Bashforth's second order),
so that residuals of sound sensors contain only what is left out here: the Earth turns and is round. Every
residual passes filters of several poles, with a bound on the effect of the declared errors of all sensors
together, as in detection/filters.py. Declared turbulence widens the bounds of flow and climb by the effect of
its gusts within a filter's memory.

    y, y_past, y_pred  (N_SENSORS,)  readings now, in the sample before, as predicted from that; SI
    e, e_past, e_older (N_SENSORS,)  bounds on their errors: now, in the sample before, in that before it
    e_new              (N_SENSORS,)  bound on the part of an error that changes from sample to sample
    w, w_max                         body rates (3,), bound on |p| + |q| + |r|; rad/s
    e_w                              sum of the bounds on the errors of the three gyros, rad/s
    v, a, a_past       (3,)          velocity m/s, acceleration m/s2 with gravity, that of the sample before
    q, p               (z1, z2)      quaternion z1 + z2 j of complex numbers; an attitude turns body to level
                                     axes
    h                                time between two samples, s: a JSBSim frame
    i, j, m, d                       sensor or axis, test, pole of a filter, duplicate sensor
    red, c, M                        record of the tests, its configuration, its memory

This file also has the records of the sensor monitor, their configuration, and its finding in words.
"""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design import LEAST_HEIGHT_M, Dryden
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA, air_rotation_slopes
from beaver_ftc.diagnosis.detection.filters import advance_bound, leak
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    N_SENSORS,
    PHI,
    SENSORS,
    SIGNALS,
    wrapped,
)
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS, ROWS, frames_apart, sensor_words

TURN_TEST = 0
ANGLE_TEST = 3
SPEED_TEST = 6
ALPHA_TEST = 7
BETA_TEST = 8
DENSITY_TEST = 9
CLIMB_TEST = 10
RPM_TEST = 11
PRESSURE_TEST = 12
N_EQUATIONS = 13  # tests with an equation; then those of sensors that should equal another reading
DUPLICATES = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_EQUATIONS + len(DUPLICATES)
# The test in which a jump of a reading appears at once, as the rows of the sensors name it.
TEST_BY_NAME = {
    "roll": TURN_TEST, "pitch": TURN_TEST + 1, "yaw": TURN_TEST + 2,
    "bank angle": ANGLE_TEST, "pitch angle": ANGLE_TEST + 1, "heading": ANGLE_TEST + 2,
    "speed": SPEED_TEST, "incidence": ALPHA_TEST, "sideslip": BETA_TEST, "density": DENSITY_TEST,
    "climb": CLIMB_TEST, "engine speed": RPM_TEST, "manifold pressure": PRESSURE_TEST,
}  # fmt: skip
# Of each sensor that should equal another reading (its row in scenario/sensors.py says which): its place in
# the readings, the place of that reading, the test that an error of that reading exceeds, and the largest
# difference of the two quantities, SI.
DUPLICATE = np.array([i for i, _ in DUPLICATES], np.int64)
COUNTERPART = np.array([SENSORS.index(equal.reading) for _, equal in DUPLICATES], np.int64)
COUNTERPART_TEST = np.array([TEST_BY_NAME[ROWS[i].test] for i in COUNTERPART], np.int64)
DUPLICATE_TOLERANCE = np.array([equal.within for _, equal in DUPLICATES], float)
FILTER_POLES_PER_S = (1e6, 10.0, 1.0)  # of the filters of each test; the first is the residual itself
N_POLES = len(FILTER_POLES_PER_S)
NO_SENSOR = -1
FORCE_JUMP_M_S2 = 8.0  # a sound specific force changes by less from one sample to the next
GYRO_OPEN, GYRO_CONFIRMED, GYRO_REFUTED = 0, 1, 2  # of `gyro_verdict`
MAX_AIRSPEED_OVER_TRIM = 1.4  # largest airspeed of a flight, as a share of that in trim
# at which the attitude corrects a replaced rate, if its noise is declared
RATE_GAIN_PER_S = 3.0
# Number of samples of a sensor that are never identical without resolution
N_FROZEN_EXACT = 3
N_FROZEN_ROUNDED = 50  # the same with noise of more than a quarter of the resolution
N_FROZEN_NEVER = 1_000_000_000  # JSBSim frames: a sound reading may repeat, if its steps exceed its noise
UNANTICIPATED_DELAY_S = 1.0  # from the alarm; a sensor not isolated by then makes the fault unanticipated
P, Q, R, ALPHA, BETA, AIRSPEED, QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2

# Hypotheses of initial_errors.py: this sensor has been broken since the monitor began
H_ALPHA, H_BETA, H_AIRSPEED, H_PHI, H_THETA = range(5)
N_INITIAL = 5
# What bounds such an error: its hypothesis, and the tests, first to last, in which its effect shows
EVIDENCE = (
    (H_PHI, TURN_TEST + 1, TURN_TEST + 2), (H_PHI, SPEED_TEST, BETA_TEST),
    (H_THETA, TURN_TEST, TURN_TEST + 2), (H_THETA, SPEED_TEST, BETA_TEST),
    (H_ALPHA, BETA_TEST, BETA_TEST), (H_BETA, ALPHA_TEST, ALPHA_TEST), (H_ALPHA, CLIMB_TEST, CLIMB_TEST),
    (H_AIRSPEED, ALPHA_TEST, ALPHA_TEST), (H_AIRSPEED, BETA_TEST, BETA_TEST),
    (H_AIRSPEED, DENSITY_TEST, DENSITY_TEST),
)  # fmt: skip
N_EFFECTS = len(EVIDENCE) + 2  # and the parts of the force

# One test; units: of the residual. bound_per_s, bound_per_sample: parts of the bound on the residual of one
# sample, the first for each second of it; past_bound: bound_per_sample of the sample before. gust_gain:
# effect on the residual of 1 m/s that a gust changes by. r: filtered residual. B: bound on |r|; e: the
# part of it that the filter sums. ratio: largest |r| / B over the poles.
TEST_RECORD = record(
    residual=float, bound_per_s=float, bound_per_sample=float, past_bound=float, gust_gain=float,
    r=N_POLES, B=N_POLES, e=N_POLES, ratio=float,
)  # fmt: skip

REDUNDANCY_RECORD = record(
    config=record(
        sample_time_s=float, decay=N_POLES, g=float,  # of each filter per sample; m/s2
        # Declared turbulence, m/s: bound on a gust's speed; bound on its changes through each filter, which
        # holds up to max_airspeed_mps, and above low_m: below it a gust changes faster
        gust_max=float, gust_change=N_POLES, max_airspeed_mps=float, low_m=float,
        wind_max=float,  # of the vertical wind, m/s
        # Declared errors, SI: |error| <= e_zero + e_slope |y|, of which const does not change; of the
        # attitude, rad/s
        e_zero=N_SENSORS, e_slope=N_SENSORS, const=N_SENSORS, drift=float,
    ),
    memory=record(
        # bounds on the error of each reading: e; part of it that changes; part of it by drift, rad; before
        reading_bound=N_SENSORS, e_new=N_SENSORS, e_drift=float, e_past=N_SENSORS, e_older=N_SENSORS,
        # of the sample before; predict_readings turns a_past into the present axes
        y_past=N_SENSORS, a=3, a_past=3,
        # m/s2: |a| in the elapsed step and in the two before it; of a_past
        a_size=3, a_size_past=float,
        e_first=float,  # m/s2, in the first step only: no sample precedes it
        predicted_reading=N_SENSORS,
        engine_commands=2,  # engine speed rpm, manifold pressure inHg
    ),
    test=(TEST_RECORD, N_TESTS),
)  # fmt: skip

INITIAL_ERRORS_RECORD = record(
    # Symbols: initial_errors.py
    e_start=N_INITIAL, e=N_INITIAL, e_alarm=N_INITIAL, d=N_INITIAL,
    H=(N_INITIAL, RPM_TEST), H_m=(N_INITIAL, RPM_TEST, N_POLES),
    C=(complex, N_EFFECTS), C_m=(complex, N_EFFECTS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),  # since the alarm
)  # fmt: skip

MONITOR_CONFIG_RECORD = record(
    enabled=int, substeps=int, has_engine=int, y_trim=N_SENSORS,
    rate_gain=float,  # share of its error that a replaced rate corrects in one sample
    noisy=int,  # the attitude: then a surface is isolated only once no gyro can be the cause
    n_frozen=(int, N_SENSORS),  # number of identical samples from which a reading counts as frozen
    # 1/s: body rates decay with rate' = -D rate; |D|, with -D_ii on its diagonal
    D=(3, 3), D_size=(3, 3),
)  # fmt: skip

MONITOR_MEMORY_RECORD = record(
    stage=int, t_start=float, substep=int, exceeded=(int, N_TESTS),
    # since the alarm, rad: by angle, body axis and pole, filtered residual of turning beyond the part of the
    # angle's own residual; by angle and pole, filtered size of the angle's residual; by angle and body axis,
    # largest size of turn_share
    beyond=(3, 3, N_POLES), swing=(3, N_POLES), c_max=(3, 3),
    # by axis, rad/s: error of the gyro if the attitude is right, as this frame and the one before began; its
    # largest size in the other samples of this frame, of the one before, of the one before that; its smallest
    # size there, of this frame and the one before
    w_att=3, w_att_past=3, peak=3, peak_past=3, peak_older=3, floor=3, floor_past=3,
    # by axis, rad/s: error of the gyro if the dynamics are right (w of sensor_monitor.py), and its bound
    w=3, w_bound=3,
    agreed=(int, max(len(DUPLICATES), 1)),  # a sensor with the reading that it should equal
    # by axis and pole, rad: filtered difference of the turn that the attitude and w show, and its bound;
    # beyond it no gyro can be broken
    gyros_excluded=int, gap=(3, N_POLES), gap_bound=(3, N_POLES), gyro_verdict=(int, 3), replaced=(int, 3),
    n_same=(int, N_SENSORS), y_older=N_SENSORS, cleared=(int, N_SENSORS), turn_max=float,
    jump=float,  # of the accelerometers, m/s2, which fades
    # since the alarm, of speed, incidence, sideslip: number of samples; sums of the residuals, of the part of
    # sound sensors, of the part of an initial error; range of the readings
    n_since=int, r_sum=3, B_sum=3, e_sum=3, y_min=3, y_max=3,
    climb=N_POLES,  # m, filtered: error of the climb, of an incidence with the error that its residuals show
)  # fmt: skip

MONITOR_OUTPUT_RECORD = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface=int,  # a surface was found long before, with sound sensors: it stays found
    had_surface=int,  # a surface had been isolated just before the alarm
    alarm_test=int,  # test that has raised the alarm
    worst_test_index=int, top_ratio=float,  # test with the largest ratio of this frame, and that ratio
    suspect=(int, N_SENSORS), isolated_sensor=int, isolated_at_s=float, is_reading_unused=(int, N_SENSORS),
)  # fmt: skip

SENSOR_MONITOR_RECORD = record(
    config=MONITOR_CONFIG_RECORD,
    memory=MONITOR_MEMORY_RECORD,
    output=MONITOR_OUTPUT_RECORD,
    redundancy=REDUNDANCY_RECORD,
    initial_errors=INITIAL_ERRORS_RECORD,
)


def configure_sensor_monitor(monitor: np.void, declared: Declared, design: np.void, y: np.ndarray) -> None:
    """Fill the monitor's record at the trim: y, the measured signals there; design: model of the designer.

    A monitor that is not declared has found nothing, and its record holds no more than that.
    """
    output, config = monitor["output"], monitor["config"]
    output["isolated_sensor"], output["alarmed_at_s"], output["isolated_at_s"] = NO_SENSOR, -1.0, -1.0
    config["enabled"] = declared.monitors_sensors
    if not declared.monitors_sensors:
        return
    initial = cast("Any", declared.initial)  # whose keys the aircraft names
    config["substeps"], config["has_engine"] = (declared.substeps, declared.aircraft.has_engine_instruments)
    config["y_trim"][3:7] = y[:4]
    config["D"] = D = air_rotation_slopes(DesignFunctions(np.array([design])), y)
    config["D_size"] = np.where(np.eye(3) > 0.0, -D, abs(D))
    monitor["memory"]["substep"] = declared.substeps - 1  # the first JSBSim frame ends a frame of the loop
    if config["has_engine"]:
        monitor["redundancy"]["memory"]["engine_commands"] = (
            initial.engine_rpm,
            initial.manifold_pressure_inhg,
        )
    configure_tests(monitor["redundancy"]["config"], declared)
    configure_errors(monitor, declared, monitor["redundancy"]["config"]["sample_time_s"])


def configure_tests(config: np.void, declared: Declared) -> None:
    """Fill the constants of the equations of motion and of the gusts; a sample is a JSBSim frame."""
    initial, h = declared.initial, 1.0 / declared.rate_hz / declared.substeps
    config["sample_time_s"] = h
    config["decay"] = [exp(-lam * h) for lam in FILTER_POLES_PER_S]
    config["g"] = GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2
    config["gust_max"], config["gust_change"] = bound_gusts(declared.air, initial.airspeed_mps, h)
    config["max_airspeed_mps"] = MAX_AIRSPEED_OVER_TRIM * initial.airspeed_mps
    config["low_m"] = declared.air.low_m
    config["wind_max"] = declared.vertical_wind_mps


def configure_errors(mon: np.void, declared: Declared, h: float) -> None:
    """Fill the declared errors of the readings, and from how many identical samples each is frozen; a sample
    is a JSBSim frame."""
    tests = mon["redundancy"]["config"]
    c = mon["config"]
    sensors = declared.sensors
    for i, name in enumerate(SENSORS):
        e = sensors[name]
        (tests["e_zero"][i], tests["e_slope"][i], tests["const"][i]) = (e.worst, e.slope, e.steady)
        c["n_frozen"][i] = n_frozen(e.noise, e.resolution) * frames_apart(i, h)
        drift = getattr(getattr(sensors.declared, name), "drift_rad_s", 0.0)
        tests["drift"] = max(tests["drift"], abs(drift))
    attitude = slice(PHI, PHI + 3)
    c["noisy"] = np.any(tests["e_zero"][attitude] > tests["const"][attitude])
    c["rate_gain"] = min(1.0, h * RATE_GAIN_PER_S) if c["noisy"] else 1.0


def n_frozen(noise: float, resolution: float) -> int:
    """Number of identical samples that a sound sensor of this noise and resolution does not give."""
    if resolution == 0.0:
        return N_FROZEN_EXACT
    return N_FROZEN_ROUNDED if noise > resolution / 4.0 else N_FROZEN_NEVER


def bound_gusts(air: Dryden, V: float, h: float) -> tuple[float, np.ndarray]:
    """Bounds on the speed of gusts, m/s, and on their changes through each filter (poles,), m/s.

    The speed of a gust is a random walk of intensity Q (`Dryden.velocity_walk`); a filter with a pole of
    lam 1/s keeps T = h / (1 - exp(-2 lam h)) of it. V m/s: airspeed in trim.
    """
    sigma = air.sigma_mps
    Q = air.velocity_walk(V, MAX_AIRSPEED_OVER_TRIM)
    T = [h / (1.0 - exp(-2.0 * lam * h)) for lam in FILTER_POLES_PER_S]
    return GUST_LIMIT_SIGMA * sigma, GUST_LIMIT_SIGMA * np.sqrt(Q * np.array(T))


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
    elif t_s > finding["detection_time_s"] + UNANTICIPATED_DELAY_S:
        finding["isolated"] = finding["isolation_type"] = "unanticipated"
        finding["isolation_time_s"] = finding["detection_time_s"] + UNANTICIPATED_DELAY_S
    else:
        pairs = zip(SENSORS, output["suspect"], strict=True)
        finding["candidates"] = tuple(sensor_words(name) for name, suspected in pairs if suspected)
    return finding


# The rates are against the rotating Earth; the level turns as the aircraft flies over the round Earth.
EARTH_TURN_RAD_S = 4e-5
EARTH_M_S2 = 0.03  # Coriolis, centrifugal, and gravity's change with place
DENSITY_SCALE_HEIGHT_M = 6300.0  # over which the density falls by a factor e at most: in the stratosphere
MAX_PITCH_RAD = 1.3  # beyond it, roll and heading cannot be distinguished: the attitude tests restart
MIN_AIRSPEED_MPS = 1.0  # at least so much where an airspeed divides
MIN_QDYN_PA = 1.0  # the same of the dynamic pressure
MIN_HALF_DENSITY = 1e-9  # kg/m3, of which the logarithm is taken: far below half a density
MIN_SPEED_MPS = 1e-3  # at least so much where a predicted speed divides
# of a reading that its constant error leaves, at least, under a logarithm
MIN_SHARE_LEFT = 0.01
READING_ROUNDING = 1e-10  # of a reading: the part of each bound that covers rounding
# of a test that compares a reading with its prediction: that reading
READING_OF = ((SPEED_TEST, AIRSPEED), (ALPHA_TEST, ALPHA), (BETA_TEST, BETA), (CLIMB_TEST, ALTITUDE))
COMPARISON_ROUNDING = 1e-6  # in the unit of the reading: the same where two readings are compared directly
# JSBSim integrates the velocity by Adams and Bashforth's second order, v + h (3/2 a - 1/2 a_before).
AB_NOW, AB_PAST = 1.5, 0.5
# It integrates the position by their third order, h (23 v - 16 v_before + 5 v_earlier) / 12. That differs
# from h v, which predicts the altitude, by at most h^2 (11 + 5) / 12 of the largest acceleration.
POSITION_FACTOR = 4.0 / 3.0


@kernel
def times(p, q):
    """p q of two quaternions: (p1 q1 - p2 q2*, p1 q2 + p2 q1*)."""
    return p[0] * q[0] - p[1] * q[1].conjugate(), p[0] * q[1] + p[1] * q[0].conjugate()


@kernel
def inverse(q):
    """q*: the turn back."""
    return q[0].conjugate(), -q[1]


@kernel
def attitude(y):
    """q of the Euler angles: psi about the third axis, theta about the second, phi about the first."""
    c2, s2 = np.cos(y[THETA] / 2), np.sin(y[THETA] / 2)
    c3, s3 = np.cos(y[PSI] / 2), np.sin(y[PSI] / 2)
    z = complex(np.cos(y[PHI] / 2), np.sin(y[PHI] / 2))
    return complex(c2 * c3, -s2 * s3) * z, complex(s2 * c3, c2 * s3) * z.conjugate()


@kernel
def turn_of_step(w, h):
    """The turn by h w in one Euler step: (1, h w / 2) / |...|."""
    x, y, z = 0.5 * h * w[0], 0.5 * h * w[1], 0.5 * h * w[2]
    norm = np.sqrt(1.0 + x * x + y * y + z * z)
    return complex(1.0, x) / norm, complex(y, z) / norm


@kernel
def turned(q, v):
    """q* v q: the components of a constant vector v (3,) in axes that have turned by q."""
    z1, z2 = times(times(inverse(q), (complex(0.0, v[0]), complex(v[1], v[2]))), q)
    return z1.imag, z2.real, z2.imag


@kernel
def turn_share(y, i, j):
    """c: rotation about body axis i for a change of phi, theta or psi (j 0, 1, 2), rad/rad, at attitude y."""
    if j == 2:
        return down(y)[i]
    return (1.0, 0.0, 0.0)[i] if j == 0 else (0.0, np.cos(y[PHI]), -np.sin(y[PHI]))[i]


@kernel
def down(y):
    """The vertical unit vector, downwards, in body axes."""
    c = np.cos(y[THETA])
    return -np.sin(y[THETA]), np.sin(y[PHI]) * c, np.cos(y[PHI]) * c


@kernel
def dot(v, w):
    """v . w of vectors (3,)."""
    return v[0] * w[0] + v[1] * w[1] + v[2] * w[2]


@kernel
def combined(a, v, b, w):
    """a v + b w of vectors (3,)."""
    return a * v[0] + b * w[0], a * v[1] + b * w[1], a * v[2] + b * w[2]


@kernel
def vector_length(v):
    """|v| of a vector (3,)."""
    return np.sqrt(dot(v, v))


@kernel
def exceeds(r, k, B, x, H):
    """Whether no error of a set explains a filtered residual: |r_m| > k B_m + x H_m for some pole m.

    B (poles,): bound for sound sensors; H (poles,): on the effect of a unit of an error, of at most x.
    """
    for m in range(r.size):
        if abs(r[m]) > k * B[m] + x * H[m]:
            return True
    return False


@kernel
def bound_readings(red, y):
    """Bounds by declaration: e = (e_zero + e_slope |y|) / (1 - e_slope), and e_new = e - const."""
    c, M = red.config, red.memory
    for i in range(N_SENSORS):
        size = abs(wrapped(y[i]) if i == PSI else y[i])
        e = (c.e_zero[i] + c.e_slope[i] * size) / (1.0 - c.e_slope[i])
        M.e_new[i] = e - c.const[i] + READING_ROUNDING * abs(y[i])
        M.reading_bound[i] = e + M.e_drift if PHI <= i <= PSI else e


@kernel
def store_sample(red, y, force):
    """Take y and the specific force (3,) m/s2 as the sample before, for the next one."""
    M = red.memory
    M.y_past[:] = y
    M.e_older[:] = M.e_past
    M.e_past[:] = M.reading_bound
    M.a[:] = combined(1.0, force, red.config.g, down(y))


@kernel
def predict_readings(red):
    """Fill y_pred: attitude, flow and altitude now, from the sample before. Returns the attitude.

    v <- v + h (3/2 a - 1/2 a_past), turned by -h w, as a_past is then. Of q = z1 + z2 j

        phi = arg(z1^2 - z2*^2),    2 z1 z2 = sin(theta) + i cos(theta) sin(psi)
    """
    M, h = red.memory, red.config.sample_time_s
    y, y_past = M.predicted_reading, M.y_past
    step = turn_of_step(y_past, h)
    q = times(attitude(y_past), step)
    roll = q[0] * q[0] - (q[1] * q[1]).conjugate()
    nose = 2.0 * q[0] * q[1]
    y[PHI] = np.arctan2(roll.imag, roll.real)
    y[THETA] = np.arcsin(min(max(nose.real, -1.0), 1.0))
    y[PSI] = np.arctan2(nose.imag, abs(q[0]) ** 2 - abs(q[1]) ** 2)
    alpha, beta, V = y_past[ALPHA], y_past[BETA], y_past[AIRSPEED]
    v = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    y[ALTITUDE] = y_past[ALTITUDE] - h * dot(v, down(y_past))
    a = combined(AB_NOW, M.a, -AB_PAST, M.a_past)
    M.a_size_past = vector_length(M.a_past)
    M.a_size[2] = M.a_size[1]
    M.a_size[1] = M.a_size[0]
    M.a_size[0] = vector_length(a)
    M.a_past[:] = turned(step, M.a)
    v = turned(step, combined(1.0, v, h, a))
    y[AIRSPEED] = vector_length(v)
    y[ALPHA] = np.arctan2(v[2], v[0])
    y[BETA] = np.arcsin(v[1] / max(y[AIRSPEED], MIN_SPEED_MPS))
    return q


@kernel
def half_density(y):
    """qdyn / V^2, kg/m3."""
    return max(y[QDYN] / y[AIRSPEED] ** 2, MIN_HALF_DENSITY)


@kernel
def fill_residuals(red, y, q):
    """Fill the residual of each test: y - y_pred; of turning 2 (q* q_now); of the density
    log(rho / rho_past), rho = qdyn / V^2. q: the attitude as predicted.
    """
    tests, y_pred = red.test, red.memory.predicted_reading
    z1, z2 = times(inverse(q), attitude(y))
    side = 2.0 if z1.real >= 0.0 else -2.0
    for i, turn in enumerate((z1.imag, z2.real, z2.imag)):
        tests[TURN_TEST + i].residual = side * turn
        tests[ANGLE_TEST + i].residual = wrapped(y[PHI + i] - y_pred[PHI + i])
    for j, i in READING_OF:
        tests[j].residual = y[i] - y_pred[i]
    tests[DENSITY_TEST].residual = np.log(half_density(y) / half_density(red.memory.y_past))


@kernel
def highest(red, y, i):
    """Bound |y_i| in this sample and the one before: |y| + e."""
    M = red.memory
    return max(abs(y[i]) + M.reading_bound[i], abs(M.y_past[i]) + M.e_past[i])


@kernel
def lowest(red, y, i):
    """Lower bound on y_i in this sample and the one before: y - e."""
    M = red.memory
    return min(y[i] - M.reading_bound[i], M.y_past[i] - M.e_past[i])


@kernel
def secant(angle):
    """1 / cos(angle), rad, of no more than MAX_PITCH_RAD."""
    return 1.0 / np.cos(min(abs(angle), MAX_PITCH_RAD))


@kernel
def too_steep(red, y):
    """Whether the tests of turning and of the angles restart, in this sample and the one before."""
    return highest(red, y, THETA) > MAX_PITCH_RAD


@kernel
def bound_acceleration(red, w_max, e_w):
    """e_a: bound on the error of the acceleration of the elapsed step, m/s2.

    A sensor adds to 3/2 y - 1/2 y_before the error 3/2 e_past + 1/2 e_older - const at most: accelerometers,
    and the attitude, which gives gravity its direction. Turning the previous acceleration into the present
    axes adds more.
    """
    c, M = red.config, red.memory
    e_force2, e_tilt, e_const = 0.0, 0.0, 0.0
    for i in (PHI, THETA, AX, AX + 1, AX + 2):
        e = AB_NOW * M.e_past[i] + AB_PAST * M.e_older[i] - c.const[i]
        if i < AX:
            e_tilt += e
            e_const += c.g * c.const[i]
        else:
            e_force2 += e**2
            e_const += c.const[i]
    e_turn = c.sample_time_s * (w_max * e_const + AB_PAST * e_w * M.a_size_past)
    return EARTH_M_S2 + M.e_first + c.g * e_tilt + np.sqrt(e_force2) + e_turn


@kernel
def bound_attitude(red, y, w_max, e_w):
    """Fill the bounds of `bound_residuals` for the tests of the attitude.

    A constant error of the attitude turns with the aircraft: in the rates J(phi, theta) (phi', theta', psi')
    it changes J. A momentary error (e_brief) turns an axis when it begins, and back when it ends with another
    J. sec: largest 1 / cos(theta); n: e_new of phi, theta, psi.
    """
    tests, c, M = red.test, red.config, red.memory
    e, n = M.e_past, M.e_new[PHI:]
    sec = secant(highest(red, y, THETA))
    turn = c.sample_time_s * w_max
    tilt = abs(y[PHI] - M.y_past[PHI]) + abs(y[THETA] - M.y_past[THETA])
    e_brief = e[THETA] - c.const[THETA] + e[PSI] - c.const[PSI] + n[1] + n[2]
    e_axes = w_max * (e[PHI] + e[THETA] + e[PSI] + sec * e[THETA]) + tilt * e_brief / c.sample_time_s
    e_rate = EARTH_TURN_RAD_S + (1.0 + sec * turn) * e_w + 2.0 * sec * w_max * (e[PHI] + e[THETA])
    s_theta = abs(np.sin(y[THETA])) + n[1]
    s_phi = abs(np.sin(y[PHI])) + n[0]
    for i, coupled in enumerate((s_theta * n[2], s_phi * n[2], s_phi * n[1])):
        tests[TURN_TEST + i].bound_per_s = EARTH_TURN_RAD_S + 2.0 * c.drift + e[P + i] + turn * e_w + e_axes
        tests[TURN_TEST + i].bound_per_sample = n[i] + coupled
        tests[ANGLE_TEST + i].bound_per_s = sec * e_rate + c.drift
        tests[ANGLE_TEST + i].bound_per_sample = n[i]


@kernel
def bound_flow(red, y, w_max, e_w):
    """Fill the bounds of `bound_residuals` for the tests of flow and climb: the largest derivative of their
    kinematics with respect to each reading, times the bound e of the reading.

    sec: largest 1 / cos(beta); second: 1 and the second order in h; gust: how much faster a gust changes.
    """
    tests, c, M = red.test, red.config, red.memory
    e, h = M.e_past, c.sample_time_s
    V = max(lowest(red, y, AIRSPEED), MIN_AIRSPEED_MPS)
    sec = secant(highest(red, y, BETA))
    e_vane, e_V = e[ALPHA] + e[BETA], e[AIRSPEED]
    e_a = bound_acceleration(red, w_max, e_w)
    a = M.a_size[0] + e_a
    second = 1.0 + h * (2.0 * M.a_size[0] / V + w_max)
    low = max(lowest(red, y, ALTITUDE), LEAST_HEIGHT_M)
    gust = np.sqrt(max(y[AIRSPEED] / c.max_airspeed_mps, 1.0) * max(c.low_m / low, 1.0))
    e_flow = sec**2 * ((e_a + a * (e_vane + e_V / V)) / V + w_max * e_vane) + sec * e_w
    tests[SPEED_TEST].gust_gain = gust
    tests[SPEED_TEST].bound_per_s = e_a + second * a * e_vane + h * (a / V) ** 2 * e_V
    for j in (ALPHA_TEST, BETA_TEST):
        tests[j].gust_gain = gust * sec / V
        tests[j].bound_per_s = second * e_flow
    tests[CLIMB_TEST].bound_per_s = (
        c.wind_max
        + c.gust_max
        + (M.y_past[AIRSPEED] + e_V) * (e[PHI] + e[THETA] + e_vane)
        + e_V
        + POSITION_FACTOR * h * max(a, M.a_size[1], M.a_size[2])
    )
    for j, i in READING_OF:
        tests[j].bound_per_sample = M.e_new[i]


@kernel
def bound_density(red, y):
    """Fill the bounds of `bound_residuals` for the logarithm of the density: climb over the scale height, and
    log(y) of the dynamic pressure and, twice, of the airspeed: of a constant error e

        e |1 / y - 1 / y_past| / (1 - e / y_min)
    """
    test, c, M = red.test[DENSITY_TEST], red.config, red.memory
    climb = M.y_past[AIRSPEED] + M.e_past[AIRSPEED] + c.wind_max + c.gust_max
    test.bound_per_s, test.bound_per_sample = climb / DENSITY_SCALE_HEIGHT_M, 0.0
    for i, n, least in ((QDYN, 1.0, MIN_QDYN_PA), (AIRSPEED, 2.0, MIN_AIRSPEED_MPS)):
        e, now, past = c.const[i], max(y[i], least), max(M.y_past[i], least)
        e_log = e * abs(1.0 / now - 1.0 / past) / max(1.0 - e / min(now, past), MIN_SHARE_LEFT)
        test.bound_per_s += n * e_log / c.sample_time_s
        test.bound_per_sample += n * M.e_new[i] / max(y[i] - M.reading_bound[i], least)


@kernel
def bound_residuals(red, y):
    """Fill bound_per_s and bound_per_sample of each test: the largest effect of sound sensors with the
    declared errors.

    The errors of the sample before act through the prediction, those of this sample through the reading that
    is compared with it.
    """
    e, w = red.memory.e_past, red.memory.y_past
    e_w = e[P] + e[Q] + e[R]
    w_max = abs(w[P]) + abs(w[Q]) + abs(w[R]) + e_w
    bound_attitude(red, y, w_max, e_w)
    bound_flow(red, y, w_max, e_w)
    bound_density(red, y)


@kernel
def filter_test(red, test):
    """Pass one test's residual through its filters, a = exp(-pole h); find its largest ratio to the bound:

    r <- a r + residual,    B = e + bound_per_sample + gust_gain gust_change,    ratio = max |r| / B

    e, the part that the filter sums, as that of a detection filter.
    """
    c, test.ratio = red.config, 0.0
    leak(test.r, c.decay, test.residual)
    for m, a in enumerate(c.decay):
        test.e[m] = advance_bound(test.e[m], test.bound_per_s, a, c.sample_time_s, test.past_bound)
        test.B[m] = test.e[m] + test.bound_per_sample + test.gust_gain * c.gust_change[m]
        test.ratio = max(test.ratio, abs(test.r[m]) / test.B[m])
    test.past_bound = test.bound_per_sample


@kernel
def restart_test(test):
    """Restart a test with this sample: its filters are empty, and the whole bound per sample is still due."""
    test.ratio = test.residual = 0.0
    test.r[:] = 0.0
    test.e[:] = test.past_bound = test.bound_per_sample


@kernel
def compare(test, residual, bound):
    """Judge a residual alone, without a filter, by the bound on it."""
    test.residual, test.B[0] = residual, bound + COMPARISON_ROUNDING
    test.ratio = abs(residual) / test.B[0]


@kernel
def compare_duplicates(red, y, fresh):
    """Compare each duplicate sensor i with the reading j that it should equal, in the samples in which it is
    fresh; fresh (sampled sensors,). One of the two is broken if they differ by more than tolerance + e_i +
    e_j.
    """
    e = red.memory.reading_bound
    for d in range(DUPLICATE.size):
        i, j, test = DUPLICATE[d], COUNTERPART[d], red.test[N_EQUATIONS + d]
        test.ratio = 0.0
        if fresh[i - N_IN_EQUATIONS]:
            r = y[i] - y[j]
            compare(test, wrapped(r) if PHI <= j <= PSI else r, DUPLICATE_TOLERANCE[d] + e[i] + e[j])


@kernel
def start_tests(red, y, force):
    """Start with the first sample, before which no reading is known; force (3,) m/s2."""
    M = red.memory
    bound_readings(red, y)
    store_sample(red, y, force)
    M.e_older[:] = M.e_past
    M.a_past[:] = M.a
    M.a_size[:2] = vector_length(M.a) + FORCE_JUMP_M_S2
    M.e_first = AB_PAST * FORCE_JUMP_M_S2
    bound_residuals(red, y)
    for j in range(RPM_TEST):
        restart_test(red.test[j])


@kernel
def run_tests(red, y, has_engine):
    """Compare this sample y with the one before."""
    c, M = red.config, red.memory
    M.e_drift += c.sample_time_s * c.drift
    bound_readings(red, y)
    fill_residuals(red, y, predict_readings(red))
    bound_residuals(red, y)
    M.e_first = 0.0
    steep = too_steep(red, y)
    for j in range(RPM_TEST):
        if steep and j < SPEED_TEST:
            restart_test(red.test[j])
        else:
            filter_test(red, red.test[j])
    if has_engine:
        for i in range(2):
            k = ENGINE_SPEED + i
            compare(red.test[RPM_TEST + i], y[k] - M.engine_commands[i], M.reading_bound[k])
