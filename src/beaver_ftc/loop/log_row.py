"""A row of the log, in the order of plant/channels.log_columns. What is not there, or has not begun, is not a
number."""

import numpy as np

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.control.profile import SPEED
from beaver_ftc.diagnosis.detection.filters import nearest_filter
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import effective, first_signal, position

PER_ESTIMATOR = 10  # columns


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
def record_estimator(fie, started, row, column):
    """Residuals between their limits, once the estimators have started; and whether the fault is excluded."""
    if started:
        for i in range(3):
            row[column + 3 * i], row[column + 3 * i + 1] = fie.residual[i], fie.mu_lo[i]
            row[column + 3 * i + 2] = fie.mu_hi[i]
    row[column + PER_ESTIMATOR - 1] = fie.excluded


@kernel
def record_alarm(bank, row, column):
    """Residual and threshold of what raises the alarm: on each axis the filter nearest to its bound."""
    for i in range(3):
        m = nearest_filter(bank, i)
        row[column + i], row[column + 3 + i] = bank.output.residual[m, i], bank.output.threshold[m, i]
    return column + 6


@kernel
def record_sensor_monitor(monitor, missing, row, column, columns):
    """How near a test between the instruments came to its bound in this frame, and which; and the first
    instrument that gives no reading, missing (N_SENSORS,). Returns the next column."""
    if monitor.config.enabled and monitor.dynamics.stage:
        row[column], row[column + 1] = (
            monitor.output.top_ratio,
            monitor.output.worst_test_index,
        )
    for i in range(missing.size - 1, -1, -1):
        if missing[i]:
            row[column + 2] = i
    return column + columns


@kernel
def record_sampled(signal, row, column, columns):
    """The readings of the last `columns` sensors, those with rates of their own. Returns the next column."""
    first = signal.size - columns
    for i in range(columns):
        row[column + i] = signal[first + i]
    return column + columns


@kernel
def record_profile(autopilot, row, column):
    """The commanded profile, of the channels that are flown, and the airspeed of it that can be held."""
    for c in range(autopilot.command.size):
        if autopilot.is_commanded[c]:
            row[column + c] = autopilot.command[c]
    if autopilot.is_commanded[SPEED]:
        row[column + autopilot.command.size] = autopilot.airspeed_to_fly


@kernel
def record_row(frame, commanded, row):
    """Write the row of a frame in the order of channels.log_columns; commanded (3,) rad/s."""
    control, fdi, prediction, logged = frame.control, frame.fdi, frame.prediction, frame.logged
    saturated, effectiveness = control.allocation.output.saturated, control.surfaces.output.effectiveness
    row[:] = np.nan
    column = record_truth(frame.truth, frame.t, row)
    column = put(row, column, frame.measured.x)
    column = put(row, column, commanded)
    column = put(row, column, control.reference.output.model_rate)
    column = record_surfaces(frame.truth, prediction.commanded, saturated, row, column)
    column = record_alarm(fdi.bank, row, column)
    column = put(row, column, fdi.fdae.output.residual)
    column = put(row, column, fdi.fdae.output.threshold)
    column = put(row, column, fdi.bound.eta_bar)
    column = put(row, column, fdi.fdae.network.output)
    column = put(row, column, prediction.means.F)
    for e in range(logged.estimators):
        if e < fdi.isolation.config.n_estimators:  # else another diagnosis has taken their place
            record_estimator(fdi.isolation.estimator[e], fdi.verdict.detected, row, column)
        column += PER_ESTIMATOR
    column = put(row, column, frame.assessment.effectiveness)
    column = put(row, column, effectiveness)
    if not control.config.uses_verdict:  # the law takes each surface for a healthy one
        row[column - effectiveness.size : column] = 1.0
    monitor, missing = fdi.sensor_monitor, frame.measured.missing
    row[column], row[column + 1] = frame.supervisor.mode, fdi.verdict.detected or monitor.output.alarmed
    column += 2
    if logged.sensor_monitor:
        column = record_sensor_monitor(monitor, missing, row, column, logged.sensor_monitor)
    column = record_sampled(frame.measured.signal, row, column, logged.sampled)
    column = put(row, column, control.power.output.command[: logged.power])
    if frame.autopilot.enabled:
        record_profile(frame.autopilot, row, column)
    detector = fdi.statistical
    if logged.tests and detector.test.enabled:
        n = detector.test.n_scores
        copy(detector.alarm.share[:n], row[row.size - n :])
