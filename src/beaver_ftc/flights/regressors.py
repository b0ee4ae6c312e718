"""What the rates of the next sample are predicted from: the past of rates, signals and commands.

    rates[k] = c + A [rates[k-1..k-h], signals[k-1]] + sum over groups g of e_g sum_j b_gj u_g[k-j] + noise

Surfaces whose commands are proportional to one another move together while they are healthy: their effects
cannot be told apart by any fit, so they form one group with one response.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.samples import Samples, mixer
from beaver_ftc.flights.vehicle import Vehicle

_PARALLEL = 1e-9


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


def predict(rates: Floats, regressors: Regressors, past: Floats, response: Floats) -> tuple[Floats, Floats]:
    """What the past leaves unexplained of the rates, (n, 3), and each group's healthy answer, (n, G, 3).

    Summed in the same order whatever the length of the flight, so that a row does not depend on later ones.
    """
    unexplained = rates - np.einsum("nm,mr->nr", regressors.past, past)
    return unexplained, np.einsum("ngl,glr->ngr", regressors.commands, response)
