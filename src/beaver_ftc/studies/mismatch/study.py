"""Fly scenarios, split their mismatch, and write the results: of one flight, or of several compared."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.folder import result_folder
from beaver_ftc.results.log import ParquetLog, StoredLog
from beaver_ftc.results.metrics import as_json, measure
from beaver_ftc.results.model import Document
from beaver_ftc.results.result_files import write_documents, write_report_files
from beaver_ftc.results.style import marks
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.study import Progress
from beaver_ftc.studies.mismatch import charts
from beaver_ftc.studies.mismatch.bound import recommended_for
from beaver_ftc.studies.mismatch.documents import csv_rows, document
from beaver_ftc.studies.mismatch.linear import analyse, linear_document
from beaver_ftc.studies.mismatch.linear_charts import linear_figure
from beaver_ftc.studies.mismatch.split import COLUMNS, split
from beaver_ftc.studies.mismatch.states import LOGGED, Unlogged
from beaver_ftc.studies.mismatch.tables import mismatch_section
from beaver_ftc.studies.present.page import Files, write_files
from beaver_ftc.studies.present.tables import as_csv

COMPARISON = "mismatch-comparison"


def run_mismatch(
    scenario: Scenario, out: Path, report: bool, progress: Progress | None
) -> tuple[Document, np.ndarray]:
    """Fly `scenario` and write `out/<name>/`: a run's result folder with the mismatch in it. Return its
    document, and the constant part (3,) rad/s2 of a bound that would have covered the flight.

    Raises BadInput for a flight that cannot be trimmed, SimulationFailed for one not completed or kept.
    """
    with result_folder(out, scenario.name) as folder:
        unlogged = Unlogged()
        with ParquetLog(folder / "log.parquet") as log:
            flight = fly(scenario, log, progress, watch=unlogged.watch)
        metrics = measure(flight)
        flight_split = split(scenario, StoredLog(folder / "log.parquet").read(LOGGED), unlogged)
        split_file = folder / "mismatch.parquet"
        with ParquetLog(split_file) as frames:
            frames.open(COLUMNS)
            frames.write(flight_split.rows())
        analysis = analyse(scenario)
        recommended = recommended_for([scenario], [flight_split.smallest_constant])
        linear = linear_document(analysis)
        result = document(scenario, flight_split, metrics) | recommended | {"linear": linear}
        write_documents(folder, scenario, metrics.document())
        write_files(folder, _as_files(result, csv_rows(result)))
        if report:
            figures = {
                "mismatch-sources.png": charts.sources_figure(split_file, result, marks(metrics)),
                "mismatch-bound.png": charts.bound_figure(result),
                "mismatch-linear.png": linear_figure(analysis, scenario.name),
            }
            write_files(folder / "figures", figures)
            write_report_files(folder, metrics.document(), sections=[mismatch_section])
    return result, flight_split.smallest_constant


def refuse_other_aircraft(scenarios: Iterable[Scenario]) -> None:
    """Raise BadInput for another aircraft than the built-in one, since only the latter has a second set of
    equations."""
    for scenario in scenarios:
        if scenario.airframe is not load():
            raise BadInput(
                f"{scenario.name}: aircraft: `mismatch` works for {load().name} only, allowed: "
                f"{load().name}; for other aircraft `beaver-ftc derive` measures the model error"
            )


def _as_files(document: Document, table: Iterable[Document]) -> Files:
    return {"mismatch.json": as_json(document), "mismatch.csv": as_csv(list(table))}


def write_comparison(out: Path, entries: list[Document], recommended: Document, report: bool) -> Path:
    """Write `out/mismatch-comparison/`: the table as JSON and CSV, and a figure. Whole or not at all."""
    drawn = {f"{COMPARISON}.png": charts.comparison_figure(entries)} if report else None
    with result_folder(out, COMPARISON) as folder:
        write_files(folder, {**_as_files({"runs": entries} | recommended, entries), "figures": drawn})
    return out / COMPARISON
