"""The command `sensitivity`: larger errors than declared, and flights without a part of the method."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.commands import SCENARIO, Reporter, SeedOption, StudyCommand, WorkersOption
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario, load_scenario
from beaver_ftc.studies.engine.study import Study, run_into
from beaver_ftc.studies.present.page import as_text
from beaver_ftc.studies.sensitivity import beyond, effects, errors_shown, mechanisms_shown
from beaver_ftc.studies.sensitivity.errors import errors_of
from beaver_ftc.studies.sensitivity.mechanisms import (
    DRAWS,
    cases_of,
    fly_one,
    margin_cells,
    margins_row,
)


def errors_study(scenario: Scenario, flights: int = beyond.FLIGHTS, seed: int = 1) -> Study:
    """The study of errors larger than declared. Raises BadInput if the scenario has no diagnosis."""
    if scenario.fdi.scheme == "none":
        raise BadInput(f"{scenario.name}: fdi.scheme: none diagnoses nothing, allowed: a scheme")
    errors = errors_of(scenario)
    cases = beyond.cases_of(errors, flights)
    return Study(
        f"{scenario.name[:80]}-{errors_shown.NAME}", cases, partial(beyond.fly_one, scenario, seed),
        partial(beyond.document_of, scenario, errors, cases, seed), errors_shown.FILES,
        follows_from=[scenario, seed], lost=lambda flight, why: beyond.FAILED,
    )  # fmt: skip


def mechanisms_study(draws: int, seed: int) -> Study:
    """The study of the mechanisms of both systems."""

    def document(rows: Sequence[Document]) -> Document:
        margins = [margins_row(cell) for cell in margin_cells()]
        return effects.document_of(seed, draws, rows, margins)

    name = f"mechanisms-{mechanisms_shown.NAME}"
    fly = partial(fly_one, seed)
    return Study(name, cases_of(draws), fly, document, mechanisms_shown.FILES, follows_from=seed)


@dataclass(frozen=True)
class Sensitivity(StudyCommand):
    """Measure how verdicts change with larger errors, or without parts of a method.

    SCENARIO: `fdi.bounds` can declare several errors. The command flies each declared error at 1, 1.5, 2 and
    4 times its declared size, first alone and then together with all other errors. An error that is not
    declared has no declared size. The command flies such an error alone, at multiples of a fixed size. The
    sign of an error is random, but its size is not. The command reports false alarms, detections, right
    names, wrong names and tracking errors, each with its 95 % interval.

    --mechanisms: the command flies two systems on the same random flights: the published system and the
    default system. Each system flies with all of its mechanisms, and then without one mechanism at a time.
    The mechanisms are adaptive thresholds, adaptation, networks, hand-over to the flap, bank of poles,
    memory, sharpened tests and statistics. The random flights differ in the fault, the bandwidth of the law,
    the undeclared error, and the instruments. For each mechanism the command counts the flights that become
    worse without the mechanism, and subtracts the number of flights that become better. It prints this
    difference as a share of all flights. There is one share for false alarms, one for late alarms, one for
    names and one for tracking, each with its 95 % interval. For each false alarm of a worst-case detector the
    command prints the reason, and for the default scheme also the certificate. The exit status is 1 if a
    false alarm of a worst-case detector has no reason.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc sensitivity elevator-loss-in-turbulence
      beaver-ftc sensitivity --mechanisms --draws 1

    mechanisms: Fly without mechanisms instead.
    flights: Number of flights for each error and size.
    draws: With --mechanisms: number of random flights for each combination.
    seed: Seed of all random draws.
    out: Folder for the results.
    """

    scenario: Annotated[str | None, SCENARIO] = None
    mechanisms: bool = False
    flights: Annotated[int, typer.Option(min=1, max=10_000)] = beyond.FLIGHTS
    draws: Annotated[int, typer.Option(min=1, max=1000)] = DRAWS
    seed: SeedOption = 1
    workers: WorkersOption = None
    out: Path = Path("runs")

    FILES = tuple(errors_shown.FILES)

    def run(self, reporter: Reporter) -> Document:
        """Fly the chosen study."""
        if (self.scenario is None) is not self.mechanisms:
            raise BadInput("sensitivity: allowed: exactly one of SCENARIO and --mechanisms")
        if self.mechanisms:
            study = mechanisms_study(self.draws, self.seed)
        else:
            study = errors_study(load_scenario(str(self.scenario)), self.flights, self.seed)
        return run_into(study, self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """Sentences and tables, and the folder of the files."""
        shown = mechanisms_shown if self.mechanisms else errors_shown
        return f"{as_text(shown.page_of(document)[1])}\n\nresults: {document['folder']}"
