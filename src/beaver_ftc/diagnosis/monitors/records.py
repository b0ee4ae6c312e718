"""The sensor monitor's tests by number, its records and their configuration, and its finding in words.

Letters as in redundancy.py, sensor_monitor.py and initial_errors.py, which fill the records.
"""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import record
from beaver_ftc.design import Dryden
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.deviations import air_rotation_slopes
from beaver_ftc.diagnosis.state import fill
from beaver_ftc.plant.instruments import (
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    SENSORS,
    SIGNALS,
)
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import ROWS, frames_apart, sensor_words

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
# So many identical samples a sound sensor never gives: one without resolution, and one with a noise of more
# than a quarter of its resolution.
N_FROZEN_EXACT = 3
N_FROZEN_ROUNDED = 50
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

# Symbols: redundancy.py.
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
