"""The fault isolation estimators (FIE), their sets of parameters, and the decision among them.

The estimators start at detection:

    xhats' = -Lambdas (xhats - x) + f + G u + base + Zs ths + Oms ths'
    Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step
multiplied by Omega[k+1], the residual of the true estimator is exactly Omega (theta - thetahat) plus the
filtered uncertainty, for any course of the estimate.

Every hypothesis is linear in one unknown parameter per axis, phi_i = base_i + theta_i Z_i:

    loss of effectiveness   base 0          Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                base -G_is u_s  Z_i = G_is          theta in the travel

LOSS on aileron, elevator and rudder is the published class. POSITION states only that the surface does not
follow its command. Its parameter, the deflection in rad, may change in any way, so it covers every fault of
the surface. Both together are `fdi.fault_class: all`; types/ decides which type of fault it is.

Set membership: the parameters theta of a fault that are consistent with the innovation nu on axis i,

    |nu_i - base_i - theta Z_i| <= eta_bar_i

nu, base, Z and eta_bar are in rad/s2 (Z per unit of theta). One surface has one parameter, so one theta must
be consistent on all axes. For a parameter that may change in any way, no test frame by frame is sharper. For
a constant parameter (`fdi.fault_profile: abrupt`) the sets of all frames since the alarm are intersected.

Likelihood ratios exclude a loss of the published class, or confirm it. A confirmed loss is never excluded by
likelihood. A loss that only the end of an undetected earlier loss could explain is weakly excluded: it is not
isolated.

The sharpened tests (detection/filters.py, set membership) exclude as well, each by its own switch. The first
test that fails excludes a fault.
"""

from math import exp

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.bounds import level_covering, travel_share_used
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.filters import (
    advance_reach,
    bound_step,
    interval_limits,
    noise_step,
    norm_limits,
    reach_explains,
)
from beaver_ftc.diagnosis.state import (
    CONSTANT_THRESHOLD,
    DAMAGE_POSSIBLE,
    INTERVAL_THRESHOLD,
    LOSS,
    NOT_ISOLATED,
    PITCH,
    POSITION,
    PUBLISHED_THRESHOLD,
    UNANTICIPATED,
)
from beaver_ftc.scenario.diagnosis import MAX_POLES
from beaver_ftc.scenario.schema import Scenario

EMPTY_SET = (1.0, -1.0)
N_SEARCH_ROUNDS = 4  # each round reduces the remaining travel to the share of it that the tolerance is


@kernel
def is_healthy(innovation, bound):
    """True if the declared uncertainty alone explains an innovation (3,): |nu| <= bound (3,), rad/s2."""
    within = True
    for i in range(3):
        within = within and abs(innovation[i]) <= bound[i]
    return within


@kernel
def consistent_parameters(value, bound, slope, low, high):
    """The theta of [low, high] with |value - theta slope| <= bound, as (low, high); low > high if none."""
    if slope == 0.0:
        return (low, high) if abs(value) <= bound else EMPTY_SET
    one, other = (value - bound) / slope, (value + bound) / slope
    return max(low, min(one, other)), min(high, max(one, other))


@kernel
def consistent_on_axis(innovation, bound, fie, effect, i):
    """The interval of theta that is consistent with an innovation (3,) rad/s2 on axis i.

    It is the whole known set if the axis is ignored. bound (3,) rad/s2: on the innovation without a fault;
    effect: acceleration by the fault, of dtype EFFECT.
    """
    if fie.ignored_axes[i]:
        return fie.low, fie.high
    value, room = innovation[i] - effect.offset[i], bound[i] + effect.spread[i]
    return consistent_parameters(value, room, effect.Z[i], fie.low, fie.high)


@kernel
def largest_axis(Z):
    """The axis on which a regressor Z (3,) is largest."""
    axis = 0
    for i in range(1, 3):
        if abs(Z[i]) > abs(Z[axis]):
            axis = i
    return axis


@kernel
def widen_by_own_errors(fie, bound, innovation, instants):
    """Widen the tolerance of a position by the errors of the surface's own terms at that position.

    eta_bar contains these errors at the commanded position. They grow with the distance from neutral. How far
    the surface can have been follows from the frame itself, in a few rounds from its travel inwards; every
    round gives a valid bound. If a frame has several instants, the surface may still be where it was a frame
    before at the first of them. The same holds for a map of the model's error, which is for healthy surfaces.
    """
    s, effect = fie.surface, fie.effect
    axis = largest_axis(effect.Z)
    before, reach = fie.largest_deflection, max(abs(fie.low), abs(fie.high))
    room, mapped, where = effect.spread[axis], bound.error_map, (fie.low, fie.high)
    level = level_at_position(mapped, fie, where, instants)
    value = innovation[axis] - effect.offset[axis]
    earlier = 2.0 * before / instants if instants > 1 else 0.0
    for _ in range(N_SEARCH_ROUNDS):
        own = max(bound.surface_error_per_rad[axis, s] * (reach + earlier) - bound.own[axis, s], 0.0)
        own += bound.further_error[level, axis]
        low, high = consistent_parameters(
            value, bound.frame[axis] + room + own, effect.Z[axis], fie.low, fie.high
        )
        if low > high:
            break
        reach, where = min(reach, max(abs(low), abs(high))), (low, high)
        level = level_at_position(mapped, fie, where, instants)
    fie.largest_deflection = reach
    if mapped.anywhere:
        fie.travel_share = travel_share_used(mapped, s, where, fie.travel_share, instants)
    for i in range(3):
        effect.spread[i] += max(bound.surface_error_per_rad[i, s] * (reach + earlier) - bound.own[i, s], 0.0)
        effect.spread[i] += bound.further_error[level, i]


@kernel
def level_at_position(mapped, fie, where, instants):
    """The level of the error map that covers a surface at a mean position within `where`, (low, high) rad.

    It is 0 without a map.
    """
    if not mapped.anywhere:
        return 0
    return level_covering(mapped, travel_share_used(mapped, fie.surface, where, fie.travel_share, instants))


@kernel
def is_consistent(fie, innovation, frame_bound):
    """True if one theta, or no fault at all, is consistent with the elapsed frame on every axis."""
    if is_healthy(innovation, frame_bound):
        return True
    low, high = fie.low, fie.high
    for i in range(3):
        axis_low, axis_high = consistent_on_axis(innovation, frame_bound, fie, fie.effect, i)
        low, high = max(low, axis_low), min(high, axis_high)
    return low <= high


@kernel
def start_sets(fie, unprojected):
    """Start with the known set of theta on every axis, or, if `unprojected`, without limits."""
    fie.theta_low[:], fie.theta_high[:] = fie.low, fie.high
    if unprojected:
        fie.theta_low[:], fie.theta_high[:] = -np.inf, np.inf


@kernel
def intersect_sets(fie, i, interval, shared):
    """Intersect the set of theta on axis i, or on every axis if `shared`, with `interval`."""
    low, high = interval
    for j in range(3):
        if shared or j == i:
            fie.theta_low[j] = max(fie.theta_low[j], low)
            fie.theta_high[j] = min(fie.theta_high[j], high)


@kernel
def narrow_sets(fie, innovation, frame_bound, shared):
    """Intersect the set of a constant theta with those of frame and filtered residual; false if it is empty.

    Filtered: eps + Omega thetahat = Omega theta + filtered uncertainty, for any course of the estimate.
    """
    for i in range(3):
        frame = consistent_on_axis(innovation, frame_bound, fie, fie.effect, i)
        intersect_sets(fie, i, frame, shared)
        filtered = fie.residual[i] + fie.omega[i] * fie.theta[i]
        intersect_sets(
            fie, i, consistent_parameters(filtered, fie.bound[i], fie.omega[i], fie.low, fie.high), shared
        )
    left = True
    for i in range(3):
        left = left and fie.theta_low[i] <= fie.theta_high[i]
    return left


@kernel
def set_spread(effect, spread, s):
    """Fill the spread of a fault's effect by that of its surface s; spread (3, n) rad/s2."""
    for i in range(3):
        effect.spread[i] = spread[i, s]


@kernel
def clear_mean_effect(mean):
    """Begin the mean of a fault's effect over a block of frames (dtype EFFECT)."""
    mean.offset[:], mean.Z[:], mean.spread[:] = 0.0, 0.0, 0.0


@kernel
def add_to_mean_effect(mean, effect, share):
    """Add the effect of a frame, a `share` of the block, to the mean over the block."""
    for i in range(3):
        mean.offset[i] += share * effect.offset[i]
        mean.Z[i] += share * effect.Z[i]
        mean.spread[i] += share * effect.spread[i]


# Acceleration by a fault, rad/s2: offset + theta Z, within +/- spread.
EFFECT = record(offset=3, Z=3, spread=3)

ESTIMATOR = record(
    kind=int, surface=int,
    low=float, high=float,  # the known set of theta
    excluded=int, excluded_at_s=float, ignored_axes=(int, 3), xhat=3, residual=3, lower=3, upper=3,
    confirmed=int, weakly_excluded=int, excluded_by_likelihood=int,  # by likelihood ratios
    omega=3, positive_Z=3, negative_Z=3, bound=3, bound_eta=3, bound_noise=3, theta=3, covariance=3,
    effect=EFFECT, block_effect=EFFECT,  # of the frame; mean over a block
    largest_deflection=float, travel_share=float,  # that it can have had: rad; share of its travel
    # reach in the bank (filters.py), and sets
    parity_direction=3, reach_low=(MAX_POLES, 4), reach_high=(MAX_POLES, 4), theta_low=3, theta_high=3,
)  # fmt: skip


@sized
def isolation_dtype(surfaces: int) -> np.dtype:
    """The isolation estimators, a loss and a position of each surface at most, and how the decision among
    them is sharpened. by_gradient: how they adapt, else by least squares; unprojected: their estimates may
    leave the known set. patience_s: for so long the one left is not named yet; taken: surfaces that damage
    may take, besides."""
    config = record(
        n=int, thresholds=int, forgetting=float, decay=3, memory=int, shared=int, membership=int,
        by_gradient=int, gradient=float, unprojected=int, patience_s=float, taken=(int, surfaces),
    )  # fmt: skip
    return record(config=config, estimator=(ESTIMATOR, 2 * surfaces))


NAMING_DELAY_S = 4.0  # in still air what damage left over was excluded within 3.2 s, in 210 flights
PARAMETER_SET = {LOSS: (-1.0, 0.0)}
_THRESHOLDS = {"interval": INTERVAL_THRESHOLD, "published": PUBLISHED_THRESHOLD}

Member = tuple[str, int, int]  # of a fault class: name, kind and surface of its estimator


def members_of(fault_class: str, aircraft: Aircraft) -> tuple[Member, ...]:
    """The isolation estimators of a fault class, in the bank's order.

    published: a loss of the surface that leads each axis, and of what turns with it. all: a loss and a
    position of every surface.
    """
    index = {name: s for s, name in enumerate(aircraft.surfaces)}
    losses = tuple((name, LOSS, index[name]) for name in aircraft.class_of_losses)
    if fault_class == "published":
        return losses
    others = tuple((name, LOSS, s) for name in aircraft.stand_ins for s in [index[name]])
    return (*losses, *others, *((f"{name}_position", POSITION, s) for name, s in index.items()))


def estimator_names(fault_class: str, aircraft: Aircraft) -> tuple[str, ...]:
    """Names of the isolation estimators of a fault class, in the bank's order."""
    return tuple(name for name, _, _ in members_of(fault_class, aircraft))


def configure_isolation(
    isolation: np.void, scenario: Scenario, members: tuple[Member, ...], travel: np.ndarray
) -> None:
    """Fill in the estimators and how the decision among them is sharpened; travel (2, n) rad."""
    config, aircraft, dt = scenario.fdi, scenario.airframe, 1.0 / scenario.rate_hz
    sharpen = config.sharpen
    isolation["config"]["thresholds"] = _THRESHOLDS[config.thresholds]
    isolation["config"]["forgetting"] = exp(-dt / config.forgetting_time_s)
    isolation["config"]["decay"] = exp(-config.isolation_pole_per_s * dt)
    isolation["config"]["memory"], isolation["config"]["shared"] = (
        sharpen.memory,
        sharpen.shared_effectiveness,
    )
    isolation["config"]["membership"], isolation["config"]["n"] = sharpen.set_membership, len(members)
    reach = np.array([np.minimum(travel[0], 0.0), np.maximum(travel[1], 0.0)])  # a share of it can be left
    for fie, (_, kind, surface) in zip(isolation["estimator"], members, strict=False):
        fie["kind"], fie["surface"] = kind, surface
        fie["low"], fie["high"] = PARAMETER_SET[kind] if kind == LOSS else reach[:, surface]
        if config.pairs:  # each plane by itself: pitch by its two surfaces, roll and yaw by theirs
            fie["ignored_axes"] = (1, 0, 1) if aircraft.dominant_axis[surface] == PITCH else (0, 1, 0)
    # Damage is outside the class: with declared damage, the last fault left after statistical exclusion is
    # not isolated yet.
    weakly_excluded = DAMAGE_POSSIBLE if config.weighs_chance and aircraft.damage else 0
    isolation["estimator"]["weakly_excluded"] = weakly_excluded
    isolation["config"]["patience_s"] = NAMING_DELAY_S if aircraft.damage else 0.0
    lost = {surface for case in aircraft.damage.values() for surface in case.takes}
    isolation["config"]["taken"] = [surface in lost for surface in aircraft.surfaces]


@kernel
def fill_hypothesis(kind, surface, G, Gu, base, Z):
    """Fill base (3,) rad/s2 and the regressor Z (3,) rad/s2 per unit of theta, for one fault of `surface`.

    G (3, 4) rad/s2 per rad; Gu (3, 4) rad/s2, the acceleration each commanded surface would give if healthy.
    """
    for i in range(3):
        if kind == POSITION:
            base[i], Z[i] = -Gu[i, surface], G[i, surface]
        else:
            base[i], Z[i] = 0.0, Gu[i, surface]


@kernel
def update_hypothesis(isolation, fie, bank, bound, config, G, Gu, spread):
    """Fill the effect of an estimator's fault in the elapsed frame, and update its reach in the bank.

    G (3, n) rad/s2 per rad; Gu (3, n) rad/s2: effect of each surface; means over the frame. spread (3, n)
    rad/s2: error of the mean if a fault changes within the frame.
    """
    effect = fie.effect
    fill_hypothesis(fie.kind, fie.surface, G, Gu, effect.offset, effect.Z)
    set_spread(effect, spread, fie.surface)
    if (bound.has_surface_errors or bound.error_map.anywhere) and fie.kind == POSITION:
        widen_by_own_errors(fie, bound, bank.output.innovation, config.instants)
    if isolation.config.memory:
        advance_reach(bank, fie, config.dt)


@kernel
def update_hypotheses(isolation, bank, bound, config, detected, G, Gu, spread):
    """`update_hypothesis` for every estimator, where something will ask for it."""
    if isolation.config.memory or config.every_type or detected:
        for fie in isolation.estimator[: isolation.config.n]:
            update_hypothesis(isolation, fie, bank, bound, config, G, Gu, spread)


@kernel
def start_estimators(isolation, noise, x):
    """Start every estimator at the measured x (3,) rad/s, without residual and with the prior of theta.

    noise (3,) rad/s: bound on the change of the gyros' errors.
    """
    for fie in isolation.estimator[: isolation.config.n]:
        fie.xhat[:], fie.bound_noise[:] = x, noise
        fie.covariance[:] = (fie.high - fie.low) ** 2 / 12.0  # of a uniform distribution
        start_sets(fie, isolation.config.unprojected)


@kernel
def update_residual(fie, thresholds, x):
    """Form the residual and its thresholds; true if it is within them on every axis that counts."""
    within = True
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        low, high, omega, theta, bound = fie.low, fie.high, fie.omega[i], fie.theta[i], fie.bound[i]
        if thresholds == INTERVAL_THRESHOLD:
            limits = interval_limits(low, high, fie.positive_Z[i], fie.negative_Z[i], omega, theta, bound)
        elif thresholds == CONSTANT_THRESHOLD:
            limits = -bound, bound
        else:
            limits = norm_limits(low, high, omega, theta, bound)
        fie.lower[i], fie.upper[i] = limits
        within = within and (fie.lower[i] <= fie.residual[i] <= fie.upper[i] or fie.ignored_axes[i])
    return within


@kernel
def is_possible(isolation, fie, bank, frame_bound, abrupt, x, started):
    """True if no test that is switched on excludes the fault of estimator fie.

    frame_bound (3,) rad/s2: on the innovation of a healthy frame; abrupt: a fault is declared to stay as it
    is; x (3,) rad/s: measured; started: the isolation started a frame or more ago.
    """
    can_be = update_residual(fie, isolation.config.thresholds, x)
    if isolation.config.memory:
        can_be = can_be and reach_explains(bank, fie, isolation.config.shared)
    if (isolation.config.shared or fie.kind == POSITION) and (started or isolation.config.memory):
        can_be = can_be and is_consistent(fie, bank.output.innovation, frame_bound)
    if isolation.config.membership and abrupt and started and fie.kind == LOSS:
        can_be = can_be and narrow_sets(fie, bank.output.innovation, frame_bound, isolation.config.shared)
    return can_be


@kernel
def set_isolation_thresholds(isolation, constant):
    """Replace the adaptive thresholds by a constant, rad/s."""
    for fie in isolation.estimator[: isolation.config.n]:
        fie.bound[:] = constant


@kernel
def exclude_fault(fie, t):
    """Exclude a fault from t s on."""
    if not fie.excluded:
        fie.excluded, fie.excluded_at_s = 1, t


@kernel
def decide_isolation(isolation, t):
    """The fault isolated by the generalised observer scheme: the one estimator that is not excluded.

    NOT_ISOLATED if several are left; UNANTICIPATED if none is left: the fault is outside the class. A weakly
    excluded estimator is not isolated unless it is confirmed. On an aircraft that declares damage, neither is
    one that has been the only one left for less than `patience_s`.
    """
    left, last, since_s = 0, NOT_ISOLATED, -np.inf
    for s, fie in enumerate(isolation.estimator[: isolation.config.n]):
        if fie.excluded:
            since_s = max(since_s, fie.excluded_at_s)
        else:
            left += 1
            last = NOT_ISOLATED if fie.weakly_excluded and not fie.confirmed else s
    if t - since_s < isolation.config.patience_s:
        last = NOT_ISOLATED
    return NOT_ISOLATED if left > 1 else (last if left == 1 else UNANTICIPATED)


@kernel
def take_plugin_estimate(isolation, isolated, theta):
    """Replace theta of the isolated estimator, where there is one, by the estimate of a plug-in."""
    if isolated >= 0:
        isolation.estimator[isolated].theta[:] = theta


@kernel
def least_squares_step(fie, i, residual, forgetting, low, high):
    """One least-squares step of thetahat_i on a residual, projected onto [low, high]; returns the step.

    The gain is covariance Omega / (noise + Omega^2 covariance). The noise is the square of the bound on the
    filtered uncertainty, so the estimate changes no faster than its information allows.
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
def gradient_step(fie, i, gain, dt):
    """thetahat' = P{gain Omega eps}, by a step of dt s [Zhang2005, sec. IV]; returns the step."""
    before = fie.theta[i]
    moved = before + dt * gain * fie.omega[i] * fie.residual[i]
    fie.theta[i] = min(max(moved, fie.theta_low[i]), fie.theta_high[i])
    return fie.theta[i] - before


@kernel
def joint_least_squares_step(fie, forgetting):
    """The same for one theta shared by the axes: each axis corrects what the axes before left."""
    total = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i], fie.covariance[i] = fie.theta[i - 1], fie.covariance[i - 1]
        if fie.effect.Z[i] != 0.0:
            left = fie.residual[i] - fie.omega[i] * total
            total += least_squares_step(fie, i, left, forgetting, fie.theta_low[i], fie.theta_high[i])
            forgetting = 1.0  # once a frame
    fie.theta[:], fie.covariance[:] = fie.theta[2], fie.covariance[2]
    return total


@kernel
def predict_estimator(isolation, fie, bound, x, predicted_acceleration, dt):
    """Advance one estimator by a frame.

    x (3,) rad/s: at the start of the frame; predicted_acceleration (3,) rad/s2: mean of f + G u over
    the frame; fie.effect must be that of this frame.
    """
    for i in range(3):
        base, Z, theta, a = fie.effect.offset[i], fie.effect.Z[i], fie.theta[i], isolation.config.decay[i]
        fie.xhat[i] = x[i] + dt * (predicted_acceleration[i] + base + Z * theta) + a * (fie.xhat[i] - x[i])
    adapt_estimate(isolation, fie, dt)
    for i in range(3):
        Z, a = fie.effect.Z[i], isolation.config.decay[i]
        fie.positive_Z[i] = a * fie.positive_Z[i] + dt * max(Z, 0.0)
        fie.negative_Z[i] = a * fie.negative_Z[i] + dt * min(Z, 0.0)
        fie.bound_eta[i] = bound_step(fie.bound_eta[i], bound.eta_bar[i] + fie.effect.spread[i], a, dt)
        fie.bound_noise[i] = noise_step(fie.bound_noise[i], bound.noise_before[i], a)
        fie.bound[i] = fie.bound_eta[i] + fie.bound_noise[i] + bound.noise[i]


@kernel
def adapt_estimate(isolation, fie, dt):
    """Correct the estimate by the residual at the start of the frame, and the prediction by Omega[k+1]."""
    joint = joint_least_squares_step(fie, isolation.config.forgetting) if isolation.config.shared else 0.0
    for i in range(3):
        if isolation.config.by_gradient:
            step = gradient_step(fie, i, isolation.config.gradient, dt)
        elif isolation.config.shared:
            step = joint
        else:
            step = least_squares_step(
                fie, i, fie.residual[i], isolation.config.forgetting, fie.theta_low[i], fie.theta_high[i]
            )
        fie.omega[i] = isolation.config.decay[i] * fie.omega[i] + dt * fie.effect.Z[i]
        fie.xhat[i] += fie.omega[i] * step


@kernel
def predict_estimators(isolation, bound, x, predicted_acceleration, dt):
    """Advance the estimators by a frame; arguments as in `predict_estimator`."""
    for fie in isolation.estimator[: isolation.config.n]:
        predict_estimator(isolation, fie, bound, x, predicted_acceleration, dt)


@kernel
def update_likelihood_exclusion(fie, tests, blocks, isolation, loss_estimator, abrupt, vane_error_can_hide):
    """Fill `excluded_by_likelihood` of estimator fie; update its `confirmed` and `weakly_excluded`.

    vane_error_can_hide: a gust may hide an error of a vane from the sensor monitor. An exclusion may then be
    the effect of that error, so all estimators become weakly excluded. loss_estimator (n,): of each surface;
    abrupt: a fault is declared to stay as it is.
    """
    others, s = isolation.estimator, fie.surface
    fie.excluded_by_likelihood = 0
    if not fie.confirmed and (fie.weakly_excluded or not abrupt):
        fie.confirmed = statistical.confirms_loss(
            tests, blocks, others, loss_estimator, s
        )  # what follows later may be its end
    if fie.confirmed or not statistical.excludes_loss(
        tests, blocks, others, loss_estimator, s, False, abrupt
    ):
        return
    fie.excluded_by_likelihood = statistical.excludes_loss(
        tests, blocks, others, loss_estimator, s, True, abrupt
    )
    fie.weakly_excluded = max(fie.weakly_excluded, 1)
    if fie.excluded_by_likelihood and vane_error_can_hide:
        for other in others[: isolation.config.n]:
            other.weakly_excluded = max(other.weakly_excluded, 1)
