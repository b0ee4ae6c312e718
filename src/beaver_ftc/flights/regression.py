"""What the rates of the next sample are predicted from, and least squares on it.

    rates[k] = c + A [rates[k-1..k-h], signals[k-1]] + sum over groups g of e_g sum_j b_gj u_g[k-j] + noise

Surfaces whose commands are proportional to one another move together while they are healthy: their effects
cannot be told apart by any fit, so they form one group with one response. Of a fit: what a coloured residual
does to its covariance, and which regressors are collinear.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.samples import Samples, mixer
from beaver_ftc.flights.vehicle import Vehicle

_PARALLEL = 1e-9
_RIDGE = 1e-10


@dataclass(frozen=True)
class Regressors:
    """past (n, 3 h + X); commands (n, G, L) of the groups at lags 1 to L; ok (n,) all of it is known and no
    gap lies within."""

    past: Floats
    commands: Floats
    ok: NDArray[np.bool_]


def groups_of(vehicle: Vehicle) -> list[list[int]]:
    """Surfaces by what excites them: those in one group get proportional commands."""
    rows = mixer(vehicle)
    groups: list[list[int]] = []
    for i, row in enumerate(rows):
        for group in groups:
            if _parallel(row, rows[group[0]]):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _parallel(one: Floats, other: Floats) -> bool:
    product = float(one @ other) ** 2
    return product >= (1.0 - _PARALLEL) * float(one @ one) * float(other @ other)


def build(samples: Samples, groups: list[list[int]], history: int, lags: int, scaled: bool) -> Regressors:
    """The regressors of each sample.

    scaled: multiply each surface's command by its labelled effectiveness (1 where there is no label).
    """
    surfaces = samples.commands
    if scaled:
        surfaces = surfaces * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    grouped = np.column_stack([surfaces[:, group].sum(axis=1) for group in groups])
    past = np.column_stack([_lagged(samples.rates, range(1, history + 1)), _lagged(samples.signals, (1,))])
    commands = _lagged(grouped, range(1, lags + 1)).reshape(len(grouped), lags, len(groups))
    known = np.isfinite(past).all(axis=1) & np.isfinite(commands).all(axis=(1, 2))
    known &= np.isfinite(samples.rates).all(axis=1)
    return Regressors(past, commands.transpose(0, 2, 1), known & _within_run(samples.run, max(history, lags)))


def _lagged(values: Floats, lags: range | tuple[int, ...]) -> Floats:
    """Columns delayed by each lag, nan where there is no past: (n, len(lags) * columns)."""
    n = len(values)
    delayed = [
        np.vstack([np.full((min(k, n), values.shape[1]), np.nan), values[: max(n - k, 0)]]) for k in lags
    ]
    return np.column_stack(delayed)


def _within_run(run: NDArray[np.int64], reach: int) -> NDArray[np.bool_]:
    before = np.concatenate([np.full(min(reach, len(run)), -1), run[: max(len(run) - reach, 0)]])
    return run == before


def group_indices(model: Model) -> list[list[int]]:
    """The model's groups as positions of their surfaces."""
    names = list(model.vehicle.surfaces)
    return [[names.index(name) for name in group] for group in model.groups]


def predicted(
    samples: Samples, model: Model, scaled: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """By a model: which samples it can predict, (n,), what the past leaves unexplained of the rates, (n, 3),
    and each group's healthy answer, (n, G, 3). scaled: as `build`.

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
    """
    regressors = build(samples, group_indices(model), model.history, model.lags, scaled)
    _, past, response, _ = model.arrays()
    unexplained = samples.rates - np.einsum("nm,mr->nr", regressors.past, past)
    return regressors.ok, unexplained, np.einsum("ngl,glr->ngr", regressors.commands, response)


@dataclass(frozen=True)
class Fit:
    """coefficients (m, 3); residuals (n, 3); covariance (3, 3) of the residuals; standard errors (m, 3) and
    the factor by which the residuals' colour widens them over those of white ones, (m, 3); correlation (m, m)
    of the coefficients' errors, alike on every axis."""

    coefficients: Floats
    residuals: Floats
    covariance: Floats
    standard_errors: Floats
    colour: Floats
    correlation: Floats


def least_squares(x: Floats, y: Floats, run: NDArray[np.int64], reach: int) -> Fit:
    """Ordinary least squares of y (n, 3) on x (n, m), with Newey-West standard errors over `reach` lags.

    run (n,): products of residuals are formed within one gap-free stretch only. Directions that x does not
    excite get the least coefficients that fit.
    """
    scale = np.maximum(np.sqrt((x**2).mean(axis=0)), 1e-300)
    z = x / scale
    inverse = np.linalg.pinv(z.T @ z, rcond=_RIDGE, hermitian=True)
    coefficients = inverse @ (z.T @ y)
    residuals = y - z @ coefficients
    free = max(len(y) - x.shape[1], 1)
    covariance = residuals.T @ residuals / free
    white = np.sqrt(np.maximum(np.outer(np.diag(inverse), np.diag(covariance)), 0.0))
    robust = np.column_stack(
        [_newey_west(z, residuals[:, i], inverse, run, reach) for i in range(y.shape[1])]
    )
    colour = np.divide(robust, white, out=np.ones_like(robust), where=white > 0)
    size = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    return Fit(
        coefficients / scale[:, None], residuals, covariance, robust / scale[:, None], colour,
        inverse / np.outer(size, size),
    )  # fmt: skip


def _newey_west(z: Floats, e: Floats, inverse: Floats, run: NDArray[np.int64], reach: int) -> Floats:
    """Standard errors that hold for autocorrelated residuals: Bartlett weights over `reach` lags."""
    score = z * e[:, None]
    middle = score.T @ score
    for lag in range(1, min(reach, len(e) - 1) + 1):
        together = (run[lag:] == run[:-lag])[:, None]
        product = (score[lag:] * together).T @ score[:-lag]
        middle += (1.0 - lag / (reach + 1.0)) * (product + product.T)
    return np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 0.0))


def variance_inflation(x: Floats) -> Floats:
    """How much each column's coefficient's variance is inflated by the others: 1 alone, inf dependent."""
    z = x - x.mean(axis=0)
    norm = np.sqrt((z**2).sum(axis=0))
    factors = np.full(x.shape[1], np.inf)
    live = norm > 1e-12
    correlation = (z[:, live] / norm[live]).T @ (z[:, live] / norm[live])
    factors[live] = np.diag(np.linalg.pinv(correlation, rcond=1e-12, hermitian=True))
    return factors


def spectrum(residuals: Floats, dt_s: float, segment: int = 256) -> tuple[Floats, Floats]:
    """One-sided spectral density of each residual, (f,) Hz and (f, 3), by averaged periodograms."""
    from scipy import signal

    length = min(segment, len(residuals))
    frequency, density = signal.welch(residuals, fs=1.0 / dt_s, nperseg=length, axis=0, detrend="constant")
    return frequency, density
