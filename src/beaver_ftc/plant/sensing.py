"""Sensing: the truth's record, and what the instruments make of it.

The truth and what is measured are records of different types, so that compiled code of the diagnosis or of a
law cannot be handed the truth by mistake.
"""

from functools import lru_cache

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, N_Y, QDYN
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import N_SIGNALS, read_all
from beaver_ftc.plant.native import read_nodes, write_nodes

FLYING, DEPARTED, NOT_FINITE = 0, 1, 2
DEPARTURE_ANGLE_RAD = 0.6
DEPARTURE_RATE_RAD_S = 6.0
DEPARTURE_SIGNALS = ("p", "q", "r", "alpha", "beta", "altitude")

# What is known of an instant. No instrument model stands before attitude (phi, theta, psi, rad), altitude (m)
# and before the declared signals in y, from dpt on: they are the truth's.
MEASURED = np.dtype(
    [
        ("signal", "f8", (N_SIGNALS,)), ("x", "f8", (3,)), ("y", "f8", (N_Y,)),
        ("attitude", "f8", (3,)), ("altitude", "f8"),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def truth_dtype(n: int) -> np.dtype:
    """The truth of an aircraft with n surfaces: its nodes, what they hold, and its faults."""
    room = ch.most_channels(n)
    fields = [
        ("native", "i8"), ("getter", "i8"), ("setter", "i8"),
        ("n", "i8"), ("read_pointers", "i8", (room,)), ("write_pointers", "i8", (n,)),
        ("engine_pointer", "i8", (1,)),
        ("factor", "f8", (room,)), ("value", "f8", (room,)),  # the first n, in SI: see channels.py
        ("latitude_0", "f8"), ("longitude_0", "f8"), ("radius_m", "f8"), ("parallel_radius_m", "f8"),
        ("ground_m", "f8"),
        # its faults, for the oracle and for the accounts
        ("faulted", "i8"), ("fault_at_s", "f8"), ("immovable", "i8", (n,)), ("Cm_alpha3", "f8"),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@kernel
def position(truth, s):
    """Where the actuator of surface s is, rad."""
    return truth.value[ch.POS + s]


@kernel
def effective(truth, s):
    """The deflection of surface s that acts, rad."""
    return truth.value[ch.POS + truth.immovable.size + s]


@kernel
def effectiveness(truth, s):
    """What surface s has left of its effectiveness, 1 healthy."""
    return truth.value[ch.POS + 2 * truth.immovable.size + s]


@kernel
def first_signal(truth):
    """Where the declared signals begin among the values."""
    return ch.POS + 3 * truth.immovable.size


@kernel
def measure(truth, instruments, measured):
    """Read the truth's nodes, in SI, and fill `measured` with what the instruments give."""
    value = truth.value
    if truth.native:
        read_nodes(truth.getter, truth.read_pointers[: truth.n], value)
    for i in range(truth.n):
        value[i] *= truth.factor[i]
    signal, y = measured.signal, measured.y
    for i in range(N_SIGNALS):
        signal[i] = value[i]
    if instruments.real:
        read_all(instruments, signal)
    for i in range(3):
        measured.x[i] = signal[i]
        measured.attitude[i] = value[ch.PHI + i]
    y[ALPHA], y[BETA], y[AIRSPEED] = signal[ch.ALPHA], signal[ch.BETA], signal[ch.AIRSPEED]
    y[QDYN] = signal[ch.QDYN]
    measured.altitude = value[ch.ALTITUDE]
    first = first_signal(truth)
    for j in range(truth.n - first):
        y[DPT + j] = value[first + j]


@kernel
def flight_status(value, ground_m):
    """FLYING, NOT_FINITE, or DEPARTED + the index in DEPARTURE_SIGNALS of what left its limits, times ten."""
    for i in range(value.size):
        if not np.isfinite(value[i]):
            return NOT_FINITE
    for i in range(3):
        if abs(value[i]) > DEPARTURE_RATE_RAD_S:
            return DEPARTED + 10 * i
    if abs(value[ch.ALPHA]) > DEPARTURE_ANGLE_RAD:
        return DEPARTED + 30
    if abs(value[ch.BETA]) > DEPARTURE_ANGLE_RAD:
        return DEPARTED + 40
    if value[ch.ALTITUDE] < ground_m:
        return DEPARTED + 50
    return FLYING


@kernel
def hand_over(truth, commanded, power):
    """Write the command (n,) rad, and the manifold pressure where the law uses it, where nodes are native."""
    if truth.native:
        write_nodes(truth.setter, truth.write_pointers, commanded)
        if power.in_use:
            write_nodes(truth.setter, truth.engine_pointer, power.command)
