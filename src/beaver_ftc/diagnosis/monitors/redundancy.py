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
    n                  (N_SENSORS,)  bound on the part of an error that changes from sample to sample
    w, w_max                         body rates (3,), bound on |p| + |q| + |r|; rad/s
    e_w                              sum of the bounds on the errors of the three gyros, rad/s
    v, a, a_past       (2,)          vectors: velocity m/s, acceleration m/s2 with gravity, that of before
    q, p               (z1, z2)      quaternion z1 + z2 j of complex numbers; an attitude turns body to level
                                     axes; a vector of components x, y, z is (x i, y + z i)
    h                                time between two samples, s: a JSBSim frame
    i, j, m, d                       sensor or axis, test, pole of a filter, duplicate sensor
    mon                              record of the monitor

This file also has the records of the sensor monitor, their configuration, and its finding in words.
"""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design import LEAST_HEIGHT_M, Dryden
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.detection.filters import advance_bound, leak
from beaver_ftc.diagnosis.deviations import air_rotation_slopes
from beaver_ftc.diagnosis.state import fill
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

# The tests by number; 0 to 2 are of turning about axis 0 to 2, 3 to 5 of phi, theta, psi. In each, a jump of
# one reading appears at once: the rows of the sensors name it.
TEST_NAMES = (
    "roll", "pitch", "yaw", "bank angle", "pitch angle", "heading", "speed", "incidence", "sideslip",
    "density", "climb", "engine speed", "manifold pressure",
)  # fmt: skip
TURN_TEST, ANGLE_TEST, SPEED_TEST, ALPHA_TEST, BETA_TEST, DENSITY_TEST, CLIMB_TEST = 0, 3, 6, 7, 8, 9, 10
RPM_TEST, PRESSURE_TEST = 11, 12
N_EQUATIONS = len(TEST_NAMES)  # then the tests of sensors that should equal another reading
_NAMED = [row.test for row in ROWS]
SENSOR_OF = tuple(_NAMED.index(name) for name in TEST_NAMES)
DUPLICATES = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_EQUATIONS + len(DUPLICATES)
# Of each sensor that should equal another reading (its row in scenario/sensors.py says which): its place in
# the readings, the place of that reading, the test that an error of that reading exceeds, and the largest
# difference of the two quantities, SI.
DUPLICATE = np.array([i for i, _ in DUPLICATES], np.int64)
COUNTERPART = np.array([SENSORS.index(equal.reading) for _, equal in DUPLICATES], np.int64)
COUNTERPART_TEST = np.array([TEST_NAMES.index(_NAMED[i]) for i in COUNTERPART], np.int64)
DUPLICATE_TOLERANCE = np.array([equal.within for _, equal in DUPLICATES], float)
FILTER_POLES_PER_S = (1e6, 10.0, 1.0)  # of the filters of each test; the first is the residual itself
N_POLES = len(FILTER_POLES_PER_S)
NO_SENSOR = -1
ERRORS = {"e_zero": "worst", "e_slope": "slope", "const": "steady"}  # of a reading, by their declared names
FORCE_JUMP_M_S2 = 8.0  # a sound specific force changes by less from one sample to the next
GYRO_OPEN, GYRO_CONFIRMED, GYRO_REFUTED = 0, 1, 2  # verdicts of a gyro
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
H_AIRSPEED, H_ALPHA, H_BETA, H_PHI, H_THETA = range(5)
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

MONITOR_CONFIG_RECORD = record(
    enabled=int, substeps=int, has_engine=int, y_trim=N_SENSORS,
    rate_gain=float,  # share of its error that a replaced rate corrects in one sample
    noisy=int,  # the attitude: then a surface is isolated only once no gyro can be the cause
    n_frozen=(int, N_SENSORS),  # number of identical samples from which a reading counts as frozen
    D=(3, 3),  # 1/s: body rates decay with rate' = -D rate
)  # fmt: skip

MONITOR_OUTPUT_RECORD = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface=int,  # a surface was found long before, with sound sensors: it stays found
    alarm_test=int,  # test that has raised the alarm
    worst_test_index=int, top_ratio=float,  # test with the largest ratio of this frame, and that ratio
    suspect=(int, N_SENSORS), isolated_sensor=int, isolated_at_s=float, is_reading_unused=(int, N_SENSORS),
)  # fmt: skip

# Of an axis. shown, shown_past, rad/s: error of the gyro if the attitude is right, as this frame begins and
# as the one before began; most, least: of its size in the other samples of this frame, of the one before
# (most_past, least_past), of the one before that. gap, B_gap (poles,) rad: filtered difference of the turn
# that the attitude and w show, and its bound; beyond it no gyro can be broken. replaced: its reading.
GYRO_RECORD = record(
    shown=float, shown_past=float, most=float, most_past=float, most_older=float,
    least=float, least_past=float, gap=N_POLES, B_gap=N_POLES, verdict=int, replaced=int,
)  # fmt: skip

# Of speed, incidence or sideslip, since the alarm: sums of the residuals, of the part of sound sensors, of
# the part of an initial error; range of the reading.
FLOW_RECORD = record(r_sum=float, B_sum=float, H_sum=float, y_min=float, y_max=float)

# Symbols: above.
SENSOR_MONITOR_RECORD = record(
    config=MONITOR_CONFIG_RECORD, output=MONITOR_OUTPUT_RECORD,
    h=float, decay=N_POLES, g=float,  # decay: of each filter per sample; g m/s2
    # Declared turbulence, m/s: bound on a gust's speed; bound on its changes through each filter, which
    # holds up to max_airspeed_mps, and above low_m: below it a gust changes faster
    gust_max=float, gust_change=N_POLES, max_airspeed_mps=float, low_m=float,
    wind_max=float,  # of the vertical wind, m/s
    # Declared errors, SI: |error| <= e_zero + e_slope |y|, of which const does not change; of the attitude,
    # rad/s
    e_zero=N_SENSORS, e_slope=N_SENSORS, const=N_SENSORS, drift=float,
    # Bounds on the error of each reading; e_drift: part of them by drift, rad
    e=N_SENSORS, n=N_SENSORS, e_drift=float, e_past=N_SENSORS, e_older=N_SENSORS,
    # of the sample before; predict_readings turns a_past into the present axes
    y_past=N_SENSORS, y_older=N_SENSORS, a=(complex, 2), a_past=(complex, 2),
    # m/s2: |a| in the elapsed step and in the two before it; of a_past
    a_size=3, a_size_past=float,
    e_first=float,  # m/s2, in the first step only: no sample precedes it
    y_pred=N_SENSORS,  # of the engine's readings: the commands
    # By test, in the unit of the residual. per_s, per_sample: parts of the bound on the residual of one
    # sample, the first for each second of it; past: per_sample of the sample before. gust: effect on the
    # residual of 1 m/s that a gust changes by. r: filtered residual. B: bound on |r|; e_sum: the part of it
    # that the filter sums. ratio: largest |r| / B over the poles.
    residual=N_TESTS, per_s=N_TESTS, per_sample=N_TESTS, past=N_TESTS, gust=N_TESTS,
    r=(N_TESTS, N_POLES), B=(N_TESTS, N_POLES), e_sum=(N_TESTS, N_POLES), ratio=N_TESTS,
    # Errors from the start: symbols of initial_errors.py
    E_start=N_INITIAL, E=N_INITIAL, E_alarm=N_INITIAL, d=N_INITIAL,
    H=(N_INITIAL, RPM_TEST), H_m=(N_INITIAL, RPM_TEST, N_POLES),
    C=(complex, N_EFFECTS), C_m=(complex, N_EFFECTS, N_POLES),
    refuted=(int, N_INITIAL, N_TESTS),  # since the alarm
    stage=int, t_start=float, substep=int, exceeded=(int, N_TESTS),
    # since the alarm, rad: by angle, body axis and pole, filtered residual of turning beyond the part of the
    # angle's own residual; by angle and pole, filtered size of the angle's residual; by angle and body axis,
    # largest size of turn_share
    beyond=(3, 3, N_POLES), swing=(3, N_POLES), c_max=(3, 3),
    # by axis, rad/s: error of the gyro if the dynamics are right (w of sensor_monitor.py), and its bound
    w=3, w_bound=3, gyro=(GYRO_RECORD, 3), flow=(FLOW_RECORD, 3),
    agreed=(int, max(len(DUPLICATES), 1)),  # a sensor with the reading that it should equal
    gyros_excluded=int, n_same=(int, N_SENSORS), cleared=(int, N_SENSORS), turn_max=float,
    jump=float,  # of the accelerometers, m/s2, which fades
    n_since=int,  # samples since the alarm
    climb=N_POLES,  # m, filtered: error of the climb, of an incidence with the error that its residuals show
)  # fmt: skip


def configure_sensor_monitor(monitor: np.void, declared: Declared, design: np.void, y: np.ndarray) -> None:
    """Fill the monitor's record at the trim: y, the measured signals there; design: model of the designer.

    A monitor that is not declared has found nothing, and its record holds no more than that.
    """
    config = monitor["config"]
    fill(monitor["output"], isolated_sensor=NO_SENSOR, alarmed_at_s=-1.0, isolated_at_s=-1.0)
    config["enabled"] = declared.monitors_sensors
    if not declared.monitors_sensors:
        return
    initial, air = cast("Any", declared.initial), declared.air  # whose keys the aircraft names
    D = air_rotation_slopes(DesignFunctions(np.array([design])), y)
    engine, h = declared.aircraft.has_engine_instruments, 1.0 / declared.rate_hz / declared.substeps
    gust_max, gust_change = bound_gusts(air, initial.airspeed_mps, h)
    fill(config, substeps=declared.substeps, has_engine=engine, D=D)
    config["y_trim"][3:7] = y[:4]
    fill(
        monitor, h=h, decay=[exp(-lam * h) for lam in FILTER_POLES_PER_S],
        g=GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2,
        gust_max=gust_max, gust_change=gust_change, low_m=air.low_m, wind_max=declared.vertical_wind_mps,
        max_airspeed_mps=MAX_AIRSPEED_OVER_TRIM * initial.airspeed_mps,
        substep=declared.substeps - 1,  # the first JSBSim frame ends a frame of the loop
    )  # fmt: skip
    if engine:
        monitor["y_pred"][[ENGINE_SPEED, MANIFOLD]] = initial.engine_rpm, initial.manifold_pressure_inhg
    configure_errors(monitor, declared)


def configure_errors(monitor: np.void, declared: Declared) -> None:
    """Fill the declared errors of the readings, and from how many identical samples each is frozen; a sample
    is a JSBSim frame."""
    config, sensors, h = monitor["config"], declared.sensors, float(monitor["h"])
    fill(monitor, **{name: sensors.each(kind, SENSORS) for name, kind in ERRORS.items()})
    drifts = [getattr(getattr(sensors.declared, name), "drift_rad_s", 0.0) for name in SENSORS]
    monitor["drift"] = max(map(abs, drifts))
    for i, name in enumerate(SENSORS):
        e = sensors[name]
        config["n_frozen"][i] = n_frozen(e.noise, e.resolution) * frames_apart(i, h)
    noisy = np.any((monitor["e_zero"] > monitor["const"])[PHI : PHI + 3])
    fill(config, noisy=noisy, rate_gain=min(1.0, h * RATE_GAIN_PER_S) if noisy else 1.0)


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
    o = monitor["output"]
    if not o["alarmed"]:
        return None
    finding: dict[str, Any] = {
        "isolated": None, "isolation_type": None, "estimate": None, "candidates": (),
        "detection_time_s": float(o["alarmed_at_s"]), "isolation_time_s": None,
    }  # fmt: skip
    latest = finding["detection_time_s"] + UNANTICIPATED_DELAY_S
    if o["isolated_sensor"] >= 0:
        name, at_s = sensor_words(SENSORS[int(o["isolated_sensor"])]), float(o["isolated_at_s"])
        return finding | {"isolated": name, "isolation_time_s": at_s}
    if t_s > latest:
        name = "unanticipated"
        return finding | {"isolated": name, "isolation_type": name, "isolation_time_s": latest}
    return finding | {"candidates": tuple(sensor_words(SENSORS[i]) for i in np.flatnonzero(o["suspect"]))}


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
COMPARISON_ROUNDING = 1e-6  # in the unit of the reading: the same where two readings are compared directly
# JSBSim integrates the velocity by Adams and Bashforth's second order, v + h (3/2 a - 1/2 a_before).
AB_NOW, AB_PAST = 1.5, 0.5
# It integrates the position by their third order, h (23 v - 16 v_before + 5 v_earlier) / 12. That differs
# from h v, which predicts the altitude, by at most h^2 (11 + 5) / 12 of the largest acceleration.
POSITION_FACTOR = 4.0 / 3.0


@kernel
def unit(angle):
    """exp(i angle)."""
    return complex(np.cos(angle), np.sin(angle))


@kernel
def times(p, q):
    """p q of two quaternions: (p1 q1 - p2 q2*, p1 q2 + p2 q1*)."""
    return p[0] * q[0] - p[1] * q[1].conjugate(), p[0] * q[1] + p[1] * q[0].conjugate()


@kernel
def inverse(q):
    """q*: the turn back."""
    return q[0].conjugate(), -q[1]


@kernel
def turned(q, v):
    """q* v q: a constant vector v in axes that have turned by q."""
    return times(times(inverse(q), v), q)


@kernel
def combined(a, v, b, w):
    """a v + b w of two quaternions or vectors."""
    return a * v[0] + b * w[0], a * v[1] + b * w[1]


@kernel
def length(q):
    """|q| of a quaternion or vector."""
    return np.hypot(abs(q[0]), abs(q[1]))


@kernel
def vector(x):
    """The vector of the components x, of which the first three count."""
    return complex(0.0, x[0]), complex(x[1], x[2])


@kernel
def components(q):
    """The components (3,) of a vector, or of a quaternion's part that is one."""
    return q[0].imag, q[1].real, q[1].imag


@kernel
def attitude(y):
    """q of the Euler angles: psi about the third axis, theta about the second, phi about the first."""
    heading, pitch = unit(0.5 * y[PSI]), unit(0.5 * y[THETA])
    level = (complex(heading.real), 1j * heading.imag), (complex(pitch.real), complex(pitch.imag))
    return times(times(level[0], level[1]), (unit(0.5 * y[PHI]), 0j))


@kernel
def down(y):
    """The vertical unit vector, downwards, in body axes."""
    return complex(0.0, -np.sin(y[THETA])), np.cos(y[THETA]) * complex(np.sin(y[PHI]), np.cos(y[PHI]))


@kernel
def turn_share(y, i, j):
    """c: rotation about body axis i for a change of phi, theta or psi (j 0, 1, 2), rad/rad, at attitude y."""
    across = 0.0, np.cos(y[PHI]), -np.sin(y[PHI])
    return ((1.0, 0.0, 0.0), across, components(down(y)))[j][i]


@kernel
def speed(y):
    """V, m/s, of a reading: where it divides."""
    return max(y[AIRSPEED], MIN_AIRSPEED_MPS)


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
def bound_readings(mon, y):
    """Bounds by declaration: e = (e_zero + e_slope |y|) / (1 - e_slope), and n = e - const."""
    for i in range(N_SENSORS):
        size = abs(wrapped(y[i]) if i == PSI else y[i])
        e = (mon.e_zero[i] + mon.e_slope[i] * size) / (1.0 - mon.e_slope[i])
        mon.n[i] = e - mon.const[i] + READING_ROUNDING * abs(y[i])
        mon.e[i] = e + mon.e_drift if PHI <= i <= PSI else e


@kernel
def store_sample(mon, y, force):
    """Take y and the specific force (3,) m/s2 as the sample before, for the next one."""
    mon.y_older[:] = mon.y_past
    mon.y_past[:] = y
    mon.e_older[:] = mon.e_past
    mon.e_past[:] = mon.e
    mon.a[:] = combined(1.0, vector(force), mon.g, down(y))


@kernel
def expect_pressure(mon, pressure):
    """Predict the manifold pressure, inHg, from the command of the law in charge of the engine."""
    mon.y_pred[MANIFOLD] = pressure


@kernel
def predict_readings(mon):
    """Fill y_pred: attitude, flow and altitude now, from the sample before. Returns the attitude.

    q <- q (1, h w / 2) / |...|: the turn of an Euler step; v <- v + h (3/2 a - 1/2 a_past), turned by -h w,
    as a_past is then. Of q = z1 + z2 j

        phi = arg(z1^2 - z2*^2),    2 z1 z2 = sin(theta) + i cos(theta) sin(psi)
    """
    h, y, past = mon.h, mon.y_pred, mon.y_past
    w = vector(past)
    s1, s2 = 1.0 + 0.5 * h * w[0], 0.5 * h * w[1]
    size = length((s1, s2))
    step = s1 / size, s2 / size
    q = times(attitude(past), step)
    roll, nose = q[0] ** 2 - q[1].conjugate() ** 2, 2.0 * q[0] * q[1]
    y[PHI] = np.angle(roll)
    y[THETA] = np.arcsin(min(max(nose.real, -1.0), 1.0))
    y[PSI] = np.arctan2(nose.imag, abs(q[0]) ** 2 - abs(q[1]) ** 2)
    flow = past[AIRSPEED] * unit(past[BETA])
    plane = flow.real * unit(past[ALPHA])
    v = complex(0.0, plane.real), complex(flow.imag, plane.imag)
    climb = times(v, down(past))[0].real  # minus the product of two vectors is their scalar product
    y[ALTITUDE] = past[ALTITUDE] + h * climb
    a = combined(AB_NOW, mon.a, -AB_PAST, mon.a_past)
    mon.a_size_past = length(mon.a_past)
    mon.a_size[:] = length(a), mon.a_size[0], mon.a_size[1]
    mon.a_past[:] = turned(step, mon.a)
    v = turned(step, combined(1.0, v, h, a))
    y[AIRSPEED] = length(v)
    y[ALPHA] = np.arctan2(v[1].imag, v[0].imag)
    y[BETA] = np.arcsin(v[1].real / max(y[AIRSPEED], MIN_SPEED_MPS))
    return q


@kernel
def half_density(y):
    """qdyn / V^2, kg/m3."""
    return max(y[QDYN] / y[AIRSPEED] ** 2, MIN_HALF_DENSITY)


@kernel
def fill_residuals(mon, y, q):
    """Fill the residual of each test: y - y_pred; of turning 2 (q* q_now); of the density
    log(rho / rho_past), rho = qdyn / V^2. q: the attitude as predicted.
    """
    turn = times(inverse(q), attitude(y))
    side = 2.0 if turn[0].real >= 0.0 else -2.0
    mon.residual[:ANGLE_TEST] = components(combined(side, turn, 0.0, turn))
    for j in range(ANGLE_TEST, RPM_TEST):
        r = y[SENSOR_OF[j]] - mon.y_pred[SENSOR_OF[j]]
        mon.residual[j] = wrapped(r) if j < SPEED_TEST else r
    mon.residual[DENSITY_TEST] = np.log(half_density(y) / half_density(mon.y_past))


@kernel
def highest(mon, y, i):
    """Bound |y_i| in this sample and the one before: |y| + e."""
    return max(abs(y[i]) + mon.e[i], abs(mon.y_past[i]) + mon.e_past[i])


@kernel
def lowest(mon, y, i):
    """Lower bound on y_i in this sample and the one before: y - e."""
    return min(y[i] - mon.e[i], mon.y_past[i] - mon.e_past[i])


@kernel
def secant(angle):
    """1 / cos(angle), rad, of no more than MAX_PITCH_RAD."""
    return 1.0 / np.cos(min(abs(angle), MAX_PITCH_RAD))


@kernel
def too_steep(mon, y):
    """Whether the tests of turning and of the angles restart, in this sample and the one before."""
    return highest(mon, y, THETA) > MAX_PITCH_RAD


@kernel
def bound_acceleration(mon, w_max, e_w):
    """e_a: bound on the error of the acceleration of the elapsed step, m/s2.

    A sensor adds to 3/2 y - 1/2 y_before the error 3/2 e_past + 1/2 e_older - const at most: accelerometers,
    and the attitude, which gives gravity its direction. Turning the previous acceleration into the present
    axes adds more.
    """
    e_a, force2 = EARTH_M_S2 + mon.e_first + mon.h * AB_PAST * e_w * mon.a_size_past, 0.0
    for i in (PHI, THETA, AX, AX + 1, AX + 2):
        e = AB_NOW * mon.e_past[i] + AB_PAST * mon.e_older[i] - mon.const[i]
        e_turn = mon.h * w_max * mon.const[i]
        if i < AX:
            e_a += mon.g * (e + e_turn)
        else:
            e_a += e_turn
            force2 += e**2
    return e_a + np.sqrt(force2)


@kernel
def bound_attitude(mon, y, w_max, e_w):
    """Fill the bounds of `bound_residuals` for the tests of the attitude.

    A constant error of the attitude turns with the aircraft: in the rates J(phi, theta) (phi', theta', psi')
    it changes J. A momentary error (brief) turns an axis when it begins, and back when it ends with another
    J. sec: largest 1 / cos(theta).
    """
    h, e, n, past, const = mon.h, mon.e_past, mon.n, mon.y_past, mon.const
    sec, turn = secant(highest(mon, y, THETA)), h * w_max
    tilt = abs(y[PHI] - past[PHI]) + abs(y[THETA] - past[THETA])
    brief = e[THETA] - const[THETA] + e[PSI] - const[PSI] + n[THETA] + n[PSI]
    axes = w_max * (e[PHI] + (1.0 + sec) * e[THETA] + e[PSI]) + tilt * brief / h + turn * e_w
    angles = EARTH_TURN_RAD_S + (1.0 + sec * turn) * e_w + 2.0 * sec * w_max * (e[PHI] + e[THETA])
    s_theta, s_phi = abs(np.sin(y[THETA])) + n[THETA], abs(np.sin(y[PHI])) + n[PHI]
    coupled = s_theta * n[PSI], s_phi * n[PSI], s_phi * n[THETA]
    for i in range(3):
        mon.per_s[i] = EARTH_TURN_RAD_S + 2.0 * mon.drift + e[i] + axes
        mon.per_sample[i] = n[PHI + i] + coupled[i]
        mon.per_s[ANGLE_TEST + i] = sec * angles + mon.drift


@kernel
def bound_flow(mon, y, w_max, e_w):
    """Fill the bounds of `bound_residuals` for the tests of flow and climb: the largest derivative of their
    kinematics with respect to each reading, times the bound e of the reading.

    sec: largest 1 / cos(beta); second: 1 and the second order in h; gust: how much faster a gust changes.
    """
    h, e, a_size = mon.h, mon.e_past, mon.a_size
    V = max(lowest(mon, y, AIRSPEED), MIN_AIRSPEED_MPS)
    sec = secant(highest(mon, y, BETA))
    vane, e_V = e[ALPHA] + e[BETA], e[AIRSPEED]
    e_a = bound_acceleration(mon, w_max, e_w)
    a, second = a_size[0] + e_a, 1.0 + h * (2.0 * a_size[0] / V + w_max)
    low = max(lowest(mon, y, ALTITUDE), LEAST_HEIGHT_M)
    gust = np.sqrt(max(y[AIRSPEED] / mon.max_airspeed_mps, 1.0) * max(mon.low_m / low, 1.0))
    flow = second * (sec**2 * ((e_a + a * (vane + e_V / V)) / V + w_max * vane) + sec * e_w)
    mon.per_s[SPEED_TEST:DENSITY_TEST] = e_a + second * a * vane + h * (a / V) ** 2 * e_V, flow, flow
    mon.gust[SPEED_TEST:DENSITY_TEST] = gust, gust * sec / V, gust * sec / V
    path = (mon.y_past[AIRSPEED] + e_V) * (e[PHI] + e[THETA] + vane)
    bend = POSITION_FACTOR * h * max(a, a_size[1], a_size[2])
    mon.per_s[CLIMB_TEST] = mon.wind_max + mon.gust_max + path + e_V + bend


@kernel
def bound_density(mon, y):
    """Fill the bounds of `bound_residuals` for the logarithm of the density: climb over the scale height, and
    log(y) of the dynamic pressure and, twice, of the airspeed: of a constant error e

        e |1 / y - 1 / y_past| / (1 - e / y_min)
    """
    j, past = DENSITY_TEST, mon.y_past
    climb = past[AIRSPEED] + mon.e_past[AIRSPEED] + mon.wind_max + mon.gust_max
    mon.per_s[j], mon.per_sample[j] = climb / DENSITY_SCALE_HEIGHT_M, 0.0
    for i, k, least in ((QDYN, 1.0, MIN_QDYN_PA), (AIRSPEED, 2.0, MIN_AIRSPEED_MPS)):
        e, y1, y0 = mon.const[i], max(y[i], least), max(past[i], least)
        e_log = e * abs(1.0 / y1 - 1.0 / y0) / max(1.0 - e / min(y1, y0), MIN_SHARE_LEFT)
        mon.per_s[j] += k * e_log / mon.h
        mon.per_sample[j] += k * mon.n[i] / max(y[i] - mon.e[i], least)


@kernel
def bound_residuals(mon, y):
    """Fill per_s and per_sample of each test: the largest effect of sound sensors with the declared errors.

    The errors of the sample before act through the prediction, those of this sample through the reading that
    is compared with it.
    """
    e_w = w_max = 0.0
    for i in range(3):
        e_w += mon.e_past[i]
        w_max += abs(mon.y_past[i]) + mon.e_past[i]
    for j in range(ANGLE_TEST, RPM_TEST):
        mon.per_sample[j] = mon.n[SENSOR_OF[j]]
    bound_attitude(mon, y, w_max, e_w)
    bound_flow(mon, y, w_max, e_w)
    bound_density(mon, y)


@kernel
def filter_test(mon, j):
    """Pass the residual of test j through its filters, a = exp(-pole h); find its largest ratio to the bound:

    r <- a r + residual,    B = e_sum + per_sample + gust gust_change,    ratio = max |r| / B

    e_sum, the part that the filter sums, as that of a detection filter.
    """
    r, e, B, n = mon.r[j], mon.e_sum[j], mon.B[j], mon.per_sample[j]
    mon.ratio[j] = 0.0
    leak(r, mon.decay, mon.residual[j])
    for m, a in enumerate(mon.decay):
        e[m] = advance_bound(e[m], mon.per_s[j], a, mon.h, mon.past[j])
        B[m] = e[m] + n + mon.gust[j] * mon.gust_change[m]
        mon.ratio[j] = max(mon.ratio[j], abs(r[m]) / B[m])
    mon.past[j] = n


@kernel
def restart_tests(mon, n):
    """Restart the first n tests with this sample: their filters are empty, and the whole bound per sample is
    still due."""
    mon.ratio[:n] = mon.residual[:n] = mon.r[:n] = 0.0
    for j in range(n):
        mon.e_sum[j] = mon.past[j] = mon.per_sample[j]


@kernel
def compare(mon, j, residual, bound):
    """Judge the residual of test j alone, without a filter, by the bound on it."""
    mon.residual[j], mon.B[j, 0] = residual, bound + COMPARISON_ROUNDING
    mon.ratio[j] = abs(residual) / mon.B[j, 0]


@kernel
def compare_duplicates(mon, y, fresh):
    """Compare each duplicate sensor i with the reading j that it should equal, in the samples in which it is
    fresh; fresh (sampled sensors,). One of the two is broken if they differ by more than tolerance + e_i +
    e_j. Those that have agreed before any alarm are recorded.
    """
    for d in range(DUPLICATE.size):
        i, j, test = DUPLICATE[d], COUNTERPART[d], N_EQUATIONS + d
        mon.ratio[test] = 0.0
        if fresh[i - N_IN_EQUATIONS]:
            r = wrapped(y[i] - y[j]) if PHI <= j <= PSI else y[i] - y[j]
            compare(mon, test, r, DUPLICATE_TOLERANCE[d] + mon.e[i] + mon.e[j])
            mon.agreed[d] |= mon.ratio[test] <= 1.0 and not mon.output.alarmed


@kernel
def start_tests(mon, y, force):
    """Start with the first sample, before which no reading is known; force (3,) m/s2."""
    bound_readings(mon, y)
    store_sample(mon, y, force)
    mon.y_older[:] = y
    mon.e_older[:] = mon.e_past
    mon.a_past[:] = mon.a
    mon.a_size[:2] = length(mon.a) + FORCE_JUMP_M_S2
    mon.e_first = AB_PAST * FORCE_JUMP_M_S2
    bound_residuals(mon, y)
    restart_tests(mon, RPM_TEST)


@kernel
def run_tests(mon, y, fresh):
    """Compare this sample y with the one before; fresh (sampled sensors,): those that are read now."""
    mon.e_drift += mon.h * mon.drift
    bound_readings(mon, y)
    fill_residuals(mon, y, predict_readings(mon))
    bound_residuals(mon, y)
    mon.e_first = 0.0
    first = SPEED_TEST if too_steep(mon, y) else 0
    restart_tests(mon, first)
    for j in range(first, RPM_TEST):
        filter_test(mon, j)
    if mon.config.has_engine:
        for j in (RPM_TEST, PRESSURE_TEST):
            i = SENSOR_OF[j]
            compare(mon, j, y[i] - mon.y_pred[i], mon.e[i])
    if N_TESTS > N_EQUATIONS:
        compare_duplicates(mon, y, fresh)
