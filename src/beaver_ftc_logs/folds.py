"""Fit models with a part left out in turn, and predict that part.

Every figure of merit comes from parts left out: the two halves of a single flight in turn, or each of several
flights in turn. A *fold* is a part left out with the model of the others.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import regression
from beaver_ftc_logs.effect_errors import group_gain_sd, tied_shares
from beaver_ftc_logs.fit_parts import FitPart, Parts
from beaver_ftc_logs.model import FittedRanges, Model
from beaver_ftc_logs.orders import fit_of, refit
from beaver_ftc_logs.recording import MIN_DIVISOR

_MAX_SPLITS = 12  # largest number of refits, to limit the time of `identify`


class Fold(NamedTuple):
    """A part left out (`held_out`), its name, the parts of the refit (`fitted`) and their model. Of the
    ranges of the model (`model.fitted`), only the standard errors of the gains and the tied shares (of all
    parts) are set."""

    model: Model
    held_out: FitPart
    name: str
    fitted: Parts

    def innovations(self) -> regression.Innovations:
        """The usable samples of the part left out, by the model of the others."""
        return self.held_out.innovations(self.model)


def held_out_folds(parts: Parts, model: Model, max_splits: int | None = _MAX_SPLITS) -> Iterator[Fold]:
    """Yield the folds. max_splits: largest number of refits, as in `validation_folds`."""
    tied = tied_shares(parts, model).tolist()
    for fitted, held_out, name in validation_folds(parts, max_splits):
        gain_sd = group_gain_sd(fit_of(fitted, model), model).tolist()
        ranges = FittedRanges(commands=[], rates=[], gain_sd=gain_sd, tied=tied)
        yield Fold(refit(fitted, model).model_copy(update={"fitted": ranges}), held_out, name, fitted)


def validation_folds(parts: Parts, max_splits: int | None = None) -> list[tuple[list[FitPart], FitPart, str]]:
    """The fitted flights, the held-out one and its name, for each fold: the halves of one flight, or each of
    several flights. If there are more than `max_splits` flights, every `max_splits`-th flight is left out of
    the same refit, so that there are `max_splits` refits."""
    if len(parts) == 1:
        first, second = parts[0].halves
        return [([first], second, "second half"), ([second], first, "first half")]
    n = min(len(parts), max_splits or len(parts))
    return [
        ([part for i, part in enumerate(parts) if i % n != k], left_out, left_out.samples.name)
        for k in range(n)
        for left_out in parts[k::n]
    ]


def fold_qualities(parts: Parts, model: Model) -> list[Document]:
    """The name and the `prediction_quality` of each part left out."""
    folds = held_out_folds(parts, model, None)
    return [{"left_out": fold.name, **prediction_quality(fold)} for fold in folds]


def prediction_quality(fold: Fold) -> Document:
    """For each axis the share of the rates' variance that one-step prediction explains, 1 - var(e) / var(y),
    and the standard deviation of the residual e, rad/s; y: the rates. Without a sample, only their number
    0."""
    flight = fold.held_out.one_step_innovations(fold.model)
    y = fold.held_out.samples.rates[flight.rows]
    e = flight.e
    if not len(y):
        return {"samples": 0}
    explained = 1.0 - e.var(axis=0) / np.maximum(y.var(axis=0), MIN_DIVISOR)
    return {
        "samples": len(y),
        "explained": regression.by_axis(explained),
        "residual_rad_s": regression.by_axis(e.std(axis=0)),
    }
