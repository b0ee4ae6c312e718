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
from beaver_ftc_logs.detectors import detector_names, diagnose_by_freeze_rule, diagnose_with_detector
from beaver_ftc_logs.diagnose import DiagnosisRows
from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.fitting import (
    FlightWithUsableRows,
    add_fitted_ranges_and_alarm_threshold,
    fit_model,
    flights_with_usable_rows,
    score_folds_and_choose_credible_mass,
    validation_folds,
)
from beaver_ftc_logs.model import FilterSettings, Model
from beaver_ftc_logs.recording import RecordedFlight
from beaver_ftc_logs.samples import Samples, read_columns_of_vehicle, resample
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle

HeaderAndRows = tuple[list[str], list[list[str]]]
LABEL_SCORE_TITLES = {
    "classes": "classes", "healthy_or_faulty": "healthy or faulty", "side": "side",
    "mean_error": "mean error", "held_by_bounds": "held by 90 % bounds",
}  # fmt: skip
PUBLISHED_SCORES_FILE = Path(__file__).with_name("published.json")  # of each data set: what others found
MAX_SHORT_DELAY_S = 5.0
SURFACE_KINDS = ("aileron", "rudder", "elevator")
_KIND_OF_SURFACE = {"left_aileron": "aileron", "right_aileron": "aileron"}
OUR_METHOD_TITLE = "bank of filters (ours)"
FROZEN_OUTPUT_RULE_TITLE = "freeze rule, 6 s, on the logged outputs"
METHOD_TITLE_BY_DETECTOR_NAME = {
    "bank-of-filters": OUR_METHOD_TITLE,
    "sliding-least-squares": "sliding least squares, 20 s",
    "forgetting-least-squares": "forgetting least squares, 20 s",
}
_MAX_SHOWN_DELAY_S = 30.0
VEHICLE_FILE = "vehicle.yaml"
_ALFA_GYRO_FILE_PATTERN = "*-mavros-imu-data_raw.csv"


@dataclass(frozen=True)
class FlightDataSet:
    """Flights of one vehicle: as they were logged, and on one time base."""

    name: str
    vehicle: Vehicle
    recordings: tuple[RecordedFlight, ...]
    flights: tuple[Samples, ...]


def load_data_sets(folder: Path) -> list[FlightDataSet]:
    """The data sets below a folder. Raises BadInput where there is none, or a flight cannot be used."""
    if not folder.is_dir():
        raise BadInput(f"compare: --flights {folder}: no such folder, allowed: a folder of recorded flights")
    data_sets = [
        data_set for path in (folder, *sorted(folder.iterdir())) if (data_set := _load_data_set(path))
    ]
    if not data_sets:
        raise BadInput(
            f"compare: --flights {folder}: holds no data set, allowed: folders with tables and a "
            f"{VEHICLE_FILE}, or with processed folders of the ALFA data set"
        )
    return data_sets


def _load_data_set(path: Path) -> FlightDataSet | None:
    if not path.is_dir():
        return None
    if (path / VEHICLE_FILE).is_file():
        table_paths = sorted([*path.glob("*.csv"), *path.glob("*.parquet")])
        return (
            _read_data_set(path.name, load_vehicle(path / VEHICLE_FILE), table_paths) if table_paths else None
        )
    alfa_flight_folders = sorted(
        flight_folder
        for flight_folder in path.iterdir()
        if flight_folder.is_dir() and any(flight_folder.glob(_ALFA_GYRO_FILE_PATTERN))
    )
    return (
        _read_data_set(path.name, load_vehicle("alfa"), alfa_flight_folders) if alfa_flight_folders else None
    )


def _read_data_set(name: str, vehicle: Vehicle, paths: list[Path]) -> FlightDataSet:
    recordings = tuple(read_columns_of_vehicle(path, vehicle) for path in paths)
    return FlightDataSet(
        name, vehicle, recordings, tuple(resample(recording, vehicle) for recording in recordings)
    )


def run_benchmark(folder: Path) -> Document:
    """The document of the benchmark: a part a data set, a row a method."""
    return {"sets": [_compare_methods(data_set) for data_set in load_data_sets(folder)]}


def result_files(document: Document) -> Files:
    """The document, its tables and its figure."""
    return {
        "flights.png": draw_comparison_figure(document),
        "flights.json": as_json(document),
        "flights.md": as_markdown(document),
    }


def _compare_methods(data_set: FlightDataSet) -> Document:
    flights_with_usable_mask = flights_with_usable_rows(data_set.flights)
    is_single_flight = len(data_set.flights) == 1
    # Neither half of a single flight has all levels of effectiveness, so the settings, and only they, are
    # fitted to the whole flight.
    whole_flight_settings = (
        settings_of_whole_flight(flights_with_usable_mask, data_set) if is_single_flight else None
    )
    flight_entries: list[Document] = []
    for fitted_flights, held_out, held_out_name in validation_folds(flights_with_usable_mask):
        model = add_fitted_ranges_and_alarm_threshold(
            fitted_flights, fit_model(fitted_flights, data_set.vehicle, whole_flight_settings)
        )
        recording = next(
            recording for recording in data_set.recordings if recording.name == held_out.samples.name
        )
        flight_entries += [
            {"left_out": held_out_name, "method": method_title, **_score_against_log(held_out, rows, model)}
            for method_title, rows in _diagnose_with_each_method(recording, held_out, model)
        ]
    is_scored_by_labels = "classes" in flight_entries[0]
    summarize = summarize_label_scores if is_scored_by_labels else summarize_failure_scores
    method_titles = dict.fromkeys(entry["method"] for entry in flight_entries)
    flight_entries_by_method = {
        method_title: [entry for entry in flight_entries if entry["method"] == method_title]
        for method_title in method_titles
    }
    return {
        "set": data_set.name,
        "vehicle": data_set.vehicle.name,
        "scored_by": "labels" if is_scored_by_labels else "events",
        "left_out": "halves of the one flight in turn" if is_single_flight else "each flight in turn",
        "rows": [
            {"method": method_title, **summarize(scores)}
            for method_title, scores in flight_entries_by_method.items()
        ],
        "published": json.loads(PUBLISHED_SCORES_FILE.read_text(encoding="utf-8")).get(data_set.name, []),
        "flights": flight_entries,
    }


def _diagnose_with_each_method(
    recording: RecordedFlight, held_out: FlightWithUsableRows, model: Model
) -> Iterator[tuple[str, DiagnosisRows]]:
    """Every detector's rows, and the freeze rule's where the log has servo outputs."""
    for name in detector_names():
        yield (
            METHOD_TITLE_BY_DETECTOR_NAME.get(name, f"{name}, of the loop"),
            diagnose_with_detector(name, held_out.samples, model),
        )
    frozen_output_rule_rows = diagnose_by_freeze_rule(recording, held_out.samples, model)
    if frozen_output_rule_rows is not None:
        yield FROZEN_OUTPUT_RULE_TITLE, frozen_output_rule_rows


def settings_of_whole_flight(
    flights_with_usable_mask: list[FlightWithUsableRows], data_set: FlightDataSet
) -> FilterSettings:
    """Return the settings fitted to a whole flight: levels, rate of change, and the mass of the bounds."""
    model = fit_model(flights_with_usable_mask, data_set.vehicle)
    if len(flights_with_usable_mask) > 1:
        return model.settings
    return model.settings.model_copy(
        update={"credible_mass": score_folds_and_choose_credible_mass(flights_with_usable_mask, model)[1]}
    )


def _score_against_log(held_out: FlightWithUsableRows, rows: DiagnosisRows, model: Model) -> Document:
    if np.isfinite(held_out.samples.labels).any():
        return scoring.score_against_labels(rows, labels_nan_outside_usable_span(held_out))
    return scoring.score_against_failures(rows, held_out.samples.logged_failures, model.groups)


def labels_nan_outside_usable_span(held_out: FlightWithUsableRows) -> np.ndarray:
    """Labels from the first usable row to the last, those of rows between that the fit does not use included:
    they count in the score. NaN elsewhere."""
    usable_rows, labels = np.flatnonzero(held_out.is_usable), np.full_like(held_out.samples.labels, np.nan)
    if usable_rows.size:
        row_span = slice(usable_rows[0], usable_rows[-1] + 1)
        labels[row_span] = held_out.samples.labels[row_span]
    return labels


def summarize_failure_scores(flight_scores: Sequence[Document]) -> Document:
    """From each flight's score against its failure. A flight whose surface failed is found if an alarm comes
    after; a flight with an alarm before its failure, or without any failure, counts as a false one."""
    failed_flights = [score for score in flight_scores if score["failure"]]
    engine_failures = [score for score in failed_flights if ENGINE in score["failure"]]
    surface_failures = [score for score in failed_flights if ENGINE not in score["failure"]]
    detected_surface_failures = [score for score in surface_failures if score["detected"]]
    false_alarm_flights = [score for score in flight_scores if score["false_alarms"]]
    healthy_flights = [score for score in flight_scores if score["failure"] is None]
    quiet_healthy_flights = [score for score in healthy_flights if not score["false_alarms"]]
    healthy_hours = sum(score["healthy_s"] for score in flight_scores) / 3600.0
    false_alarm_rate_and_interval = poisson(
        sum(score["false_alarms"] for score in flight_scores), healthy_hours
    )
    n_detected_or_quiet_flights = len(detected_surface_failures) + len(quiet_healthy_flights)
    return {
        "surface_failures": len(surface_failures),
        "found": len(detected_surface_failures),
        "precision": len(detected_surface_failures)
        / max(len(detected_surface_failures) + len(false_alarm_flights), 1),
        "recall": len(detected_surface_failures) / max(len(surface_failures), 1),
        "accuracy": n_detected_or_quiet_flights / max(len(surface_failures) + len(healthy_flights), 1),
        "healthy_flights": len(healthy_flights),
        "healthy_flights_with_an_alarm": len(healthy_flights) - len(quiet_healthy_flights),
        "false_alarms_per_hour": {
            "value": false_alarm_rate_and_interval.value,
            "low": false_alarm_rate_and_interval.low,
            "high": false_alarm_rate_and_interval.high,
        },
        "healthy_hours": healthy_hours,
        "wrong_group": sum(score["right_group"] is False for score in detected_surface_failures),
        "delay_s": {
            surface_kind: _summarize_delays(surface_failures, surface_kind) for surface_kind in SURFACE_KINDS
        },
        "engine_failures_with_an_alarm": sum(score["detected"] for score in engine_failures),
    }


def _summarize_delays(surface_failures: Sequence[Document], surface_kind: str) -> Document:
    """Summarize the delays of a kind of surface. Where several fail in one flight, the first in the alphabet
    counts: an aileron before a rudder."""
    failures_of_kind = [
        failure_score
        for failure_score in surface_failures
        if min(
            _KIND_OF_SURFACE.get(failed_surface, failed_surface)
            for failed_surface in failure_score["failure"].split("+")
        )
        == surface_kind
    ]
    delays_s = [failure_score["delay_s"] for failure_score in failures_of_kind if failure_score["detected"]]
    return {
        "failures": len(failures_of_kind),
        "found": len(delays_s),
        "within_5_s": sum(delay <= MAX_SHORT_DELAY_S for delay in delays_s),
        "mean": float(np.mean(delays_s)) if delays_s else None,
    }


def summarize_label_scores(part_scores: Sequence[Document]) -> Document:
    """Mean of the figures over the parts that were left out, weighted by their rows; None without rows."""
    part_scores = [part_score for part_score in part_scores if part_score["rows"]]
    if not part_scores:
        return {**dict.fromkeys(LABEL_SCORE_TITLES), "rows": 0}
    row_counts = np.array([part_score["rows"] for part_score in part_scores], dtype=float)
    means = {
        key: float(np.average([part_score[key] for part_score in part_scores], weights=row_counts))
        for key in LABEL_SCORE_TITLES
    }
    return means | {"rows": int(row_counts.sum())}


def score_tables(document: Document) -> list[tuple[str, HeaderAndRows]]:
    """A title and a table for each data set."""
    if "other_days" in document:
        return _tables_of_other_days(document["other_days"])
    titles_and_tables = []
    for data_set in document["sets"]:
        header, format_row = (
            (LABEL_TABLE_HEADER, _label_score_cells)
            if data_set["scored_by"] == "labels"
            else (FAILURE_TABLE_HEADER, _failure_score_cells)
        )
        rows = [format_row(method_scores) for method_scores in (*data_set["rows"], *data_set["published"])]
        titles_and_tables.append((f"{data_set['set']}: left out, {data_set['left_out']}", (header, rows)))
    return titles_and_tables


def _tables_of_other_days(document: Document) -> list[tuple[str, HeaderAndRows]]:
    """A title and a table for each data set: every day, then mean and worst of each kind."""
    header = ["day", *LABEL_SCORE_TITLES.values(), "classes by sliding least squares"]
    titles_and_tables = []
    for data_set in document["sets"]:
        day_and_summary_rows = [
            [one_day_scores["day"], *_day_score_cells(one_day_scores)]
            for one_day_scores in data_set["rows"]
            if one_day_scores["kind"] == "one change"
        ]
        for day_kind_summary in data_set["summary"]:
            day_and_summary_rows += [
                [f"{day_kind_summary['kind']}: {statistic}", *_day_score_cells(day_kind_summary[statistic])]
                for statistic in ("mean", "worst")
            ]
        titles_and_tables.append(
            (
                f"{data_set['set']}: other days made of it, halves left out in turn",
                (header, day_and_summary_rows),
            )
        )
    return titles_and_tables


def _day_score_cells(one_day_scores: Document) -> list[str]:
    return [f"{one_day_scores[key]:.3f}" for key in (*LABEL_SCORE_TITLES, "beside")]


LABEL_TABLE_HEADER = ["method", *LABEL_SCORE_TITLES.values()]
FAILURE_TABLE_HEADER = [
    "method", "precision", "recall", "accuracy", "mean delay, s: aileron", "rudder", "elevator",
    "ailerons and rudders within 5 s", "false alarms an hour (95 %)", "healthy flights with an alarm",
    "wrong group",
]  # fmt: skip


def _label_score_cells(method_scores: Document) -> list[str]:
    return [method_scores["method"], *_score_texts_or_empty(method_scores, LABEL_SCORE_TITLES)]


def _failure_score_cells(method_scores: Document) -> list[str]:
    """Return the cells of a method's row; figures that its authors did not publish are left empty."""
    delay_summaries = [method_scores["delay_s"].get(surface_kind, {}) for surface_kind in SURFACE_KINDS]
    cells = [
        method_scores["method"],
        *_score_texts_or_empty(method_scores, FAILURE_TABLE_HEADER[1:4]),
        *map(_mean_delay_text, delay_summaries),
    ]
    if "false_alarms_per_hour" not in method_scores:
        return cells + [""] * (len(FAILURE_TABLE_HEADER) - len(cells))
    n_ailerons_and_rudders_within_5_s, n_aileron_and_rudder_failures = (
        sum(delay_summary[key] for delay_summary in delay_summaries[:2]) for key in ("within_5_s", "failures")
    )
    alarms_per_hour = method_scores["false_alarms_per_hour"]
    return [
        *cells,
        f"{n_ailerons_and_rudders_within_5_s} of {n_aileron_and_rudder_failures}",
        f"{alarms_per_hour['value']:.1f} ({alarms_per_hour['low']:.1f} to {alarms_per_hour['high']:.1f})",
        f"{method_scores['healthy_flights_with_an_alarm']} of {method_scores['healthy_flights']}",
        str(method_scores["wrong_group"]),
    ]


def _score_texts_or_empty(method_scores: Document, keys: Iterable[str]) -> list[str]:
    return ["" if method_scores.get(key) is None else f"{method_scores[key]:.3f}" for key in keys]


def _mean_delay_text(delay_summary: Document) -> str:
    if delay_summary.get("mean") is None:
        return "not found" if delay_summary.get("failures") else ""
    count_text = (
        f" ({delay_summary['found']} of {delay_summary['failures']})" if "found" in delay_summary else ""
    )
    return f"{delay_summary['mean']:.1f}{count_text}"


def as_text(document: Document) -> str:
    """The tables for a terminal."""
    return "\n".join(f"{title}\n{aligned([head, *rows])}\n" for title, (head, rows) in score_tables(document))


def as_markdown(document: Document) -> str:
    """The tables for a Markdown page."""
    titles_and_tables = score_tables(document)
    return "\n".join(
        f"### {title}\n\n{markdown_table(head, rows)}\n" for title, (head, rows) in titles_and_tables
    )


def table_markers(document: Document) -> tuple[str, str]:
    """Return the marks before and after the tables in a page."""
    name = "other days" if "other_days" in document else "recorded flights"
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def update_page(document: Document, page: Path) -> None:
    """Put the tables between the marks of a Markdown page. Raises BadInput where it has none."""
    replace_between(page, *table_markers(document), as_markdown(document))


def draw_comparison_figure(document: Document) -> Any:
    """How late each method found each failure, and how near it came to the labels: a panel a data set."""
    data_sets = document["sets"]
    figure, axes_grid = panels(
        len(data_sets), 1, 8.6, sum(0.27 * len(_method_titles(data_set)) + 1.3 for data_set in data_sets)
    )
    for axis, data_set in zip(axes_grid[:, 0], data_sets, strict=True):
        draw_panel = _draw_shares_of_right_rows if data_set["scored_by"] == "labels" else _draw_failure_delays
        draw_panel(axis, data_set)
        axis.set_title(f"{data_set['set']}: left out, {data_set['left_out']}", fontsize=10, loc="left")
        axis.set_yticks(range(len(_method_titles(data_set))), _method_titles(data_set))
        axis.set_ylim(len(_method_titles(data_set)) - 0.5, -0.5)
        axis.tick_params(labelsize=8)
        axis.grid(color=GRID, linewidth=0.5)
        axis.set_axisbelow(True)
        axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def _method_titles(data_set: Document) -> list[str]:
    return [method_scores["method"] for method_scores in (*data_set["rows"], *data_set.get("published", ()))]


def _draw_failure_delays(axis: Any, data_set: Document) -> None:
    """A line a method, a mark a failed surface at its delay; right of the line what is not found in time."""
    method_titles = _method_titles(data_set)
    failure_of_flight = {entry["left_out"]: entry["failure"] for entry in data_set["flights"]}
    distinct_failure_names = [
        failure for failure in dict.fromkeys(failure_of_flight.values()) if failure and ENGINE not in failure
    ]
    for i, surface_failure in enumerate(distinct_failure_names):
        entries_of_failure = [
            entry
            for entry in data_set["flights"]
            if entry["failure"] == surface_failure and entry["method"] in method_titles
        ]
        delays_s = [
            _MAX_SHOWN_DELAY_S + 1.0 if entry["delay_s"] is None else entry["delay_s"]
            for entry in entries_of_failure
        ]
        heights_in_method_rows = [
            method_titles.index(entry["method"]) + 0.7 * ((i + 0.5) / len(distinct_failure_names) - 0.5)
            for entry in entries_of_failure
        ]
        label = surface_failure.replace("_", " ").replace("+", " + ")
        axis.plot(
            [min(delay, _MAX_SHOWN_DELAY_S + 1.0) for delay in delays_s],
            heights_in_method_rows,
            marker(i),
            color=SERIES[i],
            label=label,
        )
    axis.axvspan(_MAX_SHOWN_DELAY_S, _MAX_SHOWN_DELAY_S + 2.0, color=GRID)
    axis.set_xlim(-0.5, _MAX_SHOWN_DELAY_S + 2.0)
    axis.set_xlabel(f"delay, s (grey: not found within {_MAX_SHOWN_DELAY_S:g} s)", fontsize=9)


def _draw_shares_of_right_rows(axis: Any, data_set: Document) -> None:
    """A line a method, a mark for each share of the rows that are right; as published where they are."""
    legend_label_of_score = {
        "classes": "class",
        "healthy_or_faulty": "healthy or faulty",
        "side": "side of the aircraft",
    }
    rows = [*data_set["rows"], *data_set["published"]]
    for i, (key, label) in enumerate(legend_label_of_score.items()):
        indices_of_rows_with_score = [
            row_index for row_index, row in enumerate(rows) if row.get(key) is not None
        ]
        heights_in_method_rows = [row_index + 0.22 * (i - 1) for row_index in indices_of_rows_with_score]
        axis.plot(
            [rows[row_index][key] for row_index in indices_of_rows_with_score],
            heights_in_method_rows,
            marker(i),
            color=SERIES[i],
            label=label,
        )
    axis.set_xlim(0, 1)
    axis.set_xlabel("share of the rows that are right", fontsize=9)
