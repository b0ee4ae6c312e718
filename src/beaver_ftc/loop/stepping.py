"""The compiled frame as Python calls it: whole, many in a row, what is looked at between two.

Where a plug-in is between (plugin_frame.py), Python calls the frame's stages one by one: here they take
arrays, since to look up the type of a whole record costs a call from Python a hundred frames.

frames (1,): of `frame_dtype` (assembly.py).
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis.model_prediction import redo_move
from beaver_ftc.diagnosis.schemes import detection_share as largest_statistic
from beaver_ftc.loop import frame as whole
from beaver_ftc.plant.channels import advance
from beaver_ftc.plant.sensing import FLYING, NOT_FINITE, hand_over


@kernel
def begin(frames):
    """See frame.py, as of all stages down to `finish`. Returns the flight's status."""
    frame = frames[0]
    whole.begin(frame)
    return frame.departed


@kernel
def diagnose(frames):
    """The diagnosis alone."""
    diagnose_one(frames[0])


@apart
def diagnose_one(frame):
    """See frame.py. By itself, as `fly_one`."""
    whole.diagnose(frame)


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
    whole.finish(frame, references[frame.row], log[frame.row])


@kernel
def detection_share(frames):
    """The built-in detection's statistic at this frame: see schemes.detection_share."""
    return largest_statistic(frames[0].fdi)


@kernel
def hold(frames):
    """Command frame.held_rad in the law's place, from the frame just flown on: nothing has moved since."""
    frame = frames[0]
    prediction = frame.prediction
    frame.held = 1
    redo_move(prediction, frame.held_rad)
    hand_over(frame.truth, prediction.commanded, frame.control.power.output)


@kernel
def sense_inside(frames):
    """See frame.py."""
    whole.sense_inside(frames[0])


@apart
def fly_one(frame, commanded, row):
    """See `fly_frame`, which returns frame.departed. By itself, so that all who call it share its code.

    commanded (3,) rad/s, row (columns,) of the log: rows, which nobody counts the users of.
    """
    whole.begin(frame)
    if frame.departed != NOT_FINITE:
        diagnose_one(frame)
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
    fly_one(frame, references[frame.row], log[frame.row])
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
