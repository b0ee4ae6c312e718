"""`beaver-ftc show`: a built-in scenario or sweep, as its file has it."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import complete_names
from beaver_ftc.cli.output import emit
from beaver_ftc.documents.errors import BadInput, suggestion


def command(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="A built-in scenario or sweep.", autocompletion=complete_names),
    ],
) -> None:
    """Print a built-in scenario or sweep.

    What is printed is a file that `run` or `sweep` takes.
    """
    emit(_file(name).read_text(encoding="utf-8"))


def _file(name: str) -> Path:
    from beaver_ftc.scenario.builtin import builtin_names, builtin_path
    from beaver_ftc.scenario.sweep_loader import builtin_sweeps, resolve_sweep

    if name in builtin_names():
        return builtin_path(name)
    if name in builtin_sweeps():
        return resolve_sweep(name)
    known = [*builtin_names(), *builtin_sweeps()]
    raise BadInput(f"show: no built-in scenario or sweep {name[:100]!r}{suggestion(name, known)}")
