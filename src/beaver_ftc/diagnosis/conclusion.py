"""The conclusion about the surfaces, and the assessment of each surface that the laws read.

*Conclusion*: the alarm, surface and type of the fault, and the surface on which the law acts. The
stages of the diagnosis return their findings, and the schemes (schemes/) hand each of them to a kernel of
this file, which alone writes the conclusion:

    a detector        the axis of its alarm
    the isolation     the only remaining estimator
    the fault types   a surface with its type
    a monitor         that the cause is no surface

*Assessment* (`out`): effectiveness, offset and lag of each surface, by the stage that estimates them. It is
the output of the diagnosis, and only this file writes it.

    cfg           SHARED_CONFIG_RECORD
    types         record of `fault_types_dtype`; surf: that of one surface
    fies          isolation estimators; layout: their numbers, by surface
    s, t          surface; time, s
"""

import numpy as np

from beaver_ftc.compiled import copy, fill, kernel, record, sized
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.fdae import fdae_unmodelled
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, WORST_CASE_DETECTOR
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    last_error,
    modes,
    verdict,
)

MAX_WITHDRAWN = 16

# Why an isolation is withdrawn: an estimator refutes the surface; all types on it, or all of the named type,
# are excluded; a sensor is found broken; a plug-in decides so; or for none of these reasons, if another
# surface has become possible too.
SURFACE_REFUTED, TYPES_REFUTED, SENSOR_BROKEN, PLUGIN_DECIDES, SEVERAL_POSSIBLE = range(5)

# An isolation that was withdrawn, or the type of one: surface; type, -1 if open; its beginning and end, s.
WITHDRAWN_RECORD = record(surface=int, fault_type=int, from_s=float, to_s=float, reason=int)


@sized
def conclusion_dtype(n: int) -> np.dtype:
    """The conclusion about n surfaces; times in s.

    The fault:
    detected, detected_at_s, axis: whether there is an alarm, since when, on which axis
    isolated_estimator, isolated_at_s: estimator of the isolated fault, NOT_ISOLATED or UNANTICIPATED
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
        conclusion.detected, conclusion.detected_at_s, conclusion.axis = 1, t, axis


@kernel
def set_isolated(conclusion, j, t):
    """Replace the isolated fault by that of estimator j, or by NOT_ISOLATED or UNANTICIPATED; if this is a
    change, the time of isolation becomes t s."""
    if j != conclusion.isolated_estimator:
        conclusion.isolated_estimator, conclusion.isolated_at_s = j, t


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
    """Replace the built-in conclusion at t s by the verdict of a plug-in."""
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
    conclusion.detected, conclusion.isolated_estimator, conclusion.fault_type = 0, NOT_ISOLATED, -1
    conclusion.detected_at_s = conclusion.isolated_at_s = -1.0
    conclusion.target = conclusion.accommodation_mode = -1


@kernel
def update_interval(conclusion, s, isolated, t, kind, reason):
    """Record at t s whether surface s is isolated, and its type `kind` (-1 if open). If the isolation ends
    with this frame, store it with the reason; if it continues and its type ends or changes, store the type
    that it had.
    """
    isolated_since, old_type = conclusion.from_s[s], conclusion.isolated_type[s]
    if isolated and isolated_since < 0.0:
        conclusion.from_s[s] = t
    elif isolated_since >= 0.0 and not isolated:
        conclusion.n_gone = store_withdrawn(
            conclusion.gone, conclusion.n_gone, s, old_type, isolated_since, t, reason
        )
        conclusion.from_s[s] = -1.0
    elif old_type >= 0 and kind != old_type:
        conclusion.n_gone_types = store_withdrawn(
            conclusion.withdrawn_types,
            conclusion.n_gone_types,
            s,
            old_type,
            conclusion.type_from_s[s],
            t,
            reason,
        )
    kind = kind if isolated else -1
    if kind != old_type:
        conclusion.isolated_type[s], conclusion.type_from_s[s] = kind, t


@kernel
def store_withdrawn(store, n, s, kind, from_s, to_s, reason):
    """Fill the next record of a store (MAX_WITHDRAWN,) in which n records are filled, or its last record if
    it is full; return the number of withdrawals so far, n + 1."""
    entry = store[min(n, MAX_WITHDRAWN - 1)]
    entry.surface, entry.fault_type, entry.reason = s, kind, reason
    entry.from_s, entry.to_s = from_s, to_s
    return n + 1


@kernel
def isolated_surface(conclusion, fies):
    """The surface of the isolated fault, or -1."""
    return fies[conclusion.isolated_estimator].surface if conclusion.isolated_estimator >= 0 else -1


# 1 / variance of an effectiveness with a standard deviation of 0.05: precise enough to be applied at once
MIN_INFORMATION = 400.0


@sized
def assessment_dtype(n: int) -> np.dtype:
    """The assessment of n surfaces.

    detected                  whether there is an alarm
    no_target                 whether the law acts on no surface; true without a fault as well
    diagnoses_all_types       whether faults of every type are diagnosed
    isolated_surface          -1 for none
    lags                      whether a surface follows its command late
    accommodation_mode (n,)   -1 if the law does not act on the surface, or if only losses are diagnosed
    effectiveness (n,)        0 to 1
    at_once (n,)              whether the law applies the effectiveness at once, not gradually
    offset, lag (n,)          rad
    unknown_acceleration (3,) rad/s2, explained by no known fault
    pitch_undecided           whether the main surface of pitch may be at fault, and this has long been open
    held                      whether the surfaces are assessed as before a sensor broke
    """
    return record(
        detected=int, no_target=int, diagnoses_all_types=int, isolated_surface=int, lags=int,
        accommodation_mode=(int, n), effectiveness=n, at_once=(int, n), offset=n, lag=n,
        unknown_acceleration=3, pitch_undecided=int, held=int,
    )  # fmt: skip


@kernel
def assess_surfaces(out, cfg, conclusion, types, layout, fies, stat):
    """Fill the assessment of this frame from the outputs of the stages; stat: of `statistical_dtype`. The
    effectiveness of a surface, and what goes with it, comes from the first source that applies:

        a plug-in estimates effectiveness, after its alarm     the plug-in
        the fault types have set a mode for the surface        `assess_surface`
        only losses are diagnosed, and its loss is isolated    `isolated_theta`
        otherwise                                              1, no offset, no lag

    The law has no target if no surface is isolated or accommodated, and no plug-in estimates effectiveness.
    """
    all_types, j = cfg.diagnoses_all_types, conclusion.isolated_estimator
    at_fault = isolated_surface(conclusion, fies)
    out.held = out.lags = 0
    out.detected, out.diagnoses_all_types, out.isolated_surface = conclusion.detected, all_types, at_fault
    out.no_target = j < 0 and conclusion.target < 0 and not conclusion.has_effectiveness
    for s in range(out.accommodation_mode.size):
        out.accommodation_mode[s] = types.surface[s].accommodation.mode if all_types else -1
        out.effectiveness[s], out.at_once[s] = 1.0, 0
        out.offset[s] = out.lag[s] = 0.0
        if conclusion.has_effectiveness and conclusion.detected:
            out.effectiveness[s] = conclusion.effectiveness[s]
        elif out.accommodation_mode[s] >= 0:
            assess_surface(out, types, layout, fies, s)
        elif s == at_fault and not all_types:
            theta, information = isolated_theta(cfg, conclusion, layout, fies, stat, s)
            out.effectiveness[s], out.at_once[s] = 1.0 + theta, information > MIN_INFORMATION


@kernel
def hold_assessment(out, types):
    """Keep the assessment from before a sensor broke: effectiveness, and offsets of constant faults and of
    surfaces that are given up.

    Lags, and offsets that vary from frame to frame, cannot be estimated without the sensor, and become zero.
    """
    out.held, out.lags, out.lag[:] = 1, 0, 0.0
    for s, surf in enumerate(types.surface):
        if out.accommodation_mode[s] != GIVE_UP and not verdict.constant_remains(surf):
            out.offset[s] = 0.0


@kernel
def assess_surface(out, types, layout, fies, s):
    """Fill the assessment of surface s by its mode of accommodation (types/modes.py):

    SCALE_COMMAND       effectiveness
    GIVE_UP             effectiveness 0 at once; offset: its deflection, rad
    SUBTRACT_OFFSET     offset: its deflection error, rad
    WAIT_FOR_SURFACE    lag: its deflection error in the last frame, rad; lags: 1
    """
    surf = types.surface[s]
    possible = verdict.can_be_faulty(surf)
    mode = surf.accommodation.mode
    if mode == SCALE_COMMAND:
        out.effectiveness[s] = modes.remaining_effectiveness(types, layout, fies, s)
    elif mode == GIVE_UP:
        out.effectiveness[s], out.at_once[s] = 0.0, 1
        out.offset[s] = surf.last.u + modes.deflection_error(surf, possible)
    elif mode == SUBTRACT_OFFSET:
        out.offset[s] = modes.deflection_error(surf, possible)
    elif mode == WAIT_FOR_SURFACE:
        out.lag[s] = last_error(surf)
        out.lags = 1


@kernel
def isolated_theta(cfg, conclusion, layout, fies, stat, s):
    """The estimated theta of the isolated loss of surface s, and its information, 1 / variance.

    The statistical detector gives the most likely theta. If its estimates are not used, theta is that of the
    isolation estimator. Its uncertainty is bounded and not random, so its information counts as 0.
    """
    if weighs_statistics(stat, cfg.authority):
        return statistical.estimate_loss(stat.block, s)
    return fies[conclusion.isolated_estimator].theta[layout.dominant_axis[s]], 0.0


@kernel
def weighs_statistics(stat, authority):
    """Whether the estimates of the statistical detector are used; stat: of `statistical_dtype`."""
    return stat.test.enabled and authority != WORST_CASE_DETECTOR


@kernel
def assess_unknown(out, cfg, conclusion, types, layout, stat, fdae, bound):
    """Fill unknown_acceleration, 0 before the alarm, and pitch_undecided; fdae: of `FDAE_RECORD`; bound: what
    is declared.

    While the law waits for a slow surface, the unknown acceleration is 0: to compensate the lag would wind up
    the command. pitch_undecided: half a cycle of anomalous frames (half_frames) is a long time.
    """
    unknown = out.unknown_acceleration
    unknown[:] = 0.0
    if conclusion.detected and not (
        conclusion.target >= 0 and conclusion.accommodation_mode == WAIT_FOR_SURFACE
    ):
        if weighs_statistics(stat, cfg.authority):
            statistical.fill_unmodelled(stat.block, stat.gust, unknown)
        else:
            fdae_unmodelled(fdae, bound.n_gyro, unknown)
    main = types.surface[layout.main[PITCH]]
    waited = main.evidence.n_anomalous >= types.config.half_frames and verdict.can_be_faulty(main)
    not_isolated = conclusion.detected and conclusion.isolated_estimator == NOT_ISOLATED
    out.pitch_undecided = cfg.diagnoses_all_types and not_isolated and waited
