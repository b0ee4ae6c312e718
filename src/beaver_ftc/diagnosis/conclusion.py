"""The conclusion about the surfaces, and the assessment of each surface that the laws read.

The conclusion holds the alarm, surface and type of the fault, and the surface on which the law acts. The
stages of the diagnosis return their findings: a detector the axis of its alarm, the isolation the estimator
that is left, the fault types a surface with its type, a monitor whether the cause is no surface. The frame
(loop/frame.py) hands each of them to a kernel of this file, and no other file writes the conclusion.

The assessment holds effectiveness, offset and lag of each surface, by whichever stage estimates them. It is
the output of the diagnosis. No other file writes it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.detection import filters, statistical
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, WORST_CASE_DETECTOR
from beaver_ftc.diagnosis.types import verdict
from beaver_ftc.diagnosis.types.contract import (
    GIVE_UP,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    observed_error,
)

MAX_WITHDRAWN = 16

# A name that was withdrawn: the surface, named from when to when, s.
WITHDRAWN_NAME = record(surface=int, from_s=float, to_s=float)


@sized
def conclusion_dtype(n: int) -> np.dtype:
    """The conclusion about n surfaces. isolated: an estimator, NOT_ISOLATED or UNANTICIPATED. type: of the
    isolated fault, -1 if open. lead, lead_kind: the surface the law acts upon, and its accommodation mode.
    effectiveness: of every surface, where a plug-in `estimates` it. named_from_s: since when each surface is
    named, -1 if it is not; withdrawn: what was named before."""
    return record(
        detected=int, detected_at_s=float, detected_axis=int, isolated=int, isolated_at_s=float, type=int,
        type_at_s=float, lead=int, lead_kind=int, estimates=int, effectiveness=n, named_from_s=n,
        n_withdrawn=int, withdrawn=(WITHDRAWN_NAME, MAX_WITHDRAWN),
    )  # fmt: skip


def configure_conclusion(conclusion: np.void) -> None:
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
def record_isolated(conclusion, isolated, t):
    """Replace the isolated fault, and at t s its instant if it is another one."""
    if isolated != conclusion.isolated:
        conclusion.isolated, conclusion.isolated_at_s = isolated, t


@kernel
def record_finding(conclusion, finding):
    """Replace fault, type and lead by the finding of the fault types.

    finding: (isolated, isolated_at_s, type, type_at_s, lead, lead_kind).
    """
    conclusion.isolated, conclusion.isolated_at_s = finding[0], finding[1]
    conclusion.type, conclusion.type_at_s = finding[2], finding[3]
    conclusion.lead, conclusion.lead_kind = finding[4], finding[5]


@kernel
def record_plugin_verdict(conclusion, given, t):
    """Replace the built-in conclusion at t s by the verdict `given` of a plug-in."""
    if given.detected:
        latch_alarm(conclusion, given.axis, t)
    record_isolated(conclusion, given.isolated if conclusion.detected else NOT_ISOLATED, t)
    conclusion.estimates = given.estimates
    conclusion.effectiveness[:] = given.effectiveness


@kernel
def discard_conclusion(conclusion):
    """Discard the conclusion: a sensor is broken, not a surface."""
    conclusion.detected, conclusion.isolated, conclusion.type = 0, NOT_ISOLATED, -1
    conclusion.detected_at_s = conclusion.isolated_at_s = -1.0
    conclusion.lead = conclusion.lead_kind = -1


@kernel
def record_named(conclusion, s, named, t):
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
def cause_is_unknown(conclusion):
    """Whether the cause is open: no surface is isolated or leads, and no plug-in estimates effectiveness."""
    return conclusion.isolated < 0 and conclusion.lead < 0 and not conclusion.estimates


SURE_INFORMATION = (
    400.0  # one over the variance of an effectiveness known to 0.05, which need not be eased in
)


@sized
def assessment_dtype(n: int) -> np.dtype:
    """The assessment of n surfaces.

    detected: a fault; unknown: no surface is isolated or leads; named: the isolated surface, -1 for none.
    surface_lags: a surface follows its command late. accommodation_mode: of each surface, -1 where open, or
    where faults of every type are not diagnosed; effectiveness; apply_immediately: whether the law applies it
    at once, not gradually; offset, lag rad. unknown_acceleration (3,) rad/s2: explained by no known fault.
    pitch_undecided: elevator or flap is at fault, and it has long been open which.
    """
    return record(
        detected=int, unknown=int, every_type=int, named=int, surface_lags=int, accommodation_mode=(int, n),
        effectiveness=n, apply_immediately=(int, n), offset=n, lag=n, unknown_acceleration=3,
        pitch_undecided=int,
    )  # fmt: skip


@kernel
def assess_surfaces(assessment, config, conclusion, types, layout, estimators, statistics):
    """Bring the assessment to this frame, by the stages' outputs; statistics: of `statistical_dtype`."""
    every_type, named = config.every_type, isolated_surface(conclusion, estimators)
    assessment.detected, assessment.every_type = conclusion.detected, every_type
    assessment.named, assessment.surface_lags, assessment.unknown = named, 0, cause_is_unknown(conclusion)
    for s in range(assessment.accommodation_mode.size):
        assessment.accommodation_mode[s] = types.surface[s].accommodation.mode if every_type else -1
        assessment.effectiveness[s], assessment.apply_immediately[s] = 1.0, 0
        assessment.offset[s], assessment.lag[s] = 0.0, 0.0
        if conclusion.estimates and conclusion.detected:
            assessment.effectiveness[s] = conclusion.effectiveness[s]
        elif assessment.accommodation_mode[s] >= 0:
            assess_surface_at_fault(assessment, types, layout, estimators, s)
        elif s == named and not every_type:
            likely = uses_statistical_estimates(statistics.tests, config.authority)
            sure = likely and statistical.estimated_loss(statistics.block, s)[1] > SURE_INFORMATION
            theta = isolated_theta(config, conclusion, layout, estimators, statistics, s)
            assessment.effectiveness[s], assessment.apply_immediately[s] = 1.0 + theta, sure


@kernel
def assess_surface_at_fault(assessment, types, layout, estimators, s):
    """Fill the assessment of surface s, at fault by the diagnosis of every type."""
    surface = types.surface[s]
    at_fault, mode = verdict.can_be_at_fault(surface), surface.accommodation.mode
    if mode == SCALE_COMMAND:
        assessment.effectiveness[s] = verdict.effectiveness_left(types, layout, estimators, s)
    elif mode == GIVE_UP:
        assessment.effectiveness[s], assessment.apply_immediately[s] = 0.0, 1
        assessment.offset[s] = surface.elapsed.command + verdict.deflection_error(surface, at_fault)
    elif mode == SUBTRACT_OFFSET:
        assessment.offset[s] = verdict.deflection_error(surface, at_fault)
    elif mode == WAIT_FOR_SURFACE:
        assessment.lag[s] = observed_error(surface)
        assessment.surface_lags = 1


@kernel
def isolated_theta(config, conclusion, layout, estimators, statistics, s):
    """Estimated theta of the isolated loss of surface s: under noise, the most likely one."""
    if uses_statistical_estimates(statistics.tests, config.authority):
        return statistical.estimated_loss(statistics.block, s)[0]
    return estimators[conclusion.isolated].theta[layout.dominant_axis[s]]


@kernel
def uses_statistical_estimates(tests, authority):
    """Whether the estimates of the statistical detector are used."""
    return tests.enabled and authority != WORST_CASE_DETECTOR


@kernel
def assess_unknown_acceleration(assessment, config, conclusion, types, layout, statistics, detector, bound):
    """Fill unknown_acceleration and pitch_undecided; detector: the FDAE's record; bound: what is declared.

    No acceleration is asked for what a slow surface lags: it would only wind the command up.
    """
    unknown, every_type = assessment.unknown_acceleration, config.every_type
    unknown[:] = 0.0
    lags = conclusion.lead >= 0 and conclusion.lead_kind == WAIT_FOR_SURFACE
    if conclusion.detected and not lags and uses_statistical_estimates(statistics.tests, config.authority):
        statistical.statistical_unknown_acceleration(statistics.block, statistics.air, unknown)
    elif conclusion.detected and not lags:
        filters.fdae_unknown_acceleration(detector, bound.noise, unknown)
    is_not_excluded = every_type and conclusion.detected and conclusion.isolated == NOT_ISOLATED
    long = types.surface[layout.main[PITCH]].evidence.frames >= types.config.half_cycle_frames
    assessment.pitch_undecided = is_not_excluded and long
