"""The isolation: hypotheses about the fault, the tests that exclude them, and the decision among them.

Record and configuration come first, then the steps of a frame: the effect of each fault, the tests that
exclude it, and the decision. estimators.py has the estimators and their sets of theta.

Every hypothesis is linear in one unknown parameter per axis, phi_i = h_i + theta_i Z_i:

    loss of effectiveness   h_i = 0         Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                h_i = -G_is u_s Z_i = G_is          theta in the travel, extended to 0

LOSS on aileron, elevator and rudder of the Beaver is the published class. POSITION_HYPOTHESIS states only
that the surface does not follow its command. Its parameter, the deflection in rad, may change in any way, so
it covers every fault of the surface. Both together are `fdi.fault_class: all`; types/ decides which type of
fault it is.

Likelihood ratios exclude a loss of the published class, or confirm it. A confirmed loss is never excluded by
likelihood. A loss that only the end of an undetected earlier loss in pitch could explain is weakly excluded:
it is not isolated.

The sharpened tests (detection/intervals.py, set membership in estimators.py) exclude as well, each by its own
switch. The first test that fails excludes a fault.

Symbols of the kernels:

    nu, nu_max (3,) rad/s2        innovation of the frame and its bound without a fault (filters.py)
    x (3,) rad/s, F (3,) rad/s2   measured rates; mean of f + G u over the elapsed frame
    G (3, n), Gu (3, n)           mean of G, rad/s2 per rad, and effect of each healthy surface, rad/s2
    e_Gu (3, n) rad/s2            error of that mean if a fault changes within the frame
    phi                           effect of a fault, h + theta Z within +- r (EFFECT_RECORD)
    known set                     [theta_min, theta_max], to which the hypothesis limits theta
    interval = (lo, hi)           of theta: without unit for a loss, rad for a position
    s, i, j                       surface, axis, estimator
    iso, fie, bank, bound, emap   records: isolation, estimator, bank, bounds, map of the model's error
    abrupt                        a fault is declared to stay as it is

Words for an estimator: *excluded*, its fault is refuted and no longer a candidate; *weakly excluded* (weak),
its fault may be refuted, so it is not isolated; *pending*, a test has refuted the fault, and the exclusion
waits for the sensor monitor; *confirmed*, its loss has been proved by likelihood.
"""

from collections.abc import Sequence
from math import exp

import numpy as np

from beaver_ftc.aircraft import PITCH, Aircraft, main_surface_index_by_axis
from beaver_ftc.compiled import fill, kernel, record, sized
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.diagnosis.detection import parity, statistical
from beaver_ftc.diagnosis.detection.blocks import LOSS, POSITION_HYPOTHESIS
from beaver_ftc.diagnosis.detection.intervals import advance_reach, is_reachable
from beaver_ftc.diagnosis.error_map import level_of_share, share_used
from beaver_ftc.diagnosis.estimators import (
    DAMAGE_EXCLUDES,
    ESTIMATOR_RECORD,
    INTERVAL_THRESHOLD,
    PUBLISHED_THRESHOLD,
    narrow_sets,
    theta_explains,
    update_residual,
)
from beaver_ftc.diagnosis.sets import explain
from beaver_ftc.scenario.declared import Declared

PITCH_GROUP, LATERAL_GROUP = 0, 1  # groups of surfaces
# Rounds of `widen_error`. Each one multiplies the distance of u from its limit by eG / |Z|, the relative
# error of the surface's effect.
N_ROUNDS = 4


@sized
def layout_dtype(n: int) -> np.dtype:
    """Layout of n surfaces. By surface: its dominant axis; its group (PITCH_GROUP or LATERAL_GROUP); its
    partner, the other surface of a group of two in the aircraft's file, or -1; the numbers of the estimators
    of its loss and of its position, or -1. By axis: the main surface."""
    return record(
        dominant_axis=(int, n), group=(int, n), partner=(int, n), main=(int, 3), loss=(int, n),
        position=(int, n),
    )  # fmt: skip


@sized
def isolation_dtype(n: int) -> np.dtype:
    """The isolation estimators, a loss and a position of each surface at most, and how the decision among
    them is sharpened.

    n_estimators      how many are in use
    mu_kind           of the residual: INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD or CONSTANT_THRESHOLD
    a (3,)            decay per frame of the estimators' filters, by axis
    forget            factor on the information of the least-squares estimate, per frame
    gradient, gain    whether theta is estimated by gradient and not by least squares, and with which gain
    free              whether an estimate may leave the known set
    reach             test: is a residual of the bank within the fault's reach?
    shared            the axes share one theta
    narrows           the sets of a constant theta are intersected over frames
    hold_s            s, for which the only remaining estimator must have been alone before it is isolated
    losable (n,)      whether damage can take a surface
    """
    config = record(
        n_estimators=int, mu_kind=int, forget=float, a=3, reach=int, shared=int, narrows=int, gradient=int,
        gain=float, free=int, hold_s=float, losable=(int, n),
    )  # fmt: skip
    return record(config=config, estimator=(ESTIMATOR_RECORD, 2 * n))


# In 210 flights with damage in still air, the last fault that the damage had left was excluded within 3.2 s.
DAMAGE_HOLD_OFF_S = 4.0
LOSS_RANGE = (-1.0, 0.0)
_THRESHOLD_KINDS = {"interval": INTERVAL_THRESHOLD, "published": PUBLISHED_THRESHOLD}

# An isolation estimator: its name; LOSS or POSITION_HYPOTHESIS; the index of its surface.
EstimatorEntry = tuple[str, int, int]


def list_estimators(fault_class: str, aircraft: Aircraft) -> tuple[EstimatorEntry, ...]:
    """The isolation estimators of a fault class, in the bank's order.

    published: a loss of the surface that leads each axis, and of every other one but the stand-ins
    all: those losses, a loss of each stand-in, and a position of every surface
    """
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    if fault_class == "published":
        return tuple((name, LOSS, index[name]) for name in aircraft.class_of_losses)
    losses = ((name, LOSS, index[name]) for name in (*aircraft.class_of_losses, *aircraft.stand_ins))
    return (*losses, *((f"{name}_position", POSITION_HYPOTHESIS, s) for name, s in index.items()))


def estimator_names(fault_class: str, aircraft: Aircraft) -> tuple[str, ...]:
    """Names of the isolation estimators of a fault class, in the bank's order."""
    return tuple(name for name, _, _ in list_estimators(fault_class, aircraft))


def configure_layout(layout: np.void, rows: Sequence[tuple[str, int, int]], aircraft: Aircraft) -> None:
    """Fill in axes, groups and estimators of the surfaces; rows: (name, kind of hypothesis, surface) of each
    estimator."""
    index = {name: k for k, name in enumerate(aircraft.surfaces)}
    groups = [PITCH_GROUP if axis == PITCH else LATERAL_GROUP for axis in aircraft.dominant_axis]
    fill(
        layout, main=main_surface_index_by_axis(aircraft), dominant_axis=aircraft.dominant_axis,
        group=groups, partner=-1, loss=-1, position=-1,
    )  # fmt: skip
    for names in aircraft.groups.values():
        if len(names) == 2:
            a, b = (index[name] for name in names)
            layout["partner"][[a, b]] = b, a
    for j, (_, kind, s) in enumerate(rows):
        layout["loss" if kind == LOSS else "position"][s] = j


def configure_isolation(
    iso: np.void, declared: Declared, rows: tuple[EstimatorEntry, ...], travel: np.ndarray
) -> None:
    """Fill in the estimators and how the decision among them is sharpened; travel (2, n) rad."""
    config = declared.fdi
    aircraft = declared.aircraft
    dt = 1.0 / declared.rate_hz
    losable = {name for damage in aircraft.damage.values() for name in damage.takes}
    fill(
        iso["config"], n_estimators=len(rows), mu_kind=_THRESHOLD_KINDS[config.thresholds],
        forget=exp(-dt / config.forgetting_time_s), a=exp(-config.isolation_pole_per_s * dt),
        reach=config.sharpen.memory, shared=config.sharpen.shared_effectiveness,
        narrows=config.sharpen.set_membership and not config.pairs,
        hold_s=DAMAGE_HOLD_OFF_S if aircraft.damage else 0.0,
        losable=[name in losable for name in aircraft.surfaces],
    )  # fmt: skip
    # The range of a position contains 0, because a surface that has lost effectiveness acts nearer to 0.
    ends = np.array([np.minimum(travel[0], 0.0), np.maximum(travel[1], 0.0)])
    for fie, (_, kind, s) in zip(iso["estimator"], rows, strict=False):  # the record has room for more
        lo, hi = LOSS_RANGE if kind == LOSS else ends[:, s]
        fill(fie, hypothesis_kind=kind, surface=s, theta_min=lo, theta_max=hi)
        if config.pairs:  # each plane by itself: pitch by its two surfaces, roll and yaw by theirs
            fie["skip"] = (1, 0, 1) if aircraft.dominant_axis[s] == PITCH else (0, 1, 0)
    # Damage is not in the fault class. If the aircraft declares damage and likelihood ratios exclude faults,
    # the damage may be what has excluded the others. So each estimator begins weakly excluded: its fault is
    # isolated only once it is confirmed.
    iso["estimator"]["weak"] = DAMAGE_EXCLUDES if config.weighs_chance and aircraft.damage else 0


@kernel
def own_error(bound, s, i, u, level):
    """max(eG u - eGu, 0) + extra, rad/s2: by how much the error of surface s on axis i at a distance of u rad
    from neutral exceeds the error at its command. extra: of the map of the model's error, at this level.
    """
    return max(bound.eG[i, s] * u - bound.eGu[i, s], 0.0) + bound.extra[level, i]


@kernel
def widen_error(fie, bound, nu, n_substeps):
    """Widen the tolerance of a position by the errors of the surface's own terms at that position:

        r <- r + max(eG (u + first) - eGu, 0) + extra

    eta_bar contains these errors at the commanded position. They grow with u, the largest distance from
    neutral at which the surface can have been. The frame itself gives u, on the axis i of the largest |Z|:

        u = travel;   N_ROUNDS times:   u <- min(u, max |interval of the position with the tolerance at u|)

    Every round gives a valid bound; u is kept as u_far for the next frame. The same holds for a map of the
    model's error, which is for healthy surfaces (`level`).

    If a frame has n substeps, the surface may at the first of them still be where it was a frame before. That
    is taken to be within u_far of neutral. For the mean position p the surface is then further out at the
    other substeps, to make up for the first:  mean |position| <= |p| + first,  first = 2 u_far / n.
    """
    s = fie.surface
    phi = fie.effect
    emap = bound.error_map
    i = 0
    for j in range(1, 3):
        if abs(phi.Z[j]) > abs(phi.Z[i]):
            i = j
    first = 2.0 * fie.u_far / n_substeps if n_substeps > 1 else 0.0
    u = max(abs(fie.theta_min), abs(fie.theta_max))
    e = bound.nu_max[i] + phi.r[i]
    interval = (fie.theta_min, fie.theta_max)
    level = level_near(emap, fie, interval, n_substeps)
    for _ in range(N_ROUNDS):
        e_own = own_error(bound, s, i, u + first, level)
        lo, hi = explain(nu[i] - phi.h[i], e + e_own, phi.Z[i], fie.theta_min, fie.theta_max)
        if lo > hi:
            break
        u = min(u, max(abs(lo), abs(hi)))
        interval = (lo, hi)
        level = level_near(emap, fie, interval, n_substeps)
    fie.u_far = u
    if emap.one_free:
        fie.share_far = share_used(emap, s, interval, fie.share_far, n_substeps)
    for j in range(3):
        phi.r[j] += own_error(bound, s, j, u + first, level)


@kernel
def level_near(emap, fie, interval, n_substeps):
    """The level of the map that covers a surface whose mean position is in the interval, rad; 0 without a
    map."""
    if not emap.one_free:
        return 0
    return level_of_share(emap, share_used(emap, fie.surface, interval, fie.share_far, n_substeps))


@kernel
def add_to_mean(mean, phi, w, begins):
    """mean <- mean + w phi, each an EFFECT_RECORD; w: share of a frame in its block. If the block `begins`
    with this frame, the mean is zero before."""
    if begins:
        mean.h[:] = mean.Z[:] = mean.r[:] = 0.0
    for i in range(3):
        mean.h[i] += w * phi.h[i]
        mean.Z[i] += w * phi.Z[i]
        mean.r[i] += w * phi.r[i]


@kernel
def update_effects(iso, bank, bound, config, detected, G, Gu, e_Gu):
    """Fill the effect phi = h + theta Z, within +- r, of each estimator's fault in the elapsed frame, and
    update its reach in the bank, if a later stage reads them.

        loss of surface s   h = 0, Z = Gu_s        position   h = -Gu_s, Z = G_s        r = e_Gu_s

    If errors of the surfaces' own terms are declared, `widen_error` adds them to r of a position.
    """
    if not (iso.config.reach or config.diagnoses_all_types or detected):
        return
    for fie in iso.estimator[: iso.config.n_estimators]:
        phi = fie.effect
        s = fie.surface
        stuck = fie.hypothesis_kind == POSITION_HYPOTHESIS
        for i in range(3):
            phi.h[i] = -Gu[i, s] if stuck else 0.0
            phi.Z[i] = G[i, s] if stuck else Gu[i, s]
            phi.r[i] = e_Gu[i, s]
        if stuck and (bound.has_eG or bound.error_map.one_free):
            widen_error(fie, bound, bank.output.innovation, config.n_substeps)
        if iso.config.reach:
            advance_reach(bank, fie, config.dt)


@kernel
def fault_possible(iso, fie, bank, nu_max, abrupt, x, before):
    """True if no test that is switched on excludes the fault of estimator fie:

        test                    switched on for
        residual, thresholds    every estimator
        reach                   every estimator, if `reach`
        one theta, one frame    positions, and with `shared` losses too; not in the frame of the alarm
                                unless `reach`
        sets over frames        losses, if `narrows` and abrupt; not in the frame of the alarm

    The tests run in this order, and none runs after one that excludes the fault.
    before: the alarm came a frame or more ago.
    """
    possible = update_residual(fie, iso.config.mu_kind, x)
    if iso.config.reach:
        possible = possible and is_reachable(bank, fie, iso.config.shared)
    if (iso.config.shared or fie.hypothesis_kind == POSITION_HYPOTHESIS) and (before or iso.config.reach):
        possible = possible and theta_explains(fie, bank.output.innovation, nu_max)
    if iso.config.narrows and abrupt and before and fie.hypothesis_kind == LOSS:
        possible = possible and narrow_sets(fie, bank.output.innovation, nu_max, iso.config.shared)
    return possible


@kernel
def exclude_fault(fie, t, waits, in_doubt):
    """Exclude a fault from t s on. If `waits`, the exclusion is pending until the next frame; if `in_doubt`
    (a gyro may be the cause of the alarm), until the doubt is over."""
    if in_doubt or (waits and not fie.pending):
        fie.pending = 1
    elif not fie.excluded:
        fie.excluded = 1
        fie.excluded_at_s = t


@kernel
def decide_isolation(iso, t):
    """The fault isolated at t s by the generalised observer scheme: the one estimator that is not excluded.

    NOT_ISOLATED if several are left; UNANTICIPATED if none is left: the fault is outside the class. A weakly
    excluded estimator is not isolated unless it is confirmed. On an aircraft that declares damage, neither is
    one that has been the only one left for less than `hold_s`.
    """
    n = 0
    remaining = NOT_ISOLATED
    last_exclusion_s = -np.inf
    for j, fie in enumerate(iso.estimator[: iso.config.n_estimators]):
        if fie.excluded:
            last_exclusion_s = max(last_exclusion_s, fie.excluded_at_s)
        else:
            n += 1
            remaining = NOT_ISOLATED if fie.weak and not fie.confirmed else j
    if n == 0:
        return UNANTICIPATED
    return remaining if n == 1 and t - last_exclusion_s >= iso.config.hold_s else NOT_ISOLATED


@kernel
def weigh_views(fie, stat, G):
    """Fill `unlikely` of estimator fie: whether a parity view shows motion that its surface, with this column
    (3,) of G, cannot cause."""
    fie.unlikely = parity.views_exclude(stat, fie.surface, G)


@kernel
def update_likelihood(fie, cfg, blocks, iso, loss_of, abrupt, hidden):
    """Fill `unlikely` of estimator fie; update its `confirmed` and `weak`.

    confirmed    tested if the loss is weakly excluded, or if faults may end; stays once it is set: what
                 contradicts a loss later may be its end
    weak         at least 1 if the likelihood excludes the loss, with no end of a loss in pitch allowed for
    unlikely     whether it excludes the loss also with such an end allowed for; 0 if confirmed

    hidden: a gust may hide an error of a vane from the sensor monitor. An exclusion may then be the effect of
    that error, so all estimators become weakly excluded. cfg, blocks: of the statistical detector; loss_of
    (n,): index of the estimator of each surface's loss.
    """
    fies = iso.estimator
    s = fie.surface
    fie.unlikely = 0
    if not fie.confirmed and (fie.weak or not abrupt):
        fie.confirmed = statistical.confirms_loss(cfg, blocks, fies, loss_of, s)
    if fie.confirmed or not statistical.excludes_loss(cfg, blocks, fies, loss_of, s, False, abrupt):
        return
    fie.unlikely = statistical.excludes_loss(cfg, blocks, fies, loss_of, s, True, abrupt)
    fie.weak = max(fie.weak, 1)
    if fie.unlikely and hidden:
        for other in fies[: iso.config.n_estimators]:
            other.weak = max(other.weak, 1)
