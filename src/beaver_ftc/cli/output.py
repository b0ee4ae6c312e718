"""What all commands share about their output: text for people, one JSON document for machines."""

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from beaver_ftc.documents.errors import BeaverFtcError, SimulationFailed
from beaver_ftc.documents.plain import Document


class Format(StrEnum):
    """How a command answers on standard output."""

    text = "text"
    json = "json"


# Whether this command was asked for a document, and whether it has given one.
_document = {"asked": False, "given": False}


def _remember(format: Format) -> Format:
    _document["asked"], _document["given"] = format is Format.json, False
    return format


FormatOption = Annotated[
    Format,
    typer.Option("--format", help="Text for people, or one JSON document.", callback=_remember),
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
    """What a command has found, in the form that was asked for."""
    if format is Format.json:
        emit_json(document)
    else:
        emit(text())


def complain(text: str) -> None:
    """Write a line to standard error."""
    print(text, file=sys.stderr)


def report(error: BeaverFtcError) -> int:
    """Say what went wrong, with its traceback if BEAVER_FTC_DEBUG is set; returns the exit status."""
    if os.environ.get("BEAVER_FTC_DEBUG"):
        traceback.print_exception(error)
    else:
        complain(str(error))
    return error.exit_code


def report_last(error: BeaverFtcError) -> int:
    """`report` what ends the command: who asked for a JSON document and has none gets the errors as one."""
    status = report(error)
    if _document["asked"] and not _document["given"]:
        with suppress(SimulationFailed):  # standard output that cannot be written is no second error
            emit_json({"errors": str(error).splitlines()})
    return status


def write_junit(runs: list[Document], path: Path | None) -> None:
    """The verdicts as JUnit XML, where they are asked for."""
    from beaver_ftc.results import junit

    if path is not None:
        junit.write_junit(runs, path)


def judged(what: str, format: Format, junit: Path | None, fly: Callable[[], Document]) -> NoReturn:
    """Fly what is judged as a whole, and end with its status: what fails is told in JSON and JUnit XML too.

    what: the file it is of, where no verdict came to be.
    fly: flies and answers; the verdict, as JUnit XML says it.
    """
    began = time.perf_counter()
    try:
        verdict = fly()
    except Exception as error:
        failure = failure_of(error)
        if format is Format.json:
            emit_json({"passed": False, "errors": str(failure).splitlines()})
        failed = {"scenario": what, "error": str(failure), "took_s": time.perf_counter() - began}
        write_junit([failed], junit)
        raise failure from failure.__cause__
    write_junit([verdict | {"took_s": time.perf_counter() - began}], junit)
    raise typer.Exit(0 if verdict["passed"] else 1)


def failure_of(error: Exception) -> BeaverFtcError:
    """An error of ours as it is; another as a line for the user, with the error itself as its cause."""
    if isinstance(error, BeaverFtcError):
        return error
    said = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        text = "there is not enough memory for this" + (f": {said}" if said else "")
    else:
        text = f"unexpected {type(error).__name__}: {said} (BEAVER_FTC_DEBUG=1 shows where)"
    failed = SimulationFailed(text)
    failed.__cause__ = error
    return failed


def status_of_stop(error: Exception) -> int | None:
    """The exit status where a signal stopped compiled code, whose caller sees it as a SystemError alone."""
    cause = error.__cause__ if isinstance(error, SystemError) else None
    if isinstance(cause, KeyboardInterrupt):
        return 128 + signal.SIGINT
    return cause.code if isinstance(cause, SystemExit) and isinstance(cause.code, int) else None


def _discard_stdout() -> None:
    """Keep the interpreter from failing over the same stream once more when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
