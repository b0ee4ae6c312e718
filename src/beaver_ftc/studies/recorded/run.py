"""Leave one flight out: identify from the others, freeze every setting, diagnose the one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.flights.detectors import detector_names, diagnose_with
from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.flights.identify import Stretch, fit_model, stretches_of
from beaver_ftc.flights.model import Model, Settings
from beaver_ftc.flights.plain import freeze
from beaver_ftc.flights.recording import Recording
from beaver_ftc.flights.scoring import by_event, by_labels
from beaver_ftc.flights.testing import folds, run_tests
from beaver_ftc.studies.recorded import tally
from beaver_ftc.studies.recorded.data import DataSet, data_sets

Document = dict[str, Any]

OURS = "bank of filters (ours)"
FREEZE = "freeze rule, 6 s, on the logged outputs"
TITLES = {
    "bank-of-filters": OURS,
    "sliding-least-squares": "sliding least squares, 20 s",
    "forgetting-least-squares": "forgetting least squares, 20 s",
}
PUBLISHED: dict[str, list[Document]] = {
    "alfa": [
        {
            "method": "recursive least-squares monitor [Keipour2019], 22 flights, as published",
            "precision": 0.88,
            "recall": 0.88,
            "accuracy": 0.86,
            "delay_s": {"rudder": {"mean": 0.21}, "elevator": {"mean": 0.36}, "aileron": {"mean": 3.3}},
        }
    ],
    "enac": [
        {"method": "support vector machine [Bronz2020], within one flight, as published", "classes": 0.94},
        {"method": "support vector machine [Bronz2020], two days later, as published", "classes": 0.48},
    ],
}


def run_benchmark(folder: Path) -> Document:
    """The document of the benchmark: a part a data set, a row a method."""
    return {"sets": [_compare(one) for one in data_sets(folder)]}


def _compare(data: DataSet) -> Document:
    stretches = stretches_of(data.flights)
    whole = settings_of(stretches, data)
    flights: list[Document] = []
    for fitted, kept, name in folds(stretches):
        model = _frozen(fitted, data, whole)
        recording = next(one for one in data.recordings if one.name == kept.samples.name)
        flights += [
            {"left_out": name, "method": method, **_score(kept, rows, model)}
            for method, rows in _diagnosed(recording, kept, model)
        ]
    labelled = "classes" in flights[0]
    summarise = tally.by_labels if labelled else tally.by_events
    methods = dict.fromkeys(one["method"] for one in flights)
    rows_of = {m: [one for one in flights if one["method"] == m] for m in methods}
    return {
        "set": data.name,
        "vehicle": data.vehicle.name,
        "scored_by": "labels" if labelled else "events",
        "left_out": "halves of the one flight in turn" if len(data.flights) == 1 else "each flight in turn",
        "rows": [{"method": method, **summarise(scores)} for method, scores in rows_of.items()],
        "published": PUBLISHED.get(data.name, []),
        "flights": flights,
    }


def _diagnosed(recording: Recording, kept: Stretch, model: Model) -> Iterator[tuple[str, Rows]]:
    """Every detector's rows, and the freeze rule's where the log has servo outputs."""
    for name in detector_names():
        yield TITLES.get(name, f"{name}, of the loop"), diagnose_with(name, kept.samples, model)
    frozen = freeze(recording, kept.samples, model)
    if frozen is not None:
        yield FREEZE, frozen


def settings_of(stretches: list[Stretch], data: DataSet) -> Settings:
    """What a single flight says as a whole: levels, rate of change, and the mass of the bounds."""
    model = fit_model(stretches, data.vehicle)
    if len(stretches) > 1:
        return model.settings
    return model.settings.model_copy(update={"bounds": run_tests(stretches, model)[1]})


def _frozen(fitted: list[Stretch], data: DataSet, whole: Settings) -> Model:
    """A model of the flights that are not left out, settings included.

    Of one flight's halves neither shows all the levels that the test is about: there the settings, and only
    they, are those of the whole.
    """
    return fit_model(fitted, data.vehicle, whole if len(data.flights) == 1 else None)


def _score(kept: Stretch, rows: Rows, model: Model) -> Document:
    if np.isfinite(kept.samples.labels).any():
        return by_labels(rows, np.where(kept_rows(kept)[:, None], kept.samples.labels, np.nan))
    return by_event(rows, kept.samples.events, model.groups)


def kept_rows(kept: Stretch) -> np.ndarray:
    """The whole span of what is kept, edges of labels included: they count in the score."""
    used = np.flatnonzero(kept.use)
    span = np.zeros(len(kept.use), dtype=bool)
    if used.size:
        span[used[0] : used[-1] + 1] = True
    return span
