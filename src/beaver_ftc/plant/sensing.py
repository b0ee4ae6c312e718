"""Sensing: the record of the truth, and the readings that the instruments give of it.

The truth and what is measured are records of different types, so that compiled code of the diagnosis or of a
law cannot be handed the truth by mistake.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_LEVERS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.table import AIRSPEED, DPT
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.channels import read_nodes, write_nodes
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SAMPLED,
    PHI,
    break_all,
    read_all,
    read_forces,
    read_sampled,
    set_inertial,
    share_out,
    slipstream_read,
)

FLYING, DEPARTED, NOT_FINITE = 0, 1, 2
MIN_AIRSPEED_ON_WHEELS_MPS = 1.0  # a lower measured one counts as this, as in the truth's own equations
# Beyond these the flight has departed: body rates, incidence and sideslip; or below the ground.
DEPARTURE_RATE_RAD_S, DEPARTURE_ANGLE_RAD = 6.0, 0.6
DEPARTURE_SIGNALS = ("p", "q", "r", "alpha", "beta", "altitude")
DEPARTURE_LIMITS = {  # by the column of the log
    **dict.fromkeys(("p_rad_s", "q_rad_s", "r_rad_s"), DEPARTURE_RATE_RAD_S),
    **dict.fromkeys(("alpha_rad", "beta_rad"), DEPARTURE_ANGLE_RAD),
}


@sized
def truth_dtype(n: int) -> np.dtype:
    """The truth of an aircraft with n surfaces: its nodes, what they hold, and its faults."""
    room = ch.most_channels(n)
    return record(
        native=int, getter=int, setter=int, n=int, declared=int, read_pointers=(int, room),
        write_pointers=(int, n), levers=int, lever_pointers=(int, MAX_LEVERS),
        factor=room, value=room,  # the first n, in SI: see channels.py
        latitude_0=float, longitude_0=float, radius_m=float, parallel_radius_m=float, ground_m=float,
        slow_mps=float,  # airspeed at which angles of the flow mean nothing: of an aircraft on wheels, else 0
        # its faults, for the oracle and for the accounts
        faulted=int, fault_at_s=float, immovable=(int, n), Cm_alpha3=float,
    )  # fmt: skip


@kernel
def position(truth, s):
    """Position of the actuator of surface s, rad."""
    return truth.value[ch.POS + s]


@kernel
def effective(truth, s):
    """The deflection of surface s that acts, rad."""
    return truth.value[ch.POS + truth.immovable.size + s]


@kernel
def effectiveness(truth, s):
    """Remaining effectiveness of surface s: 1 if healthy, 0 if lost."""
    return truth.value[ch.POS + 2 * truth.immovable.size + s]


@kernel
def first_signal(truth):
    """Index of the first declared signal in `value`."""
    return ch.POS + 3 * truth.immovable.size


@kernel
def measure(truth, instruments, measured):
    """Read the truth's nodes into `value`, SI, and fill `measured` with the readings of the instruments."""
    value, signal = truth.value, measured.signal
    if truth.native:
        read_nodes(truth.getter, truth.read_pointers[: truth.n], value)
    for i in range(truth.n):
        value[i] *= truth.factor[i]
    for i in range(PHI):
        signal[i] = value[i]
    for i in range(3):
        signal[PHI + i] = value[ch.PHI + i]
    signal[ALTITUDE] = value[ch.ALTITUDE]
    read_further(value, first_signal(truth) + truth.declared, truth.n, measured)
    if instruments.real:
        read_all(instruments, signal)
        read_forces(instruments, signal)
    read_sampled(instruments, signal, measured.fresh)
    dpt_error = 0.0
    if instruments.broken:
        if measured.engine:
            dpt_error = -slipstream_read(measured)
        break_all(instruments, signal, measured.missing)
        if measured.engine:
            dpt_error += slipstream_read(measured)
    distribute_readings(truth, instruments, dpt_error, measured)


@kernel
def read_further(value, first, n, measured):
    """Take the readings of accelerometers, of sensors that the monitor alone uses, and of the engine's."""
    set_inertial(measured, 1)
    engine = first + 4 + N_SAMPLED
    for i in range(3):
        measured.signal[AX + i] = value[first + i] / value[first + 3]
    for i in range(N_SAMPLED):
        measured.signal[AX + 3 + i] = value[first + 4 + i]
    if n > engine:
        measured.engine = 1
        measured.signal[ENGINE_SPEED], measured.signal[MANIFOLD] = value[engine], value[engine + 1]


@kernel
def distribute_readings(truth, instruments, dpt_error, measured):
    """Copy the readings in `signal` to the records of their users. Declared signals have no instrument: their
    readings are exact, but for what broken instruments change in dpt, `dpt_error`. With errors of the
    instruments it is worked out from the readings."""
    share_out(measured)
    y, first = measured.y, first_signal(truth)
    if y[AIRSPEED] < MIN_AIRSPEED_ON_WHEELS_MPS and truth.slow_mps > 0.0:
        y[AIRSPEED] = MIN_AIRSPEED_ON_WHEELS_MPS  # rates over an airspeed stay finite
    for j in range(truth.declared):
        y[DPT + j] = truth.value[first + j]
    if instruments.engine:
        y[DPT] = slipstream_read(measured)
    elif dpt_error != 0.0:
        y[DPT] += dpt_error


@kernel
def flight_status(value, ground_m, slow_mps):
    """FLYING; NOT_FINITE; or DEPARTED + 10 i, where signal i of DEPARTURE_SIGNALS has left its limits."""
    for i in range(value.size):
        if not np.isfinite(value[i]):
            return NOT_FINITE
    for i in range(3):
        if abs(value[i]) > DEPARTURE_RATE_RAD_S:
            return DEPARTED + 10 * i
    if value[ch.AIRSPEED] >= slow_mps:
        if abs(value[ch.ALPHA]) > DEPARTURE_ANGLE_RAD:
            return DEPARTED + 30
        if abs(value[ch.BETA]) > DEPARTURE_ANGLE_RAD:
            return DEPARTED + 40
    if value[ch.ALTITUDE] < ground_m:
        return DEPARTED + 50
    return FLYING


@kernel
def hand_over(truth, commanded, levers):
    """Write the command (n,) rad, and the levers' commands if they are used, where nodes are native."""
    if truth.native:
        write_nodes(truth.setter, truth.write_pointers, commanded)
        if levers.in_use:
            write_nodes(truth.setter, truth.lever_pointers[: truth.levers], levers.command[: truth.levers])
