"""Generalised likelihood ratio tests on the whitened innovation [Willsky1976].

The innovation is whitened by a Kalman filter:

    x[k+1] = x[k] + dt (F[k] + d[k] + phi[k])      d[k+1] = a d[k] + drift      measured: x + gyro noise

x are the rates, rad/s; F, rad/s2, is the acceleration of the design model; d, rad/s2, is the drift: a slow
error of F by rotation of the air, by bounded uncertainty, by unknown constants. phi, rad/s2, is a fault. With
a = 1 the drift is a random walk, so a constant error does not appear in the whitened innovation. The filter
is linear, so the response to a fault or to an error of a coefficient is worked out by itself and compared
with the innovation:

    g = e + dt (nu - d)      e <- g - K_x g      d <- a d + K_d g

nu, rad/s2, is the innovation of the frame as an acceleration; e, rad/s, is the remaining error of the rate.

A hypothesis is a fault phi = theta s(t) from an onset on, with s(t) a known signature. g_s is the response of
the whitening filter to the signature, g the whitened innovation, rad/s, S its covariance:

    N = sum g_s' S^-1 g,  D = sum g_s' S^-1 g_s:      theta_hat = N / D,   log likelihood ratio N^2 / 2 D

Without a fault N / sqrt(D) is standard normal (or smaller, if the noise is smaller than declared). The alarm
level follows from the declared rate of false alarms by the union bound over hypotheses, onsets and frames.

Errors of coefficients are constants c_j, |c_j| <= tol_j, times known regressors r_j. Through the same filter
they add sum_j c_j R_j to N, with R_j = sum g_s' S^-1 g_rj. That is at most sum_j tol_j |R_j|, which is
subtracted from the evidence.

A bounded uncertainty |d| <= eta_bar is not noise. g_d is its response of the filter. The response to a unit
constant settles at g_0; the response to a unit step also has a transient whose sum is 1 / K_d and whose
magnitudes sum to at most RINGING / K_d. With w = S^-1 g_s, summation by parts gives

    |sum w' g_d| <= eta_bar (|g_0| sum |w| + RINGING / K_d TV(w)),     TV(w) = sum |w[k] - w[k-1]|

d changes by at most eta_bar omega dt in a frame, so omega dt sum |w| may replace TV(w). An alarm requires
more evidence than this bound explains.

A growing loss is a loss times 1 - exp(-kappa t). The end of a loss is a step of the opposite sign, of the
size that the signature had at the onset. These hypotheses raise no alarm; they are needed to decide whether
a fault of a surface can explain the data.

The declared drift is an upper limit. In calmer air the filter interprets gyro noise as gust, and its
innovation g is then partly predictable: from p = g - g_0, where g_0 is the innovation of a second filter
without gust. The control law reacts to the same noise, so a loss would seem to be present without one. The
fraction of p in g is estimated, lambda = sum p' S^-1 g / sum p' S^-1 p: 0 in air as declared, 1 in calm air.
The evidence that lambda p contributes is subtracted.

A gust may be visible to the vanes only roughly, if no force separates it from the aircraft's own motion
(gusts.py). It correlates with the surfaces of a law that uses the vanes. Its response is whitened likewise,
and the evidence that it contributes is subtracted.

Onsets: slot j restarts every 2^(j+1) frames, so that onsets of about every age exist at any time. After an
alarm no slot restarts, and old evidence decays slowly.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.state import LOSS

# A block is a set of axes with correlated noise: pitch, and roll with yaw, the latter twice. The state of a
# filter is e, then d.
PITCH_BLOCK, LATERAL_BLOCK, MEAN_REVERTING_LATERAL_BLOCK = (
    0,
    1,
    2,
)  # the last: roll and yaw again, with a drift that returns to zero
N_FILTER_BLOCKS = 3
N_ONSET_SLOTS = 10
N_INPUT_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power: statistical.py
USUAL_MAX_HYPOTHESES_PER_BLOCK = (
    8  # of a block of the rates of most aircraft: three losses, and the alternatives to them
)
MIN_UNCERTAINTY_BOUND_FOR_DRIFT_RAD_S2 = (
    1e-3  # lower limit of the bound that sets the drift: the bound may pass zero
)
STEP_FAULT, ALPHA_CUBED_MOMENT, GROWING_LOSS, LOSS_END = 2, 3, 4, 5  # further kinds of hypothesis
# Sign of N that supports a hypothesis: a loss removes moment, its end restores moment; 0: both signs.
SUPPORTING_CORRELATION_SIGN_BY_KIND = {
    LOSS: -1.0,
    STEP_FAULT: 0.0,
    ALPHA_CUBED_MOMENT: 0.0,
    GROWING_LOSS: -1.0,
    LOSS_END: 1.0,
}

PRIOR_DRIFT_STD_RAD_S2 = 1.0  # standard deviation of the drift at the start of a flight; soon irrelevant
PRIOR_LOSS_INFORMATION = 12.0  # one over the variance of a loss that is uniform on [0, 1]
# The magnitudes of a second-order transient of damping 0.7 sum to 1.09 times its sum; on two axes to more.
TRANSIENT_RINGING_SUM_FACTOR = 1.2

# Time constant, s, of the estimate of lambda: long compared with a filter's memory, short compared with
# changes of the weather.
CALM_AIR_SHARE_MEMORY_S = 2.0
CALM_AIR_SHARE_PRIOR_INFORMATION = 4.0  # prior information for lambda = 1 (calm air), units of sum p' S^-1 p
STDS_ADDED_TO_CALM_AIR_SHARE = 2.0  # standard deviations by which lambda is taken larger than estimated

HYPOTHESIS_RECORD = record(
    kind=int, surface=int, axis=int, raises_alarm=int, score_column_index=int,
    signature=2,  # s of this frame, rad/s2 per unit of theta
    remaining_growth_decay_factor=float,  # exp(-kappa dt) of a growing loss
    score=float,  # largest normalised evidence over the onsets, standard deviations
    theta_estimate=float, theta_information=float,  # estimate at the likeliest onset; one over its variance
    llr_lower_bound=float, llr_upper_bound=float,  # bounds on the log-likelihood ratio against no fault
)  # fmt: skip


class BlockCapacity(NamedTuple):
    """The numbers of regressors and hypotheses for which a block has memory."""

    max_regressors: int
    max_hypotheses: int


# An onset test is one hypothesis with one onset. Those of a few hypotheses lie side by side for vector
# instructions: test (h % HYPOTHESES_PER_TEST_GROUP) * N_ONSET_SLOTS + slot in group
# h // HYPOTHESES_PER_TEST_GROUP. A group has the same size in every record, so compiled code knows that its
# arrays do not overlap. Checking that in each frame took a tenth of the detector's time.
HYPOTHESES_PER_TEST_GROUP = 4
N_ONSET_TESTS_PER_GROUP = HYPOTHESES_PER_TEST_GROUP * N_ONSET_SLOTS
ONSET_TESTS_RECORD = record(
    supporting_correlation_sign=N_ONSET_TESTS_PER_GROUP,  # sign of N that supports the hypothesis, or 0
    signature_for_onset=(2, N_ONSET_TESTS_PER_GROUP),  # s since the onset, rad/s2
    signature_filter_state=(4, N_ONSET_TESTS_PER_GROUP),
    correlation_weight=(2, N_ONSET_TESTS_PER_GROUP),  # w = S^-1 g_s of the frame
    correlation=N_ONSET_TESTS_PER_GROUP, information=N_ONSET_TESTS_PER_GROUP,  # N; D
    max_correlation_by_coefficient_errors=N_ONSET_TESTS_PER_GROUP,  # sum_j tol_j |R_j|
    # exp(-kappa t) of a growing loss; 1 until a loss has ended
    remaining_growth_share=N_ONSET_TESTS_PER_GROUP,
    signature_at_loss_end=(2, N_ONSET_TESTS_PER_GROUP),  # rad/s2
    # shares of |N| that a bounded uncertainty explains: constant; varying by TV(w); varying by its rate of
    # change
    max_correlation_by_constant_uncertainty=N_ONSET_TESTS_PER_GROUP,
    max_correlation_by_varying_uncertainty=N_ONSET_TESTS_PER_GROUP,
    max_correlation_by_rate_limited_uncertainty=N_ONSET_TESTS_PER_GROUP,
    # shares of N: of lambda p; of a roughly visible gust
    correlation_by_calm_air=N_ONSET_TESTS_PER_GROUP, correlation_from_coarse_gust=N_ONSET_TESTS_PER_GROUP,
    score=N_ONSET_TESTS_PER_GROUP,
    llr_lower_bound=N_ONSET_TESTS_PER_GROUP, llr_upper_bound=N_ONSET_TESTS_PER_GROUP,
    llr=N_ONSET_TESTS_PER_GROUP,  # log-likelihood ratio
)  # fmt: skip


_FILTER_FIELD_TYPE_BY_NAME = {
    "n_axes": int, "drift_decay_factor": float, "state": 4, "unscaled_white_innovation_rad_s": 2,
    "P_xx": (2, 2), "P_xd": (2, 2), "P_dd": (2, 2), "drift_intensity": (2, 2), "model_noise_variance": 2,
    "gyro_noise_variance": 2, "S_inverse": (2, 2), "K_x": (2, 2), "K_d": (2, 2),
}  # fmt: skip
FILTER_RECORD = record(**_FILTER_FIELD_TYPE_BY_NAME)


def set_supporting_correlation_signs(block: np.void, hypothesis_kinds: Sequence[int]) -> None:
    """Fill the sign of N that supports each hypothesis, in all of its onset tests."""
    block["onset_tests"]["supporting_correlation_sign"] = 0.0
    for h, kind in enumerate(hypothesis_kinds):
        first_test_index = (h % HYPOTHESES_PER_TEST_GROUP) * N_ONSET_SLOTS
        block["onset_tests"]["supporting_correlation_sign"][
            h // HYPOTHESES_PER_TEST_GROUP, first_test_index : first_test_index + N_ONSET_SLOTS
        ] = SUPPORTING_CORRELATION_SIGN_BY_KIND[kind]


def max_test_groups(capacity: BlockCapacity) -> int:
    """The number of groups of onset tests that the hypotheses of a block need."""
    return (capacity.max_hypotheses + HYPOTHESES_PER_TEST_GROUP - 1) // HYPOTHESES_PER_TEST_GROUP


@sized
def block_dtype(capacity: BlockCapacity) -> np.dtype:
    """A block: its whitening filter and its hypotheses."""
    return record(
        axes=(int, 2),  # first: a record that begins as another does is taken for one
        **_FILTER_FIELD_TYPE_BY_NAME,
        drift_correlation_length_m=float, gust_drift_intensity_factor=float,
        filter_state_after_known_faults=4,
        frame_innovation=2,  # rad/s2
        # in turbulence: the filter without gust, lambda p, and numerator and denominator of lambda
        no_gust_filter=FILTER_RECORD, predictable_innovation_in_calm_air=2, calm_air_cross_correlation=float,
        calm_air_information=float,
        # whether vanes show a gust roughly; its whitened effect, rad/s; the state of its filter
        has_coarse_gust_estimate=int, coarse_gust_response=2, coarse_gust_filter_state=4,
        # alarm level, standard deviations; share of it reserved for noise beyond a bounded uncertainty;
        # omega dt of that uncertainty; its responses: see `fill_uncertainty_response_bounds`
        alarm_level=float, noise_share_of_alarm_level=float, uncertainty_change_over_bound_per_frame=float,
        settled_uncertainty_response_bound=2, transient_response_sum_bound=2,
        n_regressors=int, regressor_tolerance=capacity.max_regressors, regressor=(capacity.max_regressors, 2),
        regressor_filter_state=(capacity.max_regressors, 4), regressor_response=(capacity.max_regressors, 2),
        n_hypotheses=int, hypothesis=(HYPOTHESIS_RECORD, capacity.max_hypotheses),
        onset_tests=(ONSET_TESTS_RECORD, max_test_groups(capacity)),
        # R_j of each onset test
        regressor_correlation=(max_test_groups(capacity), capacity.max_regressors, N_ONSET_TESTS_PER_GROUP),
    )  # fmt: skip


def new_filter_block(P: np.ndarray, R: np.ndarray) -> np.ndarray:
    """A block (1,) that filters n rates and has no hypotheses.

    P (2 n, 2 n): covariance of rates and their drift; R (n,): variance of a reading's noise."""
    array_of_one_block, n = np.zeros(1, block_dtype(BlockCapacity(1, 1))), len(R)
    block, rate_slice, drift_slice = array_of_one_block[0], slice(0, n), slice(n, 2 * n)
    block["n_axes"], block["axes"], block["gyro_noise_variance"][:n] = n, (0, 1), R
    for covariance_name, row_slice, column_slice in (
        ("P_xx", rate_slice, rate_slice),
        ("P_xd", rate_slice, drift_slice),
        ("P_dd", drift_slice, drift_slice),
    ):
        block[covariance_name][:n, :n] = P[row_slice, column_slice]
    return array_of_one_block


@kernel
def invert_symmetric_in_place(n, S):
    """Replace the leading n x n part of a symmetric S (2, 2), n at most 2, by its inverse."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    off_diagonal = 0.5 * (S[0, 1] + S[1, 0])
    determinant = S[0, 0] * S[1, 1] - off_diagonal * off_diagonal
    S[0, 0], S[1, 1] = S[1, 1] / determinant, S[0, 0] / determinant
    S[0, 1] = S[1, 0] = -off_diagonal / determinant


@kernel
def predict_covariance(block, dt):
    """Predict the covariances over a frame of dt s, and fill `S_inverse` with S, yet to be inverted."""
    P_xx, P_xd, P_dd, S_before_inversion = block.P_xx, block.P_xd, block.P_dd, block.S_inverse
    for i in range(block.n_axes):
        for j in range(block.n_axes):
            P_xx[i, j] += dt * (P_xd[i, j] + P_xd[j, i]) + dt * dt * P_dd[i, j]
        P_xx[i, i] += dt * dt * block.model_noise_variance[i]
    for i in range(block.n_axes):
        for j in range(block.n_axes):
            P_xd[i, j] = block.drift_decay_factor * (P_xd[i, j] + dt * P_dd[i, j])
            P_dd[i, j] = (
                block.drift_decay_factor * block.drift_decay_factor * P_dd[i, j]
                + dt * block.drift_intensity[i, j]
            )
            S_before_inversion[i, j] = P_xx[i, j]
        S_before_inversion[i, i] += block.gyro_noise_variance[i]


@kernel
def fill_kalman_gains(block):
    """Fill the Kalman gains K_x = P_xx S^-1 and K_d = P_xd' S^-1, (n, n)."""
    for i in range(block.n_axes):
        for j in range(block.n_axes):
            rate_gain_entry, drift_gain_entry = 0.0, 0.0
            for k in range(block.n_axes):
                rate_gain_entry += block.P_xx[i, k] * block.S_inverse[k, j]
                drift_gain_entry += block.P_xd[k, i] * block.S_inverse[k, j]
            block.K_x[i, j], block.K_d[i, j] = rate_gain_entry, drift_gain_entry


@kernel
def update_covariance(block):
    """Update the covariances for the measurement: P <- P - K S K'."""
    rate_gain, drift_gain = block.K_x, block.K_d
    for j in range(2):  # a column follows from itself alone
        P_xx_0j, P_xx_1j = block.P_xx[0, j], block.P_xx[1, j]
        P_xd_0j, P_xd_1j = block.P_xd[0, j], block.P_xd[1, j]
        for i in range(block.n_axes):
            block.P_dd[i, j] -= drift_gain[i, 0] * P_xd_0j + drift_gain[i, 1] * P_xd_1j
            block.P_xx[i, j] -= rate_gain[i, 0] * P_xx_0j + rate_gain[i, 1] * P_xx_1j
            block.P_xd[i, j] -= rate_gain[i, 0] * P_xd_0j + rate_gain[i, 1] * P_xd_1j


@kernel
def advance_covariance(block, dt):
    """Predict the covariances, fill the gains, update the covariances for the frame just measured; dt s."""
    predict_covariance(block, dt)
    invert_symmetric_in_place(block.n_axes, block.S_inverse)
    fill_kalman_gains(block)
    update_covariance(block)


@kernel
def advance_whitening_filter(block, filter_state, input_acceleration, dt, out):
    """Advance the filter by one frame of input_acceleration (2,) rad/s2; dt s.

    filter_state (4,): e, rad/s, and d, rad/s2; advanced in place. out (2,) rad/s: the whitened response g;
    that of the innovation has covariance S.
    """
    for i in range(block.n_axes):
        out[i] = filter_state[i] + dt * (input_acceleration[i] - filter_state[2 + i])
    for i in range(block.n_axes):
        remaining_rate_error, drift_correction = out[i], 0.0
        for j in range(block.n_axes):
            remaining_rate_error -= block.K_x[i, j] * out[j]
            drift_correction += block.K_d[i, j] * out[j]
        filter_state[i] = remaining_rate_error
        filter_state[2 + i] = block.drift_decay_factor * filter_state[2 + i] + drift_correction


@kernel
def whiten_regressors(block, dt):
    """Whiten all regressors as `advance_whitening_filter` does.

    In a block of one axis all values of a second axis are zero.
    """
    rate_gain, drift_gain, drift_decay_factor = block.K_x, block.K_d, block.drift_decay_factor
    rate_gain_00, rate_gain_01 = rate_gain[0, 0], rate_gain[0, 1]
    rate_gain_10, rate_gain_11 = rate_gain[1, 0], rate_gain[1, 1]
    drift_gain_00, drift_gain_01 = drift_gain[0, 0], drift_gain[0, 1]
    drift_gain_10, drift_gain_11 = drift_gain[1, 0], drift_gain[1, 1]
    regressors = block.regressor
    filter_states = block.regressor_filter_state
    responses = block.regressor_response
    for j in range(block.n_regressors):
        response_0 = filter_states[j, 0] + dt * (regressors[j, 0] - filter_states[j, 2])
        response_1 = filter_states[j, 1] + dt * (regressors[j, 1] - filter_states[j, 3])
        responses[j, 0], responses[j, 1] = response_0, response_1
        filter_states[j, 0] = response_0 - rate_gain_00 * response_0 - rate_gain_01 * response_1
        filter_states[j, 1] = response_1 - rate_gain_10 * response_0 - rate_gain_11 * response_1
        filter_states[j, 2] = drift_decay_factor * filter_states[j, 2] + (
            drift_gain_00 * response_0 + drift_gain_01 * response_1
        )
        filter_states[j, 3] = drift_decay_factor * filter_states[j, 3] + (
            drift_gain_10 * response_0 + drift_gain_11 * response_1
        )


@kernel
def whiten_by_no_gust_filter(block, dt):
    """Whiten the frame, `frame_innovation`, rad/s2, by the filter without gust; dt s."""
    advance_covariance(block.no_gust_filter, dt)
    advance_whitening_filter(
        block.no_gust_filter,
        block.no_gust_filter.state,
        block.frame_innovation,
        dt,
        block.no_gust_filter.unscaled_white_innovation_rad_s,
    )


@kernel
def update_predictable_innovation(block, dt):
    """Fill `predictable_innovation_in_calm_air` (2,) rad/s with lambda p, the part of g that calm air makes
    predictable.

    lambda is estimated over the last CALM_AIR_SHARE_MEMORY_S. `whiten_by_no_gust_filter` must have run for
    this frame.
    """
    no_gust_filter = block.no_gust_filter
    predictable_innovation = block.predictable_innovation_in_calm_air
    unscaled_white_innovation_rad_s = block.unscaled_white_innovation_rad_s
    sum_decay_factor = np.exp(-dt / CALM_AIR_SHARE_MEMORY_S)
    block.calm_air_cross_correlation *= sum_decay_factor
    block.calm_air_information *= sum_decay_factor
    for i in range(block.n_axes):
        predictable_innovation[i] = (
            unscaled_white_innovation_rad_s[i] - no_gust_filter.unscaled_white_innovation_rad_s[i]
        )
    for i in range(block.n_axes):
        for j in range(block.n_axes):
            block.calm_air_cross_correlation += (
                predictable_innovation[i] * block.S_inverse[i, j] * unscaled_white_innovation_rad_s[j]
            )
            block.calm_air_information += (
                predictable_innovation[i] * block.S_inverse[i, j] * predictable_innovation[j]
            )
    calm_air_share_denominator = block.calm_air_information + CALM_AIR_SHARE_PRIOR_INFORMATION
    upper_calm_air_share_numerator = (
        block.calm_air_cross_correlation
        + CALM_AIR_SHARE_PRIOR_INFORMATION
        + STDS_ADDED_TO_CALM_AIR_SHARE * sqrt(calm_air_share_denominator)
    )
    upper_calm_air_share = min(max(upper_calm_air_share_numerator / calm_air_share_denominator, 0.0), 1.0)
    for i in range(block.n_axes):
        predictable_innovation[i] *= upper_calm_air_share


@kernel
def onset_slot_restarting_at_frame(frame_index):
    """The slot that restarts at a frame: slot j at odd multiples of 2^j, the last at all other frames."""
    onset_slot = 0
    while frame_index % 2 == 0 and onset_slot < N_ONSET_SLOTS - 1:
        frame_index //= 2
        onset_slot += 1
    return onset_slot


@kernel
def n_onset_tests_in_group(block, group_index):
    """The number of onset tests in use in group g: the first entries of each array."""
    return (
        min(block.n_hypotheses - group_index * HYPOTHESES_PER_TEST_GROUP, HYPOTHESES_PER_TEST_GROUP)
        * N_ONSET_SLOTS
    )


@kernel
def n_test_groups(block):
    """The number of groups of onset tests in use."""
    return (block.n_hypotheses + HYPOTHESES_PER_TEST_GROUP - 1) // HYPOTHESES_PER_TEST_GROUP


@kernel
def reset_onset_slot(block, onset_slot):
    """Restart a slot: its onset is the next frame, without evidence."""
    for group_index in range(n_test_groups(block)):
        onset_tests = block.onset_tests[group_index]
        for k in range(onset_slot, n_onset_tests_in_group(block, group_index), N_ONSET_SLOTS):
            onset_tests.correlation[k] = onset_tests.information[k] = 0.0
            onset_tests.correlation_weight[0, k] = onset_tests.correlation_weight[1, k] = 0.0
            onset_tests.max_correlation_by_constant_uncertainty[
                k
            ] = onset_tests.max_correlation_by_varying_uncertainty[k] = 0.0
            onset_tests.max_correlation_by_rate_limited_uncertainty[k] = 0.0
            onset_tests.correlation_by_calm_air[k] = onset_tests.correlation_from_coarse_gust[k] = 0.0
            onset_tests.remaining_growth_share[k] = 1.0
            for i in range(4):
                onset_tests.signature_filter_state[i, k] = 0.0
            for j in range(block.n_regressors):
                block.regressor_correlation[group_index, j, k] = 0.0


@kernel
def fill_uncertainty_response_bounds(block, uncertainty_bound, dt):
    """Fill `settled_uncertainty_response_bound` and `transient_response_sum_bound` (2,) with eta_bar |g_0|
    and eta_bar RINGING / K_d.

    uncertainty_bound (3,) rad/s2: eta_bar.
    """
    drift_gain, drift_share_lost_per_frame = block.K_d, 1.0 - block.drift_decay_factor
    drift_gain_determinant = (
        drift_gain[0, 0] * drift_gain[1, 1] - drift_gain[0, 1] * drift_gain[1, 0]
        if block.n_axes > 1
        else drift_gain[0, 0]
    )
    for i in range(block.n_axes):
        block.settled_uncertainty_response_bound[i] = block.transient_response_sum_bound[i] = 0.0
        for j in range(block.n_axes):
            drift_gain_cofactor = (
                1.0 if block.n_axes == 1 else (drift_gain[1 - i, 1 - i] if i == j else drift_gain[i, j])
            )
            block.transient_response_sum_bound[i] += (
                TRANSIENT_RINGING_SUM_FACTOR
                * abs(drift_gain_cofactor / drift_gain_determinant)
                * uncertainty_bound[block.axes[j]]
            )
        if drift_share_lost_per_frame > 0.0:
            axis_settled_response_per_constant_uncertainty = (
                dt
                * drift_share_lost_per_frame
                / (block.K_x[i, i] * drift_share_lost_per_frame + dt * drift_gain[i, i])
            )
            block.settled_uncertainty_response_bound[i] = (
                axis_settled_response_per_constant_uncertainty * uncertainty_bound[block.axes[i]]
            )


@kernel
def update_signatures_for_onsets(hypothesis, onset_tests, first_test_index):
    """Fill `signature_for_onset`, rad/s2, of a hypothesis for each onset, from test `first_test_index` on.

    It is the signature of the frame; for a growing loss times 1 - exp(-kappa t); for the end of a loss that
    of the onset.
    """
    frame_signature_0, frame_signature_1 = hypothesis.signature[0], hypothesis.signature[1]
    for k in range(first_test_index, first_test_index + N_ONSET_SLOTS):
        if hypothesis.kind == LOSS_END:
            if onset_tests.remaining_growth_share[k] > 0.0:
                onset_tests.remaining_growth_share[k] = 0.0
                onset_tests.signature_at_loss_end[0, k] = frame_signature_0
                onset_tests.signature_at_loss_end[1, k] = frame_signature_1
            onset_tests.signature_for_onset[0, k] = onset_tests.signature_at_loss_end[0, k]
            onset_tests.signature_for_onset[1, k] = onset_tests.signature_at_loss_end[1, k]
        elif hypothesis.kind == GROWING_LOSS:
            onset_tests.remaining_growth_share[k] *= hypothesis.remaining_growth_decay_factor
            grown_share = 1.0 - onset_tests.remaining_growth_share[k]
            onset_tests.signature_for_onset[0, k] = grown_share * frame_signature_0
            onset_tests.signature_for_onset[1, k] = grown_share * frame_signature_1
        else:
            onset_tests.signature_for_onset[0, k] = frame_signature_0
            onset_tests.signature_for_onset[1, k] = frame_signature_1


@kernel
def whiten_signatures_and_accumulate_sums(block, onset_tests, n_tests, dt, evidence_decay_factor):
    """Whiten `signature_for_onset` of the first n_tests tests, and add the frame to N, D and the bounds on N.

    evidence_decay_factor: factor by which earlier sums decay. In a block of one axis all values of a second
    axis are zero.
    """
    rate_gain, drift_gain, S_inverse = block.K_x, block.K_d, block.S_inverse
    rate_gain_00, rate_gain_01 = rate_gain[0, 0], rate_gain[0, 1]
    rate_gain_10, rate_gain_11 = rate_gain[1, 0], rate_gain[1, 1]
    drift_gain_00, drift_gain_01 = drift_gain[0, 0], drift_gain[0, 1]
    drift_gain_10, drift_gain_11 = drift_gain[1, 0], drift_gain[1, 1]
    S_inv00, S_inv01, S_inv10, S_inv11 = S_inverse[0, 0], S_inverse[0, 1], S_inverse[1, 0], S_inverse[1, 1]
    drift_decay_factor = block.drift_decay_factor
    unscaled_white_innovation_0 = block.unscaled_white_innovation_rad_s[0]
    unscaled_white_innovation_1 = block.unscaled_white_innovation_rad_s[1]
    predictable_innovation_0 = block.predictable_innovation_in_calm_air[0]
    predictable_innovation_1 = block.predictable_innovation_in_calm_air[1]
    transient_response_sum_bound_0 = block.transient_response_sum_bound[0]
    transient_response_sum_bound_1 = block.transient_response_sum_bound[1]
    settled_response_bound_0 = block.settled_uncertainty_response_bound[0]
    settled_response_bound_1 = block.settled_uncertainty_response_bound[1]
    signature_filter_state = onset_tests.signature_filter_state
    signature_for_onset = onset_tests.signature_for_onset
    correlation_weight = onset_tests.correlation_weight
    uncertainty_change_over_bound_per_frame = block.uncertainty_change_over_bound_per_frame
    for k in range(n_tests):
        signature_response_0 = signature_filter_state[0, k] + dt * (
            signature_for_onset[0, k] - signature_filter_state[2, k]
        )
        signature_response_1 = signature_filter_state[1, k] + dt * (
            signature_for_onset[1, k] - signature_filter_state[3, k]
        )
        signature_filter_state[0, k] = (
            signature_response_0 - rate_gain_00 * signature_response_0 - rate_gain_01 * signature_response_1
        )
        signature_filter_state[1, k] = (
            signature_response_1 - rate_gain_10 * signature_response_0 - rate_gain_11 * signature_response_1
        )
        signature_filter_state[2, k] = drift_decay_factor * signature_filter_state[2, k] + (
            drift_gain_00 * signature_response_0 + drift_gain_01 * signature_response_1
        )
        signature_filter_state[3, k] = drift_decay_factor * signature_filter_state[3, k] + (
            drift_gain_10 * signature_response_0 + drift_gain_11 * signature_response_1
        )
        weight_0 = S_inv00 * signature_response_0 + S_inv01 * signature_response_1
        weight_1 = S_inv10 * signature_response_0 + S_inv11 * signature_response_1
        onset_tests.correlation[k] = evidence_decay_factor * onset_tests.correlation[k] + (
            weight_0 * unscaled_white_innovation_0 + weight_1 * unscaled_white_innovation_1
        )
        onset_tests.information[k] = (
            evidence_decay_factor * onset_tests.information[k]
            + weight_0 * signature_response_0
            + weight_1 * signature_response_1
        )
        onset_tests.correlation_by_calm_air[k] = (
            evidence_decay_factor * onset_tests.correlation_by_calm_air[k]
        ) + (weight_0 * predictable_innovation_0 + weight_1 * predictable_innovation_1)
        varying_uncertainty_bound_increment = transient_response_sum_bound_0 * abs(
            weight_0 - correlation_weight[0, k]
        ) + transient_response_sum_bound_1 * abs(weight_1 - correlation_weight[1, k])
        constant_uncertainty_bound_increment = settled_response_bound_0 * abs(
            weight_0
        ) + settled_response_bound_1 * abs(weight_1)
        onset_tests.max_correlation_by_constant_uncertainty[k] = (
            evidence_decay_factor * onset_tests.max_correlation_by_constant_uncertainty[k]
            + constant_uncertainty_bound_increment
        )
        onset_tests.max_correlation_by_varying_uncertainty[k] = (
            evidence_decay_factor * onset_tests.max_correlation_by_varying_uncertainty[k]
            + varying_uncertainty_bound_increment
        )
        onset_tests.max_correlation_by_rate_limited_uncertainty[k] = (
            evidence_decay_factor * onset_tests.max_correlation_by_rate_limited_uncertainty[k]
            + uncertainty_change_over_bound_per_frame
            * (
                transient_response_sum_bound_0 * abs(weight_0)
                + transient_response_sum_bound_1 * abs(weight_1)
            )
        )
        correlation_weight[0, k], correlation_weight[1, k] = weight_0, weight_1


@kernel
def accumulate_regressor_correlation(
    block, onset_tests, regressor_correlation, n_tests, evidence_decay_factor
):
    """Add the frame to R_j of n onset tests, `regressor_correlation` (regressors, tests), and fill their
    `max_correlation_by_coefficient_errors`.

    Regressors go in pairs: weight and bound then pass through memory half as often. LLVM makes vector
    instructions of the loop as it is written; with an index of its own for the second regressor of a pair it
    did not, and the detector took a fifth longer (`make cost` shows it).
    """
    correlation_weight = onset_tests.correlation_weight
    max_correlation_by_coefficient_errors = onset_tests.max_correlation_by_coefficient_errors
    regressor_response, coefficient_error_bounds = block.regressor_response, block.regressor_tolerance
    n_regressors = block.n_regressors
    max_correlation_by_coefficient_errors[:n_tests] = 0.0
    for j in range(0, n_regressors - 1, 2):
        response_a0 = regressor_response[j, 0]
        response_a1 = regressor_response[j, 1]
        response_b0 = regressor_response[j + 1, 0]
        response_b1 = regressor_response[j + 1, 1]
        correlations_a, correlations_b = regressor_correlation[j], regressor_correlation[j + 1]
        error_bound_a, error_bound_b = coefficient_error_bounds[j], coefficient_error_bounds[j + 1]
        for k in range(n_tests):
            weight_0, weight_1 = correlation_weight[0, k], correlation_weight[1, k]
            R_a = evidence_decay_factor * correlations_a[k] + (
                weight_0 * response_a0 + weight_1 * response_a1
            )
            R_b = evidence_decay_factor * correlations_b[k] + (
                weight_0 * response_b0 + weight_1 * response_b1
            )
            correlations_a[k], correlations_b[k] = R_a, R_b
            max_correlation_by_coefficient_errors[k] = (
                max_correlation_by_coefficient_errors[k] + error_bound_a * abs(R_a) + error_bound_b * abs(R_b)
            )
    for j in range(n_regressors - n_regressors % 2, n_regressors):
        response_0, response_1 = regressor_response[j, 0], regressor_response[j, 1]
        for k in range(n_tests):
            regressor_correlation[j, k] = evidence_decay_factor * regressor_correlation[j, k] + (
                correlation_weight[0, k] * response_0 + correlation_weight[1, k] * response_1
            )
            max_correlation_by_coefficient_errors[k] += coefficient_error_bounds[j] * abs(
                regressor_correlation[j, k]
            )


@kernel
def accumulate_correlation_from_coarse_gust(block, onset_tests, n_tests, evidence_decay_factor):
    """Add the frame to the share of N that a roughly visible gust contributes.

    `whiten_signatures_and_accumulate_sums` must have filled the weights of the frame.
    """
    gust_acceleration_axis_0, gust_acceleration_axis_1 = (
        block.coarse_gust_response[0],
        block.coarse_gust_response[1],
    )
    for k in range(n_tests):
        onset_tests.correlation_from_coarse_gust[k] = (
            evidence_decay_factor * onset_tests.correlation_from_coarse_gust[k]
            + (
                onset_tests.correlation_weight[0, k] * gust_acceleration_axis_0
                + onset_tests.correlation_weight[1, k] * gust_acceleration_axis_1
            )
        )


@kernel
def accumulate_evidence(block, uses_regressors, dt, evidence_decay_factor):
    """Add the frame just whitened to the sums of every hypothesis and onset; earlier sums decay by
    `evidence_decay_factor`."""
    for h in range(block.n_hypotheses):
        update_signatures_for_onsets(
            block.hypothesis[h],
            block.onset_tests[h // HYPOTHESES_PER_TEST_GROUP],
            (h % HYPOTHESES_PER_TEST_GROUP) * N_ONSET_SLOTS,
        )
    for group_index in range(n_test_groups(block)):
        onset_tests, n_tests = block.onset_tests[group_index], n_onset_tests_in_group(block, group_index)
        whiten_signatures_and_accumulate_sums(block, onset_tests, n_tests, dt, evidence_decay_factor)
        if block.has_coarse_gust_estimate:
            accumulate_correlation_from_coarse_gust(block, onset_tests, n_tests, evidence_decay_factor)
        if uses_regressors:
            accumulate_regressor_correlation(
                block, onset_tests, block.regressor_correlation[group_index], n_tests, evidence_decay_factor
            )


@kernel
def max_correlation_by_uncertainty(
    onset_tests, k, transient_response_sum_bound_0, transient_response_sum_bound_1
):
    """The largest share of |N| in test k that a bounded uncertainty explains.

    transient_response_sum_bound_0, _1: the two entries of the block's `transient_response_sum_bound`.
    """
    bound_from_final_drop_of_weight = transient_response_sum_bound_0 * abs(
        onset_tests.correlation_weight[0, k]
    ) + transient_response_sum_bound_1 * abs(onset_tests.correlation_weight[1, k])
    return onset_tests.max_correlation_by_constant_uncertainty[k] + min(
        onset_tests.max_correlation_by_varying_uncertainty[k] + bound_from_final_drop_of_weight,
        onset_tests.max_correlation_by_rate_limited_uncertainty[k],
    )


@kernel
def is_one_sided(kind):
    """True if only one sign of N supports a hypothesis: a loss cannot be a gain."""
    return kind in (LOSS, GROWING_LOSS, LOSS_END)


@kernel
def max_log_likelihood_ratio(is_loss_or_its_end, supporting_evidence, information):
    """Largest log-likelihood ratio of a fault against none, for supporting_evidence N and information D.

    It is N^2 / 2 D; for a loss, whose |theta| is at most 1, it is N - D / 2 if N > D.
    """
    llr = 0.5 * supporting_evidence * supporting_evidence / information
    if is_loss_or_its_end and supporting_evidence > information:
        llr = supporting_evidence - 0.5 * information
    # The zero is not returned earlier: each way out would be a division of its own.
    return llr if supporting_evidence > 0.0 else 0.0


@kernel
def evidence_over_noise_and_uncertainty(
    alarm_level, noise_share_of_alarm_level, supporting_evidence, max_evidence_from_uncertainty, information
):
    """Evidence over its standard deviation sqrt(D), or over what uncertainty and noise together allow.

    max_evidence_from_uncertainty: the share of the evidence that a bounded uncertainty explains; alarm_level:
    of the alarm; noise_share_of_alarm_level: share of the level that is reserved for noise in addition. The
    result is compared with the level.
    """
    evidence_std = sqrt(information)
    return supporting_evidence / (
        evidence_std
        if max_evidence_from_uncertainty <= 0.0
        else max(
            evidence_std,
            max_evidence_from_uncertainty / alarm_level + noise_share_of_alarm_level * evidence_std,
        )
    )


@kernel
def evaluate_onset_tests(
    block, onset_tests, n_tests, llr_bounds_ignore_uncertainty, non_loss_llr_bounds_include_uncertainty
):
    """Fill the score and the log-likelihood ratios of n onset tests; those of a test without information are
    0.

    llr_bounds_ignore_uncertainty: the bounds on the ratios leave out the bounded uncertainty.
    non_loss_llr_bounds_include_uncertainty: the bounds on hypotheses other than a loss always include it,
    because the model's error is mapped: it is then large and lasting.
    """
    supporting_correlation_sign = onset_tests.supporting_correlation_sign
    transient_response_sum_bound_0 = block.transient_response_sum_bound[0]
    transient_response_sum_bound_1 = block.transient_response_sum_bound[1]
    alarm_level = block.alarm_level
    noise_share_of_alarm_level = block.noise_share_of_alarm_level
    uncertainty_weight_in_llr_bounds = 0.0 if llr_bounds_ignore_uncertainty else 1.0
    for k in range(n_tests):
        N, D = onset_tests.correlation[k], onset_tests.information[k]
        evidence_from_errors_and_air = onset_tests.max_correlation_by_coefficient_errors[k] + max(
            supporting_correlation_sign[k] * onset_tests.correlation_by_calm_air[k], 0.0
        )
        evidence_from_errors_and_air += max(
            supporting_correlation_sign[k] * onset_tests.correlation_from_coarse_gust[k], 0.0
        )
        is_loss_or_its_end, has_information = supporting_correlation_sign[k] != 0.0, D > 0.0
        supporting_evidence = supporting_correlation_sign[k] * N if is_loss_or_its_end else abs(N)
        max_evidence_from_uncertainty = max_correlation_by_uncertainty(
            onset_tests, k, transient_response_sum_bound_0, transient_response_sum_bound_1
        )
        evidence_error_bound = evidence_from_errors_and_air + (
            max_evidence_from_uncertainty
            if non_loss_llr_bounds_include_uncertainty and not is_loss_or_its_end
            else uncertainty_weight_in_llr_bounds * max_evidence_from_uncertainty
        )
        score_in_standard_deviations = evidence_over_noise_and_uncertainty(
            alarm_level,
            noise_share_of_alarm_level,
            supporting_evidence - evidence_from_errors_and_air,
            max_evidence_from_uncertainty,
            D,
        )
        llr = max_log_likelihood_ratio(is_loss_or_its_end, supporting_evidence, D)
        llr_lower_bound = max_log_likelihood_ratio(
            is_loss_or_its_end, supporting_evidence - evidence_error_bound, D
        )
        llr_upper_bound = max_log_likelihood_ratio(
            is_loss_or_its_end, supporting_evidence + evidence_error_bound, D
        )
        onset_tests.score[k] = score_in_standard_deviations if has_information else 0.0
        onset_tests.llr_lower_bound[k] = llr_lower_bound if has_information else 0.0
        onset_tests.llr_upper_bound[k] = llr_upper_bound if has_information else 0.0
        onset_tests.llr[k] = llr if has_information else -1.0


@kernel
def evaluate_hypotheses(
    block, upper_bound_decay_factor_per_frame=0.0, non_loss_llr_bounds_include_uncertainty=False
):
    """Fill the score, the estimate and the bounds on the log-likelihood ratio of each hypothesis.

    upper_bound_decay_factor_per_frame: if a loss may end, the factor by which earlier upper bounds decay;
    else 0. non_loss_llr_bounds_include_uncertainty: see `evaluate_onset_tests`.
    """
    for group_index in range(n_test_groups(block)):
        evaluate_onset_tests(
            block,
            block.onset_tests[group_index],
            n_onset_tests_in_group(block, group_index),
            upper_bound_decay_factor_per_frame > 0.0,
            non_loss_llr_bounds_include_uncertainty,
        )
    for h, hypothesis in enumerate(block.hypothesis[: block.n_hypotheses]):
        onset_tests = block.onset_tests[h // HYPOTHESES_PER_TEST_GROUP]
        first_test_index = (h % HYPOTHESES_PER_TEST_GROUP) * N_ONSET_SLOTS
        max_score, best_llr, likeliest_test_index = 0.0, -1.0, -1
        max_llr_lower_bound, max_llr_upper_bound = (
            0.0,
            upper_bound_decay_factor_per_frame * hypothesis.llr_upper_bound,
        )
        for k in range(first_test_index, first_test_index + N_ONSET_SLOTS):
            max_score = max(max_score, onset_tests.score[k])
            max_llr_lower_bound = max(max_llr_lower_bound, onset_tests.llr_lower_bound[k])
            max_llr_upper_bound = max(max_llr_upper_bound, onset_tests.llr_upper_bound[k])
            if onset_tests.llr[k] > best_llr:
                best_llr, likeliest_test_index = onset_tests.llr[k], k
        hypothesis.score = max_score
        hypothesis.llr_lower_bound, hypothesis.llr_upper_bound = max_llr_lower_bound, max_llr_upper_bound
        if likeliest_test_index >= 0:
            N = onset_tests.correlation[likeliest_test_index]
            D = onset_tests.information[likeliest_test_index]
            hypothesis.theta_estimate, hypothesis.theta_information = (
                estimate_theta_with_loss_prior(hypothesis.kind, N, D),
                D,
            )


@kernel
def update_block(
    block,
    uncertainty_bound,
    uses_regressors,
    dt,
    evidence_decay_factor,
    upper_bound_decay_factor_per_frame=0.0,
    non_loss_llr_bounds_include_uncertainty=False,
):
    """Update a block with one frame of the innovation: whiten it and test every hypothesis; dt s.

    The innovation, rad/s2, is in `frame_innovation`. Noise, drift, signatures and, if `uses_regressors`,
    regressors are those of the frame. uncertainty_bound: see `fill_uncertainty_response_bounds`;
    evidence_decay_factor: `accumulate_evidence`; upper_bound_decay_factor_per_frame,
    non_loss_llr_bounds_include_uncertainty: `evaluate_hypotheses`.
    """
    advance_covariance(block, dt)
    if block.alarm_level > 0.0:
        fill_uncertainty_response_bounds(block, uncertainty_bound, dt)
    advance_whitening_filter(
        block, block.state, block.frame_innovation, dt, block.unscaled_white_innovation_rad_s
    )
    if block.no_gust_filter.n_axes > 0:
        update_predictable_innovation(block, dt)
    if block.has_coarse_gust_estimate:
        advance_whitening_filter(
            block, block.coarse_gust_filter_state, block.coarse_gust_response, dt, block.coarse_gust_response
        )
    if uses_regressors:
        whiten_regressors(block, dt)
    accumulate_evidence(block, uses_regressors, dt, evidence_decay_factor)
    evaluate_hypotheses(block, upper_bound_decay_factor_per_frame, non_loss_llr_bounds_include_uncertainty)


@kernel
def estimate_theta_with_loss_prior(kind, N, D):
    """The most likely theta; for a loss with a prior that is uniform on its set [-1, 0]."""
    if not is_one_sided(kind):
        return N / D
    theta = (N - 0.5 * PRIOR_LOSS_INFORMATION) / (D + PRIOR_LOSS_INFORMATION)
    return min(max(theta, -1.0), 0.0)


@kernel
def set_coarse_gust_effect_of_block(block, gust_acceleration):
    """Store gust_acceleration (3,) rad/s2, of the coarsely estimated gust, in `coarse_gust_response`.

    `update_block` whitens it in place.
    """
    for i, axis in enumerate(block.axes[: block.n_axes]):
        block.coarse_gust_response[i] = gust_acceleration[axis]
