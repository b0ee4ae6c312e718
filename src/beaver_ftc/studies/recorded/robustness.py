"""How a model holds on other days: halves of a labelled flight, the other half altered as another day would.

The settings were chosen on the first drawn days; what counts is the others.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.detectors import BANK, diagnose_with
from beaver_ftc.flights.identify import Stretch, fit_model, stretches_of
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.samples import mixer
from beaver_ftc.flights.scoring import by_labels
from beaver_ftc.flights.testing import folds
from beaver_ftc.studies.recorded import tally
from beaver_ftc.studies.recorded.data import DataSet, data_sets
from beaver_ftc.studies.recorded.other_days import Day, drawn, grid, on
from beaver_ftc.studies.recorded.run import kept_rows, settings_of

Document = dict[str, Any]

CHOSEN_ON, JUDGED_ON = range(8), range(8, 16)
_BESIDE = "sliding-least-squares"
_KEYS = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
_WORST = {"mean_error": max}


def run_other_days(folder: Path) -> Document:
    """The document: of each labelled data set a part, a row a day. Raises BadInput where none has labels."""
    labelled = [data for data in data_sets(folder) if np.isfinite(data.flights[0].labels).any()]
    if not labelled:
        raise BadInput(f"compare: --other-days: {folder} holds no labelled flight, allowed: one with labels")
    return {"sets": [_part(data) for data in labelled]}


def _part(data: DataSet) -> Document:
    stretches = stretches_of(data.flights)
    settings = settings_of(stretches, data)
    models = [(fit_model(fitted, data.vehicle, settings), kept) for fitted, kept, _ in folds(stretches)]
    whole = fit_model(stretches, data.vehicle, settings)
    surfaces = len(data.vehicle.surfaces)
    kinds = {
        "one change": grid(mixer(data.vehicle), list(data.vehicle.commands)),
        "drawn, settings chosen on these": drawn(surfaces, CHOSEN_ON),
        "drawn, not looked at": drawn(surfaces, JUDGED_ON),
    }
    rows = [row for kind, days in kinds.items() for row in _rows(kind, days, models, whole)]
    summaries = [_summary(kind, [row for row in rows if row["kind"] == kind]) for kind in kinds]
    return {"set": data.name, "rows": rows, "summary": summaries}


def _rows(
    kind: str, days: Sequence[Day], models: Sequence[tuple[Model, Stretch]], whole: Model
) -> Iterator[Document]:
    past, noise = whole.arrays()[1], whole.arrays()[3]
    for day in days:
        scores: dict[str, list[Document]] = {BANK: [], _BESIDE: []}
        for model, kept in models:
            altered = on(day, kept.samples, past, noise)
            labels = np.where(kept_rows(kept)[:, None], kept.samples.labels, np.nan)
            for name, found in scores.items():
                found.append(by_labels(diagnose_with(name, altered, model), labels))
        beside = tally.by_labels(scores[_BESIDE])["classes"]
        yield {"kind": kind, "day": day.name, **tally.by_labels(scores[BANK]), "beside": beside}


def _summary(kind: str, rows: Sequence[Document]) -> Document:
    """Mean and worst of each figure."""
    keys = (*_KEYS, "beside")
    worst = {key: _WORST.get(key, min)(row[key] for row in rows) for key in keys}
    return {
        "kind": kind,
        "mean": {key: float(np.mean([row[key] for row in rows])) for key in keys},
        "worst": worst,
    }


def tables(document: Document) -> list[tuple[str, tuple[list[str], list[list[str]]]]]:
    """A title and a table for each data set: every day, then mean and worst of each kind."""
    header = ["day", "classes", "healthy or faulty", "side", "mean error", "held by 90 % bounds",
              "classes by sliding least squares"]  # fmt: skip
    found = []
    for part in document["sets"]:
        cells = [[row["day"], *_cells(row)] for row in part["rows"] if row["kind"] == "one change"]
        for one in part["summary"]:
            cells += [[f"{one['kind']}: {what}", *_cells(one[what])] for what in ("mean", "worst")]
        found.append((f"{part['set']}: other days made of it, halves left out in turn", (header, cells)))
    return found


def _cells(row: Document) -> list[str]:
    return [f"{row[key]:.3f}" for key in (*_KEYS, "beside")]
