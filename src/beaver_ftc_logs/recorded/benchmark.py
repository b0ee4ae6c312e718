"""The benchmark on recorded flights: leave one out, identify from the others, diagnose the one.

The data sets of a folder are ENAC's tables beside their vehicle file and ALFA's folders of topics. Every
setting is frozen before the flight that is left out is looked at. Of a single flight, each half is left out
in turn, with settings fitted to the whole flight. Rivals stand beside ours.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.results import Document, as_json
from beaver_ftc.studies.engine import poisson
from beaver_ftc.studies.present import GRID, Files, aligned, markdown_table, marker, panels, replace_between
from beaver_ftc_logs import scoring
from beaver_ftc_logs.detectors import detector_names, diagnose_with, freeze
from beaver_ftc_logs.diagnose import Rows
from beaver_ftc_logs.fitting import Stretch, fit_model, folds, run_tests, stretches_of, trusted
from beaver_ftc_logs.model import Model, Settings
from beaver_ftc_logs.recording import Recording
from beaver_ftc_logs.samples import Samples, read_for, sample
from beaver_ftc_logs.scoring import ENGINE
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle

Table = tuple[list[str], list[list[str]]]
FIGURES = {
    "classes": "classes", "healthy_or_faulty": "healthy or faulty", "side": "side",
    "mean_error": "mean error", "held_by_bounds": "held by 90 % bounds",
}  # fmt: skip
PUBLISHED = Path(__file__).with_name("published.json")  # of each data set: what others found
SOON_S = 5.0
KINDS = ("aileron", "rudder", "elevator")
_KIND_OF = {"left_aileron": "aileron", "right_aileron": "aileron"}
OURS = "bank of filters (ours)"
FREEZE = "freeze rule, 6 s, on the logged outputs"
TITLES = {
    "bank-of-filters": OURS,
    "sliding-least-squares": "sliding least squares, 20 s",
    "forgetting-least-squares": "forgetting least squares, 20 s",
}
_LATEST_S = 30.0
VEHICLE_FILE = "vehicle.yaml"
_RAW = "*-mavros-imu-data_raw.csv"


@dataclass(frozen=True)
class DataSet:
    """Flights of one vehicle: as they were logged, and on one time base."""

    name: str
    vehicle: Vehicle
    recordings: tuple[Recording, ...]
    flights: tuple[Samples, ...]


def data_sets(folder: Path) -> list[DataSet]:
    """The data sets below a folder. Raises BadInput where there is none, or a flight cannot be used."""
    if not folder.is_dir():
        raise BadInput(f"compare: --flights {folder}: no such folder, allowed: a folder of recorded flights")
    found = [entry for path in (folder, *sorted(folder.iterdir())) if (entry := _data_set(path))]
    if not found:
        raise BadInput(
            f"compare: --flights {folder}: holds no data set, allowed: folders with tables and a "
            f"{VEHICLE_FILE}, or with processed folders of the ALFA data set"
        )
    return found


def _data_set(path: Path) -> DataSet | None:
    if not path.is_dir():
        return None
    if (path / VEHICLE_FILE).is_file():
        tables = sorted([*path.glob("*.csv"), *path.glob("*.parquet")])
        return _read(path.name, load_vehicle(path / VEHICLE_FILE), tables) if tables else None
    alfa = sorted(flight for flight in path.iterdir() if flight.is_dir() and any(flight.glob(_RAW)))
    return _read(path.name, load_vehicle("alfa"), alfa) if alfa else None


def _read(name: str, vehicle: Vehicle, paths: list[Path]) -> DataSet:
    recordings = tuple(read_for(path, vehicle) for path in paths)
    return DataSet(name, vehicle, recordings, tuple(sample(one, vehicle) for one in recordings))


def run_benchmark(folder: Path) -> Document:
    """The document of the benchmark: a part a data set, a row a method."""
    return {"sets": [_compare(one) for one in data_sets(folder)]}


def files_of(document: Document) -> Files:
    """The document, its tables and its figure."""
    return {
        "flights.png": figure_of(document),
        "flights.json": as_json(document),
        "flights.md": as_markdown(document),
    }


def _compare(data: DataSet) -> Document:
    stretches, alone = stretches_of(data.flights), len(data.flights) == 1
    # Neither half of a single flight has all levels of effectiveness, so the settings, and only they, are
    # fitted to the whole flight.
    whole = settings_of(stretches, data) if alone else None
    flights: list[Document] = []
    for fitted, kept, name in folds(stretches):
        model = trusted(fitted, fit_model(fitted, data.vehicle, whole))
        recording = next(one for one in data.recordings if one.name == kept.samples.name)
        flights += [
            {"left_out": name, "method": method, **_score(kept, rows, model)}
            for method, rows in _diagnosed(recording, kept, model)
        ]
    labelled = "classes" in flights[0]
    summarise = by_labels if labelled else by_events
    methods = dict.fromkeys(one["method"] for one in flights)
    rows_of = {m: [one for one in flights if one["method"] == m] for m in methods}
    return {
        "set": data.name,
        "vehicle": data.vehicle.name,
        "scored_by": "labels" if labelled else "events",
        "left_out": "halves of the one flight in turn" if alone else "each flight in turn",
        "rows": [{"method": method, **summarise(scores)} for method, scores in rows_of.items()],
        "published": json.loads(PUBLISHED.read_text(encoding="utf-8")).get(data.name, []),
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


def _score(kept: Stretch, rows: Rows, model: Model) -> Document:
    if np.isfinite(kept.samples.labels).any():
        return scoring.by_labels(rows, kept_labels(kept))
    return scoring.by_event(rows, kept.samples.events, model.groups)


def kept_labels(kept: Stretch) -> np.ndarray:
    """Labels in the whole span of what is kept, their edges included: they count in the score; else NaN."""
    used, labels = np.flatnonzero(kept.use), np.full_like(kept.samples.labels, np.nan)
    if used.size:
        span = slice(used[0], used[-1] + 1)
        labels[span] = kept.samples.labels[span]
    return labels


def by_events(scores: Sequence[Document]) -> Document:
    """From each flight's score against its failure. A flight whose surface failed is found if an alarm comes
    after; a flight with an alarm before its failure, or without any failure, counts as a false one."""
    failed = [one for one in scores if one["failure"]]
    engine = [one for one in failed if ENGINE in one["failure"]]
    surface = [one for one in failed if ENGINE not in one["failure"]]
    found = [one for one in surface if one["detected"]]
    falsely = [one for one in scores if one["false_alarms"]]
    healthy = [one for one in scores if one["failure"] is None]
    quiet = [one for one in healthy if not one["false_alarms"]]
    hours = sum(one["healthy_s"] for one in scores) / 3600.0
    alarms = poisson(sum(one["false_alarms"] for one in scores), hours)
    right = len(found) + len(quiet)
    return {
        "surface_failures": len(surface),
        "found": len(found),
        "precision": len(found) / max(len(found) + len(falsely), 1),
        "recall": len(found) / max(len(surface), 1),
        "accuracy": right / max(len(surface) + len(healthy), 1),
        "healthy_flights": len(healthy),
        "healthy_flights_with_an_alarm": len(healthy) - len(quiet),
        "false_alarms_per_hour": {"value": alarms.value, "low": alarms.low, "high": alarms.high},
        "healthy_hours": hours,
        "wrong_group": sum(one["right_group"] is False for one in found),
        "delay_s": {kind: _delays(surface, kind) for kind in KINDS},
        "engine_failures_with_an_alarm": sum(one["detected"] for one in engine),
    }


def _delays(surface: Sequence[Document], kind: str) -> Document:
    """Where several fail in one flight, the first in the alphabet counts: an aileron before a rudder."""
    ours = [one for one in surface if min(_KIND_OF.get(s, s) for s in one["failure"].split("+")) == kind]
    delays = [one["delay_s"] for one in ours if one["detected"]]
    return {
        "failures": len(ours),
        "found": len(delays),
        "within_5_s": sum(delay <= SOON_S for delay in delays),
        "mean": float(np.mean(delays)) if delays else None,
    }


def by_labels(scores: Sequence[Document]) -> Document:
    """Mean of the figures over the parts that were left out, weighted by their rows."""
    weights = np.array([one["rows"] for one in scores], dtype=float)
    means = {key: float(np.average([one[key] for one in scores], weights=weights)) for key in FIGURES}
    return means | {"rows": int(weights.sum())}


def tables(document: Document) -> list[tuple[str, Table]]:
    """A title and a table for each data set."""
    if "other_days" in document:
        return _of_days(document["other_days"])
    found = []
    for part in document["sets"]:
        header, row_of = (LABELS, _label_row) if part["scored_by"] == "labels" else (EVENTS, _event_row)
        rows = [row_of(row) for row in (*part["rows"], *part["published"])]
        found.append((f"{part['set']}: left out, {part['left_out']}", (header, rows)))
    return found


def _of_days(document: Document) -> list[tuple[str, Table]]:
    """A title and a table for each data set: every day, then mean and worst of each kind."""
    header = ["day", *FIGURES.values(), "classes by sliding least squares"]
    found = []
    for part in document["sets"]:
        cells = [[row["day"], *_cells(row)] for row in part["rows"] if row["kind"] == "one change"]
        for one in part["summary"]:
            cells += [[f"{one['kind']}: {what}", *_cells(one[what])] for what in ("mean", "worst")]
        found.append((f"{part['set']}: other days made of it, halves left out in turn", (header, cells)))
    return found


def _cells(row: Document) -> list[str]:
    return [f"{row[key]:.3f}" for key in (*FIGURES, "beside")]


LABELS = ["method", *FIGURES.values()]
EVENTS = [
    "method", "precision", "recall", "accuracy", "mean delay, s: aileron", "rudder", "elevator",
    "ailerons and rudders within 5 s", "false alarms an hour (95 %)", "healthy flights with an alarm",
    "wrong group",
]  # fmt: skip


def _label_row(row: Document) -> list[str]:
    return [row["method"], *_shares(row, FIGURES)]


def _event_row(row: Document) -> list[str]:
    """Of what others published only some is known."""
    delays = [row["delay_s"].get(kind, {}) for kind in KINDS]
    cells = [row["method"], *_shares(row, EVENTS[1:4]), *map(_delay, delays)]
    if "false_alarms_per_hour" not in row:
        return cells + [""] * (len(EVENTS) - len(cells))
    soon, failures = (sum(of[key] for of in delays[:2]) for key in ("within_5_s", "failures"))
    alarms = row["false_alarms_per_hour"]
    return [
        *cells,
        f"{soon} of {failures}",
        f"{alarms['value']:.1f} ({alarms['low']:.1f} to {alarms['high']:.1f})",
        f"{row['healthy_flights_with_an_alarm']} of {row['healthy_flights']}",
        str(row["wrong_group"]),
    ]


def _shares(row: Document, keys: Iterable[str]) -> list[str]:
    return ["" if row.get(key) is None else f"{row[key]:.3f}" for key in keys]


def _delay(of: Document) -> str:
    if of.get("mean") is None:
        return "not found" if of.get("failures") else ""
    count = f" ({of['found']} of {of['failures']})" if "found" in of else ""
    return f"{of['mean']:.1f}{count}"


def as_text(document: Document) -> str:
    """The tables for a terminal."""
    return "\n".join(f"{title}\n{aligned([head, *rows])}\n" for title, (head, rows) in tables(document))


def as_markdown(document: Document) -> str:
    """The tables for a Markdown page."""
    found = tables(document)
    return "\n".join(f"### {title}\n\n{markdown_table(head, rows)}\n" for title, (head, rows) in found)


def marks(document: Document) -> tuple[str, str]:
    """What stands before and after the tables in a page."""
    name = "other days" if "other_days" in document else "recorded flights"
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def update_page(document: Document, page: Path) -> None:
    """Put the tables between the marks of a Markdown page. Raises BadInput where it has none."""
    replace_between(page, *marks(document), as_markdown(document))


def figure_of(document: Document) -> Any:
    """How late each method found each failure, and how near it came to the labels: a panel a data set."""
    sets = document["sets"]
    figure, grid = panels(len(sets), 1, 8.6, sum(0.27 * len(_methods(part)) + 1.3 for part in sets))
    for axis, part in zip(grid[:, 0], sets, strict=True):
        draw = _draw_labels if part["scored_by"] == "labels" else _draw_events
        draw(axis, part)
        axis.set_title(f"{part['set']}: left out, {part['left_out']}", fontsize=10, loc="left")
        axis.set_yticks(range(len(_methods(part))), _methods(part))
        axis.set_ylim(len(_methods(part)) - 0.5, -0.5)
        axis.tick_params(labelsize=8)
        axis.grid(color=GRID, linewidth=0.5)
        axis.set_axisbelow(True)
        axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def _methods(part: Document) -> list[str]:
    return [row["method"] for row in (*part["rows"], *part.get("published", ()))]


def _draw_events(axis: Any, part: Document) -> None:
    """A line a method, a mark a failed surface at its delay; right of the line what is not found in time."""
    methods = _methods(part)
    named = {one["left_out"]: one["failure"] for one in part["flights"]}
    surfaces = [failure for failure in dict.fromkeys(named.values()) if failure and ENGINE not in failure]
    for i, surface in enumerate(surfaces):
        mine = [one for one in part["flights"] if one["failure"] == surface and one["method"] in methods]
        delays = [_LATEST_S + 1.0 if one["delay_s"] is None else one["delay_s"] for one in mine]
        heights = [methods.index(one["method"]) + 0.7 * ((i + 0.5) / len(surfaces) - 0.5) for one in mine]
        label = surface.replace("_", " ").replace("+", " + ")
        axis.plot(
            [min(delay, _LATEST_S + 1.0) for delay in delays],
            heights,
            marker(i),
            color=SERIES[i],
            label=label,
        )
    axis.axvspan(_LATEST_S, _LATEST_S + 2.0, color=GRID)
    axis.set_xlim(-0.5, _LATEST_S + 2.0)
    axis.set_xlabel(f"delay, s (grey: not found within {_LATEST_S:g} s)", fontsize=9)


def _draw_labels(axis: Any, part: Document) -> None:
    """A line a method, a mark for each share of the rows that are right; as published where they are."""
    keys = {"classes": "class", "healthy_or_faulty": "healthy or faulty", "side": "side of the aircraft"}
    rows = [*part["rows"], *part["published"]]
    for i, (key, label) in enumerate(keys.items()):
        known = [place for place, row in enumerate(rows) if row.get(key) is not None]
        heights = [place + 0.22 * (i - 1) for place in known]
        axis.plot([rows[place][key] for place in known], heights, marker(i), color=SERIES[i], label=label)
    axis.set_xlim(0, 1)
    axis.set_xlabel("share of the rows that are right", fontsize=9)
