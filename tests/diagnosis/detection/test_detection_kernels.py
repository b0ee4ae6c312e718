"""Detection estimator, network and prediction, a kernel at a time: sums over instants and frames by NumPy."""

import numpy as np
import pytest
from kernels import DT, fill, new_fdi, on

from beaver_ftc.diagnosis.detection import filters as detection_filters
from beaver_ftc.diagnosis.detection.filters import (
    ALPHA_CENTRES_RAD,
    BETA_CENTRES_RAD,
    FDAE_NETWORK_RECORD,
    N_BASIS,
)
from beaver_ftc.diagnosis.state import EITHER_DETECTOR, STATISTICAL_DETECTOR, WORST_CASE_DETECTOR


def new_network(**fields):
    return fill(np.zeros(1, FDAE_NETWORK_RECORD).view(np.recarray)[0], **fields)


@pytest.mark.parametrize("alpha", [-0.3, -0.1, 0.0, 0.13, 0.5, 0.9])
@pytest.mark.parametrize("beta", [-0.5, 0.07, 0.3, 0.4])
def test_the_basis_is_that_of_gaussians_as_wide_as_their_spacing(alpha, beta):
    out = np.zeros(N_BASIS)
    detection_filters.fill_basis(alpha, beta, out)
    parts = []
    for place, centres in ((alpha, ALPHA_CENTRES_RAD), (beta, BETA_CENTRES_RAD)):
        inside = np.clip(place, centres[0], centres[-1])
        parts.append(np.exp(-0.5 * ((inside - centres) / (centres[1] - centres[0])) ** 2))
    both = np.concatenate(parts)
    assert out == pytest.approx(both / np.linalg.norm(both), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("residual", "left"), [(0.5, 0.2), (0.3, 0.0), (-0.3, 0.0), (-0.5, -0.2), (0.1, 0.0)]
)
def test_the_dead_zone_leaves_the_excess(residual, left):
    assert detection_filters.beyond_bound(residual, 0.3) == pytest.approx(left)


@pytest.mark.parametrize("leaking", [False, True])
def test_weights_learn_what_exceeds_the_threshold_and_leak(leaking):
    rng = np.random.default_rng(2)
    before = 0.1 * rng.normal(size=(3, N_BASIS))
    record = new_network(
        gain=30.0,
        leak=2.0,
        w_max=9.0,
        weights=before,
        Phi=rng.uniform(0, 1, N_BASIS),
    )
    detection_filters.train_network(record, np.array([0.5, -0.4, 0.1]), np.full(3, 0.2), leaking, DT)
    kept = np.exp(-2.0 * DT) if leaking else 1.0
    learnt = DT * 30.0 * np.outer([0.3, -0.2, 0.0], record["memory"]["Phi"])
    assert record["memory"]["weights"] == pytest.approx(kept * before + learnt)
    record["config"]["w_max"] = 0.05
    detection_filters.train_network(record, np.array([0.5, -0.4, 0.1]), np.full(3, 0.2), leaking, DT)
    assert np.abs(record["memory"]["weights"]).max() == 0.05
    assert record["memory"]["weights"].min() == -0.05


@pytest.mark.parametrize(
    ("authority", "filters", "score", "axis"),
    [
        (WORST_CASE_DETECTOR, 1.1, 9.0, 2), (WORST_CASE_DETECTOR, 0.9, 9.0, None),
        (STATISTICAL_DETECTOR, 9.0, 1.1, 0),
        (STATISTICAL_DETECTOR, 9.0, 0.9, None), (STATISTICAL_DETECTOR, 9.0, 1.0, None),
        (EITHER_DETECTOR, 1.1, 9.0, 2),
        (EITHER_DETECTOR, 0.9, 1.1, 0), (EITHER_DETECTOR, 0.9, 0.9, None),
    ],
)  # fmt: skip
def test_who_is_in_authority_raises_the_alarm(authority, filters, score, axis):
    fdi = new_fdi()
    fdi["config"]["authority"] = authority
    fdi["bank"]["output"]["threshold"][:3], fdi["bank"]["output"]["residual"][1, 2] = 0.1, 0.1 * filters
    (
        fdi["statistical"]["alarm"]["ratio"],
        fdi["statistical"]["alarm"]["axis"],
        fdi["fdae"]["memory"]["xhat"],
    ) = (
        score,
        0,
        (1.0, 1.0, 1.0),
    )
    detection_filters.fdae_residual(fdi["fdae"], np.array([1.5, 0.5, 1.0]))
    assert fdi["fdae"]["output"]["residual"] == pytest.approx([0.5, -0.5, 0.0])
    assert on(detection_filters.alarm_axis, fdi, authority) == (-1 if axis is None else axis)


def instants(count, seed=5):
    """(f, G, u, eta_bar, per_rad) of so many instants."""
    rng = np.random.default_rng(seed)
    sizes = (3,), (3, 4), (4,), (3,), (3, 4)
    return [tuple(rng.normal(size=size) for size in sizes) for _ in range(count)]
