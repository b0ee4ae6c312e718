"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/                what is believed of the aircraft, and whether it still holds
    decide      control/accommodation.py  the mode
    command     control/                  the surfaces, and the engine
    outer loops control/autopilot.py      the reference of the next frame, if a profile is to be flown
    record      accounts.py, frame.py     the metrics' sums, a row of the log

Each stage has records of its own; what a flight remembers is all of them in one (assembly.py), which only
the kernels of this file see whole. Python calls them through stepping.py. The command computed in a frame
is in effect from the next on. In a row of the log, what is not there, or has not begun, is left as the row is
given: not a number.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.control import accommodation, allocation, engines, laws, state
from beaver_ftc.control.autopilot import SPEED, judge, steer
from beaver_ftc.diagnosis import conclusion, schemes
from beaver_ftc.diagnosis import conclusion as assessed
from beaver_ftc.diagnosis.conclusion import assess_surfaces, assess_unknown_acceleration
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.detection.filters import nearest_filter
from beaver_ftc.diagnosis.expectation import (
    accumulate_substep,
    begin_sums,
    evaluate_design,
    evaluate_frame,
    move_healthy_surfaces,
    predict_acceleration,
)
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.schemes import record_named_surfaces
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.diagnosis.types import verdict
from beaver_ftc.loop import accounts
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import (
    NOT_FINITE,
    effective,
    first_signal,
    flight_status,
    hand_over,
    measure,
    position,
)

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
            row[column + 3 * i], row[column + 3 * i + 1] = fie.residual[i], fie.lower[i]
            row[column + 3 * i + 2] = fie.upper[i]
    row[column + PER_ESTIMATOR - 1] = fie.excluded


@kernel
def record_alarm(bank, row, column):
    """Residual and threshold of what raises the alarm: on each axis the filter nearest to its bound."""
    for i in range(3):
        m = nearest_filter(bank, i)
        row[column + i], row[column + 3 + i] = bank.output.residual[m, i], bank.output.threshold[m, i]
    return column + 6


@kernel
def record_used(effectiveness, used, row, column):
    """What the law takes the effectiveness of each surface for: 1 if it makes no use of it. Returns the next
    column."""
    for s in range(effectiveness.size):
        row[column + s] = effectiveness[s] if used else 1.0
    return column + effectiveness.size


@kernel
def record_sensor_monitor(monitor, missing, row, column, columns):
    """How near a test between the instruments came to its bound in this frame, and which; of three `columns`
    the first instrument that gives no reading, missing (N_SENSORS,). Returns the next column."""
    if monitor.config.enabled and monitor.memory.begun:
        row[column], row[column + 1] = monitor.output.share, monitor.output.largest_test
    if columns > 2:
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
        if autopilot.commanded[c]:
            row[column + c] = autopilot.command[c]
    if autopilot.commanded[SPEED]:
        row[column + autopilot.command.size] = autopilot.held


@apart
def monitor_sensors(frame):
    """Compare the sensors with one another, and replace the broken one. Time inside a frame counts as that of
    its end."""
    fdi, monitor, engine = frame.fdi, frame.fdi.sensor_monitor, frame.control.power.output
    before, t = monitor.output.alarmed, frame.k * frame.dt
    if engine.in_use:
        sensor_monitor.set_expected_manifold_pressure(monitor, engine.command[0])
    sensor_monitor.monitor_sensors(
        monitor, frame.belief, frame.measured, fdi.verdict, fdi.bank, fdi.bound, frame.dt, t
    )
    if monitor.output.alarmed and not (before or monitor.output.keeps_surface):
        reset_surface_diagnosis(fdi)


@kernel
def reset_surface_diagnosis(fdi):
    """Discard what the diagnosis of the surfaces made of a broken sensor."""
    conclusion.discard_conclusion(fdi.verdict)
    verdict.clear_modes(fdi.types.surface)
    filters.reset_network(fdi.fdae.network)


@kernel
def sense(frame):
    """Measure, and see what the design model makes of this instant. Returns the flight's status."""
    truth, belief, measured = frame.truth, frame.belief, frame.measured
    measure(truth, frame.instruments, measured)
    if frame.fdi.sensor_monitor.config.enabled:
        monitor_sensors(frame)
    status = flight_status(truth.value, truth.ground_m, truth.slow_mps)
    if status != NOT_FINITE:
        evaluate_design(belief, measured)
        accounts.effect_of_faults(frame.accounts.guarantee, truth, belief, measured.y)
    return status


@kernel
def start_clock(frame):
    """Set the time of the frame, s since the start."""
    frame.t = frame.k * frame.dt


@kernel
def advance_clock(frame):
    """Count the frame: it is over."""
    frame.k += 1


@kernel
def begin(frame):
    """Measure, and see what the design model makes of the elapsed frame. Returns the flight's status."""
    start_clock(frame)
    status = sense(frame)
    if status != NOT_FINITE:
        evaluate_frame(frame.belief, frame.fdi.bound, frame.measured, frame.k, frame.dt)
    return status


@kernel
def diagnose(frame):
    """The diagnosis, from prediction to verdict, by the kernels of the scheme in charge.

    The faults that the law already takes into account are expected: they are no innovation.
    """
    fdi, belief, measured, k = frame.fdi, frame.belief, frame.measured, frame.k - frame.since
    scheme, every_type, applied = fdi.config.scheme, fdi.config.every_type, frame.control.surfaces.output
    engine_symmetry.disable_if_differential_thrust(fdi.engines, frame.control.power.output.command[1:])
    if k == 0:
        schemes.begin(scheme, fdi, belief, measured)
    else:
        predict_acceleration(belief, fdi.verdict.detected, applied.effectiveness, applied.offset, every_type)
        schemes.predict(scheme, fdi, belief, measured, k, frame.t)
    schemes.conclude(scheme, fdi, belief, measured, frame.t)
    record_named_surfaces(fdi, frame.t)
    schemes.prepare(scheme, fdi, belief, measured, k)
    begin_sums(belief, fdi.bound, fdi.layout, every_type, measured)
    accounts.follow_guarantee(frame.accounts.guarantee, fdi.bank, fdi.config.dt, belief.share, k, frame.t)
    assess_faults(frame)


@kernel
def assess_faults(frame):
    """Put what the diagnosis says of each surface, and of what is unknown, where the law reads it."""
    fdi, assessment = frame.fdi, frame.assessment
    config, found, types, layout, detector = fdi.config, fdi.verdict, fdi.types, fdi.layout, fdi.statistical
    assess_surfaces(assessment, config, found, types, layout, fdi.isolation.estimator, detector)
    assess_unknown_acceleration(assessment, config, found, types, layout, detector, fdi.fdae, fdi.bound)


@kernel
def accumulate_instant(frame):
    """Take in an instant inside a frame: what is believed of it, and the gust that the vanes see by then."""
    fdi = frame.fdi
    schemes.accumulate(fdi.config.scheme, fdi, frame.belief, frame.measured)
    accumulate_substep(frame.belief, fdi.bound, fdi.layout, fdi.config.every_type, frame.measured)


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: see conclusion.py."""
    return assessed.isolated_theta(
        fdi.config, fdi.verdict, fdi.layout, fdi.isolation.estimator, fdi.statistical, s
    )


@kernel
def decide(frame):
    """The mode for this frame."""
    control, layout, informed = frame.control, frame.control.layout, frame.control.config.informed
    accounts.share_faults(frame.truth, frame.faults, informed)
    if informed:
        wanted = accommodation.true_mode(layout.main[PITCH], frame.faults)
    else:
        wanted = accommodation.mode_from(control.config, layout, frame.fdi.verdict, frame.assessment)
    accommodation.supervise(frame.supervisor, wanted, frame.t)


@kernel
def accommodate(frame):
    """How effective the law takes each surface to be."""
    law, belief = frame.control.config.law, frame.belief
    state.accommodate(law, frame.control, frame.assessment, frame.faults, belief, frame.measured)


@kernel
def take_command(frame, deflections):
    """A command (n,) rad from outside, within the travel of each surface."""
    accommodate(frame)
    allocation.take_command(frame.control.allocation.output, frame.control.layout, deflections)


@kernel
def command(frame):
    """The command of the law, or of what commands in its place."""
    control, mode = frame.control, frame.supervisor.mode
    if frame.held:
        take_command(frame, frame.held_rad)
        return
    accommodate(frame)
    state.command(
        control.config.law, control, frame.assessment, frame.faults, frame.belief, frame.measured, mode,
        frame.t,
    )  # fmt: skip


@apart
def fly_profile(frame, commanded):
    """Add the outer loops' body rates to what is commanded (3,) rad/s, and set the engine."""
    autopilot, control, belief, value = frame.autopilot, frame.control, frame.belief, frame.truth.value
    unexplained, elevator = control.axes.disturbance[PITCH], control.layout.main[PITCH]
    if unexplained != 0.0:
        unexplained /= belief.G[PITCH, elevator]  # rad of the elevator
    steer(autopilot, control, belief.u, frame.measured, unexplained, frame.t)
    if autopilot.sets_power:
        engines.follow_autopilot(control.power, autopilot.setting, autopilot.power_airspeed)
    judge(autopilot, value[ch.ALTITUDE], value[ch.AIRSPEED], value[ch.PHI + 2], value[ch.PHI], frame.t)
    for i in range(3):
        commanded[i] += autopilot.rates[i]


@kernel
def account(frame):
    """Advance the metrics' sums by this frame; before a fault, the closest approach to an alarm."""
    control, truth, sums = frame.control, frame.truth, frame.accounts
    accounts.track(sums.tracking, truth, control.reference.output.model_rate)
    if truth.faulted:
        accounts.account_authority(sums.authority, control.axes)
    else:
        filters.note_closest_approach(frame.fdi.bank)
        statistical.note_closest_approach(frame.fdi.statistical.alarm)
    saturated, dt = control.allocation.output.saturated, control.reference.config.dt
    accounts.account_surfaces(sums, truth, saturated, frame.k, dt)
    accounts.note_envelope(sums.envelope, truth.value[ch.ENVELOPE] < 0.5, frame.t)
    accounts.note_inconclusive(sums.inconclusive, frame.fdi, frame.t)


@kernel
def record(frame, commanded, row):
    """Write the row of a frame in the order of channels.log_columns; commanded (3,) rad/s."""
    control, fdi, belief, logged = frame.control, frame.fdi, frame.belief, frame.logged
    saturated, effectiveness = control.allocation.output.saturated, control.surfaces.output.effectiveness
    row[:] = np.nan
    column = record_truth(frame.truth, frame.t, row)
    column = put(row, column, frame.measured.x)
    column = put(row, column, commanded)
    column = put(row, column, control.reference.output.model_rate)
    column = record_surfaces(frame.truth, belief.commanded, saturated, row, column)
    column = record_alarm(fdi.bank, row, column)
    column = put(row, column, fdi.fdae.output.residual)
    column = put(row, column, fdi.fdae.output.threshold)
    column = put(row, column, fdi.bound.eta_bar)
    column = put(row, column, fdi.fdae.network.output)
    column = put(row, column, belief.means.acceleration)
    for e in range(logged.estimators):
        if e < fdi.isolation.config.n:  # else another diagnosis has taken their place
            record_estimator(fdi.isolation.estimator[e], fdi.verdict.detected, row, column)
        column += PER_ESTIMATOR
    column = put(row, column, frame.assessment.effectiveness)
    column = record_used(effectiveness, control.config.uses_verdict, row, column)
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
    if logged.tests and detector.tests.enabled:
        views = detector.views[: detector.n_views]
        statistical.log_scores(detector.tests, detector.block, views, detector.forces, detector.air, row)


@kernel
def finish(frame, commanded, row):
    """Account, record and hand the command over; the reference model moves on. commanded (3,) rad/s."""
    control, belief = frame.control, frame.belief
    if frame.autopilot.enabled:
        fly_profile(frame, commanded)
    account(frame)
    record(frame, commanded, row)
    laws.follow(control.reference.config, control.reference.output, commanded)
    authority_lost = control.surfaces.output.authority_lost
    laws.govern(control.reference, commanded, control.axes.shortfall, authority_lost)
    move_healthy_surfaces(belief, control.allocation.output.command)
    hand_over(frame.truth, belief.commanded, control.power.output)
    advance_clock(frame)
    frame.row += 1
