"""`beaver-ftc evidence`: fly a plan of requirements, and write what it shows."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli.inputs import NoReportOption, WorkersOption
from beaver_ftc.cli.output import Format, FormatOption, answer
from beaver_ftc.cli.progress import progress_bar

if TYPE_CHECKING:
    from beaver_ftc.studies.evidence.plan import EvidencePlan


@dataclass(frozen=True)
class Arguments:
    """What is wanted of it, as `command` says."""

    plan: Annotated[str, typer.Argument(metavar="PLAN")]
    out: Path | None = None
    workers: WorkersOption = None
    replay: Annotated[str | None, typer.Option(metavar="FLIGHT")] = None
    format: FormatOption = Format.text
    no_report: NoReportOption = False


def command(arguments: Arguments) -> None:
    """Fly a plan of requirements and write the evidence.

    Requirement by requirement met, not met or not shown, with its margin, its worst flight and the command
    that flies it again. Writes evidence.json, evidence.html and evidence.pdf.

    Exit status 1 if a requirement is not met, or not shown.

    Stopped or killed, it goes on where it was with the same command.

    Examples:
      beaver-ftc evidence flight-controls

    plan: A plan of evidence, or the name of a built-in one.
    out: Folder for the evidence. Default: runs/ and the plan's name.
    replay: Fly this one flight again, as `run` would, and judge it.
    """
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.evidence.plan import load_plan
    from beaver_ftc.studies.evidence.shown import as_text, run_plan

    plan = load_plan(arguments.plan)
    folder = Path("runs") / plan.file.name if arguments.out is None else arguments.out
    if arguments.replay is not None:
        raise typer.Exit(_replay(plan, arguments))
    with progress_bar(plan.file.name) as progress:
        document = run_plan(plan, folder.absolute(), arguments.workers or cores(), progress)
    said = document | {"folder": str(folder)}
    answer(arguments.format, said, lambda: as_text(document, str(folder), sys.stdout.isatty()))
    raise typer.Exit(0 if document["passed"] else 1)


def _replay(plan: "EvidencePlan", arguments: Arguments) -> int:
    """Fly one flight into a result folder of its own; the exit status."""
    from beaver_ftc.results.verdict import verdict_text
    from beaver_ftc.results.writer import run
    from beaver_ftc.studies.evidence.shown import of_flight

    scenario, judged, meets = of_flight(plan, str(arguments.replay))
    out = Path("runs") if arguments.out is None else arguments.out
    document = run(scenario, out, not arguments.no_report)
    folder = str(out / scenario.name)
    said = document | {"folder": folder, "requirements": judged, "passed": meets}

    def text() -> str:
        return "\n".join([verdict_text(document, folder, sys.stdout.isatty()).rstrip(), *judged])

    answer(arguments.format, said, text)
    return 0 if meets else 1
