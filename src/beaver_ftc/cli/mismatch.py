"""`beaver-ftc mismatch`: where truth and design model differ, and what that costs the diagnosis."""

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

Say = Callable[[str], None]


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
        flown = [each for scenario in load_all(scenarios) for each in _variants(scenario, variant)]
    except BadInput as error:
        if format is Format.json:
            emit_json({"runs": [], "errors": str(error).splitlines()})
        raise
    refuse_other_aircraft(flown)
    report = not no_report
    say: Say = emit if format is Format.text else lambda text: None  # the document says it
    found = [_split(scenario, out, report, say) for scenario in flown]
    documents = [document for document, _ in found]
    several = len(flown) > 1
    recommended = _compare(flown, found, out, report, say) if several else {}
    for scenario, document in zip(flown, documents if map else (), strict=False):
        document["map"] = _map(scenario, out, report, say)
    if format is Format.json:
        emit_json({"runs": documents} | recommended if several else documents[0])


def _variants(scenario: "Scenario", text: str) -> list["Scenario"]:
    from beaver_ftc.studies.mismatch.study import variant_of

    wanted = [scenario] if not text else [variant_of(scenario, each.strip()) for each in text.split(",")]
    names = [each.name for each in wanted]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise BadInput(f"--variant {text}: {twice} comes twice, allowed: each variant once")
    return wanted


def _split(scenario: "Scenario", out: Path, report: bool, say: Say) -> tuple[Document, "np.ndarray"]:
    """Fly and split one: its document, and the constant bound that it needs."""
    from beaver_ftc.studies.mismatch.study import run_mismatch
    from beaver_ftc.studies.mismatch.tables import mismatch_text

    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    with progress_bar(scenario.name) as progress:
        document, needed = run_mismatch(scenario, out, report, progress)
    folder = str(out / scenario.name)
    say(mismatch_text(document, folder, sys.stdout.isatty()))
    return document | {"folder": folder}, needed


def _compare(
    scenarios: list["Scenario"], found: list[tuple[Document, "np.ndarray"]], out: Path, report: bool, say: Say
) -> Document:
    from beaver_ftc.studies.mismatch.bound import recommended_for
    from beaver_ftc.studies.mismatch.study import entry, write_comparison
    from beaver_ftc.studies.mismatch.tables import comparison_text

    entries = [entry(document) for document, _ in found]
    recommended = recommended_for(scenarios, [needed for _, needed in found])
    folder = write_comparison(out, entries, recommended, report)
    say(comparison_text(entries, recommended, str(folder), sys.stdout.isatty()))
    return recommended


def _map(scenario: "Scenario", out: Path, report: bool, say: Say) -> list[Document]:
    from beaver_ftc.studies.engine.study import run_into
    from beaver_ftc.studies.mismatch.study import map_study

    with progress_bar(f"{scenario.name}: envelope") as progress:
        found = run_into(map_study(scenario, report), out, progress=progress)
    say(f"map          {found['folder']}")
    return found["map"]
