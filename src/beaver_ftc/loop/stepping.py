"""The compiled frame as Python calls it: whole, many in a row, and what is looked at between two.

Where a plug-in is between (plugin_frame.py), Python calls the frame's stages one by one: here they take
arrays, since to look up the type of a whole record costs a call from Python a hundred frames.

frames (1,): of `frame_dtype` (assembly.py).
"""

from beaver_ftc.compiled import apart, kernel, row_of
from beaver_ftc.design.model import move
from beaver_ftc.diagnosis.conclusion import uses_statistical_estimates
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import built_in_statistic as largest_statistic
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.accounts import add_effect
from beaver_ftc.plant.channels import advance
from beaver_ftc.plant.sensing import FLYING, NOT_FINITE, hand_over, sample_forces


@kernel
def begin_sensor_monitor(frames):
    """Begin to watch the instruments, with the readings there are. Where accelerometers were not read, their
    truth stands there."""
    frame = frames[0]
    if not frame.measured.inertial:
        sample_forces(frame.instruments, frame.measured)
    sensor_monitor.begin_monitor(frame.fdi.sensor_monitor, frame.measured, frame.t)


@kernel
def begin(frames):
    """See frame.py, as of all stages down to `finish`."""
    return whole.begin(frames[0])


@kernel
def diagnose(frames):
    """The diagnosis alone."""
    whole.diagnose(frames[0])


@kernel
def decide(frames):
    """What the supervisor makes of the verdict."""
    whole.decide(frames[0])


@kernel
def command(frames):
    """The built-in law alone."""
    whole.command(frames[0])


@kernel
def take_command(frames, deflections):
    """In its place a plug-in's, (n,) rad."""
    whole.take_command(frames[0], deflections)


@kernel
def finish(frames, references, log):
    """The end of a frame; references, log: as in `fly_frame`."""
    frame = frames[0]
    whole.finish(frame, row_of(references, frame.row), row_of(log, frame.row))


@kernel
def built_in_statistic(frames):
    """The built-in detection's statistic at this frame: see schemes.built_in_statistic."""
    fdi = frames[0].fdi
    alarm, authority = fdi.statistical.alarm, fdi.config.authority
    return largest_statistic(
        fdi.bank, alarm, authority, uses_statistical_estimates(fdi.statistical.tests, authority)
    )


@kernel
def hold(frames):
    """Command frame.held_rad in the law's place, from the frame just flown on: nothing has moved since."""
    frame = frames[0]
    belief = frame.belief
    frame.held = 1
    belief.commanded[:] = frame.held_rad
    belief.u[:] = belief.u_before
    move(belief.actuators, belief.commanded, belief.u)
    hand_over(frame.truth, belief.commanded, frame.control.power.output)


@kernel
def sense_inside(frames):
    """See an instant inside a frame of the loop, for the means over that frame; nothing is commanded.

    A departure, or what is not finite, is left for `fly_frame` to find.
    """
    frame = frames[0]
    if whole.sense(frame) != NOT_FINITE:
        whole.accumulate_instant(frame)
        add_effect(frame.accounts.guarantee)


@apart
def fly_one(frame, commanded, row):
    """See `fly_frame`, which returns frame.departed. By itself, so that all who call it share its code.

    commanded (3,) rad/s, row (columns,) of the log: rows, which nobody counts the users of.
    """
    frame.departed = whole.begin(frame)
    if frame.departed != NOT_FINITE:
        whole.diagnose(frame)
        whole.decide(frame)
        whole.command(frame)
        whole.finish(frame, commanded, row)


@kernel
def fly_frame(frames, references, log):
    """One frame of the closed loop with the built-in diagnosis and law.

    references (m, 3) rad/s and log (m, columns): of the present chunk, indexed by frame.row. Returns FLYING,
    or why the flight ends: the row of a departure is still recorded, that of a non-finite truth is not.
    """
    frame = frames[0]
    fly_one(frame, row_of(references, frame.row), row_of(log, frame.row))
    return frame.departed


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
                sense_inside(frames)
        status = fly_frame(frames, references, log)
        if status != FLYING:
            return status
    return FLYING
