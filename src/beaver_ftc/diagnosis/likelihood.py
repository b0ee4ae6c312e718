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

An uncertainty d that is merely bounded, |d| <= eta_bar, is no noise. Through the same filter it shows as g_d.
Of a constant the filter leaves g_0, of a step besides a transient whose sum is 1 / K_d and whose magnitudes
add up to little more. With w = S^-1 g_s, by summation by parts,

    |sum w' g_d| <= eta_bar (|g_0| sum |w| + RINGING / K_d TV(w)),     TV(w) = sum |w[k] - w[k-1]|

and, d changing by no more than eta_bar omega dt in a frame, TV(w) may be replaced by omega dt sum |w|. The
alarm wants evidence beyond all of this.

A loss that grows is a loss times 1 - exp(-kappa t); one that ends gives back what the surface did not do at
that instant, and stays away. Such shapes raise no alarm: they say what a surface may explain.

Onsets: slot j starts anew every 2^(j+1) frames, so that there is always one of about every age. From the
alarm on they stay, and old evidence is forgotten slowly.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.state import ENDING, GROWING, LOSS, N_SLOTS
from beaver_ftc.diagnosis.whitening import whiten

PRIOR_INFORMATION = 12.0  # of a loss uniform on [0, 1]: one over its variance
# Magnitudes of a second-order transient of damping 0.7 add up to 1.09 times its sum; on two axes to more.
RINGING = 1.2


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
        hypothesis.weight[slot, :] = 0.0
        hypothesis.stays[slot] = hypothesis.swings[slot] = hypothesis.drifts[slot] = 0.0
        hypothesis.missing[slot] = 1.0


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
def allow(block, hypothesis, slot, w0, w1, keep):
    """Add to what a bounded uncertainty can contribute to the correlation; w = S^-1 g_s of this frame."""
    before = hypothesis.weight[slot]
    size = block.swing[0] * abs(w0) + block.swing[1] * abs(w1)
    change = block.swing[0] * abs(w0 - before[0]) + block.swing[1] * abs(w1 - before[1])
    hypothesis.stays[slot] = keep * hypothesis.stays[slot]
    hypothesis.stays[slot] += block.stay[0] * abs(w0) + block.stay[1] * abs(w1)
    hypothesis.swings[slot] = keep * hypothesis.swings[slot] + change
    hypothesis.drifts[slot] = keep * hypothesis.drifts[slot] + block.pace * size
    before[0], before[1] = w0, w1


@kernel
def allowance(block, hypothesis, slot):
    """How much of N a bounded uncertainty can explain."""
    weight = hypothesis.weight[slot]
    last = block.swing[0] * abs(weight[0]) + block.swing[1] * abs(weight[1])
    return hypothesis.stays[slot] + min(hypothesis.swings[slot] + last, hypothesis.drifts[slot])


@kernel
def shape(hypothesis, slot, out):
    """Fill out (2,) with the signature since this onset: of growth a part, of an end what it was then."""
    if hypothesis.kind == ENDING:
        if hypothesis.missing[slot] > 0.0:
            hypothesis.held[slot, :] = hypothesis.signature
            hypothesis.missing[slot] = 0.0
        out[:] = hypothesis.held[slot]
        return
    grown = 1.0
    if hypothesis.kind == GROWING:
        hypothesis.missing[slot] *= hypothesis.growth_keep
        grown -= hypothesis.missing[slot]
    out[0], out[1] = grown * hypothesis.signature[0], grown * hypothesis.signature[1]


@kernel
def weigh(block, tolerated, dt, keep):
    """Add the frame just whitened to every hypothesis and onset; `keep` is the share of what was there."""
    response = block.scratch
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        for slot in range(N_SLOTS):
            shape(hypothesis, slot, block.shaped)
            whiten(block, hypothesis.response[slot], block.shaped, dt, response)
            w0 = block.S_inverse[0, 0] * response[0] + block.S_inverse[0, 1] * response[1]
            w1 = block.S_inverse[1, 0] * response[0] + block.S_inverse[1, 1] * response[1]
            N = w0 * block.innovation[0] + w1 * block.innovation[1]
            hypothesis.correlation[slot] = keep * hypothesis.correlation[slot] + N
            hypothesis.information[slot] = (
                keep * hypothesis.information[slot] + w0 * response[0] + w1 * response[1]
            )
            if block.level > 0.0:
                allow(block, hypothesis, slot, w0, w1, keep)
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
def one_sided(kind):
    """Whether a hypothesis has a sign: a loss is no gain."""
    return kind in (LOSS, GROWING, ENDING)


@kernel
def speaking_for(kind, N):
    """The evidence for a hypothesis in its correlation N: a loss takes away, one that ends gives back."""
    if kind == ENDING:
        return N
    return -N if one_sided(kind) else abs(N)


@kernel
def log_likelihood(kind, evidence, information):
    """Largest log likelihood ratio for an evidence N against no fault; a loss is at most whole."""
    if evidence <= 0.0:
        return 0.0
    if one_sided(kind) and evidence > information:
        return evidence - 0.5 * information
    return 0.5 * evidence * evidence / information


@kernel
def share(block, evidence, room, D):
    """Evidence in standard deviations, or as many as it is of all that bounded uncertainty and chance allow.

    room: what a bounded uncertainty can add to the evidence, of information D.
    """
    root = D**0.5
    return evidence / (root if room <= 0.0 else max(root, room / block.level + block.chance * root))


@kernel
def judge(block, tolerated, memory=0.0):
    """Fill each hypothesis' score, estimate, and the least and greatest log likelihood ratio it can have.

    memory: where a loss may end, what a frame leaves of what one explained before; 0 where a loss stays.
    """
    for h in range(block.n_hypotheses):
        hypothesis = block.hypothesis[h]
        hypothesis.at_most *= memory
        hypothesis.score, hypothesis.at_least, best = 0.0, 0.0, -1.0
        for slot in range(N_SLOTS):
            D = hypothesis.information[slot]
            if D <= 0.0:
                continue
            N = hypothesis.correlation[slot]
            evidence = speaking_for(hypothesis.kind, N)
            slack = tolerance(block, hypothesis, slot) if tolerated else 0.0
            room = allowance(block, hypothesis, slot) if block.level > 0.0 else 0.0
            hypothesis.score = max(hypothesis.score, share(block, evidence - slack, room, D))
            doubt = slack + (room if memory == 0.0 else 0.0)
            at_least = log_likelihood(hypothesis.kind, evidence - doubt, D)
            at_most = log_likelihood(hypothesis.kind, evidence + doubt, D)
            hypothesis.at_least = max(hypothesis.at_least, at_least)
            hypothesis.at_most = max(hypothesis.at_most, at_most)
            likelihood = log_likelihood(hypothesis.kind, evidence, D)
            if likelihood > best:
                best = likelihood
                hypothesis.theta, hypothesis.certainty = estimate(hypothesis.kind, N, D), D


@kernel
def estimate(kind, N, D):
    """The most likely theta; of a loss, with nothing known before but that it is one."""
    if not one_sided(kind):
        return N / D
    theta = (N - 0.5 * PRIOR_INFORMATION) / (D + PRIOR_INFORMATION)
    return min(max(theta, -1.0), 0.0)
