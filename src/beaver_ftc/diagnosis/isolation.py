"""The fault isolation estimators (FIE), their sets of parameters, and the decision among them.

The kernels stand in this order: set membership of one frame; records and configuration; then what happens in
a frame, which is effect of each fault, tests that exclude it, decision, and estimator.

The estimators start at detection:

    xhats' = -Lambdas (xhats - x) + f + G u + h + Zs ths + Oms ths'
    Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step
multiplied by Omega[k+1], the residual of the true estimator is exactly Omega (theta - thetahat) plus the
filtered uncertainty, for any course of the estimate.

Every hypothesis is linear in one unknown parameter per axis, phi_i = h_i + theta_i Z_i:

    loss of effectiveness   h_i = 0         Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                h_i = -G_is u_s Z_i = G_is          theta in the travel

LOSS on aileron, elevator and rudder is the published class. POSITION_HYPOTHESIS states only that the surface
does not follow its command. Its parameter, the deflection in rad, may change in any way, so it covers every
fault of the surface. Both together are `fdi.fault_class: all`; types/ decides which type of fault it is.

Set membership: the parameters theta of a fault that are consistent with the innovation nu on axis i,

    |nu_i - h_i - theta Z_i| <= nu_max_i + r_i

nu, h, Z, nu_max and r are in rad/s2 (Z per unit of theta). One surface has one parameter, so one theta must
be consistent on all axes. For a parameter that may change in any way, no test frame by frame is sharper. For
a constant loss (`fdi.fault_profile: abrupt`) the sets of all frames since the alarm are intersected, unless a
second fault may begin later (`fdi.pairs`).

Likelihood ratios exclude a loss of the published class, or confirm it. A confirmed loss is never excluded by
likelihood. A loss that only the end of an undetected earlier loss could explain is weakly excluded: it is not
isolated.

The sharpened tests (detection/filters.py, set membership) exclude as well, each by its own switch. The first
test that fails excludes a fault.

Symbols of the kernels:

    nu, nu_max (3,) rad/s2        innovation of the frame and its bound without a fault (filters.py)
    x (3,) rad/s, F (3,) rad/s2   measured rates; mean of f + G u over the elapsed frame
    G (3, n), Gu (3, n)           mean of G, rad/s2 per rad, and effect of each healthy surface, rad/s2
    e_Gu (3, n) rad/s2            error of that mean if a fault changes within the frame
    phi                           effect of a fault, h + theta Z within +- r (EFFECT_RECORD)
    known set                     [theta_min, theta_max], to which the hypothesis limits theta
    interval = (lo, hi)           of theta: without unit for a loss, rad for a position
    Om, R_pos                     Omega, and the same of the positive part of Z
    B, B_lag rad/s                bound on the filtered uncertainty, and its part with a memory
    th, P                         estimate of theta and its variance
    s, i, j                       surface, axis, estimator; in a loop over pairs of axes, j is the second axis
    iso, fie, bank, bound, emap   records: isolation, estimator, bank, bounds, map of the model's error
    abrupt                        a fault is declared to stay as it is

Words for an estimator: *excluded*, its fault is refuted and no longer a candidate; *weakly excluded* (weak),
its fault may be refuted, so it is not isolated; *pending*, a test has refuted the fault, and the exclusion
waits for the sensor monitor; *confirmed*, its loss has been proved by likelihood.
"""

from math import exp

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import fill, kernel, record, sized
from beaver_ftc.diagnosis.detection import parity, statistical
from beaver_ftc.diagnosis.detection.filters import (
    advance_bound,
    advance_reach,
    is_reachable,
    published_interval,
    residual_interval,
)
from beaver_ftc.diagnosis.error_map import level_of_share, share_used
from beaver_ftc.diagnosis.sets import explain, intersect
from beaver_ftc.diagnosis.state import (
    DAMAGE_EXCLUDES,
    INTERVAL_THRESHOLD,
    LOSS,
    NOT_ISOLATED,
    PITCH,
    POSITION_HYPOTHESIS,
    PUBLISHED_THRESHOLD,
    UNANTICIPATED,
)
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import MAX_POLES

# Rounds of `widen_error`. Each one multiplies the distance of u from its limit by eG / |Z|, the relative
# error of the surface's effect.
N_ROUNDS = 4


@kernel
def eta_explains(nu, nu_max):
    """True if the declared uncertainty alone explains an innovation: |nu| <= nu_max."""
    for i in range(3):
        if not abs(nu[i]) <= nu_max[i]:
            return False
    return True


@kernel
def consistent_on(nu, nu_max, fie, phi, i):
    """The interval of theta within the known set with |nu_i - h_i - theta Z_i| <= nu_max_i + r_i; the whole
    known set if axis i is skipped (`fie.skip`): where pairs are diagnosed, a second fault may act on it.
    """
    if fie.skip[i]:
        return fie.theta_min, fie.theta_max
    e = nu_max[i] + phi.r[i]
    return explain(nu[i] - phi.h[i], e, phi.Z[i], fie.theta_min, fie.theta_max)


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

    Every round gives a valid bound. The same holds for a map of the model's error, which is for healthy
    surfaces (`level`).

    If a frame has n substeps, the surface may at the first of them still be where it was a frame before. That
    is taken to be within u_far of neutral. For the mean position p the surface is then further out at the
    other substeps, to make up for the first:  mean |position| <= |p| + first,  first = 2 u_far / n.
    """
    s, phi, emap, i = fie.surface, fie.effect, bound.error_map, 0
    for j in range(1, 3):
        if abs(phi.Z[j]) > abs(phi.Z[i]):
            i = j
    first = 2.0 * fie.u_far / n_substeps if n_substeps > 1 else 0.0
    u, e = max(abs(fie.theta_min), abs(fie.theta_max)), bound.nu_max[i] + phi.r[i]
    interval = (fie.theta_min, fie.theta_max)
    level = level_near(emap, fie, interval, n_substeps)
    for _ in range(N_ROUNDS):
        e_own = own_error(bound, s, i, u + first, level)
        lo, hi = explain(nu[i] - phi.h[i], e + e_own, phi.Z[i], fie.theta_min, fie.theta_max)
        if lo > hi:
            break
        u, interval = min(u, max(abs(lo), abs(hi))), (lo, hi)
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
def consistent_on_axes(nu, nu_max, fie, phi, axis):
    """The interval of theta that is consistent on every axis; if `axis` >= 0, on that axis alone, and on
    those where Z = 0, which exclude the fault or say nothing."""
    interval = fie.theta_min, fie.theta_max
    for i in range(3):
        if axis < 0 or i == axis or phi.Z[i] == 0.0:
            interval = intersect(interval, consistent_on(nu, nu_max, fie, phi, i))
    return interval


@kernel
def theta_explains(fie, nu, nu_max):
    """True if one theta of the known set, or no fault at all, is consistent with the elapsed frame:

        |nu_i - h_i - theta Z_i| <= eta_bar_i + r_i + (n_i[k] + n_i[k-1]) / dt      on every axis i

    eta_bar + (n[k] + n[k-1]) / dt is nu_max (`filters.update_bank`).
    """
    lo, hi = consistent_on_axes(nu, nu_max, fie, fie.effect, -1)
    return lo <= hi or eta_explains(nu, nu_max)


@kernel
def narrow_sets(fie, nu, nu_max, shared):
    """Intersect the sets of a constant theta with what the frame and the filtered residual allow; false if
    one of them is empty. Each axis narrows its own set, or, if `shared`, every axis narrows all three.

        |eps + Om th - Om theta| <= B      |nu - h - theta Z| <= nu_max + r

    The first holds for any course of the estimate th. Its theta are those from (eps + Om th - B) / Om to (eps
    + Om th + B) / Om.
    """
    for i in range(3):
        eps = fie.residual[i] + fie.Om[i] * fie.theta[i]
        interval = explain(eps, fie.B[i], fie.Om[i], fie.theta_min, fie.theta_max)
        interval = intersect(interval, consistent_on(nu, nu_max, fie, fie.effect, i))
        for j in range(3):
            if shared or j == i:
                before = fie.set_lo[j], fie.set_hi[j]
                fie.set_lo[j], fie.set_hi[j] = intersect(before, interval)
    for i in range(3):
        if fie.set_lo[i] > fie.set_hi[i]:
            return False
    return True


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


# Acceleration by a fault, rad/s2: h + theta Z, within +/- r.
EFFECT_RECORD = record(h=3, Z=3, r=3)

# An isolation estimator: its hypothesis, the tests that exclude it, its estimate.
ESTIMATOR_RECORD = record(
    hypothesis_kind=int, surface=int,
    theta_min=float, theta_max=float,  # the known set of theta
    # skip: whether an axis cannot exclude the fault; residual, its thresholds mu_lo and mu_hi: rad/s
    excluded=int, excluded_at_s=float, pending=int, skip=(int, 3), xhat=3, residual=3, mu_lo=3, mu_hi=3,
    confirmed=int, weak=int, unlikely=int,  # by likelihood ratios; unlikely: in this frame
    # R_pos: as Omega, of the positive part of Z; B, B_lag: rad/s
    # effect: of the frame; mean_effect: of a block of frames (examination.py)
    Om=3, R_pos=3, B=3, B_lag=3, theta=3, P=3, effect=EFFECT_RECORD,
    mean_effect=EFFECT_RECORD,
    # In the last frame: the largest distance from neutral that the surface's mean position can have had, rad;
    # the largest share of its travel that it can have used.
    u_far=float, share_far=float,
    # test on the residuals of the bank (filters.py): the parity direction m; the reach, rad/s, by filter, on
    # roll, pitch, yaw and along m
    parity_direction=3, reach_lo=(MAX_POLES, 4), reach_hi=(MAX_POLES, 4),
    set_lo=3, set_hi=3,  # what the frames since the alarm leave of the known set
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

    published: a loss of the surface that leads each axis, and of what turns with it
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


def configure_isolation(
    iso: np.void, declared: Declared, rows: tuple[EstimatorEntry, ...], travel: np.ndarray
) -> None:
    """Fill in the estimators and how the decision among them is sharpened; travel (2, n) rad."""
    config, aircraft, dt = declared.fdi, declared.aircraft, 1.0 / declared.rate_hz
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
def update_effects(iso, bank, bound, config, detected, G, Gu, e_Gu):
    """Fill the effect phi = h + theta Z, within +- r, of each estimator's fault in the elapsed frame, and
    update its reach in the bank, if a later stage reads them.

        loss of surface s   h = 0, Z = Gu_s        position   h = -Gu_s, Z = G_s        r = e_Gu_s
    """
    if not (iso.config.reach or config.diagnoses_all_types or detected):
        return
    for fie in iso.estimator[: iso.config.n_estimators]:
        phi, s, stuck = fie.effect, fie.surface, fie.hypothesis_kind == POSITION_HYPOTHESIS
        for i in range(3):
            phi.h[i] = -Gu[i, s] if stuck else 0.0
            phi.Z[i] = G[i, s] if stuck else Gu[i, s]
            phi.r[i] = e_Gu[i, s]
        if stuck and (bound.has_eG or bound.error_map.one_free):
            widen_error(fie, bound, bank.output.innovation, config.n_substeps)
        if iso.config.reach:
            advance_reach(bank, fie, config.dt)


@kernel
def start_estimators(iso, n, x):
    """Start every estimator at the measured x, with the prior of theta; n (3,): of `n_gyro`.

    The set of a constant theta is the known one on every axis, or without limits if iso.config.free.
    """
    for fie in iso.estimator[: iso.config.n_estimators]:
        fie.xhat[:], fie.B_lag[:] = x, n
        fie.P[:] = (fie.theta_max - fie.theta_min) ** 2 / 12.0  # of a uniform distribution
        fie.set_lo[:] = -np.inf if iso.config.free else fie.theta_min
        fie.set_hi[:] = np.inf if iso.config.free else fie.theta_max


@kernel
def update_residual(fie, kind, x):
    """Fill eps = x - xhat, rad/s, and its thresholds (mu_lo, mu_hi) by `kind`: of `residual_interval`, of
    `published_interval`, or +- B; true if eps is within them on every axis that is not skipped.
    """
    within = True
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        lo, hi, Om, th, B = fie.theta_min, fie.theta_max, fie.Om[i], fie.theta[i], fie.B[i]
        mu = -B, B
        if kind == INTERVAL_THRESHOLD:
            mu = residual_interval(lo, hi, fie.R_pos[i], Om - fie.R_pos[i], Om, th, B)
        elif kind == PUBLISHED_THRESHOLD:
            mu = published_interval(lo, hi, Om, th, B)
        fie.mu_lo[i], fie.mu_hi[i] = mu
        within = within and (mu[0] <= fie.residual[i] <= mu[1] or fie.skip[i])
    return within


@kernel
def fault_possible(iso, fie, bank, nu_max, abrupt, x, started):
    """True if no test that is switched on excludes the fault of estimator fie:

        test                    switched on for
        residual, thresholds    every estimator
        reach                   every estimator, if `reach`
        one theta, one frame    positions, and with `shared` losses too; not in the first frame of the
                                isolation unless `reach`
        sets over frames        losses, if `narrows` and abrupt; not in the first frame

    The tests run in this order, and none runs after one that excludes the fault.
    started: the isolation started a frame or more ago.
    """
    possible = update_residual(fie, iso.config.mu_kind, x)
    if iso.config.reach:
        possible = possible and is_reachable(bank, fie, iso.config.shared)
    if (iso.config.shared or fie.hypothesis_kind == POSITION_HYPOTHESIS) and (started or iso.config.reach):
        possible = possible and theta_explains(fie, bank.output.innovation, nu_max)
    if iso.config.narrows and abrupt and started and fie.hypothesis_kind == LOSS:
        possible = possible and narrow_sets(fie, bank.output.innovation, nu_max, iso.config.shared)
    return possible


@kernel
def exclude_fault(fie, t, waits, in_doubt):
    """Exclude a fault from t s on. If `waits`, the exclusion is pending until the next frame; if `in_doubt`
    (a gyro may be the cause of the alarm), until the doubt is over."""
    if in_doubt or (waits and not fie.pending):
        fie.pending = 1
    elif not fie.excluded:
        fie.excluded, fie.excluded_at_s = 1, t


@kernel
def decide_isolation(iso, t):
    """The fault isolated at t s by the generalised observer scheme: the one estimator that is not excluded.

    NOT_ISOLATED if several are left; UNANTICIPATED if none is left: the fault is outside the class. A weakly
    excluded estimator is not isolated unless it is confirmed. On an aircraft that declares damage, neither is
    one that has been the only one left for less than `hold_s`.
    """
    n, remaining, last_exclusion_s = 0, NOT_ISOLATED, -np.inf
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
def least_squares_step(fie, i, eps, forget):
    """One least-squares step of theta_i on a residual eps, rad/s, projected onto its set; returns the step.

        S = B^2 + Om^2 P      th <- th + P Om / S eps      P <- min(P B^2 / S / forget, prior)

    forget = exp(-dt / tau), tau s: forgetting_time_s. prior: the variance (theta_max - theta_min)^2 / 12 of a
    uniform theta. B bounds the filtered uncertainty, so the estimate changes no faster than its information
    allows.
    """
    th, B2, P_Om = fie.theta[i], fie.B[i] ** 2, fie.P[i] * fie.Om[i]
    S = B2 + fie.Om[i] * P_Om
    if S <= 0.0:
        return 0.0
    fie.theta[i] = min(max(th + P_Om / S * eps, fie.set_lo[i]), fie.set_hi[i])
    fie.P[i] = min(fie.P[i] * B2 / S / forget, (fie.theta_max - fie.theta_min) ** 2 / 12.0)
    return fie.theta[i] - th


@kernel
def joint_least_squares(fie, forget):
    """A least-squares step of one theta shared by the axes, axis after axis: eps_i = residual_i - Om_i total,
    with the steps of the axes before in `total`. Returns the total. P is divided by `forget` once a frame."""
    total = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i], fie.P[i] = fie.theta[i - 1], fie.P[i - 1]
        if fie.effect.Z[i] != 0.0:
            total += least_squares_step(fie, i, fie.residual[i] - fie.Om[i] * total, forget)
            forget = 1.0
    fie.theta[:], fie.P[:] = fie.theta[2], fie.P[2]
    return total


@kernel
def advance_estimator(iso, fie, bound, x, F, dt):
    """Advance one estimator by a frame: estimate, predicted rates, and filtered Z and bounds.

        Om <- a Om + dt Z      R_pos <- a R_pos + dt max(Z, 0)      R_neg = Om - R_pos
        xhat <- x + dt (F + h + Z th) + a (xhat - x) + Om step
        B_lag <- a B_lag + dt (eta_bar + r) + (1 - a) n_old         B = B_lag + n
        th <- P{th + dt gain Om eps} by gradient [Zhang2005, sec. IV], or by least squares

    B_lag = B_eta + T_n; step: that of th (Delta in isolation.md). x is measured at the start of the frame, as
    is the residual eps; fie.effect must be that of this frame. The order matters: th moves before Om, which
    then carries the step into xhat.
    """
    cfg, phi, th = iso.config, fie.effect, fie.theta
    for i in range(3):
        effect = F[i] + phi.h[i] + phi.Z[i] * th[i]
        fie.xhat[i] = x[i] + dt * effect + cfg.a[i] * (fie.xhat[i] - x[i])
    step = joint_least_squares(fie, cfg.forget) if cfg.shared else 0.0
    for i in range(3):
        a, Z = cfg.a[i], phi.Z[i]
        if cfg.gradient:
            old = th[i]
            th[i] = min(max(old + dt * cfg.gain * fie.Om[i] * fie.residual[i], fie.set_lo[i]), fie.set_hi[i])
            step = th[i] - old
        elif not cfg.shared:
            step = least_squares_step(fie, i, fie.residual[i], cfg.forget)
        fie.Om[i] = a * fie.Om[i] + dt * Z
        fie.R_pos[i] = a * fie.R_pos[i] + dt * max(Z, 0.0)
        fie.xhat[i] += fie.Om[i] * step
        fie.B_lag[i] = advance_bound(fie.B_lag[i], bound.eta_bar[i] + phi.r[i], a, dt, bound.n_old[i])
        fie.B[i] = fie.B_lag[i] + bound.n_gyro[i]


@kernel
def advance_estimators(iso, bound, x, F, dt):
    """Advance the estimators by a frame; arguments as in `advance_estimator`."""
    for fie in iso.estimator[: iso.config.n_estimators]:
        advance_estimator(iso, fie, bound, x, F, dt)


@kernel
def weigh_views(fie, views, cfg, forces, G):
    """Fill `unlikely` of estimator fie: whether a parity view shows motion that its surface, with this column
    (3,) of G, cannot cause."""
    fie.unlikely = parity.views_exclude(views, cfg, forces, fie.surface, G)


@kernel
def update_likelihood(fie, cfg, blocks, iso, loss_of, abrupt, hidden):
    """Fill `unlikely` of estimator fie; update its `confirmed` and `weak`.

    confirmed    stays once it is set: what contradicts a loss later may be its end
    weak         at least 1 if the likelihood excludes the loss, with no end of a loss in pitch allowed for
    unlikely     whether it excludes the loss also with such an end allowed for

    hidden: a gust may hide an error of a vane from the sensor monitor. An exclusion may then be the effect of
    that error, so all estimators become weakly excluded. cfg, blocks: of the statistical detector; loss_of
    (n,): index of the estimator of each surface's loss.
    """
    fies, s = iso.estimator, fie.surface
    fie.unlikely = 0
    if not fie.confirmed and (fie.weak or not abrupt):
        # a confirmed loss stays: what contradicts it later may be its end
        fie.confirmed = statistical.confirms_loss(cfg, blocks, fies, loss_of, s)
    if fie.confirmed or not statistical.excludes_loss(cfg, blocks, fies, loss_of, s, False, abrupt):
        return
    fie.unlikely = statistical.excludes_loss(cfg, blocks, fies, loss_of, s, True, abrupt)
    fie.weak = max(fie.weak, 1)
    if fie.unlikely and hidden:
        for other in fies[: iso.config.n_estimators]:
            other.weak = max(other.weak, 1)
