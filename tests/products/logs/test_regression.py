"""Regressors and least squares, by closed forms and by another road."""

import numpy as np
import pytest

from beaver_ftc_logs import least_squares, regression
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
    assert small.group_surfaces(vehicle) == ([[0, 2], [1, 3]] if together else [[0], [1, 3], [2]])


@pytest.mark.parametrize(("history", "lags"), [(1, 1), (2, 3), (4, 1)])
def test_what_a_sample_is_predicted_from(history, lags):
    """Of one stretch, with every number known; commands as effective as labels say, where they say it."""
    samples, reach = small.flight(TAIL, 30, gap=12), max(history, lags)
    samples.rates[20, 1] = samples.commands[25, 1] = samples.signals[5, 0] = np.nan
    samples.labels[:] = [0.5, np.nan, 0.25]
    past, commands, known = regression.build_regressors(samples, [[0, 2], [1]], history, lags, True, 1)
    missing = {20 + j for j in range(history + 1)} | {25 + j for j in range(1, lags + 1)} | {6}
    whole = [k for k in range(30) if k % 12 >= reach or k >= 24]
    assert np.flatnonzero(known).tolist() == [
        k for k in whole if k not in missing and not 12 <= k < 12 + reach
    ]
    for k in np.flatnonzero(known):
        rates = samples.rates[k - history : k][::-1].ravel()
        np.testing.assert_array_equal(past[k], [*rates, *samples.signals[k - 1]])
        a, e, b = samples.commands[k - lags : k][::-1].T
        np.testing.assert_allclose(commands[k], [0.5 * a + 0.25 * b, e], rtol=1e-15)


def drawn(n=40, m=4, seed=1):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, m)) * [1.0, 10.0, 0.1, 2.0][:m]
    y = x @ rng.standard_normal((m, 3)) + rng.standard_normal((n, 3)) * [0.1, 0.2, 0.3]
    return x, y, np.repeat([0, 1, 2], [15, 15, 10])


def test_least_squares_and_its_covariance():
    x, y, run = drawn()
    fit = least_squares.fit_ols(x, y, run, 3)
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
    fit = least_squares.fit_ols(x, y, run, reach)
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
    fit = least_squares.fit_ols(wide, y, run, 2)
    alone = least_squares.fit_ols(x, y, run, 2)
    np.testing.assert_allclose(fit.coefficients[0], fit.coefficients[3], rtol=1e-6)
    np.testing.assert_allclose(fit.coefficients[0] * 2, alone.coefficients[0], rtol=1e-6)
    assert fit.coefficients[4].tolist() == [0.0] * 3
    assert fit.standard_error_inflation[4].tolist() == [1.0] * 3
    assert np.isfinite(fit.coefficient_error_correlation).all()
    few = least_squares.fit_ols(x[:3], y[:3], run[:3], 5)
    assert np.isfinite(few.residual_covariance).all()
