"""`beaver-ftc mismatch`: where truth and design model differ, and what that costs the diagnosis."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beaver_ftc.cli.inputs import NoReportOption, ResultsOption, ScenariosArgument, load_all
from beaver_ftc.cli.output import Format, FormatOption, complain, emit, emit_json
from beaver_ftc.documents.errors import BadInput

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


def command(
    scenarios: ScenariosArgument,
    out: ResultsOption = Path("runs"),
    format: FormatOption = Format.text,
    variant: Annotated[
        str,
        typer.Option(help="Design models to compare, e.g. declared,engine-neglected,linearised,mass=1.1."),
    ] = "",
    map: Annotated[bool, typer.Option("--map", help="Worst mismatch over speed and altitude, too.")] = False,
    no_report: NoReportOption = False,
) -> None:
    """Split truth less design model into its sources.

    With --format json: the document of the flight, axes.{p,q,r}.{source}: rms, max, share, bound_share;
    of several flights {"runs": [...], "recommended": ..., "guarantee": ...}.

    Stopped or killed, a map goes on where it was with the same command.
    """
    try:
        flown = [each for scenario in load_all(scenarios) for each in _variants(scenario, variant)]
    except BadInput as error:
        if format is Format.json:
            emit_json({"runs": [], "errors": str(error).splitlines()})
        raise
    _refuse_other_aircraft(flown)
    documents, recommended = _fly_all(flown, out, format, report=not no_report)
    maps = [_map(scenario, out, format, report=not no_report) for scenario in flown if map]
    for document, entries in zip(documents, maps, strict=False):
        document["map"] = entries
    if format is Format.json:
        emit_json(documents[0] if len(documents) == 1 else {"runs": documents} | recommended)


def _refuse_other_aircraft(scenarios: list["Scenario"]) -> None:
    """The sources are told apart by the terms and the engine of the built-in aircraft."""
    for scenario in scenarios:
        if not scenario.airframe.forces or "dpt" not in scenario.airframe.signals:
            raise BadInput(
                f"{scenario.name}: mismatch splits by the terms and the engine of a built-in aircraft; what "
                f"is left of {scenario.aircraft} is in the page derive writes, allowed: a built-in aircraft"
            )


def _variants(scenario: "Scenario", text: str) -> list["Scenario"]:
    from beaver_ftc.studies.mismatch.variants import variant_of

    wanted = [scenario] if not text else [variant_of(scenario, each.strip()) for each in text.split(",")]
    names = [each.name for each in wanted]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice:
        raise BadInput(f"--variant {text}: {twice} comes twice, allowed: each variant once")
    return wanted


def _fly_all(
    scenarios: list["Scenario"], out: Path, format: Format, report: bool
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Fly and split each; then compare, if there is something to compare."""
    documents, tallies = [], []
    for scenario in scenarios:
        found, kept = _fly(scenario, out, report)
        documents.append(found)
        tallies.append(kept)
        if format is Format.text:
            _say(found, out / scenario.name)
    if len(scenarios) == 1:
        return documents, {}
    return documents, _compare(scenarios, documents, tallies, out, format, report)


def _fly(scenario: "Scenario", out: Path, report: bool) -> tuple[dict[str, Any], Any]:
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.mismatch.study import run_mismatch

    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    with progress_bar(scenario.name) as progress:
        found, kept = run_mismatch(scenario, out, report, progress)
    return found | {"folder": str(out / scenario.name)}, kept


def _compare(
    scenarios: list["Scenario"],
    documents: list[dict[str, Any]],
    tallies: list[Any],
    out: Path,
    format: Format,
    report: bool,
) -> dict[str, Any]:
    from beaver_ftc.studies.mismatch.study import entry, recommended_for, write_comparison
    from beaver_ftc.studies.mismatch.tables import comparison_text

    entries = [entry(found) for found in documents]
    recommended = recommended_for(scenarios, tallies)
    folder = write_comparison(out, entries, recommended, report)
    if format is Format.text:
        emit(comparison_text(entries, recommended, str(folder), _colour()))
    return recommended


def _map(scenario: "Scenario", out: Path, format: Format, report: bool) -> list[dict[str, Any]]:
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.mismatch.study import map_name, run_map

    with progress_bar(f"{scenario.name}: envelope") as progress:
        entries = run_map(out, scenario, report, progress)
    if format is Format.text:
        emit(f"map          {out / map_name(scenario)}")
    return entries


def _say(found: dict[str, Any], folder: Path) -> None:
    from beaver_ftc.studies.mismatch.tables import mismatch_text

    emit(mismatch_text(found, str(folder), _colour()))


def _colour() -> bool:
    import sys

    return sys.stdout.isatty()
