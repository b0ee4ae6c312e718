"""The command line: one module for each command, and what commands share: options, answers and progress.

An answer is text, or one JSON document. On a terminal, a run or a study that takes longer than a second shows
a bar on standard error, and a sweep a line that is written again; elsewhere, as in a log, both print a line
from time to time. All scenarios of a command are checked before the first one flies.
"""

import contextlib
import errno
import math
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import is_dataclass, replace
from enum import StrEnum
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, get_args

import typer

from beaver_ftc.commands import SCENARIO, ScenarioArgument, WorkersOption, complete_names, listed
from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed, split_docstring
from beaver_ftc.documents.files import Document

if TYPE_CHECKING:
    from beaver_ftc.results.model import Judged
    from beaver_ftc.scenario.schema import Scenario


class Format(StrEnum):
    """How a command answers on standard output."""

    text = "text"
    json = "json"


# Whether the command must print a JSON document, and whether it has printed one.
_document = {"asked": False, "given": False}


def _remember(format: Format) -> Format:
    _document["asked"], _document["given"] = format is Format.json, False
    return format


FormatOption = Annotated[
    Format,
    typer.Option(
        "--format", help="Format of the output: text for people, or one JSON document.", callback=_remember
    ),
]


def emit(text: str) -> None:
    """Write to standard output. A reader that went away is no error; a full disk is (SimulationFailed)."""
    try:
        sys.stdout.write(text if text.endswith("\n") else text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_stdout()
    except OSError as error:
        _discard_stdout()
        raise SimulationFailed(f"cannot write standard output: {error.strerror}") from error


def emit_json(document: Any) -> None:
    """Write one JSON document to standard output."""
    from beaver_ftc.results.metrics import as_json

    _document["given"] = True
    emit(as_json(document))


def answer(format: Format, document: Any, text: Callable[[], str]) -> None:
    """Print the result of a command in the requested format."""
    if format is Format.json:
        emit_json(document)
    else:
        emit(text())


def complain(text: str) -> None:
    """Write a line to standard error."""
    print(text, file=sys.stderr)


def report(error: BeaverFtcError) -> int:
    """Print an error, with its traceback if BEAVER_FTC_DEBUG is set; returns the exit status."""
    if os.environ.get("BEAVER_FTC_DEBUG"):
        traceback.print_exception(error)
    else:
        complain(str(error))
    return error.exit_code


def report_last(error: BeaverFtcError) -> int:
    """`report` the error that ends the command. If it must print a JSON document and has printed none, the
    document has the errors."""
    status = report(error)
    if _document["asked"] and not _document["given"]:
        with suppress(SimulationFailed):  # standard output that cannot be written is no second error
            emit_json({"errors": str(error).splitlines()})
    return status


def write_junit(runs: list["Judged"], path: Path | None) -> None:
    """Write the verdicts as JUnit XML to a path, if there is one."""
    if path is not None:
        from beaver_ftc.results import junit

        junit.write_junit(runs, path)


def judged(what: str, format: Format, junit: Path | None, fly: Callable[[], "Judged"]) -> NoReturn:
    """Run a command with one verdict, and end with its exit status. An error is in JSON and JUnit XML too.

    what: name of the test suite in JUnit XML if there is no verdict.
    fly: flies, prints the answer, and returns the verdict.
    """
    from beaver_ftc.results.model import Judged

    began = time.perf_counter()
    try:
        verdict = fly()
    except Exception as error:
        failure = failure_of(error)
        if format is Format.json:
            emit_json({"passed": False, "errors": str(failure).splitlines()})
        took_s = time.perf_counter() - began
        write_junit([Judged(what, error=str(failure), took_s=took_s)], junit)
        raise failure from failure.__cause__
    write_junit([replace(verdict, took_s=time.perf_counter() - began)], junit)
    raise typer.Exit(0 if verdict.passed else 1)


def failure_of(error: Exception) -> BeaverFtcError:
    """An error of the package as it is; for any other, one with a message of one line and it as its cause."""
    if isinstance(error, BeaverFtcError):
        return error
    said = " ".join(str(error).split())
    if isinstance(error, OSError) and error.errno in (errno.ENAMETOOLONG, errno.ELOOP) and error.filename:
        return BadInput(f"{error.filename}: {str(error.strerror).lower()}, allowed: the path of a file")
    if isinstance(error, MemoryError):
        text = "there is not enough memory for this" + (f": {said}" if said else "")
    else:
        text = f"unexpected {type(error).__name__}: {said} (BEAVER_FTC_DEBUG=1 shows where)"
    failed = SimulationFailed(text)
    failed.__cause__ = error
    return failed


def status_of_stop(error: Exception) -> int | None:
    """The exit status if a signal stopped compiled code, whose caller sees only a SystemError; else None."""
    cause = error.__cause__ if isinstance(error, SystemError) else None
    if isinstance(cause, KeyboardInterrupt):
        return 128 + signal.SIGINT
    return cause.code if isinstance(cause, SystemExit) and isinstance(cause.code, int) else None


REPEATED_S = 0.01


def repeat(number: int) -> None:
    """Repeat a signal whose exception arrived where Python ignores exceptions, as in a callback of an
    import's lock. From a thread and a little later: at once it would arrive there, and be lost again.
    """
    threading.Timer(REPEATED_S, os.kill, [os.getpid(), number]).start()


def _discard_stdout() -> None:
    """Keep the interpreter from failing over the same stream once more when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


PATIENCE_S = 1.0  # before the bar on a terminal
TERMINAL_S, LOG_S = 0.2, 30.0  # time between two lines
FIRST_S = 5.0  # before the first line of a log


@contextlib.contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Yield the function that a run calls with the share that is done, 0 to 1."""
    with contextlib.ExitStack() as stack:
        begin, patience_s = (_bar, PATIENCE_S) if sys.stderr.isatty() else (_lines, FIRST_S)
        started, advance = time.monotonic(), None

        def show(done: float) -> None:
            """Begin to show progress once the run has taken longer than `patience_s`."""
            nonlocal advance
            if advance is None and time.monotonic() - started > patience_s:
                advance = begin(label, stack)
            if advance:
                advance(done)

        yield show


def _bar(label: str, stack: contextlib.ExitStack) -> Callable[[float], None]:
    from rich.console import Console
    from rich.progress import Progress

    progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
    task = progress.add_task(label, total=1.0)
    return lambda done: progress.update(task, completed=done)


def _lines(label: str, stack: contextlib.ExitStack) -> Callable[[float], None]:
    tell, started, first = stack.enter_context(told(0.0, LOG_S)), time.monotonic(), None

    def show(done: float) -> None:
        nonlocal first
        first, passed_s = done if first is None else first, time.monotonic() - started
        to_come = f", {_span((1.0 - done) / (done - first) * passed_s)} left" if done > first else ""
        if done < 1.0:
            tell(f"{label}: {done:.0%}{to_come}")

    return show


@contextlib.contextmanager
def told(terminal_s: float = 0.0, log_s: float = math.inf) -> Iterator[Callable[[str], None]]:
    """Yield the function that a study calls with a line of progress. On a terminal a line replaces the one
    before. terminal_s, log_s: least time between two lines there and elsewhere; infinite: no lines."""
    terminal = sys.stderr.isatty()
    every_s, last_s = terminal_s if terminal else log_s, -math.inf

    def tell(line: str) -> None:
        nonlocal last_s
        if math.isfinite(every_s) and time.monotonic() - last_s >= every_s:
            last_s = time.monotonic()
            _write_error(f"\r\033[K{line}" if terminal else f"{line}\n")

    try:
        yield tell
    finally:
        if terminal:
            _write_error("\r\033[K")


def _write_error(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()


@contextlib.contextmanager
def live_progress(name: str) -> Iterator[Callable[[Counter[str]], None]]:
    """Yield the function that a sweep calls with its counts (campaign.run_sweep)."""
    first, begun = None, 0.0

    def show(counts: Counter[str]) -> None:
        nonlocal first, begun
        now = time.monotonic()
        if first is None:
            first, begun = counts["done"], now
        elif now - begun >= (TERMINAL_S if sys.stderr.isatty() else LOG_S):
            tell(_counted(name, counts, (counts["done"] - first) / (now - begun)))

    with told(TERMINAL_S, LOG_S) as tell:
        yield show


def _counted(name: str, counts: Counter[str], rate: float) -> str:
    """The counts of a sweep in a line, with the time left. rate: flights per second."""
    done, total = counts["done"], counts["total"]
    to_come = f", {_span((total - done) / rate)} left" if rate > 0 else ""
    parts = [f"{name}: {done} of {total} flights, {_rate(rate)}/s{to_come}"]
    if counts["faulted"]:
        parts.append(f"detected {counts['detected'] / counts['faulted']:.1%}")
    if counts["failed"]:
        parts.append(f"{counts['failed']} not flown")
    return ", ".join(parts)


def _rate(per_s: float) -> str:
    return f"{per_s:.0f}" if per_s >= 10.0 or per_s == 0.0 else f"{per_s:.2g}"


def _span(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"


ScenariosArgument = Annotated[list[str], SCENARIO]
ResultsOption = Annotated[Path, typer.Option(help="Folder for the results.")]
NoReportOption = Annotated[
    bool, typer.Option("--no-report", help="Do not write report.html and the figures.")
]
JunitOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Also write the verdict to this file as JUnit XML, for CI."),
]
PluginOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="[NAME=]MODULE:CLASS",
        help="Register your own detector or law as NAME for this command. Without NAME: MyClass as my-class.",
    ),
]


def as_typer_reads(command: Callable[..., None], flies: bool) -> Callable[..., None]:
    """A command as typer reads it: its parameters, or the fields of the dataclass that is its only one.

    What the command's docstring says of one, `name: ...` at its end, is the help of that one. One that is not
    annotated is an option; one that is true or false a switch, off if left out. A command that flies has
    --plugin besides, whose classes are registered before it runs.
    """
    first = next(iter(signature(command).parameters.values())).annotation
    record = first if isinstance(first, type) and is_dataclass(first) else None
    own = signature(record or command).parameters
    about, helps = split_docstring(command.__doc__, own)
    parameters = [_annotated(each, helps.get(name)) for name, each in own.items()]
    if flies:
        parameters.append(Parameter("plugin", Parameter.KEYWORD_ONLY, default=None, annotation=PluginOption))

    @wraps(command)
    def called(plugin: Sequence[str] | None = None, **given: Any) -> None:
        if plugin:
            from beaver_ftc.plugins import register

            for each in plugin:
                register(each)
        command(**given) if record is None else command(record(**given))

    called.__doc__ = about
    called.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    return called


def _annotated(parameter: Parameter, help: str | None) -> Parameter:
    """A parameter as typer is to read it, with this help if any."""
    kind, given = parameter.annotation, None
    if hasattr(kind, "__metadata__"):
        kind, given = get_args(kind)
    switch = [f"--{parameter.name.replace('_', '-')}"] if kind is bool else []
    option = copy(given) or typer.Option(*switch)
    if help:
        option.help = help
    return parameter.replace(annotation=Annotated[kind, option])


def address(option: str, given: str) -> tuple[str, int]:
    """Host and port of HOST:PORT, as an option has it."""
    host, _, port = given.rpartition(":")
    if not host or not re.fullmatch("[0-9]{1,5}", port) or not 0 < int(port) < 65536:
        raise BadInput(f"{option}: {given!r} is no address, allowed: HOST:PORT with a port of 1 to 65535")
    return host, int(port)


def load_all(names: list[str]) -> list["Scenario"]:
    """The scenarios of these files or built-in names. Raises BadInput with every mistake in all of them."""
    from beaver_ftc.scenario.schema import load_scenario

    loaded: list[Scenario] = []
    mistakes: list[str] = []
    for name in names:
        try:
            loaded.append(load_scenario(name))
            check_flyable(loaded[-1], name)
        except BadInput as error:
            mistakes.append(str(error))
    for name, count in Counter(scenario.name for scenario in loaded).items():
        if count > 1:
            mistakes.append(f"two scenarios are named {name}: one result would replace the other")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def check_flyable(scenario: "Scenario", name: str) -> None:
    """Raise BadInput, in the form of any other mistake in a file, if the flight cannot be trimmed.

    The trim is kept: the flight does not search for it again."""
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.plant.conditions import find_trim
    from beaver_ftc.scenario.builtin import read_file, resolve

    try:
        find_trim(scenario)
    except BadInput as error:
        path = resolve(name)
        line = parse_document(read_file(path, name), str(path)).line(("initial",))
        raise BadInput(f"{path}:{line}: initial: {error}") from None
