"""Generalised likelihood ratio tests on the whitened innovation [Willsky1976].

The innovation is whitened by a Kalman filter:

    x[k+1] = x[k] + dt (F[k] + d[k] + phi[k])      d[k+1] = a d[k] + drift      measured: x + gyro noise

F is the design model, d what moves slowly beside it: the air's rotation, uncertainty that is merely bounded,
unknown constants. phi is a fault. With a = 1 the drift is a random walk: whatever is constant has no part in
what is whitened, and whatever drifts less than declared has less. The filter is linear: a fault, or the error
of a coefficient, passes through it by itself, and that is what the innovation is compared with.

    g = e + dt (nu - d)      e <- g - K_x g      d <- a d + K_d g

with nu the innovation of the frame as acceleration and e what is left of the rate.

A hypothesis says what a fault does: theta times a signature s(t), from an onset on. Passed through the
whitening filter from that onset, the signature becomes g_s; with g the whitened innovation and S its
covariance

    N = sum g_s' S^-1 g,  D = sum g_s' S^-1 g_s:      theta_hat = N / D,   log likelihood ratio N^2 / 2 D

and without a fault N / sqrt(D) is standard normal (or less, where the noise is less than declared). An alarm
is raised where it leaves a level that follows from the declared rate of false alarms, by the union bound
over hypotheses, onsets and frames.

Errors of coefficients are constants c_j, |c_j| <= tol_j, times known regressors r_j. Through the same filter
they add sum_j c_j R_j to N, R_j = sum g_s' S^-1 g_rj, hence no more than sum_j tol_j |R_j|: exactly that is
taken off the evidence.

An uncertainty d that is merely bounded, |d| <= eta_bar, is no noise. Through the same filter it shows as g_d.
Of a constant the filter leaves g_0, of a step besides a transient whose sum is 1 / K_d and whose magnitudes
add up to little more. With w = S^-1 g_s, by summation by parts,

    |sum w' g_d| <= eta_bar (|g_0| sum |w| + RINGING / K_d TV(w)),     TV(w) = sum |w[k] - w[k-1]|

and, d changing by no more than eta_bar omega dt in a frame, TV(w) may be replaced by omega dt sum |w|. The
alarm wants evidence beyond all of this.

A loss that grows is a loss times 1 - exp(-kappa t); one that ends gives back what the surface did not do at
that instant, and stays away. Such shapes raise no alarm: they say what a surface may explain.

The declared drift is a most. In calmer air the filter follows the gyro's noise as if it were gust, and what
it leaves, g, can be foreseen: by p = g - g_calm, of a filter beside it that reckons with no gust. A law
answers the same noise through the surfaces, so a loss then shows where there is none. How much of p is in g
is fitted, lambda = sum p' S^-1 g / sum p' S^-1 p: 0 in air as declared, 1 in calm air. What lambda p gives
the evidence is taken off it.

Nor is a gust that vanes show, but forces do not tell from the aircraft's own way, independent of the surfaces
of a law that answers the vanes. What it gives the evidence, whitened alike, is taken off that.

Onsets: slot j starts anew every 2^(j+1) frames, so that there is always one of about every age. From the
alarm on they stay, and old evidence is forgotten slowly.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.diagnosis.state import LOSS

# A block is the axes whose noise goes together: pitch, and roll with yaw, the latter twice. States of a
# filter: what is left of the rate, then the drift.
PITCH_BLOCK, LATERAL, RETURNING = 0, 1, 2  # the last is the second view of roll and yaw
N_BLOCKS = 3
N_SLOTS = 10
N_READINGS = 5  # alpha, beta, airspeed, dynamic pressure, engine power: noise_model.py
MAX_HYPOTHESES = 8  # of a block of the rates: three losses at most, and what they are held against
LEAST_UNCERTAINTY_RAD_S2 = 1e-3  # reckoned with: a bound that passes zero does not stay there
STEP, ALPHA3, GROWING, ENDING = 2, 3, 4, 5  # further kinds of hypothesis
# Which sign of a correlation speaks for one: a loss takes away, one that ends gives back; 0: either does.
SENSE = {LOSS: -1.0, STEP: 0.0, ALPHA3: 0.0, GROWING: -1.0, ENDING: 1.0}

PRIOR_DRIFT_RAD_S2 = 1.0  # what a drift may be at the start of a flight: soon forgotten
PRIOR_INFORMATION = 12.0  # of a loss uniform on [0, 1]: one over its variance
# Magnitudes of a second-order transient of damping 0.7 add up to 1.09 times its sum; on two axes to more.
RINGING = 1.2

FOLLOWED_S = 2.0  # of the past say how calm the air is: long beside a filter's memory, short beside weather's
CALM_PRIOR = 4.0  # before anything is known it is calm, and held so within two standard deviations
CALM_MARGIN = 2.0

HYPOTHESIS = record(
    kind=int, surface=int, axis=int, alarms=int, column=int, signature=2, growth_keep=float,
    score=float, theta=float, certainty=float, at_least=float, at_most=float,
)  # fmt: skip


class Capacity(NamedTuple):
    """How many regressors and hypotheses a block has room for."""

    regressors: int
    hypotheses: int


# A hypothesis tried from one onset is a lane. The lanes of a few hypotheses lie side by side for vector
# instructions, lane (h % PER_GROUP) * N_SLOTS + slot in group h // PER_GROUP. A group is as large in every
# record, so that compiled code knows that none of its arrays overlaps another: to find that out in each frame
# took a tenth of the detector's time.
PER_GROUP = 4
N_LANES = PER_GROUP * N_SLOTS
LANES = record(
    sense=N_LANES, shaped=(2, N_LANES), response=(4, N_LANES),
    weight=(2, N_LANES),  # S^-1 g_s of the frame
    correlation=N_LANES, information=N_LANES, slack=N_LANES,
    missing=N_LANES,  # of a loss that grows, what is yet to come
    held=(2, N_LANES),  # of a loss that ends, its signature as it did
    # what a bounded uncertainty can add to the correlation: as it stays, as it swings, at its pace
    stays=N_LANES, swings=N_LANES, drifts=N_LANES,
    foreseen=N_LANES,  # of the correlation, what calm air gives a law that answers noise
    shown=N_LANES,  # and a gust that the vanes show a law which answers them
    # what it comes to, the last three as log likelihood ratios
    score=N_LANES, at_least=N_LANES, at_most=N_LANES, likelihood=N_LANES,
)  # fmt: skip


_FILTER = {
    "n": int, "keep": float, "state": 4, "innovation": 2, "P_xx": (2, 2), "P_xd": (2, 2), "P_dd": (2, 2),
    "drift": (2, 2), "jitter": 2, "noise": 2, "S_inverse": (2, 2), "K_x": (2, 2), "K_d": (2, 2),
}  # fmt: skip
FILTER = record(**_FILTER)


def set_senses(block: np.void, kinds: Sequence[int]) -> None:
    """Say of the lanes of each hypothesis which sign of a correlation speaks for it."""
    block["lanes"]["sense"] = 0.0
    for h, kind in enumerate(kinds):
        first = (h % PER_GROUP) * N_SLOTS
        block["lanes"]["sense"][h // PER_GROUP, first : first + N_SLOTS] = SENSE[kind]


def groups(capacity: Capacity) -> int:
    """How many groups of lanes the hypotheses of a block need."""
    return (capacity.hypotheses + PER_GROUP - 1) // PER_GROUP


@sized
def block_dtype(capacity: Capacity) -> np.dtype:
    """A block: its filter, and what its hypotheses come to."""
    return record(
        axis=(int, 2),  # first: a record that begins as another does is taken for one
        **_FILTER,
        lag=float, stronger=float, rest=4, scratch=2,
        # the filter that reckons with no gust, where one is declared; lambda p, and the two sums of lambda
        calm=FILTER, foreseen=2, agreement=float, size=float,
        glimpsed=int, shown=2, shown_state=4,  # whether vanes show a gust roughly; what it does, whitened
        # alarm level; share of it that chance is given beside what is bounded; omega dt of the latter
        level=float, chance=float, pace=float, stay=2, swing=2,
        n_regressors=int, tolerance=capacity.regressors, regressor=(capacity.regressors, 2),
        regressor_state=(capacity.regressors, 4), regressor_response=(capacity.regressors, 2),
        n_hypotheses=int, hypothesis=(HYPOTHESIS, capacity.hypotheses),
        lanes=(LANES, groups(capacity)),
        overlap=(groups(capacity), capacity.regressors, N_LANES),  # R_j of each lane
    )  # fmt: skip


def filter_block(P: np.ndarray, R: np.ndarray) -> np.ndarray:
    """A block (1,) that filters n rates and tests nothing.

    P (2 n, 2 n): covariance of rates and their drift; R (n,): variance of a reading's noise."""
    blocks, n = np.zeros(1, block_dtype(Capacity(1, 1))), len(R)
    block, rates, drifts = blocks[0], slice(0, n), slice(n, 2 * n)
    block["n"], block["axis"], block["noise"][:n] = n, (0, 1), R
    for name, rows, columns in (("P_xx", rates, rates), ("P_xd", rates, drifts), ("P_dd", drifts, drifts)):
        block[name][:n, :n] = P[rows, columns]
    return blocks


@kernel
def invert(n, S):
    """Replace the leading n x n part of a symmetric S (2, 2), n at most 2, by its inverse."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    across = 0.5 * (S[0, 1] + S[1, 0])
    determinant = S[0, 0] * S[1, 1] - across * across
    S[0, 0], S[1, 1] = S[1, 1] / determinant, S[0, 0] / determinant
    S[0, 1] = S[1, 0] = -across / determinant


@kernel
def spread_uncertainty(block, dt):
    """Advance the covariances over a frame in which the drift acts; `S_inverse` holds S for now."""
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
def gains(block):
    """Fill K_x and K_d (n, n) from the covariances and `S_inverse`."""
    for i in range(block.n):
        for j in range(block.n):
            of_rate, of_drift = 0.0, 0.0
            for k in range(block.n):
                of_rate += block.P_xx[i, k] * block.S_inverse[k, j]
                of_drift += block.P_xd[k, i] * block.S_inverse[k, j]
            block.K_x[i, j], block.K_d[i, j] = of_rate, of_drift


@kernel
def learn(block):
    """Take off the covariances what is learnt from the measurement."""
    K_x, K_d = block.K_x, block.K_d
    for j in range(2):  # a column follows from itself alone
        p0, p1 = block.P_xx[0, j], block.P_xx[1, j]
        c0, c1 = block.P_xd[0, j], block.P_xd[1, j]
        for i in range(block.n):
            block.P_dd[i, j] -= K_d[i, 0] * c0 + K_d[i, 1] * c1
            block.P_xx[i, j] -= K_x[i, 0] * p0 + K_x[i, 1] * p1
            block.P_xd[i, j] -= K_x[i, 0] * c0 + K_x[i, 1] * c1


@kernel
def advance(block, dt):
    """Bring gains and covariances to the frame just measured; dt s."""
    spread_uncertainty(block, dt)
    invert(block.n, block.S_inverse)
    gains(block)
    learn(block)


@kernel
def whiten(block, state, acceleration, dt, out):
    """Pass one frame of an acceleration through the filter.

    state (4,): what is left of the rates, rad/s, and the drifts, rad/s2, advanced in place. acceleration (2,)
    rad/s2; out (2,) rad/s: the whitened response, of covariance S were it the innovation's.
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
    """Whiten the regressors as `whiten` does, all at once; of a block of one axis, the second's are zero."""
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
def follow_calm(block, dt):
    """Whiten the frame, `scratch`, by the filter that reckons with no gust."""
    advance(block.calm, dt)
    whiten(block.calm, block.calm.state, block.scratch, dt, block.calm.innovation)


@kernel
def foresee(block, dt):
    """Fill `foreseen` (2,) rad/s: what of this frame's whitened innovation the past foretells if the air is
    calmer than declared, as far as it has lately been. `follow_calm` has taken the frame in."""
    calm, foreseen, g = block.calm, block.foreseen, block.innovation
    kept = np.exp(-dt / FOLLOWED_S)
    block.agreement *= kept
    block.size *= kept
    for i in range(block.n):
        foreseen[i] = g[i] - calm.innovation[i]
    for i in range(block.n):
        for j in range(block.n):
            block.agreement += foreseen[i] * block.S_inverse[i, j] * g[j]
            block.size += foreseen[i] * block.S_inverse[i, j] * foreseen[j]
    size = block.size + CALM_PRIOR
    share = min(max((block.agreement + CALM_PRIOR + CALM_MARGIN * sqrt(size)) / size, 0.0), 1.0)
    for i in range(block.n):
        foreseen[i] *= share


@kernel
def slot_to_start(k):
    """The slot that starts anew at frame k: slot j at odd multiples of 2^j, the last at all that are left."""
    slot = 0
    while k % 2 == 0 and slot < N_SLOTS - 1:
        k //= 2
        slot += 1
    return slot


@kernel
def lanes_in(block, g):
    """How many lanes of group g there are: the first of each of its arrays."""
    return min(block.n_hypotheses - g * PER_GROUP, PER_GROUP) * N_SLOTS


@kernel
def n_groups(block):
    """How many groups of lanes there are."""
    return (block.n_hypotheses + PER_GROUP - 1) // PER_GROUP


@kernel
def start(block, slot):
    """Forget everything about an onset."""
    for g in range(n_groups(block)):
        lanes = block.lanes[g]
        for k in range(slot, lanes_in(block, g), N_SLOTS):
            lanes.correlation[k] = lanes.information[k] = 0.0
            lanes.weight[0, k] = lanes.weight[1, k] = 0.0
            lanes.stays[k] = lanes.swings[k] = lanes.drifts[k] = lanes.foreseen[k] = lanes.shown[k] = 0.0
            lanes.missing[k] = 1.0
            for i in range(4):
                lanes.response[i, k] = 0.0
            for j in range(block.n_regressors):
                block.overlap[g, j, k] = 0.0


@kernel
def reach(block, bounded, dt):
    """Fill stay and swing (2,): eta_bar |g_0| and eta_bar RINGING / K_d of each axis; bounded (3,) rad/s2."""
    K, returns = block.K_d, 1.0 - block.keep
    det = K[0, 0] * K[1, 1] - K[0, 1] * K[1, 0] if block.n > 1 else K[0, 0]
    for i in range(block.n):
        block.stay[i] = block.swing[i] = 0.0
        for j in range(block.n):
            cofactor = 1.0 if block.n == 1 else (K[1 - i, 1 - i] if i == j else K[i, j])
            block.swing[i] += RINGING * abs(cofactor / det) * bounded[block.axis[j]]
        if returns > 0.0:
            left = dt * returns / (block.K_x[i, i] * returns + dt * K[i, i])
            block.stay[i] = left * bounded[block.axis[i]]


@kernel
def shape(hypothesis, lanes, first):
    """Fill `shaped` with the signature of a hypothesis since each onset, from lane `first` on: of growth a
    part, of an end what it was then."""
    s0, s1 = hypothesis.signature[0], hypothesis.signature[1]
    for k in range(first, first + N_SLOTS):
        if hypothesis.kind == ENDING:
            if lanes.missing[k] > 0.0:
                lanes.held[0, k], lanes.held[1, k], lanes.missing[k] = s0, s1, 0.0
            lanes.shaped[0, k], lanes.shaped[1, k] = lanes.held[0, k], lanes.held[1, k]
        elif hypothesis.kind == GROWING:
            lanes.missing[k] *= hypothesis.growth_keep
            grown = 1.0 - lanes.missing[k]
            lanes.shaped[0, k], lanes.shaped[1, k] = grown * s0, grown * s1
        else:
            lanes.shaped[0, k], lanes.shaped[1, k] = s0, s1


@kernel
def respond(block, lanes, n, dt, keep):
    """Whiten the shaped signatures of n lanes, as `whiten` does, and bring N and D to this frame.

    Of a block of one axis, what belongs to a second one is zero.
    """
    K_x, K_d, S = block.K_x, block.K_d, block.S_inverse
    x00, x01, x10, x11 = K_x[0, 0], K_x[0, 1], K_x[1, 0], K_x[1, 1]
    d00, d01, d10, d11 = K_d[0, 0], K_d[0, 1], K_d[1, 0], K_d[1, 1]
    s00, s01, s10, s11 = S[0, 0], S[0, 1], S[1, 0], S[1, 1]
    kept, g0, g1 = block.keep, block.innovation[0], block.innovation[1]
    p0, p1 = block.foreseen[0], block.foreseen[1]
    swing0, swing1, stay0, stay1 = block.swing[0], block.swing[1], block.stay[0], block.stay[1]
    state, shaped, weight, pace = lanes.response, lanes.shaped, lanes.weight, block.pace
    for k in range(n):
        r0 = state[0, k] + dt * (shaped[0, k] - state[2, k])
        r1 = state[1, k] + dt * (shaped[1, k] - state[3, k])
        state[0, k], state[1, k] = r0 - x00 * r0 - x01 * r1, r1 - x10 * r0 - x11 * r1
        state[2, k] = kept * state[2, k] + (d00 * r0 + d01 * r1)
        state[3, k] = kept * state[3, k] + (d10 * r0 + d11 * r1)
        w0, w1 = s00 * r0 + s01 * r1, s10 * r0 + s11 * r1
        lanes.correlation[k] = keep * lanes.correlation[k] + (w0 * g0 + w1 * g1)
        lanes.information[k] = keep * lanes.information[k] + w0 * r0 + w1 * r1
        lanes.foreseen[k] = keep * lanes.foreseen[k] + (w0 * p0 + w1 * p1)
        change = swing0 * abs(w0 - weight[0, k]) + swing1 * abs(w1 - weight[1, k])
        lanes.stays[k] = keep * lanes.stays[k] + (stay0 * abs(w0) + stay1 * abs(w1))
        lanes.swings[k] = keep * lanes.swings[k] + change
        lanes.drifts[k] = keep * lanes.drifts[k] + pace * (swing0 * abs(w0) + swing1 * abs(w1))
        weight[0, k], weight[1, k] = w0, w1


@kernel
def accumulate_overlap(block, lanes, overlap, n, keep):
    """Bring R_j of n lanes to this frame, `overlap` (regressors, lanes), and `slack`: how much of N the
    declared errors of the coefficients explain."""
    weight, slack = lanes.weight, lanes.slack
    slack[:n] = 0.0
    for j in range(block.n_regressors):
        r0, r1 = block.regressor_response[j, 0], block.regressor_response[j, 1]
        total, tolerance = overlap[j], block.tolerance[j]
        for k in range(n):
            total[k] = keep * total[k] + (weight[0, k] * r0 + weight[1, k] * r1)
            slack[k] += tolerance * abs(total[k])


@kernel
def glimpse(block, lanes, n, keep):
    """Bring to this frame what a gust that the vanes show adds to N; `respond` has left the weights."""
    p0, p1 = block.shown[0], block.shown[1]
    for k in range(n):
        lanes.shown[k] = keep * lanes.shown[k] + (lanes.weight[0, k] * p0 + lanes.weight[1, k] * p1)


@kernel
def weigh(block, tolerated, dt, keep):
    """Add the frame just whitened to every hypothesis and onset; `keep` is the share of what was there."""
    for h in range(block.n_hypotheses):
        shape(block.hypothesis[h], block.lanes[h // PER_GROUP], (h % PER_GROUP) * N_SLOTS)
    for g in range(n_groups(block)):
        lanes, n = block.lanes[g], lanes_in(block, g)
        respond(block, lanes, n, dt, keep)
        if block.glimpsed:
            glimpse(block, lanes, n, keep)
        if tolerated:
            accumulate_overlap(block, lanes, block.overlap[g], n, keep)


@kernel
def allowance(lanes, k, swing0, swing1):
    """How much of N, in lane k, a bounded uncertainty can explain; swing0, swing1: a block's `swing`."""
    last = swing0 * abs(lanes.weight[0, k]) + swing1 * abs(lanes.weight[1, k])
    return lanes.stays[k] + min(lanes.swings[k] + last, lanes.drifts[k])


@kernel
def one_sided(kind):
    """Whether a hypothesis has a sign: a loss is no gain."""
    return kind in (LOSS, GROWING, ENDING)


@kernel
def log_likelihood(is_loss, evidence, information):
    """Largest log likelihood ratio for an evidence N against no fault; a loss is at most whole."""
    if evidence <= 0.0:
        return 0.0
    if is_loss and evidence > information:
        return evidence - 0.5 * information
    return 0.5 * evidence * evidence / information


@kernel
def share(level, chance, evidence, room, D):
    """Evidence in standard deviations, or as many as it is of all that bounded uncertainty and chance allow.

    room: what a bounded uncertainty can add to the evidence, of information D.
    """
    root = sqrt(D)
    return evidence / (root if room <= 0.0 else max(root, room / level + chance * root))


@kernel
def judge_lanes(block, lanes, n, certain, mapped):
    """Find what each of n lanes comes to; certain: what a bounded uncertainty may hide is no doubt.

    A lane without information comes to nothing. A model whose error is `mapped` has more of it than what is
    published, and the same for long: what is no loss is then doubted.
    """
    sense, swing0, swing1 = lanes.sense, block.swing[0], block.swing[1]
    level, chance, doubted = block.level, block.chance, 0.0 if certain else 1.0
    for k in range(n):
        N, D = lanes.correlation[k], lanes.information[k]
        slack = lanes.slack[k] + max(sense[k] * lanes.foreseen[k], 0.0) + max(sense[k] * lanes.shown[k], 0.0)
        is_loss, known = sense[k] != 0.0, D > 0.0
        evidence = sense[k] * N if is_loss else abs(N)
        room = allowance(lanes, k, swing0, swing1)
        doubt = slack + (room if mapped and not is_loss else doubted * room)
        score = share(level, chance, evidence - slack, room, D)
        likelihood = log_likelihood(is_loss, evidence, D)
        at_least = log_likelihood(is_loss, evidence - doubt, D)
        at_most = log_likelihood(is_loss, evidence + doubt, D)
        lanes.score[k] = score if known else 0.0
        lanes.at_least[k] = at_least if known else 0.0
        lanes.at_most[k] = at_most if known else 0.0
        lanes.likelihood[k] = likelihood if known else -1.0


@kernel
def judge(block, memory=0.0, mapped=False):
    """Fill each hypothesis' score, estimate, and the least and greatest log likelihood ratio it can have.

    memory: where a loss may end, what a frame leaves of what one explained before; 0 where a loss stays.
    mapped: as of `judge_lanes`.
    """
    for g in range(n_groups(block)):
        judge_lanes(block, block.lanes[g], lanes_in(block, g), memory > 0.0, mapped)
    for h, hypothesis in enumerate(block.hypothesis[: block.n_hypotheses]):
        lanes, first = block.lanes[h // PER_GROUP], (h % PER_GROUP) * N_SLOTS
        score, at_least, at_most, best, likeliest = 0.0, 0.0, memory * hypothesis.at_most, -1.0, -1
        for k in range(first, first + N_SLOTS):
            score = max(score, lanes.score[k])
            at_least, at_most = max(at_least, lanes.at_least[k]), max(at_most, lanes.at_most[k])
            if lanes.likelihood[k] > best:
                best, likeliest = lanes.likelihood[k], k
        hypothesis.score, hypothesis.at_least, hypothesis.at_most = score, at_least, at_most
        if likeliest >= 0:
            N, D = lanes.correlation[likeliest], lanes.information[likeliest]
            hypothesis.theta, hypothesis.certainty = estimate(hypothesis.kind, N, D), D


@kernel
def take_in(block, bounded, tolerated, dt, keep, memory=0.0, mapped=False):
    """One frame of a block: its `scratch`, rad/s2, whitened and weighed against every hypothesis.

    Noise, drift and signatures are the frame's already, and so, where `tolerated`, are the regressors.
    bounded: as of `reach`; keep, memory, mapped: as of `weigh` and `judge`.
    """
    advance(block, dt)
    if block.level > 0.0:
        reach(block, bounded, dt)
    whiten(block, block.state, block.scratch, dt, block.innovation)
    if block.calm.n > 0:
        foresee(block, dt)
    if block.glimpsed:
        whiten(block, block.shown_state, block.shown, dt, block.shown)
    if tolerated:
        whiten_regressors(block, dt)
    weigh(block, tolerated, dt, keep)
    judge(block, memory, mapped)


@kernel
def estimate(kind, N, D):
    """The most likely theta; of a loss, with nothing known before but that it is one."""
    if not one_sided(kind):
        return N / D
    theta = (N - 0.5 * PRIOR_INFORMATION) / (D + PRIOR_INFORMATION)
    return min(max(theta, -1.0), 0.0)
