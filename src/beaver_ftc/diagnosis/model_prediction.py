"""The predicted acceleration f + G u of the designer's model: at this instant, and its mean over a frame.

    F = f(x, y) + G(x, y) u,    x rates (3,) rad/s, y measurements, u surfaces (n,) rad, F (3,) rad/s2

The order of evaluation is that of JSBSim. After `run()` number k the rates are x[k] and the accelerations
a[k] = F(x[k], u[k]), where u[k] is the command written before that run. The next run adds dt a[k] to the
rates. If a frame has n JSBSim steps (instants), the rates first change by dt/n a[k], under the old command,
and then by the accelerations of the other instants, under u[k+1]. The mean over a frame is therefore a left
sum over its n instants, the first of them under the old command.
"""

from math import exp, radians

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.model import actuators_dtype, design_dtype, design_of, move, response
from beaver_ftc.diagnosis.bounds import (
    additional_error_bound_at_travel_level,
    changing_gyro_error_bound,
    fill_uncertainty_bound_now,
)
from beaver_ftc.scenario.declared import Declared


@sized
def frame_sums_dtype(n: int) -> np.dtype:
    """Sums over the instants of a frame, n surfaces: f, G, G u and bounds; own errors as in bounds.py."""
    return record(
        f=3, G=(3, n), Gu=(3, n), eta_bar=3,
        surface_term_error_bound_per_rad=(3, n), surface_term_error_bound_at_command=(3, n),
        first_instant_Gu=(3, n),  # of the first instant alone
        G_min=n, G_max=n,  # on each surface's dominant axis
        u_min=n, u_max=n,  # rad
    )  # fmt: skip


@sized
def frame_means_dtype(n: int) -> np.dtype:
    """Means over the elapsed frame, of an aircraft with n surfaces."""
    return record(
        # rad/s2 per rad; rad/s2; see `fill_effect_tolerance_for_fault_change`, rad/s2
        G=(3, n), Gu=(3, n), Gu_tolerance_for_fault_change=(3, n),
        predicted_acceleration=3,  # f + G u, rad/s2
        # With G of the frame before. It does not depend on the measurement noise of this frame, to which the
        # control law reacts: with G of this frame that reaction would correlate with the noise.
        previous_G=(3, n), Gu_with_previous_G=(3, n),
        # If faults of every type are examined, extremes within the frame: of G on each surface's dominant
        # axis, and of the position of the healthy surface, rad.
        G_min=n, G_max=n, u_min=n, u_max=n,
    )  # fmt: skip


@sized
def prediction_dtype(n: int) -> np.dtype:
    """The designer's model of an aircraft with n surfaces and its predictions; rad, rad/s, rad/s2."""
    return record(
        design=design_dtype(n), actuators=actuators_dtype(n),
        frame_share_per_instant=float,  # one over the number of instants in a frame
        commanded=n,
        u=n, u_before=n,  # positions of healthy surfaces under the command: now, and an instant before
        f=3, G=(3, n),  # at this instant
        x_before=3,  # rates measured at the start of the elapsed frame
        sums=frame_sums_dtype(n), frame_means=frame_means_dtype(n),
        acceleration_with_known_faults=3,  # mean acceleration of the elapsed frame, known faults included
        innovation_after_known_faults=3,  # measured minus expected mean acceleration
    )  # fmt: skip


def configure_prediction(prediction: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill the design model and the declared actuators; travel (2, n) rad: the stops."""
    prediction["frame_share_per_instant"] = 1.0 / declared.substeps
    prediction["design"] = design_of(declared.design_model, declared.aircraft)[0]
    actuators, instant_interval_s = prediction["actuators"], 1.0 / declared.rate_hz / declared.substeps
    actuators["real"] = not declared.servos.is_ideal
    actuators["low"], actuators["high"] = travel
    for s, surface_name in enumerate(declared.aircraft.surfaces):
        actuator = getattr(declared.servos, surface_name)
        bandwidth_rad_s, rate_limit_rad_s = actuator.bandwidth_rad_s, radians(actuator.rate_limit_deg_s)
        actuators["approach"][s] = (
            1.0 - exp(-bandwidth_rad_s * instant_interval_s) if bandwidth_rad_s else 1.0
        )
        actuators["step"][s] = rate_limit_rad_s * instant_interval_s if rate_limit_rad_s else np.inf


@kernel
def evaluate_design_model(prediction, measured):
    """Fill f (3,) rad/s2 and G (3, n) rad/s2 per rad of the design model at this instant."""
    response(prediction.design, measured.x, measured.y, prediction.f, prediction.G)


@kernel
def add_instant_to_sums_and_extremes(prediction, bound_record, layout, diagnoses_all_types):
    """Add this instant to the sums over the frame and, for faults of `diagnoses_all_types`, to the
    extremes."""
    sums, G, u = prediction.sums, prediction.G, prediction.u
    for i in range(3):
        sums.f[i] += prediction.f[i]
        sums.eta_bar[i] += bound_record.eta_bar_now[i]
        for s in range(u.size):
            sums.G[i, s] += G[i, s]
            sums.Gu[i, s] += G[i, s] * u[s]
            if bound_record.has_surface_term_errors:
                sums.surface_term_error_bound_per_rad[i, s] += (
                    bound_record.declared_errors.acceleration_error_bound_per_rad[i, s]
                )
                sums.surface_term_error_bound_at_command[i, s] += (
                    bound_record.declared_errors.acceleration_error_bound_per_rad[i, s] * abs(u[s])
                )
    if bound_record.error_map.one_surface_may_be_anywhere:
        for j in range(bound_record.error_map.n_travel_levels):
            for i in range(3):
                bound_record.additional_error_bound_by_travel_level[j, i] += (
                    prediction.frame_share_per_instant
                    * additional_error_bound_at_travel_level(bound_record.error_map, j, i)
                )
    if diagnoses_all_types:
        for s, axis in enumerate(layout.dominant_axis):
            G_on_dominant_axis = G[axis, s]
            sums.G_min[s] = min(sums.G_min[s], G_on_dominant_axis)
            sums.G_max[s] = max(sums.G_max[s], G_on_dominant_axis)
            sums.u_min[s], sums.u_max[s] = min(sums.u_min[s], u[s]), max(sums.u_max[s], u[s])


@kernel
def fill_frame_means(prediction, bound_record):
    """Fill the means over the elapsed frame: G, the effect G u of each surface, f + G u, and the bound."""
    frame_share_per_instant = prediction.frame_share_per_instant
    sums = prediction.sums
    frame_means = prediction.frame_means
    for i in range(3):
        mean_predicted_acceleration = frame_share_per_instant * sums.f[i]
        for s in range(prediction.u.size):
            frame_means.previous_G[i, s] = frame_means.G[i, s]
            frame_means.G[i, s] = frame_share_per_instant * sums.G[i, s]
            frame_means.Gu[i, s] = frame_share_per_instant * sums.Gu[i, s]
            mean_predicted_acceleration += frame_means.Gu[i, s]
        frame_means.predicted_acceleration[i] = mean_predicted_acceleration
        bound_record.eta_bar[i] = frame_share_per_instant * sums.eta_bar[i]
    frame_means.G_min[:], frame_means.G_max[:] = sums.G_min, sums.G_max
    frame_means.u_min[:], frame_means.u_max[:] = sums.u_min, sums.u_max
    if bound_record.has_surface_term_errors:
        bound_record.surface_term_error_bound_per_rad[:] = (
            frame_share_per_instant * sums.surface_term_error_bound_per_rad
        )
        bound_record.surface_term_error_bound_at_command[:] = (
            frame_share_per_instant * sums.surface_term_error_bound_at_command
        )
    if frame_share_per_instant < 1.0:
        fill_effect_tolerance_for_fault_change(prediction)


@kernel
def fill_surface_effects_with_previous_G(frame_means):
    """Fill `Gu_with_previous_G` (3, n) rad/s2: the effect of each surface with G of the frame before."""
    for i in range(3):
        for s in range(frame_means.G_min.size):
            previous_over_present_G = (
                frame_means.previous_G[i, s] / frame_means.G[i, s] if frame_means.G[i, s] != 0.0 else 0.0
            )
            frame_means.Gu_with_previous_G[i, s] = previous_over_present_G * frame_means.Gu[i, s]


@kernel
def fill_effect_tolerance_for_fault_change(prediction):
    """Fill `Gu_tolerance_for_fault_change` (3, n) rad/s2: the error of the mean effect if a fault changes
    within the frame.

    A fault changes between frames, that is between the first JSBSim step of a frame and the others. z0 and z
    are the effects of a healthy surface in the first and in the other n - 1 steps. The mean effect of the
    fault then exceeds the extremes for the mean of z0 and z by at most |z0 - z| / n.
    """
    frame_share_per_instant, sums = prediction.frame_share_per_instant, prediction.sums
    for i in range(3):
        for s in range(prediction.u.size):
            first_instant_effect = sums.first_instant_Gu[i, s]
            mean_effect_of_other_instants = (
                (sums.Gu[i, s] - first_instant_effect)
                * frame_share_per_instant
                / (1.0 - frame_share_per_instant)
            )
            prediction.frame_means.Gu_tolerance_for_fault_change[i, s] = frame_share_per_instant * abs(
                first_instant_effect - mean_effect_of_other_instants
            )


@kernel
def evaluate_bound_and_frame_means(prediction, bound_record, measured, frame_index, dt):
    """Fill the bound on the uncertainty at this instant, and the means over the elapsed frame, k, of dt s."""
    bound_record.error_map.time_s = frame_index * dt
    fill_uncertainty_bound_now(bound_record, prediction.design, measured, prediction.u)
    bound_record.eta_bar[:] = bound_record.eta_bar_now
    if bound_record.declared_errors.has_declared_errors:
        for i in range(3):
            bound_record.changing_gyro_error_bound[i] = changing_gyro_error_bound(
                bound_record.declared_errors, i, measured.x[i]
            )
    if frame_index > 0:
        fill_frame_means(prediction, bound_record)


@kernel
def begin_frame_with_instant(prediction, bound_record, layout, diagnoses_all_types, measured):
    """Start the next frame's sums with this instant, at which the old command is still in effect."""
    prediction.x_before[:] = measured.x
    bound_record.changing_gyro_error_bound_before[:] = bound_record.changing_gyro_error_bound
    sums = prediction.sums
    sums.f[:], sums.eta_bar[:] = 0.0, 0.0
    sums.G[:], sums.Gu[:] = 0.0, 0.0
    sums.G_min[:], sums.G_max[:] = np.inf, -np.inf
    sums.u_min[:], sums.u_max[:] = np.inf, -np.inf
    if bound_record.has_surface_term_errors:
        sums.surface_term_error_bound_per_rad[:], sums.surface_term_error_bound_at_command[:] = 0.0, 0.0
    bound_record.additional_error_bound_by_travel_level[:] = 0.0
    add_instant_to_sums_and_extremes(prediction, bound_record, layout, diagnoses_all_types)
    sums.first_instant_Gu[:] = sums.Gu


@kernel
def redo_last_move_to_command(prediction, command):
    """Move the healthy surfaces by the same JSBSim frame towards another command (n,) rad."""
    prediction.u[:] = prediction.u_before
    store_command_and_move_healthy_surfaces(prediction, command)


@kernel
def add_instant_and_move_healthy_surfaces(prediction, bound_record, layout, diagnoses_all_types, measured):
    """Add an instant inside the frame to its sums, and move the healthy surfaces on."""
    fill_uncertainty_bound_now(bound_record, prediction.design, measured, prediction.u)
    add_instant_to_sums_and_extremes(prediction, bound_record, layout, diagnoses_all_types)
    move(prediction.actuators, prediction.commanded, prediction.u)


@kernel
def fill_acceleration_with_known_faults(
    prediction, include_known_faults, effectiveness, deflection_bias, include_biases
):
    """Fill `acceleration_with_known_faults` (3,) rad/s2: mean of f + G u over the elapsed frame, with the
    faults if `include_known_faults`.

    effectiveness (n,): estimate for each surface; deflection_bias (n,) rad: its bias, used if
    `include_biases`.
    """
    acceleration_with_known_faults = prediction.acceleration_with_known_faults
    frame_means = prediction.frame_means
    acceleration_with_known_faults[:] = frame_means.predicted_acceleration
    if not include_known_faults:
        return
    for s in range(effectiveness.size):
        lost_effectiveness_share = 1.0 - effectiveness[s]
        for i in range(3):
            acceleration_with_known_faults[i] -= lost_effectiveness_share * frame_means.Gu[i, s]
    if include_biases:
        for s in range(deflection_bias.size):
            for i in range(3):
                acceleration_with_known_faults[i] += frame_means.G[i, s] * deflection_bias[s]


@kernel
def form_innovation_after_known_faults(prediction, measured_rates, dt):
    """Fill `innovation_after_known_faults` (3,) rad/s2 of the elapsed frame, of dt s; measured_rates
    (3,) rad/s: now."""
    for i in range(3):
        prediction.innovation_after_known_faults[i] = (
            measured_rates[i] - prediction.x_before[i]
        ) / dt - prediction.acceleration_with_known_faults[i]


@kernel
def store_command_and_move_healthy_surfaces(prediction, command):
    """Move the healthy surfaces by one JSBSim frame towards the new command (n,) rad."""
    for s in range(command.size):
        prediction.commanded[s] = command[s]
    prediction.u_before[:] = prediction.u
    move(prediction.actuators, prediction.commanded, prediction.u)
