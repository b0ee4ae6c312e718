"""The files of a result folder: scenario, metrics, figures and report."""

import contextlib
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results.folder import AIRCRAFT, MODEL_FILES, disk_error_text, locked, partial_prefix
from beaver_ftc.results.metrics import as_json
from beaver_ftc.results.model import Document, Metrics

if TYPE_CHECKING:
    from beaver_ftc.results.painters import Painters
    from beaver_ftc.results.report import ReportSection
    from beaver_ftc.scenario.schema import Scenario


@contextlib.contextmanager
def note_failure_and_go_on(failed: list[Exception], folder: Path, what: str) -> Iterator[None]:
    """Write one part of the results in the block. If it fails, add the reason to `failed` and remove the new
    files of this part. what: name of the part."""
    existing = set(folder.iterdir())
    try:
        yield
    except Exception as error:
        for new in set(folder.iterdir()) - existing:
            shutil.rmtree(new) if new.is_dir() else new.unlink()
        text = f"{type(error).__name__}: {error}"
        if isinstance(error, OSError) and error.errno and not error.filename:  # an error of the disk
            text = disk_error_text(error)
        reason = SimulationFailed(f"{what} could not be written: {text}")
        reason.__cause__ = error
        failed.append(reason)


def write_documents(folder: Path, scenario: "Scenario", document: Document) -> None:
    """Write scenario.yaml and metrics.json into a result folder."""
    write_scenario(folder, scenario)
    (folder / "metrics.json").write_text(as_json(document), encoding="utf-8")


def write_scenario(folder: Path, scenario: "Scenario") -> None:
    """Write scenario.yaml, and a copy of an own aircraft, into a result folder."""
    from beaver_ftc.scenario.dump import to_yaml

    # an own aircraft is copied, so that the folder alone can be flown again
    if str(scenario.aircraft).startswith("./"):
        shutil.copytree(
            scenario.airframe.folder, folder / AIRCRAFT, ignore=_files_not_of_model, dirs_exist_ok=True
        )
        scenario = scenario.model_copy(update={"aircraft": f"./{AIRCRAFT}"})
    (folder / "scenario.yaml").write_text(to_yaml(scenario), encoding="utf-8")


def _files_not_of_model(folder: str, names: list[str]) -> set[str]:
    """The names of files that belong neither to a JSBSim model nor to its description."""
    return {n for n in names if Path(folder, n).is_file() and Path(n).suffix not in MODEL_FILES}


def write_report_files(
    folder: Path,
    document: Document,
    to: Path | None = None,
    painters: "Painters" = (),
    formats: Sequence[str] = ("png",),
    sections: "Sequence[ReportSection]" = (),
) -> None:
    """Draw the figures and the report of a result folder that holds its log and its scenario.

    to: another folder to write into. painters: the processes that draw the figures; without them this process
    draws. formats: endings of the figures, none for no figures. sections: of studies, for the report.
    """
    from beaver_ftc.results.painters import drawing
    from beaver_ftc.results.pictures import pictures_of
    from beaver_ftc.results.report import write_report

    to = to or folder
    if formats:
        (to / "figures").mkdir(exist_ok=True)
    pictures = pictures_of(folder / "log.parquet", Metrics.of(document), to / "figures", formats)
    with drawing(pictures, painters):
        write_report(to / "report.html", [folder], sections=sections)


def add_report(folder: Path, document: Document) -> str:
    """Draw figures and report of an existing result folder. Returns an empty text; if drawing fails, the
    reason.

    Both are drawn in a hidden folder, and moved into the result folder once they are complete, unless that
    has been replaced meanwhile.
    """
    failed: list[Exception] = []
    with (
        TemporaryDirectory(prefix=partial_prefix(folder.name), dir=folder.parent) as hidden,
        locked(Path(hidden)),
        note_failure_and_go_on(failed, Path(hidden), "report.html"),
    ):
        drawn_for = folder.stat()
        write_report_files(folder, document, Path(hidden))
        if os.path.samestat(drawn_for, folder.stat()):
            for name in ("figures", "report.html"):
                Path(hidden, name).rename(folder / name)
    return "".join(map(str, failed))
