"""The command line: one module for each command. Here is what commands share: options, answers, errors and
the loading of scenarios.

An answer is text, or one JSON document. All scenarios of a command are checked before the first one flies.
"""

import errno
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from beaver_ftc.cli.progress import progress_bar
from beaver_ftc.commands import SCENARIO, ScenarioArgument, WorkersOption, complete_names, listed
from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.documents.files import Document

if TYPE_CHECKING:
    from beaver_ftc.results.model import Judged
    from beaver_ftc.scenario.schema import Scenario


class Format(StrEnum):
    """How a command answers on standard output."""

    text = "text"
    json = "json"


# Whether the command must print a JSON document, and whether it has printed one.
_json_document = {"required": False, "printed": False}


def _remember(format: Format) -> Format:
    """Note the format of the command, for `report_last`."""
    _json_document["required"], _json_document["printed"] = format is Format.json, False
    return format


FormatOption = Annotated[
    Format,
    typer.Option(
        "--format", help="Format of the output: text for people, or one JSON document.", callback=_remember
    ),
]


ScenariosArgument = Annotated[list[str], SCENARIO]
ResultsOption = Annotated[Path, typer.Option(help="Folder for the results.")]
NoReportOption = Annotated[
    bool, typer.Option("--no-report", help="Do not write report.html and the figures.")
]
JunitOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Also write the verdict to this file as JUnit XML, for CI."),
]


def emit(text: str) -> None:
    """Write to standard output. A reader that has closed the pipe is no error. Raises SimulationFailed if the
    text cannot be written, for example on a full disk."""
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

    _json_document["printed"] = True
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
    """Print an error; its traceback instead if BEAVER_FTC_DEBUG is set. Returns the exit status."""
    if os.environ.get("BEAVER_FTC_DEBUG"):
        traceback.print_exception(error)
    else:
        complain(str(error))
    return error.exit_code


def report_last(error: BeaverFtcError) -> int:
    """`report` the error that ends the command. If it must print a JSON document and has printed none, the
    document has the errors."""
    status = report(error)
    if _json_document["required"] and not _json_document["printed"]:
        with suppress(SimulationFailed):  # standard output that cannot be written is no second error
            emit_json({"errors": str(error).splitlines()})
    return status


def write_junit(runs: list["Judged"], path: Path | None) -> None:
    """Write the verdicts as JUnit XML to a path, if there is one."""
    if path is not None:
        from beaver_ftc.results import junit

        junit.write_junit(runs, path)


def judged(what: str, format: Format, junit: Path | None, fly: Callable[[], "Judged"]) -> NoReturn:
    """Run a command that has one verdict, and end with its exit status. An error is also written in the JSON
    document and in JUnit XML.

    what: name of the test suite in JUnit XML if there is no verdict. fly: flies, prints the answer, and
    returns the verdict.
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
    """An error of the package unchanged. Any other error becomes the cause of an error of the package, whose
    message is one line."""
    if isinstance(error, BeaverFtcError):
        return error
    reason = " ".join(str(error).split())
    if isinstance(error, OSError) and error.errno in (errno.ENAMETOOLONG, errno.ELOOP) and error.filename:
        return BadInput(f"{error.filename}: {str(error.strerror).lower()}, allowed: the path of a file")
    if isinstance(error, MemoryError):
        text = "there is not enough memory for this" + (f": {reason}" if reason else "")
    else:
        text = f"unexpected {type(error).__name__}: {reason} (BEAVER_FTC_DEBUG=1 shows where)"
    failed = SimulationFailed(text)
    failed.__cause__ = error
    return failed


def status_of_stop(error: Exception) -> int | None:
    """The exit status if a signal has stopped compiled code, whose caller receives a SystemError; None for
    other errors."""
    cause = error.__cause__ if isinstance(error, SystemError) else None
    if isinstance(cause, KeyboardInterrupt):
        return 128 + signal.SIGINT
    return cause.code if isinstance(cause, SystemExit) and isinstance(cause.code, int) else None


REPEATED_S = 0.01  # time after which a lost signal is repeated


def repeat(number: int) -> None:
    """Repeat a signal whose exception was raised where Python ignores exceptions, for example in a callback
    of an import's lock. A thread repeats it REPEATED_S later: at once, it would be lost again there."""
    threading.Timer(REPEATED_S, os.kill, [os.getpid(), number]).start()


def _discard_stdout() -> None:
    """Replace standard output by the null device, which the interpreter can flush at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def address(option: str, given: str) -> tuple[str, int]:
    """Host and port of the text HOST:PORT. option: its name, for the message of BadInput."""
    host, _, port = given.rpartition(":")
    if not host or not re.fullmatch("[0-9]{1,5}", port) or not 0 < int(port) < 65536:
        raise BadInput(f"{option}: {given!r} is no address, allowed: HOST:PORT with a port of 1 to 65535")
    return host, int(port)


def load_all(names: list[str]) -> list["Scenario"]:
    """The scenarios of these files or built-in names. Raises BadInput with a line for each mistake in any of
    them."""
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
    """Raise BadInput, with the line of `initial` in the file, if the flight cannot be trimmed. The trim that
    is found is kept for the flight."""
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.plant.conditions import find_trim
    from beaver_ftc.scenario.builtin import read_file, resolve

    try:
        find_trim(scenario)
    except BadInput as error:
        path = resolve(name)
        line = parse_document(read_file(path, name), str(path)).line(("initial",))
        raise BadInput(f"{path}:{line}: initial: {error}") from None
