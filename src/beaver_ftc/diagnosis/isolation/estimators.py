"""The fault isolation estimators (FIE), started at detection, and the decision among them.

    xhats' = -Lambdas (xhats - x) + f + G u + base + Zs ths + Oms ths'
    Oms' = -Lambdas Oms + Zs,  Oms(Td) = 0

[Zhang2005, sec. IV]. In discrete time, with Omega[k+1] = a Omega[k] + dt Z[k] and the estimate's step
multiplied by Omega[k+1], the residual of the true estimator is exactly Omega (theta - thetahat) plus the
filtered uncertainty, whatever the estimate does.

Every hypothesis is linear in one unknown parameter per axis, phi_i = base_i + theta_i Z_i:

    loss of effectiveness   base 0          Z_i = G_is u_s      theta in [-1, 0]       [Zhang2005, eq. (4)]
    position                base -G_is u_s  Z_i = G_is          theta in the travel

LOSS on aileron, elevator and rudder is the published class. POSITION states only that the surface does not
follow its command. Its parameter, the deflection in rad, may change in any way, so it covers every fault of
the surface. Both together are `fdi.fault_class: all`; types/ decides which type of fault it is.

The sharpened tests (bank.py, membership.py) exclude as well, each by its own switch. The first test that
fails excludes a fault.
"""

from math import exp

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.detection.bank import explains, remember
from beaver_ftc.diagnosis.detection.thresholds import bound_step, interval, noise_step, published
from beaver_ftc.diagnosis.isolation import membership
from beaver_ftc.diagnosis.state import (
    BESIDE_DAMAGE,
    CONSTANT,
    INTERVAL,
    LOSS,
    NOT_ISOLATED,
    PITCH,
    POSITION,
    PUBLISHED,
    UNANTICIPATED,
)
from beaver_ftc.scenario.diagnosis import MAX_POLES
from beaver_ftc.scenario.schema import Scenario

# Acceleration by a fault, rad/s2: offset + theta Z, within +/- spread.
EFFECT = record(offset=3, Z=3, spread=3)

ESTIMATOR = record(
    kind=int, surface=int,
    low=float, high=float,  # the known set of theta
    excluded=int, excluded_at_s=float, ignored_axes=(int, 3), xhat=3, residual=3, lower=3, upper=3,
    confirmed=int, weakly_excluded=int, excluded_by_likelihood=int,  # by_chance.py
    omega=3, rise=3, fall=3, bound=3, bound_eta=3, bound_noise=3, theta=3, covariance=3,
    effect=EFFECT, block_effect=EFFECT,  # of the frame; mean over a block
    furthest=float, used=float,  # rad from neutral, share of its travel, where it can have been in the frame
    # what bank.py and membership.py keep
    across=3, reach_low=(MAX_POLES, 4), reach_high=(MAX_POLES, 4), theta_low=3, theta_high=3,
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


PATIENCE_S = 4.0  # in still air what damage left over was excluded within 3.2 s, in 210 flights
PARAMETER_SET = {LOSS: (-1.0, 0.0)}
_THRESHOLDS = {"interval": INTERVAL, "published": PUBLISHED}

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


def configure(
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
    # Damage is outside the class: what is merely left when chance has excluded the others is not yet at
    # fault.
    doubted = BESIDE_DAMAGE if config.weighs_chance and aircraft.damage else 0
    isolation["estimator"]["weakly_excluded"] = doubted
    isolation["config"]["patience_s"] = PATIENCE_S if aircraft.damage else 0.0
    lost = {surface for case in aircraft.damage.values() for surface in case.takes}
    isolation["config"]["taken"] = [surface in lost for surface in aircraft.surfaces]


@kernel
def hypothesis(kind, surface, G, Gu, base, Z):
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
    hypothesis(fie.kind, fie.surface, G, Gu, effect.offset, effect.Z)
    membership.set_spread(effect, spread, fie.surface)
    if (bound.own_errors or bound.error_map.anywhere) and fie.kind == POSITION:
        membership.allow_for_own_errors(fie, bound, bank.output.innovation, config.instants)
    if isolation.config.memory:
        remember(bank, fie, config.dt)


@kernel
def update_hypotheses(isolation, bank, bound, config, detected, G, Gu, spread):
    """`update_hypothesis` for every estimator, where something will ask for it."""
    if isolation.config.memory or config.every_type or detected:
        for fie in isolation.estimator[: isolation.config.n]:
            update_hypothesis(isolation, fie, bank, bound, config, G, Gu, spread)


@kernel
def start(isolation, noise, x):
    """Start every estimator at the measured x (3,) rad/s, without residual and with the prior of theta.

    noise (3,) rad/s: bound on the change of the gyros' errors.
    """
    for fie in isolation.estimator[: isolation.config.n]:
        fie.xhat[:], fie.bound_noise[:] = x, noise
        fie.covariance[:] = (fie.high - fie.low) ** 2 / 12.0  # of a uniform distribution
        membership.start(fie, isolation.config.unprojected)


@kernel
def within_limits(fie, thresholds, x):
    """Form the residual and its thresholds; true if it is within them on every axis that counts."""
    within = True
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        low, high, omega, theta, bound = fie.low, fie.high, fie.omega[i], fie.theta[i], fie.bound[i]
        if thresholds == INTERVAL:
            limits = interval(low, high, fie.rise[i], fie.fall[i], omega, theta, bound)
        elif thresholds == CONSTANT:
            limits = -bound, bound
        else:
            limits = published(low, high, omega, theta, bound)
        fie.lower[i], fie.upper[i] = limits
        within = within and (fie.lower[i] <= fie.residual[i] <= fie.upper[i] or fie.ignored_axes[i])
    return within


@kernel
def possible(isolation, fie, bank, frame_bound, abrupt, x, started):
    """True if no test that is switched on excludes the fault of estimator fie.

    frame_bound (3,) rad/s2: on the innovation of a healthy frame; abrupt: a fault is declared to stay as it
    is; x (3,) rad/s: measured; started: the isolation started a frame or more ago.
    """
    can_be = within_limits(fie, isolation.config.thresholds, x)
    if isolation.config.memory:
        can_be = can_be and explains(bank, fie, isolation.config.shared)
    if (isolation.config.shared or fie.kind == POSITION) and (started or isolation.config.memory):
        can_be = can_be and membership.agree(fie, bank.output.innovation, frame_bound)
    if isolation.config.membership and abrupt and started and fie.kind == LOSS:
        can_be = can_be and membership.narrow(
            fie, bank.output.innovation, frame_bound, isolation.config.shared
        )
    return can_be


@kernel
def hold_thresholds(isolation, constant):
    """Replace the adaptive thresholds by a constant, rad/s."""
    for fie in isolation.estimator[: isolation.config.n]:
        fie.bound[:] = constant


@kernel
def exclude(fie, t):
    """Exclude a fault from t s on."""
    if not fie.excluded:
        fie.excluded, fie.excluded_at_s = 1, t


@kernel
def decide(isolation, t):
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
def take_estimate(isolation, isolated, theta):
    """Replace theta of the isolated estimator, where there is one, by the estimate of a plug-in."""
    if isolated >= 0:
        isolation.estimator[isolated].theta[:] = theta


@kernel
def correct(fie, i, residual, forgetting, low, high):
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
def descend(fie, i, gain, dt):
    """thetahat' = P{gain Omega eps}, by a step of dt s [Zhang2005, sec. IV]; returns the step."""
    before = fie.theta[i]
    moved = before + dt * gain * fie.omega[i] * fie.residual[i]
    fie.theta[i] = min(max(moved, fie.theta_low[i]), fie.theta_high[i])
    return fie.theta[i] - before


@kernel
def adapt_jointly(fie, forgetting):
    """The same for one theta shared by the axes: each axis corrects what the axes before left."""
    total = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i], fie.covariance[i] = fie.theta[i - 1], fie.covariance[i - 1]
        if fie.effect.Z[i] != 0.0:
            left = fie.residual[i] - fie.omega[i] * total
            total += correct(fie, i, left, forgetting, fie.theta_low[i], fie.theta_high[i])
            forgetting = 1.0  # once a frame
    fie.theta[:], fie.covariance[:] = fie.theta[2], fie.covariance[2]
    return total


@kernel
def predict(isolation, fie, bound, x, believed, dt):
    """Advance one estimator by a frame.

    x (3,) rad/s: at the start of the frame; believed (3,) rad/s2: mean of f + G u over the frame; fie.effect
    must be that of this frame.
    """
    for i in range(3):
        base, Z, theta, a = fie.effect.offset[i], fie.effect.Z[i], fie.theta[i], isolation.config.decay[i]
        fie.xhat[i] = x[i] + dt * (believed[i] + base + Z * theta) + a * (fie.xhat[i] - x[i])
    adapt(isolation, fie, dt)
    for i in range(3):
        Z, a = fie.effect.Z[i], isolation.config.decay[i]
        fie.rise[i] = a * fie.rise[i] + dt * max(Z, 0.0)
        fie.fall[i] = a * fie.fall[i] + dt * min(Z, 0.0)
        fie.bound_eta[i] = bound_step(fie.bound_eta[i], bound.eta_bar[i] + fie.effect.spread[i], a, dt)
        fie.bound_noise[i] = noise_step(fie.bound_noise[i], bound.noise_then[i], a)
        fie.bound[i] = fie.bound_eta[i] + fie.bound_noise[i] + bound.noise[i]


@kernel
def adapt(isolation, fie, dt):
    """Correct the estimate by the residual at the start of the frame, and the prediction by Omega[k+1]."""
    joint = adapt_jointly(fie, isolation.config.forgetting) if isolation.config.shared else 0.0
    for i in range(3):
        if isolation.config.by_gradient:
            step = descend(fie, i, isolation.config.gradient, dt)
        elif isolation.config.shared:
            step = joint
        else:
            step = correct(
                fie, i, fie.residual[i], isolation.config.forgetting, fie.theta_low[i], fie.theta_high[i]
            )
        fie.omega[i] = isolation.config.decay[i] * fie.omega[i] + dt * fie.effect.Z[i]
        fie.xhat[i] += fie.omega[i] * step


@kernel
def predict_all(isolation, bound, x, believed, dt):
    """Advance the estimators by a frame; arguments as in `predict`."""
    for fie in isolation.estimator[: isolation.config.n]:
        predict(isolation, fie, bound, x, believed, dt)
