"""`beaver-ftc matrix`: every fault type on every surface, beside the oracle."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    out: Annotated[Path, typer.Option(help="Folder for the results: `fault-matrix` in it.")] = Path("runs"),
    airspeed: Annotated[
        list[float] | None, typer.Option(min=30, max=55, help="Airspeed, m/s; once for each. [38, 45, 52]")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 1,
    format: FormatOption = Format.text,
) -> None:
    """Fly every fault type on every surface: detected, named, and tracked how well beside the oracle.

    Exit status 1 if a fault is named wrongly or an alarm is false.
    """
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.matrix.cases import AIRSPEEDS_MPS
    from beaver_ftc.matrix.run import NAME, run_matrix
    from beaver_ftc.matrix.text import as_text

    with progress_bar("faults") as progress:
        document = run_matrix(out, tuple(airspeed or AIRSPEEDS_MPS), workers, progress)
    folder = str(out / NAME)
    if format is Format.json:
        emit_json(document | {"folder": folder})
    else:
        emit(as_text(document) + f"\n\nresults: {folder}")
    raise typer.Exit(0 if document["passed"] else 1)
