"""Likelihood ratios a kernel at a time: the bounded uncertainty's room, shapes of a loss, what is judged."""

import numpy as np
import pytest
from innovations import block_of, by_onset, with_hypotheses
from kernels import new_fdi
from statistics_of import Statistical, put

from beaver_ftc.diagnosis.detection import likelihood
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA_CUBED_MOMENT,
    GROWING_LOSS,
    LOSS_END,
    N_SLOTS,
    STEP_FAULT,
)
from beaver_ftc.diagnosis.state import LOSS

TOGETHER = np.array([[0.04, 0.006], [0.006, 0.003]])


def shapes(kind, frames=5):
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), kind)
    block["hypothesis"]["decay"], block["tests"]["left"] = (
        0.8,
        1.0,
    )
    found = []
    for k in range(frames):
        block["hypothesis"]["signature"][0] = 1.0 + k, -2.0 * k
        likelihood.update_signatures(block["hypothesis"][0], block["tests"][0], 0)
        found.append(by_onset(block, "s")[:, 3, 0].copy())
    return np.array(found)


@pytest.mark.parametrize(
    ("kind", "sided", "score"),
    [
        (LOSS, True, -1.0),
        (GROWING_LOSS, True, -1.0),
        (LOSS_END, True, 1.0),
        (STEP_FAULT, False, 1.0),
        (ALPHA_CUBED_MOMENT, False, 1.0),
    ],
)
def test_a_loss_takes_away_and_its_end_gives_back(kind, sided, score):
    """The score for a correlation of 3 and of -3, of information 9."""
    assert bool(likelihood.is_one_sided(kind)) == sided
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), kind)
    for sign in (1.0, -1.0):
        onset_tests = block["tests"][0]
        onset_tests["correlation"][0], onset_tests["information"][0] = 3.0 * sign, 9.0
        likelihood.evaluate_tests(block, onset_tests, N_SLOTS, True, False)
        assert onset_tests["score"][0] == pytest.approx(score * sign if sided else 1.0)


@pytest.mark.parametrize(("kind", "certain"), [(LOSS, 24.5), (ALPHA_CUBED_MOMENT, 0.5), (STEP_FAULT, 0.5)])
def test_a_mapped_error_is_doubt_of_all_but_a_loss(kind, certain):
    """Evidence of 7 standard deviations, of which what is bounded may be 6: logarithms 7^2 / 2, 1 / 2."""
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), kind)
    lane = block["tests"][0]
    lane["supporting_correlation_sign"], lane["correlation"], lane["information"] = (
        likelihood.SIGN_OF_KIND[kind],
        -7.0 * 9.0,
        81.0,
    )
    lane["e_0"] = 6.0 * 9.0
    likelihood.evaluate_tests(block, lane, N_SLOTS, True, True)
    assert lane["llr_lo"][0] == pytest.approx(certain)
    likelihood.evaluate_tests(block, lane, N_SLOTS, True, False)
    assert lane["llr_lo"][0] == pytest.approx(24.5)
    likelihood.evaluate_tests(block, lane, N_SLOTS, False, True)
    assert lane["llr_lo"][0] == pytest.approx(0.5)


@pytest.mark.parametrize("kind", [LOSS, STEP_FAULT])
@pytest.mark.parametrize("evidence", [-1.0, 0.0, 0.5, 3.9, 4.0, 6.0])
def test_the_log_likelihood_ratio_is_the_largest_of_any_theta_allowed(kind, evidence):
    theta = np.linspace(0.0, 1.0 if kind == LOSS else 9.0, 9001)
    largest = np.max(theta * evidence - 0.5 * theta**2 * 4.0)
    assert likelihood.max_llr(kind == LOSS, evidence, 4.0) == pytest.approx(max(largest, 0.0), abs=1e-6)


@pytest.mark.parametrize("N", [-30.0, -9.0, -5.0, 2.0])
def test_the_estimate_of_a_loss_is_the_likeliest_with_a_prior_and_of_a_step_without(N):
    """A normal prior of mean -1/2 and the variance of a uniform one: the mode within [-1, 0]."""
    theta, D = np.linspace(-1.0, 0.0, 100001), 9.0
    posterior = theta * N - 0.5 * theta**2 * D - 0.5 * 12.0 * (theta + 0.5) ** 2
    assert likelihood.estimate_theta(LOSS, N, D) == pytest.approx(theta[posterior.argmax()], abs=2e-5)
    assert likelihood.estimate_theta(STEP_FAULT, N, D) == pytest.approx(N / 9.0)


def judged(kind=LOSS, uses_regressors=False, memory=0.0, rooms=(0.0, 0.0), at_most=0.0):
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), kind, tolerance=(0.1, 0.2))
    block["alarm_level"], block["noise_share"] = 1.0, 0.5
    onsets, onset_tests, overlap = [1, 5], block["tests"][0], block["R"][0]
    onset_tests["correlation"][onsets], onset_tests["information"][onsets] = (-3.0, -5.0), (4.0, 16.0)
    onset_tests["correlation"][7] = -99.0  # nothing is known of that onset
    overlap[:2, 1], overlap[:2, 5], onset_tests["e_0"][onsets] = (
        (1.0, -2.0),
        (-3.0, 4.0),
        rooms,
    )
    hypothesis = block["hypothesis"][0]
    hypothesis["score"], hypothesis["llr_lo"], hypothesis["llr_hi"] = 99.0, 99.0, at_most
    if uses_regressors:
        likelihood.accumulate_regressors(block, onset_tests, overlap, N_SLOTS, 1.0)
    likelihood.evaluate_hypotheses(block, memory)
    return hypothesis


def detector(**fields):
    fdi = new_fdi()
    record = fdi["statistical"]
    (
        record["test"]["alarm_level"],
        record["test"]["margin"],
        record["test"]["forget"],
    ) = (
        5.0,
        4.0,
        0.9,
    )
    put(record, **fields)
    for block, axes in zip(record["block"], ((1,), (0, 2), (0, 2)), strict=True):
        block["n"], block["axes"][: len(axes)], block["n_h"] = len(axes), axes, 3
    return fdi, record


def with_scores(*scores, alarms=1):
    _, record = detector(detected_at_s=-1.0)
    for block, values in zip(record["block"], scores, strict=True):
        block["hypothesis"]["score"][:3], block["hypothesis"]["alarms"][:3] = values, alarms
        block["hypothesis"]["axis"][:3], block["hypothesis"]["column"][:3] = (0, 1, 2), (0, 1, 2)
    return record


def test_the_alarm_is_the_largest_share_of_the_level():
    record = with_scores((1.0, 2.0, 0.0), (3.0, 0.0, 4.9), (0.5, 1.5, 2.5))
    Statistical.score(record, 7.0)
    assert record["alarm"]["ratio"] == pytest.approx(4.9 / 5.0)
    assert record["alarm"]["axis"] == 2
    assert record["alarm"]["detected_at_s"] == -1.0
    record["block"][1]["hypothesis"]["score"][0] = 6.0
    Statistical.score(record, 8.0)
    Statistical.score(record, 9.0)
    assert (record["alarm"]["axis"], record["alarm"]["detected_at_s"]) == (0, 8.0)
    Statistical.score(record, 10.0, False)  # where the model's error is not known
    assert record["alarm"]["ratio"] == 0.0
    silent = with_scores((9.0,) * 3, (9.0,) * 3, (9.0,) * 3, alarms=0)
    Statistical.score(silent, 7.0)
    assert silent["alarm"]["ratio"] == 0.0
