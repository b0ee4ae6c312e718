"""Regressors and least squares, by closed forms and by another road."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs import regression
from products.logs import small

WING, TAIL = small.model(), small.model(small.TAIL)


@pytest.mark.parametrize(("off", "together"), [(0.9e-5, True), (4e-5, False)])
def test_surfaces_whose_commands_are_proportional_are_one_group(off, together):
    """To an angle whose square is 1e-9; whatever the size and the sign."""
    table = {
        "a": {"roll": 1.0},
        "b": {"pitch": 2.0},
        "c": {"roll": -3.0, "pitch": 3.0 * off},
        "d": {"pitch": 0.1},
    }
    vehicle = small.vehicle(small.WING, surfaces=table, labels={})
    assert regression.group_surfaces(vehicle) == ([[0, 2], [1, 3]] if together else [[0], [1, 3], [2]])


@pytest.mark.parametrize("history", [1, 2, 4])
@pytest.mark.parametrize("lags", [1, 3])
def test_what_a_sample_is_predicted_from(history, lags):
    samples = small.flight(TAIL, 30, gap=12)
    samples.rates[20, 1] = samples.commands[25, 1] = samples.signals[5, 0] = np.nan
    past, commands, known = regression.build_regressors(samples, [[0, 2], [1]], history, lags, labelled=False)
    reach = max(history, lags)
    for k in range(30):
        whole = k >= reach and samples.stretch_number[k - reach] == samples.stretch_number[k]
        whole &= all(k - j != 20 for j in range(history + 1)) and all(k - j != 25 for j in range(1, lags + 1))
        whole &= k != 6
        assert known[k] == whole
        if not whole:
            continue
        rates = [samples.rates[k - j] for j in range(1, history + 1)]
        np.testing.assert_array_equal(past[k], np.concatenate([*rates, samples.signals[k - 1]]))
        for j in range(lags):
            u = samples.commands[k - 1 - j]
            assert commands[k, :, j].tolist() == [u[0] + u[2], u[1]]


def test_commands_as_effective_as_the_labels_say():
    samples = small.flight(WING, 12)
    samples.labels[:] = [0.5, np.nan]
    by_label = regression.build_regressors(samples, [[0], [1]], 1, 2, labelled=True)[1]
    plain = regression.build_regressors(samples, [[0], [1]], 1, 2, labelled=False)[1]
    np.testing.assert_array_equal(by_label[2:], plain[2:] * np.array([[0.5], [1.0]]))


def test_a_flight_shorter_than_the_past():
    known = regression.build_regressors(small.flight(WING, 2), [[0], [1]], 4, 3, labelled=False)[2]
    assert known.tolist() == [False, False]
    assert regression._delay_rows(np.arange(3.0), 2, -1.0).tolist() == [-1.0, -1.0, 0.0]
    assert regression._delay_rows(np.arange(3), 5, -1).tolist() == [-1, -1, -1]


def test_columns_of_groups_become_those_of_surfaces():
    values = np.array([[0.2, 0.4], [0.6, 0.8]])
    assert regression.group_indices(TAIL) == [[0, 2], [1]]
    assert regression.expand_groups(values, TAIL).tolist() == [
        [0.2, 0.4, 0.2],
        [0.6, 0.8, 0.6],
    ]
    apart = TAIL.model_copy(update={"groups": [["elevator"]]})
    assert regression.expand_groups(values[:, :1], apart).tolist() == [
        [1.0, 0.2, 1.0],
        [1.0, 0.6, 1.0],
    ]


def drawn(n=40, m=4, seed=1):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, m)) * [1.0, 10.0, 0.1, 2.0][:m]
    y = x @ rng.standard_normal((m, 3)) + rng.standard_normal((n, 3)) * [0.1, 0.2, 0.3]
    return x, y, np.repeat([0, 1, 2], [15, 15, 10])


def test_least_squares_and_its_covariance():
    x, y, run = drawn()
    fit = regression.fit_ols(x, y, run, 3)
    np.testing.assert_allclose(fit.coefficients, np.linalg.lstsq(x, y, rcond=None)[0], rtol=1e-9)
    rest = y - x @ fit.coefficients
    np.testing.assert_allclose(fit.residual_covariance, rest.T @ rest / 36, rtol=1e-9)
    inverse = np.linalg.inv(x.T @ x)
    size = np.sqrt(np.diag(inverse))
    np.testing.assert_allclose(fit.coefficient_error_correlation, inverse / np.outer(size, size), rtol=1e-6)
    white = np.outer(size, np.sqrt(np.diag(fit.residual_covariance)))
    np.testing.assert_allclose(fit.standard_error_inflation, fit.standard_errors / white, rtol=1e-6)


@pytest.mark.parametrize("reach", [0, 1, 4, 100])
def test_standard_errors_for_coloured_residuals(reach):
    """Newey and West, pair by pair of samples of one stretch: Bartlett's weight of their distance."""
    x, y, run = drawn()
    fit = regression.fit_ols(x, y, run, reach)
    rest = y - x @ fit.coefficients
    inverse = np.linalg.inv(x.T @ x)
    distance = np.abs(np.subtract.outer(np.arange(40), np.arange(40)))
    weight = np.where(np.equal.outer(run, run), np.maximum(1.0 - distance / (reach + 1.0), 0.0), 0.0)
    for axis in range(3):
        score = x * rest[:, [axis]]
        middle = score.T @ weight @ score
        expected = np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 0.0))
        np.testing.assert_allclose(fit.standard_errors[:, axis], expected, rtol=1e-6, atol=1e-9)


def test_what_is_not_excited_gets_no_coefficient():
    """A column of zeros, and one twice: the least coefficients that fit, and colour of one where none is."""
    x, y, run = drawn(m=3)
    wide = np.column_stack([x, x[:, 0], np.zeros(40)])
    fit = regression.fit_ols(wide, y, run, 2)
    alone = regression.fit_ols(x, y, run, 2)
    np.testing.assert_allclose(fit.coefficients[0], fit.coefficients[3], rtol=1e-6)
    np.testing.assert_allclose(fit.coefficients[0] * 2, alone.coefficients[0], rtol=1e-6)
    assert fit.coefficients[4].tolist() == [0.0] * 3
    assert fit.standard_error_inflation[4].tolist() == [1.0] * 3
    assert np.isfinite(fit.coefficient_error_correlation).all()
    few = regression.fit_ols(x[:3], y[:3], run[:3], 5)
    assert np.isfinite(few.residual_covariance).all()


def test_variance_inflation_of_columns_that_stand_still_or_depend():
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 200))
    x = np.column_stack([a, np.full(200, 3.0), b + 0.1 * a + 5.0, 1e-14 * b])
    found = regression.variance_inflation(x)
    r2 = np.corrcoef(a, x[:, 2])[0, 1] ** 2
    assert found[[0, 2]] == pytest.approx([1.0 / (1.0 - r2)] * 2)
    assert np.isinf(found[[1, 3]]).all()


@pytest.mark.parametrize(("share", "excited"), [(1.5e-10, True), (0.7e-10, False)])
def test_a_direction_excited_too_little_gets_no_coefficient(share, excited):
    """Two columns that differ by a ten-thousandth: their difference has this share of what their sum has."""
    a, b, *_ = np.linalg.qr(np.random.default_rng(4).standard_normal((200, 4)))[0].T
    off = 2.0 * np.sqrt(share)
    x = np.column_stack([a, a + off * b])
    y = np.column_stack([x @ [1.0, -2.0]] * 3)
    found = regression.fit_ols(x, y, np.zeros(200, dtype=int), 0).coefficients[:, 0]
    np.testing.assert_allclose(found, [1.0, -2.0] if excited else [-0.5, -0.5], atol=1e-3)


@pytest.mark.parametrize(("share", "depends"), [(1.6e-12, False), (0.6e-12, True)])
def test_columns_that_depend_on_one_another_are_inflated_without_end(share, depends):
    """One twice, but for this share of the sum of both; a third column has nothing to do with it."""
    rng = np.random.default_rng(4)
    centred = rng.standard_normal((200, 3))
    a, b, c = np.linalg.qr(centred - centred.mean(axis=0))[0].T
    off = 2.0 * np.sqrt(share)
    found = regression.variance_inflation(np.column_stack([a, c, a + off * b]) + 3.0)
    assert found[1] == pytest.approx(1.0)
    if depends:
        assert np.isinf(found[[0, 2]]).all()
    else:
        assert found[[0, 2]] == pytest.approx([1.0 / (4.0 * share)] * 2, rel=1e-2)
    assert np.isinf(regression.variance_inflation(np.column_stack([a, c, a]))).tolist() == [
        True,
        False,
        True,
    ]
    assert np.isinf(regression.variance_inflation(np.ones((9, 2)))).all()


def test_a_spectrum_holds_the_variance():
    rng = np.random.default_rng(3)
    white = rng.standard_normal((4096, 3)) * [1.0, 2.0, 3.0]
    frequency, density = regression.spectral_density(white, 0.05)
    assert len(frequency) == 129
    assert (frequency[0], frequency[-1]) == (0.0, pytest.approx(10.0))
    assert density.mean(axis=0) * 10.0 == pytest.approx([1.0, 4.0, 9.0], rel=0.05)
    assert len(regression.spectral_density(white[:100], 0.05)[0]) == 51
    shifted = regression.spectral_density(white + 7.0, 0.05)[1]
    np.testing.assert_allclose(shifted, density, rtol=1e-6)


def test_what_a_model_predicts_does_not_depend_on_later_samples():
    samples = small.flight(WING, 60)
    short = replace(
        samples,
        **{k: getattr(samples, k)[:40] for k in ("rates", "commands", "signals", "labels", "stretch_number")},
    )
    whole, cut = (regression.unexplained_rates(one, WING) for one in (samples, short))
    for one, other in zip(whole, cut, strict=True):
        np.testing.assert_array_equal(one[:40], other)


def test_a_column_of_rounding_gets_no_coefficient_and_changes_no_other():
    rng = np.random.default_rng(3)
    x = np.column_stack([np.ones(400), rng.standard_normal((400, 2)) * [0.3, 40.0]])
    y = x @ np.array([[0.5, -1.0, 2.0], [3.0, 0.2, -0.7], [0.01, 0.02, -0.03]])
    dead = np.column_stack([x[:, :2], 1e-140 * rng.standard_normal(400), x[:, 2:]])
    fit = regression.fit_ols(dead, y, np.zeros(400, dtype=int), 5)
    assert fit.coefficients[2].tolist() == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(fit.coefficients[[0, 1, 3]], np.linalg.lstsq(x, y, rcond=None)[0], rtol=1e-9)


@pytest.mark.parametrize("more", [(), (2,)])
def test_a_prediction_is_the_sum_over_the_samples_before_times_their_coefficients(more):
    """x[k] - sum_j x[k - j] P[j], coefficients of no two axes alike; before the first sample is nothing."""
    rng = np.random.default_rng(3)
    values, predictor = rng.standard_normal((7, *more, 3)), rng.standard_normal((2, 3, 3))
    expected = [
        values[k] - sum(values[k - j] @ predictor[j - 1] for j in (1, 2) if k >= j)
        for k in range(len(values))
    ]
    np.testing.assert_allclose(regression.subtract_noise(values, predictor), expected, atol=1e-12)


def test_a_flight_is_split_where_its_shortest_part_is_long_enough():
    assert [len(part) for part in regression.split_parts(np.arange(242))] == [61, 61, 60, 60]
    assert regression.split_parts(np.arange(239)) is None  # the last part has 59 rows


def test_what_a_coefficient_surely_does_not_exceed():
    """Four standard errors above least squares, of samples of which each counts for a share; much where
    columns make one another up."""
    x, y, _ = drawn(n=60, m=4)
    for share in (1.0, 0.4):
        high, squares = regression.bound_above(x, y[:, 1], share)
        value = np.linalg.lstsq(x, y[:, 1], rcond=None)[0]
        rest = y[:, 1] - x @ value
        np.testing.assert_allclose(squares, rest**2, rtol=1e-6)
        errors = np.sqrt(np.diag(np.linalg.inv(x.T @ x)) * (rest @ rest) / 60 / share)
        np.testing.assert_allclose(high, value + 4.0 * errors, rtol=1e-6)
    twice = np.column_stack([x, x[:, 0]])
    loose, _ = regression.bound_above(twice, y[:, 1], 0.4)
    assert (loose[[0, 4]] > 1e3 * np.abs(high[0])).all()
    np.testing.assert_allclose(loose[1:4], high[1:], rtol=1e-3)


@pytest.mark.parametrize(("n", "parts"), [(239, None), (240, [60] * 4), (243, [61, 61, 61, 60])])
def test_a_flight_has_four_parts_of_sixty_rows_at_least(n, parts):
    found = regression.split_parts(7 + 2 * np.arange(n))
    if parts is None:
        assert found is None
        return
    assert [len(part) for part in found] == parts
    assert np.concatenate(found).tolist() == [*range(7, 7 + 2 * n, 2)]
