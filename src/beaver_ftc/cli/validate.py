"""`beaver-ftc validate`: say what is wrong with scenario and sweep files, without flying them."""

from typing import Annotated, Any

import typer

from beaver_ftc.cli.inputs import check_flyable
from beaver_ftc.cli.output import Format, FormatOption, complain, emit, emit_json
from beaver_ftc.documents.errors import BadInput


def command(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE", help="Scenario and sweep files, or names of built-in ones.")
    ],
    format: FormatOption = Format.text,
) -> None:
    """Check scenario and sweep files.

    Every mistake is one line on standard error, FILE:LINE: key.path: what is wrong, what is allowed.

    With --format json: {"valid": ..., "files": [{"file", "valid", "errors", "warnings"}]}.
    """
    reports = [_check(file) for file in files]
    for report in reports:
        _say(report, format)
    valid = all(report["valid"] for report in reports)
    if format is Format.json:
        emit_json({"valid": valid, "files": reports})
    raise typer.Exit(0 if valid else BadInput.exit_code)


def _check(file: str) -> dict[str, Any]:
    from beaver_ftc.scenario.loader import load_scenario
    from beaver_ftc.scenario.sweep_loader import is_sweep, load_sweep

    try:
        if is_sweep(file):
            load_sweep(file)
            return {"file": file, "valid": True, "errors": [], "warnings": []}
        scenario = load_scenario(file)
        check_flyable(scenario, file)
    except BadInput as error:
        return {"file": file, "valid": False, "errors": str(error).splitlines(), "warnings": []}
    return {"file": file, "valid": True, "errors": [], "warnings": list(scenario.warnings())}


def _say(report: dict[str, Any], format: Format) -> None:
    for error in report["errors"]:
        complain(error)
    for warning in report["warnings"]:
        complain(f"{report['file']}: warning: {warning}")
    if report["valid"] and format is Format.text:
        emit(f"{report['file']}: OK")
