"""The isolation estimators one kernel at a time: their identity, least squares, who excludes a fault."""

import numpy as np
import pytest
from kernels import estimator, new_fdi, on

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
