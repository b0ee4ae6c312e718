"""The command `mechanisms`: what each mechanism of diagnosis and accommodation is worth."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.commands import Reporter, StudyCommand, WorkersOption
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.mechanisms.effects import document_of
from beaver_ftc.studies.mechanisms.shown import FILES, NAME, as_text
from beaver_ftc.studies.mechanisms.survey import DRAWS, cases_of, fly_one, margin_cells, margins_row


def run_mechanisms(
    out: Path, draws: int, seed: int, workers: int, progress: Progress | None = None
) -> Document:
    """Write `out/mechanisms/`; return the document."""

    def document(rows: Sequence[Document]) -> Document:
        margins = [margins_row(cell) for cell in margin_cells()]
        return document_of(seed, draws, rows, margins) | {"versions": dict(versions())}

    study = Study(NAME, cases_of(draws), partial(fly_one, seed), document, FILES, follows_from=seed)
    found: Document = run_study(study, out, workers, progress)
    return found | {"folder": str(out / NAME)}


@dataclass(frozen=True)
class Mechanisms(StudyCommand):
    """Measure which mechanisms of diagnosis and law help.

    The command flies two systems on the same random flights: the published system and the default system.
    Each system flies with all of its mechanisms, and then without one mechanism at a time. The mechanisms are
    adaptive thresholds, adaptation, networks, hand-over to the flap, bank of poles, memory, sharpened tests
    and statistics. The random flights differ in the fault, the bandwidth of the law, the undeclared error,
    and the instruments.

    For each mechanism the command counts the flights that become worse without the mechanism, and subtracts
    the number of flights that become better. It prints this difference as a share of all flights. There is
    one share for false alarms, one for late alarms, one for names and one for tracking, each with its 95 %
    interval.

    For each false alarm of a worst-case detector the command prints the reason. For the default scheme it
    also prints the certificate.

    The exit status is 1 if a false alarm of a worst-case detector has no reason.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc mechanisms --draws 1

    draws: Number of random flights for each combination.
    seed: Seed of all random draws.
    out: Folder for the results.
    """

    draws: Annotated[int, typer.Option(min=1, max=1000)] = DRAWS
    seed: Annotated[int, typer.Option(min=0)] = 1
    workers: WorkersOption = None
    out: Path = Path("runs")

    FILES = FILES
    PLUGINS = False

    def run(self, reporter: Reporter) -> Document:
        """Fly every draw."""
        return run_mechanisms(self.out, self.draws, self.seed, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """Findings and tables, and where the files are."""
        return f"{as_text(document)}\n\nresults: {document['folder']}"
