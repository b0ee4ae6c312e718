"""`beaver-ftc power`: how likely a fault is found, by every scheme at the same false-alarm rate."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import TurbulenceName, WorkersOption
from beaver_ftc.cli.output import Format, FormatOption, answer


class GridName(StrEnum):
    """The grids there are."""

    quick = "quick"
    full = "full"


class SensorsName(StrEnum):
    """The sensors there are in a grid."""

    ideal = "ideal"
    tactical_grade = "tactical-grade"


def command(
    grid: Annotated[GridName, typer.Option(help="quick: a minute of CPU; full: ten or so.")] = GridName.quick,
    schemes: Annotated[
        str | None, typer.Option(help="Comma-separated schemes beside ours; all registered ones if left out.")
    ] = None,
    sensors: Annotated[
        SensorsName | None, typer.Option(help="Only with these sensors; left out: all of the grid.")
    ] = None,
    turbulence: Annotated[
        TurbulenceName | None, typer.Option(help="Only in this air; left out: all of the grid.")
    ] = None,
    rates_alone: Annotated[
        bool,
        typer.Option(
            "--rates-alone", help="Do not show plug-ins the air as our detector sees it by the vanes."
        ),
    ] = False,
    workers: WorkersOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the results: `power` in it.")] = Path("runs"),
    format: FormatOption = Format.text,
) -> None:
    """Map how likely and how soon faults are detected.

    Over surface, magnitude, excitation, sensors and turbulence.

    Every scheme watches the same flights, at the alarm level that gives all the same false-alarm rate on the
    same healthy flights. Writes power.json, power.parquet, power.txt, and maps as PNG and SVG.

    Stopped or killed, it goes on where it was with the same command.
    """
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.engine.workers import cores
    from beaver_ftc.studies.power.shown import NAME, as_text, run_power
    from beaver_ftc.studies.power.survey import GRIDS, contenders

    names = None if schemes is None else [name.strip() for name in schemes.split(",") if name.strip()]
    chosen = contenders(names)
    with progress_bar(f"power, {grid.value} grid") as progress:
        survey = replace(GRIDS[grid].only(sensors, turbulence), vanes=not rates_alone)
        document = run_power(out, survey, chosen, workers or cores(), progress)
    folder = str(out / NAME)
    answer(format, document | {"folder": folder}, lambda: as_text(document) + f"\n\nresults: {folder}")
