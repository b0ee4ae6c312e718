"""The assessment of each surface, which the laws read: effectiveness, offset and lag, by the stage that
estimates them.

It is the output of the diagnosis (`out`), and only this file writes it.

    cfg           SHARED_CONFIG_RECORD
    conclusion    record of `conclusion_dtype`
    types         record of `fault_types_dtype`; surf: that of one surface
    fies          isolation estimators; layout: their numbers, by surface
    s             surface
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, isolated_surface
from beaver_ftc.diagnosis.config import WORST_CASE_DETECTOR
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.fdae import fdae_unmodelled
from beaver_ftc.diagnosis.types import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    modes,
    remaining,
    verdict,
)
from beaver_ftc.diagnosis.types.observations import last_error

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
    all_types = cfg.diagnoses_all_types
    j = conclusion.isolated_estimator
    at_fault = isolated_surface(conclusion, fies)
    out.held = out.lags = 0
    out.detected = conclusion.detected
    out.diagnoses_all_types = all_types
    out.isolated_surface = at_fault
    out.no_target = j < 0 and conclusion.target < 0 and not conclusion.has_effectiveness
    for s in range(out.accommodation_mode.size):
        out.accommodation_mode[s] = types.surface[s].accommodation.mode if all_types else -1
        out.effectiveness[s] = 1.0
        out.at_once[s] = 0
        out.offset[s] = out.lag[s] = 0.0
        if conclusion.has_effectiveness and conclusion.detected:
            out.effectiveness[s] = conclusion.effectiveness[s]
        elif out.accommodation_mode[s] >= 0:
            assess_surface(out, types, layout, fies, s)
        elif s == at_fault and not all_types:
            theta, information = isolated_theta(cfg, conclusion, layout, fies, stat, s)
            out.effectiveness[s] = 1.0 + theta
            out.at_once[s] = information > MIN_INFORMATION


@kernel
def hold_assessment(out, types):
    """Keep the assessment from before a sensor broke: effectiveness, and offsets of constant faults and of
    surfaces that are given up.

    Lags, and offsets that vary from frame to frame, cannot be estimated without the sensor, and become zero.
    """
    out.held = 1
    out.lags = 0
    out.lag[:] = 0.0
    for s, surf in enumerate(types.surface):
        if out.accommodation_mode[s] != GIVE_UP and not remaining.constant_remains(surf):
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
        out.effectiveness[s] = 0.0
        out.at_once[s] = 1
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
