"""`beaver-ftc new`: a scenario file to begin with."""

import re
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import complete_names
from beaver_ftc.cli.output import emit
from beaver_ftc.documents.errors import BadInput, SimulationFailed

_NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")  # as of a scenario
_NAME_LINE = re.compile(r"^name:.*$", re.MULTILINE)

TEMPLATE = """\
name: {name}
description: What the case shows.
duration_s: 30
initial: {{airspeed_mps: 45, altitude_m: 1828.8}}
reference:                            # body rates to follow, deg/s; `beaver-ftc list` names the signals
  q: [{{sine: {{amplitude_deg_s: 3, frequency_hz: 0.2}}}}]
faults:                               # what breaks, and when; `beaver-ftc list` names the types
  - {{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 12}}
expect:                               # what a CI job asserts; each key is optional
  detected_within_s: 0.5
  isolated_as: elevator
  no_false_alarm: true
  no_departure: true
"""


def command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the scenario, and of its file.")],
    like: Annotated[
        str | None,
        typer.Option(
            "--like", metavar="SCENARIO", help="Begin with a built-in one.", autocompletion=complete_names
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the new file; made if need be.")] = Path(),
) -> None:
    """Write NAME.yaml, a scenario to begin with.

    It flies as it is; an existing file is never replaced.
    """
    if not _NAME.fullmatch(name):
        raise BadInput(f"new: {name[:100]!r} is no name, allowed: letters, digits, - and _, at most 100")
    text = TEMPLATE.format(name=name) if like is None else _renamed(like, name)
    if out.suffix in (".yaml", ".yml") and not out.is_dir():
        says = f"{str(out)!r} is a file's name, allowed: a folder; the file in it is {name}.yaml"
        raise BadInput(f"new: --out: {says}")
    path = out / f"{name}.yaml"
    _write(path, text)
    emit(f"{path}: written; fly it with `beaver-ftc run {path}`")


def _renamed(like: str, name: str) -> str:
    from beaver_ftc.scenario.builtin import builtin_names, builtin_path, no_such

    if like not in builtin_names():
        raise BadInput(f"new: --like: {no_such(like, 'scenario')}")
    return _NAME_LINE.sub(f"name: {name}", builtin_path(like).read_text(encoding="utf-8"), count=1)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if path.exists():
            raise BadInput(f"new: {path} exists, allowed: another name") from None
        raise SimulationFailed(f"cannot write {path}: {(error.strerror or str(error)).lower()}") from error
