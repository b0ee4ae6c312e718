"""The records of the sensor monitor, how they are configured, and its verdict in words."""

from math import exp
from typing import Any, cast

import numpy as np

from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, GRAVITY_MPS2
from beaver_ftc.compiled import record
from beaver_ftc.design.context import DesignFunctions
from beaver_ftc.design.dryden import Dryden
from beaver_ftc.diagnosis.bounds.admitted import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.bounds.variances import gust_effect
from beaver_ftc.plant.instruments import N_SENSORS, PHI, SENSORS, SIGNALS
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import ROWS, frames_apart, sensor_words

TURN, ANGLE, SPEED, ALPHA_FLOW, BETA_FLOW, DENSITY, CLIMB, RPM, PRESSURE = 0, 3, 6, 7, 8, 9, 10, 11, 12
N_COMPUTED = 13  # tests with an equation; then those of sensors that should equal another reading
EQUAL = tuple((SENSORS.index(row.name), row.equal) for row in ROWS if row.equal is not None)
N_TESTS = N_COMPUTED + len(EQUAL)
# The test in which a jump of a reading appears at once, as the rows of the sensors name it.
TESTS = {
    "roll": TURN, "pitch": TURN + 1, "yaw": TURN + 2,
    "bank angle": ANGLE, "pitch angle": ANGLE + 1, "heading": ANGLE + 2,
    "speed": SPEED, "incidence": ALPHA_FLOW, "sideslip": BETA_FLOW, "density": DENSITY, "climb": CLIMB,
    "engine speed": RPM, "manifold pressure": PRESSURE,
}  # fmt: skip
# Of each sensor that should equal another reading: its place, that of the reading, the test in which the
# reading's own errors appear, and by how much the quantities may differ, SI.
EQUAL_SENSOR = np.array([i for i, _ in EQUAL], np.int64)
EQUAL_READING = np.array([SENSORS.index(to.reading) for _, to in EQUAL], np.int64)
EQUAL_SHOWS = np.array([TESTS[ROWS[SENSORS.index(to.reading)].test] for _, to in EQUAL], np.int64)
EQUAL_WITHIN = np.array([to.within for _, to in EQUAL], float)
POLES_PER_S = (1e6, 10.0, 1.0)
N_POLES = len(POLES_PER_S)
NO_SENSOR = -1
LEAP_M_S2 = 8.0  # by which no specific force changes from one look to the next
UNKNOWN, YES, NO = 0, 1, 2
FASTER = 1.4  # than in trim a flight may become
ATTITUDE_TAKES_OVER_PER_S = 3.0  # a rate that it replaces, where the attitude's own noise is declared
NEVER_STILL = 1_000_000_000  # JSBSim frames: of a reading that resolves less than it scatters
WAIT_S = 1.0  # for the instrument to be found; then the fault is outside what can be named
P, Q, R, ALPHA, BETA, AIRSPEED, QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2

# Hypotheses of since_start.py: the instruments that may be broken when the monitor begins
OF_ALPHA, OF_BETA, OF_SPEED, OF_PHI, OF_THETA = range(5)
STARTERS, N_COUPLINGS = 5, 14

TEST = record(
    residual=float, rate=float, noise=float, noise_then=float,  # of the elapsed step
    air=float, bound=N_POLES,  # share of `gusts` in it; the whole bound
    filtered=N_POLES, bound_rate=N_POLES, bound_noise=N_POLES, share=float,
)  # fmt: skip

STEP = record(
    config=record(
        h=float, decay=N_POLES, gravity=float,
        # of the declared turbulence: its speed at most, m/s, and what passes each filter of a gust's changes
        # up to an airspeed m/s
        gust=float, gusts=N_POLES, swift=float,
        low=float,  # height below which a gust changes faster than those of 2000 ft, m
        rising=float,  # vertical wind at most, m/s
        # declared: the whole error of a reading, and what of it changes; drift of the attitude
        offset=N_SENSORS, slope=N_SENSORS, steady=N_SENSORS, drift=float,
    ),
    memory=record(
        error=N_SENSORS, changing=N_SENSORS,  # how far a reading can be off, and by how much that changes
        # drift so far, rad; the errors of the look before, and of the one before that
        drifted=float, error_then=N_SENSORS, error_before=N_SENSORS,
        # the look before: readings, attitude as a quaternion, velocity, acceleration there and before that
        then=N_SENSORS, turned=4, velocity=3, acceleration=3, acceleration_then=3,
        # m/s2: size of the acceleration of the elapsed step, and of those before it; of acceleration_then
        size=float, sizes_before=2, size_then=float,
        unknown=float,  # of the acceleration of the first step, for want of the instant before
        predicted=N_SENSORS, scratch=4, now=4,
        command=2,  # engine speed rpm, manifold pressure inHg
    ),
    test=(TEST, N_TESTS),
)  # fmt: skip

SINCE = record(
    # of each hypothesis: how far it can be off, at first, now, at the alarm; what it may have moved by
    first=STARTERS, off=STARTERS, held=STARTERS, changed=STARTERS,
    reach=(STARTERS, RPM), reached=(STARTERS, RPM, N_POLES),  # of a unit: in this look, through the filters
    coupling=N_COUPLINGS, coupled=(N_COUPLINGS, N_POLES),  # the same with its sign
    refuted=(int, STARTERS, N_TESTS),  # since the alarm, and by which test
)  # fmt: skip

MONITOR_CONFIG = record(
    enabled=int, instants=int, engine=int, trim=N_SENSORS,
    follows=float,  # share of its error a replaced rate makes up a look
    blurred=int,  # the attitude is noisy: a surface is named only once no gyro can be the cause
    longest_identical=(int, N_SENSORS),  # how many looks with the very same reading say that it is frozen
    damping=(3, 3),
)  # fmt: skip

MONITOR_MEMORY = record(
    begun=int, begun_at_s=float, past=int, exceeded=(int, N_TESTS),
    # what tells a gyro from the attitude, by axis
    gyro_error=3, gyro_error_then=3,  # as each frame began, rad/s
    spike=3, spike_then=3, spike_before=3, W=3, W_bound=3, W_then=3, before=3,
    # no gyro can be what the rates show: what attitude and W make of that, and how far one gyro goes
    agreed=(int, max(len(EQUAL), 1)),  # whether a sensor has equalled the reading that it should
    no_gyro=int, apart=(3, N_POLES), apart_bound=(3, N_POLES), rates_confirm=(int, 3), taken_over=(int, 3),
    # accelerometers.py: looks with the very same reading; readings of two looks ago; who is cleared
    identical=(int, N_SENSORS), earlier=N_SENSORS, cleared=(int, N_SENSORS),
    # how far accelerometers have leapt of late. Since the alarm: looks, residuals of speed, incidence and
    # sideslip, how much of them is sound, how much is of a first error; least and most of the readings; the
    # climb that such an incidence makes up; the velocity made up, body axes
    largest_jump=float, n_summed=int, residual_sum=3, sound_sum=3, first=3, least=3, most=3,
    climb_error=N_POLES, spurious_velocity=3,
)  # fmt: skip

MONITOR_OUTPUT = record(
    alarmed=int, alarmed_at_s=float,
    keeps_surface=int,  # a surface was found long before, with sound sensors: it stays found
    misnamed=int,  # a surface had been named in the moment before the alarm
    lead=int,  # the test that has raised the alarm
    largest_test=int, share=float,  # of this frame: the test nearest its bound, and how near
    suspect=(int, N_SENSORS), named=int, named_at_s=float, replaced=(int, N_SENSORS),
)  # fmt: skip

SENSOR_MONITOR = record(
    config=MONITOR_CONFIG, memory=MONITOR_MEMORY, output=MONITOR_OUTPUT, step=STEP, since=SINCE
)


def configure(monitor: np.void, scenario: Scenario, design: np.void, y: np.ndarray, enabled: bool) -> None:
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
    monitor["memory"]["past"] = scenario.substeps - 1  # the first JSBSim frame ends a frame of the loop
    if config["engine"]:
        monitor["step"]["memory"]["command"] = initial.engine_rpm, initial.manifold_pressure_inhg
    configure_step(monitor["step"]["config"], declared, scenario)
    configure_readings(monitor, declared, monitor["step"]["config"]["h"])


def configure_step(step: np.void, declared: Declared, scenario: Scenario) -> None:
    """Fill what the equations of motion and the gusts are stepped with, a JSBSim frame a step."""
    initial, h = scenario.initial, 1.0 / scenario.rate_hz / scenario.substeps
    step["h"], step["decay"] = h, [exp(-pole * h) for pole in POLES_PER_S]
    step["gravity"] = GRAVITY_MPS2 * (1.0 + initial.altitude_m / EARTH_RADIUS_M) ** -2
    step["gust"], step["gusts"] = gusts_seen(declared.air, initial.airspeed_mps, h)
    step["swift"] = FASTER * initial.airspeed_mps
    step["low"], step["rising"] = declared.air.low_m, declared.vertical_wind_mps


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
    config["blurred"] = np.any(step["offset"][attitude] > step["steady"][attitude])
    config["follows"] = min(1.0, h * ATTITUDE_TAKES_OVER_PER_S) if config["blurred"] else 1.0


def longest_identical(noise: float, quantum: float) -> int:
    """For how many samples no sound sensor, of this noise and resolution, gives the very same reading."""
    if quantum == 0.0:
        return 3
    return 50 if noise > quantum / 4.0 else NEVER_STILL


def gusts_seen(air: Dryden, airspeed_mps: float, h: float) -> tuple[float, np.ndarray]:
    """Bounds on the speed of gusts, m/s, and on what passes each filter of their changes in h s.

    The speed of a gust changes like a random walk (`Dryden.velocity_walk`); a filter with a pole of lam 1/s
    keeps 1 / 2 lam of it.
    """
    sigma_mps, intensity = air.sigma_mps, air.velocity_walk(airspeed_mps, FASTER)
    kept_s = [h / (1.0 - exp(-2.0 * pole * h)) for pole in POLES_PER_S]
    return GUST_LIMIT_SIGMA * sigma_mps, GUST_LIMIT_SIGMA * np.sqrt(intensity * np.array(kept_s))


def instrument_found(monitor: np.void, t_s: float) -> dict[str, Any] | None:
    """The verdict's parts as of t_s, where an instrument is found broken; None where none is."""
    if not monitor["output"]["alarmed"] or monitor["output"]["keeps_surface"]:
        return None
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["detection_time_s"], said["isolation_time_s"] = float(monitor["output"]["alarmed_at_s"]), None
    if monitor["output"]["named"] >= 0:
        said["isolated"] = sensor_words(SENSORS[int(monitor["output"]["named"])])
        said["isolation_time_s"] = float(monitor["output"]["named_at_s"])
    elif t_s > said["detection_time_s"] + WAIT_S:
        said["isolated"] = said["isolation_type"] = "unanticipated"
        said["isolation_time_s"] = said["detection_time_s"] + WAIT_S
    else:
        left = zip(SENSORS, monitor["output"]["suspect"], strict=True)
        said["candidates"] = tuple(sensor_words(name) for name, possible in left if possible)
    return said
