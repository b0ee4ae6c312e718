"""The compiled diagnosis fed from outside: what is measured comes as arguments, nothing is read or written.

take -> stepping.diagnose -> accommodate_and_advance
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.conclusion import isolated_surface
from beaver_ftc.diagnosis.model_prediction import evaluate_design, move_surfaces
from beaver_ftc.loop.frame import accommodate, advance_clock, evaluate_elapsed, isolated_theta, start_clock
from beaver_ftc.plant.instruments import take_sample

MEMORY = 8 + 5 * 8  # of the verdict's words: `news`


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


@kernel
def news(frames, known):
    """Whether the verdict says anything else than when `known` was filled last, but for its estimate.

    known (MEMORY,) int64: what the words follow from; brought up to date.
    """
    fdi = frames[0].fdi
    changed = replace(known, 0, fdi.verdict.detected)
    if not fdi.verdict.detected:
        return changed
    changed |= replace(known, 1, fdi.verdict.axis) | replace(known, 2, fdi.verdict.isolated_estimator)
    excluded = 0
    for i in range(fdi.isolation.config.n_estimators):
        excluded = 2 * excluded + fdi.isolation.estimator[i].excluded
    changed |= replace(known, 3, excluded) | replace(known, 4, fdi.verdict.fault_type)
    if fdi.config.diagnoses_all_types:
        for plane in range(fdi.types.pair.group_alarm.size):
            changed |= replace(known, 5 + plane, fdi.types.pair.group_alarm[plane])
        for s in range(fdi.types.surface.size):
            changed |= news_of(fdi.types.surface[s], fdi.types.config.half_frames, known[8 + 5 * s :])
    return changed


@kernel
def news_of(surface, half_frames, known):
    """The same of one surface, where every type is asked for; known (5 and more,): its own."""
    bits = 0
    for kind in range(surface.sets.excluded.size):
        bits = 2 * bits + surface.sets.excluded[kind]
    early = surface.evidence.n_anomalous - surface.evidence.n_rest < half_frames
    changed = replace(known, 0, surface.status.is_isolated) | replace(known, 1, surface.status.basis)
    changed |= replace(known, 2, surface.status.fault_type) | replace(known, 3, bits)
    return changed | replace(known, 4, 1 if early else 0)


@kernel
def replace(known, i, value):
    """Put an integer into its place; whether another was there."""
    other = known[i] != value
    known[i] = value
    return other
