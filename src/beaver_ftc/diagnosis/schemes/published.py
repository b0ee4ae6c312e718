"""The published scheme, to the letter (`fdi.scheme: zhang2005`) [Zhang2005, sec. IV, eq. (3) and (4)].

    FDAE         xhat0' = -Lambda0 (xhat0 - x) + f + G u + fhat(x, u, th0),     eps0 = x - xhat0
                 th0' = P{Gamma Z^T D[eps0]},   Z = d fhat / d th0,   th0 = 0 until Td
    detection    Td = inf {t: |eps0_i(t)| > ebar_i(t), some i},   ebar_i = int e^{-lam (t-tau)} eta_bar_i dtau
    FIE s        xhats' = -Lambdas (xhats - x) + f + G u + fhats(x, u, ths) + Oms ths',   from Td on
                 Oms' = -Lambdas Oms + Zs,   Oms(Td) = 0,   ths' = P{Gammas Oms^T epss}
    thresholds   mu_i^s = k_i^s |Om_i^s| + int_Td^t e^{-lam (t-tau)} eta_bar_i dtau + e^{-lam (t-Td)} w_i
    isolation    s is excluded once |eps_i^s| > mu_i^s, some i; the one left is the fault; none: not isolable

The estimators are those of detection/filters.py and isolation.py, whose residuals and thresholds these are.
This file has the differences: Euler steps, a network of (x, u), gradients instead of least squares, and no
alarm but the FDAE's. D[eps] is eps outside the thresholds and 0 within [Zhang2002]. w is 0, since xhats(Td) =
x(Td); with noisy gyros w is the bound on their noise. What the paper leaves open is an option (plugins.yaml
lists them, with how each was chosen); some options remove a part of the scheme, to measure the effect of that
part.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion, isolation
from beaver_ftc.diagnosis.detection import filters
from beaver_ftc.diagnosis.detection.filters import fill_gaussians_and_sum_squares, replace_network_output
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.schemes import adaptive_estimators
from beaver_ftc.diagnosis.schemes.adaptive_estimators import CompiledScheme, begin_scheme
from beaver_ftc.diagnosis.state import CONSTANT_THRESHOLD, PITCH
from beaver_ftc.plugins import DETECTORS, settings
from beaver_ftc.scenario.declared import Declared

# Centres of the network's basis functions on each axis of the aircraft: alpha (pitch) or beta, rad; the rate
# of the axis, rad/s; the deflection of the surface that leads it, as a share of its travel.
ALPHA_CENTRES_RAD, BETA_CENTRES_RAD = np.linspace(-0.1, 0.5, 9), np.linspace(-0.4, 0.4, 9)
RATE_CENTRES_RAD_S, TRAVEL_SHARE_CENTRES = np.linspace(-0.3, 0.3, 3), np.linspace(0.0, 1.0, 3)
N_CENTRES_PER_INPUT = (len(ALPHA_CENTRES_RAD), len(RATE_CENTRES_RAD_S), len(TRAVEL_SHARE_CENTRES))
N_NODES_PER_AXIS = N_CENTRES_PER_INPUT[0] * N_CENTRES_PER_INPUT[1] * N_CENTRES_PER_INPUT[2]

# first_centre, centre_spacing: of the centres, by axis and input. weight_limit: of a weight, projection P;
# infinite without one. output: fhat, rad/s2.
STATE_NETWORK_RECORD = record(
    config=record(gain=float, weight_limit=float, first_centre=(3, 3), centre_spacing=(3, 3)),
    memory=record(
        input_basis=(3, N_CENTRES_PER_INPUT[0]), weights=(3, N_NODES_PER_AXIS), basis=(3, N_NODES_PER_AXIS)
    ),
    output=3,
)

# uses_dead_zone: whether the network waits for a residual outside the threshold; constant_threshold: rad/s,
# in the place of all adaptive thresholds, or 0.
PUBLISHED_CONFIG_RECORD = record(uses_dead_zone=int, constant_threshold=float)
PUBLISHED_RECORD = record(config=PUBLISHED_CONFIG_RECORD, network=STATE_NETWORK_RECORD)


def configure_state_network(network: np.void, gain: float, weight_limit: float, travel: np.ndarray) -> None:
    """Fill the network's record; travel (2, 3) rad: of the surfaces that lead roll, pitch and yaw."""
    network["config"]["gain"], network["config"]["weight_limit"] = gain, weight_limit
    for i in range(3):
        deflection_centres_rad = travel[0, i] + TRAVEL_SHARE_CENTRES * (travel[1, i] - travel[0, i])
        for input_index, centres in enumerate(
            (
                ALPHA_CENTRES_RAD if i == PITCH else BETA_CENTRES_RAD,
                RATE_CENTRES_RAD_S,
                deflection_centres_rad,
            )
        ):
            (
                network["config"]["first_centre"][i, input_index],
                network["config"]["centre_spacing"][i, input_index],
            ) = (
                centres[0],
                centres[1] - centres[0],
            )


def reconfigure_diagnosis_as_published(fdi: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Turn the stages of a diagnosis, filled in already, into the published scheme; travel (2, n)
    rad: the stops."""
    config, dt, isolation_record = declared.fdi, 1.0 / declared.rate_hz, fdi["isolation"]
    options, published_record = settings(DETECTORS, config.scheme, config.options), fdi["published"]
    published_record["config"]["uses_dead_zone"] = options["dead_zone"]
    weight_limit = options["network_limit_rad_s2"] if options["projection"] else np.inf
    configure_state_network(
        published_record["network"], options["network_gain"], weight_limit, travel[:, fdi["layout"]["main"]]
    )
    fdi["fdae"]["config"]["decay_factor"] = fdi["bank"]["config"]["decay_factor"][0] = euler_decay(
        config.detection_pole_per_s, dt
    )
    isolation_record["config"]["filter_decay"] = euler_decay(config.isolation_pole_per_s, dt)
    isolation_record["config"]["adapts_by_gradient"], isolation_record["config"]["gradient_gain"] = (
        1,
        options["adaptation_gain"],
    )
    isolation_record["estimator"]["theta"] = options["initial_theta"]
    isolation_record["config"]["projection_disabled"] = not options["projection"]
    if not options["adaptive_threshold"]:
        published_record["config"]["constant_threshold"], isolation_record["config"]["threshold_kind"] = (
            options["constant_threshold_rad_s"],
            CONSTANT_THRESHOLD,
        )
    if options["leave_out"]:
        isolation_record["estimator"]["excluded"][int(options["leave_out"]) - 1] = 1


def euler_decay(pole_per_s: float, dt_s: float) -> float:
    """Return the decay of a filter's state in an Euler step; 0 for a pole beyond the frame rate."""
    return max(1.0 - pole_per_s * dt_s, 0.0)


@kernel
def fill_input_basis(network, i, input_index, n_centres, input_value):
    """Fill input_basis[input_index] with the Gaussians of that input of axis i at input_value; their squares
    add up to 1."""
    position_in_centre_spacings = min(
        max(
            (input_value - network.config.first_centre[i, input_index])
            / network.config.centre_spacing[i, input_index],
            0.0,
        ),
        n_centres - 1.0,
    )
    basis_euclidean_norm = np.sqrt(
        fill_gaussians_and_sum_squares(
            position_in_centre_spacings, n_centres, 0, network.memory.input_basis[input_index]
        )
    )
    for centre_index in range(n_centres):
        network.memory.input_basis[input_index, centre_index] /= basis_euclidean_norm


@kernel
def fill_state_network_basis_and_output(network, main_surface_indices, x, y, u):
    """Fill basis, of unit length on each axis, and network.output (3,) rad/s2 at (x, u).

    x (3,) rad/s; y: measured signals; u (n,) rad; main_surface_indices (3,): the surface that leads each
    axis.
    """
    for i in range(3):
        fill_input_basis(network, i, 0, N_CENTRES_PER_INPUT[0], y[ALPHA] if i == PITCH else y[BETA])
        fill_input_basis(network, i, 1, N_CENTRES_PER_INPUT[1], x[i])
        fill_input_basis(network, i, 2, N_CENTRES_PER_INPUT[2], u[main_surface_indices[i]])
        node_index, weighted_sum = 0, 0.0
        for angle_centre_index in range(N_CENTRES_PER_INPUT[0]):
            for rate_centre_index in range(N_CENTRES_PER_INPUT[1]):
                for deflection_centre_index in range(N_CENTRES_PER_INPUT[2]):
                    basis_value = (
                        network.memory.input_basis[0, angle_centre_index]
                        * network.memory.input_basis[1, rate_centre_index]
                        * network.memory.input_basis[2, deflection_centre_index]
                    )
                    network.memory.basis[i, node_index] = basis_value
                    weighted_sum += network.memory.weights[i, node_index] * basis_value
                    node_index += 1
        network.output[i] = weighted_sum


@kernel
def train_state_network(network, training_residual, dt):
    """th' = P{Gamma Z^T training_residual}, by a step of dt s; training_residual (3,), Z: the basis as it was
    evaluated."""
    for i in range(3):
        for node_index in range(N_NODES_PER_AXIS):
            unlimited_weight = (
                network.memory.weights[i, node_index]
                + dt * network.config.gain * network.memory.basis[i, node_index] * training_residual[i]
            )
            network.memory.weights[i, node_index] = min(
                max(unlimited_weight, -network.config.weight_limit), network.config.weight_limit
            )


@kernel
def train_fdae_network_if_due(published_record, fdae, is_detected, dt):
    """The FDAE's network learns from the residual the frame began with, once a fault is detected.

    Without the dead zone it learns from the first frame on, with any residual.
    """
    is_any_axis_outside_threshold = False
    for i in range(3):
        is_any_axis_outside_threshold = (
            is_any_axis_outside_threshold or abs(fdae.output.residual[i]) > fdae.output.threshold[i]
        )
    if not published_record.config.uses_dead_zone or (is_detected and is_any_axis_outside_threshold):
        train_state_network(published_record.network, fdae.output.residual, dt)


@kernel
def update_fdae_network_output(published_record, fdae, main_surface_indices, x, y, u):
    """Evaluate fhat for this frame, for the FDAE and the log; arguments as of
    `fill_state_network_basis_and_output`."""
    fill_state_network_basis_and_output(published_record.network, main_surface_indices, x, y, u)
    replace_network_output(fdae.network, published_record.network.output)


@kernel
def fdae_alarm_axis(fdae):
    """The first axis on which the residual of the FDAE exceeds its threshold, or -1."""
    for i in range(3):
        if abs(fdae.output.residual[i]) > fdae.output.threshold[i]:
            return i
    return -1


@apart
def advance_estimators_to_frame(fdi, prediction, measured, k, t):
    """Bring isolation, FDAE and its network to this frame (adaptive_estimators.CompiledScheme)."""
    published_record, bound_record, dt = fdi.published, fdi.bound, fdi.config.dt
    adaptive_estimators.update_detection_filters(fdi, prediction, measured)
    adaptive_estimators.update_fault_effects_and_isolation_estimators(fdi, prediction)
    train_fdae_network_if_due(published_record, fdi.fdae, fdi.verdict.detected, dt)
    filters.advance_fdae(
        fdi.fdae,
        bound_record,
        prediction.x_before,
        prediction.frame_means.predicted_acceleration,
        False,
        False,
        dt,
    )
    if published_record.config.constant_threshold > 0.0:
        set_all_constant_thresholds(fdi, published_record.config.constant_threshold)


@kernel
def set_all_constant_thresholds(fdi, common_threshold_rad_s):
    """Replace all adaptive thresholds by a constant, rad/s."""
    filters.set_constant_fdae_threshold(fdi.fdae, common_threshold_rad_s)
    filters.set_constant_published_filter_threshold(fdi.bank, common_threshold_rad_s)
    isolation.set_constant_isolation_thresholds(fdi.isolation, common_threshold_rad_s)


@apart
def update_verdict(fdi, prediction, measured, t):
    """Raise the alarm by the FDAE, evaluate its network, and isolate (adaptive_estimators.CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    was_detected_before, conclusion_record = fdi.verdict.detected, fdi.verdict
    filters.form_fdae_residual(fdi.fdae, measured.x)
    alarm_axis = fdae_alarm_axis(fdi.fdae)
    update_fdae_network_output(fdi.published, fdi.fdae, fdi.layout.main, measured.x, measured.y, prediction.u)
    if alarm_axis >= 0:
        conclusion.latch_alarm(conclusion_record, alarm_axis, t)
    if conclusion_record.detected:
        adaptive_estimators.start_or_continue_isolation(fdi, measured, t, was_detected_before)


SCHEME = CompiledScheme(
    begin_scheme,
    advance_estimators_to_frame,
    update_verdict,
    adaptive_estimators.skip_prepare_next_frame,
    adaptive_estimators.skip_accumulate_substep,
)
