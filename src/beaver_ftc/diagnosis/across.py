"""What a surface cannot have done, whatever the type and the course of its fault.

A fault of surface s moves the rates along its column g_s of G and nowhere else. So they are looked at along
directions m that it does not move,

    m . x,     m . g_s = 0

each by a filter and tests of its own (whitening.py, likelihood.py): a step, and losses of other surfaces.
What is found there is another surface's doing. Directions are the axes, for the surfaces that do not move
them at all, and in roll and yaw, which ailerons and rudder both move, across the column of each:
m = (-g_r, g_p) / |g|.

Where declared errors may turn that column, a share of what goes along it shows across: at most
(|m_p| e_p + |m_r| e_r) / (|g| - |m_r| e_p - |m_p| e_r), e the error of the surface's own terms per rad. That
much is tolerated as an error of a coefficient is. The vanes are not asked: a surface that is off its command
has forces that they would take for a gust, so every gust is reckoned with in full. What a test must reach is
the level of the alarm: chance and bounded uncertainty exclude no oftener than they alarm.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import air, likelihood, whitening
from beaver_ftc.diagnosis.state import LATERAL, LEAST_UNCERTAINTY_RAD_S2, PITCH, PITCH_BLOCK, ROLL, STEP, YAW

LEAST_LENGTH = 0.1  # of a column: errors larger than that are not reckoned with


@kernel
def turn(view, G):
    """Fill `mix` (3,), for a view across a column of G (3, n); returns the column's length."""
    in_roll, in_yaw = G[ROLL, view.surface], G[YAW, view.surface]
    size = np.sqrt(in_roll * in_roll + in_yaw * in_yaw)
    if size > 0.0:
        view.mix[ROLL], view.mix[YAW] = -in_yaw / size, in_roll / size
    return size


@kernel
def blur(view, statistical, V):
    """Fill noise, jitter, drift and bound of a view's block from what is declared of the axes; V m/s."""
    block, m, bounded = view.block, view.mix, statistical.bounded
    noise, jitter, bound, drift = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        noise += m[i] * m[i] * statistical.block[PITCH_BLOCK if i == PITCH else LATERAL].noise[i // 2]
        jitter += abs(m[i]) * np.sqrt(statistical.jitter[i])
        bound += abs(m[i]) * bounded[i]
        if statistical.air.moving:
            for j in range(3):
                if m[i] != 0.0 and m[j] != 0.0:
                    drift += m[i] * m[j] * air.whole_drift(statistical.air, V, i, j)
                    block.P_dd[0, 0] += m[i] * m[j] * statistical.air.leap[i, j]
    size = max(bound, LEAST_UNCERTAINTY_RAD_S2)
    block.noise[0], block.jitter[0], view.bounded[0] = noise, jitter * jitter, bound
    block.drift[0, 0] = drift + statistical.rapidity * size * size


@kernel
def regress(fdi, view, innovation, size):
    """Fill what constants multiply in a view; size: of the column it looks across, 0 of none."""
    block, m, own = view.block, view.mix, fdi.bound.own_per_rad
    lateral, pitch = fdi.statistical.block[LATERAL], fdi.statistical.block[PITCH_BLOCK]
    if m[PITCH] != 0.0:
        for j in range(pitch.n_regressors):
            block.regressor[j, 0] = m[PITCH] * pitch.regressor[j, 0]
        return
    for j in range(lateral.n_regressors):
        block.regressor[j, 0] = m[ROLL] * lateral.regressor[j, 0] + m[YAW] * lateral.regressor[j, 1]
    if size > 0.0:
        in_roll, in_yaw = own[ROLL, view.surface], own[YAW, view.surface]
        turned = abs(m[ROLL]) * in_roll + abs(m[YAW]) * in_yaw
        shorter = abs(m[YAW]) * in_roll + abs(m[ROLL]) * in_yaw
        along = m[YAW] * innovation[ROLL] - m[ROLL] * innovation[YAW]
        share = turned / max(size - shorter, LEAST_LENGTH * size)
        block.regressor[lateral.n_regressors, 0] = share * along if fdi.bound.own_errors else 0.0


@kernel
def sign(view, Gu):
    """Fill the signatures: a step, and losses; Gu (3, n) rad/s2."""
    block, m = view.block, view.mix
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        s = hypothesis.surface
        hypothesis.signature[0] = 1.0
        if hypothesis.kind != STEP:
            hypothesis.signature[0] = m[0] * Gu[0, s] + m[1] * Gu[1, s] + m[2] * Gu[2, s]


@kernel
def observe(fdi, innovation, G, Gu, V, frame, latched):
    """Take in one frame, as `statistical.observe`. G, Gu (3, n): of it; V m/s."""
    statistical, dt = fdi.statistical, fdi.dt
    keep, slot = statistical.keep if latched else 1.0, likelihood.slot_to_start(frame)
    for a in range(statistical.n_views):
        view = statistical.views[a]
        block, m, size = view.block, view.mix, 0.0
        if view.surface >= 0:
            size = turn(view, G)
        if not latched:
            likelihood.start(block, slot)
        blur(view, statistical, V)
        whitening.advance(block, dt)
        if block.level > 0.0:
            likelihood.reach(block, view.bounded, dt)
        block.scratch[0] = m[0] * innovation[0] + m[1] * innovation[1] + m[2] * innovation[2]
        whitening.whiten(block, block.state, block.scratch, dt, block.innovation)
        if statistical.tolerated:
            regress(fdi, view, innovation, size)
            for j in range(block.n_regressors):
                whitening.whiten(
                    block, block.regressor_state[j], block.regressor[j], dt, block.regressor_response[j]
                )
        sign(view, Gu)
        likelihood.weigh(block, statistical.tolerated, dt, keep)
        likelihood.judge(block)


@kernel
def feels(view, s, column):
    """Whether a fault of surface s, of this column of G (3,), shows in a view."""
    if view.surface == s:
        return False
    return view.mix[0] * column[0] + view.mix[1] * column[1] + view.mix[2] * column[2] != 0.0


@kernel
def excludes(fdi, s):
    """Whether something is going on that no fault of surface s does."""
    statistical, column = fdi.statistical, fdi.estimator[fdi.layout.position_of[s]].effect.Z
    for a in range(statistical.n_views):
        view = statistical.views[a]
        if not feels(view, s, column):
            for h in range(view.block.n_hypotheses):
                if view.block.hypothesis[h].score > statistical.alarm_level:
                    return True
    return False
