"""What all commands share about their output: text for people, one JSON document for machines."""

import os
import sys
from enum import StrEnum
from typing import Annotated, Any

import typer

from beaver_ftc.errors import SimulationFailed


class Format(StrEnum):
    """How a command answers on standard output."""

    text = "text"
    json = "json"


FormatOption = Annotated[Format, typer.Option("--format", help="Text for people, or one JSON document.")]


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

    emit(as_json(document))


def complain(text: str) -> None:
    """Write a line to standard error."""
    print(text, file=sys.stderr)


def _discard_stdout() -> None:
    """Keep the interpreter from failing over the same stream once more when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
