"""What the rates of the next sample are predicted from, and least squares on it.

    rates[k] = c + A [rates[k-1..k-h], signals[k-1]] + sum over groups g of e_g sum_j b_gj u_g[k-j] + noise

Surfaces whose commands are proportional to one another move together while they are healthy: their effects
cannot be distinguished by any fit, so they form one group with one response. Of a fit: what a coloured
residual does to its covariance, and which regressors are collinear.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.samples import Samples, mixer
from beaver_ftc_logs.vehicle import Vehicle

_PARALLEL = 1e-9
_RIDGE = 1e-10
_DEPENDENT = 1e-12
_PARTS, _LEAST_ROWS, _SURELY = 4, 60, 4.0
"""Parts of a flight, and their rows at least; standard errors."""


def groups_of(vehicle: Vehicle) -> list[list[int]]:
    """Surfaces by what excites them: those in one group get proportional commands."""
    rows = mixer(vehicle)
    groups: list[list[int]] = []
    for i, row in enumerate(rows):
        for group in groups:
            other = rows[group[0]]
            if (row @ other) ** 2 >= (1.0 - _PARALLEL) * (row @ row) * (other @ other):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def build(
    samples: Samples, groups: list[list[int]], history: int, lags: int, scaled: bool, felt: int = 1
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The regressors of each sample: the past (n, 3 h + X f), the commands (n, G, L) of the groups at lags 1
    to L, and whether all of it is known and no gap lies within, (n,).

    scaled: multiply each surface's command by its labelled effectiveness (1 where there is no label). felt:
    past samples f of the signals.
    """
    surfaces = samples.commands
    if scaled:
        surfaces = surfaces * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    grouped = np.column_stack([surfaces[:, group].sum(axis=1) for group in groups])
    rates = [_delayed(samples.rates, k, np.nan) for k in range(1, history + 1)]
    past = np.column_stack([*rates, *(_delayed(samples.signals, k, np.nan) for k in range(1, felt + 1))])
    commands = np.stack([_delayed(grouped, k, np.nan) for k in range(1, lags + 1)], axis=1)
    known = np.isfinite(past).all(axis=1) & np.isfinite(commands).all(axis=(1, 2))
    known &= np.isfinite(samples.rates).all(axis=1)
    known &= samples.run == _delayed(samples.run, max(history, lags), -1)
    return past, commands.transpose(0, 2, 1), known


def _delayed(values: np.ndarray, k: int, before: float) -> np.ndarray:
    """The rows k samples later, `before` where there is no past."""
    k = min(k, len(values))
    return np.concatenate([np.full((k, *values.shape[1:]), before), values[: len(values) - k]])


def group_indices(model: Model) -> list[list[int]]:
    """The model's groups as positions of their surfaces."""
    names = list(model.vehicle.surfaces)
    return [[names.index(name) for name in group] for group in model.groups]


def by_surface(values: Floats, model: Model) -> Floats:
    """Each surface's column (n, S) of those of the groups (n, G): its group's, 1 where it is in none."""
    place = np.full(len(model.vehicle.surfaces), -1)
    for group, members in enumerate(group_indices(model)):
        place[members] = group
    return np.asarray(np.take(np.column_stack([values, np.ones(len(values))]), place, axis=1))


def predicted(
    samples: Samples, model: Model, scaled: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """By a model: which samples it can predict, (n,), what the past leaves unexplained of the rates, (n, 3),
    and each group's healthy answer, (n, G, 3). scaled: as `build`.

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
    """
    order = model.history, model.lags, scaled, model.vehicle.felt(model.history)
    past, commands, ok = build(samples, group_indices(model), *order)
    _, by_past, response, _ = model.arrays()
    unexplained = samples.rates - np.einsum("nm,mr->nr", past, by_past)
    return ok, unexplained, np.einsum("ngl,glr->ngr", commands, response)


def in_white(
    samples: Samples, model: Model, scaled: bool = False
) -> tuple[NDArray[np.bool_], Floats, Floats]:
    """As `predicted`, less the prediction from the residuals before each sample by the flight's noise model:
    of a healthy flight a white residual is left."""
    ok, unexplained, answers = predicted(samples, model, scaled)
    before, known = model.noise_predictor(samples.colour), ok.copy()
    for j in range(1, len(before) + 1):
        known &= _delayed(ok, j, False)
    return known, less_predicted(unexplained, before), less_predicted(answers, before)


def less_predicted(values: Floats, before: Floats) -> Floats:
    """Values (n, ..., 3) less their prediction from the L before each; before (L, 3, 3): coefficients."""
    rest = values.copy()
    if not len(before) or not values.size:
        return rest
    given, left = (np.moveaxis(of.reshape(len(values), -1, 3), 0, -1) for of in (values, rest))
    for (r, s), taps in zip(np.ndindex(3, 3), before.reshape(-1, 9).T, strict=True):
        for one, of in zip(np.ascontiguousarray(given[:, r]), left[:, s], strict=True):
            of[1:] -= np.convolve(one, taps)[: len(one) - 1]
    return rest


@dataclass(frozen=True)
class Fit:
    """coefficients (m, 3); covariance (3, 3) of the residuals; standard errors (m, 3) and
    the factor by which the residuals' colour widens them over those of white ones, (m, 3); correlation (m, m)
    of the coefficients' errors, alike on every axis."""

    coefficients: Floats
    covariance: Floats
    standard_errors: Floats
    colour: Floats
    correlation: Floats


def least_squares(x: Floats, y: Floats, run: NDArray[np.int64], reach: int) -> Fit:
    """Ordinary least squares of y (n, 3) on x (n, m), with Newey-West standard errors over `reach` lags.

    run (n,): products of residuals are formed within one gap-free stretch only. Directions that x does not
    excite get the least coefficients that fit, and a column of nothing but rounding gets 0.
    """
    size = np.sqrt((x**2).mean(axis=0))
    scale = np.where(size > _DEPENDENT * size.max(), size, np.inf)
    z = x / scale
    inverse: Floats = np.asarray(np.linalg.pinv(z.T @ z, rcond=_RIDGE), dtype=np.float64)
    coefficients = inverse @ (z.T @ y)
    residuals = y - z @ coefficients
    free = max(len(y) - x.shape[1], 1)
    covariance = residuals.T @ residuals / free
    white = np.sqrt(np.maximum(np.outer(np.diag(inverse), np.diag(covariance)), 0.0))
    robust = np.column_stack(
        [_newey_west(z, residuals[:, i], inverse, run, reach) for i in range(y.shape[1])]
    )
    colour = np.divide(robust, white, out=np.ones_like(robust), where=white > 0)
    size = np.sqrt(np.maximum(np.diag(inverse), TINY))
    return Fit(
        coefficients / scale[:, None], covariance, robust / scale[:, None], colour,
        inverse / np.outer(size, size),
    )  # fmt: skip


def _newey_west(z: Floats, e: Floats, inverse: Floats, run: NDArray[np.int64], reach: int) -> Floats:
    """Standard errors that hold for autocorrelated residuals: Bartlett weights over `reach` lags."""
    score, width = z * e[:, None], reach + 1
    edges = [0, *(np.flatnonzero(np.diff(run)) + 1).tolist(), len(run)]
    middle = np.zeros((z.shape[1], z.shape[1]))
    for begin, end in pairwise(edges):  # Bartlett's weights are those of products of running sums
        total = np.cumsum(np.pad(score[begin:end], ((width, width - 1), (0, 0))), axis=0)
        sums = total[width:] - total[:-width]
        middle += sums.T @ sums / width
    return np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 0.0))


def coefficient_bounds(x: Floats, y: Floats, power: float) -> tuple[Floats, Floats]:
    """Least squares of y (n,) on x (n, m): what each coefficient surely does not exceed, (m,), which is much
    where columns make one another up; and squares of what is left (n,). power: as in `Settings`."""
    size = np.maximum(np.sqrt((x**2).mean(axis=0)), TINY)
    z = x / size
    inverse = np.linalg.inv(z.T @ z + _RIDGE * len(z) * np.eye(z.shape[1]))
    found = inverse @ (z.T @ y)
    square = (y - z @ found) ** 2
    error = np.sqrt(np.maximum(np.diag(inverse), 0.0) * square.mean() / power)
    return (found + _SURELY * error) / size, square


def quarters(rows: NDArray[np.int64]) -> list[NDArray[np.int64]] | None:
    """The rows of a flight in its parts; None where one is too short."""
    parts = np.array_split(rows, _PARTS)
    return parts if min(map(len, parts)) >= _LEAST_ROWS else None


def variance_inflation(x: Floats) -> Floats:
    """How much each column's coefficient's variance is inflated by the others: 1 alone, inf dependent."""
    z = x - x.mean(axis=0)
    norm = np.sqrt((z**2).sum(axis=0))
    factors = np.full(x.shape[1], np.inf)
    live = norm > 1e-12
    correlation = (z[:, live] / norm[live]).T @ (z[:, live] / norm[live])
    values, vectors = np.linalg.eigh(correlation)
    free, share = values > _DEPENDENT * values.max(initial=0.0), vectors**2
    inflated = (share[:, free] / values[free]).sum(axis=1)
    factors[live] = np.where(share[:, ~free].sum(axis=1) > _DEPENDENT, np.inf, inflated)
    return factors


def spectrum(residuals: Floats, dt_s: float, segment: int = 256) -> tuple[Floats, Floats]:
    """One-sided spectral density of each residual, (f,) Hz and (f, 3), by averaged periodograms."""
    from scipy import signal

    length = min(segment, len(residuals))
    frequency, density = signal.welch(residuals, fs=1.0 / dt_s, nperseg=length, axis=0, detrend="constant")
    return frequency, density
