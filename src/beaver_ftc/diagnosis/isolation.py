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

LOSS on aileron, elevator and rudder is the published class. POSITION_HYPOTHESIS states only that the
surface does not follow its command. Its parameter, the deflection in rad, may change in any way, so it
covers every fault of the surface. Both together are `fdi.fault_class: all`; types/ decides which type of
fault it is.

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
from beaver_ftc.diagnosis.bounds import max_travel_share_used, travel_level_index_for_share
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.filters import (
    advance_gyro_error_bound,
    advance_reachable_residuals,
    advance_residual_bound,
    are_residuals_reachable,
    published_threshold_interval,
    residual_interval,
)
from beaver_ftc.diagnosis.state import (
    CONSTANT_THRESHOLD,
    DAMAGE_MAY_HAVE_EXCLUDED_OTHERS,
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

EMPTY_THETA_INTERVAL = (1.0, -1.0)
N_DEFLECTION_BOUND_ITERATIONS = (
    4  # each round reduces the remaining travel to the share of it that the tolerance is
)


@kernel
def uncertainty_explains_innovation(innovation, innovation_bound):
    """True if the declared uncertainty alone explains an innovation (3,): |nu| <= innovation_bound (3,),
    rad/s2."""
    is_within_bound = True
    for i in range(3):
        is_within_bound = is_within_bound and abs(innovation[i]) <= innovation_bound[i]
    return is_within_bound


@kernel
def consistent_theta_interval(measured_effect, error_bound, regressor, theta_min, theta_max):
    """The theta of [theta_min, theta_max] with |measured_effect - theta regressor| <= error_bound, as (low,
    high); low > high if none."""
    if regressor == 0.0:
        return (theta_min, theta_max) if abs(measured_effect) <= error_bound else EMPTY_THETA_INTERVAL
    end_at_lower_effect = (measured_effect - error_bound) / regressor
    end_at_upper_effect = (measured_effect + error_bound) / regressor
    return max(theta_min, min(end_at_lower_effect, end_at_upper_effect)), min(
        theta_max, max(end_at_lower_effect, end_at_upper_effect)
    )


@kernel
def consistent_theta_interval_on_axis(innovation, innovation_bound, fie, fault_effect, axis):
    """The interval of theta that is consistent with an innovation (3,) rad/s2 on axis i.

    It is the whole known set if the axis is ignored. innovation_bound (3,) rad/s2: without a fault;
    fault_effect: acceleration by the fault, of dtype FAULT_EFFECT_RECORD.
    """
    if fie.ignored_axes[axis]:
        return fie.theta_min, fie.theta_max
    measured_effect = innovation[axis] - fault_effect.acceleration_at_zero_theta[axis]
    error_bound = innovation_bound[axis] + fault_effect.error_bound[axis]
    return consistent_theta_interval(
        measured_effect, error_bound, fault_effect.regressor[axis], fie.theta_min, fie.theta_max
    )


@kernel
def axis_of_largest_regressor(regressor):
    """The axis on which a regressor (3,) is largest."""
    axis = 0
    for i in range(1, 3):
        if abs(regressor[i]) > abs(regressor[axis]):
            axis = i
    return axis


@kernel
def bound_deflection_and_widen_error(fie, bound_record, innovation, n_substeps):
    """Widen the tolerance of a position by the errors of the surface's own terms at that position.

    eta_bar contains these errors at the commanded position. They grow with the distance from neutral. How far
    the surface can have been follows from the frame itself, in a few rounds from its travel inwards; every
    round gives a valid bound. If a frame has several substeps, the surface may still be where it was a frame
    before at the first of them. The same holds for a map of the model's error, which is for healthy surfaces.
    """
    s, fault_effect = fie.surface, fie.frame_mean_effect
    axis = axis_of_largest_regressor(fault_effect.regressor)
    last_frame_max_abs_deflection = fie.max_abs_deflection_in_last_frame
    max_abs_deflection = max(abs(fie.theta_min), abs(fie.theta_max))
    error_bound_before_widening = fault_effect.error_bound[axis]
    error_map = bound_record.error_map
    mean_position_interval = (fie.theta_min, fie.theta_max)
    travel_level_index = travel_level_index_at_position(error_map, fie, mean_position_interval, n_substeps)
    measured_effect = innovation[axis] - fault_effect.acceleration_at_zero_theta[axis]
    first_substep_allowance_rad = 2.0 * last_frame_max_abs_deflection / n_substeps if n_substeps > 1 else 0.0
    for _ in range(N_DEFLECTION_BOUND_ITERATIONS):
        extra_error_bound = max(
            bound_record.surface_term_error_bound_per_rad[axis, s]
            * (max_abs_deflection + first_substep_allowance_rad)
            - bound_record.surface_term_error_bound_at_command[axis, s],
            0.0,
        )
        extra_error_bound += bound_record.additional_error_bound_by_travel_level[travel_level_index, axis]
        mean_position_low, mean_position_high = consistent_theta_interval(
            measured_effect,
            bound_record.frame_innovation_bound[axis] + error_bound_before_widening + extra_error_bound,
            fault_effect.regressor[axis],
            fie.theta_min,
            fie.theta_max,
        )
        if mean_position_low > mean_position_high:
            break
        max_abs_deflection = min(max_abs_deflection, max(abs(mean_position_low), abs(mean_position_high)))
        mean_position_interval = (mean_position_low, mean_position_high)
        travel_level_index = travel_level_index_at_position(
            error_map, fie, mean_position_interval, n_substeps
        )
    fie.max_abs_deflection_in_last_frame = max_abs_deflection
    if error_map.one_surface_may_be_anywhere:
        fie.max_travel_share_in_last_frame = max_travel_share_used(
            error_map, s, mean_position_interval, fie.max_travel_share_in_last_frame, n_substeps
        )
    for i in range(3):
        fault_effect.error_bound[i] += max(
            bound_record.surface_term_error_bound_per_rad[i, s]
            * (max_abs_deflection + first_substep_allowance_rad)
            - bound_record.surface_term_error_bound_at_command[i, s],
            0.0,
        )
        fault_effect.error_bound[i] += bound_record.additional_error_bound_by_travel_level[
            travel_level_index, i
        ]


@kernel
def travel_level_index_at_position(error_map, fie, mean_position_interval, n_substeps):
    """The level of the error map that covers a surface whose mean position is in `mean_position_interval`,
    (low, high) rad.

    It is 0 without a map.
    """
    if not error_map.one_surface_may_be_anywhere:
        return 0
    return travel_level_index_for_share(
        error_map,
        max_travel_share_used(
            error_map,
            fie.surface,
            mean_position_interval,
            fie.max_travel_share_in_last_frame,
            n_substeps,
        ),
    )


@kernel
def some_theta_explains_innovation(fie, innovation, innovation_bound):
    """True if one theta, or no fault at all, is consistent with the elapsed frame on every axis."""
    if uncertainty_explains_innovation(innovation, innovation_bound):
        return True
    theta_low, theta_high = fie.theta_min, fie.theta_max
    for i in range(3):
        axis_theta_low, axis_theta_high = consistent_theta_interval_on_axis(
            innovation, innovation_bound, fie, fie.frame_mean_effect, i
        )
        theta_low, theta_high = max(theta_low, axis_theta_low), min(theta_high, axis_theta_high)
    return theta_low <= theta_high


@kernel
def reset_feasible_theta_sets(fie, projection_disabled):
    """Start with the known set of theta on every axis, or, if `projection_disabled`, without limits."""
    fie.feasible_theta_min[:], fie.feasible_theta_max[:] = fie.theta_min, fie.theta_max
    if projection_disabled:
        fie.feasible_theta_min[:], fie.feasible_theta_max[:] = -np.inf, np.inf


@kernel
def intersect_feasible_theta_sets(fie, axis, theta_interval, shared_by_axes):
    """Intersect the set of theta on axis i, or on every axis if `shared_by_axes`, with `theta_interval`."""
    theta_low, theta_high = theta_interval
    for set_axis in range(3):
        if shared_by_axes or set_axis == axis:
            fie.feasible_theta_min[set_axis] = max(fie.feasible_theta_min[set_axis], theta_low)
            fie.feasible_theta_max[set_axis] = min(fie.feasible_theta_max[set_axis], theta_high)


@kernel
def narrow_feasible_theta_sets(fie, innovation, innovation_bound, shared_by_axes):
    """Intersect the set of a constant theta with those of frame and filtered residual; false if it is empty.

    Filtered: eps + Omega thetahat = Omega theta + filtered uncertainty, for any course of the estimate.
    """
    for i in range(3):
        frame_theta_interval = consistent_theta_interval_on_axis(
            innovation, innovation_bound, fie, fie.frame_mean_effect, i
        )
        intersect_feasible_theta_sets(fie, i, frame_theta_interval, shared_by_axes)
        filtered_measured_effect = fie.residual[i] + fie.filtered_regressor[i] * fie.theta[i]
        intersect_feasible_theta_sets(
            fie,
            i,
            consistent_theta_interval(
                filtered_measured_effect,
                fie.filtered_uncertainty_bound[i],
                fie.filtered_regressor[i],
                fie.theta_min,
                fie.theta_max,
            ),
            shared_by_axes,
        )
    is_nonempty = True
    for i in range(3):
        is_nonempty = is_nonempty and fie.feasible_theta_min[i] <= fie.feasible_theta_max[i]
    return is_nonempty


@kernel
def set_effect_error_bound(fault_effect, effect_error_bound, surface_index):
    """Set the error bound of a fault's effect to that of its surface; effect_error_bound (3, n) rad/s2."""
    for i in range(3):
        fault_effect.error_bound[i] = effect_error_bound[i, surface_index]


@kernel
def clear_mean_effect(mean_effect):
    """Begin the mean of a fault's effect over a block of frames (dtype FAULT_EFFECT_RECORD)."""
    mean_effect.acceleration_at_zero_theta[:], mean_effect.regressor[:], mean_effect.error_bound[:] = (
        0.0,
        0.0,
        0.0,
    )


@kernel
def add_frame_to_block_mean_effect(mean_effect, fault_effect, frame_share_of_block):
    """Add the effect of a frame, a `frame_share_of_block` of the block, to the mean over the block."""
    for i in range(3):
        mean_effect.acceleration_at_zero_theta[i] += (
            frame_share_of_block * fault_effect.acceleration_at_zero_theta[i]
        )
        mean_effect.regressor[i] += frame_share_of_block * fault_effect.regressor[i]
        mean_effect.error_bound[i] += frame_share_of_block * fault_effect.error_bound[i]


# Acceleration by a fault, rad/s2: acceleration_at_zero_theta + theta regressor, within +/- error_bound.
FAULT_EFFECT_RECORD = record(acceleration_at_zero_theta=3, regressor=3, error_bound=3)

ISOLATION_ESTIMATOR_RECORD = record(
    hypothesis_kind=int, surface=int,
    theta_min=float, theta_max=float,  # the known set of theta
    excluded=int, excluded_at_s=float, exclusion_is_pending=int, ignored_axes=(int, 3), xhat=3, residual=3,
    lower_threshold=3, upper_threshold=3,
    confirmed_by_likelihood=int, weakly_excluded=int, excluded_by_likelihood=int,  # by likelihood ratios
    # Omega, and the same of the positive and the negative part of Z
    filtered_regressor=3, filtered_positive_regressor=3, filtered_negative_regressor=3,
    filtered_uncertainty_bound=3, filtered_eta_bar=3, filtered_gyro_error_bound=3, theta=3, theta_variance=3,
    frame_mean_effect=FAULT_EFFECT_RECORD, block_mean_effect=FAULT_EFFECT_RECORD,
    # that the surface can have had: rad; share of its travel
    max_abs_deflection_in_last_frame=float, max_travel_share_in_last_frame=float,
    # on the residuals of the bank (filters.py)
    parity_direction=3,
    reachable_bank_residual_low=(MAX_POLES, 4), reachable_bank_residual_high=(MAX_POLES, 4),
    feasible_theta_min=3, feasible_theta_max=3,  # what the frames since the alarm leave of the known set
)  # fmt: skip


@sized
def isolation_dtype(n_surfaces: int) -> np.dtype:
    """The isolation estimators, a loss and a position of each surface at most, and how the decision among
    them is sharpened. adapts_by_gradient: else by least squares; projection_disabled: their estimates may
    leave the known set. isolation_hold_off_s: for so long the one left is not isolated yet."""
    config = record(
        n_estimators=int, threshold_kind=int, forgetting_factor=float, filter_decay=3, uses_reach_test=int,
        shares_theta_across_axes=int, narrows_theta_sets=int,
        adapts_by_gradient=int, gradient_gain=float, projection_disabled=int, isolation_hold_off_s=float,
        can_be_lost_by_damage=(int, n_surfaces),
    )  # fmt: skip
    return record(config=config, estimator=(ISOLATION_ESTIMATOR_RECORD, 2 * n_surfaces))


ISOLATION_HOLD_OFF_IF_DAMAGE_DECLARED_S = (
    4.0  # in still air what damage left over was excluded within 3.2 s, in 210 flights
)
LOSS_THETA_RANGE = (-1.0, 0.0)
_THRESHOLD_KIND_OF_NAME = {"interval": INTERVAL_THRESHOLD, "published": PUBLISHED_THRESHOLD}

EstimatorNameKindSurface = tuple[str, int, int]  # of an isolation estimator; surface: its index


def list_isolation_estimators(fault_class: str, aircraft: Aircraft) -> tuple[EstimatorNameKindSurface, ...]:
    """The isolation estimators of a fault class, in the bank's order.

    published: a loss of the surface that leads each axis, and of what turns with it. all: a loss and a
    position of every surface.
    """
    surface_index_by_name = {name: s for s, name in enumerate(aircraft.surfaces)}
    loss_entries = tuple((name, LOSS, surface_index_by_name[name]) for name in aircraft.class_of_losses)
    if fault_class == "published":
        return loss_entries
    stand_in_surface_loss_entries = tuple(
        (name, LOSS, s) for name in aircraft.stand_ins for s in [surface_index_by_name[name]]
    )
    return (
        *loss_entries,
        *stand_in_surface_loss_entries,
        *((f"{name}_position", POSITION_HYPOTHESIS, s) for name, s in surface_index_by_name.items()),
    )


def estimator_names(fault_class: str, aircraft: Aircraft) -> tuple[str, ...]:
    """Names of the isolation estimators of a fault class, in the bank's order."""
    return tuple(name for name, _, _ in list_isolation_estimators(fault_class, aircraft))


def configure_isolation(
    isolation: np.void,
    declared: Declared,
    estimator_entries: tuple[EstimatorNameKindSurface, ...],
    travel: np.ndarray,
) -> None:
    """Fill in the estimators and how the decision among them is sharpened; travel (2, n) rad."""
    config, aircraft, dt = declared.fdi, declared.aircraft, 1.0 / declared.rate_hz
    sharpening_switches = config.sharpen
    isolation["config"]["threshold_kind"] = _THRESHOLD_KIND_OF_NAME[config.thresholds]
    isolation["config"]["forgetting_factor"] = exp(-dt / config.forgetting_time_s)
    isolation["config"]["filter_decay"] = exp(-config.isolation_pole_per_s * dt)
    isolation["config"]["uses_reach_test"], isolation["config"]["shares_theta_across_axes"] = (
        sharpening_switches.memory,
        sharpening_switches.shared_effectiveness,
    )
    isolation["config"]["narrows_theta_sets"], isolation["config"]["n_estimators"] = (
        sharpening_switches.set_membership,
        len(estimator_entries),
    )
    travel_including_neutral = np.array(
        [np.minimum(travel[0], 0.0), np.maximum(travel[1], 0.0)]
    )  # a share of it can be left
    for fie, (_, hypothesis_kind, surface_index) in zip(
        isolation["estimator"], estimator_entries, strict=False
    ):
        fie["hypothesis_kind"], fie["surface"] = hypothesis_kind, surface_index
        fie["theta_min"], fie["theta_max"] = (
            LOSS_THETA_RANGE if hypothesis_kind == LOSS else travel_including_neutral[:, surface_index]
        )
        if config.pairs:  # each plane by itself: pitch by its two surfaces, roll and yaw by theirs
            fie["ignored_axes"] = (1, 0, 1) if aircraft.dominant_axis[surface_index] == PITCH else (0, 1, 0)
    # Damage is outside the class: with declared damage, the last fault left after statistical exclusion is
    # not isolated yet.
    initial_weak_exclusion = (
        DAMAGE_MAY_HAVE_EXCLUDED_OTHERS if config.weighs_chance and aircraft.damage else 0
    )
    isolation["estimator"]["weakly_excluded"] = initial_weak_exclusion
    isolation["config"]["isolation_hold_off_s"] = (
        ISOLATION_HOLD_OFF_IF_DAMAGE_DECLARED_S if aircraft.damage else 0.0
    )
    surfaces_lost_by_some_damage = {
        surface_name for damage_case in aircraft.damage.values() for surface_name in damage_case.takes
    }
    isolation["config"]["can_be_lost_by_damage"] = [
        surface_name in surfaces_lost_by_some_damage for surface_name in aircraft.surfaces
    ]


@kernel
def fill_effect_of_hypothesis(
    hypothesis_kind, surface_index, G, Gu_by_surface, acceleration_at_zero_theta, regressor
):
    """Fill acceleration_at_zero_theta (3,) rad/s2 and regressor (3,) rad/s2 per unit of theta, for one fault.

    G (3, n) rad/s2 per rad; Gu_by_surface (3, n) rad/s2, the acceleration each commanded surface would give
    if healthy.
    """
    for i in range(3):
        if hypothesis_kind == POSITION_HYPOTHESIS:
            acceleration_at_zero_theta[i], regressor[i] = (
                -Gu_by_surface[i, surface_index],
                G[i, surface_index],
            )
        else:
            acceleration_at_zero_theta[i], regressor[i] = 0.0, Gu_by_surface[i, surface_index]


@kernel
def update_fault_effect_and_reach(
    isolation, fie, filter_bank, bound_record, config, G, Gu_by_surface, effect_error_bound
):
    """Fill the effect of an estimator's fault in the elapsed frame, and update its reach in the bank.

    G (3, n) rad/s2 per rad; Gu_by_surface (3, n) rad/s2: effect of each surface; means over the frame.
    effect_error_bound (3, n) rad/s2: error of the mean if a fault changes within the frame.
    """
    fault_effect = fie.frame_mean_effect
    fill_effect_of_hypothesis(
        fie.hypothesis_kind,
        fie.surface,
        G,
        Gu_by_surface,
        fault_effect.acceleration_at_zero_theta,
        fault_effect.regressor,
    )
    set_effect_error_bound(fault_effect, effect_error_bound, fie.surface)
    if (
        bound_record.has_surface_term_errors or bound_record.error_map.one_surface_may_be_anywhere
    ) and fie.hypothesis_kind == POSITION_HYPOTHESIS:
        bound_deflection_and_widen_error(fie, bound_record, filter_bank.output.innovation, config.n_substeps)
    if isolation.config.uses_reach_test:
        advance_reachable_residuals(filter_bank, fie, config.dt)


@kernel
def update_all_fault_effects_and_reach(
    isolation, filter_bank, bound_record, config, is_detected, G, Gu_by_surface, effect_error_bound
):
    """Call `update_fault_effect_and_reach` for every estimator, if a later stage reads the effects."""
    if isolation.config.uses_reach_test or config.diagnoses_all_types or is_detected:
        for fie in isolation.estimator[: isolation.config.n_estimators]:
            update_fault_effect_and_reach(
                isolation, fie, filter_bank, bound_record, config, G, Gu_by_surface, effect_error_bound
            )


@kernel
def start_estimators(isolation, changing_gyro_error_bound, x):
    """Start every estimator at the measured x (3,) rad/s, without residual and with the prior of theta.

    changing_gyro_error_bound (3,) rad/s: on the changing part of the gyros' errors.
    """
    for fie in isolation.estimator[: isolation.config.n_estimators]:
        fie.xhat[:], fie.filtered_gyro_error_bound[:] = x, changing_gyro_error_bound
        fie.theta_variance[:] = (fie.theta_max - fie.theta_min) ** 2 / 12.0  # of a uniform distribution
        reset_feasible_theta_sets(fie, isolation.config.projection_disabled)


@kernel
def update_residual_and_thresholds(fie, threshold_kind, x):
    """Compute the residual and its thresholds; true if it is within them on every axis not ignored."""
    is_within_thresholds = True
    for i in range(3):
        fie.residual[i] = x[i] - fie.xhat[i]
        theta_min = fie.theta_min
        theta_max = fie.theta_max
        filtered_regressor = fie.filtered_regressor[i]
        theta = fie.theta[i]
        filtered_uncertainty_bound = fie.filtered_uncertainty_bound[i]
        if threshold_kind == INTERVAL_THRESHOLD:
            threshold_interval = residual_interval(
                theta_min,
                theta_max,
                fie.filtered_positive_regressor[i],
                fie.filtered_negative_regressor[i],
                filtered_regressor,
                theta,
                filtered_uncertainty_bound,
            )
        elif threshold_kind == CONSTANT_THRESHOLD:
            threshold_interval = -filtered_uncertainty_bound, filtered_uncertainty_bound
        else:
            threshold_interval = published_threshold_interval(
                theta_min, theta_max, filtered_regressor, theta, filtered_uncertainty_bound
            )
        fie.lower_threshold[i], fie.upper_threshold[i] = threshold_interval
        is_within_thresholds = is_within_thresholds and (
            fie.lower_threshold[i] <= fie.residual[i] <= fie.upper_threshold[i] or fie.ignored_axes[i]
        )
    return is_within_thresholds


@kernel
def update_and_test_if_fault_possible(
    isolation, fie, filter_bank, innovation_bound, fault_is_declared_constant, x, isolation_started_earlier
):
    """True if no test that is switched on excludes the fault of estimator fie.

    innovation_bound (3,) rad/s2: on the innovation of a healthy frame; fault_is_declared_constant: a fault is
    declared to stay as it is; x (3,) rad/s: measured; isolation_started_earlier: it started a frame or more
    ago.
    """
    is_possible = update_residual_and_thresholds(fie, isolation.config.threshold_kind, x)
    if isolation.config.uses_reach_test:
        is_possible = is_possible and are_residuals_reachable(
            filter_bank, fie, isolation.config.shares_theta_across_axes
        )
    if (isolation.config.shares_theta_across_axes or fie.hypothesis_kind == POSITION_HYPOTHESIS) and (
        isolation_started_earlier or isolation.config.uses_reach_test
    ):
        is_possible = is_possible and some_theta_explains_innovation(
            fie, filter_bank.output.innovation, innovation_bound
        )
    if (
        isolation.config.narrows_theta_sets
        and fault_is_declared_constant
        and isolation_started_earlier
        and fie.hypothesis_kind == LOSS
    ):
        is_possible = is_possible and narrow_feasible_theta_sets(
            fie, filter_bank.output.innovation, innovation_bound, isolation.config.shares_theta_across_axes
        )
    return is_possible


@kernel
def set_constant_isolation_thresholds(isolation, constant_threshold_rad_s):
    """Replace the adaptive thresholds by a constant one, rad/s."""
    for fie in isolation.estimator[: isolation.config.n_estimators]:
        fie.filtered_uncertainty_bound[:] = constant_threshold_rad_s


@kernel
def exclude_fault(fie, t, waits_a_frame):
    """Exclude a fault from t s on, or, if `waits_a_frame`, from the next frame on."""
    if waits_a_frame and not fie.exclusion_is_pending:
        fie.exclusion_is_pending = 1
    elif not fie.excluded:
        fie.excluded, fie.excluded_at_s = 1, t


@kernel
def decide_isolation(isolation, t):
    """The fault isolated by the generalised observer scheme: the one estimator that is not excluded.

    NOT_ISOLATED if several are left; UNANTICIPATED if none is left: the fault is outside the class. A weakly
    excluded estimator is not isolated unless it is confirmed. On an aircraft that declares damage, neither is
    one that has been the only one left for less than `isolation_hold_off_s`.
    """
    n_not_excluded, remaining_estimator_index, last_exclusion_s = 0, NOT_ISOLATED, -np.inf
    for estimator_index, fie in enumerate(isolation.estimator[: isolation.config.n_estimators]):
        if fie.excluded:
            last_exclusion_s = max(last_exclusion_s, fie.excluded_at_s)
        else:
            n_not_excluded += 1
            remaining_estimator_index = (
                NOT_ISOLATED if fie.weakly_excluded and not fie.confirmed_by_likelihood else estimator_index
            )
    if t - last_exclusion_s < isolation.config.isolation_hold_off_s:
        remaining_estimator_index = NOT_ISOLATED
    return (
        NOT_ISOLATED
        if n_not_excluded > 1
        else (remaining_estimator_index if n_not_excluded == 1 else UNANTICIPATED)
    )


@kernel
def replace_theta_by_plugin_estimate(isolation, isolated_estimator, theta):
    """Replace theta of the isolated estimator, where there is one, by the estimate of a plug-in."""
    if isolated_estimator >= 0:
        isolation.estimator[isolated_estimator].theta[:] = theta


@kernel
def least_squares_step(fie, axis, rate_residual, forgetting_factor, theta_min, theta_max):
    """One least-squares step of thetahat_i on a residual, rad/s, projected onto [theta_min, theta_max];
    returns the step.

    The gain is covariance Omega / (noise + Omega^2 covariance). The noise is the square of the bound on the
    filtered uncertainty, so the estimate changes no faster than its information allows.
    """
    noise_variance = fie.filtered_uncertainty_bound[axis] ** 2
    variance_times_regressor = fie.theta_variance[axis] * fie.filtered_regressor[axis]
    residual_variance = noise_variance + fie.filtered_regressor[axis] * variance_times_regressor
    if residual_variance <= 0.0:
        return 0.0
    previous_theta = fie.theta[axis]
    fie.theta[axis] = min(
        max(previous_theta + variance_times_regressor / residual_variance * rate_residual, theta_min),
        theta_max,
    )
    prior_variance = (fie.theta_max - fie.theta_min) ** 2 / 12.0
    fie.theta_variance[axis] = min(
        fie.theta_variance[axis] * noise_variance / residual_variance / forgetting_factor, prior_variance
    )
    return fie.theta[axis] - previous_theta


@kernel
def gradient_step(fie, axis, gain, dt):
    """thetahat' = P{gain Omega eps}, by a step of dt s [Zhang2005, sec. IV]; returns the step."""
    previous_theta = fie.theta[axis]
    unprojected_theta = previous_theta + dt * gain * fie.filtered_regressor[axis] * fie.residual[axis]
    fie.theta[axis] = min(max(unprojected_theta, fie.feasible_theta_min[axis]), fie.feasible_theta_max[axis])
    return fie.theta[axis] - previous_theta


@kernel
def joint_least_squares_step(fie, forgetting_factor):
    """A least-squares step of one theta shared by the axes: each axis corrects the residual that the axes
    before left; returns the step."""
    total_step = 0.0
    for i in range(3):
        if i > 0:
            fie.theta[i], fie.theta_variance[i] = fie.theta[i - 1], fie.theta_variance[i - 1]
        if fie.frame_mean_effect.regressor[i] != 0.0:
            unexplained_residual = fie.residual[i] - fie.filtered_regressor[i] * total_step
            total_step += least_squares_step(
                fie,
                i,
                unexplained_residual,
                forgetting_factor,
                fie.feasible_theta_min[i],
                fie.feasible_theta_max[i],
            )
            forgetting_factor = 1.0  # once a frame
    fie.theta[:], fie.theta_variance[:] = fie.theta[2], fie.theta_variance[2]
    return total_step


@kernel
def advance_estimator(isolation, fie, bound_record, x, predicted_acceleration, dt):
    """Advance one estimator by a frame: estimate, predicted rates, and filtered regressor and bounds.

    x (3,) rad/s: at the start of the frame; predicted_acceleration (3,) rad/s2: mean of f + G u over
    the frame; fie.frame_mean_effect must be that of this frame.
    """
    for i in range(3):
        acceleration_at_zero_theta = fie.frame_mean_effect.acceleration_at_zero_theta[i]
        regressor = fie.frame_mean_effect.regressor[i]
        theta = fie.theta[i]
        decay_factor = isolation.config.filter_decay[i]
        fie.xhat[i] = (
            x[i]
            + dt * (predicted_acceleration[i] + acceleration_at_zero_theta + regressor * theta)
            + decay_factor * (fie.xhat[i] - x[i])
        )
    update_theta_regressor_and_xhat(isolation, fie, dt)
    for i in range(3):
        regressor, decay_factor = fie.frame_mean_effect.regressor[i], isolation.config.filter_decay[i]
        fie.filtered_positive_regressor[i] = decay_factor * fie.filtered_positive_regressor[i] + dt * max(
            regressor, 0.0
        )
        fie.filtered_negative_regressor[i] = decay_factor * fie.filtered_negative_regressor[i] + dt * min(
            regressor, 0.0
        )
        fie.filtered_eta_bar[i] = advance_residual_bound(
            fie.filtered_eta_bar[i],
            bound_record.eta_bar[i] + fie.frame_mean_effect.error_bound[i],
            decay_factor,
            dt,
        )
        fie.filtered_gyro_error_bound[i] = advance_gyro_error_bound(
            fie.filtered_gyro_error_bound[i], bound_record.changing_gyro_error_bound_before[i], decay_factor
        )
        fie.filtered_uncertainty_bound[i] = (
            fie.filtered_eta_bar[i]
            + fie.filtered_gyro_error_bound[i]
            + bound_record.changing_gyro_error_bound[i]
        )


@kernel
def update_theta_regressor_and_xhat(isolation, fie, dt):
    """Correct the estimate by the residual at the start of the frame, and the predicted rates by Omega[k+1]
    times the step of the estimate."""
    joint_step = (
        joint_least_squares_step(fie, isolation.config.forgetting_factor)
        if isolation.config.shares_theta_across_axes
        else 0.0
    )
    for i in range(3):
        if isolation.config.adapts_by_gradient:
            theta_step = gradient_step(fie, i, isolation.config.gradient_gain, dt)
        elif isolation.config.shares_theta_across_axes:
            theta_step = joint_step
        else:
            theta_step = least_squares_step(
                fie,
                i,
                fie.residual[i],
                isolation.config.forgetting_factor,
                fie.feasible_theta_min[i],
                fie.feasible_theta_max[i],
            )
        fie.filtered_regressor[i] = (
            isolation.config.filter_decay[i] * fie.filtered_regressor[i]
            + dt * fie.frame_mean_effect.regressor[i]
        )
        fie.xhat[i] += fie.filtered_regressor[i] * theta_step


@kernel
def advance_estimators(isolation, bound_record, x, predicted_acceleration, dt):
    """Advance the estimators by a frame; arguments as in `advance_estimator`."""
    for fie in isolation.estimator[: isolation.config.n_estimators]:
        advance_estimator(isolation, fie, bound_record, x, predicted_acceleration, dt)


@kernel
def update_likelihood_confirmation_and_exclusion(
    fie,
    test_config,
    statistical_filters,
    isolation,
    loss_estimator_of_surface,
    fault_is_declared_constant,
    gust_can_hide_vane_error,
):
    """Fill `excluded_by_likelihood` of estimator fie; update its `confirmed_by_likelihood` and
    `weakly_excluded`.

    gust_can_hide_vane_error: a gust may hide an error of a vane from the sensor monitor. An exclusion may
    then be the effect of that error, so all estimators become weakly excluded. loss_estimator_of_surface
    (n,): index of the estimator; fault_is_declared_constant: a fault is declared to stay as it is.
    """
    all_estimator_records, s = isolation.estimator, fie.surface
    fie.excluded_by_likelihood = 0
    if not fie.confirmed_by_likelihood and (fie.weakly_excluded or not fault_is_declared_constant):
        fie.confirmed_by_likelihood = statistical.confirms_loss(
            test_config, statistical_filters, all_estimator_records, loss_estimator_of_surface, s
        )  # what follows later may be its end
    if fie.confirmed_by_likelihood or not statistical.excludes_loss(
        test_config,
        statistical_filters,
        all_estimator_records,
        loss_estimator_of_surface,
        s,
        False,
        fault_is_declared_constant,
    ):
        return
    fie.excluded_by_likelihood = statistical.excludes_loss(
        test_config,
        statistical_filters,
        all_estimator_records,
        loss_estimator_of_surface,
        s,
        True,
        fault_is_declared_constant,
    )
    fie.weakly_excluded = max(fie.weakly_excluded, 1)
    if fie.excluded_by_likelihood and gust_can_hide_vane_error:
        for estimator_record in all_estimator_records[: isolation.config.n_estimators]:
            estimator_record.weakly_excluded = max(estimator_record.weakly_excluded, 1)
