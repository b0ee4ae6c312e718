"""What goes into a row of the log, a stage at a time; frame.py has the order."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.outer.state import SPEED
from beaver_ftc.diagnosis.bank import nearest
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import effective, first_signal, position


@kernel
def put(row, column, values):
    """Write values into row from column on; returns the next column."""
    for i in range(values.size):
        row[column + i] = values[i]
    return column + values.size


@kernel
def record_truth(truth, t, row):
    """The first columns: time and the truth. Returns the next column."""
    value = truth.value
    row[0] = t
    row[1], row[2], row[3] = value[ch.AIRSPEED], value[ch.ALPHA], value[ch.BETA]
    column = put(row, 4, value[0:3])
    column = put(row, column, value[ch.PHI : ch.PHI + 3])
    row[column] = (value[ch.LATITUDE] - truth.latitude_0) * truth.radius_m
    row[column + 1] = (value[ch.LONGITUDE] - truth.longitude_0) * truth.parallel_radius_m
    row[column + 2] = value[ch.ALTITUDE]
    column = put(row, column + 3, value[ch.PDOT : ch.PDOT + 3])
    row[column] = value[ch.QDYN]
    first = first_signal(truth)
    column = put(row, column + 1, value[first : first + truth.declared])
    row[column] = value[ch.ENVELOPE]
    return column + 1


@kernel
def record_surfaces(truth, commanded, saturated, row, column):
    """Command in effect, position and effective deflection of each surface; then which are saturated."""
    for s in range(commanded.size):
        row[column] = commanded[s]
        row[column + 1] = position(truth, s)
        row[column + 2] = effective(truth, s)
        column += 3
    return put(row, column, saturated)


@kernel
def record_estimator(fie, there, detected, row, column):
    """Residuals between their limits; not a number before the estimators start, or where another diagnosis
    has taken their place. Returns the next column."""
    started = there and detected
    for i in range(3):
        row[column] = fie.residual[i] if started else np.nan
        row[column + 1] = fie.lower[i] if started else np.nan
        row[column + 2] = fie.upper[i] if started else np.nan
        column += 3
    row[column] = fie.excluded if there else np.nan
    return column + 1


@kernel
def record_alarm(bank, row, column):
    """Residual and threshold of what raises the alarm: on each axis the filter nearest to its bound."""
    for i in range(3):
        m = nearest(bank, i)
        row[column + i], row[column + 3 + i] = bank.residual[m, i], bank.threshold[m, i]
    return column + 6


@kernel
def record_watch(watch, row, column):
    """How near a test between the instruments came to its bound in this frame, and which; not a number where
    they are not watched."""
    watched = watch.enabled and watch.begun
    row[column] = watch.share if watched else np.nan
    row[column + 1] = watch.furthest if watched else np.nan


@kernel
def record_profile(autopilot, row, column):
    """The commanded profile, and the airspeed of it that can be held; not a number where a channel is not
    flown."""
    for c in range(autopilot.command.size):
        row[column + c] = autopilot.command[c] if autopilot.commanded[c] else np.nan
    row[column + autopilot.command.size] = autopilot.held if autopilot.commanded[SPEED] else np.nan
