"""Fly a scenario, split its mismatch, keep the results beside the run's own."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.mismatch.document import (
    Document,
    document,
    guarantee_document,
    linear_document,
    recommendation_document,
    rows,
    write_csv,
)
from beaver_ftc.studies.mismatch.states import OPTIONAL, REQUIRED, Columns

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario
    from beaver_ftc.studies.mismatch.bound import Recommendation
    from beaver_ftc.studies.mismatch.linear import LinearAnalysis
    from beaver_ftc.studies.mismatch.split import Stretch
    from beaver_ftc.studies.mismatch.tally import Tally

Progress = Callable[[float], None]
MAX_ROUNDS = 10


def run_mismatch(
    scenario: "Scenario", out: Path, report: bool = True, progress: Progress | None = None
) -> tuple[Document, "Tally"]:
    """Fly `scenario` and write `out/<name>/`: a run's result folder with the mismatch in it.

    Raises BadInput for a flight that cannot be trimmed, SimulationFailed for one not completed or kept.
    """
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.log import ParquetLog
    from beaver_ftc.results.metrics import as_json, metrics
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.scenario.dump import to_yaml

    refuse_other_aircraft(scenario)
    with result_folder(out, scenario.name) as folder:
        with ParquetLog(folder / "log.parquet") as log:
            flight = fly(scenario, log, progress)
        flown = metrics(flight)
        (folder / "scenario.yaml").write_text(to_yaml(scenario), encoding="utf-8")
        (folder / "metrics.json").write_text(as_json(flown), encoding="utf-8")
        found, kept = analyse_folder(scenario, folder, flown, report)
    return found, kept


def refuse_other_aircraft(scenario: "Scenario") -> None:
    """The study compares with a second set of equations, which there is of the built-in aircraft only."""
    if scenario.airframe is not load():
        raise BadInput(
            f"{scenario.name}: aircraft: mismatch knows the equations of {load().name} alone, allowed: "
            f"{load().name}; of others `beaver-ftc derive` measures the error"
        )


def analyse_folder(
    scenario: "Scenario", folder: Path, flown: Document, report: bool
) -> tuple[Document, "Tally"]:
    """Split the flight whose log is in a result folder; add the mismatch's files, figures and report."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.studies.mismatch.linear import analyse

    kept = tally_of_log(scenario, folder / "log.parquet", folder / "mismatch.parquet")
    analysis = analyse(scenario)
    found = complete(scenario, kept, flown, analysis)
    (folder / "mismatch.json").write_text(as_json(found), encoding="utf-8")
    write_csv(folder / "mismatch.csv", list(rows(found)))
    if report:
        _report(folder, found, flown, analysis)
    return found, kept


def complete(scenario: "Scenario", kept: "Tally", flown: Document, analysis: "LinearAnalysis") -> Document:
    """The document of one flight, its own recommendation, what that does to the guarantee, and the modes."""
    return (
        document(scenario, kept, flown)
        | recommended_for([scenario], [kept])
        | {"linear": linear_document(analysis)}
    )


def recommended_for(scenarios: Sequence["Scenario"], kept: Sequence["Tally"]) -> Document:
    """The bound that covers these flights, and the published elevator case flown with it and the design.

    The case is one of the flights to be covered: a bound that suits calmer air alone would raise a false
    alarm in it, and guarantee nothing.
    """
    from beaver_ftc.studies.mismatch.bound import guarantee_with, published_case

    first = scenarios[0]
    declared = first.fdi.bounds.constant_rad_s2.model_dump()
    case = published_case(declared, first)
    covered = settle([*scenarios, case], [*kept, tally_of_flight(case)[0]])
    recommended = replace(covered, runs=len(scenarios))
    return {
        "recommended": recommendation_document(recommended),
        "guarantee": guarantee_document(
            guarantee_with(declared, first), guarantee_with(recommended.constant_rad_s2, first)
        ),
    }


def settle(scenarios: Sequence["Scenario"], kept: Sequence["Tally"]) -> "Recommendation":
    """The recommended bound, flown with until no flight exceeds it or raises a false alarm.

    A bound too small raises an alarm, after which another law flies; without that alarm the flight, and its
    mismatch, is another. So every flight is flown again with what is recommended.
    """
    from beaver_ftc.studies.mismatch.bound import recommend, widened, with_bound

    tallies, recommended = list(kept), recommend(kept)
    for _ in range(MAX_ROUNDS):
        constant = recommended.constant_rad_s2
        again = [tally_of_flight(with_bound(scenario, constant)) for scenario in scenarios]
        short = [tally for tally, flown in again if tally.exceeded or flown["false_alarm"]]
        if not short:
            return replace(recommended, runs=len(scenarios))
        tallies += short
        larger = recommend(tallies).at_least(constant)
        recommended = larger if larger.constant_rad_s2 != constant else widened(larger)
    return replace(recommended, runs=len(scenarios), settled=False)


def tally_of_log(scenario: "Scenario", log: Path, frames: Path) -> "Tally":
    """Split a log, a row group at a time; every frame goes to `frames`."""
    from beaver_ftc.studies.mismatch.frames import written
    from beaver_ftc.studies.mismatch.split import split
    from beaver_ftc.studies.mismatch.tally import tally_for

    kept = tally_for(scenario)
    for stretch in written(split(scenario, _chunks(log)), frames):
        kept.add(stretch)
    return kept


def tally_of_flight(scenario: "Scenario") -> tuple["Tally", Document]:
    """Fly and split as it is flown, keeping no log: the tally and the flight's metrics."""
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.metrics import metrics

    sink = _SplittingSink(scenario)
    flight = fly(scenario, sink)
    return sink.tally, metrics(flight)


class _SplittingSink:
    """A log sink that splits and forgets."""

    def __init__(self, scenario: "Scenario") -> None:
        from beaver_ftc.studies.mismatch.split import Splitter
        from beaver_ftc.studies.mismatch.tally import tally_for

        self._splitter, self.tally = Splitter(scenario), tally_for(scenario)

    def open(self, columns: Sequence[str]) -> None:
        self._columns = {name: i for i, name in enumerate(columns) if name in REQUIRED or name in OPTIONAL}

    def write(self, rows_: np.ndarray) -> None:
        self._add(self._splitter.feed({name: rows_[:, i] for name, i in self._columns.items()}))

    def close(self) -> None:
        self._add(self._splitter.end())

    def _add(self, stretches: "Iterator[Stretch]") -> None:
        for stretch in stretches:
            self.tally.add(stretch)


def _chunks(log: Path) -> Iterator[Columns]:
    from beaver_ftc.results.log import column_names, read_chunks

    there = column_names(log)
    return read_chunks(log, [name for name in (*REQUIRED, *OPTIONAL) if name in there])


def _report(folder: Path, found: Document, flown: Document, analysis: "LinearAnalysis") -> None:
    from beaver_ftc.results.run import write_report_files
    from beaver_ftc.studies.mismatch.figures import write_figures
    from beaver_ftc.studies.mismatch.section import show_in_reports

    show_in_reports()
    write_figures(folder, found, flown, analysis)
    write_report_files(folder, flown)
