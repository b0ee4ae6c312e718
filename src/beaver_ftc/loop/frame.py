"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/scheme.py       what is believed of the aircraft, and whether it still holds
    decide      control/supervisor.py     the mode
    command     control/                  the surfaces, and the engine
    outer loops control/outer/            the reference of the next frame, if a profile is to be flown
    record      accounts.py, record.py    the metrics' sums, a row of the log

Each has records of its own; what a flight remembers is all of them in one, so that a frame is one call from
Python. The command computed in a frame is in effect from the next on.
"""

from functools import lru_cache

import numba
import numpy as np

from beaver_ftc.compiled import apart, in_two, kernel
from beaver_ftc.control import accommodation, allocation, power, reference, supervisor
from beaver_ftc.control.accommodation import assessment_dtype, true_faults_dtype
from beaver_ftc.control.laws import INDI, LQR, NOMINAL, ORACLE, REJECTING, published, rejecting
from beaver_ftc.control.outer.autopilot import judge, steer
from beaver_ftc.control.outer.state import AUTOPILOT
from beaver_ftc.control.rivals import compiled
from beaver_ftc.control.state import control_dtype
from beaver_ftc.control.supervisor import MODE_REALLOCATED, SUPERVISOR
from beaver_ftc.design.actuators import move
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.diagnosis import bank, scheme, statistical
from beaver_ftc.diagnosis.belief import belief_dtype, follow_command, look_back, respond
from beaver_ftc.diagnosis.instruments import attend
from beaver_ftc.diagnosis.scheme import (
    diagnosis_dtype,
    isolated_surface,
    isolated_theta,
    likelihood_counts,
    unknown_acceleration,
)
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, verdict_dtype
from beaver_ftc.diagnosis.types.examine import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.diagnosis.types.verdict import deflection_error, effectiveness_left, possible
from beaver_ftc.loop.accounts import (
    account_authority,
    account_surfaces,
    accounts_dtype,
    add_effect,
    effect_of_faults,
    follow_guarantee,
    note_envelope,
    track,
)
from beaver_ftc.loop.record import (
    put,
    record_alarm,
    record_estimator,
    record_profile,
    record_surfaces,
    record_truth,
    record_watch,
)
from beaver_ftc.loop.rows import row_of
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import INSTRUMENTS
from beaver_ftc.plant.native import RUNNING, advance
from beaver_ftc.plant.sensing import (
    FLYING,
    MEASURED,
    NOT_FINITE,
    effective,
    effectiveness,
    flight_status,
    hand_over,
    measure,
    truth_dtype,
)
from beaver_ftc.scenario.diagnosis import FdiConfig

__all__ = ["FLYING", "NOT_FINITE", "fly_frame", "fly_on", "frame_dtype", "hold", "idle", "look_inside"]


SURE = 400.0  # one over the variance of an effectiveness known to 0.05

# What the log has columns for: estimators, the watch, the engine, statistical tests.
LOGGED = np.dtype([("estimators", "i8"), ("watch", "i8"), ("power", "i8"), ("tests", "i8")], align=True)


@lru_cache
def frame_dtype(n: int) -> np.dtype:
    """All that a flight of an aircraft with n surfaces remembers between frames."""
    fields = [
        ("k", "i8"), ("row", "i8"), ("dt", "f8"), ("t", "f8"),  # frame, row of the log, s, s
        ("running", RUNNING),
        ("since", "i8"), ("logged", LOGGED),  # the frame with which this diagnosis has begun
        ("truth", truth_dtype(n)), ("instruments", INSTRUMENTS), ("measured", MEASURED),
        ("belief", belief_dtype(n)), ("fdi", diagnosis_dtype(n)), ("verdict", verdict_dtype(n)),
        ("assessment", assessment_dtype(n)), ("faults", true_faults_dtype(n)),
        ("supervisor", SUPERVISOR), ("control", control_dtype(n)),
        ("autopilot", AUTOPILOT),
        ("held", "i8"), ("held_rad", "f8", (n,)),  # whether another than the law commands, and what
        ("accounts", accounts_dtype(n)), ("departed", "i8"),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


def idle(fdi: FdiConfig) -> list[tuple[str, ...]]:
    """Large fields that are not read before they are written: delay lines are filled by the first sample."""
    parts = {"block": bool(fdi.statistical), "views": bool(fdi.statistical) and fdi.fault_class == "all"}
    unused = [("fdi", "statistical", part) for part, used in parts.items() if not used]
    return [("instruments", "line"), *unused]


@apart
def watch_instruments(frame):
    """Hold the instruments against one another; what is known to be broken is replaced. What an instant
    inside a frame shows is known with that frame."""
    fdi, watch, engine = frame.fdi, frame.fdi.watch, frame.control.power
    before, t = watch.alarmed, frame.k * frame.dt
    if engine.in_use:
        watch.step.command[1] = engine.command[0]
    attend(watch, frame.belief, frame.measured, fdi.verdict, fdi.bank, fdi.bound, frame.dt, t)
    if watch.alarmed and not (before or watch.beside):
        take_back(fdi)


@kernel
def take_back(fdi):
    """What the diagnosis of the surfaces made of a broken instrument is void."""
    for s in range(fdi.types.surface.size):
        fdi.types.surface[s].measure = -1
    fdi.fdae.network.weights[:] = 0.0
    fdi.fdae.network.output[:] = 0.0


@kernel
def sense(frame):
    """Measure, and see what the design model makes of this instant. Returns the flight's status."""
    truth, belief, measured = frame.truth, frame.belief, frame.measured
    measure(truth, frame.instruments, measured)
    if frame.fdi.watch.enabled:
        watch_instruments(frame)
    status = flight_status(truth.value, truth.ground_m)
    if status != NOT_FINITE:
        respond(belief, measured)
        effect_of_faults(frame.accounts.guarantee, truth, belief, measured.y)
    return status


@kernel
def begin(frame):
    """Measure, and see what the design model makes of the elapsed frame. Returns the flight's status."""
    frame.t = frame.k * frame.dt
    status = sense(frame)
    if status != NOT_FINITE:
        look_back(frame.belief, frame.fdi.bound, frame.measured, frame.k, frame.dt)
    return status


@kernel
def diagnose(frame):
    """The built-in diagnosis; and when detection would have been certain."""
    surfaces, fdi, belief = frame.control.surfaces, frame.fdi, frame.belief
    k = frame.k - frame.since
    scheme.diagnose(fdi, belief, frame.measured, surfaces.effectiveness, surfaces.offset, k, frame.t)
    follow_guarantee(frame.accounts.guarantee, fdi.bank, fdi.config.dt, belief.share, k, frame.t)
    assess(fdi, frame.assessment)


@kernel
def take_verdict(frame):
    """Take a plug-in's verdict, which is in frame.verdict, in place of the built-in diagnosis."""
    surfaces, fdi, belief, k = frame.control.surfaces, frame.fdi, frame.belief, frame.k - frame.since
    scheme.take_verdict(
        fdi, belief, frame.measured, frame.verdict, surfaces.effectiveness, surfaces.offset, k, frame.t
    )
    follow_guarantee(frame.accounts.guarantee, fdi.bank, fdi.config.dt, belief.share, k, frame.t)
    assess(fdi, frame.assessment)


@kernel
def assess(fdi, assessment):
    """Put what the diagnosis says of each surface where the law reads it (`assessment_dtype`)."""
    verdict, named = fdi.verdict, isolated_surface(fdi)
    assessment.detected, assessment.every_type = verdict.detected, fdi.config.every_type
    assessment.named, assessment.hedge = named, 0
    for s in range(assessment.measure.size):
        assessment.measure[s] = fdi.types.surface[s].measure if fdi.config.every_type else -1
        assessment.effectiveness[s], assessment.at_once[s] = 1.0, 0
        assessment.offset[s], assessment.lag[s] = 0.0, 0.0
        if verdict.estimates and verdict.detected:
            assessment.effectiveness[s] = verdict.effectiveness[s]
        elif assessment.measure[s] >= 0:
            assess_type(fdi, assessment, s)
        elif s == named and not fdi.config.every_type:
            assess_loss(fdi, assessment, s)


@kernel
def assess_loss(fdi, assessment, s):
    """Surface s has lost effectiveness; what is known well need not be eased in."""
    assessment.effectiveness[s] = 1.0 + isolated_theta(fdi, s)
    if likelihood_counts(fdi) and statistical.estimated_loss(fdi.statistical.block, s)[1] > SURE:
        assessment.at_once[s] = 1


@kernel
def assess_type(fdi, assessment, s):
    """What the diagnosis of every type makes of surface s."""
    surface = fdi.types.surface[s]
    at_fault = possible(surface)
    if surface.measure == LOSES:
        assessment.effectiveness[s] = effectiveness_left(fdi.types, fdi.layout, fdi.isolation.estimator, s)
    elif surface.measure == FIXED:
        assessment.effectiveness[s], assessment.at_once[s] = 0.0, 1
        assessment.offset[s] = surface.command + deflection_error(surface, at_fault)
    elif surface.measure == SHIFTED:
        assessment.offset[s] = deflection_error(surface, at_fault)
    elif surface.measure == LAGS:
        assessment.lag[s] = 0.5 * (surface.low + surface.high) - surface.command
        assessment.hedge = 1


@kernel
def share_faults(truth, faults, oracle):
    """Put into `faults` what the law may know of the truth: to the oracle all, to others whether to account
    for authority."""
    faults.present = truth.faulted
    if oracle:
        faults.Cm_alpha3 = truth.Cm_alpha3
        for s in range(faults.effectiveness.size):
            faults.effectiveness[s] = effectiveness(truth, s)
            faults.effective[s] = effective(truth, s)
            faults.immovable[s] = truth.immovable[s]


@kernel
def decide(frame):
    """The mode for this frame."""
    control, layout = frame.control, frame.control.layout
    oracle = control.law == ORACLE
    share_faults(frame.truth, frame.faults, oracle)
    if oracle:
        wanted = supervisor.true_mode(layout.main[PITCH], frame.faults)
    else:
        wanted = supervisor.mode_from(control.law, layout, frame.fdi.verdict, frame.assessment)
    supervisor.supervise(frame.supervisor, wanted, frame.t)


@kernel
def accommodate(frame):
    """What the law takes each surface for, and the unknown."""
    control, surfaces = frame.control, frame.control.surfaces
    accommodation.accommodate(
        control.law,
        control.inner,
        frame.assessment,
        surfaces,
        control.rejection,
        control.layout,
        control.allocation.saturated,
        frame.faults,
        frame.belief.u,
    )
    if frame.assessment.hedge and control.law != ORACLE:
        control.reference.hedging = 1
    compensate(frame)


@kernel
def compensate(frame):
    """Fill fhat (3,) rad/s2: what the law takes the unknown for."""
    control, fdi, fhat = frame.control, frame.fdi, frame.control.feedback.fhat
    fhat[:] = 0.0
    if control.inner == REJECTING:
        return  # its observer finds what is unknown
    if control.law == ORACLE:
        fhat[PITCH] = unanticipated_pitch(frame.belief.design, frame.measured.y, frame.faults.Cm_alpha3)
    elif control.law != NOMINAL and fdi.verdict.detected:
        unknown_acceleration(fdi, fhat)
        if fdi.verdict.lead >= 0 and fdi.verdict.lead_kind == LAGS:
            fhat[:] = 0.0  # to ask a slow surface for what it lacks would only wind the command up


@kernel
def in_doubt(frame):
    """Whether elevator or flap is at fault and it has long been open which."""
    fdi, law = frame.fdi, frame.control.law
    open_question = fdi.config.every_type and fdi.verdict.detected and fdi.verdict.isolated == NOT_ISOLATED
    long = fdi.types.surface[frame.control.layout.main[PITCH]].evidence >= fdi.types.config.patience
    return open_question and long and law not in (NOMINAL, ORACLE)


@kernel
def hand_over_pitch(frame):
    """Hand the pitch demand to the flap, or back. What a jammed elevator no longer carries goes at once."""
    control, surfaces, every_type = frame.control, frame.control.surfaces, frame.fdi.config.every_type
    remains, least = surfaces.effectiveness[control.layout.main[PITCH]], surfaces.least_effectiveness
    at_once = control.reference.hedging or (remains < least and every_type)
    reallocated = frame.supervisor.mode == MODE_REALLOCATED
    allocation.advance_hand_over(control.allocation, reallocated, at_once, 1.0 - remains, every_type)
    rejecting.hand_over(control.rejection, control.allocation.hand_over, remains, least)


@kernel
def demand(frame):
    """The angular accelerations (3,) rad/s2 that the inner law asks of the surfaces."""
    control, belief, measured, axes = frame.control, frame.belief, frame.measured, frame.control.axes
    surfaces, reference = control.surfaces, control.reference
    if control.inner == REJECTING:
        main = control.layout.main
        rejecting.demand(control.rejection, axes, reference, surfaces, main, belief, measured)
    else:
        published.demand(control.feedback, axes, reference, measured.x, belief.f)
    if control.law != NOMINAL:
        accommodation.allow_for_offsets(axes, surfaces.offset, belief.G)


@kernel
def allocate(frame):
    """The surfaces that give it; what does not follow goes to its trim."""
    control, out, layout = frame.control, frame.control.allocation, frame.control.layout
    wanted, surfaces, rejects = control.axes.demand, control.surfaces, control.inner == REJECTING
    share = control.rejection.lost if rejects else allocation.smooth(out.hand_over)
    probe = control.probe.deflection
    allocation.allocate(out, layout, wanted, surfaces.effectiveness, share, probe)
    if rejects and control.law != NOMINAL and frame.assessment.detected:
        allocation.relieve(out, layout, wanted[PITCH])
    accommodation.give_up(
        control.law,
        frame.assessment,
        surfaces,
        control.rejection.withdrawn,
        frame.faults,
        layout,
        out,
        control.reference,
    )


@kernel
def note_what_is_missing(frame):
    """Whether the demand is met; what is missing in pitch is left to the engine."""
    control, measured, engine = frame.control, frame.measured, frame.control.power
    detected, saturated = frame.assessment.detected, control.allocation.saturated
    if frame.faults.present or control.reference.hedging or (engine.enabled and detected):
        allocation.note_shortfall(control.axes, control.allocation, control.layout, control.surfaces.lag)
    if engine.enabled:
        watched = detected or control.law == ORACLE
        lost = watched and power.pitch_is_lost(
            control.layout, control.surfaces, saturated, control.axes.shortfall
        )
        power.steer(engine, control.reference, measured.x, measured.y, watched, lost, frame.t)


@apart
def command_as_rival(frame):
    """The command of a compiled rival."""
    control = frame.control
    compiled.command(
        control.inner,
        control.rival,
        control.reference,
        control.axes,
        control.allocation,
        control.layout,
        frame.belief.G,
        frame.measured.x,
    )


@kernel
def command_by_law(frame):
    """The built-in law: accommodate, demand, allocate, give back what cannot be had."""
    control, out, belief = frame.control, frame.control.allocation, frame.belief
    accommodate(frame)
    if control.inner in (INDI, LQR):
        command_as_rival(frame)
        return
    if control.law == NOMINAL:
        out.G[:] = belief.G
    else:
        accommodation.believed_effectiveness(control.surfaces, belief.G, out.G)
    hand_over_pitch(frame)
    if control.probe.frames > 0:
        allocation.advance_probe(control.probe, in_doubt(frame), frame.t)
    demand(frame)
    allocate(frame)
    if control.inner != REJECTING:
        published.integrate(control.feedback, control.axes, control.reference, out, frame.measured.x)
    note_what_is_missing(frame)
    if control.inner == REJECTING:
        rejecting.lead_actuators(control.rejection, control.layout, out.command, belief.u)


@kernel
def take_command(frame, deflections):
    """A command (n,) rad from outside, within the travel of each surface."""
    accommodate(frame)
    allocation.take_command(frame.control.allocation, frame.control.layout, deflections)


@kernel
def command(frame):
    """The built-in law; or whoever commands in its place."""
    if frame.held:
        take_command(frame, frame.held_rad)
    else:
        command_by_law(frame)


@apart
def fly_profile(frame, commanded):
    """Add the outer loops' body rates to what is commanded (3,) rad/s, and set the engine."""
    autopilot, control, belief, value = frame.autopilot, frame.control, frame.belief, frame.truth.value
    unexplained = 0.0
    if control.inner == REJECTING:
        elevator = control.layout.main[PITCH]
        unexplained = control.rejection.disturbance[PITCH] / belief.G[PITCH, elevator]
    steer(
        autopilot,
        control.layout,
        control.surfaces,
        control.allocation,
        control.axes.hold,
        control.power,
        belief.u,
        frame.measured,
        unexplained,
        frame.t,
    )
    judge(autopilot, value[ch.ALTITUDE], value[ch.AIRSPEED], value[ch.PHI + 2], value[ch.PHI], frame.t)
    for i in range(3):
        commanded[i] += autopilot.rates[i]


@kernel
def account(frame):
    """Advance the metrics' sums by this frame; before a fault, how near healthy flight has come to an
    alarm."""
    control, truth, accounts = frame.control, frame.truth, frame.accounts
    track(accounts.tracking, truth, control.reference.model_rate)
    if truth.faulted:
        account_authority(accounts.authority, control.axes)
    else:
        bank.note_closest_approach(frame.fdi.bank, frame.fdi.statistical.alarm)
    account_surfaces(accounts, truth, control.allocation.saturated, frame.k, control.reference.dt)
    note_envelope(accounts.envelope, truth.value[ch.ENVELOPE] < 0.5, frame.t)


@kernel
def record(frame, commanded, row):
    """Write the row of a frame in the order of channels.log_columns; commanded (3,) rad/s."""
    control, fdi, belief, logged = frame.control, frame.fdi, frame.belief, frame.logged
    column = record_truth(frame.truth, frame.t, row)
    column = put(row, column, frame.measured.x)
    column = put(row, column, commanded)
    column = put(row, column, control.reference.model_rate)
    column = record_surfaces(frame.truth, belief.commanded, control.allocation.saturated, row, column)
    column = record_alarm(fdi.bank, row, column)
    column = put(row, column, fdi.fdae.residual)
    column = put(row, column, fdi.fdae.threshold)
    column = put(row, column, fdi.bound.eta_bar)
    column = put(row, column, fdi.fdae.network.output)
    column = put(row, column, belief.means.acceleration)
    for e in range(logged.estimators):
        there = e < fdi.isolation.n
        column = record_estimator(fdi.isolation.estimator[e], there, fdi.verdict.detected, row, column)
    column = put(row, column, control.surfaces.effectiveness)
    row[column] = frame.supervisor.mode
    row[column + 1] = fdi.verdict.detected or fdi.watch.alarmed
    column += 2
    if logged.watch:
        record_watch(fdi.watch, row, column)
        column += 2
    if logged.power:
        row[column] = control.power.command[0]
    if frame.autopilot.enabled:
        record_profile(frame.autopilot, row, column + 1)
    chances = fdi.statistical
    if logged.tests and chances.tests.enabled:
        views = chances.views[: chances.n_views]
        statistical.record(chances.tests, chances.block, views, chances.forces, chances.air, row)
    elif logged.tests:
        row[row.size - logged.tests :] = np.nan


@kernel
def finish(frame, commanded, row):
    """Account, record and hand the command over; the reference model moves on. commanded (3,) rad/s."""
    control, belief = frame.control, frame.belief
    if frame.autopilot.enabled:
        fly_profile(frame, commanded)
    account(frame)
    record(frame, commanded, row)
    reference.follow(control.reference, commanded)
    reference.govern(control.reference, commanded, control.axes.shortfall)
    follow_command(belief, control.allocation.command)
    hand_over(frame.truth, belief.commanded, control.power)
    frame.k += 1
    frame.row += 1


@kernel
def hold(frames):
    """Command frame.held_rad in the law's place, from the frame just flown on: nothing has moved since."""
    frame = frames[0]
    belief = frame.belief
    frame.held = 1
    belief.commanded[:] = frame.held_rad
    belief.u[:] = belief.u_then
    move(belief.actuators, belief.commanded, belief.u)
    hand_over(frame.truth, belief.commanded, frame.control.power)


@kernel
def look_inside(frames):
    """See an instant inside a frame of the loop, for the means over that frame; nothing is commanded.

    frames (1,) of dtype `frame_dtype`. A departure, or what is not finite, is left for `fly_frame` to find.
    """
    frame = frames[0]
    if sense(frame) != NOT_FINITE:
        scheme.look_inside(frame.fdi, frame.belief, frame.measured)
        add_effect(frame.accounts.guarantee)


@kernel
def fly_frame(frames, references, log):
    """One frame of the closed loop with the built-in diagnosis and law.

    frames (1,) of dtype `frame_dtype`; references (m, 3) rad/s and log (m, columns) of the present chunk,
    indexed by frame.row. Returns FLYING, or why the flight ends: the row of a departure is still recorded,
    that of a non-finite truth is not.
    """
    frame = frames[0]
    status = begin(frame)
    if status == NOT_FINITE:
        return status
    diagnose(frame)
    decide(frame)
    command(frame)
    finish(frame, row_of(references, frame.row), row_of(log, frame.row))
    return status


@kernel
def fly_on(frames, references, log, order):
    """Frames of the loop one after the other, each after JSBSim's own; nothing else changes meanwhile.

    order: (2,) how many, and how many of JSBSim's to each. The rest, and what is returned: see `fly_frame`.
    """
    running = frames[0].running
    for _ in range(order[0]):
        for left in range(order[1] - 1, -1, -1):
            advance(running)
            if left > 0:
                look_inside(frames)
        status = fly_frame(frames, references, log)
        if status != FLYING:
            return status
    return FLYING


def _halves_of_a_frame(frames, references, log):
    """What `fly_frame` mostly consists of, by types: halves that take about as long to compile."""
    frame, row = frames.dtype, references.copy(ndim=1)
    parts = tuple(frame.fields[name].type for name in ("fdi", "belief", "measured"))
    fdi, belief, measured = parts
    bound = fdi.fields["bound"].type
    there = [(diagnose, (frame,)), (look_back, (belief, bound, measured, numba.int64, numba.float64))]
    return there, [(sense, (frame,)), (command, (frame,)), (finish, (frame, row, row))]


def _halves_of_frames(frames, references, log, order):
    there, here = _halves_of_a_frame(frames, references, log)
    inside = tuple(frames.dtype.fields[name].type for name in ("fdi", "belief", "measured"))
    return [*there, (scheme.look_inside, inside)], here


in_two(fly_frame, _halves_of_a_frame)
in_two(fly_on, _halves_of_frames)
