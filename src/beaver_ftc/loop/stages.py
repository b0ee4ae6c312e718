"""The compiled frame in stages, for flights in which a plug-in diagnoses or commands between them.

    sense -> diagnose | heed -> decide_mode -> command | obey -> close          (left: built in, right: a
    plug-in)

`frame.fly_frame` is the same in one call.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import guarantee, network
from beaver_ftc.diagnosis.state import NOT_ISOLATED, STATISTICS, WORST_CASE
from beaver_ftc.loop.frame import (
    NOT_FINITE,
    accommodate,
    begin,
    command,
    conclude,
    finish,
    look_back,
    predict,
    remember,
    supervise,
)

# A plug-in's verdict as the frame record understands it. isolated: a surface, NOT_ISOLATED or UNANTICIPATED.
TOLD = np.dtype(
    [
        ("detected", "i8"), ("axis", "i8"), ("isolated", "i8"), ("theta", "f8"),
        ("estimates", "i8"), ("effectiveness", "f8", (4,)),
    ],
    align=True,
)  # fmt: skip


@kernel
def sense(frames):
    """Measure, and see what the design model makes of the elapsed frame. Returns the flight's status."""
    frame = frames[0]
    status = begin(frame)
    if status != NOT_FINITE:
        look_back(frame)
    return status


@kernel
def diagnose(frames):
    """The built-in diagnosis."""
    conclude(frames[0])
    remember(frames[0])


@kernel
def heed(frames, told):
    """Bring the estimator that serves the laws up to date, and take a plug-in's verdict (told, (1,) TOLD)."""
    frame, verdict = frames[0], told[0]
    fdi = frame.fdi
    if frame.k > 0:
        predict(frame)
    guarantee.judge(fdi, frame.t)
    for i in range(3):
        fdi.residual[i] = frame.x[i] - fdi.xhat[i]
    note(frame, verdict)
    if fdi.detected:
        network.evaluate(fdi.network, frame.y[ALPHA], frame.y[BETA])
    remember(frame)


@kernel
def note(frame, verdict):
    """Write a plug-in's verdict where the built-in one stands."""
    fdi = frame.fdi
    if verdict.detected and not fdi.detected:
        fdi.detected, fdi.detected_at_s, fdi.detected_axis = 1, frame.t, verdict.axis
    isolated = verdict.isolated if fdi.detected else NOT_ISOLATED
    if isolated != fdi.isolated:
        fdi.isolated, fdi.isolated_at_s = isolated, frame.t
    if isolated >= 0:
        fdi.estimator[isolated].theta[:] = verdict.theta
    fdi.estimates = verdict.estimates
    fdi.effectiveness[:] = verdict.effectiveness


@kernel
def built_in_statistic(frames):
    """The largest share of its threshold that the built-in detection reaches at this frame.

    Of two detectors, the worst-case one counts beyond its bound only: it has no rate of false alarms that a
    lower level could trade for power.
    """
    fdi = frames[0].fdi
    chances = fdi.statistical.enabled and fdi.authority != WORST_CASE
    likely = fdi.statistical.score if chances else 0.0
    if fdi.authority == STATISTICS:
        return likely
    certain = largest_share(fdi)
    return max(likely, certain) if certain > 1.0 or not chances else likely


@kernel
def largest_share(fdi):
    """The largest share of its bound that a filter of the bank reaches."""
    largest = 0.0
    for m in range(fdi.n_poles):
        for i in range(3):
            if fdi.bank_threshold[m, i] > 0.0:
                largest = max(largest, abs(fdi.bank_residual[m, i]) / fdi.bank_threshold[m, i])
    return largest


@kernel
def decide_mode(frames):
    """Who is in charge."""
    supervise(frames[0])


@kernel
def act(frames, references):
    """The built-in law."""
    command(frames[0], references[frames[0].row])


@kernel
def obey(frames, deflections):
    """Take a plug-in's command (4,) rad, within the travel of each surface."""
    frame = frames[0]
    control = frame.control
    accommodate(frame)
    for s in range(4):
        limited = min(max(deflections[s], control.low[s]), control.high[s])
        control.saturated[s] = limited != deflections[s]
        control.command[s] = limited


@kernel
def close(frames, references, log):
    """Account, record, hand the command over."""
    frame = frames[0]
    finish(frame, references[frame.row], log[frame.row])
