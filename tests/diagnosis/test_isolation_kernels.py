"""The isolation estimators one kernel at a time: their identity, least squares, who excludes a fault."""

import numpy as np
import pytest
from kernels import DT, estimator, new_fdi, on

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
