"""The conclusion about the surfaces: the alarm, surface and type of the fault, and the surface on which the
law acts.

The stages of the diagnosis return their findings. The schemes (schemes/), and for the sensor monitor
loop/frame.py, hand each of them to a kernel of this file, which alone writes the conclusion:

    a detector        the axis of its alarm
    the isolation     the only remaining estimator
    the fault types   a surface with its type
    a monitor         that the cause is no surface
    a plug-in         its verdict

What the laws read of each surface: assessment.py. Symbols: fies, j: isolation estimators, and the number of
one; s: surface; t: time, s.
"""

import numpy as np

from beaver_ftc.compiled import copy, fill, kernel, record, sized

NOT_ISOLATED, UNANTICIPATED = -1, -2  # in place of an estimator: no fault isolated; one outside the class
MAX_WITHDRAWN = 16

# Why an isolation is withdrawn: an estimator refutes the surface; all types on it, or all of the named type,
# are excluded; a sensor is found broken; a plug-in decides so; or for none of these reasons, if another
# surface has become possible too.
SURFACE_REFUTED, TYPES_REFUTED, SENSOR_BROKEN, PLUGIN_DECIDES, SEVERAL_POSSIBLE = range(5)

# An isolation that was withdrawn, or the type of one: surface; type, -1 if open; its beginning and end, s.
WITHDRAWN_RECORD = record(surface=int, fault_type=int, from_s=float, to_s=float, reason=int)


@sized
def plugin_verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED; axis: on which it has an
    alarm; theta: its estimate of the fault parameter; effectiveness (n,): of each surface, of use only if
    has_effectiveness."""
    return record(detected=int, axis=int, isolated=int, theta=float, has_effectiveness=int, effectiveness=n)


@sized
def conclusion_dtype(n: int) -> np.dtype:
    """The conclusion about n surfaces; times in s.

    The fault:
    detected, detected_at_s, axis: whether there is an alarm, since when, on which axis
    isolated_estimator: estimator of the isolated fault, NOT_ISOLATED or UNANTICIPATED
    isolated_at_s: since when
    fault_type, typed_at_s: number of its type, -1 if open, and since when
    target, accommodation_mode: the surface on which the law acts, and how; -1 for none
    has_effectiveness, effectiveness (n,): of every surface, if a plug-in estimates it

    Each surface (n,):
    from_s: since when the surface is isolated, -1 if it is not
    isolated_type, type_from_s: its type, -1 if open, and since when. Types of one name have one number here,
    that of the first (SAME_NAME of types/registry.py).

    Isolations that were withdrawn, the first ones and the last, and how many there were:
    gone, n_gone: surfaces
    withdrawn_types, n_gone_types: types of surfaces that stayed isolated
    """
    return record(
        detected=int, detected_at_s=float, axis=int, isolated_estimator=int, isolated_at_s=float,
        fault_type=int, typed_at_s=float, target=int, accommodation_mode=int, has_effectiveness=int,
        effectiveness=n, from_s=n, isolated_type=(int, n), type_from_s=n, n_gone=int, n_gone_types=int,
        gone=(WITHDRAWN_RECORD, MAX_WITHDRAWN), withdrawn_types=(WITHDRAWN_RECORD, MAX_WITHDRAWN),
    )  # fmt: skip


def reset_conclusion(conclusion: np.void) -> None:
    """Fill the conclusion of a diagnosis that has found nothing yet."""
    fill(
        conclusion, detected_at_s=-1.0, isolated_estimator=NOT_ISOLATED, isolated_at_s=-1.0, fault_type=-1,
        typed_at_s=-1.0, target=-1, accommodation_mode=-1, from_s=-1.0, isolated_type=-1, type_from_s=-1.0,
    )  # fmt: skip


@kernel
def latch_alarm(conclusion, axis, t):
    """Latch an alarm at t s on an axis. Only the first alarm is recorded."""
    if not conclusion.detected:
        conclusion.detected = 1
        conclusion.detected_at_s = t
        conclusion.axis = axis


@kernel
def set_isolated(conclusion, j, t):
    """Replace the isolated fault by that of estimator j, or by NOT_ISOLATED or UNANTICIPATED; if this is a
    change, the time of isolation becomes t s."""
    if j != conclusion.isolated_estimator:
        conclusion.isolated_estimator = j
        conclusion.isolated_at_s = t


@kernel
def record_decision(conclusion, finding, lead):
    """Replace isolated fault, type and accommodation by those that the fault types found.

    finding: (isolated, isolated_at_s, type, type_at_s); lead: (target, accommodation_mode).
    """
    conclusion.isolated_estimator, conclusion.isolated_at_s, conclusion.fault_type, conclusion.typed_at_s = (
        finding
    )
    conclusion.target, conclusion.accommodation_mode = lead


@kernel
def record_plugin_verdict(conclusion, plugin, t):
    """Take alarm, isolated fault and effectiveness at t s from the verdict of a plug-in; an alarm stays."""
    if plugin.detected:
        latch_alarm(conclusion, plugin.axis, t)
    set_isolated(conclusion, plugin.isolated if conclusion.detected else NOT_ISOLATED, t)
    conclusion.has_effectiveness = plugin.has_effectiveness
    copy(plugin.effectiveness, conclusion.effectiveness)


@kernel
def withdraw_conclusion(conclusion):
    """Withdraw alarm, isolation and type, because a sensor is broken and no surface.

    Times of isolation of single surfaces stay: `update_interval` ends them and stores what is withdrawn. The
    axis and the time of the type count only with an alarm and a type, and has_effectiveness is a plug-in's,
    which has no sensor monitor.
    """
    conclusion.detected = 0
    conclusion.isolated_estimator = NOT_ISOLATED
    conclusion.fault_type = -1
    conclusion.detected_at_s = conclusion.isolated_at_s = -1.0
    conclusion.target = conclusion.accommodation_mode = -1


@kernel
def update_interval(conclusion, s, isolated, t, kind, reason):
    """Record at t s whether surface s is isolated, and its type `kind` (-1 if open). If the isolation ends
    with this frame, store it with the reason; if it continues and its type ends or changes, store the type
    that it had.
    """
    since = conclusion.from_s[s]
    type_since = conclusion.type_from_s[s]
    old_type = conclusion.isolated_type[s]
    if isolated and since < 0.0:
        conclusion.from_s[s] = t
    elif since >= 0.0 and not isolated:
        n = conclusion.n_gone
        conclusion.n_gone = store_withdrawn(conclusion.gone, n, s, old_type, since, t, reason)
        conclusion.from_s[s] = -1.0
    elif old_type >= 0 and kind != old_type:
        n = conclusion.n_gone_types
        types = conclusion.withdrawn_types
        conclusion.n_gone_types = store_withdrawn(types, n, s, old_type, type_since, t, reason)
    kind = kind if isolated else -1
    if kind != old_type:
        conclusion.isolated_type[s] = kind
        conclusion.type_from_s[s] = t


@kernel
def store_withdrawn(store, n, s, kind, from_s, to_s, reason):
    """Fill the next record of a store (MAX_WITHDRAWN,) in which n records are filled, or its last record if
    it is full; return the number of withdrawals so far, n + 1."""
    entry = store[min(n, MAX_WITHDRAWN - 1)]
    entry.surface = s
    entry.fault_type = kind
    entry.reason = reason
    entry.from_s = from_s
    entry.to_s = to_s
    return n + 1


@kernel
def isolated_surface(conclusion, fies):
    """The surface of the isolated fault, or -1."""
    return fies[conclusion.isolated_estimator].surface if conclusion.isolated_estimator >= 0 else -1
