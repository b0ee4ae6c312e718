"""The statistical detector: likelihood-ratio tests on the whitened innovation (likelihood.py, parity.py).

Pitch is one block; roll and yaw, whose noise is correlated, are another. Roll and yaw have two blocks with
different models of the drift. A random walk reacts fast and ignores constant errors. A drift that returns to
zero gathers evidence for longer. Pitch has only the latter if the air moves and no gust is measured. The
worst-case scheme needs no probability; the scenario's `fdi.authority` sets whose alarms and exclusions count.

statistical_design.py fills the records from what a scenario declares.

Symbols of the kernels:

    nu (3,) rad/s2                innovation of the frame
    eta (3,) rad/s2               bound on the uncertainty
    y; u (n,) rad                 readings; positions of healthy surfaces
    dt s, k                       duration and number of the frame
    V m/s                         airspeed
    b, h, v                       block, hypothesis, view
    s; i, j                       surface; axes of a block
    fies                          isolation estimators
    loss_number (n,)              number of the estimator of each surface's loss, or -1
    lo, hi                        bounds on a log-likelihood ratio: places LO and HI of a pair
    stat                          the record of the detector, of `statistical_dtype`
    cfg, noise, gust, bound       records of the tests, the noise model, the gust estimate, the bounds
"""

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.schema import MAX_SURFACES
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis.detection import likelihood, parity
from beaver_ftc.diagnosis.detection.attitude import attitude_dtype
from beaver_ftc.diagnosis.detection.blocks import (
    GROWING_LOSS,
    LATERAL_BLOCK,
    LOSS,
    LOSS_END,
    MIN_ETA_RAD_S2,
    N_FILTER_BLOCKS,
    PITCH_BLOCK,
    REVERTING_BLOCK,
    block_dtype,
    restarting_slot,
)
from beaver_ftc.diagnosis.detection.forces import FORCES_RECORD
from beaver_ftc.diagnosis.detection.parity import (
    StatisticalSize,
    view_dtype,
)
from beaver_ftc.diagnosis.detection.rates import NOISE_RECORD, add_constants, begin_rows
from beaver_ftc.diagnosis.detection.rows import ROWS_RECORD, project_rows
from beaver_ftc.diagnosis.detection.tones import TONE_RECORD
from beaver_ftc.diagnosis.detection.whitening import D0, add_turn_to_drift, whiten_calm, whiten_step
from beaver_ftc.diagnosis.estimators import DAMAGE_EXCLUDES
from beaver_ftc.diagnosis.gust_drift import unmeasured_drift
from beaver_ftc.diagnosis.gusts import (
    GUST_RECORD,
    begin_gust_sums,
    fill_gust_effect,
    update_gust,
)

# A loss that grows at any rate has, as a loss of constant theta, at least this share of its log-likelihood
# ratio (docs/explanation/statistical.md).
MIN_LLR_SHARE = 0.25
# In a frame, the error of a model moves at most from one end of its bound to the other, by 2 bounds. For this
# a surface must move by a quarter of its travel.
MAX_ETA_RATE = 2.0
BOUNDS_PER_TRAVEL = 8.0
MIN_TRAVEL_RAD = 1e-6  # lower limit of a travel that divides
LO, HI = 0, 1

# Configuration of the tests.
TESTING_RECORD = record(
    enabled=int,
    alarm_level=float, margin=float,  # standard deviations; difference of log-likelihood ratios
    forget=float,  # factor by which evidence decays per frame after the alarm
    n_scores=int,  # number of columns of `share` in ALARM_RECORD that are logged
    w=float,  # one over the number of instants in a frame
    mapped=int,  # whether the model's error is mapped and no surface can be lost
)  # fmt: skip

# Output of the detector. ratio, axis: largest score over the alarm level, and its axis; detected_at_s: time
# of the first alarm, s, or -1; share: scores over the alarm level, by loss, then by axis of a step.
ALARM_RECORD = record(ratio=float, axis=int, detected_at_s=float, share=MAX_SURFACES + len(AXES))


@sized
def statistical_dtype(size: StatisticalSize) -> np.dtype:
    """The record of the detector, for an aircraft that needs these capacities."""
    return record(
        test=TESTING_RECORD, noise=NOISE_RECORD, rows=ROWS_RECORD, alarm=ALARM_RECORD,
        block=(block_dtype(size.rate_size), N_FILTER_BLOCKS), n_views=int,
        views=(view_dtype(size.view_size), size.n_views), tone_test_config=TONE_RECORD, forces=FORCES_RECORD,
        gust=GUST_RECORD, vaneless=GUST_RECORD, vaned=GUST_RECORD, attitude=attitude_dtype(size.rate_size),
    )  # fmt: skip


@kernel
def update_blocks(stat, dt, k, alarmed, may_end=False):
    """Update the blocks with frame k: each projects the rows on its axes, whitens them and tests them.

    alarmed: the detector has raised its alarm, so evidence decays and no onset restarts; may_end: a loss may
    end.
    """
    cfg = stat.test
    gust = stat.gust
    blocks = stat.block
    decay = cfg.forget if alarmed else 1.0
    slot = restarting_slot(k)
    for place, b in enumerate(blocks):
        if not alarmed:
            likelihood.reset_slot(b, slot)
        project_rows(b, stat.rows)
        b.has_coarse = gust.config.coarse_only
        if gust.config.coarse_only:
            for i, axis in enumerate(b.axes[: b.n]):
                b.g_c[i] = gust.output.acc_coarse[axis]
        if gust.output.gusty:
            add_turn_to_drift(b, gust)
            if place < REVERTING_BLOCK:
                whiten_calm(b, dt)
            else:  # without gust both blocks of roll and yaw have the same filter
                b.calm.g = blocks[LATERAL_BLOCK].calm.g
        likelihood.update_block(b, dt, decay, cfg.forget if may_end else 0.0, cfg.mapped)


@kernel
def filter_known(blocks, gust, nu, dt):
    """Whiten nu (3,), the innovation after known faults, less the effect of the measured gust. The state
    x_known of each block tracks its slowly varying mean.

    The whitened innovation replaces the `nu` of each block, which the next frame fills again.
    """
    for b in blocks[:REVERTING_BLOCK]:
        for i, axis in enumerate(b.axes[: b.n]):
            b.nu[i] = nu[axis] - gust.output.acc_mean[axis]
        whiten_step(b, b.x_known, b.nu, dt, b.nu)


@kernel
def fill_unmodelled(blocks, gust, out):
    """Fill out = d + acc, (3,) rad/s2: the acceleration that the control law's model lacks.

    d: estimated drift; acc: effect of the gust that the vanes measure.
    """
    for b in blocks[:REVERTING_BLOCK]:
        for i, axis in enumerate(b.axes[: b.n]):
            out[axis] = b.x_known[D0 + i] + gust.output.acc[axis]


@kernel
def update_alarm(stat, t, bounded=True):
    """Fill the scores over the alarm level, the largest of them with its axis, and at the first alarm its
    time t s.

    Scores of forces and of oscillations are in the column of the step on their axis: the last three of the
    n_scores columns of `share` are those of the axes. Unless `bounded`, the largest is set to 0: outside its
    map, the model's error has no bound.
    """
    alarm = stat.alarm
    cfg = stat.test
    alarm.ratio = 0.0
    alarm.share[:] = 0.0
    for b in stat.block:
        for h in b.hypothesis[: b.n_h]:
            if h.alarms:
                keep_score(alarm, h.score / cfg.alarm_level, h.axis, h.column)
    for v in stat.views[: stat.n_views]:
        share = parity.view_alarm_score(v, stat) / cfg.alarm_level
        keep_score(alarm, share, v.alarm_axis, cfg.n_scores - len(AXES) + v.alarm_axis)
    if not bounded:
        alarm.ratio = 0.0
    if alarm.ratio > 1.0 and alarm.detected_at_s < 0.0:
        alarm.detected_at_s = t


@kernel
def keep_score(alarm, share, axis, column):
    """Keep a score over the alarm level in its column, and with its axis if it is the largest of all."""
    alarm.share[column] = max(alarm.share[column], share)
    if share > alarm.ratio:
        alarm.ratio = share
        alarm.axis = axis


@kernel
def best_alternative(b, fies, loss_number, s, revived=False):
    """max_h lo_h over all alternatives h to the loss of surface s in block b, at least 0, that of no fault.

    Alternatives are the steps, the moment in alpha^3, and the losses of other surfaces. An excluded loss is
    none, unless `revived`: as evidence decays, an uncertainty that correlates with the commands may support
    it again.
    """
    lo = 0.0
    for h in b.hypothesis[: b.n_h]:
        if h.kind in (GROWING_LOSS, LOSS_END):
            continue
        if h.kind == LOSS:
            number = loss_number[h.surface]
            if h.surface == s or (number >= 0 and fies[number].excluded and not revived):
                continue
        lo = max(lo, h.llr_lo)
    return lo


@kernel
def loss_bounds(b, s, ended):
    """(max_h lo_h, max_h hi_h) over hypotheses of surface s in block b: its constant and its growing loss,
    or, if `ended`, the end of its loss; 0 without any."""
    lo = hi = 0.0
    for h in b.hypothesis[: b.n_h]:
        if h.surface == s and (h.kind == LOSS_END) == ended:
            lo, hi = max(lo, h.llr_lo), max(hi, h.llr_hi)
    return lo, hi


@kernel
def confirms_loss(cfg, blocks, fies, loss_number, s):
    """True if a loss of surface s explains the data better than all alternatives:

        lo_loss - max_alternatives lo > margin      in some block

    If declared damage has weakly excluded the loss (DAMAGE_EXCLUDES), excluded losses are alternatives, too.
    """
    revived = loss_number[s] >= 0 and fies[loss_number[s]].weak == DAMAGE_EXCLUDES
    for b in blocks:
        if loss_bounds(b, s, False)[LO] - best_alternative(b, fies, loss_number, s, revived) > cfg.margin:
            return True
    return False


@kernel
def excludes_loss(cfg, blocks, fies, loss_number, s, pitch_ends, abrupt):
    """True if an alternative explains the data better than a loss of surface s:

        best - max(hi, hi_end) > margin,   hi < share best,   hi_end < share_end best

    best: the largest lo of the alternatives; hi, hi_end: upper bounds of the loss and of its end. Each block
    of roll and yaw is compared together with that of pitch, because a loss acts on its own axes only; one of
    the two comparisons is enough. The end of a loss in pitch counts only if `pitch_ends` is set: a fault
    outside the class may look like it.

    A constant theta may explain only a part of a loss, for which the shares allow:

        w        `abrupt`    share            share_end
        < 1      any         MIN_LLR_SHARE    MIN_LLR_SHARE    a loss may begin or end inside a frame
        1        no          MIN_LLR_SHARE    1                a loss may grow, but is constant in each frame
        1        yes         1                1
    """
    pitch = blocks[PITCH_BLOCK]
    share_end = 1.0 if cfg.w == 1.0 else MIN_LLR_SHARE
    share = share_end if abrupt else MIN_LLR_SHARE
    best_pitch = best_alternative(pitch, fies, loss_number, s)
    hi_pitch = loss_bounds(pitch, s, False)[HI]
    hi_end_pitch = loss_bounds(pitch, s, True)[HI] if pitch_ends else 0.0
    for b in blocks[LATERAL_BLOCK:]:
        best = max(best_pitch, best_alternative(b, fies, loss_number, s))
        hi = max(hi_pitch, loss_bounds(b, s, False)[HI])
        hi_end = max(hi_end_pitch, loss_bounds(b, s, True)[HI])
        if hi < share * best and hi_end < share_end * best and best - max(hi, hi_end) > cfg.margin:
            return True
    return False


@kernel
def estimate_loss(blocks, s):
    """(theta, D): estimate in [-1, 0] of a loss of surface s, and one over its variance, from the block in
    which this variance is smallest.
    """
    th = D = 0.0
    for b in blocks:
        for h in b.hypothesis[: b.n_h]:
            if h.kind == LOSS and h.surface == s and h.D > D:
                th = h.th
                D = h.D
    return th, D


@kernel
def prepare_tests(stat, bound, model, meas, u, dt):
    """Prepare the next frame: gust, rows, drift and eta_rate of the blocks at this instant.

    u (n,): positions of healthy surfaces.
    """
    noise = stat.noise
    gust = stat.gust
    share = stat.test.w
    V = meas.y[AIRSPEED]
    if gust.output.gusty:
        fill_gust_effect(gust, model, meas.x, meas.y, u)
    begin_rows(share, noise, stat.rows, bound, model, meas, u)
    fill_drift(noise, stat.rows.eta[0], stat.block, gust, V, dt)
    if bound.error_map.n_boxes > 0:
        update_eta_rate(noise, stat.block, bound.error_map, u)
    if gust.output.gusty:
        begin_gust_sums(gust, V, share * dt)


@kernel
def update_eta_rate(noise, blocks, emap, u):
    """Fill eta_rate, the share of its bound by which a mapped uncertainty can change in the next frame.

    eta_rate = min(rate0 + moved BOUNDS_PER_TRAVEL, MAX_ETA_RATE),   moved = max_s |u_s - u_old_s| / travel_s

    travel_s rad: between the stops of the map (`map_dtype`). `emap.u_old` becomes u.
    """
    moved = 0.0
    for s in range(u.size):
        width = max(emap.stop_hi[s] - emap.stop_lo[s], MIN_TRAVEL_RAD)
        moved = max(moved, abs(u[s] - emap.u_old[s]) / width)
        emap.u_old[s] = u[s]
    for b in blocks:
        b.eta_rate = min(noise.rate0 + BOUNDS_PER_TRAVEL * moved, MAX_ETA_RATE)


@kernel
def add_test_instant(stat, bound, model, meas, u, dt):
    """Add an instant inside a frame, dt s after the instant before, to gust and rows."""
    if stat.gust.output.gusty:
        update_gust(stat.gust, model, meas.x, meas.y, u, meas.attitude, dt)
    add_constants(stat.test.w, stat.noise, stat.rows, bound.declared_errors, model, meas, u)


@kernel
def fill_drift(noise, eta, blocks, gust, V, dt):
    """Fill the intensity Q_d and the decay a of the drift of each block, and for its filter without gust Q_d
    and the noise Q_x.

        Q_d,ij = Q_scale q_gust,ij + [i = j] q max(eta_i, MIN_ETA_RAD_S2)^2,      a = exp(-dt V / length)

    i, j: axes of the block; Q_d, q_gust (rad/s2)2/s; V m/s; length m: `drift_length_m`, 0 for a
    random walk, a = 1; q 1/s. The filter without gust has the second term alone.
    """
    gusty = gust.output.gusty
    for place, b in enumerate(blocks):
        reverts = place == REVERTING_BLOCK
        length = b.drift_length_m
        for i, axis in enumerate(b.axes[: b.n]):
            for j in range(b.n):
                q_gust = unmeasured_drift(gust, V, axis, b.axes[j], reverts) if gusty else 0.0
                b.Q_d[i, j] = b.Q_scale * q_gust
            q_eta = noise.q * max(eta[axis], MIN_ETA_RAD_S2) ** 2
            b.Q_d[i, i] += q_eta
            b.calm.Q_d[i, i] = q_eta
            b.calm.Q_x[i] = noise.Q[axis]
        b.a = np.exp(-dt * V / length) if length > 0.0 else 1.0
