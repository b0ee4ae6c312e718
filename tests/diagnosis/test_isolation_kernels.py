"""The isolation estimators one kernel at a time: their identity, least squares, who excludes a fault."""

import numpy as np
import pytest
from kernels import DT, estimator, new_fdi, on, put

from beaver_ftc.diagnosis import conclusion, isolation
from beaver_ftc.diagnosis.detection.likelihood import STEP_FAULT
from beaver_ftc.diagnosis.schemes import adaptive_estimators
from beaver_ftc.diagnosis.state import (
    INTERVAL_THRESHOLD,
    LOSS,
    NOT_ISOLATED,
    POSITION_HYPOTHESIS,
    PUBLISHED_THRESHOLD,
    UNANTICIPATED,
)
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.scenario.diagnosis import FdiConfig

EITHER = 0


def run_estimator(shared, theta, kind=LOSS, frames=25, eta_share=1.0, seed=0):
    """An estimator beside a plant with this fault: (fdi, fie, what was fed in)."""
    rng, fdi = np.random.default_rng(seed), new_fdi()
    fie = estimator(fdi, kind, low=-1.0, high=0.6)
    fdi["isolation"]["config"]["shared"], x = shared, rng.normal(size=3)
    fdi["bound"]["n_gyro"] = 0.004, 0.005, 0.006
    on(isolation.start_estimators, fdi, x)
    fed = {name: [] for name in ("Z", "eta", "eta_bar", "noise_before", "spread")}
    for _ in range(frames):
        Z, eta_bar, noise_before = rng.normal(size=3), rng.uniform(0.1, 0.3, 3), rng.uniform(0.01, 0.02, 3)
        eta, believed, spread = eta_bar * rng.uniform(-1, 1, 3), rng.normal(size=3), rng.uniform(0, 0.1, 3)
        eta *= eta_share
        offset = rng.normal(size=3)
        fie["effect"]["regressor"] = Z
        fie["effect"]["base"] = offset
        fie["effect"]["e"] = spread
        fdi["bound"]["eta_bar"], fdi["bound"]["n_old"] = eta_bar, noise_before
        isolation.update_residual(fie, fdi["isolation"]["config"]["mu_kind"], x)
        on(isolation.advance_estimators, fdi, x, believed)
        x = x + DT * (believed + offset + theta * Z + eta)
        for name, value in zip(fed, (Z, eta, eta_bar, noise_before, spread), strict=True):
            fed[name].append(value)
    within = isolation.update_residual(fie, fdi["isolation"]["config"]["mu_kind"], x)
    return fdi, fie, {name: np.array(value) for name, value in fed.items()}, within


@pytest.mark.parametrize("shared", [False, True])
def test_the_residual_is_omega_times_the_error_and_the_filtered_uncertainty(shared):
    """Whatever the estimate does [Zhang2005, sec. IV]; and every filter is the convolution it stands for."""
    theta, frames = -0.45, 25
    fdi, fie, fed, within = run_estimator(shared, theta, frames=frames)
    w = fdi["isolation"]["config"]["a"] ** np.arange(frames)[::-1, None]
    omega = DT * (w * fed["Z"]).sum(axis=0)
    uncertainty = DT * (w * fed["eta"]).sum(axis=0)
    assert fie["Om"] == pytest.approx(omega)
    assert fie["residual"] == pytest.approx(omega * (theta - fie["theta"]) + uncertainty, abs=1e-12)
    assert fie["Om_pos"] == pytest.approx(DT * (w * np.maximum(fed["Z"], 0)).sum(axis=0))
    assert fie["Om_neg"] == pytest.approx(DT * (w * np.minimum(fed["Z"], 0)).sum(axis=0))
    eta = DT * (w * (fed["eta_bar"] + fed["spread"])).sum(axis=0)
    left = fdi["isolation"]["config"]["a"] ** frames * np.array([0.004, 0.005, 0.006])
    noise = left + ((1.0 - fdi["isolation"]["config"]["a"]) * w * fed["noise_before"]).sum(axis=0)
    assert fie["e_lag"] == pytest.approx(eta + noise)
    assert fie["e"] == pytest.approx(eta + noise + [0.004, 0.005, 0.006])
    assert within


@pytest.mark.parametrize("shared", [False, True])
def test_an_estimate_finds_theta_and_stays_in_its_set(shared):
    _, fie, *_ = run_estimator(shared, -0.45, frames=120, eta_share=0.0)
    assert fie["theta"] == pytest.approx([-0.45] * 3, abs=0.03)
    _, fie, *_ = run_estimator(shared, -1.4, frames=60, eta_share=0.0)
    assert fie["theta"] == pytest.approx([-1.0] * 3)
    _, fie, *_ = run_estimator(shared, 0.9, frames=60, eta_share=0.0)
    assert fie["theta"] == pytest.approx([0.6] * 3)


def test_a_start_knows_nothing_but_the_set_of_theta():
    fdi = new_fdi()
    fie = estimator(fdi, low=-0.4, high=0.8)
    fie["set_lo"] = fie["set_hi"] = 0.3
    fdi["bound"]["n_gyro"] = 0.1, 0.2, 0.3
    on(isolation.start_estimators, fdi, np.array([1.0, 2.0, 3.0]))
    assert fie["xhat"] == pytest.approx([1.0, 2.0, 3.0])
    assert fie["e_lag"] == pytest.approx([0.1, 0.2, 0.3])
    assert fie["P"] == pytest.approx([1.2**2 / 12.0] * 3)  # of a uniform distribution
    assert (fie["set_lo"] == -0.4).all()
    assert (fie["set_hi"] == 0.8).all()


def test_a_shared_theta_is_corrected_axis_by_axis_with_what_is_left():
    """As one weighted least-squares problem of three equations, forgetting once."""
    fie = estimator(new_fdi())
    omega, noise = np.array([0.5, -0.8, 0.3]), np.array([0.2, 0.3, 0.4])
    residual = np.array([0.02, 0.03, -0.01])
    fie["Om"] = omega
    fie["e"] = noise
    fie["residual"] = residual
    fie["effect"]["regressor"] = 1.0
    fie["theta"], fie["P"] = -0.5, 0.06
    total = isolation.joint_least_squares(fie, 1.0)
    information = 1.0 / 0.06 + np.sum(omega**2 / noise**2)
    assert total == pytest.approx(np.sum(omega * residual / noise**2) / information)
    assert fie["theta"] == pytest.approx([-0.5 + total] * 3)
    assert fie["P"] == pytest.approx([1.0 / information] * 3)
    fie["effect"]["regressor"] = 0.0
    assert isolation.joint_least_squares(fie, 0.5) == 0.0


@pytest.mark.parametrize("thresholds", [INTERVAL_THRESHOLD, PUBLISHED_THRESHOLD])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_residual_at_its_limit_is_within_and_beyond_it_is_not(thresholds, axis, side):
    def within(beyond, ignored_axes=False):
        fdi = new_fdi()
        fie = estimator(fdi, low=-0.9, high=0.2)
        fdi["isolation"]["config"]["mu_kind"] = thresholds
        fie["Om_pos"] = 0.5
        fie["Om_neg"] = -0.2
        fie["e"] = 0.03
        fie["theta"] = -0.3
        fie["Om"], fie["skip"][axis] = 0.3, ignored_axes
        lower, upper = -0.9 * 0.5 - 0.2 * 0.2, 0.2 * 0.5 + 0.9 * 0.2
        limits = (lower + 0.09 - 0.03, upper + 0.09 + 0.03)
        if thresholds == PUBLISHED_THRESHOLD:
            limits = (-0.6 * 0.3 - 0.03, 0.6 * 0.3 + 0.03)
        x = np.zeros(3)
        x[axis] = limits[side > 0] + side * beyond
        return bool(isolation.update_residual(fie, fdi["isolation"]["config"]["mu_kind"], x))

    assert within(-1e-12)
    assert not within(1e-9)
    assert within(1e-9, ignored_axes=True)


def excludes(fdi, row, x=0.0):
    """Whether a row of the fault classes excludes the first fault of a diagnosis, at rates of x rad/s."""
    measured = np.zeros(1, MEASURED).view(np.recarray)[0]
    measured["x"], estimator(fdi)["excluded"] = x, 0
    adaptive_estimators.ISOLATION_VARIANTS[row].isolate(fdi, measured, 1.0, False)
    return bool(estimator(fdi)["excluded"])


@pytest.mark.parametrize(
    ("row", "x", "excluded"),
    [
        (("published", "worst-case"), 0.0, False), (("published", "worst-case"), 1.0, True),
        (("all", "either"), 1.0, True), (("all", "either"), 0.0, False), (("all", "worst-case"), 1.0, True),
        (("published", "either"), 1.0, True), (("published", "either"), 0.0, False),
        (("published", "statistical"), 1.0, False),
    ],
)  # fmt: skip
def test_who_excludes_a_fault_beyond_its_worst_case(row, x, excluded):
    fdi = new_fdi()
    fdi["isolation"]["config"]["n_estimators"], fdi["statistical"]["alarm"]["detected_at_s"] = 1, -1.0
    fdi["layout"]["position"], fdi["layout"]["loss"] = range(4), range(4)
    assert excludes(fdi, row, x) == excluded


@pytest.mark.parametrize(
    ("excluded", "isolated"),
    [
        ((0, 0, 0), NOT_ISOLATED), ((1, 0, 0), NOT_ISOLATED), ((1, 0, 1), 1), ((0, 1, 1), 0),
        ((1, 1, 1), UNANTICIPATED),
    ],
)  # fmt: skip
def test_the_one_left_is_the_fault(excluded, isolated):
    fdi = new_fdi()
    fdi["isolation"]["config"]["n_estimators"], fdi["isolation"]["estimator"]["excluded"][:3] = 3, excluded
    fdi["verdict"]["isolated_estimator"], fdi["verdict"]["isolated_at_s"] = NOT_ISOLATED, -1.0
    assert on(isolation.decide_isolation, fdi, 4.0) == isolated
    for t in (4.0, 5.0):
        on(conclusion.set_isolated, fdi, isolated, t)
        assert fdi["verdict"]["isolated_estimator"] == isolated
        assert fdi["verdict"]["isolated_at_s"] == (-1.0 if isolated == NOT_ISOLATED else 4.0)


@pytest.mark.parametrize(("doubted", "shown", "named"), [(1, 0, False), (1, 1, True), (0, 0, True)])
def test_one_that_is_left_for_an_end_that_nobody_saw_begin_is_not_named(doubted, shown, named):
    fdi = new_fdi()
    fdi["isolation"]["config"]["n_estimators"], fdi["isolation"]["estimator"]["excluded"][:3] = 3, (1, 0, 1)
    fdi["isolation"]["estimator"]["weak"][1] = doubted
    fdi["isolation"]["estimator"]["confirmed"][1] = shown
    assert on(isolation.decide_isolation, fdi, 4.0) == (1 if named else NOT_ISOLATED)
    fdi["isolation"]["estimator"]["excluded"][1] = 1
    assert on(isolation.decide_isolation, fdi, 5.0) == UNANTICIPATED


@pytest.mark.parametrize("memory", [False, True])
def test_what_is_supposed_of_a_frame(memory):
    rng, fdi = np.random.default_rng(4), new_fdi()
    estimator(fdi, surface=2)
    G, Gu, spread = rng.normal(size=(3, 3, 4))
    fdi["isolation"]["config"]["reach"], fdi["verdict"]["detected"] = memory, 0
    on(isolation.update_effects, fdi, G, Gu, np.abs(spread))
    fie = fdi["isolation"]["estimator"][0]
    assert fie["reach_lo"][:3, :3].any() == memory
    assert fie["effect"]["regressor"].any() == memory
    fdi["verdict"]["detected"] = 1
    on(isolation.update_effects, fdi, G, Gu, np.abs(spread))
    assert fie["effect"]["regressor"] == pytest.approx(Gu[:, 2])
    assert fie["effect"]["e"] == pytest.approx(np.abs(spread[:, 2]))


NAMING = 5.0


def told(fdi, loss, step):
    """A detector for which a loss of surface 0 explains so much, and a step, by log likelihood ratios."""
    record = fdi["statistical"]
    record["test"]["enabled"], record["test"]["margin"] = 1, NAMING
    for block in record["block"][1:]:
        block["n_h"] = 2
        hypotheses = block["hypothesis"][:2]
        hypotheses["kind"], hypotheses["surface"] = (LOSS, STEP_FAULT), (0, -1)
        hypotheses["llr_lo"] = hypotheses["llr_hi"] = loss, step
    fdi["isolation"]["config"]["n_estimators"], record["test"]["w"] = 1, 1.0
    return estimator(fdi)


EITHER_OR_STATISTICS = (("published", "either"), ("published", "statistical"))


@pytest.mark.parametrize("row", EITHER_OR_STATISTICS)
@pytest.mark.parametrize(("step", "excluded"), [(NAMING + 0.1, True), (NAMING - 0.1, False)])
def test_statistics_exclude_what_something_else_explains_better(row, step, excluded):
    fdi = new_fdi()
    told(fdi, 0.0, step)
    assert excludes(fdi, row) == excluded
    assert not excludes(fdi, ("published", "worst-case"))


@pytest.mark.parametrize(("detected_at_s", "excluded"), [(-1.0, False), (0.0, True), (2.5, True)])
@pytest.mark.parametrize("row", EITHER_OR_STATISTICS)
def test_statistics_that_have_raised_no_alarm_exclude_nothing(row, detected_at_s, excluded):
    fdi = new_fdi()
    told(fdi, 0.0, NAMING + 0.1)
    fdi["statistical"]["alarm"]["detected_at_s"] = detected_at_s
    assert excludes(fdi, row) == excluded


@pytest.mark.parametrize("abrupt", [0, 1])
def test_a_loss_that_has_shown_is_not_excluded_by_what_comes_later(abrupt):
    """That may be its end; one that is declared to stay has none."""
    fdi = new_fdi()
    fie, fdi["config"]["abrupt"] = told(fdi, 20.0, 0.0), abrupt
    assert not excludes(fdi, ("published", "either"))
    assert fie["confirmed"] == (not abrupt)
    told(fdi, 0.0, 90.0)
    assert excludes(fdi, ("published", "either")) == bool(abrupt)


def doubtful(kind=LOSS, **switches):
    """An estimator within its limits, whose frame no theta of its set explains, and no more the bank."""
    fdi = new_fdi()
    fie = estimator(fdi, kind)
    fie["e"], fie["effect"]["regressor"] = 1.0, (1.0, 0.0, 0.0)
    fdi["bank"]["output"]["innovation"], fdi["bound"]["nu_max"] = (9.0, 0.0, 0.0), 1.0
    fdi["bank"]["output"]["residual"], fdi["bank"]["output"]["threshold"] = 9.0, 1.0
    put(fdi, **switches)
    return fdi, fie


@pytest.mark.parametrize(
    ("kind", "switches", "started", "possible"),
    [
        (LOSS, {}, True, True), (LOSS, {"memory": 1}, False, False), (LOSS, {"shared": 1}, True, False),
        (LOSS, {"shared": 1}, False, True), (POSITION_HYPOTHESIS, {}, True, False),
        (POSITION_HYPOTHESIS, {}, False, True),
        (LOSS, {"membership": 1, "abrupt": 1}, True, False), (LOSS, {"membership": 1}, True, True),
        (LOSS, {"abrupt": 1}, True, True), (LOSS, {"membership": 1, "abrupt": 1}, False, True),
    ],
)  # fmt: skip
def test_each_test_that_is_switched_on_can_exclude(kind, switches, started, possible):
    fdi, fie = doubtful(kind, **switches)
    assert on(isolation.fault_possible, fdi, fie, np.zeros(3), started) == possible
    assert not on(isolation.fault_possible, fdi, fie, np.full(3, 9.0), started), (
        "beyond its limits it is excluded"
    )


def test_a_position_is_asked_in_the_first_frame_where_the_past_is_kept():
    fdi, fie = doubtful(POSITION_HYPOTHESIS, memory=1)
    fdi["bank"]["output"]["residual"] = 0.0
    assert not on(isolation.fault_possible, fdi, fie, np.zeros(3), False)
    fdi["bank"]["output"]["innovation"] = 0.0
    assert on(isolation.fault_possible, fdi, fie, np.zeros(3), False)


def test_what_is_learned_of_a_constant_loss_is_kept_of_no_position():
    fdi, fie = doubtful(POSITION_HYPOTHESIS, membership=1, abrupt=1)
    fdi["bank"]["output"]["innovation"] = 0.0
    on(isolation.fault_possible, fdi, fie, np.zeros(3), True)
    assert fie["set_lo"].tolist() == [-1.0] * 3


@pytest.mark.parametrize(
    ("kind", "errors", "wider"),
    [(POSITION_HYPOTHESIS, 1, True), (POSITION_HYPOTHESIS, 0, False), (LOSS, 1, False)],
)
def test_errors_of_a_surfaces_own_terms_widen_the_room_of_its_position(kind, errors, wider):
    rng, fdi = np.random.default_rng(6), new_fdi()
    fie = estimator(fdi, kind, surface=2, low=-0.5, high=0.5)
    G, Gu = rng.normal(size=(2, 3, 4))
    fdi["bound"]["has_eG"] = errors
    fdi["bound"]["eG"] = 0.3
    fdi["bound"]["nu_max"] = 1.0
    fdi["config"]["n_substeps"] = 1
    on(isolation.update_effect, fdi, fie, G, Gu, np.full((3, 4), 0.1))
    assert (fie["effect"]["e"] > 0.1).tolist() == [wider] * 3


def test_every_type_starts_with_no_knowledge_of_any_surface():
    for (fault_class, _), row in adaptive_estimators.ISOLATION_VARIANTS.items():
        fdi = new_fdi()
        fdi["types"]["surface"]["evidence"]["n_anomalous"] = 7
        row.begin_at_alarm(fdi)
        assert fdi["types"]["surface"]["evidence"]["n_anomalous"].tolist() == [7 * (fault_class != "all")] * 4


def test_the_row_of_a_fault_class_follows_from_the_detectors_in_authority():
    """Without the statistical detector the worst case alone excludes; of types it always does."""
    rows = list(adaptive_estimators.ISOLATION_VARIANTS)
    for of, statistical, authority, row in (
        ("published", None, "either", ("published", "worst-case")),
        ("published", {}, "either", ("published", "either")),
        ("published", {}, "worst-case", ("published", "worst-case")),
        ("published", {}, "statistical", ("published", "statistical")),
        ("all", None, "either", ("all", "worst-case")),
        ("all", {}, "statistical", ("all", "either")),
        ("all", {}, "worst-case", ("all", "worst-case")),
    ):
        config = FdiConfig(fault_class=of, statistical=statistical, authority=authority)
        assert rows[adaptive_estimators.variant_row(config)] == row
    assert rows[adaptive_estimators.PUBLISHED_VARIANT] == ("published", "worst-case")


@pytest.mark.parametrize(
    ("length", "started", "memory", "frame", "filled"),
    [(1, True, 0, 1, 0), (1, False, 1, 1, 0), (1, False, 0, 0, 0), (3, True, 0, 0, 1), (3, False, 0, 0, 0)],
)
def test_a_frame_is_shown_to_every_type_alone_or_in_its_block(length, started, memory, frame, filled):
    fdi = new_fdi()
    fdi["isolation"]["config"]["reach"] = memory
    fdi["types"]["config"]["frames_per_block"], fdi["types"]["config"]["block_duration_s"] = length, 0.1
    fdi["layout"]["position"], fdi["layout"]["loss"] = range(4), range(4)
    fdi["layout"]["dominant_axis"] = (0, 1, 2, 1)
    fdi["isolation"]["config"]["n_estimators"] = 4
    fdi["types"]["config"]["half_frames"] = 9
    fdi["config"]["n_substeps"] = 1
    fdi["types"]["config"]["single_instant"] = 1
    for s, fie in enumerate(fdi["isolation"]["estimator"][:4]):
        fie["hypothesis_kind"] = POSITION_HYPOTHESIS
        fie["surface"] = s
        fie["theta_min"] = -1.0
        fie["theta_max"] = 1.0
        fie["effect"]["regressor"] = np.eye(3)[(0, 1, 2, 1)[s]]
    measured = np.zeros(1, MEASURED).view(np.recarray)[0]
    adaptive_estimators.ISOLATION_VARIANTS["all", "worst-case"].isolate(fdi, measured, 1.0, started)
    assert (fdi["types"]["frame_index"], fdi["types"]["block"]["n_so_far"]) == (frame, filled)


def test_the_axes_of_a_shared_theta_agree_after_each_step():
    fie = estimator(new_fdi())
    fie["Om"] = (0.5, -0.8, 0.3)
    fie["e"] = 0.2
    fie["residual"] = (0.02, 0.03, -0.01)
    fie["theta"] = (-0.5, -0.9, -0.1)
    fie["P"] = (0.06, 0.01, 0.09)
    fie["effect"]["regressor"] = 1.0
    isolation.joint_least_squares(fie, 1.0)
    assert len(set(fie["theta"])) == len(set(fie["P"])) == 1
    alone = estimator(new_fdi())
    alone["Om"], alone["e"], alone["residual"] = (
        fie["Om"],
        0.2,
        fie["residual"],
    )
    alone["theta"], alone["P"], alone["effect"]["regressor"] = -0.5, 0.06, 1.0
    isolation.joint_least_squares(alone, 1.0)
    assert alone["theta"].tolist() == fie["theta"].tolist(), "that of the first axis counts"
