"""Parity tests: they exclude a surface for any type and time history of its fault.

A fault of surface s accelerates the aircraft along the column g_s of G only, rad/s2 per rad. A projection of
the innovation nu, rad/s2, on a parity direction m that is orthogonal to that column,

    m . nu        with  m . g_s = 0,  |m| = 1

does not depend on a fault of s. If a test finds a signal in this projection, s is not the (only) cause. Each
direction is a view: it has a whitening filter of its own and tests for a step, for a loss of another surface
(likelihood.py) and for an oscillation (tones.py). The directions are

* each axis, for the surfaces that do not move it;
* in a plane that several surfaces move, the direction across the column g of each: m = (-g_2, g_1) / |g|. The
  planes are roll and yaw; if accelerometers are used (forces.py), also pitch and normal force, yaw and side
  force.

Declared errors may turn the column. Then a share of the innovation along the column leaks into the
projection, at most (|m_1| e_1 + |m_2| e_2) / (|g| - |m_2| e_1 - |m_1| e_2), where e_1 and e_2 bound the
errors of the surface's own terms, rad/s2 per rad. This share is tolerated like an error of a coefficient. A
test excludes at the alarm level, so noise and bounded uncertainty exclude as rarely as they raise an alarm.

The gust estimated from the vanes is subtracted from the rates only if the forces are measured. Without that
measurement a surface that does not follow its command produces a force that looks like a gust; then the
whole declared gust counts as noise. The rolling gust always does: no vane measures it.

An error of a vane changes a rate and its force, and so does the false gust estimate that it causes. If a view
uses a vane, it excludes a surface only after a view that is insensitive to the vane confirms it. That is a
view across the column of the vane, with the gust estimated from the forces, or a view of the force at the
flow angle that integrated inertial motion gives.

A broken accelerometer changes a force and no rate. If accelerometers may break, a force raises no alarm, and
the rates use no gust estimate that rests on accelerometers. An alarm of the rates then shows that another
part is broken, and after it the views count as usual. Forces that are known or suspected to be wrong are not
used.

Letters of the kernels, in addition to those of likelihood.py and rows.py:

    m, col      direction of a view and g / |g|, (5,)
    b, f        block of a view; record of a force
    L           acceleration per rad/s of the aircraft against the air, 1/s
    cfg         configuration of the statistical tests
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS_OF_ONE
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.forces import (
    FORCE_NAMES,
    MAX_FORCE_REGRESSORS,
    MIN_UPDATES,
    NORMAL_INDEX,
    SIDE_INDEX,
    terms_of_force,
)
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL_BLOCK,
    N_INPUT_READINGS,
    PITCH_BLOCK,
    STEP_FAULT,
    USUAL_HYPOTHESES,
    BlockCapacity,
)
from beaver_ftc.diagnosis.detection.rows import (
    INERTIAL,
    RAW,
    VANED,
    VANELESS,
    add_turn_to_drift,
    fill_leak,
    project_rows,
    set_columns,
)
from beaver_ftc.diagnosis.detection.tones import tones_dtype, update_tones, within_limits
from beaver_ftc.diagnosis.deviations import moment_axis
from beaver_ftc.diagnosis.gusts import project_gust, view_drift
from beaver_ftc.diagnosis.state import LOSS, NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW, fill

PEAK_MEMORY_RATIO = 5.0  # time constant of `peak` over the one with which evidence is forgotten
MIN_FORCE_PART = 0.9  # component of a direction of length 1, above which a view counts as one of the force
MIN_NORM_SHARE = 0.1  # least length that the errors leave of a column, as a share of its length
PITCH_PLANE = (PITCH, NORMAL_FORCE)
ROLL_YAW_PLANE = (ROLL, YAW)
YAW_PLANE = (YAW, SIDE_FORCE)

# Values of `nulled` besides a surface: a view of an axis; one across the column of an error of the side vane,
# of the other vane.
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
        nulled=int,  # whose column of `rows.G` the direction is orthogonal to, or AXIS_VIEW
        alarm_axis=int,  # reported with an alarm of this view
        places=(int, 3), col=5,  # the rows that it combines, or -1; g / |g|
        by_force=int,  # whether it sees a force
        confirmer=int,  # force of the views that confirm this one; 0 if no vane is used
        # of this frame: whether the view is used; which share of nu along the column leaks into it
        used=int, leak=float,
        L_rate=3, L_force=3,  # by the rates and by the forces that it combines, 1/s: fill_view_drift
        peak=float,  # largest score, decaying slowly
        block=likelihood.block_dtype(size), tones=tones_dtype(size.max_regressors),
    )  # fmt: skip


@kernel
def turn_view(view, rows, gust):
    """Turn a view across the column g of what it nulls: of a surface, or of an error of a vane.

        m = g x q / |g x q|      col = g / |g|      on the rows i, k, j of `places`

    q: the effect of the rolling gust on i and k, 1/s, or, without a row k, along the place of k. Returns the
    share of the innovation along g that errors e of g let leak into the view, |m|' e / (|g| - |col|' e).
    """
    m, col, c, e, e_col = view.block.m[0], view.col, view.nulled, 0.0, 0.0
    i, k, j = view.places[0], view.places[1], view.places[2]
    g_i, g_k, g_j, q_i, q_k = rows.G[c, i], 0.0, rows.G[c, j], 0.0, 1.0
    if k >= 0:
        L, C = gust.output.rate_damping, gust.output.C
        g_k, q_i, q_k = rows.G[c, k], project_gust(L[i], C, 0), project_gust(L[k], C, 0)
    m_i, m_k, m_j = -g_j * q_k, g_j * q_i, g_i * q_k - g_k * q_i
    norm, norm_m = np.sqrt(g_i * g_i + g_k * g_k + g_j * g_j), np.sqrt(m_i * m_i + m_k * m_k + m_j * m_j)
    if norm_m == 0.0:
        return 0.0
    for r, g_r, m_r in ((i, g_i, m_i), (k, g_k, m_k), (j, g_j, m_j)):
        if r >= 0:
            m[r], col[r] = m_r / norm_m, g_r / norm
            e += abs(m[r]) * rows.e_G[c, r]
            e_col += abs(col[r]) * rows.e_G[c, r]
    return e / max(norm - e_col, MIN_NORM_SHARE * norm)


@kernel
def fill_view_drift(view, q, gust, own, forces, V):
    """Fill the drift of a view, (rad/s2)2/s, at a speed V m/s.

    It is that of a bounded uncertainty, that of the flow angle from inertial motion, and that of the rotation
    of the air, by L_rate = m' L and L_force = sum over the forces of m L_f.

    q: see NOISE_RECORD. gust: the estimate of the views; own: that which this view subtracts, if any.
    """
    b, m, L = view.block, view.block.m, gust.output.rate_damping
    Q_d = q * max(b.eta[0], likelihood.MIN_ETA_RAD_S2) ** 2
    for i, f in enumerate(forces.component):
        Q_d += (view.block.source == INERTIAL) * (m[0, SIDE_FORCE + i] * forces.q_ratio) ** 2 * f.Q_e
    if gust.output.gusty:
        for j in range(3):
            view.L_rate[j] = m[0, 0] * L[0, j] + m[0, 1] * L[1, j] + m[0, 2] * L[2, j]
            view.L_force[j] = 0.0
            for i, f in enumerate(forces.component):
                view.L_force[j] += m[0, SIDE_FORCE + i] * f.L[j] * forces.q_ratio
        Q_d += view_drift(own, V, view.L_rate, view.L_force, view.block.source != RAW and forces.in_use == 1)
        add_turn_to_drift(b, gust)
    b.Q_d[0, 0] = Q_d


@kernel
def project_views(views, noise, rows, forces, gust, vaned, vaneless, V):
    """Bring direction, noise, signatures and regressors of each view to the elapsed frame; V m/s.

    gust, vaned, vaneless: the estimates that are subtracted: rows.py.
    """
    for view in views:
        b = view.block
        view.used = not view.by_force or (forces.in_use and forces.n_seen == MIN_UPDATES)
        if not view.used:
            continue
        of_view = gust if b.source == RAW else vaned
        view.leak = turn_view(view, rows, of_view) if view.nulled != AXIS_VIEW else 0.0
        project_rows(b, rows)
        if view.nulled != AXIS_VIEW and b.n_Z > 0:
            fill_leak(b, rows, view.leak, view.col)
        own = vaneless if b.source >= VANELESS and forces.in_use else of_view
        fill_view_drift(view, noise.q, of_view, own, forces, V)


@kernel
def update_views(views, cfg, c, y, dt, k, latched):
    """Update filter and tests of each view with frame k, as `statistical.update_blocks`; y (5,) measured."""
    inside = within_limits(c, y)
    decay = cfg.forget if latched else 1.0
    slot = likelihood.restarting_slot(k)
    for view in views:
        if not view.used:
            view.peak = 0.0
            continue
        if not latched:
            likelihood.reset_slot(view.block, slot)
        likelihood.update_block(view.block, dt, decay)
        if (
            view.block.source != INERTIAL
        ):  # the error of the integrated angle oscillates with the aircraft's own modes
            update_tones(view.tones, view.block, c, cfg.alarm_level, inside, dt)
        view.peak = max((1.0 - (1.0 - cfg.forget) / PEAK_MEMORY_RATIO) * view.peak, view_score(view))


@kernel
def changes_view(view, forces, s, G):
    """True if a fault of surface s changes the projection of a view; G (3,): its effect on the rates now.

    The column that the view was turned across is that of the frame before, and zero in the first.
    """
    m, effect = view.block.m, 0.0
    for i in range(3):
        effect += m[0, i] * G[i]
    for i, f in enumerate(forces.component):
        effect += m[0, SIDE_FORCE + i] * f.G[s]
    return view.nulled != s and effect != 0.0


@kernel
def view_score(view):
    """The largest score of the tests of a view."""
    score = view.tones.score
    for h in range(view.block.n_h):
        score = max(score, view.block.hypothesis[h].score)
    return score


@kernel
def confirmed_score(view, views, cfg, forces):
    """The score of a view, limited by the views that confirm that it is not an error of a vane.

    A view of the rates alone from which no gust is subtracted needs no confirmation: no error of a vane
    changes the rates alone. Peak scores are compared because the view and its confirmation may reach their
    levels at different times. The confirming view must reach the level of the isolation, sqrt(2 margin).
    """
    if view.by_force and not forces.in_use:
        return 0.0
    if view.block.source != VANED or not forces.in_use:
        return view_score(view)
    peak = 0.0
    for other in views:
        if other.block.source >= VANELESS and other.places[2] == view.confirmer:
            peak = max(peak, other.peak)
    return min(view.peak, peak * cfg.alarm_level / np.sqrt(2.0 * cfg.margin))


@kernel
def view_alarm_score(view, views, cfg, forces, gust):
    """The score with which a view raises the alarm, 0 if it raises none.

    Views raise it only where no block of the rates tests: for an oscillation about an axis, and for a
    force, if accelerometers cannot break.
    """
    if view.nulled == AXIS_VIEW:
        return view.tones.score if view.block.source != INERTIAL else 0.0
    of_force = view.by_force and abs(view.block.m[0, view.places[2]]) > MIN_FORCE_PART
    if of_force and view.block.source == VANED and gust.output.uses_accelerometers == 1:
        return confirmed_score(view, views, cfg, forces)
    return 0.0


@kernel
def views_exclude(views, cfg, forces, s, G):
    """True if a view detects a signal that no fault of surface s, with this column (3,) of G, can cause."""
    for view in views:
        decides = view.block.source < VANELESS and not changes_view(view, forces, s, G)
        if decides and confirmed_score(view, views, cfg, forces) > cfg.alarm_level:
            return True
    return False


class ParityDirection(NamedTuple):
    """A parity direction as it is set up.

    nulled: the surface to whose column it is orthogonal, or VANE_VIEW, or AXIS_VIEW; m_0: at the start of the
    flight; tested_losses: indices of surfaces; by_inertia: the force is that at the flow angle from inertial
    motion.
    """

    nulled: int
    m_0: tuple[float, ...]
    plane_pair: tuple[int, int]
    tested_losses: list[int]
    by_inertia: bool = False
    uses_vane_gust: bool = False  # for the gust estimate in moving air, which has no rolling component


def list_directions(aircraft: Aircraft, with_forces: bool = False) -> Iterator[ParityDirection]:
    """The parity directions of an aircraft: each axis, and in roll and yaw across each surface's column.

    With accelerometers also, in the plane of a rate and its force, across the column of each surface that
    moves both and across that of the vane; and the force at the flow angle from inertial motion.
    """
    pitch = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield ParityDirection(AXIS_VIEW, _unit_sum((PITCH,)), PITCH_PLANE, pitch, uses_vane_gust=True)
    yield ParityDirection(AXIS_VIEW, _unit_sum((ROLL,)), ROLL_YAW_PLANE, lateral)
    yield ParityDirection(AXIS_VIEW, _unit_sum((YAW,)), ROLL_YAW_PLANE, lateral, uses_vane_gust=True)
    for s in lateral:
        rolls = aircraft.dominant_axis[s] == ROLL
        others = [other for other in lateral if other != s]
        yield ParityDirection(s, _unit_sum((ROLL,)), ROLL_YAW_PLANE, others, uses_vane_gust=rolls)
    if not with_forces:
        return
    for i, plane, tested in ((NORMAL_INDEX, PITCH_PLANE, pitch), (SIDE_INDEX, YAW_PLANE, lateral)):
        separable = aircraft.separated_by_force(FORCE_NAMES[i])
        for s in separable:
            pair = aircraft.dominant_axis[s], plane[1]
            yield ParityDirection(s, _unit_sum(pair), pair, [other for other in tested if other != s])
        if separable:
            yield ParityDirection(VANE_VIEW + i, _unit_sum(plane), plane, tested)
            yield ParityDirection(AXIS_VIEW, _unit_sum(plane[1:]), plane, tested, by_inertia=True)


def _unit_sum(ones: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in ones) for i in range(NORMAL_FORCE + 1))


def required_size(aircraft: Aircraft) -> StatisticalSize:
    """The capacities that the records of an aircraft need."""
    directions = list(list_directions(aircraft, aircraft.forces_separate_surfaces))
    n_rate = N_INPUT_READINGS + _largest_block([moment_axis(term) for term in aircraft.moments])
    n_force = (
        max(len(terms_of_force(aircraft, i)) for i in range(2)) + MAX_FORCE_REGRESSORS - MAX_TERMS_OF_ONE
    )
    lost = [aircraft.dominant_axis[aircraft.surfaces.index(name)] for name in aircraft.class_of_losses]
    n_tested = max(len(d.tested_losses) for d in directions)
    error_map = aircraft.file.model_error_map
    n_boxes = len(error_map.boxes) if error_map else 0
    return StatisticalSize(
        BlockCapacity(n_rate, 3 * _largest_block(lost) + 2),
        BlockCapacity(n_rate + n_force + 2, n_tested + 1),
        len(directions),
        n_boxes,
    )


def _largest_block(axes: list[int]) -> int:
    """How many of these axes the block of pitch or that of roll and yaw has, whichever has more."""
    return max(axes.count(PITCH), len(axes) - axes.count(PITCH))


def configure_parity_views(stat: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose rows, blocks and forces are already set up."""
    forces = stat["forces"]
    gusty = bool(stat["gust"]["output"]["gusty"])
    subtracts = forces["in_use"] and gusty and all(aircraft.separated_by_force(name) for name in FORCE_NAMES)
    directions = list(list_directions(aircraft, bool(forces["in_use"])))
    stat["n_views"] = min(len(directions), len(stat["views"]))
    for view, d in zip(stat["views"], directions, strict=False):
        may_alarm = d.nulled == AXIS_VIEW  # and no alarm rests on accelerometers that may break
        vaned = subtracts and d.uses_vane_gust and not (may_alarm and stat["vaned"]["output"]["gusty"])
        _configure_view(view, d, gusty, vaned)
        rates = stat["block"][PITCH_BLOCK if d.plane_pair == PITCH_PLANE else LATERAL_BLOCK]
        _configure_filter(view["block"], d, rates)
        _configure_columns(view, d, rates, stat["rows"], forces)
        _configure_hypotheses(view["block"], d, gusty)


def _configure_view(view: np.void, d: ParityDirection, gusty: bool, vaned: bool) -> None:
    """Fill the rows that a view combines, the axis that its alarm names, and which errors it does not see.

    vaned: whether the gust estimate by vanes is subtracted, although it sees no force.
    """
    is_axis, across_vane, by_force = d.nulled == AXIS_VIEW, d.nulled >= VANE_VIEW, any(d.m_0[SIDE_FORCE:])
    i, j = d.plane_pair
    across_gust = across_vane and d.plane_pair == YAW_PLANE and gusty
    source = VANED if vaned or by_force else RAW
    if d.by_inertia or across_vane:
        source = INERTIAL if d.by_inertia else VANELESS
    view["block"]["source"] = source
    fill(
        view, nulled=d.nulled, by_force=by_force, places=(ROLL, YAW, j) if across_gust else (i, -1, j),
        alarm_axis=d.m_0.index(1.0) if is_axis and not d.by_inertia else i,
        confirmer=(NORMAL_FORCE if j == NORMAL_FORCE else SIDE_FORCE) if by_force or vaned else 0,
    )  # fmt: skip


def _configure_filter(b: np.void, d: ParityDirection, rates: np.void) -> None:
    """Fill direction and filter of a view's block from the block of the rates that the view combines."""
    same = {name: rates[name] for name in ("alarm_level", "noise_share", "eta_rate")}
    fill(b, n=1, a=1.0, Q_scale=1.0, any_position=1, **same)
    b["m"][0], b["P_xx"][0, 0], b["P_dd"][0, 0] = d.m_0, rates["R_y"].max(), likelihood.DRIFT_PRIOR_RAD_S2**2


def _configure_columns(
    view: np.void, d: ParityDirection, rates: np.void, rows: np.void, forces: np.void
) -> None:
    """Fill the regressors that a view sees: those of its rates, of its force, of the flow angle from inertial
    motion, and the leak, which is worked out in flight.
    """
    b, columns = view["block"], list(rates["columns"][: rates["n_Z"]])
    if not columns and not view["by_force"]:
        return
    if view["by_force"]:
        i = d.plane_pair[1] - SIDE_FORCE
        first = int(rows["first"][i])
        columns += range(first, first + int(forces["component"][i]["n_Z"]) + d.by_inertia)
    set_columns(b, rows, columns)
    if d.nulled != AXIS_VIEW:
        b["tol"][b["n_Z"]] = 1.0
        b["n_Z"] += 1


def _configure_hypotheses(b: np.void, d: ParityDirection, gusty: bool) -> None:
    """Fill the hypotheses of a view: a step of its innovation, and a loss of each surface that it tests."""
    # A law that uses the vanes reacts to a gust before the gyros measure its pitching effect, and these
    # views do not use the vanes. The elevator's effect then correlates with the noise: no loss is tested.
    untested = gusty and d.m_0[PITCH]
    lost = [] if untested else list(d.tested_losses[: len(b["hypothesis"]) - 1])
    kinds = [STEP_FAULT, *(LOSS for _ in lost)]
    b["n_h"] = len(kinds)
    hyps = b["hypothesis"][: len(kinds)]
    hyps["kind"], hyps["surface"], hyps["signature"][0, 0] = kinds, [-1, *lost], 1.0
    likelihood.set_signs(b, kinds)
