"""Fly a run and write its result folder: log and scenario, then metrics, certificate, report and exports."""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import required
from beaver_ftc.results.folder import result_folder
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import as_json, metrics
from beaver_ftc.results.model import Document
from beaver_ftc.results.result_files import note_failure_and_go_on, write_report_files, write_scenario

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.results.painters import Painters
    from beaver_ftc.scenario.schema import Scenario

CERTIFICATE_FILE = "certificate.json"


def run(
    scenario: "Scenario",
    out: Path,
    report: bool = True,
    progress: Callable[[float], None] | None = None,
    exports: Collection[str] = (),
    prepare: "Callable[[Plant], None] | None" = None,
    recording: str | None = None,
    certified: bool = False,
    painters: "Painters" = (),
    figures: Sequence[str] = ("png",),
) -> Document:
    """Fly `scenario`, write `out/<name>/`, and return the metrics document.

    A flight that is not completed leaves no files. After a completed flight, log and scenario are kept even
    if another file cannot be written.

    exports: any of "csv" and "acmi". prepare: called with the trimmed plant just before the flight.
    recording: table, ulog or ardupilot, to write the log as a recorder on board does. certified: write the
    certificate of the alarm and the exclusions. painters: the processes that draw the figures; without them
    this process draws. figures: formats of the figures.

    Raises BadInput for a flight that cannot be trimmed or certified, SimulationFailed for one not completed
    or kept, NotAllWritten where the log is kept but another file could not be written.
    """
    from beaver_ftc.loop.loop import fly

    certificate = required("certificate", "certified")(scenario) if certified else None
    failed: list[Exception] = []
    with result_folder(out, scenario.name) as folder:
        written = partial(note_failure_and_go_on, failed, folder)
        with ParquetLog(folder / "log.parquet") as log:
            flight = fly(scenario, log, progress, prepare=prepare, watch=certificate and certificate.watch)
        write_scenario(folder, scenario)
        document: Document = {}
        with written("metrics.json"):
            document = metrics(flight)
            (folder / "metrics.json").write_text(as_json(document), encoding="utf-8")
        if certificate:
            with written(CERTIFICATE_FILE):
                certificate.write(folder)
        if report and document:
            with written("report.html"):
                write_report_files(folder, document, painters=painters, formats=figures)
        if exports or recording:
            from beaver_ftc.results.exports import exports_of

            for what, write in exports_of(folder, scenario.airframe, document, exports, recording).items():
                with written(what):
                    write()
    if failed:
        reasons = "; ".join(" ".join(str(error).split()) for error in failed)
        beginning = f"{out / scenario.name}: the flight and its log are kept"
        raise NotAllWritten(f"{beginning}, but {reasons}") from failed[0]
    return document


class NotAllWritten(SimulationFailed):
    """A flight was completed and its log is kept, but another file of its results could not be written."""
