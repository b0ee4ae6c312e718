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
PITCH_BLOCK, LATERAL, LATERAL_RETURNING = (
    0,
    1,
    2,
)  # RETURNING: roll and yaw again, with a drift that returns to zero
N_BLOCKS = 3
N_SLOTS = 10
N_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power: noise_model.py
MAX_HYPOTHESES = 8  # of a block of the rates of most aircraft: three losses, and the alternatives to them
LEAST_UNCERTAINTY_RAD_S2 = 1e-3  # lower limit of the bound that sets the drift: the bound may pass zero
STEP, ALPHA3, GROWING, ENDING = 2, 3, 4, 5  # further kinds of hypothesis
# Sign of N that supports a hypothesis: a loss removes moment, its end restores moment; 0: both signs.
SUPPORTING_SIGN = {LOSS: -1.0, STEP: 0.0, ALPHA3: 0.0, GROWING: -1.0, ENDING: 1.0}

PRIOR_DRIFT_RAD_S2 = 1.0  # standard deviation of the drift at the start of a flight; soon irrelevant
PRIOR_INFORMATION = 12.0  # one over the variance of a loss that is uniform on [0, 1]
# The magnitudes of a second-order transient of damping 0.7 sum to 1.09 times its sum; on two axes to more.
RINGING = 1.2

# Time constant, s, of the estimate of lambda: long compared with a filter's memory, short compared with
# changes of the weather.
CALM_MEMORY_S = 2.0
CALM_PRIOR = 4.0  # prior information for lambda = 1 (calm air), units of sum p' S^-1 p
CALM_MARGIN = 2.0  # standard deviations by which lambda is taken larger than estimated

HYPOTHESIS = record(
    kind=int, surface=int, axis=int, raises_alarm=int, log_column=int,
    signature=2,  # s of this frame, rad/s2 per unit of theta
    growth_decay=float,  # exp(-kappa dt) of a growing loss
    score=float,  # largest normalised evidence over the onsets, standard deviations
    theta=float, information=float,  # estimate at the likeliest onset; one over its variance
    min_llr=float, max_llr=float,  # bounds on the log-likelihood ratio against no fault
)  # fmt: skip


class Capacity(NamedTuple):
    """The numbers of regressors and hypotheses for which a block has memory."""

    regressors: int
    hypotheses: int


# A lane is one hypothesis with one onset. The lanes of a few hypotheses lie side by side for vector
# instructions: lane (h % PER_GROUP) * N_SLOTS + slot in group h // PER_GROUP. A group has the same size in
# every record, so compiled code knows that its arrays do not overlap. Checking that in each frame took a
# tenth of the detector's time.
PER_GROUP = 4
N_LANES = PER_GROUP * N_SLOTS
LANES = record(
    sense=N_LANES,  # sign of N that supports the hypothesis, or 0
    shaped_signature=(2, N_LANES), response=(4, N_LANES),  # s since the onset, rad/s2; state of its filter
    weight=(2, N_LANES),  # w = S^-1 g_s of the frame
    correlation=N_LANES, information=N_LANES, coefficient_part=N_LANES,  # N; D; sum_j tol_j |R_j|
    growth_left=N_LANES,  # exp(-kappa t) of a growing loss; for the end of a loss: 1 before the onset
    onset_signature=(2, N_LANES),  # signature when a loss ended, rad/s2
    # share of |N| that a bounded uncertainty explains: constant; varying by TV(w); varying by its pace
    constant_part=N_LANES, variation_part=N_LANES, paced_part=N_LANES,
    calm_prediction=N_LANES, gust_response=N_LANES,  # shares of N: of lambda p; of a roughly visible gust
    score=N_LANES, min_llr=N_LANES, max_llr=N_LANES, llr=N_LANES,  # llr: log-likelihood ratio
)  # fmt: skip


_FILTER = {
    "n": int, "keep": float, "state": 4, "innovation": 2, "P_xx": (2, 2), "P_xd": (2, 2), "P_dd": (2, 2),
    "drift": (2, 2), "jitter": 2, "noise": 2, "S_inverse": (2, 2), "K_x": (2, 2), "K_d": (2, 2),
}  # fmt: skip
FILTER = record(**_FILTER)


def set_supporting_signs(block: np.void, kinds: Sequence[int]) -> None:
    """Fill the sign of N that supports each hypothesis, in all of its lanes."""
    block["lanes"]["sense"] = 0.0
    for h, kind in enumerate(kinds):
        first = (h % PER_GROUP) * N_SLOTS
        block["lanes"]["sense"][h // PER_GROUP, first : first + N_SLOTS] = SUPPORTING_SIGN[kind]


def group_total(capacity: Capacity) -> int:
    """The number of groups of lanes that the hypotheses of a block need."""
    return (capacity.hypotheses + PER_GROUP - 1) // PER_GROUP


@sized
def block_dtype(capacity: Capacity) -> np.dtype:
    """A block: its whitening filter and its hypotheses."""
    return record(
        axis=(int, 2),  # first: a record that begins as another does is taken for one
        **_FILTER,
        return_length=float, drift_scale=float, residual_state=4, scratch=2,
        # in turbulence: the filter without gust, lambda p, and numerator and denominator of lambda
        no_gust_filter=FILTER, calm_prediction=2, calm_agreement=float, calm_information=float,
        # whether vanes show a gust roughly; its whitened effect, rad/s; the state of its filter
        has_coarse_gust=int, gust_response=2, gust_state=4,
        # alarm level, standard deviations; share of it reserved for noise beyond a bounded uncertainty;
        # omega dt of that uncertainty; its responses: see `fill_uncertainty_response`
        level=float, noise_share=float, pace=float, constant_response=2, transient_response=2,
        n_regressors=int, tolerance=capacity.regressors, regressor=(capacity.regressors, 2),
        regressor_state=(capacity.regressors, 4), regressor_response=(capacity.regressors, 2),
        n_hypotheses=int, hypothesis=(HYPOTHESIS, capacity.hypotheses),
        lanes=(LANES, group_total(capacity)),
        overlap=(group_total(capacity), capacity.regressors, N_LANES),  # R_j of each lane
    )  # fmt: skip


def filter_block(P: np.ndarray, R: np.ndarray) -> np.ndarray:
    """A block (1,) that filters n rates and has no hypotheses.

    P (2 n, 2 n): covariance of rates and their drift; R (n,): variance of a reading's noise."""
    blocks, n = np.zeros(1, block_dtype(Capacity(1, 1))), len(R)
    block, rates, drifts = blocks[0], slice(0, n), slice(n, 2 * n)
    block["n"], block["axis"], block["noise"][:n] = n, (0, 1), R
    for name, rows, columns in (("P_xx", rates, rates), ("P_xd", rates, drifts), ("P_dd", drifts, drifts)):
        block[name][:n, :n] = P[rows, columns]
    return blocks


@kernel
def invert_symmetric(n, S):
    """Replace the leading n x n part of a symmetric S (2, 2), n at most 2, by its inverse."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    across = 0.5 * (S[0, 1] + S[1, 0])
    determinant = S[0, 0] * S[1, 1] - across * across
    S[0, 0], S[1, 1] = S[1, 1] / determinant, S[0, 0] / determinant
    S[0, 1] = S[1, 0] = -across / determinant


@kernel
def predict_covariance(block, dt):
    """Predict the covariances over a frame of dt s, and fill `S_inverse` with S, yet to be inverted."""
    P_xx, P_xd, P_dd, S = block.P_xx, block.P_xd, block.P_dd, block.S_inverse
    for i in range(block.n):
        for j in range(block.n):
            P_xx[i, j] += dt * (P_xd[i, j] + P_xd[j, i]) + dt * dt * P_dd[i, j]
        P_xx[i, i] += dt * dt * block.jitter[i]
    for i in range(block.n):
        for j in range(block.n):
            P_xd[i, j] = block.keep * (P_xd[i, j] + dt * P_dd[i, j])
            P_dd[i, j] = block.keep * block.keep * P_dd[i, j] + dt * block.drift[i, j]
            S[i, j] = P_xx[i, j]
        S[i, i] += block.noise[i]


@kernel
def fill_gains(block):
    """Fill the Kalman gains K_x = P_xx S^-1 and K_d = P_xd' S^-1, (n, n)."""
    for i in range(block.n):
        for j in range(block.n):
            rate_gain, drift_gain = 0.0, 0.0
            for k in range(block.n):
                rate_gain += block.P_xx[i, k] * block.S_inverse[k, j]
                drift_gain += block.P_xd[k, i] * block.S_inverse[k, j]
            block.K_x[i, j], block.K_d[i, j] = rate_gain, drift_gain


@kernel
def update_covariance(block):
    """Update the covariances for the measurement: P <- P - K S K'."""
    K_x, K_d = block.K_x, block.K_d
    for j in range(2):  # a column follows from itself alone
        p0, p1 = block.P_xx[0, j], block.P_xx[1, j]
        c0, c1 = block.P_xd[0, j], block.P_xd[1, j]
        for i in range(block.n):
            block.P_dd[i, j] -= K_d[i, 0] * c0 + K_d[i, 1] * c1
            block.P_xx[i, j] -= K_x[i, 0] * p0 + K_x[i, 1] * p1
            block.P_xd[i, j] -= K_x[i, 0] * c0 + K_x[i, 1] * c1


@kernel
def advance_covariance(block, dt):
    """Predict the covariances, fill the gains, update the covariances for the frame just measured; dt s."""
    predict_covariance(block, dt)
    invert_symmetric(block.n, block.S_inverse)
    fill_gains(block)
    update_covariance(block)


@kernel
def whiten(block, state, acceleration, dt, out):
    """Advance the filter by one frame of an acceleration (2,) rad/s2; dt s.

    state (4,): e, rad/s, and d, rad/s2; advanced in place. out (2,) rad/s: the whitened response g; that of
    the innovation has covariance S.
    """
    for i in range(block.n):
        out[i] = state[i] + dt * (acceleration[i] - state[2 + i])
    for i in range(block.n):
        kept, drift = out[i], 0.0
        for j in range(block.n):
            kept -= block.K_x[i, j] * out[j]
            drift += block.K_d[i, j] * out[j]
        state[i] = kept
        state[2 + i] = block.keep * state[2 + i] + drift


@kernel
def whiten_regressors(block, dt):
    """Whiten all regressors as `whiten` does; in a block of one axis all values of a second axis are zero."""
    K_x, K_d, kept = block.K_x, block.K_d, block.keep
    x00, x01, x10, x11 = K_x[0, 0], K_x[0, 1], K_x[1, 0], K_x[1, 1]
    d00, d01, d10, d11 = K_d[0, 0], K_d[0, 1], K_d[1, 0], K_d[1, 1]
    given, state, response = block.regressor, block.regressor_state, block.regressor_response
    for j in range(block.n_regressors):
        r0 = state[j, 0] + dt * (given[j, 0] - state[j, 2])
        r1 = state[j, 1] + dt * (given[j, 1] - state[j, 3])
        response[j, 0], response[j, 1] = r0, r1
        state[j, 0], state[j, 1] = r0 - x00 * r0 - x01 * r1, r1 - x10 * r0 - x11 * r1
        state[j, 2] = kept * state[j, 2] + (d00 * r0 + d01 * r1)
        state[j, 3] = kept * state[j, 3] + (d10 * r0 + d11 * r1)


@kernel
def whiten_without_gust(block, dt):
    """Whiten the frame, `scratch`, rad/s2, by the filter without gust; dt s."""
    advance_covariance(block.no_gust_filter, dt)
    whiten(
        block.no_gust_filter, block.no_gust_filter.state, block.scratch, dt, block.no_gust_filter.innovation
    )


@kernel
def predict_calm_air(block, dt):
    """Fill `calm_prediction` (2,) rad/s with lambda p: the part of g that calm air makes predictable.

    lambda is estimated over the last FOLLOWED_S. `whiten_without_gust` must have run for this frame.
    """
    calm, prediction, g = block.no_gust_filter, block.calm_prediction, block.innovation
    kept = np.exp(-dt / CALM_MEMORY_S)
    block.calm_agreement *= kept
    block.calm_information *= kept
    for i in range(block.n):
        prediction[i] = g[i] - calm.innovation[i]
    for i in range(block.n):
        for j in range(block.n):
            block.calm_agreement += prediction[i] * block.S_inverse[i, j] * g[j]
            block.calm_information += prediction[i] * block.S_inverse[i, j] * prediction[j]
    information = block.calm_information + CALM_PRIOR
    agreement = block.calm_agreement + CALM_PRIOR + CALM_MARGIN * sqrt(information)
    share = min(max(agreement / information, 0.0), 1.0)
    for i in range(block.n):
        prediction[i] *= share


@kernel
def slot_to_reset(k):
    """The slot that restarts at frame k: slot j at odd multiples of 2^j, the last at all other frames."""
    slot = 0
    while k % 2 == 0 and slot < N_SLOTS - 1:
        k //= 2
        slot += 1
    return slot


@kernel
def lane_count(block, g):
    """The number of lanes in use in group g: the first entries of each array."""
    return min(block.n_hypotheses - g * PER_GROUP, PER_GROUP) * N_SLOTS


@kernel
def group_count(block):
    """The number of groups of lanes in use."""
    return (block.n_hypotheses + PER_GROUP - 1) // PER_GROUP


@kernel
def reset_onset(block, slot):
    """Restart a slot: its onset is the next frame, without evidence."""
    for g in range(group_count(block)):
        lanes = block.lanes[g]
        for k in range(slot, lane_count(block, g), N_SLOTS):
            lanes.correlation[k] = lanes.information[k] = 0.0
            lanes.weight[0, k] = lanes.weight[1, k] = 0.0
            lanes.constant_part[k] = lanes.variation_part[k] = lanes.paced_part[k] = lanes.calm_prediction[
                k
            ] = lanes.gust_response[k] = 0.0
            lanes.growth_left[k] = 1.0
            for i in range(4):
                lanes.response[i, k] = 0.0
            for j in range(block.n_regressors):
                block.overlap[g, j, k] = 0.0


@kernel
def fill_uncertainty_response(block, bounded, dt):
    """Fill `constant_response` and `transient_response` (2,) with eta_bar |g_0| and eta_bar RINGING / K_d.

    bounded (3,) rad/s2: eta_bar.
    """
    K, returns = block.K_d, 1.0 - block.keep
    det = K[0, 0] * K[1, 1] - K[0, 1] * K[1, 0] if block.n > 1 else K[0, 0]
    for i in range(block.n):
        block.constant_response[i] = block.transient_response[i] = 0.0
        for j in range(block.n):
            cofactor = 1.0 if block.n == 1 else (K[1 - i, 1 - i] if i == j else K[i, j])
            block.transient_response[i] += RINGING * abs(cofactor / det) * bounded[block.axis[j]]
        if returns > 0.0:
            left = dt * returns / (block.K_x[i, i] * returns + dt * K[i, i])
            block.constant_response[i] = left * bounded[block.axis[i]]


@kernel
def shape_signature(hypothesis, lanes, first):
    """Fill `shaped_signature`, rad/s2, of a hypothesis for each onset, from lane `first` on.

    It is the signature of the frame; for a growing loss times 1 - exp(-kappa t); for the end of a loss that
    of the onset.
    """
    s0, s1 = hypothesis.signature[0], hypothesis.signature[1]
    for k in range(first, first + N_SLOTS):
        if hypothesis.kind == ENDING:
            if lanes.growth_left[k] > 0.0:
                lanes.onset_signature[0, k], lanes.onset_signature[1, k], lanes.growth_left[k] = s0, s1, 0.0
            lanes.shaped_signature[0, k] = lanes.onset_signature[0, k]
            lanes.shaped_signature[1, k] = lanes.onset_signature[1, k]
        elif hypothesis.kind == GROWING:
            lanes.growth_left[k] *= hypothesis.growth_decay
            grown = 1.0 - lanes.growth_left[k]
            lanes.shaped_signature[0, k], lanes.shaped_signature[1, k] = grown * s0, grown * s1
        else:
            lanes.shaped_signature[0, k], lanes.shaped_signature[1, k] = s0, s1


@kernel
def accumulate_correlations(block, lanes, n, dt, keep):
    """Whiten the shaped signatures of n lanes, and add the frame to N, D and the bounds on N.

    keep: factor by which earlier sums decay. In a block of one axis all values of a second axis are zero.
    """
    K_x, K_d, S = block.K_x, block.K_d, block.S_inverse
    x00, x01, x10, x11 = K_x[0, 0], K_x[0, 1], K_x[1, 0], K_x[1, 1]
    d00, d01, d10, d11 = K_d[0, 0], K_d[0, 1], K_d[1, 0], K_d[1, 1]
    s00, s01, s10, s11 = S[0, 0], S[0, 1], S[1, 0], S[1, 1]
    kept, g0, g1 = block.keep, block.innovation[0], block.innovation[1]
    p0, p1 = block.calm_prediction[0], block.calm_prediction[1]
    transient0, transient1 = block.transient_response[0], block.transient_response[1]
    constant0, constant1 = block.constant_response[0], block.constant_response[1]
    state, shaped, weight, pace = lanes.response, lanes.shaped_signature, lanes.weight, block.pace
    for k in range(n):
        r0 = state[0, k] + dt * (shaped[0, k] - state[2, k])
        r1 = state[1, k] + dt * (shaped[1, k] - state[3, k])
        state[0, k], state[1, k] = r0 - x00 * r0 - x01 * r1, r1 - x10 * r0 - x11 * r1
        state[2, k] = kept * state[2, k] + (d00 * r0 + d01 * r1)
        state[3, k] = kept * state[3, k] + (d10 * r0 + d11 * r1)
        w0, w1 = s00 * r0 + s01 * r1, s10 * r0 + s11 * r1
        lanes.correlation[k] = keep * lanes.correlation[k] + (w0 * g0 + w1 * g1)
        lanes.information[k] = keep * lanes.information[k] + w0 * r0 + w1 * r1
        lanes.calm_prediction[k] = keep * lanes.calm_prediction[k] + (w0 * p0 + w1 * p1)
        change = transient0 * abs(w0 - weight[0, k]) + transient1 * abs(w1 - weight[1, k])
        lanes.constant_part[k] = keep * lanes.constant_part[k] + (constant0 * abs(w0) + constant1 * abs(w1))
        lanes.variation_part[k] = keep * lanes.variation_part[k] + change
        lanes.paced_part[k] = keep * lanes.paced_part[k] + pace * (
            transient0 * abs(w0) + transient1 * abs(w1)
        )
        weight[0, k], weight[1, k] = w0, w1


@kernel
def accumulate_overlap(block, lanes, overlap, n, keep):
    """Add the frame to R_j of n lanes, `overlap` (regressors, lanes), and fill their `coefficient_part`."""
    weight, coefficient_part = lanes.weight, lanes.coefficient_part
    coefficient_part[:n] = 0.0
    for j in range(block.n_regressors):
        r0, r1 = block.regressor_response[j, 0], block.regressor_response[j, 1]
        total, tolerance = overlap[j], block.tolerance[j]
        for k in range(n):
            total[k] = keep * total[k] + (weight[0, k] * r0 + weight[1, k] * r1)
            coefficient_part[k] += tolerance * abs(total[k])


@kernel
def accumulate_gust(block, lanes, n, keep):
    """Add the frame to the share of N that a roughly visible gust contributes.

    `accumulate_correlations` must have filled the weights of the frame.
    """
    p0, p1 = block.gust_response[0], block.gust_response[1]
    for k in range(n):
        lanes.gust_response[k] = keep * lanes.gust_response[k] + (
            lanes.weight[0, k] * p0 + lanes.weight[1, k] * p1
        )


@kernel
def accumulate_evidence(block, has_tolerances, dt, keep):
    """Add the frame just whitened to the sums of every hypothesis and onset; earlier sums decay by `keep`."""
    for h in range(block.n_hypotheses):
        shape_signature(block.hypothesis[h], block.lanes[h // PER_GROUP], (h % PER_GROUP) * N_SLOTS)
    for g in range(group_count(block)):
        lanes, n = block.lanes[g], lane_count(block, g)
        accumulate_correlations(block, lanes, n, dt, keep)
        if block.has_coarse_gust:
            accumulate_gust(block, lanes, n, keep)
        if has_tolerances:
            accumulate_overlap(block, lanes, block.overlap[g], n, keep)


@kernel
def uncertainty_part(lanes, k, transient0, transient1):
    """The largest share of |N| in lane k that a bounded uncertainty explains.

    transient0, transient1: the two entries of the block's `transient_response`.
    """
    last = transient0 * abs(lanes.weight[0, k]) + transient1 * abs(lanes.weight[1, k])
    return lanes.constant_part[k] + min(lanes.variation_part[k] + last, lanes.paced_part[k])


@kernel
def is_one_sided(kind):
    """True if only one sign of N supports a hypothesis: a loss cannot be a gain."""
    return kind in (LOSS, GROWING, ENDING)


@kernel
def log_likelihood_ratio(is_loss, evidence, information):
    """Largest log-likelihood ratio of a fault against none, for evidence N and information D.

    It is N^2 / 2 D; for a loss, whose |theta| is at most 1, it is N - D / 2 if N > D.
    """
    if evidence <= 0.0:
        return 0.0
    if is_loss and evidence > information:
        return evidence - 0.5 * information
    return 0.5 * evidence * evidence / information


@kernel
def normalised_evidence(level, noise_share, evidence, room, D):
    """Evidence over its standard deviation sqrt(D), or over what uncertainty and noise together allow.

    room: the share of the evidence that a bounded uncertainty explains; level: of the alarm; noise_share:
    share of the level that is reserved for noise in addition. The result is compared with the level.
    """
    root = sqrt(D)
    return evidence / (root if room <= 0.0 else max(root, room / level + noise_share * root))


@kernel
def evaluate_lanes(block, lanes, n, certain, mapped):
    """Fill the score and the log-likelihood ratios of n lanes; those of a lane without information are 0.

    certain: the bounds on the ratio of a loss leave bounded uncertainty out of account. mapped: the model's
    error is mapped; it is then large and lasting, so the bounds on other hypotheses always include it.
    """
    sense, transient0, transient1 = lanes.sense, block.transient_response[0], block.transient_response[1]
    level, noise_share, room_share = block.level, block.noise_share, 0.0 if certain else 1.0
    for k in range(n):
        N, D = lanes.correlation[k], lanes.information[k]
        explained = lanes.coefficient_part[k] + max(sense[k] * lanes.calm_prediction[k], 0.0)
        explained += max(sense[k] * lanes.gust_response[k], 0.0)
        is_loss, known = sense[k] != 0.0, D > 0.0
        evidence = sense[k] * N if is_loss else abs(N)
        room = uncertainty_part(lanes, k, transient0, transient1)
        doubt = explained + (room if mapped and not is_loss else room_share * room)
        score = normalised_evidence(level, noise_share, evidence - explained, room, D)
        llr = log_likelihood_ratio(is_loss, evidence, D)
        min_llr = log_likelihood_ratio(is_loss, evidence - doubt, D)
        max_llr = log_likelihood_ratio(is_loss, evidence + doubt, D)
        lanes.score[k] = score if known else 0.0
        lanes.min_llr[k] = min_llr if known else 0.0
        lanes.max_llr[k] = max_llr if known else 0.0
        lanes.llr[k] = llr if known else -1.0


@kernel
def evaluate_hypotheses(block, memory=0.0, mapped=False):
    """Fill the score, the estimate and the bounds on the log-likelihood ratio of each hypothesis.

    memory: if a loss may end, the factor by which its earlier upper bound decays per frame; else 0.
    mapped: see `evaluate_lanes`.
    """
    for g in range(group_count(block)):
        evaluate_lanes(block, block.lanes[g], lane_count(block, g), memory > 0.0, mapped)
    for h, hypothesis in enumerate(block.hypothesis[: block.n_hypotheses]):
        lanes, first = block.lanes[h // PER_GROUP], (h % PER_GROUP) * N_SLOTS
        score, min_llr, max_llr, best, likeliest = 0.0, 0.0, memory * hypothesis.max_llr, -1.0, -1
        for k in range(first, first + N_SLOTS):
            score = max(score, lanes.score[k])
            min_llr, max_llr = max(min_llr, lanes.min_llr[k]), max(max_llr, lanes.max_llr[k])
            if lanes.llr[k] > best:
                best, likeliest = lanes.llr[k], k
        hypothesis.score, hypothesis.min_llr, hypothesis.max_llr = score, min_llr, max_llr
        if likeliest >= 0:
            N, D = lanes.correlation[likeliest], lanes.information[likeliest]
            hypothesis.theta, hypothesis.information = estimate_theta(hypothesis.kind, N, D), D


@kernel
def update_block(block, bounded, has_tolerances, dt, keep, memory=0.0, mapped=False):
    """Update a block with one frame of the innovation: whiten it and test every hypothesis; dt s.

    The innovation, rad/s2, is in `scratch`. Noise, drift, signatures and, if `has_tolerances`, regressors are
    those of the frame. bounded: see `fill_uncertainty_response`; keep: `accumulate_evidence`; memory, mapped:
    `evaluate_hypotheses`.
    """
    advance_covariance(block, dt)
    if block.level > 0.0:
        fill_uncertainty_response(block, bounded, dt)
    whiten(block, block.state, block.scratch, dt, block.innovation)
    if block.no_gust_filter.n > 0:
        predict_calm_air(block, dt)
    if block.has_coarse_gust:
        whiten(block, block.gust_state, block.gust_response, dt, block.gust_response)
    if has_tolerances:
        whiten_regressors(block, dt)
    accumulate_evidence(block, has_tolerances, dt, keep)
    evaluate_hypotheses(block, memory, mapped)


@kernel
def estimate_theta(kind, N, D):
    """The most likely theta; for a loss with a prior that is uniform on its set [-1, 0]."""
    if not is_one_sided(kind):
        return N / D
    theta = (N - 0.5 * PRIOR_INFORMATION) / (D + PRIOR_INFORMATION)
    return min(max(theta, -1.0), 0.0)


@kernel
def set_gust_response(block, acceleration):
    """Fill the response of the block's axes to the gust that the vanes measure coarsely; acceleration (3,)
    rad/s2."""
    for i, axis in enumerate(block.axis[: block.n]):
        block.gust_response[i] = acceleration[axis]
