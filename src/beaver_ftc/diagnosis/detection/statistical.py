"""The statistical detector: likelihood-ratio tests on the whitened innovation (likelihood.py, parity.py).

Pitch is one block; roll and yaw, whose noise is correlated, are another. Roll and yaw have two blocks with
different models of the drift. A random walk reacts fast and ignores constant errors. A drift that returns to
zero gathers evidence for longer. Pitch has only the latter if no vane measures its gust. The declared rate of
false alarms holds for the declared noise. The worst-case scheme needs no probability; the scenario's
`fdi.authority` sets whose alarms and exclusions count.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.model import AIRSPEED, N_SIGNALS, QDYN, evaluate, regressors
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.bounds import UNKNOWN_IN_FILTERS_RAD_S2, add_published_bound, further_map_error
from beaver_ftc.diagnosis.detection import likelihood, noise_model, parity
from beaver_ftc.diagnosis.detection.forces import MEASURED_FORCES
from beaver_ftc.diagnosis.detection.likelihood import (
    ENDING,
    GROWING,
    LATERAL,
    N_BLOCKS,
    N_READINGS,
    block_dtype,
)
from beaver_ftc.diagnosis.detection.parity import TONE_CONFIG, USUAL_SIZE, RecordSize, view_dtype
from beaver_ftc.diagnosis.gusts import GUST_RECORD
from beaver_ftc.diagnosis.state import DAMAGE_POSSIBLE, LOSS

# Least share of the best log-likelihood ratio that a constant theta explains of a loss growing at any rate
# (docs/theory.md, section 7).
MIN_CONSTANT_SHARE = 0.25
# The error of a model moves from one end of its bound to the other, by 2 bounds, no faster than a surface
# moves by this share of its travel.
REVERSAL_TRAVEL_SHARE = 0.25
PACE_PER_TRAVEL = 2.0 / REVERSAL_TRAVEL_SHARE
LEAST_TRAVEL_RAD = 1e-6

# Configuration of the tests.
TESTS = record(
    enabled=int,
    alarm_level=float, naming_level=float,  # standard deviations; difference of log-likelihood ratios
    keep=float,  # factor by which evidence decays per frame after the alarm
    n_log_columns=int,
    has_tolerances=int,  # whether unknown constants have tolerances
    share=float,  # one over the number of instants in a frame
    mapped=int,  # whether the model's error is mapped
)  # fmt: skip

# The noise model: accelerations that are not caused by a fault.
NOISE = record(
    walk_intensity=float,  # of the drift that represents a bounded uncertainty, over bound squared, 1/s
    pace=float,  # share of its bound by which the uncertainty changes in a frame if no surface moves
    bounded=3,  # bound on the uncertainty with healthy surfaces, now, rad/s2
    further_error=3,  # what one surface anywhere in its travel adds to it, rad/s2
    deflection=3,  # share of the bound by errors of the deflections, rad/s2
    jitter=3, own_jitter=3,  # variance by noise of all inputs of the model; without the air data; (rad/s2)2
    read=int, reading=N_READINGS,  # whether errors of the air data count; their noise, units of the readings
    terms=MAX_TERMS, direction=N_SIGNALS, slope=MAX_MONOMIALS, moved=3,  # scratch
)  # fmt: skip

# Output of the detector: largest score over the alarm level and its axis; the largest so far in healthy
# flight; time of the first alarm, s, or -1.
ALARM = record(score=float, axis=int, closest=float, detected_at_s=float)


@sized
def statistical_dtype(size: RecordSize = USUAL_SIZE) -> np.dtype:
    """The record of the detector, for an aircraft that needs these capacities."""
    return record(
        tests=TESTS, noise=NOISE, alarm=ALARM, block=(block_dtype(size.rates), N_BLOCKS),
        n_views=int, views=(view_dtype(size.view), size.views), tone_config=TONE_CONFIG,
        forces=MEASURED_FORCES, air=GUST_RECORD, inertial_air=GUST_RECORD,
    )  # fmt: skip


@kernel
def update_blocks(tests, bounded, blocks, air, innovation, dt, k, latched, ends=False):
    """Update the blocks with frame k, of dt s: innovation and bound `bounded`, both (3,) rad/s2.

    latched: the detector has raised its alarm; ends: a loss may end.
    """
    keep, slot = tests.keep if latched else 1.0, likelihood.slot_to_reset(k)
    for b, block in enumerate(blocks):
        if not latched:
            likelihood.reset_onset(block, slot)
        for i, axis in enumerate(block.axis[: block.n]):
            block.scratch[i] = innovation[axis] - air.output.mean[axis]
        block.has_coarse_gust = air.config.coarse
        if air.config.coarse:
            likelihood.set_gust_response(block, air.output.coarse_acceleration)
        if air.output.moving:
            add_turn_variance(air, block)
            if b < likelihood.LATERAL_RETURNING:
                likelihood.whiten_without_gust(block, dt)
            else:  # without gust both blocks of roll and yaw have the same filter
                block.no_gust_filter.innovation[:] = blocks[LATERAL].no_gust_filter.innovation
        memory = tests.keep if ends else 0.0
        likelihood.update_block(block, bounded, tests.has_tolerances, dt, keep, memory, tests.mapped)


@kernel
def add_turn_variance(air, block):
    """Add to the covariance of the drift what a fast turn of the gusts' axes may change in it."""
    for i in range(block.n):
        for j in range(block.n):
            block.P_dd[i, j] += block.drift_scale * air.output.turn_variance[block.axis[i], block.axis[j]]


@kernel
def track_residual_mean(blocks, air, innovation_after_known_faults, dt):
    """Filter the innovation after known faults (3,) rad/s2; the state tracks its slowly varying mean."""
    for block in blocks[: likelihood.LATERAL_RETURNING]:
        for i, axis in enumerate(block.axis[: block.n]):
            block.scratch[i] = innovation_after_known_faults[axis] - air.output.mean[axis]
        likelihood.whiten(block, block.residual_state, block.scratch, dt, block.scratch)


@kernel
def statistical_unknown_acceleration(blocks, air, out):
    """Fill out (3,) rad/s2 with the estimated acceleration that the control law's model lacks.

    It is the estimated drift plus the effect of the gust estimated from the vanes.
    """
    for block in blocks[: likelihood.LATERAL_RETURNING]:
        for i, axis in enumerate(block.axis[: block.n]):
            out[axis] = block.residual_state[2 + i] + air.output.acceleration[axis]


@kernel
def update_alarm(alarm, tests, blocks, views, forces, air, t, known=True):
    """Fill the largest score over the alarm level, its axis, and at the first alarm its time t s.

    The score is 0 where the model's error is not `known`.
    """
    alarm.score = 0.0
    if not known:
        return
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.raises_alarm:
                keep_largest_score(alarm, tests.alarm_level, hypothesis.score, hypothesis.axis)
    for view in views:
        keep_largest_score(
            alarm, tests.alarm_level, parity.alarm_score(view, views, tests, forces, air), view.axis
        )
    if alarm.score > 1.0 and alarm.detected_at_s < 0.0:
        alarm.detected_at_s = t


@kernel
def note_closest_approach(alarm):
    """Keep the largest score over the alarm level so far."""
    alarm.closest = max(alarm.closest, alarm.score)


@kernel
def keep_largest_score(alarm, level, score, axis):
    """Keep a score if it is the largest."""
    share = score / level
    if share > alarm.score:
        alarm.score, alarm.axis = share, axis


@kernel
def log_scores(tests, blocks, views, forces, air, row):
    """Write the last columns of a log row: scores over the alarm level, first of losses, then of steps.

    Scores of forces and of oscillations are in the column of the step on their axis.
    """
    first = row.size - tests.n_log_columns
    row[first:] = 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.raises_alarm:
                place = first + hypothesis.log_column
                row[place] = max(row[place], hypothesis.score / tests.alarm_level)
    for view in views:
        place = row.size - 3 + view.axis
        row[place] = max(row[place], parity.alarm_score(view, views, tests, forces, air) / tests.alarm_level)


@kernel
def is_not_excluded(estimators, loss_estimator, surface):
    """True if a loss of this surface has not been excluded."""
    return loss_estimator[surface] < 0 or not estimators[loss_estimator[surface]].excluded


@kernel
def best_alternative_llr(block, estimators, loss_estimator, surface, every=False):
    """The largest lower bound on the log-likelihood ratio of all alternatives to the loss of a surface.

    Excluded losses are no alternatives, unless `every`: as evidence decays, an uncertainty that correlates
    with the commands may support them again.
    """
    best = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.kind in (GROWING, ENDING):
            continue
        other = hypothesis.surface
        if hypothesis.kind != LOSS or (
            other != surface and (every or is_not_excluded(estimators, loss_estimator, other))
        ):
            best = max(best, hypothesis.min_llr)
    return best


@kernel
def max_llr(block, surface, ending):
    """Upper bound on the log-likelihood ratio of a loss of this surface, or, if `ending`, of its end.

    It is 0 if the block has no such hypothesis.
    """
    most = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.surface == surface and (hypothesis.kind == ENDING) == ending:
            most = max(most, hypothesis.max_llr)
    return most


@kernel
def confirms_loss(tests, blocks, estimators, loss_estimator, surface):
    """True if a loss of this surface explains the data better than all alternatives, by the naming level.

    estimators: of the isolation; loss_estimator (n,): that of each surface's loss, or -1. If the estimator
    is weakly excluded by DAMAGE_POSSIBLE, excluded losses are alternatives as well.
    """
    every = (
        loss_estimator[surface] >= 0
        and estimators[loss_estimator[surface]].weakly_excluded == DAMAGE_POSSIBLE
    )
    for block in blocks:
        least = 0.0
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.surface == surface and hypothesis.kind in (LOSS, GROWING):
                least = max(least, hypothesis.min_llr)
        if (
            least - best_alternative_llr(block, estimators, loss_estimator, surface, every)
            > tests.naming_level
        ):
            return True
    return False


@kernel
def excludes_loss(tests, blocks, estimators, loss_estimator, surface, ends, abrupt):
    """True if an alternative explains the data better than a loss of this surface, by the naming level.

    Each block of roll and yaw is compared together with that of pitch, because a loss acts on its own axes
    only. A loss that is not declared `abrupt` may grow. A constant theta then explains only a part of its
    effect, so the loss is excluded only if its ratio is also below MIN_CONSTANT_SHARE of the best. The same
    holds for a loss that begins inside a frame of several instants, and for the end of a loss there. The end
    of a loss in pitch counts only if `ends` is set: a fault outside the class may look like it. Arguments as
    in `confirms_loss`.
    """
    pitch, single_instant = blocks[likelihood.PITCH_BLOCK], tests.share == 1.0
    part = 1.0 if abrupt and single_instant else MIN_CONSTANT_SHARE
    end_part = 1.0 if single_instant else MIN_CONSTANT_SHARE
    for lateral in blocks[LATERAL:]:
        better = best_alternative_llr(pitch, estimators, loss_estimator, surface)
        better = max(better, best_alternative_llr(lateral, estimators, loss_estimator, surface))
        worse = max(max_llr(pitch, surface, False), max_llr(lateral, surface, False))
        ended = max_llr(lateral, surface, True)
        if ends:
            ended = max(ended, max_llr(pitch, surface, True))
        small = worse < part * better and ended < end_part * better
        if small and better - max(worse, ended) > tests.naming_level:
            return True
    return False


@kernel
def estimated_loss(blocks, surface):
    """Estimate of theta, in [-1, 0], of a loss of effectiveness of a surface, and one over its variance."""
    theta, information = 0.0, 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if (
                hypothesis.kind == LOSS
                and hypothesis.surface == surface
                and hypothesis.information > information
            ):
                theta, information = hypothesis.theta, hypothesis.information
    return theta, information


@kernel
def prepare_tests(tests, noise, blocks, air, bound, design, measured, u, dt):
    """Prepare the next frame, of dt s: gust, regressors, drift and jitter at this instant.

    bound: the declared bounds; u (n,) rad: positions of healthy surfaces.
    """
    x, y = measured.x, measured.y
    if air.output.moving:
        gusts.fill_gust_effect(air, design, x, y, u)
    if tests.has_tolerances:
        for block in blocks:
            block.regressor[:] = 0.0
        add_regressors(tests.share, noise, blocks, bound.declared_errors, design, measured, u)
    fill_drift_and_jitter(noise, blocks, air, bound, design, measured, dt)
    if bound.error_map.n_boxes > 0:
        update_pace(noise, blocks, bound.error_map, u)
    if air.output.moving:
        gusts.begin_gust_sums(air, y[AIRSPEED], tests.share * dt)


@kernel
def update_pace(noise, blocks, error_map, u):
    """Fill the pace of every block for the next frame: the model's mapped error changes with the surfaces."""
    moved = 0.0
    for s in range(u.size):
        travel = max(error_map.travel_high[s] - error_map.travel_low[s], LEAST_TRAVEL_RAD)
        moved = max(moved, abs(u[s] - error_map.before[s]) / travel)
        error_map.before[s] = u[s]
    for block in blocks:
        block.pace = min(noise.pace + PACE_PER_TRAVEL * moved, PACE_PER_TRAVEL * REVERSAL_TRAVEL_SHARE)


@kernel
def accumulate_test_substep(tests, noise, blocks, air, bound, design, measured, u, dt):
    """Add an instant inside a frame, dt s after the instant before, to gust and regressors."""
    if air.output.moving:
        gusts.accumulate_gust_substep(air, design, measured.x, measured.y, u, measured.attitude, dt)
    if tests.has_tolerances:
        add_regressors(tests.share, noise, blocks, bound.declared_errors, design, measured, u)


@kernel
def add_regressors(share, noise, blocks, declared_errors, design, measured, u):
    """Add this instant, a `share` of the frame, to the regressors of all unknown constants."""
    y = measured.y
    evaluate(design.moments, measured.x, y)
    add_coefficient_regressors(share, noise.terms, blocks, design, y, u)
    if noise.read:
        noise_model.add_reading_regressors(share, noise, blocks, declared_errors, design, y, u)


@kernel
def fill_drift_and_jitter(noise, blocks, air, bound, design, measured, dt):
    """Fill drift intensity and jitter of each block: for the bounded uncertainty and the unmeasured gust."""
    bounded, V = noise.bounded, measured.y[AIRSPEED]
    bounded[:] = 0.0
    add_published_bound(measured.x, design, bound.inertia, bound.constant, bound.earth_rate, bounded)
    mapped = bound.error_map.n_boxes > 0
    for i in range(3):
        bounded[i] += noise.deflection[i]
        if mapped:
            bounded[i] += min(bound.error_map.now[i], UNKNOWN_IN_FILTERS_RAD_S2)
        if bound.error_map.anywhere:
            noise.further_error[i] = further_map_error(bound.error_map, bound.error_map.n_levels - 1, i)
    for b, block in enumerate(blocks):
        for i, axis in enumerate(block.axis[: block.n]):
            for j in range(block.n):
                block.drift[i, j] = 0.0
                if air.output.moving:
                    moved = gusts.unmeasured_gust_drift(
                        air, V, axis, block.axis[j], b == likelihood.LATERAL_RETURNING
                    )
                    block.drift[i, j] = block.drift_scale * moved
            size = max(bounded[axis], likelihood.LEAST_UNCERTAINTY_RAD_S2)
            walk = noise.walk_intensity * size * size
            block.drift[i, i] += walk
            block.no_gust_filter.drift[i, i] = walk
            block.jitter[i] = block.no_gust_filter.jitter[i] = noise.jitter[axis]
        block.keep = np.exp(-dt * V / block.return_length) if block.return_length > 0.0 else 1.0


@kernel
def add_coefficient_regressors(share, terms, blocks, design, y, u):
    """Add this instant, a `share` of the frame, to the regressors (n, 2) rad/s2 of the coefficients."""
    table = design.moments
    regressors(table, table.power, u, terms)
    force = share * y[QDYN] * design.S
    lateral, longitudinal = force * design.b, force * design.c
    pitch = blocks[likelihood.PITCH_BLOCK]
    first = table.free_from[1]
    for j in range(table.surface_to[1] - first):
        pitch.regressor[j, 0] += design.Qm * longitudinal * terms[first + j]
    for rolling in blocks[LATERAL:]:
        n_roll, first = table.surface_to[0], table.free_from[2]
        for j in range(n_roll):
            Cl = lateral * terms[j]
            rolling.regressor[j, 0] += design.Pl * Cl
            rolling.regressor[j, 1] += design.Rl * Cl
        for j in range(table.surface_to[2] - first):
            Cn = lateral * terms[first + j]
            rolling.regressor[n_roll + j, 0] += design.Pn * Cn
            rolling.regressor[n_roll + j, 1] += design.Rn * Cn
