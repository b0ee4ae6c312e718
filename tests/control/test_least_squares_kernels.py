"""Constrained least squares against SciPy's, the optimality conditions, and the published hand-over."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from beaver_ftc.control import allocation, least_squares
from beaver_ftc.control.general_allocation import allocate_generally
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from law_records import new_control
from samples import samples


def problem_of(n, rng, side=None):
    problem = np.zeros(1, problem_dtype(n)).view(np.recarray)[0]
    problem["low"], problem["high"] = -rng.uniform(0.05, 0.6, n), rng.uniform(0.05, 0.6, n)
    problem["u_preferred"] = rng.uniform(-0.2, 0.2, n)
    problem["weight"] = 10.0 ** rng.uniform(-3, 0, n)
    problem["side"] = 0 if side is None else side
    return problem


def columns(n, rng, gone=0.2):
    B = rng.normal(0.0, [[4.0], [3.0], [1.5]], (3, n))
    return np.where(rng.random(n) < gone, 0.0, B)


def by_scipy(problem, B, demand):
    root = np.sqrt(problem["slack"] / problem["weight"])
    A = np.vstack([B, np.diag(root)])
    b = np.concatenate([demand, root * problem["u_preferred"]])
    limits = problem["low"], problem["high"]
    return lsq_linear(A, b, limits, method="bvls", tol=1e-14, max_iter=1000).x


def cost(problem, B, demand, u):
    lack = B @ u - demand
    away = (u - problem["u_preferred"]) ** 2 / problem["weight"]
    return float(lack @ lack + problem["slack"] * away.sum())


@settings(max_examples=samples(60), deadline=None)
@given(st.integers(3, 20), st.integers(0, 2**32 - 1), st.sampled_from([0.3, 3.0, 30.0]))
def test_it_is_the_minimum_that_scipy_finds(n, seed, size):
    rng = np.random.default_rng(seed)
    problem, B, demand = problem_of(n, rng, rng.integers(-1, 2, n)), columns(n, rng), rng.normal(0, size, 3)
    least_squares.solve(problem, B, demand)
    other = by_scipy(problem, B, demand)
    ours, theirs = cost(problem, B, demand, problem["u"]), cost(problem, B, demand, other)
    assert ours <= theirs * (1.0 + 1e-6) + 1e-9
    assert B @ problem["u"] == pytest.approx(B @ other, abs=1e-4)
    assert np.all((problem["low"] <= problem["u"]) & (problem["u"] <= problem["high"]))


# Aileron, elevator, rudder, flap: rad/s2 per rad at 45 m/s, elevator and flap in pitch alone, as a Beaver's.
G = np.array([[-6.6, 0.0, 0.5, 0.0], [0.0, -10.9, 0.0, 2.3], [-0.2, 0.0, -2.6, 0.0]])
TRIM, LOWEST, HIGHEST = [0.01, -0.05, 0.02, 0.0], [-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]


def beaver_law(left=1.0):
    control = new_control(main=(0, 1, 2), stand_in=3, least_effectiveness=0.1)
    layout = control["layout"]
    layout["trim"], layout["low"], layout["high"] = TRIM, LOWEST, HIGHEST
    control["surfaces"]["output"]["effectiveness"] = (1.0, left, 1.0, 1.0)
    control["axes"]["G"] = G * control["surfaces"]["output"]["effectiveness"]
    prediction = np.zeros(1, prediction_dtype(4)).view(np.recarray)[0]
    prediction["w"], prediction["actuators"]["step"] = 1.0, np.inf
    return control, prediction


def published(demand, left, share, probe=0.0):
    control, _ = beaver_law(left)
    allocated, control["axes"]["demand"] = control["allocation"]["output"], demand
    effectiveness = control["surfaces"]["output"]["effectiveness"]
    allocation.allocate(control["axes"], allocated, control["layout"], effectiveness, share, probe)
    return allocated["command"].copy()


def generally(demand, left, share, at=None, step=np.inf):
    control, prediction = beaver_law(left)
    control["axes"]["demand"], prediction["actuators"]["step"] = demand, step
    prediction["u"] = TRIM if at is None else at
    effectiveness = control["surfaces"]["output"]["effectiveness"]
    parts = control["axes"], control["allocation"], control["layout"], effectiveness
    allocate_generally(*parts, prediction, share, 0.0)
    return control["allocation"]["output"]


@settings(max_examples=samples(60), deadline=None)
@given(
    st.tuples(st.floats(-0.5, 0.5), st.floats(0.3, 0.7), st.floats(-0.2, 0.2)),
    st.floats(0.3, 1.0),
    st.floats(0.0, 1.0),
)
def test_the_published_hand_over_is_one_instance(demand, left, share):
    """Elevator and flap as the published lines have them; up to what a stand-in is never unwilling to do."""
    expected, found = published(demand, left, share), generally(demand, left, share)["command"]
    assert found == pytest.approx(expected, abs=1e-3)
    if 1e-3 < share < 1.0 - 1e-3:
        assert found == pytest.approx(expected, abs=1e-6)


def test_no_surface_goes_further_than_its_rate_lets_it():
    at, step = np.array([0.1, 0.0, -0.1, 0.0]), np.array([0.01, 0.02, 0.01, 0.005])
    found = generally([3.0, 3.0, 1.0], 1.0, 0.0, at=at, step=step)
    assert np.all(np.abs(found["command"] - at) <= step + 1e-12)
    assert found["saturated"].tolist() == [0, 0, 0, 0]
