"""What the watch over the instruments keeps (redundancy.py, instruments.py), and its verdict in words."""

from typing import Any

import numpy as np

from beaver_ftc.plant.instruments import N_SENSORS, PHI, SENSORS, SIGNALS
from beaver_ftc.scenario.sensors import sensor_words

TURN, ANGLE, SPEED, ALPHA_FLOW, BETA_FLOW, DENSITY, CLIMB, RPM, PRESSURE = 0, 3, 6, 7, 8, 9, 10, 11, 12
N_TESTS = 13
POLES_PER_S = (1e6, 10.0, 1.0)
NOBODY = -1
LEAP_M_S2 = 8.0  # by which no specific force changes from one look to the next
UNKNOWN, YES, NO = 0, 1, 2
WAIT_S = 1.0  # for the instrument to be found; then the fault is outside what can be named
P, Q, R, ALPHA, BETA, AIRSPEED, QDYN = range(len(SIGNALS))
THETA, PSI = PHI + 1, PHI + 2

TEST = np.dtype(
    [
        ("residual", "f8"), ("rate", "f8"), ("noise", "f8"), ("noise_then", "f8"),  # of the elapsed step
        ("air", "f8"), ("bound", "f8", (len(POLES_PER_S),)),  # share of `gusts` in it; the whole bound
        ("filtered", "f8", (len(POLES_PER_S),)), ("bound_rate", "f8", (len(POLES_PER_S),)),
        ("bound_noise", "f8", (len(POLES_PER_S),)), ("share", "f8"),
    ],
    align=True,
)  # fmt: skip

STEP = np.dtype(
    [
        ("h", "f8"), ("decay", "f8", (len(POLES_PER_S),)), ("gravity", "f8"),
        # of the declared turbulence: its speed at most, m/s, and what passes each filter of a gust's changes
        # up to an airspeed m/s
        ("gust", "f8"), ("gusts", "f8", (len(POLES_PER_S),)), ("swift", "f8"),
        # declared: the whole error of a reading, and what of it changes; drift of the attitude
        ("offset", "f8", (N_SENSORS,)), ("slope", "f8", (N_SENSORS,)), ("steady", "f8", (N_SENSORS,)),
        ("drift", "f8"), ("error", "f8", (N_SENSORS,)), ("changing", "f8", (N_SENSORS,)),
        # drift so far, rad; the errors of the look before, and of the one before that
        ("drifted", "f8"), ("error_then", "f8", (N_SENSORS,)), ("error_before", "f8", (N_SENSORS,)),
        # the look before: readings, attitude as a quaternion, velocity, acceleration there and before that
        ("then", "f8", (N_SENSORS,)), ("turned", "f8", (4,)), ("velocity", "f8", (3,)),
        ("acceleration", "f8", (3,)), ("acceleration_then", "f8", (3,)),
        # m/s2: size of the acceleration of the elapsed step, and of those before it; of acceleration_then
        ("pull", "f8"), ("pulled", "f8", (2,)), ("felt_then", "f8"),
        ("unknown", "f8"),  # of the acceleration of the first step, for want of the instant before
        ("predicted", "f8", (N_SENSORS,)), ("scratch", "f8", (4,)), ("now", "f8", (4,)),
        ("command", "f8", (2,)),  # engine speed rpm, manifold pressure inHg
        ("test", TEST, (N_TESTS,)),
    ],
    align=True,
)  # fmt: skip

WATCH = np.dtype(
    [
        ("enabled", "i8"), ("begun", "i8"), ("instants", "i8"), ("past", "i8"), ("engine", "i8"),
        ("alarmed", "i8"), ("alarmed_at_s", "f8"), ("beside", "i8"), ("lead", "i8"),
        ("misnamed", "i8"),  # a surface had been named in the moment before the alarm
        ("furthest", "i8"), ("share", "f8"),  # of this frame: the test nearest its bound, and how near
        ("fired", "i8", (N_TESTS,)), ("suspect", "i8", (N_SENSORS,)),
        ("named", "i8"), ("named_at_s", "f8"), ("replaced", "i8", (N_SENSORS,)),
        ("trim", "f8", (N_SENSORS,)), ("follows", "f8"),  # share of its error a replaced rate makes up a look
        # what tells a gyro from the attitude, by axis
        ("error", "f8", (3,)), ("error_then", "f8", (3,)),  # of the gyro, as each frame began, rad/s
        ("spike", "f8", (3,)), ("spike_then", "f8", (3,)),
        ("damping", "f8", (3, 3)), ("W", "f8", (3,)), ("W_bound", "f8", (3,)),
        ("W_then", "f8", (3,)), ("before", "f8", (3,)),
        # no gyro can be what the rates show: what attitude and W make of that, and how far one gyro goes
        ("blurred", "i8"), ("no_gyro", "i8"),
        ("apart", "f8", (3, len(POLES_PER_S))), ("apart_bound", "f8", (3, len(POLES_PER_S))),
        ("rates_say", "i8", (3,)), ("taken_over", "i8", (3,)),
        # accelerometers.py: looks with the very same reading, and how many say that it is frozen; readings of
        # two looks ago; who is cleared
        ("still", "i8", (N_SENSORS,)), ("longest_still", "i8", (N_SENSORS,)),
        ("earlier", "f8", (N_SENSORS,)), ("cleared", "i8", (N_SENSORS,)),
        # how far accelerometers have leapt of late. Since the alarm: looks, residuals of speed, incidence and
        # sideslip, how much of them is sound, least and most of the readings; the climb that such an
        # incidence makes up; the velocity made up, body axes
        ("restless", "f8"), ("gathering", "i8"), ("gathered", "f8", (3,)), ("sound", "f8", (3,)),
        ("least", "f8", (3,)), ("most", "f8", (3,)), ("fallen", "f8", (len(POLES_PER_S),)),
        ("made_up", "f8", (3,)),
        ("step", STEP),
    ],
    align=True,
)  # fmt: skip


def instrument_found(watch: np.void, t_s: float) -> dict[str, Any] | None:
    """The verdict's parts as of t_s, where an instrument is found broken; None where none is."""
    if not watch["alarmed"] or watch["beside"]:
        return None
    said: dict[str, Any] = {"isolated": None, "isolation_type": None, "estimate": None, "candidates": ()}
    said["detection_time_s"], said["isolation_time_s"] = float(watch["alarmed_at_s"]), None
    if watch["named"] >= 0:
        said["isolated"] = sensor_words(SENSORS[int(watch["named"])])
        said["isolation_time_s"] = float(watch["named_at_s"])
    elif t_s > said["detection_time_s"] + WAIT_S:
        said["isolated"] = said["isolation_type"] = "unanticipated"
        said["isolation_time_s"] = said["detection_time_s"] + WAIT_S
    else:
        left = zip(SENSORS, watch["suspect"], strict=True)
        said["candidates"] = tuple(sensor_words(name) for name, possible in left if possible)
    return said
