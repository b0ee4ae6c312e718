"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/                what is believed of the aircraft, and whether it still holds
    decide      control/accommodation.py  the mode
    command     control/                  the surfaces, and the engine
    outer loops control/autopilot.py      the reference of the next frame, if a profile is to be flown
    record      here                      the accounts of the flight, a row of the log

Each stage has records of its own; what a flight remembers is all of them in one (assembly.py), which only the
kernels of this file see whole. Python calls them through stepping.py. The command computed in a frame is in
effect from the next on. In a row of the log, what is not there, or has not begun, is left as the row is
given: not a number.

The accounts are what the metrics are made of. They alone, and the oracle, see the truth. One of them is the
instant from which detection is certain, whatever the uncertainty does: if
|int e^{-lam (t - tau)} phi_i dtau| > 2 ebar_i for some i, the fault has been detected by t [Zhang2002]: at
worst an admissible eta hides ebar_i of the fault's effect. With a bank of poles, the first of theirs. The
effect phi is the truth's, so this is an analyst's figure: the diagnosis never sees it.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.control import accommodation, allocation, power, state
from beaver_ftc.control.accommodation import MAX_EVENTS
from beaver_ftc.control.autopilot import steer
from beaver_ftc.control.laws import reference
from beaver_ftc.control.profile import SPEED, record_deviations
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis import conclusion, monitors, schemes
from beaver_ftc.diagnosis import conclusion as assessed
from beaver_ftc.diagnosis.conclusion import (
    assess_surfaces,
    assess_unknown,
    hold_assessment,
    weighs_statistics,
)
from beaver_ftc.diagnosis.detection import fdae, filters
from beaver_ftc.diagnosis.detection.filters import nearest_filter
from beaver_ftc.diagnosis.error_map import N_MAP_COORDINATES, map_row, outside_span
from beaver_ftc.diagnosis.model_prediction import (
    add_instant,
    begin_sums,
    evaluate_design,
    evaluate_frame,
    move_surfaces,
    predict_known,
)
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import detection_share, record_isolated_surfaces
from beaver_ftc.diagnosis.state import PITCH, PLUGIN_SCHEME
from beaver_ftc.diagnosis.types import verdict
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import (
    FLYING,
    NOT_FINITE,
    effective,
    effectiveness,
    first_signal,
    flight_status,
    hand_over,
    measure,
    position,
)
from beaver_ftc.scenario.diagnosis import MAX_POLES

GUARANTEE = record(
    phi=3, phi_sum=3,  # effect of the faults, rad/s2: now, and over the frame
    effect=(MAX_POLES, 3),  # filtered as the bank filters the innovation, rad/s
    certain_after_s=float,
)  # fmt: skip
TRACKING = record(
    before=3, frames_before=int,  # squared error before a fault, rad2/s2, and since
    since=3, frames_since=int,
)  # fmt: skip
AUTHORITY = record(demanded=3, lacking=3, beyond_frames=(int, 3))
ENVELOPE = record(
    outside=int, n_exits=int, outside_frames=int, exit_at_s=MAX_EVENTS, return_at_s=MAX_EVENTS,
)  # fmt: skip
# Frames in which the diagnosis concludes nothing, of so many watched. undiagnosed: there is none. late: the
# flight is older than any that was measured. beyond: outside the map of the model's error in this quantity,
# which was then between least and greatest. between: inside the range of each quantity, but in no box.
INCONCLUSIVE = record(
    watched=int, frames=int, from_s=float, undiagnosed=int, late=int, between=int,
    beyond=(int, N_MAP_COORDINATES), least=N_MAP_COORDINATES, greatest=N_MAP_COORDINATES,
)  # fmt: skip


@sized
def accounts_dtype(n: int) -> np.dtype:
    """Accounts of a flight with n surfaces; actuator_travel (n,) rad, actuator_energy
    (n,) rad2/s: the integral of the speed's square. beyond_threshold_at_s: since a window of faults began
    (windows.py), the first frame in which the diagnosis shows a fault, -1 if none."""
    return record(
        guarantee=GUARANTEE, tracking=TRACKING, authority=AUTHORITY, envelope=ENVELOPE,
        inconclusive=INCONCLUSIVE, beyond_threshold_at_s=float,
        saturated_frames=(int, n), actuator_travel=n, actuator_energy=n, position_then=n,
    )  # fmt: skip


@sized
def true_faults_dtype(n: int) -> np.dtype:
    """present: 1 from the first fault on. effectiveness (n,): 1 healthy. immovable (n,): does not follow its
    command. effective (n,) rad: the deflection that acts. Cm_alpha3: the unanticipated pitching moment."""
    return record(present=int, Cm_alpha3=float, effectiveness=n, immovable=(int, n), effective=n)


@kernel
def share_faults(truth, faults):
    """Fill `faults` (`true_faults_dtype`), which an informed law alone is given."""
    faults.present, faults.Cm_alpha3 = truth.faulted, truth.Cm_alpha3
    for s in range(faults.effectiveness.size):
        faults.effectiveness[s] = effectiveness(truth, s)
        faults.effective[s] = effective(truth, s)
        faults.immovable[s] = truth.immovable[s]


@kernel
def effect_of_faults(guarantee, truth, prediction, y):
    """Fill guarantee.phi (3,) rad/s2: what the truth's faults do to the angular acceleration, as the design
    model weighs it."""
    phi, G, u = guarantee.phi, prediction.G, prediction.u
    phi[:] = 0.0
    if truth.faulted:
        for i in range(3):
            for s in range(u.size):
                phi[i] += G[i, s] * (effective(truth, s) - u[s])
        phi[PITCH] += unanticipated_pitch(prediction.design, y, truth.Cm_alpha3)


@kernel
def follow_guarantee(guarantee, bank, dt, share, k, t):
    """Advance the filtered effect by the elapsed frame and note the first instant t (s) of certainty.

    share: one over the instants in a frame. The sum then restarts with this instant. k: number of the
    diagnosis' frame; with its first one, of 0, its filters are empty, whatever went before.
    """
    if k == 0:
        guarantee.effect[:], guarantee.phi_sum[:], guarantee.certain_after_s = 0.0, guarantee.phi, -1.0
        return
    for i in range(3):
        mean = share * guarantee.phi_sum[i]
        for m in range(bank.config.n_filters):
            effect = bank.config.a[m] * guarantee.effect[m, i] + dt * mean
            guarantee.effect[m, i] = effect
            certain = abs(effect) > 2.0 * bank.output.threshold[m, i] > 0.0
            if certain and guarantee.certain_after_s < 0.0:
                guarantee.certain_after_s = t
        guarantee.phi_sum[i] = guarantee.phi[i]


@kernel
def track(tracking, truth, model_rate):
    """Add this frame's squared error of the rates, rad2/s2; model_rate (3,) rad/s."""
    if truth.faulted:
        sums = tracking.since
        tracking.frames_since += 1
    else:
        sums = tracking.before
        tracking.frames_before += 1
    for i in range(3):
        sums[i] += (model_rate[i] - truth.value[i]) ** 2


@kernel
def account_surfaces(accounts, truth, saturated, k, dt):
    """How long each surface was saturated, how far it has travelled and how fast."""
    for s in range(saturated.size):
        now = position(truth, s)
        accounts.saturated_frames[s] += saturated[s]
        if k > 0:
            moved = now - accounts.position_then[s]
            accounts.actuator_travel[s] += abs(moved)
            accounts.actuator_energy[s] += moved * moved / dt
        accounts.position_then[s] = now


@kernel
def account_authority(authority, axes):
    """How much of what was demanded after the fault the surfaces could not give, and for how long not even
    the rates could have been held."""
    for i in range(3):
        authority.demanded[i] += abs(axes.demand[i])
        authority.lacking[i] += abs(axes.shortfall[i])
        authority.beyond_frames[i] += axes.beyond[i]


@kernel
def note_envelope(envelope, outside, t):
    """Note when the flight leaves the validated envelope and when it comes back; t s."""
    envelope.outside_frames += outside
    exits = outside and not envelope.outside
    envelope.n_exits += exits
    last = min(envelope.n_exits, MAX_EVENTS) - 1  # of more than there is room for, the latest stays
    if exits:
        envelope.exit_at_s[last], envelope.return_at_s[last] = t, np.inf
    elif envelope.outside and not outside:
        envelope.return_at_s[last] = t
    envelope.outside = outside


@kernel
def note_inconclusive(inconclusive, fdi, t):
    """Count this frame, and why nothing can be concluded in it; t s."""
    enabled, error_map = fdi.config.enabled, fdi.bound.error_map
    inconclusive.watched += 1
    if enabled and (error_map.n_boxes == 0 or not error_map.outside):
        return
    if inconclusive.frames == 0:
        inconclusive.from_s = t
    inconclusive.frames += 1
    if not enabled:
        inconclusive.undiagnosed += 1
    elif map_row(error_map) < 0:
        inconclusive.late += 1
    else:
        note_place(inconclusive, error_map)


@kernel
def note_place(inconclusive, error_map):
    """Count the quantities in which this place is outside the map."""
    explained = False
    for i in range(error_map.coordinates.size):
        if outside_span(error_map, i):
            now, first = error_map.coordinates[i], inconclusive.beyond[i] == 0
            inconclusive.least[i] = now if first else min(now, inconclusive.least[i])
            inconclusive.greatest[i] = now if first else max(now, inconclusive.greatest[i])
            inconclusive.beyond[i] += 1
            explained = True
    inconclusive.between += not explained


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
    if monitor.config.enabled and monitor.stage:
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


@apart
def monitor_sensors(frame):
    """Compare the sensors with one another, and replace the broken one. Time inside a frame counts as that of
    its end."""
    fdi, monitor, engine = frame.fdi, frame.fdi.sensor_monitor, frame.control.power.output
    before, t = monitor.output.alarmed, frame.k * frame.dt
    if engine.in_use:
        sensor_monitor.expect_pressure(monitor, engine.command[0])
    sensor_monitor.check_sensors(
        monitor, frame.prediction, frame.measured, fdi.verdict, fdi.bank, fdi.bound, frame.dt, t
    )
    att = fdi.statistical.attitude
    if att.enabled:
        sensor_monitor.add_turn(monitor, att, frame.measured.signal)
        if fdi.verdict.detected and att.gyro >= 0 and monitor.output.isolated_sensor < 0:
            sensor_monitor.name_gyro(monitor, fdi.verdict, att.gyro, t)
    if monitor.output.alarmed and not (before or monitor.output.keeps_surface):
        reset_surface_diagnosis(fdi)


@kernel
def reset_surface_diagnosis(fdi):
    """Discard what the diagnosis of the surfaces made of a broken sensor."""
    conclusion.withdraw_conclusion(fdi.verdict)
    verdict.clear_modes(fdi.types.surface)
    fdae.reset_network(fdi.fdae.network)


@apart
def sense(frame):
    """Measure, and see what the design model makes of this instant. frame.departed: the flight's status."""
    truth, prediction, measured = frame.truth, frame.prediction, frame.measured
    measure(truth, frame.instruments, measured)
    if frame.fdi.sensor_monitor.config.enabled:
        monitor_sensors(frame)
    status = flight_status(truth.value, truth.ground_m, truth.slow_mps)
    if status != NOT_FINITE:
        evaluate_design(prediction, measured)
        effect_of_faults(frame.accounts.guarantee, truth, prediction, measured.y)
    frame.departed = status


@kernel
def start_clock(frame):
    """Set the time of the frame, s since the start."""
    frame.t = frame.k * frame.dt


@kernel
def advance_clock(frame):
    """Count the frame: it is over."""
    frame.k += 1


@apart
def evaluate_elapsed(frame):
    """See what the design model makes of the elapsed frame."""
    evaluate_frame(frame.prediction, frame.fdi.bound, frame.measured, frame.k, frame.dt)


@kernel
def begin(frame):
    """Measure, and evaluate the elapsed frame. frame.departed: see `sense`."""
    start_clock(frame)
    sense(frame)
    if frame.departed != NOT_FINITE:
        evaluate_elapsed(frame)


@kernel
def diagnose(frame):
    """The diagnosis, from prediction to verdict, by the kernels of the scheme in charge.

    The faults that the law already takes into account are expected: they are no innovation. Of a law that is
    informed of the truth, those count that the diagnosis itself has found.
    """
    fdi, prediction, measured, k = frame.fdi, frame.prediction, frame.measured, frame.k - frame.since
    diagnoses_all_types = fdi.config.diagnoses_all_types
    applied, found, informed = frame.control.surfaces.output, frame.assessment, frame.control.config.informed
    monitors.disable_if_apart(fdi.engine_monitor, frame.control.power.output.command[1:])
    if k == 0:
        schemes.begin_scheme(fdi, prediction, measured)
    else:
        left = found.effectiveness if informed else applied.effectiveness
        offset = found.offset if informed else applied.offset
        predict_known(prediction, fdi.verdict.detected, left, offset, diagnoses_all_types)
        schemes.advance_estimators_to_frame(fdi, prediction, measured, k, frame.t)
    schemes.update_verdict(fdi, prediction, measured, frame.t)
    record_isolated_surfaces(fdi, frame.t)
    schemes.prepare_next_frame(fdi, prediction, measured, k)
    begin_sums(prediction, fdi.bound, fdi.layout, diagnoses_all_types, measured)
    follow_guarantee(frame.accounts.guarantee, fdi.bank, fdi.config.dt, prediction.w, k, frame.t)
    assess_faults(frame)


@kernel
def assess_faults(frame):
    """Put what the diagnosis says of each surface, and of what is unknown, where the law reads it."""
    fdi, assessment = frame.fdi, frame.assessment
    config, found, types, layout, detector = fdi.config, fdi.verdict, fdi.types, fdi.layout, fdi.statistical
    if found.detected and sensor_monitor.has_alarm(fdi.sensor_monitor):
        hold_assessment(assessment, types)
    else:
        assess_surfaces(assessment, config, found, types, layout, fdi.isolation.estimator, detector)
    assess_unknown(assessment, config, found, types, layout, detector, fdi.fdae, fdi.bound)


@apart
def accumulate_instant(frame):
    """Take in an instant inside a frame: what is believed of it, and the gust that the vanes see by then."""
    fdi = frame.fdi
    schemes.accumulate_substep(fdi, frame.prediction, frame.measured)
    add_instant(frame.prediction, fdi.bound, fdi.layout, fdi.config.diagnoses_all_types, frame.measured)


@kernel
def sense_inside(frame):
    """See an instant inside a frame of the loop, for the means over that frame; nothing is commanded.

    A departure, or what is not finite, is left for the end of the frame to find.
    """
    sense(frame)
    if frame.departed != NOT_FINITE:
        accumulate_instant(frame)
        guarantee = frame.accounts.guarantee
        for i in range(3):
            guarantee.phi_sum[i] += guarantee.phi[i]
    frame.departed = FLYING


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: see conclusion.py."""
    return assessed.isolated_theta(
        fdi.config, fdi.verdict, fdi.layout, fdi.isolation.estimator, fdi.statistical, s
    )[0]


@kernel
def decide(frame):
    """The mode for this frame."""
    control, layout, informed = frame.control, frame.control.layout, frame.control.config.informed
    if informed:
        share_faults(frame.truth, frame.faults)
        wanted = accommodation.true_mode(control.config, layout, frame.faults)
    else:
        wanted = accommodation.mode_from(control.config, layout, frame.fdi.verdict, frame.assessment)
    accommodation.supervise(frame.supervisor, wanted, frame.t)


@kernel
def accommodate(frame):
    """How effective the law takes each surface to be."""
    law, prediction = frame.control.config.law, frame.prediction
    state.accommodate(law, frame.control, frame.assessment, frame.faults, prediction, frame.measured)


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
        control.config.law, control, frame.assessment, frame.faults, frame.prediction, frame.measured, mode,
        frame.t,
    )  # fmt: skip


@apart
def fly_profile(frame, commanded):
    """Add the outer loops' body rates to what is commanded (3,) rad/s, and set the engine."""
    autopilot = frame.autopilot
    control = frame.control
    prediction = frame.prediction
    value = frame.truth.value
    unexplained, elevator = control.axes.disturbance[PITCH], control.layout.main[PITCH]
    if unexplained != 0.0:
        unexplained /= prediction.G[PITCH, elevator]  # rad of the elevator
    steer(autopilot, control, prediction.u, frame.measured, unexplained, frame.t)
    if autopilot.sets_power:
        power.follow_autopilot(control.power, autopilot.power_setting, autopilot.power_airspeed)
    record_deviations(
        autopilot, value[ch.ALTITUDE], value[ch.AIRSPEED], value[ch.PHI + 2], value[ch.PHI], frame.t
    )
    for i in range(3):
        commanded[i] += autopilot.rates[i]


@kernel
def note_beyond_threshold(accounts, fdi, t):
    """Note that a detector is beyond its threshold at t s. A plug-in says so itself."""
    monitor, detector, authority = fdi.sensor_monitor, fdi.statistical, fdi.config.authority
    if fdi.config.scheme_number == PLUGIN_SCHEME:
        is_beyond = fdi.plugin_verdict.detected == 1
    else:
        uses_statistics = weighs_statistics(detector, authority)
        ratio = detection_share(fdi.bank, detector.alarm, authority, uses_statistics)
        is_beyond = ratio > 1.0 or (sensor_monitor.has_alarm(monitor) and monitor.output.top_ratio > 1.0)
    if is_beyond:
        accounts.beyond_threshold_at_s = t


@kernel
def account(frame):
    """Advance the metrics' sums by this frame; before a fault, the closest approach to an alarm."""
    control, truth, sums = frame.control, frame.truth, frame.accounts
    track(sums.tracking, truth, control.reference.output.model_rate)
    if truth.faulted:
        account_authority(sums.authority, control.axes)
        if sums.beyond_threshold_at_s < 0.0:
            note_beyond_threshold(sums, frame.fdi, frame.t)
    else:
        filters.keep_bank_peak(frame.fdi.bank)
        alarm = frame.fdi.statistical.alarm
        alarm.peak = max(alarm.peak, alarm.ratio)
    saturated, dt = control.allocation.output.saturated, control.reference.config.dt
    account_surfaces(sums, truth, saturated, frame.k, dt)
    note_envelope(sums.envelope, truth.value[ch.ENVELOPE] < 0.5, frame.t)
    note_inconclusive(sums.inconclusive, frame.fdi, frame.t)


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
        row[row.size - n :] = detector.alarm.share[:n]


@apart
def finish(frame, commanded, row):
    """Account, record and hand the command over; the reference model moves on. commanded (3,) rad/s."""
    control, prediction = frame.control, frame.prediction
    if frame.autopilot.enabled:
        fly_profile(frame, commanded)
    account(frame)
    record_row(frame, commanded, row)
    reference.follow(control.reference.config, control.reference.output, commanded)
    authority_lost = control.surfaces.output.authority_lost
    reference.govern(control.reference, commanded, control.axes.shortfall, authority_lost)
    move_surfaces(prediction, control.allocation.output.command)
    hand_over(frame.truth, prediction.commanded, control.power.output)
    advance_clock(frame)
    frame.row += 1
