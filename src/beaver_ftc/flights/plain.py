"""Rivals on recorded flights: plain estimators that get the same model, and the rule that needs none.

sliding-least-squares   the last 20 s, every sample alike
forgetting-least-squares  all the past, forgotten exponentially with 20 s [Ljung1999]
freeze                  a servo output that has not moved for 6 s: sees the logged output itself stand still
"""

import numpy as np

from beaver_ftc.flights.bank import bank_of
from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats, Recording
from beaver_ftc.flights.regressors import build, group_indices, predict
from beaver_ftc.flights.samples import Samples

MEMORY_S = 20.0
STILL_S = 6.0
_SURE_SD = 5.0
_NINETY = 1.645


def sliding(samples: Samples, model: Model) -> Rows:
    """Least squares over the last 20 s."""
    return _least_squares(samples, model, forget=False)


def forgetting(samples: Samples, model: Model) -> Rows:
    """Least squares that forgets with a time constant of 20 s."""
    return _least_squares(samples, model, forget=True)


def _least_squares(samples: Samples, model: Model, forget: bool) -> Rows:
    """Effectiveness of the groups and the trim, from y = c + sum e_g F_g, whitened."""
    x, y = _whitened(samples, model)
    information = _remembered(np.einsum("nai,naj->nij", x, x), samples.dt_s, forget)
    score = _remembered(np.einsum("nai,na->ni", x, y), samples.dt_s, forget)
    prior = np.diag([*np.full(3, 1.0 / model.settings.trim_sd**2), *np.full(x.shape[2] - 3, 4.0)])
    covariance = np.linalg.inv(information + prior)
    found = np.einsum("nij,nj->ni", covariance, score)
    effectiveness = 1.0 + found[:, 3:]
    sd = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2)[:, 3:], 0.0))
    return _rows(samples, model, effectiveness, sd)


def _whitened(samples: Samples, model: Model) -> tuple[Floats, Floats]:
    """Regressors (n, 3, 3 + G) of trim and lost effectiveness, and what a healthy vehicle leaves, (n, 3)."""
    regressors = build(samples, group_indices(model), model.history, model.lags, scaled=False)
    intercept, past, response, noise = model.arrays()
    unexplained, answers = predict(samples.rates, regressors, past, response)
    whiten = np.linalg.inv(np.linalg.cholesky(noise))
    rest = np.where(regressors.ok[:, None], unexplained - intercept - answers.sum(axis=1), 0.0) @ whiten.T
    sizes = np.broadcast_to(np.diag(np.sqrt(np.diag(noise))), (len(rest), 3, 3))
    x = np.concatenate([sizes, answers.transpose(0, 2, 1)], axis=2)
    x = np.where(regressors.ok[:, None, None], x, 0.0)
    return np.einsum("ab,nbi->nai", whiten, x), rest


def _remembered(values: Floats, dt_s: float, forget: bool) -> Floats:
    """Sums over the memory that ends at each sample."""
    if forget:
        from scipy.signal import lfilter

        return np.asarray(lfilter([1.0], [1.0, -np.exp(-dt_s / MEMORY_S)], values, axis=0))
    total = np.cumsum(values, axis=0)
    length = round(MEMORY_S / dt_s)
    total[length:] = total[length:] - total[:-length].copy()
    return total


def _rows(samples: Samples, model: Model, effectiveness: Floats, sd: Floats) -> Rows:
    """The nearest level the model knows; faulty where that is not healthy, and surely so without labels."""
    bank, groups = bank_of(model), group_indices(model)
    surfaces = len(model.vehicle.surfaces)
    estimate, low, high = (np.ones((len(effectiveness), surfaces)) for _ in range(3))
    lost = np.zeros(effectiveness.shape, dtype=bool)
    for g, members in enumerate(groups):
        levels = _known_levels(model, bank.effectiveness[:, g], g)
        value = np.clip(effectiveness[:, g], 0.0, 1.0)
        if model.settings.levels:
            value = levels[np.abs(value[:, None] - levels).argmin(axis=1)]
            lost[:, g] = value < 1.0
        else:
            lost[:, g] = effectiveness[:, g] + _SURE_SD * sd[:, g] < 1.0
        estimate[:, members] = value[:, None]
        low[:, members] = np.clip(effectiveness[:, g] - _NINETY * sd[:, g], 0.0, 1.0)[:, None]
        high[:, members] = np.clip(effectiveness[:, g] + _NINETY * sd[:, g], 0.0, 1.0)[:, None]
    return _named(samples.t_s, model, lost, estimate, np.minimum(low, estimate), np.maximum(high, estimate))


def _known_levels(model: Model, all_levels: Floats, group: int) -> Floats:
    seen = model.settings.levels.get("+".join(model.groups[group]))
    return np.array([*seen, 1.0]) if seen else np.unique(all_levels)


def _named(t_s: Floats, model: Model, lost: np.ndarray, estimate: Floats, low: Floats, high: Floats) -> Rows:
    named = np.full(len(t_s), "", dtype=object)
    for k in np.flatnonzero(lost.any(axis=1)):
        named[k] = "+".join(name for g in np.flatnonzero(lost[k]) for name in model.groups[g])
    faulty = np.asarray(lost.any(axis=1))
    ones = np.ones(len(t_s))
    return Rows(
        t_s, faulty.astype(np.int64), named, estimate, low, high, faulty.astype(float), 1.0 - lost, ones, ones
    )


def freeze(recording: Recording, samples: Samples, model: Model) -> Rows | None:
    """The freeze rule on the logged servo outputs; None where the vehicle file names none."""
    names = list(model.vehicle.surfaces)
    columns = {
        name: recording.columns[column]
        for name, column in model.vehicle.outputs.items()
        if column in recording.columns
    }
    if not columns:
        return None
    still = np.zeros((len(samples.t_s), len(names)), dtype=bool)
    for name, column in columns.items():
        last = np.searchsorted(column.t_s, samples.t_s, side="right") - 1
        moved = np.concatenate([[True], np.diff(column.values) != 0.0])
        since = column.t_s[np.maximum.accumulate(np.where(moved, np.arange(len(moved)), 0))]
        still[:, names.index(name)] = (samples.t_s - since[np.maximum(last, 0)] > STILL_S) & (last >= 0)
    estimate = 1.0 - still
    named = np.array(
        ["+".join(name for name, frozen in zip(names, row, strict=True) if frozen) for row in still],
        dtype=object,
    )
    faulty = np.asarray(still.any(axis=1))
    healthy = np.ones((len(faulty), len(model.groups)))
    ones = np.ones(len(faulty))
    return Rows(
        samples.t_s, faulty.astype(np.int64), named, estimate, estimate, estimate, faulty.astype(float),
        healthy, ones, ones,
    )  # fmt: skip
