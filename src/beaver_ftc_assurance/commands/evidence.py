"""`beaver-ftc evidence`: fly a plan of requirements, and write the evidence."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import (
    Format,
    FormatOption,
    JunitOption,
    NoReportOption,
    WorkersOption,
    answer,
    judged,
    progress_bar,
)
from beaver_ftc.commands import declare

if TYPE_CHECKING:
    from beaver_ftc.results import Judged
    from beaver_ftc_assurance.evidence.plan import EvidencePlan


@dataclass(frozen=True)
class Arguments:
    """The options; `command` documents them."""

    plan: Annotated[str, typer.Argument(metavar="PLAN")]
    out: Path | None = None
    workers: WorkersOption = None
    replay: Annotated[str | None, typer.Option(metavar="FLIGHT")] = None
    format: FormatOption = Format.text
    no_report: NoReportOption = False
    junit: JunitOption = None


@declare("evidence.json", "evidence.html", "evidence.pdf")
def command(arguments: Arguments) -> None:
    """Fly a plan of requirements and write the evidence.

    For each requirement the command reports the result (met, not met or not shown), the margin, the worst
    flight, and the command that repeats this flight. It writes evidence.json, evidence.html and evidence.pdf.

    The exit status is 1 if a requirement is not met or not shown.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc evidence flight-controls

    plan: Path of a plan of evidence, or name of a built-in plan.
    out: Folder for the results. Default: runs/ and the name of the plan.
    replay: Fly only this flight again, and write its result folder as `run` does.
    no_report: With --replay: do not write report.html and the figures.
    """
    from beaver_ftc_assurance.evidence.plan import load_plan

    def fly() -> "Judged":
        plan = load_plan(arguments.plan)
        return _fly(plan, arguments) if arguments.replay is None else _replay(plan, arguments)

    judged(arguments.plan, arguments.format, arguments.junit, fly)


def _fly(plan: "EvidencePlan", arguments: Arguments) -> "Judged":
    """Fly and judge all flights of a plan, and print the result."""
    from beaver_ftc.results import Judged
    from beaver_ftc.studies.engine import cores
    from beaver_ftc_assurance.evidence.shown import as_expectations, as_text, run_plan

    folder = Path("runs") / plan.file.name if arguments.out is None else arguments.out
    with progress_bar(plan.file.name) as progress:
        document = run_plan(plan, folder.absolute(), arguments.workers or cores(), progress)
    answered = document | {"folder": str(folder)}
    answer(arguments.format, answered, lambda: as_text(document, str(folder)))
    return Judged(plan.file.name, document["passed"], as_expectations(document))


def _replay(plan: "EvidencePlan", arguments: Arguments) -> "Judged":
    """Fly one flight into a result folder of its own, judge it, and print the result."""
    from beaver_ftc.results import Judged, Metrics, verdict_text
    from beaver_ftc.results import run_scenario as run
    from beaver_ftc_assurance.evidence.shown import of_flight

    scenario, requirements = of_flight(plan, str(arguments.replay))
    out = Path("runs") if arguments.out is None else arguments.out
    document = run(scenario, out, not arguments.no_report)
    folder = str(out / scenario.name)
    meets = all(requirement.passed for requirement in requirements)
    lines = [f"{requirement.name} {requirement.actual}" for requirement in requirements]
    answered = document | {"folder": folder, "requirements": lines, "passed": meets}

    def text() -> str:
        return "\n".join([verdict_text(Metrics.of(document), folder, sys.stdout.isatty()).rstrip(), *lines])

    answer(arguments.format, answered, text)
    return Judged(scenario.name, meets, requirements)
