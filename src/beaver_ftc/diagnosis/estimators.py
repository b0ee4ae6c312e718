"""The fault isolation estimators (FIE), and the sets of theta that agree with a frame.

The estimators start at detection:

    xhats' = -Lambdas (xhats - x) + f + G u + h + Zs ths + Oms ths'
    Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step
multiplied by Omega[k+1], the residual of the true estimator is exactly Omega (theta - thetahat) plus the
filtered uncertainty, for any course of the estimate.

Set membership: the parameters theta of a fault that are consistent with the innovation nu on axis i,

    |nu_i - h_i - theta Z_i| <= nu_max_i + r_i

nu, h, Z, nu_max and r are in rad/s2 (Z per unit of theta). One surface has one parameter, so one theta must
be consistent on all axes. For a parameter that may change in any way, no test frame by frame is sharper. For
a constant loss (`fdi.fault_profile: abrupt`) the sets of all frames since the alarm are intersected if
`sharpen.set_membership` is on, unless a second fault may begin later (`fdi.pairs`).

    nu, nu_max (3,) rad/s2        innovation of the frame and its bound without a fault (filters.py)
    x (3,) rad/s, F (3,) rad/s2   measured rates; mean of f + G u over the elapsed frame
    phi                           effect of a fault, h + theta Z within +- r (EFFECT_RECORD): isolation.py
                                  fills it, by the hypothesis
    known set                     [theta_min, theta_max], to which the hypothesis limits theta
    interval = (lo, hi)           of theta: without unit for a loss, rad for a position
    Om, R_pos                     Omega, and the same of the positive part of Z
    B, B_lag rad/s                bound on the filtered uncertainty, and its part with a memory
    th, P                         estimate of theta and its variance
    i, j                          axes
    fie, iso, bound               records: one estimator, the isolation, the bounds
"""

import numpy as np

from beaver_ftc.compiled import copy, kernel, record
from beaver_ftc.diagnosis.detection.filters import advance_bound
from beaver_ftc.diagnosis.detection.intervals import published_interval, residual_interval
from beaver_ftc.diagnosis.sets import explain, intersect
from beaver_ftc.scenario.diagnosis import MAX_POLES

# Of an estimator's `weak` (isolation.py): 0 not weakly excluded; 1 weakly excluded; this value the same,
# because declared damage may have excluded the other estimators.
DAMAGE_EXCLUDES = 2
INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD, CONSTANT_THRESHOLD = 0, 1, 2  # kinds of threshold: isolation.py

# Acceleration by a fault, rad/s2: h + theta Z, within +/- r.
EFFECT_RECORD = record(h=3, Z=3, r=3)

# An isolation estimator: its hypothesis, the tests that exclude it, its estimate.
ESTIMATOR_RECORD = record(
    hypothesis_kind=int, surface=int,
    theta_min=float, theta_max=float,  # the known set of theta
    # skip: whether an axis cannot exclude the fault; residual, its thresholds mu_lo and mu_hi: rad/s
    excluded=int, excluded_at_s=float, pending=int, skip=(int, 3), xhat=3, residual=3, mu_lo=3, mu_hi=3,
    # by likelihood ratios; unlikely: in this frame, of a position by parity views
    confirmed=int, weak=int, unlikely=int,
    # R_pos: as Omega, of the positive part of Z; B, B_lag: rad/s
    # effect: of the frame; mean_effect: of a block of frames (frame_blocks.py)
    Om=3, R_pos=3, B=3, B_lag=3, theta=3, P=3, effect=EFFECT_RECORD,
    mean_effect=EFFECT_RECORD,
    # In the last frame: the largest distance from neutral that the surface's mean position can have had, rad;
    # the largest share of its travel that it can have used.
    u_far=float, share_far=float,
    # test on the residuals of the bank (intervals.py): the parity direction m; the reach, rad/s, by filter,
    # on roll, pitch, yaw and along m
    parity_direction=3, reach_lo=(MAX_POLES, 4), reach_hi=(MAX_POLES, 4),
    set_lo=3, set_hi=3,  # part of the known set that agrees with all frames since the alarm
)  # fmt: skip


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

    The first holds for any course of the estimate th. Its theta are those between (eps + Om th - B) / Om and
    (eps + Om th + B) / Om. The second says nothing on an axis that is skipped.
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
def prior_variance(fie):
    """Variance of a theta that is uniformly distributed over its known set."""
    return (fie.theta_max - fie.theta_min) ** 2 / 12.0


@kernel
def start_estimators(iso, n, x):
    """Start every estimator at the measured x, with the prior variance of theta; n (3,): of `n_gyro`.

    The set of a constant theta is the known one on every axis, or without limits if iso.config.free.
    """
    for fie in iso.estimator[: iso.config.n_estimators]:
        copy(x, fie.xhat)
        copy(n, fie.B_lag)
        fie.P[:] = prior_variance(fie)
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
        lo = fie.theta_min
        hi = fie.theta_max
        Om = fie.Om[i]
        th = fie.theta[i]
        B = fie.B[i]
        mu = -B, B
        if kind == INTERVAL_THRESHOLD:
            mu = residual_interval(lo, hi, fie.R_pos[i], Om - fie.R_pos[i], Om, th, B)
        elif kind == PUBLISHED_THRESHOLD:
            mu = published_interval(lo, hi, Om, th, B)
        fie.mu_lo[i], fie.mu_hi[i] = mu
        within = within and (mu[0] <= fie.residual[i] <= mu[1] or fie.skip[i])
    return within


@kernel
def move_theta(fie, i, th):
    """Move the estimate of theta_i to th, projected onto its set; returns the step."""
    old = fie.theta[i]
    fie.theta[i] = min(max(th, fie.set_lo[i]), fie.set_hi[i])
    return fie.theta[i] - old


@kernel
def least_squares_step(fie, i, eps, forget):
    """One least-squares step of theta_i on a residual eps, rad/s; returns the step.

        S = B^2 + Om^2 P      th <- th + P Om / S eps      P <- min(P B^2 / S / forget, prior)

    forget = exp(-dt / tau), tau s: forgetting_time_s. prior: `prior_variance`. B bounds the filtered
    uncertainty, so the estimate changes no faster than its information allows.
    """
    B2 = fie.B[i] ** 2
    P_Om = fie.P[i] * fie.Om[i]
    S = B2 + fie.Om[i] * P_Om
    if S <= 0.0:
        return 0.0
    fie.P[i] = min(fie.P[i] * B2 / S / forget, prior_variance(fie))
    return move_theta(fie, i, fie.theta[i] + P_Om / S * eps)


@kernel
def joint_least_squares(fie, forget):
    """A least-squares step of one theta shared by the axes, axis after axis: eps_i = residual_i - Om_i total,
    with the steps of the axes before in `total`. An axis with Z = 0 takes no step. Returns the total. P is
    divided by `forget` once a frame."""
    total = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i] = fie.theta[i - 1]
            fie.P[i] = fie.P[i - 1]
        if fie.effect.Z[i] != 0.0:
            total += least_squares_step(fie, i, fie.residual[i] - fie.Om[i] * total, forget)
            forget = 1.0
    fie.theta[:] = fie.theta[2]
    fie.P[:] = fie.P[2]
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
    cfg = iso.config
    phi = fie.effect
    th = fie.theta
    for i in range(3):
        effect = F[i] + phi.h[i] + phi.Z[i] * th[i]
        fie.xhat[i] = x[i] + dt * effect + cfg.a[i] * (fie.xhat[i] - x[i])
    step = joint_least_squares(fie, cfg.forget) if cfg.shared else 0.0
    for i in range(3):
        a = cfg.a[i]
        Z = phi.Z[i]
        if cfg.gradient:
            step = move_theta(fie, i, th[i] + dt * cfg.gain * fie.Om[i] * fie.residual[i])
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
