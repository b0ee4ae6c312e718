"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/scheme.py       what is believed of the aircraft, and whether it still holds
    decide      control/supervisor.py     the mode
    command     control/law.py            the surfaces, and the engine
    outer loops control/outer/            the reference of the next frame, if a profile is to be flown
    record      accounts.py, record.py    the metrics' sums, a row of the log

Each has records of its own; what a flight remembers is all of them in one, so that a frame is one call from
Python. The command computed in a frame is in effect from the next on.
"""

from functools import lru_cache

import numba
import numpy as np

from beaver_ftc.compiled import apart, in_two, kernel
from beaver_ftc.control import authority, law, reference_model
from beaver_ftc.control.accommodation import accommodate
from beaver_ftc.control.oracle import true_faults_dtype, true_mode
from beaver_ftc.control.outer.autopilot import judge, steer
from beaver_ftc.control.outer.state import AUTOPILOT
from beaver_ftc.control.state import ORACLE, control_dtype
from beaver_ftc.control.supervisor import SUPERVISOR, mode_from, supervise
from beaver_ftc.design.actuators import move
from beaver_ftc.diagnosis import scheme
from beaver_ftc.diagnosis.belief import belief_dtype, follow_command, look_back, respond
from beaver_ftc.diagnosis.instruments import attend
from beaver_ftc.diagnosis.scheme import diagnosis_dtype
from beaver_ftc.diagnosis.state import verdict_dtype
from beaver_ftc.loop.accounts import account, accounts_dtype, add_effect, effect_of_faults, follow_guarantee
from beaver_ftc.loop.record import record
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
        ("faults", true_faults_dtype(n)), ("supervisor", SUPERVISOR), ("control", control_dtype(n)),
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
    watch, power = frame.fdi.watch, frame.control.power
    if power.in_use:
        watch.step.command[1] = power.command[0]
    attend(watch, frame.fdi, frame.belief, frame.measured, frame.k * frame.dt)


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
    control, fdi, belief = frame.control, frame.fdi, frame.belief
    k = frame.k - frame.since
    scheme.diagnose(fdi, belief, frame.measured, control.effectiveness, control.offset, k, frame.t)
    follow_guarantee(frame.accounts.guarantee, fdi, belief.share, k, frame.t)


@kernel
def take_verdict(frame):
    """Take a plug-in's verdict, which is in frame.verdict, in place of the built-in diagnosis."""
    control, fdi, belief, k = frame.control, frame.fdi, frame.belief, frame.k - frame.since
    scheme.take_verdict(
        fdi, belief, frame.measured, frame.verdict, control.effectiveness, control.offset, k, frame.t
    )
    follow_guarantee(frame.accounts.guarantee, fdi, belief.share, k, frame.t)


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
    control, oracle = frame.control, frame.control.law == ORACLE
    share_faults(frame.truth, frame.faults, oracle)
    wanted = true_mode(control, frame.faults) if oracle else mode_from(control, frame.fdi)
    supervise(frame.supervisor, wanted, frame.t)


@kernel
def take_command(frame, deflections):
    """A command (n,) rad from outside, within the travel of each surface."""
    accommodate(frame.control, frame.fdi, frame.belief, frame.measured, frame.faults)
    law.take_command(frame.control, deflections)


@kernel
def command(frame):
    """The built-in law; or whoever commands in its place."""
    if frame.held:
        take_command(frame, frame.held_rad)
        return
    mode = frame.supervisor.mode
    law.command(frame.control, frame.fdi, frame.belief, frame.measured, frame.faults, mode, frame.t)


@apart
def fly_profile(frame, reference):
    """Add the outer loops' body rates to the reference (3,) rad/s, and set the engine."""
    autopilot, value = frame.autopilot, frame.truth.value
    steer(autopilot, frame.control, frame.belief, frame.measured, frame.t)
    judge(autopilot, value[ch.ALTITUDE], value[ch.AIRSPEED], value[ch.PHI + 2], value[ch.PHI], frame.t)
    for i in range(3):
        reference[i] += autopilot.rates[i]


@kernel
def finish(frame, reference, row):
    """Account, record and hand the command over; the reference model moves on."""
    control, belief = frame.control, frame.belief
    if frame.autopilot.enabled:
        fly_profile(frame, reference)
    account(frame.accounts, frame.truth, frame.fdi, control, frame.k, frame.t)
    record(frame, reference, row)
    reference_model.follow(control, reference)
    authority.govern(control, reference)
    follow_command(belief, control.command)
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
    inside = there[-1][1][:-1]
    return [*there, (scheme.look_inside, inside)], here


in_two(fly_frame, _halves_of_a_frame)
in_two(fly_on, _halves_of_frames)
