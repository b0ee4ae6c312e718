"""The statistical detector: likelihood ratios on the whitened innovation, beside the worst-case thresholds.

Pitch is one block, roll and yaw another, whose noise goes together. Roll and yaw are looked at twice: by a
drift that may go anywhere, which is quick and knows nothing of constants, and by one that returns, which
gathers evidence for longer; pitch by the latter alone, where no vane shows its gust. The declared rate of
false alarms holds for the declared noise; the worst-case scheme beside it needs no probability at all.
`fdi.config.authority` says whose alarms and exclusions count.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.terms import AIRSPEED, N_SIGNALS, QDYN, evaluate, regressors
from beaver_ftc.diagnosis.belief import air as gusts
from beaver_ftc.diagnosis.belief.air import AIR
from beaver_ftc.diagnosis.bounds.worst_case import UNKNOWN_TO_FILTERS_RAD_S2, beyond, uncertainty_bound
from beaver_ftc.diagnosis.detection import likelihood, noise_model, parity
from beaver_ftc.diagnosis.detection.forces import FORCES_FELT
from beaver_ftc.diagnosis.detection.likelihood import (
    ENDING,
    GROWING,
    LATERAL,
    N_BLOCKS,
    N_READINGS,
    block_dtype,
)
from beaver_ftc.diagnosis.detection.parity import USUAL_SIZE, Size, view_dtype
from beaver_ftc.diagnosis.detection.tones import TONE_CONFIG
from beaver_ftc.diagnosis.state import BESIDE_DAMAGE, LOSS

# Of what the best explanation explains, the part that a constant theta leaves to a loss that grows is larger
# for every rate of growth (docs/theory.md, section 7).
LEAST_PART = 0.25
# The error of a model goes from one end of its bound to the other, 2, while a surface moves by a quarter of
# its travel, and no sooner.
WITHIN_TRAVEL = 0.25
FROM_END_TO_END = 2.0 / WITHIN_TRAVEL
LEAST_TRAVEL_RAD = 1e-6

# What the scenario asks of the tests: whether there are any, levels, what of the evidence a frame after the
# alarm leaves, columns of the log, whether constants are tolerated; one over the instants in a frame; whether
# the model's error is mapped.
TESTS = record(
    enabled=int, alarm_level=float, naming_level=float, keep=float, n_columns=int, tolerated=int, share=float,
    mapped=int,
)  # fmt: skip

# What moves the rates besides a fault. rapidity, 1/s: intensity of the drift of an uncertainty over its bound
# squared; pace: by what share of its bound it changes in a frame in which no surface moves; bounded, rad/s2:
# that bound now, of healthy surfaces; beyond: what one anywhere in its travel adds; deflection: its part by
# that of the surfaces; jitter, (rad/s2)2: noise of the model's own inputs, `own_jitter` what of it is none of
# the air data's. read: whether errors of the air data count. The last are scratch.
NOISE = record(
    rapidity=float, pace=float, bounded=3, beyond=3, deflection=3, jitter=3, own_jitter=3, read=int,
    reading=N_READINGS, terms=MAX_TERMS, direction=N_SIGNALS, slope=MAX_MONOMIALS, moved=3,
)  # fmt: skip

# What the tests say: the largest share of the alarm level and its axis, how close healthy flight came to it,
# and when it was first passed.
ALARM = record(score=float, axis=int, closest=float, detected_at_s=float)


@sized
def statistical_dtype(size: Size = USUAL_SIZE) -> np.dtype:
    """What the detector keeps of an aircraft of this size."""
    return record(
        tests=TESTS, noise=NOISE, alarm=ALARM, block=(block_dtype(size.rates), N_BLOCKS),
        n_views=int, views=(view_dtype(size.view), size.views), tone_config=TONE_CONFIG,
        forces=FORCES_FELT, air=AIR, inertial_air=AIR,
    )  # fmt: skip


@kernel
def observe(tests, bounded, blocks, air, innovation, dt, k, latched, ends=False):
    """Take in frame k: innovation and `bounded` (3,) rad/s2, whether the alarm is out; ends:
    a loss may."""
    keep, slot = tests.keep if latched else 1.0, likelihood.slot_to_start(k)
    for b, block in enumerate(blocks):
        if not latched:
            likelihood.start(block, slot)
        for i, axis in enumerate(block.axis[: block.n]):
            block.scratch[i] = innovation[axis] - air.output.mean[axis]
        block.glimpsed = air.config.glimpsed
        if air.config.glimpsed:
            for i, axis in enumerate(block.axis[: block.n]):
                block.shown[i] = air.output.shown[axis]
        if air.output.moving:
            leap(air, block)
            if b < likelihood.RETURNING:
                likelihood.follow_calm(block, dt)
            else:  # calm air is the same for both views of roll and yaw
                block.calm.innovation[:] = blocks[LATERAL].calm.innovation
        memory = tests.keep if ends else 0.0
        likelihood.take_in(block, bounded, tests.tolerated, dt, keep, memory, tests.mapped)


@kernel
def leap(air, block):
    """Let the drift be elsewhere where the axes of the gusts have swung round."""
    for i in range(block.n):
        for j in range(block.n):
            block.P_dd[i, j] += block.stronger * air.output.leap[block.axis[i], block.axis[j]]


@kernel
def follow_rest(blocks, air, surprise, dt):
    """Filter what the law's beliefs leave unexplained: surprise (3,) rad/s2, known faults taken off."""
    for block in blocks[: likelihood.RETURNING]:
        for i, axis in enumerate(block.axis[: block.n]):
            block.scratch[i] = surprise[axis] - air.output.mean[axis]
        likelihood.whiten(block, block.rest, block.scratch, dt, block.scratch)


@kernel
def unknown_acceleration(blocks, air, out):
    """Fill out (3,) rad/s2 with what goes on beyond the law's beliefs: the drift that explains the rates
    best, and the gust the vanes see."""
    for block in blocks[: likelihood.RETURNING]:
        for i, axis in enumerate(block.axis[: block.n]):
            out[axis] = block.rest[2 + i] + air.output.acceleration[axis]


@kernel
def score(alarm, tests, blocks, views, forces, air, t, known=True):
    """Find the largest share of the alarm level that any hypothesis reaches, and its axis; at t s. Where the
    model's error is not `known`, none does."""
    alarm.score = 0.0
    if not known:
        return
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.alarms:
                note(alarm, tests.alarm_level, hypothesis.score, hypothesis.axis)
    for view in views:
        note(alarm, tests.alarm_level, parity.alarm_score(view, views, tests, forces, air), view.axis)
    if alarm.score > 1.0 and alarm.detected_at_s < 0.0:
        alarm.detected_at_s = t


@kernel
def note_closest_approach(alarm):
    """Keep the largest share of its level that the detector has reached."""
    alarm.closest = max(alarm.closest, alarm.score)


@kernel
def note(alarm, level, score, axis):
    """Keep a score if it is the largest."""
    share = score / level
    if share > alarm.score:
        alarm.score, alarm.axis = share, axis


@kernel
def write_shares(tests, blocks, views, forces, air, row):
    """Write the last columns of the log: each test as a share of the alarm level, losses, then steps. What
    forces and tones show besides is in the step of the axis."""
    first = row.size - tests.n_columns
    row[first:] = 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.alarms:
                place = first + hypothesis.column
                row[place] = max(row[place], hypothesis.score / tests.alarm_level)
    for view in views:
        place = row.size - 3 + view.axis
        row[place] = max(row[place], parity.alarm_score(view, views, tests, forces, air) / tests.alarm_level)


@kernel
def is_open(estimators, loss_of, surface):
    """Whether a loss of this surface has not been excluded."""
    return loss_of[surface] < 0 or not estimators[loss_of[surface]].excluded


@kernel
def best_alternative(block, estimators, loss_of, surface, every=False):
    """The greatest log likelihood ratio that any hypothesis but the loss of a surface has at least.

    What has been excluded is no alternative: as the evidence for that fades, uncertainty that goes along with
    the commands may gather some for it. `every`: it is all the same.
    """
    best = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.kind in (GROWING, ENDING):
            continue
        other = hypothesis.surface
        if hypothesis.kind != LOSS or (other != surface and (every or is_open(estimators, loss_of, other))):
            best = max(best, hypothesis.at_least)
    return best


@kernel
def at_most(block, surface, ending):
    """The log likelihood ratio a loss of this surface, or the end of one, has at most; 0 where the block does
    not feel it."""
    most = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.surface == surface and (hypothesis.kind == ENDING) == ending:
            most = max(most, hypothesis.at_most)
    return most


@kernel
def shows(tests, blocks, estimators, loss_of, surface):
    """Whether a loss of this surface explains the flight better than all else, by the naming level.

    estimators: of isolation; loss_of (surfaces,): which of them is of a surface's loss, or -1. Of one that is
    BESIDE_DAMAGE every other loss counts: damage excludes what it took as well.
    """
    every = loss_of[surface] >= 0 and estimators[loss_of[surface]].doubted == BESIDE_DAMAGE
    for block in blocks:
        least = 0.0
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.surface == surface and hypothesis.kind in (LOSS, GROWING):
                least = max(least, hypothesis.at_least)
        if least - best_alternative(block, estimators, loss_of, surface, every) > tests.naming_level:
            return True
    return False


@kernel
def excludes(tests, blocks, estimators, loss_of, surface, ends, abrupt):
    """Whether something else explains the flight better than a loss of this surface, by the naming level.

    Each view of roll and yaw is held against that of pitch: a loss explains what it does to its own axes. A
    loss whose course is not declared `abrupt` may grow, and a constant theta then explains only part of what
    it does: it is excluded where that part is small besides; so is one that begins within a frame. The end of
    one is a step like any other, and explains as much or nothing, but within a frame of several instants a
    part: it shows in two; in pitch, where a fault outside the class may be such a step, only where asked for,
    by `ends`. Arguments as in `shows`.
    """
    pitch, at_once = blocks[likelihood.PITCH_BLOCK], tests.share == 1.0
    part = 1.0 if abrupt and at_once else LEAST_PART
    end_part = 1.0 if at_once else LEAST_PART
    for lateral in blocks[LATERAL:]:
        better = best_alternative(pitch, estimators, loss_of, surface)
        better = max(better, best_alternative(lateral, estimators, loss_of, surface))
        worse = max(at_most(pitch, surface, False), at_most(lateral, surface, False))
        ended = at_most(lateral, surface, True)
        if ends:
            ended = max(ended, at_most(pitch, surface, True))
        small = worse < part * better and ended < end_part * better
        if small and better - max(worse, ended) > tests.naming_level:
            return True
    return False


@kernel
def estimated_loss(blocks, surface):
    """Estimated theta of a loss of effectiveness of a surface, in [-1, 0], and one over its variance."""
    theta, certainty = 0.0, 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.kind == LOSS and hypothesis.surface == surface and hypothesis.certainty > certainty:
                theta, certainty = hypothesis.theta, hypothesis.certainty
    return theta, certainty


@kernel
def prepare(tests, noise, blocks, air, bound, design, measured, u, dt):
    """Make ready for the frame to come, of dt s: noise as it is now, and what the coefficients multiply.

    bound: what is declared; u (surfaces,) rad: in effect.
    """
    x, y = measured.x, measured.y
    if air.output.moving:
        gusts.effect(air, design, x, y, u)
    if tests.tolerated:
        for block in blocks:
            block.regressor[:] = 0.0
        constants(tests.share, noise, blocks, bound.admitted, design, measured, u)
    drifts(noise, blocks, air, bound, design, measured, dt)
    if bound.error_map.n_boxes > 0:
        follow_surfaces(noise, blocks, bound.error_map, u)
    if air.output.moving:
        gusts.begin_frame(air, y[AIRSPEED], tests.share * dt)


@kernel
def follow_surfaces(noise, blocks, error_map, u):
    """Bring the pace to the frame to come: what a model's own terms are off moves with its surfaces."""
    moved = 0.0
    for s in range(u.size):
        travel = max(error_map.travel_high[s] - error_map.travel_low[s], LEAST_TRAVEL_RAD)
        moved = max(moved, abs(u[s] - error_map.before[s]) / travel)
        error_map.before[s] = u[s]
    for block in blocks:
        block.pace = min(noise.pace + FROM_END_TO_END * moved, FROM_END_TO_END * WITHIN_TRAVEL)


@kernel
def look(tests, noise, blocks, air, bound, design, measured, u, dt):
    """Take in an instant inside a frame, dt s after the one before."""
    if air.output.moving:
        gusts.look(air, design, measured.x, measured.y, u, measured.attitude, dt)
    if tests.tolerated:
        constants(tests.share, noise, blocks, bound.admitted, design, measured, u)


@kernel
def constants(share, noise, blocks, admitted, design, measured, u):
    """Add to the regressors what the constants that are not known multiply now, a `share` of the frame."""
    y = measured.y
    evaluate(design.moments, measured.x, y)
    coefficients(share, noise.terms, blocks, design, y, u)
    if noise.read:
        noise_model.add_readings(share, noise, blocks, admitted, design, y, u)


@kernel
def drifts(noise, blocks, air, bound, design, measured, dt):
    """Fill each block's drift and jitter: uncertainty that is merely bounded, and the air not seen."""
    bounded, V = noise.bounded, measured.y[AIRSPEED]
    bounded[:] = 0.0
    uncertainty_bound(measured.x, design, bound.inertia, bound.constant, bound.earth_rate, bounded)
    mapped = bound.error_map.n_boxes > 0
    for i in range(3):
        bounded[i] += noise.deflection[i]
        if mapped:
            bounded[i] += min(bound.error_map.now[i], UNKNOWN_TO_FILTERS_RAD_S2)
        if bound.error_map.anywhere:
            noise.beyond[i] = beyond(bound.error_map, bound.error_map.n_levels - 1, i)
    for b, block in enumerate(blocks):
        for i, axis in enumerate(block.axis[: block.n]):
            for j in range(block.n):
                block.drift[i, j] = 0.0
                if air.output.moving:
                    moved = gusts.unseen_drift(air, V, axis, block.axis[j], b == likelihood.RETURNING)
                    block.drift[i, j] = block.stronger * moved
            size = max(bounded[axis], likelihood.LEAST_UNCERTAINTY_RAD_S2)
            walk = noise.rapidity * size * size
            block.drift[i, i] += walk
            block.calm.drift[i, i] = walk
            block.jitter[i] = block.calm.jitter[i] = noise.jitter[axis]
        block.keep = np.exp(-dt * V / block.lag) if block.lag > 0.0 else 1.0


@kernel
def coefficients(share, terms, blocks, design, y, u):
    """Add to each block's regressors (n, 2) rad/s2, means over a frame: what the coefficients multiply."""
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
