"""`beaver-ftc sweep`: fly many variations of a scenario, write a row for each flight, and summarise them."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beaver_ftc.cli import (
    Format,
    FormatOption,
    JunitOption,
    NoReportOption,
    answer,
    complain,
    judged,
)
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput

if TYPE_CHECKING:
    from beaver_ftc.results.model import Judged
    from beaver_ftc.scenario.sweeps import Sweep
    from beaver_ftc.studies.sweep.campaign import Options
    from beaver_ftc.studies.sweep.one_flight import Keep

LANDS_S = 1.0  # time for which flights continue after the sweep was asked to stop

Backend = StrEnum("Backend", ["local", "ray"])  # where the flights run
Objective = StrEnum("Objective", ["delay", "false_alarm", "tracking"])  # of a search


@dataclass(frozen=True)
class Arguments:
    """The arguments of `command`."""

    file: Annotated[str, typer.Argument(metavar="FILE")]
    out: Path = Path("runs")
    workers: Annotated[int | None, typer.Option(min=1, max=4096)] = None
    backend: Backend = Backend.local
    ray_address: str | None = None
    resume: bool = False
    keep_logs: str = "none"
    replay: Annotated[int | None, typer.Option(min=0, metavar="INDEX")] = None
    search: Objective | None = None
    rare: Annotated[str | None, typer.Option(metavar="EXPECTATION")] = None
    format: FormatOption = Format.text
    no_report: NoReportOption = False
    junit: JunitOption = None
    certificate: bool = False


@declare("results.parquet", "summary.json", "rare.json", "flight.yaml")
def command(arguments: Arguments) -> None:
    """Fly many variations of one scenario and summarise them.

    The flights run on all cores of the machine, or on a Ray cluster. If the sweep is interrupted, the
    finished flights are kept, and --resume continues the sweep. With --format json the command prints the
    summary.

    Examples:
      beaver-ftc sweep elevator-effectiveness
      beaver-ftc sweep elevator-effectiveness --search delay

    file: A sweep file, or the name of a built-in sweep.
    out: Folder for the results.
    workers: Number of parallel processes or Ray tasks. Default: one for each core.
    backend: Where the flights run: local processes, or a Ray cluster.
    ray_address: Address of the Ray cluster, e.g. auto. Default: a cluster on this machine.
    resume: Continue an interrupted sweep from its finished flights.
    keep_logs: Which flights keep a result folder: none, failed, missed, worst, all, or indices such as 3,17.
    replay: Fly only this flight again, and write its result folder as `run` does.
    search: Search for the flight with the worst value of this objective.
    certificate: Write a certificate into each kept result folder. Default of --keep-logs then: worst.
    rare: Estimate the probability that a flight misses this expectation.
    """
    if arguments.backend is Backend.local and arguments.replay is None:
        from beaver_ftc.studies.engine.processes import start_early

        start_early()
    from beaver_ftc.scenario.sweeps import load_sweep

    options, replay, format = _options(arguments), arguments.replay, arguments.format
    if arguments.rare is not None:
        _rare(load_sweep(arguments.file), arguments)
        return
    if arguments.ray_address is not None and arguments.backend is not Backend.ray:
        raise BadInput("--ray-address: allowed: only with --backend ray")

    def fly() -> "Judged":
        sweep = load_sweep(arguments.file)
        if unknown := {run for run in options.keep.runs if not 0 <= run < sweep.flights}:
            text = f"there is no flight {min(unknown)}, allowed: 0 to {sweep.flights - 1}"
            raise BadInput(f"--keep-logs: {text}")
        return _fly(sweep, options, format) if replay is None else _replay(sweep, options, replay, format)

    judged(arguments.file, format, arguments.junit, fly)


_NOT_WITH_RARE = ("search", "replay", "junit", "ray_address", "backend", "keep_logs", "certificate")


def _rare(sweep: "Sweep", arguments: Arguments) -> None:
    """Estimate the probability that an expectation is not met, with its interval, and print it. Raises
    BadInput for an option that this estimate does not use."""
    from beaver_ftc.cli.progress import progress_lines
    from beaver_ftc.studies.engine.processes import cores
    from beaver_ftc.studies.engine.study import run_into
    from beaver_ftc.studies.sweep.rare import as_text, rare_study

    defaults = Arguments(arguments.file)
    unused = [name for name in _NOT_WITH_RARE if getattr(arguments, name) != getattr(defaults, name)]
    if unused:
        raise BadInput(f"--rare and --{unused[0].replace('_', '-')} exclude each other, allowed: one of them")
    with progress_lines() as write_line:
        study = rare_study(sweep, str(arguments.rare), write_line)
        document = run_into(study, arguments.out, arguments.workers or cores())
    answer(arguments.format, document, lambda: as_text(document))


def _options(arguments: Arguments) -> "Options":
    """The options of the campaign."""
    from beaver_ftc.studies.sweep.campaign import Options

    return Options(
        out=arguments.out,
        workers=arguments.workers,
        backend=arguments.backend.value,
        address=arguments.ray_address,
        resume=arguments.resume,
        keep=_keep(arguments.keep_logs, arguments.certificate),
        report=not arguments.no_report,
        search=arguments.search.value if arguments.search else None,
        source=arguments.file,
    )


def _keep(flights: str, certified: bool) -> "Keep":
    """The flights that keep a result folder. flights: a policy, or indices with commas between them.
    certified: with a certificate; the policy `none` is then `worst`."""
    from beaver_ftc.studies.sweep.one_flight import KEEP_POLICIES, Keep

    if flights in KEEP_POLICIES:
        return Keep("worst" if certified and flights == "none" else flights, certified=certified)
    try:
        return Keep("selected", frozenset(int(index) for index in flights.split(",")), certified=certified)
    except ValueError:
        allowed = ", ".join(KEEP_POLICIES)
        raise BadInput(
            f"--keep-logs: {flights!r} is not known, allowed: {allowed}, or indices like 3,17"
        ) from None


def _fly(sweep: "Sweep", options: "Options", format: Format) -> "Judged":
    """Fly a sweep, print its summary, and return its verdict."""
    from beaver_ftc.cli.progress import sweep_progress
    from beaver_ftc.studies.sweep.campaign import named_for, run_sweep
    from beaver_ftc.studies.sweep.summary_words import summary_text, verdict

    with _stoppable() as stopped, sweep_progress(sweep.name) as progress:
        document = run_sweep(sweep, options, progress, stopped)
    document |= {"folder": str(options.out / named_for(sweep, options.search).name)}
    answer(format, document, lambda: summary_text(document, colour=sys.stdout.isatty()))
    return verdict(document)


def _replay(sweep: "Sweep", options: "Options", index: int, format: Format) -> "Judged":
    """Fly one flight of a sweep again, print its verdict, and return it."""
    from beaver_ftc.results.model import Metrics
    from beaver_ftc.results.verdict import verdict_text
    from beaver_ftc.studies.sweep.campaign import replay

    document = replay(sweep, options, index)
    metrics = Metrics.of(document)
    answer(format, document, lambda: verdict_text(metrics, document["folder"], sys.stdout.isatty()))
    return metrics.judged


@contextmanager
def _stoppable() -> Iterator[Callable[[], bool]]:
    """Yield the function that returns whether Ctrl-C or SIGTERM has asked the sweep to stop. The sweep then
    ends when its present flights have landed, or after LANDS_S; a second signal ends it at once."""
    signals: list[int] = []

    def stop(number: int, frame: Any) -> None:
        if signals:
            raise KeyboardInterrupt
        signals.append(number)
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, LANDS_S)
        complain("\nstopping: flights in the air have a second to land; once more to stop at once")

    handled = [signal.SIGINT, signal.SIGTERM, *([signal.SIGALRM] if hasattr(signal, "setitimer") else [])]
    before = {number: signal.signal(number, stop) for number in handled}
    try:
        yield lambda: bool(signals)
    except KeyboardInterrupt:
        from beaver_ftc.studies.sweep.campaign import SweepStopped

        raise SweepStopped("stopped; what had landed is kept, go on with --resume") from None
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
