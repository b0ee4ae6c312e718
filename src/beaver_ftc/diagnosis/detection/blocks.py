"""Blocks: what a likelihood-ratio test keeps of a set of axes, of its hypotheses and of their onsets.

A block is one of the rates, or that of a parity view (parity.py). It has a whitening filter (whitening.py),
regressors, and hypotheses; each hypothesis is tested for N_SLOTS onsets (likelihood.py).

Onsets: slot j restarts every 2^(j+1) frames (the last one every 2^j), so that onsets of about every age exist
at any time. After an alarm no slot restarts, and old evidence decays slowly.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.compiled import kernel, plain, record, sized
from beaver_ftc.diagnosis.detection.whitening import FILTER_FIELDS

# The blocks of the rates. Each is a set of axes with correlated noise: pitch, roll with yaw, and roll with
# yaw again, with a drift that returns to zero.
PITCH_BLOCK, LATERAL_BLOCK, REVERTING_BLOCK = range(3)
N_FILTER_BLOCKS = 3
N_SLOTS = 10  # number of onsets that are tested of each hypothesis
N_ROWS = 5  # roll, pitch, yaw, side force, normal force: rows.py
SIDE_FORCE, NORMAL_FORCE = 3, 4
USUAL_HYPOTHESES = 8  # number that is enough for a block of the rates of most aircraft
MIN_ETA_RAD_S2 = 1e-3  # lower limit of the bound that sets the drift: the bound may pass zero
# Kinds of hypothesis. LOSS: a surface has lost effectiveness; POSITION_HYPOTHESIS, of isolation.py alone: it
# is anywhere in its travel.
LOSS, POSITION_HYPOTHESIS, STEP_FAULT, ALPHA_CUBED_MOMENT, GROWING_LOSS, LOSS_END = range(6)
# Sign of N that supports a hypothesis: a loss removes moment, its end restores moment; 0: both signs.
SIGN_OF_KIND = {LOSS: -1.0, STEP_FAULT: 0.0, ALPHA_CUBED_MOMENT: 0.0, GROWING_LOSS: -1.0, LOSS_END: 1.0}

DRIFT_PRIOR_RAD_S2 = 1.0  # standard deviation of the drift at the start of a flight; soon irrelevant

HYPOTHESIS_RECORD = record(
    # alarms: whether it raises alarms; column: of its score in ALARM_RECORD.share (statistical.py)
    kind=int, surface=int, axis=int, alarms=int, column=int,
    signature=2,  # s of this frame, rad/s2 per unit of theta
    decay=float,  # exp(-kappa dt) of a growing loss
    score=float,  # largest normalised evidence over the onsets, standard deviations
    th=float, D=float,  # of a LOSS: estimate at the likeliest onset; one over its variance
    llr_lo=float, llr_hi=float,  # bounds on the log-likelihood ratio against no fault
)  # fmt: skip


class BlockCapacity(NamedTuple):
    """The numbers of regressors and hypotheses for which a block has memory."""

    max_regressors: int
    max_hypotheses: int


# An onset test is one hypothesis with one onset. Those of a few hypotheses lie side by side for vector
# instructions: test (h % GROUP_SIZE) * N_SLOTS + slot in group h // GROUP_SIZE. A group has the same size in
# every record, so compiled code knows that its arrays do not overlap. Checking that in each frame took a
# tenth of the detector's time.
GROUP_SIZE = 4
N_GROUP_TESTS = GROUP_SIZE * N_SLOTS
TESTS_RECORD = record(
    sign=N_GROUP_TESTS,  # of an N that supports the hypothesis, or 0
    # signature since the onset, rad/s2; state of its filter; its response in this frame, rad/s; and S^-1 g_s
    s=(2, N_GROUP_TESTS), x_s=(4, N_GROUP_TESTS), g_s=(2, N_GROUP_TESTS), w=(2, N_GROUP_TESTS),
    N=N_GROUP_TESTS, D=N_GROUP_TESTS,  # sums of w' g and of w' g_s
    left=N_GROUP_TESTS,  # exp(-kappa age) of a growing loss; for an end of a loss 1, and 0 after the onset
    # Of |N|: part by errors of coefficients; three parts by a bounded uncertainty (likelihood.py). Of N: part
    # by calm air, part by a coarse gust
    e_R=N_GROUP_TESTS, e_0=N_GROUP_TESTS, e_tv=N_GROUP_TESTS, e_w=N_GROUP_TESTS,
    N_p=N_GROUP_TESTS, N_c=N_GROUP_TESTS,
    # score; bounds on the log-likelihood ratio against no fault; that ratio itself, -1 without information
    score=N_GROUP_TESTS, llr_lo=N_GROUP_TESTS, llr_hi=N_GROUP_TESTS, llr=N_GROUP_TESTS,
)  # fmt: skip


@sized
def block_dtype(size: BlockCapacity) -> np.dtype:
    """A block: its axes, its whitening filter, its regressors, its hypotheses and their onset tests."""
    n_groups = plain(n_test_groups)(size.max_hypotheses)
    return record(
        axes=(int, 2),  # first: a record that begins as another does is taken for one
        **FILTER_FIELDS,
        # source of the rows that it sees (rows.py), and its directions m; bound on the uncertainty along
        # these, rad/s2, and whether that bound is for one surface anywhere in its travel
        source=int, m=(2, N_ROWS), eta=2, any_position=int,
        # correlation length of the drift, m, 0 for a random walk; factor on the intensity of a gust
        drift_length_m=float, Q_scale=float,
        nu=2, x_known=4,  # innovation of the frame, rad/s2; state of the filter after known faults
        # in turbulence: filter without gust; lambda p, rad/s, and the sums pg, pp (`update_calm_part`)
        calm=record(**FILTER_FIELDS), p=2, pg=float, pp=float,
        has_coarse=int, g_c=2, x_c=4,  # whether vanes show a gust coarsely; state of its filter
        # alarm level, standard deviations; share of it reserved for noise beyond a bounded uncertainty
        alarm_level=float, noise_share=float,
        # largest change of the bounded uncertainty in a frame, over eta; effects of eta on g, rad/s, by a
        # constant and by the transient of a step (`likelihood.bound_responses`)
        eta_rate=float, eta_0=2, eta_r=2,
        # regressors: number in use; of these the first n_columns are columns of Z in rows.py, one more is the
        # leak of a view; tolerances; values, states and responses
        n_Z=int, n_columns=int, columns=(int, size.max_regressors), tol=size.max_regressors,
        regressor=(size.max_regressors, 2), x_Z=(size.max_regressors, 4), g_Z=(size.max_regressors, 2),
        n_h=int, hypothesis=(HYPOTHESIS_RECORD, size.max_hypotheses),
        tests=(TESTS_RECORD, n_groups),
        R=(n_groups, size.max_regressors, N_GROUP_TESTS),  # sums of w' g_Z
    )  # fmt: skip


def new_filter_block(P: np.ndarray, R: np.ndarray) -> np.ndarray:
    """A block (1,) that filters n rates and has no hypotheses.

    P (2 n, 2 n): covariance of rates and their drift; R (n,): variance of a reading's noise. The decay a of
    the drift is left 0, for the caller to fill.
    """
    blocks = np.zeros(1, block_dtype(BlockCapacity(1, 1)))
    n = len(R)
    b = blocks[0]
    x = slice(0, n)
    d = slice(n, 2 * n)
    b["n"] = n
    b["axes"] = 0, 1
    b["R_y"][:n] = R
    for name, i, j in (("P_xx", x, x), ("P_xd", x, d), ("P_dd", d, d)):
        b[name][:n, :n] = P[i, j]
    return blocks


@kernel
def restarting_slot(k):
    """The slot that restarts at frame k: slot j at odd multiples of 2^j, the last at all other frames."""
    j = 0
    while k % 2 == 0 and j < N_SLOTS - 1:
        k //= 2
        j += 1
    return j


@kernel
def n_test_groups(n_h):
    """The number of groups of onset tests that n_h hypotheses need."""
    return (n_h + (GROUP_SIZE - 1)) // GROUP_SIZE


@kernel
def tests_in_group(b, i):
    """The number of onset tests in use in group i: the first entries of each array."""
    return min(b.n_h - i * GROUP_SIZE, GROUP_SIZE) * N_SLOTS
