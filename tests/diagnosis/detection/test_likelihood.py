"""The likelihood ratios against generalised least squares with the whole covariance, and their promises."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from innovations import block_of, bounded_all, by_onset, with_hypotheses

from beaver_ftc.diagnosis.detection import likelihood, whitening
from beaver_ftc.diagnosis.detection.blocks import LOSS, N_SLOTS, STEP_FAULT, restarting_slot
from samples import samples

DT = 0.01
TOGETHER = np.array([[0.04, 0.006], [0.006, 0.003]])
AXES = {  # drift, noise, what a drift keeps of itself in a frame
    "one axis": (np.array([[0.02]]), [3e-4], 1.0),
    "two axes": (TOGETHER, [3e-4, 8e-4], 1.0),
    "a drift that returns": (TOGETHER, [3e-4, 8e-4], 0.95),
}


def _block(case, *kinds, tolerance=()):
    drift, noise, kept = AXES[case]
    return with_hypotheses(block_of(drift, noise, jitter=0.05, keep=kept), *kinds, tolerance=tolerance)


@settings(max_examples=samples(60))
@given(
    st.sampled_from(sorted(AXES)),
    st.integers(0, 2**31),
    st.sampled_from(["anyhow", "bang-bang", "against the weights", "constant"]),
)
def test_a_bounded_uncertainty_adds_no_more_than_is_allowed_for(case, seed, course):
    """Any d within its bound, long after the filter has settled; the worst one goes with the signs of w."""
    rng, settled, frames, eta_bar = np.random.default_rng(seed), 600, 90, 0.02
    block = _block(case, STEP_FAULT)
    n = int(block["n"])
    block["alarm_level"], block["eta_rate"] = 6.6, np.inf
    signature = np.zeros((settled + frames, 1, n))
    signature[settled:] = np.cumsum(rng.normal(size=(frames, 1, n)), axis=0)
    size = {"bang-bang": np.sign(rng.normal(size=(settled + frames, n))), "constant": np.ones(n)}.get(
        course, rng.uniform(-1, 1, (settled + frames, n))
    )
    d = np.broadcast_to(eta_bar * size, (settled + frames, n)).copy()
    if course == "against the weights":
        d[settled:] = eta_bar * np.sign(np.gradient(signature[settled:, 0], axis=0))
    bounded_all(block, d, signature, settled, DT)
    known = by_onset(block, "D")[:, 0] > 0.0
    correlation = by_onset(block, "N")[:, 0]
    assert np.all((np.abs(correlation) <= _allowed(block) + 1e-9)[known])


def _allowed(block):
    """What a bounded uncertainty may add to the correlation of the first hypothesis, (slots,)."""
    return np.array(
        [likelihood.uncertain_share(block["tests"][0], k, *block["eta_r"]) for k in range(N_SLOTS)]
    )


GUSTS, QUIET_RAD_S, FRAME_S = np.array([[18.0]]), 1.7e-3, 1 / 229


def _beside(block):
    """The block with the filter that reckons with no gust, as it begins."""
    for name in (
        "n",
        "a",
        "R_y",
        "Q_x",
        "P_xx",
        "P_dd",
    ):
        block["calm"][name] = block[name]
    block["calm"]["Q_d"][0, 0] = 0.01
    return block


def _largest_share(block, innovations, moments):
    """Largest evidence for a loss, in standard deviations, innovations and moments (k,) rad/s2."""
    block["alarm_level"], most = 0.0, 0.0
    for k, (nu, moment) in enumerate(zip(innovations, moments, strict=True)):
        likelihood.reset_slot(block, restarting_slot(k))
        block["nu"][0], block["hypothesis"][0]["signature"][0] = nu, moment
        if block["calm"]["n"]:
            whitening.whiten_calm(block, FRAME_S)
        likelihood.update_block(block, FRAME_S, 1.0)
        most = max(most, block["hypothesis"][0]["score"])
    return most


def _shares(calm):
    """Of 20 flights in still air, in which surfaces give 2.5 rad/s2 for each rad/s that the gyro reads."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        block = with_hypotheses(block_of(GUSTS, [QUIET_RAD_S]), LOSS)
        block = _beside(block) if calm else block
        gyro = QUIET_RAD_S * rng.standard_normal(301)
        yield _largest_share(block, np.diff(gyro) / FRAME_S, 2.5 * gyro[:-1])


def test_a_law_that_answers_noise_shows_no_loss_in_air_calmer_than_declared():
    """A law that takes damping off does so."""
    assert min(_shares(False)) > 5.0  # the evidence, were it not so
    assert max(_shares(True)) < 3.5
