"""The steps of the compiled frame, one call each, for flights in which a plug-in diagnoses or commands.

    measure -> diagnose | take_verdict -> decide -> command | take_command -> finish

left of a bar: built in, right of it: a plug-in's answer. `frame.fly_frame` is the built-in ones in one call.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import instruments, scheme
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.rows import row_of
from beaver_ftc.plant.sensing import sample_forces


@kernel
def measure(frames):
    """Measure, and see what the design model makes of the elapsed frame. Returns the flight's status."""
    return whole.begin(frames[0])


@kernel
def begin_watch(frames):
    """Begin to watch the instruments, with the readings there are. Where accelerometers were not read, their
    truth stands there."""
    frame = frames[0]
    if not frame.measured.inertial:
        sample_forces(frame.instruments, frame.measured)
    instruments.begin(frame.fdi.watch, frame.measured, frame.t)


@kernel
def diagnose(frames):
    """The built-in diagnosis."""
    whole.diagnose(frames[0])


@kernel
def take_verdict(frames):
    """A plug-in's verdict, written to the frame's `verdict`."""
    whole.take_verdict(frames[0])


@kernel
def built_in_statistic(frames):
    """The built-in detection's statistic at this frame: see scheme.py."""
    return scheme.built_in_statistic(frames[0].fdi)


@kernel
def decide(frames):
    """The mode."""
    whole.decide(frames[0])


@kernel
def command(frames):
    """The built-in law, or a command that is held in its place."""
    whole.command(frames[0])


@kernel
def take_command(frames, deflections):
    """A plug-in's command (n,) rad, within the travel of each surface."""
    whole.take_command(frames[0], deflections)


@kernel
def finish(frames, references, log):
    """Account, record, hand the command over."""
    frame = frames[0]
    whole.finish(frame, row_of(references, frame.row), row_of(log, frame.row))
