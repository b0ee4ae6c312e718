"""Generalised likelihood ratio tests on the whitened innovation [Willsky1976].

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

Onsets: slot j starts anew every 2^(j+1) frames, so that there is always one of about every age. From the
alarm on they stay, and old evidence is forgotten slowly.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import LOSS, N_SLOTS
from beaver_ftc.diagnosis.whitening import whiten

PRIOR_INFORMATION = 12.0  # of a loss uniform on [0, 1]: one over its variance


@kernel
def slot_to_start(frame):
    """The slot that starts anew at a frame: slot j at odd multiples of 2^j, the last at all that are left."""
    slot = 0
    while frame % 2 == 0 and slot < N_SLOTS - 1:
        frame //= 2
        slot += 1
    return slot


@kernel
def start(block, slot):
    """Forget everything about an onset."""
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        hypothesis.correlation[slot] = hypothesis.information[slot] = 0.0
        hypothesis.response[slot, :] = 0.0
        hypothesis.overlap[slot, : block.n_regressors] = 0.0


@kernel
def weigh(block, tolerated, dt, keep):
    """Add the frame just whitened to every hypothesis and onset; `keep` is the share of what was there."""
    response = block.scratch
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        for slot in range(N_SLOTS):
            whiten(block, hypothesis.response[slot], hypothesis.signature, dt, response)
            w0 = block.S_inverse[0, 0] * response[0] + block.S_inverse[0, 1] * response[1]
            w1 = block.S_inverse[1, 0] * response[0] + block.S_inverse[1, 1] * response[1]
            N = w0 * block.innovation[0] + w1 * block.innovation[1]
            hypothesis.correlation[slot] = keep * hypothesis.correlation[slot] + N
            hypothesis.information[slot] = (
                keep * hypothesis.information[slot] + w0 * response[0] + w1 * response[1]
            )
            if tolerated:
                for j in range(block.n_regressors):
                    R = w0 * block.regressor_response[j, 0] + w1 * block.regressor_response[j, 1]
                    hypothesis.overlap[slot, j] = keep * hypothesis.overlap[slot, j] + R


@kernel
def tolerance(block, hypothesis, slot):
    """How much of N the declared errors of the coefficients can explain."""
    total = 0.0
    for j in range(block.n_regressors):
        total += block.tolerance[j] * abs(hypothesis.overlap[slot, j])
    return total


@kernel
def log_likelihood(kind, evidence, information):
    """Largest log likelihood ratio for an evidence N against no fault; a loss is at most whole."""
    if evidence <= 0.0:
        return 0.0
    if kind == LOSS and evidence > information:
        return evidence - 0.5 * information
    return 0.5 * evidence * evidence / information


@kernel
def judge(block, tolerated):
    """Fill each hypothesis' score, estimate, and the least and greatest log likelihood ratio it can have."""
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        hypothesis.score, hypothesis.at_least, hypothesis.at_most, best = 0.0, 0.0, 0.0, -1.0
        for slot in range(N_SLOTS):
            D = hypothesis.information[slot]
            if D <= 0.0:
                continue
            N = hypothesis.correlation[slot]
            evidence = -N if hypothesis.kind == LOSS else abs(N)
            slack = tolerance(block, hypothesis, slot) if tolerated else 0.0
            hypothesis.score = max(hypothesis.score, (evidence - slack) / D**0.5)
            at_least = log_likelihood(hypothesis.kind, evidence - slack, D)
            at_most = log_likelihood(hypothesis.kind, evidence + slack, D)
            hypothesis.at_least = max(hypothesis.at_least, at_least)
            hypothesis.at_most = max(hypothesis.at_most, at_most)
            likelihood = log_likelihood(hypothesis.kind, evidence, D)
            if likelihood > best:
                best = likelihood
                hypothesis.theta, hypothesis.certainty = estimate(hypothesis.kind, N, D), D


@kernel
def estimate(kind, N, D):
    """The most likely theta; of a loss, with nothing known before but that it is one."""
    if kind != LOSS:
        return N / D
    theta = (N - 0.5 * PRIOR_INFORMATION) / (D + PRIOR_INFORMATION)
    return min(max(theta, -1.0), 0.0)
