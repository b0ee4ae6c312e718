"""Detection estimator, network and prediction, a kernel at a time: sums over instants and frames by NumPy."""

import numpy as np
import pytest
from kernels import DT, fill, new_fdi, on

from beaver_ftc.diagnosis import model_prediction
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


def new_prediction(share):
    record = np.zeros(1, model_prediction.prediction_dtype(4)).view(np.recarray)[0]
    record["w"] = share
    return record


def instants(count, seed=5):
    """(f, G, u, eta_bar, per_rad) of so many instants."""
    rng = np.random.default_rng(seed)
    sizes = (3,), (3, 4), (4,), (3,), (3, 4)
    return [tuple(rng.normal(size=size) for size in sizes) for _ in range(count)]


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("has_eG", [0, 1])
def test_means_over_a_frame_are_of_its_instants(count, has_eG):
    fdi, record = new_fdi(), new_prediction(1.0 / count)
    fdi["bound"]["has_eG"], fdi["config"]["diagnoses_all_types"] = (
        has_eG,
        1,
    )
    fdi["layout"]["dominant_axis"] = 0, 1, 2, 1
    record["sums"]["F"] = record["sums"]["G"] = record["sums"]["Gu"] = 99.0  # of an earlier frame
    record["sums"]["eta_bar"] = 99.0
    (
        record["sums"]["eGu"],
        record["sums"]["eG"],
    ) = (99.0, 99.0) if has_eG else (0.0, 0.0)
    fdi["bound"]["n_gyro"] = 0.1, 0.2, 0.3
    measured = np.zeros(1, [("x", "f8", (3,))]).view(np.recarray)[0]
    measured["x"] = 1.0, 2.0, 3.0
    seen = instants(count)
    for k, (f, G, u, eta_bar, per_rad) in enumerate(seen):
        record["f"], record["G"], record["u"] = f, G, u
        fdi["bound"]["eta_now"], fdi["bound"]["declared_errors"]["eG"] = (
            eta_bar,
            np.abs(per_rad),
        )
        if k == 0:
            model_prediction.begin_sums(
                record, fdi["bound"], fdi["layout"], fdi["config"]["diagnoses_all_types"], measured
            )
        else:
            model_prediction.add_to_sums(
                record, fdi["bound"], fdi["layout"], fdi["config"]["diagnoses_all_types"]
            )
    model_prediction.fill_means(record, fdi["bound"])
    Gu = np.array([G * u for _, G, u, _, _ in seen])
    mean = record["means"]
    assert record["x_before"] == pytest.approx([1.0, 2.0, 3.0])
    assert fdi["bound"]["n_old"] == pytest.approx([0.1, 0.2, 0.3])
    assert mean["G"] == pytest.approx(np.mean([G for _, G, *_ in seen], axis=0))
    assert mean["Gu"] == pytest.approx(Gu.mean(axis=0))
    assert mean["F"] == pytest.approx(np.mean([f + G @ u for f, G, u, *_ in seen], axis=0))
    assert fdi["bound"]["eta_bar"] == pytest.approx(np.mean([eta for *_, eta, _ in seen], axis=0))
    own = np.mean([np.abs(per_rad) for *_, per_rad in seen], axis=0)
    at_command = np.mean([np.abs(per_rad * u) for _, _, u, _, per_rad in seen], axis=0)
    assert fdi["bound"]["eG"] == pytest.approx(own if has_eG else 0.0)
    assert fdi["bound"]["eGu"] == pytest.approx(at_command if has_eG else 0.0)
    spread = np.abs(Gu[0] - Gu[1:].mean(axis=0)) / count if count > 1 else 0.0
    assert mean["e_Gu"] == pytest.approx(spread)
    own_axis = np.array([G[(0, 1, 2, 1), range(4)] for _, G, *_ in seen])
    assert mean["G_min"] == pytest.approx(own_axis.min(axis=0))
    assert mean["G_max"] == pytest.approx(own_axis.max(axis=0))
    deflections = np.array([u for _, _, u, *_ in seen])
    assert mean["u_min"] == pytest.approx(deflections.min(axis=0))
    assert mean["u_max"] == pytest.approx(deflections.max(axis=0))
