"""`beaver-ftc mismatch`: the model error by source, and the bound that it requires."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from beaver_ftc.cli import (
    Document,
    Format,
    FormatOption,
    NoReportOption,
    ResultsOption,
    ScenariosArgument,
    complain,
    emit,
    emit_json,
    load_all,
    progress_bar,
)
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput

if TYPE_CHECKING:
    import numpy as np

    from beaver_ftc.scenario.schema import Scenario

Show = Callable[[str], None]
"""Prints a text, or nothing if the answer is a JSON document."""


@declare("mismatch.json", "mismatch.csv", "mismatch.parquet")
def command(
    scenarios: ScenariosArgument,
    out: ResultsOption = Path("runs"),
    format: FormatOption = Format.text,
    variant: str = "",
    map: bool = False,
    no_report: NoReportOption = False,
) -> None:
    """Decompose the model error by source.

    The command flies each scenario and computes the mismatch: the angular acceleration of the truth minus
    that of the design model. For each source, such as sensors, fault or coefficients, it reports the part of
    the mismatch that comes from this source. It also reports this part as a share of the declared bound.

    With --format json the command prints one JSON object. For one flight it contains rms, max, share and
    bound_share for each axis and source (axes.{p,q,r}.{source}). For several flights it is {"runs": [...],
    "recommended": ..., "guarantee": ...}.

    If the command is interrupted while it computes the map (--map), the same command resumes it.

    Examples:
      beaver-ftc mismatch fault-free
      beaver-ftc mismatch fault-free --variant declared,linearised,mass=1.1

    variant: Design models to compare, separated by commas, e.g.
    declared,engine-neglected,linearised,mass=1.1.
    map: Also print the largest mismatch over airspeed and altitude.
    """
    from beaver_ftc.studies.mismatch.study import refuse_other_aircraft

    try:
        flown = [flight for scenario in load_all(scenarios) for flight in _variants(scenario, variant)]
    except BadInput as error:
        if format is Format.json:
            emit_json({"runs": [], "errors": str(error).splitlines()})
        raise
    refuse_other_aircraft(flown)
    report = not no_report
    show: Show = emit if format is Format.text else lambda text: None
    results = [_split(scenario, out, report, show) for scenario in flown]
    documents = [document for document, _ in results]
    several = len(flown) > 1
    recommended = _compare(flown, results, out, report, show) if several else {}
    for scenario, document in zip(flown, documents if map else (), strict=False):
        document["map"] = _map(scenario, out, report, show)
    if format is Format.json:
        emit_json({"runs": documents} | recommended if several else documents[0])


def _variants(scenario: "Scenario", text: str) -> list["Scenario"]:
    """The scenario with each of the design models that the option --variant lists; without it, the scenario
    alone."""
    from beaver_ftc.studies.mismatch.variants import variant_of

    variants = [variant_of(scenario, name.strip()) for name in text.split(",")] if text else [scenario]
    names = [flight.name for flight in variants]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise BadInput(f"--variant {text}: {twice} comes twice, allowed: each variant once")
    return variants


def _split(scenario: "Scenario", out: Path, report: bool, show: Show) -> tuple[Document, "np.ndarray"]:
    """Fly a scenario and split its model error: the document, and the constant bound that it requires."""
    from beaver_ftc.studies.mismatch.study import run_mismatch
    from beaver_ftc.studies.mismatch.tables import mismatch_text

    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    with progress_bar(scenario.name) as progress:
        document, needed = run_mismatch(scenario, out, report, progress)
    folder = str(out / scenario.name)
    show(mismatch_text(document, folder, sys.stdout.isatty()))
    return document | {"folder": folder}, needed


def _compare(
    scenarios: list["Scenario"],
    results: list[tuple[Document, "np.ndarray"]],
    out: Path,
    report: bool,
    show: Show,
) -> Document:
    """Write the comparison of several flights, and print it. Returns the document of `recommended_for`.
    results: of `_split`."""
    from beaver_ftc.studies.mismatch.bound import recommended_for
    from beaver_ftc.studies.mismatch.documents import entry
    from beaver_ftc.studies.mismatch.study import write_comparison
    from beaver_ftc.studies.mismatch.tables import comparison_text

    entries = [entry(document) for document, _ in results]
    recommended = recommended_for(scenarios, [needed for _, needed in results])
    folder = write_comparison(out, entries, recommended, report)
    show(comparison_text(entries, recommended, str(folder), sys.stdout.isatty()))
    return recommended


def _map(scenario: "Scenario", out: Path, report: bool, show: Show) -> list[Document]:
    """The map of the model error over airspeed and altitude; prints the path of its folder."""
    from beaver_ftc.studies.engine.study import run_into
    from beaver_ftc.studies.mismatch.over_envelope import map_study

    with progress_bar(f"{scenario.name}: envelope") as progress:
        document = run_into(map_study(scenario, report), out, progress=progress)
    show(f"map          {document['folder']}")
    return document["map"]
