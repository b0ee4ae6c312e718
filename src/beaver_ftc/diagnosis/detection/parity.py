"""Parity tests: they exclude a surface for any type and time history of its fault.

A fault of surface s accelerates the aircraft along the column g_s of G only, rad/s2 per rad. A projection of
the innovation nu, rad/s2, on a parity direction m that is orthogonal to that column,

    m . nu        with  m . g_s = 0,  |m| = 1

does not depend on a fault of s. If a test finds a signal in this projection, s is not the (only) cause. Each
direction is a view: it has a whitening filter of its own and tests for a step, for a loss of another surface
(likelihood.py) and for an oscillation. The directions are

* each axis, for the surfaces that do not move it;
* in a plane that several surfaces move, the direction across the column g of each: m = (-g_2, g_1) / |g|. The
  planes are roll and yaw; if accelerometers are used (forces.py), also pitch and normal force, yaw and side
  force.

Declared errors may turn the column. Then a share of the innovation along the column leaks into the
projection, at most (|m_1| e_1 + |m_2| e_2) / (|g| - |m_2| e_1 - |m_1| e_2), where e_1 and e_2 bound the
errors of the surface's own terms, rad/s2 per rad. This share is tolerated like an error of a coefficient. A
test excludes at the alarm level, so noise and bounded uncertainty exclude as rarely as they raise an alarm.

The gust estimated from the vanes is subtracted from the rates only if the forces are measured. Without that
measurement a surface that does not follow its command produces a force that looks like a gust; then the
whole declared gust counts as noise. The rolling gust always does: no vane measures it.

An error of a vane changes a rate and its force, and so does the false gust estimate that it causes. If a view
uses a vane, it excludes a surface only after a view that is insensitive to the vane confirms it. That is a
view across the column of the vane, with the gust estimated from the forces, or a view of the force at the
flow angle that integrated inertial motion gives.

A broken accelerometer changes a force and no rate. If accelerometers may break (air.output.read is 0), a
force raises no alarm and gives no gust estimate; it only counts after an alarm of the rates. Forces that are
known or suspected to be wrong are not used.

*Oscillation tests.* They use the spectrum of a view's whitened innovation g at the frequencies of a grid.

An oscillating surface adds a tone of unknown amplitude and phase to a view. The whitening filter
is linear, so the whitened innovation contains the same tone. For each frequency w, rad/s, the test computes

    N = sum exp((i w - 1 / T) t) g / sqrt(S)          summed over past frames; t s is the age of a frame

with S the variance of g, (rad/s)2, and T = TONE_MEMORY_S. Without a fault the real and the imaginary part of
N are normal. With v the larger of their variances, |N| / sqrt(v) exceeds x with a probability of exp(-x^2 /
2) at most. Two errors can add to |N| without a fault (symbols as in likelihood.py):

* Errors of coefficients add at most sum_j tol_j |R_j|, where R_j is the same sum over regressor j.
* A bounded uncertainty |d| <= eta_bar adds at most |W(w)| sum eta_bar exp(-t / T) |cos|, where W is the gain
  of the whitening filter at w. The limited rate of change of d reduces this a little
  (`derive_max_tone_mean_of_uncertainty`).

The sums are updated once per TONE_UPDATE_INTERVAL_S: no frequency of the grid changes its phase much in that
time.
"""

from collections.abc import Iterator
from math import exp, pi, sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import MAX_TERMS_OF_ONE
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.bounds import moment_axis_of_term
from beaver_ftc.diagnosis.detection import forces, likelihood
from beaver_ftc.diagnosis.detection.forces import (
    FORCE_COEFFICIENT_NAMES,
    MIN_FORCE_UPDATES,
    NORMAL_INDEX_AMONG_FORCES,
    SIDE_INDEX_AMONG_FORCES,
    terms_of_one_force,
)
from beaver_ftc.diagnosis.detection.likelihood import (
    LATERAL_BLOCK,
    N_INPUT_READINGS,
    PITCH_BLOCK,
    STEP_FAULT,
    USUAL_MAX_HYPOTHESES_PER_BLOCK,
    BlockCapacity,
    evidence_over_noise_and_uncertainty,
)
from beaver_ftc.diagnosis.gusts import (
    full_gust_drift_intensity,
    project_on_gust_axis,
    remaining_gust_drift_intensity,
)
from beaver_ftc.diagnosis.state import LOSS, NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW

N_TONE_FREQUENCIES = 16
# A memory of T s resolves frequencies 1 / T apart. A tone halfway between two frequencies of the grid appears
# with 0.7 of its amplitude.
TONE_MEMORY_S = 2.5
TONE_FREQUENCIES_RAD_S = np.linspace(1.0, 13.0, N_TONE_FREQUENCIES)
TONE_UPDATE_INTERVAL_S = 0.04
# Share of the alarm level reserved for noise in addition to a bounded uncertainty. It is reserved without
# noise too, because `whitened_unit_tone_amplitude` assumes constant gains, and the gains vary with a varying
# bound.
TONE_NOISE_SHARE_OF_ALARM_LEVEL = 0.5
# The tests run at airspeeds within this ratio of the trim airspeed, and at vane angles within this limit.
MAX_AIRSPEED_FACTOR_FROM_TRIM, MAX_VANE_ANGLE_RAD = 2.0, 0.5

# Configuration that all views share.
TONE_CONFIG_RECORD = record(
    min_airspeed=float, max_airspeed=float,  # airspeeds, m/s, between which the tests run
    frames_per_update=int, alarm_level=float,  # alarm level, standard deviations
    sum_decay_factor_per_update=float,  # factor by which a sum decays from one update to the next
    # (cos, sin) of the phase change per frame; per update, and twice that, both times
    # `sum_decay_factor_per_update`
    phase_rotation_per_frame=(2, N_TONE_FREQUENCIES), decayed_rotation_per_update=(2, N_TONE_FREQUENCIES),
    decayed_double_rotation_per_update=(2, N_TONE_FREQUENCIES),
    # largest mean of cos(w t) d(t) for a bounded uncertainty |d| <= 1
    max_tone_mean_of_unit_uncertainty=N_TONE_FREQUENCIES,
    # larger variance of real and imaginary part of N; the sum of both is 1
    larger_complex_part_variance_share=N_TONE_FREQUENCIES,
)  # fmt: skip


@sized
def tone_tests_dtype(n_regressors: int) -> np.dtype:
    """The oscillation tests of one view, for a number of regressors."""
    return record(
        # frames since the last update; sums since then of g and of n_regressors, over the deviation of g
        frames_since_update=int, normalised_innovation_sum=float, normalised_regressor_sums=n_regressors,
        # N and R_j: real and imaginary parts
        correlation=(2, N_TONE_FREQUENCIES), regressor_correlation=(n_regressors, 2, N_TONE_FREQUENCIES),
        # shares of |N| that errors of coefficients and a bounded uncertainty explain; for the latter, two
        # sums over the filtered bound: of the bound, and of its component at twice the frequency
        max_correlation_by_coefficient_errors=N_TONE_FREQUENCIES,
        max_correlation_by_uncertainty=N_TONE_FREQUENCIES,
        filtered_bound_sum=N_TONE_FREQUENCIES,
        filtered_bound_double_frequency_sum=(2, N_TONE_FREQUENCIES),
        correlation_variance=float,  # variance of N without a fault
        score=float,  # largest over the frequencies; on the scale of scores in likelihood.py
    )  # fmt: skip


@kernel
def is_within_envelope(tone_test_config, y):
    """True if airspeed and vane angles y (5,) are near those of normal flight.

    Outside, the tolerances of the tests, which are worked out for trim, do not hold.
    """
    is_airspeed_within = tone_test_config.min_airspeed < y[AIRSPEED] < tone_test_config.max_airspeed
    return is_airspeed_within and abs(y[ALPHA]) < MAX_VANE_ANGLE_RAD and abs(y[BETA]) < MAX_VANE_ANGLE_RAD


@kernel
def update_tone_tests(view, tone_test_config, detector_alarm_level, is_inside_envelope, uses_regressors, dt):
    """Update the tests of a view with one frame, which the view's block has whitened; dt s.

    uses_regressors: whether the regressors of the block count. Without `is_inside_envelope` the frame counts
    as zero, so the sums decay.
    """
    tone_tests, block = view.tone_tests, view.block
    n_regressors = block.n_regressors if uses_regressors else 0
    inverse_innovation_std = np.sqrt(block.S_inverse[0, 0]) if is_inside_envelope else 0.0
    tone_tests.normalised_innovation_sum += inverse_innovation_std * block.unscaled_white_innovation_rad_s[0]
    for j in range(n_regressors):
        tone_tests.normalised_regressor_sums[j] += inverse_innovation_std * block.regressor_response[j, 0]
    tone_tests.frames_since_update += 1
    if tone_tests.frames_since_update < tone_test_config.frames_per_update:
        return
    advance_resonators(tone_test_config, tone_tests.correlation, tone_tests.normalised_innovation_sum)
    for j in range(n_regressors):
        advance_resonators(
            tone_test_config, tone_tests.regressor_correlation[j], tone_tests.normalised_regressor_sums[j]
        )
        tone_tests.normalised_regressor_sums[j] = 0.0
    tone_tests.correlation_variance = (
        tone_test_config.sum_decay_factor_per_update
        * tone_test_config.sum_decay_factor_per_update
        * tone_tests.correlation_variance
        + tone_tests.frames_since_update
    )
    update_max_correlation_by_uncertainty(
        tone_tests, tone_test_config, block, inverse_innovation_std * view.uncertainty_bound[0], dt
    )
    fill_max_correlation_by_coefficient_errors(tone_tests, block.regressor_tolerance, n_regressors)
    fill_max_tone_score(tone_tests, tone_test_config, detector_alarm_level)
    tone_tests.normalised_innovation_sum, tone_tests.frames_since_update = 0.0, 0


@kernel
def advance_resonators(tone_test_config, resonator_state, input_sum):
    """Advance N at every frequency, resonator_state (2, N_TONE_FREQUENCIES), by one update: rotate, decay,
    add the drive."""
    decayed_rotation = tone_test_config.decayed_rotation_per_update
    for frequency_index in range(resonator_state.shape[1]):
        previous_state_real = resonator_state[0, frequency_index]
        previous_state_imaginary = resonator_state[1, frequency_index]
        resonator_state[0, frequency_index] = (
            decayed_rotation[0, frequency_index] * previous_state_real
            - decayed_rotation[1, frequency_index] * previous_state_imaginary
            + input_sum
        )
        resonator_state[1, frequency_index] = (
            decayed_rotation[1, frequency_index] * previous_state_real
            + decayed_rotation[0, frequency_index] * previous_state_imaginary
        )


@kernel
def whitened_unit_tone_amplitude(
    rate_gain, drift_gain, drift_decay_factor, cos_phase_change, sin_phase_change, dt
):
    """Amplitude, rad/s, of the whitened response to a tone of amplitude 1 rad/s2, at constant filter gains.

    cos_phase_change, sin_phase_change: of the change of the tone's phase per frame, of dt s.
    """
    squared_distance_to_drift_pole = (cos_phase_change - drift_decay_factor) * (
        cos_phase_change - drift_decay_factor
    ) + sin_phase_change * sin_phase_change
    denominator_real = (
        1.0
        - (1.0 - rate_gain) * cos_phase_change
        + dt * drift_gain * (cos_phase_change - drift_decay_factor) / squared_distance_to_drift_pole
    )
    denominator_imaginary = sin_phase_change * (1.0 - rate_gain) - (
        dt * drift_gain * sin_phase_change / squared_distance_to_drift_pole
    )
    return dt / np.sqrt(denominator_real * denominator_real + denominator_imaginary * denominator_imaginary)


@kernel
def update_max_correlation_by_uncertainty(
    tone_tests, tone_test_config, block, uncertainty_bound_over_innovation_std, dt
):
    """Update `max_correlation_by_uncertainty`: the most that a bounded uncertainty adds to |N|.

    uncertainty_bound_over_innovation_std: eta_bar, the bound on |d|, over the standard deviation of g.
    |cos x| = 2 / pi (1 + 2/3 cos 2x - 2/15 cos 4x + ...). A bound that varies at twice the tone's frequency
    adds most. Its higher harmonics add less: together no more than a third of that again.
    """
    decayed_double_rotation = tone_test_config.decayed_double_rotation_per_update
    sum_decay_factor = tone_test_config.sum_decay_factor_per_update
    normalised_bound_sum_since_update = uncertainty_bound_over_innovation_std * tone_tests.frames_since_update
    for frequency_index in range(tone_tests.max_correlation_by_uncertainty.size):
        cos_phase_change = tone_test_config.phase_rotation_per_frame[0, frequency_index]
        sin_phase_change = tone_test_config.phase_rotation_per_frame[1, frequency_index]
        whitened_bound_sum_since_update = normalised_bound_sum_since_update * whitened_unit_tone_amplitude(
            block.K_x[0, 0], block.K_d[0, 0], block.drift_decay_factor, cos_phase_change, sin_phase_change, dt
        )
        previous_double_frequency_real = tone_tests.filtered_bound_double_frequency_sum[0, frequency_index]
        previous_double_frequency_imaginary = tone_tests.filtered_bound_double_frequency_sum[
            1, frequency_index
        ]
        tone_tests.filtered_bound_double_frequency_sum[0, frequency_index] = (
            decayed_double_rotation[0, frequency_index] * previous_double_frequency_real
            - decayed_double_rotation[1, frequency_index] * previous_double_frequency_imaginary
            + whitened_bound_sum_since_update
        )
        tone_tests.filtered_bound_double_frequency_sum[1, frequency_index] = (
            decayed_double_rotation[1, frequency_index] * previous_double_frequency_real
            + decayed_double_rotation[0, frequency_index] * previous_double_frequency_imaginary
        )
        tone_tests.filtered_bound_sum[frequency_index] = (
            sum_decay_factor * tone_tests.filtered_bound_sum[frequency_index]
            + whitened_bound_sum_since_update
        )
        tone_tests.max_correlation_by_uncertainty[frequency_index] = (
            tone_test_config.max_tone_mean_of_unit_uncertainty[frequency_index]
            * (
                tone_tests.filtered_bound_sum[frequency_index]
                + np.hypot(
                    tone_tests.filtered_bound_double_frequency_sum[0, frequency_index],
                    tone_tests.filtered_bound_double_frequency_sum[1, frequency_index],
                )
            )
        )


@kernel
def fill_max_correlation_by_coefficient_errors(tone_tests, coefficient_error_bounds, n_regressors):
    """Fill `max_correlation_by_coefficient_errors`: the most that the declared errors of the first n
    coefficients add to |N|.

    The magnitude of R_j is at most its larger part plus (sqrt 2 - 1) times its smaller part.
    """
    tone_tests.max_correlation_by_coefficient_errors[:] = 0.0
    for j in range(n_regressors):
        regressor_correlation = tone_tests.regressor_correlation[j]
        coefficient_error_bound = coefficient_error_bounds[j]
        for frequency_index in range(tone_tests.max_correlation_by_coefficient_errors.size):
            abs_real_regressor_correlation = abs(regressor_correlation[0, frequency_index])
            abs_imaginary_regressor_correlation = abs(regressor_correlation[1, frequency_index])
            tone_tests.max_correlation_by_coefficient_errors[frequency_index] += coefficient_error_bound * (
                max(abs_real_regressor_correlation, abs_imaginary_regressor_correlation)
                + 0.41421356237309515
                * min(abs_real_regressor_correlation, abs_imaginary_regressor_correlation)
            )


@kernel
def fill_max_tone_score(tone_tests, tone_test_config, detector_alarm_level):
    """Fill `score` with the largest score over the frequencies, scaled to the detector's alarm level."""
    max_score = 0.0
    for frequency_index in range(tone_tests.max_correlation_by_coefficient_errors.size):
        evidence = (
            np.hypot(tone_tests.correlation[0, frequency_index], tone_tests.correlation[1, frequency_index])
            - tone_tests.max_correlation_by_coefficient_errors[frequency_index]
        )
        larger_part_variance = (
            tone_test_config.larger_complex_part_variance_share[frequency_index]
            * tone_tests.correlation_variance
        )
        max_score = max(
            max_score,
            evidence_over_noise_and_uncertainty(
                tone_test_config.alarm_level,
                TONE_NOISE_SHARE_OF_ALARM_LEVEL,
                evidence,
                tone_tests.max_correlation_by_uncertainty[frequency_index],
                larger_part_variance,
            ),
        )
    tone_tests.score = max_score * detector_alarm_level / tone_test_config.alarm_level


def derive_max_tone_mean_of_uncertainty(
    frequencies_rad_s: np.ndarray, uncertainty_change_rate_per_s: float
) -> np.ndarray:
    """Largest mean of cos(w t) d(t) over all d with |d| <= 1 and |d'| <= rate; frequencies w (n,) rad/s.

    The largest is reached by a square wave with edges of the slope `rate`, or, at frequencies where these
    edges do not reach 1, by a triangular wave.
    """
    normalised_frequencies = frequencies_rad_s / uncertainty_change_rate_per_s
    return (
        2.0
        / pi
        * np.where(normalised_frequencies < pi / 2.0, np.sin(normalised_frequencies), 1.0)
        / normalised_frequencies
    )


def configure_tone_tests(
    tone_test_config: np.void,
    false_alarm_probability_per_test_frame: float,
    airspeed_mps: float,
    uncertainty_change_rate_per_s: float,
    dt_s: float,
) -> None:
    """Fill the configuration that all views share.

    false_alarm_probability_per_test_frame: probability of a false alarm granted to one test in one frame.
    airspeed_mps: in trim. uncertainty_change_rate_per_s: largest rate of change of a bounded uncertainty, in
    bounds per second.
    """
    tone_test_config["max_tone_mean_of_unit_uncertainty"] = derive_max_tone_mean_of_uncertainty(
        TONE_FREQUENCIES_RAD_S, uncertainty_change_rate_per_s
    )
    tone_test_config["min_airspeed"] = airspeed_mps / MAX_AIRSPEED_FACTOR_FROM_TRIM
    tone_test_config["max_airspeed"] = airspeed_mps * MAX_AIRSPEED_FACTOR_FROM_TRIM
    frames_per_update = max(round(TONE_UPDATE_INTERVAL_S / dt_s), 1)
    phase_per_frame_rad = TONE_FREQUENCIES_RAD_S * dt_s
    sum_decay_factor_per_update = exp(-frames_per_update * dt_s / TONE_MEMORY_S)
    tone_test_config["frames_per_update"] = frames_per_update
    tone_test_config["sum_decay_factor_per_update"] = sum_decay_factor_per_update
    tone_test_config["alarm_level"] = sqrt(-2.0 * np.log(false_alarm_probability_per_test_frame))
    tone_test_config["phase_rotation_per_frame"] = np.cos(phase_per_frame_rad), np.sin(phase_per_frame_rad)
    tone_test_config["decayed_rotation_per_update"] = (
        sum_decay_factor_per_update * np.cos(frames_per_update * phase_per_frame_rad),
        sum_decay_factor_per_update * np.sin(frames_per_update * phase_per_frame_rad),
    )
    tone_test_config["decayed_double_rotation_per_update"] = (
        sum_decay_factor_per_update * np.cos(2.0 * frames_per_update * phase_per_frame_rad),
        sum_decay_factor_per_update * np.sin(2.0 * frames_per_update * phase_per_frame_rad),
    )
    # The variances of the two parts differ by |sum exp(2 (i w - 1 / T) t)| / sum exp(-2 t / T).
    relative_variance_difference = (1.0 - sum_decay_factor_per_update**2) / np.abs(
        1.0 - sum_decay_factor_per_update**2 * np.exp(2j * frames_per_update * phase_per_frame_rad)
    )
    tone_test_config["larger_complex_part_variance_share"] = 0.5 * (1.0 + relative_variance_difference)


VANE_EFFECT_RELATIVE_TOLERANCE = (
    0.1  # relative error of the effect of a vane's error: its column is that of the trim
)
PEAK_SCORE_TO_EVIDENCE_MEMORY_RATIO = (
    5.0  # time constant of `decaying_peak_score` over the one with which evidence is forgotten
)
MIN_FORCE_COMPONENT_OF_FORCE_VIEW = (
    0.9  # component of a direction of length 1, above which a view counts as one of the force
)
MIN_ERROR_REDUCED_COLUMN_NORM_SHARE = (
    0.1  # least length that the errors leave of a column, as a share of its length
)
PITCH_AND_NORMAL_FORCE = (PITCH, NORMAL_FORCE)
ROLL_AND_YAW = (ROLL, YAW)
YAW_AND_SIDE_FORCE = (YAW, SIDE_FORCE)

# Values of `orthogonal_to_surface` in a view without one: a view of an axis; one across the column of an
# error of a vane.
AXIS_VIEW, ORTHOGONAL_TO_VANE_ERROR = -1, -2


class StatisticalRecordSize(NamedTuple):
    """Capacities of a record: of a block of the rates, of a view; numbers of views and of error-map boxes."""

    rate_block_capacity: BlockCapacity
    view_block_capacity: BlockCapacity
    n_views: int
    n_model_error_bound_boxes: int


USUAL_RECORD_SIZE = StatisticalRecordSize(
    BlockCapacity(23, USUAL_MAX_HYPOTHESES_PER_BLOCK), BlockCapacity(36, 3), 13, 6
)  # enough for most aircraft: see `required_record_size`


@sized
def parity_view_dtype(capacity: BlockCapacity) -> np.dtype:
    """A view whose block has these capacities."""
    return record(
        # whose column the direction is orthogonal to, or AXIS_VIEW, or ORTHOGONAL_TO_VANE_ERROR
        orthogonal_to_surface=int,
        alarm_axis=int,  # reported with an alarm of this view
        direction=5, unit_column=5,  # m and g / |g|: roll, pitch, yaw, side force, normal force
        plane_axes=(int, 2),  # the two components that the column has
        is_orthogonal_to_rolling_gust=int,  # whether m is orthogonal to the rolling gust as well
        always_uses_regressors=int,  # whether regressors count in this view even if they do in no other block
        uses_inertial_flow_angle=int,  # whether the force is that at the flow angle from inertial motion
        is_immune_to_vane_error=int,  # whether an error of a vane does not appear in this view
        confirming_force_component=int,  # force of the views that confirm this one; 0 if no vane is used
        # of this frame: whether the view is used; which share of nu along the column leaks into it
        is_used=int, column_leak_share=float,
        uncertainty_bound=1,  # bound on the uncertainty along m, rad/s2
        # effect of the air's rotation about the body axes, 1/s
        rate_gust_sensitivity=3, force_gust_sensitivity=3,
        decaying_peak_score=float,  # largest score, decaying slowly
        block=likelihood.block_dtype(capacity), tone_tests=tone_tests_dtype(capacity.max_regressors),
    )  # fmt: skip


@kernel
def innovation_component_for_view(
    view, forces, gust, inertial_gust, angular_acceleration_innovation, component
):
    """One component of the innovation that a view projects, rad/s2: of the rates (3,), or of a force."""
    if component < SIDE_FORCE:
        mean_angular_acceleration_by_gust = 0.0
        if subtracts_gust_estimate(view, gust):
            mean_angular_acceleration_by_gust = gust_estimate_of_view(
                view, gust, inertial_gust
            ).output.mean_angular_acceleration_by_gust[component]
        return angular_acceleration_innovation[component] - mean_angular_acceleration_by_gust
    force_record = forces.component[component - SIDE_FORCE]
    return (
        force_record.innovation_at_inertial_flow_angle
        if view.uses_inertial_flow_angle
        else force_record.innovation
    )


@kernel
def cancelled_column_entry_and_error_bound(view, forces, bound_record, G, plane_axis_index):
    """Entry 0 or 1 of the column in a view's plane and the bound on its error, rad/s2 per rad."""
    component, s = view.plane_axes[plane_axis_index], view.orthogonal_to_surface
    if s == ORTHOGONAL_TO_VANE_ERROR:
        cancelled_column_entry = forces.component[
            view.plane_axes[1] - SIDE_FORCE
        ].axis_and_force_innovation_per_vane_error[plane_axis_index]
        return cancelled_column_entry, VANE_EFFECT_RELATIVE_TOLERANCE * abs(cancelled_column_entry)
    if component >= SIDE_FORCE:
        force_record = forces.component[component - SIDE_FORCE]
        cancelled_column_entry = force_record.previous_specific_force_over_chord_per_surface_rad[s]
        return cancelled_column_entry, force_record.specific_force_over_chord_per_surface_rad_error_bound[s]
    error_bound = (
        bound_record.surface_term_error_bound_per_rad[component, s]
        if bound_record.has_surface_term_errors
        else 0.0
    )
    return G[component, s], error_bound


@kernel
def set_view_direction_and_return_leak_share(view, forces, gust, bound_record, G):
    """Fill `direction` and `unit_column` (5,) of a view across a column of G (3, n) rad/s2 per rad.

    Returns the share of the innovation along the column that errors of the column let leak into the view.
    """
    if view.is_orthogonal_to_rolling_gust:
        return set_vane_gust_free_direction_and_return_leak_share(view, forces, gust)
    first_component, second_component = view.plane_axes[0], view.plane_axes[1]
    cancelled_entry_on_first_component, first_error_bound = cancelled_column_entry_and_error_bound(
        view, forces, bound_record, G, 0
    )
    cancelled_entry_on_second_component, second_error_bound = cancelled_column_entry_and_error_bound(
        view, forces, bound_record, G, 1
    )
    column_norm = np.sqrt(
        cancelled_entry_on_first_component * cancelled_entry_on_first_component
        + cancelled_entry_on_second_component * cancelled_entry_on_second_component
    )
    if column_norm == 0.0:
        return 0.0
    view.direction[first_component] = -cancelled_entry_on_second_component / column_norm
    view.direction[second_component] = cancelled_entry_on_first_component / column_norm
    view.unit_column[first_component] = cancelled_entry_on_first_component / column_norm
    view.unit_column[second_component] = cancelled_entry_on_second_component / column_norm
    error_bound_along_direction = (
        abs(view.direction[first_component]) * first_error_bound
        + abs(view.direction[second_component]) * second_error_bound
    )
    column_norm_error_bound = (
        abs(view.direction[second_component]) * first_error_bound
        + abs(view.direction[first_component]) * second_error_bound
    )
    return error_bound_along_direction / max(
        column_norm - column_norm_error_bound, MIN_ERROR_REDUCED_COLUMN_NORM_SHARE * column_norm
    )


@kernel
def set_vane_gust_free_direction_and_return_leak_share(view, forces, gust):
    """Fill `direction`, orthogonal to two vectors, and `unit_column`; return the share that leaks.

    The direction is the vector product of the two in (roll, yaw, side force).

    The vectors are the column of an error of the side vane and the effect of the rolling gust on the rates.
    """
    side_force_record = forces.component[0]
    vane_roll_effect = side_force_record.roll_innovation_per_vane_error
    vane_yaw_effect = side_force_record.axis_and_force_innovation_per_vane_error[0]
    vane_side_force_effect = side_force_record.axis_and_force_innovation_per_vane_error[1]
    rolling_gust_roll_effect = project_on_gust_axis(
        gust.output.rate_damping[ROLL], gust.output.gust_axes_in_body, 0
    )
    rolling_gust_yaw_effect = project_on_gust_axis(
        gust.output.rate_damping[YAW], gust.output.gust_axes_in_body, 0
    )
    direction_roll = -vane_side_force_effect * rolling_gust_yaw_effect
    direction_yaw = vane_side_force_effect * rolling_gust_roll_effect
    direction_side_force = (
        vane_roll_effect * rolling_gust_yaw_effect - vane_yaw_effect * rolling_gust_roll_effect
    )
    direction_norm = np.sqrt(
        direction_roll * direction_roll
        + direction_yaw * direction_yaw
        + direction_side_force * direction_side_force
    )
    if direction_norm == 0.0:
        return 0.0
    vane_column_norm = np.sqrt(
        vane_roll_effect * vane_roll_effect
        + vane_yaw_effect * vane_yaw_effect
        + vane_side_force_effect * vane_side_force_effect
    )
    error_bound_along_direction = 0.0
    for i, vane_effect, unnormalised_direction_entry in (
        (ROLL, vane_roll_effect, direction_roll),
        (YAW, vane_yaw_effect, direction_yaw),
        (SIDE_FORCE, vane_side_force_effect, direction_side_force),
    ):
        view.direction[i] = unnormalised_direction_entry / direction_norm
        view.unit_column[i] = vane_effect / vane_column_norm
        error_bound_along_direction += VANE_EFFECT_RELATIVE_TOLERANCE * abs(view.direction[i] * vane_effect)
    return error_bound_along_direction / ((1.0 - VANE_EFFECT_RELATIVE_TOLERANCE) * vane_column_norm)


@kernel
def subtracts_gust_estimate(view, gust):
    """True if the gust estimate is subtracted from a view: the measured force separates it from faults."""
    return view.confirming_force_component > 0 and gust.output.uses_accelerometers == 1


@kernel
def uses_force(view):
    """True if a view's direction has a component along a force."""
    return view.direction[SIDE_FORCE] != 0.0 or view.direction[SIDE_FORCE + 1] != 0.0


@kernel
def gust_estimate_of_view(view, gust, inertial_gust):
    """The gust estimate that a view uses: from the vanes, or from inertial motion if it must not use them."""
    return inertial_gust if view.is_immune_to_vane_error else gust


@kernel
def fill_air_rotation_sensitivity(view, forces, rate_damping):
    """Fill `rate_gust_sensitivity` and `force_gust_sensitivity` (3,), 1/s: the gust sensitivity of a view.

    It is the projected acceleration per rad/s of rotation of the air about each body axis. rate_damping (3,
    3) 1/s: that of the rates.
    """
    m = view.direction
    for k in range(3):
        sensitivity_part_of_roll_acceleration = m[ROLL] * rate_damping[ROLL, k]
        sensitivity_part_of_pitch_acceleration = m[PITCH] * rate_damping[PITCH, k]
        sensitivity_part_of_yaw_acceleration = m[YAW] * rate_damping[YAW, k]
        view.rate_gust_sensitivity[k] = (
            sensitivity_part_of_roll_acceleration
            + sensitivity_part_of_pitch_acceleration
            + sensitivity_part_of_yaw_acceleration
        )
        view.force_gust_sensitivity[k] = 0.0
        for force_index in range(2):
            view.force_gust_sensitivity[k] += (
                m[SIDE_FORCE + force_index]
                * forces.component[force_index].innovation_per_air_rotation[k]
                * forces.dynamic_pressure_over_trim
            )


@kernel
def set_view_noise_drift_and_bound(view, noise_model, blocks, forces, gust, inertial_gust, V):
    """Fill measurement noise, model noise, drift intensity and bound of a view from the declared ones; V
    m/s."""
    block, m = view.block, view.direction
    gyro_noise_variance, model_noise_std, uncertainty_bound, drift_intensity = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        gyro_noise_variance += (
            m[i] * m[i] * blocks[PITCH_BLOCK if i == PITCH else LATERAL_BLOCK].gyro_noise_variance[i // 2]
        )
        model_noise_std += abs(m[i]) * np.sqrt(noise_model.acceleration_variance_by_input_noise[i])
        if view.is_immune_to_vane_error:
            model_noise_std += abs(m[i]) * forces.angular_acceleration_by_gust_noise_std[i]
        uncertainty_bound += abs(m[i]) * (
            noise_model.uncertainty_bound[i] + noise_model.additional_bound_for_surface_anywhere[i]
        )
    for force_index, force_record in enumerate(forces.component):
        model_noise_std += abs(m[SIDE_FORCE + force_index]) * np.sqrt(
            force_record.noise_variance_with_without_vane[view.uses_inertial_flow_angle]
        )
        if view.uses_inertial_flow_angle:
            drift_intensity += (
                m[SIDE_FORCE + force_index] * forces.dynamic_pressure_over_trim
            ) ** 2 * force_record.inertial_innovation_drift_intensity
        uncertainty_bound += abs(m[SIDE_FORCE + force_index]) * (
            force_record.deflection_error_effect_bound * forces.dynamic_pressure_over_trim
            + force_record.force_flow_lag_error_bound
        )
    if gust.output.accounts_for_gusts:
        fill_air_rotation_sensitivity(view, forces, gust.output.rate_damping)
        if subtracts_gust_estimate(view, gust):
            drift_intensity += remaining_gust_drift_intensity(
                gust_estimate_of_view(view, gust, inertial_gust),
                V,
                view.rate_gust_sensitivity,
                view.force_gust_sensitivity,
            )
        else:
            drift_intensity += full_gust_drift_intensity(
                gust, V, view.rate_gust_sensitivity, view.force_gust_sensitivity
            )
        for i in range(3):
            for j in range(3):
                block.P_dd[0, 0] += m[i] * m[j] * gust.output.acceleration_variance_by_axes_turn[i, j]
    lower_limited_uncertainty_bound = max(
        uncertainty_bound, likelihood.MIN_UNCERTAINTY_BOUND_FOR_DRIFT_RAD_S2
    )
    block.gyro_noise_variance[0] = gyro_noise_variance
    block.model_noise_variance[0] = model_noise_std * model_noise_std
    view.uncertainty_bound[0] = uncertainty_bound
    block.drift_intensity[0, 0] = (
        drift_intensity
        + noise_model.drift_intensity_over_squared_bound
        * lower_limited_uncertainty_bound
        * lower_limited_uncertainty_bound
    )


@kernel
def fill_view_regressors(view, blocks, forces, gust, inertial_gust, angular_acceleration_innovation):
    """Fill the regressors of a view: projections of those of the rates' block, of the force, of the leak.

    angular_acceleration_innovation (3,) rad/s2.
    """
    block, m = view.block, view.direction
    first_component, second_component = view.plane_axes[0], view.plane_axes[1]
    rate_block = blocks[PITCH_BLOCK if first_component == PITCH else LATERAL_BLOCK]
    for j in range(rate_block.n_regressors):
        if first_component == PITCH:
            block.regressor[j, 0] = m[PITCH] * rate_block.regressor[j, 0]
        else:
            block.regressor[j, 0] = m[ROLL] * rate_block.regressor[j, 0] + m[YAW] * rate_block.regressor[j, 1]
    next_regressor_index = rate_block.n_regressors
    if second_component >= SIDE_FORCE and m[second_component] != 0.0:
        force_record = forces.component[second_component - SIDE_FORCE]
        for j in range(force_record.n_regressors):
            block.regressor[next_regressor_index + j, 0] = m[second_component] * force_record.regressor[j]
        next_regressor_index += force_record.n_regressors
        if view.uses_inertial_flow_angle:
            block.regressor[next_regressor_index, 0] = (
                m[second_component] * force_record.innovation_per_flow_angle_drift
            )
            next_regressor_index = next_regressor_index + 1
    if view.orthogonal_to_surface != AXIS_VIEW:
        block.regressor[next_regressor_index, 0] = 0.0
        for i in range(m.size):
            if view.unit_column[i] != 0.0:
                view_innovation_component = innovation_component_for_view(
                    view, forces, gust, inertial_gust, angular_acceleration_innovation, i
                )
                block.regressor[next_regressor_index, 0] += (
                    view.column_leak_share * view.unit_column[i] * view_innovation_component
                )


@kernel
def set_view_use_directions_signatures(views, forces, gust, bound_record, G, Gu):
    """Bring the direction and the signatures of each view to this frame.

    G (3, n) rad/s2 per rad, Gu (3, n) rad/s2: control effectiveness and effect of each surface in the frame.
    """
    for view in views:
        view.is_used = not uses_force(view) or (
            forces.in_use and forces.n_updates_capped_at_minimum == MIN_FORCE_UPDATES
        )
        if view.is_used:
            view.column_leak_share = (
                set_view_direction_and_return_leak_share(view, forces, gust, bound_record, G)
                if view.orthogonal_to_surface != AXIS_VIEW
                else 0.0
            )
            fill_view_signatures(view, forces, Gu)


@kernel
def fill_view_innovations_noise_regressors(
    views,
    uses_regressors,
    noise_model,
    blocks,
    forces,
    gust,
    inertial_gust,
    angular_acceleration_innovation,
    V,
):
    """Project the innovation (3,) rad/s2 on the direction of each view, into `frame_innovation` of its block.

    Fill the noise too, and with `uses_regressors` the regressors of constant errors; V m/s.
    """
    for view in views:
        if not view.is_used:
            continue
        set_view_noise_drift_and_bound(view, noise_model, blocks, forces, gust, inertial_gust, V)
        m, projected_innovation = view.direction, view.block.frame_innovation
        projected_innovation[0] = 0.0
        for i in range(m.size):
            if m[i] != 0.0:
                projected_innovation[0] += m[i] * innovation_component_for_view(
                    view, forces, gust, inertial_gust, angular_acceleration_innovation, i
                )
        if uses_regressors or view.always_uses_regressors:
            fill_view_regressors(view, blocks, forces, gust, inertial_gust, angular_acceleration_innovation)


@kernel
def update_view_tests(views, test_config, tone_test_config, y, dt, frame_index, is_alarm_latched):
    """Update filter and tests of each view with frame k, as `statistical.update_blocks`; y (5,) measured."""
    is_inside_envelope = is_within_envelope(tone_test_config, y)
    evidence_decay_factor = test_config.evidence_decay_factor if is_alarm_latched else 1.0
    onset_slot = likelihood.onset_slot_restarting_at_frame(frame_index)
    for view in views:
        if not view.is_used:
            view.decaying_peak_score = 0.0
            continue
        if not is_alarm_latched:
            likelihood.reset_onset_slot(view.block, onset_slot)
        uses_regressors = test_config.uses_regressors or view.always_uses_regressors
        likelihood.update_block(
            view.block, view.uncertainty_bound, uses_regressors, dt, evidence_decay_factor
        )
        if (
            not view.uses_inertial_flow_angle
        ):  # the error of the integrated angle oscillates with the aircraft's own modes
            update_tone_tests(
                view, tone_test_config, test_config.alarm_level, is_inside_envelope, uses_regressors, dt
            )
        view.decaying_peak_score = max(
            (1.0 - (1.0 - test_config.evidence_decay_factor) / PEAK_SCORE_TO_EVIDENCE_MEMORY_RATIO)
            * view.decaying_peak_score,
            max_test_score_of_view(view),
        )


@kernel
def can_surface_fault_change_view(view, forces, s, angular_effectiveness_column):
    """True if a fault of surface s, with this angular_effectiveness_column (3,) of G, changes the projection
    of a view."""
    if view.orthogonal_to_surface == s:
        return False
    m, projected_effect_per_rad = view.direction, 0.0
    for i in range(3):
        projected_effect_per_rad += m[i] * angular_effectiveness_column[i]
    for force_index in range(2):
        projected_effect_per_rad += (
            m[SIDE_FORCE + force_index]
            * forces.component[force_index].specific_force_over_chord_per_surface_rad[s]
        )
    return projected_effect_per_rad != 0.0


@kernel
def max_test_score_of_view(view):
    """The largest score of the tests of a view."""
    largest_score = view.tone_tests.score
    for h in range(view.block.n_hypotheses):
        largest_score = max(largest_score, view.block.hypothesis[h].score)
    return largest_score


@kernel
def score_confirmed_without_vane(view, views, test_config, forces, gust):
    """The score of a view, limited by the views that confirm that it is not an error of a vane.

    A view of the rates alone needs no confirmation: no error of a vane changes the rates alone. Peak scores
    are compared because the view and its confirmation may reach their levels at different times. The
    confirming view must reach the level of the isolation, sqrt(2 isolation_llr_margin).
    """
    if uses_force(view) and not forces.in_use:
        return 0.0
    if view.is_immune_to_vane_error or not (uses_force(view) or subtracts_gust_estimate(view, gust)):
        return max_test_score_of_view(view)
    max_confirming_peak_score = 0.0
    for other_view in views:
        if other_view.is_immune_to_vane_error and other_view.plane_axes[1] == view.confirming_force_component:
            max_confirming_peak_score = max(max_confirming_peak_score, other_view.decaying_peak_score)
    return min(
        view.decaying_peak_score,
        max_confirming_peak_score * test_config.alarm_level / np.sqrt(2.0 * test_config.isolation_llr_margin),
    )


@kernel
def view_alarm_score(view, views, test_config, forces, gust):
    """The score with which a view raises the alarm, 0 if it raises none.

    Views raise it only where no block of the rates tests: for an oscillation about an axis, and for a
    force, if accelerometers cannot break.
    """
    if view.orthogonal_to_surface == AXIS_VIEW and not view.uses_inertial_flow_angle:
        return view.tone_tests.score
    is_mostly_force = (
        view.plane_axes[1] >= SIDE_FORCE
        and abs(view.direction[view.plane_axes[1]]) > MIN_FORCE_COMPONENT_OF_FORCE_VIEW
    )
    if view.orthogonal_to_surface >= 0 and is_mostly_force and gust.output.uses_accelerometers == 1:
        return score_confirmed_without_vane(view, views, test_config, forces, gust)
    return 0.0


@kernel
def views_exclude_surface(views, test_config, forces, gust, s, angular_effectiveness_column):
    """True if a view detects a signal that no fault of surface s, with this angular_effectiveness_column (3,)
    of G, can cause."""
    for view in views:
        can_exclude_surface = not view.is_immune_to_vane_error and not can_surface_fault_change_view(
            view, forces, s, angular_effectiveness_column
        )
        if (
            can_exclude_surface
            and score_confirmed_without_vane(view, views, test_config, forces, gust) > test_config.alarm_level
        ):
            return True
    return False


class ParityDirection(NamedTuple):
    """A parity direction as it is set up.

    orthogonal_to_surface: the surface to whose column it is orthogonal, or ORTHOGONAL_TO_VANE_ERROR, or
    AXIS_VIEW; initial_direction: at the start of the flight; loss_tested_surface_indices: their indices;
    uses_inertial_flow_angle: the force is that at the flow angle from inertial motion.
    """

    orthogonal_to_surface: int
    initial_direction: tuple[float, ...]
    plane_axes: tuple[int, int]
    loss_tested_surface_indices: list[int]
    uses_inertial_flow_angle: bool = False
    may_use_vane_gust_estimate: bool = (
        False  # for the gust estimate in moving air, which has no rolling component
    )


def iterate_parity_directions(aircraft: Aircraft, uses_forces: bool = False) -> Iterator[ParityDirection]:
    """The parity directions of an aircraft: each axis, and in roll and yaw across each surface's column.

    With accelerometers also, in the plane of a rate and its force, across the column of each surface that
    moves both and across that of the vane; and the force at the flow angle from inertial motion.
    """
    pitch_surface_indices = [s for s, axis in enumerate(aircraft.dominant_axis) if axis == PITCH]
    lateral_surface_indices = [s for s, axis in enumerate(aircraft.dominant_axis) if axis != PITCH]
    yield ParityDirection(
        AXIS_VIEW,
        _sum_of_unit_vectors((PITCH,)),
        PITCH_AND_NORMAL_FORCE,
        pitch_surface_indices,
        may_use_vane_gust_estimate=True,
    )
    yield ParityDirection(AXIS_VIEW, _sum_of_unit_vectors((ROLL,)), ROLL_AND_YAW, lateral_surface_indices)
    yield ParityDirection(
        AXIS_VIEW,
        _sum_of_unit_vectors((YAW,)),
        ROLL_AND_YAW,
        lateral_surface_indices,
        may_use_vane_gust_estimate=True,
    )
    for s in lateral_surface_indices:
        is_roll_surface = aircraft.dominant_axis[s] == ROLL
        other_surface_indices = [
            other_surface_index for other_surface_index in lateral_surface_indices if other_surface_index != s
        ]
        yield ParityDirection(
            s,
            _sum_of_unit_vectors((ROLL,)),
            ROLL_AND_YAW,
            other_surface_indices,
            may_use_vane_gust_estimate=is_roll_surface,
        )
    if not uses_forces:
        return
    for force_index, plane_axes, plane_surface_indices in (
        (NORMAL_INDEX_AMONG_FORCES, PITCH_AND_NORMAL_FORCE, pitch_surface_indices),
        (SIDE_INDEX_AMONG_FORCES, YAW_AND_SIDE_FORCE, lateral_surface_indices),
    ):
        force_separable_surface_indices = aircraft.separated_by_force(FORCE_COEFFICIENT_NAMES[force_index])
        for s in force_separable_surface_indices:
            column_components = aircraft.dominant_axis[s], plane_axes[1]
            yield ParityDirection(
                s,
                _sum_of_unit_vectors(column_components),
                column_components,
                [
                    other_surface_index
                    for other_surface_index in plane_surface_indices
                    if other_surface_index != s
                ],
            )
        if force_separable_surface_indices:
            yield ParityDirection(
                ORTHOGONAL_TO_VANE_ERROR, _sum_of_unit_vectors(plane_axes), plane_axes, plane_surface_indices
            )
            yield ParityDirection(
                AXIS_VIEW,
                _sum_of_unit_vectors(plane_axes[1:]),
                plane_axes,
                plane_surface_indices,
                uses_inertial_flow_angle=True,
            )


def _sum_of_unit_vectors(component_indices: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(float(i in component_indices) for i in range(NORMAL_FORCE + 1))


def required_record_size(aircraft: Aircraft) -> StatisticalRecordSize:
    """The capacities that the records of an aircraft need."""
    axes_of_moment_terms = [moment_axis_of_term(term) for term in aircraft.moments]
    parity_directions = list(iterate_parity_directions(aircraft, aircraft.forces_separate_surfaces))
    max_rate_regressors = N_INPUT_READINGS + max(
        axes_of_moment_terms.count(PITCH), axes_of_moment_terms.count(ROLL) + axes_of_moment_terms.count(YAW)
    )
    max_force_regressors = (
        max(
            len(terms_of_one_force(aircraft, force_index))
            for force_index in (SIDE_INDEX_AMONG_FORCES, NORMAL_INDEX_AMONG_FORCES)
        )
        + forces.MAX_FORCE_REGRESSORS
        - MAX_TERMS_OF_ONE
    )
    axes_of_losses = [
        aircraft.dominant_axis[aircraft.surfaces.index(surface_name)]
        for surface_name in aircraft.class_of_losses
    ]
    max_loss_surfaces_per_rate_block = max(
        axes_of_losses.count(PITCH), axes_of_losses.count(ROLL) + axes_of_losses.count(YAW)
    )
    max_tested_losses_per_view = max(
        len(parity_direction.loss_tested_surface_indices) for parity_direction in parity_directions
    )
    model_error_map = aircraft.file.model_error_map
    n_boxes = len(model_error_map.boxes) if model_error_map else 0
    return StatisticalRecordSize(
        BlockCapacity(max_rate_regressors, 3 * max_loss_surfaces_per_rate_block + 2),
        BlockCapacity(max_rate_regressors + max_force_regressors + 2, max_tested_losses_per_view + 1),
        len(parity_directions),
        n_boxes,
    )


def configure_parity_views(statistical: np.void, aircraft: Aircraft) -> None:
    """Fill the views of a statistical record whose blocks and forces are already set up."""
    forces = statistical["forces"]
    accounts_for_gusts = bool(statistical["gust"]["output"]["accounts_for_gusts"])
    subtracts_gust_estimate_from_rates = (
        forces["in_use"]
        and accounts_for_gusts
        and all(
            aircraft.separated_by_force(FORCE_COEFFICIENT_NAMES[force_index])
            for force_index in (SIDE_INDEX_AMONG_FORCES, NORMAL_INDEX_AMONG_FORCES)
        )
    )
    parity_directions = list(iterate_parity_directions(aircraft, bool(forces["in_use"])))
    statistical["n_views"] = min(len(parity_directions), len(statistical["views"]))
    for view, parity_direction in zip(statistical["views"], parity_directions, strict=False):
        if subtracts_gust_estimate_from_rates and parity_direction.may_use_vane_gust_estimate:
            view["confirming_force_component"] = (
                NORMAL_FORCE if parity_direction.plane_axes == PITCH_AND_NORMAL_FORCE else SIDE_FORCE
            )
        _configure_view(view, parity_direction, accounts_for_gusts)
        rate_block = statistical["block"][
            PITCH_BLOCK if parity_direction.plane_axes == PITCH_AND_NORMAL_FORCE else LATERAL_BLOCK
        ]
        _configure_view_filter(view["block"], rate_block)
        _configure_view_regressors(view, parity_direction, rate_block, forces)
        _configure_view_hypotheses(view["block"], parity_direction, accounts_for_gusts)


def _configure_view(view: np.void, parity_direction: ParityDirection, accounts_for_gusts: bool) -> None:
    """Fill the direction of a view, the axis that its alarm names, and which errors it does not see."""
    is_axis_view = parity_direction.orthogonal_to_surface == AXIS_VIEW
    is_orthogonal_to_vane_error = parity_direction.orthogonal_to_surface == ORTHOGONAL_TO_VANE_ERROR
    view["orthogonal_to_surface"] = parity_direction.orthogonal_to_surface
    view["direction"], view["plane_axes"] = parity_direction.initial_direction, parity_direction.plane_axes
    view["alarm_axis"] = (
        parity_direction.initial_direction.index(1.0)
        if is_axis_view and not parity_direction.uses_inertial_flow_angle
        else parity_direction.plane_axes[0]
    )
    view["is_orthogonal_to_rolling_gust"] = (
        is_orthogonal_to_vane_error
        and parity_direction.plane_axes == YAW_AND_SIDE_FORCE
        and accounts_for_gusts
    )
    view["uses_inertial_flow_angle"] = parity_direction.uses_inertial_flow_angle
    view["is_immune_to_vane_error"] = parity_direction.uses_inertial_flow_angle or is_orthogonal_to_vane_error
    if any(parity_direction.initial_direction[SIDE_FORCE:]):
        view["confirming_force_component"] = parity_direction.plane_axes[1]
        view["always_uses_regressors"] = 1


def _configure_view_filter(block: np.void, rate_block: np.void) -> None:
    """Fill the filter of a view's block, of one axis, from the block of the rates that the view combines."""
    block["n_axes"], block["drift_decay_factor"] = 1, 1.0
    block["P_xx"][0, 0] = rate_block["gyro_noise_variance"].max()
    block["P_dd"][0, 0] = likelihood.PRIOR_DRIFT_STD_RAD_S2**2
    for field_name in (
        "alarm_level",
        "noise_share_of_alarm_level",
        "uncertainty_change_over_bound_per_frame",
    ):
        block[field_name] = rate_block[field_name]


def _configure_view_regressors(
    view: np.void, parity_direction: ParityDirection, rate_block: np.void, forces: np.void
) -> None:
    """Fill the tolerances of a view's regressors: those of its rates, of its force, of the flow angle from
    inertial motion, and that of the leak, which is worked out in flight."""
    tolerances = [rate_block["regressor_tolerance"][: rate_block["n_regressors"]]]
    if any(parity_direction.initial_direction[SIDE_FORCE:]):
        force_record = forces["component"][parity_direction.plane_axes[1] - SIDE_FORCE]
        tolerances.append(force_record["regressor_tolerance"][: force_record["n_regressors"]])
        if parity_direction.uses_inertial_flow_angle:
            tolerances.append([force_record["flow_angle_drift_bound"]])
    if parity_direction.orthogonal_to_surface != AXIS_VIEW:
        tolerances.append([1.0])
    every_tolerance = np.concatenate(tolerances)
    view["block"]["n_regressors"] = len(every_tolerance)
    view["block"]["regressor_tolerance"][: len(every_tolerance)] = every_tolerance


def _configure_view_hypotheses(
    block: np.void, parity_direction: ParityDirection, accounts_for_gusts: bool
) -> None:
    """Fill the hypotheses of a view: a step of its innovation, and a loss of each surface that it tests."""
    # A law that uses the vanes reacts to a gust before the gyros measure its pitching effect, and these
    # views do not use the vanes. The elevator's effect then correlates with the noise: no loss is tested.
    is_pitch_view_in_gusts = accounts_for_gusts and parity_direction.initial_direction[PITCH]
    loss_surface_indices = (
        []
        if is_pitch_view_in_gusts
        else list(parity_direction.loss_tested_surface_indices[: len(block["hypothesis"]) - 1])
    )
    hypothesis_kinds = [STEP_FAULT, *(LOSS for _ in loss_surface_indices)]
    block["n_hypotheses"] = len(hypothesis_kinds)
    hypotheses = block["hypothesis"][: len(hypothesis_kinds)]
    hypotheses["kind"], hypotheses["surface"] = hypothesis_kinds, [-1, *loss_surface_indices]
    likelihood.set_supporting_correlation_signs(block, hypothesis_kinds)


@kernel
def fill_block_signatures(blocks, Gu, acceleration_per_alpha_cubed_coefficient):
    """Fill the signatures of the blocks of the rates, rad/s2.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame; acceleration_per_alpha_cubed_coefficient
    rad/s2: pitch acceleration of a coefficient 1 of alpha^3.
    """
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            for i in range(block.n_axes):
                if hypothesis.surface >= 0:
                    hypothesis.signature[i] = Gu[block.axes[i], hypothesis.surface]
                elif hypothesis.kind == STEP_FAULT:
                    hypothesis.signature[i] = 1.0 if hypothesis.axis == block.axes[i] else 0.0
                else:
                    hypothesis.signature[i] = acceleration_per_alpha_cubed_coefficient


@kernel
def fill_view_signatures(view, forces, Gu):
    """Fill the projections of the signatures on the direction of a view: of a step, and of losses.

    Gu (3, n) rad/s2: effect of each surface, mean over the frame.
    """
    block, m = view.block, view.direction
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        s = hypothesis.surface
        hypothesis.signature[0] = 1.0
        if hypothesis.kind != STEP_FAULT:
            projected_surface_acceleration = m[0] * Gu[0, s] + m[1] * Gu[1, s] + m[2] * Gu[2, s]
            for force_index in range(2):
                projected_surface_acceleration += (
                    m[SIDE_FORCE + force_index]
                    * forces.component[force_index].specific_force_over_chord_of_surface_at_command[s]
                )
            hypothesis.signature[0] = projected_surface_acceleration
