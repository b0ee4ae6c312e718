"""The benchmark on recorded flights: leave one flight out, identify from the others, diagnose the one left
out.

The data sets of a folder are ENAC's tables with their vehicle file, and ALFA's folders of topics. Of several
flights, every setting is fixed before the flight left out is read. Of a single flight, each half is left out
in turn, with settings fitted to the whole flight. Other detectors are compared with ours.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from beaver_ftc.documents import read_json
from beaver_ftc.results import Document
from beaver_ftc.studies.engine import poisson
from beaver_ftc_logs import scoring
from beaver_ftc_logs.detectors import detector_names, diagnose_by_freeze_rule, diagnose_with_detector
from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.fit_parts import FitPart, fit_parts
from beaver_ftc_logs.fitting import fit_model
from beaver_ftc_logs.folds import validation_folds
from beaver_ftc_logs.loading import read_vehicle_columns
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import FilterSettings, Model
from beaver_ftc_logs.recording import RecordedFlight
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.replay import is_log_of_run
from beaver_ftc_logs.samples import Samples, resample
from beaver_ftc_logs.validation import add_ranges_and_threshold, score_folds
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle

LABEL_TITLES = {
    "classes": "classes", "healthy_or_faulty": "healthy or faulty", "side": "side",
    "mean_error": "mean error", "held_by_bounds": "held by 90 % bounds",
}  # fmt: skip
PUBLISHED_SCORES_FILE = Path(__file__).with_name("published.json")  # published results for each data set
MAX_SHORT_DELAY_S = 5.0  # the limit of the key `within_5_s`
SURFACE_KINDS = ("aileron", "rudder", "elevator")
_KIND_OF_SURFACE = {"left_aileron": "aileron", "right_aileron": "aileron"}
OUR_METHOD_TITLE = "bank of filters (ours)"
FREEZE_RULE_TITLE = "freeze rule, 6 s, on the logged outputs"
METHOD_TITLES = {
    "bank-of-filters": OUR_METHOD_TITLE,
    "sliding-least-squares": "sliding least squares, 20 s",
    "forgetting-least-squares": "forgetting least squares, 20 s",
}
VEHICLE_FILE = "vehicle.yaml"
_ALFA_GYRO_FILES = "*-mavros-imu-data_raw.csv"


@dataclass(frozen=True)
class DataSet:
    """Flights of one vehicle: as they were logged, and on one time base."""

    name: str
    vehicle: Vehicle
    recordings: tuple[RecordedFlight, ...]
    flights: tuple[Samples, ...]


def load_data_sets(folder: Path) -> list[DataSet]:
    """The data sets below a folder. Raises BadInput where there is none, or a flight cannot be used."""
    if not folder.is_dir():
        raise refusal("compare", f"--flights {folder}: no such folder", "a folder of recorded flights")
    data_sets = [data for path in (folder, *sorted(folder.iterdir())) if (data := _load_data_set(path))]
    if not data_sets:
        raise refusal(
            "compare",
            f"--flights {folder}: holds no data set",
            f"folders with tables and a {VEHICLE_FILE}, or with processed folders of the ALFA data set",
        )
    return data_sets


def _load_data_set(path: Path) -> DataSet | None:
    """The data set in a folder: tables beside a vehicle file, or ALFA flights; None for another folder."""
    if not path.is_dir():
        return None
    if (path / VEHICLE_FILE).is_file():
        tables = (*path.glob("*.csv"), *path.glob("*.parquet"))
        paths = sorted(table for table in tables if not is_log_of_run(table))  # its flight lies beside it
        return _read_data_set(path.name, load_vehicle(path / VEHICLE_FILE), paths) if paths else None
    folders = sorted(sub for sub in path.iterdir() if sub.is_dir() and any(sub.glob(_ALFA_GYRO_FILES)))
    return _read_data_set(path.name, load_vehicle("alfa"), folders) if folders else None


def _read_data_set(name: str, vehicle: Vehicle, paths: list[Path]) -> DataSet:
    """The data set of some logs."""
    recordings = tuple(read_vehicle_columns(path, vehicle) for path in paths)
    return DataSet(name, vehicle, recordings, tuple(resample(log, vehicle) for log in recordings))


def run_benchmark(folder: Path) -> Document:
    """The document of the benchmark: an entry for each data set, with a row for each method."""
    return {"sets": [_compare_methods(data) for data in load_data_sets(folder)]}


def _compare_methods(data: DataSet) -> Document:
    """The document of a data set: the scores of each method on each part that was left out of the fit."""
    usable = fit_parts(data.flights)
    settings = settings_of_single(usable, data)
    entries: list[Document] = []
    for fitted, held_out, name in validation_folds(usable):
        model = add_ranges_and_threshold(fitted, fit_model(fitted, data.vehicle, settings))
        log = next(log for log in data.recordings if log.name == held_out.samples.name)
        for title, rows in _diagnose_each(log, held_out, model):
            scores = _score_against_log(held_out, rows, model)
            entries.append({"left_out": name, "method": title, **scores})
    by_labels = "classes" in entries[0]
    summarize = summarize_labels if by_labels else summarize_failures
    titles = dict.fromkeys(entry["method"] for entry in entries)
    by_method = {title: [entry for entry in entries if entry["method"] == title] for title in titles}
    return {
        "set": data.name,
        "vehicle": data.vehicle.name,
        "scored_by": "labels" if by_labels else "events",
        "left_out": "each flight in turn" if settings is None else "halves of the one flight in turn",
        "rows": [{"method": title, **summarize(scores)} for title, scores in by_method.items()],
        "published": read_json(PUBLISHED_SCORES_FILE).get(data.name, []),
        "flights": entries,
    }


def _diagnose_each(log: RecordedFlight, held_out: FitPart, model: Model) -> Iterator[tuple[str, LogRows]]:
    """For each detector its title and its rows; also for the freeze rule if the log has servo outputs."""
    for name in detector_names():
        title = METHOD_TITLES.get(name, f"{name}, of the loop")
        yield title, diagnose_with_detector(name, held_out.samples, model)
    frozen = diagnose_by_freeze_rule(log, held_out.samples, model)
    if frozen is not None:
        yield FREEZE_RULE_TITLE, frozen


def settings_of_single(usable: list[FitPart], data: DataSet) -> FilterSettings | None:
    """The settings for a data set of a single flight, whose halves are judged in turn: all, such as levels,
    rate of changes and mass of the bounds, are fitted to the whole flight, since neither half has all levels.
    None if there are several flights.
    """
    if len(data.flights) > 1:
        return None
    model = fit_model(usable, data.vehicle)
    return model.settings.model_copy(update={"bounds": score_folds(usable, model)[1]})


def _score_against_log(held_out: FitPart, rows: LogRows, model: Model) -> Document:
    """The scores by the labels of a log or, without labels, by its failures."""
    if np.isfinite(held_out.samples.labels).any():
        return scoring.score_against_labels(rows, labels_in_span(held_out))
    return scoring.score_against_failures(rows, held_out.samples.logged_failures, model.groups)


def labels_in_span(held_out: FitPart) -> np.ndarray:
    """Labels from the first usable row to the last, and NaN elsewhere. Rows between them count in the score,
    even if the fit does not use them.
    """
    rows = np.flatnonzero(held_out.is_usable)
    labels = np.full_like(held_out.samples.labels, np.nan)
    if rows.size:
        span = slice(rows[0], rows[-1] + 1)
        labels[span] = held_out.samples.labels[span]
    return labels


def summarize_failures(scores: Sequence[Document]) -> Document:
    """Summary of the scores of flights against their failures.

    found       flights with a failed surface and an alarm after the failure
    false       flights with an alarm before their failure, or without any failure
    quiet       flights without a failure and without an alarm

    precision = found / (found + false), recall = found / failed, accuracy = (found + quiet) / (failed +
    healthy). Failures of the engine are counted apart.
    """
    failures = [score for score in scores if score["failure"]]
    engine = [score for score in failures if ENGINE in score["failure"]]
    failed = [score for score in failures if ENGINE not in score["failure"]]
    found = [score for score in failed if score["detected"]]
    false = [score for score in scores if score["false_alarms"]]
    healthy = [score for score in scores if score["failure"] is None]
    quiet = [score for score in healthy if not score["false_alarms"]]
    hours = sum(score["healthy_s"] for score in scores) / 3600.0
    rate = poisson(sum(score["false_alarms"] for score in scores), hours)
    n_right = len(found) + len(quiet)
    return {
        "surface_failures": len(failed),
        "found": len(found),
        "precision": len(found) / max(len(found) + len(false), 1),
        "recall": len(found) / max(len(failed), 1),
        "accuracy": n_right / max(len(failed) + len(healthy), 1),
        "healthy_flights": len(healthy),
        "healthy_flights_with_an_alarm": len(healthy) - len(quiet),
        "false_alarms_per_hour": asdict(rate),
        "healthy_hours": hours,
        "wrong_group": sum(score["right_group"] is False for score in found),
        "delay_s": {kind: _summarize_delays(failed, kind) for kind in SURFACE_KINDS},
        "engine_failures_with_an_alarm": sum(score["detected"] for score in engine),
    }


def _summarize_delays(failed: Sequence[Document], kind: str) -> Document:
    """Summary of the delays of failures of one kind of surface. If several kinds fail in one flight, the
    first in the alphabet counts: an aileron before a rudder.
    """
    kinds = [
        min(_KIND_OF_SURFACE.get(name, name) for name in score["failure"].split("+")) for score in failed
    ]
    delays_s = [score["delay_s"] for score, first in zip(failed, kinds, strict=True) if first == kind]
    found = [delay for delay in delays_s if delay is not None]
    return {
        "failures": len(delays_s),
        "found": len(found),
        "within_5_s": sum(delay <= MAX_SHORT_DELAY_S for delay in found),
        "mean": float(np.mean(found)) if found else None,
    }


def summarize_labels(parts: Sequence[Document]) -> Document:
    """Means of the scores over the parts left out, weighted by their rows; None without rows."""
    parts = [part for part in parts if part["rows"]]
    if not parts:
        return {**dict.fromkeys(LABEL_TITLES), "rows": 0}
    counts = np.array([part["rows"] for part in parts], dtype=float)
    means = {key: float(np.average([part[key] for part in parts], weights=counts)) for key in LABEL_TITLES}
    return means | {"rows": int(counts.sum())}
