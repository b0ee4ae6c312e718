"""The worst-case detector: a bank of filters of the innovation with adaptive thresholds, and the FDAE.

    nu[k] = (x[k+1] - x[k]) / dt - F[k] = eta[k] + phi[k]
    E_m[k+1] = a_m E_m[k] + dt nu[k],   a_m = exp(-lam_m dt)

All filters are exact for the discrete truth x[k+1] = x[k] + dt (F[k] + eta[k]): a residual obeys eps[k+1] = a
eps[k] + dt eta[k], and its bound obeys the same with eta_bar in place of eta. The guarantees of the theory
therefore hold at any frame rate, without an allowance for discretisation.

Every filter has the exact bound of its own pole, so the alarm is the first of theirs without further false
alarms. A pole far above the frame rate (`DEADBEAT_PER_S`) tests the innovation itself, |nu| > eta_bar; for a
bound that holds instant by instant no filter, window or sum of innovations can alarm earlier (detection.md,
"The guarantees"). Slower poles detect more if errors are correlated over frames, as measurement errors are.
The reach of a fault is its possible effect on the filters since the start of the flight.

The fault detection and approximation estimator (FDAE) is always on:

    xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat,  eps0 = x - xhat0,  alarm when |eps0_i| > ebar_i, some i

[Zhang2005, sec. IV]. Until the alarm eps0 is filter 0 of the bank, which raises it. In discrete time
xhat0[k+1] = x[k] + dt F[k] + exp(-Lambda0 dt) (xhat0[k] - x[k]).

Its network approximates the fault by Gaussian radial basis functions of alpha and of beta, linear in its
weights:

    fhat_i = W_i^T Phi(alpha, beta)       W_i' = P{gain Phi D[eps_i] - leak W_i},   |Phi| = 1

[Zhang2005, sec. IV and V]. Phi is normalised, so that `gain` alone sets the bandwidth of learning at any
state. D is a continuous dead zone at the detection threshold: the network cannot learn what the declared
uncertainty explains.
"""

from math import exp

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.bounds import detection_poles_for_delays
from beaver_ftc.diagnosis.state import STATISTICAL_DETECTOR, WORST_CASE_DETECTOR
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import MAX_POLES, FdiConfig


@kernel
def advance_residual_bound(residual_bound, eta_bar, decay_factor, dt):
    """Advance ebar' = -lam ebar + eta_bar by one frame [Zhang2005, sec. IV].

    Units: bound rad/s, eta_bar rad/s2, decay = exp(-lam dt), dt s.
    """
    return decay_factor * residual_bound + dt * eta_bar


@kernel
def advance_gyro_error_bound(filtered_gyro_error_bound, changing_gyro_error_bound, decay_factor):
    """Advance the filtered bound on a gyro's changing error, rad/s, by one frame.

    changing_gyro_error_bound: nbar of bounds.py at the start of the frame, rad/s. An error of the gyro adds
    at most the filtered bound plus the present nbar to a residual.
    """
    return decay_factor * filtered_gyro_error_bound + (1.0 - decay_factor) * changing_gyro_error_bound


@kernel
def residual_interval(
    theta_min,
    theta_max,
    filtered_positive_Z,
    filtered_negative_Z,
    filtered_Z,
    theta_estimate,
    uncertainty_bound,
):
    """The signed interval (low, high), rad/s, that holds the residual of the true estimator.

    The parameter may move anywhere within [theta_min, theta_max] at every instant, so an incipient or
    intermittent fault is covered. With Z+ and Z- the filtered positive and negative part of Z, the filtered
    Z theta lies between theta_min Z+ + theta_max Z- and theta_max Z+ + theta_min Z-. The residual is this
    effect minus Omega thetahat, plus or minus the bound on the uncertainty.
    """
    residual_low = (
        theta_min * filtered_positive_Z
        + theta_max * filtered_negative_Z
        - filtered_Z * theta_estimate
        - uncertainty_bound
    )
    residual_high = (
        theta_max * filtered_positive_Z
        + theta_min * filtered_negative_Z
        - filtered_Z * theta_estimate
        + uncertainty_bound
    )
    return residual_low, residual_high


@kernel
def published_threshold_interval(theta_min, theta_max, filtered_Z, theta_estimate, uncertainty_bound):
    """The norm bound mu = k |Omega| + bound, rad/s, symmetric; k bounds |theta - thetahat| [Zhang2005, via
    Zhang2002].
    """
    published_threshold = (
        max(theta_estimate - theta_min, theta_max - theta_estimate) * abs(filtered_Z) + uncertainty_bound
    )
    return -published_threshold, published_threshold


# The bank of detection filters; filter 0 is the published one. decay_factor: a_m; residual, threshold and its
# parts rad/s; innovation rad/s2; max_residual_over_threshold_so_far: of residual over threshold, in healthy
# flight.
BANK_CONFIG_RECORD = record(n_filters=int, decay_factor=MAX_POLES)
BANK_MEMORY_RECORD = record(
    threshold_uncertainty_part=(MAX_POLES, 3), threshold_gyro_error_part=(MAX_POLES, 3)
)
BANK_OUTPUT_RECORD = record(
    innovation=3,
    residual=(MAX_POLES, 3),
    threshold=(MAX_POLES, 3),
    max_residual_over_threshold_so_far=MAX_POLES,
)
BANK_RECORD = record(config=BANK_CONFIG_RECORD, memory=BANK_MEMORY_RECORD, output=BANK_OUTPUT_RECORD)


def filter_poles_per_s(config: FdiConfig, declared: Declared) -> tuple[float, ...]:
    """The filters' poles, 1/s, the published one first."""
    poles_for_noise_per_s = detection_poles_for_delays(declared.sensors, max(declared.constant_rad_s2))
    poles_after_published_per_s = (
        (*config.pole_bank_per_s, *poles_for_noise_per_s) if config.sharpen.pole_bank else ()
    )
    return (config.detection_pole_per_s, *poles_after_published_per_s)[:MAX_POLES]


def fill_bank_decay_factors(filter_bank: np.void, config: FdiConfig, declared: Declared, dt: float) -> None:
    """Fill in the filters' poles: those of the scenario, and those that noise asks for."""
    poles_per_s = filter_poles_per_s(config, declared)
    filter_bank["config"]["n_filters"] = len(poles_per_s)
    filter_bank["config"]["decay_factor"][: len(poles_per_s)] = [
        exp(-pole_per_s * dt) for pole_per_s in poles_per_s
    ]


@kernel
def start_bank_gyro_error_bounds(filter_bank, changing_gyro_error_bound):
    """Start with the full bound on the changing part of the gyros' errors, changing_gyro_error_bound (3,)
    rad/s."""
    filter_bank.memory.threshold_gyro_error_part[: filter_bank.config.n_filters] = changing_gyro_error_bound


@kernel
def set_constant_published_filter_threshold(filter_bank, threshold):
    """Replace the threshold of the published filter by a constant, rad/s."""
    filter_bank.output.threshold[0] = threshold


@kernel
def set_estimator_parity_directions(isolation, G):
    """Fix, once, the direction along which each fault has least effect; G (3, n) at the start of the flight.

    Unit length, in the roll-yaw plane, whose two axes are the only ones that one surface moves together.
    The bound is exact for any fixed direction; this one has power while G keeps its direction, which
    depends on alpha alone, and weakly.
    """
    for fie in isolation.estimator[: isolation.config.n_estimators]:
        roll_acceleration_per_rad, yaw_acceleration_per_rad = G[0, fie.surface], G[2, fie.surface]
        roll_yaw_column_norm = np.hypot(roll_acceleration_per_rad, yaw_acceleration_per_rad)
        if roll_yaw_column_norm > 0.0:
            fie.parity_direction[0] = yaw_acceleration_per_rad / roll_yaw_column_norm
            fie.parity_direction[2] = -roll_acceleration_per_rad / roll_yaw_column_norm


@kernel
def update_innovation_and_filter_bank(filter_bank, bound_record, x, x_before, predicted_acceleration, dt):
    """Form the innovation of the elapsed frame and pass it through the bank.

    x, x_before (3,) rad/s: measured now and a frame ago; predicted_acceleration (3,) rad/s2: f + G u of the
    healthy aircraft, mean over the frame. bound_record: of `bound_dtype`; dt s.
    """
    for i in range(3):
        filter_bank.output.innovation[i] = (x[i] - x_before[i]) / dt - predicted_acceleration[i]
        bound_record.frame_innovation_bound[i] = (
            bound_record.eta_bar[i]
            + (bound_record.changing_gyro_error_bound[i] + bound_record.changing_gyro_error_bound_before[i])
            / dt
        )
        for m, decay_factor in enumerate(filter_bank.config.decay_factor[: filter_bank.config.n_filters]):
            filter_bank.output.residual[m, i] = (
                decay_factor * filter_bank.output.residual[m, i] + dt * filter_bank.output.innovation[i]
            )
            filter_bank.memory.threshold_uncertainty_part[m, i] = advance_residual_bound(
                filter_bank.memory.threshold_uncertainty_part[m, i], bound_record.eta_bar[i], decay_factor, dt
            )
            filter_bank.memory.threshold_gyro_error_part[m, i] = advance_gyro_error_bound(
                filter_bank.memory.threshold_gyro_error_part[m, i],
                bound_record.changing_gyro_error_bound_before[i],
                decay_factor,
            )
            filter_bank.output.threshold[m, i] = (
                filter_bank.memory.threshold_uncertainty_part[m, i]
                + filter_bank.memory.threshold_gyro_error_part[m, i]
                + bound_record.changing_gyro_error_bound[i]
            )


@kernel
def bank_alarm_axis(filter_bank):
    """The first axis on which a filter of the bank leaves its bound, or -1."""
    for i in range(3):
        for m in range(filter_bank.config.n_filters):
            if abs(filter_bank.output.residual[m, i]) > filter_bank.output.threshold[m, i]:
                return i
    return -1


@kernel
def residual_threshold_ratio(filter_bank, m, i):
    """The share of its bound that filter m reaches on axis i."""
    threshold = filter_bank.output.threshold[m, i]
    return abs(filter_bank.output.residual[m, i]) / threshold if threshold > 0.0 else 0.0


@kernel
def filter_nearest_to_alarm(filter_bank, i):
    """The filter that is nearest to its bound on axis i: the one the alarm comes from, if there is one."""
    nearest_filter_index, max_ratio = 0, 0.0
    for m in range(filter_bank.config.n_filters):
        ratio = residual_threshold_ratio(filter_bank, m, i)
        if ratio > max_ratio:
            nearest_filter_index, max_ratio = m, ratio
    return nearest_filter_index


@kernel
def max_residual_threshold_ratio(filter_bank):
    """The largest share of its bound that a filter of the bank reaches."""
    max_ratio = 0.0
    for m in range(filter_bank.config.n_filters):
        for i in range(3):
            max_ratio = max(max_ratio, residual_threshold_ratio(filter_bank, m, i))
    return max_ratio


@kernel
def update_max_residual_ratio_by_filter(filter_bank):
    """Keep the largest share of its bound that each filter has reached."""
    for m in range(filter_bank.config.n_filters):
        for i in range(3):
            filter_bank.output.max_residual_over_threshold_so_far[m] = max(
                filter_bank.output.max_residual_over_threshold_so_far[m],
                residual_threshold_ratio(filter_bank, m, i),
            )


@kernel
def fault_acceleration_range(fie, i):
    """Least and greatest acceleration (rad/s2) of axis i: theta anywhere in its set, or no fault at all."""
    acceleration_at_zero_theta = fie.frame_mean_effect.acceleration_at_zero_theta[i]
    acceleration_per_theta = fie.frame_mean_effect.regressor[i]
    error_bound = fie.frame_mean_effect.error_bound[i]
    acceleration_at_theta_min = acceleration_at_zero_theta + fie.theta_min * acceleration_per_theta
    acceleration_at_theta_max = acceleration_at_zero_theta + fie.theta_max * acceleration_per_theta
    acceleration_low = min(0.0, acceleration_at_theta_min, acceleration_at_theta_max) - error_bound
    acceleration_high = max(0.0, acceleration_at_theta_min, acceleration_at_theta_max) + error_bound
    return acceleration_low, acceleration_high


@kernel
def fault_acceleration_range_along_parity(fie):
    """Least and greatest acceleration, rad/s2, along `fie.parity_direction` (3,); else as
    `fault_acceleration_range`."""
    frame_mean_effect_record = fie.frame_mean_effect
    acceleration_at_zero_theta = 0.0
    acceleration_per_theta = 0.0
    error_bound = 0.0
    for i in range(3):
        error_bound += abs(fie.parity_direction[i]) * frame_mean_effect_record.error_bound[i]
        acceleration_at_zero_theta += (
            fie.parity_direction[i] * frame_mean_effect_record.acceleration_at_zero_theta[i]
        )
        acceleration_per_theta += fie.parity_direction[i] * frame_mean_effect_record.regressor[i]
    acceleration_at_theta_min = acceleration_at_zero_theta + fie.theta_min * acceleration_per_theta
    acceleration_at_theta_max = acceleration_at_zero_theta + fie.theta_max * acceleration_per_theta
    acceleration_low = min(0.0, acceleration_at_theta_min, acceleration_at_theta_max) - error_bound
    acceleration_high = max(0.0, acceleration_at_theta_min, acceleration_at_theta_max) + error_bound
    return acceleration_low, acceleration_high


@kernel
def advance_reachable_residuals(filter_bank, fie, dt):
    """Advance the reach of the fault in each filter since the flight began; index 3: `parity_direction`."""
    for axis_or_parity in range(4):
        acceleration_low, acceleration_high = (
            fault_acceleration_range(fie, axis_or_parity)
            if axis_or_parity < 3
            else fault_acceleration_range_along_parity(fie)
        )
        for m, decay_factor in enumerate(filter_bank.config.decay_factor[: filter_bank.config.n_filters]):
            fie.reachable_bank_residual_low[m, axis_or_parity] = (
                decay_factor * fie.reachable_bank_residual_low[m, axis_or_parity] + dt * acceleration_low
            )
            fie.reachable_bank_residual_high[m, axis_or_parity] = (
                decay_factor * fie.reachable_bank_residual_high[m, axis_or_parity] + dt * acceleration_high
            )


@kernel
def are_residuals_reachable(filter_bank, fie, axes_share_theta):
    """True if the residuals are within the reach of the fault, for any course of it since the flight began.

    axes_share_theta: the axes share one parameter; the residual along `parity_direction` is then tested as
    well.
    """
    for m in range(filter_bank.config.n_filters):
        parity_residual, parity_threshold = 0.0, 0.0
        for i in range(3):
            residual, threshold = filter_bank.output.residual[m, i], filter_bank.output.threshold[m, i]
            if (
                not fie.reachable_bank_residual_low[m, i] - threshold
                <= residual
                <= fie.reachable_bank_residual_high[m, i] + threshold
                and not fie.ignored_axes[i]
            ):
                return False
            parity_residual += fie.parity_direction[i] * residual
            parity_threshold += abs(fie.parity_direction[i]) * threshold
        if (
            axes_share_theta
            and not fie.reachable_bank_residual_low[m, 3] - parity_threshold
            <= parity_residual
            <= fie.reachable_bank_residual_high[m, 3] + parity_threshold
        ):
            return False
    return True


# Centres of the network's basis functions, rad; and its record. learning_gain 1/s2, weight_limit rad/s2;
# output: fhat, rad/s2.
ALPHA_CENTRES_RAD = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES_RAD = np.linspace(-0.3, 0.3, 5)
N_ALPHA_PLUS_BETA_CENTRES = len(ALPHA_CENTRES_RAD) + len(BETA_CENTRES_RAD)
FDAE_NETWORK_RECORD = record(
    config=record(learning_gain=float, leak_per_s=float, weight_limit=float),
    memory=record(weights=(3, N_ALPHA_PLUS_BETA_CENTRES), basis_values=N_ALPHA_PLUS_BETA_CENTRES),
    output=3,
)

# decay_factor: a. xhat: the estimate of the rates, rad/s; threshold_uncertainty_part,
# threshold_gyro_error_part rad/s: parts of the threshold. residual, threshold rad/s.
FDAE_CONFIG_RECORD = record(pole_per_s=3, decay_factor=3)
FDAE_MEMORY_RECORD = record(xhat=3, threshold_uncertainty_part=3, threshold_gyro_error_part=3)
FDAE_OUTPUT_RECORD = record(residual=3, threshold=3)
FDAE_RECORD = record(
    config=FDAE_CONFIG_RECORD,
    memory=FDAE_MEMORY_RECORD,
    output=FDAE_OUTPUT_RECORD,
    network=FDAE_NETWORK_RECORD,
)

_RATIO_OF_SUCCESSIVE_GAUSSIAN_RATIOS = np.exp(-1.0)
_N_ALPHA_CENTRES, _N_BETA_CENTRES = len(ALPHA_CENTRES_RAD), len(BETA_CENTRES_RAD)
_FIRST_ALPHA_CENTRE_RAD = ALPHA_CENTRES_RAD[0]
_ALPHA_CENTRE_SPACING_RAD = ALPHA_CENTRES_RAD[1] - ALPHA_CENTRES_RAD[0]
_FIRST_BETA_CENTRE_RAD = BETA_CENTRES_RAD[0]
_BETA_CENTRE_SPACING_RAD = BETA_CENTRES_RAD[1] - BETA_CENTRES_RAD[0]


def configure_fdae(fdae: np.void, declared: Declared) -> None:
    """Fill in the estimator's pole, and how its network learns."""
    control_config, network = declared.control, fdae["network"]
    fdae["config"]["pole_per_s"] = declared.fdi.detection_pole_per_s
    fdae["config"]["decay_factor"] = exp(-declared.fdi.detection_pole_per_s * (1.0 / declared.rate_hz))
    network["config"]["learning_gain"] = control_config.network_gain_per_s2
    network["config"]["leak_per_s"] = control_config.network_leak_per_s
    network["config"]["weight_limit"] = control_config.network_weight_limit_rad_s2


@kernel
def fill_gaussians_and_sum_squares(axis_position, n_gaussians, first_index, out):
    """Fill out from first_index on with exp(-(axis_position - j)^2 / 2), j = 0, 1, ...; return the sum of
    their squares.

    The ratio of a value and the one before is exp(axis_position - j - 1/2). The ratio of two successive
    ratios is 1 / e. So two exponentials are enough for all values.
    """
    gaussian = np.exp(-0.5 * axis_position * axis_position)
    next_gaussian_ratio = np.exp(axis_position - 0.5)
    sum_of_squares = 0.0
    for j in range(n_gaussians):
        out[first_index + j] = gaussian
        sum_of_squares += gaussian * gaussian
        gaussian *= next_gaussian_ratio
        next_gaussian_ratio *= _RATIO_OF_SUCCESSIVE_GAUSSIAN_RATIOS
    return sum_of_squares


@kernel
def fill_normalised_gaussians(alpha, beta, out):
    """Fill out (N_ALPHA_PLUS_BETA_CENTRES,) with the normalised radial basis functions at (alpha, beta), rad.

    Each width equals the spacing of its centres; outside the grid the nearest edge answers.
    """
    alpha_grid_position = min(
        max((alpha - _FIRST_ALPHA_CENTRE_RAD) / _ALPHA_CENTRE_SPACING_RAD, 0.0), _N_ALPHA_CENTRES - 1.0
    )
    beta_grid_position = min(
        max((beta - _FIRST_BETA_CENTRE_RAD) / _BETA_CENTRE_SPACING_RAD, 0.0), _N_BETA_CENTRES - 1.0
    )
    concatenated_gaussian_norm = np.sqrt(
        fill_gaussians_and_sum_squares(alpha_grid_position, _N_ALPHA_CENTRES, 0, out)
        + fill_gaussians_and_sum_squares(beta_grid_position, _N_BETA_CENTRES, _N_ALPHA_CENTRES, out)
    )
    for j in range(N_ALPHA_PLUS_BETA_CENTRES):
        out[j] /= concatenated_gaussian_norm


@kernel
def signed_excess_over_threshold(residual, threshold):
    """D[eps]: zero inside the threshold, the excess over it outside."""
    if residual > threshold:
        return residual - threshold
    if residual < -threshold:
        return residual + threshold
    return 0.0


@kernel
def evaluate_network(network, alpha, beta):
    """Fill network.output (3,) rad/s2 for the present alpha and beta."""
    fill_normalised_gaussians(alpha, beta, network.memory.basis_values)
    for i in range(3):
        fhat_i = 0.0
        for j in range(N_ALPHA_PLUS_BETA_CENTRES):
            fhat_i += network.memory.weights[i, j] * network.memory.basis_values[j]
        network.output[i] = fhat_i


@kernel
def train_network(network, residual, threshold, do_weights_leak, dt):
    """Advance the weights by one frame; residual and threshold (3,) rad/s, dt s.

    do_weights_leak: the weights decay, because another estimate explains the fault.
    """
    leak_factor = np.exp(-network.config.leak_per_s * dt) if do_weights_leak else 1.0
    weight_limit = network.config.weight_limit
    for i in range(3):
        learning_step_beyond_threshold = (
            dt * network.config.learning_gain * signed_excess_over_threshold(residual[i], threshold[i])
        )
        for j in range(N_ALPHA_PLUS_BETA_CENTRES):
            weight = (
                leak_factor * network.memory.weights[i, j]
                + learning_step_beyond_threshold * network.memory.basis_values[j]
            )
            network.memory.weights[i, j] = min(max(weight, -weight_limit), weight_limit)


@kernel
def start_fdae_rates_and_gyro_bounds(fdae, changing_gyro_error_bound, x):
    """Start at the first measurement x (3,) rad/s: no residual, and all of the gyro's error still to come.

    changing_gyro_error_bound (3,) rad/s: on the changing part of the gyros' errors.
    """
    fdae.memory.xhat[:], fdae.memory.threshold_gyro_error_part[:] = x, changing_gyro_error_bound


@kernel
def set_constant_fdae_threshold(fdae, threshold):
    """Replace the threshold by a constant, rad/s."""
    fdae.output.threshold[:] = threshold


@kernel
def replace_network_output(network, fhat):
    """Replace the output of the network by that of another, fhat (3,) rad/s2."""
    network.output[:] = fhat


@kernel
def reset_network(network):
    """Set the weights and the output of the network to zero."""
    network.memory.weights[:], network.output[:] = 0.0, 0.0


@kernel
def form_fdae_residual(fdae, x):
    """Fill the residual for the measured x (3,) rad/s."""
    for i in range(3):
        fdae.output.residual[i] = x[i] - fdae.memory.xhat[i]


@kernel
def alarm_axis(filter_bank, alarm_authority_code, statistical_alarm_record):
    """The axis on which a detector in authority raises the alarm, or -1.

    statistical_alarm_record: `ALARM` of the statistical detector.
    """
    axis = bank_alarm_axis(filter_bank) if alarm_authority_code != STATISTICAL_DETECTOR else -1
    if (
        axis < 0
        and alarm_authority_code != WORST_CASE_DETECTOR
        and statistical_alarm_record.score_over_alarm_level > 1.0
    ):
        axis = statistical_alarm_record.axis
    return axis


@kernel
def advance_fdae(fdae, bound_record, x, predicted_acceleration, is_fault_detected, do_weights_leak, dt):
    """Advance the FDAE and its threshold by one frame; once `is_fault_detected`, the network learns what
    exceeds the threshold.

    x (3,) rad/s; predicted_acceleration (3,) rad/s2 is f + G u, with the isolated fault once there is one.
    """
    if is_fault_detected:
        train_network(fdae.network, fdae.output.residual, fdae.output.threshold, do_weights_leak, dt)
    for i in range(3):
        acceleration_with_network_output = predicted_acceleration[i] + fdae.network.output[i]
        decay_factor = fdae.config.decay_factor[i]
        fdae.memory.xhat[i] = (
            x[i] + dt * acceleration_with_network_output + decay_factor * (fdae.memory.xhat[i] - x[i])
        )
        fdae.memory.threshold_uncertainty_part[i] = advance_residual_bound(
            fdae.memory.threshold_uncertainty_part[i], bound_record.eta_bar[i], decay_factor, dt
        )
        fdae.memory.threshold_gyro_error_part[i] = advance_gyro_error_bound(
            fdae.memory.threshold_gyro_error_part[i],
            bound_record.changing_gyro_error_bound_before[i],
            decay_factor,
        )
        fdae.output.threshold[i] = (
            fdae.memory.threshold_uncertainty_part[i]
            + fdae.memory.threshold_gyro_error_part[i]
            + bound_record.changing_gyro_error_bound[i]
        )


@kernel
def fill_fdae_unmodelled_acceleration_estimate(fdae, changing_gyro_error_bound, out):
    """Fill out (3,) rad/s2 with the acceleration that the FDAE estimates in addition to the model.

    The residual settles at (phi - fhat) / Lambda0, so Lambda0 eps0 is the part of the fault not yet in the
    weights, at the bandwidth of the estimator. What the gyro's changing_gyro_error_bound (3,) rad/s alone
    explains stays out of it, and off the surfaces.
    """
    for i in range(3):
        gyro_caused_residual_bound = fdae.memory.threshold_gyro_error_part[i] + changing_gyro_error_bound[i]
        out[i] = fdae.network.output[i] + fdae.config.pole_per_s[i] * signed_excess_over_threshold(
            fdae.output.residual[i], gyro_caused_residual_bound
        )
