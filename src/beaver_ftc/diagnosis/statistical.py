"""The statistical detector: likelihood ratios on the whitened innovation, beside the worst-case thresholds.

Pitch is one block, roll and yaw another, whose noise goes together. Roll and yaw are looked at twice: by a
drift that may go anywhere, which is quick and knows nothing of constants, and by one that returns, which
gathers evidence for longer. The declared rate of false alarms holds for the declared noise; the worst-case
scheme beside it needs no probability at all. `fdi.config.authority` says whose alarms and exclusions count.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel
from beaver_ftc.design.terms import AIRSPEED, N_SIGNALS, QDYN, evaluate, regressors
from beaver_ftc.diagnosis import across, air, likelihood, readings, whitening
from beaver_ftc.diagnosis.across import MAX_VIEWS, VIEW
from beaver_ftc.diagnosis.air import AIR
from beaver_ftc.diagnosis.error_map import UNKNOWN_TO_FILTERS_RAD_S2
from beaver_ftc.diagnosis.forces import FORCES_FELT
from beaver_ftc.diagnosis.likelihood import (
    BLOCK,
    ENDING,
    GROWING,
    LATERAL,
    LEAST_UNCERTAINTY_RAD_S2,
    N_READINGS,
    RETURNING,
    STEP,
)
from beaver_ftc.diagnosis.likelihood import PITCH_BLOCK as PITCH
from beaver_ftc.diagnosis.state import LOSS
from beaver_ftc.diagnosis.thresholds import uncertainty_bound
from beaver_ftc.diagnosis.tones import LISTENING

# Of what the best explanation explains, the part that a constant theta leaves to a loss that grows is larger
# for every rate of growth (docs/theory.md, section 7).
LEAST_PART = 0.25

STATISTICAL = np.dtype(
    [
        ("share", "f8"),  # one over the instants in a frame
        ("enabled", "i8"), ("alarm_level", "f8"), ("naming_level", "f8"), ("keep", "f8"),
        ("n_columns", "i8"),  # of the log
        ("rapidity", "f8"),  # 1/s: intensity of the drift of an uncertainty over its bound squared
        ("bounded", "f8", (3,)), ("deflection", "f8", (3,)), ("jitter", "f8", (3,)), ("tolerated", "i8"),
        ("n_blocks", "i8"), ("block", BLOCK, (3,)), ("n_views", "i8"), ("views", VIEW, (MAX_VIEWS,)),
        ("forces", FORCES_FELT), ("listening", LISTENING),
        ("air", AIR), ("inertial_air", AIR), ("terms", "f8", (MAX_TERMS,)),
        # readings.py: whether errors of the air data count; their noise, and the jitter of all else; scratch
        ("read", "i8"), ("reading_noise", "f8", (N_READINGS,)), ("own_jitter", "f8", (3,)),
        ("direction", "f8", (N_SIGNALS,)), ("slope", "f8", (MAX_MONOMIALS,)), ("moved", "f8", (3,)),
        ("score", "f8"), ("axis", "i8"), ("closest", "f8"), ("detected_at_s", "f8"),
    ],
    align=True,
)  # fmt: skip


@kernel
def signatures(statistical, Gu, cubic):
    """What each fault would have done in the elapsed frame, times theta. Gu (3, surfaces) rad/s2: what each
    surface gave, mean over it; cubic rad/s2: a pitching moment on alpha^3."""
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        for h in range(block.n_hypotheses):
            hypothesis = block.hypothesis[h]
            for i in range(block.n):
                if hypothesis.surface >= 0:
                    hypothesis.signature[i] = Gu[block.axis[i], hypothesis.surface]
                elif hypothesis.kind == STEP:
                    hypothesis.signature[i] = 1.0 if hypothesis.axis == block.axis[i] else 0.0
                else:
                    hypothesis.signature[i] = cubic


@kernel
def observe(statistical, innovation, dt, frame, latched, ends=False):
    """Take in one frame: innovation (3,) rad/s2, frame number, whether the alarm is out; ends: a loss may."""
    keep = statistical.keep if latched else 1.0
    slot = likelihood.slot_to_start(frame)
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        if not latched:
            likelihood.start(block, slot)
        if statistical.air.moving:
            leap(statistical.air, block)
        for i in range(block.n):
            axis = block.axis[i]
            block.scratch[i] = innovation[axis] - statistical.air.mean[axis]
        memory = statistical.keep if ends else 0.0
        likelihood.take_in(block, statistical.bounded, statistical.tolerated, dt, keep, memory)


@kernel
def leap(air, block):
    """Let the drift be elsewhere where the axes of the gusts have swung round."""
    for i in range(block.n):
        for j in range(block.n):
            block.P_dd[i, j] += block.stronger * air.leap[block.axis[i], block.axis[j]]


@kernel
def follow_rest(statistical, surprise, dt):
    """Filter what the law's beliefs leave unexplained: surprise (3,) rad/s2, known faults taken off."""
    for b in range(RETURNING):
        block = statistical.block[b]
        for i in range(block.n):
            axis = block.axis[i]
            block.scratch[i] = surprise[axis] - statistical.air.mean[axis]
        whitening.whiten(block, block.rest, block.scratch, dt, block.scratch)


@kernel
def unknown_acceleration(statistical, out):
    """Fill out (3,) rad/s2 with what goes on beyond the law's beliefs: the drift that explains the rates
    best, and the gust the vanes see."""
    for b in range(RETURNING):
        block = statistical.block[b]
        for i in range(block.n):
            axis = block.axis[i]
            out[axis] = block.rest[2 + i] + statistical.air.acceleration[axis]


@kernel
def score(statistical, t, known=True):
    """Find the largest share of the alarm level that any hypothesis reaches, and its axis; at t s. Where the
    model's error is not `known`, none does."""
    statistical.score = 0.0
    if not known:
        return
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        for h in range(block.n_hypotheses):
            hypothesis = block.hypothesis[h]
            if hypothesis.alarms:
                note(statistical, hypothesis.score, hypothesis.axis)
    for a in range(statistical.n_views):
        view = statistical.views[a]
        note(statistical, across.alarm(statistical, view), view.axis)
    if statistical.score > 1.0 and statistical.detected_at_s < 0.0:
        statistical.detected_at_s = t


@kernel
def note(statistical, score, axis):
    """Keep a score if it is the largest."""
    share = score / statistical.alarm_level
    if share > statistical.score:
        statistical.score, statistical.axis = share, axis


@kernel
def record(statistical, row):
    """Write the last columns of the log: each test as a share of the alarm level, losses, then steps. What
    forces and tones show besides is in the step of the axis."""
    first = row.size - statistical.n_columns
    row[first:] = 0.0
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        for h in range(block.n_hypotheses):
            hypothesis = block.hypothesis[h]
            if hypothesis.alarms:
                place = first + hypothesis.column
                row[place] = max(row[place], hypothesis.score / statistical.alarm_level)
    for a in range(statistical.n_views):
        view = statistical.views[a]
        place = row.size - 3 + view.axis
        row[place] = max(row[place], across.alarm(statistical, view) / statistical.alarm_level)


@kernel
def is_open(fdi, surface):
    """Whether a loss of this surface has not been excluded."""
    for s in range(fdi.isolation.n):
        fie = fdi.isolation.estimator[s]
        if fie.kind == LOSS and fie.surface == surface:
            return not fie.excluded
    return True


@kernel
def best_alternative(fdi, block, surface):
    """The greatest log likelihood ratio that any hypothesis but the loss of a surface has at least.

    What has been excluded is no alternative: as the evidence for that fades, uncertainty that goes along with
    the commands may gather some for it.
    """
    best = 0.0
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        if hypothesis.kind in (GROWING, ENDING):
            continue
        if hypothesis.kind != LOSS or (hypothesis.surface != surface and is_open(fdi, hypothesis.surface)):
            best = max(best, hypothesis.at_least)
    return best


@kernel
def at_most(block, surface, ending):
    """The log likelihood ratio a loss of this surface, or the end of one, has at most; 0 where the block does
    not feel it."""
    most = 0.0
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        if hypothesis.surface == surface and (hypothesis.kind == ENDING) == ending:
            most = max(most, hypothesis.at_most)
    return most


@kernel
def shows(fdi, surface):
    """Whether a loss of this surface explains the flight better than all else, by the naming level."""
    for b in range(fdi.statistical.n_blocks):
        block = fdi.statistical.block[b]
        least = 0.0
        for h in range(block.n_hypotheses):
            hypothesis = block.hypothesis[h]
            if hypothesis.surface == surface and hypothesis.kind in (LOSS, GROWING):
                least = max(least, hypothesis.at_least)
        if least - best_alternative(fdi, block, surface) > fdi.statistical.naming_level:
            return True
    return False


@kernel
def excludes(fdi, surface, ends):
    """Whether something else explains the flight better than a loss of this surface, by the naming level.

    Each view of roll and yaw is held against that of pitch: a loss explains what it does to its own axes. A
    loss whose course is not declared `abrupt` may grow, and a constant theta then explains only part of what
    it does: it is excluded where that part is small besides; so is one that begins within a frame. The end of
    one is a step like any other, and explains as much or nothing, but within a frame of several instants a
    part: it shows in two; in pitch, where a fault outside the class may be such a step, only where asked for,
    by `ends`.
    """
    statistical = fdi.statistical
    pitch, exact = statistical.block[PITCH], fdi.config.abrupt and fdi.config.instants == 1
    for b in range(LATERAL, statistical.n_blocks):
        lateral = statistical.block[b]
        better = max(best_alternative(fdi, pitch, surface), best_alternative(fdi, lateral, surface))
        worse = max(at_most(pitch, surface, False), at_most(lateral, surface, False))
        ended = at_most(lateral, surface, True)
        if ends:
            ended = max(ended, at_most(pitch, surface, True))
        part = 1.0 if exact else LEAST_PART
        end_part = 1.0 if fdi.config.instants == 1 else LEAST_PART
        small = worse < part * better and ended < end_part * better
        if small and better - max(worse, ended) > statistical.naming_level:
            return True
    return False


@kernel
def loss_of(statistical, surface):
    """Estimated theta of a loss of effectiveness of a surface, in [-1, 0], and one over its variance."""
    theta, certainty = 0.0, 0.0
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        for h in range(block.n_hypotheses):
            hypothesis = block.hypothesis[h]
            if hypothesis.kind == LOSS and hypothesis.surface == surface and hypothesis.certainty > certainty:
                theta, certainty = hypothesis.theta, hypothesis.certainty
    return theta, certainty


@kernel
def prepare(statistical, fdi, design, x, y, u):
    """Make ready for the frame to come: noise as it is now, and what the coefficients multiply.

    x (3,) rad/s, y (5,) as measured, u (4,) rad the surfaces in effect.
    """
    if statistical.air.moving:
        air.effect(statistical.air, design, x, y, u)
    if statistical.tolerated:
        for b in range(statistical.n_blocks):
            statistical.block[b].regressor[:] = 0.0
        constants(statistical, fdi, design, x, y, u)
    drifts(statistical, fdi, design, x, y)
    if statistical.air.moving:
        air.begin_frame(statistical.air, y[AIRSPEED], statistical.share * fdi.config.dt)


@kernel
def look(statistical, fdi, design, x, y, u, attitude, dt):
    """Take in an instant inside a frame, dt s after the one before; attitude (3,) rad."""
    if statistical.air.moving:
        air.look(statistical.air, design, x, y, u, attitude, dt)
    if statistical.tolerated:
        constants(statistical, fdi, design, x, y, u)


@kernel
def constants(statistical, fdi, design, x, y, u):
    """Add to the regressors what the constants that are not known multiply now."""
    evaluate(design.moments, x, y)
    coefficients(statistical, design, y, u)
    if statistical.read:
        readings.add(statistical, fdi.bound.admitted, design, y, u)


@kernel
def drifts(statistical, fdi, design, x, y):
    """Fill each block's drift and jitter: uncertainty that is merely bounded, and the air not seen."""
    bounded = statistical.bounded
    bounded[:] = 0.0
    uncertainty_bound(x, design, fdi.bound.inertia, fdi.bound.constant, fdi.bound.earth_rate, bounded)
    mapped = fdi.bound.error_map.n_boxes > 0
    for i in range(3):
        bounded[i] += statistical.deflection[i]
        if mapped:
            bounded[i] += min(fdi.bound.error_map.now[i], UNKNOWN_TO_FILTERS_RAD_S2)
    for b in range(statistical.n_blocks):
        block = statistical.block[b]
        for i in range(block.n):
            axis = block.axis[i]
            for j in range(block.n):
                block.drift[i, j] = 0.0
                if statistical.air.moving:
                    unseen = air.unseen_drift(statistical.air, y[AIRSPEED], axis, block.axis[j])
                    block.drift[i, j] = block.stronger * unseen
            size = max(bounded[axis], LEAST_UNCERTAINTY_RAD_S2)
            block.drift[i, i] += statistical.rapidity * size * size
            block.jitter[i] = statistical.jitter[axis]
        block.keep = np.exp(-fdi.config.dt * y[AIRSPEED] / block.lag) if block.lag > 0.0 else 1.0


@kernel
def coefficients(statistical, design, y, u):
    """Add to each block's regressors (n, 2) rad/s2, means over a frame: what the coefficients multiply."""
    table = design.moments
    regressors(table, table.power, u, statistical.terms)
    share = statistical.share * y[QDYN] * design.S
    lateral, longitudinal = share * design.b, share * design.c
    pitch = statistical.block[PITCH]
    first = table.free_from[1]
    for j in range(table.surface_to[1] - first):
        pitch.regressor[j, 0] += design.Qm * longitudinal * statistical.terms[first + j]
    for b in range(LATERAL, statistical.n_blocks):
        rolling = statistical.block[b]
        n_roll, first = table.surface_to[0], table.free_from[2]
        for j in range(n_roll):
            Cl = lateral * statistical.terms[j]
            rolling.regressor[j, 0] += design.Pl * Cl
            rolling.regressor[j, 1] += design.Rl * Cl
        for j in range(table.surface_to[2] - first):
            Cn = lateral * statistical.terms[first + j]
            rolling.regressor[n_roll + j, 0] += design.Pn * Cn
            rolling.regressor[n_roll + j, 1] += design.Rn * Cn
