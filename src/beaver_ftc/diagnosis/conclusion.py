"""The conclusion about the surfaces: alarm, surface and type of the fault, and the surface the law acts upon.

The stages of the diagnosis return their findings: a detector the axis of its alarm, the isolation the
estimator that is left, the fault types a surface with its type, a monitor whether the cause is no surface.
The frame (loop/frame.py) hands each of them to a kernel of this file, and no other file writes the
conclusion.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.state import NOT_ISOLATED

MAX_WITHDRAWN = 16

# A name that was withdrawn: the surface, named from when to when, s.
WITHDRAWN = record(surface=int, from_s=float, to_s=float)


@sized
def conclusion_dtype(n: int) -> np.dtype:
    """The conclusion about n surfaces. isolated: an estimator, NOT_ISOLATED or UNANTICIPATED. type: of the
    isolated fault, -1 if open. lead, lead_kind: the surface the law acts upon, and its accommodation mode.
    effectiveness: of every surface, where a plug-in `estimates` it. named_from_s: since when each surface is
    named, -1 if it is not; withdrawn: what was named before."""
    return record(
        detected=int, detected_at_s=float, detected_axis=int, isolated=int, isolated_at_s=float, type=int,
        type_at_s=float, lead=int, lead_kind=int, estimates=int, effectiveness=n, named_from_s=n,
        n_withdrawn=int, withdrawn=(WITHDRAWN, MAX_WITHDRAWN),
    )  # fmt: skip


def configure(conclusion: np.void) -> None:
    """Fill the record of a diagnosis that has concluded nothing."""
    conclusion["detected_at_s"] = conclusion["isolated_at_s"] = -1.0
    conclusion["isolated"], conclusion["named_from_s"] = NOT_ISOLATED, -1.0
    conclusion["type"] = conclusion["lead"] = conclusion["lead_kind"] = conclusion["type_at_s"] = -1


@kernel
def latch_alarm(conclusion, axis, t):
    """Latch an alarm at t s that showed on an axis, -1 for one of no axis: the first alarm counts."""
    if not conclusion.detected:
        conclusion.detected, conclusion.detected_at_s, conclusion.detected_axis = 1, t, axis


@kernel
def note_isolated(conclusion, isolated, t):
    """Replace the isolated fault, and at t s its instant if it is another one."""
    if isolated != conclusion.isolated:
        conclusion.isolated, conclusion.isolated_at_s = isolated, t


@kernel
def note_type(conclusion, finding):
    """Replace fault, type and lead by the finding of the fault types.

    finding: (isolated, isolated_at_s, type, type_at_s, lead, lead_kind).
    """
    conclusion.isolated, conclusion.isolated_at_s = finding[0], finding[1]
    conclusion.type, conclusion.type_at_s = finding[2], finding[3]
    conclusion.lead, conclusion.lead_kind = finding[4], finding[5]


@kernel
def note_plugin(conclusion, given, t):
    """Replace the built-in conclusion by the verdict of a plug-in, `given` (`verdict_dtype`), at t s."""
    if given.detected:
        latch_alarm(conclusion, given.axis, t)
    note_isolated(conclusion, given.isolated if conclusion.detected else NOT_ISOLATED, t)
    conclusion.estimates = given.estimates
    conclusion.effectiveness[:] = given.effectiveness


@kernel
def void(conclusion):
    """Discard the conclusion: a sensor is broken, not a surface."""
    conclusion.detected, conclusion.isolated, conclusion.type = 0, NOT_ISOLATED, -1
    conclusion.detected_at_s = conclusion.isolated_at_s = -1.0
    conclusion.lead = conclusion.lead_kind = -1


@kernel
def note_name(conclusion, s, named, t):
    """Note at t s whether surface s is named, and keep a withdrawn name; once the room for them is used up
    the latest takes the last place."""
    since = conclusion.named_from_s[s]
    if named and since < 0.0:
        conclusion.named_from_s[s] = t
    elif since >= 0.0 and not named:
        gone = conclusion.withdrawn[min(conclusion.n_withdrawn, MAX_WITHDRAWN - 1)]
        gone.surface, gone.from_s, gone.to_s = s, since, t
        conclusion.n_withdrawn += 1
        conclusion.named_from_s[s] = -1.0


@kernel
def isolated_surface(conclusion, estimators):
    """The surface of the isolated fault, or -1."""
    return estimators[conclusion.isolated].surface if conclusion.isolated >= 0 else -1


@kernel
def is_unknown(conclusion):
    """Whether the cause is open: no surface is isolated or leads, and no plug-in estimates effectiveness."""
    return conclusion.isolated < 0 and conclusion.lead < 0 and not conclusion.estimates
