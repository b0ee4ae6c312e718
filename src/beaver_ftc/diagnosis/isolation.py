"""The fault isolation estimators (FIE), started at detection, and the decision among them.

    xhats' = -Lambdas (xhats - x) + f + G u + base + Zs ths + Oms ths'
    Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step
multiplied by Omega[k+1], the residual of the true estimator is exactly Omega (theta - thetahat) plus the
filtered uncertainty, whatever the estimate does.

The sharpened tests (bank.py, membership.py) exclude beside it, each by its own switch; a fault is excluded
by the first test that fails.
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis import across, bank, membership
from beaver_ftc.diagnosis.fault_class import hypothesis
from beaver_ftc.diagnosis.state import (
    INTERVAL,
    LOSS,
    NOT_ISOLATED,
    POSITION,
    STATISTICS,
    UNANTICIPATED,
    WORST_CASE,
)
from beaver_ftc.diagnosis.statistical import excludes, shows
from beaver_ftc.diagnosis.thresholds import bound_step, interval, noise_step, published
from beaver_ftc.diagnosis.types import examine, pairs, verdict


@kernel
def suppose(fdi, fie, G, Gu, spread):
    """What the fault would have done in the elapsed frame, and to the bank since the flight began.

    G (3, 4) rad/s2 per rad; Gu (3, 4) rad/s2, the contribution of each surface; means over the frame. spread
    (3, 4) rad/s2: by how much the mean can mislead about a fault that changed in the frame.
    """
    effect = fie.effect
    hypothesis(fie.kind, fie.surface, G, Gu, effect.offset, effect.Z)
    for i in range(3):
        effect.spread[i] = spread[i, fie.surface]
    if fdi.bound.own_errors and fie.kind == POSITION:
        membership.allow_for_own_errors(fdi, fie)
    if fdi.isolation.memory:
        bank.remember(fdi, fie)


@kernel
def suppose_all(fdi, G, Gu, spread):
    """`suppose` for every estimator, where something will ask for it."""
    if fdi.isolation.memory or fdi.config.every_type or fdi.verdict.detected:
        for s in range(fdi.isolation.n):
            suppose(fdi, fdi.isolation.estimator[s], G, Gu, spread)


@kernel
def start(fdi, x):
    """Start every estimator at the measured x (3,) rad/s, with no residual and no knowledge of theta."""
    for s in range(fdi.isolation.n):
        fie = fdi.isolation.estimator[s]
        for i in range(3):
            fie.xhat[i] = x[i]
            fie.bound_noise[i] = fdi.bound.noise[i]
            fie.covariance[i] = (fie.high - fie.low) ** 2 / 12.0  # of a uniform distribution
            fie.theta_low[i], fie.theta_high[i] = fie.low, fie.high
    if fdi.config.every_type:
        examine.start(fdi.types)


@kernel
def within_limits(fdi, fie, x):
    """Form the residual and its limits; whether it is within them on every axis."""
    within = True
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        if fdi.isolation.thresholds == INTERVAL:
            fie.lower[i], fie.upper[i] = interval(
                fie.low, fie.high, fie.rise[i], fie.fall[i], fie.omega[i], fie.theta[i], fie.bound[i]
            )
        else:
            fie.lower[i], fie.upper[i] = published(
                fie.low, fie.high, fie.omega[i], fie.theta[i], fie.bound[i]
            )
        within = within and (fie.lower[i] <= fie.residual[i] <= fie.upper[i] or fie.unasked[i])
    return within


@kernel
def possible(fdi, fie, x, started):
    """Whether the fault can be the one, by every test switched on. `started`: a frame or more ago."""
    can_be = within_limits(fdi, fie, x)
    if fdi.isolation.memory:
        can_be = can_be and bank.explains(fdi, fie, fdi.isolation.shared)
    if (fdi.isolation.shared or fie.kind == POSITION) and (started or fdi.isolation.memory):
        can_be = can_be and membership.agree(fdi, fie)
    if fdi.isolation.membership and fdi.config.abrupt and started and fie.kind == LOSS:
        can_be = can_be and membership.narrow(fdi, fie)
    return can_be


@kernel
def rules_out(fdi, fie, within):
    """Whether a fault is excluded by those in authority; `within`: it is possible in the worst case.

    Of faults of every type the sets know the course; chance, which axes are moved. Within the class, chance
    that has raised no alarm has nothing to say about the alarm of the sets.
    """
    if fdi.config.authority == WORST_CASE or (fdi.config.every_type and not within):
        return not within
    if fdi.config.every_type:
        chances, places = fdi.statistical, fdi.layout.position_of
        column = fdi.isolation.estimator[places[fie.surface]].effect.Z
        views = chances.views[: chances.n_views]
        return chances.tests.enabled and across.excludes(
            views, chances.tests, chances.forces, chances.air, fie.surface, column
        )
    if fdi.config.authority != STATISTICS and not within:
        return True
    return (
        fdi.statistical.tests.enabled and fdi.statistical.alarm.detected_at_s >= 0.0 and is_unlikely(fdi, fie)
    )


@kernel
def is_unlikely(fdi, fie):
    """Whether chance excludes a loss of the class. A loss that shows by itself it never does.

    A fault that only the end of a loss that nobody saw would explain is `doubted`. So are all, where a gust
    may hide a vane's error from the watch: what that excludes leaves a surface by accident.
    """
    tests, blocks, others, loss_of, s = (
        fdi.statistical.tests, fdi.statistical.block, fdi.isolation.estimator, fdi.layout.loss_of, fie.surface
    )  # fmt: skip
    if not fie.shown and (fie.doubted or not fdi.config.abrupt):
        fie.shown = shows(tests, blocks, others, loss_of, s)  # later may be its end
    if fie.shown or not excludes(tests, blocks, others, loss_of, s, False, fdi.config.abrupt):
        return False
    fie.doubted = 1
    if not excludes(tests, blocks, others, loss_of, s, True, fdi.config.abrupt):
        return False
    if fdi.watch.enabled and fdi.statistical.air.moving:
        for i in range(fdi.isolation.n):
            others[i].doubted = 1
    return True


@kernel
def decide(fdi, t):
    """The generalised observer scheme: the one left is the fault; none left means it is outside the class.

    One that is doubted and does not show by itself is not named.
    """
    left, last = 0, NOT_ISOLATED
    for s in range(fdi.isolation.n):
        fie = fdi.isolation.estimator[s]
        if not fie.excluded:
            left += 1
            last = NOT_ISOLATED if fie.doubted and not fie.shown else s
    named = NOT_ISOLATED if left > 1 else (last if left == 1 else UNANTICIPATED)
    if named != fdi.verdict.isolated:
        fdi.verdict.isolated = named
        fdi.verdict.isolated_at_s = t


@kernel
def isolate(fdi, x, t, started):
    """Test every estimator against the measured x (3,) rad/s at time t (s), and decide; as `possible`."""
    for s in range(fdi.isolation.n):
        fie = fdi.isolation.estimator[s]
        if rules_out(fdi, fie, possible(fdi, fie, x, started)) and not fie.excluded:
            fie.excluded = 1
            fie.excluded_at_s = t
    if fdi.config.every_type:
        isolate_type(fdi, t, started)
    else:
        decide(fdi, t)


@apart
def isolate_type(fdi, t, started):
    """Of faults of every type, alone or two at a time, decide which it is."""
    types, layout, estimators = fdi.types, fdi.layout, fdi.isolation.estimator
    verdict.note_refuted(types.surface, layout, estimators)
    if types.pair.enabled:
        pairs.examine(types, layout, estimators, fdi.bank, fdi.bound.frame)
        pairs.decide(types, fdi.verdict, layout, t)
        return
    if started or fdi.isolation.memory:
        examine.examine(types, layout, estimators, fdi.bank.innovation, fdi.bound)
    verdict.decide(types, fdi.verdict, layout, estimators, t)


@kernel
def correct(fie, i, residual, forgetting, low, high):
    """One least-squares step of thetahat_i on a residual, projected onto [low, high]; returns the step.

    Gradient along Omega with the gain covariance / (noise + Omega^2 covariance); the noise is the bound on
    the filtered uncertainty, so an estimate moves no faster than its information allows.
    """
    noise = fie.bound[i] ** 2
    gain = fie.covariance[i] * fie.omega[i]
    scale = noise + fie.omega[i] * gain
    if scale <= 0.0:
        return 0.0
    before = fie.theta[i]
    fie.theta[i] = min(max(before + gain / scale * residual, low), high)
    prior = (fie.high - fie.low) ** 2 / 12.0
    fie.covariance[i] = min(fie.covariance[i] * noise / scale / forgetting, prior)
    return fie.theta[i] - before


@kernel
def adapt_jointly(fie, forgetting):
    """The same for one theta shared by the axes, each correcting what those before have left."""
    total = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i], fie.covariance[i] = fie.theta[i - 1], fie.covariance[i - 1]
        if fie.effect.Z[i] != 0.0:
            left = fie.residual[i] - fie.omega[i] * total
            total += correct(fie, i, left, forgetting, fie.theta_low[i], fie.theta_high[i])
            forgetting = 1.0  # once a frame
    for i in range(2):
        fie.theta[i], fie.covariance[i] = fie.theta[2], fie.covariance[2]
    return total


@kernel
def predict(fdi, fie, x, believed):
    """Advance one estimator by a frame.

    x (3,) rad/s as the frame began; believed (3,) rad/s2 is f + G u, mean over the frame; fie.effect is
    already this frame's.
    """
    dt = fdi.config.dt
    for i in range(3):
        base, Z, theta, a = fie.effect.offset[i], fie.effect.Z[i], fie.theta[i], fdi.isolation.decay[i]
        fie.xhat[i] = x[i] + dt * (believed[i] + base + Z * theta) + a * (fie.xhat[i] - x[i])
    adapt(fdi, fie)
    for i in range(3):
        Z, a = fie.effect.Z[i], fdi.isolation.decay[i]
        fie.rise[i] = a * fie.rise[i] + dt * max(Z, 0.0)
        fie.fall[i] = a * fie.fall[i] + dt * min(Z, 0.0)
        fie.bound_eta[i] = bound_step(fie.bound_eta[i], fdi.bound.eta_bar[i] + fie.effect.spread[i], a, dt)
        fie.bound_noise[i] = noise_step(fie.bound_noise[i], fdi.bound.noise_then[i], a)
        fie.bound[i] = fie.bound_eta[i] + fie.bound_noise[i] + fdi.bound.noise[i]


@kernel
def adapt(fdi, fie):
    """Move the estimate by the residual the frame began with, and the prediction along Omega[k+1]."""
    joint = adapt_jointly(fie, fdi.isolation.forgetting) if fdi.isolation.shared else 0.0
    for i in range(3):
        if fdi.isolation.shared:
            step = joint
        else:
            step = correct(
                fie, i, fie.residual[i], fdi.isolation.forgetting, fie.theta_low[i], fie.theta_high[i]
            )
        fie.omega[i] = fdi.isolation.decay[i] * fie.omega[i] + fdi.config.dt * fie.effect.Z[i]
        fie.xhat[i] += fie.omega[i] * step


@kernel
def predict_all(fdi, x, believed):
    """Advance the estimators by a frame; arguments as in `predict`."""
    for s in range(fdi.isolation.n):
        predict(fdi, fdi.isolation.estimator[s], x, believed)
