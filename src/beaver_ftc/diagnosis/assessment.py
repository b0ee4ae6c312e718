"""The assessment: effectiveness, offset and lag of each surface, by whichever stage estimates them.

It is the output of the diagnosis that the laws read. No other file writes it.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.conclusion import is_unknown, isolated_surface
from beaver_ftc.diagnosis.detection import fdae, statistical
from beaver_ftc.diagnosis.state import NOT_ISOLATED, PITCH, WORST_CASE
from beaver_ftc.diagnosis.types import verdict
from beaver_ftc.diagnosis.types.contract import FIXED, LAGS, LOSES, SHIFTED
from beaver_ftc.diagnosis.types.observation import middle_error

SURE = 400.0  # one over the variance of an effectiveness known to 0.05, which need not be eased in


@sized
def assessment_dtype(n: int) -> np.dtype:
    """The assessment of n surfaces.

    detected: a fault; unknown: no surface is isolated or leads; named: the isolated surface, -1 for none.
    surface_lags: a surface follows its command late. measure: accommodation mode of each, -1 where open,
    or where faults of every type are not diagnosed; effectiveness; at_once: whether the law applies it at
    once, not gradually; offset, lag rad. unknown_acceleration (3,) rad/s2: explained by no known fault.
    pitch_is_open: elevator or flap is at fault, and it has long been open which.
    """
    return record(
        detected=int, unknown=int, every_type=int, named=int, surface_lags=int, measure=(int, n),
        effectiveness=n, at_once=(int, n), offset=n, lag=n, unknown_acceleration=3, pitch_is_open=int,
    )  # fmt: skip


@kernel
def assess(assessment, config, conclusion, types, layout, estimators, statistics):
    """Bring the assessment to this frame, by the stages' outputs; statistics: of `statistical_dtype`."""
    every_type, named = config.every_type, isolated_surface(conclusion, estimators)
    assessment.detected, assessment.every_type = conclusion.detected, every_type
    assessment.named, assessment.surface_lags, assessment.unknown = named, 0, is_unknown(conclusion)
    for s in range(assessment.measure.size):
        assessment.measure[s] = types.surface[s].accommodation.mode if every_type else -1
        assessment.effectiveness[s], assessment.at_once[s] = 1.0, 0
        assessment.offset[s], assessment.lag[s] = 0.0, 0.0
        if conclusion.estimates and conclusion.detected:
            assessment.effectiveness[s] = conclusion.effectiveness[s]
        elif assessment.measure[s] >= 0:
            assess_type(assessment, types, layout, estimators, s)
        elif s == named and not every_type:
            likely = likelihood_counts(statistics.tests, config.authority)
            sure = likely and statistical.estimated_loss(statistics.block, s)[1] > SURE
            theta = isolated_theta(config, conclusion, layout, estimators, statistics, s)
            assessment.effectiveness[s], assessment.at_once[s] = 1.0 + theta, sure


@kernel
def assess_type(assessment, types, layout, estimators, s):
    """Fill the assessment of surface s, at fault by the diagnosis of every type."""
    surface = types.surface[s]
    at_fault, mode = verdict.possible(surface), surface.accommodation.mode
    if mode == LOSES:
        assessment.effectiveness[s] = verdict.effectiveness_left(types, layout, estimators, s)
    elif mode == FIXED:
        assessment.effectiveness[s], assessment.at_once[s] = 0.0, 1
        assessment.offset[s] = surface.elapsed.command + verdict.deflection_error(surface, at_fault)
    elif mode == SHIFTED:
        assessment.offset[s] = verdict.deflection_error(surface, at_fault)
    elif mode == LAGS:
        assessment.lag[s] = middle_error(surface)
        assessment.surface_lags = 1


@kernel
def isolated_theta(config, conclusion, layout, estimators, statistics, s):
    """Estimated theta of the isolated loss of surface s: under noise, the most likely one."""
    if likelihood_counts(statistics.tests, config.authority):
        return statistical.estimated_loss(statistics.block, s)[0]
    return estimators[conclusion.isolated].theta[layout.dominant_axis[s]]


@kernel
def likelihood_counts(tests, authority):
    """Whether the estimates of the statistical detector are used."""
    return tests.enabled and authority != WORST_CASE


@kernel
def assess_unknown(assessment, config, conclusion, types, layout, statistics, detector, bound):
    """Fill unknown_acceleration and pitch_is_open; detector: the FDAE's record; bound: what is declared.

    No acceleration is asked for what a slow surface lags: it would only wind the command up.
    """
    unknown, every_type = assessment.unknown_acceleration, config.every_type
    unknown[:] = 0.0
    lags = conclusion.lead >= 0 and conclusion.lead_kind == LAGS
    if conclusion.detected and not lags and likelihood_counts(statistics.tests, config.authority):
        statistical.unknown_acceleration(statistics.block, statistics.air, unknown)
    elif conclusion.detected and not lags:
        fdae.unknown_acceleration(detector, bound.noise, unknown)
    is_not_excluded = every_type and conclusion.detected and conclusion.isolated == NOT_ISOLATED
    long = types.surface[layout.main[PITCH]].evidence.frames >= types.config.patience
    assessment.pitch_is_open = is_not_excluded and long
