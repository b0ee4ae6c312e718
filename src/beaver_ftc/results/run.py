"""Fly a scenario and keep what came out: the result folder of one run."""

import shutil
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import Document, as_json, metrics
from beaver_ftc.results.writer import AIRCRAFT, MODEL_FILES, result_folder

if TYPE_CHECKING:
    from beaver_ftc.aircraft import Aircraft
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.scenario.schema import Scenario

Progress = Callable[[float], None]


def run(
    scenario: "Scenario",
    out: Path,
    report: bool = True,
    progress: Progress | None = None,
    exports: Collection[str] = (),
    prepare: "Callable[[Plant], None] | None" = None,
    recording: str | None = None,
) -> Document:
    """Fly `scenario`, write `out/<name>/` whole or not at all, and return the metrics document.

    exports: of "csv" and "acmi". prepare: called with the trimmed plant just before the flight. recording:
    table, ulog or ardupilot, to write the log as a recorder on board would have. Raises BadInput for a flight
    that cannot be trimmed, SimulationFailed for one not completed or kept.
    """
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.recordings import write_recording

    with result_folder(out, scenario.name) as folder:
        with ParquetLog(folder / "log.parquet") as log:
            flight = fly(scenario, log, progress, prepare=prepare)
        document = metrics(flight)
        write_documents(folder, scenario, document)
        if report:
            write_report_files(folder, document)
        if exports:
            write_exports(folder, document, exports, scenario.airframe)
        if recording is not None:
            write_recording(folder / "log.parquet", _travel_rad(scenario.airframe), recording, folder)
    return document


def write_documents(folder: Path, scenario: "Scenario", document: Document) -> None:
    """Write what was flown and what came out of it into a result folder."""
    from beaver_ftc.scenario.dump import to_yaml

    (folder / "scenario.yaml").write_text(to_yaml(_with_its_aircraft(folder, scenario)), encoding="utf-8")
    (folder / "metrics.json").write_text(as_json(document), encoding="utf-8")


def _with_its_aircraft(folder: Path, scenario: "Scenario") -> "Scenario":
    """The scenario as it can be flown again from this folder: an aircraft of the user's own is copied."""
    if not str(scenario.aircraft).startswith("./"):
        return scenario
    shutil.copytree(scenario.airframe.folder, folder / AIRCRAFT, ignore=_no_model, dirs_exist_ok=True)
    return scenario.model_copy(update={"aircraft": f"./{AIRCRAFT}"})


def _no_model(folder: str, names: list[str]) -> set[str]:
    """What is no part of a JSBSim model and of its description."""
    return {n for n in names if Path(folder, n).is_file() and Path(n).suffix not in MODEL_FILES}


def write_report_files(folder: Path, document: Document) -> None:
    """Draw the figures and the report of a result folder that holds its log and its scenario."""
    from beaver_ftc.results.figures import write_figures
    from beaver_ftc.results.report import write_report

    write_figures(folder / "log.parquet", document, folder / "figures")
    write_report(folder / "report.html", [folder])


def write_exports(
    folder: Path, document: Document, exports: Collection[str], aircraft: "Aircraft | None" = None
) -> None:
    """Write the log of a result folder for other tools: "csv" as log.csv, "acmi" as flight.acmi."""
    from beaver_ftc.results.exports import write_acmi, write_csv

    if "csv" in exports:
        write_csv(folder / "log.parquet", folder / "log.csv")
    if "acmi" in exports:
        write_acmi(folder / "log.parquet", document, folder / "flight.acmi", aircraft)


def _travel_rad(aircraft: "Aircraft") -> dict[str, float]:
    """The farther stop of each surface."""
    return {name: max(abs(stop.min_rad), abs(stop.max_rad)) for name, stop in aircraft.travel.items()}
