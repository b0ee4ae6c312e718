"""Likelihood ratios a kernel at a time: the bounded uncertainty's room, shapes of a loss, what is judged."""

import numpy as np
import pytest
from innovations import block_of, by_onset, onset_tests_of, with_hypotheses
from kernels import new_fdi
from statistics_of import Statistical, put

from beaver_ftc.diagnosis.detection import likelihood, statistical
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA_CUBED_MOMENT,
    GROWING_LOSS,
    LOSS_END,
    N_GROUP_TESTS,
    N_SLOTS,
    STEP_FAULT,
    USUAL_HYPOTHESES,
)
from beaver_ftc.diagnosis.state import LOSS

DT = 0.02
TOGETHER = np.array([[0.04, 0.006], [0.006, 0.003]])


def steady_block(axes=2, keep=0.97):
    """A block whose filter has settled."""
    drift, noise = (TOGETHER, [3e-4, 8e-4]) if axes == 2 else (TOGETHER[:1, :1], [3e-4])
    block = block_of(drift, noise, jitter=0.05, keep=keep)
    for _ in range(60):
        likelihood.advance_covariance(block, DT)
    return block


def through(block, accelerations):
    """What the filter, from rest, leaves of accelerations (k, n)."""
    out, state, shown = np.zeros(2), np.zeros(4), []
    for acceleration in accelerations:
        likelihood.whiten_step(block, state, np.append(acceleration, 0.0)[:2], DT, out)
        shown.append(out[: block["n"]].copy())
    return np.array(shown)


@pytest.mark.parametrize("is_estimated", [0, 1])
def test_a_coarse_gust_is_whitened_as_the_innovation_is_and_summed_with_the_same_weights(is_estimated):
    rng, keep, gust = np.random.default_rng(5), 0.9, np.array([0.3, -0.2, 0.5])
    block = with_hypotheses(steady_block(), LOSS, STEP_FAULT)
    block["axes"][:2], block["has_coarse"] = (2, 0), is_estimated
    before = onset_tests_of(block, "correlation_from_coarse_gust")
    before[: 2 * N_SLOTS] = rng.normal(size=2 * N_SLOTS)
    block["tests"]["correlation_from_coarse_gust"] = before.reshape(-1, N_GROUP_TESTS)
    block["hypothesis"]["signature"][:2, :2] = rng.normal(size=(2, 2))
    likelihood.set_coarse_gust(block, is_estimated * gust)
    settled = block.copy()
    likelihood.advance_covariance(settled, DT)
    white = through(settled, [gust[[2, 0]]])[0]
    likelihood.update_block(block, np.zeros(3), False, DT, keep)
    weights = onset_tests_of(block, "w")
    share = keep * before + is_estimated * white @ weights
    expected = np.where(np.arange(before.size) < 2 * N_SLOTS, share, before)
    found = onset_tests_of(block, "correlation_from_coarse_gust")
    assert found == pytest.approx(expected)
    assert np.abs(white @ weights).max() > 0.0


def test_the_slot_that_starts_anew_counts_the_twos_of_the_frame():
    expected = [min((k & -k).bit_length() - 1, N_SLOTS - 1) for k in range(1, 2**11)]
    assert [likelihood.restarting_slot(k) for k in range(1, 2**11)] == expected
    assert likelihood.restarting_slot(0) == N_SLOTS - 1


def test_an_onset_that_starts_knows_nothing_and_the_others_stay():
    kinds = USUAL_HYPOTHESES // 2 * (LOSS, STEP_FAULT)
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), *kinds, tolerance=(0.1, 0.2))
    names = (
        "correlation",
        "information",
        "e_0",
        "e_tv",
        "e_w",
        "N_p",
        "left",
        "x_s",
        "w",
        "R",
    )
    for name in names[:-1]:
        block["tests"][name] = 3.0
    block["R"] = 3.0
    likelihood.reset_slot(block, 4)
    for name in names:
        kept = by_onset(block, name)
        assert (np.delete(kept, 4, axis=-2) == 3.0).all(), name
        cleared = kept[:2, 4] if name == "R" else kept[..., 4, :]
        assert (cleared == (1.0 if name == "left" else 0.0)).all(), name


def test_of_a_constant_the_filter_leaves_what_stay_says():
    """One axis, a drift that returns: after its transient a constant of eta_bar shows as g_0."""
    block = steady_block(1)
    likelihood.bound_responses(block, np.array([0.3, 9.0, 9.0]), DT)
    assert through(block, np.full((600, 1), 0.3))[-1] == pytest.approx(block["eta_0"][:1])
    still = steady_block(1, keep=1.0)
    likelihood.bound_responses(still, np.array([0.3, 0.0, 0.0]), DT)
    assert not still["eta_0"].any()  # a walk takes in all that is constant


@pytest.mark.parametrize("axes", [1, 2])
def test_a_steps_transient_sums_to_the_inverse_gain(axes):
    """Sum of what the filter leaves of a step: K_d^-1, by axes; RINGING is kept for its swings."""
    block, bounded = steady_block(axes, keep=1.0), np.array([0.3, 0.2, 9.0])
    likelihood.bound_responses(block, bounded, DT)
    sums = np.array([through(block, np.tile(unit, (600, 1))).sum(axis=0) for unit in np.eye(axes)]).T
    expected = likelihood.RINGING_FACTOR * np.abs(sums) @ bounded[:axes]
    assert block["eta_r"][:axes] == pytest.approx(expected, rel=1e-6)
    assert np.linalg.inv(block["K_d"][:axes, :axes]) == pytest.approx(sums, rel=1e-6)


def test_the_room_of_a_bounded_uncertainty_is_summed_up_by_parts():
    rng, frames, keep = np.random.default_rng(4), 12, 0.9
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), STEP_FAULT)
    (
        block["eta_0"],
        block["eta_r"],
        block["eta_rate"],
    ) = (
        (0.1, 0.2),
        (0.3, 0.4),
        0.05,
    )
    w = rng.normal(size=(frames, 2))
    block["K_x"] = block["S_inv"] = np.eye(2)  # a filter that forgets at once: g_s is the signature
    onset_tests, lane = block["tests"][0], 2
    for each in w:
        onset_tests["s"][:, lane] = each
        likelihood.accumulate_tests(block, onset_tests, N_SLOTS, 1.0, keep)
    old = keep ** np.arange(frames)[::-1]
    changes = np.abs(np.diff(np.vstack([np.zeros(2), w]), axis=0))
    max_correlation_by_constant_uncertainty, swings = (
        old @ np.abs(w) @ [0.1, 0.2],
        old @ changes @ [0.3, 0.4],
    )
    max_correlation_by_rate_limited_uncertainty = old @ np.abs(w) @ [0.3, 0.4] * 0.05
    assert onset_tests["e_0"][lane] == pytest.approx(max_correlation_by_constant_uncertainty)
    assert onset_tests["e_tv"][lane] == pytest.approx(swings)
    assert onset_tests["e_w"][lane] == pytest.approx(max_correlation_by_rate_limited_uncertainty)
    last = np.abs(w[-1]) @ [0.3, 0.4]
    allowed = likelihood.uncertain_share(onset_tests, lane, *block["eta_r"])
    assert allowed == pytest.approx(
        max_correlation_by_constant_uncertainty
        + min(swings + last, max_correlation_by_rate_limited_uncertainty)
    )
    onset_tests["e_w"][lane] = 99.0
    allowed = likelihood.uncertain_share(onset_tests, lane, *block["eta_r"])
    assert allowed == pytest.approx(max_correlation_by_constant_uncertainty + swings + last)


@pytest.mark.parametrize("tolerance", [(), (0.1,), (0.1, 0.2), (0.1, 0.2, 0.3), (0.1, 0.2, 0.3, 0.4, 0.5)])
def test_a_frame_is_whitened_weighed_and_summed_as_matrices_say(tolerance):
    """Every onset test by itself: r = x + dt (s - d), w = S^-1 r; N, D and R by w, what was there by its
    share. Of even and odd numbers of regressors."""
    rng, dt, keep, kept = np.random.default_rng(8), 0.05, 0.9, 0.8
    kinds = USUAL_HYPOTHESES // 2 * (LOSS, STEP_FAULT)
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), *kinds, tolerance=tolerance)
    K_x, K_d, S = rng.normal(size=(3, 2, 2))
    block["K_x"], block["K_d"], block["S_inv"], block["a"] = K_x, K_d, S, kept
    seen, regressors = rng.normal(size=2), rng.normal(size=(len(tolerance), 2))
    block["g"], block["g_Z"][: len(tolerance)] = seen, regressors
    for name in (
        "s",
        "x_s",
        "correlation",
        "information",
        "e_R",
    ):
        block["tests"][name] = rng.normal(size=block["tests"][name].shape)
    block["R"] = rng.normal(size=block["R"].shape)
    kept_by_name = (
        "s",
        "x_s",
        "correlation",
        "information",
        "R",
    )
    before = {name: onset_tests_of(block, name) for name in kept_by_name}
    for onset_tests, overlap in zip(block["tests"], block["R"], strict=True):
        likelihood.accumulate_tests(block, onset_tests, N_GROUP_TESTS, dt, keep)
        likelihood.accumulate_regressors(block, onset_tests, overlap, N_GROUP_TESTS, keep)
    lane = {name: onset_tests_of(block, name) for name in (*kept_by_name, "w", "e_R")}
    x, d = before["x_s"][:2], before["x_s"][2:]
    r = x + dt * (before["s"] - d)
    w = S @ r
    assert lane["x_s"] == pytest.approx(np.vstack([r - K_x @ r, kept * d + K_d @ r]))
    assert lane["w"] == pytest.approx(w)
    assert lane["correlation"] == pytest.approx(keep * before["correlation"] + seen @ w)
    assert lane["information"] == pytest.approx(keep * before["information"] + (w * r).sum(axis=0))
    overlaps = keep * before["R"][: len(tolerance)] + regressors @ w
    assert lane["R"][: len(tolerance)] == pytest.approx(overlaps)
    assert lane["R"][len(tolerance) :] == pytest.approx(before["R"][len(tolerance) :])
    assert lane["e_R"] == pytest.approx(np.array(tolerance) @ np.abs(overlaps))


@pytest.mark.parametrize(
    ("pg", "size", "share"),
    [
        (
            0.0,
            500.0,
            lambda pg, size: (pg + 4.0 + 2.0 * np.sqrt(size + 4.0)) / (size + 4.0),
        ),
        (-900.0, 500.0, lambda pg, size: 0.0),
        (900.0, 500.0, lambda pg, size: 1.0),
    ],
)
def test_what_calm_air_foretells_is_what_the_calm_filter_sees_by_as_much_as_it_lately_has(pg, size, share):
    block = steady_block()
    for name in (
        "n",
        "a",
        "R_y",
        "Q_x",
        "P_xx",
        "P_dd",
    ):
        block["calm"][name] = block[name]
    block["calm"]["Q_d"][:] = 0.1 * TOGETHER
    alone = block["calm"].copy()
    block["g"], block["nu"] = (0.003, -0.001), (0.4, -0.2)
    block["pg"], block["pp"] = pg, size
    inverse, g = block["S_inv"].copy(), block["g"].copy()
    likelihood.whiten_calm(block, DT)
    likelihood.update_calm_part(block, DT)
    likelihood.advance_covariance(alone, DT)
    likelihood.whiten_step(alone, alone["state"], np.array([0.4, -0.2]), DT, alone["g"])
    foretold = g - alone["g"]
    kept = np.exp(-DT / 2.0)
    pg, size = (
        kept * pg + foretold @ inverse @ g,
        kept * size + foretold @ inverse @ foretold,
    )
    assert (block["pg"], block["pp"]) == pytest.approx((pg, size), rel=1e-12)
    assert block["p"] == pytest.approx(share(pg, size) * foretold, rel=1e-12)
    assert block["calm"]["state"] == pytest.approx(alone["state"], rel=1e-12)


@pytest.mark.parametrize(("kind", "sided"), [(LOSS, -1.0), (LOSS_END, 1.0), (STEP_FAULT, 0.0)])
def test_what_calm_air_foretells_is_taken_off_where_it_speaks_for_the_fault(kind, sided):
    for foreseen in (3.0, -3.0):
        scores = []
        for it in (0.0, foreseen):
            block = with_hypotheses(steady_block(), kind)
            for name, value in {
                "correlation": sided * 8.0 or 8.0,
                "information": 4.0,
                "N_p": it,
            }.items():
                block["tests"][name][0, :N_SLOTS] = value
            likelihood.evaluate_hypotheses(block)
            scores.append(block["hypothesis"][0]["score"])
        assert scores[0] == pytest.approx(4.0)
        assert scores[0] - scores[1] == pytest.approx(1.5 if sided * foreseen > 0.0 else 0.0)


def test_of_hypotheses_that_a_block_does_not_have_nothing_is_reckoned():
    rng = np.random.default_rng(9)
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), LOSS, STEP_FAULT, tolerance=(0.1, 0.2))
    block["alarm_level"], block["regressor"][:2] = 4.0, rng.normal(size=(2, 2))
    names = (*block["tests"].dtype.names, "R")
    for name in names[:-1]:
        block["tests"][name] = rng.uniform(1.0, 2.0, block["tests"][name].shape)
    block["R"] = rng.uniform(1.0, 2.0, block["R"].shape)
    before = {name: onset_tests_of(block, name) for name in names}
    block["hypothesis"]["signature"], block["nu"] = rng.normal(size=2), rng.normal(size=2)
    likelihood.reset_slot(block, 3)
    likelihood.update_block(block, np.full(3, 0.1), True, DT, 0.9)
    for name in names:
        assert (onset_tests_of(block, name) == before[name])[..., 2 * N_SLOTS :].all(), name


def test_a_lane_without_information_comes_to_nothing():
    block = with_hypotheses(block_of(TOGETHER, [1e-3, 1e-3]), *USUAL_HYPOTHESES * (LOSS,))
    (
        block["tests"]["supporting_correlation_sign"],
        block["tests"]["correlation"],
        block["alarm_level"],
    ) = (
        -1.0,
        -5.0,
        4.0,
    )
    block["tests"]["information"][:, ::2] = 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        for onset_tests in block["tests"]:
            likelihood.evaluate_tests(block, onset_tests, N_GROUP_TESTS, True, False)
    for name, nothing in (("score", 0.0), ("llr_lo", 0.0), ("llr_hi", 0.0), ("llr", -1.0)):
        assert (onset_tests_of(block, name)[1::2] == nothing).all()
        assert (onset_tests_of(block, name)[::2] > 0.0).all()


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


def test_a_loss_grows_stays_or_gives_back_what_it_was():
    k = np.arange(5)
    signature = np.column_stack([1.0 + k, -2.0 * k])
    assert shapes(LOSS) == pytest.approx(signature)
    assert shapes(STEP_FAULT) == pytest.approx(signature)
    assert shapes(GROWING_LOSS) == pytest.approx((1.0 - 0.8 ** (k + 1.0))[:, None] * signature)
    assert shapes(LOSS_END) == pytest.approx(np.tile(signature[0], (5, 1)))


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


def test_a_share_is_in_standard_deviations_or_of_what_uncertainty_and_chance_allow():
    assert likelihood.evidence_ratio(6.0, 0.5, 12.0, 0.0, 9.0) == pytest.approx(4.0)
    assert likelihood.evidence_ratio(6.0, 0.5, 12.0, 24.0, 9.0) == pytest.approx(12.0 / (4.0 + 1.5))
    against_chance_alone = likelihood.evidence_ratio(6.0, 0.5, 12.0, 0.6, 9.0)
    assert against_chance_alone == pytest.approx(4.0)  # never more than that


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


def test_a_hypothesis_is_worth_its_best_onset():
    hypothesis = judged()
    assert hypothesis["score"] == pytest.approx(1.5)  # 3 / 2 beside 5 / 4
    assert hypothesis["llr_lo"] == hypothesis["llr_hi"] == pytest.approx(9.0 / 8.0)
    assert hypothesis["th"] == pytest.approx(max((-3.0 - 6.0) / 16.0, -1.0))
    assert hypothesis["D"] == 4.0


def test_what_errors_of_coefficients_explain_is_taken_off_and_may_be_added():
    hypothesis = judged(uses_regressors=True)  # slack 0.5 and 1.1
    assert hypothesis["score"] == pytest.approx(max(2.5 / 2.0, 3.9 / 4.0))
    assert hypothesis["llr_lo"] == pytest.approx(max(2.5**2 / 8.0, 3.9**2 / 32.0))
    assert hypothesis["llr_hi"] == pytest.approx(max(3.5**2 / 8.0, 6.1**2 / 32.0))


def test_what_a_bounded_uncertainty_explains_is_held_against_the_evidence():
    hypothesis = judged(rooms=(0.25, 0.5))
    assert hypothesis["score"] == pytest.approx(max(3.0 / 2.0, 5.0 / 4.0))
    assert hypothesis["llr_lo"] == pytest.approx(max(2.75**2 / 8.0, 4.5**2 / 32.0))
    assert hypothesis["llr_hi"] == pytest.approx(max(3.25**2 / 8.0, 5.5**2 / 32.0))


def test_where_a_loss_may_end_what_was_explained_is_remembered_and_uncertainty_casts_no_doubt():
    hypothesis = judged(rooms=(0.25, 0.5), memory=0.9, at_most=10.0)
    assert hypothesis["llr_hi"] == pytest.approx(9.0)
    assert hypothesis["llr_lo"] == pytest.approx(9.0 / 8.0)
    assert judged(memory=0.0, at_most=10.0)["llr_hi"] == pytest.approx(9.0 / 8.0)


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


def test_signatures_are_what_surfaces_gave_steps_and_the_cubic_moment():
    _, record = detector()
    for hypothesis, (kind, surface, axis) in zip(
        record["block"][1]["hypothesis"],
        ((LOSS, 2, 2), (STEP_FAULT, -1, 2), (STEP_FAULT, -1, 0)),
        strict=False,
    ):
        hypothesis["kind"], hypothesis["surface"], hypothesis["axis"] = kind, surface, axis
    record["block"][0]["hypothesis"]["kind"][:3] = LOSS, STEP_FAULT, ALPHA_CUBED_MOMENT
    record["block"][0]["hypothesis"]["surface"][:3] = 1, -1, -1
    record["block"][0]["hypothesis"]["axis"][:3] = 1, 1, 1
    Gu = np.arange(12.0).reshape(3, 4)
    Statistical.signatures(record, Gu, 0.7)
    lateral = record["block"][1]["hypothesis"]["signature"][:3]
    assert lateral == pytest.approx(np.array([[2.0, 10.0], [0.0, 1.0], [1.0, 0.0]]))
    assert record["block"][0]["hypothesis"]["signature"][:3, 0] == pytest.approx([5.0, 1.0, 0.7])


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


def test_the_log_has_each_test_as_its_largest_share():
    record, row = with_scores((1.0, 2.0, 0.0), (3.0, 0.0, 4.0), (0.5, 1.5, 2.5)), np.full(6, 9.0)
    record["test"]["n_scores"] = 4
    Statistical.record(record, row)
    assert row == pytest.approx([9.0, 9.0, 0.6, 0.4, 0.8, 0.0])
    record["block"]["hypothesis"]["alarms"] = 0
    Statistical.record(record, row)
    assert row == pytest.approx([9.0, 9.0, 0.0, 0.0, 0.0, 0.0])


def test_the_estimate_of_a_loss_is_the_surest():
    _, record = detector()
    for b, (theta, information) in enumerate(((-0.9, 1.0), (-0.4, 5.0), (-0.3, 2.0))):
        hypothesis = record["block"][b]["hypothesis"][1]
        hypothesis["kind"], hypothesis["surface"] = LOSS, 2
        hypothesis["th"], hypothesis["D"] = theta, information
    record["block"][2]["hypothesis"][0] = record["block"][2]["hypothesis"][1]
    record["block"][2]["hypothesis"]["kind"][0], record["block"][2]["hypothesis"]["D"][0] = (
        STEP_FAULT,
        9.0,
    )
    assert statistical.estimate_loss(record["block"], 2) == (-0.4, 5.0)
    assert statistical.estimate_loss(record["block"], 1) == (0.0, 0.0)


def contested(loss=1.0, step=0.0, other=0.0, growing=0.0, ending=0.0, pitch=(0.0, 0.0, 0.0), **keys):
    """Whether a loss of the rudder (2) is excluded, by log likelihood ratios in roll and yaw; in pitch by
    those of (a step, a loss, its end). Naming level 4."""
    fdi, record = detector()
    fdi["layout"]["loss"] = 0, -1, 1, -1
    fdi["isolation"]["estimator"]["excluded"][0] = keys.get("other_excluded", 0)
    fdi["config"]["abrupt"], record["test"]["w"] = (
        keys.get("abrupt", 0),
        1.0 / keys.get("instants", 1),
    )
    for b, values in ((1, (loss, step, other, growing, ending)), (2, (99.0, 0.0, 0.0, 0.0, 0.0))):
        block = record["block"][b]
        block["n_h"] = 5
        block["hypothesis"]["kind"][:5] = LOSS, STEP_FAULT, LOSS, GROWING_LOSS, LOSS_END
        block["hypothesis"]["surface"][:5] = 2, -1, 0, 2, 2
        block["hypothesis"]["llr_lo"][:5] = block["hypothesis"]["llr_hi"][:5] = values
    block = record["block"][0]
    block["hypothesis"]["kind"][:3], block["hypothesis"]["surface"][:3] = (
        (STEP_FAULT, LOSS, LOSS_END),
        (-1, 2, 2),
    )
    block["hypothesis"]["llr_lo"][:3] = block["hypothesis"]["llr_hi"][:3] = pitch
    return bool(Statistical.excludes(fdi, 2, keys.get("ends", False)))


def test_a_loss_is_excluded_by_what_explains_better_by_the_naming_level():
    assert not contested(loss=1.0, step=4.9)
    assert contested(loss=1.0, step=5.1)
    assert contested(loss=1.0, other=5.1)
    assert not contested(loss=1.0, other=9.0, other_excluded=1)
    assert not contested(loss=1.0, growing=0.0, ending=9.0, step=9.0)  # its end explains as much
    assert not contested(loss=1.0, step=5.1, growing=3.0)  # or a part that grows
    assert contested(loss=0.0, pitch=(5.0, 0.0, 0.0))
    assert not contested(loss=0.0, pitch=(3.9, 0.0, 0.0))
    assert not contested(loss=0.0, step=5.0, pitch=(0.0, 4.0, 0.0))


def test_a_loss_that_may_grow_keeps_a_part_and_a_constant_one_does_not():
    assert not contested(loss=5.1, step=20.0)
    assert contested(loss=4.9, step=20.0)
    assert contested(loss=15.9, step=20.0, abrupt=1)
    assert not contested(loss=16.1, step=20.0, abrupt=1)
    assert not contested(loss=5.1, step=20.0, abrupt=1, instants=4)


def test_in_pitch_an_end_counts_where_it_is_asked_for():
    """It is excluded by what explains better than that, too, by the naming level."""
    for pitch, ended in (((60.0, 0.0, 60.0), False), ((60.0, 0.0, 56.1), False), ((60.0, 0.0, 55.9), True)):
        assert contested(loss=0.0, pitch=pitch)
        assert contested(loss=0.0, pitch=pitch, ends=True) == ended


@pytest.mark.parametrize(
    ("at_least", "shown"),
    [
        ((9.0, 4.9, 0.0), False),  # of a step, a loss, one that grows
        ((0.9, 4.8, 0.0), False),
        ((0.9, 5.0, 0.0), True),
        ((0.9, 0.0, 5.0), True),
        ((5.0, 0.0, 9.1), True),
    ],
)
def test_a_loss_shows_where_it_explains_better_than_all_else_by_the_naming_level(at_least, shown):
    fdi, record = detector()
    fdi["layout"]["loss"] = -1, -1, 0, -1
    for b in range(3):
        record["block"][b]["n_h"] = 0
    block = record["block"][1]
    block["n_h"] = 3
    block["hypothesis"]["kind"][:3], block["hypothesis"]["surface"][:3] = (
        (STEP_FAULT, LOSS, GROWING_LOSS),
        (-1, 2, 2),
    )
    block["hypothesis"]["llr_lo"][:3] = at_least
    assert bool(Statistical.shows(fdi, 2)) == shown
    assert not Statistical.shows(fdi, 0)


def test_an_end_within_a_frame_of_several_instants_keeps_a_part():
    """Half of it shows in one frame, the rest in the next: a step in either explains half of the two."""
    assert not contested(loss=0.0, ending=50.0, step=100.0, instants=2)
    assert not contested(loss=0.0, pitch=(93.2, 14.9, 59.2), instants=2, ends=True)
    assert contested(loss=0.0, pitch=(93.2, 14.9, 59.2), ends=True)
    assert contested(loss=0.0, ending=24.0, step=100.0, instants=2)


@pytest.mark.parametrize("b", [0, 1])
def test_what_the_beliefs_leave_unexplained_is_followed_by_the_drift(b):
    _, record = detector()
    rng = np.random.default_rng(b)
    surprise, mean = rng.normal(size=3), rng.normal(size=3)
    (
        record["gust"]["output"]["acc_mean"],
        record["gust"]["output"]["acc"],
    ) = (
        mean,
        (0.1, 0.2, 0.3),
    )
    gains = rng.normal(size=(2, 2))
    record["block"]["K_d"], record["block"]["a"] = gains, 1.0
    Statistical.filter_known(record, surprise, DT)
    axes = [(1,), (0, 2)][b]
    left = DT * (surprise - mean)[list(axes)]
    drift = gains[: len(axes), : len(axes)] @ left
    assert record["block"][b]["x_known"][2 : 2 + len(axes)] == pytest.approx(drift)
    assert not record["block"][2]["x_known"].any()
    out = np.zeros(3)
    Statistical.unknown_acceleration(record, out)
    assert out[list(axes)] == pytest.approx(drift + np.array([0.1, 0.2, 0.3])[list(axes)])


def test_what_is_just_as_much_excludes_nothing():
    """Levels are what chance may reach, and a part that is left may be all of it."""
    assert not contested(loss=1.0, step=5.0)
    assert not contested(loss=5.0, step=20.0)
    assert not contested(loss=0.0, ending=25.0, step=100.0, instants=2)
    assert contested(loss=0.0, pitch=(200.0, 2.0, 199.0), abrupt=1)


def test_the_first_surface_signs_as_any_other():
    _, record = detector()
    hypothesis = record["block"][1]["hypothesis"]
    hypothesis["kind"][0], hypothesis["surface"][0] = LOSS, 0
    Statistical.signatures(record, np.arange(12.0).reshape(3, 4) + 1.0, 0.7)
    assert hypothesis["signature"][0].tolist() == [1.0, 9.0]


def test_of_equal_shares_the_first_says_the_axis():
    record = with_scores((0.0, 3.0, 0.0), (3.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    Statistical.score(record, 7.0)
    assert record["alarm"]["axis"] == 1


def test_a_loss_that_nothing_tries_does_not_show():
    fdi, record = detector()
    record["test"]["margin"] = 0.5
    for b in range(3):
        record["block"][b]["n_h"] = 0
    assert not Statistical.shows(fdi, 2)
