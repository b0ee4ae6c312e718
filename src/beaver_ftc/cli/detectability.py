"""`beaver-ftc detectability`: how small a fault is certain to be found, and what it can be taken for."""

from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json


def command(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A file, or the name of a built-in scenario.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the map, the CSV and the JSON.")] = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Survey the smallest fault that is certain to be found.

    Over speed, altitude and excitation: the smallest loss certain to be detected, and to be isolated.

    Certain: within 0.5 s and 1 s, whatever the declared uncertainty does, along the scenario's references
    scaled by 0.25 to 2; `median` where the fault strikes at half of all instants.

    Stopped or killed, it goes on where it was with the same command.
    """
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.scenario.loader import load_scenario
    from beaver_ftc.studies.detectability import document, run_survey, survey_name, text

    loaded = load_scenario(scenario)
    name = survey_name(loaded)
    with progress_bar(name) as progress:
        rows = run_survey(out, loaded, progress=progress)
    if format is Format.json:
        emit_json(document(loaded.name, rows) | {"folder": str(out / name)})
    else:
        emit(f"{text(rows)}\n{out / name}")
