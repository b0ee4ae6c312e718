"""Files before they fly: `beaver-ftc new` writes a scenario or sample logs, `validate` prints mistakes."""

import re
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import (
    Document,
    Format,
    FormatOption,
    check_flyable,
    complain,
    complete_names,
    emit,
    emit_json,
)
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plugins import required

_NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")  # of a scenario
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


def validate(
    files: Annotated[list[str], typer.Argument(metavar="FILE")], format: FormatOption = Format.text
) -> None:
    """Check scenario and sweep files, and plans of evidence.

    The command prints each mistake as one line on standard error: file, line, key, the mistake, and the
    allowed values.

    With --format json the command prints {"valid": ..., "files": [{"file", "valid", "errors", "warnings"}]}.

    Examples:
      beaver-ftc validate elevator-partial-loss fault-free

    files: Paths of scenario, sweep and plan files, or names of built-in files.
    """
    reports = [_check(file) for file in files]
    for report in reports:
        for line in (*report["errors"], *(f"{report['file']}: warning: {w}" for w in report["warnings"])):
            complain(line)
        if report["valid"] and format is Format.text:
            emit(f"{report['file']}: OK")
    valid = all(report["valid"] for report in reports)
    if format is Format.json:
        emit_json({"valid": valid, "files": reports})
    raise typer.Exit(0 if valid else BadInput.exit_code)


def _check(file: str) -> Document:
    """The report on a file: whether it is valid, its errors and warnings."""
    from beaver_ftc.scenario.builtin import has_key, is_sweep
    from beaver_ftc.scenario.schema import load_scenario

    errors: list[str] = []
    warnings: list[str] = []
    try:
        if is_sweep(file):
            from beaver_ftc.scenario.sweeps import load_sweep

            load_sweep(file)
        elif has_key(file, "plan", "requirements"):
            required("load_plan", file)(file)
        else:
            scenario = load_scenario(file)
            check_flyable(scenario, file)
            warnings = list(scenario.warnings())
    except BadInput as error:
        errors = str(error).splitlines()
    return {"file": file, "valid": not errors, "errors": errors, "warnings": warnings}


@declare(plugins=False)
def new(
    name: Annotated[str, typer.Argument(metavar="NAME")],
    like: Annotated[str | None, typer.Option(metavar="SCENARIO", autocompletion=complete_names)] = None,
    log: bool = False,
    out: Path = Path(),
) -> None:
    """Write a first scenario NAME.yaml, or sample logs.

    `run` can fly the new file without changes. The command does not replace an existing file.

    Examples:
      beaver-ftc new my-case
      beaver-ftc new my-other-case --like elevator-partial-loss
      beaver-ftc new my-logs --log

    name: Name of the scenario, and of its file.
    like: Copy this built-in scenario instead of the template.
    log: Write a folder NAME with two recorded flights and their vehicle file.
    out: Folder of the new file.
    """
    if not _NAME.fullmatch(name):
        raise BadInput(f"new: {name[:100]!r} is no name, allowed: letters, digits, - and _, at most 100")
    if log:
        _sample_logs(out / name, like)
        return
    text = TEMPLATE.format(name=name) if like is None else _renamed(like, name)
    if out.suffix in (".yaml", ".yml") and not out.is_dir():
        text = f"{str(out)!r} is a file's name, allowed: a folder; the file in it is {name}.yaml"
        raise BadInput(f"new: --out: {text}")
    path = out / f"{name}.yaml"
    _write(path, text)
    emit(f"{path}: written; fly it with `beaver-ftc run {path}`")


def _sample_logs(folder: Path, like: str | None) -> None:
    """Write the sample logs into a folder. like: the option, which --log excludes."""
    if like is not None:
        raise BadInput("new: --like and --log are given, allowed: one of them")
    for name, text in required("sample_logs", "new --log")().items():
        _write(folder / name, text)
    emit(f"{folder}: written; `beaver-ftc identify --check {folder}/healthy.csv` says what it is")


def _renamed(like: str, name: str) -> str:
    """The text of a built-in scenario, with another name."""
    from beaver_ftc.scenario.builtin import builtin_names, builtin_path, no_such

    if like not in builtin_names():
        raise BadInput(f"new: --like: {no_such(like, 'scenario')}")
    return _NAME_LINE.sub(f"name: {name}", builtin_path(like).read_text(encoding="utf-8"), count=1)


def _write(path: Path, text: str) -> None:
    """Write a new file. Raises BadInput if it exists."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        if path.exists():
            raise BadInput(f"new: {path} exists, allowed: another name") from None
        raise SimulationFailed(f"cannot write {path}: {(error.strerror or str(error)).lower()}") from error
