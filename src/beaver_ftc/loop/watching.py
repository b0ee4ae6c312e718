"""The compiled diagnosis fed from outside: what is measured comes as arguments, nothing is read or written.

take -> stepping.diagnose -> accommodate_and_advance
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.conclusion import isolated_surface
from beaver_ftc.diagnosis.model_prediction import evaluate_design, move_surfaces
from beaver_ftc.loop.frame import accommodate, advance_clock, evaluate_elapsed, isolated_theta, start_clock
from beaver_ftc.plant.instruments import take_sample


@kernel
def take(frames, x, y, command, attitude):
    """Take a sample, and see what the design model makes of the elapsed frame.

    x (3,) rad/s; y signals; command (surfaces,) rad, what has been commanded since the sample before;
    attitude (3,) rad. Returns whether all of it is finite; if not, nothing is taken.
    """
    if not (finite(x) and finite(y) and finite(command) and finite(attitude)):
        return False
    frame = frames[0]
    prediction, measured = frame.prediction, frame.measured
    start_clock(frame)
    if frame.k > 0:
        move_surfaces(prediction, command)
    take_sample(measured, x, y, attitude)
    evaluate_design(prediction, measured)
    evaluate_elapsed(frame)
    return True


@kernel
def finite(values):
    """Whether every one of values (n,) is a finite number."""
    sound = True
    for i in range(values.size):
        sound = sound and np.isfinite(values[i])
    return sound


@kernel
def accommodate_and_advance(frames):
    """Give the estimated state of the surfaces to the next prediction, and advance the clock."""
    frame = frames[0]
    accommodate(frame)
    advance_clock(frame)


@kernel
def theta(frames):
    """The estimate of the isolated loss of effectiveness, of the published class."""
    fdi = frames[0].fdi
    return isolated_theta(fdi, isolated_surface(fdi.verdict, fdi.isolation.estimator))
