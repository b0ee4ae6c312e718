"""`beaver-ftc run`: fly scenarios, keep the results, say the verdict."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beaver_ftc.cli.inputs import load_all
from beaver_ftc.cli.output import Format, FormatOption, complain, emit, emit_json, report, unexpected
from beaver_ftc.errors import BadInput, BeaverFtcError

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


def command(
    scenarios: Annotated[
        list[str], typer.Argument(metavar="SCENARIO", help="A file, or the name of a built-in scenario.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the results, one folder a scenario in it.")] = Path(
        "runs"
    ),
    format: FormatOption = Format.text,
    no_report: Annotated[bool, typer.Option("--no-report", help="Skip report.html and the figures.")] = False,
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write the verdict as JUnit XML, for CI.")
    ] = None,
) -> None:
    """Fly scenarios and say the verdict.

    With --format json: {"passed": ..., "runs": [...]}, each run its metrics and `folder`, or its `error`.
    """
    try:
        loaded = load_all(scenarios)
    except BadInput as error:
        if format is Format.json:
            emit_json({"passed": False, "runs": [], "errors": str(error).splitlines()})
        if junit is not None:
            _write_junit([{"scenario": "scenarios", "error": str(error)}], junit)
        raise
    raise typer.Exit(_run_all(loaded, out, format, not no_report, junit))


def _run_all(
    scenarios: list["Scenario"], out: Path, format: Format, with_report: bool, junit: Path | None
) -> int:
    """Fly one after the other; one that fails does not stop the rest. Returns the worst exit status."""
    runs, status = [], 0
    for scenario in scenarios:
        try:
            document = _run_one(scenario, out, with_report)
        except Exception as error:
            failure = error if isinstance(error, BeaverFtcError) else unexpected(error)
            status = max(status, report(failure))
            runs.append({"scenario": scenario.name, "error": str(failure)})
            continue
        runs.append(document)
        status = max(status, 0 if document["passed"] else 1)
        if format is Format.text:
            _say(document)
    if junit is not None:
        _write_junit(runs, junit)
    if format is Format.json:
        emit_json({"passed": status == 0, "runs": runs})
    return status


def _write_junit(runs: list[dict[str, Any]], junit: Path) -> None:
    from beaver_ftc.results.junit import write_junit

    write_junit(runs, junit)


def _run_one(scenario: "Scenario", out: Path, with_report: bool) -> dict[str, Any]:
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.results.run import run

    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    with progress_bar(scenario.name) as progress:
        document = run(scenario, out, with_report, progress)
    return document | {"folder": str(out / scenario.name)}


def _say(document: dict[str, Any]) -> None:
    import sys

    from beaver_ftc.results.verdict import verdict_text

    emit(verdict_text(document, document["folder"], colour=sys.stdout.isatty()))
