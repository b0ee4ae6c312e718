"""Parity tests: they exclude a surface for any type and time history of its fault.

A fault of surface s accelerates the aircraft along its column G of the effects only, rad/s2 per rad. The
projection of the innovation nu, rad/s2, on a parity direction m that is orthogonal to this column,

    m' nu        with  m' G = 0,  |m| = 1

does not depend on a fault of s. If a test finds a signal in this projection, s is not the (only) cause. Each
direction is a view: a block of one axis (blocks.py) with tests for a step, for a loss of another surface
and for an oscillation (tones.py). The directions are

* each axis, for the surfaces that do not move it;
* in a plane of two rows, the direction across the column G of each surface that moves both. The planes are
  roll and yaw; if accelerometers are used (forces.py), also pitch and normal force, and roll or yaw and side
  force.

*Leak.* Errors e_G of the column turn it. Then a share of the innovation along G leaks into the view
(`turn_view`). It is tolerated like an error of a coefficient. A test excludes at the alarm level, so noise
and bounded uncertainty exclude as rarely as they raise an alarm.

*Gust.* The estimate from the vanes is subtracted from the rates only if the forces are measured. Without that
measurement a surface that does not follow its command produces a force that looks like a gust; then the
whole declared gust counts as noise. The rolling gust always does: no vane measures it.

*Vanes.* An error of a vane changes a rate and its force, and so does the false gust estimate that it causes.
A view that uses a vane excludes a surface only after a view that is insensitive to the vane confirms it: one
across the column of the vane's error, or one of a force at the flow angle from inertial motion.

*Accelerometers.* A broken one changes a force and no rate. If accelerometers may break, a force raises no
alarm, and blocks and the views of an axis use no gust estimate that rests on accelerometers. An alarm of the
rates then shows that another part is broken, and after it the views count as usual. Forces that are known or
suspected to be wrong are not used.

What each view may do, by what is subtracted from its rates (`source`), if the forces are used:

    view                             source      raises the alarm      excludes    confirmation
    of an axis                       RAW         by an oscillation     yes         not needed
    of an axis                       VANED       by an oscillation     yes         needed to exclude
    of a force, by inertia           INERTIAL    no                    no          given
    across the column of a surface   RAW         no                    yes         not needed
    across the column of a surface   VANED       if of a force (*)     yes         needed for both
    across the column of a vane      VANELESS    no                    no          given

(*) Its direction has |m_j| > MIN_FORCE_PART in the row j of its force, and accelerometers cannot break. If
the forces are not used, a view that sees a force scores 0, and no other needs confirmation.

Letters of the kernels:

    m, col      direction of a view, and G / |G|, on the five rows of rows.py
    G, e_G      column that a view nulls, and the bound on its error, on these rows, rad/s2 per rad
    i, k, j     the rows that a view combines (`places`)
    b, f        block of a view (blocks.py); record of a force; b.source: what is subtracted from its rates
                (rows.py); from VANELESS on no vane is used
    eta, Q_d    bound on the uncertainty along m, rad/s2; intensity of the drift of the view, (rad/s2)2/s
    L, C        acceleration per rad/s of the aircraft against the air, 1/s; axes of the gusts (gusts.py)
    V           airspeed, m/s
    stat, cfg   record of the detector (statistical.py), and its configuration of the tests

parity_design.py fills the views from what a scenario declares.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import ROLL
from beaver_ftc.aircraft.schema import MAX_SURFACES
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.blocks import (
    MIN_ETA_RAD_S2,
    SIDE_FORCE,
    USUAL_HYPOTHESES,
    BlockCapacity,
    block_dtype,
    restarting_slot,
)
from beaver_ftc.diagnosis.detection.directions import project
from beaver_ftc.diagnosis.detection.forces import MIN_UPDATES
from beaver_ftc.diagnosis.detection.rows import (
    INERTIAL,
    RAW,
    VANED,
    VANELESS,
    fill_leak,
    project_rows,
)
from beaver_ftc.diagnosis.detection.tones import tones_dtype, update_tones, within_limits
from beaver_ftc.diagnosis.detection.whitening import add_turn_to_drift
from beaver_ftc.diagnosis.gust_drift import project_gust, view_drift

PEAK_MEMORY_RATIO = 5.0  # time constant of `peak` over the one with which evidence is forgotten
MIN_FORCE_PART = 0.9  # component of a direction of length 1, above which a view counts as one of the force
MIN_NORM_SHARE = 0.1  # least length that the errors leave of a column, as a share of its length
FORCE_PLACE = 2  # index in `places` of j, the row of the force

# Values of `nulled` that are no surface: AXIS_VIEW for a view of an axis; VANE_VIEW + i for a view across the
# column of an error of the vane of force i.
AXIS_VIEW, VANE_VIEW = -1, MAX_SURFACES


class StatisticalSize(NamedTuple):
    """Capacities of a record: of a block of the rates, of a view; numbers of views and of error-map boxes."""

    rate_size: BlockCapacity
    view_size: BlockCapacity
    n_views: int
    n_map_boxes: int


# Enough for most aircraft: see `required_size`.
USUAL_SIZE = StatisticalSize(BlockCapacity(23, USUAL_HYPOTHESES), BlockCapacity(36, 3), 13, 6)


@sized
def view_dtype(size: BlockCapacity) -> np.dtype:
    """A view whose block has these capacities."""
    return record(
        nulled=int,  # the column of `rows.G` to which the direction is orthogonal, or AXIS_VIEW
        alarm_axis=int,  # axis that an alarm of this view reports
        # the rows (i, k, j) that it combines: k = -1 if only two, j the force if it sees one; col: G / |G|
        places=(int, 3), col=5,
        by_force=int,  # whether it sees a force
        confirmer=int,  # row of the force of the views that confirm this one, if it is VANED
        L_rate=3, L_force=3,  # L by the rates and by the forces that it combines, 1/s: fill_view_drift
        peak=float,  # largest score, decaying slowly; 0 while the view is not used
        block=block_dtype(size), tones=tones_dtype(size.max_regressors),
    )  # fmt: skip


@kernel
def turn_view(view, rows, gust):
    """Turn a view across the column G of what it nulls: of a surface, or of an error of a vane.

        m = G x q / |G x q|      col = G / |G|      on the rows i, k, j of `places`

    q: the effect of the rolling gust on the rows i and k, 1/s, 0 on j, so that the view shows no rolling gust
    either. Without a row k, q is the unit vector of its place, and m lies in the plane of i and j. If
    G x q = 0, as in the first frame, the view keeps its direction, and the share is 0.

    Returns the share of the innovation along G that errors e_G of G let leak into the view:

        |m|' e_G / max(|G| - |col|' e_G, MIN_NORM_SHARE |G|)
    """
    m = view.block.m[0]
    col = view.col
    G = rows.G[view.nulled]
    e_G = rows.e_G[view.nulled]
    i = view.places[0]
    k = view.places[1]
    j = view.places[2]
    L = gust.output.rate_damping
    C = gust.output.C
    G_k = G[k] if k >= 0 else 0.0
    q_i = project_gust(L[i], C, ROLL) if k >= 0 else 0.0
    q_k = project_gust(L[k], C, ROLL) if k >= 0 else 1.0
    m_i = -G[j] * q_k
    m_k = G[j] * q_i
    m_j = G[i] * q_k - G_k * q_i
    norm = np.sqrt(G[i] * G[i] + G_k * G_k + G[j] * G[j])
    norm_m = np.sqrt(m_i * m_i + m_k * m_k + m_j * m_j)
    if norm_m == 0.0:
        return 0.0
    e_m = e_col = 0.0
    for r, m_r in ((i, m_i), (k, m_k), (j, m_j)):
        if r >= 0:
            m[r] = m_r / norm_m
            col[r] = G[r] / norm
            e_m += abs(m[r]) * e_G[r]
            e_col += abs(col[r]) * e_G[r]
    return e_m / max(norm - e_col, MIN_NORM_SHARE * norm)


@kernel
def fill_view_drift(view, q, gust, source_gust, forces, V):
    """Fill the drift of a view, (rad/s2)2/s, at a speed V m/s.

        Q_d = q max(eta, MIN_ETA_RAD_S2)^2      bounded uncertainty
              + sum_f (m_f q_ratio)^2 Q_e,f     source INERTIAL: flow angle from inertial motion
              + `view_drift`                    moving air, by L_rate = m' L, L_force = q_ratio sum_f m_f L_f

    q: see NOISE_RECORD. gust: the gust estimate that gives L and the variance by turns; source_gust: that of
    this view's source, which gives the drift.
    """
    b = view.block
    L = gust.output.rate_damping
    m = b.m[0]
    Q_d = q * max(b.eta[0], MIN_ETA_RAD_S2) ** 2
    if b.source == INERTIAL:
        for i, f in enumerate(forces.component):
            Q_d += (m[SIDE_FORCE + i] * forces.q_ratio) ** 2 * f.Q_e
    if gust.output.gusty:
        for j in range(3):
            view.L_rate[j] = project_gust(m, L, j)
            view.L_force[j] = 0.0
            for i, f in enumerate(forces.component):
                view.L_force[j] += m[SIDE_FORCE + i] * f.L[j] * forces.q_ratio
        is_subtracted = b.source != RAW and forces.in_use == 1
        Q_d += view_drift(source_gust, V, view.L_rate, view.L_force, is_subtracted)
        add_turn_to_drift(b, gust)
    b.Q_d[0, 0] = Q_d


@kernel
def project_view(view, stat, vaned, V):
    """Bring direction, noise, signatures and regressors of a view to the elapsed frame; V m/s.

    vaned: the gust estimate of the views by vanes. A view of RAW rates takes the rotation of the air from
    `gust`, the others from `vaned`; if forces are in use, a view without vanes has the drift of `vaneless`.
    The order matters: the direction is turned before the rows are projected on it.
    """
    b = view.block
    rows = stat.rows
    forces = stat.forces
    air = stat.gust if b.source == RAW else vaned
    leak = turn_view(view, rows, air) if view.nulled != AXIS_VIEW else 0.0
    project_rows(b, rows)
    if b.n_Z > b.n_columns:
        fill_leak(b, rows, leak, view.col)
    source_gust = stat.vaneless if b.source >= VANELESS and forces.in_use else air
    fill_view_drift(view, stat.noise.q, air, source_gust, forces, V)


@kernel
def update_views(stat, vaned, y, dt, frame, latched):
    """Bring filter and tests of each view to this frame, as `statistical.update_blocks`; frame: its number;
    y (4 + signals,) measured; vaned: of `project_view`.

        peak <- max((1 - (1 - forget) / PEAK_MEMORY_RATIO) peak, score)

    latched: the detector has raised its alarm, so evidence decays and no slot restarts. A view that sees a
    force is used only while the forces are.
    """
    cfg = stat.test
    c = stat.tone_test_config
    forces = stat.forces
    inside = within_limits(c, y)
    decay = cfg.forget if latched else 1.0
    slot = restarting_slot(frame)
    for view in stat.views[: stat.n_views]:
        if view.by_force and not (forces.in_use and forces.n_seen == MIN_UPDATES):
            view.peak = 0.0
            continue
        project_view(view, stat, vaned, y[AIRSPEED])
        if not latched:
            likelihood.reset_slot(view.block, slot)
        likelihood.update_block(view.block, dt, decay)
        # The error of the integrated angle oscillates with the aircraft's own modes.
        if view.block.source != INERTIAL:
            update_tones(view.tones, view.block, c, cfg.alarm_level, inside, dt)
        view.peak = max((1.0 - (1.0 - cfg.forget) / PEAK_MEMORY_RATIO) * view.peak, view_score(view))


@kernel
def changes_view(view, forces, s, G):
    """True if a fault of surface s changes the projection of a view, m' (G, G_f) != 0; G (3,), G_f (2,): its
    effect on the rates and on the forces now.

    For the surface s that the view nulls this is false by definition: the view was turned across its column
    of the frame before, so m' G of this frame is not exactly 0.
    """
    m = view.block.m[0]
    effect = project(G, m)  # the three rates of m; project loops over its first argument
    for i, f in enumerate(forces.component):
        effect += m[SIDE_FORCE + i] * f.G[s]
    return view.nulled != s and effect != 0.0


@kernel
def view_score(view):
    """The largest score of the tests of a view."""
    score = view.tones.score
    for h in view.block.hypothesis[: view.block.n_h]:
        score = max(score, h.score)
    return score


@kernel
def confirmed_score(view, stat):
    """The score of a view, limited by the views that confirm that it is not an error of a vane:

        view                                       score
        sees a force, and no forces are used       0
        source not VANED, or no forces are used    `view_score`: no confirmation is needed
        others                                     min(peak, P alarm_level / sqrt(2 margin))

    P: the largest peak of the views without vanes whose row of a force is `confirmer`; it must reach the
    level of the isolation, sqrt(2 margin). Peaks are compared because a view and its confirmation may reach
    their levels at different times. No error of a vane changes the rates alone, so a view of RAW rates needs
    no confirmation.
    """
    in_use = stat.forces.in_use
    if view.by_force and not in_use:
        return 0.0
    if view.block.source != VANED or not in_use:
        return view_score(view)
    P = 0.0
    for other in stat.views[: stat.n_views]:
        if other.block.source >= VANELESS and other.places[FORCE_PLACE] == view.confirmer:
            P = max(P, other.peak)
    return min(view.peak, P * stat.test.alarm_level / np.sqrt(2.0 * stat.test.margin))


@kernel
def view_alarm_score(view, stat):
    """The score with which a view raises the alarm, 0 if it raises none.

    Views raise it only where no block of the rates tests: for an oscillation about an axis, and for a
    force. A force raises it only if accelerometers cannot break: then the blocks' gust estimate uses them.
    """
    if view.nulled == AXIS_VIEW:
        return view.tones.score  # 0 by inertia: `update_views`
    if (
        stat.gust.output.uses_accelerometers == 1
        and view.by_force
        and abs(view.block.m[0, view.places[FORCE_PLACE]]) > MIN_FORCE_PART
        and view.block.source == VANED
    ):
        return confirmed_score(view, stat)
    return 0.0


@kernel
def views_exclude(stat, s, G):
    """True if a view detects a signal that no fault of surface s, with this column (3,) of G, can cause."""
    for view in stat.views[: stat.n_views]:
        if (
            view.block.source < VANELESS
            and not changes_view(view, stat.forces, s, G)
            and confirmed_score(view, stat) > stat.test.alarm_level
        ):
            return True
    return False
