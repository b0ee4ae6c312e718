"""`beaver-ftc reproduce`: every case and figure of the published study, and what became of its statements."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    out: Annotated[Path, typer.Option(help="Folder for the results: `reproduction` in it.")] = Path("runs"),
    workers: Annotated[int, typer.Option(min=1, help="Processes for the sensitivity study.")] = 2,
    format: FormatOption = Format.text,
) -> None:
    """Fly the published study and judge its statements.

    Every figure, and every statement with our number and a verdict.

    Exit status 1 if a statement is not borne out.

    Stopped or killed, it goes on where it was with the same command.
    """
    import sys

    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.reproduce.run import NAME, reproduce
    from beaver_ftc.studies.reproduce.text import as_text

    with progress_bar("changes to what the paper leaves open") as progress:
        document = reproduce(out, workers, progress)
    folder = str(out / NAME)
    if format is Format.json:
        emit_json(document | {"folder": folder})
    else:
        emit(as_text(document, folder, colour=sys.stdout.isatty()))
    raise typer.Exit(0 if document["passed"] else 1)
