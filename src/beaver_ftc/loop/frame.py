"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/                what the design model predicts, and whether it still holds
    decide      control/accommodation.py  the mode
    command     control/                  the surfaces, and the engine
    outer loops control/autopilot.py      the reference of the next frame, if a profile is to be flown
    record      accounts.py, log_row.py   the accounts of the flight, a row of the log

Each stage has records of its own; what a flight remembers is all of them in one (assembly.py), which only the
kernels of these files see whole. Python calls them through stepping.py. The command computed in a frame is
in effect from the next on.
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.control import accommodation, allocation, power, state
from beaver_ftc.control.autopilot import steer
from beaver_ftc.control.laws import reference
from beaver_ftc.control.profile import record_deviations
from beaver_ftc.diagnosis import assessment, conclusion, schemes
from beaver_ftc.diagnosis.detection import fdae
from beaver_ftc.diagnosis.model_prediction import (
    add_instant,
    begin_sums,
    evaluate_design,
    evaluate_frame,
    move_surfaces,
    predict_known,
)
from beaver_ftc.diagnosis.monitors import engine_monitor, sensor_monitor
from beaver_ftc.diagnosis.schemes.isolated_surfaces import record_isolated_surfaces
from beaver_ftc.diagnosis.types import modes
from beaver_ftc.loop.accounts import account
from beaver_ftc.loop.guarantee import add_effect, effect_of_faults, follow_guarantee
from beaver_ftc.loop.log_row import record_row
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import (
    FLYING,
    NOT_FINITE,
    effective,
    effectiveness,
    flight_status,
    hand_over,
    measure,
)


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
    modes.clear_modes(fdi.types.surface)
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
    engine_monitor.disable_if_apart(fdi.engine_monitor, frame.control.power.output.command[1:])
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
    fdi, out = frame.fdi, frame.assessment
    config, found, types, layout, detector = fdi.config, fdi.verdict, fdi.types, fdi.layout, fdi.statistical
    if found.detected and sensor_monitor.has_alarm(fdi.sensor_monitor):
        assessment.hold_assessment(out, types)
    else:
        assessment.assess_surfaces(out, config, found, types, layout, fdi.isolation.estimator, detector)
    assessment.assess_unknown(out, config, found, types, layout, detector, fdi.fdae, fdi.bound)


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
        add_effect(frame.accounts.guarantee)
    frame.departed = FLYING


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: see assessment.py."""
    return assessment.isolated_theta(
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
    accommodation.supervise(frame.supervisor, wanted, informed, frame.t)


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
