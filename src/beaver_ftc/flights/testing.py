"""Tests of an identification on what it did not see, and the bounds that these tests call for.

One flight is cut in two halves of what is known of it; of several, each is left out in turn.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.flights.bank import bank_of
from beaver_ftc.flights.diagnose import Rows, rows_of
from beaver_ftc.flights.filtering import posterior_of
from beaver_ftc.flights.identify import Stretch, fit_like, without
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.regressors import build, group_indices, predict
from beaver_ftc.flights.scoring import by_labels

Document = dict[str, Any]

_MASSES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
_WANTED = 0.93
"""Coverage the bounds aim at: 90 % and some of what another day takes away."""


def folds(stretches: Sequence[Stretch]) -> list[tuple[list[Stretch], Stretch, str]]:
    """What is fitted, what is kept, and what the kept part is called."""
    if len(stretches) > 1:
        rest = [[other for other in stretches if other is not kept] for kept in stretches]
        return [(fitted, kept, kept.samples.name) for fitted, kept in zip(rest, stretches, strict=True)]
    (only,) = stretches
    known = np.flatnonzero(only.use)
    middle = int(known[len(known) // 2]) if len(known) else 0
    first, second = without(only, middle, len(only.use)), without(only, 0, middle)
    return [([first], second, "second half"), ([second], first, "first half")]


def run_tests(stretches: Sequence[Stretch], model: Model) -> tuple[list[Document], float]:
    """One entry a fold, and the posterior mass with which the bounds hold the labels as they should."""
    entries: list[Document] = []
    held: list[list[float]] = []
    for fitted, kept, name in folds(stretches):
        tested = fit_like(fitted, model)
        entry: Document = {"left_out": name, **prediction(tested, kept)}
        labels = np.where(kept.use[:, None], kept.samples.labels, np.nan)
        if np.isfinite(labels).all(axis=1).any():
            by_mass = _rows_by_mass(tested, kept)
            entry["score"] = by_labels(by_mass[model.settings.bounds], labels)
            held.append([by_labels(by_mass[mass], labels)["held_by_bounds"] for mass in _MASSES])
        entries.append(entry)
    if not held:
        return entries, model.settings.bounds
    return entries, _MASSES[int(np.argmin(np.abs(np.mean(held, axis=0) - _WANTED)))]


def _rows_by_mass(model: Model, kept: Stretch) -> dict[float, Rows]:
    bank = bank_of(model)
    found = posterior_of(kept.samples, model, bank)
    settings = [model.settings.model_copy(update={"bounds": m}) for m in {*_MASSES, model.settings.bounds}]
    return {
        one.bounds: rows_of(kept.samples, model.model_copy(update={"settings": one}), bank, *found)
        for one in settings
    }


def prediction(model: Model, kept: Stretch) -> Document:
    """Share of the rates' variance that one-step prediction explains, and the residual, an axis."""
    residual, rates = residuals(model, kept)
    if not len(rates):
        return {"samples": 0}
    explained = 1.0 - residual.var(axis=0) / np.maximum(rates.var(axis=0), 1e-300)
    return {
        "samples": len(rates),
        "explained": dict(zip("pqr", explained.tolist(), strict=True)),
        "residual_rad_s": dict(zip("pqr", residual.std(axis=0).tolist(), strict=True)),
    }


def residuals(model: Model, kept: Stretch) -> tuple[Floats, Floats]:
    """One-step residuals and rates of the samples in use, (n, 3)."""
    rows, residual = residual_rows(model, kept)
    return residual, kept.samples.rates[rows]


def residual_rows(model: Model, kept: Stretch) -> tuple[NDArray[np.int64], Floats]:
    """Places (n,) of the samples in use, and their one-step residuals (n, 3)."""
    regressors = build(kept.samples, group_indices(model), model.history, model.lags, scaled=True)
    intercept, past, response, _ = model.arrays()
    unexplained, answers = predict(kept.samples.rates, regressors, past, response)
    rows = np.flatnonzero(kept.use & regressors.ok)
    return rows, (unexplained - answers.sum(axis=1) - intercept)[rows]
